"""The solution as MCAP that Foxglove, ROS 2 tools and Python open."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from earth.rotation import euler_from_quat
from earth.units import DEG
from navgrade.logs.container.writer import Batch, McapWriter
from navgrade.logs.copying import FOREVER, OWN, TopicCopy
from navgrade.logs.messages import (
    LOCATION_FIX,
    NAV_SAT_FIX,
    NAV_SOLUTION,
    ODOMETRY,
    TF_MESSAGE,
)
from navgrade.logs.outgoing import Columns, OutTopic, vector
from navgrade.logs.poses import LocalMap, Poses
from navgrade.logs.thinning import Thinning
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
        add = partial(OutTopic, self.file)
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
            self._solution.batch(stamp_ns[rows], solution_columns(nav, rows)),
            self._fix.batch(stamp_ns[fixes], fix_columns(nav, fixes)),
        ]
        if self._location is not None:
            columns = {**fix_columns(nav, fixes), **_motion_columns(nav, fixes)}
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


def solution_columns(nav: Trajectory, rows: Rows) -> Columns:
    """Members of ``navgrade_msgs/msg/NavSolution``."""
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


def fix_columns(nav: Trajectory, rows: Rows) -> Columns:
    """Members of ``sensor_msgs/msg/NavSatFix`` that tell the place."""
    lat_deg, lon_deg = _degrees(nav, rows)
    return {"latitude": lat_deg, "longitude": lon_deg, "altitude": nav.h[rows]}


def _motion_columns(nav: Trajectory, rows: Rows) -> Columns:
    """What Foxglove's fix has besides: heading clockwise from north, velocity east, north, up."""
    north, east, down = nav.v_eb_n[rows].T
    return {
        "heading": euler_from_quat(nav.q_nb[rows])[:, 2] % (2.0 * np.pi),
        "heading_variance": np.full(len(north), np.nan),
        "velocity_x": east,
        "velocity_y": north,
        "velocity_z": -down,
    }


def _odometry_columns(poses: Poses) -> Columns:
    return {
        **vector("pose.pose.position", poses.position),
        **_quaternion("pose.pose.orientation", poses.orientation),
        **vector("twist.twist.linear", poses.velocity),
        **vector("twist.twist.angular", poses.rate),
    }


def _transform_columns(poses: Poses) -> Columns:
    return {
        **vector("transforms.0.transform.translation", poses.position),
        **_quaternion("transforms.0.transform.rotation", poses.orientation),
    }


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
