"""What of a comparison is drawn: quantities, costs, rows, and how each variant looks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from earth.units import DEG
from navgrade.compare.result import Array, Axis, Comparison, Group, Variant

Rows = NDArray[np.intp]

REFERENCE_COLOR = "#9a9a9a"
IMU_COLOR = "#7a6a58"
CURVE_POINTS = 300
TRACK_POINTS = 600
DECADES = 11  # shown below the largest error
MINUTES = (0.001, 0.01, 0.1, 1.0, 10.0, 60.0, 600.0, 3600.0, 36_000.0)  # ticks of time, s


class Quantity(NamedTuple):
    """An error that grows.

    Attributes
    ----------
    key, label : str
    title : str
        Of its axis.
    unit : {"m", "m/s", "rad"}
    of : callable
        Its size in a variant, shape (n,).
    guides : tuple of (float, str)
        Lines to judge it by.
    """

    key: str
    label: str
    title: str
    unit: str
    of: Callable[[Variant], Array]
    guides: tuple[tuple[float, str], ...]


QUANTITIES = (
    Quantity(
        "position",
        "Horizontal position",
        "error of horizontal position",
        "m",
        lambda v: v.horizontal,
        ((1.0, "1 m"), (10.0, "10 m")),
    ),
    Quantity(
        "height",
        "Height",
        "error of height",
        "m",
        lambda v: np.abs(v.position_error[:, 2]),
        ((1.0, "1 m"), (10.0, "10 m")),
    ),
    Quantity(
        "velocity",
        "Horizontal velocity",
        "error of horizontal velocity",
        "m/s",
        lambda v: np.hypot(v.velocity_error[:, 0], v.velocity_error[:, 1]),
        ((0.1, "0.1 m/s"), (1.0, "1 m/s")),
    ),
    Quantity(
        "attitude",
        "Attitude",
        "error of attitude",
        "rad",
        lambda v: np.asarray(np.linalg.norm(v.attitude_error, axis=1)),
        ((0.1 * DEG, "0.1°"), (1.0 * DEG, "1°")),
    ),
)
POSITION = QUANTITIES[0]


@dataclass(frozen=True)
class Style:
    """How the lines of a variant look; `dash` is "solid", "dash" or "dot"."""

    color: str
    dash: str
    width: float


# after Okabe and Ito, and Tol: told apart by the colour-blind, visible on white and on black
_COLORS: dict[Group, tuple[str, ...]] = {
    "engine": ("#0072b2",),
    "flat": ("#d55e00", "#e69f00", "#cc3377", "#8a5a2b", "#b08cff"),
    "term": ("#009e73", "#cc79a7", "#56b4e9", "#a39a2e", "#8e63ce", "#c1440e"),
}
_LINES: dict[Group, tuple[tuple[str, float], ...]] = {
    "engine": (("solid", 3.0), ("dot", 3.0)),
    "flat": (("dash", 2.4), ("dot", 2.4)),
    "term": (("solid", 1.6), ("dot", 2.0)),
}


def styles(comparison: Comparison) -> dict[str, Style]:
    """The style of each variant, by its name: colours in turn, then the next line of the group."""
    seen = dict.fromkeys(_COLORS, 0)
    found = {}
    for variant in comparison.variants:
        colors, lines = _COLORS[variant.group], _LINES[variant.group]
        turn, color = divmod(seen[variant.group], len(colors))
        seen[variant.group] += 1
        found[variant.name] = Style(colors[color], *lines[turn % len(lines)])
    return found


def labels(comparison: Comparison) -> dict[str, str]:
    """What to call each variant, by its name.

    What all terms left out begin with, up to a comma, goes without saying.
    """
    found = {variant.name: variant.label for variant in comparison.variants}
    terms = [variant for variant in comparison.variants if variant.group == "term"]
    shared = {variant.label.rpartition(", ")[0] for variant in terms}
    if len(shared) == 1:
        for variant in terms:
            text = variant.label.rpartition(", ")[2]
            found[variant.name] = text[0].upper() + text[1:]
    return found


def last_row(variant: Variant) -> int:
    """The last row with a solution, -1 where there is none."""
    return int(np.flatnonzero(np.isfinite(variant.horizontal)).max(initial=-1))


def ended(comparison: Comparison, variant: Variant) -> float | None:
    """When a solution ended before the others, s; None where it did not."""
    row = last_row(variant)
    if row == len(comparison.t) - 1:
        return None
    return float(comparison.t[row]) if row >= 0 else 0.0


def is_reference(variant: Variant) -> bool:
    """Whether errors are relative to this solution."""
    return not np.nan_to_num(variant.position_error).any()


def quantities(comparison: Comparison) -> tuple[Quantity, ...]:
    """What to show: with truth, also the distance from the full engine, that of `costs`."""
    engine = comparison.variants[0]
    if is_reference(engine):
        return QUANTITIES

    def apart(variant: Variant) -> Array:
        delta = variant.position_error - engine.position_error
        return np.asarray(np.hypot(delta[:, 0], delta[:, 1]))

    label = "Distance from the full engine"
    cost = POSITION._replace(key="cost", label=label, title=label.lower(), of=apart)
    return (POSITION, cost, *QUANTITIES[1:])


def predicted_axis(comparison: Comparison, quantity: Quantity) -> Axis | None:
    """Which closed forms predict it: those of what a model costs, not of what the sensors do."""
    if is_reference(comparison.variants[0]):
        axes: dict[str, Axis] = {"position": "horizontal", "height": "vertical"}
        return axes.get(quantity.key)
    return "horizontal" if quantity.key == "cost" else None


def predicted(variant: Variant, axis: Axis) -> Array:
    """What the closed form gives at the epochs, m; NaN where it is of the other axis."""
    growth = variant.growth
    return growth.predicted if growth.axis == axis else np.full_like(growth.predicted, np.nan)


class Cost(NamedTuple):
    """What a variant's horizontal position costs at an epoch, m, and what was predicted."""

    variant: Variant
    value: float
    predicted: float


