"""Bad input gets one clear sentence, exit code 2, and nothing half-written."""

from __future__ import annotations

import json
import resource
import shutil
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from navgrade.logs import open_imu
from tests.navgrade.cli.calling import Bench, navgrade, one_sentence
from tests.navgrade.logmaking import (
    EPOCH_NS,
    SITE,
    Channel,
    Recording,
    chunks_of,
    damage_chunk,
    imu_channel,
    invert,
    random_recording,
    records_of,
    resting,
    started_site,
    text_channel,
    write_log,
)

RATE = 50.0  # Hz
STEP_NS = 20_000_000
STILL = 10.0  # s, the alignment window of SITE
MESSAGE, SCHEMA = 0x05, 0x03  # opcodes of MCAP


def drive(seconds: float = 20.0) -> Recording:
    """At rest for the alignment window, then moving."""
    return resting(seconds, RATE, sway_from_s=STILL + 0.5)


def increments(seconds: float = 20.0) -> Recording:
    """The same as integrals over each interval."""
    recording = drive(seconds)
    return recording.as_increments(np.full(len(recording), 1.0 / RATE))


def chunk_times(path: Path) -> list[tuple[int, int]]:
    """First and last log time of each chunk, ns, as its record says."""
    data = path.read_bytes()
    return [struct.unpack_from("<QQ", data, chunk.start) for chunk in chunks_of(path)]


def spliced(recording: Recording, stamp_ns: dict[int, int]) -> Recording:
    """A recording with some stamps replaced."""
    stamps = recording.stamp_ns.copy()
    for index, value in stamp_ns.items():
        stamps[index] = value
    return replace(recording, stamp_ns=stamps)


# ---- files that are no logs -----------------------------------------------------------------


@pytest.mark.parametrize("command", ["run", "align", "inspect"])
def test_a_missing_log_is_named(bench: Bench, command: str) -> None:
    bench.site.write_text(SITE)
    options = {
        "run": ("-c", bench.site, "-o", bench.out),
        "align": ("-c", bench.site),
        "inspect": (),
    }[command]
    one_sentence(navgrade(command, bench.log, *options), str(bench.log), "no such file")
    bench.left_nothing()


NOT_MCAP = {
    "text": (b"time,gx,gy,gz\n0.0,1,2,3\n", "not an MCAP file"),
    "empty": (b"", "empty"),
    "ROS 1 bag": (b"#ROSBAG V2.0\n" + bytes(4096), "ROS 1 bag"),
    "rosbag2 database": (b"SQLite format 3\0" + bytes(4096), "not an MCAP file"),
    "cut in the magic": (b"\x89MCA", "not an MCAP file"),
}


@pytest.mark.parametrize("name", NOT_MCAP)
@pytest.mark.parametrize("command", ["run", "align", "inspect"])
def test_a_file_that_is_not_mcap_is_told_apart(bench: Bench, command: str, name: str) -> None:
    content, fact = NOT_MCAP[name]
    bench.log.write_bytes(content)
    bench.site.write_text(SITE)
    options = {
        "run": ("-c", bench.site, "-o", bench.out),
        "align": ("-c", bench.site),
        "inspect": (),
    }[command]
    one_sentence(navgrade(command, bench.log, *options), str(bench.log), fact)
    bench.left_nothing()


