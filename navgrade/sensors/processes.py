"""Random processes and counters, sample by sample; each carries its state in place.

A process x and its integral over an interval are jointly Gaussian. Given x at both ends the
integral is ``weight * (x0 + x1)`` and an independent rest, which is what the loops add.
"""

from __future__ import annotations

import numpy as np

from earth._jit import formula, kernel

_SMALL = 0.1  # of half an interval over the correlation time: below it a series


@formula
def tanh_rest(u):
    """Return u - tanh(u) for u >= 0; the series leaves 1e-15 of it."""
    if u > _SMALL:
        return u - np.tanh(u)
    s = u * u
    return (
        u
        * s
        * (
            1.0 / 3.0
            - s
            * (
                2.0 / 15.0
                - s
                * (
                    17.0 / 315.0
                    - s * (62.0 / 2835.0 - s * (1382.0 / 155925.0 - s * (21844.0 / 6081075.0)))
                )
            )
        )
    )


@kernel
def random_walk(dt, normal, density, state, value, integral):
    """Fill value and integral (n, 3) of a Wiener process from normal (n, 2, 3)."""
    for k in range(dt.shape[0]):
        step = density * np.sqrt(dt[k])
        rest = step * dt[k] / np.sqrt(12.0)
        for i in range(3):
            x0 = state[i]
            x1 = x0 + step * normal[k, 0, i]
            value[k, i] = x1
            integral[k, i] = 0.5 * dt[k] * (x0 + x1) + rest * normal[k, 1, i]
            state[i] = x1


@kernel
def gauss_markov(dt, normal, sigma, time, state, value, integral):
    """Fill value and integral (n, 3) of a first-order Gauss-Markov process likewise."""
    for k in range(dt.shape[0]):
        u = 0.5 * dt[k] / time
        decay = np.exp(-2.0 * u)
        step = sigma * np.sqrt(-np.expm1(-4.0 * u))
        weight = time * np.tanh(u)
        rest = 2.0 * sigma * time * np.sqrt(tanh_rest(u))
        for i in range(3):
            x0 = state[i]
            x1 = decay * x0 + step * normal[k, 0, i]
            value[k, i] = x1
            integral[k, i] = weight * (x0 + x1) + rest * normal[k, 1, i]
            state[i] = x1


@kernel
def count_pulses(values, quantum, remainder):
    """Replace increments (n, 3) by whole pulses; what is left waits for the next."""
    for k in range(values.shape[0]):
        for i in range(3):
            due = remainder[i] + values[k, i]
            counted = quantum * np.rint(due / quantum)
            remainder[i] = due - counted
            values[k, i] = counted
