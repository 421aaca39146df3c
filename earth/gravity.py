"""Normal gravity: gravitation plus centrifugal acceleration of the equipotential ellipsoid.

The closed ellipsoidal-harmonic form is the standard here. `fitted_gravity` reproduces it inside
loops for a tenth of the cost; Somigliana's formula with a second-order height term is offered
under its own name because other engines use it, not because it is as good: it is off by
1 µm/s² at 20 km.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from earth._jit import formula, rare_formula
from earth.ellipsoid import WGS84, Ellipsoid, ellipsoidal_q
from earth.geodetic import radii

FIT_H_MIN = -1_000.0  # m, domain of the fit
FIT_H_MAX = 20_000.0  # m


@rare_formula
def closed_form_gravity(params, sin_lat, cos_lat, h):
    """Return north and down components of the exact normal gravity, m/s^2.

    Heiskanen & Moritz, Physical Geodesy (1967), section 6-2 (6-2, 6-5, 6-8), rotated from the
    ellipsoidal to the geodetic axes.
    """
    E2 = params.E * params.E
    omega2 = params.omega * params.omega
    _, transverse = radii(params, sin_lat)
    rho = (transverse + h) * cos_lat
    z = (transverse * (1.0 - params.e2) + h) * sin_lat
    k = rho * rho + z * z - E2
    u2 = 0.5 * (k + np.sqrt(k * k + 4.0 * E2 * z * z))
    u = np.sqrt(u2)
    v2 = u2 + E2
    v = np.sqrt(v2)
    sin_beta = z / u
    cos_beta = rho / v
    w2 = (u2 + E2 * sin_beta * sin_beta) / v2
    q, dq = ellipsoidal_q(params.E / u)
    swirl = omega2 * params.a * params.a / params.q0
    g_u = -(
        params.GM / v2
        + swirl * params.E / v2 * dq * (0.5 * sin_beta * sin_beta - 1.0 / 6.0)
        - omega2 * u * cos_beta * cos_beta
    )
    g_beta = (swirl * q / v - omega2 * v) * sin_beta * cos_beta
    tilt = u * cos_beta / v
    g_rho = (g_u * tilt - g_beta * sin_beta) / w2
    g_z = (g_u * sin_beta + g_beta * tilt) / w2
    return -sin_lat * g_rho + cos_lat * g_z, -(cos_lat * g_rho + sin_lat * g_z)


@formula
def somigliana(params, sin_lat):
    """Return normal gravity on the ellipsoid, m/s^2; exact there (Somigliana 1929)."""
    s2 = sin_lat * sin_lat
    k = params.b * params.gamma_p / (params.a * params.gamma_e) - 1.0
    return params.gamma_e * (1.0 + k * s2) / np.sqrt(1.0 - params.e2 * s2)


@formula
def taylor_gravity(params, sin_lat, h):
    """Return Somigliana's gravity continued to `h` by a second-order Taylor series, m/s^2.

    Heiskanen & Moritz (2-123).
    """
    f = 1.0 - params.b / params.a
    m = params.omega * params.omega * params.a * params.a * params.b / params.GM
    x = h / params.a
    linear = 2.0 * (1.0 + f + m - 2.0 * f * sin_lat * sin_lat)
    return somigliana(params, sin_lat) * (1.0 - linear * x + 3.0 * x * x)


class GravityFit(NamedTuple):
    """Polynomials in s = sin^2(lat) and h of the closed form; see `gravity_fit`.

    Coefficients of s^i h^j, i + j at most the degree, ordered by j, then i.
    """

    down: tuple[float, ...]  # degree 4: g_D, m/s^2
    north: tuple[float, ...]  # degree 2: g_N / (sin(lat) cos(lat) h), 1/s^2


@formula
def fitted_gravity(params, fit, sin_lat, cos_lat, h):
    """Return north and down gravity, m/s^2: the fit in its domain, the closed form outside."""
    if h < FIT_H_MIN or h > FIT_H_MAX:
        return closed_form_gravity(params, sin_lat, cos_lat, h)
    s = sin_lat * sin_lat
    c = fit.down
    d0 = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * c[4])))
    d1 = c[5] + s * (c[6] + s * (c[7] + s * c[8]))
    d2 = c[9] + s * (c[10] + s * c[11])
    d3 = c[12] + s * c[13]
    down = d0 + h * (d1 + h * (d2 + h * (d3 + h * c[14])))
    c = fit.north
    n0 = c[0] + s * (c[1] + s * c[2])
    north = n0 + h * (c[3] + s * c[4] + h * c[5])
    return north * sin_lat * cos_lat * h, down


@cache
def gravity_fit(ellipsoid: Ellipsoid = WGS84) -> GravityFit:
    """Fit the closed form for loops.

    Least squares on Chebyshev nodes in s over [0, 1] and h over [-1 km, 20 km]. Accuracy against
    the closed form there: 1e-11 m/s^2 (`tests/earth/test_gravity.py`).
    """
    unit = chebyshev.chebpts1(24)
    s = 0.5 + 0.5 * unit[:, None]
    half = 0.5 * (FIT_H_MAX - FIT_H_MIN)
    h = FIT_H_MIN + half * (1.0 + unit[None, :])
    sin_lat, cos_lat = np.sqrt(s), np.sqrt(1.0 - s)
    north, down = closed_form_gravity(ellipsoid.params, sin_lat, cos_lat, h)

    def coefficients(values: NDArray[np.float64], degree: int) -> tuple[float, ...]:
        scaled = h / FIT_H_MAX
        terms = [(i, j) for j in range(degree + 1) for i in range(degree + 1 - j)]
        design = np.stack([(s**i * scaled**j).ravel() for i, j in terms], axis=-1)
        found = np.linalg.lstsq(design, values.ravel(), rcond=None)[0]
        return tuple(float(x) / FIT_H_MAX**j for x, (_, j) in zip(found, terms, strict=True))

    return GravityFit(
        down=coefficients(down, 4), north=coefficients(north / (sin_lat * cos_lat * h), 2)
    )


def normal_gravity_n(
    lat: ArrayLike, h: ArrayLike, ellipsoid: Ellipsoid = WGS84
) -> NDArray[np.float64]:
    """Normal gravity vector in NED, closed form.

    Parameters
    ----------
    lat : array_like
        Geodetic latitude, rad.
    h : array_like
        Height above the ellipsoid, m; shapes broadcast.
    ellipsoid : Ellipsoid

    Returns
    -------
    ndarray, shape (..., 3)
        ``g_n``, m/s^2; the east component is zero. Accuracy 1e-11 m/s^2 from the surface to
        100 km (`tests/earth/test_gravity.py`, against GeographicLib's table and 50-digit
        arithmetic). It is the field of the ellipsoid; the real Earth departs from it.
    """
    lat, h = np.broadcast_arrays(np.asarray(lat, float), np.asarray(h, float))
    north, down = closed_form_gravity(ellipsoid.params, np.sin(lat), np.cos(lat), h)
    return np.stack([north, np.zeros_like(north), down], axis=-1)


def somigliana_second_order(
    lat: ArrayLike, h: ArrayLike, ellipsoid: Ellipsoid = WGS84
) -> NDArray[np.float64]:
    """Magnitude of normal gravity, m/s^2, by Somigliana and a second-order Taylor term in h.

    The model of most textbooks (Groves 2013, 2.134-2.139). Against the closed form it is off by
    0.1 µm/s² at 1 km and 1.4 µm/s² at 20 km (`tests/earth/test_gravity.py`).
    """
    sin_lat = np.sin(np.asarray(lat, float))
    return np.asarray(taylor_gravity(ellipsoid.params, sin_lat, np.asarray(h, float)))
