"""What a static alignment reports: method, residuals, scatter, and what speaks against it."""

from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from scipy.stats import t

from align import Alignment, KnownHeading, SensorErrors, align_static
from earth import GRS80, WGS84
from tests.align.at_rest import DEG, DEG_H, UG, Window, error_n, rotation, still
from tests.oracles.constants import OMEGA

EULER = (-0.3, 0.2, 2.5)  # rad
NAVIGATION = SensorErrors(gyro_bias=0.01 * DEG_H, accel_bias=50.0 * UG)
ROUNDING = 1e-12  # rad


def gyro_sigma(lat_deg: float, errors: SensorErrors = NAVIGATION) -> float:
    """Heading sigma of the gyros alone, rad, in closed form."""
    assert errors.gyro_bias is not None
    assert errors.accel_bias is not None
    lat = lat_deg * DEG
    by_tilt = np.tan(lat) * errors.accel_bias / still(lat_deg, rotation(0, 0, 0)).g
    return float(np.hypot(errors.gyro_bias / (OMEGA * np.cos(lat)), by_tilt))


def found_in(result: Alignment, *words: str) -> bool:
    return any(all(word in warning for word in words) for warning in result.warnings)


@pytest.mark.parametrize("lat_deg", [-65.0, 0.0, 48.0])
def test_the_smaller_sigma_chooses_where_north_comes_from(lat_deg: float) -> None:
    window = still(lat_deg, rotation(*EULER))
    sigma = gyro_sigma(lat_deg)
    better = KnownHeading(EULER[2] + 0.5 * sigma, 0.99 * sigma)
    by_survey = align_static(*window.samples, errors=NAVIGATION, known_heading=better)
    assert by_survey.method == "known-heading"
    assert by_survey.heading == pytest.approx(better.heading, rel=0.0, abs=ROUNDING)
    assert by_survey.heading_sigma == better.sigma
    worse = KnownHeading(EULER[2] + 0.5 * sigma, 1.01 * sigma)
    by_gyros = align_static(*window.samples, errors=NAVIGATION, known_heading=worse)
    assert by_gyros.method == "triad"
    assert by_gyros.heading == pytest.approx(EULER[2], rel=0.0, abs=ROUNDING)
    for result in (by_survey, by_gyros):
        # Used or not, the gyros' word is reported. Relative: the noise of a perfect window.
        assert result.gyro_heading == pytest.approx(EULER[2], rel=0.0, abs=ROUNDING)
        assert result.gyro_heading_sigma == pytest.approx(sigma, rel=1e-6)
        assert result.warnings == ()
    assert by_gyros.azimuth_sigma == by_gyros.gyro_heading_sigma


def test_means_are_weighted_by_the_intervals() -> None:
    """Errors that cancel by duration, though not by count, leave nothing."""
    dt = np.where(np.arange(1600) % 2, 0.03, 0.01)  # s
    window = still(-40.0, rotation(*EULER), count=1600, dt=dt)
    swing = np.where(np.arange(1600) % 2, 1.0, -3.0)[:, None]
    felt = window.plus(gyro=1e-5 * swing * np.ones(3), accel=1e-3 * swing * np.ones(3))
    result = align_static(*felt.samples, errors=NAVIGATION)
    # rad; unweighted means would be off by 1e-3/9.8 and by a tenth of the level Earth rate.
    assert np.linalg.norm(error_n(result.q_nb, window.attitude)) < 1e-11
    assert result.duration == pytest.approx(32.0, rel=0.0, abs=1e-9)  # s


@pytest.mark.parametrize("lat_deg", [-70.0, -20.0, 0.0, 51.08])
def test_residuals_are_the_errors_that_show(lat_deg: float) -> None:
    """Down and north gyro error, and the accelerometer error along up, with their signs."""
    window = still(lat_deg, rotation(*EULER))
    gyro = np.array([0.02, 0.0, -0.03]) * DEG_H
    accel = np.array([0.0, 0.0, 40.0]) * UG
    result = align_static(*window.plus_n(gyro=gyro, accel=accel).samples, errors=NAVIGATION)
    # rad/s: 2e-16 of the Earth rate by rounding
    assert result.rate_residual_north == pytest.approx(gyro[0], rel=0.0, abs=1e-18)
    assert result.rate_residual_down == pytest.approx(gyro[2], rel=0.0, abs=1e-18)
    lat = lat_deg * DEG
    along = gyro[0] * np.cos(lat) - gyro[2] * np.sin(lat)
    # Second order: (0.036 deg/h)^2 over twice the Earth rate of 15 deg/h
    assert result.rate_residual == pytest.approx(along, rel=0.0, abs=5e-5 * DEG_H)
    # Down error of +40 µg shortens the force that points up.
    assert result.specific_force_residual == pytest.approx(-accel[2], rel=0.0, abs=1e-12)
    seen = np.arctan2(OMEGA * np.sin(lat) - gyro[2], OMEGA * np.cos(lat) + gyro[0])
    assert result.implied_latitude == pytest.approx(seen, rel=0.0, abs=ROUNDING)


