"""What the means of a window at rest say against the data, the units, the axes or the site."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from align.errors import AlignmentError
from earth.ellipsoid import WGS84, Ellipsoid
from earth.rates import omega_ie_n
from earth.units import DEG

Array = NDArray[np.float64]

_DEGREES_IN_RADIAN = 1.0 / DEG
_LATITUDE_OFF = 10.0 * DEG  # between implied and surveyed latitude: a mistake, not a bias
_STEADY_TURN = 1.0 * DEG  # rad/s: with steady specific force, more than any gyro's bias
_SIGNIFICANT = 5.0  # sigmas: it refuses


@dataclass(frozen=True)
class Residuals:
    """Measured minus expected, of the means of a window at rest.

    Attributes
    ----------
    force : float
        ``|f| - g``, m/s^2.
    rate : float
        ``|omega| - omega_ie``, rad/s.
    down, north : float
        Rate about the plumb line and across it, rad/s.
    implied_latitude : float
        rad; not a number where nothing turns.
    """

    force: float
    rate: float
    down: float
    north: float
    implied_latitude: float

    @property
    def shown_rate(self) -> float:
        """Root mean square of the two rates that show, rad/s."""
        return float(np.hypot(self.down, self.north) / np.sqrt(2.0))


def residuals(
    omega_ib_b: Array, f_ib_b: Array, lat: float, g_n: Array, ellipsoid: Ellipsoid = WGS84
) -> Residuals:
    """Compare mean rate (rad/s) and specific force (m/s^2), shapes (3,), with the Earth's."""
    force = float(np.linalg.norm(f_ib_b))
    expected = np.asarray(omega_ie_n(lat, ellipsoid))
    up_n = -g_n / np.linalg.norm(g_n)
    up, level = _split(omega_ib_b, f_ib_b / force)
    up_expected, level_expected = _split(expected, up_n)
    return Residuals(
        force=force - float(np.linalg.norm(g_n)),
        rate=float(np.linalg.norm(omega_ib_b)) - ellipsoid.omega,
        down=up_expected - up,
        north=level - level_expected,
        implied_latitude=implied_latitude(omega_ib_b, f_ib_b),
    )


def _split(rate: Array, up: Array) -> tuple[float, float]:
    along = float(rate @ up)
    return along, float(np.linalg.norm(rate - along * up))


def implied_latitude(omega_ib_b: Array, f_ib_b: Array) -> float:
    """Angle of the rotation above the horizon, rad: the latitude of a body at rest.

    Not a number where nothing turns.
    """
    product = float(np.linalg.norm(omega_ib_b) * np.linalg.norm(f_ib_b))
    if product == 0.0:
        return float("nan")
    return float(np.arcsin(np.clip(omega_ib_b @ f_ib_b / product, -1.0, 1.0)))


def check_units_at_rest(
    omega_ib_b: Array, f_ib_b: Array, lat: float, ellipsoid: Ellipsoid = WGS84
) -> None:
    """Refuse mean rates that only a wrong unit or a processed stream explains.

    Parameters
    ----------
    omega_ib_b, f_ib_b : ndarray, shape (3,)
        Means over a stretch at rest, rad/s and m/s^2.
    lat : float
        Geodetic latitude, rad.
    ellipsoid : Ellipsoid

    Raises
    ------
    AlignmentError
    """
    check_force(f_ib_b)
    check_rate(omega_ib_b, f_ib_b, lat, ellipsoid)


def check_force(f_ib_b: Array) -> None:
    """Refuse a mean specific force that is not gravity's."""
    force = float(np.linalg.norm(f_ib_b))
    if force < 0.5:
        raise AlignmentError(
            f"specific force at rest is {force:.4f} m/s², not 9.8: gravity has been removed from "
            "this stream, and without it nothing can be leveled or navigated; log the raw IMU "
            "topic instead"
        )
    if 0.8 < force < 1.2:
        raise AlignmentError(
            f"specific force at rest is {force:.4f}, not 9.8 m/s²: it is in g; set "
            'imu.accel_unit = "g" in the site file'
        )
    if not 9.0 < force < 10.6:
        raise AlignmentError(
            f"specific force at rest is {force:.4f} m/s², not 9.8: the body accelerates, or the "
            "unit or the kind (increments declared as rates?) is wrong"
        )


def check_rate(omega_ib_b: Array, f_ib_b: Array, lat: float, ellipsoid: Ellipsoid = WGS84) -> None:
    """Refuse a mean rate, under steady specific force, that is in degrees."""
    rate = float(np.linalg.norm(omega_ib_b))
    turns = rate / ellipsoid.omega
    implied = implied_latitude(omega_ib_b, f_ib_b)
    is_earth_rate = abs(turns / _DEGREES_IN_RADIAN - 1.0) < 0.1 and abs(implied - lat) < 10.0 * DEG
    if is_earth_rate or rate > _STEADY_TURN:
        otherwise = "" if is_earth_rate else ", unless the body turns about the vertical: not still"
        raise AlignmentError(
            f"the gyros read {rate:.5f} rad/s, {turns:.1f} times the Earth rate, while the "
            'specific force stays put: they are in degrees; set imu.gyro_unit = "deg/s" in the '
            f"site file{otherwise}"
        )


def latitude_contradiction(
    shown: Residuals,
    rate_sigma: float | None,
    lat: float,
    lon: float | None,
    ellipsoid: Ellipsoid = WGS84,
) -> str:
    """Name the likely cause where gyros feel the Earth turn as at another latitude, else "".

    Parameters
    ----------
    shown : Residuals
    rate_sigma : float or None
        Stated 1-sigma of a mean rate, rad/s; None where no bias is stated.
    lat, lon : float
        Of the site, rad; `lon` None where it is not known.
    ellipsoid : Ellipsoid
    """
    implied = shown.implied_latitude
    if rate_sigma is None:  # then a rate that fits the Earth's is no coincidence
        limit = _LATITUDE_OFF if abs(shown.rate) < 0.05 * ellipsoid.omega else np.pi
    else:
        limit = max(_LATITUDE_OFF, _SIGNIFICANT * rate_sigma / ellipsoid.omega)
    if not abs(implied - lat) > limit:
        return ""
    near = min(limit, _LATITUDE_OFF)
    causes = []
    if abs(implied + lat) < near:
        causes.append(
            "the hemisphere of site.latitude is wrong, or gyros and accelerometers disagree on the "
            "sign of an axis (z of one of them upside down)"
        )
    if lon is not None and abs(implied - lon) < near:
        causes.append("latitude and longitude are swapped")
    cause = (
        ", or ".join(causes)
        if causes
        else "a wrong hemisphere, latitude and longitude swapped, or axes of the gyros that are "
        "not those of the accelerometers"
    )
    return (
        f"the gyros feel the Earth turn, but as at latitude {implied / DEG:.1f}°, the site says "
        f"{lat / DEG:.1f}°: likely {cause}; check site.latitude and imu.axes"
    )
