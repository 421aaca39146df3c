"""Perfect sensors at rest give the perfect attitude, whatever it is."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from align import (
    AlignmentError,
    KnownHeading,
    SensorErrors,
    align_static,
    analytic_coarse,
    gyrocompass,
    level,
    leveled_attitude,
)
from tests.align.at_rest import DEG, DEG_H, HALF, UG, Window, attitudes, error_n, rotation, still

EACH_LATITUDE = pytest.mark.parametrize("lat_deg", [-80, -60, -33.9, -5, 0, 18.4, 51.08, 80])

# rad: the means are rounded to 1e-16 of their size, and at 80° only a sixth of the Earth rate is
# level. Far below any sensor.
TOL = 1e-13
# rad, 0.2 milliarcseconds: roll is rounded by 1e-16 over cos(pitch), which a given heading, unlike
# one found by gyros, does not make good.
STEEP = 1e-9
CLEAR = 0.5e-6  # cos(pitch) above which STEEP holds

GOOD = SensorErrors(gyro_bias=0.001 * DEG_H, accel_bias=10.0 * UG)


def each_window(lat_deg: float) -> list[tuple[tuple[float, float, float], Window]]:
    return [(euler, still(lat_deg, rotation(*euler), count=5)) for euler in attitudes()]


@EACH_LATITUDE
def test_triad(lat_deg: float) -> None:
    for euler, window in each_window(lat_deg):
        C = analytic_coarse(window.f_ib_b[0], window.omega_ib_b[0])
        assert np.linalg.det(C) == pytest.approx(1.0, rel=0.0, abs=TOL)
        error = (Rotation.from_matrix(C) * window.attitude.inv()).magnitude()
        assert error < TOL, euler


@EACH_LATITUDE
def test_leveling_and_gyrocompass(lat_deg: float) -> None:
    """Together they hold at pitch ±90° too: what roll loses there, heading makes good."""
    for euler, window in each_window(lat_deg):
        f, omega = window.f_ib_b[0], window.omega_ib_b[0]
        roll, pitch = level(f)
        heading = gyrocompass(omega, roll, pitch)
        # Roll, pitch and heading of up to pi are rounded to 4e-16 rad on the way.
        found = rotation(roll, pitch, heading)
        assert (found * window.attitude.inv()).magnitude() < TOL, euler
        by_package = error_n(leveled_attitude(f, heading), window.attitude)
        assert np.linalg.norm(by_package) < TOL, euler


@EACH_LATITUDE
def test_leveling_and_known_heading(lat_deg: float) -> None:
    for euler, window in each_window(lat_deg):
        error = error_n(leveled_attitude(window.f_ib_b[0], euler[2]), window.attitude)
        assert np.linalg.norm(error) < STEEP or np.cos(euler[1]) < CLEAR, euler


@EACH_LATITUDE
def test_down_is_down_at_every_attitude(lat_deg: float) -> None:
    """Even where roll means nothing, the leveled attitude carries f to straight up."""
    for euler, window in each_window(lat_deg):
        for heading in (0.0, -2.0):
            q = leveled_attitude(window.f_ib_b[0], heading)
            up = Rotation.from_quat(q, scalar_first=True).apply(window.f_ib_b[0]) / window.g
            np.testing.assert_allclose(up, [0.0, 0.0, -1.0], rtol=0.0, atol=TOL, err_msg=str(euler))


@EACH_LATITUDE
def test_static_alignment(lat_deg: float) -> None:
    for euler, window in each_window(lat_deg):
        by_gyros = align_static(*window.samples, errors=GOOD)
        assert by_gyros.method == "triad"
        assert np.linalg.norm(error_n(by_gyros.q_nb, window.attitude)) < TOL, euler
        again = rotation(by_gyros.roll, by_gyros.pitch, by_gyros.heading)
        # Roll, pitch and heading are those of the quaternion.
        assert np.linalg.norm(error_n(by_gyros.q_nb, again)) < TOL, euler
        # Half an arcsecond: better than any gyro, so it is used.
        known = KnownHeading(euler[2], 0.5 * DEG / 3600.0)
        by_survey = align_static(*window.samples, errors=GOOD, known_heading=known)
        assert by_survey.method == "known-heading"
        if np.cos(euler[1]) > CLEAR:
            assert np.linalg.norm(error_n(by_survey.q_nb, window.attitude)) < STEEP, euler
            assert np.linalg.norm(by_survey.scatter) < STEEP, euler


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_units_do_not_matter_to_the_geometry(scale: float) -> None:
    window = still(-41.0, rotation(-2.0, 0.9, 0.4))
    f, omega = scale * window.f_ib_b[0], window.omega_ib_b[0] / scale
    found = Rotation.from_matrix(analytic_coarse(f, omega))
    assert (found * window.attitude.inv()).magnitude() < TOL
    roll, pitch = level(f)
    assert roll == pytest.approx(-2.0, rel=0.0, abs=TOL)
    assert pitch == pytest.approx(0.9, rel=0.0, abs=TOL)
    assert gyrocompass(omega, roll, pitch) == pytest.approx(0.4, rel=0.0, abs=TOL)


@pytest.mark.parametrize("upright", [1.0, -1.0])
def test_a_body_exactly_on_its_tail_or_nose(upright: float) -> None:
    """No roll can be felt, and none may come out as not a number."""
    roll, pitch = level([upright * 9.81, 0.0, 0.0])
    assert np.isfinite(roll)
    assert pitch == upright * HALF


def test_leveling_signs_in_words() -> None:
    """Nose up tips the specific force forward; the right wing down tips it to the left."""
    assert level([1.0, 0.0, -9.7])[1] > 0.0
    assert level([0.0, -1.0, -9.7])[0] > 0.0
    # A level body heading east feels the northward Earth rate on its left.
    assert gyrocompass([0.0, -1.0, 0.0], 0.0, 0.0) == pytest.approx(HALF, rel=0.0, abs=TOL)


@pytest.mark.parametrize(
    ("f", "omega"),
    [
        ((0.0, 0.0, -9.8), (0.0, 0.0, 7e-5)),
        ((0.0, 9.8, 0.0), (0.0, 7e-5, 0.0)),
        ((0.0, 0.0, 0.0), (5e-5, 0.0, -5e-5)),
        ((1.0, 2.0, -9.8), (0.0, 0.0, 0.0)),
    ],
)
def test_two_vectors_that_fix_no_attitude_are_refused(
    f: tuple[float, float, float], omega: tuple[float, float, float]
) -> None:
    with pytest.raises(AlignmentError, match=r"parallel.*give a heading"):
        analytic_coarse(f, omega)
