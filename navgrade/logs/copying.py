"""Topics of a log carried over to another file unchanged."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from pathlib import Path

import numpy as np

from navgrade.errors import ConfigError
from navgrade.logs.container import McapFile, Messages
from navgrade.logs.container.writer import Batch, McapWriter
from navgrade.logs.topics import list_topics

OWN = "/navgrade/"  # what the solution's topics begin with
FOREVER = np.iinfo(np.int64).max  # ns


class TopicCopy:
    """Topics of a log as batches for a file being written, in the order of log time.

    The log is read once and held a chunk at a time. Where its chunks are not in the order of
    time, neither are the batches.

    Parameters
    ----------
    path : path or URL
        Of the log.
    topics : sequence of str
    strict : bool
        Refuse a damaged log.

    Raises
    ------
    ConfigError
        When the log has no such topic, or its name is one of the solution's.
    """

    def __init__(self, path: str | Path, topics: Sequence[str], *, strict: bool = False) -> None:
        listed = list_topics(path)
        for name in topics:
            if name not in {topic.name for topic in listed}:
                held = "; ".join(map(str, listed)) or "no topics at all"
                raise ConfigError(f"no topic {name} to copy; the log holds {held}")
            if name.startswith(OWN):
                raise ConfigError(f"{name} cannot be copied: the solution's own names begin so")
        self._log = McapFile(path, strict=strict)
        self._chunks = self._read(frozenset(topics))
        self._held: list[Batch] = []
        self._numbers: dict[int, int] = {}  # of channels, there and here

    def until(self, end_ns: int, out: McapWriter) -> Iterator[list[Batch]]:
        """Yield what was logged up to a time, that time included, chunk by chunk."""
        while held := self._held or [self._batch(m, out) for m in next(self._chunks, [])]:
            due = [b for batch in held if len(b := batch[batch.log_time_ns <= end_ns])]
            self._held = [b for batch in held if len(b := batch[batch.log_time_ns > end_ns])]
            if due:
                yield due
            if self._held:
                return

    def close(self) -> None:
        """End the reading, wherever it is."""
        self._chunks.close()

    def _read(self, topics: frozenset[str]) -> Generator[list[Messages], None, None]:
        """The messages of each chunk; those of one chunk share its bytes."""
        chunk: list[Messages] = []
        for messages in self._log.messages(lambda channel: channel.topic in topics):
            if chunk and messages.data is not chunk[-1].data:
                yield chunk
                chunk = []
            chunk.append(messages)
        if chunk:
            yield chunk

    def _batch(self, messages: Messages, out: McapWriter) -> Batch:
        number = self._numbers.get(messages.channel)
        if number is None:
            channel = self._log.channels[messages.channel]
            number = out.copy_channel(channel, self._log.schemas.get(channel.schema_id))
            self._numbers[messages.channel] = number
        return Batch(
            number,
            messages.log_time_ns,
            messages.data,
            messages.publish_time_ns,
            messages.sequence,
            messages.offsets,
            messages.sizes,
        )
