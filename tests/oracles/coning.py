"""Coning, sculling and SPIN-CONE in closed form, and what the classical algorithms leave of them.

Quaternions are scalar first and carry vectors from b to the inertial frame; rotation vectors and
velocity increments are judged as arrays, whoever computed them. Errors are computed minus true.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import comb

import numpy as np
from mpmath import mp, mpf
from numpy.typing import ArrayLike, NDArray

from tests.oracles.truth import Increments

Array = NDArray[np.float64]

_NODES = 20  # Gauss points: the 41st power of a phase of 2 rad over 41! is 1e-38


def _columns(*columns: ArrayLike) -> Array:
    rows: Array = np.stack(np.broadcast_arrays(*columns), axis=-1).astype(np.float64)
    return rows


def _product(p: Array, q: Array) -> Array:
    w, x, y, z = np.moveaxis(p, -1, 0)
    a, b, c, d = np.moveaxis(q, -1, 0)
    return _columns(
        w * a - x * b - y * c - z * d,
        w * b + x * a + y * d - z * c,
        w * c - x * d + y * a + z * b,
        w * d + x * c - y * b + z * a,
    )


def _from_rotation_vectors(phi: Array) -> Array:
    half = 0.5 * np.sqrt(np.sum(phi * phi, axis=-1))
    return np.concatenate(
        [np.cos(half)[:, None], 0.5 * np.sinc(half / np.pi)[:, None] * phi], axis=-1
    )


def _chain(q: Array) -> Array:
    """Product of all rows, in pairs: fewer roundings than one after the other."""
    while len(q) > 1:
        odd = q[len(q) - len(q) % 2 :]
        q = np.concatenate([_product(q[: len(q) - len(odd) : 2], q[1 : len(q) : 2]), odd])
    product: Array = q[0]
    return product


def attitude_error(start: Array, phi: Array, end: Array) -> Array:
    """Error, as a rotation vector in b (rad), of `start` turned by rows of `phi`, against `end`.

    For small errors: twice the vector part of conj(end) * computed, to rounding.
    """
    computed = _product(start, _chain(_from_rotation_vectors(phi)))
    difference = _product(end * np.array([1.0, -1.0, -1.0, -1.0]), computed)
    error: Array = 2.0 * np.copysign(1.0, difference[0]) * difference[1:]
    return error


@dataclass(frozen=True)
class Coning:
    """A body axis on a cone of `half_angle` (rad) about inertial z, at `frequency` (Hz).

    q = [cos(a/2), sin(a/2) cos Wt, sin(a/2) sin Wt, 0], W = 2 pi f, exactly, so
    omega = (-W sin a sin Wt, W sin a cos Wt, -2 W sin^2(a/2)).
    """

    half_angle: float
    frequency: float

    @property
    def W(self) -> float:
        """Angular frequency, rad/s."""
        return 2.0 * np.pi * self.frequency

    def attitude(self, t: ArrayLike) -> Array:
        """Quaternions at times `t`, s."""
        phase, half = self.W * np.asarray(t, dtype=np.float64), 0.5 * self.half_angle
        return _columns(
            np.cos(half), np.sin(half) * np.cos(phase), np.sin(half) * np.sin(phase), 0.0
        )

    def increments(self, edges: Array) -> Increments:
        """Exact integrals between any `edges`, s; no force."""
        dt = np.diff(edges)
        x = np.diff(np.sin(self.half_angle) * np.cos(self.W * edges))
        y = np.diff(np.sin(self.half_angle) * np.sin(self.W * edges))
        dtheta = _columns(x, y, -2.0 * self.W * np.sin(0.5 * self.half_angle) ** 2 * dt)
        return Increments(edges[1:], dt, dtheta, np.zeros_like(dtheta))

    def drift(self, t: Array, dt: Array, phi: Array) -> float:
        """Error of attitude about the cone's axis per time, rad/s, over consecutive rows."""
        ends = np.array([t[0] - dt[0], t[-1]])
        start, end = self.attitude(ends)
        return float(attitude_error(start, phi, end)[2] / (ends[1] - ends[0]))


