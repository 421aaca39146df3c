"""Laws of motion and of integration that every algorithm of the registries obeys."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np
import pymap3d
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from earth._jit import kernel
from earth.summation import compensated_sum
from navgrade import ImuSamples, NavState, Trajectory, navigate
from navgrade.mechanization import MECHANIZATIONS, World
from navgrade.navigation import solve
from navgrade.reconstruction import DEFAULT, RECONSTRUCTIONS, reconstruct
from navgrade.vertical import BaroLoop
from tests.navgrade.engine import attitude_error, fly, samples, state_at
from tests.oracles.cases import position_error
from tests.oracles.constants import E2, EQUATORIAL_RADIUS, OMEGA
from tests.oracles.gravity import normal_gravity_zonal
from tests.oracles.truth import Coordinate, Motion, manoeuvre, static

Array = NDArray[np.float64]

DEG = np.pi / 180.0
PAIRS = list(itertools.product(RECONSTRUCTIONS, MECHANIZATIONS))
EACH_FRAME = pytest.mark.parametrize("mechanization", MECHANIZATIONS)
SPIN = np.array([0.0, 0.0, OMEGA])


# --- the Earth, by other means than the package ---------------------------------------------------


def ecef(lat: float, lon: float, h: float) -> Array:
    """Earth-fixed position, m."""
    return np.array(pymap3d.geodetic2ecef(lat, lon, h, deg=False))


def C_en(lat: float, lon: float) -> Array:
    """North, east, down to Earth-fixed axes."""
    north = (-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat))
    east = (-np.sin(lon), np.cos(lon), 0.0)
    down = (-np.cos(lat) * np.cos(lon), -np.cos(lat) * np.sin(lon), -np.sin(lat))
    return np.array([north, east, down]).T


def gravity_e(r: Array) -> Array:
    """Gravity at an Earth-fixed position, m/s^2."""
    lat, lon, h = (float(x) for x in pymap3d.ecef2geodetic(*r, deg=False))
    g = normal_gravity_zonal(lat, h)
    return C_en(lat, lon) @ np.array([float(g.north), 0.0, float(g.down)])


def integrated(rates: Callable[[float, Array], Array], start: Array, t: Array) -> Array:
    """Solution of an ordinary differential equation at times `t`, one row each."""
    span = (0.0, float(t[-1]))
    # the states are departures from the start, of metres to kilometres and as many m/s
    found = solve_ivp(rates, span, start, "DOP853", t, rtol=1e-10, atol=1e-10)
    assert found.success
    return found.y.T


def rows_at(nav: Trajectory, t: Array) -> NDArray[np.intp]:
    """Rows of a solution that end at the times `t`."""
    rows = np.searchsorted(nav.t, t - 1e-6)
    np.testing.assert_allclose(nav.t[rows], t, atol=1e-6)
    return rows


# --- at rest --------------------------------------------------------------------------------------


@cache
def resting_log(lat_deg: float, duration: float, dt: float) -> tuple[Motion, ImuSamples]:
    """A tilted base at rest and what an IMU on it feels."""
    base = static(lat_deg, -170.0, 1200.0, 33.0, -61.0, 250.0)
    # every interval feels the same: the first one, repeated
    one = base.increments(np.array([0.0, dt]))
    n = round(duration / dt)
    return base, ImuSamples(
        t=np.arange(1, n + 1) * dt,
        dt=np.full(n, dt),
        gyro=np.repeat(one.dtheta, n, axis=0),
        accel=np.repeat(one.dvel, n, axis=0),
        kind="increment",
    )


STILL = [
    *((reconstruction, frame, -45.0) for reconstruction, frame in PAIRS),
    *itertools.product([DEFAULT], MECHANIZATIONS, [-89.0, 0.0, 37.0, 89.5]),
]


@pytest.mark.parametrize(("reconstruction", "mechanization", "lat_deg"), STILL)
def test_still_stays_still(reconstruction: str, mechanization: str, lat_deg: float) -> None:
    """Two minutes at rest, tilted: no motion beyond rounding."""
    base, log = resting_log(lat_deg, 120.0, 0.02)
    nav = navigate(
        log, state_at(base, 0.0), reconstruction=reconstruction, mechanization=mechanization
    )
    truth = base.state(nav.t)
    error = position_error(nav, truth)
    # m: the gravity fit, 1e-12 m/s^2 here, is 7 nm after 120 s. Frame i sees gravity turn and
    # takes it at the middle of intervals of up to 80 ms (four samples): g (omega dt)^2 / 24 =
    # 1.4e-11 m/s^2, 0.1 um. "none" and "euler" leave theta x v / 2, 5e-6 m/s^2 at 50 Hz, 36 mm;
    # "midpoint" moves by half of dv dt, dt theta x v / 12 too far: 24 nm/s, 2.9 um
    limit = {"none": 0.04, "euler": 0.04, "midpoint": 4e-6}.get(reconstruction, 1e-7)
    assert error.horizontal < limit
    assert error.vertical < limit
    if reconstruction not in ("none", "euler"):
        assert np.abs(nav.v_eb_n).max() < 2e-9  # m/s: the same over 120 s
        # rad: 6,000 roundings, compensated; a false way turns level and north, tan(45°) times too
        assert attitude_error(nav, truth).max() < 1e-13 + (
            2.0 * limit / 6.4e6 if limit > 1e-7 else 0.0
        )


# --- the errors of a navigator at rest are swings and a runaway -----------------------------------


@cache
def held_swing(lat: float, lon: float, h: float, v_north: float) -> tuple[Array, Array, Array]:
    """Each minute of a day (s) and the north and east departure (m) of a navigator at rest.

    It starts with a false velocity. Its gyros are right, so its axes keep their attitude to the
    Earth; the specific force it feels is fixed in them, and gravity turns away under its false
    position. Height is held.
    """
    t = np.arange(1, 1441) * 60.0
    g = normal_gravity_zonal(lat, h)
    f_e = C_en(lat, lon) @ np.array([-float(g.north), 0.0, -float(g.down)])

    def radii(lat: float) -> tuple[float, float]:
        w2 = 1.0 - E2 * np.sin(lat) ** 2
        transverse = EQUATORIAL_RADIUS / np.sqrt(w2)
        return transverse * (1.0 - E2) / w2 + h, transverse + h

    meridian, transverse = radii(lat)
    per_metre = np.array([1.0 / meridian, 1.0 / (transverse * np.cos(lat))])

    def rates(_: float, y: Array) -> Array:
        north, east, v_north, v_east = y
        L, lam = lat + north * per_metre[0], lon + east * per_metre[1]
        r_m, r_n = radii(L)
        f = C_en(L, lam).T @ f_e
        turn = 2.0 * OMEGA * np.sin(L) + v_east * np.tan(L) / r_n
        return np.array(
            [
                v_north / r_m / per_metre[0],
                v_east / (r_n * np.cos(L)) / per_metre[1],
                f[0] + float(normal_gravity_zonal(L, h).north) - turn * v_east,
                f[1] + turn * v_north,
            ]
        )

    y = integrated(rates, np.array([0.0, 0.0, v_north, 0.0]), t)
    return t, y[:, 0], y[:, 1]


@EACH_FRAME
@pytest.mark.parametrize("lat_deg", [45.0, -30.0])
def test_schuler_and_foucault(mechanization: str, lat_deg: float) -> None:
    """A false velocity swings for a day: Schuler's period, in a plane that turns as Foucault's."""
    lat, lon, h = lat_deg * DEG, -170.0 * DEG, 1200.0
    base, log = resting_log(lat_deg, 86_400.0, 1.0)
    true = state_at(base, 0.0)
    v_north = 0.1  # m/s
    kicked = NavState(lat=lat, lon=lon, h=h, v_eb_n=np.array([v_north, 0.0, 0.0]), q_nb=true.q_nb)
    nav = navigate(
        log, kicked, mechanization=mechanization, vertical="hold", reconstruction="causal-1"
    )
    w2 = 1.0 - E2 * np.sin(lat) ** 2
    transverse = EQUATORIAL_RADIUS / np.sqrt(w2) + h
    meridian = EQUATORIAL_RADIUS * (1.0 - E2) / w2**1.5 + h
    north, east = (nav.lat - lat) * meridian, (nav.lon - lon) * transverse * np.cos(lat)

    t, exact_north, exact_east = held_swing(lat, lon, h, v_north)
    rows = rows_at(nav, t)
    # m: of a swing of 81 m. What a step of 1 s gains in vertical velocity before it is held back
    # is felt by Coriolis, which feeds the swing by up to 2 (omega cosL)^2 x 1 s: 2e-4 of it a day.
    np.testing.assert_allclose(north[rows], exact_north, atol=0.02)
    np.testing.assert_allclose(east[rows], exact_east, atol=0.02)

    # unwound by Foucault's turn the swing stays in its first plane, but for a share that grows as
    # the periods along the meridian and across it, 0.15 min apart, go out of step
    plane = (north + 1j * east) * np.exp(-1j * OMEGA * np.sin(lat) * nav.t)
    through = nav.t[np.flatnonzero(plane.real[:-1] * plane.real[1:] < 0)]
    # min: 84.4 on a sphere; the radii of the ellipsoid move it by 0.1 either way
    assert 2.0 * np.diff(through).mean() / 60.0 == pytest.approx(84.4, abs=0.1)
    speed = np.hypot(*np.diff([north, east], axis=1))
    far = np.flatnonzero((speed[1:-1] < speed[:-2]) & (speed[1:-1] <= speed[2:])) + 1
    bearing = np.unwrap(2.0 * np.arctan2(east[far], north[far])) / 2.0
    turned = np.polyfit(nav.t[far], bearing, 1)[0]
    # clockwise in the north; 33.85 h at 45 degrees, 47.9 h at 30
    assert 2.0 * np.pi / turned / 3600.0 == pytest.approx(
        2.0 * np.pi / (OMEGA * np.sin(lat)) / 3600.0, rel=0.005
    )


@EACH_FRAME
@pytest.mark.parametrize("lat_deg", [45.0, -12.0])
def test_vertical_instability(mechanization: str, lat_deg: float) -> None:
    """A height error of 1 m grows as cosh(t / 570 s): 1.61 m after 600 s, 11.8 m after 1800 s."""
    base, log = resting_log(lat_deg, 1800.0, 0.1)
    true = state_at(base, 0.0)
    raised = NavState(lat=true.lat, lon=true.lon, h=true.h + 1.0, q_nb=true.q_nb)
    nav = navigate(log, raised, mechanization=mechanization, reconstruction="causal-1")
    t = np.array([60.0, 600.0, 1800.0])
    rows = rows_at(nav, t)
    # 1 %: 570 s is rounded, and over the poles it is 1 s more than over the equator
    np.testing.assert_allclose(nav.h[rows] - true.h, np.cosh(t / 570.0), rtol=0.01)

    r0 = ecef(true.lat, true.lon, true.h)
    f_e = -gravity_e(r0)
    up = -C_en(true.lat, true.lon)[:, 2]

    def rates(_: float, y: Array) -> Array:
        return np.concatenate([y[3:], f_e + gravity_e(r0 + y[:3]) - 2.0 * np.cross(SPIN, y[3:])])

    y = integrated(rates, np.concatenate([up, np.zeros(3)]), t)
    for k, row in enumerate(rows):
        r = ecef(nav.lat[row], nav.lon[row], nav.h[row])
        # m: frame i takes turning gravity at the middle of 0.1 s: g (omega dt)^2 / 24 =
        # 2e-11 m/s^2, grown to 0.1 mm at the end, where the height error is 11.8 m
        np.testing.assert_allclose(r, r0 + y[k, :3], atol=2e-4)


# --- falling --------------------------------------------------------------------------------------


def thrown(state: NavState, mechanization: str, duration: float) -> Trajectory:
    """Navigate a log in which nothing is felt."""
    n = round(duration / 0.01)
    nothing = ImuSamples(
        t=np.arange(1, n + 1) * 0.01,
        dt=np.full(n, 0.01),
        gyro=np.zeros((n, 3)),
        accel=np.zeros((n, 3)),
        kind="increment",
    )
    return navigate(nothing, state, mechanization=mechanization)


@EACH_FRAME
@pytest.mark.parametrize("lat_deg", [-77.0, -35.0, 0.0, 52.0])
def test_free_fall_is_straight_in_inertial_space(mechanization: str, lat_deg: float) -> None:
    """A body thrown without specific force moves as gravitation alone moves it."""
    lat, lon, h, duration = lat_deg * DEG, 170 * DEG, 3000.0, 20.0
    v = np.array([120.0, -200.0, -150.0])
    nav = thrown(NavState(lat=lat, lon=lon, h=h, v_eb_n=v), mechanization, duration)

    # inertial axes that agree with the Earth's at t = 0; gravitation is gravity there less the
    # centrifugal acceleration
    r0 = ecef(lat, lon, h)

    def rates(t: float, y: Array) -> Array:
        C_ie = Rotation.from_rotvec(SPIN * t)
        r_e = C_ie.apply(r0 + y[:3], inverse=True)
        pull = gravity_e(r_e) + np.cross(SPIN, np.cross(SPIN, r_e))
        return np.concatenate([y[3:], C_ie.apply(pull)])

    v0 = C_en(lat, lon) @ v + np.cross(SPIN, r0)
    y = integrated(rates, np.concatenate([np.zeros(3), v0]), np.array([duration]))[0]
    C_ei = Rotation.from_rotvec(-SPIN * duration)
    # m: the steps of 10 ms leave 0.02 um, conversions of a few nm each; a Coriolis term of the
    # wrong sign moves the end by 12 m
    end = ecef(nav.lat[-1], nav.lon[-1], nav.h[-1])
    np.testing.assert_allclose(end, C_ei.apply(r0 + y[:3]), atol=2e-7)
    # attitude: inertially fixed; rad
    C_nb = Rotation.from_quat(nav.q_nb[-1], scalar_first=True).as_matrix()
    C_eb = C_en(nav.lat[-1], nav.lon[-1]) @ C_nb
    np.testing.assert_allclose(C_eb, C_ei.as_matrix() @ C_en(lat, lon), atol=1e-12)


@EACH_FRAME
@pytest.mark.parametrize("lat_deg", [-60.0, 8.0, 45.0])
@pytest.mark.parametrize("up", [0.0, 100.0])
def test_coriolis_deflects_a_fall(mechanization: str, lat_deg: float, up: float) -> None:
    """Dropped, a body lands east by omega cosL g t^3 / 3; thrown up, it lands west."""
    t, lat = 20.0, lat_deg * DEG
    start = NavState(lat=lat, lon=1.0, h=4000.0, v_eb_n=np.array([0.0, 0.0, -up]))
    nav = thrown(start, mechanization, t)
    g = float(normal_gravity_zonal(lat, 4000.0).down)
    radius = EQUATORIAL_RADIUS / np.sqrt(1.0 - E2 * np.sin(lat) ** 2) + 4000.0
    east = (nav.lon[-1] - 1.0) * radius * np.cos(lat)
    expected = OMEGA * np.cos(lat) * (g * t**3 / 3.0 - up * t**2)
    # 1.9 cosL m and -1.0 cosL m; g grows by 0.06 % on the 2 km down
    assert east == pytest.approx(expected, rel=1e-3)


# --- symmetries -----------------------------------------------------------------------------------

# Reflections keep the laws of motion where they keep the Earth's rotation. A rate is an axial
# vector: reflected in a plane it keeps the component across the plane and turns the others round.


def reflected(state: NavState, lat: float, lon: float, v: tuple[float, ...], axis: int) -> NavState:
    """Reflected state; the body is reflected across the same axis of n and of b."""
    q = -state.q_nb
    q[[0, axis + 1]] *= -1.0
    return NavState(lat=lat, lon=lon, h=state.h, v_eb_n=state.v_eb_n * v, q_nb=q, t=state.t)


LOOKING_AROUND = 24  # intervals before and after, for windows that look back or ahead


def weaving_log(duration: float, dt: float) -> tuple[NavState, ImuSamples, float]:
    """A manoeuvre from its middle on: state at the start, log with context, time of the end."""
    n = 12 * round(duration / dt / 12)  # whole blocks of 2, 3 and 4 samples
    edges = np.arange(-LOOKING_AROUND, n + LOOKING_AROUND + 1) * dt + 7.0
    return state_at(manoeuvre(), 7.0), samples(manoeuvre().increments(edges)), 7.0 + n * dt


def nav_at(nav: Trajectory, t: float) -> NavState:
    """Navigated state at one time."""
    return nav.state(int(rows_at(nav, np.array([t]))[0]))


def distance(a: NavState, b: NavState) -> float:
    """Between two positions, m."""
    return float(np.linalg.norm(ecef(a.lat, a.lon, a.h) - ecef(b.lat, b.lon, b.h)))


@pytest.mark.parametrize(("reconstruction", "mechanization"), PAIRS)
def test_the_south_mirrors_the_north(reconstruction: str, mechanization: str) -> None:
    """The same flight reflected in the equator's plane ends at the reflected point."""
    start, log, end = weaving_log(24.0, 0.02)
    choices: Any = {"reconstruction": reconstruction, "mechanization": mechanization}
    north = nav_at(navigate(log, start, **choices), end)
    image = ImuSamples(
        t=log.t,
        dt=log.dt,
        gyro=log.gyro * [1.0, -1.0, -1.0],
        accel=log.accel * [-1.0, 1.0, 1.0],
        kind="increment",
    )
    mirrored = reflected(start, -start.lat, start.lon, (-1.0, 1.0, 1.0), 0)
    south = nav_at(navigate(image, mirrored, **choices), end)
    image_of_end = reflected(north, -north.lat, north.lon, (-1.0, 1.0, 1.0), 0)
    assert distance(south, image_of_end) < 1e-8  # m: rounding of a few positions
    np.testing.assert_allclose(south.v_eb_n, image_of_end.v_eb_n, atol=1e-11)  # m/s: rounding


