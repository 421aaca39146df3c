"""Windows end where a stretch ends: at a bridged gap, a jump of the interval, an end of the log.

What a row depends on is seen from outside: one sample is changed, and the rows whose bits change
are those whose window holds it.
"""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

import navgrade
from navgrade import ImuSamples, NavState, Status
from navgrade.imu import BodyIncrements
from navgrade.reconstruction import RECONSTRUCTIONS
from tests.navgrade.body import log_of, rebuilt, same_bits

Array = NDArray[np.float64]

H = 0.01  # s
SHORT, SHIFTED = Status.SHORT_WINDOW, Status.SHIFTED_WINDOW
AROUND = 6  # samples that make the rate at a point
# of rates at points: those before and after the start of an interval that are taken
POINTS = {"euler": (0, 0), "midpoint": (0, 1), "rk4": (1, 2)}
CENTRED = [name for name in RECONSTRUCTIONS if name.startswith("centred")]
NEIGHBOURLY = [name for name in RECONSTRUCTIONS if name not in ("none", "causal-0")]


def size_of(name: str) -> int:
    """The number in the name: previous samples, samples of a block, or of a centred window."""
    return int(name.partition("-")[2] or 0)


def around_points(name: str, start: int, end: int) -> list[tuple[int, int, int]]:
    """Rows of a stretch for an algorithm of rates at points."""
    rows = []
    back, ahead = POINTS[name]
    for k in range(start, end):
        if end - start < AROUND:
            rows.append((start, end, SHORT))
            continue
        points = np.arange(k - back, k + ahead + 1)
        shift = max(start - points[0], 0) - max(points[-1] - end, 0)
        first = points + shift - AROUND // 2
        moved = np.clip(first, start, end - AROUND)
        status = SHIFTED if shift or np.any(moved != first) else 0
        rows.append((int(moved[0]), int(moved[-1]) + AROUND, status))
    return rows


def windows(name: str, lengths: list[int]) -> list[tuple[int, int, int]]:
    """First sample, last sample + 1 and status of every row, for stretches of these lengths."""
    size, half = size_of(name), size_of(name) // 2
    rows: list[tuple[int, int, int]] = []
    start = 0
    for length in lengths:
        end = start + length
        if name.startswith("samples"):
            for k in range(start, end, size):
                stop = min(k + size, end)
                rows.append((k, stop, SHORT if stop - k < size else 0))
        elif name in POINTS:
            rows += around_points(name, start, end)
        elif name.startswith("centred"):
            for k in range(start, end):
                if length < size:
                    rows.append((start, end, SHORT))
                elif k - start < half:
                    rows.append((start, start + size, SHIFTED))
                elif end - 1 - k < half:
                    rows.append((end - size, end, SHIFTED))
                else:
                    rows.append((k - half, k + half + 1, 0))
        else:
            for k in range(start, end):
                rows.append((max(k - size, start), k + 1, SHORT if k - start < size else 0))
        start = end
    return rows


def changed_rows(one: BodyIncrements, other: BodyIncrements) -> NDArray[np.bool_]:
    """Rows of which any bit differs."""
    rows: NDArray[np.bool_] = np.any(
        [np.any(getattr(one, c) != getattr(other, c), axis=1) for c in ("phi", "dv", "dr")], axis=0
    )
    return rows


def with_changed(log: ImuSamples, sample: int) -> ImuSamples:
    """Another turn and force in one sample."""
    rows = np.arange(len(log)) == sample
    change = np.outer(rows, [1.7, -0.6, 0.4])
    return dataclasses.replace(log, gyro=log.gyro * (1 + change), accel=log.accel * (1 + change))


def dependence(log: ImuSamples, name: str) -> NDArray[np.bool_]:
    """Whether a row (first index) changes with a sample (second index)."""
    reference = rebuilt(log, name)
    return np.stack(
        [changed_rows(rebuilt(with_changed(log, k), name), reference) for k in range(len(log))],
        axis=1,
    )


def flagged(status: Status, lengths: list[int], which: tuple[int, ...]) -> NDArray[np.uint32]:
    """The status of samples that come in stretches, of which some are marked."""
    parts = [np.full(n, status if i in which else 0) for i, n in enumerate(lengths)]
    return np.concatenate(parts).astype(np.uint32)


def steps(*pieces: tuple[int, float]) -> Array:
    """Intervals, s: so many of so many times the usual one."""
    return np.concatenate([np.full(count, H * times) for count, times in pieces])


