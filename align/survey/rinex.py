"""The mark in the header of a RINEX observation file, versions 2 to 4."""

from __future__ import annotations

from align.survey.errors import SurveyError
from align.survey.marks import Mark, geodetic_from_xyz

_END = "END OF HEADER"


def is_rinex(text: str) -> bool:
    first = text.split("\n", 1)[0]
    return first[60:].strip() == "RINEX VERSION / TYPE"


def read_rinex(text: str, file: str) -> list[Mark]:
    """The one mark of a header: APPROX POSITION XYZ as it stands.

    The position is the marker's; the antenna's, ANTENNA: DELTA H/E/N above it, goes into the notes,
    and so does that nobody states how approximate the position is.

    Raises
    ------
    SurveyError
        If there is no position, or a number is damaged.
    """
    name = number_ = ""
    xyz: list[float] | None = None
    delta = [0.0, 0.0, 0.0]
    at = 0
    for number, line in enumerate(text.splitlines(), 1):
        label, content = line[60:].strip(), line[:60]
        if label == _END:
            break
        try:
            if label == "MARKER NAME":
                name = content.strip()
            elif label == "MARKER NUMBER":
                number_ = content[:20].strip()
            elif label == "APPROX POSITION XYZ":
                xyz, at = _triple(content), number
            elif label == "ANTENNA: DELTA H/E/N":
                delta = _triple(content)
        except ValueError:
            raise SurveyError(
                f"{label} has no three numbers in columns 1 to 42", file=file, line=number
            ) from None
    if xyz is None or not any(xyz):
        raise SurveyError("its header has no APPROX POSITION XYZ", file=file, line=at or None)
    try:
        lat, lon, h = geodetic_from_xyz(xyz)
    except SurveyError as error:
        raise SurveyError(str(error), file=file, line=at) from None
    notes = ["its position is a receiver's approximate one, often off by meters"]
    if any(delta):
        notes.append(
            f"the antenna is {delta[0]:g} m above, {delta[1]:g} m east and {delta[2]:g} m north of "
            "the mark; the position is the mark's"
        )
    return [
        Mark(
            name=name or number_ or "RINEX",
            lat=lat,
            lon=lon,
            h=h,
            source=f"{file}, line {at}",
            aliases=(number_,) if name and number_ else (),
            notes=tuple(notes),
        )
    ]


def _triple(content: str) -> list[float]:
    return [float(content[start : start + 14]) for start in (0, 14, 28)]
