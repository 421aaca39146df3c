"""Every message type of the registry, recorded by other people's software, comes out as it went in.

And each trap the registry tells of: what a naive reading gives, and what stands in its way.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from navgrade import ImuSamples
from navgrade.errors import ConfigError, LogError, SchemaError
from navgrade.logs import ImuFields, open_imu, read_imu
from navgrade.logs.container import reader
from navgrade.logs.schemas import IMU_SCHEMAS
from navgrade.site import read_site
from tests.navgrade.logmaking import EPOCH_NS, Channel, imu_channel, text_channel, write_log
from tests.navgrade.logmaking import Recording as Samples
from tests.navgrade.logs.vendors import filled, vendor_channel

Array = NDArray[np.float64]
COUNT = 400
DEG = np.pi / 180.0  # rad
_RNG = np.random.default_rng(6)
STEPS_US = _RNG.integers(4_900, 5_100, COUNT)  # 200 Hz that jitters
TIME_US = 77_000_000 + np.cumsum(STEPS_US)
TIME_NS = TIME_US * 1000
DELAY_NS = 1_500_000 + _RNG.integers(0, 3_000_000, COUNT)  # from the sensor to the recorder
LEAST_NS = int(DELAY_NS.min())
LOG_NS = EPOCH_NS + (TIME_NS - TIME_NS[0]) + DELAY_NS
RATE = 0.3 * _RNG.standard_normal((COUNT, 3))  # rad/s
FORCE = np.array([0.0, 0.0, 9.8]) + _RNG.standard_normal((COUNT, 3))  # m/s^2
ANGLE, VELOCITY = 0.005 * RATE, 0.005 * FORCE
SINGLE = np.float32
TIMES = 1000  # roundings: the difference of two times of 2 s is 4e-16 s off, 1e-13 of 5 ms
STEP_DT = np.concatenate([[np.median(np.diff(TIME_US))], np.diff(TIME_US)]) * 1e-6
TURNS: dict[str, Callable[..., tuple[Array, Array, Array]]] = {  # to forward, right, down
    "FRD": lambda x, y, z: (x, y, z),
    "FLU": lambda x, y, z: (x, -y, -z),
    "RFU": lambda x, y, z: (y, x, -z),
}
HEADER = {"header.frame_id": "imu"}


@dataclass(frozen=True)
class Case:
    """A recording, and the samples that are in it, in the axes of the sensor.

    `epoch_ns` is the Unix time of the first sample, `ulp` how often a number may be rounded.
    """

    schema: int
    channels: tuple[Channel, ...]
    kind: str
    axes: str
    dt: Array
    gyro: Array
    accel: Array
    epoch_ns: int = EPOCH_NS + LEAST_NS
    options: Mapping[str, Any] = field(default_factory=dict)
    ulp: int = 0


def rows(**columns: Any) -> list[dict[str, Any]]:
    """Rows of columns; ``__`` in a name stands for a dot."""
    names = [name.replace("__", ".") for name in columns]
    return [dict(zip(names, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def constant(value: Any) -> list[Any]:
    """A column of one value."""
    return [value] * COUNT


def wide(values: Array) -> Array:
    """What a member of single precision holds."""
    return values.astype(SINGLE).astype(np.float64)


def vector_rows(prefixes: tuple[str, str, str], values: Array) -> dict[str, list[float]]:
    """Columns of three members."""
    return dict(zip(prefixes, values.T.tolist(), strict=True))


def index(name: str, nth: int = 0) -> int:
    """Place of an entry in the registry."""
    return [k for k, schema in enumerate(IMU_SCHEMAS) if schema.name == name][nth]


def ros_imu(**changed: Any) -> Case:
    """sensor_msgs/Imu as the NovAtel driver writes it: covariances that begin with -1."""
    name = "sensor_msgs/msg/Imu"
    no_estimate = np.array([-1.0] + [0.0] * 8)
    stamps = EPOCH_NS + TIME_NS - TIME_NS[0]
    channel = vendor_channel(
        "/imu",
        name,
        rows(
            header__stamp=stamps,
            angular_velocity=RATE,
            linear_acceleration=FORCE,
            angular_velocity_covariance=constant(no_estimate),
            linear_acceleration_covariance=constant(no_estimate),
        ),
        LOG_NS,
    )
    options = {"kind": "average"}
    return Case(index(name), (channel,), "average", "FLU", STEP_DT, RATE, FORCE, EPOCH_NS, options)


def increments() -> Case:
    """Our own increments, packed by hand."""
    interval = STEP_DT * 0.999
    stamps = EPOCH_NS + TIME_NS - TIME_NS[0]
    channel = imu_channel(Samples(stamps, ANGLE, VELOCITY, interval), "/imu", log_ns=LOG_NS)
    name = "navgrade_msgs/msg/ImuIncrement"
    return Case(index(name), (channel,), "increment", "FLU", interval, ANGLE, VELOCITY, EPOCH_NS)


def px4_vehicle_imu(variant: str = "", velocity_us: Any = STEPS_US, clipped: Any = None) -> Case:
    """PX4's increments over intervals of their own."""
    name = "px4_msgs/msg/VehicleImu"
    channel = vendor_channel(
        "/fmu/out/vehicle_imu",
        name,
        rows(
            timestamp=TIME_US + 300,
            timestamp_sample=TIME_US,
            delta_angle=ANGLE.astype(SINGLE),
            delta_velocity=VELOCITY.astype(SINGLE),
            delta_angle_dt=STEPS_US,
            delta_velocity_dt=velocity_us,
            delta_angle_clipping=constant(0) if clipped is None else clipped,
        ),
        LOG_NS,
        variant,
    )
    return Case(
        index(name),
        (channel,),
        "increment",
        "FRD",
        STEPS_US / 1e6,
        wide(ANGLE),
        wide(VELOCITY),
    )


def px4_sensor_combined(relative: Any = None) -> Case:
    """PX4's mean rates."""
    name = "px4_msgs/msg/SensorCombined"
    channel = vendor_channel(
        "/fmu/out/sensor_combined",
        name,
        rows(
            timestamp=TIME_US,
            gyro_rad=RATE.astype(SINGLE),
            gyro_integral_dt=STEPS_US,
            accelerometer_m_s2=FORCE.astype(SINGLE),
            accelerometer_integral_dt=STEPS_US,
            accelerometer_timestamp_relative=constant(0) if relative is None else relative,
        ),
        LOG_NS,
    )
    return Case(index(name), (channel,), "average", "FRD", STEPS_US / 1e6, wide(RATE), wide(FORCE))


