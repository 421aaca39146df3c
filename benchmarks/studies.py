"""How long an hour takes to simulate at 1 kHz, and to compare at 200 Hz, by the commands."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.scenarios import READY, ROOT

_ROUNDS = 6  # of the helicopter's ten minutes


def study_rows() -> Iterator[str]:
    """Lines of a table: what, processor time and wall time, s, and the most memory, MB."""
    yield "| command | processor s | wall s | MB |"
    yield "|---|---|---|---|"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made = folder / "log.mcap"
        for rate in (1000.0, 200.0):
            scenario, site = folder / f"{rate:g}.toml", folder / f"site_{rate:g}.toml"
            scenario.write_text(_long(rate))
            row = _timed("simulate", scenario, "-o", made, "--site", site, "--overwrite")
            yield f"| simulate an hour of the vibrating helicopter at {rate:g} Hz | {row} |"
        arguments = ("compare", made, "-c", site, "-o", folder / "page.html", "--overwrite")
        _timed(*arguments, "--duration", 2)  # compiles
        yield f"| compare that hour at 200 Hz, 14 solutions | {_timed(*arguments)} |"


def _long(rate_hz: float) -> str:
    """The helicopter's scenario, its flight repeated until it fills an hour."""
    text = (READY / "helicopter.toml").read_text()
    head, mark, flight = text.partition("[[segment]]")
    return head.replace("rate_hz = 200.0", f"rate_hz = {rate_hz}") + (mark + flight) * _ROUNDS


def _timed(*arguments: object) -> str:
    command = [sys.executable, "-m", "navgrade", *map(str, arguments)]
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
    after, ended = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return f"{used:.1f} | {ended - began:.1f} | {after.ru_maxrss / 1024:.0f}"
