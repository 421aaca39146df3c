"""The Kalman filter against batch solutions, 50-digit arithmetic and closed forms."""

import numpy as np
import pytest
from mpmath import mp
from numpy.typing import NDArray

from align.kalman import consistency, predict, update

Array = NDArray[np.float64]


def random_covariance(rng: np.random.Generator, n: int) -> Array:
    root = rng.normal(size=(n, n))
    return root @ root.T + 0.1 * np.eye(n)


def test_a_constant_state_is_the_weighted_least_squares_solution() -> None:
    """Prior and 30 correlated measurements at once, by QR of the whitened equations."""
    rng = np.random.default_rng(1)
    n = 5
    x, P = rng.normal(size=n), random_covariance(rng, n)
    whitened = [np.linalg.inv(np.linalg.cholesky(P))]
    right = [whitened[0] @ x]
    for _ in range(30):
        m = int(rng.integers(1, 4))
        H, R, z = rng.normal(size=(m, n)), random_covariance(rng, m), rng.normal(size=m)
        root = np.linalg.inv(np.linalg.cholesky(R))
        whitened.append(root @ H)
        right.append(root @ z)
        x, P, *_ = update(x, P, z, H, R)
    A = np.concatenate(whitened)
    batch = np.linalg.lstsq(A, np.concatenate(right), rcond=None)[0]
    upper = np.linalg.inv(np.linalg.qr(A, mode="r"))
    # of numbers about 1, after 30 steps of rounding
    np.testing.assert_allclose(x, batch, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(P, upper @ upper.T, rtol=0.0, atol=1e-13)


def test_a_moving_state_is_conditioned_on_all_measurements() -> None:
    """The last state given the whole record, from the joint covariance of everything."""
    rng = np.random.default_rng(2)
    n, m, count = 3, 2, 6
    x, P = rng.normal(size=n), random_covariance(rng, n)
    F = [np.eye(n) + 0.3 * rng.normal(size=(n, n)) for _ in range(count)]
    Q = [random_covariance(rng, n) for _ in range(count)]
    H = [rng.normal(size=(m, n)) for _ in range(count)]
    R = [random_covariance(rng, m) for _ in range(count)]
    z = rng.normal(size=(count, m))

    # every state and measurement as a linear map of (initial state, process noises, noises)
    source = n + count * (n + m)
    spread = np.zeros((source, source))
    spread[:n, :n] = P
    mean = np.zeros(source)
    mean[:n] = x
    state = np.eye(n, source)
    seen = []
    for k in range(count):
        w, v = n + k * (n + m), n + k * (n + m) + n
        spread[w:v, w:v], spread[v : v + m, v : v + m] = Q[k], R[k]
        state = F[k] @ state + np.eye(n, source, w)
        seen.append(H[k] @ state + np.eye(m, source, v))
        x, P = predict(x, P, F[k], Q[k])
        x, P, *_ = update(x, P, z[k], H[k], R[k])
    A = np.concatenate(seen)
    gain = state @ spread @ A.T @ np.linalg.inv(A @ spread @ A.T)
    np.testing.assert_allclose(
        x, state @ mean + gain @ (z.ravel() - A @ mean), rtol=0.0, atol=1e-12
    )
    np.testing.assert_allclose(P, (state - gain @ A) @ spread @ state.T, rtol=0.0, atol=1e-12)


def exact_update(
    x: Array, P: Array, z: Array, H: Array, R: Array
) -> tuple[mp.matrix, mp.matrix, mp.mpf]:
    """Posterior and normalised innovation squared with 50 digits, by an explicit inverse."""
    with mp.workdps(50):
        X, C, Z, M, V = (mp.matrix(np.atleast_2d(a).tolist()) for a in (x, P, z, H, R))
        inverse = (M * C * M.T + V) ** -1
        gain = C * M.T * inverse
        y = Z.T - M * X.T
        return X.T + gain * y, C - gain * M * C, (y.T * inverse * y)[0]


def test_nearly_parallel_measurements_far_sharper_than_the_state() -> None:
    """Bierman's example: two sums that differ by 1e-5 measured to 1e-5 of the state's sigma.

    The best known combination has a variance of 1.7e-11; the short form ``P - K H P`` is off by
    1e-7 here, ten thousand times as much.
    """
    near = 1e-5
    x, P = np.array([3.0, -2.0, 1.0]), np.eye(3)
    H = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0 + near]])
    R = near**2 * np.eye(2)
    z = H @ [3.5, -2.2, 0.4]
    got = update(x, P, z, H, R)
    with mp.workdps(50):
        x_true, P_true, nis_true = exact_update(x, P, z, H, R)
        P_true = np.array(P_true.tolist(), float)
        x_true = np.array(x_true.tolist(), float).ravel()
    # S is known to eps / near^2 = 2e-6, and so is the gain; Joseph's form does not pass it on
    np.testing.assert_allclose(got.P, P_true, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(got.x, x_true, rtol=0.0, atol=1e-6)
    assert np.linalg.eigvalsh(got.P)[0] == pytest.approx(np.linalg.eigvalsh(P_true)[0], rel=1e-3)
    assert got.nis == pytest.approx(float(nis_true), rel=3e-6)
    assert np.array_equal(got.P, got.P.T)


def test_units_far_apart() -> None:
    """Turns of 1e-8 rad and velocities of 1e-5 m/s beside an unknown heading, in one update."""
    rng = np.random.default_rng(3)
    scale = np.array([1.8, 1e-5, 1e-8, 1e-13])
    P = scale[:, None] * random_covariance(rng, 4) * scale
    H = np.array([[0.0, 1.0, 0.0, 0.0], [7e-5, 0.0, 1.0, 3.0]])
    R = np.diag([1e-6, 1e-9]) ** 2
    x, z = scale * rng.normal(size=4), np.array([1e-5, 1e-4])
    got = update(x, P, z, H, R)
    x_true, P_true, nis_true = exact_update(x, P, z, H, R)
    sigma = np.sqrt(np.array([float(P_true[i, i]) for i in range(4)]))
    off = np.array((mp.matrix(got.P.tolist()) - P_true).tolist(), float) / sigma / sigma[:, None]
    assert np.max(np.abs(off)) < 1e-12
    off = np.array((mp.matrix(got.x.tolist()) - x_true).tolist(), float).ravel() / sigma
    assert np.max(np.abs(off)) < 1e-12
    assert got.nis == pytest.approx(float(nis_true), rel=1e-12)


@pytest.mark.parametrize(("q", "r"), [(1.0, 1.0), (1e-3, 1.0), (4.0, 1e-3)])
def test_steady_state_of_a_random_walk(q: float, r: float) -> None:
    """Variance of the prediction (q + sqrt(q^2 + 4 q r)) / 2, as every textbook has it."""
    x, P = np.zeros(1), np.array([[100.0]])
    F, H = np.eye(1), np.eye(1)
    for _ in range(800):
        x, P = predict(x, P, F, q * np.eye(1))
        x, P, _, S, _ = update(x, P, np.zeros(1), H, r * np.eye(1))
    before = 0.5 * (q + np.sqrt(q * q + 4.0 * q * r))
    assert S[0, 0] == pytest.approx(before + r, rel=1e-12)
    assert P[0, 0] == pytest.approx(before * r / (before + r), rel=1e-12)


def test_covariances_stay_covariances() -> None:
    """Thousands of steps with a noise-free measurement among them."""
    rng = np.random.default_rng(4)
    n = 6
    F = np.eye(n) + 0.05 * rng.normal(size=(n, n)) - 0.1 * np.eye(n)
    Q = 1e-6 * random_covariance(rng, n)
    x, P = np.zeros(n), 1e4 * random_covariance(rng, n)
    for _ in range(2000):
        x, P = predict(x, P, F, Q)
        assert np.array_equal(P, P.T)
        size = np.trace(P)
        x, P, *_ = update(x, P, np.zeros(1), rng.normal(size=(1, n)), np.zeros((1, 1)))
        assert np.array_equal(P, P.T)
        assert np.linalg.eigvalsh(P)[0] > -1e-15 * size


def test_innovation_and_its_square() -> None:
    got = update(
        np.array([1.0, 2.0]),
        np.array([[2.0, 1.0], [1.0, 3.0]]),
        np.array([7.0]),
        np.array([[1.0, 1.0]]),
        np.array([[2.0]]),
    )
    assert got.innovation.tolist() == [4.0]
    assert got.S.tolist() == [[9.0]]
    assert got.nis == pytest.approx(16.0 / 9.0, rel=1e-15)
    np.testing.assert_allclose(got.x, [1.0 + 4.0 * 3.0 / 9.0, 2.0 + 4.0 * 4.0 / 9.0], rtol=1e-15)


def test_a_measurement_without_noise_of_a_state_without_spread_is_refused() -> None:
    H = np.array([[1.0, 0.0], [0.0, 1.0]])
    with pytest.raises(ValueError, match="not positive definite at row 1"):
        update(np.zeros(2), np.diag([1.0, 0.0]), np.zeros(2), H, np.zeros((2, 2)))


def test_bounds_are_those_of_the_printed_table() -> None:
    """Ten degrees of freedom: 3.247 and 20.483 (any table of chi-square, 2.5 and 97.5 %)."""
    judged = consistency(np.arange(5), np.full(5, 2.0), 2)
    assert 5.0 * judged.low == pytest.approx(3.247, rel=0.0, abs=5e-4)
    assert 5.0 * judged.high == pytest.approx(20.483, rel=0.0, abs=5e-4)
    assert judged.consistent
    assert judged.dof == 2
    for mean in (3.246 / 5.0, 20.484 / 5.0):
        assert not consistency(np.arange(5), np.full(5, mean), 2).consistent


def test_a_filter_that_knows_its_noise_is_called_consistent_19_times_in_20() -> None:
    """Random walk with noise, and the same with a process noise that is 3 or 1/3 of the truth."""
    rng = np.random.default_rng(5)
    runs, count = 100, 60

    def judged(believed: float) -> float:
        walk = np.cumsum(rng.normal(size=(count, runs)), axis=0)
        seen = walk + rng.normal(size=walk.shape)
        good = 0
        for run in range(runs):
            x, P = np.zeros(1), np.zeros((1, 1))
            nis = []
            for z in seen[:, run]:
                x, P = predict(x, P, np.eye(1), believed**2 * np.eye(1))
                x, P, _, _, fit = update(x, P, np.array([z]), np.eye(1), np.eye(1))
                nis.append(fit)
            good += consistency(np.arange(count), nis, 1).consistent
        return good / runs

    # of 100: 95 % +- 2.2 % (1 sigma), three of these
    assert judged(1.0) == pytest.approx(0.95, rel=0.0, abs=0.066)
    assert judged(3.0) < 0.05
    assert judged(1.0 / 3.0) < 0.05


@pytest.mark.parametrize("nis", [np.empty(0), np.ones((2, 2)), np.ones(3)])
def test_innovations_without_their_times_are_refused(nis: Array) -> None:
    with pytest.raises(ValueError, match="one shape"):
        consistency(np.arange(2 if nis.size else 0), nis, 1)
