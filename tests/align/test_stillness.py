"""The stillness statistic against motions whose scatter is known."""

import numpy as np
import pytest

from align.stillness import FORCE_LIMIT, RATE_LIMIT, Stillness, assess, span_means
from tests.align.at_rest import DEG, Array


def uneven(rng: np.random.Generator, count: int) -> Array:
    return rng.uniform(0.004, 0.02, count)  # s


def test_means_are_weighted_by_the_intervals() -> None:
    """A span's mean is its integral over its length, however the samples are spaced."""
    dt = np.array([0.3, 0.7, 0.2, 0.2, 0.6, 0.5, 0.5])  # s: three spans of 1 s
    values = np.array([1.0, 2.0, -1.0, 0.0, 5.0, 7.0, 9.0])[:, None] * [1.0, 10.0, -3.0]
    means = span_means(dt, values, 1.0)
    expected = np.array([1.7, 2.8, 8.0])[:, None] * [1.0, 10.0, -3.0]
    # Four roundings of values up to 90.
    np.testing.assert_allclose(means, expected, rtol=0.0, atol=5e-14)


@pytest.mark.parametrize(
    ("total", "span", "count"), [(10.0, 1.0, 10), (9.97, 1.0, 9), (0.5, 1.0, 1), (9.5, 2.0, 4)]
)
def test_the_rest_joins_the_last_span(total: float, span: float, count: int) -> None:
    steps = round(total / 0.01)
    means = span_means(np.full(steps, 0.01), np.ones((steps, 3)), span)
    # A mean of ones, a thousand roundings.
    np.testing.assert_allclose(means, np.ones((count, 3)), rtol=0.0, atol=1e-13)


def test_a_span_without_a_sample_is_left_out() -> None:
    means = span_means(np.array([0.5, 2.9, 0.6]), np.diag([1.0, 2.0, 3.0]), 1.0)
    assert len(means) < 4
    assert np.all(np.isfinite(means))
    assert set(means.ravel()) <= {0.0, 1.0, 2.0, 3.0}


def test_scatter_of_a_square_wave_between_seconds() -> None:
    """Plus and minus a in turn: the scatter of one axis is a, of all the root sum square."""
    dt = np.full(2000, 0.01)  # s
    sign = np.where((np.arange(2000) // 100) % 2, 1.0, -1.0)[:, None]
    found = assess(dt, sign * [1e-4, -2e-4, 2e-4] + 0.3, sign * [0.02, 0.03, 0.06] - 9.8)
    # A thousand roundings of 9.8 m/s^2 in a span, most of which cancel.
    assert found.force == pytest.approx(0.07, rel=0.0, abs=1e-12)
    assert found.rate == pytest.approx(3e-4, rel=0.0, abs=1e-13)


@pytest.mark.parametrize("frequency", [1.0, 7.0, 23.0])  # Hz
def test_vibration_faster_than_the_span_averages_out(frequency: float) -> None:
    """An idling engine, whole periods in a second, 1 m/s^2 and 1 deg/s."""
    t = 0.005 * np.arange(1, 12_001)
    shake = np.sin(2.0 * np.pi * frequency * t)[:, None] * np.ones(3)
    found = assess(np.full(t.size, 0.005), DEG * shake, shake)
    assert found.force < 1e-3 * FORCE_LIMIT
    assert found.rate < 1e-3 * RATE_LIMIT


def test_white_noise_scatters_as_the_root_of_the_span() -> None:
    rng = np.random.default_rng(70)
    dt = uneven(rng, 80_000)
    noise = rng.normal(size=(dt.size, 3)) / np.sqrt(dt[:, None])
    found = assess(dt, 1e-6 * noise, 1e-4 * noise)
    # Three axes of 1e-4 (m/s)/sqrt(s) in one second; 960 spans x 3 axes are known to 1.3 %, x3.
    assert found.force == pytest.approx(np.sqrt(3.0) * 1e-4, rel=0.04)
    assert found.rate == pytest.approx(np.sqrt(3.0) * 1e-6, rel=0.04)


@pytest.mark.parametrize(
    ("force", "rate", "verdict"),
    [
        (0.999 * FORCE_LIMIT, 0.999 * RATE_LIMIT, True),
        (1.001 * FORCE_LIMIT, 0.0, False),
        (0.0, 1.001 * RATE_LIMIT, False),
        (float("nan"), 0.0, False),
    ],
)
def test_both_limits_count(force: float, rate: float, verdict: bool) -> None:
    assert Stillness(force=force, rate=rate).is_still is verdict


def test_limits_lie_between_a_parked_car_and_a_gentle_drive() -> None:
    """What the comments say of a real car, m/s^2 and deg/s."""
    assert 0.009 < FORCE_LIMIT < 0.13
    assert 0.016 < RATE_LIMIT / DEG < 0.3
