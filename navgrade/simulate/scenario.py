"""The scenario file: a motion, an IMU on it and what is recorded, in TOML."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from earth.frames import C_bs
from earth.rotation import quat_from_euler
from earth.units import DEG
from navgrade.config import Table, read_toml
from navgrade.errors import ConfigError
from navgrade.imu import Kind
from navgrade.sensors import GRADES, SHEET, ImuErrors, imu_errors
from navgrade.simulate.bspline import BSpline, drawn_path
from navgrade.simulate.motion import Motion, Mounted
from navgrade.simulate.paths import SUFFIXES, TrackPoints, read_csv, read_geojson, read_log
from navgrade.simulate.segments import (
    Accelerate,
    BankToTurn,
    Climb,
    FigureEight,
    Rotate,
    Segments,
    Spiral,
    Start,
    Still,
    Straight,
    Turn,
)
from navgrade.simulate.sinusoids import Oscillation, Sinusoid, Sinusoids
from navgrade.simulate.vibration import Coning, Sculling, Shaking, Vibrating
from navgrade.simulate.waypoints import Waypoints

Array = NDArray[np.float64]

START_NS = 1_767_225_600_000_000_000  # 2026-01-01T00:00:00Z
TRUTH_RATE = 10.0  # Hz
FIX_RATE = 1.0  # Hz
FIX_SIGMA = 1.0, 2.0  # m, horizontal and vertical
SIMULATED_KINDS: tuple[Kind, ...] = ("increment", "average", "rate")
MAX_JITTER = 0.1  # of an interval, 1-sigma: with more, stamps would pass each other

_Fields = Mapping[str, tuple[str, float]]  # key: attribute, factor to SI
_RAMP = {"ramp_s": ("ramp", 1.0)}
_ROUND = {"radius_m": ("radius", 1.0), "rate_deg_s": ("rate", DEG), "banked": ("banked", 1.0)}
_SEGMENTS: Mapping[str, tuple[Callable[..., Any], _Fields]] = {
    "still": (Still, {"duration_s": ("duration", 1.0)}),
    "straight": (Straight, {"duration_s": ("duration", 1.0), "distance_m": ("distance", 1.0)}),
    "accelerate": (
        Accelerate,
        {
            "to_speed_m_s": ("to_speed", 1.0),
            "duration_s": ("duration", 1.0),
            "acceleration_m_s2": ("acceleration", 1.0),
            **_RAMP,
        },
    ),
    "turn": (
        Turn,
        {"angle_deg": ("angle", DEG), "duration_s": ("duration", 1.0), **_ROUND, **_RAMP},
    ),
    "climb": (
        Climb,
        {
            "height_m": ("height", 1.0),
            "angle_deg": ("angle", DEG),
            "duration_s": ("duration", 1.0),
            **_RAMP,
        },
    ),
    "figure-eight": (FigureEight, {**_ROUND, **_RAMP}),
    "spiral": (Spiral, {"turns": ("turns", 1.0), "height_m": ("height", 1.0), **_ROUND, **_RAMP}),
    "bank-to-turn": (
        BankToTurn,
        {"bank_deg": ("bank", DEG), "angle_deg": ("angle", DEG), **_RAMP},
    ),
    "rotate": (
        Rotate,
        {
            "axis": ("axis", 1.0),
            "angle_deg": ("angle", DEG),
            "rate_deg_s": ("rate", DEG),
            **_RAMP,
        },
    ),
}
_AMPLITUDE = {
    "acceleration_m_s2": ("acceleration", 1.0),
    "displacement_mm": ("displacement", 1e-3),
}
_WAVE = {"frequency_hz": ("frequency", 1.0), "phase_deg": ("phase", DEG)}
_VIBRATIONS: Mapping[str, tuple[Callable[..., Any], _Fields]] = {
    "coning": (Coning, {"half_angle_deg": ("half_angle", DEG), "axis": ("axis", 1.0), **_WAVE}),
    "sculling": (
        Sculling,
        {
            "angle_deg": ("angle", DEG),
            **_AMPLITUDE,
            "rotation_axis": ("rotation_axis", 1.0),
            "force_axis": ("force_axis", 1.0),
            "lead_deg": ("lead", DEG),
            **_WAVE,
        },
    ),
    "translation": (Shaking, {**_AMPLITUDE, "axis": ("axis", 1.0), **_WAVE}),
}

KEYS: dict[str, tuple[str, ...]] = {
    "": ("imu", "start", "segment", "path", "sinusoids", "vibration", "truth", "gnss"),
    "imu": (
        "rate_hz",
        "kind",
        "axes",
        "topic",
        "lever_arm_m",
        "mounting_deg",
        "jitter_us",
        "dropped",
        "dropped_spans_s",
        "grade",
        "seed",
        "errors",
    ),
    "imu.errors": tuple(SHEET),
    "start": (
        "time",
        "latitude",
        "longitude",
        "height_m",
        "orthometric_height_m",
        "geoid_height_m",
        "heading_deg",
        "speed_m_s",
        "roll_deg",
        "pitch_deg",
        "crab_deg",
    ),
    **{f"segment.{name}": ("type", *keys) for name, (_, keys) in _SEGMENTS.items()},
    **{f"vibration.{name}": ("type", *keys) for name, (_, keys) in _VIBRATIONS.items()},
    "path": (
        "file",
        "topic",
        "frame",
        "child",
        "height_m",
        "geoid_height_m",
        "method",
        "speed_m_s",
        "still_s",
    ),
    "sinusoids": ("duration_s", "term"),
    "sinusoids.term": ("coordinate", "amplitude_m", "amplitude_deg", "period_s", "phase_deg"),
    "truth": ("rate_hz",),
    "gnss": ("rate_hz", "horizontal_sigma_m", "vertical_sigma_m", "lever_arm_m"),
}
METHODS = ("interpolate", "b-spline")
_PLACE = ("latitude", "longitude", "height_m", "orthometric_height_m", "geoid_height_m")
_STILL = 60.0  # s, before a drawn path
_EVEN = 1e-3  # of an interval: poses whose steps differ by more are not equally spaced
_COORDINATES = {
    "north": "m",
    "east": "m",
    "up": "m",
    "roll": "deg",
    "pitch": "deg",
    "heading": "deg",
}


@dataclass(frozen=True, eq=False)
class Imu:
    """The IMU of a scenario.

    Attributes
    ----------
    rate_hz : float
    kind : {"increment", "average", "rate"}
    axes : str or None
        In the log; None for those usual for its messages.
    topic : str or None
    lever_arm_b : ndarray, shape (3,)
        From the vehicle's point, in the vehicle's axes, m.
    q_bs : ndarray, shape (4,)
        Mounting: the IMU's forward-right-down axes to the vehicle's.
    jitter : float
        1-sigma of the ends of its intervals, s.
    dropped : float
        Fraction of messages lost at random.
    dropped_spans : tuple of (float, float)
        s after the start, between which all messages are lost.
    grade : str or None
    errors : ImuErrors
    seed : int
        Of errors, jitter, losses and fixes.
    """

    rate_hz: float
    kind: Kind = "increment"
    axes: str | None = None
    topic: str | None = None
    lever_arm_b: Array = field(default_factory=lambda: np.zeros(3))
    q_bs: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    jitter: float = 0.0
    dropped: float = 0.0
    dropped_spans: tuple[tuple[float, float], ...] = ()
    grade: str | None = None
    errors: ImuErrors = field(default_factory=ImuErrors)
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Gnss:
    """A receiver: rate, 1-sigma of each horizontal axis and of height (m), and its antenna's lever
    arm from the vehicle's point, in the vehicle's axes, m."""

    rate_hz: float = FIX_RATE
    horizontal_sigma: float = FIX_SIGMA[0]
    vertical_sigma: float = FIX_SIGMA[1]
    lever_arm_b: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, eq=False)
class Scenario:
    """A scenario file, checked.

    Attributes
    ----------
    file : str
    text : bytes
        As read, for the attachment.
    motion : Motion
        Of the vehicle's point, vibration included.
    start_ns : int
        Unix time of the motion's start, ns.
    still : float
        s the vehicle stands at the start.
    imu : Imu
    truth_rate_hz : float
    gnss : Gnss or None
    notes : tuple of str
        What the reader of the path left out.
    """

    file: str
    text: bytes
    motion: Motion
    start_ns: int
    still: float
    imu: Imu
    truth_rate_hz: float = TRUTH_RATE
    gnss: Gnss | None = None
    notes: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Of the motion, s."""
        return self.motion.end - self.motion.start

    @property
    def imu_motion(self) -> Motion:
        """Of the IMU's own point and axes."""
        return Mounted(self.motion, self.imu.lever_arm_b, self.imu.q_bs)

    def with_seed(self, seed: int) -> Scenario:
        """The same with another seed."""
        return replace(self, imu=replace(self.imu, seed=seed))


