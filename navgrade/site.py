"""The site file: what the survey and the sensor's sheet say, in TOML."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from align import KnownHeading, SensorErrors
from align.survey import parse_angle
from earth.rotation import quat_from_euler
from earth.units import DEG, DEG_PER_H, DEG_PER_RTH, UG, UG_PER_RTHZ
from navgrade.errors import ConfigError
from navgrade.imu import DV_FRAMES, DvFrame
from navgrade.logs import ImuFields
from navgrade.logs.schemas import Vector
from navgrade.state import NavState
from navgrade.vertical import (
    CLASSICAL_GAINS,
    DEFAULT_GAINS,
    QUANTITIES,
    REFERENCES,
    LoopGains,
    Quantity,
    Reference,
    gains_from_time_constant,
)

_Choice = TypeVar("_Choice", bound=str)

DEFAULT_HEADING_SIGMA = 1.0 * DEG  # of a known heading whose sigma nobody states

KEYS: dict[str, tuple[str, ...]] = {
    "": ("imu", "site", "alignment", "initial", "mechanization", "baro"),
    "imu": (
        "topic",
        "accel_topic",
        "kind",
        "axes",
        "gyro_unit",
        "accel_unit",
        "dv_frame",
        "rate_hz",
        "fields",
        "errors",
    ),
    "imu.fields": ("gyro", "accel", "time", "time_unit", "clock", "interval", "interval_unit"),
    "imu.errors": ("gyro_bias_deg_h", "accel_bias_ug", "arw_deg_rth", "vrw_ug_rthz"),
    "site": (
        "latitude",
        "longitude",
        "height_m",
        "orthometric_height_m",
        "geoid_height_m",
        "heading_deg",
        "heading_sigma_deg",
    ),
    "alignment": ("start_s", "duration_s"),
    "initial": (
        "time",
        "time_ns",
        "latitude",
        "longitude",
        "height_m",
        "velocity_ned_m_s",
        "roll_deg",
        "pitch_deg",
        "heading_deg",
    ),
    "mechanization": ("reconstruction", "frame", "vertical", "gravity", "disturbance"),
    "baro": ("topic", "field", "quantity", "time_constant_s", "gains", "reference"),
}


@dataclass(frozen=True)
class Place:
    """Where the IMU stood: rad, rad, m above the ellipsoid; and its heading where known."""

    lat: float
    lon: float
    h: float
    heading: KnownHeading | None = None


@dataclass(frozen=True)
class Window:
    """Alignment window, s from the first sample."""

    start: float
    duration: float


@dataclass(frozen=True)
class Initial:
    """A known state at a Unix time in ns; its `t` is not used."""

    time_ns: int
    state: NavState


@dataclass(frozen=True)
class BaroSettings:
    """Where the heights of the vertical loop are, and the loop.

    Attributes
    ----------
    topic, field, quantity : str or None
        Of `navgrade.logs.read_heights`.
    gains, reference
        Of `navgrade.vertical.BaroLoop`.
    """

    topic: str | None = None
    field: str | None = None
    quantity: Quantity | None = None
    gains: LoopGains = DEFAULT_GAINS
    reference: Reference = "start"


@dataclass(frozen=True)
class Site:
    """A site file, checked.

    Attributes
    ----------
    file : str
    text : bytes
        As read, for the attachment.
    topic, kind, axes, gyro_unit, accel_unit : str or None
    accel_topic : str or None
        Of the specific forces, where they have a topic of their own.
    rate_hz : float or None
        Of the IMU.
    fields : ImuFields or None
        Where the samples stand in messages of a type this program does not know.
    dv_frame : {"start", "end"} or None
        Of compensated velocity increments: resolved in b at the start or the end of the interval.
    errors : SensorErrors
    place, window : Place, Window or None
        Both, or `initial` instead.
    initial : Initial or None
    reconstruction, frame, vertical, gravity : str or None
    disturbance : Path or None
        Grid of gravity disturbances; in the file relative to its folder.
    baro : BaroSettings or None
    """

    file: str
    text: bytes
    topic: str | None = None
    kind: str | None = None
    axes: str | None = None
    gyro_unit: str | None = None
    accel_unit: str | None = None
    accel_topic: str | None = None
    rate_hz: float | None = None
    fields: ImuFields | None = None
    dv_frame: DvFrame | None = None
    errors: SensorErrors = field(default_factory=SensorErrors)
    place: Place | None = None
    window: Window | None = None
    initial: Initial | None = None
    reconstruction: str | None = None
    frame: str | None = None
    vertical: str | None = None
    gravity: str | None = None
    disturbance: Path | None = None
    baro: BaroSettings | None = None


class _Table:
    """One table of the file; takes its values with their types checked."""

    def __init__(self, file: str, path: str, values: Any) -> None:
        if not isinstance(values, Mapping):
            raise ConfigError(f"{path} must be a table, [{path}]", file=file, key=path)
        self.file = file
        self.path = path
        self.values = values
        for key in values:
            if key not in KEYS[path]:
                raise self.error(key, self._unknown(key))

    def _unknown(self, key: str) -> str:
        near = difflib.get_close_matches(key, KEYS[self.path], n=1, cutoff=0.0)
        where = f" in [{self.path}]" if self.path else ""
        return f"unknown key{where}; the nearest allowed key is {near[0]}"

    def error(self, key: str, text: str) -> ConfigError:
        path = f"{self.path}.{key}" if self.path else key
        return ConfigError(f"{path}: {text}", file=self.file, key=path)

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def text(self, key: str) -> str | None:
        value = self.values.get(key)
        if value is not None and not isinstance(value, str):
            raise self.error(key, f"must be text, got {value!r}")
        return value

    def choice(self, key: str, allowed: Iterable[_Choice]) -> _Choice | None:
        value = self.text(key)
        choices = list(allowed)
        for known in choices:
            if value == known:
                return known
        if value is None:
            return None
        raise self.error(key, f"{value!r} is not one of {', '.join(choices)}")

    def number(self, key: str, default: float | None = None, *, least: float = -math.inf) -> float:
        value = self.values.get(key, default)
        if value is None:
            raise self.error(key, "is required")
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.error(key, f"must be a number, got {value!r}")
        if not math.isfinite(value) or value < least:
            wanted = "finite" if least == -math.inf else f"finite and at least {least:g}"
            raise self.error(key, f"must be {wanted}, got {value!r}")
        return float(value)

    def positive(self, key: str) -> float | None:
        return self.number(key, least=0.0) if key in self else None

    def latitude(self) -> float:
        return self._angle("latitude", "N", "S", 90.0)

    def longitude(self) -> float:
        return self._angle("longitude", "E", "W", 360.0)

    def _angle(self, key: str, positive: str, negative: str, limit_deg: float) -> float:
        if key not in self:
            raise self.error(key, "is required")
        try:
            angle = parse_angle(self.values[key], positive, negative)
        except ValueError as error:
            raise self.error(key, str(error)) from None
        if not abs(angle) <= limit_deg * DEG:
            raise self.error(
                key, f"must be within ±{limit_deg:g} degrees, got {self.values[key]!r}"
            )
        return angle

    def height(self) -> float:
        ellipsoidal = "height_m" in self
        orthometric = "orthometric_height_m" in self
        if ellipsoidal and orthometric:
            raise self.error("height_m", "give it or orthometric_height_m, not both")
        if ellipsoidal and "geoid_height_m" in self:
            raise self.error("geoid_height_m", "belongs to orthometric_height_m, not to height_m")
        if ellipsoidal:
            return self.number("height_m")
        if orthometric:
            if "geoid_height_m" not in self:
                raise self.error(
                    "orthometric_height_m",
                    "is above sea level; navigation needs the height above the ellipsoid, so add "
                    "geoid_height_m (undulation at the site) or give height_m",
                )
            return self.number("orthometric_height_m") + self.number("geoid_height_m")
        raise self.error("height_m", "is required (above the ellipsoid)")


_TIME = re.compile(r"^(?P<whole>[^.]+?)(?:\.(?P<fraction>\d{1,9}))?(?P<zone>Z|[+-]\d\d:?\d\d)?$")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def parse_time_ns(value: object) -> int:
    """Unix time, ns, of ``2026-01-01T00:00:00.500Z`` or a TOML date-time; UTC if no zone.

    Raises
    ------
    ValueError
        If it is neither.
    """
    fraction = ""
    if isinstance(value, datetime):
        moment = value
    else:
        match = _TIME.match(value) if isinstance(value, str) else None
        if match is None:
            raise ValueError(f"{value!r} is not a time such as 2026-01-01T00:00:00.500Z")
        fraction = match["fraction"] or ""
        try:
            moment = datetime.fromisoformat(match["whole"] + (match["zone"] or ""))
        except ValueError:
            raise ValueError(f"{value!r} is not a time such as 2026-01-01T00:00:00.500Z") from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    span = moment - _EPOCH
    whole = (span.days * 86_400 + span.seconds) * 1_000_000_000 + span.microseconds * 1000
    return whole + int(fraction.ljust(9, "0"))


def read_site(path: str | Path) -> Site:
    """Read and check a site file.

    Raises
    ------
    ConfigError
        Naming the file, the key and, for an unknown key, the nearest allowed one.
    """
    path = Path(path)
    file = str(path)
    try:
        text = path.read_bytes()
        values = tomllib.loads(text.decode())
    except FileNotFoundError:
        raise ConfigError("no such site file", file=file) from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"cannot be read: {error}", file=file) from None
    root = _Table(file, "", values)
    tables = {name: _Table(file, name, values[name]) for name in values}
    imu = tables.get("imu", _Table(file, "imu", {}))
    mechanization = tables.get("mechanization", _Table(file, "mechanization", {}))
    disturbance = mechanization.text("disturbance")
    place = window = initial = None
    if "initial" in root:
        if "site" in root or "alignment" in root:
            raise root.error("initial", "stands instead of [site] and [alignment], not beside them")
        initial = _initial(tables["initial"])
    elif "site" in root:
        place = _place(tables["site"])
    if "alignment" in root:
        if place is None:
            raise root.error("site", "[alignment] needs the [site] it happens at")
        alignment = tables["alignment"]
        window = Window(
            alignment.number("start_s", 0.0, least=0.0), alignment.number("duration_s", least=2.0)
        )
    return Site(
        file=file,
        text=text,
        topic=imu.text("topic"),
        kind=imu.text("kind"),
        axes=imu.text("axes"),
        gyro_unit=imu.text("gyro_unit"),
        accel_unit=imu.text("accel_unit"),
        accel_topic=imu.text("accel_topic"),
        rate_hz=imu.positive("rate_hz"),
        fields=_fields(imu),
        dv_frame=imu.choice("dv_frame", DV_FRAMES),
        errors=_errors(_Table(file, "imu.errors", imu.values.get("errors", {}))),
        place=place,
        window=window,
        initial=initial,
        reconstruction=mechanization.text("reconstruction"),
        frame=mechanization.text("frame"),
        vertical=mechanization.text("vertical"),
        gravity=mechanization.text("gravity"),
        disturbance=None if disturbance is None else path.parent / disturbance,
        baro=_baro(tables["baro"]) if "baro" in tables else None,
    )


def _fields(imu: _Table) -> ImuFields | None:
    if "fields" not in imu:
        return None
    table = _Table(imu.file, "imu.fields", imu.values["fields"])

    def vector(key: str) -> Vector:
        value = table.values.get(key)
        if isinstance(value, list) and len(value) == 3 and all(isinstance(v, str) for v in value):
            return value[0], value[1], value[2]
        if isinstance(value, str):
            return value
        raise table.error(key, f"must be the path of a vector, or of its x, y and z, got {value!r}")

    texts = {
        key: text
        for key in KEYS["imu.fields"]
        if key not in ("gyro", "accel") and (text := table.text(key)) is not None
    }
    try:
        return ImuFields(vector("gyro"), vector("accel"), **texts)
    except ConfigError as error:
        raise ConfigError(str(error), file=table.file, key=error.key) from None


def _errors(table: _Table) -> SensorErrors:
    def scaled(key: str, unit: float) -> float | None:
        value = table.positive(key)
        return None if value is None else value * unit

    return SensorErrors(
        gyro_bias=scaled("gyro_bias_deg_h", DEG_PER_H),
        accel_bias=scaled("accel_bias_ug", UG),
        arw=scaled("arw_deg_rth", DEG_PER_RTH),
        vrw=scaled("vrw_ug_rthz", UG_PER_RTHZ),
    )


def _baro(table: _Table) -> BaroSettings:
    for needed in ("topic", "quantity"):
        if "field" in table and needed not in table:
            raise table.error(needed, "is required beside field")
    if "time_constant_s" in table and "gains" in table:
        raise table.error("gains", "give it or time_constant_s, not both")
    gains = DEFAULT_GAINS
    if "time_constant_s" in table:
        try:
            gains = gains_from_time_constant(table.number("time_constant_s"))
        except ValueError:
            value = table.values["time_constant_s"]
            raise table.error("time_constant_s", f"must be positive, got {value!r}") from None
    elif (name := table.choice("gains", CLASSICAL_GAINS)) is not None:
        gains = CLASSICAL_GAINS[name]
    return BaroSettings(
        topic=table.text("topic"),
        field=table.text("field"),
        quantity=table.choice("quantity", QUANTITIES),
        gains=gains,
        reference=table.choice("reference", REFERENCES) or "start",
    )


def _place(table: _Table) -> Place:
    heading = None
    if "heading_deg" in table:
        sigma = table.positive("heading_sigma_deg")
        heading = KnownHeading(
            table.number("heading_deg") * DEG,
            DEFAULT_HEADING_SIGMA if sigma is None else sigma * DEG,
        )
    elif "heading_sigma_deg" in table:
        raise table.error("heading_sigma_deg", "has no heading_deg to belong to")
    return Place(table.latitude(), table.longitude(), table.height(), heading)


def _initial(table: _Table) -> Initial:
    if ("time" in table) == ("time_ns" in table):
        raise table.error("time", "give time or time_ns, one of them")
    if "time_ns" in table:
        time_ns = table.values["time_ns"]
        if isinstance(time_ns, bool) or not isinstance(time_ns, int):
            raise table.error("time_ns", f"must be an integer, got {time_ns!r}")
    else:
        value = table.values["time"]
        try:
            if isinstance(value, date) and not isinstance(value, datetime):
                raise ValueError(f"{value!r} is a date without a time")
            time_ns = parse_time_ns(value)
        except ValueError as error:
            raise table.error("time", str(error)) from None
    velocity = table.values.get("velocity_ned_m_s", [0.0, 0.0, 0.0])
    try:
        v_eb_n = np.array(velocity, dtype=float)
    except (TypeError, ValueError):
        v_eb_n = np.empty(0)
    if v_eb_n.shape != (3,) or not np.all(np.isfinite(v_eb_n)):
        raise table.error("velocity_ned_m_s", f"must be three finite numbers, got {velocity!r}")
    angles = [table.number(key) * DEG for key in ("roll_deg", "pitch_deg", "heading_deg")]
    return Initial(
        time_ns,
        NavState(
            lat=table.latitude(),
            lon=table.longitude(),
            h=table.number("height_m"),
            v_eb_n=v_eb_n,
            q_nb=quat_from_euler(*angles),
        ),
    )
