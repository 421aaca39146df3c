"""Predicted 1-sigma of a static alignment, in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from earth.ellipsoid import WGS84, Ellipsoid


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


def euler_sigmas(
    roll_pitch_heading: NDArray[np.float64], tilt: float, azimuth: float
) -> tuple[float, float, float]:
    """Sigmas of roll, pitch and heading, rad, from those of the small rotation in NED.

    `tilt` is that of the rotations about north and east, `azimuth` about down, taken as
    independent. Toward pitch ±90° roll and heading grow as 1/cos(pitch) and turn together; the
    attitude does not get worse.
    """
    _, pitch, _ = roll_pitch_heading
    per_cos = 1.0 / max(abs(np.cos(pitch)), 1e-12)
    return (
        float(min(tilt * per_cos, np.pi)),
        tilt,
        float(min(np.hypot(azimuth, tilt * abs(np.sin(pitch)) * per_cos), np.pi)),
    )
