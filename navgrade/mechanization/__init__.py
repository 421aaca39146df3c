"""From body increments to a solution over the Earth; one file per frame.

This stage knows nothing of sampling. A frame is one file and one line of the registry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from navgrade.mechanization.cartesian import Cartesian
from navgrade.mechanization.flat import Flat
from navgrade.mechanization.frame import Frame
from navgrade.mechanization.ned import Ned
from navgrade.mechanization.terms import TERMS, Terms
from navgrade.mechanization.wander import Wander
from navgrade.mechanization.world import VERTICAL, World
from navgrade.state import NavState


@dataclass(frozen=True)
class Mechanization:
    """One frame of the registry.

    Attributes
    ----------
    summary : str
    order : int
        Global order of the position error in the interval, given exact body increments.
    start : callable
        ``start(state, world, epoch_ns)`` makes the `Frame` at a state.
    reconstruction : str, optional
        The body stage that belongs to it; without one it takes any.
    """

    summary: str
    order: int
    start: Callable[[NavState, World, int], Frame]
    reconstruction: str | None = None


MECHANIZATIONS: dict[str, Mechanization] = {
    "n": Mechanization("north-east-down, to latitude ±89.9°", 2, Ned),
    "e": Mechanization("Earth-fixed, everywhere", 2, partial(Cartesian, True)),
    "i": Mechanization("inertial, everywhere", 2, partial(Cartesian, False)),
    "w": Mechanization("wander azimuth, everywhere", 2, Wander),
}
DEFAULT = "n"

# For comparison; orders are over a flat world, where exact body increments leave nothing.
FLAT_WORLD: dict[str, Mechanization] = {
    "flat": Mechanization("flat world, attitude as a quaternion", 0, partial(Flat, False)),
    "flat-matrix": Mechanization("flat world, attitude as a matrix", 0, partial(Flat, True)),
    "flat-euler": Mechanization("flat world, Euler's step", 1, partial(Flat, False), "euler"),
    "flat-midpoint": Mechanization("flat world, midpoint", 2, partial(Flat, False), "midpoint"),
    "flat-rk4": Mechanization("flat world, Runge-Kutta", 4, partial(Flat, False), "rk4"),
}

__all__ = [
    "DEFAULT",
    "FLAT_WORLD",
    "MECHANIZATIONS",
    "TERMS",
    "VERTICAL",
    "Frame",
    "Mechanization",
    "Terms",
    "World",
]
