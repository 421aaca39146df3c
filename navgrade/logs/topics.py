"""What a log holds, and which of its topics is the IMU."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from navgrade.errors import LogError, SchemaError
from navgrade.logs.container import McapFile
from navgrade.logs.schemas import IMU_SCHEMAS, ImuSchema


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
    """

    name: str
    schema: str
    encoding: str
    count: int
    rate_hz: float

    def __str__(self) -> str:
        return (
            f"{self.name} ({self.schema or self.encoding}, {self.count} at {self.rate_hz:.4g} Hz)"
        )


def list_topics(path: Path) -> list[Topic]:
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
        for run in file.runs(lambda channel: True):
            counts[run.channel] = counts.get(run.channel, 0) + len(run.sizes)
            low, high = int(run.log_time_ns.min()), int(run.log_time_ns.max())
            first = low if first is None else min(first, low)
            last = high if last is None else max(last, high)
        span_ns = 0 if first is None or last is None else last - first
    topics: dict[tuple[str, str, str], int] = {}
    for number, channel in file.channels.items():
        key = (channel.topic, file.schema_name(channel), channel.message_encoding)
        topics[key] = topics.get(key, 0) + counts.get(number, 0)
    seconds = span_ns * 1e-9
    return [
        Topic(*key, count, (count - 1) / seconds if seconds > 0 and count > 1 else 0.0)
        for key, count in sorted(topics.items())
    ]


def choose_imu(path: Path, topic: str | None) -> tuple[str, ImuSchema]:
    """Return the IMU topic and its schema.

    Parameters
    ----------
    path : Path
    topic : str or None
        None takes the only IMU topic there is.

    Raises
    ------
    LogError
        When there is no such topic, no IMU topic, or more than one to choose from.
    SchemaError
        When the topic's schema or encoding is not read.
    """
    topics = list_topics(path)
    file = str(path)
    if topic is None:
        usable = [t for t in topics if t.schema in IMU_SCHEMAS and t.count]
        if not usable:
            held = "; ".join(map(str, topics)) or "no topics at all"
            raise LogError(f"no IMU topic ({_known()}); the log holds {held}", file=file)
        if len(usable) > 1:
            raise LogError(
                f"{len(usable)} IMU topics, choose one with --imu-topic or imu.topic: "
                + "; ".join(map(str, usable)),
                file=file,
            )
        chosen = usable[0]
    else:
        matches = [t for t in topics if t.name == topic]
        if not matches:
            held = "; ".join(map(str, topics)) or "no topics at all"
            raise LogError(f"no such topic; the log holds {held}", file=file, topic=topic)
        chosen = matches[0]
        if chosen.schema not in IMU_SCHEMAS:
            raise SchemaError(
                f"schema {chosen.schema or '(none)'} is not an IMU schema this program reads "
                f"({_known()})",
                file=file,
                topic=topic,
            )
    if chosen.encoding != "cdr":
        raise SchemaError(
            f"message encoding {chosen.encoding!r} is not read, only ROS 2 cdr; convert the log "
            "to ROS 2 first",
            file=file,
            topic=chosen.name,
        )
    return chosen.name, IMU_SCHEMAS[chosen.schema]


def _known() -> str:
    return "it reads " + ", ".join(IMU_SCHEMAS)
