"""Samples reduced to spans: means and scatter of angular rate and specific force."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from earth._jit import kernel

LEAST_LENGTH = 0.25  # s: a few spans in a door slam, some thousand in a long window
LEAST_SAMPLES = 10  # so that each span's variance is known to a third or better

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Spans:
    """Consecutive spans of equal length; those without a sample are left out.

    Attributes
    ----------
    length : float
        s. Spans lie on a grid that starts with the first sample's interval.
    end : ndarray, shape (m,)
        s, on the clock of the samples' stamps. The last span may hold less than its length.
    dt : ndarray, shape (m,)
        s of samples inside, by their own intervals: a sample belongs where its midpoint lies.
    count : ndarray of int, shape (m,)
        Samples inside.
    omega_ib_b, f_ib_b : ndarray, shape (m, 3)
        Means weighted by the intervals, rad/s and m/s^2.
    omega_var, f_var : ndarray, shape (m, 3)
        Unbiased variance of one sample about the span's mean, (rad/s)^2 and (m/s^2)^2: times
        the mean interval, the density of white noise, however the intervals vary. 0 for a
        single sample.
    """

    length: float
    end: Array
    dt: Array
    count: Integers
    omega_ib_b: Array
    f_ib_b: Array
    omega_var: Array
    f_var: Array

    @property
    def start(self) -> Array:
        """Start of each span, s."""
        return self.end - self.length

    def __len__(self) -> int:
        return len(self.end)

    def __getitem__(self, rows: slice | NDArray[Any]) -> Spans:
        return Spans(
            self.length,
            self.end[rows],
            self.dt[rows],
            self.count[rows],
            self.omega_ib_b[rows],
            self.f_ib_b[rows],
            self.omega_var[rows],
            self.f_var[rows],
        )


@kernel
def _reduce(t, dt, omega, f, origin, length, place, state, index, count, sums):
    """Write the spans that end within the samples; return how many, -1 if the time runs back.

    `place` holds the open span's index and count; `state` and each row of `sums` its time, the
    weighted means of rate and force and their weighted sums of squares about the mean (West).
    """
    rows = 0
    for k in range(t.shape[0]):
        at = np.int64(np.floor((t[k] - 0.5 * dt[k] - origin) / length))
        if at != place[0] and place[1] > 0:
            if at < place[0]:
                return -1
            index[rows] = place[0]
            count[rows] = place[1]
            for i in range(13):
                sums[rows, i] = state[i]
                state[i] = 0.0
            place[1] = 0
            rows += 1
        place[0] = at
        place[1] += 1
        state[0] += dt[k]
        share = dt[k] / state[0]
        for i in range(3):
            off = omega[k, i] - state[1 + i]
            state[1 + i] += share * off
            state[7 + i] += dt[k] * off * (omega[k, i] - state[1 + i])
            off = f[k, i] - state[4 + i]
            state[4 + i] += share * off
            state[10 + i] += dt[k] * off * (f[k, i] - state[4 + i])
    return rows


class SpanReducer:
    """Reduce a stream of samples to spans, bit for bit independent of where blocks end.

    Parameters
    ----------
    length : float
        Of a span, s; `natural_length` gives one that fits the samples.
    """

    def __init__(self, length: float) -> None:
        if not 0.0 < length < np.inf:
            raise ValueError(f"length of a span must be positive and finite, got {length} s")
        self._length = float(length)
        self._origin = np.nan
        self._place = np.zeros(2, np.int64)
        self._state = np.zeros(13)
        self._rows: list[tuple[Integers, Integers, Array]] = []

    def add(self, t: Array, dt: Array, omega_ib_b: Array, f_ib_b: Array) -> None:
        """Take the next samples: mean rates over the intervals `dt` that end at `t`.

        Parameters
        ----------
        t, dt : ndarray, shape (n,)
            s; gaps between the intervals belong to no span.
        omega_ib_b, f_ib_b : ndarray, shape (n, 3)
            rad/s and m/s^2.

        Raises
        ------
        ValueError
            When the time runs back.
        """
        if not len(t):
            return
        if np.isnan(self._origin):
            self._origin = float(t[0] - dt[0])
        ahead = (np.max(t) - self._origin) / self._length - self._place[0]
        room = int(min(len(t), max(ahead, 0.0) + 2.0))
        index, count = np.empty(room, np.int64), np.empty(room, np.int64)
        sums = np.empty((room, 13))
        rows = _reduce(
            np.ascontiguousarray(t, np.float64),
            np.ascontiguousarray(dt, np.float64),
            np.ascontiguousarray(omega_ib_b, np.float64),
            np.ascontiguousarray(f_ib_b, np.float64),
            self._origin,
            self._length,
            self._place,
            self._state,
            index,
            count,
            sums,
        )
        if rows < 0:
            raise ValueError("the samples' stamps t must not run back")
        self._rows.append((index[:rows].copy(), count[:rows].copy(), sums[:rows].copy()))

    def finish(self) -> Spans:
        """Return the spans so far, the open one included; more samples may follow."""
        held = int(self._place[1] > 0)
        open_ = (self._place[:1][:held], self._place[1:][:held], self._state[None][:held])
        index, count, sums = (np.concatenate(part) for part in zip(*self._rows, open_, strict=True))
        dt = sums[:, 0]
        # Of weighted squares about the mean: (n - 1) times the density of white noise squared
        variance = sums[:, 7:] * (count / (np.maximum(count - 1, 1) * dt))[:, None]
        return Spans(
            self._length,
            self._origin + (index + 1) * self._length,
            dt,
            count,
            sums[:, 1:4],
            sums[:, 4:7],
            variance[:, :3],
            variance[:, 3:],
        )


def natural_length(dt: Array) -> float:
    """Length of a span, s, that fits samples of intervals `dt`: 0.25 s, or ten samples."""
    return max(LEAST_LENGTH, LEAST_SAMPLES * float(np.median(dt)))


def spans_of(
    dt: Array,
    omega_ib_b: Array,
    f_ib_b: Array,
    length: float | None = None,
    t: Array | None = None,
) -> Spans:
    """Reduce arrays of samples to spans.

    Parameters
    ----------
    dt : ndarray, shape (n,)
        Intervals, s.
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        Mean rates over them, rad/s and m/s^2.
    length : float, optional
        s, by default `natural_length`.
    t : ndarray, shape (n,), optional
        Ends of the intervals, s; by default they follow each other from 0.
    """
    reducer = SpanReducer(natural_length(dt) if length is None else length)
    reducer.add(np.cumsum(dt) if t is None else t, dt, omega_ib_b, f_ib_b)
    return reducer.finish()