def test_gravity_and_earth_rate_are_those_of_the_ellipsoid_given() -> None:
    window = still(0.0, rotation(*EULER))
    by_grs80 = align_static(*window.samples, errors=NAVIGATION, ellipsoid=GRS80)
    # m/s^2 on the equator, both as published
    assert by_grs80.specific_force_residual == pytest.approx(
        9.7803253359 - 9.7803267715, rel=0.0, abs=1e-10
    )
    slower = replace(WGS84, omega=0.99 * OMEGA)
    result = align_static(*window.samples, ellipsoid=slower)
    assert result.rate_residual == pytest.approx(0.01 * OMEGA, rel=0.0, abs=1e-18)  # rad/s
    assert result.rate_residual_north == pytest.approx(0.01 * OMEGA, rel=0.0, abs=1e-18)


def test_residual_of_eastward_error_is_second_order() -> None:
    """It is the one that turns the heading, and it does not show."""
    window = still(45.0, rotation(*EULER))
    felt = window.plus_n(gyro=(0.0, 0.05 * DEG_H, 0.0))
    result = align_static(*felt.samples, errors=NAVIGATION)
    # rad/s: (0.05 deg/h)^2 over twice the level rate of 10.6 deg/h is 1.2e-4 deg/h.
    assert abs(result.rate_residual_north) < 1.3e-4 * DEG_H
    assert result.rate_residual_down == pytest.approx(0.0, rel=0.0, abs=1e-18)


@pytest.mark.parametrize("known", [None, KnownHeading(2.5, 1e-6)], ids=["triad", "known"])
def test_scatter_is_that_of_the_attitude_in_sub_windows(known: KnownHeading | None) -> None:
    """White noise over a tenth of the window, about north, east and down."""
    lat_deg, arw, vrw = 50.0, 0.005 * DEG / 60.0, 30.0 * UG
    window = still(lat_deg, rotation(*EULER), count=2000, dt=0.1)
    rng = np.random.default_rng(90)
    squares = np.mean(
        [
            align_static(
                *window.noisy(rng, arw, vrw).samples, errors=NAVIGATION, known_heading=known
            ).scatter
            ** 2
            for _ in range(60)
        ],
        axis=0,
    )
    tilt = vrw / np.sqrt(20.0) / window.g
    azimuth = np.hypot(
        arw / np.sqrt(20.0) / (OMEGA * np.cos(window.lat)), np.tan(window.lat) * tilt
    )
    if known is not None:  # heading held: a tilt across the nose turns about down by tan(pitch)
        azimuth = np.tan(EULER[1]) * tilt
    # Relative: 60 x 9 degrees of freedom know a sigma to 3 %; three of these.
    np.testing.assert_allclose(np.sqrt(squares), [tilt, tilt, azimuth], rtol=0.1)


def test_scatter_needs_two_sub_windows() -> None:
    dt = np.array([2.5])
    window = still(45.0, rotation(*EULER), count=1, dt=dt)
    result = align_static(*window.samples, errors=NAVIGATION)
    assert np.all(np.isnan(result.scatter))
    assert np.linalg.norm(error_n(result.q_nb, window.attitude)) < ROUNDING


