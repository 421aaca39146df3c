"""Two-axis and small-angle formulas, and a known heading on the plumb line of the place."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from align.errors import AlignmentError
from align.gyrocompass import gyrocompass, gyrocompass_small_angle
from align.leveling import level, level_small_angle, level_two_axes, leveled_attitude
from tests.align.at_rest import DEG, HALF, UG, attitudes, error_n, rotation, still
from tests.oracles.gravity import normal_gravity_zonal

EACH_LATITUDE = pytest.mark.parametrize("lat_deg", [-80, -60, -33.9, -5, 0, 18.4, 51.08, 80])


@EACH_LATITUDE
def test_two_axes_level_an_upright_body(lat_deg: float) -> None:
    for roll, pitch, heading in attitudes():
        window = still(lat_deg, rotation(roll, pitch, heading), count=1)
        fx, fy, _ = window.f_ib_b[0]
        upward = abs(np.cos(pitch) * np.cos(roll))
        if upward < 1e-7:  # there rounding may make it more than gravity
            continue
        found = level_two_axes(fx, fy, window.g)
        turned = Rotation.from_euler("YX", [found[1], found[0]])
        truth = roll if np.cos(roll) > 0.0 else np.arctan2(np.sin(roll), -np.cos(roll))
        off = turned * Rotation.from_euler("YX", [pitch, truth]).inv()
        # rad: what is left of gravity is rounded to 1e-16 of it, its root to that over its cosine
        assert abs(off.as_rotvec()[1]) < 1e-15 / upward, (roll, pitch)
        assert (found[0] - truth) * np.cos(pitch) == pytest.approx(0.0, abs=1e-15 / upward)


@pytest.mark.parametrize(("roll", "pitch"), [(0.0, 0.0), (0.4, -0.3), (-1.0, 0.9), (1.2, -1.1)])
def test_errors_of_two_axes(roll: float, pitch: float) -> None:
    """Signed, first order, of both accelerometers and of gravity."""
    window = still(40.0, rotation(roll, pitch, 1.0), count=1)
    fx, fy, _ = window.f_ib_b[0]
    g, bias, excess = window.g, (300.0 * UG, -200.0 * UG), 150.0 * UG
    found = level_two_axes(fx + bias[0], fy + bias[1], g + excess)
    less = level_two_axes(fx - bias[0], fy - bias[1], g - excess)
    p = (bias[0] - np.sin(pitch) * excess) / (g * np.cos(pitch))
    r = -(bias[1] / np.cos(pitch) + np.sin(roll) * excess) / (g * np.cos(roll))
    r += np.tan(roll) * np.tan(pitch) * p
    half = 0.5 * (np.array(found) - less)
    # rad: third order
    np.testing.assert_allclose(half, (r, p), rtol=0.0, atol=10.0 * max(abs(r), abs(p)) ** 3)
    # The vector form does not ask for gravity, and near the level the two agree.
    if roll == pitch == 0.0:
        np.testing.assert_allclose(found, level((fx + bias[0], fy + bias[1], -g)), atol=1e-7)


def test_two_axes_see_no_difference_between_up_and_down() -> None:
    hanging = still(20.0, rotation(np.pi - 0.2, 0.1, 0.0), count=1)
    fx, fy, _ = hanging.f_ib_b[0]
    np.testing.assert_allclose(level_two_axes(fx, fy, hanging.g), (0.2, 0.1), rtol=0.0, atol=1e-14)
    assert level(hanging.f_ib_b[0])[0] == pytest.approx(np.pi - 0.2, rel=0.0, abs=1e-14)


@pytest.mark.parametrize("force", [(9.9, 0.0), (-9.9, 0.0), (0.0, 9.9), (7.0, -7.1), (np.nan, 0.0)])
def test_two_axes_that_feel_more_than_gravity(force: tuple[float, float]) -> None:
    with pytest.raises(AlignmentError, match="level with all three"):
        level_two_axes(*force, 9.81)
    assert level_two_axes(9.81, 0.0, 9.81)[1] == HALF


@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_small_angle_leveling_is_short_by_its_third_order(scale: float) -> None:
    roll, pitch = 5.0 * DEG * scale, -4.0 * DEG * scale
    window = still(-30.0, rotation(roll, pitch, 2.0), count=1)
    found = level_small_angle(*window.f_ib_b[0, :2], window.g)
    short = (-roll * (roll**2 / 6.0 + pitch**2 / 2.0), -(pitch**3) / 6.0)
    fifth = np.hypot(roll, pitch) ** 5 / 10.0  # rad
    np.testing.assert_allclose(np.subtract(found, (roll, pitch)), short, rtol=0.0, atol=fifth)
    assert abs(short[0]) > 10.0 * fifth


@pytest.mark.parametrize("lat_deg", [-70.0, -20.0, 0.0, 45.0, 80.0])
@pytest.mark.parametrize("heading", [0.0, 0.7, 2.0, -2.5, -0.9, np.pi])
def test_small_angle_gyrocompass_is_off_by_its_second_order(lat_deg: float, heading: float) -> None:
    steps = []
    for scale in (1.0, 0.5):
        roll, pitch = 2.0 * DEG * scale, -1.5 * DEG * scale
        window = still(lat_deg, rotation(roll, pitch, heading), count=1)
        omega = window.omega_ib_b[0]
        assert gyrocompass(omega, roll, pitch) == pytest.approx(heading, rel=0.0, abs=1e-13)
        off = gyrocompass_small_angle(omega, roll, pitch) - heading
        off -= 2.0 * np.pi * np.rint(off / (2.0 * np.pi))
        second = (roll**2 - pitch**2) / 4.0 * np.sin(2.0 * heading)
        second -= roll * pitch * np.sin(heading) ** 2
        steps.append(off - second)
        third = np.hypot(roll, pitch) ** 3 * (1.0 + abs(np.tan(window.lat)))  # rad
        assert abs(steps[-1]) < third
    # What is left shrinks with the third power.
    assert abs(steps[1]) < abs(steps[0]) / 6.0 + 1e-12


def test_small_angle_formulas_by_hand() -> None:
    """A level body heading east feels the northward rate on its left; nose up, f leads."""
    assert gyrocompass_small_angle((0.0, -1.0, 0.0), 0.0, 0.0) == pytest.approx(HALF)
    assert level_small_angle(1.0, -2.0, 10.0) == (0.2, 0.1)


@EACH_LATITUDE
def test_known_heading_on_the_plumb_line(lat_deg: float) -> None:
    """The ellipsoid's normal is down, though the force leans by up to 7 µrad at 9 km."""
    for euler in attitudes():
        window = still(lat_deg, rotation(*euler), h=9000.0, count=1)
        gravity = normal_gravity_zonal(window.lat, window.h)
        g_n = np.array([float(gravity.north), 0.0, float(gravity.down)])
        q = leveled_attitude(window.f_ib_b[0], euler[2], g_n=g_n)
        C = Rotation.from_quat(q, scalar_first=True)
        up = C.apply(window.f_ib_b[0]) / window.g
        # Whatever becomes of roll and heading, the force points up the plumb line.
        np.testing.assert_allclose(up, -g_n / window.g, rtol=0.0, atol=1e-15)
        if np.cos(euler[1]) > 1e-3:  # rad: roll is rounded by 1e-16 over cos(pitch)
            assert np.linalg.norm(error_n(q, window.attitude)) < 1e-12, euler
        elif np.cos(euler[1]) > 2e-5:  # the nose is clear of plumb line and normal
            assert np.linalg.norm(error_n(q, window.attitude)) < 1e-10, euler


def test_without_the_place_the_plumb_line_is_the_normal() -> None:
    window = still(45.0, rotation(0.5, -0.3, 2.0), h=9000.0, count=1)
    off = error_n(leveled_attitude(window.f_ib_b[0], 2.0), window.attitude)
    gravity = normal_gravity_zonal(window.lat, window.h)
    assert off[1] == pytest.approx(-float(gravity.north / gravity.down), rel=1e-3)
    assert np.linalg.norm(off[:2]) > 7e-6  # rad
