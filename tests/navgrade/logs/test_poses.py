"""Odometry, transforms and Foxglove's fixes place the body as ROS means it.

The truth goes another way than the code: positions and axes of the map in 120 digits, attitudes
from their angles with SciPy, rates from motions whose rate is known.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import Message
from mcap.stream_reader import StreamReader
from mpmath import mp, mpf
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from navgrade import Trajectory
from navgrade.logs import SolutionWriter
from tests.navgrade.logmaking import EPOCH_NS
from tests.navgrade.logs.decoding import (
    DECODERS,
    LOCATION,
    MESSAGES,
    ODOMETRY,
    ODOMETRY_FLOATS,
    TRANSFORMS,
    Columns,
    Decoder,
    by_mcap_ros2_support,
    fixes,
    solution,
)
from tests.oracles import high_precision

Array = NDArray[np.float64]

TRANSFORM_FLOATS = tuple(
    f"transforms.0.transform.{path}.{axis}"
    for path, axes in (("translation", "xyz"), ("rotation", "xyzw"))
    for axis in axes
)
LOCATION_FLOATS = (
    *("latitude", "longitude", "altitude", "heading", "heading_variance"),
    *("velocity_x", "velocity_y", "velocity_z"),
)
FLU_TO_FRD = Rotation.from_quat([1.0, 0.0, 0.0, 0.0])  # half a turn about forward


def scalar_first(rotation: Rotation) -> Array:
    return np.roll(rotation.as_quat(), 1, axis=-1)


def a_flight(count: int = 600, rate_hz: float = 100.0) -> tuple[Trajectory, Rotation]:
    """Turning in every axis, thirty kilometres away from where it began; and its C_nb."""
    t = np.arange(count) / rate_hz
    angles = np.stack([2.0 - 0.9 * t, 0.4 + 0.3 * np.sin(t), 0.5 + 1.1 * np.sin(0.7 * t)], axis=1)
    C_nb = Rotation.from_euler("ZYX", angles)
    nav = Trajectory(
        t=t,
        lat=-0.7 + 0.003 * np.sin(0.5 * t),
        lon=2.9 + 0.004 * np.sin(0.3 * t),
        h=1200.0 + 900.0 * np.sin(0.4 * t),
        v_eb_n=np.stack([100.0 * np.cos(t), 80.0 * np.sin(2.0 * t), 5.0 * np.cos(3.0 * t)], axis=1),
        q_nb=scalar_first(C_nb),
        status=np.zeros(count, np.uint32),
        epoch_ns=EPOCH_NS,
    )
    return nav, C_nb


def written(path: Path, nav: Trajectory, *, block: int = 10**6, **options: Any) -> Path:
    with SolutionWriter(path, **options) as out:
        for start in range(0, len(nav), block):
            out.write(nav[start : start + block])
    return path


def messages(path: Path) -> list[Message]:
    """All messages, as they stand in the file."""
    with path.open("rb") as stream:
        return [r for r in StreamReader(stream).records if isinstance(r, Message)]


def vectors(columns: Columns, path: str, axes: str = "xyz") -> Array:
    return np.stack([columns[f"{path}.{axis}"] for axis in axes], axis=1)


def odometry(path: Path, decoder: Decoder = by_mcap_ros2_support) -> Columns:
    return decoder(path, ODOMETRY, ODOMETRY_FLOATS, ())


def rows_of(columns: Columns, nav: Trajectory) -> NDArray[np.intp]:
    """Rows of the solution the stamps belong to."""
    stamp_ns = EPOCH_NS + np.rint(nav.t * 1e9).astype(np.int64)
    rows = np.searchsorted(stamp_ns, columns["stamp_ns"])
    assert np.array_equal(stamp_ns[rows], columns["stamp_ns"])
    return rows


def matrix(C: mp.matrix) -> Array:
    return np.array([[float(C[i, j]) for j in range(C.cols)] for i in range(C.rows)])


def in_the_map(nav: Trajectory, row: int) -> tuple[Array, Rotation]:
    """Position and C_en of a row from the map's origin, east, north and up."""
    places = [[mpf(float(x[k])) for x in (nav.lat, nav.lon, nav.h)] for k in (0, row)]
    (lat, lon, _), (row_lat, row_lon, _) = places
    enu = mp.matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    to_map = enu * high_precision.C_en(lat, lon).T
    away = high_precision.ecef(*places[1]) - high_precision.ecef(*places[0])
    C_mn = to_map * high_precision.C_en(row_lat, row_lon)
    return matrix(to_map * away)[:, 0], Rotation.from_matrix(matrix(C_mn))


