"""Positions, velocities and attitudes of a log, for comparison and aiding."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from earth.rotation import quat_from_euler
from navgrade.errors import ConfigError, LogError, SchemaError
from navgrade.logs.container import Issue, McapFile
from navgrade.logs.container.layout import NO_TIME
from navgrade.logs.schemas import AIDING_SCHEMAS, AidingSchema
from navgrade.logs.schemas.aiding import Triple
from navgrade.logs.times import least_delay_ns
from navgrade.logs.topics import find_topic, list_topics

Array = NDArray[np.float64]
Fields = Mapping[str, NDArray[Any]]
_ELEMENTS = 8  # of an array of structures, read at once


@dataclass(frozen=True, eq=False)
class Aiding:
    """Positions, velocities and attitudes of one topic, in file order; None where it holds none.

    Attributes
    ----------
    topic, schema : str
    time_ns : ndarray of int64, shape (n,)
        Unix time, ns.
    valid : ndarray of bool, shape (n,)
        The receiver says that this is a solution, and its numbers are finite.
    lat, lon : ndarray, shape (n,), or None
        Geodetic, rad.
    h : ndarray, shape (n,), or None
        Above the ellipsoid, m.
    h_msl : ndarray, shape (n,), or None
        Above mean sea level, m; never the same as `h`.
    sigma_r_n : ndarray, shape (n, 3), or None
        Of the position along north, east, down, m; NaN where unknown.
    v_eb_n, sigma_v_n : ndarray, shape (n, 3), or None
        Velocity, m/s.
    q_nb : ndarray, shape (n, 4), or None
        Attitude of body forward-right-down over north-east-down.
    sigma_euler : ndarray, shape (n, 3), or None
        Of roll, pitch and heading, rad.
    frame, child : ndarray of str, shape (n,), or None
        Frames of what follows.
    r : ndarray, shape (n, 3), or None
        Position of the child in the frame, m.
    q : ndarray, shape (n, 4), or None
        Turns vectors of the child into the frame; scalar first.
    v : ndarray, shape (n, 3), or None
        Velocity, in the child, m/s.
    sigma_r : ndarray, shape (n, 3), or None
        Of `r`, m; NaN where unknown.
    clock_offset_ns : int
        What was added to the times of a clock that does not count from 1970.
    issues : list of Issue
        Defects of the file.
    """

    topic: str
    schema: str
    time_ns: NDArray[np.int64]
    valid: NDArray[np.bool_]
    lat: Array | None
    lon: Array | None
    h: Array | None
    h_msl: Array | None
    sigma_r_n: Array | None
    v_eb_n: Array | None
    sigma_v_n: Array | None
    q_nb: Array | None
    sigma_euler: Array | None
    frame: NDArray[np.object_] | None
    child: NDArray[np.object_] | None
    r: Array | None
    q: Array | None
    v: Array | None
    sigma_r: Array | None
    clock_offset_ns: int
    issues: list[Issue]

    def __len__(self) -> int:
        return len(self.time_ns)


def read_aiding(
    path: str | Path,
    topic: str,
    *,
    msl: bool = False,
    frame: str | None = None,
    child: str | None = None,
    clock_offset_ns: int | None = None,
    strict: bool = False,
) -> Aiding:
    """Read a whole topic of positions, velocities or attitudes into memory.

    Parameters
    ----------
    path : path or URL
    topic : str
    msl : bool
        The heights are above mean sea level, whatever the definition says; they become `h_msl`.
    frame, child : str, optional
        Only messages, or transforms, of these frames.
    clock_offset_ns : int, optional
        Of a clock that does not count from 1970, such as `ImuLog.clock_offset_ns` of the same
        device, which keeps the two in step. By default it is tied to log time by the least delay
        of this topic's own first messages.
    strict : bool
        Refuse a damaged file instead of using what it still holds.

    Raises
    ------
    LogError, SchemaError
        When the log or the topic cannot be read, or nothing is of the frames asked for.
    ConfigError
        When `msl` or a frame is asked for of messages that have none.
    """
    name = find_topic(path, list_topics(path), topic).schema
    schemas = [schema for schema in AIDING_SCHEMAS if schema.name == name]
    if not schemas:
        known = ", ".join(dict.fromkeys(schema.name for schema in AIDING_SCHEMAS))
        raise SchemaError(
            f"schema {name or '(none)'} holds no position this program reads (it reads {known})",
            file=str(path),
            topic=topic,
        )
    schema, issues, log_ns, fields = _read(path, topic, schemas, strict)
    if msl and (schema.h is None or schema.h_msl is not None):
        raise ConfigError(f"{name} says what its heights are; leave msl out")
    time_ns = schema.clock.times_ns(fields)
    if schema.clock.unix:
        clock_offset_ns = 0
    elif clock_offset_ns is None:
        clock_offset_ns = least_delay_ns(time_ns, log_ns)
    try:
        keep = _of_frames(schema, fields, frame, child)
    except LogError as error:
        raise LogError(str(error), file=str(path), topic=topic) from None
    found = _solutions(schema, {path: column[keep] for path, column in fields.items()})
    if msl:
        found["h"], found["h_msl"] = None, found["h"]
    return Aiding(
        topic=topic,
        schema=name,
        time_ns=time_ns[keep] + clock_offset_ns,
        clock_offset_ns=clock_offset_ns,
        issues=issues,
        **found,
    )


def _read(
    path: str | Path, topic: str, schemas: list[AidingSchema], strict: bool
) -> tuple[AidingSchema, list[Issue], NDArray[np.int64], Fields]:
    """Columns of the first entry whose members the messages have."""
    refusals = []
    for schema in schemas:
        try:
            read = _elements if schema.each else _whole
            return schema, *read(path, topic, schema, strict)
        except SchemaError as error:
            refusals.append(error)
    raise refusals[0]


def _paths(schema: AidingSchema) -> list[str]:
    """Members an entry reads."""
    paths = list(schema.clock.paths)
    for scaled in (schema.lat, schema.lon, schema.h, schema.h_msl):
        paths += [scaled[0]] if scaled else []
    triples = (schema.sigma_r_n, schema.v_eb_n, schema.sigma_v_n, schema.euler, schema.sigma_euler)
    for triple in triples:
        paths += [path for path, _ in triple or ()]
    paths += schema.covariance or ()
    for path in (
        schema.undulation,
        schema.velocity_valid,
        schema.r,
        schema.v,
        schema.q,
        schema.pose_covariance,
        schema.frame,
        schema.child,
        schema.valid.path if schema.valid else None,
    ):
        paths += [path] if path else []
    return list(dict.fromkeys(paths))


def _columns(
    path: str | Path, topic: str, paths: list[str], strict: bool
) -> tuple[list[Issue], NDArray[np.int64], Fields]:
    """All messages of a topic."""
    file = McapFile(path, strict=strict)
    parts = list(file.columns({topic: paths}))
    if not parts:
        raise LogError("no message of it is in the log", file=str(path), topic=topic)
    fields = {p: np.concatenate([part.fields[p] for part in parts]) for p in paths}
    return file.issues, np.concatenate([part.log_time_ns for part in parts]), fields


def _whole(
    path: str | Path, topic: str, schema: AidingSchema, strict: bool
) -> tuple[list[Issue], NDArray[np.int64], Fields]:
    return _columns(path, topic, _paths(schema), strict)


def _elements(
    path: str | Path, topic: str, schema: AidingSchema, strict: bool
) -> tuple[list[Issue], NDArray[np.int64], Fields]:
    """All elements of the array in each message, a row each."""
    own = _paths(schema)
    (stamp,) = schema.clock.paths
    columns: dict[str, list[NDArray[Any]]] = {p: [] for p in own}
    more = True
    while more:
        first = len(columns[stamp])
        elements = range(first, first + _ELEMENTS)
        paths = [f"{schema.each}.{k}.{p}" for k in elements for p in own]
        issues, log_ns, fields = _columns(path, topic, paths, strict)
        for k in elements:
            for p in own:
                columns[p].append(fields[f"{schema.each}.{k}.{p}"])
        more = bool(np.any(columns[stamp][-1] != NO_TIME))
    there = np.stack(columns[stamp], axis=1) != NO_TIME
    rows, _ = np.nonzero(there)
    return issues, log_ns[rows], {p: np.stack(c, axis=1)[there] for p, c in columns.items()}


def _solutions(schema: AidingSchema, fields: Fields) -> dict[str, Any]:
    """The attributes of an `Aiding` but for its time."""
    count = len(next(iter(fields.values())))

    def scaled(of: tuple[str, float] | None) -> Array | None:
        return None if of is None else fields[of[0]] * of[1]

    def triple(of: Triple | None) -> Array | None:
        return None if of is None else np.column_stack([fields[path] * unit for path, unit in of])

    h, h_msl = scaled(schema.h), scaled(schema.h_msl)
    if schema.undulation is not None and h_msl is not None:
        h = h_msl + fields[schema.undulation]
    sigma_r_n = triple(schema.sigma_r_n)
    if schema.covariance is not None:
        values, kind = (fields[path] for path in schema.covariance)
        sigma_r_n = _sigmas(values, (4, 0, 8), kind != 0)
    v_eb_n = triple(schema.v_eb_n)
    if schema.velocity_valid is not None and v_eb_n is not None:
        v_eb_n[~fields[schema.velocity_valid].astype(bool)] = np.nan
    euler = triple(schema.euler)
    q = fields[schema.q][:, [3, 0, 1, 2]] if schema.q else None
    sigma_r = None
    if schema.pose_covariance is not None:
        values = fields[schema.pose_covariance]
        sigma_r = _sigmas(values, (0, 7, 14), np.any(values != 0.0, axis=1))
    r = fields[schema.r] if schema.r else None
    lat, lon = scaled(schema.lat), scaled(schema.lon)
    valid = np.ones(count, bool)
    if schema.valid is not None:
        valid &= schema.valid.holds(fields[schema.valid.path])
    for column in (lat, lon, h, r, q):
        if column is not None:
            valid &= np.isfinite(column.reshape(count, -1)).all(axis=1)
    return {
        "valid": valid,
        "lat": lat,
        "lon": lon,
        "h": h,
        "h_msl": h_msl,
        "sigma_r_n": sigma_r_n,
        "v_eb_n": v_eb_n,
        "sigma_v_n": triple(schema.sigma_v_n),
        "q_nb": None if euler is None else quat_from_euler(*euler.T),
        "sigma_euler": triple(schema.sigma_euler),
        "frame": fields[schema.frame] if schema.frame else None,
        "child": fields[schema.child] if schema.child else None,
        "r": r,
        "q": q,
        "v": fields[schema.v] if schema.v else None,
        "sigma_r": sigma_r,
    }


def _sigmas(covariance: Array, diagonal: tuple[int, int, int], known: NDArray[np.bool_]) -> Array:
    """Standard deviations, NaN where they are not known."""
    sigmas = np.full((len(covariance), 3), np.nan)
    if covariance.ndim == 2 and covariance.shape[1] > max(diagonal):
        variances = covariance[:, diagonal]
        known = known[:, None] & (variances >= 0.0)
        np.sqrt(variances, out=sigmas, where=known)
    return sigmas


def _of_frames(
    schema: AidingSchema, fields: Fields, frame: str | None, child: str | None
) -> NDArray[np.bool_]:
    """Which rows are of these frames."""
    keep = np.ones(len(next(iter(fields.values()))), bool)
    for name, wanted, path in (("frame", frame, schema.frame), ("child", child, schema.child)):
        if wanted is None:
            continue
        if path is None:
            raise ConfigError(f"{schema.name} names no {name}; leave it out")
        keep &= fields[path] == wanted
        if not keep.any():
            held = ", ".join(sorted(set(fields[path])))
            raise LogError(f"nothing there has the {name} {wanted}; there is {held}")
    return keep
