"""Other people's software takes what we write, finds no fault, and reads the same bytes."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import os
import shutil
import struct
import subprocess
import sys
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, DataEnd, Message
from mcap.stream_reader import StreamReader
from rosbags.highlevel import AnyReader

from navgrade.logs import SolutionWriter
from navgrade.logs.container.writer import Batch, McapWriter
from navgrade.logs.messages import Schema
from tests.navgrade.logmaking import (
    EPOCH_NS,
    IMU,
    IMU_TEXT,
    INCREMENT,
    INCREMENT_TEXT,
    STRING,
    STRING_TEXT,
    messages_of,
    random_recording,
)
from tests.navgrade.logs.decoding import NODE_FOLDER
from tests.navgrade.logs.test_output import a_trajectory

ATTACHED = bytes(range(256)) * 20
NOTES = {"version": "0.1", "gaps": "0", "text": "ünïcode\nand lines"}
FILES = ("zstd", "lz4", "none", "solution")

Row = tuple[int, int, int, bytes]  # sequence, log time, publish time (ns), data
Topics = dict[str, list[Row]]


def digest(rows: Iterable[Row]) -> list[Any]:
    """Count of the messages and a SHA-256 over all of each."""
    found, count = hashlib.sha256(), 0
    for sequence, log_ns, publish_ns, data in rows:
        found.update(struct.pack("<IQQI", sequence, log_ns, publish_ns, len(data)) + data)
        count += 1
    return [count, found.hexdigest()]


def digests(topics: Topics) -> dict[str, list[Any]]:
    """Of every topic."""
    return {name: digest(rows) for name, rows in topics.items()}


def several_topics(path: Path, compression: str) -> Topics:
    """Three topics of other rates and sizes, written in slabs; what was put in is returned."""
    truth: Topics = {"/imu": [], "/increments": [], "/chatter": []}
    imu = messages_of(random_recording(4000, 400.0))
    recording = random_recording(1000, 100.0)
    increments = messages_of(recording.as_increments(np.full(1000, 0.01)), ("body",))
    texts = [("word " * (k % 7)).encode() + b"\0" for k in range(300)]
    chatter = [b"\0\1\0\0" + struct.pack("<I", len(text)) + text for text in texts]
    with McapWriter(path, compression=compression, chunk_bytes=200_000) as out:
        schemas = (Schema(IMU, IMU_TEXT), Schema(INCREMENT, INCREMENT_TEXT))
        numbers = [
            out.add_channel(topic, schema)
            for topic, schema in zip(truth, (*schemas, Schema(STRING, STRING_TEXT)), strict=True)
        ]
        out.add_attachment("site.toml", "application/toml", ATTACHED, EPOCH_NS)
        for slab in range(10):
            batches = []
            for number, topic, messages, step_ns in zip(
                numbers,
                truth,
                (imu, increments, chatter),
                (2_500_000, 10_000_000, 33_333_333),
                strict=True,
            ):
                size = len(messages) // 10
                rows = np.arange(slab * size, (slab + 1) * size)
                mine = messages[rows[0] : rows[-1] + 1]
                log_ns = EPOCH_NS + rows * step_ns
                sizes = np.array([len(message) for message in mine])
                publish_ns = log_ns - 77 if topic == "/imu" else log_ns
                batches.append(
                    Batch(
                        number,
                        log_ns,
                        np.frombuffer(b"".join(mine), np.uint8),
                        publish_time_ns=publish_ns if topic == "/imu" else None,
                        sequence=(7 * rows).astype(np.uint32) if topic == "/imu" else None,
                        offsets=np.cumsum(sizes) - sizes,
                        sizes=sizes,
                    )
                )
                sequence = 7 * rows if topic == "/imu" else rows
                truth[topic] += zip(
                    sequence.tolist(), log_ns.tolist(), publish_ns.tolist(), mine, strict=True
                )
            out.write(*batches)
        out.add_metadata("navgrade.provenance", NOTES)
    return truth


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Topics]]:
    """Files by name, each with what it must hold; of the solution by the official reader."""
    folder = tmp_path_factory.mktemp("conformance")
    found = {}
    for compression in ("zstd", "lz4", "none"):
        path = folder / f"{compression}.mcap"
        found[compression] = path, several_topics(path, compression)
    path, (nav, _) = folder / "solution.mcap", a_trajectory(5000)
    with SolutionWriter(path, location_fix=True) as out:
        for start in range(0, len(nav), 700):
            out.write(nav[start : start + 700])
        out.file.add_attachment("site.toml", "application/toml", ATTACHED, EPOCH_NS)
        out.file.add_metadata("navgrade.provenance", NOTES)
    found["solution"] = path, by_official(path)
    assert len(found["solution"][1]) == 5  # topics
    assert len(found["solution"][1]["/navgrade/solution"]) == len(nav)
    return found


def by_official(path: Path) -> Topics:
    """The official reader from front to back, the sums of chunks and of the data verified."""
    names: dict[int, str] = {}
    topics: Topics = {}
    with path.open("rb") as stream:
        for record in StreamReader(stream, validate_crcs=True).records:
            if isinstance(record, Channel):
                names[record.id] = record.topic
            elif isinstance(record, Message):
                row = (record.sequence, record.log_time, record.publish_time, record.data)
                topics.setdefault(names[record.channel_id], []).append(row)
    return topics


@pytest.mark.parametrize("name", FILES)
def test_the_official_reader_finds_all_of_it(
    files: dict[str, tuple[Path, Topics]], name: str
) -> None:
    path, truth = files[name]
    assert digests(by_official(path)) == digests(truth)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        indexed: Topics = {}
        last_ns = 0
        for _, channel, m in reader.iter_messages():
            assert m.log_time >= last_ns
            last_ns = m.log_time
            row = (m.sequence, m.log_time, m.publish_time, m.data)
            indexed.setdefault(channel.topic, []).append(row)
        assert digests(indexed) == digests(truth)
        assert [(a.name, a.data) for a in reader.iter_attachments()] == [("site.toml", ATTACHED)]
        assert [(m.name, m.metadata) for m in reader.iter_metadata()] == [
            ("navgrade.provenance", NOTES)
        ]


@pytest.mark.parametrize("name", FILES)
def test_no_checksum_is_left_out(files: dict[str, tuple[Path, Topics]], name: str) -> None:
    """Zero means that none is given; the summary's the official Python reader does not verify."""
    path = files[name][0]
    with path.open("rb") as stream:
        records = list(StreamReader(stream, emit_chunks=True, validate_crcs=True).records)
    assert all(record.uncompressed_crc for record in records if isinstance(record, Chunk))
    assert all(record.data_section_crc for record in records if isinstance(record, DataEnd))
    data = path.read_bytes()
    start, _, crc = struct.unpack("<QQI", data[-28:-8])
    assert crc == zlib.crc32(data[start:-12]) != 0


