"""What is wrong with the stamps and the sequence numbers of a topic."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navgrade.imu import MAX_MISSING, nominal_interval

_MAX_LISTED = 20
_JUMP = 10.0  # s by which steps of stamp and log time differ when a clock was set
_SECOND = 1_000_000_000  # ns
_COUNTERS = (  # ns after which stamps made from a counter start again
    1_000 << 32,  # microseconds in 32 bits
    1_000_000 << 32,  # milliseconds in 32 bits
    1 << 32,  # nanoseconds in 32 bits
    604_800 * _SECOND,  # the GPS week
)
Stamps = NDArray[np.int64]
Seconds = NDArray[np.float64]


@dataclass
class Places:
    """Where something was met.

    Attributes
    ----------
    count : int
    first : list of (float, float)
        The first twenty: s after the first stamp, and its length, s.
    """

    count: int = 0
    first: list[tuple[float, float]] = field(default_factory=list)

    def add(self, at: Seconds, length: Seconds) -> None:
        """Add places."""
        self.count += len(at)
        room = _MAX_LISTED - len(self.first)
        self.first += zip(at[:room].tolist(), length[:room].tolist(), strict=True)


def _seconds(time_ns: Stamps) -> Seconds:
    return time_ns.astype(np.float64) * 1e-9


@dataclass
class StampAudit:
    """The stamps of a topic, each against the one before and against log time.

    Attributes
    ----------
    name : str
        What they are.
    first_ns, last_ns : int
    interval : float or None
        Median of the first thousand steps, s.
    repeats : int
        Stamps equal to the one before.
    exact_repeats : int or None
        Messages among them that equal the one before in every byte; None where nobody looked.
    backward_steps, gaps : Places
        Steps back; and steps longer than three intervals, the missing time as length.
    jumps : Places
        Steps of more than 10 s that log time did not make: a clock was set.
    wraps : Places
        Steps back by just what a counter holds.
    log_minus_stamp : (float, float)
        Least and greatest log time minus stamp, s.
    """

    name: str
    first_ns: int = 0
    last_ns: int = 0
    interval: float | None = None
    repeats: int = 0
    exact_repeats: int | None = None
    backward_steps: Places = field(default_factory=Places)
    gaps: Places = field(default_factory=Places)
    jumps: Places = field(default_factory=Places)
    wraps: Places = field(default_factory=Places)
    log_minus_stamp: tuple[float, float] = (np.inf, -np.inf)
    _last: tuple[Stamps, Stamps] | None = None

    @property
    def span(self) -> float:
        """Last minus first stamp, s."""
        return (self.last_ns - self.first_ns) * 1e-9

    @property
    def is_steady(self) -> bool:
        """The clock behind them went on all the time, as far as can be seen."""
        return self.span > 0.0 and not self.jumps.count + self.wraps.count

    def report(self) -> dict[str, Any]:
        """In plain types."""
        low, high = self.log_minus_stamp
        return {
            "name": self.name,
            "first_ns": self.first_ns,
            "last_ns": self.last_ns,
            "interval_s": self.interval,
            "repeats": self.repeats,
            "exact_repeats": self.exact_repeats,
            "backward_steps": asdict(self.backward_steps),
            "gaps": asdict(self.gaps),
            "jumps": asdict(self.jumps),
            "wraps": asdict(self.wraps),
            "log_minus_stamp_s": [low, high],
        }

    def add(self, stamp_ns: Stamps, log_ns: Stamps, *, follows: bool) -> None:
        """Add messages; `follows`: none is missing between the last ones and these."""
        low, high = self.log_minus_stamp
        lag = _seconds(log_ns - stamp_ns)
        self.log_minus_stamp = (min(low, float(lag.min())), max(high, float(lag.max())))
        if self._last is None:
            self.first_ns = int(stamp_ns[0])
        elif follows:
            stamp_ns = np.concatenate([self._last[0], stamp_ns])
            log_ns = np.concatenate([self._last[1], log_ns])
        self._last = stamp_ns[-1:], log_ns[-1:]
        self.last_ns = int(stamp_ns[-1])
        if len(stamp_ns) > 1:
            at = _seconds(stamp_ns[:-1] - self.first_ns)
            self._judge(at, _seconds(np.diff(stamp_ns)), _seconds(np.diff(log_ns)))

    def _judge(self, at: Seconds, steps: Seconds, log_steps: Seconds) -> None:
        if self.interval is None:
            self.interval = nominal_interval(steps)
        wrapped = np.zeros(len(steps), bool)
        for period_ns in _COUNTERS:
            period = period_ns * 1e-9
            found = np.abs(steps + period - self.interval) <= MAX_MISSING * self.interval
            self.wraps.add(at[found], np.full(np.count_nonzero(found), period))
            wrapped |= found
        repeated = steps == 0.0
        jumped = ~wrapped & ~repeated & (np.abs(steps - log_steps) > _JUMP)
        backward = ~wrapped & ~jumped & (steps < 0.0)
        self.repeats += int(np.count_nonzero(repeated))
        self.jumps.add(at[jumped], steps[jumped])
        self.backward_steps.add(at[backward], -steps[backward])
        if self.interval > 0.0:
            wide = ~jumped & (steps > (1.0 + MAX_MISSING) * self.interval)
            self.gaps.add(at[wide], steps[wide] - self.interval)


@dataclass
class SequenceAudit:
    """The sequence numbers of a topic's messages.

    Attributes
    ----------
    skipped : int
        Numbers left out: messages that never reached the recorder.
    steps_back : int
    wraps : int
        Steps back from the last number 8, 16 or 32 bits can hold.
    """

    skipped: int = 0
    steps_back: int = 0
    wraps: int = 0
    _last: NDArray[np.int64] | None = None

    def report(self) -> dict[str, int]:
        """In plain types."""
        return {"skipped": self.skipped, "steps_back": self.steps_back, "wraps": self.wraps}

    def add(self, sequence: NDArray[np.uint32], *, follows: bool) -> None:
        """Add messages, see `StampAudit.add`."""
        numbers = sequence.astype(np.int64)
        if self._last is not None and follows:
            numbers = np.concatenate([self._last, numbers])
        self._last = numbers[-1:]
        steps = np.diff(numbers)
        wrapped = (steps < 0) & np.isin(numbers[:-1], [(1 << bits) - 1 for bits in (8, 16, 32)])
        self.wraps += int(np.count_nonzero(wrapped))
        self.steps_back += int(np.count_nonzero((steps < 0) & ~wrapped))
        self.skipped += int(np.maximum(steps - 1, 0).sum())
