"""A comparison as one page that needs no network."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from importlib.metadata import version
from pathlib import Path

import numpy as np

from navgrade.compare.result import Comparison, Group, Variant
from navgrade.logs.appearing import appearing
from navgrade.report.curves import (
    IMU_COLOR,
    REFERENCE_COLOR,
    Quantity,
    Style,
    ended,
    labels,
    quantities,
    styles,
)
from navgrade.report.figures import (
    IMU,
    REFERENCE,
    cost_figure,
    growth_figure,
    track_figure,
)
from navgrade.report.sheet import sheet, swatch, switch, unbroken, views
from navgrade.report.words import (
    GROUPS,
    clock,
    law,
    meaning,
    place,
    readable,
    readable_time,
)


def write_page(comparison: Comparison, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a comparison as one HTML file.

    Scripts, styles and data stand in the file, and its content security policy forbids the
    browser to ask any network for more.

    Parameters
    ----------
    comparison : Comparison
    path : path
        Appears when it is complete.
    overwrite : bool

    Raises
    ------
    ConfigError
        If `path` exists and must not be overwritten, or its folder does not exist.
    """
    with appearing(Path(path), overwrite=overwrite) as stream:
        stream.write(_page(comparison).encode())


def _page(comparison: Comparison) -> str:
    figures = {
        "track": track_figure(comparison),
        "growth": growth_figure(comparison),
        "cost": cost_figure(comparison),
    }
    name = escape(Path(comparison.log).name)
    first, *more = [f"<p>{unbroken(sentence)}</p>" for sentence in comparison.verdict] or [""]
    body = f"""<header>
<h1>{name}</h1>
<p>{escape(clock(comparison.start_ns))}, {readable_time(comparison.t[-1])} without aiding</p>
</header>
<div class="verdict">
{first}
{"".join(more)}
</div>
<p class="lead">{_lead(comparison)}</p>
<noscript><p>The plots need JavaScript; the table below does not.</p></noscript>
<div class="study">
{_legend(comparison)}
<div>
<section>
<h2>Where each solution went</h2>
<p class="hint">Drag to zoom, double-click to see the whole. The reference is the broad grey
line.</p>
{views("track", figures, "View")}
<div id="track" class="plot" role="img" aria-label="Map of all solutions"></div>
</section>
<section>
<h2>How the errors grow</h2>
<p class="hint">Both axes are logarithmic: one division up is ten times the error, and a straight
line is a power of time. A circle is what a formula predicts.</p>
{views("growth", figures, "Quantity")}
<div id="growth" class="plot" role="img" aria-label="Errors over time"></div>
</section>
<section>
<h2>What each simplification costs</h2>
<p class="hint">Metres between the solution and the full engine, after the chosen time, on a
logarithmic axis. A circle is what a formula predicts.</p>
{views("cost", figures, "Time")}
<div id="cost" class="plot bars" role="img" aria-label="Cost of each simplification"
style="height: {_height(comparison)}"></div>
</section>
</div>
</div>
<section>
<h2>In numbers</h2>
<p class="hint">Relative to {escape(comparison.reference)}. A dash is a solution that had ended.</p>
{_tables(comparison)}
</section>
<section>
<h2>What each of them is</h2>
{_meanings(comparison)}
</section>
{_notes(comparison)}
<section>
<h2>Where this comes from</h2>
{_provenance(comparison)}
</section>"""
    return sheet(f"{Path(comparison.log).name}: what the Earth is worth", body, figures)


def _height(comparison: Comparison) -> str:
    """Of the bars: two lines of text for each."""
    return f"{2.2 * len(comparison.variants) + 6.0:g}rem"


def _lead(comparison: Comparison) -> str:
    flat = sum(variant.group == "flat" for variant in comparison.variants)
    terms = sum(variant.group == "term" for variant in comparison.variants)
    return (
        "The motion sensor's log was turned into a path again and again, each time from the same "
        "start and with no GNSS to correct it: once over the Earth as it is"
        + (f", {_times(flat)} over a flat world" if flat else "")
        + (
            f", {_times(terms)} with one property of the Earth or one correction left out"
            if terms
            else ""
        )
        + f". Errors are relative to {escape(comparison.reference)}."
    )


def _times(count: int) -> str:
    return {1: "once", 2: "twice"}.get(count, f"{count} times")


def _legend(comparison: Comparison) -> str:
    look, called = styles(comparison), labels(comparison)
    fields = [
        _field(
            GROUPS[group],
            [(v.name, called[v.name], swatch(*_drawn(look[v.name]))) for v in variants],
        )
        for group, variants in _grouped(comparison)
    ]
    others = [
        (REFERENCE, f"Reference: {comparison.reference}", swatch(REFERENCE_COLOR, "solid", 6.0))
    ]
    if comparison.imu_error is not None:
        others.append((IMU, "This IMU's own errors, 1σ", swatch(IMU_COLOR, "dashdot", 2.0)))
    fields.append(_field("To judge by", others))
    return f'<aside class="legend" aria-label="Legend">{"".join(fields)}</aside>'


