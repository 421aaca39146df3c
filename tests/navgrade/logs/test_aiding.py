"""Positions, velocities and attitudes come out of a log as they went in, on their own terms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from navgrade.errors import ConfigError, LogError, SchemaError
from navgrade.logs import open_imu, read_aiding, write_solution
from navgrade.logs.schemas import AIDING_SCHEMAS
from navgrade.state import Trajectory
from tests.navgrade.logmaking import EPOCH_NS, Channel, damage_chunk, text_channel, write_log
from tests.navgrade.logs.vendors import vendor_channel

COUNT = 60
DEG = np.pi / 180.0  # rad
RNG = np.random.default_rng(12)
STAMPS = EPOCH_NS + 200_000_000 * np.arange(COUNT) + RNG.integers(0, 999_999, COUNT)
DELAY_NS = 3_000_000 + RNG.integers(0, 5_000_000, COUNT)
LOG_NS = STAMPS + DELAY_NS
BOOT_US = 12_000_000 + (STAMPS - EPOCH_NS) // 1000
LAT_DEG = 45.0 + 1e-5 * np.cumsum(RNG.standard_normal(COUNT))
LON_DEG = -120.0 + 1e-5 * np.cumsum(RNG.standard_normal(COUNT))
H = 850.0 + RNG.standard_normal(COUNT)  # m above the ellipsoid
GEOID = -17.25  # m, exact in single precision
V = RNG.standard_normal((COUNT, 3))  # m/s, north, east, down
EULER_DEG = np.stack(
    [
        RNG.uniform(-20.0, 20.0, COUNT),
        RNG.uniform(-10.0, 10.0, COUNT),
        RNG.uniform(0.0, 360.0, COUNT),
    ],
    axis=1,
)
SIGMA = RNG.uniform(0.5, 2.0, (COUNT, 3))  # m, north, east, down


def columns(**values: Any) -> list[dict[str, Any]]:
    """Rows of columns; ``__`` in a name stands for a dot; what is not an array is in every row."""
    filled = {
        name.replace("__", "."): value if isinstance(value, list | np.ndarray) else [value] * COUNT
        for name, value in values.items()
    }
    return [dict(zip(filled, row, strict=True)) for row in zip(*filled.values(), strict=True)]


def recorded(tmp_path: Path, *channels: Channel, **options: Any) -> Path:
    """A log of these topics, with another one beside them."""
    return write_log(tmp_path / "log.mcap", *channels, text_channel(), **options)


def enu_covariance() -> list[NDArray[np.float64]]:
    """Covariances along east, north, up, of what SIGMA has along north, east, down."""
    return [np.diag([east, north, up]).ravel() ** 2 for north, east, up in SIGMA]


def fix(**changed: Any) -> Channel:
    """sensor_msgs/NavSatFix."""
    rows = columns(
        **{
            "header__stamp": STAMPS,
            "header__frame_id": "antenna",
            "latitude": LAT_DEG,
            "longitude": LON_DEG,
            "altitude": H,
            "position_covariance": enu_covariance(),
            "position_covariance_type": 2,
            **changed,
        }
    )
    return vendor_channel("/fix", "sensor_msgs/msg/NavSatFix", rows, LOG_NS)


def close(found: NDArray[np.float64] | None, expected: Any, rtol: float = 4e-16) -> None:
    """Equal but for a rounding or two of a unit."""
    assert found is not None
    np.testing.assert_allclose(found, expected, rtol=rtol, atol=0.0)


# ---- each type ---------------------------------------------------------------------------------


def test_nav_sat_fix(tmp_path: Path) -> None:
    found = read_aiding(recorded(tmp_path, fix()), "/fix")
    assert (found.topic, found.schema) == ("/fix", "sensor_msgs/msg/NavSatFix")
    assert found.time_ns.tobytes() == STAMPS.tobytes()
    assert found.clock_offset_ns == 0
    close(found.lat, LAT_DEG * DEG)
    close(found.lon, LON_DEG * DEG)
    assert found.h is not None
    assert found.h.tobytes() == H.tobytes()
    close(found.sigma_r_n, SIGMA)
    assert found.valid.all()
    assert found.frame is not None
    assert set(found.frame) == {"antenna"}
    for name in ("h_msl", "v_eb_n", "sigma_v_n", "q_nb", "r", "q", "v", "child"):
        assert getattr(found, name) is None
    assert found.issues == []


def test_our_own_nav_solution(tmp_path: Path) -> None:
    """NavSolution; attitudes to the rounding of degrees, 1e-15 of 2 pi and a few more."""
    attitude = Rotation.from_euler("ZYX", EULER_DEG[:, ::-1], degrees=True)
    nav = Trajectory(
        t=(STAMPS - EPOCH_NS) * 1e-9,
        lat=LAT_DEG * DEG,
        lon=LON_DEG * DEG,
        h=H,
        v_eb_n=V,
        q_nb=attitude.as_quat(scalar_first=True),
        status=np.zeros(COUNT, np.uint32),
        epoch_ns=EPOCH_NS,
    )
    write_solution(tmp_path / "nav.mcap", nav)
    found = read_aiding(tmp_path / "nav.mcap", "/navgrade/solution")
    assert found.time_ns.tobytes() == STAMPS.tobytes()
    assert found.valid.all()
    close(found.lat, LAT_DEG * DEG)
    close(found.lon, LON_DEG * DEG)
    close(found.h, H)
    close(found.v_eb_n, V)
    assert found.q_nb is not None
    between = Rotation.from_quat(found.q_nb, scalar_first=True) * attitude.inv()
    assert between.magnitude().max() < 1e-14


@pytest.mark.parametrize("how", ["ROS", "protobuf"])
def test_location_fix(tmp_path: Path, how: str) -> None:
    if how == "ROS":
        rows = columns(
            timestamp=STAMPS,
            frame_id="gps",
            latitude=LAT_DEG,
            longitude=LON_DEG,
            altitude=H,
            position_covariance=enu_covariance(),
            position_covariance_type=3,
        )
        channel = vendor_channel("/location", "foxglove_msgs/msg/LocationFix", rows, LOG_NS)
        path = recorded(tmp_path, channel)
    else:
        path = protobuf_locations(tmp_path / "location.mcap")
    found = read_aiding(path, "/location")
    assert found.time_ns.tobytes() == STAMPS.tobytes()
    close(found.lat, LAT_DEG * DEG)
    close(found.h, H)
    close(found.sigma_r_n, SIGMA)
    assert found.frame is not None
    assert set(found.frame) == {"gps"}


def protobuf_locations(path: Path) -> Path:
    """foxglove.LocationFix by the official writer, its definition written out here."""
    pytest.importorskip("google.protobuf", reason="the extra `protobuf` is not installed")
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, timestamp_pb2
    from mcap_protobuf.writer import Writer

    number = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(
        name="foxglove/LocationFix.proto", package="foxglove", syntax="proto3"
    )
    file.dependency.append("google/protobuf/timestamp.proto")
    message = file.message_type.add(name="LocationFix")
    enum = message.enum_type.add(name="PositionCovarianceType")
    for value, name in enumerate(("UNKNOWN", "APPROXIMATED", "DIAGONAL_KNOWN", "KNOWN")):
        enum.value.add(name=name, number=value)
    for place, name, kind, type_name in (
        (6, "timestamp", number.TYPE_MESSAGE, ".google.protobuf.Timestamp"),
        (7, "frame_id", number.TYPE_STRING, None),
        (1, "latitude", number.TYPE_DOUBLE, None),
        (2, "longitude", number.TYPE_DOUBLE, None),
        (3, "altitude", number.TYPE_DOUBLE, None),
        (
            5,
            "position_covariance_type",
            number.TYPE_ENUM,
            ".foxglove.LocationFix.PositionCovarianceType",
        ),
    ):
        label = number.LABEL_OPTIONAL
        message.field.add(name=name, number=place, label=label, type=kind, type_name=type_name)
    message.field.add(
        name="position_covariance", number=4, label=number.LABEL_REPEATED, type=number.TYPE_DOUBLE
    )
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    kind_of = message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.LocationFix"))
    with path.open("wb") as stream, Writer(stream) as writer:
        for k, covariance in enumerate(enu_covariance()):
            one = kind_of(
                frame_id="gps",
                latitude=LAT_DEG[k],
                longitude=LON_DEG[k],
                altitude=H[k],
                position_covariance=covariance,
                position_covariance_type=3,
            )
            one.timestamp.seconds, one.timestamp.nanos = divmod(int(STAMPS[k]), 10**9)
            writer.write_message("/location", one, int(LOG_NS[k]), int(LOG_NS[k]))
    return path


def test_odometry_stays_in_its_frames(tmp_path: Path) -> None:
    """The pose in the frame of the header, the velocity in the child's."""
    r, v = RNG.standard_normal((2, COUNT, 3))
    q = Rotation.random(COUNT, rng=3).as_quat()  # x, y, z, w
    covariance = np.zeros((COUNT, 36))
    covariance[:, [0, 7, 14]] = SIGMA**2
    covariance[7] = 0.0
    rows = columns(
        header__stamp=STAMPS,
        header__frame_id="odom",
        child_frame_id="base_link",
        pose__pose__position=r,
        pose__pose__orientation=q,
        pose__covariance=covariance,
        twist__twist__linear=v,
    )
    channel = vendor_channel("/odom", "nav_msgs/msg/Odometry", rows, LOG_NS)
    found = read_aiding(recorded(tmp_path, channel), "/odom", frame="odom", child="base_link")
    assert found.r is not None
    assert found.q is not None
    assert found.v is not None
    assert found.sigma_r is not None
    assert found.r.tobytes() == r.tobytes()
    assert found.v.tobytes() == v.tobytes()
    assert np.array_equal(found.q, q[:, [3, 0, 1, 2]])
    known = np.arange(COUNT) != 7
    close(found.sigma_r[known], SIGMA[known])
    assert np.isnan(found.sigma_r[7]).all()
    assert found.lat is None
    assert found.h is None


