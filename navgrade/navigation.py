"""The whole way from samples to a solution, block by block."""

from __future__ import annotations

import difflib
from collections import deque
from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from earth import gravity as earth_gravity
from earth.disturbance import DisturbanceGrid
from earth.ellipsoid import WGS84, Ellipsoid
from earth.gravity import GravityFunction
from navgrade import mechanization as frames
from navgrade import reconstruction as body
from navgrade.errors import StateTimeError
from navgrade.gaps import Gap, without_gaps
from navgrade.imu import BodyIncrements, ImuSamples, concatenate
from navgrade.mechanization import FLAT_WORLD, MECHANIZATIONS, VERTICAL, Mechanization, Terms, World
from navgrade.mechanization.terms import without as terms_without
from navgrade.reconstruction import (
    BODY_TERMS,
    RECONSTRUCTIONS,
    BlockForm,
    reconstruct,
    takes_rates,
    to_increments,
)
from navgrade.state import Columns, NavState, Trajectory
from navgrade.vertical import BaroLoop

BLOCK = 65_536  # samples of one block of an array held in memory
_COINCIDE = 1e-9  # s: a state this close to a sample's end needs no split

FRAMES = MECHANIZATIONS | FLAT_WORLD
TERMS = frames.TERMS | BODY_TERMS  # what `navigate` can do without, one at a time


def check_choice(name: str, value: str, allowed: Iterable[str]) -> None:
    """Raise ValueError, naming the nearest, unless `value` is one of `allowed`."""
    choices = list(allowed)
    if value not in choices:
        near = difflib.get_close_matches(value, choices, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"{name} {value!r} is not one of {', '.join(choices)}{hint}")


def choose(
    reconstruction: str | None, mechanization: str, vertical: str | BaroLoop = "free"
) -> tuple[str, Mechanization]:
    """Return the body stage, the mechanization's own or the default unless named, and the frame.

    Raises
    ------
    ValueError
        On an unknown name, and on choices that contradict each other.
    """
    if reconstruction is not None:
        check_choice("reconstruction", reconstruction, RECONSTRUCTIONS)
    check_choice("mechanization", mechanization, FRAMES)
    if isinstance(vertical, str):
        check_choice("vertical", vertical, VERTICAL)
    frame = FRAMES[mechanization]
    own = frame.reconstruction
    if own is not None and reconstruction not in (None, own):
        raise ValueError(
            f"{mechanization!r} brings its own reconstruction {own!r} and takes no other, here "
            f"{reconstruction!r}; the frame 'flat' takes any"
        )
    if mechanization in FLAT_WORLD and vertical != "free":
        held = vertical if isinstance(vertical, str) else "baro"
        raise ValueError(
            f"{mechanization!r} leaves its height free; vertical {held!r} takes one of the frames "
            f"{', '.join(MECHANIZATIONS)}"
        )
    return reconstruction or own or body.DEFAULT, frame


def _removal(
    terms: Terms | None, without: str | None, mechanization: str
) -> tuple[Terms | None, str | None]:
    """Return the terms frame n keeps and the body stage's term that goes."""
    if terms is None and without is None:
        return None, None
    if mechanization != "n":
        raise ValueError(f"terms can be taken out in frame n alone, not in {mechanization!r}")
    if without is None:
        return terms, None
    if terms is not None:
        raise ValueError("give terms or without, not both")
    check_choice("without", without, TERMS)
    return (None, without) if without in BODY_TERMS else (terms_without(without), None)


def _split(block: ImuSamples, k: int, t: float, before: ImuSamples | None) -> ImuSamples:
    """Cut sample `k` at time `t`: increments in proportion, rates along a straight line.

    `before` is the sample before the block.
    """
    after = (block.t[k] - t) / block.dt[k]
    cut = block[k : k + 1]
    first, last = (cut.gyro, cut.accel), (cut.gyro, cut.accel)
    if cut.is_integrated:
        first, last = ((cut.gyro * share, cut.accel * share) for share in (1.0 - after, after))
    elif k or before is not None:
        earlier = block[k - 1 : k] if k else before
        assert earlier is not None
        first = tuple(
            (1.0 - after) * getattr(cut, name) + after * getattr(earlier, name)
            for name in ("gyro", "accel")
        )
    halves = [
        replace(cut, t=np.array([end]), dt=cut.dt * share, gyro=gyro, accel=accel)
        for end, share, (gyro, accel) in ((t, 1.0 - after, first), (block.t[k], after, last))
    ]
    return concatenate([block[:k], *halves, block[k + 1 :]])


