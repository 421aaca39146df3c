"""Topics carried over to the solution's file are the same bytes, in the order of log time."""

from __future__ import annotations

import tracemalloc
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from navgrade import Trajectory
from navgrade.errors import ConfigError, LogError
from navgrade.logs import SolutionWriter, TopicCopy
from tests.navgrade.cli.calling import Bench
from tests.navgrade.logmaking import (
    EPOCH_NS,
    SITE,
    STRING,
    STRING_TEXT,
    damage_chunk,
    imu_channel,
    resting,
    text_channel,
)
from tests.navgrade.logs.decoding import FIX, ODOMETRY, SOLUTION, TRANSFORMS, solution

OURS = {SOLUTION, FIX, ODOMETRY, TRANSFORMS}
SECOND = 1_000_000_000  # ns


def a_log(path: Path, shift_ns: int = 0, *, seed: int = 1) -> Path:
    """Four channels over 20 s: two of one topic, one of JSON, one that has no schema.

    Sequences, publish times and sizes have nothing to do with each other; chunks are small, and
    within a chunk the channels take turns at random.
    """
    rng = np.random.default_rng(seed)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=4000, compression=CompressionType.LZ4)
        writer.start(profile="ros2", library="tests")
        text = writer.register_schema(STRING, "ros2msg", STRING_TEXT.encode())
        json = writer.register_schema("notes", "jsonschema", b'{"type": "object"}')
        channels = [
            writer.register_channel("/left", "cdr", text, {"offered_qos_profiles": "ü"}),
            writer.register_channel("/left", "cdr", text, {"another": "publisher"}),
            writer.register_channel("/json", "json", json),
            writer.register_channel("/bare", "", 0),
        ]
        times = np.sort(EPOCH_NS + shift_ns + rng.integers(-5 * SECOND, 15 * SECOND, 3000))
        for log_ns in times.tolist():
            writer.add_message(
                channels[rng.integers(0, 4)],
                log_ns,
                rng.bytes(int(rng.integers(0, 300))),
                log_ns - int(rng.integers(0, SECOND)),
                int(rng.integers(0, 1 << 32)),
            )
        writer.finish()
    return path


def a_trajectory(count: int = 1000) -> Trajectory:
    t = np.arange(count) / 100.0
    return Trajectory(
        t=t,
        lat=0.7 + 1e-6 * t,
        lon=0.2 + 0.0 * t,
        h=10.0 * t,
        v_eb_n=np.tile([6.4, 0.0, -10.0], (count, 1)),
        q_nb=np.tile([0.8, 0.0, 0.6, 0.0], (count, 1)),
        status=np.zeros(count, np.uint32),
        epoch_ns=EPOCH_NS,
    )


def merge(out: Path, log: Path, topics: tuple[str, ...], *, block: int = 300) -> Path:
    nav = a_trajectory()
    with SolutionWriter(out, copy=TopicCopy(log, topics)) as writer:
        for start in range(0, len(nav), block):
            writer.write(nav[start : start + block])
    return out


