"""Windows that cannot give an attitude are refused, and the message names the likely cause."""

import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from align import AlignmentError, KnownHeading, SensorErrors, align_static
from align.checks import check_units_at_rest
from earth import NavgradeError
from tests.align.at_rest import DEG, DEG_H, UG, Window, rotation, still
from tests.oracles.constants import OMEGA

ATTITUDES = [(0.1, -0.2, 1.0), (-2.9, 0.4, -1.7), (0.4, 1.55, 2.0)]
EACH_ATTITUDE = pytest.mark.parametrize("euler", ATTITUDES)
NAVIGATION = SensorErrors(gyro_bias=0.01 * DEG_H, accel_bias=50.0 * UG)
KNOWN = KnownHeading(1.0, 1.0 * DEG)
NOT_STILL = "not still"
IN_DEGREES = r'they are in degrees; set imu.gyro_unit = "deg/s"'
TOO_WEAK = r"gyros cannot find north.*give site.heading_deg"


def refusal(window: Window, **options: object) -> str:
    """The message of the refusal, which must come with and without a known heading."""
    with pytest.raises(AlignmentError) as with_heading:
        align_static(*window.samples, known_heading=KNOWN, **options)  # type: ignore[arg-type]
    with pytest.raises(NavgradeError) as without:
        align_static(*window.samples, **options)  # type: ignore[arg-type]
    assert str(without.value) == str(with_heading.value)
    return str(without.value)


def minute(euler: tuple[float, float, float], lat_deg: float = 45.0) -> Window:
    return still(lat_deg, rotation(*euler), count=1200, dt=0.05)


def stamps(window: Window) -> np.ndarray:
    return np.cumsum(window.dt)


def turning(window: Window, angle: np.ndarray, axis: np.ndarray) -> Window:
    """The body turned by `angle` (rad, one per sample) about a fixed body axis."""
    turns = Rotation.from_rotvec(angle[:, None] * axis)
    rate = np.gradient(angle, stamps(window))[:, None] * axis
    return Window(
        window.dt,
        turns.inv().apply(window.omega_ib_b) + rate,
        turns.inv().apply(window.f_ib_b),
        window.lat,
        window.h,
        window.attitude,
    )


@EACH_ATTITUDE
@pytest.mark.parametrize("axis", np.eye(3), ids="xyz")
def test_swaying(euler: tuple[float, float, float], axis: np.ndarray) -> None:
    """A boat at its mooring: 1° at 8 s, about any axis."""
    window = minute(euler)
    angle = 1.0 * DEG * np.sin(2.0 * np.pi / 8.0 * stamps(window))
    assert NOT_STILL in refusal(turning(window, angle, axis))


@EACH_ATTITUDE
def test_turned_during_the_window(euler: tuple[float, float, float]) -> None:
    """Somebody moves the tripod by 3° in 2 s."""
    window = minute(euler)
    angle = 3.0 * DEG * np.clip((stamps(window) - 40.0) / 2.0, 0.0, 1.0)
    message = refusal(turning(window, angle, np.array([0.0, 0.6, 0.8])))
    assert NOT_STILL in message
    assert "choose alignment.start_s and duration_s inside a stop" in message


@EACH_ATTITUDE
def test_driving_off(euler: tuple[float, float, float]) -> None:
    """0.5 m/s^2 for the last five seconds."""
    window = minute(euler)
    push = np.where(stamps(window) > 55.0, 0.5, 0.0)[:, None] * [0.8, 0.0, 0.6]
    message = refusal(window.plus(accel=push))
    assert NOT_STILL in message
    # Five of sixty seconds at 0.5 m/s^2 scatter by 0.5 sqrt(5/60 * 55/60) = 0.1382.
    assert "0.1382 m/s²" in message


def test_a_drive_with_turns_is_motion_and_not_a_wrong_unit() -> None:
    """Once round the block in a minute: 6 deg/s on average, braking and cornering."""
    window = minute((0.0, 0.0, 0.3))
    t = stamps(window)
    speed = 8.0 + 3.0 * np.sin(2.0 * np.pi / 20.0 * t)  # m/s
    rate = 6.0 * DEG * (1.0 + np.sin(2.0 * np.pi / 15.0 * t))  # rad/s
    zero = np.zeros_like(t)
    drive = window.plus(
        gyro=np.stack([zero, zero, rate], axis=-1),
        accel=np.stack([np.gradient(speed, t), speed * rate, zero], axis=-1),
    )
    message = refusal(drive)
    assert NOT_STILL in message
    assert "degrees" not in message


