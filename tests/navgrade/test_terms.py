"""Terms taken out, one at a time, against equations of motion that never had them."""

from __future__ import annotations

import dataclasses
import itertools
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from earth.gravity import normal_gravity_n
from navgrade import NavState, Trajectory, navigate
from navgrade.mechanization import FLAT_WORLD, MECHANIZATIONS, Terms
from navgrade.mechanization import terms as earth_terms
from navgrade.navigation import TERMS, solve
from navgrade.reconstruction import BODY_TERMS, RECONSTRUCTIONS, reconstruct, takes_rates
from tests.navgrade.body import log_of, same_bits
from tests.navgrade.engine import samples, state_at
from tests.navgrade.test_coning import CONTEXT, SMALL, H, even_edges
from tests.oracles.cases import position_error
from tests.oracles.coning import Coning, Sculling, within
from tests.oracles.constants import E2, EQUATORIAL_RADIUS, OMEGA
from tests.oracles.gravity import normal_gravity_zonal
from tests.oracles.truth import Coordinate, Motion, manoeuvre, per_metre

Array = NDArray[np.float64]

CORRECTING = [name for name in RECONSTRUCTIONS if name != "none" and not takes_rates(name)]
DURATION = 60.0  # s
MOTION, BEGIN = manoeuvre(), 11.0  # s
DT = 0.01  # s


WORTH = {  # m after a minute, at least
    "earth-rate": 5.0,
    "transport-rate": 5.0,
    "coriolis": 20.0,
    "ellipsoid": 0.1,
    "gravity-height": 0.5,
    "gravity-latitude": 0.02,
    "north-gravity": 0.005,
}


# --- the equations of motion, with and without ----------------------------------------------------


def turned(q: Array, v: Array) -> Array:
    """C v of unit quaternions, row by row."""
    t = 2.0 * np.cross(q[:, 1:], v)
    return np.asarray(v + q[:, :1] * t + np.cross(q[:, 1:], t))


@cache
def twins() -> Array:
    """Latitude, longitude, height, velocity and attitude after `DURATION`, integrated afresh.

    A row without each of the Earth's terms. Groves (2013), 5.28 to 5.57, as differential equations
    of the rates an ideal IMU feels.
    """
    start = state_at(MOTION, BEGIN)
    keeps = {term: np.array([float(term != row) for row in WORTH]) for term in WORTH}

    def slope(t: float, flat: Array) -> Array:
        y = flat.reshape(len(WORTH), 10)
        lat, h, v = y[:, 0], y[:, 2], y[:, 3:6]
        q = y[:, 6:] / np.linalg.norm(y[:, 6:], axis=1, keepdims=True)
        felt = MOTION.rates(t)
        w2 = 1.0 - E2 * np.sin(lat) ** 2
        transverse = EQUATORIAL_RADIUS / np.sqrt(w2)
        keep = keeps["ellipsoid"]
        r_m = keep * transverse * (1.0 - E2) / w2 + (1.0 - keep) * 6_371_000.0 + h
        r_n = keep * transverse + (1.0 - keep) * 6_371_000.0 + h
        still = np.zeros(len(y))
        earth = OMEGA * np.stack([np.cos(lat), still, -np.sin(lat)], axis=1)
        transport = np.stack([v[:, 1] / r_n, -v[:, 0] / r_m, -v[:, 1] * np.tan(lat) / r_n], axis=1)
        keep = keeps["gravity-latitude"], keeps["gravity-height"]
        g = normal_gravity_zonal(
            keep[0] * lat + (1.0 - keep[0]) * start.lat, keep[1] * h + (1.0 - keep[1]) * start.h
        )
        gravity = np.stack([keeps["north-gravity"] * g.north, still, g.down], axis=1)
        coriolis = keeps["coriolis"][:, None] * np.cross(2.0 * earth + transport, v)
        frame = keeps["earth-rate"][:, None] * earth + keeps["transport-rate"][:, None] * transport
        spin = felt.omega_ib_b - turned(q * [1.0, -1.0, -1.0, -1.0], frame)
        y1 = np.empty_like(y)
        y1[:, 0], y1[:, 1], y1[:, 2] = v[:, 0] / r_m, v[:, 1] / (r_n * np.cos(lat)), -v[:, 2]
        y1[:, 3:6] = turned(q, np.broadcast_to(felt.f_ib_b, v.shape)) + gravity - coriolis
        y1[:, 6] = -0.5 * np.sum(q[:, 1:] * spin, axis=1)
        y1[:, 7:] = 0.5 * (q[:, :1] * spin + np.cross(q[:, 1:], spin))
        return y1.ravel()

    y = np.tile([start.lat, start.lon, start.h, *start.v_eb_n, *start.q_nb], len(WORTH))
    # latitudes are angles: 1e-13 of them is 0.6 um
    found = solve_ivp(slope, (BEGIN, BEGIN + DURATION), y, "DOP853", rtol=1e-12, atol=1e-13)
    assert found.success
    ends: Array = found.y[:, -1].reshape(len(WORTH), 10)
    return ends


