"""A scenario file says what the motions and sensors of the package say, or what is wrong."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navgrade.errors import ConfigError, LogError
from navgrade.sensors import GRADES
from navgrade.simulate.bspline import drawn_path
from navgrade.simulate.imu import true_trajectory
from navgrade.simulate.motion import Motion
from navgrade.simulate.scenario import read_scenario
from navgrade.simulate.segments import (
    Accelerate,
    BankToTurn,
    Climb,
    FigureEight,
    Rotate,
    Segments,
    Spiral,
    Start,
    Still,
    Straight,
    Turn,
)
from navgrade.simulate.simulation import simulate
from navgrade.simulate.vibration import Coning, Sculling, Shaking, Vibrating
from navgrade.simulate.waypoints import Waypoints
from tests.navgrade.simulate.scenarios import (
    NAMES,
    READY,
    START,
    STILL,
    TURN,
    scenario,
    written,
)

DEG = math.pi / 180.0  # rad
HERE = "[start]\nlatitude = -41.5\nlongitude = 174.25\nheight_m = 30.0\nheading_deg = 310.0\n"
ALL_SEGMENTS = """\
[[segment]]
type = "still"
duration_s = 3.0
[[segment]]
type = "rotate"
axis = "heading"
angle_deg = -30.0
rate_deg_s = 20.0
[[segment]]
type = "rotate"
axis = "pitch"
angle_deg = 4.0
rate_deg_s = 5.0
ramp_s = 0.5
[[segment]]
type = "accelerate"
to_speed_m_s = 20.0
acceleration_m_s2 = 4.0
ramp_s = 1.0
[[segment]]
type = "accelerate"
to_speed_m_s = 25.0
duration_s = 4.0
[[segment]]
type = "straight"
duration_s = 2.0
[[segment]]
type = "straight"
distance_m = 50.0
[[segment]]
type = "turn"
angle_deg = 80.0
radius_m = 60.0
banked = true
[[segment]]
type = "turn"
angle_deg = -20.0
rate_deg_s = 8.0
[[segment]]
type = "turn"
angle_deg = 10.0
duration_s = 5.0
ramp_s = 1.5
[[segment]]
type = "climb"
height_m = 12.0
angle_deg = 6.0
ramp_s = 1.5
[[segment]]
type = "climb"
height_m = -5.0
duration_s = 6.0
[[segment]]
type = "figure-eight"
radius_m = 80.0
banked = true
[[segment]]
type = "spiral"
turns = -1.5
height_m = 20.0
rate_deg_s = 12.0
[[segment]]
type = "bank-to-turn"
bank_deg = 30.0
angle_deg = 70.0
"""


def same(found: Motion, expected: Motion) -> None:
    """Equal at many instants, to the last bit: the same numbers must have gone in."""
    assert (found.start, found.end) == (expected.start, expected.end)
    t = np.linspace(found.start, found.end, 200)
    for a, b in zip(found.at(t), expected.at(t), strict=True):
        np.testing.assert_array_equal(np.array(a), np.array(b))


def test_every_segment(tmp_path: Path) -> None:
    start = Start(-41.5 * DEG, 174.25 * DEG, 30.0, heading=310.0 * DEG, pitch=2.0 * DEG, crab=DEG)
    expected = Segments(
        start,
        [
            Still(3.0),
            Rotate("heading", -30.0 * DEG, 20.0 * DEG),
            Rotate("pitch", 4.0 * DEG, 5.0 * DEG, ramp=0.5),
            Accelerate(20.0, acceleration=4.0, ramp=1.0),
            Accelerate(25.0, duration=4.0),
            Straight(duration=2.0),
            Straight(distance=50.0),
            Turn(80.0 * DEG, radius=60.0, banked=True),
            Turn(-20.0 * DEG, rate=8.0 * DEG),
            Turn(10.0 * DEG, duration=5.0, ramp=1.5),
            Climb(12.0, angle=6.0 * DEG, ramp=1.5),
            Climb(-5.0, duration=6.0),
            FigureEight(radius=80.0, banked=True),
            Spiral(-1.5, 20.0, rate=12.0 * DEG),
            BankToTurn(30.0 * DEG, 70.0 * DEG),
        ],
    )
    text = HERE + "pitch_deg = 2.0\ncrab_deg = 1.0\n" + ALL_SEGMENTS
    found = scenario(tmp_path, rest=text)
    same(found.motion, expected)
    assert found.still == 3.0
    assert found.start_ns == 1_767_225_600_000_000_000  # 2026-01-01


def test_vibrations(tmp_path: Path) -> None:
    text = """\