@pytest.mark.parametrize("variant", ["", "_integers"])
def test_px4_gps_of_new_and_old_definitions(tmp_path: Path, variant: str) -> None:
    where: dict[str, Any] = {
        "latitude_deg": LAT_DEG,
        "longitude_deg": LON_DEG,
        "altitude_msl_m": H - GEOID,
        "altitude_ellipsoid_m": H,
    }
    tolerance = 4e-16
    if variant:
        scales = (("lat", LAT_DEG, 1e7), ("lon", LON_DEG, 1e7))
        scales += (("alt", H - GEOID, 1e3), ("alt_ellipsoid", H, 1e3))
        where = {name: np.rint(value * scale).astype(int) for name, value, scale in scales}
        tolerance = 1e-6  # half a millimetre of 850 m
    rows = columns(
        timestamp=BOOT_US,
        fix_type=3,
        eph=SIGMA[:, 0],
        epv=SIGMA[:, 2],
        s_variance_m_s=0.25,
        vel_n_m_s=V[:, 0],
        vel_e_m_s=V[:, 1],
        vel_d_m_s=V[:, 2],
        vel_ned_valid=[k != 4 for k in range(COUNT)],
        **where,
    )
    rows[5]["fix_type"] = 2
    channel = vendor_channel("/gps", "px4_msgs/msg/SensorGps", rows, LOG_NS, variant)
    found = read_aiding(recorded(tmp_path, channel), "/gps")
    close(found.lat, LAT_DEG * DEG, max(tolerance, 1e-9 if variant else 0.0))
    close(found.lon, LON_DEG * DEG, max(tolerance, 1e-9 if variant else 0.0))
    close(found.h, H, tolerance)
    close(found.h_msl, H - GEOID, tolerance)
    single = V.astype(np.float32)
    assert found.v_eb_n is not None
    kept = np.arange(COUNT) != 4
    close(found.v_eb_n[kept], single[kept])
    assert np.isnan(found.v_eb_n[4]).all()
    close(found.sigma_r_n, SIGMA[:, [0, 0, 2]].astype(np.float32))
    close(found.sigma_v_n, np.full((COUNT, 3), 0.25))
    assert np.flatnonzero(~found.valid).tolist() == [5]


