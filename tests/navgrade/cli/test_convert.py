"""``navgrade convert``: what comes out navigates as what went in."""

from __future__ import annotations

import csv
import re
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from tests.navgrade.cli.calling import Bench, Outcome, navgrade, one_sentence
from tests.navgrade.logmaking import (
    SITE,
    Recording,
    chunks_of,
    damage_chunk,
    from_body_axes,
    imu_channel,
    resting,
    text_channel,
)
from tests.navgrade.logs.decoding import SOLUTION_FLOATS, solution

RATE = 50.0  # Hz
STILL = 10.0  # s, the alignment window of SITE
UNSAID = SITE.replace('kind = "average"\n', "").replace('axes = "FRD"\n', "")
COLUMNS = ("--time", "t", "--gyro", "gx,gy,gz", "--accel", "ax, ay, az")
AVERAGES = (*COLUMNS, "--kind", "average", "--axes", "FRD")


def drive(seconds: float = 20.0) -> Recording:
    """At rest for the alignment window, then moving."""
    return resting(seconds, RATE, sway_from_s=STILL + 0.5)


def increments(seconds: float = 20.0) -> Recording:
    recording = drive(seconds)
    return recording.as_increments(np.full(len(recording), 1.0 / RATE))


def convert(bench: Bench, output: str, *options: object, source: Path | None = None) -> Outcome:
    """The command, from the log unless another source is given."""
    return navgrade("convert", source or bench.log, "-o", bench.folder / output, *options)


def converted(bench: Bench, output: str, *options: object, source: Path | None = None) -> Path:
    """The file it wrote."""
    outcome = convert(bench, output, *options, source=source)
    assert outcome.code == 0, outcome
    assert outcome.err == ""
    path = bench.folder / output
    assert path.is_file()
    assert not path.with_name(path.name + ".part").exists()
    return path


def navigated(bench: Bench, log: Path, site: str, name: str) -> Path:
    """The solution of a log."""
    bench.site.write_text(site)
    out = bench.folder / name
    outcome = navgrade("run", log, "-c", bench.site, "-o", out)
    assert outcome.code == 0, outcome
    return out


def text_of(bench: Bench, recording: Recording, name: str = "drive.csv") -> Path:
    """The recording as a text file with a header."""
    columns = np.concatenate([recording.gyro, recording.accel], axis=1).tolist()
    path = bench.folder / name
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["t", "gx", "gy", "gz", "ax", "ay", "az"])
        for ns, row in zip(recording.stamp_ns.tolist(), columns, strict=True):
            writer.writerow([f"{ns // 10**9}.{ns % 10**9:09d}", *map(repr, row)])
    return path


def same(one: Path, other: Path) -> None:
    """Check that two solutions are the same to the bit."""
    first, second = solution(one), solution(other)
    assert len(first["stamp_ns"]) > 400
    for name in (*SOLUTION_FLOATS, "status", "stamp_ns"):
        assert first[name].tobytes() == second[name].tobytes(), name


@pytest.mark.parametrize("axes", ["FRD", "RFU"])
def test_converted_increments_navigate_to_the_same_bits(bench: Bench, axes: str) -> None:
    """And nobody says kind or axes of the new file."""
    bench.write(imu_channel(from_body_axes(increments(), axes)), text_channel())
    site = UNSAID.replace("[imu]\n", f'[imu]\naxes = "{axes}"\n')
    truth = navigated(bench, bench.log, site, "truth.mcap")
    out = converted(bench, "out.mcap", "--axes", axes)
    same(navigated(bench, out, UNSAID, "again.mcap"), truth)


def test_what_the_site_file_says_of_the_imu_holds(bench: Bench) -> None:
    site = UNSAID.replace("[imu]\n", '[imu]\naxes = "RFU"\nkind = "compensated"\n')
    bench.write(imu_channel(from_body_axes(increments(), "RFU")))
    truth = navigated(bench, bench.log, site, "truth.mcap")
    out = converted(bench, "out.mcap", "-c", bench.site)
    same(navigated(bench, out, UNSAID, "again.mcap"), truth)


def test_the_way_through_a_table_and_back_keeps_every_bit(bench: Bench) -> None:
    bench.write(imu_channel(increments()))
    table = converted(bench, "out.csv", "--axes", "FRD")
    angles = ",".join(f"delta_angle_{axis}_rad" for axis in "xyz")
    velocities = ",".join(f"delta_velocity_{axis}_m_s" for axis in "xyz")
    columns = ("--time", "time_ns", "--time-unit", "ns", "--gyro", angles, "--accel", velocities)
    back = converted(
        bench,
        "back.mcap",
        *(*columns, "--interval", "interval_s", "--interval-unit", "s"),
        *("--kind", "increment", "--axes", "FRD"),
        source=table,
    )
    site = UNSAID.replace("[imu]\n", '[imu]\naxes = "FRD"\n')
    truth = navigated(bench, bench.log, site, "truth.mcap")
    same(navigated(bench, back, UNSAID, "again.mcap"), truth)