[[vibration]]
type = "coning"
half_angle_deg = 0.5
frequency_hz = 7.0
axis = "x"
phase_deg = 30.0
[[vibration]]
type = "sculling"
angle_deg = 0.2
frequency_hz = 11.0
acceleration_m_s2 = 3.0
rotation_axis = "y"
force_axis = "z"
lead_deg = 15.0
[[vibration]]
type = "translation"
displacement_mm = 0.4
frequency_hz = 20.0
axis = "y"
"""
    found = scenario(tmp_path, rest=START + STILL.replace("still", "straight") + text)
    start = Start(-41.5 * DEG, 174.25 * DEG, 30.0, heading=310.0 * DEG, speed=12.0)
    vibrations = [
        Coning(0.5 * DEG, 7.0, "x", 30.0 * DEG),
        Sculling(
            0.2 * DEG,
            11.0,
            acceleration=3.0,
            rotation_axis="y",
            force_axis="z",
            lead=15.0 * DEG,
        ),
        Shaking(20.0, displacement=0.4e-3, axis="y"),
    ]
    same(found.motion, Vibrating(Segments(start, [Straight(duration=4.0)]), vibrations))
    shaken = scenario(tmp_path, rest=HERE + STILL + text)
    assert shaken.still == 0.0, "what vibrates does not lie still"


def test_sinusoids_against_their_formulas(tmp_path: Path) -> None:
    """By hand at one instant: 10 m north in 8 s, 5 deg roll in 6 s; 1 nm and 1e-14 rad."""
    text = """\
