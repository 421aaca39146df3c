"""The site file: what the survey and the sensor's sheet say, in TOML."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from align import KnownHeading, SensorErrors
from align.survey import (
    KINDS,
    HeightKind,
    Mark,
    SurveyError,
    azimuth_between,
    choose,
    displaced,
    geodetic_from_xyz,
    read_marks,
    site_warning,
    stated_azimuth,
)
from earth.rotation import dcm_from_quat, quat_from_euler
from earth.units import ARCSEC, DEG, DEG_PER_H, DEG_PER_RTH, UG, UG_PER_RTHZ
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

_FAR = 100e3 / 6.4e6  # rad: no line of sight, nor any that is carried on from it
DEFAULT_HEADING_SIGMA = 1.0 * DEG  # of a known heading whose sigma nobody states

KEYS: dict[str, tuple[str, ...]] = {
    "": ("imu", "site", "azimuth", "alignment", "initial", "mechanization", "baro"),
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
        "height_kind",
        "xyz_m",
        "marks",
        "mark",
        "datum",
        "lever_arm_b_m",
        "lever_arm_ned_m",
        "lever_arm_enu_m",
        "heading_deg",
        "heading_sigma_deg",
    ),
    "azimuth": (
        "from",
        "to",
        "deg",
        "sigma_deg",
        "sigma_arcsec",
        "kind",
        "grid",
        "declination_deg",
        "declination_sigma_deg",
        "deflection_arcsec",
        "zenith_deg",
        "turned_deg",
        "mounting_deg",
        "mounting_sigma_deg",
    ),
    "alignment": ("method", "start_s", "duration_s", "false_alarm"),
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
    """Where the IMU stood: rad, rad, m above the ellipsoid; and its heading where known.

    With a lever arm in body axes (m, forward-right-down, from the mark to the IMU) it is the mark's
    place; `place_of_imu` goes on to the IMU's once the attitude is known.
    """

    lat: float
    lon: float
    h: float
    heading: KnownHeading | None = None
    lever_arm_b: tuple[float, float, float] | None = None


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
        Place, or `initial` instead; without a window the alignment finds the best still stretch.
    method : str or None
        Of the alignment.
    false_alarm : float or None
        Of the search for still stretches: probability that a still one is taken for disturbed.
    marks : Path or None
        The surveyor's file; in the site file relative to its folder.
    survey : tuple of str
        How place and heading came about.
    survey_notes : tuple of str
        Warnings: what has to be said of frames, heights and marks.
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
    method: str | None = None
    false_alarm: float | None = None
    marks: Path | None = None
    survey: tuple[str, ...] = ()
    survey_notes: tuple[str, ...] = ()
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
    survey = _Survey()
    alignment = tables["alignment"]
    if "initial" in root:
        if "site" in root or "alignment" in root:
            raise root.error("initial", "stands instead of [site] and [alignment], not beside them")
        initial = _initial(tables["initial"])
    elif "site" in root:
        survey = _survey(tables["site"], path.parent)
        place = _place(tables["site"], tables["azimuth"], "azimuth" in root, survey)
    for key, what in (("alignment", "happens"), ("azimuth", "holds")):
        if key in root and place is None:
            raise root.error("site", f"[{key}] needs the [site] it {what} at")
    if "start_s" in alignment or "duration_s" in alignment:
        window = Window(
            alignment.number("start_s", 0.0, least=0.0), alignment.number("duration_s", least=2.0)
        )
    false_alarm = alignment.optional("false_alarm", above=0.0)
    if false_alarm is not None and false_alarm >= 1.0:
        raise alignment.error("false_alarm", f"must be between 0 and 1, got {false_alarm!r}")
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
        method=alignment.text("method"),
        false_alarm=false_alarm,
        marks=survey.file,
        survey=tuple(survey.said),
        survey_notes=tuple(dict.fromkeys(survey.warnings)),
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
    return SensorErrors(
        gyro_bias=_scaled(table.positive("gyro_bias_deg_h"), DEG_PER_H),
        accel_bias=_scaled(table.positive("accel_bias_ug"), UG),
        arw=_scaled(table.positive("arw_deg_rth"), DEG_PER_RTH),
        vrw=_scaled(table.positive("vrw_ug_rthz"), UG_PER_RTHZ),
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


def place_of_imu(place: Place, q_nb: ArrayLike) -> Place:
    """The IMU's own place, over the lever arm in body axes, at attitude `q_nb`."""
    if place.lever_arm_b is None:
        return place
    arm_n = dcm_from_quat(q_nb) @ np.array(place.lever_arm_b)
    return Place(*displaced(place.lat, place.lon, place.h, arm_n), place.heading)


