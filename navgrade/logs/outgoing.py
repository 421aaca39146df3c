"""Topics written from columns."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from navgrade.logs.container.definitions import parse_definition
from navgrade.logs.container.layout import record_template
from navgrade.logs.container.writer import Batch, McapWriter
from navgrade.logs.messages import Schema

Columns = Mapping[str, NDArray[np.generic]]


def vector(path: str, values: NDArray[np.float64]) -> Columns:
    """Columns of the x, y and z of a member."""
    return {f"{path}.{axis}": values[:, i] for i, axis in enumerate("xyz")}


class OutTopic:
    """A topic being written; all its messages have one size.

    Parameters
    ----------
    out : McapWriter
    topic : str
    schema : Schema
    texts : mapping of str to str
        Its texts, by path.
    stamp : str
        Path of the time.
    counts : mapping of str to int, optional
        Lengths of its sequences, by path.
    metadata : mapping of str to str, optional
        Of the channel.
    """

    def __init__(
        self,
        out: McapWriter,
        topic: str,
        schema: Schema,
        texts: Mapping[str, str],
        *,
        stamp: str = "header.stamp",
        counts: Mapping[str, int] | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self._channel = out.add_channel(topic, schema, metadata=metadata)
        self._stamp = stamp
        members = parse_definition(schema.name, schema.text)
        self._dtype, self._template = record_template(members, texts, counts)

    def batch(self, stamp_ns: NDArray[np.int64], columns: Columns) -> Batch:
        """Messages of these instants with these members; all others are zero."""
        records = np.repeat(self._template, len(stamp_ns))
        seconds, nanoseconds = np.divmod(stamp_ns, 1_000_000_000)
        records[f"{self._stamp}.sec"], records[f"{self._stamp}.nanosec"] = seconds, nanoseconds
        for path, values in columns.items():
            records[path] = values
        data = records.view(np.uint8).reshape(-1, self._dtype.itemsize)
        return Batch(self._channel, stamp_ns, data)
