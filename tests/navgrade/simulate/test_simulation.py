"""What a scenario says is in the log, read by the official library."""

from __future__ import annotations

import json
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from navgrade.errors import ConfigError
from navgrade.logs import read_imu
from navgrade.simulate import simulation
from navgrade.simulate.imu import imu_increments, imu_rates, true_trajectory
from navgrade.simulate.scenario import read_scenario
from navgrade.simulate.simulation import Simulated, simulate
from tests.navgrade.logs.decoding import (
    SOLUTION_FLOATS,
    by_mcap_ros2_support,
)
from tests.navgrade.logs.decoding import (
    messages_by_mcap_ros2_support as messages,
)
from tests.navgrade.simulate.scenarios import (
    START,
    STILL,
    TURN,
    scenario,
    stamps_ns,
    vectors,
)

DEG = math.pi / 180.0  # rad
START_NS = 1_772_600_767_000_000_000  # 2026-03-04T05:06:07Z
MOUNTED = "lever_arm_m = [1.0, -2.0, 0.5]\nmounting_deg = [5.0, -10.0, 40.0]\n"
HERE = START.replace("12.0", "0.0")
NOISY = """\
jitter_us = 300.0
dropped = 0.2
dropped_spans_s = [[2.0, 2.5]]
grade = "consumer"
seed = 5
"""
GNSS = "[gnss]\nrate_hz = 7.0\nhorizontal_sigma_m = 0.5\nvertical_sigma_m = 2.0\n"

Made = tuple[Simulated, Path]


def made(folder: Path, imu: str = "", rest: str = START + TURN) -> Made:
    path = folder / "log.mcap"
    return simulate(scenario(folder, imu, rest), path), path


def euler_error(q: NDArray[np.float64], expected: NDArray[np.float64]) -> float:
    """Rotation between attitudes, rad."""
    between = (
        Rotation.from_quat(q, scalar_first=True)
        * Rotation.from_quat(expected, scalar_first=True).inv()
    )
    return float(between.magnitude().max())


def test_increments_in_body_axes(tmp_path: Path) -> None:
    """To the last bit those of the motion, interval and all; the stamps are ends."""
    wanted = scenario(tmp_path, MOUNTED)
    result, path = made(tmp_path, MOUNTED)
    rows = messages(path, "/imu/increments")
    n = math.floor(wanted.duration * 100.0)
    assert (len(rows), result.samples, result.lost) == (n, n, 0)
    edges = 0.01 * np.arange(n + 1)
    assert (stamps_ns(rows) - START_NS).tolist() == [10_000_000 * k for k in range(1, n + 1)]
    dtheta, dvel = imu_increments(wanted.imu_motion, np.rint(edges * 1e9) * 1e-9)
    found = vectors(rows, "delta_angle", "delta_velocity")
    np.testing.assert_array_equal(found, np.concatenate([dtheta, dvel], axis=1))
    assert all(m.interval_s == pytest.approx(0.01, rel=1e-12) for m in rows)
    with path.open("rb") as stream:
        reader = make_reader(stream)
        channels = reader.get_summary().channels.values()  # type: ignore[union-attr]
        told = {channel.topic: channel.metadata for channel in channels}
        (attachment,) = reader.iter_attachments()
        (record,) = reader.iter_metadata()
    assert told["/imu/increments"] == {"imu.kind": "increment", "imu.axes": "FRD"}
    assert attachment.data == (tmp_path / "scenario.toml").read_bytes()
    assert (record.name, record.metadata["grade"]) == ("navgrade.simulation", "none")


