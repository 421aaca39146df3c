"""What plots of pages share: axes, numbers and text as plotly.js takes them.

A figure is a dict of ``data``, ``layout``, ``views`` and ``first``, the view to begin with. A view
has a name and what of data and layout it replaces. The ``meta`` of a trace names what hides it.
"""

from __future__ import annotations

import html
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from navgrade.report.curves import MINUTES
from navgrade.report.words import decades, readable_time

Array = NDArray[np.float64]
Figure = dict[str, Any]

MARGIN = {"l": 60, "r": 16, "t": 16, "b": 48}
ABOVE = {"yanchor": "bottom", "showarrow": False}


def time_axis(t: Array, title: str = "time since the start") -> Figure:
    """Logarithmic, over positive times in s."""
    return {
        "type": "log",
        "title": {"text": title},
        "range": [math.log10(t[0]), math.log10(t[-1] * 1.15)],
        "tickvals": list(MINUTES),
        "ticktext": [readable_time(t) for t in MINUTES],
    }


def log_axis(unit: str, low: float, high: float) -> Figure:
    """Logarithmic between two values, ticks with SI prefixes."""
    # plotly writes the tick 1e-6 with a minus sign, not a hyphen
    labels = {f"{value:.0e}": text for value, text in decades(unit).items()}
    aliases = {_as_plotly(key): text for key, text in labels.items()}
    return {
        "type": "log",
        "range": [math.log10(low), math.log10(high)],
        "tickformat": "~e",
        "labelalias": aliases,
    }


def _as_plotly(tick: str) -> str:
    """A tick such as 1e-06 as the format ~e of plotly.js writes it."""
    digit, power = tick.split("e")
    return f"{digit}e{'−' if int(power) < 0 else '+'}{abs(int(power))}"


def numbers(values: Array | Sequence[float], digits: int = 5) -> list[float | None]:
    """Rounded, for JSON; None for NaN."""
    return [float(f"{x:.{digits}g}") if math.isfinite(x) else None for x in values]


def as_text(text: str) -> str:
    """Nothing of it is taken for markup."""
    return html.escape(text, quote=False)
