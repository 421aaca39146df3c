"""Analytic coarse alignment in its variants: exact on perfect data, wrong as its formulas say."""

from typing import get_args

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from align.errors import AlignmentError
from align.triad import Variant, analytic_coarse, triad
from tests.align.at_rest import DEG_H, UG, Array, Window, attitudes, rotation, still
from tests.oracles.constants import OMEGA
from tests.oracles.gravity import normal_gravity_zonal

EACH_VARIANT = pytest.mark.parametrize("variant", get_args(Variant))
EACH_LATITUDE = pytest.mark.parametrize("lat_deg", [-80, -60, -33.9, -5, 0, 18.4, 51.08, 80])
HEIGHTS = (0.0, 9000.0)  # m

# rad. Where a variant leaves the angle between gravity and the Earth rate to the data, the error
# of the package's gravity (1e-11 m/s^2) and 1e-16 over a sixth of the Earth rate enter.
EXACT = 2e-12


def references(window: Window) -> dict[str, Array]:
    """Gravity and Earth rate in n, by the oracles."""
    gravity = normal_gravity_zonal(window.lat, window.h)
    return {
        "g_n": np.array([float(gravity.north), 0.0, float(gravity.down)]),
        "omega_ie_n": OMEGA * np.array([np.cos(window.lat), 0.0, -np.sin(window.lat)]),
    }


def error(window: Window, variant: Variant) -> Array:
    C = analytic_coarse(
        window.f_ib_b[0], window.omega_ib_b[0], variant=variant, **references(window)
    )
    return (Rotation.from_matrix(C) * window.attitude.inv()).as_rotvec()


@EACH_VARIANT
@EACH_LATITUDE
def test_perfect_data(lat_deg: float, variant: Variant) -> None:
    for k, euler in enumerate(attitudes()):
        window = still(lat_deg, rotation(*euler), h=HEIGHTS[k % 2], count=1)
        assert np.linalg.norm(error(window, variant)) < EXACT, euler


def test_without_references_the_plumb_line_is_taken_for_the_normal() -> None:
    """0.8 nrad per metre at 45°, about east; with them, none."""
    window = still(45.0, rotation(0.3, -0.4, 2.0), h=1000.0, count=1)
    C = analytic_coarse(window.f_ib_b[0], window.omega_ib_b[0])
    off = (Rotation.from_matrix(C) * window.attitude.inv()).as_rotvec()
    gravity = normal_gravity_zonal(window.lat, window.h)
    lean = float(gravity.north / gravity.down)
    assert abs(lean) == pytest.approx(0.8e-6, rel=0.05)
    np.testing.assert_allclose(off, [0.0, -lean, 0.0], rtol=0.0, atol=1e-12)  # rad
    assert np.linalg.norm(error(window, "gravity-first")) < EXACT


def expected(variant: Variant, lat: float, g: float, gyro: Array, accel: Array) -> Array:
    """Signed first-order small rotation NED of `analytic_coarse`'s docstring, written again."""
    rate, tilt = gyro / OMEGA, accel / g
    sin, cos, tan = np.sin(lat), np.cos(lat), np.tan(lat)
    east = {
        "gravity-first": tilt[0],
        "rate-first": sin * rate[0] + cos * rate[2],
        "inverse": 0.5 * (tilt[0] - tan * tilt[2] + rate[2] / cos),
    }[variant]
    return np.array([-tilt[1], east, tan * tilt[1] - rate[1] / cos])


