"""Roll and pitch from the specific force of a body at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from align.errors import AlignmentError
from align.triad import triad
from earth.rotation import quat_from_dcm


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


def level_two_axes(fx: float, fy: float, g: float) -> tuple[float, float]:
    """Roll and pitch from the forward and the right accelerometer where gravity is known.

    Parameters
    ----------
    fx, fy : float
        Mean specific force forward and to the right, m/s^2.
    g : float
        Gravity of the place, m/s^2.

    Returns
    -------
    roll, pitch : float
        rad, in ±pi/2: a body upside down looks upright. Errors, first order, of accelerometer
        errors ``bx, by`` and an error ``dg`` of gravity ::

            p = (bx - sin(pitch) dg) / (g cos(pitch))
            r = -(by/cos(pitch) + sin(roll) dg) / (g cos(roll)) + tan(roll) tan(pitch) p

        They grow without bound toward 90° and are `level`'s near the
        level, where `dg` drops out.

    Raises
    ------
    AlignmentError
        If the two feel more than gravity.

    Notes
    -----
    ``pitch = asin(fx/g), roll = -asin(fy/(g cos(pitch)))``: Noureldin, Karamat & Georgy,
    Fundamentals of Inertial Navigation (2013), in forward-right-down axes. It is `level` with
    the third specific force taken from g.
    """
    rest = (g - fx) * (g + fx) - fy * fy
    if not rest >= 0.0:
        raise AlignmentError(
            f"the level accelerometers feel {np.hypot(fx, fy):.4f} m/s², more than gravity's "
            f"{g:.4f}: near 90° two axes cannot level the body; level with all three"
        )
    return level((fx, fy, -np.sqrt(rest)))


def level_small_angle(fx: float, fy: float, g: float) -> tuple[float, float]:
    """Roll and pitch of a nearly level, upright body, rad: ``-fy/g`` and ``fx/g``.

    The formulas of the lectures, linear in what is measured. To third order they are short by
    ``roll (roll^2/6 + pitch^2/2)`` and ``pitch^3/6``: 0.05 mrad at 4°, 1 mrad at 10°. Units and
    signs as for `level_two_axes`.
    """
    return -fy / g, fx / g


def leveled_attitude(
    f_ib_b: ArrayLike, heading: float, *, g_n: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Attitude from specific force and a heading known from elsewhere.

    Parameters
    ----------
    f_ib_b : array_like, shape (3,)
        Mean specific force in body axes, any unit.
    heading : float
        The body's own, an Euler angle, rad.
    g_n : array_like, shape (3,), optional
        Gravity at the place in NED, any unit; without it the plumb line is taken for the
        ellipsoid's normal.

    Returns
    -------
    ndarray, shape (4,)
        ``q_nb`` that carries the specific force onto ``-g_n`` and has the heading, both to
        rounding. Where the nose is nearer to the plumb line than that to the normal, no attitude
        may have both; the force keeps its direction, and the heading comes as near as it can.

    Raises
    ------
    AlignmentError
        If the specific force or gravity is zero.

    Notes
    -----
    A heading says that the nose has no part along the level direction to its right, `right_n`.
    So that direction, in the body, lies in the y-z plane, and its angle to the specific force is
    the one to the plumb line: the roll of `level`, but for the plumb line's tilt to that side.
    """
    _, fy, fz = f = np.asarray(f_ib_b, float)
    up_n = np.array([0.0, 0.0, -1.0]) if g_n is None else -np.asarray(g_n, float)
    right_n = np.array([-np.sin(heading), np.cos(heading), 0.0])
    along = right_n @ up_n / np.linalg.norm(up_n) * np.linalg.norm(f)
    roll, _ = level(f)
    roll += np.arctan2(along, np.sqrt(max(fy * fy + fz * fz - along * along, 0.0)))
    right_b = (0.0, np.cos(roll), -np.sin(roll))
    return quat_from_dcm(triad(up_n, right_n, f, right_b))
