"""``navgrade align``: the alignment report alone."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.navgrade.cli.calling import Bench, navgrade, one_sentence
from tests.navgrade.logmaking import (
    OMEGA,
    SITE,
    imu_channel,
    resting,
    started_site,
)

KEYS = {
    "method",
    "roll_deg",
    "pitch_deg",
    "heading_deg",
    "roll_sigma_deg",
    "pitch_sigma_deg",
    "heading_sigma_deg",
    "start_s",
    "duration_s",
    "implied_latitude_deg",
    "specific_force_residual_m_s2",
    "rate_residual_deg_h",
    "warnings",
}


def report(bench: Bench, *options: str) -> dict[str, object]:
    """What ``align --json`` prints."""
    outcome = navgrade("align", bench.log, "-c", bench.site, "--json", *options)
    assert outcome.code == 0, outcome
    assert outcome.err == ""
    found: dict[str, object] = json.loads(outcome.out)
    return found


@pytest.mark.parametrize("lat_deg", [45.0, -45.0])
@pytest.mark.parametrize(
    ("roll", "pitch", "heading"), [(2.0, -3.0, 70.0), (-170.0, 40.0, 300.0), (0.5, -85.0, 181.0)]
)
def test_the_attitude_put_in_comes_out(
    bench: Bench, roll: float, pitch: float, heading: float, lat_deg: float
) -> None:
    recording = resting(
        20.0, 50.0, lat_deg=lat_deg, roll_deg=roll, pitch_deg=pitch, heading_deg=heading
    )
    bench.write(imu_channel(recording), site=SITE.replace("45.0", f"{lat_deg}"))
    found = report(bench)
    assert set(found) >= KEYS
    assert found["method"] == "triad"
    # the directions of gravity and Earth rate are exact; rounding of the triad, 1e-16 over the
    # Earth rate's horizontal share and cos(85 deg)
    assert found["roll_deg"] == pytest.approx(roll, abs=1e-9)
    assert found["pitch_deg"] == pytest.approx(pitch, abs=1e-9)
    assert found["heading_deg"] == pytest.approx(heading, abs=1e-9)
    assert found["implied_latitude_deg"] == pytest.approx(lat_deg, abs=1e-9)
    assert found["specific_force_residual_m_s2"] == pytest.approx(0.0, abs=1e-6)  # of gravity
    assert found["rate_residual_deg_h"] == pytest.approx(0.0, abs=1e-9)
    assert (found["start_s"], found["duration_s"]) == (0.0, 10.0)


def test_sigmas_are_those_of_the_stated_errors(bench: Bench) -> None:
    """Tilt: accelerometer bias over g. Heading: gyro bias over horizontal Earth rate."""
    bench.write(imu_channel(resting(20.0, 50.0, roll_deg=0.0, pitch_deg=0.0)), site=SITE)
    found = report(bench)
    tilt = math.degrees(50e-6 * 9.80665 / 9.806198)
    north = math.degrees(0.01 * math.pi / 180.0 / 3600.0 / (OMEGA * math.cos(math.pi / 4)))
    # 0.1 %: two digits more than anybody knows a sigma to
    assert found["roll_sigma_deg"] == pytest.approx(tilt, rel=1e-3)
    assert found["pitch_sigma_deg"] == pytest.approx(tilt, rel=1e-3)
    assert found["heading_sigma_deg"] == pytest.approx(math.hypot(north, tilt), rel=1e-3)


def test_the_window_is_the_one_asked_for(bench: Bench) -> None:
    """Still from 8 s on only."""
    before = resting(30.0, 50.0)
    still = before.gyro.copy()
    before.gyro[:400] += 0.02 * np.sin(np.arange(400.0))[:, None]
    site = SITE.replace("start_s = 0.0", "start_s = 8.0")
    bench.write(imu_channel(before), site=site)
    found = report(bench)
    assert (found["start_s"], found["duration_s"]) == (8.0, 10.0)
    assert found["heading_deg"] == pytest.approx(70.0, abs=1e-9)
    assert not np.array_equal(still, before.gyro)


def test_a_known_heading_is_used_where_gyros_are_weak(bench: Bench) -> None:
    site = SITE.replace("gyro_bias_deg_h = 0.01", "gyro_bias_deg_h = 10.0").replace(
        "[site]\n", "[site]\nheading_deg = 75.0\nheading_sigma_deg = 2.0\n"
    )
    bench.write(imu_channel(resting(20.0, 50.0)), site=site)
    found = report(bench)
    assert found["method"] == "known-heading"
    assert found["heading_deg"] == pytest.approx(75.0, abs=1e-9)
    assert found["heading_sigma_deg"] == pytest.approx(2.0, rel=1e-2)


def test_gyros_that_read_nothing_leave_the_report_json(bench: Bench) -> None:
    """A latitude cannot follow from no rotation; JSON has no word for not-a-number but null."""
    site = SITE.replace("[site]\n", "[site]\nheading_deg = 70.0\n")
    bench.write(imu_channel(resting(20.0, 50.0).scaled(gyro=0.0)), site=site)
    outcome = navgrade("align", bench.log, "-c", bench.site, "--json")
    assert outcome.code == 0

    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is not JSON")

    found = json.loads(outcome.out, parse_constant=refuse)
    assert found["implied_latitude_deg"] is None
    assert not [warning for warning in found["warnings"] if "nan" in warning]


def test_the_report_for_people_holds_the_same_numbers(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, 50.0)), site=SITE)
    outcome = navgrade("align", bench.log, "-c", bench.site)
    assert outcome.code == 0
    found = report(bench)
    for name in ("roll", "pitch", "heading"):
        assert f"{found[f'{name}_deg']:10.4f}°" in outcome.out
        assert f"{found[f'{name}_sigma_deg']:.4f}°" in outcome.out
    assert f"{found['implied_latitude_deg']:.4f}°" in outcome.out


def test_alignment_needs_a_site(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, 50.0)), site=started_site())
    one_sentence(navgrade("align", bench.log, "-c", bench.site), str(bench.site), "[site]")


@pytest.mark.parametrize(
    ("name", "pitch_deg", "latitude_deg"),
    [("calgary_ln100_x_up", 89.66, 51.083), ("calgary_ln100_x_down", -89.54, 52.36)],
)
def test_a_navigation_grade_recording_stood_on_its_nose(
    bench: Bench, shared_data: Path, name: str, pitch_deg: float, latitude_deg: float
) -> None:
    """LN-100 at Calgary, as its readme tells it; called as a user does."""
    bench.site.write_text(
        SITE.replace("45.0", "51.07995352")
        .replace("8.0", "-114.13371127")
        .replace("height_m = 0.0", "height_m = 1118.5")
        .replace("duration_s = 10.0", "duration_s = 295.0")
    )
    log = shared_data / f"{name}.mcap"
    command = [sys.executable, "-m", "navgrade", "align", str(log), "-c", str(bench.site), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    assert found["pitch_deg"] == pytest.approx(pitch_deg, abs=0.02)
    assert found["implied_latitude_deg"] == pytest.approx(latitude_deg, abs=0.1)
    w, x, y, z = found["q_nb"]
    # the quaternion's own pitch: a rotation of the forward axis, no Euler angle in between
    assert math.degrees(math.asin(2.0 * (w * y - x * z))) == pytest.approx(pitch_deg, abs=0.02)
    assert math.fsum(c * c for c in (w, x, y, z)) == pytest.approx(1.0, abs=1e-14)
    assert any("heading" in warning for warning in found["warnings"])
