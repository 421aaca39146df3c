"""The site file: what the survey and the sensor's sheet say, in TOML."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from align import KnownHeading, SensorErrors
from earth.rotation import quat_from_euler
from earth.units import DEG, DEG_PER_H, DEG_PER_RTH, UG, UG_PER_RTHZ
from navgrade.config import Table, read_toml
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
    method: str | None = None
    false_alarm: float | None = None
    survey_notes: tuple[str, ...] = ()
    initial: Initial | None = None
    reconstruction: str | None = None
    frame: str | None = None
    vertical: str | None = None
    gravity: str | None = None
    disturbance: Path | None = None
    baro: BaroSettings | None = None


def read_site(path: str | Path) -> Site:
    """Read and check a site file.

    Raises
    ------
    ConfigError
        Naming the file, the key and, for an unknown key, the nearest allowed one.
    """
    path = Path(path)
    root, text = read_toml(path, KEYS, "site file")
    tables = {name: root.table(name) for name in KEYS[""]}
    imu, mechanization = tables["imu"], tables["mechanization"]
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
        file=root.file,
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
        errors=_errors(imu.table("errors")),
        place=place,
        window=window,
        initial=initial,
        reconstruction=mechanization.text("reconstruction"),
        frame=mechanization.text("frame"),
        vertical=mechanization.text("vertical"),
        gravity=mechanization.text("gravity"),
        disturbance=None if disturbance is None else path.parent / disturbance,
        baro=_baro(tables["baro"]) if "baro" in root else None,
    )


def _fields(imu: Table) -> ImuFields | None:
    if "fields" not in imu:
        return None
    table = imu.table("fields")

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


def _errors(table: Table) -> SensorErrors:
    def scaled(key: str, unit: float) -> float | None:
        value = table.positive(key)
        return None if value is None else value * unit

    return SensorErrors(
        gyro_bias=scaled("gyro_bias_deg_h", DEG_PER_H),
        accel_bias=scaled("accel_bias_ug", UG),
        arw=scaled("arw_deg_rth", DEG_PER_RTH),
        vrw=scaled("vrw_ug_rthz", UG_PER_RTHZ),
    )


def _baro(table: Table) -> BaroSettings:
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


def _place(table: Table) -> Place:
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


def _initial(table: Table) -> Initial:
    if ("time" in table) == ("time_ns" in table):
        raise table.error("time", "give time or time_ns, one of them")
    if "time_ns" in table:
        time_ns = table.values["time_ns"]
        if isinstance(time_ns, bool) or not isinstance(time_ns, int):
            raise table.error("time_ns", f"must be an integer, got {time_ns!r}")
    else:
        time_ns = table.time_ns("time")
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


def place_of_imu(place: Place, q_nb: Any) -> Place:
    """Interim."""
    return place
