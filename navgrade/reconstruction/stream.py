"""Algorithms over a stream of blocks: context at the seams, stretches between gaps, all cores.

A stretch is a run of samples no window may leave: it ends where recorded and bridged samples
meet, and where intervals within one window would differ by more than a factor `MAX_RATIO`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from earth._jit import kernel
from navgrade.imu import BodyIncrements, ImuSamples, Status, concatenate

Array = NDArray[np.float64]

MAX_RATIO = 10.0  # of the intervals in one window
_OPEN = np.iinfo(np.int64).max
_LEAST = 4096  # rows worth handing to another core: 0.1 ms and more of work


@dataclass(frozen=True)
class Reconstruction:
    """One algorithm of the registry, one row out for each sample.

    Attributes
    ----------
    summary : str
    order : int
        Global order of the velocity error in the interval, for smooth motion.
    coning_order : int
        Power of (coning frequency times interval) its pure-coning drift falls with.
    loop : callable
        ``loop(dt, dtheta, dvel, first, phi, dv, dr, status)`` fills the rows of `phi`, `dv` and
        `dr` for the samples from `first` on, as many as they hold; it may set `Status` bits. The
        arrays are of one stretch, and end where it ends or `back` and `ahead` samples further.
    back, ahead : int
        Samples it looks back and ahead.
    of_rates : Reconstruction, optional
        Of an algorithm that takes rates at the ends of the intervals: its form for samples of kind
        ``rate``, which gets them as they are. For other algorithms they become increments first.
    """

    summary: str
    order: int
    coning_order: int
    loop: Callable[[Array, Array, Array, int, Array, Array, Array, NDArray[np.uint32]], None]
    back: int = 0
    ahead: int = 0
    of_rates: Reconstruction | None = None


@dataclass(frozen=True)
class BlockForm:
    """One algorithm of the registry, one row out for each `samples` samples.

    Attributes
    ----------
    summary, order, coning_order
        As in `Reconstruction`; the interval is that of the samples.
    loop : callable
        ``loop(dt, dtheta, dvel, phi, dv, dr)`` fills ``ceil(n / samples)`` rows.
    samples : int
    """

    summary: str
    order: int
    coning_order: int
    loop: Callable[[Array, Array, Array, Array, Array, Array], None]
    samples: int


@kernel
def _cut(dt, bridged, first, start, reach, ratio, cuts):
    """Write where stretches start from row `first` on to `cuts`; return how many."""
    found = 0
    for k in range(first, dt.shape[0]):
        ends = k > 0 and bridged[k] != bridged[k - 1]
        for j in range(max(start, k - reach), k):
            if dt[j] > ratio * dt[k] or dt[k] > ratio * dt[j]:
                ends = True
        if ends:
            start = k
            cuts[found] = k
            found += 1
    return found


class _Stretches:
    """Where stretches start, by index since the start of the stream."""

    def __init__(self, reach: int) -> None:
        self.starts = [0]
        self._reach = max(reach, 1)
        self._dt = np.empty(0)
        self._bridged = np.empty(0, bool)
        self._seen = 0

    def see(self, block: ImuSamples) -> None:
        """Take the next block into account."""
        known = len(self._dt)
        dt = np.concatenate([self._dt, block.dt])
        bridged = np.concatenate([self._bridged, (block.status & np.uint32(Status.BRIDGED)) != 0])
        if dt.max() > MAX_RATIO * dt.min() or (bridged != bridged[0]).any():
            cuts = np.empty(len(dt), np.int64)
            offset = self._seen - known
            start = max(self.starts[-1] - offset, 0)
            found = _cut(dt, bridged, known, start, self._reach, MAX_RATIO, cuts)
            self.starts += [offset + int(cut) for cut in cuts[:found]]
        self._seen += len(block)
        self._dt, self._bridged = dt[-self._reach :], bridged[-self._reach :]

    def forget(self, before: int) -> None:
        """Drop stretches that end before an index."""
        while len(self.starts) > 1 and self.starts[1] <= before:
            self.starts.pop(0)

    def within(self, first: int, stop: int) -> Iterator[tuple[int, int]]:
        """Start and end of those that meet [first, stop); the last one's end is not known."""
        for start, end in zip(self.starts, [*self.starts[1:], _OPEN], strict=True):
            if start < stop and end > first:
                yield start, end


