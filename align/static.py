"""Static alignment of one window: attitude, its sigmas, and what speaks for and against it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.accuracy import SensorErrors, euler_sigmas, heading_sigma, tilt_sigma
from align.errors import AlignmentError
from align.leveling import leveled_attitude
from align.stillness import FORCE_LIMIT, RATE_LIMIT, assess, span_means
from align.triad import analytic_coarse
from earth.ellipsoid import WGS84, Ellipsoid
from earth.gravity import normal_gravity_n
from earth.rotation import dcm_from_quat, euler_from_quat, quat_from_dcm, rotvec_from_quat
from earth.units import DEG, DEG_PER_H

Array = NDArray[np.float64]

MAX_HEADING_SIGMA = 15.0 * DEG  # beyond it gyros have not found north
SUB_WINDOWS = 10
_SIGNIFICANT = 3.0  # sigmas
_DEGREES_IN_RADIAN = 1.0 / DEG
_LATITUDE_OFF = 10.0 * DEG  # between implied and surveyed latitude: a mistake, not a bias
_STEADY_TURN = 1.0 * DEG  # rad/s: with steady specific force, more than any gyro's bias


@dataclass(frozen=True)
class KnownHeading:
    """A heading from survey or eye, and its sigma, rad."""

    heading: float
    sigma: float


@dataclass(frozen=True, eq=False)
class StaticAlignment:
    """Attitude of a body at rest.

    Attributes
    ----------
    method : str
        ``triad`` (leveling and gyrocompassing) or ``leveling+known-heading``.
    q_nb : ndarray, shape (4,)
    roll, pitch, heading : float
        rad; heading in [0, 2 pi).
    roll_sigma, pitch_sigma, heading_sigma : float
        Predicted 1-sigma, rad.
    tilt_sigma, azimuth_sigma : float
        1-sigma of the small rotations about a horizontal axis and about down, rad; unlike roll
        and heading they stay meaningful at pitch ±90°.
    gyro_heading, gyro_heading_sigma : float
        What the gyros alone say, rad, used or not.
    implied_latitude : float
        Latitude the data alone imply, rad.
    specific_force_residual : float
        ``|f| - g``, m/s^2.
    rate_residual : float
        ``|omega| - omega_ie``, rad/s.
    rate_residual_down, rate_residual_north : float
        Measured minus expected Earth rate about down and along north, rad/s: the part of the
        gyro error that shows.
    scatter : ndarray, shape (3,)
        Standard deviation of the attitude between sub-windows about north, east, down, rad.
    force_scatter, rate_scatter : float
        Stillness statistics, m/s^2 and rad/s.
    duration : float
        s of samples used.
    warnings : tuple of str
    """

    method: str
    q_nb: Array
    roll: float
    pitch: float
    heading: float
    roll_sigma: float
    pitch_sigma: float
    heading_sigma: float
    tilt_sigma: float
    azimuth_sigma: float
    gyro_heading: float
    gyro_heading_sigma: float
    implied_latitude: float
    specific_force_residual: float
    rate_residual: float
    rate_residual_down: float
    rate_residual_north: float
    scatter: Array
    force_scatter: float
    rate_scatter: float
    duration: float
    warnings: tuple[str, ...]


def check_units_at_rest(
    omega_ib_b: Array, f_ib_b: Array, lat: float, ellipsoid: Ellipsoid = WGS84
) -> None:
    """Refuse mean rates that only a wrong unit or a processed stream explains.

    Parameters
    ----------
    omega_ib_b, f_ib_b : ndarray, shape (3,)
        Means over a stretch at rest, rad/s and m/s^2.
    lat : float
        Geodetic latitude, rad.
    ellipsoid : Ellipsoid

    Raises
    ------
    AlignmentError
    """
    _check_force(f_ib_b)
    _check_rate(omega_ib_b, f_ib_b, lat, ellipsoid)


def _check_force(f_ib_b: Array) -> None:
    force = float(np.linalg.norm(f_ib_b))
    if force < 0.5:
        raise AlignmentError(
            f"specific force at rest is {force:.4f} m/s², not 9.8: gravity has been removed from "
            "this stream, and without it nothing can be leveled or navigated; log the raw IMU "
            "topic instead"
        )
    if 0.8 < force < 1.2:
        raise AlignmentError(
            f"specific force at rest is {force:.4f}, not 9.8 m/s²: it is in g; set "
            'imu.accel_unit = "g" in the site file'
        )
    if not 9.0 < force < 10.6:
        raise AlignmentError(
            f"specific force at rest is {force:.4f} m/s², not 9.8: the body accelerates, or the "
            "unit or the kind (increments declared as rates?) is wrong"
        )


def _check_rate(omega_ib_b: Array, f_ib_b: Array, lat: float, ellipsoid: Ellipsoid) -> None:
    rate = float(np.linalg.norm(omega_ib_b))
    turns = rate / ellipsoid.omega
    implied = _implied_latitude(omega_ib_b, f_ib_b)
    is_earth_rate = abs(turns / _DEGREES_IN_RADIAN - 1.0) < 0.1 and abs(implied - lat) < 10.0 * DEG
    if is_earth_rate or rate > _STEADY_TURN:
        otherwise = "" if is_earth_rate else ", unless the body turns about the vertical: not still"
        raise AlignmentError(
            f"the gyros read {rate:.5f} rad/s, {turns:.1f} times the Earth rate, while the "
            'specific force stays put: they are in degrees; set imu.gyro_unit = "deg/s" in the '
            f"site file{otherwise}"
        )


def _implied_latitude(omega_ib_b: Array, f_ib_b: Array) -> float:
    """Angle of the rotation above the horizon, rad: the latitude of a body at rest.

    Not a number where nothing turns.
    """
    product = float(np.linalg.norm(omega_ib_b) * np.linalg.norm(f_ib_b))
    if product == 0.0:
        return float("nan")
    return float(np.arcsin(np.clip(omega_ib_b @ f_ib_b / product, -1.0, 1.0)))


def align_static(
    dt: Array,
    omega_ib_b: Array,
    f_ib_b: Array,
    lat: float,
    h: float,
    *,
    errors: SensorErrors | None = None,
    known_heading: KnownHeading | None = None,
    ellipsoid: Ellipsoid = WGS84,
) -> StaticAlignment:
    """Find the attitude of a body at rest from one window of IMU samples.

    Down comes from the accelerometers. North comes from the gyros or from `known_heading`,
    whichever has the smaller sigma.

    Parameters
    ----------
    dt : ndarray, shape (n,)
        Interval of each sample, s.
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        Angular rate (rad/s) and specific force (m/s^2) in body axes (forward-right-down).
    lat, h : float
        Geodetic latitude (rad) and ellipsoidal height (m) from the survey.
    errors : SensorErrors, optional
        Stated 1-sigma. What is not stated is taken from the data as far as it shows there.
    known_heading : KnownHeading, optional
    ellipsoid : Ellipsoid

    Returns
    -------
    StaticAlignment
        Sigmas: accelerometer error over g for tilt; eastward gyro error over the horizontal
        Earth rate for heading (`align.accuracy`). The stated biases are enlarged where the
        residuals against the known gravity and Earth rate prove them too small.

    Raises
    ------
    AlignmentError
        When the window is not still, a unit is wrong, or the gyros are too weak to find north
        and no heading is given.
    """
    errors = SensorErrors() if errors is None else errors
    duration = float(dt.sum())
    if duration < 2.0:
        raise AlignmentError(
            f"the alignment window holds {duration:.3f} s of samples; it takes 2 s at least, and "
            "minutes for gyros to find north"
        )
    f = dt @ f_ib_b / duration
    omega = dt @ omega_ib_b / duration
    g = float(np.linalg.norm(normal_gravity_n(lat, h, ellipsoid)))

    _check_force(f)
    stillness = assess(dt, omega_ib_b, f_ib_b)
    if stillness.force <= FORCE_LIMIT:
        _check_rate(omega, f, lat, ellipsoid)
    if not stillness.is_still:
        raise AlignmentError(
            f"the alignment window is not still: one-second means scatter by "
            f"{stillness.force:.4f} m/s² (limit {FORCE_LIMIT}) and "
            f"{stillness.rate / DEG:.4f} deg/s (limit {RATE_LIMIT / DEG:.2f}); choose "
            "alignment.start_s and duration_s inside a stop"
        )

    # what the data show of the errors
    up = f / np.linalg.norm(f)
    rate_up = float(omega @ up)
    rate_level = float(np.linalg.norm(omega - rate_up * up))
    residual_down = -rate_up + ellipsoid.omega * np.sin(lat)
    residual_north = rate_level - ellipsoid.omega * np.cos(lat)
    rate_shown = float(np.hypot(residual_down, residual_north) / np.sqrt(2.0))
    force_residual = float(np.linalg.norm(f)) - g
    sub_f = span_means(dt, f_ib_b, duration / SUB_WINDOWS)
    sub_omega = span_means(dt, omega_ib_b, duration / SUB_WINDOWS)
    rate_noise = _noise(errors.arw, sub_omega, duration)
    force_noise = _noise(errors.vrw, sub_f, duration)

    warnings: list[str] = []
    rate_sigma, rate_note = _total_sigma(errors.gyro_bias, rate_noise, rate_shown)
    force_sigma, force_note = _total_sigma(errors.accel_bias, force_noise, abs(force_residual))
    tilt = tilt_sigma(force_sigma, g)
    azimuth = heading_sigma(rate_sigma, force_sigma, lat, g, ellipsoid)
    implied = _implied_latitude(omega, f)
    if force_note:
        warnings.append(
            f"|f| differs from normal gravity by {force_residual * 1e3:+.3f} mm/s² {force_note}"
        )
    implied_off = implied - lat
    if rate_note:
        implies = "the data imply no latitude"
        if np.isfinite(implied):
            implies = (
                f"the data imply latitude {implied / DEG:.3f}°, {implied_off / DEG:+.3f}° from the "
                "site's"
            )
        warnings.append(
            f"the gyros miss the Earth rate by {residual_down / DEG_PER_H:+.3f} deg/h about down "
            f"and {residual_north / DEG_PER_H:+.3f} deg/h along north {rate_note}; {implies}. "
            "These parts do not turn the heading, but an eastward error does and cannot be seen: "
            f"of the same size it would turn the heading by {azimuth / DEG:.2f}°"
        )
    rate_residual = float(np.linalg.norm(omega)) - ellipsoid.omega
    latitude_note = ""
    if errors.gyro_bias is None:  # then a rate that fits the Earth's is no coincidence
        limit = _LATITUDE_OFF if abs(rate_residual) < 0.05 * ellipsoid.omega else np.pi
    else:
        explained = float(np.hypot(rate_noise, errors.gyro_bias)) / ellipsoid.omega
        limit = max(_LATITUDE_OFF, _SIGNIFICANT * explained)
    if abs(implied_off) > limit:
        latitude_note = (
            f"the gyros feel the Earth turn, but as at latitude {implied / DEG:.1f}°, the site "
            f"says {lat / DEG:.1f}°: check site.latitude (hemisphere, latitude and longitude "
            "swapped) and imu.axes"
        )
        warnings.append(latitude_note)

    q_gyro = None
    gyro_heading = float("nan")
    try:
        q_gyro = quat_from_dcm(analytic_coarse(f, omega))
        gyro_heading = float(euler_from_quat(q_gyro)[2])
    except AlignmentError:
        azimuth = np.pi
    q_known = None
    if known_heading is not None:
        q_known = leveled_attitude(f, known_heading.heading)
        pitch = float(euler_from_quat(q_known)[1])
        by_tilt = tilt / max(abs(np.cos(pitch)), 1e-12)  # roll, and with it heading, at pitch 90°
        explained = float(np.linalg.norm([azimuth, known_heading.sigma, by_tilt]))
        off = 0.0 if q_gyro is None else float(_small_rotation(q_gyro, q_known)[2])
        if abs(off) > _SIGNIFICANT * explained:
            warnings.append(
                f"the gyros point {off / DEG:+.2f}° from the given heading, more than the "
                f"{explained / DEG:.2f}° sigma of the difference explains"
            )
    if known_heading is not None and q_known is not None and known_heading.sigma < azimuth:
        method, down_sigma, q_nb = "leveling+known-heading", known_heading.sigma, q_known
    elif q_gyro is not None and azimuth <= MAX_HEADING_SIGMA:
        method, down_sigma, q_nb = "triad", azimuth, q_gyro
    else:
        raise AlignmentError(
            f"the gyros cannot find north: heading would have a sigma of "
            f"{min(azimuth / DEG, 180.0):.0f}° (gyro error {rate_sigma / DEG_PER_H:.3g} deg/h "
            f"against a horizontal Earth rate of {ellipsoid.omega * np.cos(lat) / DEG_PER_H:.2f} "
            "deg/h); give site.heading_deg and site.heading_sigma_deg"
            + (f"; {latitude_note}" if latitude_note else "")
        )
    euler = euler_from_quat(q_nb)
    sigmas = euler_sigmas(euler, tilt, down_sigma)
    if method != "triad":  # the Euler angle itself is given; tilt moves the turn about down instead
        sigmas = (sigmas[0], sigmas[1], down_sigma)
        down_sigma = float(min(np.hypot(down_sigma, tilt * abs(np.tan(euler[1]))), np.pi))
    if dcm_from_quat(q_nb)[2, 2] < -0.5:
        warnings.append(
            f"the body hangs upside down (roll {euler[0] / DEG:.1f}°); if it does not, imu.axes "
            "is wrong"
        )
    return StaticAlignment(
        method=method,
        q_nb=q_nb,
        roll=float(euler[0]),
        pitch=float(euler[1]),
        heading=_compass(float(euler[2])),
        roll_sigma=sigmas[0],
        pitch_sigma=sigmas[1],
        heading_sigma=sigmas[2],
        tilt_sigma=tilt,
        azimuth_sigma=down_sigma,
        gyro_heading=_compass(gyro_heading),
        gyro_heading_sigma=azimuth,
        implied_latitude=implied,
        specific_force_residual=force_residual,
        rate_residual=rate_residual,
        rate_residual_down=residual_down,
        rate_residual_north=residual_north,
        scatter=_scatter(sub_f, sub_omega, q_nb, method != "triad"),
        force_scatter=stillness.force,
        rate_scatter=stillness.rate,
        duration=duration,
        warnings=tuple(warnings),
    )


def _compass(heading: float) -> float:
    """The same direction in [0, 2 pi)."""
    wrapped = heading % (2.0 * np.pi)
    return 0.0 if wrapped == 2.0 * np.pi else wrapped  # of a tiny negative angle


def _noise(random_walk: float | None, sub_means: Array, duration: float) -> float:
    """Sigma of the window's mean: the larger of stated white noise and observed scatter."""
    shown = 0.0
    if len(sub_means) > 1:
        per_axis = np.var(sub_means, axis=0, ddof=1) / len(sub_means)
        shown = float(np.sqrt(per_axis.mean()))
    stated = 0.0 if random_walk is None else random_walk / np.sqrt(duration)
    return max(shown, stated)


