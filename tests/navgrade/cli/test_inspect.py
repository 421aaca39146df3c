"""``navgrade inspect``: what is in a log, and what is wrong with its time."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import IndexType, Writer

from tests.navgrade.cli.calling import Bench, navgrade
from tests.navgrade.logmaking import (
    EPOCH_NS,
    IMU,
    IMU_TEXT,
    SITE,
    Channel,
    Recording,
    chunks_of,
    damage_chunk,
    imu_channel,
    invert,
    messages_of,
    records_of,
    resting,
    text_channel,
)

RATE = 50.0  # Hz
STEP_NS = 20_000_000
SECOND = 1_000_000_000  # ns
STATISTICS, FOOTER = 0x0B, 0x02  # opcodes of MCAP


def inspect(bench: Bench, *options: str, log: Path | None = None) -> str:
    """Output of the command."""
    outcome = navgrade("inspect", log or bench.log, *options)
    assert outcome.code == 0, outcome
    assert outcome.err == ""
    return outcome.out


def report(bench: Bench, *options: str) -> dict[str, Any]:
    """What it prints for programs."""
    found: dict[str, Any] = json.loads(inspect(bench, "--json", *options))
    return found


def topic_of(found: dict[str, Any], name: str = "/imu/data_raw") -> dict[str, Any]:
    (topic,) = [topic for topic in found["topics"] if topic["topic"] == name]
    return topic


def stamps_of(bench: Bench) -> dict[str, Any]:
    """The audit of the header stamps, every message read."""
    stamps: dict[str, Any] = topic_of(report(bench, "--deep"))["stamps"]
    return stamps


def row_of(out: str, topic: str) -> list[str]:
    """Cells of a topic's row in the table, and below it its schema and encoding."""
    lines = out.splitlines()
    (k,) = [k for k, line in enumerate(lines) if re.match(rf"{re.escape(topic)} +[\d-]+ ", line)]
    return [*lines[k].split()[1:], *lines[k + 1].split()]


def restamped(stamp_ns: np.ndarray) -> Recording:
    """A drive with these stamps."""
    recording = resting((len(stamp_ns) - 1) / RATE, RATE)
    return Recording(stamp_ns, recording.gyro, recording.accel)


def regular(count: int = 1001) -> np.ndarray:
    """Stamps without a fault."""
    return EPOCH_NS + STEP_NS * np.arange(count)


# ---- what a log holds ------------------------------------------------------------------------


@pytest.mark.parametrize("options", [(), ("--deep",)])
def test_topics_schemas_counts_rates_and_times(bench: Bench, options: tuple[str, ...]) -> None:
    drive = resting(20.0, RATE)
    bench.write(
        imu_channel(drive, "/imu/a"),
        imu_channel(drive.rows(slice(100, None, 5)), "/imu/b"),
        text_channel("/chatter", count=11),
        chunk_bytes=30_000,
    )
    out = inspect(bench, *options)
    imu = ["sensor_msgs/msg/Imu", "cdr"]
    assert row_of(out, "/imu/a") == ["1001", "50", "0.000", "20.000", *imu]
    assert row_of(out, "/imu/b") == ["181", "10", "2.000", "20.000", *imu]
    chatter = ["11", "10", "0.000", "1.000", "std_msgs/msg/String", "cdr"]
    assert row_of(out, "/chatter") == chatter
    assert "from 2026-01-01 00:00:00.123 UTC on, 20.000 s" in out
    assert "gap" not in out
    assert "header stamp" not in out


def test_a_page_is_eighty_columns_wide(bench: Bench) -> None:
    drive = resting(1.0, RATE)
    bench.write(imu_channel(drive, f"/vehicle{'/sensors' * 8}/imu"), imu_channel(drive, "/imu"))
    lines = inspect(bench).splitlines()[1:]  # the first one holds the path
    assert any("/sensors" in line for line in lines)
    assert max(map(len, lines)) <= 80


REPORT = {
    *("file", "bytes", "profile", "library", "deep", "why_deep", "messages", "first_log_ns"),
    *("last_log_ns", "chunks", "topics", "imus", "imu_choices", "metadata", "attachments"),
    "issues",
}
TOPIC = {
    *("topic", "schema", "encoding", "messages", "rate_hz", "first_log_ns", "last_log_ns"),
    *("stamps", "sequence", "not_finite", "trouble"),
}
STAMPS = {
    *("name", "first_ns", "last_ns", "interval_s", "repeats", "exact_repeats", "gaps", "jumps"),
    *("backward_steps", "wraps", "log_minus_stamp_s"),
}


