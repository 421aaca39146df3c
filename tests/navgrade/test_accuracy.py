"""The accuracy claims of docs/accuracy.md, against closed-form truth."""

from __future__ import annotations

import numpy as np
import pytest

from tests.navgrade.engine import attitude_error, fly
from tests.oracles.cases import CASES, CONTEXT, Case, position_error
from tests.oracles.truth import turning_vehicle

ARCSEC = np.pi / 648_000  # rad


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_hour(case: Case) -> None:
    """Position after an hour of exact increments stays within the claim."""
    nav, truth = fly(case.motion(), case.edges(), CONTEXT, reconstruction="causal-3")
    error = position_error(nav, truth)
    assert len(nav) > 3600 / max(case.intervals) - 1
    assert nav.t[-1] == pytest.approx(3600.0, abs=1e-9)  # s: rounding of the edges
    assert error.horizontal < case.horizontal
    if case.vertical is not None:
        assert error.vertical < case.vertical


def test_attitude_of_the_turning_vehicle() -> None:
    """Attitude after an hour: 1e-5 arcsec, where the peers reach 0.08."""
    case = CASES[0]
    nav, truth = fly(case.motion(), case.edges(), CONTEXT)
    assert attitude_error(nav, truth).max() < 1e-5 * ARCSEC


@pytest.mark.parametrize("reconstruction", ["none", "causal-1", "causal-3"])
def test_first_samples_without_context(reconstruction: str) -> None:
    """A log that starts in motion costs its short first windows, 20 micrometres in 10 s."""
    edges = np.arange(2001) * 0.005 + 3.0
    limit = {"none": 1.0, "causal-1": 2e-5, "causal-3": 2e-5}[reconstruction]  # m after 10 s
    nav, truth = fly(turning_vehicle(), edges, reconstruction=reconstruction)
    error = position_error(nav, truth)
    assert max(error.horizontal, error.vertical) < limit
