"""Paths of other people's making: CSV, GeoJSON, and positions of a log."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from earth.frames import C_en
from earth.geodetic import ecef_to_geodetic, geodetic_to_ecef
from earth.rotation import (
    dcm_from_quat,
    quat_from_dcm,
    quat_from_euler,
)
from earth.units import DEG
from navgrade.config import parse_time_ns
from navgrade.errors import ConfigError, LogError
from navgrade.logs import read_aiding
from navgrade.logs.aiding import Aiding

Array = NDArray[np.float64]

SUFFIXES = (".csv", ".geojson", ".json", ".mcap")

_COLUMNS: dict[str, tuple[str, ...]] = {
    "lat": ("latitude_deg", "lat_deg", "latitude", "lat"),
    "lon": ("longitude_deg", "lon_deg", "longitude", "lon"),
    "h": ("height_m", "h_m"),
}
_TIMES: dict[str, float] = {  # s
    "time_s": 1.0,
    "unix_s": 1.0,
    "time_ns": 1e-9,
    "log_time_ns": 1e-9,
}
_EULER = ("roll_deg", "pitch_deg", "heading_deg")
_QUATERNION = ("qw", "qx", "qy", "qz")
_C_ENU_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_C_FLU_FRD = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, eq=False)
class TrackPoints:
    """Points of a path.

    Attributes
    ----------
    lat, lon : ndarray, shape (n,)
        Geodetic, rad.
    h : ndarray, shape (n,), or None
        Above the ellipsoid, m; None where the path is drawn on a map.
    t : ndarray, shape (n,), or None
        s after the first point; None where the path has no times.
    time_ns : int or None
        Unix time of the first point, ns, where the path knows it.
    q_nb : ndarray, shape (n, 4), or None
        Attitude, scalar first.
    notes : tuple of str
        What was left out, in sentences.
    """

    lat: Array
    lon: Array
    h: Array | None
    t: Array | None = None
    time_ns: int | None = None
    q_nb: Array | None = None
    notes: tuple[str, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.lat)


def read_csv(path: Path) -> TrackPoints:
    """Read points from a table whose first line names its columns.

    ``latitude_deg`` (or lat_deg, latitude, lat), ``longitude_deg`` likewise, ``height_m`` (or h_m)
    above the ellipsoid; a time where there is one: ``time_s`` (from any zero), ``unix_s``,
    ``time_ns`` or ``log_time_ns`` (since 1970), or ``time``, such as 2026-01-01T00:00:00Z; an
    attitude where there is one: ``roll_deg``, ``pitch_deg`` and ``heading_deg``, or ``qw``, ``qx``,
    ``qy``, ``qz``, which turn vectors of the body (forward-right-down) into north-east-down. Other
    columns are left alone.

    Raises
    ------
    ConfigError
        Naming the column that is missing and those found, or the line that is wrong.
    """
    header, rows, lines = _table(path)

    def column(name: str) -> Array:
        k = header.index(name)
        values = np.empty(len(rows))
        for i, row in enumerate(rows):
            try:
                values[i] = float(row[k])
            except ValueError:
                values[i] = np.nan
            if not np.isfinite(values[i]):
                raise _error(path, f"line {lines[i]}: {name} is {row[k]!r}, not a finite number")
        return values

    found = {}
    for what, names in _COLUMNS.items():
        present = [name for name in names if name in header]
        if not present and what != "h":
            raise _missing(path, names, header)
        found[what] = column(present[0]) if present else None
    lat, lon = found["lat"], found["lon"]
    assert lat is not None
    assert lon is not None
    t, time_ns = _times(path, header, rows, lines, column)
    q_nb = None
    for names in (_EULER, _QUATERNION):
        present = [name for name in names if name in header]
        if present and len(present) < len(names):
            raise _missing(path, [n for n in names if n not in present][:1], header)
        if not present or q_nb is not None:
            continue
        values = np.stack([column(name) for name in names], axis=-1)
        if names is _EULER:
            q_nb = quat_from_euler(*(values * DEG).T)
            continue
        norm = np.linalg.norm(values, axis=1)
        if np.any(np.abs(norm - 1.0) > 1e-3):
            k = int(np.argmax(np.abs(norm - 1.0)))
            raise _error(path, f"line {lines[k]}: the quaternion has the norm {norm[k]:.6g}, not 1")
        q_nb = values / norm[:, None]
    _check_range(path, lat, lon, lambda k: f"line {lines[k]}")
    return TrackPoints(lat * DEG, lon * DEG, found["h"], t, time_ns, q_nb)


def _table(path: Path) -> tuple[list[str], list[list[str]], list[int]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            reader = csv.reader(stream)
            header = [name.strip() for name in next(reader, [])]
            rows, lines = [], []
            for row in reader:
                if not row:
                    continue
                if len(row) != len(header):
                    text = f"line {reader.line_num} has {len(row)} cells, the header {len(header)}"
                    raise _error(path, text)
                rows.append(row)
                lines.append(reader.line_num)
    except FileNotFoundError:
        raise _error(path, "no such path file") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise _error(path, f"cannot be read: {error}") from None
    return header, rows, lines


def _times(
    path: Path, header: list[str], rows: list[list[str]], lines: list[int], column: Any
) -> tuple[Array | None, int | None]:
    """Times after the first point, s, and when that was."""
    if not rows:
        return None, None
    for name, unit in _TIMES.items():
        if name not in header:
            continue
        if name.endswith("_ns"):
            k = header.index(name)
            try:
                time_ns = [int(row[k]) for row in rows]
            except ValueError:
                raise _error(path, f"{name} must hold whole nanoseconds") from None
            return np.array([x - time_ns[0] for x in time_ns]) * unit, time_ns[0]
        values = column(name)
        first_ns = round(values[0] * 1e9) if name == "unix_s" else None
        return values - values[0], first_ns
    if "time" in header:
        k = header.index("time")
        moments = []
        for row, line in zip(rows, lines, strict=True):
            try:
                moments.append(parse_time_ns(row[k].strip()))
            except ValueError as error:
                raise _error(path, f"line {line}: {error}") from None
        return np.array([x - moments[0] for x in moments]) * 1e-9, moments[0]
    return None, None


def read_geojson(path: Path) -> TrackPoints:
    """Read the one LineString of a GeoJSON file: a Feature, a FeatureCollection or a geometry.

    Coordinates are longitude, latitude, in degrees, and perhaps height above the ellipsoid, m
    (RFC 7946). Only a path all of whose points have a height has heights.

    Raises
    ------
    ConfigError
        When there is not one LineString, or its coordinates are not such.
    """
    try:
        content = json.loads(path.read_bytes())
    except FileNotFoundError:
        raise _error(path, "no such path file") from None
    except (OSError, ValueError) as error:
        raise _error(path, f"cannot be read as GeoJSON: {error}") from None
    found = list(_geometries(content))
    lines = [g for g in found if g.get("type") == "LineString"]
    if len(lines) != 1:
        kinds = ", ".join(sorted({str(g.get("type")) for g in found})) or "nothing"
        raise _error(path, f"holds {len(lines)} LineStrings, one is needed; it has {kinds}")
    points = lines[0].get("coordinates")
    if not isinstance(points, list):
        raise _error(path, "the LineString has no coordinates")
    for k, point in enumerate(points):
        good = isinstance(point, list) and len(point) >= 2
        if not good or not all(
            isinstance(x, (int, float)) and not isinstance(x, bool) and np.isfinite(x)
            for x in point[:3]
        ):
            raise _error(path, f"point {k + 1} is {point!r}, not [longitude, latitude, height]")
    lon, lat = (np.array([point[i] for point in points], dtype=float) for i in (0, 1))
    _check_range(path, lat, lon, lambda k: f"point {k + 1}", ": GeoJSON is longitude first")
    h = None
    if points and all(len(point) >= 3 for point in points):
        h = np.array([point[2] for point in points], dtype=float)
    return TrackPoints(lat * DEG, lon * DEG, h)


def _geometries(content: Any) -> Iterator[Mapping[str, Any]]:
    if not isinstance(content, Mapping):
        return
    if content.get("type") == "FeatureCollection":
        for feature in content.get("features") or []:
            yield from _geometries(feature)
    elif content.get("type") == "Feature":
        yield from _geometries(content.get("geometry"))
    else:
        yield content


def read_log(
    path: Path,
    topic: str,
    *,
    geoid_height: float | None = None,
    frame: str | None = None,
    child: str | None = None,
    origin: tuple[float, float, float] | None = None,
) -> TrackPoints:
    """Read the positions of a topic, and attitudes where it has them.

    Positions over the Earth (NavSatFix, our solution, ...) are taken as they are; points without
    a valid solution are left out, which the notes tell. Poses in a map (Odometry, transforms) need
    `frame`, `child` and the `origin` of the map: its axes are east, north, up there, those of the
    child forward, left, up (REP-103).

    Parameters
    ----------
    path : Path
    topic : str
    geoid_height : float, optional
        m; the heights are above mean sea level, and this makes them heights above the ellipsoid.
    frame, child : str, optional
    origin : (float, float, float), optional
        Latitude, longitude, rad, and height, m.

    Raises
    ------
    LogError, SchemaError
        When the topic cannot be read.
    ConfigError
        When frames or the origin are not said, or a geoid height where the topic needs none.
    """
    found = read_aiding(path, topic)
    if found.r is not None:
        if frame is None or child is None:
            held = ", ".join(
                sorted({f"frame {f}, child {c}" for f, c in zip(*_frames(found), strict=True)})
            )
            raise _error(
                path, f"{topic} holds poses in a map ({held}); say path.frame and path.child"
            )
        if origin is None:
            raise _error(
                path,
                f"{topic} holds poses in a map; say where it has its origin, latitude, longitude "
                "and height_m of [start]",
            )
        found = read_aiding(path, topic, frame=frame, child=child)
    keep, notes = _usable(path, found)
    h: Array | None
    if found.r is not None:
        assert origin is not None
        lat, lon, h, q_nb = _from_map(found, keep, origin)
    elif found.lat is None or found.lon is None:
        raise LogError("holds no positions", file=str(path), topic=topic)
    else:
        lat, lon, h, q_nb = found.lat[keep], found.lon[keep], None, None
        all_h = _height(path, found, geoid_height)
        if all_h is not None:
            h = all_h[keep]
        if found.q_nb is not None:
            q_nb = found.q_nb[keep]
    time_ns = found.time_ns[keep]
    return TrackPoints(
        lat, lon, h, (time_ns - time_ns[0]) * 1e-9, int(time_ns[0]), q_nb, tuple(notes)
    )


def _height(path: Path, found: Aiding, geoid_height: float | None) -> Array | None:
    if geoid_height is None or found.h is None:
        return found.h
    if found.h_msl is not None:
        raise _error(
            path,
            f"{found.topic} itself says its heights above the ellipsoid; leave "
            "path.geoid_height_m out",
        )
    return found.h + geoid_height


def _frames(found: Aiding) -> tuple[Sequence[str], Sequence[str]]:
    frame = found.frame if found.frame is not None else [""] * len(found)
    return list(frame), list(found.child) if found.child is not None else [""] * len(found)


def _usable(path: Path, found: Aiding) -> tuple[NDArray[np.intp], list[str]]:
    """Rows that hold a solution, in the order of time, each time once."""
    notes = [f"{issue.text} (byte {issue.offset})" for issue in found.issues]
    rows = np.flatnonzero(found.valid)
    if len(rows) < len(found):
        notes.append(
            f"{len(found) - len(rows)} of {len(found)} messages hold no valid position and were "
            "left out"
        )
    if not len(rows):
        raise LogError("no message holds a valid position", file=str(path), topic=found.topic)
    times, first = np.unique(found.time_ns[rows], return_index=True)
    if len(times) < len(rows):
        notes.append(f"{len(rows) - len(times)} messages of a time already seen were left out")
    return rows[first], notes


def _from_map(
    found: Aiding, keep: NDArray[np.intp], origin: tuple[float, float, float]
) -> tuple[Array, Array, Array, Array | None]:
    assert found.r is not None
    lat0, lon0, h0 = origin
    C_e_enu = C_en(lat0, lon0) @ _C_ENU_NED.T
    r_e = geodetic_to_ecef(lat0, lon0, h0) + found.r[keep] @ C_e_enu.T
    lat, lon, h = ecef_to_geodetic(r_e)
    if found.q is None:
        return lat, lon, h, None
    C_ne = np.swapaxes(C_en(lat, lon), -1, -2)
    C_nb = C_ne @ C_e_enu @ dcm_from_quat(found.q[keep]) @ _C_FLU_FRD
    return lat, lon, h, quat_from_dcm(C_nb)


def _check_range(path: Path, lat_deg: Array, lon_deg: Array, where: Any, hint: str = "") -> None:
    for name, values, limit in (("latitude", lat_deg, 90.0), ("longitude", lon_deg, 360.0)):
        beyond = np.abs(values) > limit
        if beyond.any():
            k = int(np.argmax(beyond))
            raise _error(
                path, f"{where(k)} has the {name} {values[k]:.6g}, beyond ±{limit:g}°{hint}"
            )


def _missing(path: Path, names: Sequence[str], header: list[str]) -> ConfigError:
    wanted = names[0] if len(names) == 1 else f"{names[0]} (or {', '.join(names[1:])})"
    held = ", ".join(header) or "none"
    return _error(path, f"there is no column {wanted}; the columns are {held}")


def _error(path: Path, text: str) -> ConfigError:
    return ConfigError(text, file=str(path))
