"""``navgrade run`` killed while it writes: what it leaves behind is whole, or readable so far."""

from __future__ import annotations

import io
import math
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.records import Channel, Chunk, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from navgrade.logs.container import McapFile
from tests.fuzz.mutate import CHUNK, HEAD, MAGIC
from tests.navgrade.logmaking import SITE, imu_channel, resting, write_log

RATE = 1000.0  # Hz

Row = tuple[int, int, int, bytes]  # sequence, log time, publish time (ns), data
Topics = dict[str, list[Row]]


@dataclass(frozen=True)
class Run:
    """One run, made ready."""

    log: Path
    site: Path
    out: Path

    @property
    def part(self) -> Path:
        return self.out.with_name(self.out.name + ".part")

    def start(self) -> subprocess.Popen[bytes]:
        """Start it, and return when it begins to write."""
        command = [sys.executable, "-m", "navgrade", "run", str(self.log)]
        command += ["-c", str(self.site), "-o", str(self.out)]
        process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
        while process.poll() is None and not self.part.exists():
            time.sleep(1e-3)
        return process

    def written(self) -> float:
        """Bytes in the part, without end when it has become the output."""
        try:
            return self.part.stat().st_size
        except FileNotFoundError:
            return math.inf

    def clear(self) -> None:
        """Remove what it left."""
        self.out.unlink(missing_ok=True)
        self.part.unlink(missing_ok=True)


def prepare(folder: Path, seconds: float) -> Run:
    """A log of increments at 1 kHz and its site file."""
    recording = resting(seconds, RATE, sway_from_s=10.5)
    increments = recording.as_increments(np.full(len(recording), 1.0 / RATE))
    log = write_log(folder / "drive.mcap", imu_channel(increments))
    site = folder / "site.toml"
    site.write_text(SITE.replace('kind = "average"\n', ""))
    return Run(log, site, folder / "nav.mcap")


def by_official(path: Path) -> Topics:
    """All messages of a whole file, every checksum verified."""
    names: dict[int, str] = {}
    topics: Topics = {}
    with path.open("rb") as stream:
        for record in StreamReader(stream, validate_crcs=True).records:
            _add(record, names, topics)
    return topics


def in_whole_chunks(part: Path) -> tuple[int, Topics]:
    """Count of the whole chunks of an unfinished file, and their messages."""
    names: dict[int, str] = {}
    topics: Topics = {}
    count = 0
    for content in _chunks(part.read_bytes()):
        chunk = Chunk.read(ReadDataStream(io.BytesIO(content)))
        for record in breakup_chunk(chunk, validate_crc=True):
            _add(record, names, topics)
        count += 1
    return count, topics


def _chunks(data: bytes) -> Iterator[bytes]:
    """Contents of the whole chunks."""
    at = len(MAGIC)
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        end = at + HEAD.size + length
        if opcode == CHUNK and end <= len(data):
            yield data[at + HEAD.size : end]
        at = end


def _add(record: object, names: dict[int, str], topics: Topics) -> None:
    if isinstance(record, Channel):
        names[record.id] = record.topic
    elif isinstance(record, Message):
        row = (record.sequence, record.log_time, record.publish_time, record.data)
        topics.setdefault(names[record.channel_id], []).append(row)


def by_navgrade(path: Path) -> Topics:
    """All messages the reader under test finds."""
    log = McapFile(path)
    topics: Topics = {}
    for run in log.messages(lambda _: True):
        rows = topics.setdefault(log.channels[run.channel].topic, [])
        for k in range(len(run)):
            at, size = int(run.offsets[k]), int(run.sizes[k])
            numbers = run.sequence[k], run.log_time_ns[k], run.publish_time_ns[k]
            rows.append((*map(int, numbers), bytes(run.data[at : at + size])))
    return topics


def left_behind(run: Run, reference: Topics) -> str:
    """Say what a killed run left; AssertionError when it is neither whole nor readable so far."""
    if run.out.exists():
        assert by_official(run.out) == reference, "the output is not whole"
        assert not run.part.exists(), "there is an output and a part of it"
        return "the whole output"
    if not run.part.exists() or run.part.stat().st_size < len(MAGIC):
        return "nothing"
    count, promised = in_whole_chunks(run.part)
    found = by_navgrade(run.part)
    for topic, rows in promised.items():
        assert found[topic][: len(rows)] == rows, f"{topic}: not all of the whole chunks is read"
    for topic, rows in found.items():
        assert rows == reference[topic][: len(rows)], f"{topic} differs from the whole run"
    return "a part with whole chunks" if count else "a part without a whole chunk"


def finish(folder: Path, seconds: float) -> tuple[Run, Topics]:
    """Run over a log of so many seconds to the end; what it wrote."""
    run = prepare(folder, seconds)
    assert run.start().wait() == 0
    return run, by_official(run.out)


def kill(run: Run, reference: Topics, count: int, seed: int) -> Counter[str]:
    """Kill `count` runs of a finished one at random moments of their writing.

    A moment is a share of the bytes to be written, so that a machine with much else to do does
    not move it.
    """
    size, rng = run.out.stat().st_size, Random(seed)
    run = replace(run, out=run.out.with_name("killed.mcap"))
    found: Counter[str] = Counter()
    for k in range(count):
        run.clear()
        process = run.start()
        wanted = (k + rng.random()) / count * size
        while process.poll() is None and run.written() < wanted:
            time.sleep(rng.uniform(0.0, 2e-3))
        process.kill()
        process.wait()
        found[left_behind(run, reference)] += 1
    return found
