"""Frame n: velocity, position and attitude in north-east-down.

One step (docs/equations.md, section 3; Groves 2013, section 5.4, in increments):

1. predict the displacement with the gravity and Coriolis acceleration of the last step,
2. at the middle of the interval so found, take radii, Earth rate, gravity, and with the mean
   velocity transport rate and Coriolis acceleration,
3. step velocity, position and attitude with those.

A second evaluation would change the mean velocity too little to be made
(docs/decisions/0003-one-evaluation-per-step.md).
"""

from __future__ import annotations

import numpy as np

from earth._jit import formula, kernel
from earth.rates import earth_rate, transport_rate
from earth.rotation import cross, quat_rotate
from earth.summation import compensated_sum, compensated_sums
from earth.units import DEG
from navgrade.errors import NumericalError
from navgrade.mechanization.frame import Frame
from navgrade.mechanization.step import (
    FREE,
    attitude_after,
    corrected,
    predicted,
    to_middle,
    velocity_change,
    vertical_correction,
)
from navgrade.mechanization.terms import (
    Kept,
    Terms,
    kept_acceleration,
    kept_curvatures,
    kept_gravity,
    kept_rate,
)
from navgrade.mechanization.world import World
from navgrade.state import NavState

MAX_LATITUDE = 89.9 * DEG  # beyond it the transport rate about down outgrows the step
REACH = 1e-3  # rad from the anchor latitude

# What one block hands to the next: lat, lon, h, v (3), q (4), lost by the sums of lat, lon, h (3),
# and of the last interval's middle: acceleration (3), omega_in_n (3), angles per metre (2), the
# anchor latitude, its sine and cosine; length of the last interval; the acceleration error the
# vertical loop has found; lost by the sums of v (3).
_CARRY = 29


@formula
def sin_cos_near(x, anchor):
    """Return sine and cosine of a latitude, `x` rad from the anchor (latitude, sine, cosine).

    By the addition theorem, to rounding within `REACH`: a step moves so little that this spares
    it the two library calls it would wait for longest.
    """
    x2 = x * x
    sin_x = x * (1.0 - x2 * (1.0 / 6.0 - x2 * (1.0 / 120.0)))
    versine = x2 * (0.5 - x2 * (1.0 / 24.0 - x2 * (1.0 / 720.0)))
    return (
        anchor[1] + (anchor[2] * sin_x - anchor[1] * versine),
        anchor[2] - (anchor[1] * sin_x + anchor[2] * versine),
    )


@formula
def middle_latitude(lat, v, per_metre, dt):
    """Return the latitude in the middle of a step, rad, by the velocity at its start alone."""
    return lat + 0.5 * dt * v[0] * per_metre[0]


@formula
def surroundings(params, field, kept, sin_lat, cos_lat, lat, lon, h, v):
    """Return what the Earth does to a body at a place moving with `v` (NED).

    Acceleration g - (2 omega_ie + omega_en) x v, m/s^2; omega_in_n, rad/s; latitude per metre
    north and longitude per metre east. `kept` is None, or says which terms stay.
    """
    per_meridian, per_transverse = kept_curvatures(params, kept, sin_lat, h)
    per_cos = 1.0 / cos_lat
    ie_n, ie_d = earth_rate(params, sin_lat, cos_lat)
    en = transport_rate(v[0], v[1], sin_lat * per_cos, per_meridian, per_transverse)
    g = kept_gravity(params, field, kept, sin_lat, cos_lat, lat, lon, h)
    coriolis = cross((2.0 * ie_n + en[0], en[1], 2.0 * ie_d + en[2]), v)
    return (
        kept_acceleration(kept, g, coriolis),
        kept_rate(kept, ie_n, ie_d, en),
        (per_meridian, per_cos * per_transverse),
    )


