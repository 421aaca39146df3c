"""ROS messages as strided NumPy views: a layout compiled from the definition and one message.

A CDR message is a C structure whose texts and sequences vary in length. For one set of lengths
it is a fixed record, so a whole run of messages is one NumPy view. The lengths are read from one
message and checked in all others; messages that differ get a layout of their own. ROS 1 messages
are the same without alignment and encapsulation.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import SchemaError
from navgrade.logs.container.definitions import PRIMITIVES, STRINGS, Member, flat
from navgrade.logs.container.source import Bytes

CDR_LE = b"\x00\x01\x00\x00"
NO_TIME = np.iinfo(np.int64).min  # ns: an element that is not there
_MAX_LAYOUTS = 64  # tried on all messages of a run; then each message gets its own
_REFUSED = {
    2: "parameter-list CDR",
    3: "parameter-list CDR",
    6: "XCDR2",
    7: "XCDR2",
    8: "delimited XCDR2",
    9: "delimited XCDR2",
    10: "parameter-list XCDR2",
    11: "parameter-list XCDR2",
}


class Rows(NamedTuple):
    """Messages of one size at equal distances in a buffer."""

    buffer: Bytes
    first: int
    stride: int
    number: int
    size: int

    def view(self, offset: int, code: str, width: int | None = None) -> NDArray[Any]:
        """Numbers at `offset` of each message, shape (number,) or (number, width)."""
        dtype = np.dtype(code)
        shape: tuple[int, ...] = (self.number,)
        strides: tuple[int, ...] = (self.stride,)
        if width is not None:
            shape += (width,)
            strides += (dtype.itemsize,)
        return np.ndarray(shape, dtype, self.buffer, self.first + offset, strides)

    def message(self, index: int) -> Bytes:
        """Bytes of one message."""
        start = self.first + index * self.stride
        return self.buffer[start : start + self.size]


class _Leaf(NamedTuple):
    path: str
    code: str
    number: int | None
    offset: int
    is_length: bool


def _leaves(
    members: Sequence[Member], length_of: Callable[[str, int], int], start: int, *, aligned: bool
) -> Iterator[_Leaf]:
    """All numbers of a message and where they stand; `length_of(path, offset)` gives lengths."""
    at = 0

    def place(path: str, code: str, count: int | None = None, *, is_length: bool = False) -> _Leaf:
        nonlocal at
        size = np.dtype(code).itemsize
        if aligned:
            at = -(-at // size) * size
        leaf = _Leaf(path, code, count, at + start, is_length)
        at += size * (1 if count is None else count)
        return leaf

    def length(path: str) -> Generator[_Leaf, None, int]:
        word = place(path, "u4", is_length=True)
        yield word
        return length_of(path, word.offset)

    def walk(members: Sequence[Member], indices: tuple[int, ...]) -> Iterator[_Leaf]:
        for member in members:
            path = _indexed(member.path, indices)
            count = member.count
            if count == 0:
                count = yield from length(path)
            if member.type in PRIMITIVES:
                if count != 0:
                    yield place(path, PRIMITIVES[member.type], count)
                continue
            if not aligned and member.type not in STRINGS and not any(flat(member.members)):
                continue
            for i in range(1 if count is None else count):
                here = path if count is None else f"{path}.{i}"
                if member.type == "string":
                    characters = yield from length(here)
                    if characters:
                        yield place(here, "u1", characters)
                elif member.type == "wstring":
                    raise SchemaError(f"member {path}: wide strings are not read")
                elif not member.members:
                    yield place(here, "u1")  # CDR has no structure of no bytes
                else:
                    yield from walk(member.members, indices if count is None else (*indices, i))

    yield from walk(members, ())


def _indexed(path: str, indices: tuple[int, ...]) -> str:
    for index in indices:
        path = path.replace("#", str(index), 1)
    return path


class _Wanted(NamedTuple):
    """One path asked for: its leaves in order, each whole (None) or one element of it."""

    path: str
    kind: str  # "float", "int", "bool", "text" or "time"
    parts: tuple[tuple[str, int | None], ...]
    width: int | None

    def empty(self, count: int) -> NDArray[Any]:
        dtype = {"float": np.float64, "bool": np.bool_, "text": np.object_}.get(self.kind, np.int64)
        return np.empty(count if self.width is None else (count, self.width), dtype)


_VECTORS = (["x", "y", "z"], ["x", "y", "z", "w"], ["x", "y"])
_KINDS = {"f": "float", "?": "bool"}


def _resolve(members: tuple[Member, ...], path: str) -> _Wanted:
    """Find what a path means.

    Raises
    ------
    SchemaError
        When the message has no such member, or it is no number, text, time or vector.
    """
    parts = path.split(".")
    level: Sequence[Member] = members
    here = ""
    while True:
        member = next((m for m in level if m.name == parts[0]), None)
        if member is None:
            inside = f" in {here}" if here else ""
            raise SchemaError(
                f"there is no {parts[0]}{inside}; there is {', '.join(m.name for m in level)}"
            )
        here = f"{here}.{parts[0]}" if here else parts[0]
        parts = parts[1:]
        element = None
        if member.count is not None and parts and parts[0].isdigit():
            element = int(parts[0])
            if member.count and element >= member.count:
                raise SchemaError(f"{here} has {member.count} elements, there is no {element}")
            parts = parts[1:]
        if member.type in PRIMITIVES or member.type in STRINGS:
            return _leaf(member, path, here, element, parts)
        if member.count is not None:
            if element is None:
                raise SchemaError(f"{here} is an array of structures; ask for one, {here}.0")
            here = f"{here}.{element}"
        level = member.members
        if not parts:
            return _structure(level, path, here)


def _leaf(member: Member, path: str, here: str, element: int | None, rest: list[str]) -> _Wanted:
    if rest:
        raise SchemaError(f"{here} is a {member.type}, it has no {'.'.join(rest)}")
    if member.count == 0 and element is None:
        raise SchemaError(f"{here} is a sequence of any length; ask for one element, {here}.0")
    if member.type in STRINGS:
        if member.count is not None and element is None:
            raise SchemaError(f"{here} is an array of texts; ask for one, {here}.0")
        return _Wanted(path, "text", ((path, None),), None)
    kind = _KINDS.get(PRIMITIVES[member.type][0], "int")
    width = member.count if element is None else None
    return _Wanted(path, kind, ((here, element),), width)


def _structure(members: Sequence[Member], path: str, here: str) -> _Wanted:
    names = [m.name for m in members]
    numbers = all(m.type in PRIMITIVES and m.count is None for m in members)
    if numbers and names == ["sec", "nanosec"]:
        return _Wanted(path, "time", tuple((f"{here}.{n}", None) for n in names), None)
    if numbers and names in _VECTORS:
        kind = _KINDS.get(PRIMITIVES[members[0].type][0], "int")
        return _Wanted(path, kind, tuple((f"{here}.{n}", None) for n in names), len(names))
    raise SchemaError(f"{here} is a structure of {', '.join(names)}; ask for one of them")


class _Piece(NamedTuple):
    """A stretch of equal numbers in each message, and the columns it fills."""

    offset: int
    code: str
    width: int | None
    column: int | None


@dataclass(frozen=True)
class _Layout:
    """Where the wanted members stand in messages with these lengths."""

    guards: tuple[tuple[int, str, int], ...]
    pieces: tuple[tuple[_Piece, ...], ...]
    end: int

    def fits(self, rows: Rows) -> NDArray[np.bool_] | None:
        """Which messages have these lengths; None when none can."""
        if rows.size < self.end:
            return None
        good = np.ones(rows.number, bool)
        for offset, code, value in self.guards:
            good &= rows.view(offset, code) == value
        return good


class Plan:
    """Reads chosen members of the messages of one definition.

    Parameters
    ----------
    members : tuple of Member
    paths : sequence of str
        See `McapFile.columns`.
    start : int
        Bytes before a message in its row.
    encapsulated : bool
        CDR; False for ROS 1.
    """

    def __init__(
        self, members: tuple[Member, ...], paths: Sequence[str], *, start: int, encapsulated: bool
    ) -> None:
        self._start = start
        self._members = members
        self._encapsulated = encapsulated
        self._wanted = [_resolve(members, path) for path in paths]
        self._last: _Layout | None = None

    def columns(self, rows: Rows) -> list[NDArray[Any]]:
        """One array a path.

        Raises
        ------
        SchemaError
            On bytes that cannot hold the members.
        """
        out = [wanted.empty(rows.number) for wanted in self._wanted]
        layout = self._last
        fits = None if layout is None else layout.fits(rows)
        if layout is not None and fits is not None and fits.all():
            self._fill(out, rows, layout, slice(None))
            return out
        rest = np.arange(rows.number)
        tried = 0
        while len(rest):
            layout = self._compile(rows.message(int(rest[0])))
            tried += 1
            fits = layout.fits(rows)
            assert fits is not None  # it was made from one of them
            if tried > _MAX_LAYOUTS:
                part, rest = rest[:1], rest[1:]
            else:
                part, rest = rest[fits[rest]], rest[~fits[rest]]
            self._fill(out, rows, layout, slice(None) if len(part) == rows.number else part)
        self._last = layout
        return out

    def _fill(
        self, out: list[NDArray[Any]], rows: Rows, layout: _Layout, at: slice | NDArray[np.intp]
    ) -> None:
        for wanted, column, pieces in zip(self._wanted, out, layout.pieces, strict=True):
            if wanted.kind == "text":
                column[at] = _texts(rows, pieces, at)
            elif not pieces:
                if wanted.kind not in ("float", "time"):
                    raise SchemaError(f"a message has no {wanted.path}")
                column[at] = np.nan if wanted.kind == "float" else NO_TIME
            elif wanted.kind == "time":
                seconds, nanoseconds = (rows.view(p.offset, p.code)[at] for p in pieces)
                column[at] = seconds.astype(np.int64) * 1_000_000_000 + nanoseconds
            else:
                for piece in pieces:
                    values = rows.view(piece.offset, piece.code, piece.width)[at]
                    if piece.column is None:
                        column[at] = values
                    else:
                        column[at, piece.column : piece.column + (piece.width or 1)] = values

    def _compile(self, sample: Bytes) -> _Layout:
        order, start, size = "<", self._start, len(sample) - self._start
        guards: list[tuple[int, str, int]] = []
        if self._encapsulated:
            kind = sample[start : start + 2]
            order = _byte_order(kind)
            guards.append((start, "<u2", int(kind.view("<u2")[0])))
            start += len(CDR_LE)

        def length_of(path: str, offset: int) -> int:
            if offset + 4 > len(sample):
                raise SchemaError(
                    f"a message of {len(sample) - self._start} bytes ends before {path}"
                )
            length = int(sample[offset : offset + 4].view(order + "u4")[0])
            if offset + 4 + length > len(sample):
                raise SchemaError(f"{path} claims {length} items in a message of {size} bytes")
            return length

        missing = {leaf for wanted in self._wanted for leaf, _ in wanted.parts}
        found: dict[str, _Leaf] = {}
        end = start
        for leaf in _leaves(self._members, length_of, start, aligned=self._encapsulated):
            number = 1 if leaf.number is None else leaf.number
            end = leaf.offset + np.dtype(leaf.code).itemsize * number
            if end > len(sample):
                raise SchemaError(
                    f"a message of {len(sample) - self._start} bytes ends before {leaf.path}"
                )
            if leaf.is_length:
                guards.append((leaf.offset, order + "u4", length_of(leaf.path, leaf.offset)))
            elif leaf.path in missing:
                found[leaf.path] = leaf
                missing.remove(leaf.path)
                if not missing:
                    break
        pieces = tuple(_pieces(wanted, found, order) for wanted in self._wanted)
        return _Layout(tuple(guards), pieces, end)


def _byte_order(encapsulation: Bytes) -> str:
    if len(encapsulation) < 2:
        raise SchemaError("a message is too short for CDR")
    kind = int.from_bytes(encapsulation.tobytes(), "big")
    if kind > 1:
        what = f", it is {_REFUSED[kind]}" if kind in _REFUSED else ""
        raise SchemaError(
            f"CDR encapsulation {kind:04x} is not plain CDR{what}; record or "
            "convert the log with plain CDR (XCDR1)"
        )
    return "<" if kind else ">"


def _pieces(wanted: _Wanted, found: Mapping[str, _Leaf], order: str) -> tuple[_Piece, ...]:
    """Views that fill a column; none where the message is too short to have it."""
    pieces: list[_Piece] = []
    for column, (path, element) in enumerate(wanted.parts):
        leaf = found.get(path)
        if leaf is None:
            return ()
        size = np.dtype(leaf.code).itemsize
        if element is not None:
            if leaf.number is None or element >= leaf.number:
                return ()
            pieces.append(_Piece(leaf.offset + element * size, order + leaf.code, None, None))
        elif len(wanted.parts) == 1 or wanted.kind == "time":
            pieces.append(_Piece(leaf.offset, order + leaf.code, leaf.number, None))
        else:
            last = pieces[-1] if pieces else None
            if last and last.offset + (last.width or 1) * size == leaf.offset:
                pieces[-1] = last._replace(width=(last.width or 1) + 1)
            else:
                pieces.append(_Piece(leaf.offset, order + leaf.code, 1, column))
    return tuple(pieces)


def _texts(
    rows: Rows, pieces: tuple[_Piece, ...], at: slice | NDArray[np.intp]
) -> NDArray[np.object_]:
    if not pieces:
        count = rows.number if isinstance(at, slice) else len(at)
        return np.full(count, "", np.object_)
    raw = np.ascontiguousarray(rows.view(pieces[0].offset, "u1", pieces[0].width)[at])
    width = raw.shape[1]
    names, which = np.unique(raw.view(f"V{width}")[:, 0], return_inverse=True)
    decoded = [name.tobytes().rstrip(b"\0").decode(errors="replace") for name in names]
    return np.array(decoded, np.object_)[which]


def record_template(
    members: tuple[Member, ...],
    texts: Mapping[str, str],
    counts: Mapping[str, int] | None = None,
) -> tuple[np.dtype[np.void], NDArray[np.void]]:
    """Record type for writing CDR messages with constant texts, and one record to start from.

    Parameters
    ----------
    members : tuple of Member
    texts : mapping of str to str
        By path; a text left out is empty.
    counts : mapping of str to int, optional
        Lengths of sequences, by path; a sequence left out is empty.
    """
    encoded = {path: text.encode() + b"\0" for path, text in texts.items()}
    text_paths = {m.path for m in flat(members) if m.type in STRINGS}
    lengths: dict[int, int] = {}

    def length_of(path: str, offset: int) -> int:
        generic = ".".join("#" if part.isdigit() else part for part in path.split("."))
        if generic in text_paths:
            lengths[offset] = len(encoded.get(path, b"\0"))
        else:
            lengths[offset] = (counts or {}).get(path, 0)
        return lengths[offset]

    leaves = list(_leaves(members, length_of, len(CDR_LE), aligned=True))
    last = leaves[-1]
    size = last.offset + np.dtype(last.code).itemsize * (1 if last.number is None else last.number)
    named = [leaf for leaf in leaves if not leaf.is_length]
    dtype = np.dtype(
        {
            "names": [leaf.path for leaf in named],
            "formats": [
                "<" + leaf.code if leaf.number is None else ("<" + leaf.code, (leaf.number,))
                for leaf in named
            ],
            "offsets": [leaf.offset for leaf in named],
            "itemsize": size,
        }
    )
    buffer = np.zeros(size, np.uint8)
    buffer[: len(CDR_LE)] = np.frombuffer(CDR_LE, np.uint8)
    for offset, length in lengths.items():
        buffer[offset : offset + 4].view("<u4")[0] = length
    record = buffer.view(dtype)
    for leaf in named:
        generic = ".".join("#" if part.isdigit() else part for part in leaf.path.split("."))
        if generic in text_paths:
            record[leaf.path] = np.frombuffer(encoded.get(leaf.path, b"\0"), np.uint8)
    return dtype, record
