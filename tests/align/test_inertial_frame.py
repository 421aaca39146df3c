"""A swaying base: exact data give the exact attitude, noisy data the scatter predicted."""

from dataclasses import fields, replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from align import AlignmentError, SensorErrors, analytic_coarse
from align.inertial_frame import InertialFrame, InertialSolution, inertial_frame
from navgrade.imu import ImuSamples
from navgrade.reconstruction import DEFAULT, reconstruct, to_increments
from navgrade.simulate import Oscillation, Sinusoid, Sinusoids, imu_increments, true_trajectory
from tests.align.at_rest import DEG, DEG_H, UG, Array, attitudes, error_n
from tests.align.sway import Sway, Waves, edges
from tests.align.test_recordings import CALGARY, KINGSTON, read
from tests.oracles.constants import OMEGA
from tests.oracles.gravity import normal_gravity_zonal

NOISE = SensorErrors(gyro_bias=0.0, accel_bias=0.0, arw=0.003 * DEG / 60.0, vrw=10.0 * UG)
NAVIGATION = SensorErrors(
    gyro_bias=0.01 * DEG_H, accel_bias=50.0 * UG, arw=0.003 * DEG / 60.0, vrw=10.0 * UG
)
TACTICAL = SensorErrors(
    gyro_bias=1.0 * DEG_H, accel_bias=500.0 * UG, arw=0.1 * DEG / 60.0, vrw=50.0 * UG
)
TWO_DEGREES = Waves((2.0 * DEG, 2.0 * DEG, 2.0 * DEG), phase=(0.3, 2.0, 4.4))
RUNS = 400


def swaying(rng: np.random.Generator, lat: float, sway: float, path: float = 0.0) -> Sway:
    """Roll, pitch and yaw, and the three coordinates, each with a period of 7 to 11 s."""

    def waves(amplitude: float) -> Waves:
        return Waves((amplitude,) * 3, rng.uniform(7.0, 11.0, 3), rng.uniform(0.0, 7.0, 3))

    euler = (*rng.uniform(-0.1, 0.1, 2), rng.uniform(-np.pi, np.pi))
    return Sway(lat, 20.0, euler, waves(sway), waves(path))


def rms(rows: list[Array]) -> Array:
    return np.sqrt(np.mean(np.square(rows), axis=0))


@pytest.mark.parametrize("lat_deg", [-80.0, -60.0, -33.9, -5.0, 0.0, 18.4, 51.08, 80.0])
def test_exact_increments_give_the_attitude(lat_deg: float) -> None:
    """Whatever the mounting. 1e-9 rad is 0.2 milliarcseconds, far below any sensor."""
    base = Sway(lat_deg * DEG, 300.0, (0.1, -0.2, 2.5))
    motions = [replace(base, turn=turn).feel(edges(60.0, 5.0)) for turn in (Waves(), TWO_DEGREES)]
    for k, euler in enumerate(attitudes()):
        felt = motions[k % 2]
        mounted = Rotation.from_euler("ZYX", euler[::-1])
        phi, dv = mounted.inv().apply(felt.phi), mounted.inv().apply(felt.dv)
        found = inertial_frame(felt.dt, phi, dv, lat_deg * DEG, 300.0)
        error = error_n(found.q_nb, felt.attitude * mounted)
        assert np.linalg.norm(error) < 1e-9, euler
        # The level comes from vectors, not from their curvature: nothing enlarges its rounding.
        assert np.linalg.norm(error[:2]) < 1e-12, euler


@pytest.mark.parametrize("lat_deg", [-80.0, 80.0])
@pytest.mark.parametrize("seconds", [30.0, 1200.0])
def test_short_and_long_windows(lat_deg: float, seconds: float) -> None:
    felt = Sway(lat_deg * DEG, 0.0, (3.0, -1.2, 2.5), TWO_DEGREES).feel(edges(seconds, 20.0))
    found = inertial_frame(*felt.samples, lat_deg * DEG, 0.0)
    assert np.linalg.norm(error_n(found.q_nb, felt.attitude)) < 1e-9
    assert found.duration == pytest.approx(seconds, rel=1e-14)
    # Rounding of |alpha|^2, a part in 1e16 of the square of g T.
    assert found.velocity_rms < 1e-7 * 9.8 * seconds
    assert abs(found.specific_force_residual) < 1e-12
    assert abs(found.rate_residual_north) < 1e-9 * DEG_H


