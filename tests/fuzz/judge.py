"""What a reading of a mutated log may be, and what it must not."""

from __future__ import annotations

import io
import struct
import tempfile
import traceback
from collections.abc import Callable
from dataclasses import dataclass, field
from random import Random

import lz4.frame
import numpy as np
import zstandard
from fsspec.implementations.memory import MemoryFileSystem

from navgrade.errors import NavgradeError
from navgrade.imu import ImuSamples
from navgrade.logs import open_imu
from navgrade.logs.audit import audit
from navgrade.logs.container import Columns, Issue, McapFile
from tests.fuzz.corpus import Sample
from tests.fuzz.mutate import CHUNK, CHUNK_HEAD, DATA_END, HEAD, Mutant, split

ROUTES = {"columns": 10, "messages": 7, "imu": 2, "audit": 1}  # with their weights
GOOD = ("whole", "defects told", "refused")
KINDS = {"cut", "chunk", "compression", "record", "checksum", "summary", "bomb", "channel"}


@dataclass(frozen=True)
class How:
    """What is read, and the options of the reading.

    `route` is ``messages``, ``columns``, ``imu`` (samples for navigation) or ``audit``. The last
    two know only `strict`; to an audit it means that everything is read.
    """

    route: str
    strict: bool = False
    threads: int = 1
    window: tuple[int, int] | None = None
    remote: bool = False


def choose(rng: Random, sample: Sample) -> How:
    """Mostly a plain reading of everything."""
    window = None
    if rng.random() < 0.2:
        times = [int(t) for topic in sample.topics.values() for t in topic.log_ns]
        start, end = sorted((rng.choice(times), rng.choice(times)))
        window = (start, end)
    (route,) = rng.choices(tuple(ROUTES), tuple(ROUTES.values()))
    strict, two, remote = (rng.random() < part for part in (0.2, 0.1, 0.1))
    return How(route, strict, 1 + two, window, remote)


@dataclass
class Reading:
    """What a reader gave, by the route it took, and the defects it told of."""

    rows: list[tuple[str, int, int, int, bytes]] = field(default_factory=list)
    columns: list[Columns] = field(default_factory=list)
    samples: list[ImuSamples] = field(default_factory=list)
    issues: list[Issue] = field(default_factory=list)


Reader = Callable[[bytes, Sample, How], Reading]


def by_navgrade(data: bytes, sample: Sample, how: How) -> Reading:
    """Read with the reader under test."""
    if how.route in ("imu", "audit"):
        return _for_navigation(data, sample, how)
    source: str | io.BytesIO = io.BytesIO(data)
    if how.remote:
        MemoryFileSystem().pipe_file("/fuzz.mcap", data)
        source = "memory://fuzz.mcap"
    log = McapFile(source, strict=how.strict)
    start, end = how.window or (None, None)
    reading = Reading(issues=log.issues)
    if how.route == "columns":
        fields = {name: tuple(topic.columns) for name, topic in sample.topics.items()}
        for block in log.columns(fields, start_ns=start, end_ns=end, threads=how.threads):
            reading.columns.append(block)
    else:
        for run in log.messages(lambda _: True, start_ns=start, end_ns=end, threads=how.threads):
            topic, whole = log.channels[run.channel].topic, bytes(run.data)
            for k in range(len(run.offsets)):
                at, size = int(run.offsets[k]), int(run.sizes[k])
                numbers = run.sequence[k], run.log_time_ns[k], run.publish_time_ns[k]
                reading.rows.append((topic, *map(int, numbers), whole[at : at + size]))
    return reading


def _for_navigation(data: bytes, sample: Sample, how: How) -> Reading:
    with tempfile.NamedTemporaryFile(prefix="navgrade-fuzz-", suffix=".mcap") as file:
        file.write(data)
        file.flush()
        if how.route == "audit":
            return Reading(issues=audit(file.name, deep=how.strict).issues)
        topic = next(name for name in sample.topics if name.startswith("/imu"))
        log = open_imu(file.name, topic, "average", "FRD", strict=how.strict)
        return Reading(samples=list(log.blocks()), issues=log.issues)


@dataclass(frozen=True)
class Verdict:
    """One of GOOD, or a failure and its story."""

    outcome: str
    story: str = ""


def examine(mutant: Mutant, sample: Sample, how: How, reader: Reader) -> Verdict:
    """Read a mutant and judge the reading."""
    data = mutant.data
    try:
        reading = reader(data, sample, how)
    except NavgradeError:
        return Verdict("refused")
    except MemoryError:
        return Verdict("memory", traceback.format_exc(limit=-4))
    except Exception:
        return Verdict("foreign error", traceback.format_exc(limit=-4))
    for issue in reading.issues:
        if story := _senseless(issue, len(data)):
            return Verdict("senseless issue", story)
    if how.strict and how.route != "audit" and reading.issues:
        return Verdict("not strict", str(reading.issues))
    if not mutant.forged:
        found, wrong = _compare(reading, sample, how)
        if wrong and not _excused(wrong, data, sample, reading.issues):
            return Verdict("wrong value", f"{wrong[0].story}; issues {reading.issues}")
        counted = how.route in ("messages", "columns") and how.window is None
        told = reading.issues or mutant.misled or _a_checksum_is_missing(data)
        if counted and not told and found != _expected(sample):
            lost = len(_expected(sample) - found)
            return Verdict("silent loss", f"{lost} messages are missing, no issue")
    return Verdict("defects told" if reading.issues else "whole")


