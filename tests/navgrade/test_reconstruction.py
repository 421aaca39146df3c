"""Body increments against closed forms; the Earth is not here."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.spatial.transform import Rotation

from navgrade import ImuSamples
from navgrade.reconstruction import RECONSTRUCTIONS, reconstruct, to_increments
from navgrade.reconstruction.causal import coning_weights

COMPENSATED = [name for name in RECONSTRUCTIONS if name != "none"]


def body(name: str, dt: np.ndarray, dtheta: np.ndarray, dvel: np.ndarray):
    """Reconstruct one block; return phi and dv."""
    t = np.cumsum(dt)
    block = ImuSamples(t=t, dt=dt, gyro=dtheta, accel=dvel, kind="increment")
    (out,) = reconstruct([block], name)
    return out.phi, out.dv


def coning_increments(a: float, f: float, edges: np.ndarray) -> np.ndarray:
    """Integrals of the rate of pure coning with half-angle a (rad) at f (Hz).

    omega = (-W sin a sin Wt, W sin a cos Wt, -2 W sin^2(a/2)), W = 2 pi f.
    """
    W = 2 * np.pi * f
    x = np.sin(a) * np.cos(W * edges)
    y = np.sin(a) * np.sin(W * edges)
    z = -2 * W * np.sin(a / 2) ** 2 * edges
    return np.diff(np.stack([x, y, z], axis=-1), axis=0)


CLASSICAL = {
    "none": (),
    "causal-1": (Fraction(1, 12),),
    "causal-3": (Fraction(113, 840), Fraction(-13, 420), Fraction(1, 280)),
}


def uncorrected_share(name: str, lam: mpf) -> mpf:
    """What an algorithm leaves of the second-order coning integral, per interval.

    (lambda - sin lambda) - 4 (1 - cos lambda) sum_m k_m sin(m lambda), in 50 digits.
    """
    with mp.workdps(50):
        lam = mpf(lam)
        terms = sum(
            mpf(k.numerator) / k.denominator * mp.sin((m + 1) * lam)
            for m, k in enumerate(CLASSICAL[name])
        )
        return lam - mp.sin(lam) - 4 * (1 - mp.cos(lam)) * terms


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_declared_coning_order(name: str) -> None:
    """The share left is 2 lambda^(2n+1) / [(n+1) C(2n+2, n+1)], n = previous samples + 1."""
    terms = RECONSTRUCTIONS[name].previous + 1
    lam = mpf("0.001")
    leading = 2 * lam ** (2 * terms + 1) / ((terms + 1) * comb(2 * terms + 2, terms + 1))
    # 1e-5: the next power of lambda is about lambda^2 of the leading one
    assert float(uncorrected_share(name, lam) / leading) == pytest.approx(1.0, abs=1e-5)
    assert RECONSTRUCTIONS[name].coning_order == 2 * terms


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_coning_drift(name: str) -> None:
    """The drift about the cone's axis is a^2 / 2 of that share per interval."""
    a, f, h, n = 0.02 * np.pi / 180, 10.0, 0.01, 20_000
    edges = np.arange(n + 1) * h
    phi, _ = body(name, np.full(n, h), coning_increments(a, f, edges), np.zeros((n, 3)))
    W = 2 * np.pi * f
    first = 4  # samples with fewer predecessors are not of the class
    q = np.array([1.0, 0, 0, 0])
    for w, x, y, z in Rotation.from_rotvec(phi[first:]).as_quat(scalar_first=True):
        q = np.array(
            [
                q[0] * w - q[1] * x - q[2] * y - q[3] * z,
                q[0] * x + q[1] * w + q[2] * z - q[3] * y,
                q[0] * y - q[1] * z + q[2] * w + q[3] * x,
                q[0] * z + q[1] * y - q[2] * x + q[3] * w,
            ]
        )
    start, end = (
        Rotation.from_rotvec(a * np.array([np.cos(W * t), np.sin(W * t), 0.0]))
        for t in (edges[first], edges[-1])
    )
    drift = (start.inv() * end).inv() * Rotation.from_quat(q, scalar_first=True)
    rate = drift.as_rotvec()[2] / ((n - first) * h)
    expected = -0.5 * a**2 * float(uncorrected_share(name, W * h)) / h
    # 0.2 %: the a^4 terms are 1e-7 of a^2; rounding of 20,000 products is 1e-14 rad of 3e-8
    assert rate == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("name", COMPENSATED)
