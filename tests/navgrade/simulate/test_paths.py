"""Paths are read as they were written, and refused where they are not what they seem."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navgrade import Trajectory, write_solution
from navgrade.errors import ConfigError, LogError
from navgrade.simulate.paths import read_csv, read_geojson, read_log
from tests.navgrade.logmaking import EPOCH_NS, write_log
from tests.navgrade.logs.vendors import vendor_channel

DEG = math.pi / 180.0  # rad
POINTS = "48.1,11.5,500.5\n48.2,11.6,501.0\n48.3,11.7,502.0\n"
LINE = [[11.5, 48.1], [11.6, 48.2], [11.7, 48.25]]


def table(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "path.csv"
    path.write_text(text)
    return path


def drawn(tmp_path: Path, content: Any) -> Path:
    path = tmp_path / "path.geojson"
    path.write_text(json.dumps(content))
    return path


# ---- CSV ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "header",
    [
        "latitude_deg,longitude_deg,height_m",
        "lat_deg,lon_deg,h_m",
        " lat , lon , height_m ",
        "\ufefflatitude,longitude,height_m",
    ],
)
def test_names_of_columns(tmp_path: Path, header: str) -> None:
    found = read_csv(table(tmp_path, f"{header}\n{POINTS}\n"))
    np.testing.assert_allclose(found.lat / DEG, [48.1, 48.2, 48.3], rtol=1e-15)
    np.testing.assert_allclose(found.lon / DEG, [11.5, 11.6, 11.7], rtol=1e-15)
    assert found.h is not None
    assert found.h.tolist() == [500.5, 501.0, 502.0]
    assert (found.t, found.time_ns, found.q_nb, len(found)) == (None, None, None, 3)


@pytest.mark.parametrize(
    ("name", "cells", "first_ns"),
    [
        ("time_s", ("10.5", "11.0", "13.0"), None),
        ("unix_s", ("1767225600.5", "1767225601.0", "1767225603.0"), 1_767_225_600_500_000_000),
        (
            "time_ns",
            ("1767225600123456789", "1767225600623456789", "1767225602623456789"),
            1_767_225_600_123_456_789,
        ),
        (
            "time",
            ("2026-01-01T00:00:00.25Z", "2026-01-01T00:00:00.75Z", "2026-01-01T01:00:02.75+01:00"),
            1_767_225_600_250_000_000,
        ),
    ],
)
def test_times(tmp_path: Path, name: str, cells: tuple[str, ...], first_ns: int | None) -> None:
    rows = [f"{cell},{row}" for cell, row in zip(cells, POINTS.splitlines(), strict=True)]
    found = read_csv(table(tmp_path, "\n".join([f"{name},lat_deg,lon_deg,h_m", *rows])))
    assert found.t is not None
    assert found.t.tolist() == [0.0, 0.5, 2.5]
    assert found.time_ns == first_ns


def test_attitudes(tmp_path: Path) -> None:
    """Against scipy's intrinsic z, y, x angles."""
    head = "lat_deg,lon_deg,h_m"
    angles = np.array([[10.0, -20.0, 300.0], [-5.0, 3.0, 12.0], [0.5, 60.0, 181.0]])
    expected = Rotation.from_euler("ZYX", angles[:, ::-1], degrees=True)
    rows = [
        f"{row},{roll},{pitch},{heading}"
        for row, (roll, pitch, heading) in zip(POINTS.splitlines(), angles, strict=True)
    ]
    euler = read_csv(
        table(tmp_path, "\n".join([f"{head},roll_deg,pitch_deg,heading_deg", *rows]))
    ).q_nb
    rows = [
        ",".join([row, *(f"{x:.17g}" for x in q)])
        for row, q in zip(POINTS.splitlines(), expected.as_quat(scalar_first=True), strict=True)
    ]
    quaternion = read_csv(table(tmp_path, "\n".join([f"{head},qw,qx,qy,qz", *rows]))).q_nb
    for q in (euler, quaternion):
        assert q is not None
        between = Rotation.from_quat(q, scalar_first=True) * expected.inv()
        assert between.magnitude().max() < 1e-15


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("", ("no column latitude_deg", "the columns are none")),
        ("x,lon\n1,2\n", ("no column latitude_deg (or lat_deg, latitude, lat)", "x, lon")),
        ("lat,y\n1,2\n", ("no column longitude_deg", "lat, y")),
        ("lat,lon,roll_deg\n1,2,3\n", ("no column pitch_deg", "lat, lon, roll_deg")),
        ("lat,lon\n1,2\n1,2,3\n", ("line 3 has 3 cells, the header 2",)),
        ("lat,lon\n1,2\n\n1,east\n", ("line 4: lon is 'east', not a finite number",)),
        ("lat,lon\n1,nan\n", ("line 2: lon is 'nan'",)),
        ("lat,lon\n1,2\n95,2\n", ("line 3 has the latitude 95, beyond ±90°",)),
        ("lat,lon,time\n1,2,noon\n", ("line 2: 'noon' is not a time",)),
        ("lat,lon,time_ns\n1,2,1.5\n", ("whole nanoseconds",)),
        ("lat,lon,qw,qx,qy,qz\n1,2,1,1,0,0\n", ("line 2: the quaternion has the norm 1.41421",)),
    ],
)
def test_wrong_tables(tmp_path: Path, text: str, facts: tuple[str, ...]) -> None:
    with pytest.raises(ConfigError) as caught:
        read_csv(table(tmp_path, text))
    for fact in (str(tmp_path), *facts):
        assert fact in str(caught.value)


