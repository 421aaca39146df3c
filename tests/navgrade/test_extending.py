"""What docs/extending.md promises: a reconstruction is one file and one line."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from navgrade import Status, navigate
from navgrade.navigation import solve
from navgrade.reconstruction import RECONSTRUCTIONS, Reconstruction
from tests.navgrade.engine import samples, state_at
from tests.oracles.truth import turning_vehicle

FILE = '''
"""One previous sample, in plain NumPy."""

import numpy as np

from navgrade.imu import Status


def reconstruct(dt, dtheta, dvel, first, phi, dv, dr, status):
    """Fill the rows from `first` on; the rows around them are context."""
    rows = np.arange(first, first + len(phi))
    if first == 0:
        status[0] |= np.uint32(Status.SHORT_WINDOW)
    before = np.maximum(rows - 1, 0)
    share = np.where(rows > 0, 1.0 / 12.0, 0.0)[:, None]
    theta, v = dtheta[rows], dvel[rows]
    A, B = share * dtheta[before], share * dvel[before]
    turn = np.cross(theta, v)
    phi[:] = theta + np.cross(A, theta)
    dv[:] = v + 0.5 * turn + np.cross(theta, turn) / 6.0 + np.cross(A, v) + np.cross(B, theta)
    dr[:] = 0.5 * dt[rows, None] * dv
'''


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The file, and its line in the registry."""
    path = tmp_path / "mine.py"
    path.write_text(FILE)
    spec = importlib.util.spec_from_file_location("mine", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    entry = Reconstruction("what it does", order=3, coning_order=4, loop=module.reconstruct, back=1)
    monkeypatch.setitem(RECONSTRUCTIONS, "mine", entry)
    return "mine"


def test_one_file_and_one_line(mine: str) -> None:
    """Any frame takes it, in any blocks; it does what causal-1 does."""
    motion = turning_vehicle()
    imu, state = samples(motion.increments(np.arange(6001) * 0.005)), state_at(motion, 0.0)
    for frame in ("n", "e"):
        nav = navigate(imu, state, reconstruction=mine, mechanization=frame)
        known = navigate(imu, state, reconstruction="causal-1", mechanization=frame)
        # m: its trapezoid for the displacement is 10 m/s² dt² / 12 = 20 µm off at most
        assert np.abs(nav.h - known.h).max() < 5e-5
        assert np.abs(nav.lat - known.lat).max() * 6.4e6 < 5e-5
        assert nav.status[0] == Status.SHORT_WINDOW
        assert not nav.status[1:].any()
        pieces = solve(imu.blocks(777), state, reconstruction=mine, mechanization=frame)
        assert np.array_equal(np.concatenate([piece.h for piece in pieces]), nav.h)


def test_a_name_not_far_off_is_suggested(mine: str) -> None:
    motion = turning_vehicle()
    imu, state = samples(motion.increments(np.arange(11) * 0.005)), state_at(motion, 0.0)
    with pytest.raises(ValueError, match="did you mean 'mine'"):
        navigate(imu, state, reconstruction="mines")
