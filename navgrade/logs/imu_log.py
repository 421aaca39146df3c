"""An IMU topic of a log as blocks of samples in body axes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from earth.frames import C_bs
from earth.units import DEG_PER_S, STANDARD_GRAVITY
from navgrade.errors import ConfigError, LogError, SchemaError
from navgrade.imu import (
    KIND_HELP,
    KINDS,
    DvFrame,
    ImuSamples,
    Kind,
    concatenate,
    intervals,
    nominal_interval,
)
from navgrade.logs.container import Issue, McapFile, RawMessages
from navgrade.logs.records import STAMP, records, stamps_ns
from navgrade.logs.schemas import ImuSchema
from navgrade.logs.topics import choose_imu

DEFAULT_AXES = "FLU"  # REP-103
GYRO_UNITS = {"rad/s": 1.0, "deg/s": DEG_PER_S}
ACCEL_UNITS = {"m/s^2": 1.0, "g": STANDARD_GRAVITY}
_BLOCK = 16_384  # samples collected before a block is handed on
Array = NDArray[np.float64]


@dataclass
class ImuLog:
    """An IMU topic, opened; `blocks` reads it from the start each time it is called.

    Attributes
    ----------
    path : Path
    topic : str
    schema : ImuSchema
    kind : str
    axes : str
        Of the sensor; samples come out forward-right-down.
    strict : bool
        Refuse a damaged file instead of using what it still holds.
    gyro_unit, accel_unit : str
        Of the recorded rates, or of the rate whose integral increments are.
    dv_frame : {"start", "end"}
        Of compensated velocity increments.
    issues : list of Issue
        Defects of the file met by the last reading.
    """

    path: Path
    topic: str
    schema: ImuSchema
    kind: Kind
    axes: str
    strict: bool = False
    gyro_unit: str = "rad/s"
    accel_unit: str = "m/s^2"
    dv_frame: DvFrame = "start"
    issues: list[Issue] = field(default_factory=list)

    def blocks(self, progress: Callable[[int], None] | None = None) -> Iterator[ImuSamples]:
        """Yield consecutive samples; memory does not grow with the log.

        Raises
        ------
        LogError
            On a value that is not finite, time that repeats or runs backwards, or no message.
        """
        file = McapFile(self.path, strict=self.strict)
        self.issues = file.issues
        raw = (
            self._columns(file, run)
            for run in file.runs(lambda channel: channel.topic == self.topic, progress=progress)
        )
        assembler = _Assembler(self)
        yield from assembler.blocks(raw)

    def _columns(self, file: McapFile, run: RawMessages) -> _Columns:
        try:
            return self._decoded(file, run)
        except (SchemaError, UnicodeDecodeError) as error:
            raise SchemaError(str(error), file=str(self.path), topic=self.topic) from None

    def _decoded(self, file: McapFile, run: RawMessages) -> _Columns:
        count = len(run.sizes)
        out = _Columns(
            np.empty(count, np.int64), np.empty((count, 3)), np.empty((count, 3)), np.empty(count)
        )
        needed = [*STAMP, *self.schema.gyro, *self.schema.accel]
        if self.schema.interval:
            needed.append(self.schema.interval)
        for at, found in records(file, run, needed):
            out.stamp_ns[at] = stamps_ns(found)
            for i in range(3):
                out.gyro[at, i] = found[self.schema.gyro[i]]
                out.accel[at, i] = found[self.schema.accel[i]]
            if self.schema.interval:
                out.interval[at] = found[self.schema.interval]
        return out


@dataclass(frozen=True, eq=False)
class _Columns:
    stamp_ns: NDArray[np.int64]
    gyro: Array
    accel: Array
    interval: Array

    def __len__(self) -> int:
        return len(self.stamp_ns)


class _Assembler:
    """Turns columns as recorded into valid samples, carrying what crosses their boundaries."""

    def __init__(self, log: ImuLog) -> None:
        self.log = log
        self.from_gyro = C_bs(log.axes).T * GYRO_UNITS[log.gyro_unit]
        self.from_accel = C_bs(log.axes).T * ACCEL_UNITS[log.accel_unit]
        self.rows = 0
        self.last_ns: int | None = None
        self.epoch_ns = 0
        self.nominal = 0.0

    def blocks(self, raw: Iterator[_Columns]) -> Iterator[ImuSamples]:
        held: list[_Columns] = []
        for columns in raw:
            held.append(columns)
            if sum(map(len, held)) >= _BLOCK:
                yield self._samples(held)
                held = []
        if sum(map(len, held)):
            yield self._samples(held)
        if not self.rows:
            raise LogError(
                "no message of it is in the log", file=str(self.log.path), topic=self.log.topic
            )

    def _samples(self, parts: list[_Columns]) -> ImuSamples:
        stamp_ns = np.concatenate([p.stamp_ns for p in parts])
        gyro = np.concatenate([p.gyro for p in parts])
        accel = np.concatenate([p.accel for p in parts])
        self._check_time(stamp_ns)
        self._check_finite(stamp_ns, "angular rate", gyro)
        self._check_finite(stamp_ns, "specific force", accel)
        if self.last_ns is None:
            self.epoch_ns = int(stamp_ns[0])
        t = (stamp_ns - self.epoch_ns) * 1e-9
        last = None if self.last_ns is None else (self.last_ns - self.epoch_ns) * 1e-9
        if self.log.schema.interval:
            dt = np.concatenate([p.interval for p in parts])
            self._check_finite(stamp_ns, "interval", dt)
            if not dt.min() > 0.0:
                bad = int(np.argmin(dt > 0.0))
                raise self._error(f"interval_s is {dt[bad]!r}, not positive", stamp_ns, bad)
        else:
            if last is None:
                if len(t) < 2:
                    raise LogError(
                        "one message is not a log", file=str(self.log.path), topic=self.log.topic
                    )
                self.nominal = nominal_interval(np.diff(t))
            dt = intervals(t, last, self.nominal)
        self.rows += len(t)
        self.last_ns = int(stamp_ns[-1])
        return ImuSamples(
            t=t,
            dt=dt,
            gyro=gyro @ self.from_gyro,
            accel=accel @ self.from_accel,
            kind=self.log.kind,
            epoch_ns=self.epoch_ns,
            dv_frame=self.log.dv_frame,
        )

    def _error(self, text: str, stamp_ns: NDArray[np.int64], index: int) -> LogError:
        epoch = self.epoch_ns if self.last_ns is not None else int(stamp_ns[0])
        seconds = (int(stamp_ns[index]) - epoch) * 1e-9
        return LogError(
            f"message {self.rows + index}, {seconds:.6f} s after the first: {text}",
            index=self.rows + index,
            time_s=seconds,
            file=str(self.log.path),
            topic=self.log.topic,
        )

    def _check_time(self, stamp_ns: NDArray[np.int64]) -> None:
        before = stamp_ns[:1] - 1 if self.last_ns is None else np.array([self.last_ns])
        step = np.diff(stamp_ns, prepend=before)
        if step.min() > 0:
            return
        bad = int(np.argmax(step <= 0))
        what = "repeats" if step[bad] == 0 else f"steps back by {-step[bad] * 1e-9:.6f} s"
        raise self._error(
            f"the header stamp {what}; repair the stamps first, `navgrade inspect` counts them",
            stamp_ns,
            bad,
        )

    def _check_finite(self, stamp_ns: NDArray[np.int64], what: str, values: Array) -> None:
        if np.isfinite(values.sum()):
            return
        good = np.isfinite(values).reshape(len(values), -1).all(axis=1)
        if not good.all():
            bad = int(np.argmin(good))
            raise self._error(f"the {what} is {values[bad]}, not finite", stamp_ns, bad)


def open_imu(
    path: str | Path,
    topic: str | None = None,
    kind: str | None = None,
    axes: str | None = None,
    *,
    strict: bool = False,
    gyro_unit: str = "rad/s",
    accel_unit: str = "m/s^2",
    dv_frame: DvFrame = "start",
) -> ImuLog:
    """Open an IMU topic of an MCAP log.

    Parameters
    ----------
    path : path
    topic : str, optional
        May be left out when the log has one IMU topic.
    kind : {"rate", "average", "increment", "compensated"}, optional
        What the numbers are; required unless the schema says it.
    axes : str, optional
        Where the sensor's x, y, z point, see `earth.C_bs`; FLU, the ROS convention, by default.
    strict : bool
        Refuse a damaged file.
    gyro_unit : {"rad/s", "deg/s"}
    accel_unit : {"m/s^2", "g"}
    dv_frame : {"start", "end"}
        Of compensated velocity increments: resolved in b at the start or the end of the interval.

    Raises
    ------
    LogError, SchemaError
        When the log or the topic cannot be read.
    ConfigError
        When `kind` is missing, unknown or not what the schema can hold, or `axes` is wrong.
    """
    path = Path(path)
    topic, schema = choose_imu(path, topic)
    if kind is None:
        kind = schema.default_kind
    if kind is None:
        raise ConfigError(
            f"{schema.name} does not say what its numbers are; set --kind (or imu.kind) to "
            f"{KIND_HELP}",
            key="imu.kind",
        )
    if kind not in KINDS:
        raise ConfigError(f"kind {kind!r} is not known; it is {KIND_HELP}", key="imu.kind")
    if kind not in schema.kinds:
        raise ConfigError(
            f"{schema.name} holds {' or '.join(schema.kinds)}, not kind {kind!r}", key="imu.kind"
        )
    axes = DEFAULT_AXES if axes is None else axes
    try:
        C_bs(axes)
    except ValueError as error:
        raise ConfigError(str(error), key="imu.axes") from None
    for key, unit, known in (
        ("gyro_unit", gyro_unit, GYRO_UNITS),
        ("accel_unit", accel_unit, ACCEL_UNITS),
    ):
        if unit not in known:
            raise ConfigError(f"{key} {unit!r} is not one of {', '.join(known)}", key=f"imu.{key}")
    return ImuLog(path, topic, schema, kind, axes, strict, gyro_unit, accel_unit, dv_frame)


def read_imu(
    path: str | Path,
    topic: str | None = None,
    kind: str | None = None,
    axes: str | None = None,
    *,
    strict: bool = False,
    gyro_unit: str = "rad/s",
    accel_unit: str = "m/s^2",
    dv_frame: DvFrame = "start",
) -> ImuSamples:
    """Read a whole IMU topic into memory, in body axes forward-right-down.

    Parameters and errors are those of `open_imu`. Gaps stay gaps: `navgrade.navigate` refuses
    or bridges them.

    Returns
    -------
    ImuSamples
        One row per message; ``t = 0`` at the first header stamp. Where the schema has no
        interval, `dt` is the step from the previous stamp, except after a gap and for the first
        sample, whose interval is taken as the median one.
    """
    log = open_imu(
        path,
        topic,
        kind,
        axes,
        strict=strict,
        gyro_unit=gyro_unit,
        accel_unit=accel_unit,
        dv_frame=dv_frame,
    )
    return concatenate(list(log.blocks()))


def sha256(path: Path) -> str:
    """Checksum of a file, read in pieces."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