def test_programs_get_the_same_in_keys_that_stay(bench: Bench) -> None:
    """The keys are documented: one that goes or changes breaks somebody's program."""
    drive = resting(20.0, RATE)
    bench.write(imu_channel(drive, log_ns=drive.stamp_ns + 5_000_000), chunk_bytes=30_000)
    found = report(bench)
    assert set(found) == REPORT
    assert found["file"] == str(bench.log)
    assert found["bytes"] == bench.log.stat().st_size
    assert (found["profile"], found["library"]) == ("ros2", "tests")
    assert found["messages"] == 1001
    assert found["first_log_ns"] == EPOCH_NS + 5_000_000
    assert found["last_log_ns"] == EPOCH_NS + 5_000_000 + 20 * SECOND
    assert set(found["chunks"]) == {"count", "stored", "size", "compressions"}
    assert found["chunks"]["count"] == len(chunks_of(bench.log))
    assert found["chunks"]["compressions"] == ["zstd"]
    topic = topic_of(found)
    assert set(topic) == TOPIC
    assert topic["first_log_ns"] == found["first_log_ns"]
    assert topic["last_log_ns"] == found["last_log_ns"]
    assert topic["sequence"] == {"skipped": 0, "steps_back": 0, "wraps": 0}
    stamps = topic["stamps"]
    assert set(stamps) == STAMPS
    assert (stamps["first_ns"], stamps["last_ns"]) == (EPOCH_NS, EPOCH_NS + 20 * SECOND)
    assert stamps["interval_s"] == 0.02
    assert stamps["log_minus_stamp_s"] == [0.005, 0.005]
    for places in ("gaps", "jumps", "backward_steps", "wraps"):
        assert stamps[places] == {"count": 0, "first": []}
    deep = report(bench, "--deep")
    assert (found.pop("deep"), deep.pop("deep")) == (False, True)
    assert topic_of(deep)["stamps"].pop("exact_repeats") == 0
    assert stamps.pop("exact_repeats") is None
    assert found == deep


def test_only_the_ends_of_each_topic_are_read(bench: Bench) -> None:
    """A damaged chunk in the middle is not met, those where a topic begins and ends are read."""
    drive = resting(20.0, RATE)
    late = drive.rows(slice(480, 520))
    bench.write(imu_channel(drive, "/imu/a"), imu_channel(late, "/late"), chunk_bytes=30_000)
    damage_chunk(bench.log, 3)
    found = report(bench)
    assert found["issues"] == []
    assert topic_of(found, "/late")["first_log_ns"] == late.stamp_ns[0]
    assert topic_of(found, "/late")["last_log_ns"] == late.stamp_ns[-1]
    (issue,) = report(bench, "--deep")["issues"]
    assert issue["kind"] == "chunk"


def test_our_own_files_tell_where_they_came_from(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, RATE)), site=SITE)
    bench.accepted("--output-rate", "5")
    out = inspect(bench, log=bench.out)
    assert row_of(out, "/navgrade/solution")[0] == str(len(bench.messages()))
    assert row_of(out, "/navgrade/solution")[4] == "navgrade_msgs/msg/NavSolution"
    assert row_of(out, "/navgrade/fix")[0] == str(len(bench.messages("/navgrade/fix")))
    assert "metadata navgrade.provenance" in out
    for key, value in bench.provenance().items():
        assert f"{key}: {value}" in out
    assert f"attachment site.toml, application/toml, {len(SITE)} bytes" in out


def test_an_empty_topic_is_listed(bench: Bench) -> None:
    drive = resting(1.0, RATE)
    bench.write(imu_channel(drive, "/imu/a"), imu_channel(drive.rows(slice(0, 0)), "/imu/empty"))
    assert row_of(inspect(bench), "/imu/empty")[:4] == ["0", "-", "-", "-"]


@pytest.mark.parametrize("option", ["--deep", "--json", "LOG.mcap"])
def test_help_names_every_option(option: str) -> None:
    assert option in navgrade("inspect", "--help").out


