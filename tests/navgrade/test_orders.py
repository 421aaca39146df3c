"""Every declared order, seen by making the interval shorter.

The error of an order p falls by the factor 2^p when the interval is halved. Too long an interval
still shows the next orders, too short a one shows rounding; so each error is measured on a ladder
of intervals, and the order is read off its finest rungs that stand well clear of rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from navgrade import ImuSamples
from navgrade.imu import BodyIncrements
from navgrade.mechanization import MECHANIZATIONS, World
from navgrade.reconstruction import RECONSTRUCTIONS, reconstruct
from tests.navgrade.engine import state_at
from tests.oracles.cases import position_error
from tests.oracles.constants import OMEGA
from tests.oracles.truth import Motion, manoeuvre

Array = NDArray[np.float64]

GAUSS_X, GAUSS_W = np.polynomial.legendre.leggauss(20)
FRACTION, WEIGHT = 0.5 * (1.0 + GAUSS_X), 0.5 * GAUSS_W


def orders_of(errors: Callable[[float], Array], ladder: Array, floors: Array) -> Array:
    """Slopes of ln error over ln interval, each on the three finest rungs above its floor."""
    table: list[Array] = []
    for interval in ladder:  # from long to short
        table.append(errors(float(interval)))
        if np.all(table[-1] < floors):
            break
    orders = []
    for column, floor in zip(np.array(table).T, floors, strict=True):
        clear = int(np.argmax(np.append(column < floor, True)))
        assert clear >= 3, f"only {column[:clear]} stand above {floor}"
        rungs = slice(clear - 3, clear)
        orders.append(np.polyfit(np.log(ladder[rungs]), np.log(column[rungs]), 1)[0])
    return np.array(orders)


# A body in empty space, in closed form: heading, pitch and roll, and the acceleration along
# inertial axes, each a constant and a sinusoid; rates of up to 1.5 rad/s, forces of 4 to 14 m/s^2.
# Large and slow: what is left of the products of increments shows, not the ends of the windows.
ANGLES = ((0.7, 2.0, 0.5, 0.3), (-0.2, 1.7, 0.6, 1.9), (0.4, 2.3, 0.4, 4.0))  # rad, rad, rad/s, rad
FORCES = ((0.8, 3.0, 0.5, 0.5), (-1.1, 2.0, 0.4, 2.2), (-9.8, 2.5, 0.6, 5.1))  # m/s^2 likewise


DURATION = 9.6  # s
LADDER = 0.4 / np.array([1.0, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32])  # s: whole blocks of 2, 3 and 4


def waves(table: tuple[tuple[float, ...], ...], t: Array, integrals: int) -> Array:
    """Rows of a table at `t`, integrated so many times; -1 is the derivative."""
    constant, amplitude, w, phase = np.array(table).T
    steady = {-1: 0.0 * t, 0: 1.0 + 0.0 * t, 1: t, 2: 0.5 * t**2}[integrals]
    swing = np.sin(np.multiply.outer(t, w) + phase - integrals * np.pi / 2)
    return np.multiply.outer(steady, constant) + amplitude * w**-integrals * swing


def attitude(t: Array) -> Rotation:
    """Body to inertial axes."""
    return Rotation.from_euler("ZYX", waves(ANGLES, t, 0))


def body_rate(t: Array) -> Array:
    """Angular rate in b, rad/s, from the rates of the Euler angles."""
    _, pitch, roll = waves(ANGLES, t, 0).T
    heading1, pitch1, roll1 = waves(ANGLES, t, -1).T
    return np.stack(
        [
            roll1 - heading1 * np.sin(pitch),
            pitch1 * np.cos(roll) + heading1 * np.cos(pitch) * np.sin(roll),
            heading1 * np.cos(pitch) * np.cos(roll) - pitch1 * np.sin(roll),
        ],
        axis=-1,
    )


def recorded(edges: Array) -> ImuSamples:
    """Increments of the body's rate and force between `edges`."""
    dt = np.diff(edges)
    nodes = (edges[:-1, None] + dt[:, None] * FRACTION).ravel()
    force = attitude(nodes).inv().apply(waves(FORCES, nodes, 0))

    def integral(values: Array) -> Array:
        return np.einsum("m,nmi->ni", WEIGHT, values.reshape(len(dt), -1, 3)) * dt[:, None]

    return ImuSamples(
        t=edges[1:], dt=dt, gyro=integral(body_rate(nodes)), accel=integral(force), kind="increment"
    )


