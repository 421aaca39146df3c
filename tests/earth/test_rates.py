"""Rates of the Earth and of the local level, against the derivative of the frames themselves."""

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.typing import NDArray

from earth import Ellipsoid, omega_en_n, omega_ie_n, omega_in_n
from tests.earth import exact
from tests.oracles.constants import OMEGA_TEXT

Array = NDArray[np.float64]
DEG = np.pi / 180.0

# lat deg, lon deg, h m, velocity north, east, down m/s: both hemispheres, date line, near the
# poles, and each velocity component alone
STATES = [
    (51.08, -114.13, 1118.5, (260.0, 150.0, -5.0)),
    (-33.5, 151.25, 2500.0, (-120.0, 300.0, 12.0)),
    (5.0, 179.9999999, 10_000.0, (-10.0, 600.0, 0.0)),
    (-0.001, -180.0, -50.0, (33.0, -21.0, 3.0)),
    (89.0, 12.0, 8000.0, (150.0, -250.0, 1.0)),
    (-89.99, -77.0, 3000.0, (-2.0, 5.0, 0.5)),
    (45.0, 10.0, 0.0, (100.0, 0.0, 0.0)),
    (-45.0, 10.0, 0.0, (0.0, 100.0, 0.0)),
    (70.0, 10.0, 0.0, (0.0, 0.0, 100.0)),
]
EACH_STATE = pytest.mark.parametrize(("lat_deg", "lon_deg", "h", "v"), STATES)


def skew_part(C: mp.matrix, dC: mp.matrix) -> list[mpf]:
    """Rate of the moving axes, resolved in themselves: C^T dC = [omega x]."""
    product = C.T * dC
    return [product[2, 1], product[0, 2], product[1, 0]]


def place_of(r: mp.matrix, start: list[mpf]) -> tuple[mpf, mpf]:
    """Latitude and longitude of a point by Newton's method on the ellipse: no radius enters."""
    rho, z = mp.hypot(r[0], r[1]), r[2]

    def miss(lat: mpf, h: mpf) -> list[mpf]:
        point = exact.meridian_point(lat, h)
        return [point[0] - rho, point[1] - z]

    found = mp.findroot(miss, start, tol=mpf(10) ** -60)
    return found[0], mp.atan2(r[1], r[0])


@EACH_STATE
def test_transport_rate(
    lat_deg: float, lon_deg: float, h: float, v: tuple[float, float, float]
) -> None:
    """A point moves straight through Earth-fixed space; the axes at its place turn."""
    lat, lon = lat_deg * DEG, lon_deg * DEG
    with mp.workdps(80):
        here = exact.C_en(mpf(lat), mpf(lon))
        rho, z = exact.meridian_point(mpf(lat), mpf(h))
        r = mp.matrix([rho * mp.cos(mpf(lon)), rho * mp.sin(mpf(lon)), z])
        step = mpf(10) ** -20  # s; the central difference is good to 1e-30 of the rate
        velocity = here * mp.matrix(v)
        ahead, back = (
            exact.C_en(*place_of(r + sign * step * velocity, [mpf(lat), mpf(h)]))
            for sign in (1, -1)
        )
        expected = [float(x) for x in skew_part(here, (ahead - back) / (2 * step))]
    # Roundings of a product, 2.2e-16 of the rate; tan(lat) takes the 1.1e-16 rad rounding of the
    # latitude, which is shared, so no more than a few ulps remain even at 89.99°. Straight up
    # nothing turns, to the error of the difference.
    tol = 1e-15 * max(np.abs(expected)) + 1e-24  # rad/s
    np.testing.assert_allclose(omega_en_n(lat, h, v), expected, rtol=0.0, atol=tol)


@EACH_STATE
def test_earth_rate_is_the_polar_axis_seen_from_the_place(
    lat_deg: float, lon_deg: float, h: float, v: tuple[float, float, float]
) -> None:
    lat, lon = lat_deg * DEG, lon_deg * DEG
    with mp.workdps(40):
        axis = exact.C_en(mpf(lat), mpf(lon)).T * mp.matrix([0, 0, mpf(OMEGA_TEXT)])
    expected = np.array([float(x) for x in axis])
    tol = 2e-20  # rad/s, one rounding of 7.3e-5
    np.testing.assert_allclose(omega_ie_n(lat), expected, rtol=0.0, atol=tol)
    total = expected + omega_en_n(lat, h, v)
    np.testing.assert_allclose(omega_in_n(lat, h, v), total, rtol=0.0, atol=tol + 1e-16 * total[0])


def test_signs_in_words() -> None:
    """The Earth turns eastward; so do the axes of who travels east, and north is minus east."""
    assert omega_ie_n(40.0 * DEG)[0] > 0.0 > omega_ie_n(40.0 * DEG)[2]
    assert omega_ie_n(-40.0 * DEG)[2] > 0.0
    north, east = omega_en_n(-40.0 * DEG, 0.0, np.diag([10.0, 10.0, 10.0]))[:2]
    assert north[1] < 0.0
    assert north[0] == north[2] == 0.0
    assert east[0] > 0.0
    assert east[2] > 0.0


def test_rates_follow_the_ellipsoid_given() -> None:
    """Twice the size turns the level half as fast; twice the spin is twice the Earth rate."""
    v, lat = np.array([30.0, -70.0, 2.0]), -0.8
    base = Ellipsoid("base", 6.4e6, 1.0 / 300.0, 4e14, 7e-5, "made up")
    other = Ellipsoid("other", 1.28e7, 1.0 / 300.0, 4e14, 1.4e-4, "made up")
    # rad/s: a few roundings of 1e-4 and 1e-5
    np.testing.assert_allclose(
        omega_ie_n(lat, other), 2.0 * omega_ie_n(lat, base), rtol=0.0, atol=1e-19
    )
    np.testing.assert_allclose(
        omega_en_n(lat, 0.0, v, other), 0.5 * omega_en_n(lat, 0.0, v, base), rtol=0.0, atol=1e-20
    )
    np.testing.assert_array_equal(
        omega_in_n(lat, 0.0, v, other), omega_ie_n(lat, other) + omega_en_n(lat, 0.0, v, other)
    )


def test_shapes_broadcast() -> None:
    lat, h = np.array([0.2, -0.9, 1.4]), np.array([[0.0], [5000.0]])
    v = np.array([30.0, -70.0, 2.0])
    assert omega_ie_n(lat).shape == (3, 3)
    rates = omega_in_n(lat, h, np.broadcast_to(v, (2, 3, 3)))
    assert rates.shape == (2, 3, 3)
    np.testing.assert_array_equal(rates[1, 2], omega_in_n(1.4, 5000.0, v))
