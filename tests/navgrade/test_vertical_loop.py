"""The vertical channel inside navigation: what holds it, what aids it, what is left of errors.

The errors of an aided navigator are those of a linear system of three states, solved here by the
matrix exponential with the free-air gradient of the oracle's gravity.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from navgrade import ImuSamples, NavState, Trajectory, navigate
from navgrade.errors import StateTimeError
from navgrade.imu import Status
from navgrade.mechanization import MECHANIZATIONS
from navgrade.navigation import solve
from navgrade.vertical import (
    CLASSICAL_GAINS,
    DEFAULT_GAINS,
    BaroLoop,
    LoopGains,
    gains_from_time_constant,
)
from tests.navgrade.engine import samples, state_at
from tests.oracles.gravity import normal_gravity_zonal
from tests.oracles.truth import Motion, ecef, manoeuvre, road_drive, static

Array = NDArray[np.float64]

EACH_FRAME = pytest.mark.parametrize("mechanization", MECHANIZATIONS)
INTERVALS = (0.06, 0.04)  # s, in turn
MEAN_INTERVAL = 0.05  # s
KICKS = {  # of height (m), upward velocity (m/s) and upward acceleration (m/s^2)
    "height": (30.0, 0.0, 0.0),
    "velocity": (0.0, 0.8, 0.0),
    "bias": (0.0, 0.0, 2e-3),
    "all": (-20.0, 0.5, -1e-3),
}
GAINS = {
    "100 s": DEFAULT_GAINS,
    "40 s": gains_from_time_constant(40.0),
    "rogers": CLASSICAL_GAINS["rogers"],
    "second order": LoopGains(0.03, 3e-4, 0.0),
}


def base() -> Motion:
    """At rest and tilted."""
    return static(48.0, -71.0, 1250.0, 20.0, -35.0, 130.0)


def at_rest(duration: float, intervals: tuple[float, ...] = INTERVALS) -> ImuSamples:
    """What an IMU feels there: rates that do not change, over intervals in turn."""
    one = base().increments(np.array([0.0, 0.1]))
    dt = np.tile(intervals, round(duration / sum(intervals)))
    return ImuSamples(
        t=np.cumsum(dt),
        dt=dt,
        gyro=one.dtheta * 10.0 * dt[:, None],
        accel=one.dvel * 10.0 * dt[:, None],
        kind="increment",
    )


@cache
def moving(name: str) -> tuple[Motion, ImuSamples]:
    """Ten minutes of a motion."""
    motion = {"manoeuvre": manoeuvre, "road drive": road_drive}[name]()
    return motion, samples(motion.increments(np.arange(12_001) * 0.05))


def true_heights(motion: Motion, log: ImuSamples, **options: Any) -> BaroLoop:
    """A barometer without error, read at each stamp."""
    t = np.concatenate([[log.t[0] - log.dt[0]], log.t])
    return BaroLoop(t, motion.state(t).h, **options)


def kicked(state: NavState, kick: tuple[float, float, float]) -> NavState:
    """A state that is too high and rises too fast."""
    v = state.v_eb_n - [0.0, 0.0, kick[1]]
    return replace(state, h=state.h + kick[0], v_eb_n=v)


def with_bias(motion: Motion, log: ImuSamples, up: float) -> ImuSamples:
    """A log whose accelerometers feel more upwards, m/s^2, than there is."""
    middles = log.t - 0.5 * log.dt
    up_b = -motion.state(middles).C_nb[:, 2, :]  # the bias turns with the vertical: not constant
    return replace(log, accel=log.accel + up * up_b * log.dt[:, None])


def up_errors(nav: Trajectory, motion: Motion) -> Array:
    """Errors of height (m) and of upward velocity (m/s), one row per instant."""
    truth = motion.state(nav.t)
    return np.stack([nav.h - truth.h, truth.v_eb_n[:, 2] - nav.v_eb_n[:, 2]], axis=1)


def response(
    gains: LoopGains, kick: tuple[float, float, float], lat: float, h: float, t: Array
) -> Array:
    """Errors of height and upward velocity at `t` by the exponential of the linear system."""
    above, below = (float(normal_gravity_zonal(lat, h + dh).down) for dh in (50.0, -50.0))
    gradient = (below - above) / 100.0  # 1/s^2, 3.09e-6
    c1, c2, c3 = gains
    rates = np.array(  # of height, upward velocity, found acceleration error, and the bias
        [
            [-c1, 1.0, 0.0, 0.0],
            [gradient - c2, 0.0, -1.0, 1.0],
            [c3, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0],
        ]
    )
    start = np.array([kick[0], kick[1], 0.0, kick[2]])
    return np.array([(expm(rates * each) @ start)[:2] for each in t])


# ---- the response of the loop --------------------------------------------------------------------


@EACH_FRAME
@pytest.mark.parametrize("gains", GAINS)
@pytest.mark.parametrize("kick", KICKS)
def test_errors_at_rest_follow_the_linear_system(kick: str, gains: str, mechanization: str) -> None:
    motion = base()
    log = with_bias(motion, at_rest(600.0), KICKS[kick][2])
    loop = true_heights(motion, log, gains=GAINS[gains], reference="absolute")
    start = kicked(state_at(motion, 0.0), KICKS[kick])
    nav = navigate(log, start, mechanization=mechanization, vertical=loop)
    found = up_errors(nav, motion)
    rows = np.linspace(0, len(nav) - 1, 40).astype(int)
    exact = response(GAINS[gains], KICKS[kick], 48.0 * np.pi / 180.0, 1250.0, nav.t[rows])
    size, c1 = np.abs(exact).max(axis=0), GAINS[gains].c1
    # The loop's own sums are Euler's: of the largest error they leave an interval times the first
    # gain, 1.5e-3 (100 s) to 4e-3 (40 s). Without gravity's gradient it would be 1 % off at 100 s
    assert np.all(np.abs(found[rows] - exact).max(axis=0) < 1.7 * MEAN_INTERVAL * c1 * size)


@pytest.mark.parametrize("name", ["manoeuvre", "road drive"])
def test_errors_in_motion_follow_the_linear_system_in_every_frame(name: str) -> None:
    motion, log = moving(name)
    log = with_bias(motion, log, KICKS["all"][2])
    loop = true_heights(motion, log, gains=GAINS["40 s"], reference="absolute")
    start = kicked(state_at(motion, 0.0), KICKS["all"])
    flights = [navigate(log, start, mechanization=frame, vertical=loop) for frame in MECHANIZATIONS]
    rows = np.linspace(0, len(log) - 1, 60).astype(int)
    first = motion.state(0.0)
    exact = response(
        GAINS["40 s"], KICKS["all"], float(first.lat[0]), float(first.h[0]), log.t[rows]
    )
    size = np.abs(exact).max(axis=0)
    for nav in flights:
        found = up_errors(nav, motion)[rows]
        # as above, 4e-3 of 20 m and 0.7 m/s. Gravity's gradient changes by 0.1 % with height and
        # latitude; a false upward velocity makes a false eastward one, whose Coriolis acceleration
        # is 1e-6 of the loop's
        limit = MEAN_INTERVAL * GAINS["40 s"].c1 * size
        assert np.all(np.abs(found - exact).max(axis=0) < limit)
    positions = [ecef(nav.lat, nav.lon, nav.h) for nav in flights]
    for other in positions[1:]:
        # m: 30 um of each frame's own step at 20 Hz
        assert np.abs(other - positions[0]).max() < 1e-3


@EACH_FRAME
def test_an_accelerometer_bias_leaves_no_height_error(mechanization: str) -> None:
    """The third gain finds it; without that gain the height settles where c2 balances it."""
    motion, bias = base(), 2e-3  # m/s^2, 200 ug
    log = with_bias(motion, at_rest(600.0), bias)
    left = {}
    for gains in (gains_from_time_constant(20.0), LoopGains(0.15, 8e-3, 0.0)):
        loop = true_heights(motion, log, gains=gains)
        nav = navigate(log, state_at(motion, 0.0), mechanization=mechanization, vertical=loop)
        left[gains.c3 > 0.0] = up_errors(nav, motion)
    # m: b t^2/2 exp(-t/tau) at two time constants; 1 %: interval times first gain, as above
    assert left[True][:, 0].max() == pytest.approx(0.5 * bias * 40.0**2 * np.exp(-2.0), rel=0.01)
    # m: 1e-10 after 30 time constants, and the Coriolis acceleration of the eastward velocity that
    # the transient has left, which swings with Schuler's period
    assert abs(left[True][-1, 0]) < 1e-6
    # m/s: between corrections the bias goes on working, half of the time before the stamp
    assert abs(left[True][-1, 1]) < 0.6 * max(INTERVALS) * bias
    # m: b / (c2 - 2 g/R)
    assert left[False][-1, 0] == pytest.approx(bias / (8e-3 - 3.09e-6), rel=0.01)


@EACH_FRAME
def test_free_diverges_and_baro_does_not(mechanization: str) -> None:
    motion, log = base(), at_rest(3600.0, (0.1,))
    start = kicked(state_at(motion, 0.0), (1.0, 0.0, 0.0))
    free = navigate(log, start, mechanization=mechanization)
    loop = true_heights(motion, log, reference="absolute")
    aided = navigate(log, start, mechanization=mechanization, vertical=loop)
    # m: cosh(3600 s / 569 s) of the metre; 2 g/R makes 569 to 570 s, 1 % an hour
    assert up_errors(free, motion)[-1, 0] == pytest.approx(np.cosh(3600.0 / 569.5), rel=0.02)
    # m, m/s: 1e-13 after 36 time constants; falling by a metre the base seems to go east at 0.1
    # mm/s, which swings with Schuler's period, and with it its Coriolis acceleration, 1e-8 m/s^2
    assert abs(up_errors(aided, motion)[-1, 0]) < 3e-5
    assert abs(up_errors(aided, motion)[-1, 1]) < 1e-6


@EACH_FRAME
def test_blocks_leave_no_trace_in_the_loop(mechanization: str) -> None:
    """What the loop has found goes on from block to block, bit for bit."""
    motion, log = moving("manoeuvre")
    loop = true_heights(motion, log, gains=GAINS["40 s"], reference="absolute")
    start = kicked(state_at(motion, 0.0), KICKS["all"])

    def solved(size: int) -> list[bytes]:
        pieces = solve(log[:1200].blocks(size), start, mechanization=mechanization, vertical=loop)
        return [
            np.concatenate([np.ravel(getattr(nav, name)) for nav in ended]).tobytes()
            for ended in [list(pieces)]
            for name in ("h", "v_eb_n", "lat", "lon", "q_nb")
        ]

    assert solved(17) == solved(1200)


# ---- where heights come from ---------------------------------------------------------------------


@EACH_FRAME
def test_start_takes_the_weather_out_and_absolute_leaves_it_in(mechanization: str) -> None:
    """A barometer that is 300 m off, by weather and geoid, read once a second."""
    motion, log = base(), at_rest(1500.0)
    true = state_at(motion, 0.0)
    seconds = np.arange(-1.3, 1502.0)
    heights = np.full(len(seconds), true.h + 300.0)
    left = {}
    for reference in ("start", "absolute"):
        loop = BaroLoop(seconds, heights, reference=reference)
        nav = navigate(log, true, mechanization=mechanization, vertical=loop)
        left[reference] = nav.h - true.h
    assert np.abs(left["start"]).max() < 1e-7  # m: 1e-12 m/s^2 of the gravity fit
    # 15 time constants: exp(-15) (1 - 30 + 225/2) of 300 m is 8 mm
    assert left["absolute"][-1] == pytest.approx(300.0, abs=0.02)


@EACH_FRAME
def test_a_start_that_is_wrong_stays_wrong_by_as_much(mechanization: str) -> None:
    """With reference start the barometer says how the height changes, not what it is."""
    motion, log = moving("manoeuvre")
    start = kicked(state_at(motion, 0.0), (50.0, 0.0, 0.0))
    nav = navigate(log, start, mechanization=mechanization, vertical=true_heights(motion, log))
    # m: gravity for the false height is 1.5e-4 m/s^2 too weak, which the loop takes for a bias:
    # b t^2/2 exp(-t/tau), 0.42 m at 200 s, 0.07 m at 600 s
    error = up_errors(nav, motion)[:, 0] - 50.0
    assert error.max() == pytest.approx(0.5 * 1.543e-4 * 200.0**2 * np.exp(-2.0), rel=0.01)
    assert error[-1] == pytest.approx(0.5 * 1.543e-4 * 600.0**2 * np.exp(-6.0), rel=0.03)


def in_hole(t: Array) -> NDArray[np.bool_]:
    """Whether an instant lies in the two minutes without heights."""
    return (t > 300.013 + 1e-9) & (t < 420.013 - 1e-9)


@EACH_FRAME
def test_the_loop_coasts_through_a_hole_with_the_bias_it_has_found(mechanization: str) -> None:
    motion, bias = base(), 2e-3  # m/s^2
    log = with_bias(motion, at_rest(900.0, (0.05,)), bias)
    recorded = np.arange(-0.187, 900.3, 0.2)
    recorded = recorded[~in_hole(recorded)]
    recorded = np.delete(recorded, [700, 701, 702])  # 0.8 s, no hole
    loop = BaroLoop(
        recorded, np.full(len(recorded), 1250.0), gains_from_time_constant(20.0), "absolute"
    )
    start = state_at(motion, 0.0)
    nav = navigate(log, start, mechanization=mechanization, vertical=loop)
    assert np.array_equal((nav.status & Status.UNAIDED) != 0, in_hole(nav.t))
    error = up_errors(nav, motion)[:, 0]
    # m: 14 m without what it had found; 4e-5 of the bias, exp(-15) (1 + 15 + 15^2/2), was left to
    # find after 15 time constants, 0.6 mm
    end = int(np.searchsorted(nav.t, 420.013)) - 1
    assert abs(error[end]) < 2e-3
    free = navigate(log, start, mechanization=mechanization)
    assert up_errors(free, motion)[2399, 0] == pytest.approx(0.5 * bias * 120.0**2, rel=0.01)
    assert abs(error[-1]) < 1e-6  # m: 24 time constants later


@pytest.mark.parametrize("reconstruction", ["causal-3", "centred-9", "samples-4"])
def test_samples_outside_the_record_of_heights_are_told(reconstruction: str) -> None:
    motion, log = base(), at_rest(120.0, (0.05,))
    seconds = np.arange(30.0, 90.1, 0.5)
    loop = BaroLoop(seconds, np.full(len(seconds), 1250.0), reference="absolute")
    start = state_at(motion, 0.0)
    nav = navigate(log, start, reconstruction=reconstruction, vertical=loop)
    outside = (nav.t < 30.0 - 1e-9) | (nav.t > 90.0 + 1e-9)
    assert np.array_equal((nav.status & Status.UNAIDED) != 0, outside)
    for vertical in ("free", "hold"):
        nav = navigate(log, start, reconstruction=reconstruction, vertical=vertical)
        assert not (nav.status & Status.UNAIDED).any()


@pytest.mark.parametrize("t", [5.0, 60.0])
def test_start_needs_a_height_at_the_start(t: float) -> None:
    log = at_rest(120.0, (0.05,))
    seconds = np.concatenate([np.arange(10.0, 50.0), np.arange(70.0, 110.0)])
    loop = BaroLoop(seconds, np.full(len(seconds), 900.0))
    start = replace(state_at(base(), 0.0), t=t)
    with pytest.raises(StateTimeError, match="no height to start from"):
        navigate(log, start, vertical=loop)
    navigate(log, replace(start, t=20.0), vertical=loop)


# ---- holding the height --------------------------------------------------------------------------


@EACH_FRAME
@pytest.mark.parametrize("name", ["manoeuvre", "road drive"])
def test_hold_keeps_the_height_whatever_is_felt(name: str, mechanization: str) -> None:
    """Against a vertical motion, a false upward velocity and a bias that are all in the log."""
    motion, log = moving(name)
    log = with_bias(motion, log, 0.05)
    start = kicked(state_at(motion, 0.0), (200.0, 3.0, 0.0))
    nav = navigate(log, start, mechanization=mechanization, vertical="hold")
    assert np.abs(nav.h - start.h).max() < 1e-9  # m: rounding
    assert np.abs(nav.v_eb_n[:, 2]).max() < 1e-12  # m/s: rounding of 300 and of 460 m/s


def test_hold_leads_every_frame_the_same_way() -> None:
    motion, log = moving("manoeuvre")
    start = kicked(state_at(motion, 0.0), (200.0, 3.0, 0.0))
    positions = [
        ecef(nav.lat, nav.lon, nav.h)
        for nav in (
            navigate(log, start, mechanization=frame, vertical="hold") for frame in MECHANIZATIONS
        )
    ]
    for other in positions[1:]:
        assert np.abs(other - positions[0]).max() < 1e-3  # m: 50 um of each frame's own step


def test_baro_without_heights_says_what_to_pass() -> None:
    imu = ImuSamples(t=[0.1, 0.2], gyro=np.zeros((2, 3)), accel=np.zeros((2, 3)), kind="increment")
    with pytest.raises(ValueError, match=r"vertical=navgrade\.BaroLoop"):
        navigate(imu, NavState(lat=0.5, lon=0.1, h=0.0), vertical="baro")
