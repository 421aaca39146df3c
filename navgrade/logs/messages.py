"""The message definitions this program writes: self-contained ``ros2msg`` texts."""

from __future__ import annotations

from dataclasses import dataclass

_SEPARATOR = "=" * 80

HEADER = """\
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id"""
TIME = """\
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec"""
VECTOR3 = """\
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z"""
QUATERNION = """\
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w"""
POINT = """\
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z"""
POSE = """\
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation"""
POSE_WITH_COVARIANCE = """\
MSG: geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance"""
TWIST = """\
MSG: geometry_msgs/Twist
geometry_msgs/Vector3 linear
geometry_msgs/Vector3 angular"""
TWIST_WITH_COVARIANCE = """\
MSG: geometry_msgs/TwistWithCovariance
geometry_msgs/Twist twist
float64[36] covariance"""
TRANSFORM = """\
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation"""
TRANSFORM_STAMPED = """\
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform"""
NAV_SAT_STATUS = """\
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


def definition(*parts: str) -> str:
    """Join a message's definition and those of its members' types."""
    return f"\n{_SEPARATOR}\n".join(parts) + "\n"


@dataclass(frozen=True)
class Schema:
    """A message type and its self-contained ``ros2msg`` definition."""

    name: str
    text: str


NAV_SOLUTION = Schema(
    name="navgrade_msgs/msg/NavSolution",
    text=definition(
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
        HEADER,
        TIME,
        QUATERNION,
    ),
)

IMU = Schema(
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
)

IMU_INCREMENT = Schema(
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
)

NAV_SAT_FIX = Schema(
    name="sensor_msgs/msg/NavSatFix",
    text=definition(
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
        HEADER,
        TIME,
        NAV_SAT_STATUS,
    ),
)

ODOMETRY = Schema(
    name="nav_msgs/msg/Odometry",
    text=definition(
        """\
std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist""",
        HEADER,
        TIME,
        POSE_WITH_COVARIANCE,
        POSE,
        POINT,
        QUATERNION,
        TWIST_WITH_COVARIANCE,
        TWIST,
        VECTOR3,
    ),
)

TF_MESSAGE = Schema(
    name="tf2_msgs/msg/TFMessage",
    text=definition(
        "geometry_msgs/TransformStamped[] transforms",
        TRANSFORM_STAMPED,
        HEADER,
        TIME,
        TRANSFORM,
        VECTOR3,
        QUATERNION,
    ),
)

# Foxglove's own message, without the colour and notes it may also carry.
LOCATION_FIX = Schema(
    name="foxglove_msgs/msg/LocationFix",
    text=definition(
        """\
builtin_interfaces/Time timestamp
string frame_id
float64 latitude
float64 longitude
float64 altitude
float64[9] position_covariance
uint8 UNKNOWN=0
uint8 APPROXIMATED=1
uint8 DIAGONAL_KNOWN=2
uint8 KNOWN=3
uint8 position_covariance_type
float64 heading                         # rad, clockwise from true north
float64 heading_variance                # NaN: not known
float64 velocity_x                      # m/s, east
float64 velocity_y                      # north
float64 velocity_z                      # up""",
        TIME,
    ),
)
