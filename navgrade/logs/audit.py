"""What is in a log, which topic is the IMU, and what is wrong with the rest."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import SchemaError
from navgrade.logs.container import ENCODINGS, Columns, Issue, McapFile, Messages
from navgrade.logs.schemas import HEADER_STAMP, IMU_SCHEMAS, Clock, Condition, ImuSchema
from navgrade.logs.stamps import Places, SequenceAudit, StampAudit
from navgrade.logs.topics import (
    DEFAULT_AXES,
    Topic,
    as_recorded,
    open_known,
    usable_imus,
)

Progress = Callable[[int], None]


@dataclass
class TopicAudit:
    """One topic's messages and times.

    Attributes
    ----------
    name, schema, encoding : str
    metadata : mapping of str to str
        What the recorder wrote down of it.
    count : int
    first_log_ns, last_log_ns : int or None
        Log times, Unix ns; None where no message was read.
    stamps : StampAudit or None
        None where the messages have no readable time of their own.
    sequence : SequenceAudit
    not_finite : Places
        Messages of an IMU that hold a NaN or an infinity; of length 0.
    trouble : str or None
        Why its messages cannot be decoded.
    """

    name: str
    schema: str
    encoding: str
    metadata: Mapping[str, str]
    count: int = 0
    first_log_ns: int | None = None
    last_log_ns: int | None = None
    stamps: StampAudit | None = None
    sequence: SequenceAudit = field(default_factory=SequenceAudit)
    not_finite: Places = field(default_factory=Places)
    trouble: str | None = None

    @property
    def log_span(self) -> float:
        """Last minus first log time, s."""
        return ((self.last_log_ns or 0) - (self.first_log_ns or 0)) * 1e-9

    @property
    def rate_hz(self) -> float:
        """Mean rate, by stamps where their clock can be trusted; 0 where there is none."""
        stamps = self.stamps
        span = stamps.span if stamps is not None and stamps.is_steady else self.log_span
        return (self.count - 1) / span if span > 0.0 and self.count > 1 else 0.0

    @property
    def clock_ratio(self) -> float | None:
        """Time by stamps over log time; far from 1, one of the clocks is not a clock."""
        if self.stamps is None or not self.stamps.span or not self.log_span:
            return None
        return self.stamps.span / self.log_span


@dataclass(frozen=True)
class ImuUse:
    """How `navgrade run` understands a topic of IMU samples.

    Attributes
    ----------
    topic : str
    kinds : tuple of str
        What its numbers can be.
    default_kind : str or None
        What they are when nobody says it; None makes that a required choice.
    axes : str
        When nobody says where x, y and z point.
    accel_schema : str or None
        Type of the second topic's messages, where the specific force has one of its own.
    warning : str or None
    """

    topic: str
    kinds: tuple[str, ...]
    default_kind: str | None
    axes: str
    accel_schema: str | None
    warning: str | None


@dataclass(frozen=True)
class Chunks:
    """The chunks of a file, by its summary.

    Attributes
    ----------
    count : int
    stored, size : int
        Bytes in the file, and unpacked.
    compressions : tuple of str
        ``zstd``, ``lz4``, ``none``, or whatever else the file says.
    """

    count: int
    stored: int
    size: int
    compressions: tuple[str, ...]


@dataclass(frozen=True)
class LogAudit:
    """A whole log.

    Attributes
    ----------
    name : str
    size : int
        Bytes.
    profile, library : str
        What the file says of its recorder.
    deep : bool
        Every message was read; otherwise the summary, and the first and last chunk of each topic.
    why_deep : str or None
        What made that necessary when nobody asked for it.
    chunks : Chunks or None
        None where the summary does not tell.
    topics : list of TopicAudit
    imus : list of ImuUse
        Topics that hold IMU samples.
    imu_choices : list of str
        What `navgrade run` can choose from when nobody names a topic; it takes the only one.
    metadata : list of (str, dict)
        Names, and what they hold.
    attachments : list of (str, str, int)
        Name, media type, bytes.
    issues : list of Issue
    """

    name: str
    size: int
    profile: str
    library: str
    deep: bool
    why_deep: str | None
    chunks: Chunks | None
    topics: list[TopicAudit]
    imus: list[ImuUse]
    imu_choices: list[str]
    metadata: list[tuple[str, dict[str, str]]]
    attachments: list[tuple[str, str, int]]
    issues: list[Issue]

    @property
    def log_span_ns(self) -> tuple[int, int] | None:
        """First and last log time of all topics, Unix ns."""
        first = [topic.first_log_ns for topic in self.topics if topic.first_log_ns is not None]
        last = [topic.last_log_ns for topic in self.topics if topic.last_log_ns is not None]
        return (min(first), max(last)) if first else None

    def report(self) -> dict[str, Any]:
        """The audit in plain types, as `navgrade inspect --json` prints it."""
        first_ns, last_ns = self.log_span_ns or (None, None)
        return {
            "file": self.name,
            "bytes": self.size,
            "profile": self.profile,
            "library": self.library,
            "deep": self.deep,
            "why_deep": self.why_deep,
            "messages": sum(topic.count for topic in self.topics),
            "first_log_ns": first_ns,
            "last_log_ns": last_ns,
            "chunks": asdict(self.chunks) if self.chunks else None,
            "topics": [_topic_report(topic) for topic in self.topics],
            "imus": [asdict(use) for use in self.imus],
            "imu_choices": self.imu_choices,
            "metadata": [{"name": name, "values": values} for name, values in self.metadata],
            "attachments": [
                {"name": name, "media_type": media_type, "bytes": size}
                for name, media_type, size in self.attachments
            ],
            "issues": [asdict(issue) for issue in self.issues],
        }


def _topic_report(topic: TopicAudit) -> dict[str, Any]:
    stamps = topic.stamps
    return {
        "topic": topic.name,
        "schema": topic.schema,
        "encoding": topic.encoding,
        "messages": topic.count,
        "rate_hz": topic.rate_hz,
        "first_log_ns": topic.first_log_ns,
        "last_log_ns": topic.last_log_ns,
        "stamps": stamps.report() if stamps else None,
        "sequence": topic.sequence.report(),
        "not_finite": asdict(topic.not_finite),
        "trouble": topic.trouble,
    }


def audit(path: str | Path, *, deep: bool = False, progress: Progress | None = None) -> LogAudit:
    """Report on a log, from its summary or by reading all of it.

    Parameters
    ----------
    path : path
    deep : bool
        Read every message. Without it the summary tells most, and only the first and last chunk
        of each topic are read; a file whose summary does not suffice is read whole all the same.
    progress : callable, optional
        Called with the number of bytes of the file read so far.

    Raises
    ------
    LogError
        When it is no MCAP file.
    """
    known = open_known(path, progress)
    why_deep = None if deep else _why_deep(known)
    troubles: dict[str, str] = {}
    while True:
        file = McapFile(path)
        reading = _Reading(known, troubles)
        try:
            if deep or why_deep:
                reading.everything(file, progress)
            else:
                reading.ends(file)
            break
        except SchemaError as error:
            if error.topic is None or error.topic in troubles:
                raise
            troubles[error.topic] = str(error)  # once more, without a look into its messages
    if deep or why_deep:
        reading.compare(McapFile(path))
    topics = sorted(reading.topics.values(), key=lambda topic: topic.name)
    listed = [Topic(t.name, t.schema, t.encoding, t.count, t.rate_hz) for t in topics]
    return LogAudit(
        name=file.name,
        size=file.size,
        profile=file.profile,
        library=file.library,
        deep=deep or why_deep is not None,
        why_deep=why_deep,
        chunks=_chunks(file),
        topics=topics,
        imus=[_imu_use(topic) for topic in topics if _entries(topic)],
        imu_choices=[topic.name for topic in usable_imus(listed)],
        metadata=[(record.name, record.metadata) for record in file.metadata],
        attachments=[(a.name, a.media_type, a.data_size) for a in file.attachments],
        issues=[*file.issues, *_contradictions(file)],
    )


def _entries(topic: TopicAudit) -> list[ImuSchema]:
    if topic.encoding not in ENCODINGS:
        return []
    return [schema for schema in IMU_SCHEMAS if schema.name == topic.schema]


def _imu_use(topic: TopicAudit) -> ImuUse:
    entries = [as_recorded(entry, topic.metadata) for entry in _entries(topic)]
    return ImuUse(
        topic.name,
        kinds=tuple(dict.fromkeys(kind for entry in entries for kind in entry.kinds)),
        default_kind=entries[0].default_kind,
        axes=entries[0].axes or DEFAULT_AXES,
        accel_schema=entries[0].accel_name,
        warning=entries[0].warning,
    )


def _why_deep(file: McapFile) -> str | None:
    """Why the summary does not suffice."""
    summary = file.summary
    if summary is None:
        return "it has no summary that can be trusted"
    if summary.statistics is None:
        return "its summary has no statistics"
    if summary.statistics.message_count and not summary.channels:
        return "its summary has no topics"
    if summary.statistics.message_count and not summary.chunk_indexes:
        return "its summary has no index of chunks"
    return None


def _chunks(file: McapFile) -> Chunks | None:
    if file.summary is None or not file.summary.chunk_indexes:
        return None
    indexes = file.summary.chunk_indexes
    return Chunks(
        count=len(indexes),
        stored=sum(index.compressed_size for index in indexes),
        size=sum(index.uncompressed_size for index in indexes),
        compressions=tuple(sorted({index.compression or "none" for index in indexes})),
    )


def _contradictions(file: McapFile) -> list[Issue]:
    """Where the summary, although its checksum agrees, contradicts itself or the file."""
    summary = file.summary
    if summary is None or summary.statistics is None:
        return []
    statistics, indexes = summary.statistics, summary.chunk_indexes
    texts = []
    counted = sum(statistics.channel_message_counts.values())
    if counted and counted != statistics.message_count:
        texts.append(f"counts {counted} messages by topic, {statistics.message_count} in all")
    if indexes and len(indexes) != statistics.chunk_count:
        texts.append(f"counts {statistics.chunk_count} chunks, and lists {len(indexes)}")
    beyond = [i for i in indexes if i.chunk_start_offset + i.chunk_length > file.size]
    if beyond:
        texts.append(f"lists {len(beyond)} chunks beyond the end of the file")
    return [Issue(file.size, "summary", f"the summary {text}") for text in texts]


class _Reading:
    """Topics by name, and what is read of their messages."""

    def __init__(self, known: McapFile, troubles: Mapping[str, str]) -> None:
        self.topics: dict[str, TopicAudit] = {}
        self._looks: dict[str, _Look] = {}
        for channel in known.channels.values():
            name = channel.topic
            if name not in self.topics:
                schema, encoding = known.schema_name(channel), channel.message_encoding
                topic = TopicAudit(name, schema, encoding, channel.metadata)
                topic.trouble = troubles.get(name)
                self.topics[name] = topic
                self._looks[name] = _Look() if topic.trouble else _look(known, topic)
        self._fields = {name: look.paths for name, look in self._looks.items()}

    def everything(self, file: McapFile, progress: Progress | None) -> None:
        """Read every message."""
        for columns in file.columns(self._fields, progress=progress):
            self.topics[columns.topic].count += len(columns)
            self._take(columns, slice(None), follows=True)

    def ends(self, file: McapFile) -> None:
        """Take the counts from the summary; read the first and the last chunk of each topic."""
        summary = file.summary
        assert summary is not None and summary.statistics is not None  # else all of it is read
        for number, count in summary.statistics.channel_message_counts.items():
            if number in file.channels:
                self.topics[file.channels[number].topic].count += count
        first = _first_chunks(file, summary.chunk_indexes)
        last = _first_chunks(file, reversed(summary.chunk_indexes))
        wanted = {chunk.chunk_start_offset for chunk in (*first.values(), *last.values())}
        for columns in file.columns(self._fields, chunks=wanted):
            if columns.topic in first:
                head = columns.log_time_ns <= first[columns.topic].message_end_time
                tail = ~head & (columns.log_time_ns >= last[columns.topic].message_start_time)
                self._take(columns, head, follows=True)
                self._take(columns, tail, follows=False)

    def _take(self, columns: Columns, which: Any, *, follows: bool) -> None:
        log_ns = columns.log_time_ns[which]
        if not len(log_ns):
            return
        topic = self.topics[columns.topic]
        low, high = int(log_ns.min()), int(log_ns.max())
        topic.first_log_ns = low if topic.first_log_ns is None else min(low, topic.first_log_ns)
        topic.last_log_ns = high if topic.last_log_ns is None else max(high, topic.last_log_ns)
        topic.sequence.add(columns.sequence[which], follows=follows)
        look = self._looks[columns.topic]
        if look.clock is None:
            return
        if topic.stamps is None:
            topic.stamps = StampAudit(look.clock.title)
        stamp_ns = _stamps_ns(look.clock, columns.fields)[which]
        topic.stamps.add(stamp_ns, log_ns, follows=follows)
        bad = np.zeros(len(log_ns), bool)
        for path in look.numbers:
            values = columns.fields[path][which].reshape(len(log_ns), -1)
            bad |= ~np.isfinite(values).all(axis=1)
        if look.condition is not None:
            bad &= look.condition.holds(columns.fields[look.condition.path][which])
        at = (stamp_ns[bad] - topic.stamps.first_ns) * 1e-9
        topic.not_finite.add(at, np.zeros(len(at)))

    def compare(self, file: McapFile) -> None:
        """Where stamps repeat, count the messages equal to the one before in every byte."""
        found = {name: t.stamps for name, t in self.topics.items() if t.stamps and t.stamps.repeats}
        equal = dict.fromkeys(found, 0)
        last: dict[int, bytes] = {}
        for messages in file.messages(lambda channel: channel.topic in found) if found else ():
            name = file.channels[messages.channel].topic
            equal[name] += last.get(messages.channel) == _message(messages, 0)
            equal[name] += _equal_to_last(messages)
            last[messages.channel] = _message(messages, -1)
        for name, topic in self.topics.items():
            if topic.stamps:
                topic.stamps.exact_repeats = equal.get(name, 0)


def _first_chunks(file: McapFile, indexes: Iterable[Any]) -> dict[str, Any]:
    """The first chunk of each topic; one whose index lists no channels may hold any."""
    found: dict[str, Any] = {}
    names = {number: channel.topic for number, channel in file.channels.items()}
    for index in indexes:
        for number in index.message_index_offsets or names:
            if number in names:
                found.setdefault(names[number], index)
        if len(found) == len(names):
            break
    return found


class _Look(NamedTuple):
    """What is read of a topic's messages."""

    clock: Clock | None = None
    numbers: tuple[str, ...] = ()  # to be finite
    condition: Condition | None = None  # of the messages that count

    @property
    def paths(self) -> list[str]:
        clock = self.clock.paths if self.clock else ()
        condition = (self.condition.path,) if self.condition else ()
        return list(dict.fromkeys((*clock, *self.numbers, *condition)))


