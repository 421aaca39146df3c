"""Attitude and sensor biases together, from two or more still orientations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.accuracy import SensorErrors
from align.errors import AlignmentError
from align.triad import analytic_coarse
from earth.ellipsoid import WGS84, Ellipsoid
from earth.gravity import normal_gravity_n
from earth.rates import omega_ie_n
from earth.rotation import (
    dcm_from_quat,
    quat_from_dcm,
    quat_from_rotvec,
    rotvec_from_quat,
    skew,
)
from earth.units import DEG_PER_H, MG, MGAL

Array = NDArray[np.float64]

WIDE_GYRO_BIAS = 10.0 * DEG_PER_H  # rad/s, where none is stated
WIDE_ACCEL_BIAS = 10.0 * MG  # m/s^2, likewise
GRAVITY_SIGMA = 50.0 * MGAL  # m/s^2: how far free-air gravity departs from normal gravity
_UNTOLD = 0.5  # of a bias's prior variance left: the data tell less than was stated
_OWN_AXIS = 0.9  # share of an axis in what is untold that makes it that axis
_SHARE = 0.5  # of a variance that comes from one bias
_NUISANCES = 7  # three gyro biases, three accelerometer biases, the gravity disturbance
_STEPS = 200
_HIDES = 0.1  # of the Earth rate: a larger bias may leave more than one least sum of squares
_BENT = 0.7  # sigmas
_FRACTIONS = 0.5 ** np.arange(12)  # of a step that may overshoot
_SETTLED = 1e-5  # sigmas: far below what the solution is worth


@dataclass(frozen=True, eq=False)
class Position:
    """Means over one still orientation.

    Attributes
    ----------
    omega_ib_b, f_ib_b : ndarray, shape (3,)
        rad/s and m/s^2, in body axes.
    duration : float
        s.
    arw, vrw : float or ndarray, shape (3,)
        White noise the data show, rad/sqrt(s) and (m/s)/sqrt(s); the larger of it and the stated
        one counts.
    turn : ndarray, shape (4,), or None
        Quaternion that carries vectors from this position's body axes to those of the position
        before, where a turntable or the gyros through the turn tell it; the first has none.
    turn_sigma : float
        1-sigma of `turn` about each axis, rad.
    """

    omega_ib_b: Array
    f_ib_b: Array
    duration: float
    arw: float | Array = 0.0
    vrw: float | Array = 0.0
    turn: Array | None = None
    turn_sigma: float = float("nan")


@dataclass(frozen=True, eq=False)
class MultiPositionSolution:
    """Attitudes of all positions and the biases they have in common.

    Attributes
    ----------
    q_nb : ndarray, shape (k, 4)
    P_n : ndarray, shape (k, 3, 3)
        Covariance of the small rotation of ``C_hat C^T`` of each about north, east, down, rad^2.
    gyro_bias, gyro_bias_sigma : ndarray, shape (3,)
        In body axes, rad/s.
    accel_bias, accel_bias_sigma : ndarray, shape (3,)
        In body axes, m/s^2.
    unobservable : tuple of str
        Biases of which the data tell less than was stated, and what they turn; and, where the
        sigmas do not hold because the gyro bias may hide the Earth rate, that.
    chi2 : float
        Weighted sum of squared residuals, those of the stated biases included.
    dof : int
        Expectation of `chi2` where the stated sigmas hold.
    """

    q_nb: Array
    P_n: Array
    gyro_bias: Array
    gyro_bias_sigma: Array
    accel_bias: Array
    accel_bias_sigma: Array
    unobservable: tuple[str, ...]
    chi2: float
    dof: int


def align_positions(
    positions: Sequence[Position],
    lat: float,
    h: float,
    *,
    errors: SensorErrors,
    gravity_sigma: float = GRAVITY_SIGMA,
    ellipsoid: Ellipsoid = WGS84,
) -> MultiPositionSolution:
    """Align an IMU that stood still in several orientations, and find its biases.

    Parameters
    ----------
    positions : sequence of Position
        Two or more, in order of time; headings and the turns between need not be known.
    lat, h : float
        Geodetic latitude, rad, and height, m.
    errors : SensorErrors
        Biases are weighed as zero with their stated sigma, or with 10 deg/h and 10 mg where none
        is stated; noise with the stated random walks.
    gravity_sigma : float
        1-sigma of normal gravity's magnitude at the place, m/s^2. One unknown gravity disturbance
        is estimated and taken off: the rest of ``|f|`` is the accelerometers'.
    ellipsoid : Ellipsoid

    Returns
    -------
    MultiPositionSolution
        The most probable attitudes and biases. Perfect data give the attitude within 1e-9 rad
        (`tests/align/test_multi_position.py`).

    Raises
    ------
    AlignmentError
        If there are fewer than two positions, specific force and rate are parallel in one, or
        nobody tells the noise.
    ValueError
        On a turn before the first position or without a sigma.

    Notes
    -----
    Weighted least squares by Gauss-Newton on the exact model, ::

        omega = C_bn omega_ie_n + gyro bias
        f = -C_bn g_n (1 + disturbance/g) + accelerometer bias

    from the analytic coarse attitude of each position. What it rests on:

    - A bias along the plumb line shows in one position: by the rate about down, and by ``|f|``,
      as far as gravity is known there.
    - A level bias, seen by one position as a tilt or a turn of the heading, shows when the body
      is turned relative to it. A level accelerometer bias shows only through a known turn, or,
      weakly, through the gyros that see the tilt.
    - Half a turn about the vertical is special. Where the turn is known, level biases cancel from
      the mean of the two attitudes. Where it is not, the northward gyro bias shows, and the
      eastward one to first order does not: it turns the two headings in opposite senses.
    - Gyros whose bias may be as large as the Earth rate leave several attitudes that fit. Several
      starts look for the best of them, but take four orientations or more: in two or three the
      best may be the wrong one, and its sigmas too small.
    """
    problem = _Problem(
        positions,
        normal_gravity_n(lat, h, ellipsoid),
        omega_ie_n(lat, ellipsoid),
        errors,
        gravity_sigma,
    )
    ends = [_least(problem, problem.start(x), x) for x in problem.starts()]
    found = [end for end in ends if end is not None]
    if not found:
        raise AlignmentError(
            f"attitudes and biases of the positions have not settled after {_STEPS} steps; state "
            "the gyro bias, or give the turns between the positions"
        )
    return problem.solution(*min(found, key=lambda end: float(end[2] @ end[2])))


def _least(problem: _Problem, C: Array, x: Array) -> tuple[Array, Array, Array] | None:
    """Go down to the least sum of squares near a start; None where the way is too long."""
    residual = problem.residual(C, x)
    for _ in range(_STEPS):
        orthogonal, triangular = np.linalg.qr(problem.jacobian(C))
        step = -np.linalg.solve(triangular, orthogonal.T @ residual)
        if float(np.linalg.norm(triangular @ step)) < _SETTLED:
            C, x = _moved(C, x, step)
            return C, x, problem.residual(C, x)
        for fraction in _FRACTIONS:
            C_next, x_next = _moved(C, x, fraction * step)
            next_residual = problem.residual(C_next, x_next)
            if next_residual @ next_residual < residual @ residual:
                C, x, residual = C_next, x_next, next_residual
                break
        else:
            return C, x, residual  # the residuals are down to rounding
    return None


def _moved(C: Array, x: Array, step: Array) -> tuple[Array, Array]:
    turns = dcm_from_quat(quat_from_rotvec(step[:-_NUISANCES].reshape(-1, 3)))
    return turns @ C, x + step[-_NUISANCES:]


class _Problem:
    """Whitened least squares; unknowns are small rotations NED and nuisances over their sigmas."""

    def __init__(
        self,
        positions: Sequence[Position],
        g_n: Array,
        omega_n: Array,
        errors: SensorErrors,
        gravity_sigma: float,
    ) -> None:
        if len(positions) < 2:
            raise AlignmentError(
                f"{len(positions)} position tells no bias from a tilt; stand still in two or more "
                "orientations"
            )
        self.g_n, self.omega_n = g_n, omega_n
        self.omega = np.stack([np.asarray(p.omega_ib_b, float) for p in positions])
        self.f = np.stack([np.asarray(p.f_ib_b, float) for p in positions])
        duration = np.array([p.duration for p in positions])
        if not np.all(duration > 0.0):
            raise ValueError(f"durations must be positive, s, got {duration}")

        def noise(name: str, stated: float | None, shown: list[float | Array]) -> Array:
            rows = np.stack([np.broadcast_to(walk, 3) for walk in shown])
            density = np.maximum(rows, 0.0 if stated is None else stated)
            if not np.all(density > 0.0):
                raise AlignmentError(
                    f"nobody tells the noise of the {name}; state their random walk, or give the "
                    "one the data show"
                )
            sigma: Array = density / np.sqrt(duration)[:, None]
            return sigma

        self.omega_sigma = noise("gyros", errors.arw, [p.arw for p in positions])
        self.f_sigma = noise("accelerometers", errors.vrw, [p.vrw for p in positions])
        gyro = WIDE_GYRO_BIAS if errors.gyro_bias is None else errors.gyro_bias
        accel = WIDE_ACCEL_BIAS if errors.accel_bias is None else errors.accel_bias
        self.sigma = np.array([gyro] * 3 + [accel] * 3 + [gravity_sigma])
        self.hides = gyro > _HIDES * np.linalg.norm(omega_n)
        self.up_n = -g_n / np.linalg.norm(g_n)
        self.turns = {}
        for k, position in enumerate(positions):
            if position.turn is None:
                continue
            if k == 0 or not position.turn_sigma > 0.0:
                raise ValueError(
                    f"positions[{k}].turn is from the position before and needs a positive "
                    f"turn_sigma, rad, got {position.turn_sigma}"
                )
            self.turns[k] = dcm_from_quat(position.turn), position.turn_sigma

    def starts(self) -> list[Array]:
        """Biases to start from: none, and where gyros may hide the Earth rate, one each way."""
        starts = [np.zeros(_NUISANCES)]
        if self.hides:
            starts += [way * axis for axis in np.eye(_NUISANCES)[:3] for way in (1.0, -1.0)]
        return starts

    def start(self, x: Array) -> Array:
        """Analytic coarse attitudes; a known turn leads on from the position before."""
        found: list[Array] = []
        omega = self.omega - self.sigma[:3] * x[:3]
        for k, (f, rate) in enumerate(zip(self.f, omega, strict=True)):
            if k in self.turns:
                found.append(found[-1] @ self.turns[k][0])
            else:
                found.append(analytic_coarse(f, rate, g_n=self.g_n, omega_ie_n=self.omega_n))
        return np.stack(found)

    def residual(self, C: Array, x: Array) -> Array:
        nuisances = self.sigma * x
        gyro, accel, disturbance = nuisances[:3], nuisances[3:6], nuisances[6]
        force = disturbance * self.up_n - self.g_n
        rows = [
            ((self.omega_n @ C + gyro - self.omega) / self.omega_sigma).ravel(),
            ((force @ C + accel - self.f) / self.f_sigma).ravel(),
            x,
        ]
        for k, (turn, sigma) in self.turns.items():
            off = C[k - 1].T @ C[k] @ turn.T
            rows.append(rotvec_from_quat(quat_from_dcm(off)) / sigma)
        return np.concatenate(rows)

    def jacobian(self, C: Array) -> Array:
        """Derivative of `residual`; a known turn is taken as nearly met."""
        count = len(C)
        J = np.zeros((6 * count + _NUISANCES + 3 * len(self.turns), 3 * count + _NUISANCES))
        for k in range(count):
            at = slice(3 * k, 3 * k + 3)
            by_rate, by_force = 1.0 / self.omega_sigma[k, :, None], 1.0 / self.f_sigma[k, :, None]
            J[at, at] = by_rate * (C[k].T @ skew(self.omega_n))
            J[at, -7:-4] = by_rate * np.diag(self.sigma[:3])
            below = slice(3 * (count + k), 3 * (count + k) + 3)
            J[below, at] = -by_force * (C[k].T @ skew(self.g_n))
            J[below, -4:-1] = by_force * np.diag(self.sigma[3:6])
            J[below, -1] = by_force[:, 0] * (C[k].T @ self.up_n) * self.sigma[6]
        J[6 * count : 6 * count + _NUISANCES, -_NUISANCES:] = np.eye(_NUISANCES)
        for row, (k, (_, sigma)) in enumerate(self.turns.items()):
            start = 6 * count + _NUISANCES + 3 * row
            J[start : start + 3, 3 * k : 3 * k + 3] = C[k - 1].T / sigma
            J[start : start + 3, 3 * k - 3 : 3 * k] = -C[k - 1].T / sigma
        return J

    def solution(self, C: Array, x: Array, residual: Array) -> MultiPositionSolution:
        J = self.jacobian(C)
        root = np.linalg.inv(np.linalg.qr(J)[1])
        P = root @ root.T
        count = len(C)
        blocks = P[:-_NUISANCES, :-_NUISANCES].reshape(count, 3, count, 3)
        biases = self.sigma * x
        sigmas = self.sigma * np.sqrt(np.diag(P)[-_NUISANCES:])
        untold: list[str] = []
        for sensor, at in (("gyro", slice(-7, -4)), ("accelerometer", slice(-4, -1))):
            if self.sigma[at][0] > 0.0:
                untold += _untold(sensor, P, np.arange(len(P))[at])
        if self.hides and self._bend(C, x, residual, J) > _BENT:
            untold.append(
                "how far the attitudes may be off: within one sigma the data bend away from the "
                "straight line that the sigmas assume; add positions or known turns"
            )
        return MultiPositionSolution(
            q_nb=quat_from_dcm(C),
            P_n=np.einsum("kikj->kij", blocks),
            gyro_bias=biases[:3],
            gyro_bias_sigma=sigmas[:3],
            accel_bias=biases[3:6],
            accel_bias_sigma=sigmas[3:6],
            unobservable=tuple(untold),
            chi2=float(residual @ residual),
            dof=3 * count + 3 * len(self.turns),
        )

    def _bend(self, C: Array, x: Array, residual: Array, J: Array) -> float:
        """Largest departure of the residuals from linear, one sigma away, sigmas."""
        _, scale, axes = np.linalg.svd(np.linalg.qr(J)[1])
        steps = axes / scale[:, None]
        return max(
            float(np.linalg.norm(self.residual(*_moved(C, x, step)) - residual - J @ step))
            for step in (*steps, *-steps)
        )


def _untold(sensor: str, P: Array, at: NDArray[np.int64]) -> list[str]:
    """Name the directions of a sensor's bias that keep most of their prior variance."""
    values, vectors = np.linalg.eigh(P[np.ix_(at, at)])
    free = vectors[:, values > _UNTOLD]
    axes = np.flatnonzero(np.sum(free * free, axis=1) > _OWN_AXIS)
    if len(axes) == free.shape[1]:
        groups = (
            [(_listed(["xyz"[i] for i in axes]) + f" {sensor} bias", free)] if len(axes) else []
        )
    else:
        groups = [
            (f"{sensor} bias along ({', '.join(f'{c:.2f}' for c in u)}) of the body", u[:, None])
            for u in free.T
        ]
    return [name + _turned(P, at, U) for name, U in groups]


def _turned(P: Array, at: NDArray[np.int64], U: Array) -> str:
    """What of the attitudes owes most of its variance to a bias along the columns of `U`."""
    cross = P[:-_NUISANCES, at] @ U
    own = U.T @ P[np.ix_(at, at)] @ U
    owed = np.einsum("ij,ji->i", cross, np.linalg.solve(own, cross.T)) / np.diag(P)[:-_NUISANCES]
    shares = owed.reshape(-1, 3) > _SHARE
    words = []
    for what, held in (("level", np.any(shares[:, :2], axis=1)), ("heading", shares[:, 2])):
        if np.any(held):
            numbers = [str(k + 1) for k in np.flatnonzero(held)]
            noun = "position" if len(numbers) == 1 else "positions"
            words.append(f"the {what} of {noun} {_listed(numbers)}")
    return f", together with {_listed(words)}" if words else ""


def _listed(words: list[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