@EACH_ATTITUDE
@pytest.mark.parametrize("lat_deg", [-60.0, -5.0, 0.0, 45.0, 75.0])
def test_navigation_gyros_in_degrees(lat_deg: float, euler: tuple[float, float, float]) -> None:
    window = minute(euler, lat_deg).plus(gyro=0.01 * DEG_H)
    in_degrees = Window(
        window.dt,
        window.omega_ib_b / DEG,
        window.f_ib_b,
        window.lat,
        window.h,
        window.attitude,
    )
    with pytest.raises(AlignmentError, match=IN_DEGREES):
        align_static(*in_degrees.samples, errors=NAVIGATION)
    # 180/pi = 57.30, and 0.02 deg/h of 15 deg/h for the bias
    assert re.search(r"57\.[234] times the Earth rate", refusal(in_degrees))


@EACH_ATTITUDE
def test_mems_gyros_in_degrees(euler: tuple[float, float, float]) -> None:
    """A bias of 0.24 deg/s, read as 0.24 rad/s, is no bias of any gyro."""
    rng = np.random.default_rng(80)
    window = minute(euler).plus(gyro=0.24 * DEG * np.array([0.6, -0.64, 0.48]))
    window = window.noisy(rng, 0.3 * DEG / 60.0, 200.0 * UG)
    in_degrees = window.plus(gyro=window.omega_ib_b * (1.0 / DEG - 1.0))
    with pytest.raises(AlignmentError, match=IN_DEGREES):
        align_static(*in_degrees.samples, known_heading=KNOWN)


def test_a_steady_turn_about_the_vertical_may_be_either() -> None:
    """A turntable at 3 deg/s: no force tells it from a wrong unit, so both are named."""
    window = minute((0.1, -0.2, 1.0))
    turned = window.plus(gyro=window.attitude.inv().apply([0.0, 0.0, 3.0 * DEG]))
    with pytest.raises(AlignmentError, match=IN_DEGREES) as caught:
        align_static(*turned.samples, known_heading=KNOWN)
    assert NOT_STILL in str(caught.value)


@pytest.mark.parametrize("bias_deg_s", [0.05, 0.24, 0.6])
@pytest.mark.parametrize(
    "direction", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -0.6, -0.8), (-0.6, 0.48, 0.64)]
)
@pytest.mark.parametrize("lat_deg", [45.0, -52.0])
def test_no_false_alarm_for_a_mems_bias(
    bias_deg_s: float, direction: tuple[float, float, float], lat_deg: float
) -> None:
    """0.24 deg/s is 57 Earth rates, yet only its elevation could make it pass for one."""
    rng = np.random.default_rng(81)
    window = minute((0.1, -0.05, 2.0), lat_deg).plus(gyro=bias_deg_s * DEG * np.array(direction))
    window = window.noisy(rng, 0.3 * DEG / 60.0, 200.0 * UG)
    known = KnownHeading(2.0, 2.0 * DEG)
    result = align_static(*window.samples, known_heading=known)
    assert result.method == "known-heading"
    assert result.heading == pytest.approx(2.0, rel=0.0, abs=1e-12)  # rad, as given
    # White noise of 200 µg/sqrt(Hz) over a minute is 26 µrad; five of these.
    assert result.roll == pytest.approx(0.1, rel=0.0, abs=1.3e-4)
    assert result.pitch == pytest.approx(-0.05, rel=0.0, abs=1.3e-4)
    with pytest.raises(AlignmentError, match=TOO_WEAK):
        align_static(*window.samples)


@EACH_ATTITUDE
def test_specific_force_in_g(euler: tuple[float, float, float]) -> None:
    window = minute(euler, -30.0)
    in_g = window.plus(accel=window.f_ib_b * (1.0 / 9.80665 - 1.0))
    message = refusal(in_g)
    assert 'it is in g; set imu.accel_unit = "g"' in message


@EACH_ATTITUDE
def test_gravity_removed(euler: tuple[float, float, float]) -> None:
    window = minute(euler)
    removed = window.plus(accel=0.02 - window.f_ib_b)
    assert "gravity has been removed from this stream" in refusal(removed)


@pytest.mark.parametrize("scale", [0.15, 0.5, 0.9, 1.1, 2.0, 100.0])
def test_a_force_that_is_neither(scale: float) -> None:
    window = minute((0.2, 0.1, -1.0))
    message = refusal(window.plus(accel=window.f_ib_b * (scale - 1.0)))
    assert f"specific force at rest is {scale * window.g:.4f} m/s², not 9.8" in message


