"""Columns are the numbers that were written, whatever the layout of messages and file."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from navgrade.errors import LogError, SchemaError
from navgrade.logs.container import Columns, McapFile
from tests.navgrade.logmaking import (
    EPOCH_NS,
    IMU,
    IMU_TEXT,
    Channel,
    imu_channel,
    messages_of,
    random_recording,
    text_channel,
    write_log,
)

VECTORS = ("angular_velocity", "linear_acceleration")
ALL = "/all"


def joined(parts: Sequence[Columns], path: str) -> np.ndarray:
    """One column of a whole reading."""
    return np.concatenate([part.fields[path] for part in parts])


def one_topic(path: Path, text: str, messages: Sequence[bytes], **how: str) -> McapFile:
    """A file with one topic of a made-up type."""
    log_ns = [EPOCH_NS + k for k in range(len(messages))]
    write_log(path, Channel(ALL, "made_msgs/msg/Up", text, messages, log_ns, **how))
    return McapFile(path)


@pytest.mark.parametrize("threads", [1, 2, None])
@pytest.mark.parametrize("chunk_bytes", [3_000, 1 << 20])
def test_times_counters_and_values(tmp_path: Path, chunk_bytes: int, threads: int | None) -> None:
    recording = random_recording(3000)
    log_ns = recording.stamp_ns + np.arange(3000) % 7
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream, chunk_size=chunk_bytes)
        writer.start()
        schema = writer.register_schema(IMU, "ros2msg", IMU_TEXT.encode())
        channel = writer.register_channel("/imu", "cdr", schema)
        for k, message in enumerate(messages_of(recording)):
            writer.add_message(channel, int(log_ns[k]), message, int(log_ns[k]) - 5, k + 10)
        writer.finish()
    fields = {"/imu": ["header.stamp", "header.frame_id", *VECTORS]}
    parts = list(McapFile(tmp_path / "a.mcap").columns(fields, threads=threads))
    assert np.array_equal(np.concatenate([p.log_time_ns for p in parts]), log_ns)
    assert np.array_equal(np.concatenate([p.publish_time_ns for p in parts]), log_ns - 5)
    assert np.array_equal(np.concatenate([p.sequence for p in parts]), np.arange(3000) + 10)
    assert np.array_equal(joined(parts, "header.stamp"), recording.stamp_ns)
    assert joined(parts, "angular_velocity").tobytes() == recording.gyro.tobytes()
    assert joined(parts, "linear_acceleration").tobytes() == recording.accel.tobytes()
    assert set(joined(parts, "header.frame_id")) == {"imu"}
    assert {p.topic for p in parts} == {"/imu"}


def test_an_open_file_is_read_like_a_path(tmp_path: Path) -> None:
    recording = random_recording(500)
    path = write_log(tmp_path / "a.mcap", imu_channel(recording, "/imu"))
    parts = list(McapFile(io.BytesIO(path.read_bytes())).columns({"/imu": VECTORS}))
    assert joined(parts, "angular_velocity").tobytes() == recording.gyro.tobytes()


@pytest.mark.parametrize("how", [{}, {"summary": False}, {"chunked": False}])
def test_two_topics_at_once_among_others(tmp_path: Path, how: dict[str, bool]) -> None:
    """Their chunks have no regular distances: each record is looked for."""
    first, second = random_recording(700), random_recording(400, seed=9)
    path = write_log(
        tmp_path / "a.mcap",
        imu_channel(first, "/a"),
        imu_channel(second, "/b", frame_ids=("x", "a longer name")),
        text_channel(count=50),
        chunk_bytes=20_000,
        **how,
    )
    parts = list(McapFile(path).columns({"/a": VECTORS, "/b": VECTORS}))
    for topic, recording in (("/a", first), ("/b", second)):
        mine = [part for part in parts if part.topic == topic]
        assert joined(mine, "angular_velocity").tobytes() == recording.gyro.tobytes()
        assert joined(mine, "linear_acceleration").tobytes() == recording.accel.tobytes()


def test_a_topic_on_two_channels_comes_in_file_order(tmp_path: Path) -> None:
    recording = random_recording(600)
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema(IMU, "ros2msg", IMU_TEXT.encode())
        channels = [
            writer.register_channel("/imu", "cdr", schema, metadata={"copy": str(k)})
            for k in range(2)
        ]
        for k, message in enumerate(messages_of(recording)):
            writer.add_message(channels[k % 2], k, message, k)
        writer.finish()
    parts = list(McapFile(tmp_path / "a.mcap").columns({"/imu": VECTORS}))
    assert joined(parts, "angular_velocity").tobytes() == recording.gyro.tobytes()


@pytest.mark.parametrize("how", [{}, {"summary": False}, {"chunked": False}])
@pytest.mark.parametrize(("start", "end"), [(100, 200), (None, 7), (493, None), (250, 250)])
def test_a_window_of_log_time_is_half_open(
    tmp_path: Path, how: dict[str, bool], start: int | None, end: int | None
) -> None:
    recording = random_recording(500)
    channel = imu_channel(recording, "/imu")
    path = write_log(tmp_path / "a.mcap", channel, chunk_bytes=9_000, **how)
    stamp_ns = recording.stamp_ns
    parts = list(
        McapFile(path).columns(
            {"/imu": ["header.stamp"]},
            start_ns=None if start is None else int(stamp_ns[start]),
            end_ns=None if end is None else int(stamp_ns[end]),
        )
    )
    found = joined(parts, "header.stamp") if parts else np.empty(0)
    assert np.array_equal(found, stamp_ns[start:end])


TREE = """\
uint8 flag
string[] names
made_msgs/Point[] track
float32[3] small
uint64 huge
bool yes
int16[] counts
made_msgs/Quaternion q
builtin_interfaces/Time when
string last
================================================================================
MSG: made_msgs/Point
float64 x
float64 y
string label
================================================================================
MSG: made_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