def test_a_text_file_navigates_as_the_log_of_the_same_numbers(bench: Bench) -> None:
    recording = drive()
    bench.write(imu_channel(recording))
    truth = navigated(bench, bench.log, SITE, "truth.mcap")
    out = converted(bench, "out.mcap", *AVERAGES, source=text_of(bench, recording))
    same(navigated(bench, out, UNSAID, "again.mcap"), truth)


def test_it_says_what_it_read_and_wrote(bench: Bench) -> None:
    bench.write(imu_channel(increments()))
    out = convert(bench, "out.mcap", "--axes", "RFU").out
    assert re.search(
        r"/imu/data_raw +navgrade_msgs/msg/ImuIncrement, kind increment, axes RFU", out
    )
    assert re.search(r"written +\S+out.mcap, 1001 samples: /imu/increments", out)
    assert "kind increment, axes FRD" in out
    text = text_of(bench, drive())
    out = convert(bench, "text.mcap", *AVERAGES, source=text).out
    assert f"{text}  kind average, axes FRD" in out
    assert "1001 samples: /imu/data_raw, sensor_msgs/msg/Imu, kind average, axes FLU" in out


def test_a_window_in_seconds_after_the_first_sample(bench: Bench) -> None:
    bench.write(imu_channel(increments()))
    out = converted(bench, "out.csv", "--start-s", "5", "--end-s", "6")
    with out.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 50
    assert (float(rows[0]["time_s"]), float(rows[-1]["time_s"])) == (5.0, 5.98)


def test_a_solution_becomes_a_table(bench: Bench) -> None:
    bench.write(imu_channel(drive()), site=SITE)
    bench.accepted()
    out = converted(bench, "nav.csv", "--topic", "/navgrade/solution", source=bench.out)
    with out.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    truth = solution(bench.out)
    for name in SOLUTION_FLOATS:
        assert [float(row[name]) for row in rows] == truth[name].tolist()
    assert [int(row["header.stamp_ns"]) for row in rows] == truth["stamp_ns"].tolist()
    fixes = converted(bench, "fix.csv", "--topic", "/navgrade/fix", source=bench.out)
    assert "position_covariance.8" in fixes.read_text().splitlines()[0]


def test_damage_is_told_and_the_rest_converted(bench: Bench) -> None:
    bench.write(imu_channel(increments()), chunk_bytes=30_000)
    start_ns, end_ns = struct.unpack_from(
        "<QQ", bench.log.read_bytes(), chunks_of(bench.log)[2].start
    )
    lost = round((end_ns - start_ns) * 1e-9 * RATE) + 1
    damage_chunk(bench.log, 2)
    outcome = convert(bench, "out.mcap")
    assert f"{1001 - lost} samples" in outcome.out
    assert "damaged chunk" in outcome.out
    sentence = one_sentence(convert(bench, "strict.mcap", "--strict"), str(bench.log))
    assert "damaged chunk" in sentence
    assert not (bench.folder / "strict.mcap").exists()


def test_the_topic_is_chosen_among_several(bench: Bench) -> None:
    bench.write(imu_channel(increments(), "/a"), imu_channel(increments(2.0), "/b"))
    one_sentence(convert(bench, "out.mcap"), "2 IMU topics", "--imu-topic", "/a", "/b")
    assert "101 samples" in convert(bench, "out.mcap", "--imu-topic", "/b").out


def test_an_output_is_replaced_only_when_told(bench: Bench) -> None:
    bench.write(imu_channel(increments()))
    out = converted(bench, "out.mcap")
    before = out.read_bytes()
    one_sentence(convert(bench, "out.mcap", "--axes", "FRD"), "exists", "--overwrite")
    assert out.read_bytes() == before
    converted(bench, "out.mcap", "--axes", "FRD", "--overwrite")
    assert out.read_bytes() != before


def test_an_input_is_never_its_own_output(bench: Bench) -> None:
    bench.write(imu_channel(increments()))
    before = bench.log.read_bytes()
    one_sentence(convert(bench, bench.log.name, "--overwrite"), "is the input")
    assert bench.log.read_bytes() == before