def _drawn(style: Style) -> tuple[str, str, float]:
    return style.color, style.dash, style.width


def _field(title: str, entries: list[tuple[str, str, str]]) -> str:
    labels = "".join(
        f'<label><input type="checkbox" value="{escape(name)}" checked>{swatch}'
        f"<span>{escape(label)}</span></label>"
        for name, label, swatch in entries
    )
    return f"<fieldset><legend>{escape(title)}</legend>{labels}</fieldset>"


def _grouped(comparison: Comparison) -> Iterable[tuple[Group, list[Variant]]]:
    for group in GROUPS:
        variants = [variant for variant in comparison.variants if variant.group == group]
        if variants:
            yield group, variants


def _tables(comparison: Comparison) -> str:
    every = quantities(comparison)
    tables = (_table(comparison, quantity, i) for i, quantity in enumerate(every))
    return switch("table", [quantity.label for quantity in every], "Quantity") + "".join(tables)


def _table(comparison: Comparison, quantity: Quantity, index: int) -> str:
    called = labels(comparison)
    laws = quantity.key == "position"
    head = "".join(f"<th>{readable_time(t)}</th>" for t in comparison.epochs)
    if laws:
        head += '<th class="text">fitted, m</th><th class="text">formula, m</th>'
    columns = 1 + len(comparison.epochs) + 2 * laws
    body = ""
    for group, variants in _grouped(comparison):
        body += f'<tr class="group"><th colspan="{columns}">{escape(GROUPS[group])}</th></tr>'
        body += "".join(_row(comparison, v, called[v.name], quantity, laws=laws) for v in variants)
    if laws and comparison.imu_error is not None:
        cells = "".join(f"<td>{readable(x, 'm')}</td>" for x in comparison.imu_error)
        body += (
            f'<tr class="group"><th>This IMU\'s own errors, 1σ</th>{cells}<td></td><td></td></tr>'
        )
    return (
        f'<div class="scroll" data-pane="table" data-view="{index}"><table>'
        f"<caption>{quantity.label}</caption>"
        f"<thead><tr><th>after</th>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _row(
    comparison: Comparison, variant: Variant, label: str, quantity: Quantity, *, laws: bool
) -> str:
    cells = ""
    for value in quantity.of(variant)[comparison.epoch_rows]:
        kind = ' class="ended"' if np.isnan(value) else ""
        cells += f"<td{kind}>{readable(value, quantity.unit)}</td>"
    if laws:
        fitted = law(variant.growth)
        text = ""
        if fitted is not None:
            mantissa, exponent, power = fitted
            text = f"{mantissa} × 10<sup>{exponent}</sup> t<sup>{power}</sup>"
        formula = escape(variant.growth.formula)
        if variant.growth.axis == "vertical":
            text, formula = f"height: {text}", f"height: {formula}"
        cells += f'<td class="text law">{text}</td><td class="text law">{formula}</td>'
    end = ended(comparison, variant)
    note = "" if end is None else f" (ended at {readable_time(end)})"
    return f"<tr><th>{escape(label)}{note}</th>{cells}</tr>"


def _meanings(comparison: Comparison) -> str:
    look, called = styles(comparison), labels(comparison)
    entries = "".join(
        f"<dt>{swatch(*_drawn(look[v.name]))}<span>{escape(called[v.name])}</span></dt>"
        f"<dd>{escape(meaning(v.name))}</dd>"
        for v in comparison.variants
        if meaning(v.name)
    )
    return f'<dl class="swatches">{entries}</dl>'


def _notes(comparison: Comparison) -> str:
    if not comparison.notes:
        return ""
    items = "".join(f"<li>{escape(note)}</li>" for note in comparison.notes)
    return f"<section><h2>Notes</h2><ul>{items}</ul></section>"


def _provenance(comparison: Comparison) -> str:
    entries = {
        "log": comparison.log,
        "topic": comparison.topic,
        "understood as": comparison.description,
        "start": f"{clock(comparison.start_ns)}, "
        f"{place(comparison.lat, comparison.lon, comparison.h)} above the ellipsoid",
        "length": readable_time(comparison.t[-1]),
        "errors relative to": comparison.reference,
        "attitude error": "the angle between estimated and reference attitude",
        "computed by": f"navgrade {version('navgrade')}",
    }
    items = "".join(f"<dt>{name}</dt><dd>{escape(text)}</dd>" for name, text in entries.items())
    return f"<dl>{items}</dl>"
