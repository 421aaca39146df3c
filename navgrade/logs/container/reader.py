"""MCAP files as columns of numbers, whatever their condition.

A file is walked from front to back (`Walk`), so that a damaged chunk or a missing end costs what
it held and nothing more. Stretches of it are read, unpacked, verified and turned into columns by
threads, each with buffers of its own; results come in the order of the file. Checksums are always
verified. Message indexes are not used: no checksum covers them, and finding the messages without
them takes less time than unpacking.
"""

from __future__ import annotations

import os
import threading
import zlib
from bisect import insort
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing, suppress
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol

import numpy as np
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, ChunkIndex, Header, Metadata, Schema
from numpy.typing import NDArray

from navgrade.errors import LogError, SchemaError
from navgrade.logs.container import slow
from navgrade.logs.container.chunks import (
    HEAD,
    RECORD,
    Bomb,
    Group,
    UnknownCompression,
    Workspace,
    locate,
    unpack,
)
from navgrade.logs.container.definitions import Member, flat, full_name, parse_definition
from navgrade.logs.container.layout import Plan, Rows
from navgrade.logs.container.source import Bytes, open_source, read_at
from navgrade.logs.container.summary import MAGIC, PARSE_ERRORS, read_summary, stream
from navgrade.logs.container.walk import Issue, Small, Stretch, Walk

_FAST = {"cdr": "ros2msg", "ros1": "ros1msg"}  # message encoding: schema encoding
ENCODINGS = (*_FAST, *slow.SLOW_ENCODINGS)
_JOB_BYTES = 1 << 22  # uncompressed, of the stretches decoded as one piece of work
_REMOTE_BYTES = 1 << 25  # the same of a remote file: a request costs more than a cache
_NEAR = 1 << 20  # bytes between stretches of a remote file that are read rather than left out
_BLOCK = 1 << 20


@dataclass(frozen=True, eq=False)
class Columns:
    """Messages of one topic, one row each, in the order of the file.

    Attributes
    ----------
    topic : str
    log_time_ns, publish_time_ns : ndarray of int64, shape (n,)
    sequence : ndarray of uint32, shape (n,)
    fields : dict of str to ndarray
        By the paths asked for: float64, int64, bool, or objects for texts; shape (n,) or (n, k).
    """

    topic: str
    log_time_ns: NDArray[np.int64]
    publish_time_ns: NDArray[np.int64]
    sequence: NDArray[np.uint32]
    fields: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.log_time_ns)


@dataclass(frozen=True, eq=False)
class Messages:
    """Messages of one channel as bytes, in the order of the file.

    Attributes
    ----------
    channel : int
    log_time_ns, publish_time_ns : ndarray of int64, shape (n,)
    sequence : ndarray of uint32, shape (n,)
    data : ndarray of uint8
    offsets, sizes : ndarray of int64, shape (n,)
        Message ``k`` is ``data[offsets[k] : offsets[k] + sizes[k]]``.
    """

    channel: int
    log_time_ns: NDArray[np.int64]
    publish_time_ns: NDArray[np.int64]
    sequence: NDArray[np.uint32]
    data: Bytes
    offsets: NDArray[np.int64]
    sizes: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.offsets)


class _Taker(Protocol):
    """What becomes of located messages."""

    keep: bool  # results are views of the unpacked records

    def wants(self, channel: Channel) -> bool: ...

    def take(self, group: Group, channel: Channel, schema: Schema | None) -> Any: ...

    def finish(self, taken: list[list[Any]]) -> Iterable[Any]:
        """Results of a piece of work from what was taken of each of its stretches."""


@dataclass
class _Done:
    """Outcome of a piece of work."""

    job: list[Stretch]
    results: list[Any] = field(default_factory=list)
    issues: list[Issue] = field(default_factory=list)
    records: list[Small] = field(default_factory=list)
    unknown: set[int] = field(default_factory=set)  # channels
    unchecked: bool = False  # no checksum of a chunk covers some of it