def doctor() -> str:
    """The official command-line tool, whose binary comes inside a wheel."""
    spec = importlib.util.find_spec("databeam_mcap_reader")
    if spec is None or spec.origin is None:
        pytest.skip("the mcap tool is not installed: pip install databeam-mcap-reader")
    tool = Path(spec.origin).with_name("mcap_cli")
    if not os.access(tool, os.X_OK):
        pytest.skip(f"databeam-mcap-reader has no mcap tool for {sys.platform}")
    return str(tool)


def diagnosis(path: Path) -> subprocess.CompletedProcess[str]:
    """What the official command-line tool says of a file."""
    command = [doctor(), "doctor", "--strict-message-order", str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("name", FILES)
def test_the_doctor_finds_nothing(files: dict[str, tuple[Path, Topics]], name: str) -> None:
    done = diagnosis(files[name][0])
    said = done.stdout.splitlines() + done.stderr.splitlines()
    assert done.returncode == 0, done
    assert [line for line in said if not line.startswith("Examining ")] == []


def test_the_doctor_finds_a_wrong_index(
    files: dict[str, tuple[Path, Topics]], tmp_path: Path
) -> None:
    """It would say if there were something."""
    data = files["none"][0].read_bytes()
    start, offsets, _ = struct.unpack("<QQI", data[-28:-8])
    at = data.index(b"\x08", data.rindex(STRING_TEXT.encode()))
    assert start < at < offsets
    path = tmp_path / "wrong.mcap"
    path.write_bytes(data[: at + 9] + bytes([data[at + 9] ^ 1]) + data[at + 10 :])
    assert diagnosis(path).returncode == 1


@pytest.mark.parametrize("name", FILES)
def test_javascript_reads_the_same_bytes(files: dict[str, tuple[Path, Topics]], name: str) -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node.js is not installed")
    if not (NODE_FOLDER / "node_modules").is_dir():
        pytest.skip("the JavaScript libraries are not installed: run `npm ci` in tests/node")
    path, truth = files[name]
    command = [node, "verify.mjs", str(path)]
    done = subprocess.run(command, cwd=NODE_FOLDER, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    answer = json.loads(done.stdout)
    assert answer["streamed"] == digests(truth)
    assert answer["indexed"] == digests(truth)
    assert answer["attachments"] == [["site.toml", ATTACHED.hex()]]
    assert answer["metadata"] == [["navgrade.provenance", NOTES]]


@pytest.mark.parametrize("name", FILES)
def test_rosbags_reads_the_same_bytes(files: dict[str, tuple[Path, Topics]], name: str) -> None:
    path, truth = files[name]
    found: dict[str, list[tuple[int, bytes]]] = {topic: [] for topic in truth}
    with AnyReader([path]) as reader:
        for connection, log_ns, data in reader.messages():
            found[connection.topic].append((log_ns, bytes(data)))
    for topic, rows in truth.items():
        assert found[topic] == [(log_ns, data) for _, log_ns, _, data in rows]


@pytest.mark.parametrize("name", FILES)
def test_rerun_finds_nothing(files: dict[str, tuple[Path, Topics]], name: str) -> None:
    folders = os.pathsep.join((str(Path(sys.executable).parent), os.environ.get("PATH", "")))
    rerun = shutil.which("rerun", path=folders)
    if rerun is None:
        pytest.skip("rerun is not installed: extra `conformance`")
    command = [rerun, "mcap", "check", "--full", str(files[name][0])]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