def test_missing_files(tmp_path: Path) -> None:
    for read, name in ((read_csv, "no.csv"), (read_geojson, "no.geojson")):
        with pytest.raises(ConfigError, match="no such path file"):
            read(tmp_path / name)


# ---- GeoJSON -----------------------------------------------------------------------------------


def geometry(points: Any = LINE) -> dict[str, Any]:
    return {"type": "LineString", "coordinates": points}


def feature(points: Any = LINE) -> dict[str, Any]:
    return {"type": "Feature", "properties": {}, "geometry": geometry(points)}


def collection(*features: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features)}


@pytest.mark.parametrize("content", [geometry(), feature(), collection(feature())])
def test_every_wrapping(tmp_path: Path, content: Any) -> None:
    found = read_geojson(drawn(tmp_path, content))
    np.testing.assert_allclose(found.lon / DEG, [11.5, 11.6, 11.7], rtol=1e-15)
    np.testing.assert_allclose(found.lat / DEG, [48.1, 48.2, 48.25], rtol=1e-15)
    assert (found.h, found.t) == (None, None)


def test_a_point_beside_the_line_is_left_alone(tmp_path: Path) -> None:
    beside = {"type": "Feature", "geometry": {"type": "Point", "coordinates": [0.0, 0.0]}}
    assert len(read_geojson(drawn(tmp_path, collection(beside, feature())))) == 3


def test_heights_only_where_every_point_has_one(tmp_path: Path) -> None:
    high = [[*point, 100.0 + k] for k, point in enumerate(LINE)]
    found = read_geojson(drawn(tmp_path, feature(high))).h
    assert found is not None
    assert found.tolist() == [100.0, 101.0, 102.0]
    assert read_geojson(drawn(tmp_path, feature([*high[:2], LINE[2]]))).h is None