def flown(**choices: Any) -> Trajectory:
    """The same flight by the engine."""
    edges = BEGIN + np.arange(-8, round(DURATION / DT) + 9) * DT
    nav = navigate(samples(MOTION.increments(edges)), state_at(MOTION, BEGIN), **choices)
    return nav[: round(DURATION / DT)]


@pytest.mark.parametrize("missing", WORTH)
def test_a_term_taken_out_was_never_there(missing: str) -> None:
    assert set(WORTH) == set(earth_terms.TERMS)
    nav, end = flown(without=missing)[-1:], twins()[list(WORTH).index(missing)]
    as_solution = Trajectory(
        nav.t, *(np.array([x]) for x in (*end[:3], end[3:6], end[6:10])), nav.status
    )
    error = position_error(nav, as_solution)
    # m: the step leaves 0.3 um; latitude and gravity to 1e-13 and 1e-12 in the twin
    assert max(error.horizontal, error.vertical) < 5e-6
    np.testing.assert_allclose(nav.v_eb_n[0], end[3:6], rtol=0, atol=5e-7)
    q = end[6:10] / np.linalg.norm(end[6:10])
    assert min(np.abs(nav.q_nb[0] - q).max(), np.abs(nav.q_nb[0] + q).max()) < 1e-10
    cost = position_error(nav, flown()[-1:])
    assert max(cost.horizontal, cost.vertical) > WORTH[missing]


def test_terms_of_an_aircraft_have_their_size() -> None:
    """250 m/s east at 10 km and 45 degrees: what each acceleration amounts to in a minute."""
    lat, h, speed, t = np.pi / 4, 10_000.0, 250.0, 60.0
    _, east = per_metre(lat, h)
    zero = Coordinate(0.0)
    flight = Motion(Coordinate(lat), Coordinate(0.2, speed * east), Coordinate(h), zero, zero, zero)
    log, state = samples(flight.increments(np.arange(6001) * 0.01)), state_at(flight, 0.0)

    def away(term: str) -> tuple[float, float, float]:
        error = position_error(navigate(log, state, without=term)[-1:], flight.state(t))
        return float(error.north[0]), float(error.east[0]), float(error.up[0])

    radius = 6_388_838.290121148 + h  # m, transverse: algorithms.md, section 4
    rate, g = speed / radius, 9.775414187888955
    # (2 omega sin + v tan / r) v north, the same up with the cosine: half of it times t^2
    pull = (2.0 * OMEGA * np.sin(lat) + rate) * speed
    lift = (2.0 * OMEGA * np.cos(lat) + rate) * speed
    north, _, up = away("coriolis")
    # 1 %: the level turns, and gravity changes with the height, by 1e-3 of what moves
    assert north == pytest.approx(0.5 * pull * t**2, rel=0.01)
    assert up == pytest.approx(-0.5 * lift * t**2, rel=0.01)
    # g tilt t^3 / 6: the north rates tilt to the east
    north, east_, _ = away("earth-rate")
    assert np.hypot(north, east_) == pytest.approx(g * OMEGA * np.cos(lat) * t**3 / 6.0, rel=0.01)
    north, east_, _ = away("transport-rate")
    assert np.hypot(north, east_) == pytest.approx(g * rate * t**3 / 6.0, rel=0.01)
    # a pull of 81 um/s^2 to the south is missed, 0.15 m
    gravity = normal_gravity_n(lat, h)[0]
    north, _, _ = away("north-gravity")
    assert north == pytest.approx(-0.5 * gravity * t**2, rel=0.01)


