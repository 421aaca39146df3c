"""Centred reconstruction: the N samples around the current one, half of them later.

Rate and specific force are the polynomial of degree N - 1 whose integrals over the N intervals
are the increments. Over the current interval it is written in Legendre polynomials,

    dt omega(s) = a_0 + a_1 P_1(2s-1) + ... + a_4 P_4(2s-1),    a_0 = theta_k,

the force likewise with b_m. Rotation, velocity and displacement obey one linear equation
X' = X M(t) with M = (omega, f, 0, 1), whose solution is the exponential of a Magnus series: all
terms to the sixth power of the interval (Blanes, Casas & Ros, BIT 40 (2000) 434-450), and of the
terms of second order, which make coning and sculling, those to the ninth. Sculling and scrolling
need no formulas of their own: they are other components of the same brackets
(docs/equations.md, section 2).

At the ends of a stretch the window moves aside; a stretch shorter than N takes all there is.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from earth._jit import formula, kernel, rare_formula
from earth.rotation import cross, rotation_factors
from navgrade.imu import Status
from navgrade.reconstruction.coning import is_equal

Array = NDArray[np.float64]

ORDERS = 4  # a_1 ... a_4
_CHUNK = 64  # rows whose coefficients are formed together; they stay in the first-level cache
_SHORT = np.uint32(Status.SHORT_WINDOW)
_SHIFTED = np.uint32(Status.SHIFTED_WINDOW)

# Slopes of P_1 ... P_4 at Gauss points of [0, 1], which integrate degree 19: 15 + 1 knots and P_4.
_x, _w = legendre.leggauss(10)
_GAUSS = 0.5 * (1.0 + _x)
_SLOPES = np.stack(
    [
        0.5 * _w * (2 * m + 1) * 2.0 * legendre.legval(_x, legendre.legder(np.eye(ORDERS + 1)[m]))
        for m in range(1, ORDERS + 1)
    ]
)


@cache
def equal_weights(window: int) -> Array:
    """Weights (ORDERS, window) of the increments in a_1 ... a_4 for equal intervals.

    In rational arithmetic, rounded once.
    """
    half = window // 2
    knots = [Fraction(j - half) for j in range(window + 1)]
    shifted = [  # P_1 ... P_4 of 2 s - 1, ascending powers of s
        [Fraction(c) for c in row]
        for row in ((-1, 2), (1, -6, 6), (-1, 12, -30, 20), (1, -20, 90, -140, 70))
    ]
    out = np.zeros((ORDERS, window))
    for m, P in enumerate(shifted, start=1):
        slope = [power * c for power, c in enumerate(P)][1:]
        # a_m / (2 m + 1) = Theta(1) - integral of Theta P_m', Theta by Lagrange on the knots
        on_knots = []
        for j, knot in enumerate(knots):
            basis = [Fraction(1)]
            for other in knots[:j] + knots[j + 1 :]:
                up, down = [Fraction(0), *basis], [-other * c for c in basis] + [Fraction(0)]
                basis = [(u + d) / (knot - other) for u, d in zip(up, down, strict=True)]
            products = (
                b * c / (i + k + 1) for i, b in enumerate(basis) for k, c in enumerate(slope)
            )
            on_knots.append(-sum(products, Fraction(0)))
        on_knots[half + 1] += 1
        for i in range(window):
            inside = on_knots[i + 1 :] if i >= half else [-x for x in on_knots[: i + 1]]
            out[m - 1, i] = float((2 * m + 1) * sum(inside))
    out.setflags(write=False)
    return out


@rare_formula
def solve_weights(dt, low, count, k, gauss, slopes, knots, inverse, weights):
    """Fill `weights` (ORDERS, count) of the increments from `low` on in a_1 ... a_4 of interval k.

    `knots` and `inverse` are scratch.
    """
    here = k - low
    knots[here] = 0.0
    for j in range(here, count):
        knots[j + 1] = knots[j] + dt[low + j] / dt[k]
    for j in range(here, 0, -1):
        knots[j - 1] = knots[j] - dt[low + j - 1] / dt[k]
    for j in range(count + 1):
        product = 1.0
        for i in range(count + 1):
            if i != j:
                product *= knots[j] - knots[i]
        inverse[j] = 1.0 / product
    orders = weights.shape[0]
    for m in range(orders):
        for i in range(count):
            weights[m, i] = 0.0
        weights[m, here] = 2.0 * m + 3.0
    for g in range(gauss.shape[0]):
        node = 1.0
        for j in range(count + 1):
            node *= gauss[g] - knots[j]
        value = 0.0
        for i in range(count - 1, here - 1, -1):
            value += node * inverse[i + 1] / (gauss[g] - knots[i + 1])
            for m in range(orders):
                weights[m, i] -= slopes[m, g] * value
        value = 0.0
        for i in range(here):
            value -= node * inverse[i] / (gauss[g] - knots[i])
            for m in range(orders):
                weights[m, i] -= slopes[m, g] * value


@formula
def bracket(x, y):
    """Return the rotation and velocity parts of [x, y], each a pair of triples."""
    turn = cross(x[0], y[0])
    xv = cross(x[0], y[1])
    yv = cross(y[0], x[1])
    return turn, (xv[0] - yv[0], xv[1] - yv[1], xv[2] - yv[2])


@formula
def combined(p, x, q, y):
    """Return p x + q y of two pairs of triples."""
    (a, b), (c, d) = x, y
    return (
        (p * a[0] + q * c[0], p * a[1] + q * c[1], p * a[2] + q * c[2]),
        (p * b[0] + q * d[0], p * b[1] + q * d[1], p * b[2] + q * d[2]),
    )


@formula
def motion(dt, e0, e1, e2, e3, e4):
    """Return phi, dv, dr of an interval from its Legendre coefficients, pairs (a_m, b_m)."""
    K = bracket(e0, e1)
    second = bracket(e1, combined(1.0 / 30.0, e2, -1.0 / 60.0, K))
    high = bracket(e3, combined(1.0 / 126.0, e4, -1.0 / 70.0, e2))
    u = combined(1.0 / 60.0, e2, -1.0 / 360.0, K)
    inner = bracket(e0, u)
    outer = bracket(e0, inner)
    log = combined(1.0, combined(1.0 / 6.0, K, 1.0, second), 1.0, combined(1.0, high, 1.0, outer))
    phi, nu = combined(1.0, e0, 1.0, log)
    b1, bi = e1[1], inner[1]
    push = cross(e1[0], b1)
    swing = cross(e0[0], b1)
    u_b = u[1]
    swung = cross(
        e0[0],
        (
            (1.0 / 360.0) * swing[0] - u_b[0],
            (1.0 / 360.0) * swing[1] - u_b[1],
            (1.0 / 360.0) * swing[2] - u_b[2],
        ),
    )
    rho = (
        (1.0 / 60.0) * push[0] - (1.0 / 6.0) * b1[0] + (swung[0] - bi[0]),
        (1.0 / 60.0) * push[1] - (1.0 / 6.0) * b1[1] + (swung[1] - bi[1]),
        (1.0 / 60.0) * push[2] - (1.0 / 6.0) * b1[2] + (swung[2] - bi[2]),
    )

    x2 = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    r1, r2 = rotation_factors(x2)
    r3 = 1.0 / 24.0 - x2 * (1.0 / 720.0 - x2 * (1.0 / 40320.0))
    turn = cross(phi, nu)
    turn2 = cross(phi, turn)
    rise = cross(phi, rho)
    rise2 = cross(phi, rise)
    dv = (
        nu[0] + (r1 * turn[0] + r2 * turn2[0]),
        nu[1] + (r1 * turn[1] + r2 * turn2[1]),
        nu[2] + (r1 * turn[2] + r2 * turn2[2]),
    )
    dr = (
        dt * (0.5 * nu[0] + r2 * turn[0] + r3 * turn2[0] + rho[0] + r1 * rise[0] + r2 * rise2[0]),
        dt * (0.5 * nu[1] + r2 * turn[1] + r3 * turn2[1] + rho[1] + r1 * rise[1] + r2 * rise2[1]),
        dt * (0.5 * nu[2] + r2 * turn[2] + r3 * turn2[2] + rho[2] + r1 * rise[2] + r2 * rise2[2]),
    )
    return phi, dv, dr


@formula
def _triples(theta, vel, column):
    return (
        (theta[column], theta[column + 1], theta[column + 2]),
        (vel[column], vel[column + 1], vel[column + 2]),
    )


@formula
def _fold(equal, x, k, size, out, column):
    """Apply equal-interval weights to `size` numbers from row `k` of `x` on.

    Weights of odd orders are odd, of even orders even, so the window folds in half.
    """
    half = equal.shape[1] // 2
    for c in range(size):
        out[0, column + c] = 0.0
        out[1, column + c] = equal[1, half] * x[3 * k + c]
        out[2, column + c] = 0.0
        out[3, column + c] = equal[3, half] * x[3 * k + c]
    for j in range(1, half + 1):
        w1, w2 = equal[0, half + j], equal[1, half + j]
        w3, w4 = equal[2, half + j], equal[3, half + j]
        later, earlier = 3 * (k + j), 3 * (k - j)
        for c in range(size):
            odd = x[later + c] - x[earlier + c]
            even = x[later + c] + x[earlier + c]
            out[0, column + c] += w1 * odd
            out[1, column + c] += w2 * even
            out[2, column + c] += w3 * odd
            out[3, column + c] += w4 * even


@kernel
def _reconstruct(window, equal, gauss, slopes, bits, dt, dtheta, dvel, first, phi, dv, dr, status):
    short, shifted = bits
    n = dt.shape[0]
    half = window // 2
    theta, vel = dtheta.ravel(), dvel.ravel()
    a, b = np.empty((ORDERS, 3 * _CHUNK)), np.empty((ORDERS, 3 * _CHUNK))
    weights = np.empty((ORDERS, window))
    knots, inverse = np.empty(window + 1), np.empty(window + 1)
    even = np.zeros(n, np.int32)  # steps up to this one without a change of interval
    for k in range(1, n):
        if is_equal(dt, k):
            even[k] = even[k - 1] + 1
    count = min(window, n)
    rows = phi.shape[0]
    for begin in range(0, rows, _CHUNK):
        end = min(begin + _CHUNK, rows)
        k0, k1 = first + begin, first + end
        last = k1 - 1 + half
        regular = k0 >= half and last < n and even[last] >= k1 - 1 - k0 + 2 * half
        if regular:
            _fold(equal, theta, k0, 3 * (end - begin), a, 0)
            _fold(equal, vel, k0, 3 * (end - begin), b, 0)
        else:
            for k in range(k0, k1):
                low = min(max(k - half, 0), n - count)
                if count < window:
                    status[k - first] |= short
                elif k - low != half:
                    status[k - first] |= shifted
                column = 3 * (k - k0)
                if count == window and k - low == half and even[k + half] >= 2 * half:
                    _fold(equal, theta, k, 3, a, column)
                    _fold(equal, vel, k, 3, b, column)
                    continue
                solve_weights(dt, low, count, k, gauss, slopes, knots, inverse, weights)
                for m in range(ORDERS):
                    for i in range(3):
                        a[m, column + i] = 0.0
                        b[m, column + i] = 0.0
                    for j in range(count):
                        for i in range(3):
                            a[m, column + i] += weights[m, j] * theta[3 * (low + j) + i]
                            b[m, column + i] += weights[m, j] * vel[3 * (low + j) + i]
        for k in range(k0, k1):
            row, column = k - first, 3 * (k - k0)
            phi_k, dv_k, dr_k = motion(
                dt[k],
                _triples(theta, vel, 3 * k),
                _triples(a[0], b[0], column),
                _triples(a[1], b[1], column),
                _triples(a[2], b[2], column),
                _triples(a[3], b[3], column),
            )
            for i in range(3):
                phi[row, i] = phi_k[i]
                dv[row, i] = dv_k[i]
                dr[row, i] = dr_k[i]


def reconstruct(window, dt, dtheta, dvel, first, phi, dv, dr, status):
    """Fill the rows from `first` on; the rows around them are context."""
    _reconstruct(
        window,
        equal_weights(window),
        _GAUSS,
        _SLOPES,
        (_SHORT, _SHIFTED),
        dt,
        dtheta,
        dvel,
        first,
        phi,
        dv,
        dr,
        status,
    )
