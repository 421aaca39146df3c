"""Members of a topic's messages by name, whatever its schema."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import SchemaError
from navgrade.logs.container import McapFile, RawMessages
from navgrade.logs.container.cdr import Field, decode, parse_ros2msg

STAMP = ("header.stamp.sec", "header.stamp.nanosec")


def fields_of(file: McapFile, channel: int) -> tuple[Field, ...]:
    """All members of a channel's messages, by the log's own definition.

    Raises
    ------
    SchemaError
        When there is none, or it is not ``ros2msg`` or not understood.
    """
    definition = file.schemas.get(file.channels[channel].schema_id)
    if definition is None:
        raise SchemaError("its messages have no schema, so nothing says what they hold")
    if definition.encoding != "ros2msg":
        raise SchemaError(f"schema encoding {definition.encoding!r} is not read, only ros2msg")
    return parse_ros2msg(definition.name, definition.data.decode())


def records(
    file: McapFile, run: RawMessages, needed: Iterable[str]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.void]]]:
    """Yield (rows, records) of a run of messages, see `navgrade.logs.container.cdr.decode`.

    Raises
    ------
    SchemaError
        When the definition is not read, or has not all the members `needed`.
    """
    fields = fields_of(file, run.channel)
    missing = set(needed) - {f.path for f in fields}
    if missing:
        name = file.schema_name(file.channels[run.channel])
        raise SchemaError(f"the log's own {name} has no {', '.join(sorted(missing))}")
    for rows, messages in run.by_size():
        for part, found in decode(fields, messages):
            yield rows[part], found


def stamps_ns(found: NDArray[np.void]) -> NDArray[np.int64]:
    """Header stamps, Unix ns."""
    seconds, nanoseconds = (found[path] for path in STAMP)
    stamps: NDArray[np.int64] = seconds.astype(np.int64) * 1_000_000_000 + nanoseconds
    return stamps