JITTER = 1.0 + 0.2 * np.random.default_rng(9).uniform(-1.0, 1.0, 40)
PARTS = [17, 5, 3, 4, 9, 1, 1]
BRIDGES = flagged(Status.BRIDGED, PARTS, (1, 3, 5))
STRETCHED = flagged(Status.STRETCHED, [18, 1, 18], (1,))
LOGS = {  # the samples, and the lengths of their stretches
    "equal intervals": (log_of(np.full(37, H)), [37]),
    "uneven intervals": (log_of(H * JITTER[:37]), [37]),
    "bridged gaps": (log_of(np.full(40, H), status=BRIDGES), PARTS),
    "uneven, bridged from the start": (log_of(H * JITTER, status=BRIDGES[::-1]), PARTS[::-1]),
    "a longer interval from here on": (log_of(steps((18, 1.0), (19, 10.5))), [18, 19]),
    "a shorter interval from here on": (log_of(steps((18, 1.0), (19, 1 / 10.5))), [18, 19]),
    "not so much longer": (log_of(steps((18, 1.0), (19, 9.5))), [37]),
    "not so much shorter": (log_of(steps((18, 1.0), (19, 1 / 9.5))), [37]),
    "one long interval": (log_of(steps((18, 1.0), (1, 10.5), (18, 1.0))), [18, 1, 18]),
    "one short interval": (log_of(steps((18, 1.0), (1, 1 / 10.5), (18, 1.0))), [18, 1, 18]),
    "a stretched sample": (
        log_of(steps((18, 1.0), (1, 3.0), (18, 1.0)), status=STRETCHED),
        [37],
    ),
    "fewer than most windows": (log_of(H * JITTER[:5]), [5]),
    "one sample": (log_of([H]), [1]),
}


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
@pytest.mark.parametrize("case", LOGS)
def test_a_row_depends_on_its_window_and_says_so(case: str, name: str) -> None:
    log, lengths = LOGS[case]
    rows = windows(name, lengths)
    sample = np.arange(len(log))
    expected = [(first <= sample) & (sample < stop) for first, stop, _ in rows]
    found = dependence(log, name)
    assert found.tolist() == np.array(expected).tolist()
    own = rebuilt(log, name)
    bits = Status.SHORT_WINDOW | Status.SHIFTED_WINDOW
    assert (own.status & bits).tolist() == [status for *_, status in rows]


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_what_happened_to_the_samples_is_kept(name: str) -> None:
    """A row is bridged or stretched when its sample is; a group when one of its samples is."""
    for case in ("bridged gaps", "a stretched sample"):
        log, lengths = LOGS[case]
        happened = log.status & (Status.BRIDGED | Status.STRETCHED)
        if name.startswith("samples"):
            groups = [(first, stop) for first, stop, _ in windows(name, lengths)]
            wanted = [int(happened[first:stop].max()) for first, stop in groups]
        else:
            wanted = happened.tolist()
        found = rebuilt(log, name).status & (Status.BRIDGED | Status.STRETCHED)
        assert found.tolist() == wanted


@pytest.mark.parametrize("reaches", [True, False])
@pytest.mark.parametrize("name", NEIGHBOURLY)
def test_only_intervals_within_one_window_are_compared(name: str, reaches: bool) -> None:
    """From 1 to 16 by way of 4: a cut where a window would hold the first and the last."""
    span = AROUND if name in POINTS else size_of(name) + name.startswith("causal")
    between = span - 2 if reaches else span - 1
    log = log_of(steps((20, 0.5), (between, 2.0), (20, 8.0)))
    lengths = [20 + between, 20] if reaches else [40 + between]
    rows = windows(name, lengths)
    found = rebuilt(log, name)
    bits = Status.SHORT_WINDOW | Status.SHIFTED_WINDOW
    assert (found.status & bits).tolist() == [status for *_, status in rows]
    for sample in (19 + between, 20 + between):
        expected = [first <= sample < stop for first, stop, _ in rows]
        changed = changed_rows(rebuilt(with_changed(log, sample), name), found)
        assert changed.tolist() == expected


@pytest.mark.parametrize("name", [name for name in CENTRED if size_of(name) > 5])
def test_a_stretch_shorter_than_the_window_takes_all_there_is(name: str) -> None:
    """Five samples between two gaps are a window of five."""
    lengths = [20, 6, 5, 7, 20]
    log = log_of(np.full(58, H), status=flagged(Status.BRIDGED, lengths, (1, 3)))
    found, alone = rebuilt(log, name), rebuilt(log[26:31], "centred-5")
    assert np.all(found.status[26:31] == Status.SHORT_WINDOW)
    assert alone.status.tolist() == [SHIFTED, SHIFTED, 0, SHIFTED, SHIFTED]
    for column in ("phi", "dv", "dr"):
        # rounding of weights from the table against those solved for: 1e-15 of 0.1 m/s, 1e-15 rad
        np.testing.assert_allclose(
            getattr(found, column)[26:31], getattr(alone, column), rtol=0, atol=1e-15
        )


@pytest.mark.parametrize("name", CENTRED)
def test_windows_of_a_short_log_are_all_the_same(name: str) -> None:
    """With no more samples than the smaller window, the larger one has nothing to add."""
    log = log_of(H * JITTER[: size_of(name) - 1])
    wider = [other for other in CENTRED if size_of(other) > size_of(name)]
    assert all(same_bits(rebuilt(log, other), rebuilt(log, name)) for other in wider)


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_rows_of_a_stretch_are_those_of_a_log_of_its_own(name: str) -> None:
    """Bit for bit: a gap is as good as two logs."""
    log, lengths = LOGS["uneven, bridged from the start"]
    ends = np.cumsum(lengths)
    parts = [log[a:b] for a, b in zip([0, *ends], ends, strict=False)]
    alone = [rebuilt(part, name) for part in parts]
    whole = rebuilt(log, name)
    for column in ("t", "dt", "phi", "dv", "dr", "status"):
        joined = np.concatenate([getattr(part, column) for part in alone])
        assert joined.tobytes() == getattr(whole, column).tobytes()


def test_the_solution_tells_where_windows_moved_aside() -> None:
    """At both ends of the log and on either side of a bridged gap, four rows under centred-9."""
    log = dataclasses.replace(log_of(np.full(300, H)), t=H * np.arange(1.0, 301.0))
    keep = np.r_[:100, 130:300]
    holed = dataclasses.replace(
        log, **{name: getattr(log, name)[keep] for name in ("t", "dt", "gyro", "accel", "status")}
    )
    start = NavState(lat=0.7, lon=0.1, h=10.0, q_nb=(0.5, -0.5, 0.5, 0.5))
    nav = navgrade.navigate(holed, start, bridge_gaps=True, reconstruction="centred-9")
    moved = np.zeros(300, bool)
    for end in (0, 100, 130, 300):
        moved[max(end - 4, 0) : end + 4] = True
    bridged = np.zeros(300, bool)
    bridged[100:130] = True
    assert nav.status.tolist() == (SHIFTED * moved + Status.BRIDGED * bridged).tolist()
