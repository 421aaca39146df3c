"""Small sensor errors turn the attitude by the signed closed forms, to second order."""

import numpy as np
import pytest

from align import KnownHeading, SensorErrors, align_static
from tests.align.at_rest import DEG_H, UG, Array, Window, error_n, rotation, still
from tests.oracles.constants import OMEGA

ATTITUDES = [(0.3, -0.2, 0.8), (-2.9, 0.4, -1.7), (1.2, 1.5, 2.6), (0.1, -1.3, -3.1)]
EACH_ATTITUDE = pytest.mark.parametrize("euler", ATTITUDES)
EACH_LATITUDE = pytest.mark.parametrize("lat_deg", [-75.0, -45.0, -10.0, 0.0, 30.0, 60.0, 75.0])
STATED = SensorErrors(gyro_bias=0.01 * DEG_H, accel_bias=50.0 * UG)

GYRO = np.array([0.013, -0.007, 0.011]) * DEG_H  # rad/s, north, east, down
ACCEL = np.array([60.0, -35.0, 80.0]) * UG  # m/s^2, north, east, down

# Which errors are present: gyros north, east, down, then accelerometers
SOURCES = {
    f"{sensor} {axis}": np.eye(6)[3 * i + j].reshape(2, 3)
    for i, sensor in enumerate(("gyro", "accel"))
    for j, axis in enumerate(("north", "east", "down"))
} | {"all": np.ones((2, 3))}


def expected_error(window: Window, gyro: Array, accel: Array) -> Array:
    """Rotation of the estimate relative to the truth about north, east, down, rad."""
    tan_lat, level_rate = np.tan(window.lat), OMEGA * np.cos(window.lat)
    return np.array(
        [
            -accel[1] / window.g,
            accel[0] / window.g,
            -gyro[1] / level_rate + tan_lat * accel[1] / window.g,
        ]
    )


def signed_errors(window: Window, gyro: Array, accel: Array, **options: object) -> list[Array]:
    """Alignment errors with the sensor errors as they are and with all their signs turned."""
    found = []
    for sign in (1.0, -1.0):
        felt = window.plus_n(gyro=sign * gyro, accel=sign * accel)
        result = align_static(*felt.samples, errors=STATED, **options)  # type: ignore[arg-type]
        found.append(error_n(result.q_nb, window.attitude))
    return found


@EACH_LATITUDE
@EACH_ATTITUDE
@pytest.mark.parametrize("present", SOURCES.values(), ids=SOURCES.keys())
def test_gyros_and_accelerometers(
    lat_deg: float, euler: tuple[float, float, float], present: Array
) -> None:
    """Each error alone and all together; north and down gyro errors do not enter."""
    gyro, accel = GYRO * present[0], ACCEL * present[1]
    window = still(lat_deg, rotation(*euler), count=4)
    plus, minus = signed_errors(window, gyro, accel)
    truth = expected_error(window, gyro, accel)
    # The largest ratio of the problem: gyro error over the level Earth rate, 4e-3 at 75°, and tilt
    # times tan(lat). Half the difference is free of second-order terms, the sum is made of them.
    ratio = np.linalg.norm(gyro) / (OMEGA * np.cos(window.lat))
    ratio += np.linalg.norm(accel) / window.g / np.cos(window.lat)
    tol = 2.0 * ratio**3 + 1e-13  # rad, third order and rounding
    np.testing.assert_allclose(0.5 * (plus - minus), truth, rtol=0.0, atol=tol)
    np.testing.assert_allclose(plus, truth, rtol=0.0, atol=2.0 * ratio**2 + 1e-13)


@EACH_LATITUDE
@EACH_ATTITUDE
def test_accelerometers_and_a_known_heading(
    lat_deg: float, euler: tuple[float, float, float]
) -> None:
    """Heading stays as given; tilts follow the accelerometers, gyros enter nowhere."""
    window = still(lat_deg, rotation(*euler), count=4)
    known = KnownHeading(euler[2], 1e-6)
    plus, minus = signed_errors(window, GYRO, ACCEL, known_heading=known)
    truth = expected_error(window, GYRO, ACCEL)
    # What is held is the Euler angle, so tilting about the level axis across the nose by e turns
    # the attitude about down by e tan(pitch).
    _, pitch, heading = euler
    across = np.cos(heading) * truth[0] + np.sin(heading) * truth[1]
    truth[2] = -np.tan(pitch) * across
    # Third order in the tilt of 1e-4 rad, enlarged where the nose is steep (86°).
    tol = 4.0 * (np.linalg.norm(ACCEL) / window.g / np.cos(pitch)) ** 3 + 1e-13  # rad
    np.testing.assert_allclose(0.5 * (plus - minus), truth, rtol=0.0, atol=tol)


# 0.01 deg/h of eastward drift, mrad of heading, to the digits printed: half a unit of the last.
@pytest.mark.parametrize(
    ("lat_deg", "mrad"), [(0.0, 0.66), (30.0, 0.77), (45.0, 0.94), (60.0, 1.33), (75.0, 2.57)]
)
@pytest.mark.parametrize("hemisphere", [1.0, -1.0])
def test_heading_error_of_a_hundredth_of_a_degree_per_hour(
    lat_deg: float, mrad: float, hemisphere: float
) -> None:
    window = still(hemisphere * lat_deg, rotation(0.2, 0.1, -2.2), count=4)
    drift = np.array([0.0, 0.01 * DEG_H, 0.0])
    result = align_static(*window.plus_n(gyro=drift).samples, errors=STATED)
    error = 1e3 * error_n(result.q_nb, window.attitude)
    assert error[2] == pytest.approx(-mrad, rel=0.0, abs=0.0051)


def test_tilt_of_a_micro_g() -> None:
    """1 µg to the north tilts about east by 0.206 arcseconds, up to 9.80665 against local g."""
    window = still(-45.0, rotation(2.2, -0.9, 0.5), count=4)
    result = align_static(*window.plus_n(accel=(UG, 0.0, 0.0)).samples, errors=STATED)
    arcseconds = error_n(result.q_nb, window.attitude) * 180.0 / np.pi * 3600.0
    assert arcseconds[1] == pytest.approx(0.206, rel=0.0, abs=0.0006)
    assert abs(arcseconds[0]) < 1e-6
