"""An alignment as one page that needs no network."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from earth.units import DEG, DEG_PER_H, DEG_PER_RTH, DEG_PER_S, UG, UG_PER_RTHZ
from navgrade.logs.appearing import appearing
from navgrade.report.alignment_figures import (
    AZIMUTH,
    CURVES,
    SHADES,
    TILT,
    budget_figure,
    convergence_figure,
    innovations_figure,
    timeline_figure,
)
from navgrade.report.plots import Figure
from navgrade.report.sheet import sheet, swatch, unbroken
from navgrade.report.words import (
    angle_unit,
    number,
    place,
    readable_angle,
    readable_time,
    signed,
)

if TYPE_CHECKING:
    from align import Alignment
    from navgrade.alignment import AlignedWindow

Array = NDArray[np.float64]
_MM = 1e-3  # m/s^2 in mm/s^2
_HARD = "\N{NO-BREAK SPACE}"
_AXES = ("x, forward", "y, right", "z, down")


def write_alignment_page(
    aligned: AlignedWindow,
    path: str | Path,
    *,
    log_name: str,
    site_name: str,
    lat: float,
    overwrite: bool = False,
) -> None:
    """Write an alignment as one HTML file, which asks no network for more.

    Parameters
    ----------
    aligned : AlignedWindow
    path : path
        Appears when it is complete.
    log_name, site_name : str
        Where it comes from.
    lat : float
        Geodetic latitude of the site, rad.
    overwrite : bool

    Raises
    ------
    ConfigError
        If `path` exists and must not be overwritten, or its folder does not exist.
    """
    with appearing(Path(path), overwrite=overwrite) as stream:
        stream.write(_page(aligned, log_name, site_name, lat).encode())


def _page(aligned: AlignedWindow, log_name: str, site_name: str, lat: float) -> str:
    r = aligned.result
    drawn = {
        "budget": budget_figure(r),
        "convergence": convergence_figure(r.convergence),
        "timeline": timeline_figure(aligned),
        "innovations": innovations_figure(r.innovations),
    }
    figures = {name: figure for name, figure in drawn.items() if figure is not None}
    name = Path(log_name).name
    parts = [
        f"""<header>
