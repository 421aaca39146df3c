"""Heights come out of a log as they went in; the messages are made by other people's software."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore

from navgrade.errors import ConfigError, LogError, SchemaError
from navgrade.logs import Heights, read_heights
from navgrade.logs.schemas import HEIGHT_SCHEMAS
from navgrade.vertical import BaroLoop
from tests.navgrade.logmaking import (
    EPOCH_NS,
    Channel,
    damage_chunk,
    imu_channel,
    random_recording,
    text_channel,
    write_log,
)

ROS = get_typestore(Stores.ROS2_HUMBLE)
PRESSURE = "sensor_msgs/msg/FluidPressure"
FLOAT64 = "std_msgs/msg/Float64"
FLOAT32 = "std_msgs/msg/Float32"
POSE = "geometry_msgs/msg/PoseStamped"
FIX = "sensor_msgs/msg/NavSatFix"
COUNT = 300
# 25 Hz with jitter, and as many digits as nanoseconds have
STAMPS = (
    EPOCH_NS + np.arange(COUNT) * 40_000_000 + np.random.default_rng(3).integers(0, 999_999, COUNT)
)
RECORDED = STAMPS + 7_654_321  # 8 ms later
VALUES = 99_000.0 + 500.0 * np.random.default_rng(4).standard_normal(COUNT)


def header(stamp_ns: int, frame_id: str = "baro") -> Any:
    """A std_msgs/Header."""
    time = ROS.types["builtin_interfaces/msg/Time"](*divmod(int(stamp_ns), 1_000_000_000))
    return ROS.types["std_msgs/msg/Header"](time, frame_id)


def message(schema: str, stamp_ns: int, value: float, frame_id: str) -> Any:
    """A message with a value in the member that is a height or a pressure."""
    types = ROS.types
    if schema == PRESSURE:
        return types[PRESSURE](header(stamp_ns, frame_id), value, 0.0)
    if schema in (FLOAT64, FLOAT32):
        return types[schema](value)
    if schema == POSE:
        point = types["geometry_msgs/msg/Point"](1.0, 2.0, value)
        turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        pose = types["geometry_msgs/msg/Pose"](point, turn)
        return types[POSE](header(stamp_ns, frame_id), pose)
    status = types["sensor_msgs/msg/NavSatStatus"](0, 1)
    return types[FIX](header(stamp_ns, frame_id), status, 45.0, 8.0, value, np.zeros(9), 0)


def channel(
    schema: str = PRESSURE,
    values: NDArray[np.float64] = VALUES,
    stamps: NDArray[np.int64] = STAMPS,
    *,
    topic: str = "/baro",
    log_ns: NDArray[np.int64] | None = None,
    frame_ids: Sequence[str] = ("baro",),
) -> Channel:
    """A topic as a ROS 2 recorder would have written it."""
    messages = [
        bytes(ROS.serialize_cdr(message(schema, ns, v, frame_ids[k % len(frame_ids)]), schema))
        for k, (ns, v) in enumerate(zip(stamps.tolist(), values.tolist(), strict=True))
    ]
    text = ROS.generate_msgdef(schema, ros_version=2)[0]
    log = RECORDED[: len(stamps)] if log_ns is None else log_ns
    return Channel(topic, schema, text, messages, log.tolist())


def log(tmp_path: Path, *channels: Channel, **options: Any) -> Path:
    """A log of them, with an IMU and other things beside."""
    others = (imu_channel(random_recording(500)), text_channel())
    return write_log(tmp_path / "a.mcap", *others, *channels, **options)


def table_height(pressure: NDArray[np.float64]) -> NDArray[np.float64]:
    """Geometric height by integrating dp = -p g dH/(R T) from 1013.25 hPa, in the troposphere."""
    H = np.linspace(-500.0, 1_500.0, 20_001)
    weight = 9.80665 / (287.05287 * (288.15 - 0.0065 * H))  # 1/m
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]) * np.diff(H))])
    p = 101_325.0 * np.exp(np.interp(0.0, H, integral) - integral)
    geopotential = np.interp(np.log(pressure), np.log(p[::-1]), H[::-1])
    return geopotential * 6_356_766.0 / (6_356_766.0 - geopotential)


# ---- what is right -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    "container", [{}, {"chunk_bytes": 2_000}, {"chunked": False, "summary": False}]
)
@pytest.mark.parametrize("frame_ids", [("baro",), ("", "baro_link", "x")])
def test_pressures_become_heights_at_their_header_stamps(
    tmp_path: Path, frame_ids: tuple[str, ...], container: dict[str, Any]
) -> None:
    found = read_heights(log(tmp_path, channel(frame_ids=frame_ids), **container))
    assert found.issues == ()
    assert found.time_ns.dtype == np.int64
    assert found.time_ns.tobytes() == STAMPS.tobytes()
    # 0.1 mm: the trapezoids of 0.1 m, and chords between them
    np.testing.assert_allclose(found.h, table_height(VALUES), rtol=0.0, atol=1e-4)


@pytest.mark.parametrize("schema", [FLOAT64, FLOAT32])
def test_heights_without_a_header_are_taken_at_log_time(tmp_path: Path, schema: str) -> None:
    heights = VALUES - 98_000.0
    path = log(tmp_path, channel(schema, heights, topic="/height"))
    found = read_heights(path, "/height")
    assert found.time_ns.tobytes() == RECORDED.tobytes()
    expected = heights if schema == FLOAT64 else heights.astype(np.float32).astype(float)
    assert found.h.tobytes() == expected.tobytes()


@pytest.mark.parametrize("schema", [FLOAT64, FLOAT32])
def test_numbers_without_a_header_may_be_pressures(tmp_path: Path, schema: str) -> None:
    path = log(tmp_path, channel(schema, topic="/p"))
    found = read_heights(path, "/p", quantity="pressure_pa")
    # float32 holds 99 kPa to 4 mPa, 0.3 mm
    np.testing.assert_allclose(found.h, table_height(VALUES), rtol=0.0, atol=5e-4)


@pytest.mark.parametrize(("schema", "field"), [(POSE, "pose.position.z"), (FIX, "altitude")])
def test_any_number_of_a_stamped_message_can_be_the_height(
    tmp_path: Path, schema: str, field: str
) -> None:
    path = log(tmp_path, channel(schema, frame_ids=("map", "odom")), channel(topic="/other"))
    found = read_heights(path, "/baro", field=field, quantity="height_m")
    assert found.time_ns.tobytes() == STAMPS.tobytes()
    assert found.h.tobytes() == VALUES.tobytes()
    found = read_heights(path, "/baro", field=field, quantity="pressure_pa")
    np.testing.assert_allclose(found.h, table_height(VALUES), rtol=0.0, atol=1e-4)  # m, as above


def test_the_only_pressure_topic_is_found_among_others(tmp_path: Path) -> None:
    path = log(tmp_path, channel(FLOAT64, topic="/height"), channel(FIX, topic="/fix"), channel())
    assert read_heights(path).time_ns.tobytes() == STAMPS.tobytes()


def test_a_topic_is_chosen_by_name(tmp_path: Path) -> None:
    path = log(tmp_path, channel(), channel(values=VALUES - 2_000.0, topic="/baro2"))
    low, high = read_heights(path, "/baro"), read_heights(path, "/baro2")
    assert 160.0 < np.mean(high.h - low.h) < 190.0  # m: 2 kPa at 8.4 cm per pascal


def test_seconds_are_on_the_axis_of_the_imu() -> None:
    heights = Heights(STAMPS, VALUES)
    seconds = heights.seconds(EPOCH_NS + 1_000_000_000)
    # 1 ns; Unix seconds in a float64 would be off by 120 ns
    expected = [(ns - EPOCH_NS - 1_000_000_000) / 1e9 for ns in STAMPS.tolist()]
    np.testing.assert_allclose(seconds, expected, rtol=0.0, atol=1e-9)
    assert len(BaroLoop(seconds, heights.h)) == COUNT


def test_a_damaged_chunk_leaves_a_hole_or_is_refused(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap", channel(), compression="none", chunk_bytes=2_000)
    damage_chunk(path, 3)
    found = read_heights(path)
    (issue,) = found.issues
    assert "damaged chunk" in issue.text
    assert 0 < COUNT - len(found.h) < 40
    assert set(found.time_ns) < set(STAMPS)
    with pytest.raises(LogError, match="damaged chunk"):
        read_heights(path, strict=True)


@pytest.mark.parametrize("schema", HEIGHT_SCHEMAS)
def test_entries_name_members_of_the_definitions_of_ros(schema: str) -> None:
    _, members = ROS.fielddefs[schema]
    names = [name for name, _ in members]
    assert HEIGHT_SCHEMAS[schema].field in names
    assert HEIGHT_SCHEMAS[schema].stamped == ("header" in names)


def test_heights_may_be_json(tmp_path: Path) -> None:
    messages = [
        {"header": {"stamp": {"sec": ns // 10**9, "nsec": ns % 10**9}}, "p": {"z": z}}
        for ns, z in zip(STAMPS.tolist(), VALUES.tolist(), strict=True)
    ]
    texts = [json.dumps(message).encode() for message in messages]
    heights = Channel("/own", "my.Height", "{}", texts, RECORDED.tolist(), "jsonschema", "json")
    found = read_heights(log(tmp_path, heights), "/own", field="p.z", quantity="height_m")
    assert found.time_ns.tobytes() == STAMPS.tobytes()
    assert found.h.tobytes() == VALUES.tobytes()


# ---- what is wrong -----------------------------------------------------------------------------


def refused(error: type[Exception], path: Path, *arguments: Any, **options: Any) -> Any:
    """The error; it is one line."""
    with pytest.raises(error) as caught:
        read_heights(path, *arguments, **options)
    assert "\n" not in str(caught.value)
    return caught.value


def test_no_pressure_topic_lists_what_there_is(tmp_path: Path) -> None:
    path = log(
        tmp_path, channel(FLOAT64, topic="/height"), channel(values=VALUES[:0], stamps=STAMPS[:0])
    )
    text = str(refused(LogError, path))
    assert text.startswith(f"{path}: no {PRESSURE} topic; name a topic")
    for part in ("baro.topic", "/height", "/imu/data_raw", "/chatter", FLOAT64):
        assert part in text


def test_two_pressure_topics_must_be_chosen_from(tmp_path: Path) -> None:
    text = str(refused(LogError, log(tmp_path, channel(), channel(topic="/baro2"))))
    assert "2 pressure topics, choose one with baro.topic: /baro (" in text
    assert "/baro2 (" in text
    assert "/imu" not in text


def test_an_unknown_topic_lists_what_there_is(tmp_path: Path) -> None:
    error = refused(LogError, log(tmp_path, channel()), "/barometer")
    assert error.topic == "/barometer"
    assert "no such topic; the log holds /baro (" in str(error)


def test_an_empty_topic_is_told(tmp_path: Path) -> None:
    path = log(tmp_path, channel(values=VALUES[:0], stamps=STAMPS[:0]))
    assert "no message of it is in the log" in str(refused(LogError, path, "/baro"))


def test_an_unknown_schema_needs_field_and_quantity(tmp_path: Path) -> None:
    path = log(tmp_path, channel(FIX))
    error = refused(SchemaError, path, "/baro")
    assert error.topic == "/baro"
    assert f"schema {FIX} does not say which number" in str(error)
    assert "set baro.field and baro.quantity" in str(error)
    error = refused(ConfigError, path, "/baro", field="altitude")
    assert error.key == "baro.quantity"
    assert "nothing says what altitude is" in str(error)


@pytest.mark.parametrize(
    ("field", "fact"),
    [
        ("altitud", "there is no altitud; there is header, status, latitude, longitude, altitude"),
        ("header.frame_id", "header.frame_id is not a number"),
        ("position_covariance", "position_covariance is not a number"),
        ("header", "header is a structure of stamp, frame_id"),
    ],
)
def test_a_field_that_is_no_number_is_told(tmp_path: Path, field: str, fact: str) -> None:
    path = log(tmp_path, channel(FIX))
    error = refused(SchemaError, path, "/baro", field=field, quantity="height_m")
    assert error.topic == "/baro"
    assert fact in str(error)


def test_a_field_needs_a_header_beside_it(tmp_path: Path) -> None:
    point = replace(channel(FLOAT64), schema="geometry_msgs/msg/Point", text="float64 z\n")
    error = refused(SchemaError, log(tmp_path, point), "/baro", field="z", quantity="height_m")
    assert "there is no header; there is z" in str(error)


def test_a_field_needs_its_topic(tmp_path: Path) -> None:
    error = refused(ConfigError, log(tmp_path, channel()), field="fluid_pressure")
    assert error.key == "baro.topic"


def test_a_quantity_must_be_known_and_fit(tmp_path: Path) -> None:
    path = log(tmp_path, channel())
    error = refused(ConfigError, path, "/baro", quantity="feet")
    assert error.key == "baro.quantity"
    assert "'feet' is not one of height_m, pressure_pa" in str(error)
    error = refused(ConfigError, path, "/baro", quantity="height_m")
    assert error.key == "baro.quantity"
    assert "holds pressure_pa, not height_m" in str(error)


def test_foreign_encodings_are_refused(tmp_path: Path) -> None:
    cbor = replace(channel(), message_encoding="cbor", encoding="jsonschema")
    error = refused(SchemaError, log(tmp_path, cbor), "/baro")
    assert "'cbor' is not read, only cdr, ros1, json, protobuf" in str(error)
    idl = replace(channel(), encoding="ros2idl")
    error = refused(SchemaError, log(tmp_path, idl), "/baro")
    assert "'ros2idl' is not read" in str(error)
    assert error.topic == "/baro"


@pytest.mark.parametrize(
    ("bad", "fact"),
    [
        (0.0, "is 0 Pa, not within"),
        (-99_000.0, "is -99000 Pa, not within"),
        (np.nan, "is nan Pa, not within"),
        (np.inf, "is inf Pa, not within"),
        (200_000.0, "20 km to -5 km"),
        (1_013.25, "is it in hPa?"),
    ],
)
def test_a_bad_pressure_names_its_message_and_time(tmp_path: Path, bad: float, fact: str) -> None:
    values = VALUES.copy()
    values[123] = bad
    error = refused(LogError, log(tmp_path, channel(values=values), chunk_bytes=2_000))
    seconds = (int(STAMPS[123]) - int(STAMPS[0])) / 1e9
    assert error.index == 123
    assert error.topic == "/baro"
    assert error.time_s == pytest.approx(seconds, abs=1e-9)  # s: 1 ns
    assert f"message 123, {seconds:.6f} s after the first: the pressure fluid_pressure" in str(
        error
    )
    assert fact in str(error)
    assert ("hPa" in str(error)) == (bad == 1_013.25)


def test_a_bad_height_names_its_message(tmp_path: Path) -> None:
    values = VALUES.copy()
    values[[70, 200]] = -np.inf
    error = refused(LogError, log(tmp_path, channel(FLOAT64, values)), "/baro")
    assert error.index == 70
    assert "the height data is -inf, not finite" in str(error)


@pytest.mark.parametrize(("step_ns", "fact"), [(0, "repeats"), (-1_500_000, "back by 0.001500 s")])
def test_time_must_increase(tmp_path: Path, step_ns: int, fact: str) -> None:
    stamps = STAMPS.copy()
    stamps[58] = stamps[57] + step_ns
    error = refused(LogError, log(tmp_path, channel(stamps=stamps), chunk_bytes=2_000))
    assert error.index == 58
    assert f"the header stamp {fact}" in str(error) or f"the header stamp steps {fact}" in str(
        error
    )
    times = RECORDED.copy()
    times[58] = times[57] + step_ns
    # alone in its file: the writer of these tests sorts topics by log time
    path = write_log(tmp_path / "b.mcap", channel(FLOAT64, log_ns=times))
    error = refused(LogError, path, "/baro")
    assert error.index == 58
    assert "the log time" in str(error)
    # with a header, the recorder's clock does not matter
    path = write_log(tmp_path / "c.mcap", channel(log_ns=times))
    assert read_heights(path).time_ns.tobytes() == STAMPS.tobytes()
