"""From raw increments to body increments: coning, sculling and rotation compensation.

This stage knows nothing of the Earth. An algorithm is one file and one line of the registry.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable
from functools import partial
from itertools import chain

from navgrade.imu import BodyIncrements, ImuSamples
from navgrade.reconstruction import blocks as block_forms
from navgrade.reconstruction import causal, centred, classical, compensated, uncompensated
from navgrade.reconstruction.increments import to_increments
from navgrade.reconstruction.stream import BlockForm, Reconstruction, by_block, by_sample
from navgrade.reconstruction.terms import BODY_TERMS, without_body_term

__all__ = [
    "BODY_TERMS",
    "CAUSAL",
    "DEFAULT",
    "RECONSTRUCTIONS",
    "BlockForm",
    "Reconstruction",
    "check_input",
    "reconstruct",
    "takes_rates",
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


def _classical(method: int, order: int, coning_order: int, summary: str) -> Reconstruction:
    entry = partial(Reconstruction, summary, order, coning_order)
    reach = classical.AROUND - 1
    rk4 = method == classical.RK4
    return entry(
        loop=partial(classical.from_increments, method),
        back=reach,
        ahead=reach,
        of_rates=entry(
            loop=partial(classical.from_rates, method), back=3 if rk4 else 1, ahead=2 if rk4 else 0
        ),
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
    "euler": _classical(classical.EULER, 1, 2, "rates at the start stand for the interval"),
    "midpoint": _classical(classical.MIDPOINT, 2, 2, "means of the rates at both ends"),
    "rk4": _classical(classical.RK4, 4, 4, "classical Runge-Kutta, rates at ends and middle"),
}
DEFAULT = "centred-9"
CAUSAL = "causal-3"  # what a program that cannot see the future would take


def takes_rates(algorithm: str) -> bool:
    """Return whether an algorithm is of rates at points, and gets ``rate`` samples as they are."""
    chosen = RECONSTRUCTIONS[algorithm]
    return isinstance(chosen, Reconstruction) and chosen.of_rates is not None


def has_body_terms(algorithm: str) -> bool:
    """Return whether an algorithm makes the corrections of `BODY_TERMS`, one by one."""
    return algorithm != "none" and not takes_rates(algorithm)


def check_input(algorithm: str, kind: str, without: str | None = None) -> None:
    """Raise ValueError where an algorithm cannot take a kind of samples, or miss a body term."""
    if kind == "compensated" and takes_rates(algorithm):
        raise ValueError(
            f"reconstruction {algorithm!r} needs the rates themselves, and compensated increments "
            "no longer hold them; take another reconstruction"
        )
    if without is None:
        return
    if kind == "compensated":
        raise ValueError(f"{without} cannot be taken out of increments the sensor has compensated")
    if not has_body_terms(algorithm):
        raise ValueError(
            f"reconstruction {algorithm!r} has no {without} term to take out; take one of causal, "
            "samples, centred"
        )


def reconstruct(
    blocks: Iterable[ImuSamples], algorithm: str, *, without: str | None = None
) -> Generator[BodyIncrements, None, None]:
    """Turn consecutive blocks of increments into body increments.

    Parameters
    ----------
    blocks : iterable of ImuSamples
        Of kind ``increment``; ``compensated``, which passes untouched; or ``rate`` for an
        algorithm that takes rates.
    algorithm : str
        A name of `RECONSTRUCTIONS`.
    without : str, optional
        A name of `BODY_TERMS`, which is taken out: to see what it is worth.

    Yields
    ------
    BodyIncrements
        One row per sample; per N samples for the block forms. The values do not depend on where
        the blocks end.

    Raises
    ------
    ValueError
        As `check_input`.
    """
    chosen = RECONSTRUCTIONS[algorithm]
    iterator = (block for block in blocks if len(block))
    first = next(iterator, None)
    if first is None:
        return
    stream = chain([first], iterator)
    check_input(algorithm, first.kind, without)
    if without is not None:
        chosen = without_body_term(chosen, without)
    if first.kind == "compensated":
        loop = partial(compensated.reconstruct, first.dv_frame == "end")
        yield from by_sample(stream, Reconstruction("as they are", 0, 0, loop, back=1))
    elif isinstance(chosen, BlockForm):
        yield from by_block(stream, chosen)
    elif chosen.of_rates is not None and first.kind == "rate":
        yield from by_sample(stream, chosen.of_rates)
    else:
        yield from by_sample(stream, chosen)
