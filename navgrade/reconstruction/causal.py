"""Causal reconstruction: the current sample and up to four before it.

Coning: `coning.solve_weights`. With P samples before it the pure-coning drift falls with the
power 2 P + 2 of the frequency; for one previous sample the weight is also exact for a linear
rate.

Sculling by duality (Roscoe, J. Guidance 24 (2001) 205-209): every product theta x theta becomes
theta x v + v x theta.

Rotation. The exact factors of Savage (J. Guidance 21 (1998) 208-221, part 2) and Groves (2013),
5.84. The usual half theta x v is an acceleration error of (omega dt)^2 f / 6: 4 µg at 0.5 rad/s,
10 ms and 1 g.

Displacement: the specific force in b at the start taken as a straight line, its slope from the
last two samples and the rotation.
"""

from __future__ import annotations

import numpy as np

from earth._jit import kernel
from navgrade.imu import Status
from navgrade.reconstruction.coning import EQUAL_PREVIOUS, MOST, is_equal, solve_weights
from navgrade.reconstruction.products import update

_SHORT = np.uint32(Status.SHORT_WINDOW)


@kernel
def _reconstruct(previous, equal, short, dt, dtheta, dvel, first, phi, dv, dr, status):
    weights = np.zeros(MOST)
    system = np.empty((MOST, MOST + 1))
    even = 0  # intervals before this one, one after the other of its length
    for k in range(max(first - previous, 0) + 1, first):
        even = even + 1 if is_equal(dt, k) else 0
    of_equal = -1  # how many previous samples the weights of equal intervals in place are for
    for row in range(phi.shape[0]):
        k = first + row
        p = min(previous, k)
        if p < previous:
            status[row] |= short
        even = even + 1 if k > 0 and is_equal(dt, k) else 0
        if even < p:
            solve_weights(dt, k, p, dt[k], system, weights)
            of_equal = -1
        elif of_equal != p:
            weights[:] = equal[p]
            of_equal = p
        c1, c2, c3, c4 = weights[0], weights[1], weights[2], weights[3]
        k1, k2, k3, k4 = max(k - 1, 0), max(k - 2, 0), max(k - 3, 0), max(k - 4, 0)
        A = (
            (c1 * dtheta[k1, 0] + c2 * dtheta[k2, 0]) + (c3 * dtheta[k3, 0] + c4 * dtheta[k4, 0]),
            (c1 * dtheta[k1, 1] + c2 * dtheta[k2, 1]) + (c3 * dtheta[k3, 1] + c4 * dtheta[k4, 1]),
            (c1 * dtheta[k1, 2] + c2 * dtheta[k2, 2]) + (c3 * dtheta[k3, 2] + c4 * dtheta[k4, 2]),
        )
        B = (
            (c1 * dvel[k1, 0] + c2 * dvel[k2, 0]) + (c3 * dvel[k3, 0] + c4 * dvel[k4, 0]),
            (c1 * dvel[k1, 1] + c2 * dvel[k2, 1]) + (c3 * dvel[k3, 1] + c4 * dvel[k4, 1]),
            (c1 * dvel[k1, 2] + c2 * dvel[k2, 2]) + (c3 * dvel[k3, 2] + c4 * dvel[k4, 2]),
        )
        theta = (dtheta[k, 0], dtheta[k, 1], dtheta[k, 2])
        v = (dvel[k, 0], dvel[k, 1], dvel[k, 2])
        ratio, share = 0.0, 0.0
        if p:
            ratio = dt[k] / dt[k1]
            share = ratio / (1.0 + ratio)
        slope = (
            share * (v[0] - ratio * dvel[k1, 0]),
            share * (v[1] - ratio * dvel[k1, 1]),
            share * (v[2] - ratio * dvel[k1, 2]),
        )
        phi_k, dv_k, dr_k = update(dt[k], theta, v, A, B, theta, v, slope)
        for i in range(3):
            phi[row, i] = phi_k[i]
            dv[row, i] = dv_k[i]
            dr[row, i] = dr_k[i]


def reconstruct(previous, dt, dtheta, dvel, first, phi, dv, dr, status):
    """Fill the rows from `first` on; the rows before are context."""
    _reconstruct(previous, EQUAL_PREVIOUS, _SHORT, dt, dtheta, dvel, first, phi, dv, dr, status)
