"""Arrays written as MCAP are the same messages in every other reader, and every index is right.

The official library reads the files; where it does not check, the file is walked here byte by
byte after the specification.
"""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import textwrap
import tracemalloc
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Channel, DataEnd, Message, Schema
from mcap.stream_reader import StreamReader
from numpy.typing import NDArray

from navgrade.errors import ConfigError
from navgrade.logs.container import Batch, McapFile, McapWriter
from navgrade.logs.messages import Schema as Definition
from tests.navgrade.logmaking import CHUNK, EPOCH_NS, IMU, IMU_TEXT, Record, records_of

FIXED = Definition(IMU, IMU_TEXT)
VARYING = Definition("test_msgs/msg/Blob", "uint8[] data\n")
CHUNK_BYTES = 50_000
COMPRESSIONS = {"zstd": "zstd", "lz4": "lz4", "none": ""}

# the names of the window's ends that replace them came with mcap 1.6
DEPRECATED = pytest.mark.filterwarnings("ignore:.*_time is deprecated")
Row = tuple[str, int, int, int, bytes]  # topic, sequence, log time, publish time, message


@dataclass(frozen=True)
class Given:
    """Columns of one topic."""

    topic: str
    log_ns: NDArray[np.int64]
    publish_ns: NDArray[np.int64]
    sequence: NDArray[np.uint32]
    messages: list[bytes]

    def __len__(self) -> int:
        return len(self.messages)

    def rows(self) -> list[Row]:
        columns = (self.sequence.tolist(), self.log_ns.tolist(), self.publish_ns.tolist())
        return [(self.topic, *row) for row in zip(*columns, self.messages, strict=True)]

    def batch(self, channel: int, start: int = 0, stop: int | None = None) -> Batch:
        """Some rows; their messages lie in a buffer in no order and with other bytes between."""
        part = slice(start, stop)
        messages = self.messages[part]
        order = np.random.default_rng(5).permutation(len(messages))
        sizes = np.array([len(message) for message in messages], np.int64)
        offsets = np.empty(len(messages), np.int64)
        buffer = b"before"
        for k in order.tolist():
            offsets[k] = len(buffer)
            buffer += messages[k] + b"between"
        return Batch(
            channel,
            self.log_ns[part],
            np.frombuffer(buffer, np.uint8),
            self.publish_ns[part],
            self.sequence[part],
            offsets,
            sizes,
        )


def given(topic: str, count: int, step_ns: int, *, longest: int = 400, seed: int = 1) -> Given:
    """Messages of any size, empty ones too; no two columns are alike."""
    rng = np.random.default_rng(seed)
    log_ns = EPOCH_NS + np.arange(count) * step_ns
    return Given(
        topic,
        log_ns,
        log_ns - rng.integers(1, 10**9, count),
        rng.integers(0, 1 << 32, count, dtype=np.uint32),
        [rng.bytes(size) for size in rng.integers(0, longest, count).tolist()],
    )


def write(path: Path, *topics: Given, blocks: int = 1, **options: object) -> Path:
    """Write topics in slabs of their common time."""
    ends_ns = [int(topic.log_ns[-1]) for topic in topics if len(topic)]
    edges = np.linspace(EPOCH_NS, max(ends_ns, default=EPOCH_NS) + 1000, blocks + 1)
    with McapWriter(path, chunk_bytes=CHUNK_BYTES, **options) as out:  # type: ignore[arg-type]
        channels = [out.add_channel(topic.topic, VARYING) for topic in topics]
        for span in pairwise(edges):
            slab = []
            for topic, channel in zip(topics, channels, strict=True):
                start, stop = np.searchsorted(topic.log_ns, span)
                slab.append(topic.batch(channel, int(start), int(stop)))
            out.write(*slab)
    return path


THREE = (
    given("/fast", 3000, 1_000_000, seed=1),
    given("/slow", 300, 10_000_000, longest=900, seed=2),
    given("/odd", 41, 73_000_001, longest=2000, seed=3),
)


