"""Normal gravity of WGS-84 by two routes: float64 zonal harmonics and 50-digit closed potential.

Both hold on and above the ellipsoid and a few kilometres below it, where the harmonic
series of the normal field still converges.
"""

from typing import NamedTuple

import numpy as np
from mpmath import mp
from numpy.typing import ArrayLike, NDArray

from tests.oracles.constants import (
    E2,
    EQUATORIAL_RADIUS,
    EQUATORIAL_RADIUS_TEXT,
    GM,
    GM_TEXT,
    INVERSE_FLATTENING_TEXT,
    J2,
    OMEGA,
    OMEGA_TEXT,
)

Array = NDArray[np.float64]


class NormalGravity(NamedTuple):
    """Gravity (gravitation plus centrifugal) in north-east-down, m/s^2; its east part is zero."""

    north: Array
    down: Array


class NormalGravityMp(NamedTuple):
    """The same, one point, as mpmath numbers."""

    north: mp.mpf
    down: mp.mpf


ZONAL_DEGREE = 12  # degree 14 adds less than 1e-15 m/s^2


def _zonal_coefficient(degree: int) -> float:
    """J_2n of an ellipsoid of revolution, Heiskanen & Moritz (1967), eq. 2-92."""
    n = degree // 2
    scale = 3 * E2**n / ((2 * n + 1) * (2 * n + 3))
    return float((-1) ** (n + 1) * scale * (1 - n + 5 * n * J2 / E2))


_J = {n: _zonal_coefficient(n) for n in range(2, ZONAL_DEGREE + 1, 2)}


def _even_legendre_step(n: int) -> tuple[float, float, float]:
    """(alpha, beta, gamma) of t^2 P_n = alpha P_{n+2} + beta P_n + gamma P_{n-2}."""
    alpha = (n + 1) * (n + 2) / ((2 * n + 1) * (2 * n + 3))
    beta = (2 * n * n + 2 * n - 1) / ((2 * n - 1) * (2 * n + 3))
    gamma = n * (n - 1) / ((2 * n + 1) * (2 * n - 1))
    return alpha, beta, gamma


_STEPS = {n: _even_legendre_step(n) for n in range(0, ZONAL_DEGREE, 2)}


def _zonal_sums(u: Array, q: Array) -> tuple[Array, Array]:
    """1 - sum (n + 1) J_n q^(n/2) P_n and sum J_n q^(n/2) dP_n/du, from u and q = (a / r)^2."""
    p, p_last = np.ones_like(u), np.zeros_like(u)
    d, d_last = np.zeros_like(u), np.zeros_like(u)  # dP/du
    power = np.ones_like(u)
    radial, polar = np.ones_like(u), np.zeros_like(u)
    for n, (alpha, beta, gamma) in _STEPS.items():
        x = u - beta
        p_next = x * p
        d_next = x * d
        d_next += p
        p_last *= gamma
        p_next -= p_last
        p_next /= alpha
        d_last *= gamma
        d_next -= d_last
        d_next /= alpha
        p, p_last, d, d_last = p_next, p, d_next, d
        power *= q
        term = power * _J[n + 2]
        polar += term * d
        term *= p
        term *= n + 3
        radial -= term
    return radial, polar


def normal_gravity_zonal(lat: ArrayLike, h: ArrayLike) -> NormalGravity:
    """Normal gravity at geodetic latitude (rad) and ellipsoidal height (m), vectorised."""
    lat = np.asarray(lat, dtype=np.float64)
    return zonal_from_trig(np.sin(lat), np.cos(lat), np.asarray(h, dtype=np.float64))


