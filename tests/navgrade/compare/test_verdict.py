"""Sentences on what a comparison found."""

from __future__ import annotations

import numpy as np
import pytest

from navgrade.compare.verdict import crossing, length_text, time_text


@pytest.mark.parametrize(
    ("metres", "text"),
    [
        (18.2, "18 m"),
        (2275.0, "2.3 km"),
        (512345.0, "512 km"),
        (0.0053, "5.3 mm"),
        (3.1e-5, "31 µm"),
        (2e-8, "< 1 µm"),
        (-150.0, "-150 m"),
        (np.nan, "—"),
    ],
)
def test_lengths(metres: float, text: str) -> None:
    assert length_text(metres) == text


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.5, "0.5 s"), (14.2, "14 s"), (119.0, "119 s"), (600.0, "10 min"), (750.0, "12.5 min")],
)
def test_times(seconds: float, text: str) -> None:
    assert time_text(seconds) == text


def test_the_last_crossing_counts() -> None:
    """Larger for a moment is not yet larger for good."""
    t = np.arange(1.0, 9.0)
    larger = np.array([0.0, 3.0, 1.0, 2.0, 4.0, 8.0, np.nan, 16.0])
    assert crossing(t, larger, np.full(8, 2.5)) == 5.0
    assert crossing(t, larger, np.full(8, 100.0)) is None
    assert crossing(t, larger, np.full(8, -1.0)) == 1.0
