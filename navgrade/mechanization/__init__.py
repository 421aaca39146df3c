"""From body increments to a solution over the Earth; one file per frame.

This stage knows nothing of sampling. A frame is one file and one line of the registry.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Protocol

from navgrade.imu import BodyIncrements
from navgrade.mechanization.cartesian import Cartesian
from navgrade.mechanization.ned import Ned
from navgrade.mechanization.wander import Wander
from navgrade.mechanization.world import VERTICAL, World
from navgrade.state import Columns, NavState, Trajectory


class Mechanizer(Protocol):
    """A state that body increments advance."""

    def advance(self, increments: BodyIncrements, room: Columns | None = None) -> Trajectory:
        """Integrate a block of increments, into `room` where given."""


class MechanizerFactory(Protocol):
    """Makes a `Mechanizer` from an initial state."""

    def __call__(self, state: NavState, world: World, epoch_ns: int = 0) -> Mechanizer:
        """Start at `state`."""


@dataclass(frozen=True)
class Mechanization:
    """One frame of the registry.

    Attributes
    ----------
    summary : str
    order : int
        Global order of the position error in the interval, given exact body increments.
    start : MechanizerFactory
    """

    summary: str
    order: int
    start: MechanizerFactory


MECHANIZATIONS: dict[str, Mechanization] = {
    "n": Mechanization("north-east-down, to latitude ±89.9°", 4, Ned),
    "e": Mechanization("Earth-fixed, everywhere", 4, partial(Cartesian, True)),
    "i": Mechanization("inertial, everywhere", 4, partial(Cartesian, False)),
    "w": Mechanization("wander azimuth, everywhere", 4, Wander),
}
DEFAULT = "n"

__all__ = ["DEFAULT", "MECHANIZATIONS", "VERTICAL", "Mechanization", "World"]
