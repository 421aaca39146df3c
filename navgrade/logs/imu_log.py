"""An IMU topic of a log as blocks of samples in body axes."""

from __future__ import annotations

import hashlib
from collections import Counter as Counts
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from earth.frames import C_bs
from earth.units import DEG_PER_S, STANDARD_GRAVITY
from navgrade.errors import ConfigError, LogError
from navgrade.imu import (
    KIND_HELP,
    KINDS,
    NOMINAL_SAMPLES,
    DvFrame,
    ImuSamples,
    Kind,
    concatenate,
    intervals,
    nominal_interval,
)
from navgrade.logs.container import SLOW_ENCODINGS, Issue, McapFile
from navgrade.logs.container.source import open_source, read_at
from navgrade.logs.feed import AccelPart, Feed, GyroPart, Part
from navgrade.logs.schemas import ImuFields, ImuSchema
from navgrade.logs.times import Joiner, Rows, join_rows, least_delay_ns
from navgrade.logs.topics import DEFAULT_AXES, choose_imu

GYRO_UNITS = {"rad/s": 1.0, "deg/s": DEG_PER_S}
ACCEL_UNITS = {"m/s^2": 1.0, "g": STANDARD_GRAVITY}
_BLOCK = 16_384  # samples collected before a block is handed on
_PIECE = 1 << 24  # bytes of a file read at once
_SAME = 0.1  # relative: intervals that differ by more do not mean the same thing
_CLOSE = 0.75  # nominal intervals: two clocks in each other's way leave a step of half at most
Array = NDArray[np.float64]
Progress = Callable[[int], None]


@dataclass
class ImuLog:
    """An IMU topic, opened; `blocks` reads it from the start each time it is called.

    Attributes
    ----------
    path : Path, or str for a URL
    topic : str
    encoding : str
        Of its messages.
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
    rate_hz : float or None
        Of the IMU: each of its samples stands for an interval of ``1 / rate_hz``.
    accel_topic : str or None
        Topic of the specific forces, where they have one of their own.
    issues : list of Issue
        Defects of the file met by the last reading.
    """

    path: Path | str
    topic: str
    encoding: str
    schema: ImuSchema
    kind: Kind
    axes: str
    strict: bool = False
    gyro_unit: str = "rad/s"
    accel_unit: str = "m/s^2"
    dv_frame: DvFrame = "start"
    rate_hz: float | None = None
    accel_topic: str | None = None
    issues: list[Issue] = field(default_factory=list)
    _reading: _Reading | None = field(default=None, init=False, repr=False)
    _start: tuple[int, int] | None = field(default=None, init=False, repr=False)

    @property
    def epoch_ns(self) -> int:
        """Unix time of the first sample, ns; read once."""
        return self._started()[0]

    @property
    def clock_offset_ns(self) -> int:
        """What is added to times that do not count from 1970; see `read_aiding`."""
        return self._started()[1]

    def _started(self) -> tuple[int, int]:
        if self._start is None:
            reading = _Reading(self)
            block = next(reading.blocks(McapFile(self.path, strict=self.strict), None))
            self._start = block.epoch_ns, reading.offset_ns
        return self._start

    @property
    def notes(self) -> list[str]:
        """What a user should know of the log and of what the last reading met, in sentences."""
        notes = []
        if self.encoding in SLOW_ENCODINGS:
            notes.append(f"{self.encoding} messages are decoded one by one: this is slow")
        if self.schema.warning:
            notes.append(self.schema.warning)
        return notes + (self._reading.notes() if self._reading else [])

    def blocks(self, progress: Progress | None = None) -> Iterator[ImuSamples]:
        """Yield consecutive samples; memory does not grow with the log.

        Messages up to a second late are put in order, those recorded twice are left out; `notes`
        tells how many.

        Raises
        ------
        LogError
            On a value that is not finite, time that repeats or runs backwards, or no message.
        """
        file = McapFile(self.path, strict=self.strict)
        self.issues = file.issues
        self._reading = _Reading(self)
        for block in self._reading.blocks(file, progress):
            self._start = block.epoch_ns, self._reading.offset_ns
            yield block


