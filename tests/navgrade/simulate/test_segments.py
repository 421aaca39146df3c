"""Drives and flights of segments against their profiles rewritten in high precision."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from mpmath import mp, mpf

from navgrade.simulate import (
    Accelerate,
    BankToTurn,
    Climb,
    FigureEight,
    Rotate,
    Segments,
    Spiral,
    Start,
    Still,
    Straight,
    Turn,
    extremes,
    imu_rates,
    true_trajectory,
)
from tests.navgrade.simulate.exact import DEG, Pose, closing, mismatch, over_earth, radii
from tests.oracles.gravity import normal_gravity_mp
from tests.oracles.high_precision import from_euler

Segment = Accelerate | BankToTurn | Climb | FigureEight | Rotate | Spiral | Still | Straight | Turn
START = Start(
    lat=-41.3 * DEG,
    lon=179.9995 * DEG,
    h=80.0,
    heading=1.2,
    roll=0.03,
    pitch=-0.02,
    crab=0.05,
)
FLIGHT: Sequence[Segment] = (
    Still(2.0),
    Rotate("pitch", 0.4, 0.3),
    Rotate("heading", -5.0, 0.8, ramp=1.0),
    Accelerate(30.0, acceleration=2.5),
    Straight(distance=100.0),
    Turn(110.0 * DEG, rate=0.3, banked=True),
    Climb(25.0, angle=6.0 * DEG),
    Turn(-1.0, radius=80.0, ramp=0.5),
    Spiral(-1.25, -20.0, rate=0.35, banked=True),
    BankToTurn(25.0 * DEG, 0.9),
    FigureEight(rate=0.6),
    Climb(-10.0, duration=9.0, ramp=3.0),
    Accelerate(0.0, duration=12.0),
    Rotate("roll", 2.0, 0.5),
)


def rise(u: mpf) -> mpf:
    """The ninth-degree smooth step: the integral of the Bernstein polynomial (x (1 - x))^4."""
    if u <= 0 or u >= 1:
        return mpf(u >= 1)
    return mp.betainc(5, 5, 0, u, regularized=True)


def risen(u: mpf) -> mpf:
    """Its integral from 0, by parts."""
    if u <= 0:
        return mpf(0)
    if u >= 1:
        return u - mpf(1) / 2
    return u * rise(u) - mp.betainc(6, 5, 0, u, regularized=True) / 2


class Profile:
    """Speed, course, roll, pitch, climb angle and bank of FLIGHT as functions of time.

    Written from what the segments promise: what each holds, its change, and its ramp.
    """

    def __init__(self, start: Start) -> None:
        self.start = start
        self.clock = mpf(0)
        self.integrals: list[tuple[str, mpf, mpf, mpf, mpf]] = []
        self.climbs: list[tuple[mpf, mpf, mpf, mpf]] = []
        self.banked: list[tuple[mpf, mpf]] = []

    def pulse(
        self, channel: str, change: float, held: float, ramp: float, bank: bool = False
    ) -> None:
        """A rate that is held long enough for a change."""
        duration = abs(mpf(change)) / mpf(held) + mpf(ramp)
        rate = mp.sign(change) * mpf(held)
        self.integrals.append((channel, self.clock, duration, mpf(ramp), rate))
        if bank:
            self.banked.append((self.clock, self.clock + duration))
        self.clock += duration

    def climb(self, angle: mpf, begin: mpf, duration: mpf, ramp: mpf) -> None:
        """A climb angle that is held."""
        self.climbs.append((begin, duration, ramp, angle))

    def plateau(self, t: mpf, begin: mpf, duration: mpf, ramp: mpf) -> mpf:
        """0, rising to 1, and back."""
        return rise((t - begin) / ramp) - rise((t - begin - duration + ramp) / ramp)

    def channel(self, name: str, t: mpf) -> mpf:
        """Integral of the rates of a channel."""
        return sum(
            (
                rate
                * ramp
                * (risen((t - begin) / ramp) - risen((t - begin - duration + ramp) / ramp))
                for channel, begin, duration, ramp, rate in self.integrals
                if channel == name
            ),
            mpf(0),
        )

    def course_rate(self, t: mpf) -> mpf:
        """rad/s."""
        return sum(
            (
                rate * self.plateau(t, begin, duration, ramp)
                for channel, begin, duration, ramp, rate in self.integrals
                if channel == "course"
            ),
            mpf(0),
        )

    def climb_angle(self, t: mpf) -> mpf:
        """rad."""
        return sum((c[3] * self.plateau(t, *c[:3]) for c in self.climbs), mpf(0))


def climb_time(angle: float, height: float, speed: float, ramp: float) -> mpf:
    """Duration of a climb whose angle is given."""
    ramps = 2 * mpf(ramp) * mp.quad(lambda u: mp.sin(mpf(angle) * rise(u)), [0, 0.5, 1])
    return 2 * mpf(ramp) + (mpf(height) / speed - ramps) / mp.sin(mpf(angle))


def climb_angle(height: float, speed: float, duration: mpf, ramp: float) -> mpf:
    """Angle of a climb whose duration is given."""

    def gained(angle: mpf) -> mpf:
        ramps = 2 * mpf(ramp) * mp.quad(lambda u: mp.sin(angle * rise(u)), [0, 0.5, 1])
        return speed * (ramps + (duration - 2 * mpf(ramp)) * mp.sin(angle))

    return mp.findroot(lambda angle: gained(angle) - height, height / (speed * duration))


def flight_profile() -> Profile:
    """FLIGHT, segment by segment."""
    with mp.workdps(30):  # of the numbers that define it; doubles know 16
        p = Profile(START)
        g = normal_gravity_mp(START.lat, START.h).down
        p.clock += 2
        p.pulse("pitch", 0.4, 0.3, 0.5 * 0.4 / 0.3)
        p.pulse("course", -5.0, 0.8, 1.0)
        p.pulse("speed", 30.0, 2.5, 2.0)
        p.clock += mpf(100) / 30
        p.pulse("course", 110.0 * DEG, 0.3, 2.0, bank=True)
        duration = climb_time(6.0 * DEG, 25.0, 30.0, 2.0)
        p.climb(mpf(6.0 * DEG), p.clock, duration, mpf(2))
        p.clock += duration
        p.pulse("course", -1.0, 30.0 / 80.0, 0.5)
        begin = p.clock
        p.pulse("course", -2.5 * np.pi, 0.35, 2.0, bank=True)
        p.climb(-climb_angle(20.0, 30.0, p.clock - begin, 2.0), begin, p.clock - begin, mpf(2))
        rate = g * mp.tan(25.0 * DEG) / 30
        p.pulse("course", 0.9, rate, min(mpf(2), mpf(0.45) / rate), bank=True)
        p.pulse("course", 2 * np.pi, 0.6, 2.0)
        p.pulse("course", -2 * np.pi, 0.6, 2.0)
        p.climb(-climb_angle(10.0, 30.0, mpf(9), 3.0), p.clock, mpf(9), mpf(3))
        p.clock += 9
        p.pulse("speed", -30.0, 3.0, 2.0)
        p.pulse("roll", 2.0, 0.5, 2.0)
        return p


PROFILE = flight_profile()
MOTION = Segments(START, FLIGHT)
# in every segment, on ramps and between them, away from the ends
INSIDE = (0.7, 2.4, 6.9, 10.3, 13.0, 21.0, 27.3, 29.1, 33.9, 37.0, 38.9, 42.0, 43.7, 47.1, 60.0)
LATER = (69.3, 71.4, 74.9, 80.2, 88.8, 95.0, 97.2, 106.0, 109.0, 112.0, 114.5)


def velocity(p: Profile, t: mpf) -> tuple[mpf, mpf, mpf]:
    """North, east, up."""
    speed, climb = p.channel("speed", t), p.climb_angle(t)
    course = p.start.heading - mpf(p.start.crab) + p.channel("course", t)
    level = speed * mp.cos(climb)
    return level * mp.cos(course), level * mp.sin(course), speed * mp.sin(climb)


def attitude(p: Profile, t: mpf, g: mpf) -> mp.matrix:
    """C_nb."""
    speed, climb, rate = p.channel("speed", t), p.climb_angle(t), p.course_rate(t)
    banked = any(begin <= t <= end for begin, end in p.banked)
    bank = mp.atan(speed * rate * mp.cos(climb) / g) if banked else mpf(0)
    return from_euler(
        mpf(p.start.roll) + p.channel("roll", t) + bank,
        mpf(p.start.pitch) + p.channel("pitch", t) + climb,
        mpf(p.start.heading) + p.channel("course", t),
    )


def around(t0: float) -> Pose:
    """Pose around a time, from the velocity and the true position there.

    The second derivatives of latitude and longitude come from differencing their rates.
    """
    truth = true_trajectory(MOTION, [t0])
    start = tuple(mpf(float(x[0])) for x in (truth.lat, truth.lon, truth.h))
    g = normal_gravity_mp(START.lat, START.h).down

    def rates(t: mpf, lat: mpf, h: mpf) -> tuple[mpf, mpf, mpf]:
        north, east, up = velocity(PROFILE, t)
        meridian, transverse = radii(lat)
        return north / (meridian + h), east / ((transverse + h) * mp.cos(lat)), up

    with mp.workdps(120):
        first = rates(mpf(t0), start[0], start[2])
        step = mpf(10) ** -40  # s
        moved = [
            rates(mpf(t0) + s, start[0] + first[0] * s, start[2] + first[2] * s)
            for s in (-step, step)
        ]
        second = [(b - a) / (2 * step) for a, b in zip(*moved, strict=True)]

    def pose(t: mpf) -> tuple[mp.matrix, mp.matrix]:
        s = t - mpf(t0)
        lat, lon, h = (
            x + v * s + a * s**2 / 2 for x, v, a in zip(start, first, second, strict=True)
        )
        return over_earth(lat, lon, h, attitude(PROFILE, t, g))

    return pose


def test_ends_of_the_segments() -> None:
    """The flight lasts as long as its segments promise."""
    assert len(MOTION.ends) == len(FLIGHT)
    assert MOTION.end == MOTION.ends[-1]
    assert MOTION.end == pytest.approx(float(PROFILE.clock), abs=1e-12)  # s, rounding


@pytest.mark.parametrize("times", [INSIDE, LATER])
def test_rates(times: Sequence[float]) -> None:
    """Rates, force and velocity agree with high precision to rounding."""
    found = mismatch(MOTION, around, times)
    # times in a ramp are rounded to 1e-14 s, and rates and forces change by 0.3 rad/s² and
    # 40 m/s³; the course adds up 50 pieces, 5e-15 rad of 30 m/s
    assert found.omega < 2e-14  # rad/s
    assert found.f < 5e-13  # m/s^2
    assert found.v < 5e-13  # m/s


def test_position_is_the_integral_of_velocity() -> None:
    """Earth-fixed position against quadrature of Earth-fixed velocity: no radius enters."""
    edges = np.union1d(np.linspace(0.0, MOTION.end, 800), MOTION.knots)
    x, w = np.polynomial.legendre.leggauss(8)
    dt = np.diff(edges)
    t = (edges[:-1, None] + dt[:, None] * 0.5 * (1.0 + x)).ravel()
    v_e = np.array(MOTION.at(t).v_e).reshape(3, *dt.shape, len(x))
    moved = np.cumsum(v_e @ (0.5 * w) * dt, axis=1)
    r_e = np.array(MOTION.at(edges).r_e)
    # m: Earth-fixed coordinates are rounded to 1e-9 m, latitudes and longitudes no less
    assert np.abs(r_e[:, 1:] - r_e[:, :1] - moved).max() < 5e-9


def test_closes() -> None:
    """The whole flight, navigated, ends where it ends, across the antimeridian."""
    error = closing(MOTION, np.arange(0.0, MOTION.end, 0.005))
    # m: roundings of positions, and 1e-12 m/s^2 of the engine's gravity
    assert max(error.horizontal, error.vertical) < 3e-8
    lon = true_trajectory(MOTION, [0.0, MOTION.end]).lon
    assert lon[0] > 3.0 and lon[1] < -3.0


def test_smooth_across_knots() -> None:
    """Angular rate, acceleration and angular acceleration do not jump, nor their slopes."""
    gap = 1e-6  # s
    for values in (
        lambda t: np.concatenate(imu_rates(MOTION, t), axis=1),
        lambda t: np.stack(MOTION.at(t).alpha_eb_b, axis=1),
    ):
        before, after = (values(MOTION.knots + side) for side in (-gap, gap))
        # force changes fastest, at the turn of 11 m/s^2 reached within half a second
        assert np.abs(after - before).max() < 2.0 * gap * 60.0  # m/s^3
        slope = (values(MOTION.knots - gap) - values(MOTION.knots - 3.0 * gap)) / (2.0 * gap)
        later = (values(MOTION.knots + 3.0 * gap) - values(MOTION.knots + gap)) / (2.0 * gap)
        # 4 us apart, of second slopes below 500 per s^2, those of angular acceleration
        assert np.abs(later - slope).max() < 2e-3


def test_what_the_segments_promise() -> None:
    """Heights, headings, speeds and still attitudes at the ends of the segments."""
    at_ends = true_trajectory(MOTION, MOTION.ends)
    speed = np.linalg.norm(at_ends.v_eb_n, axis=1)
    assert speed[[0, 1, 2]] == pytest.approx(0.0, abs=1e-15)  # m/s
    assert speed[3:12] == pytest.approx(30.0, abs=1e-12)
    assert speed[12:] == pytest.approx(0.0, abs=1e-15)
    h = at_ends.h - START.h
    assert h[6] == pytest.approx(25.0, abs=1e-8)  # m
    assert h[8] == pytest.approx(5.0, abs=1e-8)
    assert h[11] == pytest.approx(-5.0, abs=1e-8)
    roll, pitch, heading = at_ends.euler.T
    assert pitch[-2] == pytest.approx(0.38, abs=1e-12)  # rad: it stays as it was rotated
    assert roll[-1] == pytest.approx(2.03, abs=1e-12)
    turned = 1.2 - 5.0 + 110.0 * DEG - 1.0 - 2.5 * np.pi + 0.9
    assert np.cos(heading[-1] - turned) == pytest.approx(1.0, abs=1e-15)
    spot = np.ptp(true_trajectory(MOTION, np.linspace(0.0, MOTION.ends[2], 50)).lat)
    assert spot < 1e-15  # rad


def test_coordinated_turns() -> None:
    """In a banked turn nothing pulls sideways but the Earth's rotation; the bank is as asked."""
    motion = Segments(
        Start(0.6, 1.0, 900.0, speed=60.0), [BankToTurn(30.0 * DEG, -2.0), Straight(5.0)]
    )
    t = np.linspace(0.0, motion.end, 400)
    _, f = imu_rates(motion, t)
    # 2 * 7.3e-5 rad/s * 60 m/s of Coriolis, and as much again of the curved Earth
    assert np.abs(f[:, 1]).max() < 2e-2  # m/s^2
    roll = true_trajectory(motion, t).euler[:, 0]
    assert roll.min() == pytest.approx(-30.0 * DEG, abs=1e-12)
    assert extremes(motion).f == pytest.approx(9.79 / np.cos(30.0 * DEG), abs=0.03)  # m/s^2


