"""The hour-long cases by which accuracy is claimed, and how errors are measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tests.oracles.constants import E2, EQUATORIAL_RADIUS
from tests.oracles.truth import (
    Motion,
    State,
    static,
    turning_vehicle,
    vibrating_vehicle,
)

Array = NDArray[np.float64]

CONTEXT = 4  # intervals before the start, for windows that look back


class Solution(Protocol):
    """Columns of a solution, whoever computed it."""

    t: Array
    lat: Array
    lon: Array
    h: Array


@dataclass(frozen=True)
class Case:
    """A motion, sampled, and what is claimed of it after an hour.

    Attributes
    ----------
    name, domain : str
    motion : callable
        Makes the motion.
    intervals : tuple of float
        Sample intervals, s, repeated in turn.
    horizontal, vertical : float or None
        Largest allowed error at any time, m.
    duration : float
        s.
    """

    name: str
    domain: str
    motion: Callable[[], Motion]
    intervals: tuple[float, ...]
    horizontal: float
    vertical: float | None
    duration: float = 3600.0

    def edges(self) -> Array:
        """Ends of the intervals, s; `CONTEXT` intervals come before t = 0."""
        period = float(sum(self.intervals))
        repeats = round(self.duration / period)
        inside = np.cumsum(self.intervals)[:-1]
        starts = np.arange(-CONTEXT, repeats) * period
        edges = (starts[:, None] + np.concatenate([[0.0], inside])[None, :]).ravel()
        first = CONTEXT * len(self.intervals) - CONTEXT
        return np.append(edges[first:], repeats * period)


def resting_base() -> Motion:
    """A base at rest in the southern hemisphere, tilted."""
    return static(-33.7, 151.2, 40.0, 10.0, -20.0, 130.0)


CASES = (
    Case(
        "turning vehicle",
        "100 m/s, in permanent turns, banked, exact increments at 200 Hz, 1 h",
        turning_vehicle,
        (0.005,),
        horizontal=2e-4,
        vertical=5e-3,
    ),
    Case(
        "base at rest",
        "tilted base at latitude -33.7°, exact increments at 200 Hz, 1 h",
        resting_base,
        (0.005,),
        horizontal=1e-4,
        vertical=None,
    ),
    Case(
        "vibration",
        "the turning vehicle with 10 Hz coning of 0.1° and 10 Hz vibration of 1 m/s², 200 Hz, 1 h",
        vibrating_vehicle,
        (0.005,),
        horizontal=0.3,
        vertical=None,
    ),
    Case(
        "vibration, uneven intervals",
        "the same with intervals of 6 and 4 ms in turn",
        vibrating_vehicle,
        (0.006, 0.004),
        horizontal=20.0,
        vertical=None,
    ),
)


@dataclass(frozen=True)
class PositionError:
    """Estimate minus truth, north, east (m) and up (m), one row per instant."""

    north: Array
    east: Array
    up: Array

    @property
    def horizontal(self) -> float:
        """Largest horizontal error, m."""
        return float(np.hypot(self.north, self.east).max())

    @property
    def vertical(self) -> float:
        """Largest vertical error, m."""
        return float(np.abs(self.up).max())


def position_error(nav: Solution, truth: State) -> PositionError:
    """Position error in metres, on the radii of the true position."""
    w2 = 1.0 - E2 * np.sin(truth.lat) ** 2
    transverse = EQUATORIAL_RADIUS / np.sqrt(w2)
    meridian = transverse * (1.0 - E2) / w2
    turn = np.remainder(nav.lon - truth.lon + np.pi, 2.0 * np.pi) - np.pi
    return PositionError(
        north=(nav.lat - truth.lat) * (meridian + truth.h),
        east=turn * (transverse + truth.h) * np.cos(truth.lat),
        up=nav.h - truth.h,
    )