def test_stillness_statistics_are_reported() -> None:
    window = still(45.0, rotation(*EULER), count=600, dt=0.1)
    wave = np.where((np.arange(600) // 10) % 2, 1.0, -1.0)[:, None] * [0.0, 0.6, 0.8]
    result = align_static(
        *window.plus(gyro=2e-4 * wave, accel=0.01 * wave).samples, errors=NAVIGATION
    )
    # One-second means of a square wave of two seconds, rounded like the force itself.
    assert result.force_scatter == pytest.approx(0.01, rel=1e-9)  # m/s^2
    assert result.rate_scatter == pytest.approx(2e-4, rel=1e-9)  # rad/s


@pytest.mark.parametrize("heading", [0.0, 1e-17, -1e-17, -1e-9, -0.5, 3.0, -3.1, 2.0 * np.pi])
@pytest.mark.parametrize("known", [False, True], ids=["triad", "known"])
def test_heading_is_counted_from_0_to_below_360(heading: float, known: bool) -> None:
    window = still(-33.0, rotation(0.0, 0.0, heading))
    given = KnownHeading(heading, 1e-6) if known else None
    result = align_static(*window.samples, errors=NAVIGATION, known_heading=given)
    assert 0.0 <= result.heading < 2.0 * np.pi
    assert 0.0 <= result.gyro_heading < 2.0 * np.pi
    for angle in (result.heading, result.gyro_heading):
        assert abs(np.sin(0.5 * (angle - heading))) < ROUNDING


def test_a_result_does_not_change() -> None:
    result = align_static(*still(45.0, rotation(*EULER)).samples, errors=NAVIGATION)
    with pytest.raises(FrozenInstanceError):
        result.heading = 0.0  # type: ignore[misc]  # the point of the test
    with pytest.raises(FrozenInstanceError):
        NAVIGATION.arw = 0.0  # type: ignore[misc]


def test_samples_are_left_alone() -> None:
    window = still(45.0, rotation(*EULER))
    kept = replace(window, omega_ib_b=window.omega_ib_b.copy(), f_ib_b=window.f_ib_b.copy())
    align_static(*window.samples, errors=NAVIGATION)
    np.testing.assert_array_equal(window.omega_ib_b, kept.omega_ib_b)
    np.testing.assert_array_equal(window.f_ib_b, kept.f_ib_b)


@pytest.mark.parametrize("roll", [0.0, 1.0, -2.0, 2.2, np.pi, -3.0])
def test_hanging_upside_down_is_mentioned(roll: float) -> None:
    """Beyond 120° from upright, by roll or by pitch and roll together; not when lying on a side."""
    result = align_static(*still(30.0, rotation(roll, 0.1, 1.0)).samples, errors=NAVIGATION)
    upright = np.cos(roll) * np.cos(0.1)
    assert found_in(result, "upside down", "imu.axes") is bool(upright < -0.5)
    if upright < -0.5:
        assert found_in(result, f"roll {roll / DEG:.1f}°")


def within(window: Window, gyro_n: tuple[float, float, float], accel_d: float) -> Alignment:
    """Alignment of a window with gyro errors in deg/h and a down accelerometer error in µg."""
    felt = window.plus_n(gyro=DEG_H * np.array(gyro_n), accel=(0.0, 0.0, UG * accel_d))
    return align_static(*felt.samples, errors=NAVIGATION)


@pytest.mark.parametrize("lat_deg", [-45.0, 20.0, 60.0])
def test_a_residual_the_stated_errors_do_not_allow_is_mentioned(lat_deg: float) -> None:
    """Stated are 0.01 deg/h and 50 µg; three times that is the limit."""
    window = still(lat_deg, rotation(*EULER))
    quiet = within(window, (0.028, 0.0, -0.028), 145.0)
    assert quiet.warnings == ()
    assert quiet.azimuth_sigma == pytest.approx(gyro_sigma(lat_deg), rel=1e-5)
    gyro = within(window, (0.3, 0.0, 0.4), 0.0)
    assert found_in(gyro, "+0.400 deg/h about down", "+0.300 deg/h along north", "enlarged")
    assert len(gyro.warnings) == 1
    # The rms of what shows, 0.354 deg/h, stands for the eastward error that does not.
    shown = SensorErrors(gyro_bias=np.sqrt(0.125) * DEG_H, accel_bias=50.0 * UG)
    assert gyro.azimuth_sigma == pytest.approx(gyro_sigma(lat_deg, shown), rel=1e-5)
    force = within(window, (0.0, 0.0, 0.0), -2000.0)
    # 2000 µg of 9.80665 m/s^2
    assert found_in(force, "|f| differs from normal gravity by +19.613 mm/s²", "enlarged")
    assert force.tilt_sigma == pytest.approx(2000.0 * UG / window.g, rel=1e-5)


def test_without_stated_errors_the_residuals_stand_for_them() -> None:
    window = still(45.0, rotation(*EULER))
    gyro = (0.03 * DEG_H, 0.0, 0.04 * DEG_H)
    felt = window.plus_n(gyro=gyro, accel=(0.0, 0.0, 3000.0 * UG))
    result = align_static(*felt.samples)
    assert found_in(result, "|f| differs", "-29.420 mm/s²", "no bias is stated")
    assert found_in(result, "+0.040 deg/h about down", "no bias is stated")
    # One residual, or two, tell a sigma by Student's t: 68 % of it lie within so many of them
    one, two = t.ppf(0.5 + 0.5 * 0.682689, [1, 2])
    assert result.tilt_sigma == pytest.approx(one * 3000.0 * UG / window.g, rel=3e-3)
    shown = SensorErrors(gyro_bias=two * np.sqrt(0.00125) * DEG_H, accel_bias=one * 3000.0 * UG)
    assert result.azimuth_sigma == pytest.approx(gyro_sigma(45.0, shown), rel=3e-3)


def test_a_small_residual_force_proves_no_good_accelerometers() -> None:
    """It is that of one axis, and may be small by luck: 1 mg stands for what nobody states."""
    window = still(45.0, rotation(*EULER))
    result = align_static(*window.plus_n(accel=(0.0, 0.0, 300.0 * UG)).samples)
    assert found_in(result, "-2.942 mm/s²", "1000 µg stand for its sigma")
    assert result.tilt_sigma == pytest.approx(1000.0 * UG / window.g, rel=1e-5)


@pytest.mark.parametrize("lat_deg", [-33.9, 8.0])
@pytest.mark.parametrize("errors", [NAVIGATION, None], ids=["stated", "not stated"])
@pytest.mark.parametrize("known", [None, KnownHeading(2.5, 1e-4)], ids=["gyros", "known"])
def test_a_latitude_of_the_wrong_hemisphere_is_named(
    lat_deg: float, errors: SensorErrors | None, known: KnownHeading | None
) -> None:
    """Good gyros contradict the site: whether refused or warned, the user reads what to check."""
    window = still(lat_deg, rotation(*EULER))
    mistaken = replace(window, lat=-window.lat)
    try:
        result = align_static(*mistaken.samples, errors=errors, known_heading=known)
        text = "\n".join(result.warnings)
    except Exception as refusal:  # whatever the refusal, its text is what counts here
        text = str(refusal)
    assert "site.latitude" in text
    assert "hemisphere" in text


def test_weak_gyros_do_not_accuse_the_site() -> None:
    """A stated bias of 3 deg/h explains an implied latitude 13° off."""
    window = still(10.0, rotation(*EULER))
    weak = SensorErrors(gyro_bias=3.0 * DEG_H, accel_bias=50.0 * UG)
    felt = window.plus_n(gyro=(0.0, 0.0, 3.5 * DEG_H))
    result = align_static(*felt.samples, errors=weak)
    assert abs(result.implied_latitude - window.lat) > 12.0 * DEG
    assert not found_in(result, "site.latitude")


def test_gyros_that_do_not_feel_the_earth_do_not_accuse_the_site() -> None:
    """Nothing is stated, and 13 % too much rate: this is a bias, not another latitude."""
    window = still(10.0, rotation(*EULER))
    felt = window.plus_n(gyro=np.array([2.0, 0.0, 5.5]) * DEG_H)
    given = KnownHeading(EULER[2], 1.0 * DEG)
    result = align_static(*felt.samples, known_heading=given)
    assert abs(result.implied_latitude - window.lat) > 15.0 * DEG
    assert found_in(result, "no bias is stated")
    assert not found_in(result, "site.latitude")


@pytest.mark.parametrize("off_deg", [0.2, -3.0, 179.0])
def test_gyros_that_contradict_a_better_heading_are_mentioned(off_deg: float) -> None:
    """0.01 deg/h at 45° is 0.054°: 0.2° is more than three sigma, 0.15° is not."""
    window = still(45.0, rotation(*EULER))
    given = KnownHeading(EULER[2] - off_deg * DEG, 0.001 * DEG)
    result = align_static(*window.samples, errors=NAVIGATION, known_heading=given)
    assert result.method == "known-heading"
    assert found_in(result, f"the gyros point {off_deg:+.2f}° from the given heading")
    assert found_in(result, "0.05° sigma")
    near = KnownHeading(EULER[2] - 0.15 * DEG, 0.001 * DEG)
    agreed = align_static(*window.samples, errors=NAVIGATION, known_heading=near)
    assert agreed.warnings == ()


def test_a_given_heading_that_better_gyros_contradict_is_mentioned() -> None:
    """90° off with a sigma of 1°: the gyros win, and the user learns of the contradiction."""
    window = still(45.0, rotation(*EULER))
    wrong = KnownHeading(EULER[2] + 0.5 * np.pi, 1.0 * DEG)
    result = align_static(*window.samples, errors=NAVIGATION, known_heading=wrong)
    assert result.method == "triad"
    assert found_in(result, "given heading")


@pytest.mark.parametrize("pitch", [0.5 * np.pi, -0.5 * np.pi])
def test_no_false_contradiction_at_pitch_90(pitch: float) -> None:
    """There the split between roll and heading is arbitrary, and proves nothing."""
    window = still(45.0, rotation(0.4, pitch, 1.0))
    given = KnownHeading(1.0, 0.001 * DEG)
    result = align_static(*window.samples, errors=NAVIGATION, known_heading=given)
    assert not found_in(result, "from the given heading")