# --- corrections of the body stage ----------------------------------------------------------------


def rows_of(name: str, log: Any, without: str | None) -> tuple[Array, ...]:
    """Columns t, dt, phi, dv, dr."""
    pieces = list(reconstruct([log], name, without=without))
    columns = ("t", "dt", "phi", "dv", "dr")
    return tuple(np.concatenate([getattr(piece, c) for piece in pieces]) for c in columns)


def size_of(name: str) -> int:
    """Samples of one row."""
    return int(name[-1]) if name.startswith("samples") else 1


@pytest.mark.parametrize("name", CORRECTING)
def test_without_coning_all_of_it_is_left(name: str) -> None:
    """1/2 a^2 W (1 - sin(lambda) / lambda), whatever the algorithm."""
    motion = Coning(SMALL, 10.0)
    exact = motion.increments(even_edges(H, 1200))
    t, dt, phi, *_ = rows_of(name, samples(exact), "coning")
    rows = within(t, dt, exact.t[CONTEXT - 1], exact.t[-1 - CONTEXT])
    left = motion.drift(t[rows], dt[rows], phi[rows]) / (motion.half_angle**2 * motion.W)
    lam = motion.W * H * size_of(name)
    # of a^2 W: terms in a^4, 1e-10
    assert left == pytest.approx(-0.5 * (1.0 - np.sin(lam) / lam), rel=1e-5)


@pytest.mark.parametrize("name", CORRECTING)
def test_without_sculling_all_of_it_is_left(name: str) -> None:
    """The same share of angle times force, by duality: the rotation term sees none of it."""
    motion = Sculling(SMALL, 2.0, 10.0)
    exact = motion.increments(even_edges(H, 1200))
    t, dt, _, dv, _ = rows_of(name, samples(exact), "sculling")
    rows = within(t, dt, exact.t[CONTEXT - 1], exact.t[-1 - CONTEXT])
    left = motion.residual(t[rows], dt[rows], dv[rows]) / (motion.angle * motion.force)
    lam = motion.W * H * size_of(name)
    assert left[2] == pytest.approx(-0.5 * (1.0 - np.sin(lam) / lam), rel=1e-4)


@pytest.mark.parametrize("name", CORRECTING)
def test_what_is_taken_out_is_what_the_sums_say(name: str) -> None:
    """Uneven random samples: each term by itself from the sums of an update's increments."""
    log = log_of(np.random.default_rng(6).uniform(0.005, 0.015, 24))
    _, dt, phi, dv, dr = rows_of(name, log, None)
    size = size_of(name)
    theta, v = (x.reshape(-1, size, 3).sum(axis=1) for x in (log.gyro, log.accel))
    angle = np.linalg.norm(theta, axis=1, keepdims=True)
    turn = np.cross(theta, v)
    rotation = 2.0 * np.sin(0.5 * angle) ** 2 / angle**2 * turn
    rotation += (1.0 - np.sin(angle) / angle) / angle**2 * np.cross(theta, turn)
    sculling = dv - v - rotation
    wanted = {
        "coning": (theta, dv, dr),
        "rotation": (phi, dv - rotation, dr - 0.5 * dt[:, None] * rotation),
        "sculling": (phi, v + rotation, dr - 0.5 * dt[:, None] * sculling),
    }
    for term, columns in wanted.items():
        found = rows_of(name, log, term)[2:]
        for one, other in zip(found, columns, strict=True):
            # rad, m/s, m: rounding of 0.3 m/s; (1 - cos) loses digits here, not in the package
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-15)


@pytest.mark.parametrize(("name", "term"), list(itertools.product(CORRECTING, BODY_TERMS)))
def test_rows_without_a_term_do_not_depend_on_blocks(name: str, term: str) -> None:
    log = log_of(np.random.default_rng(7).uniform(0.005, 0.015, 60))

    def joined(size: int) -> list[bytes]:
        pieces = list(reconstruct(log.blocks(size), name, without=term))
        return [
            np.concatenate([getattr(piece, c) for piece in pieces]).tobytes()
            for c in ("t", "phi", "dv", "dr", "status")
        ]

    assert joined(1) == joined(17) == joined(60)


