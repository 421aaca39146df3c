"""Alignment of recordings nobody on the project made.

LN-100: navigation-grade ring-laser INS, sensor x axis up and then down, so that pitch is near
±90°. HG1700: tactical-grade ring-laser IMU in a parked car.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import navgrade
from align import Alignment, AlignmentError, KnownHeading, SensorErrors, align_static
from align.checks import check_units_at_rest
from tests.align.at_rest import DEG, DEG_H, HALF, UG, Array
from tests.oracles.gravity import normal_gravity_zonal

CALGARY = (51.07995352 * DEG, 1118.5)  # rad, m
KINGSTON = (44.23249 * DEG, 39.94)  # rad, m
LN100 = SensorErrors(gyro_bias=0.25 * DEG_H, accel_bias=50.0 * UG)  # what its two positions show

# Pitch deg, implied latitude deg, rate along up and across it in deg/h
LN100_FACTS = [
    ("calgary_ln100_x_up.mcap", 89.66, 51.083, 11.480, 9.27),
    ("calgary_ln100_x_down.mcap", -89.54, 52.36, 11.943, 9.21),
]
EACH_LN100 = pytest.mark.parametrize(
    ("name", "pitch_deg", "implied_deg", "up_deg_h", "level_deg_h"),
    LN100_FACTS,
    ids=["x up", "x down"],
)


def read(folder: Path, name: str, axes: str, topic: str | None = None) -> navgrade.ImuSamples:
    return navgrade.read_imu(folder / name, topic, kind="average", axes=axes)


def part(samples: navgrade.ImuSamples, start: float, stop: float) -> tuple[Array, Array, Array]:
    rows = (samples.t > start) & (samples.t <= stop)
    return samples.dt[rows], samples.gyro[rows], samples.accel[rows]


@EACH_LN100
def test_ln100_on_its_tail_and_on_its_nose(
    shared_data: Path,
    name: str,
    pitch_deg: float,
    implied_deg: float,
    up_deg_h: float,
    level_deg_h: float,
) -> None:
    samples = read(shared_data, name, "FRD")
    window = samples.dt, samples.gyro, samples.accel
    result = align_static(*window, *CALGARY, errors=LN100)
    assert result.method == "triad"
    # deg: pitch moves by 0.003 for each 50 µg, and the facts end at a hundredth.
    assert result.pitch / DEG == pytest.approx(pitch_deg, rel=0.0, abs=0.02)
    # deg: 0.03 of it is how the jittering stamps weigh the samples.
    assert result.implied_latitude / DEG == pytest.approx(implied_deg, rel=0.0, abs=0.1)
    assert result.duration == pytest.approx(300.0, rel=0.0, abs=0.05)  # s

    C_nb = Rotation.from_quat(result.q_nb, scalar_first=True)
    up = C_nb.apply(samples.dt @ samples.accel / samples.dt.sum())
    rate = C_nb.apply(samples.dt @ samples.gyro / samples.dt.sum()) / DEG_H
    # The quaternion, not the Euler angles, carries the attitude: force up, rate in the meridian.
    # A kilometre up the plumb line leaves the ellipsoid's normal by 0.9 µrad.
    gravity = normal_gravity_zonal(*CALGARY)
    plumb = -np.array([float(gravity.north), 0.0, float(gravity.down)])
    np.testing.assert_allclose(
        up / np.linalg.norm(up), plumb / np.linalg.norm(plumb), rtol=0.0, atol=1e-12
    )
    assert abs(rate[1]) < 1e-9  # deg/h
    assert rate[0] == pytest.approx(level_deg_h, rel=0.0, abs=0.02)  # deg/h
    assert -rate[2] == pytest.approx(up_deg_h, rel=0.0, abs=0.02)  # deg/h
    euler = Rotation.from_euler("ZYX", [result.heading, result.pitch, result.roll])
    assert (euler * C_nb.inv()).magnitude() < 1e-12  # rad
    # Roll and heading know that they are weak here, pitch that it is not.
    steep = np.cos(HALF - abs(result.pitch))
    assert steep > 0.99996
    assert result.pitch_sigma == result.tilt_sigma < 0.02 * DEG
    assert result.roll_sigma > 100.0 * result.tilt_sigma
    assert result.heading_sigma > result.azimuth_sigma


@EACH_LN100
def test_ln100_halves_agree(
    shared_data: Path,
    name: str,
    pitch_deg: float,
    implied_deg: float,
    up_deg_h: float,
    level_deg_h: float,
) -> None:
    """Two windows of one recording differ by noise, not by the 1.4° sigma of a common bias."""
    samples = read(shared_data, name, "FRD")
    turns = []
    for start in (0.0, 150.0):
        result = align_static(*part(samples, start, start + 150.0), *CALGARY, errors=LN100)
        turns.append(Rotation.from_quat(result.q_nb, scalar_first=True))
    off = np.abs((turns[0] * turns[1].inv()).as_rotvec()) / DEG
    # deg: attitudes of 30 s windows scatter by 0.8 about down and 0.0007 about the level axes;
    # the difference of two windows of 150 s by 0.5 and 0.0004; three of these.
    assert off[2] < 1.5
    assert np.all(off[:2] < 0.0015)


def parked(folder: Path) -> tuple[Array, Array, Array]:
    return part(read(folder, "kingston_hg1700_drive.mcap", "RFU"), 5.0, 520.0)


def close_to_facts(result: Alignment) -> None:
    # deg: people in the car, 0.03 between sub-windows
    assert result.roll / DEG == pytest.approx(-0.246, rel=0.0, abs=0.05)
    assert result.pitch / DEG == pytest.approx(-0.339, rel=0.0, abs=0.05)


def test_a_parked_car_by_its_gyros(shared_data: Path) -> None:
    result = align_static(*parked(shared_data), *KINGSTON)
    close_to_facts(result)
    assert result.method == "triad"
    assert result.heading / DEG == pytest.approx(201.0, rel=0.0, abs=2.5)
    assert abs(result.heading - 201.0 * DEG) < result.heading_sigma
    # m/s^2: the recording means 9.80522, normal gravity there is 9.80538
    assert result.specific_force_residual == pytest.approx(-1.6e-4, rel=0.0, abs=2e-5)
    # deg/h: a z-up gyro that reads 2.1 too little reads 2.1 too much about down.
    assert result.rate_residual_down / DEG_H == pytest.approx(2.1, rel=0.0, abs=0.1)
    assert any("about down" in warning for warning in result.warnings)


def test_a_parked_car_with_a_known_heading(shared_data: Path) -> None:
    known = KnownHeading(201.0 * DEG, 1.0 * DEG)
    errors = SensorErrors(gyro_bias=1.5 * DEG_H, accel_bias=1000.0 * UG)
    result = align_static(*parked(shared_data), *KINGSTON, errors=errors, known_heading=known)
    close_to_facts(result)
    assert result.method == "known-heading"
    assert result.heading == pytest.approx(known.heading, rel=0.0, abs=1e-12)
    assert result.warnings == ()


@pytest.mark.parametrize(("start", "stop"), [(480.0, 620.0), (520.0, 640.0), (600.0, 700.0)])
def test_a_driving_car_is_not_still(shared_data: Path, start: float, stop: float) -> None:
    """It turns by 1.5 deg/s on average for two minutes, and is not told that it means degrees."""
    samples = read(shared_data, "kingston_hg1700_drive.mcap", "RFU")
    known = KnownHeading(201.0 * DEG, 1.0 * DEG)
    with pytest.raises(AlignmentError, match="not still"):
        align_static(*part(samples, start, stop), *KINGSTON, known_heading=known)


def test_a_stream_without_gravity_is_recognised(shared_data: Path) -> None:
    samples = read(shared_data, "novatel_oem7_parked.mcap", "FRD", "/gps/imu")
    with pytest.raises(AlignmentError, match="gravity has been removed"):
        check_units_at_rest(samples.gyro.mean(0), samples.accel.mean(0), CALGARY[0])
