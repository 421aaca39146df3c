"""What a log holds, and which of its topics is the IMU."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from navgrade.errors import ConfigError, LogError, SchemaError
from navgrade.logs.container import ENCODINGS, McapFile
from navgrade.logs.schemas import IMU_SCHEMAS, ImuFields, ImuSchema

DEFAULT_AXES = "FLU"  # REP-103
KIND_KEY = "imu.kind"  # in a channel's metadata: what a recorder says of its samples
AXES_KEY = "imu.axes"


@dataclass(frozen=True)
class Topic:
    """One topic of a log.

    Attributes
    ----------
    name, schema, encoding : str
    count : int
        Messages.
    rate_hz : float
        Mean rate over the log, by log time.
    metadata : dict of str to str
        What the recorder wrote down of it.
    """

    name: str
    schema: str
    encoding: str
    count: int
    rate_hz: float
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return (
            f"{self.name} ({self.schema or self.encoding}, {self.count} at {self.rate_hz:.4g} Hz)"
        )


class ImuTopic(NamedTuple):
    """Where the samples are, and what their messages hold."""

    topic: str
    encoding: str
    schema: ImuSchema


def open_known(path: str | Path, progress: Callable[[int], None] | None = None) -> McapFile:
    """Open a log and know its topics; where the summary does not list them, it is read."""
    file = McapFile(path)
    if not file.channels:
        for _ in file.messages(lambda channel: False, progress=progress):
            pass
    return file


def list_topics(path: str | Path) -> list[Topic]:
    """List a log's topics, from its summary or, where that is missing, by reading it."""
    file = McapFile(path)
    counts: dict[int, int] = {}
    span_ns = 0
    summary = file.summary
    if summary is not None and summary.statistics is not None and summary.channels:
        counts = dict(summary.statistics.channel_message_counts)
        span_ns = summary.statistics.message_end_time - summary.statistics.message_start_time
    else:
        first = last = None
        for run in file.messages(lambda channel: True):
            counts[run.channel] = counts.get(run.channel, 0) + len(run)
            low, high = int(run.log_time_ns.min()), int(run.log_time_ns.max())
            first = low if first is None else min(first, low)
            last = high if last is None else max(last, high)
        span_ns = 0 if first is None or last is None else last - first
    topics: dict[tuple[str, str, str], int] = {}
    metadata: dict[tuple[str, str, str], dict[str, str]] = {}
    for number, channel in file.channels.items():
        key = (channel.topic, file.schema_name(channel), channel.message_encoding)
        topics[key] = topics.get(key, 0) + counts.get(number, 0)
        metadata.setdefault(key, channel.metadata)
    seconds = span_ns * 1e-9
    return [
        Topic(
            *key, count, (count - 1) / seconds if seconds > 0 and count > 1 else 0.0, metadata[key]
        )
        for key, count in sorted(topics.items())
    ]


def find_topic(path: str | Path, topics: list[Topic], name: str) -> Topic:
    """Return the topic of this name.

    Raises
    ------
    LogError
        When there is none.
    SchemaError
        When its encoding is not read.
    """
    for topic in topics:
        if topic.name != name:
            continue
        if topic.encoding not in ENCODINGS:
            raise SchemaError(
                f"message encoding {topic.encoding!r} is not read, only {', '.join(ENCODINGS)}; "
                "convert the log to ROS 2 first",
                file=str(path),
                topic=name,
            )
        return topic
    held = "; ".join(map(str, topics)) or "no topics at all"
    raise LogError(f"no such topic; the log holds {held}", file=str(path), topic=name)