<h1>{escape(name)}</h1>
<p>Attitude by {escape(r.method)}, from {_span(aligned)}</p>
</header>
<div class="verdict">
<p>{_sentence(r.verdict)}</p>
</div>
<p class="lead">Method <b>{escape(r.method)}</b>: {unbroken(r.reason)}.</p>""",
        _listed("Warnings", r.warnings, "warnings"),
        "<noscript><p>The plots need JavaScript; the tables do not.</p></noscript>",
        _section(
            "Attitude",
            "Body axes forward, right, down against north, east, down; 1σ is what the alignment "
            "predicts of its own error.",
            _attitude(r),
        ),
        _section(
            "Error budget",
            "What each error of the sensors contributes. Contributions add as squares; the share "
            "is that of the square. The bars are on a logarithmic axis.",
            _budget(r),
            _key([("tilt", _block(TILT)), ("azimuth", _block(AZIMUTH))])
            if "budget" in figures
            else "",
            _plot("budget", figures, "Error budget", f"{4.4 * len(r.budget) + 9.0:g}rem"),
        ),
        _section(
            "Quality",
            "What the data say against gravity, the Earth's rotation and themselves.",
            _quality(r, lat),
        ),
        _convergence(figures),
        _still(aligned, figures),
        _biases(r),
        _innovations(r, figures),
        _section("Where this comes from", "", _provenance(aligned, log_name, site_name, lat)),
    ]
    return sheet(f"{name}: alignment", "\n".join(filter(None, parts)), figures)


def _sentence(words: str) -> str:
    """With a capital and a full stop."""
    return f"{unbroken(words[:1].upper() + words[1:].rstrip('.'))}."


def _span(aligned: AlignedWindow) -> str:
    stop = aligned.start + aligned.duration
    return f"{aligned.start:.1f} s to {stop:.1f} s, {aligned.result.duration:.1f} s used"


def _section(title: str, hint: str, *parts: str) -> str:
    inside = "\n".join(filter(None, parts))
    if not inside:
        return ""
    hint = f'<p class="hint">{hint}</p>\n' if hint else ""
    return f"<section>\n<h2>{title}</h2>\n{hint}{inside}\n</section>"


def _listed(title: str, entries: Sequence[str], kind: str) -> str:
    if not entries:
        return ""
    items = "".join(f"<li>{unbroken(entry)}</li>" for entry in entries)
    return f'<section class="{kind}"><h3>{title}</h3><ul>{items}</ul></section>'


def _plot(name: str, figures: dict[str, Figure], title: str, height: str = "") -> str:
    if name not in figures:
        return ""
    kind, style = ("plot bars", f' style="height: {height}"') if height else ("plot", "")
    return f'<div id="{name}" class="{kind}" role="img" aria-label="{title}"{style}></div>'


def _key(entries: Iterable[tuple[str, str]]) -> str:
    items = "".join(f"<li>{mark}<span>{escape(label)}</span></li>" for label, mark in entries)
    return f'<ul class="key">{items}</ul>'


def _block(color: str) -> str:
    return (
        '<svg width="22" height="12" aria-hidden="true">'
        f'<rect width="22" height="12" fill="{color}"/></svg>'
    )


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "fit") -> str:
    """A table of text; the first cell of a row is its header."""
    top = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(
        f"<tr><th>{escape(first)}</th>" + "".join(f"<td>{escape(x)}</td>" for x in cells) + "</tr>"
        for first, *cells in rows
    )
    return (
        f'<div class="scroll"><table class="{kind}"><thead><tr>{top}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _degrees(value: float, sigma: float) -> str:
    """An angle in degrees to the second significant digit of its sigma."""
    if not np.isfinite(value):
        return "unknown"
    decimals = 4
    if np.isfinite(sigma) and sigma > 0.0:
        decimals = int(np.clip(1 - np.floor(np.log10(sigma / DEG)), 2, 9))
    return f"{value / DEG:.{decimals}f}°".replace("-", "−")


def _attitude(r: Alignment) -> str:
    angles = (
        ("roll", r.roll, r.roll_sigma),
        ("pitch", r.pitch, r.pitch_sigma),
        ("heading", r.heading, r.heading_sigma),
    )
    rows = [(name, _degrees(value, sigma), *_sigma(sigma)) for name, value, sigma in angles]
    rows += [("tilt", "", *_sigma(r.tilt_sigma)), ("azimuth", "", *_sigma(r.azimuth_sigma))]
    table = _table(("", "angle", "1σ", "1σ, mrad"), rows)
    if not np.all(np.isfinite(r.q_nb)):
        return table
    q = "&ensp;".join(f"{x:.9f}".replace("-", "−") for x in r.q_nb)
    return f'{table}<p class="hint">Quaternion body to NED, scalar first: <code>{q}</code></p>'


def _sigma(sigma: float) -> tuple[str, str]:
    return readable_angle(sigma), number(sigma / 1e-3)


def _budget(r: Alignment) -> str:
    if not r.budget:
        return ""
    tilt, tilt_sign = angle_unit(max(r.tilt_sigma, *(line.tilt for line in r.budget)))
    azimuth, azimuth_sign = angle_unit(max(r.azimuth_sigma, *(line.azimuth for line in r.budget)))

    def cells(of_tilt: float, of_azimuth: float) -> tuple[str, ...]:
        return (
            number(of_tilt / tilt),
            _share(of_tilt, r.tilt_sigma),
            number(of_azimuth / azimuth),
            _share(of_azimuth, r.azimuth_sigma),
        )

    rows = [(line.source, *cells(line.tilt, line.azimuth)) for line in r.budget]
    rows.append(("total", *cells(r.tilt_sigma, r.azimuth_sigma)))
    head = ("1σ", f"tilt,{_HARD}{tilt_sign}", "share", f"azimuth,{_HARD}{azimuth_sign}", "share")
    return _table(head, rows, "fit total")


def _share(part: float, whole: float) -> str:
    if not (np.isfinite(part) and np.isfinite(whole) and whole > 0.0):
        return "—"
    share = 100.0 * (part / whole) ** 2
    return f"{share:.0f} %" if share == 0.0 or share >= 0.5 else "< 1 %"


def _quality(r: Alignment, lat: float) -> str:
    residuals = (
        ("|f| − g", r.specific_force_residual / _MM, "mm/s²", "accelerometers, along up"),
        ("|ω| − Ω", r.rate_residual / DEG_PER_H, "°/h", "gyros, along the Earth's axis"),
        ("rate about down", r.rate_residual_down / DEG_PER_H, "°/h", "gyros, about down"),
        ("rate along north", r.rate_residual_north / DEG_PER_H, "°/h", "gyros, along north"),
    )
    rows = [
        *((name, f"{signed(x)} {u}", of) for name, x, u, of in residuals if np.isfinite(x)),
        _latitude(r.implied_latitude, lat),
    ]
    if differs(r.gyro_heading, r.heading):
        sigma = r.gyro_heading_sigma
        rows.append(
            ("heading by gyros", _degrees(r.gyro_heading, sigma), f"1σ {readable_angle(sigma)}")
        )
    rows += [
        (f"scatter of tenths, {name}", readable_angle(x), "attitude between tenths of the window")
        for name, x in zip(("north", "east", "down"), r.scatter, strict=True)
        if np.isfinite(x)
    ]
    rows += [
        ("stillness, force", f"{number(r.force_scatter / _MM)} mm/s²", "scatter of 1 s means"),
        ("stillness, rate", f"{number(r.rate_scatter / DEG_PER_S)} °/s", "scatter of 1 s means"),
    ]
    if np.isfinite(r.eigenvalue_gap):
        rows.append(
            ("eigenvalue gap", number(r.eigenvalue_gap), "how sharply the vectors fix the attitude")
        )
    if r.innovations is not None:
        rows.append(_nis(r))
    return _table(("", "found", "of what"), rows, "fit says")


def differs(gyro_heading: float, heading: float) -> bool:
    """Whether the gyros' own heading is another than the one found, and worth a line."""
    return bool(np.isfinite(gyro_heading) and not abs(gyro_heading - heading) < 1e-9)


