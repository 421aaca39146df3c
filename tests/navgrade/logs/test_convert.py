"""Samples keep every bit from one kind of file to another."""

from __future__ import annotations

import csv
import struct
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory

from navgrade.errors import ConfigError, LogError, SchemaError
from navgrade.logs import open_imu
from navgrade.logs.convert import convert_imu, topic_columns, write_table
from navgrade.logs.tables import SampleTable
from navgrade.logs.topics import open_known
from tests.navgrade.logmaking import (
    EPOCH_NS,
    Channel,
    Recording,
    from_body_axes,
    imu_channel,
    random_recording,
    text_channel,
    write_log,
)
from tests.navgrade.logs.decoding import Columns, by_mcap_ros2_support

COUNT = 40_000  # more than one block
XYZ = "xyz"
INCREMENT_PATHS = (
    "interval_s",
    *(f"{name}.{axis}" for name in ("delta_angle", "delta_velocity") for axis in XYZ),
)
IMU_PATHS = tuple(
    f"{name}.{axis}" for name in ("angular_velocity", "linear_acceleration") for axis in XYZ
)


def incremental(count: int = COUNT) -> Recording:
    """Increments whose intervals are not the steps of the stamps."""
    interval = 0.01 + 1e-4 * np.random.default_rng(5).random(count)
    return random_recording(count).as_increments(interval)


def written(path: Path, *channels: Channel, **container: Any) -> Path:
    return write_log(path / "in.mcap", *channels, **container)


def increments(path: Path) -> Columns:
    """Converted increments as the official reader decodes them, checksums verified."""
    return by_mcap_ros2_support(path, "/imu/increments", INCREMENT_PATHS, ())


def vectors(columns: Columns, paths: tuple[str, ...]) -> np.ndarray:
    return np.stack([columns[path] for path in paths], axis=1)


@pytest.mark.parametrize("axes", ["FRD", "FLU", "RFU"])
def test_increments_are_those_of_the_log_to_the_bit(tmp_path: Path, axes: str) -> None:
    truth = incremental()
    log = written(tmp_path, imu_channel(from_body_axes(truth, axes)))
    done = convert_imu(open_imu(log, axes=axes), tmp_path / "out.mcap")
    assert done.count == COUNT
    found = increments(tmp_path / "out.mcap")
    assert np.array_equal(found["stamp_ns"], truth.stamp_ns)
    assert found["interval_s"].tobytes() == truth.interval.tobytes()
    values = np.concatenate([truth.gyro, truth.accel], axis=1)
    assert vectors(found, INCREMENT_PATHS[1:]).tobytes() == values.tobytes()


def test_averages_become_increments_by_their_intervals(tmp_path: Path) -> None:
    truth = random_recording(3000)
    log = written(tmp_path, imu_channel(truth))
    convert_imu(open_imu(log, kind="average", axes="FRD"), tmp_path / "out.mcap")
    found = increments(tmp_path / "out.mcap")
    interval = found["interval_s"]
    # differences of stamps up to 30 s, as doubles: 2 ulp
    steps = np.diff(truth.stamp_ns) * 1e-9
    np.testing.assert_allclose(interval[1:], steps, rtol=0.0, atol=2 * np.spacing(30.0))
    values = np.concatenate([truth.gyro, truth.accel], axis=1) * interval[:, None]
    assert vectors(found, INCREMENT_PATHS[1:]).tobytes() == values.tobytes()
    with (tmp_path / "out.mcap").open("rb") as stream:
        (channel,) = make_reader(stream).get_summary().channels.values()
    assert channel.metadata == {"imu.kind": "increment", "imu.axes": "FRD"}


def test_instantaneous_rates_are_not_made_into_increments(tmp_path: Path) -> None:
    log = written(tmp_path, imu_channel(random_recording(100)))
    with pytest.raises(ConfigError, match="instantaneous rates are not increments"):
        convert_imu(open_imu(log, kind="rate"), tmp_path / "out.mcap")
    assert not (tmp_path / "out.mcap").exists()
    done = convert_imu(open_imu(log, kind="rate"), tmp_path / "out.csv")
    assert done.count == 100


@pytest.mark.parametrize("kind", ["increment", "compensated"])
def test_the_file_tells_kind_and_axes_to_those_who_open_it(tmp_path: Path, kind: str) -> None:
    """Nobody says them again; what is said still wins."""
    truth = incremental(100)
    log = written(tmp_path, imu_channel(truth))
    convert_imu(open_imu(log, kind=kind, axes="FRD"), tmp_path / "out.mcap")
    imu = open_imu(tmp_path / "out.mcap")
    assert (imu.kind, imu.axes) == (kind, "FRD")
    (block,) = imu.blocks()
    assert block.kind == kind
    assert block.gyro.tobytes() == truth.gyro.tobytes()
    said = open_imu(tmp_path / "out.mcap", kind="increment", axes="FLU")
    assert (said.kind, said.axes) == ("increment", "FLU")


