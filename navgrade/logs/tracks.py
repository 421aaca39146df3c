"""Known trajectories: a topic of a log, or a text file with one line for each instant."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from decimal import Context, Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from earth.rotation import quat_from_euler
from earth.units import DEG
from navgrade.errors import LogError
from navgrade.logs.aiding import Aiding

Array = NDArray[np.float64]

_EXACT = Context(prec=40)
_NAMES = {  # what a column may be called
    "time": ("unix_s", "time_s", "t_s", "time", "t", "timestamp"),
    "time_ns": ("time_ns", "unix_ns", "stamp_ns", "log_time_ns", "header.stamp_ns"),
    "lat": ("latitude_deg", "lat_deg", "latitude", "lat"),
    "lon": ("longitude_deg", "lon_deg", "longitude", "lon"),
    "h": ("height_m", "h_m", "height", "h"),
    "north": ("v_north_m_s", "vn_m_s"),
    "east": ("v_east_m_s", "ve_m_s"),
    "down": ("v_down_m_s", "vd_m_s"),
    "roll": ("roll_deg",),
    "pitch": ("pitch_deg",),
    "heading": ("heading_deg", "yaw_deg"),
    "qw": ("qw", "q_w", "orientation.w"),
    "qx": ("qx", "q_x", "orientation.x"),
    "qy": ("qy", "q_y", "orientation.y"),
    "qz": ("qz", "q_z", "orientation.z"),
}


@dataclass(frozen=True, eq=False)
class Track:
    """Positions at increasing times, with velocity and attitude where they are known.

    Attributes
    ----------
    source : str
        File, or topic.
    time_ns : ndarray of int64, shape (n,)
        Unix time, ns; in a text file, of the clock its times count on.
    lat, lon, h : ndarray, shape (n,)
        Geodetic, rad; m above the ellipsoid.
    v_eb_n : ndarray, shape (n, 3), or None
        m/s.
    q_nb : ndarray, shape (n, 4), or None
    notes : tuple of str
        What a reader of the numbers must know.
    """

    source: str
    time_ns: NDArray[np.int64]
    lat: Array
    lon: Array
    h: Array
    v_eb_n: Array | None = None
    q_nb: Array | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time_ns)


def track_of(aiding: Aiding, file: str) -> Track:
    """The valid rows of a topic, in the order of their times.

    Raises
    ------
    LogError
        Where it holds no positions over the ellipsoid, or none of them is valid.
    """
    notes = []
    valid = aiding.valid
    if aiding.lat is not None and aiding.lon is not None:
        lat, lon = aiding.lat, aiding.lon
        h = aiding.h
        if h is None:
            if aiding.h_msl is None:
                raise LogError("holds no heights", file=file, topic=aiding.topic)
            h = aiding.h_msl
            notes.append(
                f"the heights of {aiding.topic} are above mean sea level and are taken as they "
                "are: the geoid's height remains in the height error"
            )
    else:
        raise LogError(
            "holds no latitudes and longitudes, so nothing says where on the Earth it is",
            file=file,
            topic=aiding.topic,
        )
    if not valid.all():
        notes.append(f"{np.count_nonzero(~valid)} of {len(valid)} rows of {aiding.topic} invalid")
    order = np.flatnonzero(valid)[np.argsort(aiding.time_ns[valid], kind="stable")]
    if len(order):
        order = order[np.diff(aiding.time_ns[order], prepend=-(1 << 62)) > 0]
    if not len(order):
        raise LogError("holds no valid position", file=file, topic=aiding.topic)
    return Track(
        aiding.topic,
        aiding.time_ns[order],
        lat[order],
        lon[order],
        h[order],
        None if aiding.v_eb_n is None else aiding.v_eb_n[order],
        None if aiding.q_nb is None else aiding.q_nb[order],
        tuple(notes),
    )


def read_track_csv(path: Path) -> Track:
    """Read a text file of comma-separated columns named by its first line.

    Time in seconds (``unix_s``, ``time_s``) or nanoseconds (``time_ns``), ``latitude_deg``,
    ``longitude_deg`` and ``height_m`` (above the ellipsoid); where given ``v_north_m_s``,
    ``v_east_m_s``, ``v_down_m_s`` and ``roll_deg``, ``pitch_deg``, ``heading_deg`` or ``qw`` to
    ``qz`` (body forward-right-down over north-east-down).

    Raises
    ------
    LogError
        Naming the column that is missing, or the line that is wrong.
    """
    file = str(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as stream:
            lines = [cells for cells in csv.reader(stream) if any(cell.strip() for cell in cells)]
    except (UnicodeDecodeError, csv.Error) as error:
        raise LogError(f"is not text with comma-separated columns: {error}", file=file) from None
    if len(lines) < 2:
        raise LogError("holds no line below a header", file=file)
    header = [cell.strip() for cell in lines[0]]
    place = {}
    for what, names in _NAMES.items():
        found = next((name for name in names if name in header), None)
        if found is not None:
            place[what] = header.index(found)
    for what in ("lat", "lon", "h"):
        if what not in place:
            raise _missing(file, what, header)
    if "time" not in place and "time_ns" not in place:
        raise _missing(file, "time", header)
    for number, cells in enumerate(lines[1:], start=2):
        if len(cells) != len(header):
            raise LogError(
                f"line {number} has {len(cells)} cells, the header {len(header)}", file=file
            )

    def column(what: str) -> Array:
        k = place[what]
        out = np.empty(len(lines) - 1)
        for row, cells in enumerate(lines[1:]):
            try:
                out[row] = float(cells[k])
            except ValueError:
                out[row] = np.nan
            if not np.isfinite(out[row]):
                raise LogError(
                    f"line {row + 2}: column {header[k]} is {cells[k]!r}, not a finite number",
                    file=file,
                )
        return out

    def columns(*names: str) -> Array | None:
        if not all(name in place for name in names):
            return None
        return np.stack([column(name) for name in names], axis=1)

    time_ns = _times_ns(file, header, lines[1:], place)
    lat, lon = column("lat") * DEG, column("lon") * DEG
    if np.abs(lat).max() > np.pi / 2:
        row = int(np.argmax(np.abs(lat)))
        raise LogError(
            f"line {row + 2}: latitude {lat[row] / DEG:g} degrees is outside ±90; are latitude and "
            "longitude exchanged?",
            file=file,
        )
    q_nb = columns("qw", "qx", "qy", "qz")
    euler = columns("roll", "pitch", "heading")
    if q_nb is None and euler is not None:
        q_nb = quat_from_euler(*(euler.T * DEG))
    elif q_nb is not None:
        norm = np.linalg.norm(q_nb, axis=1, keepdims=True)
        if np.abs(norm - 1.0).max() > 1e-3:
            row = int(np.argmax(np.abs(norm - 1.0)))
            raise LogError(f"line {row + 2}: its quaternion has norm {norm[row, 0]:g}", file=file)
        q_nb = q_nb / norm
    return Track(path.name, time_ns, lat, lon, column("h"), columns("north", "east", "down"), q_nb)


def _missing(file: str, what: str, header: list[str]) -> LogError:
    return LogError(
        f"has no column {_NAMES[what][0]}; its header holds {', '.join(header)}", file=file
    )


def _times_ns(
    file: str, header: list[str], lines: list[list[str]], place: dict[str, int]
) -> NDArray[np.int64]:
    """Exact: seconds since 1970 in a double resolve 0.2 µs."""
    k = place.get("time_ns", place.get("time", 0))
    scale = 0 if "time_ns" in place else 9
    out = np.empty(len(lines), np.int64)
    for row, cells in enumerate(lines):
        try:
            out[row] = int(Decimal(cells[k].strip()).scaleb(scale, _EXACT).to_integral_value())
        except (InvalidOperation, ValueError, OverflowError):
            raise LogError(
                f"line {row + 2}: column {header[k]} is {cells[k]!r}, not a time", file=file
            ) from None
    late = np.flatnonzero(np.diff(out) <= 0)
    if late.size:
        raise LogError(
            f"line {late[0] + 3}: its time is not after that of the line before", file=file
        )
    return out
