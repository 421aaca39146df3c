"""A flat world that stands still: a plane with constant gravity, for comparison.

The world of robotics courses. Its axes are north, east and down at the start; with C = C_wb they
stay put, and

    r += v dt + C dr + 1/2 g dt^2      v += C dv + g dt      C <- C exp(phi x)

with g straight down, that of the field at the start. There is no Earth rate, no curvature, and no
change of gravity; what that costs is in docs/flat-world.md. With the body stages `euler`,
`midpoint` and `rk4` a step is the courses' own.

The attitude is a quaternion, or a matrix that every step brings back to orthogonal. The solution
is in the Earth's terms like any other, through the tangent plane as it lies: r_e = r_e0 + C_en0 r.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from earth._jit import formula, kernel
from earth.geodetic import ecef_from_geodetic
from earth.gravity import gravity
from earth.rotation import (
    cross,
    dcm_to_quat,
    quat_rotate,
    quat_to_dcm,
    rotation_factors,
)
from navgrade.mechanization.frame import Frame
from navgrade.mechanization.local import from_local, from_ned, local_directions, to_local
from navgrade.mechanization.step import attitude_after
from navgrade.mechanization.world import World
from navgrade.state import NavState

_STILL = (0.0, 0.0, 0.0)  # rad/s: the axes do not turn


class Start(NamedTuple):
    """Where the plane touches the Earth, for kernels."""

    g: float  # m/s^2, gravity of the plane
    r_e: tuple[float, float, float]  # m
    sin_lat: float
    cos_lat: float
    sin_lon: float
    cos_lon: float


@formula
def _moved(r, v, C_dv, C_dr, g, dt):
    """Return position and velocity after an interval."""
    fall = 0.5 * dt * dt * g
    return (
        (r[0] + v[0] * dt + C_dr[0], r[1] + v[1] * dt + C_dr[1], r[2] + v[2] * dt + C_dr[2] + fall),
        (v[0] + C_dv[0], v[1] + C_dv[1], v[2] + C_dv[2] + g * dt),
    )


@formula
def _times(row, v):
    return row[0] * v[0] + row[1] * v[1] + row[2] * v[2]


@formula
def matrix_turned(C, phi):
    """Return the rows of C exp(phi x), brought back to orthogonal to first order."""
    x2 = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    a, b = rotation_factors(x2)
    s = 1.0 - x2 * b
    x, y, z = (
        _row_turned(C[0], phi, s, a),
        _row_turned(C[1], phi, s, a),
        _row_turned(C[2], phi, s, a),
    )
    xy, xz, yz = -0.5 * _times(x, y), -0.5 * _times(x, z), -0.5 * _times(y, z)
    return (
        _row_sum(1.5 - 0.5 * _times(x, x), x, xy, y, xz, z),
        _row_sum(1.5 - 0.5 * _times(y, y), y, xy, x, yz, z),
        _row_sum(1.5 - 0.5 * _times(z, z), z, xz, x, yz, y),
    )


@formula
def _row_turned(row, phi, s, a):
    """Return exp(-phi x) row: a row times exp(phi x), as a column (Rodrigues)."""
    turn = cross(phi, row)
    turn2 = cross(phi, turn)
    return (
        row[0] - s * turn[0] + a * turn2[0],
        row[1] - s * turn[1] + a * turn2[1],
        row[2] - s * turn[2] + a * turn2[2],
    )


@formula
def _row_sum(p, x, q, y, r, z):
    return (
        p * x[0] + q * y[0] + r * z[0],
        p * x[1] + q * y[1] + r * z[1],
        p * x[2] + q * y[2] + r * z[2],
    )


@formula
def _in_earth_terms(params, start, r, v, q):
    """Return latitude, longitude, height, v_eb_n and q_nb."""
    _, r_e, sin_lat, cos_lat, sin_lon, cos_lon = start
    away = from_ned(sin_lat, cos_lat, sin_lon, cos_lon, r)
    v_e, q_eb = from_local(sin_lat, cos_lat, sin_lon, cos_lon, v, q)
    sin_lat, cos_lat, sin_lon, cos_lon, h = local_directions(
        params, (r_e[0] + away[0], r_e[1] + away[1], r_e[2] + away[2])
    )
    lat, lon, v_n, q_nb = to_local(sin_lat, cos_lat, sin_lon, cos_lon, v_e, q_eb)
    return lat, lon, h, v_n, q_nb


@kernel
def propagate(
    params,
    field,
    channel,
    start,
    dts,
    phis,
    dvs,
    drs,
    heights,
    carry,
    lat_out,
    lon_out,
    h_out,
    v_out,
    q_out,
):
    """Step through a block; return the rows done, fewer than asked where nothing finite is left."""
    r = (carry[0], carry[1], carry[2])
    v = (carry[3], carry[4], carry[5])
    q = (carry[6], carry[7], carry[8], carry[9])
    n = dts.shape[0]
    for k in range(n):
        C_dv = quat_rotate(q, (dvs[k, 0], dvs[k, 1], dvs[k, 2]))
        C_dr = quat_rotate(q, (drs[k, 0], drs[k, 1], drs[k, 2]))
        r, v = _moved(r, v, C_dv, C_dr, start.g, dts[k])
        q = attitude_after(q, (phis[k, 0], phis[k, 1], phis[k, 2]), _STILL, dts[k])
        lat, lon, h, v_n, q_nb = _in_earth_terms(params, start, r, v, q)
        if not h < np.inf:
            return k
        lat_out[k] = lat
        lon_out[k] = lon
        h_out[k] = h
        v_out[k, 0], v_out[k, 1], v_out[k, 2] = v_n
        q_out[k, 0], q_out[k, 1], q_out[k, 2], q_out[k, 3] = q_nb
    carry[0], carry[1], carry[2] = r
    carry[3], carry[4], carry[5] = v
    carry[6], carry[7], carry[8], carry[9] = q
    return n


@kernel
def propagate_matrix(
    params,
    field,
    channel,
    start,
    dts,
    phis,
    dvs,
    drs,
    heights,
    carry,
    lat_out,
    lon_out,
    h_out,
    v_out,
    q_out,
):
    """Step through a block with the attitude as a matrix; return the rows done."""
    r = (carry[0], carry[1], carry[2])
    v = (carry[3], carry[4], carry[5])
    C = (
        (carry[6], carry[7], carry[8]),
        (carry[9], carry[10], carry[11]),
        (carry[12], carry[13], carry[14]),
    )
    n = dts.shape[0]
    for k in range(n):
        dv = (dvs[k, 0], dvs[k, 1], dvs[k, 2])
        dr = (drs[k, 0], drs[k, 1], drs[k, 2])
        C_dv = (_times(C[0], dv), _times(C[1], dv), _times(C[2], dv))
        C_dr = (_times(C[0], dr), _times(C[1], dr), _times(C[2], dr))
        r, v = _moved(r, v, C_dv, C_dr, start.g, dts[k])
        C = matrix_turned(C, (phis[k, 0], phis[k, 1], phis[k, 2]))
        q = dcm_to_quat((*C[0], *C[1], *C[2]))
        lat, lon, h, v_n, q_nb = _in_earth_terms(params, start, r, v, q)
        if not h < np.inf:
            return k
        lat_out[k] = lat
        lon_out[k] = lon
        h_out[k] = h
        v_out[k, 0], v_out[k, 1], v_out[k, 2] = v_n
        q_out[k, 0], q_out[k, 1], q_out[k, 2], q_out[k, 3] = q_nb
    carry[0], carry[1], carry[2] = r
    carry[3], carry[4], carry[5] = v
    carry[6], carry[7], carry[8] = C[0]
    carry[9], carry[10], carry[11] = C[1]
    carry[12], carry[13], carry[14] = C[2]
    return n


class Flat(Frame):
    """The flat world's frame; its height is free.

    Parameters
    ----------
    matrix : bool
        Keep the attitude as a rotation matrix instead of a quaternion.
    state : NavState
    world : World
    epoch_ns : int
    """

    def __init__(self, matrix: bool, state: NavState, world: World, epoch_ns: int = 0) -> None:
        lat, lon, h = state.lat, state.lon, state.h
        sin_lat, cos_lat, sin_lon, cos_lon = (
            float(f(x)) for x in (lat, lon) for f in (np.sin, np.cos)
        )
        _, _, g_d = gravity(world.params, world.field, sin_lat, cos_lat, lat, lon, h)
        x, y, z = map(float, ecef_from_geodetic(world.params, lat, lon, h))
        start = Start(float(g_d), (x, y, z), sin_lat, cos_lat, sin_lon, cos_lon)
        loop: Callable[..., Any] = propagate_matrix if matrix else propagate
        attitude = quat_to_dcm(state.q_nb) if matrix else state.q_nb
        carry = np.concatenate([np.zeros(3), world.start_velocity(state), attitude])
        super().__init__(world, epoch_ns, loop, carry, start)
