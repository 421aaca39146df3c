"""Holes in the time line: small ones are stretched over, gaps are refused or bridged, all told."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import GapError
from navgrade.imu import (
    JITTER,
    MAX_MISSING,
    NOMINAL_SAMPLES,
    ImuSamples,
    Status,
    concatenate,
    nominal_interval,
)

MAX_BRIDGE = 600.0  # s: beyond it a straight line between two rates says nothing


@dataclass(frozen=True)
class Gap:
    """A stretch without samples.

    Attributes
    ----------
    start, length : float
        s since the epoch, and s.
    """

    start: float
    length: float


def _bridge(before: ImuSamples, after: ImuSamples, hole: float, nominal: float) -> ImuSamples:
    """Samples across `hole` on the straight line between the mean rates of its neighbours."""
    count = max(round(hole / nominal), 1)
    dt = np.full(count, hole / count)
    share = ((np.arange(count) + 0.5) / count)[:, None]
    (gyro_0,), (accel_0,) = before.mean_rates()
    (gyro_1,), (accel_1,) = after.mean_rates()
    gyro = (1.0 - share) * gyro_0 + share * gyro_1
    accel = (1.0 - share) * accel_0 + share * accel_1
    scale = dt[:, None] if before.is_integrated else 1.0
    end = float(after.t[0] - after.dt[0])
    return replace(
        before,
        t=np.linspace(end - hole, end, count + 1)[1:],
        dt=dt,
        gyro=gyro * scale,
        accel=accel * scale,
        status=np.full(count, Status.BRIDGED, np.uint32),
    )


def without_gaps(
    blocks: Iterable[ImuSamples], *, bridge: bool, gaps: list[Gap], since: float = -np.inf
) -> Iterator[ImuSamples]:
    """Make the intervals of consecutive blocks meet.

    Holes of up to half an interval are jitter of the stamps and stay. Up to two missing samples
    are stretched over: the next sample's mean rate stands for the hole too. Anything longer is a
    gap.

    Parameters
    ----------
    blocks : iterable of ImuSamples
    bridge : bool
        Interpolate across gaps; otherwise the first one raises.
    gaps : list of Gap
        Receives every gap met.
    since : float
        Gaps that end before it are left alone: nothing is integrated there.

    Raises
    ------
    GapError
        On a gap, unless `bridge`; on one too long to bridge; and on intervals that overlap.
    """
    last: ImuSamples | None = None
    nominal = 0.0
    for block in _enough_to_judge(blocks):
        if last is None:
            nominal = nominal_interval(block.dt)
        holes = _holes(last, block)
        if np.abs(holes).max() > JITTER * nominal:
            block = _mended(last, block, holes, nominal, bridge, gaps, since)
        yield block
        last = block[len(block) - 1 :]


def _enough_to_judge(blocks: Iterable[ImuSamples]) -> Iterator[ImuSamples]:
    """Join the first blocks until the nominal interval does not depend on where they end."""
    head: list[ImuSamples] | None = []
    for block in blocks:
        if not len(block):
            continue
        if head is None:
            yield block
            continue
        head.append(block)
        if sum(map(len, head)) >= NOMINAL_SAMPLES:
            yield concatenate(head)
            head = None
    if head:
        yield concatenate(head)


def _holes(last: ImuSamples | None, block: ImuSamples) -> NDArray[np.float64]:
    """Time from the end of the previous sample to the start of each interval, s."""
    holes = block.t - block.dt
    holes[1:] -= block.t[:-1]
    holes[0] -= holes[0] if last is None else last.t[0]
    return holes


def _mended(
    last: ImuSamples | None,
    block: ImuSamples,
    holes: NDArray[np.float64],
    nominal: float,
    bridge: bool,
    gaps: list[Gap],
    since: float,
) -> ImuSamples:
    bad = int(np.argmin(holes))
    if holes[bad] < -JITTER * nominal:
        raise GapError(
            f"the interval of the sample at {block.t[bad]:.6f} s starts {-holes[bad]:.6f} s "
            "before the previous sample ends; its dt or its stamp is wrong",
            time_s=float(block.t[bad]),
        )
    stretch = (holes > JITTER * nominal) & (holes <= MAX_MISSING * nominal)
    if stretch.any():
        wider = np.where(stretch, block.dt + holes, block.dt)
        ratio = (wider / block.dt)[:, None] if block.is_integrated else 1.0
        block = replace(
            block,
            dt=wider,
            gyro=block.gyro * ratio,
            accel=block.accel * ratio,
            status=block.status | np.where(stretch, np.uint32(Status.STRETCHED), np.uint32(0)),
        )
    pieces: list[ImuSamples] = []
    start = 0
    for k in np.flatnonzero((holes > MAX_MISSING * nominal) & (block.t - block.dt > since)):
        before = block[k - 1 : k] if k else last
        assert before is not None  # the first sample of all has no hole before it
        gap = Gap(float(before.t[0]), float(holes[k]))
        gaps.append(gap)
        if not bridge:
            raise GapError(
                f"{gap.length:.3f} s without samples after {gap.start:.3f} s (interval "
                f"{nominal:.6f} s); interpolate across gaps with --bridge-gaps (bridge_gaps=True), "
                "or cut the log there",
                time_s=gap.start,
            )
        if gap.length > MAX_BRIDGE:
            raise GapError(
                f"{gap.length:.3f} s without samples after {gap.start:.3f} s is too long to "
                f"interpolate across (limit {MAX_BRIDGE:.0f} s); cut the log there",
                time_s=gap.start,
            )
        if k > start:
            pieces.append(block[start:k])
        pieces.append(_bridge(before, block[k : k + 1], gap.length, nominal))
        start = int(k)
    pieces.append(block[start:])
    return concatenate(pieces)
