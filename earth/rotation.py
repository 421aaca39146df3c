"""Rotations: rotation vector, unit quaternion, direction cosine matrix, Euler angles ZYX.

Quaternions are scalar first, Hamilton, and named like matrices: ``q_nb`` carries vectors from b
to n, ``v_n = C_nb @ v_b``, and ``q_nb = q_ne * q_eb``. Euler angles turn n into b about z
(heading), then y (pitch), then x (roll), so ``C_nb = Rz(heading) Ry(pitch) Rx(roll)``.

Every function holds at every attitude. At pitch ±90° heading and roll turn about the same axis;
the pair returned still gives back the attitude to rounding. Lower-case formulas on scalars serve
the compiled loops, the functions on arrays of rows call them.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from earth._jit import formula, kernel

_TINY = 1e-8  # rad^2: below it two terms
_SMALL = 0.03  # rad^2: below it series; the first neglected terms are under 1e-17


@formula
def cross(a, b):
    """Return a x b of two triples."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@formula
def quat_product(p, q):
    """Return the Hamilton product p * q."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@formula
def quat_rotate(q, v):
    """Return C v for the C of the unit quaternion q."""
    t = cross((q[1], q[2], q[3]), v)
    u = cross((q[1], q[2], q[3]), t)
    return (
        v[0] + 2.0 * (q[0] * t[0] + u[0]),
        v[1] + 2.0 * (q[0] * t[1] + u[1]),
        v[2] + 2.0 * (q[0] * t[2] + u[2]),
    )


@formula
def rotvec_to_quat_change(phi):
    """Return q - 1 of a rotation vector, any length: small turns keep all their digits."""
    x2 = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    y = 0.25 * x2
    if x2 < _TINY:
        w = -0.5 * y
        s = 0.5 - y * (1.0 / 12.0)
    else:
        # halved until the series holds, then doubled: in a loop a call would cost every turn,
        # for the registers it claims, even where it is never reached
        halvings = 0
        while _SMALL <= 4.0 * y < np.inf:
            y *= 0.25
            halvings += 1
        w = -y * (0.5 - y * (1.0 / 24.0 - y * (1.0 / 720.0 - y * (1.0 / 40320.0))))
        s = 0.5 - y * (1.0 / 12.0 - y * (1.0 / 240.0 - y * (1.0 / 10080.0 - y * (1.0 / 725760.0))))
        for _ in range(halvings):
            s *= 1.0 + w
            w *= 2.0 * (2.0 + w)
    return w, s * phi[0], s * phi[1], s * phi[2]


@formula
def rotvec_to_quat(phi):
    """Return the quaternion of a rotation vector, any length."""
    w, x, y, z = rotvec_to_quat_change(phi)
    return 1.0 + w, x, y, z


@formula
def rotation_factors(x2):
    """Return (1 - cos x)/x^2 and (1 - sin(x)/x)/x^2 for x^2."""
    if x2 < _SMALL:
        a = 0.5 - x2 * (
            1.0 / 24.0
            - x2
            * (
                1.0 / 720.0
                - x2 * (1.0 / 40320.0 - x2 * (1.0 / 3628800.0 - x2 * (1.0 / 479001600.0)))
            )
        )
        b = 1.0 / 6.0 - x2 * (
            1.0 / 120.0 - x2 * (1.0 / 5040.0 - x2 * (1.0 / 362880.0 - x2 * (1.0 / 39916800.0)))
        )
    else:
        x = np.sqrt(x2)
        a = 2.0 * np.sin(0.5 * x) ** 2 / x2
        b = (1.0 - np.sin(x) / x) / x2
    return a, b


@formula
def quat_to_rotvec(q):
    """Return the shortest rotation vector of a unit quaternion, |phi| <= pi."""
    sine = np.sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if sine < 1e-8:
        k = 2.0 / q[0]
    else:
        k = 2.0 * np.arctan2(np.copysign(sine, q[0]), abs(q[0])) / sine
    return k * q[1], k * q[2], k * q[3]


@formula
def quat_to_dcm(q):
    """Return the nine elements, row by row, of the matrix of a unit quaternion."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    return (
        w * w + x * x - y * y - z * z,
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        w * w - x * x + y * y - z * z,
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        w * w - x * x - y * y + z * z,
    )


@formula
def dcm_to_quat(C):
    """Return the unit quaternion, scalar part >= 0, of nine elements row by row.

    Shepperd's choice of the largest component (J. Guidance and Control 1 (1978) 223-224).
    """
    trace = C[0] + C[4] + C[8]
    if trace >= C[0] and trace >= C[4] and trace >= C[8]:
        q = (1.0 + trace, C[7] - C[5], C[2] - C[6], C[3] - C[1])
    elif C[0] >= C[4] and C[0] >= C[8]:
        q = (C[7] - C[5], 1.0 + C[0] - C[4] - C[8], C[1] + C[3], C[2] + C[6])
    elif C[4] >= C[8]:
        q = (C[2] - C[6], C[1] + C[3], 1.0 - C[0] + C[4] - C[8], C[5] + C[7])
    else:
        q = (C[3] - C[1], C[2] + C[6], C[5] + C[7], 1.0 - C[0] - C[4] + C[8])
    k = 1.0 / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if q[0] < 0.0:
        k = -k
    return k * q[0], k * q[1], k * q[2], k * q[3]


