"""Alignments made up by closed forms: nothing is aligned."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from align.result import Alignment, Contribution, Convergence, Innovations
from align.stillness import StillReport, Stretch
from navgrade.alignment import AlignedWindow, Trace
from navgrade.state import NavState

DEG = np.pi / 180.0
MINUTE = 60.0
LOG = "/data/<script>alert(1)</script>&/parked <b>&amp;.mcap"
SITE = "site <i>&.toml"
LAT = 51.08 * DEG
ROLL, PITCH, HEADING = 1.585412, -2.674431, 64.726133  # deg
TILT = 10.4e-6  # rad
GYRO, CROSS, NOISE = 1.02e-3, 12.9e-6, 8.4e-5  # of the azimuth, rad
AZIMUTH = float(np.linalg.norm([GYRO, CROSS, NOISE]))


def stretch(*pieces: tuple[float, float], sway: bool = False) -> Stretch:
    """Kept pieces; what is between them is cut."""
    start, stop = pieces[0][0], pieces[-1][1]
    kept = sum(b - a for a, b in pieces)
    return Stretch(
        start=start,
        stop=stop,
        pieces=pieces,
        rows=np.zeros(0, bool),
        duration=kept,
        cut=stop - start - kept,
        motion="swaying" if sway else "still",
        force_scatter=0.031 if sway else 1.7e-4,
        rate_scatter=(0.04 if sway else 8e-5) * DEG,
        arw=np.array([0.0015, 0.0020, 0.0025]) * DEG / MINUTE,
        vrw=np.array([3.0, 5.0, 7.0]) * 9.80665e-6,
        arw_1s=np.zeros(3),
        vrw_1s=np.zeros(3),
    )


def still(*stretches: Stretch) -> StillReport:
    """Of a detector with one false alarm in a thousand spans."""
    return StillReport(stretches, 1e-3, 0.25, np.zeros(0, bool))


def alignment() -> Alignment:
    """A navigation-grade IMU, all there is to say said."""
    t = np.geomspace(2.0, 300.0, 40)
    rng = np.random.default_rng(7)
    off = rng.standard_normal((40, 3)) * np.array([2e-6, 2e-6, 8e-4]) * np.sqrt(300.0 / t)[:, None]
    off[-1] = 1e-17
    nis = rng.chisquare(3, 599)
    sources = ("accelerometer bias", "accelerometer noise", "gyro bias", "gyro noise")
    tilts = (np.sqrt(TILT**2 - 0.31e-6**2), 0.31e-6, 0.0, 0.0)
    azimuths = (CROSS, 0.0, GYRO, NOISE)
    q = np.array([0.844610536, 0.003863994, -0.019745661, 0.535003009])
    return Alignment(
        method="triad",
        reason="the base is still and the gyros are strong enough to find north",
        q_nb=q / np.linalg.norm(q),
        roll=ROLL * DEG,
        pitch=PITCH * DEG,
        heading=HEADING * DEG,
        P_n=np.diag([TILT**2, TILT**2, AZIMUTH**2]),
        roll_sigma=TILT,
        pitch_sigma=TILT,
        heading_sigma=AZIMUTH,
        tilt_sigma=TILT,
        azimuth_sigma=AZIMUTH,
        budget=tuple(map(Contribution, sources, tilts, azimuths)),
        grade="navigation",
        verdict="good for navigation-grade free inertial: level to 0.0006°, north to 0.059° (1σ)",
        gyro_heading=HEADING * DEG,
        gyro_heading_sigma=AZIMUTH,
        implied_latitude=51.0662 * DEG,
        specific_force_residual=-4.378e-4,
        rate_residual=0.0113 * DEG / 3600.0,
        rate_residual_down=-0.0071 * DEG / 3600.0,
        rate_residual_north=0.0042 * DEG / 3600.0,
        scatter=np.array([1.7e-6, 1.9e-6, 2.8e-3]),
        force_scatter=1.7e-4,
        rate_scatter=8e-5 * DEG,
        duration=288.4,
        convergence=Convergence(
            t,
            off,
            np.hypot(TILT, 2e-6 * np.sqrt(300.0 / t)),
            np.hypot(GYRO, 8e-4 * np.sqrt(300.0 / t)),
        ),
        gyro_bias=np.array([-0.2512, np.nan, 0.0123]) * DEG / 3600.0,
        gyro_bias_sigma=np.array([0.0511, np.nan, 0.0031]) * DEG / 3600.0,
        accel_bias=np.array([-43.8, np.nan, np.nan]) * 9.80665e-6,
        accel_bias_sigma=np.array([5.2, np.nan, np.nan]) * 9.80665e-6,
        unobservable=(
            "the gyro bias about east, which turns the heading by 0.059°",
            "the accelerometer biases along the level axes, which tilt by 2.1″",
        ),
        innovations=Innovations(
            np.arange(0.5, 300.0, 0.5), nis * 3.05 / nis.mean(), 3, 2.8, 3.2, consistent=True
        ),
        eigenvalue_gap=0.412,
        warnings=(
            "|f| differs from normal gravity by -0.438 mm/s² (no bias is stated, so this stands "
            "for its sigma)",
            "a <b>warning</b> & more",
        ),
    )


def aligned(**changes: Any) -> AlignedWindow:
    """The alignment in a log of 15 minutes: a stop with door slams, another, a sway, a drive."""
    pieces = tuple((a, b) for a, b in ((5.0, 92.0), (95.5, 184.0), (188.0, 305.0)))
    stretches = (
        stretch(*pieces),
        stretch((412.0, 480.0)),
        stretch((640.0, 700.0), (702.0, 838.5), sway=True),
    )
    t = np.arange(0.25, 900.1, 0.25)
    rng = np.random.default_rng(3)
    noise = np.abs(rng.standard_normal((2, len(t)))) + 0.2
    rate, force = noise * np.array([[2e-7], [3e-4]])
    for a, b in ((305.0, 412.0), (480.0, 640.0), (838.5, 900.0), (92.0, 95.5), (184.0, 188.0)):
        moving = (t > a) & (t <= b)
        rate[moving] = 0.05 * noise[0, moving]
        force[moving] = 0.8 * noise[1, moving]
    sway = (t > 640.0) & (t <= 838.5)
    rate[sway] = 1e-3 * np.abs(np.sin(t[sway] / 1.3)) + 1e-6
    force[sway] = 0.05 * np.abs(np.sin(t[sway] / 1.3)) + 1e-3
    kept = np.zeros(len(t), bool)
    for a, b in pieces:
        kept |= (t > a) & (t <= b)
    state = NavState(lat=LAT, lon=-114.1337 * DEG, h=1118.5, t=305.0)
    trace = Trace(t, rate, force, kept)
    found = AlignedWindow(alignment(), 5.0, 300.0, state, still(*stretches), 0, trace)
    return replace(found, **changes)


def bare() -> AlignedWindow:
    """Only the level was found, upside down; nothing else is known."""
    nan = float("nan")
    result = replace(
        alignment(),
        method="level",
        reason="the gyros are too weak",
        q_nb=np.full(4, nan),
        roll=-178.25 * DEG,
        heading=nan,
        heading_sigma=np.pi,
        azimuth_sigma=np.pi,
        budget=(),
        grade="levelling",
        verdict="good for levelling only",
        gyro_heading=nan,
        gyro_heading_sigma=np.pi,
        implied_latitude=nan,
        rate_residual=nan,
        rate_residual_down=nan,
        rate_residual_north=nan,
        scatter=np.full(3, nan),
        convergence=None,
        gyro_bias=None,
        gyro_bias_sigma=None,
        accel_bias=None,
        accel_bias_sigma=None,
        unobservable=(),
        innovations=None,
        eigenvalue_gap=nan,
        warnings=(),
    )
    nothing = np.zeros(0)
    trace = Trace(nothing, nothing, nothing, np.zeros(0, bool))
    return AlignedWindow(result, 0.0, 300.0, None, still(), None, trace)
