"""Reading, writing and navigating long logs, beside the libraries people use, in one run."""

from __future__ import annotations

import importlib.util
import io
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.mcap_routes import (
    FIELDS,
    READ_FLOOR,
    READ_OURS,
    READ_PEER,
    READERS,
    RECORD,
    SLAB,
    STEP_NS,
    TOPIC,
    WRITE_FLOOR,
    WRITE_OURS,
    WRITE_PEER,
    WRITERS,
    Imu,
    Route,
    noisy,
    write_official,
    write_ours,
)
from navgrade.logs.container import McapFile
from tests.navgrade.logmaking import EPOCH_NS, resting, started_site

_RUNS = 3  # of a quick route in each round
_SECOND_NS = 1_000_000_000
_WINDOW_S = 60
_RATE_HZ = 1000  # of the navigated logs
_STILL_S = 60
_LONG_BYTES = 12 << 30  # ten hours at this rate, and their solution
_PACKAGES = ("numpy", "zstandard", "mcap", "mcap-ros2-support", "rosbags", "rerun-sdk")

_HEAD = """\
# Performance

`python -m benchmarks mcap --long --write` measures and writes this page in one run. Seconds are
this machine's, ratios travel.

"""
_READING = """
## Reading

Header stamp, angular rate and specific force of {messages:,} `sensor_msgs/msg/Imu` at 400 Hz:
{raw:.0f} MB uncompressed, {stored:.0f} MB in zstd chunks of 1 MiB, written by `mcap`.

Each route runs in a process of its own, the file in the page cache. Quick routes take turns in
{rounds} rounds, {runs} runs each: s and CPU s are the least. × compares processor times, which
other load on the machine changes least: the median over the rounds of the ratio to the floor + CRC
of the same round. That floor reads chunks into one kept buffer and unpacks them into another. Slow
routes run once. The speed-up over mcap-ros2-support is its processor time over the route's median
wall time, to its advantage; and it verifies no checksum, navgrade verifies all. MB is the largest
resident memory, interpreter and imports included, and "grown" what came after the imports.

"""
_WRITING = """
## Writing

The same messages from arrays of stamps, rates and forces. Every file is brought to the disk
(`fsync`) within its time. The floor writes ready records without indexes and summary, on one
thread. "Grown" is what came after the arrays were ready. mcap-ros2-support writes a tenth, and its
times are multiplied by ten.

"""
_BROWSING = """
## A long log

{messages:,} messages, {hours:.1f} h at 400 Hz: {raw:.1f} GB uncompressed, {stored:.2f} GB in zstd,
written by navgrade in {seconds:.1f} s. A window of 60 s takes {calls} read calls, {taken:.2f} MB.
"""
_NAVIGATING = """
## Navigating

`navgrade run` on `sensor_msgs/msg/Imu` at 1 kHz, the solution written at full rate; the start of
the interpreter counts. The hour is the median of three runs, the others ran once.

| samples | log | solution | s | µs a sample | MB |
|---|---|---|---|---|---|
"""


@dataclass
class Cost:
    """What a route cost: the least times (s) of each round, and memory (MB)."""

    before: float
    peak: float = 0.0
    wall: list[float] = field(default_factory=list)
    cpu: list[float] = field(default_factory=list)


