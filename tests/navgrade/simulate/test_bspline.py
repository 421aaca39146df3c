"""Cumulative B-splines against the textbook's matrices, and drawn paths."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.typing import NDArray

from navgrade.simulate import BSpline, drawn_path, imu_rates, true_trajectory
from tests.navgrade.simulate.exact import (
    DEG,
    Pose,
    closing,
    cox_de_boor,
    mismatch,
    over_earth,
    rotation,
)
from tests.navgrade.simulate.test_waypoints import LAT, LON, H, Q

Array = NDArray[np.float64]
T0, DT = 7.0, 3.7  # s


def skew(v: list[mpf]) -> mp.matrix:
    """Cross product as a matrix."""
    x, y, z = v
    return mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def exponential(v: list[mpf]) -> mp.matrix:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = mp.sqrt(sum(x * x for x in v))
    S = skew([x / angle for x in v])
    return mp.eye(3) + mp.sin(angle) * S + (1 - mp.cos(angle)) * S * S


def logarithm(C: mp.matrix) -> list[mpf]:
    """Its inverse."""
    axis = [C[2, 1] - C[1, 2], C[0, 2] - C[2, 0], C[1, 0] - C[0, 1]]
    sine = mp.sqrt(sum(x * x for x in axis)) / 2
    cosine = (C[0, 0] + C[1, 1] + C[2, 2] - 1) / 2
    return [x * mp.atan2(sine, cosine) / (2 * sine) for x in axis]


def pose(degree: int) -> Pose:
    """The spline by its definition: a product of matrix exponentials of cumulative bases."""
    knots = T0 + DT * (np.arange(len(LAT) + degree + 1.0) - 0.5 * (degree + 1))
    columns = LAT, np.unwrap(LON), H

    def at(t: mpf) -> tuple[mp.matrix, mp.matrix]:
        exact_knots = [mpf(T0) + mpf(DT) * (k - mpf(degree + 1) / 2) for k in range(len(knots))]
        span = int(np.searchsorted(knots, float(t), side="right")) - 1
        near = range(span - degree, span + 1)
        weights = [cox_de_boor(exact_knots, k, degree, t) for k in near]
        place = (
            sum(w * mpf(float(column[k])) for w, k in zip(weights, near, strict=True))
            for column in columns
        )
        C = [rotation([mpf(float(x)) for x in Q[k]]) for k in near]
        factors = [
            exponential([sum(weights[j:]) * x for x in logarithm(C[j - 1].T * C[j])])
            for j in range(1, degree + 1)
        ]
        return over_earth(*place, reduce(lambda a, b: a * b, factors, C[0]))

    return at


@pytest.mark.parametrize("degree", [3, 5])
def test_rates(degree: int) -> None:
    """Rates, force and velocity agree with high precision to rounding."""
    motion, here = BSpline(T0, DT, LAT, LON, H, Q, degree), pose(degree)
    found = mismatch(motion, lambda _: here, (motion.start + 0.2, 42.1, 88.8))
    # a few roundings of 0.5 rad/s, 12 m/s^2 and 70 m/s
    assert found.omega < 2e-15  # rad/s
    assert found.f < 1e-13  # m/s^2
    assert found.v < 1e-13  # m/s


@pytest.mark.parametrize("degree", [3, 5])
def test_closes(degree: int) -> None:
    """A hundred seconds, navigated, end where they end."""
    motion = BSpline(T0, DT, LAT, LON, H, Q, degree)
    error = closing(motion, np.arange(motion.start, motion.end, 0.01))
    assert max(error.horizontal, error.vertical) < 1e-6  # m


@pytest.mark.parametrize("degree", [3, 5])
def test_smooth_across_knots(degree: int) -> None:
    """Rates, force and angular acceleration do not jump."""
    motion, gap = BSpline(T0, DT, LAT, LON, H, Q, degree), 1e-6  # s
    before, after = (
        np.concatenate(
            [*imu_rates(motion, motion.knots + side), motion.at(motion.knots + side).alpha_eb_b],
            axis=None,
        )
        for side in (-gap, gap)
    )
    assert np.abs(after - before).max() < 2.0 * gap * 30.0  # of slopes up to 30 per s


def test_between_its_poses() -> None:
    """The paper's weights: at a pose, 1/6, 4/6 and 1/6 of it and its neighbours."""
    h = np.array([0.0, 0.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    level = np.tile([1.0, 0.0, 0.0, 0.0], (8, 1))
    motion = BSpline(0.0, 1.0, np.full(8, 0.5), np.full(8, 1.0), h, level, 3)
    assert (motion.start, motion.end) == (1.0, 6.0)
    found = true_trajectory(motion, [1.0, 2.0, 3.0, 4.0]).h
    assert found == pytest.approx([1.0, 4.0, 1.0, 0.0], abs=1e-8)  # m


def corner(angle_deg: float, degree: int, leg: float = 0.003) -> BSpline:
    """North, then a turn to the right, at 10 m/s."""
    angle = angle_deg * DEG
    lat = np.array([45.0, 45.0 + leg, 45.0 + leg + 0.003 * np.cos(angle)]) * DEG
    lon = np.array([8.0, 8.0, 8.0 + 0.003 * np.sin(angle) / np.cos(45.0 * DEG)]) * DEG
    return drawn_path(lat, lon, [100.0, 100.0, 100.0], 10.0, dt=1.0, still=20.0, degree=degree)


def slip(motion: BSpline) -> tuple[Array, Array]:
    """Speed (m/s) and angle between velocity and the forward axis (rad)."""
    truth = true_trajectory(motion, np.linspace(20.0, motion.end, 4000))
    heading = truth.euler[:, 2]
    course = np.arctan2(truth.v_eb_n[:, 1], truth.v_eb_n[:, 0])
    speed = np.linalg.norm(truth.v_eb_n, axis=1)
    off = np.abs((course - heading + np.pi) % (2.0 * np.pi) - np.pi)
    return speed, np.where(speed > 0.1, off, 0.0)


@pytest.mark.parametrize("degree", [3, 5])
@pytest.mark.parametrize(("angle", "limit"), [(30.0, 3.1), (90.0, 10.0), (120.0, 17.0)])
def test_slip_in_corners(angle: float, limit: float, degree: int) -> None:
    """What the documentation says of slip and speed, wherever the corner falls."""
    for leg in (0.003, 0.00304):
        speed, off = slip(corner(angle, degree, leg))
        assert off.max() < limit * DEG
        assert speed.max() == pytest.approx(10.0, abs=0.1)
    if angle == 90.0:
        assert speed[1500:2500].min() == pytest.approx(7.1, abs=0.3)


def test_corner_is_cut() -> None:
    """By less than half of what the vehicle goes in an interval."""
    motion = corner(90.0, 5)
    truth = true_trajectory(motion, np.linspace(20.0, motion.end, 4000))
    north = (truth.lat - 45.003 * DEG) * 6.37e6
    east = (truth.lon - 8.0 * DEG) * 6.39e6 * np.cos(45.0 * DEG)
    assert 3.0 < np.hypot(north, east).min() < 5.0  # m


def test_starts_and_ends_at_rest() -> None:
    """It stands as long as asked for, pointing the way it will go, and stops at the last point."""
    motion = corner(60.0, 5)
    truth = true_trajectory(motion, [0.0, 10.0, 20.0, motion.end - 0.5, motion.end])
    assert np.linalg.norm(truth.v_eb_n, axis=1) == pytest.approx(0.0, abs=1e-9)  # m/s
    assert truth.lat[:3] == pytest.approx(45.0 * DEG, abs=1e-15)
    assert truth.lat[-1] == pytest.approx(45.0045 * DEG, abs=1e-15)
    assert truth.euler[:3, 2] == pytest.approx(0.0, abs=1e-12)
    assert truth.euler[-1, 2] == pytest.approx(60.0 * DEG, abs=2e-3)  # rad: on a sphere
    t = np.linspace(0.0, 20.0, 11)
    omega, f = imu_rates(motion, t)
    assert np.linalg.norm(omega, axis=1) == pytest.approx(7.292115e-5, rel=1e-12)
    assert np.ptp(f, axis=0) == pytest.approx(0.0, abs=1e-9)  # m/s^2
    error = closing(motion, np.arange(15.0, motion.end, 0.01))
    assert max(error.horizontal, error.vertical) < 1e-6  # m


NORTH = np.array([0.5, 0.5001, 0.5002])
SAME = np.ones(3)
SIX = np.linspace(0.5, 0.5001, 6)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: drawn_path(NORTH[:1], SAME[:1], SAME[:1], 5.0), "two points or more, got 1"),
        (lambda: drawn_path(NORTH, SAME, SAME, 0.0), "speed must be positive, got 0.0 m/s"),
        (lambda: drawn_path(NORTH, SAME, SAME, 5.0, dt=-1.0), "dt must be positive, got -1.0 s"),
        (lambda: drawn_path(NORTH, SAME, SAME, 5.0, still=-1.0), "still must not be negative"),
        (
            lambda: drawn_path(NORTH[[0, 1, 1]], SAME, SAME, 5.0),
            "points 2 and 3 are at the same pl",
        ),
        (
            lambda: drawn_path(NORTH[[0, 1, 0]], SAME, SAME, 5.0),
            "turns back by 180° at point 2, more than 150°; round the corner",
        ),
        (lambda: drawn_path(NORTH + 1.06, SAME, SAME, 5.0), "point 1 is at latitude 89.38"),
        (lambda: drawn_path(NORTH * np.nan, SAME, SAME, 5.0), "point 1 is not finite"),
        (lambda: drawn_path(NORTH, SAME[:2], SAME, 5.0), "rows of one length, got shapes"),
        (lambda: BSpline(0.0, 1.0, SIX, SIX, SIX, Q[:6], 4), "degree must be 3 or 5, got 4"),
        (lambda: BSpline(0.0, 0.0, SIX, SIX, SIX, Q[:6]), "dt positive, got 0.0 s and 0.0 s"),
        (lambda: BSpline(0.0, 1.0, SIX[1:], SIX[1:], SIX[1:], Q[:5]), "needs 6 poses, got 5"),
        (
            lambda: BSpline(0.0, 1.0, SIX, SIX, SIX, np.eye(4)[[0, 0, 0, 1, 1, 1]]),
            "from pose 3 to 4 the body rotates by 180.0°, more than the 150°",
        ),
    ],
)
def test_refusals(make: Callable[[], object], message: str) -> None:
    """The point at fault is named, and the way out."""
    with pytest.raises(ValueError, match=message):
        make()
