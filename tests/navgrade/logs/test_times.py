"""Messages recorded late or twice are mended and counted; a clock that was set is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from navgrade import ImuSamples
from navgrade.errors import LogError
from navgrade.logs import imu_log, open_imu, read_imu, times
from navgrade.logs.container import reader
from tests.navgrade.cli.calling import Bench
from tests.navgrade.logmaking import (
    EPOCH_NS,
    SITE,
    Channel,
    Recording,
    damage_chunk,
    imu_channel,
    random_recording,
    resting,
    stamps,
    write_log,
)
from tests.navgrade.logs.vendors import vendor_channel

RATE = 100.0  # Hz
STEP_NS = 10_000_000
BLOCK = 16_384  # samples of a block
CHUNKS: list[dict[str, Any]] = [{}, {"chunk_bytes": 2_000}, {"chunked": False, "summary": False}]


@pytest.fixture(autouse=True, params=[None, 5_000], ids=["large batches", "small batches"])
def batches(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every test with the usual batches of messages and with batches of some ten."""
    if request.param:
        monkeypatch.setattr(reader, "_JOB_BYTES", request.param)


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    """An empty bench."""
    return Bench(tmp_path)


def shuffled(recording: Recording, order: NDArray[np.intp], **options: Any) -> Channel:
    """The messages in another order; their log times tell it."""
    log_ns = EPOCH_NS + STEP_NS * np.arange(len(order))
    return imu_channel(recording.rows(order), log_ns=log_ns, **options)


def read(path: Path, **options: Any) -> tuple[ImuSamples, list[str]]:
    """All samples, without turning axes, and the notes."""
    log = open_imu(path, kind="average", axes="FRD", **options)
    blocks = list(log.blocks())
    return imu_log.concatenate(blocks), log.notes


def equal(found: ImuSamples, recording: Recording) -> None:
    """Samples are, to the bit, those of the recording written in order."""
    assert np.array_equal(found.epoch_ns + np.rint(found.t * 1e9).astype(int), recording.stamp_ns)
    assert found.gyro.tobytes() == recording.gyro.tobytes()
    assert found.accel.tobytes() == recording.accel.tobytes()
    steps = np.diff(found.t)
    assert found.dt[1:].tobytes() == steps.tobytes()


def swapped(count: int, *pairs: tuple[int, int]) -> NDArray[np.intp]:
    """The order with a message `by` places late."""
    order = list(range(count))
    for place, by in pairs:
        order.insert(place + by, order.pop(place))
    return np.array(order)


# ---- late --------------------------------------------------------------------------------------


@pytest.mark.parametrize("container", CHUNKS)
def test_late_messages_find_their_place(tmp_path: Path, container: dict[str, Any]) -> None:
    recording = random_recording(1000, RATE)
    order = swapped(1000, (0, 1), (40, 1), (200, 99), (700, 3), (703, 20), (997, 2))
    path = write_log(tmp_path / "a.mcap", shuffled(recording, order), **container)
    imu, notes = read(path)
    equal(imu, recording)
    moved = sum(any(before > k for before in order[:place]) for place, k in enumerate(order))
    assert notes == [f"/imu/data_raw: {moved} messages were put back in order"]


def test_any_order_within_a_second_is_mended(tmp_path: Path) -> None:
    """Each message up to 99 places from its own."""
    recording = random_recording(3000, RATE)
    recording = replace(recording, stamp_ns=stamps(3000, RATE))
    order = np.argsort(np.arange(3000) + np.random.default_rng(8).uniform(0.0, 99.0, 3000))
    path = write_log(tmp_path / "a.mcap", shuffled(recording, order), chunk_bytes=3_000)
    imu, _ = read(path)
    equal(imu, recording)


