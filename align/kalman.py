"""The Kalman filter: one prediction, one update, and whether its innovations fit its covariance."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import dpotrf, dtrtrs
from scipy.stats import chi2

from align.result import Innovations

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


def predict(x: Array, P: Array, F: Array, Q: Array) -> Estimate:
    """Carry a state over one step of ``x' = F x + w``, ``w`` of covariance `Q`.

    Parameters
    ----------
    x : ndarray, shape (n,)
    P, F, Q : ndarray, shape (n, n)

    Returns
    -------
    Estimate
        Its covariance is symmetric bit for bit. What drives the step, add to `x`.
    """
    P = F @ P @ F.T + Q
    return Estimate(F @ x, 0.5 * (P + P.T))


def update(x: Array, P: Array, z: Array, H: Array, R: Array) -> Update:
    """Take in a measurement ``z = H x + v``, ``v`` of covariance `R`.

    Parameters
    ----------
    x : ndarray, shape (n,)
    P : ndarray, shape (n, n)
    z : ndarray, shape (m,)
    H : ndarray, shape (m, n)
    R : ndarray, shape (m, m)
        Zero for what is known exactly.

    Returns
    -------
    Update
        The covariance, in Joseph's form, is symmetric bit for bit and stays positive
        semidefinite to rounding of the *old* covariance: a measurement 1e6 times sharper than
        the state loses no digit that matters (`tests/align/test_kalman.py`, against 50-digit
        arithmetic).

    Raises
    ------
    ValueError
        If the covariance of the innovation is not positive definite.

    Notes
    -----
    Bar-Shalom, Li & Kirubarajan (2001), 5.2.3; the factor L of ``S = L L^T`` replaces its inverse.
    """
    PHt = P @ H.T
    S = H @ PHt + R
    S = 0.5 * (S + S.T)
    L, failed = dpotrf(S, lower=1)
    if failed:
        raise ValueError(
            f"the covariance of the innovation is not positive definite at row {failed - 1}: "
            "measurement noise R is zero or P not a covariance"
        )
    innovation = z - H @ x
    white = dtrtrs(L, np.column_stack((PHt.T, innovation)), lower=1)[0]
    gain = dtrtrs(L, white[:, :-1], lower=1, trans=1)[0].T
    keep = np.eye(len(x)) - gain @ H
    P = keep @ P @ keep.T + gain @ R @ gain.T
    return Update(
        x=x + white[:, :-1].T @ white[:, -1],
        P=0.5 * (P + P.T),
        innovation=innovation,
        S=S,
        nis=float(white[:, -1] @ white[:, -1]),
    )


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
    low, high = chi2.ppf([tail, 1.0 - tail], dof * nis.size) / nis.size
    mean = float(nis.mean())
    return Innovations(
        t=t,
        nis=nis,
        dof=dof,
        low=float(low),
        high=float(high),
        consistent=bool(low <= mean <= high),
    )
