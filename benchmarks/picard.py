"""Centred windows: the explicit Magnus series beside Picard sweeps on Gauss nodes.

Both solve the same intervals from the same Legendre coefficients of rate and force, one interval
after the other in a compiled loop. A sweep takes the derivative of attitude at the nodes and puts
it through their integration matrix; the first sweep, the integral of the rate, comes straight from
the coefficients. Attitude is a rotation vector (Bortz 1971) or a quaternion; velocity and
displacement follow from the last sweep with the weights of the nodes.

``python -m benchmarks solvers``
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

MAGNUS = "Magnus"
WINDOW = 9  # samples, as in the default reconstruction
INTERVALS = 2000
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
    if len(x) == 3:
        return first
    if len(x) == 4:
        return (*first, function(x[3], y[3]))
    return (*first, function(x[3], y[3]), function(x[4], y[4]))


@formula
def mirrored(even, odd, x, y):
    """Return the sum and the difference of two weighted sums: a node and its mirror image."""
    a, b = weighted(even, x), weighted(odd, y)
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2]), (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@formula
def in_order(even, odd, x, y):
    """Return the values at all nodes; the middle one has no odd part."""
    last, first = mirrored(even[0], odd[0], x, y)
    if len(odd) == 1:
        return first, weighted(even[1], x), last
    late, early = mirrored(even[1], odd[1], x, y)
    if len(even) == 2:
        return first, early, late, last
    return first, early, weighted(even[2], x), late, last


@formula
def values(table, p):
    """Return sum p_m P_m at the nodes."""
    return in_order(table[0], table[1], (p[0], p[2], p[4]), (p[1], p[3]))


@formula
def integrals(table, p):
    """Return the integrals of sum p_m P_m up to the nodes."""
    return in_order(table[0], table[1], (p[0], p[1], p[3]), (p[0], p[2], p[4]))


@formula
def bortz(phi, omega):
    """Return the derivative of a rotation vector."""
    x2 = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    if x2 < 0.03:  # rad^2: below it the first neglected term is under 1e-15
        k = 1.0 / 12.0 + x2 * (1.0 / 720.0 + x2 * (1.0 / 30240.0 + x2 * (1.0 / 1209600.0)))
    else:
        half = 0.5 * np.sqrt(x2)
        k = (1.0 - half / np.tan(half)) / x2
    turn = cross(phi, omega)
    turn2 = cross(phi, turn)
    return (
        omega[0] + (0.5 * turn[0] + k * turn2[0]),
        omega[1] + (0.5 * turn[1] + k * turn2[1]),
        omega[2] + (0.5 * turn[2] + k * turn2[2]),
    )


@formula
def turned(phi, f):
    """Return C f for the C of a rotation vector."""
    x2 = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    r1, r2 = rotation_factors(x2)
    r0 = 1.0 - x2 * r2
    turn = cross(phi, f)
    turn2 = cross(phi, turn)
    return (
        f[0] + (r0 * turn[0] + r1 * turn2[0]),
        f[1] + (r0 * turn[1] + r1 * turn2[1]),
        f[2] + (r0 * turn[2] + r1 * turn2[2]),
    )


@formula
def coefficients(rows, k):
    """Return the five triples of interval k."""
    return (
        (rows[k, 0, 0], rows[k, 0, 1], rows[k, 0, 2]),
        (rows[k, 1, 0], rows[k, 1, 1], rows[k, 1, 2]),
        (rows[k, 2, 0], rows[k, 2, 1], rows[k, 2, 2]),
        (rows[k, 3, 0], rows[k, 3, 1], rows[k, 3, 2]),
        (rows[k, 4, 0], rows[k, 4, 1], rows[k, 4, 2]),
    )


@formula
def store(out, k, dt, phi, dv, dr):
    """Fill row k; dr comes in units of dt."""
    for i in range(3):
        out[k, 0, i], out[k, 1, i], out[k, 2, i] = phi[i], dv[i], dt * dr[i]


@kernel
def magnus(dt, a, b, out):
    """Solve every interval by the package's series."""
    for k in range(a.shape[0]):
        p, q = coefficients(a, k), coefficients(b, k)
        phi, dv, dr = motion(
            dt, (p[0], q[0]), (p[1], q[1]), (p[2], q[2]), (p[3], q[3]), (p[4], q[4])
        )
        store(out, k, 1.0, phi, dv, dr)


