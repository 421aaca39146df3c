"""Roll and pitch from the specific force of a body at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from earth.rotation import quat_from_euler


def level(f_ib_b: ArrayLike) -> tuple[float, float]:
    """Roll and pitch that make the specific force point up.

    Parameters
    ----------
    f_ib_b : array_like, shape (3,)
        Mean specific force in body axes (forward-right-down), any unit; at rest it is
        ``C_bn (0, 0, -g)``.

    Returns
    -------
    roll, pitch : float
        rad. Pitch error = accelerometer error / g. Exact in every attitude; within
        (accelerometer error / g) of pitch ±90° roll is undetermined, as it must be.

    Notes
    -----
    Groves (2013), 5.101.
    """
    fx, fy, fz = np.asarray(f_ib_b, float)
    return float(np.arctan2(-fy, -fz)), float(np.arctan2(fx, np.hypot(fy, fz)))


def leveled_attitude(f_ib_b: ArrayLike, heading: float) -> NDArray[np.float64]:
    """Attitude ``q_nb`` from specific force and a heading (rad) known from elsewhere."""
    roll, pitch = level(f_ib_b)
    return quat_from_euler(roll, pitch, heading)
