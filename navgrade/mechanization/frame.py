"""What the frames share outside their loops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from earth.gravity import kernel_for
from navgrade.errors import NumericalError
from navgrade.imu import BodyIncrements, Status
from navgrade.mechanization.world import World
from navgrade.state import Columns, Trajectory


class Frame:
    """A state in some frame that body increments advance.

    Parameters
    ----------
    world : World
    epoch_ns : int
        Carried into the trajectories.
    propagate : callable
        The frame's kernel: ``propagate(params, field, channel, *constants, dt, phi, dv, dr,
        heights, carry, lat, lon, h, v, q)`` steps through a block and returns the rows done.
    carry : ndarray
        What one block hands to the next, as at the start.
    constants : float or tuple
        The frame's own.
    """

    def __init__(
        self,
        world: World,
        epoch_ns: int,
        propagate: Callable[..., Any],
        carry: NDArray[np.float64],
        *constants: float | tuple[Any, ...] | None,
    ) -> None:
        self._world = world
        self._epoch_ns = epoch_ns
        self._propagate = kernel_for(propagate, world.field)
        self._carry = carry
        self._constants = constants
        self._rows = 0
        self._no_heights = np.empty(0)

    def advance(self, increments: BodyIncrements, room: Columns | None = None) -> Trajectory:
        """Integrate a block, into `room` where given; the values do not depend on block ends.

        Raises
        ------
        NumericalError
            Where the frame ends, or nothing finite is left.
        """
        n = len(increments)
        out = Columns.empty(n) if room is None else room
        status, loop = increments.status, self._world.loop
        if loop is not None:
            heights = loop.heights_at(increments.t)
            status = status | np.where(np.isnan(heights), np.uint32(Status.UNAIDED), np.uint32(0))
        else:
            if len(self._no_heights) < n:
                self._no_heights = np.full(n, np.nan)
            heights = self._no_heights[:n]
        done = self._propagate(
            self._world.params,
            self._world.field,
            self._world.channel,
            *self._constants,
            increments.dt,
            increments.phi,
            increments.dv,
            increments.dr,
            heights,
            self._carry,
            *out,
        )
        if done < n:
            raise self._stopped(float(increments.t[done]), self._rows + done)
        self._rows += n
        return Trajectory.made(increments.t, out, status, self._epoch_ns)

    def _stopped(self, t: float, row: int) -> NumericalError:
        cause = "the increments are too large to be real"
        if self._world.field.grid is not None:
            cause = "the trajectory leaves the disturbance grid; give one that covers it"
        return NumericalError(f"no finite solution at {t:.3f} s: {cause}", index=row, t=t)