roll_deg = 1.0
[sinusoids]
duration_s = 20.0
[[sinusoids.term]]
coordinate = "up"
amplitude_m = 10.0
period_s = 8.0
phase_deg = 20.0
[[sinusoids.term]]
coordinate = "roll"
amplitude_deg = 5.0
period_s = 6.0
[[sinusoids.term]]
coordinate = "roll"
amplitude_deg = 2.0
period_s = 3.0
phase_deg = 90.0
"""
    found = scenario(tmp_path, rest=HERE + text)
    t = 3.7
    nav = true_trajectory(found.motion, [t])
    assert nav.h[0] == pytest.approx(
        30.0 + 10.0 * math.sin(2.0 * math.pi * t / 8.0 + 20.0 * DEG), abs=2e-9
    )
    roll = 1.0 + 5.0 * math.sin(2.0 * math.pi * t / 6.0)
    roll += 2.0 * math.cos(2.0 * math.pi * t / 3.0)
    assert nav.euler[0] / DEG == pytest.approx([roll, 0.0, -50.0], abs=1e-12)
    assert nav.v_eb_n[0, 2] == pytest.approx(
        -10.0 * 2.0 * math.pi / 8.0 * math.cos(2.0 * math.pi * t / 8.0 + 20.0 * DEG), abs=1e-12
    )
    moving = scenario(
        tmp_path, rest=HERE + "speed_m_s = 6.0\n" + text.replace("roll_deg", "crab_deg", 1)
    )
    north, east = true_trajectory(moving.motion, [t]).v_eb_n[0, :2]
    assert math.degrees(math.atan2(east, north)) % 360.0 == pytest.approx(309.0, abs=1e-3)
    assert math.hypot(north, east) == pytest.approx(6.0, abs=1e-4)  # m/s: the radii change


def test_drawn_path(tmp_path: Path) -> None:
    line = [[174.25, -41.5], [174.26, -41.5], [174.26, -41.49]]
    geometry = {"type": "LineString", "coordinates": line}
    (tmp_path / "walk.geojson").write_text(json.dumps(geometry))
    path = '[path]\nfile = "walk.geojson"\nheight_m = 30.0\nspeed_m_s = 5.0\nstill_s = 20.0\n'
    lon, lat = np.array(line).T * DEG
    found = scenario(tmp_path, rest=path + "[start]\ntime = 2026-03-04T05:06:07Z\n")
    same(found.motion, drawn_path(lat, lon, np.full(3, 30.0), 5.0, still=20.0))
    assert found.still == 20.0
    assert found.start_ns == 1_772_600_767_000_000_000


def waypoints(tmp_path: Path, step: float = 1.0) -> tuple[str, tuple[np.ndarray, ...]]:
    """A CSV file of a curve, and its columns."""
    t = step * np.arange(12.0)
    lat = -41.5 + 1e-4 * np.sin(0.3 * t)
    lon = 174.25 + 1e-4 * t
    h = 30.0 + t
    euler = np.stack([2.0 * np.sin(t), np.cos(t), 70.0 + 3.0 * t])
    rows = ["unix_s,lat_deg,lon_deg,h_m,roll_deg,pitch_deg,heading_deg"]
    for row in zip(t, lat, lon, h, *euler, strict=True):
        rows.append(",".join([f"{1_772_600_767 + row[0]:.3f}", *(f"{x:.17g}" for x in row[1:])]))
    (tmp_path / "path.csv").write_text("\n".join(rows))
    q = Rotation.from_euler("ZYX", euler[::-1].T, degrees=True).as_quat(scalar_first=True)
    return '[path]\nfile = "path.csv"\n', (t, lat * DEG, lon * DEG, h, q)


def test_timed_path(tmp_path: Path) -> None:
    """To rounding of angles; the start is the first point's, 2 s later for a B-spline."""
    text, columns = waypoints(tmp_path)
    found = scenario(tmp_path, rest=text)
    expected = Waypoints(*columns)
    t = np.linspace(0.0, 11.0, 50)
    for a, b, limit in zip(found.motion.at(t), expected.at(t), (2e-9, *[1e-8] * 5), strict=True):
        assert np.abs(np.array(a) - np.array(b)).max() < limit
    assert found.start_ns == 1_772_600_767_000_000_000
    near = scenario(tmp_path, rest=text + 'method = "b-spline"\n')
    assert (near.motion.start, near.motion.end) == (2.0, 9.0)
    assert near.start_ns == 1_772_600_769_000_000_000
    away = np.array(near.motion.at(t[20:21]).r_e) - np.array(expected.at(t[20:21]).r_e)
    assert 1e-6 < np.abs(away).max() < 1.0, "near the points, not through them"


def test_a_path_along_the_truth_of_another_log(tmp_path: Path) -> None:
    """Ten points a second through a turn: 1 mm between them, where the spline is near its ends."""
    first = scenario(tmp_path)
    simulate(first, tmp_path / "log.mcap")
    text = '[path]\nfile = "log.mcap"\ntopic = "/truth/solution"\n'
    again = scenario(tmp_path, rest=text)
    assert again.start_ns == first.start_ns + 10_000_000
    t = np.linspace(0.0, again.motion.end, 300)
    for found, expected, limit in zip(
        again.motion.at(t)[:2], first.motion.at(t + 0.01)[:2], (1e-3, 1e-2), strict=True
    ):
        assert np.abs(np.array(found) - np.array(expected)).max() < limit


