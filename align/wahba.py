"""Attitude from any number of weighted directions: Wahba's problem (1965)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from align.errors import AlignmentError
from earth.rotation import dcm_from_quat, quat_from_dcm, quat_from_rotvec

Array = NDArray[np.float64]
Method = Literal["davenport", "quest", "svd"]

MIN_GAP = 1e-12  # two equal directions 3e-6 rad apart; below it rounding turns the attitude
MIN_QUEST_GAP = 1e-7  # an eigenvalue near a double root keeps half its digits


@dataclass(frozen=True, eq=False)
class WahbaSolution:
    """Attitude that fits weighted directions best.

    Attributes
    ----------
    q_nb : ndarray, shape (4,)
    P_n : ndarray, shape (3, 3)
        Covariance of the small rotation of ``C_hat C^T`` about north, east, down, rad^2.
    loss : float
        ``sum |v_n - C_nb v_b|^2 / (2 sigma^2)`` over unit vectors; its double is chi-square with
        ``2 k - 3`` degrees of freedom where the sigmas hold.
    gap : float
        Largest less second eigenvalue of Davenport's matrix, of weights that sum to one, in
        (0, 4/3]; an attitude that nothing fixes about some axis has none.
    """

    q_nb: Array
    P_n: Array
    loss: float
    gap: float


def wahba(
    v_n: ArrayLike, v_b: ArrayLike, sigma: ArrayLike, method: Method = "davenport"
) -> WahbaSolution:
    """Attitude of least ``sum |v_n - C_nb v_b|^2 / sigma^2``.

    Parameters
    ----------
    v_n, v_b : array_like, shape (k, 3)
        The same k >= 2 directions in n and as measured in b; any lengths.
    sigma : array_like, shape (k,)
        1-sigma of each measured direction about either axis across it, rad.
    method : {"davenport", "quest", "svd"}
        Eigenvector of Davenport's matrix; Newton's method on its characteristic polynomial
        (Shuster & Oh 1981), from the reference turned so that no half turn comes near; singular
        values of the profile matrix (Markley 1988, SciPy's). They agree within 1e-12 rad
        (`tests/align/test_wahba.py`): each is polished by Newton's method on the loss itself,
        because the matrix of unequal weights has lost the digits of the light ones.

    Returns
    -------
    WahbaSolution

    Raises
    ------
    AlignmentError
        If fewer than two directions are given, one is zero, or all are parallel, that is the gap
        is below 1e-12, for ``quest`` 1e-7.
    ValueError
        On shapes that do not fit, sigmas that are not positive, or an unknown method.

    Notes
    -----
    Covariance: Shuster & Oh, J. Guidance and Control 4 (1981) 70-77, in n: the inverse of
    ``sum (I - v_n v_n^T) / sigma^2``.
    """
    if method not in _METHODS:
        raise ValueError(f"method must be one of {', '.join(_METHODS)}, got {method!r}")
    n, b = _units("v_n", v_n), _units("v_b", v_b)
    sigmas = np.asarray(sigma, float)
    if n.shape != b.shape or sigmas.shape != n.shape[:1]:
        raise ValueError(
            f"v_n, v_b and sigma must have shapes (k, 3), (k, 3) and (k,), got {n.shape}, "
            f"{b.shape} and {sigmas.shape}"
        )
    if not np.all((sigmas > 0.0) & (sigmas < np.inf)):
        raise ValueError(f"sigma must be positive, rad, got {sigmas}")
    if len(n) < 2:
        raise AlignmentError(f"{len(n)} direction fixes no attitude; give two that differ")
    weight = np.min(sigmas) ** 2 / sigmas**2
    weight /= weight.sum()
    values = np.linalg.eigvalsh(davenport_matrix(_profile(n, b, weight)))
    gap = float(values[3] - values[2])
    if gap < (MIN_QUEST_GAP if method == "quest" else MIN_GAP):
        raise AlignmentError(
            f"the directions are parallel, or all but one weigh too little (gap {gap:.1e}): the "
            "turn about them is undefined; give another that differs"
            + (", or take method davenport" if gap >= MIN_GAP else "")
        )
    q = _polished(_METHODS[method](n, b, weight), n, b, weight)
    information = np.einsum("k,kij->ij", sigmas**-2, np.eye(3) - n[:, :, None] * n[:, None, :])
    off = n - b @ dcm_from_quat(q).T
    return WahbaSolution(
        q_nb=q,
        P_n=np.linalg.inv(information),
        loss=float(0.5 * np.sum(np.sum(off * off, axis=1) / sigmas**2)),
        gap=gap,
    )


def vectors_at_rest(
    f_ib_b: ArrayLike,
    omega_ib_b: ArrayLike,
    g_n: ArrayLike,
    omega_ie_n: ArrayLike,
    accel_sigma: float,
    gyro_sigma: float,
) -> tuple[Array, Array, Array]:
    """Wahba's problem of an IMU at rest: gravity and the Earth rate.

    Parameters
    ----------
    f_ib_b, omega_ib_b : array_like, shape (3,)
        Means in body axes, m/s^2 and rad/s.
    g_n, omega_ie_n : array_like, shape (3,)
        Gravity and Earth rate at the place, NED, m/s^2 and rad/s.
    accel_sigma, gyro_sigma : float
        1-sigma of each axis of the means, bias and noise, m/s^2 and rad/s.

    Returns
    -------
    v_n, v_b : ndarray, shape (2, 3)
    sigma : ndarray, shape (2,)
        rad, as `wahba` takes them.

    Notes
    -----
    The cross product of the two, third vector of analytic coarse alignment, is left out: its
    error is made of theirs, so counted as a measurement of its own it would let the covariance
    promise what nothing measured. With these two the sigma of the turn about down is that of
    `align.accuracy.heading_sigma`.

    The turns about north and down are those of TRIAD whatever the weights. The one about east,
    which both vectors measure, is the mean of the gravity-first and the rate-first variant of
    `align.triad.analytic_coarse`, weighted by the inverse squares of their sigmas: a gyro error
    along north or down tilts the body, though by no more than the sigmas allow.
    """
    g, omega = np.asarray(g_n, float), np.asarray(omega_ie_n, float)
    v_n = np.stack([-g, omega])
    v_b = np.stack([np.asarray(f_ib_b, float), np.asarray(omega_ib_b, float)])
    return v_n, v_b, np.array([accel_sigma, gyro_sigma]) / np.linalg.norm(v_n, axis=1)


def _units(name: str, vectors: ArrayLike) -> Array:
    rows = np.asarray(vectors, float)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(f"{name} must have shape (k, 3), got {rows.shape}")
    lengths = np.linalg.norm(rows, axis=1)
    bad = np.flatnonzero(~((lengths > 0.0) & (lengths < np.inf)))
    if bad.size:
        raise AlignmentError(
            f"{name}[{bad[0]}] has length {lengths[bad[0]]} and no direction; leave it out"
        )
    units: Array = rows / lengths[:, None]
    return units


def _profile(n: Array, b: Array, weight: Array) -> Array:
    """Attitude profile matrix; the loss is ``1 - trace(B C_bn)``."""
    B: Array = np.einsum("k,ki,kj->ij", weight, n, b)
    return B


def _parts(B: Array) -> tuple[Array, Array, Array]:
    """Trace, symmetric part doubled, and vector of the skew part of profile matrices."""
    z = np.stack(
        [B[..., 2, 1] - B[..., 1, 2], B[..., 0, 2] - B[..., 2, 0], B[..., 1, 0] - B[..., 0, 1]], -1
    )
    return np.trace(B, axis1=-2, axis2=-1), B + np.swapaxes(B, -1, -2), z


def davenport_matrix(B: Array) -> Array:
    """Davenport's matrix of attitude profile matrices ``B = sum w v_n v_b^T``.

    Parameters
    ----------
    B : ndarray, shape (..., 3, 3)

    Returns
    -------
    ndarray, shape (..., 4, 4)
        K with ``trace(B C_bn) = q_nb^T K q_nb``, scalar first.
    """
    trace, S, z = _parts(B)
    K = np.empty((*B.shape[:-2], 4, 4))
    K[..., 0, 0] = trace
    K[..., 0, 1:] = K[..., 1:, 0] = z
    K[..., 1:, 1:] = S - trace[..., None, None] * np.eye(3)
    return K


def _davenport(n: Array, b: Array, weight: Array) -> Array:
    q: Array = np.linalg.eigh(davenport_matrix(_profile(n, b, weight)))[1][:, 3]
    return q


def _svd(n: Array, b: Array, weight: Array) -> Array:
    q: Array = scipy.spatial.transform.Rotation.align_vectors(n, b, weights=weight)[0].as_quat(
        scalar_first=True
    )
    return q


def _quest(n: Array, b: Array, weight: Array) -> Array:
    # Sequential rotation: near a half turn the scalar part, by which QUEST divides, vanishes.
    # Turn the reference half round about the axis that leaves the most of it.
    B = _profile(n, b, weight)
    diagonal = np.diag(B)
    left = np.array([np.trace(B), *(2.0 * diagonal - np.trace(B))])
    axis = int(np.argmax(left))
    turn = -np.ones(3) if axis else np.ones(3)
    if axis:
        turn[axis - 1] = 1.0
    trace, S, z = _parts(turn[:, None] * B)
    adjoint_trace = 0.5 * (np.trace(S) ** 2 - np.sum(S * S))
    det = float(np.linalg.det(S))
    a0 = trace * trace - adjoint_trace
    b0 = trace * trace + z @ z
    c0 = det + z @ S @ z
    d0 = z @ S @ S @ z
    root = 1.0  # never below the largest: Newton's method comes down to it
    for _ in range(50):
        value = (root * root - a0) * (root * root - b0) - c0 * root + c0 * trace - d0
        slope = 2.0 * root * (2.0 * root * root - a0 - b0) - c0
        step = value / slope if slope > 0.0 else 0.0
        root -= step
        if abs(step) < 1e-16:
            break
    alpha = root * root - trace * trace + adjoint_trace
    beta = root - trace
    x = alpha * z + beta * (S @ z) + S @ (S @ z)
    gamma = (root + trace) * alpha - det
    w, (i, j, k) = gamma, x
    # q = (half turn about the axis)^-1 * (w, i, j, k)
    back = [(w, i, j, k), (i, -w, k, -j), (j, -k, -w, i), (k, j, -i, -w)][axis]
    q = np.array(back)
    unit: Array = q / np.linalg.norm(q)
    return unit


_METHODS: dict[str, Callable[[Array, Array, Array], Array]] = {
    "davenport": _davenport,
    "quest": _quest,
    "svd": _svd,
}


def _polished(q: Array, n: Array, b: Array, weight: Array) -> Array:
    """Newton's method on the loss, whose gradient is small where the fit is good."""
    C = dcm_from_quat(q)
    for _ in range(6):
        seen = b @ C.T
        gradient = weight @ np.cross(seen - n, n)
        cosine = np.einsum("k,ki,ki->", weight, seen, n)
        mixed = np.einsum("k,ki,kj->ij", weight, seen, n)
        step = np.linalg.solve(cosine * np.eye(3) - 0.5 * (mixed + mixed.T), gradient)
        C = dcm_from_quat(quat_from_rotvec(step)) @ C
        if np.linalg.norm(step) < 1e-14:
            break
    return quat_from_dcm(C)
