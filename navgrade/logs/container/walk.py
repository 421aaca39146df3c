"""The records of a file one after the other, whatever its condition."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import ChunkIndex

from navgrade.logs.container.chunks import (
    COMPRESSIONS,
    HEAD,
    MAX_CHUNK,
    RECORD,
    ChunkHead,
    whole_records,
)
from navgrade.logs.container.source import Source, read_at
from navgrade.logs.container.summary import MAGIC

_HEAD = 64  # bytes read to see what a record is
_LOOSE = 1 << 20  # bytes of messages outside chunks taken at once
_SMALL = 1 << 24  # bytes read of a schema, channel or metadata record
_SEARCH = 1 << 20
_HEAD_OF_ATTACHMENT = 1 << 12
_CHUNK_LIKE = re.compile(rb"\x06.{5}\x00\x00\x00.{20}\x00{4}", re.DOTALL)
_IN_DATA = {
    Opcode.HEADER,
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.MESSAGE,
    Opcode.CHUNK,
    Opcode.MESSAGE_INDEX,
    Opcode.ATTACHMENT,
    Opcode.METADATA,
    Opcode.DATA_END,
}
_ENDS = "the file ends early, it was cut off or is still being written"


@dataclass(frozen=True)
class Issue:
    """A defect of the file and what it cost.

    Attributes
    ----------
    offset : int
        Byte in the file.
    kind : str
        ``cut`` (the file ends early), ``chunk``, ``compression`` (not known), ``bomb`` (claims an
        absurd size), ``record``, ``checksum`` (of all the data), ``summary``, ``channel``.
    text : str
    messages : int or None
        How many were lost, of all topics, where the file still tells.
    start_ns, end_ns : int or None
        Log time span of what was lost, where known.
    """

    offset: int
    kind: str
    text: str
    messages: int | None = None
    start_ns: int | None = None
    end_ns: int | None = None


class Stretch(NamedTuple):
    """A chunk's content, or message records outside chunks: bytes of the file."""

    offset: int
    length: int
    size: int  # uncompressed
    loose: bool
    cut: bool
    start_ns: int | None
    end_ns: int | None


class Small(NamedTuple):
    """A record that holds no message; of an attachment only the beginning of its content."""

    offset: int
    opcode: int
    content: bytes
    length: int


