"""Azimuths of surveyed lines: value, sigma, and what turns one kind of north into another."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pymap3d.vincenty
import pytest

from align.survey import (
    KnownAzimuth,
    Mark,
    SurveyError,
    azimuth_between,
    meridian_convergence,
    stated_azimuth,
)
from earth.ellipsoid import GRS80
from tests.align.naive import DEG, local_axes, sight, turn, xyz

ARCSEC = DEG / 3600.0  # rad


def mark(lat_deg: float, lon_deg: float, h: float = 0.0, name: str = "A", **more: object) -> Mark:
    given: dict[str, object] = {"sigmas": (0.005, 0.005, 0.01), **more}
    return Mark(name, lat_deg * DEG, lon_deg * DEG, h, **given)  # type: ignore[arg-type]


def away(start: Mark, north: float, east: float, h: float = 0.0, **more: object) -> Mark:
    """About as many meters north and east."""
    lat = start.lat / DEG + north / 111.3e3
    lon = start.lon / DEG + east / (111.3e3 * math.cos(start.lat))
    return mark(lat, lon, h, "B", **more)


LINES = [  # latitude, longitude, north, east
    (51.08, -114.13, 300.0, 560.0),
    (51.08, -114.13, -7000.0, 6000.0),
    (-37.9, 144.4, 9000.0, -3000.0),
    (0.0, 0.0, 1000.0, -1000.0),
    (78.0, 179.999, 100.0, 300.0),  # across the date line
    (45.0, 10.0, -500.0, 0.0),
]


@pytest.mark.parametrize(("lat", "lon", "north", "east"), LINES)
def test_the_azimuth_is_that_of_the_line_of_sight(
    lat: float, lon: float, north: float, east: float
) -> None:
    """2 nrad over 10 km: what geodesic and normal section differ by."""
    a = mark(lat, lon)
    b = away(a, north, east)
    found = azimuth_between(a, b)
    truth, _ = sight((a.lat, a.lon, 0.0), (b.lat, b.lon, 0.0))
    # 1e-8 m of rounding of Earth-fixed coordinates over the line, beside the 2 nrad
    assert turn(found.azimuth, truth) == pytest.approx(
        0.0, abs=2e-9 + 1e-8 / abs(north + 1j * east)
    )
    assert 0.0 <= found.azimuth < 2.0 * math.pi
    _, by_vincenty = pymap3d.vincenty.vdist(lat, lon, b.lat / DEG, b.lon / DEG)
    assert turn(found.azimuth, float(by_vincenty) * DEG) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("bearing", range(0, 360, 30))
@pytest.mark.parametrize("lat", [0.0, 30.0, -60.0])
def test_a_high_target_moves_the_azimuth_by_no_more_than_is_said(lat: float, bearing: int) -> None:
    a = mark(lat, 20.0)
    b = away(a, 2e3 * math.cos(bearing * DEG), 2e3 * math.sin(bearing * DEG), 1000.0)
    truth, _ = sight((a.lat, a.lon, 0.0), (b.lat, b.lon, 1000.0))
    assert abs(turn(azimuth_between(a, b).azimuth, truth)) < 0.6e-6


def test_a_published_line() -> None:
    """Flinders Peak to Buninyong, GDA94 Technical Manual (ICSM), chapter 4: GRS80, 0.01″."""
    flinders = mark(-(37 + 57 / 60 + 3.72030 / 3600), 144 + 25 / 60 + 29.52440 / 3600)
    buninyong = mark(-(37 + 39 / 60 + 10.15610 / 3600), 143 + 55 / 60 + 35.38390 / 3600)
    there = azimuth_between(flinders, buninyong, ellipsoid=GRS80)
    back = azimuth_between(buninyong, flinders, ellipsoid=GRS80)
    assert there.azimuth == pytest.approx((306 + 52 / 60 + 5.37 / 3600) * DEG, abs=0.006 * ARCSEC)
    assert back.azimuth == pytest.approx((127 + 10 / 60 + 25.07 / 3600) * DEG, abs=0.006 * ARCSEC)
    assert "54972.271 m" in there.provenance


def test_equal_sigmas_give_the_rule_of_thumb() -> None:
    a = mark(51.0, -114.0)
    found = azimuth_between(a, away(a, 100.0, 0.0))
    # the line is 100 m to 0.1 %, since a degree of latitude is not always 111.3 km
    assert found.sigma == pytest.approx(math.sqrt(2.0) * 0.005 / 100.0, rel=2e-3)


def test_the_sigma_is_that_of_marks_thrown_about() -> None:
    """30,000 draws show a standard deviation to 0.4 %; 1.5 % is nearly four of those."""
    rng = np.random.default_rng(5)
    a = mark(40.0, 15.0, sigmas=(0.02, 0.005, 0.1))
    b = away(a, 60.0, 25.0, sigmas=(0.003, 0.03, 0.1))
    line = xyz(b.lat, b.lon, 0.0) - xyz(a.lat, a.lon, 0.0)
    north, east = (axis @ line for axis in local_axes(a.lat, a.lon)[:2])
    draws = 30_000
    assert a.sigmas is not None and b.sigmas is not None
    n = north + rng.normal(0.0, b.sigmas[0], draws) - rng.normal(0.0, a.sigmas[0], draws)
    e = east + rng.normal(0.0, b.sigmas[1], draws) - rng.normal(0.0, a.sigmas[1], draws)
    thrown = float(np.std(np.arctan2(e, n)))
    assert azimuth_between(a, b).sigma == pytest.approx(thrown, rel=0.015)


def test_marks_too_close_are_refused_with_the_sigma_there_would_be() -> None:
    a = mark(51.0, -114.0)
    with pytest.raises(SurveyError) as refusal:
        azimuth_between(a, away(a, 0.04, 0.0))
    said = str(refusal.value)
    assert "0.04 m apart" in said and "0.0071 m across" in said
    assert "sigma of 10.1°" in said
    assert "0.071 m apart at least" in said
    azimuth_between(a, away(a, 0.09, 0.0))  # far enough


def test_what_has_no_direction_or_no_sigma_is_refused() -> None:
    a = mark(51.0, -114.0, sigmas=None)
    b = away(a, 100.0, 50.0)
    with pytest.raises(SurveyError, match="at the same place"):
        azimuth_between(b, replace(b, name="C"))
    with pytest.raises(SurveyError, match=r"because mark A \(\) has none; give the azimuth's"):
        azimuth_between(a, b)
    assert azimuth_between(a, b, sigma=1e-4).sigma == 1e-4
    swapped = replace(b, lat=b.lon + math.pi / 2, lon=b.lat)
    with pytest.raises(SurveyError, match=r"km long; are latitude and longitude of one mark"):
        azimuth_between(a, swapped, sigma=1e-4)


@pytest.mark.parametrize(
    ("frames", "epochs", "said"),
    [
        (("NAD 83(2011)", "ITRF2014"), (2010.0, 2010.0), "frames may differ by 1 to 2 m"),
        (("NAD 83(1986)", "NAD83(2011)"), (None, None), "realizations differ by centimeters"),
        (("GDA94", "GDA2020"), (None, None), "frames may differ"),
        (("NAD27", "NAD 83(2011)"), (None, None), "how far apart is not known"),
        (("NAD27", "ED50"), (None, None), "how far apart is not known"),
        (("ITRF2014", None), (None, None), "the frame of B is not stated"),
        ((None, "ETRS89"), (None, None), "the frame of A is not stated"),
        (("ITRF2014", "ITRF2014"), (2010.0, 2020.0), "10.0 years apart"),
        (("ITRF2014", "IGS14"), (2010.0, 2010.2), None),
        (("NAD 83(2011)", "NAD83 (2011)"), (2010.0, 2020.0), None),
        (("WGS84", "WGS 84"), (None, 2020.0), None),
        (("NAD27", "NAD 27"), (None, None), None),
        ((None, None), (None, None), None),
    ],
)
def test_different_frames_are_said_aloud_and_not_corrected(
    frames: tuple[str | None, str | None],
    epochs: tuple[float | None, float | None],
    said: str | None,
) -> None:
    a = mark(51.0, -114.0, frame=frames[0], epoch=epochs[0])
    b = away(a, 100.0, 50.0, frame=frames[1], epoch=epochs[1])
    found = azimuth_between(a, b)
    plain = azimuth_between(replace(a, frame=None), replace(b, frame=None))
    assert found.azimuth == plain.azimuth
    if said is None:
        assert found.warnings == ()
    else:
        (warning,) = found.warnings
        assert said in warning


def test_the_size_of_a_mismatch_is_that_over_the_line() -> None:
    a = mark(51.0, -114.0, frame="NAD 83(2011)")
    (warning,) = azimuth_between(a, away(a, 500.0, 0.0, frame="ITRF2014")).warnings
    assert "over 499.8 m up to 0.23°" in warning  # 2 m


# ---- grid --------------------------------------------------------------------------------------


def redfearn(lat: float, lon: float, meridian: float) -> float:
    """Convergence of transverse Mercator, Redfearn's series to the fifth power, rad."""
    dlon = math.remainder(lon - meridian, 2.0 * math.pi)
    e2 = 2.0 / 298.257223563 - 1.0 / 298.257223563**2
    psi = (1.0 - e2 * math.sin(lat) ** 2) / (1.0 - e2)  # transverse over meridian radius
    t, c, s = math.tan(lat), math.cos(lat), math.sin(lat)
    return s * (
        dlon
        + dlon**3 / 3.0 * c**2 * (2.0 * psi**2 - psi)
        + dlon**5
        / 15.0
        * c**4
        * (
            psi**4 * (11.0 - 24.0 * t**2)
            - psi**3 * (11.0 - 36.0 * t**2)
            + 2.0 * psi**2 * (1.0 - 7.0 * t**2)
            + psi * t**2
        )
    )


