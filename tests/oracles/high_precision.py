"""The oracle's motions once more, in 120-digit arithmetic and by another route.

Attitude and position are differentiated numerically in inertial axes; gravity is the gradient of
the closed potential. Both routes share the numbers that define a motion, no formula.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
from mpmath import mp, mpf
from numpy.typing import ArrayLike

from tests.oracles import constants
from tests.oracles.gravity import meridian_gravity_mp
from tests.oracles.truth import Coordinate

DIGITS = 120


def value(coordinate: Coordinate, tau: mpf) -> mpf:
    """A coordinate at a time of its clock."""
    return (
        mpf(coordinate.constant)
        + mpf(coordinate.rate) * tau
        + sum(
            mpf(s.amplitude) * mp.sin(mpf(s.angular_frequency) * tau + mpf(s.phase))
            for s in coordinate.sinusoids
        )
    )


def turn(axis: int, angle: mpf) -> mp.matrix:
    """Elementary rotation that takes coordinates after the turn to those before it."""
    s, c = mp.sin(angle), mp.cos(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    C = mp.eye(3)
    C[j, j], C[k, k], C[j, k], C[k, j] = c, c, -s, s
    return C


def from_euler(roll: mpf, pitch: mpf, heading: mpf) -> mp.matrix:
    """Attitude matrix of ZYX angles."""
    return turn(2, heading) * turn(1, pitch) * turn(0, roll)


def C_en(lat: mpf, lon: mpf) -> mp.matrix:
    """North, east and down in Earth-fixed axes."""
    return turn(2, lon) * turn(1, -lat - mp.pi / 2)


def ecef(lat: mpf, lon: mpf, h: mpf) -> mp.matrix:
    """Earth-fixed position of geodetic coordinates, m."""
    f = 1 / mpf(constants.INVERSE_FLATTENING_TEXT)
    e2 = f * (2 - f)
    normal = mpf(constants.EQUATORIAL_RADIUS_TEXT) / mp.sqrt(1 - e2 * mp.sin(lat) ** 2)
    rho = (normal + h) * mp.cos(lat)
    return mp.matrix([rho * mp.cos(lon), rho * mp.sin(lon), (normal * (1 - e2) + h) * mp.sin(lat)])


def derivatives(function: Callable[[mpf], mp.matrix], t: mpf) -> tuple[mp.matrix, ...]:
    """Value, first and second derivative by central differences, good to 55 digits at 120."""
    step = mpf(10) ** -30  # s
    back, here, ahead = (function(t + k * step) for k in (-1, 0, 1))
    return here, (ahead - back) / (2 * step), (ahead - 2 * here + back) / step**2


def felt(pose: Callable[[mpf], tuple[mp.matrix, mp.matrix]], t: float | mpf) -> tuple[mpf, ...]:
    """omega_ib_b and f_ib_b from attitude C_eb and position r_eb_e as functions of time."""
    omega = mpf(constants.OMEGA_TEXT)

    def inertial(t: mpf) -> mp.matrix:
        C_ie, (C_eb, r_e) = turn(2, omega * t), pose(t)
        together = mp.matrix(3, 4)
        together[:, :3], together[:, 3] = C_ie * C_eb, C_ie * r_e
        return together

    with mp.workdps(DIGITS):
        t = mpf(t)
        here, first, second = derivatives(inertial, t)
        C_ib, r_i = here[:, :3], here[:, 3]
        skew = C_ib.T * first[:, :3]
        rho = mp.hypot(r_i[0], r_i[1])
        g_rho, g_z = meridian_gravity_mp(rho, r_i[2])
        outward = g_rho / rho - omega**2  # of gravitation, per metre
        gravitation_i = mp.matrix([r_i[0] * outward, r_i[1] * outward, g_z])
        f_ib_b = C_ib.T * (second[:, 3] - gravitation_i)
        return (skew[2, 1], skew[0, 2], skew[1, 0], *f_ib_b)


def error(got: ArrayLike, exact: Iterable[mpf]) -> float:
    """Largest |got - exact|, subtracted in high precision."""
    return max(abs(float(mpf(float(a)) - b)) for a, b in zip(np.ravel(got), exact, strict=True))
