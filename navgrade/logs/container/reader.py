"""MCAP files as runs of raw messages, whatever their condition.

Records are parsed by the official library; this module walks them, so that a damaged chunk or a
missing end costs what it held and nothing more. Checksums are always verified.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.summary import Summary
from numpy.typing import NDArray

from navgrade.errors import LogError

MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQII")
_MAX_CHUNK = 1 << 30  # bytes uncompressed; MCAP writers use about 1 MiB
_MAX_RECORD = 1 << 32
_END = "the file ends early, it was cut off or is still being written"


@dataclass(frozen=True)
class Issue:
    """A defect of the file and what it cost.

    Attributes
    ----------
    offset : int
        Byte in the file.
    text : str
    start_ns, end_ns : int or None
        Log time span of what was lost, where known.
    """

    offset: int
    text: str
    start_ns: int | None = None
    end_ns: int | None = None


@dataclass(frozen=True, eq=False)
class RawMessages:
    """Messages of one channel from one chunk, in file order."""

    channel: int
    log_time_ns: NDArray[np.int64]
    data: memoryview
    offsets: NDArray[np.int64]
    sizes: NDArray[np.int64]

    def by_size(self) -> Iterator[tuple[NDArray[np.intp], NDArray[np.uint8]]]:
        """Yield (rows, bytes) for each message size; bytes of shape (n, size)."""
        buffer = np.frombuffer(self.data, np.uint8)
        for size in np.unique(self.sizes):
            rows = np.flatnonzero(self.sizes == size)
            if size == 0:
                yield rows, np.empty((len(rows), 0), np.uint8)
                continue
            windows = np.lib.stride_tricks.sliding_window_view(buffer, int(size))
            yield rows, windows[self.offsets[rows]]


def _decompress(compression: str, data: bytes, size: int) -> bytes:
    if compression == "":
        return data
    if compression == "zstd":
        told = zstandard.frame_content_size(data)  # -1 where the frame does not say
        if told not in (-1, size):
            raise ValueError(f"its frame claims {told} of {size} bytes")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    if compression == "lz4":
        out: bytes = lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1)
        return out
    raise ValueError(f"compression {compression!r} is not known")


@dataclass
class McapFile:
    """An MCAP file, read from front to back.

    Attributes
    ----------
    path : Path
    strict : bool
        Raise on the first defect instead of noting it.
    channels : dict of int to Channel
    schemas : dict of int to Schema
        Both grow while reading.
    attachments, metadata : list
        Likewise.
    issues : list of Issue
    summary : Summary or None
        The file's own index, where it can be read.
    """

    path: Path
    strict: bool = False
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    attachments: list[Attachment] = field(default_factory=list)
    metadata: list[Metadata] = field(default_factory=list)
    issues: list[Issue] = field(default_factory=list)
    summary: Summary | None = None

    def __post_init__(self) -> None:
        if not self.path.is_file():
            what = "is a folder" if self.path.is_dir() else "no such file"
            raise LogError(what, file=str(self.path))
        with self.path.open("rb") as stream:
            magic = stream.read(len(MAGIC))
            if magic == MAGIC:
                stream.seek(0)
                self._read_summary(stream)
        if magic != MAGIC:
            what = "the file is empty" if not magic else "this is not an MCAP file"
            hint = " (a ROS 1 bag)" if magic.startswith(b"#ROSBAG") else ""
            raise LogError(f"{what}{hint}", file=str(self.path))

    def _read_summary(self, stream: BinaryIO) -> None:
        """Channels and schemas from the summary: they outlive a chunk that held them."""
        try:
            self.summary = make_reader(stream).get_summary()
        except Exception:  # a damaged tail makes the parser fail in any way; the data remain
            return
        if self.summary is not None:
            self.channels.update(self.summary.channels)
            self.schemas.update(self.summary.schemas)

    def schema_name(self, channel: Channel) -> str:
        """Name of a channel's schema, empty where it has none."""
        schema = self.schemas.get(channel.schema_id)
        return schema.name if schema else ""

    def runs(
        self,
        wanted: Callable[[Channel], bool],
        *,
        progress: Callable[[int], None] | None = None,
    ) -> Iterator[RawMessages]:
        """Yield the messages of the wanted channels, chunk by chunk.

        Parameters
        ----------
        wanted : callable
        progress : callable, optional
            Called with the number of bytes of the file read so far.

        Raises
        ------
        LogError
            On a defect, when strict; otherwise defects are added to `issues`.
        """
        choice: dict[int, bool] = {}
        with self.path.open("rb", buffering=1 << 20) as stream:
            stream.seek(len(MAGIC))
            loose = io.BytesIO()
            for opcode, offset, content in self._records(stream):
                if opcode == Opcode.CHUNK:
                    yield from self._gather(self._chunk(offset, content), choice, wanted, offset)
                elif opcode == Opcode.MESSAGE:
                    loose.write(_RECORD.pack(opcode, len(content)) + content)
                    if loose.tell() > 1 << 20:
                        yield from self._gather(loose.getvalue(), choice, wanted, offset)
                        loose = io.BytesIO()
                elif opcode == Opcode.DATA_END:
                    self._check_data_end(offset, content)
                    break
                else:
                    self._note(opcode, content, offset)
                if progress:
                    progress(stream.tell())
            if loose.tell():
                yield from self._gather(loose.getvalue(), choice, wanted, 0)

    def _defect(self, issue: Issue) -> None:
        if self.strict:
            raise LogError(f"{issue.text} (byte {issue.offset})", file=str(self.path))
        self.issues.append(issue)

    def _records(self, stream: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
        self._data_crc = zlib.crc32(MAGIC)
        while True:
            offset = stream.tell()
            head = stream.read(_RECORD.size)
            if len(head) < _RECORD.size:
                self._defect(Issue(offset, _END))
                return
            opcode, length = _RECORD.unpack(head)
            if opcode == 0 or length > _MAX_RECORD:
                self._defect(Issue(offset, "no record starts here, the rest cannot be read"))
                return
            content = stream.read(length)
            if len(content) < length:
                lost = _END
                span: tuple[int | None, int | None] = (None, None)
                if opcode == Opcode.CHUNK and len(content) >= 16:
                    span = struct.unpack_from("<QQ", content)
                    lost = f"{_END}, inside a chunk"
                self._defect(Issue(offset, lost, *span))
                return
            yield opcode, offset, content
            self._data_crc = zlib.crc32(content, zlib.crc32(head, self._data_crc))

    def _check_data_end(self, offset: int, content: bytes) -> None:
        crc = int.from_bytes(content[:4], "little")
        if crc and crc != self._data_crc and not self.issues:
            self._defect(Issue(offset, "the checksum of the data does not match: a value is wrong"))

    def _note(self, opcode: int, content: bytes, offset: int) -> None:
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.ATTACHMENT, Opcode.METADATA):
            return
        try:
            self._keep(opcode, ReadDataStream(io.BytesIO(content)))
        except (ValueError, struct.error, McapError, MemoryError) as error:
            name = Opcode(opcode).name.lower()
            self._defect(Issue(offset, f"a damaged {name} record was left out: {error}"))

    def _keep(self, opcode: int, stream: ReadDataStream) -> None:
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels.setdefault(channel.id, channel)
        elif opcode == Opcode.ATTACHMENT:
            self.attachments.append(Attachment.read(stream))
        else:
            self.metadata.append(Metadata.read(stream))

    def _chunk(self, offset: int, content: bytes) -> bytes:
        """Decompress and verify; empty, with an issue noted, when that fails."""
        start = end = None
        try:
            start, end, size, crc, name_length = _CHUNK.unpack_from(content)
            at = _CHUNK.size + name_length
            compression = content[_CHUNK.size : at].decode()
            (stored,) = struct.unpack_from("<Q", content, at)
            if size > _MAX_CHUNK:
                raise ValueError(f"it claims {size} bytes")
            records = _decompress(compression, content[at + 8 : at + 8 + stored], size)
            if len(records) != size:
                raise ValueError(f"it holds {len(records)} of {size} bytes")
            if crc and zlib.crc32(records) != crc:
                raise ValueError("its checksum does not match")
        except (ValueError, struct.error, zstandard.ZstdError, RuntimeError, MemoryError) as error:
            self._defect(Issue(offset, f"a damaged chunk was left out: {error}", start, end))
            return b""
        return records

    def _gather(
        self,
        records: bytes,
        choice: dict[int, bool],
        wanted: Callable[[Channel], bool],
        file_offset: int,
    ) -> Iterator[RawMessages]:
        found: dict[int, tuple[list[int], list[int], list[int]]] = {}
        at, end = 0, len(records)
        while at + _RECORD.size <= end:
            opcode, length = _RECORD.unpack_from(records, at)
            at += _RECORD.size
            if at + length > end:
                self._defect(Issue(file_offset, "a record is longer than its chunk"))
                break
            if opcode == Opcode.MESSAGE and length >= _MESSAGE.size:
                channel, _, log_time, _ = _MESSAGE.unpack_from(records, at)
                take = choice.get(channel)
                if take is None and channel in self.channels:
                    take = choice[channel] = wanted(self.channels[channel])
                if take:
                    times, offsets, sizes = found.setdefault(channel, ([], [], []))
                    times.append(log_time)
                    offsets.append(at + _MESSAGE.size)
                    sizes.append(length - _MESSAGE.size)
            else:
                self._note(opcode, records[at : at + length], file_offset)
            at += length
        view = memoryview(records)
        for channel, (times, offsets, sizes) in found.items():
            yield RawMessages(
                channel,
                np.array(times, np.uint64).view(np.int64),
                view,
                np.array(offsets, np.int64),
                np.array(sizes, np.int64),
            )