def test_imu(tmp_path: Path) -> None:
    text = """\
kind = "average"
axes = "RFU"
topic = "/mine"
lever_arm_m = [1.0, 2.0, 3.0]
mounting_deg = [10.0, 20.0, 30.0]
jitter_us = 25.0
dropped = 0.25
dropped_spans_s = [[1.0, 2.0], [3.5, 4]]
grade = "tactical"
seed = 12
[imu.errors]
arw_deg_rth = 0.5
gyro_bias_deg_h = [1.0, 2.0, 3.0]
accel_scale_ppm = 100
[truth]
rate_hz = 20
[gnss]
rate_hz = 5
horizontal_sigma_m = 0.1
vertical_sigma_m = 0.2
lever_arm_m = [4, 5, 6]
"""
    found = scenario(tmp_path, text)
    imu = found.imu
    assert (imu.rate_hz, imu.kind, imu.axes, imu.topic) == (100.0, "average", "RFU", "/mine")
    assert imu.lever_arm_b.tolist() == [1.0, 2.0, 3.0]
    mounting = Rotation.from_euler("ZYX", [30.0, 20.0, 10.0], degrees=True)
    between = Rotation.from_quat(imu.q_bs, scalar_first=True) * mounting.inv()
    assert between.magnitude() < 1e-15
    assert (imu.jitter, imu.dropped, imu.seed) == (pytest.approx(25e-6), 0.25, 12)
    assert imu.dropped_spans == ((1.0, 2.0), (3.5, 4.0))
    tactical = GRADES["tactical"].errors
    assert imu.grade == "tactical"
    assert imu.errors.gyro.white == pytest.approx(0.5 * DEG / 60.0)
    assert imu.errors.gyro.bias == pytest.approx(np.array([1.0, 2.0, 3.0]) * DEG / 3600.0)
    assert imu.errors.accel.scale == pytest.approx([1e-4] * 3, rel=1e-15)
    assert imu.errors.accel.white == tactical.accel.white
    assert imu.errors.gyro.markov_time == tactical.gyro.markov_time
    assert found.truth_rate_hz == 20.0
    gnss = found.gnss
    assert gnss is not None
    assert (gnss.rate_hz, gnss.horizontal_sigma, gnss.vertical_sigma) == (5.0, 0.1, 0.2)
    assert gnss.lever_arm_b.tolist() == [4.0, 5.0, 6.0]
    assert found.start_ns == 1_772_600_767_000_000_000
    assert found.with_seed(3).imu.seed == 3


@pytest.mark.parametrize("name", NAMES)
def test_every_ready_scenario(name: str) -> None:
    found = read_scenario(READY / f"{name}.toml")
    assert 540.0 < found.duration < 720.0, "about ten minutes"
    assert (found.imu.rate_hz, found.imu.kind) == (200.0, "increment")
    assert found.imu.grade is None
    assert not found.imu.errors.gyro.white


def test_no_ready_scenario_is_forgotten() -> None:
    assert sorted(path.stem for path in READY.glob("*.toml")) == list(NAMES)


# ---- what is refused ---------------------------------------------------------------------------

PATH = '[path]\nfile = "walk.geojson"\n'