@dataclass(frozen=True)
class Walk:
    """Walks a file's records from front to back.

    Parameters
    ----------
    source : Source
    index : dict of int to ChunkIndex
        By offset; empty where the file has none.
    data_end : int or None
        Where the footer says that the data end.
    skip : callable
        Says of a chunk, by its first and last log time and its index (None where it has none),
        whether it can be left alone.
    defect : callable
        Takes each `Issue`.
    trusting : bool
        Take the index at its word and look only at what is not in it: looking costs a request,
        or a movement of the disk.
    """

    source: Source
    index: dict[int, ChunkIndex]
    data_end: int | None
    skip: Callable[[int, int, ChunkIndex | None], bool]
    defect: Callable[[Issue], None]
    trusting: bool

    def __iter__(self) -> Iterator[Stretch | Small]:
        end, whole = self._end()
        at = len(MAGIC)
        while True:
            index = self.index.get(at)
            if index and self.trusting:
                if not self.skip(index.message_start_time, index.message_end_time, index):
                    yield _indexed(index)
                at += max(index.chunk_length + index.message_index_length, RECORD.size)
                continue
            head = read_at(self.source, at, _HEAD)[: max(0, end - at)]
            if len(head) < RECORD.size:
                self.defect(Issue(at, "cut", _ENDS))
                return
            opcode, length = RECORD.unpack_from(head)
            after = at + RECORD.size + length
            try:
                if not _plausible(opcode) or after > end or self._crosses(at, after):
                    raise ValueError("no record starts here")
                if index and opcode != Opcode.CHUNK:
                    raise ValueError("no chunk starts where the index has one")
                if opcode == Opcode.DATA_END and self.data_end not in (None, after):
                    raise ValueError("the data do not end here")
                if opcode == Opcode.CHUNK:
                    says = ChunkHead.parse(head[RECORD.size :])
                    if says.at + says.stored != length:
                        raise ValueError("a chunk's head is damaged")
                if opcode == Opcode.MESSAGE and length < HEAD:
                    raise ValueError("a message record is too short")
                if opcode in (Opcode.CHUNK, Opcode.MESSAGE) and length > MAX_CHUNK:
                    raise ValueError(f"a record claims {length} bytes")
            except ValueError as error:
                found = self._resync(at, end)
                if found is None and after > end and _plausible(opcode) and not whole:
                    yield from self._cut(at, end, opcode, head)
                    return
                rest = "the rest is not read" if found is None else f"{found - at} bytes left out"
                span = (index.message_start_time, index.message_end_time) if index else (None, None)
                self.defect(Issue(at, "record", f"{error}, {rest}", None, *span))
                if found is None:
                    return
                at = found
                continue
            if opcode == Opcode.DATA_END:
                yield Small(at, opcode, head[RECORD.size : RECORD.size + length], length)
                if not whole:
                    self.defect(Issue(end, "cut", _ENDS))
                return
            if opcode == Opcode.CHUNK:
                start_ns, end_ns = says.start_ns, says.end_ns
                if index:  # its times are covered by a checksum
                    start_ns, end_ns = index.message_start_time, index.message_end_time
                if not self.skip(start_ns, end_ns, index):
                    yield Stretch(
                        at + RECORD.size, length, says.size, False, False, start_ns, end_ns
                    )
            elif opcode == Opcode.MESSAGE:
                after = at + self._loose(at, after - at, end)
                yield Stretch(at, after - at, after - at, True, False, None, None)
            elif opcode != Opcode.MESSAGE_INDEX:
                size = _HEAD_OF_ATTACHMENT if opcode == Opcode.ATTACHMENT else _SMALL
                content = read_at(self.source, at + RECORD.size, min(length, size))
                yield Small(at, opcode, content, length)
            at = after

    def lost(self, stretch: Stretch) -> int | None:
        """How many messages a chunk held, by the message indexes after it."""
        at, count = stretch.offset + stretch.length, 0
        while True:
            head = read_at(self.source, at, RECORD.size)
            if len(head) < RECORD.size or head[0] != Opcode.MESSAGE_INDEX:
                return count or None
            _, length = RECORD.unpack(head)
            at += RECORD.size + length
            if at > self.source.size:
                return None
            count += max(0, length - 6) // 16

    def _end(self) -> tuple[int, bool]:
        """Where the records end, and whether the file does there as it should.

        Zeros that a power loss left at the end are no records.
        """
        end = self.source.size
        if read_at(self.source, max(0, end - len(MAGIC)), len(MAGIC)) == MAGIC:
            return end - len(MAGIC), True
        while end > len(MAGIC):
            start = max(len(MAGIC), end - _SEARCH)
            block = read_at(self.source, start, end - start).rstrip(b"\0")
            if block:
                return start + len(block), False
            end = start
        return end, False

    def _crosses(self, at: int, after: int) -> bool:
        """A chunk known from the index starts inside: this record's length is wrong."""
        known = self._known
        k = bisect_right(known, at)
        return k < len(known) and known[k] < after

    @cached_property
    def _known(self) -> list[int]:
        return sorted(self.index)

    def _resync(self, at: int, end: int) -> int | None:
        """Where the next chunk starts after broken records."""
        k = bisect_right(self._known, at)
        if k < len(self._known):
            return self._known[k]
        start = at + 1
        while start < end:
            block = read_at(self.source, start, min(_SEARCH, end - start))
            for match in _CHUNK_LIKE.finditer(block):
                head = read_at(self.source, start + match.start(), _HEAD)
                _, length = RECORD.unpack_from(head)
                try:
                    says = ChunkHead.parse(head[RECORD.size :])
                except ValueError:
                    continue
                if says.compression in COMPRESSIONS and says.at + says.stored == length:
                    return start + match.start()
            start += max(1, len(block) - _HEAD)
        return None

    def _cut(self, at: int, end: int, opcode: int, head: bytes) -> Iterator[Stretch]:
        """The last record, of which only the beginning is there."""
        content = at + RECORD.size
        if opcode != Opcode.CHUNK:
            self.defect(Issue(at, "cut", _ENDS, 1 if opcode == Opcode.MESSAGE else None))
            return
        try:
            says = ChunkHead.parse(head[RECORD.size :])
        except ValueError:
            self.defect(Issue(at, "cut", f"{_ENDS}, inside a chunk"))
            return
        text = f"{_ENDS}, inside a chunk; what is there of it is used, no checksum covers that"
        self.defect(Issue(at, "cut", text, None, says.start_ns, says.end_ns))
        if says.size <= MAX_CHUNK:
            yield Stretch(
                content, end - content, says.size, False, True, says.start_ns, says.end_ns
            )

    def _loose(self, at: int, first: int, end: int) -> int:
        """Bytes of the messages outside chunks from a place on that are taken at once."""
        block = np.frombuffer(bytearray(read_at(self.source, at, min(_LOOSE, end - at))), np.uint8)
        return max(first, whole_records(block))


def _plausible(opcode: int) -> bool:
    return opcode in _IN_DATA or opcode >= 0x80  # those above are anybody's own


def _indexed(index: ChunkIndex) -> Stretch:
    return Stretch(
        index.chunk_start_offset + RECORD.size,
        index.chunk_length - RECORD.size,
        index.uncompressed_size,
        False,
        False,
        index.message_start_time,
        index.message_end_time,
    )
