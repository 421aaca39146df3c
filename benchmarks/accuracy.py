"""What every claim of docs/accuracy.md is worth, measured."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from earth import ecef_to_geodetic, geodetic_to_ecef, normal_gravity_n
from earth.ellipsoid import WGS84
from earth.gravity import FIT_H_MAX, FIT_H_MIN, fitted_gravity, gravity_fit
from navgrade import Trajectory, navigate
from navgrade.reconstruction import RECONSTRUCTIONS
from tests.navgrade.engine import attitude_error, fly, samples, state_at
from tests.navgrade.real_drive import drive_errors
from tests.oracles.cases import (
    CASES,
    CONTEXT,
    Case,
    Solution,
    position_error,
    true_increments,
)
from tests.oracles.gravity import NormalGravity, normal_gravity_zonal
from tests.oracles.truth import Increments, State

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "data"
DEG = np.pi / 180.0
ARCSEC = DEG / 3600.0
Array = NDArray[np.float64]
_EVERY = 20  # rows between those the comparison looks at: ten times a second at 200 Hz


@dataclass(frozen=True)
class Row:
    """One measured claim."""

    claim: str
    domain: str
    value: str
    limit: str
    test: str


def _metres(value: float) -> str:
    for unit, factor in (("m", 1.0), ("mm", 1e-3), ("µm", 1e-6), ("nm", 1e-9)):
        if value >= factor:
            return f"{value / factor:.3g} {unit}"
    return f"{value:.1e} m"


def hour_rows() -> Iterator[Row]:
    """Position and attitude after an hour: every claim of every case."""
    for case in CASES:
        motion, edges = case.motion(), case.edges()
        for claim in case.claims:
            nav, truth = fly(
                motion,
                edges,
                CONTEXT,
                reconstruction=claim.reconstruction,
                mechanization=claim.mechanization,
            )
            error = position_error(nav, truth)
            vertical = "" if claim.vertical is None else f", vertical {_metres(claim.vertical)}"
            yield Row(
                f"{case.name}, `{claim.reconstruction}`, frame {claim.mechanization}",
                case.domain,
                f"horizontal {_metres(error.horizontal)}, vertical {_metres(error.vertical)}, "
                f"attitude {attitude_error(nav, truth).max() / ARCSEC:.1e}″",
                f"horizontal {_metres(claim.horizontal)}{vertical}",
                "tests/navgrade/test_accuracy.py",
            )


def earth_rows() -> Iterator[Row]:
    """Gravity and coordinates against reference tables and independent formulas."""
    lat, h = np.meshgrid(np.linspace(-90, 90, 721) * DEG, np.linspace(-1e3, 2e4, 43))
    truth = normal_gravity_zonal(lat, h)
    ours = normal_gravity_n(lat, h)
    off = max(np.abs(ours[..., 0] - truth.north).max(), np.abs(ours[..., 2] - truth.down).max())
    yield Row(
        "normal gravity vector, closed form",
        "all latitudes, -1 to 20 km, against zonal harmonics",
        f"{off:.1e} m/s²",
        "1e-11 m/s²",
        "tests/earth/test_gravity.py",
    )
    fit = gravity_fit(WGS84)
    worst = 0.0
    for phi in np.linspace(-90, 90, 181) * DEG:
        for height in np.linspace(FIT_H_MIN, FIT_H_MAX, 22):
            north, down = fitted_gravity(WGS84.params, fit, np.sin(phi), np.cos(phi), float(height))
            exact = normal_gravity_zonal(phi, height)
            worst = max(worst, abs(north - float(exact.north)), abs(down - float(exact.down)))
    yield Row(
        "normal gravity in loops",
        "the same",
        f"{worst:.1e} m/s²",
        "1e-11 m/s²",
        "tests/earth/test_gravity.py",
    )
    if SHARED.is_dir():
        table = np.genfromtxt(
            SHARED / "normal_gravity_wgs84_geographiclib.csv", delimiter=",", skip_header=2
        )
        g = normal_gravity_n(table[:, 0] * DEG, table[:, 1])
        off = max(np.abs(g[:, 0] - table[:, 2]).max(), np.abs(g[:, 2] + table[:, 3]).max())
        yield Row(
            "normal gravity vector, closed form",
            "GeographicLib 2.1.2 table, -100 m to 100 km",
            f"{off:.1e} m/s²",
            "1e-11 m/s²",
            "tests/earth/test_gravity.py",
        )
        table = np.genfromtxt(
            SHARED / "lla_ecef_wgs84_geographiclib.csv", delimiter=",", skip_header=1
        )
        lat, lon, h = table[:, 0] * DEG, table[:, 1] * DEG, table[:, 2]
        forth = np.abs(geodetic_to_ecef(lat, lon, h) - table[:, 3:6]).max()
        lat2, _, h2 = ecef_to_geodetic(table[:, 3:6])
        back = max(np.abs(lat2 - lat).max() * WGS84.a, np.abs(h2 - h).max())
        yield Row(
            "geodetic to ECEF and back",
            "GeographicLib 2.1.2 table, -5 km to geostationary height",
            f"{_metres(float(forth))} and {_metres(float(back))}",
            "10 nm",
            "tests/earth/test_geodetic.py",
        )


def real_rows() -> Iterator[Row]:
    """Free inertial navigation of a recorded drive against its reference."""
    log = SHARED / "kingston_hg1700_drive.mcap"
    if not log.is_file():
        return
    for seconds, error in drive_errors(SHARED, (10.0, 30.0, 60.0, 120.0)).items():
        yield Row(
            f"car, tactical IMU, free inertial after {seconds:.0f} s of driving",
            "aligned on its own 515 s stop, heading by gyros, 10 Hz averages, against SPAN",
            f"horizontal {error.horizontal:.2f} m, height {error.up:+.2f} m, velocity "
            f"{error.velocity:.2f} m/s",
            "60 m, 3 m, 0.9 m/s at 120 s",
            "tests/navgrade/test_real_drive.py",
        )


def comparison(with_pyins: bool) -> list[str]:
    """Every reconstruction in frame n, and pyins, on the moving cases: horizontal / vertical."""
    cases = [case for case in CASES if any(c.mechanization == "n" for c in case.claims)]
    cases = [case for case in cases if case.name != "base at rest"]
    columns: list[list[str]] = []
    for case in cases:
        motion, edges = case.motion(), case.edges()
        imu, state = samples(true_increments(motion, edges)), state_at(motion, edges[CONTEXT])
        cells = []
        for name in RECONSTRUCTIONS:
            nav = navigate(imu, state, reconstruction=name)
            nav = nav[: int(np.searchsorted(nav.t, edges[-1 - CONTEXT], side="right")) : _EVERY]
            cells.append(_cell(nav, motion.state(nav.t)))
        cells.append(_pyins_cell(case) if with_pyins else "not installed")
        columns.append(cells)
    names = [*(f"`{name}`" for name in RECONSTRUCTIONS), "pyins"]
    return [
        "| algorithm | " + " | ".join(case.name for case in cases) + " |",
        "|---" * (len(cases) + 1) + "|",
        *(
            f"| {name} | " + " | ".join(column[row] for column in columns) + " |"
            for row, name in enumerate(names)
        ),
    ]


def _cell(nav: Solution, truth: State) -> str:
    error = position_error(nav, truth)
    return f"{_metres(error.horizontal)} / {_metres(error.vertical)}"


def _pyins_cell(case: Case) -> str:
    """pyins on the same motion, the truth made with its own gravity: integration error alone."""
    from benchmarks.peers import pyins_gravity, run_pyins_from
    from earth import quat_from_euler

    def field(sin_lat: Array, cos_lat: Array, h: Array) -> NormalGravity:
        down = pyins_gravity(np.arctan2(sin_lat, cos_lat), np.asarray(h))
        return NormalGravity(np.zeros_like(down), down)

    motion, edges = case.motion(), case.edges()[:-CONTEXT]
    with patch("tests.oracles.truth.zonal_from_trig", field):
        exact = motion.increments(edges)
    start = motion.state(edges[CONTEXT])
    rows = slice(CONTEXT, None)
    shown = Increments(exact.t[rows], exact.dt[rows], exact.dtheta[rows], exact.dvel[rows])
    before = (exact.dtheta[CONTEXT - 1], exact.dvel[CONTEXT - 1])
    peer = run_pyins_from(shown, start, before=before, repeats=1)
    nav = Trajectory(
        exact.t[rows].copy(),
        peer.lat,
        peer.lon,
        peer.h,
        peer.v_eb_n,
        quat_from_euler(peer.roll, peer.pitch, peer.heading),
        np.zeros(len(peer.lat), np.uint32),
    )
    return _cell(nav[::_EVERY], motion.state(nav.t[::_EVERY]))