def test_the_whole_chain_from_simulated_counts() -> None:
    """Motion, counts and reconstruction of the package; 1e-8 rad is what coning leaves at 50 Hz."""
    lat = -36.8 * DEG
    motion = Sinusoids(
        lat,
        3.0,
        20.0,
        120.0,
        roll=Oscillation(0.02, 0.0, (Sinusoid(0.1 * DEG, 1.0 / 7.0, 0.3),)),
        pitch=Oscillation(-0.03, 0.0, (Sinusoid(2.0 * DEG, 1.0 / 8.5, 1.9),)),
        heading=Oscillation(2.0, 0.0, (Sinusoid(2.0 * DEG, 1.0 / 11.0, 4.0),)),
    )
    t = edges(120.0, 50.0)
    imu = ImuSamples(t[1:], *imu_increments(motion, t), kind="increment", dt=np.diff(t))
    frame = InertialFrame(lat, 20.0)
    for body in reconstruct(imu.blocks(1000), DEFAULT):
        frame.add(body.dt, body.phi, body.dv)
    truth = Rotation.from_quat(true_trajectory(motion, t[-1:]).q_nb[0], scalar_first=True)
    assert np.linalg.norm(error_n(frame.solution().q_nb, truth)) < 1e-8


def numbers(of: object) -> list[Array]:
    return [np.asarray(getattr(of, x.name)) for x in fields(of)]  # type: ignore[arg-type]


def same(one: InertialSolution, two: InertialSolution) -> bool:
    if one.budget != two.budget:
        return False
    rows = [
        [x for x in (*numbers(s), *numbers(s.convergence)) if x.dtype != object] for s in (one, two)
    ]
    return all(np.array_equal(a, b) for a, b in zip(*rows, strict=True))


def test_blocks_do_not_matter_bit_for_bit() -> None:
    rng = np.random.default_rng(3)
    felt = swaying(rng, 0.9, 2.0 * DEG, 0.1).feel(edges(60.0, 50.0)).noisy(rng, 1e-6, 1e-4)
    whole = inertial_frame(*felt.samples, 0.9, 20.0, errors=NAVIGATION)
    cuts = np.unique(rng.integers(0, len(felt.dt), 40))
    frame = InertialFrame(0.9, 20.0, errors=NAVIGATION)
    for rows in zip(*(np.split(x, cuts) for x in felt.samples), strict=True):
        frame.add(*rows)
    assert same(frame.solution(), whole)
    assert same(frame.solution(), whole)  # solving changes nothing
    frame.add(*(x[:1] for x in felt.samples))
    assert not same(frame.solution(), whole)


@pytest.mark.parametrize("sway_deg", [0.1, 2.0])
def test_sway(sway_deg: float) -> None:
    """Heading within 3 mrad after 120 s, where mean vectors (TRIAD) are off by 0.1 rad and more."""
    rng = np.random.default_rng(70)
    by_curve, by_means, shares = [], [], []
    for _ in range(16):
        felt = swaying(rng, 45.0 * DEG, sway_deg * DEG).feel(edges(120.0, 50.0))
        felt = felt.noisy(rng, NOISE.arw or 0.0, NOISE.vrw or 0.0)
        found = inertial_frame(*felt.samples, 45.0 * DEG, 20.0, errors=NOISE)
        error = error_n(found.q_nb, felt.attitude)
        by_curve.append(error)
        shares.append(error / np.sqrt(np.diag(found.P_n)))
        triad = Rotation.from_matrix(analytic_coarse(felt.dv.mean(axis=0), felt.phi.mean(axis=0)))
        by_means.append((triad * felt.attitude.inv()).as_rotvec()[2])
    assert rms(by_curve)[2] < 3e-3
    assert rms(by_means) > 0.1
    # 16 runs know a sigma to 18 %, here within two and a half of these.
    assert_allclose(rms(shares), 1.0, rtol=0.45)


