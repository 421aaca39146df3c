"""Recorded samples of any kind to integrals over their intervals.

An average times its interval is the integral, exactly. Instantaneous rates are not increments:
a trapezoid over them leaves the coning of an uncompensated algorithm. They are integrated with
the polynomial through six samples around the interval, whatever their spacing; for equal spacing
its weights are (11, -93, 802, 802, -93, 11)/1440.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from navgrade.imu import ImuSamples, concatenate

Array = NDArray[np.float64]

_POINTS = 6
_BEFORE = 3  # samples of the stencil at or before the start of the interval
_AHEAD = _POINTS - _BEFORE - 1  # samples it needs after the end


def _integration_weights(nodes: Array, start: Array, end: Array) -> Array:
    """Weights (n, m) that integrate the polynomial through `nodes` (n, m) over [start, end]."""
    m = nodes.shape[1]
    scale = (end - start)[:, None]
    x = (nodes - end[:, None]) / scale
    powers = np.arange(m)
    vandermonde = x[:, None, :] ** powers[None, :, None]
    moments = -((-1.0) ** (powers + 1)) / (powers + 1)  # of x^j over [-1, 0]
    return (
        np.linalg.solve(vandermonde, np.broadcast_to(moments[:, None], (len(x), m, 1)))[..., 0]
        * scale
    )


def _integrate(samples: ImuSamples, rows: range, is_head: bool) -> ImuSamples:
    """Increments of `rows`; `samples` holds the neighbours, `is_head` the start of the log."""
    n = len(samples)
    index = np.arange(rows.start, rows.stop)
    points = min(_POINTS, n)
    low = np.clip(index - _BEFORE, 0, n - points)
    stencil = low[:, None] + np.arange(points)[None, :]
    start = samples.t[index] - samples.dt[index]
    if rows.start > 0 or not is_head:
        start[:] = samples.t[index - 1]
    else:
        start[1:] = samples.t[index[1:] - 1]
    weights = _integration_weights(samples.t[stencil], start, samples.t[index])
    if is_head and rows.start == 0 and points > 3:
        # The first interval has no sample at its start: a parabola, so that noise stays small.
        weights[0] = 0.0
        weights[0, :3] = _integration_weights(samples.t[None, :3], start[:1], samples.t[:1])[0]
    return ImuSamples(
        t=samples.t[index],
        dt=samples.t[index] - start,
        gyro=np.einsum("np,npi->ni", weights, samples.gyro[stencil]),
        accel=np.einsum("np,npi->ni", weights, samples.accel[stencil]),
        kind="increment",
        epoch_ns=samples.epoch_ns,
        status=samples.status[index],
    )


def _rates_to_increments(blocks: Iterable[ImuSamples]) -> Iterator[ImuSamples]:
    held: ImuSamples | None = None
    done = 0  # rows of `held` already handed on
    is_head = True
    for block in blocks:
        held = block if held is None else concatenate([held, block])
        ready = len(held) - _AHEAD
        if ready <= done or len(held) < 2 * _POINTS:
            continue
        yield _integrate(held, range(done, ready), is_head)
        first_kept = max(ready - _BEFORE - _POINTS, 0)
        is_head = is_head and first_kept == 0
        held = held[first_kept:]
        done = ready - first_kept
    if held is not None and len(held) > done:
        yield _integrate(held, range(done, len(held)), is_head)


def _from_stamp_to_stamp(blocks: Iterable[ImuSamples]) -> Iterator[ImuSamples]:
    """Let the interval of each sample begin at the stamp before it."""
    last: float | None = None
    for block in blocks:
        dt = block.dt.copy()
        dt[1:] = np.diff(block.t)
        if last is not None:
            dt[0] = block.t[0] - last
        last = float(block.t[-1])
        yield replace(block, dt=dt)


def to_increments(
    blocks: Iterable[ImuSamples], *, keep_rates: bool = False
) -> Iterator[ImuSamples]:
    """Turn blocks of any kind into increments; ``compensated`` ones stay what they are.

    ``rate`` input is held back by two samples, because its integration looks that far ahead; with
    `keep_rates` it stays what it is, each interval from the stamp before to its own.
    """
    iterator = iter(blocks)
    first = next(iterator, None)
    if first is None:
        return

    def chain() -> Iterator[ImuSamples]:
        yield first
        yield from iterator

    if first.kind == "rate":
        yield from (_from_stamp_to_stamp if keep_rates else _rates_to_increments)(chain())
        return
    for block in chain():
        if block.kind == "average":
            dt = block.dt[:, None]
            block = replace(block, gyro=block.gyro * dt, accel=block.accel * dt, kind="increment")
        yield block
