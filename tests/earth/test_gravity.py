"""Normal gravity against GeographicLib's table, zonal harmonics and the closed potential."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from earth import (
    GRAVITY_MODELS,
    GRS80,
    WGS84,
    DisturbanceGrid,
    Ellipsoid,
    gravity_n,
    normal_gravity_n,
    somigliana_second_order,
)
from earth._jit import kernel, uncached
from earth.gravity import (
    GravityFit,
    closed_form_gravity,
    fitted_gravity,
    gravity,
    gravity_field,
    gravity_fit,
    needs_place,
    somigliana,
)
from tests.earth import exact
from tests.oracles import constants
from tests.oracles import gravity as oracle

Array = NDArray[np.float64]
Evaluate = Callable[[Ellipsoid, Array, Array], Array]
DEG = np.pi / 180.0
CLAIM = 1e-11  # m/s^2, what the docstrings promise: 1e-12 g
# A hundred roundings on 10 m/s^2, 1.8e-15 m/s^2 each, that mostly cancel; two digits below CLAIM.
ROUNDING = 1e-13  # m/s^2
H_MIN, H_MAX = -1000.0, 20_000.0  # m, the domain the docstrings promise
FLAT = Ellipsoid("flat", 3396190.0, 1.0 / 50.0, 4.2828e13, 2.5e-4, "made up")

# Normal gravity, m/s^2, computed with GeographicLib and in 50 digits: lat deg, h m, north, down
VECTORS = [
    (0.0, 0.0, 0.0, 9.780325335903892),
    (0.0, 1000.0, 0.0, 9.777238264593897),
    (0.0, 10000.0, 0.0, 9.749519858256518),
    (0.0, 20000.0, 0.0, 9.718858773096203),
    (30.0, 0.0, 0.0, 9.793247269219322),
    (30.0, 1000.0, -7.0547144677e-6, 9.790161296095843),
    (30.0, 10000.0, -7.04741969945e-5, 9.762452727353303),
    (30.0, 20000.0, -1.40786419988e-4, 9.731802476651257),
    (45.0, 0.0, 0.0, 9.806197769377376),
    (45.0, 1000.0, -8.14359054512e-6, 9.803112896932381),
    (45.0, 10000.0, -8.13519889761e-5, 9.775414187888955),
    (45.0, 20000.0, -1.62517643965e-4, 9.744774795528002),
    (60.0, 0.0, 0.0, 9.819176953118638),
    (60.0, 1000.0, -7.05039810567e-6, 9.816093183844106),
    (60.0, 10000.0, -7.0431580534e-5, 9.788404356605226),
    (60.0, 20000.0, -1.40702393822e-4, 9.757775846471629),
    (90.0, 0.0, 0.0, 9.832184937863400),
    (90.0, 1000.0, 0.0, 9.829102274251326),
    (90.0, 10000.0, 0.0, 9.801423350923577),
    (90.0, 20000.0, 0.0, 9.770805746907038),
    (-33.5, 2500.25, 1.87436627177e-5, 9.788362616313032),
]


@kernel
def _fit_loop(params, fit, lat, h, out):
    for i in range(lat.size):
        for j in range(h.size):
            out[i, j, 0], out[i, j, 1] = fitted_gravity(
                params, fit, np.sin(lat[i]), np.cos(lat[i]), h[j]
            )


@kernel
def _closed_loop(params, lat, h, out):
    for i in range(lat.size):
        for j in range(h.size):
            out[i, j, 0], out[i, j, 1] = closed_form_gravity(
                params, np.sin(lat[i]), np.cos(lat[i]), h[j]
            )


def fit_compiled(ellipsoid: Ellipsoid, lat: Array, h: Array) -> Array:
    out = np.empty((lat.size, h.size, 2))
    _fit_loop(ellipsoid.params, gravity_fit(ellipsoid), lat, h, out)
    return out


def fit_plain(ellipsoid: Ellipsoid, lat: Array, h: Array) -> Array:
    params, fit = ellipsoid.params, gravity_fit(ellipsoid)
    trig = [(float(np.sin(x)), float(np.cos(x))) for x in lat]
    return np.array([[fitted_gravity(params, fit, s, c, float(y)) for y in h] for s, c in trig])


def closed_compiled(ellipsoid: Ellipsoid, lat: Array, h: Array) -> Array:
    out = np.empty((lat.size, h.size, 2))
    _closed_loop(ellipsoid.params, lat, h, out)
    return out


def closed_plain(ellipsoid: Ellipsoid, lat: Array, h: Array) -> Array:
    return normal_gravity_n(lat[:, None], h[None, :], ellipsoid)[..., [0, 2]]


def zonal(lat: Array, h: Array) -> Array:
    truth = oracle.normal_gravity_zonal(lat[:, None], h[None, :])
    return np.stack([truth.north, truth.down], axis=-1)


def use(monkeypatch: pytest.MonkeyPatch, ellipsoid: exact.ExactEllipsoid) -> None:
    """Give the 50-digit route the constants of another ellipsoid."""
    monkeypatch.setattr(oracle, "EQUATORIAL_RADIUS_TEXT", ellipsoid.a)
    monkeypatch.setattr(oracle, "INVERSE_FLATTENING_TEXT", ellipsoid.inverse_f)
    monkeypatch.setattr(oracle, "GM_TEXT", ellipsoid.GM)
    monkeypatch.setattr(oracle, "OMEGA_TEXT", ellipsoid.omega)


@pytest.mark.parametrize(("lat_deg", "h", "north", "down"), VECTORS)
def test_reference_vectors(lat_deg: float, h: float, north: float, down: float) -> None:
    g_n = normal_gravity_n(lat_deg * DEG, h)
    # The north literals end at 12 digits: 1e-16 m/s^2 at most.
    assert g_n[0] == pytest.approx(north, rel=0.0, abs=ROUNDING)
    assert g_n[1] == 0.0
    assert g_n[2] == pytest.approx(down, rel=0.0, abs=ROUNDING)


def test_against_the_table(shared_data: Path) -> None:
    table = np.loadtxt(
        shared_data / "normal_gravity_wgs84_geographiclib.csv", delimiter=",", skiprows=2
    )
    assert len(table) == 46 * 11
    lat, h, north, up, magnitude, surface = table.T
    lat = lat * DEG
    g_n = normal_gravity_n(lat, h)
    np.testing.assert_allclose(g_n[:, 0], north, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(g_n[:, 2], -up, rtol=0.0, atol=ROUNDING)
    np.testing.assert_allclose(np.linalg.norm(g_n, axis=-1), magnitude, rtol=0.0, atol=ROUNDING)
    on_surface = somigliana(WGS84.params, np.sin(lat))
    np.testing.assert_allclose(on_surface, surface, rtol=0.0, atol=ROUNDING)
    fitted = np.array(
        [
            fitted_gravity(WGS84.params, gravity_fit(WGS84), np.sin(p), np.cos(p), y)
            for p, y in zip(lat, h, strict=True)
        ]
    )
    np.testing.assert_allclose(fitted, np.stack([north, -up], axis=-1), rtol=0.0, atol=CLAIM)


@pytest.mark.parametrize("evaluate", [closed_plain, closed_compiled])
def test_closed_form_against_zonal_harmonics(evaluate: Evaluate) -> None:
    lat = np.linspace(-90.0, 90.0, 541) * DEG
    h = np.concatenate([np.linspace(-1000.0, 20_000.0, 106), [35_000.0, 60_000.0, 100_000.0]])
    truth = zonal(lat, h)
    np.testing.assert_allclose(evaluate(WGS84, lat, h), truth, rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("ellipsoid", "truth"),
    [(WGS84, exact.WGS84), (GRS80, exact.GRS80), (FLAT, exact.FLAT)],
    ids=["WGS84", "GRS80", "flat"],
)
def test_closed_form_in_50_digits(
    ellipsoid: Ellipsoid, truth: exact.ExactEllipsoid, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On ellipsoids that differ in every constant, one of them too flat to forgive a slip."""
    use(monkeypatch, truth)
    for lat in (-1.5707, -0.91, -1e-6, 0.3, 0.7853981, 1.49):
        for h in (-1000.0, 0.0, 1234.5, 20_000.0, 100_000.0):
            north, _, down = normal_gravity_n(lat, h, ellipsoid)
            expected = oracle.normal_gravity_mp(lat, h)
            assert abs(north - expected.north) < ROUNDING
            assert abs(down - expected.down) < ROUNDING


