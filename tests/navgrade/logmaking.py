"""IMU logs for tests, written without the project's writer.

The container comes from the official library, each message is packed by hand: CDR is a C
structure after four bytes of encapsulation, every member aligned to its own size.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from numpy.typing import ArrayLike, NDArray

from tests.oracles.constants import OMEGA

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]

EPOCH_NS = 1_767_225_600_123_456_789  # 2026-01-01T00:00:00.123456789Z
DEG = math.pi / 180.0  # rad
GRAVITY_45 = 9.806198  # m/s^2, normal gravity at 45 deg and height 0 (WGS-84), to 1 um/s^2

_LINE = "=" * 80
_HEADER = """\
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""
_TIME = """\
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_VECTOR3 = """\
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
"""
_QUATERNION = """\
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
"""
IMU = "sensor_msgs/msg/Imu"
IMU_TEXT = f"\n{_LINE}\n".join(
    (
        """\
# Comments and blank lines stand in the definitions robots record.
std_msgs/Header header

geometry_msgs/Quaternion orientation
float64[9] orientation_covariance # Row major about x, y, z axes

geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance

geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
""",
        _HEADER,
        _TIME,
        _QUATERNION,
        _VECTOR3,
    )
)
INCREMENT = "navgrade_msgs/msg/ImuIncrement"
INCREMENT_TEXT = f"\n{_LINE}\n".join(
    (
        """\
