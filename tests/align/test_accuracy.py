"""The sigmas an alignment predicts are the scatter it has."""

from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from align import KnownHeading, SensorErrors, WeakGyrosError, align_static
from align.accuracy import euler_sigmas, heading_sigma, tilt_sigma
from earth import Ellipsoid
from tests.align.at_rest import DEG, DEG_H, HALF, UG, Array, error_n, rotation, still
from tests.oracles.constants import OMEGA

RUNS = 400
ARW = 0.003 * DEG / 60.0  # rad/sqrt(s), navigation grade: 0.003 deg/sqrt(h)
VRW = 10.0 * UG  # (m/s)/sqrt(s)
NOISE_ONLY = SensorErrors(gyro_bias=0.0, accel_bias=0.0, arw=ARW, vrw=VRW)
NAVIGATION = SensorErrors(gyro_bias=0.01 * DEG_H, accel_bias=50.0 * UG, arw=ARW, vrw=VRW)
TACTICAL = SensorErrors(
    gyro_bias=1.0 * DEG_H, accel_bias=500.0 * UG, arw=0.1 * DEG / 60.0, vrw=50.0 * UG
)


@pytest.mark.parametrize("errors", [NAVIGATION, TACTICAL], ids=["navigation", "tactical"])
def test_predicted_sigmas_match_the_scatter(errors: SensorErrors) -> None:
    """400 windows each of 60, 300 and 600 s at latitudes 0, 45 and 70°."""
    squares, runs = 0.0, 0
    for lat_deg, seconds in product((0.0, 45.0, 70.0), (60.0, 300.0, 600.0)):
        found, predicted, square = _windows(errors, lat_deg, seconds)
        tilt = np.hypot(errors.accel_bias, errors.vrw / np.sqrt(seconds))  # type: ignore[operator]
        rate = np.hypot(errors.gyro_bias, errors.arw / np.sqrt(seconds))  # type: ignore[operator]
        lat = lat_deg * DEG
        tilt /= still(lat_deg, rotation(0, 0, 0)).g
        azimuth = np.hypot(rate / (OMEGA * np.cos(lat)), np.tan(lat) * tilt)
        scatter = np.sqrt(np.mean(np.square(found), axis=0))
        # Relative: the scatter of 400 runs is known to 3.5 %; a heading off by 14° is not linear
        # in the rates any more, which costs 4 % more.
        np.testing.assert_allclose(scatter, [tilt, tilt, azimuth], rtol=0.12)
        np.testing.assert_allclose(np.mean(predicted, axis=0), [tilt, tilt, azimuth], rtol=0.03)
        assert len(found) > 0.99 * RUNS  # of chance that proves gyros worse than stated
        if azimuth < 0.1:  # rad; beyond, curvature alone leaves the bounds
            squares, runs = squares + sum(square), runs + len(square)
    low, high = chi2.ppf([0.025, 0.975], 3 * runs)
    assert low < squares < high


def _windows(
    errors: SensorErrors, lat_deg: float, seconds: float
) -> tuple[list[Array], list[Array], list[float]]:
    """Errors, predicted sigmas, and errors over their covariance of windows with drawn errors."""
    assert errors.gyro_bias is not None
    assert errors.accel_bias is not None
    assert errors.arw is not None
    assert errors.vrw is not None
    rng = np.random.default_rng([60, round(lat_deg), round(seconds)])
    window = still(lat_deg, rotation(-0.4, 0.6, 2.0), count=50, dt=seconds / 50.0)
    found, predicted, squares = [], [], []
    for _ in range(RUNS):
        felt = window.noisy(rng, errors.arw, errors.vrw).plus(
            gyro=errors.gyro_bias * rng.normal(size=3),
            accel=errors.accel_bias * rng.normal(size=3),
        )
        try:
            result = align_static(*felt.samples, errors=errors, method="triad", convergence=False)
        except WeakGyrosError:
            continue
        error = error_n(result.q_nb, window.attitude)
        found.append(error)
        predicted.append(np.array([result.tilt_sigma, result.tilt_sigma, result.azimuth_sigma]))
        squares.append(float(error @ np.linalg.solve(result.P_n, error)))
    return found, predicted, squares


