"""The plots of a comparison's page; the ``meta`` of a trace names its variant."""

from __future__ import annotations

import math
import textwrap

import numpy as np

from navgrade.compare.result import Array, Axis, Comparison, Variant
from navgrade.report.curves import (
    IMU_COLOR,
    REFERENCE_COLOR,
    Quantity,
    Style,
    costs,
    ended,
    labels,
    last_row,
    log_limits,
    map_limits,
    predicted,
    predicted_axis,
    quantities,
    rows_in_log_time,
    rows_in_time,
    styles,
)
from navgrade.report.plots import (
    ABOVE,
    MARGIN,
    Figure,
    as_text,
    log_axis,
    numbers,
    time_axis,
)
from navgrade.report.words import readable, readable_time

IMU = "imu"  # the variant that is none: the sensors' own errors
REFERENCE = "reference"
_WRAP = 25  # characters of a label beside a bar
_HARD = "\N{NO-BREAK SPACE}"
_OUTAGE = 60.0  # s: of GNSS, a common one


def track_figure(comparison: Comparison) -> Figure:
    """East and north of every solution, at one scale."""
    look, called = styles(comparison), labels(comparison)
    rows = rows_in_time(comparison.t)
    times = [readable_time(t) for t in comparison.t[rows]]
    reference = f"reference: {comparison.reference}"
    data = [
        _plan(comparison.track[rows], times, reference, REFERENCE)
        | {"line": {"color": REFERENCE_COLOR, "width": 7}, "opacity": 0.55}
    ]
    for variant in comparison.variants:
        style = look[variant.name]
        data.append(
            _plan(variant.track[rows], times, called[variant.name], variant.name)
            | {"line": _line(style)}
        )
        end = last_row(variant)
        if ended(comparison, variant) is not None and end >= 0:
            data.append(
                _end(
                    variant, style, variant.track[end, 0], variant.track[end, 1], comparison.t[end]
                )
            )
    seen = np.flatnonzero(np.isfinite(comparison.track[:, 0]))
    for row, name, symbol in ((seen[0], "start", "circle"), (seen[-1], "end", "square")):
        east, north = map(float, comparison.track[row, :2])
        data.append(
            {
                "type": "scatter",
                "mode": "markers+text",
                "x": [east],
                "y": [north],
                "text": [name],
                "textposition": "top center" if name == "start" else "bottom center",
                "textfont": {"size": 14, "weight": 700, "shadow": "auto"},
                "marker": {"symbol": symbol, "size": 10},
                "hoverinfo": "skip",
            }
        )
    easts, norths = map_limits(comparison.track)
    axis: Figure = {"tickformat": ",", "zeroline": False, "showline": True}
    x = axis | {"title": {"text": "east of the start, m"}}
    y = axis | {"title": {"text": "north of the start, m"}, "scaleanchor": "x", "scaleratio": 1}
    layout = {
        "margin": MARGIN,
        "hovermode": "closest",
        "xaxis": x | {"range": easts},
        "yaxis": y | {"range": norths},
    }
    whole = {"xaxis": x | {"autorange": True}, "yaxis": y | {"autorange": True}}
    views = [{"name": "The drive"}, {"name": "All solutions", "layout": whole}]
    return {"data": data, "layout": layout, "views": views, "first": 0}


def growth_figure(comparison: Comparison) -> Figure:
    """Errors over time, both logarithmic; a view for each quantity."""
    views = [_growth_view(comparison, quantity) for quantity in quantities(comparison)]
    return {
        "data": [],
        "layout": {"margin": MARGIN, "hovermode": "closest"},
        "views": views,
        "first": 0,
    }


def cost_figure(comparison: Comparison) -> Figure:
    """What each variant costs, sorted; a view for each epoch."""
    layout = {
        "margin": {"l": 12, "r": 20, "t": 40, "b": 48},
        "hovermode": "closest",
        "bargap": 0.35,
    }
    views = [_cost_view(comparison, epoch) for epoch in range(len(comparison.epochs))]
    first = int(np.argmin(np.abs(np.log(comparison.epochs / _OUTAGE))))
    return {"data": [], "layout": layout, "views": views, "first": first}


def _plan(track: Array, times: list[str], label: str, name: str) -> Figure:
    return {
        "type": "scatter",
        "mode": "lines",
        "x": numbers(track[:, 0], 8),
        "y": numbers(track[:, 1], 8),
        "text": times,
        "hovertemplate": f"<b>{as_text(label)}</b><br>%{{text}}<br>east %{{x:,.3r}} m, "
        "north %{y:,.3r} m<extra></extra>",
        "meta": name,
    }


