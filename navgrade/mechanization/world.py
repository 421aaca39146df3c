"""What every frame needs beside the increments: ellipsoid, gravity, and the vertical channel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from earth.disturbance import DisturbanceGrid
from earth.ellipsoid import WGS84, Ellipsoid, EllipsoidParams
from earth.gravity import DEFAULT, GravityField, GravityFunction, gravity_field
from navgrade.mechanization.step import BARO, FREE, HOLD, Channel
from navgrade.mechanization.terms import Terms
from navgrade.state import NavState
from navgrade.vertical import BaroLoop

Array = NDArray[np.float64]

VERTICAL = {
    "free": "unaided; diverges with a time constant of 570 s",
    "hold": "constant height",
    "baro": "third-order loop on pressure heights",
}


@dataclass(frozen=True, eq=False)
class World:
    """Surroundings of a run.

    Attributes
    ----------
    params : EllipsoidParams
    field : GravityField
    channel : Channel
    loop : BaroLoop or None
        Heights above the ellipsoid.
    terms : Terms or None
        What frame n keeps; None for all.
    """

    params: EllipsoidParams
    field: GravityField
    channel: Channel
    loop: BaroLoop | None = None
    terms: Terms | None = None

    @classmethod
    def around(
        cls,
        state: NavState,
        *,
        vertical: str | BaroLoop = "free",
        gravity: str | GravityFunction = DEFAULT,
        disturbance: GravityFunction | DisturbanceGrid | None = None,
        ellipsoid: Ellipsoid = WGS84,
        terms: Terms | None = None,
    ) -> World:
        """Make the surroundings of a run that starts at `state`.

        Raises
        ------
        ValueError
            When `vertical` is "baro": the loop needs its heights, a `BaroLoop`.
        """
        if vertical == "baro":
            raise ValueError(
                "vertical 'baro' needs pressure heights; pass vertical=navgrade.BaroLoop(t, h)"
            )
        loop = None
        if isinstance(vertical, BaroLoop):
            loop = vertical.aligned(state.t, state.h)
            channel = Channel(BARO, *loop.gains, state.h)
        else:
            mode = {"free": FREE, "hold": HOLD}[vertical]
            channel = Channel(mode, 0.0, 0.0, 0.0, state.h)
        field = gravity_field(gravity, disturbance, ellipsoid)
        return cls(ellipsoid.params, field, channel, loop, terms)

    def start_velocity(self, state: NavState) -> Array:
        """Velocity the run starts with, NED; without a vertical part where height is held."""
        v = np.array(state.v_eb_n)
        if self.channel.mode == HOLD:
            v[2] = 0.0
        return v