@pytest.mark.parametrize(
    ("content", "fact"),
    [
        (collection(), "holds 0 LineStrings, one is needed; it has nothing"),
        (collection(feature(), feature()), "holds 2 LineStrings"),
        ({"type": "Point", "coordinates": [1.0, 2.0]}, "it has Point"),
        ([1, 2], "it has nothing"),
        (feature([[11.5, 48.1], [48.2, 111.6]]), "point 2 has the latitude 111.6"),
        (feature([[11.5, 48.1], [48.2, 111.6]]), "GeoJSON is longitude first"),
        (feature([[11.5]]), "point 1 is [11.5], not [longitude, latitude, height]"),
        (feature([[11.5, "48"]]), "point 1 is [11.5, '48']"),
        (feature("none"), "has no coordinates"),
    ],
)
def test_wrong_drawings(tmp_path: Path, content: Any, fact: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_geojson(drawn(tmp_path, content))
    assert fact in str(caught.value)


def test_what_is_no_json(tmp_path: Path) -> None:
    path = tmp_path / "path.geojson"
    path.write_text("{")
    with pytest.raises(ConfigError, match="cannot be read as GeoJSON"):
        read_geojson(path)


# ---- logs --------------------------------------------------------------------------------------

COUNT = 20
T = 0.5 * np.arange(COUNT)
LAT = (-12.0 + 1e-4 * T) * DEG
LON = (130.0 - 2e-4 * T) * DEG
H = 40.0 + T
EULER_DEG = np.stack([3.0 * np.sin(T), 2.0 * np.cos(T), 10.0 * T + 100.0], axis=1)
Q = Rotation.from_euler("ZYX", EULER_DEG[:, ::-1], degrees=True).as_quat(scalar_first=True)


def solution() -> Trajectory:
    v = np.zeros((COUNT, 3))
    return Trajectory(T, LAT, LON, H, v, Q, np.zeros(COUNT, np.uint32), EPOCH_NS)


def fixes(tmp_path: Path, status: list[int]) -> Path:
    stamps = EPOCH_NS + (T * 1e9).astype(np.int64)
    stamps[5] = stamps[4]
    rows = [
        {
            "header.stamp": int(stamps[k]),
            "status.status": status[k],
            "latitude": LAT[k] / DEG,
            "longitude": LON[k] / DEG,
            "altitude": H[k],
        }
        for k in range(COUNT)
    ]
    channel = vendor_channel("/fix", "sensor_msgs/msg/NavSatFix", rows, stamps)
    return write_log(tmp_path / "log.mcap", channel)


def test_our_solution(tmp_path: Path) -> None:
    write_solution(tmp_path / "nav.mcap", solution())
    found = read_log(tmp_path / "nav.mcap", "/navgrade/solution")
    np.testing.assert_allclose(found.lat, LAT, rtol=1e-15)
    np.testing.assert_allclose(found.lon, LON, rtol=1e-15)
    assert found.h is not None
    assert found.t is not None
    assert found.q_nb is not None
    assert found.h.tolist() == H.tolist()
    np.testing.assert_allclose(found.t, T, rtol=1e-15)
    assert found.time_ns == EPOCH_NS
    between = (
        Rotation.from_quat(found.q_nb, scalar_first=True)
        * Rotation.from_quat(Q, scalar_first=True).inv()
    )
    assert between.magnitude().max() < 1e-14
    assert found.notes == ()


def test_odometry_by_its_map(tmp_path: Path) -> None:
    """The map of a solution has its origin at its first row; back to it within 10 nm, 1e-14 rad."""
    write_solution(tmp_path / "nav.mcap", solution())
    found = read_log(
        tmp_path / "nav.mcap",
        "/navgrade/odometry",
        frame="map",
        child="base_link",
        origin=(float(LAT[0]), float(LON[0]), float(H[0])),
    )
    rows = slice(1, None)  # the first has no pose
    radius = 6.4e6  # m
    assert np.abs(found.lat - LAT[rows]).max() * radius < 1e-8
    assert np.abs(found.lon - LON[rows]).max() * radius < 1e-8
    assert found.h is not None
    assert np.abs(found.h - H[rows]).max() < 1e-8
    assert found.q_nb is not None
    between = (
        Rotation.from_quat(found.q_nb, scalar_first=True)
        * Rotation.from_quat(Q[rows], scalar_first=True).inv()
    )
    assert between.magnitude().max() < 1e-14


def test_poses_ask_for_their_frames(tmp_path: Path) -> None:
    path = tmp_path / "nav.mcap"
    write_solution(path, solution())
    with pytest.raises(ConfigError, match=r"frame map, child base_link.*say path\.frame"):
        read_log(path, "/navgrade/odometry")
    with pytest.raises(ConfigError, match="say where it has its origin"):
        read_log(path, "/navgrade/odometry", frame="map", child="base_link")


def test_fixes_that_are_none_are_left_out_and_told(tmp_path: Path) -> None:
    status = [0] * COUNT
    status[2] = status[9] = -1
    found = read_log(fixes(tmp_path, status), "/fix")
    assert len(found) == COUNT - 3
    assert found.notes == (
        "2 of 20 messages hold no valid position and were left out",
        "1 messages of a time already seen were left out",
    )
    with pytest.raises(LogError, match="no message holds a valid position"):
        read_log(fixes(tmp_path, [-1] * COUNT), "/fix")


def test_heights_above_the_sea_are_raised_by_what_is_told(tmp_path: Path) -> None:
    path = fixes(tmp_path, [0] * COUNT)
    plain, raised = read_log(path, "/fix"), read_log(path, "/fix", geoid_height=45.5)
    assert plain.h is not None
    assert raised.h is not None
    np.testing.assert_allclose(raised.h, plain.h + 45.5, rtol=1e-15)
    rows = [{"timestamp": k * 500_000, "fix_type": 3, "latitude_deg": 1.0} for k in range(COUNT)]
    stamps = EPOCH_NS + (T * 1e9).astype(np.int64)
    log = write_log(
        tmp_path / "px4.mcap", vendor_channel("/gps", "px4_msgs/msg/SensorGps", rows, stamps)
    )
    with pytest.raises(ConfigError, match=r"leave path\.geoid_height_m out"):
        read_log(log, "/gps", geoid_height=45.5)


def test_a_topic_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="/nothing"):
        read_log(fixes(tmp_path, [0] * COUNT), "/nothing")