def px4_sensors(keep: Any = slice(None)) -> Case:
    """PX4's raw sensors: two topics; `keep` are the accelerometer's messages that were recorded."""
    name = "px4_msgs/msg/SensorGyro"
    gyro = vendor_channel(
        "/sensor_gyro",
        name,
        rows(
            timestamp=TIME_US + 150,
            timestamp_sample=TIME_US,
            **vector_rows(("x", "y", "z"), RATE),
        ),
        LOG_NS,
    )
    accel = vendor_channel(
        "/sensor_accel",
        "px4_msgs/msg/SensorAccel",
        rows(
            timestamp=TIME_US[keep] + 250,
            timestamp_sample=TIME_US[keep],
            **vector_rows(("x", "y", "z"), FORCE[keep]),
        ),
        LOG_NS[keep] + 400_000,
    )
    options = {"topic": "/sensor_gyro", "accel_topic": "/sensor_accel", "kind": "rate"}
    return Case(
        index(name),
        (gyro, accel),
        "rate",
        "FRD",
        STEP_DT,
        wide(RATE),
        wide(FORCE),
        options=options,
    )


GPS_MS = 600_118_000 + 5 * np.arange(COUNT)  # 200 Hz, in whole milliseconds
GPS_DT = np.full(COUNT, 0.005)


def novatel(count: int = 1, interval_ms: int = 5) -> Case:
    """NovAtel's corrected increments; the driver stamps the arrival of replayed data."""
    name = "novatel_oem7_msgs/msg/CORRIMU"
    channel = vendor_channel(
        "/novatel/oem7/corrimu",
        name,
        rows(
            header__stamp=EPOCH_NS + 400_000 * np.arange(COUNT),
            nov_header__message_name=constant("CORRIMUS"),
            nov_header__gps_week_number=constant(2100),
            nov_header__gps_week_milliseconds=600_118_000 + interval_ms * np.arange(COUNT),
            imu_data_count=constant(count),
            **vector_rows(("pitch_rate", "roll_rate", "yaw_rate"), ANGLE),
            **vector_rows(("lateral_acc", "longitudinal_acc", "vertical_acc"), VELOCITY),
        ),
        EPOCH_NS + interval_ms * 1_000_000 * np.arange(COUNT) + DELAY_NS,
    )
    dt = np.full(COUNT, 1e-3 * interval_ms)
    return Case(index(name), (channel,), "increment", "RFU", dt, ANGLE, VELOCITY)


def novatel_imu_rate() -> Case:
    """The same at the rate of the IMU, with seconds of the week."""
    name = "novatel_oem7_msgs/msg/IMURATECORRIMU"
    channel = vendor_channel(
        "/imuratecorrimu",
        name,
        rows(
            header__stamp=EPOCH_NS + 400_000 * np.arange(COUNT),
            week=constant(2100),
            seconds=GPS_MS * 1e-3,
            **vector_rows(("pitch_rate", "roll_rate", "yaw_rate"), ANGLE),
            **vector_rows(("lateral_acc", "longitudinal_acc", "vertical_acc"), VELOCITY),
        ),
        EPOCH_NS + 5_000_000 * np.arange(COUNT) + DELAY_NS,
    )
    return Case(index(name), (channel,), "increment", "RFU", GPS_DT, ANGLE, VELOCITY)


def vectornav_common(fields: Any = None) -> Channel:
    """VectorNav's common group; what `group_fields` does not name is zero."""
    mask = np.asarray(constant(0x0801 | 0x0200) if fields is None else fields)
    filled_in = (mask & 0x0800 != 0)[:, None]
    return vendor_channel(
        "/vectornav/raw/common",
        "vectornav_msgs/msg/CommonGroup",
        rows(
            header__stamp=LOG_NS,
            group_fields=mask,
            timestartup=TIME_NS,
            imu_rate=RATE,
            imu_accel=FORCE,
            deltatheta_dtime=np.where(filled_in[:, 0], STEPS_US * 1e-6, 0.0).astype(SINGLE),
            deltatheta_dtheta=np.where(filled_in, ANGLE / DEG, 0.0),
            deltatheta_dvel=np.where(filled_in, VELOCITY, 0.0),
        ),
        LOG_NS,
    )


def vectornav_increments() -> Case:
    """Delta-theta in degrees."""
    return Case(
        index("vectornav_msgs/msg/CommonGroup"),
        (vectornav_common(),),
        "increment",
        "FRD",
        wide(STEPS_US * 1e-6),
        ANGLE,
        VELOCITY,
        ulp=2,
    )


def vectornav_rates() -> Case:
    """A log without delta-theta."""
    return Case(
        index("vectornav_msgs/msg/CommonGroup", 1),
        (vectornav_common(constant(0x0201)),),
        "rate",
        "FRD",
        STEP_DT,
        RATE,
        FORCE,
    )


def vectornav_imu(mask: int) -> Channel:
    """VectorNav's IMU group, which has no time of its own."""
    return vendor_channel(
        "/vectornav/raw/imu",
        "vectornav_msgs/msg/ImuGroup",
        rows(
            header__stamp=EPOCH_NS + TIME_NS - TIME_NS[0],
            group_fields=constant(mask),
            uncompgyro=RATE,
            uncompaccel=FORCE,
            deltatheta_time=(STEPS_US * 1e-6).astype(SINGLE),
            deltatheta_dtheta=ANGLE / DEG,
            deltavel=VELOCITY,
        ),
        LOG_NS,
    )


def vectornav_imu_increments() -> Case:
    """Delta-theta of the IMU group."""
    return Case(
        index("vectornav_msgs/msg/ImuGroup"),
        (vectornav_imu(0x00CC),),
        "increment",
        "FRD",
        wide(STEPS_US * 1e-6),
        ANGLE,
        VELOCITY,
        EPOCH_NS,
        ulp=2,
    )


