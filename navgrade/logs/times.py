"""Messages put into the order of their time, block by block, whatever the blocks are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import LogError
from navgrade.imu import NOMINAL_SAMPLES

REORDER_NS = 1_000_000_000  # a message this much older than the newest one still finds its place
_MAX_PENDING = 1 << 20  # messages of one topic that wait for those of another
Times = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Rows:
    """Messages of a topic.

    Attributes
    ----------
    number : ndarray of int64, shape (n,)
        Of each message within its topic, from 0.
    log_ns : ndarray of int64, shape (n,)
    time_ns : ndarray of int64, shape (n,)
        On the clock of the messages.
    values : ndarray, shape (n, k)
    late_ns : ndarray of int64, shape (n,)
        How much newer a message before it in the file was; 0 where there is none.
    """

    number: NDArray[np.int64]
    log_ns: Times
    time_ns: Times
    values: NDArray[np.float64]
    late_ns: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.time_ns)

    def __getitem__(self, which: Any) -> Rows:
        return Rows(*(column[which] for column in vars(self).values()))


_NONE = np.empty(0, np.int64)
NO_ROWS = Rows(_NONE, _NONE, _NONE, np.empty((0, 0)), _NONE)


def join_rows(parts: list[Rows]) -> Rows:
    """Rows of all parts, one after the other."""
    if len(parts) < 2:
        return parts[0] if parts else NO_ROWS
    return Rows(*map(np.concatenate, zip(*(vars(part).values() for part in parts), strict=True)))


Fault = Callable[[str, Rows, int], LogError]  # what is wrong, and with which row


def least_delay_ns(time_ns: Times, log_ns: Times) -> int:
    """What to add to times of some clock to have log time: the least of the first messages."""
    return int((log_ns - time_ns)[:NOMINAL_SAMPLES].min())


class Counter:
    """A counter of time that starts again from zero."""

    def __init__(self, period_ns: int) -> None:
        self._period = period_ns
        self._last: tuple[int, int, int] | None = None

    def unwrapped(self, time_ns: Times, log_ns: Times) -> Times:
        """Times without the jumps; log time tells how often it started again in a gap."""
        raw, log, end = self._last or (int(time_ns[0]), int(log_ns[0]), int(time_ns[0]))
        step = np.diff(time_ns, prepend=raw)
        turns = np.rint((np.diff(log_ns, prepend=log) - step) / self._period).astype(np.int64)
        out: Times = end + np.cumsum(step + turns * self._period)
        self._last = int(time_ns[-1]), int(log_ns[-1]), int(out[-1])
        return out


class Sorter:
    """Puts late messages where they belong and drops those recorded twice.

    Parameters
    ----------
    fault : callable
        Makes the error for a message that is too late, or has the time of another one and
        different values.

    Attributes
    ----------
    moved, dropped : int
        How many were put back in order, and left out.
    """

    def __init__(self, fault: Fault) -> None:
        self._fault = fault
        self._held: list[Rows] = []
        self._newest: int | None = None
        self.moved = 0
        self.dropped = 0

    def push(self, rows: Rows) -> Rows:
        """Take the next messages of the file; return those nothing can come before any more."""
        if not len(rows):
            return rows
        newest = np.maximum.accumulate(rows.time_ns)
        before = np.concatenate([newest[:1], newest[:-1]])
        if self._newest is not None:
            before = np.maximum(before, self._newest)
        late_ns = before - rows.time_ns
        if late_ns.max() > REORDER_NS:
            k = int(np.argmax(late_ns > REORDER_NS))
            raise self._fault(f"steps back by {late_ns[k] * 1e-9:.6f} s", rows, k)
        self._newest = max(int(newest[-1]), int(before[-1]))
        self._held.append(replace(rows, late_ns=np.maximum(late_ns, 0)))
        return self._release(self._newest - REORDER_NS)

    def finish(self) -> Rows:
        """Return the rest, at the end of the file."""
        return self._release(None)

    def _release(self, limit_ns: int | None) -> Rows:
        """Sorted rows of times before the limit, which keeps those of equal time together."""
        held = join_rows(self._held)
        if held.late_ns.any():
            held = held[np.argsort(held.time_ns, kind="stable")]
        count = len(held)
        if limit_ns is not None:
            count = int(np.searchsorted(held.time_ns, limit_ns))
        self._held = [held[count:]] if count < len(held) else []
        return self._without_repeats(held[:count])

    def _without_repeats(self, rows: Rows) -> Rows:
        again = np.flatnonzero(np.diff(rows.time_ns) == 0) + 1
        if len(again):
            differs = (rows.values[again] != rows.values[again - 1]).any(axis=1)
            if differs.any():
                raise self._fault("repeats with other values", rows, int(again[differs][0]))
            self.dropped += len(again)
            rows = rows[np.delete(np.arange(len(rows)), again)]
        self.moved += int(np.count_nonzero(rows.late_ns))
        return rows


class Joiner:
    """Pairs the messages of two topics by equal times; both come in the order of time.

    Parameters
    ----------
    faults : (callable, callable)
        Make the error for a message of each topic that waits too long.

    Attributes
    ----------
    alone : list of int
        Messages of each topic without a partner.
    """

    def __init__(self, faults: tuple[Fault, Fault]) -> None:
        self._faults = faults
        self._pending: tuple[list[Rows], list[Rows]] = ([], [])
        self.alone = [0, 0]

    def push(self, side: int, rows: Rows) -> Rows:
        """Take messages of one topic, 0 or 1; return the pairs found, the values side by side."""
        self._pending[side].append(rows)
        ends = [parts[-1].time_ns[-1] for parts in self._pending if parts]
        pairs = self._pairs(min(ends)) if len(ends) == 2 else NO_ROWS
        waiting = self._pending[side]
        count = sum(map(len, waiting))
        if count > _MAX_PENDING:
            raise self._faults[side](
                f"no message of the other topic has its time, like {count - 1} after it: the "
                "topics are far apart in the file, or one of them ends early; cut the log there",
                waiting[0],
                0,
            )
        return pairs

    def finish(self) -> None:
        """Count what is left alone at the end of the file."""
        for side, parts in enumerate(self._pending):
            self.alone[side] += sum(map(len, parts))

    def _pairs(self, until_ns: int) -> Rows:
        """Pairs of times up to `until_ns`, after which the rest still waits."""
        first, second = (_take_until(parts, until_ns) for parts in self._pending)
        _, at_first, at_second = np.intersect1d(
            first.time_ns, second.time_ns, assume_unique=True, return_indices=True
        )
        self.alone[0] += len(first) - len(at_first)
        self.alone[1] += len(second) - len(at_second)
        first, second = first[at_first], second[at_second]
        return Rows(
            first.number,
            first.log_ns,
            first.time_ns,
            np.hstack([first.values, second.values]),
            np.maximum(first.late_ns, second.late_ns),
        )


def _take_until(parts: list[Rows], until_ns: int) -> Rows:
    """Rows of times up to `until_ns`, taken out of `parts`."""
    rows = join_rows(parts)
    count = int(np.searchsorted(rows.time_ns, until_ns, side="right"))
    parts[:] = [rows[count:]] if count < len(rows) else []
    return rows[:count]
