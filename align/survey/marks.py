"""Marks: surveyed points with their frame and sigmas, and the way from a mark to the IMU."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from align.survey.errors import SurveyError
from earth.ellipsoid import WGS84, Ellipsoid
from earth.frames import NED_TO_ENU, C_en
from earth.geodetic import ecef_to_geodetic, geodetic_to_ecef

Array = NDArray[np.float64]
HeightKind = Literal["ellipsoidal", "orthometric"]

_DEEP, _HIGH = -12e3, 1e5  # m: below the deepest sea, above any mark


@dataclass(frozen=True)
class Mark:
    """A surveyed point.

    Attributes
    ----------
    name : str
    lat, lon : float
        Geodetic, rad.
    h : float or None
        Above the ellipsoid, m; None where the file does not give it.
    sigmas : tuple of 3 floats or None
        1-sigma north, east, up, m.
    frame : str or None
        Reference frame as written, such as ``NAD 83(2011)``.
    epoch : float or None
        Of the coordinates, decimal year.
    source : str
        File and line.
    aliases : tuple of str
        Other names it answers to.
    orthometric_h : float or None
        Above the geoid, m, where there is no `h`.
    unsaid_h : float or None
        A height, m, of which the file does not say above what.
    notes : tuple of str
        What has to be said where the mark is used.
    """

    name: str
    lat: float
    lon: float
    h: float | None
    sigmas: tuple[float, float, float] | None = None
    frame: str | None = None
    epoch: float | None = None
    source: str = ""
    aliases: tuple[str, ...] = ()
    orthometric_h: float | None = None
    unsaid_h: float | None = None
    notes: tuple[str, ...] = ()

    def height(self, geoid_height: float | None = None, kind: HeightKind | None = None) -> float:
        """Height above the ellipsoid, m.

        Parameters
        ----------
        geoid_height : float, optional
            Of the geoid above the ellipsoid at the mark, m; for a height above the geoid.
        kind : {"ellipsoidal", "orthometric"}, optional
            Of a height whose file does not say it.

        Raises
        ------
        SurveyError
            If the file gives none, does not say above what, or only one above the geoid and no
            `geoid_height` is given; or if what is given has nothing to belong to.
        """
        if self.unsaid_h is not None:
            if kind is None:
                raise SurveyError(
                    f"{self._where} has height {self.unsaid_h:g} m, but nothing says above what; "
                    'give height_kind = "ellipsoidal" or "orthometric"'
                )
            above_sea = self.unsaid_h if kind == "orthometric" else None
        elif kind is not None:
            raise SurveyError(f"{self._where} says itself above what its height is: no height_kind")
        else:
            above_sea = self.orthometric_h
        if above_sea is not None:
            if geoid_height is None:
                raise SurveyError(
                    f"{self._where} has only an orthometric height, {above_sea:g} m above sea "
                    "level; navigation needs the height above the ellipsoid, so add the geoid "
                    "height (undulation at the mark) as geoid_height_m"
                )
            return above_sea + geoid_height
        h = self.h if self.unsaid_h is None else self.unsaid_h
        if h is None:
            raise SurveyError(f"{self._where} has no height; give height_m")
        if geoid_height is not None:
            raise SurveyError(
                f"{self._where} has its height above the ellipsoid; geoid_height_m has nothing to "
                "belong to"
            )
        return h

    @property
    def _where(self) -> str:
        return f"mark {self.name} ({self.source})" if self.source else f"mark {self.name}"


def geodetic_from_xyz(xyz: ArrayLike, ellipsoid: Ellipsoid = WGS84) -> tuple[float, float, float]:
    """Latitude, longitude (rad) and ellipsoidal height (m) of Earth-fixed X, Y, Z (m).

    Raises
    ------
    SurveyError
        If the point is not near the Earth's surface.
    """
    r = np.asarray(xyz, float)
    lat, lon, h = (float(x) for x in ecef_to_geodetic(r, ellipsoid))
    if not _DEEP <= h <= _HIGH:
        raise SurveyError(
            f"X, Y, Z = {', '.join(f'{x:.10g}' for x in r)} is {np.linalg.norm(r) / 1e3:.6g} km "
            "from the Earth's center, not near its surface; they must be Earth-fixed, in meters"
        )
    return lat, lon, h


def ned_sigmas(sigmas_xyz: ArrayLike, lat: float, lon: float) -> tuple[float, float, float]:
    """Sigmas north, east, up of a point from those of X, Y, Z, m, taken as uncorrelated."""
    C = C_en(lat, lon)
    north, east, up = np.sqrt((C.T**2) @ np.square(np.asarray(sigmas_xyz, float)))
    return float(north), float(east), float(up)


def displaced(
    lat: float,
    lon: float,
    h: float,
    arm: ArrayLike,
    axes: Literal["NED", "ENU"] = "NED",
    ellipsoid: Ellipsoid = WGS84,
) -> tuple[float, float, float]:
    """The place at the far end of a lever arm, exact through Earth-fixed coordinates.

    Parameters
    ----------
    lat, lon, h : float
        Its near end, rad, rad, m.
    arm : array_like, shape (3,)
        m, in the local axes of the near end.
    axes : {"NED", "ENU"}
    ellipsoid : Ellipsoid

    Returns
    -------
    lat, lon, h : float
    """
    arm_n = np.asarray(arm, float)
    if axes == "ENU":
        arm_n = NED_TO_ENU.T @ arm_n
    r = geodetic_to_ecef(lat, lon, h, ellipsoid) + C_en(lat, lon) @ arm_n
    far_lat, far_lon, far_h = ecef_to_geodetic(r, ellipsoid)
    return float(far_lat), float(far_lon), float(far_h)


def choose(marks: Sequence[Mark], name: str) -> Mark:
    """The mark of that name or alias; upper and lower case are told apart only where both exist.

    Raises
    ------
    SurveyError
        If there is none, or more than one.
    """
    for same in (str, str.casefold):
        found = [
            mark for mark in marks if same(name) in {same(x) for x in (mark.name, *mark.aliases)}
        ]
        if len(found) == 1:
            return found[0]
        if found:
            which = "; ".join(
                f"{' or '.join(mark.aliases) or mark.name} ({mark.source})" for mark in found
            )
            raise SurveyError(f"{len(found)} marks are called {name}: {which}")
    names = [x for mark in marks for x in (mark.name, *mark.aliases)]
    (near,) = difflib.get_close_matches(name, names, n=1, cutoff=0.0)
    raise SurveyError(f"there is no mark {name}; the nearest name is {near}")