def _from(blocks: Iterable[ImuSamples], t: float) -> Iterator[ImuSamples]:
    """Make `t` the end of a sample; raise if the blocks do not hold it."""
    started = False
    before: ImuSamples | None = None
    for block in blocks:
        if not started:
            begin = block.t[0] - block.dt[0]
            if before is None and t < begin - 1e-3 * block.dt[0]:
                raise StateTimeError(
                    f"state.t = {t:.9f} s is before the samples, whose first interval begins at "
                    f"{begin:.9f} s"
                )
            k = _first_after(block.t, t)
            started = k < len(block)
            if started and block.t[k] - block.dt[k] < t - _COINCIDE:
                block = _split(block, k, t, before)
        before = block[len(block) - 1 :]
        yield block
    if not started:
        last = "there are none" if before is None else f"the last is at {before.t[0]:.9f} s"
        raise StateTimeError(f"state.t = {t:.9f} s leaves no samples to integrate: {last}")


def _first_after(times: NDArray[np.float64], t: float) -> int:
    return int(np.searchsorted(times, t + _COINCIDE, side="right"))


def _after(blocks: Iterable[ImuSamples], t: float) -> Iterator[ImuSamples]:
    """Drop samples that end at `t` or before."""
    for block in blocks:
        first = _first_after(block.t, t)
        if first < len(block):
            yield block[first:]


def _ahead(items: Iterator[BodyIncrements]) -> Generator[BodyIncrements, None, None]:
    """Hand items on while a second thread makes the next two.

    Two, because a block comes as its seam with the last one, a few rows, and the rest.
    """
    with ThreadPoolExecutor(1) as worker:
        pending = deque(worker.submit(next, items, None) for _ in range(2))
        while (item := pending.popleft().result()) is not None:
            pending.append(worker.submit(next, items, None))
            yield item


def solve(
    blocks: Iterable[ImuSamples],
    state: NavState,
    *,
    reconstruction: str | None = None,
    mechanization: str = frames.DEFAULT,
    vertical: str | BaroLoop = "free",
    gravity: str | GravityFunction = earth_gravity.DEFAULT,
    disturbance: GravityFunction | DisturbanceGrid | None = None,
    bridge_gaps: bool = False,
    ellipsoid: Ellipsoid = WGS84,
    terms: Terms | None = None,
    without: str | None = None,
    gaps: list[Gap] | None = None,
    room: Columns | None = None,
) -> Iterator[Trajectory]:
    """Navigate through consecutive blocks of samples in bounded memory.

    The body stage of the next block runs on a second thread. Parameters are those of `navigate`,
    and

    Parameters
    ----------
    blocks : iterable of ImuSamples
        Consecutive; the solution does not depend, bit for bit, on where they end.
    gaps : list of Gap, optional
        Receives the gaps met.
    room : Columns, optional
        Rows are written there, one block after the other, as long as they fit.

    Yields
    ------
    Trajectory
        The rows of a block that lie after ``state.t``.
    """
    reconstruction, frame = choose(reconstruction, mechanization, vertical)
    terms, missing = _removal(terms, without, mechanization)
    world = World.around(
        state,
        vertical=vertical,
        gravity=gravity,
        disturbance=disturbance,
        ellipsoid=ellipsoid,
        terms=terms,
    )
    found = [] if gaps is None else gaps
    whole = without_gaps(blocks, bridge=bridge_gaps, gaps=found, since=state.t)
    epoch_ns: list[int] = []

    def noted(samples: Iterable[ImuSamples]) -> Iterator[ImuSamples]:
        for block in samples:
            if not epoch_ns:
                epoch_ns.append(block.epoch_ns)
            yield block

    mechanizer = None
    rows = 0
    as_taken = to_increments(noted(whole), keep_rates=takes_rates(reconstruction))
    samples = _from(as_taken, state.t)
    if isinstance(RECONSTRUCTIONS[reconstruction], BlockForm):
        samples = _after(samples, state.t)  # so that groups start there
    body_increments = reconstruct(samples, reconstruction, without=missing)
    # closed here whatever ends this: left to the garbage collector their threads would be joined
    # at any time from any thread
    with closing(body_increments), closing(_ahead(body_increments)) as coming:
        for increments in coming:
            first = _first_after(increments.t, state.t)
            if first == len(increments):
                continue
            increments = increments[first:]
            if mechanizer is None:
                mechanizer = frame.start(state, world, epoch_ns[0])
            start, rows = rows, rows + len(increments)
            fits = room is not None and rows <= len(room.lat)
            yield mechanizer.advance(
                increments, room.rows(start, rows) if room is not None and fits else None
            )


