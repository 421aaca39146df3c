"""Columns of an IMU topic as rows of numbers in the order of their time."""

from __future__ import annotations

from collections import Counter as Counts
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from earth.rotation import rotvec_from_quat
from navgrade.errors import LogError, SchemaError
from navgrade.logs.container import Columns
from navgrade.logs.schemas import ImuSchema, Vector
from navgrade.logs.times import Counter, Rows, Sorter

Array = NDArray[np.float64]
Fields = Mapping[str, NDArray[Any]]
Refuse = Callable[[NDArray[np.bool_], Callable[[int], str]], None]


class Part(Protocol):
    """Some of a row's values, read from some members."""

    paths: tuple[str, ...]

    def values(self, fields: Fields, refuse: Refuse) -> Array:
        """Values of each message, shape (n, k); `refuse` takes the bad rows and says why."""


class GyroPart:
    """Angular rate or increment, and the interval's length in s where the messages have it.

    Parameters
    ----------
    schema : ImuSchema
    rate_hz : float or None
        Of the IMU; the interval is then what its samples in a message stand for.
    """

    def __init__(self, schema: ImuSchema, rate_hz: float | None) -> None:
        self._schema = schema
        self._rate_hz = rate_hz
        self._length = schema.interval
        if rate_hz is not None and schema.count is not None:
            self._length = schema.count, rate_hz
        self.paths = _paths(schema.gyro) + ((self._length[0],) if self._length else ())

    def values(self, fields: Fields, refuse: Refuse) -> Array:
        """Rotation and interval, shape (n, 3) or (n, 4)."""
        width = 4 if self._schema.quaternion else 3
        gyro = _vector(fields, self._schema.gyro, width, "angular rate", refuse)
        if self._schema.quaternion:
            refuse(np.all(gyro == 0.0, axis=1), lambda _: "the rotation is a quaternion of zeros")
            gyro = rotvec_from_quat(gyro[:, [3, 0, 1, 2]])
        if self._length:
            return np.column_stack([gyro, _interval(fields, self._length, refuse)])
        if self._rate_hz is not None:
            return np.column_stack([gyro, np.full(len(gyro), 1.0 / self._rate_hz)])
        return gyro


class AccelPart:
    """Specific force or velocity increment, over the interval of the angle."""

    def __init__(self, schema: ImuSchema, met: Counts[str]) -> None:
        self._schema = schema
        self._met = met
        self._lengths: tuple[tuple[str, float], ...] = ()
        if schema.interval and schema.accel_interval:
            self._lengths = (schema.interval, schema.accel_interval)
        self.paths = _paths(schema.accel) + tuple(path for path, _ in self._lengths)

    def values(self, fields: Fields, refuse: Refuse) -> Array:
        """Force, shape (n, 3)."""
        accel = _vector(fields, self._schema.accel, 3, "specific force", refuse)
        if not self._lengths:
            return accel
        angle, velocity = (_interval(fields, length, refuse) for length in self._lengths)
        differs = angle != velocity
        if differs.any():
            (name, _), (other, _) = self._lengths
            scaled = f"had {other} unlike {name}: the velocity was scaled to the angle's interval"
            self._met[scaled] += int(np.count_nonzero(differs))
            accel[differs] *= (angle[differs] / velocity[differs])[:, None]
        return accel