class _Reading:
    """One pass through a log, from columns as recorded to valid samples."""

    def __init__(self, log: ImuLog) -> None:
        self.log = log
        self._met: Counts[str] = Counts()
        gyro, accel = GyroPart(log.schema, log.rate_hz), AccelPart(log.schema, self._met)
        parts: dict[str, tuple[Part, ...]] = {log.topic: (gyro, accel)}
        if log.accel_topic is not None:
            parts = {log.topic: (gyro,), log.accel_topic: (accel,)}
        self._feeds = {
            topic: Feed(str(log.path), topic, log.schema, own, self._met)
            for topic, own in parts.items()
        }
        self._joiner: Joiner | None = None
        if log.accel_topic is not None:
            faults = self._feeds[log.topic].error, self._feeds[log.accel_topic].error
            self._joiner = Joiner(faults)
        self._assembler = _Assembler(log, self._feeds[log.topic])

    @property
    def offset_ns(self) -> int:
        """What was added to times that do not count from 1970."""
        return self._assembler.offset_ns

    def blocks(self, file: McapFile, progress: Progress | None) -> Iterator[ImuSamples]:
        """Samples in blocks of equal size, whatever the file's chunks."""
        held: list[Rows] = []
        for rows in self._rows(file, progress):
            held.append(rows)
            if sum(map(len, held)) >= _BLOCK:
                rest = join_rows(held)
                while len(rest) >= _BLOCK:
                    yield self._assembler.samples(rest[:_BLOCK])
                    rest = rest[_BLOCK:]
                held = [rest]
        rest = join_rows(held)
        if len(rest):
            yield self._assembler.samples(rest)
        if self._assembler.last_ns is None:
            raise LogError(self._nothing(), file=str(self.log.path), topic=self.log.topic)

    def _rows(self, file: McapFile, progress: Progress | None) -> Iterator[Rows]:
        """Messages in the order of time, those of two topics joined."""
        wanted = {topic: feed.paths for topic, feed in self._feeds.items()}
        for columns in file.columns(wanted, progress=progress):
            yield from self._joined(columns.topic, self._feeds[columns.topic].push(columns))
        for topic, feed in self._feeds.items():
            yield from self._joined(topic, feed.sorter.finish())
        if self._joiner:
            self._joiner.finish()

    def _joined(self, topic: str, rows: Rows) -> Iterator[Rows]:
        if len(rows) and self._joiner:
            rows = self._joiner.push(list(self._feeds).index(topic), rows)
        if len(rows):
            yield rows

    def _nothing(self) -> str:
        if self._joiner and any(self._joiner.alone):
            return f"no message of it has the time of one of {self.log.accel_topic}"
        return "; ".join(["no message of it is in the log", *self._told()])

    def _told(self) -> list[str]:
        return [f"{count} messages {what}" for what, count in self._met.items()]

    def notes(self) -> list[str]:
        """What this pass met."""
        notes = [*self._assembler.notes, *self._told()]
        for topic, feed in self._feeds.items():
            if feed.sorter.moved:
                notes.append(f"{topic}: {feed.sorter.moved} messages were put back in order")
            if feed.sorter.dropped:
                notes.append(
                    f"{topic}: {feed.sorter.dropped} messages recorded twice were left out"
                )
        if self._joiner:
            for topic, count in zip(self._feeds, self._joiner.alone, strict=True):
                if count:
                    notes.append(f"{topic}: {count} messages without a partner were left out")
        return notes


