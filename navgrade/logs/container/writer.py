"""MCAP from arrays: the records of many messages are laid down by a few array operations.

Full chunks are checksummed, compressed and written, in order, by two threads, while the caller
makes the next ones.
"""

from __future__ import annotations

import os
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from types import TracebackType
from typing import Self

import lz4.frame
import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from numpy.typing import NDArray

from navgrade.errors import ConfigError
from navgrade.logs.container.chunks import RECORD
from navgrade.logs.container.summary import MAGIC
from navgrade.logs.messages import Schema

_HEAD = np.dtype(  # of a message record, before the message itself
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
_ROWS = 1 << 15  # messages placed at a time
_THREADS = 2
_COMPRESSORS: dict[str, Callable[[int], Callable[[memoryview], bytes | memoryview]]] = {
    "zstd": lambda level: zstandard.ZstdCompressor(level=level).compress,
    "lz4": lambda level: partial(lz4.frame.compress, compression_level=level),
    "none": lambda level: lambda data: data,
}


@dataclass(frozen=True, eq=False)
class Batch:
    """Messages of one channel.

    Attributes
    ----------
    channel : int
        From `McapWriter.add_channel`.
    log_time_ns : ndarray of int64, shape (n,)
    data : ndarray of uint8, shape (n, size) or (bytes,)
        One message a row; or bytes in which `offsets` and `sizes` place each.
    publish_time_ns : ndarray of int64, shape (n,), optional
        The log time by default.
    sequence : ndarray of uint32, shape (n,), optional
        By default the messages of the channel are counted from 0.
    offsets, sizes : ndarray of int64, shape (n,), optional

    Raises
    ------
    ValueError
        When the arrays are not of one length.
    """

    channel: int
    log_time_ns: NDArray[np.int64]
    data: NDArray[np.uint8]
    publish_time_ns: NDArray[np.int64] | None = None
    sequence: NDArray[np.uint32] | None = None
    offsets: NDArray[np.int64] | None = None
    sizes: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        messages = self.data if self.sizes is None else self.sizes
        columns = (self.publish_time_ns, self.sequence, self.offsets, messages)
        lengths = {len(column) for column in columns if column is not None}
        if lengths != {len(self)}:
            raise ValueError(f"{len(self)} log times with columns of {sorted(lengths)} messages")

    def __len__(self) -> int:
        return len(self.log_time_ns)

    def __getitem__(self, rows: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Batch:
        columns = {
            name: column[rows]
            for name in ("log_time_ns", "publish_time_ns", "sequence", "offsets", "sizes")
            if (column := getattr(self, name)) is not None
        }
        if self.sizes is None:
            columns["data"] = self.data[rows]
        return replace(self, **columns)

    def record_sizes(self) -> NDArray[np.int64]:
        """Bytes of the record of each message."""
        sizes = np.full(len(self), self.data.shape[1]) if self.sizes is None else self.sizes
        return sizes + _HEAD.itemsize

    def heads(self) -> NDArray[np.void]:
        """What stands before each message."""
        published = self.log_time_ns if self.publish_time_ns is None else self.publish_time_ns
        heads = np.empty(len(self), _HEAD)
        heads["opcode"] = Opcode.MESSAGE
        heads["length"] = self.record_sizes() - RECORD.size
        heads["channel"] = self.channel
        heads["sequence"] = self.sequence
        heads["log_time"] = self.log_time_ns
        heads["publish_time"] = published
        return heads

    def copy(self, target: NDArray[np.uint8], to: NDArray[np.int64]) -> None:
        """Copy the messages to the places `to` in `target`."""
        if self.offsets is None or self.sizes is None:
            size = self.data.shape[1]
            if size:
                _runs(target, size)[to] = self.data.view(f"V{size}")[:, 0]
            return
        for size in np.unique(self.sizes[self.sizes > 0]).tolist():
            at = np.flatnonzero(self.sizes == size)
            _runs(target, size)[to[at]] = _runs(self.data, size)[self.offsets[at]]


def _runs(data: NDArray[np.uint8], size: int) -> NDArray[np.void]:
    """All runs of `size` bytes, by where they start."""
    return np.ndarray((len(data) - size + 1,), f"V{size}", data, strides=(1,))


class _Chunk:
    """Records being collected, and the compressor that will pack them."""

    def __init__(self, room: int, compress: Callable[[memoryview], bytes | memoryview]) -> None:
        self.compress = compress
        self.data = np.empty(room, np.uint8)
        self.clear()

    def clear(self) -> None:
        self.size = 0
        self.entries: dict[int, list[NDArray[np.uint64]]] = {}

    def grow(self, size: int) -> int:
        """Make room for `size` more bytes; return where they begin."""
        begin, self.size = self.size, self.size + size
        if self.size > len(self.data):
            room = np.empty(self.size + self.size // 4, np.uint8)
            room[:begin] = self.data[:begin]
            self.data = room
        return begin

    def add(self, record: bytes) -> None:
        begin = self.grow(len(record))
        self.data.data[begin : self.size] = record

    def place(self, batch: Batch, to: NDArray[np.int64]) -> None:
        """Lay down the records of a batch at the places `to`."""
        heads = batch.heads()
        _runs(self.data, _HEAD.itemsize)[to] = heads.view(f"V{_HEAD.itemsize}")
        batch.copy(self.data, to + _HEAD.itemsize)
        entries = np.empty((len(to), 2), "<u8")
        entries[:, 0], entries[:, 1] = heads["log_time"], to
        self.entries.setdefault(batch.channel, []).append(entries)


def check_output(path: Path, *, overwrite: bool) -> None:
    """Raise ConfigError unless a file may appear at `path`."""
    if path.is_dir():
        raise ConfigError(f"the output {path} is a folder")
    if path.exists() and not overwrite:
        raise ConfigError(f"{path} exists; choose another name or pass --overwrite")
    if not path.parent.is_dir():
        raise ConfigError(f"the folder {path.parent} of the output does not exist")


class McapWriter:
    """An MCAP file that appears under its name only when it is complete.

    Used as a context manager: the file is written to ``PATH.part``, brought to the disk and
    renamed when the block ends; on an exception the part is removed. Chunks are written as they
    fill: after a kill the part can be read up to its last whole chunk.

    Parameters
    ----------
    path : path
    overwrite : bool
    compression : {"zstd", "lz4", "none"}
    level : int
        Of the compression.
    chunk_bytes : int
        Size of a chunk before compression; one longer message makes a longer chunk.
    threads : int
        That compress and write; 1 is the caller's own.
    profile, library : str

    Raises
    ------
    ConfigError
        If `path` exists and must not be overwritten, or its folder does not exist.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        overwrite: bool = False,
        compression: str = "zstd",
        level: int = 1,
        chunk_bytes: int = 1 << 20,
        threads: int = _THREADS,
        profile: str = "ros2",
        library: str = "navgrade",
    ) -> None:
        if compression not in _COMPRESSORS:
            raise ValueError(f"compression {compression!r} is not one of {', '.join(_COMPRESSORS)}")
        self.path = Path(path)
        check_output(self.path, overwrite=overwrite)
        self._chunk_bytes = chunk_bytes
        self._compression = "" if compression == "none" else compression
        self._free: SimpleQueue[_Chunk] = SimpleQueue()
        for _ in range(1 if threads == 1 else threads + 2):  # one being filled, one waiting
            self._free.put(_Chunk(chunk_bytes, _COMPRESSORS[compression](level)))
        self._chunk = self._free.get()
        self._schemas: dict[int, records.Schema] = {}
        self._channels: dict[int, records.Channel] = {}
        self._described: set[tuple[Opcode, int]] = set()
        self._chunk_indexes: list[records.ChunkIndex] = []
        self._attachment_indexes: list[records.AttachmentIndex] = []
        self._metadata_indexes: list[records.MetadataIndex] = []
        self._counts: Counter[int] = Counter()
        self._part = self.path.with_name(self.path.name + ".part")
        self._stream = self._part.open("wb")
        self._size = self._crc = 0  # of what is written
        self._pool = None if threads == 1 else ThreadPoolExecutor(threads)
        self._stored: Future[None] | None = None  # the last chunk sent to the pool
        self._put(MAGIC + _bytes(records.Header(profile, library)))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self._finish()
                self._stream.flush()
                os.fsync(self._stream.fileno())
                self._stream.close()
                self._part.replace(self.path)
        finally:  # the part is gone unless it became the output
            if self._pool:
                self._pool.shutdown(cancel_futures=True)
            with suppress(OSError):
                self._stream.close()
            self._part.unlink(missing_ok=True)

    def add_channel(
        self,
        topic: str,
        schema: Schema,
        *,
        message_encoding: str = "cdr",
        schema_encoding: str = "ros2msg",
        metadata: Mapping[str, str] | None = None,
    ) -> int:
        """Add a topic; return the number its messages carry."""
        return self.copy_channel(
            records.Channel(0, topic, message_encoding, dict(metadata or {}), 0),
            records.Schema(0, schema.text.encode(), schema_encoding, schema.name),
        )

    def copy_channel(self, channel: records.Channel, schema: records.Schema | None) -> int:
        """Add a channel of another file, its numbers aside; return the number it has here."""
        number = len(self._channels) + 1
        schema_number = 0 if schema is None else self._schema_number(schema)
        self._channels[number] = replace(channel, id=number, schema_id=schema_number)
        return number

    def write(self, *batches: Batch) -> None:
        """Append messages of one or more channels, merged by log time.

        Messages of one time keep the order of `batches`. Calls are not merged with each other:
        where one begins before the last one ended, so does the file; readers put that in order.
        """
        batches = tuple(self._counted(batch) for batch in batches if len(batch))
        if not batches:
            return
        order = np.argsort(np.concatenate([b.log_time_ns for b in batches]), kind="stable")
        sizes = np.concatenate([batch.record_sizes() for batch in batches])[order]
        ends = np.cumsum(sizes)
        begins = np.empty_like(ends)
        begins[order] = ends - sizes
        places = np.split(begins, np.cumsum([len(batch) for batch in batches[:-1]]))
        low, total = 0, int(ends[-1])
        while low < total:  # bytes of all these records, chunk by chunk
            room = self._chunk_bytes - self._chunk.size
            fit = int(np.searchsorted(ends, low + room, side="right"))
            high = max(low, int(ends[fit - 1])) if fit else low
            if high == low and not self._chunk.size:
                high = int(ends[np.searchsorted(ends, low, side="right")])
            if high > low:
                self._place(batches, places, low, high)
            if high < total:
                self._send()
            low = high

    def _place(
        self, batches: Sequence[Batch], places: Sequence[NDArray[np.int64]], low: int, high: int
    ) -> None:
        """Lay down in the chunk the records whose places are from `low` to `high`."""
        parts = []
        for batch, place in zip(batches, places, strict=True):
            rows = slice(*np.searchsorted(place, (low, high)).tolist())
            if rows.stop > rows.start:
                self._chunk.add(self._description(batch.channel))
                parts.append((batch[rows], place[rows]))
        begin = self._chunk.grow(high - low)
        for batch, place in parts:
            self._chunk.place(batch, place - low + begin)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record."""
        record = _bytes(records.Metadata(name, dict(values)))
        self._wait()
        self._metadata_indexes.append(records.MetadataIndex(self._size, len(record), name))
        self._put(record)

    def add_attachment(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        """Add an attachment."""
        record = _bytes(records.Attachment(time_ns, time_ns, name, media_type, data))
        self._wait()
        self._attachment_indexes.append(
            records.AttachmentIndex(
                self._size, len(record), time_ns, time_ns, len(data), name, media_type
            )
        )
        self._put(record)

    def _schema_number(self, schema: records.Schema) -> int:
        for number, known in self._schemas.items():
            if known == replace(schema, id=number):
                return number
        number = len(self._schemas) + 1
        self._schemas[number] = replace(schema, id=number)
        return number

    def _description(self, number: int) -> bytes:
        """A channel and its schema, as far as they are not in the file yet."""
        channel = self._channels[number]
        schema = self._schemas.get(channel.schema_id)
        needed = {(Opcode.SCHEMA, channel.schema_id): schema, (Opcode.CHANNEL, number): channel}
        new = {key: record for key, record in needed.items() if key not in self._described}
        self._described.update(new)
        return _bytes(*(record for record in new.values() if record is not None))

    def _counted(self, batch: Batch) -> Batch:
        """Count a batch's messages; fill in their sequence and put them in order of log time."""
        before = self._counts[batch.channel]
        self._counts[batch.channel] += len(batch)
        sequence = batch.sequence
        if sequence is None:
            sequence = (before + np.arange(len(batch))).astype(np.uint32)
        batch = replace(batch, sequence=sequence, data=np.ascontiguousarray(batch.data))
        if (batch.log_time_ns[1:] < batch.log_time_ns[:-1]).any():
            batch = batch[np.argsort(batch.log_time_ns, kind="stable")]
        return batch

    def _send(self) -> None:
        """Have the chunk packed and written, and take an empty one as soon as there is one."""
        if self._stored is not None and self._stored.done():
            self._stored.result()  # raises what went wrong
        if self._pool:
            self._stored = self._pool.submit(self._store, self._chunk, self._stored)
        else:
            self._store(self._chunk, None)
        self._chunk = self._free.get()

    def _wait(self) -> None:
        """Wait until all chunks sent are in the file."""
        if self._stored is not None:
            self._stored.result()

    def _store(self, chunk: _Chunk, before: Future[None] | None) -> None:
        """Pack a chunk and, after the one `before`, write it."""
        try:
            content = chunk.data[: chunk.size].data
            packed = chunk.compress(content)
            entries = {channel: np.concatenate(parts) for channel, parts in chunk.entries.items()}
            start_ns = int(min(column[:, 0].min() for column in entries.values()))
            end_ns = int(max(column[:, 0].max() for column in entries.values()))
            head = RecordBuilder()
            head.write8(start_ns)
            head.write8(end_ns)
            head.write8(chunk.size)
            head.write4(zlib.crc32(content))
            head.write_prefixed_string(self._compression)
            head.write8(len(packed))
            length = head.count + len(packed)
            index = RecordBuilder()
            offsets = {}
            for channel, column in entries.items():
                offsets[channel] = RECORD.size + length + index.count
                index.start_record(Opcode.MESSAGE_INDEX)
                index.write2(channel)
                index.write4(column.nbytes)
                index.write(column.data)
                index.finish_record()
            if before is not None:
                before.result()
            self._chunk_indexes.append(
                records.ChunkIndex(
                    chunk_start_offset=self._size,
                    chunk_length=RECORD.size + length,
                    message_start_time=start_ns,
                    message_end_time=end_ns,
                    message_index_offsets={c: self._size + at for c, at in offsets.items()},
                    message_index_length=index.count,
                    compression=self._compression,
                    compressed_size=len(packed),
                    uncompressed_size=chunk.size,
                )
            )
            self._put(RECORD.pack(Opcode.CHUNK, length) + head.end(), packed, index.end())
            self._stream.flush()
        finally:
            chunk.clear()
            self._free.put(chunk)

    def _put(self, *pieces: bytes | memoryview) -> None:
        for piece in pieces:
            self._crc = zlib.crc32(piece, self._crc)
            self._size += len(piece)
            self._stream.write(piece)

    def _finish(self) -> None:
        if self._chunk.size:
            self._send()
        self._wait()
        self._put(b"".join(map(self._description, self._channels)))
        self._put(_bytes(records.DataEnd(self._crc)))
        self._put(self._summary() + MAGIC)

    def _summary(self) -> bytes:
        """The summary section, its offsets and the footer."""
        chunks = self._chunk_indexes
        statistics = records.Statistics(
            message_count=self._counts.total(),
            schema_count=len(self._schemas),
            channel_count=len(self._channels),
            attachment_count=len(self._attachment_indexes),
            metadata_count=len(self._metadata_indexes),
            chunk_count=len(chunks),
            message_start_time=min((c.message_start_time for c in chunks), default=0),
            message_end_time=max((c.message_end_time for c in chunks), default=0),
            channel_message_counts=dict(self._counts),
        )
        groups: dict[Opcode, Iterable[records.McapRecord]] = {
            Opcode.SCHEMA: self._schemas.values(),
            Opcode.CHANNEL: self._channels.values(),
            Opcode.STATISTICS: [statistics],
            Opcode.CHUNK_INDEX: chunks,
            Opcode.ATTACHMENT_INDEX: self._attachment_indexes,
            Opcode.METADATA_INDEX: self._metadata_indexes,
        }
        summary = RecordBuilder()
        offsets = []
        for opcode, group in groups.items():
            begin = summary.count
            for record in group:
                record.write(summary)
            if summary.count > begin:
                length = summary.count - begin
                offsets.append(records.SummaryOffset(opcode, self._size + begin, length))
        offsets_at = self._size + summary.count
        for offset in offsets:
            offset.write(summary)
        records.Footer(self._size, offsets_at, summary_crc=0).write(summary)
        covered: bytes = summary.end()[:-4]
        return covered + zlib.crc32(covered).to_bytes(4, "little")


def _bytes(*written: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in written:
        record.write(builder)
    content: bytes = builder.end()
    return content