@pytest.mark.parametrize(
    ("imu", "rest", "facts"),
    [
        ("rat_hz = 1", START + TURN, ("imu.rat_hz: unknown key in [imu]", "rate_hz")),
        ("[imu.errors]\narw = 1", START + TURN, ("imu.errors.arw", "arw_deg_rth")),
        ('kind = "compensated"', START + TURN, ("imu.kind", "increment, average, rate")),
        ('axes = "FRU"', START + TURN, ("imu.axes", "right-handed")),
        ('grade = "tacticle"', START + TURN, ("imu.grade: 'tacticle'", "the nearest is tactical")),
        ("dropped = 1.0", START + TURN, ("imu.dropped", "below 1")),
        ("dropped = -0.1", START + TURN, ("imu.dropped", "at least 0")),
        ("dropped_spans_s = 3", START + TURN, ("must be a list of [from, to]",)),
        ("dropped_spans_s = [[1]]", START + TURN, ("span 1 must be [from, to], got [1]",)),
        ("dropped_spans_s = [[0, 1], [5, 900]]", START + TURN, ("span 2", "[5, 900]")),
        ("dropped_spans_s = [[2, 1]]", START + TURN, ("span 1 must increase",)),
        ("jitter_us = 1100", START + TURN, ("imu.jitter_us", "at most a tenth", "1000 us")),
        ("seed = -1", START + TURN, ("imu.seed", "not negative")),
        ("seed = 1.5", START + TURN, ("imu.seed", "whole number")),
        ("lever_arm_m = [1, 2]", START + TURN, ("imu.lever_arm_m", "3 finite numbers")),
        ("[imu.errors]\narw_deg_rth = -1", START + TURN, ("white", "not negative")),
        ("[imu.errors]\ngyro_bias_deg_h = [1]", START + TURN, ("gyro_bias_deg_h", "3 finite")),
        ("[imu.errors]\narw_deg_rth = true", START + TURN, ("arw_deg_rth", "must be a number")),
        ("", START, ("a scenario needs one of [[segment]], [path] and [sinusoids]", "none")),
        ("", START + TURN + PATH, ("this one has segment and path",)),
        ("", TURN, ("start: is required: [start] with latitude",)),
        ("", START.replace("-41.5", "-89.5") + TURN, ("latitude -89.5",)),
        ("", START + "[segment]\n", ("segment: must be an array of tables, [[segment]]",)),
        ("", START + "[[segment]]\nduration_s = 3\n", ("segment 1.type: is required",)),
        ("", START + '[[segment]]\ntype = "trun"\n', ("segment 1.type: 'trun'", "nearest is turn")),
        (
            "",
            START + TURN + '[[segment]]\ntype = "climb"\nradius_m = 1\n',
            ("segment 3.radius_m: unknown key in [segment 3]; the nearest",),
        ),
        (
            "",
            START + '[[segment]]\ntype = "turn"\nradius_m = 9\n',
            ("segment 1.angle_deg: is req",),
        ),
        ("", START + STILL, ("segment 1, Still: the vehicle moves at 12 m/s",)),
        ("", START + TURN.replace("60.0", "-60.0"), ("radius must be positive, got -60.0 m",)),
        ("", START + TURN + "[truth]\nrate_hz = 0\n", ("truth.rate_hz", "above 0")),
        ("", START + TURN + "[gnss]\nrate_hz = 0\n", ("gnss.rate_hz", "above 0")),
        ("", START + TURN + "[gnss]\nvertical_sigma_m = -1\n", ("gnss.vertical_sigma_m",)),
        ("", START + TURN + '[[vibration]]\ntype = "conning"\n', ("the nearest is coning",)),
        (
            "",
            START + TURN + '[[vibration]]\ntype = "translation"\nfrequency_hz = 3\n',
            ("vibration 1: give one of acceleration and displacement",),
        ),
        ("", START + "[sinusoids]\nduration_s = 5\n", ("sinusoids.term: is required",)),
        (
            "",
            START
            + '[sinusoids]\nduration_s = 5\n[[sinusoids.term]]\ncoordinate = "up"\n'
            + "amplitude_deg = 1\nperiod_s = 3\n",
            ("sinusoids.term 1.amplitude_deg: up has an amplitude_m",),
        ),
        ("", '[path]\nfile = "no.csv"\n', ("no.csv: no such path file",)),
        ("", "[path]\n", ("path.file: is required",)),
        ("", '[path]\nfile = "p.kml"\n', ("p.kml does not end in .csv, .geojson, .json, .mcap",)),
        ("", PATH, ("path.height_m: is required: the path has no heights",)),
        ("", PATH + "height_m = 3\n", ("path.speed_m_s: is required",)),
        (
            "",
            PATH + "height_m = 3\nspeed_m_s = 0\n",
            ("path.speed_m_s: must be finite and above 0",),
        ),
        ("", PATH + 'topic = "/fix"\n', ("path.topic: is about a log",)),
        ("", PATH + "geoid_height_m = 3\n", ("geoid_height_m: the points have no heights",)),
        (
            "",
            PATH + 'height_m = 3\nspeed_m_s = 1\nmethod = "b-spline"\n',
            ("path.method: is for a path with times",),
        ),
        ("", '[path]\nfile = "empty.csv"\n', ("empty.csv: holds no point",)),
        ("", '[path]\nfile = "path.csv"\nspeed_m_s = 3\n', ("is for a path without times",)),
        ("", '[path]\nfile = "path.csv"\nheight_m = 3\n', ("have heights of their own",)),
        ("", PATH + "[start]\nheading_deg = 3\n", ("start.heading_deg: is not for a [path]",)),
        ("", PATH + "[start]\nlatitude = 3\n", ("start.latitude: is not for a [path]",)),
        ("", '[path]\nfile = "few.csv"\n', ("few.csv: a quintic spline needs 6 waypoints",)),
    ],
)
def test_refused(tmp_path: Path, imu: str, rest: str, facts: tuple[str, ...]) -> None:
    line = {"type": "LineString", "coordinates": [[174.25, -41.5], [174.26, -41.5]]}
    (tmp_path / "walk.geojson").write_text(json.dumps(line))
    (tmp_path / "empty.csv").write_text("lat_deg,lon_deg,h_m\n")
    (tmp_path / "few.csv").write_text("time_s,lat_deg,lon_deg,h_m\n0,1,2,3\n1,1.1,2,3\n")
    waypoints(tmp_path)
    with pytest.raises(ConfigError) as caught:
        scenario(tmp_path, imu, rest)
    for fact in (str(tmp_path), *facts):
        assert fact in str(caught.value)


