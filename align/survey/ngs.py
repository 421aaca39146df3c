"""Marks of the US National Geodetic Survey's data sheets (DSDATA, 80 columns)."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from align.survey.angles import parse_latitude, parse_longitude
from align.survey.errors import SurveyError
from align.survey.marks import Mark

_FIRST = re.compile(r"1\s+NATIONAL GEODETIC SURVEY\b", re.IGNORECASE)
_LINE = re.compile(r" ?(?P<pid>[A-Z]{2}\d{4})(?P<mark>[ *.;:_'])(?P<rest>.*)")
_DATUM = r"(?P<datum>[A-Z]+ \d\d(?:\s?\([^)]*\))?)"
_POSITION = re.compile(
    rf"\s*{_DATUM}\s+POSITION\s*-\s*(?P<lat>\d+ +\d+ +[\d.]+) ?\((?P<ns>[NS])\)\s*"
    r"(?P<lon>\d+ +\d+ +[\d.]+) ?\((?P<ew>[EW])\)\s*(?P<how>.*?)\s*"
)
_ELLIPSOID = re.compile(rf"\s*{_DATUM}\s+ELLIP (?:HT|HEIGHT)\s*-\s*(?P<h>[+-]?[\d.]+)\s*\(m\w*\).*")
_EPOCH = re.compile(rf"\s*{_DATUM}\s+EPOCH\s*-\s*(?P<year>\d{{4}}(?:\.\d*)?).*")
_SEA = re.compile(r"\s*(?P<datum>[A-Z]+ ?\d\d) ORTHO HEIGHT\s*-\s*(?P<H>[+-]?[\d.]+)\s*\(m\w*\).*")
_GEOID = re.compile(r"\s*GEOID HEIGHT\s*-\s*(?P<N>[+-]?[\d.]+)\s*\(m\w*\)\s*(?P<model>\S*).*")
_NETWORK = re.compile(
    r"\s*NETWORK\s+[\d.]+\s+[\d.]+\s+(?P<n>[\d.]+)\s+(?P<e>[\d.]+)\s+(?P<u>[\d.]+)\s+.*"
)
_SCALED = "SCALED"


def is_datasheet(text: str) -> bool:
    return any(_FIRST.match(line) for line in text.splitlines())


@dataclass
class _Sheet:
    pid: str
    line: int
    name: str = ""
    lat: float | None = None
    lon: float = 0.0
    frame: str = ""
    epoch: float | None = None
    h: float | None = None
    sea: tuple[str, float] | None = None
    geoid: tuple[str, float] | None = None
    sigmas: tuple[float, float, float] | None = None
    notes: list[str] = field(default_factory=list)


def read_datasheets(text: str, file: str) -> list[Mark]:
    """The marks of one or more data sheets, by designation and PID.

    Read are the current survey control (position, ellipsoid height, epoch, orthometric and geoid
    height) and the network accuracies; superseded values are not. Without an ellipsoid height, the
    orthometric height and the first geoid height make one. A sheet without a position is passed
    over.

    Raises
    ------
    SurveyError
        If no sheet has a position, or a position is none.
    """
    sheets: list[_Sheet] = []
    for number, line in enumerate(text.splitlines(), 1):
        match = _LINE.fullmatch(line.rstrip())
        if match is None:
            continue
        if not sheets or sheets[-1].pid != match["pid"]:
            sheets.append(_Sheet(match["pid"], number))
        try:
            _read(sheets[-1], match["mark"], match["rest"])
        except ValueError as error:
            raise SurveyError(str(error), file=file, line=number) from None
    marks = [_mark(sheet, file) for sheet in sheets if sheet.lat is not None]
    if not marks:
        raise SurveyError("no data sheet in it has a POSITION of current survey control", file=file)
    return marks


def _read(sheet: _Sheet, mark: str, rest: str) -> None:
    if mark == "*":  # current survey control
        if m := _POSITION.fullmatch(rest):
            sheet.lat = parse_latitude(f"{m['lat']} {m['ns']}")
            sheet.lon = parse_longitude(f"{m['lon']} {m['ew']}")
            sheet.frame = m["datum"]
            if m["how"].upper() == _SCALED:
                sheet.notes.append("its position was scaled from a map, good to 6″ (200 m)")
            elif m["how"].upper().startswith("HD_HELD"):
                sheet.notes.append("its position is from a hand-held receiver, good to 10 m")
        elif m := _ELLIPSOID.fullmatch(rest):
            sheet.h = float(m["h"])
        elif m := _EPOCH.fullmatch(rest):
            sheet.epoch = float(m["year"])
        elif m := _SEA.fullmatch(rest):
            sheet.sea = m["datum"], float(m["H"])
    if mark in " *" and sheet.geoid is None and (m := _GEOID.fullmatch(rest)):
        sheet.geoid = m["model"], float(m["N"])
    elif mark == " " and (m := re.fullmatch(r"\s*DESIGNATION\s*-\s*(.*?)\s*", rest)):
        sheet.name = m[1]
    elif mark == " " and (m := _NETWORK.fullmatch(rest)):
        sheet.sigmas = float(m["n"]) * 1e-2, float(m["e"]) * 1e-2, float(m["u"]) * 1e-2  # cm


def _mark(sheet: _Sheet, file: str) -> Mark:
    assert sheet.lat is not None
    h, above_sea, notes = sheet.h, None, sheet.notes
    if h is None and sheet.sea is not None:
        datum, H = sheet.sea
        if sheet.geoid is None:
            above_sea = H
        else:
            model, N = sheet.geoid
            h = H + N
            notes = [*notes, f"its ellipsoid height is from {datum} and {model or 'the geoid'}"]
    return Mark(
        name=sheet.name or sheet.pid,
        lat=sheet.lat,
        lon=sheet.lon,
        h=h,
        sigmas=sheet.sigmas,
        frame=sheet.frame,
        epoch=sheet.epoch,
        source=f"{file}, line {sheet.line}",
        aliases=(sheet.pid,) if sheet.name else (),
        orthometric_h=above_sea,
        notes=tuple(notes),
    )
