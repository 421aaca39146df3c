"""Frame w, wander azimuth: level like frame n, but not turned to north.

The frame does not turn about the vertical relative to the Earth, so nothing in it grows near a
pole. Position is the quaternion q_ew and the height. With p = C_we z_e, the Earth's axis in w,
the horizontal velocity turns the frame by

    omega_ew = (K v)_y, -(K v)_x, 0      K = I/(N+h) + N e^2 / ((1 - e^2 sin^2 L)(M+h)(N+h)) p p'

for p p' of the horizontal components of p, which is the curvature of the ellipsoid in any azimuth
(docs/equations.md, section 3; Savage, Strapdown Analytics, 5.3). The step is that of frame n.
"""

from __future__ import annotations

import numpy as np

from earth._jit import formula, kernel
from earth.frames import ned_to_ecef_quat
from earth.geodetic import curvatures
from earth.gravity import gravity, needs_place
from earth.rotation import cross, quat_product, quat_rotate, rotvec_to_quat_change
from earth.summation import compensated_sum, compensated_sums
from navgrade.mechanization.frame import Frame
from navgrade.mechanization.local import direction, to_local
from navgrade.mechanization.step import (
    FREE,
    attitude_after,
    corrected,
    predicted,
    to_middle,
    velocity_change,
    vertical_correction,
)
from navgrade.mechanization.world import World
from navgrade.state import NavState

# What one block hands to the next: q_ew (4), h, v (3), q_wb (4), lost by the sums of q_ew and h
# (5), acceleration (3), omega_iw_w (3) and curvature (3) at the last interval's middle, its
# length, the acceleration error the vertical loop has found, lost by the sums of v (3).
_CARRY = 31


@formula
def _axis(q):
    """Return the Earth's axis in w, the last row of C_ew."""
    return (
        2.0 * (q[1] * q[3] - q[0] * q[2]),
        2.0 * (q[2] * q[3] + q[0] * q[1]),
        q[0] * q[0] - q[1] * q[1] - q[2] * q[2] + q[3] * q[3],
    )


@formula
def turn_of(curvature, moved):
    """Return the rotation of w that goes with a displacement, rad."""
    K_xx, K_xy, K_yy = curvature
    return (K_xy * moved[0] + K_yy * moved[1], -(K_xx * moved[0] + K_xy * moved[1]), 0.0)


@formula
def surroundings(params, field, p, up, h, v):
    """Return what the Earth does to a body where its axis is `p` in w, moving with `v`.

    Three triples: acceleration g - (2 omega_ie + omega_ew) x v, m/s^2; omega_iw_w, rad/s; the
    elements xx, xy, yy of the curvature, 1/m. `up` is the vertical in e.
    """
    sin_lat = -p[2]
    cos_lat = np.sqrt(p[0] * p[0] + p[1] * p[1])
    per_meridian, per_transverse = curvatures(params, sin_lat, h)
    # N e^2 / ((1 - e^2 sin^2 L) (M + h)(N + h)), with N / (N + h) = 1 - h / (N + h)
    k = (1.0 - h * per_transverse) * per_meridian
    k *= params.e2 / (1.0 - params.e2 * sin_lat * sin_lat)
    curvature = (
        per_transverse + k * p[0] * p[0],
        k * p[0] * p[1],
        per_transverse + k * p[1] * p[1],
    )
    ew = turn_of(curvature, v)
    ie = (params.omega * p[0], params.omega * p[1], params.omega * p[2])

    lat, lon = 0.0, 0.0
    if needs_place(field):
        lat, lon = np.arctan2(sin_lat, cos_lat), np.arctan2(up[1], up[0])
    g_n, g_e, g_d = gravity(params, field, sin_lat, cos_lat, lat, lon, h)
    north_y, north_x = direction(cos_lat, p[0], p[1])
    coriolis = cross((2.0 * ie[0] + ew[0], 2.0 * ie[1] + ew[1], 2.0 * ie[2]), v)
    return (
        (
            north_x * g_n - north_y * g_e - coriolis[0],
            north_y * g_n + north_x * g_e - coriolis[1],
            g_d - coriolis[2],
        ),
        (ie[0] + ew[0], ie[1] + ew[1], ie[2]),
        curvature,
    )