@pytest.mark.parametrize("decoder", DECODERS)
def test_poses_are_in_a_plane_that_touches_the_earth_at_the_start(
    tmp_path: Path, decoder: str
) -> None:
    nav, C_nb = a_flight()
    path = written(tmp_path / "nav.mcap", nav)
    found = odometry(path, DECODERS[decoder])
    transforms = DECODERS[decoder](
        path, TRANSFORMS, TRANSFORM_FLOATS, (), stamp="transforms.0.header.stamp"
    )
    assert np.array_equal(transforms["stamp_ns"], found["stamp_ns"])
    position = vectors(found, "pose.pose.position")
    q = vectors(found, "pose.pose.orientation", "xyzw")
    assert np.array_equal(vectors(transforms, "transforms.0.transform.translation"), position)
    assert np.array_equal(vectors(transforms, "transforms.0.transform.rotation", "xyzw"), q)
    assert np.abs(position).max() > 10_000.0
    rows = rows_of(found, nav)
    assert len(rows) > 50
    for k, row in enumerate(rows.tolist()):
        wanted, C_mn = in_the_map(nav, row)
        # two positions of 6.4e6 m, each rounded to half a nanometre a few times
        np.testing.assert_allclose(position[k], wanted, rtol=0, atol=1e-8)
        error = (C_mn * C_nb[row] * FLU_TO_FRD).inv() * Rotation.from_quat(q[k])
        assert error.magnitude() < 1e-14  # rad; three products of rotations rounded to 1e-16


