"""Centred windows: the explicit Magnus series beside Picard sweeps on Gauss nodes.

Both solve the same intervals from the same Legendre coefficients of rate and force, one interval
after the other in a compiled loop. A sweep takes the derivative of attitude at the nodes and puts
it through their integration matrix; the first sweep, the integral of the rate, comes straight from
the coefficients. Attitude is a rotation vector (Bortz 1971) or a quaternion; velocity and
displacement follow from the last sweep with the weights of the nodes.

``python -c "from benchmarks.picard import picard_table; print(*picard_table(), sep='\\n')"``
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from earth._jit import formula, kernel
from earth.rotation import cross, quat_rotate, rotation_factors
from navgrade.reconstruction.centred import ORDERS, equal_weights, motion
from tests.navgrade.body import Polynomial

Array = NDArray[np.float64]
Solver = Callable[[float, Array, Array, Array], None]
DEG = np.pi / 180.0  # rad

WINDOW = 9  # samples, as in the default reconstruction
INTERVALS = 1000
ROUNDS = 31
PASSES = 4  # over the intervals in one timed run
NODES = (3, 4, 5)
SWEEPS = range(2, 7)
DEGREE = 18  # of the polynomial that stands for the true motion within one interval
# Errors below these count as equal: a million of them make 1e-9 rad and 1e-9 m/s.
ROUNDING = np.array([1e-15, 1e-15, 1e-17])  # rad, m/s, m


@formula
def weighted(w, x):
    """Return the sum of w_j x_j, x_j triples."""
    a, b, c = w[0] * x[0][0], w[0] * x[0][1], w[0] * x[0][2]
    for j in range(1, len(w)):
        a, b, c = a + w[j] * x[j][0], b + w[j] * x[j][1], c + w[j] * x[j][2]
    return a, b, c


@formula
def each(function, x, y):
    """Return function(x_j, y_j) for three, four or five nodes j."""
    first = (function(x[0], y[0]), function(x[1], y[1]), function(x[2], y[2]))
    if len(y) == 3:
        return first
    if len(y) == 4:
        return (*first, function(x[3], y[3]))
    return (*first, function(x[3], y[3]), function(x[4], y[4]))

@formula
def b1(x,y):
    return cross(x,y)
@formula
def b2(x,y):
    return x[0]+y[0],x[1],x[2]

@kernel
def go(x,y):
    z= each(b1,x,y)
    return each(b2,z,y)