@pytest.mark.parametrize("lat_deg", [-45.0, 20.0])
def test_noise_that_nobody_states_is_read_off_the_data(lat_deg: float) -> None:
    """Only the biases are stated (as none): the sub-windows show the noise."""
    rng = np.random.default_rng(61)
    window = still(lat_deg, rotation(3.0, -0.3, 0.4), count=400, dt=0.25)
    silent = SensorErrors(gyro_bias=0.0, accel_bias=0.0)
    found, predicted = [], []
    for _ in range(RUNS):
        result = align_static(*window.noisy(rng, ARW, VRW).samples, errors=silent)
        found.append(error_n(result.q_nb, window.attitude))
        predicted.append((result.tilt_sigma, result.tilt_sigma, result.azimuth_sigma))
    scatter = np.sqrt(np.mean(np.square(found), axis=0))
    np.testing.assert_allclose(np.mean(predicted, axis=0), scatter, rtol=0.15)
    # Ten sub-windows of three axes: 27 degrees of freedom leave 14 %, the few runs whose residual
    # happens to exceed three sigma bring it to 20 %. A sigma from the residual would vary by 75 %.
    spread = np.std(predicted, axis=0) / np.mean(predicted, axis=0)
    assert np.all(spread < 0.3)


@pytest.mark.parametrize("lat_deg", [-45.0, 0.0, 62.0])
@pytest.mark.parametrize("seconds", [20.0, 100.0])
def test_stated_noise_counts_where_the_data_show_less(lat_deg: float, seconds: float) -> None:
    window = still(lat_deg, rotation(0.3, -0.1, 2.0), count=40, dt=seconds / 40.0)
    result = align_static(*window.samples, errors=NOISE_ONLY)
    tilt = VRW / np.sqrt(seconds) / window.g
    by_gyro = ARW / np.sqrt(seconds) / (OMEGA * np.cos(window.lat))
    # The closed forms, to the rounding of the gravity they divide by.
    assert result.tilt_sigma == pytest.approx(tilt, rel=1e-12)
    azimuth = np.hypot(by_gyro, np.tan(window.lat) * tilt)
    assert result.azimuth_sigma == pytest.approx(azimuth, rel=1e-12)


@pytest.mark.parametrize("pitch", [0.1, -0.6, 1.2])
def test_predicted_sigmas_with_a_known_heading(pitch: float) -> None:
    """Heading is as good as it was given, at every pitch: tilt does not reach it.

    The turn about down is not: holding the Euler angle, a tilt across the nose turns the attitude
    about down by tan(pitch) as much.
    """
    errors = SensorErrors(gyro_bias=1.0 * DEG_H, accel_bias=500.0 * UG, arw=ARW, vrw=VRW)
    assert errors.accel_bias is not None
    sigma = 5e-4  # rad, like the tilt
    rng = np.random.default_rng(63)
    window = still(45.0, rotation(0.3, pitch, 2.0))
    turns, headings = [], []
    for _ in range(RUNS):
        felt = window.plus(accel=errors.accel_bias * rng.normal(size=3))
        known = KnownHeading(2.0 + sigma * rng.normal(), sigma)
        result = align_static(*felt.samples, errors=errors, known_heading=known)
        turns.append(error_n(result.q_nb, window.attitude))
        headings.append(result.heading - 2.0)
    scatter = np.sqrt(np.mean(np.square(turns), axis=0))
    # Relative, as above.
    np.testing.assert_allclose(result.tilt_sigma, scatter[:2], rtol=0.15)
    assert result.heading_sigma == pytest.approx(np.sqrt(np.mean(np.square(headings))), rel=0.15)
    assert result.azimuth_sigma == pytest.approx(scatter[2], rel=0.15)