@dataclass(frozen=True)
class Sculling:
    """Rotation about x by `angle` sin Wt (rad) in phase with a force along body y.

    The force is `force` sin Wt (m/s^2), W = 2 pi `frequency` (Hz). In the frame of zero rotation
    it averages to `force` J1(`angle`) along z, close to half the product of the two.
    """

    angle: float
    force: float
    frequency: float

    @property
    def W(self) -> float:
        """Angular frequency, rad/s."""
        return 2.0 * np.pi * self.frequency

    def increments(self, edges: Array) -> Increments:
        """Exact integrals between any `edges`, s."""
        zero = np.zeros(len(edges) - 1)
        theta = np.diff(self.angle * np.sin(self.W * edges))
        v = np.diff(-self.force / self.W * np.cos(self.W * edges))
        return Increments(
            edges[1:], np.diff(edges), _columns(theta, zero, zero), _columns(zero, v, zero)
        )

    def velocity(self, start: Array, dt: Array) -> Array:
        """True velocity increments (m/s) of intervals, resolved in the frame of zero rotation.

        By Gauss quadrature, to rounding: relative 1e-15 for phases up to 2 rad per interval.
        """
        x, w = np.polynomial.legendre.leggauss(_NODES)
        sine = np.sin(self.W * (start[:, None] + dt[:, None] * (0.5 + 0.5 * x)))
        scale = 0.5 * self.force * dt
        y = scale * ((np.cos(self.angle * sine) * sine) @ w)
        z = scale * ((np.sin(self.angle * sine) * sine) @ w)
        return _columns(np.zeros_like(y), y, z)

    def residual(self, t: Array, dt: Array, dv: Array) -> Array:
        """Mean error (m/s^2) of velocity increments given in b at the start of their interval."""
        start = t - dt
        theta = self.angle * np.sin(self.W * start)
        y = np.cos(theta) * dv[:, 1] - np.sin(theta) * dv[:, 2]
        z = np.sin(theta) * dv[:, 1] + np.cos(theta) * dv[:, 2]
        error = _columns(dv[:, 0], y, z) - self.velocity(start, dt)
        mean: Array = error.sum(axis=0) / dt.sum()
        return mean


@dataclass(frozen=True)
class SpinCone:
    """Savage's SPIN-CONE: C = Rz(wc t) Ry(pi/2 - beta) Rx(rho t), rho = ws + wc cos beta.

    A body spinning at `spin` (rad/s) while its spin axis precesses at `precession` (rad/s) on a
    cone of half-angle `beta` (rad): omega = (ws, wc sin beta sin rho t, wc sin beta cos rho t).
    """

    precession: float
    spin: float
    beta: float

    @property
    def rho(self) -> float:
        """Roll rate, rad/s."""
        return float(self.spin + self.precession * np.cos(self.beta))

    def attitude(self, t: ArrayLike) -> Array:
        """Quaternions at times `t`, s."""
        t = np.asarray(t, dtype=np.float64)
        zero = np.zeros_like(t)
        heading, pitch, roll = (
            0.5 * self.precession * t,
            0.5 * (0.5 * np.pi - self.beta) + zero,
            0.5 * self.rho * t,
        )
        about_z = _columns(np.cos(heading), zero, zero, np.sin(heading))
        about_y = _columns(np.cos(pitch), zero, np.sin(pitch), zero)
        about_x = _columns(np.cos(roll), np.sin(roll), zero, zero)
        return _product(_product(about_z, about_y), about_x)

    def increments(self, edges: Array) -> Increments:
        """Exact integrals between any `edges`, s; no force."""
        dt = np.diff(edges)
        radius = self.precession * np.sin(self.beta) / self.rho
        dtheta = _columns(
            self.spin * dt,
            np.diff(-radius * np.cos(self.rho * edges)),
            np.diff(radius * np.sin(self.rho * edges)),
        )
        return Increments(edges[1:], dt, dtheta, np.zeros_like(dtheta))

    def error(self, t: Array, dt: Array, phi: Array) -> float:
        """Angle (rad) by which consecutive rows miss the true attitude at their end."""
        start, end = self.attitude(np.array([t[0] - dt[0], t[-1]]))
        return float(np.linalg.norm(attitude_error(start, phi, end)))


