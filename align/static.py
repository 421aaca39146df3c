"""Static alignment of one window at rest: level by the accelerometers, north by gyros or survey."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from align.accuracy import (
    MAX_HEADING_SIGMA,
    UNIFORM,
    SensorErrors,
    gyro_covariance,
    known_heading_budget,
    known_heading_covariance,
    wahba_budget,
)
from align.checks import latitude_contradiction
from align.errors import AlignmentError, WeakGyrosError
from align.gyrocompass import gyrocompass
from align.leveling import level, leveled_attitude
from align.result import Alignment, Contribution, Convergence
from align.triad import triad
from align.wahba import WahbaSolution, vectors_at_rest, wahba
from align.window import SIGNIFICANT, Window, compass, conclude, examine, small_rotation
from earth.ellipsoid import WGS84, Ellipsoid
from earth.rotation import dcm_from_quat, euler_from_quat, quat_from_dcm, quat_from_euler, skew
from earth.units import DEG, DEG_PER_H

Array = NDArray[np.float64]
Attitude = Callable[[Array, Array], Array]  # of mean specific force and mean rate

STATIC_METHODS = {
    "triad": "gravity and Earth rate as two vectors, gravity kept exactly",
    "gyrocompass": "roll and pitch by leveling, then heading by the leveled gyros",
    "wahba": "gravity and Earth rate weighted by their sigmas",
    "known-heading": "roll and pitch by leveling, heading from the survey",
    "level": "roll and pitch alone",
}
BY_GYROS = ("triad", "gyrocompass", "wahba")
POLE = 1.0 * DEG  # nearer than this, gyros find no north
_CURVE = 40  # points of the convergence
_LEAST = 1e-9  # rad: sigma of the directions of perfect sensors
_WANTED = 1.0 * DEG  # heading sigma a user with weak gyros is told the way to


@dataclass(frozen=True)
class KnownHeading:
    """A heading from survey or eye, and its sigma, rad."""

    heading: float
    sigma: float


@dataclass(frozen=True)
class Gyros:
    """What the gyros alone say of north: an attitude or none, and its azimuth's 1-sigma, rad."""

    q_nb: Array | None
    sigma: float

    @property
    def heading(self) -> float:
        return float("nan") if self.q_nb is None else compass(float(euler_from_quat(self.q_nb)[2]))


def align_static(
    dt: Array,
    omega_ib_b: Array,
    f_ib_b: Array,
    lat: float,
    h: float,
    *,
    errors: SensorErrors | None = None,
    known_heading: KnownHeading | None = None,
    method: str = "auto",
    lon: float | None = None,
    convergence: bool = True,
    ellipsoid: Ellipsoid = WGS84,
) -> Alignment:
    """Find the attitude of a body at rest from one window of IMU samples.

    Down comes from the accelerometers. North comes from the gyros or from `known_heading`,
    whichever has the smaller sigma unless `method` says.

    Parameters
    ----------
    dt : ndarray, shape (n,)
        Interval of each row, s.
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        Mean angular rate (rad/s) and specific force (m/s^2) of each row in body axes
        (forward-right-down): samples, or spans of them.
    lat, h : float
        Geodetic latitude (rad) and ellipsoidal height (m) from the survey.
    errors : SensorErrors, optional
        Stated 1-sigma. What is not stated is taken from the data as far as it shows there.
    known_heading : KnownHeading, optional
    method : str
        Of `STATIC_METHODS`, or ``auto``.
    lon : float, optional
        Longitude, rad, to recognise one that was swapped with the latitude.
    convergence : bool
        Also align growing parts of the window, which takes most of the time.
    ellipsoid : Ellipsoid

    Returns
    -------
    Alignment
        Sigmas: accelerometer error over g for tilt; eastward gyro error over the horizontal
        Earth rate for heading (`align.accuracy`). The stated errors are enlarged where scatter,
        or the residuals against the known gravity and Earth rate, prove them too small. With
        ``level`` the quaternion and the heading are not numbers. With a known heading the gyro
        bias shows, and is estimated.

    Raises
    ------
    AlignmentError
        When the window is not still, a unit is wrong, or gyros contradict the latitude.
    WeakGyrosError
        When the gyros are too weak to find north, or the pole too near, and no heading is given.
    """
    if method not in ("auto", *STATIC_METHODS):
        raise ValueError(f"method {method!r} is not one of auto, {', '.join(STATIC_METHODS)}")
    if method == "known-heading" and known_heading is None:
        raise AlignmentError(
            "method known-heading has no heading: give [azimuth], or site.heading_deg and "
            "site.heading_sigma_deg"
        )
    errors = SensorErrors() if errors is None else errors
    window = examine(dt, omega_ib_b, f_ib_b, lat, h, errors, ellipsoid)
    found = at_rest(window, errors, known_heading, method, lon)
    more: dict[str, Any] = {}
    if convergence:
        more["convergence"] = _convergence(dt, omega_ib_b, f_ib_b, window, found)
    if found.method == "known-heading":
        more["gyro_bias"], more["gyro_bias_sigma"] = _gyro_bias(window, found.q_nb, found.P_n)
    result = conclude(
        window.quality,
        found.method,
        found.reason,
        found.q_nb,
        found.P_n,
        found.budget,
        warnings=found.warnings,
        gyro_heading=found.gyros.heading,
        gyro_heading_sigma=found.gyros.sigma,
        scatter=scatter(window, found),
        **more,
    )
    if found.method == "level":
        return replace(result, q_nb=np.full(4, np.nan), heading=float("nan"))
    return result