@EACH_VARIANT
@pytest.mark.parametrize("lat_deg", [-75.0, -45.0, -10.0, 0.0, 30.0, 60.0, 75.0])
@pytest.mark.parametrize("source", range(6), ids=["gN", "gE", "gD", "aN", "aE", "aD"])
def test_signed_error_of_each_sensor(lat_deg: float, source: int, variant: Variant) -> None:
    biases = np.zeros(6)
    biases[source] = [
        0.013 * DEG_H,
        -0.007 * DEG_H,
        0.011 * DEG_H,
        60.0 * UG,
        -35.0 * UG,
        80.0 * UG,
    ][source]
    gyro, accel = biases[:3], biases[3:]
    for euler in [(0.3, -0.2, 0.8), (-2.9, 0.4, -1.7), (0.4, np.pi / 2, 1.0)]:
        window = still(lat_deg, rotation(*euler), count=1)
        plus = error(window.plus_n(gyro=gyro, accel=accel), variant)
        minus = error(window.plus_n(gyro=-gyro, accel=-accel), variant)
        truth = expected(variant, window.lat, window.g, gyro, accel)
        ratio = np.linalg.norm(gyro) / OMEGA + np.linalg.norm(accel) / window.g
        ratio /= np.cos(window.lat)
        # Half the difference has no second order left; EXACT is the rounding of both.
        np.testing.assert_allclose(
            0.5 * (plus - minus), truth, rtol=0.0, atol=2.0 * ratio**3 + EXACT
        )
        np.testing.assert_allclose(plus, truth, rtol=0.0, atol=2.0 * ratio**2 + EXACT)


def test_what_each_variant_keeps() -> None:
    """With errors: the first vector exactly, or, by the inverse, neither but a rotation."""
    window = still(-40.0, rotation(-1.0, 0.6, 2.5), h=500.0, count=1)
    window = window.plus(gyro=[1e-6, -2e-6, 1.5e-6], accel=[0.01, 0.02, -0.015])
    f, omega, known = window.f_ib_b[0], window.omega_ib_b[0], references(window)

    def off(variant: Variant) -> tuple[float, float]:
        C = analytic_coarse(f, omega, variant=variant, **known)
        np.testing.assert_allclose(C @ C.T, np.eye(3), rtol=0.0, atol=1e-14)
        assert np.linalg.det(C) == pytest.approx(1.0, rel=0.0, abs=1e-14)
        sines = []
        for v_b, v_n in ((f, -known["g_n"]), (omega, known["omega_ie_n"])):
            lengths = np.linalg.norm(v_b) * np.linalg.norm(v_n)
            sines.append(float(np.linalg.norm(np.cross(C @ v_b, v_n)) / lengths))
        return sines[0], sines[1]

    assert off("gravity-first")[0] < 1e-15 < 1e-3 < off("gravity-first")[1]
    assert off("rate-first")[1] < 1e-15 < 1e-3 < off("rate-first")[0]
    assert min(off("inverse")) > 1e-3


def test_triad_of_any_two_pairs() -> None:
    rng = np.random.default_rng(7)
    for euler in attitudes():
        attitude = rotation(*euler)
        v_n = rng.normal(size=(2, 3))
        v_b = attitude.inv().apply(v_n) * [[3.0], [0.2]]
        C = triad(*v_n, *v_b)
        # rad; the random pairs are at least a hundredth of a radian from parallel
        assert (Rotation.from_matrix(C) * attitude.inv()).magnitude() < 1e-13, euler


@pytest.mark.parametrize(
    ("vectors", "message"),
    [
        (((0, 0, 1), (0, 0, -2), (1, 0, 0), (0, 1, 0)), "parallel"),
        (((1, 0, 0), (0, 1, 0), (1, 2, 3), (1, 2, 3 + 1e-9)), "parallel"),
        (((1, 0, 0), (0, 1, 0), (1, 2, 3), (0, 0, 0)), "no direction"),
    ],
)
def test_pairs_that_fix_no_attitude(vectors: tuple[tuple[float, ...], ...], message: str) -> None:
    with pytest.raises(AlignmentError, match=message):
        triad(*vectors)


def test_coarse_alignment_refuses() -> None:
    window = still(30.0, rotation(0.1, 0.2, 0.3), count=1)
    f, omega, known = window.f_ib_b[0], window.omega_ib_b[0], references(window)
    with pytest.raises(AlignmentError, match="at a pole"):
        analytic_coarse(f, 1e-6 * f, **known)
    with pytest.raises(ValueError, match="only gravity-first does without"):
        analytic_coarse(f, omega, variant="inverse")
    with pytest.raises(ValueError, match="both"):
        analytic_coarse(f, omega, g_n=known["g_n"])
    with pytest.raises(ValueError, match="variant must be one of gravity-first"):
        analytic_coarse(f, omega, variant="best")  # type: ignore[arg-type]