@pytest.mark.parametrize("lat_deg", [-60.0, 0.0, 45.0, 70.0])
def test_heading_sigma_in_closed_form(lat_deg: float) -> None:
    """Each part alone, and both as independent; the sign of the latitude does not enter."""
    lat = lat_deg * DEG
    by_gyro = heading_sigma(0.01 * DEG_H, 0.0, lat, 9.81)
    assert by_gyro == pytest.approx(0.01 * DEG_H / (OMEGA * np.cos(lat)), rel=1e-14)
    by_tilt = heading_sigma(0.0, 981e-6, lat, 9.81)
    assert by_tilt == pytest.approx(abs(np.tan(lat)) * 1e-4, rel=1e-14, abs=1e-20)
    both = heading_sigma(0.01 * DEG_H, 981e-6, lat, 9.81)
    assert both == pytest.approx(np.sqrt(by_gyro**2 + by_tilt**2), rel=1e-14)
    assert tilt_sigma(981e-6, 9.81) == pytest.approx(1e-4, rel=1e-14)


def test_heading_sigma_of_a_faster_planet() -> None:
    fast = Ellipsoid("fast", 6.4e6, 1.0 / 300.0, 4e14, 2.0 * OMEGA, "made up")
    slow = heading_sigma(1e-8, 0.0, 0.9, 9.81)
    assert heading_sigma(1e-8, 0.0, 0.9, 9.81, fast) == pytest.approx(0.5 * slow, rel=1e-14)


@pytest.mark.parametrize(
    "euler",
    [
        (0.0, 0.0, 0.0),
        (0.7, 0.5, 2.0),
        (-3.0, -1.2, -1.0),
        (1.0, HALF - 0.1, 0.3),
        (2.0, 0.02 - HALF, -3.0),
    ],
)
def test_euler_sigmas_match_the_scatter(euler: tuple[float, float, float]) -> None:
    """Small rotations about north, east, down, carried to Euler angles by SciPy.

    They go together, as an eastward accelerometer error makes the first and the last.
    """
    mix = 1e-6 * np.array([[2.0, 0.0, 0.0], [0.5, 1.5, 0.0], [-3.0, 1.0, 4.0]])
    rng = np.random.default_rng(62)  # rad, small enough that even 1/cos(pitch) = 50 stays linear
    turns = Rotation.from_rotvec(rng.normal(size=(40_000, 3)) @ mix.T)
    found: Array = (turns * rotation(*euler)).as_euler("ZYX")[:, ::-1] - np.array(euler)
    found = np.remainder(found + np.pi, 2.0 * np.pi) - np.pi
    # Relative: the scatter of 40 000 draws is known to 0.35 %; four of these.
    np.testing.assert_allclose(euler_sigmas(np.array(euler), mix @ mix.T), found.std(0), rtol=0.014)


@pytest.mark.parametrize("pitch", [HALF, -HALF, HALF - 1e-9, 1e-3 - HALF])
def test_euler_sigmas_at_pitch_90(pitch: float) -> None:
    """Roll and heading are lost, and say so within half a turn; pitch is as good as ever."""
    tilt, azimuth = 2e-3, 1e-4
    roll_sigma, pitch_sigma, heading_sigma_ = euler_sigmas(
        np.array([0.3, pitch, 1.0]), np.diag([tilt, tilt, azimuth]) ** 2
    )
    assert pitch_sigma == pytest.approx(tilt, rel=1e-12)
    steep = tilt / np.cos(1e-3 - HALF) if pitch == 1e-3 - HALF else np.pi  # tilt is 2 cos(pitch)
    assert roll_sigma == pytest.approx(steep, rel=1e-6)
    assert heading_sigma_ == pytest.approx(min(np.hypot(azimuth, steep), np.pi), rel=1e-6)


@pytest.mark.parametrize("pitch", [HALF, -HALF])
def test_the_attitude_is_no_worse_at_pitch_90(pitch: float) -> None:
    window = still(50.0, rotation(0.4, pitch, 1.0))
    result = align_static(*window.samples, errors=NAVIGATION)
    assert result.roll_sigma == result.heading_sigma == np.pi
    reference = align_static(*still(50.0, rotation(0.4, 0.1, 1.0)).samples, errors=NAVIGATION)
    # Stated biases and a perfect window: the same but for the rounding of the noise.
    assert result.tilt_sigma == pytest.approx(reference.tilt_sigma, rel=1e-9)
    assert result.azimuth_sigma == pytest.approx(reference.azimuth_sigma, rel=1e-9)
    assert result.pitch_sigma == pytest.approx(result.tilt_sigma, rel=1e-12)