def test_names_in_brackets_are_printed_as_they_are(bench: Bench) -> None:
    bench.write(
        imu_channel(resting(1.0, RATE), "/imu[0]"), attachment=("notes[draft].txt", b"hello")
    )
    out = inspect(bench)
    assert "notes[draft].txt" in out
    assert row_of(out, "/imu[0]")[0] == "51"


def test_a_real_log_with_vendor_messages(shared_data: Path, bench: Bench) -> None:
    """Counts as in its readme."""
    out = inspect(bench, log=shared_data / "novatel_oem7_parked.mcap")
    assert row_of(out, "/gps/imu")[0] == "766"
    corrimu = row_of(out, "/novatel/oem7/corrimu")
    assert corrimu[0] == "766"
    assert corrimu[4] == "novatel_oem7_msgs/msg/CORRIMU"


# ---- the IMU ---------------------------------------------------------------------------------


def test_the_only_imu_is_the_one_a_run_takes(bench: Bench) -> None:
    bench.write(imu_channel(resting(1.0, RATE)), text_channel())
    out = inspect(bench)
    assert re.search(r"IMU topic +/imu/data_raw, the only one", out)
    assert "kind to be said (--kind), axes FLU unless said" in out
    assert report(bench)["imu_choices"] == ["/imu/data_raw"]


def test_of_several_imus_one_must_be_chosen(bench: Bench) -> None:
    drive = resting(1.0, RATE)
    increments = drive.as_increments(np.full(len(drive), 1.0 / RATE))
    bench.write(imu_channel(drive, "/a"), imu_channel(increments, "/b"))
    out = inspect(bench)
    assert re.search(r"IMU topic +say which \(--imu-topic\)", out)
    assert re.search(r"/b\n +kind increment, axes", out)
    assert report(bench)["imu_choices"] == ["/a", "/b"]


def test_a_log_without_an_imu_says_so(bench: Bench) -> None:
    bench.write(text_channel())
    assert re.search(r"IMU topic +none of a known type", inspect(bench))
    found = report(bench)
    assert (found["imus"], found["imu_choices"]) == ([], [])


SENSOR_TEXT = "uint64 timestamp\nuint64 timestamp_sample\nfloat32 x\nfloat32 y\nfloat32 z\n"


def sensor_channel(topic: str, schema: str, count: int = 100) -> Channel:
    """PX4's rates of a gyroscope or specific forces of an accelerometer, us since it started."""
    messages = [
        b"\0\1\0\0" + struct.pack("<2Q3f", 1_000_500 + k * 4000, 1_000_000 + k * 4000, 0, 0, 1)
        for k in range(count)
    ]
    log_ns = [EPOCH_NS + k * 4_000_000 for k in range(count)]
    return Channel(topic, f"px4_msgs/msg/{schema}", SENSOR_TEXT, messages, log_ns)


def test_a_gyroscope_alone_asks_for_its_accelerometer(bench: Bench) -> None:
    bench.write(sensor_channel("/gyro", "SensorGyro"), sensor_channel("/accel", "SensorAccel"))
    out = inspect(bench)
    assert "/gyro" in out
    assert "with a topic of px4_msgs/msg/SensorAccel (imu.accel_topic)" in out
    assert report(bench)["imu_choices"] == []


def test_the_time_of_a_sensor_is_its_own_and_not_the_headers(bench: Bench) -> None:
    bench.write(sensor_channel("/gyro", "SensorGyro"))
    stamps = topic_of(report(bench), "/gyro")["stamps"]
    assert stamps["name"] == "time timestamp_sample"
    assert stamps["first_ns"] == 1_000_000_000
    assert stamps["interval_s"] == 0.004


# ---- what is wrong with its time ---------------------------------------------------------------


