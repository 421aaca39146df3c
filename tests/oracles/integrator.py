"""A naive navigator without samples: ordinary differential equations in Earth-fixed axes.

It integrates the angular rate and the specific force that a motion states at any time, and must
come back to the position that the motion states. It shares with the motions only the rates under
test and the oracle's gravity; for `Motion`, that by another route.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from tests.oracles.constants import OMEGA
from tests.oracles.gravity import gravitation_e
from tests.oracles.truth import ClosedForm

Array = NDArray[np.float64]

OMEGA_IE = np.array([0.0, 0.0, OMEGA])  # rad/s, the same in i and e


@dataclass(frozen=True)
class Pose:
    """Position (m), velocity (m/s) and attitude relative to the Earth, in its axes."""

    r_eb_e: Array
    v_eb_e: Array
    C_eb: Array


def integrate(motion: ClosedForm, start: Pose, t0: float, t1: float) -> Pose:
    """Where the rates of `motion` take a body from `start` at t0 until t1, to about 1 nm."""

    def slope(t: float, state: Array) -> Array:
        q, v, moved = state[:4], state[4:7], state[7:]
        rates = motion.rates(t)
        C_eb = Rotation.from_quat(q, scalar_first=True).as_matrix()
        r = start.r_eb_e + moved
        w = rates.omega_ib_b[0] - C_eb.T @ OMEGA_IE
        q_dot = 0.5 * np.array(
            [-q[1:] @ w, *(q[0] * w + np.cross(q[1:], w))],
        )
        v_dot = (
            C_eb @ rates.f_ib_b[0]
            + np.array(gravitation_e(*r))
            - 2.0 * np.cross(OMEGA_IE, v)
            - np.cross(OMEGA_IE, np.cross(OMEGA_IE, r))
        )
        return np.concatenate([q_dot, v_dot, v])

    q_start = Rotation.from_matrix(start.C_eb).as_quat(scalar_first=True)
    # The way from the start, not the position, is integrated: 20 km carry more digits than 6400.
    first = np.concatenate([q_start, start.v_eb_e, np.zeros(3)])
    solution = solve_ivp(slope, (t0, t1), first, method="DOP853", rtol=1e-12, atol=1e-13)
    last = solution.y[:, -1]
    return Pose(
        r_eb_e=start.r_eb_e + last[7:],
        v_eb_e=last[4:7],
        C_eb=Rotation.from_quat(last[:4], scalar_first=True).as_matrix(),
    )
