"""Closed-form motion across a pole, given in Earth-fixed Cartesian coordinates.

omega_ib_b = omega_eb_b + C_be omega_ie_e and
f_ib_b = C_be (a + 2 omega_ie x v + omega_ie x (omega_ie x r) - gamma(r)), gamma the gravitation.
Neither knows latitude, longitude or north, so nothing is singular at the pole. Geodetic
coordinates are derived, to start an engine and to compare with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.oracles.constants import E2, EQUATORIAL_RADIUS, OMEGA
from tests.oracles.gravity import gravitation_e
from tests.oracles.truth import (
    DEG,
    ClosedForm,
    Coordinate,
    Sinusoid,
    fastest_wave,
    matrix,
    on_clock,
    period,
    quaternion,
    quaternion_product,
    write_rates,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PolarState:
    """True state at `t`; at a pole lon, v_eb_n and q_nb agree with each other, no more."""

    t: Array
    r_eb_e: Array
    v_eb_e: Array
    q_eb: Array
    C_eb: Array
    lat: Array
    lon: Array
    h: Array
    v_eb_n: Array
    q_nb: Array


@dataclass(frozen=True)
class PolarMotion(ClosedForm):
    """Earth-fixed position (m) and ZYX Euler angles (rad) as functions of time.

    The angles are relative to axes fixed in the Earth: x along that of e, z down at the pole.

    Attributes
    ----------
    pole : int
        1 for the north pole, -1 for the south pole.
    """

    x: Coordinate
    y: Coordinate
    z: Coordinate
    roll: Coordinate
    pitch: Coordinate
    yaw: Coordinate
    pole: int

    def state(self, t: ArrayLike) -> PolarState:
        """True navigation state at each time."""
        t = np.atleast_1d(np.asarray(t, dtype=np.float64))
        *axes, roll, pitch, yaw = (
            (np.broadcast_to(x, t.shape), np.broadcast_to(x1, t.shape))
            for x, x1, _ in on_clock(self._all(), t, np.zeros(1))
        )
        r_eb_e = np.stack([x for x, _ in axes], axis=1)
        v_eb_e = np.stack([x1 for _, x1 in axes], axis=1)
        lat, lon, h = geodetic(r_eb_e)
        # At the north pole the fixed axes are those of e after half a turn about x.
        q_ef = np.array([[0.0, 1.0, 0.0, 0.0] if self.pole > 0 else [1.0, 0.0, 0.0, 0.0]])
        q_eb = _positive(quaternion_product(q_ef, quaternion(roll[0], pitch[0], yaw[0])))
        C_eb = matrix(roll[0], pitch[0], yaw[0])
        C_eb[:, 1:] *= -self.pole
        level, tilt = np.zeros_like(lat), -0.5 * math.pi - lat
        v_eb_n = np.einsum("kij,ki->kj", matrix(level, tilt, lon), v_eb_e)
        q_ne = quaternion(level, tilt, lon) * np.array([1.0, -1.0, -1.0, -1.0])
        q_nb = _positive(quaternion_product(q_ne, q_eb))
        return PolarState(t, r_eb_e, v_eb_e, q_eb, C_eb, lat, lon, h, v_eb_n, q_nb)

    def fastest(self) -> float:
        """Angular frequency of the fastest sinusoid, rad/s."""
        return fastest_wave(self._all())

    def _all(self) -> tuple[Coordinate, ...]:
        return self.x, self.y, self.z, self.roll, self.pitch, self.yaw

    def fill_rates(self, t: Array, t_low: Array, out: Array) -> None:
        """Write omega_ib_b, then f_ib_b, at t + t_low along the first axis of `out`."""
        x_, y_, z_, roll, pitch, yaw = on_clock(self._all(), t, t_low)
        (x, x1, x2), (y, y1, y2), (z, _, z2) = x_, y_, z_
        gamma_x, gamma_y, gamma_z = gravitation_e(x, y, z)
        f_x = x2 - 2.0 * OMEGA * y1 - OMEGA**2 * x - gamma_x
        f_y = y2 + 2.0 * OMEGA * x1 - OMEGA**2 * y - gamma_y
        f_z = z2 - gamma_z
        turned = -self.pole
        omega_ie = np.zeros(1), np.zeros(1), np.full(1, turned * OMEGA)
        write_rates(omega_ie, (f_x, turned * f_y, turned * f_z), (roll, pitch, yaw), out)


def geodetic(r: Array) -> tuple[Array, Array, Array]:
    """Latitude, longitude and height of Earth-fixed positions (Bowring's iteration)."""
    x, y, z = r.T
    rho, k = np.hypot(x, y), math.sqrt(1.0 - E2)  # k = b / a
    sin_beta, cos_beta = z, k * rho
    for _ in range(4):
        norm = np.hypot(sin_beta, cos_beta)
        sin_beta, cos_beta = sin_beta / norm, cos_beta / norm
        up = z + EQUATORIAL_RADIUS * E2 / k * sin_beta**3
        out = rho - EQUATORIAL_RADIUS * E2 * cos_beta**3
        sin_beta, cos_beta = k * up, out
    lat = np.arctan2(up, out)
    sin_lat, cos_lat = np.sin(lat), np.cos(lat)
    h = rho * cos_lat + z * sin_lat - EQUATORIAL_RADIUS * np.sqrt(1.0 - E2 * sin_lat**2)
    return lat, np.arctan2(y, x), h


def _positive(q: Array) -> Array:
    return q * np.copysign(1.0, q[:, :1])


def polar_flight(pole: int = 1) -> PolarMotion:
    """Figures of eight of half an hour at 110 to 280 m/s, 1.5 to 4.8 km high, centred on a pole.

    It passes at 250 s and every 900 s after: over the pole itself the first and third time, 3 m
    beside it the second and fourth.
    """
    eight, first = period(1800.0), 250.0  # rad/s, s

    def wave(amplitude: float, multiple: float) -> Sinusoid:
        """A sinusoid through zero at the first pass."""
        w = multiple * eight
        return Sinusoid(amplitude, w, -w * first)

    height = EQUATORIAL_RADIUS * math.sqrt(1.0 - E2) + 3000.0
    return PolarMotion(
        x=Coordinate(0.0, sinusoids=(wave(60_000.0, 1), wave(200.0, 15))),
        y=Coordinate(0.0, sinusoids=(wave(21_500.0, 2), wave(300.0, 24), wave(3.0, 0.5))),
        z=Coordinate(pole * height, sinusoids=(Sinusoid(pole * 1500.0, period(240.0), 0.6),)),
        roll=Coordinate(3.0 * DEG, sinusoids=(Sinusoid(30.0 * DEG, period(20.0), 0.3),)),
        pitch=Coordinate(-2.0 * DEG, sinusoids=(Sinusoid(8.0 * DEG, period(40.0), 1.1),)),
        yaw=Coordinate(
            0.5,
            sinusoids=(
                Sinusoid(150.0 * DEG, period(400.0), 0.7),
                Sinusoid(20.0 * DEG, period(75.0), 0.2),
            ),
        ),
        pole=pole,
    )