def novatel(name: str, h: NDArray[np.float64], status: str, **more: Any) -> Channel:
    """INSPVA or INSPVAX."""
    rows = columns(
        **{
            "nov_header__gps_week_number": 2100,
            "nov_header__gps_week_milliseconds": 1_000 + 200 * np.arange(COUNT),
            "nov_header__message_name": name,
            "latitude": LAT_DEG,
            "longitude": LON_DEG,
            "height": h,
            "north_velocity": V[:, 0],
            "east_velocity": V[:, 1],
            "up_velocity": -V[:, 2],
            "roll": EULER_DEG[:, 0],
            "pitch": EULER_DEG[:, 1],
            "azimuth": EULER_DEG[:, 2],
            f"{status}__status": 3,
            **more,
        }
    )
    rows[9][f"{status}.status"] = 1  # aligning
    log_ns = EPOCH_NS + 200_000_000 * np.arange(COUNT) + DELAY_NS
    return vendor_channel(f"/{name}", f"novatel_oem7_msgs/msg/{name}", rows, log_ns)


def test_inspva_and_inspvax_mean_different_heights(tmp_path: Path) -> None:
    """INSPVA's is above the ellipsoid, INSPVAX's above mean sea level."""
    deviations = dict(
        zip(("latitude_stdev", "longitude_stdev", "height_stdev"), SIGMA.T, strict=True)
    )
    names = ("north_velocity_stdev", "east_velocity_stdev", "up_velocity_stdev")
    deviations |= dict(zip(names, 0.1 * SIGMA.T, strict=True))
    angles = ("roll_stdev", "pitch_stdev", "azimuth_stdev")
    deviations |= dict(zip(angles, 0.01 * SIGMA.T, strict=True))
    path = recorded(
        tmp_path,
        novatel("INSPVA", H, "status"),
        novatel("INSPVAX", H - GEOID, "ins_status", undulation=GEOID, **deviations),
    )
    plain, extended = read_aiding(path, "/INSPVA"), read_aiding(path, "/INSPVAX")
    assert plain.h_msl is None
    close(plain.h, H)
    close(extended.h, H)
    close(extended.h_msl, H - GEOID)
    roll, pitch, azimuth = EULER_DEG.T
    # scipy's intrinsic z, y, x angles of body forward-right-down over north-east-down
    expected = Rotation.from_euler("ZYX", np.stack([azimuth, pitch, roll], axis=1), degrees=True)
    for found in (plain, extended):
        close(found.v_eb_n, V)
        assert found.q_nb is not None
        turn = Rotation.from_quat(found.q_nb[:, [1, 2, 3, 0]]).inv() * expected
        assert turn.magnitude().max() < 1e-14  # rad: some roundings
        assert np.flatnonzero(~found.valid).tolist() == [9]
        assert found.time_ns[0] == EPOCH_NS + int(DELAY_NS.min())
        assert np.array_equal(np.diff(found.time_ns), np.full(COUNT - 1, 200_000_000))
    assert plain.sigma_r_n is None
    single = SIGMA.astype(np.float32)
    close(extended.sigma_r_n, single)
    close(extended.sigma_v_n, (0.1 * SIGMA).astype(np.float32))
    close(extended.sigma_euler, (0.01 * SIGMA).astype(np.float32).astype(float) * DEG)


