"""Free inertial navigation of the recorded Kingston drive, against its reference."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from navgrade import ImuSamples, NavState, navigate, read_imu
from navgrade.alignment import align_log
from navgrade.job import Choices, open_log
from navgrade.logs import read_heights
from navgrade.site import read_site
from navgrade.vertical import BaroLoop
from tests.oracles.constants import EQUATORIAL_RADIUS

SITE = """
[imu]
kind = "average"
axes = "RFU"
[site]
latitude = 44.23249074
longitude = -76.46649200
height_m = 39.94
[alignment]
start_s = 5.0
duration_s = 515.0
"""
BARO = """
[baro]
topic = "/gnss/fix"
field = "altitude"
quantity = "height_m"
"""
LOG = "kingston_hg1700_drive.mcap"
DRIVE_STARTS = 528.0  # s after the first sample, by the reference's speed


@dataclass(frozen=True)
class DriveError:
    """Solution minus reference: m, m, m/s, deg."""

    horizontal: float
    up: float
    velocity: float
    roll_pitch: float


@dataclass(frozen=True)
class Drive:
    """The log, the state aligned on the stop before it, and heights once a second."""

    imu: ImuSamples
    state: NavState
    baro: BaroLoop


def site_file(folder: Path) -> Path:
    """Write the site file of the drive."""
    path = folder / "kingston.toml"
    path.write_text(SITE + BARO)
    return path


@cache
def drive(shared: Path) -> Drive:
    """Read and align the drive; kept, for it takes a second."""
    path = shared / LOG
    with tempfile.TemporaryDirectory() as folder:
        site = read_site(site_file(Path(folder)))
    aligned = align_log(open_log(path, site, Choices()), site)
    imu = read_imu(path, kind="average", axes="RFU")
    heights = read_heights(path, "/gnss/fix", field="altitude", quantity="height_m")
    baro = BaroLoop(heights.seconds(imu.epoch_ns), heights.h)
    return Drive(imu, aligned.state, baro)


def drive_errors(shared: Path, seconds: Iterable[float]) -> dict[float, DriveError]:
    """Errors after so many seconds of driving, aligned on the stop before it."""
    imu = drive(shared).imu
    nav = navigate(imu, drive(shared).state)
    table = np.genfromtxt(shared / "kingston_hg1700_reference.csv", delimiter=",", skip_header=1)
    t = table[:, 0] - imu.epoch_ns * 1e-9  # 1e-7 s: a Unix time in a double

    errors = {}
    for after in seconds:
        row = int(np.argmin(np.abs(t - (DRIVE_STARTS + after))))
        lat, lon, up = (np.interp(t[row], nav.t, x) for x in (nav.lat, nav.lon, nav.h))
        velocity = [np.interp(t[row], nav.t, nav.v_eb_n[:, i]) for i in range(3)]
        level = [np.interp(t[row], nav.t, nav.euler[:, i]) * 180 / np.pi for i in range(2)]
        north = (lat - np.radians(table[row, 1])) * EQUATORIAL_RADIUS
        east = (lon - np.radians(table[row, 2])) * EQUATORIAL_RADIUS * np.cos(lat)
        errors[after] = DriveError(
            horizontal=float(np.hypot(north, east)),
            up=float(up - table[row, 3]),
            velocity=float(np.linalg.norm(np.array(velocity) - table[row, 4:7])),
            roll_pitch=float(np.abs(np.array(level) - table[row, 7:9]).max()),
        )
    return errors
