"""Closed forms of error growth against the equations they solve, and fitted power laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from navgrade.compare.growth import FLOOR, Level, fit_power, superposed

LEVEL = Level.at(math.radians(-33.5), 250.0)
T = np.array([1.0, 60.0, 600.0, 3600.0, 7200.0])


def integrated(rates: object, start: list[float]) -> np.ndarray:
    """First component of the solution at T, to 1e-10 of its size."""
    found = solve_ivp(rates, (0.0, T[-1]), start, t_eval=T, method="DOP853", rtol=1e-12, atol=1e-14)
    return np.asarray(found.y[0])


def test_radius_and_gravity() -> None:
    """Printed WGS-84 values: radii at 30° and 45° bracket those at 33.5°; g from the table."""
    assert 6.367e6 < LEVEL.R < 6.382e6
    assert Level.at(math.radians(-33.5), 2500.25).g == pytest.approx(9.788362616, abs=1e-8)  # m/s²
    assert (
        pytest.approx(
            math.sqrt(6367381.815619549 * 6388838.290121148),
            abs=1e-3,  # m
        )
        == Level.at(math.radians(45.0), 0.0).R
    )


def test_horizontal_forms_solve_the_schuler_pendulum() -> None:
    """x'' = b - g tilt, tilt' = x'/R - eps, for an acceleration, a rate and a start."""
    R, g = LEVEL.R, LEVEL.g

    def pendulum(b: float, eps: float) -> object:
        return lambda t, y: [y[1], b - g * y[2], y[1] / R - eps]

    b, eps = 5e-4, 5e-8  # m/s², rad/s
    for closed, truth in (
        (LEVEL.by_acceleration(b, T), integrated(pendulum(b, 0.0), [0.0, 0.0, 0.0])),
        (LEVEL.by_rate(eps, T), integrated(pendulum(0.0, eps), [0.0, 0.0, 0.0])),
        (LEVEL.after_push(T), integrated(pendulum(0.0, 0.0), [0.0, 1.0, 0.0])),
        (LEVEL.after_tilt(T), integrated(pendulum(0.0, 0.0), [0.0, 0.0, -1.0])),
        (LEVEL.after_step(T), integrated(pendulum(0.0, 0.0), [1.0, 0.0, 1.0 / R])),
    ):
        assert closed == pytest.approx(truth, rel=1e-6)  # after 1 s eight digits are lost


def test_vertical_form_solves_the_unstable_channel() -> None:
    truth = integrated(lambda t, y: [y[1], 2.0 * LEVEL.g / LEVEL.R * y[0]], [0.0, 1.0])
    assert LEVEL.after_lift(T) == pytest.approx(truth, rel=1e-8)


def test_a_driver_that_varies_is_superposed() -> None:
    """A force that comes and goes, over the Earth, against the pendulum driven by it."""
    R, g = LEVEL.R, LEVEL.g

    def rates(t: float, y: list[float]) -> list[float]:
        return [y[1], 1e-3 * math.sin(t / 300.0) - g * y[2], y[1] / R]

    t = np.linspace(0.0, T[-1], 7201)
    found = superposed(LEVEL.after_push, t, 1e-3 * np.sin(t / 300.0), T)
    assert found[1:] == pytest.approx(integrated(rates, [0.0, 0.0, 0.0])[1:], rel=1e-3)
    sides = superposed(LEVEL.after_push, t, np.stack([0 * t, 1e-3 * np.sin(t / 300.0)], -1), T)
    assert sides[:, 1] == pytest.approx(found, rel=1e-9)  # summed in another order
    assert not sides[:, 0].any()


def test_flat_forms_are_the_first_terms_of_the_earth_s() -> None:
    """The relative excess of the flat form is (w t)²/12 and (w t)²/20."""
    t = np.array([60.0])
    excess = (LEVEL.schuler * t) ** 2
    ratio = 0.5 * t**2 / LEVEL.by_acceleration(1.0, t)
    assert ratio - 1.0 == pytest.approx(excess / 12.0, rel=0.01)
    ratio = LEVEL.g * 1e-6 * t**3 / 6.0 / LEVEL.by_rate(1e-6, t)
    assert ratio - 1.0 == pytest.approx(excess / 20.0, rel=0.01)


def test_flat_world_at_rest_at_45_degrees() -> None:
    """g Omega cos L t³/6, printed: 18.2 m after 60 s and 2275 m after 300 s."""
    level = Level.at(math.radians(45.0), 0.0)
    eps = 7.292115e-5 * math.cos(math.radians(45.0))  # rad/s
    t = np.linspace(0.0, 300.0, 3001)
    found = superposed(level.flat_after_tilt, t, np.full_like(t, eps), np.array([60.0, 300.0]))
    assert found == pytest.approx([18.2, 2275.0], rel=3e-3)


def test_noise_is_that_of_the_impulse_response() -> None:
    """A random walk of angle or velocity, summed over its impulses."""
    w, t = LEVEL.schuler, 2000.0
    tau = (np.arange(200_000) + 0.5) * 0.01
    by_rate = LEVEL.R * (1.0 - np.cos(w * tau))
    by_force = np.sin(w * tau) / w
    for closed, response in (
        (LEVEL.by_rate_noise(1e-6, np.array([t])), by_rate),
        (LEVEL.by_acceleration_noise(1e-6, np.array([t])), by_force),
    ):
        assert closed[0] == pytest.approx(1e-6 * math.sqrt(np.sum(response**2) * 0.01), rel=1e-5)


def test_a_power_law_is_found() -> None:
    t = np.geomspace(0.01, 3600.0, 200)
    error = 2.5e-4 * t**2.7
    error[t > 1300.0] = 1.0  # bounded later on: not part of the fit
    assert fit_power(t, error) == pytest.approx((2.5e-4, 2.7), rel=1e-9)


def test_rounding_is_not_fitted() -> None:
    t = np.geomspace(0.01, 3600.0, 200)
    assert all(math.isnan(x) for x in fit_power(t, np.full_like(t, 0.5 * FLOOR)))
    assert all(math.isnan(x) for x in fit_power(t, np.full_like(t, np.nan)))