def transforms(counts: list[int]) -> tuple[Channel, list[tuple[int, int]]]:
    """Messages of that many transforms each; the first is map to odom, others odom to their own."""
    rows, places = [], []
    for k, count in enumerate(counts):
        several = []
        for j in range(count):
            several.append(
                {
                    "header.stamp": int(STAMPS[k]) + j,
                    "header.frame_id": "odom" if j else "map",
                    "child_frame_id": f"link{j}" if j else "odom",
                    "transform.translation": [float(k), float(j), 0.5],
                    "transform.rotation": [0.0, 0.0, 0.6, 0.8],
                }
            )
            places.append((k, j))
        rows.append({"transforms": several})
    log_ns = LOG_NS[: len(counts)]
    return vendor_channel("/tf", "tf2_msgs/msg/TFMessage", rows, log_ns), places


@pytest.mark.parametrize("container", [{}, {"chunk_bytes": 500}])
def test_transforms_are_taken_one_by_one(tmp_path: Path, container: dict[str, Any]) -> None:
    """Messages of none to eleven of them."""
    counts = [1, 3, 0, 2, 11, 1, 8, 9, 0, 2]
    channel, places = transforms(counts)
    path = recorded(tmp_path, channel, **container)
    found = read_aiding(path, "/tf")
    assert found.r is not None
    assert found.q is not None
    assert found.child is not None
    assert [(int(x), int(y)) for x, y, _ in found.r] == places
    assert found.time_ns.tolist() == [int(STAMPS[k]) + j for k, j in places]
    assert np.array_equal(found.q, [[0.8, 0.0, 0.0, 0.6]] * len(places))
    assert found.child.tolist() == [f"link{j}" if j else "odom" for _, j in places]
    one = read_aiding(path, "/tf", frame="odom", child="link2")
    assert one.r is not None
    assert one.r[:, 0].tolist() == [k for k, count in enumerate(counts) if count > 2]