class Feed:
    """Messages of one topic on their way into the order of time, carried across blocks.

    Parameters
    ----------
    file, topic : str
        For errors.
    schema : ImuSchema
    parts : sequence of Part
        Their values stand side by side in a row.
    met : Counter of str
        Takes what was met, and how often.

    Attributes
    ----------
    paths : list of str
        Members to be read.
    sorter : Sorter
    """

    def __init__(
        self, file: str, topic: str, schema: ImuSchema, parts: tuple[Part, ...], met: Counts[str]
    ) -> None:
        self._file = file
        self._topic = topic
        self._schema = schema
        self._parts = parts
        self._met = met
        condition = (schema.condition.path,) if schema.condition else ()
        wanted = [*schema.clock.paths, *condition, *schema.clipping]
        self.paths = list(dict.fromkeys(wanted + [path for part in parts for path in part.paths]))
        self.sorter = Sorter(self.fault)
        self._counter = None if schema.clock.period is None else Counter(schema.clock.period)
        self._count = 0
        self._first_ns = 0

    def push(self, columns: Columns) -> Rows:
        """Take the next messages; return those nothing can come before any more."""
        try:
            return self.sorter.push(self._rows(columns))
        except SchemaError as error:
            raise SchemaError(str(error), file=self._file, topic=self._topic) from None

    def _rows(self, columns: Columns) -> Rows:
        fields: Fields = columns.fields
        time_ns = self._schema.clock.times_ns(fields)
        if self._counter:
            time_ns = self._counter.unwrapped(time_ns, columns.log_time_ns)
        if not self._count:
            self._first_ns = int(time_ns[0])
        number = np.arange(self._count, self._count + len(columns))
        self._count += len(columns)
        none = np.empty((len(columns), 0))
        rows = Rows(number, columns.log_time_ns, time_ns, none, np.zeros_like(number))
        if self._schema.condition:
            keep = self._schema.condition.holds(fields[self._schema.condition.path])
            if not keep.all():
                left = f"without {self._schema.condition.text} were left out"
                self._met[left] += int(np.count_nonzero(~keep))
                rows = rows[keep]
                fields = {path: column[keep] for path, column in fields.items()}
        for path in self._schema.clipping:
            if clipped := int(np.count_nonzero(fields[path])):
                self._met[f"say that a sensor was out of its range ({path})"] += clipped

        def refuse(bad: NDArray[np.bool_], why: Callable[[int], str]) -> None:
            if bad.any():
                first = int(np.argmax(bad))
                raise self.error(why(first), rows, first)

        return replace(rows, values=np.hstack([p.values(fields, refuse) for p in self._parts]))

    def fault(self, text: str, rows: Rows, index: int) -> LogError:
        """The error for the time of a message."""
        return self.error(
            f"the {self._schema.clock.title} {text}; repair the stamps first, `navgrade inspect "
            "--deep` counts them",
            rows,
            index,
        )

    def error(self, text: str, rows: Rows, index: int) -> LogError:
        """An error that names a message and its time."""
        number = int(rows.number[index])
        seconds = (int(rows.time_ns[index]) - self._first_ns) * 1e-9
        return LogError(
            f"message {number}, {seconds:.6f} s after the first: {text}",
            index=number,
            time_s=seconds,
            file=self._file,
            topic=self._topic,
        )


def _paths(vector: Vector) -> tuple[str, ...]:
    return (vector,) if isinstance(vector, str) else vector


def _numbers(fields: Fields, paths: tuple[str, ...], width: int) -> NDArray[Any]:
    """The members side by side, shape (n, width), as whole numbers where all are."""
    values = np.column_stack([fields[path] for path in paths])
    if values.dtype.kind not in "if" or values.shape[1] != width:
        wanted = "a number" if width == 1 else f"a vector of {width} numbers"
        raise SchemaError(f"{', '.join(paths)} is not {wanted}")
    return values


def _vector(fields: Fields, vector: Vector, width: int, what: str, refuse: Refuse) -> Array:
    values = _numbers(fields, _paths(vector), width).astype(np.float64)
    with np.errstate(invalid="ignore"):  # infinities of both signs
        finite = np.isfinite(values.sum())
    if not finite:
        refuse(
            np.any(~np.isfinite(values), axis=1), lambda k: f"the {what} is {values[k]}, not finite"
        )
    return values


def _interval(fields: Fields, length: tuple[str, float], refuse: Refuse) -> Array:
    """Lengths of intervals, s."""
    path, per_second = length
    column = _numbers(fields, (path,), 1)[:, 0]
    refuse(~np.isfinite(column), lambda k: f"the interval {path} is {column[k]}, not finite")
    refuse(~(column > 0), lambda k: f"the interval {path} is {column[k]}, not positive")
    lengths: Array = column / per_second
    return lengths