def test_a_log_that_only_begins_holds_no_topics(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    data = bench.log.read_bytes()
    bench.log.write_bytes(data[: records_of(bench.log)[0].start + 10])
    bench.refused("no IMU topic", "no topics at all")


# ---- truncated and damaged logs ----------------------------------------------------------------


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_a_log_cut_inside_a_chunk_is_used_up_to_there(bench: Bench, compression: str) -> None:
    bench.write(imu_channel(drive()), site=SITE, chunk_bytes=30_000, compression=compression)
    cut = chunks_of(bench.log)[9]
    (_, last_whole_ns), (_, end_of_cut_ns) = chunk_times(bench.log)[8:10]
    bench.log.write_bytes(bench.log.read_bytes()[: cut.start + cut.length // 2])

    outcome = bench.accepted()
    assert "ends early" in outcome.out
    stamp_ns, _ = bench.stamps_and_status()
    if compression == "none":  # half of the messages are there
        middle_ns = (last_whole_ns + end_of_cut_ns) / 2
        assert abs(stamp_ns[-1] - middle_ns) < 3 * STEP_NS
    else:  # a block that is not whole cannot be unpacked
        assert stamp_ns[-1] == last_whole_ns
    provenance = bench.provenance()
    assert provenance["defects"] == "1"
    assert "ends early" in json.loads(provenance["defects_text"])[0]
    bench.out.unlink()
    bench.refused("ends early", str(bench.log), options=("--strict",))


def test_a_log_cut_in_its_summary_has_lost_no_sample_and_says_so(bench: Bench) -> None:
    recording = drive()
    bench.write(imu_channel(recording), site=SITE)
    bench.log.write_bytes(bench.log.read_bytes()[:-40])
    bench.accepted()
    stamp_ns, _ = bench.stamps_and_status()
    assert stamp_ns[-1] == recording.stamp_ns[-1]


def test_an_unchunked_log_that_is_cut_is_used_up_to_there(bench: Bench) -> None:
    recording = drive()
    bench.write(imu_channel(recording), site=SITE, chunked=False)
    messages = [record for record in records_of(bench.log) if record.opcode == MESSAGE]
    bench.log.write_bytes(bench.log.read_bytes()[: messages[800].start + 20])
    assert "ends early" in bench.accepted().out
    stamp_ns, _ = bench.stamps_and_status()
    assert stamp_ns[-1] == recording.stamp_ns[799]
    bench.out.unlink()
    bench.refused("ends early", options=("--strict",))


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_a_damaged_chunk_becomes_a_gap(bench: Bench, compression: str) -> None:
    bench.write(imu_channel(drive()), site=SITE, chunk_bytes=30_000, compression=compression)
    times = chunk_times(bench.log)
    before_ns, after_ns = times[7][1], times[9][0]
    damage_chunk(bench.log, 8)

    start = (before_ns - EPOCH_NS) * 1e-9
    hole_ns = after_ns - before_ns - STEP_NS
    bench.refused(
        f"{hole_ns * 1e-9:.3f} s without samples",
        f"after {start:.3f} s",
        "--bridge-gaps",
        "damaged chunk",
        str(bench.log),
        "/imu/data_raw",
    )
    bench.refused("damaged chunk", str(bench.log), options=("--strict",))
    bench.refused("damaged chunk", options=("--strict", "--bridge-gaps"))

    outcome = bench.accepted("--bridge-gaps")
    assert "damaged chunk" in outcome.out
    stamp_ns, status = bench.stamps_and_status()
    bridged = (status & 1).astype(bool)
    assert bridged.sum() == hole_ns // STEP_NS
    assert np.array_equal(bridged, (stamp_ns > before_ns) & (stamp_ns < after_ns))
    assert np.all(np.diff(stamp_ns) == STEP_NS)
    provenance = bench.provenance()
    assert provenance["gaps"] == "1"
    assert provenance["defects"] == "1"
    assert provenance["samples_bridged"] == str(bridged.sum())
    ((gap_start, gap_length),) = json.loads(provenance["gaps_s"])
    # stamps are exact to 1 ns; the printed seconds carry a double's rounding at 20 s
    assert gap_start == pytest.approx(start, abs=1e-9)
    assert gap_length == pytest.approx(hole_ns * 1e-9, abs=1e-9)


def test_a_chunk_that_claims_a_senseless_size_becomes_a_gap(bench: Bench) -> None:
    """Two bits of the zstd frame say how long its size is: set, they make it exabytes."""
    bench.write(imu_channel(drive()), site=SITE, chunk_bytes=30_000)
    frame = chunks_of(bench.log)[8].start + 44  # behind times, size, CRC, "zstd" and length
    data = bytearray(bench.log.read_bytes())
    assert data[frame : frame + 4] == bytes.fromhex("28b52ffd")
    data[frame + 4] |= 0xC0
    bench.log.write_bytes(data)
    bench.refused("damaged chunk", "without samples", "--bridge-gaps")
    assert "damaged chunk" in bench.accepted("--bridge-gaps").out


def test_a_damaged_first_chunk_costs_only_itself(bench: Bench) -> None:
    """The first chunk also holds the channel and schema records; the summary repeats them.

    Seconds of the window then count from the first sample that is left.
    """
    recording = drive(25.0)
    site = SITE.replace("duration_s = 10.0", "duration_s = 6.0")
    bench.write(imu_channel(recording), site=site, chunk_bytes=30_000)
    first_left_ns = chunk_times(bench.log)[1][0]
    damage_chunk(bench.log, 0)
    assert "damaged chunk" in bench.accepted().out
    stamp_ns, _ = bench.stamps_and_status()
    assert stamp_ns[0] >= first_left_ns + 6_000_000_000
    assert stamp_ns[-1] == recording.stamp_ns[-1]
    bench.out.unlink()
    bench.refused("damaged chunk", options=("--strict",))


def test_damage_without_chunks_is_noticed(bench: Bench) -> None:
    """An unchunked log has one checksum, that of its data section."""
    bench.write(imu_channel(drive()), site=SITE, chunked=False)
    messages = [record for record in records_of(bench.log) if record.opcode == MESSAGE]
    invert(bench.log, messages[700].start + messages[700].length - 74)  # in linear_acceleration
    bench.refused("checksum", str(bench.log), options=("--strict",))
    assert "checksum" in bench.accepted().out


@pytest.mark.parametrize("command", ["run", "inspect", "align"])
@pytest.mark.parametrize("where", [2, 12, 90])
@pytest.mark.parametrize("summary", [True, False])
def test_a_damaged_schema_record_is_no_crash(
    bench: Bench, command: str, where: int, summary: bool
) -> None:
    bench.write(imu_channel(drive()), site=SITE, chunked=False, summary=summary)
    (schema, *_) = [record for record in records_of(bench.log) if record.opcode == SCHEMA]
    data = bytearray(bench.log.read_bytes())
    data[schema.start + where] = 0xFF  # in a length, in the name, in the text
    bench.log.write_bytes(data)
    options = {
        "run": ("-c", bench.site, "-o", bench.out),
        "align": ("-c", bench.site),
        "inspect": (),
    }[command]
    outcome = navgrade(command, bench.log, *options)
    if outcome.code:  # the summary holds a copy of the record, so it need not be refused
        one_sentence(outcome, str(bench.log))
        bench.left_nothing()
    else:
        assert outcome.err == ""


# ---- topics and schemas ------------------------------------------------------------------------


def test_no_imu_topic_lists_what_there_is(bench: Bench) -> None:
    bench.write(text_channel("/chatter", count=11), site=SITE)
    bench.refused("no IMU topic", "/chatter", "std_msgs/msg/String", "11 at 10 Hz")


def test_several_imu_topics_are_listed_with_rate_and_count(bench: Bench) -> None:
    bench.write(
        imu_channel(drive(), "/imu/left"),
        imu_channel(drive().rows(slice(None, None, 2)), "/imu/right"),
        text_channel(),
        site=SITE,
    )
    sentence = bench.refused(
        "2 IMU topics",
        "--imu-topic",
        "imu.topic",
        "/imu/left (sensor_msgs/msg/Imu, 1001 at 50 Hz)",
        "/imu/right (sensor_msgs/msg/Imu, 501 at 25 Hz)",
    )
    assert "/chatter" not in sentence
    bench.accepted("--imu-topic", "/imu/right")
    assert bench.provenance()["topic"] == "/imu/right"
    bench.site.write_text(SITE.replace("[imu]\n", '[imu]\ntopic = "/imu/left"\n'))
    bench.accepted("--overwrite")
    assert bench.provenance()["topic"] == "/imu/left"


def test_a_topic_that_is_not_there_is_named_with_those_that_are(bench: Bench) -> None:
    bench.write(imu_channel(drive()), text_channel(), site=SITE)
    bench.refused(
        "/imu/raw",
        "no such topic",
        "/imu/data_raw",
        "/chatter",
        options=("--imu-topic", "/imu/raw"),
    )


FOREIGN = {
    "std_msgs/msg/String": (text_channel(), "std_msgs/msg/String"),
    "CBOR": (
        Channel("/chatter", "sensor_msgs/msg/Imu", "{}", [b"\xa0"], [0], "jsonschema", "cbor"),
        "cbor",
    ),
    "IDL": (
        Channel("/chatter", "sensor_msgs/msg/Imu", "struct Imu {};", [b""], [0], "ros2idl"),
        "ros2idl",
    ),
}


@pytest.mark.parametrize("name", FOREIGN)
def test_an_unknown_schema_or_encoding_is_named(bench: Bench, name: str) -> None:
    channel, fact = FOREIGN[name]
    bench.write(imu_channel(drive()), channel, site=SITE)
    bench.refused("/chatter", fact, "is not", "read", options=("--imu-topic", "/chatter"))


def test_a_definition_without_the_members_is_refused(bench: Bench) -> None:
    channel = imu_channel(drive())
    renamed = replace(channel, text=channel.text.replace("angular_velocity", "spin"))
    bench.write(renamed, site=SITE)
    bench.refused("/imu/data_raw", "there is no angular_velocity; there is header, ")


def test_messages_too_short_for_their_definition_are_refused(bench: Bench) -> None:
    channel = imu_channel(drive())
    cut = replace(channel, messages=[message[:200] for message in channel.messages])
    bench.write(cut, site=SITE)
    bench.refused("200 bytes")


# ---- kind and axes -----------------------------------------------------------------------------


def test_a_missing_kind_explains_the_four_choices(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE.replace('kind = "average"\n', ""))
    bench.refused(
        "sensor_msgs/msg/Imu does not say",
        "--kind",
        "imu.kind",
        "rate (instantaneous",
        "average (mean over the interval that ends at the stamp)",
        "increment (integral over that interval)",
        "compensated (increments the sensor has already",
    )
    bench.accepted("--kind", "average")
    assert bench.provenance()["kind"] == "average"


@pytest.mark.parametrize("kind", ["rate", "average"])
def test_increments_cannot_be_called_rates(bench: Bench, kind: str) -> None:
    bench.write(imu_channel(increments()), site=SITE)
    bench.refused(
        "navgrade_msgs/msg/ImuIncrement",
        "increment or compensated",
        repr(kind),
        options=("--kind", kind),
    )


@pytest.mark.parametrize(
    ("options", "facts"),
    [
        (("--kind", "averaged"), ("'averaged'", "average (mean over")),
        (("--axes", "FRU"), ("'FRU'", "not a right-handed triple", "FLU")),
        (("--axes", "x=-up"), ("x=-up", "leaves y, z open")),
        (("--axes", "x=north y=east z=down"), ("x=north", "not understood", "forward")),
        (("--reconstruction", "causal-5"), ("'causal-5'", "did you mean 'causal-")),
        (("--frame", "ned"), ("frame 'ned'", "not one of n, e, i, w")),
        (("--vertical", "held"), ("'held'", "did you mean 'hold'")),
        (("--gravity", "WGS84"), ("gravity 'WGS84'", "not one of closed-form, somigliana")),
        (("--output-rate", "0"), ("output rate", "positive", "0.0 Hz")),
        (("--output-rate", "nan"), ("output rate", "positive", "nan Hz")),
    ],
)
def test_a_wrong_option_names_what_it_may_be(
    bench: Bench, options: tuple[str, ...], facts: tuple[str, ...]
) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.refused(*facts, options=options)


# ---- values and time ---------------------------------------------------------------------------

MOVING = started_site(velocity=(1.0, 0.0, 0.0))
SMALL_CHUNKS = 50_000  # bytes; blocks end where chunks do


@pytest.fixture(scope="module")
def seam(tmp_path_factory: pytest.TempPathFactory) -> int:
    """Index of the first sample of the reader's second block, in logs of 20,000 messages."""
    path = tmp_path_factory.mktemp("seam") / "a.mcap"
    write_log(path, imu_channel(random_recording(20_000, RATE)), chunk_bytes=SMALL_CHUNKS)
    first = len(next(open_imu(path, kind="average").blocks()))
    assert 1000 < first < 19_000
    return first


@pytest.mark.parametrize("place", ["first", "fortieth", "seam", "behind the seam"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["gyro", "accel"])
def test_a_value_that_is_not_finite_is_named_by_message_and_time(
    bench: Bench, seam: int, column: str, value: float, place: str
) -> None:
    index = {"first": 0, "fortieth": 40, "seam": seam, "behind the seam": seam + 300}[place]
    recording = random_recording(20_000 if index > 1000 else 100, RATE)
    getattr(recording, column)[index, 1] = value
    seconds = (int(recording.stamp_ns[index]) - EPOCH_NS) * 1e-9
    bench.write(imu_channel(recording), site=MOVING, chunk_bytes=SMALL_CHUNKS)
    bench.refused(
        {"gyro": "angular rate", "accel": "specific force"}[column],
        str(value),
        "not finite",
        f"message {index},",
        f"{seconds:.6f} s",
        "/imu/data_raw",
        str(bench.log),
    )


@pytest.mark.parametrize(
    ("value", "fact"), [(np.nan, "not finite"), (0.0, "not positive"), (-0.02, "not positive")]
)
def test_an_interval_that_is_none_is_named_by_message(
    bench: Bench, value: float, fact: str
) -> None:
    recording = increments()
    assert recording.interval is not None
    recording.interval[7] = value
    bench.write(imu_channel(recording), site=SITE)
    bench.refused("interval", fact, "message 7,", "0.140000 s", options=("--kind", "increment"))


@pytest.mark.parametrize("place", ["second", "inside", "seam", "behind the seam"])
@pytest.mark.parametrize("back_ns", [0, 5_000_000])
def test_time_that_repeats_or_runs_backwards_is_named(
    bench: Bench, seam: int, place: str, back_ns: int
) -> None:
    index = {"second": 1, "inside": 700, "seam": seam, "behind the seam": seam + 1}[place]
    recording = random_recording(20_000 if index > 1000 else 1000, RATE)
    before_ns = int(recording.stamp_ns[index - 1])
    recording = spliced(recording, {index: before_ns - back_ns})
    bench.write(imu_channel(recording), site=MOVING, chunk_bytes=SMALL_CHUNKS)
    bench.refused(
        "steps back by 0.005000 s" if back_ns else "repeats",
        f"message {index},",
        f"{(before_ns - back_ns - EPOCH_NS) * 1e-9:.6f} s",
        "navgrade inspect",
        str(bench.log),
    )


# ---- gaps --------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["rate", "average", "increment", "compensated"])
@pytest.mark.parametrize("missing", [3, 4, 100])
def test_a_gap_longer_than_three_intervals_is_bridged_only_on_request(
    bench: Bench, kind: str, missing: int
) -> None:
    recording = increments() if kind in ("increment", "compensated") else drive()
    bench.write(imu_channel(recording.without(700, missing)), site=SITE)
    bench.refused(
        f"{missing / RATE:.3f} s without samples",
        f"after {699 / RATE:.3f} s",
        "--bridge-gaps",
        options=("--kind", kind),
    )
    outcome = bench.accepted("--kind", kind, "--bridge-gaps")
    assert f"{missing / RATE:.3f} s at {699 / RATE:.3f} s" in outcome.out
    stamp_ns, status = bench.stamps_and_status()
    index = np.rint((stamp_ns - EPOCH_NS) / STEP_NS).astype(int)
    assert np.array_equal(index[(status & 1) == 1], np.arange(700, 700 + missing))
    assert np.array_equal(index, np.arange(501, 1001))
    provenance = bench.provenance()
    assert provenance["gaps"] == "1"
    assert provenance["samples_bridged"] == str(missing)
    ((start, length),) = json.loads(provenance["gaps_s"])
    assert start == pytest.approx(699 / RATE, abs=1e-9)  # stamps are exact to 1 ns
    assert length == pytest.approx(missing / RATE, abs=1e-9)


@pytest.mark.parametrize("kind", ["rate", "average", "increment", "compensated"])
@pytest.mark.parametrize("missing", [1, 2])
def test_one_or_two_missing_samples_are_stretched_over_and_marked(
    bench: Bench, kind: str, missing: int
) -> None:
    recording = increments() if kind in ("increment", "compensated") else drive()
    bench.write(imu_channel(recording.without(700, missing)), site=SITE)
    outcome = bench.accepted("--kind", kind)
    assert "stretched samples     1 " in outcome.out
    stamp_ns, status = bench.stamps_and_status()
    index = np.rint((stamp_ns - EPOCH_NS) / STEP_NS).astype(int)
    assert index[status == 2].tolist() == [700 + missing]
    assert len(index) == 500 - missing
    provenance = bench.provenance()
    assert provenance["samples_stretched"] == "1"
    assert provenance["gaps"] == "0"


def test_intervals_that_overlap_are_refused(bench: Bench) -> None:
    recording = drive()
    doubled = recording.as_increments(np.full(len(recording), 2.0 / RATE))
    bench.write(imu_channel(doubled), site=started_site())
    bench.refused(
        "0.020000 s before the previous sample ends",
        "dt",
        "stamp",
        options=("--kind", "increment"),
    )


# ---- units and gravity -------------------------------------------------------------------------

SITES = {"site": SITE, "initial": started_site()}


@pytest.mark.parametrize("site", SITES)
@pytest.mark.parametrize("kind", ["average", "rate", "increment"])
@pytest.mark.parametrize(
    ("gyro", "accel", "facts"),
    [
        (1.0, 1.0 / 9.80665, ("1.0000", "in g", 'imu.accel_unit = "g"')),
        (180.0 / np.pi, 1.0, ("57.3 times", "degrees", 'imu.gyro_unit = "deg/s"')),
        (1.0, 1e-3, ("gravity has been removed", "0.0098 m/s²")),
        (1.0, 0.5, ("4.9031 m/s²", "not 9.8")),
    ],
)
def test_wrong_units_name_the_cause_and_the_option(
    bench: Bench, gyro: float, accel: float, facts: tuple[str, ...], kind: str, site: str
) -> None:
    recording = increments() if kind == "increment" else drive()
    bench.write(imu_channel(recording.scaled(gyro, accel)), site=SITES[site])
    bench.refused(*facts, options=("--kind", kind))


@pytest.mark.parametrize(
    ("gyro", "accel", "option"),
    [(1.0, 1.0 / 9.80665, 'accel_unit = "g"'), (180.0 / np.pi, 1.0, 'gyro_unit = "deg/s"')],
)
def test_the_named_option_mends_the_unit(
    bench: Bench, gyro: float, accel: float, option: str
) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.accepted()
    wanted = bench.messages()[-1]
    site = SITE.replace("[imu]\n", f"[imu]\n{option}\n")
    bench.write(imu_channel(drive().scaled(gyro, accel)), site=site)
    bench.accepted("--overwrite")
    found = bench.messages()[-1]
    # one rounding of each sample, 1e-16 of g, cannot move 10 s of navigation by a micrometre
    metre = 1.0 / 111_000.0  # degrees of latitude
    assert found.latitude_deg == pytest.approx(wanted.latitude_deg, abs=1e-6 * metre)
    assert found.height_m == pytest.approx(wanted.height_m, abs=1e-6)
    assert found.heading_deg == pytest.approx(wanted.heading_deg, abs=1e-9)


def test_wrong_unit_names_list_the_right_ones(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE.replace("[imu]\n", '[imu]\ngyro_unit = "rpm"\n'))
    bench.refused("gyro_unit", "'rpm'", "rad/s", "deg/s")


def test_a_real_stream_without_gravity_is_refused(bench: Bench, shared_data: Path) -> None:
    site = SITE.replace("latitude = 45.0", "latitude = 51.15").replace("8.0", "-114.03")
    bench.site.write_text(site)
    shutil.copy(shared_data / "novatel_oem7_parked.mcap", bench.log)
    bench.refused(
        "gravity has been removed", "log the raw IMU topic", options=("--imu-topic", "/gps/imu")
    )


# ---- the site against the data -----------------------------------------------------------------


@pytest.mark.parametrize("true_deg", [43.0, 45.6])
def test_a_latitude_the_gyros_contradict_is_a_warning(bench: Bench, true_deg: float) -> None:
    bench.write(imu_channel(resting(20.0, RATE, lat_deg=true_deg)), site=SITE)
    outcome = bench.accepted()
    assert "warning" in outcome.out
    assert f"latitude {true_deg:.3f}°, {true_deg - 45.0:+.3f}° from the site's" in outcome.out
    (warning,) = json.loads(bench.provenance()["alignment"])["warnings"]
    assert f"{true_deg:.3f}°" in warning


def test_a_latitude_within_the_predicted_sigma_is_no_warning(bench: Bench) -> None:
    """0.01 deg/h of stated gyro bias is 0.04 deg of latitude, 1-sigma."""
    bench.write(imu_channel(resting(20.0, RATE, lat_deg=45.05)), site=SITE)
    assert "warning" not in bench.accepted().out


def test_gyros_too_weak_for_north_ask_for_a_heading(bench: Bench) -> None:
    weak = SITE.replace("gyro_bias_deg_h = 0.01", "gyro_bias_deg_h = 10.0")
    bench.write(imu_channel(drive()), site=weak)
    bench.refused("cannot find north", "site.heading_deg", "site.heading_sigma_deg")
    bench.site.write_text(weak.replace("[site]\n", "[site]\nheading_deg = 70.0\n"))
    bench.accepted()


def test_a_window_that_is_not_still_is_refused(bench: Bench) -> None:
    bench.write(imu_channel(resting(20.0, RATE, sway_from_s=3.0)), site=SITE)
    bench.refused("not still", "alignment.start_s", "duration_s")


@pytest.mark.parametrize(
    ("start", "duration", "facts"),
    [
        ("0.0", "21.0", ("21 s", "the log ends at 20.000 s", "duration_s")),
        ("15.0", "10.0", ("15 s to 25 s", "the log ends at 20.000 s", "start_s")),
        ("0.0", "20.0", ("20.0", "no samples")),
    ],
)
def test_a_window_beyond_the_log_is_refused(
    bench: Bench, start: str, duration: str, facts: tuple[str, ...]
) -> None:
    site = SITE.replace("start_s = 0.0", f"start_s = {start}")
    site = site.replace("duration_s = 10.0", f"duration_s = {duration}")
    bench.write(imu_channel(resting(20.0, RATE)), site=site)
    bench.refused(*facts)


@pytest.mark.parametrize(
    ("latitude", "north_m_s", "at"),
    [(89.95, 0.0, "0.000 s"), (-89.95, 0.0, "0.000 s"), (89.8999, 100.0, None)],
)
def test_beyond_89_9_degrees_the_frame_to_use_is_named(
    bench: Bench, latitude: float, north_m_s: float, at: str | None
) -> None:
    recording = resting(20.0, RATE, lat_deg=latitude, gravity=9.832)
    bench.write(
        imu_channel(recording), site=started_site(latitude=latitude, velocity=(north_m_s, 0.0, 0.0))
    )
    sentence = bench.refused("frame n", "±89.9°", "e (Earth-fixed)", "w (wander azimuth)")
    if at is not None:
        assert f"passed at {at}" in sentence


@pytest.mark.parametrize(
    ("offset_s", "fact"), [(-1, "before the samples"), (25, "leaves no samples")]
)
def test_an_initial_state_outside_the_log_is_refused(
    bench: Bench, offset_s: int, fact: str
) -> None:
    bench.write(imu_channel(drive()), site=started_site(EPOCH_NS + offset_s * 1_000_000_000))
    bench.refused(f"{offset_s:.9f} s", fact)


# ---- the site file -----------------------------------------------------------------------------

SITE_ERRORS = {
    "unknown table": ("[site]", "[sight]", ("sight", "nearest allowed key is site")),
    "unknown key": ("height_m", "heigth_m", ("site.heigth_m", "nearest allowed key is height_m")),
    "unknown key of errors": (
        "gyro_bias_deg_h",
        "gyro_bias_dph",
        ("imu.errors.gyro_bias_dph", "nearest allowed key is gyro_bias_deg_h"),
    ),
    "number as text": ("height_m = 0.0", 'height_m = "0"', ("site.height_m", "number", "'0'")),
    "text as number": ('kind = "average"', "kind = 3", ("imu.kind", "text", "3")),
    "orthometric height alone": (
        "height_m",
        "orthometric_height_m",
        ("site.orthometric_height_m", "geoid_height_m", "ellipsoid"),
    ),
    "no height": ("height_m = 0.0\n", "", ("site.height_m", "required")),
    "no latitude": ("latitude = 45.0\n", "", ("site.latitude", "required")),
    "no site": (SITE[SITE.index("[site]") : SITE.index("[alignment]")], "", ("[site]",)),
    "no duration": ("duration_s = 10.0\n", "", ("alignment.duration_s", "required")),
    "unknown method": (
        "[alignment]\n",
        "[alignment]\nmethod = 'triads'\n",
        ("alignment.method", "'triads'", "triad"),
    ),
    "both": (
        "[alignment]",
        started_site()[started_site().index("[initial]") :] + "[alignment]",
        ("initial", "[site]", "instead"),
    ),
    "axes": ('"FRD"', '"FRU"', ("FRU", "right-handed")),
    "sigma without heading": (
        "height_m",
        "heading_sigma_deg = 1.0\nheight_m",
        ("site.heading_sigma_deg", "heading_deg"),
    ),
    "reconstruction": (
        "[alignment]",
        '[mechanization]\nreconstruction = "casual-3"\n[alignment]',
        ("'casual-3'", "did you mean 'causal-3'"),
    ),
    "not TOML": ("[site]", "[site", ("cannot be read", "line")),
}


@pytest.mark.parametrize("name", SITE_ERRORS)
def test_a_wrong_site_file_names_the_key(bench: Bench, name: str) -> None:
    old, new, facts = SITE_ERRORS[name]
    assert SITE.count(old) == 1
    bench.write(imu_channel(drive()), site=SITE.replace(old, new))
    bench.refused(*facts)


def test_a_missing_site_file_is_named(bench: Bench) -> None:
    bench.write(imu_channel(drive()))
    bench.refused(str(bench.site), "no such site file")


# ---- where the output goes ---------------------------------------------------------------------


def test_an_existing_output_is_not_touched(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.out.write_bytes(b"the work of last week")
    one_sentence(bench.run(), str(bench.out), "exists", "--overwrite")
    assert bench.out.read_bytes() == b"the work of last week"
    assert not bench.part.exists()


@pytest.mark.parametrize("defect", ["gap", "pole"])
def test_overwrite_keeps_the_old_output_when_the_run_fails(bench: Bench, defect: str) -> None:
    site = SITE if defect == "gap" else started_site(latitude=89.9, velocity=(100.0, 0.0, 0.0))
    bench.write(imu_channel(drive().without(700, 10)), site=site)
    bench.out.write_bytes(b"the work of last week")
    assert bench.run("--overwrite").code == 2
    assert bench.out.read_bytes() == b"the work of last week"
    assert not bench.part.exists()


def test_the_log_is_never_the_output(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    content = bench.log.read_bytes()
    outcome = navgrade("run", bench.log, "-c", bench.site, "-o", bench.log, "--overwrite")
    one_sentence(outcome, str(bench.log), "input log")
    assert bench.log.read_bytes() == content
    assert sorted(path.name for path in bench.folder.iterdir()) == ["drive.mcap", "site.toml"]


def test_a_folder_that_is_not_there_is_named(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    out = bench.folder / "results" / "nav.mcap"
    one_sentence(navgrade("run", bench.log, "-c", bench.site, "-o", out), str(out.parent))


def test_an_output_that_is_a_folder_leaves_no_part(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.out.mkdir()
    one_sentence(bench.run("--overwrite"), str(bench.out))
    assert not bench.part.exists()


def test_a_full_disk_leaves_nothing(bench: Bench) -> None:
    """The output fits into the writer's buffer, so that the disk is full only at the very end."""
    bench.write(imu_channel(drive()), site=SITE)

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))  # bytes a file may have

    command = [sys.executable, "-m", "navgrade", "run"]
    command += [str(bench.log), "-c", str(bench.site), "-o", str(bench.out)]
    done = subprocess.run(command, capture_output=True, text=True, preexec_fn=limit, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("navgrade: ")
    assert done.stderr.count("\n") == 1
    bench.left_nothing()


# ---- as a user calls it ------------------------------------------------------------------------


@pytest.mark.parametrize("entry", [(sys.executable, "-m", "navgrade")])
def test_the_sentence_stands_alone_on_stderr(bench: Bench, entry: tuple[str, ...]) -> None:
    bench.write(imu_channel(drive().without(700, 10)), site=SITE)
    command = [*entry, "run", str(bench.log), "-c", str(bench.site), "-o", str(bench.out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith(f"navgrade: {bench.log}, /imu/data_raw: 0.200 s without samples")
    assert done.stderr.count("\n") == 1
    bench.left_nothing()
