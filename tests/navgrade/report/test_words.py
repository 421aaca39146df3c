"""Numbers as people read them."""

from __future__ import annotations

import math

import pytest

from navgrade.report.words import clock, decades, place, readable, readable_time


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0, "m", "0"),
        (math.nan, "m", "—"),
        (3.21e-13, "m", "0.000321 nm"),
        (4.56e-9, "m", "4.56 nm"),
        (1.0e-6, "m", "1.00 µm"),
        (9.996e-4, "m", "1.00 mm"),  # rounding moves it to the next prefix
        (0.0182, "m", "18.2 mm"),
        (18.2088, "m", "18.2 m"),
        (999.6, "m", "1.00 km"),
        (123_456.0, "m", "123 km"),
        (3_933_100.0, "m", "3,930 km"),
        (2_500.0, "m/s", "2,500 m/s"),
        (3.0e-5, "m/s", "30.0 µm/s"),
        (7.56e-4, "rad", "756 µrad"),
        (math.pi / 180.0, "rad", "1.00°"),
        (1e-3, "rad", "0.0573°"),
    ],
)
def test_readable(value: float, unit: str, text: str) -> None:
    assert readable(value, unit) == text


@pytest.mark.parametrize(
    ("t", "text"),
    [
        (0.01, "0.01 s"),
        (14.0, "14 s"),
        (59.99, "60 s"),
        (60.0, "1 min"),
        (398.2, "6 min 38 s"),
        (3600.0, "1 h"),
        (7261.0, "2 h 1 min 1 s"),
    ],
)
def test_readable_time(t: float, text: str) -> None:
    assert readable_time(t) == text


def test_ticks() -> None:
    metres = decades("m")
    assert metres[1e-6] == "1 µm"
    assert metres[2e-3] == "2 mm"
    assert metres[500.0] == "500 m"
    assert metres[1e6] == "1,000 km"
    assert decades("m/s")[1e4] == "10,000 m/s"


def test_start() -> None:
    assert clock(1_717_243_200_999_999_999) == "2024-06-01 12:00:00 UTC"
    assert place(-0.5, -1.0, 3.04) == "28.647890° S, 57.295780° W, 3.0 m"
