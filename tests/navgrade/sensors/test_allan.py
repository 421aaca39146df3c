"""The Allan deviation of a simulated still IMU is the one its errors promise, for every grade.

Closed forms after IEEE Std 952-1997, annex C. Every process is looked at alone, so that none can
hide another. The bounds are those of a chi-square variable with as many degrees of freedom as there
are pairs of separate clusters on three axes, fewer than the overlapping estimator has, at a false
alarm of one in 100,000 for each number.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from navgrade import ImuSamples
from navgrade.sensors import GRADES, ImuErrors, Sensor, TriadErrors

Array = NDArray[np.float64]
COUNT = 40_000
CLUSTERS = (1, 2, 5, 20, 100, 400)
FALSE_ALARM = 1e-5
PARTS = ("gyro", "accel")


def allan_variance(increments: Array, dt: float, m: int) -> Array:
    """Overlapping, of clusters of m intervals, for each axis."""
    angle = np.concatenate([np.zeros((1, 3)), np.cumsum(increments, axis=0)])
    second = angle[2 * m :] - 2.0 * angle[m:-m] + angle[: -2 * m]
    variance: Array = np.mean(second**2, axis=0) / (2.0 * (m * dt) ** 2)
    return variance


def white(errors: TriadErrors, tau: float) -> float:
    return errors.white**2 / tau


def walk(errors: TriadErrors, tau: float) -> float:
    return errors.walk**2 * tau / 3.0


def markov(errors: TriadErrors, tau: float) -> float:
    x = tau / errors.markov_time
    bracket = 1.0 - (3.0 - 4.0 * math.exp(-x) + math.exp(-2.0 * x)) / (2.0 * x)
    return 2.0 * errors.markov**2 / x * bracket


def still(dt: float, count: int = COUNT) -> ImuSamples:
    zero = np.zeros((count, 3))
    t = dt * np.arange(1, count + 1)
    return ImuSamples(t=t, dt=np.full(count, dt), gyro=zero, accel=zero, kind="increment")


def alone(errors: TriadErrors, *kept: str) -> TriadErrors:
    """Only these processes."""
    others = {"white", "walk", "markov", "quantum", "resolution", "bias_sigma"} - set(kept)
    return replace(errors, **dict.fromkeys(others, 0.0))


def measured(grade: str, part: str, dt: float, *kept: str) -> Array:
    errors = getattr(GRADES[grade].errors, part)
    sensor = Sensor(ImuErrors(**{part: alone(errors, *kept)}), seed=20260101)
    values: Array = getattr(sensor.measure(still(dt)), part)
    return values


def check(found: Array, expected: float, m: int, what: str) -> None:
    freedom = 3 * (COUNT // m - 1)
    low, high = (chi2.ppf(p, freedom) / freedom for p in (FALSE_ALARM, 1.0 - FALSE_ALARM))
    ratio = float(found.mean()) / expected
    assert low < ratio < high, f"{what}: {ratio:.4f} outside {low:.4f} to {high:.4f}"


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("grade", GRADES)
def test_random_walks_of_angle_and_velocity(grade: str, part: str) -> None:
    errors = getattr(GRADES[grade].errors, part)
    found = measured(grade, part, 0.005, "white")
    for m in CLUSTERS:
        check(allan_variance(found, 0.005, m), white(errors, m * 0.005), m, f"{grade} {part} {m}")


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("grade", GRADES)
def test_random_walk_of_the_bias(grade: str, part: str) -> None:
    errors = getattr(GRADES[grade].errors, part)
    found = measured(grade, part, 2.0, "walk")
    for m in CLUSTERS:
        check(allan_variance(found, 2.0, m), walk(errors, m * 2.0), m, f"{grade} {part} {m}")


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize("grade", GRADES)
def test_gauss_markov_plateau(grade: str, part: str) -> None:
    """From a fiftieth of the correlation time to eight times it; the plateau at 1.89 of it."""
    errors = getattr(GRADES[grade].errors, part)
    dt = errors.markov_time / 50.0
    found = measured(grade, part, dt, "markov")
    for m in (*CLUSTERS[:-1], 95):
        check(allan_variance(found, dt, m), markov(errors, m * dt), m, f"{grade} {part} {m}")
    assert math.sqrt(markov(errors, 1.8926 * errors.markov_time)) == pytest.approx(
        0.6174 * errors.markov, rel=1e-4
    )
    dt = 1.5 * errors.markov_time  # intervals longer than the correlation
    found = measured(grade, part, dt, "markov")
    for m in CLUSTERS:
        check(allan_variance(found, dt, m), markov(errors, m * dt), m, f"{grade} {part} long {m}")


@pytest.mark.parametrize("grade", GRADES)
def test_everything_together_is_the_sum(grade: str) -> None:
    """At 10 s, where no process rules alone."""
    errors = GRADES[grade].errors.gyro
    found = measured(grade, "gyro", 10.0, "white", "walk", "markov")
    for m in CLUSTERS:
        tau = 10.0 * m
        expected = white(errors, tau) + walk(errors, tau) + markov(errors, tau)
        check(allan_variance(found, 10.0, m), expected, m, f"{grade} {m}")


@pytest.mark.parametrize("grade", GRADES)
def test_rates_and_averages_have_the_same_white_noise(grade: str) -> None:
    """N / sqrt(dt), lecture 2 of the course the literature calls VIO; 120,000 numbers, 5 sigma."""
    errors = GRADES[grade].errors.gyro
    for kind in ("rate", "average"):
        sensor = Sensor(ImuErrors(gyro=alone(errors, "white")), seed=1)
        noise = sensor.measure(replace(still(0.005), kind=kind)).gyro  # type: ignore[arg-type]
        expected = errors.white / math.sqrt(0.005)
        assert abs(noise.std() / expected - 1.0) < 5.0 / math.sqrt(2.0 * noise.size)


def test_the_sheet_of_a_grade_in_si() -> None:
    """Some numbers by hand: 0.0035 deg/h, 0.125 deg/sqrt(h), 33.7 ug/sqrt(Hz), 2^-33 rad."""
    tactical = GRADES["tactical"].errors
    assert GRADES["navigation"].errors.gyro.bias_sigma == pytest.approx(1.6968e-8, rel=1e-4)
    assert tactical.gyro.white == pytest.approx(3.6361e-5, rel=1e-4)
    assert tactical.accel.white == pytest.approx(3.302e-4, rel=2e-3)
    assert tactical.gyro.quantum == pytest.approx(2.0**-33, rel=1e-5)
    assert tactical.gyro.walk == pytest.approx(math.radians(0.2) / 3600.0 / 60.0, rel=1e-12)


def test_every_number_of_a_grade_has_a_source() -> None:
    for name, grade in GRADES.items():
        assert name == grade.name
        assert len(grade.sheet) == 18
        assert all(figure.value > 0.0 and figure.source for figure in grade.sheet.values())
