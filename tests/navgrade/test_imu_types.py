"""Samples, states and trajectories: checked, immutable, and started at any instant."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

import navgrade
from navgrade import ImuSamples, NavState, Status, Trajectory
from navgrade.errors import StateTimeError
from tests.navgrade.logmaking import EPOCH_NS, OMEGA, resting

COUNT = 6
KINDS = ("rate", "average", "increment", "compensated")


def columns(**changed: Any) -> dict[str, Any]:
    """Arguments of valid samples, some of them changed."""
    valid = {
        "t": np.arange(1.0, COUNT + 1.0),
        "dt": np.full(COUNT, 1.0),
        "gyro": np.arange(3.0 * COUNT).reshape(COUNT, 3),
        "accel": np.ones((COUNT, 3)),
        "kind": "increment",
    }
    return valid | changed


def with_value(name: str, index: Any, value: float) -> dict[str, Any]:
    """Arguments of samples with one number replaced."""
    arguments = columns()
    arguments[name] = arguments[name].copy()
    arguments[name][index] = value
    return arguments


# ---- samples -----------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize(
    ("name", "index"), [("gyro", (4, 2)), ("accel", (4, 0)), ("dt", 4), ("t", 4)]
)
def test_a_value_that_is_not_finite_is_named(name: str, index: Any, value: float) -> None:
    with pytest.raises(ValueError, match=rf"^{name} is not finite at index 4: .*{value}"):
        ImuSamples(**with_value(name, index, value))


@pytest.mark.parametrize(("value", "before"), [(3.0, 3.0), (2.5, 3.0), (-1.0, 3.0)])
def test_time_that_does_not_increase_is_named(value: float, before: float) -> None:
    with pytest.raises(ValueError, match=rf"t must increase: .*{value}.* at index 3 .*{before}"):
        ImuSamples(**with_value("t", 3, value))


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_an_interval_that_is_not_positive_is_named(value: float) -> None:
    with pytest.raises(ValueError, match=rf"dt must be positive.*{value}.* at index 2"):
        ImuSamples(**with_value("dt", 2, value))


@pytest.mark.parametrize(
    ("name", "value", "shape"),
    [
        ("gyro", np.zeros((COUNT, 2)), r"\(6, 3\), got \(6, 2\)"),
        ("gyro", np.zeros((COUNT - 1, 3)), r"\(6, 3\), got \(5, 3\)"),
        ("accel", np.zeros(3), r"\(6, 3\), got \(3,\)"),
        ("accel", np.zeros((3, COUNT)), r"\(6, 3\), got \(3, 6\)"),
        ("dt", 0.01, r"\(6,\), got \(1?,?\)"),
        ("t", np.arange(float(COUNT))[:, None], r"\(6,\), got \(6, 1\)"),
        ("status", np.zeros(2, np.uint32), r"\(6,\), got \(2,\)"),
    ],
)
def test_a_wrong_shape_is_named_with_the_right_one(name: str, value: Any, shape: str) -> None:
    with pytest.raises(ValueError, match=rf"^{name} must have shape {shape}"):
        ImuSamples(**columns(**{name: value}))


@pytest.mark.parametrize("kind", ["rates", "", None, "Rate"])
def test_an_unknown_kind_lists_the_four(kind: Any) -> None:
    with pytest.raises(ValueError, match=f"rate, average, increment, compensated, got {kind!r}"):
        ImuSamples(**columns(kind=kind))


def test_a_single_sample_needs_its_interval() -> None:
    one = {"t": [1.0], "gyro": np.zeros((1, 3)), "accel": np.ones((1, 3)), "kind": "rate"}
    with pytest.raises(ValueError, match="dt must be given"):
        ImuSamples(**one)
    assert ImuSamples(**one, dt=[0.5]).dt.tolist() == [0.5]


@pytest.mark.parametrize(
    ("t", "dt"),
    [
        ([0.0, 1.0, 2.0, 3.0], [1.0, 1.0, 1.0, 1.0]),
        ([0.0, 1.0, 2.5, 3.0, 4.0], [1.0, 1.0, 1.5, 0.5, 1.0]),
        ([0.0, 1.0, 2.0, 5.0, 6.0], [1.0, 1.0, 1.0, 1.0, 1.0]),  # two missing: a hole
        ([0.0, 1.0, 2.0, 6.0, 7.0], [1.0, 1.0, 1.0, 1.0, 1.0]),  # a gap is nobody's interval
    ],
)
def test_intervals_follow_from_the_stamps(t: list[float], dt: list[float]) -> None:
    n = len(t)
    imu = ImuSamples(t=t, gyro=np.zeros((n, 3)), accel=np.ones((n, 3)), kind="rate")
    assert imu.dt.tolist() == dt


def test_lists_and_integers_are_taken_as_numbers() -> None:
    imu = ImuSamples(t=[1, 2], dt=[1, 1], gyro=[[1, 2, 3]] * 2, accel=[[0, 0, -9]] * 2, kind="rate")
    assert imu.gyro.dtype == imu.t.dtype == np.float64
    assert len(imu) == 2
    assert imu.epoch_ns == 0
    assert imu.status.tolist() == [0, 0]


@pytest.mark.parametrize("name", ["t", "dt", "gyro", "accel", "status"])
def test_samples_cannot_be_changed(name: str) -> None:
    imu = ImuSamples(**columns())
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(imu, name, np.zeros(COUNT))
    with pytest.raises(ValueError, match="read-only"):
        getattr(imu, name)[0] = 7


@pytest.mark.parametrize("name", ["t", "dt", "gyro", "accel"])
def test_the_callers_own_array_stays_writable(name: str) -> None:
    arguments = columns()
    ImuSamples(**arguments)
    arguments[name][0] = 0.5
    assert np.all(arguments[name][0] == 0.5)


@pytest.mark.parametrize("rows", [slice(0, 2), slice(3, None), slice(2, 2), slice(-1, None)])
def test_rows_keep_everything(rows: slice) -> None:
    imu = ImuSamples(**columns(status=np.arange(COUNT), epoch_ns=EPOCH_NS))
    part = imu[rows]
    for name in ("t", "dt", "gyro", "accel", "status"):
        assert np.array_equal(getattr(part, name), getattr(imu, name)[rows])
    assert (part.kind, part.epoch_ns) == ("increment", EPOCH_NS)


@pytest.mark.parametrize("size", [1, 2, 4, 6, 100])
def test_blocks_are_the_samples_in_order(size: int) -> None:
    imu = ImuSamples(**columns())
    blocks = list(imu.blocks(size))
    assert [len(block) for block in blocks[:-1]] == [size] * (len(blocks) - 1)
    assert np.array_equal(np.concatenate([block.gyro for block in blocks]), imu.gyro)


@pytest.mark.parametrize("kind", KINDS)
def test_mean_rates_are_increments_over_their_intervals(kind: str) -> None:
    imu = ImuSamples(**columns(kind=kind, dt=np.full(COUNT, 0.5)))
    gyro, accel = imu.mean_rates()
    factor = 2.0 if kind in ("increment", "compensated") else 1.0
    assert imu.is_integrated == (factor == 2.0)
    assert np.array_equal(gyro, imu.gyro * factor)
    assert np.array_equal(accel, imu.accel * factor)


# ---- states ------------------------------------------------------------------------------------

HERE = {"lat": 0.8, "lon": 0.1, "h": 100.0}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"lat": 45.0}, r"lat must be within ±pi/2 rad, got 45\.0; degrees are not radians"),
        ({"lon": 114.0}, r"lon must be within ±2 pi rad, got 114\.0; degrees are not radians"),
        ({"lat": math.nan}, "lat must be finite, got nan"),
        ({"lon": math.inf}, "lon must be finite, got inf"),
        ({"h": -math.inf}, "h must be finite, got -inf"),
        ({"t": math.nan}, "t must be finite"),
        ({"v_eb_n": (1.0, 2.0)}, r"v_eb_n must be 3 finite numbers, got \(1\.0, 2\.0\)"),
        ({"v_eb_n": (1.0, math.nan, 0.0)}, "v_eb_n must be 3 finite numbers"),
        ({"q_nb": (1.0, 0.0, 0.0)}, "q_nb must be 4 finite numbers"),
        ({"q_nb": (1.0, 0.1, 0.0, 0.0)}, r"unit quaternion, its norm is 1\.004"),
        ({"q_nb": (0.0, 0.0, 0.0, 0.0)}, "unit quaternion"),
    ],
)
def test_a_wrong_state_names_the_value(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        NavState(**(HERE | changed))


def test_a_state_is_immutable_and_normalised() -> None:
    q = np.array([0.8, 0.0, 0.6, 0.0]) * (1.0 + 5e-7)
    state = NavState(**HERE, q_nb=q)
    assert np.linalg.norm(state.q_nb) == pytest.approx(1.0, abs=2e-16)  # rounding
    for array in (state.q_nb, state.v_eb_n):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        state.lat = 0.0  # type: ignore[misc]  # the point of the test
    q[0] = 5.0
    assert state.q_nb[0] < 1.0


# ---- trajectories ------------------------------------------------------------------------------


def a_trajectory(**changed: Any) -> Trajectory:
    """Five rows."""
    n = 5
    valid: dict[str, Any] = {
        "t": np.arange(float(n)),
        "lat": np.linspace(0.1, 0.2, n),
        "lon": np.linspace(0.3, 0.4, n),
        "h": np.linspace(1.0, 2.0, n),
        "v_eb_n": np.arange(3.0 * n).reshape(n, 3),
        "q_nb": np.tile([0.6, 0.0, 0.0, 0.8], (n, 1)),
        "status": np.arange(n, dtype=np.uint32),
        "epoch_ns": EPOCH_NS,
    }
    return Trajectory(**(valid | changed))


@pytest.mark.parametrize(
    ("name", "value", "shape"),
    [
        ("lat", np.zeros(4), r"\(5,\), got \(4,\)"),
        ("v_eb_n", np.zeros((5, 2)), r"\(5, 3\), got \(5, 2\)"),
        ("q_nb", np.zeros((5, 3)), r"\(5, 4\), got \(5, 3\)"),
        ("status", np.zeros(6, np.uint32), r"\(5,\), got \(6,\)"),
    ],
)
def test_a_trajectory_of_unequal_columns_is_refused(name: str, value: Any, shape: str) -> None:
    with pytest.raises(ValueError, match=rf"^{name} must have shape {shape}"):
        a_trajectory(**{name: value})


@pytest.mark.parametrize("name", ["t", "lat", "lon", "h", "v_eb_n", "q_nb", "status"])
def test_a_trajectory_cannot_be_changed(name: str) -> None:
    nav = a_trajectory()
    with pytest.raises(ValueError, match="read-only"):
        getattr(nav, name)[0] = 0
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(nav, name, np.zeros(5))


@pytest.mark.parametrize("index", [0, 3, -1])
def test_a_row_is_a_state_to_start_from(index: int) -> None:
    nav = a_trajectory()
    state = nav.state(index)
    assert (state.t, state.lat, state.lon, state.h) == (
        nav.t[index],
        nav.lat[index],
        nav.lon[index],
        nav.h[index],
    )
    assert np.array_equal(state.v_eb_n, nav.v_eb_n[index])
    assert np.array_equal(state.q_nb, nav.q_nb[index])


# ---- starting anywhere ---------------------------------------------------------------------------


def swaying(kind: str, seconds: float = 12.0, rate_hz: float = 100.0) -> ImuSamples:
    """An IMU that cones at 5 Hz while it is shaken, so that windows matter; stamps jitter."""
    steps = np.random.default_rng(4).uniform(0.8, 1.2, round(seconds * rate_hz)) / rate_hz
    steps = np.round(steps, 9)
    t = np.cumsum(steps)
    phase = 2.0 * math.pi * 5.0 * t
    gyro = 0.5 * np.stack([np.sin(phase), np.cos(phase), 0.2 * np.sin(0.3 * phase)], axis=1)
    accel = np.stack([np.cos(phase), np.sin(phase), 0.0 * t - 9.806], axis=1)
    scale = steps[:, None] if kind in ("increment", "compensated") else 1.0
    return ImuSamples(
        t=t,
        dt=steps,
        gyro=gyro * scale,
        accel=accel * scale,
        kind=kind,
        epoch_ns=EPOCH_NS,  # type: ignore[arg-type]
    )


START = NavState(lat=0.8, lon=0.2, h=50.0, v_eb_n=(20.0, -5.0, 1.0), q_nb=(0.5, 0.5, -0.5, 0.5))
METRE = 1.6e-7  # rad of latitude


def metres_between(one: Trajectory, other: Trajectory) -> float:
    """Greatest distance of two trajectories over the same rows."""
    north = (one.lat - other.lat) / METRE
    east = (one.lon - other.lon) / METRE
    return float(np.max(np.sqrt(north**2 + east**2 + (one.h - other.h) ** 2)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("row", [0, 1, 400])
def test_samples_before_the_state_are_context(kind: str, row: int) -> None:
    imu = swaying(kind)
    whole = navgrade.navigate(imu, START)
    rest = navgrade.navigate(imu, whole.state(row))
    tail = whole[row + 1 :]
    assert np.array_equal(rest.t, tail.t)
    assert rest.epoch_ns == EPOCH_NS
    # a state carries rounded sums only: 1e-16 of a position is 1 nm, of 20 m/s 4e-15 m/s, 12 s long
    assert metres_between(rest, tail) < 1e-8
    assert np.max(np.abs(rest.v_eb_n - tail.v_eb_n)) < 1e-11  # m/s
    assert np.max(np.abs(rest.q_nb - tail.q_nb)) < 1e-14
    assert np.array_equal(rest.status, tail.status)
    if row >= 4:
        assert not rest.status[:-4].any()


@pytest.mark.parametrize(
    ("reconstruction", "status"),
    [
        ("causal-3", [Status.SHORT_WINDOW] * 3 + [0]),
        ("centred-9", [Status.SHIFTED_WINDOW] * 4 + [0]),
    ],
)
def test_without_the_context_the_first_windows_are_others(
    reconstruction: str, status: list[int]
) -> None:
    """What the test above would miss if samples before the state were dropped."""
    imu = swaying("increment")
    whole = navgrade.navigate(imu, START, reconstruction=reconstruction)
    cut = navgrade.navigate(imu[401:], whole.state(400), reconstruction=reconstruction)
    assert cut.status[: len(status)].tolist() == status
    assert metres_between(cut, whole[401:]) > 1e-7  # ten times the tolerance there


@pytest.mark.parametrize("row", [3, 4, 5, 400])
def test_block_forms_begin_their_groups_at_the_state(row: int) -> None:
    """They look at nothing before it, so a log that begins there gives the same bits."""
    imu = swaying("increment")
    state = dataclasses.replace(START, t=float(imu.t[row]))
    found = navgrade.navigate(imu, state, reconstruction="samples-3")
    alone = navgrade.navigate(imu[row + 1 :], state, reconstruction="samples-3")
    assert found.t[:2].tolist() == imu.t[[row + 3, row + 6]].tolist()
    assert found.t[-1] == imu.t[-1]
    for name in ("t", "lat", "lon", "h", "v_eb_n", "q_nb", "status"):
        assert getattr(found, name).tobytes() == getattr(alone, name).tobytes()


@pytest.mark.parametrize("reconstruction", ["none", "causal-3", "centred-9"])
@pytest.mark.parametrize("kind", ["average", "increment", "compensated"])
@pytest.mark.parametrize("share", [0.25, 0.5, 0.875])
def test_a_state_inside_an_interval_splits_it_in_proportion(
    kind: str, reconstruction: str, share: float
) -> None:
    imu = swaying(kind)
    k = 500
    middle = float(imu.t[k] - imu.dt[k] * (1.0 - share))
    parts = np.array([share, 1.0 - share])
    scale = parts if imu.is_integrated else np.ones(2)

    def cut(values: np.ndarray, halves: np.ndarray) -> np.ndarray:
        return np.concatenate([values[:k], halves, values[k + 1 :]])

    by_hand = ImuSamples(
        t=cut(imu.t, np.array([middle, imu.t[k]])),
        dt=cut(imu.dt, imu.dt[k] * parts),
        gyro=cut(imu.gyro, imu.gyro[k] * scale[:, None]),
        accel=cut(imu.accel, imu.accel[k] * scale[:, None]),
        kind=imu.kind,
    )
    state = dataclasses.replace(START, t=middle)
    found = navgrade.navigate(imu, state, reconstruction=reconstruction)
    wanted = navgrade.navigate(by_hand, state, reconstruction=reconstruction)
    assert found.t[0] == imu.t[k]
    assert np.array_equal(found.t, wanted.t)
    assert len(found) == len(imu) - k
    # the two cut at instants that differ by the rounding of 5 s, 1e-15 s: 2e-14 m at 20 m/s
    assert metres_between(found, wanted) < 1e-8
    assert np.max(np.abs(found.v_eb_n - wanted.v_eb_n)) < 1e-11  # m/s
    assert np.max(np.abs(found.q_nb - wanted.q_nb)) < 1e-14


def test_a_split_rate_counts_only_what_lies_after_the_state() -> None:
    """At rest the body turns with the Earth; from the middle of an interval on, half as much."""
    drive = resting(1.0, 10.0, lat_deg=45.0, roll_deg=0.0, pitch_deg=0.0, heading_deg=0.0)
    spin = drive.gyro + np.array([0.0, 0.0, 0.3])
    t = np.arange(1.0, 12.0) / 10.0
    imu = ImuSamples(t=t, gyro=spin, accel=drive.accel, kind="rate")
    state = NavState(lat=math.pi / 4, lon=0.0, h=0.0, t=0.55)
    nav = navgrade.navigate(imu, state)
    turned = np.unwrap(nav.euler[:, 2])
    # heading is 0.3 rad/s times the time since the state; the sum of rotations is exact here
    # up to the tilt the Earth rate makes, 7e-5 rad/s * 0.6 s squared
    np.testing.assert_allclose(turned, 0.3 * (nav.t - 0.55), rtol=0.0, atol=1e-8)
    assert nav.t[0] == pytest.approx(0.6, abs=1e-12)
    assert OMEGA * 0.6 < 1e-4


@pytest.mark.parametrize("kind", KINDS)
def test_a_state_at_the_start_of_the_first_interval_uses_every_sample(kind: str) -> None:
    imu = swaying(kind)
    begin = float(imu.t[0] - imu.dt[0])
    nav = navgrade.navigate(imu, dataclasses.replace(START, t=begin))
    assert np.array_equal(nav.t, imu.t)


@pytest.mark.parametrize("row", [0, 7, 1198])
def test_a_state_at_a_stamp_splits_nothing(row: int) -> None:
    imu = swaying("average")
    nav = navgrade.navigate(imu, dataclasses.replace(START, t=float(imu.t[row])))
    assert np.array_equal(nav.t, imu.t[row + 1 :])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("offset", [-1e-3, -5.0, -1e9])
def test_a_state_before_the_samples_is_refused(kind: str, offset: float) -> None:
    imu = swaying(kind)
    begin = float(imu.t[0] - imu.dt[0])
    with pytest.raises(StateTimeError, match=rf"before the samples.*{begin:.9f} s") as error:
        navgrade.navigate(imu, dataclasses.replace(START, t=begin + offset))
    assert isinstance(error.value, ValueError)
    assert isinstance(error.value, navgrade.NavgradeError)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("offset", [0.0, 1e-3, 5.0])
def test_a_state_after_the_samples_is_refused(kind: str, offset: float) -> None:
    imu = swaying(kind)
    end = float(imu.t[-1])
    with pytest.raises(StateTimeError, match=rf"no samples to integrate.*{end:.9f} s"):
        navgrade.navigate(imu, dataclasses.replace(START, t=end + offset))


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"reconstruction": "casual-3"}, "reconstruction 'casual-3'.*did you mean 'causal-3'"),
        ({"reconstruction": "centered-9"}, "'centered-9' is not one of none, .*mean 'centred-9'"),
        ({"reconstruction": "sample-2"}, "'sample-2' is not one of none, .*mean 'samples-2'"),
        ({"mechanization": "ned"}, "mechanization 'ned' is not one of n"),
        ({"vertical": "held"}, "vertical 'held'.*did you mean 'hold'"),
    ],
)
def test_an_unknown_choice_names_the_nearest(choice: dict[str, str], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        navgrade.navigate(swaying("average"), START, **choice)


def test_samples_do_not_share_memory_that_can_change() -> None:
    gyro = np.zeros((3, 3))
    imu = ImuSamples(t=[1.0, 2.0, 3.0], gyro=gyro, accel=np.ones((3, 3)), kind="rate")
    gyro[1] = np.nan
    assert np.all(imu.gyro == 0.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"h": [0.0, np.nan]}, "h is not finite at index 1"),
        ({"t": [2.0, 1.0]}, "t must increase, it does not at index 1"),
        ({"v_eb_n": [[0.0, 0.0]] * 2}, r"v_eb_n must have shape \(2, 3\)"),
        ({"status": [0]}, r"status must have shape \(2,\)"),
    ],
)
def test_a_trajectory_is_checked(change: dict[str, Any], message: str) -> None:
    good = {
        "t": [1.0, 2.0],
        "lat": [0.1, 0.1],
        "lon": [0.2, 0.2],
        "h": [3.0, 3.0],
        "v_eb_n": np.zeros((2, 3)),
        "q_nb": [[1.0, 0.0, 0.0, 0.0]] * 2,
        "status": [0, 0],
    }
    assert len(navgrade.Trajectory(**good)) == 2
    with pytest.raises(ValueError, match=message):
        navgrade.Trajectory(**{**good, **change})
