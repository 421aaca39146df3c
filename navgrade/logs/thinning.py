"""Rows thinned to a rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from earth._jit import kernel

_NEAR = 0.49  # of an interval: a tick midway goes to the later row, whatever rounding says


@kernel
def _mark(t, period, carry, keep):
    """Mark the rows to keep; `carry` holds the next tick and the time of the last row, s."""
    due, last = carry
    for k in range(len(t)):
        late = t[k] - due
        keep[k] = late >= -_NEAR * (t[k] - last)
        if keep[k]:
            due = (t[k] if late >= period else due) + period
        last = t[k]
    carry[0], carry[1] = due, last


class Thinning:
    """Keeps the row nearest to each tick of a rate, and the very first of all.

    Ticks run from the first row on. The nearest row is the one whose tick comes less than half
    an interval later, so that rows which jitter about their ticks all stay. Where rows fall a
    whole period behind, in a gap or because there are fewer of them than ticks, the ticks start
    anew.
    """

    def __init__(self, rate_hz: float) -> None:
        self._period = 1.0 / rate_hz
        self._carry = np.array([-np.inf, 0.0])

    def rows(self, t: NDArray[np.float64]) -> NDArray[np.intp]:
        """Indices of the rows to keep among the next ones, whose times are `t` (s)."""
        keep = np.empty(len(t), bool)
        _mark(t, self._period, self._carry, keep)
        return np.flatnonzero(keep)
