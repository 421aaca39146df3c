"""Marks of a SINEX solution (Solution INdependent EXchange format 1 and 2, 80 columns)."""

from __future__ import annotations

import re
from datetime import date

from align.survey.datums import NAME_IN_TEXT, family
from align.survey.errors import SurveyError
from align.survey.marks import Mark, geodetic_from_xyz, ned_sigmas

_AXES = {"STAX": 0, "STAY": 1, "STAZ": 2}
_Key = tuple[str, str, str]  # site code, point, solution


def is_sinex(text: str) -> bool:
    return text.startswith("%=SNX")


def read_sinex(text: str, file: str) -> list[Mark]:
    """The marks of SOLUTION/ESTIMATE, by code, code:solution and what SITE/ID calls them.

    The sigmas are those of X, Y, Z taken as uncorrelated; velocities are not applied, so a
    position holds at its reference epoch. The frame is the one that the comments and FILE blocks
    name.

    Raises
    ------
    SurveyError
        If the file has no station position, or a line of one is damaged.
    """
    sites: dict[tuple[str, str], tuple[str, str]] = {}
    values: dict[_Key, dict[int, tuple[float, float]]] = {}
    lines: dict[_Key, int] = {}
    epochs: dict[_Key, float | None] = {}
    named: list[str] = []
    block = ""
    for number, line in enumerate(text.splitlines(), 1):
        if line[:1] in "+-":
            block = line[1:].strip() if line[:1] == "+" else ""
        elif line[:1] == "*" or block.startswith("FILE/"):
            named += NAME_IN_TEXT.findall(line)
        elif block == "SITE/ID":
            sites[line[1:5].strip(), line[6:8].strip()] = line[9:18].strip(), line[21:43].strip()
        elif block == "SOLUTION/ESTIMATE" and (axis := _AXES.get(line[7:13].strip())) is not None:
            key = line[14:18].strip(), line[19:21].strip(), line[22:26].strip()
            try:
                value, sigma = (float(line[a:b].replace("D", "E")) for a, b in ((47, 68), (69, 80)))
                epochs[key] = _year(line[27:39])
            except ValueError:
                raise SurveyError(
                    "is no line of SOLUTION/ESTIMATE: epoch in columns 28 to 39, value in 48 to "
                    "68, standard deviation in 70 to 80",
                    file=file,
                    line=number,
                ) from None
            if line[40:44].strip() not in ("", "m"):
                raise SurveyError(
                    f"{line[7:13].strip()} is in {line[40:44].strip()}; it must be in m",
                    file=file,
                    line=number,
                )
            lines.setdefault(key, number)
            values.setdefault(key, {})[axis] = value, sigma
    if not values:
        raise SurveyError("has no STAX, STAY, STAZ in SOLUTION/ESTIMATE", file=file)
    families = {family(name) for name in named}
    frame = named[0] if len(families) == 1 else None
    notes: tuple[str, ...] = ()
    if len(families) > 1:
        notes = (f"its file names several frames ({', '.join(dict.fromkeys(named))})",)
    marks = []
    for key, axes in values.items():
        code, point, solution = key
        source = f"{file}, line {lines[key]}"
        if len(axes) < 3:
            raise SurveyError(f"{code} lacks one of STAX, STAY, STAZ", file=file, line=lines[key])
        try:
            lat, lon, h = geodetic_from_xyz([axes[i][0] for i in range(3)])
        except SurveyError as error:
            raise SurveyError(str(error), file=file, line=lines[key]) from None
        others = *sites.get((code, point), ()), f"{code}:{solution}"
        marks.append(
            Mark(
                name=code,
                lat=lat,
                lon=lon,
                h=h,
                sigmas=ned_sigmas([axes[i][1] for i in range(3)], lat, lon),
                frame=frame,
                epoch=epochs[key],
                source=source,
                aliases=tuple(name for name in others if name),
                notes=notes,
            )
        )
    return marks


def _year(epoch: str) -> float | None:
    """Decimal year of ``YY:DDD:SSSSS``; None of zeros, which stand for no epoch."""
    match = re.fullmatch(r"\s*(\d{2}|\d{4}):(\d{3}):(\d{5})\s*", epoch)
    if match is None:
        raise ValueError(epoch)
    year, day, second = (int(x) for x in match.groups())
    if (year, day, second) == (0, 0, 0):
        return None
    if len(match[1]) == 2:
        year += 2000 if year <= 50 else 1900
    days = (date(year + 1, 1, 1) - date(year, 1, 1)).days
    return year + (day - 1 + second / 86400.0) / days
