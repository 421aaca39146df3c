"""A damaged log gives all it still holds, to the bit, and says what is gone and where."""

from __future__ import annotations

import http.server
import json
import struct
import threading
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.writer import IndexType
from numpy.typing import NDArray

from navgrade.errors import LogError
from navgrade.logs.container import Issue, McapFile
from tests.navgrade.logmaking import (
    EPOCH_NS,
    Channel,
    Record,
    Recording,
    chunks_of,
    imu_channel,
    invert,
    random_recording,
    records_of,
    text_channel,
    write_log,
)

COUNT = 6000
FIELDS = {"/imu": ("header.stamp", "angular_velocity", "linear_acceleration")}
MESSAGE, CHUNK, MESSAGE_INDEX, DATA_END, FOOTER = 0x05, 0x06, 0x07, 0x0F, 0x02
HEAD = 9  # bytes of opcode and length before a record's content
COMPRESSIONS = ("none", "lz4", "zstd")
NO_INDEX: dict[str, Any] = {"summary": False, "index": IndexType.NONE}

Rows = NDArray[np.int64]
RECORDING = random_recording(COUNT, 400.0)


def a_log(path: Path, *channels: Channel, **container: Any) -> Path:
    """Four chunks of 1,700 messages, 0.6 MB each before compression."""
    imu = imu_channel(RECORDING, "/imu")
    return write_log(path, imu, *channels, **{"chunk_bytes": 600_000, **container})


@dataclass(frozen=True)
class Read:
    """What came out of a log."""

    log: McapFile
    rows: Recording
    log_ns: NDArray[np.int64]

    @property
    def issues(self) -> list[Issue]:
        return self.log.issues


def read(source: Any, *, strict: bool = False, **window: int) -> Read:
    """Columns of the IMU, one behind the other."""
    log = McapFile(source, strict=strict)
    blocks = list(log.columns(FIELDS, **window))
    stamp, gyro, accel = (
        np.concatenate([block.fields[path] for block in blocks])
        if blocks
        else np.empty((0, 3) if path != "header.stamp" else 0)
        for path in FIELDS["/imu"]
    )
    log_ns = np.concatenate([np.empty(0, np.int64), *(block.log_time_ns for block in blocks)])
    return Read(log, Recording(stamp, gyro, accel), log_ns)


def exactly(found: Read, rows: Rows) -> None:
    """Check that these rows were delivered in order, to the bit, and no others."""
    truth = RECORDING.rows(rows)
    assert found.log_ns.tolist() == truth.stamp_ns.tolist()
    for name in ("stamp_ns", "gyro", "accel"):
        assert getattr(found.rows, name).tobytes() == getattr(truth, name).tobytes(), name


def rows_of_chunks(path: Path) -> list[Rows]:
    """Rows of the recording that each chunk holds, by the times at its head."""
    data = path.read_bytes()
    spans = [struct.unpack_from("<QQ", data, chunk.start) for chunk in chunks_of(path)]
    first = np.searchsorted(RECORDING.stamp_ns, [start for start, _ in spans])
    rows = np.split(np.arange(COUNT), first[1:])
    assert len(rows) == 4
    return rows


def without(chunks: list[Rows], *numbers: int) -> Rows:
    """All rows but those of some chunks."""
    return np.concatenate([rows for k, rows in enumerate(chunks) if k not in numbers])


def stored(path: Path, chunk: Record) -> tuple[int, str]:
    """Where the records of a chunk begin in the file, and their compression."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, chunk.start + 28)
    return chunk.start + 40 + length, data[chunk.start + 32 : chunk.start + 32 + length].decode()


def whole_messages(records: bytes) -> int:
    """Messages of a chunk's records before the first that is cut."""
    count = at = 0
    while at + HEAD <= len(records):
        opcode, length = struct.unpack_from("<BQ", records, at)
        at += HEAD + length
        count += opcode == MESSAGE and at <= len(records)
    return count