def test_times_in_a_motion_of_many_pieces() -> None:
    """One instant at a time or all together: the same."""
    t = np.linspace(0.0, MOTION.end, 31)
    together = imu_rates(MOTION, t)
    single = [imu_rates(MOTION, [x]) for x in t]
    for k in range(2):
        assert np.abs(together[k] - np.concatenate([s[k] for s in single])).max() < 1e-14


STANDING, MOVING = Start(0.5, 0.5, 0.0), Start(0.5, 0.5, 0.0, speed=10.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Segments(MOVING, []), "segments must not be empty"),
        (lambda: Segments(MOVING, [Still(3.0)]), "segment 1, Still: the vehicle moves at 10 m/s"),
        (lambda: Segments(STANDING, [Still(0.0)]), r"duration must be positive, got 0.0 s"),
        (
            lambda: Segments(STANDING, [Still(1.0), Turn(1.0, radius=5.0)]),
            "segment 2, Turn: the vehicle stands; a turn needs speed",
        ),
        (lambda: Segments(STANDING, [FigureEight(rate=1.0)]), "FigureEight: the vehicle stands"),
        (lambda: Segments(STANDING, [Spiral(1.0, 5.0, rate=1.0)]), "Spiral: the vehicle stands"),
        (lambda: Segments(STANDING, [Climb(5.0, duration=9.0)]), "a climb needs speed"),
        (lambda: Segments(STANDING, [Straight(distance=9.0)]), "a distance needs speed"),
        (lambda: Segments(STANDING, [BankToTurn(0.3, 1.0)]), "a banked turn needs speed"),
        (lambda: Segments(MOVING, [Rotate("roll", 1.0, 1.0)]), "cannot rotate on the spot"),
        (lambda: Segments(STANDING, [Rotate("yaw", 1.0, 1.0)]), "axis must be roll, pitch or head"),
        (lambda: Segments(MOVING, [Turn(0.0, rate=1.0)]), "angle must be finite and not zero"),
        (
            lambda: Segments(MOVING, [Turn(1.0)]),
            "give one of duration, rate and radius, got none",
        ),
        (
            lambda: Segments(MOVING, [Turn(1.0, rate=1.0, radius=3.0)]),
            "give one of duration, rate and radius, got rate and radius",
        ),
        (lambda: Segments(MOVING, [Turn(1.0, rate=-1.0)]), "rate must be positive, got -1.0 rad/s"),
        (lambda: Segments(MOVING, [Turn(1.0, radius=0.0)]), "radius must be positive, got 0.0 m"),
        (
            lambda: Segments(MOVING, [Turn(1.0, rate=1.0, ramp=1.5)]),
            "ramp must be positive and at most 1 s for this rate, got 1.5 s",
        ),
        (
            lambda: Segments(MOVING, [Turn(1.0, duration=2.0, ramp=1.5)]),
            "ramp must be positive and at most half of the 2 s, got 1.5 s",
        ),
        (lambda: Segments(MOVING, [Accelerate(-1.0, duration=2.0)]), "to_speed must not be neg"),
        (lambda: Segments(MOVING, [Accelerate(10.0, duration=2.0)]), "the speed is 10 m/s already"),
        (
            lambda: Segments(MOVING, [Climb(50.0, duration=4.0)]),
            "climbing that high in 4 s is steeper than 80°",
        ),
        (lambda: Segments(MOVING, [Climb(5.0, angle=1.5)]), "at most 80° steep, got 85.9"),
        (lambda: Segments(MOVING, [Climb(5.0, angle=0.2, ramp=9.0)]), "at most .* for this climb"),
        (lambda: Segments(MOVING, [BankToTurn(1.5, 1.0)]), "bank must be above 0° and at most 80°"),
        (lambda: Start(1.555, 0.0, 0.0), "the start is at latitude 89.09.*beyond ±89°"),
        (lambda: Start(0.5, 0.0, 0.0, speed=-1.0), "start speed must not be negative, got -1.0"),
        (lambda: Start(0.5, np.nan, 0.0), "start lon must be finite, got nan"),
        (
            lambda: Segments(Start(1.55, 0.0, 0.0, speed=300.0), [Straight(duration=300.0)]),
            "the path is at latitude 89.0.*beyond ±89°",
        ),
    ],
)
def test_refusals(make: Callable[[], object], message: str) -> None:
    """What cannot be done is said, with the segment and the way out."""
    with pytest.raises(ValueError, match=message):
        make()
