"""What is written is what was computed, to the bit, in software that is not ours."""

from __future__ import annotations

import dataclasses
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd, Footer
from mcap.stream_reader import StreamReader
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import navgrade
from navgrade.errors import ConfigError
from navgrade.logs import SolutionWriter
from tests.navgrade.logmaking import EPOCH_NS, INCREMENT, random_recording, stamps
from tests.navgrade.logs.decoding import (
    DECODERS,
    FIX,
    FIX_FLOATS,
    ODOMETRY,
    ODOMETRY_FLOATS,
    SOLUTION,
    SOLUTION_FLOATS,
    TRANSFORMS,
    Columns,
    by_node,
    fixes,
    solution,
)

DEG = math.pi / 180.0  # rad
Array = NDArray[np.float64]


def quaternions(roll: Array, pitch: Array, heading: Array) -> Array:
    """Half-angle product of the three turns, scalar first."""
    cr, sr = np.cos(roll / 2), np.sin(roll / 2)
    cp, sp = np.cos(pitch / 2), np.sin(pitch / 2)
    ch, sh = np.cos(heading / 2), np.sin(heading / 2)
    rows = (
        ch * cp * cr + sh * sp * sr,
        ch * cp * sr - sh * sp * cr,
        ch * sp * cr + sh * cp * sr,
        sh * cp * cr - ch * sp * sr,
    )
    return np.stack(rows, axis=1)


def a_trajectory(
    count: int = 2500, rate_hz: float = 100.0, *, jitter_s: float = 1e-4
) -> tuple[navgrade.Trajectory, dict[str, Array]]:
    """Numbers with all their digits in use, over every hemisphere; and the angles put in."""
    rng = np.random.default_rng(11)
    angles = {
        "roll": rng.uniform(-math.pi, math.pi, count),
        "pitch": rng.uniform(-1.4, 1.4, count),
        "heading": rng.uniform(-math.pi, math.pi, count),
    }
    t = (stamps(count, rate_hz, jitter_s=jitter_s) - EPOCH_NS) * 1e-9
    nav = navgrade.Trajectory(
        t=t,
        lat=rng.uniform(-1.5, 1.5, count),
        lon=rng.uniform(-4.0, 4.0, count),  # beyond ±180 deg as well
        h=rng.uniform(-400.0, 12_000.0, count),
        v_eb_n=rng.standard_normal((count, 3)) * 100.0,
        q_nb=quaternions(angles["roll"], angles["pitch"], angles["heading"]),
        status=rng.integers(0, 32, count).astype(np.uint32),
        epoch_ns=EPOCH_NS,
    )
    return nav, angles


