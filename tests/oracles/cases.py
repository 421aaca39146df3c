"""The hour-long cases by which accuracy is claimed, and how errors are measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tests.oracles.polar import PolarMotion, PolarState, polar_flight
from tests.oracles.truth import (
    Increments,
    Motion,
    State,
    ecef,
    manoeuvre,
    static,
    turning_vehicle,
    vibrating_airliner,
    vibrating_vehicle,
)

Array = NDArray[np.float64]

CONTEXT = 8  # intervals before the start and after the end, for windows that look around
AnyMotion = Motion | PolarMotion
AnyState = State | PolarState


class Solution(Protocol):
    """Columns of a solution, whoever computed it."""

    @property
    def lat(self) -> Array: ...
    @property
    def lon(self) -> Array: ...
    @property
    def h(self) -> Array: ...


@dataclass(frozen=True)
class Claim:
    """What a reconstruction and a frame promise of a case.

    Attributes
    ----------
    reconstruction, mechanization : str
    horizontal : float
        Largest error at any time, m.
    vertical : float or None
        Likewise; None where nothing is promised.
    """

    reconstruction: str
    mechanization: str
    horizontal: float
    vertical: float | None = None


@dataclass(frozen=True)
class Case:
    """A motion, sampled, and what is claimed of it.

    Attributes
    ----------
    name, domain : str
    motion : callable
        Makes the motion.
    intervals : tuple of float
        Sample intervals, s, repeated in turn.
    claims : tuple of Claim
    duration : float
        s.
    """

    name: str
    domain: str
    motion: Callable[[], AnyMotion]
    intervals: tuple[float, ...]
    claims: tuple[Claim, ...]
    duration: float = 3600.0

    def edges(self) -> Array:
        """Ends of the intervals, s, with `CONTEXT` intervals before t = 0 and after the end."""
        period, each = float(sum(self.intervals)), len(self.intervals)
        repeats = round(self.duration / period)
        around = -(-CONTEXT // each)  # whole patterns that hold the context
        inside = np.concatenate([[0.0], np.cumsum(self.intervals)[:-1]])
        starts = np.arange(-around, repeats + around + 1) * period
        edges: Array = (starts[:, None] + inside).ravel()
        return edges[around * each - CONTEXT : (around + repeats) * each + CONTEXT + 1]


def resting_base() -> Motion:
    """A base at rest in the southern hemisphere, tilted."""
    return static(-33.7, 151.2, 40.0, 10.0, -20.0, 130.0)


CASES = (
    Case(
        "turning vehicle",
        "100 m/s, in permanent turns, banked, exact increments at 200 Hz, 1 h",
        turning_vehicle,
        (0.005,),
        (
            Claim("causal-3", "n", horizontal=1e-4, vertical=5e-3),
            Claim("centred-9", "n", horizontal=1e-5, vertical=1e-4),
        ),
    ),
    Case(
        "base at rest",
        "tilted base at latitude -33.7°, exact increments at 200 Hz, 1 h",
        resting_base,
        (0.005,),
        (
            Claim("causal-3", "n", horizontal=1e-4),
            Claim("centred-9", "n", horizontal=1e-4),
        ),
    ),
    Case(
        "vibration",
        "the turning vehicle with 10 Hz coning of 0.1° and 10 Hz vibration of 1 m/s², 200 Hz, 1 h",
        vibrating_vehicle,
        (0.005,),
        (
            Claim("causal-3", "n", horizontal=0.3),
            Claim("centred-9", "n", horizontal=5e-3),
            Claim("centred-13", "n", horizontal=1e-4),
        ),
    ),
    Case(
        "vibration, uneven intervals",
        "the same with intervals of 6 and 4 ms in turn",
        vibrating_vehicle,
        (0.006, 0.004),
        (
            Claim("causal-3", "n", horizontal=0.3),
            Claim("centred-13", "n", horizontal=1e-4),
        ),
    ),
    Case(
        "vibration, 100 Hz",
        "the same at 100 Hz: ten samples a period",
        vibrating_vehicle,
        (0.01,),
        (Claim("centred-13", "n", horizontal=0.02),),
    ),
    Case(
        "vibrating airliner",
        "230 m/s at 10 km with 20 Hz coning of 0.05° and 15 Hz sculling: 1 m/s² and 0.05°, "
        "200 Hz, 1 h",
        vibrating_airliner,
        (0.005,),
        (Claim("centred-13", "n", horizontal=0.01),),
    ),
    Case(
        "manoeuvres",
        "300 m/s, weaving, climbing and rolling to 0.19 rad/s and 16.6 m/s², 200 Hz, 1 h",
        manoeuvre,
        (0.005,),
        tuple(Claim("centred-9", frame, 1e-5, 1e-4) for frame in ("n", "e", "i", "w")),
    ),
    Case(
        "over the pole",
        "110 to 280 m/s, four times across the north pole (twice exactly), rolling and turning, "
        "200 Hz, 1 h",
        polar_flight,
        (0.005,),
        tuple(Claim("centred-9", frame, 1e-5, 1e-3) for frame in ("e", "i", "w")),
    ),
)


@lru_cache(maxsize=3)
def _increments(motion: AnyMotion, edges: bytes) -> Increments:
    increments = motion.increments(np.frombuffer(edges))
    for column in (increments.t, increments.dt, increments.dtheta, increments.dvel):
        column.setflags(write=False)
    return increments


def true_increments(motion: AnyMotion, edges: Array) -> Increments:
    """``motion.increments(edges)``; the last three are kept, for an hour takes seconds."""
    return _increments(motion, edges.tobytes())


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


def position_error(nav: Solution, truth: Solution) -> PositionError:
    """Position error in metres, also at a pole; its rounding is 3 nm.

    The horizontal part is the difference of Earth-fixed positions along the true north and east,
    which still span the horizontal plane where they have no direction of their own.
    """
    dx, dy, dz = (ecef(nav.lat, nav.lon, nav.h) - ecef(truth.lat, truth.lon, truth.h)).T
    sin_lon, cos_lon = np.sin(truth.lon), np.cos(truth.lon)
    outward = cos_lon * dx + sin_lon * dy
    return PositionError(
        north=np.cos(truth.lat) * dz - np.sin(truth.lat) * outward,
        east=cos_lon * dy - sin_lon * dx,
        up=nav.h - truth.h,
    )