class Cdr:
    """Packs CDR by its rule: each number at a multiple of its size."""

    def __init__(self, order: str = "<", *, aligned: bool = True) -> None:
        self.order, self.aligned = order, aligned
        self.body = b""

    def put(self, code: str, *values: float) -> Cdr:
        """Append numbers."""
        for value in values:
            size = struct.calcsize(code)
            if self.aligned:
                self.body += bytes(-len(self.body) % size)
            self.body += struct.pack(self.order + code, value)
        return self

    def text(self, text: str, end: bytes = b"\0") -> Cdr:
        """Append a text."""
        data = text.encode() + end
        self.put("I", len(data))
        self.body += data
        return self

    def message(self) -> bytes:
        """The whole message."""
        return (b"\0\1\0\0" if self.order == "<" else b"\0\0\0\0") + self.body


def tree_message(k: int, order: str = "<") -> bytes:
    """Message k of TREE; its texts and sequences differ from k to k."""
    cdr = Cdr(order).put("B", k % 256).put("I", k % 3)
    for i in range(k % 3):
        cdr.text("n" * (i + k % 5))
    cdr.put("I", k % 4)
    for i in range(k % 4):
        cdr.put("d", k + 0.5, -k - i).text("p" * (k % 7))
    cdr.put("f", 0.25 * k, 0.5, -k).put("Q", 2**63 - 1 - k).put("?", k % 2)
    cdr.put("I", k % 2).put("h", *([-k] * (k % 2)))
    cdr.put("d", 0.1, 0.2, 0.3, k).put("i", k).put("I", 999_999_999)
    return cdr.text(f"end {k}").message()