def within(t: Array, dt: Array, start: float, end: float) -> slice:
    """Rows whose intervals lie between `start` and `end`, s, which must be edges of theirs."""
    room = 1e-6 * dt.min()
    first = int(np.searchsorted(t - dt, start - room))
    last = int(np.searchsorted(t, end + room)) - 1
    if abs(t[first] - dt[first] - start) > room or abs(t[last] - end) > room:
        raise ValueError(f"{start} s and {end} s are not both edges of intervals")
    return slice(first, last + 1)


@dataclass(frozen=True)
class Classical:
    """The frequency-matched family: `samples` per update and `previous` samples before it.

    A product of two increments depends, in pure coning, on their distance m alone. The
    coefficients k_m of the distances make the correction equal to the exact coning integral
    as a power series in frequency (Miller 1983; Lee et al. 1990; Ignagni 1996):

        (N lambda - sin N lambda) / 2 = 2 (1 - cos lambda) sum_m k_m sin m lambda,

    lambda = W h, h the sample interval. Each of n - 1 coefficients matches one odd power from the
    third on; n = `samples` + `previous`. The same share of sculling is left, by duality.
    """

    samples: int
    previous: int

    @property
    def n(self) -> int:
        """Samples in a window."""
        return self.samples + self.previous

    def coefficients(self) -> tuple[Fraction, ...]:
        """k_1 ... k_(n-1), exactly."""
        size = self.n - 1
        rows = []
        for j in range(1, size + 1):
            p = 2 * j + 1
            row = [(m + 1) ** p + (m - 1) ** p - 2 * m**p for m in range(1, size + 1)]
            rows.append([Fraction(x) for x in [*row, 0]])
            rows[-1][-1] = Fraction(self.samples**p, 2)
        for i in range(size):  # Gauss and Jordan; the leading minors are not zero
            rows[i] = [x / rows[i][i] for x in rows[i]]
            for r in range(size):
                if r != i:
                    rows[r] = [x - rows[r][i] * y for x, y in zip(rows[r], rows[i], strict=True)]
        return tuple(row[-1] for row in rows)

    def share(self, lam: float) -> float:
        """What is left per time, at lambda, in units of a^2 W (coning) or a c (sculling).

        Coning of half-angle a drifts by this much towards -z; sculling of angle a and force c
        lacks this much acceleration. To second order in a; computed in 50 digits.
        """
        with mp.workdps(50):
            x = mpf(lam)
            turn = self.samples * x
            found = sum(
                (
                    mpf(k.numerator) / k.denominator * mp.sin((m + 1) * x)
                    for m, k in enumerate(self.coefficients())
                ),
                mpf(0),
            )
            return float(((turn - mp.sin(turn)) / 2 - 2 * (1 - mp.cos(x)) * found) / turn)

    def leading(self, lam: float) -> float:
        """The first power of `share`: lambda^2n / [(n + 1) C(2n + 2, n + 1)]."""
        return lam ** (2 * self.n) / ((self.n + 1) * comb(2 * self.n + 2, self.n + 1))


def classical(name: str) -> Classical | None:
    """Class of a reconstruction by its name; None where there is no closed form."""
    family, _, size = name.partition("-")
    if family == "none":
        return Classical(1, 0)
    if family == "causal":
        return Classical(1, int(size))
    if family == "samples":
        return Classical(int(size), 0)
    return None