@pytest.mark.parametrize("evaluate", [fit_plain, fit_compiled])
def test_fit_against_zonal_harmonics(evaluate: Evaluate) -> None:
    """The promise of `gravity_fit`, on a grid that does not share its nodes."""
    count = (1441, 211) if evaluate is fit_compiled else (181, 43)
    lat = np.linspace(-90.0, 90.0, count[0]) * DEG
    h = np.linspace(H_MIN, H_MAX, count[1])
    np.testing.assert_allclose(evaluate(WGS84, lat, h), zonal(lat, h), rtol=0.0, atol=CLAIM)


@pytest.mark.parametrize("evaluate", [fit_plain, fit_compiled])
def test_fit_of_grs80(evaluate: Evaluate) -> None:
    """A second set of coefficients, against the closed form that 50 digits confirm."""
    lat = np.concatenate([np.linspace(-90.0, 90.0, 121), [-89.9999, 1e-4]]) * DEG
    h = np.linspace(H_MIN, H_MAX, 64)
    truth = closed_plain(GRS80, lat, h)
    np.testing.assert_allclose(evaluate(GRS80, lat, h), truth, rtol=0.0, atol=CLAIM)
    assert np.abs(truth - zonal(lat, h)).max() > 1e-7  # m/s^2: another ellipsoid indeed


