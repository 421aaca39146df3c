"""Body increments: motions whose rate and force are polynomials, and logs to reconstruct."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from navgrade import ImuSamples, Status
from navgrade.imu import BodyIncrements
from navgrade.reconstruction import reconstruct

Array = NDArray[np.float64]

COLUMNS = ("t", "dt", "phi", "dv", "dr", "status")
TERMS = 40  # of the series in `Polynomial.moved`: over 1 s the next ones are below 1e-14


def rebuilt(blocks: ImuSamples | Iterable[ImuSamples], name: str) -> BodyIncrements:
    """All rows an algorithm makes of one log, whole or in blocks."""
    pieces = list(reconstruct([blocks] if isinstance(blocks, ImuSamples) else blocks, name))
    return BodyIncrements(
        *(np.concatenate([getattr(piece, column) for piece in pieces]) for column in COLUMNS)
    )


def same_bits(one: BodyIncrements, other: BodyIncrements) -> bool:
    """Whether two results agree in every bit."""
    return all(getattr(one, c).tobytes() == getattr(other, c).tobytes() for c in COLUMNS)


@dataclass(frozen=True)
class Polynomial:
    """Many motions at once: rate (rad/s) and force (m/s^2) in b are polynomials in time (s).

    `rate` and `force`, (degree + 1, cases, 3), are their coefficients, ascending.
    """

    rate: Array
    force: Array

    @staticmethod
    def random(degree: int, cases: int, seed: int = 5) -> Polynomial:
        """Derivatives of 1 rad/s^(j+1) and 10 m/s^(j+2) at t = 0, each in a random direction."""
        scale = np.array([factorial(j) for j in range(degree + 1)])[:, None, None]
        values = np.random.default_rng(seed).standard_normal((2, degree + 1, cases, 3))
        values /= scale * np.linalg.norm(values, axis=-1, keepdims=True)
        return Polynomial(values[0], 10.0 * values[1])

    def _within(self, coefficients: Array, start: float, h: float) -> Array:
        """Coefficients in s = (t - start) / h, times h."""
        out = []
        for j in range(len(coefficients)):
            value = polynomial.polyval(start, polynomial.polyder(coefficients, j))
            out.append(value * h ** (j + 1) / factorial(j))
        return np.array(out)

    def logs(self, edges: Array) -> list[ImuSamples]:
        """Exact increments of each case between `edges`, s."""
        dt = np.diff(edges)
        powers = np.arange(1.0, len(self.rate) + 1.0)[:, None, None]
        dtheta, dvel = (
            np.array(
                [
                    (self._within(c, *s) / powers).sum(axis=0)
                    for s in zip(edges[:-1], dt, strict=True)
                ]
            )
            for c in (self.rate, self.force)
        )
        return [
            ImuSamples(t=edges[1:], dt=dt, gyro=gyro, accel=accel, kind="increment")
            for gyro, accel in zip(np.moveaxis(dtheta, 1, 0), np.moveaxis(dvel, 1, 0), strict=True)
        ]

    def moved(self, start: float, h: float) -> tuple[Array, Array, Array]:
        """True C (cases, 3, 3), dv and dr of all cases over one interval, from power series.

        C' = C [omega x], v' = C f, r' = v, all resolved in b at `start`. To rounding up to 1 s.
        """
        rate, force = self._within(self.rate, start, h), self._within(self.force, start, h)
        x, y, z = np.moveaxis(rate, -1, 0)
        o = np.zeros_like(x)
        skew = np.stack(
            [np.stack(row, axis=-1) for row in ((o, -z, y), (z, o, -x), (-y, x, o))], axis=-2
        )
        C = [np.broadcast_to(np.eye(3), skew.shape[1:])]
        zero = np.zeros(rate.shape[1:])
        v, r = [zero], [zero]
        for n in range(TERMS):
            known = range(min(len(rate), n + 1))
            r.append(v[n] / (n + 1))
            v.append(
                np.sum([(C[n - j] @ force[j, :, :, None])[..., 0] for j in known], axis=0) / (n + 1)
            )
            C.append(np.sum([C[n - j] @ skew[j] for j in known], axis=0) / (n + 1))
        return np.sum(C, axis=0), np.sum(v, axis=0), h * np.sum(r, axis=0)


def log_of(dt: ArrayLike, *, status: NDArray[np.uint32] | None = None) -> ImuSamples:
    """Random increments over these intervals, s: 0.3 rad/s and 10 m/s^2."""
    dt = np.asarray(dt, dtype=np.float64)
    values = np.random.default_rng(11).standard_normal((2, len(dt), 3)) * dt[:, None]
    return ImuSamples(
        t=7.0 + np.cumsum(dt),
        dt=dt,
        gyro=0.3 * values[0],
        accel=10.0 * values[1] + np.outer(dt, [0.0, 0.0, -9.8]),
        kind="increment",
        status=np.zeros(len(dt), np.uint32) if status is None else status,
    )


def varied_log() -> ImuSamples:
    """Equal, alternating and random intervals, one 12 times as long, and bridged samples."""
    rng = np.random.default_rng(12)
    equal, alternating = np.full(170, 0.01), np.tile([0.006, 0.004], 30)
    random = rng.uniform(0.004, 0.016, 50)
    long, stretched = np.array([0.12]), np.array([0.03])
    dt = np.concatenate(
        [equal, alternating, random, long, equal, stretched, equal[:40], equal / 8.0]
    )
    status = np.zeros(len(dt), np.uint32)
    for start, count in ((100, 25), (130, 3), (200, 1), (300, 12), (len(dt) - 5, 2)):
        status[start : start + count] = Status.BRIDGED
    return log_of(dt, status=status)
