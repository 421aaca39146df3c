"""IMU samples in text files: a line for each sample, columns named by a header or numbered."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from decimal import Context, Decimal
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from earth.frames import C_bs
from navgrade.errors import ConfigError, LogError
from navgrade.imu import KIND_HELP, KINDS, ImuSamples, Kind, intervals, nominal_interval
from navgrade.logs.imu_log import ACCEL_UNITS, GYRO_UNITS

TIME_UNITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}  # powers of ten to nanoseconds
DELIMITERS: dict[str, str | None] = {"tab": "\t", "space": None}  # None: any run of blanks
_BLOCK = 16_384  # lines
_END_NS = (1 << 31) * 1_000_000_000  # the stamp of a message has 31 bits of seconds
_EXACT = Context(prec=60)
Array = NDArray[np.float64]


@dataclass(frozen=True)
class SampleTable:
    """A text file of IMU samples and what its columns hold.

    A column is given by its name in the first line or by its number, from 1. When all are given
    by number, a first line without a single number in it is taken for a header and left out.

    Attributes
    ----------
    path : Path
    time : str
        Column of the stamps, which must increase.
    gyro, accel : tuple of str
        Columns of x, y and z: angular rate and specific force, or their integrals.
    kind : {"rate", "average", "increment", "compensated"}
    axes : str
        Where x, y and z point, see `earth.C_bs`.
    time_unit : {"s", "ms", "us", "ns"}
    interval : str or None
        Column of the length of each interval; without one the stamps give it.
    interval_unit : {"s", "ms", "us", "ns"}, optional
        That of the time by default.
    gyro_unit : {"rad/s", "deg/s"}
    accel_unit : {"m/s^2", "g"}
        Of the rates, or of the rates whose integrals the increments are.
    epoch_ns : int
        Unix time of the table's time 0, ns.
    delimiter : str
        One character, ``"tab"``, or ``"space"`` for any run of blanks.

    Raises
    ------
    ConfigError
        On an unknown kind, unit, delimiter or axes, or when a vector has not three columns.
    """

    path: Path
    time: str
    gyro: tuple[str, ...]
    accel: tuple[str, ...]
    kind: Kind
    axes: str
    time_unit: str = "s"
    interval: str | None = None
    interval_unit: str | None = None
    gyro_unit: str = "rad/s"
    accel_unit: str = "m/s^2"
    epoch_ns: int = 0
    delimiter: str = ","

    def __post_init__(self) -> None:
        for name in ("gyro", "accel"):
            columns = getattr(self, name)
            if len(columns) != 3:
                raise ConfigError(
                    f"{name} needs three columns, x,y,z; got {','.join(columns) or 'none'}"
                )
        if self.kind not in KINDS:
            raise ConfigError(f"kind {self.kind!r} is not known; it is {KIND_HELP}")
        for name, known in (
            ("time_unit", TIME_UNITS),
            ("interval_unit", (None, *TIME_UNITS)),
            ("gyro_unit", GYRO_UNITS),
            ("accel_unit", ACCEL_UNITS),
        ):
            if getattr(self, name) not in known:
                raise ConfigError(
                    f"{name} {getattr(self, name)!r} is not one of {', '.join(filter(None, known))}"
                )
        if self.delimiter not in DELIMITERS and len(self.delimiter) != 1:
            raise ConfigError(
                f"delimiter {self.delimiter!r} is not one character, nor {' or '.join(DELIMITERS)}"
            )
        try:
            C_bs(self.axes)
        except ValueError as error:
            raise ConfigError(str(error)) from None

    def blocks(self, progress: Callable[[int], None] | None = None) -> Iterator[ImuSamples]:
        """Yield consecutive samples in body axes; memory does not grow with the file.

        Parameters
        ----------
        progress : callable, optional
            Called with the number of bytes of the file read so far.

        Raises
        ------
        ConfigError
            On a column the file does not have.
        LogError
            Naming the line: when it has not as many cells as the first one, a cell is no finite
            number, time does not increase, or an interval is not positive.
        """
        from_gyro = C_bs(self.axes).T * GYRO_UNITS[self.gyro_unit]
        from_accel = C_bs(self.axes).T * ACCEL_UNITS[self.accel_unit]
        epoch_ns = last_ns = None
        nominal = 0.0
        for lines in self._lines(progress):
            stamp_ns = self._stamps_ns(lines, last_ns)
            epoch_ns = int(stamp_ns[0]) if epoch_ns is None else epoch_ns
            t = (stamp_ns - epoch_ns).astype(np.float64) * 1e-9
            if self.interval is not None:
                dt = self._intervals(lines, self.interval)
            elif last_ns is not None:
                dt = intervals(t, (last_ns - epoch_ns) * 1e-9, nominal)
            elif len(t) > 1:
                nominal = nominal_interval(np.diff(t))
                dt = intervals(t, None, nominal)
            else:
                raise LogError("one sample is not a log", file=str(self.path))
            last_ns = int(stamp_ns[-1])
            yield ImuSamples(
                t=t,
                dt=dt,
                gyro=lines.numbers(self.gyro) @ from_gyro,
                accel=lines.numbers(self.accel) @ from_accel,
                kind=self.kind,
                epoch_ns=epoch_ns,
            )
        if epoch_ns is None:
            raise LogError("it holds no samples", file=str(self.path))

    def _lines(self, progress: Callable[[int], None] | None) -> Iterator[_Lines]:
        with (
            self.path.open("rb") as raw,
            io.TextIOWrapper(raw, encoding="utf-8-sig", errors="replace") as stream,
        ):
            if raw.peek(5).startswith(b"\x89MCAP"):
                raise LogError("this is an MCAP log, no text file", file=str(self.path))
            first = stream.readline()
            layout = _Layout(self, first)
            ahead, number = ([], 2) if layout.has_header else ([first], 1)
            while texts := [*ahead, *islice(stream, _BLOCK)]:
                if not all(map(str.isspace, texts)):
                    yield _Lines(layout, texts, number)
                if progress:
                    progress(raw.tell())
                number += len(texts)
                ahead = []

    def _stamps_ns(self, lines: _Lines, last_ns: int | None) -> NDArray[np.int64]:
        """Stamps to the nanosecond: a double would hold them to 240 ns."""
        texts = lines.texts(self.time)
        shift = TIME_UNITS[self.time_unit]
        try:
            whole = [round(_EXACT.scaleb(Decimal(text), shift)) + self.epoch_ns for text in texts]
        except (ArithmeticError, ValueError):
            row = next(k for k, text in enumerate(texts) if not _is_finite(text))
            raise lines.error(row, f"the time {texts[row]!r} is not a number") from None
        for extreme in (min(whole), max(whole)):
            if not 0 <= extreme < _END_NS:
                row = whole.index(extreme)
                raise lines.error(
                    row,
                    f"the time {texts[row]} does not lie between 1970 and 2038, as the stamp of a "
                    "message must; check its unit and its epoch",
                )
        stamp_ns = np.array(whole, np.int64)
        steps = np.diff(stamp_ns, prepend=stamp_ns[0] - 1 if last_ns is None else last_ns)
        if steps.min() <= 0:
            row = int(np.argmax(steps <= 0))
            what = "repeats" if steps[row] == 0 else f"steps back by {-steps[row] * 1e-9:.9f} s"
            raise lines.error(row, f"the time {texts[row]} {what}; sort or repair the lines first")
        return stamp_ns

    def _intervals(self, lines: _Lines, column: str) -> Array:
        shift = TIME_UNITS[self.interval_unit or self.time_unit]
        dt: Array = lines.numbers((column,))[:, 0] / 10.0 ** (9 - shift)
        if not dt.min() > 0.0:
            raise lines.error(int(np.argmin(dt)), f"the interval is {dt.min()!r} s, not positive")
        return dt


def _is_finite(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text)))
    except ValueError:
        return False


def _cells(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]


class _Layout:
    """Where in a line the wanted columns stand."""

    def __init__(self, table: SampleTable, first: str) -> None:
        self.file = str(table.path)
        if not first:
            raise LogError("the file is empty", file=self.file)
        self.delimiter = DELIMITERS.get(table.delimiter, table.delimiter)
        cells = _cells(first, self.delimiter)
        self.width = len(cells)
        self.has_header = not any(map(_is_finite, cells))
        wanted = [table.time, *table.gyro, *table.accel]
        if table.interval is not None:
            wanted.append(table.interval)
        self.places = {column: self._place(column, cells) for column in wanted}
        if len(set(self.places.values())) < len(wanted):
            raise ConfigError(
                f"{len(wanted)} columns are needed, but {', '.join(wanted)} name one twice",
                file=self.file,
            )
        kinds = dict.fromkeys(range(self.width), "S1") | dict.fromkeys(self.places.values(), "f8")
        kinds[self.places[table.time]] = "U64"
        self.dtype = np.dtype([(str(place), kind) for place, kind in kinds.items()])

    def _place(self, column: str, cells: list[str]) -> int:
        if column.isdecimal():
            if not 1 <= int(column) <= self.width:
                raise ConfigError(
                    f"there is no column {column}, line 1 has {self.width}; columns count from 1 "
                    "and --delimiter separates them",
                    file=self.file,
                )
            return int(column) - 1
        if not self.has_header:
            raise ConfigError(
                f"line 1 holds numbers and no name {column!r}; give the columns by number, from 1",
                file=self.file,
            )
        if cells.count(column) != 1:
            what = "occurs more than once" if column in cells else "is not in line 1"
            raise ConfigError(
                f"column {column!r} {what}, which holds {', '.join(map(repr, cells))}",
                file=self.file,
            )
        return cells.index(column)


class _Lines:
    """A block of lines, as columns."""

    def __init__(self, layout: _Layout, texts: list[str], first: int) -> None:
        self._layout = layout
        self._numbers: Sequence[int] = range(first, first + len(texts))
        if any(map(str.isspace, texts)):
            held = [k for k, text in enumerate(texts) if not text.isspace()]
            self._numbers = [first + k for k in held]
            texts = [texts[k] for k in held]
        try:
            self._rows = np.loadtxt(
                texts,
                layout.dtype,
                delimiter=layout.delimiter,
                comments=None,
                quotechar='"',
                ndmin=1,
            )
        except ValueError as error:
            raise self._fault(texts, str(error)) from None
        if len(self._rows) != len(texts):
            raise self._fault(texts, "a cell goes on in the next line")

    def error(self, row: int, text: str) -> LogError:
        return LogError(f"line {self._numbers[row]}: {text}", file=self._layout.file)

    def texts(self, column: str) -> list[str]:
        found: list[str] = self._rows[str(self._layout.places[column])].tolist()
        return found

    def numbers(self, columns: tuple[str, ...]) -> Array:
        """Columns side by side, (n, m); every number finite."""
        values = np.stack([self._rows[str(self._layout.places[name])] for name in columns], axis=1)
        finite = np.isfinite(values)
        if not finite.all():
            row, k = (int(i) for i in np.argwhere(~finite)[0])
            raise self.error(row, f"column {columns[k]} is {values[row, k]}, not a finite number")
        return values

    def _fault(self, texts: list[str], told: str) -> LogError:
        """What makes these lines unreadable, found by a second and slower look."""
        layout = self._layout
        for row, text in enumerate(texts):
            if text.count('"') % 2:
                return self.error(row, "a quotation mark is not closed")
            cells = _cells(text, layout.delimiter)
            if len(cells) != layout.width:
                return self.error(row, f"it has {len(cells)} columns, line 1 has {layout.width}")
            for name, place in layout.places.items():
                if not _is_finite(cells[place]):
                    return self.error(row, f"column {name} is {cells[place]!r}, not a number")
        return LogError(
            f"lines {self._numbers[0]} to {self._numbers[-1]}: {told}", file=layout.file
        )