@pytest.mark.parametrize("lat", [-70.0, -33.0, 0.0, 10.0, 51.08, 75.0])
@pytest.mark.parametrize("off", [-3.0, -1.0, 0.0, 2.5])
def test_the_convergence_is_that_of_the_series(lat: float, off: float) -> None:
    grid = f"UTM 12{'S' if lat < 0 else 'N'}"
    found, _, warning = meridian_convergence(grid, lat * DEG, (-111.0 + off) * DEG)
    # 1e-9: the seventh power of 3 degrees
    assert found == pytest.approx(redfearn(lat * DEG, (-111 + off) * DEG, -111 * DEG), abs=1e-9)
    assert warning is None
    # west of the central meridian, in the north, grid north lies west of north
    assert math.copysign(1.0, found) == math.copysign(1.0, off * lat) or off * lat == 0.0


def test_a_published_convergence() -> None:
    """Flinders Peak in MGA zone 55, GDA94 Technical Manual: -1°35'03.65″, added to an azimuth."""
    lat, lon = -(37 + 57 / 60 + 3.72030 / 3600), 144 + 25 / 60 + 29.52440 / 3600
    turned = stated_azimuth(1.0, 1e-5, "grid", lat * DEG, lon * DEG, grid="EPSG:28355")
    published = -(1 + 35 / 60 + 3.65 / 3600) * DEG
    assert turned.azimuth == pytest.approx(1.0 - published, abs=0.006 * ARCSEC)
    assert "GDA94 / MGA zone 55" in turned.provenance
    assert turned.sigma == 1e-5