class McapFile:
    """An MCAP file, read from front to back.

    Parameters
    ----------
    source : path, binary file, or URL
        URLs are read through fsspec, with few large requests.
    strict : bool
        Raise on the first defect instead of noting it.

    Attributes
    ----------
    name : str
        For messages.
    size : int
        Bytes.
    profile, library : str
        Of the file's header.
    channels : dict of int to Channel
    schemas : dict of int to Schema
        Both grow while reading.
    attachments : list of AttachmentIndex
    metadata : list of Metadata
    issues : list of Issue
        Met by the last reading; of the issues those of the summary are there from the start.
    summary : Summary or None
        The file's own index, where there is one and its checksum agrees.

    Raises
    ------
    LogError
        When there is no such file or it is not MCAP; on any defect, when strict.
    """

    def __init__(self, source: str | Path | BinaryIO, *, strict: bool = False) -> None:
        self._source = open_source(source)
        self._strict = strict
        self.name = self._source.name
        self.size = self._source.size
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.attachments: list[AttachmentIndex] = []
        self.metadata: list[Metadata] = []
        self.issues: list[Issue] = []
        self.profile = self.library = ""
        self._open()

    def _open(self) -> None:
        magic = read_at(self._source, 0, len(MAGIC))
        if magic != MAGIC:
            what = "the file is empty" if not magic else "this is not an MCAP file"
            hint = " (a ROS 1 bag)" if magic.startswith(b"#ROSBAG") else ""
            raise LogError(f"{what}{hint}", file=self.name)
        self.summary, wrong, self._data_end = read_summary(self._source)
        if wrong:
            self._defect(
                Issue(self.size, "summary", f"the summary is damaged and not used: {wrong}")
            )
        self._opening = tuple(self.issues)
        self._index: dict[int, ChunkIndex] = {}
        if self.summary is not None:
            self.channels.update(self.summary.channels)
            self.schemas.update(self.summary.schemas)
            self._index = {
                index.chunk_start_offset: index
                for index in self.summary.chunk_indexes
                if index.chunk_length > RECORD.size
            }

    def schema_name(self, channel: Channel) -> str:
        """Name of a channel's schema, ``pkg/msg/Type`` for ROS; empty where it has none."""
        schema = self.schemas.get(channel.schema_id)
        if schema is None:
            return ""
        return full_name(schema.name) if schema.encoding in _FAST.values() else schema.name

    def members(self, topic: str) -> tuple[Member, ...]:
        """Members of a topic's messages by its definition, structures resolved.

        Raises
        ------
        LogError
            When there is no such topic.
        SchemaError
            When its messages have no ROS definition, or it is not understood.
        """
        for channel in self.channels.values():
            if channel.topic == topic:
                return tuple(flat(_members(channel, self.schemas.get(channel.schema_id))))
        raise LogError("no such topic", file=self.name, topic=topic)

    def columns(
        self,
        fields: Mapping[str, Sequence[str]],
        *,
        start_ns: int | None = None,
        end_ns: int | None = None,
        chunks: Collection[int] | None = None,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Iterator[Columns]:
        """Yield columns of one or more topics, some ten thousand messages at a time.

        Parameters
        ----------
        fields : mapping of str to sequence of str
            Paths wanted of each topic: ``a.b`` a member; ``a.4`` an element of an array or
            sequence (NaN, no text or NO_TIME in messages that have it not); a structure of x, y, z
            (, w) as a whole a vector; a structure of sec and nanosec as a whole a time, ns.
        start_ns, end_ns : int, optional
            Only messages with ``start_ns <= log_time < end_ns``.
        chunks : collection of int, optional
            Only the chunks that the summary's index has at these bytes.
        threads : int, optional
            One for each processor, up to four, by default.
        progress : callable, optional
            Called with the number of bytes of the file read so far.

        Raises
        ------
        SchemaError
            When messages are not what their definition says, or have no such member.
        LogError
            On a defect, when strict; otherwise defects are added to `issues`.
        """
        taker = _ColumnTaker(self, fields)
        return self._read(taker, start_ns, end_ns, threads, progress, chunks)

    def messages(
        self,
        wanted: Callable[[Channel], bool],
        *,
        start_ns: int | None = None,
        end_ns: int | None = None,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> Iterator[Messages]:
        """Yield the messages of the wanted channels as bytes; see `columns`."""
        return self._read(_MessageTaker(wanted), start_ns, end_ns, threads, progress)

    def _defect(self, issue: Issue) -> None:
        if self._strict:
            raise LogError(f"{issue.text} (byte {issue.offset})", file=self.name)
        insort(self.issues, issue, key=lambda issue: issue.offset)

    def _read(
        self,
        taker: _Taker,
        start_ns: int | None,
        end_ns: int | None,
        threads: int | None,
        progress: Callable[[int], None] | None,
        chunks: Collection[int] | None = None,
    ) -> Iterator[Any]:
        self.issues[:] = self._opening
        self.attachments.clear()
        self.metadata.clear()
        low = -(1 << 63) if start_ns is None else start_ns
        high = (1 << 63) - 1 if end_ns is None else end_ns
        windowed = not (start_ns is None and end_ns is None and chunks is None)
        # else a chunk before the window may be the one that declares a channel
        declared = self.summary is not None and bool(self.summary.channels)

        def skip(first: int, last: int, index: ChunkIndex | None) -> bool:
            if windowed and (first >= high or (last < low and declared)):
                return True
            if chunks is not None and (index is None or index.chunk_start_offset not in chunks):
                return True
            ids = index.message_index_offsets if index else {}
            return bool(ids) and not any(
                i not in self.channels or taker.wants(self.channels[i]) for i in ids
            )

        trusting = self._source.remote or windowed
        walk = Walk(self._source, self._index, self._data_end, skip, self._defect, trusting)
        work = _Work(self, walk, taker, (low, high) if windowed else None)
        data_end: tuple[int, int] | None = None
        unchecked = False

        def jobs() -> Iterator[list[Stretch]]:
            nonlocal data_end
            job: list[Stretch] = []
            for found in walk:
                if isinstance(found, Small):
                    if found.opcode == Opcode.DATA_END:
                        data_end = found.offset, int.from_bytes(found.content[:4], "little")
                    self._note(found)
                    continue
                if job and not self._joins(job, found):
                    yield job
                    job = []
                job.append(found)
            if job:
                yield job

        if threads is None:
            threads = min(4, os.cpu_count() or 1)
        with closing(_in_order(work, jobs(), threads)) as outcomes:
            for done in outcomes:
                if done.unknown:  # by now the chunks before have declared their channels
                    done = work(done.job)
                for number in sorted(done.unknown):
                    text = f"messages of channel {number}, which nothing declares, are left out"
                    self._defect(Issue(done.job[0].offset, "channel", text))
                for issue in done.issues:
                    self._defect(issue)
                for record in done.records:
                    self._note(record)
                unchecked |= done.unchecked
                if progress:
                    progress(done.job[-1].offset + done.job[-1].length)
                yield from done.results
        unsure = not self._index and not windowed and not self.issues
        if data_end and (unchecked or unsure):
            self._check_data(*data_end)

    def _joins(self, job: list[Stretch], found: Stretch) -> bool:
        """True when a stretch is still part of the same piece of work."""
        size = sum(s.size for s in job) + found.size
        if not self._source.remote:
            return size <= _JOB_BYTES
        gap = found.offset - job[-1].offset - job[-1].length
        return size <= _REMOTE_BYTES and gap <= _NEAR

    def _check_data(self, end: int, crc: int) -> None:
        """Verify messages no chunk's checksum covers by the one of the whole data section."""
        found = at = 0
        while crc and at < end:
            block = read_at(self._source, at, min(_BLOCK, end - at))
            found = zlib.crc32(block, found)
            at += len(block)
        if crc and found != crc:
            text = "the checksum of the data does not match: a value is wrong"
            self._defect(Issue(end, "checksum", text))

    def _note(self, record: Small) -> None:
        try:
            self._keep(record)
        except PARSE_ERRORS as error:
            name = Opcode(record.opcode).name.lower()
            text = f"a damaged {name} record was left out: {error}"
            self._defect(Issue(record.offset, "record", text))

    def _keep(self, record: Small) -> None:
        content = stream(record.content)
        if record.opcode == Opcode.SCHEMA:
            schema = Schema.read(content)
            self.schemas.setdefault(schema.id, schema)
        elif record.opcode == Opcode.CHANNEL:
            channel = Channel.read(content)
            self.channels.setdefault(channel.id, channel)
        elif record.opcode == Opcode.METADATA:
            self.metadata.append(Metadata.read(content))
        elif record.opcode == Opcode.HEADER:
            header = Header.read(content)
            self.profile, self.library = header.profile, header.library
        elif record.opcode == Opcode.ATTACHMENT:
            log_time, create_time = content.read8(), content.read8()
            name, media_type = content.read_prefixed_string(), content.read_prefixed_string()
            self.attachments.append(
                AttachmentIndex(
                    offset=record.offset,
                    length=record.length,
                    log_time=log_time,
                    create_time=create_time,
                    data_size=content.read8(),
                    name=name,
                    media_type=media_type,
                )
            )


def _members(channel: Channel, schema: Schema | None) -> tuple[Member, ...]:
    wanted = _FAST.get(channel.message_encoding)
    if wanted is None:
        raise SchemaError(
            f"message encoding {channel.message_encoding!r} is not read, only "
            + ", ".join(ENCODINGS)
        )
    if schema is None:
        raise SchemaError("its messages have no schema, so nothing says what they hold")
    if schema.encoding != wanted:
        raise SchemaError(f"schema encoding {schema.encoding!r} is not read, only {wanted}")
    try:
        text = schema.data.decode()
    except UnicodeDecodeError as error:
        raise SchemaError(f"schema {schema.name} is no text: {error}") from None
    return parse_definition(schema.name, text)


def _in_order(
    work: Callable[[list[Stretch]], _Done], jobs: Iterable[list[Stretch]], threads: int
) -> Generator[_Done, None, None]:
    if threads == 1:
        yield from map(work, jobs)
        return
    pool = ThreadPoolExecutor(threads)
    waiting: deque[Future[_Done]] = deque()
    try:
        for job in jobs:
            waiting.append(pool.submit(work, job))
            if len(waiting) > threads:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:  # without waiting: a reading may be given up in any thread
        pool.shutdown(wait=False, cancel_futures=True)


@dataclass
class _Work:
    """Reads, unpacks and takes the messages of some stretches of a file."""

    file: McapFile
    walk: Walk
    taker: _Taker
    window: tuple[int, int] | None
    local: threading.local = field(default_factory=threading.local)

    def __call__(self, job: list[Stretch]) -> _Done:
        done = _Done(job)
        taken = []
        for stretch, content in self._contents(job):
            records = self._unpacked(stretch, content, done)
            if records is not None:
                taken.append(self._taken(stretch, records, done))
        done.results = list(self.taker.finish(taken))
        return done

    @property
    def _space(self) -> Workspace:
        if not hasattr(self.local, "space"):
            self.local.space = Workspace()
        space: Workspace = self.local.space
        return space

    def _contents(self, job: list[Stretch]) -> Iterator[tuple[Stretch, Bytes]]:
        source = self.walk.source
        parts = [job] if source.remote else [[stretch] for stretch in job]
        for part in parts:
            start, end = part[0].offset, part[-1].offset + part[-1].length
            buffer = self._space.raw_bytes(end - start)
            count = source.read_into(start, buffer.data[: end - start])
            for stretch in part:
                at = stretch.offset - start
                yield stretch, buffer[at : min(at + stretch.length, count)]

    def _unpacked(self, stretch: Stretch, content: Bytes, done: _Done) -> Bytes | None:
        if stretch.loose:
            done.unchecked = True
            return content.copy() if self.taker.keep else content
        try:
            records, checked = unpack(content, self._space, keep=self.taker.keep, cut=stretch.cut)
            done.unchecked |= not checked
        except ValueError as error:
            kind = {Bomb: "bomb", UnknownCompression: "compression"}.get(type(error), "chunk")
            done.issues.append(
                Issue(
                    stretch.offset - RECORD.size,
                    kind,
                    f"a damaged chunk was left out: {error}",
                    self.walk.lost(stretch),
                    stretch.start_ns,
                    stretch.end_ns,
                )
            )
            return None
        return records

    def _taken(self, stretch: Stretch, records: Bytes, done: _Done) -> list[Any]:
        found = locate(records, self._space)
        if found.reached < len(records) and not stretch.cut:
            text = f"a record is longer than its chunk, {len(records) - found.reached} bytes lost"
            done.issues.append(Issue(stretch.offset - RECORD.size, "record", text))
        done.records += [
            Small(stretch.offset, opcode, content, len(content)) for opcode, content in found.others
        ]
        channels, schemas = self._declared(done.records)
        taken = []
        for group in found.groups:
            channel = channels.get(group.channel)
            if channel is None:
                done.unknown.add(group.channel)
            elif self.taker.wants(channel):
                if self.window:
                    low, high = self.window
                    _, log_time_ns, _ = group.heads()
                    inside = (log_time_ns >= low) & (log_time_ns < high)
                    if not inside.all():
                        group = group.rows(inside)
                if len(group):
                    taken.append(self.taker.take(group, channel, schemas.get(channel.schema_id)))
        return taken

    def _declared(self, records: list[Small]) -> tuple[Mapping[int, Channel], Mapping[int, Schema]]:
        """Channels and schemas known before, and those among the records."""
        if not records:
            return self.file.channels, self.file.schemas
        channels, schemas = dict(self.file.channels), dict(self.file.schemas)
        for record in records:
            with suppress(*PARSE_ERRORS):  # an issue will say so
                if record.opcode == Opcode.SCHEMA:
                    schema = Schema.read(stream(record.content))
                    schemas.setdefault(schema.id, schema)
                else:
                    channel = Channel.read(stream(record.content))
                    channels.setdefault(channel.id, channel)
        return channels, schemas


class _Piece(NamedTuple):
    topic: str
    starts: NDArray[np.int64]
    columns: list[NDArray[Any]]


class _ColumnTaker:
    keep = False

    def __init__(self, file: McapFile, fields: Mapping[str, Sequence[str]]) -> None:
        self._name = file.name
        self._fields = fields
        self._plans: dict[int, Callable[[Rows], list[NDArray[Any]]]] = {}

    def wants(self, channel: Channel) -> bool:
        return channel.topic in self._fields

    def take(self, group: Group, channel: Channel, schema: Schema | None) -> _Piece:
        try:
            plan = self._plans.get(channel.id)
            if plan is None:
                plan = self._plans[channel.id] = self._plan(channel, schema)
            parts = [(which, [*_heads(rows), *plan(rows)]) for which, rows in group.by_size()]
        except SchemaError as error:
            raise SchemaError(str(error), file=self._name, topic=channel.topic) from None
        if len(parts) == 1:
            return _Piece(channel.topic, group.starts, parts[0][1])
        columns = []
        for pieces in zip(*(columns for _, columns in parts), strict=True):
            column = np.empty((len(group), *pieces[0].shape[1:]), pieces[0].dtype)
            for (which, _), piece in zip(parts, pieces, strict=True):
                column[which] = piece
            columns.append(column)
        return _Piece(channel.topic, group.starts, columns)

    def _plan(
        self, channel: Channel, schema: Schema | None
    ) -> Callable[[Rows], list[NDArray[Any]]]:
        paths = self._fields[channel.topic]
        if not paths:  # only the times are wanted, of any encoding
            return lambda rows: []
        if channel.message_encoding in slow.SLOW_ENCODINGS:
            decode = slow.decoder(channel.message_encoding, schema)
            return lambda rows: slow.columns(decode, _texts(rows), paths)
        encapsulated = channel.message_encoding == "cdr"
        return Plan(_members(channel, schema), paths, start=HEAD, encapsulated=encapsulated).columns

    def finish(self, taken: list[list[_Piece]]) -> Iterator[Columns]:
        for topic, paths in self._fields.items():
            pieces = [
                _in_file_order(mine)
                for mine in ([p for p in part if p.topic == topic] for part in taken)
                if mine
            ]
            if pieces:
                sequence, log_time_ns, publish_time_ns, *values = map(
                    np.concatenate, zip(*pieces, strict=True)
                )
                yield Columns(
                    topic,
                    log_time_ns,
                    publish_time_ns,
                    sequence,
                    dict(zip(paths, values, strict=True)),
                )


def _heads(rows: Rows) -> tuple[NDArray[Any], ...]:
    """Sequence, log time and publish time."""
    return rows.view(2, "<u4").copy(), rows.view(6, "<i8").copy(), rows.view(14, "<i8").copy()


def _texts(rows: Rows) -> list[bytes]:
    return [rows.message(k)[HEAD:].tobytes() for k in range(rows.number)]


def _in_file_order(pieces: list[_Piece]) -> list[NDArray[Any]]:
    """Columns of one stretch; a topic may have several channels."""
    if len(pieces) == 1:
        return pieces[0].columns
    order = np.argsort(np.concatenate([p.starts for p in pieces]))
    return [
        np.concatenate(columns)[order] for columns in zip(*(p.columns for p in pieces), strict=True)
    ]


@dataclass
class _MessageTaker:
    wants: Callable[[Channel], bool]
    keep: bool = True

    def take(self, group: Group, channel: Channel, schema: Schema | None) -> Messages:
        sequence, log_time_ns, publish_time_ns = group.heads()
        sizes = np.broadcast_to(np.asarray(group.lengths, np.int64) - HEAD, len(group))
        return Messages(
            group.channel,
            log_time_ns,
            publish_time_ns,
            sequence,
            group.records,
            group.starts + HEAD,
            sizes,
        )

    def finish(self, taken: list[list[Messages]]) -> Iterator[Messages]:
        return chain.from_iterable(taken)
