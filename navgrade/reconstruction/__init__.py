"""From raw increments to body increments: coning, sculling and rotation compensation.

This stage knows nothing of the Earth. An algorithm is one file and one line of the registry.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from functools import partial
from itertools import chain

from navgrade.imu import BodyIncrements, ImuSamples
from navgrade.reconstruction import blocks as block_forms
from navgrade.reconstruction import causal, centred, compensated, uncompensated
from navgrade.reconstruction.increments import to_increments
from navgrade.reconstruction.stream import BlockForm, Reconstruction, by_block, by_sample

__all__ = [
    "CAUSAL",
    "DEFAULT",
    "RECONSTRUCTIONS",
    "BlockForm",
    "Reconstruction",
    "reconstruct",
    "to_increments",
]


def _causal(previous: int, order: int) -> Reconstruction:
    count = ("no", "one", "two", "three", "four")[previous]
    return Reconstruction(
        f"current and {count} previous sample{'s' * (previous != 1)}",
        order=order,
        coning_order=2 * previous + 2,
        loop=partial(causal.reconstruct, previous),
        back=previous,
    )


def _block(samples: int, summary: str) -> BlockForm:
    return BlockForm(
        summary,
        order=3,
        coning_order=2 * samples,
        loop=partial(block_forms.reconstruct, samples),
        samples=samples,
    )


def _centred(window: int, order: int, coning_order: int) -> Reconstruction:
    return Reconstruction(
        f"{window} samples around the current one",
        order=order,
        coning_order=coning_order,
        loop=partial(centred.reconstruct, window),
        back=window - 1,
        ahead=window - 1,
    )


RECONSTRUCTIONS: dict[str, Reconstruction | BlockForm] = {
    "none": Reconstruction(
        "increments as they are, no compensation",
        order=1,
        coning_order=2,
        loop=uncompensated.reconstruct,
    ),
    "causal-0": _causal(0, 2),
    "causal-1": _causal(1, 3),
    "causal-2": _causal(2, 3),
    "causal-3": _causal(3, 3),
    "causal-4": _causal(4, 3),
    "samples-2": _block(2, "two samples make one update"),
    "samples-3": _block(3, "three samples make one update"),
    "samples-4": _block(4, "four samples make one update; worse than two in manoeuvres"),
    "centred-3": _centred(3, 4, 4),
    "centred-5": _centred(5, 6, 6),
    "centred-7": _centred(7, 6, 8),
    "centred-9": _centred(9, 6, 10),
    "centred-11": _centred(11, 6, 12),
    "centred-13": _centred(13, 6, 14),
    "centred-15": _centred(15, 6, 16),
}
DEFAULT = "centred-9"
CAUSAL = "causal-3"  # what a program that cannot see the future would take


def reconstruct(
    blocks: Iterable[ImuSamples], algorithm: str
) -> Generator[BodyIncrements, None, None]:
    """Turn consecutive blocks of increments into body increments.

    Parameters
    ----------
    blocks : iterable of ImuSamples
        Of kind ``increment``, or ``compensated``, which passes untouched.
    algorithm : str
        A name of `RECONSTRUCTIONS`.

    Yields
    ------
    BodyIncrements
        One row per sample; per N samples for the block forms. The values do not depend on where
        the blocks end.
    """
    chosen = RECONSTRUCTIONS[algorithm]
    iterator = (block for block in blocks if len(block))
    first = next(iterator, None)
    if first is None:
        return
    stream = chain([first], iterator)
    if first.kind == "compensated":
        loop = partial(compensated.reconstruct, first.dv_frame == "end")
        yield from by_sample(stream, Reconstruction("as they are", 0, 0, loop, back=1))
    elif isinstance(chosen, BlockForm):
        yield from by_block(stream, chosen)
    else:
        yield from by_sample(stream, chosen)
