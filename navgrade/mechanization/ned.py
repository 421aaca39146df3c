"""Frame n: velocity, position and attitude in north-east-down.

One step (docs/equations.md, section 3; Groves 2013, section 5.4, in increments):

1. predict the velocity at the end with the gravity and Coriolis acceleration of the last step,
2. at the middle of the interval so found, take radii, Earth rate, transport rate and gravity,
3. step velocity, position by the trapezoid, and attitude with those.

The second evaluation would change the middle velocity by 1e-8 m/s, so it is not made, except at
the first step, which has no predecessor.
"""

from __future__ import annotations

import numpy as np

from earth._jit import formula, kernel
from earth.ellipsoid import WGS84, Ellipsoid
from earth.geodetic import radii
from earth.gravity import fitted_gravity, gravity_fit
from earth.rates import earth_rate, transport_rate
from earth.rotation import cross, quat_product, quat_rotate, rotvec_to_quat_change
from earth.units import DEG
from navgrade.errors import NumericalError
from navgrade.imu import BodyIncrements
from navgrade.state import Columns, NavState, Trajectory

MAX_LATITUDE = 89.9 * DEG  # beyond it the transport rate about down outgrows the step

# What one block hands to the next: lat, lon, h, v (3), q (4), lost by the sums of lat, lon, h (3),
# and of the last interval's middle: acceleration (3), omega_in_n (3), angles per metre (3), and
# the anchor latitude, its sine and cosine.
_CARRY = 25


@formula
def sin_cos_near(lat, near):
    """Return sine and cosine of `lat`, and the anchor (latitude, sine, cosine) they grew from.

    Within 1e-3 rad of the anchor by the addition theorem, to rounding; otherwise anew. A step
    moves so little that this spares it the two library calls it would wait for longest.
    """
    x = lat - near[0]
    if abs(x) > 1e-3:
        near = (lat, np.sin(lat), np.cos(lat))
        return near[1], near[2], near
    x2 = x * x
    sin_x = x * (1.0 - x2 * (1.0 / 6.0 - x2 * (1.0 / 120.0)))
    versine = x2 * (0.5 - x2 * (1.0 / 24.0 - x2 * (1.0 / 720.0)))
    return (
        near[1] + (near[2] * sin_x - near[1] * versine),
        near[2] - (near[1] * sin_x + near[2] * versine),
        near,
    )


@formula
def surroundings(params, fit, sin_lat, cos_lat, h, v):
    """Return what the Earth does to a body at a latitude and `h` moving with `v` (NED).

    Three triples: acceleration g - (2 omega_ie + omega_en) x v, m/s^2; omega_in_n, rad/s;
    latitude, longitude and height per metre north, east, down.
    """
    meridian, transverse = radii(params, sin_lat)
    per_meridian = 1.0 / (meridian + h)
    per_transverse = 1.0 / (transverse + h)
    per_cos = 1.0 / cos_lat
    ie_n, ie_d = earth_rate(params, sin_lat, cos_lat)
    en_n, en_e, en_d = transport_rate(v[0], v[1], sin_lat * per_cos, per_meridian, per_transverse)
    g_n, g_d = fitted_gravity(params, fit, sin_lat, cos_lat, h)
    coriolis = cross((2.0 * ie_n + en_n, en_e, 2.0 * ie_d + en_d), v)
    return (
        (g_n - coriolis[0], -coriolis[1], g_d - coriolis[2]),
        (ie_n + en_n, en_e, ie_d + en_d),
        (per_meridian, per_cos * per_transverse, -1.0),
    )


@formula
def velocity_after(v, f, rest, rate, dt):
    """Return v + (I - zeta x / 2) f + rest dt for the frame rotation zeta = rate dt."""
    turn = cross(rate, f)
    half = 0.5 * dt
    return (
        v[0] + (f[0] - half * turn[0]) + rest[0] * dt,
        v[1] + (f[1] - half * turn[1]) + rest[1] * dt,
        v[2] + (f[2] - half * turn[2]) + rest[2] * dt,
    )


@formula
def compensated_sum(total, lost, term):
    """Kahan's step: return the new sum and what it lost."""
    y = term - lost
    new = total + y
    return new, (new - total) - y


