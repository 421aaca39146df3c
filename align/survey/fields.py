"""One mark from named values, as tables and GeoJSON properties hold them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from typing import Any

from align.survey.angles import parse_latitude, parse_longitude
from align.survey.errors import SurveyError
from align.survey.marks import Mark, geodetic_from_xyz, ned_sigmas

_SPELLINGS = {
    "name": ("name", "mark", "mark_name", "point", "point_id", "station", "id", "designation"),
    "latitude": ("latitude", "lat", "phi", "φ"),
    "longitude": ("longitude", "lon", "long", "lng", "lambda", "λ"),
    "height": ("height", "ellipsoidal_height", "ellipsoid_height", "ellip_ht", "h", "h_ell"),
    "orthometric_height": ("orthometric_height", "ortho_height", "ortho_ht", "h_ortho"),
    "geoid_height": ("geoid_height", "geoid_undulation", "undulation"),
    "unsaid_height": ("elevation", "elev", "altitude", "alt"),
    "height_kind": ("height_kind",),
    "x": ("x", "ecef_x"),
    "y": ("y", "ecef_y"),
    "z": ("z", "ecef_z"),
    "sigma": ("sigma", "sd", "std"),
    "sigma_n": ("sigma_n", "sigma_north", "sigma_lat", "sigma_latitude", "sd_n", "std_n"),
    "sigma_e": ("sigma_e", "sigma_east", "sigma_lon", "sigma_longitude", "sd_e", "std_e"),
    "sigma_u": ("sigma_u", "sigma_up", "sigma_h", "sigma_height", "sd_u", "sd_h", "std_u"),
    "sigma_x": ("sigma_x", "sd_x", "std_x"),
    "sigma_y": ("sigma_y", "sd_y", "std_y"),
    "sigma_z": ("sigma_z", "sd_z", "std_z"),
    "datum": ("datum", "frame", "reference_frame"),
    "epoch": ("epoch", "reference_epoch"),
}
_FIELD = {spelling: name for name, spellings in _SPELLINGS.items() for spelling in spellings}
_TEXTS = ("name", "datum", "epoch", "height_kind")
_ANGLES = ("latitude", "longitude")
_GRID = ("easting", "northing", "utm_e", "utm_n")
_METERS = {"m": 1.0, "meters": 1.0, "metres": 1.0, "cm": 1e-2, "mm": 1e-3}
_DEGREES = ("deg", "degrees", "°", "dms", "dd")
_WITH_UNIT = re.compile(
    r"(?P<base>.*?)(?:\s*[(\[]\s*(?P<boxed>[^)\]]*?)\s*[)\]]"
    r"|_(?P<tail>m|cm|mm|km|ft|usft|deg|rad|dms|dd))?"
)
_AGREE = 0.01  # m, between X, Y, Z and latitude, longitude, height of one mark


@dataclass(frozen=True)
class Field:
    """What a column holds, and the factor that takes its numbers to meters."""

    name: str
    unit: float = 1.0


def known_field(header: str) -> Field | None:
    """What a column of that header holds; None where it is nothing of a mark.

    Raises
    ------
    ValueError
        If it is in a unit that is not read.
    """
    match = _WITH_UNIT.fullmatch(header.strip())
    if match is None:
        return None
    base = match["base"].strip()
    name = _FIELD.get(re.sub(r"[\s.\-]+", "_", base.lower()))
    if base == "H":  # geodesy's letter for the height above the geoid, and anybody's for a height
        name = "unsaid_height"
    if name is None:
        return None
    unit = match["boxed"] or match["tail"]
    if name in _TEXTS or unit is None:
        return Field(name)
    unit = unit.lower()
    if name in _ANGLES:
        if unit not in _DEGREES:
            raise ValueError(f"column {header!r} is in {unit}; give degrees")
        return Field(name)
    if unit not in _METERS:
        raise ValueError(f"column {header!r} is in {unit}; give meters")
    return Field(name, _METERS[unit])


def grid_header(header: str) -> bool:
    return re.sub(r"[\s.\-]+", "_", header.strip().lower()).startswith(_GRID)


def mark_from(
    values: Mapping[str, Any], file: str, line: int | None = None, frame: str | None = None
) -> Mark:
    """A mark from values by field name; empty ones left out, lengths in meters.

    Parameters
    ----------
    values : mapping
        By the names `known_field` gives.
    file : str
    line : int, optional
        Both for messages.
    frame : str, optional
        Of a mark that does not name its datum.

    Raises
    ------
    SurveyError
    """

    def wrong(text: str) -> SurveyError:
        return SurveyError(text, file=file, line=line)

    def number(key: str) -> float | None:
        value = values.get(key)
        if value is None:
            return None
        try:
            result = float("nan") if isinstance(value, bool) else float(value)
        except (TypeError, ValueError):
            result = float("nan")
        if not math.isfinite(result):
            raise wrong(f"{key} {value!r} is not a number")
        return result

    def triple(x: str, y: str, z: str) -> tuple[float, float, float] | None:
        found = [number(key) for key in (x, y, z)]
        if all(value is None for value in found):
            return None
        a, b, c = found
        if a is None or b is None or c is None:
            raise wrong(f"{x}, {y} and {z} go together")
        return a, b, c

    name = str(values.get("name", "")).strip()
    if not name:
        raise wrong("the mark has no name")
    h, above_sea, unsaid = (number(k) for k in ("height", "orthometric_height", "unsaid_height"))
    if h is not None or above_sea is not None:
        unsaid = None
    kind = values.get("height_kind")
    if kind not in (None, "ellipsoidal", "orthometric"):
        raise wrong(f"height_kind {kind!r} is not one of ellipsoidal, orthometric")
    if kind is not None and unsaid is not None:
        h, above_sea = (unsaid, None) if kind == "ellipsoidal" else (None, unsaid)
        unsaid = None
    geoid = number("geoid_height")
    if h is None and above_sea is not None and geoid is not None:
        h, above_sea = above_sea + geoid, None
    xyz = triple("x", "y", "z")
    if "latitude" in values or "longitude" in values:
        angles = []
        for key, parse in (("latitude", parse_latitude), ("longitude", parse_longitude)):
            if key not in values:
                raise wrong(f"{key} is missing")
            try:
                angles.append(parse(values[key]))
            except ValueError as error:
                raise wrong(f"{key} {error}") from None
        lat, lon = angles
    elif xyz is None:
        raise wrong("the mark has no position: give latitude and longitude, or x, y and z")
    if xyz is not None:
        try:
            at = geodetic_from_xyz(xyz)
        except SurveyError as error:
            raise wrong(str(error)) from None
        if "latitude" in values:
            north, east = 6.4e6 * (lat - at[0]), 6.4e6 * math.remainder(lon - at[1], 2 * math.pi)
            off = math.hypot(north, east * math.cos(lat), 0.0 if h is None else h - at[2])
            if off > _AGREE:
                raise wrong(f"x, y, z and latitude, longitude, height are {off:.3g} m apart")
        lat, lon, h = at
        above_sea = unsaid = None
    sigmas = triple("sigma_n", "sigma_e", "sigma_u")
    if sigmas is None and (of_xyz := triple("sigma_x", "sigma_y", "sigma_z")) is not None:
        sigmas = ned_sigmas(of_xyz, lat, lon)
    if sigmas is None and (one := number("sigma")) is not None:
        sigmas = one, one, one
    if sigmas is not None and min(sigmas) < 0.0:
        raise wrong(f"a sigma is negative: {min(sigmas):g} m")
    try:
        epoch = None if (stated := values.get("epoch")) is None else decimal_year(stated)
    except ValueError as error:
        raise wrong(str(error)) from None
    return Mark(
        name=name,
        lat=lat,
        lon=lon,
        h=h,
        sigmas=sigmas,
        frame=str(values["datum"]).strip() if "datum" in values else frame,
        epoch=epoch,
        source=file if line is None else f"{file}, line {line}",
        orthometric_h=above_sea if h is None else None,
        unsaid_h=unsaid,
    )


def decimal_year(value: object) -> float:
    """``2010.0`` or ``2010-07-01`` as a decimal year.

    Raises
    ------
    ValueError
        If it is neither, or not between 1900 and 2200.
    """
    try:
        day = date.fromisoformat(str(value))
        first, after = date(day.year, 1, 1), date(day.year + 1, 1, 1)
        return day.year + (day - first).days / (after - first).days
    except ValueError:
        pass
    try:
        year = float(str(value))
    except ValueError:
        year = 0.0
    if not 1900.0 <= year < 2200.0:
        raise ValueError(f"epoch {value!r} is no year such as 2010.0, nor a date 2010-01-01")
    return year
