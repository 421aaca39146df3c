"""Known trajectories: a topic of a log, or a table with one line for each instant."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Context, Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from earth.rotation import quat_from_euler
from earth.units import DEG
from navgrade.config import parse_time_ns
from navgrade.errors import ConfigError, LogError
from navgrade.logs.aiding import Aiding

Array = NDArray[np.float64]
Nanoseconds = NDArray[np.int64]

_EXACT = Context(prec=40)
_COLUMNS: dict[str, tuple[str, ...]] = {
    "lat": ("latitude_deg", "lat_deg", "latitude", "lat"),
    "lon": ("longitude_deg", "lon_deg", "longitude", "lon"),
    "h": ("height_m", "h_m"),
}
_TIMES = {"time_s": 9, "t_s": 9, "unix_s": 9, "time_ns": 0, "log_time_ns": 0}  # powers of ten to ns
_EULER = ("roll_deg", "pitch_deg", "heading_deg")
_QUATERNION = ("qw", "qx", "qy", "qz")
_VELOCITY = ("v_north_m_s", "v_east_m_s", "v_down_m_s")


@dataclass(frozen=True, eq=False)
class Track:
    """Positions, with times, velocity and attitude where they are known.

    Attributes
    ----------
    source : str
        File, or topic.
    lat, lon : ndarray, shape (n,)
        Geodetic, rad.
    h : ndarray, shape (n,), or None
        Above the ellipsoid, m.
    time_ns : ndarray of int64, shape (n,), or None
        ns, since 1970 where `is_unix`.
    is_unix : bool
    v_eb_n : ndarray, shape (n, 3), or None
        m/s.
    q_nb : ndarray, shape (n, 4), or None
        Scalar first.
    notes : tuple of str
        What a reader of the numbers must know, in sentences.
    """

    source: str
    lat: Array
    lon: Array
    h: Array | None
    time_ns: Nanoseconds | None = None
    is_unix: bool = False
    v_eb_n: Array | None = None
    q_nb: Array | None = None
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.lat)


def track_of(found: Aiding, path: str | Path) -> Track:
    """The valid rows of a topic, in the order of time.

    Raises
    ------
    LogError
        When none is valid, or they are not positions over the Earth.
    """
    if found.lat is None or found.lon is None:
        raise LogError(
            "holds no latitudes and longitudes, so nothing says where on the Earth it is",
            file=str(path),
            topic=found.topic,
        )
    keep, notes = usable_rows(found, path)
    h, v, q = found.h, found.v_eb_n, found.q_nb
    if h is None and found.h_msl is not None:
        h = found.h_msl
        notes.append(
            f"the heights of {found.topic} are above mean sea level and taken as they are: the "
            "geoid's height remains in the height error"
        )
    return Track(
        found.topic,
        found.lat[keep],
        found.lon[keep],
        None if h is None else h[keep],
        found.time_ns[keep],
        True,
        None if v is None else v[keep],
        None if q is None else q[keep],
        tuple(notes),
    )


def usable_rows(found: Aiding, path: str | Path) -> tuple[NDArray[np.intp], list[str]]:
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


def read_track_csv(path: Path) -> Track:
    """Read points from a table whose first line names its columns.

    ``latitude_deg`` (or lat_deg, latitude, lat), ``longitude_deg`` likewise, ``height_m`` (or h_m)
    above the ellipsoid; a time where there is one: ``time_s`` or ``t_s`` (from any zero),
    ``unix_s``, ``time_ns`` or ``log_time_ns`` (since 1970), or ``time``, such as
    2026-01-01T00:00:00Z; an
    attitude where there is one: ``roll_deg``, ``pitch_deg`` and ``heading_deg``, or ``qw``, ``qx``,
    ``qy``, ``qz``, which turn vectors of the body (forward-right-down) into north-east-down; a
    velocity likewise: ``v_north_m_s``, ``v_east_m_s``, ``v_down_m_s``. Other columns are left
    alone.

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
                raise path_error(
                    path, f"line {lines[i]}: {name} is {row[k]!r}, not a finite number"
                )
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
    time_ns, is_unix = _times(path, header, rows, lines)
    v_eb_n = q_nb = None
    if all(name in header for name in _VELOCITY):
        v_eb_n = np.stack([column(name) for name in _VELOCITY], axis=-1)
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
            raise path_error(
                path, f"line {lines[k]}: the quaternion has the norm {norm[k]:.6g}, not 1"
            )
        q_nb = values / norm[:, None]
    check_range(path, lat, lon, lambda k: f"line {lines[k]}")
    return Track(path.name, lat * DEG, lon * DEG, found["h"], time_ns, is_unix, v_eb_n, q_nb)


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
                    raise path_error(path, text)
                rows.append(row)
                lines.append(reader.line_num)
    except FileNotFoundError:
        raise path_error(path, "no such path file") from None
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise path_error(path, f"cannot be read: {error}") from None
    return header, rows, lines


def _times(
    path: Path, header: list[str], rows: list[list[str]], lines: list[int]
) -> tuple[Nanoseconds | None, bool]:
    """Times, exact to the nanosecond, and whether they count from 1970."""
    name = next((name for name in (*_TIMES, "time") if name in header), None)
    if name is None or not rows:
        return None, False
    k = header.index(name)
    out = np.empty(len(rows), np.int64)
    for i, (row, line) in enumerate(zip(rows, lines, strict=True)):
        text = row[k].strip()
        try:
            if name == "time":
                out[i] = parse_time_ns(text)
            else:
                value = Decimal(text).scaleb(_TIMES[name], _EXACT)
                if not _TIMES[name] and value != value.to_integral_value():
                    raise ValueError(f"{name} must hold whole nanoseconds, it is {text}")
                out[i] = int(value.to_integral_value())
        except InvalidOperation:
            raise path_error(
                path, f"line {line}: {name} is {text!r}, not a finite number"
            ) from None
        except (ValueError, OverflowError) as error:
            raise path_error(path, f"line {line}: {error}") from None
    return out, name not in ("time_s", "t_s")


def check_range(
    path: Path, lat_deg: Array, lon_deg: Array, where: Callable[[int], str], hint: str = ""
) -> None:
    for name, values, limit in (("latitude", lat_deg, 90.0), ("longitude", lon_deg, 360.0)):
        beyond = np.abs(values) > limit
        if beyond.any():
            k = int(np.argmax(beyond))
            raise path_error(
                path, f"{where(k)} has the {name} {values[k]:.6g}, beyond ±{limit:g}°{hint}"
            )


def _missing(path: Path, names: Sequence[str], header: list[str]) -> ConfigError:
    wanted = names[0] if len(names) == 1 else f"{names[0]} (or {', '.join(names[1:])})"
    held = ", ".join(header) or "none"
    return path_error(path, f"there is no column {wanted}; the columns are {held}")


def path_error(path: Path, text: str) -> ConfigError:
    """What is wrong with a file of positions."""
    return ConfigError(text, file=str(path))
