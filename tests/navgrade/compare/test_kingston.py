"""Three numbers of the recorded drive's comparison, computed again without navgrade's engine."""

from __future__ import annotations

import csv
from functools import cache
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from navgrade import NavState, read_imu
from navgrade.alignment import align_log
from navgrade.compare.result import Comparison
from navgrade.compare.study import compare
from navgrade.job import Choices, open_log
from navgrade.logs import read_track_csv
from navgrade.site import read_site
from tests.navgrade.real_drive import LOG, SITE
from tests.oracles.constants import OMEGA
from tests.oracles.gravity import gravitation_e

ERRORS = """[imu.errors]
gyro_bias_deg_h = 1.0
accel_bias_ug = 1000.0
[site]"""
REFERENCE = "kingston_hg1700_reference.csv"
SECONDS = 60.0


@cache
def compared(shared: Path, folder: Path) -> tuple[Comparison, NavState]:
    site_file = folder / "kingston.toml"
    site_file.write_text(SITE.replace("[site]", ERRORS))
    site = read_site(site_file)
    log = open_log(shared / LOG, site, Choices())
    truth = read_track_csv(shared / REFERENCE)
    found = compare(log, site, truth=truth, duration=600.0)
    return found, align_log(log, site).state


@pytest.fixture
def both(
    shared_data: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Comparison, NavState]:
    return compared(shared_data, tmp_path_factory.getbasetemp())


def reference_at(shared: Path, unix_s: float) -> tuple[float, float, float]:
    """Latitude, longitude (deg) and height of the line of the reference at a time."""
    with (shared / REFERENCE).open() as stream:
        rows = [[float(x) for x in row[:4]] for row in list(csv.reader(stream))[1:]]
    row = min(rows, key=lambda row: abs(row[0] - unix_s))
    assert abs(row[0] - unix_s) < 1e-3
    return row[1], row[2], row[3]


def naive(shared: Path, state: NavState, unix_s: float, *, flat: bool) -> tuple[float, ...]:
    """Where rates held over each interval lead in Earth-fixed axes: ECEF position, m.

    In the flat world the axes do not turn and gravity is that of the start, straight down.
    """
    imu = read_imu(shared / LOG, kind="average", axes="RFU")
    gyro, accel = imu.gyro.copy(), imu.accel.copy()
    end = unix_s - imu.epoch_ns * 1e-9
    lat, lon = np.degrees(state.lat), np.degrees(state.lon)
    r = np.array(pymap3d.geodetic2ecef(lat, lon, state.h))
    C_en = Rotation.from_euler("ZY", [state.lon, -np.pi / 2 - state.lat])
    C = C_en * Rotation.from_quat(state.q_nb.copy(), scalar_first=True)
    v = C_en.apply(state.v_eb_n.copy())
    omega = np.zeros(3) if flat else np.array([0.0, 0.0, OMEGA])

    def gravity(r: np.ndarray) -> np.ndarray:
        turning = np.array([0.0, 0.0, OMEGA])
        return np.array(gravitation_e(*r)) - np.cross(turning, np.cross(turning, r))

    g = gravity(r)
    t = state.t
    for k in np.flatnonzero((imu.t > state.t + 1e-6) & (imu.t < end + imu.dt)):
        dt = min(imu.t[k], end) - t
        t += dt
        middle = C * Rotation.from_rotvec(0.5 * dt * gyro[k])
        middle = Rotation.from_rotvec(-0.5 * dt * omega) * middle
        here = g if flat else gravity(r + 0.5 * dt * v)
        # the force held in b turns by half the interval's angle each way: sinc of it remains
        a = middle.apply(accel[k]) + here - 2.0 * np.cross(omega, v)
        r = r + dt * v + 0.5 * dt * dt * a
        v = v + dt * a
        C = Rotation.from_rotvec(-dt * omega) * C * Rotation.from_rotvec(dt * gyro[k])
    return tuple(r)


@pytest.mark.parametrize(
    ("name", "flat", "within"),
    [
        # m: holding the rates of 0.1 s leaves out coning and sculling, 0.06 m by the comparison
        ("engine", False, 0.15),
        # m: and the courses' integrator takes rates at points, which averages of 0.1 s only tell so
        ("flat-rk4", True, 0.25),
    ],
)
def test_the_error_after_a_minute(
    shared_data: Path, both: tuple[Comparison, NavState], name: str, flat: bool, within: float
) -> None:
    """Two of the numbers: the full engine's error, and the flat world's."""
    comparison, state = both
    row = int(np.argmin(np.abs(comparison.t - SECONDS)))
    unix_s = comparison.start_ns * 1e-9 + comparison.t[row]
    place = reference_at(shared_data, unix_s)
    r = naive(shared_data, state, unix_s, flat=flat)
    east, north, _ = pymap3d.ecef2enu(*r, *place)
    variant = next(v for v in comparison.variants if v.name == name)
    assert variant.position_error[row, :2] == pytest.approx([north, east], abs=within)
    assert np.hypot(north, east) > 1.0


def test_the_stated_errors_of_the_imu(both: tuple[Comparison, NavState]) -> None:
    """The third: 1 deg/h and 1 mg about two axes, Schuler-bounded, beside the heading's sigma."""
    comparison, _ = both
    t = comparison.epochs[-1]
    assert t == pytest.approx(600.0, abs=1.0)
    assert comparison.imu_error is not None
    w, R = np.sqrt(9.805 / 6.378e6), 6.378e6
    gyro = R * np.radians(1.0) / 3600.0 * (t - np.sin(w * t) / w)
    accel = 9.80665e-3 * (1.0 - np.cos(w * t)) / w**2
    of_sensors = np.sqrt(2.0) * np.hypot(gyro, accel)
    east, north, _ = comparison.variants[0].track[-1]
    of_heading = np.sqrt(comparison.imu_error[-1] ** 2 - of_sensors**2) / np.hypot(east, north)
    assert of_sensors == pytest.approx(comparison.imu_error[-1], rel=0.1)
    assert 0.0 <= of_heading < np.radians(10.0)


def test_the_verdict_says_so(both: tuple[Comparison, NavState]) -> None:
    """From where on the distance between the two is for good larger than the engine's error."""
    comparison, _ = both
    of = {v.name: v.position_error[:, :2] for v in comparison.variants}
    model = np.linalg.norm(of["flat-rk4"] - of["engine"], axis=1)
    behind = np.flatnonzero(model <= np.linalg.norm(of["engine"], axis=1))
    since = round(comparison.t[behind[-1] + 1])
    assert 10 <= since <= 30
    assert comparison.verdict[0] == (
        f"With this IMU the flat world is the larger error after {since} s; before that, the "
        "sensors and the starting state are."
    )
