"""A comparison as pictures for papers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from navgrade.compare.result import Comparison
from navgrade.logs.appearing import appearing
from navgrade.report.curves import (
    IMU_COLOR,
    MINUTES,
    POSITION,
    REFERENCE_COLOR,
    Style,
    costs,
    ended,
    is_reference,
    labels,
    log_limits,
    map_limits,
    predicted,
    rows_in_log_time,
    rows_in_time,
    styles,
)
from navgrade.report.output import places
from navgrade.report.words import readable, readable_time

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH = 3.5  # in, a column of a paper
_DPI = 300
_SIZE = 7.0  # pt, of text
_DASHES = {"solid": "-", "dash": "--", "dot": ":"}
_THIN = 0.6  # of the line widths of a screen


def write_pictures(
    comparison: Comparison, folder: str | Path, *, overwrite: bool = False
) -> tuple[Path, ...]:
    """Write ``track.png``, ``growth.png`` and ``terms.png``: one column wide, 300 dpi.

    Parameters
    ----------
    comparison : Comparison
    folder : path
        Made if only it is missing.
    overwrite : bool

    Returns
    -------
    tuple of Path
        Written.

    Raises
    ------
    ConfigError
        If a file exists and must not be overwritten, or the folder cannot be made.
    """
    draw = {"track.png": _track, "growth.png": _growth, "terms.png": _terms}
    paths = places(Path(folder), tuple(draw), overwrite=overwrite)
    for path, figure in zip(paths, draw.values(), strict=True):
        with appearing(path, overwrite=overwrite) as stream:
            figure(comparison).savefig(stream, format="png", dpi=_DPI)
    return paths


def _track(comparison: Comparison) -> Figure:
    figure, axes = _axes(4.3)
    rows = rows_in_time(comparison.t)
    east, north = comparison.track[rows, 0], comparison.track[rows, 1]
    axes.plot(east, north, color=REFERENCE_COLOR, alpha=0.6, linewidth=4, label="reference")
    look, called = styles(comparison), labels(comparison)
    for variant in comparison.variants:
        x, y = variant.track[rows, 0], variant.track[rows, 1]
        axes.plot(x, y, label=called[variant.name], **_line(look[variant.name]))
    for row, name, marker in ((0, "start", "o"), (-1, "end", "s")):
        place = float(east[row]), float(north[row])
        axes.plot(*place, marker, color="black", markersize=3)
        axes.annotate(name, place, xytext=(3, 3), textcoords="offset points", fontsize=_SIZE)
    x_limits, y_limits = map_limits(comparison.track)
    axes.set(xlim=x_limits, ylim=y_limits, aspect="equal")
    axes.set_xlabel("east of the start, m", fontsize=_SIZE)
    axes.set_ylabel("north of the start, m", fontsize=_SIZE)
    _legend(figure)
    return figure


def _growth(comparison: Comparison) -> Figure:
    figure, axes = _axes(4.6)
    rows = rows_in_log_time(comparison.t)
    t = comparison.t[rows]
    look, called = styles(comparison), labels(comparison)
    shown = []
    for variant in comparison.variants:
        error = POSITION.of(variant)[rows]
        error = np.where(error > 0.0, error, np.nan)
        if not np.isfinite(error).any():
            continue
        shown.append(error)
        axes.plot(t, error, label=called[variant.name], **_line(look[variant.name]))
        if is_reference(comparison.variants[0]):  # closed forms predict what a model costs
            axes.plot(
                comparison.epochs,
                predicted(variant, "horizontal"),
                "o",
                markersize=3.5,
                markerfacecolor="none",
                markeredgewidth=0.8,
                color=look[variant.name].color,
                clip_on=False,
            )
    if comparison.imu_error is not None:
        shown.append(comparison.imu_error)
        axes.plot(
            comparison.epochs,
            comparison.imu_error,
            "D-.",
            color=IMU_COLOR,
            linewidth=1.0,
            markersize=2.5,
            label="the IMU's own errors, 1σ",
        )
    low, high = log_limits(shown)
    for size, text in POSITION.guides:
        if low < size < high:
            axes.axhline(size, color="0.5", linewidth=0.6, linestyle=":")
            axes.annotate(text, (t[0], size), xytext=(2, 1), textcoords="offset points", fontsize=6)
    axes.set(xscale="log", yscale="log", xlim=(t[0], t[-1] * 1.15), ylim=(low, high))
    ticks = [tick for tick in MINUTES if t[0] <= tick <= t[-1]]
    axes.set_xticks(ticks, [readable_time(tick) for tick in ticks], fontsize=_SIZE)
    axes.minorticks_off()
    axes.yaxis.set_major_formatter(_metres)
    axes.set_xlabel("time since the start", fontsize=_SIZE)
    axes.set_ylabel("error of horizontal position", fontsize=_SIZE)
    _legend(figure)
    return figure


def _terms(comparison: Comparison) -> Figure:
    from matplotlib.ticker import LogLocator

    epoch = len(comparison.epochs) - 1
    found = [cost for cost in costs(comparison, epoch) if cost.value != 0.0]
    figure, axes = _axes(0.8 + 0.2 * len(found))
    look, called = styles(comparison), labels(comparison)
    low, high = log_limits([np.array([cost.value for cost in found])])
    for place, cost in enumerate(found):
        end = ended(comparison, cost.variant)
        text, x = readable(cost.value, "m"), max(cost.value, low)
        if np.isnan(cost.value):
            text, x = f"ended at {readable_time(end or 0.0)}", low
        axes.barh(
            place,
            cost.value,
            height=0.65,
            color=look[cost.variant.name].color,
            hatch="////" if cost.variant.group == "flat" else None,
            edgecolor="white",
            linewidth=0.0,
        )
        axes.annotate(
            text,
            (x, place),
            xytext=(2, 0),
            textcoords="offset points",
            verticalalignment="center",
            fontsize=_SIZE - 1.0,
        )
    names = [called[cost.variant.name] for cost in found]
    axes.set_yticks(range(len(found)), names, fontsize=_SIZE)
    axes.set(xscale="log", xlim=(low, high * 30.0), ylim=(len(found) - 0.4, -0.6))
    axes.xaxis.set_major_locator(LogLocator(numticks=4))
    axes.xaxis.set_major_formatter(_metres)
    axes.minorticks_off()
    after = readable_time(comparison.epochs[epoch])
    axes.set_xlabel(f"horizontal distance from the full engine after {after}", fontsize=_SIZE)
    axes.xaxis.get_label().set(x=1.0, horizontalalignment="right")
    axes.grid(axis="y", visible=False)
    return figure


def _axes(height: float) -> tuple[Figure, Axes]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(_WIDTH, height), layout="constrained")
    axes = figure.add_subplot()
    axes.tick_params(labelsize=_SIZE, width=0.5, length=2.5)
    axes.grid(color="0.88", linewidth=0.5)
    axes.set_axisbelow(True)
    for side, spine in axes.spines.items():
        spine.set_linewidth(0.5)
        spine.set_visible(side in ("left", "bottom"))
    return figure, axes


def _legend(figure: Figure) -> None:
    figure.legend(
        loc="outside lower center",
        ncols=2,
        frameon=False,
        fontsize=_SIZE - 1.0,
        handlelength=2.4,
        columnspacing=1.5,
    )


def _line(style: Style) -> dict[str, Any]:
    return {
        "color": style.color,
        "linestyle": _DASHES[style.dash],
        "linewidth": style.width * _THIN,
    }


def _metres(value: float, _: float) -> str:
    return readable(value, "m", digits=1)
