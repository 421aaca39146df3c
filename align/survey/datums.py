"""Names of reference frames: carried, compared and spoken of, never transformed."""

from __future__ import annotations

import re

from earth.units import DEG

_FAMILIES = {
    "NAD 83": r"NAD83",
    "ETRS89": r"ETRS89|ETRF\d+",
    "GDA94": r"GDA94",
    "GDA2020": r"GDA2020",
    "ITRF": r"ITRF\d*|IG[SB]\d\d|WGS84",
}
# from the frames WGS 84 follows, ITRF; plates move on, so the sizes grow
_OFF = {
    "NAD 83": "by 1 to 2 m",
    "ETRS89": "by 2.5 cm for each year since 1989",
    "GDA94": "by 7 cm for each year since 1994",
    "GDA2020": "by 7 cm for each year since 2020",
}
NAME_IN_TEXT = re.compile(
    r"\b(?:ITRF(?:\d{4}|\d\d)|IG[Sb]\d\d|ETRF(?:\d{4}|\d\d)|ETRS ?89|GDA ?(?:94|2020)"
    r"|NAD ?83(?: ?\([^)]*\))?|WGS ?-?84(?: ?\(G\d+\))?)",
)
_SAME = 0.5  # years: plates then move less than 4 cm


def family(frame: str) -> str | None:
    """ITRF (with WGS 84 and IGS), NAD 83, ETRS89, GDA94 or GDA2020; None for any other name."""
    plain = _plain(frame)
    for known, pattern in _FAMILIES.items():
        if re.match(rf"(?:{pattern})(?!\d)", plain):
            return known
    return None


def _plain(frame: str) -> str:
    return re.sub(r"[\s_\-]", "", frame.upper())


def site_warning(what: str, frame: str | None) -> str | None:
    """What has to be said of a place whose coordinates are in `frame`, on a WGS 84 Earth."""
    if frame is None or (known := family(frame)) == "ITRF":
        return None
    if known is None:
        return (
            f"{what} is in {frame}, a frame this program does not know: how far it is from WGS 84 "
            "(ITRF) is yours to judge; nothing was corrected"
        )
    return (
        f"{what} is in {frame}; the Earth model is WGS 84, which follows ITRF, and the two differ "
        f"{_OFF[known]}; nothing was corrected"
    )


def line_warning(
    names: tuple[str, str],
    frames: tuple[str | None, str | None],
    epochs: tuple[float | None, float | None],
    distance: float,
) -> str | None:
    """What has to be said of a line of `distance` m between two marks in their frames."""
    (a, b), (one, two) = names, frames
    if one is None and two is None:
        return None
    if one is None or two is None:
        silent, said = (a, two) if one is None else (b, one)
        return f"the frame of {silent} is not stated, the other mark of the line is in {said}"
    of = family(one), family(two)
    same = _plain(one) == _plain(two)
    if None in of and not same:
        return (
            f"{a} is in {one} and {b} in {two}: how far apart is not known; nothing was corrected"
        )
    if of[0] != of[1]:
        return (
            f"{a} is in {one} and {b} in {two}: the frames may differ by 1 to 2 m, over "
            f"{distance:.1f} m up to {_degrees(2.0 / distance)}; nothing was corrected"
        )
    if of[0] != "ITRF":
        if same:
            return None
        return (
            f"{a} is in {one} and {b} in {two}: these realizations differ by centimeters to 1 m, "
            f"over {distance:.1f} m up to {_degrees(1.0 / distance)}; nothing was corrected"
        )
    years = 0.0 if epochs[0] is None or epochs[1] is None else abs(epochs[1] - epochs[0])
    if years <= _SAME:
        return None
    return (
        f"the coordinates of {a} and {b} are {years:.1f} years apart in {two}, where ground moves "
        f"1 to 8 cm a year: over {distance:.1f} m up to {_degrees(0.08 * years / distance)}; "
        "nothing was corrected"
    )


def _degrees(turn: float) -> str:
    return f"{min(turn / DEG, 180.0):.2g}°"