def _latitude(implied: float, lat: float) -> tuple[str, str, str]:
    site = f"{lat / DEG:.4f}°".replace("-", "−")
    if not np.isfinite(implied):
        return "implied latitude", "unknown", f"the site's is {site}"
    value = f"{implied / DEG:.4f}°".replace("-", "−")
    return (
        "implied latitude",
        value,
        f"the site's is {site}, off by {signed((implied - lat) / DEG)}°",
    )


def _nis(r: Alignment) -> tuple[str, str, str]:
    found = r.innovations
    assert found is not None
    says = "consistent" if found.consistent else "not consistent with the model"
    bounds = f"95{_HARD}% between {number(found.low)} and {number(found.high)}: {says}"
    return "mean NIS", number(float(np.nanmean(found.nis))), bounds


def _convergence(figures: dict[str, Figure]) -> str:
    if "convergence" not in figures:
        return ""
    drawn = {trace["meta"] for trace in figures["convergence"]["data"]}
    key = _key(
        (label, swatch(style.color, style.dash, style.width))
        for name, (label, style) in CURVES.items()
        if name in drawn
    )
    return _section(
        "Convergence",
        "How far the attitude from the first part of the window alone is from the final one, "
        "beside what theory predicts of its error. Both axes are logarithmic. Biases do not show "
        "in the distance, they are the same all along.",
        key,
        _plot("convergence", figures, "Convergence against averaging time"),
    )


