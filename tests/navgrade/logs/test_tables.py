"""Text files of samples: every digit is kept, and what cannot be right is named by its line."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from navgrade.errors import ConfigError, LogError
from navgrade.imu import ImuSamples, concatenate
from navgrade.logs.tables import SampleTable

HEADER = ("t", "gx", "gy", "gz", "ax", "ay", "az")
NUMBERS = {"time": "1", "gyro": ("2", "3", "4"), "accel": ("5", "6", "7")}
NAMES = {"time": "t", "gyro": ("gx", "gy", "gz"), "accel": ("ax", "ay", "az")}
FIRST_NS = 1_700_000_000_123_456_789
STEP_NS = 9_999_991  # a prime: no stamp is round


def rows_of(count: int, seed: int = 1) -> list[list[str]]:
    """Exact times in s and six numbers with all their digits."""
    values = np.random.default_rng(seed).standard_normal((count, 6))
    stamp_ns = [FIRST_NS + k * STEP_NS for k in range(count)]
    return [
        [f"{ns // 10**9}.{ns % 10**9:09d}", *map(repr, row)]
        for ns, row in zip(stamp_ns, values.tolist(), strict=True)
    ]


def text_of(rows: Iterable[Sequence[str]], delimiter: str = ",") -> str:
    """The rows as the csv module writes them."""
    stream = io.StringIO()
    csv.writer(stream, delimiter=delimiter).writerows(rows)
    return stream.getvalue()


def write(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


def table(path: Path, **given: Any) -> SampleTable:
    return SampleTable(path, **{**NAMES, "kind": "average", "axes": "FRD", **given})


def read(path: Path, **given: Any) -> ImuSamples:
    return concatenate(list(table(path, **given).blocks()))


def stamps_of(imu: ImuSamples) -> np.ndarray:
    return imu.epoch_ns + np.rint(imu.t * 1e9).astype(np.int64)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "samples.csv"


@pytest.mark.parametrize("count", [2, 5000, 40_000])
def test_every_digit_of_values_and_nanosecond_of_time_is_kept(path: Path, count: int) -> None:
    """Also across the blocks a long file is read in."""
    rows = rows_of(count)
    imu = read(write(path, text_of([HEADER, *rows])))
    values = np.array([[float(cell) for cell in row[1:]] for row in rows])
    assert imu.gyro.tobytes() == values[:, :3].tobytes()
    assert imu.accel.tobytes() == values[:, 3:].tobytes()
    assert np.array_equal(stamps_of(imu), FIRST_NS + STEP_NS * np.arange(count))


TIMES = {
    "s": "1700000000.123456789",
    "ms": "1700000000123.456789",
    "us": "1700000000123456.789",
    "ns": "1700000000123456789",
}


@pytest.mark.parametrize("unit", TIMES)
def test_a_time_is_exact_in_every_unit(path: Path, unit: str) -> None:
    later = str(int(TIMES[unit].split(".")[0]) + 1)
    rows = [[TIMES[unit], *"123456"], [later, *"123456"]]
    assert read(write(path, text_of([HEADER, *rows])), time_unit=unit).epoch_ns == FIRST_NS


@pytest.mark.parametrize(
    ("text", "ns"),
    [
        ("5.0000000004", 5_000_000_000),  # rounded to the nearest, not cut
        ("5.0000000006", 5_000_000_001),
        ("5e-1", 500_000_000),
        (" 7 ", 7_000_000_000),
    ],
)
def test_other_spellings_of_a_time(path: Path, text: str, ns: int) -> None:
    imu = read(write(path, text_of([HEADER, [text, *"123456"], ["8", *"123456"]])))
    assert imu.epoch_ns == ns


def test_the_epoch_is_added_to_the_nanosecond(path: Path) -> None:
    rows = [["0.1", *"123456"], ["0.2", *"123456"]]
    imu = read(write(path, text_of([HEADER, *rows])), epoch_ns=FIRST_NS)
    assert imu.epoch_ns == FIRST_NS + 100_000_000


SPELLINGS = {
    "comma": (",", ",", NAMES),
    "semicolon": (";", ";", NAMES),
    "tab": ("\t", "tab", NAMES),
    "blank": (" ", "space", NAMES),
    "numbered columns under a header": (",", ",", NUMBERS),
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_delimiters_and_ways_to_name_a_column(path: Path, name: str) -> None:
    character, delimiter, columns = SPELLINGS[name]
    rows = rows_of(20)
    write(path, text_of([HEADER, *rows], character))
    imu = read(path, delimiter=delimiter, **columns)
    assert imu.gyro[7].tolist() == [float(cell) for cell in rows[7][1:4]]
    assert len(imu) == 20


def test_a_file_without_a_header_is_read_from_its_first_line(path: Path) -> None:
    imu = read(write(path, text_of(rows_of(5))), **NUMBERS)
    assert len(imu) == 5
    assert imu.epoch_ns == FIRST_NS


def test_runs_of_blanks_around_numbers(path: Path) -> None:
    lines = ["   ".join(["", *row, ""]) for row in rows_of(3)]
    assert len(read(write(path, "\n".join(lines)), delimiter="space", **NUMBERS)) == 3


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_blank_lines_quotes_and_a_mark_of_utf8_are_no_matter(path: Path, end: str) -> None:
    rows = rows_of(4)
    quoted = [",".join(f'"{cell}"' for cell in row) for row in rows]
    text = end.join(["t,gx,gy,gz,ax,ay,az", *quoted[:2], "", " ", *quoted[2:], "", ""])
    imu = read(write(path, b"\xef\xbb\xbf" + text.encode()))
    assert imu.accel[3].tolist() == [float(cell) for cell in rows[3][4:]]
    assert len(imu) == 4


def test_columns_of_no_interest_may_hold_anything(path: Path) -> None:
    rows = [["ok, fine", *row, "", "n/a"] for row in rows_of(3)]
    imu = read(write(path, text_of([("note", *HEADER, "u", "v"), *rows])))
    assert len(imu) == 3


def test_units_and_axes_are_turned_into_ours(path: Path) -> None:
    """180 deg/s are pi rad/s; standard gravity is 9.80665 m/s^2; DFR to FRD is a rotation."""
    rows = [["0", "180", "0", "0", "0", "0", "1"], ["1", "180", "0", "0", "0", "0", "1"]]
    imu = read(write(path, text_of([HEADER, *rows])), gyro_unit="deg/s", accel_unit="g", axes="DFR")
    np.testing.assert_allclose(imu.gyro[0], [0.0, 0.0, np.pi], rtol=1e-15, atol=0.0)
    np.testing.assert_allclose(imu.accel[0], [0.0, 9.80665, 0.0], rtol=1e-15, atol=0.0)


def test_an_interval_is_read_in_its_unit(path: Path) -> None:
    rows = [[*row, "2.5"] for row in rows_of(3)]
    write(path, text_of([(*HEADER, "dt"), *rows]))
    imu = read(path, kind="increment", interval="dt", interval_unit="ms")
    assert imu.dt.tolist() == [0.0025] * 3


def test_without_an_interval_the_stamps_give_it_except_after_a_gap(path: Path) -> None:
    """Also where a block ends: the nominal interval is that of the file's beginning."""
    count = 40_000
    rows = rows_of(count)
    del rows[20_000:20_007]
    imu = read(write(path, text_of([HEADER, *rows])))
    ns = [int(Fraction(row[0]) * 10**9) - FIRST_NS for row in rows]
    assert np.diff(ns)[19_999] == 8 * STEP_NS
    steps = np.full(len(rows), STEP_NS * 1e-9)
    # differences of doubles up to 400 s: 2 ulp
    np.testing.assert_allclose(imu.dt, steps, rtol=0.0, atol=2 * np.spacing(400.0))