def within_ulps(found: Array, wanted: Array, ulps: float) -> bool:
    """True when no number is further off than so many units in the last place."""
    return bool(np.all(np.abs(found - wanted) <= ulps * np.spacing(np.abs(wanted))))


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A trajectory as a file."""
    path = tmp_path_factory.mktemp("output") / "nav.mcap"
    navgrade.write_solution(path, a_trajectory()[0])
    return path


# ---- values ------------------------------------------------------------------------------------


@pytest.mark.parametrize("decoder", DECODERS)
def test_every_number_of_the_solution_is_kept(written: Path, decoder: str) -> None:
    nav, angles = a_trajectory()
    found = solution(written, DECODERS[decoder])
    assert found["stamp_ns"].tolist() == (EPOCH_NS + np.rint(nav.t * 1e9).astype(int)).tolist()
    exact = {
        "height_m": nav.h,
        "v_north_m_s": nav.v_eb_n[:, 0],
        "v_east_m_s": nav.v_eb_n[:, 1],
        "v_down_m_s": nav.v_eb_n[:, 2],
        "orientation.w": nav.q_nb[:, 0],
        "orientation.x": nav.q_nb[:, 1],
        "orientation.y": nav.q_nb[:, 2],
        "orientation.z": nav.q_nb[:, 3],
    }
    for name, values in exact.items():
        assert found[name].tobytes() == np.ascontiguousarray(values).tobytes(), name
    assert found["status"].tolist() == nav.status.tolist()
    # degrees are the radians over pi/180, one rounding: 1 ulp is 1.4e-14 deg, 1.6 nm on the ground
    assert within_ulps(found["latitude_deg"], nav.lat / DEG, 1.0)
    lon_deg = np.where(np.abs(nav.lon) > math.pi, nav.lon - np.sign(nav.lon) * 2 * math.pi, nav.lon)
    # beyond the date line a turn is subtracted: another 2 ulp of up to 229 deg
    np.testing.assert_allclose(found["longitude_deg"], lon_deg / DEG, rtol=0, atol=1e-13)
    assert np.all(np.abs(found["longitude_deg"]) <= 180.0)
    # Euler angles of a quaternion rounded to 1.1e-16; 80 deg of pitch makes it six times as much
    np.testing.assert_allclose(found["roll_deg"], angles["roll"] / DEG, rtol=0, atol=2e-13)
    np.testing.assert_allclose(found["pitch_deg"], angles["pitch"] / DEG, rtol=0, atol=2e-13)
    heading_deg = np.mod(angles["heading"] / DEG, 360.0)
    np.testing.assert_allclose(found["heading_deg"], heading_deg, rtol=0, atol=2e-13)
    assert np.all((found["heading_deg"] >= 0.0) & (found["heading_deg"] <= 360.0))


def test_decoders_agree_to_the_bit(written: Path) -> None:
    one, other = (solution(written, decoder) for decoder in DECODERS.values())
    assert one.keys() == other.keys()
    for name in one:
        assert one[name].tobytes() == other[name].tobytes(), name


def from_bits(text: str) -> float:
    """A float64 from its bits in hexadecimal."""
    (value,) = struct.unpack(">d", bytes.fromhex(text))
    return float(value)


def member(message: dict[str, Any], path: str) -> Any:
    """A member by its dotted path."""
    for name in path.split("."):
        message = message[name]
    return message


@pytest.mark.parametrize(
    ("topic", "floats", "integers"),
    [
        (SOLUTION, SOLUTION_FLOATS, ("status",)),
        (FIX, FIX_FLOATS, ("status.status", "status.service")),
        (ODOMETRY, ODOMETRY_FLOATS, ()),
    ],
)
def test_javascript_reads_the_same_bits(
    written: Path, topic: str, floats: tuple[str, ...], integers: tuple[str, ...]
) -> None:
    answer = by_node(written, topic, 50)
    reference: Columns = DECODERS["rosbags"](written, topic, floats, integers)
    rows = np.arange(len(reference["stamp_ns"]))
    assert answer["total"] == len(rows)
    assert answer["encoding"] == "ros2msg"
    rows = np.concatenate([rows[:50], rows[-50:]])
    assert len(answer["messages"]) == len(rows)
    for path in floats:
        bits = [member(message, path) for message in answer["messages"]]
        wanted = [struct.pack(">d", value).hex() for value in reference[path][rows]]
        assert bits == wanted, path
        assert from_bits(bits[0]) == reference[path][0]
    for path in ("header.stamp.sec", "header.stamp.nanosec", *integers):
        values = [member(message, path) for message in answer["messages"]]
        assert values == reference[path][rows].tolist(), path


@pytest.mark.parametrize("decoder", DECODERS)
def test_stamps_are_the_nearest_nanosecond(tmp_path: Path, decoder: str) -> None:
    """Hundredths of a second are no doubles: 0.57 s lies just below, 0.07 s just above."""
    nav, _ = a_trajectory(1000)
    path = tmp_path / "nav.mcap"
    navgrade.write_solution(path, dataclasses.replace(nav, t=np.arange(1000) / 100.0))
    wanted = [EPOCH_NS + 10_000_000 * k for k in range(1000)]
    assert solution(path, DECODERS[decoder])["stamp_ns"].tolist() == wanted


# ---- fixes -------------------------------------------------------------------------------------


@pytest.mark.parametrize("decoder", DECODERS)
def test_fixes_are_solutions_on_a_map(written: Path, decoder: str) -> None:
    nav = solution(written)
    fix = fixes(written, DECODERS[decoder])
    at = np.searchsorted(nav["stamp_ns"], fix["stamp_ns"])
    assert np.array_equal(nav["stamp_ns"][at], fix["stamp_ns"])
    for name, other in zip(FIX_FLOATS, SOLUTION_FLOATS[:3], strict=True):
        assert fix[name].tobytes() == nav[other][at].tobytes()


@pytest.mark.parametrize(
    ("rate_hz", "jitter_s"),
    [
        (4.0, 0.0),
        (10.0, 0.0),
        (10.0, 2e-3),
        (10.001, 2e-3),
        (9.999, 2e-3),
        (64.05, 33e-6),
        (1000.0, 0.0),
    ],
)
def test_fixes_come_at_10_hz_at_most(tmp_path: Path, rate_hz: float, jitter_s: float) -> None:
    """Jitter loses none, nor does a clock that drifts against the ticks more than it must."""
    nav, _ = a_trajectory(2000, rate_hz, jitter_s=jitter_s)
    path = tmp_path / "nav.mcap"
    navgrade.write_solution(path, nav)
    fix_ns = fixes(path)["stamp_ns"]
    seconds = float(nav.t[-1] - nav.t[0])
    assert fix_ns[0] == solution(path)["stamp_ns"][0]
    # one more where the last sample comes a little before its tick
    assert abs(len(fix_ns) - 1 - min(rate_hz, 10.0) * seconds) <= 1.0
    assert np.diff(fix_ns).max() <= 2e9 / min(rate_hz, 10.0)


def test_blocks_do_not_show_in_the_file(tmp_path: Path, written: Path) -> None:
    nav, _ = a_trajectory()
    path = tmp_path / "blocks.mcap"
    with SolutionWriter(path) as out:
        start = 0
        for size in (1, 2, 3, 700, 1, 1000, 5000):
            if start < len(nav):
                out.write(nav[start : start + size])
            start += size
    for read in (solution, fixes):
        whole, parts = read(written), read(path)
        for name in whole:
            assert whole[name].tobytes() == parts[name].tobytes(), name


@pytest.mark.parametrize("early_s", [0.0, 1e-6])
@pytest.mark.parametrize("rate_hz", [1.0, 7.0, 50.0, 100.0, 1000.0])
def test_an_output_rate_thins_the_rows_evenly(
    tmp_path: Path, rate_hz: float, early_s: float
) -> None:
    """The row nearest to each tick, whether its stamp is exact or a microsecond early."""
    nav, _ = a_trajectory(1001)
    t = np.arange(1001) / 100.0
    t[1:] -= early_s
    nav = dataclasses.replace(nav, t=t)
    path = tmp_path / "nav.mcap"
    with SolutionWriter(path, rate_hz=rate_hz) as out:
        for start in range(0, len(nav), 130):
            out.write(nav[start : start + 130])
    index = np.rint((solution(path)["stamp_ns"] - EPOCH_NS) / 1e7).astype(int)
    periods = range(int(10 * rate_hz) + 1)
    wanted = sorted({round(k * 100.0 / rate_hz) for k in periods})
    assert index.tolist() == [k for k in wanted if k <= 1000]


# ---- definitions -------------------------------------------------------------------------------

SOLUTION_FIELDS = [
    ("header", "std_msgs/msg/Header"),
    ("latitude_deg", "float64"),
    ("longitude_deg", "float64"),
    ("height_m", "float64"),
    ("v_north_m_s", "float64"),
    ("v_east_m_s", "float64"),
    ("v_down_m_s", "float64"),
    ("roll_deg", "float64"),
    ("pitch_deg", "float64"),
    ("heading_deg", "float64"),
    ("orientation", "geometry_msgs/msg/Quaternion"),
    ("status", "uint32"),
]
INCREMENT_FIELDS = [
    ("header", "std_msgs/msg/Header"),
    ("interval_s", "float64"),
    ("delta_angle", "geometry_msgs/msg/Vector3"),
    ("delta_velocity", "geometry_msgs/msg/Vector3"),
]


def definitions(path: Path) -> dict[str, Any]:
    """The types each schema of a file describes, as rosbags parses them."""
    types: dict[str, Any] = {}
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    for schema in summary.schemas.values():
        assert schema.encoding == "ros2msg"
        types |= get_types_from_msg(schema.data.decode(), schema.name)
    return types


def simple(fields: Any) -> list[tuple[str, str]]:
    """Names and types of the plain members."""
    return [(name, str(kind[1][0] if kind[0] == 1 else kind[1])) for name, kind in fields]


def test_the_solution_is_defined_by_the_agreed_names(written: Path) -> None:
    types = definitions(written)
    assert simple(types["navgrade_msgs/msg/NavSolution"][1]) == SOLUTION_FIELDS


@pytest.mark.parametrize(
    "name",
    [
        "sensor_msgs/msg/NavSatFix",
        "sensor_msgs/msg/NavSatStatus",
        "std_msgs/msg/Header",
        "builtin_interfaces/msg/Time",
        "geometry_msgs/msg/Quaternion",
        "nav_msgs/msg/Odometry",
        "geometry_msgs/msg/PoseWithCovariance",
        "geometry_msgs/msg/Pose",
        "geometry_msgs/msg/Point",
        "geometry_msgs/msg/TwistWithCovariance",
        "geometry_msgs/msg/Twist",
        "geometry_msgs/msg/Vector3",
        "tf2_msgs/msg/TFMessage",
        "geometry_msgs/msg/TransformStamped",
        "geometry_msgs/msg/Transform",
    ],
)
def test_borrowed_types_are_those_of_ros_2(written: Path, name: str) -> None:
    """Members; and for the fix, the values of its constants."""
    ours = definitions(written)[name]
    theirs = get_typestore(Stores.ROS2_HUMBLE).fielddefs[name]
    assert ours[1] == theirs[1]
    assert {c[:3] for c in ours[0]} <= {c[:3] for c in theirs[0]}


def test_increments_are_defined_by_the_agreed_names(tmp_path: Path) -> None:
    path = tmp_path / "imu.mcap"
    recording = random_recording(10).as_increments(np.full(10, 0.01))
    imu = navgrade.ImuSamples(
        t=np.arange(10) * 0.01,
        dt=recording.interval,
        gyro=recording.gyro,
        accel=recording.accel,
        kind="increment",
    )
    navgrade.write_increments(path, imu)
    assert simple(definitions(path)[INCREMENT][1]) == INCREMENT_FIELDS


# ---- the container -----------------------------------------------------------------------------


def test_the_container_has_summary_indexes_and_checksums(written: Path) -> None:
    nav, _ = a_trajectory()
    with written.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        header, summary = reader.get_header(), reader.get_summary()
        messages = list(reader.iter_messages())
    assert header.profile == "ros2"
    assert summary is not None
    assert summary.statistics is not None
    topics = {number: channel.topic for number, channel in summary.channels.items()}
    counts = {
        topics[number]: count for number, count in summary.statistics.channel_message_counts.items()
    }
    ten_hz = len(fixes(written)["stamp_ns"])
    assert counts == {SOLUTION: len(nav), FIX: ten_hz, ODOMETRY: ten_hz, TRANSFORMS: ten_hz}
    assert {channel.message_encoding for channel in summary.channels.values()} == {"cdr"}
    stamp_ns = EPOCH_NS + np.rint(nav.t * 1e9).astype(int)
    assert summary.statistics.message_start_time == stamp_ns[0]
    assert summary.statistics.message_end_time == stamp_ns[-1]
    assert summary.chunk_indexes
    for index in summary.chunk_indexes:
        assert index.compression == "zstd"
        assert index.message_index_offsets
    assert len(messages) == len(nav) + 3 * ten_hz
    for _, channel, message in messages:
        header_at = 8 if channel.topic == TRANSFORMS else 4  # after the number of transforms
        seconds, nanoseconds = struct.unpack_from("<iI", message.data, header_at)
        assert message.log_time == message.publish_time == seconds * 1_000_000_000 + nanoseconds

    with written.open("rb") as stream:
        records = list(StreamReader(stream, emit_chunks=True, validate_crcs=True).records)
    chunks = [record for record in records if isinstance(record, Chunk)]
    assert chunks
    assert all(chunk.uncompressed_crc for chunk in chunks)
    (end,) = [record for record in records if isinstance(record, DataEnd)]
    assert end.data_section_crc
    (footer,) = [record for record in records if isinstance(record, Footer)]
    assert footer.summary_crc


def test_nothing_appears_before_it_is_complete(tmp_path: Path) -> None:
    nav, _ = a_trajectory(100)
    path = tmp_path / "nav.mcap"
    with SolutionWriter(path) as out:
        out.write(nav)
        assert not path.exists()
        assert (tmp_path / "nav.mcap.part").exists()
    assert path.exists()
    assert [p.name for p in tmp_path.iterdir()] == ["nav.mcap"]


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_nothing(tmp_path: Path, error: type[BaseException]) -> None:
    nav, _ = a_trajectory(100)
    with pytest.raises(error), SolutionWriter(tmp_path / "nav.mcap") as out:
        out.write(nav)
        raise error
    assert not list(tmp_path.iterdir())


def test_an_existing_file_is_kept_unless_told(tmp_path: Path) -> None:
    nav, _ = a_trajectory(100)
    path = tmp_path / "nav.mcap"
    path.write_bytes(b"old")
    with pytest.raises(ConfigError, match=r"nav\.mcap exists"):
        navgrade.write_solution(path, nav)
    assert path.read_bytes() == b"old"
    navgrade.write_solution(path, nav, overwrite=True)
    assert len(solution(path)["stamp_ns"]) == 100


# ---- increments --------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["increment", "compensated"])
def test_increments_come_back_to_the_bit(tmp_path: Path, kind: str) -> None:
    count = 3000
    recording = random_recording(count)
    interval = 0.01 + 1e-5 * np.random.default_rng(3).random(count)
    imu = navgrade.ImuSamples(
        t=(recording.stamp_ns - EPOCH_NS) * 1e-9,
        dt=interval,
        gyro=recording.gyro,
        accel=recording.accel,
        kind=kind,  # type: ignore[arg-type]  # a parameter of the test
        epoch_ns=EPOCH_NS,
    )
    path = tmp_path / "imu.mcap"
    navgrade.write_increments(path, imu, topic="/imu/left", frame_id="left_mast")
    floats = ["interval_s"] + [f"delta_{v}.{i}" for v in ("angle", "velocity") for i in "xyz"]
    for decoder in DECODERS.values():
        found = decoder(path, "/imu/left", floats, [])
        assert found["stamp_ns"].tolist() == recording.stamp_ns.tolist()
        written = np.stack([found[name] for name in floats], axis=1)
        given = np.concatenate([interval[:, None], recording.gyro, recording.accel], axis=1)
        assert written.tobytes() == given.tobytes()
    back = navgrade.read_imu(path, axes="FRD", kind=kind)
    for name in ("t", "dt", "gyro", "accel"):
        assert getattr(back, name).tobytes() == getattr(imu, name).tobytes()
    assert back.epoch_ns == EPOCH_NS
    told = navgrade.read_imu(path)  # the file says kind and axes itself
    assert told.kind == kind
    assert told.gyro.tobytes() == imu.gyro.tobytes()


@pytest.mark.parametrize("kind", ["rate", "average"])
def test_rates_are_not_written_as_increments(tmp_path: Path, kind: str) -> None:
    imu = navgrade.ImuSamples(
        t=[0.0, 0.1],
        gyro=np.zeros((2, 3)),
        accel=np.ones((2, 3)),
        kind=kind,  # type: ignore[arg-type]
    )
    with pytest.raises(ValueError, match=f"kind '{kind}'"):
        navgrade.write_increments(tmp_path / "imu.mcap", imu)
    assert not list(tmp_path.iterdir())
