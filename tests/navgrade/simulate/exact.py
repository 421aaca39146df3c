"""Motions once more in high precision: poses as functions of time, differentiated numerically."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from mpmath import mp, mpf

from navgrade import ImuSamples, Trajectory, navigate
from navgrade.simulate import Motion, imu_increments, imu_rates, true_trajectory
from tests.oracles import constants
from tests.oracles.cases import PositionError, position_error
from tests.oracles.high_precision import DIGITS, C_en, derivatives, ecef, error, felt

Pose = Callable[[mpf], tuple[mp.matrix, mp.matrix]]  # of t: C_eb, r_e
DEG = np.pi / 180.0  # rad


class Mismatch(NamedTuple):
    """Largest differences from high precision: rad/s, m/s^2, and of velocity m/s."""

    omega: float
    f: float
    v: float


def mismatch(motion: Motion, pose: Callable[[float], Pose], times: Sequence[float]) -> Mismatch:
    """What `motion` gets wrong at some times; `pose(t)` is a pose good around t."""
    worst = np.zeros(3)
    for t in times:
        omega, f = imu_rates(motion, [t])
        here = pose(t)
        exact = felt(here, t)
        with mp.workdps(DIGITS):
            v_e = derivatives(lambda x, here=here: here(x)[1], mpf(t))[1]  # type: ignore[misc]
        v = motion.at(np.array([t])).v_e
        now = error(omega, exact[:3]), error(f, exact[3:]), error(v, v_e)
        worst = np.maximum(worst, now)
    return Mismatch(*(float(x) for x in worst))


def over_earth(lat: mpf, lon: mpf, h: mpf, C_nb: mp.matrix) -> tuple[mp.matrix, mp.matrix]:
    """C_eb and r_e."""
    return C_en(lat, lon) * C_nb, ecef(lat, lon, h)


def radii(lat: mpf) -> tuple[mpf, mpf]:
    """Meridian and transverse radius of curvature, m."""
    f = 1 / mpf(constants.INVERSE_FLATTENING_TEXT)
    e2 = f * (2 - f)
    w2 = 1 - e2 * mp.sin(lat) ** 2
    transverse = mpf(constants.EQUATORIAL_RADIUS_TEXT) / mp.sqrt(w2)
    return transverse * (1 - e2) / w2, transverse


def cox_de_boor(knots: Sequence[float], k: int, degree: int, t: mpf) -> mpf:
    """B-spline basis function k."""
    if degree == 0:
        return mpf(knots[k] <= t < knots[k + 1])
    total = mpf(0)
    for first, weight in ((k, 0), (k + 1, 1)):
        a, b = mpf(knots[first]), mpf(knots[first + degree])
        if b > a:
            share = (b - t if weight else t - a) / (b - a)
            total += share * cox_de_boor(knots, first, degree - 1, t)
    return total


def rotation(q: Sequence[mpf]) -> mp.matrix:
    """Matrix of a quaternion of any length."""
    w, x, y, z = q
    n = w * w + x * x + y * y + z * z
    return (
        mp.matrix(
            [
                [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
            ]
        )
        / n
    )


def navigated(motion: Motion, edges: np.ndarray) -> tuple[Trajectory, Trajectory]:
    """The engine's solution from exact increments, and the truth."""
    dtheta, dvel = imu_increments(motion, edges)
    truth = true_trajectory(motion, edges)
    imu = ImuSamples(t=edges[1:], dt=np.diff(edges), gyro=dtheta, accel=dvel, kind="increment")
    return navigate(imu, truth.state(0), reconstruction="centred-13"), truth[1:]


def closing(motion: Motion, edges: np.ndarray) -> PositionError:
    """How far the engine is from the truth."""
    return position_error(*navigated(motion, edges))
