"""A vehicle that drives or flies a list of segments: stand, go straight, turn, climb, ..."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray
from scipy.interpolate import PPoly
from scipy.optimize import brentq
from scipy.special import comb

from earth.ellipsoid import WGS84
from earth.geodetic import curvatures
from earth.gravity import closed_form_gravity
from earth.rotation import euler_to_quat
from earth.units import DEG
from navgrade.simulate.jet import Jet
from navgrade.simulate.kinematics import Kinematics, over_earth
from navgrade.simulate.motion import check_latitudes

Array = NDArray[np.float64]

_RAMP = 2.0  # s, unless a third of the segment is shorter
_STEEPEST = 80.0 * DEG  # rad: of climbs

# The ninth-degree smooth step S(u), four derivatives zero at 0 and 1, ascending about its start and
# about its middle, where its halves are evaluated without cancellation.
_STEP = Polynomial([0.0, 0.0, 0.0, 0.0, 0.0, 126.0, -420.0, 540.0, -315.0, 70.0])
_EARLY, _LATE = (np.asarray(p.coef, float) for p in (_STEP, _STEP(Polynomial([0.5, 1.0]))))
_CONSTANT = np.eye(10)[0]
_STEEPNESS = 10.0  # bandwidth of S times its duration, rad
_SHORTEST = 1e-12  # s: of a hold between two ramps

# What a piece of the drive is made of, and how many derivatives the kinematics need: roll may
# follow from the course's rate. The first four are integrals of what a profile holds.
_ORDERS = {"speed": 2, "course": 3, "roll": 2, "pitch": 2, "climb": 2, "banked": 0}
_SPEED, _COURSE, _ROLL, _PITCH, _CLIMB, _BANKED = range(len(_ORDERS))
_POWERS = np.arange(11)  # of time in a piece

_NODES = 10  # Gauss nodes of a window of the position
_WINDOW = 0.5  # s
_SWEEPS = 50


@dataclass(frozen=True)
class Start:
    """Where and how a vehicle starts.

    Parameters
    ----------
    lat, lon : float
        Geodetic latitude and longitude, rad.
    h : float
        Height above the ellipsoid, m.
    heading : float
        Of the body, from true north, rad.
    speed : float
        m/s, not negative.
    roll, pitch : float
        Attitude of the body in level straight motion, rad; bank and climb come on top.
    crab : float
        Heading minus course, rad.
    """

    lat: float
    lon: float
    h: float
    heading: float = 0.0
    speed: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    crab: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not np.isfinite(value):
                raise ValueError(f"start {name} must be finite, got {value!r}")
        check_latitudes(np.array([self.lat]), "the start")
        if self.speed < 0.0:
            raise ValueError(f"start speed must not be negative, got {self.speed!r} m/s")


class Profile(NamedTuple):
    """How a segment moves the vehicle: everything rises over a ramp, holds, and falls again.

    Attributes
    ----------
    duration, ramp : float
        s; a ramp of 0 changes nothing.
    speed, course, roll, pitch : float
        What their rates hold, m/s^2 and rad/s; each changes by that times (duration - ramp).
    climb : float
        What the climb angle itself holds, rad.
    banked : bool
        Whether the vehicle rolls into its turn.
    """

    duration: float
    ramp: float = 0.0
    speed: float = 0.0
    course: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    climb: float = 0.0
    banked: bool = False


class Vehicle(NamedTuple):
    """What a segment finds: speed (m/s) and the gravity vehicles bank against (m/s^2)."""

    speed: float
    gravity: float


class Segment(Protocol):
    """One stretch of a drive or flight."""

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does; raises ValueError where the vehicle cannot."""
        ...


@dataclass(frozen=True)
class Still:
    """Stand for `duration`, s."""

    duration: float

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does."""
        if vehicle.speed != 0.0:
            raise ValueError(
                f"the vehicle moves at {vehicle.speed:g} m/s and cannot be still; accelerate to "
                "speed 0 before"
            )
        return [Profile(_positive("duration", self.duration, "s"))]


@dataclass(frozen=True)
class Straight:
    """Keep speed and course for `duration`, s, or for `distance`, m."""

    duration: float | None = None
    distance: float | None = None

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does."""
        name, value = _one_of(duration=(self.duration, "s"), distance=(self.distance, "m"))
        if name == "distance":
            value /= _moving(vehicle, "a distance")
        return [Profile(value)]


