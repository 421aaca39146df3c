"""The flat world: the lectures' formulas to rounding, their orders, and what flatness costs."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from earth.rotation import quat_to_rotvec
from navgrade import BaroLoop, ImuSamples, NavState, Status, Trajectory, navigate
from navgrade.local import LocalTrajectory, to_local
from navgrade.mechanization import FLAT_WORLD
from navgrade.navigation import solve
from navgrade.reconstruction import RECONSTRUCTIONS, takes_rates, to_increments
from tests.navgrade.body import rebuilt, same_bits
from tests.navgrade.engine import fly
from tests.navgrade.test_orders import (
    DURATION,
    FORCES,
    LADDER,
    attitude,
    body_rate,
    orders_of,
    recorded,
    waves,
)
from tests.navgrade.test_stretches import changed_rows, flagged, with_changed
from tests.oracles import lectures
from tests.oracles.cases import position_error
from tests.oracles.constants import OMEGA
from tests.oracles.gravity import normal_gravity_zonal
from tests.oracles.truth import Coordinate, Motion, per_metre, static

Array = NDArray[np.float64]

DEG = np.pi / 180.0
OF_RATES = [name for name in RECONSTRUCTIONS if takes_rates(name)]
OWN = {name: entry for name, entry in FLAT_WORLD.items() if entry.reconstruction}
LAT, LON, H = -37.0 * DEG, 145.0 * DEG, 820.0
G = float(normal_gravity_zonal(LAT, H).down)  # m/s^2
SWAP = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # NED to ENU and back
FLIP = np.diag([1.0, -1.0, -1.0])  # FRD to FLU and back

# --- a body over a plane, in closed form: the one of test_orders, which falls, too ---------------


def start(t: float, velocity: Array | None = None) -> NavState:
    """The true state, with the place in the plane's origin."""
    q = attitude(np.array([t])).as_quat(scalar_first=True)[0]
    v = waves(FORCES, np.array([t]), 1)[0] if velocity is None else velocity
    return NavState(lat=LAT, lon=LON, h=H, v_eb_n=v, q_nb=q, t=t)


def instants(t: Array) -> ImuSamples:
    """Samples of the rate and force at `t`."""
    return ImuSamples(
        t=t, gyro=body_rate(t), accel=attitude(t).inv().apply(waves(FORCES, t, 0)), kind="rate"
    )


def plane(nav: Trajectory, **axes: Any) -> LocalTrajectory:
    """A solution in the plane at the start."""
    return to_local(nav, LAT, LON, H, **axes)


UNEVEN = 0.3 + np.concatenate([[0.0], np.cumsum(np.random.default_rng(8).uniform(0.01, 0.03, 300))])


# --- the lectures, to the last digits -------------------------------------------------------------