def unpacked(compression: str, beginning: bytes) -> bytes:
    """What the beginning of a compressed chunk still tells, by the codecs themselves."""
    if compression == "zstd":
        return zstandard.ZstdDecompressor().decompressobj().decompress(beginning)
    if compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(beginning))
    return beginning


def patched(path: Path, at: int, content: bytes) -> None:
    """Write over bytes of the file."""
    data = bytearray(path.read_bytes())
    data[at : at + len(content)] = content
    path.write_bytes(data)


def only(found: Read, kind: str) -> Issue:
    """The one issue of a reading."""
    assert [issue.kind for issue in found.issues] == [kind], found.issues
    (issue,) = found.issues
    return issue


def strictly_refused(path: Path) -> None:
    """Check that a strict reading raises the one family, naming the file."""
    with pytest.raises(LogError, match=path.name):
        read(path, strict=True)


# ---- not damaged, only unusual -----------------------------------------------------------------

UNUSUAL: dict[str, dict[str, Any]] = {
    "no message index": {"index": IndexType.ALL & ~IndexType.MESSAGE},
    "no chunk index": {"index": IndexType.MESSAGE},
    "no summary at all": NO_INDEX,
    "unchunked": {"chunked": False},
    "unchunked, no summary": {"chunked": False, **NO_INDEX},
}


@pytest.mark.parametrize("layout", UNUSUAL)
def test_indexes_and_chunks_may_be_missing(tmp_path: Path, layout: str) -> None:
    found = read(a_log(tmp_path / "a.mcap", **UNUSUAL[layout]), strict=True)
    exactly(found, np.arange(COUNT))
    assert not found.issues


def points(count: int = 300) -> Channel:
    """A topic no robot framework knows."""
    schema = json.dumps({"type": "object", "properties": {"x": {"type": "number"}}})
    messages = [json.dumps({"x": 0.1 * k}).encode() for k in range(count)]
    log_ns = [EPOCH_NS + 40_000_000 * k for k in range(count)]
    return Channel("/points", "demo.Point", schema, messages, log_ns, "jsonschema", "json")


def test_a_foreign_channel_beside_the_imu_is_no_obstacle(tmp_path: Path) -> None:
    path = a_log(tmp_path / "a.mcap", points())
    exactly(read(path, strict=True), np.arange(COUNT))
    blocks = list(McapFile(path, strict=True).columns({"/points": ("x",)}))
    x = np.concatenate([block.fields["x"] for block in blocks])
    assert x.tolist() == [0.1 * k for k in range(300)]


# ---- files that end early ----------------------------------------------------------------------


@pytest.mark.parametrize("zeros", [False, True])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_cut_log_gives_whole_chunks_and_the_beginning_of_the_cut_one(
    tmp_path: Path, compression: str, zeros: bool
) -> None:
    """Cut off, or left with zeros by a loss of power."""
    path = a_log(tmp_path / "a.mcap", compression=compression)
    chunks, cut = rows_of_chunks(path), chunks_of(path)[2]
    data, (begin, name) = path.read_bytes(), stored(path, chunks_of(path)[2])
    end = begin + (cut.start + cut.length - begin) * 7 // 10
    path.write_bytes(data[:end] + bytes(len(data) - end) * zeros)

    kept = whole_messages(unpacked(name, data[begin:end]))
    assert 0 < kept < len(chunks[2])
    found = read(path)
    rows = np.concatenate([chunks[0], chunks[1], chunks[2][:kept]])
    exactly(found, rows)
    issue = only(found, "cut")
    assert issue.offset == cut.start - HEAD
    first, last = RECORDING.stamp_ns[chunks[2][[0, -1]]]
    assert issue.start_ns is not None
    assert issue.end_ns is not None
    assert first <= issue.start_ns <= RECORDING.stamp_ns[rows[-1] + 1]
    assert issue.end_ns == last
    strictly_refused(path)