def described(path: Path, topics: set[str]) -> list[tuple[object, ...]]:
    """Messages of some topics with all that is known of them, numbers of channels aside."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [
            (
                schema and (schema.name, schema.encoding, schema.data),
                (channel.topic, channel.message_encoding, tuple(channel.metadata.items())),
                (message.sequence, message.log_time, message.publish_time, message.data),
            )
            for schema, channel, message in reader.iter_messages()
            if channel.topic in topics
        ]


def in_the_file(path: Path) -> list[tuple[str, Message]]:
    with path.open("rb") as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
    topics = {r.id: r.topic for r in records if isinstance(r, Channel)}
    return [(topics[r.channel_id], r) for r in records if isinstance(r, Message)]


@pytest.mark.parametrize("topics", [("/left",), ("/json", "/bare"), ("/left", "/json", "/bare")])
def test_copied_topics_are_unchanged(tmp_path: Path, topics: tuple[str, ...]) -> None:
    log = a_log(tmp_path / "log.mcap")
    out = merge(tmp_path / "out.mcap", log, topics)
    assert described(out, set(topics)) == described(log, set(topics))
    assert {topic for topic, _ in in_the_file(out)} == OURS | set(topics)
    assert len(solution(out)["stamp_ns"]) == 1000


@pytest.mark.parametrize("shift_ns", [0, -1000 * SECOND, 1000 * SECOND])
def test_all_stands_in_the_order_of_log_time(tmp_path: Path, shift_ns: int) -> None:
    """Copies may begin before the solution and end after it, or have a clock of their own."""
    log = a_log(tmp_path / "log.mcap", shift_ns)
    out = merge(tmp_path / "out.mcap", log, ("/left", "/json"))
    found = in_the_file(out)
    times = [message.log_time for _, message in found]
    assert times == sorted(times)
    counts = Counter(topic for topic, _ in found)
    assert counts[SOLUTION] == 1000
    assert counts["/left"] + counts["/json"] == len(described(log, {"/left", "/json"})) > 2000


def test_blocks_do_not_show_among_the_copies(tmp_path: Path) -> None:
    log = a_log(tmp_path / "log.mcap")
    whole, *parts = (
        in_the_file(merge(tmp_path / f"{block}.mcap", log, ("/left", "/bare"), block=block))
        for block in (1000, 1, 77)
    )
    for part in parts:
        assert [m.data for _, m in part] == [m.data for _, m in whole]
        assert [topic for topic, _ in part] == [topic for topic, _ in whole]


def test_memory_does_not_grow_with_what_is_copied(tmp_path: Path) -> None:
    """160 MB between two rows of the solution; jobs of 16 MB are read ahead."""
    log = tmp_path / "log.mcap"
    image = np.random.default_rng(1).bytes(1_000_000)
    with log.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start()
        camera = writer.register_channel("/camera", "", 0)
        for k in range(160):
            writer.add_message(camera, EPOCH_NS + 5_000_000 + k, image, 0)
        writer.finish()
    copy = TopicCopy(log, ["/camera"])
    tracemalloc.start()
    try:
        with SolutionWriter(tmp_path / "out.mcap", copy=copy) as out:
            out.write(a_trajectory())
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 130_000_000  # bytes
    assert (tmp_path / "out.mcap").stat().st_size > 160_000_000


def test_a_topic_the_log_does_not_hold_is_refused(tmp_path: Path) -> None:
    log = a_log(tmp_path / "log.mcap")
    with pytest.raises(ConfigError, match=r"no topic /right to copy.*/left \(std_msgs"):
        TopicCopy(log, ["/left", "/right"])


def test_names_of_the_solution_are_refused(tmp_path: Path) -> None:
    """A log that is itself a solution: two of one name could not be told apart."""
    first = merge(tmp_path / "first.mcap", a_log(tmp_path / "log.mcap"), ("/left",))
    with pytest.raises(ConfigError, match="/navgrade/solution cannot be copied"):
        TopicCopy(first, [SOLUTION])
    merge(tmp_path / "second.mcap", first, ("/left", "/tf"))
    found = Counter(topic for topic, _ in in_the_file(tmp_path / "second.mcap"))
    assert found["/tf"] == 2 * found[ODOMETRY]


def test_a_damaged_chunk_costs_what_it_held(tmp_path: Path) -> None:
    log = a_log(tmp_path / "log.mcap")
    whole = described(log, {"/left"})
    damage_chunk(log, 20)
    found = described(merge(tmp_path / "out.mcap", log, ("/left",)), {"/left"})
    assert 0 < len(whole) - len(found) < 30
    assert set(found) < set(whole)
    with (
        pytest.raises(LogError),
        SolutionWriter(
            tmp_path / "strict.mcap", copy=TopicCopy(log, ["/left"], strict=True)
        ) as out,
    ):
        out.write(a_trajectory())
    assert not list(tmp_path.glob("strict*"))


# ---- the command -------------------------------------------------------------------------------


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """A log with an IMU and some text."""
    drive = resting(12.0, 50.0, sway_from_s=10.5)
    return Bench(tmp_path).write(imu_channel(drive), text_channel(count=130), site=SITE)


def test_the_command_carries_topics_over(bench: Bench) -> None:
    bench.accepted("--copy-topics", "/chatter", "--copy-topics", "/imu/data_raw")
    for topic in ("/chatter", "/imu/data_raw"):
        assert described(bench.out, {topic}) == described(bench.log, {topic})
    times = [message.log_time for _, message in in_the_file(bench.out)]
    assert times == sorted(times)


def test_the_command_names_what_the_log_holds(bench: Bench) -> None:
    options = ("--copy-topics", "/camera")
    bench.refused("no topic /camera to copy", "/chatter (std_msgs/msg/String", options=options)


@pytest.mark.parametrize(("rate", "count"), [("0", 0), ("5", 10)])
def test_the_command_writes_poses_at_a_rate(bench: Bench, rate: str, count: int) -> None:
    bench.accepted("--pose-rate", rate)
    found = Counter(topic for topic, _ in in_the_file(bench.out))
    assert abs(found[ODOMETRY] - count) <= 1
    assert found[ODOMETRY] == found[TRANSFORMS]
    assert found[SOLUTION] == 100


@pytest.mark.parametrize("rate", ["-1", "nan", "inf"])
def test_a_rate_of_poses_is_a_number_of_them(bench: Bench, rate: str) -> None:
    bench.refused("the pose rate must be positive, or 0", options=("--pose-rate", rate))


def test_the_command_writes_foxgloves_fix(bench: Bench) -> None:
    bench.accepted("--location-fix")
    found = Counter(topic for topic, _ in in_the_file(bench.out))
    assert found["/navgrade/location"] == found[FIX] > 0
