"""The site file: every key in its unit, every mistake named."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from navgrade.config import parse_time_ns
from navgrade.errors import ConfigError
from navgrade.logs import ImuFields
from navgrade.site import BaroSettings, Site, place_of_imu, read_site
from navgrade.vertical import CLASSICAL_GAINS, DEFAULT_GAINS, gains_from_time_constant
from tests.align.naive import local_axes, sight, xyz

DEG = math.pi / 180.0  # rad
FULL = """\
[imu]
topic = "/imu/data_raw"
kind = "average"
axes = "RFU"
gyro_unit = "deg/s"
accel_unit = "g"
dv_frame = "end"
accel_topic = "/dv"
rate_hz = 200
[imu.fields]
gyro = "imu.w"
accel = ["imu.ax", "imu.ay", "imu.az"]
time = "t_us"
time_unit = "us"
clock = "device"
interval = "dt"
interval_unit = "ms"
[imu.errors]
gyro_bias_deg_h = 0.01
accel_bias_ug = 50.0
arw_deg_rth = 0.003
vrw_ug_rthz = 10.0
[site]
latitude = "51 04 47.8327 N"
longitude = -114.13371127
height_m = 1118.5
heading_deg = 201.0
heading_sigma_deg = 2.5
[alignment]
start_s = 5.0
duration_s = 300.0
[mechanization]
reconstruction = "causal-3"
frame = "n"
vertical = "free"
gravity = "somigliana"
disturbance = "maps/disturbance.csv"
[baro]
topic = "/baro"
field = "pose.position.z"
quantity = "height_m"
time_constant_s = 60.0
reference = "absolute"
"""
INITIAL = """\
[imu]
kind = "average"
[initial]
time = "2026-01-01T00:00:00.500Z"
latitude = 30.0
longitude = 114.0
height_m = 35.0
velocity_ned_m_s = [1.0, -2.0, 3.0]
roll_deg = 10.0
pitch_deg = -20.0
heading_deg = 250.0
"""


def site(tmp_path: Path, text: str) -> Site:
    """Read a text as a site file."""
    path = tmp_path / "site.toml"
    path.write_text(text)
    return read_site(path)


def error(tmp_path: Path, text: str) -> ConfigError:
    """The error a text gives; it names the file and is one line."""
    path = tmp_path / "site.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_site(path)
    assert caught.value.file == str(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)
    return caught.value


def changed(text: str, old: str, new: str) -> str:
    """Replace what stands there exactly once."""
    assert text.count(old) == 1
    return text.replace(old, new)


# ---- what is right -----------------------------------------------------------------------------


def test_every_key_is_read_in_its_unit(tmp_path: Path) -> None:
    found = site(tmp_path, FULL)
    assert (found.topic, found.kind, found.axes) == ("/imu/data_raw", "average", "RFU")
    assert (found.gyro_unit, found.accel_unit) == ("deg/s", "g")
    assert found.dv_frame == "end"
    assert (found.accel_topic, found.rate_hz) == ("/dv", 200.0)
    accel = ("imu.ax", "imu.ay", "imu.az")
    assert found.fields == ImuFields("imu.w", accel, "t_us", "us", "device", "dt", "ms")
    assert (found.reconstruction, found.frame, found.vertical) == ("causal-3", "n", "free")
    assert found.gravity == "somigliana"
    assert found.disturbance == tmp_path / "maps" / "disturbance.csv"
    assert found.baro is not None
    assert found.baro.topic == "/baro"
    assert (found.baro.field, found.baro.quantity) == ("pose.position.z", "height_m")
    assert found.baro.gains == gains_from_time_constant(60.0)
    assert found.baro.reference == "absolute"
    assert found.initial is None
    # 1e-15: a few roundings
    close = {"rel": 1e-15, "abs": 0.0}
    assert found.errors.gyro_bias == pytest.approx(0.01 / 3600.0 * DEG, **close)
    assert found.errors.accel_bias == pytest.approx(50e-6 * 9.80665, **close)
    assert found.errors.arw == pytest.approx(0.003 / 60.0 * DEG, **close)
    assert found.errors.vrw == pytest.approx(10e-6 * 9.80665, **close)
    assert found.place is not None
    assert found.place.lat == pytest.approx((51 + 4 / 60 + 47.8327 / 3600) * DEG, **close)
    assert found.place.lon == pytest.approx(-114.13371127 * DEG, **close)
    assert found.place.h == 1118.5
    assert found.place.heading is not None
    assert found.place.heading.heading == pytest.approx(201.0 * DEG, **close)
    assert found.place.heading.sigma == pytest.approx(2.5 * DEG, **close)
    assert found.window is not None
    assert (found.window.start, found.window.duration) == (5.0, 300.0)
    assert found.text == FULL.encode()


def test_what_is_not_said_stays_open(tmp_path: Path) -> None:
    found = site(tmp_path, "")
    for name in ("topic", "kind", "axes", "gyro_unit", "accel_unit", "place", "window", "initial"):
        assert getattr(found, name) is None
    for name in ("dv_frame", "gravity", "disturbance", "baro", "accel_topic", "rate_hz", "fields"):
        assert getattr(found, name) is None
    for name in ("gyro_bias", "accel_bias", "arw", "vrw"):
        assert getattr(found.errors, name) is None


def test_a_baro_table_may_be_empty(tmp_path: Path) -> None:
    found = site(tmp_path, "[baro]\n").baro
    assert found == BaroSettings()
    assert (found.topic, found.field, found.quantity) == (None, None, None)
    assert (found.gains, found.reference) == (DEFAULT_GAINS, "start")


@pytest.mark.parametrize("name", CLASSICAL_GAINS)
def test_gains_may_be_a_classical_set(tmp_path: Path, name: str) -> None:
    found = site(tmp_path, f'[baro]\ngains = "{name}"\n').baro
    assert found is not None
    assert found.gains == CLASSICAL_GAINS[name]


def test_a_disturbance_grid_may_stand_anywhere(tmp_path: Path) -> None:
    found = site(tmp_path, '[mechanization]\ndisturbance = "/maps/grid.csv"\n')
    assert found.disturbance == Path("/maps/grid.csv")


def test_an_initial_state_is_read(tmp_path: Path) -> None:
    found = site(tmp_path, INITIAL).initial
    assert found is not None
    assert found.time_ns == 1_767_225_600_500_000_000
    state = found.state
    assert state.lat == pytest.approx(30.0 * DEG, rel=1e-15)
    assert state.lon == pytest.approx(114.0 * DEG, rel=1e-15)
    assert state.h == 35.0
    assert state.v_eb_n.tolist() == [1.0, -2.0, 3.0]
    # forward axis in north-east-down, from the angles alone; rounding of a quaternion
    w, x, y, z = state.q_nb
    forward = [w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)]
    pitch, heading = -20.0 * DEG, 250.0 * DEG
    wanted = [
        math.cos(pitch) * math.cos(heading),
        math.cos(pitch) * math.sin(heading),
        -math.sin(pitch),
    ]
    np.testing.assert_allclose(forward, wanted, atol=1e-15)
    down_of_right = 2 * (y * z + w * x)
    assert down_of_right == pytest.approx(math.cos(pitch) * math.sin(10.0 * DEG), abs=1e-15)


def test_velocity_may_be_left_out(tmp_path: Path) -> None:
    text = changed(INITIAL, "velocity_ned_m_s = [1.0, -2.0, 3.0]\n", "")
    found = site(tmp_path, text).initial
    assert found is not None
    assert found.state.v_eb_n.tolist() == [0.0, 0.0, 0.0]


def test_heights_above_the_sea_need_the_geoid(tmp_path: Path) -> None:
    text = changed(
        FULL, "height_m = 1118.5", "orthometric_height_m = 1135.25\ngeoid_height_m = -16.5"
    )
    found = site(tmp_path, text).place
    assert found is not None
    assert found.h == 1118.75


@pytest.mark.parametrize(
    ("latitude", "degrees"),
    [
        ("-33.5", -33.5),
        ("33", 33.0),
        ('"33 30 00 S"', -33.5),
        ('"33°30\'36.0\\"N"', 33.51),
        ('"S 33 30 36"', -33.51),
        ('"33:30:36 n"', 33.51),
        ('"-33 30.6"', -33.51),
        ('"-0 30 0"', -0.5),
        ('"0 0 0.36 S"', -0.0001),
    ],
)
def test_angles_in_many_spellings(tmp_path: Path, latitude: str, degrees: float) -> None:
    found = site(tmp_path, changed(FULL, '"51 04 47.8327 N"', latitude)).place
    assert found is not None
    assert found.lat == pytest.approx(degrees * DEG, rel=1e-14)  # rounding, 1 nm on the ground


TIMES = {
    "2026-01-01T00:00:00.500Z": 1_767_225_600_500_000_000,
    "2026-01-01T00:00:00Z": 1_767_225_600_000_000_000,
    "2026-01-01 00:00:00": 1_767_225_600_000_000_000,  # UTC unless said
    "2026-01-01T00:00:00.123456789Z": 1_767_225_600_123_456_789,
    "2026-01-01T00:00:00.1+00:00": 1_767_225_600_100_000_000,
    "2026-01-01T01:30:00.25+01:30": 1_767_225_600_250_000_000,
    "2025-12-31T16:00:00-08:00": 1_767_225_600_000_000_000,
    "1970-01-01T00:00:00.000000001Z": 1,
    "1969-12-31T23:59:59.999999999Z": -1,
    "2000-02-29T12:00:00Z": 951_825_600_000_000_000,
}


@pytest.mark.parametrize("text", TIMES)
def test_times_are_exact_to_the_nanosecond(text: str) -> None:
    assert parse_time_ns(text) == TIMES[text]


@pytest.mark.parametrize(
    ("value", "time_ns"),
    [
        ("time = 2026-01-01T00:00:00.500Z", 1_767_225_600_500_000_000),  # a TOML date-time
        ("time = 2026-01-01T00:00:00.123456", 1_767_225_600_123_456_000),
        ("time = 2026-01-01T01:00:00+01:00", 1_767_225_600_000_000_000),
        ("time_ns = 1767225600500000001", 1_767_225_600_500_000_001),
    ],
)
def test_times_may_be_toml_or_nanoseconds(tmp_path: Path, value: str, time_ns: int) -> None:
    text = changed(INITIAL, 'time = "2026-01-01T00:00:00.500Z"', value)
    found = site(tmp_path, text).initial
    assert found is not None
    assert found.time_ns == time_ns


# ---- what is wrong -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "old", "new", "key", "nearest"),
    [
        (FULL, "[site]", "[sites]", "sites", "site"),
        (FULL, "[alignment]", "[alignement]", "alignement", "alignment"),
        (FULL, 'topic = "/imu', 'topics = "/imu', "imu.topics", "topic"),
        (FULL, "kind", "Kind", "imu.Kind", "kind"),
        (FULL, "axes", "axis", "imu.axis", "axes"),
        (FULL, "[imu.errors]", "[imu.error]", "imu.error", "errors"),
        (FULL, "[imu.fields]", "[imu.field]", "imu.field", "fields"),
        (FULL, "rate_hz", "rate", "imu.rate", "rate_hz"),
        (FULL, "time_unit", "unit", "imu.fields.unit", "time_unit"),
        (FULL, 'clock = "dev', 'clocks = "dev', "imu.fields.clocks", "clock"),
        (FULL, "gyro_bias_deg_h", "gyro_bias_deg_s", "imu.errors.gyro_bias_deg_s",
         "gyro_bias_deg_h"),
        (FULL, "accel_bias_ug", "accel_bias_mg", "imu.errors.accel_bias_mg", "accel_bias_ug"),
        (FULL, "latitude", "lattitude", "site.lattitude", "latitude"),
        (FULL, "heading_sigma_deg", "heading_sigma", "site.heading_sigma", "heading_sigma_deg"),
        (FULL, "duration_s", "duration", "alignment.duration", "duration_s"),
        (FULL, "reconstruction", "reconstuction", "mechanization.reconstuction", "reconstruction"),
        (FULL, "dv_frame", "dvframe", "imu.dvframe", "dv_frame"),
        (FULL, "gravity", "gravitation", "mechanization.gravitation", "gravity"),
        (FULL, "disturbance =", "disturbances =", "mechanization.disturbances", "disturbance"),
        (FULL, "[baro]", "[barometer]", "barometer", "baro"),
        (FULL, "time_constant_s", "time_constant", "baro.time_constant", "time_constant_s"),
        (INITIAL, "velocity_ned_m_s", "velocity", "initial.velocity", "velocity_ned_m_s"),
        (INITIAL, "roll_deg", "roll", "initial.roll", "roll_deg"),
    ],
)  # fmt: skip
def test_an_unknown_key_names_the_nearest(
    tmp_path: Path, text: str, old: str, new: str, key: str, nearest: str
) -> None:
    caught = error(tmp_path, changed(text, old, new))
    assert caught.key == key
    assert f"{key}: unknown key" in str(caught)
    assert str(caught).endswith(f"the nearest allowed key is {nearest}")


WRONG = [  # text, old, new, key, facts
    (FULL, '"/imu/data_raw"', "7", "imu.topic", "must be text, got 7"),
    (FULL, '"average"', '["average"]', "imu.kind", "must be text"),
    (FULL, '"causal-3"', "3", "mechanization.reconstruction", "must be text, got 3"),
    (FULL, "0.01", '"0.01"', "imu.errors.gyro_bias_deg_h", "must be a number, got '0.01'"),
    (FULL, "0.01", "true", "imu.errors.gyro_bias_deg_h", "must be a number, got True"),
    (FULL, "0.01", "-0.01", "imu.errors.gyro_bias_deg_h", "at least 0, got -0.01"),
    (FULL, "0.01", "nan", "imu.errors.gyro_bias_deg_h", "finite"),
    (FULL, "0.003", "inf", "imu.errors.arw_deg_rth", "finite"),
    (FULL, "1118.5", "[1118.5]", "site.height_m", "must be a number"),
    (FULL, "1118.5", "inf", "site.height_m", "finite"),
    (FULL, "height_m = 1118.5\n", "", "site.height_m", "required (above the ellipsoid)"),
    (FULL, "height_m = 1118.5", "orthometric_height_m = 1135.0", "site.orthometric_height_m",
     "geoid_height_m"),
    (FULL, "height_m = 1118.5", "height_m = 1.0\northometric_height_m = 2.0", "site.height_m",
     "not both"),
    (FULL, '"51 04 47.8327 N"', '"51 04 47.8327 E"', "site.latitude", "expected N or S"),
    (FULL, '"51 04 47.8327 N"', '"-51 04 47 N"', "site.latitude", "sign twice"),
    (FULL, '"51 04 47.8327 N"', '"51 64 00 N"', "site.latitude", "60 or more"),
    (FULL, '"51 04 47.8327 N"', '"north"', "site.latitude", "is not an angle"),
    (FULL, '"51 04 47.8327 N"', "true", "site.latitude", "is not an angle"),
    (FULL, '"51 04 47.8327 N"', "91.0", "site.latitude", "within ±90 degrees, got 91.0"),
    (FULL, '"51 04 47.8327 N"', "nan", "site.latitude", "within ±90 degrees"),
    (FULL, 'latitude = "51 04 47.8327 N"\n', "", "site.latitude", "required"),
    (FULL, "longitude = -114.13371127\n", "", "site.longitude", "required"),
    (FULL, "-114.13371127", "-374.0", "site.longitude", "within ±360 degrees"),
    (FULL, "heading_deg = 201.0\n", "", "site.heading_sigma_deg", "no heading_deg"),
    (FULL, "2.5", "-2.5", "site.heading_sigma_deg", "at least 0"),
    (FULL, "duration_s = 300.0\n", "", "alignment.duration_s", "required"),
    (FULL, "300.0", "1.0", "alignment.duration_s", "at least 2, got 1.0"),
    (FULL, "5.0\nd", "-5.0\nd", "alignment.start_s", "at least 0, got -5.0"),
    (FULL, FULL[FULL.index("[site]") : FULL.index("[alignment]")], "", "site", "[site]"),
    (FULL, '"end"', '"middle"', "imu.dv_frame", "'middle' is not one of start, end"),
    (FULL, '"end"', "true", "imu.dv_frame", "must be text, got True"),
    (FULL, "rate_hz = 200", "rate_hz = -200", "imu.rate_hz", "at least 0, got -200"),
    (FULL, '"/dv"', "3", "imu.accel_topic", "must be text, got 3"),
    (FULL, 'gyro = "imu.w"\n', "", "imu.fields.gyro", "the path of a vector, or of its x, y and z"),
    (FULL, ', "imu.az"]', "]", "imu.fields.accel", "got ['imu.ax', 'imu.ay']"),
    (FULL, '"t_us"', "1", "imu.fields.time", "must be text, got 1"),
    (FULL, '"us"', '"min"', "imu.fields.time_unit", "'min' is not one of s, ms, us, ns"),
    (FULL, '"ms"', '"Hz"', "imu.fields.interval_unit", "'Hz' is not one of s, ms, us, ns"),
    (FULL, '"device"', '"gps"', "imu.fields.clock", "'gps' is not one of unix, device"),
    (FULL, 'clock = "device"\n', "", "imu.fields.clock", "needs time_unit and clock"),
    (FULL, '"somigliana"', "9.81", "mechanization.gravity", "must be text, got 9.81"),
    (FULL, '"maps/disturbance.csv"', "1", "mechanization.disturbance", "must be text, got 1"),
    (FULL, '"/baro"', "3", "baro.topic", "must be text, got 3"),
    (FULL, 'topic = "/baro"\n', "", "baro.topic", "required beside field"),
    (FULL, '"pose.position.z"', "2", "baro.field", "must be text, got 2"),
    (FULL, '"height_m"', '"height_ft"', "baro.quantity",
     "'height_ft' is not one of height_m, pressure_pa"),
    (FULL, 'quantity = "height_m"\n', "", "baro.quantity", "required beside field"),
    (FULL, "60.0", "0.0", "baro.time_constant_s", "must be positive, got 0.0"),
    (FULL, "60.0", "-60", "baro.time_constant_s", "must be positive, got -60"),
    (FULL, "60.0", "inf", "baro.time_constant_s", "finite, got inf"),
    (FULL, "60.0", '"slow"', "baro.time_constant_s", "must be a number, got 'slow'"),
    (FULL, "time_constant_s = 60.0", 'time_constant_s = 60.0\ngains = "rogers"', "baro.gains",
     "not both"),
    (FULL, "time_constant_s = 60.0", 'gains = "roger"', "baro.gains",
     "'roger' is not one of rogers, butterworth"),
    (FULL, '"absolute"', '"msl"', "baro.reference", "'msl' is not one of start, absolute"),
    (INITIAL, 'time = "2026-01-01T00:00:00.500Z"\n', "", "initial.time", "one of them"),
    (INITIAL, "latitude", "time_ns = 3\nlatitude", "initial.time", "one of them"),
    (INITIAL, '"2026-01-01T00:00:00.500Z"', '"yesterday"', "initial.time", "'yesterday'"),
    (INITIAL, '"2026-01-01T00:00:00.500Z"', '"2026-13-01T00:00:00Z"', "initial.time", "2026-13"),
    (INITIAL, '"2026-01-01T00:00:00.500Z"', "2026-01-01", "initial.time", "without a time"),
    (INITIAL, '"2026-01-01T00:00:00.500Z"', "5", "initial.time", "is not a time"),
    (INITIAL, 'time = "2026-01-01T00:00:00.500Z"', "time_ns = 1.5", "initial.time_ns", "integer"),
    (INITIAL, 'time = "2026-01-01T00:00:00.500Z"', "time_ns = true", "initial.time_ns", "integer"),
    (INITIAL, "[1.0, -2.0, 3.0]", "[1.0, -2.0]", "initial.velocity_ned_m_s", "three finite"),
    (INITIAL, "[1.0, -2.0, 3.0]", "[1.0, -2.0, nan]", "initial.velocity_ned_m_s", "three finite"),
    (INITIAL, "[1.0, -2.0, 3.0]", '"still"', "initial.velocity_ned_m_s", "three finite"),
    (INITIAL, "roll_deg = 10.0\n", "", "initial.roll_deg", "required"),
    (INITIAL, "heading_deg = 250.0\n", "", "initial.heading_deg", "required"),
    (INITIAL, "height_m = 35.0\n", "", "initial.height_m", "required"),
    (INITIAL, "latitude = 30.0\n", "", "initial.latitude", "required"),
    (INITIAL, "[initial]", "[alignment]\nduration_s = 3.0\n[initial]", "initial", "instead"),
    (INITIAL, "[initial]", "[site]\nlatitude = 3.0\n[initial]", "initial", "instead"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "old", "new", "key", "fact"), WRONG, ids=[f"{case[3]}: {case[4]}" for case in WRONG]
)
def test_a_wrong_value_names_its_key(
    tmp_path: Path, text: str, old: str, new: str, key: str, fact: str
) -> None:
    caught = error(tmp_path, changed(text, old, new))
    assert caught.key == key
    assert f"{key}: " in str(caught)
    assert fact in str(caught)


@pytest.mark.parametrize("table", ["imu", "site", "alignment", "initial", "mechanization", "baro"])
def test_a_table_that_is_a_value_is_told(tmp_path: Path, table: str) -> None:
    caught = error(tmp_path, f"{table} = 3\n")
    assert caught.key == table
    assert f"{table} must be a table, [{table}]" in str(caught)


@pytest.mark.parametrize("table", ["errors", "fields"])
def test_tables_of_the_imu_that_are_a_value_are_told(tmp_path: Path, table: str) -> None:
    caught = error(tmp_path, f"[imu]\n{table} = 0.01\n")
    assert caught.key == f"imu.{table}"


@pytest.mark.parametrize(
    ("content", "fact"),
    [
        (b"[site\nlatitude = 3", "line 1"),
        (b"latitude == 3", "line 1"),
        (b"[site]\nlatitude = 1\nlatitude = 2", "overwrite"),
        (b"topic = \"\xff\xfe\"", "utf-8"),
    ],
)  # fmt: skip
def test_a_file_that_is_not_toml_tells_where(tmp_path: Path, content: bytes, fact: str) -> None:
    path = tmp_path / "site.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match="cannot be read") as caught:
        read_site(path)
    assert fact in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"nowhere\.toml: no such site file"):
        read_site(tmp_path / "nowhere.toml")


def test_the_example_of_the_specification_is_accepted(tmp_path: Path) -> None:
    """Site and alignment; and, apart from it, the known state."""
    found: dict[str, Any] = {"site": site(tmp_path, FULL), "initial": site(tmp_path, INITIAL)}
    assert found["site"].place is not None
    assert found["initial"].initial is not None


# ---- survey ------------------------------------------------------------------------------------

MARKS = Path(__file__).parents[1] / "align" / "marks"
PIER = (51 + 4 / 60 + 47.83270 / 3600) * DEG, -(114 + 8 / 60 + 1.36060 / 3600) * DEG, 1118.5
TARGET = (51 + 4 / 60 + 57.10412 / 3600) * DEG, -(114 + 7 / 60 + 31.98425 / 3600) * DEG, 1121.25
# rad, on the ellipsoid: the target's height would move it by 0.2 µrad, the sigma is 11 µrad
LINE, _ = sight((*PIER[:2], 0.0), (*TARGET[:2], 0.0))
SURVEYED = f"""\
[site]
marks = "{MARKS}/surveyor.csv"
mark = "PIER 1"
[azimuth]
to = "AZ MK"
"""
STATED = """\
[site]
latitude = 51.08
longitude = -114.13
height_m = 1118.5
[azimuth]
deg = "63 23 00"
sigma_arcsec = 36.0
"""


@pytest.mark.parametrize("file", ["surveyor.csv", "datasheet.txt", "solution.snx"])
def test_a_surveyed_line_gives_place_and_heading(tmp_path: Path, file: str) -> None:
    found = site(tmp_path, changed(SURVEYED, "surveyor.csv", file))
    place = found.place
    assert place is not None and place.heading is not None
    assert xyz(place.lat, place.lon, place.h) == pytest.approx(xyz(*PIER), abs=2e-8)
    assert place.heading.heading == pytest.approx(LINE, abs=1e-8)
    # 5 mm at both ends of 640 m
    assert place.heading.sigma == pytest.approx(math.sqrt(2.0) * 0.005 / 639.58, rel=1e-4)
    assert found.marks == MARKS / file
    assert "PIER 1" in found.survey[0] or "PIR1" in found.survey[0]
    assert "639.583 m" in found.survey[1]
    if file == "solution.snx":
        assert found.survey_notes == ()
    else:
        (note,) = found.survey_notes
        assert "in NAD 83(2011); the Earth model is WGS 84" in note
        assert "differ by 1 to 2 m; nothing was corrected" in note


def test_marks_stand_in_the_folder_of_the_site_file(tmp_path: Path) -> None:
    (tmp_path / "marks.csv").write_bytes((MARKS / "surveyor.csv").read_bytes())
    found = site(tmp_path, changed(SURVEYED, f"{MARKS}/surveyor.csv", "marks.csv"))
    assert found.marks == tmp_path / "marks.csv"


def test_the_mounting_follows_the_line_and_the_theodolite(tmp_path: Path) -> None:
    more = 'turned_deg = "100 30 00"\nmounting_deg = -0.25\nmounting_sigma_deg = 0.01\n'
    found = site(tmp_path, SURVEYED + more)
    assert found.place is not None and found.place.heading is not None
    assert found.place.heading.heading == pytest.approx(LINE + 100.25 * DEG, abs=1e-8)
    assert found.place.heading.sigma == pytest.approx(
        math.hypot(0.01 * DEG, math.sqrt(2.0) * 0.005 / 639.58), rel=1e-6
    )
    assert "turned +100.500000°, mounted at -0.250000° ± 0.01°" in found.survey[1]


def test_a_sigma_given_stands_for_that_of_the_marks(tmp_path: Path) -> None:
    found = site(tmp_path, SURVEYED + "sigma_arcsec = 1.8\n")
    assert found.place is not None and found.place.heading is not None
    assert found.place.heading.sigma == pytest.approx(0.0005 * DEG, rel=1e-12)


def test_a_stated_azimuth(tmp_path: Path) -> None:
    found = site(tmp_path, STATED)
    assert found.place is not None and found.place.heading is not None
    assert found.place.heading.heading == pytest.approx((63 + 23 / 60) * DEG, rel=1e-15)
    assert found.place.heading.sigma == pytest.approx(0.01 * DEG, rel=1e-12)
    assert found.survey == ("heading: geodetic azimuth 63.383333° ± 0.01°",)


@pytest.mark.parametrize(
    ("more", "turned_deg", "sigma_deg"),
    [
        # meridian 111 W: closed form of the sphere, good to 0.003 degrees here
        ('kind = "grid"\ngrid = "UTM 12N"\n', -3.13 * math.sin(51.08 * DEG), 0.01),
        (
            'kind = "magnetic"\ndeclination_deg = 14.0\ndeclination_sigma_deg = 0.4\n',
            14.0,
            math.hypot(0.4, 0.01),
        ),
        (
            'kind = "astronomic"\ndeflection_arcsec = [3.0, 7.2]\n',
            -0.002 * math.tan(51.08 * DEG),
            0.01,
        ),
        (
            'kind = "astronomic"\ndeflection_arcsec = [36.0, 0.0]\nzenith_deg = 80.0\n',
            -0.01 * math.sin(63.38 * DEG) / math.tan(80.0 * DEG),
            0.01,
        ),
    ],
)
def test_azimuths_from_other_norths(
    tmp_path: Path, more: str, turned_deg: float, sigma_deg: float
) -> None:
    found = site(tmp_path, STATED + more)
    assert found.place is not None and found.place.heading is not None
    off = found.place.heading.heading / DEG - (63 + 23 / 60)
    assert off == pytest.approx(turned_deg, abs=0.003 if "grid" in more else 1e-6)
    assert found.place.heading.sigma == pytest.approx(sigma_deg * DEG, rel=1e-9)


def test_a_line_elsewhere_is_carried_to_the_site(tmp_path: Path) -> None:
    """A kilometer east of the line's beginning its azimuth is larger by the convergence."""
    east = 1000.0 / (6.39e6 * math.cos(PIER[0]))  # rad of longitude
    text = SURVEYED.replace(
        'mark = "PIER 1"',
        f"latitude = {PIER[0] / DEG!r}\nlongitude = {(PIER[1] + east) / DEG!r}\nheight_m = 1e3",
    )
    found = site(tmp_path, text + 'from = "PIER 1"\n')
    assert found.place is not None and found.place.heading is not None
    assert found.place.heading.heading == pytest.approx(LINE + east * math.sin(PIER[0]), abs=1e-8)
    assert "carried to the IMU by convergence" in found.survey[-1]


