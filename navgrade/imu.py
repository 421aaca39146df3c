"""IMU samples as recorded, and the body increments reconstructed from them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import IntFlag
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

Kind = Literal["rate", "average", "increment", "compensated"]
KINDS: tuple[Kind, ...] = get_args(Kind)
DvFrame = Literal["start", "end"]
DV_FRAMES: tuple[DvFrame, ...] = get_args(DvFrame)
KIND_HELP = (
    "rate (instantaneous at the stamp), average (mean over the interval that ends at the stamp), "
    "increment (integral over that interval) or compensated (increments the sensor has already "
    "corrected for coning and sculling)"
)


JITTER = 0.5  # nominal intervals: a hole shorter than this is jitter of the stamps
MAX_MISSING = 2.25  # nominal intervals: stamps further apart than three, plus jitter, leave a gap
NOMINAL_SAMPLES = 1000  # the first ones, whose median is the nominal interval


class Status(IntFlag):
    """What a sample went through, bit by bit; 0 is an ordinary sample."""

    BRIDGED = 1  # not recorded: interpolated across a gap
    STRETCHED = 2  # the mean rate also stands for up to 3 missing intervals before it
    SHORT_WINDOW = 4  # fewer samples than the reconstruction asks for
    SHIFTED_WINDOW = 8  # a centred window moved aside, at an end of the log or of a gap
    UNAIDED = 16  # no pressure height for the vertical loop


def _frozen(array: NDArray[np.float64]) -> NDArray[np.float64]:
    view = array.view()
    view.setflags(write=False)
    return view


def _column(name: str, values: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    if isinstance(values, np.ndarray) and not values.flags.writeable:
        array = np.ascontiguousarray(values, dtype=np.float64)
    else:  # a copy: what was checked must not change any more
        array = np.array(values, dtype=np.float64, order="C")
    if array.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, got {array.shape}")
    if not np.isfinite(array.sum()):
        bad = ~np.isfinite(array).reshape(len(array), -1).all(axis=1)
        if bad.any():
            index = int(np.argmax(bad))
            raise ValueError(f"{name} is not finite at index {index}: {array[index]}")
    return _frozen(array)


def nominal_interval(steps: NDArray[np.float64]) -> float:
    """Median of the first thousand intervals, s."""
    return float(np.median(steps[:NOMINAL_SAMPLES]))


def intervals(t: NDArray[np.float64], last: float | None, nominal: float) -> NDArray[np.float64]:
    """Interval lengths, s, of samples known by their stamps alone.

    Each reaches back to the previous stamp (`last` for the first one), but where samples are
    missing, and where there is no previous stamp, only as far as a nominal interval.
    """
    steps = np.diff(t, prepend=t[0] - nominal if last is None else last)
    return np.where(steps > (1.0 + JITTER) * nominal, nominal, steps)


@dataclass(frozen=True, eq=False)
class ImuSamples:
    """A stretch of IMU samples in body axes (forward-right-down).

    Parameters
    ----------
    t : array_like, shape (n,)
        Stamp of each sample, s since the epoch: the end of its interval.
    gyro : array_like, shape (n, 3)
        Angular rate of b relative to i, in b: rad/s, or rad for increments.
    accel : array_like, shape (n, 3)
        Specific force in b: m/s^2, or m/s for increments. At rest it points up: (0, 0, -g).
    kind : {"rate", "average", "increment", "compensated"}
        What the numbers are; nothing guesses it.
    dt : array_like, shape (n,), optional
        Length of each interval, s. By default the step from the previous stamp; for the first
        sample, and after a step of more than one and a half median ones (samples are missing),
        the median step.
    epoch_ns : int
        Unix time of ``t = 0``, ns.
    status : array_like of int, shape (n,), optional
        `Status` bits.
    dv_frame : {"start", "end"}
        Of compensated velocity increments: resolved in b at the start or the end of the interval.

    Raises
    ------
    ValueError
        On a wrong shape, a value that is not finite, times that do not increase, an interval
        that is not positive, or an unknown kind; the message names the index.
    """

    t: NDArray[np.float64]
    gyro: NDArray[np.float64]
    accel: NDArray[np.float64]
    kind: Kind
    dt: NDArray[np.float64] = field(default=None)  # type: ignore[arg-type]  # filled in below
    epoch_ns: int = 0
    status: NDArray[np.uint32] = field(default=None)  # type: ignore[arg-type]  # filled in below
    dv_frame: DvFrame = "start"

    def __post_init__(self) -> None:
        for name, allowed in (("kind", KINDS), ("dv_frame", DV_FRAMES)):
            if getattr(self, name) not in allowed:
                raise ValueError(
                    f"{name} must be one of {', '.join(allowed)}, got {getattr(self, name)!r}"
                )
        n = np.size(self.t)
        t = _column("t", self.t, (n,))
        steps = np.diff(t)
        if n > 1 and not steps.min() > 0.0:
            index = int(np.argmin(steps > 0.0)) + 1
            raise ValueError(
                f"t must increase: {t[index]!r} s at index {index} follows {t[index - 1]!r} s"
            )
        if self.dt is None:
            if n < 2:
                raise ValueError("dt must be given for fewer than two samples")
            dt = _frozen(intervals(t, None, nominal_interval(steps)))
        else:
            dt = _column("dt", self.dt, (n,))
            if n and not dt.min() > 0.0:
                index = int(np.argmin(dt > 0.0))
                raise ValueError(f"dt must be positive, got {dt[index]!r} s at index {index}")
        status = (
            np.zeros(n, np.uint32) if self.status is None else np.asarray(self.status, np.uint32)
        )
        if status.shape != (n,):
            raise ValueError(f"status must have shape {(n,)}, got {status.shape}")
        status = status.view()
        status.setflags(write=False)
        for name, value in (
            ("t", t),
            ("dt", dt),
            ("gyro", _column("gyro", self.gyro, (n, 3))),
            ("accel", _column("accel", self.accel, (n, 3))),
            ("status", status),
        ):
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, rows: slice) -> ImuSamples:
        part = object.__new__(ImuSamples)  # rows of valid samples are valid: no second check
        for name in ("t", "dt", "gyro", "accel", "status"):
            object.__setattr__(part, name, getattr(self, name)[rows])
        for name in ("kind", "epoch_ns", "dv_frame"):
            object.__setattr__(part, name, getattr(self, name))
        return part

    @property
    def is_integrated(self) -> bool:
        """True when `gyro` and `accel` are increments rather than rates."""
        return self.kind in ("increment", "compensated")

    def mean_rates(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Angular rate (rad/s) and specific force (m/s^2), one row per sample."""
        if self.is_integrated:
            dt = self.dt[:, None]
            return self.gyro / dt, self.accel / dt
        return self.gyro, self.accel

    def blocks(self, size: int) -> Iterator[ImuSamples]:
        """Consecutive pieces of at most `size` samples."""
        for start in range(0, len(self), size):
            yield self[start : start + size]