def _still(aligned: AlignedWindow, figures: dict[str, Figure]) -> str:
    key = ""
    if "timeline" in figures:
        shown = {shape["name"] for shape in figures["timeline"]["layout"]["shapes"]}
        key = _key((kind, _block(color)) for kind, color in SHADES.items() if kind in shown)
    parts = key, _plot("timeline", figures, "Rate and force over the log"), _stretches(aligned)
    return _section(
        "Still stretches",
        "Distance of each short mean of rate and specific force from those of the part used. The "
        f"detector takes {100.0 * aligned.still.false_alarm:.2g}&nbsp;% of the undisturbed spans "
        "for disturbed. Noise is per axis.",
        *parts,
    )


def _stretches(aligned: AlignedWindow) -> str:
    rows = [
        (
            f"{i + 1}, used" if i == aligned.chosen else f"{i + 1}",
            f"{s.start:.1f}",
            f"{s.stop:.1f}",
            f"{s.duration:.1f}",
            f"{s.cut:.1f}",
            s.motion,
            number(s.force_scatter / _MM),
            number(s.rate_scatter / DEG_PER_S),
            number(_rms(s.arw) / DEG_PER_RTH),
            number(_rms(s.vrw) / UG_PER_RTHZ),
        )
        for i, s in enumerate(aligned.still.stretches)
    ]
    scatter = "force scatter, mm/s²", "rate scatter, °/s", "noise, °/√h", "noise, µg/√Hz"
    head = ("", "from, s", "to, s", "kept, s", "cut, s", "motion", *scatter)
    return _table(head, rows, "narrow") if rows else ""


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _biases(r: Alignment) -> str:
    columns: list[tuple[str, Array | None, float]] = [
        ("gyro bias, °/h", r.gyro_bias, DEG_PER_H),
        ("accelerometer bias, µg", r.accel_bias, UG),
    ]
    sigmas = (r.gyro_bias_sigma, r.accel_bias_sigma)
    head, cells = [""], [[axis] for axis in _AXES]
    for (title, bias, unit), sigma in zip(columns, sigmas, strict=True):
        if bias is None:
            continue
        head += [title, "1σ"]
        for axis, row in enumerate(cells):
            row.append(signed(bias[axis] / unit))
            row.append("—" if sigma is None else number(sigma[axis] / unit))
    table = _table(head, cells) if len(head) > 1 else ""
    hint = "Estimated in body axes, where the data show them." if table else ""
    hidden = _listed("What the data cannot tell", r.unobservable, "hidden")
    return _section("Biases", hint, table, hidden)


def _innovations(r: Alignment, figures: dict[str, Figure]) -> str:
    if "innovations" not in figures:
        return ""
    _, mean, bounds = _nis(r)
    line = swatch(AZIMUTH, "solid", 2.0)
    return _section(
        "Innovations of the filter",
        "Where the filter's covariance is right, their mean lies in the shaded band: it is "
        f"{mean}, {bounds}.",
        _key([("mean", line), (f"95{_HARD}% bounds of the mean", _block(SHADES["used"]))]),
        _plot("innovations", figures, "Normalised innovations squared"),
    )


def _provenance(aligned: AlignedWindow, log_name: str, site_name: str, lat: float) -> str:
    r, state = aligned.result, aligned.state
    where = f"latitude {lat / DEG:.6f}°".replace("-", "−")
    if state is not None:
        where = f"{place(state.lat, state.lon, state.h)} above the ellipsoid"
    entries = {
        "log": log_name,
        "site": site_name,
        "window": f"{_span(aligned)} ({readable_time(r.duration)})",
        "method": r.method,
        "grade": r.grade,
        "place": where,
        "computed by": f"navgrade {version('navgrade')}",
    }
    items = "".join(f"<dt>{name}</dt><dd>{escape(text)}</dd>" for name, text in entries.items())
    return f"<dl>{items}</dl>"