def cell(rows: list[list[str]], row: int, column: int, text: str) -> list[list[str]]:
    rows[row][column] = text
    return rows


FAULTS = {
    "not a number": (lambda rows: cell(rows, 4, 2, "x"), "line 6: column gy is 'x', not a number"),
    "empty": (lambda rows: cell(rows, 4, 5, ""), "line 6: column ay is '', not a number"),
    "nan": (lambda rows: cell(rows, 4, 6, "nan"), "line 6: column az is nan"),
    "infinite": (lambda rows: cell(rows, 4, 1, "-inf"), "line 6: column gx is -inf"),
    "time": (lambda rows: cell(rows, 4, 0, "noon"), "line 6: the time 'noon' is not a number"),
    "time nan": (lambda rows: cell(rows, 4, 0, "nan"), "line 6: the time 'nan' is not a number"),
    "short": (lambda rows: [*rows[:4], rows[4][:5], *rows[5:]], "line 6: it has 5 columns"),
    "long": (lambda rows: [*rows[:4], [*rows[4], "1"], *rows[5:]], "line 6: it has 8 columns"),
    "repeated": (lambda rows: [*rows[:4], *rows[3:]], "line 6: the time 1700000000.15.* repeats"),
    "backward": (
        lambda rows: [*rows[:5], rows[3], *rows[5:]],
        "line 7: the time .* steps back by 0.009999991 s",
    ),
    "before 1970": (lambda rows: cell(rows, 0, 0, "-1"), "line 2: the time -1 does not lie"),
    "after 2038": (lambda rows: cell(rows, 9, 0, "2147483648"), "line 11: .*2038"),
    "decimal comma": (lambda rows: cell(rows, 4, 2, "1,5"), "line 6: column gy is '1,5'"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_named_by_its_line(path: Path, name: str) -> None:
    damage, told = FAULTS[name]
    write(path, text_of([HEADER, *damage(rows_of(10))]))
    with pytest.raises(LogError, match=told) as caught:
        read(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize("closed", [True, False])
def test_a_quotation_that_goes_on_in_the_next_line_swallows_nothing(
    path: Path, closed: bool
) -> None:
    """In a column of no interest, where it would hide a whole line."""
    lines = text_of([(*HEADER, "note"), *([*row, "ok"] for row in rows_of(9))]).splitlines()
    lines[4] = lines[4].replace("ok", '"not')
    if closed:
        lines[5] = lines[5].replace("ok", 'so"')
    with pytest.raises(LogError, match="line 5: a quotation mark is not closed"):
        read(write(path, "\n".join(lines)))


def test_a_fault_far_down_and_below_blank_lines_is_named_by_its_line(path: Path) -> None:
    lines = text_of([HEADER, *rows_of(30_000)]).splitlines()
    lines[100:100] = ["", " "]
    lines[300] = f"{lines[300]},"
    with pytest.raises(LogError, match="line 301: it has 8 columns"):
        read(write(path, "\n".join(lines)))
    lines[300] = lines[300][:-1]
    lines[25_000] = lines[25_000].replace(",", ",?", 1)
    with pytest.raises(LogError, match="line 25001: column gx"):
        read(write(path, "\n".join(lines)))
    lines[25_000] = lines[24_999]
    with pytest.raises(LogError, match=r"line 25001: .* repeats"):
        read(write(path, "\n".join(lines)))


def test_time_is_watched_across_blocks(path: Path) -> None:
    """Every line of a long file in turn may be the first of a block."""
    rows = rows_of(20_000)
    for row in (16_383, 16_384, 16_385):
        repeated = [*rows[:row], rows[row - 1], *rows[row:]]
        with pytest.raises(LogError, match=rf"line {row + 1}: .* repeats"):
            read(write(path, text_of(repeated)), **NUMBERS)


@pytest.mark.parametrize("interval", ["0", "-0.01"])
def test_an_interval_that_is_not_positive_is_named(path: Path, interval: str) -> None:
    rows = [[*row, "0.01"] for row in rows_of(5)]
    rows[2][7] = interval
    write(path, text_of([(*HEADER, "dt"), *rows]))
    with pytest.raises(LogError, match=r"line 4: the interval is .* not positive"):
        read(path, kind="increment", interval="dt")


COLUMNS = {
    "no such name": ({"time": "time"}, "column 'time' is not in line 1, which holds 't', 'gx'"),
    "no such number": ({"time": "9"}, "no column 9, line 1 has 7"),
    "number 0": ({"time": "0"}, "no column 0"),
    "twice": ({"time": "gx"}, "name one twice"),
    "two of three": ({"gyro": ("gx", "gy")}, "gyro needs three columns"),
    "unit": ({"time_unit": "min"}, "time_unit 'min' is not one of s, ms, us, ns"),
    "gyro unit": ({"gyro_unit": "rpm"}, "gyro_unit 'rpm'"),
    "kind": ({"kind": "mean"}, "kind 'mean' is not known"),
    "axes": ({"axes": "XYZ"}, "XYZ"),
    "delimiter": ({"delimiter": "::"}, "delimiter '::'"),
}


@pytest.mark.parametrize("name", COLUMNS)
def test_a_wrong_description_is_refused(path: Path, name: str) -> None:
    given, told = COLUMNS[name]
    write(path, text_of([HEADER, *rows_of(3)]))
    with pytest.raises(ConfigError, match=told):
        read(path, **given)


def test_names_for_a_file_without_names_are_refused(path: Path) -> None:
    with pytest.raises(ConfigError, match="line 1 holds numbers and no name 't'"):
        read(write(path, text_of(rows_of(3))))


def test_a_name_that_occurs_twice_is_refused(path: Path) -> None:
    write(path, text_of([("t", "gx", "gy", "gz", "ax", "ay", "az", "t"), [*"12345678"]]))
    with pytest.raises(ConfigError, match="'t' occurs more than once"):
        read(path)


@pytest.mark.parametrize(
    ("text", "told"),
    [("", "the file is empty"), ("t,gx,gy,gz,ax,ay,az\n\n", "it holds no samples")],
)
def test_a_file_without_samples_is_refused(path: Path, text: str, told: str) -> None:
    with pytest.raises(LogError, match=told):
        read(write(path, text))


def test_one_sample_has_no_interval(path: Path) -> None:
    with pytest.raises(LogError, match="one sample is not a log"):
        read(write(path, text_of([HEADER, *rows_of(1)])))


def test_bytes_that_are_no_text_are_refused_by_line(path: Path) -> None:
    write(path, text_of([HEADER, *rows_of(3)]).encode() + bytes(4096))
    with pytest.raises(LogError, match="line 5"):
        read(path)