@pytest.mark.parametrize(
    "h", [-11_000.0, np.nextafter(H_MIN, -np.inf), np.nextafter(H_MAX, np.inf), 1e5]
)
@pytest.mark.parametrize("lat", [-1.3, -0.4, 0.8])
def test_outside_its_domain_the_fit_is_the_closed_form(lat: float, h: float) -> None:
    sin_lat, cos_lat = float(np.sin(lat)), float(np.cos(lat))
    params = WGS84.params
    found = fitted_gravity(params, gravity_fit(WGS84), sin_lat, cos_lat, float(h))
    assert found == closed_form_gravity(params, sin_lat, cos_lat, float(h))


@pytest.mark.parametrize("h", [H_MIN, -400.0, 3000.0, H_MAX])
def test_inside_its_domain_the_fit_answers(h: float) -> None:
    """It differs from the closed form, by less than it promises."""
    sin_lat, cos_lat = float(np.sin(-0.4)), float(np.cos(-0.4))
    found = fitted_gravity(WGS84.params, gravity_fit(WGS84), sin_lat, cos_lat, h)
    truth = closed_form_gravity(WGS84.params, sin_lat, cos_lat, h)
    assert found != truth
    np.testing.assert_allclose(found, truth, rtol=0.0, atol=CLAIM)


def test_outside_its_domain_the_compiled_fit_is_true() -> None:
    lat = np.array([-1.3, -0.4, 0.8, 1.57])
    h = np.array([-2500.0, 25_000.0, 50_000.0, 100_000.0])
    found = fit_compiled(WGS84, lat, h)
    np.testing.assert_allclose(found, zonal(lat, h), rtol=0.0, atol=ROUNDING)


def test_a_fit_is_made_once_and_cannot_change() -> None:
    fit = gravity_fit(WGS84)
    assert gravity_fit(WGS84) is fit
    assert gravity_fit(GRS80) != fit
    assert isinstance(fit, GravityFit)
    assert (len(fit.down), len(fit.north)) == (15, 6)
    with pytest.raises(AttributeError):
        fit.down = ()  # type: ignore[misc]  # the point of the test


def test_the_plumb_line_leans_to_the_equator_above_the_ellipsoid() -> None:
    """In both hemispheres; below the surface the other way."""
    for lat in (-1.2, -0.5, 0.1, 0.9):
        assert normal_gravity_n(lat, 5000.0)[0] * lat < 0.0
        assert normal_gravity_n(lat, -500.0)[0] * lat > 0.0


def test_shapes_broadcast() -> None:
    g_n = normal_gravity_n(np.array([[0.7], [-0.4]]), np.array([0.0, 1e3, 1e4]))
    assert g_n.shape == (2, 3, 3)
    np.testing.assert_array_equal(g_n[1, 2], normal_gravity_n(-0.4, 1e4))