@pytest.mark.parametrize("grid", ["UTM 12", "utm 12n", "UTM zone 12N", "UTM12N", "EPSG:26912"])
def test_spellings_of_a_grid(grid: str) -> None:
    found, _, warning = meridian_convergence(grid, 51.08 * DEG, -113.5 * DEG)
    assert found == pytest.approx(redfearn(51.08 * DEG, -113.5 * DEG, -111 * DEG), abs=1e-9)
    assert warning is None


@pytest.mark.parametrize(
    ("grid", "said"),
    [
        ("12N", "is not understood"),
        ("UTM 61N", "no UTM zone"),
        ("UTM 12S", "is of the southern hemisphere"),
        ("UTM 12U", "is not understood"),
        ("EPSG:4326", "no map grid"),
        ("EPSG:99999", "cannot be used here"),
        ("EPSG:3031", "no map grid with east and north"),
    ],
)
def test_what_is_no_grid_is_refused(grid: str, said: str) -> None:
    with pytest.raises(SurveyError, match=said):
        meridian_convergence(grid, 51.08 * DEG, -114.13 * DEG)


@pytest.mark.parametrize(
    ("grid", "lon", "warned"),
    [
        ("UTM 12N", -114.13, False),  # Calgary, a little outside
        ("UTM 13N", -114.13, True),
        ("UTM 12N", 114.13, True),
        ("UTM 1N", -179.0, False),
        ("UTM 1N", 179.5, False),
        ("UTM 60N", -179.5, False),
        ("UTM 60N", -178.0, True),
    ],
)
def test_the_wrong_zone_is_suspected(grid: str, lon: float, warned: bool) -> None:
    _, _, warning = meridian_convergence(grid, 51.08 * DEG, lon * DEG)
    assert (warning is not None) is warned
    assert warning is None or "is it the right grid?" in warning


