"""States at given times, and the difference of two."""

from __future__ import annotations

import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from navgrade import NavState, Trajectory
from navgrade.compare.sampling import States, at_times, difference, in_plane, states_of
from navgrade.errors import NumericalError
from tests.navgrade.engine import state_at
from tests.oracles.truth import turning_vehicle

MOTION = turning_vehicle()


def solution(t: np.ndarray) -> Trajectory:
    """The true states, as an engine would hand them on."""
    s = MOTION.state(t)
    return Trajectory(t, s.lat, s.lon, s.h, s.v_eb_n, s.q_nb, np.zeros(len(t), np.uint32))


def start() -> NavState:
    return state_at(MOTION, 0.0)


def test_rows_that_coincide_are_taken_as_they_are() -> None:
    """In pieces of any size, and the state at the start itself."""
    t = np.arange(1, 1001) * 0.01
    nav = solution(t)
    pieces = [nav[:1], nav[1:333], nav[333:334], nav[334:]]
    wanted = np.array([0.0, 0.01, 0.02, 3.33, 3.34, 3.35, 9.99, 10.0])
    found, ended = at_times(pieces, start(), wanted)
    assert ended is None
    rows = np.round(wanted[1:] / 0.01).astype(int) - 1
    for got, known in zip(found, states_of(nav), strict=True):
        assert np.array_equal(got[1:], known[rows])
    assert found.lat[0] == start().lat


def test_between_rows_the_motion_is_followed() -> None:
    """At 10 Hz, 4 m/s² and 0.3 rad/s: the cubic is off by a jerk's worth, 0.1 s³ · 10 m/s³/100."""
    nav = solution(np.arange(1, 101) * 0.1)
    wanted = np.arange(1, 199) * 0.05 + 0.013
    found, _ = at_times([nav[:7], nav[7:60], nav[60:]], start(), wanted)
    apart = difference(found, states_of(solution(wanted)))
    assert np.abs(apart.position).max() < 1e-4  # m
    assert np.abs(apart.velocity).max() < 0.02  # m/s: between rows it is a straight line
    assert np.abs(apart.attitude).max() < 1e-3  # rad: turned at a constant rate


def test_across_the_date_line() -> None:
    q = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    v = np.tile([0.0, 100.0, 0.0], (2, 1))
    turn = 50.0 / (6388838.29 * np.cos(0.7))  # rad of longitude in half a second, about
    lon = np.array([np.pi - turn, -np.pi + turn])
    nav = Trajectory(np.array([1.0, 2.0]), [0.7] * 2, lon, [0.0] * 2, v, q, np.zeros(2, np.uint32))
    begin = NavState(0.7, lon[0] - 2.0 * turn, 0.0, v[0], q[0])
    found, _ = at_times([nav], begin, np.array([1.5]))
    assert abs(abs(found.lon[0]) - np.pi) < 1e-12


def test_a_solution_that_ends_early() -> None:
    def pieces():
        yield solution(np.arange(1, 101) * 0.01)
        raise NumericalError("the frame ends at 1.0 s", index=100, t=1.0)

    found, ended = at_times(pieces(), start(), np.array([0.5, 1.0, 1.5, 2.0]))
    assert ended == "the frame ends at 1.0 s"
    assert np.isfinite(found.h[:2]).all() and np.isnan(found.h[2:]).all()
    apart = difference(found, states_of(solution(np.array([0.5, 1.0, 1.5, 2.0]))))
    assert np.isnan(apart.position[2:]).all() and np.isnan(apart.attitude[2:]).all()


@pytest.mark.parametrize("far", [1e-6, 1.0, 3e5])  # m
def test_difference_of_positions_and_the_plane(far: float) -> None:
    """Against pymap3d's local axes: rounding, and 1e-12 of the distance, its own inverse's."""
    lat, lon, h = -0.6, 3.1, 1234.5
    r = np.array([0.6, -0.7, 0.3]) * far
    place = pymap3d.enu2geodetic(r[1], r[0], -r[2], lat, lon, h, deg=False)
    q = np.array([[1.0, 0.0, 0.0, 0.0]])

    def states(lat: float, lon: float, h: float) -> States:
        return States(*(np.array([x]) for x in (lat, lon, h)), np.zeros((1, 3)), q)

    apart = difference(states(*place), states(lat, lon, h))
    assert apart.position[0] == pytest.approx(r, abs=4e-9 + 1e-12 * far)
    plane = in_plane(states(*place), lat, lon, h)
    assert plane[0] == pytest.approx([r[1], r[0], -r[2]], abs=4e-9 + 1e-12 * far)


def test_difference_of_velocities_and_attitudes() -> None:
    """Of two far places: vectors compared in the Earth-fixed frame, turned by SciPy."""

    def q_en(lat: float, lon: float) -> Rotation:
        return Rotation.from_euler("ZY", [lon, -np.pi / 2 - lat])

    places = [(0.9, -1.3, 10.0), (0.95, -1.2, 20.0)]
    C = Rotation.from_euler("ZYX", [2.8, -0.4, 0.3])
    phi = np.array([3e-4, -2e-4, 5e-4])
    v = np.array([12.0, -3.0, 0.5])
    dv = np.array([0.02, 0.01, -0.03])
    to_there = q_en(*places[1][:2]).inv() * q_en(*places[0][:2])
    C_hat = to_there * Rotation.from_rotvec(-phi) * C

    def states(place: tuple[float, float, float], v: np.ndarray, C: Rotation) -> States:
        q = C.as_quat(scalar_first=True)
        return States(*(np.array([x]) for x in place), v[None, :], q[None, :])

    apart = difference(states(places[1], to_there.apply(v + dv), C_hat), states(places[0], v, C))
    assert apart.velocity[0] == pytest.approx(dv, abs=1e-13)  # m/s
    assert apart.attitude[0] == pytest.approx(phi, abs=1e-14)  # rad
