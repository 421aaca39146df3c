"""Analytic coarse alignment: attitude from two vectors, whatever the attitude."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from align.errors import AlignmentError


def analytic_coarse(f_ib_b: ArrayLike, omega_ib_b: ArrayLike) -> NDArray[np.float64]:
    """Attitude of a body at rest from mean specific force and mean angular rate.

    Down is opposite to the specific force, exactly; east is down cross angular rate. It is the
    same attitude as leveling followed by gyrocompassing, without their Euler angles.

    Parameters
    ----------
    f_ib_b, omega_ib_b : array_like, shape (3,)
        In body axes, any units.

    Returns
    -------
    ndarray, shape (3, 3)
        ``C_nb``. Small-rotation error, NED, of the estimate relative to the truth (Britting
        1971): ``(-b_aE/g, b_aN/g, -b_gE/(omega cos lat) + tan lat b_aE/g)``.

    Raises
    ------
    AlignmentError
        If the two vectors are parallel or one is zero.
    """
    f = np.asarray(f_ib_b, float)
    down = -f / np.linalg.norm(f) if np.any(f) else f
    east = np.cross(down, np.asarray(omega_ib_b, float))
    norm = float(np.linalg.norm(east))
    if norm == 0.0:
        raise AlignmentError(
            "specific force and angular rate are parallel: at a pole, or without a rotation to "
            "sense, north is undefined; give a heading"
        )
    east /= norm
    return np.stack([np.cross(east, down), east, down])
