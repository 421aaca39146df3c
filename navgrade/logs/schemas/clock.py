"""What the time of a message counts, and from when."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import SchemaError

_SECOND = 1_000_000_000  # ns
_WEEK = 604_800 * _SECOND  # ns
TIME_UNITS = {"s": _SECOND, "ms": 1_000_000, "us": 1_000, "ns": 1}  # ns


@dataclass(frozen=True)
class Clock:
    """Where the time of a message stands.

    Attributes
    ----------
    members : tuple of (str, int)
        Paths, and the length of one unit of each, ns; their sum is the time. A stamp of seconds
        and nanoseconds is one member, in ns.
    unix : bool
        It counts from 1970. Any other clock is tied to log time.
    period : int or None
        After how long the counter starts again from zero, ns.
    """

    members: tuple[tuple[str, int], ...]
    unix: bool
    period: int | None = None

    @property
    def paths(self) -> tuple[str, ...]:
        """Members to read."""
        return tuple(path for path, _ in self.members)

    @property
    def title(self) -> str:
        """How errors and notes name it."""
        return "header stamp" if self == HEADER_STAMP else f"time {self.members[-1][0]}"

    def times_ns(self, fields: Mapping[str, NDArray[Any]]) -> NDArray[np.int64]:
        """Times, ns, of columns of the members; whole numbers stay exact.

        Raises
        ------
        SchemaError
            When a member is no finite number.
        """
        total = np.zeros(len(fields[self.members[0][0]]), np.int64)
        for path, unit in self.members:
            column = fields[path]
            if column.ndim != 1 or column.dtype.kind not in "if":
                raise SchemaError(f"{path} is not a time")
            if column.dtype.kind == "f":
                if unit == 1 or not np.isfinite(column).all():
                    what = (
                        "may have a fraction of a ns"
                        if unit == 1
                        else "is not finite in all messages"
                    )
                    raise SchemaError(f"{path} {what}, so it is no time")
                column, unit = np.rint(column * unit).astype(np.int64), 1
            total += column * unit
        return total


HEADER_STAMP = Clock((("header.stamp", 1),), unix=True)


def boot_time(path: str, unit: str = "us", *, bits: int = 64) -> Clock:
    """Time since the sensor started; a counter of 32 bits starts again from zero."""
    period = None if bits == 64 else (1 << bits) * TIME_UNITS[unit]
    return Clock(((path, TIME_UNITS[unit]),), unix=False, period=period)


def gps_time(week: str, part: str, unit: str) -> Clock:
    """GPS week, and time in it."""
    return Clock(((week, _WEEK), (part, TIME_UNITS[unit])), unix=False)
