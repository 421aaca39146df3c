"""From raw increments to body increments: coning, sculling and rotation compensation.

This stage knows nothing of the Earth. An algorithm is one file and one line of the registry.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from navgrade.imu import BodyIncrements, ImuSamples, Status, concatenate
from navgrade.reconstruction import causal, uncompensated
from navgrade.reconstruction.increments import to_increments

Array = NDArray[np.float64]

__all__ = ["DEFAULT", "RECONSTRUCTIONS", "Reconstruction", "reconstruct", "to_increments"]


@dataclass(frozen=True)
class Reconstruction:
    """One algorithm of the registry.

    Attributes
    ----------
    summary : str
    previous : int
        Samples it looks back.
    order : int
        Global order of the velocity error in the interval, for smooth motion.
    coning_order : int
        Power of (coning frequency times interval) its pure-coning drift falls with.
    loop : callable
        ``loop(dt, dtheta, dvel, first, phi, dv)`` fills `phi`, `dv` for rows from `first` on.
    """

    summary: str
    previous: int
    order: int
    coning_order: int
    loop: Callable[[Array, Array, Array, int, Array, Array], None]


RECONSTRUCTIONS: dict[str, Reconstruction] = {
    "none": Reconstruction(
        "increments as they are, no compensation", 0, 1, 2, uncompensated.reconstruct
    ),
    "causal-1": Reconstruction(
        "current and previous sample", 1, 3, 4, partial(causal.reconstruct, 1)
    ),
    "causal-3": Reconstruction(
        "current and three previous samples", 3, 3, 8, partial(causal.reconstruct, 3)
    ),
}
DEFAULT = "causal-3"


def reconstruct(blocks: Iterable[ImuSamples], algorithm: str) -> Iterator[BodyIncrements]:
    """Turn consecutive blocks of increments into body increments, one row per sample.

    Parameters
    ----------
    blocks : iterable of ImuSamples
        Of kind ``increment``, or ``compensated``, which passes untouched.
    algorithm : str
        A name of `RECONSTRUCTIONS`.

    Yields
    ------
    BodyIncrements
        The values do not depend on where the blocks end.
    """
    chosen = RECONSTRUCTIONS[algorithm]
    context: ImuSamples | None = None
    for block in blocks:
        if block.kind == "compensated":
            yield BodyIncrements(block.t, block.dt, block.gyro, block.accel, block.status)
            continue
        n, known = len(block), 0 if context is None else len(context)
        phi, dv = np.empty((n, 3)), np.empty((n, 3))
        head = min(chosen.previous, n) if known else 0
        if context is not None and head:
            seam = concatenate([context, block[:head]])
            chosen.loop(seam.dt, seam.gyro, seam.accel, known, phi[:head], dv[:head])
        chosen.loop(block.dt, block.gyro, block.accel, head, phi[head:], dv[head:])
        status = block.status
        short = max(chosen.previous - known, 0)
        if short:
            status = status.copy()
            status[:short] |= np.uint32(Status.SHORT_WINDOW)
        yield BodyIncrements(block.t, block.dt, phi, dv, status)
        if context is not None and n < chosen.previous:
            block = concatenate([context, block])
        context = block[max(len(block) - chosen.previous, 0) :]
