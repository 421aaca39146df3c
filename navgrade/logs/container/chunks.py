"""Chunks unpacked and verified, and the messages in them located."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from navgrade.logs.container.layout import Rows
from navgrade.logs.container.source import Bytes

RECORD = struct.Struct("<BQ")  # opcode and length of every record
HEAD = 22  # bytes of a message record before its data: channel, sequence, log and publish time
MAX_CHUNK = 1 << 28  # bytes uncompressed; writers make chunks of about 1 MiB
_CHUNK = struct.Struct("<QQQII")
COMPRESSIONS = ("", "zstd", "lz4")


class ChunkHead(NamedTuple):
    """What stands before a chunk's records."""

    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    at: int
    stored: int

    @classmethod
    def parse(cls, content: bytes) -> ChunkHead:
        """Parse the first bytes of a chunk's content; ValueError when they are no chunk's."""
        try:
            start, end, size, crc, name_length = _CHUNK.unpack_from(content)
            at = _CHUNK.size + name_length + 8
            if at > len(content):
                raise ValueError("its head is damaged")
            compression = content[_CHUNK.size : at - 8].decode()
            (stored,) = struct.unpack_from("<Q", content, at - 8)
        except (struct.error, UnicodeDecodeError):
            raise ValueError("its head is damaged") from None
        return cls(start, end, size, crc, compression, at, stored)


class UnknownCompression(ValueError):
    """A chunk was packed by a method this program does not know."""


class Bomb(ValueError):
    """A chunk claims more than is ever unpacked."""


class Workspace:
    """Buffers one thread uses again and again: giving them back to the system costs more than
    decoding."""

    def __init__(self) -> None:
        self.raw = np.empty(0, np.uint8)
        self.records = np.empty(0, np.uint8)
        self.starts = np.empty(0, np.int64)
        self.zstd = zstandard.ZstdDecompressor()

    def raw_bytes(self, size: int) -> Bytes:
        """At least `size` bytes for what is read from the file."""
        if len(self.raw) < size:
            self.raw = np.empty(size + size // 4, np.uint8)
        return self.raw

    def records_bytes(self, size: int) -> Bytes:
        """At least `size` bytes for unpacked records."""
        if len(self.records) < size:
            self.records = np.empty(size + size // 4, np.uint8)
        return self.records


def unpack(
    content: Bytes, space: Workspace, *, keep: bool, cut: bool = False
) -> tuple[Bytes, bool]:
    """Decompress and verify a chunk.

    Parameters
    ----------
    content : ndarray of uint8
        Of the chunk record.
    space : Workspace
        Holds the result until its next use, unless `keep`.
    keep : bool
        Give the result memory of its own.
    cut : bool
        The content ends early: unpack what there is of it.

    Returns
    -------
    records : ndarray of uint8
    checked : bool
        A checksum covers them.

    Raises
    ------
    ValueError
        Saying what is wrong.
    """
    head = ChunkHead.parse(content[:64].tobytes())
    if head.compression not in COMPRESSIONS:
        raise UnknownCompression(f"compression {head.compression!r} is not known")
    if head.size > MAX_CHUNK:
        raise Bomb(f"it claims {head.size} bytes, more than the {MAX_CHUNK} that are unpacked")
    packed = content[head.at : head.at + head.stored]
    if len(packed) < head.stored and not cut:
        raise ValueError(f"it holds {len(packed)} of {head.stored} stored bytes")
    if head.compression == "":
        records = packed.copy() if keep else packed
    else:
        out = np.empty(head.size, np.uint8) if keep else space.records_bytes(head.size)
        try:
            records = out[: _decompress(head, packed, out.data[: head.size], space)]
        except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
            raise ValueError(str(error)) from None
    if cut:
        return records[: head.size], False
    if len(records) != head.size:
        raise ValueError(f"it holds {len(records)} of {head.size} bytes")
    if head.crc and zlib.crc32(records.data) != head.crc:
        raise ValueError("its checksum does not match")
    return records, bool(head.crc)


def _decompress(head: ChunkHead, packed: Bytes, out: memoryview, space: Workspace) -> int:
    """Fill `out`; return how many bytes there were, one more than fit if there are more."""
    if head.compression == "lz4":
        whole = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=len(out) + 1)
        count = min(len(whole), len(out))
        out[:count] = whole[:count]
        return len(whole)
    with space.zstd.stream_reader(packed.data) as stream:
        done = 0
        while done < len(out):
            count = stream.readinto(out[done:])
            if not count:
                return done
            done += count
        return done + len(stream.read(1))


def whole_records(records: Bytes) -> int:
    """Bytes of the schemas, channels and messages that start the records and are whole."""
    from navgrade.logs.container.scan import scan

    room = len(records) // RECORD.size + 1
    return int(scan(records, 0, np.empty(room, np.int64))[1])


@dataclass(frozen=True, eq=False)
class Group:
    """Messages of one channel among the records.

    Attributes
    ----------
    channel : int
    starts : ndarray of int64
        Of the content of each message record.
    lengths : ndarray of int64 or int
        Of the contents; one number when all are of it and stand at equal distances.
    """

    channel: int
    records: Bytes
    starts: NDArray[np.int64]
    lengths: NDArray[np.int64] | int

    def __len__(self) -> int:
        return len(self.starts)

    def by_size(self) -> Iterator[tuple[slice | NDArray[np.intp], Rows]]:
        """Yield (which, message records of one size), the data of each `HEAD` bytes in."""
        if isinstance(self.lengths, int):
            step = self.lengths + RECORD.size
            first = int(self.starts[0])
            yield slice(None), Rows(self.records, first, step, len(self), self.lengths)
            return
        for size in np.unique(self.lengths).tolist():
            which = np.flatnonzero(self.lengths == size)
            windows = np.lib.stride_tricks.sliding_window_view(self.records, size)
            gathered = windows[self.starts[which]].reshape(-1)
            yield which, Rows(gathered, 0, size, len(which), size)

    def rows(self, which: NDArray[np.bool_]) -> Group:
        """Only some of the messages."""
        lengths = self.lengths
        if isinstance(lengths, int):
            lengths = np.full(len(self), lengths, np.int64)
        return Group(self.channel, self.records, self.starts[which], lengths[which])

    def heads(self) -> tuple[NDArray[np.uint32], NDArray[np.int64], NDArray[np.int64]]:
        """Sequence, log time and publish time of each message."""
        if isinstance(self.lengths, int):
            ((_, rows),) = self.by_size()
        else:
            windows = np.lib.stride_tricks.sliding_window_view(self.records, HEAD)
            rows = Rows(windows[self.starts].reshape(-1), 0, HEAD, len(self), HEAD)
        return rows.view(2, "<u4"), rows.view(6, "<i8"), rows.view(14, "<i8")


class Located(NamedTuple):
    """What a stretch of records holds."""

    groups: list[Group]
    others: list[tuple[int, bytes]]  # opcode and content of schemas and channels
    reached: int  # bytes understood


def locate(records: Bytes, space: Workspace) -> Located:
    """Find the messages, by their equal distances where they have them, else one by one."""
    others: list[tuple[int, bytes]] = []
    at = 0
    while len(records) - at >= RECORD.size:
        opcode, length = RECORD.unpack_from(records.data, at)
        end = at + RECORD.size + length
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL) or end > len(records):
            break
        others.append((opcode, records[at + RECORD.size : end].tobytes()))
        at = end
    group = _regular(records, at)
    if group is not None:
        return Located([group], others, len(records))
    return _one_by_one(records, at, others, space)


