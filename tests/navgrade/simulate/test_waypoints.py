"""Interpolating splines against their own definition in high precision."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline

from navgrade.simulate import Waypoints, imu_rates, true_trajectory
from tests.navgrade.simulate.exact import (
    DEG,
    Pose,
    closing,
    cox_de_boor,
    mismatch,
    over_earth,
    rotation,
)
from tests.oracles.truth import quaternion

Array = NDArray[np.float64]
RNG = np.random.default_rng(4)


def track(n: int = 30) -> tuple[Array, Array, Array, Array]:
    """A bending track of 30 to 40 m/s in the south across the antimeridian, unevenly sampled."""
    t = 100.0 + np.cumsum(RNG.uniform(3.0, 5.0, n))
    course, speed = 1.5 * np.sin(0.05 * t), 35.0 + 5.0 * np.sin(0.07 * t)
    step = np.diff(t, prepend=t[0]) * speed
    lat = -38.0 * DEG + np.cumsum(step * np.cos(course)) / 6.36e6
    lon = 179.99 * DEG + np.cumsum(step * np.sin(course)) / 5.0e6
    lon = (lon + np.pi) % (2.0 * np.pi) - np.pi
    assert lon.max() - lon.min() > 6.0
    return t, lat, lon, 50.0 + 10.0 * np.sin(0.1 * t)


def tumbling(n: int) -> Array:
    """Random attitudes up to 115° apart, with random signs."""
    q = RNG.standard_normal(4)
    rows = []
    for _ in range(n):
        q = q / np.linalg.norm(q)
        turn = RNG.standard_normal(3)
        half = 0.5 * RNG.uniform(0.3, 2.0)
        w, v = np.cos(half), np.sin(half) * turn / np.linalg.norm(turn)
        q = np.array([w * q[0] - v @ q[1:], *(w * q[1:] + q[0] * v + np.cross(q[1:], v))])
        rows.append(q * RNG.choice([-1.0, 1.0]))
    return np.array(rows)


T, LAT, LON, H = track()
Q = tumbling(len(T))


def test_passes_through_its_points() -> None:
    """Places and attitudes at the waypoints are the ones given."""
    truth = true_trajectory(Waypoints(T, LAT, LON, H, Q), T)
    assert truth.lat == pytest.approx(LAT, abs=1e-15)  # rad: 6 nm
    assert truth.lon == pytest.approx(LON, abs=1e-15)
    assert truth.h == pytest.approx(H, abs=1e-8)  # m
    assert np.abs(np.sum(truth.q_nb * Q, axis=1)) == pytest.approx(1.0, abs=1e-14)


def pose() -> Pose:
    """Of the spline through the waypoints, by the recursion of Cox and de Boor."""
    signs = np.cumprod(np.append(1.0, np.sign(np.sum(Q[1:] * Q[:-1], axis=1))))
    away = np.stack([LAT - LAT[0], np.unwrap(LON) - LON[0], H - H[0]], axis=1)
    spline = make_interp_spline(T, np.concatenate([away, Q * signs[:, None]], axis=1), k=5)

    def at(t: mpf) -> tuple[mp.matrix, mp.matrix]:
        span = int(np.searchsorted(spline.t, float(t), side="right")) - 1
        near = range(span - 5, span + 1)
        weights = [cox_de_boor(spline.t, k, 5, t) for k in near]
        lat, lon, h, *q = (
            sum(w * mpf(float(spline.c[k, i])) for w, k in zip(weights, near, strict=True))
            for i in range(7)
        )
        place = mpf(float(LAT[0])) + lat, mpf(float(LON[0])) + lon, mpf(float(H[0])) + h
        return over_earth(*place, rotation(q))

    return at


def test_rates() -> None:
    """Rates, force and velocity agree with high precision to rounding."""
    here = pose()
    found = mismatch(Waypoints(T, LAT, LON, H, Q), lambda _: here, (T[0] + 0.1, 131.7, 180.3))
    # a few roundings of 1 rad/s, 12 m/s^2 and 40 m/s
    assert found.omega < 4e-15  # rad/s
    assert found.f < 5e-14  # m/s^2
    assert found.v < 1e-13  # m/s


@pytest.mark.parametrize("q_nb", [None, Q], ids=["along the path", "tumbling"])
def test_closes(q_nb: Array | None) -> None:
    """A hundred seconds, navigated, end where they end."""
    error = closing(Waypoints(T, LAT, LON, H, q_nb), np.arange(T[0], T[-1], 0.005))
    assert max(error.horizontal, error.vertical) < 1e-7  # m: roundings of positions


def test_points_along_its_path() -> None:
    """Without attitudes the body looks where it goes; standing it keeps its direction."""
    t = np.arange(20.0)
    forward = np.concatenate([np.zeros(6), np.cumsum(np.minimum(np.arange(14.0), 8.0))])
    course = 2.0
    lat = 0.8 + forward * np.cos(course) / 6.37e6
    lon = 0.3 + forward * np.sin(course) / (6.39e6 * np.cos(0.8))
    motion = Waypoints(t, lat, lon, 5.0 + 0.1 * forward)
    roll, pitch, heading = true_trajectory(motion, np.linspace(0.0, 19.0, 90)).euler.T
    assert np.abs(roll).max() < 1e-12
    # rad: a sphere of 6370 km for the Earth is this far off
    assert heading == pytest.approx(course, abs=3e-3)
    assert pitch == pytest.approx(np.arctan(0.1), abs=3e-3)


@pytest.mark.parametrize("turned", ["body", "reference"])
def test_attitude_depends_on_no_axes(turned: str) -> None:
    """Other axes of the body, or of the reference, give the same motion in those axes."""
    half = 0.7
    c, s = np.cos(half), np.sin(half)
    w, x, y, z = Q.T
    if turned == "body":  # about its x axis
        other = np.stack([c * w - s * x, s * w + c * x, c * y + s * z, c * z - s * y], axis=1)
    else:
        other = np.stack([c * w - s * x, s * w + c * x, c * y - s * z, c * z + s * y], axis=1)
    t = np.linspace(T[0], T[-1], 55)
    one = true_trajectory(Waypoints(T, LAT, LON, H, Q), t).q_nb
    two = true_trajectory(Waypoints(T, LAT, LON, H, other), t).q_nb
    w, x, y, z = one.T
    if turned == "body":
        expected = np.stack([c * w - s * x, s * w + c * x, c * y + s * z, c * z - s * y], axis=1)
    else:
        expected = np.stack([c * w - s * x, s * w + c * x, c * y - s * z, c * z + s * y], axis=1)
    assert np.abs(np.sum(two * expected, axis=1)) == pytest.approx(1.0, abs=1e-14)


def test_smooth_across_knots() -> None:
    """Rates, force and angular acceleration do not jump."""
    motion, gap = Waypoints(T, LAT, LON, H, Q), 1e-6  # s
    before, after = (
        np.concatenate(
            [*imu_rates(motion, motion.knots + side), motion.at(motion.knots + side).alpha_eb_b],
            axis=None,
        )
        for side in (-gap, gap)
    )
    assert np.abs(after - before).max() < 2.0 * gap * 30.0  # of slopes up to 30 per s


def changed(column: int, row: int, value: float) -> Callable[[], Waypoints]:
    """The track with one number changed."""
    columns = [T.copy(), LAT.copy(), LON.copy(), H.copy()]
    columns[column][row] = value
    return lambda: Waypoints(*columns)


def kinked() -> Waypoints:
    """Out and back on the same line."""
    t = np.arange(8.0)
    return Waypoints(t, 0.5 + np.array([0, 1, 2, 3, 2, 1, 0, -1]) * 1e-6, np.full(8, 1.0), 0.0 * t)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (changed(0, 5, T[4]), r"waypoints 5 and 6 are both at [\d.]+ s"),
        (
            changed(0, 5, T[3]),
            r"time goes back from [\d.]+ s at waypoint 5 to [\d.]+ s at waypoint 6",
        ),
        (changed(3, 2, np.nan), "h of waypoint 3 must be finite, got"),
        (changed(1, 7, 89.5 * DEG), "waypoint 8 is at latitude 89.5000°, beyond ±89°"),
        (kinked, "kink of 180° at waypoint 4, 3 s; slow down there"),
        (lambda: Waypoints(T[:5], LAT[:5], LON[:5], H[:5]), "needs 6 waypoints, got 5"),
        (lambda: Waypoints(T, LAT[:-1], LON, H), "of one length, got 30, 29, 30 and 30"),
        (lambda: Waypoints(T, LAT, LON, H[:, None]), "h must have one dimension"),
        (lambda: Waypoints(T, LAT, LON, H, Q[:, :3]), r"q_nb must have shape \(30, 4\)"),
        (
            lambda: Waypoints(T, LAT, LON, H, 1.1 * Q),
            "q_nb of waypoint 1 must be a unit quaternion",
        ),
        (
            lambda: Waypoints(T, 0.0 * T, 0.0 * T, H),
            "no waypoint moves faster than 0.5 m/s, .* give attitudes",
        ),
        (
            lambda: Waypoints(
                T, LAT, LON, H, quaternion(*np.array([0, 0, 2.2])[:, None] * (T > 120))
            ),
            r"from waypoint \d+ to \d+ the body rotates by 126.1°, more than the 120°",
        ),
    ],
)
def test_refusals(make: Callable[[], object], message: str) -> None:
    """The waypoint at fault is named, and the way out."""
    with pytest.raises(ValueError, match=message):
        make()
