"""Angles as surveyors write them."""

from __future__ import annotations

import math
import re

from earth.units import DEG

_NUMBER = r"\d+(?:\.\d*)?|\.\d+"
_DMS = re.compile(
    rf"\s*(?P<lead>[NSEW])?\s*(?P<sign>[+-])?\s*(?P<d>{_NUMBER})\s*(?P<unit>°|d|(?=[:\sNSEW]|$))"
    rf"(?:\s*:?\s*(?P<m>{_NUMBER})\s*(?:'|′|m|(?=[:\sNSEW]|$))"
    rf"(?:\s*:?\s*(?P<s>{_NUMBER})\s*(?P<mark>\"|″|''|s)??)?)?"
    r"\s*(?P<trail>[NSEW])?\s*",
    re.IGNORECASE,
)


def parse_angle(value: float | int | str, positive: str, negative: str) -> float:
    """Read a latitude or longitude.

    Parameters
    ----------
    value : float or str
        Degrees, or text: ``51.07995``, ``51 04 47.8327 N``, ``51°04'47.8327"N``, ``N51.0799``,
        ``-114:08:01.37``.
    positive, negative : str
        Hemisphere letters: N and S, or E and W.

    Returns
    -------
    float
        rad.

    Raises
    ------
    ValueError
        If the text is not an angle, minutes or seconds reach 60, a part before the last has
        decimals, sign and hemisphere are both given, or an S may mean seconds or south.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{value!r} is not an angle")
    if not isinstance(value, str):
        return float(value) * DEG
    match = _DMS.fullmatch(value)
    if match is None:
        raise ValueError(f"{value!r} is not an angle; write 51.07995 or 51 04 47.8327 {positive}")
    trail = match["trail"]
    if match["unit"] in ("d", "D") and match["s"] and not match["mark"] and trail in ("s", "S"):
        if trail == "S" and match["unit"] == "D":
            raise ValueError(
                f"{value!r} ends in an S that may mean seconds or south; write "
                f"{match['d']} {match['m']} {match['s']} {positive} or {negative}"
            )
        if trail == "s":
            trail = None  # 33d51m54.5s: the unit of the seconds, not the south
    letters = [x.upper() for x in (match["lead"], trail) if x]
    if len(letters) > 1 or (letters and match["sign"]):
        raise ValueError(f"{value!r} gives its sign twice")
    if letters and letters[0] not in (positive, negative):
        raise ValueError(
            f"{value!r} ends in {letters[0]}, expected {positive} or {negative}; are latitude and "
            "longitude swapped?"
        )
    for part, finer in ("dm", "ms"):
        if match[finer] and "." in match[part]:
            raise ValueError(f"{value!r} has decimals before its last part")
    degrees, minutes, seconds = (float(match[part] or 0.0) for part in "dms")
    if minutes >= 60.0 or seconds >= 60.0:
        raise ValueError(f"{value!r} has minutes or seconds of 60 or more")
    sign = -1.0 if match["sign"] == "-" or letters == [negative] else 1.0
    return sign * (degrees + minutes / 60.0 + seconds / 3600.0) * DEG


def parse_latitude(value: float | int | str) -> float:
    """Read a latitude, rad, north positive; see `parse_angle`.

    Raises
    ------
    ValueError
        Also beyond ±90 degrees.
    """
    lat = parse_angle(value, "N", "S")
    if not abs(lat) <= 90.0 * DEG:
        swapped = "; are latitude and longitude swapped?" if math.isfinite(lat) else ""
        raise ValueError(f"must be within ±90 degrees, got {value!r}{swapped}")
    return lat


def parse_longitude(value: float | int | str) -> float:
    """Read a longitude, rad, east positive; see `parse_angle`.

    Raises
    ------
    ValueError
        Also beyond ±360 degrees.
    """
    lon = parse_angle(value, "E", "W")
    if not abs(lon) <= 360.0 * DEG:
        raise ValueError(f"must be within ±360 degrees, got {value!r}")
    return lon


def parse_turn(value: float | int | str) -> float:
    """Read an azimuth or a turned angle, rad, clockwise positive.

    Parameters
    ----------
    value : float or str
        Degrees, or text without letters: ``123.4567``, ``123 27 24.1``, ``-0:30``.

    Raises
    ------
    ValueError
        If it is no angle, is beyond ±360 degrees, or is a bearing such as ``N 45 30 E``.
    """
    if isinstance(value, str) and re.search("[NSEW]", re.sub(r"\d\s*s\s*$", "", value), re.I):
        raise ValueError(f"{value!r} has letters; write degrees clockwise from north, 0 to 360")
    turn = parse_angle(value, "E", "W")
    if not abs(turn) <= 360.0 * DEG:
        raise ValueError(f"must be within ±360 degrees, got {value!r}")
    return turn
