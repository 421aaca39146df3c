"""Small valid logs that mutations start from, and what is in them.

Containers come from the official library, messages are packed by hand. The sequence number of a
message is its row in the truth.
"""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from numpy.typing import NDArray

from tests.navgrade.logmaking import EPOCH_NS, IMU, IMU_TEXT, imu_channel, random_recording

STEP_NS = 10_000_000
_SEPARATOR = "=" * 80

_TAG_TEXT = f"""\
std_msgs/Header header
string label
float64[] values
uint16 code
{_SEPARATOR}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_SEPARATOR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
_ROS1_TEXT = f"""\
Header header
float32 temperature
float64[3] force
{_SEPARATOR}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
"""
_JSON_TEXT = json.dumps(
    {"type": "object", "properties": {"x": {"type": "number"}, "n": {"type": "integer"}}}
)

Columns = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Topic:
    """One topic: its description, its messages and what fields of them are worth."""

    name: str
    schema: tuple[str, str, str]  # name, encoding, text
    encoding: str
    log_ns: NDArray[np.int64]
    publish_ns: NDArray[np.int64]
    messages: tuple[bytes, ...]
    columns: Columns


@dataclass(frozen=True)
class Sample:
    """A valid log and its truth."""

    name: str
    data: bytes
    topics: dict[str, Topic]
    chunked: bool


def _topic(
    name: str,
    schema: tuple[str, str, str],
    encoding: str,
    messages: list[bytes],
    columns: Columns,
    first_ns: int,
) -> Topic:
    log_ns = EPOCH_NS + first_ns + STEP_NS * np.arange(len(messages))
    return Topic(name, schema, encoding, log_ns, log_ns - 1_234, tuple(messages), columns)


def _stamp(k: int) -> tuple[int, int]:
    return divmod(EPOCH_NS + k * STEP_NS, 1_000_000_000)


def _stamps(count: int) -> NDArray[np.int64]:
    return EPOCH_NS + STEP_NS * np.arange(count)


def imu(name: str, count: int, order: str = "<", frame_ids: tuple[str, ...] = ("imu",)) -> Topic:
    """A topic of sensor_msgs/Imu; its frame may change from message to message."""
    recording = random_recording(count, seed=len(name))
    columns = {
        "header.stamp": recording.stamp_ns,
        "angular_velocity": recording.gyro,
        "linear_acceleration.z": recording.accel[:, 2],
        "angular_velocity_covariance": np.full((count, 9), -2.0),
    }
    messages = imu_channel(recording, frame_ids=frame_ids, order=order).messages
    return _topic(name, (IMU, "ros2msg", IMU_TEXT), "cdr", list(messages), columns, 0)


def tags(name: str, count: int) -> Topic:
    """A topic whose texts and sequences have other lengths in every message."""
    values = np.random.default_rng(7).standard_normal((count, 4))
    messages = []
    for k in range(count):
        label = b"x" * (k % 5) + b"\0"
        body = struct.pack("<iII4s", *_stamp(k), 4, b"map\0")
        body += struct.pack("<I", len(label)) + label
        body += bytes(-len(body) % 4)
        length = 1 + k % 4
        body += struct.pack("<I", length)
        body += bytes(-len(body) % 8)
        body += values[k, :length].tobytes() + struct.pack("<H", k)
        messages.append(b"\0\1\0\0" + body)
    columns: Columns = {
        "header.stamp": _stamps(count),
        "values.0": values[:, 0],
        "code": np.arange(count),
        "label": np.array(["x" * (k % 5) for k in range(count)], object),
    }
    schema = ("demo_msgs/msg/Tag", "ros2msg", _TAG_TEXT)
    return _topic(name, schema, "cdr", messages, columns, 1_000_000)


def ros1(name: str, count: int) -> Topic:
    """A topic as the first ROS serialises it: packed without gaps."""
    force = np.random.default_rng(8).standard_normal((count, 3))
    messages = [
        struct.pack("<4I5sf3d", k, *_stamp(k), 5, b"mast1", 0.5 * k, *force[k])
        for k in range(count)
    ]
    columns: Columns = {
        "header.stamp": _stamps(count),
        "temperature": 0.5 * np.arange(count),
        "force": force,
    }
    schema = ("demo_msgs/Probe", "ros1msg", _ROS1_TEXT)
    return _topic(name, schema, "ros1", messages, columns, 2_000_000)


def json_topic(name: str, count: int) -> Topic:
    """A topic of JSON objects."""
    x = np.random.default_rng(9).standard_normal(count)
    messages = [json.dumps({"x": x[k], "n": k}).encode() for k in range(count)]
    columns: Columns = {"x": x, "n": np.arange(count)}
    return _topic(name, ("demo.Point", "jsonschema", _JSON_TEXT), "json", messages, columns, 3_000)


def written(
    topics: list[Topic],
    *,
    compression: str = "zstd",
    chunk_bytes: int = 2_500,
    chunked: bool = True,
    summary: bool = True,
    index: IndexType = IndexType.ALL,
    extras: bool = True,
) -> bytes:
    """The topics as an MCAP file, merged by log time; with an attachment and metadata."""
    stream = io.BytesIO()
    writer = Writer(
        stream,
        chunk_size=chunk_bytes,
        compression=CompressionType[compression.upper()],
        use_chunking=chunked,
        index_types=index if summary else IndexType.NONE,
        repeat_channels=summary,
        repeat_schemas=summary,
        use_statistics=summary,
        use_summary_offsets=summary,
        enable_data_crcs=True,
    )
    writer.start(profile="ros2", library="tests.fuzz")
    rows = []
    for topic in topics:
        name, encoding, text = topic.schema
        schema = writer.register_schema(name, encoding, text.encode())
        number = writer.register_channel(
            topic.name, topic.encoding, schema, {"offered": "by\ntest"}
        )
        times = zip(topic.log_ns.tolist(), topic.publish_ns.tolist(), strict=True)
        rows += [(log_ns, number, k, publish) for k, (log_ns, publish) in enumerate(times)]
    for log_ns, number, k, publish_ns in sorted(rows):
        writer.add_message(number, log_ns, topics[number - 1].messages[k], publish_ns, k)
    if extras:
        writer.add_attachment(EPOCH_NS, EPOCH_NS, "site.toml", "text/plain", b"[imu]\n" * 20)
        writer.add_metadata("device", {"serial": "0042", "rate": "100"})
    writer.finish()
    return stream.getvalue()


def corpus() -> list[Sample]:
    """Every layout of file and message worth mutating."""
    return list(_samples())


def _samples() -> Iterator[Sample]:
    def sample(name: str, topics: list[Topic], **container: Any) -> Sample:
        data = written(topics, **container)
        chunked = container.get("chunked", True)
        return Sample(name, data, {topic.name: topic for topic in topics}, chunked)

    mixed = [imu("/imu", 16), tags("/tags", 12), ros1("/probe", 10), json_topic("/point", 8)]
    for compression in ("zstd", "lz4", "none"):
        yield sample(f"mixed {compression}", mixed, compression=compression)
    yield sample("unchunked", mixed, chunked=False)
    yield sample("unchunked, no summary", mixed, chunked=False, summary=False)
    yield sample("no summary", mixed, summary=False)
    yield sample("no summary, lz4", mixed, summary=False, compression="lz4", extras=False)
    without = IndexType.ALL & ~IndexType.MESSAGE
    yield sample("no message index", mixed, index=without)
    yield sample("no chunk index", mixed, index=IndexType.MESSAGE | IndexType.ATTACHMENT)
    yield sample("one imu", [imu("/imu", 40)], chunk_bytes=4_000)
    yield sample("one chunk", [imu("/imu", 40)], compression="none", chunk_bytes=1 << 20)
    big = imu("/imu", 20, ">", ("a", "imu", "mast", ""))
    yield sample("big-endian frames", [big, tags("/tags", 20)], compression="lz4")
    two = [imu("/imu/left", 12), imu("/imu/right", 12, frame_ids=("r", "right"))]
    yield sample("two imus", two, compression="none")
