"""ROS 2 messages as NumPy records: a layout compiled from the message definition.

A CDR message is a C structure whose strings and sequences vary in length. For one set of lengths
it is a fixed record, so a whole run of messages is one NumPy view. The lengths are read from the
first message and checked in all others; messages that differ get a layout of their own.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import SchemaError

_PRIMITIVES = {
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
_FIELD = re.compile(
    r"^(?P<type>[A-Za-z]\w*(?:/\w+)*)(?:<=\d+)?"
    r"(?P<array>\[(?:<=)?(?P<count>\d*)\])?\s+(?P<name>[A-Za-z]\w*)(?P<rest>.*)$"
)
_HEADER_SIZE = 4  # bytes of encapsulation before the message
_MAX_LAYOUTS = 64  # of one run of messages

CDR_LE = b"\x00\x01\x00\x00"


@dataclass(frozen=True)
class Field:
    """One flattened member: `count` is None for a scalar, 0 for a sequence of any length."""

    path: str
    type: str
    count: int | None


@cache
def parse_ros2msg(name: str, text: str) -> tuple[Field, ...]:
    """Flatten a ``ros2msg`` definition into primitive members with dotted paths.

    Raises
    ------
    SchemaError
        On a type that is not defined in the text, or a sequence of structures.
    """
    definitions: dict[str, list[tuple[str, str, int | None]]] = {}
    current = definitions.setdefault(_full(name), [])
    for raw in text.splitlines():
        line = raw.split("#", 1)[0].strip()
        if raw.startswith("====") or not line:
            continue
        if line.startswith("MSG:"):
            current = definitions.setdefault(_full(line[4:].strip()), [])
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

    def flatten(kind: str, prefix: str) -> Iterator[Field]:
        for type_name, member, count in definitions[kind]:
            path = f"{prefix}{member}"
            if type_name in _PRIMITIVES or type_name in ("string", "wstring"):
                yield Field(path, type_name, count)
                continue
            full = _resolve(type_name, kind, definitions)
            if full is None:
                raise SchemaError(f"schema {name}: type {type_name} of {path} is not defined")
            if count is None:
                yield from flatten(full, f"{path}.")
            elif count > 0:
                for i in range(count):
                    yield from flatten(full, f"{path}.{i}.")
            else:
                raise SchemaError(f"schema {name}: {path} is a sequence of structures")

    return tuple(flatten(_full(name), ""))


def _full(name: str) -> str:
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[-1]}" if len(parts) > 1 else name


def _resolve(
    name: str, inside: str, known: dict[str, list[tuple[str, str, int | None]]]
) -> str | None:
    package = inside.split("/")[0]
    for candidate in (_full(name), f"{package}/msg/{name}", f"std_msgs/msg/{name}"):
        if candidate in known:
            return candidate
    return None


@dataclass(frozen=True)
class Layout:
    """A message with all its lengths fixed.

    Attributes
    ----------
    dtype : numpy dtype
        Members by dotted path, encapsulation included; texts are arrays of bytes.
    lengths : dict of str to int
        Value of every length word, by its name in `dtype`.
    """

    dtype: np.dtype[np.void]
    lengths: dict[str, int]


def _lay_out(
    fields: tuple[Field, ...],
    length_of: Callable[[str, int], int],
    order: str = "<",
    itemsize: int | None = None,
) -> Layout:
    """Place all members with CDR alignment; `length_of(path, offset)` gives each length."""
    names: list[str] = []
    formats: list[object] = []
    offsets: list[int] = []
    lengths: dict[str, int] = {}
    at = 0

    def place(name: str, code: str, count: int | None) -> int:
        nonlocal at
        size = np.dtype(code).itemsize
        at = -(-at // size) * size
        offset = at + _HEADER_SIZE
        names.append(name)
        formats.append(order + code if count is None else (order + code, (count,)))
        offsets.append(offset)
        at += size * (1 if count is None else count)
        return offset

    for field in fields:
        if field.type == "wstring" or (field.type == "string" and field.count is not None):
            raise SchemaError(
                f"member {field.path}: arrays of strings and wide strings are not read"
            )
        code = "u1" if field.type == "string" else _PRIMITIVES[field.type]
        count = field.count
        if field.type == "string" or count == 0:
            word = f"{field.path}#length"
            count = length_of(field.path, place(word, "u4", None))
            lengths[word] = count
            if count == 0:
                continue
        place(field.path, code, count)
    size = at + _HEADER_SIZE
    if itemsize is not None and size > itemsize:
        raise SchemaError(f"a message of {itemsize} bytes ends before its {size} bytes of members")
    spec = {
        "names": names,
        "formats": formats,
        "offsets": offsets,
        "itemsize": size if itemsize is None else itemsize,
    }
    return Layout(np.dtype(spec), lengths)  # type: ignore[call-overload]


def _layout_of(fields: tuple[Field, ...], sample: NDArray[np.uint8]) -> Layout:
    encapsulation = bytes(sample[:2])
    if encapsulation not in (b"\x00\x00", b"\x00\x01"):
        raise SchemaError(f"CDR encapsulation {encapsulation.hex()} is not plain CDR")
    order = ">" if encapsulation[1] == 0 else "<"

    def length_of(path: str, offset: int) -> int:
        if offset + 4 > len(sample):
            raise SchemaError(f"a message of {len(sample)} bytes ends before {path}")
        length = int(sample[offset : offset + 4].view(order + "u4")[0])
        if offset + 4 + length > len(sample):
            raise SchemaError(f"{path} claims {length} items in a message of {len(sample)} bytes")
        return length

    return _lay_out(fields, length_of, order, len(sample))


def decode(
    fields: tuple[Field, ...], messages: NDArray[np.uint8]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.void]]]:
    """View messages of one size as records.

    Parameters
    ----------
    fields : tuple of Field
    messages : ndarray of uint8, shape (n, size)

    Yields
    ------
    rows : ndarray of int
        Which messages.
    records : structured ndarray
        Members by dotted path.

    Raises
    ------
    SchemaError
        On bytes that cannot hold the members.
    """
    rows = np.arange(len(messages))
    for _ in range(_MAX_LAYOUTS):
        if not len(rows):
            return
        layout = _layout_of(fields, messages[rows[0]])
        records = np.ascontiguousarray(messages[rows]).view(layout.dtype)[:, 0]
        fits = np.ones(len(rows), bool)
        for word, length in layout.lengths.items():
            fits &= records[word] == length
        yield rows[fits], records[fits]
        rows = rows[~fits]
    raise SchemaError(f"more than {_MAX_LAYOUTS} different lengths of texts in one run of messages")


def record_template(
    fields: tuple[Field, ...], texts: dict[str, str]
) -> tuple[np.dtype[np.void], NDArray[np.void]]:
    """Record type for writing messages with constant texts, and one record with them filled in."""
    encoded = {path: text.encode() + b"\0" for path, text in texts.items()}
    layout = _lay_out(fields, lambda path, _: len(encoded.get(path, b"\0")))
    buffer = np.zeros(layout.dtype.itemsize, np.uint8)
    buffer[:_HEADER_SIZE] = np.frombuffer(CDR_LE, np.uint8)
    record = buffer.view(layout.dtype)
    for word, length in layout.lengths.items():
        record[word] = length
        path = word.removesuffix("#length")
        record[path] = np.frombuffer(encoded.get(path, b"\0"), np.uint8)
    return layout.dtype, record
