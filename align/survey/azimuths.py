"""Azimuths of surveyed lines: from marks, from a grid, a compass or the stars; and the heading."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np

from align.static import KnownHeading
from align.survey.datums import line_warning
from align.survey.errors import SurveyError
from align.survey.marks import Mark
from earth.ellipsoid import WGS84, Ellipsoid
from earth.units import ARCSEC, DEG

AzimuthKind = Literal["geodetic", "grid", "astronomic", "magnetic"]
KINDS: tuple[AzimuthKind, ...] = get_args(AzimuthKind)

MAX_SIGMA = 0.1  # rad: beyond ten sigmas of position in a line it has no direction to speak of
_LONGEST = 200e3  # m, of a line anybody sights along
_MARGIN = 1.0 * DEG  # outside a grid's area of use
_UTM = re.compile(r"UTM\s*(?:zone)?\s*(?P<zone>\d{1,2})\s*(?P<half>[NS]?)", re.IGNORECASE)
_EPSG = re.compile(r"EPSG:\d+", re.IGNORECASE)


@dataclass(frozen=True)
class KnownAzimuth:
    """Direction of a line, clockwise from geodetic north.

    Attributes
    ----------
    azimuth : float
        rad, in [0, 2 pi).
    sigma : float
        1-sigma, rad.
    provenance : str
        How it came about.
    warnings : tuple of str
    """

    azimuth: float
    sigma: float
    provenance: str
    warnings: tuple[str, ...] = ()

    def turned(self, angle: float, sigma: float = 0.0, what: str = "turned") -> KnownAzimuth:
        """The direction `angle` (rad) clockwise from this one, as a theodolite reads it."""
        return replace(
            self,
            azimuth=_compass(self.azimuth + angle),
            sigma=float(np.hypot(self.sigma, sigma)),
            provenance=f"{self.provenance}, {what} {_signed(angle)}"
            + (f" ± {_small(sigma)}" if sigma else ""),
        )

    def carried(
        self, here: tuple[float, float], there: tuple[float, float], what: str = "to the IMU"
    ) -> KnownAzimuth:
        """The same direction as an azimuth at another place, by convergence of the meridians.

        Parameters
        ----------
        here, there : tuple of float
            Latitude and longitude, rad, where it holds and where it is wanted.
        what : str
            Of the provenance.

        Notes
        -----
        Parallel transport: the longitude difference times the sine of the mean latitude. Accuracy
        over distance s: s^2/R^2/12 of the turn, 1e-9 rad over 10 km at latitude 60.
        """
        lon = (there[1] - here[1] + np.pi) % (2.0 * np.pi) - np.pi
        turn = float(lon * np.sin(0.5 * (here[0] + there[0])))
        if turn == 0.0:
            return self
        return self.turned(turn, what=f"carried {what} by convergence of the meridians")

    @property
    def heading(self) -> KnownHeading:
        """Of an IMU whose x axis points this way."""
        return KnownHeading(self.azimuth, self.sigma)


def azimuth_between(
    start: Mark, end: Mark, *, sigma: float | None = None, ellipsoid: Ellipsoid = WGS84
) -> KnownAzimuth:
    """Azimuth of the geodesic from one mark to another, at the first.

    Parameters
    ----------
    start, end : Mark
    sigma : float, optional
        1-sigma of the azimuth, rad, in place of what follows from the marks' sigmas: marks surveyed
        together lie better to each other than to the frame.
    ellipsoid : Ellipsoid

    Returns
    -------
    KnownAzimuth
        Its sigma is that of the two positions across the line over its length; correlation between
        the marks is not known and not used. The line of sight differs from the geodesic by
        0.6 µrad per km of the target's height, at most, and 2 nrad over 10 km; both are neglected.

    Raises
    ------
    SurveyError
        If the marks are closer together than their sigmas allow, or no sigma is known.
    """
    from pyproj import Geod

    geod = Geod(a=ellipsoid.a, f=ellipsoid.f)
    azimuth, _, distance = geod.inv(start.lon, start.lat, end.lon, end.lat, radians=True)
    line = f"{start.name} to {end.name}"
    if distance < 1e-4:  # m, what marks are given to
        raise SurveyError(f"the line {line} has no direction: both marks are at the same place")
    if distance > _LONGEST:
        raise SurveyError(
            f"the line {line} is {distance / 1e3:.0f} km long; are latitude and longitude of one "
            "mark swapped?"
        )
    if sigma is None:
        across = [
            float(np.hypot(mark.sigmas[0] * np.sin(azimuth), mark.sigmas[1] * np.cos(azimuth)))
            for mark in (start, end)
            if mark.sigmas is not None
        ]
        if len(across) < 2:
            silent = start if start.sigmas is None else end
            raise SurveyError(
                f"the azimuth {line} has no sigma, because mark {silent.name} ({silent.source}) "
                "has none; give the azimuth's sigma_deg or sigma_arcsec"
            )
        off = float(np.hypot(across[0], across[1]))
        sigma = off / distance
        if sigma > MAX_SIGMA:
            raise SurveyError(
                f"the marks of the line {line} are {distance:.4g} m apart with a sigma of "
                f"{off:.2g} m across it, so the azimuth would have a sigma of "
                f"{_small(min(sigma, np.pi))}; take marks {off / MAX_SIGMA:.2g} m apart at least, "
                f"{off / (0.1 * DEG):.2g} m for 0.1°, or give the azimuth's sigma_deg"
            )
    warning = line_warning(
        (start.name, end.name), (start.frame, end.frame), (start.epoch, end.epoch), distance
    )
    return _known(
        azimuth,
        sigma,
        f"azimuth {line} {_compass(azimuth) / DEG:.6f}° ± {_small(sigma)} "
        f"(geodesic, {distance:.3f} m)",
        *([warning] if warning else []),
        *(f"{mark.name}: {note}" for mark in (start, end) for note in mark.notes),
    )


def meridian_convergence(grid: str, lat: float, lon: float) -> tuple[float, str, str | None]:
    """Angle from geodetic to grid north, clockwise, at a place (rad).

    Parameters
    ----------
    grid : str
        ``UTM 12N`` or the code of a projected reference system, ``EPSG:26912``.
    lat, lon : float

    Returns
    -------
    convergence : float
        rad; the geodetic azimuth is the grid azimuth plus this.
    name : str
        The grid's own.
    warning : str or None
        Where the place lies outside the grid's area of use.

    Raises
    ------
    SurveyError
        If the grid is not known, or is none whose axes point east and north.
    """
    from pyproj import CRS, Proj
    from pyproj.exceptions import CRSError, ProjError

    text = grid.strip()
    if utm := _UTM.fullmatch(text):
        zone, south = int(utm["zone"]), utm["half"].upper() == "S"
        if not 1 <= zone <= 60:
            raise SurveyError(f"grid {grid!r} is no UTM zone, 1 to 60")
        if utm["half"] and south != (lat < 0.0):
            raise SurveyError(
                f"grid {grid!r} is of the {'southern' if south else 'northern'} hemisphere, the "
                f"place is at latitude {lat / DEG:.4f}; the letter is N or S, no MGRS band"
            )
        code = f"EPSG:{(32700 if lat < 0.0 else 32600) + zone}"
    elif _EPSG.fullmatch(text):
        code = text
    else:
        raise SurveyError(f'grid {grid!r} is not understood; write "UTM 12N" or "EPSG:26912"')
    try:
        crs = CRS(code)
        axes = sorted(axis.direction for axis in crs.axis_info[:2])
        if not crs.is_projected or axes != ["east", "north"]:
            raise SurveyError(f"grid {grid!r} ({crs.name}) is no map grid with east and north axes")
        turn = Proj(crs).get_factors(lon, lat, radians=True, errcheck=True).meridian_convergence
    except (CRSError, ProjError) as error:
        raise SurveyError(f"grid {grid!r} cannot be used here: {error}") from None
    area, warning = crs.area_of_use, None
    if area is not None:
        off = (lon - area.west * DEG) % (2.0 * np.pi)
        width = ((area.east - area.west) % 360.0) * DEG or 2.0 * np.pi
        outside = min(off - width, 2.0 * np.pi - off)
        below, above = area.south * DEG - lat, lat - area.north * DEG
        if max(outside, below, above) > _MARGIN:
            warning = (
                f"the place, {lat / DEG:.4f}, {lon / DEG:.4f}, is outside the area of {crs.name} "
                f"({area.name}): is it the right grid?"
            )
    return float(turn) * DEG, str(crs.name), warning


def stated_azimuth(
    azimuth: float,
    sigma: float,
    kind: AzimuthKind,
    lat: float,
    lon: float,
    *,
    grid: str | None = None,
    declination: float | None = None,
    declination_sigma: float | None = None,
    deflection: Sequence[float] | None = None,
    zenith: float | None = None,
) -> KnownAzimuth:
    """The geodetic azimuth of a line from one of another kind, at a place.

    Parameters
    ----------
    azimuth, sigma : float
        rad, clockwise from the north of its kind.
    kind : {"geodetic", "grid", "astronomic", "magnetic"}
    lat, lon : float
        Where the line begins, rad.
    grid : str, optional
        Of a grid azimuth; see `meridian_convergence`. The arc-to-chord correction is neglected:
        3 µrad per km of line at 250 km from the central meridian.
    declination, declination_sigma : float, optional
        Of a magnetic azimuth, rad, east of north.
    deflection : sequence of 2 floats, optional
        Of an astronomic azimuth: deflection of the vertical xi, eta, rad; the astronomic zenith
        lies north and east of the ellipsoid's normal by them.
    zenith : float, optional
        Zenith angle of the target of an astronomic azimuth, rad; horizontal by default.

    Returns
    -------
    KnownAzimuth

    Raises
    ------
    SurveyError
        If what the conversion needs is not given.

    Notes
    -----
    Astronomic: Laplace's equation in full, Heiskanen & Moritz (5-13) and Vanicek & Krakiwsky,
    ``A = A_astro - eta tan(lat) - (xi sin A - eta cos A) cot z``.
    """
    stated = f"{kind} azimuth {_compass(azimuth) / DEG:.6f}° ± {_small(sigma)}"
    if kind == "grid":
        if grid is None:
            raise SurveyError(
                "a grid azimuth is turned from north by the convergence of the meridians; give its "
                'grid, "UTM 12N" or "EPSG:26912"'
            )
        turn, name, warning = meridian_convergence(grid, lat, lon)
        how = f"{stated}, convergence {_signed(turn)} of {name}"
        return _known(azimuth + turn, sigma, how, *([warning] if warning else []))
    if kind == "magnetic":
        if declination is None or declination_sigma is None:
            raise SurveyError(
                "a magnetic azimuth is turned from north by the declination, which changes with "
                "place and year; give declination_deg and declination_sigma_deg (models are good "
                "to about 0.4°, near iron to nothing)"
            )
        how = f"{stated}, declination {_signed(declination)} ± {_small(declination_sigma)}"
        return _known(azimuth + declination, float(np.hypot(sigma, declination_sigma)), how)
    if kind == "astronomic":
        if deflection is None:
            raise SurveyError(
                "an astronomic azimuth refers to the plumb line; give the deflection of the "
                "vertical, deflection_arcsec = [xi, eta], for Laplace's equation"
            )
        xi, eta = deflection
        turn = -eta * np.tan(lat)
        if zenith is not None:
            turn -= (xi * np.sin(azimuth) - eta * np.cos(azimuth)) / np.tan(zenith)
        how = (
            f"{stated}, Laplace correction {turn / ARCSEC:+.2f}″ of deflection "
            f"{xi / ARCSEC:+.2f}″, {eta / ARCSEC:+.2f}″"
        )
        return _known(azimuth + float(turn), sigma, how)
    return _known(azimuth, sigma, stated)


def _known(azimuth: float, sigma: float, provenance: str, *warnings: str) -> KnownAzimuth:
    return KnownAzimuth(_compass(azimuth), float(sigma), provenance, warnings)


def _compass(azimuth: float) -> float:
    """The same direction in [0, 2 pi)."""
    wrapped = float(azimuth % (2.0 * np.pi))
    return 0.0 if wrapped == 2.0 * np.pi else wrapped


def _signed(turn: float) -> str:
    return f"{turn / DEG:+.6f}°"


def _small(sigma: float) -> str:
    """A sigma in the unit it reads well in."""
    return f"{sigma / DEG:.3g}°" if sigma >= 0.01 * DEG else f"{sigma / ARCSEC:.3g}″"
