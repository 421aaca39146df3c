"""Message definitions as trees of members."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from navgrade.errors import SchemaError

PRIMITIVES = {
    "bool": "?",
    "byte": "u1",
    "char": "u1",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "int64": "i8",
    "uint64": "u8",
    "float32": "f4",
    "float64": "f8",
}
STRINGS = ("string", "wstring")
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z]\w*(?:/\w+)*)(?:<=\d+)?"
    r"(?P<array>\[(?:<=)?(?P<count>\d*)\])?\s+(?P<name>[A-Za-z]\w*)(?P<rest>.*)$"
)
_MAX_MEMBERS = 10_000
_ROS1_TIMES = {
    "time": (("sec", "uint32"), ("nanosec", "uint32")),
    "duration": (("sec", "int32"), ("nanosec", "int32")),
}


@dataclass(frozen=True)
class Member:
    """A member of a message.

    Attributes
    ----------
    path : str
        Dotted, from the message down; ``#`` stands for the index of an array of structures.
    type : str
        A primitive, ``string``, or the full name of a structure.
    count : int or None
        None for a single one, 0 for a sequence of any length.
    members : tuple of Member
        Of a structure.
    """

    path: str
    type: str
    count: int | None
    members: tuple[Member, ...] = ()

    @property
    def name(self) -> str:
        """Last part of the path."""
        return self.path.rpartition(".")[2]


def flat(members: tuple[Member, ...]) -> Iterator[Member]:
    """All members that are not structures, in order."""
    for member in members:
        if member.type in PRIMITIVES or member.type in STRINGS:
            yield member
        else:
            yield from flat(member.members)


@cache
def parse_definition(name: str, text: str) -> tuple[Member, ...]:
    """Parse a ``ros2msg`` or ``ros1msg`` definition.

    Raises
    ------
    SchemaError
        On a line that is not understood or a type that is not defined in the text.
    """
    definitions: dict[str, list[tuple[str, str, int | None]]] = {}
    current = definitions.setdefault(full_name(name), [])
    for raw in text.splitlines():
        line = raw.split("#", 1)[0].strip()
        if raw.startswith("====") or not line:
            continue
        if line.startswith("MSG:"):
            current = definitions.setdefault(full_name(line[4:].strip()), [])
            continue
        match = _FIELD.match(line)
        if match is None:
            raise SchemaError(f"schema {name}: line {raw!r} is not understood")
        if match["rest"].lstrip().startswith("="):  # a constant
            continue
        count = None
        if match["array"] is not None:
            count = int(match["count"]) if match["count"] and "<=" not in match["array"] else 0
        current.append((match["type"], match["name"], count))

    total = 0

    def resolve(kind: str, prefix: str, inside: tuple[str, ...]) -> Iterator[Member]:
        nonlocal total
        for type_name, member, count in definitions[kind]:
            total += 1
            if total > _MAX_MEMBERS:
                raise SchemaError(f"schema {name} has more than {_MAX_MEMBERS} members")
            path = f"{prefix}{member}"
            if type_name in PRIMITIVES or type_name in STRINGS:
                yield Member(path, type_name, count)
                continue
            below = f"{path}." if count is None else f"{path}.#."
            if type_name in _ROS1_TIMES and not any(
                n in definitions for n in _candidates(type_name, kind)
            ):
                parts = tuple(Member(below + part, t, None) for part, t in _ROS1_TIMES[type_name])
                yield Member(path, type_name, count, parts)
                continue
            full = next((n for n in _candidates(type_name, kind) if n in definitions), None)
            if full is None:
                raise SchemaError(f"schema {name}: type {type_name} of {path} is not defined")
            if full in inside:
                raise SchemaError(f"schema {name}: {full} contains itself")
            yield Member(path, full, count, tuple(resolve(full, below, (*inside, full))))

    top = full_name(name)
    return tuple(resolve(top, "", (top,)))


def full_name(name: str) -> str:
    """``pkg/msg/Type`` of ``pkg/Type``."""
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[-1]}" if len(parts) > 1 else name


def _candidates(name: str, inside: str) -> tuple[str, str, str]:
    package = inside.split("/")[0]
    return full_name(name), f"{package}/msg/{name}", f"std_msgs/msg/{name}"