@pytest.mark.parametrize("increments", [False, True])
@pytest.mark.parametrize("chunk_bytes", [8_000, 1 << 20])
def test_repeats_backward_steps_and_gaps_are_counted(
    bench: Bench, chunk_bytes: int, increments: bool
) -> None:
    stamp_ns = regular()
    stamp_ns[100] = stamp_ns[99]
    stamp_ns[200] = stamp_ns[199]
    stamp_ns[301] = stamp_ns[299]  # a repeat of the one before is not this; a backward step is
    stamp_ns[500:] += 4_000_000_000
    stamp_ns[700:] += 60_000_000
    stamp_ns[800:] += 40_000_000  # two missing: no gap
    recording = restamped(stamp_ns)
    if increments:
        recording = recording.as_increments(np.full(1001, 1.0 / RATE))
    bench.write(imu_channel(recording, log_ns=regular()), chunk_bytes=chunk_bytes)
    out = inspect(bench, "--deep")
    assert "2 repeats of the header stamp" in out
    assert "1 backward steps of the header stamp: 0.020 s at 6.000 s" in out
    assert "2 gaps longer than 3 intervals: 4.000 s at 9.980 s, 0.060 s at 17.980 s" in out


@pytest.mark.parametrize("chunk_bytes", [700, 8_000, 1 << 20])
def test_messages_recorded_twice_differ_from_stamps_used_twice(
    bench: Bench, chunk_bytes: int
) -> None:
    """Also where a chunk ends between the two."""
    drive = resting(20.0, RATE, sway_from_s=0.0)
    rows = np.sort(np.concatenate([np.arange(1001), [10, 11, 11, 500]]))
    twice = drive.rows(rows)
    values = twice.gyro.copy()
    values[700] += 1.0
    stamps = twice.stamp_ns.copy()
    stamps[700] = stamps[699]
    bench.write(
        imu_channel(replace(twice, gyro=values, stamp_ns=stamps), frame_ids=("a",)),
        chunk_bytes=chunk_bytes,
    )
    found = stamps_of(bench)
    assert (found["repeats"], found["exact_repeats"]) == (5, 4)
    assert "5 repeats of the header stamp, 4 of them in messages" in inspect(bench, "--deep")


JUMPS = {
    "from GPS zero to Unix": (slice(0, 300), -EPOCH_NS, [(5.98, EPOCH_NS * 1e-9 + 0.02)]),
    "one zero stamp": (slice(300, 301), None, [(5.98, None), (None, None)]),
    "18 leap seconds": (slice(300, None), 18 * SECOND, [(5.98, 18.02)]),
    "an hour back": (slice(300, None), -3600 * SECOND, [(5.98, -3599.98)]),
}


@pytest.mark.parametrize("name", JUMPS)
def test_a_clock_that_was_set_is_no_gap(bench: Bench, name: str) -> None:
    """The stamps jump where log time does not; the rate is then that by log time."""
    which, shift, jumps = JUMPS[name]
    stamp_ns = regular()
    stamp_ns[which] = 0 if shift is None else stamp_ns[which] + shift
    bench.write(imu_channel(restamped(stamp_ns), log_ns=regular()), chunk_bytes=30_000)
    stamps = stamps_of(bench)
    assert stamps["jumps"]["count"] == len(jumps)
    for (at, length), (at_expected, expected) in zip(stamps["jumps"]["first"], jumps, strict=True):
        # doubles of 1.8e9 s are 0.24 us apart
        assert at_expected is None or abs(at - at_expected) < 1e-6
        assert expected is None or abs(length - expected) < 1e-6
    assert stamps["gaps"]["count"] == stamps["backward_steps"]["count"] == 0
    assert topic_of(report(bench, "--deep"))["rate_hz"] == pytest.approx(RATE, rel=1e-12)
    assert "a clock was set" in inspect(bench, "--deep")


def test_a_pause_of_both_clocks_is_a_gap_and_no_jump(bench: Bench) -> None:
    stamp_ns = regular()
    stamp_ns[300:] += 100 * SECOND
    bench.write(imu_channel(restamped(stamp_ns)), chunk_bytes=30_000)
    stamps = stamps_of(bench)
    assert stamps["gaps"]["first"] == [[pytest.approx(5.98), pytest.approx(100.0)]]
    assert stamps["jumps"]["count"] == 0


COUNTERS = {"us": (1_000 << 32), "ms": (1_000_000 << 32), "GPS week": 604_800 * SECOND}


