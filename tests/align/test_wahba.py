"""Wahba's problem: three solvers, one answer, and a covariance that is the scatter."""

from typing import get_args

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from align.errors import AlignmentError
from align.wahba import Method, WahbaSolution, vectors_at_rest, wahba
from tests.align.at_rest import DEG_H, UG, Array, Window, attitudes, error_n, rotation, still
from tests.oracles.constants import OMEGA
from tests.oracles.gravity import normal_gravity_zonal

LATITUDES = (-80.0, -60.0, -33.9, -5.0, 0.0, 18.4, 51.08, 80.0)  # deg
METHODS: tuple[Method, ...] = get_args(Method)
EACH_METHOD = pytest.mark.parametrize("method", METHODS)
HALF_TURNS = [
    Rotation.from_rotvec(np.pi * np.array(axis) / np.linalg.norm(axis))
    for axis in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 1], [-0.2, 3, 1])
]


def every_attitude() -> list[Rotation]:
    return [rotation(*euler) for euler in attitudes()] + HALF_TURNS


def at_rest(window: Window, accel_sigma: float, gyro_sigma: float) -> tuple[Array, Array, Array]:
    gravity = normal_gravity_zonal(window.lat, window.h)
    return vectors_at_rest(
        window.f_ib_b[0],
        window.omega_ib_b[0],
        np.array([float(gravity.north), 0.0, float(gravity.down)]),
        OMEGA * np.array([np.cos(window.lat), 0.0, -np.sin(window.lat)]),
        accel_sigma,
        gyro_sigma,
    )


def apart(one: WahbaSolution, other: WahbaSolution) -> float:
    return float(
        np.linalg.norm(error_n(one.q_nb, Rotation.from_quat(other.q_nb, scalar_first=True)))
    )


@EACH_METHOD
@pytest.mark.parametrize("shift", [0, 3])
def test_perfect_data(shift: int, method: Method) -> None:
    for k, euler in enumerate(attitudes()):
        window = still(
            LATITUDES[(k + shift) % 8], rotation(*euler), h=(0.0, 9000.0)[k % 2], count=1
        )
        # navigation grade: the Earth rate weighs 1e-3 of gravity at best
        found = wahba(*at_rest(window, 50.0 * UG, 0.01 * DEG_H), method)
        # rad: gravity of the oracle to 1e-16, the Earth rate's level part to 6e-16
        assert np.linalg.norm(error_n(found.q_nb, window.attitude)) < 1e-13, euler
        assert found.loss < 1e-18


@pytest.mark.parametrize(("count", "ratio"), [(2, 3e-3), (3, 1.0), (7, 0.1)])
def test_solvers_agree_on_noisy_data(count: int, ratio: float) -> None:
    """Any lengths, unequal weights, half turns; the loss is least, as its gradient says."""
    rng = np.random.default_rng(100 + count)
    for attitude in every_attitude():
        v_n = rng.normal(size=(count, 3))
        sigma = np.geomspace(1e-3 * ratio, 1e-3, count)  # rad
        units = v_n / np.linalg.norm(v_n, axis=1)[:, None]
        v_b = attitude.inv().apply(units) + sigma[:, None] * rng.normal(size=(count, 3))
        v_b *= rng.uniform(0.1, 50.0, size=(count, 1))
        found = [wahba(v_n, v_b, sigma, method) for method in METHODS]
        assert max(apart(x, found[0]) for x in found) < 1e-12
        seen = Rotation.from_quat(found[0].q_nb, scalar_first=True).apply(v_b)
        seen /= np.linalg.norm(seen, axis=1)[:, None]
        gradient = np.sum(np.cross(seen - units, units) / sigma[:, None] ** 2, axis=0)
        newton = found[0].P_n @ gradient  # rad: how far the least loss still is
        assert np.linalg.norm(newton) < 1e-12
        loss = 0.5 * np.sum(np.sum((seen - units) ** 2, axis=1) / sigma**2)
        assert found[0].loss == pytest.approx(loss, rel=1e-9)


