"""One correction of the body stage taken out of any algorithm, to see what it is worth.

The raw sums theta and v of an update's increments say what a correction is:

    coning    phi - theta
    rotation  a1 theta x v + a2 theta x (theta x v), exact for a constant rate and force
    sculling  dv - v - rotation

Half the interval times what is taken from dv is taken from dr.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from earth._jit import kernel
from earth.rotation import cross, rotation_factors
from navgrade.reconstruction.stream import BlockForm, Reconstruction

BODY_TERMS = {
    "coning": "turns of the rate within an interval",
    "sculling": "turns and changes of the force within an interval that go together",
    "rotation": "the turn of the force by the mean rate of an interval",
}
_CONING, _SCULLING, _ROTATION = range(len(BODY_TERMS))  # positions there


@kernel
def _take_out(term, dt, dtheta, dvel, phi, dv, dr):
    for k in range(phi.shape[0]):
        theta = (dtheta[k, 0], dtheta[k, 1], dtheta[k, 2])
        v = (dvel[k, 0], dvel[k, 1], dvel[k, 2])
        turn = cross(theta, v)
        turn2 = cross(theta, turn)
        a1, a2 = rotation_factors(theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2])
        for i in range(3):
            if term == _CONING:
                phi[k, i] = theta[i]
                continue
            removed = a1 * turn[i] + a2 * turn2[i]
            if term == _SCULLING:
                removed = dv[k, i] - v[i] - removed
            dv[k, i] -= removed
            dr[k, i] -= 0.5 * dt[k] * removed


def without_body_term(chosen: Reconstruction | BlockForm, term: str) -> Reconstruction | BlockForm:
    """Return an algorithm of the registry with one of `BODY_TERMS` taken out of its rows."""
    number = list(BODY_TERMS).index(term)
    if isinstance(chosen, BlockForm):
        whole, samples = chosen.loop, chosen.samples

        def of_blocks(dt, dtheta, dvel, phi, dv, dr):
            whole(dt, dtheta, dvel, phi, dv, dr)
            starts = np.arange(0, len(dt), samples)
            T, theta, v = (np.add.reduceat(x, starts) for x in (dt, dtheta, dvel))
            _take_out(number, T, theta, v, phi, dv, dr)

        return replace(chosen, loop=of_blocks)
    each = chosen.loop

    def of_samples(dt, dtheta, dvel, first, phi, dv, dr, status):
        each(dt, dtheta, dvel, first, phi, dv, dr, status)
        rows = slice(first, first + len(phi))
        _take_out(number, dt[rows], dtheta[rows], dvel[rows], phi, dv, dr)

    return replace(chosen, loop=of_samples)
