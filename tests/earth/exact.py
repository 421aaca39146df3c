"""The ellipsoid in 50 digits, from the meridian ellipse alone: no radius formula enters.

A point of the ellipse is (a cos beta, b sin beta), its normal has the geodetic latitude; the radii
of curvature are the arc length per latitude and the distance to the axis along the normal.
"""

from dataclasses import dataclass

from mpmath import mp, mpf

from tests.oracles import constants

DIGITS = 50


@dataclass(frozen=True)
class ExactEllipsoid:
    """Defining constants as decimal text."""

    a: str
    inverse_f: str
    GM: str
    omega: str


WGS84 = ExactEllipsoid(
    a=constants.EQUATORIAL_RADIUS_TEXT,
    inverse_f=constants.INVERSE_FLATTENING_TEXT,
    GM=constants.GM_TEXT,
    omega=constants.OMEGA_TEXT,
)
# Moritz (2000), table 1 and the derived reciprocal flattening
GRS80 = ExactEllipsoid(
    a="6378137", inverse_f="298.257222100882711", GM="3986005e8", omega="7292115e-11"
)
# Flatter, smaller and faster than any planet a vehicle drives on: terms the Earth hides stand out
FLAT = ExactEllipsoid(a="3396190", inverse_f="50", GM="4.2828e13", omega="2.5e-4")


def meridian_point(lat: mpf, h: mpf, ell: ExactEllipsoid = WGS84) -> tuple[mpf, mpf]:
    """Distance from the axis and above the equator, m."""
    a = mpf(ell.a)
    ratio = 1 - 1 / mpf(ell.inverse_f)
    beta = mp.atan2(ratio * mp.sin(lat), mp.cos(lat))
    return a * mp.cos(beta) + h * mp.cos(lat), a * ratio * mp.sin(beta) + h * mp.sin(lat)


def ecef(
    lat: float | mpf, lon: float | mpf, h: float | mpf, ell: ExactEllipsoid = WGS84
) -> tuple[mpf, mpf, mpf]:
    """Earth-fixed coordinates, m."""
    with mp.workdps(DIGITS):
        lat, lon, h = mpf(lat), mpf(lon), mpf(h)
        rho, z = meridian_point(lat, h, ell)
        return rho * mp.cos(lon), rho * mp.sin(lon), z


def radii(lat: float, ell: ExactEllipsoid = WGS84) -> tuple[mpf, mpf]:
    """Meridian and transverse radius of curvature, m."""
    with mp.workdps(DIGITS):
        lat = mpf(lat)
        slope = [mp.diff(lambda x, i=i: meridian_point(x, mpf(0), ell)[i], lat) for i in (0, 1)]
        return mp.hypot(*slope), meridian_point(lat, mpf(0), ell)[0] / mp.cos(lat)


def C_en(lat: mpf, lon: mpf) -> mp.matrix:
    """North, east and down at a place, as columns in Earth-fixed axes."""
    up = [mp.cos(lat) * mp.cos(lon), mp.cos(lat) * mp.sin(lon), mp.sin(lat)]
    east = [-mp.sin(lon), mp.cos(lon), mpf(0)]
    north = [
        up[(i + 1) % 3] * east[(i + 2) % 3] - up[(i + 2) % 3] * east[(i + 1) % 3] for i in range(3)
    ]
    return mp.matrix([[north[i], east[i], -up[i]] for i in range(3)])
