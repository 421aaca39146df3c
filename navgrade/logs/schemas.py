"""The message schemas this program reads and writes; one entry each.

Reader, writer, documentation and round-trip tests follow from an entry.
"""

from __future__ import annotations

from dataclasses import dataclass

from navgrade.imu import KINDS, Kind
from navgrade.vertical import Quantity

_SEPARATOR = "=" * 80

_HEADER = """\
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id"""
_TIME = """\
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec"""
_VECTOR3 = """\
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z"""
_QUATERNION = """\
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w"""
_NAV_SAT_STATUS = """\
MSG: sensor_msgs/NavSatStatus
int8 STATUS_NO_FIX=-1
int8 STATUS_FIX=0
int8 STATUS_SBAS_FIX=1
int8 STATUS_GBAS_FIX=2
int8 status
uint16 SERVICE_GPS=1
uint16 SERVICE_GLONASS=2
uint16 SERVICE_COMPASS=4
uint16 SERVICE_GALILEO=8
uint16 service"""


def _definition(*parts: str) -> str:
    return f"\n{_SEPARATOR}\n".join(parts) + "\n"


@dataclass(frozen=True)
class Schema:
    """A message type and its self-contained ``ros2msg`` definition."""

    name: str
    text: str


@dataclass(frozen=True)
class ImuSchema(Schema):
    """A message type that carries IMU samples.

    Attributes
    ----------
    gyro, accel : tuple of str
        Paths of the x, y, z members: rad/s and m/s^2, or rad and m/s.
    interval : str or None
        Path of the interval's length, s; None where the stamps must give it.
    kinds : tuple of str
        What the numbers can be; when it is one, nobody needs to say it.
    default_kind : str or None
        Kind when nobody says it; None makes it a required choice.
    """

    gyro: tuple[str, str, str]
    accel: tuple[str, str, str]
    interval: str | None
    kinds: tuple[Kind, ...]
    default_kind: Kind | None


@dataclass(frozen=True)
class HeightSchema(Schema):
    """A message type that carries a height or a static pressure.

    Attributes
    ----------
    field : str
        Path of the member.
    quantities : tuple of str
        What the number can be; the first is taken when nobody says it.
    stamped : bool
        There is a header; without one, log time must do.
    """

    field: str
    quantities: tuple[Quantity, ...]
    stamped: bool


def _xyz(path: str) -> tuple[str, str, str]:
    return f"{path}.x", f"{path}.y", f"{path}.z"


IMU = ImuSchema(
    name="sensor_msgs/msg/Imu",
    text=_definition(
        """\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance""",
        _HEADER,
        _TIME,
        _QUATERNION,
        _VECTOR3,
    ),
    gyro=_xyz("angular_velocity"),
    accel=_xyz("linear_acceleration"),
    interval=None,
    kinds=KINDS,
    default_kind=None,
)

IMU_INCREMENT = ImuSchema(
    name="navgrade_msgs/msg/ImuIncrement",
    text=_definition(
        """\
# Integrals of angular rate and specific force over an interval.
std_msgs/Header header                  # stamp: end of the interval
float64 interval_s
geometry_msgs/Vector3 delta_angle       # rad
geometry_msgs/Vector3 delta_velocity    # m/s""",
        _HEADER,
        _TIME,
        _VECTOR3,
    ),
    gyro=_xyz("delta_angle"),
    accel=_xyz("delta_velocity"),
    interval="interval_s",
    kinds=("increment", "compensated"),
    default_kind="increment",
)

IMU_SCHEMAS: dict[str, ImuSchema] = {schema.name: schema for schema in (IMU, IMU_INCREMENT)}

FLUID_PRESSURE = HeightSchema(
    name="sensor_msgs/msg/FluidPressure",
    text=_definition(
        """\
std_msgs/Header header
float64 fluid_pressure
float64 variance""",
        _HEADER,
        _TIME,
    ),
    field="fluid_pressure",
    quantities=("pressure_pa",),
    stamped=True,
)

FLOAT64 = HeightSchema(
    name="std_msgs/msg/Float64",
    text=_definition("float64 data"),
    field="data",
    quantities=("height_m", "pressure_pa"),
    stamped=False,
)

FLOAT32 = HeightSchema(
    name="std_msgs/msg/Float32",
    text=_definition("float32 data"),
    field="data",
    quantities=("height_m", "pressure_pa"),
    stamped=False,
)

HEIGHT_SCHEMAS: dict[str, HeightSchema] = {
    schema.name: schema for schema in (FLUID_PRESSURE, FLOAT64, FLOAT32)
}

NAV_SOLUTION = Schema(
    name="navgrade_msgs/msg/NavSolution",
    text=_definition(
        """\
# Position, velocity and attitude of the body over the WGS-84 ellipsoid.
std_msgs/Header header                  # stamp: instant of the solution
float64 latitude_deg                    # geodetic
float64 longitude_deg
float64 height_m                        # above the ellipsoid
float64 v_north_m_s
float64 v_east_m_s
float64 v_down_m_s
float64 roll_deg
float64 pitch_deg
float64 heading_deg                     # clockwise from true north, 0 to 360
geometry_msgs/Quaternion orientation    # body (forward-right-down) to north-east-down
uint32 status                           # 1 bridged, 2 stretched, 4 short window,
                                        # 8 shifted window, 16 no pressure height""",
        _HEADER,
        _TIME,
        _QUATERNION,
    ),
)

NAV_SAT_FIX = Schema(
    name="sensor_msgs/msg/NavSatFix",
    text=_definition(
        """\
std_msgs/Header header
sensor_msgs/NavSatStatus status
float64 latitude
float64 longitude
float64 altitude
float64[9] position_covariance
uint8 COVARIANCE_TYPE_UNKNOWN=0
uint8 COVARIANCE_TYPE_APPROXIMATED=1
uint8 COVARIANCE_TYPE_DIAGONAL_KNOWN=2
uint8 COVARIANCE_TYPE_KNOWN=3
uint8 position_covariance_type""",
        _HEADER,
        _TIME,
        _NAV_SAT_STATUS,
    ),
)