@pytest.mark.parametrize("rate", ["0.0", "-3.0", "inf", '"fast"'])
def test_rates_that_are_none(tmp_path: Path, rate: str) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(f"[imu]\nrate_hz = {rate}\n{START}{TURN}")
    with pytest.raises(ConfigError, match=r"imu\.rate_hz"):
        read_scenario(path)


def test_less_than_one_sample(tmp_path: Path) -> None:
    path = written(tmp_path, rest=HERE + STILL, rate_hz=0.24)
    with pytest.raises(ConfigError, match=r"4 s, less than one sample at 0\.24 Hz"):
        read_scenario(path)


def test_no_imu(tmp_path: Path) -> None:
    path = tmp_path / "scenario.toml"
    path.write_text(START + TURN)
    with pytest.raises(ConfigError, match="imu: is required"):
        read_scenario(path)
    path.write_text(f"segment = []\n[imu]\nrate_hz = 9\n{START}")
    with pytest.raises(ConfigError, match="segment: holds no segment"):
        read_scenario(path)
    with pytest.raises(ConfigError, match="no such scenario file"):
        read_scenario(tmp_path / "nothing.toml")


def test_b_splines_ask_for_even_poses(tmp_path: Path) -> None:
    text, _ = waypoints(tmp_path)
    rows = (tmp_path / "path.csv").read_text().splitlines()
    (tmp_path / "path.csv").write_text("\n".join(rows[:5] + rows[6:]))
    with pytest.raises(ConfigError, match=r"from point 4 to 5 it is 2 s instead of 1 s"):
        scenario(tmp_path, rest=text + 'method = "b-spline"\n')
    bare = [",".join(row.split(",")[:4]) for row in rows]
    (tmp_path / "path.csv").write_text("\n".join(bare))
    with pytest.raises(ConfigError, match="needs the attitudes"):
        scenario(tmp_path, rest=text + 'method = "b-spline"\n')


def test_a_log_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no such file"):
        scenario(tmp_path, rest='[path]\nfile = "no.mcap"\ntopic = "/fix"\n')
    with pytest.raises(ConfigError, match=r"path\.topic: is required"):
        scenario(tmp_path, rest='[path]\nfile = "no.mcap"\n')