def by_sample(blocks: Iterable[ImuSamples], chosen: Reconstruction) -> Iterator[BodyIncrements]:
    """Run an algorithm over consecutive blocks; its rows come `ahead` samples late."""
    back, ahead = chosen.back, chosen.ahead
    reach = max(back, ahead)
    stretches = _Stretches(reach)
    held: ImuSamples | None = None  # the last `back + ahead` samples
    seen = done = 0

    workers = max((os.cpu_count() or 1) - 1, 1)  # one core is the recursion's
    with ThreadPoolExecutor(workers) as cores:

        def body(samples: ImuSamples, at: int, first: int, stop: int) -> BodyIncrements:
            rows = slice(first - at, stop - at)
            n = stop - first
            phi, dv, dr = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
            status = samples.status[rows].copy()

            def fill(begin: int, end: int, low: int, high: int) -> None:
                part, out = slice(low - at, high - at), slice(begin - first, end - first)
                chosen.loop(
                    samples.dt[part],
                    samples.gyro[part],
                    samples.accel[part],
                    begin - low,
                    phi[out],
                    dv[out],
                    dr[out],
                    status[out],
                )

            jobs = []
            share = max(-(-n // workers), _LEAST)
            for start, end in stretches.within(first, stop):
                for begin in range(max(start, first), min(end, stop), share):
                    piece_end = min(begin + share, end, stop)
                    low = max(start, begin - back)
                    high = min(end, piece_end + ahead, at + len(samples))
                    jobs.append((begin, piece_end, low, high))
            if len(jobs) == 1:
                fill(*jobs[0])
            else:
                for job in [cores.submit(fill, *job) for job in jobs]:
                    job.result()
            return BodyIncrements(samples.t[rows], samples.dt[rows], phi, dv, dr, status)

        for block in blocks:
            stretches.see(block)
            at, seen = seen, seen + len(block)
            if held is not None and len(block) >= 2 * reach:
                seam = concatenate([held, block[: 2 * reach]])
                yield body(seam, at - len(held), done, at + reach)
                done = at + reach
            elif held is not None:
                block = concatenate([held, block])
                at = seen - len(block)
            if done < seen - ahead:
                yield body(block, at, done, seen - ahead)
                done = seen - ahead
                stretches.forget(done)
            if reach:
                held = block[max(len(block) - back - ahead, 0) :]
        if held is not None and done < seen:
            yield body(held, seen - len(held), done, seen)


def by_block(blocks: Iterable[ImuSamples], chosen: BlockForm) -> Iterator[BodyIncrements]:
    """Run a block form over consecutive blocks; groups start anew in each stretch."""
    size = chosen.samples
    stretches = _Stretches(size - 1)
    held: ImuSamples | None = None  # a group that is not full yet
    seen = 0

    def body(samples: ImuSamples) -> BodyIncrements:
        starts = np.arange(0, len(samples), size)
        last = np.minimum(starts + size, len(samples)) - 1
        n = len(starts)
        phi, dv, dr = np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3))
        chosen.loop(samples.dt, samples.gyro, samples.accel, phi, dv, dr)
        status = np.bitwise_or.reduceat(samples.status, starts)
        status[last - starts + 1 < size] |= np.uint32(Status.SHORT_WINDOW)
        dt = np.add.reduceat(samples.dt, starts)
        return BodyIncrements(samples.t[last], dt, phi, dv, dr, status)

    for block in blocks:
        stretches.see(block)
        seen += len(block)
        samples = block if held is None else concatenate([held, block])
        at, held = seen - len(samples), None
        for start, end in stretches.within(at, seen):
            part = samples[max(start, at) - at : min(end, seen) - at]
            whole = len(part) if end <= seen else len(part) - len(part) % size
            if whole:
                yield body(part[:whole])
            if whole < len(part):
                held = part[whole:]
        stretches.forget(seen)
    if held is not None:
        yield body(held)