@pytest.mark.parametrize("where", [0.1, 0.5, 0.9])
def test_an_unchunked_log_that_is_cut_gives_its_whole_messages(
    tmp_path: Path, where: float
) -> None:
    path = a_log(tmp_path / "a.mcap", chunked=False)
    data = path.read_bytes()[: int(where * path.stat().st_size)]
    messages = [record for record in records_of(path) if record.opcode == MESSAGE]
    kept = sum(message.start + message.length <= len(data) for message in messages)
    cut = messages[kept]
    path.write_bytes(data)
    found = read(path)
    exactly(found, np.arange(kept))
    assert only(found, "cut").offset == cut.start - HEAD
    strictly_refused(path)


@pytest.mark.parametrize("missing", [1, 8, 9, 30, 300])
def test_a_log_cut_behind_its_data_has_lost_nothing_and_says_so(
    tmp_path: Path, missing: int
) -> None:
    path = a_log(tmp_path / "a.mcap")
    path.write_bytes(path.read_bytes()[:-missing])
    found = read(path)
    exactly(found, np.arange(COUNT))
    assert found.log.summary is None
    only(found, "cut")
    strictly_refused(path)


def test_what_was_attached_before_the_cut_is_still_attached(tmp_path: Path) -> None:
    path = a_log(tmp_path / "a.mcap", attachment=("notes.txt", b"wind from the left"))
    (end,) = [record for record in records_of(path) if record.opcode == DATA_END]
    path.write_bytes(path.read_bytes()[: end.start - HEAD])
    found = read(path)
    exactly(found, np.arange(COUNT))
    attached = [(a.name, a.media_type, a.data_size) for a in found.log.attachments]
    assert attached == [("notes.txt", "text/plain", len(b"wind from the left"))]


# ---- damaged chunks ----------------------------------------------------------------------------


