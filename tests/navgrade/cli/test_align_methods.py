"""``navgrade align`` with every method, motion, survey and mistake, called as a user does."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from align import METHODS
from tests.align.slams import slams
from tests.align.sway import Sway, Waves, edges
from tests.navgrade.cli.calling import Bench, Outcome, navgrade, one_sentence
from tests.navgrade.logmaking import SITE, Recording, imu_channel, resting, stamps

DEG = math.pi / 180.0
ARW = 0.003 * DEG / 60.0  # rad/sqrt(s)
VRW = 10.0 * 9.80665e-6  # (m/s)/sqrt(s)
OPEN = SITE[: SITE.index("[alignment]")]  # no window: the log says where it is still
STATED = OPEN.replace("[imu.errors]\n", "[imu.errors]\narw_deg_rth = 0.003\nvrw_ug_rthz = 10.0\n")
MARKS = Path(__file__).resolve().parents[2] / "align" / "marks"


def aligned(bench: Bench, *options: str) -> Any:
    outcome = navgrade("align", bench.log, "-c", bench.site, "--json", *options)
    assert outcome.code == 0, outcome
    return json.loads(outcome.out)


def words(bench: Bench, *options: object) -> str:
    outcome: Outcome = navgrade("align", bench.log, "-c", bench.site, *options)
    assert outcome.code == 0, outcome
    return outcome.out


def noisy(recording: Recording, seed: int, rate: float, more: float = 1.0) -> Recording:
    """With the white noise of a navigation-grade IMU, `more` times."""
    rng = np.random.default_rng(seed)
    sigma = more * math.sqrt(rate)
    return replace(
        recording,
        gyro=recording.gyro + ARW * sigma * rng.standard_normal(recording.gyro.shape),
        accel=recording.accel + VRW * sigma * rng.standard_normal(recording.accel.shape),
    )


def swaying(amplitude_deg: float, seconds: float, seed: int) -> tuple[Recording, Rotation]:
    """A ship at berth: roll, pitch and yaw of 7 to 11 s, and the attitude at the end."""
    rng = np.random.default_rng(seed)
    amplitude = amplitude_deg * DEG * np.array([1.0, 0.7, 0.4])
    waves = Waves(amplitude, (7.3, 9.1, 10.7), tuple(rng.uniform(0.0, 2.0 * np.pi, 3)))
    felt = Sway(lat=45.0 * DEG, euler=(0.03, -0.05, 1.2), turn=waves).feel(edges(seconds, 50.0))
    felt = felt.noisy(rng, ARW, VRW)
    dt = felt.dt[:, None]
    # the first message's interval reaches back to the start
    return Recording(stamps(len(dt), 50.0), felt.phi / dt, felt.dv / dt), felt.attitude


def heading_off(found: dict[str, Any], truth: Rotation) -> float:
    """rad"""
    q = Rotation.from_quat(found["q_nb"], scalar_first=True)
    return abs(float((q * truth.inv()).as_rotvec()[2]))


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_what_was_put_in(bench: Bench, method: str) -> None:
    site = STATED.replace("[site]\n", "[site]\nheading_deg = 70.0\nheading_sigma_deg = 0.5\n")
    recording = noisy(resting(120.0, 50.0), 3, 50.0)
    if method == "multi-position":
        second = resting(120.0, 50.0, roll_deg=-3.0, pitch_deg=1.0, heading_deg=251.0)
        moved = np.int64(200e9)  # ns
        recording = Recording(
            np.concatenate([recording.stamp_ns, second.stamp_ns + moved]),
            np.concatenate([recording.gyro, noisy(second, 4, 50.0).gyro]),
            np.concatenate([recording.accel, noisy(second, 4, 50.0).accel]),
        )
    bench.write(imu_channel(recording), site=site)
    found = aligned(bench, "--method", method)
    first = found[0] if method == "multi-position" else found
    assert first["method"] == ("triad" if method == "auto" else method)
    # Five sigma of white noise over two minutes: 1 µrad of level each, 8 mrad of heading;
    # sigmas in degrees are those of the stated biases, 50 µg and 0.01 deg/h
    assert first["roll_deg"] == pytest.approx(2.0, abs=5.0e-3)
    assert first["pitch_deg"] == pytest.approx(-3.0, abs=5.0e-3)
    if method == "level":
        assert first["heading_deg"] is None
        assert first["grade"] == "levelling"
        return
    assert first["heading_deg"] == pytest.approx(70.0, abs=0.5)
    assert abs(first["heading_deg"] - 70.0) < 4.0 * first["heading_sigma_deg"]
    squares = [
        sum(line[key] ** 2 for line in first["budget"]) for key in ("tilt_deg", "azimuth_deg")
    ]
    assert math.sqrt(squares[0]) == pytest.approx(first["tilt_sigma_deg"], rel=1e-6)
    assert math.sqrt(squares[1]) == pytest.approx(first["azimuth_sigma_deg"], rel=1e-6)


def test_an_unknown_method_is_refused(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, 50.0)), site=OPEN)
    outcome = navgrade("align", bench.log, "-c", bench.site, "--method", "triads")
    one_sentence(outcome, "'triads' is not one of auto, triad", "multi-position")


@pytest.mark.parametrize("amplitude_deg", [0.1, 2.0])
def test_a_swaying_base_is_never_given_to_triad(bench: Bench, amplitude_deg: float) -> None:
    offs = []
    for seed in range(6):
        recording, truth = swaying(amplitude_deg, 120.0, seed)
        bench.write(imu_channel(recording), site=STATED)
        found = aligned(bench)
        assert found["method"] == "inertial"
        assert "sways" in found["reason"]
        assert [s["motion"] for s in found["stretches"]] == ["swaying"]
        offs.append(heading_off(found, truth))
        assert offs[-1] < 4.0 * found["azimuth_sigma_deg"] * DEG
    assert np.sqrt(np.mean(np.square(offs))) < 3e-3  # rad; TRIAD is off by 0.1 to 0.8


def test_weak_gyros_on_a_swaying_base_give_no_level(bench: Bench) -> None:
    """A level of means would be of nothing that stood still."""
    recording, _ = swaying(2.0, 60.0, 1)
    weak = STATED.replace("gyro_bias_deg_h = 0.01", "gyro_bias_deg_h = 10.0")
    bench.write(imu_channel(recording), site=weak)
    outcome = navgrade("align", bench.log, "-c", bench.site)
    one_sentence(outcome, "cannot find north on a base that sways", "sigma of 5")


def test_a_gap_in_a_sway_is_refused(bench: Bench) -> None:
    recording, _ = swaying(2.0, 120.0, 1)
    bench.write(imu_channel(recording.without(3000, 100)), site=STATED)
    outcome = navgrade("align", bench.log, "-c", bench.site, "--method", "inertial")
    one_sentence(outcome, "samples are missing from", "without a gap")


def test_door_slams_are_cut_out(bench: Bench) -> None:
    """Averaged in, slams of 20 times what is visible would move the level."""
    slammed = slams(np.random.default_rng(8), 50.0, 240.0, "navigation", 20.0)
    rest = resting(240.0, 50.0)
    count = len(slammed.values)
    felt = Recording(
        rest.stamp_ns[:count],
        rest.gyro[:count] + slammed.values[:, :3] - [2e-5, -3e-5, 5e-5],
        rest.accel[:count] + slammed.values[:, 3:] - [0.31, -0.12, -9.80],
    )
    bench.write(imu_channel(felt), site=STATED)
    found = aligned(bench)
    (stretch,) = found["stretches"]
    assert stretch["used"]
    assert 8.0 < stretch["cut_s"] < 40.0  # s: eight slams of a second or two, and their guards
    assert found["used_s"] == pytest.approx(240.0 - stretch["cut_s"], abs=0.5)
    assert found["heading_deg"] == pytest.approx(70.0, abs=4.0 * found["heading_sigma_deg"])
    assert "cut" in words(bench)


def test_the_window_may_be_left_open(bench: Bench) -> None:
    """The first stop is the longer one; a run leaves something to navigate."""
    recording = noisy(resting(60.0, 50.0, sway_from_s=40.0), 5, 50.0)
    bench.write(imu_channel(recording), site=STATED)
    found = aligned(bench)
    assert found["start_s"] == pytest.approx(0.0, abs=0.3)
    assert 37.0 < found["start_s"] + found["duration_s"] < 40.6
    bench.accepted()
    kept = json.loads(bench.provenance()["alignment"])
    assert kept["method"] == "triad"
    assert kept["heading_deg"] == pytest.approx(found["heading_deg"], abs=1e-9)
    assert kept["budget"] == found["budget"]


def test_a_run_starts_at_the_first_good_stop(bench: Bench) -> None:
    """Stops of 40 s and 60 s: the longer has less noise, the first leaves more to navigate."""
    first = resting(80.0, 50.0, sway_from_s=40.0)
    second = resting(60.0, 50.0)
    third = resting(30.0, 50.0, sway_from_s=0.0)
    pieces = (first, second, third)
    count = sum(map(len, pieces))
    recording = Recording(
        stamps(count, 50.0),
        np.concatenate([p.gyro for p in pieces]),
        np.concatenate([p.accel for p in pieces]),
    )
    bench.write(imu_channel(noisy(recording, 13, 50.0)), site=STATED)
    assert aligned(bench)["start_s"] == pytest.approx(80.0, abs=2.0)
    bench.accepted()
    assert json.loads(bench.provenance()["alignment"])["start_s"] == pytest.approx(0.0, abs=0.3)


def test_a_log_cut_off_is_aligned_and_said_to_be_cut(bench: Bench) -> None:
    bench.write(imu_channel(noisy(resting(120.0, 50.0), 14, 50.0)), site=STATED)
    whole = bench.log.read_bytes()
    assert "cut off" not in words(bench)
    bench.log.write_bytes(whole[: int(0.6 * len(whole))])
    found = aligned(bench)
    assert 20.0 < found["used_s"] < 100.0
    assert len(found["defects"]) == 1
    assert "cut off" in found["defects"][0]
    assert f"warning: {found['defects'][0]}" in words(bench)
    outcome = navgrade("align", bench.log, "-c", bench.site, "--strict")
    one_sentence(outcome, "cut off")


def test_a_run_needs_something_after_the_stop(bench: Bench) -> None:
    bench.write(imu_channel(noisy(resting(30.0, 50.0), 6, 50.0)), site=STATED)
    bench.refused("ends with the log and leaves nothing to navigate")


def test_a_log_that_never_stops(bench: Bench) -> None:
    bench.write(imu_channel(resting(60.0, 50.0, sway_from_s=0.0)), site=STATED)
    outcome = navgrade("align", bench.log, "-c", bench.site)
    one_sentence(outcome, "no stretch of the log is still for 10 s", "[initial]")


def test_weak_gyros_leave_the_level(bench: Bench) -> None:
    """The report stays useful, a run does not start, and both say what would help."""
    site = OPEN.replace("gyro_bias_deg_h = 0.01", "gyro_bias_deg_h = 10.0")
    bench.write(imu_channel(resting(60.0, 50.0, sway_from_s=40.0)), site=site)
    found = aligned(bench)
    assert found["method"] == "level"
    assert found["grade"] == "levelling"
    assert found["heading_deg"] is None
    assert found["q_nb"] == [None] * 4
    assert found["roll_deg"] == pytest.approx(2.0, abs=1e-9)
    # 10 deg/h over 10.64 deg/h level is 54°
    assert any("sigma of 54°" in w and "heading_deg" in w for w in found["warnings"])
    assert "two positions" in " ".join(found["warnings"])
    assert "unknown" in words(bench)
    bench.refused("cannot find north", "sigma of 54°", "site.heading_deg")
    outcome = navgrade("align", bench.log, "-c", bench.site, "--method", "triad")
    one_sentence(outcome, "cannot find north")


MISTAKES = {
    "hemisphere": (
        "latitude = 45.0",
        "latitude = -45.0",
        ("45.0°", "the hemisphere of site.latitude is wrong"),
    ),
    "swapped": (
        "latitude = 45.0\nlongitude = 8.0",
        "latitude = 8.0\nlongitude = 45.0",
        ("latitude and longitude are swapped",),
    ),
    "pole": ("latitude = 45.0", "latitude = 89.5", ("latitude 45.0°", "89.5°")),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_wrong_place_is_named(bench: Bench, name: str) -> None:
    old, new, facts = MISTAKES[name]
    bench.write(imu_channel(noisy(resting(60.0, 50.0), 7, 50.0)), site=OPEN.replace(old, new))
    one_sentence(navgrade("align", bench.log, "-c", bench.site), *facts)


def test_near_a_pole_gyros_are_of_no_use(bench: Bench) -> None:
    recording = noisy(resting(60.0, 50.0, lat_deg=89.5, gravity=9.8321), 7, 50.0)
    site = OPEN.replace("latitude = 45.0", "latitude = 89.5")
    bench.write(imu_channel(recording), site=site)
    outcome = navgrade("align", bench.log, "-c", bench.site, "--method", "triad")
    one_sentence(outcome, "within 1° of a pole", "site.heading_deg")
    assert aligned(bench)["method"] == "level"


def test_accelerometers_upside_down_are_named(bench: Bench) -> None:
    """The Earth then seems to turn as on the other hemisphere: both causes are said."""
    recording = noisy(resting(60.0, 50.0), 7, 50.0)
    bench.write(imu_channel(replace(recording, accel=-recording.accel)), site=OPEN)
    one_sentence(navgrade("align", bench.log, "-c", bench.site), "-45.0°", "sign of an axis")


def test_axes_upside_down_are_mentioned(bench: Bench) -> None:
    """The data fit: only the body seems to hang from its ceiling."""
    recording = noisy(resting(60.0, 50.0), 7, 50.0)
    turned = np.array([1.0, -1.0, -1.0])
    flu = replace(recording, gyro=recording.gyro * turned, accel=recording.accel * turned)
    bench.write(imu_channel(flu), site=OPEN)
    found = aligned(bench)
    assert any("upside down" in w and "imu.axes" in w for w in found["warnings"])


@pytest.mark.parametrize(
    ("marks", "mark", "to", "frame"),
    [
        ("surveyor.csv", "PIER 1", "AZ MK", "NAD 83(2011)"),
        ("datasheet.txt", "PIER 1", "AZ MK", "NAD 83(2011)"),
        ("solution.snx", "PIER 1", "AZ MK", "ITRF2014"),
        ("points.geojson", "PIER 1", "AZ MK", "WGS 84"),
    ],
)
def test_marks_of_every_format_give_one_heading(
    bench: Bench, marks: str, mark: str, to: str, frame: str
) -> None:
    """Azimuth 63.383481° of the line, by the GRS 80 geodesic, and an angle turned from it."""
    lat_deg = 51.0799535
    recording = noisy(resting(60.0, 50.0, lat_deg=lat_deg, gravity=9.80725), 9, 50.0)
    site = f"""\