def read_scenario(path: str | Path) -> Scenario:
    """Read and check a scenario file.

    Raises
    ------
    ConfigError
        Naming the file, the key and, for an unknown key, the nearest allowed one.
    LogError, SchemaError
        When its path is a topic that cannot be read.
    """
    path = Path(path)
    root, text = read_toml(path, KEYS, "scenario file")
    if "imu" not in root:
        raise root.error("imu", "is required: [imu] with rate_hz")
    given = [name for name in _MOTIONS if name in root]
    if len(given) != 1:
        raise root.error(
            given[1] if given else "segment",
            "a scenario needs one of [[segment]], [path] and [sinusoids], this one has "
            f"{' and '.join(given) or 'none'}",
        )
    motion, start_ns, still, notes = _MOTIONS[given[0]](root)
    vibrations = [_made(row, _VIBRATIONS) for row in root.rows("vibration", by="type")]
    if vibrations:
        motion, still = Vibrating(motion, vibrations), 0.0
    return Scenario(
        file=root.file,
        text=text,
        motion=motion,
        start_ns=start_ns,
        still=still,
        imu=_imu(root.table("imu"), motion.end - motion.start),
        truth_rate_hz=root.table("truth").number("rate_hz", TRUTH_RATE, above=0.0),
        gnss=_gnss(root.table("gnss")) if "gnss" in root else None,
        notes=notes,
    )