@pytest.mark.parametrize(("seconds", "metres"), [(60.0, 0.2), (120.0, 0.2), (300.0, 0.5)])
def test_swell_that_moves_the_imu_counts_in_the_sigmas(seconds: float, metres: float) -> None:
    """Heave, surge and sway; in heading it rules at 60 s (40 mrad) and is gone at 300 s."""
    rng = np.random.default_rng(71)
    shares, velocities, motions = [], [], []
    for _ in range(30):
        felt = swaying(rng, -50.0 * DEG, 2.0 * DEG, metres).feel(edges(seconds, 10.0))
        felt = felt.noisy(rng, NOISE.arw or 0.0, NOISE.vrw or 0.0)
        found = inertial_frame(*felt.samples, -50.0 * DEG, 20.0, errors=NOISE)
        shares.append(error_n(found.q_nb, felt.attitude) / np.sqrt(np.diag(found.P_n)))
        velocities.append(found.velocity_rms)
        motions.append(found.budget[-1].azimuth / found.budget[-2].azimuth)
    # 30 runs know a sigma to 13 %, and where the swell rules four numbers tell it: to 35 %.
    assert_allclose(rms(shares), 1.0, rtol=0.35)
    if seconds == 60.0:
        # The ends of the window turn tilt and heading alike.
        _, east, down = np.transpose(shares)
        together = np.mean(east * down) / np.sqrt(np.mean(east**2) * np.mean(down**2))
        sigma = np.sqrt(np.diag(found.P_n))
        assert found.P_n[1, 2] / (sigma[1] * sigma[2]) == pytest.approx(together, abs=0.1)
    assert (np.median(motions) > 5.0) == (seconds == 60.0)
    assert (np.median(motions) > 0.3) == (seconds < 300.0)
    # Three sinusoids of mean frequency 1/8.8 s.
    assert_allclose(np.mean(velocities), metres * np.sqrt(1.5) * 2.0 * np.pi / 8.8, rtol=0.1)


def test_a_base_that_leaves_is_recognised() -> None:
    """From half of 300 s on it accelerates at 0.2 m/s^2, to 30 m/s."""
    felt = Sway(0.8, euler=(0.0, 0.02, 1.0), leaves=(0.2, 0.1, 0.0)).feel(edges(300.0, 20.0))
    found = inertial_frame(*felt.samples, 0.8, 0.0, errors=NAVIGATION)
    assert found.velocity_rms > 1.0
    # Heading is worth nothing, and the sigma says so.
    assert found.budget[-1].source == "motion of the base"
    assert found.budget[-1].azimuth > 0.1 > 50.0 * found.budget[-2].azimuth


def small_errors(errors: SensorErrors, lat: float, noise: Array, biases: Array, dt: float) -> Array:
    """Errors (n, e, d) of runs by weighted least squares on velocities, in the plane, no rotation.

    `noise` (2, 2, n, runs) is standard normal: gyro and accelerometer, north and east; `biases`
    (2, 2, runs) likewise.
    """
    n = noise.shape[2]
    t = dt * np.arange(1, n + 1)
    end = t[-1]
    gravity = normal_gravity_zonal(lat, 0.0)
    g = float(gravity.down)
    arw, vrw, bg, ba = (
        x or 0.0 for x in (errors.arw, errors.vrw, errors.gyro_bias, errors.accel_bias)
    )
    tilt = arw * np.sqrt(dt) * np.cumsum(noise[0], axis=1)
    tilt += bg * t[:, None] * biases[0][:, None]
    # East turns toward north with the Earth.
    turned = OMEGA * np.sin(lat) * (t - 0.5 * end)[:, None]
    accel = ba * (biases[1][:, None] + np.zeros((1, n, 1)))
    accel = np.stack([accel[0] + turned * accel[1], accel[1]])
    velocity = np.cumsum(dt * accel + vrw * np.sqrt(dt) * noise[1], axis=1)
    # A tilt about east draws gravity to the south, one about north to the east.
    along = np.cumsum(tilt, axis=1) - 0.5 * tilt
    velocity += g * dt * np.stack([-along[1], along[0]])
    design = np.stack([np.ones(n), t, 0.5 * t**2], axis=1)
    weight = t * (end - t)
    solve = np.linalg.solve(design.T * weight @ design, design.T * weight)
    fitted = np.einsum("kt,cts->cks", solve, velocity)
    last = (fitted[:, 1] + end * fitted[:, 2]) / g
    return np.stack(
        [
            tilt[0, -1] - last[1],
            tilt[1, -1] + last[0],
            fitted[0, 2] / g / (OMEGA * np.cos(lat)),
        ]
    )