[imu]
kind = "average"
axes = "FRD"
[imu.errors]
gyro_bias_deg_h = 0.3
accel_bias_ug = 200.0
[site]
marks = "{(MARKS / marks).as_posix()}"
mark = "{mark}"
[azimuth]
to = "{to}"
turned_deg = "6 37 00"
mounting_deg = -0.25
mounting_sigma_deg = 0.02
"""
    bench.write(imu_channel(recording), site=site)
    found = aligned(bench)
    assert found["method"] == "known-heading"
    heading = 63.383481 + 6.0 + 37.0 / 60.0 - 0.25
    assert found["heading_deg"] == pytest.approx(heading, abs=1e-6)  # deg: the digits above
    assert found["heading_sigma_deg"] == pytest.approx(0.02, rel=1e-3)
    # The gyros read the Earth rate exactly, the recording heads 70°: what remains is their bias
    assert np.all(np.abs(found["gyro_bias_deg_h"]) < 0.5)
    shown = words(bench)
    assert frame in shown
    assert ("differ by 1 to 2 m" in shown) is frame.startswith("NAD")


def test_known_heading_shows_the_gyro_bias(bench: Bench) -> None:
    bias = np.array([0.5, -0.3, 0.2])  # deg/h
    recording = noisy(resting(120.0, 50.0), 11, 50.0)
    recording = replace(recording, gyro=recording.gyro + bias * DEG / 3600.0)
    site = STATED.replace("gyro_bias_deg_h = 0.01", "gyro_bias_deg_h = 0.5").replace(
        "[site]\n", "[site]\nheading_deg = 70.0\nheading_sigma_deg = 0.01\n"
    )
    bench.write(imu_channel(recording), site=site)
    found = aligned(bench)
    # deg/h: white noise leaves 0.016 on each axis, the tilt of 50 µg less
    assert found["gyro_bias_deg_h"] == pytest.approx(bias.tolist(), abs=0.07)
    assert found["gyro_bias_sigma_deg_h"] == pytest.approx([0.0165] * 3, rel=0.3)


def test_a_page_is_written(bench: Bench) -> None:
    bench.write(imu_channel(noisy(resting(60.0, 50.0), 12, 50.0)), site=STATED)
    page = bench.folder / "out.html"
    words(bench, "--plot", page)
    assert "<html" in page.read_text()[:200]
    again = navgrade("align", bench.log, "-c", bench.site, "--plot", page)
    one_sentence(again, "out.html", "--overwrite")
    words(bench, "--plot", page, "--overwrite")


def test_several_logs_are_positions(bench: Bench) -> None:
    """Two logs, half a turn apart, share a bias of 1 deg/h about the vertical."""
    down = np.array([0.0, 0.0, 1.0 * DEG / 3600.0])
    logs = []
    for k, (roll, heading) in enumerate(((2.0, 70.0), (-178.0, 70.0))):
        recording = noisy(resting(120.0, 50.0, roll_deg=roll, heading_deg=heading), 20 + k, 50.0)
        bench.log = bench.folder / f"{k}.mcap"
        bench.write(imu_channel(replace(recording, gyro=recording.gyro + down)), site=None)
        logs.append(bench.log)
    bench.site.write_text(STATED.replace("gyro_bias_deg_h = 0.01", "gyro_bias_deg_h = 1.0"))
    outcome = navgrade("align", *logs, "-c", bench.site, "--json")
    assert outcome.code == 0, outcome
    first, second = json.loads(outcome.out)
    assert first["method"] == second["method"] == "multi-position"
    assert first["gyro_bias_deg_h"][2] == pytest.approx(1.0, abs=0.1)
    for found, roll in ((first, 2.0), (second, -178.0)):
        assert found["roll_deg"] == pytest.approx(roll, abs=0.01)
    other = navgrade("align", *logs, "-c", bench.site, "--method", "triad")
    assert other.code == 2
    assert "multi-position" in other.err


def test_the_recordings(bench: Bench, shared_data: Path) -> None:
    """Each prints a result whose sigma covers the known truth, or is rightly refused."""
    calgary = """\
