"""The whole way from samples to a solution, block by block."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from earth.ellipsoid import WGS84, Ellipsoid
from navgrade import mechanization as frames
from navgrade import reconstruction as body
from navgrade.errors import StateTimeError
from navgrade.gaps import Gap, without_gaps
from navgrade.imu import BodyIncrements, ImuSamples, concatenate
from navgrade.mechanization import MECHANIZATIONS, VERTICAL
from navgrade.reconstruction import RECONSTRUCTIONS, reconstruct, to_increments
from navgrade.state import NavState, Trajectory

_COINCIDE = 1e-9  # s: a state this close to a sample's end needs no split


def check_choice(name: str, value: str, allowed: Iterable[str]) -> None:
    """Raise ValueError, naming the nearest, unless `value` is one of `allowed`."""
    choices = list(allowed)
    if value not in choices:
        near = difflib.get_close_matches(value, choices, n=1, cutoff=0.4)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise ValueError(f"{name} {value!r} is not one of {', '.join(choices)}{hint}")


def _split(block: ImuSamples, k: int, t: float) -> ImuSamples:
    """Cut sample `k` at time `t`, its increments in proportion."""
    after = (block.t[k] - t) / block.dt[k]
    cut = block[k : k + 1]
    halves = [
        replace(
            cut,
            t=np.array([end]),
            dt=cut.dt * share,
            gyro=cut.gyro * share,
            accel=cut.accel * share,
        )
        for end, share in ((t, 1.0 - after), (block.t[k], after))
    ]
    return concatenate([block[:k], *halves, block[k + 1 :]])


def _from(blocks: Iterable[ImuSamples], t: float) -> Iterator[ImuSamples]:
    """Make `t` the end of a sample; raise if the blocks do not hold it."""
    started = False
    end = None
    for block in blocks:
        if not started:
            begin = block.t[0] - block.dt[0]
            if end is None and t < begin - 1e-3 * block.dt[0]:
                raise StateTimeError(
                    f"state.t = {t:.9f} s is before the samples, whose first interval begins at "
                    f"{begin:.9f} s"
                )
            k = int(np.searchsorted(block.t, t + _COINCIDE, side="right"))
            started = k < len(block)
            if started and block.t[k] - block.dt[k] < t - _COINCIDE:
                block = _split(block, k, t)
        end = block.t[-1]
        yield block
    if not started:
        last = "there are none" if end is None else f"the last is at {end:.9f} s"
        raise StateTimeError(f"state.t = {t:.9f} s leaves no samples to integrate: {last}")


def solve(
    blocks: Iterable[ImuSamples],
    state: NavState,
    *,
    reconstruction: str = body.DEFAULT,
    mechanization: str = frames.DEFAULT,
    vertical: str = "free",
    bridge_gaps: bool = False,
    ellipsoid: Ellipsoid = WGS84,
    gaps: list[Gap] | None = None,
) -> Iterator[Trajectory]:
    """Navigate through consecutive blocks of samples in bounded memory.

    Parameters are those of `navigate`, and

    Parameters
    ----------
    blocks : iterable of ImuSamples
        Consecutive; the solution does not depend, bit for bit, on where they end.
    gaps : list of Gap, optional
        Receives the gaps met.

    Yields
    ------
    Trajectory
        The rows of a block that lie after ``state.t``.
    """
    check_choice("reconstruction", reconstruction, RECONSTRUCTIONS)
    check_choice("mechanization", mechanization, MECHANIZATIONS)
    check_choice("vertical", vertical, VERTICAL)
    whole = without_gaps(blocks, bridge=bridge_gaps, gaps=[] if gaps is None else gaps)
    epoch_ns: list[int] = []

    def noted(samples: Iterable[ImuSamples]) -> Iterator[ImuSamples]:
        for block in samples:
            if not epoch_ns:
                epoch_ns.append(block.epoch_ns)
            yield block

    mechanizer = None
    for increments in reconstruct(_from(to_increments(noted(whole)), state.t), reconstruction):
        first = int(np.searchsorted(increments.t, state.t + _COINCIDE, side="right"))
        if first == len(increments):
            continue
        if first:
            increments = BodyIncrements(
                increments.t[first:],
                increments.dt[first:],
                increments.phi[first:],
                increments.dv[first:],
                increments.status[first:],
            )
        if mechanizer is None:
            mechanizer = MECHANIZATIONS[mechanization].start(
                state, vertical=vertical, ellipsoid=ellipsoid, epoch_ns=epoch_ns[0]
            )
        yield mechanizer.advance(increments)


def navigate(
    imu: ImuSamples,
    state: NavState,
    *,
    reconstruction: str = body.DEFAULT,
    mechanization: str = frames.DEFAULT,
    vertical: str = "free",
    bridge_gaps: bool = False,
    ellipsoid: Ellipsoid = WGS84,
) -> Trajectory:
    """Integrate IMU samples over the Earth from a known state.

    Parameters
    ----------
    imu : ImuSamples
        Samples before ``state.t`` are context for the reconstruction and are not integrated; a
        sample that holds ``state.t`` inside its interval is split in proportion.
    state : NavState
        Where to start.
    reconstruction : str
        ``none``, ``causal-1`` or ``causal-3``.
    mechanization : str
        Frame: ``n``.
    vertical : {"free", "hold"}
    bridge_gaps : bool
        Interpolate across gaps longer than three intervals instead of refusing them.
    ellipsoid : Ellipsoid

    Returns
    -------
    Trajectory
        One row per integrated sample.

    Raises
    ------
    ValueError
        On an unknown choice.
    StateTimeError
        When the samples do not hold ``state.t``; also a ValueError.
    GapError
        On a gap, unless `bridge_gaps`.
    NumericalError
        Beyond latitude ±89.9° in frame n.

    Notes
    -----
    Accuracy with exact increments at 200 Hz, ``causal-3``, after 1 h at 100 m/s in permanent
    turns: see docs/accuracy.md, which a command writes and tests guard.
    """
    pieces = solve(
        [imu],
        state,
        reconstruction=reconstruction,
        mechanization=mechanization,
        vertical=vertical,
        bridge_gaps=bridge_gaps,
        ellipsoid=ellipsoid,
    )
    return join(list(pieces))


def join(pieces: list[Trajectory]) -> Trajectory:
    """Put the consecutive pieces of a trajectory together."""
    if len(pieces) == 1:
        return pieces[0]
    return Trajectory(
        t=np.concatenate([piece.t for piece in pieces]),
        lat=np.concatenate([piece.lat for piece in pieces]),
        lon=np.concatenate([piece.lon for piece in pieces]),
        h=np.concatenate([piece.h for piece in pieces]),
        v_eb_n=np.concatenate([piece.v_eb_n for piece in pieces]),
        q_nb=np.concatenate([piece.q_nb for piece in pieces]),
        status=np.concatenate([piece.status for piece in pieces]),
        epoch_ns=pieces[0].epoch_ns,
    )