@pytest.mark.parametrize("name", COUNTERS)
def test_a_counter_that_starts_again_is_told_apart(bench: Bench, name: str) -> None:
    period_ns = COUNTERS[name]
    ticks = period_ns - 300 * STEP_NS + STEP_NS * np.arange(1001)
    bench.write(imu_channel(restamped(ticks % period_ns), log_ns=regular()), chunk_bytes=30_000)
    stamps = stamps_of(bench)
    assert stamps["wraps"] == {"count": 1, "first": [[pytest.approx(5.98), period_ns * 1e-9]]}
    assert stamps["jumps"]["count"] == stamps["backward_steps"]["count"] == 0
    assert "1 wraps of the counter behind the header stamp" in inspect(bench, "--deep")


def test_a_log_time_that_is_no_clock_is_told(bench: Bench) -> None:
    """Replayed 20 times too fast; the first and last messages show it."""
    recording = resting(20.0, RATE)
    log_ns = EPOCH_NS + (recording.stamp_ns - EPOCH_NS) // 20
    bench.write(imu_channel(recording, log_ns=log_ns), chunk_bytes=30_000)
    out = inspect(bench)
    assert "the header stamp spans 20 times the log time; navigation uses the header stamp" in out
    assert row_of(out, "/imu/data_raw")[1:4] == ["50", "0.000", "1.000"]
    assert "log time minus header stamp runs from -19.000000 s to 0.000000 s" in out


def test_a_constant_delay_is_no_defect(bench: Bench) -> None:
    recording = resting(20.0, RATE)
    bench.write(imu_channel(recording, log_ns=recording.stamp_ns + 7_000_000))
    assert "log time minus" not in inspect(bench, "--deep")


# ---- what else is wrong ------------------------------------------------------------------------


def numbered(bench: Bench, sequence: Sequence[int]) -> dict[str, int]:
    """The audit of a log whose messages carry these numbers."""
    drive = resting((len(sequence) - 1) / RATE, RATE)
    with bench.log.open("wb") as stream:
        writer = Writer(stream, chunk_size=5_000)
        writer.start()
        channel = writer.register_channel(
            "/imu/data_raw", "cdr", writer.register_schema(IMU, "ros2msg", IMU_TEXT.encode())
        )
        times = drive.stamp_ns.tolist()
        for number, time_ns, data in zip(sequence, times, messages_of(drive), strict=True):
            writer.add_message(channel, time_ns, data, time_ns, number)
        writer.finish()
    found: dict[str, int] = topic_of(report(bench, "--deep"))["sequence"]
    return found


SEQUENCES: dict[str, tuple[list[int], tuple[int, int, int]]] = {
    "counted": (list(range(100)), (0, 0, 0)),
    "never counted": ([0] * 100, (0, 0, 0)),
    "lost": ([*range(50), *range(53, 70), *range(71, 80)], (4, 0, 0)),
    "started again": ([*range(50), *range(50)], (0, 1, 0)),
    "8 bits": ([k % 256 for k in range(200, 600)], (0, 0, 2)),
    "16 bits": ([k % 65536 for k in range(65_500, 65_600)], (0, 0, 1)),
    "32 bits": ([k % (1 << 32) for k in range((1 << 32) - 50, (1 << 32) + 50)], (0, 0, 1)),
}


@pytest.mark.parametrize("name", SEQUENCES)
def test_sequence_numbers(bench: Bench, name: str) -> None:
    sequence, (skipped, steps_back, wraps) = SEQUENCES[name]
    found = numbered(bench, sequence)
    assert found == {"skipped": skipped, "steps_back": steps_back, "wraps": wraps}


def test_numbers_that_are_not_finite_are_counted(bench: Bench) -> None:
    drive = resting(20.0, RATE)
    drive.gyro[100, 1] = np.nan
    drive.accel[100, 2] = np.inf
    drive.accel[900, 0] = -np.inf
    bench.write(imu_channel(drive), chunk_bytes=8_000)
    out = inspect(bench, "--deep")
    assert "2 messages with a number that is not finite: 2.000 s, 18.000 s" in out
    assert topic_of(report(bench, "--deep"))["not_finite"]["count"] == 2


EXT_SENSOR_TEXT = """\
made_msgs/Block block_header
float64 angular_rate_x
float64 angular_rate_y
float64 angular_rate_z
float64 acceleration_x
float64 acceleration_y
float64 acceleration_z
================
MSG: made_msgs/Block
uint32 tow
uint16 wnc
"""


