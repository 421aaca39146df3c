"""Increments as integrals, instants, and the extremes of a motion."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from navgrade.simulate import (
    BSpline,
    Coning,
    Motion,
    Mounted,
    Sculling,
    Segments,
    Start,
    Still,
    Straight,
    Vibrating,
    Waypoints,
    extremes,
    imu,
    imu_increments,
    imu_rates,
    true_trajectory,
)
from tests.navgrade.simulate.test_segments import MOTION
from tests.navgrade.simulate.test_sinusoids import SWELL
from tests.navgrade.simulate.test_waypoints import LAT, LON, H, Q, T

Array = NDArray[np.float64]


class Sample(NamedTuple):
    """A motion, and to what its rates (rad/s) and forces (m/s^2) are rounded at any one time."""

    motion: Motion
    omega: float
    f: float


MOTIONS = {
    # phases up to 6e3 rad, rounded to 5e-13, of 0.06 rad/s and 39 m/s^2
    "sinusoids": Sample(SWELL, 3e-14, 2e-11),
    # times up to 100 s, rounded to 1e-14, of 0.5 rad/s^2 and 60 m/s^3
    "segments": Sample(MOTION, 1e-14, 4e-13),
    # phases up to 1.5e4 rad, rounded to 9e-13, of 4 rad/s and 10 m/s^2
    "vibrating": Sample(
        Vibrating(MOTION, [Coning(0.05, 11.0), Sculling(0.02, 20.0, acceleration=10.0)]),
        4e-12,
        1e-11,
    ),
    # times up to 100 s, rounded to 1e-14, of 1 rad/s^2 and 10 m/s^3
    "waypoints": Sample(Waypoints(T - 100.0, LAT, LON, H, Q), 1e-14, 1e-13),
    "B-spline": Sample(BSpline(0.0, 2.0, LAT, LON, H, Q), 4e-15, 4e-14),
}


def fejer(n: int) -> tuple[Array, Array]:
    """Nodes within (0, 1), increasing, and weights of Fejér's first rule."""
    angle = np.pi * (np.arange(n)[::-1] + 0.5) / n
    k = np.arange(1, n // 2 + 1)
    sums = (np.cos(2.0 * np.outer(angle, k)) / (4.0 * k**2 - 1.0)).sum(axis=1)
    return 0.5 * (1.0 + np.cos(angle)), (1.0 - 2.0 * sums) / n


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("longest", [0.004, 0.6])  # s
def test_increments_are_integrals(name: str, longest: float) -> None:
    """Another quadrature between edges and knots gives the same, short intervals or long."""
    motion, omega_rounding, f_rounding = MOTIONS[name]
    start = motion.knots[3] - 1.5 * longest if len(motion.knots) else 10.0
    steps = np.random.default_rng(8).uniform(0.2, 1.0, 8) * longest  # of an unsteady clock
    edges = start + np.concatenate([[0.0], np.cumsum(steps)])
    dtheta, dvel = imu_increments(motion, edges)
    x, w = fejer(200)
    for k in range(len(steps)):
        inside = motion.knots[(motion.knots > edges[k]) & (motion.knots < edges[k + 1])]
        exact = np.zeros(6)
        for a, b in pairwise([edges[k], *inside, edges[k + 1]]):
            exact += (b - a) * (w @ np.concatenate(imu_rates(motion, a + (b - a) * x), axis=1))
        assert dtheta[k] == pytest.approx(exact[:3], abs=omega_rounding * steps[k])
        assert dvel[k] == pytest.approx(exact[3:], abs=f_rounding * steps[k])


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("dt", [0.03, 1.0])  # s
def test_more_nodes_change_nothing(name: str, dt: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The nodes suffice throughout a minute, for intervals short or long."""
    motion, *rounding = MOTIONS[name]
    edges = np.arange(motion.start, min(motion.end, motion.start + 60.0), dt)
    few = imu_increments(motion, edges)
    monkeypatch.setattr(imu, "_nodes", lambda _: 14)
    many = imu_increments(motion, edges)
    for one, other, unit in zip(few, many, rounding, strict=True):
        assert np.abs(one - other).max() < unit * dt


def test_sums_of_increments() -> None:
    """Increments between some of the edges are sums of those between all."""
    edges = np.union1d(np.arange(0.0, MOTION.end, 0.31), MOTION.knots[5:9])
    fine = imu_increments(MOTION, edges)
    coarse = imu_increments(MOTION, edges[::7])
    for one, other in zip(fine, coarse, strict=True):
        count = len(other)
        sums = np.add.reduceat(one, np.arange(0, 7 * count, 7))
        assert np.abs(sums[: count - 1] - other[: count - 1]).max() < 1e-13  # rad, m/s: rounding


def test_at_rest() -> None:
    """A still sensor feels the Earth's rate and minus gravity, in its own axes."""
    q_bs = np.array([0.5, 0.5, 0.5, 0.5])  # x of the sensor is y of the body, y is z, z is x
    motion = Mounted(Segments(Start(-0.6, 2.0, 150.0, heading=0.7), [Still(10.0)]), q_bs=q_bs)
    omega, f = imu_rates(motion, [5.0])
    rate = 7.292115e-5
    north, down = rate * np.cos(0.6), rate * np.sin(0.6)
    body = np.array([north * np.cos(0.7), -north * np.sin(0.7), down])
    assert omega[0] == pytest.approx(body[[1, 2, 0]], abs=1e-19)  # rad/s
    # Somigliana and the free-air gradient, 1e-5 of it unknown to the formula at 150 m
    s2 = np.sin(0.6) ** 2
    g = 9.7803253359 * (1 + 0.00193185265241 * s2) / np.sqrt(1 - 0.00669437999013 * s2)
    assert f[0, 1] == pytest.approx(-(g - 3.086e-6 * 150.0), abs=3e-6)  # m/s^2
    dtheta, dvel = imu_increments(motion, [0.0, 0.5, 0.7])
    assert dtheta == pytest.approx(omega * [[0.5], [0.2]], rel=1e-14)
    assert dvel == pytest.approx(f * [[0.5], [0.2]], rel=1e-14, abs=1e-15)


def test_extremes() -> None:
    """The largest rate, force and speed, and when."""
    found = extremes(SWELL)
    t = np.linspace(0.0, 100.0, 100_001)
    omega, f = (np.linalg.norm(x, axis=1) for x in imu_rates(SWELL, t))
    speed = np.linalg.norm(true_trajectory(SWELL, t).v_eb_n, axis=1)
    for value, when, values in (
        (found.omega, found.omega_t, omega),
        (found.f, found.f_t, f),
        (found.speed, found.speed_t, speed),
    ):
        assert 0.98 * values.max() < value <= values.max() * (1.0 + 1e-6)
        assert np.interp(when, t, values) == pytest.approx(value, rel=1e-3)
    still = extremes(Segments(Start(0.5, 0.5, 0.0), [Still(3.0)]))
    assert still.omega == pytest.approx(7.292115e-5)
    assert still.speed == 0.0


@pytest.mark.parametrize(
    ("edges", "message"),
    [
        ([1.0], "edges must be 2 or more increasing times, s"),
        ([1.0, 1.0], "edges must be 2 or more increasing times, s"),
        ([[1.0, 2.0]], "edges must be 2 or more increasing times, s"),
        ([1.0, np.nan], "edges must be 2 or more increasing times, s"),
        ([-1.0, 2.0], "edges must be within the motion, 0 to 9 s; they are -1 to 2 s"),
        ([1.0, 9.1], "edges must be within the motion, 0 to 9 s; they are 1 to 9.1 s"),
    ],
)
def test_refusals(edges: list[float], message: str) -> None:
    """Times that do not increase or leave the motion."""
    motion = Segments(Start(0.5, 0.5, 0.0, speed=1.0), [Straight(duration=9.0)])
    with pytest.raises(ValueError, match=message):
        imu_increments(motion, edges)
