"""The integrators of robotics lectures, written down as they stand there, step by step.

World z up, gravity (0, 0, g): v' = R a - (0, 0, g). Of one sample after the other, with rotation
matrices and the exponential of a rotation vector; nothing is shared with the package.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cross_matrix(v: Array) -> Array:
    """[v x]."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def exponential(phi: Array) -> Array:
    """Rotation matrix of a rotation vector, by Rodrigues."""
    angle = float(np.linalg.norm(phi))
    K = cross_matrix(phi)
    if angle < 1e-4:  # the next terms are of the fifth power of the angle
        return np.eye(3) + (1.0 - angle**2 / 6.0) * K + (0.5 - angle**2 / 24.0) * K @ K
    half = np.sin(0.5 * angle)
    return np.eye(3) + np.sin(angle) / angle * K + 2.0 * half * half / angle**2 * K @ K


def quaternion_matrix(q: Array) -> Array:
    """R with R v = q v q*, for any q."""
    w, v = q[0], q[1:]
    return (w * w - v @ v) * np.eye(3) + 2.0 * np.outer(v, v) + 2.0 * w * cross_matrix(v)


def matrix_quaternion(R: Array) -> Array:
    """Unit quaternion of a rotation matrix, by the largest component."""
    trace = np.trace(R)
    own = np.array([trace, R[0, 0], R[1, 1], R[2, 2]])
    i = int(np.argmax(own))
    antisymmetric = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    q = np.empty(4)
    if i == 0:
        q[0], q[1:] = 1.0 + trace, antisymmetric
    else:
        a = i - 1
        q[0] = antisymmetric[a]
        q[1:] = R[a] + R[:, a]
        q[i] = 1.0 + 2.0 * R[a, a] - trace
    return q / np.linalg.norm(q)


def euler_step(
    R: Array, v: Array, p: Array, dt: float, omega: Array, a: Array, g: Array
) -> tuple[Array, Array, Array]:
    """What was felt at the start stands for the interval."""
    acceleration = R @ a - g
    return (
        R @ exponential(omega * dt),
        v + acceleration * dt,
        p + v * dt + 0.5 * acceleration * dt**2,
    )


def midpoint_step(
    R: Array, v: Array, p: Array, dt: float, omega: tuple[Array, Array], a: tuple[Array, Array],
    g: Array,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Means of what was felt at both ends."""
    R_end = R @ exponential(0.5 * (omega[0] + omega[1]) * dt)
    v_end = v + (0.5 * (R_end @ a[1] + R @ a[0]) - g) * dt
    return R_end, v_end, p + 0.5 * (v_end + v) * dt


def rk4_step(
    q: Array, v: Array, p: Array, dt: float, omega: tuple[Array, Array, Array],
    a: tuple[Array, Array, Array], g: Array,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """The classical scheme for (q, v, p), from values at start, middle and end."""

    def slope(y: Array, w: Array, f: Array) -> Array:
        turn = np.array([[0.0, *-w], *np.column_stack([w, -cross_matrix(w)])])
        return np.concatenate([0.5 * turn @ y[:4], quaternion_matrix(y[:4]) @ f - g, y[4:7]])

    y = np.concatenate([q, v, p])
    k1 = slope(y, omega[0], a[0])
    k2 = slope(y + 0.5 * dt * k1, omega[1], a[1])
    k3 = slope(y + 0.5 * dt * k2, omega[1], a[1])
    k4 = slope(y + dt * k3, omega[2], a[2])
    y = y + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return y[:4] / np.linalg.norm(y[:4]), y[4:7], y[7:]


def lagrange(t: Array, values: Array, at: float) -> Array:
    """Value at a time of the polynomial through all rows."""
    total = np.zeros(values.shape[1])
    for j in range(len(t)):
        others = np.delete(t, j)
        total += values[j] * np.prod((at - others) / (t[j] - others))
    return total


def integrate(
    method: str, t: Array, omega: Array, a: Array, R: Array, v: Array, p: Array, g: float
) -> tuple[Array, Array, Array]:
    """Integrate samples from the first one on; rows of q, v and p after each later sample.

    `method` is "euler", "midpoint", "rk4" (middle values by the cubic through the four samples
    around) or "rk4-mean" (by the mean of the ends).
    """
    gravity = np.array([0.0, 0.0, g])
    q = matrix_quaternion(R)
    rows = []
    for k in range(1, len(t)):
        dt = t[k] - t[k - 1]
        if method == "euler":
            R, v, p = euler_step(R, v, p, dt, omega[k - 1], a[k - 1], gravity)
        elif method == "midpoint":
            ends = (omega[k - 1], omega[k]), (a[k - 1], a[k])
            R, v, p = midpoint_step(R, v, p, dt, *ends, gravity)
        else:
            around = slice(k - 1, k + 1)
            if method == "rk4":
                low = min(max(k - 2, 0), len(t) - 4)
                around = slice(low, low + 4)
            middle = [lagrange(t[around], x[around], 0.5 * (t[k - 1] + t[k])) for x in (omega, a)]
            points = [(x[k - 1], m, x[k]) for x, m in zip((omega, a), middle, strict=True)]
            q, v, p = rk4_step(q, v, p, dt, *points, gravity)
        rows.append((q if method.startswith("rk4") else matrix_quaternion(R), v, p))
    qs, vs, ps = (np.array(column) for column in zip(*rows, strict=True))
    return qs, vs, ps
