"""The error model against closed forms, a naive twin, and its own blocks."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.typing import NDArray

from navgrade import ImuSamples
from navgrade.sensors import ImuErrors, Sensor, TriadErrors
from navgrade.sensors.processes import tanh_rest

Array = NDArray[np.float64]
KINDS = ("increment", "average", "rate")
RNG = np.random.default_rng(7)
UNEVEN = RNG.uniform(0.002, 0.3, 700)  # s
EVERYTHING = TriadErrors(
    bias=(0.01, -0.02, 0.03),
    scale=(1e-3, -2e-3, 5e-4),
    misalignment=((0.0, 1e-3, -2e-3), (3e-3, 0.0, 4e-4), (-5e-4, 6e-4, 0.0)),
    white=2e-3,
    walk=4e-3,
    markov=0.05,
    markov_time=0.4,
    quantum=1e-3,
    resolution=2e-3,
    bias_sigma=0.01,
    scale_sigma=1e-3,
    misalignment_sigma=2e-3,
)


def samples(dt: Array, kind: str, seed: int = 3) -> ImuSamples:
    """Numbers with all their digits in use."""
    gyro, accel = np.random.default_rng(seed).standard_normal((2, len(dt), 3))
    return ImuSamples(t=np.cumsum(dt), dt=dt, gyro=gyro, accel=accel, kind=kind, epoch_ns=17)  # type: ignore[arg-type]


def still(dt: Array, kind: str) -> ImuSamples:
    zero = np.zeros((len(dt), 3))
    return ImuSamples(t=np.cumsum(dt), dt=dt, gyro=zero, accel=zero, kind=kind)  # type: ignore[arg-type]


def of_gyro(errors: TriadErrors) -> ImuErrors:
    return ImuErrors(gyro=errors)


def twin(errors: TriadErrors, true: Array, dt: Array, kind: str, seed: int, triad: int) -> Array:
    """The same model sample by sample, its noise by the Cholesky factor of the textbook's
    covariance of a process and its integral, in 40 digits."""

    def source(key: int) -> np.random.Generator:
        return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(triad, key)))

    bias = errors.bias + errors.bias_sigma * source(0).standard_normal(3)
    scale = errors.scale + errors.scale_sigma * source(1).standard_normal(3)
    small = errors.misalignment_sigma * source(2).standard_normal((3, 3))
    response = np.array(errors.misalignment)
    for i in range(3):
        for j in range(3):
            response[i, j] = 1.0 + scale[i] if i == j else response[i, j] + small[i, j]
    white, walk, markov = source(3), source(4), source(5)
    b = np.zeros(3)
    m = errors.markov * markov.standard_normal(3)
    left = np.zeros(3)
    rows = []
    mp.dps = 40
    for x, step in zip(true, dt, strict=True):
        h, T = mpf(step), mpf(errors.markov_time)
        n = white.standard_normal(3) * errors.white
        w = walk.standard_normal((2, 3)) * errors.walk
        v = markov.standard_normal((2, 3)) * errors.markov
        e = mp.exp(-h / T)
        l11 = mp.sqrt(1 - e**2)
        l21 = T * (1 - e) ** 2 / l11
        l22 = mp.sqrt(T**2 * (2 * h / T - 3 + 4 * e - e**2) - l21**2)
        b_integral = b * step + w[0] * float(h**1.5 / 2) + w[1] * float(h**1.5 / mp.sqrt(12))
        m_integral = m * float(T * (1 - e)) + v[0] * float(l21) + v[1] * float(l22)
        b = b + w[0] * math.sqrt(step)
        m = m * float(e) + v[0] * float(l11)
        if kind == "rate":
            y = response @ x + bias + n / math.sqrt(step) + b + m
        else:
            length = 1.0 if kind == "increment" else step
            y = response @ x + bias * (step / length)
            y = y + (n * math.sqrt(step) + b_integral + m_integral) / length
        if kind == "increment":
            pulses = np.round((left + y) / errors.quantum)
            left = left + y - pulses * errors.quantum
            y = pulses * errors.quantum
        else:
            y = np.round(y / errors.resolution) * errors.resolution
        rows.append(y)
    return np.array(rows)


@pytest.mark.parametrize("kind", KINDS)
def test_every_source_together_is_that_of_a_naive_twin(kind: str) -> None:
    """To rounding; a pulse or a digit may fall to the other side of a half, hence the count."""
    true = samples(UNEVEN, kind)
    errors = ImuErrors(EVERYTHING, replace(EVERYTHING, white=3e-3, markov_time=2.0))
    measured = Sensor(errors, seed=5).measure(true)
    for triad, part, values, out in (
        (0, errors.gyro, true.gyro, measured.gyro),
        (1, errors.accel, true.accel, measured.accel),
    ):
        naive = twin(part, values, UNEVEN, kind, 5, triad)
        apart = np.abs(out - naive)
        last = part.quantum if kind == "increment" else part.resolution
        assert np.count_nonzero(apart > 1e-12) <= 2, "of two thousand numbers"
        assert apart.max() <= 1.001 * last


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("ends", [(1, 2, 3, 699), (64, 128, 500), (350,)])
def test_what_comes_out_does_not_depend_on_where_blocks_end(
    kind: str, ends: tuple[int, ...]
) -> None:
    true = samples(UNEVEN, kind)
    errors = ImuErrors(EVERYTHING, EVERYTHING)
    whole = Sensor(errors, seed=1).measure(true)
    sensor = Sensor(errors, seed=1)
    edges = (0, *ends, len(true))
    parts = [sensor.measure(true[a:b]) for a, b in pairwise(edges)]
    for name in ("gyro", "accel", "t", "dt"):
        joined = np.concatenate([getattr(part, name) for part in parts])
        assert joined.tobytes() == getattr(whole, name).tobytes()
    assert (whole.kind, whole.epoch_ns) == (kind, 17)


@pytest.mark.parametrize(
    "off", ["white", "walk", "markov", "bias_sigma", "scale_sigma", "misalignment_sigma"]
)
def test_switching_one_source_off_leaves_the_others(off: str) -> None:
    """The difference is what that source alone adds, to rounding of numbers near 1."""
    smooth = replace(EVERYTHING, resolution=0.0, quantum=0.0)
    true = still(UNEVEN, "average")
    alone = TriadErrors(markov_time=0.4, **{off: getattr(smooth, off)})

    def gyro(errors: TriadErrors) -> Array:
        return Sensor(of_gyro(errors), seed=9).measure(true).gyro

    difference = gyro(smooth) - gyro(replace(smooth, **{off: 0.0}))
    np.testing.assert_allclose(difference, gyro(alone), rtol=0.0, atol=1e-15)


def test_seeds() -> None:
    true = samples(UNEVEN, "increment")
    errors = ImuErrors(EVERYTHING, EVERYTHING)
    first, again, other = (Sensor(errors, seed).measure(true) for seed in (0, 0, 1))
    assert first.gyro.tobytes() == again.gyro.tobytes()
    assert not np.any(np.all(first.gyro == other.gyro, axis=1))
    alike = replace(EVERYTHING, quantum=0.0)
    noise = Sensor(ImuErrors(alike, alike), 0).measure(still(UNEVEN, "increment"))
    assert abs(np.corrcoef(noise.gyro[:, 0], noise.accel[:, 0])[0, 1]) < 0.2, (
        "gyro and accel differ"
    )


def test_scale_and_misalignment_are_exact() -> None:
    """Rounding of three products of numbers below 100."""
    errors = TriadErrors(
        bias=(1.0, 2.0, 3.0),
        scale=(0.01, 0.02, -0.03),
        misalignment=((0.0, 0.1, 0.2), (0.3, 0.0, 0.4), (0.5, 0.6, 0.0)),
    )
    true = ImuSamples(
        t=[0.5], dt=[0.5], gyro=[[10.0, 20.0, 40.0]], accel=[[1.0, 0.0, 0.0]], kind="rate"
    )
    measured = Sensor(ImuErrors(errors, errors), 0).measure(true)
    np.testing.assert_allclose(measured.gyro, [[21.1, 41.4, 58.8]], rtol=1e-15)
    np.testing.assert_allclose(measured.accel, [[2.01, 2.3, 3.5]], rtol=1e-15)
    increments = ImuSamples(
        t=[0.5], dt=[0.5], gyro=[[5.0, 10.0, 20.0]], accel=[[0.5, 0.0, 0.0]], kind="increment"
    )
    halves = Sensor(ImuErrors(errors, errors), 0).measure(increments)
    np.testing.assert_allclose(halves.gyro, measured.gyro / 2.0, rtol=1e-15)


def test_no_errors_change_nothing() -> None:
    true = samples(UNEVEN, "increment")
    measured = Sensor(ImuErrors(), 4).measure(true)
    assert measured.gyro.tobytes() == true.gyro.tobytes()
    assert measured.accel.tobytes() == true.accel.tobytes()


def test_the_run_tells_what_it_drew() -> None:
    """Over 500 runs, the spread of the constants within 5 sigma of its own scatter."""
    errors = TriadErrors(bias_sigma=0.3, scale_sigma=2e-3, misalignment_sigma=5e-3)
    units = [Sensor(of_gyro(errors), seed).errors.gyro for seed in range(500)]
    for values, sigma, count in (
        (np.array([unit.bias for unit in units]), 0.3, 1500),
        (np.array([unit.scale for unit in units]), 2e-3, 1500),
        (np.array([unit.misalignment[~np.eye(3, dtype=bool)] for unit in units]), 5e-3, 3000),
    ):
        assert abs(values.std() / sigma - 1.0) < 5.0 / math.sqrt(2.0 * count)
        assert abs(values.mean()) < 5.0 * sigma / math.sqrt(count)
    assert units[0].bias_sigma == units[0].scale_sigma == units[0].misalignment_sigma == 0.0
    true = still(np.array([0.1]), "rate")
    assert np.all(Sensor(of_gyro(errors), 3).measure(true).gyro == units[3].bias)


def test_pulses_lose_nothing() -> None:
    """The sum of what was counted stays within half a pulse of what was to be counted."""
    dt = np.full(20_000, 0.005)
    quantum = 1e-4
    rate = np.sqrt([9e-6, 5e-7, 1.1e-5]) * [1.001, -1.0, 1.0]  # 0.15, -0.035, 0.17 pulses
    true = ImuSamples(
        t=np.cumsum(dt), dt=dt, gyro=rate * dt[:, None], accel=rate * dt[:, None], kind="increment"
    )
    counted = Sensor(of_gyro(TriadErrors(quantum=quantum)), 0).measure(true).gyro
    pulses = counted / quantum
    assert np.abs(pulses - np.rint(pulses)).max() < 1e-9
    error = np.cumsum(counted, axis=0) - np.cumsum(true.gyro, axis=0)
    assert np.abs(error).max() <= 0.5000001 * quantum
    assert np.abs(error.mean(axis=0)).max() < 0.02 * quantum, "neither side is preferred"


def test_rates_are_rounded_to_the_nearest_digit() -> None:
    true = samples(UNEVEN, "rate")
    rounded = Sensor(of_gyro(TriadErrors(resolution=0.25)), 0).measure(true).gyro
    assert np.all(rounded * 4.0 == np.rint(rounded * 4.0))
    assert np.abs(rounded - true.gyro).max() <= 0.125


def test_the_small_difference_keeps_its_digits() -> None:
    """1e-14 of it, from a thousandth of a microsecond over an hour to many correlation times."""
    mp.dps = 60
    for u in [*np.geomspace(1e-12, 40.0, 90), 0.1, np.nextafter(0.1, 1.0)]:
        exact = mpf(float(u)) - mp.tanh(mpf(float(u)))
        assert abs(mpf(tanh_rest(float(u))) / exact - 1) < 1e-13, u


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"bias": (1.0, 2.0)}, "bias must be finite, of shape"),
        ({"scale": (0.0, math.nan, 0.0)}, "scale must be finite"),
        ({"misalignment": np.eye(3)}, "zero diagonal"),
        ({"white": -1.0}, "white must be finite and not negative, got -1.0"),
        ({"walk": math.inf}, "walk must be finite"),
        ({"quantum": math.nan}, "quantum must be"),
        ({"markov": 1.0}, "markov_time must be positive"),
        ({"markov": 1.0, "markov_time": 0.0}, "markov_time must be positive"),
    ],
)
def test_wrong_errors_are_refused(change: dict[str, object], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        TriadErrors(**change)  # type: ignore[arg-type]


def test_compensated_samples_are_refused() -> None:
    true = replace(samples(UNEVEN, "increment"), kind="compensated")
    with pytest.raises(ValueError, match="not compensated"):
        Sensor(ImuErrors(), 0).measure(true)