REFUSED: dict[str, tuple[Sequence[str], Sequence[str]]] = {
    "no kind": ((*COLUMNS, "--axes", "FRD"), ("--kind", "average")),
    "no axes": ((*COLUMNS, "--kind", "average"), ("--axes", "FRD")),
    "unknown kind": ((*COLUMNS, "--kind", "mean", "--axes", "FRD"), ("'mean'",)),
    "no gyro": (("--time", "t", "--accel", "ax,ay,az", *AVERAGES[6:]), ("gyro", "three")),
    "two columns": (("--time", "t", "--gyro", "gx,gy", *AVERAGES[4:]), ("gyro", "three")),
    "no such column": ((*AVERAGES, "--interval", "dt"), ("'dt'", "line 1", "'gx'")),
    "epoch": ((*AVERAGES, "--epoch", "noon"), ("--epoch", "'noon'")),
    "unit": ((*AVERAGES, "--time-unit", "min"), ("time_unit", "'min'", "ms")),
    "wrong unit of time": ((*AVERAGES, "--time-unit", "ns"), ("line 3", "repeats")),
    "a log's option": ((*AVERAGES, "--imu-topic", "/imu"), ("--imu-topic", "--time")),
    "no time": (("--kind", "average"), ("--time", "--gyro", "--accel")),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_text_file_not_described_well_is_refused(bench: Bench, name: str) -> None:
    options, facts = REFUSED[name]
    outcome = convert(bench, "out.mcap", *options, source=text_of(bench, drive(1.0)))
    one_sentence(outcome, *facts)
    assert sorted(path.name for path in bench.folder.iterdir()) == ["drive.csv"]


def test_an_epoch_gives_relative_times_their_date(bench: Bench) -> None:
    text = bench.folder / "a.txt"
    text.write_text("0.25 1 2 3 4 5 6\n0.5 1 2 3 4 5 6\n")
    columns = ("--time", "1", "--gyro", "2,3,4", "--accel", "5,6,7", "--delimiter", "space")
    said = ("--kind", "rate", "--axes", "FRD", "--epoch", "2026-01-01T00:00:00.000000001Z")
    out = converted(bench, "out.csv", *columns, *said, source=text)
    with out.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [int(row["time_ns"]) for row in rows] == [
        1_767_225_600_250_000_001,
        1_767_225_600_500_000_001,
    ]


def test_a_line_that_is_wrong_is_named_and_leaves_nothing(bench: Bench) -> None:
    text = text_of(bench, drive())
    lines = text.read_text().splitlines()
    lines[700] = lines[700].rpartition(",")[0]
    text.write_text("\n".join(lines))
    outcome = convert(bench, "out.mcap", *AVERAGES, source=text)
    one_sentence(outcome, str(text), "line 701: it has 6 columns, line 1 has 7")
    assert [path.name for path in bench.folder.iterdir()] == ["drive.csv"]


@pytest.mark.parametrize(
    ("options", "output", "facts"),
    [
        (("--gyro", "1,2,3"), "out.mcap", ("text file", "--time")),
        ((), "out.txt", (".mcap", ".csv", ".parquet")),
        (("--topic", "/imu/data_raw"), "out.mcap", (".csv",)),
        (("--kind", "rate"), "out.mcap", ("holds increment or compensated",)),
        (AVERAGES, "out.mcap", ("this is an MCAP log",)),
        (("--start-s", "100"), "out.mcap", ("no sample from 100 s on",)),
        ((), "nowhere/out.mcap", ("folder", "does not exist")),
    ],
)
def test_what_makes_no_sense_for_a_log_is_refused(
    bench: Bench, options: Sequence[str], output: str, facts: Sequence[str]
) -> None:
    bench.write(imu_channel(increments()))
    one_sentence(convert(bench, output, *options), *facts)
    assert [path.name for path in bench.folder.iterdir()] == [bench.log.name]


@pytest.mark.parametrize("options", [(), AVERAGES])
def test_a_missing_input_is_named(bench: Bench, options: Sequence[str]) -> None:
    one_sentence(convert(bench, "out.mcap", *options), str(bench.log))
    assert list(bench.folder.iterdir()) == []


@pytest.mark.parametrize(
    "option",
    [
        *("INPUT", "--output", "--config", "--imu-topic", "--kind", "--axes", "--strict"),
        *("--topic", "--start-s", "--end-s", "--overwrite", "--time", "--time-unit", "--epoch"),
        *("--gyro", "--accel", "--interval", "--interval-unit", "--gyro-unit", "--accel-unit"),
        "--delimiter",
    ],
)
def test_help_names_every_option(option: str) -> None:
    assert f"{option} " in navgrade("convert", "--help").out