@pytest.mark.parametrize("kind", ["rate", "nonsense"])
def test_a_kind_its_messages_cannot_hold_is_not_believed(tmp_path: Path, kind: str) -> None:
    """An entry in a channel's metadata may be anybody's."""
    channel = imu_channel(incremental(10))
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(channel.schema, "ros2msg", channel.text.encode())
        number = writer.register_channel("/imu", "cdr", schema, {"imu.kind": kind})
        for log_ns, message in zip(channel.log_ns, channel.messages, strict=True):
            writer.add_message(number, log_ns, message, log_ns)
        writer.finish()
    assert open_imu(tmp_path / "a.mcap").kind == "increment"


@pytest.mark.parametrize("suffix", [".mcap", ".csv"])
@pytest.mark.parametrize(
    ("start", "end", "rows"),
    [
        (None, None, slice(0, None)),
        (0.5, None, slice(50, None)),
        (None, 0.5, slice(0, 50)),
        (250.0, 300.0, slice(25_000, 30_000)),
        (0.01, 0.02, slice(1, 2)),
    ],
)
def test_a_window_holds_its_start_and_not_its_end(
    tmp_path: Path, suffix: str, start: float | None, end: float | None, rows: slice
) -> None:
    stamp_ns = EPOCH_NS + 10_000_000 * np.arange(COUNT)
    log = written(tmp_path, imu_channel(replace(incremental(), stamp_ns=stamp_ns)))
    out = tmp_path / f"out{suffix}"
    done = convert_imu(open_imu(log), out, start=start, end=end)
    expected = stamp_ns[rows].tolist()
    assert done.count == len(expected)
    if suffix == ".csv":
        with out.open() as stream:
            assert [int(row["time_ns"]) for row in csv.DictReader(stream)] == expected
    else:
        assert increments(out)["stamp_ns"].tolist() == expected


def test_an_empty_window_is_refused(tmp_path: Path) -> None:
    log = written(tmp_path, imu_channel(incremental(100)))
    with pytest.raises(LogError, match="no sample from 5 s on and before 6 s"):
        convert_imu(open_imu(log), tmp_path / "out.mcap", start=5.0, end=6.0)
    with pytest.raises(LogError, match=r"no sample from 5 s on$"):
        convert_imu(open_imu(log), tmp_path / "out.csv", start=5.0)
    assert [path.name for path in tmp_path.iterdir()] == ["in.mcap"]


def test_a_stamp_that_jumped_by_weeks_is_refused(tmp_path: Path) -> None:
    """So far from the first sample seconds no longer hold its nanoseconds."""
    recording = incremental(100)
    recording.stamp_ns[50:] += 20 * 86_400 * 10**9
    log = written(tmp_path, imu_channel(recording))
    with pytest.raises(LogError, match=r"20\.0 days after the first: a stamp has jumped"):
        convert_imu(open_imu(log), tmp_path / "out.mcap")


HEADS = {
    "increment": ("delta_angle_{}_rad", "delta_velocity_{}_m_s"),
    "average": ("gyro_{}_rad_s", "accel_{}_m_s2"),
}