@kernel
def propagate(
    params,
    field,
    channel,
    max_latitude,
    kept,
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
    """Step through a block; return the rows done, fewer than asked where frame n ends."""
    lat, lon, h = carry[0], carry[1], carry[2]
    v = (carry[3], carry[4], carry[5])
    q = (carry[6], carry[7], carry[8], carry[9])
    lost_lat, lost_lon, lost_h = carry[10], carry[11], carry[12]
    rest = (carry[13], carry[14], carry[15])
    rate = (carry[16], carry[17], carry[18])
    per_metre = (carry[19], carry[20])
    near = (carry[21], carry[22], carry[23])
    dt_before, bias = carry[24], carry[25]
    lost_v = (carry[26], carry[27], carry[28])
    n = dts.shape[0]
    k = 0
    while k < n:
        # outside the loop of steps: a call in it would cost every step, for the registers it claims
        if abs(middle_latitude(lat, v, per_metre, dts[k]) - near[0]) > REACH:
            near = (lat, np.sin(lat), np.cos(lat))
        first = k
        for k in range(first, n):
            dt = dts[k]
            middle_lat = middle_latitude(lat, v, per_metre, dt)
            x = middle_lat - near[0]
            if abs(x) > REACH and k > first:
                break
            sin_lat, cos_lat = sin_cos_near(x, near)
            per_dt = 1.0 / dt
            A = quat_rotate(q, (dvs[k, 0], dvs[k, 1], dvs[k, 2]))
            D = quat_rotate(q, (drs[k, 0], drs[k, 1], drs[k, 2]))
            W = cross(rate, A)
            moved = predicted(v, A, D, W, rest, dt)
            middle = to_middle(v, moved, dt)
            mean_v = (per_dt * moved[0], per_dt * moved[1], per_dt * moved[2])
            middle_lon = lon + middle[1] * per_metre[1]
            before = rest
            rest, rate, per_metre = surroundings(
                params, field, kept, sin_lat, cos_lat, middle_lat, middle_lon, h - middle[2], mean_v
            )
            moved = corrected(moved, rest, before, dt, dt_before)
            v, lost_v = compensated_sums(v, lost_v, velocity_change(A, D, W, rest, rate, dt))
            q = attitude_after(q, (phis[k, 0], phis[k, 1], phis[k, 2]), rate, dt)
            dt_before = dt

            lat, lost_lat = compensated_sum(lat, lost_lat, moved[0] * per_metre[0])
            lon, lost_lon = compensated_sum(lon, lost_lon, moved[1] * per_metre[1])
            h, lost_h = compensated_sum(h, lost_h, -moved[2])
            if channel.mode != FREE:
                dh, dv_down, bias = vertical_correction(channel, h, v[2], heights[k], bias, dt)
                h, lost_h = compensated_sum(h, lost_h, dh)
                v = (v[0], v[1], v[2] + dv_down)

            if lon > np.pi:
                lon -= 2.0 * np.pi
            elif lon < -np.pi:
                lon += 2.0 * np.pi
            if not abs(lat) <= max_latitude:
                carry[0] = lat
                return k
            lat_out[k] = lat
            lon_out[k] = lon
            h_out[k] = h
            v_out[k, 0] = v[0]
            v_out[k, 1] = v[1]
            v_out[k, 2] = v[2]
            q_out[k, 0] = q[0]
            q_out[k, 1] = q[1]
            q_out[k, 2] = q[2]
            q_out[k, 3] = q[3]
        else:
            k = n
    carry[0], carry[1], carry[2] = lat, lon, h
    carry[3], carry[4], carry[5] = v
    carry[6], carry[7], carry[8], carry[9] = q
    carry[10], carry[11], carry[12] = lost_lat, lost_lon, lost_h
    carry[13], carry[14], carry[15] = rest
    carry[16], carry[17], carry[18] = rate
    carry[19], carry[20] = per_metre
    carry[21], carry[22], carry[23] = near
    carry[24], carry[25] = dt_before, bias
    carry[26], carry[27], carry[28] = lost_v
    return n


class Ned(Frame):
    """Frame n; the parameters are those of every frame.

    Parameters
    ----------
    state : NavState
    world : World
    epoch_ns : int

    Raises
    ------
    NumericalError
        Within 0.1° of a pole, where frame n has no meaning.
    """

    def __init__(self, state: NavState, world: World, epoch_ns: int = 0) -> None:
        if abs(state.lat) > MAX_LATITUDE:
            raise _beyond(state.t, 0)
        v = world.start_velocity(state)
        sin_lat, cos_lat = np.sin(state.lat), np.cos(state.lat)
        kept = None
        if world.terms is not None and not all(world.terms):
            terms = Terms(*map(bool, world.terms))
            kept = Kept(terms, state.lat, float(sin_lat), float(cos_lat), state.h)
        carry = np.zeros(_CARRY)
        carry[:3] = state.lat, state.lon, state.h
        carry[3:6] = v
        carry[6:10] = state.q_nb
        carry[13:21] = np.concatenate(
            surroundings(
                world.params, world.field, kept, sin_lat, cos_lat, state.lat, state.lon, state.h, v
            )
        )
        carry[21:24] = state.lat, sin_lat, cos_lat
        super().__init__(world, epoch_ns, propagate, carry, MAX_LATITUDE, kept)

    def _stopped(self, t: float, row: int) -> NumericalError:
        return super()._stopped(t, row) if np.isnan(self._carry[0]) else _beyond(t, row)


def _beyond(t: float, row: int) -> NumericalError:
    return NumericalError(
        f"frame n ends at latitude ±89.9°, passed at {t:.3f} s; crossing a pole takes a frame "
        "without a north direction: w (wander azimuth) or e (Earth-fixed)",
        index=row,
        t=t,
    )