@kernel
def by_vector(nodes, sweeps, dt, a, b, out):
    """Solve every interval by sweeps of the rotation vector."""
    at, at_rate, up_to, matrix, weights, moments = nodes
    for k in range(a.shape[0]):
        p, q = coefficients(a, k), coefficients(b, k)
        omega, phi = values(at_rate, p), integrals(up_to, p)
        for _ in range(1, sweeps):
            rate = each(bortz, phi, omega)
            phi = each(weighted, matrix, (rate, rate, rate, rate, rate))
        f = each(turned, phi, values(at, q))
        end = weighted(weights, each(bortz, phi, omega))
        store(out, k, dt, end, weighted(weights, f), weighted(moments, f))


@formula
def start(half, _):
    """Return the first sweep of q - 1, scalar last, from half the integral of the rate."""
    return half[0], half[1], half[2], 0.0


@formula
def spin(d, half):
    """Return the derivative of d = q - 1, scalar last, from half the rate."""
    w = 1.0 + d[3]
    turn = cross(d, half)
    return (
        w * half[0] + turn[0],
        w * half[1] + turn[1],
        w * half[2] + turn[2],
        -(d[0] * half[0] + d[1] * half[1] + d[2] * half[2]),
    )


@formula
def weighted4(w, x):
    """Return the sum of w_j x_j, x_j of four numbers."""
    a, b, c = weighted(w, x)
    d = w[0] * x[0][3]
    for j in range(1, len(w)):
        d = d + w[j] * x[j][3]
    return a, b, c, d


@formula
def spun(d, f):
    """Return C f for the C of the unit quaternion 1 + d."""
    return quat_rotate((1.0 + d[3], d[0], d[1], d[2]), f)


@formula
def vector_of(d):
    """Return the rotation vector of the unit quaternion 1 + d, up to 3 rad."""
    s2 = d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
    if s2 < 0.01:  # the first neglected term is under 1e-15
        k = 2.0 + s2 * (1.0 / 3.0 + s2 * (3.0 / 20.0 + s2 * (5.0 / 56.0 + s2 * (35.0 / 576.0))))
    else:
        s = np.sqrt(s2)
        k = 2.0 * np.arctan2(s, 1.0 + d[3]) / s
    return k * d[0], k * d[1], k * d[2]


@kernel
def by_quaternion(nodes, sweeps, dt, a, b, out):
    """Solve every interval by sweeps of the quaternion."""
    at, at_rate, up_to, matrix, weights, moments = nodes
    for k in range(a.shape[0]):
        p, q = coefficients(a, k), coefficients(b, k)
        half, first = values(at_rate, p), integrals(up_to, p)
        d = each(start, first, first)
        for _ in range(1, sweeps):
            rate = each(spin, d, half)
            d = each(weighted4, matrix, (rate, rate, rate, rate, rate))
        f = each(spun, d, values(at, q))
        end = weighted4(weights, each(spin, d, half))
        store(out, k, dt, vector_of(end), weighted(weights, f), weighted(moments, f))