@pytest.mark.parametrize(("reconstruction", "mechanization"), PAIRS)
def test_time_reversal_returns_to_the_start(reconstruction: str, mechanization: str) -> None:
    """The way back, with time and the Earth's rotation reversed, ends where the flight began.

    The Earth is reversed by reflection in a meridian plane, so that the same Earth serves.
    """
    start, log, end = weaving_log(60.0, 0.02)
    choices: Any = {"reconstruction": reconstruction, "mechanization": mechanization}
    there = nav_at(navigate(log, start, **choices), end)
    reversed_log = ImuSamples(
        t=(start.t + end - (log.t - log.dt))[::-1],
        dt=log.dt[::-1],
        gyro=log.gyro[::-1] * [1.0, -1.0, 1.0],
        accel=log.accel[::-1] * [1.0, -1.0, 1.0],
        kind="increment",
    )
    # time turns all velocities round, the reflection that of the east once more
    turned = reflected(there, there.lat, -there.lon, (-1.0, 1.0, -1.0), 1)
    turned = NavState(turned.lat, turned.lon, turned.h, turned.v_eb_n, turned.q_nb, start.t)
    back = nav_at(navigate(reversed_log, turned, **choices), end)
    home = reflected(back, back.lat, -back.lon, (-1.0, 1.0, -1.0), 1)
    away = distance(home, start)
    # m: what the way there has left in position and velocity may come back doubled, not grown
    true = state_at(manoeuvre(), end)
    slip = (end - start.t) * float(np.linalg.norm(there.v_eb_n - true.v_eb_n))
    assert away < 2.0 * (distance(there, true) + slip) + 1e-8
    if getattr(RECONSTRUCTIONS[reconstruction], "ahead", 0) and reconstruction != "euler":
        # a window that looks ahead as far as back retraces its steps: rounding alone is left; but
        # Euler takes the rate at the start, which is the end on the way back
        assert away < 1e-8  # m
        assert np.abs(home.v_eb_n - start.v_eb_n).max() < 5e-11  # m/s