def _senseless(issue: Issue, size: int) -> str:
    if not 0 <= issue.offset <= size:
        return f"{issue} lies outside the {size} bytes of the file"
    if issue.kind not in KINDS or not issue.text:
        return f"{issue} has no known kind or no text"
    if issue.messages is not None and issue.messages < 0:
        return f"{issue} lost fewer than no messages"
    return ""


@dataclass(frozen=True)
class Wrong:
    """A row that differs from the original, and its payload where known."""

    story: str
    payload: bytes | None = None


def _expected(sample: Sample) -> set[tuple[str, int]]:
    return {(n, k) for n, topic in sample.topics.items() for k in range(len(topic.messages))}


def _compare(
    reading: Reading, sample: Sample, how: How
) -> tuple[set[tuple[str, int]], list[Wrong]]:
    """Rows found, and what is wrong with them."""
    found: set[tuple[str, int]] = set()
    wrong: list[Wrong] = []
    start, end = how.window or (0, 1 << 63)
    for name, sequence, log_ns, publish_ns, payload in reading.rows:
        topic = sample.topics.get(name)
        if topic is None or sequence >= len(topic.messages):
            wrong.append(Wrong(f"{name} message {sequence} never was", payload))
        elif (log_ns, publish_ns) != (topic.log_ns[sequence], topic.publish_ns[sequence]):
            wrong.append(Wrong(f"{name} message {sequence} has another time", payload))
        elif payload != topic.messages[sequence]:
            wrong.append(Wrong(f"{name} message {sequence} has another payload", payload))
        elif not start <= log_ns < end:
            wrong.append(Wrong(f"{name} message {sequence} lies outside the window", payload))
        found.add((name, sequence))
    for block in reading.columns:
        topic = sample.topics[block.topic]
        found.update((block.topic, int(k)) for k in block.sequence)
        rows = block.sequence.astype(np.int64)
        if np.any(rows >= len(topic.messages)):
            wrong.append(Wrong(f"{block.topic} has a message that never was"))
            continue
        if np.any((block.log_time_ns < start) | (block.log_time_ns >= end)):
            wrong.append(Wrong(f"{block.topic} has a message outside the window"))
        truth = {path: values[rows] for path, values in topic.columns.items()}
        truth |= {"log time": topic.log_ns[rows], "publish time": topic.publish_ns[rows]}
        given = {"log time": block.log_time_ns, "publish time": block.publish_time_ns}
        for path, values in {**block.fields, **given}.items():
            if values.shape != truth[path].shape or not _equal(values, truth[path]):
                wrong.append(Wrong(f"{block.topic} {path} has another value"))
    recorded = {
        row.tobytes()
        for name, topic in sample.topics.items()
        if name.startswith("/imu")
        for row in topic.columns["angular_velocity"]
    }
    for samples in reading.samples:
        if not {row.tobytes() for row in samples.gyro} <= recorded:
            wrong.append(Wrong("a sample was never recorded"))
    return found, wrong


def _equal(one: np.ndarray, other: np.ndarray) -> bool:
    if one.dtype != other.dtype:
        return False
    if one.dtype == object:
        return one.tolist() == other.tolist()
    return one.tobytes() == np.ascontiguousarray(other).tobytes()


def _excused(wrong: list[Wrong], data: bytes, sample: Sample, issues: list[Issue]) -> bool:
    """No checksum covers these rows, or an issue says that one does not match."""
    if any(issue.kind == "checksum" for issue in issues):
        return True
    if issues and not sample.chunked:  # the one checksum stands at the end
        return True
    cut = [issue.offset for issue in issues if issue.kind == "cut"]
    if cut and any(row.payload is None or row.payload in _prefix(data, cut[0]) for row in wrong):
        return True
    return _a_checksum_is_missing(data)


def _a_checksum_is_missing(data: bytes) -> bool:
    """Four zeros stand in its place: none is given."""
    return any(not any(part[at : at + 4]) for part in split(data) for at in _checksums(part))


def _checksums(part: bytes) -> list[int]:
    """Where a record has a checksum of messages."""
    if part[:1] == bytes([CHUNK]) and len(part) >= HEAD.size + CHUNK_HEAD.size:
        return [HEAD.size + 24]
    return [HEAD.size] if part[:1] == bytes([DATA_END]) else []


def _prefix(data: bytes, offset: int) -> bytes:
    """What can be decompressed of a cut chunk."""
    head = offset + HEAD.size
    if data[offset : offset + 1] != bytes([CHUNK]) or len(data) < head + CHUNK_HEAD.size:
        return b""
    (length,) = struct.unpack_from("<I", data, head + CHUNK_HEAD.size - 4)
    at = head + CHUNK_HEAD.size + length
    name, stored = data[at - length : at], data[at + 8 :]
    try:
        if name == b"zstd":
            return zstandard.ZstdDecompressor().decompressobj().decompress(stored)
        if name == b"lz4":
            return lz4.frame.LZ4FrameDecompressor().decompress(stored)
    except (zstandard.ZstdError, RuntimeError):
        return stored
    return stored
