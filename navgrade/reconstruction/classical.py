"""Euler, midpoint and Runge-Kutta steps, which take rates at the ends of the interval.

The integrators of robotics courses, for comparison. They solve

    q' = 1/2 q omega      v' = C f      r' = v

from q = 1, v = r = 0 at the start of the interval, with omega and f known at points only:

    euler     those at the start stand for the interval
    midpoint  phi = 1/2 (omega_0 + omega_1) dt,  dv = 1/2 (f_0 + C(phi) f_1) dt,  dr = 1/2 dv dt
    rk4       the classical scheme with those at the start, the middle and the end

Gravity is constant over a flat world, and the equations look the same from every attitude, so
these steps in b followed by the frame `flat` are the courses' steps in world axes, to rounding.

No sample stands in the middle of an interval. The plain mean of its ends would make rk4 a scheme
of order 2 (docs/flat-world.md measures it); the cubic through the four points around keeps it at
4: for equal intervals (-1, 9, 9, -1)/16.

Instantaneous samples are these points as they are. From increments a point's rate is the
derivative of the polynomial through the cumulated increments of the six intervals around it: for
equal intervals (1, -8, 37, 37, -8, 1)/60. Windows move aside at the ends of a stretch.
"""

from __future__ import annotations

import numpy as np

from earth._jit import formula, kernel, rare_formula
from earth.rotation import quat_product, quat_rotate, quat_to_rotvec, rotvec_to_quat
from navgrade.imu import Status
from navgrade.reconstruction.coning import is_equal

EULER, MIDPOINT, RK4 = range(3)
AROUND = 6  # intervals whose increments make the rate at a point
NODES = 4  # points through which the middle is found

_BITS = np.uint32(Status.SHORT_WINDOW), np.uint32(Status.SHIFTED_WINDOW)
_EQUAL_SLOPE = np.array([1.0, -8.0, 37.0, 37.0, -8.0, 1.0]) / 60.0
_EQUAL_MIDDLE = np.array([-1.0, 9.0, 9.0, -1.0]) / 16.0


@rare_formula
def solve_slope(dt, low, count, point, knots, inverse, weights):
    """Fill `weights` (1/s) of the increments of `count` intervals from `low` on in a point's rate.

    The point is the start of interval `point`; `knots` and `inverse` are scratch.
    """
    knots[0] = 0.0
    for j in range(count):
        knots[j + 1] = knots[j] + dt[low + j]
    for j in range(count + 1):
        product = 1.0
        for i in range(count + 1):
            if i != j:
                product *= knots[j] - knots[i]
        inverse[j] = 1.0 / product
    here = point - low
    # an increment is in all knots after it: the slopes of their Lagrange polynomials there, summed
    # from the side without the point's own
    total = 0.0
    for j in range(count, here, -1):
        total += inverse[j] / (inverse[here] * (knots[here] - knots[j]))
        weights[j - 1] = total
    total = 0.0
    for j in range(here):
        total += inverse[j] / (inverse[here] * (knots[here] - knots[j]))
        weights[j] = -total


@rare_formula
def solve_middle(dt, low, count, k, knots, weights):
    """Fill `weights` of the `count` points from `low` on in the value amid interval k."""
    knots[0] = 0.0
    for j in range(count - 1):
        knots[j + 1] = knots[j] + dt[low + j]
    middle = knots[k - low] + 0.5 * dt[k]
    for j in range(count):
        weights[j] = 1.0
        for i in range(count):
            if i != j:
                weights[j] *= (middle - knots[i]) / (knots[j] - knots[i])


