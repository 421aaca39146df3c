"""Predicted 1-sigma of an alignment, in closed form, and what it is good for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.result import Contribution, Grade
from earth.ellipsoid import WGS84, Ellipsoid
from earth.units import DEG

Array = NDArray[np.float64]

NAVIGATION_TILT = 0.01 * DEG  # 0.17 mrad of g: what a free inertial of 1 nmi/h levels to
NAVIGATION_AZIMUTH = 0.1 * DEG  # what such a system finds of north at middle latitudes
MAX_HEADING_SIGMA = 15.0 * DEG  # beyond it gyros have not found north
UNIFORM = np.pi / np.sqrt(3.0)  # rad: sigma of a direction nobody knows


@dataclass(frozen=True)
class SensorErrors:
    """1-sigma errors of one axis; None where nothing is stated.

    Attributes
    ----------
    gyro_bias : float or None
        rad/s.
    accel_bias : float or None
        m/s^2.
    arw : float or None
        Angle random walk, rad/sqrt(s).
    vrw : float or None
        Velocity random walk, (m/s)/sqrt(s).
    """

    gyro_bias: float | None = None
    accel_bias: float | None = None
    arw: float | None = None
    vrw: float | None = None


def tilt_sigma(accel_sigma: float, g: float) -> float:
    """Sigma of each tilt, rad: accelerometer error over gravity."""
    return accel_sigma / g


def heading_sigma(
    rate_sigma: float, accel_sigma: float, lat: float, g: float, ellipsoid: Ellipsoid = WGS84
) -> float:
    """Sigma of the heading found by gyros, rad.

    The error is ``-b_gE/(omega cos lat) + tan lat b_aE/g``; only eastward errors enter.
    """
    by_rate = rate_sigma / (ellipsoid.omega * np.cos(lat))
    return float(np.hypot(by_rate, np.tan(lat) * accel_sigma / g))


def gyro_covariance(tilt: float, azimuth: float, lat: float) -> Array:
    """Covariance of the small rotation of a gyrocompass, NED, rad^2.

    Parameters
    ----------
    tilt, azimuth : float
        `tilt_sigma` and `heading_sigma`, rad.
    lat : float
        rad.

    Returns
    -------
    ndarray, shape (3, 3)
        An eastward accelerometer error turns the attitude about north by ``-b_aE/g`` and about
        down by ``tan lat b_aE/g``.
    """
    P_n = np.diag([tilt**2, tilt**2, azimuth**2])
    P_n[0, 2] = P_n[2, 0] = -np.tan(lat) * tilt**2
    return P_n


def known_heading_covariance(tilt: float, heading: float, roll_pitch_heading: Array) -> Array:
    """Covariance of the small rotation where the Euler angle heading is given, NED, rad^2.

    `tilt` is the sigma of each tilt, `heading` that of the heading, rad. Holding the angle, a tilt
    across the nose turns the attitude about down by ``tan pitch`` as much.
    """
    _, pitch, psi = roll_pitch_heading
    across = np.array([np.cos(psi), np.sin(psi)]) * _bounded_tan(pitch)
    P_n = np.zeros((3, 3))
    P_n[:2, :2] = tilt**2 * np.eye(2)
    P_n[2, :2] = P_n[:2, 2] = -across * tilt**2
    P_n[2, 2] = heading**2 + across @ across * tilt**2
    return P_n


def euler_sigmas(roll_pitch_heading: Array, P_n: Array) -> tuple[float, float, float]:
    """Sigmas of roll, pitch and heading, rad, from the covariance of the small rotation.

    Parameters
    ----------
    roll_pitch_heading : ndarray, shape (3,)
        rad.
    P_n : ndarray, shape (3, 3)
        NED, rad^2.

    Returns
    -------
    roll, pitch, heading : float
        Toward pitch ±90° roll and heading grow as 1/cos(pitch), to pi at most, and turn together;
        the attitude does not get worse.
    """
    _, pitch, psi = roll_pitch_heading
    along = np.array([np.cos(psi), np.sin(psi), 0.0])
    across = np.array([-np.sin(psi), np.cos(psi), 0.0])
    down = np.array([0.0, 0.0, 1.0])
    rows = (along / max(abs(np.cos(pitch)), 1e-12), across, down + _bounded_tan(pitch) * along)
    roll, pitch, heading = (float(np.sqrt(max(row @ P_n @ row, 0.0))) for row in rows)
    return min(roll, np.pi), pitch, min(heading, np.pi)


def _bounded_tan(pitch: float) -> float:
    return float(np.sin(pitch) / max(abs(np.cos(pitch)), 1e-12))


def gyro_budget(
    gyro_bias: float,
    gyro_noise: float,
    accel_bias: float,
    accel_noise: float,
    lat: float,
    g: float,
    ellipsoid: Ellipsoid = WGS84,
) -> tuple[Contribution, ...]:
    """What each sensor error, the 1-sigma of a mean over the window, adds to a gyrocompass."""

    def line(source: str, rate: float, accel: float) -> Contribution:
        azimuth = heading_sigma(rate, accel, lat, g, ellipsoid)
        return Contribution(source, tilt_sigma(accel, g), azimuth)

    return (
        line("gyro bias", gyro_bias, 0.0),
        line("gyro noise", gyro_noise, 0.0),
        line("accelerometer bias", 0.0, accel_bias),
        line("accelerometer noise", 0.0, accel_noise),
    )


def known_heading_budget(
    source: str, heading: float, accel_bias: float, accel_noise: float, pitch: float, g: float
) -> tuple[Contribution, ...]:
    """What the sigma of a heading from `source`, rad, and accelerometer errors, m/s^2, add."""
    by_tilt = abs(_bounded_tan(pitch))

    def line(source: str, accel: float) -> Contribution:
        tilt = tilt_sigma(accel, g)
        return Contribution(source, tilt, by_tilt * tilt)

    return (
        Contribution(source, 0.0, heading),
        line("accelerometer bias", accel_bias),
        line("accelerometer noise", accel_noise),
    )


def wahba_budget(
    gyro_bias: float,
    gyro_noise: float,
    accel_bias: float,
    accel_noise: float,
    lat: float,
    g: float,
    ellipsoid: Ellipsoid = WGS84,
) -> tuple[Contribution, ...]:
    """What each sensor error adds to the weighted attitude of `align.wahba.vectors_at_rest`.

    Azimuth and the turn about north are those of a gyrocompass; the turn about east is the mean of
    what gravity and what the Earth rate say, weighted by their sigmas.
    """
    by_force = np.hypot(accel_bias, accel_noise) / g
    by_rate = np.hypot(gyro_bias, gyro_noise) / ellipsoid.omega
    share = by_rate**2 / (by_rate**2 + by_force**2)  # of gravity in the turn about east
    lines = gyro_budget(gyro_bias, gyro_noise, accel_bias, accel_noise, lat, g, ellipsoid)
    rates = (gyro_bias, gyro_noise, 0.0, 0.0)
    return tuple(
        Contribution(
            line.source,
            float(
                np.sqrt(
                    0.5 * (1.0 + share**2) * line.tilt**2
                    + 0.5 * ((1.0 - share) * rate / ellipsoid.omega) ** 2
                )
            ),
            line.azimuth,
        )
        for line, rate in zip(lines, rates, strict=True)
    )


def left_over(P_n: Array, lines: tuple[Contribution, ...]) -> tuple[Contribution, ...]:
    """Budget of a filter: what its covariance holds of each bias of `lines`, the rest as noise."""
    tilt, azimuth = 0.5 * (P_n[0, 0] + P_n[1, 1]), P_n[2, 2]
    found = []
    for line in lines:
        if line.source.endswith("noise"):
            continue
        by_tilt, by_azimuth = min(line.tilt**2, tilt), min(line.azimuth**2, azimuth)
        found.append(Contribution(line.source, float(np.sqrt(by_tilt)), float(np.sqrt(by_azimuth))))
        tilt, azimuth = tilt - by_tilt, azimuth - by_azimuth
    return (*found, Contribution("noise", float(np.sqrt(tilt)), float(np.sqrt(azimuth))))


def judge(tilt: float, azimuth: float) -> tuple[Grade, str]:
    """Say what an attitude of these sigmas, rad, is good for."""
    level = f"level to {tilt / DEG:.2g}°"
    north = f"north to {azimuth / DEG:.2g}°"
    if tilt <= NAVIGATION_TILT and azimuth <= NAVIGATION_AZIMUTH:
        return "navigation", f"good for navigation-grade free inertial: {level}, {north} (1σ)"
    if azimuth <= MAX_HEADING_SIGMA:
        wanted = f"{NAVIGATION_TILT / DEG:g}° and {NAVIGATION_AZIMUTH / DEG:g}°"
        return "coarse", (
            f"good for levelling and a coarse heading: {level}, {north} (1σ); navigation-grade "
            f"free inertial wants {wanted}"
        )
    return "levelling", f"good for levelling only: {level} (1σ), north not found"
