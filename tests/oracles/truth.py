"""Closed-form motion over the WGS-84 ellipsoid and what an ideal IMU feels on it.

Each coordinate is a constant, a rate and sinusoids, so rates follow without approximation:
omega_ib_b = omega_nb_b + C_bn (omega_ie_n + omega_en_n) and
f_ib_b = C_bn (vdot_n + (2 omega_ie_n + omega_en_n) x v_eb_n - g_n).
Increments are Gauss-Legendre integrals of these.

Phases w t are carried to twice double precision. Rounded to a double (1e-11 rad at one hour and
10 Hz) they would add a random walk of 1e-13 rad to the attitude, 0.5 um of position.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tests.oracles.constants import E2, EQUATORIAL_RADIUS, OMEGA
from tests.oracles.gravity import zonal_from_trig

Array = NDArray[np.float64]
Timed = tuple[Array, Array, Array]  # a value, its first and its second derivative in time

_BLOCK = 8192  # nodes evaluated at once: the working arrays of a block stay in cache
_MAX_NODES = 24
DEG = math.pi / 180.0  # rad


@dataclass(frozen=True)
class Sinusoid:
    """amplitude * sin(angular_frequency * t + phase)."""

    amplitude: float
    angular_frequency: float  # rad/s
    phase: float = 0.0  # rad


@dataclass(frozen=True)
class Coordinate:
    """constant + rate * t + sinusoids."""

    constant: float
    rate: float = 0.0
    sinusoids: tuple[Sinusoid, ...] = ()


@dataclass(frozen=True)
class SmoothStart:
    """A clock tau(t) that stands at 0 for `t_still` and then starts smoothly.

    Its rate rises from 0 to 1 over `t_ramp` by the ninth-degree smooth step, so tau has five
    continuous derivatives; from then on tau = t - t_still - t_ramp / 2.
    """

    t_still: float  # s
    t_ramp: float  # s


@dataclass(frozen=True)
class State:
    """True state at `t`; heading in [0, 2 pi), scalar part of q_nb not negative."""

    t: Array
    lat: Array
    lon: Array
    h: Array
    v_eb_n: Array
    roll: Array
    pitch: Array
    heading: Array
    q_nb: Array
    C_nb: Array


@dataclass(frozen=True)
class Rates:
    """True angular rate (rad/s) and specific force (m/s^2) at `t`."""

    t: Array
    omega_ib_b: Array
    f_ib_b: Array


@dataclass(frozen=True)
class Increments:
    """Integrals of omega_ib_b (rad) and f_ib_b (m/s) over intervals of `dt` seconds to `t`."""

    t: Array
    dt: Array
    dtheta: Array
    dvel: Array


class ClosedForm:
    """A motion whose rates are known at any time, and what an ideal IMU counts on it."""

    def fill_rates(self, t: Array, t_low: Array, out: Array) -> None:
        """Write omega_ib_b, then f_ib_b, at t + t_low along the first axis of `out`."""
        raise NotImplementedError

    def fastest(self) -> float:
        """Angular frequency of the fastest part, rad/s."""
        raise NotImplementedError

    def rates(self, t: ArrayLike) -> Rates:
        """What an ideal IMU feels at each time."""
        t = np.atleast_1d(np.asarray(t, dtype=np.float64))
        out = np.empty((6, t.size))
        self.fill_rates(t, np.zeros(1), out)
        return Rates(t, np.ascontiguousarray(out[:3].T), np.ascontiguousarray(out[3:].T))

    def increments(self, edges: ArrayLike, nodes: int | None = None) -> Increments:
        """Integrals over [edges[k], edges[k + 1]] with `nodes` Gauss points in each interval."""
        edges = np.asarray(edges, dtype=np.float64)
        dt = np.diff(edges)
        if edges.ndim != 1 or dt.size == 0 or not np.all(dt > 0.0):
            raise ValueError("edges must be two or more increasing times in seconds")
        x, w = np.polynomial.legendre.leggauss(nodes or self.nodes_for(float(dt.max())))
        fraction, weight = 0.5 * (1.0 + x), 0.5 * w
        out = np.empty((6, dt.size))
        step = max(1, _BLOCK // x.size)
        for first in range(0, dt.size, step):
            part = slice(first, min(first + step, dt.size))
            t, t_low = two_sum(edges[part], np.multiply.outer(fraction, dt[part]))
            values = np.empty((6, *t.shape))
            self.fill_rates(t, t_low, values)
            np.multiply(weight @ values, dt[part], out=out[:, part])
        dtheta, dvel = np.ascontiguousarray(out[:3].T), np.ascontiguousarray(out[3:].T)
        return Increments(edges[1:].copy(), dt, dtheta, dvel)

    def nodes_for(self, dt: float) -> int:
        """Fewest Gauss points whose error over an interval of `dt` is below round-off.

        The remainder for sin(w t) is (w dt)^2n n!^4 / ((2n + 1) (2n)!^3); w is taken as four
        times the fastest sinusoid, since products of sinusoids make overtones.
        """
        w = 4.0 * self.fastest()
        for n in range(2, _MAX_NODES + 1):
            remainder = math.factorial(n) ** 4 / ((2 * n + 1) * math.factorial(2 * n) ** 3)
            if (w * dt) ** (2 * n) * remainder < 1e-18:
                return n
        raise ValueError(f"dt = {dt} s is too long for this motion; shorten it or pass nodes")


@dataclass(frozen=True)
class Motion(ClosedForm):
    """Latitude, longitude (rad), height (m) and ZYX Euler angles (rad) as functions of time."""

    lat: Coordinate
    lon: Coordinate
    h: Coordinate
    roll: Coordinate
    pitch: Coordinate
    heading: Coordinate
    start: SmoothStart | None = None

    def state(self, t: ArrayLike) -> State:
        """True navigation state at each time."""
        t = np.atleast_1d(np.asarray(t, dtype=np.float64))
        (lat, lat1), (lon, lon1), (h, h1), *attitude = (
            (np.broadcast_to(x, t.shape), x1) for x, x1, _ in self._coordinates(t, np.zeros(1))
        )
        meridian, transverse, _ = radii(np.sin(lat))
        roll, pitch, heading = (angle for angle, _ in attitude)
        v_eb_n = np.empty((t.size, 3))
        v_eb_n[:, 0] = (meridian + h) * lat1
        v_eb_n[:, 1] = (transverse + h) * np.cos(lat) * lon1
        v_eb_n[:, 2] = -h1
        q_nb = quaternion(roll, pitch, heading)
        C_nb = matrix(roll, pitch, heading)
        heading = np.mod(heading, 2.0 * math.pi)
        return State(t, lat, lon, h, v_eb_n, roll, pitch, heading, q_nb, C_nb)

    def fastest(self) -> float:
        """Angular frequency of the fastest sinusoid or of the start, rad/s."""
        w = fastest_wave(self._all())
        return w if self.start is None else max(w, 10.0 / self.start.t_ramp)

    def _all(self) -> tuple[Coordinate, ...]:
        return self.lat, self.lon, self.h, self.roll, self.pitch, self.heading

    def _coordinates(self, t: Array, t_low: Array) -> list[Timed]:
        """Value, first and second derivative of each coordinate at t + t_low."""
        if self.start is None:
            return on_clock(self._all(), t, t_low)
        tau, tau_low, tau1, tau2 = _smooth_start(self.start, t, t_low)
        return [
            (x, x1 * tau1, x2 * tau1 * tau1 + x1 * tau2)
            for x, x1, x2 in on_clock(self._all(), tau, tau_low)
        ]

    def fill_rates(self, t: Array, t_low: Array, out: Array) -> None:
        """Write omega_ib_b, then f_ib_b, at t + t_low along the first axis of `out`."""
        lat_, lon_, h_, roll_, pitch_, heading_ = self._coordinates(t, t_low)
        (lat, lat1, lat2), (_, lon1, lon2), (h, h1, h2) = lat_, lon_, h_
        s, c = np.sin(lat), np.cos(lat)
        meridian, transverse, slope = radii(s)
        slope = slope * c * lat1  # of ln N in time; that of ln M is three times as large
        r_m, r_n = meridian + h, transverse + h
        v_n, v_e, v_d = r_m * lat1, r_n * c * lon1, -h1
        v_n1 = r_m * lat2 + (3.0 * slope * meridian + h1) * lat1
        v_e1 = r_n * (c * lon2 - s * lat1 * lon1) + (slope * transverse + h1) * c * lon1
        gravity = zonal_from_trig(s, c, h)

        spin = lon1 + 2.0 * OMEGA
        w_n, w_e, w_d = spin * c, -lat1, -spin * s
        f_n = v_n1 + (w_e * v_d - w_d * v_e) - gravity.north
        f_e = v_e1 + (w_d * v_n - w_n * v_d)
        f_d = -h2 + (w_n * v_e - w_e * v_n) - gravity.down
        spin = lon1 + OMEGA

        omega_in = spin * c, -lat1, -spin * s
        write_rates(omega_in, (f_n, f_e, f_d), (roll_, pitch_, heading_), out)


def write_rates(
    omega: tuple[Array, Array, Array],
    force: tuple[Array, Array, Array],
    angles: tuple[Timed, Timed, Timed],
    out: Array,
) -> None:
    """Write omega_ib_b and f_ib_b from what is known in the axes the Euler angles start from.

    `omega` is the inertial rate of these axes, `angles` roll, pitch and heading.
    """
    (roll, roll1, _), (pitch, pitch1, _), (heading, heading1, _) = angles
    sr, cr = np.sin(roll), np.cos(roll)
    sp, cp = np.sin(pitch), np.cos(pitch)
    sh, ch = np.sin(heading), np.cos(heading)

    def to_body(x: Array, y: Array, z: Array) -> tuple[Array, Array, Array]:
        x, y = ch * x + sh * y, ch * y - sh * x
        x, z = cp * x - sp * z, sp * x + cp * z
        return x, cr * y + sr * z, cr * z - sr * y

    x, y, z = to_body(*omega)
    out[0] = x + (roll1 - heading1 * sp)
    out[1] = y + (pitch1 * cr + heading1 * cp * sr)
    out[2] = z + (heading1 * cp * cr - pitch1 * sr)
    out[3], out[4], out[5] = to_body(*force)


def two_sum(a: Array, b: Array) -> tuple[Array, Array]:
    """Return a + b as its rounded value and the exact remainder (Knuth)."""
    total = a + b
    b_part = total - a
    return total, (a - (total - b_part)) + (b - b_part)


def _split(a: Array) -> tuple[Array, Array]:
    """A number as a sum of two with half the bits (Veltkamp)."""
    scaled = a * 134217729.0  # 2^27 + 1
    high = scaled - (scaled - a)
    return high, a - high


def fastest_wave(coordinates: tuple[Coordinate, ...]) -> float:
    """Angular frequency of the fastest sinusoid, rad/s."""
    return max((s.angular_frequency for c in coordinates for s in c.sinusoids), default=0.0)


def on_clock(coordinates: tuple[Coordinate, ...], t: Array, t_low: Array) -> list[Timed]:
    """Value, first and second derivative of each coordinate at t + t_low."""
    t_a, t_b = _split(t)
    waves: dict[float, tuple[Array, Array]] = {}
    for w in {s.angular_frequency: 0 for c in coordinates for s in c.sinusoids}:
        w_a, w_b = _split(np.asarray(w))
        phase = w * t
        rest = w_a * t_a - phase + w_a * t_b + w_b * t_a + w_b * t_b + w * t_low
        sin, cos = np.sin(phase), np.cos(phase)
        waves[w] = sin + rest * cos, cos - rest * sin

    result = []
    for coordinate in coordinates:
        x, x1, x2 = (np.asarray(v) for v in (coordinate.constant, coordinate.rate, 0.0))
        if coordinate.rate:
            x = x + coordinate.rate * t
        for s in coordinate.sinusoids:
            w, (sin, cos) = s.angular_frequency, waves[s.angular_frequency]
            in_phase, quadrature = s.amplitude * math.cos(s.phase), s.amplitude * math.sin(s.phase)
            wave = in_phase * sin + quadrature * cos
            x = x + wave
            x1 = x1 + ((w * in_phase) * cos - (w * quadrature) * sin)
            x2 = x2 - (w * w) * wave
        result.append((x, x1, x2))
    return result


def _smooth_start(start: SmoothStart, t: Array, t_low: Array) -> tuple[Array, Array, Array, Array]:
    """tau, its low part, first and second derivative."""
    elapsed = (t - start.t_still) + t_low
    u = np.clip(elapsed / start.t_ramp, 0.0, 1.0)
    late = u > 0.5
    v = np.where(late, 1.0 - u, u)
    rate = v**5 * (126.0 + v * (-420.0 + v * (540.0 + v * (-315.0 + v * 70.0))))
    area = v**6 * (21.0 + v * (-60.0 + v * (67.5 + v * (-35.0 + v * 7.0))))
    tau = start.t_ramp * area + np.where(late, elapsed - 0.5 * start.t_ramp, 0.0)
    driving = u >= 1.0
    cruise, cruise_low = two_sum(t, np.asarray(-start.t_still - 0.5 * start.t_ramp))
    tau_low = np.where(driving, cruise_low + t_low, 0.0)
    tau2 = 630.0 / start.t_ramp * (v * (1.0 - v)) ** 4
    return np.where(driving, cruise, tau), tau_low, np.where(late, 1.0 - rate, rate), tau2


def radii(sin_lat: Array) -> tuple[Array, Array, Array]:
    """Meridian and transverse radius, and d ln(transverse) / d sin(lat)."""
    w2 = 1.0 - E2 * sin_lat * sin_lat
    transverse = EQUATORIAL_RADIUS / np.sqrt(w2)
    return transverse * (1.0 - E2) / w2, transverse, E2 * sin_lat / w2


def ecef(lat: Array, lon: Array, h: Array) -> Array:
    """Earth-fixed position of geodetic coordinates, one row per point; rounded to 3 nm."""
    sin_lat, cos_lat = np.sin(lat), np.cos(lat)
    _, transverse, _ = radii(sin_lat)
    rho = (transverse + h) * cos_lat
    z = (transverse * (1.0 - E2) + h) * sin_lat
    return np.stack([rho * np.cos(lon), rho * np.sin(lon), z], axis=-1)


def quaternion(roll: Array, pitch: Array, heading: Array) -> Array:
    """Unit quaternion of Rz(heading) Ry(pitch) Rx(roll), scalar part not negative."""
    sr, cr = np.sin(0.5 * roll), np.cos(0.5 * roll)
    sp, cp = np.sin(0.5 * pitch), np.cos(0.5 * pitch)
    sh, ch = np.sin(0.5 * heading), np.cos(0.5 * heading)
    q = np.empty((roll.size, 4))
    q[:, 0] = ch * cp * cr + sh * sp * sr
    q[:, 1] = ch * cp * sr - sh * sp * cr
    q[:, 2] = ch * sp * cr + sh * cp * sr
    q[:, 3] = sh * cp * cr - ch * sp * sr
    return q * np.copysign(1.0, q[:, :1])


def quaternion_product(p: Array, q: Array) -> Array:
    """Hamilton product p q, row by row, scalar first."""
    w, v = p[:, :1], p[:, 1:]
    scalar = w * q[:, :1] - np.sum(v * q[:, 1:], axis=1, keepdims=True)
    vector = w * q[:, 1:] + q[:, :1] * v + np.cross(v, q[:, 1:])
    return np.concatenate([scalar, vector], axis=1)


def matrix(roll: Array, pitch: Array, heading: Array) -> Array:
    """Rz(heading) Ry(pitch) Rx(roll)."""
    sr, cr = np.sin(roll), np.cos(roll)
    sp, cp = np.sin(pitch), np.cos(pitch)
    sh, ch = np.sin(heading), np.cos(heading)
    C = np.empty((roll.size, 3, 3))
    C[:, 0, 0], C[:, 1, 0], C[:, 2, 0] = ch * cp, sh * cp, -sp
    C[:, 0, 1], C[:, 1, 1], C[:, 2, 1] = ch * sp * sr - sh * cr, sh * sp * sr + ch * cr, cp * sr
    C[:, 0, 2], C[:, 1, 2], C[:, 2, 2] = ch * sp * cr + sh * sr, sh * sp * cr - ch * sr, cp * cr
    return C


def per_metre(lat: float, h: float) -> tuple[float, float]:
    """Latitude and longitude (rad) per metre north and east at a point."""
    meridian, transverse, _ = radii(np.asarray(math.sin(lat)))
    return 1.0 / float(meridian + h), 1.0 / (float(transverse + h) * math.cos(lat))


def period(seconds: float) -> float:
    """Angular frequency of a period, rad/s."""
    return 2.0 * math.pi / seconds


def turning_vehicle() -> Motion:
    """About 100 m/s in a circle of 100 s, banked 32 deg, never steady, at 48 deg N."""
    lat, h, turn = 48.0 * DEG, 500.0, period(100.0)
    north, east = per_metre(lat, h)
    radius = 100.0 / turn  # m
    return Motion(
        lat=Coordinate(lat, sinusoids=(Sinusoid(radius * north, turn, 0.4),)),
        lon=Coordinate(11.0 * DEG, sinusoids=(Sinusoid(radius * east, turn, 0.4 - math.pi / 2),)),
        h=Coordinate(h, sinusoids=(Sinusoid(50.0, period(240.0), 0.8),)),
        roll=Coordinate(32.0 * DEG, sinusoids=(Sinusoid(4.0 * DEG, period(20.0), 0.3),)),
        pitch=Coordinate(2.0 * DEG, sinusoids=(Sinusoid(3.0 * DEG, period(40.0), 1.1),)),
        heading=Coordinate(0.4, turn, (Sinusoid(5.0 * DEG, period(31.0), 0.6),)),
    )


def with_coning(base: Motion, frequency_hz: float, cone_deg: float) -> Motion:
    """`base` with coning of a half-angle."""
    w, cone = 2.0 * math.pi * frequency_hz, cone_deg * DEG
    return replace(
        base,
        roll=_add(base.roll, Sinusoid(cone, w)),
        pitch=_add(base.pitch, Sinusoid(cone, w, math.pi / 2)),
    )


def with_vibration(
    base: Motion, frequency_hz: float, cone_deg: float, acceleration: float
) -> Motion:
    """`base` with coning of a half-angle and a north shake of an amplitude (m/s^2).

    The specific force of the shake is in phase with roll, so that it sculls.
    """
    w = 2.0 * math.pi * frequency_hz
    north, _ = per_metre(base.lat.constant, base.h.constant)
    shake = Sinusoid(-acceleration / w**2 * north, w)
    return replace(with_coning(base, frequency_hz, cone_deg), lat=_add(base.lat, shake))


def with_heave(base: Motion, frequency_hz: float, rock_deg: float, acceleration: float) -> Motion:
    """`base` with a vertical shake of an amplitude (m/s^2), rocking in phase with it.

    It sculls forward and sideways: roll and pitch swing together, with the upward force.
    """
    w, rock = 2.0 * math.pi * frequency_hz, Sinusoid(rock_deg * DEG, 2.0 * math.pi * frequency_hz)
    return replace(
        base,
        h=_add(base.h, Sinusoid(-acceleration / w**2, w)),
        roll=_add(base.roll, rock),
        pitch=_add(base.pitch, rock),
    )


def vibrating_vehicle() -> Motion:
    """`turning_vehicle` that cones at 0.1 deg and shakes north at 1 m/s^2, both at 10 Hz."""
    return with_vibration(turning_vehicle(), 10.0, 0.1, 1.0)


def airliner() -> Motion:
    """230 m/s at 10 km from 47 deg N, nearly level, never steady."""
    lat, h = 47.0 * DEG, 10_000.0
    north, east = per_metre(lat, h)
    return Motion(
        lat=Coordinate(lat, 221.0 * north, (Sinusoid(150.0 * north, period(300.0), 0.5),)),
        lon=Coordinate(8.0 * DEG, 65.0 * east, (Sinusoid(90.0 * east, period(210.0), 1.3),)),
        h=Coordinate(h, sinusoids=(Sinusoid(40.0, period(170.0), 0.2),)),
        roll=Coordinate(1.0 * DEG, sinusoids=(Sinusoid(6.0 * DEG, period(60.0), 0.9),)),
        pitch=Coordinate(2.5 * DEG, sinusoids=(Sinusoid(1.5 * DEG, period(45.0), 0.4),)),
        heading=Coordinate(16.0 * DEG, sinusoids=(Sinusoid(5.0 * DEG, period(300.0), 2.0),)),
    )


def vibrating_airliner() -> Motion:
    """`airliner` that cones at 20 Hz and 0.05 deg and sculls at 15 Hz, 1 m/s^2 and 0.05 deg."""
    return with_heave(with_coning(airliner(), 20.0, 0.05), 15.0, 0.05, 1.0)


def static(
    lat_deg: float, lon_deg: float, h: float, roll_deg: float, pitch_deg: float, heading_deg: float
) -> Motion:
    """At rest on the Earth."""
    angles = (lat_deg, lon_deg, roll_deg, pitch_deg, heading_deg)
    lat, lon, roll, pitch, heading = (Coordinate(angle * DEG) for angle in angles)
    return Motion(lat, lon, Coordinate(h), roll, pitch, heading)


def manoeuvre() -> Motion:
    """300 m/s over ground from 45 deg N with weaving, climbing and rolling; 0.19 rad/s at most."""
    lat, h, weave = 45.0 * DEG, 1000.0, period(120.0)
    north, east = per_metre(lat, h)
    return Motion(
        lat=Coordinate(lat, 260.0 * north, (Sinusoid(2000.0 * north, weave),)),
        lon=Coordinate(10.0 * DEG, 150.0 * east, (Sinusoid(1500.0 * east, period(75.0)),)),
        h=Coordinate(h + 400.0, sinusoids=(Sinusoid(-400.0, period(90.0), math.pi / 2),)),
        roll=Coordinate(0.0, sinusoids=(Sinusoid(35.0 * DEG, period(20.0)),)),
        pitch=Coordinate(0.0, sinusoids=(Sinusoid(8.0 * DEG, period(40.0)),)),
        heading=Coordinate(30.0 * DEG, sinusoids=(Sinusoid(25.0 * DEG, weave),)),
    )


def road_drive() -> Motion:
    """A car at 15 to 19 m/s through town over gentle hills, heading and pitch along the track.

    The path is a circle with an epicycle; the heading is its tangent to second order in the
    ratio of the two speeds, so that sideslip stays below 1 mrad.
    """
    lat, h, speed, swerve = 30.5 * DEG, 35.0, 17.0, 2.0  # rad, m, m/s, m/s
    slow, fast, hill = period(130.0), period(37.0), period(83.0)
    north, east = per_metre(lat, h)
    ratio, phase = swerve / speed, 1.2
    arcs = ((speed / slow, slow, phase), (swerve / fast, fast, 0.5))  # radius in m
    return Motion(
        lat=Coordinate(lat, sinusoids=tuple(Sinusoid(r * north, w, p) for r, w, p in arcs)),
        lon=Coordinate(
            114.3 * DEG,
            sinusoids=tuple(Sinusoid(r * east, w, p - math.pi / 2) for r, w, p in arcs),
        ),
        h=Coordinate(h, sinusoids=(Sinusoid(4.0, hill, 0.7),)),
        roll=Coordinate(1.0 * DEG, sinusoids=(Sinusoid(1.5 * DEG, period(9.0), 0.4),)),
        pitch=Coordinate(
            0.5 * DEG,
            sinusoids=(
                Sinusoid(4.0 * hill / speed, hill, 0.7 + math.pi / 2),
                Sinusoid(0.5 * DEG, period(7.0), 0.9),
            ),
        ),
        heading=Coordinate(
            phase,
            slow,
            (
                Sinusoid(ratio, fast - slow, 0.5 - phase),
                Sinusoid(-0.5 * ratio**2, 2.0 * (fast - slow), 2.0 * (0.5 - phase)),
            ),
        ),
    )


def start_from_rest(base: Motion, t_still: float, t_ramp: float) -> Motion:
    """`base` frozen at its time 0 for `t_still` seconds, then started over `t_ramp` seconds."""
    return replace(base, start=SmoothStart(t_still, t_ramp))


def _add(coordinate: Coordinate, sinusoid: Sinusoid) -> Coordinate:
    return replace(coordinate, sinusoids=(*coordinate.sinusoids, sinusoid))