@kernel
def propagate(
    params,
    field,
    channel,
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
    place = (carry[0], carry[1], carry[2], carry[3])
    h = carry[4]
    v = (carry[5], carry[6], carry[7])
    q = (carry[8], carry[9], carry[10], carry[11])
    lost_0, lost_1, lost_2, lost_3 = carry[12], carry[13], carry[14], carry[15]
    lost_h = carry[16]
    rest = (carry[17], carry[18], carry[19])
    rate = (carry[20], carry[21], carry[22])
    curvature = (carry[23], carry[24], carry[25])
    dt_before, bias = carry[26], carry[27]
    lost_v = (carry[28], carry[29], carry[30])
    n = dts.shape[0]
    for k in range(n):
        dt = dts[k]
        per_dt = 1.0 / dt
        A = quat_rotate(q, (dvs[k, 0], dvs[k, 1], dvs[k, 2]))
        D = quat_rotate(q, (drs[k, 0], drs[k, 1], drs[k, 2]))
        W = cross(rate, A)
        moved = predicted(v, A, D, W, rest, dt)
        middle = to_middle(v, moved, dt)
        p = _axis(place)
        half_turn = turn_of(curvature, middle)
        step = cross(p, half_turn)
        up = (0.0, 0.0, 0.0)
        if needs_place(field):
            up = quat_rotate(place, (-half_turn[1], half_turn[0], -1.0))
        before = rest
        rest, rate, curvature = surroundings(
            params,
            field,
            (p[0] + step[0], p[1] + step[1], p[2] + step[2]),
            up,
            h - middle[2],
            (per_dt * moved[0], per_dt * moved[1], per_dt * moved[2]),
        )
        moved = corrected(moved, rest, before, dt, dt_before)
        v, lost_v = compensated_sums(v, lost_v, velocity_change(A, D, W, rest, rate, dt))
        q = attitude_after(q, (phis[k, 0], phis[k, 1], phis[k, 2]), rate, dt)
        dt_before = dt

        change = rotvec_to_quat_change(turn_of(curvature, moved))
        excess = 0.5 - 0.5 * (
            place[0] * place[0] + place[1] * place[1] + place[2] * place[2] + place[3] * place[3]
        )
        turn = quat_product(place, (change[0] + excess, change[1], change[2], change[3]))
        q0, lost_0 = compensated_sum(place[0], lost_0, turn[0])
        q1, lost_1 = compensated_sum(place[1], lost_1, turn[1])
        q2, lost_2 = compensated_sum(place[2], lost_2, turn[2])
        q3, lost_3 = compensated_sum(place[3], lost_3, turn[3])
        place = (q0, q1, q2, q3)
        h, lost_h = compensated_sum(h, lost_h, -moved[2])
        if channel.mode != FREE:
            dh, dv_down, bias = vertical_correction(channel, h, v[2], heights[k], bias, dt)
            h, lost_h = compensated_sum(h, lost_h, dh)
            v = (v[0], v[1], v[2] + dv_down)
        if not h < np.inf:
            return k

        up = quat_rotate(place, (0.0, 0.0, -1.0))
        cos_lat = np.sqrt(up[0] * up[0] + up[1] * up[1])
        sin_lon, cos_lon = direction(cos_lat, up[0], up[1])
        lat, lon, v_n, q_nb = to_local(
            up[2], cos_lat, sin_lon, cos_lon, quat_rotate(place, v), quat_product(place, q)
        )
        lat_out[k] = lat
        lon_out[k] = lon
        h_out[k] = h
        v_out[k, 0], v_out[k, 1], v_out[k, 2] = v_n
        q_out[k, 0], q_out[k, 1], q_out[k, 2], q_out[k, 3] = q_nb
    carry[0], carry[1], carry[2], carry[3] = place
    carry[4] = h
    carry[5], carry[6], carry[7] = v
    carry[8], carry[9], carry[10], carry[11] = q
    carry[12], carry[13], carry[14], carry[15] = lost_0, lost_1, lost_2, lost_3
    carry[16] = lost_h
    carry[17], carry[18], carry[19] = rest
    carry[20], carry[21], carry[22] = rate
    carry[23], carry[24], carry[25] = curvature
    carry[26], carry[27] = dt_before, bias
    carry[28], carry[29], carry[30] = lost_v
    return n


class Wander(Frame):
    """Frame w, which starts turned to north.

    Parameters
    ----------
    state : NavState
    world : World
    epoch_ns : int
    """

    def __init__(self, state: NavState, world: World, epoch_ns: int = 0) -> None:
        lat, lon = np.array([state.lat, state.lon])
        place = ned_to_ecef_quat(np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon))
        up = quat_rotate(place, (0.0, 0.0, -1.0))
        v = world.start_velocity(state)
        carry = np.zeros(_CARRY)
        carry[:4] = place
        carry[4] = state.h
        carry[5:8] = v
        carry[8:12] = state.q_nb
        carry[17:26] = np.concatenate(
            surroundings(world.params, world.field, _axis(place), up, state.h, v)
        )
        super().__init__(world, epoch_ns, propagate, carry)
