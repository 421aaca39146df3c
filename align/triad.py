"""Attitude from two vectors, whatever the attitude; analytic coarse alignment by it."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from align.errors import AlignmentError
from earth.rotation import cross

Array = NDArray[np.float64]
Variant = Literal["gravity-first", "rate-first", "inverse"]

PARALLEL = 1e-9  # rad: nearer to parallel, rounding alone turns the attitude by 1e-7 rad


def triad(v1_n: ArrayLike, v2_n: ArrayLike, v1_b: ArrayLike, v2_b: ArrayLike) -> Array:
    """Attitude that keeps one direction exactly and the plane of two.

    Parameters
    ----------
    v1_n, v2_n : array_like, shape (3,)
        Two directions in n, any units.
    v1_b, v2_b : array_like, shape (3,)
        The same as measured in b, any units.

    Returns
    -------
    ndarray, shape (3, 3)
        ``C_nb``: it carries `v1_b` onto `v1_n` and `v2_b` into the half plane of `v1_n` and
        `v2_n`. An error of the angle between the two is left to the second.

    Raises
    ------
    AlignmentError
        If a vector is zero or the two of a pair are parallel within 1e-9 rad.

    Notes
    -----
    Black, AIAA Journal 2 (1964) 1350-1351.
    """
    return _axes(v1_n, v2_n) @ _axes(v1_b, v2_b).T


def _axes(first: ArrayLike, second: ArrayLike) -> Array:
    """Columns: along `first`, across both, and what completes them."""
    u, v = _unit(first), _unit(second)
    across = np.array(cross(u, v))
    sine = float(np.linalg.norm(across))
    if sine < PARALLEL:
        raise AlignmentError(
            "two directions are parallel, and the turn about them is undefined; take two that "
            "differ"
        )
    across /= sine
    return np.stack([u, across, np.array(cross(u, across))], axis=-1)


def _unit(vector: ArrayLike) -> Array:
    v = np.asarray(vector, float)
    norm = float(np.linalg.norm(v))
    if not 0.0 < norm < np.inf:
        raise AlignmentError(f"a vector of length {norm} has no direction; measure it anew")
    unit: Array = v / norm
    return unit


def analytic_coarse(
    f_ib_b: ArrayLike,
    omega_ib_b: ArrayLike,
    *,
    g_n: ArrayLike | None = None,
    omega_ie_n: ArrayLike | None = None,
    variant: Variant = "gravity-first",
) -> Array:
    """Attitude of a body at rest from mean specific force and mean angular rate.

    Parameters
    ----------
    f_ib_b, omega_ib_b : array_like, shape (3,)
        In body axes; any units, but m/s^2 and rad/s for ``inverse``.
    g_n, omega_ie_n : array_like, shape (3,), optional
        Gravity and Earth rate at the place, in NED (`earth.gravity.normal_gravity_n`,
        `earth.rates.omega_ie_n`), both or neither. Without them the plumb line is taken for the
        ellipsoid's normal, which it leaves by 0.8 nrad per metre of height at latitude 45°; only
        ``gravity-first`` does without.
    variant : {"gravity-first", "rate-first", "inverse"}
        What happens to the angle between the two, which sensor errors put off the colatitude:

        - ``gravity-first``: specific force points up exactly; the same attitude as leveling
          followed by gyrocompassing.
        - ``rate-first``: the angular rate points along the Earth's axis exactly.
        - ``inverse``: the matrix that carries f, omega and their cross product onto the
          references, lengths included, then the rotation nearest to it (polar decomposition).

    Returns
    -------
    ndarray, shape (3, 3)
        ``C_nb``. Small-rotation error, NED, of the estimate relative to the truth, first order
        (after Britting 1971): the same about north and down in every variant, ::

            e_N = -b_aE/g
            e_D = -b_gE/(omega cos lat) + tan lat b_aE/g

        but about east ::

            gravity-first   e_E = b_aN/g
            rate-first      e_E = (sin lat b_gN + cos lat b_gD)/omega
            inverse         e_E = (b_aN/g - tan lat b_aD/g + b_gD/(omega cos lat))/2

        A gyro of 0.01 deg/h tilts the last two by 0.2 to 0.7 mrad, an accelerometer of 50 µg the
        first by 0.05: it is the one to use, the others show what the textbooks mean
        (`tests/align/test_triad_variants.py`).

    Raises
    ------
    AlignmentError
        If the two vectors are parallel within 1e-9 rad or one is zero.
    ValueError
        On an unknown variant, or references that are missing.
    """
    if variant not in get_args(Variant):
        raise ValueError(f"variant must be one of {', '.join(get_args(Variant))}, got {variant!r}")
    f, omega = np.asarray(f_ib_b, float), np.asarray(omega_ib_b, float)
    lengths = float(np.linalg.norm(f)) * float(np.linalg.norm(omega))
    if not np.linalg.norm(cross(f, omega)) > PARALLEL * lengths:
        raise AlignmentError(
            "specific force and angular rate are parallel: at a pole, or without a rotation to "
            "sense, north is undefined; give a heading"
        )
    if g_n is None or omega_ie_n is None:
        if variant != "gravity-first" or g_n is not omega_ie_n:
            raise ValueError("give g_n and omega_ie_n both; only gravity-first does without")
        return triad((0.0, 0.0, -1.0), (1.0, 0.0, 0.0), f, omega)  # the rate is in the meridian
    up, axis = -np.asarray(g_n, float), np.asarray(omega_ie_n, float)
    if variant == "gravity-first":
        return triad(up, axis, f, omega)
    if variant == "rate-first":
        return triad(axis, up, omega, f)
    g, rate = np.linalg.norm(up), np.linalg.norm(axis)
    up, axis, f, omega = up / g, axis / rate, f / g, omega / rate
    rows_n = np.stack([up, axis, np.cross(up, axis)])
    rows_b = np.stack([f, omega, np.cross(f, omega)])
    left, _, right = np.linalg.svd(np.linalg.solve(rows_n, rows_b))
    nearest: Array = left @ right  # the determinant is positive, as those of both sides are
    return nearest
