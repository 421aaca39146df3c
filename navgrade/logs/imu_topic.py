"""IMU samples as messages: which type, where its x, y and z point, and its members."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from earth.frames import C_bs
from navgrade.errors import LogError
from navgrade.imu import ImuSamples
from navgrade.logs.container.writer import Batch, McapWriter
from navgrade.logs.messages import IMU, IMU_INCREMENT, Schema
from navgrade.logs.outgoing import Columns, OutTopic, vector
from navgrade.logs.topics import AXES_KEY, KIND_KEY

_MAX_SPAN = 1e6  # s: up to here seconds give back their nanoseconds
_NO_ORIENTATION = np.array([-1.0, *[0.0] * 8])  # by the definition of the message


class ImuForm(NamedTuple):
    """A message type for IMU samples, with the topic and axes it has unless said."""

    schema: Schema
    topic: str
    axes: str
    columns: Callable[[ImuSamples, NDArray[np.float64]], Columns]


def _increments(samples: ImuSamples, to_sensor: NDArray[np.float64]) -> Columns:
    dtheta, dvel = samples.gyro, samples.accel
    if not samples.is_integrated:
        dtheta, dvel = dtheta * samples.dt[:, None], dvel * samples.dt[:, None]
    return {
        "interval_s": samples.dt,
        **vector("delta_angle", dtheta @ to_sensor),
        **vector("delta_velocity", dvel @ to_sensor),
    }


def _rates(samples: ImuSamples, to_sensor: NDArray[np.float64]) -> Columns:
    return {
        "orientation.w": np.ones(len(samples)),
        "orientation_covariance": _NO_ORIENTATION,
        **vector("angular_velocity", samples.gyro @ to_sensor),
        **vector("linear_acceleration", samples.accel @ to_sensor),
    }


INCREMENTS = ImuForm(IMU_INCREMENT, "/imu/increments", "FRD", _increments)
RATES = ImuForm(IMU, "/imu/data_raw", "FLU", _rates)


class ImuTopic:
    """An IMU topic being written; its channel tells kind and axes.

    Parameters
    ----------
    out : McapWriter
    form : ImuForm
    kind : str
    topic, axes : str, optional
        Those of the form by default.
    frame_id : str
    """

    def __init__(
        self,
        out: McapWriter,
        form: ImuForm,
        kind: str,
        *,
        topic: str | None = None,
        axes: str | None = None,
        frame_id: str = "imu",
    ) -> None:
        self.name = topic or form.topic
        self.axes = axes or form.axes
        self._form = form
        self._to_sensor = C_bs(self.axes)  # of rows; of columns it would be the transpose
        self._topic = OutTopic(
            out,
            self.name,
            form.schema,
            {"header.frame_id": frame_id},
            metadata={KIND_KEY: kind, AXES_KEY: self.axes},
        )

    def batch(self, samples: ImuSamples) -> Batch:
        """Samples in body axes as messages.

        Raises
        ------
        LogError
            If the samples span more than a million seconds, which hide their nanoseconds.
        """
        return self._topic.batch(stamps_ns(samples), self._form.columns(samples, self._to_sensor))


def stamps_ns(samples: ImuSamples) -> NDArray[np.int64]:
    """Unix time of each sample, ns."""
    if samples.t[-1] > _MAX_SPAN:
        raise LogError(
            f"a sample lies {samples.t[-1] / 86_400.0:.1f} days after the first: a stamp has "
            "jumped (`navgrade inspect --deep` tells where), or cut the log"
        )
    return samples.epoch_ns + np.rint(samples.t * 1e9).astype(np.int64)