def _made(row: Table, kinds: Mapping[str, tuple[Callable[..., Any], _Fields]]) -> Any:
    """What a row of an array of tables describes."""
    make, keys = kinds[row.values["type"]]
    needed = {f.name for f in fields(make) if f.default is MISSING}  # type: ignore[arg-type]
    values: dict[str, Any] = {}
    for key, (attribute, factor) in keys.items():
        if key not in row:
            if attribute in needed:
                raise row.error(key, "is required")
        elif attribute == "banked":
            values[attribute] = row.flag(key)
        elif "axis" in attribute:
            values[attribute] = row.text(key)
        else:
            values[attribute] = row.number(key) * factor
    try:
        return make(**values)
    except ValueError as error:
        raise ConfigError(f"{row.name}: {error}", file=row.file, key=row.name) from None


_Read = tuple[Motion, int, float, tuple[str, ...]]


def _segments(root: Table) -> _Read:
    rows = root.rows("segment", by="type")
    if not rows:
        raise root.error("segment", "holds no segment")
    start, start_ns = _start(root)
    segments = [_made(row, _SEGMENTS) for row in rows]
    try:
        motion = Segments(start, segments)
    except ValueError as error:
        raise ConfigError(str(error), file=root.file, key="segment") from None
    still = 0.0
    for segment in segments:
        if not isinstance(segment, Still):
            break
        still += segment.duration
    return motion, start_ns, still, ()


def _start(root: Table) -> tuple[Start, int]:
    if "start" not in root:
        raise root.error("start", "is required: [start] with latitude, longitude and height_m")
    table = root.table("start")
    try:
        start = Start(
            lat=table.latitude(),
            lon=table.longitude(),
            h=table.height(),
            heading=table.number("heading_deg", 0.0) * DEG,
            speed=table.number("speed_m_s", 0.0, least=0.0),
            roll=table.number("roll_deg", 0.0) * DEG,
            pitch=table.number("pitch_deg", 0.0) * DEG,
            crab=table.number("crab_deg", 0.0) * DEG,
        )
    except ValueError as error:
        raise ConfigError(str(error), file=root.file, key="start") from None
    return start, _time_ns(table, START_NS)


def _time_ns(table: Table, default: int) -> int:
    return table.time_ns("time") if "time" in table else default