def test_messages_of_another_sensor_are_no_samples_that_are_not_finite(bench: Bench) -> None:
    """Septentrio leaves rates NaN in the blocks of other sensors."""
    rows = [[0.0, 0.0, 0.0, 0.0, 0.0, -9.8]] * 3
    rows += [[np.nan] * 6, [0.0, 0.0, 0.0, np.nan, 0.0, 0.0]]
    messages = [
        b"\0\1\0\0" + struct.pack("<IH2x6d", 1000 * k, 2300, *row) for k, row in enumerate(rows)
    ]
    schema = "septentrio_gnss_driver/msg/ExtSensorMeas"
    log_ns = [EPOCH_NS + k * SECOND for k in range(5)]
    bench.write(Channel("/ext", schema, EXT_SENSOR_TEXT, messages, log_ns))
    found = topic_of(report(bench, "--deep"), "/ext")
    assert found["stamps"]["interval_s"] == 1.0
    assert found["not_finite"] == {"count": 1, "first": [[4.0, 0.0]]}


def test_a_topic_that_cannot_be_decoded_does_not_hide_the_others(bench: Bench) -> None:
    """Its definition promises more than its messages hold."""
    text = IMU_TEXT.split("geometry_msgs/Quaternion")[0] + IMU_TEXT[IMU_TEXT.index("====") :]
    assert "float64" in text
    stub = b"\0\1\0\0" + struct.pack("<i", 5)
    bad = Channel("/bad", "made_msgs/msg/Up", text, [stub] * 10, [EPOCH_NS] * 10)
    bench.write(bad, imu_channel(resting(20.0, RATE)))
    for options in ((), ("--deep",)):
        found = report(bench, *options)
        assert topic_of(found)["messages"] == 1001
        assert topic_of(found)["stamps"]["interval_s"] == 0.02
        assert topic_of(found, "/bad")["messages"] == 10
        assert topic_of(found, "/bad")["trouble"]
    assert "/bad: its messages cannot be decoded" in inspect(bench)


# ---- damaged files -----------------------------------------------------------------------------


def test_damage_is_told_with_its_place_and_what_it_cost(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, RATE)), chunk_bytes=30_000)
    start_ns, end_ns = struct.unpack_from(
        "<QQ", bench.log.read_bytes(), chunks_of(bench.log)[4].start
    )
    damage_chunk(bench.log, 4)
    chunk = chunks_of(bench.log)[4]
    out = inspect(bench, "--deep")
    lost = (end_ns - start_ns) // STEP_NS + 1
    assert "damaged chunk" in out
    # a record begins with opcode and length
    assert f"(byte {chunk.start - 9}, {lost} messages lost, log time 2026-01-01 00:00:0" in out
    assert "1 gaps longer than 3 intervals" in out
    (issue,) = report(bench, "--deep")["issues"]
    assert (issue["offset"], issue["kind"], issue["messages"]) == (chunk.start - 9, "chunk", lost)
    assert (issue["start_ns"], issue["end_ns"]) == (start_ns, end_ns)
    assert topic_of(report(bench, "--deep"))["messages"] == 1001 - lost


def test_a_second_look_at_repeats_forgets_no_damage(bench: Bench) -> None:
    """The repeats are in one topic, the damaged chunk held another alone."""
    drive = resting(20.0, RATE)
    late = drive.rows(np.sort(np.concatenate([np.arange(600, 1001), [700]])))
    bench.write(
        imu_channel(drive.rows(slice(0, 500)), "/early"),
        imu_channel(late, "/late"),
        chunk_bytes=30_000,
        attachment=("notes.txt", b"hello"),
    )
    damage_chunk(bench.log, 2)
    found = report(bench, "--deep")
    assert topic_of(found, "/late")["stamps"]["exact_repeats"] == 1
    assert [issue["kind"] for issue in found["issues"]] == ["chunk"]
    assert [attachment["name"] for attachment in found["attachments"]] == ["notes.txt"]


def test_the_rate_of_messages_whose_stamps_were_never_set_is_that_by_log_time(
    bench: Bench,
) -> None:
    unset = restamped(np.zeros(1001, np.int64))
    bench.write(imu_channel(unset, log_ns=regular()), chunk_bytes=30_000)
    found = topic_of(report(bench, "--deep"))
    assert found["rate_hz"] == RATE
    assert found["stamps"]["repeats"] == 1000


