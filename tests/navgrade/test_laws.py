"""Laws every algorithm of the registries obeys."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
import pytest

from navgrade import ImuSamples, NavgradeError, NavState, navigate
from navgrade.mechanization import MECHANIZATIONS
from navgrade.mechanization.ned import compensated_sum
from navgrade.reconstruction import RECONSTRUCTIONS
from tests.navgrade.engine import attitude_error, fly, samples, state_at
from tests.oracles.cases import position_error
from tests.oracles.constants import E2, EQUATORIAL_RADIUS, OMEGA
from tests.oracles.gravity import normal_gravity_zonal
from tests.oracles.truth import Coordinate, Motion, Sinusoid, manoeuvre, static

DEG = np.pi / 180.0
PAIRS = list(itertools.product(RECONSTRUCTIONS, MECHANIZATIONS))


@pytest.mark.parametrize(("reconstruction", "mechanization"), PAIRS)
@pytest.mark.parametrize("lat_deg", [-89.0, -45.0, 0.0, 37.0, 89.5])
def test_still_stays_still(reconstruction: str, mechanization: str, lat_deg: float) -> None:
    """Ten minutes at rest, tilted: no motion beyond rounding."""
    base = static(lat_deg, -170.0, 1200.0, 33.0, -61.0, 250.0)
    nav, truth = fly(
        base, np.arange(60_001) * 0.01, reconstruction=reconstruction, mechanization=mechanization
    )
    error = position_error(nav, truth)
    # m: the gravity fit, 1e-12 m/s^2 here, is 2e-7 m after 600 s; "none" leaves theta x v / 2,
    # 7e-6 m/s^2 at 100 Hz, twice integrated 1.3 m
    limit = 2.0 if reconstruction == "none" else 5e-7
    assert error.horizontal < limit
    assert error.vertical < limit
    if reconstruction != "none":
        assert np.abs(nav.v_eb_n).max() < 2e-9  # m/s: the same over 600 s
        assert attitude_error(nav, truth).max() < 1e-13  # rad: 60,000 roundings, compensated


@pytest.mark.parametrize("mechanization", MECHANIZATIONS)
def test_schuler_period(mechanization: str) -> None:
    """An initial velocity error north swings with the Schuler period of the meridian."""
    lat, h, dt = 45 * DEG, 0.0, 0.1
    base = static(45.0, 10.0, h, 5.0, 4.0, 30.0)
    start = state_at(base, 0.0)
    kicked = NavState(
        lat=start.lat, lon=start.lon, h=h, v_eb_n=np.array([0.1, 0, 0]), q_nb=start.q_nb
    )
    nav = navigate(
        samples(base.increments(np.arange(60_001) * dt)),
        kicked,
        mechanization=mechanization,
        vertical="hold",
    )
    meridian = EQUATORIAL_RADIUS * (1 - E2) / (1 - E2 * np.sin(lat) ** 2) ** 1.5
    g = normal_gravity_zonal(lat, h).down
    omega_s = np.sqrt(float(g) / meridian)
    north = (nav.lat - lat) * meridian
    back = nav.t[np.flatnonzero((north[:-1] > 0) & (north[1:] <= 0))[0]]
    # half a period; the Foucault rotation, 7 % of the rate in 42 min, changes it by 0.3 %
    assert back == pytest.approx(np.pi / omega_s, rel=0.005)
    # amplitude v / omega_s = 80.6 m, less the 3 % that Coriolis has turned east by then
    assert north.max() == pytest.approx(0.1 / omega_s, rel=0.03)


@pytest.mark.parametrize("mechanization", MECHANIZATIONS)
def test_vertical_instability(mechanization: str) -> None:
    """A height error of 1 m grows as cosh(t sqrt(2 g / R)): 1.609 m after 600 s."""
    base = static(45.0, 10.0, 0.0, 5.0, 4.0, 30.0)
    start = state_at(base, 0.0)
    raised = NavState(lat=start.lat, lon=start.lon, h=1.0, v_eb_n=start.v_eb_n, q_nb=start.q_nb)
    nav = navigate(
        samples(base.increments(np.arange(6_001) * 0.1)), raised, mechanization=mechanization
    )
    assert nav.h[-1] == pytest.approx(1.609, abs=0.005)  # m: table of the gradient, 3.086e-6 1/s^2


@pytest.mark.parametrize("mechanization", MECHANIZATIONS)
def test_free_fall_is_straight_in_inertial_space(mechanization: str) -> None:
    """A body thrown without specific force moves as gravitation alone moves it."""
    lat, lon, h, dt, n = -35 * DEG, 170 * DEG, 3000.0, 0.01, 2000
    v = np.array([120.0, -200.0, -150.0])
    t = np.arange(1, n + 1) * dt
    still = ImuSamples(
        t=t, dt=np.full(n, dt), gyro=np.zeros((n, 3)), accel=np.zeros((n, 3)), kind="increment"
    )
    nav = navigate(still, NavState(lat=lat, lon=lon, h=h, v_eb_n=v), mechanization=mechanization)

    w = np.array([0.0, 0.0, OMEGA])
    r0, C = _ecef(lat, lon, h), _C_en(lat, lon)
    r, r1 = r0, C @ v + np.cross(w, r0)  # inertial axes that agree with the Earth's at t = 0
    for _ in range(n):  # Runge-Kutta-Nystroem on the inertial acceleration
        k1 = _gravitation(r)
        k2 = _gravitation(r + dt / 2 * r1 + dt**2 / 8 * k1)
        k3 = _gravitation(r + dt * r1 + dt**2 / 2 * k2)
        r = r + dt * r1 + dt**2 / 6 * (k1 + 2 * k2)
        r1 = r1 + dt / 6 * (k1 + 4 * k2 + k3)
    angle = OMEGA * n * dt
    cos, sin = np.cos(angle), np.sin(angle)
    C_ei = np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    end = _ecef(nav.lat[-1], nav.lon[-1], nav.h[-1])
    # m: the trapezoid leaves dt^2/12 of the change of acceleration, 1e-6 m here; a Coriolis
    # term of the wrong sign moves the end by 12 m
    np.testing.assert_allclose(end, C_ei @ r, atol=1e-4)
    # attitude: inertially fixed
    C_nb = _C_en(nav.lat[-1], nav.lon[-1]).T @ C_ei @ C
    w_, x, y, z = nav.q_nb[-1]
    assert C_nb[0, 1] == pytest.approx(2 * (x * y - w_ * z), abs=1e-10)  # rad
    assert C_nb[2, 0] == pytest.approx(2 * (x * z - w_ * y), abs=1e-10)


def _ecef(lat: float, lon: float, h: float) -> np.ndarray:
    N = EQUATORIAL_RADIUS / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    rho = (N + h) * np.cos(lat)
    return np.array([rho * np.cos(lon), rho * np.sin(lon), (N * (1 - E2) + h) * np.sin(lat)])


def _C_en(lat: float, lon: float) -> np.ndarray:
    north = [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)]
    east = [-np.sin(lon), np.cos(lon), 0.0]
    return np.stack([north, east, np.cross(north, east)], axis=-1)


def _gravitation(r: np.ndarray) -> np.ndarray:
    """Gravitation at an inertial position: gravity there less the centrifugal acceleration."""
    lon = np.arctan2(r[1], r[0])
    rho = np.hypot(r[0], r[1])
    lat = np.arctan2(r[2], rho * (1 - E2))
    for _ in range(8):
        N = EQUATORIAL_RADIUS / np.sqrt(1 - E2 * np.sin(lat) ** 2)
        lat = np.arctan2(r[2] + E2 * N * np.sin(lat), rho)
    h = rho / np.cos(lat) - EQUATORIAL_RADIUS / np.sqrt(1 - E2 * np.sin(lat) ** 2)
    g = normal_gravity_zonal(lat, h)
    g_i = _C_en(lat, lon) @ np.array([float(g.north), 0.0, float(g.down)])
    return g_i - OMEGA**2 * np.array([r[0], r[1], 0.0])


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_reconstruction_order(name: str) -> None:
    """Halving the interval shows the declared order in the velocity error."""
    errors = []
    intervals = (0.08, 0.04, 0.02)
    for dt in intervals:
        edges = np.arange(-4, round(60 / dt) + 1) * dt + 7.0
        nav, truth = fly(manoeuvre(), edges, 4, reconstruction=name)
        errors.append(np.abs(nav.v_eb_n - truth.v_eb_n).max())
    slope = np.polyfit(np.log(intervals), np.log(errors), 1)[0]
    assert slope == pytest.approx(RECONSTRUCTIONS[name].order, abs=0.2)


@pytest.mark.parametrize("name", MECHANIZATIONS)
def test_mechanization_order(name: str) -> None:
    """Halving the interval shows the declared order in the position error."""
    errors = []
    intervals = (0.08, 0.04, 0.02)
    for dt in intervals:
        edges = np.arange(-4, round(60 / dt) + 1) * dt + 7.0
        nav, truth = fly(manoeuvre(), edges, 4, mechanization=name)
        error = position_error(nav, truth)
        errors.append(max(error.horizontal, error.vertical))
    slope = np.polyfit(np.log(intervals), np.log(errors), 1)[0]
    assert slope == pytest.approx(MECHANIZATIONS[name].order, abs=0.2)


@pytest.mark.parametrize("mechanization", MECHANIZATIONS)
@pytest.mark.parametrize("east", [1.0, -1.0])
def test_date_line(mechanization: str, east: float) -> None:
    """Crossing the date line costs nothing, and longitude stays within ±180°."""

    def cross(lon: float) -> tuple[np.ndarray, np.ndarray]:
        motion = Motion(
            lat=Coordinate(-17 * DEG, sinusoids=(Sinusoid(1e-4, 0.1),)),
            lon=Coordinate(lon - east * 1e-4, rate=east * 4e-5),
            h=Coordinate(900.0),
            roll=Coordinate(0.1),
            pitch=Coordinate(-0.2, sinusoids=(Sinusoid(0.05, 0.3),)),
            heading=Coordinate(0.0),
        )
        nav, truth = fly(motion, np.arange(-4, 1001) * 0.01, 4, mechanization=mechanization)
        error = position_error(nav, truth)
        return np.stack([error.north, error.east, error.up]), nav.lon

    at_greenwich, _ = cross(0.0)
    at_the_line, lon = cross(east * np.pi)
    # m: 4e-16 rad of longitude is 3 nm, here rounded in truth and solution
    np.testing.assert_allclose(at_the_line, at_greenwich, atol=2e-8)
    assert np.abs(lon).max() <= np.pi
    assert np.sign(lon[0]) == east
    assert np.sign(lon[-1]) == -east


def test_frame_n_stops_short_of_the_pole() -> None:
    """Frame n refuses beyond 89.9° and says which frames to use."""
    motion = Motion(
        lat=Coordinate(89.89 * DEG, rate=1e-4),
        lon=Coordinate(0.3),
        h=Coordinate(10.0),
        roll=Coordinate(0.0),
        pitch=Coordinate(0.1),
        heading=Coordinate(0.2),
    )
    with pytest.raises(NavgradeError, match=r"89\.9.*\be\b.*\bw\b") as caught:
        fly(motion, np.arange(1001) * 0.01)
    # s: 0.01 degrees at 1e-4 rad/s
    assert caught.value.t == pytest.approx(0.01 * DEG / 1e-4, abs=0.02)  # type: ignore[attr-defined]
    with pytest.raises(NavgradeError, match=r"89\.9"):
        fly(static(-89.95, 0.0, 0.0, 1.0, 2.0, 3.0), np.arange(11) * 0.01)


def test_hold_keeps_the_height() -> None:
    """Held, the height does not move and vertical velocity is zero, whatever is felt."""
    motion = manoeuvre()
    nav, _ = fly(motion, np.arange(2001) * 0.01, vertical="hold")
    assert np.all(nav.h == motion.state(0.0).h[0])
    assert np.all(nav.v_eb_n[:, 2] == 0.0)


def test_positions_lose_no_step() -> None:
    """A hundred thousand equal steps add up to their product, within one rounding."""
    step = np.pi * 1e-9  # rad, 20 mm of latitude
    total, lost = 0.7, 0.0
    for _ in range(100_000):
        total, lost = compensated_sum(total, lost, step)
    exact = Fraction(0.7) + 100_000 * Fraction(step)
    # rad: half a unit in the last place of 0.7; a plain sum is off by 2e-12, 13 micrometres
    assert abs(Fraction(total) - exact) <= Fraction(1.2e-16)