def _look(file: McapFile, topic: TopicAudit) -> _Look:
    try:
        leaves = {f"{member.path}." for member in file.members(topic.name)}
    except SchemaError:  # its definition is not understood, or in an encoding that is slow to read
        return _Look()

    def has(path: str) -> bool:
        return any(leaf.startswith(f"{path}.") for leaf in leaves)

    entry = next(iter(_entries(topic)), None)
    look = _Look(HEADER_STAMP)
    if entry is not None:
        vectors = (entry.gyro,) if entry.accel_name else (entry.gyro, entry.accel)
        paths = [path for v in vectors for path in ((v,) if isinstance(v, str) else v)]
        look = _Look(entry.clock, tuple(paths), entry.condition)
    return look if all(map(has, look.paths)) else _Look()


def _stamps_ns(clock: Clock, fields: Mapping[str, NDArray[Any]]) -> NDArray[np.int64]:
    total = np.zeros(len(fields[clock.paths[0]]), np.int64)
    for path, unit in clock.members:
        column = fields[path]
        if column.dtype.kind == "f":
            column = np.rint(np.nan_to_num(column) * unit).astype(np.int64)
            unit = 1
        total += column * unit
    return total


def _message(messages: Messages, number: int) -> bytes:
    start = messages.offsets[number]
    return messages.data[start : start + messages.sizes[number]].tobytes()


def _equal_to_last(messages: Messages) -> int:
    """How many messages equal the one before them."""
    same = np.diff(messages.sizes) == 0
    count = 0
    for size in np.unique(messages.sizes[1:][same]).tolist():
        rows = np.flatnonzero(same & (messages.sizes[1:] == size)) + 1
        windows = np.lib.stride_tricks.sliding_window_view(messages.data, size)
        equal = windows[messages.offsets[rows]] == windows[messages.offsets[rows - 1]]
        count += int(np.count_nonzero(equal.all(axis=1)))
    return count