@pytest.mark.parametrize("lag", [0, 1, 50])
def test_one_topic_on_two_channels(tmp_path: Path, lag: int) -> None:
    """Two publishers share the samples; the second one is recorded later."""
    recording = random_recording(2000, RATE)
    halves = [recording.rows(slice(k, None, 2)) for k in (0, 1)]
    log_ns = [half.stamp_ns + k * lag * STEP_NS for k, half in enumerate(halves)]
    channels = [imu_channel(half, log_ns=ns) for half, ns in zip(halves, log_ns, strict=True)]
    channels[1] = replace(channels[1], text=channels[1].text + "\n# another publisher\n")
    path = write_log(tmp_path / "a.mcap", *channels, chunk_bytes=30_000)
    imu, notes = read(path)
    equal(imu, recording)
    assert bool(notes) == (lag > 0)


@pytest.mark.parametrize(("late_ns", "fine"), [(1_000_000_000, True), (1_000_000_001, False)])
@pytest.mark.parametrize("container", CHUNKS)
def test_a_second_is_the_limit(
    tmp_path: Path, late_ns: int, fine: bool, container: dict[str, Any]
) -> None:
    recording = replace(random_recording(1000, RATE), stamp_ns=stamps(1000, RATE))
    recording.stamp_ns[500] += late_ns % STEP_NS * -1
    channel = shuffled(recording, swapped(1000, (500, 100)))
    path = write_log(tmp_path / "a.mcap", channel, **container)
    if fine:
        equal(read(path)[0], recording)
        return
    with pytest.raises(LogError, match=r"message 600, .* stamp steps back by 1\.000000 s") as error:
        read(path)
    assert error.value.index == 600
    assert error.value.topic == "/imu/data_raw"
    # 1 ns: the stamps' resolution
    assert error.value.time_s == pytest.approx(5.0 - 1e-9, abs=1e-10)


@pytest.mark.parametrize("at", [300, 1500, BLOCK - 1, BLOCK, BLOCK + 1])
@pytest.mark.parametrize("back_s", [0.0149, 0.303, 0.3075, 0.9999])
def test_a_clock_that_was_set_back_is_not_mended(tmp_path: Path, at: int, back_s: float) -> None:
    """Sorting would put the samples of two times between each other."""
    count = max(1000, at + 300)
    recording = replace(random_recording(count, RATE), stamp_ns=stamps(count, RATE))
    recording.stamp_ns[at:] -= round(back_s * 1e9)
    path = write_log(tmp_path / "a.mcap", imu_channel(recording), chunk_bytes=400_000)
    with pytest.raises(LogError, match="a clock that was set back, not a message that came late"):
        read(path)


def test_a_clock_set_back_by_whole_steps_repeats(tmp_path: Path) -> None:
    recording = replace(random_recording(1000, RATE), stamp_ns=stamps(1000, RATE))
    recording.stamp_ns[500:] -= 30 * STEP_NS
    path = write_log(tmp_path / "a.mcap", imu_channel(recording))
    with pytest.raises(LogError, match=r"message 500, .*stamp repeats with other values"):
        read(path)


def test_a_clock_set_forward_is_a_gap(tmp_path: Path) -> None:
    recording = replace(random_recording(1000, RATE), stamp_ns=stamps(1000, RATE))
    recording.stamp_ns[500:] += 3_600_000_000_000
    imu, notes = read(write_log(tmp_path / "a.mcap", imu_channel(recording)))
    assert np.diff(imu.t).max() > 3600.0
    assert notes == []


# ---- twice -------------------------------------------------------------------------------------


@pytest.mark.parametrize("container", CHUNKS)
def test_messages_recorded_twice_count_once(tmp_path: Path, container: dict[str, Any]) -> None:
    """At once, three times, and half a second later."""
    recording = random_recording(1000, RATE)
    order = np.insert(np.arange(1000), [1, 10, 10, 300, 1000], [0, 9, 9, 250, 999])
    path = write_log(tmp_path / "a.mcap", shuffled(recording, order), **container)
    imu, notes = read(path)
    equal(imu, recording)
    assert notes == ["/imu/data_raw: 5 messages recorded twice were left out"]


