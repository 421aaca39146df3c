"""Classical block forms: N samples make one update.

For comparison with the literature. The coning weights (Miller 1983; Lee, Yoon, Jiang, Ignagni
1990) make the pure-coning drift fall with the power 2 N of the sample interval, like the causal
form with N - 1 previous samples, but the update is N times as long: in manoeuvres the neglected
triple products grow with its fifth power, so that four samples are worse than two.

Sculling by duality and the exact rotation term as in `causal`, of the sums over the block.
"""

from __future__ import annotations

import numpy as np

from earth._jit import kernel
from navgrade.reconstruction.coning import EQUAL_BLOCK, MOST, is_equal, solve_weights
from navgrade.reconstruction.products import update


@kernel
def _reconstruct(equal, samples, dt, dtheta, dvel, phi, dv, dr):
    weights = np.empty(MOST)
    system = np.empty((MOST, MOST + 1))
    for row in range(phi.shape[0]):
        begin = row * samples
        last = min(begin + samples, dt.shape[0]) - 1
        count = last - begin
        T = 0.0
        for j in range(begin, last + 1):
            T += dt[j]
        even = True
        for j in range(begin + 1, last + 1):
            even = even and is_equal(dt, j)
        if even:
            for m in range(count):
                weights[m] = equal[count, m]
        else:
            solve_weights(dt, last, count, T, system, weights)
        A0, A1, A2, B0, B1, B2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        t0, t1, t2, v0, v1, v2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        w0, w1, w2 = 0.0, 0.0, 0.0  # first moment of the force about the middle of the block
        begun, cubes = 0.0, 0.0
        for j in range(begin, last + 1):
            t0 += dtheta[j, 0]
            t1 += dtheta[j, 1]
            t2 += dtheta[j, 2]
            v0 += dvel[j, 0]
            v1 += dvel[j, 1]
            v2 += dvel[j, 2]
            arm = (2.0 * begun + dt[j]) / T - 1.0
            w0 += arm * dvel[j, 0]
            w1 += arm * dvel[j, 1]
            w2 += arm * dvel[j, 2]
            begun += dt[j]
            cubes += (dt[j] / T) ** 3
            if j < last:
                c = weights[last - 1 - j]
                A0 += c * dtheta[j, 0]
                A1 += c * dtheta[j, 1]
                A2 += c * dtheta[j, 2]
                B0 += c * dvel[j, 0]
                B1 += c * dvel[j, 1]
                B2 += c * dvel[j, 2]
        theta_last = (dtheta[last, 0], dtheta[last, 1], dtheta[last, 2])
        v_last = (dvel[last, 0], dvel[last, 1], dvel[last, 2])
        factor = 3.0 / (1.0 - cubes) if count else 0.0
        slope = (factor * w0, factor * w1, factor * w2)
        A, B = (A0, A1, A2), (B0, B1, B2)
        phi_k, dv_k, dr_k = update(T, (t0, t1, t2), (v0, v1, v2), A, B, theta_last, v_last, slope)
        for i in range(3):
            phi[row, i] = phi_k[i]
            dv[row, i] = dv_k[i]
            dr[row, i] = dr_k[i]


def reconstruct(samples, dt, dtheta, dvel, phi, dv, dr):
    """Fill one row for each `samples` samples; the last may have fewer."""
    _reconstruct(EQUAL_BLOCK, samples, dt, dtheta, dvel, phi, dv, dr)
