"""Frames e and i: Cartesian position, velocity and attitude, with no singularity anywhere.

Frame e is Earth-fixed; frame i agrees with it at the start and does not turn. Both obey

    dv/dt = C f + g - (omega_ie^2 - spin^2) (x, y, 0) - 2 spin z x v

with spin the frame's own rate about the Earth's axis: omega_ie, or 0, where the middle term turns
gravity into gravitation (docs/equations.md, section 3; Groves 2013, sections 5.2 and 5.3). The
step is that of frame n; gravity is taken at the middle of the interval.
"""

from __future__ import annotations

import numpy as np

from earth._jit import formula, kernel
from earth.geodetic import ecef_from_geodetic
from earth.gravity import gravity, needs_place
from earth.rotation import cross, quat_product, quat_rotate
from earth.summation import compensated_sum, compensated_sums
from navgrade.mechanization.frame import Frame
from navgrade.mechanization.local import from_local, from_ned, local_directions, to_local
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

# What one block hands to the next: r (3), v (3), q (4), lost by the sums of r (3), acceleration at
# the last interval's middle (3), its length, time since the start and lost by its sum, the
# acceleration error the vertical loop has found, lost by the sums of v (3).
_CARRY = 23


@formula
def acceleration(params, field, spin, turned, r, v):
    """Return what acts beside the specific force at `r` moving with `v`, m/s^2.

    `turned` is the angle by which the Earth has turned in the frame.
    """
    sin_lat, cos_lat, sin_lon, cos_lon, h = local_directions(params, r)
    lat, lon = 0.0, 0.0
    if needs_place(field):
        lat, lon = np.arctan2(sin_lat, cos_lat), np.arctan2(sin_lon, cos_lon) - turned
    g_n = gravity(params, field, sin_lat, cos_lat, lat, lon, h)
    g = from_ned(sin_lat, cos_lat, sin_lon, cos_lon, g_n)
    excess = params.omega * params.omega - spin * spin
    return (
        g[0] - excess * r[0] + 2.0 * spin * v[1],
        g[1] - excess * r[1] - 2.0 * spin * v[0],
        g[2],
    )


@kernel
def propagate(
    params,
    field,
    channel,
    spin,
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
    lost_r = (carry[10], carry[11], carry[12])
    rest = (carry[13], carry[14], carry[15])
    dt_before = carry[16]
    elapsed, lost_t = carry[17], carry[18]
    bias = carry[19]
    lost_v = (carry[20], carry[21], carry[22])
    rate = (0.0, 0.0, spin)
    drift = params.omega - spin  # of the Earth in the frame
    n = dts.shape[0]
    for k in range(n):
        dt = dts[k]
        per_dt = 1.0 / dt
        A = quat_rotate(q, (dvs[k, 0], dvs[k, 1], dvs[k, 2]))
        D = quat_rotate(q, (drs[k, 0], drs[k, 1], drs[k, 2]))
        W = cross(rate, A)
        moved = predicted(v, A, D, W, rest, dt)
        middle = to_middle(v, moved, dt)
        before = rest
        rest = acceleration(
            params,
            field,
            spin,
            drift * (elapsed + 0.5 * dt),
            (r[0] + middle[0], r[1] + middle[1], r[2] + middle[2]),
            (per_dt * moved[0], per_dt * moved[1], per_dt * moved[2]),
        )
        moved = corrected(moved, rest, before, dt, dt_before)
        v, lost_v = compensated_sums(v, lost_v, velocity_change(A, D, W, rest, rate, dt))
        q = attitude_after(q, (phis[k, 0], phis[k, 1], phis[k, 2]), rate, dt)
        dt_before = dt
        r, lost_r = compensated_sums(r, lost_r, moved)
        elapsed, lost_t = compensated_sum(elapsed, lost_t, dt)

        sin_lat, cos_lat, sin_lon, cos_lon, h = local_directions(params, r)
        if channel.mode != FREE:
            up = (cos_lat * cos_lon, cos_lat * sin_lon, sin_lat)
            v_down = -(up[0] * v[0] + up[1] * v[1] + up[2] * v[2])
            dh, dv, bias = vertical_correction(channel, h, v_down, heights[k], bias, dt)
            carried = drift * dh  # a new place in the frame moves with the Earth
            v = (
                v[0] - dv * up[0] - carried * up[1],
                v[1] - dv * up[1] + carried * up[0],
                v[2] - dv * up[2],
            )
            r, lost_r = compensated_sums(r, lost_r, (dh * up[0], dh * up[1], dh * up[2]))
            h += dh
        if not h < np.inf:
            return k

        v_e, q_eb = v, q
        if drift != 0.0:
            angle = drift * elapsed
            c, s = np.cos(angle), np.sin(angle)
            v_x, v_y = v[0] + drift * r[1], v[1] - drift * r[0]
            v_e = (c * v_x + s * v_y, c * v_y - s * v_x, v[2])
            q_eb = quat_product((np.cos(0.5 * angle), 0.0, 0.0, -np.sin(0.5 * angle)), q)
            sin_lon, cos_lon = c * sin_lon - s * cos_lon, c * cos_lon + s * sin_lon
        lat, lon, v_n, q_nb = to_local(sin_lat, cos_lat, sin_lon, cos_lon, v_e, q_eb)
        lat_out[k] = lat
        lon_out[k] = lon
        h_out[k] = h
        v_out[k, 0], v_out[k, 1], v_out[k, 2] = v_n
        q_out[k, 0], q_out[k, 1], q_out[k, 2], q_out[k, 3] = q_nb
    carry[0], carry[1], carry[2] = r
    carry[3], carry[4], carry[5] = v
    carry[6], carry[7], carry[8], carry[9] = q
    carry[10], carry[11], carry[12] = lost_r
    carry[13], carry[14], carry[15] = rest
    carry[16], carry[17], carry[18], carry[19] = dt_before, elapsed, lost_t, bias
    carry[20], carry[21], carry[22] = lost_v
    return n


class Cartesian(Frame):
    """Frame e, which turns with the Earth, or frame i, which does not.

    Parameters
    ----------
    turns : bool
    state : NavState
    world : World
    epoch_ns : int
    """

    def __init__(self, turns: bool, state: NavState, world: World, epoch_ns: int = 0) -> None:
        params = world.params
        spin = params.omega if turns else 0.0
        lat, lon = np.array([state.lat, state.lon])
        v, q = from_local(
            np.sin(lat),
            np.cos(lat),
            np.sin(lon),
            np.cos(lon),
            world.start_velocity(state),
            state.q_nb,
        )
        r = ecef_from_geodetic(params, lat, lon, state.h)
        drift = params.omega - spin
        v = (v[0] - drift * r[1], v[1] + drift * r[0], v[2])
        carry = np.zeros(_CARRY)
        carry[:3] = r
        carry[3:6] = v
        carry[6:10] = q
        carry[13:16] = acceleration(params, world.field, spin, 0.0, r, v)
        super().__init__(world, epoch_ns, propagate, carry, spin)
