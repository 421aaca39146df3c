"""Running the engine on true increments."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from navgrade import ImuSamples, NavState, Trajectory, navigate
from tests.oracles.cases import AnyMotion, AnyState, true_increments
from tests.oracles.polar import PolarState
from tests.oracles.truth import Increments, quaternion, quaternion_product


def samples(increments: Increments) -> ImuSamples:
    """Oracle increments as engine input."""
    return ImuSamples(
        t=increments.t,
        dt=increments.dt,
        gyro=increments.dtheta,
        accel=increments.dvel,
        kind="increment",
    )


def state_at(motion: AnyMotion, t: float) -> NavState:
    """The true state at one instant."""
    s = motion.state(t)
    return NavState(lat=s.lat[0], lon=s.lon[0], h=s.h[0], v_eb_n=s.v_eb_n[0], q_nb=s.q_nb[0], t=t)


def fly(
    motion: AnyMotion, edges: NDArray[np.float64], context: int = 0, **choices: Any
) -> tuple[Trajectory, AnyState]:
    """Navigate a motion; return the solution and the truth.

    The first and last `context` intervals are there for windows that look around: the solution
    starts after the former and is cut before the latter.
    """
    begin, end = float(edges[context]), float(edges[-1 - context])
    nav = navigate(samples(true_increments(motion, edges)), state_at(motion, begin), **choices)
    nav = nav[: int(np.searchsorted(nav.t, end, side="right"))]
    return nav, motion.state(nav.t)


def attitude_error(nav: Trajectory, truth: AnyState) -> NDArray[np.float64]:
    """Angle between solution and truth, rad, one per row; good down to 1e-15.

    On a motion across a pole, where north means nothing, it is the angle relative to the Earth.
    """
    if isinstance(truth, PolarState):
        C_en = np.zeros_like(nav.lat), -0.5 * np.pi - nav.lat, nav.lon
        return _angle(quaternion_product(quaternion(*C_en), nav.q_nb), truth.q_eb)
    return _angle(nav.q_nb, truth.q_nb)


def _angle(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angle of the rotation from q to p, rad."""
    turn = quaternion_product(q * np.array([1.0, -1.0, -1.0, -1.0]), p)
    angle: NDArray[np.float64] = np.arctan2(np.linalg.norm(turn[:, 1:], axis=1), np.abs(turn[:, 0]))
    return 2.0 * angle
