"""Vibration and mounting against high precision, and what vibration rectifies to."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.special import j0, j1

from navgrade.simulate import (
    Coning,
    Mounted,
    Sculling,
    Segments,
    Shaking,
    Start,
    Still,
    Vibrating,
    imu_increments,
    imu_rates,
    true_trajectory,
)
from tests.navgrade.simulate.exact import DEG, Pose, closing, mismatch, rotation
from tests.navgrade.simulate.test_segments import MOTION
from tests.navgrade.simulate.test_sinusoids import SWELL
from tests.navgrade.simulate.test_sinusoids import pose as swell_pose
from tests.oracles.high_precision import turn

VIBRATIONS = (
    Coning(0.02, 11.0, "x", 0.4),
    Coning(0.01, 3.0, "y"),
    Coning(0.3, 0.5, "z", -1.0),
    Sculling(0.01, 17.0, acceleration=2.0, rotation_axis="z", force_axis="x", lead=0.3, phase=0.2),
    Sculling(0.02, 5.0, displacement=0.01, rotation_axis="y", force_axis="z"),
    Shaking(23.0, acceleration=3.0, axis="y", phase=1.0),
)
LEVER, MOUNTING = (1.2, -0.4, 0.7), np.array([0.5, -0.1, 0.7, 0.5]) / 1.0  # m
ARM = Mounted(Vibrating(SWELL, VIBRATIONS), LEVER, MOUNTING)


def cone(vibration: Coning, t: mpf) -> mp.matrix:
    """Round the axis, tilt, and round back."""
    axis = "xyz".index(vibration.axis)
    angle = 2 * mp.pi * mpf(vibration.frequency) * t + mpf(vibration.phase)
    tilt = turn((axis + 2) % 3, mpf(vibration.half_angle))
    return turn(axis, angle) * tilt * turn(axis, -angle)


def shaken(t: mpf) -> tuple[mp.matrix, mp.matrix]:
    """Rotation and displacement of VIBRATIONS."""
    C, move = mp.eye(3), mp.matrix([0, 0, 0])
    for v in VIBRATIONS:
        if isinstance(v, Coning):
            C = C * cone(v, t)
            continue
        angle = 2 * mp.pi * mpf(v.frequency) * t + mpf(v.phase)
        lead = 0.0
        if isinstance(v, Sculling):
            C = C * turn("xyz".index(v.rotation_axis), mpf(v.angle) * mp.sin(angle))
            lead = v.lead
        size = v.displacement
        if v.acceleration is not None:
            size = mpf(v.acceleration) / (2 * mp.pi * mpf(v.frequency)) ** 2
        axis = v.force_axis if isinstance(v, Sculling) else v.axis
        move["xyz".index(axis)] -= size * mp.sin(angle + mpf(lead))
    return C, move


def arm_pose() -> Pose:
    """Pose of the sensor on the vibrating swell."""
    base, C_bs = swell_pose(SWELL), rotation([mpf(float(x)) for x in MOUNTING])

    def at(t: mpf) -> tuple[mp.matrix, mp.matrix]:
        (C_eb, r_e), (C, move) = base(t), shaken(t)
        lever = mp.matrix([mpf(x) for x in LEVER])
        return C_eb * C * C_bs, r_e + C_eb * (move + C * lever)

    return at


def test_rates() -> None:
    """Rates, force and velocity of a sensor on a vibrating body agree with high precision."""
    found = mismatch(ARM, lambda _: arm_pose(), (0.0, 33.333, 99.9))
    # phases up to 1.4e4 rad are rounded to 1e-12 rad: of 3 rad/s, 300 m/s^2 and 3 m/s at most
    assert found.omega < 3e-12  # rad/s
    assert found.f < 3e-10  # m/s^2
    assert found.v < 3e-12  # m/s


@pytest.mark.parametrize("motion", [SWELL, MOTION], ids=["swell", "segments"])
def test_closes(motion: object) -> None:
    """A sensor on a vibrating body, navigated, ends where it ends."""
    vibrations = Coning(0.1 * DEG, 10.0, "x"), Sculling(0.05 * DEG, 15.0, 1.0), Shaking(20.0, 2.0)
    arm = Mounted(Vibrating(motion, vibrations), LEVER, MOUNTING)  # type: ignore[arg-type]
    error = closing(arm, np.arange(0.0, 60.0, 0.004))
    # m: 12 samples a period of 20 Hz leave the engine 1e-7 of the coning and sculling
    assert max(error.horizontal, error.vertical) < 1e-6


def test_vibration_moves_the_truth() -> None:
    """Attitude, velocity and place swing by the amplitudes, not only what sensors feel."""
    still = Segments(Start(0.7, -1.9, 20.0, heading=0.0), [Still(2.0)])
    moving = Vibrating(still, [Shaking(5.0, displacement=0.01, axis="z"), Coning(0.03, 4.0, "z")])
    truth = true_trajectory(moving, np.linspace(0.0, 2.0, 2001))
    assert (truth.h - 20.0).min() == pytest.approx(-0.01, abs=1e-7)  # m
    assert (truth.h - 20.0).max() == pytest.approx(0.01, abs=1e-7)
    assert np.abs(truth.v_eb_n[:, 2]).max() == pytest.approx(0.01 * 10.0 * np.pi, rel=1e-6)
    down = 1.0 - 2.0 * (truth.q_nb[:, 1] ** 2 + truth.q_nb[:, 2] ** 2)
    assert np.arccos(down) == pytest.approx(0.03, abs=1e-12)  # rad


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_coning_drift(axis: str) -> None:
    """Over whole turns the rate about the cone's axis is -w (1 - cos a) plus the Earth's part."""
    start = Start(-0.7, 1.0, 0.0, heading=0.4, roll=0.2, pitch=0.3)
    still, half, hz = Segments(start, [Still(2.0)]), 0.1, 8.0
    edges = np.linspace(0.0, 2.0, 401)
    moving = Vibrating(still, [Coning(half, hz, axis, 0.3)])  # type: ignore[arg-type]
    mean = imu_increments(moving, edges)[0].sum(axis=0) / 2.0
    earth = imu_rates(still, [1.0])[0][0]
    k = "xyz".index(axis)
    expected = -2.0 * np.pi * hz * (1.0 - np.cos(half)) + np.cos(half) * earth[k]
    assert mean[k] == pytest.approx(expected, rel=1e-14)
    others = np.delete(mean, k)
    assert np.abs(others).max() < 1e-4  # rad/s: the Earth's


@pytest.mark.parametrize("lead", [0.0, 0.7, np.pi])
def test_sculling_force(lead: float) -> None:
    """Over whole periods rotation and force rectify to F J1(A) cos(lead), next to gravity."""
    start = Start(0.9, 1.0, 0.0, heading=0.4)
    still, angle, force, hz = Segments(start, [Still(2.0)]), 0.05, 4.0, 6.0
    moving = Vibrating(still, [Sculling(angle, hz, acceleration=force, lead=lead)])
    mean = imu_increments(moving, np.linspace(0.0, 2.0, 401))[1].sum(axis=0) / 2.0
    g = -imu_rates(still, [1.0])[1][0, 2]
    expected = -force * j1(angle) * np.cos(lead) - g * j0(angle)
    # m/s^2: the Earth's rotation couples 7e-5 rad/s with 0.1 m/s, 0.05 rad out of phase
    assert mean[2] == pytest.approx(expected, abs=5e-7)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Coning(0.1, 0.0), "frequency must be positive, got 0.0 Hz"),
        (lambda: Coning(np.nan, 1.0), "half_angle must be finite, got nan"),
        (lambda: Coning(0.1, 1.0, "roll"), "must be x, y or z, got 'roll'"),
        (lambda: Sculling(0.1, 1.0), "give one of acceleration and displacement"),
        (lambda: Shaking(1.0, 2.0, 3.0), "give one of acceleration and displacement"),
        (lambda: Mounted(SWELL, (1.0, 2.0)), "lever_arm_b must be 3 finite numbers"),
        (lambda: Mounted(SWELL, q_bs=(1.0, 0.0, 0.0, np.inf)), "q_bs must be 4 finite numbers"),
        (lambda: Mounted(SWELL, q_bs=(1.0, 0.0, 0.0, 0.1)), "q_bs must be a unit quaternion"),
    ],
)
def test_refusals(make: Callable[[], object], message: str) -> None:
    """Each wrong number is named."""
    with pytest.raises(ValueError, match=message):
        make()