# µm/s^2, at the equator, 45° and the poles: half a unit of the last digit, and 1 nm/s^2 of margin
@pytest.mark.parametrize(
    ("h", "errors"),
    [
        (0.0, (0.0, 0.0, 0.0)),
        (1000.0, (0.10, 0.05, 0.0)),
        (10_000.0, (0.70, 0.41, 0.21)),
        (20_000.0, (1.25, 1.26, 1.44)),
    ],
)
@pytest.mark.parametrize("hemisphere", [1.0, -1.0])
def test_error_of_somigliana_with_second_order_height(
    h: float, errors: tuple[float, float, float], hemisphere: float
) -> None:
    lat = hemisphere * np.array([0.0, 45.0, 90.0]) * DEG
    truth = oracle.normal_gravity_zonal(lat, h)
    error = somigliana_second_order(lat, h) - np.hypot(truth.north, truth.down)
    np.testing.assert_allclose(error * 1e6, errors, rtol=0.0, atol=0.006)


@pytest.mark.parametrize(("h", "bound"), [(1000.0, 0.105e-6), (20_000.0, 1.445e-6)])
def test_documented_error_of_somigliana_at_every_latitude(h: float, bound: float) -> None:
    """The docstring: 0.1 µm/s^2 at 1 km and 1.4 µm/s^2 at 20 km, to the digits printed."""
    lat = np.linspace(-90.0, 90.0, 721) * DEG
    truth = oracle.normal_gravity_zonal(lat, h)
    error = np.abs(somigliana_second_order(lat, h) - np.hypot(truth.north, truth.down))
    assert 0.95 * bound < error.max() < bound


def test_somigliana_of_grs80(monkeypatch: pytest.MonkeyPatch) -> None:
    use(monkeypatch, exact.GRS80)
    for lat in (-0.7, 0.35, 1.2):
        expected = oracle.normal_gravity_mp(lat, 0.0).down
        assert abs(float(somigliana_second_order(lat, 0.0, GRS80)) - expected) < ROUNDING


def on_the_ellipsoid(lat: Array, h: Array) -> Array:
    """North and down of "somigliana": the magnitude on the surface, unchanged with height."""
    surface = oracle.normal_gravity_zonal(lat[:, None], np.zeros(1))
    down = np.hypot(surface.north, surface.down) + 0.0 * h
    return np.stack([np.zeros_like(down), down], axis=-1)


def to_second_order(lat: Array, h: Array) -> Array:
    """North and down of "somigliana-taylor": Heiskanen & Moritz (2-123) in the oracles' numbers."""
    a, f = constants.EQUATORIAL_RADIUS, 1.0 / float(constants.INVERSE_FLATTENING_TEXT)
    m = constants.OMEGA**2 * a**3 * (1.0 - f) / constants.GM
    slope = -2.0 / a * (1.0 + f + m - 2.0 * f * np.sin(lat[:, None]) ** 2)
    north_down = on_the_ellipsoid(lat, h)
    north_down[..., 1] *= 1.0 + slope * h + 3.0 * (h / a) ** 2
    return north_down


TRUTHS = {
    "closed-form": zonal,
    "somigliana-taylor": to_second_order,
    "somigliana": on_the_ellipsoid,
}


def test_every_named_model_is_tested_and_the_first_is_the_default() -> None:
    assert list(TRUTHS) == list(GRAVITY_MODELS)
    assert gravity_fit() == gravity_fit(WGS84, "closed-form")
    assert gravity_field() == gravity_field("closed-form")


@pytest.mark.parametrize("model", GRAVITY_MODELS)
def test_a_named_model_is_its_formula_in_the_domain_of_the_fit(model: str) -> None:
    lat = np.linspace(-90.0, 90.0, 361) * DEG
    h = np.linspace(H_MIN, H_MAX, 64)
    g_n = gravity_n(lat[:, None], 0.7, h, model)
    np.testing.assert_allclose(g_n[..., [0, 2]], TRUTHS[model](lat, h), rtol=0.0, atol=CLAIM)
    assert not g_n[..., 1].any()
    if model != "closed-form":
        assert not g_n[..., 0].any()