@pytest.mark.parametrize("order", ["<", ">"])
def test_members_after_texts_and_sequences(tmp_path: Path, order: str) -> None:
    count = 400  # each message has a layout of its own, and there are more than are tried
    file = one_topic(tmp_path / "a.mcap", TREE, [tree_message(k, order) for k in range(count)])
    paths = [
        *("flag", "small", "small.2", "huge", "yes", "q", "when", "last"),
        *("track.0.y", "track.2.x", "track.1.label"),
    ]
    parts = list(file.columns({ALL: paths}))
    k = np.arange(count)
    assert joined(parts, "flag").dtype == np.int64
    assert np.array_equal(joined(parts, "flag"), k % 256)
    small = np.stack([0.25 * k, np.full(count, 0.5), -1.0 * k], axis=1)
    assert np.array_equal(joined(parts, "small"), small)  # exact in 24 bits
    assert np.array_equal(joined(parts, "small.2"), -1.0 * k)
    assert joined(parts, "huge").tolist() == [2**63 - 1 - i for i in range(count)]
    assert np.array_equal(joined(parts, "yes"), k % 2 == 1)
    q = np.stack([np.full(count, 0.1), np.full(count, 0.2), np.full(count, 0.3), k], axis=1)
    assert joined(parts, "q").tobytes() == q.tobytes()
    assert joined(parts, "when").tolist() == [i * 10**9 + 999_999_999 for i in range(count)]
    assert joined(parts, "last").tolist() == [f"end {i}" for i in range(count)]
    assert np.array_equal(joined(parts, "track.0.y"), np.where(k % 4 > 0, -k, np.nan), True)
    assert np.array_equal(joined(parts, "track.2.x"), np.where(k % 4 > 2, k + 0.5, np.nan), True)
    labels = ["p" * (i % 7) if i % 4 > 1 else "" for i in range(count)]
    assert joined(parts, "track.1.label").tolist() == labels


def test_equal_sizes_with_other_lengths_are_told_apart(tmp_path: Path) -> None:
    """One byte moved from one text to the other: only the length words say so."""
    text = "string a\nstring b\nfloat64 value\n"
    messages = [
        Cdr().text("x" * (1 + k % 3)).text("y" * (3 - k % 3)).put("d", k).message()
        for k in range(100)
    ]
    assert len({len(message) for message in messages}) == 1
    parts = list(one_topic(tmp_path / "a.mcap", text, messages).columns({ALL: ["b", "value"]}))
    assert joined(parts, "value").tolist() == list(range(100))
    assert joined(parts, "b").tolist() == ["y" * (3 - k % 3) for k in range(100)]


def test_ros_1_is_the_same_without_alignment(tmp_path: Path) -> None:
    text = (
        "Header header\nuint8 odd\nfloat64[2] pair\nduration lag\n"
        "================================================================================\n"
        "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
    )
    messages = []
    for k in range(50):
        ros = Cdr(aligned=False).put("I", k, 1_700_000_000 + k, 5).text("f" * (k % 3), b"")
        messages.append(ros.put("B", 7).put("d", k, -k).put("i", -1, 250).body)
    file = one_topic(
        tmp_path / "a.mcap", text, messages, encoding="ros1msg", message_encoding="ros1"
    )
    paths = ["header.stamp", "header.frame_id", "pair", "odd", "lag"]
    parts = list(file.columns({ALL: paths}))
    assert joined(parts, "header.stamp").tolist() == [
        (1_700_000_000 + k) * 10**9 + 5 for k in range(50)
    ]
    assert joined(parts, "header.frame_id").tolist() == ["f" * (k % 3) for k in range(50)]
    assert joined(parts, "pair").tolist() == [[k, -k] for k in range(50)]
    assert joined(parts, "lag").tolist() == [250 - 10**9] * 50


