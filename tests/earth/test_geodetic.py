"""Radii and Earth-fixed coordinates, against GeographicLib's table and the ellipse in 50 digits."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.typing import NDArray

from earth import (
    GRS80,
    WGS84,
    Ellipsoid,
    ecef_to_geodetic,
    geodetic_to_ecef,
    meridian_radius,
    transverse_radius,
)
from earth.geodetic import ecef_from_geodetic, geodetic_from_ecef, radii
from tests.earth import exact

Array = NDArray[np.float64]
DEG = np.pi / 180.0
NEAR = 100_000.0  # m, heights for which the forward direction is promised
R_EARTH = 6.38e6  # m
TOL = 1e-8  # m, what the docstrings promise: five roundings of an Earth radius, 1.9e-9 m each
TOL_RADIUS = 4e-9  # m, what the docstrings of the radii promise: four ulps of an Earth radius

# Both hemispheres, equator, mid-latitudes, and toward the poles as close as float64 goes.
LATITUDES = np.concatenate(
    [
        np.linspace(-90.0, 90.0, 121) * DEG,
        0.5 * np.pi - 10.0 ** -np.arange(1.0, 15.0),
        10.0 ** -np.arange(1.0, 15.0) - 0.5 * np.pi,
        [1e-9, -1e-9, -33.5 * DEG, 51.07995352 * DEG],
        # Where rounding of the meridian radius is worst among 60 000 random latitudes
        [0.6847314376251337, -0.642716544130937, -1.5426811031381518, -0.1968092767459073],
    ]
)
LONGITUDES = (
    np.array([-180.0, -179.999999999, -114.13, -1e-9, 0.0, 10.0, 151.25, 179.999999999]) * DEG
)


class Table(NamedTuple):
    """GeographicLib's 200 points."""

    lat: Array
    lon: Array
    h: Array
    r: Array
    meridian: Array
    transverse: Array


@pytest.fixture(scope="module")
def table(shared_data: Path) -> Table:
    rows = np.loadtxt(shared_data / "lla_ecef_wgs84_geographiclib.csv", delimiter=",", skiprows=1)
    assert len(rows) == 200
    return Table(
        rows[:, 0] * DEG, rows[:, 1] * DEG, rows[:, 2], rows[:, 3:6], rows[:, 6], rows[:, 7]
    )


def distances(lat: Array, lon: Array, h: Array, truth: tuple[Array, Array, Array]) -> Array:
    """Metres between two sets of coordinates: north, east, up."""
    lat_0, lon_0, h_0 = truth
    turn = np.remainder(lon - lon_0 + np.pi, 2.0 * np.pi) - np.pi
    return np.stack(
        [(lat - lat_0) * (R_EARTH + h_0), turn * (R_EARTH + h_0) * np.cos(lat_0), h - h_0], axis=-1
    )


def test_ecef_against_the_table(table: Table) -> None:
    for r in (
        geodetic_to_ecef(table.lat, table.lon, table.h),
        np.stack(ecef_from_geodetic(WGS84.params, table.lat, table.lon, table.h), axis=-1),
    ):
        np.testing.assert_allclose(r, table.r, rtol=0.0, atol=TOL)


def test_geodetic_against_the_table(table: Table) -> None:
    by_rows = ecef_to_geodetic(table.r)
    one_by_one = np.array([geodetic_from_ecef(WGS84.params, *map(float, r)) for r in table.r]).T
    for lat, lon, h in (by_rows, one_by_one):
        off = distances(lat, lon, h, (table.lat, table.lon, table.h))
        np.testing.assert_allclose(off, 0.0, rtol=0.0, atol=TOL)


def test_radii_against_the_table(table: Table) -> None:
    # The table is rounded to 1 ulp of its own, 0.9e-9 m, on top of what is promised.
    tol = TOL_RADIUS + 1e-9  # m
    np.testing.assert_allclose(meridian_radius(table.lat), table.meridian, rtol=0.0, atol=tol)
    np.testing.assert_allclose(transverse_radius(table.lat), table.transverse, rtol=0.0, atol=tol)


# GeographicLib, PROJ's cct and pymap3d agree on these to 1e-9 m.
@pytest.mark.parametrize(
    ("lat_deg", "lon_deg", "h", "r"),
    [
        (45.0, 10.0, 1000.0, (4449654.886667982, 784594.21136083216, 4488055.5156471064)),
        (-33.5, 151.25, 2500.25, (-4669582.1548553385, 2561820.4958502753, -3501714.2684698823)),
        (89.9, -120.0, 0.0, (-5584.6960853031958, -9672.9773645761479, 6356742.5671093141)),
    ],
)
def test_ecef_reference_points(
    lat_deg: float, lon_deg: float, h: float, r: tuple[float, float, float]
) -> None:
    lat, lon = lat_deg * DEG, lon_deg * DEG
    np.testing.assert_allclose(geodetic_to_ecef(lat, lon, h), r, rtol=0.0, atol=TOL)
    found = np.array([float(x) for x in ecef_to_geodetic(r)])
    off = distances(*found, (lat, lon, h))
    np.testing.assert_allclose(off, 0.0, rtol=0.0, atol=TOL)


@pytest.mark.parametrize(
    ("lat_deg", "meridian", "transverse"),
    [
        (0.0, 6335439.32729282, 6378137.0),
        (-30.0, 6351377.103715514, 6383480.917690109),
        (45.0, 6367381.815619549, 6388838.290121148),
        (-60.0, 6383453.857229078, 6394209.173847894),
        (90.0, 6399593.625758493, 6399593.625758493),
    ],
)
def test_radii_reference_values(lat_deg: float, meridian: float, transverse: float) -> None:
    tol = TOL_RADIUS + 1e-9  # m, the literals carry a rounding of their own
    assert meridian_radius(lat_deg * DEG) == pytest.approx(meridian, rel=0.0, abs=tol)
    assert transverse_radius(lat_deg * DEG) == pytest.approx(transverse, rel=0.0, abs=tol)


