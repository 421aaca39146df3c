"""The solution as MCAP that Foxglove, ROS 2 tools and Python open."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from earth.units import DEG
from navgrade.errors import ConfigError
from navgrade.imu import ImuSamples
from navgrade.logs.container.cdr import parse_ros2msg, record_template
from navgrade.logs.messages import IMU_INCREMENT, NAV_SAT_FIX, NAV_SOLUTION, Schema
from navgrade.state import Trajectory

SOLUTION_TOPIC = "/navgrade/solution"
FIX_TOPIC = "/navgrade/fix"
PROVENANCE = "navgrade.provenance"
FIX_RATE = 10.0  # Hz, at most


class Decimator:
    """Keeps the first row of each period, and the very first of all."""

    def __init__(self, rate_hz: float | None) -> None:
        self._rate = rate_hz
        self._period: int | None = None

    def rows(self, t: NDArray[np.float64]) -> NDArray[np.intp]:
        """Indices of the rows of `t` (s) to keep."""
        if self._rate is None or not len(t):
            return np.arange(len(t))
        # a thousandth of a period: stamps meant to fall on its start may fall short of it
        period = np.floor(t * self._rate + 1e-3).astype(np.int64)
        before = period[:1] - 1 if self._period is None else np.array([self._period])
        keep = np.diff(period, prepend=before) > 0
        self._period = int(period[-1])
        return np.flatnonzero(keep)


class _Channel:
    """One topic being written; `put` takes whole columns."""

    def __init__(self, writer: Writer, topic: str, schema: Schema, frame_id: str) -> None:
        self._writer = writer
        number = writer.register_schema(schema.name, "ros2msg", schema.text.encode())
        self._id = writer.register_channel(topic, "cdr", number)
        fields = parse_ros2msg(schema.name, schema.text)
        self._dtype, self._template = record_template(fields, {"header.frame_id": frame_id})
        self._sequence = 0

    def put(self, stamp_ns: NDArray[np.int64], columns: Mapping[str, NDArray[np.generic]]) -> None:
        records = np.repeat(self._template, len(stamp_ns))
        seconds, nanoseconds = np.divmod(stamp_ns, 1_000_000_000)
        records["header.stamp.sec"] = seconds
        records["header.stamp.nanosec"] = nanoseconds
        for path, values in columns.items():
            records[path] = values
        data = records.tobytes()
        size = self._dtype.itemsize
        for k, stamp in enumerate(stamp_ns.tolist()):
            self._writer.add_message(
                self._id, stamp, data[k * size : (k + 1) * size], stamp, self._sequence
            )
            self._sequence += 1


def check_output(path: Path, *, overwrite: bool) -> None:
    """Raise ConfigError unless a file may appear at `path`."""
    if path.is_dir():
        raise ConfigError(f"the output {path} is a folder")
    if path.exists() and not overwrite:
        raise ConfigError(f"{path} exists; choose another name or pass --overwrite")
    if not path.parent.is_dir():
        raise ConfigError(f"the folder {path.parent} of the output does not exist")


class _McapOutput:
    """An MCAP file that appears under its name only when it is complete."""

    def __init__(self, path: str | Path, *, overwrite: bool) -> None:
        self.path = Path(path)
        check_output(self.path, overwrite=overwrite)
        self._part = self.path.with_name(self.path.name + ".part")
        self._stream = self._part.open("wb")
        self._writer = Writer(
            self._stream, compression=CompressionType.ZSTD, enable_crcs=True, enable_data_crcs=True
        )
        self._writer.start(profile="ros2", library="navgrade")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self._writer.finish()
                self._stream.flush()
                os.fsync(self._stream.fileno())
                self._stream.close()
                self._part.replace(self.path)
        finally:  # the part is gone unless it became the output
            with suppress(OSError):
                self._stream.close()
            self._part.unlink(missing_ok=True)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record."""
        self._writer.add_metadata(name, dict(values))

    def attach(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        """Add an attachment."""
        self._writer.add_attachment(time_ns, time_ns, name, media_type, data)


class SolutionWriter(_McapOutput):
    """Writes a solution block by block.

    Used as a context manager: the file is written to ``PATH.part`` and renamed when the block
    ends; on an exception the part is removed and no ``PATH`` appears.

    Parameters
    ----------
    path : path
    overwrite : bool
    rate_hz : float, optional
        Output rate of the solution; every sample by default.

    Raises
    ------
    ConfigError
        If `path` exists and must not be overwritten, or its folder does not exist.
    """

    def __init__(
        self, path: str | Path, *, overwrite: bool = False, rate_hz: float | None = None
    ) -> None:
        super().__init__(path, overwrite=overwrite)
        self._solution = _Channel(self._writer, SOLUTION_TOPIC, NAV_SOLUTION, "ned")
        self._fix = _Channel(self._writer, FIX_TOPIC, NAV_SAT_FIX, "imu")
        self._every = Decimator(rate_hz)
        self._fixes = Decimator(FIX_RATE)

    def write(self, nav: Trajectory) -> None:
        """Append a block."""
        stamp_ns = nav.epoch_ns + np.rint(nav.t * 1e9).astype(np.int64)
        rows = self._every.rows(nav.t)
        lat_deg, lon_deg = nav.lat / DEG, _within_180(nav.lon / DEG)
        roll, pitch, heading = (nav.euler[rows] / DEG).T
        self._solution.put(
            stamp_ns[rows],
            {
                "latitude_deg": lat_deg[rows],
                "longitude_deg": lon_deg[rows],
                "height_m": nav.h[rows],
                "v_north_m_s": nav.v_eb_n[rows, 0],
                "v_east_m_s": nav.v_eb_n[rows, 1],
                "v_down_m_s": nav.v_eb_n[rows, 2],
                "roll_deg": roll,
                "pitch_deg": pitch,
                "heading_deg": np.where(heading < 0.0, heading + 360.0, heading) % 360.0,
                "orientation.w": nav.q_nb[rows, 0],
                "orientation.x": nav.q_nb[rows, 1],
                "orientation.y": nav.q_nb[rows, 2],
                "orientation.z": nav.q_nb[rows, 3],
                "status": nav.status[rows],
            },
        )
        rows = self._fixes.rows(nav.t)
        self._fix.put(
            stamp_ns[rows],
            {"latitude": lat_deg[rows], "longitude": lon_deg[rows], "altitude": nav.h[rows]},
        )


def _within_180(degrees: NDArray[np.float64]) -> NDArray[np.float64]:
    wrapped = degrees - 360.0 * np.rint(degrees / 360.0)
    return np.asarray(wrapped)


def write_solution(path: str | Path, nav: Trajectory, *, overwrite: bool = False) -> None:
    """Write a trajectory as MCAP: ``/navgrade/solution`` and ``/navgrade/fix``.

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
        out.write(nav)


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
    with _McapOutput(path, overwrite=overwrite) as out:
        channel = _Channel(out._writer, topic, IMU_INCREMENT, frame_id)
        columns = {"interval_s": imu.dt}
        for i, axis in enumerate("xyz"):
            columns[f"delta_angle.{axis}"] = imu.gyro[:, i]
            columns[f"delta_velocity.{axis}"] = imu.accel[:, i]
        channel.put(imu.epoch_ns + np.rint(imu.t * 1e9).astype(np.int64), columns)
