"""Recordings of vendors' messages: their definitions, encoded by other people's software."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from tests.navgrade.logmaking import Channel

DEFINITIONS = Path(__file__).parent / "definitions"
_LINE = "=" * 80
_STANDARD = get_typestore(Stores.ROS2_HUMBLE)


def own_text(name: str, variant: str = "") -> str | None:
    """A vendor's definition of a type, without those of its members."""
    package, _, short = name.split("/")
    path = DEFINITIONS / package / f"{short}{variant}.msg"
    return path.read_text() if path.exists() else None


def parts(name: str, variant: str = "") -> dict[str, str]:
    """Definitions of a type and of all it needs, by name; as a recorder puts them together."""
    text = own_text(name, variant)
    if text is None:
        first, *others = _STANDARD.generate_msgdef(name, ros_version=2)[0].split(f"{_LINE}\nMSG: ")
        found = {name: first}
        for other in others:
            head, body = other.split("\n", 1)
            package, short = head.split("/")
            found[f"{package}/msg/{short}"] = body
        return found
    found = {name: text}
    package = name.split("/")[0]
    for kind in re.findall(r"^([A-Za-z]\w*(?:/\w+)?)(?:\[\d*\])? \w+", text, re.MULTILINE):
        full = kind.replace("/", "/msg/") if "/" in kind else f"{package}/msg/{kind}"
        if "/" in kind or own_text(full) is not None:
            found |= parts(full)
    return found


def definition(name: str, variant: str = "") -> str:
    """The definition as it stands in a log."""
    first, *others = parts(name, variant).items()
    sections = [first[1]]
    for full, text in others:
        sections.append(f"MSG: {full.replace('/msg/', '/')}\n{text}")
    return f"{_LINE}\n".join(section.rstrip("\n") + "\n" for section in sections)


def types(name: str, variant: str = "") -> Typestore:
    """The types of a definition, ready to be filled."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    new = {}
    for full in parts(name, variant):
        text = own_text(full, variant if full == name else "")
        if text is not None:
            new.update(get_types_from_msg(text, full))
    store.register(new)
    return store


def filled(store: Typestore, name: str, values: Mapping[str, Any]) -> Any:
    """A message with these members, by dotted path or as a whole; all others are zero or empty."""
    members = {}
    for member, (node, kind) in store.fielddefs[name][1]:
        inside = {
            path.removeprefix(f"{member}."): value
            for path, value in values.items()
            if path.startswith(f"{member}.")
        }
        members[member] = _member(store, node, kind, values.get(member), inside)
    unknown = {path.split(".")[0] for path in values} - set(members)
    assert not unknown, f"{name} has no {unknown}"
    return store.types[name](**members)


def _member(store: Typestore, node: Nodetype, kind: Any, value: Any, inside: Any) -> Any:
    if node == Nodetype.NAME:
        if isinstance(value, int | np.integer):  # a time, ns
            inside = dict(zip(("sec", "nanosec"), divmod(int(value), 1_000_000_000), strict=True))
        elif value is not None:  # a vector
            inside = dict(zip("xyzw", map(float, value), strict=False))
        return filled(store, kind, inside)
    if node == Nodetype.BASE:
        if kind[0] == "string":
            return value or ""
        return (float if "float" in kind[0] else bool if kind[0] == "bool" else int)(value or 0)
    (inner, inner_kind), count = kind
    if inner == Nodetype.NAME:
        return [filled(store, inner_kind, each) for each in value or ()]
    return np.asarray([0] * count if value is None else value, inner_kind[0])


def vendor_channel(
    topic: str,
    name: str,
    rows: Iterable[Mapping[str, Any]],
    log_ns: Sequence[int] | np.ndarray,
    variant: str = "",
) -> Channel:
    """A topic as a ROS 2 recorder would have written it; a row holds members by dotted path."""
    store = types(name, variant)
    messages = [bytes(store.serialize_cdr(filled(store, name, row), name)) for row in rows]
    return Channel(topic, name, definition(name, variant), messages, np.asarray(log_ns).tolist())
