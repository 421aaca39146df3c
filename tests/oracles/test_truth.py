"""The oracle against 120-digit arithmetic by another route, and against literature values."""

from functools import cache

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.spatial.transform import Rotation

from tests.oracles import high_precision, truth
from tests.oracles.gravity import normal_gravity_mp, normal_gravity_zonal
from tests.oracles.high_precision import error

STILL, RAMP = 60.0, 20.0  # s

MOTIONS = {
    "turning": truth.turning_vehicle(),
    "vibrating": truth.vibrating_vehicle(),
    "static_north": truth.static(51.08, -114.13, 1118.5, 3.0, -2.0, 130.0),
    "static_south": truth.static(-33.9, 18.4, -20.0, -170.0, 80.0, 275.0),
    "manoeuvre": truth.manoeuvre(),
    "airliner": truth.vibrating_airliner(),
    "road": truth.road_drive(),
    "road_from_rest": truth.start_from_rest(truth.road_drive(), STILL, RAMP),
    "vibrating_from_rest": truth.start_from_rest(truth.vibrating_vehicle(), STILL, RAMP),
}
# Doubles without a short decimal form: still, both halves of the ramp, driving, and the far end.
TIMES = (41.3071, 64.7719, 73.1313, 97.5317, 1234.5671, 3599.7531)  # s
EACH_MOTION = pytest.mark.parametrize("name", MOTIONS)
EACH_TIME = pytest.mark.parametrize("t", TIMES)

# Round-off of float64 on sums of terms near 20 m/s^2 is 4e-15 m/s^2 a term; gravity adds 1e-14,
# and a heading of 226 rad after an hour is rounded to 1.4e-14 rad, which turns 12 m/s^2.
TOL_F = 3e-13  # m/s^2
# Round-off of rates up to 0.3 rad/s. Inside the ramp the clock of 20 s is rounded to 3.6e-15 s,
# which moves a 10 Hz vibration of 6.9 rad/s^2.
TOL_OMEGA = {name: 2.5e-14 if name == "vibrating_from_rest" else 2e-16 for name in MOTIONS}  # rad/s
TOL_V = 1e-13  # m/s, round-off of 400 m/s
TOL_R = 3e-9  # m, a latitude or longitude of 2 rad is rounded to 2.8e-9 m
TOL_C = 5e-14  # rad, heading of 226 rad as above


def mp_clock(start: truth.SmoothStart | None, t: mpf) -> mpf:
    """tau(t): the ninth-degree smooth step is the distribution of Beta(5, 5)."""
    if start is None:
        return t
    u = (t - mpf(start.t_still)) / mpf(start.t_ramp)
    if u <= 0:
        return mpf(0)
    if u >= 1:
        return mpf(start.t_ramp) * (u - mpf(1) / 2)
    step, moment = (mp.betainc(k, 5, 0, u, regularized=True) for k in (5, 6))
    return mpf(start.t_ramp) * (u * step - moment / 2)


def mp_coordinates(motion: truth.Motion, t: mpf) -> list[mpf]:
    tau = mp_clock(motion.start, t)
    names = ("lat", "lon", "h", "roll", "pitch", "heading")
    return [high_precision.value(getattr(motion, name), tau) for name in names]


@cache
def mp_rates(name: str, t: float | mpf) -> tuple[mpf, ...]:
    def pose(t: mpf) -> tuple[mp.matrix, mp.matrix]:
        lat, lon, h, *angles = mp_coordinates(MOTIONS[name], t)
        C_nb = high_precision.from_euler(*angles)
        return high_precision.C_en(lat, lon) * C_nb, high_precision.ecef(lat, lon, h)

    return high_precision.felt(pose, t)


@EACH_MOTION
@EACH_TIME
def test_rates_match_inertial_derivation(name, t):
    rates = MOTIONS[name].rates(t)
    exact = mp_rates(name, t)
    assert error(rates.omega_ib_b, exact[:3]) < TOL_OMEGA[name]
    assert error(rates.f_ib_b, exact[3:]) < TOL_F


