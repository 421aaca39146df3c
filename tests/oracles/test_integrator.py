"""Position, velocity and attitude of every motion follow from its own rates."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles.integrator import Pose, integrate
from tests.oracles.polar import PolarMotion, polar_flight
from tests.oracles.truth import Motion, ecef, manoeuvre, matrix, vibrating_airliner


def pose(motion: Motion | PolarMotion, t: float) -> Pose:
    """The true pose; of geodetic motion by turning n into e."""
    state = motion.state(t)
    if isinstance(motion, PolarMotion):
        return Pose(state.r_eb_e[0], state.v_eb_e[0], state.C_eb[0])
    C_en = matrix(np.zeros(1), -0.5 * np.pi - state.lat, state.lon)[0]
    r_eb_e = ecef(state.lat, state.lon, state.h)[0]
    return Pose(r_eb_e, C_en @ state.v_eb_n[0], C_en @ state.C_nb[0])


@pytest.mark.parametrize(
    ("motion", "t0", "t1"),
    [
        pytest.param(manoeuvre(), 1000.0, 1060.0, id="manoeuvre"),
        pytest.param(vibrating_airliner(), 30.0, 30.7, id="vibrating airliner"),
        pytest.param(polar_flight(1), 220.0, 280.0, id="over the north pole"),
        pytest.param(polar_flight(-1), 1120.0, 1180.0, id="3 m beside the south pole"),
    ],
)
def test_rates_lead_back_to_the_motion(motion, t0, t1):
    got, truth = integrate(motion, pose(motion, t0), t0, t1), pose(motion, t1)
    # m: start and end are rounded to 3 nm; a start off by 1e-15 rad drifts 10 m/s^2 t^2 / 2
    # times that, 2e-11 m; a term of 1e-8 m/s^2 forgotten would show as 18 um
    assert np.abs(got.r_eb_e - truth.r_eb_e).max() < 2e-8
    assert np.abs(got.v_eb_e - truth.v_eb_e).max() < 1e-9  # m/s, likewise
    assert np.abs(got.C_eb - truth.C_eb).max() < 1e-12  # rad, likewise