def test_kinds_of_azimuth_are_refused_without_what_turns_them() -> None:
    at = 51.08 * DEG, -114.13 * DEG
    with pytest.raises(SurveyError, match=r'give its grid, "UTM 12N"'):
        stated_azimuth(1.0, 1e-4, "grid", *at)
    with pytest.raises(SurveyError, match="give declination_deg and declination_sigma_deg"):
        stated_azimuth(1.0, 1e-4, "magnetic", *at)
    with pytest.raises(SurveyError, match="give declination_deg and declination_sigma_deg"):
        stated_azimuth(1.0, 1e-4, "magnetic", *at, declination=0.2)
    with pytest.raises(SurveyError, match=r"deflection_arcsec = \[xi, eta\]"):
        stated_azimuth(1.0, 1e-4, "astronomic", *at)


def test_a_magnetic_azimuth_is_turned_by_the_declination() -> None:
    """The needle points east of north by the declination, so the line is that much further on."""
    found = stated_azimuth(
        6.2, 3e-3, "magnetic", 0.9, -2.0, declination=0.25, declination_sigma=4e-3
    )
    assert found.azimuth == pytest.approx(6.45 - 2.0 * math.pi, abs=1e-14)
    assert found.sigma == pytest.approx(5e-3, rel=1e-12)


# ---- stars -------------------------------------------------------------------------------------


@pytest.mark.parametrize("lat", [-60.0, -20.0, 0.0, 35.0, 51.0, 70.0])
@pytest.mark.parametrize("zenith", [90.0, 85.0, 100.0])
@pytest.mark.parametrize("azimuth", [0.0, 77.0, 200.0, 310.0])
def test_laplace_is_the_turn_of_the_axes(lat: float, zenith: float, azimuth: float) -> None:
    """The same sight in axes of the plumb line and of the ellipsoid's normal."""
    xi, eta = 12.0 * ARCSEC, -20.0 * ARCSEC
    here = lat * DEG, 30.0 * DEG
    plumb = here[0] + xi, here[1] + eta / math.cos(here[0])
    north, east, up = local_axes(*plumb)
    A, z = azimuth * DEG, zenith * DEG
    line = math.sin(z) * (math.cos(A) * north + math.sin(A) * east) + math.cos(z) * up
    north, east, _ = local_axes(*here)
    truth = math.atan2(east @ line, north @ line)
    found = stated_azimuth(A, 1e-6, "astronomic", *here, deflection=(xi, eta), zenith=z)
    # second order of a deflection of 1.1e-4 rad, tan of 70 degrees
    assert turn(found.azimuth, truth) == pytest.approx(0.0, abs=1.1e-4**2 * 4.0)
    if zenith == 90.0:
        level = stated_azimuth(A, 1e-6, "astronomic", *here, deflection=(xi, eta))
        assert turn(level.azimuth, truth) == pytest.approx(0.0, abs=1.1e-4**2 * 4.0)


# ---- turned, carried, mounted ------------------------------------------------------------------


def test_a_theodolite_turns_clockwise_and_sigmas_add() -> None:
    found = KnownAzimuth(6.0, 3e-4, "line").turned(1.0, 4e-4)
    assert found.azimuth == pytest.approx(7.0 - 2.0 * math.pi, abs=1e-15)
    assert found.sigma == pytest.approx(5e-4, rel=1e-12)
    assert found.provenance == "line, turned +57.295780° ± 0.0229°"
    heading = found.heading
    assert (heading.heading, heading.sigma) == (found.azimuth, found.sigma)


@pytest.mark.parametrize(("lat", "lon", "north", "east"), LINES)
def test_a_direction_carried_along_a_geodesic_turns_as_the_geodesic(
    lat: float, lon: float, north: float, east: float
) -> None:
    a = mark(lat, lon)
    b = away(a, north, east)
    there = azimuth_between(a, b)
    back = azimuth_between(b, a).azimuth + math.pi
    carried = there.carried((a.lat, a.lon), (b.lat, b.lon))
    # 1e-9 rad over 10 km of what is neglected
    assert turn(carried.azimuth, back) == pytest.approx(0.0, abs=1e-9)
    assert carried.sigma == there.sigma