def vectornav_imu_rates() -> Case:
    """Rates of the IMU group."""
    return Case(
        index("vectornav_msgs/msg/ImuGroup", 1),
        (vectornav_imu(0x000C),),
        "rate",
        "FRD",
        STEP_DT,
        RATE,
        FORCE,
        EPOCH_NS,
    )


def sbg_channel(time_us: Any = TIME_US, log_ns: Any = LOG_NS) -> Channel:
    """SBG's increments divided by their interval, and its filtered rates."""
    return vendor_channel(
        "/sbg/imu_data",
        "sbg_driver/msg/SbgImuData",
        rows(
            header__stamp=log_ns,
            time_stamp=np.asarray(time_us) % (1 << 32),
            gyro=0.9 * RATE,
            accel=0.9 * FORCE,
            delta_angle=RATE,
            delta_vel=FORCE,
        ),
        log_ns,
    )


def sbg() -> Case:
    """Increments."""
    by = STEP_DT[:, None]
    name = "sbg_driver/msg/SbgImuData"
    return Case(
        index(name),
        (sbg_channel(),),
        "compensated",
        "FRD",
        STEP_DT,
        RATE * by,
        FORCE * by,
        ulp=TIMES,
    )


def sbg_rates() -> Case:
    """The filtered rates beside them."""
    name = "sbg_driver/msg/SbgImuData"
    options = {"kind": "average"}
    return Case(
        index(name, 1),
        (sbg_channel(),),
        "average",
        "FRD",
        STEP_DT,
        0.9 * RATE,
        0.9 * FORCE,
        options=options,
    )


def xsens(shift_ns: Any = 0) -> Case:
    """Rotations and velocity increments in two topics."""
    name = "geometry_msgs/msg/QuaternionStamped"
    stamps = EPOCH_NS + TIME_NS - TIME_NS[0]
    quaternions = Rotation.from_rotvec(ANGLE).as_quat()  # x, y, z, w
    dq = vendor_channel("/imu/dq", name, rows(header__stamp=stamps, quaternion=quaternions), LOG_NS)
    dv = vendor_channel(
        "/imu/dv",
        "geometry_msgs/msg/Vector3Stamped",
        rows(header__stamp=stamps + shift_ns, vector=VELOCITY),
        LOG_NS + 30_000,
    )
    options = {"topic": "/imu/dq", "accel_topic": "/imu/dv"}
    # sine, cosine and arc tangent of an angle of 1 mrad: a few roundings of 1e-16 rad
    return Case(
        index(name),
        (dq, dv),
        "compensated",
        "FLU",
        STEP_DT,
        ANGLE,
        VELOCITY,
        EPOCH_NS,
        options,
        1000,
    )


def septentrio(missing: Any = ()) -> Case:
    """Degrees per second in blocks whose lists vary in length."""
    name = "septentrio_gnss_driver/msg/ExtSensorMeas"
    rate = RATE / DEG
    rate[list(missing)] = np.nan
    sources = [np.arange(1 + k % 3) for k in range(COUNT)]
    channel = vendor_channel(
        "/extsensormeas",
        name,
        rows(
            header__stamp=LOG_NS,
            block_header__tow=GPS_MS,
            block_header__wnc=constant(2400),
            source=sources,
            type=sources,
            **vector_rows(("acceleration_x", "acceleration_y", "acceleration_z"), FORCE),
            **vector_rows(("angular_rate_x", "angular_rate_y", "angular_rate_z"), rate),
        ),
        EPOCH_NS + 5_000_000 * np.arange(COUNT) + DELAY_NS,
    )
    options = {"kind": "average"}
    return Case(
        index(name),
        (channel,),
        "average",
        "FLU",
        GPS_DT,
        RATE,
        FORCE,
        options=options,
        ulp=2,
    )


def aspn_channel(types: Any) -> Channel:
    """ASPN's IMU with lists of structures behind the numbers."""
    integrals = np.asarray(types)[:, None] == 0
    quality = [{"integrity_method": 1, "integrity_value": 0.5}]
    return vendor_channel(
        "/aspn/imu",
        "aspn23_ros_interfaces/msg/MeasurementImu",
        rows(
            time_of_validity__elapsed_nsec=TIME_NS,
            imu_type=types,
            meas_gyro=np.where(integrals, ANGLE, RATE),
            meas_accel=np.where(integrals, VELOCITY, FORCE),
            num_integrity=[k % 3 for k in range(COUNT)],
            integrity=[quality * (k % 3) for k in range(COUNT)],
        ),
        LOG_NS,
    )


def aspn_integrated() -> Case:
    """Integrals."""
    name = "aspn23_ros_interfaces/msg/MeasurementImu"
    channel = aspn_channel(constant(0))
    return Case(index(name), (channel,), "increment", "FLU", STEP_DT, ANGLE, VELOCITY)


def aspn_sampled() -> Case:
    """Samples."""
    name = "aspn23_ros_interfaces/msg/MeasurementImu"
    channel = aspn_channel(constant(1))
    return Case(index(name, 1), (channel,), "rate", "FLU", STEP_DT, RATE, FORCE)


CASES: dict[str, Callable[[], Case]] = {
    "sensor_msgs/Imu": ros_imu,
    "ImuIncrement": increments,
    "PX4 VehicleImu": px4_vehicle_imu,
    "PX4 VehicleImu, short intervals": lambda: px4_vehicle_imu("_uint16"),
    "PX4 SensorCombined": px4_sensor_combined,
    "PX4 SensorGyro and SensorAccel": px4_sensors,
    "NovAtel CORRIMU": novatel,
    "NovAtel IMURATECORRIMU": novatel_imu_rate,
    "VectorNav CommonGroup": vectornav_increments,
    "VectorNav CommonGroup, rates": vectornav_rates,
    "VectorNav ImuGroup": vectornav_imu_increments,
    "VectorNav ImuGroup, rates": vectornav_imu_rates,
    "SBG": sbg,
    "SBG, rates": sbg_rates,
    "Xsens": xsens,
    "Septentrio": septentrio,
    "ASPN, integrated": aspn_integrated,
    "ASPN, sampled": aspn_sampled,
}


def recorded(tmp_path: Path, *channels: Channel, **options: Any) -> Path:
    """A log of these topics, with another one beside them."""
    return write_log(tmp_path / "log.mcap", *channels, text_channel(), **options)