class _Assembler:
    """Turns rows as recorded into valid samples, carrying what crosses their boundaries."""

    def __init__(self, log: ImuLog, feed: Feed) -> None:
        self.log = log
        self.notes: list[str] = []
        self.last_ns: int | None = None
        self.offset_ns = 0
        self._feed = feed
        self._from_gyro = C_bs(log.axes).T * GYRO_UNITS[log.gyro_unit]
        self._from_accel = C_bs(log.axes).T * ACCEL_UNITS[log.accel_unit]
        self._epoch_ns = 0
        self._nominal = 0.0
        self._last: Rows | None = None

    def samples(self, rows: Rows) -> ImuSamples:
        """Samples of the next rows."""
        interval = rows.values[:, 3] if rows.values.shape[1] > 6 else None
        if self.last_ns is None:
            self._begin(rows, interval)
        self._check_moved(rows)
        stamp_ns = rows.time_ns + self.offset_ns
        t = np.asarray((stamp_ns - self._epoch_ns) * 1e-9)
        last = None if self.last_ns is None else (self.last_ns - self._epoch_ns) * 1e-9
        dt = intervals(t, last, self._nominal) if interval is None else interval
        self.last_ns = int(stamp_ns[-1])
        gyro = rows.values[:, :3] @ self._from_gyro
        accel = rows.values[:, -3:] @ self._from_accel
        if self.log.schema.rates:
            gyro, accel = gyro * dt[:, None], accel * dt[:, None]
        return ImuSamples(
            t=t,
            dt=dt,
            gyro=gyro,
            accel=accel,
            kind=self.log.kind,
            epoch_ns=self._epoch_ns,
            dv_frame=self.log.dv_frame,
        )

    def _begin(self, rows: Rows, interval: Array | None) -> None:
        """Take the epoch, the clock and the nominal interval from the first rows."""
        clock = self.log.schema.clock
        if not clock.unix:
            self.offset_ns = least_delay_ns(rows.time_ns, rows.log_ns)
            self.notes.append(
                f"the {clock.title} does not count from 1970: it was tied to log time by the least "
                f"delay of the first {NOMINAL_SAMPLES} messages"
            )
        self._epoch_ns = int(rows.time_ns[0]) + self.offset_ns
        if len(rows) > 1:
            self._nominal = nominal_interval(np.diff((rows.time_ns - rows.time_ns[0]) * 1e-9))
        elif interval is None:
            raise LogError(
                "one message is not a log", file=str(self.log.path), topic=self.log.topic
            )
        if interval is not None and len(rows) > 1:
            self._compare(nominal_interval(interval))

    def _compare(self, length: float) -> None:
        """Recorded intervals, or those of a given rate, against the steps of the stamps."""
        if abs(length - self._nominal) <= _SAME * self._nominal:
            return
        if self.log.rate_hz is not None:
            rate_hz = self.log.rate_hz * length / self._nominal
            raise ConfigError(
                f"imu.rate_hz = {self.log.rate_hz:g} makes intervals of {length:.6g} s, but "
                f"{self.log.topic} has a message every {self._nominal:.6g} s, which is "
                f"{rate_hz:.6g} Hz; set that, or leave rate_hz out",
                key="imu.rate_hz",
            )
        self.notes.append(
            f"intervals of {length:.6g} s are recorded, but messages are {self._nominal:.6g} s "
            "apart: samples are missing, or the intervals are wrong"
        )

    def _check_moved(self, rows: Rows) -> None:
        """Raise where messages put back in order come from a clock that stepped back."""
        both = rows if self._last is None else join_rows([self._last, rows])
        self._last = rows[-1:]
        if not both.late_ns.any():
            return
        moved = both.late_ns > 0
        close = np.diff(both.time_ns) * 1e-9 < _CLOSE * self._nominal
        bad = np.flatnonzero(close & (moved[1:] | moved[:-1]))
        if len(bad):
            first = int(bad[0])
            late = first if moved[first] else first + 1
            step = (both.time_ns[first + 1] - both.time_ns[first]) * 1e-9
            raise self._feed.fault(
                f"steps back by {both.late_ns[late] * 1e-9:.6f} s, and is then {step:.6f} s from "
                "that of another sample: this is a clock that was set back, not a message that "
                "came late",
                both,
                late,
            )