def _total_sigma(bias: float | None, noise: float, shown: float) -> tuple[float, str]:
    """Sigma of a mean, and the words for why it is not simply what was stated."""
    if bias is None:
        return float(np.hypot(noise, shown)), "(no bias is stated, so this stands for its sigma)"
    stated = float(np.hypot(noise, bias))
    if shown > _SIGNIFICANT * stated:
        return float(np.hypot(noise, shown)), (
            "(more than the stated errors allow, so the sigmas were enlarged)"
        )
    return stated, ""


def _scatter(sub_f: Array, sub_omega: Array, q_nb: Array, leveled: bool) -> Array:
    """Standard deviation of the sub-windows' attitudes about north, east, down."""
    heading = float(euler_from_quat(q_nb)[2])
    turns = []
    for f, omega in zip(sub_f, sub_omega, strict=True):
        q = leveled_attitude(f, heading) if leveled else quat_from_dcm(analytic_coarse(f, omega))
        turns.append(_small_rotation(q, q_nb))
    if len(turns) < 2:
        return np.full(3, np.nan)
    scatter: Array = np.std(turns, axis=0, ddof=1)
    return scatter


def _small_rotation(q_hat: Array, q: Array) -> Array:
    return rotvec_from_quat(quat_from_dcm(dcm_from_quat(q_hat) @ dcm_from_quat(q).T))
