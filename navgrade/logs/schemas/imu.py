"""How message types carry IMU samples: one entry each, facts alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import ConfigError
from navgrade.imu import KINDS, Kind
from navgrade.logs.schemas.clock import HEADER_STAMP, TIME_UNITS, Clock, boot_time, gps_time

Vector = str | tuple[str, str, str]
CLOCKS = ("unix", "device")


@dataclass(frozen=True)
class Condition:
    """Which messages of a topic count.

    Attributes
    ----------
    path : str
    holds : callable
        Of a column of that member; its rows that count.
    text : str
        What it asks for, in words.
    """

    path: str
    holds: Callable[[NDArray[Any]], NDArray[np.bool_]]
    text: str


@dataclass(frozen=True)
class ImuSchema:
    """How a message type carries IMU samples.

    Attributes
    ----------
    name : str
        Of the message type, in ROS 2 spelling.
    source : str
        Who records it.
    gyro, accel : str or tuple of str
        Path of the vector, or of its x, y and z.
    kinds : tuple of str
        What the numbers can be; when it is one, nobody needs to say it.
    default_kind : str or None
        Kind when nobody says it; None makes it a required choice.
    axes : str or None
        Where x, y and z point; None where the message type leaves it open.
    gyro_unit, accel_unit : str
        Of the rates, or of the rates whose integrals the increments are.
    clock : Clock
        Of the end of the interval.
    interval : (str, float) or None
        Path of the interval's length, and how many of its units make a second; None where the
        stamps must give it.
    accel_interval : (str, float) or None
        Likewise of the velocity increment, where it has an interval of its own.
    count : str or None
        Path of the number of IMU samples summed in a message.
    rates : bool
        The increments are recorded divided by their interval.
    quaternion : bool
        `gyro` is the rotation over the interval as a quaternion x, y, z, w.
    condition : Condition or None
        Messages that do not meet it are left out, and counted.
    clipping : tuple of str
        Members that are not zero when a sensor was out of its range.
    accel_name : str or None
        Type of the second topic's messages, which hold `accel`; joined by equal stamps.
    warning : str or None
        What a user must know whenever this is read.
    traps : tuple of str
        What has gone wrong with it, and what is done about it.
    """

    name: str
    source: str
    gyro: Vector
    accel: Vector
    kinds: tuple[Kind, ...]
    default_kind: Kind | None
    axes: str | None = None
    gyro_unit: str = "rad/s"
    accel_unit: str = "m/s^2"
    clock: Clock = HEADER_STAMP
    interval: tuple[str, float] | None = None
    accel_interval: tuple[str, float] | None = None
    count: str | None = None
    rates: bool = False
    quaternion: bool = False
    condition: Condition | None = None
    clipping: tuple[str, ...] = ()
    accel_name: str | None = None
    warning: str | None = None
    traps: tuple[str, ...] = field(default=(), repr=False)


def _wrong(key: str, text: str) -> ConfigError:
    return ConfigError(f"imu.fields.{key}: {text}", key=f"imu.fields.{key}")


@dataclass(frozen=True)
class ImuFields:
    """Where the samples stand in messages that have no entry here: ``[imu.fields]``.

    Attributes
    ----------
    gyro, accel : str or tuple of str
        Path of the vector, or of its x, y and z. With an `accel_topic`, `accel` is in the messages
        of that topic.
    time : str
        Path of the end of the interval: a stamp, or a number.
    time_unit : {"s", "ms", "us", "ns"} or None
        Of a number.
    clock : {"unix", "device"} or None
        Where a number counts from: 1970, or anything else, which is tied to log time.
    interval : str or None
        Path of the interval's length; without one the stamps give it.
    interval_unit : {"s", "ms", "us", "ns"}

    Raises
    ------
    ConfigError
        On an unknown unit or clock, or when only one of `time_unit` and `clock` is given.
    """

    gyro: Vector
    accel: Vector
    time: str = "header.stamp"
    time_unit: str | None = None
    clock: str | None = None
    interval: str | None = None
    interval_unit: str = "s"

    def __post_init__(self) -> None:
        if (self.time_unit is None) != (self.clock is None):
            missing = "clock" if self.clock is None else "time_unit"
            raise _wrong(missing, "is missing; a time that is a number needs time_unit and clock")
        for key, value, known in (
            ("time_unit", self.time_unit or "ns", TIME_UNITS),
            ("interval_unit", self.interval_unit, TIME_UNITS),
            ("clock", self.clock or "unix", CLOCKS),
        ):
            if value not in known:
                raise _wrong(key, f"{value!r} is not one of {', '.join(known)}")

    def schema(self, name: str, accel_name: str | None) -> ImuSchema:
        """The entry for messages of this name."""
        unit = TIME_UNITS[self.time_unit or "ns"]
        interval = None
        if self.interval is not None:
            interval = (self.interval, 1e9 / TIME_UNITS[self.interval_unit])
        return ImuSchema(
            name=name,
            source="site file",
            gyro=self.gyro,
            accel=self.accel,
            kinds=KINDS,
            default_kind=None,
            clock=Clock(((self.time, unit),), unix=self.clock != "device"),
            interval=interval,
            accel_name=accel_name,
        )


def has_bits(path: str, mask: int, what: str) -> Condition:
    """The messages whose bit mask says that all of it is there."""
    return Condition(path, lambda bits: (bits & mask) == mask, f"{what} ({path} {mask:#06x})")


_MICROSECONDS = 1e6  # in a second
_INCREMENTS: tuple[Kind, ...] = ("increment", "compensated")
_SAMPLES: tuple[Kind, ...] = ("rate", "average")

IMU = ImuSchema(
    name="sensor_msgs/msg/Imu",
    source="ROS",
    gyro="angular_velocity",
    accel="linear_acceleration",
    kinds=KINDS,
    default_kind=None,
    traps=(
        'A covariance that begins with -1 means "no estimate", but NovAtel\'s driver writes it '
        "on valid data: covariances are not read, no message is left out.",
        "MicroStrain's driver (imu/data) records the device's increments divided by their "
        'interval, and its stamps jitter: say kind "average" and rate_hz, so that each '
        "interval is 1/rate_hz.",
        "NovAtel's driver multiplies increments by an IMU rate from a table; a wrong rate there "
        "scales everything (a factor of two was recorded). Read CORRIMU instead where it is in "
        "the log; at rest, alignment compares |f| with gravity.",
        'Frames that end in _ned are forward-right-down; say axes "FRD".',
    ),
)

IMU_INCREMENT = ImuSchema(
    name="navgrade_msgs/msg/ImuIncrement",
    source="navgrade",
    gyro="delta_angle",
    accel="delta_velocity",
    kinds=_INCREMENTS,
    default_kind="increment",
    interval=("interval_s", 1.0),
)

PX4_VEHICLE_IMU = ImuSchema(
    name="px4_msgs/msg/VehicleImu",
    source="PX4",
    gyro="delta_angle",
    accel="delta_velocity",
    kinds=_INCREMENTS,
    default_kind="increment",
    axes="FRD",
    clock=boot_time("timestamp_sample"),
    interval=("delta_angle_dt", _MICROSECONDS),
    accel_interval=("delta_velocity_dt", _MICROSECONDS),
    clipping=("delta_angle_clipping", "delta_velocity_clipping"),
    traps=(
        "The two increments have intervals of their own; where they differ, the velocity "
        "increment is scaled to the interval of the angle, and told.",
        "Time counts from the start of the board, not from 1970: it is tied to log time.",
        "delta_angle is already corrected for coning, delta_velocity not for sculling.",
    ),
)

PX4_SENSOR_COMBINED = ImuSchema(
    name="px4_msgs/msg/SensorCombined",
    source="PX4",
    gyro="gyro_rad",
    accel="accelerometer_m_s2",
    kinds=("average",),
    default_kind="average",
    axes="FRD",
    clock=boot_time("timestamp"),
    interval=("gyro_integral_dt", _MICROSECONDS),
    condition=Condition(
        "accelerometer_timestamp_relative",
        lambda relative: relative != 0x7FFFFFFF,
        "a valid accelerometer (accelerometer_timestamp_relative is not 0x7fffffff)",
    ),
    clipping=("gyro_clipping", "accelerometer_clipping"),
    traps=(
        "Time counts from the start of the board, not from 1970: it is tied to log time.",
        "Where accelerometer_timestamp_relative is 0x7fffffff the specific force is not valid: "
        "such messages are left out, and counted.",
    ),
)

PX4_SENSORS = ImuSchema(
    name="px4_msgs/msg/SensorGyro",
    source="PX4",
    gyro=("x", "y", "z"),
    accel=("x", "y", "z"),
    kinds=_SAMPLES,
    default_kind=None,
    axes="FRD",
    clock=boot_time("timestamp_sample"),
    accel_name="px4_msgs/msg/SensorAccel",
    traps=(
        "Two topics: a gyroscope and an accelerometer of one chip share timestamp_sample; the "
        "times of two chips never meet.",
        "Time counts from the start of the board, not from 1970: it is tied to log time.",
        'With samples greater than 1 the numbers are means: kind "average".',
    ),
)

_NOVATEL_WARNING = (
    "the receiver has removed gravity, the rotation of the Earth and its estimates of the "
    "sensors' errors from these increments: they cannot be navigated as they are"
)
_NOVATEL_TRAPS = (
    "Rates come in the order pitch (x, right), roll (y, forward), yaw (z, up), forces as "
    "lateral (x), longitudinal (y), vertical (z).",
    "They are called rates and accelerations, and are increments.",
    "header.stamp is the arrival at the driver, and in replayed files has nothing to do with the "
    "data: the receiver's GPS time is taken, and tied to log time.",
    "Gravity, the Earth's rotation and the estimated errors are already removed.",
)
NOVATEL_CORRIMU = ImuSchema(
    name="novatel_oem7_msgs/msg/CORRIMU",
    source="NovAtel OEM7",
    gyro=("pitch_rate", "roll_rate", "yaw_rate"),
    accel=("lateral_acc", "longitudinal_acc", "vertical_acc"),
    kinds=_INCREMENTS,
    default_kind="increment",
    axes="RFU",
    clock=gps_time("nov_header.gps_week_number", "nov_header.gps_week_milliseconds", "ms"),
    count="imu_data_count",
    warning=_NOVATEL_WARNING,
    traps=(
        *_NOVATEL_TRAPS,
        "A message sums imu_data_count samples of the IMU. A wrong rate of the IMU makes every "
        "interval wrong by a factor (two, for one sensor): intervals are steps of GPS time, and "
        "a rate_hz that contradicts them is refused.",
    ),
)
NOVATEL_IMURATECORRIMU = ImuSchema(
    name="novatel_oem7_msgs/msg/IMURATECORRIMU",
    source="NovAtel OEM7",
    gyro=("pitch_rate", "roll_rate", "yaw_rate"),
    accel=("lateral_acc", "longitudinal_acc", "vertical_acc"),
    kinds=_INCREMENTS,
    default_kind="increment",
    axes="RFU",
    clock=gps_time("week", "seconds", "s"),
    warning=_NOVATEL_WARNING,
    traps=_NOVATEL_TRAPS,
)

_VECTORNAV_DEGREES = (
    "The definition states no unit; VectorNav's manuals give delta-theta in degrees. Say "
    'gyro_unit "rad/s" where a driver has converted it.'
)
_VECTORNAV_MASK = (
    "group_fields says which members are filled; the others are zero, not missing. Messages "
    "without what is read are left out, and counted."
)
VECTORNAV_COMMON = ImuSchema(
    name="vectornav_msgs/msg/CommonGroup",
    source="VectorNav",
    gyro="deltatheta_dtheta",
    accel="deltatheta_dvel",
    kinds=_INCREMENTS,
    default_kind="increment",
    axes="FRD",
    gyro_unit="deg/s",
    clock=boot_time("timestartup", "ns"),
    interval=("deltatheta_dtime", 1.0),
    condition=has_bits("group_fields", 0x0801, "delta-theta and time since start"),
    traps=(_VECTORNAV_DEGREES, _VECTORNAV_MASK),
)
VECTORNAV_COMMON_RATES = ImuSchema(
    name="vectornav_msgs/msg/CommonGroup",
    source="VectorNav",
    gyro="imu_rate",
    accel="imu_accel",
    kinds=_SAMPLES,
    default_kind="rate",
    axes="FRD",
    clock=boot_time("timestartup", "ns"),
    condition=has_bits("group_fields", 0x0201, "uncompensated IMU and time since start"),
    traps=(_VECTORNAV_MASK,),
)
VECTORNAV_IMU = ImuSchema(
    name="vectornav_msgs/msg/ImuGroup",
    source="VectorNav",
    gyro="deltatheta_dtheta",
    accel="deltavel",
    kinds=_INCREMENTS,
    default_kind="increment",
    axes="FRD",
    gyro_unit="deg/s",
    interval=("deltatheta_time", 1.0),
    condition=has_bits("group_fields", 0x00C0, "delta-theta and delta-v"),
    traps=(
        _VECTORNAV_DEGREES,
        _VECTORNAV_MASK,
        "It has no time of the sensor: header.stamp is the arrival at the driver.",
    ),
)
VECTORNAV_IMU_RATES = ImuSchema(
    name="vectornav_msgs/msg/ImuGroup",
    source="VectorNav",
    gyro="uncompgyro",
    accel="uncompaccel",
    kinds=_SAMPLES,
    default_kind="rate",
    axes="FRD",
    condition=has_bits("group_fields", 0x000C, "uncompensated gyro and accelerometer"),
    traps=(
        _VECTORNAV_MASK,
        "It has no time of the sensor: header.stamp is the arrival at the driver.",
    ),
)

_SBG_TIME = (
    "time_stamp counts microseconds from power-on in 32 bits and starts again after 71.6 min: "
    "it is unwrapped, and tied to log time."
)
_SBG_AXES = (
    "With use_enu the driver turns y and z over, which is forward-left-up, whatever its comments "
    'say: then say axes "FLU".'
)
SBG_IMU = ImuSchema(
    name="sbg_driver/msg/SbgImuData",
    source="SBG Systems",
    gyro="delta_angle",
    accel="delta_vel",
    kinds=("compensated", "increment"),
    default_kind="compensated",
    axes="FRD",
    clock=boot_time("time_stamp", bits=32),
    rates=True,
    traps=(
        "delta_angle and delta_vel are rates, rad/s and m/s^2: increments divided by their "
        "interval. They are multiplied by it.",
        _SBG_TIME,
        _SBG_AXES,
    ),
)
SBG_IMU_RATES = ImuSchema(
    name="sbg_driver/msg/SbgImuData",
    source="SBG Systems",
    gyro="gyro",
    accel="accel",
    kinds=_SAMPLES,
    default_kind="average",
    axes="FRD",
    clock=boot_time("time_stamp", bits=32),
    traps=("gyro and accel have passed a filter of the sensor.", _SBG_TIME, _SBG_AXES),
)

XSENS = ImuSchema(
    name="geometry_msgs/msg/QuaternionStamped",
    source="Xsens",
    gyro="quaternion",
    accel="vector",
    kinds=("compensated", "increment"),
    default_kind="compensated",
    quaternion=True,
    accel_name="geometry_msgs/msg/Vector3Stamped",
    traps=(
        "Two topics, /imu/dq and /imu/dv: name the second with accel_topic; messages of one "
        "stamp belong together.",
        "dq is the rotation over the interval, not an attitude: its rotation vector is taken, "
        "which is free of coning.",
    ),
)

SEPTENTRIO = ImuSchema(
    name="septentrio_gnss_driver/msg/ExtSensorMeas",
    source="Septentrio",
    gyro=("angular_rate_x", "angular_rate_y", "angular_rate_z"),
    accel=("acceleration_x", "acceleration_y", "acceleration_z"),
    kinds=_SAMPLES,
    default_kind=None,
    gyro_unit="deg/s",
    clock=gps_time("block_header.wnc", "block_header.tow", "ms"),
    condition=Condition("angular_rate_x", np.isfinite, "an angular rate (not NaN)"),
    traps=(
        "Angular rates are in degrees per second, forces in m/s^2.",
        "Blocks of other sensors (speed, temperature) leave the rates NaN: such messages are "
        "left out, and counted.",
        "use_ros_axis_orientation decides the axes: true makes them FLU, false FRD.",
        "Time is GPS week and time of week: it is tied to log time.",
    ),
)

_ASPN_TIME = (
    "The clock of time_of_validity is named in another message (metadata): it is tied to log time."
)
_ASPN_TYPE = (
    "imu_type says message by message whether these are integrals or samples: messages of the "
    "other type are left out, and counted."
)
ASPN_INTEGRATED = ImuSchema(
    name="aspn23_ros_interfaces/msg/MeasurementImu",
    source="ASPN-2023",
    gyro="meas_gyro",
    accel="meas_accel",
    kinds=_INCREMENTS,
    default_kind="increment",
    clock=boot_time("time_of_validity.elapsed_nsec", "ns"),
    condition=Condition("imu_type", lambda kind: kind == 0, "integrals (imu_type 0)"),
    traps=(_ASPN_TYPE, _ASPN_TIME),
)
ASPN_SAMPLED = ImuSchema(
    name="aspn23_ros_interfaces/msg/MeasurementImu",
    source="ASPN-2023",
    gyro="meas_gyro",
    accel="meas_accel",
    kinds=_SAMPLES,
    default_kind="rate",
    clock=boot_time("time_of_validity.elapsed_nsec", "ns"),
    condition=Condition("imu_type", lambda kind: kind == 1, "samples (imu_type 1)"),
    traps=(_ASPN_TYPE, _ASPN_TIME),
)

IMU_SCHEMAS: tuple[ImuSchema, ...] = (
    IMU,
    IMU_INCREMENT,
    PX4_VEHICLE_IMU,
    PX4_SENSOR_COMBINED,
    PX4_SENSORS,
    NOVATEL_CORRIMU,
    NOVATEL_IMURATECORRIMU,
    VECTORNAV_COMMON,
    VECTORNAV_COMMON_RATES,
    VECTORNAV_IMU,
    VECTORNAV_IMU_RATES,
    SBG_IMU,
    SBG_IMU_RATES,
    XSENS,
    SEPTENTRIO,
    ASPN_INTEGRATED,
    ASPN_SAMPLED,
)
