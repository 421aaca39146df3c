"""What an ideal IMU feels on a motion, and where the motion truly is."""

from __future__ import annotations

from math import factorial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from earth.ellipsoid import WGS84
from earth.geodetic import geodetic_from_ecef, meridian_plane
from earth.gravity import closed_form_gravity
from earth.rotation import quat_product, quat_rotate
from navgrade.simulate.kinematics import Kinematics, Triple, conjugate, q_en
from navgrade.simulate.motion import Motion
from navgrade.state import Columns, Trajectory

Array = NDArray[np.float64]

_BLOCK = 8192  # instants evaluated at once: their working arrays stay in cache
_OVERTONES = 3.0  # attitude times attitude times force: products of three sinusoids
_LONGEST = 1.0  # bandwidth times the longest piece integrated at once, rad
_ROUNDING = 1e-9  # s: times this far outside a motion are meant to be its ends


def imu_increments(motion: Motion, edges: ArrayLike) -> tuple[Array, Array]:
    """Integrate angular rate and specific force between instants.

    Parameters
    ----------
    motion : Motion
    edges : array_like, shape (n + 1,)
        Ends of the intervals, s, increasing; they need not be equally spaced.

    Returns
    -------
    dtheta, dvel : ndarray, shape (n, 3)
        Integrals of ``omega_ib_b`` (rad) and ``f_ib_b`` (m/s) over [edges[k], edges[k + 1]].

    Raises
    ------
    ValueError
        If `edges` are not two or more increasing times within the motion.

    Notes
    -----
    Gauss-Legendre quadrature between the edges and the motion's knots. The number of nodes q makes
    its remainder (q!)^4 / ((2q + 1) (2q)!^3) (3 w dt)^(2q) less than 1e-15 of the rate, where w is
    the motion's bandwidth; pieces longer than 1/w are cut. Errors are then those of rounding
    (`tests/navgrade/simulate/test_imu.py`).
    """
    edges = _times(motion, edges, "edges", at_least=2)
    pieces = _pieces(motion, edges)
    dt = np.diff(pieces)
    x, w = np.polynomial.legendre.leggauss(_nodes(_OVERTONES * motion.bandwidth * float(dt.max())))
    fraction, weight = 0.5 * (1.0 + x), 0.5 * w
    step = max(1, _BLOCK // len(x))
    integrals = np.empty((6, len(dt)))
    for first in range(0, len(dt), step):
        part = slice(first, first + step)
        t = pieces[:-1][part, None] + dt[part, None] * fraction
        mean = _felt(motion, t.ravel()).reshape(6, *t.shape) @ weight
        np.multiply(mean, dt[part], out=integrals[:, part])
    sums = np.add.reduceat(integrals, np.searchsorted(pieces, edges[:-1]), axis=1)
    return np.ascontiguousarray(sums[:3].T), np.ascontiguousarray(sums[3:].T)


def imu_rates(motion: Motion, t: ArrayLike) -> tuple[Array, Array]:
    """Instantaneous angular rate and specific force.

    Parameters
    ----------
    motion : Motion
    t : array_like, shape (n,)
        s, increasing.

    Returns
    -------
    omega_ib_b, f_ib_b : ndarray, shape (n, 3)
        rad/s and m/s^2. Gravity is the exact normal gravity of WGS-84 at the point itself.

    Raises
    ------
    ValueError
        If `t` are not increasing times within the motion.

    Notes
    -----
    Against differentiation of the path in 120 digits: 2e-14 rad/s and 5e-13 m/s^2 on segments and
    splines at 40 m/s; sinusoids and vibrations add the rounding of their phase
    (`tests/navgrade/simulate`).
    """
    t = _times(motion, t, "t")
    rows = np.empty((6, len(t)))
    for first in range(0, len(t), _BLOCK):
        part = slice(first, first + _BLOCK)
        rows[:, part] = _felt(motion, t[part])
    return np.ascontiguousarray(rows[:3].T), np.ascontiguousarray(rows[3:].T)


def true_trajectory(motion: Motion, t: ArrayLike, epoch_ns: int = 0) -> Trajectory:
    """Position, velocity and attitude of a motion.

    Parameters
    ----------
    motion : Motion
    t : array_like, shape (n,)
        s, increasing.
    epoch_ns : int
        Unix time of ``t = 0``, ns.

    Returns
    -------
    Trajectory
        The scalar part of ``q_nb`` is not negative. Positions are rounded to 2 nm.

    Raises
    ------
    ValueError
        If `t` are not increasing times within the motion.
    """
    t = _times(motion, t, "t")
    columns = Columns.empty(len(t))
    for first in range(0, len(t), _BLOCK):
        part = columns.rows(first, min(first + _BLOCK, len(t)))
        now = motion.at(t[first : first + _BLOCK])
        lat, lon, h = geodetic_from_ecef(WGS84.params, *now.r_e)
        q_ne = conjugate(q_en(lat, lon))
        q_nb = np.stack(quat_product(q_ne, now.q_eb), axis=-1)
        part.lat[:], part.lon[:], part.h[:] = lat, lon, h
        part.v_eb_n[:] = np.stack(quat_rotate(q_ne, now.v_e), axis=-1)
        part.q_nb[:] = q_nb * np.copysign(1.0 / np.linalg.norm(q_nb, axis=1), q_nb[:, 0])[:, None]
    return Trajectory(t, *columns, np.zeros(len(t), np.uint32), epoch_ns)


class Extremes(NamedTuple):
    """The largest magnitudes of a motion, each with its time, s.

    Attributes
    ----------
    omega, f, speed : float
        Of ``omega_ib_b`` (rad/s), ``f_ib_b`` (m/s^2) and velocity over the Earth (m/s).
    """

    omega: float
    omega_t: float
    f: float
    f_t: float
    speed: float
    speed_t: float


def extremes(motion: Motion) -> Extremes:
    """Find what an IMU must be able to measure.

    Looked for at sixteen instants per period of the motion's bandwidth, at least one a second: the
    maxima are met within 2 %.
    """
    period = 2.0 * np.pi / max(motion.bandwidth, 1e-9)
    count = int(np.ceil((motion.end - motion.start) / min(1.0, period / 16.0))) + 1
    t = np.linspace(motion.start, motion.end, count)
    largest = np.zeros((3, 2))
    for first in range(0, count, _BLOCK):
        part = t[first : first + _BLOCK]
        now = motion.at(part)
        felt = _felt_there(now)
        vectors: tuple[Any, ...] = felt[:3], felt[3:], now.v_e
        for row, vector in zip(largest, vectors, strict=True):
            size = np.sqrt(sum(x * x for x in vector))
            k = int(np.argmax(size))
            if size[k] > row[0]:
                row[:] = size[k], part[k]
    return Extremes(*(float(x) for x in largest.ravel()))


def _times(motion: Motion, values: ArrayLike, name: str, at_least: int = 1) -> Array:
    t = np.asarray(values, dtype=np.float64)
    if t.ndim != 1 or len(t) < at_least or not np.all(np.diff(t) > 0.0):
        raise ValueError(f"{name} must be {at_least} or more increasing times, s")
    if not (motion.start - _ROUNDING <= t[0] and t[-1] <= motion.end + _ROUNDING):
        raise ValueError(
            f"{name} must be within the motion, {motion.start:.9g} to {motion.end:.9g} s; they are "
            f"{t[0]:.9g} to {t[-1]:.9g} s"
        )
    return t


def _pieces(motion: Motion, edges: Array) -> Array:
    """Edges and knots, and as many instants between them as the bandwidth asks for."""
    knots = np.asarray(motion.knots)
    pieces = np.union1d(edges, knots[(knots > edges[0]) & (knots < edges[-1])])
    dt = np.diff(pieces)
    parts = np.maximum(np.ceil(dt * (motion.bandwidth / _LONGEST)), 1.0).astype(np.intp)
    if parts.max() == 1:
        return pieces
    number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    inner = np.repeat(pieces[:-1], parts) + number * np.repeat(dt / parts, parts)
    return np.append(inner, pieces[-1])


def _nodes(phase: float) -> int:
    """Fewest Gauss nodes that integrate sin over `phase` (rad) to rounding."""
    q = 2
    while factorial(q) ** 4 / ((2 * q + 1) * factorial(2 * q) ** 3) * phase ** (2 * q) > 1e-15:
        q += 1
    return q


def _felt(motion: Motion, t: Array) -> Array:
    return _felt_there(motion.at(t))


def _felt_there(now: Kinematics) -> Array:
    """omega_ib_b, then f_ib_b, along the first axis."""
    spin = WGS84.params.omega
    g_e = _gravity_e(now.r_e)
    (v_x, v_y, _), (a_x, a_y, a_z) = now.v_e, now.a_e
    f_e = a_x - 2.0 * spin * v_y - g_e[0], a_y + 2.0 * spin * v_x - g_e[1], a_z - g_e[2]
    q_be = conjugate(now.q_eb)
    out = np.empty((6, len(v_x)))
    for k, (relative, carried) in enumerate(
        zip(now.omega_eb_b, quat_rotate(q_be, (0.0, 0.0, spin)), strict=True)
    ):
        np.add(relative, carried, out=out[k])
    out[3], out[4], out[5] = quat_rotate(q_be, f_e)
    return out


def _gravity_e(r_e: Triple) -> Triple:
    x, y, z = r_e
    rho = np.hypot(x, y)
    sin_lat, cos_lat, h = meridian_plane(WGS84.params, rho, z)
    north, down = closed_form_gravity(WGS84.params, sin_lat, cos_lat, h)
    outward = -(sin_lat * north + cos_lat * down) / rho
    return outward * x, outward * y, cos_lat * north - sin_lat * down