@EACH_MOTION
@EACH_TIME
def test_state_matches_position_and_its_derivative(name, t):
    state, motion = MOTIONS[name].state(t), MOTIONS[name]
    with mp.workdps(high_precision.DIGITS):
        lat, lon, _, *angles = mp_coordinates(motion, mpf(t))
        r_true, v_e, _ = high_precision.derivatives(
            lambda t: high_precision.ecef(*mp_coordinates(motion, t)[:3]), mpf(t)
        )
        v_n = high_precision.C_en(lat, lon).T * v_e
        C_nb = high_precision.from_euler(*angles)
        r = high_precision.ecef(*(mpf(float(x[0])) for x in (state.lat, state.lon, state.h)))
        assert mp.norm(r - r_true) < TOL_R
        assert error(truth.ecef(state.lat, state.lon, state.h), r_true) < TOL_R
    assert error(state.v_eb_n, v_n) < TOL_V
    assert error(state.C_nb, C_nb) < TOL_C


@pytest.mark.parametrize("name", ["vibrating", "manoeuvre", "road_from_rest"])
def test_increments_match_high_precision_quadrature(name):
    edges = np.array([3599.005, 3599.010])  # s
    if name == "road_from_rest":
        edges += 71.2 - 3599.0  # inside the ramp
    got = MOTIONS[name].increments(edges)
    with mp.workdps(40):
        exact = [
            mp.quadgl(lambda t, i=i: mp_rates(name, t)[i], list(map(mpf, edges)), maxdegree=4)
            for i in range(6)
        ]
    # The rates' tolerances times the interval of 5 ms.
    assert error(got.dtheta, exact[:3]) < TOL_OMEGA[name] * 5e-3  # rad
    assert error(got.dvel, exact[3:]) < TOL_F * 5e-3  # m/s


@EACH_MOTION
@pytest.mark.parametrize("dt", [0.0025, 0.005, 0.01, 0.02])
def test_default_nodes_agree_with_more(name, dt):
    motion = MOTIONS[name]
    for first in (STILL - 1.0, STILL + RAMP - 1.0, 3000.0):
        edges = first + dt * np.arange(201)
        got, fine = motion.increments(edges), motion.increments(edges, nodes=16)
        # Round-off of the rates: 1e-16 of the increments or little more.
        assert np.abs(got.dtheta - fine.dtheta).max() < TOL_OMEGA[name] * dt
        assert np.abs(got.dvel - fine.dvel).max() < TOL_F * dt


def test_smooth_motion_needs_few_nodes():
    assert truth.turning_vehicle().nodes_for(0.005) <= 5
    assert truth.vibrating_vehicle().nodes_for(0.005) <= 10
    with pytest.raises(ValueError, match="too long"):
        truth.vibrating_vehicle().nodes_for(10.0)


def test_increments_add_up_over_uneven_edges():
    rng = np.random.default_rng(1)
    edges = 500.0 + np.concatenate(([0.0], np.cumsum(rng.uniform(0.001, 0.02, 6000))))
    fine = MOTIONS["vibrating"].increments(edges)
    coarse = MOTIONS["vibrating"].increments(edges[::2])
    np.testing.assert_array_equal(fine.t, edges[1:])
    np.testing.assert_array_equal(fine.dt, np.diff(edges))
    # Two units in the last place of the increments, 0.01 rad and 0.5 m/s.
    for a, b, tol in ((fine.dtheta, coarse.dtheta, 4e-18), (fine.dvel, coarse.dvel, 2e-15)):
        assert np.abs(a[::2] + a[1::2] - b).max() < tol


@pytest.mark.parametrize("edges", [[1.0], [1.0, 1.0], [2.0, 1.0], [0.0, np.nan]])
def test_increments_reject_bad_edges(edges):
    with pytest.raises(ValueError, match="edges"):
        MOTIONS["road"].increments(edges)


@EACH_MOTION
def test_attitude_forms_agree(name):
    state = MOTIONS[name].state(np.linspace(0.0, 3600.0, 1001))
    angles = np.stack([state.heading, state.pitch, state.roll], axis=1)
    expected = Rotation.from_euler("ZYX", angles).as_matrix()
    # Round-off of unit entries and of a heading of 226 rad.
    assert np.abs(state.C_nb - expected).max() < 1e-13
    from_q = Rotation.from_quat(state.q_nb, scalar_first=True).as_matrix()
    assert np.abs(state.C_nb - from_q).max() < 1e-13
    assert np.all(state.q_nb[:, 0] >= 0.0)
    assert np.all((state.heading >= 0.0) & (state.heading < 2.0 * np.pi))


