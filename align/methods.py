"""Every method by its name, and the two that work on more than means."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from align.accuracy import MAX_HEADING_SIGMA, SensorErrors, left_over
from align.checks import Residuals, residuals
from align.errors import AlignmentError, WeakGyrosError
from align.fine import fine_align
from align.inertial_frame import InertialFrame
from align.multi_position import Position, align_positions
from align.result import Alignment, Contribution
from align.static import BY_GYROS, STATIC_METHODS, KnownHeading, at_rest, scatter
from align.stillness import Stillness
from align.window import (
    ONE_RESIDUAL,
    UNSTATED_ACCEL_BIAS,
    Quality,
    bias_sigma,
    compass,
    conclude,
    examine,
)
from earth.ellipsoid import WGS84, Ellipsoid
from earth.gravity import normal_gravity_n
from earth.rates import omega_ie_n
from earth.rotation import euler_from_quat
from earth.units import DEG, DEG_PER_H

Array = NDArray[np.float64]

METHODS = {
    "auto": "the one for the motion found and the heading given",
    **STATIC_METHODS,
    "inertial": "gravity's turn in inertial space, for a base that sways",
    "fine": "a zero-velocity Kalman filter from the coarse attitude, with the biases that show",
    "multi-position": "attitude and biases together, from two or more still orientations",
}
_LEAST_BIAS = 1e-9  # of what is sensed: of perfect sensors
_FALSE_ALARM = 1e-3
_DRIVES = 2.0  # m/s rms: no berth moves a ship so fast, nor wind a parked car


def align_fine(
    dt: Array,
    omega_ib_b: Array,
    f_ib_b: Array,
    lat: float,
    h: float,
    *,
    errors: SensorErrors | None = None,
    known_heading: KnownHeading | None = None,
    still: NDArray[np.bool_] | None = None,
    t: Array | None = None,
    lon: float | None = None,
    ellipsoid: Ellipsoid = WGS84,
) -> Alignment:
    """Align by the static methods, then by the filter of `align.fine`.

    Parameters are those of `align_static` and `align.fine.fine_align`.

    Raises
    ------
    AlignmentError
        As either.
    """
    kept = np.ones(len(dt), bool) if still is None else still
    stated = errors or SensorErrors()
    window = examine(dt[kept], omega_ib_b[kept], f_ib_b[kept], lat, h, stated, ellipsoid)
    coarse = at_rest(window, stated, known_heading, lon=lon)
    assumed = SensorErrors(
        gyro_bias=max(window.rate_bias.sigma, _LEAST_BIAS * ellipsoid.omega),
        accel_bias=max(window.force_bias.sigma, _LEAST_BIAS * window.g),
        arw=None if window.rate_noise.exceeds else stated.arw,
        vrw=None if window.force_noise.exceeds else stated.vrw,
    )
    found = fine_align(
        dt,
        omega_ib_b,
        f_ib_b,
        coarse.q_nb,
        lat,
        h,
        errors=assumed,
        still=kept,
        t=t,
        heading=None if coarse.method in BY_GYROS else known_heading,
        ellipsoid=ellipsoid,
    )
    warnings = list(coarse.warnings)
    mean, said = float(np.mean(found.innovations.nis)), found.innovations
    if not said.consistent:
        warnings.append(
            f"the mean normalised innovation is {mean:.2f}, not {said.low:.2f} to {said.high:.2f}: "
            + (
                "the base moves, or the sensors' noise is more than stated or not white; believe "
                "the sigmas of method triad rather than these"
                if mean > said.high
                else "noise is less than assumed or not white, and the sigmas err on the safe side"
            )
        )
    return conclude(
        window.quality,
        "fine",
        "as chosen",
        found.q_nb,
        found.P_n,
        left_over(found.P_n, coarse.budget),
        warnings=tuple(warnings),
        gyro_heading=coarse.gyros.heading,
        gyro_heading_sigma=coarse.gyros.sigma,
        scatter=scatter(window, coarse),
        convergence=found.convergence,
        gyro_bias=found.gyro_bias,
        gyro_bias_sigma=found.gyro_bias_sigma,
        accel_bias=found.accel_bias,
        accel_bias_sigma=found.accel_bias_sigma,
        unobservable=found.unobservable,
        innovations=found.innovations,
    )


def align_swaying(
    increments: Iterable[tuple[Array, Array, Array]],
    lat: float,
    h: float,
    *,
    errors: SensorErrors | None = None,
    stillness: Stillness | None = None,
    reason: str = "as chosen",
    ellipsoid: Ellipsoid = WGS84,
) -> Alignment:
    """Align a base that sways about a fixed place.

    Parameters
    ----------
    increments : iterable of (dt, phi, dv)
        Blocks of consecutive intervals: their length, s, shape (n,); the rotation vector of each,
        rad, and the velocity increment in body axes at its start, m/s, shape (n, 3), as
        `navgrade.reconstruction.reconstruct` gives them.
    lat, h : float
        Geodetic latitude (rad) and ellipsoidal height (m) from the survey.
    errors : SensorErrors, optional
        Stated 1-sigma. A bias not stated is taken from the residuals; noise not stated counts as
        zero, so state what the data show.
    stillness : Stillness, optional
        For the report.
    reason : str
        Why this method.
    ellipsoid : Ellipsoid

    Returns
    -------
    Alignment
        At the end of the last interval.

    Raises
    ------
    AlignmentError
        As `align.inertial_frame.InertialFrame`, and when the base leaves its place.
    WeakGyrosError
        When the gyros are too weak to find north.
    """
    stated = errors or SensorErrors()
    frame = InertialFrame(lat, h, ellipsoid=ellipsoid)
    for dt, phi, dv in increments:
        frame.add(dt, phi, dv)
    first = frame.solution(stated)
    motion = max(line.azimuth for line in first.budget if line.source == "motion of the base")
    if first.velocity_rms > _DRIVES or motion > MAX_HEADING_SIGMA:
        raise AlignmentError(
            "the base is not still, and it does more than sway: its velocity varies by "
            f"{first.velocity_rms:.2g} m/s rms over the window, so it leaves its place; choose "
            "alignment.start_s and duration_s inside a stop"
        )
    omega_n = omega_ie_n(lat, ellipsoid)
    north, force = first.rate_residual_north, first.specific_force_residual
    g = float(np.linalg.norm(normal_gravity_n(lat, h, ellipsoid)))
    assumed, warnings = _proven(stated, first.budget, north, force, omega_n[0], g)
    found = frame.solution(assumed)
    azimuth = float(np.sqrt(found.P_n[2, 2]))
    if azimuth > MAX_HEADING_SIGMA:
        raise WeakGyrosError(
            f"the gyros cannot find north on a base that sways: heading would have a sigma of "
            f"{min(azimuth / DEG, 180.0):.0f}°; state better gyros if they are, wait longer, or "
            "give [initial]"
        )
    implied = np.arccos(np.clip((omega_n[0] + north) / ellipsoid.omega, -1.0, 1.0))
    nan = float("nan")
    shown = Residuals(force, nan, nan, north, float(np.copysign(implied, lat)))
    quality = Quality(shown, stillness or Stillness(nan, nan), found.duration, tuple(warnings))
    return conclude(
        quality,
        "inertial",
        reason,
        found.q_nb,
        found.P_n,
        found.budget,
        convergence=found.convergence,
        gyro_heading=compass(float(euler_from_quat(found.q_nb)[2])),
        gyro_heading_sigma=azimuth,
        scatter=np.full(3, nan),
        eigenvalue_gap=found.gap,
    )


def _proven(
    stated: SensorErrors,
    budget: tuple[Contribution, ...],
    north: float,
    force: float,
    level_rate: float,
    g: float,
) -> tuple[SensorErrors, list[str]]:
    """Take biases from residuals where none is stated, or where they prove more than is stated."""
    noise = {line.source: line for line in budget}
    by_rate = noise["gyro noise"].azimuth * level_rate
    gyro = bias_sigma(stated.gyro_bias, by_rate, abs(north), ONE_RESIDUAL)
    by_force = noise["accelerometer noise"].tilt * g
    accel = bias_sigma(stated.accel_bias, by_force, abs(force), ONE_RESIDUAL, UNSTATED_ACCEL_BIAS)
    warnings = []
    if stated.gyro_bias is not None and gyro.note:
        warnings.append(
            f"the gyros miss the Earth rate by {north / DEG_PER_H:+.3f} deg/h along north "
            f"{gyro.note}"
        )
    if stated.accel_bias is not None and accel.note:
        warnings.append(f"|f| differs from normal gravity by {force * 1e3:+.3f} mm/s² {accel.note}")
    return replace(stated, gyro_bias=gyro.sigma, accel_bias=accel.sigma), warnings


def align_together(
    means: Sequence[tuple[Array, Array, Array]],
    lat: float,
    h: float,
    *,
    errors: SensorErrors | None = None,
    ellipsoid: Ellipsoid = WGS84,
) -> list[Alignment]:
    """Align several still orientations of one IMU, with the biases they share.

    Parameters
    ----------
    means : sequence of (dt, omega_ib_b, f_ib_b)
        One orientation each, as `align_static` takes them.
    lat, h : float
        Geodetic latitude (rad) and ellipsoidal height (m) from the survey.
    errors : SensorErrors, optional
        See `align.multi_position.align_positions`; a bias not stated is taken from the residuals
        of the single positions.
    ellipsoid : Ellipsoid

    Returns
    -------
    list of Alignment
        One for each; their residuals are those that the biases leave.

    Raises
    ------
    AlignmentError
        As `align_static` and `align.multi_position.align_positions`.
    """
    errors = errors or SensorErrors()
    windows = [examine(*rows, lat, h, errors, ellipsoid) for rows in means]
    rate_bias = max(window.rate_bias for window in windows)
    force_bias = max(window.force_bias for window in windows)
    windows = [replace(w, rate_bias=rate_bias, force_bias=force_bias) for w in windows]
    errors = replace(errors, gyro_bias=rate_bias.sigma, accel_bias=force_bias.sigma)
    found = align_positions(
        [
            Position(
                window.omega_ib_b,
                window.f_ib_b,
                window.duration,
                arw=window.rate_noise.sigma * np.sqrt(window.duration),
                vrw=window.force_noise.sigma * np.sqrt(window.duration),
            )
            for window in windows
        ],
        lat,
        h,
        errors=errors,
        ellipsoid=ellipsoid,
    )
    warnings: tuple[str, ...] = ()
    if found.chi2 > scipy.special.chdtri(found.dof, _FALSE_ALARM):
        warnings = (
            f"the positions fit each other worse than the stated errors allow (chi-square "
            f"{found.chi2:.1f} with {found.dof} degrees of freedom): the biases changed between "
            "them, or more is wrong",
        )
    results = []
    for k, window in enumerate(windows):
        shown = residuals(
            window.omega_ib_b - found.gyro_bias,
            window.f_ib_b - found.accel_bias,
            lat,
            window.g_n,
            ellipsoid,
        )
        results.append(
            conclude(
                Quality(shown, window.stillness, window.duration, warnings),
                "multi-position",
                f"position {k + 1} of {len(windows)}, biases in common",
                found.q_nb[k],
                found.P_n[k],
                left_over(found.P_n[k], window.budget()),
                gyro_heading=compass(float(euler_from_quat(found.q_nb[k])[2])),
                gyro_heading_sigma=float(np.sqrt(found.P_n[k, 2, 2])),
                scatter=np.full(3, np.nan),
                gyro_bias=found.gyro_bias,
                gyro_bias_sigma=found.gyro_bias_sigma,
                accel_bias=found.accel_bias,
                accel_bias_sigma=found.accel_bias_sigma,
                unobservable=found.unobservable,
            )
        )
    return results
