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
from earth.geodetic import ecef_from_geodetic, meridian_plane
from earth.gravity import gravity, kernel_for, needs_place
from earth.rotation import quat_product, quat_rotate
from navgrade.imu import BodyIncrements
from navgrade.mechanization.local import direction, from_local, to_local
from navgrade.mechanization.step import (
    FREE,
    attitude_after,
    compensated_sum,
    displacement,
    to_middle,
    velocity_after,
    vertical_correction,
)
from navgrade.mechanization.world import World
from navgrade.state import Columns, NavState, Trajectory

# What one block hands to the next: r (3), v (3), q (4), lost by the sums of r (3), acceleration at
# the last interval's middle (3), its length, time since the start and lost by its sum, and the
# acceleration error the vertical loop has found.
_CARRY = 20


@formula
def _normal(params, r):
    """Return the local directions (sine and cosine of latitude and longitude) and the height."""
    rho = np.sqrt(r[0] * r[0] + r[1] * r[1])
    sin_lat, cos_lat, h = meridian_plane(params, rho, r[2])
    sin_lon, cos_lon = direction(rho, r[0], r[1])
    return sin_lat, cos_lat, sin_lon, cos_lon, h


@formula
def acceleration(params, field, spin, turned, r, v):
    """Return what acts beside the specific force at `r` moving with `v`, m/s^2.

    `turned` is the angle by which the Earth has turned in the frame.
    """
    sin_lat, cos_lat, sin_lon, cos_lon, h = _normal(params, r)
    lat, lon = 0.0, 0.0
    if needs_place(field):
        lat, lon = np.arctan2(sin_lat, cos_lat), np.arctan2(sin_lon, cos_lon) - turned
    g_n, g_e, g_d = gravity(params, field, sin_lat, cos_lat, lat, lon, h)
    out = -sin_lat * g_n - cos_lat * g_d
    excess = params.omega * params.omega - spin * spin
    return (
        cos_lon * out - sin_lon * g_e - excess * r[0] + 2.0 * spin * v[1],
        sin_lon * out + cos_lon * g_e - excess * r[1] - 2.0 * spin * v[0],
        cos_lat * g_n - sin_lat * g_d,
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
    lost_x, lost_y, lost_z = carry[10], carry[11], carry[12]
    rest = (carry[13], carry[14], carry[15])
    dt_before = carry[16]
    elapsed, lost_t = carry[17], carry[18]
    bias = carry[19]
    rate = (0.0, 0.0, spin)
    drift = params.omega - spin  # of the Earth in the frame
    n = dts.shape[0]
    for k in range(n):
        dt = dts[k]
        A = quat_rotate(q, (dvs[k, 0], dvs[k, 1], dvs[k, 2]))
        D = quat_rotate(q, (drs[k, 0], drs[k, 1], drs[k, 2]))
        moved = displacement(v, A, D, rest, rest, rate, dt, dt_before)
        middle = to_middle(v, moved, dt)
        before = rest
        rest = acceleration(
            params,
            field,
            spin,
            drift * (elapsed + 0.5 * dt),
            (r[0] + middle[0], r[1] + middle[1], r[2] + middle[2]),
            (moved[0] / dt, moved[1] / dt, moved[2] / dt),
        )
        moved = displacement(v, A, D, rest, before, rate, dt, dt_before)
        v = velocity_after(v, A, D, rest, rate, dt)
        q = attitude_after(q, (phis[k, 0], phis[k, 1], phis[k, 2]), rate, dt)
        dt_before = dt
        x, lost_x = compensated_sum(r[0], lost_x, moved[0])
        y, lost_y = compensated_sum(r[1], lost_y, moved[1])
        z, lost_z = compensated_sum(r[2], lost_z, moved[2])
        r = (x, y, z)
        elapsed, lost_t = compensated_sum(elapsed, lost_t, dt)

        sin_lat, cos_lat, sin_lon, cos_lon, h = _normal(params, r)
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
            x, lost_x = compensated_sum(r[0], lost_x, dh * up[0])
            y, lost_y = compensated_sum(r[1], lost_y, dh * up[1])
            z, lost_z = compensated_sum(r[2], lost_z, dh * up[2])
            r = (x, y, z)
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
    carry[10], carry[11], carry[12] = lost_x, lost_y, lost_z
    carry[13], carry[14], carry[15] = rest
    carry[16], carry[17], carry[18], carry[19] = dt_before, elapsed, lost_t, bias
    return n


class Cartesian:
    """Steps a state through body increments in frame e or i.

    Parameters
    ----------
    turns : bool
        Frame e turns with the Earth, frame i does not.
    state : NavState
    world : World
    epoch_ns : int
        Carried into the trajectories.
    """

    def __init__(self, turns: bool, state: NavState, world: World, epoch_ns: int = 0) -> None:
        self._world = world
        self._epoch_ns = epoch_ns
        self._rows = 0
        params = world.params
        self._spin = params.omega if turns else 0.0
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
        drift = params.omega - self._spin
        v = (v[0] - drift * r[1], v[1] + drift * r[0], v[2])
        self._carry = np.zeros(_CARRY)
        self._carry[:3] = r
        self._carry[3:6] = v
        self._carry[6:10] = q
        self._carry[13:16] = acceleration(params, world.field, self._spin, 0.0, r, v)

    def advance(self, increments: BodyIncrements, room: Columns | None = None) -> Trajectory:
        """Integrate a block, into `room` where given; the values do not depend on block ends."""
        n = len(increments)
        out = Columns.empty(n) if room is None else room
        heights, status = self._world.heights(increments)
        done = kernel_for(propagate, self._world.field)(
            self._world.params,
            self._world.field,
            self._world.channel,
            self._spin,
            increments.dt,
            increments.phi,
            increments.dv,
            increments.dr,
            heights,
            self._carry,
            *out,
        )
        if done < n:
            raise self._world.no_solution(increments.t[done], self._rows + done)
        self._rows += n
        return Trajectory.made(increments.t, out, status, self._epoch_ns)
