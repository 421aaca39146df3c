"""Gravity as the user chooses it, and what the real field adds: where it drives a navigator.

Truth is a body at rest whose accelerometers feel one field while the navigator assumes another.
Its gyros are right, so its axes keep their attitude to the Earth, and its false motion is that of
a point with a fixed specific force, integrated here in Earth-fixed axes.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pymap3d
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from earth import GRAVITY_MODELS, DisturbanceGrid
from navgrade import ImuSamples, NavState, Trajectory, navigate
from navgrade.errors import NumericalError
from navgrade.mechanization import MECHANIZATIONS
from navgrade.navigation import solve
from tests.navgrade.engine import fly, samples, state_at
from tests.oracles.constants import E2, EQUATORIAL_RADIUS, GM, J2, OMEGA
from tests.oracles.gravity import normal_gravity_zonal
from tests.oracles.truth import Coordinate, Motion, ecef, manoeuvre, matrix, quaternion

Array = NDArray[np.float64]
Field = Callable[[float, float, float], Array]  # (lat, lon, h) to gravity in NED, m/s^2

DEG = math.pi / 180.0  # rad
ARCSEC = DEG / 3600.0  # rad
MGAL = 1e-5  # m/s^2
EACH_FRAME = pytest.mark.parametrize("mechanization", MECHANIZATIONS)
DURATION, DT = 600.0, 0.1  # s

LAT, LON, H = 40.0 * DEG, 31.0 * DEG, 5000.0
XI, ETA, DG = 20.0 * ARCSEC, -35.0 * ARCSEC, 120.0 * MGAL
ANGLES = tuple(np.array([angle * DEG]) for angle in (12.0, -25.0, 200.0))


# --- fields by other means than the package -------------------------------------------------------


def normal(lat: float, lon: float, h: float) -> Array:
    """Normal gravity."""
    g = normal_gravity_zonal(lat, h)
    return np.array([float(g.north), 0.0, float(g.down)])


def somigliana(lat: float, lon: float, h: float) -> Array:
    """The formula of 1929 with the numbers of NGA.STND.0036 (2014), the same at every height."""
    s2 = math.sin(lat) ** 2
    # m/s^2 at the equator; 2e-11 of it is in the digits left out
    return np.array([0, 0, 9.7803253359 * (1 + 0.00193185265241 * s2) / math.sqrt(1 - E2 * s2)])


def taylor(lat: float, lon: float, h: float) -> Array:
    """The second-order series in height of the same document (4-3)."""
    f, m = 1 / 298.257223563, 0.00344978650684
    x = h / EQUATORIAL_RADIUS
    series = 1 - 2 * x * (1 + f + m - 2 * f * math.sin(lat) ** 2) + 3 * x * x
    return somigliana(lat, lon, h) * series


MODELS: dict[str, Field] = {
    "closed-form": normal,
    "somigliana": somigliana,
    "somigliana-taylor": taylor,
}


def disturbed(xi: float, eta: float, dg: float) -> Field:
    """Normal gravity with the plumb line bent to the south by `xi` and to the west by `eta`."""

    def field(lat: float, lon: float, h: float) -> Array:
        north, _, down = normal(lat, lon, h)
        return np.array([north - down * xi, -down * eta, down + dg])

    return field


# --- a body at rest in one field, navigated in another --------------------------------------------


def at_rest(lat: float, lon: float, h: float, felt: Array) -> tuple[NavState, ImuSamples]:
    """A tilted body at rest where gravity (NED) is `felt`, and its log."""
    C_bn = matrix(*ANGLES)[0].T
    n = round(DURATION / DT)
    log = ImuSamples(
        t=np.linspace(DT, DURATION, n),
        gyro=np.tile(C_bn @ [OMEGA * math.cos(lat), 0.0, -OMEGA * math.sin(lat)], (n, 1)),
        accel=np.tile(-C_bn @ felt, (n, 1)),
        kind="average",
    )
    return NavState(lat=lat, lon=lon, h=h, q_nb=quaternion(*ANGLES)[0]), log


def C_en(lat: float, lon: float) -> Array:
    """North, east, down to Earth-fixed axes."""
    north = (-math.sin(lat) * math.cos(lon), -math.sin(lat) * math.sin(lon), math.cos(lat))
    east = (-math.sin(lon), math.cos(lon), 0.0)
    down = (-math.cos(lat) * math.cos(lon), -math.cos(lat) * math.sin(lon), -math.sin(lat))
    return np.array([north, east, down]).T


def drift_ned(lat: float, lon: float, h: float, felt: Array, assumed: Field) -> Array:
    """Where `DURATION` of false gravity leads: north, east, down of the start, m."""
    r0 = np.array(pymap3d.geodetic2ecef(lat, lon, h, deg=False))
    f_e = C_en(lat, lon) @ -felt
    spin = np.array([0.0, 0.0, OMEGA])

    def rates(_: float, y: Array) -> Array:
        place = [float(x) for x in pymap3d.ecef2geodetic(*(r0 + y[:3]), deg=False)]
        pull = C_en(place[0], place[1]) @ assumed(*place)
        return np.concatenate([y[3:], f_e + pull - 2.0 * np.cross(spin, y[3:])])

    # departures of metres to kilometres
    found = solve_ivp(rates, (0.0, DURATION), np.zeros(6), "DOP853", rtol=1e-10, atol=1e-9)
    drift: Array = C_en(lat, lon).T @ found.y[:3, -1]
    return drift


def moved_ned(nav: Trajectory, start: NavState) -> Array:
    """From the start to the end of a solution, along north, east, down of the start, m."""
    lat, lon = (np.array([x, y]) for x, y in ((start.lat, nav.lat[-1]), (start.lon, nav.lon[-1])))
    positions = ecef(lat, lon, np.array([start.h, nav.h[-1]]))
    moved: Array = C_en(start.lat, start.lon).T @ (positions[1] - positions[0])
    return moved


# --- named models ---------------------------------------------------------------------------------


def test_every_model_has_its_formula_here() -> None:
    assert set(MODELS) == set(GRAVITY_MODELS)


@cache
def model_drift(model: str) -> Array:
    """Drift in the field of a model of a body that feels normal gravity."""
    return drift_ned(LAT, LON, H, normal(LAT, LON, H), MODELS[model])


@EACH_FRAME
@pytest.mark.parametrize("model", GRAVITY_MODELS)
def test_a_model_drives_a_body_at_rest_by_what_it_is_wrong(model: str, mechanization: str) -> None:
    felt = normal(LAT, LON, H)
    start, log = at_rest(LAT, LON, H, felt)
    nav = navigate(log, start, mechanization=mechanization, gravity=model)
    found = moved_ned(nav, start)
    # m: 2e-11 m/s^2 of the Earth's turn in 0.1 s, in frame i, and of printed constants
    np.testing.assert_allclose(found, model_drift(model), rtol=0.0, atol=1e-5)
    wrong = MODELS[model](LAT, LON, H) - felt
    # to first order wrong t^2/2: 2.8 km down without the height; without the north component alone,
    # which bends the plumb line to the equator, 7 m north. 5 %: Schuler's swing takes 4.6 % back
    first_order = 0.5 * wrong * DURATION**2
    largest = int(np.argmax(np.abs(wrong)))
    assert found[largest] == pytest.approx(first_order[largest], rel=0.05, abs=1e-4)
    if model == "somigliana":
        assert nav.h[-1] == pytest.approx(H - 2774.0, abs=10.0)


# --- disturbances ---------------------------------------------------------------------------------


def constant(xi: float, eta: float, dg: float) -> DisturbanceGrid:
    """The same everywhere within 5 degrees of the base."""
    ones = np.ones((3, 2))
    lat, lon = LAT + np.array([-5.0, 0.0, 5.0]) * DEG, LON + np.array([-5.0, 5.0]) * DEG
    return DisturbanceGrid(lat, lon, xi * ones, eta * ones, dg * ones)


@cache
def disturbance_drift(xi: float, eta: float, dg: float) -> Array:
    """Drift in a disturbed field of a body that feels normal gravity."""
    return drift_ned(LAT, LON, H, normal(LAT, LON, H), disturbed(xi, eta, dg))


@EACH_FRAME
@pytest.mark.parametrize(
    ("xi", "eta", "dg", "axis"), [(XI, 0.0, 0.0, 0), (0.0, ETA, 0.0, 1), (0.0, 0.0, DG, 2)]
)
def test_each_disturbance_pulls_its_way(
    xi: float, eta: float, dg: float, axis: int, mechanization: str
) -> None:
    """A zenith bent north makes gravity pull south; bent east, west; a positive dg pulls down."""
    felt = normal(LAT, LON, H)
    start, log = at_rest(LAT, LON, H, felt)
    nav = navigate(log, start, mechanization=mechanization, disturbance=constant(xi, eta, dg))
    found = moved_ned(nav, start)
    # m: 2e-11 m/s^2 of the Earth's turn in 0.1 s, in frame i
    np.testing.assert_allclose(found, disturbance_drift(xi, eta, dg), rtol=0.0, atol=1e-5)
    pull = np.array([-felt[2] * xi, -felt[2] * eta, dg])
    # 170, 300 and 216 m; 10 %: Schuler's swing takes 4.6 % back in ten minutes, and the vertical
    # instability adds 9 %
    assert found[axis] == pytest.approx(0.5 * pull[axis] * DURATION**2, rel=0.1)


SLOPE = 10.0 / DEG  # per rad: tenfold in a degree of longitude
EDGE = 30.0 * DEG  # east of it there is a disturbance


def sloping_grid(lon: float) -> DisturbanceGrid:
    """The constants above at longitude `lon`, growing eastwards; read 360° further on."""
    lats = LAT + np.array([-2.0, 2.0]) * DEG
    lons = lon + 2.0 * math.pi + np.array([-1.0, 0.0, 1.0]) * DEG
    growth = np.tile(1.0 + SLOPE * (lons - lons[1]), (2, 1))
    return DisturbanceGrid(lats, lons, XI * growth, ETA * growth, DG * growth)


@EACH_FRAME
@pytest.mark.parametrize("lon_deg", [31.0, -179.7])
def test_a_disturbance_stands_still_on_the_earth(lon_deg: float, mechanization: str) -> None:
    """A body that feels the real field rests in it, while the Earth turns by 2.5 degrees."""
    lon = lon_deg * DEG
    felt = disturbed(XI, ETA, DG)(LAT, lon, H)
    start, log = at_rest(LAT, lon, H, felt)
    nav = navigate(log, start, mechanization=mechanization, disturbance=sloping_grid(lon))
    # m: 2e-11 m/s^2 of the Earth's turn in 0.1 s, in frame i; a grid that stood still in space
    # would have it leave after four minutes
    assert np.abs(moved_ned(nav, start)).max() < 1e-5
    without = moved_ned(navigate(log, start, mechanization=mechanization), start)
    first_order = 0.5 * np.array([felt[2] * XI, felt[2] * ETA, -DG]) * DURATION**2
    np.testing.assert_allclose(without, first_order, rtol=0.1)  # as above, the other way


# --- functions ------------------------------------------------------------------------------------

ZONALS = tuple(  # Heiskanen & Moritz (1967), 2-92
    (-1.0) ** (n + 1) * 3 * E2**n / ((2 * n + 1) * (2 * n + 3)) * (1 - n + 5 * n * J2 / E2)
    for n in range(1, 6)
)


def zonal(lat: float, lon: float, h: float) -> tuple[float, float, float]:
    """Normal gravity by zonal harmonics to degree 10, as a user would write it."""
    sin_lat, cos_lat = math.sin(lat), math.cos(lat)
    transverse = EQUATORIAL_RADIUS / math.sqrt(1.0 - E2 * sin_lat**2)
    x = (transverse + h) * cos_lat
    z = (transverse * (1.0 - E2) + h) * sin_lat
    r = math.hypot(x, z)
    s, c = z / r, x / r
    p0, p1, d0, d1 = 1.0, s, 0.0, 1.0  # two Legendre polynomials and their derivatives
    up, north = 1.0, 0.0
    for degree in range(2, 11):
        p2 = ((2 * degree - 1) * s * p1 - (degree - 1) * p0) / degree
        d2 = d0 + (2 * degree - 1) * p1
        p0, p1, d0, d1 = p1, p2, d1, d2
        if degree % 2 == 0:
            part = ZONALS[degree // 2 - 1] * (EQUATORIAL_RADIUS / r) ** degree
            up -= (degree + 1) * part * p1
            north -= part * d1 * c
    outward = -GM / (r * r) * up
    along = GM / (r * r) * north
    g_x = outward * c - along * s + OMEGA**2 * x
    g_z = outward * s + along * c
    return -sin_lat * g_x + cos_lat * g_z, 0.0, -cos_lat * g_x - sin_lat * g_z


def eastern(lat: float, lon: float, h: float) -> tuple[float, float, float]:
    """No disturbance west of 30 degrees; east of it, one that grows with longitude."""
    if lon < EDGE:
        return 0.0, 0.0, 0.0
    growth = 1.0 + SLOPE * (lon - LON)
    return XI * growth, ETA * growth, DG * growth


@EACH_FRAME
def test_functions_take_the_place_of_models_and_grids(mechanization: str) -> None:
    """One pair of functions, for each frame compiles its loop anew."""
    # in the west, at 10 degrees: what a function returns is what the default is
    edges = np.linspace(0.0, 180.0, 18_001)
    mine, _ = fly(
        manoeuvre(), edges, mechanization=mechanization, gravity=zonal, disturbance=eastern
    )
    default, _ = fly(manoeuvre(), edges, mechanization=mechanization)
    off = ecef(mine.lat, mine.lon, mine.h) - ecef(default.lat, default.lon, default.h)
    assert np.abs(off).max() < 1e-6  # m: 1e-11 m/s^2 of the fit, twice integrated over 180 s
    # in the east: it is Earth-fixed, as a grid is
    felt = disturbed(XI, ETA, DG)(LAT, LON, H)
    start, log = at_rest(LAT, LON, H, felt)
    nav = navigate(log, start, mechanization=mechanization, gravity=zonal, disturbance=eastern)
    assert np.abs(moved_ned(nav, start)).max() < 1e-5  # m: as with a grid


def test_frames_agree_in_a_rough_field() -> None:
    """Five minutes at 300 m/s across cells of 0.1 degrees whose nodes are drawn at random."""
    rng = np.random.default_rng(8)
    lats, lons = (np.linspace(at - 2.0, at + 4.0, 61) * DEG for at in (45.0, 10.0))
    xi, eta, dg = rng.standard_normal((3, 61, 61)) * np.array([XI, ETA, DG])[:, None, None]
    grid = DisturbanceGrid(lats, lons, xi, eta, dg)
    log, start = samples(manoeuvre().increments(np.arange(30_001) * 0.01)), state_at(manoeuvre(), 0)
    flights = [
        navigate(log, start, mechanization=frame, disturbance=field)
        for frame, field in [("n", None), *((frame, grid) for frame in MECHANIZATIONS)]
    ]
    without, first, *others = (ecef(nav.lat, nav.lon, nav.h) for nav in flights)
    assert np.abs(first - without).max() > 3.0  # m: 1e-3 m/s^2 for 30 s at a time
    for other in others:
        # m: 1 um of each frame's own step; a field looked at where the interval begins, 1.5 m
        # behind, would be 4 mm
        assert np.abs(other - first).max() < 1e-5


# --- what is refused ------------------------------------------------------------------------------


@EACH_FRAME
@pytest.mark.parametrize("way", ["north", "east"])
def test_leaving_the_grid_ends_the_solution_there(way: str, mechanization: str) -> None:
    """It takes 33.333 s to its border."""
    speed, reach = 5e-5, 33.333  # rad/s, s
    motion = Motion(
        lat=Coordinate(-35.0 * DEG, rate=speed if way == "north" else 0.0),
        lon=Coordinate(-70.0 * DEG, rate=speed if way == "east" else 0.0),
        h=Coordinate(800.0),
        roll=Coordinate(0.1),
        pitch=Coordinate(-0.2),
        heading=Coordinate(1.0),
    )
    zeros = np.zeros((2, 2))
    lats, lons = np.array([-36.0, -34.0]) * DEG, np.array([-71.0, -69.0]) * DEG
    if way == "north":
        lats[1] = -35.0 * DEG + speed * reach
    else:
        lons[1] = -70.0 * DEG + speed * reach
    grid = DisturbanceGrid(lats, lons, zeros, zeros, zeros)
    edges = np.linspace(0.0, 60.0, 6001)
    with pytest.raises(NumericalError, match="leaves the disturbance grid") as caught:
        fly(motion, edges, mechanization=mechanization, disturbance=grid)
    # s: in the middle of the interval to 33.34 s, where the field is looked at, it is outside
    assert caught.value.t == pytest.approx(33.34, abs=1e-9)
    assert caught.value.index == 3333
    nav, truth = fly(motion, edges[:3334], mechanization=mechanization, disturbance=grid)
    assert np.abs(ecef(nav.lat, nav.lon, nav.h) - ecef(truth.lat, truth.lon, truth.h)).max() < 1e-6


@EACH_FRAME
def test_a_start_off_the_grid_is_refused(mechanization: str) -> None:
    start, log = at_rest(LAT + 6.0 * DEG, LON, H, normal(LAT, LON, H))
    with pytest.raises(NumericalError, match="leaves the disturbance grid") as caught:
        navigate(log, start, mechanization=mechanization, disturbance=constant(0.0, 0.0, 0.0))
    assert caught.value.index == 0


def test_an_end_leaves_no_thread_behind() -> None:
    """Kept with the error, a pool of threads would be joined wherever its garbage is found."""
    start, log = at_rest(LAT + 6.0 * DEG, LON, H, normal(LAT, LON, H))
    blocks = [replace(log, t=log.t + k * DURATION) for k in range(8)]  # more than are read ahead
    before = threading.active_count()
    with pytest.raises(NumericalError) as caught:
        list(solve(blocks, start, disturbance=constant(0.0, 0.0, 0.0)))
    assert threading.active_count() == before
    assert caught.value.index == 0


def pythonic(lat: float, lon: float, h: float) -> tuple[float, float, float]:
    """Nothing numba knows."""
    return 0.0, 0.0, float(f"{lat:.3f}")


def test_what_cannot_be_taken_says_so() -> None:
    start, log = at_rest(LAT, LON, H, normal(LAT, LON, H))
    with pytest.raises(ValueError, match="did you mean 'somigliana'"):
        navigate(log, start, gravity="somiliana")
    with pytest.raises(ValueError, match=r"closed-form, somigliana-taylor, somigliana"):
        navigate(log, start, gravity="J2")
    with pytest.raises(TypeError, match=r"numba cannot compile pythonic\(lat, lon, h\)"):
        navigate(log, start, gravity=pythonic)
    with pytest.raises(TypeError, match=r"numba cannot compile pythonic\(lat, lon, h\)"):
        navigate(log, start, disturbance=pythonic)
    with pytest.raises(TypeError, match=r"DisturbanceGrid\.read reads one from a file"):
        navigate(log, start, disturbance="grid.csv")  # type: ignore[arg-type]
