"""Marks in a table with headers: CSV, also with semicolons or tabs."""

from __future__ import annotations

import csv
import re

from align.survey.errors import SurveyError
from align.survey.fields import Field, grid_header, known_field, mark_from
from align.survey.marks import Mark

_TEXT = ("name", "datum", "epoch", "height_kind", "latitude", "longitude")
_DELIMITERS = ",;\t"
_DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")


def is_table(text: str) -> bool:
    """Whether its first line of content has a header that a mark may have."""
    for line in text.splitlines():
        if line.strip() and not line.startswith("#"):
            try:
                return any(_headers(line)[1])
            except csv.Error:
                return False
            except ValueError:  # a known header in an unknown unit
                return True
    return False


def read_table(text: str, file: str) -> list[Mark]:
    """The marks of a table, one a line; lines beginning with # are comments.

    Columns in any order, upper or lower case: name; latitude and longitude (degrees or
    degrees, minutes, seconds) or x, y, z; height (above the ellipsoid), or orthometric_height and
    geoid_height; sigma_n, sigma_e, sigma_u or sigma_x, sigma_y, sigma_z or one sigma (m, or with
    _mm, _cm behind); datum; epoch. Other columns are passed over.

    Raises
    ------
    SurveyError
    """
    delimiter = ","
    fields: list[Field | None] = []
    marks: list[Mark] = []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        if not fields:
            try:
                delimiter, fields = _headers(line)
            except ValueError as error:
                raise SurveyError(str(error), file=file, line=number) from None
            _check(line, fields, file, number)
            continue
        cells = _cells(line, delimiter)
        if len(cells) > len(fields):
            raise SurveyError(
                f"{len(cells)} values under {len(fields)} headers; text with a "
                f"{delimiter!r} needs quotes",
                file=file,
                line=number,
            )
        values: dict[str, object] = {}
        for field, cell in zip(fields, cells, strict=False):
            if field is not None and cell.strip():
                values[field.name] = _value(field, cell.strip(), delimiter, file, number)
        marks.append(mark_from(values, file, number))
    return marks


def _headers(line: str) -> tuple[str, list[Field | None]]:
    delimiter = max(_DELIMITERS, key=line.count)
    return delimiter, [known_field(cell) for cell in _cells(line, delimiter)]


def _cells(line: str, delimiter: str) -> list[str]:
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))


def _check(line: str, fields: list[Field | None], file: str, number: int) -> None:
    names = [field.name for field in fields if field is not None]
    if twice := {name for name in names if names.count(name) > 1}:
        raise SurveyError(f"two columns hold the {min(twice)}", file=file, line=number)
    if "name" not in names:
        raise SurveyError("there is no column name", file=file, line=number)
    if not ({"latitude", "longitude"} <= set(names) or {"x", "y", "z"} <= set(names)):
        grid = [cell for cell in re.split(f"[{_DELIMITERS}]", line) if grid_header(cell)]
        raise SurveyError(
            (f"grid coordinates ({grid[0].strip()}) are not read; " if grid else "")
            + "give columns latitude and longitude, or x, y and z",
            file=file,
            line=number,
        )


def _value(field: Field, cell: str, delimiter: str, file: str, number: int) -> object:
    if delimiter != "," and _DECIMAL_COMMA.fullmatch(cell):
        cell = cell.replace(",", ".")
    if field.name in _TEXT:
        return cell
    try:
        return float(cell) * field.unit
    except ValueError:
        raise SurveyError(
            f"{field.name} {cell!r} is not a number", file=file, line=number
        ) from None