def test_json(tmp_path: Path) -> None:
    messages = [
        json.dumps(
            {
                "stamp": {"sec": k, "nanosec": 7},
                "gyro": {"x": 0.1 * k, "y": 2.0, "z": 3.5},
                "list": [1.5, k],
                "id": 2**60 + k,
                "who": f"no {k}",
            }
        ).encode()
        for k in range(30)
    ]
    file = one_topic(
        tmp_path / "a.mcap", "{}", messages, encoding="jsonschema", message_encoding="json"
    )
    parts = list(file.columns({ALL: ["stamp", "gyro", "list.1", "id", "who"]}))
    assert joined(parts, "stamp").tolist() == [k * 10**9 + 7 for k in range(30)]
    assert joined(parts, "gyro").tolist() == [[0.1 * k, 2.0, 3.5] for k in range(30)]
    assert joined(parts, "list.1").tolist() == list(range(30))
    assert joined(parts, "id").tolist() == [2**60 + k for k in range(30)]
    assert joined(parts, "who").tolist() == [f"no {k}" for k in range(30)]
    with pytest.raises(SchemaError, match=r"no gyro\.w"):
        list(McapFile(tmp_path / "a.mcap").columns({ALL: ["gyro.w"]}))


REFUSALS = {
    "nothing": "there is no nothing; there is flag, names,",
    "q.a": "there is no a in q; there is x, y, z, w",
    "q.x.y": "q.x is a float64, it has no y",
    "names": "names is a sequence of any length; ask for one element, names.0",
    "counts": "counts is a sequence of any length; ask for one element, counts.0",
    "track": "track is an array of structures; ask for one, track.0",
    "track.0": "track.0 is a structure of x, y, label; ask for one of them",
    "small.3": "small has 3 elements, there is no 3",
}


@pytest.mark.parametrize("path", REFUSALS)
def test_a_path_that_is_no_number_is_refused_with_what_there_is(tmp_path: Path, path: str) -> None:
    file = one_topic(tmp_path / "a.mcap", TREE, [tree_message(0)])
    with pytest.raises(SchemaError) as refused:
        list(file.columns({ALL: [path]}))
    assert REFUSALS[path] in str(refused.value)
    assert refused.value.topic == ALL


FOREIGN = {b"\0\3": "parameter-list CDR", b"\0\7": "XCDR2", b"\0\x0b": "parameter-list XCDR2"}


@pytest.mark.parametrize("kind", FOREIGN)
def test_other_encapsulations_are_refused_by_name(tmp_path: Path, kind: bytes) -> None:
    messages = [Cdr().put("d", k).message() for k in range(3)]
    messages[2] = kind + messages[2][2:]
    file = one_topic(tmp_path / "a.mcap", "float64 value\n", messages)
    with pytest.raises(SchemaError, match=f"not plain CDR, it is {FOREIGN[kind]};"):
        list(file.columns({ALL: ["value"]}))


def test_a_message_shorter_than_its_definition_is_refused(tmp_path: Path) -> None:
    file = one_topic(tmp_path / "a.mcap", "float64 a\nfloat64 b\n", [Cdr().put("d", 1).message()])
    assert joined(list(file.columns({ALL: ["a"]})), "a").tolist() == [1.0]
    with pytest.raises(SchemaError, match="a message of 12 bytes ends before b"):
        list(file.columns({ALL: ["b"]}))


def test_members_of_a_topic_are_listed(tmp_path: Path) -> None:
    file = one_topic(tmp_path / "a.mcap", TREE, [tree_message(1)])
    listed = [(member.path, member.type, member.count) for member in file.members(ALL)]
    assert ("track.#.x", "float64", None) in listed
    assert ("small", "float32", 3) in listed
    assert ("names", "string", 0) in listed
    with pytest.raises(LogError, match="no such topic"):
        file.members("/none")


def test_raw_messages_are_the_bytes_written(tmp_path: Path) -> None:
    recording = random_recording(300)
    channel = imu_channel(recording, "/imu", frame_ids=("a", "bcd"))
    path = write_log(tmp_path / "a.mcap", channel, text_channel(), chunk_bytes=11_000)
    found = []
    for part in McapFile(path).messages(lambda c: c.topic == "/imu"):
        found += [
            part.data[at : at + size].tobytes()
            for at, size in zip(part.offsets.tolist(), part.sizes.tolist(), strict=True)
        ]
    assert found == list(channel.messages)