def choose_imu(
    path: str | Path,
    topic: str | None,
    *,
    kind: str | None = None,
    accel_topic: str | None = None,
    fields: ImuFields | None = None,
) -> ImuTopic:
    """Return the IMU topic and what its messages hold.

    Parameters
    ----------
    path : path or URL
    topic : str or None
        None takes the only IMU topic there is.
    kind : str, optional
        Of samples, where a message holds several.
    accel_topic : str, optional
        Topic of the specific forces, where they have one of their own.
    fields : ImuFields, optional
        Members to read instead of those known for the message type.

    Raises
    ------
    LogError
        When there is no such topic, no IMU topic, or more than one to choose from.
    SchemaError
        When the topic's message type or encoding is not read.
    ConfigError
        When `kind` is not what the messages hold, or a second topic is missing or too many.
    """
    topics = list_topics(path)
    if topic is None:
        if fields is not None:
            raise ConfigError("imu.fields needs the topic it is about", key="imu.topic")
        topic = _only_imu(path, topics)
    chosen = find_topic(path, topics, topic)
    if fields is not None:
        accel = find_topic(path, topics, accel_topic).schema if accel_topic else None
        return ImuTopic(topic, chosen.encoding, fields.schema(chosen.schema, accel))
    schemas = [schema for schema in IMU_SCHEMAS if schema.name == chosen.schema]
    if not schemas:
        raise SchemaError(
            f"schema {chosen.schema or '(none)'} is not an IMU schema this program reads "
            f"({_known()}); [imu.fields] can say where its samples stand",
            file=str(path),
            topic=topic,
        )
    _check_pair(path, topics, schemas[0], accel_topic)
    if kind is not None:
        fitting = [schema for schema in schemas if kind in schema.kinds]
        if not fitting:
            held = " or ".join(dict.fromkeys(k for schema in schemas for k in schema.kinds))
            raise ConfigError(f"{chosen.schema} holds {held}, not kind {kind!r}", key="imu.kind")
        schemas = fitting
    schema = as_recorded(_present(path, topic, schemas), chosen.metadata)
    return ImuTopic(topic, chosen.encoding, schema)


def as_recorded(schema: ImuSchema, metadata: Mapping[str, str]) -> ImuSchema:
    """The entry, with kind and axes where the topic's metadata tell them."""
    told = (kind for kind in schema.kinds if kind == metadata.get(KIND_KEY))
    return replace(
        schema,
        default_kind=next(told, schema.default_kind),
        axes=metadata.get(AXES_KEY, schema.axes),
    )


def usable_imus(topics: list[Topic]) -> list[Topic]:
    """Topics of IMU samples that hold some and need no second topic."""
    names = {schema.name for schema in IMU_SCHEMAS if schema.accel_name is None}
    return [topic for topic in topics if topic.schema in names and topic.count]


def _only_imu(path: str | Path, topics: list[Topic]) -> str:
    usable = usable_imus(topics)
    if not usable:
        held = "; ".join(map(str, topics)) or "no topics at all"
        raise LogError(f"no IMU topic ({_known()}); the log holds {held}", file=str(path))
    if len(usable) > 1:
        raise LogError(
            f"{len(usable)} IMU topics, choose one with --imu-topic or imu.topic: "
            + "; ".join(map(str, usable)),
            file=str(path),
        )
    return usable[0].name


def _check_pair(
    path: str | Path, topics: list[Topic], schema: ImuSchema, accel_topic: str | None
) -> None:
    """Raise unless there is a second topic exactly where the samples are in two."""
    key = "imu.accel_topic"
    if schema.accel_name is None:
        if accel_topic is not None:
            raise ConfigError(
                f"{schema.name} holds angular rate and specific force; leave {key} out", key=key
            )
        return
    if accel_topic is None:
        raise ConfigError(
            f"{schema.name} holds no specific force; name the topic of {schema.accel_name} with "
            f"{key}",
            key=key,
        )
    found = find_topic(path, topics, accel_topic)
    if found.schema != schema.accel_name:
        raise ConfigError(
            f"{accel_topic} holds {found.schema or '(no schema)'}, not {schema.accel_name}", key=key
        )


def _present(path: str | Path, topic: str, schemas: list[ImuSchema]) -> ImuSchema:
    """The first entry whose members the first messages hold; the first one where none does."""
    conditions = [schema.condition for schema in schemas]
    wanted = list(dict.fromkeys(c.path for c in conditions if c is not None))
    if len(schemas) > 1 and wanted:
        head = next(McapFile(path).columns({topic: wanted}, threads=1), None)
        for schema, condition in zip(schemas, conditions, strict=True):
            if head and (condition is None or condition.holds(head.fields[condition.path]).any()):
                return schema
    return schemas[0]


def _known() -> str:
    return "it reads " + ", ".join(dict.fromkeys(schema.name for schema in IMU_SCHEMAS))