def zonal_from_trig(sin_lat: Array, cos_lat: Array, h: Array) -> NormalGravity:
    """`normal_gravity_zonal` for callers that hold the sine and cosine of latitude already."""
    w2 = 1.0 - E2 * sin_lat * sin_lat
    w = np.sqrt(w2)
    transverse = EQUATORIAL_RADIUS / w
    rho = (transverse + h) * cos_lat
    z = (transverse * (1.0 - E2) + h) * sin_lat
    r2 = rho * rho + z * z
    r = np.sqrt(r2)
    u = z * z / r2  # squared sine of geocentric latitude
    q = EQUATORIAL_RADIUS**2 / r2

    radial, polar = _zonal_sums(u, q)
    attraction = GM / r2
    spin2 = OMEGA * OMEGA
    # Geocentric up and north, with cos = rho / r, sin = z / r and dP/dt = 2 t dP/du.
    up = spin2 * rho * rho / r - attraction * radial
    north = -(2.0 * attraction * polar / r2 + spin2 / r) * rho * z
    # The angle from geocentric to geodetic latitude, free of cancellation.
    sin_delta = transverse * E2 * sin_lat * cos_lat / r
    cos_delta = (EQUATORIAL_RADIUS * w + h) / r
    return NormalGravity(
        north=north * cos_delta - up * sin_delta, down=-up * cos_delta - north * sin_delta
    )


def gravitation_e(x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
    """Gravitation (without the centrifugal part) at an Earth-fixed position, also at the poles."""
    z2 = z * z
    r2 = x * x + y * y + z2
    u = z2 / r2
    radial, polar = _zonal_sums(u, EQUATORIAL_RADIUS**2 / r2)
    attraction = -GM / (r2 * np.sqrt(r2))  # times the position
    polar *= 2.0
    across = attraction * (radial - u * polar)
    return x * across, y * across, z * (across + attraction * polar)


def _potential(rho: mp.mpf, z: mp.mpf) -> mp.mpf:
    """Normal gravity potential in closed form, Heiskanen & Moritz (1967), eq. 2-62."""
    a = mp.mpf(EQUATORIAL_RADIUS_TEXT)
    f = 1 / mp.mpf(INVERSE_FLATTENING_TEXT)
    gm, omega = mp.mpf(GM_TEXT), mp.mpf(OMEGA_TEXT)
    b = a * (1 - f)
    focal2 = a**2 - b**2
    focal = mp.sqrt(focal2)

    def q(u: mp.mpf) -> mp.mpf:
        return ((1 + 3 * u**2 / focal2) * mp.atan(focal / u) - 3 * u / focal) / 2

    k = rho**2 + z**2 - focal2
    u2 = (k + mp.sqrt(k**2 + 4 * focal2 * z**2)) / 2
    u = mp.sqrt(u2)
    harmonic = omega**2 * a**2 / 2 * q(u) / q(b) * (z**2 / u2 - mp.mpf(1) / 3)
    return gm / focal * mp.atan(focal / u) + harmonic + omega**2 * rho**2 / 2


def meridian_gravity_mp(rho: mp.mpf, z: mp.mpf) -> tuple[mp.mpf, mp.mpf]:
    """Gravity away from the axis and along it, m/s^2, to about 50 digits at a distance and z, m."""
    with mp.workdps(max(mp.dps, 60)):
        g_rho, g_z = (mp.diff(_potential, (rho, z), order) for order in ((1, 0), (0, 1)))
        return g_rho, g_z


def normal_gravity_mp(lat: mp.mpf | float, h: mp.mpf | float) -> NormalGravityMp:
    """Normal gravity to about 50 digits: the gradient of the closed potential, one point."""
    with mp.workdps(max(mp.dps, 60)):
        s, c = mp.sin(lat), mp.cos(lat)
        f = 1 / mp.mpf(INVERSE_FLATTENING_TEXT)
        e2 = f * (2 - f)
        transverse = mp.mpf(EQUATORIAL_RADIUS_TEXT) / mp.sqrt(1 - e2 * s**2)
        g_rho, g_z = meridian_gravity_mp((transverse + h) * c, (transverse * (1 - e2) + h) * s)
        return NormalGravityMp(north=c * g_z - s * g_rho, down=-c * g_rho - s * g_z)
