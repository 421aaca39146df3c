"""The stillness statistic and the detector against motions and noise that are known."""

from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

import navgrade
from align.spans import SpanReducer, Spans, spans_of
from align.stillness import (
    FORCE_LIMIT,
    RATE_LIMIT,
    Stillness,
    StillReport,
    _medians,
    assess,
    find_still,
    span_means,
)
from tests.align.at_rest import DEG, UG, Array
from tests.align.slams import GRADES, REST, Disturbed, noise, slams, sways, walkers

EACH_GRADE = pytest.mark.parametrize("grade", list(GRADES))


def uneven(rng: np.random.Generator, count: int) -> Array:
    return rng.uniform(0.004, 0.02, count)  # s


def test_means_are_weighted_by_the_intervals() -> None:
    """A span's mean is its integral over its length, however the samples are spaced."""
    dt = np.array([0.3, 0.7, 0.2, 0.2, 0.6, 0.5, 0.5])  # s: three spans of 1 s
    values = np.array([1.0, 2.0, -1.0, 0.0, 5.0, 7.0, 9.0])[:, None] * [1.0, 10.0, -3.0]
    means = span_means(dt, values, 1.0)
    expected = np.array([1.7, 2.8, 8.0])[:, None] * [1.0, 10.0, -3.0]
    # Four roundings of values up to 90.
    np.testing.assert_allclose(means, expected, rtol=0.0, atol=5e-14)


@pytest.mark.parametrize(
    ("total", "span", "count"), [(10.0, 1.0, 10), (9.97, 1.0, 9), (0.5, 1.0, 1), (9.5, 2.0, 4)]
)
def test_the_rest_joins_the_last_span(total: float, span: float, count: int) -> None:
    steps = round(total / 0.01)
    means = span_means(np.full(steps, 0.01), np.ones((steps, 3)), span)
    # A mean of ones, a thousand roundings.
    np.testing.assert_allclose(means, np.ones((count, 3)), rtol=0.0, atol=1e-13)


def test_a_span_without_a_sample_is_left_out() -> None:
    means = span_means(np.array([0.5, 2.9, 0.6]), np.diag([1.0, 2.0, 3.0]), 1.0)
    assert len(means) < 4
    assert np.all(np.isfinite(means))
    assert set(means.ravel()) <= {0.0, 1.0, 2.0, 3.0}


