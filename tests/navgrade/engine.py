"""Running the engine on true increments."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from navgrade import ImuSamples, NavState, Trajectory, navigate
from tests.oracles.truth import Increments, Motion, State


def samples(increments: Increments) -> ImuSamples:
    """Oracle increments as engine input."""
    return ImuSamples(
        t=increments.t,
        dt=increments.dt,
        gyro=increments.dtheta,
        accel=increments.dvel,
        kind="increment",
    )


def state_at(motion: Motion, t: float) -> NavState:
    """The true state at one instant."""
    s = motion.state(t)
    return NavState(lat=s.lat[0], lon=s.lon[0], h=s.h[0], v_eb_n=s.v_eb_n[0], q_nb=s.q_nb[0], t=t)


def fly(
    motion: Motion, edges: NDArray[np.float64], start: int = 0, **choices: str
) -> tuple[Trajectory, State]:
    """Navigate a motion from ``edges[start]`` on; return the solution and the truth."""
    nav = navigate(
        samples(motion.increments(edges)), state_at(motion, float(edges[start])), **choices
    )
    return nav, motion.state(nav.t)


def attitude_error(nav: Trajectory, truth: State) -> NDArray[np.float64]:
    """Angle between solution and truth, rad, one per row; good down to 1e-15."""
    p, q = nav.q_nb, truth.q_nb
    w = np.einsum("ni,ni->n", p, q)
    # vector part of conj(q) * p
    v = q[:, :1] * p[:, 1:] - p[:, :1] * q[:, 1:] - np.cross(q[:, 1:], p[:, 1:])
    return 2.0 * np.arctan2(np.linalg.norm(v, axis=1), np.abs(w))
