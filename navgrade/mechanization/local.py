"""From frames without a north direction to the solution's terms, and back."""

from __future__ import annotations

import numpy as np

from earth._jit import formula
from earth.frames import ned_to_ecef_quat
from earth.geodetic import meridian_plane
from earth.rotation import quat_product


@formula
def direction(rho, x, y):
    """Return sine and cosine of the angle of (x, y), of length `rho`; 0 and 1 for the length 0."""
    if rho > 0.0:
        return y / rho, x / rho
    return 0.0, 1.0


@formula
def local_directions(params, r):
    """Return sine and cosine of latitude and of the angle about the axis, and the height, m."""
    rho = np.sqrt(r[0] * r[0] + r[1] * r[1])
    sin_lat, cos_lat, h = meridian_plane(params, rho, r[2])
    sin_lon, cos_lon = direction(rho, r[0], r[1])
    return sin_lat, cos_lat, sin_lon, cos_lon, h


@formula
def to_local(sin_lat, cos_lat, sin_lon, cos_lon, v_e, q_eb):
    """Return latitude, longitude, v_eb_n and q_nb."""
    out = cos_lon * v_e[0] + sin_lon * v_e[1]  # away from the axis
    v_n = (
        cos_lat * v_e[2] - sin_lat * out,
        cos_lon * v_e[1] - sin_lon * v_e[0],
        -cos_lat * out - sin_lat * v_e[2],
    )
    w, x, y, z = ned_to_ecef_quat(sin_lat, cos_lat, sin_lon, cos_lon)
    q_nb = quat_product((w, -x, -y, -z), q_eb)
    return np.arctan2(sin_lat, cos_lat), np.arctan2(sin_lon, cos_lon), v_n, q_nb


@formula
def from_ned(sin_lat, cos_lat, sin_lon, cos_lon, v):
    """Return C_en v."""
    out = -sin_lat * v[0] - cos_lat * v[2]
    return (
        cos_lon * out - sin_lon * v[1],
        sin_lon * out + cos_lon * v[1],
        cos_lat * v[0] - sin_lat * v[2],
    )


@formula
def from_local(sin_lat, cos_lat, sin_lon, cos_lon, v_n, q_nb):
    """Return v_eb_e and q_eb."""
    v_e = from_ned(sin_lat, cos_lat, sin_lon, cos_lon, v_n)
    return v_e, quat_product(ned_to_ecef_quat(sin_lat, cos_lat, sin_lon, cos_lon), q_nb)