def errors_of(rows: BodyIncrements) -> Array:
    """Put increments together; return the largest attitude, velocity and position error.

    In rad, m/s and m.
    """
    start = rows.t[:1] - rows.dt[0]
    C, v, r = attitude(start).as_matrix()[0], waves(FORCES, start, 1)[0], waves(FORCES, start, 2)[0]
    C_true, v_true, r_true = (
        attitude(rows.t).as_matrix(),
        waves(FORCES, rows.t, 1),
        waves(FORCES, rows.t, 2),
    )
    turns = Rotation.from_rotvec(rows.phi).as_matrix()
    worst = np.zeros(3)
    for k in range(len(rows)):
        r = r + v * rows.dt[k] + C @ rows.dr[k]
        v = v + C @ rows.dv[k]
        C = C @ turns[k]
        off = (C - C_true[k], v - v_true[k], r - r_true[k])
        worst = np.maximum(worst, [np.abs(x).max() for x in off])
    return worst


def between(begin: float, end: float, pieces: list[BodyIncrements]) -> BodyIncrements:
    """Rows whose intervals lie inside."""
    names = ("t", "dt", "phi", "dv", "dr", "status")
    columns = [np.concatenate([getattr(piece, name) for piece in pieces]) for name in names]
    t, dt = columns[:2]
    inside = (t - dt > begin - 1e-9) & (t < end + 1e-9)
    return BodyIncrements(*(column[inside] for column in columns))


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_reconstruction_order(name: str) -> None:
    """The declared order is that of attitude or velocity, whichever is lower, and of position."""

    def errors(dt: float) -> Array:
        # windows that look back or ahead find samples beyond both ends
        log = recorded(np.arange(-24, round(DURATION / dt) + 25) * dt + 0.3)
        return errors_of(between(0.3, 0.3 + DURATION, list(reconstruct([log], name))))

    # rounding: 1e-16 rad, 1e-14 m/s and 1e-14 m a step, a thousand steps
    floors = np.array([5e-14, 1e-12, 1e-11])
    attitude_order, velocity_order, position_order = orders_of(errors, LADDER, floors)
    declared = RECONSTRUCTIONS[name].order
    assert min(attitude_order, velocity_order) == pytest.approx(declared, abs=0.2)
    assert position_order == pytest.approx(declared, abs=0.2)


def inertial_attitude(motion: Motion, t: Array) -> Rotation:
    """Body to inertial axes of a motion over the Earth."""
    s = motion.state(t)
    down = np.stack([s.lon + OMEGA * t, -s.lat - np.pi / 2], axis=-1)
    C_in = Rotation.from_euler("ZY", down)
    return C_in * Rotation.from_euler("ZYX", np.stack([s.heading, s.pitch, s.roll], axis=-1))


@cache
def exact_increments(motion: Motion, begin: float, interval: float, n: int) -> BodyIncrements:
    """Body increments by quadrature of the specific force in inertial axes."""
    edges = begin + np.arange(n + 1) * interval
    dt = np.diff(edges)
    nodes = (edges[:-1, None] + dt[:, None] * FRACTION).ravel()
    C_ib = inertial_attitude(motion, edges)
    start = C_ib[:-1].inv()
    force = inertial_attitude(motion, nodes).apply(motion.rates(nodes).f_ib_b)
    force = force.reshape(len(dt), -1, 3)
    velocity = np.einsum("m,nmi->ni", WEIGHT, force) * dt[:, None]
    way = np.einsum("m,nmi->ni", WEIGHT * (1.0 - FRACTION), force) * dt[:, None] ** 2
    return BodyIncrements(
        t=edges[1:],
        dt=dt,
        phi=(start * C_ib[1:]).as_rotvec(),
        dv=start.apply(velocity),
        dr=start.apply(way),
        status=np.zeros(len(dt), np.uint32),
    )


@pytest.mark.parametrize("name", MECHANIZATIONS)
def test_mechanization_order(name: str) -> None:
    """The declared order of the position error, from exact body increments."""
    motion = manoeuvre()

    def errors(dt: float) -> Array:
        state = state_at(motion, 7.0)
        mechanizer = MECHANIZATIONS[name].start(state, World.around(state))
        nav = mechanizer.advance(exact_increments(motion, 7.0, dt, round(60.0 / dt)))
        error = position_error(nav, motion.state(nav.t))
        return np.array([max(error.horizontal, error.vertical)])

    # m: 1e-12 m/s^2 of the gravity fit are 2e-9 m after a minute, rounding about as much
    (order,) = orders_of(errors, 2.0 / 2.0 ** np.arange(6), np.array([1e-7]))
    assert order == pytest.approx(MECHANIZATIONS[name].order, abs=0.2)