ARM = [2.0, -3.0, 0.5]  # m


@pytest.mark.parametrize(
    ("key", "arm_ned"),
    [("lever_arm_ned_m", ARM), ("lever_arm_enu_m", [-3.0, 2.0, -0.5])],
)
def test_a_local_lever_arm_leads_to_the_imu(tmp_path: Path, key: str, arm_ned: list[float]) -> None:
    found = site(tmp_path, SURVEYED.replace("[azimuth]", f"{key} = {ARM}\n[azimuth]")).place
    assert found is not None
    north, east, up = local_axes(PIER[0], PIER[1])
    wanted = xyz(*PIER) + arm_ned[0] * north + arm_ned[1] * east - arm_ned[2] * up
    assert xyz(found.lat, found.lon, found.h) == pytest.approx(wanted, abs=2e-8)
    assert found.lever_arm_b is None


def test_a_lever_arm_in_body_axes_waits_for_the_attitude(tmp_path: Path) -> None:
    found = site(tmp_path, SURVEYED.replace("[azimuth]", f"lever_arm_b_m = {ARM}\n[azimuth]")).place
    assert found is not None
    assert found.lever_arm_b == tuple(ARM)
    assert xyz(found.lat, found.lon, found.h) == pytest.approx(xyz(*PIER), abs=2e-8)
    attitude = Rotation.from_euler("ZYX", [200.0, -30.0, 170.0], degrees=True)
    x, y, z, w = attitude.as_quat()
    imu = place_of_imu(found, [w, x, y, z])
    down_arm = attitude.apply(ARM)
    north, east, up = local_axes(PIER[0], PIER[1])
    wanted = xyz(*PIER) + down_arm[0] * north + down_arm[1] * east - down_arm[2] * up
    assert xyz(imu.lat, imu.lon, imu.h) == pytest.approx(wanted, abs=2e-8)
    assert imu.heading == found.heading
    assert place_of_imu(imu, [1.0, 0.0, 0.0, 0.0]) == imu