@dataclass
class _Survey:
    """What the surveyor handed over, and what came of it so far."""

    file: Path | None = None
    marks: list[Mark] = field(default_factory=list)
    mark: Mark | None = None  # of the site
    said: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


@contextmanager
def _refusing(table: Table, key: str) -> Iterator[None]:
    """What survey data refuse, as an error of a key."""
    try:
        yield
    except SurveyError as error:
        raise table.error(key, str(error)) from None


def _survey(site: Table, folder: Path) -> _Survey:
    """The marks, and the one the site names."""
    survey = _Survey()
    if (name := site.text("marks")) is not None:
        survey.file = folder / name
        with _refusing(site, "marks"):
            survey.marks = read_marks(survey.file)
    if (name := site.text("mark")) is not None:
        survey.mark = _mark(site, "mark", name, survey)
    return survey


def _mark(table: Table, key: str, name: str, survey: _Survey) -> Mark:
    if survey.file is None:
        raise table.error(key, "is a mark of a file; give it as marks in [site]")
    with _refusing(table, key):
        return choose(survey.marks, name)


# what stands instead of what
_INSTEAD = {
    "mark": ("xyz_m", "latitude", "longitude"),
    "xyz_m": ("latitude", "longitude", "height_m", "orthometric_height_m", "geoid_height_m"),
    "height_kind": ("height_m", "orthometric_height_m"),
}


def _place(site: Table, azimuth: Table, surveyed: bool, survey: _Survey) -> Place:
    """Place and heading; what the survey says of them goes into `survey`."""
    for whole, parts in _INSTEAD.items():
        for part in parts:
            if whole in site and part in site:
                raise site.error(whole, f"give it or {part}, not both")
    datum = site.text("datum")
    if survey.mark is not None:
        mark = survey.mark
        if datum is not None and mark.frame not in (None, datum):
            raise site.error("datum", f"the file of mark {mark.name} says {mark.frame}")
        frame = mark.frame or datum
        lat, lon, h = mark.lat, mark.lon, _height(site, mark)
        what = f"mark {mark.name} ({mark.source})"
        survey.warnings += [f"{mark.name}: {note}" for note in mark.notes]
        epoch = "" if mark.epoch is None else f" at epoch {mark.epoch:.1f}"
        survey.said.append(f"place: {what} in {frame or 'a frame not named'}{epoch}")
    else:
        frame, what = datum, "the site"
        if "height_kind" in site:
            raise site.error("height_kind", "is for the height of a mark")
        if "xyz_m" in site:
            with _refusing(site, "xyz_m"):
                lat, lon, h = geodetic_from_xyz(site.numbers("xyz_m", 3))
        else:
            lat, lon, h = site.latitude(), site.longitude(), site.height()
    if (warning := site_warning(what, frame)) is not None:
        survey.warnings.append(warning)
    arms = [key for key in site.values if key.startswith("lever_arm_")]
    if len(arms) > 1:
        raise site.error(arms[1], f"give it or {arms[0]}, not both")
    if "lever_arm_ned_m" in site:
        lat, lon, h = displaced(lat, lon, h, site.numbers("lever_arm_ned_m", 3), "NED")
    elif "lever_arm_enu_m" in site:
        lat, lon, h = displaced(lat, lon, h, site.numbers("lever_arm_enu_m", 3), "ENU")
    place = Place(lat, lon, h)
    if "lever_arm_b_m" in site:
        x, y, z = site.numbers("lever_arm_b_m", 3)
        place = replace(place, lever_arm_b=(x, y, z))
    if "heading_deg" in site:
        if surveyed:
            raise site.error("heading_deg", "give it or [azimuth], not both")
        sigma = site.positive("heading_sigma_deg")
        heading = KnownHeading(
            site.number("heading_deg") * DEG,
            DEFAULT_HEADING_SIGMA if sigma is None else sigma * DEG,
        )
        return replace(place, heading=heading)
    if "heading_sigma_deg" in site:
        raise site.error("heading_sigma_deg", "has no heading_deg to belong to")
    if surveyed:
        return replace(place, heading=_heading(azimuth, place, survey))
    return place


