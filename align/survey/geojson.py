"""Marks as points of GeoJSON (RFC 7946)."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from align.survey.errors import SurveyError
from align.survey.fields import known_field, mark_from
from align.survey.marks import Mark

_WGS84 = ("CRS84", "CRS84h", "4326", "4979")


def read_geojson(text: str, file: str) -> list[Mark]:
    """The marks of a GeoJSON file: every Point of it.

    Properties hold what the columns of a table hold (`align.survey.tables`); the name may be the
    feature's id. Longitude and latitude are in WGS 84, unless a property ``datum`` says otherwise.
    The third coordinate counts only where ``height_kind`` says above what it is: the format means
    the ellipsoid, the programs that write it often the sea.

    Raises
    ------
    SurveyError
        If the file is no GeoJSON, has no points, or is in another reference system.
    """
    try:
        root = json.loads(text)
    except json.JSONDecodeError as error:
        raise SurveyError(f"is not JSON: {error.msg}", file=file, line=error.lineno) from None
    if not isinstance(root, Mapping) or "type" not in root:
        raise SurveyError("is not GeoJSON: it has no type", file=file)
    crs = root.get("crs")
    if crs is not None:
        name = str(crs.get("properties", {}).get("name") if isinstance(crs, Mapping) else crs)
        if not name.replace("/", ":").endswith(tuple(f":{known}" for known in _WGS84)):
            raise SurveyError(
                f"its coordinates are in {name}; GeoJSON has longitude and latitude in WGS 84, so "
                "convert them, or remove crs and name the frame in a property datum",
                file=file,
            )
    features = root.get("features", []) if root["type"] == "FeatureCollection" else [root]
    if not isinstance(features, list):
        raise SurveyError("is not GeoJSON: features is no list", file=file)
    marks = [
        _mark(feature, file, number)
        for number, feature in enumerate(features, 1)
        if isinstance(feature, Mapping)
        and isinstance(feature.get("geometry"), Mapping)
        and feature["geometry"].get("type") == "Point"
    ]
    if not marks:
        raise SurveyError("holds no feature with a Point", file=file)
    return marks


def _mark(feature: Mapping[str, Any], file: str, number: int) -> Mark:
    where = f"{file}, feature {number}"
    coordinates = feature["geometry"].get("coordinates")
    if (
        not isinstance(coordinates, list)
        or len(coordinates) not in (2, 3)
        or not all(isinstance(x, (int, float)) and not isinstance(x, bool) for x in coordinates)
    ):
        raise SurveyError(f"a Point has 2 or 3 numbers, got {coordinates!r}", file=where)
    values: dict[str, Any] = {}
    properties = feature.get("properties")
    for key, value in (properties if isinstance(properties, Mapping) else {}).items():
        try:
            field = known_field(key)
        except ValueError as error:
            raise SurveyError(str(error), file=where) from None
        if field is not None and value is not None:
            scaled = field.unit != 1.0 and isinstance(value, (int, float))
            values[field.name] = value * field.unit if scaled else value
    values.setdefault("name", str(feature.get("id", "")))
    values["longitude"], values["latitude"] = coordinates[:2]
    if len(coordinates) == 3:
        values["unsaid_height"] = coordinates[2]
    return mark_from(values, where, frame="WGS 84")