std_msgs/Header header
float64 interval_s
geometry_msgs/Vector3 delta_angle
geometry_msgs/Vector3 delta_velocity
""",
        _HEADER,
        _TIME,
        _VECTOR3,
    )
)
STRING = "std_msgs/msg/String"
STRING_TEXT = "string data\n"

COMPRESSIONS = {
    "none": CompressionType.NONE,
    "lz4": CompressionType.LZ4,
    "zstd": CompressionType.ZSTD,
}


@dataclass(frozen=True)
class Recording:
    """Columns to be written: stamps (ns), angular rates and specific forces or their integrals.

    `interval` (s) makes the messages ImuIncrement, None makes them Imu.
    """

    stamp_ns: Stamps
    gyro: Array
    accel: Array
    interval: Array | None = None

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def rows(self, keep: ArrayLike | slice) -> Recording:
        """Only the rows of `keep`, an index of NumPy."""
        index = keep if isinstance(keep, slice) else np.asarray(keep)
        interval = None if self.interval is None else self.interval[index]
        return Recording(self.stamp_ns[index], self.gyro[index], self.accel[index], interval)

    def without(self, first: int, count: int) -> Recording:
        """Leave `count` rows out, from `first` on."""
        return self.rows(np.delete(np.arange(len(self)), np.arange(first, first + count)))

    def scaled(self, gyro: float = 1.0, accel: float = 1.0) -> Recording:
        """Values multiplied, stamps kept."""
        return replace(self, gyro=self.gyro * gyro, accel=self.accel * accel)

    def as_increments(self, interval: Array) -> Recording:
        """Mean rates times their intervals."""
        by = interval[:, None]
        return Recording(self.stamp_ns, self.gyro * by, self.accel * by, interval)


@dataclass(frozen=True)
class Channel:
    """One topic: messages as bytes, and the log time of each, ns."""

    topic: str
    schema: str
    text: str
    messages: Sequence[bytes]
    log_ns: Sequence[int]
    encoding: str = "ros2msg"
    message_encoding: str = "cdr"


def _packer(doubles: int, frame_id: str, order: str) -> Callable[..., bytes]:
    """Pack (sec, nanosec, doubles) after a header with `frame_id`, big- or little-endian."""
    text = frame_id.encode() + b"\0"
    pad = -(12 + len(text)) % 8  # bytes up to the next multiple of 8, where doubles stand
    layout = struct.Struct(f"{order}4siII{len(text)}s{pad}x{doubles}d")
    encapsulation = b"\0\1\0\0" if order == "<" else b"\0\0\0\0"

    def pack(sec: int, nanosec: int, values: Sequence[float]) -> bytes:
        return layout.pack(encapsulation, sec, nanosec, len(text), text, *values)

    return pack


def messages_of(
    recording: Recording, frame_ids: Sequence[str] = ("imu",), order: str = "<"
) -> list[bytes]:
    """CDR bytes of each row; `frame_ids` are used in turn."""
    vectors = np.concatenate([recording.gyro, recording.accel], axis=1)
    if recording.interval is None:
        columns = np.zeros((len(recording), 37))
        columns[:, 0:4] = 0.1, -0.2, 0.3, 0.9  # an orientation, to be left alone
        columns[:, 4:13] = -1.0
        columns[:, 13:16] = vectors[:, :3]
        columns[:, 16:25] = -2.0
        columns[:, 25:28] = vectors[:, 3:]
        columns[:, 28:37] = -3.0
    else:
        columns = np.concatenate([recording.interval[:, None], vectors], axis=1)
    packers = [_packer(columns.shape[1], name, order) for name in frame_ids]
    seconds, nanoseconds = np.divmod(recording.stamp_ns, 1_000_000_000)
    times = zip(seconds.tolist(), nanoseconds.tolist(), strict=True)
    return [
        packers[k % len(packers)](sec, nanosec, row)
        for k, ((sec, nanosec), row) in enumerate(zip(times, columns.tolist(), strict=True))
    ]


def imu_channel(
    recording: Recording,
    topic: str = "/imu/data_raw",
    *,
    frame_ids: Sequence[str] = ("imu",),
    order: str = "<",
    log_ns: ArrayLike | None = None,
) -> Channel:
    """A topic of Imu or ImuIncrement; log time is the stamp unless `log_ns` says otherwise."""
    schema, text = (IMU, IMU_TEXT) if recording.interval is None else (INCREMENT, INCREMENT_TEXT)
    log = recording.stamp_ns if log_ns is None else np.asarray(log_ns, np.int64)
    return Channel(topic, schema, text, messages_of(recording, frame_ids, order), log.tolist())


def text_channel(topic: str = "/chatter", count: int = 5, step_ns: int = 100_000_000) -> Channel:
    """A topic of std_msgs/String, of no use for navigation."""
    message = b"\0\1\0\0" + struct.pack("<I6s", 6, b"hello\0")
    log_ns = [EPOCH_NS + k * step_ns for k in range(count)]
    return Channel(topic, STRING, STRING_TEXT, [message] * count, log_ns)


def write_log(
    path: Path,
    *channels: Channel,
    compression: str = "zstd",
    chunk_bytes: int = 1 << 20,
    chunked: bool = True,
    summary: bool = True,
    index: IndexType = IndexType.ALL,
    attachment: tuple[str, bytes] | None = None,
) -> Path:
    """Write channels as MCAP, their messages merged by log time."""
    with path.open("wb") as stream:
        writer = Writer(
            stream,
            chunk_size=chunk_bytes,
            compression=COMPRESSIONS[compression],
            use_chunking=chunked,
            index_types=index,
            repeat_channels=summary,
            repeat_schemas=summary,
            use_statistics=summary,
            use_summary_offsets=summary,
            enable_data_crcs=True,
        )
        writer.start(profile="ros2", library="tests")
        rows: list[tuple[int, int, bytes]] = []
        for channel in channels:
            schema = writer.register_schema(channel.schema, channel.encoding, channel.text.encode())
            number = writer.register_channel(channel.topic, channel.message_encoding, schema)
            rows += [
                (log_ns, number, message)
                for log_ns, message in zip(channel.log_ns, channel.messages, strict=True)
            ]
        if len(channels) > 1:
            rows.sort(key=lambda row: row[0])
        for log_ns, number, message in rows:
            writer.add_message(number, log_ns, message, log_ns)
        if attachment is not None:
            writer.add_attachment(EPOCH_NS, EPOCH_NS, attachment[0], "text/plain", attachment[1])
        writer.finish()
    return path


@dataclass(frozen=True)
class Record:
    """Where a record of an MCAP file stands: its opcode, and its content's place in bytes."""

    opcode: int
    start: int
    length: int


CHUNK = 0x06


def records_of(path: Path) -> list[Record]:
    """Every record of the file outside chunks, found by walking opcodes and lengths."""
    data = path.read_bytes()
    found, at = [], 8  # after the magic
    while at < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        found.append(Record(opcode, at + 9, length))
        at += 9 + length
    return found


def chunks_of(path: Path) -> list[Record]:
    """The chunks of the file, in order."""
    return [record for record in records_of(path) if record.opcode == CHUNK]


def invert(path: Path, at: int, count: int = 1) -> None:
    """Damage bytes of the file in place."""
    data = bytearray(path.read_bytes())
    data[at : at + count] = bytes(byte ^ 0xFF for byte in data[at : at + count])
    path.write_bytes(data)