@kernel
def _point_rates(equal, dt, dtheta, dvel, begin, rates):
    """Fill rows with the angular rate and force at the starts of the intervals from `begin` on.

    The point after the last interval is its end.
    """
    n = dt.shape[0]
    knots, inverse = np.empty(AROUND + 1), np.empty(AROUND + 1)
    weights = np.empty(AROUND)
    count = min(AROUND, n)
    for row in range(rates.shape[0]):
        point = begin + row
        low = min(max(point - AROUND // 2, 0), n - count)
        even = count == AROUND and point - low == AROUND // 2
        for j in range(low + 1, low + count):
            even = even and is_equal(dt, j)
        if even:
            for j in range(count):
                weights[j] = equal[j] / dt[point]
        else:
            solve_slope(dt, low, count, point, knots, inverse, weights)
        for i in range(3):
            rates[row, i] = 0.0
            rates[row, 3 + i] = 0.0
        for j in range(count):
            for i in range(3):
                rates[row, i] += weights[j] * dtheta[low + j, i]
                rates[row, 3 + i] += weights[j] * dvel[low + j, i]


@formula
def _triples(rates, row):
    return (
        (rates[row, 0], rates[row, 1], rates[row, 2]),
        (rates[row, 3], rates[row, 4], rates[row, 5]),
    )


@formula
def euler_step(dt, omega, f):
    """Return phi, dv and dr of an interval with a rate and force that stand for all of it."""
    half = 0.5 * dt * dt
    return (
        (omega[0] * dt, omega[1] * dt, omega[2] * dt),
        (f[0] * dt, f[1] * dt, f[2] * dt),
        (half * f[0], half * f[1], half * f[2]),
    )


@formula
def midpoint_step(dt, omega_0, f_0, omega_1, f_1):
    """Return phi, dv and dr of an interval with the means of the values at its ends."""
    half = 0.5 * dt
    phi = (
        half * (omega_0[0] + omega_1[0]),
        half * (omega_0[1] + omega_1[1]),
        half * (omega_0[2] + omega_1[2]),
    )
    end = quat_rotate(rotvec_to_quat(phi), f_1)
    dv = (half * (f_0[0] + end[0]), half * (f_0[1] + end[1]), half * (f_0[2] + end[2]))
    return phi, dv, (half * dv[0], half * dv[1], half * dv[2])


@formula
def _slopes(q, omega, f):
    """Return q' and v' = C f; q q* need not be 1, C then scales with it."""
    turn = quat_product(q, (0.0, 0.5 * omega[0], 0.5 * omega[1], 0.5 * omega[2]))
    pushed = quat_product(quat_product(q, (0.0, f[0], f[1], f[2])), (q[0], -q[1], -q[2], -q[3]))
    return turn, (pushed[1], pushed[2], pushed[3])


@formula
def _moved(q, h, turn):
    return (
        q[0] + h * turn[0],
        q[1] + h * turn[1],
        q[2] + h * turn[2],
        q[3] + h * turn[3],
    )


@formula
def rk4_step(dt, omega_0, f_0, omega_m, f_m, omega_1, f_1):
    """Return phi, dv and dr of an interval by the classical Runge-Kutta scheme.

    From values at its start, middle and end. v' does not hold v, so that of the displacement
    needs no stages of its own.
    """
    q = (1.0, 0.0, 0.0, 0.0)
    turn_1, push_1 = _slopes(q, omega_0, f_0)
    turn_2, push_2 = _slopes(_moved(q, 0.5 * dt, turn_1), omega_m, f_m)
    turn_3, push_3 = _slopes(_moved(q, 0.5 * dt, turn_2), omega_m, f_m)
    turn_4, push_4 = _slopes(_moved(q, dt, turn_3), omega_1, f_1)
    sixth = dt * (1.0 / 6.0)
    q = (
        1.0 + sixth * (turn_1[0] + 2.0 * (turn_2[0] + turn_3[0]) + turn_4[0]),
        sixth * (turn_1[1] + 2.0 * (turn_2[1] + turn_3[1]) + turn_4[1]),
        sixth * (turn_1[2] + 2.0 * (turn_2[2] + turn_3[2]) + turn_4[2]),
        sixth * (turn_1[3] + 2.0 * (turn_2[3] + turn_3[3]) + turn_4[3]),
    )
    dv = (
        sixth * (push_1[0] + 2.0 * (push_2[0] + push_3[0]) + push_4[0]),
        sixth * (push_1[1] + 2.0 * (push_2[1] + push_3[1]) + push_4[1]),
        sixth * (push_1[2] + 2.0 * (push_2[2] + push_3[2]) + push_4[2]),
    )
    dr = (
        dt * sixth * (push_1[0] + push_2[0] + push_3[0]),
        dt * sixth * (push_1[1] + push_2[1] + push_3[1]),
        dt * sixth * (push_1[2] + push_2[2] + push_3[2]),
    )
    return quat_to_rotvec(q), dv, dr


@kernel
def _integrate(method, equal, dt, begin, rates, least, first, phi, dv, dr):
    """Step through the rows from `first` on; row 0 of `rates` is the start of interval `begin`.

    There is no point before `least`; an interval that starts earlier has the rate of its end.
    """
    n = dt.shape[0]
    knots, weights, middle = np.empty(NODES), np.empty(NODES), np.empty((1, 6))
    count = min(NODES, n + 1 - least)
    for row in range(phi.shape[0]):
        k = first + row
        omega_0, f_0 = _triples(rates, max(k, least) - begin)
        if method == EULER:
            phi_k, dv_k, dr_k = euler_step(dt[k], omega_0, f_0)
        else:
            omega_1, f_1 = _triples(rates, k + 1 - begin)
            if method == MIDPOINT:
                phi_k, dv_k, dr_k = midpoint_step(dt[k], omega_0, f_0, omega_1, f_1)
            else:
                middle[0] = rates[k + 1 - begin]
                if k >= least:
                    low = min(max(k - 1, least), n + 1 - count)
                    even = count == NODES and k - low == 1
                    if even and is_equal(dt, k) and is_equal(dt, k + 1):
                        weights[:] = equal
                    else:
                        solve_middle(dt, low, count, k, knots, weights)
                    for i in range(6):
                        middle[0, i] = 0.0
                        for j in range(count):
                            middle[0, i] += weights[j] * rates[low + j - begin, i]
                omega_m, f_m = _triples(middle, 0)
                phi_k, dv_k, dr_k = rk4_step(dt[k], omega_0, f_0, omega_m, f_m, omega_1, f_1)
        for i in range(3):
            phi[row, i] = phi_k[i]
            dv[row, i] = dv_k[i]
            dr[row, i] = dr_k[i]


def from_increments(method, dt, dtheta, dvel, first, phi, dv, dr, status):
    """Fill the rows from `first` on; the rows around them are context."""
    n, rows = len(dt), len(phi)
    begin = max(first - 2, 0)
    rates = np.empty((min(first + rows + 2, n) + 1 - begin, 6))
    _point_rates(_EQUAL_SLOPE, dt, dtheta, dvel, begin, rates)
    _integrate(method, _EQUAL_MIDDLE, dt, begin, rates, 0, first, phi, dv, dr)
    short, shifted = _BITS
    if n < AROUND:
        status |= short
        return
    k = np.arange(first, first + rows)
    before = AROUND // 2 + (method == RK4)
    after = AROUND // 2 - 1 + method  # points after the start that the method takes
    status[(k < before) | (k + after >= n)] |= shifted


def from_rates(method, dt, omega, f, first, phi, dv, dr, status):
    """Fill the rows from `first` on from samples at the ends of the intervals."""
    rates = np.concatenate([omega, f], axis=1)
    _integrate(method, _EQUAL_MIDDLE, dt, 1, rates, 1, first, phi, dv, dr)
    short, shifted = _BITS
    k = np.arange(first, first + len(phi))
    few = method == RK4 and len(dt) < NODES
    status[(k < 1) | few] |= short
    if method == RK4 and not few:
        status[(k == 1) | ((k > 0) & (k + 1 >= len(dt)))] |= shifted