GRADES = pytest.mark.parametrize("errors", [NAVIGATION, TACTICAL], ids=["navigation", "tactical"])


@pytest.mark.parametrize(
    "errors", [NOISE, NAVIGATION, TACTICAL], ids=["noise only", "navigation", "tactical"]
)
def test_predicted_covariance(errors: SensorErrors) -> None:
    """At 60, 300 and 600 s, latitudes 0, 45 and 70, 400 runs each."""
    rng, dt = np.random.default_rng(72), 0.5
    together = 0.0
    for seconds, lat in product((60.0, 300.0, 600.0), (0.0, 45.0 * DEG, 70.0 * DEG)):
        felt = Sway(lat, 0.0, (0.3, -0.2, 2.0)).feel(edges(seconds, 1.0 / dt))
        noise = rng.standard_normal((2, 2, len(felt.dt), RUNS))
        runs = small_errors(errors, lat, noise, rng.standard_normal((2, 2, RUNS)), dt)
        predicted = inertial_frame(*felt.samples, lat, 0.0, errors=errors)
        sigma = np.sqrt(np.diag(predicted.P_n))
        # The scatter of 400 runs is known to 3.5 %.
        assert_allclose(rms(list(runs.T)) / sigma, 1.0, rtol=0.12)
        # Known to 0.05, here within four of these.
        correlations = runs @ runs.T / RUNS / np.outer(sigma, sigma)
        assert_allclose(correlations, predicted.P_n / np.outer(sigma, sigma), rtol=0.0, atol=0.2)
        together += np.einsum("is,ij,js->", runs, np.linalg.inv(predicted.P_n), runs)
        squares = np.sum([(x.tilt**2, x.azimuth**2) for x in predicted.budget], axis=0)
        assert_allclose(squares, np.diag(predicted.P_n)[[0, 2]], rtol=1e-12)
    low, high = chi2.ppf([0.025, 0.975], 9 * 3 * RUNS)
    assert low < together < high


@pytest.mark.parametrize("lat_deg", [-70.0, 0.0, 45.0])
def test_covariance_of_accelerometer_biases_alone(lat_deg: float) -> None:
    """That of (-b_E, b_N, tan(lat) b_E) / g."""
    felt = Sway(lat_deg * DEG).feel(edges(20.0, 5.0))
    found = inertial_frame(*felt.samples, lat_deg * DEG, 0.0, errors=SensorErrors(accel_bias=UG))
    law = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, np.tan(lat_deg * DEG)]])
    law *= UG / float(normal_gravity_zonal(lat_deg * DEG, 0.0).down)
    # Rounding that the tests for motion may take for it.
    assert_allclose(found.P_n, law @ law.T, rtol=1e-9, atol=1e-18)


@GRADES
@pytest.mark.parametrize(("seconds", "lat_deg"), [(60.0, 45.0), (300.0, -70.0), (600.0, 0.0)])
def test_small_errors_are_those_of_the_whole_code(
    errors: SensorErrors, seconds: float, lat_deg: float
) -> None:
    """Run by run: what `test_predicted_covariance` draws is what the alignment would have found."""
    rng = np.random.default_rng(73)
    lat, dt, attitude = lat_deg * DEG, 0.25, (0.3, -0.2, 2.0)
    small = 0.01  # of the errors, so that no second order is left to tell them apart
    felt = Sway(lat, 0.0, attitude).feel(edges(seconds, 1.0 / dt))
    n = len(felt.dt)
    noise, biases = rng.standard_normal((2, 2, n, 6)), rng.standard_normal((2, 2, 6))
    expected = small_errors(errors, lat, noise, biases, dt)
    sigma = np.sqrt(np.diag(inertial_frame(*felt.samples, lat, 0.0, errors=errors).P_n))
    arw, vrw, bg, ba = (
        small * (x or 0.0) for x in (errors.arw, errors.vrw, errors.gyro_bias, errors.accel_bias)
    )
    down = np.zeros((n, 1))
    to_body = felt.attitude.inv()
    for run in range(6):
        gyro = np.hstack(
            [bg * dt * biases[0, :, run] + arw * np.sqrt(dt) * noise[0, :, :, run].T, down]
        )
        accel = np.hstack(
            [ba * dt * biases[1, :, run] + vrw * np.sqrt(dt) * noise[1, :, :, run].T, down]
        )
        found = inertial_frame(
            felt.dt, felt.phi + to_body.apply(gyro), felt.dv + to_body.apply(accel), lat, 0.0
        )
        error = error_n(found.q_nb, felt.attitude) / small
        # First-order in the turn of the Earth over the window, 0.04 in 600 s.
        assert_allclose(error / sigma, expected[:, run] / sigma, rtol=0.0, atol=0.1)