# m/s^2 the Earth offers, equator on a mountain to the pole, with a poor accelerometer
@pytest.mark.parametrize("force", [9.70, 9.76, 9.81, 9.84, 9.90])
def test_no_force_of_the_earth_is_refused(force: float) -> None:
    omega = OMEGA * np.array([np.cos(0.7), 0.0, -np.sin(0.7)])
    for attitude in (rotation(0.1, 0.2, 0.3), rotation(3.0, -1.5, 2.0)):
        check_units_at_rest(
            attitude.inv().apply(omega), attitude.inv().apply([0.0, 0.0, -force]), 0.7
        )
        with pytest.raises(AlignmentError, match="in degrees"):  # the check is awake
            check_units_at_rest(
                attitude.inv().apply(omega / DEG), attitude.inv().apply([0.0, 0.0, -force]), 0.7
            )


@pytest.mark.parametrize("seconds", [0.05, 1.0, 1.95])
def test_too_short(seconds: float) -> None:
    window = still(45.0, rotation(0.1, 0.2, 0.3), count=round(seconds / 0.05), dt=0.05)
    message = refusal(window)
    assert f"holds {seconds:.3f} s of samples; it takes 2 s at least" in message


def test_two_seconds_are_enough_for_perfect_sensors() -> None:
    window = still(45.0, rotation(0.1, 0.2, 0.3), count=32, dt=0.0625)
    assert align_static(*window.samples, errors=NAVIGATION).method == "triad"


@pytest.mark.parametrize("lat_deg", [0.0, 45.0, -45.0, 70.0, 89.0])
def test_stated_gyro_bias_too_large(lat_deg: float) -> None:
    """15° of heading is the limit: a bias of 0.262 of the level Earth rate, to a percent."""
    window = still(lat_deg, rotation(0.3, -0.1, 2.0))
    level_rate = OMEGA * np.cos(window.lat)
    limit = 15.0 * DEG * level_rate
    weak = SensorErrors(gyro_bias=1.01 * limit, accel_bias=0.1 * UG)
    with pytest.raises(AlignmentError, match=TOO_WEAK) as caught:
        align_static(*window.samples, errors=weak)
    assert f"gyro error {1.01 * limit / DEG_H:.3g} deg/h" in str(caught.value)
    assert f"horizontal Earth rate of {level_rate / DEG_H:.2f} deg/h" in str(caught.value)
    better = SensorErrors(gyro_bias=0.99 * limit, accel_bias=0.1 * UG)
    assert align_static(*window.samples, errors=better).method == "triad"
    known = KnownHeading(2.0, 0.01)
    rescued = align_static(*window.samples, errors=weak, known_heading=known)
    assert rescued.method == "known-heading"


@pytest.mark.parametrize("noise_deg_rth", [0.5, 1.0])
def test_gyros_too_noisy(noise_deg_rth: float) -> None:
    """Nothing is stated: the samples themselves show that a minute is too short."""
    rng = np.random.default_rng(82)
    window = minute((0.3, -0.1, 2.0)).noisy(rng, noise_deg_rth * DEG / 60.0, 20.0 * UG)
    with pytest.raises(AlignmentError, match=TOO_WEAK):
        align_static(*window.samples)


@pytest.mark.parametrize("lat_deg", [90.0, -90.0])
def test_at_a_pole_only_a_known_heading_helps(lat_deg: float) -> None:
    window = still(lat_deg, rotation(0.3, -0.1, 2.0))
    with pytest.raises(AlignmentError, match=TOO_WEAK):
        align_static(*window.samples, errors=NAVIGATION)
    result = align_static(*window.samples, errors=NAVIGATION, known_heading=KnownHeading(2.0, 0.01))
    assert result.method == "known-heading"
    assert (result.roll, result.pitch) == pytest.approx((0.3, -0.1), rel=0.0, abs=1e-12)


@pytest.mark.filterwarnings("error")
def test_gyros_that_read_nothing() -> None:
    """A dead gyro is no reason for a NaN; with a heading the attitude is still level."""
    window = still(45.0, rotation(0.3, -0.1, 2.0))
    dead = window.plus(gyro=-window.omega_ib_b)
    with pytest.raises(AlignmentError, match=TOO_WEAK):
        align_static(*dead.samples)
    result = align_static(*dead.samples, known_heading=KnownHeading(2.0, 0.01))
    assert (result.roll, result.pitch) == pytest.approx((0.3, -0.1), rel=0.0, abs=1e-12)
    assert not any("nan" in warning for warning in result.warnings)