def nodes(count: int, scale: float) -> tuple[Any, ...]:
    """Tables of Gauss nodes on [0, 1], as nested tuples: their number is part of the type.

    Values and integrals of P_0 ... P_4 at the last nodes and the middle one, even and odd parts
    about the middle apart; those for the rate times `scale`.
    """
    x, w = legendre.leggauss(count)
    upper = x[::-1][: (count + 1) // 2]
    P = legendre.legvander(upper, ORDERS)
    up_to = _primitives(upper, ORDERS + 1)
    up_to[:, 0] -= 0.5
    middle = np.full((len(upper), 1), 0.5)
    inverse = np.linalg.inv(legendre.legvander(x, count - 1))
    at = P[:, 0::2], P[: count // 2, 1::2]
    from_start = np.hstack([middle, up_to[:, 1::2]]), up_to[: count // 2, 0::2]
    return (
        _tuples(at),
        _tuples(tuple(scale * part for part in at)),
        _tuples(tuple(scale * part for part in from_start)),
        _tuples(_primitives(x, count) @ inverse),
        _tuples(0.5 * w),
        _tuples(0.25 * w * (1.0 - x)),
    )


def _primitives(x: Array, count: int) -> Array:
    """Integrals over time from 0 to (1 + x) / 2 of the first Legendre polynomials."""
    return np.stack(
        [0.5 * legendre.legval(x, legendre.legint(e, lbnd=-1)) for e in np.eye(count)], axis=1
    )


def _tuples(x: Any) -> Any:
    return float(x) if isinstance(x, float) else tuple(map(_tuples, x))


@dataclass(frozen=True)
class Case:
    """A motion sampled at `frequency`, Hz; `motion` gives rate (rad/s) and force (m/s^2) in b."""

    name: str
    frequency: float
    motion: Callable[[Array], tuple[Array, Array]]


def _columns(*columns: ArrayLike) -> Array:
    rows: Array = np.stack(np.broadcast_arrays(*columns), axis=-1)
    return rows


def _manoeuvre(t: Array) -> tuple[Array, Array]:
    rate = _columns(
        0.6 * np.sin(1.9 * t) + 0.3 * np.cos(4.4 * t),
        0.5 * np.cos(1.5 * t) - 0.3 * np.sin(3.7 * t),
        0.6 * np.sin(1.1 * t + 1.0),
    )
    force = _columns(3.0 * np.sin(1.3 * t), 2.0 * np.cos(2.1 * t), -9.8 + 2.0 * np.sin(2.9 * t))
    return rate, force


def _cone(half_angle: float, frequency: float, t: Array) -> tuple[Array, Array]:
    W = 2.0 * np.pi * frequency
    s, c = np.sin(W * t), np.cos(W * t)
    wide, along = W * np.sin(half_angle), 2.0 * W * np.sin(0.5 * half_angle) ** 2
    force = _columns(np.sin(W * t + 0.5), np.cos(W * t + 0.3), -9.8 + 0.5 * s)
    return _columns(-wide * s, wide * c, -along), force


def _spin(t: Array) -> tuple[Array, Array]:
    s, c = np.sin(10.0 * t), np.cos(10.0 * t)
    return _columns(10.0, s, c), _columns(1.0, 9.8 * s, 9.8 * c)


CASES = (
    Case("manoeuvre of 1 rad/s, 200 Hz", 200.0, _manoeuvre),
    Case("10 Hz coning of 0.1° and 1 m/s², 100 Hz", 100.0, partial(_cone, 0.1 * DEG, 10.0)),
    Case("20 Hz coning of 1° and 1 m/s², 100 Hz", 100.0, partial(_cone, 1.0 * DEG, 20.0)),
    Case("spin of 10 rad/s, its axis turning at 1 rad/s, 100 Hz", 100.0, _spin),
)
SPINS = tuple(
    Case(f"{10.0 / f:.2g}", f, _spin) for f in (200.0, 100.0, 50.0, 30.0, 20.0, 10.0, 5.0)
)


def solvers() -> dict[str, Solver]:
    """The series and every combination of unknown, nodes and sweeps, by name."""
    out: dict[str, Solver] = {MAGNUS: magnus}
    for name, loop, scale in (("quaternion", by_quaternion, 0.5), ("vector", by_vector, 1.0)):
        for count in NODES:
            for sweeps in SWEEPS:
                label = f"{name}, {count} nodes, {sweeps} sweeps"
                out[label] = partial(loop, nodes(count, scale), sweeps)
    return out


def _exact(motion: Callable[[Array], tuple[Array, Array]], h: float) -> tuple[Array, Array]:
    """Legendre coefficients (rows, DEGREE + 1, 3) of the motion, a window's context included."""
    x, w = legendre.leggauss(DEGREE + 6)
    starts = h * np.arange(INTERVALS + WINDOW - 1)
    onto = legendre.legvander(x, DEGREE) * w[:, None] * (np.arange(DEGREE + 1) + 0.5)
    rate, force = motion(starts[:, None] + h * (0.5 + 0.5 * x))
    return tuple(h * np.einsum("kgi,gm->kmi", y, onto) for y in (rate, force))


def _of_window(exact: Array) -> Array:
    """The five coefficients that a centred window makes of the increments."""
    increments = exact[:, 0]
    windows = np.lib.stride_tricks.sliding_window_view(increments, WINDOW, axis=0)
    others = np.einsum("kij,mj->kmi", windows, equal_weights(WINDOW))
    return np.concatenate([windows[:, None, :, WINDOW // 2], others], axis=1)


def _moved(dt: float, a: Array, b: Array) -> tuple[Array, Array, Array]:
    """C, dv, dr of every interval, by the power series of the tests' oracle."""
    count = a.shape[1]
    powers = np.zeros((count, count))
    for m in range(count):
        powers[m, : m + 1] = legendre.leg2poly(np.eye(count)[m, : m + 1])
    rate, force = (0.5 * np.einsum("kmi,mp->pki", y, powers) for y in (a, b))
    C, dv, dr = Polynomial(rate, force).moved(-1.0, 2.0)  # in the variable of the polynomials
    return C, dv, 0.5 * dt * dr


def _apart(one: tuple[Array, Array, Array], other: tuple[Array, Array, Array]) -> Array:
    """Largest distance of any interval: rad, m/s, m."""
    turn = np.swapaxes(other[0], 1, 2) @ one[0]
    angle = 0.5 * (turn - np.swapaxes(turn, 1, 2))[:, [2, 0, 1], [1, 2, 0]]
    return np.array(
        [np.linalg.norm(x, axis=1).max() for x in (angle, one[1] - other[1], one[2] - other[2])]
    )


@dataclass(frozen=True)
class Measured:
    """What one case gave: errors (rad, m/s, m), ns per interval, and these over the series'."""

    window: Array
    errors: dict[str, Array]
    times: dict[str, float]
    ratios: dict[str, float]

    def quickest(self, limit: Array) -> str | None:
        """The fastest combination of sweeps with errors no larger than `limit`."""
        good = [n for n in self.errors if n != MAGNUS and np.all(self.errors[n] <= limit)]
        return min(good, key=lambda n: self.ratios[n], default=None)


def measure(case: Case) -> Measured:
    """Errors against the power series, and thread time in alternating runs, of every solver."""
    dt = 1.0 / case.frequency
    exact = _exact(case.motion, dt)
    a, b = (_of_window(y) for y in exact)
    half = WINDOW // 2
    truth, same = _moved(dt, *(y[half:-half] for y in exact)), _moved(dt, a, b)
    out = np.empty((INTERVALS, 3, 3))
    loops = solvers()
    errors = {}
    for name, loop in loops.items():
        loop(dt, a, b, out)
        C = Rotation.from_rotvec(out[:, 0]).as_matrix()
        errors[name] = _apart((C, out[:, 1], out[:, 2]), same)
    spent = np.empty((ROUNDS, len(loops)))
    for row in spent:
        for i, loop in enumerate(loops.values()):
            began = time.thread_time()
            for _ in range(PASSES):
                loop(dt, a, b, out)
            row[i] = (time.thread_time() - began) / (PASSES * INTERVALS) * 1e9
    times = np.median(spent, axis=0)
    ratios = np.median(spent / spent[:, :1], axis=0)
    return Measured(
        _apart(same, truth),
        errors,
        dict(zip(loops, times, strict=True)),
        dict(zip(loops, ratios, strict=True)),
    )


def _cell(errors: Array) -> str:
    return " / ".join(f"{x:.1e}" for x in errors)


def _choice(found: Measured, limit: Array) -> str:
    name = found.quickest(limit)
    if name is None:
        return "none"
    return f"{name}: {found.ratios[name]:.2f} times the time, {_cell(found.errors[name])}"


def picard_table() -> list[str]:
    """Markdown: time per interval and largest error of phi, dv, dr (rad / m/s / m) per interval.

    First every solver in four motions, then the quickest sweeps at equal error, then a spinning
    body by its turn per sample. `window` is what the five coefficients of the default
    reconstruction leave of the true motion, whoever solves the interval.
    """
    results = [measure(case) for case in CASES]
    first = results[0]
    finest = first.errors[f"vector, {max(NODES)} nodes, {max(SWEEPS)} sweeps"]
    if np.any(finest > ROUNDING):
        raise AssertionError(f"sweeps converge to something else: {_cell(finest)}")
    lines = [
        "| solver | ns | ratio | " + " | ".join(case.name for case in CASES) + " |",
        "|---" * (3 + len(CASES)) + "|",
        "| window | | | " + " | ".join(_cell(found.window) for found in results) + " |",
    ]
    for name, ns in first.times.items():
        cells = [_cell(found.errors[name]) for found in results]
        lines.append(f"| {name} | {ns:.0f} | {first.ratios[name]:.2f} | {' | '.join(cells)} |")
    lines += ["", "Quickest sweeps with at most twice the error of the series:", ""]
    for case, found in zip(CASES, results, strict=True):
        limit = np.maximum(2.0 * found.errors[MAGNUS], ROUNDING)
        lines.append(f"- {case.name}: {_choice(found, limit)}")
    lines += [
        "",
        "| turn per sample, rad | window | Magnus | ns "
        "| quickest sweeps with at most twice its error | quickest with at most the window's |",
        "|---" * 6 + "|",
    ]
    for case in SPINS:
        found = measure(case)
        series = found.errors[MAGNUS]
        cells = [
            case.name,
            _cell(found.window),
            _cell(series),
            f"{found.times[MAGNUS]:.0f}",
            _choice(found, np.maximum(2.0 * series, ROUNDING)),
            _choice(found, np.maximum(found.window, ROUNDING)),
        ]
        lines.append(f"| {' | '.join(cells)} |")
    return lines