def test_no_rotation_and_no_memory_is_no_compensation() -> None:
    """causal-0 corrects the rotation alone; without it the velocity is that of none."""
    choices = {"vertical": "hold"}
    one = flown(reconstruction="causal-0", without="rotation", **choices)
    other = flown(reconstruction="none", **choices)
    error = position_error(one, other)
    # m: where an interval's velocity comes from within it moves the body by less than 4 um each
    assert error.horizontal < 0.02
    assert position_error(flown(reconstruction="causal-0", **choices), other).horizontal > 0.5


# --- nothing taken out, and refusals --------------------------------------------------------------


def bits(pieces: list[Trajectory]) -> list[bytes]:
    """All numbers of a solution."""
    names = ("t", "lat", "lon", "h", "v_eb_n", "q_nb", "status")
    return [np.concatenate([getattr(p, name) for p in pieces]).tobytes() for name in names]


def test_all_terms_kept_is_the_ordinary_run() -> None:
    """To the bit, by way of the ordinary kernel."""
    ordinary = bits([flown()])
    assert bits([flown(terms=Terms())]) == ordinary
    assert bits([flown(terms=Terms(*[1] * 7))]) == ordinary


@pytest.mark.parametrize("term", TERMS)
def test_one_entry_takes_every_term(term: str) -> None:
    """Also block by block, with the same bits; of the Earth's terms `Terms` says the same."""
    log = samples(MOTION.increments(BEGIN + np.arange(401) * DT))
    state = state_at(MOTION, BEGIN)
    whole = bits([navigate(log, state, without=term)])
    assert bits(list(solve(log.blocks(37), state, without=term))) == whole
    assert whole != bits([navigate(log, state)])
    if term in earth_terms.TERMS:
        without = Terms()._replace(**{term.replace("-", "_"): False})
        assert earth_terms.without(term) == without
        assert bits([navigate(log, state, terms=without)]) == whole


SHORT_LOG = log_of(np.full(30, 0.01))
STATE = NavState(lat=0.8, lon=0.1, h=10.0, t=float(SHORT_LOG.t[3]))
OTHERS = [*(name for name in MECHANIZATIONS if name != "n"), *FLAT_WORLD]


@pytest.mark.parametrize("frame", OTHERS)
def test_terms_belong_to_frame_n(frame: str) -> None:
    choices: tuple[Any, ...] = ({"without": "coriolis"}, {"without": "coning"}, {"terms": Terms()})
    for choice in choices:
        with pytest.raises(ValueError, match=f"in frame n alone, not in '{frame}'"):
            navigate(SHORT_LOG, STATE, mechanization=frame, **choice)


@pytest.mark.parametrize("term", BODY_TERMS)
@pytest.mark.parametrize("name", [n for n in RECONSTRUCTIONS if n not in CORRECTING])
def test_what_is_not_corrected_cannot_be_taken_out(name: str, term: str) -> None:
    with pytest.raises(ValueError, match=f"'{name}' has no {term} term to take out"):
        navigate(SHORT_LOG, STATE, reconstruction=name, without=term)


def test_contradictions_and_unknown_names() -> None:
    with pytest.raises(ValueError, match=r"'corolis' is not one of .*did you mean 'coriolis'"):
        navigate(SHORT_LOG, STATE, without="corolis")
    with pytest.raises(ValueError, match="term 'coning' is not one of earth-rate"):
        earth_terms.without("coning")
    with pytest.raises(ValueError, match="terms or without, not both"):
        navigate(SHORT_LOG, STATE, without="coriolis", terms=Terms())
    compensated = dataclasses.replace(SHORT_LOG, kind="compensated")
    with pytest.raises(ValueError, match="coning cannot be taken out of increments the sensor"):
        navigate(compensated, STATE, without="coning")


def test_a_missing_body_term_leaves_the_algorithm_as_it_was() -> None:
    log = log_of(np.full(40, 0.01))
    before = next(reconstruct([log], "causal-3"))
    next(reconstruct([log], "causal-3", without="sculling"))
    assert same_bits(next(reconstruct([log], "causal-3")), before)
