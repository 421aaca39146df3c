"""The polar motion against 120-digit arithmetic by another route, and where it goes."""

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.spatial.transform import Rotation

from tests.oracles import high_precision
from tests.oracles.constants import OMEGA
from tests.oracles.gravity import gravitation_e, meridian_gravity_mp, normal_gravity_zonal
from tests.oracles.high_precision import error
from tests.oracles.polar import geodetic, polar_flight
from tests.oracles.truth import ecef

POLES = (1, -1)
# Doubles without a short decimal form: far out, 1 cm and 3 m from the pole, turning, the far end.
TIMES = (41.3071, 250.0000353, 1150.0, 1234.5671, 3599.7531)  # s
EACH_POLE = pytest.mark.parametrize("pole", POLES)
EACH_TIME = pytest.mark.parametrize("t", TIMES)

TOL_F = 3e-14  # m/s^2, round-off of terms up to 10 m/s^2; gravity adds 1e-14
TOL_OMEGA = 2e-16  # rad/s, round-off of rates up to 0.2 rad/s
TOL_V = 2e-13  # m/s, round-off of 280 m/s
TOL_R = 3e-9  # m, latitude and height are rounded to 1 nm each
TOL_C = 2e-15  # rad, round-off of unit entries and of angles of 3 rad


def mp_pose(pole: int, t: mpf) -> tuple[mp.matrix, mp.matrix]:
    """C_eb and r_eb_e."""
    motion = polar_flight(pole)
    names = ("x", "y", "z", "roll", "pitch", "yaw")
    *r, roll, pitch, yaw = (high_precision.value(getattr(motion, name), t) for name in names)
    half_turn = mp.diag([1, -1, -1]) if pole > 0 else mp.eye(3)
    return half_turn * high_precision.from_euler(roll, pitch, yaw), mp.matrix(r)


def mp_rates(pole: int, t: float | mpf) -> tuple[mpf, ...]:
    return high_precision.felt(lambda t: mp_pose(pole, t), t)