@pytest.mark.parametrize("axes", ["FLU", "RFU", "x=up y=forward z=left"])
@pytest.mark.parametrize("kind", ["increment", "average", "rate"])
def test_axes_of_choice(tmp_path: Path, kind: str, axes: str) -> None:
    """Read back they are those of the motion; in the file, x, y and z point as was said."""
    text = f'{MOUNTED}kind = "{kind}"\naxes = "{axes}"\ntopic = "/my/imu"\n'
    wanted = scenario(tmp_path, text)
    result, path = made(tmp_path, text)
    assert (result.topic, result.axes) == ("/my/imu", axes)
    samples = read_imu(path)
    assert samples.kind == kind
    edges = np.arange(len(samples) + 1) * 0.01
    gyro, accel = imu_rates(wanted.imu_motion, edges[1:])
    if kind != "rate":
        length = 0.01 if kind == "average" else 1.0
        gyro, accel = (x / length for x in imu_increments(wanted.imu_motion, edges))
    np.testing.assert_allclose(samples.gyro, gyro, rtol=0.0, atol=1e-12)  # rounding of dt
    np.testing.assert_allclose(samples.accel, accel, rtol=0.0, atol=1e-10)
    name = "delta_velocity" if kind == "increment" else "linear_acceleration"
    x, y, z = vectors(messages(path, "/my/imu")[:1], name)[0]
    forward, right, down = accel[0]
    recorded = {
        "FLU": (forward, -right, -down),
        "RFU": (right, forward, -down),
        "x=up y=forward z=left": (-down, forward, -right),
    }
    assert (x, y, z) == pytest.approx(recorded[axes], abs=1e-10)


def test_the_last_interval_is_whole(tmp_path: Path) -> None:
    """4 s at 0.3 s: thirteen samples, the rest of the motion is left."""
    path = tmp_path / "scenario.toml"
    path.write_text(f"[imu]\nrate_hz = {1 / 0.3}\n{HERE}{STILL}")
    result = simulate(read_scenario(path), tmp_path / "log.mcap")
    assert (result.samples, result.duration) == (13, pytest.approx(3.9, abs=1e-9))


def test_truth_is_of_the_imus_point_and_axes(tmp_path: Path) -> None:
    """At stamps of samples, ten a second, the first of them; 2 nm and roundings of degrees."""
    wanted = scenario(tmp_path, MOUNTED)
    result, path = made(tmp_path, MOUNTED)
    columns = by_mcap_ros2_support(path, "/truth/solution", SOLUTION_FLOATS, ["status"])
    t = (columns["stamp_ns"] - START_NS) * 1e-9
    assert len(t) == result.truth
    np.testing.assert_allclose(t, 0.01 + 0.1 * np.arange(len(t)), atol=1e-9)
    nav = true_trajectory(wanted.imu_motion, t)
    np.testing.assert_allclose(columns["latitude_deg"], nav.lat / DEG, rtol=1e-15)
    np.testing.assert_allclose(columns["longitude_deg"], nav.lon / DEG, rtol=1e-15)
    np.testing.assert_array_equal(columns["height_m"], nav.h)
    np.testing.assert_array_equal(columns["v_east_m_s"], nav.v_eb_n[:, 1])
    q = np.stack([columns[f"orientation.{axis}"] for axis in "wxyz"], axis=1)
    assert euler_error(q, nav.q_nb) < 1e-15
    assert result.first.lat == nav.lat[0]
    assert result.distance == pytest.approx(12.0 * result.duration, rel=0.1)


def test_where_the_imu_is_and_points(tmp_path: Path) -> None:
    """Vehicle heading west, IMU 3 m forward, 2 m right, 1 m down: 3 m west, 2 m north, 1 mm."""
    text = "lever_arm_m = [3.0, 2.0, 1.0]\nmounting_deg = [5.0, -10.0, 40.0]\n"
    result, _ = made(tmp_path, text, HERE.replace("310.0", "270.0") + STILL)
    metre = 1.0 / 6_378_137.0  # rad of latitude, to half a percent
    assert (result.first.lat + 41.5 * DEG) / metre == pytest.approx(2.0, rel=5e-3)
    east = (result.first.lon - 174.25 * DEG) * math.cos(41.5 * DEG) / metre
    assert east == pytest.approx(-3.0, rel=5e-3)
    assert result.first.h == pytest.approx(29.0, abs=1e-5)
    vehicle = Rotation.from_euler("ZYX", [270.0, 0.0, 0.0], degrees=True)
    mounting = Rotation.from_euler("ZYX", [40.0, -10.0, 5.0], degrees=True)
    expected = (vehicle * mounting).as_quat(scalar_first=True)
    assert euler_error(result.first.q_nb, expected) < 1e-6  # north turns over three metres