@dataclass(frozen=True, eq=False)
class AtRest:
    """Attitude of a window by one of the static methods.

    Attributes
    ----------
    method, reason, q_nb, P_n, budget, warnings
        Of `align.result.Alignment`; warnings beside the window's, and a heading of 0 where it is
        unknown.
    attitude : callable
        How the method turns means of force and rate into ``q_nb``.
    gyros : Gyros
        What the gyros alone say.
    """

    method: str
    reason: str
    q_nb: Array
    P_n: Array
    budget: tuple[Contribution, ...]
    warnings: tuple[str, ...]
    attitude: Attitude
    gyros: Gyros


def at_rest(
    window: Window,
    errors: SensorErrors,
    known_heading: KnownHeading | None = None,
    method: str = "auto",
    lon: float | None = None,
) -> AtRest:
    """Find the attitude of a window; parameters and errors are those of `align_static`."""
    gyros = _ask_gyros(window)
    reason = "as chosen"
    if method == "auto":
        method, reason = "triad", "at rest the means of all samples are the best estimate"
        if known_heading is not None and known_heading.sigma < gyros.sigma:
            method, reason = "known-heading", "the given heading is better than the gyros' own"
    warnings: list[str] = []
    stated = None
    if errors.gyro_bias is not None:
        stated = float(np.hypot(window.rate_noise.sigma, errors.gyro_bias))
    if contradiction := latitude_contradiction(
        window.shown, stated, window.lat, lon, window.ellipsoid
    ):
        if method in BY_GYROS:
            raise AlignmentError(contradiction)
        warnings.append(contradiction)
    if method in BY_GYROS and (gyros.q_nb is None or gyros.sigma > MAX_HEADING_SIGMA):
        raise WeakGyrosError(_too_weak(window, gyros.sigma))
    if known_heading is not None:
        warnings += _contradicted(window, gyros, known_heading)
    attitude = _attitude(method, window, known_heading)
    q_nb = attitude(window.f_ib_b, window.omega_ib_b)
    if method == "wahba":
        P_n = _weighted(window, window.f_ib_b, window.omega_ib_b).P_n
        budget = window.budget(wahba_budget)
    elif method in BY_GYROS:
        P_n = gyro_covariance(window.tilt, gyros.sigma, window.lat)
        budget = window.budget()
    else:
        source, sigma = "unknown heading", UNIFORM
        if method == "known-heading" and known_heading is not None:
            source, sigma = "given heading", known_heading.sigma
        euler = euler_from_quat(q_nb)
        P_n = known_heading_covariance(window.tilt, sigma, euler)
        budget = known_heading_budget(
            source,
            sigma,
            window.force_bias.sigma,
            window.force_noise.sigma,
            float(euler[1]),
            window.g,
        )
    return AtRest(method, reason, q_nb, P_n, budget, tuple(warnings), attitude, gyros)


def _near_pole(window: Window) -> bool:
    return bool(abs(window.lat) > 0.5 * np.pi - POLE + 1e-12)


def _ask_gyros(window: Window) -> Gyros:
    try:
        q_nb = window.by_gyros(window.f_ib_b, window.omega_ib_b)
    except AlignmentError:
        return Gyros(None, UNIFORM)
    return Gyros(q_nb, UNIFORM if _near_pole(window) else min(window.azimuth, UNIFORM))


def _attitude(method: str, window: Window, known_heading: KnownHeading | None) -> Attitude:
    """Return how the method turns means into ``q_nb``."""
    if method == "triad":
        return window.by_gyros
    if method == "gyrocompass":
        plumb_n = triad(-window.g_n, window.omega_ie_n, (0.0, 0.0, -1.0), (1.0, 0.0, 0.0))

        def leveled_gyros(f: Array, omega: Array) -> Array:
            roll, pitch = level(f)
            leveled = quat_from_euler(roll, pitch, gyrocompass(omega, roll, pitch))
            return quat_from_dcm(plumb_n @ dcm_from_quat(leveled))

        return leveled_gyros
    if method == "wahba":
        return lambda f, omega: _weighted(window, f, omega).q_nb
    heading = 0.0 if method == "level" or known_heading is None else known_heading.heading
    return lambda f, omega: leveled_attitude(f, heading, g_n=window.g_n)


