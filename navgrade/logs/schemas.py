"""The message schemas this program reads; one entry each.

Reader, writer, documentation and round-trip tests follow from an entry.
"""

from __future__ import annotations

from dataclasses import dataclass

from navgrade.imu import KINDS, Kind
from navgrade.logs.messages import HEADER, QUATERNION, TIME, VECTOR3, Schema, definition
from navgrade.vertical import Quantity


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
    text=definition(
        """\
std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance""",
        HEADER,
        TIME,
        QUATERNION,
        VECTOR3,
    ),
    gyro=_xyz("angular_velocity"),
    accel=_xyz("linear_acceleration"),
    interval=None,
    kinds=KINDS,
    default_kind=None,
)

IMU_INCREMENT = ImuSchema(
    name="navgrade_msgs/msg/ImuIncrement",
    text=definition(
        """\
# Integrals of angular rate and specific force over an interval.
std_msgs/Header header                  # stamp: end of the interval
float64 interval_s
geometry_msgs/Vector3 delta_angle       # rad
geometry_msgs/Vector3 delta_velocity    # m/s""",
        HEADER,
        TIME,
        VECTOR3,
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
    text=definition(
        """\
std_msgs/Header header
float64 fluid_pressure
float64 variance""",
        HEADER,
        TIME,
    ),
    field="fluid_pressure",
    quantities=("pressure_pa",),
    stamped=True,
)

FLOAT64 = HeightSchema(
    name="std_msgs/msg/Float64",
    text=definition("float64 data"),
    field="data",
    quantities=("height_m", "pressure_pa"),
    stamped=False,
)

FLOAT32 = HeightSchema(
    name="std_msgs/msg/Float32",
    text=definition("float32 data"),
    field="data",
    quantities=("height_m", "pressure_pa"),
    stamped=False,
)

HEIGHT_SCHEMAS: dict[str, HeightSchema] = {
    schema.name: schema for schema in (FLUID_PRESSURE, FLOAT64, FLOAT32)
}