def mp_matrix(q: np.ndarray) -> mp.matrix:
    """Rotation matrix of a unit quaternion, scalar first."""
    w, x, y, z = (mpf(float(part)) for part in q)
    return mp.matrix(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


@EACH_POLE
@EACH_TIME
def test_rates_match_inertial_derivation(pole, t):
    rates, exact = polar_flight(pole).rates(t), mp_rates(pole, t)
    assert error(rates.omega_ib_b, exact[:3]) < TOL_OMEGA
    assert error(rates.f_ib_b, exact[3:]) < TOL_F


@EACH_POLE
@EACH_TIME
def test_state_matches_position_and_its_derivative(pole, t):
    state = polar_flight(pole).state(t)
    with mp.workdps(high_precision.DIGITS):
        C_eb, r_e = mp_pose(pole, mpf(t))
        _, v_e, _ = high_precision.derivatives(lambda t: mp_pose(pole, t)[1], mpf(t))
        lat, lon, h = (mpf(float(x[0])) for x in (state.lat, state.lon, state.h))
        assert error(state.r_eb_e, r_e) < TOL_R
        assert mp.norm(high_precision.ecef(lat, lon, h) - r_e) < TOL_R
        assert error(state.v_eb_e, v_e) < TOL_V
        assert error(state.C_eb, C_eb) < TOL_C
        assert error(np.array(mp_matrix(state.q_eb[0]).tolist(), float), C_eb) < TOL_C
        # In n, at the longitude that the state gives, whatever it means here.
        C_en = high_precision.C_en(lat, lon)
        assert error(state.v_eb_n, C_en.T * v_e) < TOL_V
        C_nb = mp_matrix(state.q_nb[0])
        assert max(abs(x) for x in C_en * C_nb - C_eb) < TOL_C
    assert state.q_eb[0, 0] >= 0.0
    assert state.q_nb[0, 0] >= 0.0


@EACH_POLE
@pytest.mark.parametrize("begin", [249.9975, 1234.505])
def test_increments_match_high_precision_quadrature(pole, begin):
    edges = np.array([begin, begin + 0.005])  # s; the first holds the pole
    got = polar_flight(pole).increments(edges)
    with mp.workdps(40):
        rates: dict[mpf, tuple[mpf, ...]] = {}

        def rate(t: mpf, i: int) -> mpf:
            if t not in rates:
                rates[t] = mp_rates(pole, t)
            return rates[t][i]

        limits = [mpf(float(t)) for t in edges]
        exact = [mp.quadgl(lambda t, i=i: rate(t, i), limits, maxdegree=4) for i in range(6)]
    # The rates' tolerances times the interval of 5 ms.
    assert error(got.dtheta, exact[:3]) < TOL_OMEGA * 5e-3  # rad
    assert error(got.dvel, exact[3:]) < TOL_F * 5e-3  # m/s


@EACH_POLE
def test_it_crosses_the_pole(pole):
    t = np.arange(36_001) * 0.1  # s
    state = polar_flight(pole).state(t)
    from_axis = np.hypot(state.r_eb_e[:, 0], state.r_eb_e[:, 1])
    passes = [2500, 11_500, 20_500, 29_500]
    np.testing.assert_allclose(from_axis[passes], [0.0, 3.0, 0.0, 3.0], atol=1e-9)  # m
    assert np.flatnonzero(from_axis < 10.0).tolist() == passes
    speed = np.linalg.norm(state.v_eb_e, axis=1)
    assert np.all((speed[passes] > 200.0) & (speed[passes] < 300.0))  # m/s
    assert speed.min() > 100.0
    assert np.all((state.h > 0.0) & (state.h < 10_000.0))  # m
    assert np.degrees(pole * state.lat[0]) < 89.95
    assert np.all(pole * np.degrees(state.lat) > 89.4)


@pytest.mark.parametrize("dt", [0.0025, 0.005, 0.02])
def test_default_nodes_agree_with_more(dt):
    motion = polar_flight()
    edges = 249.5 + dt * np.arange(201)
    got, fine = motion.increments(edges), motion.increments(edges, nodes=16)
    assert np.abs(got.dtheta - fine.dtheta).max() < TOL_OMEGA * dt
    assert np.abs(got.dvel - fine.dvel).max() < TOL_F * dt


def test_attitude_forms_agree():
    state = polar_flight().state(np.linspace(0.0, 3600.0, 1001))
    from_q = Rotation.from_quat(state.q_eb, scalar_first=True).as_matrix()
    assert np.abs(state.C_eb - from_q).max() < 2e-15  # round-off of unit entries


LATITUDES = (-90.0, -89.99999, -66.6, -45.0, -1e-6, 0.0, 7.3, 30.0, 48.0, 89.9, 89.9999999, 90.0)


@pytest.mark.parametrize("h", [-1000.0, 0.0, 2500.25, 20_000.0])
def test_geodetic_coordinates_give_the_position_back(h):
    lat, lon = np.radians(LATITUDES), np.linspace(-3.1, 3.1, len(LATITUDES))
    r = ecef(lat, lon, np.full_like(lat, h))
    got_lat, got_lon, got_h = geodetic(r)
    for k in range(len(LATITUDES)):
        with mp.workdps(40):
            point = (mpf(float(x[k])) for x in (got_lat, got_lon, got_h))
            assert error(r[k], high_precision.ecef(*point)) < TOL_R
    assert np.abs(got_lat - lat).max() < 1e-15  # rad, 6 nm
    assert np.abs(got_h - h).max() < TOL_R


@pytest.mark.parametrize("h", [0.0, 12_000.0])
def test_gravitation_is_gravity_less_the_centrifugal_part(h):
    lat, lon = np.radians(LATITUDES), 0.7
    x, y, z = ecef(lat, np.full_like(lat, lon), np.full_like(lat, h)).T
    gamma = np.stack(gravitation_e(x, y, z), axis=1)
    zonal = normal_gravity_zonal(lat, h)
    for k, angle in enumerate(lat):
        exact = meridian_gravity_mp(mp.hypot(x[k], y[k]), mpf(z[k]))
        outward = np.hypot(x[k], y[k]) * OMEGA**2
        assert np.cos(lon) * gamma[k, 0] + np.sin(lon) * gamma[k, 1] + outward == pytest.approx(
            float(exact[0]), abs=1.5e-14
        )  # m/s^2, round-off
        assert gamma[k, 2] == pytest.approx(float(exact[1]), abs=1.5e-14)  # m/s^2, round-off
        down = -np.sin(angle) * gamma[k, 2] - np.cos(angle) * float(exact[0])
        assert zonal.down[k] == pytest.approx(down, abs=3e-14)  # m/s^2, round-off
