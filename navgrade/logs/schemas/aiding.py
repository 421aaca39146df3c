"""How message types carry positions, velocities and attitudes: one entry each, facts alone."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from earth.units import DEG
from navgrade.logs.schemas.clock import HEADER_STAMP, Clock, boot_time, gps_time
from navgrade.logs.schemas.imu import Condition

Scaled = tuple[str, float]  # path of a number, and its unit in SI
Triple = tuple[Scaled, Scaled, Scaled]


@dataclass(frozen=True)
class AidingSchema:
    """How a message type carries positions, velocities and attitudes.

    Attributes
    ----------
    name : str
        Of the message type, in ROS 2 spelling.
    source : str
        Who records it.
    clock : Clock
    lat, lon : (str, float) or None
        Geodetic; path and unit.
    h : (str, float) or None
        Above the ellipsoid.
    h_msl : (str, float) or None
        Above mean sea level.
    undulation : str or None
        Mean sea level above the ellipsoid, m: `h` is the sum of the two.
    covariance : (str, str) or None
        Of the position, east-north-up, and where it says that it is known.
    sigma_r_n : three of (str, float) or None
        Of the position, along north, east, down.
    v_eb_n, sigma_v_n : three of (str, float) or None
        Along north, east, down.
    velocity_valid : str or None
        Where it says whether there is a velocity.
    euler, sigma_euler : three of (str, float) or None
        Roll, pitch and heading of body forward-right-down over north-east-down.
    r, v : str or None
        Position in `frame`, velocity in `child`.
    q : str or None
        Quaternion x, y, z, w that turns vectors of `child` into `frame`.
    pose_covariance : str or None
        Of `r` and the attitude, 6 x 6.
    frame, child : str or None
        Names of the frames.
    each : str or None
        The array of structures all paths are in.
    valid : Condition or None
        Which messages hold a solution.
    traps : tuple of str
        What has gone wrong with it, and what is done about it.
    """

    name: str
    source: str
    clock: Clock = HEADER_STAMP
    lat: Scaled | None = None
    lon: Scaled | None = None
    h: Scaled | None = None
    h_msl: Scaled | None = None
    undulation: str | None = None
    covariance: tuple[str, str] | None = None
    sigma_r_n: Triple | None = None
    v_eb_n: Triple | None = None
    sigma_v_n: Triple | None = None
    velocity_valid: str | None = None
    euler: Triple | None = None
    sigma_euler: Triple | None = None
    r: str | None = None
    v: str | None = None
    q: str | None = None
    pose_covariance: str | None = None
    frame: str | None = None
    child: str | None = None
    each: str | None = None
    valid: Condition | None = None
    traps: tuple[str, ...] = field(default=(), repr=False)


_STATED_ELLIPSOID = (
    "Some receivers and drivers write the height above mean sea level where the definition asks "
    "for the ellipsoid: then say msl=True, and it becomes h_msl."
)

NAV_SAT_FIX = AidingSchema(
    name="sensor_msgs/msg/NavSatFix",
    source="ROS",
    lat=("latitude", DEG),
    lon=("longitude", DEG),
    h=("altitude", 1.0),
    covariance=("position_covariance", "position_covariance_type"),
    frame="header.frame_id",
    valid=Condition("status.status", lambda status: status >= 0, "a fix"),
    traps=(
        _STATED_ELLIPSOID,
        "The covariance is along east, north, up, and says nothing where its type is 0.",
    ),
)

LOCATION_FIX = AidingSchema(
    name="foxglove.LocationFix",
    source="Foxglove",
    clock=replace(HEADER_STAMP, members=(("timestamp", 1),)),
    lat=("latitude", DEG),
    lon=("longitude", DEG),
    h=("altitude", 1.0),
    covariance=("position_covariance", "position_covariance_type"),
    frame="frame_id",
    traps=(
        "The definition does not say what the altitude is above; it follows NavSatFix, so it is "
        "taken as above the ellipsoid. " + _STATED_ELLIPSOID,
    ),
)
LOCATION_FIX_ROS = replace(LOCATION_FIX, name="foxglove_msgs/msg/LocationFix")

ODOMETRY = AidingSchema(
    name="nav_msgs/msg/Odometry",
    source="ROS",
    r="pose.pose.position",
    q="pose.pose.orientation",
    v="twist.twist.linear",
    pose_covariance="pose.covariance",
    frame="header.frame_id",
    child="child_frame_id",
    traps=(
        "The velocity is in the child's frame, the pose in the frame of the header: neither is "
        "over the Earth until somebody says where that frame is.",
    ),
)

TF = AidingSchema(
    name="tf2_msgs/msg/TFMessage",
    source="ROS",
    each="transforms",
    r="transform.translation",
    q="transform.rotation",
    frame="header.frame_id",
    child="child_frame_id",
    traps=(
        "A message holds any number of transforms between any frames: choose them with frame and "
        "child.",
    ),
)

_PX4_TIME = "Time counts from the start of the board, not from 1970: it is tied to log time."
PX4_GPS = AidingSchema(
    name="px4_msgs/msg/SensorGps",
    source="PX4",
    clock=boot_time("timestamp"),
    lat=("latitude_deg", DEG),
    lon=("longitude_deg", DEG),
    h=("altitude_ellipsoid_m", 1.0),
    h_msl=("altitude_msl_m", 1.0),
    sigma_r_n=(("eph", 1.0), ("eph", 1.0), ("epv", 1.0)),
    v_eb_n=(("vel_n_m_s", 1.0), ("vel_e_m_s", 1.0), ("vel_d_m_s", 1.0)),
    sigma_v_n=(("s_variance_m_s", 1.0),) * 3,
    velocity_valid="vel_ned_valid",
    valid=Condition("fix_type", lambda kind: kind >= 3, "a 3D fix"),
    traps=(
        "Both heights are there; the one above the ellipsoid is h.",
        "s_variance_m_s is an accuracy, m/s, not a variance.",
        _PX4_TIME,
    ),
)
PX4_GPS_INTEGERS = replace(
    PX4_GPS,
    lat=("lat", 1e-7 * DEG),
    lon=("lon", 1e-7 * DEG),
    h=("alt_ellipsoid", 1e-3),
    h_msl=("alt", 1e-3),
    traps=(
        "Older definitions hold latitude and longitude in 1e-7 degrees and heights in mm, as "
        "whole numbers.",
        *PX4_GPS.traps,
    ),
)

_NOVATEL_GOOD = (2, 3, 6, 7)  # high variance, good, free, alignment complete
_NOVATEL_V = (("north_velocity", 1.0), ("east_velocity", 1.0), ("up_velocity", -1.0))
_NOVATEL_TIME = "Time is GPS week and milliseconds of the receiver: it is tied to log time."
INSPVA = AidingSchema(
    name="novatel_oem7_msgs/msg/INSPVA",
    source="NovAtel OEM7",
    clock=gps_time("nov_header.gps_week_number", "nov_header.gps_week_milliseconds", "ms"),
    lat=("latitude", DEG),
    lon=("longitude", DEG),
    h=("height", 1.0),
    v_eb_n=_NOVATEL_V,
    euler=(("roll", DEG), ("pitch", DEG), ("azimuth", DEG)),
    valid=Condition("status.status", lambda s: np.isin(s, _NOVATEL_GOOD), "a solution"),
    traps=("Height is above the ellipsoid here, above mean sea level in INSPVAX.", _NOVATEL_TIME),
)
INSPVAX = AidingSchema(
    name="novatel_oem7_msgs/msg/INSPVAX",
    source="NovAtel OEM7",
    clock=INSPVA.clock,
    lat=("latitude", DEG),
    lon=("longitude", DEG),
    h_msl=("height", 1.0),
    undulation="undulation",
    sigma_r_n=(("latitude_stdev", 1.0), ("longitude_stdev", 1.0), ("height_stdev", 1.0)),
    v_eb_n=_NOVATEL_V,
    sigma_v_n=(
        ("north_velocity_stdev", 1.0),
        ("east_velocity_stdev", 1.0),
        ("up_velocity_stdev", 1.0),
    ),
    euler=INSPVA.euler,
    sigma_euler=(("roll_stdev", DEG), ("pitch_stdev", DEG), ("azimuth_stdev", DEG)),
    valid=Condition("ins_status.status", lambda s: np.isin(s, _NOVATEL_GOOD), "a solution"),
    traps=(
        "Height is above mean sea level: h is height plus undulation.",
        _NOVATEL_TIME,
    ),
)

NAV_SOLUTION = AidingSchema(
    name="navgrade_msgs/msg/NavSolution",
    source="navgrade",
    lat=("latitude_deg", DEG),
    lon=("longitude_deg", DEG),
    h=("height_m", 1.0),
    v_eb_n=(("v_north_m_s", 1.0), ("v_east_m_s", 1.0), ("v_down_m_s", 1.0)),
    euler=(("roll_deg", DEG), ("pitch_deg", DEG), ("heading_deg", DEG)),
)

AIDING_SCHEMAS: tuple[AidingSchema, ...] = (
    NAV_SOLUTION,
    NAV_SAT_FIX,
    LOCATION_FIX,
    LOCATION_FIX_ROS,
    ODOMETRY,
    TF,
    PX4_GPS,
    PX4_GPS_INTEGERS,
    INSPVA,
    INSPVAX,
)