@pytest.fixture(scope="module", params=COMPRESSIONS)
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three topics of different rates, in four slabs, in each compression."""
    path = tmp_path_factory.mktemp("written") / f"{request.param}.mcap"
    return write(path, *THREE, blocks=4, compression=request.param)


def merged(*topics: Given) -> list[Row]:
    """All messages by log time; those of one time in the order of the topics."""
    return sorted((row for topic in topics for row in topic.rows()), key=lambda row: row[2])


def row_of(channel: Channel, message: Message) -> Row:
    return (
        channel.topic,
        message.sequence,
        message.log_time,
        message.publish_time,
        message.data,
    )


# ---- the official readers ----------------------------------------------------------------------


def test_every_message_comes_back_in_the_order_of_log_time(written: Path) -> None:
    with written.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        found = [row_of(channel, message) for _, channel, message in reader.iter_messages()]
    assert found == merged(*THREE)


def test_messages_stand_in_the_file_in_the_order_of_log_time(written: Path) -> None:
    """Read from front to back, checksums of chunks and data verified, nothing sorted."""
    with written.open("rb") as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
    topics = {record.id: record for record in records if isinstance(record, Channel)}
    found = [row_of(topics[r.channel_id], r) for r in records if isinstance(r, Message)]
    assert found == merged(*THREE)


def test_a_pipe_is_enough_to_read_it(written: Path) -> None:
    with written.open("rb") as stream:
        reader = NonSeekingReader(stream, validate_crcs=True)
        found = [
            (schema.name, row_of(channel, message))
            for schema, channel, message in reader.iter_messages(log_time_order=False)
            if schema is not None
        ]
    assert found == [(VARYING.name, row) for row in merged(*THREE)]


@DEPRECATED
def test_windows_of_time_are_found_by_the_index(written: Path) -> None:
    wanted = merged(*THREE)
    rng = np.random.default_rng(4)
    with written.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        for _ in range(20):
            start, end = np.sort(EPOCH_NS + rng.integers(0, 3_100_000_000, 2)).tolist()
            found = [
                row_of(channel, message)
                for _, channel, message in reader.iter_messages(start_time=start, end_time=end)
            ]
            assert found == [row for row in wanted if start <= row[2] < end]


def test_one_topic_is_found_by_the_index(written: Path) -> None:
    with written.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        found = [row_of(channel, m) for _, channel, m in reader.iter_messages(topics=["/odd"])]
    assert found == THREE[2].rows()


def test_our_own_reader_finds_no_fault(written: Path) -> None:
    log = McapFile(written, strict=True)
    assert log.summary is not None
    found = []
    for part in log.messages(lambda channel: True):
        topic = log.channels[part.channel].topic
        times = (part.sequence.tolist(), part.log_time_ns.tolist(), part.publish_time_ns.tolist())
        for k, (sequence, log_ns, publish_ns) in enumerate(zip(*times, strict=True)):
            data = part.data[part.offsets[k] : part.offsets[k] + part.sizes[k]].tobytes()
            found.append((topic, sequence, log_ns, publish_ns, data))
    assert sorted(found, key=lambda row: row[2]) == merged(*THREE)


# ---- byte by byte ------------------------------------------------------------------------------

SCHEMA, CHANNEL, MESSAGE, MESSAGE_INDEX, CHUNK_INDEX = 0x03, 0x04, 0x05, 0x07, 0x08
ATTACHMENT, STATISTICS, SUMMARY_OFFSET, DATA_END, FOOTER = 0x09, 0x0B, 0x0E, 0x0F, 0x02


@dataclass(frozen=True)
class WalkedChunk:
    """A chunk unpacked by its own description."""

    record: Record
    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str
    stored: int
    content: bytes

    def records(self) -> Iterator[tuple[int, int, bytes]]:
        """Opcode, place and content of each record inside."""
        at = 0
        while at < len(self.content):
            opcode, length = struct.unpack_from("<BQ", self.content, at)
            yield opcode, at, self.content[at + 9 : at + 9 + length]
            at += 9 + length


def unpack(data: bytes, record: Record) -> WalkedChunk:
    content = data[record.start : record.start + record.length]
    start_ns, end_ns, size, crc, name_length = struct.unpack_from("<QQQII", content)
    compression = content[32 : 32 + name_length].decode()
    (stored,) = struct.unpack_from("<Q", content, 32 + name_length)
    packed = content[40 + name_length :]
    assert len(packed) == stored
    if compression == "zstd":
        packed = zstandard.ZstdDecompressor().decompress(packed)
    elif compression == "lz4":
        packed = lz4.frame.decompress(packed)
    return WalkedChunk(record, start_ns, end_ns, size, crc, compression, stored, packed)


def chunks(path: Path) -> list[WalkedChunk]:
    data = path.read_bytes()
    return [unpack(data, record) for record in records_of(path) if record.opcode == CHUNK]


def message_times(chunk: WalkedChunk) -> dict[int, list[tuple[int, int]]]:
    """Log time and place of the messages of each channel, in the order of the chunk."""
    found: dict[int, list[tuple[int, int]]] = {}
    for opcode, at, content in chunk.records():
        if opcode == MESSAGE:
            channel, _, log_ns = struct.unpack_from("<HIQ", content)
            found.setdefault(channel, []).append((log_ns, at))
    return found


def pairs(content: bytes, code: str) -> list[tuple[int, int]]:
    """A length-prefixed array of pairs."""
    (length,) = struct.unpack_from("<I", content)
    assert len(content) >= 4 + length
    return list(struct.iter_unpack(code, content[4 : 4 + length]))  # type: ignore[arg-type]


def test_the_head_of_each_chunk_tells_what_is_in_it(written: Path) -> None:
    for chunk in chunks(written):
        times = [log_ns for each in message_times(chunk).values() for log_ns, _ in each]
        assert chunk.compression == COMPRESSIONS[written.stem]
        assert chunk.size == len(chunk.content)
        assert chunk.crc == zlib.crc32(chunk.content)
        assert (chunk.start_ns, chunk.end_ns) == (min(times), max(times))


def test_every_entry_of_every_index_points_at_its_message(written: Path) -> None:
    """Message indexes against a walk of the chunk, chunk indexes against a walk of the file."""
    data = written.read_bytes()
    records = records_of(written)
    described = iter([record for record in records if record.opcode == CHUNK_INDEX])
    entries = 0
    for number, record in enumerate(records):
        if record.opcode != CHUNK:
            continue
        chunk = unpack(data, record)
        indexes: dict[int, int] = {}
        found: dict[int, list[tuple[int, int]]] = {}
        end = record.start + record.length
        for index in records[number + 1 :]:
            if index.opcode != MESSAGE_INDEX:
                break
            content = data[index.start : index.start + index.length]
            (channel,) = struct.unpack_from("<H", content)
            found[channel] = pairs(content[2:], "<QQ")
            indexes[channel] = index.start - 9
            end = index.start + index.length
        assert found == message_times(chunk)
        entries += sum(map(len, found.values()))

        content = data[(at := next(described)).start : at.start + at.length]
        start_ns, end_ns, offset, length = struct.unpack_from("<QQQQ", content)
        assert (start_ns, end_ns) == (chunk.start_ns, chunk.end_ns)
        assert (offset, length) == (record.start - 9, record.length + 9)
        assert dict(pairs(content[32:], "<HQ")) == indexes
        rest = content[36 + 10 * len(indexes) :]
        index_length, name_length = struct.unpack_from("<QI", rest)
        assert index_length == end - record.start - record.length
        assert rest[12 : 12 + name_length].decode() == chunk.compression
        assert struct.unpack_from("<QQ", rest, 12 + name_length) == (chunk.stored, chunk.size)
    assert next(described, None) is None
    assert entries == sum(map(len, THREE))


def test_a_channel_and_its_schema_stand_before_their_first_message(written: Path) -> None:
    """Once each, in the chunk that uses them first."""
    seen: list[tuple[int, int]] = []
    for chunk in chunks(written):
        new = []
        used = set()
        for opcode, _, content in chunk.records():
            (number,) = struct.unpack_from("<H", content)
            if opcode == MESSAGE:
                used.add(number)
                assert (CHANNEL, number) in seen
            else:
                seen.append((opcode, number))
                new.append((opcode, number))
        assert {number for opcode, number in new if opcode == CHANNEL} <= used
    assert sorted(seen) == [(SCHEMA, 1), (CHANNEL, 1), (CHANNEL, 2), (CHANNEL, 3)]


def test_the_checksum_of_the_data_covers_all_before_it(written: Path) -> None:
    data = written.read_bytes()
    (end,) = [record for record in records_of(written) if record.opcode == DATA_END]
    (crc,) = struct.unpack_from("<I", data, end.start)
    assert crc == zlib.crc32(data[: end.start - 9]) != 0


def test_the_checksum_of_the_summary_covers_all_of_it(written: Path) -> None:
    data = written.read_bytes()
    records = records_of(written)
    footer = records[-1]
    assert footer.opcode == FOOTER
    start, offsets, crc = struct.unpack_from("<QQI", data, footer.start)
    (end,) = [record for record in records if record.opcode == DATA_END]
    assert start == end.start + end.length
    assert data[offsets] == SUMMARY_OFFSET
    assert crc == zlib.crc32(data[start : footer.start + 16]) != 0
    assert data[footer.start + footer.length :] == data[:8]  # the magic


def test_summary_offsets_part_the_summary_by_kind(written: Path) -> None:
    data = written.read_bytes()
    records = records_of(written)
    (start,) = struct.unpack_from("<Q", data, records[-1].start)
    groups: dict[int, list[Record]] = {}
    for record in records:
        if record.start > start and record.opcode not in (SUMMARY_OFFSET, FOOTER):
            groups.setdefault(record.opcode, []).append(record)
    wanted = [
        (opcode, group[0].start - 9, group[-1].start + group[-1].length - group[0].start + 9)
        for opcode, group in groups.items()
    ]
    found = [
        struct.unpack_from("<BQQ", data, record.start)
        for record in records
        if record.opcode == SUMMARY_OFFSET
    ]
    assert found == wanted


def test_statistics_count(written: Path) -> None:
    with written.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    found = summary.statistics
    times = [row[2] for row in merged(*THREE)]
    assert found.message_count == len(times)
    assert (found.message_start_time, found.message_end_time) == (times[0], times[-1])
    assert found.channel_message_counts == {1: 3000, 2: 300, 3: 41}
    assert (found.schema_count, found.channel_count) == (1, 3)
    assert (found.attachment_count, found.metadata_count) == (0, 0)
    assert found.chunk_count == len(chunks(written)) == len(summary.chunk_indexes)


# ---- chunks ------------------------------------------------------------------------------------


@pytest.mark.parametrize("rows", [1, 7, 4096])
def test_chunks_are_full_however_the_rows_come(tmp_path: Path, rows: int) -> None:
    path = tmp_path / "out.mcap"
    data = np.random.default_rng(1).integers(0, 256, (4096, 100), np.uint8)
    log_ns = EPOCH_NS + np.arange(4096)
    with McapWriter(path, chunk_bytes=10_000) as out:
        channel = out.add_channel("/fixed", FIXED)
        for start in range(0, 4096, rows):
            part = slice(start, start + rows)
            out.write(Batch(channel, log_ns[part], data[part]))
    sizes = [len(chunk.content) for chunk in chunks(path)]
    record = 100 + 31
    assert all(10_000 - record < size <= 10_000 for size in sizes[1:-1])
    assert sizes[0] < 10_000 + 2000  # the first one describes the channel, too
    assert sum(sizes) - 4096 * record < 2000


def test_slabs_do_not_show_in_the_file(tmp_path: Path) -> None:
    whole = write(tmp_path / "whole.mcap", *THREE)
    parts = write(tmp_path / "parts.mcap", *THREE, blocks=37)
    assert parts.read_bytes() == whole.read_bytes()


def test_a_message_longer_than_a_chunk_has_one_of_its_own(tmp_path: Path) -> None:
    path = tmp_path / "out.mcap"
    big = given("/blob", 5, 1000)
    messages = [b"a" * 10, b"b" * 3 * CHUNK_BYTES, b"c" * 10, b"d" * 2 * CHUNK_BYTES, b"e"]
    blobs = Given("/blob", big.log_ns, big.publish_ns, big.sequence, messages)
    write(path, blobs)
    held = [sum(map(len, message_times(chunk).values())) for chunk in chunks(path)]
    assert held == [1, 1, 1, 1, 1]
    with path.open("rb") as stream:
        found = [m.data for _, _, m in make_reader(stream, validate_crcs=True).iter_messages()]
    assert found == messages


def test_memory_does_not_grow_when_compression_is_slow(tmp_path: Path) -> None:
    """Noise at level 19 takes longer to pack than to make: the caller has to wait."""
    block = np.random.default_rng(1).integers(0, 256, (500, 100), np.uint8)
    tracemalloc.start()
    try:
        with McapWriter(tmp_path / "out.mcap", level=19, chunk_bytes=65_536) as out:
            channel = out.add_channel("/noise", FIXED)
            for k in range(160):  # 10 MB
                out.write(Batch(channel, EPOCH_NS + k * 500 + np.arange(500), block))
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2_000_000  # bytes: four chunks, what they are packed to, and indexes


# ---- what is written ---------------------------------------------------------------------------


@pytest.mark.parametrize("count", [0, 1])
def test_a_file_may_hold_one_message_or_none(tmp_path: Path, count: int) -> None:
    topic = given("/rare", count, 1)
    path = write(tmp_path / "out.mcap", topic)
    for validate in (False, True):
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=validate)
            found = [row_of(channel, m) for _, channel, m in reader.iter_messages()]
            summary = reader.get_summary()
        assert found == topic.rows()
        assert summary is not None
        assert [channel.topic for channel in summary.channels.values()] == ["/rare"]
        assert summary.statistics is not None
        assert summary.statistics.message_count == count
        assert len(summary.chunk_indexes) == count
    with path.open("rb") as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
    data = records[: next(k for k, r in enumerate(records) if isinstance(r, DataEnd))]
    assert [r.topic for r in data if isinstance(r, Channel)] == ["/rare"]
    assert [r.name for r in data if isinstance(r, Schema)] == [VARYING.name]


def test_times_and_numbers_have_defaults(tmp_path: Path) -> None:
    """Published when logged; each channel counts its own messages across calls."""
    path = tmp_path / "out.mcap"
    with McapWriter(path) as out:
        one, other = out.add_channel("/one", FIXED), out.add_channel("/other", FIXED)
        for start in (0, 3):
            log_ns = EPOCH_NS + np.arange(start, start + 3) * 10
            data = np.full((3, 4), start, np.uint8)
            out.write(Batch(one, log_ns, data), Batch(other, log_ns[:2] + 5, data[:2]))
    with path.open("rb") as stream:
        found = [row_of(channel, m) for _, channel, m in make_reader(stream).iter_messages()]
    assert [row[1] for row in found if row[0] == "/one"] == [0, 1, 2, 3, 4, 5]
    assert [row[1] for row in found if row[0] == "/other"] == [0, 1, 2, 3]
    assert all(row[2] == row[3] for row in found)


@DEPRECATED
def test_calls_that_go_back_in_time_are_kept_in_the_order_of_the_calls(tmp_path: Path) -> None:
    """Within a call rows are sorted; the index still finds each message at its time."""
    path = tmp_path / "out.mcap"
    rng = np.random.default_rng(6)
    with McapWriter(path, chunk_bytes=1000) as out:
        channel = out.add_channel("/fixed", FIXED)
        for late in (500, 0, 250):
            log_ns = EPOCH_NS + late + rng.permutation(100)
            data = (log_ns - EPOCH_NS).astype("<u2").view(np.uint8).reshape(-1, 2)
            out.write(Batch(channel, log_ns, data))
    with path.open("rb") as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
    stands = [r.log_time - EPOCH_NS for r in records if isinstance(r, Message)]
    assert stands == [*range(500, 600), *range(100), *range(250, 350)]
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        found = [message for _, _, message in reader.iter_messages()]
        window = [
            m.log_time - EPOCH_NS
            for _, _, m in reader.iter_messages(start_time=EPOCH_NS + 90, end_time=EPOCH_NS + 510)
        ]
    assert [m.log_time - EPOCH_NS for m in found] == sorted(stands)
    assert all(struct.unpack("<H", m.data)[0] == m.log_time - EPOCH_NS for m in found)
    assert window == [*range(90, 100), *range(250, 350), *range(500, 510)]


def test_messages_of_one_time_keep_the_order_of_the_batches(tmp_path: Path) -> None:
    path = tmp_path / "out.mcap"
    log_ns = np.full(50, EPOCH_NS)
    with McapWriter(path) as out:
        channels = [out.add_channel(topic, FIXED) for topic in ("/a", "/b")]
        data = np.arange(50, dtype=np.uint8)[:, None]
        out.write(*(Batch(channel, log_ns, data) for channel in reversed(channels)))
    with path.open("rb") as stream:
        records = list(StreamReader(stream).records)
    found = [(r.channel_id, r.data[0]) for r in records if isinstance(r, Message)]
    assert found == [(2, k) for k in range(50)] + [(1, k) for k in range(50)]


def test_channels_of_another_file_are_copied_with_all_they_say(tmp_path: Path) -> None:
    """Encodings, metadata, a schema that is no text; one schema of two channels stands once."""
    path = tmp_path / "out.mcap"
    schema = Schema(id=9, data=b"\xff\x00\x01", encoding="protobuf", name="test.Blob")
    channels = [
        Channel(id=7, topic="/blob", message_encoding="protobuf", metadata={"k": "v"}, schema_id=9),
        Channel(id=8, topic="/more", message_encoding="protobuf", metadata={}, schema_id=9),
        Channel(id=9, topic="/bare", message_encoding="json", metadata={}, schema_id=0),
    ]
    with McapWriter(path, profile="", library="somebody") as out:
        numbers = [
            out.copy_channel(channel, schema if channel.schema_id else None) for channel in channels
        ]
        for number in reversed(numbers):
            out.write(Batch(number, np.array([EPOCH_NS]), np.frombuffer(b"{}", np.uint8)[None]))
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        header, summary = reader.get_header(), reader.get_summary()
        found = {
            channel.topic: (channel.message_encoding, channel.metadata, schema)
            for schema, channel, _ in reader.iter_messages()
        }
    assert (header.profile, header.library) == ("", "somebody")
    assert summary is not None
    assert len(summary.schemas) == 1
    kept = Schema(id=1, data=b"\xff\x00\x01", encoding="protobuf", name="test.Blob")
    assert found == {
        "/blob": ("protobuf", {"k": "v"}, kept),
        "/more": ("protobuf", {}, kept),
        "/bare": ("json", {}, None),
    }


def test_attachments_and_metadata_stand_among_the_messages(tmp_path: Path) -> None:
    path = tmp_path / "out.mcap"
    content = np.random.default_rng(1).bytes(100_000)
    topic = given("/blob", 500, 1_000_000)
    with McapWriter(path, chunk_bytes=CHUNK_BYTES) as out:
        out.add_metadata("first", {"a": "1", "ä": "ü"})
        channel = out.add_channel("/blob", VARYING)
        out.write(topic.batch(channel, 0, 400))
        out.add_attachment("site.toml", "application/toml", content, EPOCH_NS)
        out.write(topic.batch(channel, 400))
        out.add_metadata("last", {})
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        (attachment,) = reader.iter_attachments()
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        found = [row_of(channel, m) for _, channel, m in reader.iter_messages()]
        summary = reader.get_summary()
    assert (attachment.name, attachment.media_type) == ("site.toml", "application/toml")
    assert (attachment.log_time, attachment.create_time) == (EPOCH_NS, EPOCH_NS)
    assert attachment.data == content
    assert metadata == {"first": {"a": "1", "ä": "ü"}, "last": {}}
    assert found == topic.rows()
    assert summary is not None
    assert summary.statistics is not None
    assert (summary.statistics.attachment_count, summary.statistics.metadata_count) == (1, 2)
    data = path.read_bytes()
    (record,) = [record for record in records_of(path) if record.opcode == ATTACHMENT]
    (crc,) = struct.unpack_from("<I", data, record.start + record.length - 4)
    assert crc == zlib.crc32(data[record.start : record.start + record.length - 4])


# ---- when it goes wrong ------------------------------------------------------------------------


def test_a_killed_writer_leaves_all_its_whole_chunks(tmp_path: Path) -> None:
    """Killed by the system, with no chance to tidy up."""
    path = tmp_path / "out.mcap"
    code = f"""
        import os, signal, numpy as np
        from navgrade.logs.container import Batch, McapWriter
        from navgrade.logs.messages import Schema
        out = McapWriter({str(path)!r}, chunk_bytes=10_000)
        channel = out.add_channel("/fixed", Schema("test_msgs/msg/Blob", "uint8[] data"))
        out.write(Batch(channel, np.arange(1000), np.zeros((1000, 69), np.uint8)))
        out.add_metadata("waits", {{}})  # until all chunks sent are in the file
        os.kill(os.getpid(), signal.SIGKILL)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert [p.name for p in tmp_path.iterdir()] == ["out.mcap.part"]
    log = McapFile(tmp_path / "out.mcap.part")
    times = np.concatenate([part.log_time_ns for part in log.messages(lambda channel: True)])
    assert [issue.kind for issue in log.issues] == ["cut"]
    assert times.tolist() == list(range(len(times)))
    assert len(times) == 900  # a hundred a chunk; the last one was still being filled


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    with pytest.raises(error), McapWriter(tmp_path / "out.mcap", chunk_bytes=1000) as out:
        channel = out.add_channel("/fixed", FIXED)
        out.write(Batch(channel, np.arange(1000), np.zeros((1000, 69), np.uint8)))
        raise error
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no /dev/full here")
@pytest.mark.parametrize("count", [1, 100_000])
def test_a_full_disk_is_told_and_leaves_nothing(tmp_path: Path, count: int) -> None:
    """At the end, and early where there is much to write."""
    (tmp_path / "out.mcap.part").symlink_to("/dev/full")
    calls = 0
    with (
        pytest.raises(OSError, match="No space left"),
        McapWriter(tmp_path / "out.mcap", chunk_bytes=1000) as out,
    ):
        channel = out.add_channel("/fixed", FIXED)
        for calls in range(count):  # noqa: B007
            out.write(Batch(channel, np.arange(10), np.zeros((10, 69), np.uint8)))
    assert calls < 1000
    assert not list(tmp_path.iterdir())


def test_an_existing_file_is_kept_unless_told(tmp_path: Path) -> None:
    path = tmp_path / "out.mcap"
    path.write_bytes(b"old")
    with pytest.raises(ConfigError, match=r"out\.mcap exists"):
        McapWriter(path)
    assert path.read_bytes() == b"old"
    with McapWriter(path, overwrite=True):
        assert path.read_bytes() == b"old"
    assert path.read_bytes() != b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["out.mcap"]


def test_columns_of_different_lengths_are_refused() -> None:
    times, data = np.arange(3), np.zeros((3, 8), np.uint8)
    with pytest.raises(ValueError, match="3 log times"):
        Batch(1, times, data[:2])
    with pytest.raises(ValueError, match="3 log times"):
        Batch(1, times, data, publish_time_ns=times[:1])
    with pytest.raises(ValueError, match="3 log times"):
        Batch(1, times, data.reshape(-1), offsets=times, sizes=times[:2])


def test_an_unknown_compression_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="zstd, lz4, none"):
        McapWriter(tmp_path / "out.mcap", compression="gzip")
    assert not list(tmp_path.iterdir())