@kernel
def propagate(
    params, fit, hold, max_latitude, dts, phis, dvs, carry, lat_out, lon_out, h_out, v_out, q_out
):
    """Step through a block; return the rows done, fewer than asked beyond `max_latitude`."""
    lat, lon, h = carry[0], carry[1], carry[2]
    v = (carry[3], carry[4], carry[5])
    q = (carry[6], carry[7], carry[8], carry[9])
    lost_lat, lost_lon, lost_h = carry[10], carry[11], carry[12]
    rest = (carry[13], carry[14], carry[15])
    rate = (carry[16], carry[17], carry[18])
    per_metre = (carry[19], carry[20], carry[21])
    near = (carry[22], carry[23], carry[24])
    n = dts.shape[0]
    for k in range(n):
        dt = dts[k]
        f = quat_rotate(q, (dvs[k, 0], dvs[k, 1], dvs[k, 2]))
        ahead = velocity_after(v, f, rest, rate, dt)
        if hold:
            ahead = (ahead[0], ahead[1], 0.0)
        middle_v = (0.5 * (v[0] + ahead[0]), 0.5 * (v[1] + ahead[1]), 0.5 * (v[2] + ahead[2]))
        middle_lat = lat + 0.5 * dt * v[0] * per_metre[0]
        middle_h = h + 0.125 * dt * (3.0 * v[2] + ahead[2]) * per_metre[2]
        sin_lat, cos_lat, near = sin_cos_near(middle_lat, near)
        rest, rate, per_metre = surroundings(params, fit, sin_lat, cos_lat, middle_h, middle_v)
        new = velocity_after(v, f, rest, rate, dt)
        if hold:
            new = (new[0], new[1], 0.0)

        half = 0.5 * dt
        lat, lost_lat = compensated_sum(lat, lost_lat, half * (v[0] + new[0]) * per_metre[0])
        lon, lost_lon = compensated_sum(lon, lost_lon, half * (v[1] + new[1]) * per_metre[1])
        h, lost_h = compensated_sum(h, lost_h, half * (v[2] + new[2]) * per_metre[2])
        if lon > np.pi:
            lon -= 2.0 * np.pi
        elif lon < -np.pi:
            lon += 2.0 * np.pi
        v = new

        # q_new = frame * q * body; the small changes are formed first, so they keep their digits
        body = rotvec_to_quat_change((phis[k, 0], phis[k, 1], phis[k, 2]))
        frame = rotvec_to_quat_change((-dt * rate[0], -dt * rate[1], -dt * rate[2]))
        excess = 0.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        turn = quat_product(q, (body[0] + excess, body[1], body[2], body[3]))
        half_way = (q[0] + turn[0], q[1] + turn[1], q[2] + turn[2], q[3] + turn[3])
        drag = quat_product(frame, half_way)
        q = (
            half_way[0] + drag[0],
            half_way[1] + drag[1],
            half_way[2] + drag[2],
            half_way[3] + drag[3],
        )

        if not abs(lat) <= max_latitude:
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
    carry[0], carry[1], carry[2] = lat, lon, h
    carry[3], carry[4], carry[5] = v
    carry[6], carry[7], carry[8], carry[9] = q
    carry[10], carry[11], carry[12] = lost_lat, lost_lon, lost_h
    carry[13], carry[14], carry[15] = rest
    carry[16], carry[17], carry[18] = rate
    carry[19], carry[20], carry[21] = per_metre
    carry[22], carry[23], carry[24] = near
    return n


class Ned:
    """Steps a state through body increments in frame n.

    Parameters
    ----------
    state : NavState
    vertical : {"free", "hold"}
        ``hold`` keeps the height and a zero vertical velocity.
    ellipsoid : Ellipsoid
    epoch_ns : int
        Carried into the trajectories.

    Raises
    ------
    NumericalError
        Within 0.1° of a pole, where frame n has no meaning.
    """

    def __init__(
        self,
        state: NavState,
        *,
        vertical: str = "free",
        ellipsoid: Ellipsoid = WGS84,
        epoch_ns: int = 0,
    ) -> None:
        self._params = ellipsoid.params
        self._fit = gravity_fit(ellipsoid)
        self._hold = vertical == "hold"
        self._epoch_ns = epoch_ns
        self._rows = 0
        if abs(state.lat) > MAX_LATITUDE:
            raise self._too_far_north(state.t)
        v = np.array(state.v_eb_n)
        if self._hold:
            v[2] = 0.0
        self._carry = np.zeros(_CARRY)
        self._carry[:3] = state.lat, state.lon, state.h
        self._carry[3:6] = v
        self._carry[6:10] = state.q_nb
        sin_lat, cos_lat = np.sin(state.lat), np.cos(state.lat)
        self._carry[13:22] = np.concatenate(
            surroundings(self._params, self._fit, sin_lat, cos_lat, state.h, v)
        )
        self._carry[22:25] = state.lat, sin_lat, cos_lat

    def advance(self, increments: BodyIncrements, room: Columns | None = None) -> Trajectory:
        """Integrate a block, into `room` where given; the values do not depend on block ends."""
        n = len(increments)
        out = Columns.empty(n) if room is None else room
        done = propagate(
            self._params,
            self._fit,
            self._hold,
            MAX_LATITUDE,
            increments.dt,
            increments.phi,
            increments.dv,
            self._carry,
            *out,
        )
        if done < n:
            raise self._too_far_north(float(increments.t[done]), self._rows + done)
        self._rows += n
        return Trajectory.made(increments.t, out, increments.status, self._epoch_ns)

    @staticmethod
    def _too_far_north(t: float, index: int = 0) -> NumericalError:
        return NumericalError(
            f"frame n ends at latitude ±89.9°, passed at {t:.3f} s; crossing a pole takes a frame "
            "without a north direction: e (Earth-fixed) or w (wander azimuth), planned, not here "
            "yet",
            index=index,
            t=t,
        )