@pytest.mark.parametrize("model", GRAVITY_MODELS)
def test_a_named_model_is_its_formula_outside_too(model: str) -> None:
    lat = np.array([-1.3, -0.4, 0.8, 1.57])
    h = np.array([-2500.0, np.nextafter(H_MAX, np.inf), 25_000.0, 100_000.0])
    g_n = gravity_n(lat[:, None], 0.7, h, model)
    np.testing.assert_allclose(g_n[..., [0, 2]], TRUTHS[model](lat, h), rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("h", [-2500.0, 4000.0, 25_000.0])
@pytest.mark.parametrize("model", GRAVITY_MODELS)
def test_a_named_model_knows_its_ellipsoid(model: str, h: float) -> None:
    """GRS80 is weaker by 1.4 µm/s^2 (its GM), the same for every model at these heights."""
    difference = gravity_n(-0.6, 0.0, h, model, ellipsoid=GRS80) - gravity_n(-0.6, 0.0, h, model)
    truth = normal_gravity_n(-0.6, 0.0, GRS80) - normal_gravity_n(-0.6, 0.0)
    assert abs(truth[2]) > 1e-6
    # 0.8 % of it at 25 km, by (r / (r + h))^2
    np.testing.assert_allclose(difference, truth, rtol=0.0, atol=0.02 * abs(truth[2]))


@pytest.mark.parametrize("model", GRAVITY_MODELS)
def test_plain_and_compiled_gravity_agree(model: str) -> None:
    field = gravity_field(model)
    assert not needs_place(field)
    for lat, h in ((-1.1, 2500.0), (0.6, -3000.0), (1.2, 40_000.0)):
        plain = gravity(WGS84.params, field, float(np.sin(lat)), float(np.cos(lat)), 0.0, 0.0, h)
        # A few roundings on 10 m/s^2, fused in one and not in the other.
        np.testing.assert_allclose(plain, gravity_n(lat, 2.0, h, model), rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize(
    ("name", "near"),
    [("closed", "closed-form"), ("Somigliana", "somigliana"), ("somigliana-tailor", "-taylor")],
)
def test_an_unknown_model_is_refused_with_the_nearest_name(name: str, near: str) -> None:
    with pytest.raises(ValueError, match=f"got {name!r}; did you mean '.*{near}'"):
        gravity_field(name)


def test_the_refusal_lists_the_names() -> None:
    with pytest.raises(ValueError, match="closed-form, somigliana-taylor, somigliana or a func"):
        gravity_n(0.5, 0.0, 0.0, "egm2008")


@kernel
def _loop_with_place(params, field, sin_lat, cos_lat, sin_lon, cos_lon, h, out):
    for k in range(out.shape[0]):
        lat = lon = 0.0
        if needs_place(field):
            lat = np.arctan2(sin_lat[k], cos_lat[k])
            lon = np.arctan2(sin_lon[k], cos_lon[k])
        out[k, 0], out[k, 1], out[k, 2] = gravity(
            params, field, sin_lat[k], cos_lat[k], lat, lon, h[k]
        )


def test_a_loop_pays_for_the_place_only_where_it_is_needed() -> None:
    """The arctangents are gone from the machine code of a named model."""
    lat, lon, h = np.array([-0.5, 0.52]), np.array([0.1, -0.2]), np.array([100.0, 3000.0])
    trig = [f(x) for x in (lat, lon) for f in (np.sin, np.cos)]
    grid = DisturbanceGrid(*([-1.0, 1.0],) * 2, *np.array([[[1.0, 2.0], [-3.0, 1.0]]] * 3) * 1e-5)
    loop = uncached(_loop_with_place)
    code = []
    for disturbance in (None, grid):
        out = np.empty((2, 3))
        loop(WGS84.params, gravity_field(disturbance=disturbance), *trig, h, out)
        code.append(loop.inspect_asm(loop.signatures[-1]))  # type: ignore[attr-defined]
        expected = gravity_n(lat, lon, h, disturbance=disturbance)
        # 1e-15 rad in the place times the 5e-5 m/s^2 per rad of this grid, and rounding
        np.testing.assert_allclose(out, expected, rtol=0.0, atol=ROUNDING)
    assert "atan2" not in code[0]
    assert "atan2" in code[1]
