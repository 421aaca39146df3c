"""A recording of an IMU with its truth and fixes: one MCAP file in the order of log time."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from navgrade.imu import ImuSamples, Kind
from navgrade.logs.container.writer import Batch, McapWriter
from navgrade.logs.copying import OWN
from navgrade.logs.imu_topic import INCREMENTS, RATES, ImuTopic
from navgrade.logs.messages import NAV_SAT_FIX, NAV_SOLUTION
from navgrade.logs.outgoing import OutTopic
from navgrade.logs.solution import fix_columns, solution_columns
from navgrade.state import Trajectory

TRUTH_TOPIC = "/truth/solution"
GNSS_TOPIC = "/gnss/fix"
_FIX, _GPS, _DIAGONAL_KNOWN = 0, 1, 2  # by the definition of the message


class RecordingWriter:
    """Writes samples, truth and fixes block by block.

    Used as a context manager: the file is written to ``PATH.part`` and renamed when the block
    ends; on an exception the part is removed and no ``PATH`` appears.

    Increments are ``navgrade_msgs/msg/ImuIncrement``, rates and averages ``sensor_msgs/msg/Imu``;
    kind and axes stand in the metadata of the channel. The truth is on ``/truth/solution``, of the
    type of a solution, the fixes are ``sensor_msgs/msg/NavSatFix`` on ``/gnss/fix``.

    Parameters
    ----------
    path : path
    kind : {"rate", "average", "increment"}
    axes : str, optional
        Of the IMU in the file, see `earth.frames.C_bs`; FRD for increments, FLU else.
    topic : str, optional
        Of the IMU; ``/imu/increments`` or ``/imu/data_raw`` by default.
    overwrite : bool

    Attributes
    ----------
    file : McapWriter
        Takes metadata and attachments.
    imu : ImuTopic

    Raises
    ------
    ConfigError
        If `path` exists and must not be overwritten, or its folder does not exist.
    ValueError
        If `axes` are not those of a right-handed triple, or the topic is one of the others.
    """

    def __init__(
        self,
        path: str | Path,
        kind: Kind,
        *,
        axes: str | None = None,
        topic: str | None = None,
        overwrite: bool = False,
    ) -> None:
        if topic in (TRUTH_TOPIC, GNSS_TOPIC) or (topic or "").startswith(OWN):
            raise ValueError(f"the topic {topic} is not one for an IMU")
        form = INCREMENTS if kind in ("increment", "compensated") else RATES
        self.file = McapWriter(path, overwrite=overwrite)
        try:
            self.imu = ImuTopic(self.file, form, kind, topic=topic, axes=axes)
            self._truth = OutTopic(self.file, TRUTH_TOPIC, NAV_SOLUTION, {"header.frame_id": "ned"})
            self._fix = OutTopic(self.file, GNSS_TOPIC, NAV_SAT_FIX, {"header.frame_id": "gnss"})
        except BaseException as error:
            self.file.__exit__(type(error), error, None)
            raise

    def __enter__(self) -> Self:
        self.file.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.file.__exit__(kind, error, trace)

    def write(
        self,
        imu: ImuSamples,
        truth: Trajectory,
        fixes: Trajectory,
        sigma_r_n: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Append a block; each part may be empty.

        Parameters
        ----------
        imu : ImuSamples
            In body axes.
        truth : Trajectory
        fixes : Trajectory
            Only their positions are written.
        sigma_r_n : tuple of float
            Of the fixes along north, east, down, m.
        """
        batches = [self._truth.batch(_stamps(truth), solution_columns(truth, slice(None)))]
        if len(imu):
            batches.append(self.imu.batch(imu))
        if len(fixes):
            batches.append(self._fixes(fixes, sigma_r_n))
        self.file.write(*batches)

    def _fixes(self, fixes: Trajectory, sigma_r_n: tuple[float, float, float]) -> Batch:
        north, east, down = sigma_r_n
        columns = {
            **fix_columns(fixes, slice(None)),
            "status.status": np.full(len(fixes), _FIX),
            "status.service": np.full(len(fixes), _GPS),
            "position_covariance": np.diag([east**2, north**2, down**2]).ravel(),
            "position_covariance_type": np.full(len(fixes), _DIAGONAL_KNOWN),
        }
        return self._fix.batch(_stamps(fixes), columns)


def _stamps(nav: Trajectory) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return nav.epoch_ns + np.rint(nav.t * 1e9).astype(np.int64)