# --- bookkeeping ----------------------------------------------------------------------------------


def columns(nav: Trajectory) -> list[bytes]:
    """All numbers of a solution, to the last bit."""
    values = (nav.t, nav.lat, nav.lon, nav.h, nav.v_eb_n, nav.q_nb, nav.status)
    return [np.ascontiguousarray(column).tobytes() for column in values]


@pytest.mark.parametrize(("reconstruction", "mechanization"), PAIRS)
def test_blocks_leave_no_trace(reconstruction: str, mechanization: str) -> None:
    """The solution does not depend, bit for bit, on where blocks of samples end."""
    edges = np.cumsum(np.concatenate([[3.0], 0.01 + 0.002 * np.sin(np.arange(2400.0))]))
    log = samples(manoeuvre().increments(edges))
    start = state_at(manoeuvre(), float(edges[12]))
    seconds = np.arange(2.0, 32.0)  # s; the vertical loop carries the most from block to block
    heights = BaroLoop(t=seconds, h=manoeuvre().state(seconds).h)

    def solved(log: ImuSamples, size: int) -> list[bytes]:
        solutions = solve(
            log.blocks(size),
            start,
            reconstruction=reconstruction,
            mechanization=mechanization,
            vertical=heights,
        )
        pieces = [columns(nav) for nav in solutions]
        return [b"".join(column) for column in zip(*pieces, strict=True)]

    assert solved(log, 1000) == solved(log, 2400)
    assert solved(log[:420], 7) == solved(log[:420], 420)
    assert solved(log[:60], 1) == solved(log[:60], 60)