def _weighted(window: Window, f: Array, omega: Array) -> WahbaSolution:
    """Wahba's solution of two means, weighted by the sigmas of the window."""
    sigmas = (
        max(window.force_sigma, _LEAST * window.g),
        max(window.rate_sigma, _LEAST * window.ellipsoid.omega),
    )
    return wahba(*vectors_at_rest(f, omega, window.g_n, window.omega_ie_n, *sigmas))


def _too_weak(window: Window, azimuth: float) -> str:
    """Say how weak the gyros are, and which inputs would help."""
    level_rate = window.ellipsoid.omega * np.cos(window.lat)
    given = "give site.heading_deg and site.heading_sigma_deg, or an [azimuth] line"
    if _near_pole(window):
        return (
            "the gyros cannot find north within 1° of a pole, where the horizontal Earth rate is "
            f"{level_rate / DEG_PER_H:.2f} deg/h; {given}"
        )
    allowed = _WANTED * level_rate
    noise, bias = window.rate_noise.sigma, window.rate_bias.sigma
    if bias < allowed:
        needed = window.duration * noise**2 / (allowed**2 - bias**2)
        other = f"or stand still for {_time(needed)} to find it to {_WANTED / DEG:g}°"
    else:
        other = (
            "or measure in two positions half a turn apart, which removes the gyro bias: "
            f"{_WANTED / DEG:g}° of heading wants it below {allowed / DEG_PER_H:.2g} deg/h"
        )
    return (
        f"the gyros cannot find north: heading would have a sigma of {azimuth / DEG:.0f}° (gyro "
        f"error {window.rate_sigma / DEG_PER_H:.3g} deg/h against a horizontal Earth rate of "
        f"{level_rate / DEG_PER_H:.2f} deg/h); {given}, {other}"
    )


def _time(seconds: float) -> str:
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.0f} h"


def _contradicted(window: Window, gyros: Gyros, known: KnownHeading) -> list[str]:
    """The warning that gyros and the given heading exclude each other, if they do."""
    if gyros.q_nb is None:
        return []
    q_known = leveled_attitude(window.f_ib_b, known.heading, g_n=window.g_n)
    pitch = float(euler_from_quat(q_known)[1])
    by_tilt = window.tilt / max(abs(np.cos(pitch)), 1e-12)  # roll, and heading, at pitch 90°
    explained = float(np.linalg.norm([gyros.sigma, known.sigma, by_tilt]))
    off = float(small_rotation(gyros.q_nb, q_known)[2])
    if abs(off) <= SIGNIFICANT * explained:
        return []
    return [
        f"the gyros point {off / DEG:+.2f}° from the given heading, more than the "
        f"{explained / DEG:.2f}° sigma of the difference explains"
    ]


def _gyro_bias(window: Window, q_nb: Array, P_n: Array) -> tuple[Array, Array]:
    """Gyro bias that a given attitude leaves, and its sigma, body axes, rad/s."""
    C_bn = dcm_from_quat(q_nb).T
    by_attitude = C_bn @ skew(window.omega_ie_n)
    P_b = by_attitude @ P_n @ by_attitude.T + window.rate_noise.sigma**2 * np.eye(3)
    return window.omega_ib_b - C_bn @ window.omega_ie_n, np.sqrt(np.diag(P_b))


def scatter(window: Window, found: AtRest) -> Array:
    """Standard deviation of the sub-windows' attitudes about north, east, down, rad."""
    turns = _turns(window.sub_f, window.sub_omega, found)
    if len(turns) < 2:
        return np.full(3, np.nan)
    deviation: Array = np.std(turns, axis=0, ddof=1)
    return deviation


def _turns(means_f: Array, means_omega: Array, found: AtRest) -> Array:
    """Small rotation of the attitude of each pair of means relative to the one found."""
    pairs = zip(means_f, means_omega, strict=True)
    return np.array([small_rotation(found.attitude(f, omega), found.q_nb) for f, omega in pairs])


def _convergence(
    dt: Array, omega_ib_b: Array, f_ib_b: Array, window: Window, found: AtRest
) -> Convergence | None:
    """The attitude from growing parts of the window, beside what the error budget predicts."""
    end = np.cumsum(dt)
    first = int(np.searchsorted(end, 1.0))
    if first >= len(dt) - 1:
        return None
    rows = np.unique(np.geomspace(first + 1, len(dt), _CURVE).astype(int)) - 1
    t = end[rows]
    f, omega = (np.cumsum(dt[:, None] * x, axis=0)[rows] / t[:, None] for x in (f_ib_b, omega_ib_b))
    shorter = np.sqrt(window.duration / t)
    tilt = np.hypot(window.force_noise.sigma * shorter, window.force_bias.sigma) / window.g
    if found.method in BY_GYROS:
        rate = np.hypot(window.rate_noise.sigma * shorter, window.rate_bias.sigma)
        by_rate = rate / (window.ellipsoid.omega * np.cos(window.lat))
        azimuth = np.hypot(by_rate, np.tan(window.lat) * tilt)
    else:
        azimuth = abs(np.tan(float(euler_from_quat(found.q_nb)[1]))) * tilt
    return Convergence(t, _turns(f, omega, found), tilt, azimuth)
