"""Coning weights for any intervals.

The correction of an update is A x theta_k, A = sum_m c_m theta_{k-m}, with theta_k its last
sample. In pure coning a product of two increments depends only on their lengths and on the
distance of their middles, so the c_m follow from matching the exact coning integral of the update
as a power series in frequency (docs/equations.md, section 2). For equal intervals they are the
classical frequency coefficients, which `EQUAL_PREVIOUS` and `EQUAL_BLOCK` hold.
"""

from __future__ import annotations

import numpy as np

from earth._jit import formula, rare_formula

MOST = 4  # weights at most

# One row per number of samples before the last one, weights by distance from it.
EQUAL_PREVIOUS = np.array(  # they belong to earlier updates: causal forms
    [
        (0.0, 0.0, 0.0, 0.0),
        (1 / 12, 0.0, 0.0, 0.0),
        (7 / 60, -1 / 60, 0.0, 0.0),
        (113 / 840, -26 / 840, 3 / 840, 0.0),
        (367 / 2520, -53 / 1260, 1 / 120, -1 / 1260),
    ]
)
EQUAL_BLOCK = np.array(  # they belong to the same update: block forms
    [
        (0.0, 0.0, 0.0, 0.0),
        (2 / 3, 0.0, 0.0, 0.0),
        (27 / 20, 9 / 20, 0.0, 0.0),
        (214 / 105, 92 / 105, 54 / 105, 0.0),
    ]
)
_EQUAL = 1e-8  # relative: intervals this close count as equal; changes c_m by less than 1e-7 of it


@formula
def is_equal(dt, k):
    """Return whether interval k and the one before it are of one length."""
    return abs(dt[k] - dt[k - 1]) <= _EQUAL * dt[k]


@rare_formula
def solve_weights(dt, k, count, span, system, weights):
    """Fill the first of `weights`, c_1 ... c_count of interval k and the `count` before it.

    `span` is the length of the update, s; `system`, (MOST, MOST + 1), is scratch.
    """
    # Row n = 3, 5, ...: sum_m c_m [(d+p+q)^n + (d-p-q)^n - (d+p-q)^n - (d-p+q)^n] = T^n / 2 with
    # half lengths p, q and distance of the middles d; in units of the last interval, times 2^n.
    distance = 0.0
    for m in range(count):
        a = dt[k - 1 - m] / dt[k]
        distance += 0.5 * (a + (1.0 if m == 0 else dt[k - m] / dt[k]))
        d = 2.0 * distance
        for row in range(count):
            n = 2 * row + 3
            system[row, m] = (
                (d + a + 1.0) ** n + (d - a - 1.0) ** n - (d + a - 1.0) ** n - (d - a + 1.0) ** n
            )
    for row in range(count):
        system[row, count] = 0.5 * (2.0 * span / dt[k]) ** (2 * row + 3)
    for i in range(count):
        pivot = i
        for j in range(i + 1, count):
            if abs(system[j, i]) > abs(system[pivot, i]):
                pivot = j
        for column in range(count + 1):
            held = system[i, column]
            system[i, column] = system[pivot, column]
            system[pivot, column] = held
        for j in range(i + 1, count):
            factor = system[j, i] / system[i, i]
            for column in range(i, count + 1):
                system[j, column] -= factor * system[i, column]
    for i in range(count - 1, -1, -1):
        left = system[i, count]
        for j in range(i + 1, count):
            left -= system[i, j] * weights[j]
        weights[i] = left / system[i, i]
