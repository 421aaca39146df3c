"""An update from its sums and the products of its increments, for causal and block forms alike."""

from __future__ import annotations

from earth._jit import formula
from earth.rotation import cross, rotation_factors


@formula
def update(T, theta, v, A, B, theta_last, v_last, slope):
    """Return phi, dv and dr of an update of length `T`, s, with sums `theta`, `v`.

    A x theta_last is the coning term, A and B the weighted earlier increments; `slope` is half
    the change of the force over the update, m/s (docs/equations.md, section 2).
    """
    coning = cross(A, theta_last)
    sculling_v = cross(A, v_last)
    sculling_theta = cross(B, theta_last)
    turn = cross(theta, v)
    turn2 = cross(theta, turn)
    r1, r2 = rotation_factors(theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2])
    phi = (theta[0] + coning[0], theta[1] + coning[1], theta[2] + coning[2])
    dv = (
        v[0] + r1 * turn[0] + r2 * turn2[0] + sculling_v[0] + sculling_theta[0],
        v[1] + r1 * turn[1] + r2 * turn2[1] + sculling_v[1] + sculling_theta[1],
        v[2] + r1 * turn[2] + r2 * turn2[2] + sculling_v[2] + sculling_theta[2],
    )
    dr = (
        T * (0.5 * dv[0] - (1.0 / 6.0) * (slope[0] + 0.5 * turn[0])),
        T * (0.5 * dv[1] - (1.0 / 6.0) * (slope[1] + 0.5 * turn[1])),
        T * (0.5 * dv[2] - (1.0 / 6.0) * (slope[2] + 0.5 * turn[2])),
    )
    return phi, dv, dr
