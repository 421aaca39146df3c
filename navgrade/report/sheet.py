"""What the pages share: one file of HTML that needs no network, and what stands in it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from html import escape
from importlib.resources import files

from navgrade.report.plots import Figure

_SHORTHAND = {"dash": "7 4", "dot": "2 3", "dashdot": "7 3 2 3", "solid": ""}  # of SVG, px
_POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)


def sheet(title: str, body: str, figures: Mapping[str, Figure]) -> str:
    """A whole page: scripts, styles and data stand in it.

    Its content security policy forbids the browser to ask any network for more.

    Parameters
    ----------
    title : str
    body : str
        HTML, with an element for each figure, whose id is its name.
    figures : mapping of str to Figure
    """
    from plotly.offline import get_plotlyjs

    data = json.dumps(figures, ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    here = files(__package__)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<title>{escape(title)}</title>
<link rel="icon" href="data:,">
<style>
{here.joinpath("page.css").read_text("utf-8")}</style>
</head>
<body>
<main>
{body}
</main>
<script type="application/json" id="figures">{data}</script>
<script>{get_plotlyjs()}</script>
<script>
{here.joinpath("page.js").read_text("utf-8")}</script>
</body>
</html>
"""


def views(name: str, figures: Mapping[str, Figure], title: str) -> str:
    """Buttons for the views of a figure."""
    choices = [view["name"] for view in figures[name]["views"]]
    return switch(name, choices, title, figures[name]["first"])


def switch(name: str, choices: Iterable[str], title: str, first: int = 0) -> str:
    """Buttons of which one is pressed: of the figure, or of the panes, of that name."""
    buttons = "".join(
        f'<label><input type="radio" name="{name}" value="{i}"{" checked" if i == first else ""}>'
        f"<span>{escape(choice)}</span></label>"
        for i, choice in enumerate(choices)
    )
    return f'<fieldset class="switch" aria-label="{title}">{buttons}</fieldset>'


def swatch(color: str, dash: str, width: float) -> str:
    """A piece of line as a plot draws it."""
    return (
        f'<svg width="30" height="10" aria-hidden="true"><line x1="0" x2="30" y1="5" y2="5" '
        f'stroke="{color}" stroke-width="{width}" stroke-dasharray="{_SHORTHAND[dash]}"/></svg>'
    )


def unbroken(sentence: str) -> str:
    """A sentence whose numbers stay on one line with their units."""
    return re.sub(r"(\d) (?=(?:km|m|mm|µm|s|min)\b)", "\\1&nbsp;", escape(sentence))