def test_fixes_are_of_the_antenna(tmp_path: Path) -> None:
    """Heading west, the antenna 3 m aft and 2 m up: 3 m east of the vehicle's point, 1 mm."""
    west = HERE.replace("310.0", "270.0")
    text = "[gnss]\nrate_hz = 2.0\nhorizontal_sigma_m = 0\nvertical_sigma_m = 0\n"
    _, path = made(tmp_path, MOUNTED, west + STILL + text + "lever_arm_m = [-3.0, 0.0, -2.0]\n")
    rows = messages(path, "/gnss/fix")
    assert (stamps_ns(rows) - START_NS).tolist() == [500_000_000 * k for k in range(9)]
    metre = 1.0 / (6_378_137.0 * math.cos(41.5 * DEG) * DEG)  # deg of longitude, to 0.2 %
    for m in rows:
        assert m.longitude - 174.25 == pytest.approx(3.0 * metre, rel=3e-3)
        assert m.latitude == pytest.approx(-41.5, abs=1e-9)
        assert m.altitude == pytest.approx(32.0, abs=1e-3)
        assert (m.status.status, m.position_covariance_type) == (0, 2)


def test_fixes_scatter_as_their_covariance_says(tmp_path: Path) -> None:
    """2000 fixes, each axis within 5 sigma of its own scatter."""
    text = GNSS.replace("7.0", "500.0")
    _, path = made(tmp_path, rest=HERE + STILL + text)
    rows = messages(path, "/gnss/fix")
    metre = DEG * 6_378_137.0  # of a degree; the radii are within half a percent
    north = np.array([m.latitude + 41.5 for m in rows]) * metre
    east = np.array([m.longitude - 174.25 for m in rows]) * metre * math.cos(41.5 * DEG)
    up = np.array([m.altitude - 30.0 for m in rows])
    assert len(rows) == 2001
    for values, sigma in ((north, 0.5), (east, 0.5), (up, 2.0)):
        assert values.std() == pytest.approx(sigma, rel=5.0 / math.sqrt(4000.0) + 0.01)
        assert abs(values.mean()) < 5.0 * sigma / math.sqrt(2000.0)
    assert abs(np.corrcoef(north, east)[0, 1]) < 0.12
    assert rows[0].position_covariance[0] == 0.25
    assert rows[0].position_covariance[8] == 4.0


def test_jitter_moves_the_ends_of_the_intervals(tmp_path: Path) -> None:
    """Stamps scatter by it about their ticks, and increments are those between them."""
    wanted = scenario(tmp_path, "jitter_us = 300.0")
    _, path = made(tmp_path, "jitter_us = 300.0")
    rows = messages(path, "/imu/increments")
    stamps = stamps_ns(rows) - START_NS
    off = stamps - 10_000_000 * np.arange(1, len(rows) + 1)
    assert off.std() == pytest.approx(300_000, rel=5.0 / math.sqrt(2.0 * len(rows)))
    edges = np.concatenate([[0], stamps]) * 1e-9
    dtheta, _ = imu_increments(wanted.imu_motion, edges)
    np.testing.assert_allclose(vectors(rows, "delta_angle"), dtheta, rtol=0.0, atol=1e-16)
    np.testing.assert_allclose([m.interval_s for m in rows], np.diff(edges), atol=1e-15)


