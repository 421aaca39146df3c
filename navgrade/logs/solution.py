"""The solution as MCAP that Foxglove, ROS 2 tools and Python open."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from earth.frames import NED_TO_ENU
from earth.rotation import euler_from_quat
from earth.units import DEG
from navgrade.imu import ImuSamples
from navgrade.logs.container.definitions import parse_definition
from navgrade.logs.container.layout import record_template
from navgrade.logs.container.writer import Batch, McapWriter
from navgrade.logs.copying import FOREVER, OWN, TopicCopy
from navgrade.logs.messages import (
    IMU_INCREMENT,
    LOCATION_FIX,
    NAV_SAT_FIX,
    NAV_SOLUTION,
    ODOMETRY,
    TF_MESSAGE,
    Schema,
)
from navgrade.logs.poses import LocalMap, Poses
from navgrade.logs.thinning import Thinning
from navgrade.logs.topics import AXES_KEY, KIND_KEY
from navgrade.state import Trajectory

SOLUTION_TOPIC = OWN + "solution"
FIX_TOPIC = OWN + "fix"
LOCATION_TOPIC = OWN + "location"
ODOMETRY_TOPIC = OWN + "odometry"
TF_TOPIC = "/tf"
PROVENANCE = "navgrade.provenance"
FIX_RATE = 10.0  # Hz, at most
POSE_RATE = 10.0  # Hz, at most, unless said
_MAP, _BODY = "map", "base_link"  # names of REP-105

_BLOCK = 65_536  # rows turned into messages at a time

Array = NDArray[np.float64]
Rows = slice | NDArray[np.intp]
Columns = Mapping[str, NDArray[np.generic]]


class _Topic:
    """A topic being written; all its messages have one size."""

    def __init__(
        self,
        out: McapWriter,
        topic: str,
        schema: Schema,
        texts: Mapping[str, str],
        *,
        stamp: str = "header.stamp",
        counts: Mapping[str, int] | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self._channel = out.add_channel(topic, schema, metadata=metadata)
        self._stamp = stamp
        members = parse_definition(schema.name, schema.text)
        self._dtype, self._template = record_template(members, texts, counts)

    def batch(self, stamp_ns: NDArray[np.int64], columns: Columns) -> Batch:
        """Messages of these instants with these members; all others are zero."""
        records = np.repeat(self._template, len(stamp_ns))
        seconds, nanoseconds = np.divmod(stamp_ns, 1_000_000_000)
        records[f"{self._stamp}.sec"], records[f"{self._stamp}.nanosec"] = seconds, nanoseconds
        for path, values in columns.items():
            records[path] = values
        data = records.view(np.uint8).reshape(-1, self._dtype.itemsize)
        return Batch(self._channel, stamp_ns, data)


class SolutionWriter:
    """Writes a solution block by block.

    Used as a context manager: the file is written to ``PATH.part`` and renamed when the block
    ends; on an exception the part is removed and no ``PATH`` appears.

    Parameters
    ----------
    path : path
    overwrite : bool
    rate_hz : float, optional
        Output rate of the solution; every sample by default.
    pose_rate_hz : float
        Of odometry and transforms, at most; 0 leaves them out.
    location_fix : bool
        Write fixes in Foxglove's own message, too: it has heading and velocity.
    copy : TopicCopy, optional
        Topics of a log to carry over.

    Attributes
    ----------
    file : McapWriter
        Takes metadata and attachments.

    Raises
    ------
    ConfigError
        If `path` exists and must not be overwritten, or its folder does not exist.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        overwrite: bool = False,
        rate_hz: float | None = None,
        pose_rate_hz: float = POSE_RATE,
        location_fix: bool = False,
        copy: TopicCopy | None = None,
    ) -> None:
        self.file = McapWriter(path, overwrite=overwrite)
        self._every = None if rate_hz is None else Thinning(rate_hz)
        self._fixes = Thinning(FIX_RATE)
        self._map = LocalMap(pose_rate_hz) if pose_rate_hz > 0.0 else None
        self._copy = copy
        add = partial(_Topic, self.file)
        self._solution = add(SOLUTION_TOPIC, NAV_SOLUTION, {"header.frame_id": "ned"})
        self._fix = add(FIX_TOPIC, NAV_SAT_FIX, {"header.frame_id": "imu"})
        if self._map is not None:
            frames = {"header.frame_id": _MAP, "child_frame_id": _BODY}
            self._odometry = add(ODOMETRY_TOPIC, ODOMETRY, frames)
            self._transform = add(
                TF_TOPIC,
                TF_MESSAGE,
                {f"transforms.0.{path}": name for path, name in frames.items()},
                stamp="transforms.0.header.stamp",
                counts={"transforms": 1},
            )
        self._location = None
        if location_fix:
            named = {"frame_id": _BODY}
            self._location = add(LOCATION_TOPIC, LOCATION_FIX, named, stamp="timestamp")
        self._stack = ExitStack()
        self._stack.enter_context(self.file)
        if copy is not None:
            self._stack.callback(copy.close)
        self._stack.push(self._finish)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._stack.__exit__(kind, error, trace)

    def write(self, nav: Trajectory) -> None:
        """Append a block."""
        stamp_ns = nav.epoch_ns + np.rint(nav.t * 1e9).astype(np.int64)
        rows = slice(None) if self._every is None else self._every.rows(nav.t)
        fixes = self._fixes.rows(nav.t)
        batches = [
            self._solution.batch(stamp_ns[rows], _solution_columns(nav, rows)),
            self._fix.batch(stamp_ns[fixes], _fix_columns(nav, fixes)),
        ]
        if self._location is not None:
            columns = {**_fix_columns(nav, fixes), **_motion_columns(nav, fixes)}
            batches.append(self._location.batch(stamp_ns[fixes], columns))
        if self._map is not None:
            poses = self._map.poses(nav)
            at_ns = stamp_ns[poses.rows]
            batches.append(self._odometry.batch(at_ns, _odometry_columns(poses)))
            batches.append(self._transform.batch(at_ns, _transform_columns(poses)))
        self._append(batches, int(stamp_ns[-1]))

    def _append(self, own: list[Batch], end_ns: int) -> None:
        """Write batches of the solution, which end at `end_ns`, among what is copied until then."""
        if self._copy is not None:
            for copied in self._copy.until(end_ns, self.file):
                last_ns = max(batch.log_time_ns.max() for batch in copied)
                due = [np.searchsorted(b.log_time_ns, last_ns, side="right") for b in own]
                self.file.write(*(b[:k] for b, k in zip(own, due, strict=True)), *copied)
                own = [b[k:] for b, k in zip(own, due, strict=True)]
        self.file.write(*own)

    def _finish(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self._append([], FOREVER)


def _degrees(nav: Trajectory, rows: Rows) -> tuple[Array, Array]:
    """Latitude, and longitude within ±180."""
    lon_deg = nav.lon[rows] / DEG
    return nav.lat[rows] / DEG, lon_deg - 360.0 * np.rint(lon_deg / 360.0)


def _solution_columns(nav: Trajectory, rows: Rows) -> Columns:
    lat_deg, lon_deg = _degrees(nav, rows)
    v_eb_n, q_nb = nav.v_eb_n[rows], nav.q_nb[rows]
    roll, pitch, heading = (euler_from_quat(q_nb) / DEG).T
    return {
        "latitude_deg": lat_deg,
        "longitude_deg": lon_deg,
        "height_m": nav.h[rows],
        "v_north_m_s": v_eb_n[:, 0],
        "v_east_m_s": v_eb_n[:, 1],
        "v_down_m_s": v_eb_n[:, 2],
        "roll_deg": roll,
        "pitch_deg": pitch,
        "heading_deg": np.where(heading < 0.0, heading + 360.0, heading) % 360.0,
        **_quaternion("orientation", q_nb),
        "status": nav.status[rows],
    }


def _fix_columns(nav: Trajectory, rows: Rows) -> Columns:
    lat_deg, lon_deg = _degrees(nav, rows)
    return {"latitude": lat_deg, "longitude": lon_deg, "altitude": nav.h[rows]}


def _motion_columns(nav: Trajectory, rows: Rows) -> Columns:
    """What Foxglove's fix has besides: heading clockwise from north, velocity east, north, up."""
    heading = euler_from_quat(nav.q_nb[rows])[:, 2] % (2.0 * np.pi)
    velocity = nav.v_eb_n[rows] @ NED_TO_ENU.T
    return {
        "heading": heading,
        "heading_variance": np.full(len(heading), np.nan),
        **{f"velocity_{axis}": velocity[:, i] for i, axis in enumerate("xyz")},
    }


def _odometry_columns(poses: Poses) -> Columns:
    return {
        **_vector("pose.pose.position", poses.position),
        **_quaternion("pose.pose.orientation", poses.orientation),
        **_vector("twist.twist.linear", poses.velocity),
        **_vector("twist.twist.angular", poses.rate),
    }


def _transform_columns(poses: Poses) -> Columns:
    return {
        **_vector("transforms.0.transform.translation", poses.position),
        **_quaternion("transforms.0.transform.rotation", poses.orientation),
    }


def _vector(path: str, values: Array) -> Columns:
    return {f"{path}.{axis}": values[:, i] for i, axis in enumerate("xyz")}


def _quaternion(path: str, q: Array) -> Columns:
    return {f"{path}.{axis}": q[:, i] for i, axis in enumerate("wxyz")}


def write_solution(path: str | Path, nav: Trajectory, *, overwrite: bool = False) -> None:
    """Write a trajectory as MCAP.

    The topics are ``/navgrade/solution``, ``/navgrade/fix``, ``/navgrade/odometry`` and ``/tf``.

    Parameters
    ----------
    path : path
    nav : Trajectory
    overwrite : bool

    Raises
    ------
    ConfigError
        If `path` exists and must not be overwritten.
    """
    with SolutionWriter(path, overwrite=overwrite) as out:
        for start in range(0, len(nav), _BLOCK):
            out.write(nav[start : start + _BLOCK])


def write_increments(
    path: str | Path,
    imu: ImuSamples,
    *,
    topic: str = "/imu/increments",
    frame_id: str = "imu",
    overwrite: bool = False,
) -> None:
    """Write increments in body axes as ``navgrade_msgs/msg/ImuIncrement``.

    Parameters
    ----------
    path : path
    imu : ImuSamples
        Of kind ``increment`` or ``compensated``.
    topic, frame_id : str
    overwrite : bool

    Raises
    ------
    ValueError
        If `imu` holds rates.
    ConfigError
        If `path` exists and must not be overwritten.
    """
    if not imu.is_integrated:
        raise ValueError(f"ImuIncrement holds increments, not kind {imu.kind!r}")
    told = {KIND_KEY: imu.kind, AXES_KEY: "FRD"}
    with McapWriter(path, overwrite=overwrite) as out:
        increments = _Topic(out, topic, IMU_INCREMENT, {"header.frame_id": frame_id}, metadata=told)
        for block in imu.blocks(_BLOCK):
            columns = {
                "interval_s": block.dt,
                **_vector("delta_angle", block.gyro),
                **_vector("delta_velocity", block.accel),
            }
            stamp_ns = block.epoch_ns + np.rint(block.t * 1e9).astype(np.int64)
            out.write(increments.batch(stamp_ns, columns))