def test_a_place_may_be_x_y_z(tmp_path: Path) -> None:
    text = f'[site]\nxyz_m = {xyz(*PIER).tolist()}\ndatum = "ETRS89"\n'
    found = site(tmp_path, text)
    assert found.place is not None
    assert xyz(found.place.lat, found.place.lon, found.place.h) == pytest.approx(
        xyz(*PIER), abs=2e-8
    )
    (note,) = found.survey_notes
    assert "the site is in ETRS89" in note


def test_heights_of_marks(tmp_path: Path) -> None:
    (tmp_path / "sea.csv").write_text("name,lat,lon,orthometric_height\nA,51.08,-114.13,1135.25\n")
    (tmp_path / "unsaid.csv").write_text("name,lat,lon,elevation\nA,51.08,-114.13,1135.25\n")
    sea = '[site]\nmarks = "sea.csv"\nmark = "A"\n'
    unsaid = '[site]\nmarks = "unsaid.csv"\nmark = "A"\n'
    for text, h in (
        (sea + "geoid_height_m = -16.75\n", 1118.5),
        (sea + "height_m = 1118.5\n", 1118.5),
        (unsaid + 'height_kind = "ellipsoidal"\n', 1135.25),
        (unsaid + 'height_kind = "orthometric"\ngeoid_height_m = -16.75\n', 1118.5),
    ):
        place = site(tmp_path, text).place
        assert place is not None
        assert place.h == h
    assert "only an orthometric height" in str(error(tmp_path, sea))
    assert "nothing says above what" in str(error(tmp_path, unsaid))