@EACH_FRAME
def test_hold_keeps_the_height(mechanization: str) -> None:
    """Held, the height does not move and vertical velocity is zero, whatever is felt."""
    motion = manoeuvre()
    nav, _ = fly(motion, np.arange(2001) * 0.01, vertical="hold", mechanization=mechanization)
    height = motion.state(0.0).h[0]
    assert np.abs(nav.h - height).max() < 5e-9  # m: rounding of an Earth-fixed position
    assert np.abs(nav.v_eb_n[:, 2]).max() < 1e-12  # m/s: rounding of 300 m/s


@kernel
def summed(total, step, n):
    """Add `step` n times, as the frames do."""
    lost = 0.0
    for _ in range(n):
        total, lost = compensated_sum(total, lost, step)
    return total


def test_sums_lose_nothing() -> None:
    """A hundred million equal steps add up to their product, within one rounding."""
    step, n = np.pi * 1e-9, 100_000_000  # rad, 20 mm of latitude
    exact = Fraction(0.7) + n * Fraction(step)
    # rad: half a unit in the last place of 1.01, 0.7 nm; a plain sum is off by 0.1 m
    assert abs(Fraction(float(summed(0.7, step, n))) - exact) <= Fraction(1.2e-16)


@EACH_FRAME
def test_a_million_steps_lose_nothing(mechanization: str) -> None:
    """A steady drive east in steps of 0.1 ms: each frame's own sums keep the digits."""
    motion = Motion(
        lat=Coordinate(40.0 * DEG),
        lon=Coordinate(3.0, rate=2e-5),  # rad/s, 98 m/s
        h=Coordinate(1500.0),
        roll=Coordinate(0.3),
        pitch=Coordinate(-0.5),
        heading=Coordinate(1.0),
    )
    log = samples(motion.increments(np.arange(1001) * 1e-4))
    (rows,) = reconstruct([log], "causal-1")  # exact for constant rates
    start = state_at(motion, 0.0)
    mechanizer = MECHANIZATIONS[mechanization].start(start, World.around(start))
    for _ in range(1000):
        nav = mechanizer.advance(rows)
    truth = motion.state(100.0)
    error = position_error(nav[-1:], truth)
    # m: the gravity fit, 1e-12 m/s^2, is 5 nm after 100 s, and so is the rounding of a million
    # velocities; plain sums of positions lose up to 1 mm
    assert error.horizontal < 3e-8
    assert error.vertical < 3e-8