def test_a_stretch_recorded_twice_counts_once(tmp_path: Path) -> None:
    """As after the seam of two files with an overlap."""
    recording = random_recording(20_000, RATE)
    order = np.concatenate([np.arange(BLOCK), np.arange(BLOCK - 50, 20_000)])
    imu, notes = read(write_log(tmp_path / "a.mcap", shuffled(recording, order)))
    equal(imu, recording)
    assert notes == ["/imu/data_raw: 50 messages recorded twice were left out"]


@pytest.mark.parametrize("column", ["gyro", "accel", "interval"])
@pytest.mark.parametrize("later", [1, 40])
def test_one_stamp_with_two_values_is_refused(tmp_path: Path, column: str, later: int) -> None:
    recording = random_recording(1000, RATE)
    if column == "interval":
        recording = recording.as_increments(np.full(1000, 0.01))
    order = np.insert(np.arange(1000), [299, 300 + later, 500], [298, 300, 499])
    recording = recording.rows(order)  # two others are recorded twice, before and after it
    bad = 301 + later
    values = getattr(recording, column)
    values[bad] = np.nextafter(values[bad], np.inf)
    path = write_log(tmp_path / "a.mcap", imu_channel(recording, log_ns=EPOCH_NS + np.arange(1003)))
    with pytest.raises(LogError, match=f"message {bad}, .*repeats with other values"):
        read_imu(path, kind=None if column == "interval" else "average")


def test_late_and_twice_at_once(tmp_path: Path) -> None:
    recording = random_recording(1000, RATE)
    order = np.insert(swapped(1000, (500, 10)), 515, 500)
    imu, notes = read(write_log(tmp_path / "a.mcap", shuffled(recording, order)))
    equal(imu, recording)
    assert notes == [
        "/imu/data_raw: 1 messages were put back in order",
        "/imu/data_raw: 1 messages recorded twice were left out",
    ]


# ---- two topics --------------------------------------------------------------------------------


def delta_channels(count: int, order: NDArray[np.intp], late_ns: int = 0) -> list[Channel]:
    """Rotations in order, velocity increments in another one and later."""
    stamp_ns = stamps(count, RATE)
    log_ns = EPOCH_NS + STEP_NS * np.arange(len(order))
    turn = [0.0, 0.0, 0.0, 1.0]
    dq = vendor_channel(
        "/dq",
        "geometry_msgs/msg/QuaternionStamped",
        [{"header.stamp": ns, "quaternion": turn} for ns in stamp_ns],
        log_ns[:count],
    )
    dv = vendor_channel(
        "/dv",
        "geometry_msgs/msg/Vector3Stamped",
        [{"header.stamp": stamp_ns[k], "vector": [k, 0.0, 0.0]} for k in order],
        log_ns + late_ns,
    )
    return [dq, dv]


@pytest.mark.parametrize("late_ns", [0, 3_000_000_000])
@pytest.mark.parametrize("container", CHUNKS)
def test_two_topics_are_put_in_order_before_they_meet(
    tmp_path: Path, late_ns: int, container: dict[str, Any]
) -> None:
    order = np.insert(swapped(1000, (100, 1), (400, 30)), 600, 599)
    path = write_log(tmp_path / "a.mcap", *delta_channels(1000, order, late_ns), **container)
    log = open_imu(path, "/dq", accel_topic="/dv", axes="FRD")
    (imu,) = log.blocks()
    assert np.array_equal(imu.accel[:, 0], np.arange(1000.0))
    assert log.notes == [
        "/dv: 2 messages were put back in order",
        "/dv: 1 messages recorded twice were left out",
    ]


def test_a_topic_that_ends_early_does_not_fill_the_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dq, dv = delta_channels(1000, np.arange(1000))
    short = replace(dv, messages=dv.messages[:300], log_ns=dv.log_ns[:300])
    path = write_log(tmp_path / "a.mcap", dq, short, chunk_bytes=2_000)
    log = open_imu(path, "/dq", accel_topic="/dv")
    assert sum(map(len, log.blocks())) == 300
    assert log.notes == ["/dq: 700 messages without a partner were left out"]
    monkeypatch.setattr(times, "_MAX_PENDING", 500)
    monkeypatch.setattr(reader, "_JOB_BYTES", 10_000)
    with pytest.raises(LogError, match=r"/dq: message 199, .* like 5\d\d after it"):
        list(log.blocks())


