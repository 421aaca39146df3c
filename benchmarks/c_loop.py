"""Ours against a plain C loop of the same arithmetic, on the same increments."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from earth.ellipsoid import WGS84
from earth.gravity import gravity_fit
from navgrade import ImuSamples, NavState
from navgrade.imu import BodyIncrements
from navgrade.mechanization import MECHANIZATIONS, World
from navgrade.reconstruction import CAUSAL, RECONSTRUCTIONS, Reconstruction
from navgrade.state import Columns
from tests.navgrade.engine import samples, state_at
from tests.oracles.truth import turning_vehicle

SAMPLES = 720_000
ROUNDS = 9
_ROWS = 8192  # of ours between its two stages: they stay in the second-level cache
SOURCE = Path(__file__).with_name("step.c")
FLAGS = ("-O3", "-march=native", "-ffp-contract=fast")
MINUTE = 12_000  # samples
# m: the same arithmetic, fused at other places, a last digit of latitude (0.7 nm) or two after a
# minute. Over an hour such roundings grow, with the unaided height and along the horizon alike, to
# a thousand times that.
AFTER_MINUTE, AFTER_HOUR = 3e-9, 1e-5


class _World(ctypes.Structure):
    _fields_ = (
        ("a", ctypes.c_double),
        ("e2", ctypes.c_double),
        ("omega", ctypes.c_double),
        ("down", ctypes.c_double * 15),
        ("north", ctypes.c_double * 6),
    )


def _c_loop(compiler: str, imu: ImuSamples, state: NavState, out: Columns) -> Callable[[], int]:
    """Compile the C loop and bind it to its data; each call returns the rows it did."""
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "step.so"
        subprocess.run(
            [compiler, *FLAGS, "-shared", "-fPIC", "-o", str(library), str(SOURCE), "-lm"],
            check=True,
        )
        loop = ctypes.CDLL(str(library)).navigate
    loop.restype = ctypes.c_long
    params, fit = WGS84.params, gravity_fit(WGS84)
    world = _World(
        params.a,
        params.e2,
        params.omega,
        (ctypes.c_double * 15)(*fit.down),
        (ctypes.c_double * 6)(*fit.north),
    )
    start = np.concatenate([[state.lat, state.lon, state.h], state.v_eb_n, state.q_nb])
    arrays = [imu.dt, imu.gyro, imu.accel, *out]

    def run() -> int:
        pointers = [ctypes.c_void_p(array.ctypes.data) for array in arrays]
        first = ctypes.c_void_p(start.ctypes.data)
        return int(loop(ctypes.byref(world), first, ctypes.c_long(len(imu)), *pointers))

    return run


def _stages(imu: ImuSamples, state: NavState, out: Columns) -> int:
    """Run our two compiled loops one after the other, block by block, on one thread."""
    chosen = RECONSTRUCTIONS[CAUSAL]
    assert isinstance(chosen, Reconstruction)
    frame = MECHANIZATIONS["n"].start(state, World.around(state), 0)
    space = np.empty((3, _ROWS, 3))
    for start in range(0, len(imu), _ROWS):
        low = max(start - chosen.back, 0)
        part, rows = imu[low : start + _ROWS], imu[start : start + _ROWS]
        phi, dv, dr = space[:, : len(rows)]
        status = np.zeros(len(rows), np.uint32)
        chosen.loop(part.dt, part.gyro, part.accel, start - low, phi, dv, dr, status)
        increments = BodyIncrements(rows.t, rows.dt, phi, dv, dr, status)
        frame.advance(increments, out.rows(start, start + len(rows)))
    return len(imu)


def _difference(ours: Columns, theirs: Columns) -> float:
    """Largest distance between the positions of any row, m."""
    north = ours.lat - theirs.lat
    east = np.cos(ours.lat) * (ours.lon - theirs.lon)
    up = ours.h - theirs.h
    return float(np.sqrt(((WGS84.a + ours.h) * np.hypot(north, east)) ** 2 + up**2).max())


def _ns(run: Callable[[], int]) -> float:
    """Nanoseconds of processor time per increment."""
    began = time.process_time()
    run()
    return (time.process_time() - began) / SAMPLES * 1e9


def c_ratio() -> list[str]:
    """Nanoseconds per increment, causal-3 and frame n with every state stored.

    The C loop does both stages in one pass, ours one after the other; neither spreads its work
    over cores. The runs alternate in one process, since machines drift.
    """
    compiler = shutil.which("cc")
    if compiler is None:
        return ["no C compiler (cc) here: not compared with a C loop"]
    motion = turning_vehicle()
    imu = samples(motion.increments(np.arange(SAMPLES + 1) * 0.005))
    state = state_at(motion, 0.0)
    ours, theirs = Columns.empty(SAMPLES), Columns.empty(SAMPLES)
    loop = _c_loop(compiler, imu, state, theirs)
    if loop() < SAMPLES or _stages(imu, state, ours) < SAMPLES:
        raise AssertionError("a loop stopped before the end of the increments")
    minute = _difference(ours.rows(0, MINUTE), theirs.rows(0, MINUTE))
    hour = _difference(ours, theirs)
    if minute > AFTER_MINUTE or hour > AFTER_HOUR:
        raise AssertionError(
            f"the C loop is {minute:.1e} m away after a minute and {hour:.1e} m after an hour; "
            "benchmarks/step.c must follow the Python sources"
        )
    times = np.array([[_ns(loop), _ns(lambda: _stages(imu, state, ours))] for _ in range(ROUNDS)]).T
    return [
        f"{SAMPLES} increments, {ROUNDS} rounds, ns of processor time per increment: least, median",
        _line("causal-3 and frame n, ours", times[1], ".1f"),
        _line(f"the same in C, cc {' '.join(FLAGS)}", times[0], ".1f"),
        _line("ratio", times[1] / times[0], ".2f") + "  (wanted: at most 1.3)",
        f"  positions agree to {minute:.0e} m for a minute, {hour:.0e} m for the hour",
    ]


def _line(name: str, values: NDArray[np.float64], form: str) -> str:
    return f"  {name:<60}{values.min():7{form}} {np.median(values):7{form}}"
