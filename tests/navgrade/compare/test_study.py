"""What a comparison finds on simulated motions, where the answers are known."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from navgrade import write_increments
from navgrade.compare.result import Comparison, Variant
from navgrade.compare.study import EPOCHS, compare
from navgrade.errors import ConfigError, GapError, LogError
from navgrade.imu import concatenate
from navgrade.job import Choices, open_log
from navgrade.logs import Track
from navgrade.site import Site, read_site
from tests.navgrade.engine import samples
from tests.oracles.cases import AnyMotion
from tests.oracles.truth import Motion, road_drive, static, turning_vehicle, vibrating_vehicle

EPOCH_NS = 1_767_225_600_000_000_000
SITE = """
[imu]
kind = "increment"
axes = "FRD"
{errors}
[initial]
time_ns = {time_ns}
latitude = {lat!r}
longitude = {lon!r}
height_m = {h!r}
velocity_ned_m_s = [{v[0]!r}, {v[1]!r}, {v[2]!r}]
roll_deg = {roll!r}
pitch_deg = {pitch!r}
heading_deg = {heading!r}
"""
START = 0.5  # s: the samples before it are context
ERRORS = """[imu.errors]
gyro_bias_deg_h = 0.1
accel_bias_ug = 1000.0"""


def make(
    folder: Path, motion: AnyMotion, duration: float, *, dt: float = 0.01, errors: str = ""
) -> tuple[Path, Path]:
    """A log of exact increments, and a site file with the true state at `START`."""
    imu = samples(motion.increments(np.arange(round(duration / dt) + 1) * dt))
    object.__setattr__(imu, "epoch_ns", EPOCH_NS)
    log, site = folder / "log.mcap", folder / "site.toml"
    write_increments(log, imu)
    s = motion.state(START)
    site.write_text(
        SITE.format(
            errors=errors,
            time_ns=EPOCH_NS + round(START * 1e9),
            lat=float(np.degrees(s.lat[0])),
            lon=float(np.degrees(s.lon[0])),
            h=float(s.h[0]),
            v=[float(x) for x in s.v_eb_n[0]],
            roll=float(np.degrees(s.roll[0])),
            pitch=float(np.degrees(s.pitch[0])),
            heading=float(np.degrees(s.heading[0])),
        )
    )
    return log, site


def found(log: Path, site: Path | Site, truth: Track | None = None, **choices: str) -> Comparison:
    """The comparison, by the files."""
    known = site if isinstance(site, Site) else read_site(site)
    chosen = Choices(**choices)
    return compare(open_log(log, known, chosen), known, chosen, truth=truth)


def by_name(comparison: Comparison) -> dict[str, Variant]:
    return {variant.name: variant for variant in comparison.variants}


def truth_of(motion: AnyMotion, t: np.ndarray, *, whole: bool = True) -> Track:
    s = motion.state(t)
    return Track(
        "/truth",
        s.lat,
        s.lon,
        s.h,
        EPOCH_NS + np.rint(t * 1e9).astype(np.int64),
        True,
        s.v_eb_n if whole else None,
        s.q_nb if whole else None,
    )


def test_at_rest_the_flat_world_follows_the_closed_form(tmp_path: Path) -> None:
    """g Omega cos L t³/6 at 45° N: printed 18.2 m after 60 s and 2275 m after 300 s."""
    at_rest = static(
        lat_deg=45.0, lon_deg=10.0, h=0.0, roll_deg=1.0, pitch_deg=2.0, heading_deg=70.0
    )
    comparison = found(*make(tmp_path, at_rest, 300.5, dt=0.02))
    variants = by_name(comparison)
    assert comparison.epochs == pytest.approx([1.0, 10.0, 60.0, 300.0], abs=1e-6)
    for name in ("flat-euler", "flat-midpoint", "flat-rk4"):
        flat = variants[name]
        row = comparison.epoch_rows
        assert flat.horizontal[row[2]] == pytest.approx(18.2, rel=0.01)
        assert flat.horizontal[row[3]] == pytest.approx(2275.0, rel=0.01)
        assert flat.growth.predicted[2:] == pytest.approx(flat.horizontal[row[2:]], rel=0.01)
        assert flat.growth.power == pytest.approx(3.0, abs=0.01)
        assert flat.position_error[row[2], 1] > 18.0  # m: to the east
    assert variants["without-earth-rate"].growth.power == pytest.approx(3.0, abs=0.02)
    for name in ("without-coriolis", "without-transport-rate", "without-ellipsoid"):
        assert variants[name].horizontal.max() < 1e-6  # m: nothing moves


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> tuple[Motion, Comparison]:
    """Two minutes of turns at 100 Hz."""
    motion = turning_vehicle()
    return motion, found(*make(tmp_path_factory.mktemp("drive"), motion, 121.0, errors=ERRORS))


def test_each_term_costs_what_its_form_predicts(drive: tuple[Motion, Comparison]) -> None:
    """Superposed along the motion: within 6 %, which the daily and Foucault terms leave open."""
    _, comparison = drive
    rows = comparison.epoch_rows[2:]
    for variant in comparison.variants[1:]:
        growth = variant.growth
        error = variant.horizontal if growth.axis == "horizontal" else variant.position_error[:, 2]
        if variant.name in ("flat-euler", "without-coning", "without-sculling"):
            continue  # Euler's own error; too small here, another test has their motions
        assert np.abs(error[rows]) == pytest.approx(growth.predicted[2:], rel=0.06), variant.name


def test_the_engine_comes_first_and_is_the_reference(drive: tuple[Motion, Comparison]) -> None:
    _, comparison = drive
    engine = comparison.variants[0]
    assert (engine.name, engine.group) == ("engine", "engine")
    assert not engine.position_error.any()
    assert np.abs(engine.attitude_error).max() < 1e-15  # rad: a quaternion times its conjugate
    assert comparison.reference == "the full engine"
    assert [v.group for v in comparison.variants] == ["engine", *["flat"] * 3, *["term"] * 10]
    assert np.all(np.diff(comparison.t) > 0.0)
    assert set(comparison.epochs) <= set(comparison.t)
    assert comparison.start_ns == EPOCH_NS + 500_000_000


def test_the_imu_is_set_against_the_flat_world(drive: tuple[Motion, Comparison]) -> None:
    """Both axes of 0.1 deg/h and 1 mg, summed by hand for a level navigator."""
    _, comparison = drive
    t = comparison.epochs
    g = 9.8  # m/s²: within 1 % anywhere
    eps, b = np.radians(0.1) / 3600.0, 1e-3 * 9.80665
    one_axis = np.hypot(g * eps * t**3 / 6.0, 0.5 * b * t**2)
    assert comparison.imu_error == pytest.approx(np.sqrt(2.0) * one_axis, rel=0.01)
    said = comparison.verdict[0]
    assert said.startswith("With this IMU the flat world is the larger error after ")
    flat = by_name(comparison)["flat-rk4"]
    error = np.interp(comparison.t, t, comparison.imu_error)
    after = float(said.split("after ")[1].split(" s")[0])
    assert np.all(flat.horizontal[comparison.t > 1.2 * after] > error[comparison.t > 1.2 * after])


def test_against_a_truth(tmp_path: Path) -> None:
    """At 100 Hz, where stamps coincide, and once a second between samples, without velocities."""
    motion = road_drive()
    log, site = make(tmp_path, motion, 61.0)
    dense = found(log, site, truth_of(motion, np.arange(1, 6100) * 0.01))
    engine = dense.variants[0]
    assert engine.horizontal.max() < 1e-4  # m
    assert np.abs(engine.attitude_error).max() < 1e-9  # rad
    assert dense.reference == "truth /truth"
    sparse = found(log, site, truth_of(motion, np.arange(1, 61) - 0.004, whole=False))
    assert len(sparse.t) <= 60
    # m: the cubic between samples leaves a jerk of 3 m/s³ · dt³/60
    assert sparse.variants[0].horizontal.max() < 1e-4
    assert np.isnan(sparse.variants[0].velocity_error).all()
    for name, variant in by_name(sparse).items():
        both = by_name(dense)[name].horizontal[-1], variant.horizontal[-1]
        assert both[1] == pytest.approx(both[0], rel=0.1, abs=1e-4), name


def test_the_truth_also_says_where_to_start(tmp_path: Path) -> None:
    motion = turning_vehicle()
    log, site = make(tmp_path, motion, 12.0)
    plain = Site("site.toml", b"", kind="increment", axes="FRD")
    truth = truth_of(motion, np.arange(21, 1200) * 0.01)
    comparison = found(log, plain, truth)
    # the log's own time 0 is its first sample, 0.01 s after the motion's
    assert comparison.start_ns == EPOCH_NS + 210_000_000
    assert comparison.variants[0].horizontal.max() < 1e-5  # m
    with pytest.raises(ConfigError, match="has no velocity, so the site file needs"):
        found(log, plain, truth_of(motion, np.arange(21, 1200) * 0.01, whole=False))
    del site


def test_vibration_makes_coning_and_sculling_count(tmp_path: Path) -> None:
    """The forms' prediction from the corrections themselves, on the vibrating vehicle."""
    log, site = make(tmp_path, vibrating_vehicle(), 61.0)
    comparison = found(log, site)
    variants, row = by_name(comparison), comparison.epoch_rows[-1]
    for name in ("without-coning", "without-sculling", "without-rotation"):
        variant = variants[name]
        assert variant.horizontal[row] > 1e-3  # m
        assert variant.growth.predicted[-1] == pytest.approx(variant.horizontal[row], rel=0.05), (
            name
        )