def report(messages: int, *, rounds: int, long: bool) -> Iterator[str]:
    """Measure and yield the sections of docs/performance.md.

    Parameters
    ----------
    messages : int
        In the log every library reads and writes; the other logs are in proportion.
    rounds : int
        Of the quick routes.
    long : bool
        Navigate a log ten times longer as well.
    """
    yield _HEAD + ", ".join(_machine()) + ".\n"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        yield _reading(folder / "imu.mcap", messages, rounds)
        yield _writing(folder / "imu.mcap", messages, rounds)
        yield _browsing(folder / "imu.mcap", 10 * messages)
        yield _navigating(folder, messages * 9 // 5, long)


def _machine() -> Iterator[str]:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            yield line.split(":")[1].strip()
            break
    yield f"{os.cpu_count()} cores"
    yield f"{os.sysconf('SC_PHYS_PAGES') * os.sysconf('SC_PAGE_SIZE') / 2**30:.0f} GiB"
    yield f"{platform.system()}; Python {platform.python_version()}"
    for package in _PACKAGES:
        try:
            yield f"{package} {version(package)}"
        except PackageNotFoundError:
            yield f"no {package}"


def _slabs(count: int) -> Iterator[Imu]:
    return (noisy(first, min(SLAB, count - first)) for first in range(0, count, SLAB))


def _wanted(*lines: tuple[str, float | None, str]) -> str:
    """A list of what was to be reached."""
    told = ("?" if value is None else f"{value:.3g}" for _, value, _ in lines)
    return "\n" + "".join(
        f"- {name}: {value} (wanted: {bound})\n"
        for (name, _, bound), value in zip(lines, told, strict=True)
    )


def _reading(log: Path, messages: int, rounds: int) -> str:
    write_official(log, _slabs(messages))
    text = _READING.format(
        messages=messages,
        raw=messages * RECORD.itemsize / 1e6,
        stored=log.stat().st_size / 1e6,
        rounds=rounds,
        runs=_RUNS,
    )
    costs = _measure(READERS, log, messages, rounds)
    floor, peer, ours = costs[READ_FLOOR], costs.get(READ_PEER), costs[READ_OURS]
    text += _table(READERS, costs, floor, peer, messages)
    return text + _wanted(
        ("million messages/s on one thread", messages / min(ours.wall) / 1e6, "at least 3"),
        ("times decompress + CRC", _times(ours, floor), "at most 1.6"),
        ("times as fast as mcap-ros2-support", _speed_up(ours, peer), "at least 80"),
        ("MB when streamed", ours.peak, "at most 100"),
    )


def _writing(log: Path, messages: int, rounds: int) -> str:
    costs = _measure(WRITERS, log, messages, rounds)
    floor, peer, ours = costs[WRITE_FLOOR], costs.get(WRITE_PEER), costs[WRITE_OURS]
    text = _WRITING + _table(WRITERS, costs, floor, peer, messages)
    return text + _wanted(
        ("times CRC + compress of ready bytes", _times(ours, floor), "at most 1.5"),
        ("times as fast as mcap-ros2-support", _speed_up(ours, peer), "at least 30"),
    )


def _measure(
    routes: Mapping[str, Route], path: Path, messages: int, rounds: int
) -> dict[str, Cost]:
    """Run the quick routes in turns, and the slow ones in the first round only."""
    costs: dict[str, Cost] = {}
    for turn in range(rounds):
        for name, route in routes.items():
            if importlib.util.find_spec(route.package) is None or (route.slow and turn):
                continue
            count, runs = round(messages * route.share), 1 if route.slow else _RUNS
            told = json.loads(
                _python("-m", "benchmarks.mcap_routes", name, str(path), str(count), str(runs))
            )
            cost = costs.setdefault(name, Cost(told["before"]))
            cost.peak = max(cost.peak, told["peak"])
            cost.wall.append(min(told["wall"]) / route.share)
            cost.cpu.append(min(told["cpu"]) / route.share)
    return costs


def _python(*arguments: str) -> str:
    return subprocess.run(
        [sys.executable, *arguments], check=True, stdout=subprocess.PIPE, text=True
    ).stdout


def _times(cost: Cost, floor: Cost) -> float:
    """Processor time as a multiple of the floor's, the median over the rounds both were in."""
    return statistics.median(a / b for a, b in zip(cost.cpu, floor.cpu, strict=False))


def _speed_up(cost: Cost, peer: Cost | None) -> float | None:
    return None if peer is None else peer.cpu[0] / statistics.median(cost.wall)


def _table(
    routes: Mapping[str, Route],
    costs: Mapping[str, Cost],
    floor: Cost,
    peer: Cost | None,
    messages: int,
) -> str:
    lines = [
        "| route | s | CPU s | M messages/s | × floor | over mcap-ros2-support | MB | grown |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, route in routes.items():
        if name not in costs:
            lines.append(f"| {route.label} | {route.package} is not installed | | | | | | |")
            continue
        cost = costs[name]
        least, up = min(cost.wall), _speed_up(cost, peer)
        lines.append(
            f"| {route.label} | {least:.3g} | {min(cost.cpu):.3g} | {messages / least / 1e6:.2g} | "
            f"{_times(cost, floor):.3g} | {'?' if up is None else f'{up:.3g}'} | {cost.peak:.0f} | "
            f"{cost.peak - cost.before:.0f} |"
        )
    return "\n".join(lines) + "\n"


class _Counted(io.FileIO):
    """A file that counts what is read of it."""

    calls = 0
    taken = 0

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self.calls += 1
        self.taken += len(data)
        return data


def _browsing(log: Path, messages: int) -> str:
    began = time.perf_counter()
    write_ours(log, _slabs(messages))
    seconds = time.perf_counter() - began
    start_ns = EPOCH_NS + messages // 2 * STEP_NS
    windows = []
    for _ in range(5):
        began = time.perf_counter()
        _window(McapFile(log), start_ns)
        windows.append(time.perf_counter() - began)
    with _Counted(log) as stream:
        _window(McapFile(stream), start_ns)
    inspections = []
    for _ in range(3):
        began = time.perf_counter()
        _python("-m", "navgrade", "inspect", str(log))
        inspections.append(time.perf_counter() - began)
    text = _BROWSING.format(
        messages=messages,
        hours=messages * STEP_NS / 3600e9,
        raw=messages * RECORD.itemsize / 1e9,
        stored=log.stat().st_size / 1e9,
        seconds=seconds,
        calls=stream.calls,
        taken=stream.taken / 1e6,
    )
    log.unlink()
    return text + _wanted(
        ("opening it and reading the window, s", statistics.median(windows), "at most 0.3"),
        ("`navgrade inspect`, s", statistics.median(inspections), "under 2"),
    )


def _window(log: McapFile, start_ns: int) -> None:
    end_ns = start_ns + _WINDOW_S * _SECOND_NS
    blocks = log.columns({TOPIC: FIELDS}, start_ns=start_ns, end_ns=end_ns)
    assert sum(len(block) for block in blocks) == _WINDOW_S * _SECOND_NS // STEP_NS


def _turning(first: int, count: int) -> Imu:
    """Samples of an IMU on ground at rest that after a minute turns to and fro about down."""
    swing, pulse = 1.5, 0.05  # rad, rad/s
    t = (np.arange(first, first + count) + 0.5) / _RATE_HZ - _STILL_S
    phase = pulse * np.maximum(t, 0.0)
    sine, cosine = np.sin(swing * np.sin(phase)), np.cos(swing * np.sin(phase))

    def turned(vector: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, z = vector
        return np.stack([cosine * x + sine * y, cosine * y - sine * x, np.full(count, z)], axis=1)

    still = resting(0.0)
    noise = np.random.default_rng(first).standard_normal((2, count, 3))
    gyro = turned(still.gyro[0]) + 1e-5 * noise[0]
    gyro[:, 2] += (t > 0.0) * swing * pulse * np.cos(phase)
    stamp_ns = EPOCH_NS + np.arange(first + 1, first + count + 1) * (_SECOND_NS // _RATE_HZ)
    return Imu(stamp_ns, gyro, turned(still.accel[0]) + 1e-3 * noise[1])


_RUN = """
import sys
from benchmarks.mcap_routes import memory_mb
from navgrade.cli import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    assert not end.code
print(memory_mb("VmHWM"))
"""


def _navigating(folder: Path, samples: int, long: bool) -> str:
    site = folder / "site.toml"
    site.write_text(started_site() + '[mechanization]\nvertical = "hold"\n')
    counts = [samples // 10, samples]
    if long:
        free = shutil.disk_usage(folder).free
        if free < _LONG_BYTES:
            raise SystemExit(f"--long needs {_LONG_BYTES >> 30} GiB of disk, {free >> 30} are free")
        counts.append(10 * samples)
    text = _NAVIGATING
    taken: dict[int, tuple[float, float]] = {}
    log, solution = folder / "log.mcap", folder / "solution.mcap"
    command = ["run", str(log), "-c", str(site), "-o", str(solution), "--overwrite"]
    for count in (1000, *counts):  # the first compiles
        firsts = range(0, count, SLAB)
        write_ours(log, (_turning(first, min(SLAB, count - first)) for first in firsts))
        seconds, peaks = [], []
        for _ in range(3 if count == samples else 1):
            began = time.perf_counter()
            told = _python("-c", _RUN, *command)
            seconds.append(time.perf_counter() - began)
            peaks.append(float(told.split()[-1]))
        taken[count] = statistics.median(seconds), max(peaks)
        if count in counts:
            text += (
                f"| {count:,} | {log.stat().st_size / 1e6:.0f} MB "
                f"| {solution.stat().st_size / 1e6:.0f} MB | {taken[count][0]:.1f} "
                f"| {taken[count][0] / count * 1e6:.2f} | {taken[count][1]:.0f} |\n"
            )
        log.unlink()
        solution.unlink()
    text += _wanted(
        ("s for an hour at 1 kHz", taken[samples][0], "at most 12, on two cores"),
        ("MB", taken[samples][1], "at most 500"),
    )
    if long:
        (hour_s, hour_mb), (ten_s, ten_mb) = taken[samples], taken[10 * samples]
        text += _wanted(
            ("times as long for a log ten times longer", ten_s / hour_s, "at most 10"),
            ("MB more", ten_mb - hour_mb, "none"),
        ).lstrip()
    return text