def test_lost_spans(tmp_path: Path) -> None:
    """After their start, up to and with their end."""
    _, path = made(tmp_path, "dropped_spans_s = [[2.0, 2.5], [7.005, 7.015]]\n")
    stamps = stamps_ns(messages(path, "/imu/increments")) - START_NS
    ticks = np.arange(1, 1 + (stamps[-1] // 10_000_000))
    missing = set(ticks.tolist()) - set((stamps // 10_000_000).tolist())
    assert missing == {*range(201, 251), 701}


def test_lost_messages(tmp_path: Path) -> None:
    """One in five, and all in the span; the others are those of a log without losses."""
    _, whole_path = made(tmp_path, 'grade = "industrial"\n')
    whole = messages(whole_path, "/imu/increments")
    whole_path.unlink()
    text = 'grade = "industrial"\ndropped = 0.2\ndropped_spans_s = [[2.0, 2.5]]\n'
    result, path = made(tmp_path, text)
    rows = messages(path, "/imu/increments")
    lost = set(stamps_ns(whole)) - set(stamps_ns(rows))
    assert result.lost == len(lost) == len(whole) - len(rows)
    span = {START_NS + 2_000_000_000 + 10_000_000 * k for k in range(1, 51)}
    assert span <= lost
    others = len(whole) - 50
    assert len(lost - span) == pytest.approx(0.2 * others, abs=5.0 * math.sqrt(0.16 * others))
    arrived = np.isin(stamps_ns(whole), stamps_ns(rows))
    names = "delta_angle", "delta_velocity"
    np.testing.assert_array_equal(vectors(rows, *names), vectors(whole, *names)[arrived])
    assert all(m.interval_s == pytest.approx(0.01, rel=1e-12) for m in rows)


@pytest.mark.parametrize("kind", ["increment", "average", "rate"])
def test_a_log_does_not_depend_on_its_blocks(
    tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit, with everything random switched on."""
    text, rest = NOISY + f'kind = "{kind}"\n', START + TURN + GNSS
    found = []
    for size in (16_384, 97):
        monkeypatch.setattr(simulation, "_BLOCK", size)
        result, path = made(tmp_path, text, rest)
        with path.open("rb") as stream:
            rows = [
                (channel.topic, message.log_time, message.data)
                for _, channel, message in make_reader(stream).iter_messages()
            ]
        found.append((rows, result.distance, result.samples))
        path.unlink()
    (first, far, count), (second, far_too, count_too) = found
    assert first == second
    assert (far_too, count_too) == (pytest.approx(far, rel=1e-12), count)
    assert all(a[1] <= b[1] for a, b in pairwise(first)), "in the order of log time"


def test_seeds(tmp_path: Path) -> None:
    logs = []
    for seed in (5, 5, 6):
        result = simulate(
            scenario(tmp_path, NOISY).with_seed(seed), tmp_path / "log.mcap", overwrite=True
        )
        logs.append((result.output.read_bytes(), result.errors.gyro.bias.tolist()))
    assert logs[0] == logs[1]
    assert logs[0] != logs[2]


def test_errors_are_told(tmp_path: Path) -> None:
    result, path = made(tmp_path, NOISY)
    with path.open("rb") as stream:
        (record,) = make_reader(stream).iter_metadata()
    told = json.loads(record.metadata["errors"])
    assert record.metadata["grade"] == "consumer"
    assert told["gyro"]["bias"] == result.errors.gyro.bias.tolist()
    assert told["accel"]["white"] == result.errors.accel.white
    assert "bias_sigma" not in told["gyro"]


def test_what_no_imu_measures_is_told(tmp_path: Path) -> None:
    spin = """\
[[segment]]
type = "rotate"
axis = "heading"
angle_deg = 9000.0
rate_deg_s = 3000.0
[[vibration]]
type = "translation"
acceleration_m_s2 = 600.0
frequency_hz = 40.0
"""
    result, _ = made(tmp_path, rest=HERE + spin)
    rate, force = result.warnings
    assert "angular rate reaches 3000 °/s at " in rate
    assert "up to about 2000 °/s" in rate
    assert "specific force reaches 6" in force
    assert "up to about 50 g" in force
    assert made(tmp_path / "..", rest=HERE + STILL)[0].warnings == ()


def test_outputs_that_must_not_be(tmp_path: Path) -> None:
    wanted = scenario(tmp_path)
    with pytest.raises(ConfigError, match=r"does not end in \.mcap"):
        simulate(wanted, tmp_path / "log.bag")
    (tmp_path / "log.mcap").write_bytes(b"precious")
    with pytest.raises(ConfigError, match="exists"):
        simulate(wanted, tmp_path / "log.mcap")
    assert (tmp_path / "log.mcap").read_bytes() == b"precious"
    with pytest.raises(ConfigError, match=r"imu\.topic: the topic /truth/solution"):
        simulate(scenario(tmp_path, 'topic = "/truth/solution"'), tmp_path / "new.mcap")
    with pytest.raises(ConfigError, match="every message of the IMU would be lost"):
        lost = scenario(tmp_path, "dropped_spans_s = [[0, 4]]", HERE + STILL)
        simulate(lost, tmp_path / "new.mcap")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.mcap", "scenario.toml"]