@pytest.mark.parametrize("lat_deg", [-70.0, 0.0, 45.0])
@pytest.mark.parametrize("turn", [Waves(), TWO_DEGREES], ids=["still", "2° sway"])
def test_signs_of_biases(lat_deg: float, turn: Waves) -> None:
    """As TRIAD's, on a swaying base too; north and down gyro biases do not enter."""
    lat = lat_deg * DEG
    felt = Sway(lat, 0.0, (0.03, -0.02, 0.7), turn).feel(edges(240.0, 10.0))
    mean = Rotation.from_euler("ZYX", (0.7, -0.02, 0.03))
    g, level = float(normal_gravity_zonal(lat, 0.0).down), OMEGA * np.cos(lat)
    gyro_n = np.array([0.004, -0.003, 0.005]) * DEG_H
    accel_n = np.array([30.0, -20.0, 40.0]) * UG
    biased = felt.plus(gyro=mean.inv().apply(gyro_n), accel=mean.inv().apply(accel_n))
    found = inertial_frame(*biased.samples, lat, 0.0)
    law = (
        -accel_n[1] / g,
        accel_n[0] / g,
        -gyro_n[1] / level + np.tan(lat) * accel_n[1] / g,
    )
    error = error_n(found.q_nb, felt.attitude)
    # Sway tips the biases by 2°; second order in the drift over the level Earth rate, 1e-3.
    assert_allclose(error[:2], law[:2], rtol=0.0, atol=0.1 * 40.0 * UG / g)
    assert error[2] == pytest.approx(law[2], rel=0.06, abs=2e-6)
    # The tilt shows along north a part of the rate about down.
    shown = gyro_n[0] - OMEGA * np.sin(lat) * accel_n[0] / g
    assert found.rate_residual_north == pytest.approx(shown, rel=0.01)
    # Up is where the specific force is: a bias down shortens it.
    assert found.specific_force_residual == pytest.approx(-accel_n[2], rel=0.1)


def test_convergence() -> None:
    """Attitudes from the first parts scatter about the last one as theory says."""
    rng = np.random.default_rng(74)
    lat = 30.0 * DEG
    shares = []
    for _ in range(30):
        felt = swaying(rng, lat, 2.0 * DEG).feel(edges(300.0, 10.0))
        felt = felt.noisy(rng, NOISE.arw or 0.0, NOISE.vrw or 0.0)
        curve = inertial_frame(*felt.samples, lat, 20.0, errors=NOISE).convergence
        early = (curve.t > 20.0) & (curve.t < 60.0)
        shares.append(curve.off[early, 2] / curve.azimuth_sigma[early])
    assert 30 <= len(curve.t) <= 60
    assert curve.t[0] == pytest.approx(10.0)
    assert curve.t[-1] == 300.0
    assert_allclose(np.log(curve.t[1:-1] / curve.t[:-2]), np.log(1.1), atol=0.02)
    assert_allclose(curve.off[-1], 0.0, atol=1e-15)
    assert curve.azimuth_sigma[0] > 20.0 * curve.azimuth_sigma[-1]
    # 30 runs know it to 13 %; the whole window's own error is small beside it.
    assert np.sqrt(np.mean(np.square(shares))) == pytest.approx(1.0, rel=0.3)


