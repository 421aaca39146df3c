"""What is in a log, and what is wrong with its time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import SchemaError
from navgrade.imu import MAX_MISSING, nominal_interval
from navgrade.logs.container import Issue, McapFile, RawMessages
from navgrade.logs.container.cdr import Field, decode, parse_ros2msg

_MAX_LISTED = 20


@dataclass
class TopicAudit:
    """One topic's messages and times.

    Attributes
    ----------
    name, schema, encoding : str
    count : int
    log_span : float
        Last minus first log time, s.
    stamp_span : float or None
        Last minus first header stamp, s; None without stamps.
    interval : float or None
        Median interval of the first messages, by header stamp, s.
    repeats, backward_steps, gap_count : int
        Header stamps equal to, or before, the one before; gaps longer than three intervals.
    gaps : list of (float, float)
        The first ones: start, s after the first stamp, and length, s.
    log_minus_stamp : tuple of float or None
        Least and greatest log time minus header stamp, s.
    """

    name: str
    schema: str
    encoding: str
    count: int = 0
    log_span: float = 0.0
    stamp_span: float | None = None
    interval: float | None = None
    repeats: int = 0
    backward_steps: int = 0
    gap_count: int = 0
    gaps: list[tuple[float, float]] = field(default_factory=list)
    log_minus_stamp: tuple[float, float] | None = None
    _first_log: int = 0
    _first_stamp: int | None = None
    _last_stamp: int = 0

    @property
    def rate_hz(self) -> float:
        """Mean rate, by header stamp where there is one."""
        span = self.log_span if self.stamp_span is None else self.stamp_span
        return (self.count - 1) / span if span > 0.0 and self.count > 1 else 0.0

    @property
    def clock_ratio(self) -> float | None:
        """Header time over log time; far from 1, one of the clocks is not a clock."""
        if self.stamp_span is None or not self.stamp_span or not self.log_span:
            return None
        return self.stamp_span / self.log_span

    def _add(self, log_ns: NDArray[np.int64], stamp_ns: NDArray[np.int64] | None) -> None:
        if not self.count:
            self._first_log = int(log_ns[0])
        self.count += len(log_ns)
        self.log_span = (int(log_ns[-1]) - self._first_log) * 1e-9
        if stamp_ns is None:
            return
        if self._first_stamp is None:
            self._first_stamp = self._last_stamp = int(stamp_ns[0])
            steps_ns = np.diff(stamp_ns)
        else:
            steps_ns = np.diff(stamp_ns, prepend=np.int64(self._last_stamp))
        before = stamp_ns[len(stamp_ns) - len(steps_ns) :] - steps_ns
        self._last_stamp = int(stamp_ns[-1])
        self.stamp_span = (self._last_stamp - self._first_stamp) * 1e-9
        lag = (log_ns - stamp_ns) * 1e-9
        low, high = self.log_minus_stamp or (np.inf, -np.inf)
        self.log_minus_stamp = (min(low, float(lag.min())), max(high, float(lag.max())))
        self.repeats += int(np.count_nonzero(steps_ns == 0))
        self.backward_steps += int(np.count_nonzero(steps_ns < 0))
        steps = steps_ns * 1e-9
        if self.interval is None and len(steps):
            self.interval = nominal_interval(steps)
        if self.interval:
            wide = np.flatnonzero(steps > (1.0 + MAX_MISSING) * self.interval)
            self.gap_count += len(wide)
            for k in wide[: _MAX_LISTED - len(self.gaps)]:
                start = (int(before[k]) - self._first_stamp) * 1e-9
                self.gaps.append((start, float(steps[k]) - self.interval))


@dataclass(frozen=True)
class LogAudit:
    """A whole log.

    Attributes
    ----------
    topics : list of TopicAudit
    metadata : dict of str to dict
    attachments : list of (str, str, int)
        Name, media type, bytes.
    issues : list of Issue
    """

    topics: list[TopicAudit]
    metadata: dict[str, dict[str, str]]
    attachments: list[tuple[str, str, int]]
    issues: list[Issue]


def audit(path: str | Path, progress: Callable[[int], None] | None = None) -> LogAudit:
    """Read a whole log and report on it.

    Raises
    ------
    LogError
        When it is no MCAP file.
    """
    file = McapFile(Path(path))
    topics: dict[int, TopicAudit] = {}
    for run in file.runs(lambda channel: True, progress=progress):
        if run.channel not in topics:
            channel = file.channels[run.channel]
            topics[run.channel] = TopicAudit(
                channel.topic, file.schema_name(channel), channel.message_encoding
            )
        topics[run.channel]._add(run.log_time_ns, _stamps(file, run))
    for number, channel in file.channels.items():
        if number not in topics:
            topics[number] = TopicAudit(
                channel.topic, file.schema_name(channel), channel.message_encoding
            )
    return LogAudit(
        topics=sorted(topics.values(), key=lambda topic: topic.name),
        metadata={record.name: record.metadata for record in file.metadata},
        attachments=[(a.name, a.media_type, len(a.data)) for a in file.attachments],
        issues=file.issues,
    )


def _stamps(file: McapFile, run: RawMessages) -> NDArray[np.int64] | None:
    """Header stamps of a run, None where its messages have no readable header."""
    channel = file.channels[run.channel]
    schema = file.schemas.get(channel.schema_id)
    if schema is None or channel.message_encoding != "cdr" or schema.encoding != "ros2msg":
        return None
    try:
        head = _header_fields(schema.name, schema.data.decode())
        if head is None:
            return None
        stamps = np.empty(len(run.sizes), np.int64)
        for rows, messages in run.by_size():
            for part, records in decode(head, messages):
                seconds = records["header.stamp.sec"].astype(np.int64)
                nanoseconds = records["header.stamp.nanosec"]
                stamps[rows[part]] = seconds * 1_000_000_000 + nanoseconds
    except (SchemaError, UnicodeDecodeError):
        return None
    return stamps


def _header_fields(name: str, text: str) -> tuple[Field, ...] | None:
    """The leading stamp members, all a header stamp needs; None if they do not lead."""
    try:
        fields = parse_ros2msg(name, text)
    except SchemaError:
        return None
    head = fields[:2]
    if [f.path for f in head] != ["header.stamp.sec", "header.stamp.nanosec"]:
        return None
    return head
