"""Gravity: of the equipotential ellipsoid, of a user's function, and what the Earth adds.

The closed ellipsoidal-harmonic form of normal gravity is the standard here. `fitted_gravity`
reproduces it inside loops for a tenth of the cost. The other names of `GRAVITY_MODELS` are
offered because other engines use them, not because they are as good.

Loops call `gravity` with what `gravity_field` made of a user's choice. A choice not taken costs
them nothing: it is `None`, and its branch is gone when the loop is compiled.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from earth._jit import compiled, formula, kernel, rare_formula, uncached
from earth.disturbance import DisturbanceGrid, GridNodes, grid_disturbance
from earth.ellipsoid import WGS84, Ellipsoid, ellipsoidal_q
from earth.geodetic import radii

FIT_H_MIN = -1_000.0  # m, domain of the fit
FIT_H_MAX = 20_000.0  # m

GRAVITY_MODELS = {
    "closed-form": "normal gravity, exact at every height",
    "somigliana-taylor": "Somigliana with a second-order term in height, no north component",
    "somigliana": "Somigliana on the ellipsoid, the same at every height, no north component",
}
DEFAULT = "closed-form"

# (lat, lon, h) -> three floats: g_n, g_e, g_d in m/s^2, or xi, eta in rad and dg in m/s^2
GravityFunction = Callable[[float, float, float], tuple[float, float, float]]
F = TypeVar("F", bound=Callable[..., Any])

_CLOSED_FORM, _TAYLOR, _ = range(len(GRAVITY_MODELS))  # positions there: `GravityFit.model`


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


@rare_formula
def modelled_gravity(params, model, sin_lat, cos_lat, h):
    """Return north and down gravity, m/s^2, by the formula of a model."""
    if model == _CLOSED_FORM:
        return closed_form_gravity(params, sin_lat, cos_lat, h)
    if model == _TAYLOR:
        return 0.0, taylor_gravity(params, sin_lat, h)
    return 0.0, somigliana(params, sin_lat)


class GravityFit(NamedTuple):
    """Polynomials in s = sin^2(lat) and h of a model; see `gravity_fit`.

    Coefficients of s^i h^j, i + j at most the degree, ordered by j, then i.
    """

    model: int  # position in GRAVITY_MODELS: what holds outside the domain of the fit
    down: tuple[float, ...]  # degree 4: g_D, m/s^2
    north: tuple[float, ...]  # degree 2: g_N / (sin(lat) cos(lat) h), 1/s^2


@formula
def fitted_gravity(params, fit, sin_lat, cos_lat, h):
    """Return north and down gravity, m/s^2: the fit in its domain, the formula outside."""
    if h < FIT_H_MIN or h > FIT_H_MAX:
        return modelled_gravity(params, fit.model, sin_lat, cos_lat, h)
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
def gravity_fit(ellipsoid: Ellipsoid = WGS84, model: str = DEFAULT) -> GravityFit:
    """Fit a model of `GRAVITY_MODELS` for loops.

    Least squares on Chebyshev nodes in s over [0, 1] and h over [-1 km, 20 km]. Accuracy against
    the model's own formula there: 1e-11 m/s^2 (`tests/earth/test_gravity.py`).

    Raises
    ------
    ValueError
        On an unknown model; the message gives the nearest name.
    """
    if model not in GRAVITY_MODELS:
        near = difflib.get_close_matches(str(model), GRAVITY_MODELS, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(
            f"gravity must be one of {', '.join(GRAVITY_MODELS)} or a function, got {model!r}{hint}"
        )
    number = list(GRAVITY_MODELS).index(model)
    unit = chebyshev.chebpts1(24)
    s = 0.5 + 0.5 * unit[:, None]
    half = 0.5 * (FIT_H_MAX - FIT_H_MIN)
    h = FIT_H_MIN + half * (1.0 + unit[None, :])
    sin_lat, cos_lat = np.sqrt(s), np.sqrt(1.0 - s)
    north, down = modelled_gravity(ellipsoid.params, number, sin_lat, cos_lat, h)
    north, down, _ = np.broadcast_arrays(north, down, s * h)

    def coefficients(values: NDArray[np.float64], degree: int) -> tuple[float, ...]:
        scaled = h / FIT_H_MAX
        terms = [(i, j) for j in range(degree + 1) for i in range(degree + 1 - j)]
        design = np.stack([(s**i * scaled**j).ravel() for i, j in terms], axis=-1)
        found = np.linalg.lstsq(design, values.ravel(), rcond=None)[0]
        return tuple(float(x) / FIT_H_MAX**j for x, (_, j) in zip(found, terms, strict=True))

    return GravityFit(
        model=number,
        down=coefficients(down, 4),
        north=coefficients(north / (sin_lat * cos_lat * h), 2),
    )


class GravityField(NamedTuple):
    """A choice of gravity for loops; see `gravity_field`. What is not chosen is None."""

    fit: GravityFit
    own: GravityFunction | None  # instead of the fit
    grid: GridNodes | None  # on top of either
    shift: GravityFunction | None  # likewise


@formula
def _undisturbed(params, fit, own, sin_lat, cos_lat, lat, lon, h):
    if own is None:
        north, down = fitted_gravity(params, fit, sin_lat, cos_lat, h)
        return north, 0.0, down
    north, east, down = own(lat, lon, h)
    return float(north), float(east), float(down)


@formula
def _plus(g, disturbance):
    xi, eta, dg = disturbance
    return g[0] - g[2] * xi, g[1] - g[2] * eta, g[2] + dg


@formula
def _disturbed(grid, shift, g, lat, lon, h):
    if grid is not None:
        return _plus(g, grid_disturbance(grid, lat, lon))
    if shift is not None:
        return _plus(g, shift(lat, lon, h))
    return g


@formula
def _any(own, grid, shift):
    return not (own is None and grid is None and shift is None)


@formula
def needs_place(field):
    """Return whether `gravity` will look at `lat` and `lon`; a constant in compiled loops.

    Where it is false a loop may pass zeros, and what it would do to find the two is compiled
    away.
    """
    return _any(field.own, field.grid, field.shift)


@formula
def gravity(params, field, sin_lat, cos_lat, lat, lon, h):
    """Return north, east and down gravity, m/s^2, of a `GravityField`; NaN outside its grid.

    `lat` and `lon` matter only where `needs_place`; any multiple of 2 pi may be added to `lon`.
    """
    g = _undisturbed(params, field.fit, field.own, sin_lat, cos_lat, lat, lon, h)
    return _disturbed(field.grid, field.shift, g, lat, lon, h)


def gravity_field(
    gravity: str | GravityFunction = DEFAULT,
    disturbance: GravityFunction | DisturbanceGrid | None = None,
    ellipsoid: Ellipsoid = WGS84,
) -> GravityField:
    """Make of a choice of gravity what loops need.

    Parameters
    ----------
    gravity : str or callable
        A name of `GRAVITY_MODELS`, or a function ``(lat, lon, h) -> (g_n, g_e, g_d)``; rad, rad,
        m to m/s^2. Gravity includes the centrifugal acceleration, and ``g_d`` is positive.
    disturbance : callable or DisturbanceGrid, optional
        Deflections of the vertical and gravity disturbance on top of `gravity`: a grid, or a
        function ``(lat, lon, h) -> (xi, eta, dg)``; rad, rad, m to rad, rad, m/s^2. The signs
        are those of `DisturbanceGrid`.
    ellipsoid : Ellipsoid

    Returns
    -------
    GravityField

    Raises
    ------
    ValueError
        On an unknown name; the message gives the nearest one.
    TypeError
        On a function that numba cannot compile or that does not return a tuple of three floats,
        and on a disturbance that is neither function nor grid.

    Notes
    -----
    Functions are compiled by numba: arithmetic, ``math``, NumPy on scalars, and other functions
    that numba has compiled. They are compiled once, with their globals and closures as they are.
    """
    own = None
    if callable(gravity):
        own = compiled(gravity, "(g_n, g_e, g_d)")
        fit = gravity_fit(ellipsoid)
    else:
        fit = gravity_fit(ellipsoid, gravity)
    if disturbance is None:
        return GravityField(fit, own, None, None)
    if isinstance(disturbance, DisturbanceGrid):
        return GravityField(fit, own, disturbance.nodes, None)
    if not callable(disturbance):
        raise TypeError(
            "disturbance must be a function (lat, lon, h) -> (xi, eta, dg) or a DisturbanceGrid, "
            f"got {type(disturbance).__name__}; DisturbanceGrid.read reads one from a file"
        )
    return GravityField(fit, own, None, compiled(disturbance, "(xi, eta, dg)"))


def kernel_for(loop: F, field: GravityField) -> F:
    """Return the kernel to call with `field`: `loop`, or its uncached twin for user functions."""
    return loop if field.own is None and field.shift is None else uncached(loop)


@kernel
def _gravity_rows(params, field, lat, lon, h, out):
    for k in range(out.shape[0]):
        out[k, 0], out[k, 1], out[k, 2] = gravity(
            params, field, np.sin(lat[k]), np.cos(lat[k]), lat[k], lon[k], h[k]
        )


def gravity_n(
    lat: ArrayLike,
    lon: ArrayLike,
    h: ArrayLike,
    gravity: str | GravityFunction = DEFAULT,
    disturbance: GravityFunction | DisturbanceGrid | None = None,
    ellipsoid: Ellipsoid = WGS84,
) -> NDArray[np.float64]:
    """Gravity vector in NED, exactly as loops see it with the same choice.

    Parameters
    ----------
    lat, lon : array_like
        Geodetic latitude and longitude, rad; shapes broadcast.
    h : array_like
        Height above the ellipsoid, m.
    gravity, disturbance, ellipsoid
        As for `gravity_field`.

    Returns
    -------
    ndarray, shape (..., 3)
        ``g_n``, m/s^2; NaN where `disturbance` is a grid that does not reach. A named model is
        its fit, within 1e-11 m/s^2 of its formula; `normal_gravity_n` is the closed form itself.

    Raises
    ------
    ValueError, TypeError
        As `gravity_field`.
    """
    field = gravity_field(gravity, disturbance, ellipsoid)
    rows = np.stack(np.broadcast_arrays(*(np.asarray(x, float) for x in (lat, lon, h))))
    out = np.empty((*rows.shape[1:], 3))
    lats, lons, heights = rows.reshape(3, -1)
    kernel_for(_gravity_rows, field)(
        ellipsoid.params, field, lats, lons, heights, out.reshape(-1, 3)
    )
    return out


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
