"""Radii of curvature, and geodetic to Earth-fixed coordinates and back."""

from __future__ import annotations

import numpy as np
import pymap3d
from numpy.typing import ArrayLike, NDArray

from earth._jit import formula
from earth.ellipsoid import WGS84, Ellipsoid


@formula
def curvatures(params, sin_lat, h):
    """Return 1/(M + h) and 1/(N + h) of the meridian and transverse radius, 1/m."""
    w = 1.0 - params.e2 * sin_lat * sin_lat
    root = np.sqrt(w)
    cube = w * root
    return cube / (params.a * (1.0 - params.e2) + h * cube), root / (params.a + h * root)


@formula
def radii(params, sin_lat):
    """Return meridian and transverse radius of curvature, m."""
    per_meridian, per_transverse = curvatures(params, sin_lat, 0.0)
    return 1.0 / per_meridian, 1.0 / per_transverse


@formula
def ecef_from_geodetic(params, lat, lon, h):
    """Return x, y, z (m) of geodetic coordinates (rad, rad, m)."""
    sin_lat = np.sin(lat)
    _, transverse = radii(params, sin_lat)
    rho = (transverse + h) * np.cos(lat)
    return (
        rho * np.cos(lon),
        rho * np.sin(lon),
        (transverse * (1.0 - params.e2) + h) * sin_lat,
    )


@formula
def meridian_plane(params, rho, z):
    """Return sine and cosine of latitude, and height (m), `rho` off the axis and `z` north (m).

    Bowring's iteration (Survey Review 23 (1976) 323-327) on the reduced latitude, three rounds:
    from -100 km to geostationary height its own error is below rounding.
    """
    sin_beta, cos_beta = z * params.a, rho * params.b
    for _ in range(3):
        k = 1.0 / np.sqrt(sin_beta * sin_beta + cos_beta * cos_beta)
        sin_beta, cos_beta = k * sin_beta, k * cos_beta
        sin_lat = z + params.E * params.E / params.b * (sin_beta * sin_beta * sin_beta)
        cos_lat = rho - params.e2 * params.a * (cos_beta * cos_beta * cos_beta)
        sin_beta, cos_beta = params.b * sin_lat, params.a * cos_lat
    k = 1.0 / np.sqrt(sin_lat * sin_lat + cos_lat * cos_lat)
    sin_lat, cos_lat = k * sin_lat, k * cos_lat
    surface = params.a * np.sqrt(1.0 - params.e2 * sin_lat * sin_lat)
    return sin_lat, cos_lat, rho * cos_lat + z * sin_lat - surface


@formula
def geodetic_from_ecef(params, x, y, z):
    """Return latitude, longitude (rad) and height (m) of an Earth-fixed point."""
    sin_lat, cos_lat, h = meridian_plane(params, np.hypot(x, y), z)
    return np.arctan2(sin_lat, cos_lat), np.arctan2(y, x), h


def meridian_radius(lat: ArrayLike, ellipsoid: Ellipsoid = WGS84) -> NDArray[np.float64]:
    """Radius of curvature in the meridian, m, at geodetic latitude `lat` (rad), any shape.

    Accuracy: 4e-9 m at every latitude (`tests/earth/test_geodetic.py`).
    """
    meridian, _ = radii(ellipsoid.params, np.sin(lat))
    return np.asarray(meridian)


def transverse_radius(lat: ArrayLike, ellipsoid: Ellipsoid = WGS84) -> NDArray[np.float64]:
    """Radius of curvature in the prime vertical, m, at geodetic latitude `lat` (rad), any shape.

    Accuracy: 4e-9 m at every latitude (`tests/earth/test_geodetic.py`).
    """
    _, transverse = radii(ellipsoid.params, np.sin(lat))
    return np.asarray(transverse)


def _pymap3d_ellipsoid(ellipsoid: Ellipsoid) -> pymap3d.Ellipsoid:
    return pymap3d.Ellipsoid(ellipsoid.params.a, ellipsoid.params.b, ellipsoid.name)


def geodetic_to_ecef(
    lat: ArrayLike, lon: ArrayLike, h: ArrayLike, ellipsoid: Ellipsoid = WGS84
) -> NDArray[np.float64]:
    """Earth-fixed position of geodetic coordinates.

    Parameters
    ----------
    lat, lon : array_like
        Geodetic latitude and longitude, rad; shapes broadcast.
    h : array_like
        Height above the ellipsoid, m.
    ellipsoid : Ellipsoid

    Returns
    -------
    ndarray, shape (..., 3)
        ``r_eb_e``, m. Accuracy 1e-8 m within 100 km of the surface
        (`tests/earth/test_geodetic.py`).

    Raises
    ------
    ValueError
        If a latitude is outside ±pi/2.
    """
    lat = np.asarray(lat, float)
    if not np.all(np.abs(lat) <= np.pi / 2):
        raise ValueError("lat must be within ±pi/2 rad; degrees are not radians")
    xyz = pymap3d.geodetic2ecef(
        lat,
        np.asarray(lon, float),
        np.asarray(h, float),
        ell=_pymap3d_ellipsoid(ellipsoid),
        deg=False,
    )
    return np.stack(np.broadcast_arrays(*xyz), axis=-1)


def ecef_to_geodetic(
    r_eb_e: ArrayLike, ellipsoid: Ellipsoid = WGS84
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Geodetic coordinates of Earth-fixed positions.

    Parameters
    ----------
    r_eb_e : array_like, shape (..., 3)
        Position, m; from 100 km below the surface to geostationary height.
    ellipsoid : Ellipsoid

    Returns
    -------
    lat, lon, h : ndarray
        rad, rad, m. Accuracy 1e-8 m within 100 km of the surface, 2e-8 m at geostationary
        height (`tests/earth/test_geodetic.py`).
    """
    r = np.asarray(r_eb_e, float)
    lat, lon, h = geodetic_from_ecef(ellipsoid.params, r[..., 0], r[..., 1], r[..., 2])
    return np.asarray(lat), np.asarray(lon), np.asarray(h)