def flip_a_bit_that_matters(path: Path, chunk: Record) -> None:
    """Near the middle of a chunk; a codec may say the same in another way."""
    begin, compression = stored(path, chunk)
    end = chunk.start + chunk.length
    packed = bytearray(path.read_bytes()[begin:end])
    records = unpacked(compression, bytes(packed))
    for at in range(len(packed) // 2, len(packed)):
        packed[at] ^= 0x10
        try:
            same = unpacked(compression, bytes(packed)) == records
        except (zstandard.ZstdError, RuntimeError):
            same = False
        if not same:
            break
        packed[at] ^= 0x10
    patched(path, begin, packed)


@pytest.mark.parametrize(
    ("number", "indexed"), [(0, True), (1, True), (3, True), (1, False), (3, False)]
)
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_one_flipped_bit_costs_its_chunk(
    tmp_path: Path, compression: str, number: int, indexed: bool
) -> None:
    path = a_log(tmp_path / "a.mcap", compression=compression, **({} if indexed else NO_INDEX))
    chunks, chunk = rows_of_chunks(path), chunks_of(path)[number]
    flip_a_bit_that_matters(path, chunk)

    found = read(path)
    exactly(found, without(chunks, number))
    issue = only(found, "chunk")
    assert issue.offset == chunk.start - HEAD
    assert issue.messages == (len(chunks[number]) if indexed else None)
    assert [issue.start_ns, issue.end_ns] == RECORDING.stamp_ns[chunks[number][[0, -1]]].tolist()
    strictly_refused(path)


def test_a_lost_description_of_the_topic_is_said(tmp_path: Path) -> None:
    """The first chunk is lost, and no summary repeats what its channel was."""
    path = a_log(tmp_path / "a.mcap", **NO_INDEX)
    chunk = chunks_of(path)[0]
    invert(path, chunk.start + chunk.length // 2)
    found = read(path)
    exactly(found, np.arange(0))
    assert "chunk" in [issue.kind for issue in found.issues]
    assert "channel" in [issue.kind for issue in found.issues]
    strictly_refused(path)


def test_an_unknown_compression_costs_its_chunk(tmp_path: Path) -> None:
    path = a_log(tmp_path / "a.mcap")
    chunks, chunk = rows_of_chunks(path), chunks_of(path)[1]
    patched(path, chunk.start + 32, b"zst9")
    found = read(path)
    exactly(found, without(chunks, 1))
    issue = only(found, "compression")
    assert "zst9" in issue.text
    assert issue.messages == len(chunks[1])
    strictly_refused(path)


def test_several_defects_each_cost_their_own(tmp_path: Path) -> None:
    """A damaged chunk, and the file cut in a later one."""
    path = a_log(tmp_path / "a.mcap", text_channel("/chatter"), compression="lz4")
    chunks = rows_of_chunks(path)
    damaged, cut = chunks_of(path)[1], chunks_of(path)[3]
    invert(path, damaged.start + damaged.length // 3, 4)
    path.write_bytes(path.read_bytes()[: cut.start + 20])
    found = read(path)
    exactly(found, np.concatenate([chunks[0], chunks[2]]))
    assert [issue.kind for issue in found.issues] == ["chunk", "cut"]
    assert found.issues[0].offset < found.issues[1].offset


# ---- numbers that cannot be --------------------------------------------------------------------


@pytest.mark.parametrize("length", [0, 1, 1 << 20, (1 << 32) - 1, 1 << 40, (1 << 64) - 1])
@pytest.mark.parametrize("indexed", [True, False])
def test_an_absurd_record_length_costs_its_chunk(
    tmp_path: Path, length: int, indexed: bool
) -> None:
    path = a_log(tmp_path / "a.mcap", **({} if indexed else NO_INDEX))
    chunks, chunk = rows_of_chunks(path), chunks_of(path)[1]
    patched(path, chunk.start - 8, struct.pack("<Q", length))
    found = read(path)
    exactly(found, without(chunks, 1))
    assert found.issues
    assert found.issues[0].offset == chunk.start - HEAD
    strictly_refused(path)


@pytest.mark.parametrize("size", [1 << 32, 1 << 40, (1 << 64) - 1])
@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_chunk_that_claims_too_much_is_not_unpacked(
    tmp_path: Path, compression: str, size: int
) -> None:
    path = a_log(tmp_path / "a.mcap", compression=compression)
    chunks, chunk = rows_of_chunks(path), chunks_of(path)[2]
    patched(path, chunk.start + 16, struct.pack("<Q", size))
    found = read(path)
    exactly(found, without(chunks, 2))
    assert only(found, "bomb").messages == len(chunks[2])
    strictly_refused(path)


def bombed(path: Path, number: int, records: bytes, size: int) -> None:
    """Put other compressed records in the place of a chunk's."""
    chunk, data = chunks_of(path)[number], path.read_bytes()
    begin, _ = stored(path, chunk)
    head = bytearray(data[chunk.start : begin])
    struct.pack_into("<Q", head, 16, size)
    struct.pack_into("<Q", head, len(head) - 8, len(records))
    record = struct.pack("<BQ", CHUNK, len(head) + len(records)) + head + records
    rest = data[chunk.start + chunk.length :]
    path.write_bytes(data[: chunk.start - HEAD] + record + rest)


@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("claimed", [600_000, 2 << 30])
def test_two_gigabytes_of_zeros_in_a_chunk_are_not_unpacked(
    tmp_path: Path, claimed: int, told: bool
) -> None:
    """65 kB of zstd that claim their size truly, or the size of the chunk before."""
    block = bytes(1 << 20)
    packer = zstandard.ZstdCompressor(1).compressobj(2 << 30 if told else -1)
    zeros = b"".join([*(packer.compress(block) for _ in range(2048)), packer.flush()])
    path = a_log(tmp_path / "a.mcap")
    chunks = rows_of_chunks(path)
    bombed(path, 2, zeros, claimed)
    found = read(path)
    exactly(found, without(chunks, 2))
    assert found.issues[0].kind == ("bomb" if claimed > 1 << 30 else "chunk")
    strictly_refused(path)


def shortened_message(path: Path, length: int) -> None:
    """Give the tenth message of an uncompressed second chunk another length, the sum mended."""
    chunk = chunks_of(path)[1]
    data = bytearray(path.read_bytes())
    begin, end = stored(path, chunk)[0], chunk.start + chunk.length
    at = begin
    for _ in range(9):
        at += HEAD + struct.unpack_from("<Q", data, at + 1)[0]
    struct.pack_into("<Q", data, at + 1, length)
    struct.pack_into("<I", data, chunk.start + 24, zlib.crc32(data[begin:end]))
    path.write_bytes(data)


@pytest.mark.parametrize("length", [3, 1 << 30, (1 << 64) - 1])
def test_a_message_that_does_not_fit_its_chunk_ends_it(tmp_path: Path, length: int) -> None:
    """Written so: the checksum agrees. What stands behind cannot be found by scanning."""
    path = a_log(tmp_path / "a.mcap", compression="none", **NO_INDEX)
    chunks = rows_of_chunks(path)
    shortened_message(path, length)
    found = read(path)
    exactly(found, np.concatenate([chunks[0], chunks[1][:9], chunks[2], chunks[3]]))
    assert "record" in [issue.kind for issue in found.issues]
    strictly_refused(path)


# ---- damage beside the messages ----------------------------------------------------------------


def test_a_damaged_summary_is_not_believed(tmp_path: Path) -> None:
    """The topic's name in the summary is another; its checksum tells."""
    path = a_log(tmp_path / "a.mcap")
    at = path.read_bytes().rindex(b"/imu")
    patched(path, at, b"/umi")
    found = read(path)
    exactly(found, np.arange(COUNT))
    assert found.log.summary is None
    only(found, "summary")
    strictly_refused(path)


@pytest.mark.parametrize("at", [0, 8, 16])
def test_a_footer_that_points_elsewhere_is_not_believed(tmp_path: Path, at: int) -> None:
    path = a_log(tmp_path / "a.mcap")
    footer = records_of(path)[-1]
    assert footer.opcode == FOOTER
    invert(path, footer.start + at)
    found = read(path)
    exactly(found, np.arange(COUNT))
    only(found, "summary")
    strictly_refused(path)


def test_a_flipped_bit_without_chunks_is_noticed(tmp_path: Path) -> None:
    """One checksum covers all: nothing tells which message is wrong, so all are given."""
    path = a_log(tmp_path / "a.mcap", chunked=False)
    message = [record for record in records_of(path) if record.opcode == MESSAGE][700]
    invert(path, message.start + message.length - 80)  # z of linear_acceleration
    found = read(path)
    assert len(found.rows) == COUNT
    assert found.rows.accel[700, 2] != RECORDING.accel[700, 2]
    assert only(found, "checksum").messages is None
    strictly_refused(path)


@pytest.mark.parametrize("add", [1, 364, 1 << 40])
def test_a_lying_message_index_moves_no_value(tmp_path: Path, add: int) -> None:
    """All offsets of a chunk's index point into or between messages, or outside."""
    path = a_log(tmp_path / "a.mcap", text_channel("/chatter"))
    (index, *_) = [record for record in records_of(path) if record.opcode == MESSAGE_INDEX]
    data = bytearray(path.read_bytes())
    for at in range(index.start + 6, index.start + index.length, 16):
        (offset,) = struct.unpack_from("<Q", data, at + 8)
        struct.pack_into("<Q", data, at + 8, offset + add)
    path.write_bytes(data)
    exactly(read(path), np.arange(COUNT))


def test_attachments_outlive_a_damaged_chunk(tmp_path: Path) -> None:
    path = a_log(tmp_path / "a.mcap", attachment=("notes.txt", b"wind from the left"))
    chunk = chunks_of(path)[1]
    invert(path, chunk.start + chunk.length // 2)
    found = read(path)
    attached = [(a.name, a.media_type, a.data_size) for a in found.log.attachments]
    assert attached == [("notes.txt", "text/plain", len(b"wind from the left"))]


def test_a_window_beside_the_damage_knows_nothing_of_it(tmp_path: Path) -> None:
    path = a_log(tmp_path / "a.mcap")
    chunks, chunk = rows_of_chunks(path), chunks_of(path)[1]
    invert(path, chunk.start + chunk.length // 2)
    start, end = (int(RECORDING.stamp_ns[k]) for k in (chunks[2][5], chunks[3][7]))
    found = read(path, start_ns=start, end_ns=end)
    exactly(found, np.arange(chunks[2][5], chunks[3][7]))
    assert not found.issues


# ---- over the network --------------------------------------------------------------------------


class Counting(http.server.BaseHTTPRequestHandler):
    """Serves one file by ranges and counts what is asked for."""

    content = b""
    requests = 0
    sent = 0

    def do_HEAD(self) -> None:
        type(self).requests += 1
        self.send_response(200)
        self.send_header("Content-Length", str(len(self.content)))
        self.send_header("Accept-Ranges", "bytes")
        self.end_headers()

    def do_GET(self) -> None:
        cls = type(self)
        cls.requests += 1
        first, last = 0, len(self.content) - 1
        asked = self.headers.get("Range")
        if asked is not None:
            words = asked.removeprefix("bytes=").split("-")
            first, last = int(words[0]), min(int(words[1] or last), last)
        piece = self.content[first : last + 1]
        cls.sent += len(piece)
        self.send_response(200 if asked is None else 206)
        self.send_header("Content-Length", str(len(piece)))
        self.send_header("Accept-Ranges", "bytes")
        self.send_header("Content-Range", f"bytes {first}-{last}/{len(self.content)}")
        self.end_headers()
        self.wfile.write(piece)

    def log_message(self, *_: Any) -> None:
        """Nothing is printed."""


@pytest.fixture
def served() -> Iterator[Callable[[Path], tuple[str, type[Counting]]]]:
    """Serve a file on this machine: its address, and the counts."""
    pytest.importorskip("fsspec", reason="fsspec is not installed: extra `remote`")
    pytest.importorskip("aiohttp", reason="aiohttp is not installed: extra `remote`")
    handler = type("Handler", (Counting,), {"requests": 0, "sent": 0})
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()

    def serve(path: Path) -> tuple[str, type[Counting]]:
        handler.content = path.read_bytes()
        return f"http://127.0.0.1:{server.server_port}/{path.name}", handler

    yield serve
    server.shutdown()
    server.server_close()
    thread.join()


def test_ten_seconds_over_the_network_take_few_large_requests(
    tmp_path: Path, served: Callable[[Path], tuple[str, type[Counting]]]
) -> None:
    """10 of 100 s at 400 Hz; the file's chunks of 1 MiB hold 7 s each, a quarter of a megabyte.

    Size, end and summary, and the two or three chunks take a request each at most; a mebibyte
    beside the chunks is room for reading ahead.
    """
    recording = random_recording(40_000, 400.0)
    path = write_log(tmp_path / "a.mcap", imu_channel(recording, "/imu"), points())
    chunks = [chunk.length for chunk in chunks_of(path)]
    url, counts = served(path)
    start, end = EPOCH_NS + 50_000_000_000, EPOCH_NS + 60_000_000_000
    found = read(url, start_ns=start, end_ns=end)
    rows = (recording.stamp_ns >= start) & (recording.stamp_ns < end)
    assert found.rows.gyro.tobytes() == recording.gyro[rows].tobytes()
    assert found.rows.stamp_ns.tolist() == recording.stamp_ns[rows].tolist()
    assert not found.issues
    assert counts.requests <= 8
    assert counts.sent <= 3 * max(chunks) + (1 << 20)
    assert counts.sent < path.stat().st_size // 2


def test_a_damaged_log_over_the_network_gives_the_same(
    tmp_path: Path, served: Callable[[Path], tuple[str, type[Counting]]]
) -> None:
    path = a_log(tmp_path / "a.mcap", compression="lz4")
    chunks, (_, damaged, _, cut) = rows_of_chunks(path), chunks_of(path)
    invert(path, damaged.start + damaged.length // 2)
    (begin, name), end = stored(path, cut), cut.start + cut.length // 2
    path.write_bytes(path.read_bytes()[:end])
    kept = whole_messages(unpacked(name, path.read_bytes()[begin:]))
    found = read(served(path)[0])
    exactly(found, np.concatenate([chunks[0], chunks[2], chunks[3][:kept]]))
    assert found.issues == read(path).issues
    assert [issue.kind for issue in found.issues] == ["chunk", "cut"]