def test_every_entry_of_the_registry_is_tested_here() -> None:
    """By name; the tests above read each."""
    text = Path(__file__).read_text()
    for schema in AIDING_SCHEMAS:
        assert schema.name.split("/")[-1] in text


# ---- traps -------------------------------------------------------------------------------------


def test_heights_above_the_sea_never_pass_for_ellipsoidal(tmp_path: Path) -> None:
    """Some receivers write them into NavSatFix; taken as they are, they are 17 m off here."""
    path = recorded(tmp_path, fix(altitude=H - GEOID))
    naive = read_aiding(path, "/fix")
    assert naive.h is not None
    assert np.all(naive.h - H > 17.0)
    found = read_aiding(path, "/fix", msl=True)
    assert found.h is None
    close(found.h_msl, H - GEOID)
    path = recorded(tmp_path, novatel("INSPVAX", H, "ins_status"))
    with pytest.raises(ConfigError, match="says what its heights are; leave msl out"):
        read_aiding(path, "/INSPVAX", msl=True)


@pytest.mark.parametrize(
    ("covariance", "kind"), [(np.zeros(9), 0), (np.full(9, 4.0), 0), (np.full(9, -1.0), 2)]
)
def test_a_covariance_that_says_nothing_is_no_accuracy(
    tmp_path: Path, covariance: NDArray[np.float64], kind: int
) -> None:
    channel = fix(position_covariance=[covariance] * COUNT, position_covariance_type=kind)
    found = read_aiding(recorded(tmp_path, channel), "/fix")
    assert found.sigma_r_n is not None
    assert np.isnan(found.sigma_r_n).all()


def test_what_is_no_solution_is_marked(tmp_path: Path) -> None:
    channel = fix(
        status__status=[-1 if k == 2 else 0 for k in range(COUNT)],
        latitude=np.where(np.arange(COUNT) == 3, np.nan, LAT_DEG),
    )
    found = read_aiding(recorded(tmp_path, channel), "/fix")
    assert len(found) == COUNT
    assert np.flatnonzero(~found.valid).tolist() == [2, 3]


