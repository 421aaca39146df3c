"""Samples come out of a log exactly as they went in, in body axes and SI."""

from __future__ import annotations

import re
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

import navgrade
from navgrade.errors import ConfigError, LogError, SchemaError
from navgrade.logs import open_imu
from tests.navgrade.logmaking import (
    EPOCH_NS,
    IMU,
    INCREMENT,
    Recording,
    chunks_of,
    imu_channel,
    random_recording,
    records_of,
    text_channel,
    write_log,
)

COUNT = 2000
CONTAINERS = {
    "zstd": {"compression": "zstd"},
    "lz4": {"compression": "lz4"},
    "not compressed": {"compression": "none"},
    "unchunked": {"chunked": False},
    "many chunks": {"chunk_bytes": 5_000},
    "no summary": {"summary": False},
    "unchunked, no summary": {"chunked": False, "summary": False},
}


def a_recording(schema: str, count: int = COUNT) -> Recording:
    """Random numbers for Imu, or for ImuIncrement with intervals that are not the steps."""
    recording = random_recording(count)
    if schema == IMU:
        return recording
    interval = 0.01 + 1e-4 * np.random.default_rng(5).random(count)
    return recording.as_increments(interval)


def exact_seconds(stamp_ns: np.ndarray) -> np.ndarray:
    """Seconds after the first stamp, each rounded once from the integer nanoseconds."""
    first = int(stamp_ns[0])
    return np.array([float(Fraction(int(ns) - first, 10**9)) for ns in stamp_ns])


def read(path: Path, schema: str, **options: str | None) -> navgrade.ImuSamples:
    """Read a log without turning its axes."""
    kind = "average" if schema == IMU else None
    return navgrade.read_imu(path, **{"kind": kind, "axes": "FRD", **options})


@pytest.mark.parametrize("container", CONTAINERS)
@pytest.mark.parametrize("schema", [IMU, INCREMENT])
def test_values_are_those_written_to_the_bit(tmp_path: Path, schema: str, container: str) -> None:
    recording = a_recording(schema)
    path = write_log(
        tmp_path / "a.mcap", imu_channel(recording), text_channel(), **CONTAINERS[container]
    )
    if container == "many chunks":
        assert len(chunks_of(path)) > 30
    imu = read(path, schema)
    assert imu.gyro.tobytes() == recording.gyro.tobytes()
    assert imu.accel.tobytes() == recording.accel.tobytes()
    assert imu.epoch_ns == recording.stamp_ns[0]
    # a product by 1e-9 rounds twice: 2 ulp of 20 s are 7e-15 s, 1e-12 m at 100 m/s
    assert np.max(np.abs(imu.t - exact_seconds(recording.stamp_ns))) <= 2 * np.spacing(20.0)
    if recording.interval is not None:
        assert imu.dt.tobytes() == recording.interval.tobytes()
    assert not imu.status.any()


@pytest.mark.parametrize("schema", [IMU, INCREMENT])
def test_a_log_longer_than_one_block_is_read_whole(tmp_path: Path, schema: str) -> None:
    recording = a_recording(schema, 40_000)
    path = write_log(tmp_path / "a.mcap", imu_channel(recording), chunk_bytes=50_000)
    imu = read(path, schema)
    assert imu.gyro.tobytes() == recording.gyro.tobytes()
    assert imu.accel.tobytes() == recording.accel.tobytes()
    # 2 ulp of 400 s
    assert np.max(np.abs(imu.t - exact_seconds(recording.stamp_ns))) <= 2 * np.spacing(400.0)
    if recording.interval is None:
        steps = np.diff(exact_seconds(recording.stamp_ns))
        assert np.max(np.abs(imu.dt[1:] - steps)) <= 3 * np.spacing(400.0)
    else:
        assert imu.dt.tobytes() == recording.interval.tobytes()