@pytest.mark.parametrize("pattern", [(0.006, 0.004), (0.003, 0.005, 0.009, 0.004)])
def test_uneven_coning_falls_with_the_same_power(name: str, pattern: tuple[float, ...]) -> None:
    """Uneven intervals keep the order: halving them cuts the drift 2^order times."""
    a, f = 1e-5, 10.0  # rad, Hz: so small that the a^4 terms stay out of sight
    drifts = []
    for scale in (1.0, 0.5):
        dt = np.tile(pattern, 400) * scale
        edges = np.concatenate([[0.0], np.cumsum(dt)])
        phi, _ = body(name, dt, coning_increments(a, f, edges), np.zeros((len(dt), 3)))
        # the mean of the exact rotation vector about z, to second order in a, is -a^2 sin(W h)/2
        W = 2 * np.pi * f
        exact = -0.5 * a**2 * np.sin(W * dt)
        drifts.append(abs((phi[8:, 2] - exact[8:]).sum()) / edges[-1])
    order = np.log2(drifts[0] / drifts[1])
    # 0.5: at lambda = 0.38 the next power of lambda still shows
    assert order > RECONSTRUCTIONS[name].coning_order - 0.5


@pytest.mark.parametrize("name", COMPENSATED)
def test_sculling(name: str) -> None:
    """Rotation about x in phase with force along y: the same share, by duality."""
    a, c, f, h, n = 1e-3, 2.0, 10.0, 0.01, 1000
    W, lam = 2 * np.pi * f, 2 * np.pi * f * h
    edges = np.arange(n + 1) * h
    dtheta = np.zeros((n, 3))
    dvel = np.zeros((n, 3))
    dtheta[:, 0] = np.diff(a * np.sin(W * edges))
    dvel[:, 1] = np.diff(-c / W * np.cos(W * edges))
    _, dv = body(name, np.full(n, h), dtheta, dvel)
    # exact second-order rectification along z: integral of (theta - theta_start) c sin(W t)
    exact = (
        0.5 * a * c * h
        - a * c * np.sin(W * edges[:-1]) * (np.cos(W * edges[:-1]) - np.cos(W * edges[1:])) / W
        - a * c * (np.sin(2 * W * edges[1:]) - np.sin(2 * W * edges[:-1])) / (4 * W)
    )
    residual = np.mean(dv[4:, 2] - exact[4:]) / h
    expected = -0.5 * a * (c / W) * float(uncorrected_share(name, lam)) / h
    # 0.2 %: the a^3 terms are 1e-6 of it, and the mean runs over whole periods
    assert residual == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("name", COMPENSATED)
@pytest.mark.parametrize("angle", [1e-9, 1e-4, 0.2, 0.3, 3.0])
def test_constant_rate_and_force_are_exact(name: str, angle: float) -> None:
    """A constant rate under a constant force: the integral of C(t) f in closed form."""
    axis = np.array([0.36, 0.48, -0.8])
    f = np.array([1.0, -9.0, 3.0])
    h = 0.02
    n = 6
    phi, dv = body(name, np.full(n, h), np.tile(axis * angle, (n, 1)), np.tile(f * h, (n, 1)))
    x, w = np.polynomial.legendre.leggauss(20)
    nodes = 0.5 * (1 + x)
    exact = (
        h
        * 0.5
        * np.einsum("k,ki->i", w, Rotation.from_rotvec(np.outer(nodes, axis * angle)).apply(f))
    )
    np.testing.assert_allclose(phi, np.tile(axis * angle, (n, 1)), rtol=1e-15)
    np.testing.assert_allclose(dv, np.tile(exact, (n, 1)), atol=2e-16 * 10)  # m/s: rounding


def test_weights_are_the_classical_ones() -> None:
    """Equal intervals give 1/12; 7/60, -1/60; 113/840, -13/420, 1/280 (Ignagni 1996)."""
    even = np.full(4, 0.01)
    uneven_path = even * (1 + 3e-8 * np.array([1, -1, 1, -1]))
    for dt, tolerance in ((even, 0), (uneven_path, 1e-5)):
        np.testing.assert_allclose(coning_weights(dt, 3, 1), (1 / 12, 0, 0), atol=tolerance)
        np.testing.assert_allclose(coning_weights(dt, 3, 2), (7 / 60, -1 / 60, 0), atol=tolerance)
        np.testing.assert_allclose(
            coning_weights(dt, 3, 3), (113 / 840, -13 / 420, 1 / 280), atol=tolerance
        )