def _growth_view(comparison: Comparison, quantity: Quantity) -> Figure:
    look, called = styles(comparison), labels(comparison)
    t, unit = comparison.t, quantity.unit
    rows = rows_in_log_time(t)
    data: list[Figure] = []
    shown = []
    for variant in comparison.variants:
        error = quantity.of(variant)
        shown.append(error[rows])
        data.append(
            _curve(t[rows], error[rows], unit, called[variant.name], variant.name)
            | {"mode": "lines", "line": _line(look[variant.name])}
        )
        end = last_row(variant)
        if ended(comparison, variant) is not None and end > 0 and error[end] > 0.0:
            data.append(_end(variant, look[variant.name], t[end], error[end], t[end]))
    axis = predicted_axis(comparison, quantity)
    if axis is not None:
        data += _predictions(comparison, axis)
    if quantity.key in ("position", "cost") and comparison.imu_error is not None:
        label = "this IMU's own errors, 1σ"
        line = {"color": IMU_COLOR, "width": 2, "dash": "dashdot"}
        marker = {"symbol": "diamond", "size": 8, "color": IMU_COLOR}
        shown.append(comparison.imu_error)
        data.append(
            _curve(comparison.epochs, comparison.imu_error, unit, label, IMU)
            | {"mode": "lines+markers", "line": line, "marker": marker}
        )
    low, high = log_limits(shown)
    guides = [guide for guide in quantity.guides if low < guide[0] < high]
    across = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "layer": "below"}
    left = {"xref": "paper", "x": 0, "xanchor": "left"}
    return {
        "name": quantity.label,
        "data": data,
        "layout": {
            "xaxis": time_axis(t[rows]),
            "yaxis": log_axis(unit, low, high) | {"title": {"text": quantity.title}},
            "shapes": [across | {"y0": y, "y1": y} for y, _ in guides],
            "annotations": [
                {"y": math.log10(y), "text": text} | left | ABOVE for y, text in guides
            ],
        },
    }


def _predictions(comparison: Comparison, axis: Axis) -> list[Figure]:
    look, called = styles(comparison), labels(comparison)
    found = []
    for variant in comparison.variants:
        forms = predicted(variant, axis)
        if not np.isfinite(forms).any():
            continue
        label = f"{called[variant.name]}, predicted by {variant.growth.formula}"
        marker = {
            "symbol": "circle-open",
            "size": 10,
            "color": look[variant.name].color,
            "line": {"width": 2},
        }
        found.append(
            _curve(comparison.epochs, forms, "m", label, variant.name)
            | {"mode": "markers", "marker": marker, "cliponaxis": False}
        )
    return found


def _cost_view(comparison: Comparison, epoch: int) -> Figure:
    look, called = styles(comparison), labels(comparison)
    found = costs(comparison, epoch)
    values = [cost.value for cost in found]
    forms = [cost.predicted for cost in found]
    sigma = math.nan if comparison.imu_error is None else float(comparison.imu_error[epoch])
    low, high = log_limits([np.array([*values, sigma])])
    ticks = []
    for cost in found:
        label, value = called[cost.variant.name], readable(cost.value, "m")
        if cost.variant is comparison.variants[0]:
            label = f"{label}: its own error"
        end = ended(comparison, cost.variant)
        if math.isnan(cost.value) and end is not None:
            value = f"ended at {readable_time(end)}"
        value = value.replace(" ", _HARD)
        *lines, last = textwrap.wrap(f"{label} {value}", _WRAP, break_long_words=False)
        last = f"{as_text(last.removesuffix(value))}<b>{value}</b>"
        ticks.append("<br>".join([*map(as_text, lines), last]))
    places = list(range(len(found)))
    bars = {
        "type": "bar",
        "orientation": "h",
        "y": places,
        "x": numbers([value if value > low else math.nan for value in values]),
        "text": ticks,
        "textposition": "none",
        "hovertemplate": "%{text}<extra></extra>",
        "marker": {
            "color": [look[cost.variant.name].color for cost in found],
            "pattern": {"shape": ["/" if cost.variant.group == "flat" else "" for cost in found]},
        },
    }
    circles = {
        "type": "scatter",
        "mode": "markers",
        "y": places,
        "x": numbers([value if value > low else math.nan for value in forms]),
        "text": [readable(value, "m") for value in forms],
        "hovertemplate": "predicted: %{text}<extra></extra>",
        "marker": {"symbol": "circle-open", "size": 10, "line": {"width": 2}},
    }
    layout: Figure = {
        "xaxis": log_axis("m", low, high) | {"title": {"text": "distance from the full engine"}},
        "yaxis": {
            "showgrid": False,
            "zeroline": False,
            "fixedrange": True,
            "range": [len(found) - 0.5, -0.5],
            "tickvals": places,
            "ticktext": ticks,
        },
    }
    if sigma > 0.0:
        edge = {"yref": "paper", "y0": 0, "y1": 1}
        line = {"color": IMU_COLOR, "width": 2, "dash": "dashdot"}
        text = f"this IMU's own errors: {readable(sigma, 'm')}"
        layout["shapes"] = [{"type": "line", "x0": sigma, "x1": sigma, "line": line} | edge]
        side = "left" if sigma < math.sqrt(low * high) else "right"
        note = {"x": math.log10(sigma), "xanchor": side, "y": 1, "yref": "paper", "text": text}
        layout["annotations"] = [note | ABOVE]
    return {
        "name": readable_time(comparison.epochs[epoch]),
        "data": [bars, circles],
        "layout": layout,
    }


def _curve(t: Array, error: Array, unit: str, label: str, name: str) -> Figure:
    positive = np.where(error > 0.0, error, np.nan)
    return {
        "type": "scatter",
        "x": numbers(t),
        "y": numbers(positive),
        "text": [readable(y, unit) for y in positive],
        "hovertemplate": f"<b>{as_text(label)}</b><br>%{{text}} after %{{x:.3~r}} s<extra></extra>",
        "meta": name,
    }


def _end(variant: Variant, style: Style, x: float, y: float, t: float) -> Figure:
    """A cross where a solution ended before the others."""
    return {
        "type": "scatter",
        "mode": "markers",
        "x": [float(x)],
        "y": [float(y)],
        "marker": {"symbol": "x", "size": 11, "color": style.color},
        "hovertemplate": f"{as_text(variant.label)}<br>ended at {readable_time(t)}<extra></extra>",
        "meta": variant.name,
    }


def _line(style: Style) -> Figure:
    return {"color": style.color, "dash": style.dash, "width": style.width}
