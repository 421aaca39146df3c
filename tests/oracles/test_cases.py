"""The yardstick itself: intervals of a case and errors of a position."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from tests.oracles.cases import CASES, CONTEXT, position_error, true_increments
from tests.oracles.polar import polar_flight
from tests.oracles.truth import manoeuvre, radii


@dataclass(frozen=True)
class Places:
    lat: np.ndarray
    lon: np.ndarray
    h: np.ndarray


def places(lat_deg: float, lon: float, h: float) -> Places:
    return Places(*(np.array([x]) for x in (np.radians(lat_deg), lon, h)))


@pytest.mark.parametrize("intervals", [(0.005,), (0.006, 0.004), (0.003, 0.005, 0.002)])
def test_edges_hold_the_context_on_both_sides(intervals):
    case = replace(CASES[0], intervals=intervals, duration=3.0)
    edges = case.edges()
    assert edges[CONTEXT] == 0.0
    assert edges[-1 - CONTEXT] == pytest.approx(3.0, abs=1e-12)  # s, round-off
    pattern = np.resize(np.roll(intervals, CONTEXT), edges.size - 1)
    np.testing.assert_allclose(np.diff(edges), pattern, atol=1e-14)  # s, round-off


def test_names_are_unique():
    names = [(case.name, c.reconstruction, c.mechanization) for case in CASES for c in case.claims]
    assert len(set(names)) == len(names)


def test_kept_increments_are_those_of_the_motion():
    edges = np.arange(5) * 0.01
    for motion in (manoeuvre(), polar_flight(1), polar_flight(-1), manoeuvre()):
        kept, made = true_increments(motion, edges), motion.increments(edges)
        np.testing.assert_array_equal(kept.dvel, made.dvel)
        np.testing.assert_array_equal(kept.dtheta, made.dtheta)
    with pytest.raises(ValueError, match="read-only"):
        kept.dvel[0] = 0.0


@pytest.mark.parametrize("lat_deg", [-77.0, 0.3, 48.0])
@pytest.mark.parametrize("lon", [0.4, np.pi])
def test_small_errors_are_metres_north_east_and_up(lat_deg, lon):
    truth = places(lat_deg, lon, 1200.0)
    meridian, transverse, _ = (float(r[0]) for r in radii(np.sin(truth.lat)))
    north, east, up = 3.0, -2.0, 0.7  # m
    lon_hat = lon + east / ((transverse + 1200.0) * np.cos(truth.lat))
    nav = Places(
        truth.lat + north / (meridian + 1200.0),
        np.remainder(lon_hat + np.pi, 2.0 * np.pi) - np.pi,
        truth.h + up,
    )
    error = position_error(nav, truth)
    # m: 3 m of 6e6 m along a curve
    np.testing.assert_allclose([error.north, error.east, error.up], [[3], [-2], [0.7]], atol=1e-5)
    assert error.horizontal == pytest.approx(np.hypot(3.0, 2.0), abs=1e-5)
    assert error.vertical == pytest.approx(0.7, abs=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_errors_at_a_pole_are_metres_too(side):
    """4 m from the pole on one meridian, 3 m on the next quarter: 5 m apart."""
    polar_radius = 6_399_593.626  # m, of curvature
    truth = places(side * (90.0 - np.degrees(4.0 / polar_radius)), 2.5, 0.0)
    nav = places(side * (90.0 - np.degrees(3.0 / polar_radius)), 2.5 - np.pi / 2, 0.2)
    error = position_error(nav, truth)
    assert error.horizontal == pytest.approx(5.0, abs=1e-6)
    assert error.vertical == pytest.approx(0.2, abs=1e-9)
    nowhere = places(side * 90.0, 0.0, 0.0), places(side * 90.0, 3.0, 0.0)
    assert position_error(*nowhere).horizontal < 1e-8  # m, round-off