def test_motions_are_what_they_are_named():
    t = np.linspace(0.0, 3600.0, 36001)
    state = MOTIONS["turning"].state(t)
    speed = np.linalg.norm(state.v_eb_n[:, :2], axis=1)
    assert np.all(np.abs(speed - 100.0) < 0.1)  # m/s, radii vary over the circle
    assert np.degrees(np.abs(state.roll)).min() > 27.0

    rates = MOTIONS["manoeuvre"].rates(t)
    assert np.linalg.norm(rates.omega_ib_b, axis=1).max() == pytest.approx(0.19, abs=0.01)
    assert np.linalg.norm(rates.f_ib_b, axis=1).max() == pytest.approx(16.6, abs=0.1)

    v_eb_n = MOTIONS["road"].state(t).v_eb_n
    assert np.all(np.abs(np.linalg.norm(v_eb_n[:, :2], axis=1) - 17.0) < 2.01)  # m/s
    track = np.arctan2(v_eb_n[:, 1], v_eb_n[:, 0])
    sideslip = np.angle(np.exp(1j * (track - MOTIONS["road"].state(t).heading)))
    assert np.abs(sideslip).max() < 1e-3  # rad
    climb = np.arctan2(-v_eb_n[:, 2], np.linalg.norm(v_eb_n[:, :2], axis=1))
    nod = np.degrees(MOTIONS["road"].state(t).pitch - climb)
    assert np.all(np.abs(nod - 0.5) < 0.65)  # deg, 0.5 of nodding and a slope taken at 17 m/s

    v_eb_n = MOTIONS["airliner"].state(t).v_eb_n
    assert np.all(np.abs(np.linalg.norm(v_eb_n, axis=1) - 230.0) < 7.0)  # m/s


FINE = 777.0 + 0.001 * np.arange(1000)  # s


def added(shaken: truth.Motion, plain: truth.Motion) -> tuple[np.ndarray, ...]:
    """Specific force in n, roll and pitch that `shaken` has over `plain`."""
    states = shaken.state(FINE), plain.state(FINE)
    forces = shaken.rates(FINE).f_ib_b, plain.rates(FINE).f_ib_b
    f_n = [np.einsum("kij,kj->ki", s.C_nb, f) for s, f in zip(states, forces, strict=True)]
    return f_n[0] - f_n[1], states[0].roll - states[1].roll, states[0].pitch - states[1].pitch


def test_vibration_is_in_phase_with_the_rotation_that_makes_it_scull():
    f_n, roll, pitch = added(MOTIONS["vibrating"], MOTIONS["turning"])
    wave = np.sin(20.0 * np.pi * FINE)
    # 1 m/s^2 by design; a swaying speed of 16 mm/s moves the Coriolis term by 2 um/s^2.
    np.testing.assert_allclose(f_n[:, 0], wave, atol=1e-5)
    # rad: the phases of 1e5 rad used here are rounded to 1.5e-11, times 2e-3 rad.
    np.testing.assert_allclose(roll, np.radians(0.1) * wave, atol=1e-12)
    np.testing.assert_allclose(pitch, np.radians(0.1) * np.cos(20.0 * np.pi * FINE), atol=1e-12)

    f_n, roll, pitch = added(MOTIONS["airliner"], truth.airliner())
    wave = np.sin(30.0 * np.pi * FINE)
    # 1 m/s^2; a heaving speed of 11 mm/s moves the Coriolis term by 2 um/s^2, the height of
    # 0.1 mm gravity by 0.3 nm/s^2.
    np.testing.assert_allclose(-f_n[:, 2], wave, atol=1e-5)
    cone = 40.0 * np.pi * FINE
    np.testing.assert_allclose(roll, np.radians(0.05) * (wave + np.sin(cone)), atol=1e-12)
    np.testing.assert_allclose(pitch, np.radians(0.05) * (wave + np.cos(cone)), atol=1e-12)