def _sinusoids(root: Table) -> _Read:
    start, start_ns = _start(root)
    table = root.table("sinusoids")
    course = start.heading - start.crab
    means = {
        "north": (0.0, start.speed * np.cos(course)),
        "east": (0.0, start.speed * np.sin(course)),
        "roll": (start.roll, 0.0),
        "pitch": (start.pitch, 0.0),
        "heading": (start.heading, 0.0),
    }
    terms: dict[str, list[Sinusoid]] = {name: [] for name in _COORDINATES}
    for row in table.rows("term"):
        name = row.required("coordinate", row.choice("coordinate", _COORDINATES))
        unit = _COORDINATES[name]
        for other in {"m", "deg"} - {unit}:
            if f"amplitude_{other}" in row:
                raise row.error(f"amplitude_{other}", f"{name} has an amplitude_{unit}")
        amplitude = row.number(f"amplitude_{unit}") * (DEG if unit == "deg" else 1.0)
        period = row.number("period_s", above=0.0)
        terms[name].append(Sinusoid(amplitude, 1.0 / period, row.number("phase_deg", 0.0) * DEG))
    if not any(terms.values()):
        raise table.error("term", "is required: [[sinusoids.term]] with coordinate and amplitude")
    try:
        motion = Sinusoids(
            start.lat,
            start.lon,
            start.h,
            table.number("duration_s", above=0.0),
            **{
                name: Oscillation(*means.get(name, (0.0, 0.0)), tuple(found))
                for name, found in terms.items()
            },
        )
    except ValueError as error:
        raise ConfigError(f"sinusoids: {error}", file=root.file, key="sinusoids") from None
    return motion, start_ns, 0.0, ()


def _path(root: Table) -> _Read:
    table, start = root.table("path"), root.table("start")
    allowed = {"time", *(_PLACE if "frame" in table else ())}
    for key in start.values:
        if key not in allowed:
            raise start.error(key, "is not for a [path], which has its own")
    points = _points(table, start)
    if not len(points):
        raise ConfigError("holds no point", file=str(_path_file(table)))
    h = points.h
    if "height_m" in table:
        if h is not None:
            raise table.error("height_m", "the points have heights of their own; leave it out")
        h = np.full(len(points), table.number("height_m"))
    if h is None:
        raise table.error("height_m", "is required: the path has no heights (above the ellipsoid)")
    drawn = points.t is None
    for key, of_drawn in (("speed_m_s", True), ("still_s", True), ("method", False)):
        if key in table and of_drawn is not drawn:
            raise table.error(
                key, "is for a path without times" if of_drawn else "is for a path with times"
            )
    try:
        motion, still = _along(table, points, h)
    except ValueError as error:
        raise ConfigError(str(error), file=str(_path_file(table)), key="path.file") from None
    first_ns = START_NS if points.time_ns is None else points.time_ns + round(motion.start * 1e9)
    return motion, _time_ns(start, first_ns), still, points.notes


def _along(table: Table, points: TrackPoints, h: Array) -> tuple[Motion, float]:
    """The motion through or near points, and how long it stands first."""
    lat, lon, t, q_nb = points.lat, points.lon, points.t, points.q_nb
    if t is None:
        still = table.number("still_s", _STILL, least=0.0)
        speed = table.number("speed_m_s", above=0.0)
        return cast(Motion, drawn_path(lat, lon, h, speed, still=still)), still
    if table.choice("method", METHODS) != "b-spline":
        return Waypoints(t, lat, lon, h, q_nb), 0.0
    if q_nb is None:
        raise table.error("method", "b-spline needs the attitudes of the points; use interpolate")
    dt = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    uneven = np.abs(np.diff(t) - dt) > _EVEN * dt
    if uneven.any():
        k = int(np.argmax(uneven))
        raise table.error(
            "method",
            f"b-spline needs points at equal intervals, but from point {k + 1} to {k + 2} it is "
            f"{t[k + 1] - t[k]:g} s instead of {dt:g} s; use interpolate",
        )
    return cast(Motion, BSpline(0.0, dt, lat, lon, h, q_nb)), 0.0


def _path_file(table: Table) -> Path:
    name = table.required("file", table.text("file"))
    return Path(table.file).parent / name