@formula
def euler_to_quat(euler):
    """Return q_nb of (roll, pitch, heading)."""
    cr, sr = np.cos(0.5 * euler[0]), np.sin(0.5 * euler[0])
    cp, sp = np.cos(0.5 * euler[1]), np.sin(0.5 * euler[1])
    ch, sh = np.cos(0.5 * euler[2]), np.sin(0.5 * euler[2])
    return (
        cr * cp * ch + sr * sp * sh,
        sr * cp * ch - cr * sp * sh,
        cr * sp * ch + sr * cp * sh,
        cr * cp * sh - sr * sp * ch,
    )


@formula
def quat_to_euler(q):
    """Return (roll, pitch, heading): ±pi, ±pi/2, ±pi.

    Half sum and half difference of the outer angles come from two arctangents that do not lose
    digits near pitch ±90° (after Bernardes & Viollet, PLoS ONE 17 (2022) e0276302).
    """
    a, b, c, d = q[0] - q[2], q[1] + q[3], q[2] + q[0], q[3] - q[1]
    pitch = 2.0 * np.arctan2(np.hypot(c, d), np.hypot(a, b)) - 0.5 * np.pi
    half_sum = np.arctan2(b, a)
    half_difference = np.arctan2(d, c)
    roll = half_sum - half_difference
    heading = half_sum + half_difference
    two_pi = 2.0 * np.pi
    roll -= two_pi * np.rint(roll / two_pi)
    heading -= two_pi * np.rint(heading / two_pi)
    return roll, pitch, heading


@kernel
def _rotvecs_to_quats(rows, out):
    for k in range(rows.shape[0]):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = rotvec_to_quat(rows[k])


@kernel
def _quats_to_rotvecs(rows, out):
    for k in range(rows.shape[0]):
        out[k, 0], out[k, 1], out[k, 2] = quat_to_rotvec(rows[k])


@kernel
def _quats_to_dcms(rows, out):
    for k in range(rows.shape[0]):
        C = quat_to_dcm(rows[k])
        for i in range(9):
            out[k, i] = C[i]


@kernel
def _dcms_to_quats(rows, out):
    for k in range(rows.shape[0]):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = dcm_to_quat(rows[k])


@kernel
def _eulers_to_quats(rows, out):
    for k in range(rows.shape[0]):
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = euler_to_quat(rows[k])


@kernel
def _quats_to_eulers(rows, out):
    for k in range(rows.shape[0]):
        out[k, 0], out[k, 1], out[k, 2] = quat_to_euler(rows[k])


Rows = NDArray[np.float64]


def _by_rows(loop: Callable[[Rows, Rows], None], rows: Rows, width: int) -> Rows:
    flat = np.ascontiguousarray(rows.reshape(-1, rows.shape[-1]))
    out = np.empty((flat.shape[0], width))
    loop(flat, out)
    return out.reshape((*rows.shape[:-1], width))


def _checked(name: str, values: ArrayLike, width: int) -> Rows:
    rows = np.asarray(values, dtype=np.float64)
    if rows.ndim == 0 or rows.shape[-1] != width:
        raise ValueError(f"{name} must have shape (..., {width}), got {rows.shape}")
    return rows


def _unit(name: str, values: ArrayLike) -> Rows:
    q = _checked(name, values, 4)
    norm = np.sqrt(np.sum(q * q, axis=-1, keepdims=True))
    if not np.all(norm > 0.0):
        raise ValueError(f"{name} must not be the zero quaternion")
    unit: Rows = q / norm
    return unit


def skew(v: ArrayLike) -> NDArray[np.float64]:
    """Matrix of ``v x``, shape (3, 3), of a vector."""
    x, y, z = np.asarray(v, float)
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def quat_from_rotvec(phi: ArrayLike) -> Rows:
    """Quaternions (..., 4) of rotation vectors (..., 3), rad, any length."""
    return _by_rows(_rotvecs_to_quats, _checked("phi", phi, 3), 4)


def rotvec_from_quat(q: ArrayLike) -> Rows:
    """Shortest rotation vectors (..., 3), rad, of quaternions (..., 4); |phi| <= pi."""
    return _by_rows(_quats_to_rotvecs, _unit("q", q), 3)


def dcm_from_quat(q: ArrayLike) -> Rows:
    """Direction cosine matrices (..., 3, 3) of quaternions (..., 4)."""
    rows = _by_rows(_quats_to_dcms, _unit("q", q), 9)
    return rows.reshape((*rows.shape[:-1], 3, 3))


def quat_from_dcm(C: ArrayLike) -> Rows:
    """Quaternions (..., 4), scalar part >= 0, of rotation matrices (..., 3, 3)."""
    C = np.asarray(C, dtype=np.float64)
    if C.shape[-2:] != (3, 3):
        raise ValueError(f"C must have shape (..., 3, 3), got {C.shape}")
    return _by_rows(_dcms_to_quats, C.reshape((*C.shape[:-2], 9)), 4)


def quat_from_euler(roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> Rows:
    """Quaternions ``q_nb`` (..., 4) of roll, pitch and heading, rad; shapes broadcast."""
    angles = np.broadcast_arrays(*(np.asarray(x, np.float64) for x in (roll, pitch, heading)))
    return _by_rows(_eulers_to_quats, np.stack(angles, axis=-1), 4)


def euler_from_quat(q_nb: ArrayLike) -> Rows:
    """Roll, pitch and heading (..., 3), rad, of ``q_nb`` (..., 4).

    Roll and heading are in [-pi, pi], pitch in [-pi/2, pi/2]. `quat_from_euler` gives the
    attitude back to 2e-15 rad, pitch ±90° included (`tests/earth/test_rotation.py`).
    """
    return _by_rows(_quats_to_eulers, _unit("q_nb", q_nb), 3)