def _regular(records: Bytes, at: int) -> Group | None:
    if len(records) - at < RECORD.size + HEAD:
        return None
    opcode, length = RECORD.unpack_from(records.data, at)
    number, rest = divmod(len(records) - at, RECORD.size + length)
    if opcode != Opcode.MESSAGE or rest or length < HEAD:
        return None
    rows = Rows(records, at, RECORD.size + length, number, length)
    first, last = rows.view(0, "<u8"), rows.view(3, "<u8")  # opcode, length, channel: 11 bytes
    if not ((first == first[0]).all() and (last == last[0]).all()):
        return None
    starts = at + RECORD.size + rows.stride * np.arange(number, dtype=np.int64)
    return Group(int(last[0]) >> 48, records, starts, length)


def _one_by_one(
    records: Bytes, at: int, others: list[tuple[int, bytes]], space: Workspace
) -> Located:
    from navgrade.logs.container.scan import scan

    room = (len(records) - at) // RECORD.size + 1
    if len(space.starts) < room:
        space.starts = np.empty(room, np.int64)
    count, reached = scan(records, at, space.starts)
    starts = space.starts[:count].copy()
    lengths = np.diff(starts, append=reached + RECORD.size) - RECORD.size
    opcodes = records[starts - RECORD.size]
    for k in np.flatnonzero((opcodes == Opcode.SCHEMA) | (opcodes == Opcode.CHANNEL)):
        content = records[starts[k] : starts[k] + lengths[k]]
        others.append((int(opcodes[k]), content.tobytes()))
    messages = opcodes == Opcode.MESSAGE
    starts, lengths = starts[messages], lengths[messages]
    channels = records[starts] + records[starts + 1].astype(np.uint16) * np.uint16(256)
    groups = [
        Group(int(channel), records, starts[mine], lengths[mine])
        for channel in np.unique(channels)
        for mine in (channels == channel,)
    ]
    return Located(groups, others, int(reached))
