"""Angles as surveyors write them."""

import math

import pytest

from align.survey import parse_angle, parse_latitude, parse_longitude, parse_turn
from tests.align.at_rest import DEG

LAT, LON = ("N", "S"), ("E", "W")
TOL = 1e-15  # rad, two roundings of an angle of 2 rad; 6 nm on the ground
# Calgary and Sydney, from the digits of each text alone
NORTH = (51.0 + 4.0 / 60.0 + 47.8327 / 3600.0) * math.pi / 180.0  # rad
SOUTH = -(33.0 + 51.0 / 60.0 + 54.5 / 3600.0) * math.pi / 180.0  # rad


@pytest.mark.parametrize(
    "text",
    [
        "51 04 47.8327",
        "51 04 47.8327 N",
        "  51 4  47.8327N ",
        "N51 04 47.8327",
        "n 51 04 47.8327",
        "+51 04 47.8327",
        "51°04'47.8327\"N",
        "51° 04' 47.8327\" N",
        "51°04′47.8327″N",
        "51° 4' 47.8327'' N",
        "51:04:47.8327",
        "51:04:47.8327 n",
        "51d04m47.8327sN",
        "51D04M47.8327S N",
    ],
)
def test_every_spelling_of_a_northern_latitude(text: str) -> None:
    assert parse_angle(text, *LAT) == pytest.approx(NORTH, rel=0.0, abs=TOL)


@pytest.mark.parametrize(
    "text",
    [
        "-33 51 54.5",
        "- 33 51 54.5",
        "-33:51:54.5",
        "-33°51'54.5\"",
        "S33 51 54.5",
        "s 33 51 54.5",
        "33 51 54.5 S",
        "33 51 54.5S",
        "33:51:54.5S",
        "33°51'54.5\"S",
        "33° 51' 54.5'' S",
        "33d51m54.5sS",
        "33d51m54.5S",
    ],
)
def test_every_spelling_of_a_southern_latitude(text: str) -> None:
    """The letter S after seconds is the hemisphere: Sydney is not in Japan."""
    assert parse_angle(text, *LAT) == pytest.approx(SOUTH, rel=0.0, abs=TOL)


@pytest.mark.parametrize(
    ("value", "letters", "degrees"),
    [
        (51.07995352, LAT, 51.07995352),
        (-114.13371127, LON, -114.13371127),
        (-7, LAT, -7.0),
        (0, LAT, 0.0),
        ("51.07995", LAT, 51.07995),
        ("-.5", LAT, -0.5),
        ("N51.0799", LAT, 51.0799),
        ("33.85 S", LAT, -33.85),
        ("33 51 S", LAT, -33.85),
        ("33 51.5' S", LAT, -(33.0 + 51.5 / 60.0)),
        ("-0 30", LAT, -0.5),
        ("-0 00 36", LAT, -0.01),
        ("-00:30:00", LAT, -0.5),
        ("0 30 S", LAT, -0.5),
        ("114 08 01.37 W", LON, -(114.0 + 8.0 / 60.0 + 1.37 / 3600.0)),
        ("w114.5", LON, -114.5),
        ("-114:08:01.37", LON, -(114.0 + 8.0 / 60.0 + 1.37 / 3600.0)),
        ("151 15 00 E", LON, 151.25),
        ("E 179 59 59.9999", LON, 179.0 + 59.0 / 60.0 + 59.9999 / 3600.0),
        ("12 59 59.9999", LAT, 12.0 + 59.0 / 60.0 + 59.9999 / 3600.0),
    ],
)
def test_other_spellings(value: float | str, letters: tuple[str, str], degrees: float) -> None:
    assert parse_angle(value, *letters) == pytest.approx(degrees * DEG, rel=0.0, abs=TOL)


@pytest.mark.parametrize(
    ("value", "letters", "reason"),
    [
        ("", LAT, "is not an angle"),
        ("N", LAT, "is not an angle"),
        ("north", LAT, "is not an angle"),
        ("51,5", LAT, "is not an angle"),
        ("1e2", LAT, "is not an angle"),
        ("51 04 47 8", LAT, "is not an angle"),
        ("51.07.59", LAT, "is not an angle"),
        ("51 -4 10", LAT, "is not an angle"),
        ("--51", LAT, "is not an angle"),
        ("nan", LAT, "is not an angle"),
        (None, LAT, "is not an angle"),
        (True, LAT, "is not an angle"),
        ([51.0], LAT, "is not an angle"),
        ("51 60 00 N", LAT, "has minutes or seconds of 60 or more"),
        ("51 59 60 N", LAT, "has minutes or seconds of 60 or more"),
        ("51 75", LAT, "has minutes or seconds of 60 or more"),
        ("-33 51 54 N", LAT, "gives its sign twice"),
        ("-33.5 S", LAT, "gives its sign twice"),
        ("+33.5 S", LAT, "gives its sign twice"),
        ("S 33.5 S", LAT, "gives its sign twice"),
        ("N 33.5 S", LAT, "gives its sign twice"),
        ("51 04 47 E", LAT, "ends in E, expected N or S"),
        ("114 08 01 N", LON, "ends in N, expected E or W"),
        ("W 51", LAT, "ends in W, expected N or S"),
        ("33D51M54.5S", LAT, "may mean seconds or south"),
        ("51.5 30 N", LAT, "has decimals before its last part"),
        ("51 4.5 30 N", LAT, "has decimals before its last part"),
    ],
)
def test_what_is_not_one_angle_is_refused_with_the_reason(
    value: object, letters: tuple[str, str], reason: str
) -> None:
    with pytest.raises(ValueError) as refusal:
        parse_angle(value, *letters)  # type: ignore[arg-type]  # wrong types on purpose
    assert reason in str(refusal.value)
    assert repr(value) in str(refusal.value)


@pytest.mark.parametrize(
    ("value", "degrees"),
    [
        (123.4567, 123.4567),
        (-0.5, -0.5),
        (360, 360.0),
        ("123 27 24.1", 123.0 + 27.0 / 60.0 + 24.1 / 3600.0),
        ("-0:30", -0.5),
        ("201°30'", 201.5),
        ("10d20m30s", 10.0 + 20.0 / 60.0 + 30.0 / 3600.0),
    ],
)
def test_turns_are_clockwise_degrees(value: float | str, degrees: float) -> None:
    assert parse_turn(value) == pytest.approx(degrees * DEG, rel=1e-15)


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ("N 45 30 00 E", "has letters; write degrees clockwise from north"),
        ("45 E", "has letters; write degrees clockwise from north"),
        (361.0, "must be within ±360 degrees, got 361.0"),
        (math.nan, "must be within ±360 degrees"),
        ("north", "has letters"),
        ("51,5", "is not an angle"),
        (True, "is not an angle"),
    ],
)
def test_what_is_no_turn_is_refused(value: float | str, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        parse_turn(value)


def test_places_off_the_globe_are_refused() -> None:
    assert parse_latitude("90 S") == pytest.approx(-math.pi / 2.0, abs=TOL)
    assert parse_longitude(-359.5) == pytest.approx(-359.5 * DEG, abs=2 * TOL)
    with pytest.raises(ValueError, match=r"within ±90 degrees, got -114\.1; are .* swapped\?"):
        parse_latitude(-114.1)
    with pytest.raises(ValueError, match=r"ends in W, expected N or S; are .* swapped\?"):
        parse_latitude("114 08 W")
    with pytest.raises(ValueError, match=r"within ±90 degrees, got nan$"):
        parse_latitude(math.nan)
    with pytest.raises(ValueError, match=r"within ±360 degrees, got 361"):
        parse_longitude(361)
