"""Logs longer than memory, and runs that are cut short."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import navgrade
from tests.navgrade.cli.calling import Bench
from tests.navgrade.logmaking import SITE, resting

RATE = 200.0  # Hz
SHORT, LONG = 200_000, 1_000_000  # samples; the short one already fills every buffer
PATIENCE = 60.0  # s, for a process that never comes to the point


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    """A log of 1000 s and one five times as long; our own writer will do for their length."""
    folder = tmp_path_factory.mktemp("long")
    paths = {}
    for count in (SHORT, LONG):
        recording = resting(count / RATE, RATE, sway_from_s=10.5)
        made = recording.as_increments(np.full(len(recording), 1.0 / RATE))
        t = (made.stamp_ns - made.stamp_ns[0]) * 1e-9
        samples = navgrade.ImuSamples(
            t=t,
            dt=made.interval,
            gyro=made.gyro,
            accel=made.accel,
            kind="increment",
            epoch_ns=int(made.stamp_ns[0]),
        )
        paths[count] = folder / f"{count}.mcap"
        navgrade.write_increments(paths[count], samples)
    return paths


def command(log: Path, bench: Bench) -> list[str]:
    """Arguments of ``navgrade run`` in a process of its own."""
    bench.site.write_text(SITE.replace('kind = "average"\n', ""))
    return ["run", str(log), "-c", str(bench.site), "-o", str(bench.out)]


_WITH_PEAK = """
import sys
from navgrade.cli import main
try:
    main(sys.argv[1:])
except SystemExit as stop:
    code = stop.code
(peak,) = [line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM")]
print("peak", code, peak)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory is read from /proc")
def test_a_log_five_times_longer_takes_no_more_memory(bench: Bench, logs: dict[int, Path]) -> None:
    """The samples it has more fill 46 MB, their solution 70 MB.

    40 MB leaves room for blocks more in flight (2 MB each) and for the allocator's moods, up to
    20 MB, and not for any of these.
    """
    peaks = {}
    for count, log in logs.items():
        done = subprocess.run(
            [sys.executable, "-c", _WITH_PEAK, *command(log, bench)],
            capture_output=True,
            text=True,
            check=True,
        )
        word, code, kilobytes = done.stdout.splitlines()[-1].split()
        assert (word, code) == ("peak", "0")
        assert f"{count - 10 * RATE:.0f} over {count / RATE - 10.0:.3f} s" in done.stdout
        peaks[count] = int(kilobytes) / 1024.0
        bench.out.unlink()
    assert peaks[LONG] - peaks[SHORT] < 40.0  # MB


def started(log: Path, bench: Bench) -> subprocess.Popen[str]:
    """A run that has begun to write."""
    process = subprocess.Popen(
        [sys.executable, "-m", "navgrade", *command(log, bench)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    give_up = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < give_up:
        if bench.part.exists() and bench.part.stat().st_size > 100_000:
            return process
        time.sleep(0.01)
    process.kill()
    pytest.fail(f"the run did not begin to write: {process.communicate()}")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_nothing(
    bench: Bench, logs: dict[int, Path], number: signal.Signals
) -> None:
    process = started(logs[LONG], bench)
    process.send_signal(number)
    _, err = process.communicate(timeout=PATIENCE)
    assert process.returncode == 128 + number
    assert "Traceback" not in err
    bench.left_nothing()


def test_a_killed_run_leaves_no_output(bench: Bench, logs: dict[int, Path]) -> None:
    process = started(logs[LONG], bench)
    process.kill()
    process.communicate(timeout=PATIENCE)
    assert process.returncode == -signal.SIGKILL
    assert not bench.out.exists()
    assert bench.part.exists()  # nobody was left to remove it; the next run overwrites it


def test_an_interrupted_run_keeps_the_output_it_was_to_replace(
    bench: Bench, logs: dict[int, Path]
) -> None:
    bench.out.write_bytes(b"the work of last week")
    process = subprocess.Popen(
        [sys.executable, "-m", "navgrade", *command(logs[LONG], bench), "--overwrite"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    give_up = time.monotonic() + PATIENCE
    while not (bench.part.exists() and bench.part.stat().st_size > 100_000):
        assert process.poll() is None
        assert time.monotonic() < give_up
        time.sleep(0.01)
    process.terminate()
    assert process.wait(timeout=PATIENCE) == 128 + signal.SIGTERM
    assert bench.out.read_bytes() == b"the work of last week"
    assert not bench.part.exists()
