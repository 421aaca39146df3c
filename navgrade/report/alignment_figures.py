"""The plots of an alignment's page; the ``meta`` of a trace names what it is of."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from earth.units import ARCSEC, DEG
from navgrade.report.curves import Style, log_limits
from navgrade.report.plots import ABOVE, MARGIN, Figure, as_text, numbers
from navgrade.report.plots import time_axis as log_time_axis
from navgrade.report.words import readable_angle, readable_time

if TYPE_CHECKING:
    from align import Alignment
    from align.result import Convergence, Innovations
    from navgrade.alignment import AlignedWindow, Trace

Array = NDArray[np.float64]

TILT, AZIMUTH = "#0072b2", "#d55e00"
CURVES = {
    "north": ("off about north", Style(TILT, "solid", 2.2)),
    "east": ("off about east", Style("#56b4e9", "solid", 2.2)),
    "down": ("off about down", Style(AZIMUTH, "solid", 2.2)),
    "tilt": ("tilt, theory 1σ", Style(TILT, "dash", 2.0)),
    "azimuth": ("azimuth, theory 1σ", Style(AZIMUTH, "dash", 2.0)),
}
SHADES = {
    "used": "rgba(0,158,115,0.34)",
    "still": "rgba(0,114,178,0.20)",
    "swaying": "rgba(230,159,0,0.24)",
    "cut out": "rgba(213,94,0,0.55)",
}
TRACE_COLOR = "#7d8590"
_ANGLES = tuple(
    (size, readable_angle(size, 1))
    for size in (
        *(ARCSEC * 10.0**power for power in range(-4, 1)),
        *(DEG * 10.0**power for power in range(-2, 3)),
    )
)
_DECADES = 4  # of bars, below the longest
_WRAP = 14  # characters of a label beside a bar
_POINTS = 1500  # of a trace
_NAMED = 0.04  # of the log: shorter stretches have no room for their number
_STEPS = (1, 2, 5, 10, 20, 30, 60, 120, 180, 300, 600, 1200, 1800, 3600, 7200, 14_400, 43_200)
_TICKS = 6


def budget_figure(r: Alignment) -> Figure | None:
    """What each sensor error contributes, and the total; None where nothing does."""
    sources = [
        *((line.source, line.tilt, line.azimuth) for line in r.budget),
        ("total", r.tilt_sigma, r.azimuth_sigma),
    ]
    values = np.array([source[1:] for source in sources])
    shown = values[np.isfinite(values) & (values > 0.0)]
    if not len(shown) or not r.budget:
        return None
    top = float(shown.max())
    low = max(float(shown.min()), top * 10.0**-_DECADES) / 3.0
    data: list[Figure] = []
    for column, (name, color) in enumerate((("tilt", TILT), ("azimuth", AZIMUTH))):
        sizes = values[:, column]
        texts = [readable_angle(x) for x in sizes]
        data.append(
            {
                "type": "bar",
                "orientation": "h",
                "y": list(range(len(sources))),
                "x": numbers(np.where(sizes > low, sizes, np.nan)),
                "text": [text if x > low else "" for text, x in zip(texts, sizes, strict=True)],
                "textposition": "outside",
                "cliponaxis": False,
                "customdata": texts,
                "hovertemplate": f"{name}: %{{customdata}}<extra></extra>",
                "marker": {"color": color},
                "meta": name,
            }
        )
    labels = ["<br>".join(map(as_text, wrap(source[0], _WRAP))) for source in sources]
    labels[-1] = f"<b>{labels[-1]}</b>"
    axis = _angle_axis(low, top * (top / low) ** 0.3)  # room for the numbers beside the bars
    layout: Figure = {
        "margin": {"l": 12, "r": 20, "t": 12, "b": 48},
        "hovermode": "closest",
        "bargap": 0.3,
        "xaxis": axis | {"title": {"text": "1σ"}, "fixedrange": True},
        "yaxis": {
            "showgrid": False,
            "zeroline": False,
            "fixedrange": True,
            "range": [len(sources) - 0.5, -0.5],
            "tickvals": list(range(len(sources))),
            "ticktext": labels,
        },
    }
    return _figure(data, layout)


def convergence_figure(c: Convergence | None) -> Figure | None:
    """Distance from the final attitude against averaging time; None where there are no times."""
    if c is None:
        return None
    rows = np.flatnonzero(np.isfinite(c.t) & (c.t > 0.0))
    if len(rows) < 2:
        return None
    off = np.abs(c.off)
    off[c.t == c.t[-1]] = np.nan  # from itself, nothing but rounding
    sizes = {
        "north": off[:, 0],
        "east": off[:, 1],
        "down": off[:, 2],
        "tilt": c.tilt_sigma,
        "azimuth": c.azimuth_sigma,
    }
    data: list[Figure] = []
    for name, (label, style) in CURVES.items():
        y = sizes[name][rows]
        y = np.where(y > 0.0, y, np.nan)
        if not np.isfinite(y).any():
            continue
        data.append(
            {
                "type": "scatter",
                "mode": "lines",
                "x": numbers(c.t[rows]),
                "y": numbers(y),
                "text": [readable_angle(x) for x in y],
                "hovertemplate": f"<b>{label}</b><br>%{{text}} after %{{x:.3~r}} s<extra></extra>",
                "line": {"color": style.color, "dash": style.dash, "width": style.width},
                "meta": name,
            }
        )
    low, high = log_limits([sizes[trace["meta"]][rows] for trace in data])
    layout = {
        "margin": MARGIN,
        "hovermode": "closest",
        "xaxis": log_time_axis(c.t[rows], "averaging time"),
        "yaxis": _angle_axis(low, high) | {"title": {"text": "small rotation"}},
    }
    return _figure(data, layout)


def timeline_figure(aligned: AlignedWindow) -> Figure | None:
    """Rate and specific force over the log, the still stretches shaded; None without two spans."""
    trace = aligned.trace
    if len(trace.t) < 2:
        return None
    first, last = float(trace.t[0]), float(trace.t[-1])
    data = [
        _trace(trace, trace.rate / DEG, "y", "rate", "°/s"),
        _trace(trace, trace.force, "y2", "force", "m/s²"),
    ]
    shapes, notes = [], []
    for start, stop, kind in _shades(aligned):
        shapes.append(
            {
                "type": "rect",
                "layer": "below",
                "yref": "paper",
                "x0": start,
                "x1": stop,
                "y0": 0,
                "y1": 1,
                "fillcolor": SHADES[kind],
                "line": {"width": 0},
                "name": kind,
            }
        )
    for number, stretch in enumerate(aligned.still.stretches, 1):
        if stretch.stop - stretch.start > _NAMED * (last - first):
            middle = 0.5 * (stretch.start + stretch.stop)
            notes.append({"x": middle, "y": 1, "yref": "paper", "text": f"{number}"} | ABOVE)
    step = next((s for s in _STEPS if last / s <= _TICKS), _STEPS[-1])
    ticks = [step * k for k in range(int(last // step) + 1)]
    y: Figure = {"type": "log", "dtick": 1, "tickformat": "~r", "exponentformat": "none"}
    layout = {
        "margin": MARGIN | {"t": 28},
        "hovermode": "closest",
        "xaxis": {
            "title": {"text": "time since the first sample"},
            "range": [min(0.0, first), last],
            "tickvals": ticks,
            "ticktext": [readable_time(t) for t in ticks],
            "anchor": "y2",
            "zeroline": False,
        },
        "yaxis": y | {"title": {"text": "rate, °/s"}, "domain": [0.53, 1.0]},
        "yaxis2": y | {"title": {"text": "force, m/s²"}, "domain": [0.0, 0.47], "anchor": "x"},
        "shapes": shapes,
        "annotations": notes,
    }
    return _figure(data, layout)


def innovations_figure(found: Innovations | None) -> Figure | None:
    """Normalised innovations over time, the bounds of their mean shaded; None without any."""
    if found is None or not len(found.t):
        return None
    rows = _envelope(np.nan_to_num(found.nis), _POINTS)
    data = [
        {
            "type": "scatter",
            "mode": "markers",
            "x": numbers(found.t[rows], 7),
            "y": numbers(found.nis[rows]),
            "marker": {"color": TRACE_COLOR, "size": 4},
            "hovertemplate": "%{y:.3r} at %{x:.5~r} s<extra></extra>",
            "meta": "nis",
        }
    ]
    band = {"type": "rect", "xref": "paper", "x0": 0, "x1": 1, "y0": found.low, "y1": found.high}
    mean = float(np.nanmean(found.nis))
    line = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": mean, "y1": mean}
    layout = {
        "margin": MARGIN,
        "hovermode": "closest",
        "xaxis": {"title": {"text": "time, s"}, "zeroline": False},
        "yaxis": {"title": {"text": "normalised innovation squared"}, "rangemode": "tozero"},
        "shapes": [
            band | {"fillcolor": SHADES["used"], "line": {"width": 0}, "name": "bounds"},
            line | {"line": {"color": AZIMUTH, "width": 2}, "name": "mean"},
        ],
    }
    return _figure(data, layout)


def _figure(data: list[Figure], layout: Figure) -> Figure:
    return {"data": data, "layout": layout, "views": [{"name": "all"}], "first": 0}


def _angle_axis(low: float, high: float) -> Figure:
    ticks = [angle for angle in _ANGLES if low <= angle[0] <= high]
    return {
        "type": "log",
        "range": [float(np.log10(low)), float(np.log10(high))],
        "tickvals": [size for size, _ in ticks],
        "ticktext": [text for _, text in ticks],
    }


def _shades(aligned: AlignedWindow) -> Iterator[tuple[float, float, str]]:
    """Parts of the log, s, and what each of them is."""
    for index, stretch in enumerate(aligned.still.stretches):
        kind = "used" if index == aligned.chosen else stretch.motion
        for start, stop in stretch.pieces:
            yield float(start), float(stop), kind
        edges = [stretch.start, *(edge for piece in stretch.pieces for edge in piece), stretch.stop]
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            if stop > start:
                yield float(start), float(stop), "cut out"
    if aligned.chosen is None:
        yield aligned.start, aligned.start + aligned.duration, "used"


def _trace(trace: Trace, values: Array, axis: str, name: str, unit: str) -> Figure:
    """One line of the timeline, broken where the log has a gap."""
    rows = _envelope(values, _POINTS)
    steps = np.diff(trace.t)
    gap = np.concatenate([[0], np.cumsum(steps > 2.5 * np.median(steps))])
    breaks = np.flatnonzero(np.diff(gap[rows])) + 1
    x = np.insert(trace.t[rows], breaks, np.nan)
    y = np.insert(np.where(values > 0.0, values, np.nan)[rows], breaks, np.nan)
    return {
        "type": "scatter",
        "mode": "lines",
        "x": numbers(x, 7),
        "y": numbers(y, 4),
        "yaxis": axis,
        "line": {"color": TRACE_COLOR, "width": 1.2},
        "hovertemplate": f"%{{y:.3r}} {unit} at %{{x:.5~r}} s<extra></extra>",
        "meta": name,
    }


def _envelope(values: Array, count: int) -> NDArray[np.intp]:
    """Rows that keep the lowest and the highest of each part of a long series."""
    n = len(values)
    if n <= count:
        return np.arange(n)
    edges = np.linspace(0, n, count // 2 + 1).astype(int)
    found = {0, n - 1}
    for start, stop in pairwise(edges):
        part = values[start:stop]
        found |= {start + int(part.argmin()), start + int(part.argmax())}
    return np.array(sorted(found))
