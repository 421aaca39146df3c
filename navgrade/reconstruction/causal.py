"""Causal reconstruction: the current sample and up to three before it.

Coning. The correction of sample k is A x theta_k with A = sum_m c_m theta_{k-m}. In pure coning
a product of two increments depends only on their lengths and on the distance of their middles,
so the c_m follow from matching the exact coning integral as a power series in frequency, for any
intervals (docs/equations.md, section 2). For equal intervals they are the classical frequency
coefficients 1/12; (7, -1)/60; (113, -26, 3)/840, whose pure-coning drift falls with the 4th, 6th
and 8th power of the frequency. For one previous sample they are also exact for a linear rate.

Sculling by duality (Roscoe, J. Guidance 24 (2001) 205-209): every product theta x theta becomes
theta x v + v x theta.

Rotation. The exact factors of Savage (J. Guidance 21 (1998) 208-221, part 2) and Groves (2013),
5.84. The usual half theta x v is an acceleration error of (omega dt)^2 f / 6: 4 µg at 0.5 rad/s,
10 ms and 1 g.
"""

from __future__ import annotations

from earth._jit import formula, kernel
from earth.rotation import cross, rotation_factors

_EQUAL = 1e-8  # relative: intervals this close count as equal; changes c_m by less than 1e-7 of it


@formula
def coning_weights(dt, k, p):
    """Return c_1, c_2, c_3 for interval k and the p <= 3 intervals before it."""
    if p == 0:
        return 0.0, 0.0, 0.0
    equal = True
    for m in range(1, p + 1):
        if abs(dt[k - m] - dt[k]) > _EQUAL * dt[k]:
            equal = False
    if equal:
        if p == 1:
            return 1.0 / 12.0, 0.0, 0.0
        if p == 2:
            return 7.0 / 60.0, -1.0 / 60.0, 0.0
        return 113.0 / 840.0, -26.0 / 840.0, 3.0 / 840.0

    # lengths in units of the current interval; d: distance of the middles
    a1 = dt[k - 1] / dt[k]
    d1 = 0.5 * (1.0 + a1)
    if p == 1:
        return 1.0 / (12.0 * a1 * d1), 0.0, 0.0
    x1, y1 = _coning_moments(a1, d1)
    a2 = dt[k - 2] / dt[k]
    d2 = d1 + 0.5 * (a1 + a2)
    x2, y2 = _coning_moments(a2, d2)
    if p == 2:
        w2 = (1.0 / 40.0 - x1 / 12.0) / (x2 - x1)
        return (1.0 / 12.0 - w2) / (a1 * d1), w2 / (a2 * d2), 0.0
    a3 = dt[k - 3] / dt[k]
    d3 = d2 + 0.5 * (a2 + a3)
    x3, y3 = _coning_moments(a3, d3)
    # w1 + w2 + w3 = 1/12, sum w x = 1/40, sum w y = 1/28
    u2, u3, ru = x2 - x1, x3 - x1, 1.0 / 40.0 - x1 / 12.0
    t2, t3, rt = y2 - y1, y3 - y1, 1.0 / 28.0 - y1 / 12.0
    det = 1.0 / (u2 * t3 - u3 * t2)
    w2 = (ru * t3 - u3 * rt) * det
    w3 = (u2 * rt - ru * t2) * det
    return (1.0 / 12.0 - w2 - w3) / (a1 * d1), w2 / (a2 * d2), w3 / (a3 * d3)


@formula
def _coning_moments(a, d):
    p2 = 0.25 * (a - 1.0) * (a - 1.0)
    q2 = 0.25 * (a + 1.0) * (a + 1.0)
    d2 = d * d
    s = p2 + q2
    return d2 + 0.5 * s, 3.0 * d2 * d2 + 5.0 * d2 * s + p2 * p2 + p2 * q2 + q2 * q2


@kernel
def reconstruct(previous, dt, dtheta, dvel, first, phi, dv):
    """Fill `phi` and `dv` for rows `first` and later; the rows before are context."""
    for k in range(first, dt.shape[0]):
        c1, c2, c3 = coning_weights(dt, k, min(previous, k))
        k1, k2, k3 = max(k - 1, 0), max(k - 2, 0), max(k - 3, 0)  # weighted 0 where not there
        A0 = c1 * dtheta[k1, 0] + c2 * dtheta[k2, 0] + c3 * dtheta[k3, 0]
        A1 = c1 * dtheta[k1, 1] + c2 * dtheta[k2, 1] + c3 * dtheta[k3, 1]
        A2 = c1 * dtheta[k1, 2] + c2 * dtheta[k2, 2] + c3 * dtheta[k3, 2]
        B0 = c1 * dvel[k1, 0] + c2 * dvel[k2, 0] + c3 * dvel[k3, 0]
        B1 = c1 * dvel[k1, 1] + c2 * dvel[k2, 1] + c3 * dvel[k3, 1]
        B2 = c1 * dvel[k1, 2] + c2 * dvel[k2, 2] + c3 * dvel[k3, 2]
        A = (A0, A1, A2)
        B = (B0, B1, B2)
        theta = (dtheta[k, 0], dtheta[k, 1], dtheta[k, 2])
        v = (dvel[k, 0], dvel[k, 1], dvel[k, 2])
        coning = cross(A, theta)
        sculling_v = cross(A, v)
        sculling_theta = cross(B, theta)
        turn = cross(theta, v)
        turn2 = cross(theta, turn)
        r1, r2 = rotation_factors(theta[0] * theta[0] + theta[1] * theta[1] + theta[2] * theta[2])
        row = k - first
        for i in range(3):
            phi[row, i] = theta[i] + coning[i]
            dv[row, i] = v[i] + r1 * turn[i] + r2 * turn2[i] + sculling_v[i] + sculling_theta[i]