def test_scatter_of_a_square_wave_between_seconds() -> None:
    """Plus and minus a in turn: the scatter of one axis is a, of all the root sum square."""
    dt = np.full(2000, 0.01)  # s
    sign = np.where((np.arange(2000) // 100) % 2, 1.0, -1.0)[:, None]
    found = assess(dt, sign * [1e-4, -2e-4, 2e-4] + 0.3, sign * [0.02, 0.03, 0.06] - 9.8)
    # A thousand roundings of 9.8 m/s^2 in a span, most of which cancel.
    assert found.force == pytest.approx(0.07, rel=0.0, abs=1e-12)
    assert found.rate == pytest.approx(3e-4, rel=0.0, abs=1e-13)


@pytest.mark.parametrize("frequency", [1.0, 7.0, 23.0])  # Hz
def test_vibration_faster_than_the_span_averages_out(frequency: float) -> None:
    """An idling engine, whole periods in a second, 1 m/s^2 and 1 deg/s."""
    t = 0.005 * np.arange(1, 12_001)
    shake = np.sin(2.0 * np.pi * frequency * t)[:, None] * np.ones(3)
    found = assess(np.full(t.size, 0.005), DEG * shake, shake)
    assert found.force < 1e-3 * FORCE_LIMIT
    assert found.rate < 1e-3 * RATE_LIMIT


def test_white_noise_scatters_as_the_root_of_the_span() -> None:
    rng = np.random.default_rng(70)
    dt = uneven(rng, 80_000)
    noise = rng.normal(size=(dt.size, 3)) / np.sqrt(dt[:, None])
    found = assess(dt, 1e-6 * noise, 1e-4 * noise)
    # Three axes of 1e-4 (m/s)/sqrt(s) in one second; 960 spans x 3 axes are known to 1.3 %, x3.
    assert found.force == pytest.approx(np.sqrt(3.0) * 1e-4, rel=0.04)
    assert found.rate == pytest.approx(np.sqrt(3.0) * 1e-6, rel=0.04)


@pytest.mark.parametrize(
    ("force", "rate", "verdict"),
    [
        (0.999 * FORCE_LIMIT, 0.999 * RATE_LIMIT, True),
        (1.001 * FORCE_LIMIT, 0.0, False),
        (0.0, 1.001 * RATE_LIMIT, False),
        (float("nan"), 0.0, False),
    ],
)
def test_both_limits_count(force: float, rate: float, verdict: bool) -> None:
    assert Stillness(force=force, rate=rate).is_still is verdict


def test_limits_lie_between_a_parked_car_and_a_gentle_drive() -> None:
    """What the comments say of a real car, m/s^2 and deg/s."""
    assert 0.009 < FORCE_LIMIT < 0.13
    assert 0.016 < RATE_LIMIT / DEG < 0.3


def white(rng: np.random.Generator, rows: int, count: int, length: float, grade: str) -> Spans:
    """Spans of `count` samples of white noise, drawn from the distributions of their statistics."""
    sigma = np.repeat(GRADES[grade], 3) * np.sqrt(count / length)
    mean = REST + sigma / np.sqrt(count) * rng.normal(size=(rows, 6))
    variance = sigma**2 * rng.chisquare(count - 1, (rows, 6)) / (count - 1)
    end = length * np.arange(1.0, rows + 1.0)
    dt, counts = np.full(rows, length), np.full(rows, count)
    parts = mean[:, :3], mean[:, 3:], variance[:, :3], variance[:, 3:]
    return Spans(length, end, dt, counts, *parts)


def within_binomial(alarms: float, rows: int, rate: float) -> bool:
    """Whether a count is as likely as 3.5 sigma; the levels' own noise may take a fifth."""
    return abs(alarms - rate * rows) < 3.5 * np.sqrt(rate * rows) + 0.2 * rate * rows


@pytest.mark.parametrize(
    ("rows", "count", "length"), [(1200, 25, 0.25), (1200, 250, 0.25), (600, 10, 1.0)]
)
@pytest.mark.parametrize("rate", [1e-2, 1e-3])
def test_the_false_alarm_rate_is_honored_in_white_noise(
    rows: int, count: int, length: float, rate: float
) -> None:
    rng = np.random.default_rng(71)
    logs = 30
    alarms = 0
    for _ in range(logs):
        report = find_still(white(rng, rows, count, length, "navigation"), false_alarm=rate)
        alarms += int(report.alarms.sum())
        assert len(report.stretches) == 1
    assert within_binomial(alarms, logs * rows, rate)


def colored(rng: np.random.Generator, kind: str) -> tuple[Array, Array, Array]:
    """Ten minutes of noise that is not white."""
    random, _ = noise(rng, 100.0, 600.0, "navigation")
    dt = np.full(len(random), 0.01)  # s
    if kind == "smoothed":  # over 0.15 s
        random = gaussian_filter1d(random, 5.0, axis=0)
    elif kind == "10 Hz":  # smoothed over 0.3 s and thinned, as the Kingston drive
        random, dt = gaussian_filter1d(random, 10.0, axis=0)[::10], dt[::10] * 10.0
    elif kind == "pulses":  # 1.1 arcsec and 60 µm/s, far above the noise of a sample
        quantum = np.repeat([5.4e-6, 6e-5], 3)
        count = np.rint(np.cumsum((random + REST) * dt[:, None], axis=0) / quantum)
        random = np.diff(count, axis=0, prepend=0.0) * quantum / dt[:, None] - REST
    values = random + REST
    return dt, values[:, :3], values[:, 3:]


@pytest.mark.parametrize("kind", ["smoothed", "10 Hz", "pulses"])
def test_noise_that_is_not_white_widens_the_test(kind: str) -> None:
    """A few times the stated rate, where the degrees of freedom as counted would give a tenth."""
    rng = np.random.default_rng(72)
    reports = [find_still(spans_of(*colored(rng, kind))) for _ in range(4)]
    assert np.mean(np.concatenate([report.alarms for report in reports])) < 0.006
    for report in reports:
        assert len(report.stretches) == 1
        assert report.stretches[0].duration > 0.96 * 600.0  # s
        assert report.stretches[0].motion == "still"


def found(case: Disturbed) -> tuple[StillReport, float, float]:
    report = find_still(spans_of(*case.samples))
    pieces = [piece for stretch in report.stretches for piece in stretch.pieces]
    return report, *case.shares(*np.array(pieces).T)


@EACH_GRADE
@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("size", [2.0, 5.0, 20.0])
@pytest.mark.parametrize("kind", [slams, walkers])
def test_disturbances_are_cut_out_and_little_else(
    kind: object, size: float, rate: float, grade: str
) -> None:
    """Of some minutes at least 90 % of the still time is kept, and 1 % of the disturbed at most."""
    assert callable(kind)
    seconds = 300.0 if rate < 500.0 else 130.0
    report, kept, admitted = found(kind(np.random.default_rng(73), rate, seconds, grade, size))
    assert kept >= 0.90
    assert admitted <= 0.01
    (stretch,) = report.stretches
    assert stretch.motion == "still"
    assert stretch.duration + stretch.cut == pytest.approx(stretch.stop - stretch.start, abs=1e-9)
    # 25,000 samples and more, of which a quarter tell: 1 %, x4
    np.testing.assert_allclose(stretch.arw, GRADES[grade][0], rtol=0.04)
    np.testing.assert_allclose(stretch.vrw, GRADES[grade][1], rtol=0.04)
    # 90 pairs of seconds: 9 % and 3 of them
    np.testing.assert_allclose(stretch.arw_1s, GRADES[grade][0], rtol=0.27)


def tilted(grade: str, profile: Array, axis: int = 0) -> Spans:
    """A body at 100 Hz that turns about one of its axes by `profile`, rad."""
    random, _ = noise(np.random.default_rng(74), 100.0, len(profile) / 100.0, grade)
    about = np.eye(3)[axis]
    values = random + REST
    values[:, :3] += 100.0 * np.gradient(profile)[:, None] * about
    values[:, 3:] -= profile[:, None] * np.cross(about, REST[3:])
    return spans_of(np.full(len(profile), 0.01), values[:, :3], values[:, 3:])


def ramp(at: float, seconds: float = 200.0) -> Array:
    """From 0 to 1 within two seconds."""
    return np.clip((np.arange(0.0, seconds, 0.01) - at) / 2.0, 0.0, 1.0)


@EACH_GRADE
@pytest.mark.parametrize(("axis", "turn"), [(0, 1e-3), (0, 5e-3), (2, 5e-3)])
def test_a_lasting_turn_ends_a_stretch(grade: str, axis: int, turn: float) -> None:
    """Somebody takes a seat; about the vertical no accelerometer feels it."""
    before, after = find_still(tilted(grade, turn * ramp(100.0), axis)).stretches
    assert 96.0 < before.stop <= 100.5
    assert 101.5 <= after.start < 106.0
    assert (before.start, after.stop) == pytest.approx((0.0, 200.0), abs=1e-6)


@EACH_GRADE
def test_a_shift_taken_back_is_cut_out(grade: str) -> None:
    """Somebody leans on the car for 20 s, which sways it once."""
    report = find_still(tilted(grade, 1e-3 * (ramp(100.0) - ramp(120.0))))
    (stretch,) = report.stretches
    assert stretch.motion == "still"
    assert 168.0 <= stretch.duration <= 178.5  # s
    assert not any(start < 121.5 and stop > 100.5 for start, stop in stretch.pieces)


@EACH_GRADE
def test_one_shift_there_and_back_is_no_sway(grade: str) -> None:
    report = find_still(tilted(grade, 5e-3 * (ramp(100.0) - ramp(120.0))))
    assert {stretch.motion for stretch in report.stretches} == {"still"}


def test_a_tilt_below_the_accelerometers_is_no_step() -> None:
    (stretch,) = find_still(tilted("navigation", 3e-5 * ramp(100.0))).stretches
    assert stretch.duration > 190.0  # s


def drive(rng: np.random.Generator, count: int, share: float) -> Array:
    """Acceleration and turning (count, 6) of a car at 100 Hz, rad/s and m/s^2."""
    force = gaussian_filter1d(rng.normal(size=(count, 3)), 200.0, axis=0)
    rate = gaussian_filter1d(rng.normal(size=(count, 3)), 300.0, axis=0)
    force *= 0.5 / force.std() * np.array([1.0, 1.0, 0.3])
    rate *= 3.0 * DEG / rate.std() * np.array([0.1, 0.1, 1.0])
    return share * np.hstack([rate, force])


@EACH_GRADE
@pytest.mark.parametrize("share", [1.0, 0.1])
def test_a_drive_in_between_is_neither_still_nor_sway(grade: str, share: float) -> None:
    rng = np.random.default_rng(75)
    random, _ = noise(rng, 100.0, 600.0, grade)
    values = random + REST
    values[20_000:50_000] += drive(rng, 30_000, share)
    report = find_still(spans_of(np.full(60_000, 0.01), values[:, :3], values[:, 3:]))
    assert {stretch.motion for stretch in report.stretches} == {"still"}
    before, after = report.stretches
    assert (before.start, after.stop) == pytest.approx((0.0, 600.0), abs=1e-6)
    assert 197.0 < before.stop <= 200.5
    assert 499.5 <= after.start < 503.0
    assert report.longest is before


@EACH_GRADE
@pytest.mark.parametrize("amplitude_deg", [0.1, 2.0])
@pytest.mark.parametrize(("seconds", "arm"), [(20.0, 0.0), (60.0, 0.0), (300.0, 5.0)])
def test_sway_is_whole_and_called_by_its_name(
    grade: str, amplitude_deg: float, seconds: float, arm: float
) -> None:
    """Also with the IMU 5 m above the axis; its white noise is told from the sway."""
    rng = np.random.default_rng(76)
    report = find_still(spans_of(*sways(rng, 100.0, seconds, grade, amplitude_deg, arm=arm)))
    (stretch,) = report.stretches
    assert stretch.motion == "swaying"
    assert stretch.pieces == ((stretch.start, stretch.stop),)
    assert stretch.duration == pytest.approx(seconds, abs=1e-6)
    assert (stretch.rate_scatter > RATE_LIMIT) is (amplitude_deg == 2.0) or amplitude_deg < 1.0
    # 5 % in 20 s, x3; what is left of 2 deg within a span is 3e-5 rad/s, some of the gyro noise
    assert np.all(stretch.arw < 1.15 * GRADES[grade][0] + 1.5e-6 * amplitude_deg / 2.0)
    assert np.all(stretch.vrw < 1.3 * GRADES[grade][1])


@pytest.mark.parametrize(("shares", "above"), [((0.5, 0.2, 0.0), False), ((1.0, 1.0, 0.3), True)])
def test_sway_on_both_sides_of_the_limits(shares: tuple[float, float, float], above: bool) -> None:
    rng = np.random.default_rng(77)
    samples = sways(rng, 100.0, 120.0, "navigation", 0.1, shares=shares)
    (stretch,) = find_still(spans_of(*samples)).stretches
    assert stretch.motion == "swaying"
    assert (stretch.rate_scatter > RATE_LIMIT) is above


def test_sway_that_noise_hides_is_still() -> None:
    rng = np.random.default_rng(78)
    (stretch,) = find_still(spans_of(*sways(rng, 100.0, 300.0, "tactical", 0.003))).stretches
    assert stretch.motion == "still"


def test_sway_ends_where_the_drive_begins() -> None:
    rng = np.random.default_rng(79)
    dt, omega, f = sways(rng, 100.0, 600.0, "navigation", 0.5)
    moved = drive(rng, 20_000, 1.0)
    omega[40_000:] += moved[:, :3]
    f[40_000:] += moved[:, 3:]
    first = find_still(spans_of(dt, omega, f)).stretches[0]
    assert first.motion == "swaying"
    assert first.start == pytest.approx(0.0, abs=1e-6)
    assert 360.0 < first.stop < 402.0


def test_a_rolling_road_is_no_sway() -> None:
    """A car at 25 m/s follows the hills; its tilt looks like sway, its vertical force does not."""
    rng = np.random.default_rng(82)
    dt, omega, f = sways(rng, 100.0, 120.0, "navigation", 1.0, shares=(0.1, 1.0, 0.1))
    f[:, 2] -= 25.0 * omega[:, 1]
    assert find_still(spans_of(dt, omega, f)).stretches == ()


@EACH_GRADE
def test_an_engine_that_starts_is_still(grade: str) -> None:
    """Its vibration belongs to the noise, and changes the level in the middle of a stretch."""
    random, _ = noise(np.random.default_rng(80), 100.0, 600.0, grade)
    t = 0.01 * np.arange(60_000)
    shake = np.where(t > 250.0, np.sin(2.0 * np.pi * 27.3 * t), 0.0)
    values = random + REST + shake[:, None] * np.repeat([0.01, 0.3], 3)
    (stretch,) = find_still(spans_of(np.full(60_000, 0.01), values[:, :3], values[:, 3:])).stretches
    assert stretch.motion == "still"
    assert stretch.duration > 570.0  # s


def test_a_hole_of_the_log() -> None:
    random, _ = noise(np.random.default_rng(81), 100.0, 300.0, "tactical")
    t = 0.01 * np.arange(1, 30_001)
    held = (t <= 100.0) | (t > 105.0)
    values = (random + REST)[held]
    spans = spans_of(np.full(len(values), 0.01), values[:, :3], values[:, 3:], t=t[held])
    (stretch,) = find_still(spans).stretches
    assert stretch.cut == pytest.approx(300.0 - stretch.duration, abs=0.3)
    assert stretch.duration > 290.0  # of 295 s
    assert not any(start < 102.5 < stop for start, stop in stretch.pieces)
    assert stretch.rows.sum() <= len(spans) == len(stretch.rows)


@pytest.mark.parametrize("count", [0, 1, 7, 300, 900])
def test_too_short_for_anything(count: int) -> None:
    reducer = SpanReducer(0.25)
    rows = np.full((count, 6), REST)
    reducer.add(0.01 * np.arange(1, count + 1), np.full(count, 0.01), rows[:, :3], rows[:, 3:])
    report = find_still(reducer.finish())
    assert report.stretches == ()
    assert report.longest is None


def test_numbers_without_any_noise() -> None:
    (stretch,) = find_still(
        spans_of(np.full(30_000, 0.01), *np.split(np.full((30_000, 6), REST), 2, 1))
    ).stretches
    assert stretch.pieces == ((0.0, pytest.approx(300.0, abs=1e-6)),)
    assert np.all(stretch.arw < 1e-12)


@pytest.mark.parametrize("rate", [0.0, 0.5, -1e-3, float("nan")])
def test_a_rate_of_false_alarms_that_is_none(rate: float) -> None:
    with pytest.raises(ValueError, match="false_alarm must be between 0 and"):
        find_still(
            spans_of(np.full(99, 0.01), np.zeros((99, 3)), np.ones((99, 3))), false_alarm=rate
        )


def recording(folder: Path, name: str, axes: str, topic: str | None = None) -> Spans:
    samples = navgrade.read_imu(folder / name, topic, kind="average", axes=axes)
    return spans_of(samples.dt, *samples.mean_rates(), t=samples.t)


@pytest.mark.parametrize("name", ["calgary_ln100_x_up.mcap", "calgary_ln100_x_down.mcap"])
def test_ln100_stands_still_throughout(shared_data: Path, name: str) -> None:
    report = find_still(recording(shared_data, name, "FRD"))
    (stretch,) = report.stretches
    assert stretch.motion == "still"
    assert stretch.duration > 290.0  # of 300 s
    assert report.alarms.mean() < 0.005
    # Pulses: what a sample shows is ten times what is left after a second
    assert np.all(stretch.arw > 5.0 * stretch.arw_1s)
    assert np.all(stretch.vrw_1s < 100.0 * UG)


def test_kingston_is_parked_and_then_drives(shared_data: Path) -> None:
    spans = recording(shared_data, "kingston_hg1700_drive.mcap", "RFU")
    parked, *stops = find_still(spans).stretches
    assert parked.motion == "still"
    assert parked.start < 1.0
    # s: it moves off between 527 and 528, and who gets ready for it rocks the car from 522 on
    assert 515.0 < parked.stop < 527.0
    # Half of the time somebody moves inside; what is kept is a sixth as restless as the whole
    assert 250.0 < parked.duration < 400.0
    assert parked.force_scatter < 0.002  # m/s^2
    assert parked.rate_scatter < 0.004 * DEG  # rad/s
    reference = np.genfromtxt(
        shared_data / "kingston_hg1700_reference.csv", delimiter=",", names=True
    )
    velocity = [reference[f"v_{axis}_m_s"] for axis in ("north", "east", "down")]
    speed = np.linalg.norm(velocity, axis=0)
    clock = reference["unix_s"] - reference["unix_s"][0]
    assert stops
    for stop in stops:
        assert stop.motion == "still"
        # m/s: the reference drifts by some cm/s
        assert np.all(speed[(clock > stop.start + 0.5) & (clock < stop.stop - 0.5)] < 0.1)


def test_a_log_of_half_a_second(shared_data: Path) -> None:
    spans = recording(shared_data, "novatel_oem7_parked.mcap", "FRD", "/gps/imu")
    assert find_still(spans).stretches == ()


@pytest.mark.parametrize("rows", [1, 3, 29, 60, 61, 200])
@pytest.mark.parametrize("mode", ["edge", "symmetric"])
def test_medians_of_fewer_rows_than_asked_for(
    rows: int, mode: Literal["edge", "symmetric"]
) -> None:
    """Row by row, the ends repeated or mirrored as often as it takes; the same each time."""
    values = np.random.default_rng(31).normal(size=(rows, 3))
    at = np.arange(rows)[:, None] + np.arange(-60, 61)
    if mode == "edge":
        at = np.clip(at, 0, rows - 1)
    else:
        at = np.mod(at, 2 * rows)
        at = np.where(at < rows, at, 2 * rows - 1 - at)
    naive = np.median(values[at], axis=1)
    for _ in range(5):
        np.testing.assert_array_equal(_medians(values, 121, mode), naive)


def test_the_same_spans_give_the_same_stretches() -> None:
    """Stops of half a minute: fewer rows than the minutes that tell the noise level."""
    rng = np.random.default_rng(32)
    values, _ = noise(rng, 100.0, 200.0, "tactical")
    t = np.arange(len(values)) / 100.0
    drives = np.sin(0.7 * t) * (np.mod(t, 50.0) > 30.0)
    spans = spans_of(
        np.full(len(t), 0.01), values[:, :3], values[:, 3:] + REST[3:] + drives[:, None]
    )
    first = find_still(spans).stretches
    assert len(first) >= 3
    for _ in range(5):
        again = find_still(spans).stretches
        assert [s.pieces for s in again] == [s.pieces for s in first]