def open_imu(
    path: str | Path,
    topic: str | None = None,
    kind: str | None = None,
    axes: str | None = None,
    *,
    strict: bool = False,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    dv_frame: DvFrame = "start",
    rate_hz: float | None = None,
    accel_topic: str | None = None,
    fields: ImuFields | None = None,
) -> ImuLog:
    """Open an IMU topic of an MCAP log.

    Parameters
    ----------
    path : path or URL
        A URL such as ``https://...`` or ``s3://...`` is read through fsspec.
    topic : str, optional
        May be left out when the log has one IMU topic.
    kind : {"rate", "average", "increment", "compensated"}, optional
        What the numbers are; required unless the message type says it.
    axes : str, optional
        Where the sensor's x, y, z point, see `earth.C_bs`; by default as the message type says,
        and where it does not, FLU, the ROS convention.
    strict : bool
        Refuse a damaged file.
    gyro_unit : {"rad/s", "deg/s"}, optional
    accel_unit : {"m/s^2", "g"}, optional
        By default as the message type says.
    dv_frame : {"start", "end"}
        Of compensated velocity increments: resolved in b at the start or the end of the interval.
    rate_hz : float, optional
        Of the IMU. Each of its samples then stands for an interval of ``1 / rate_hz``, however
        its stamps jitter; a rate that contradicts the stamps is refused.
    accel_topic : str, optional
        Topic of the specific forces, where they have one of their own; messages of equal time
        belong together.
    fields : ImuFields, optional
        Members to read instead of those known for the message type.

    Raises
    ------
    LogError, SchemaError
        When the log or the topic cannot be read.
    ConfigError
        When `kind` is missing, unknown or not what the messages can hold, `axes`, a unit or
        `rate_hz` is wrong, or a second topic is missing or too many.
    """
    if kind is not None and kind not in KINDS:
        raise ConfigError(f"kind {kind!r} is not known; it is {KIND_HELP}", key="imu.kind")
    source = path if isinstance(path, str) and "://" in path else Path(path)
    topic, encoding, schema = choose_imu(
        source, topic, kind=kind, accel_topic=accel_topic, fields=fields
    )
    kind = kind or schema.default_kind
    if kind is None:
        raise ConfigError(
            f"{schema.name or topic} does not say what its numbers are; set --kind (or imu.kind) "
            f"to {KIND_HELP}",
            key="imu.kind",
        )
    axes = (schema.axes or DEFAULT_AXES) if axes is None else axes
    try:
        C_bs(axes)
    except ValueError as error:
        raise ConfigError(str(error), key="imu.axes") from None
    gyro_unit = schema.gyro_unit if gyro_unit is None else gyro_unit
    accel_unit = schema.accel_unit if accel_unit is None else accel_unit
    for key, unit, known in (
        ("gyro_unit", gyro_unit, GYRO_UNITS),
        ("accel_unit", accel_unit, ACCEL_UNITS),
    ):
        if unit not in known:
            raise ConfigError(f"{key} {unit!r} is not one of {', '.join(known)}", key=f"imu.{key}")
    if rate_hz is not None:
        if not (np.isfinite(rate_hz) and rate_hz > 0.0):
            raise ConfigError(f"rate_hz must be positive, got {rate_hz!r}", key="imu.rate_hz")
        if schema.interval is not None:
            raise ConfigError(
                f"{schema.name or topic} records the length of each interval; leave rate_hz out",
                key="imu.rate_hz",
            )
    return ImuLog(
        source,
        topic,
        encoding,
        schema,
        kind,
        axes,
        strict=strict,
        gyro_unit=gyro_unit,
        accel_unit=accel_unit,
        dv_frame=dv_frame,
        rate_hz=rate_hz,
        accel_topic=accel_topic,
    )


def read_imu(
    path: str | Path,
    topic: str | None = None,
    kind: str | None = None,
    axes: str | None = None,
    *,
    strict: bool = False,
    gyro_unit: str | None = None,
    accel_unit: str | None = None,
    dv_frame: DvFrame = "start",
    rate_hz: float | None = None,
    accel_topic: str | None = None,
    fields: ImuFields | None = None,
) -> ImuSamples:
    """Read a whole IMU topic into memory, in body axes forward-right-down.

    Parameters and errors are those of `open_imu`. Gaps stay gaps: `navgrade.navigate` refuses
    or bridges them.

    Returns
    -------
    ImuSamples
        One row per message; ``t = 0`` at the first stamp. Where the messages have no interval and
        no `rate_hz` is given, `dt` is the step from the previous stamp, except after a gap and
        for the first sample, whose interval is taken as the median one.
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
        rate_hz=rate_hz,
        accel_topic=accel_topic,
        fields=fields,
    )
    return concatenate(list(log.blocks()))


def sha256(path: str | Path) -> str:
    """Checksum of a file or URL, read in pieces."""
    source = open_source(path)
    digest = hashlib.sha256()
    for offset in range(0, source.size, _PIECE):
        digest.update(read_at(source, offset, _PIECE))
    return digest.hexdigest()
