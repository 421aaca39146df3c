"""Heading from the Earth rate felt by leveled gyros."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def gyrocompass(omega_ib_b: ArrayLike, roll: float, pitch: float) -> float:
    """Heading of a body at rest.

    Parameters
    ----------
    omega_ib_b : array_like, shape (3,)
        Mean angular rate in body axes (forward-right-down), any unit.
    roll, pitch : float
        From leveling, rad.

    Returns
    -------
    float
        Heading, rad, in [-pi, pi]. Its error is the eastward gyro error over the horizontal
        Earth rate, ``omega cos(lat)`` (`align.accuracy`).

    Notes
    -----
    The rate is turned into the leveled frame, where the horizontal Earth rate points north.
    Groves (2013), 5.105.
    """
    wx, wy, wz = np.asarray(omega_ib_b, float)
    y = np.cos(roll) * wy - np.sin(roll) * wz
    z = np.sin(roll) * wy + np.cos(roll) * wz
    x = np.cos(pitch) * wx + np.sin(pitch) * z
    return float(np.arctan2(-y, x))


def gyrocompass_small_angle(omega_ib_b: ArrayLike, roll: float, pitch: float) -> float:
    """Heading of a nearly level, upright body at rest: roll and pitch to first order.

    Parameters
    ----------
    omega_ib_b : array_like, shape (3,)
        Mean angular rate in body axes (forward-right-down), any unit.
    roll, pitch : float
        From leveling, rad, small.

    Returns
    -------
    float
        Heading, rad, in [-pi, pi]. Beside the errors of `gyrocompass` it is off by ::

            (roll^2 - pitch^2)/4 sin(2 heading) - roll pitch sin(heading)^2

        to second order, at every latitude: up to 0.2 mrad at 1°, 20 mrad at 10°. The third order
        grows as tan(lat).

    Notes
    -----
    ``tan(heading) = -(wy - roll wz)/(wx + pitch wz)``, the formula of the lectures (Noureldin,
    Karamat & Georgy, Fundamentals of Inertial Navigation, 2013) in forward-right-down axes.
    """
    wx, wy, wz = np.asarray(omega_ib_b, float)
    return float(np.arctan2(roll * wz - wy, wx + pitch * wz))