@pytest.mark.parametrize("schema", [IMU, INCREMENT])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    "frame_ids", [("",), ("imu",), ("imu_link",), ("a", "imu", "imu_frame_of_the_left_mast", "")]
)
def test_byte_order_and_length_of_the_frame_change_nothing(
    tmp_path: Path, frame_ids: tuple[str, ...], order: str, schema: str
) -> None:
    recording = a_recording(schema, 500)
    channel = imu_channel(recording, frame_ids=frame_ids, order=order)
    imu = read(write_log(tmp_path / "a.mcap", channel, chunk_bytes=30_000), schema)
    assert imu.gyro.tobytes() == recording.gyro.tobytes()
    assert imu.accel.tobytes() == recording.accel.tobytes()
    assert imu.epoch_ns == EPOCH_NS


def test_frame_ids_may_change_between_chunks(tmp_path: Path) -> None:
    """Every message with a frame of its own: more lengths than one run of messages may hold."""
    recording = random_recording(500)
    channel = imu_channel(recording, frame_ids=["x" * k for k in range(50)])
    imu = read(write_log(tmp_path / "a.mcap", channel), IMU)
    assert imu.gyro.tobytes() == recording.gyro.tobytes()


def test_a_foreign_encapsulation_is_refused(tmp_path: Path) -> None:
    """Parameter-list CDR has its members elsewhere."""
    channel = imu_channel(random_recording(5))
    messages = [b"\0\3" + message[2:] for message in channel.messages]
    path = write_log(tmp_path / "a.mcap", type(channel)(**{**vars(channel), "messages": messages}))
    with pytest.raises(SchemaError, match="0003 is not plain CDR"):
        read(path, IMU)


TURNS = {  # forward, right, down in terms of the recorded x, y, z
    "FRD": lambda x, y, z: (x, y, z),
    "FLU": lambda x, y, z: (x, -y, -z),
    "RFU": lambda x, y, z: (y, x, -z),
    "BLD": lambda x, y, z: (-x, -y, z),
    "urf": lambda x, y, z: (z, y, -x),
    "x=-up y=forward z=right": lambda x, y, z: (y, z, x),
    "z=forward, x=-up, y=-right": lambda x, y, z: (z, -y, x),
    None: lambda x, y, z: (x, -y, -z),  # FLU, the ROS default
}


@pytest.mark.parametrize("axes", TURNS)
@pytest.mark.parametrize("schema", [IMU, INCREMENT])
def test_axes_are_turned_to_forward_right_down(
    tmp_path: Path, schema: str, axes: str | None
) -> None:
    recording = a_recording(schema, 50)
    path = write_log(tmp_path / "a.mcap", imu_channel(recording))
    imu = read(path, schema, axes=axes)
    turn = TURNS[axes]
    assert np.array_equal(imu.gyro.T, np.stack(turn(*recording.gyro.T)))
    assert np.array_equal(imu.accel.T, np.stack(turn(*recording.accel.T)))


@pytest.mark.parametrize("axes", ["FRU", "FLD", "FFD", "FRX", "x=-up y=right z=forward", "", "x"])
def test_axes_that_are_no_right_handed_triple_are_refused(tmp_path: Path, axes: str) -> None:
    path = write_log(tmp_path / "a.mcap", imu_channel(random_recording(5)))
    with pytest.raises(ConfigError) as error:
        read(path, IMU, axes=axes)
    assert error.value.key == "imu.axes"
    assert repr(axes) in str(error.value)