def concatenate(pieces: list[ImuSamples]) -> ImuSamples:
    """Join consecutive stretches of one log."""
    first = pieces[0]
    if len(pieces) == 1:
        return first
    return ImuSamples(
        t=np.concatenate([p.t for p in pieces]),
        dt=np.concatenate([p.dt for p in pieces]),
        gyro=np.concatenate([p.gyro for p in pieces]),
        accel=np.concatenate([p.accel for p in pieces]),
        status=np.concatenate([p.status for p in pieces]),
        kind=first.kind,
        epoch_ns=first.epoch_ns,
        dv_frame=first.dv_frame,
    )


@dataclass(frozen=True, eq=False)
class BodyIncrements:
    """What reconstruction hands to mechanization, one row per update interval.

    Attributes
    ----------
    t, dt : ndarray, shape (n,)
        End and length of each interval, s.
    phi : ndarray, shape (n, 3)
        Rotation vector from b at the start to b at the end of the interval, rad.
    dv : ndarray, shape (n, 3)
        Integral of the specific force, resolved in b at the start of the interval, m/s.
    dr : ndarray, shape (n, 3)
        Integral of that integral over the interval, m: how far the specific force alone moves
        the body.
    status : ndarray of uint32, shape (n,)
    """

    t: NDArray[np.float64]
    dt: NDArray[np.float64]
    phi: NDArray[np.float64]
    dv: NDArray[np.float64]
    dr: NDArray[np.float64]
    status: NDArray[np.uint32]

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, rows: slice) -> BodyIncrements:
        return BodyIncrements(
            *(getattr(self, name)[rows] for name in ("t", "dt", "phi", "dv", "dr", "status"))
        )
