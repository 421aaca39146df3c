"""Files of marks, recognized by what is in them."""

from __future__ import annotations

from pathlib import Path

from align.survey.errors import SurveyError
from align.survey.geojson import read_geojson
from align.survey.marks import Mark
from align.survey.ngs import is_datasheet, read_datasheets
from align.survey.rinex import is_rinex, read_rinex
from align.survey.sinex import is_sinex, read_sinex
from align.survey.tables import is_table, read_table


def read_marks(path: str | Path) -> list[Mark]:
    """The marks of a table with headers, GeoJSON, NGS data sheets, SINEX or a RINEX header.

    Raises
    ------
    SurveyError
        Naming the file, the line and what is wrong with it.
    """
    path = Path(path)
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise SurveyError("no such file of marks", file=str(path)) from None
    except OSError as error:
        raise SurveyError(f"cannot be read: {error.strerror}", file=str(path)) from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = raw.decode("latin-1")  # spreadsheets write their degree sign so
    return marks_of(text, str(path))


def marks_of(text: str, file: str) -> list[Mark]:
    """The marks of a text in any of the formats; `file` is its name for messages."""
    if is_sinex(text):
        return read_sinex(text, file)
    if is_rinex(text):
        return read_rinex(text, file)
    if text.lstrip()[:1] == "{":
        return read_geojson(text, file)
    if is_datasheet(text):
        return read_datasheets(text, file)
    if not is_table(text):
        raise SurveyError(
            "is neither a table with headers (name, latitude, longitude, height), nor GeoJSON, NGS "
            "data sheets, SINEX or a RINEX header",
            file=file,
        )
    marks = read_table(text, file)
    if not marks:
        raise SurveyError("has headers and no marks", file=file)
    return marks