# ---- what is told ------------------------------------------------------------------------------


def drive() -> Recording:
    """Ten seconds still, then moved."""
    return resting(20.0, RATE, sway_from_s=10.5)


def test_a_run_tells_what_it_mended(bench: Bench) -> None:
    recording = drive()
    bench.write(imu_channel(recording), site=SITE)
    bench.accepted()
    assert "notes" not in bench.provenance()
    clean = bench.out.read_bytes()
    order = np.insert(swapped(len(recording), (1500, 5)), 1800, 1799)
    bench.out.unlink()
    bench.write(shuffled(recording, order), site=SITE)
    outcome = bench.accepted()
    assert "warning: /imu/data_raw: 1 messages were put back in order" in outcome.out
    notes = json.loads(bench.provenance()["notes"])
    assert notes == [
        "/imu/data_raw: 1 messages were put back in order",
        "/imu/data_raw: 1 messages recorded twice were left out",
    ]
    assert abs(len(bench.out.read_bytes()) - len(clean)) < 2_000  # bytes: the notes


def test_what_is_known_beforehand_is_told_once(bench: Bench) -> None:
    rows = [
        {
            "header.stamp": EPOCH_NS + 5_000_000 * k,
            "nov_header.gps_week_milliseconds": 5 * k,
            "nov_header.gps_week_number": 2100,
            "vertical_acc": 9.806198 * 0.005,
        }
        for k in range(4000)
    ]
    log_ns = EPOCH_NS + 5_000_000 * np.arange(4000)
    channel = vendor_channel("/corrimu", "novatel_oem7_msgs/msg/CORRIMU", rows, log_ns)
    site = SITE.replace('kind = "average"\naxes = "FRD"\n', "")
    site = site.replace("[alignment]", "heading_deg = 70.0\n[alignment]")
    outcome = bench.write(channel, site=site).accepted()
    assert outcome.out.count("the receiver has removed gravity") == 1
    assert outcome.out.count("does not count from 1970") == 1
    assert "axes RFU (as its messages say)" in outcome.out


def test_a_damaged_file_is_told_once_though_two_topics_are_read(bench: Bench) -> None:
    heights = vendor_channel(
        "/height",
        "std_msgs/msg/Float64",
        [{"data": 0.0}] * 220,
        EPOCH_NS - 500_000_000 + 100_000_000 * np.arange(220),
    )
    site = SITE + '[mechanization]\nvertical = "baro"\n[baro]\ntopic = "/height"\n'
    bench.write(imu_channel(drive()), heights, site=site, chunk_bytes=100_000, compression="none")
    damage_chunk(bench.log, 5)
    assert bench.accepted("--bridge-gaps").out.count("damaged chunk") == 1


def test_the_epoch_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_log(tmp_path / "a.mcap", imu_channel(random_recording(1000)), compression="none")
    opened = []
    real = imu_log.McapFile

    def counted(*arguments: Any, **options: Any) -> Any:
        opened.append(arguments)
        return real(*arguments, **options)

    log = open_imu(path, kind="average")
    monkeypatch.setattr(imu_log, "McapFile", counted)
    assert [log.epoch_ns for _ in range(3)] == [EPOCH_NS] * 3
    assert len(opened) == 1
    log = open_imu(path, kind="average")
    next(log.blocks())
    assert log.epoch_ns == EPOCH_NS
    assert log.clock_offset_ns == 0
    assert len(opened) == 2


def test_a_log_behind_a_url_reads_like_a_file(tmp_path: Path) -> None:
    pytest.importorskip("fsspec", reason="the extra `remote` is not installed")
    recording = random_recording(1000)
    path = write_log(tmp_path / "a.mcap", imu_channel(recording))
    url = path.as_uri()
    imu = read_imu(url, kind="average", axes="FRD")
    equal(imu, recording)
    assert imu_log.sha256(url) == imu_log.sha256(path)
