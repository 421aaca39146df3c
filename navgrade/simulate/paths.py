"""Paths of other people's making: CSV, GeoJSON, and positions of a log."""

from __future__ import annotations

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
)
from earth.units import DEG
from navgrade.errors import LogError
from navgrade.logs import read_aiding
from navgrade.logs.aiding import Aiding
from navgrade.logs.tracks import check_range, path_error, read_track_csv, usable_rows

Array = NDArray[np.float64]

SUFFIXES = (".csv", ".geojson", ".json", ".mcap")

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
    """Read points from a table, see `navgrade.logs.read_track_csv`."""
    track = read_track_csv(path)
    t = first_ns = None
    if track.time_ns is not None:
        t = (track.time_ns - track.time_ns[0]) * 1e-9
        first_ns = int(track.time_ns[0]) if track.is_unix else None
    return TrackPoints(track.lat, track.lon, track.h, t, first_ns, track.q_nb)


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
        raise path_error(path, "no such path file") from None
    except (OSError, ValueError) as error:
        raise path_error(path, f"cannot be read as GeoJSON: {error}") from None
    found = list(_geometries(content))
    lines = [g for g in found if g.get("type") == "LineString"]
    if len(lines) != 1:
        kinds = ", ".join(sorted({str(g.get("type")) for g in found})) or "nothing"
        raise path_error(path, f"holds {len(lines)} LineStrings, one is needed; it has {kinds}")
    points = lines[0].get("coordinates")
    if not isinstance(points, list):
        raise path_error(path, "the LineString has no coordinates")
    for k, point in enumerate(points):
        good = isinstance(point, list) and len(point) >= 2
        if not good or not all(
            isinstance(x, (int, float)) and not isinstance(x, bool) and np.isfinite(x)
            for x in point[:3]
        ):
            raise path_error(path, f"point {k + 1} is {point!r}, not [longitude, latitude, height]")
    lon, lat = (np.array([point[i] for point in points], dtype=float) for i in (0, 1))
    check_range(path, lat, lon, lambda k: f"point {k + 1}", ": GeoJSON is longitude first")
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
            raise path_error(
                path, f"{topic} holds poses in a map ({held}); say path.frame and path.child"
            )
        if origin is None:
            raise path_error(
                path,
                f"{topic} holds poses in a map; say where it has its origin, latitude, longitude "
                "and height_m of [start]",
            )
        found = read_aiding(path, topic, frame=frame, child=child)
    keep, notes = usable_rows(found, path)
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
        raise path_error(
            path,
            f"{found.topic} itself says its heights above the ellipsoid; leave "
            "path.geoid_height_m out",
        )
    return found.h + geoid_height


def _frames(found: Aiding) -> tuple[Sequence[str], Sequence[str]]:
    frame = found.frame if found.frame is not None else [""] * len(found)
    return list(frame), list(found.child) if found.child is not None else [""] * len(found)


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