def test_the_gap_is_that_of_the_sum_of_squares() -> None:
    """Davenport's matrix in full, sample by sample, of the same centred and weighted vectors."""
    felt = Sway(0.7, 0.0, (0.3, 1.0, -2.0), TWO_DEGREES).feel(edges(600.0, 5.0))
    found = inertial_frame(*felt.samples, 0.7, 0.0)
    t = np.cumsum(felt.dt)
    ends = Rotation.from_rotvec(felt.phi)
    q, alpha, total = Rotation.identity(), [], np.zeros(3)
    for k in range(len(t)):
        total = total + q.apply(felt.dv[k])
        alpha.append(total)
        q = q * ends[k]
    weight = felt.dt * t * (t[-1] - t)
    a = np.array(alpha) - np.average(alpha, axis=0, weights=weight)
    start = felt.attitude * q.inv()
    rate = OMEGA * np.array([np.cos(0.7), 0.0, -np.sin(0.7)])
    b = (Rotation.from_rotvec(rate * t[-1]) * start).apply(a)

    def times(v: Array, sign: float) -> Array:
        x, y, z = v
        return np.array(
            [
                [0, -x, -y, -z],
                [x, 0, -sign * z, sign * y],
                [y, sign * z, 0, -sign * x],
                [z, -sign * y, sign * x, 0],
            ]
        )

    K = np.zeros((4, 4))
    for w, v_b, v_n in zip(weight, a, b, strict=True):
        difference = times(v_n, 1.0) - times(v_b, -1.0)
        K += w * difference.T @ difference
    values = np.linalg.eigvalsh(K)
    # The smallest is a part in 1e13 of the gap.
    assert found.gap == pytest.approx((values[1] - values[0]) / values[3], rel=1e-6)


def from_log(
    folder: Path, name: str, axes: str, window: tuple[float, float], errors: SensorErrors
) -> tuple[InertialSolution, Rotation]:
    """Align a stretch of a recording; also by its means (TRIAD)."""
    site = KINGSTON if "kingston" in name else CALGARY
    imu = read(folder, name, axes)
    first, stop = np.searchsorted(imu.t, window, side="right")
    imu = imu[slice(int(first), int(stop))]
    frame = InertialFrame(*site, errors=errors)
    for body in reconstruct(to_increments(imu.blocks(8192)), DEFAULT):
        frame.add(body.dt, body.phi, body.dv)
    means = analytic_coarse(imu.dt @ imu.accel, imu.dt @ imu.gyro)
    return frame.solution(), Rotation.from_matrix(means)


@pytest.mark.parametrize("name", ["calgary_ln100_x_up.mcap", "calgary_ln100_x_down.mcap"])
def test_a_recorded_imu_at_rest(shared_data: Path, name: str) -> None:
    """LN-100, pitch ±90°: both methods feel the same biases and differ by noise alone."""
    found, triad = from_log(shared_data, name, "FRD", (-1.0, 400.0), NAVIGATION)
    difference = error_n(found.q_nb, triad)
    assert abs(difference[2]) < 5e-3  # rad: three times the gyro noise stated
    assert np.linalg.norm(difference[:2]) < 2e-5  # rad: end against mean, gyro noise of 300 s
    assert found.velocity_rms < 0.01


def test_a_recorded_car_parked_and_leaving(shared_data: Path) -> None:
    name = "kingston_hg1700_drive.mcap"
    parked, triad = from_log(shared_data, name, "RFU", (5.0, 520.0), TACTICAL)
    assert abs(error_n(parked.q_nb, triad)[2]) < 3.0 * parked.budget[3].azimuth
    assert parked.velocity_rms < 0.1
    leaving, _ = from_log(shared_data, name, "RFU", (520.0, 640.0), TACTICAL)
    assert leaving.velocity_rms > 1.0
    assert leaving.budget[-1].azimuth > 1.0


def test_refusals() -> None:
    for lat_deg in (-89.5, 90.0, np.nan):
        with pytest.raises(AlignmentError, match=r"within 1° of a pole.*give a heading"):
            InertialFrame(lat_deg * DEG, 0.0)
    felt = Sway(0.5).feel(edges(20.0, 10.0))
    with pytest.raises(AlignmentError, match=r"^0.0 s of data are too few"):
        InertialFrame(0.5, 0.0).solution()
    with pytest.raises(AlignmentError, match=r"^9.9 s of data are too few"):
        inertial_frame(*(x[:99] for x in felt.samples), 0.5, 0.0)
    for scale in (0.0, 1.0 / 9.80665):
        with pytest.raises(AlignmentError, match=r"not 9.8: gravity has been removed.*m/s²"):
            inertial_frame(felt.dt, felt.phi, scale * felt.dv, 0.5, 0.0)
    with pytest.raises(ValueError, match=r"\(n, 3\), got \(200,\), \(200, 3\), \(199, 3\)"):
        inertial_frame(felt.dt, felt.phi, felt.dv[1:], 0.5, 0.0)