def navigate(
    imu: ImuSamples,
    state: NavState,
    *,
    reconstruction: str | None = None,
    mechanization: str = frames.DEFAULT,
    vertical: str | BaroLoop = "free",
    gravity: str | GravityFunction = earth_gravity.DEFAULT,
    disturbance: GravityFunction | DisturbanceGrid | None = None,
    bridge_gaps: bool = False,
    ellipsoid: Ellipsoid = WGS84,
    terms: Terms | None = None,
    without: str | None = None,
) -> Trajectory:
    """Integrate IMU samples over the Earth from a known state.

    Parameters
    ----------
    imu : ImuSamples
        Samples before ``state.t`` are context for the reconstruction and are not integrated; a
        sample that holds ``state.t`` inside its interval is split, increments in proportion, rates
        along a straight line where the reconstruction takes them as they are.
    state : NavState
        Where to start.
    reconstruction : str, optional
        A name of `navgrade.reconstruction.RECONSTRUCTIONS`: ``none``, ``causal-0`` to
        ``causal-4``, ``samples-2`` to ``samples-4``, ``centred-3`` to ``centred-15``, ``euler``,
        ``midpoint``, ``rk4``. By default the mechanization's own, else ``centred-9``.
    mechanization : str
        Frame: "n" (north-east-down), "e" (Earth-fixed), "i" (inertial) or "w" (wander azimuth).
        They agree; only n ends near the poles. Or a flat world for comparison, a name of
        `navgrade.mechanization.FLAT_WORLD`; see docs/flat-world.md.
    vertical : {"free", "hold"} or BaroLoop
    gravity : str or callable
        A name of `earth.GRAVITY_MODELS`, or a function as for `earth.gravity.gravity_field`.
    disturbance : DisturbanceGrid or callable, optional
        What the real field adds, see `earth.DisturbanceGrid`.
    bridge_gaps : bool
        Interpolate across gaps longer than three intervals instead of refusing them.
    ellipsoid : Ellipsoid
    terms : Terms, optional
        `navgrade.mechanization.Terms` of the Earth to keep, to see what one is worth; frame n.
    without : str, optional
        A name of `TERMS`, the one term to do without, of the Earth or of the body stage; frame n.

    Returns
    -------
    Trajectory
        One row per integrated sample; per N samples for ``samples-N``.

    Raises
    ------
    ValueError
        On an unknown choice, and on choices that contradict each other.
    TypeError
        On a gravity or disturbance function that cannot be compiled.
    StateTimeError
        When the samples do not hold ``state.t``; also a ValueError.
    GapError
        On a gap, unless `bridge_gaps`.
    NumericalError
        Beyond latitude ±89.9° in frame n, and off the disturbance grid.

    Notes
    -----
    Accuracy with exact increments, after 1 h, by motion, algorithm and frame: see
    docs/accuracy.md, which a command writes and tests guard.
    """
    room = Columns.empty(len(imu) + 1)
    pieces = solve(
        imu.blocks(BLOCK),
        state,
        reconstruction=reconstruction,
        mechanization=mechanization,
        vertical=vertical,
        gravity=gravity,
        disturbance=disturbance,
        bridge_gaps=bridge_gaps,
        ellipsoid=ellipsoid,
        terms=terms,
        without=without,
        room=room,
    )
    return concatenated(list(pieces), room)


def concatenated(pieces: list[Trajectory], room: Columns | None = None) -> Trajectory:
    """Put consecutive pieces together, which were written to `room` unless it was too small."""
    rows = sum(map(len, pieces))
    if room is not None and rows <= len(room.lat):
        columns = room.rows(0, rows)
    else:
        columns = Columns(
            *(np.concatenate([getattr(p, name) for p in pieces]) for name in Columns._fields)
        )
    return Trajectory.made(
        np.concatenate([piece.t for piece in pieces]),
        columns,
        np.concatenate([piece.status for piece in pieces]),
        pieces[0].epoch_ns,
    )
