"""Scenario files for tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from navgrade.simulate.scenario import Scenario, read_scenario

READY = Path(__file__).resolve().parents[3] / "data" / "scenarios"
NAMES = ("airliner", "car", "helicopter", "path", "robot", "ship", "still", "turntable")

START = """\
[start]
time = "2026-03-04T05:06:07Z"
latitude = -41.5
longitude = 174.25
height_m = 30.0
heading_deg = 310.0
speed_m_s = 12.0
"""
TURN = """\
[[segment]]
type = "turn"
angle_deg = 100.0
radius_m = 60.0
[[segment]]
type = "straight"
duration_s = 3.0
"""
STILL = """\
[[segment]]
type = "still"
duration_s = 4.0
"""


def written(folder: Path, imu: str = "", rest: str = START + TURN, rate_hz: float = 100.0) -> Path:
    """A scenario file."""
    path = folder / "scenario.toml"
    path.write_text(f"[imu]\nrate_hz = {rate_hz}\n{imu}\n{rest}")
    return path


def scenario(folder: Path, imu: str = "", rest: str = START + TURN) -> Scenario:
    """It, read."""
    return read_scenario(written(folder, imu, rest))


def shortened(name: str, folder: Path, segments: int) -> Path:
    """A ready scenario with its first segments alone."""
    head, *rows = (READY / f"{name}.toml").read_text().split("[[segment]]")
    path = folder / f"{name}.toml"
    path.write_text("[[segment]]".join([head, *rows[:segments]]))
    return path


def stamps_ns(rows: Sequence) -> np.ndarray:  # type: ignore[type-arg]
    """Header stamps."""
    return np.array([m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in rows])


def vectors(rows: Sequence, *names: str) -> np.ndarray:  # type: ignore[type-arg]
    """x, y, z of members, side by side."""
    return np.array([[getattr(getattr(m, n), a) for n in names for a in "xyz"] for m in rows])
