"""From body increments to a solution over the Earth; one file per frame.

This stage knows nothing of sampling. A frame is one file and one line of the registry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from navgrade.mechanization.cartesian import Cartesian
from navgrade.mechanization.frame import Frame
from navgrade.mechanization.ned import Ned
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
    """

    summary: str
    order: int
    start: Callable[[NavState, World, int], Frame]


MECHANIZATIONS: dict[str, Mechanization] = {
    "n": Mechanization("north-east-down, to latitude ±89.9°", 2, Ned),
    "e": Mechanization("Earth-fixed, everywhere", 2, partial(Cartesian, True)),
    "i": Mechanization("inertial, everywhere", 2, partial(Cartesian, False)),
    "w": Mechanization("wander azimuth, everywhere", 2, Wander),
}
DEFAULT = "n"

__all__ = ["DEFAULT", "MECHANIZATIONS", "VERTICAL", "Frame", "Mechanization", "World"]
