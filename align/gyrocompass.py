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