@pytest.mark.parametrize("which", [0, 1], ids=["meridian", "transverse"])
def test_radii_against_the_ellipse(which: int) -> None:
    """The accuracy the docstrings claim, at every latitude."""
    values = (meridian_radius, transverse_radius)[which](LATITUDES)
    worst = max(
        abs(mpf(float(value)) - exact.radii(float(lat))[which])
        for lat, value in zip(LATITUDES, values, strict=True)
    )
    assert worst < TOL_RADIUS


@pytest.mark.parametrize(
    ("ellipsoid", "truth"), [(WGS84, exact.WGS84), (GRS80, exact.GRS80)], ids=["WGS84", "GRS80"]
)
@pytest.mark.parametrize("h", [-NEAR, -400.0, 0.0, 1118.5, 20_000.0, NEAR])
def test_ecef_against_the_ellipse(
    h: float, ellipsoid: Ellipsoid, truth: exact.ExactEllipsoid
) -> None:
    lon = np.resize(LONGITUDES, LATITUDES.shape)
    r = geodetic_to_ecef(LATITUDES, lon, h, ellipsoid)
    formula = np.stack(ecef_from_geodetic(ellipsoid.params, LATITUDES, lon, h), axis=-1)
    places = zip(LATITUDES, lon, strict=True)
    expected = [[float(x) for x in exact.ecef(float(p), float(q), h, truth)] for p, q in places]
    np.testing.assert_allclose(r, expected, rtol=0.0, atol=TOL)
    np.testing.assert_allclose(formula, expected, rtol=0.0, atol=TOL)


# m: the whole domain of `ecef_to_geodetic`, below the surface to geostationary
@pytest.mark.parametrize("h", [-NEAR, -5000.0, 0.0, 20_000.0, 1e6, 1e7, 35_786_000.0])
def test_geodetic_against_the_ellipse(h: float) -> None:
    """The coordinates found lead, in 50 digits, back to the point that was asked for."""
    rng = np.random.default_rng(20)
    lat = np.concatenate([LATITUDES, rng.uniform(-np.pi / 2, np.pi / 2, 300)])
    lon = np.concatenate([np.resize(LONGITUDES, LATITUDES.shape), rng.uniform(-np.pi, np.pi, 300)])
    places = zip(lat, lon, strict=True)
    r = np.array([[float(x) for x in exact.ecef(float(p), float(q), h)] for p, q in places])
    found = np.stack(ecef_to_geodetic(r), axis=-1)
    with mp.workdps(exact.DIGITS):
        worst = max(
            mp.norm(mp.matrix(exact.ecef(*map(float, place))) - mp.matrix(point.tolist()))
            for place, point in zip(found, r, strict=True)
        )
    assert worst < (TOL if h < 1e7 else 2 * TOL)  # what the docstring promises far out


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 60, reason="needs an extended float type")
@pytest.mark.parametrize("h", [-NEAR, 0.0, NEAR, 1e7, 35_786_000.0])  # m
def test_three_rounds_of_bowring_are_enough(h: float) -> None:
    """In extended arithmetic only the truncation of the iteration is left: below 1e-9 m."""

    def extended(x: mpf) -> np.longdouble:
        high = float(x)
        return np.longdouble(high) + np.longdouble(float(x - mpf(high)))

    with mp.workdps(exact.DIGITS):
        for lat in np.linspace(-1.57, 1.57, 41):
            rho, z = exact.meridian_point(mpf(float(lat)), mpf(h))
            found, _, height = geodetic_from_ecef(
                WGS84.params, extended(rho), np.longdouble(0.0), extended(z)
            )
            assert abs(found - np.longdouble(lat)) * (R_EARTH + h) < 1e-9
            assert abs(height - np.longdouble(h)) < 1e-9


@pytest.mark.parametrize("z_sign", [1.0, -1.0])
def test_on_the_axis(z_sign: float) -> None:
    """At a pole the longitude is arbitrary, latitude and height are not."""
    lat, lon, h = ecef_to_geodetic([0.0, 0.0, z_sign * 6356752.3142451793])
    assert float(lat) == z_sign * np.pi / 2
    assert np.isfinite(lon)
    assert abs(float(h)) < TOL


def test_radii_formula_takes_scalars_and_arrays_alike() -> None:
    lat = np.array([[-1.2, 0.3], [0.9, 1.5]])
    each = [radii(WGS84.params, float(s)) for s in np.sin(lat).ravel()]
    np.testing.assert_array_equal(meridian_radius(lat).ravel(), [m for m, _ in each])
    np.testing.assert_array_equal(transverse_radius(lat).ravel(), [t for _, t in each])


def test_shapes_broadcast() -> None:
    lat, lon = np.array([[0.7], [-0.4]]), np.array([0.1, 2.0, -3.0])
    r = geodetic_to_ecef(lat, lon, 500.0)
    assert r.shape == (2, 3, 3)
    np.testing.assert_array_equal(r[1, 2], geodetic_to_ecef(-0.4, -3.0, 500.0))
    found = ecef_to_geodetic(r)
    assert [x.shape for x in found] == [(2, 3)] * 3
    assert abs(float(found[1][1, 2]) + 3.0) < 1e-15  # rad


@pytest.mark.parametrize("lat", [1.6, -1.6, [0.1, 45.0]])
def test_a_latitude_beyond_the_pole_is_refused(lat: float | list[float]) -> None:
    with pytest.raises(ValueError):
        geodetic_to_ecef(lat, 0.0, 0.0)