@dataclass(frozen=True)
class Accelerate:
    """Change the speed to `to_speed`, m/s, in `duration`, s, or by at most `acceleration`, m/s^2.

    `ramp`, s, is how long the acceleration takes to rise and to fall.
    """

    to_speed: float
    duration: float | None = None
    acceleration: float | None = None
    ramp: float | None = None

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does."""
        if not (np.isfinite(self.to_speed) and self.to_speed >= 0.0):
            raise ValueError(f"to_speed must not be negative, got {self.to_speed!r} m/s")
        change = self.to_speed - vehicle.speed
        if change == 0.0:
            raise ValueError(f"the speed is {self.to_speed:g} m/s already")
        pulse = _pulse(
            change,
            self.ramp,
            duration=(self.duration, "s"),
            acceleration=(self.acceleration, "m/s²"),
        )
        return [Profile(pulse.duration, pulse.ramp, speed=pulse.rate)]


@dataclass(frozen=True)
class Turn:
    """Turn by `angle`, rad, to the right if positive.

    Give one of `duration`, s, `rate`, rad/s, and `radius`, m; rate and radius hold between the
    ramps. A `banked` turn is coordinated: no specific force to the side but for that of the Earth's
    rotation.
    """

    angle: float
    duration: float | None = None
    rate: float | None = None
    radius: float | None = None
    banked: bool = False
    ramp: float | None = None

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does."""
        return [_turn(self, self.angle, vehicle)]


@dataclass(frozen=True)
class Climb:
    """Climb by `height`, m (descend if negative), along a slope of `angle`, rad, or in `duration`.

    `ramp`, s, is how long the slope takes to build up and to end. Speed along the path stays.
    """

    height: float
    angle: float | None = None
    duration: float | None = None
    ramp: float | None = None

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does."""
        speed = _moving(vehicle, "a climb")
        sign, path = _sign("height", self.height, "m"), abs(self.height) / speed
        name, value = _one_of(angle=(self.angle, "rad"), duration=(self.duration, "s"))
        if name == "duration":
            ramp = _ramp(value, self.ramp)
            return [Profile(value, ramp, climb=sign * _climb_angle(path, value, ramp))]
        if value > _STEEPEST:
            raise ValueError(f"climbs are at most 80° steep, got {value / DEG:g}°")
        full, rising = float(np.sin(value)), 2.0 * _mean_sine(value)
        longest = path / rising
        ramp = min(_RAMP, path / (rising + full)) if self.ramp is None else self.ramp
        if not 0.0 < ramp <= longest:
            raise ValueError(
                f"ramp must be positive and at most {longest:g} s for this climb, got {ramp!r} s"
            )
        return [Profile(2.0 * ramp + (path - ramp * rising) / full, ramp, climb=sign * value)]


@dataclass(frozen=True)
class FigureEight:
    """A full circle to the right, then one to the left, of `radius`, m, or at `rate`, rad/s.

    The ramps let each circle end a little ahead of where it began.
    """

    radius: float | None = None
    rate: float | None = None
    banked: bool = False
    ramp: float | None = None

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does."""
        return [_turn(self, angle, vehicle) for angle in (2.0 * np.pi, -2.0 * np.pi)]


@dataclass(frozen=True)
class Spiral:
    """Turn `turns` times (left if negative) while climbing by `height`, m.

    Give one of `radius`, m, and `rate`, rad/s. `radius` is that of a level turn; on a slope of
    angle g the circle over ground is smaller by cos g.
    """

    turns: float
    height: float
    radius: float | None = None
    rate: float | None = None
    banked: bool = False
    ramp: float | None = None

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does."""
        turn = _turn(self, 2.0 * np.pi * self.turns, vehicle)
        sign, path = _sign("height", self.height, "m"), abs(self.height) / vehicle.speed
        angle = _climb_angle(path, turn.duration, turn.ramp)
        return [turn._replace(climb=sign * angle)]


@dataclass(frozen=True)
class BankToTurn:
    """Turn by `angle`, rad, to the right if positive, rolling to `bank`, rad, as aircraft do."""

    bank: float
    angle: float
    ramp: float | None = None

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does."""
        if not 0.0 < self.bank <= _STEEPEST:
            raise ValueError(f"bank must be above 0° and at most 80°, got {self.bank / DEG:g}°")
        rate = vehicle.gravity * np.tan(self.bank) / _moving(vehicle, "a banked turn")
        return Turn(self.angle, rate=float(rate), banked=True, ramp=self.ramp).profiles(vehicle)