def _height(site: Table, mark: Mark) -> float:
    kinds: tuple[HeightKind, ...] = ("ellipsoidal", "orthometric")
    kind = site.choice("height_kind", kinds)
    if "height_m" in site or "orthometric_height_m" in site:
        return site.height()
    with _refusing(site, "mark"):
        return mark.height(site.optional("geoid_height_m"), kind)


# which keys an azimuth of each kind has for itself
_OF_KIND = {
    "grid": ("grid",),
    "magnetic": ("declination_deg", "declination_sigma_deg"),
    "astronomic": ("deflection_arcsec", "zenith_deg"),
}


def _heading(table: Table, place: Place, survey: _Survey) -> KnownHeading:
    """Heading of the IMU by the surveyed line and the mounting angle."""
    kind = table.choice("kind", KINDS) or "geodetic"
    for other, keys in _OF_KIND.items():
        for key in keys:
            if key in table and kind != other:
                raise table.error(key, f'belongs to kind = "{other}"')
    if ("to" in table) == ("deg" in table):
        raise table.error(
            "to", "give the mark the line goes to, or its azimuth as deg, one of them"
        )
    start = survey.mark
    if (name := table.text("from")) is not None:
        start = _mark(table, "from", name, survey)
    sigma = _azimuth_sigma(table)
    here = (place.lat, place.lon) if start is None else (start.lat, start.lon)
    if (name := table.text("to")) is not None:
        if kind != "geodetic":
            raise table.error("kind", "an azimuth between marks is geodetic")
        end = _mark(table, "to", name, survey)
        if start is None:
            raise table.error("from", "is required, since the site is no mark")
        with _refusing(table, "to"):
            azimuth = azimuth_between(start, end, sigma=sigma)
    else:
        if sigma is None:
            raise table.error("sigma_deg", "is required (or sigma_arcsec): how well deg is known")
        with _refusing(table, _OF_KIND.get(kind, ("deg",))[0]):
            azimuth = stated_azimuth(
                table.turn("deg"),
                sigma,
                kind,
                *here,
                grid=table.text("grid"),
                declination=_scaled(table.optional("declination_deg"), DEG),
                declination_sigma=_scaled(table.positive("declination_sigma_deg"), DEG),
                deflection=[x * ARCSEC for x in table.numbers("deflection_arcsec", 2)]
                if "deflection_arcsec" in table
                else None,
                zenith=_scaled(table.optional("zenith_deg", above=0.0), DEG),
            )
    if "turned_deg" in table:
        azimuth = azimuth.turned(table.turn("turned_deg"))
    if max(abs(here[0] - place.lat), abs(np.sin(here[1] - place.lon)) * np.cos(here[0])) > _FAR:
        raise table.error(
            "from", "is more than 100 km from the site; are latitude and longitude swapped?"
        )
    azimuth = azimuth.carried(here, (place.lat, place.lon))
    mounting, mounting_sigma = table.turn("mounting_deg"), table.positive("mounting_sigma_deg")
    if "mounting_deg" in table or mounting_sigma is not None:
        azimuth = azimuth.turned(mounting, (mounting_sigma or 0.0) * DEG, "mounted at")
    survey.said.append(f"heading: {azimuth.provenance}")
    survey.warnings += azimuth.warnings
    return azimuth.heading


def _azimuth_sigma(table: Table) -> float | None:
    if "sigma_deg" in table and "sigma_arcsec" in table:
        raise table.error("sigma_deg", "give it or sigma_arcsec, not both")
    arcsec = _scaled(table.positive("sigma_arcsec"), ARCSEC)
    return _scaled(table.positive("sigma_deg"), DEG) if arcsec is None else arcsec


def _scaled(value: float | None, unit: float) -> float | None:
    return None if value is None else value * unit


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
