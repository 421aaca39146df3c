"""Jets against Taylor series in high precision."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp

from navgrade.simulate.jet import Jet

FUNCTIONS = {
    "sum": (lambda x: 3.0 + x - (2.0 - x) + x, lambda x: 3 + x - (2 - x) + x),
    "product": (lambda x: x * x * 0.5 * (x - 7.0), lambda x: x * x * (x - 7) / 2),
    "quotient": (lambda x: (x + 1.0) / (x * x + 0.5), lambda x: (x + 1) / (x * x + 0.5)),
    "inverse": (lambda x: 2.0 / (1.0 + x * x), lambda x: 2 / (1 + x * x)),
    "sine": (lambda x: np.sin(x * x), lambda x: mp.sin(x * x)),
    "cosine": (lambda x: -np.cos(2.0 * x + 1.0), lambda x: -mp.cos(2 * x + 1)),
    "root": (lambda x: np.sqrt(2.0 + x * x * x), lambda x: mp.sqrt(2 + x**3)),
    "arctangent": (lambda x: np.arctan(3.0 * x / 2.0), lambda x: mp.atan(1.5 * x)),
    "mixed": (
        lambda x: np.sin(x) * np.sqrt(1.0 + np.cos(x) ** 1 * 0.5) / np.float64(3.0),
        lambda x: mp.sin(x) * mp.sqrt(1 + mp.cos(x) / 2) / 3,
    ),
}


@pytest.mark.parametrize("name", [name for name in FUNCTIONS if name != "mixed"])
def test_derivatives(name: str) -> None:
    """Value and three derivatives at several times, to rounding."""
    ours, exact = FUNCTIONS[name]
    t = np.array([-0.7, 0.0, 0.3, 1.1])
    found = ours(Jet(t, 1.0, 0.0, 0.0)).derivatives()
    for k, time in enumerate(t):
        expected = [float(mp.diff(exact, time, n)) for n in range(4)]
        # of third derivatives up to 60: a few roundings of sums of as many terms
        got = [np.broadcast_to(x, t.shape)[k] for x in found]
        assert got == pytest.approx(expected, abs=2e-14, rel=2e-14)


def test_arrays_and_jets_mix() -> None:
    """An array on the left multiplies, divides, adds and subtracts like one on the right."""
    t, a = np.array([0.5, 2.0]), np.array([3.0, -4.0])
    x = Jet.time(t)
    assert (a * x).derivatives()[0] == pytest.approx(a * t)
    assert (a - x).derivatives()[1] == -1.0
    assert (a + x).derivatives()[0] == pytest.approx(a + t)
    assert (a / x).derivatives()[1] == pytest.approx(-a / t**2)
    with pytest.raises(TypeError, match="exp"):
        np.exp(x)


def test_rate_and_integral_undo_each_other() -> None:
    """An integral from a value is what the rate came from, one order up and down."""
    x = np.sin(Jet(np.array([0.4]), 2.0, 0.5, 0.1))
    back = x.rate().integral(x.value)
    for one, other in zip(back.derivatives(), x.derivatives(), strict=True):
        assert one == pytest.approx(other, rel=1e-15)