def damage_chunk(path: Path, number: int) -> None:
    """Damage eight bytes in the middle of a chunk's stored records."""
    chunk = chunks_of(path)[number]
    invert(path, chunk.start + chunk.length // 2, 8)


def stamps(count: int, rate_hz: float = 100.0, *, jitter_s: float = 0.0, seed: int = 1) -> Stamps:
    """Stamps from EPOCH_NS on, each moved by a uniform jitter of up to `jitter_s`."""
    ideal = np.arange(count) / rate_hz
    moved = ideal + np.random.default_rng(seed).uniform(-jitter_s, jitter_s, count)
    stamp_ns: Stamps = EPOCH_NS + np.rint((moved - moved[0]) * 1e9).astype(np.int64)
    return stamp_ns


def random_recording(count: int, rate_hz: float = 100.0, *, seed: int = 2) -> Recording:
    """Numbers with all their digits in use, of the size an IMU gives."""
    noise = np.random.default_rng(seed).standard_normal((2, count, 3))
    return Recording(stamps(count, rate_hz, jitter_s=1e-4, seed=seed), noise[0], 9.8 * noise[1])


def body_axes(roll: float, pitch: float, heading: float) -> Array:
    """Matrix from north-east-down to forward-right-down, from the three turns (rad) in order."""
    cr, sr = math.cos(roll), math.sin(roll)
    cp, sp = math.cos(pitch), math.sin(pitch)
    ch, sh = math.cos(heading), math.sin(heading)
    about_down = np.array([[ch, sh, 0.0], [-sh, ch, 0.0], [0.0, 0.0, 1.0]])
    about_right = np.array([[cp, 0.0, -sp], [0.0, 1.0, 0.0], [sp, 0.0, cp]])
    about_forward = np.array([[1.0, 0.0, 0.0], [0.0, cr, sr], [0.0, -sr, cr]])
    turned: Array = about_forward @ about_right @ about_down
    return turned


def resting(
    seconds: float,
    rate_hz: float = 100.0,
    *,
    lat_deg: float = 45.0,
    roll_deg: float = 2.0,
    pitch_deg: float = -3.0,
    heading_deg: float = 70.0,
    gravity: float = GRAVITY_45,
    sway_from_s: float = math.inf,
) -> Recording:
    """What an ideal IMU at rest feels, in forward-right-down; from `sway_from_s` on it is moved.

    The motion is made up (2 deg/s and 0.3 m/s^2 at 0.5 Hz): it lets every number of a solution
    change, and is not meant to be the truth of anything.
    """
    t = np.arange(round(seconds * rate_hz) + 1) / rate_hz
    to_body = body_axes(roll_deg * DEG, pitch_deg * DEG, heading_deg * DEG)
    lat = lat_deg * DEG
    rate = to_body @ np.array([OMEGA * math.cos(lat), 0.0, -OMEGA * math.sin(lat)])
    force = to_body @ np.array([0.0, 0.0, -gravity])
    sway = np.sin(math.pi * np.maximum(t - sway_from_s, 0.0))[:, None]
    gyro = rate + 2.0 * DEG * sway * np.array([0.5, -0.7, 0.5])
    accel = force + 0.3 * sway * np.array([0.6, 0.8, 0.1])
    return Recording(stamps(len(t), rate_hz), gyro, accel)


def from_body_axes(recording: Recording, axes: str) -> Recording:
    """Vectors given in forward-right-down as an IMU with these axes would record them."""
    columns = {"F": (0, 1), "R": (1, 1), "D": (2, 1), "B": (0, -1), "L": (1, -1), "U": (2, -1)}
    picks = [columns[letter] for letter in axes]

    def turned(vectors: Array) -> Array:
        return np.stack([sign * vectors[:, i] for i, sign in picks], axis=1)

    return replace(recording, gyro=turned(recording.gyro), accel=turned(recording.accel))


SITE = """\
[imu]
kind = "average"
axes = "FRD"
[imu.errors]
gyro_bias_deg_h = 0.01
accel_bias_ug = 50.0
[site]
latitude = 45.0
longitude = 8.0
height_m = 0.0
[alignment]
start_s = 0.0
duration_s = 10.0
"""

START = """\
[imu]
kind = "average"
axes = "FRD"
[initial]
time_ns = {time_ns}
latitude = {latitude}
longitude = 8.0
height_m = 0.0
velocity_ned_m_s = {velocity}
roll_deg = 2.0
pitch_deg = -3.0
heading_deg = 70.0
"""


def started_site(
    time_ns: int = EPOCH_NS,
    latitude: float = 45.0,
    velocity: Sequence[float] = (0.0, 0.0, 0.0),
) -> str:
    """A site file with a known state instead of an alignment."""
    return START.format(time_ns=time_ns, latitude=latitude, velocity=list(velocity))