[imu]
kind = "average"
axes = "FRD"
[site]
latitude = 51.07995352
longitude = -114.13371127
height_m = 1118.5
"""
    bench.site.write_text(calgary)
    facts = (("up", 89.66, 11.480), ("down", -89.54, 11.943))
    logs = [shared_data / f"calgary_ln100_x_{name}.mcap" for name, _, _ in facts]
    for log, (_, pitch, up) in zip(logs, facts, strict=True):
        bench.log = log
        found = aligned(bench)
        assert found["method"] == "triad"
        assert found["used_s"] > 285.0
        assert found["pitch_deg"] == pytest.approx(pitch, abs=0.02)
        # deg/h: its tenths scatter by 0.06, and where spans are cut counts
        assert 11.702 - found["rate_residual_down_deg_h"] == pytest.approx(up, abs=0.05)
    outcome = navgrade("align", *logs, "-c", bench.site, "--json")
    for found in json.loads(outcome.out):
        assert found["gyro_bias_deg_h"][0] == pytest.approx(-0.25, abs=0.05)
        # The half-sum of the x readings is -0.43 mm/s², that is -44 µg; x leans by 0.34° and
        # 0.46° from the vertical, which hides 0.07 mm/s² of it
        assert found["accel_bias_ug"][0] * 9.80665e-3 == pytest.approx(-0.50, abs=0.03)
        # 1 mg of y and z, which nobody excludes, may hide as much: the sigma covers both
        assert found["accel_bias_sigma_ug"][0] * 9.80665e-3 == pytest.approx(0.065, rel=0.3)
        assert abs(found["rate_residual_down_deg_h"]) < 0.03
        assert any("y and z accelerometer bias" in text for text in found["unobservable"])
    bench.log = shared_data / "novatel_oem7_parked.mcap"
    refused = navgrade("align", bench.log, "-c", bench.site, "--imu-topic", "/gps/imu")
    one_sentence(refused, "gravity has been removed from this stream")


@pytest.mark.parametrize("method", ["auto", "fine", "inertial"])
def test_the_parked_car(bench: Bench, shared_data: Path, method: str) -> None:
    bench.site.write_text(
        OPEN.replace("45.0", "44.23249")
        .replace("8.0", "-76.5")
        .replace('"FRD"', '"RFU"')
        .replace("gyro_bias_deg_h = 0.01", "gyro_bias_deg_h = 1.0")
        .replace("accel_bias_ug = 50.0", "accel_bias_ug = 1000.0")
    )
    bench.log = shared_data / "kingston_hg1700_drive.mcap"
    found = aligned(bench, "--method", method)
    assert found["start_s"] < 5.0
    assert found["start_s"] + found["duration_s"] < 529.0
    # The reference of the recording, whose own azimuth moves by a degree: roll and pitch within
    # 0.05°, heading 201 ± 2°; each sigma covers the difference
    assert found["roll_deg"] == pytest.approx(-0.226, abs=0.05)
    assert found["pitch_deg"] == pytest.approx(-0.321, abs=0.05)
    assert found["heading_deg"] == pytest.approx(201.0, abs=2.0)
    assert abs(found["roll_deg"] + 0.226) < 2.0 * found["roll_sigma_deg"]
    assert abs(found["heading_deg"] - 201.0) < found["heading_sigma_deg"] < 10.0