def test_the_window_may_be_left_to_the_alignment(tmp_path: Path) -> None:
    text = changed(FULL, "start_s = 5.0\nduration_s = 300.0", 'method = "fine"\nfalse_alarm = 1e-4')
    found = site(tmp_path, text)
    assert found.window is None
    assert (found.method, found.false_alarm) == ("fine", 1e-4)
    alone = site(tmp_path, changed(FULL, "start_s = 5.0\n", "")).window
    assert alone is not None
    assert (alone.start, alone.duration) == (0.0, 300.0)


WRONG_SURVEY = [
    (SURVEYED, 'mark = "PIER 1"', 'mark = "PEER 1"', "site.mark", "the nearest name is PIER 1"),
    (SURVEYED, f'marks = "{MARKS}/surveyor.csv"\n', "", "site.mark", "give it as marks in [site]"),
    (SURVEYED, "surveyor.csv", "nowhere.csv", "site.marks", "no such file of marks"),
    (SURVEYED, "surveyor.csv", "README.md", "site.marks", "is neither a table"),
    (SURVEYED, "[azimuth]", "latitude = 3\n[azimuth]", "site.mark", "give it or latitude"),
    (SURVEYED, "[azimuth]", "xyz_m = [1, 2, 3]\n[azimuth]", "site.mark", "give it or xyz_m"),
    (SURVEYED, "[azimuth]", 'datum = "ITRF2014"\n[azimuth]', "site.datum", "says NAD 83(2011)"),
    (SURVEYED, "[azimuth]", "geoid_height_m = 3\n[azimuth]", "site.mark", "nothing to belong to"),
    (SURVEYED, "[azimuth]", "heading_deg = 3\n[azimuth]", "site.heading_deg", "or [azimuth]"),
    (SURVEYED, "[azimuth]", "lever_arm_b_m = [1, 2]\n[azimuth]", "site.lever_arm_b_m", "3 finite"),
    (SURVEYED, "[azimuth]",
     "lever_arm_b_m = [1, 2, 3]\nlever_arm_ned_m = [1, 2, 3]\n[azimuth]", "site.lever_arm_ned_m",
     "give it or lever_arm_b_m"),
    (SURVEYED, 'to = "AZ MK"', 'to = "AZ"', "azimuth.to", "the nearest name is AZ MK"),
    (SURVEYED, 'to = "AZ MK"', 'to = "PIER 1"', "azimuth.to", "at the same place"),
    (SURVEYED, 'to = "AZ MK"', 'to = "AZ MK"\ndeg = 3', "azimuth.to", "one of them"),
    (SURVEYED, 'to = "AZ MK"', "", "azimuth.to", "one of them"),
    (SURVEYED, 'to = "AZ MK"', 'to = "AZ MK"\nkind = "grid"', "azimuth.kind", "is geodetic"),
    (SURVEYED, '[site]\n', '[sites]\n', "sites", "nearest allowed key is site"),
    (STATED, "[azimuth]", "xyz_m = [1, 2, 3]\n[azimuth]", "site.xyz_m", "give it or latitude"),
    (STATED, "latitude = 51.08\nlongitude = -114.13", "xyz_m = [1, 2, 3]", "site.xyz_m",
     "give it or height_m"),
    (STATED, "latitude = 51.08\nlongitude = -114.13\nheight_m = 1118.5", "xyz_m = [1, 2, 3]",
     "site.xyz_m", "km from the Earth's center"),
    (SURVEYED, "[azimuth]", "longitude = 3\n[azimuth]", "site.mark", "give it or longitude"),
    (SURVEYED, "[azimuth]", 'height_kind = "ellipsoidal"\nheight_m = 3\n[azimuth]',
     "site.height_kind", "give it or height_m"),
    (STATED, "height_m = 1118.5", 'height_kind = "orthometric"', "site.height_kind", "of a mark"),
    (STATED, 'deg = "63 23 00"', 'to = "B"', "azimuth.to", "give it as marks in [site]"),
    (SURVEYED, 'mark = "PIER 1"', "latitude = 51\nlongitude = -114\nheight_m = 0", "azimuth.from",
     "is required, since the site is no mark"),
    (STATED, '"63 23 00"', '"N 63 23 00 E"', "azimuth.deg", "has letters"),
    (STATED, '"63 23 00"', "630", "azimuth.deg", "within ±360 degrees"),
    (STATED, "sigma_arcsec = 36.0\n", "", "azimuth.sigma_deg", "is required (or sigma_arcsec)"),
    (STATED, "sigma_arcsec", "sigma_deg = 1\nsigma_arcsec", "azimuth.sigma_deg", "not both"),
    (STATED, "sigma_arcsec", 'kind = "true"\nsigma_arcsec', "azimuth.kind", "is not one of"),
    (STATED, "sigma_arcsec", 'kind = "grid"\nsigma_arcsec', "azimuth.grid", "give its grid"),
    (STATED, "sigma_arcsec", 'kind = "grid"\ngrid = "MTM 4"\nsigma_arcsec', "azimuth.grid",
     "is not understood"),
    (STATED, "sigma_arcsec", 'grid = "UTM 12N"\nsigma_arcsec', "azimuth.grid", 'kind = "grid"'),
    (STATED, "sigma_arcsec", 'kind = "magnetic"\nsigma_arcsec', "azimuth.declination_deg",
     "changes with place and year"),
    (STATED, "sigma_arcsec", 'kind = "astronomic"\nsigma_arcsec', "azimuth.deflection_arcsec",
     "Laplace"),
    (STATED, "sigma_arcsec", "declination_sigma_deg = 1\nsigma_arcsec",
     "azimuth.declination_sigma_deg", "belongs to"),
    (STATED, "sigma_arcsec", "mounting_sigma_deg = -1\nsigma_arcsec", "azimuth.mounting_sigma_deg",
     "at least 0"),
    (STATED, "[site]\nlatitude = 51.08\nlongitude = -114.13\nheight_m = 1118.5\n", "", "site",
     "[azimuth] needs the [site] it holds at"),
    (STATED, "latitude = 51.08", "latitude = -114.13", "site.latitude", "swapped?"),
    (FULL, "duration_s = 300.0", "duration_s = 300.0\nfalse_alarm = 1", "alignment.false_alarm",
     "between 0 and 1"),
    (FULL, "duration_s = 300.0", "duration_s = 300.0\nfalse_alarm = 0", "alignment.false_alarm",
     "above 0"),
    (FULL, "duration_s = 300.0", "duration_s = 300.0\nmethod = 3", "alignment.method", "text"),
    (FULL, "duration_s = 300.0", "duration_s = 300.0\nmethods = 3", "alignment.methods", "method"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "old", "new", "key", "fact"),
    WRONG_SURVEY,
    ids=[f"{case[3]}: {case[4]}" for case in WRONG_SURVEY],
)
def test_a_wrong_survey_names_its_key(
    tmp_path: Path, text: str, old: str, new: str, key: str, fact: str
) -> None:
    caught = error(tmp_path, changed(text, old, new))
    assert caught.key == key
    assert fact in str(caught)


def test_a_site_with_latitude_and_longitude_swapped_is_far_from_its_line(tmp_path: Path) -> None:
    text = changed(SURVEYED, 'mark = "PIER 1"', "latitude = -51\nlongitude = 51\nheight_m = 0")
    caught = error(tmp_path, text + 'from = "PIER 1"\n')
    assert caught.key == "azimuth.from"
    assert "100 km from the site; are latitude and longitude swapped?" in str(caught)


def test_marks_too_close_name_the_sigma_there_would_be(tmp_path: Path) -> None:
    (tmp_path / "close.csv").write_text(
        "name,lat,lon,h,sigma\nA,51,-114,1,0.01\nB,51.0000005,-114,1,0.01\n"
    )
    text = '[site]\nmarks = "close.csv"\nmark = "A"\n[azimuth]\nto = "B"\n'
    caught = error(tmp_path, text)
    assert caught.key == "azimuth.to"
    assert "0.0556 m apart" in str(caught)
    assert "sigma of 14.6°" in str(caught)
