"""Speed and start-up; ratios in one run, since machines differ and drift."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np

from navgrade import NavState, navigate, solve
from navgrade.imu import ImuSamples
from tests.navgrade.engine import samples, state_at
from tests.oracles.truth import turning_vehicle

SAMPLES = 720_000
ROUNDS = 7
WANTED = {("causal-3", "n"): 0.25, ("centred-9", "n"): 0.8, ("centred-13", "e"): 1.2}


def kernel_ratio() -> list[str]:
    """`navigate`, warm, all states stored, against pyins' compiled kernel.

    Each round takes the better of two runs of each.
    """
    from benchmarks.peers import run_pyins_from

    motion = turning_vehicle()
    exact = motion.increments(np.arange(SAMPLES + 1) * 0.005)
    imu, state = samples(exact), state_at(motion, 0.0)
    start = motion.state(0.0)
    ours: dict[tuple[str, str], list[float]] = {pair: [] for pair in WANTED}
    peers: list[float] = []
    for reconstruction, frame in WANTED:
        navigate(imu, state, reconstruction=reconstruction, mechanization=frame)
    for _ in range(ROUNDS):
        peer = run_pyins_from(exact, start, repeats=2)
        peers.append(peer.kernel_seconds / SAMPLES * 1e9)
        for (reconstruction, frame), times in ours.items():
            seconds = []
            for _ in range(2):
                began = time.perf_counter()
                navigate(imu, state, reconstruction=reconstruction, mechanization=frame)
                seconds.append(time.perf_counter() - began)
            times.append(min(seconds) / SAMPLES * 1e9)
    lines = [
        f"{SAMPLES} increments, {ROUNDS} rounds, ns per increment: least, median",
        _line("pyins' compiled kernel alone", peers, ".1f"),
    ]
    for (reconstruction, frame), times in ours.items():
        ratios = [a / b for a, b in zip(times, peers, strict=True)]
        lines += [
            _line(f"navgrade.navigate, {reconstruction}, frame {frame}", times, ".1f"),
            _line("  ratio", ratios, ".3f")
            + f"  (wanted: at most {WANTED[reconstruction, frame]:g})",
        ]
    return lines


def _line(name: str, values: list[float], form: str) -> str:
    return f"  {name:<48}{min(values):7{form}} {statistics.median(values):7{form}}"


def long_log() -> list[str]:
    """A day at 1 kHz streamed through the engine: cost per increment, and memory."""
    code = (
        "import sys, time; from benchmarks.speed import stream\n"
        "began = time.perf_counter(); stream(int(sys.argv[1]))\n"
        "status = open('/proc/self/status').read()\n"
        "print(time.perf_counter() - began, status.split('VmHWM:')[1].split()[0])"
    )
    lines = ["increments of 1 ms streamed through centred-9, frame n:"]
    for count in (1_000_000, 10_000_000, 86_400_000):
        done = subprocess.run(
            [sys.executable, "-c", code, str(count)], check=True, capture_output=True, text=True
        )
        seconds, kilobytes = map(float, done.stdout.split())
        lines.append(
            f"  {count:>11,}: {seconds:6.2f} s, {seconds / count * 1e9:5.0f} ns each, "
            f"peak {kilobytes / 1024:.0f} MB"
        )
    return lines


def stream(count: int) -> None:
    """Navigate `count` increments of a base at rest, in blocks, keeping nothing."""
    block = 65_536
    rng = np.random.default_rng(1)
    gyro = 1e-6 * rng.standard_normal((block, 3))
    accel = 1e-6 * rng.standard_normal((block, 3)) + np.array([0.0, 0.0, -9.79e-3])
    steps = 1e-3 * np.arange(1, block + 1)

    def blocks() -> Iterator[ImuSamples]:
        for start in range(0, count, block):
            n = min(block, count - start)
            yield ImuSamples(
                t=start * 1e-3 + steps[:n],
                dt=np.full(n, 1e-3),
                gyro=gyro[:n],
                accel=accel[:n],
                kind="increment",
            )

    rows = sum(len(part) for part in solve(blocks(), NavState(0.5, 0.1, 0.0), vertical="hold"))
    assert rows == count


def startup() -> list[str]:
    """`navgrade --help`, and what a second process pays before it navigates."""
    first_call = (
        "import time; began = time.perf_counter()\n"
        "import numpy as np, navgrade\n"
        "n = 10; t = np.arange(1, n + 1) * 0.01\n"
        "imu = navgrade.ImuSamples(t=t, gyro=np.zeros((n, 3)), accel=np.zeros((n, 3)), "
        "kind='increment')\n"
        "navgrade.navigate(imu, navgrade.NavState(lat=0.5, lon=0.1, h=0.0))\n"
        "print(time.perf_counter() - began)"
    )
    helps, firsts = [], []
    for _ in range(5):
        began = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "navgrade", "--help"], check=True, capture_output=True
        )
        helps.append(time.perf_counter() - began)
        done = subprocess.run(
            [sys.executable, "-c", first_call], check=True, capture_output=True, text=True
        )
        firsts.append(float(done.stdout))
    return [
        f"navgrade --help                    {statistics.median(helps):.3f} s  (wanted: under 0.4)",
        f"second process, import to solution {statistics.median(firsts[1:]):.3f} s  "
        "(wanted: under 1)",
    ]