@pytest.mark.parametrize("kind", HEADS)
def test_a_table_holds_every_bit_under_names_with_units(tmp_path: Path, kind: str) -> None:
    truth = incremental() if kind == "increment" else random_recording(COUNT)
    log = written(tmp_path, imu_channel(from_body_axes(truth, "RFU")))
    convert_imu(open_imu(log, kind=kind, axes="RFU"), tmp_path / "out.csv")
    with (tmp_path / "out.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    names = [head.format(axis) for head in HEADS[kind] for axis in XYZ]
    assert list(rows[0]) == ["time_ns", "time_s", "interval_s", *names]
    values = np.array([[float(row[name]) for name in names] for row in rows])
    assert values.tobytes() == np.concatenate([truth.gyro, truth.accel], axis=1).tobytes()
    stamps = np.array([int(row["time_ns"]) for row in rows])
    assert np.array_equal(stamps, truth.stamp_ns)
    seconds = np.array([float(row["time_s"]) for row in rows])
    # a product by 1e-9 rounds twice: 2 ulp of 400 s
    exact = (truth.stamp_ns - truth.stamp_ns[0]) / 1e9
    np.testing.assert_allclose(seconds, exact, rtol=0.0, atol=2 * np.spacing(400.0))
    if truth.interval is not None:
        intervals = np.array([float(row["interval_s"]) for row in rows])
        assert intervals.tobytes() == truth.interval.tobytes()


def test_parquet_holds_every_bit(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    truth = incremental()
    log = written(tmp_path, imu_channel(truth))
    done = convert_imu(open_imu(log, axes="FRD"), tmp_path / "out.parquet")
    table = parquet.read_table(tmp_path / "out.parquet").to_pydict()
    assert done.count == COUNT
    assert table["time_ns"] == truth.stamp_ns.tolist()
    assert table["interval_s"] == truth.interval.tolist()
    assert table["delta_angle_y_rad"] == truth.gyro[:, 1].tolist()
    assert table["delta_velocity_z_m_s"] == truth.accel[:, 2].tolist()


def test_parquet_without_pyarrow_is_refused_in_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    log = written(tmp_path, imu_channel(incremental(100)))
    with pytest.raises(ConfigError, match=r"pip install 'navgrade\[parquet\]'"):
        convert_imu(open_imu(log), tmp_path / "out.parquet")
    assert [path.name for path in tmp_path.iterdir()] == ["in.mcap"]


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    log = written(tmp_path, imu_channel(incremental(100)))
    with pytest.raises(ConfigError, match=r"does not end in \.mcap, \.csv or \.parquet"):
        convert_imu(open_imu(log), tmp_path / "out.txt")


# ---- text files --------------------------------------------------------------------------------


def table_of(path: Path, recording: Recording) -> Path:
    """The recording as text, its numbers with all their digits."""
    columns = np.concatenate([recording.gyro, recording.accel], axis=1).tolist()
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        for ns, row in zip(recording.stamp_ns.tolist(), columns, strict=True):
            writer.writerow([f"{ns // 10**9}.{ns % 10**9:09d}", *map(repr, row)])
    return path


def samples(path: Path, kind: Any, axes: str = "FRD") -> SampleTable:
    return SampleTable(path, "1", ("2", "3", "4"), ("5", "6", "7"), kind, axes)


@pytest.mark.parametrize("kind", ["rate", "average"])
def test_rates_of_a_text_file_become_imu_messages_in_ros_axes(tmp_path: Path, kind: str) -> None:
    truth = random_recording(COUNT)
    text = table_of(tmp_path / "a.csv", from_body_axes(truth, "RFU"))
    done = convert_imu(samples(text, kind, "RFU"), tmp_path / "out.mcap")
    assert done.count == COUNT
    orientation = ("orientation.x", "orientation.w")
    found = by_mcap_ros2_support(
        tmp_path / "out.mcap", "/imu/data_raw", (*IMU_PATHS, *orientation), ()
    )
    assert np.array_equal(found["stamp_ns"], truth.stamp_ns)
    in_ros = from_body_axes(truth, "FLU")
    values = np.concatenate([in_ros.gyro, in_ros.accel], axis=1)
    assert vectors(found, IMU_PATHS).tobytes() == values.tobytes()
    assert found["orientation.x"].max() == 0.0
    assert found["orientation.w"].min() == 1.0
    imu = open_imu(tmp_path / "out.mcap")
    assert (imu.kind, imu.axes) == (kind, "FLU")


def test_they_say_that_there_is_no_orientation(tmp_path: Path) -> None:
    """By the definition of the message: the first element of its covariance is -1."""
    text = table_of(tmp_path / "a.csv", random_recording(10))
    convert_imu(samples(text, "average"), tmp_path / "out.mcap")
    with (tmp_path / "out.mcap").open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = [row.decoded_message for row in reader.iter_decoded_messages()]
    assert len(messages) == 10
    for message in messages:
        assert list(message.orientation_covariance) == [-1.0] + [0.0] * 8
        assert list(message.angular_velocity_covariance) == [0.0] * 9  # not known


def test_increments_of_a_text_file_become_increments(tmp_path: Path) -> None:
    truth = random_recording(COUNT)
    text = table_of(tmp_path / "a.csv", truth)
    convert_imu(samples(text, "increment"), tmp_path / "out.mcap")
    found = increments(tmp_path / "out.mcap")
    assert np.array_equal(found["stamp_ns"], truth.stamp_ns)
    values = np.concatenate([truth.gyro, truth.accel], axis=1)
    assert vectors(found, INCREMENT_PATHS[1:]).tobytes() == values.tobytes()
    steps = np.diff(truth.stamp_ns) * 1e-9
    np.testing.assert_allclose(found["interval_s"][1:], steps, rtol=0.0, atol=2 * np.spacing(400.0))


def test_a_fault_far_down_leaves_nothing(tmp_path: Path) -> None:
    text = table_of(tmp_path / "a.csv", random_recording(COUNT))
    with text.open("a") as stream:
        stream.write("noon,1,2,3,4,5,6\n")
    for suffix in (".mcap", ".csv"):
        with pytest.raises(LogError, match=f"line {COUNT + 1}: the time 'noon'"):
            convert_imu(samples(text, "increment"), tmp_path / f"out{suffix}")
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


# ---- any topic ---------------------------------------------------------------------------------

MADE = "made_msgs/msg/Up"
MADE_TEXT = """\
std_msgs/Header header
string name
bool ok
int8[3] counts
float32 level
uint64 big
float64[] many
made_msgs/Part[2] parts
made_msgs/Part part
================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================
MSG: made_msgs/Part
uint16 first
"""


def made(k: int) -> bytes:
    """A message, packed by hand: alignment counts from the end of the encapsulation."""
    body = struct.pack("<iI", 1_700_000_000 + k, 5)
    for text in ("frame", f"name{k}"):
        body += bytes(-len(body) % 4) + struct.pack("<I", len(text) + 1) + text.encode() + b"\0"
    body += struct.pack("<?3b", k % 2 == 1, k, -k, 7)
    body += bytes(-len(body) % 4) + struct.pack("<f", 0.5 * k)
    body += bytes(-len(body) % 8) + struct.pack("<Q", (1 << 60) + k)
    body += struct.pack("<I", k % 3)
    body += bytes(-len(body) % 8 if k % 3 else 0) + struct.pack(f"<{k % 3}d", *range(k % 3))
    body += struct.pack("<3H", 1, 2, 3 + k)
    return b"\0\1\0\0" + body


def made_log(folder: Path, **container: Any) -> Path:
    log_ns = [EPOCH_NS + k * 10**8 for k in range(9)]
    channel = Channel("/made", MADE, MADE_TEXT, [made(k) for k in range(9)], log_ns)
    return written(folder, channel, text_channel(), **container)


def test_members_of_any_topic_become_columns(tmp_path: Path) -> None:
    """Texts, truths, times and arrays of constant length; sequences, whose length varies, not."""
    log = open_known(made_log(tmp_path))
    assert write_table(tmp_path / "out.csv", topic_columns(log, "/made")) == 9
    with (tmp_path / "out.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert list(rows[4].items()) == [
        ("log_time_ns", str(EPOCH_NS + 4 * 10**8)),
        ("header.stamp_ns", "1700000004000000005"),
        ("header.frame_id", "frame"),
        ("name", "name4"),
        ("ok", "False"),
        ("counts.0", "4"),
        ("counts.1", "-4"),
        ("counts.2", "7"),
        ("level", "2.0"),
        ("big", str((1 << 60) + 4)),
        ("part.first", "7"),
    ]


def test_members_of_a_file_without_a_summary(tmp_path: Path) -> None:
    log = open_known(made_log(tmp_path, summary=False))
    assert sum(len(block["name"]) for block in topic_columns(log, "/made")) == 9


def test_a_window_of_a_topic_counts_from_its_first_message(tmp_path: Path) -> None:
    log = open_known(made_log(tmp_path))
    (block,) = topic_columns(log, "/made", start=0.2, end=0.5)
    assert block["name"].tolist() == ["name2", "name3", "name4"]
    with pytest.raises(LogError, match="/made: no message of it"):
        list(topic_columns(log, "/made", start=5.0))


@pytest.mark.parametrize(
    ("topic", "told"), [("/nowhere", "no such topic"), ("/empty", "no message")]
)
def test_a_topic_that_is_not_there_is_refused(tmp_path: Path, topic: str, told: str) -> None:
    empty = imu_channel(random_recording(10).rows(slice(0, 0)), "/empty")
    log = open_known(written(tmp_path, text_channel(), empty))
    with pytest.raises(LogError, match=told):
        write_table(tmp_path / "out.csv", topic_columns(log, topic))
    assert not (tmp_path / "out.csv").exists()


def test_messages_without_a_definition_are_refused(tmp_path: Path) -> None:
    channel = Channel("/json", "any", "{}", [b"{}"], [EPOCH_NS], "jsonschema", "json")
    log = open_known(written(tmp_path, channel))
    with pytest.raises(SchemaError, match="json"):
        list(topic_columns(log, "/json"))