@dataclass(frozen=True)
class Rotate:
    """Rotate on the spot, as a turntable does: about one axis by `angle`, rad, at `rate`, rad/s.

    Roll and pitch rotated so stay when the vehicle moves on; heading becomes its course.
    """

    axis: Literal["roll", "pitch", "heading"]
    angle: float
    rate: float
    ramp: float | None = None

    def profiles(self, vehicle: Vehicle) -> Sequence[Profile]:
        """What it does."""
        if self.axis not in ("roll", "pitch", "heading"):
            raise ValueError(f"axis must be roll, pitch or heading, got {self.axis!r}")
        if vehicle.speed != 0.0:
            raise ValueError(
                f"the vehicle moves at {vehicle.speed:g} m/s and cannot rotate on the spot; use a "
                "turn, or accelerate to speed 0 before"
            )
        _sign("angle", self.angle, "rad")
        pulse = _pulse(self.angle, self.ramp, rate=(self.rate, "rad/s"))
        rates = dict.fromkeys(("roll", "pitch", "heading"), 0.0) | {self.axis: pulse.rate}
        return [
            Profile(
                pulse.duration,
                pulse.ramp,
                course=rates["heading"],
                roll=rates["roll"],
                pitch=rates["pitch"],
            )
        ]


class _Pulse(NamedTuple):
    duration: float
    ramp: float
    rate: float


