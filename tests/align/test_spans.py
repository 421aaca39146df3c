"""Spans against the definition, sample by sample."""

from time import perf_counter

import numpy as np
import pytest

from align.spans import SpanReducer, Spans, natural_length, spans_of
from tests.align.at_rest import Array

FIELDS = ("end", "dt", "count", "omega_ib_b", "f_ib_b", "omega_var", "f_var")


def stream(rng: np.random.Generator, count: int) -> tuple[Array, Array, Array, Array]:
    """Uneven samples with two holes, one of them many spans long."""
    dt = rng.uniform(0.002, 0.02, count)  # s
    hole = np.zeros(count)
    hole[count // 3], hole[count // 2] = 0.31, 7.7  # s
    omega = 1e-4 * rng.normal(size=(count, 3)) + [1e-5, -2e-5, 7e-5]
    f = 1e-3 * rng.normal(size=(count, 3)) + [0.3, -0.2, -9.8]
    return 41.0 + np.cumsum(dt + hole), dt, omega, f


def test_every_span_against_the_definition() -> None:
    t, dt, omega, f = stream(np.random.default_rng(1), 4000)
    found = spans_of(dt, omega, f, 0.25, t)
    origin = t[0] - dt[0]
    at = np.floor((t - dt / 2 - origin) / 0.25).astype(int)
    held = np.unique(at)
    assert len(found) == len(held) < at[-1]
    for row, k in enumerate(held):
        rows = at == k
        # A few hundred roundings of times up to 90 s, and of 9.8 m/s^2.
        assert found.end[row] == pytest.approx(origin + 0.25 * (k + 1), rel=0.0, abs=1e-12)
        assert found.start[row] == pytest.approx(origin + 0.25 * k, rel=0.0, abs=1e-12)
        assert found.dt[row] == pytest.approx(dt[rows].sum(), rel=1e-13)
        assert found.count[row] == rows.sum()
        for name, values in (("omega", omega), ("f", f)):
            mean = np.average(values[rows], axis=0, weights=dt[rows])
            square = np.average((values[rows] - mean) ** 2, axis=0, weights=dt[rows])
            variance = square * rows.sum() / (rows.sum() - 1)
            np.testing.assert_allclose(
                getattr(found, f"{name}_ib_b")[row], mean, rtol=0.0, atol=1e-13
            )
            # Two roundings of 9.8 m/s^2 beside a scatter of 1e-3.
            np.testing.assert_allclose(getattr(found, f"{name}_var")[row], variance, rtol=1e-11)


def test_blocks_end_anywhere_and_change_no_bit() -> None:
    rng = np.random.default_rng(2)
    columns = stream(rng, 5000)
    whole = spans_of(*columns[1:], 0.25, columns[0])
    for size in (1, 7, 1234):
        reducer = SpanReducer(0.25)
        for first in range(0, 5000, size):
            reducer.add(*(x[first : first + size] for x in columns))
            if first == 7 * size:
                reducer.finish()  # a look in between changes nothing
        found = reducer.finish()
        for name in FIELDS:
            assert np.array_equal(getattr(found, name), getattr(whole, name)), name


def test_variance_times_interval_is_the_density_of_white_noise() -> None:
    """Samples of uneven length, each as noisy as its length makes it."""
    rng = np.random.default_rng(3)
    dt = rng.choice([0.002, 0.02], 200_000)  # s
    noise = rng.normal(size=(dt.size, 3)) / np.sqrt(dt[:, None])
    found = spans_of(dt, 3e-6 * noise, 2e-4 * noise - 9.8, 1.0)
    density = found.f_var * (found.dt / found.count)[:, None]
    # 200,000 samples x 3 axes: the variance is known to 0.2 %, x4.
    assert np.mean(density) == pytest.approx(4e-8, rel=0.008)
    rates = found.omega_var * (found.dt / found.count)[:, None]
    np.testing.assert_allclose(rates, density * (3e-6 / 2e-4) ** 2, rtol=1e-8)


def test_a_sample_across_an_edge_belongs_where_its_midpoint_lies() -> None:
    dt = np.array([0.5, 0.8, 0.6, 0.6])  # s: midpoints 0.25, 0.9, 1.6, 2.2
    values = np.array([1.0, 2.0, 4.0, 8.0])[:, None] * np.ones(3)
    found = spans_of(dt, values, -values, 1.0)
    np.testing.assert_allclose(found.dt, [1.3, 0.6, 0.6], rtol=1e-15)
    np.testing.assert_allclose(found.f_ib_b[:, 0], [-2.1 / 1.3, -4.0, -8.0], rtol=1e-15)
    assert found.count.tolist() == [2, 1, 1]
    assert np.all(found.omega_var[1:] == 0.0)


def test_rows_can_be_chosen() -> None:
    t, dt, omega, f = stream(np.random.default_rng(4), 500)
    found = spans_of(dt, omega, f, 0.25, t)
    chosen = found[found.dt > 0.2]
    assert isinstance(chosen, Spans)
    assert 0 < len(chosen) < len(found)
    assert np.array_equal(chosen.f_var, found.f_var[found.dt > 0.2])
    assert np.array_equal(found[3:5].start, found.start[3:5])


def test_no_samples_no_spans() -> None:
    reducer = SpanReducer(0.25)
    assert len(reducer.finish()) == 0
    reducer.add(np.empty(0), np.empty(0), np.empty((0, 3)), np.empty((0, 3)))
    assert reducer.finish().f_var.shape == (0, 3)


@pytest.mark.parametrize(("interval", "length"), [(0.001, 0.25), (1.0 / 64.0, 0.25), (0.1, 1.0)])
def test_natural_length(interval: float, length: float) -> None:
    assert natural_length(np.full(99, interval)) == pytest.approx(length, rel=1e-15)


@pytest.mark.parametrize("length", [0.0, -1.0, np.nan, np.inf])
def test_a_length_that_is_none(length: float) -> None:
    with pytest.raises(ValueError, match="length of a span must be positive"):
        SpanReducer(length)


def test_time_must_not_run_back() -> None:
    t, dt, omega, f = stream(np.random.default_rng(5), 500)
    t[-1] = t[0]
    with pytest.raises(ValueError, match="must not run back"):
        spans_of(dt, omega, f, 0.25, t)


def test_half_an_hour_at_1_khz() -> None:
    n = 1_800_000
    dt, values = np.full(n, 1e-3), np.ones((n, 3))
    spans_of(dt[:9], values[:9], values[:9])
    began = perf_counter()
    assert len(spans_of(dt, values, values)) == pytest.approx(7200, abs=1)
    assert perf_counter() - began < 0.6  # s; 0.04 on two cores of 2023