@pytest.mark.parametrize("t", [0.3 + 0.02 * np.arange(301), UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("name", OWN)
@pytest.mark.parametrize(("world", "body"), [("ENU", "FLU"), ("NED", "FRD")])
def test_steps_are_the_lectures(
    name: str, t: Array, world: Literal["ENU", "NED"], body: Literal["FLU", "FRD"]
) -> None:
    """In axes x forward, y left, z up over east, north, up; or all the other way round."""
    log, state = instants(t), start(t[0])
    local = plane(navigate(log, state, mechanization=name), world=world, body=body)
    to_world = SWAP if world == "ENU" else np.eye(3)
    to_body = FLIP if body == "FLU" else np.eye(3)
    q, v, p = lectures.integrate(
        str(FLAT_WORLD[name].reconstruction),
        t,
        log.gyro @ to_body,
        log.accel @ to_body,
        to_world @ attitude(t[:1]).as_matrix()[0] @ to_body,
        to_world @ state.v_eb_n,
        np.zeros(3),
        G if world == "ENU" else -G,
    )
    # m, m/s: Earth-fixed positions are rounded to 2 nm, and gravity to 1e-11 m/s^2 over 6 s
    np.testing.assert_allclose(local.p, p, rtol=0, atol=6e-9)
    np.testing.assert_allclose(local.v, v, rtol=0, atol=3e-10)
    sign = np.sign(np.sum(q * local.q, axis=1, keepdims=True))
    np.testing.assert_allclose(sign * local.q, q, rtol=0, atol=2e-13)  # 300 roundings
    assert local.t.tolist() == t[1:].tolist()


def test_one_solution_in_all_axes() -> None:
    """Axes are names: a plane's east is another's y, a body's left the other's right, reversed."""
    nav = navigate(instants(UNEVEN), start(UNEVEN[0]), mechanization="flat-rk4")
    ned, enu = plane(nav, world="NED", body="FRD"), plane(nav, world="ENU", body="FRD")
    flu = plane(nav, world="NED", body="FLU")
    # m, m/s: rounding of Earth-fixed axes times 500 m
    np.testing.assert_allclose(enu.p, ned.p @ SWAP.T, rtol=0, atol=1e-12)
    np.testing.assert_allclose(enu.v, ned.v @ SWAP.T, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(flu.p, ned.p)
    C = {name: Rotation.from_quat(x.q, scalar_first=True).as_matrix()
         for name, x in (("ned", ned), ("enu", enu), ("flu", flu))}  # fmt: skip
    np.testing.assert_allclose(C["enu"], SWAP @ C["ned"], rtol=0, atol=1e-15)
    np.testing.assert_allclose(C["flu"], C["ned"] @ FLIP, rtol=0, atol=1e-15)


def test_first_order_quaternion_is_short_of_the_exponential() -> None:
    """[1, 1/2 omega dt] of norm 1 turns by 2 atan(|omega| dt / 2), a twelfth of the cube less."""
    for angle in (1e-3, 1e-2, 0.1):
        axis = np.array([0.36, 0.48, -0.8])
        q = np.array([1.0, *(0.5 * angle * axis)])
        turned = float(np.linalg.norm(quat_to_rotvec(q / np.linalg.norm(q))))
        assert turned == pytest.approx(2.0 * np.arctan(0.5 * angle), rel=1e-14)
        # the next term is angle^5 / 80; rounding of the angle
        assert angle - turned == pytest.approx(angle**3 / 12.0, rel=0.2 * angle**2, abs=3e-16)


# --- orders ---------------------------------------------------------------------------------------


def off(name: str, dt: float, kind: str) -> Array:
    """Largest position error in the plane, m."""
    edges = np.arange(-24, round(DURATION / dt) + 25) * dt + 0.3
    log = recorded(edges) if kind == "increment" else instants(edges)
    local = plane(navigate(log, start(0.3), mechanization=name), world="NED", body="FRD")
    inside = local.t < 0.3 + DURATION + 1e-9
    since = local.t[inside] - 0.3
    truth = waves(FORCES, local.t[inside], 2) - waves(FORCES, np.array([0.3]), 2)
    truth[:, 2] += 0.5 * G * since**2
    return np.array([np.abs(local.p[inside] - truth).max()])


@pytest.mark.parametrize("kind", ["rate", "increment"])
@pytest.mark.parametrize("name", OWN)
def test_order(name: str, kind: str) -> None:
    # m: Earth-fixed positions are rounded to 2 nm
    (order,) = orders_of(lambda dt: off(name, dt, kind), LADDER, np.array([1e-7]))
    assert order == pytest.approx(FLAT_WORLD[name].order, abs=0.2)


@pytest.mark.parametrize(("method", "order"), [("rk4", 4), ("rk4-mean", 2)])
def test_order_of_runge_kutta_is_that_of_its_middle(method: str, order: int) -> None:
    """The mean of the ends is no value of the middle: the fourth order is lost."""
    errors = []
    for dt in (0.1, 0.05):
        t = 0.3 + np.arange(round(DURATION / dt) + 1) * dt
        log = instants(t)
        C = attitude(t[:1]).as_matrix()[0]
        *_, p = lectures.integrate(
            method, t, log.gyro, log.accel, C, waves(FORCES, t[:1], 1)[0], np.zeros(3), 0.0
        )
        truth = waves(FORCES, t[1:], 2) - waves(FORCES, t[:1], 2)
        errors.append(np.abs(p - truth).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.2)


# --- attitude kept in two ways --------------------------------------------------------------------


@pytest.mark.parametrize("reconstruction", ["centred-9", "causal-3", "samples-2", "rk4"])
def test_quaternion_and_matrix_agree(reconstruction: str) -> None:
    edges = 0.3 + np.arange(6001) * 0.01
    log, state = recorded(edges), start(0.3)
    one, other = (
        navigate(log, state, mechanization=name, reconstruction=reconstruction)
        for name in ("flat", "flat-matrix")
    )
    error = position_error(one, other)
    # m, after 1 min and 18 km: roundings of 1e-16 of the attitude turn the force of 12 m/s^2
    assert max(error.horizontal, error.vertical) < 2e-8
    np.testing.assert_allclose(one.v_eb_n, other.v_eb_n, rtol=0, atol=1e-9)
    sign = np.sign(np.sum(one.q_nb * other.q_nb, axis=1, keepdims=True))
    np.testing.assert_allclose(sign * one.q_nb, other.q_nb, rtol=0, atol=1e-12)


def test_the_matrix_stays_a_rotation() -> None:
    """Turned twenty thousand times by 0.3 rad."""
    n, turn = 20_000, 0.3 * np.array([0.36, 0.48, -0.8])
    log = ImuSamples(
        t=0.01 * np.arange(1, n + 1),
        gyro=np.tile(turn, (n, 1)),
        accel=np.zeros((n, 3)),
        kind="increment",
    )
    state = NavState(lat=LAT, lon=LON, h=H, q_nb=(0.5, 0.5, -0.5, 0.5))
    nav = navigate(log, state, mechanization="flat-matrix", reconstruction="none")
    found = Rotation.from_quat(plane(nav, world="NED", body="FRD").q[-1], scalar_first=True)
    exact = Rotation.from_quat(state.q_nb, scalar_first=True) * Rotation.from_rotvec(n * turn)
    assert (exact.inv() * found).magnitude() < 3e-12  # rad: 6,000 rad are rounded to 1e-12


# --- what the flat world costs --------------------------------------------------------------------


@pytest.mark.parametrize("name", FLAT_WORLD)
def test_at_rest_the_earth_turns_away(name: str) -> None:
    """The Earth rate about north tilts the level: g omega cos(lat) t^3 / 6."""
    lat = 45.0 * DEG
    nav, truth = fly(static(45.0, 10.0, 0.0, 3.0, -4.0, 50.0), np.arange(30_001) * 0.01,
                     mechanization=name)  # fmt: skip
    error = position_error(nav, truth)
    away = np.hypot(error.north, error.east)
    for seconds, metres in ((60, 18.2), (300, 2275.0)):
        law = 9.8062 * OMEGA * np.cos(lat) * seconds**3 / 6.0
        assert law == pytest.approx(metres, rel=1e-3)
        assert away[100 * seconds - 1] == pytest.approx(law, rel=0.01)
    assert error.east[-1] > 0.99 * away[-1]  # the level turns away under a false force to the east


@pytest.mark.parametrize("name", ["flat", "flat-rk4"])
def test_an_aircraft_flies_off_the_plane(name: str) -> None:
    lat, h = 45.0 * DEG, 10_000.0
    _, east = per_metre(lat, h)
    zero = Coordinate(0.0)
    flight = Motion(Coordinate(lat), Coordinate(0.2, 250.0 * east), Coordinate(h), zero, zero,
                    Coordinate(90.0 * DEG))  # fmt: skip
    nav, truth = fly(flight, np.arange(6001) * 0.01, mechanization=name)
    error = position_error(nav[-1:], flight.state(nav.t[-1:]))
    assert error.horizontal == pytest.approx(56.5, rel=0.01)  # m, computed apart from this engine
    assert truth.t[-1] == 60.0


def test_gravity_is_constant_and_straight_down() -> None:
    """Falling freely from 10 km for a minute, 17.6 km down, all with the gravity of the start."""
    n = 6000
    still = np.zeros((n, 3))
    log = ImuSamples(t=0.01 * np.arange(1, n + 1), gyro=still, accel=still, kind="increment")
    state = NavState(lat=45.0 * DEG, lon=0.3, h=10_000.0)
    nav = navigate(log, state, mechanization="flat")
    local = to_local(nav, state.lat, state.lon, state.h, world="NED", body="FRD")
    # 9.775414187888955 m/s^2: the closed form, in 50 digits. m: rounding of Earth-fixed positions,
    # and 1e-11 m/s^2 of the fit, 18 nm
    np.testing.assert_allclose(local.p[:, 2], 0.5 * 9.775414187888955 * nav.t**2, atol=4e-8)
    np.testing.assert_allclose(local.p[:, :2], 0.0, atol=4e-9)


# --- choices --------------------------------------------------------------------------------------


def bits(nav: Trajectory) -> list[bytes]:
    """All numbers of a solution."""
    columns = (nav.t, nav.lat, nav.lon, nav.h, nav.v_eb_n, nav.q_nb, nav.status)
    return [np.ascontiguousarray(column).tobytes() for column in columns]


@pytest.mark.parametrize("name", OWN)
def test_a_frame_with_its_own_body_stage_brings_it(name: str) -> None:
    log, state, own = instants(UNEVEN), start(UNEVEN[0]), OWN[name].reconstruction
    brought = bits(navigate(log, state, mechanization=name))
    assert brought == bits(navigate(log, state, mechanization=name, reconstruction=own))
    assert brought == bits(navigate(log, state, mechanization="flat", reconstruction=own))
    with pytest.raises(ValueError, match=f"{name!r} brings its own reconstruction {own!r} and"):
        navigate(log, state, mechanization=name, reconstruction="centred-9")


def test_a_plain_flat_world_takes_the_default() -> None:
    log, state = recorded(UNEVEN), start(UNEVEN[0])
    default = navigate(log, state, mechanization="flat")
    assert bits(default) == bits(
        navigate(log, state, mechanization="flat", reconstruction="centred-9")
    )


@pytest.mark.parametrize("name", FLAT_WORLD)
@pytest.mark.parametrize("vertical", ["hold", "baro"])
def test_the_height_of_a_flat_world_is_free(name: str, vertical: str) -> None:
    channel: Any = BaroLoop(t=[0.0, 9.0], h=[H, H]) if vertical == "baro" else vertical
    with pytest.raises(ValueError, match=f"{name!r} leaves its height free; vertical {vertical!r}"):
        navigate(instants(UNEVEN), start(UNEVEN[0]), mechanization=name, vertical=channel)


def test_a_misspelt_flat_world_is_suggested() -> None:
    with pytest.raises(ValueError, match="did you mean 'flat-rk4'"):
        navigate(instants(UNEVEN), start(UNEVEN[0]), mechanization="flat-rk")


@pytest.mark.parametrize("name", OWN)
def test_compensated_increments_hold_no_rates(name: str) -> None:
    log = dataclasses.replace(recorded(UNEVEN), kind="compensated")
    with pytest.raises(ValueError, match="needs the rates themselves, and compensated"):
        navigate(log, start(UNEVEN[0]), mechanization=name)


# --- rates as they are ----------------------------------------------------------------------------


# longer than what is looked at for the nominal interval, so that blocks end where they end
LONG = 0.3 + np.cumsum(np.random.default_rng(5).uniform(0.01, 0.03, 1260))


@pytest.mark.parametrize("t0", [LONG[1200], LONG[1201] - 0.004, LONG[1201] - 1e-4])
@pytest.mark.parametrize("name", OWN)
def test_blocks_leave_no_trace(name: str, t0: float) -> None:
    """Whether the state is at a sample or within an interval, at a seam or not."""
    log, state = instants(LONG), start(t0)
    whole = bits(navigate(log, state, mechanization=name))
    for size in (1, 7, 1201, 1202, 1203):
        pieces = [bits(nav) for nav in solve(log.blocks(size), state, mechanization=name)]
        assert [b"".join(column) for column in zip(*pieces, strict=True)] == whole, size


@pytest.mark.parametrize("share", [0.3, 0.99])
def test_a_state_inside_an_interval_meets_a_straight_line_of_rates(share: float) -> None:
    """What is felt there lies between the samples around, and both parts end where they should."""
    log = instants(UNEVEN)
    t0 = float(UNEVEN[40] + share * (UNEVEN[41] - UNEVEN[40]))
    between = (1.0 - share) * log.gyro[40] + share * log.gyro[41]
    force = (1.0 - share) * log.accel[40] + share * log.accel[41]
    nav = navigate(log, start(t0, np.zeros(3)), mechanization="flat-euler")
    assert nav.t[0] == UNEVEN[41]
    local = plane(nav, world="NED", body="FRD")
    dt = UNEVEN[41] - t0
    C = attitude(np.array([t0])).as_matrix()[0]
    gravity = np.array([0.0, 0.0, G])
    if share > 0.9:  # a stretch of its own, whose first rate is that of its end
        between, force = log.gyro[41], log.accel[41]
    assert bool(nav.status[0] & Status.SHORT_WINDOW) == (share > 0.9)
    # m/s: rounding of 0.2
    np.testing.assert_allclose(local.v[0], (C @ force + gravity) * dt, rtol=0, atol=1e-13)
    found = Rotation.from_quat(local.q[0], scalar_first=True)
    turned = attitude(np.array([t0])) * Rotation.from_rotvec(between * dt)
    assert (turned.inv() * found).magnitude() < 1e-14


def test_intervals_of_rates_are_those_between_stamps() -> None:
    """Whatever dt says: a rate has no interval of its own."""
    log = dataclasses.replace(instants(UNEVEN), dt=np.full(len(UNEVEN), 0.02))
    for size in (1, 9, 301):
        rows = rebuilt(to_increments(log.blocks(size), keep_rates=True), "midpoint")
        np.testing.assert_array_equal(rows.dt[1:], np.diff(UNEVEN))
        assert rows.dt[0] == 0.02


def windows(name: str, start: int, end: int) -> list[tuple[int, int, int]]:
    """First sample, last + 1 and status of the rows of a stretch of instantaneous samples."""
    short, shifted = Status.SHORT_WINDOW, Status.SHIFTED_WINDOW
    rows: list[tuple[int, int, int]] = [(start, start + 1, short)]
    for k in range(start + 1, end):
        if name == "euler":
            rows.append((k - 1, k, 0))
        elif name == "midpoint":
            rows.append((k - 1, k + 1, 0))
        elif end - start < 4:
            rows.append((start, end, short))
        else:
            low = min(max(k - 2, start), end - 4)
            rows.append((low, low + 4, 0 if low == k - 2 else shifted))
    return rows


@pytest.mark.parametrize("jitter", [0.0, 0.2])
@pytest.mark.parametrize("name", OF_RATES)
def test_a_row_of_rates_depends_on_its_points(name: str, jitter: float) -> None:
    """In stretches of all lengths from 1 on."""
    lengths = [9, 1, 2, 3, 4, 5, 12]
    bridged = flagged(Status.BRIDGED, lengths, (1, 3, 5))
    steps = 0.01 * (1.0 + jitter * np.random.default_rng(1).uniform(-1, 1, sum(lengths)))
    values = np.random.default_rng(2).standard_normal((2, len(steps), 3))
    log = ImuSamples(t=np.cumsum(steps), dt=steps, gyro=values[0], accel=10.0 * values[1],
                     kind="rate", status=bridged)  # fmt: skip
    ends = np.cumsum(lengths)
    expected = [row for a, b in zip([0, *ends], ends, strict=False) for row in windows(name, a, b)]
    whole = rebuilt(log, name)
    wanted = np.array([status for *_, status in expected], np.uint32) | bridged
    assert whole.status.tolist() == wanted.tolist()
    for sample in range(len(log)):
        found = changed_rows(rebuilt(with_changed(log, sample), name), whole)
        assert found.tolist() == [first <= sample < stop for first, stop, _ in expected]
    for size in (1, 2, 5, 30):
        assert same_bits(rebuilt(log.blocks(size), name), whole)


def test_increments_and_averages_give_the_same_points() -> None:
    log = recorded(UNEVEN)
    dt = log.dt[:, None]
    means = dataclasses.replace(log, gyro=log.gyro / dt, accel=log.accel / dt, kind="average")
    one, other = (rebuilt(to_increments([x], keep_rates=True), "rk4") for x in (log, means))
    np.testing.assert_allclose(one.dv, other.dv, rtol=0, atol=1e-15)  # m/s: rounding of 0.3


def test_a_quintic_rate_is_found_at_its_points() -> None:
    """Increments of six uneven intervals carry a rate of the fifth degree, ends included."""
    rng = np.random.default_rng(4)
    edges = np.concatenate([[0.0], np.cumsum(rng.uniform(0.5, 1.5, 20))]) - 10.0
    powers = rng.standard_normal((6, 3)) / 10.0 ** np.arange(6)[:, None]
    integral = np.polynomial.polynomial.polyint(powers, axis=0)
    steps = np.diff(np.polynomial.polynomial.polyval(edges, integral).T, axis=0)
    log = ImuSamples(t=edges[1:], dt=np.diff(edges), gyro=steps, accel=steps, kind="increment")
    rates = np.polynomial.polynomial.polyval(edges, powers).T
    rows = rebuilt(log, "euler")
    # rad: rounding of sums with weights of up to 30 at the ends
    np.testing.assert_allclose(rows.phi, rates[:-1] * log.dt[:, None], rtol=0, atol=1e-12)
    rows = rebuilt(log, "midpoint")
    mean = 0.5 * (rates[1:] + rates[:-1]) * log.dt[:, None]
    np.testing.assert_allclose(rows.phi, mean, rtol=0, atol=1e-12)


def test_equal_spacing_uses_the_published_weights() -> None:
    """(1, -8, 37, 37, -8, 1)/60 of the increments around a point; (-1, 9, 9, -1)/16 amid four."""
    n, k = 14, 7
    found = []
    for j in range(n):
        turn = 1e-9 * np.outer(np.arange(n) == j, [1.0, 0.0, 0.0])  # rad: products vanish
        log = ImuSamples(t=0.01 * np.arange(1, n + 1), dt=np.full(n, 0.01), gyro=turn,
                         accel=turn, kind="increment")  # fmt: skip
        rows = rebuilt(log, "euler")
        found.append(rows.phi[k, 0] / 1e-9)
    wanted = np.zeros(n)
    wanted[k - 3 : k + 3] = np.array([1, -8, 37, 37, -8, 1]) / 60
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-15)
    middle = []
    for j in range(n):
        rate = 1e-9 * np.outer(np.arange(n) == j, [1.0, 0.0, 0.0])
        log = ImuSamples(t=0.01 * np.arange(1, n + 1), gyro=rate, accel=rate, kind="rate")
        rows = rebuilt(log, "rk4")
        middle.append(6.0 * rows.dv[k, 0] / 1e-11)
    wanted = np.zeros(n)
    wanted[k - 2 : k + 2] = 4.0 * np.array([-1, 9, 9, -1]) / 16 + [0, 1, 1, 0]
    np.testing.assert_allclose(middle, wanted, rtol=0, atol=1e-12)
