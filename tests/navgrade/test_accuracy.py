"""The accuracy claims of docs/accuracy.md, against closed-form truth."""

from __future__ import annotations

import numpy as np
import pytest

from navgrade import Trajectory
from navgrade.mechanization import MECHANIZATIONS
from navgrade.reconstruction import RECONSTRUCTIONS
from tests.navgrade.engine import attitude_error, fly
from tests.oracles.cases import CASES, CONTEXT, Case, Claim, position_error
from tests.oracles.polar import polar_flight
from tests.oracles.truth import quaternion_product, turning_vehicle

ARCSEC = np.pi / 648_000  # rad


def test_attitude_of_the_turning_vehicle() -> None:
    """Attitude after an hour: 1e-5 arcsec, where the peers reach 0.08."""
    case = CASES[0]
    nav, truth = fly(case.motion(), case.edges(), CONTEXT, reconstruction="causal-3")
    assert attitude_error(nav, truth).max() < 1e-5 * ARCSEC


@pytest.mark.parametrize(
    ("case", "claim"),
    [
        pytest.param(case, claim, id=f"{case.name}, {claim.reconstruction}, {claim.mechanization}")
        for case in CASES
        for claim in case.claims
    ],
)
def test_hour(case: Case, claim: Claim) -> None:
    """Position after an hour of exact increments stays within the claim."""
    nav, truth = fly(
        case.motion(),
        case.edges(),
        CONTEXT,
        reconstruction=claim.reconstruction,
        mechanization=claim.mechanization,
    )
    assert len(nav) == round(case.duration * len(case.intervals) / sum(case.intervals))
    assert nav.t[-1] == pytest.approx(case.duration, abs=1e-9)  # s: rounding of the edges
    assert not nav.status.any()  # the context fills every window
    error = position_error(nav, truth)
    assert error.horizontal < claim.horizontal
    if claim.vertical is not None:
        assert error.vertical < claim.vertical


@pytest.mark.parametrize("mechanization", [name for name in MECHANIZATIONS if name != "n"])
@pytest.mark.parametrize("pole", [1, -1])
def test_over_a_pole(mechanization: str, pole: int) -> None:
    """A hundred seconds with the pole itself in their middle, at the end of an interval."""
    edges = 200.0 + np.arange(-CONTEXT, 20_001 + CONTEXT) * 0.005
    nav, truth = fly(polar_flight(pole), edges, CONTEXT, mechanization=mechanization)
    error = position_error(nav, truth)
    # m: positions are rounded to 3 nm, and 1e-12 m/s² of the gravity fit is 5 nm after 100 s
    assert max(error.horizontal, error.vertical) < 1e-7
    assert attitude_error(nav, truth).max() < 1e-13  # rad: 20,000 roundings


@pytest.mark.parametrize("away", [0.0, 1.0])
def test_attitude_error_at_a_pole_does_not_depend_on_north(away: float) -> None:
    """At the pole itself, a solution with its north 1 rad away is as far off as it was turned."""
    truth = polar_flight().state(250.0)
    off = 1e-7  # rad, about the body's x axis
    about_x = np.array([[np.cos(off / 2), np.sin(off / 2), 0.0, 0.0]])
    about_down = np.array([[np.cos(away / 2), 0.0, 0.0, -np.sin(away / 2)]])
    q_nb = quaternion_product(quaternion_product(about_down, truth.q_nb), about_x)
    nav = Trajectory(truth.t, truth.lat, truth.lon - away, truth.h, truth.v_eb_n, q_nb, np.zeros(1))
    assert attitude_error(nav, truth) == pytest.approx(off, abs=1e-15)  # rad, round-off


@pytest.mark.parametrize("reconstruction", RECONSTRUCTIONS)
def test_first_samples_without_context(reconstruction: str) -> None:
    """A log that starts in motion costs its short first windows, below 4 micrometres in 10 s."""
    edges = np.arange(2001) * 0.005 + 3.0
    # m after 10 s: without compensation 40 mm, with the samples of one interval 1.7 um; Euler too
    # leaves 40 mm, and the means of both ends 9 um, by the curvature of rate and force
    limit = {"none": 0.1, "euler": 0.1, "midpoint": 2e-5}.get(reconstruction, 4e-6)
    nav, truth = fly(turning_vehicle(), edges, reconstruction=reconstruction)
    error = position_error(nav, truth)
    assert max(error.horizontal, error.vertical) < limit
