"""Ellipsoids: what follows from the four constants, against 50 digits and the published values."""

from dataclasses import FrozenInstanceError, replace

import pytest
from mpmath import mp, mpf

from earth import GRS80, WGS84, Ellipsoid
from earth.ellipsoid import ellipsoidal_q
from tests.earth import exact
from tests.oracles import constants

FLAT = Ellipsoid("flat", 3396190.0, 1.0 / 50.0, 4.2828e13, 2.5e-4, "made up")
PAIRS = [(WGS84, exact.WGS84), (GRS80, exact.GRS80), (FLAT, exact.FLAT)]
EACH_PAIR = pytest.mark.parametrize(
    ("ellipsoid", "truth"), PAIRS, ids=lambda x: getattr(x, "name", "")
)


def closed_q(x: mpf) -> tuple[mpf, mpf]:
    """q and q' of Heiskanen & Moritz (2-57, 2-67 with u/E = 1/x), arctangents and all."""
    return (
        ((1 + 3 / x**2) * mp.atan(x) - 3 / x) / 2,
        3 * (1 + 1 / x**2) * (1 - mp.atan(x) / x) - 1,
    )


def test_the_constants_are_those_of_the_standard() -> None:
    assert pytest.approx(float(constants.EQUATORIAL_RADIUS_TEXT), rel=0.0, abs=0.0) == WGS84.a
    assert 1.0 / WGS84.f == pytest.approx(float(constants.INVERSE_FLATTENING_TEXT), rel=1e-15)
    assert float(constants.GM_TEXT) == WGS84.GM
    assert float(constants.OMEGA_TEXT) == WGS84.omega
    for ellipsoid in (WGS84, GRS80):
        assert any(year in ellipsoid.citation for year in ("2014", "2000"))


# x = E/u: from far outside the Earth, over its surface (0.082), to the flattest planet allowed
@pytest.mark.parametrize("x", [1e-6, 1e-3, 0.02, 0.0818, 0.0822, 0.12, 0.2031])
def test_the_series_of_q_loses_no_digit(x: float) -> None:
    with mp.workdps(80):
        truth = closed_q(mpf(x))
        # Relative, a few roundings of 1.1e-16: the arctangents would lose 11 of 16 digits.
        for value, expected in zip(ellipsoidal_q(x), truth, strict=True):
            assert abs(value / expected - 1) < 1e-15


@EACH_PAIR
def test_derived_constants(ellipsoid: Ellipsoid, truth: exact.ExactEllipsoid) -> None:
    """Normal gravity from Heiskanen & Moritz (2-73, 2-74), with q in closed form, in 80 digits."""
    with mp.workdps(80):
        a, GM, omega = mpf(truth.a), mpf(truth.GM), mpf(truth.omega)
        f = 1 / mpf(truth.inverse_f)
        b = a * (1 - f)
        E = mp.sqrt(a**2 - b**2)
        q0, dq0 = closed_q(E / b)
        m = omega**2 * a**2 * b / GM
        swirl = m * E / b * dq0 / q0
        expected = {
            "a": a,
            "b": b,
            "e2": 1 - (b / a) ** 2,
            "E": E,
            "GM": GM,
            "omega": omega,
            "q0": q0,
            "gamma_e": GM / (a * b) * (1 - m - swirl / 6),
            "gamma_p": GM / a**2 * (1 + swirl / 3),
        }
        for name, value in ellipsoid.params._asdict().items():
            # Relative, some roundings of 1.1e-16: 2 nm of b, 5e-15 m/s^2 of gravity.
            assert abs(value / expected[name] - 1) < 1e-15, name


# Half a unit of the last printed digit.
@pytest.mark.parametrize(
    ("ellipsoid", "name", "published", "half_digit"),
    [
        (WGS84, "gamma_e", 9.7803253359, 0.5e-10),  # m/s^2, NGA.STND.0036 table 3.6
        (WGS84, "gamma_p", 9.8321849379, 0.5e-10),  # m/s^2
        (WGS84, "b", 6356752.3142, 0.5e-4),  # m
        (WGS84, "e2", 6.694379990141e-3, 0.5e-15),
        (GRS80, "gamma_e", 9.7803267715, 0.5e-10),  # m/s^2, Moritz (2000)
        (GRS80, "gamma_p", 9.8321863685, 0.5e-10),  # m/s^2
        (GRS80, "b", 6356752.3141, 0.5e-4),  # m
        (GRS80, "e2", 0.00669438002290, 0.5e-14),
    ],
)
def test_published_values(
    ellipsoid: Ellipsoid, name: str, published: float, half_digit: float
) -> None:
    assert getattr(ellipsoid.params, name) == pytest.approx(published, rel=0.0, abs=half_digit)


def test_grs80_flattening_is_the_one_its_form_factor_defines() -> None:
    """GRS80 defines J2 = 108263e-8 and not f; Heiskanen & Moritz (2-90) leads back to it."""
    with mp.workdps(60):
        a, GM, omega, f = mpf(6378137), mpf("3986005e8"), mpf("7292115e-11"), mpf(GRS80.f)
        second_eccentricity = mp.sqrt(1 / (1 - f) ** 2 - 1)
        q0, _ = closed_q(second_eccentricity)
        m = omega**2 * a**3 * (1 - f) / GM
        J2 = f * (2 - f) / 3 * (1 - 2 * m * second_eccentricity / (15 * q0))
        # f is held to 2.2e-19 (half an ulp), and dJ2/df = 2/3; ten times that.
        assert abs(J2 - mpf("108263e-8")) < 3e-18


@pytest.mark.parametrize("name", ["a", "f", "GM", "omega", "name", "params"])
def test_an_ellipsoid_is_frozen(name: str) -> None:
    with pytest.raises(FrozenInstanceError):
        setattr(WGS84, name, 1.0)


def test_its_numbers_for_kernels_do_not_change_either() -> None:
    with pytest.raises(AttributeError):
        WGS84.params.a = 1.0  # type: ignore[misc]  # the point of the test
    assert WGS84.params is WGS84.params
    assert hash(replace(WGS84)) == hash(WGS84)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("a", 0.0),
        ("a", -6378137.0),
        ("a", float("inf")),
        ("GM", float("nan")),
        ("GM", -1.0),
        ("omega", 0.0),
        ("omega", -7.292115e-5),
        ("f", 0.0),
        ("f", 298.257223563),
        ("f", 0.0201),
        ("f", float("nan")),
    ],
)
def test_a_wrong_constant_is_named_with_its_value(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"Ellipsoid {name} must be .*{value!r}"):
        replace(WGS84, **{name: value})