def test_a_level_body_that_heads_north_points_along_y_of_the_map(tmp_path: Path) -> None:
    """REP-103: x east, y north, z up, and yaw is counted from east counterclockwise."""
    t = np.arange(30) / 10.0
    level = Trajectory(
        t=t,
        lat=np.full(30, 0.8),
        lon=np.full(30, -1.2),
        h=np.full(30, 50.0),
        v_eb_n=np.tile([3.0, 0.0, -1.0], (30, 1)),
        q_nb=np.tile([1.0, 0.0, 0.0, 0.0], (30, 1)),
        status=np.zeros(30, np.uint32),
        epoch_ns=EPOCH_NS,
    )
    found = odometry(written(tmp_path / "nav.mcap", level))
    body = Rotation.from_quat(vectors(found, "pose.pose.orientation", "xyzw")[-1])
    np.testing.assert_allclose(body.apply([1.0, 0.0, 0.0]), [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(body.apply([0.0, 1.0, 0.0]), [-1.0, 0.0, 0.0], atol=1e-15)
    yaw, pitch, roll = body.as_euler("ZYX")
    assert (yaw, pitch, roll) == pytest.approx((math.pi / 2, 0.0, 0.0), abs=1e-15)
    # forward 3 m/s, and 1 m/s of climb is up
    np.testing.assert_array_equal(vectors(found, "twist.twist.linear")[-1], [3.0, 0.0, 1.0])


def test_velocity_is_in_the_body(tmp_path: Path) -> None:
    nav, C_nb = a_flight()
    found = odometry(written(tmp_path / "nav.mcap", nav))
    rows = rows_of(found, nav)
    wanted = (C_nb * FLU_TO_FRD)[rows].inv().apply(nav.v_eb_n[rows])
    # 130 m/s: 1 ulp is 3e-14
    np.testing.assert_allclose(vectors(found, "twist.twist.linear"), wanted, rtol=0, atol=1e-13)


def test_a_steady_turn_over_one_place_has_its_rate(tmp_path: Path) -> None:
    """Forward, right, down in; forward, left, up out."""
    omega = np.array([0.3, -0.5, 0.7])  # rad/s
    t = np.cumsum(np.random.default_rng(1).uniform(5e-3, 15e-3, 500))
    C_nb = Rotation.from_rotvec([0.4, 0.2, -1.0]) * Rotation.from_rotvec(t[:, None] * omega)
    nav = Trajectory(
        t=t,
        lat=np.full(500, 0.9),
        lon=np.full(500, 0.3),
        h=np.zeros(500),
        v_eb_n=np.zeros((500, 3)),
        q_nb=scalar_first(C_nb),
        status=np.zeros(500, np.uint32),
        epoch_ns=EPOCH_NS,
    )
    rate = vectors(odometry(written(tmp_path / "nav.mcap", nav)), "twist.twist.angular")
    assert len(rate) > 40
    # attitudes are rounded to some 1e-16, 5 ms apart: 1e-13 rad/s
    np.testing.assert_allclose(rate, np.tile([0.3, 0.5, -0.7], (len(rate), 1)), rtol=0, atol=1e-12)


def test_rates_are_relative_to_the_earth_not_to_the_local_level(tmp_path: Path) -> None:
    """Level and heading north along a meridian, the body turns with the vertical."""
    t = np.arange(200) / 20.0
    nav = Trajectory(
        t=t,
        lat=0.6 + 1e-3 * t,
        lon=np.full(200, 0.3),
        h=np.zeros(200),
        v_eb_n=np.zeros((200, 3)),
        q_nb=np.tile([1.0, 0.0, 0.0, 0.0], (200, 1)),
        status=np.zeros(200, np.uint32),
        epoch_ns=EPOCH_NS,
    )
    rate = vectors(odometry(written(tmp_path / "nav.mcap", nav)), "twist.twist.angular")
    # nose down, which is positive about left; attitudes rounded to 1e-16, 50 ms apart
    np.testing.assert_allclose(rate, np.tile([0.0, 1e-3, 0.0], (len(rate), 1)), rtol=0, atol=1e-13)


def test_the_rate_is_the_mean_over_the_last_interval(tmp_path: Path) -> None:
    """Whatever the rate of the poses and the ends of the blocks."""
    nav, C_nb = a_flight()
    paths = [
        written(tmp_path / f"{block}.mcap", nav, block=block, pose_rate_hz=40.0)
        for block in (1, 7, 600)
    ]
    found = odometry(paths[-1])
    rows = rows_of(found, nav)
    C_mb = Rotation.concatenate([in_the_map(nav, row)[1] * C_nb[row] for row in range(len(nav))])
    turned = (C_mb[rows - 1].inv() * C_mb[rows]).as_rotvec()
    wanted = FLU_TO_FRD.apply(turned / np.diff(nav.t, prepend=np.nan)[rows, None])
    # attitudes rounded to a few 1e-16, 10 ms apart
    np.testing.assert_allclose(vectors(found, "twist.twist.angular"), wanted, rtol=0, atol=1e-12)
    assert rows[0] == 1  # the first solution ends no interval
    for path in paths[:-1]:
        assert messages(path) == messages(paths[-1])


@pytest.mark.parametrize("decoder", MESSAGES)
def test_frames_have_the_names_of_ros(tmp_path: Path, decoder: str) -> None:
    """And covariances are zero, which says that they are not known."""
    path = written(tmp_path / "nav.mcap", a_flight()[0], location_fix=True)
    for message in MESSAGES[decoder](path, ODOMETRY):
        assert (message.header.frame_id, message.child_frame_id) == ("map", "base_link")
        assert list(message.pose.covariance) == list(message.twist.covariance) == [0.0] * 36
    for message in MESSAGES[decoder](path, TRANSFORMS):
        (transform,) = message.transforms
        assert (transform.header.frame_id, transform.child_frame_id) == ("map", "base_link")
    for message in MESSAGES[decoder](path, LOCATION):
        assert message.frame_id == "base_link"
        assert list(message.position_covariance) == [0.0] * 9
        assert message.position_covariance_type == 0


@pytest.mark.parametrize(("rate_hz", "count"), [(0.0, 0), (1.0, 6), (50.0, 300), (1000.0, 599)])
def test_poses_come_at_the_rate_asked_for(tmp_path: Path, rate_hz: float, count: int) -> None:
    nav, _ = a_flight()
    path = written(tmp_path / "nav.mcap", nav, pose_rate_hz=rate_hz)
    assert len(solution(path)["stamp_ns"]) == len(nav)
    for topic in (ODOMETRY, TRANSFORMS):
        assert len(MESSAGES["mcap-ros2-support"](path, topic)) == count


@pytest.mark.parametrize("decoder", DECODERS)
def test_foxgloves_fix_has_heading_and_velocity(tmp_path: Path, decoder: str) -> None:
    nav, _ = a_flight()
    path = written(tmp_path / "nav.mcap", nav, location_fix=True)
    found = DECODERS[decoder](path, LOCATION, LOCATION_FLOATS, (), stamp="timestamp")
    fix = fixes(path)
    for name in ("latitude", "longitude", "altitude", "stamp_ns"):
        assert found[name].tobytes() == fix[name].tobytes()
    rows = rows_of(found, nav)
    heading = (2.0 - 0.9 * nav.t[rows]) % (2.0 * math.pi)  # the first angle of the flight
    np.testing.assert_allclose(found["heading"], heading, rtol=0, atol=1e-14)
    assert np.all(np.isnan(found["heading_variance"]))
    north, east, down = nav.v_eb_n[rows].T
    assert np.array_equal(found["velocity_x"], east)
    assert np.array_equal(found["velocity_y"], north)
    assert np.array_equal(found["velocity_z"], -down)


def test_foxgloves_fix_is_left_out_unless_asked_for(tmp_path: Path) -> None:
    path = written(tmp_path / "nav.mcap", a_flight()[0])
    assert MESSAGES["mcap-ros2-support"](path, LOCATION) == []