def test_one_previous_sample_of_another_length() -> None:
    """h2^2 / [6 h1 (h1 + h2)] (the exact coefficient of a linear rate)."""
    h1, h2 = 0.003, 0.01
    weight, *_ = coning_weights(np.array([h1, h2]), 1, 1)
    assert weight == pytest.approx(h2**2 / (6 * h1 * (h1 + h2)), rel=1e-14)


def test_none_passes_increments_as_they_are() -> None:
    rng = np.random.default_rng(1)
    dtheta, dvel = rng.standard_normal((2, 5, 3))
    phi, dv = body("none", np.full(5, 0.1), dtheta, dvel)
    assert np.array_equal(phi, dtheta)
    assert np.array_equal(dv, dvel)


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_compensated_input_is_not_corrected_again(name: str) -> None:
    rng = np.random.default_rng(2)
    dtheta, dvel = rng.standard_normal((2, 5, 3))
    block = ImuSamples(t=np.arange(1, 6) * 0.1, gyro=dtheta, accel=dvel, kind="compensated")
    (out,) = reconstruct(to_increments([block]), name)
    assert np.array_equal(out.phi, dtheta)
    assert np.array_equal(out.dv, dvel)


def test_rates_integrate_polynomials_exactly() -> None:
    """Six uneven samples carry a quintic rate without error, in any block size."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.004, 0.012, 60))
    coefficients = rng.standard_normal((6, 6))  # of 3 rates and 3 forces, ascending
    values = np.polynomial.polynomial.polyval(t, coefficients).T
    integral = np.polynomial.polynomial.polyint(coefficients, axis=0)
    steps = np.diff(np.polynomial.polynomial.polyval(t, integral).T, axis=0)
    imu = ImuSamples(t=t, gyro=values[:, :3], accel=values[:, 3:], kind="rate")
    for size in (1, 7, 13, 60):
        out = list(to_increments(imu.blocks(size)))
        dtheta = np.concatenate([o.gyro for o in out])
        dvel = np.concatenate([o.accel for o in out])
        assert np.array_equal(np.concatenate([o.t for o in out]), t)
        # rad: rounding of numbers of size 10 over intervals of 0.01 s
        np.testing.assert_allclose(dtheta[1:], steps[:, :3], atol=1e-13)
        np.testing.assert_allclose(dvel[1:], steps[:, 3:], atol=1e-13)


def test_rates_with_equal_spacing_use_the_published_weights() -> None:
    """(11, -93, 802, 802, -93, 11) / 1440 about the interval."""
    n, k = 12, 6
    unit = np.eye(n)
    weights = np.array([11, -93, 802, 802, -93, 11]) / 1440
    t = np.arange(1, n + 1) * 0.01
    for j in range(n):
        gyro = np.zeros((n, 3))
        gyro[:, 0] = unit[j]
        imu = ImuSamples(t=t, gyro=gyro, accel=gyro, kind="rate")
        dtheta = np.concatenate([out.gyro for out in to_increments([imu])])
        expected = weights[j - (k - 3)] * 0.01 if k - 3 <= j <= k + 2 else 0.0
        assert dtheta[k, 0] == pytest.approx(expected, abs=1e-14)  # rad: rounding


def test_averages_are_increments_over_their_interval() -> None:
    rng = np.random.default_rng(4)
    t = np.cumsum(rng.uniform(0.004, 0.012, 9))
    rates = rng.standard_normal((2, 9, 3))
    (out,) = to_increments([ImuSamples(t=t, gyro=rates[0], accel=rates[1], kind="average")])
    steps = np.diff(t)
    np.testing.assert_allclose(out.gyro[1:], rates[0, 1:] * steps[:, None], rtol=1e-15)
    np.testing.assert_allclose(out.accel[1:], rates[1, 1:] * steps[:, None], rtol=1e-15)
    assert out.kind == "increment"