def test_one_device_has_one_clock(tmp_path: Path) -> None:
    """Tied each by its own least delay, a slow GNSS would lag its own IMU by 150 ms."""
    imu = vendor_channel(
        "/imu",
        "px4_msgs/msg/VehicleImu",
        columns(
            timestamp_sample=BOOT_US,
            delta_angle_dt=200_000,
            delta_velocity_dt=200_000,
        ),
        STAMPS,
    )
    rows = columns(timestamp=BOOT_US, fix_type=3, latitude_deg=LAT_DEG, longitude_deg=LON_DEG)
    gps = vendor_channel("/gps", "px4_msgs/msg/SensorGps", rows, STAMPS + 150_000_000)
    path = recorded(tmp_path, imu, gps)
    log = open_imu(path)
    alone = read_aiding(path, "/gps")
    assert abs(alone.time_ns[0] - STAMPS[0] - 150_000_000) < 1_000
    found = read_aiding(path, "/gps", clock_offset_ns=log.clock_offset_ns)
    assert found.time_ns[0] == log.epoch_ns
    assert found.clock_offset_ns == log.clock_offset_ns


def test_a_damaged_file_is_told(tmp_path: Path) -> None:
    path = write_log(tmp_path / "a.mcap", fix(), chunk_bytes=2_000, compression="none")
    damage_chunk(path, 3)
    found = read_aiding(path, "/fix")
    assert 0 < len(found) < COUNT
    (issue,) = found.issues
    assert "damaged chunk" in issue.text
    with pytest.raises(LogError, match="damaged chunk"):
        read_aiding(path, "/fix", strict=True)


def test_what_cannot_be_read_is_told(tmp_path: Path) -> None:
    channel, _ = transforms([2, 1])
    path = recorded(
        tmp_path, fix(), channel, replace(fix(), topic="/empty", messages=[], log_ns=[])
    )
    with pytest.raises(LogError, match=r"no such topic; the log holds .*/fix"):
        read_aiding(path, "/gnss")
    with pytest.raises(SchemaError, match="std_msgs/msg/String holds no position") as error:
        read_aiding(path, "/chatter")
    assert "nav_msgs/msg/Odometry" in str(error.value)
    with pytest.raises(LogError, match="/empty: no message of it is in the log"):
        read_aiding(path, "/empty")
    with pytest.raises(
        LogError, match="/tf: nothing there has the frame earth; there is map, odom"
    ):
        read_aiding(path, "/tf", frame="earth")
    with pytest.raises(ConfigError, match="NavSatFix names no child"):
        read_aiding(path, "/fix", child="base_link")
    renamed = replace(fix(), text=fix().text.replace("float64 altitude", "float64 height"))
    with pytest.raises(SchemaError, match="/fix: there is no altitude"):
        read_aiding(recorded(tmp_path, renamed), "/fix")


def test_a_real_receiver(shared_data: Path) -> None:
    """Calgary: 1098 m above the sea, 1081 m above the ellipsoid; at rest."""
    found = read_aiding(shared_data / "novatel_oem7_parked.mcap", "/novatel/oem7/inspvax")
    assert found.lat is not None
    assert found.h is not None
    assert found.h_msl is not None
    assert found.v_eb_n is not None
    assert len(found) == 6
    assert found.lat / DEG == pytest.approx(51.15044, abs=1e-5)
    assert found.h == pytest.approx(1080.76, abs=0.01)
    assert found.h_msl == pytest.approx(1097.76, abs=0.01)
    assert np.abs(found.v_eb_n).max() < 0.01
    assert found.valid.all()
    assert np.array_equal(np.diff(found.time_ns), np.full(5, 1_000_000_000))
