"""The Kalman filter: one prediction, one update, and whether its innovations fit its covariance.

`predict` and `update` serve Python; loops call the kernels under them, which work in place. They
use no linear-algebra library: at these sizes its threads cost more than they bring, and the
result would depend on them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from align.result import Innovations
from earth._jit import kernel

Array = NDArray[np.float64]

_CONFIDENCE = 0.95


class Estimate(NamedTuple):
    """A state of mean `x` (n,) and covariance `P` (n, n)."""

    x: Array
    P: Array


class Update(NamedTuple):
    """A state after a measurement, and how well the measurement fitted.

    Attributes
    ----------
    x : ndarray, shape (n,)
    P : ndarray, shape (n, n)
    innovation : ndarray, shape (m,)
        ``z - H x`` of the state before.
    S : ndarray, shape (m, m)
        Covariance of the innovation, ``H P H^T + R``.
    nis : float
        Normalised innovation squared, ``innovation^T S^-1 innovation``: chi-square of m degrees
        of freedom when the model holds.
    """

    x: Array
    P: Array
    innovation: Array
    S: Array
    nis: float


class Room(NamedTuple):
    """Memory of the kernels, for n states and m measurements; `y` and `S` are results.

    Shapes: `keep`, `wide` (n, n); `gain`, `white` (m, n), transposed; `S`, `factor` (m, m);
    `moved` (n,); `y`, `whitened` (m,).
    """

    keep: Array
    wide: Array
    gain: Array
    white: Array
    S: Array
    factor: Array
    moved: Array
    y: Array
    whitened: Array


def room(n: int, m: int = 0) -> Room:
    """Make memory for n states and measurements of m elements."""
    shapes = (n, n), (n, n), (m, n), (m, n), (m, m), (m, m), (n,), (m,), (m,)
    return Room(*(np.zeros(shape) for shape in shapes))


@kernel
def _product(A, B, out):
    """Fill `out` with A B; a row of A costs what is not zero in it."""
    for i in range(A.shape[0]):
        for j in range(B.shape[1]):
            out[i, j] = 0.0
        for k in range(A.shape[1]):
            a = A[i, k]
            if a != 0.0:
                for j in range(B.shape[1]):
                    out[i, j] += a * B[k, j]


@kernel
def _congruence(A, P, wide):
    """Replace P by A P A^T, symmetric bit for bit; `wide` is memory."""
    _product(A, P, wide)
    n = A.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(n):
                total += wide[i, k] * A[j, k]
            P[i, j] = total
            P[j, i] = total


@kernel
def predict_in_place(x, P, F, Q, room):
    """Carry x and P over one step; see `predict`."""
    n = x.shape[0]
    for i in range(n):
        total = 0.0
        for k in range(n):
            total += F[i, k] * x[k]
        room.moved[i] = total
    for i in range(n):
        x[i] = room.moved[i]
    _congruence(F, P, room.wide)
    for i in range(n):
        for j in range(n):
            P[i, j] += 0.5 * (Q[i, j] + Q[j, i])


@kernel
def update_in_place(x, P, z, H, R, room):
    """Take z into x and P; see `update`.

    Returns the row at which S is found not positive definite, -1 when it is, and the normalised
    innovation squared; innovation and S are left in `room`.
    """
    n, m = x.shape[0], z.shape[0]
    white, gain, L = room.white, room.gain, room.factor
    _product(H, P, white)
    for i in range(m):
        total = z[i]
        for k in range(n):
            total -= H[i, k] * x[k]
        room.y[i] = total
        for j in range(i + 1):
            total = 0.5 * (R[i, j] + R[j, i])
            for k in range(n):
                total += white[i, k] * H[j, k]
            room.S[i, j] = total
            room.S[j, i] = total

    # S = L L^T; white becomes L^-1 H P and whitened L^-1 innovation
    nis = 0.0
    for i in range(m):
        for j in range(i + 1):
            total = room.S[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if j < i:
                L[i, j] = total / L[j, j]
            elif total > 0.0:
                L[i, i] = np.sqrt(total)
            else:
                return i, nis
        total = room.y[i]
        for j in range(i):
            total -= L[i, j] * room.whitened[j]
            for k in range(n):
                white[i, k] -= L[i, j] * white[j, k]
        room.whitened[i] = total / L[i, i]
        for k in range(n):
            white[i, k] /= L[i, i]
            x[k] += white[i, k] * room.whitened[i]
        nis += room.whitened[i] ** 2

    for i in range(m - 1, -1, -1):
        for k in range(n):
            total = white[i, k]
            for j in range(i + 1, m):
                total -= L[j, i] * gain[j, k]
            gain[i, k] = total / L[i, i]

    # Joseph: (I - K H) P (I - K H)^T + K R K^T
    for i in range(n):
        for k in range(n):
            total = 0.0
            for j in range(m):
                total -= gain[j, i] * H[j, k]
            room.keep[i, k] = total
        room.keep[i, i] += 1.0
    _congruence(room.keep, P, room.wide)
    _product(R, gain, white)
    for i in range(n):
        for k in range(i + 1):
            total = P[i, k]
            for j in range(m):
                total += 0.5 * (gain[j, i] * white[j, k] + white[j, i] * gain[j, k])
            P[i, k] = total
            P[k, i] = total
    return -1, nis


def _own(*arrays: ArrayLike) -> list[Array]:
    return [np.array(a, float, order="C") for a in arrays]


def predict(x: ArrayLike, P: ArrayLike, F: ArrayLike, Q: ArrayLike) -> Estimate:
    """Carry a state over one step of ``x' = F x + w``, ``w`` of covariance `Q`.

    Parameters
    ----------
    x : array_like, shape (n,)
    P, F, Q : array_like, shape (n, n)

    Returns
    -------
    Estimate
        Its covariance is symmetric bit for bit. What drives the step, add to `x`.
    """
    x, P, F, Q = _own(x, P, F, Q)
    predict_in_place(x, P, F, Q, room(len(x)))
    return Estimate(x, P)


def update(x: ArrayLike, P: ArrayLike, z: ArrayLike, H: ArrayLike, R: ArrayLike) -> Update:
    """Take in a measurement ``z = H x + v``, ``v`` of covariance `R`.

    Parameters
    ----------
    x : array_like, shape (n,)
    P : array_like, shape (n, n)
    z : array_like, shape (m,)
    H : array_like, shape (m, n)
    R : array_like, shape (m, m)
        Zero for what is known exactly.

    Returns
    -------
    Update
        The covariance, in Joseph's form, is symmetric bit for bit and positive semidefinite to
        the rounding of the one before. Accuracy: `tests/align/test_kalman.py`, against 50-digit
        arithmetic.

    Raises
    ------
    ValueError
        If the covariance of the innovation is not positive definite.

    Notes
    -----
    Bar-Shalom, Li & Kirubarajan (2001), 5.2; the factor L of ``S = L L^T`` replaces its inverse.
    """
    x, P, z, H, R = _own(x, P, z, H, R)
    memory = room(len(x), len(z))
    row, nis = update_in_place(x, P, z, H, R, memory)
    if row >= 0:
        raise ValueError(
            f"the covariance of the innovation is not positive definite at row {row}: what is "
            "measured there is already known exactly, or P or R is no covariance"
        )
    return Update(x, P, memory.y, memory.S, nis)


def consistency(t: ArrayLike, nis: ArrayLike, dof: int) -> Innovations:
    """Judge a filter by the mean of its normalised innovations squared.

    Parameters
    ----------
    t : array_like, shape (k,)
        s.
    nis : array_like, shape (k,)
        Of `update`, one for each of `t`.
    dof : int
        Length of each innovation.

    Returns
    -------
    Innovations
        `low` and `high` enclose the mean of k independent chi-square values with 95 %
        probability. A mean above says that the noise or a motion is larger than modelled, one
        below that it is smaller.

    Raises
    ------
    ValueError
        If there is no innovation.
    """
    t, nis = np.asarray(t, float), np.asarray(nis, float)
    if nis.ndim != 1 or t.shape != nis.shape or not nis.size:
        raise ValueError(f"t and nis must have one shape (k,), k >= 1; got {t.shape}, {nis.shape}")
    tail = 0.5 * (1.0 - _CONFIDENCE)
    low, high = scipy.special.chdtri(dof * nis.size, [1.0 - tail, tail]) / nis.size
    mean = float(nis.mean())
    return Innovations(
        t=t,
        nis=nis,
        dof=dof,
        low=float(low),
        high=float(high),
        consistent=bool(low <= mean <= high),
    )