def test_the_example_in_the_axes_message_is_accepted(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap", imu_channel(random_recording(5)))
    with pytest.raises(ConfigError) as error:
        read(path, IMU, axes="FRU")
    (example,) = re.findall(r'"(x=[^"]+)"', str(error.value))
    assert len(read(path, IMU, axes=example)) == 5


@pytest.mark.parametrize(
    ("option", "column", "factor"),
    [
        ({"gyro_unit": "deg/s"}, "gyro", np.pi / 180.0),
        ({"accel_unit": "g"}, "accel", 9.80665),
        ({"gyro_unit": "rad/s"}, "gyro", 1.0),
        ({"accel_unit": "m/s^2"}, "accel", 1.0),
    ],
)
@pytest.mark.parametrize("schema", [IMU, INCREMENT])
def test_units_are_brought_to_si(
    tmp_path: Path, schema: str, option: dict[str, str], column: str, factor: float
) -> None:
    recording = a_recording(schema, 50)
    path = write_log(tmp_path / "a.mcap", imu_channel(recording))
    imu = read(path, schema, **option)
    other = {"gyro": "accel", "accel": "gyro"}[column]
    # one product, rounded once more than here at most
    np.testing.assert_allclose(
        getattr(imu, column), getattr(recording, column) * factor, rtol=2.3e-16, atol=0.0
    )
    assert getattr(imu, other).tobytes() == getattr(recording, other).tobytes()


def test_time_is_that_of_the_header(tmp_path: Path) -> None:
    """A player wrote this log 20 times too fast, half a year later, and in bursts."""
    recording = random_recording(300)
    log_ns = EPOCH_NS + 15_552_000 * 10**9 + (recording.stamp_ns - EPOCH_NS) // 2_000 * 100
    imu = read(write_log(tmp_path / "a.mcap", imu_channel(recording, log_ns=log_ns)), IMU)
    assert imu.epoch_ns == EPOCH_NS
    # 2 ulp of 3 s
    assert np.max(np.abs(imu.t - exact_seconds(recording.stamp_ns))) <= 2 * np.spacing(4.0)


@pytest.mark.parametrize("epoch_ns", [0, -5_000_000_001, 2_147_483_640_999_999_999])
def test_any_epoch_a_header_can_hold(tmp_path: Path, epoch_ns: int) -> None:
    recording = random_recording(100)
    moved = Recording(recording.stamp_ns - EPOCH_NS + epoch_ns, recording.gyro, recording.accel)
    log_ns = np.arange(100)
    imu = read(write_log(tmp_path / "a.mcap", imu_channel(moved, log_ns=log_ns)), IMU)
    assert imu.epoch_ns == epoch_ns
    assert imu.t[-1] == pytest.approx((recording.stamp_ns[-1] - EPOCH_NS) * 1e-9, abs=1e-12)


# ---- intervals ---------------------------------------------------------------------------------


def with_steps(steps_ms: list[float]) -> Recording:
    """An Imu recording whose stamps are these steps apart."""
    steps_ns = np.rint(np.array([0.0, *steps_ms]) * 1e6).astype(np.int64)
    values = random_recording(len(steps_ns))
    return Recording(EPOCH_NS + np.cumsum(steps_ns), values.gyro, values.accel)


@pytest.mark.parametrize(
    ("steps_ms", "dt_ms"),
    [
        ([10] * 6, [10] * 7),  # the first takes the median
        ([10, 10, 12, 9, 10, 10], [10, 10, 10, 12, 9, 10, 10]),  # jitter belongs to the interval
        ([10, 10, 14, 10, 8, 10, 10], [10, 10, 10, 14, 10, 8, 10, 10]),  # to half an interval
        ([10, 10, 20, 10, 32, 10], [10, 10, 10, 10, 10, 10, 10]),  # a hole is nobody's interval
        ([10, 10, 10, 40, 10, 10], [10, 10, 10, 10, 10, 10, 10]),  # a gap is nobody's interval
        ([10, 10, 10, 5000, 10, 10], [10, 10, 10, 10, 10, 10, 10]),
        ([6, 4, 6, 4, 6], [6, 6, 4, 6, 4, 6]),
    ],
)
def test_the_interval_reaches_back_to_the_stamp_before(
    tmp_path: Path, steps_ms: list[float], dt_ms: list[float]
) -> None:
    imu = read(write_log(tmp_path / "a.mcap", imu_channel(with_steps(steps_ms))), IMU)
    np.testing.assert_allclose(imu.dt * 1e3, dt_ms, rtol=0.0, atol=1e-9)  # 1e-12 s, rounding


def test_a_gap_between_two_blocks_is_nobodys_interval(tmp_path: Path) -> None:
    steps_ms = np.full(19_999, 10.0)
    path = write_log(
        tmp_path / "a.mcap", imu_channel(with_steps(list(steps_ms))), chunk_bytes=50_000
    )
    seam = len(next(open_imu(path, kind="average").blocks()))
    assert 1000 < seam < 19_000
    steps_ms[seam - 1 : seam + 1] = 70.0, 20.0  # before and after the first sample of a block
    write_log(path, imu_channel(with_steps(list(steps_ms))), chunk_bytes=50_000)
    expected = np.full(20_000, 10.0)
    # 1e-12 s: rounding of the difference of two times of 200 s
    np.testing.assert_allclose(read(path, IMU).dt * 1e3, expected, rtol=0.0, atol=1e-9)


# ---- kind --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["rate", "average", "increment", "compensated"])
def test_an_imu_is_what_it_is_said_to_be(tmp_path: Path, kind: str) -> None:
    recording = random_recording(20)
    path = write_log(tmp_path / "a.mcap", imu_channel(recording))
    imu = navgrade.read_imu(path, kind=kind, axes="FRD")
    assert imu.kind == kind
    assert imu.gyro.tobytes() == recording.gyro.tobytes()


def test_an_imu_of_no_kind_is_refused(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap", imu_channel(random_recording(20)))
    with pytest.raises(ConfigError) as error:
        navgrade.read_imu(path)
    assert error.value.key == "imu.kind"
    for word in ("rate (", "average (", "increment (", "compensated (", "--kind"):
        assert word in str(error.value)


@pytest.mark.parametrize(("asked", "kind"), [(None, "increment"), ("compensated", "compensated")])
def test_increments_are_increments_unless_compensated(
    tmp_path: Path, asked: str | None, kind: str
) -> None:
    path = write_log(tmp_path / "a.mcap", imu_channel(a_recording(INCREMENT, 20)))
    assert navgrade.read_imu(path, kind=asked).kind == kind


@pytest.mark.parametrize("kind", ["rate", "average"])
def test_increments_are_never_rates(tmp_path: Path, kind: str) -> None:
    path = write_log(tmp_path / "a.mcap", imu_channel(a_recording(INCREMENT, 20)))
    with pytest.raises(ConfigError, match=f"increment or compensated, not kind '{kind}'"):
        navgrade.read_imu(path, kind=kind)


# ---- errors carry their data -------------------------------------------------------------------


def test_errors_carry_file_topic_index_and_time(tmp_path: Path) -> None:
    recording = random_recording(100)
    recording.gyro[41, 2] = np.nan
    path = write_log(tmp_path / "a.mcap", imu_channel(recording, "/imu"))
    with pytest.raises(LogError) as error:
        read(path, IMU)
    assert error.value.file == str(path)
    assert error.value.topic == "/imu"
    assert error.value.index == 41
    seconds = (int(recording.stamp_ns[41]) - EPOCH_NS) * 1e-9
    assert error.value.time_s == pytest.approx(seconds, abs=1e-9)  # stamps are exact to 1 ns


def test_one_message_is_not_a_log(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap", imu_channel(random_recording(1)))
    with pytest.raises(LogError, match="one message"):
        read(path, IMU)


def test_a_topic_without_messages_is_told(tmp_path: Path) -> None:
    empty = imu_channel(random_recording(1).rows(slice(0, 0)), "/empty")
    path = write_log(tmp_path / "a.mcap", imu_channel(random_recording(9), "/imu"), empty)
    assert len(read(path, IMU)) == 9  # the only one that can be meant
    with pytest.raises(LogError, match="/empty: no message"):
        read(path, IMU, topic="/empty")


def test_the_log_is_left_as_it_was(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap", imu_channel(a_recording(IMU)), chunk_bytes=10_000)
    content = path.read_bytes()
    read(path, IMU)
    assert path.read_bytes() == content
    assert len(records_of(path)) > 10


def test_real_stamps_that_jitter_give_intervals_that_jitter(shared_data: Path) -> None:
    """The LN-100 recordings: 64.05 Hz with a scatter of 33 µs."""
    imu = navgrade.read_imu(shared_data / "calgary_ln100_x_up.mcap", kind="average", axes="FRD")
    assert len(imu) == 19_217
    assert np.median(imu.dt) == pytest.approx(15.6116e-3, abs=20e-6)
    assert np.std(imu.dt[1:]) == pytest.approx(33e-6, rel=0.5)
    assert np.array_equal(imu.dt[1:], np.diff(imu.t))
    # x points up: gravity there, with the accelerometer's -0.43 mm/s^2 and 0.3 deg of tilt
    assert np.mean(imu.accel[:, 0]) == pytest.approx(9.808, abs=0.01)