def test_refusals(tmp_path: Path) -> None:
    motion = turning_vehicle()
    log, site = make(tmp_path, motion, 5.0)
    with pytest.raises(ConfigError, match="one row for each sample, and samples-2 has one for"):
        found(log, site, reconstruction="samples-2")
    with pytest.raises(LogError, match=r"/truth has nothing between the start .* runs from 99\.9"):
        found(log, site, truth_of(motion, np.arange(100.0, 110.0)))
    known = read_site(site)
    source = open_log(log, known, Choices())
    for duration in (0.0, -1.0, np.nan):
        with pytest.raises(ConfigError, match="duration must be positive"):
            compare(source, known, duration=duration)
    late = site.read_text().replace(str(EPOCH_NS + 500_000_000), str(EPOCH_NS + 9_000_000_000))
    site.write_text(late)
    with pytest.raises(LogError, match=r"ends before 8\.990 s, where navigation would start"):
        found(log, site)


def test_a_gap_is_bridged_in_every_solution(tmp_path: Path) -> None:
    imu = samples(turning_vehicle().increments(np.arange(801) * 0.01))
    log, site = make(tmp_path, turning_vehicle(), 8.0)
    kept = concatenate([imu[:300], imu[370:]])  # longer than what precedes the start
    object.__setattr__(kept, "epoch_ns", EPOCH_NS)
    write_increments(log, kept, overwrite=True)
    known = read_site(site)
    choices = Choices(bridge_gaps=True)
    comparison = compare(open_log(log, known, choices), known, choices)
    assert comparison.notes[0].startswith("a gap of 0.7")
    assert all(np.isfinite(variant.horizontal).all() for variant in comparison.variants)
    with pytest.raises(GapError):
        found(log, site)


def test_an_algorithm_without_corrections_has_none_to_leave_out(tmp_path: Path) -> None:
    log, site = make(tmp_path, turning_vehicle(), 5.0)
    comparison = found(log, site, reconstruction="midpoint")
    assert [v.name for v in comparison.variants if v.group == "term"][-1] == "without-north-gravity"
    assert EPOCHS[0] in np.round(comparison.epochs, 9)


def test_the_choice_of_another_height_channel_is_mentioned(tmp_path: Path) -> None:
    log, site = make(tmp_path, turning_vehicle(), 5.0)
    site.write_text(site.read_text() + '[mechanization]\nvertical = "hold"\n')
    assert "not 'hold': heights diverge" in found(log, site).notes[0]
