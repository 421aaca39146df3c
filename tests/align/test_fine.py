"""Fine alignment: exact on exact data, truthful sigmas on noisy data, honest about its innovations.

Truth comes from `tests.align.at_rest`; nothing here shares code with the filter.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from align import KnownHeading, SensorErrors, analytic_coarse
from align.fine import FineSolution, fine_align
from tests.align.at_rest import DEG, DEG_H, UG, Array, Window, attitudes, error_n, rotation, still
from tests.oracles.constants import OMEGA

EULER = (0.3, -0.2, 0.8)  # rad
NAVIGATION = SensorErrors(0.01 * DEG_H, 50.0 * UG, 0.003 * DEG / 60.0, 10.0 * UG)
TACTICAL = SensorErrors(1.0 * DEG_H, 500.0 * UG, 0.1 * DEG / 60.0, 50.0 * UG)
GRADES = {"navigation": NAVIGATION, "tactical": TACTICAL}
EACH_GRADE = pytest.mark.parametrize("errors", GRADES.values(), ids=GRADES.keys())


def quaternion(attitude: Rotation) -> Array:
    return np.asarray(attitude.as_quat(scalar_first=True))


def turned(attitude: Rotation, *about_n: float) -> Array:
    """The attitude turned by a rotation vector about north, east, down, as a quaternion."""
    return quaternion(Rotation.from_rotvec(about_n) * attitude)


def coarse(window: Window) -> Array:
    means = window.f_ib_b.mean(axis=0), window.omega_ib_b.mean(axis=0)
    return quaternion(Rotation.from_matrix(analytic_coarse(*means)))


def refined(window: Window, q_nb: Array, **options: object) -> FineSolution:
    options.setdefault("errors", NAVIGATION)
    return fine_align(*window.samples[:3], q_nb, window.lat, window.h, **options)  # type: ignore[arg-type]


def with_errors(
    window: Window, errors: SensorErrors, rng: np.random.Generator
) -> tuple[Window, Array, Array]:
    """The window with biases and noise drawn from stated sigmas, and those biases."""
    gyro, accel = errors.gyro_bias * rng.normal(size=3), errors.accel_bias * rng.normal(size=3)  # type: ignore[operator]
    return window.noisy(rng, errors.arw, errors.vrw).plus(gyro=gyro, accel=accel), gyro, accel  # type: ignore[arg-type]


@pytest.mark.parametrize("lat_deg", [-80, -60, -33.9, -5, 0, 18.4, 51.08, 80])
def test_exact_data_stay_exact(lat_deg: float) -> None:
    """200 attitudes, upside down and at pitch ±90° too."""
    for euler in attitudes():
        window = still(lat_deg, rotation(*euler), count=5)
        found = refined(window, quaternion(window.attitude))
        assert np.linalg.norm(error_n(found.q_nb, window.attitude)) < 1e-13, euler  # rad
        # The means are rounded to 1e-16 of g and of the Earth rate.
        assert np.linalg.norm(found.accel_bias) < 1e-13  # m/s^2
        assert np.linalg.norm(found.gyro_bias) < 1e-18  # rad/s
        assert np.linalg.norm(found.v_eb_n) < 1e-13  # m/s


@pytest.mark.parametrize("lat_deg", [-80.0, -33.9, 0.0, 51.08, 80.0])
@pytest.mark.parametrize("off_deg", [3.0, 30.0])
def test_a_coarse_attitude_that_is_off_leaves_no_trace(lat_deg: float, off_deg: float) -> None:
    """Half a degree of tilt with 3° of heading, and ten times that."""
    for euler in attitudes()[::20]:
        window = still(lat_deg, rotation(*euler), count=40)
        off = off_deg * DEG * np.array([0.12, -0.12, 1.0])
        found = refined(window, turned(window.attitude, *off))
        # rad: the last step is below 1e-6, what it leaves is of its square
        assert np.linalg.norm(error_n(found.q_nb, window.attitude)) < 1e-11, euler


@EACH_GRADE
@pytest.mark.parametrize("lat_deg", [-45.0, 0.0, 70.0])
def test_unobservable_biases_tilt_and_turn_by_the_signed_laws(
    lat_deg: float, errors: SensorErrors
) -> None:
    """(-b_aE/g, b_aN/g, -b_gE/(OMEGA cos L) + tan L b_aE/g); the other three show and are found."""
    window = still(lat_deg, rotation(*EULER), h=800.0, count=600, dt=1.0)
    gyro = 0.05 * errors.gyro_bias * np.array([1.0, -0.8, 0.6])  # north, east, down
    accel = 0.05 * errors.accel_bias * np.array([-0.7, 1.0, 0.5])
    felt = window.plus_n(gyro=gyro, accel=accel)
    # all but noise-free, so that what shows is not drawn toward zero
    sharp = SensorErrors(errors.gyro_bias, errors.accel_bias, 0.01 * errors.arw, 0.01 * errors.vrw)
    found = refined(felt, coarse(felt), errors=sharp)
    level_rate, tan_lat = OMEGA * np.cos(window.lat), np.tan(window.lat)
    law = [
        -accel[1] / window.g,
        accel[0] / window.g,
        -gyro[1] / level_rate + tan_lat * accel[1] / window.g,
    ]
    # rad: second order, and the 0.1 or 0.2 µrad of tilt that make the other gyro biases likelier
    likelier = 0.06 * OMEGA / errors.gyro_bias * (errors.accel_bias / window.g) ** 2
    tol = 1.1 * likelier + 2.0 * np.linalg.norm(law) ** 2 + 1e-9
    np.testing.assert_allclose(error_n(found.q_nb, window.attitude), law, rtol=0.0, atol=tol)
    b_g, b_a = window.attitude.apply(found.gyro_bias), window.attitude.apply(found.accel_bias)
    np.testing.assert_allclose(b_g, [gyro[0], 0.0, gyro[2]], atol=3e-3 * errors.gyro_bias)
    np.testing.assert_allclose(b_a, [0.0, 0.0, accel[2]], atol=5e-4 * errors.accel_bias)
    assert [words.split(" (")[0] for words in found.unobservable] == [
        "gyro bias along east",
        "accelerometer bias along north",
        "accelerometer bias along east",
    ]


def least_squares_covariance(window: Window, errors: SensorErrors) -> Array:
    """Of rotation (NED) and both biases (body) from the window's means, by information.

    The means of the rate and of the specific force in n are Earth rate and reaction to gravity,
    turned by the rotation error, plus bias, plus white noise over the duration.
    """

    def cross(v: Array) -> Array:
        return np.cross(np.eye(3), v)

    duration = float(window.dt.sum())
    C = window.attitude.as_matrix()
    to_n = np.array([np.cos(window.lat), 0.0, -np.sin(window.lat)])
    reaction = C @ window.f_ib_b[0]
    H = np.zeros((6, 9))
    H[:3, :3], H[:3, 3:6] = cross(OMEGA * to_n), C
    H[3:, :3], H[3:, 6:] = cross(reaction), C
    noise = np.repeat([errors.arw, errors.vrw], 3) / np.sqrt(duration)  # type: ignore[list-item]
    prior = np.repeat([10.0, errors.gyro_bias, errors.accel_bias], 3)  # type: ignore[list-item]
    # in units of the prior, where the information is well conditioned
    scaled = H * prior / noise[:, None]
    return prior[:, None] * np.linalg.inv(scaled.T @ scaled + np.eye(9)) * prior


@EACH_GRADE
@pytest.mark.parametrize("lat_deg", [-60.0, 0.0, 45.0, 70.0])
@pytest.mark.parametrize("duration", [60.0, 300.0, 600.0])
def test_covariance_is_that_of_three_vectors_and_two_biases(
    lat_deg: float, duration: float, errors: SensorErrors
) -> None:
    """A base that does not turn: the filter knows no less than the means of its window."""
    window = still(lat_deg, rotation(*EULER), count=int(2.0 * duration), dt=0.5)
    found = refined(window, quaternion(window.attitude), errors=errors)
    kept = np.r_[0:3, 6:12]
    expected = least_squares_covariance(window, errors)
    sigma = np.sqrt(np.diag(expected))
    off = (found.P[np.ix_(kept, kept)] - expected) / sigma / sigma[:, None]
    # of sigma^2: that heading is known to lie on the circle takes 1.8 % where it is 14° uncertain
    assert np.max(np.abs(off)) < 0.02
    np.testing.assert_array_equal(found.P_n, found.P[:3, :3])
    np.testing.assert_array_equal(found.P, found.P.T)
    # the floor of every method, closed form
    b_a = np.hypot(errors.accel_bias, errors.vrw / np.sqrt(duration)) / window.g
    by_rate = np.hypot(errors.gyro_bias, errors.arw / np.sqrt(duration)) / OMEGA
    triad = np.hypot(by_rate, b_a * np.sin(window.lat)) / np.cos(window.lat)
    assert np.sqrt(found.P_n[2, 2]) < 1.005 * triad
    assert np.sqrt(found.P_n[0, 0]) < 1.005 * b_a
    # estimate minus truth of heading and of the eastward gyro bias go together
    if errors is TACTICAL:
        shared = found.P[2, 6:9] @ window.attitude.as_matrix()[1]
        law = errors.gyro_bias**2 / (OMEGA * np.cos(window.lat))  # type: ignore[operator]
        assert shared == pytest.approx(law, rel=0.03)


@dataclass
class Runs:
    """Errors of many simulated alignments in units of the sigmas they reported."""

    unit: Array  # (runs, 9): rotation, gyro bias, accelerometer bias
    square: Array  # of all nine, error^T P^-1 error
    attitude_square: Array  # of the rotation alone

    @property
    def rms(self) -> Array:
        """Of tilt, heading, gyro bias and accelerometer bias; 1 when the sigmas are true."""
        square = np.mean(self.unit**2, axis=0)
        parts = square[:2], square[2:3], square[3:6], square[6:]
        return np.sqrt([np.mean(part) for part in parts])


def rotation_error(q_nb: Array, attitude: Rotation) -> Array:
    """Tilts by the true vertical in the estimated frame, linear in the biases at any heading."""
    turn = Rotation.from_quat(q_nb, scalar_first=True) * attitude.inv()
    down = turn.apply([0.0, 0.0, 1.0])
    return np.array([-down[1], down[0], turn.as_rotvec()[2]])


def simulate(
    errors: SensorErrors,
    lat_deg: float,
    duration: float,
    *,
    runs: int = 300,
    count: int = 12,
    heading_sigma: float | None = None,
) -> Runs:
    rng = np.random.default_rng([int(duration), int(lat_deg) + 90, runs])
    kept = np.r_[0:3, 6:12]
    places = [
        still(lat_deg, attitude, h=300.0, count=count, dt=duration / count)
        for attitude in Rotation.random(10, rng=rng)
    ]
    unit, square, attitude_square = [], [], []
    for run in range(runs):
        window = places[run % 10]
        felt, gyro, accel = with_errors(window, errors, rng)
        known = None
        if heading_sigma is not None:
            truth = window.attitude.as_euler("ZYX")[0]
            known = KnownHeading(truth + heading_sigma * rng.normal(), heading_sigma)
        found = refined(felt, coarse(felt), errors=errors, heading=known)
        turn = rotation_error(found.q_nb, window.attitude)
        off = np.concatenate((turn, found.gyro_bias - gyro, found.accel_bias - accel))
        P = found.P[np.ix_(kept, kept)]
        sigma = np.sqrt(np.diag(P))
        unit.append(off / sigma)
        P /= np.outer(sigma, sigma)
        square.append(unit[-1] @ np.linalg.solve(P, unit[-1]))
        attitude_square.append(unit[-1][:3] @ np.linalg.solve(P[:3, :3], unit[-1][:3]))
    return Runs(np.array(unit), np.array(square), np.array(attitude_square))


def is_chi_square(squares: Array, dof: int, confidence: float) -> bool:
    tail = 0.5 - 0.5 * confidence
    low, high = chi2.ppf([tail, 1.0 - tail], dof * len(squares))
    return bool(low < squares.sum() < high)


@EACH_GRADE
@pytest.mark.parametrize(
    ("duration", "lat_deg"),
    [(60.0, 0.0), (60.0, 70.0), (300.0, 0.0), (300.0, 45.0), (600.0, 45.0), (600.0, 70.0)],
)
def test_errors_are_as_large_as_their_sigmas(
    duration: float, lat_deg: float, errors: SensorErrors
) -> None:
    """300 simulated alignments at random attitudes, biases and noise drawn as stated."""
    runs = simulate(errors, lat_deg, duration)
    # 300 runs give an rms to 4 %, 1 sigma; the issue asks for 12 %.
    np.testing.assert_allclose(runs.rms, 1.0, rtol=0.0, atol=0.12)
    assert is_chi_square(runs.attitude_square, 3, 0.95)
    # All nine together as long as heading is known to 7° or so: beyond, the north gyro bias bends
    # away from its tangent by more than it is uncertain.
    if errors is NAVIGATION or lat_deg < 60.0:
        assert is_chi_square(runs.square, 9, 0.95)


@EACH_GRADE
def test_a_known_heading_shows_the_eastward_gyro_bias(errors: SensorErrors) -> None:
    """b_gE = -e_D OMEGA cos L of the heading the gyros alone would have found."""
    sigma = 1e-4  # rad
    runs = simulate(errors, 45.0, 300.0, runs=200, heading_sigma=sigma)
    np.testing.assert_allclose(runs.rms, 1.0, rtol=0.0, atol=0.15)  # 200 runs: 5 %, 1 sigma
    assert is_chi_square(runs.square, 9, 0.95)

    window = still(45.0, rotation(*EULER), count=300, dt=1.0)
    felt, gyro, _ = with_errors(window, errors, np.random.default_rng(6))
    q = coarse(felt)
    found = refined(felt, q, errors=errors, heading=KnownHeading(EULER[2], sigma))
    assert not any("gyro bias along east" in words for words in found.unobservable)
    east = window.attitude.as_matrix()[1]
    level_rate = OMEGA * np.cos(window.lat)
    by_noise = errors.arw / np.sqrt(300.0)  # type: ignore[operator]
    b_sigma = float(np.sqrt(east @ found.P[6:9, 6:9] @ east))
    # the tilt's share tan L b_aE/g of e_D is the accelerometer's, and unknown
    by_tilt = OMEGA * np.sin(window.lat) * errors.accel_bias / window.g  # type: ignore[operator]
    alone = np.linalg.norm([by_noise, by_tilt, level_rate * sigma])
    blended = 1.0 / np.hypot(1.0 / alone, 1.0 / errors.gyro_bias)  # type: ignore[operator]
    assert b_sigma == pytest.approx(blended, rel=0.02)
    by_law = -level_rate * error_n(q, window.attitude)[2]
    share = (blended / alone) ** 2  # what the prior leaves of it
    second = abs(by_law) * errors.gyro_bias / level_rate  # type: ignore[operator]
    tol = 0.2 * b_sigma + second
    assert east @ found.gyro_bias == pytest.approx(share * by_law, rel=0.0, abs=tol)
    assert abs(east @ (found.gyro_bias - gyro)) < 3.0 * b_sigma


@pytest.mark.parametrize("pitch", [-1.5, -0.4, 0.0, 1.2])
def test_a_known_heading_is_that_of_the_nose(pitch: float) -> None:
    """With gyros too weak to speak, heading is as given, in every attitude; tilt does not move it."""
    weak = SensorErrors(100.0 * DEG_H, 50.0 * UG, 1.0 * DEG / 60.0, 10.0 * UG)
    for roll, heading in ((0.2, 3.1), (-2.8, -3.1), (1.4, 0.5)):
        window = still(-50.0, rotation(roll, pitch, heading), count=60, dt=1.0)
        felt = window.plus_n(accel=(0.0, 40.0 * UG, 0.0), gyro=(0.0, 20.0 * DEG_H, 0.0))
        known = KnownHeading(heading + 2.0 * np.pi, 1e-5)
        found = refined(felt, turned(window.attitude, 0, 0, 0.3), errors=weak, heading=known)
        yaw = Rotation.from_quat(found.q_nb, scalar_first=True).as_euler("ZYX")[0]
        assert np.angle(np.exp(1j * (yaw - heading))) == pytest.approx(0.0, rel=0.0, abs=1e-7)
        # rad: a bias of 40 µg seen by a filter that expects 50 tilts by all of it
        tilt = error_n(found.q_nb, window.attitude)[0]
        assert tilt == pytest.approx(-40.0 * UG / window.g, rel=0.01)


def slammed(window: Window, every: float, rng: np.random.Generator) -> tuple[Window, Array]:
    """The window with 2 s of shaking out of every so many, and where it is still."""
    end = np.cumsum(window.dt)
    still_rows = (end % every) > 2.0
    hit = ~still_rows[:, None]
    force = hit * rng.normal(0.02, 0.3, size=(len(end), 3))  # m/s^2, with a mean
    angle = np.zeros((len(end) + 1, 3))  # rad, back where it was when the shaking ends
    angle[:-1] = hit * rng.normal(0.0, 0.1 * DEG, size=(len(end), 3))
    angle[:-1][np.roll(still_rows, 1)] = 0.0
    return window.plus(gyro=np.diff(angle, axis=0) / window.dt[:, None], accel=force), still_rows


@EACH_GRADE
def test_door_slams_cut_out_do_not_bias(errors: SensorErrors) -> None:
    rng = np.random.default_rng(7)
    window = still(45.0, rotation(*EULER), count=600, dt=0.5)
    felt, *_ = with_errors(window, errors, rng)
    felt, still_rows = slammed(felt, 30.0, rng)
    q = turned(window.attitude, 0.005, -0.005, 0.05)
    found = refined(felt, q, errors=errors, still=still_rows)
    units = error_n(found.q_nb, window.attitude) / np.sqrt(np.diag(found.P_n))
    assert np.max(np.abs(units)) < 3.0
    assert found.innovations.consistent
    assert found.innovations.nis.shape == (still_rows.sum(),)
    # what is lost is the time: a fifteenth
    whole = refined(window, q, errors=errors)
    assert np.sqrt(found.P_n[2, 2] / whole.P_n[2, 2]) < 1.05

    blind = refined(felt, q, errors=errors)
    assert not blind.innovations.consistent


def test_a_base_that_a_disturbance_turns_is_followed_by_the_gyros() -> None:
    """People get out, the car turns and tips: the attitude at the end is the new one."""
    window = still(45.0, rotation(*EULER), count=600, dt=0.5)
    turn = np.array([0.02, -0.03, 0.05])  # rad, body
    after = still(45.0, window.attitude * Rotation.from_rotvec(turn), count=600, dt=0.5)
    still_rows = np.ones(600, bool)
    still_rows[300:304] = False
    rate = np.where(np.arange(600)[:, None] < 302, window.omega_ib_b, after.omega_ib_b)
    rate[300:304] += turn / 2.0  # over 2 s
    force = np.where(np.arange(600)[:, None] < 302, window.f_ib_b, after.f_ib_b)
    force[300:304] += 0.5
    felt = Window(window.dt, rate, force, window.lat, window.h, after.attitude)
    found = refined(felt, coarse(after), still=still_rows)
    # rad: the Earth rate of 2 s, resolved half a turn too early or late
    assert np.linalg.norm(error_n(found.q_nb, after.attitude)) < 5e-6
    kept = refined(felt, coarse(window), still=still_rows, errors=NAVIGATION)
    assert np.linalg.norm(error_n(kept.q_nb, found_attitude(found))) < 1e-9
    # noise and all, the two halves are one window
    noisy = felt.noisy(np.random.default_rng(8), NAVIGATION.arw, NAVIGATION.vrw)  # type: ignore[arg-type]
    found = refined(noisy, coarse(after), still=still_rows)
    units = error_n(found.q_nb, after.attitude) / np.sqrt(np.diag(found.P_n))
    assert np.max(np.abs(units)) < 3.0
    assert found.innovations.consistent
    whole = refined(window, coarse(window))
    assert np.sqrt(found.P_n[2, 2] / whole.P_n[2, 2]) < 1.05


def found_attitude(found: FineSolution) -> Rotation:
    return Rotation.from_quat(found.q_nb, scalar_first=True)


def test_a_disturbance_at_the_start_and_at_the_end() -> None:
    window = still(-30.0, rotation(*EULER), count=200, dt=0.5)
    still_rows = np.ones(200, bool)
    still_rows[:5] = still_rows[-5:] = False
    shaken = window.plus(accel=np.where(still_rows, 0.0, 3.0)[:, None])
    found = refined(shaken, coarse(window), still=still_rows)
    assert np.linalg.norm(error_n(found.q_nb, window.attitude)) < 1e-9  # rad
    assert found.innovations.t[[0, -1]].tolist() == [3.0, 97.5]


def test_a_gap_keeps_the_attitude_and_restarts_the_velocity() -> None:
    """Two minutes without samples, after which base and velocity are elsewhere within bounds."""
    window = still(45.0, rotation(*EULER), count=400, dt=0.5)
    t = np.cumsum(window.dt) + np.where(np.arange(400) < 200, 0.0, 120.0)
    micro = {"micro_motion": 0.02, "micro_turn": 1e-3}  # a boat at berth, m/s and rad
    # the boat drifts to and fro in a slow, smooth way, and starts anew after the gap
    speed = np.concatenate((np.full(201, -0.03), np.full(200, 0.03)))
    felt = window.noisy(np.random.default_rng(9), NAVIGATION.arw, NAVIGATION.vrw)  # type: ignore[arg-type]
    assert speed[200] != speed[201]
    with_gap = refined(felt, coarse(felt), t=t, **micro)
    without = refined(felt, coarse(felt), **micro)
    # in the gap nothing is learned and nothing lost but the common reference of the ends
    assert with_gap.P_n[2, 2] > without.P_n[2, 2]
    units = error_n(with_gap.q_nb, window.attitude) / np.sqrt(np.diag(with_gap.P_n))
    assert np.max(np.abs(units)) < 3.0
    assert with_gap.innovations.t[-1] == 320.0