@EACH_METHOD
def test_large_disagreement_is_still_the_least_loss(method: Method) -> None:
    """Directions that fit no rotation: SciPy's residual is the judge."""
    rng = np.random.default_rng(11)
    for _ in range(20):
        v_n, v_b, sigma = rng.normal(size=(4, 3)), rng.normal(size=(4, 3)), rng.uniform(1, 3, 4)
        n, b = (v / np.linalg.norm(v, axis=1)[:, None] for v in (v_n, v_b))
        _, root = Rotation.align_vectors(n, b, weights=sigma**-2)
        assert wahba(v_n, v_b, sigma, method).loss == pytest.approx(0.5 * root**2, rel=1e-12)


def test_gap() -> None:
    """Three equal directions at right angles have 4/3; two, at an angle a, 2 sin^2(a/2)."""
    assert wahba(np.eye(3), np.eye(3), np.ones(3)).gap == pytest.approx(4.0 / 3.0)
    pair = np.array([[1.0, 0.0, 0.0], [np.cos(0.3), np.sin(0.3), 0.0]])
    assert wahba(pair, pair, np.ones(2)).gap == pytest.approx(2.0 * np.sin(0.15) ** 2)


def test_covariance_is_the_scatter() -> None:
    """400 runs of four directions: each sigma, the whole matrix by chi-square, and the loss."""
    rng = np.random.default_rng(20)
    attitude = rotation(2.0, -0.7, 0.9)
    v_n = rng.normal(size=(4, 3))
    v_n /= np.linalg.norm(v_n, axis=1)[:, None]
    sigma = np.array([2e-4, 1e-3, 5e-3, 3e-3])  # rad
    runs = 400
    errors, losses = [], []
    for _ in range(runs):
        noise = sigma[:, None] * rng.normal(size=(4, 3))
        found = wahba(v_n, attitude.inv().apply(v_n) + noise, sigma)
        errors.append(error_n(found.q_nb, attitude))
        losses.append(2.0 * found.loss)
    nees = np.einsum("ki,ij,kj->k", errors, np.linalg.inv(found.P_n), errors)
    low, high = chi2.ppf([0.001, 0.999], 3 * runs)
    assert low < nees.sum() < high
    low, high = chi2.ppf([0.001, 0.999], 5 * runs)
    assert low < np.sum(losses) < high
    # Relative: the scatter of 400 runs is known to 3.5 %.
    scatter = np.sqrt(np.mean(np.square(errors), axis=0))
    np.testing.assert_allclose(np.sqrt(np.diag(found.P_n)), scatter, rtol=0.12)
    correlation = np.mean([e[0] * e[2] for e in errors]) / (scatter[0] * scatter[2])
    stated = found.P_n[0, 2] / np.sqrt(found.P_n[0, 0] * found.P_n[2, 2])
    assert correlation == pytest.approx(stated, rel=0.0, abs=0.15)


@pytest.mark.parametrize("lat_deg", [-70.0, -20.0, 0.0, 45.0, 70.0])
def test_sigmas_at_rest_are_those_of_theory(lat_deg: float) -> None:
    window = still(lat_deg, rotation(0.3, 1.2, -2.0), count=1)
    accel, gyro = 50.0 * UG, 0.01 * DEG_H
    P = wahba(*at_rest(window, accel, gyro)).P_n
    heading = np.hypot(gyro / (OMEGA * np.cos(window.lat)), np.tan(window.lat) * accel / window.g)
    assert np.sqrt(P[2, 2]) == pytest.approx(heading, rel=1e-9)
    assert np.sqrt(P[0, 0]) == pytest.approx(accel / window.g, rel=1e-9)
    east = 1.0 / np.hypot(window.g / accel, OMEGA / gyro)  # both vectors measure it
    assert np.sqrt(P[1, 1]) == pytest.approx(east, rel=1e-9)