def _points(table: Table, start: Table) -> TrackPoints:
    file = _path_file(table)
    if file.suffix not in SUFFIXES:
        raise table.error("file", f"{file.name} does not end in {', '.join(SUFFIXES)}")
    geoid = table.optional("geoid_height_m")
    topic = table.text("topic")
    if file.suffix != ".mcap":
        for key in ("topic", "frame", "child"):
            if key in table:
                raise table.error(key, f"is about a log, but {file.name} is none")
        points = read_csv(file) if file.suffix == ".csv" else read_geojson(file)
        if geoid is not None:
            if points.h is None:
                raise table.error("geoid_height_m", "the points have no heights to add it to")
            points = replace(points, h=points.h + geoid)
        return points
    origin = None
    if "latitude" in start:
        origin = start.latitude(), start.longitude(), start.height()
    return read_log(
        file,
        table.required("topic", topic),
        geoid_height=geoid,
        frame=table.text("frame"),
        child=table.text("child"),
        origin=origin,
    )


_MOTIONS: Mapping[str, Callable[[Table], _Read]] = {
    "segment": _segments,
    "path": _path,
    "sinusoids": _sinusoids,
}


def _imu(table: Table, duration: float) -> Imu:
    rate_hz = table.number("rate_hz", above=0.0)
    if duration * rate_hz < 1.0 - 1e-9:
        raise table.error(
            "rate_hz", f"the motion takes {duration:g} s, less than one sample at {rate_hz:g} Hz"
        )
    axes = table.text("axes")
    if axes is not None:
        try:
            C_bs(axes)
        except ValueError as error:
            raise table.error("axes", str(error)) from None
    jitter = table.number("jitter_us", 0.0, least=0.0) * 1e-6
    if jitter * rate_hz > MAX_JITTER:
        raise table.error(
            "jitter_us",
            f"must be at most a tenth of the interval, {1e6 * MAX_JITTER / rate_hz:g} us, got "
            f"{jitter * 1e6:g}",
        )
    dropped = table.number("dropped", 0.0, least=0.0)
    if not dropped < 1.0:
        raise table.error("dropped", f"must be a fraction from 0 to below 1, got {dropped:g}")
    grade = table.choice("grade", GRADES)
    sheet: dict[str, Any] = dict(GRADES[grade].values) if grade else {}
    errors = table.table("errors")
    for key in errors.values:
        sheet[key] = _sheet_value(errors, key)
    try:
        found = imu_errors(sheet)
    except ValueError as error:
        raise ConfigError(f"imu.errors: {error}", file=table.file, key="imu.errors") from None
    return Imu(
        rate_hz=rate_hz,
        kind=table.choice("kind", SIMULATED_KINDS) or "increment",
        axes=axes,
        topic=table.text("topic"),
        lever_arm_b=np.array(table.numbers("lever_arm_m", 3, (0.0, 0.0, 0.0))),
        q_bs=quat_from_euler(*(np.array(table.numbers("mounting_deg", 3, (0.0, 0.0, 0.0))) * DEG)),
        jitter=jitter,
        dropped=dropped,
        dropped_spans=_spans(table, duration),
        grade=grade,
        errors=found,
        seed=table.integer("seed", 0),
    )


def _sheet_value(errors: Table, key: str) -> float | list[float]:
    value = errors.values[key]
    if isinstance(value, list):
        return errors.numbers(key, SHEET[key].count)
    return errors.number(key)


def _spans(table: Table, duration: float) -> tuple[tuple[float, float], ...]:
    spans = table.values.get("dropped_spans_s", [])
    if not isinstance(spans, list):
        raise table.error("dropped_spans_s", f"must be a list of [from, to], got {spans!r}")
    found = []
    for number, span in enumerate(spans, 1):
        pair = isinstance(span, list) and len(span) == 2
        if not pair or not all(
            isinstance(x, (int, float)) and not isinstance(x, bool) for x in span
        ):
            raise table.error("dropped_spans_s", f"span {number} must be [from, to], got {span!r}")
        begin, end = float(span[0]), float(span[1])
        if not 0.0 <= begin < end <= duration:
            raise table.error(
                "dropped_spans_s",
                f"span {number} must increase and lie within the {duration:g} s of the motion, got "
                f"{span!r}",
            )
        found.append((begin, end))
    return tuple(found)


def _gnss(table: Table) -> Gnss:
    return Gnss(
        rate_hz=table.number("rate_hz", FIX_RATE, above=0.0),
        horizontal_sigma=table.number("horizontal_sigma_m", FIX_SIGMA[0], least=0.0),
        vertical_sigma=table.number("vertical_sigma_m", FIX_SIGMA[1], least=0.0),
        lever_arm_b=np.array(table.numbers("lever_arm_m", 3, (0.0, 0.0, 0.0))),
    )