def test_start_from_rest_is_still_and_joins_the_base():
    base, started = MOTIONS["road"], MOTIONS["road_from_rest"]
    still = np.linspace(0.0, STILL, 101)
    assert np.all(started.state(still).v_eb_n == 0.0)
    assert np.all(started.state(still).C_nb == base.state(0.0).C_nb)
    names = ("lat", "lon", "h", "roll", "pitch", "heading")
    frozen = truth.Motion(*(truth.Coordinate(getattr(base.state(0.0), n).item()) for n in names))
    np.testing.assert_array_equal(started.rates(still).f_ib_b, frozen.rates(still).f_ib_b)
    np.testing.assert_array_equal(started.rates(still).omega_ib_b, frozen.rates(still).omega_ib_b)
    drive = np.array([100.0, 700.0])
    joined, expected = started.rates(STILL + RAMP / 2 + drive), base.rates(drive)
    assert np.abs(joined.f_ib_b - expected.f_ib_b).max() < 1e-13  # m/s^2, round-off


LATITUDES = (-90.0, -66.6, -45.0, -33.5, -1.0, 0.0, 7.3, 30.0, 48.0, 60.0, 89.9)  # deg
HEIGHTS = (-1000.0, 0.0, 500.0, 2500.25, 12000.0, 20000.0)  # m


@pytest.mark.parametrize("h", HEIGHTS)
def test_gravity_routes_agree(h):
    lat = np.radians(LATITUDES)
    zonal = normal_gravity_zonal(lat, h)
    for k, angle in enumerate(lat):
        exact = normal_gravity_mp(float(angle), h)
        # Eight units in the last place of 9.8 m/s^2; far below 1e-13 m/s^2.
        assert error(zonal.down[k], [exact.down]) < 1.5e-14
        assert error(zonal.north[k], [exact.north]) < 1e-15  # m/s^2, its parts are 0.03 m/s^2


# deg, m, m/s^2 down and north: GeographicLib 2.1.2 NormalGravity::WGS84().
LITERATURE = (
    (0.0, 0.0, 9.780325335903892, 0.0),
    (0.0, 20000.0, 9.718858773096203, 0.0),
    (30.0, 0.0, 9.793247269219322, 0.0),
    (30.0, 1000.0, 9.790161296095843, -7.0547144677e-6),
    (30.0, 10000.0, 9.762452727353303, -7.04741969945e-5),
    (45.0, 0.0, 9.806197769377376, 0.0),
    (45.0, 1000.0, 9.803112896932381, -8.14359054512e-6),
    (45.0, 20000.0, 9.744774795528002, -1.62517643965e-4),
    (60.0, 0.0, 9.819176953118638, 0.0),
    (60.0, 10000.0, 9.788404356605226, -7.0431580534e-5),
    (90.0, 0.0, 9.832184937863400, 0.0),
    (90.0, 20000.0, 9.770805746907038, 0.0),
    (-33.5, 2500.25, 9.788362616313032, 1.87436627177e-5),
)


@pytest.mark.parametrize(("lat_deg", "h", "down", "north"), LITERATURE)
def test_gravity_matches_literature(lat_deg, h, down, north):
    lat = np.radians(lat_deg)
    exact, zonal = normal_gravity_mp(mp.radians(mpf(lat_deg)), h), normal_gravity_zonal(lat, h)
    for gravity in (exact, zonal):
        assert float(gravity.down) == pytest.approx(down, abs=1.5e-14)  # m/s^2, round-off
        assert float(gravity.north) == pytest.approx(north, abs=1.5e-14)  # m/s^2, round-off


def test_gravity_at_equator_and_pole_to_18_digits():
    # Published to ten digits as 9.7803253359 and 9.8321849379 m/s^2 (NGA.STND.0036).
    with mp.workdps(60):
        assert abs(normal_gravity_mp(0, 0).down - mpf("9.78032533590389172")) < 1e-17
        assert abs(normal_gravity_mp(mp.pi / 2, 0).down - mpf("9.83218493786340046")) < 1e-17