def test_a_cut_file_is_read_whole_and_told(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, RATE)), chunk_bytes=30_000)
    bench.log.write_bytes(bench.log.read_bytes()[: chunks_of(bench.log)[4].start + 100])
    out = inspect(bench)
    assert "ends early" in out
    assert "whole: it has no summary that can be trusted" in out
    assert [issue["kind"] for issue in report(bench)["issues"]] == ["cut"]


POOR = {
    "no summary": ({"summary": False, "index": IndexType.NONE}, "it has no summary"),
    "unchunked": ({"chunked": False}, "its summary has no index of chunks"),
    "no chunk index": ({"index": IndexType.NONE}, "its summary has no index of chunks"),
}


@pytest.mark.parametrize("name", POOR)
def test_a_file_whose_summary_does_not_suffice_is_read_whole(bench: Bench, name: str) -> None:
    container, why = POOR[name]
    stamp_ns = regular()
    stamp_ns[500:] += SECOND
    channels = imu_channel(restamped(stamp_ns), log_ns=regular()), text_channel()
    bench.write(*channels, chunk_bytes=30_000, **container)
    found = report(bench)
    assert found["deep"] is True
    assert why in found["why_deep"]
    assert topic_of(found)["messages"] == 1001
    assert topic_of(found)["stamps"]["gaps"]["count"] == 1
    assert topic_of(found, "/chatter")["messages"] == 5
    assert found["issues"] == []
    assert f"whole: {why}" in inspect(bench)


@pytest.mark.parametrize(
    ("left_out", "why"), [("use_statistics", "statistics"), ("repeat_channels", "topics")]
)
def test_a_summary_without_counts_or_topics_does_not_suffice(
    bench: Bench, left_out: str, why: str
) -> None:
    drive = resting(20.0, RATE)
    with bench.log.open("wb") as stream:
        writer = Writer(stream, chunk_size=30_000, **{left_out: False})
        writer.start()
        schema = writer.register_schema(IMU, "ros2msg", IMU_TEXT.encode())
        channel = writer.register_channel("/imu/data_raw", "cdr", schema)
        for time_ns, data in zip(drive.stamp_ns.tolist(), messages_of(drive), strict=True):
            writer.add_message(channel, time_ns, data, time_ns)
        writer.finish()
    found = report(bench)
    assert found["why_deep"] == f"its summary has no {why}"
    assert topic_of(found)["messages"] == 1001


def test_a_file_without_message_indexes_still_needs_no_reading(bench: Bench) -> None:
    """Its chunks may hold any topic: the first and the last of all are read."""
    bench.write(
        imu_channel(resting(20.0, RATE)),
        chunk_bytes=30_000,
        index=IndexType.ALL ^ IndexType.MESSAGE,
    )
    found = report(bench)
    assert found["deep"] is False
    topic = topic_of(found)
    assert (topic["messages"], topic["rate_hz"]) == (1001, RATE)


def summary_record(path: Path, opcode: int) -> int:
    """Where the content of a record of the summary starts."""
    (record,) = [record for record in records_of(path) if record.opcode == opcode]
    return record.start


def test_a_summary_whose_checksum_is_wrong_is_not_believed(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, RATE)), chunk_bytes=30_000)
    invert(bench.log, summary_record(bench.log, STATISTICS), 2)
    found = report(bench)
    assert found["deep"] is True
    assert topic_of(found)["messages"] == 1001
    assert [issue["kind"] for issue in found["issues"]] == ["summary"]


def test_a_summary_that_contradicts_itself_is_told(bench: Bench) -> None:
    """Without a checksum of its own, as some recorders leave it."""
    bench.write(imu_channel(resting(20.0, RATE)), chunk_bytes=30_000)
    data = bytearray(bench.log.read_bytes())
    statistics, footer = (summary_record(bench.log, code) for code in (STATISTICS, FOOTER))
    struct.pack_into("<Q", data, statistics, 999)
    struct.pack_into("<I", data, footer + 16, 0)
    bench.log.write_bytes(data)
    (issue,) = report(bench)["issues"]
    assert issue["kind"] == "summary"
    assert "counts 1001 messages by topic, 999 in all" in issue["text"]
