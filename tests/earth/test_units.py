"""Factors into SI, against their definitions."""

import math

import pytest

from earth import units


@pytest.mark.parametrize(
    ("name", "count", "si"),
    [
        ("DEG", 180.0, math.pi),  # rad
        ("ARCMIN", 60.0 * 180.0, math.pi),  # rad
        ("ARCSEC", 3600.0 * 180.0, math.pi),  # rad
        ("HOUR", 24.0, 86400.0),  # s
        ("DEG_PER_S", 360.0, 2.0 * math.pi),  # rad/s
        ("DEG_PER_H", 15.0410669, 7.292115e-5),  # rad/s: the rotation of the Earth
        ("DEG_PER_RTH", 1.0, math.pi / 180.0 / math.sqrt(3600.0)),  # rad/sqrt(s)
        ("STANDARD_GRAVITY", 1.0, 9.80665),  # m/s^2
        ("UG", 1e6, 9.80665),  # m/s^2
        ("MG", 1e3, 9.80665),  # m/s^2
        ("UG_PER_RTHZ", 1e6, 9.80665),  # (m/s)/sqrt(s)
        ("MGAL", 978.03253359e3, 9.7803253359),  # m/s^2: gravity on the equator
        ("NMI", 60.0, 111120.0),  # m
        ("KMH", 3.6, 1.0),  # m/s
    ],
)
def test_factor(name: str, count: float, si: float) -> None:
    # Relative; the printed Earth rate ends at 5e-10, the rest is one rounding or two.
    tol = 4e-9 if name == "DEG_PER_H" else 1e-15
    assert count * getattr(units, name) == pytest.approx(si, rel=tol, abs=0.0)