def same(found: Array, expected: Array, ulp: int) -> None:
    """Equal to the bit, or to some roundings of the largest component."""
    if not ulp:
        assert found.tobytes() == np.ascontiguousarray(expected + 0.0).tobytes()
        return
    largest = np.abs(expected).max(axis=-1, keepdims=True)
    assert np.max(np.abs(found - expected) / np.spacing(largest)) <= ulp


def turned(values: Array, axes: str) -> Array:
    """Sensor axes to forward, right, down."""
    return np.stack(TURNS[axes](*values.T), axis=1)


@pytest.mark.parametrize("name", CASES)
def test_samples_come_out_as_they_went_in(tmp_path: Path, name: str) -> None:
    case = CASES[name]()
    log = open_imu(recorded(tmp_path, *case.channels), **case.options)
    assert log.schema == IMU_SCHEMAS[case.schema]
    (imu,) = log.blocks()
    assert (imu.kind, log.axes) == (case.kind, case.axes)
    assert len(imu) == COUNT
    same(imu.gyro, turned(case.gyro, case.axes), case.ulp)
    same(imu.accel, turned(case.accel, case.axes), case.ulp)
    # 2e-15 s: the difference of two times of 2 s
    np.testing.assert_allclose(imu.dt, case.dt, rtol=1e-15, atol=2e-15)
    assert imu.epoch_ns == log.epoch_ns == case.epoch_ns
    if "GPS" not in name and "NovAtel" not in name and name != "Septentrio":
        assert np.array_equal(np.rint(imu.t * 1e9), TIME_NS - TIME_NS[0])


def test_every_entry_of_the_registry_has_a_recording() -> None:
    assert {make().schema for make in CASES.values()} == set(range(len(IMU_SCHEMAS)))


@pytest.mark.parametrize("name", CASES)
def test_axes_are_the_users_to_say(tmp_path: Path, name: str) -> None:
    case = CASES[name]()
    imu = read_imu(
        recorded(tmp_path, *case.channels), axes="x=-up y=forward z=right", **case.options
    )
    x, y, z = case.gyro.T  # x points down
    same(imu.gyro, np.stack([y, z, x], axis=1), case.ulp)


