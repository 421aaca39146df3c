"""Holes in the time line are stretched over, refused or bridged; and blocks leave no trace."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

import navgrade
from navgrade import ImuSamples, NavState, Status, Trajectory
from navgrade.errors import GapError
from navgrade.gaps import Gap, without_gaps
from navgrade.imu import concatenate
from navgrade.navigation import solve
from navgrade.reconstruction import DEFAULT
from tests.navgrade.logmaking import EPOCH_NS, random_recording

STEP = 0.01  # s
KINDS = ("rate", "average", "increment", "compensated")


def samples(kind: str = "increment", count: int = 400, *, jitter: float = 0.0) -> ImuSamples:
    """Random samples whose intervals meet; `jitter` is a share of the step."""
    steps = STEP * (1.0 + jitter * np.random.default_rng(8).uniform(-1.0, 1.0, count))
    values = random_recording(count)
    scale = steps[:, None] if kind in ("increment", "compensated") else 1.0
    return ImuSamples(
        t=np.cumsum(steps),
        dt=steps,
        gyro=0.2 * values.gyro * scale,
        accel=(values.accel * 0.1 + np.array([0.0, 0.0, -9.8])) * scale,
        kind=kind,  # type: ignore[arg-type]  # a parameter of the test
        epoch_ns=EPOCH_NS,
    )


def without(imu: ImuSamples, first: int, count: int) -> ImuSamples:
    """Leave samples out; those behind keep their own intervals."""
    keep = np.delete(np.arange(len(imu)), np.arange(first, first + count))
    return dataclasses.replace(
        imu, **{name: getattr(imu, name)[keep] for name in ("t", "dt", "gyro", "accel", "status")}
    )


def mended(
    imu: ImuSamples, *, bridge: bool = False, size: int = 10_000
) -> tuple[ImuSamples, list[Gap]]:
    """The samples made to meet, and the gaps found."""
    gaps: list[Gap] = []
    pieces = list(without_gaps(imu.blocks(size), bridge=bridge, gaps=gaps))
    return concatenate(pieces), gaps


def meets(imu: ImuSamples) -> bool:
    """True when every interval begins where the one before ends, to 1 ns."""
    return bool(np.all(np.abs(imu.t[1:] - imu.dt[1:] - imu.t[:-1]) < 1e-9))


# ---- what counts as a gap ----------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("missing", [0, 1, 2, 3, 4, 50])
def test_the_length_decides(kind: str, missing: int) -> None:
    """Stamps up to 3 intervals apart are stretched over, more is a gap."""
    imu = without(samples(kind), 200, missing)
    if missing > 2:
        with pytest.raises(GapError, match=f"{missing * STEP:.3f} s without samples after 2.000 s"):
            mended(imu)
        return
    found, gaps = mended(imu)
    assert gaps == []
    assert meets(found)
    assert len(found) == len(imu)
    assert np.flatnonzero(found.status).tolist() == ([200] if missing else [])
    if missing:
        assert found.status[200] == Status.STRETCHED == 2
        assert found.dt[200] == pytest.approx((missing + 1) * STEP, abs=1e-12)  # rounding


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("missing", [1, 2])
def test_the_mean_rate_stands_for_what_is_missing(kind: str, missing: int) -> None:
    imu = without(samples(kind), 200, missing)
    found, _ = mended(imu)
    for ours, given in zip(found.mean_rates(), imu.mean_rates(), strict=True):
        np.testing.assert_allclose(ours, given, rtol=1e-14)  # a product and a quotient
    others = np.arange(len(imu)) != 200
    for name in ("t", "dt", "gyro", "accel"):
        assert getattr(found, name)[others].tobytes() == getattr(imu, name)[others].tobytes()


@pytest.mark.parametrize("share", [-0.4, 0.1, 0.4])
def test_jitter_of_the_stamps_is_left_alone(share: float) -> None:
    """Increments know their interval; a stamp may be late by less than half of it."""
    imu = samples()
    moved = imu.t.copy()
    moved[200:] += share * STEP
    late = dataclasses.replace(imu, t=moved)
    found, gaps = mended(late)
    assert gaps == []
    for name in ("t", "dt", "gyro", "accel", "status"):
        assert getattr(found, name).tobytes() == getattr(late, name).tobytes()


def test_intervals_that_overlap_are_refused() -> None:
    imu = samples()
    dt = imu.dt.copy()
    dt[200] *= 1.9
    with pytest.raises(GapError, match=r"sample at 2\.010000 s starts 0\.009000 s before") as error:
        mended(dataclasses.replace(imu, dt=dt))
    assert error.value.time_s == pytest.approx(2.01, abs=1e-9)


def test_the_error_tells_time_length_and_way_out() -> None:
    with pytest.raises(GapError) as error:
        navgrade.navigate(without(samples(), 100, 25), NavState(lat=0.5, lon=0.0, h=0.0))
    assert error.value.time_s == pytest.approx(1.0, abs=1e-9)
    for fact in ("0.250 s", "1.000 s", "--bridge-gaps", "bridge_gaps=True"):
        assert fact in str(error.value)


# ---- bridging ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("missing", [3, 4, 50])
@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_a_bridge_is_a_straight_line_between_its_piers(kind: str, missing: int, size: int) -> None:
    imu = without(samples(kind), 200, missing)
    found, gaps = mended(imu, bridge=True, size=size)
    assert meets(found)
    assert len(found) == len(imu) + missing
    bridged = (found.status & Status.BRIDGED).astype(bool)
    assert np.flatnonzero(bridged).tolist() == list(range(200, 200 + missing))
    # instants of a centisecond grid, to rounding
    np.testing.assert_allclose(found.t[bridged], STEP * np.arange(201, 201 + missing), atol=1e-12)
    (gap,) = gaps
    assert gap.start == pytest.approx(2.0, abs=1e-12)
    assert gap.length == pytest.approx(missing * STEP, abs=1e-12)

    rates = zip(imu.mean_rates(), found.mean_rates(), strict=True)
    for recorded, ours in rates:
        # the integral over the hole: a trapezoid between the rates on both sides
        integral = (ours[bridged] * found.dt[bridged, None]).sum(axis=0)
        trapezoid = 0.5 * (recorded[199] + recorded[200]) * missing * STEP
        np.testing.assert_allclose(integral, trapezoid, rtol=0, atol=1e-12)  # rounding, m/s
        second = np.diff(ours[bridged], n=2, axis=0)
        assert np.max(np.abs(second), initial=0.0) < 1e-12  # a line, to rounding
    for name in ("t", "dt", "gyro", "accel", "status"):
        recorded = np.concatenate(
            [getattr(found, name)[:200], getattr(found, name)[200 + missing :]]
        )
        assert recorded.tobytes() == getattr(imu, name).tobytes()


def test_several_gaps_are_each_told() -> None:
    imu = without(without(without(samples(), 300, 10), 200, 1), 100, 4)
    found, gaps = mended(imu, bridge=True)
    assert [(round(gap.start, 6), round(gap.length, 6)) for gap in gaps] == [
        (1.0, 0.04),
        (3.0, 0.1),
    ]
    assert (found.status & Status.BRIDGED).astype(bool).sum() == 14
    assert (found.status & Status.STRETCHED).astype(bool).sum() == 1
    assert meets(found)


def test_bridged_samples_carry_their_status_into_the_solution() -> None:
    imu = without(samples(), 100, 25)
    nav = navgrade.navigate(imu, NavState(lat=0.5, lon=0.0, h=0.0), bridge_gaps=True)
    bridged = (nav.status & Status.BRIDGED).astype(bool)
    assert np.flatnonzero(bridged).tolist() == list(range(100, 125))
    assert len(nav) == 400


def test_a_straight_line_is_bridged_without_error() -> None:
    """Rates that grow linearly: the bridge is off by the curvature it cannot see, none."""
    n = 400
    edges = STEP * np.arange(n + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    slope = np.array([0.1, -0.2, 0.3])
    rate = middle[:, None] * slope
    imu = ImuSamples(
        t=edges[1:], dt=np.full(n, STEP), gyro=rate * STEP, accel=rate * STEP, kind="increment"
    )
    found, _ = mended(without(imu, 150, 60), bridge=True)
    # half a step at each pier carries the pier's own rate: sums to zero over the hole
    wanted = slope * edges[-1] ** 2 / 2.0
    np.testing.assert_allclose(found.gyro.sum(axis=0), wanted, rtol=1e-12)


# ---- blocks ------------------------------------------------------------------------------------

START = NavState(
    lat=0.7, lon=0.1, h=10.0, v_eb_n=(1.0, 2.0, 3.0), q_nb=(0.5, -0.5, 0.5, 0.5), t=0.503
)


COLUMNS = ("t", "lat", "lon", "h", "v_eb_n", "q_nb", "status")


def by_blocks(imu: ImuSamples, sizes: Sequence[int], **options: Any) -> list[Trajectory]:
    """Navigate through blocks of these sizes."""
    ends = np.cumsum(sizes)
    blocks = [imu[end - size : end] for end, size in zip(ends, sizes, strict=True)]
    return list(solve(blocks, START, **options))


def same_bits(parts: list[Trajectory], whole: Trajectory) -> None:
    """Check that the pieces together are the whole."""
    assert {part.epoch_ns for part in parts} == {whole.epoch_ns} == {EPOCH_NS}
    for name in COLUMNS:
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert joined.tobytes() == getattr(whole, name).tobytes(), name


HOLES = {"none": 0, "stretched": 2, "bridged": 40}  # samples that are missing


@pytest.mark.parametrize("size", [1, 7, 500, 10_000])
@pytest.mark.parametrize("hole", HOLES)
@pytest.mark.parametrize(
    ("kind", "reconstruction"),
    [
        *((kind, DEFAULT) for kind in KINDS),
        ("increment", "causal-3"),
        ("increment", "samples-3"),
        ("average", "none"),
    ],
)
def test_the_solution_does_not_depend_on_blocks(
    kind: str, reconstruction: str, hole: str, size: int
) -> None:
    """Intervals scatter by 20 %, as those of a sensor that alternates between 6 and 4 ms.

    The hole stands behind the first thousand samples, from which the nominal interval is taken.
    """
    imu = without(samples(kind, 1700, jitter=0.2), 1300, HOLES[hole])
    options = {"reconstruction": reconstruction, "bridge_gaps": True}
    whole = navgrade.navigate(imu, START, **options)  # type: ignore[arg-type]
    same_bits(by_blocks(imu, [size] * math.ceil(len(imu) / size), **options), whole)


@pytest.mark.parametrize("kind", KINDS)
def test_ragged_and_empty_blocks_change_nothing(kind: str) -> None:
    imu = samples(kind, 1700, jitter=0.2)
    sizes = [0, 3, 1, 0, 997, 2, 1, 1, 0, 50, 1, 600, 0, 44, 0]
    assert sum(sizes) == len(imu)
    same_bits(by_blocks(imu, sizes), navgrade.navigate(imu, START))


def test_gaps_met_on_the_way_are_handed_back() -> None:
    imu = without(samples(count=1500), 900, 40)
    gaps: list[Gap] = []
    list(solve(imu.blocks(100), START, bridge_gaps=True, gaps=gaps))
    assert [(round(gap.start, 6), round(gap.length, 6)) for gap in gaps] == [(9.0, 0.4)]


def test_a_gap_before_the_start_is_nobodys_concern() -> None:
    """Only what is integrated must be whole."""
    t = np.concatenate([np.arange(1, 51), np.arange(150, 300)]) * 0.01
    accel = np.tile([0.0, 0.0, -9.8], (len(t), 1))
    imu = ImuSamples(t=t, gyro=np.zeros((len(t), 3)), accel=accel, kind="average")
    nav = navgrade.navigate(imu, NavState(lat=0.7, lon=0.1, h=0.0, t=2.0))
    assert nav.t[0] == pytest.approx(2.01, abs=1e-12)  # s: rounding
    with pytest.raises(GapError, match=r"0\.990 s without samples after 0\.500 s"):
        navgrade.navigate(imu, NavState(lat=0.7, lon=0.1, h=0.0, t=0.3))


def test_no_bridge_reaches_across_years() -> None:
    """One zero stamp must not ask for a billion samples."""
    t = np.concatenate([[0.0], 1.7e9 + np.arange(100) * 0.01])
    rows = np.ones((len(t), 3))
    imu = ImuSamples(t=t, gyro=rows, accel=rows, kind="average")
    with pytest.raises(GapError, match="too long to interpolate"):
        navgrade.navigate(imu, NavState(lat=0.7, lon=0.1, h=0.0, t=0.0), bridge_gaps=True)
