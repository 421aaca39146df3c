"""Rotation of the Earth and of the local-level frame, resolved in NED."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from earth._jit import formula
from earth.ellipsoid import WGS84, Ellipsoid
from earth.geodetic import curvatures


@formula
def earth_rate(params, sin_lat, cos_lat):
    """Return north and down components of omega_ie_n, rad/s."""
    return params.omega * cos_lat, -params.omega * sin_lat


@formula
def transport_rate(v_n, v_e, tan_lat, per_meridian, per_transverse):
    """Return north, east, down of omega_en_n, rad/s.

    The last two arguments are 1/(M + h) and 1/(N + h), 1/m. Groves (2013), 5.44.
    """
    north = v_e * per_transverse
    return north, -v_n * per_meridian, -north * tan_lat


def omega_ie_n(lat: ArrayLike, ellipsoid: Ellipsoid = WGS84) -> NDArray[np.float64]:
    """Rate of the Earth relative to inertial space, in NED, rad/s, shape (..., 3)."""
    lat = np.asarray(lat, float)
    north, down = earth_rate(ellipsoid.params, np.sin(lat), np.cos(lat))
    return np.stack([north, np.zeros_like(north), down], axis=-1)


def omega_en_n(
    lat: ArrayLike, h: ArrayLike, v_eb_n: ArrayLike, ellipsoid: Ellipsoid = WGS84
) -> NDArray[np.float64]:
    """Transport rate: NED relative to the Earth, in NED.

    Parameters
    ----------
    lat, h : array_like
        Geodetic latitude (rad) and height (m).
    v_eb_n : array_like, shape (..., 3)
        Velocity, m/s.
    ellipsoid : Ellipsoid

    Returns
    -------
    ndarray, shape (..., 3)
        rad/s. It grows as tan(lat) and has no limit at the poles.
    """
    lat, h, v = np.asarray(lat, float), np.asarray(h, float), np.asarray(v_eb_n, float)
    per_radius = curvatures(ellipsoid.params, np.sin(lat), h)
    rate = transport_rate(v[..., 0], v[..., 1], np.tan(lat), *per_radius)
    return np.stack(np.broadcast_arrays(*rate), axis=-1)


def omega_in_n(
    lat: ArrayLike, h: ArrayLike, v_eb_n: ArrayLike, ellipsoid: Ellipsoid = WGS84
) -> NDArray[np.float64]:
    """NED relative to inertial space, in NED, rad/s: Earth rate plus transport rate."""
    return omega_ie_n(lat, ellipsoid) + omega_en_n(lat, h, v_eb_n, ellipsoid)