def costs(comparison: Comparison, epoch: int) -> list[Cost]:
    """Distance of each variant from the full engine at an epoch, the largest first.

    The full engine stands among them with its own error where it is not the reference. Variants
    that ended before come last, with NaN.
    """
    row = comparison.epoch_rows[epoch]
    engine = comparison.variants[0]
    found = []
    for variant in comparison.variants:
        apart = variant.position_error[row, :2]
        if variant is engine and is_reference(engine):
            continue
        if variant is not engine:
            apart = apart - engine.position_error[row, :2]
        form = predicted(variant, "horizontal")[epoch]
        found.append(Cost(variant, float(np.hypot(*apart)), float(form)))
    return sorted(found, key=lambda cost: (np.isnan(cost.value), -cost.value))


def rows_in_log_time(t: Array, count: int = CURVE_POINTS) -> Rows:
    """At most `count` rows after t = 0, even in log time, the first and last among them."""
    after = np.flatnonzero(t > 0.0)
    if len(after) <= count:
        return after
    wanted = np.geomspace(t[after[0]], t[-1], count)
    return after[np.unique(np.searchsorted(t[after], wanted))]


def rows_in_time(t: Array, count: int = TRACK_POINTS) -> Rows:
    """At most `count` rows evenly spread in time, the first and last among them."""
    if len(t) <= count:
        return np.arange(len(t))
    wanted = np.linspace(t[0], t[-1], count)
    return np.unique(np.searchsorted(t, wanted))


def log_limits(values: list[Array]) -> tuple[float, float]:
    """What a logarithmic axis shows: the largest value and at most eleven decades below it."""
    every = np.concatenate([v[np.isfinite(v) & (v > 0.0)] for v in values] or [np.empty(0)])
    if not len(every):
        return 1e-3, 1e1
    top = float(every.max())
    return max(float(every.min()), top * 10.0**-DECADES) / 2.0, top * 3.0


def map_limits(track: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """East and north, m, that hold a track with a margin, and 20 m at least."""
    low, high = np.nanmin(track[:, :2], axis=0), np.nanmax(track[:, :2], axis=0)
    half = max(0.56 * float((high - low).max()), 10.0)
    east, north = (low + high) / 2.0
    return (east - half, east + half), (north - half, north + half)