@pytest.mark.parametrize("name", CASES)
def test_chunks_and_batches_do_not_matter(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = CASES[name]()
    whole = read_imu(recorded(tmp_path, *case.channels), **case.options)
    path = recorded(tmp_path, *case.channels, chunk_bytes=3_000, compression="none")
    monkeypatch.setattr(reader, "_JOB_BYTES", 5_000)
    parts = read_imu(path, **case.options)
    assert whole.epoch_ns == parts.epoch_ns
    for column in ("t", "dt", "gyro", "accel"):
        assert getattr(whole, column).tobytes() == getattr(parts, column).tobytes()


# ---- what is wrong -----------------------------------------------------------------------------


def test_two_imus_must_be_chosen_from(tmp_path: Path) -> None:
    path = recorded(tmp_path, *sbg().channels, *xsens().channels, *aspn_sampled().channels)
    with pytest.raises(LogError, match=r"2 IMU topics.*/aspn/imu.*/sbg/imu_data"):
        open_imu(path)


def test_a_second_topic_must_be_named_where_there_are_two(tmp_path: Path) -> None:
    path = recorded(tmp_path, *xsens().channels)
    with pytest.raises(LogError, match="no IMU topic"):
        open_imu(path)
    with pytest.raises(ConfigError, match="holds no specific force; name the topic of") as error:
        open_imu(path, "/imu/dq")
    assert error.value.key == "imu.accel_topic"
    with pytest.raises(ConfigError, match="/chatter holds std_msgs/msg/String, not geometry_msgs"):
        open_imu(path, "/imu/dq", accel_topic="/chatter")
    with pytest.raises(LogError, match="no such topic"):
        open_imu(path, "/imu/dq", accel_topic="/dv")
    path = recorded(tmp_path, *sbg().channels)
    with pytest.raises(ConfigError, match=r"leave imu.accel_topic out"):
        open_imu(path, accel_topic="/chatter")


@pytest.mark.parametrize("name", ["PX4 SensorGyro and SensorAccel", "Septentrio"])
def test_a_kind_that_nothing_says_must_be_said(tmp_path: Path, name: str) -> None:
    case = CASES[name]()
    path = recorded(tmp_path, *case.channels)
    with pytest.raises(ConfigError, match="does not say what its numbers are"):
        open_imu(path, **{**case.options, "kind": None})


def test_a_kind_the_messages_do_not_hold_is_refused(tmp_path: Path) -> None:
    path = recorded(tmp_path, *sbg().channels)
    assert read_imu(path, kind="increment").kind == "increment"
    path = recorded(tmp_path, *px4_vehicle_imu().channels)
    with pytest.raises(ConfigError, match="holds increment or compensated, not kind 'rate'"):
        open_imu(path, kind="rate")
    with pytest.raises(ConfigError, match="kind 'sum' is not known"):
        open_imu(path, kind="sum")


def test_a_rate_beside_recorded_intervals_is_refused(tmp_path: Path) -> None:
    path = recorded(tmp_path, *px4_vehicle_imu().channels)
    with pytest.raises(ConfigError, match="records the length of each interval") as error:
        open_imu(path, rate_hz=200.0)
    assert error.value.key == "imu.rate_hz"
    path = recorded(tmp_path, *ros_imu().channels)
    for rate_hz in (0.0, -100.0, np.nan, np.inf):
        with pytest.raises(ConfigError, match="must be positive"):
            open_imu(path, kind="average", rate_hz=rate_hz)


# ---- traps -------------------------------------------------------------------------------------


def notes_of(path: Path, **options: Any) -> tuple[ImuSamples, str]:
    """Samples and notes of a log."""
    log = open_imu(path, **options)
    (imu,) = log.blocks()
    return imu, "\n".join(log.notes)


def test_a_covariance_that_begins_with_minus_one_drops_nothing(tmp_path: Path) -> None:
    """Read as "no estimate", nothing would be left of these messages."""
    case = ros_imu()
    imu, notes = notes_of(recorded(tmp_path, *case.channels), **case.options)
    assert len(imu) == COUNT
    assert notes == ""


def test_means_of_a_device_keep_its_increments_however_its_stamps_jitter(tmp_path: Path) -> None:
    """MicroStrain: increments over 5 ms, divided by 5 ms; stamped within 1 ms of the truth."""
    jitter_ns = np.random.default_rng(1).integers(-1_000_000, 1_000_000, COUNT)
    stamps = EPOCH_NS + 5_000_000 * np.arange(COUNT) + jitter_ns
    channel = imu_channel(Samples(stamps, ANGLE / 0.005, VELOCITY / 0.005), "/imu/data")
    path = recorded(tmp_path, channel)
    naive = read_imu(path, kind="average", axes="FRD")
    off = np.abs(naive.gyro * naive.dt[:, None] - ANGLE).max() / np.abs(ANGLE).max()
    assert off > 0.1  # of an increment
    imu = read_imu(path, kind="average", axes="FRD", rate_hz=200.0)
    assert np.all(imu.dt == 0.005)
    same(imu.gyro * imu.dt[:, None], ANGLE, 2)
    same(imu.accel * imu.dt[:, None], VELOCITY, 2)


@pytest.mark.parametrize("make", [px4_vehicle_imu, px4_sensor_combined, sbg, novatel, septentrio])
def test_a_clock_that_does_not_count_from_1970_is_tied_to_log_time(
    tmp_path: Path, make: Callable[[], Case]
) -> None:
    """Read as Unix time, 77 s since the board started is January 1970, and GPS time the 1980s."""
    case = make()
    imu, notes = notes_of(recorded(tmp_path, *case.channels), **case.options)
    assert imu.epoch_ns == EPOCH_NS + LEAST_NS
    assert f"the {IMU_SCHEMAS[case.schema].clock.title} does not count from 1970" in notes


def test_the_tie_of_a_clock_is_that_of_its_first_thousand_messages(tmp_path: Path) -> None:
    """A message that overtakes all others later on must not move what came before it."""
    count = 30_000
    log_ns = EPOCH_NS + 5_000_000 * np.arange(count) + 2_000_000
    log_ns[999] -= 300_000
    log_ns[1000:] -= 1_900_000
    rows_of = [
        {"timestamp_sample": 5_000 * k, "delta_angle_dt": 5_000, "delta_velocity_dt": 5_000}
        for k in range(count)
    ]
    channel = vendor_channel("/imu", "px4_msgs/msg/VehicleImu", rows_of, log_ns)
    path = recorded(tmp_path, channel)
    log = open_imu(path)
    assert log.clock_offset_ns == EPOCH_NS + 1_700_000
    assert read_imu(path).epoch_ns == EPOCH_NS + 1_700_000


def test_two_intervals_that_differ_are_made_one(tmp_path: Path) -> None:
    """The velocity increment of a longer interval, over the interval of the angle, is 20 % off."""
    longer = np.where(np.arange(COUNT) % 4 == 0, STEPS_US * 6 // 5, STEPS_US)
    case = px4_vehicle_imu(velocity_us=longer)
    imu, notes = notes_of(recorded(tmp_path, *case.channels))
    same(imu.gyro, case.gyro, 0)
    expected = case.accel * (STEPS_US / longer)[:, None]
    same(imu.accel, expected, 2)
    assert np.max(np.abs(case.accel - expected)) > 0.15 * np.max(np.abs(expected))
    assert "100 messages had delta_velocity_dt unlike delta_angle_dt" in notes
    assert "scaled to the angle's interval" in notes


def test_an_interval_of_zero_is_refused(tmp_path: Path) -> None:
    intervals = STEPS_US.copy()
    intervals[17] = 0
    case = px4_vehicle_imu(velocity_us=intervals)
    with pytest.raises(LogError, match=r"message 17, .*delta_velocity_dt is 0, not positive"):
        read_imu(recorded(tmp_path, *case.channels))


def test_clipping_is_told(tmp_path: Path) -> None:
    case = px4_vehicle_imu(clipped=[4 if k in (5, 9) else 0 for k in range(COUNT)])
    imu, notes = notes_of(recorded(tmp_path, *case.channels))
    assert len(imu) == COUNT
    assert "2 messages say that a sensor was out of its range (delta_angle_clipping)" in notes


def test_an_accelerometer_that_is_not_valid_is_left_out(tmp_path: Path) -> None:
    relative = [0x7FFFFFFF if k < 3 else -400 for k in range(COUNT)]
    case = px4_sensor_combined(relative)
    imu, notes = notes_of(recorded(tmp_path, *case.channels))
    same(imu.accel, case.accel[3:], 0)
    assert "3 messages without a valid accelerometer" in notes


@pytest.mark.parametrize("make", [novatel, novatel_imu_rate])
def test_pitch_comes_before_roll(tmp_path: Path, make: Callable[[], Case]) -> None:
    """Taken as roll, pitch, yaw in forward-left-up, two axes are exchanged and one turned over."""
    case = make()
    imu = read_imu(recorded(tmp_path, *case.channels))
    pitch, roll, yaw = ANGLE.T
    assert np.array_equal(imu.gyro, np.stack([roll, pitch, -yaw], axis=1))
    naive = np.stack([pitch, -roll, -yaw], axis=1)
    assert np.max(np.abs(imu.gyro - naive)) > 1e-3  # rad


def test_the_stamps_of_a_driver_are_not_those_of_the_receiver(tmp_path: Path) -> None:
    """Replayed 12.5 times too fast: header stamps would make 0.4 ms of 5 ms."""
    imu = read_imu(recorded(tmp_path, *novatel().channels))
    assert imu.t[-1] == pytest.approx(0.005 * (COUNT - 1), abs=1e-9)


@pytest.mark.parametrize("count", [1, 2])
def test_a_rate_off_by_two_is_refused(tmp_path: Path, count: int) -> None:
    """The driver's table gave 100 Hz for an IMU of 200 Hz: rates and forces halved."""
    case = novatel(count, 5 * count)
    path = recorded(tmp_path, *case.channels)
    naive = 100.0 / count * ANGLE
    true = ANGLE / (0.005 * count)
    assert np.allclose(naive, 0.5 * true)
    with pytest.raises(
        ConfigError, match="which is 200 Hz; set that, or leave rate_hz out"
    ) as error:
        read_imu(path, rate_hz=100.0)
    assert error.value.key == "imu.rate_hz"
    for rate_hz in (None, 200.0):
        imu = read_imu(path, rate_hz=rate_hz)
        same(imu.gyro / imu.dt[:, None], turned(true, "RFU"), TIMES)
    assert np.all(imu.dt == count / 200.0)


def test_corrected_increments_are_said_to_be_corrected(tmp_path: Path) -> None:
    log = open_imu(recorded(tmp_path, *novatel().channels))
    assert "has removed gravity, the rotation of the Earth" in "\n".join(log.notes)


def test_a_real_recording_of_a_receiver(shared_data: Path) -> None:
    """125 Hz on a desk, replayed 20 times too fast; the driver's own Imu says the same."""
    path = shared_data / "novatel_oem7_parked.mcap"
    log = open_imu(path, "/novatel/oem7/corrimu")
    (imu,) = log.blocks()
    assert len(imu) == 766
    assert (log.axes, log.kind) == ("RFU", "increment")
    np.testing.assert_allclose(imu.dt, 0.008, rtol=1e-12)  # s: 1e-15 s off, differences of 6 s
    driver = read_imu(path, "/gps/imu", kind="average")
    assert driver.t[-1] < 0.32  # s, of 6.12 s
    known = driver.gyro.any(axis=1)  # it writes zeros until it knows the rate of the IMU
    assert 0 < np.count_nonzero(~known) < 200
    same((imu.gyro / imu.dt[:, None])[known], driver.gyro[known], 4 * TIMES)
    same((imu.accel / imu.dt[:, None])[known], driver.accel[known], 4 * TIMES)
    assert np.abs(imu.accel / imu.dt[:, None]).max() < 0.02  # m/s^2: gravity is not in it


@pytest.mark.parametrize("make", [vectornav_increments, vectornav_imu_increments])
def test_delta_theta_is_in_degrees_unless_said_otherwise(
    tmp_path: Path, make: Callable[[], Case]
) -> None:
    """Taken as radians, everything turns 57 times too far."""
    path = recorded(tmp_path, *make().channels)
    same(read_imu(path).gyro, ANGLE, 2)
    naive = read_imu(path, gyro_unit="rad/s")
    np.testing.assert_allclose(naive.gyro, ANGLE / DEG, rtol=1e-15)


def test_members_that_are_not_filled_are_not_zeros(tmp_path: Path) -> None:
    """Two outputs share a topic; every second message has no delta-theta."""
    mask = [0x0801 if k % 2 else 0x0209 for k in range(COUNT)]
    path = recorded(tmp_path, vectornav_common(mask))
    imu, notes = notes_of(path)
    same(imu.gyro, ANGLE[1::2], 2)
    assert np.abs(imu.accel).max(axis=1).min() > 0.0
    assert f"{COUNT // 2} messages without delta-theta and time since start" in notes
    assert "(group_fields 0x0801)" in notes


def test_a_kind_chooses_among_what_a_message_holds(tmp_path: Path) -> None:
    path = recorded(tmp_path, vectornav_common())
    assert read_imu(path).kind == "increment"
    rates = read_imu(path, kind="average")
    assert rates.kind == "average"
    same(rates.gyro, RATE, 0)


def test_messages_that_hold_nothing_are_told(tmp_path: Path) -> None:
    path = recorded(tmp_path, vectornav_common(constant(0x0009)))
    with pytest.raises(LogError, match=f"no message.*{COUNT} messages without delta-theta"):
        read_imu(path)


def test_deltas_that_are_rates_are_multiplied_by_their_interval(tmp_path: Path) -> None:
    """Taken as increments they are 200 times too large."""
    imu = read_imu(recorded(tmp_path, *sbg().channels))
    assert imu.is_integrated
    np.testing.assert_allclose(imu.gyro, RATE * imu.dt[:, None], rtol=3e-16)
    assert np.median(np.abs(RATE / imu.gyro)) == pytest.approx(200.0, rel=0.02)


@pytest.mark.parametrize("pause_us", [0, 3 * 3_600_000_000])
def test_a_counter_that_starts_again_is_unwrapped(
    tmp_path: Path, pause_us: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """32 bits of microseconds are over after 71.6 min; a pause may hide more than one turn."""
    later = np.where(np.arange(COUNT) >= 200, pause_us, 0)
    time_us = (1 << 32) - 500_000 + np.cumsum(STEPS_US) + later
    raw = time_us % (1 << 32)
    assert np.diff(raw).min() < -1_000_000_000  # us: read naively, time runs back
    channel = sbg_channel(time_us, LOG_NS + 1000 * later)
    for size in (1 << 20, 3_000):
        monkeypatch.setattr(reader, "_JOB_BYTES", size)
        imu = read_imu(recorded(tmp_path, channel, chunk_bytes=size))
        # 1e-9 s: t is rounded to 1e-12 s, and the counter counts microseconds
        np.testing.assert_allclose(imu.t, (time_us - time_us[0]) * 1e-6, rtol=0.0, atol=1e-9)


def test_a_delta_quaternion_is_a_rotation_not_three_angles(tmp_path: Path) -> None:
    """Its x, y, z are half the angle."""
    case = xsens()
    imu = read_imu(recorded(tmp_path, *case.channels), axes="FRD", **case.options)
    half = Rotation.from_rotvec(ANGLE).as_quat()[:, :3]
    np.testing.assert_allclose(imu.gyro, 2.0 * half, rtol=2e-6)  # 1 - (0.005 rad)^2 / 24
    same(imu.gyro, ANGLE, 1000)


def test_a_quaternion_of_zeros_is_refused(tmp_path: Path) -> None:
    dq, dv = xsens().channels
    stamps = EPOCH_NS + TIME_NS - TIME_NS[0]
    zero = np.zeros((COUNT, 4))
    dq = vendor_channel(dq.topic, dq.schema, rows(header__stamp=stamps, quaternion=zero), LOG_NS)
    with pytest.raises(LogError, match=r"message 0, .*quaternion of zeros"):
        read_imu(recorded(tmp_path, dq, dv), "/imu/dq", accel_topic="/imu/dv")


def test_messages_of_two_topics_meet_by_their_stamps(tmp_path: Path) -> None:
    """Joined by their order, everything after a lost message would be shifted."""
    keep = np.delete(np.arange(COUNT), [7, 100, 101])
    case = px4_sensors(keep)
    imu, notes = notes_of(recorded(tmp_path, *case.channels), **case.options)
    assert len(imu) == COUNT - 3
    same(imu.gyro, case.gyro[keep], 0)
    same(imu.accel, case.accel[keep], 0)
    assert "/sensor_gyro: 3 messages without a partner were left out" in notes
    assert "/sensor_accel" not in notes


def test_topics_that_never_meet_are_refused(tmp_path: Path) -> None:
    case = xsens(shift_ns=1_000_000)
    path = recorded(tmp_path, *case.channels)
    with pytest.raises(LogError, match="no message of it has the time of one of /imu/dv"):
        read_imu(path, **case.options)


def test_degrees_per_second_are_turned_into_radians(tmp_path: Path) -> None:
    case = septentrio()
    path = recorded(tmp_path, *case.channels)
    same(read_imu(path, axes="FRD", **case.options).gyro, RATE, 2)
    naive = read_imu(path, axes="FRD", gyro_unit="rad/s", **case.options)
    np.testing.assert_allclose(naive.gyro, RATE / DEG, rtol=1e-15)


def test_blocks_of_other_sensors_are_left_out(tmp_path: Path) -> None:
    case = septentrio(missing=(3, 4, 5))
    imu, notes = notes_of(recorded(tmp_path, *case.channels), **case.options)
    assert len(imu) == COUNT - 3
    assert "3 messages without an angular rate (not NaN) were left out" in notes


def test_integrals_and_samples_of_one_topic_are_not_mixed(tmp_path: Path) -> None:
    channel = aspn_channel([k % 2 for k in range(COUNT)])
    path = recorded(tmp_path, channel)
    imu, notes = notes_of(path)
    assert imu.kind == "increment"
    same(imu.gyro, turned(ANGLE[::2], "FLU"), 0)
    assert f"{COUNT // 2} messages without integrals (imu_type 0)" in notes
    imu, notes = notes_of(path, kind="rate")
    same(imu.gyro, turned(RATE[1::2], "FLU"), 0)


def test_intervals_unlike_the_steps_are_told(tmp_path: Path) -> None:
    """Every third message kept: the recorded intervals cover a third of the time."""
    channel = increments().channels[0]
    thinned = replace(channel, messages=channel.messages[::3], log_ns=channel.log_ns[::3])
    _, notes = notes_of(recorded(tmp_path, thinned))
    assert "samples are missing, or the intervals are wrong" in notes
    _, notes = notes_of(recorded(tmp_path, channel))
    assert notes == ""


# ---- a map of one's own ------------------------------------------------------------------------

OWN = {"gyro": "imu.w", "accel": "imu.a", "time": "t_us", "time_unit": "us", "clock": "device"}


def json_channel(messages: list[Any]) -> Channel:
    """A topic of JSON."""
    text = [json.dumps(message).encode() for message in messages]
    return Channel("/own", "my.Imu", "{}", text, LOG_NS.tolist(), "jsonschema", "json")


def own_json() -> list[dict[str, Any]]:
    """Rates in degrees in a structure of one's own."""
    return [
        {
            "t_us": t,
            "imu": {"w": w, "a": dict(zip("xyz", a, strict=True))},
            "dt_ms": dt,
            "nan": np.nan,
        }
        for t, w, a, dt in zip(
            TIME_US.tolist(),
            (RATE / DEG).tolist(),
            FORCE.tolist(),
            (STEPS_US / 1000).tolist(),
            strict=True,
        )
    ]


def test_json_of_ones_own_through_the_site_file(tmp_path: Path) -> None:
    path = recorded(tmp_path, json_channel(own_json()))
    (tmp_path / "site.toml").write_text(
        """\
[imu]
topic = "/own"
kind = "average"
axes = "RFU"
gyro_unit = "deg/s"
[imu.fields]
gyro = "imu.w"
accel = ["imu.a.x", "imu.a.y", "imu.a.z"]
time = "t_us"
time_unit = "us"
clock = "device"
interval = "dt_ms"
interval_unit = "ms"
"""
    )
    site = read_site(tmp_path / "site.toml")
    log = open_imu(
        path, site.topic, site.kind, site.axes, gyro_unit=site.gyro_unit, fields=site.fields
    )
    (imu,) = log.blocks()
    assert imu.kind == "average"
    same(imu.gyro, turned(RATE, "RFU"), 2)
    same(imu.accel, turned(FORCE, "RFU"), 0)
    np.testing.assert_allclose(imu.dt, STEPS_US * 1e-6, rtol=3e-16)
    assert imu.epoch_ns == EPOCH_NS + LEAST_NS
    assert "json messages are decoded one by one" in log.notes[0]


def test_known_members_are_read_from_json_too(tmp_path: Path) -> None:
    messages = [
        {
            "header": {"stamp": {"sec": ns // 10**9, "nanosec": ns % 10**9}, "frame_id": "imu"},
            "angular_velocity": dict(zip("xyz", w, strict=True)),
            "linear_acceleration": dict(zip("xyz", f, strict=True)),
        }
        for ns, w, f in zip(
            (EPOCH_NS + TIME_NS).tolist(), RATE.tolist(), FORCE.tolist(), strict=True
        )
    ]
    channel = replace(json_channel(messages), schema="sensor_msgs/msg/Imu")
    imu = read_imu(recorded(tmp_path, channel), kind="rate", axes="FRD")
    same(imu.gyro, RATE, 0)
    assert imu.epoch_ns == EPOCH_NS + TIME_NS[0]


def test_ros_1_messages_are_read_as_those_of_ros_2(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS1_NOETIC)
    name = "sensor_msgs/msg/Imu"
    stamps = EPOCH_NS + TIME_NS - TIME_NS[0]
    messages = [
        bytes(
            store.serialize_ros1(
                filled(
                    store,
                    name,
                    {
                        "header.seq": k,
                        "header.stamp": stamps[k],
                        "header.frame_id": "imu" * (k % 3),
                        "angular_velocity": RATE[k],
                        "linear_acceleration": FORCE[k],
                    },
                ),
                name,
            )
        )
        for k in range(COUNT)
    ]
    text = store.generate_msgdef(name, ros_version=1)[0]
    channel = Channel("/imu", "sensor_msgs/Imu", text, messages, LOG_NS.tolist(), "ros1msg", "ros1")
    imu = read_imu(recorded(tmp_path, channel), kind="rate", axes="FRD")
    same(imu.gyro, RATE, 0)
    same(imu.accel, FORCE, 0)
    assert imu.epoch_ns == EPOCH_NS


def test_protobuf_of_ones_own(tmp_path: Path) -> None:
    """A message type made on the spot, written by the official writer for protobuf."""
    pytest.importorskip("google.protobuf", reason="the extra `protobuf` is not installed")
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
    from mcap_protobuf.writer import Writer

    file = descriptor_pb2.FileDescriptorProto(name="own.proto", package="own", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    message = file.message_type.add(name="Imu")
    number = descriptor_pb2.FieldDescriptorProto
    message.field.add(
        name="stamp",
        number=1,
        label=number.LABEL_OPTIONAL,
        type=number.TYPE_MESSAGE,
        type_name=".google.protobuf.Timestamp",
    )
    for place, member in enumerate(("w", "f"), start=2):
        message.field.add(
            name=member, number=place, label=number.LABEL_REPEATED, type=number.TYPE_DOUBLE
        )
    pool = descriptor_pool.Default()
    timestamp_pb2.Timestamp()  # its file is in the pool
    pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName("own.Imu"))
    path = tmp_path / "own.mcap"
    stamps = EPOCH_NS + TIME_NS - TIME_NS[0]
    with path.open("wb") as stream, Writer(stream) as writer:
        for ns, w, f, log_ns in zip(
            stamps.tolist(), RATE.tolist(), FORCE.tolist(), LOG_NS.tolist(), strict=True
        ):
            one = kind(w=w, f=f)
            one.stamp.seconds, one.stamp.nanos = divmod(ns, 10**9)
            writer.write_message("/own", one, log_ns, log_ns)
    fields = ImuFields("w", "f", time="stamp")
    imu = read_imu(path, "/own", "rate", "FRD", fields=fields)
    same(imu.gyro, RATE, 0)
    same(imu.accel, FORCE, 0)
    assert imu.epoch_ns == EPOCH_NS


def test_fields_may_overrule_an_entry_of_the_registry(tmp_path: Path) -> None:
    """The bias-free rates of VectorNav, which no entry reads."""
    path = recorded(tmp_path, vectornav_common())
    fields = ImuFields("imu_rate", "imu_accel", "timestartup", time_unit="ns", clock="device")
    imu = read_imu(path, "/vectornav/raw/common", "rate", "FRD", fields=fields)
    same(imu.gyro, RATE, 0)
    assert imu.epoch_ns == EPOCH_NS + LEAST_NS


def test_fields_may_be_in_two_topics(tmp_path: Path) -> None:
    case = xsens()
    path = recorded(tmp_path, *case.channels)
    fields = ImuFields(("quaternion.x", "quaternion.y", "quaternion.z"), "vector")
    imu = read_imu(path, "/imu/dq", "increment", "FRD", accel_topic="/imu/dv", fields=fields)
    same(imu.accel, VELOCITY, 0)
    np.testing.assert_allclose(imu.gyro, 0.5 * ANGLE, rtol=2e-6)  # half angles, as asked for


@pytest.mark.parametrize(
    ("changed", "error", "fact"),
    [
        ({"gyro": "imu.v"}, SchemaError, "/own: a message has no imu.v"),
        ({"accel": "t_us"}, SchemaError, "/own: t_us is not a vector of 3 numbers"),
        ({"gyro": ("imu.w", "t_us", "t_us")}, SchemaError, "is not a vector of 3 numbers"),
        ({"time": "imu.w"}, SchemaError, "/own: imu.w is not a time"),
        ({"time": "dt_ms", "time_unit": "ns"}, SchemaError, "/own: dt_ms may have a fraction of"),
        ({"time": "nan"}, SchemaError, "/own: nan is not finite in all messages"),
        ({"clock": None}, ConfigError, "imu.fields.clock: is missing; a time that is a"),
        ({"time_unit": None}, ConfigError, "imu.fields.time_unit: is missing"),
        (
            {"time_unit": "min"},
            ConfigError,
            "imu.fields.time_unit: 'min' is not one of s, ms, us, ns",
        ),
        ({"interval_unit": "Hz"}, ConfigError, "imu.fields.interval_unit: 'Hz' is not one of"),
        ({"clock": "gps"}, ConfigError, "imu.fields.clock: 'gps' is not one of unix, device"),
    ],
)
def test_a_wrong_map_is_told(
    tmp_path: Path, changed: dict[str, Any], error: type[Exception], fact: str
) -> None:
    path = recorded(tmp_path, json_channel(own_json()))
    with pytest.raises(error) as caught:
        read_imu(path, "/own", "rate", fields=ImuFields(**{**OWN, **changed}))
    assert fact in str(caught.value)


def test_a_map_needs_its_topic_and_kind(tmp_path: Path) -> None:
    path = recorded(tmp_path, json_channel(own_json()))
    with pytest.raises(ConfigError, match="needs the topic") as error:
        open_imu(path, kind="rate", fields=ImuFields(**OWN))
    assert error.value.key == "imu.topic"
    with pytest.raises(ConfigError, match=r"my.Imu does not say what its numbers are"):
        open_imu(path, "/own", fields=ImuFields(**OWN))


def test_an_unknown_type_says_what_can_be_done(tmp_path: Path) -> None:
    path = recorded(tmp_path, json_channel(own_json()))
    with pytest.raises(SchemaError, match=r"my.Imu is not an IMU schema.*\[imu.fields\] can say"):
        open_imu(path, "/own")


def test_rates_and_intervals_are_compared_for_ones_own_too(tmp_path: Path) -> None:
    path = recorded(tmp_path, json_channel(own_json()))
    assert np.all(
        read_imu(path, "/own", "rate", rate_hz=200.0, fields=ImuFields(**OWN)).dt == 0.005
    )
    with pytest.raises(ConfigError, match=r"imu.rate_hz = 100 makes intervals of 0.01 s"):
        read_imu(path, "/own", "rate", rate_hz=100.0, fields=ImuFields(**OWN))