@pytest.mark.parametrize("lat_deg", [-70.0, 0.0, 45.0])
@pytest.mark.parametrize("accel_sigma", [50.0 * UG, 3000.0 * UG])
def test_signed_errors_at_rest(lat_deg: float, accel_sigma: float) -> None:
    """About north and down as TRIAD; about east the weighted mean of its two variants."""
    gyro, accel = np.array([1.3, -0.7, 1.1]) * 1e-3 * DEG_H, np.array([6.0, -3.5, 8.0]) * UG
    gyro_sigma = 0.01 * DEG_H
    clean = still(lat_deg, rotation(-2.0, 0.4, 1.0), count=1)
    half = np.zeros(3)
    for sign in (1.0, -1.0):
        felt = clean.plus_n(gyro=sign * gyro, accel=sign * accel)
        found = wahba(*at_rest(felt, accel_sigma, gyro_sigma))
        half += 0.5 * sign * error_n(found.q_nb, clean.attitude)
    sin, cos, tan = np.sin(clean.lat), np.cos(clean.lat), np.tan(clean.lat)
    by_force, by_rate = (clean.g / accel_sigma) ** 2, (OMEGA / gyro_sigma) ** 2
    tilts = accel[0] / clean.g, (sin * gyro[0] + cos * gyro[2]) / OMEGA
    truth = [
        -accel[1] / clean.g,
        (by_force * tilts[0] + by_rate * tilts[1]) / (by_force + by_rate),
        tan * accel[1] / clean.g - gyro[1] / (OMEGA * cos),
    ]
    # rad: third order of the gyro ratio, 1e-4 and 3e-4 at 70°
    np.testing.assert_allclose(half, truth, rtol=0.0, atol=5e-11)
    assert abs(truth[1] - tilts[0]) > 1e-10


@pytest.mark.parametrize(
    ("v_n", "v_b", "message"),
    [
        ([[1, 0, 0]], [[0, 1, 0]], "1 direction fixes no attitude"),
        ([[1, 0, 0], [-2, 0, 0]], [[0, 1, 0], [0, -1, 0]], "parallel"),
        ([[1, 0, 0], [1, 1e-8, 0]], [[1, 0, 0], [1, 1e-8, 0]], "parallel"),
        ([[1, 0, 0], [0, 1, 0]], [[0, 1, 0], [0, 3, 0]], "parallel"),
        ([[1, 0, 0], [0, 1, 0]], [[0, 1, 0], [0, 0, 0]], r"v_b\[1\] has length 0"),
        ([[1, 0, 0], [0, np.nan, 0]], [[0, 1, 0], [0, 0, 1]], r"v_n\[1\] has length nan"),
    ],
)
@EACH_METHOD
def test_refusals(
    v_n: list[list[float]], v_b: list[list[float]], message: str, method: Method
) -> None:
    with pytest.raises(AlignmentError, match=message):
        wahba(v_n, v_b, np.full(len(v_n), 1e-3), method)


def test_quest_says_when_its_digits_are_gone() -> None:
    rng = np.random.default_rng(5)
    v = rng.normal(size=(2, 3))
    sigma = np.array([1e-6, 1e-1])  # rad
    with pytest.raises(AlignmentError, match="take method davenport"):
        wahba(v, v, sigma, "quest")
    for method in ("davenport", "svd"):
        found = wahba(v, rotation(1.0, 0.2, 3.0).inv().apply(v), sigma, method)  # type: ignore[arg-type]
        assert np.linalg.norm(error_n(found.q_nb, rotation(1.0, 0.2, 3.0))) < 1e-13


def test_arguments_that_do_not_fit() -> None:
    pair = np.eye(3)[:2]
    with pytest.raises(ValueError, match="sigma must be positive"):
        wahba(pair, pair, [1.0, 0.0])
    with pytest.raises(ValueError, match="must have shape"):
        wahba(pair, np.eye(3), [1.0, 1.0])
    with pytest.raises(ValueError, match="must have shape"):
        wahba(pair[0], pair, [1.0, 1.0])
    with pytest.raises(ValueError, match="method must be one of davenport, quest, svd"):
        wahba(pair, pair, [1.0, 1.0], "esoq")  # type: ignore[arg-type]
