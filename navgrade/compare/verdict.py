"""What a comparison means, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from navgrade.compare.result import Variant

Array = NDArray[np.float64]

SMALL = 1e-3  # m: no navigator asks for less


def length_text(metres: float) -> str:
    """A length as people say it: 18 m, 2.3 km, 5 mm, 30 µm."""
    if not np.isfinite(metres):
        return "—"
    sizes = (("km", 1e3), ("m", 1.0), ("mm", 1e-3), ("µm", 1e-6))
    size = next((size for size in sizes if abs(metres) >= size[1]), None)
    if size is None:
        return "< 1 µm"
    value = metres / size[1]
    return f"{value:,.0f} {size[0]}" if abs(value) >= 100.0 else f"{value:.2g} {size[0]}"


def time_text(seconds: float) -> str:
    """A time as people say it."""
    if seconds >= 120.0:
        minutes = seconds / 60.0
        return (
            f"{minutes:.0f} min" if abs(minutes - round(minutes)) < 0.05 else f"{minutes:.1f} min"
        )
    return f"{seconds:.0f} s" if seconds >= 9.5 else f"{seconds:.2g} s"


def crossing(t: Array, larger: Array, smaller: Array) -> float | None:
    """When `larger` is the larger for good; None if it never is."""
    known = np.isfinite(larger) & np.isfinite(smaller)
    t, ahead = t[known], (larger > smaller)[known]
    if not ahead.size or not ahead[-1]:
        return None
    behind = np.flatnonzero(~ahead)
    return float(t[behind[-1] + 1]) if behind.size else float(t[0])


def verdict(
    t: Array,
    epochs: Array,
    variants: Sequence[Variant],
    imu_error: Array | None,
    *,
    against_truth: bool,
) -> tuple[str, ...]:
    """Sentences on what was found.

    Parameters
    ----------
    t, epochs : ndarray
        s after the start.
    variants : sequence of Variant
        The full engine first.
    imu_error : ndarray, shape (n,), or None
        Horizontal error, 1-sigma, that the stated sensor errors cause, at `t`, m.
    against_truth : bool
        The full engine's own error is known.
    """
    engine = variants[0]
    by_name = {variant.name: variant for variant in variants}
    flat = [variant for variant in variants if variant.group == "flat"][-1]
    model = np.hypot(*(flat.position_error - engine.position_error)[:, :2].T)
    rows = np.searchsorted(t, epochs)
    end = rows[-1]
    said = [_flat_or_imu(t, model, engine, imu_error, against_truth=against_truth)]
    costs = ", ".join(
        f"{length_text(float(model[row]))} after {time_text(float(t[row]))}"
        for row in rows
        if t[row] >= 5.0 and np.isfinite(model[row])
    )
    if costs:
        said.append(
            f"Treating the Earth as flat, not turning and of constant gravity costs {costs}."
        )
    if against_truth:
        said.append(_engine(t, rows, engine))
    said.append(_integrators(by_name, end, t))
    said += _terms([v for v in variants if v.group == "term"], engine, end, t)
    return tuple(sentence for sentence in said if sentence)


def _engine(t: Array, rows: NDArray[np.intp], engine: Variant) -> str:
    largest = float(np.nanmax(engine.horizontal))
    if largest < SMALL:
        return (
            f"The full engine stays within {length_text(max(largest, 1e-6))} of the truth: the "
            "sensors and the starting state have no errors to speak of."
        )
    errors = ", ".join(
        f"{length_text(float(engine.horizontal[row]))} after {time_text(float(t[row]))}"
        for row in rows
        if t[row] >= 5.0 and np.isfinite(engine.horizontal[row])
    )
    return f"The full engine is off by {errors}: that is the sensors and the starting state."


def _flat_or_imu(
    t: Array, model: Array, engine: Variant, imu_error: Array | None, *, against_truth: bool
) -> str:
    if against_truth:
        own, whose = engine.horizontal, "the sensors and the starting state"
    elif imu_error is not None:
        own, whose = imu_error, "its stated errors"
    else:
        return (
            "Nothing says how good this IMU is: with [imu.errors] in the site file, or with a "
            "truth, this page would tell from when on the flat world is the larger error."
        )
    since = crossing(t, model, own)
    flat = "With this IMU the flat world is"
    if since is None:
        return f"{flat} never the larger error: {whose} cost more throughout."
    if since <= t[min(1, len(t) - 1)]:
        return f"{flat} the larger error throughout: {whose} cost less."
    return f"{flat} the larger error after {time_text(since)}; before that, {whose} are."


def _integrators(by_name: dict[str, Variant], end: int, t: Array) -> str:
    if "flat-rk4" not in by_name:
        return ""
    best = by_name["flat-rk4"].position_error[end]
    apart = {
        name: float(np.hypot(*(by_name[f"flat-{name}"].position_error[end] - best)[:2]))
        for name in ("euler", "midpoint")
    }
    if not all(np.isfinite(x) for x in apart.values()):
        return ""
    return (
        f"The choice of integrator in the flat world: after {time_text(float(t[end]))} Euler is "
        f"{length_text(apart['euler'])} and midpoint {length_text(apart['midpoint'])} away from "
        "Runge-Kutta 4; the rest of its error no integrator removes."
    )


def _terms(terms: Sequence[Variant], engine: Variant, end: int, t: Array) -> list[str]:
    cost = {
        v.label: float(np.hypot(*(v.position_error - engine.position_error)[end, :2]))
        for v in terms
    }
    known = {label: x for label, x in cost.items() if np.isfinite(x)}
    order = sorted(known, key=lambda label: -known[label])
    when = time_text(float(t[end]))
    large = [label for label in order if known[label] >= SMALL]
    small = [label for label in order if known[label] < SMALL]
    said = []
    if large:
        listed = ", ".join(f"{label} {length_text(known[label])}" for label in large[:3])
        said.append(f"Of the engine's terms the dearest to leave out, after {when}: {listed}.")
    if small:
        names = ", ".join(label.removeprefix("without ") for label in small)
        said.append(f"Worth less than 1 mm on this log: {names}.")
    return said