def _positive(name: str, value: float, unit: str) -> float:
    if not (np.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be positive, got {value!r} {unit}")
    return float(value)


def _sign(name: str, value: float, unit: str) -> float:
    if not np.isfinite(value) or value == 0.0:
        raise ValueError(f"{name} must be finite and not zero, got {value!r} {unit}")
    return float(np.sign(value))


def _one_of(**choices: tuple[float | None, str]) -> tuple[str, float]:
    given = [name for name, (value, _) in choices.items() if value is not None]
    if len(given) != 1:
        names = " and ".join([", ".join(list(choices)[:-1]), list(choices)[-1]])
        raise ValueError(f"give one of {names}, got {' and '.join(given) or 'none'}")
    value, unit = choices[given[0]]
    assert value is not None
    return given[0], _positive(given[0], value, unit)


def _moving(vehicle: Vehicle, what: str) -> float:
    if vehicle.speed == 0.0:
        raise ValueError(f"the vehicle stands; {what} needs speed, accelerate before")
    return vehicle.speed


def _ramp(duration: float, ramp: float | None) -> float:
    if ramp is None:
        return min(_RAMP, duration / 3.0)
    if not 0.0 < ramp <= 0.5 * duration:
        raise ValueError(
            f"ramp must be positive and at most half of the {duration:g} s, got {ramp!r} s"
        )
    return ramp


def _pulse(change: float, ramp: float | None, **choices: tuple[float | None, str]) -> _Pulse:
    """A rate that rises, holds and falls, by its duration or by what it holds."""
    name, value = _one_of(**choices)
    if name == "duration":
        ramp = _ramp(value, ramp)
        return _Pulse(value, ramp, change / (value - ramp))
    steady = abs(change) / value
    if ramp is None:
        ramp = min(_RAMP, 0.5 * steady)
    elif not 0.0 < ramp <= steady:
        raise ValueError(
            f"ramp must be positive and at most {steady:g} s for this {name}, got {ramp!r} s"
        )
    return _Pulse(steady + ramp, ramp, float(np.copysign(value, change)))


def _turn(segment: Any, angle: float, vehicle: Vehicle) -> Profile:
    """A turn of a segment that has a rate or radius, perhaps a duration, and a ramp."""
    speed = vehicle.speed
    if speed == 0.0:
        raise ValueError(
            "the vehicle stands; a turn needs speed: accelerate before, or rotate on the spot"
        )
    _sign("angle", angle, "rad")
    choices = {"rate": (segment.rate, "rad/s"), "radius": (segment.radius, "m")}
    if hasattr(segment, "duration"):
        choices = {"duration": (segment.duration, "s"), **choices}
    name, value = _one_of(**choices)
    if name == "radius":
        name, value = "rate", speed / value
    pulse = _pulse(angle, segment.ramp, **{name: (value, "")})
    return Profile(pulse.duration, pulse.ramp, course=pulse.rate, banked=segment.banked)


_RISE_NODES, _RISE_WEIGHTS = np.polynomial.legendre.leggauss(24)
_RISE = _STEP(0.5 + 0.5 * _RISE_NODES)


def _mean_sine(angle: float) -> float:
    """Mean of sin(angle S(u)) over a ramp."""
    return float(0.5 * _RISE_WEIGHTS @ np.sin(angle * _RISE))


def _climb_angle(path: float, duration: float, ramp: float) -> float:
    """Angle that gains `path` seconds' worth of vertical way."""

    def missing(angle: float) -> float:
        steady = (duration - 2.0 * ramp) * float(np.sin(angle))
        return 2.0 * ramp * _mean_sine(angle) + steady - path

    if missing(_STEEPEST) < 0.0:
        raise ValueError(
            f"climbing that high in {duration:g} s is steeper than 80°; give it more time or speed"
        )
    return float(brentq(missing, 0.0, _STEEPEST, xtol=1e-15, rtol=1e-15))


class _Piece(NamedTuple):
    duration: float
    ramp: float  # whose half it is; 0 of a steady piece
    table: Array  # (channel, power) of the time since the piece began, s


def _plateau(profile: Profile) -> Iterator[tuple[float, float, Array]]:
    """Duration, ramp and polynomial of the pieces of a rise to 1, a hold, and a fall."""
    duration, ramp = profile.duration, profile.ramp
    if ramp == 0.0:
        yield duration, 0.0, 0.0 * _CONSTANT
        return
    scale = ramp ** _POWERS[:-1]
    early, late = _EARLY / scale, _LATE / scale
    yield 0.5 * ramp, ramp, early
    yield 0.5 * ramp, ramp, late
    if duration - 2.0 * ramp > _SHORTEST:
        yield duration - 2.0 * ramp, 0.0, _CONSTANT
    yield 0.5 * ramp, ramp, _CONSTANT - early
    yield 0.5 * ramp, ramp, _CONSTANT - late


def _pieces(profile: Profile, values: Array) -> Iterator[_Piece]:
    """Polynomials of all channels; `values` of the integrated ones go on to the end."""
    rates = np.array([profile.speed, profile.course, profile.roll, profile.pitch])
    for duration, ramp, shape in _plateau(profile):
        table = np.zeros((len(_ORDERS), len(_POWERS)))
        table[:_CLIMB, 0] = values
        table[:_CLIMB, 1:] = np.outer(rates, shape / _POWERS[1:])
        table[_CLIMB, :-1] = profile.climb * shape
        table[_BANKED, 0] = profile.banked
        values[:] = table[:_CLIMB] @ duration**_POWERS
        yield _Piece(duration, ramp, table)


class _Channels:
    """The pieces one after the other, from time 0 on."""

    def __init__(self, pieces: Sequence[_Piece]) -> None:
        self.breaks = np.concatenate([[0.0], np.cumsum([piece.duration for piece in pieces])])
        tables = np.stack([piece.table for piece in pieces])
        taylor = [  # of the k-th derivative over k!, (piece, power)
            comb(_POWERS[k:], k) * tables[:, channel, k:]
            for channel, order in enumerate(_ORDERS.values())
            for k in range(order + 1)
        ]
        self._taylor = [
            [np.trim_zeros(rows[k], "b") for rows in taylor] for k in range(len(pieces))
        ]

    def at(self, t: Array) -> dict[str, Jet]:
        """All channels at times in increasing order."""
        rows = np.zeros((sum(_ORDERS.values()) + len(_ORDERS), len(t)))
        bounds = np.concatenate([[0], np.searchsorted(t, self.breaks[1:-1]), [len(t)]])
        for k in np.flatnonzero(np.diff(bounds)):
            part = slice(bounds[k], bounds[k + 1])
            elapsed = t[part] - self.breaks[k]
            for row, coefficients in zip(rows, self._taylor[k], strict=True):
                if len(coefficients):
                    row[part] = polyval(elapsed, coefficients, tensor=False)
        known = iter(row if row.any() else 0.0 for row in rows)
        return {
            name: Jet(*(next(known) for _ in range(order + 1))) for name, order in _ORDERS.items()
        }


class Segments:
    """A vehicle that does one segment after the other over the Earth.

    Speed, course and climb angle are given functions of time whose rates rise and fall by the
    ninth-degree smooth step, so that acceleration, jerk, angular rate and angular acceleration are
    continuous. The velocity follows in closed form, the path over the ellipsoid from it to 1e-10 m.
    Heading is course plus crab, pitch and roll those of `Start` plus climb angle and bank.

    Parameters
    ----------
    initial : Start
    segments : sequence
        Of `Still`, `Straight`, `Accelerate`, `Turn`, `Climb`, `FigureEight`, `Spiral`,
        `BankToTurn`, `Rotate`.

    Attributes
    ----------
    start, end : float
        0 and the sum of all durations, s.
    ends : ndarray
        When each segment ends, s.

    Raises
    ------
    ValueError
        Where a segment cannot be done, naming it by its number, counted from 1; beyond latitude
        ±89°.

    Notes
    -----
    Banked turns are coordinated for the normal gravity of the start. Navigated from exact
    increments, two minutes of every segment end within 30 nm of the truth
    (`tests/navgrade/simulate/test_segments.py`).
    """

    start = 0.0

    def __init__(self, initial: Start, segments: Sequence[Segment]) -> None:
        if not segments:
            raise ValueError("segments must not be empty")
        self.initial = initial
        _, self._gravity = closed_form_gravity(
            WGS84.params, np.sin(initial.lat), np.cos(initial.lat), initial.h
        )
        values = np.array(
            [initial.speed, initial.heading - initial.crab, initial.roll, initial.pitch]
        )
        pieces: list[_Piece] = []
        ends = []
        for number, segment in enumerate(segments, 1):
            try:
                profiles = segment.profiles(Vehicle(float(values[_SPEED]), self._gravity))
            except ValueError as error:
                raise ValueError(f"segment {number}, {type(segment).__name__}: {error}") from None
            for profile in profiles:
                pieces += _pieces(profile, values)
            if isinstance(segment, Accelerate):
                values[_SPEED] = segment.to_speed
            ends.append(sum(piece.duration for piece in pieces))
        self._channels = _Channels(pieces)
        self.ends = np.array(ends)
        self.end = float(self._channels.breaks[-1])
        self.knots = self._channels.breaks[1:-1]
        bandwidths = self._bandwidths(pieces)
        self.bandwidth = float(bandwidths.max())
        self._position = self._integrated(pieces, bandwidths)

    def _bandwidths(self, pieces: Sequence[_Piece]) -> Array:
        """Of each piece, rad/s: its rates, and the steepness of its ramp and of banking."""
        tables = np.stack([piece.table for piece in pieces])
        ramps = np.array([piece.ramp for piece in pieces])
        after = np.array([piece.duration for piece in pieces])[:, None] ** _POWERS
        slopes = tables[..., 1:] * _POWERS[1:]

        def largest(polynomials: Array) -> Array:  # they rise or fall throughout
            ends = np.einsum("pcn,pn->pc", polynomials, after[:, : polynomials.shape[2]])
            size: Array = np.maximum(np.abs(polynomials[..., 0]), np.abs(ends))
            return size

        value, rate = largest(tables), largest(slopes)
        lateral = value[:, _BANKED] * value[:, _SPEED] * rate[:, _COURSE] / self._gravity
        steepness = np.divide(_STEEPNESS, ramps, out=np.zeros_like(ramps), where=ramps > 0.0)
        turning = rate[:, [_COURSE, _ROLL, _PITCH]].sum(axis=1)
        bandwidths: Array = turning + steepness * (1.0 + value[:, _CLIMB] + lateral)
        return bandwidths

    def _integrated(self, pieces: Sequence[_Piece], bandwidths: Array) -> PPoly:
        """Latitude, longitude and height relative to the start, by Picard's iteration.

        Gauss quadrature in windows between the knots; all windows go through each sweep together.
        """
        params, initial, breaks = WGS84.params, self.initial, self._channels.breaks
        moving = np.array([piece.table[_SPEED].any() for piece in pieces])
        length = np.minimum(_WINDOW, 1.0 / np.maximum(bandwidths, 1e-9))
        count = np.ceil(np.diff(breaks) / np.where(moving, length, np.inf))
        windows = np.concatenate(
            [
                np.linspace(a, b, int(max(n, 1.0)), endpoint=False)
                for a, b, n in zip(breaks[:-1], breaks[1:], count, strict=True)
            ]
            + [breaks[-1:]]
        )
        dt = np.diff(windows)
        x, w = np.polynomial.legendre.leggauss(_NODES)
        powers = _integrals_from_values(x, w)
        inner = (0.5 * (1.0 + x))[:, None] ** np.arange(_NODES + 1)  # (node, power)

        def integral(rate: Array) -> tuple[Array, Array]:
            """At the windows' nodes, and its polynomials (window, power) of t / dt."""
            coefficients = rate @ powers.T * dt[:, None]
            ends = np.cumsum(rate @ (0.5 * w) * dt)
            coefficients[1:, 0] += ends[:-1]
            return coefficients @ inner.T, coefficients

        t = windows[:-1, None] + dt[:, None] * 0.5 * (1.0 + x)
        channels = self._channels.at(t.ravel())
        north, east, up = (
            np.broadcast_to(x.value, t.size).reshape(t.shape) for x in _velocity(channels)
        )
        h, h_poly = integral(up)
        h += initial.h
        lat, lat_poly = np.zeros_like(h), np.zeros_like(h)
        for _ in range(_SWEEPS):
            per_meridian, _ = curvatures(params, np.sin(initial.lat + lat), h)
            before = lat
            lat, lat_poly = integral(north * per_meridian)
            check_latitudes((initial.lat + lat).ravel(), "the path")
            if np.abs(lat - before).max() <= 1e-15 * np.abs(lat).max():
                break
        sin_lat, cos_lat = np.sin(initial.lat + lat), np.cos(initial.lat + lat)
        _, per_transverse = curvatures(params, sin_lat, h)
        _, lon_poly = integral(east * per_transverse / cos_lat)
        table = np.stack([lat_poly, lon_poly, h_poly], axis=-1)  # (window, power, coordinate)
        table /= (dt[:, None] ** np.arange(_NODES + 1))[..., None]
        return PPoly(np.ascontiguousarray(table[:, ::-1].transpose(1, 0, 2)), windows)

    def at(self, t: Array) -> Kinematics:
        """Kinematics at times `t`, s, shape (n,), in increasing order."""
        channels = self._channels.at(t)
        speed, course, climb = (channels[name] for name in ("speed", "course", "climb"))
        lateral = channels["banked"].value * speed * course.rate() * np.cos(climb)
        d_lat, d_lon, d_h = self._position(t).T
        lat, lon, h = self._coordinates(
            self.initial.lat + d_lat,
            self.initial.lon + d_lon,
            self.initial.h + d_h,
            _velocity(channels),
        )
        euler = (
            channels["roll"] + np.arctan(lateral / self._gravity),
            channels["pitch"] + climb,
            course + self.initial.crab,
        )
        return over_earth(t, lat, lon, h, euler_to_quat(euler))

    def _coordinates(
        self, lat: Array, lon: Array, h: Array, velocity: tuple[Jet, Jet, Jet]
    ) -> tuple[Jet, Jet, Jet]:
        """Coordinates with the derivatives that follow from the velocity."""
        north, east, up = velocity
        lat_jet, h_jet = Jet(lat), Jet(h)
        for _ in range(2):  # each round, radii known to one more order give one more
            sin_lat, cos_lat = np.sin(lat_jet), np.cos(lat_jet)
            per_meridian, per_transverse = curvatures(WGS84.params, sin_lat, h_jet)
            lat_jet = (north * per_meridian).integral(lat)
            lon_jet = (east * per_transverse / cos_lat).integral(lon)
            h_jet = up.integral(h)
        return lat_jet, lon_jet, h_jet


def _velocity(channels: dict[str, Jet]) -> tuple[Jet, Jet, Jet]:
    """North, east, up."""
    speed, course, climb = (channels[name] for name in ("speed", "course", "climb"))
    level = speed * np.cos(climb)
    return level * np.cos(course), level * np.sin(course), speed * np.sin(climb)


def _integrals_from_values(x: Array, w: Array) -> Array:
    """Matrix (power, node) from values at Gauss nodes to the integral from 0, ascending in u.

    The interpolating polynomial by Legendre's orthogonality, u = (1 + x) / 2 of a unit window.
    """
    n = len(x)
    matrix = np.zeros((n + 1, n))
    unit = Polynomial([-1.0, 2.0])
    for degree in range(n):
        basis = Legendre.basis(degree)
        weights = (degree + 0.5) * w * basis(x)
        powers = 0.5 * basis.integ(lbnd=-1.0).convert(kind=Polynomial)(unit)
        matrix += np.outer(np.pad(powers.coef, (0, n + 1 - len(powers.coef))), weights)
    return matrix
