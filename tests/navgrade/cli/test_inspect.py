"""``navgrade inspect``: what is in a log, and what is wrong with its time."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.navgrade.cli.calling import Bench, navgrade
from tests.navgrade.logmaking import (
    EPOCH_NS,
    SITE,
    Recording,
    chunks_of,
    damage_chunk,
    imu_channel,
    resting,
    text_channel,
)

RATE = 50.0  # Hz
STEP_NS = 20_000_000


def inspect(bench: Bench, path: Path | None = None) -> str:
    """Output of the command."""
    outcome = navgrade("inspect", path or bench.log)
    assert outcome.code == 0, outcome
    assert outcome.err == ""
    return outcome.out


def row_of(out: str, topic: str) -> list[str]:
    """Cells of a topic's row in the table."""
    (row,) = [line.split() for line in out.splitlines() if re.match(rf"{topic} +\S+/msg/", line)]
    return row


def restamped(stamp_ns: np.ndarray) -> Recording:
    """A drive with these stamps."""
    recording = resting((len(stamp_ns) - 1) / RATE, RATE)
    return Recording(stamp_ns, recording.gyro, recording.accel)


def test_topics_schemas_counts_rates_and_spans(bench: Bench) -> None:
    drive = resting(20.0, RATE)
    bench.write(
        imu_channel(drive, "/imu/a"),
        imu_channel(drive.rows(slice(None, None, 5)), "/imu/b"),
        text_channel("/chatter", count=11),
    )
    out = inspect(bench)
    assert row_of(out, "/imu/a")[1:] == ["sensor_msgs/msg/Imu", "1001", "50", "20.000", "20.000"]
    assert row_of(out, "/imu/b")[1:] == ["sensor_msgs/msg/Imu", "201", "10", "20.000", "20.000"]
    assert row_of(out, "/chatter")[1:] == ["std_msgs/msg/String", "11", "10", "-", "1.000"]
    assert "gap" not in out
    assert "header stamp" not in out


@pytest.mark.parametrize("increments", [False, True])
@pytest.mark.parametrize("chunk_bytes", [8_000, 1 << 20])
def test_repeats_backward_steps_and_gaps_are_counted(
    bench: Bench, chunk_bytes: int, increments: bool
) -> None:
    stamp_ns = EPOCH_NS + STEP_NS * np.arange(1001)
    stamp_ns[100] = stamp_ns[99]
    stamp_ns[200] = stamp_ns[199]
    stamp_ns[301] = stamp_ns[299]  # a repeat of the one before is not this; a backward step is
    stamp_ns[500:] += 4_000_000_000
    stamp_ns[700:] += 60_000_000
    stamp_ns[800:] += 40_000_000  # two missing: no gap
    recording = restamped(stamp_ns)
    if increments:
        recording = recording.as_increments(np.full(1001, 1.0 / RATE))
    log_ns = EPOCH_NS + STEP_NS * np.arange(1001)
    bench.write(imu_channel(recording, log_ns=log_ns), chunk_bytes=chunk_bytes)
    out = inspect(bench)
    assert "2 repeated header stamps" in out
    assert "1 backward step" in out
    assert "2 gaps longer than 3 intervals: 4.000 s at 9.980 s, 0.060 s at 17.980 s" in out


def test_a_log_time_that_is_no_clock_is_told(bench: Bench) -> None:
    """Replayed 20 times too fast."""
    recording = resting(20.0, RATE)
    log_ns = EPOCH_NS + (recording.stamp_ns - EPOCH_NS) // 20
    bench.write(imu_channel(recording, log_ns=log_ns))
    out = inspect(bench)
    assert "header stamps span 20 times the log time; navigation uses header stamps" in out
    assert row_of(out, "/imu/data_raw")[3:] == ["50", "20.000", "1.000"]
    assert "log time minus header stamp runs from -19.000000 s to 0.000000 s" in out


def test_a_constant_delay_is_no_defect(bench: Bench) -> None:
    recording = resting(20.0, RATE)
    bench.write(imu_channel(recording, log_ns=recording.stamp_ns + 7_000_000))
    out = inspect(bench)
    assert "log time" not in out.split("\n", 1)[1]


def test_our_own_files_tell_where_they_came_from(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, RATE)), site=SITE)
    bench.accepted("--output-rate", "5")
    out = inspect(bench, bench.out)
    assert row_of(out, "/navgrade/solution")[1:3] == ["navgrade_msgs/msg/NavSolution", "51"]
    assert row_of(out, "/navgrade/fix")[1:3] == ["sensor_msgs/msg/NavSatFix", "101"]
    assert "metadata navgrade.provenance" in out
    for key, value in bench.provenance().items():
        assert f"{key}: {value}" in out
    assert f"attachment site.toml, application/toml, {len(SITE)} bytes" in out


def test_damage_is_told_with_its_place(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, RATE)), chunk_bytes=30_000)
    damage_chunk(bench.log, 4)
    chunk = chunks_of(bench.log)[4]
    out = inspect(bench)
    assert "damaged chunk" in out
    assert f"(byte {chunk.start - 9})" in out  # a record begins with opcode and length
    assert "1 gaps longer than 3 intervals" in out


def test_a_cut_file_is_told(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, RATE)), chunk_bytes=30_000)
    bench.log.write_bytes(bench.log.read_bytes()[: chunks_of(bench.log)[4].start + 100])
    assert "ends early" in inspect(bench)


def test_an_empty_topic_is_listed(bench: Bench) -> None:
    drive = resting(1.0, RATE)
    bench.write(imu_channel(drive, "/imu/a"), imu_channel(drive.rows(slice(0, 0)), "/imu/empty"))
    assert row_of(inspect(bench), "/imu/empty")[2] == "0"


def test_names_in_brackets_are_printed_as_they_are(bench: Bench) -> None:
    bench.write(imu_channel(resting(1.0, RATE)), attachment=("notes[draft].txt", b"hello"))
    assert "notes[draft].txt" in inspect(bench)


def test_a_real_log_with_vendor_messages(shared_data: Path, bench: Bench) -> None:
    """Counts as in its readme; its vendor schemas are listed, not read."""
    out = inspect(bench, shared_data / "novatel_oem7_parked.mcap")
    assert row_of(out, "/gps/imu")[1:3] == ["sensor_msgs/msg/Imu", "766"]
    corrimu = row_of(out, "/novatel/oem7/corrimu")
    assert corrimu[1:3] == ["novatel_oem7_msgs/msg/CORRIMU", "766"]
