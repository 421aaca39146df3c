"""Fine alignment: exact on exact data, truthful sigmas on noisy data, honest about its innovations.

Truth comes from `tests.align.at_rest`; nothing here shares code with the filter.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import navgrade
from align import AlignmentError, KnownHeading, SensorErrors, analytic_coarse
from align.fine import FineSolution, fine_align
from tests.align.at_rest import DEG, DEG_H, UG, Array, Window, attitudes, error_n, rotation, still
from tests.oracles.constants import OMEGA

Mask = NDArray[np.bool_]
EULER = (0.3, -0.2, 0.8)  # rad


@dataclass(frozen=True)
class Grade(SensorErrors):
    """Sensor errors that are all stated."""

    gyro_bias: float
    accel_bias: float
    arw: float
    vrw: float


NAVIGATION = Grade(0.01 * DEG_H, 50.0 * UG, 0.003 * DEG / 60.0, 10.0 * UG)
TACTICAL = Grade(1.0 * DEG_H, 500.0 * UG, 0.1 * DEG / 60.0, 50.0 * UG)
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
    window: Window, errors: Grade, rng: np.random.Generator
) -> tuple[Window, Array, Array]:
    """The window with biases and noise drawn from stated sigmas, and those biases."""
    gyro, accel = errors.gyro_bias * rng.normal(size=3), errors.accel_bias * rng.normal(size=3)
    return window.noisy(rng, errors.arw, errors.vrw).plus(gyro=gyro, accel=accel), gyro, accel


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
    lat_deg: float, errors: Grade
) -> None:
    """(-b_aE/g, b_aN/g, -b_gE/(OMEGA cos L) + tan L b_aE/g); the other three show and are found."""
    window = still(lat_deg, rotation(*EULER), h=800.0, count=600, dt=1.0)
    gyro = 0.05 * errors.gyro_bias * np.array([1.0, -0.8, 0.6])  # north, east, down
    accel = 0.05 * errors.accel_bias * np.array([-0.7, 1.0, 0.5])
    felt = window.plus_n(gyro=gyro, accel=accel)
    # all but noise-free, so that what shows is not drawn toward zero
    sharp = Grade(errors.gyro_bias, errors.accel_bias, 0.01 * errors.arw, 0.01 * errors.vrw)
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
    np.testing.assert_allclose(b_a, [0.0, 0.0, accel[2]], atol=1.1 * likelier * window.g)
    assert b_a[2] == pytest.approx(accel[2], rel=0.0, abs=1e-4 * errors.accel_bias)
    assert [words.split(" (")[0] for words in found.unobservable] == [
        "gyro bias along east",
        "accelerometer bias along north",
        "accelerometer bias along east",
    ]


def least_squares_covariance(window: Window, errors: Grade) -> Array:
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
    noise = np.repeat([errors.arw, errors.vrw], 3) / np.sqrt(duration)
    prior = np.repeat([10.0, errors.gyro_bias, errors.accel_bias], 3)
    # in units of the prior, where the information is well conditioned
    scaled = H * prior / noise[:, None]
    return prior[:, None] * np.linalg.inv(scaled.T @ scaled + np.eye(9)) * prior


@EACH_GRADE
@pytest.mark.parametrize("lat_deg", [-60.0, 0.0, 45.0, 70.0])
@pytest.mark.parametrize("duration", [60.0, 300.0, 600.0])
def test_covariance_is_that_of_three_vectors_and_two_biases(
    lat_deg: float, duration: float, errors: Grade
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
        law = errors.gyro_bias**2 / (OMEGA * np.cos(window.lat))
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
    errors: Grade,
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


@pytest.mark.parametrize(
    ("grade", "duration", "lat_deg"),
    [
        ("navigation", 60.0, 0.0),
        ("navigation", 300.0, 45.0),
        ("navigation", 600.0, 70.0),
        ("tactical", 60.0, 70.0),
        ("tactical", 300.0, 0.0),
        ("tactical", 600.0, 45.0),
    ],
)
def test_errors_are_as_large_as_their_sigmas(grade: str, duration: float, lat_deg: float) -> None:
    """300 simulated alignments at random attitudes, biases and noise drawn as stated."""
    runs = simulate(GRADES[grade], lat_deg, duration)
    # 300 runs give an rms to 4 %, 1 sigma; three of these.
    np.testing.assert_allclose(runs.rms, 1.0, rtol=0.0, atol=0.12)
    assert is_chi_square(runs.attitude_square, 3, 0.95)
    # All nine together as long as heading is known to 7° or so: beyond, the north gyro bias bends
    # away from its tangent by more than it is uncertain.
    if grade == "navigation" or lat_deg < 60.0:
        assert is_chi_square(runs.square, 9, 0.95)


@EACH_GRADE
def test_a_known_heading_shows_the_eastward_gyro_bias(errors: Grade) -> None:
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
    by_noise = errors.arw / np.sqrt(300.0)
    b_sigma = float(np.sqrt(east @ found.P[6:9, 6:9] @ east))
    # the tilt's share tan L b_aE/g of e_D is the accelerometer's, and unknown
    by_tilt = OMEGA * np.sin(window.lat) * errors.accel_bias / window.g
    alone = np.linalg.norm([by_noise, by_tilt, level_rate * sigma])
    blended = 1.0 / np.hypot(1.0 / alone, 1.0 / errors.gyro_bias)
    assert b_sigma == pytest.approx(blended, rel=0.02)
    by_law = -level_rate * error_n(q, window.attitude)[2]
    share = (blended / alone) ** 2  # what the prior leaves of it
    second = abs(by_law) * errors.gyro_bias / level_rate
    tol = 0.2 * b_sigma + second
    assert east @ found.gyro_bias == pytest.approx(share * by_law, rel=0.0, abs=tol)
    assert abs(east @ (found.gyro_bias - gyro)) < 3.0 * b_sigma


@pytest.mark.parametrize("pitch", [-1.5, -0.4, 0.0, 1.2])
def test_a_known_heading_is_that_of_the_nose(pitch: float) -> None:
    """With gyros too weak to speak it stays as given, in every attitude, tilt or not."""
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


def slammed(window: Window, every: float, rng: np.random.Generator) -> tuple[Window, Mask]:
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
def test_door_slams_cut_out_do_not_bias(errors: Grade) -> None:
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


def test_gyros_that_lose_a_little_in_each_slam_do_not_tilt() -> None:
    """Half of what their account is trusted to, ten times in five minutes."""
    rng = np.random.default_rng(16)
    window = still(45.0, rotation(*EULER), count=600, dt=0.5)
    felt, *_ = with_errors(window, NAVIGATION, rng)
    still_rows = (np.cumsum(window.dt) % 30.0) > 2.0
    lost = np.repeat(rng.normal(0.0, 50e-6, size=(150, 3)), 4, axis=0) / 2.0  # rad in 2 s
    felt = felt.plus(gyro=np.where(still_rows, 0.0, 1.0)[:, None] * lost)
    found = refined(felt, coarse(window), still=still_rows)
    units = error_n(found.q_nb, window.attitude) / np.sqrt(np.diag(found.P_n))
    assert np.max(np.abs(units)) < 3.0
    assert found.innovations.consistent


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
    noisy = felt.noisy(np.random.default_rng(8), NAVIGATION.arw, NAVIGATION.vrw)
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
    """A boat at its berth is nudged just before a pause in the recording, and lies still after."""
    sharp = Grade(1e-3 * DEG_H, 0.1 * UG, NAVIGATION.arw, NAVIGATION.vrw)
    window = still(45.0, rotation(*EULER), count=400, dt=0.5)
    felt = window.noisy(np.random.default_rng(9), sharp.arw, sharp.vrw)
    nudge = np.where((np.arange(400) >= 196) & (np.arange(400) < 200), 0.015, 0.0)  # m/s^2, 2 s
    felt = felt.plus_n(accel=np.outer(nudge, [1.0, 0.0, 0.0]))
    t = np.cumsum(window.dt) + np.where(np.arange(400) < 200, 0.0, 120.0)
    micro = {"micro_motion": 0.01, "micro_turn": 1e-5}  # m/s, rad
    paused = refined(felt, coarse(felt), errors=sharp, t=t, **micro)
    units = error_n(paused.q_nb, window.attitude) / np.sqrt(np.diag(paused.P_n))
    assert np.max(np.abs(units)) < 3.0
    assert paused.innovations.t[-1] == 320.0
    # A velocity carried over the pause must end somewhere: in a tilt.
    carried = refined(felt, coarse(felt), errors=sharp, **micro)
    units = error_n(carried.q_nb, window.attitude) / np.sqrt(np.diag(carried.P_n))
    assert np.abs(units[1]) > 5.0
    # The base is known not to have turned: the pause costs north the wobble of two more ends.
    ratio = np.sqrt(paused.P_n[2, 2] / carried.P_n[2, 2])
    assert 1.0 < ratio < 1.3


def test_a_gap_lasts_as_long_as_two_wobbles() -> None:
    """Heading known before, its mean over each part to wobble/sqrt(ends), the base in between."""
    sharp = Grade(1e-4 * DEG_H, 0.1 * UG, NAVIGATION.arw, NAVIGATION.vrw)
    window = still(45.0, rotation(*EULER), count=400, dt=0.5)
    t = np.cumsum(window.dt) + np.where(np.arange(400) < 200, 0.0, 120.0)
    known, wobble = KnownHeading(EULER[2], 1e-5), 1e-3  # rad
    options = {"errors": sharp, "heading": known, "micro_turn": wobble}
    paused = refined(window, quaternion(window.attitude), t=t, **options)
    # rad; the gyros' random walk adds 1e-5
    law = np.hypot(known.sigma, wobble * np.sqrt(2.0 / 201.0))
    assert np.sqrt(paused.P_n[2, 2]) == pytest.approx(law, rel=0.02)
    # Without a pause the gyros carry the heading.
    carried = refined(window, quaternion(window.attitude), **options)
    walk = sharp.arw * np.sqrt(200.0)
    assert np.sqrt(carried.P_n[2, 2]) == pytest.approx(np.hypot(known.sigma, walk), rel=0.02)


def test_without_the_turn_it_is_the_classical_filter() -> None:
    """Zero velocity alone: north shows in the tilt that grows, (ARW^2 T + 2 ARW VRW/g)^½/(T OMEGA
    cos L): a tilt walks as the gyros do, and is leveled to (ARW VRW/g)^½ at either end."""
    sharp = Grade(1e-5 * DEG_H, 1e-3 * UG, NAVIGATION.arw, NAVIGATION.vrw)
    window = still(45.0, rotation(*EULER), count=1200, dt=0.25)
    duration, arw, vrw = 300.0, NAVIGATION.arw, NAVIGATION.vrw
    level_rate = OMEGA * np.cos(window.lat)
    classical = refined(window, quaternion(window.attitude), errors=sharp, micro_turn=0.1)
    walk = np.sqrt(arw**2 * duration + 2.0 * arw * vrw / window.g)
    law = walk / (duration * level_rate)
    assert np.sqrt(classical.P_n[2, 2]) == pytest.approx(law, rel=0.01)
    quiet = refined(window, quaternion(window.attitude), errors=sharp)
    by_rate = arw / np.sqrt(duration) / level_rate
    assert np.sqrt(quiet.P_n[2, 2]) == pytest.approx(by_rate, rel=0.002)


def scaled(errors: Grade, **factors: float) -> Grade:
    return replace(errors, **{name: x * getattr(errors, name) for name, x in factors.items()})


@EACH_GRADE
def test_innovations_of_a_true_model_are_called_consistent(errors: Grade) -> None:
    rng = np.random.default_rng(10)
    good = 0
    for _ in range(60):
        window = still(45.0, rotation(*EULER), count=120, dt=0.5)
        felt, *_ = with_errors(window, errors, rng)
        found = refined(felt, coarse(felt), errors=errors).innovations
        good += found.consistent
        assert found.dof == 6
    assert good >= 52  # of 60 at 95 %: fewer in one of 400 tries


@EACH_GRADE
@pytest.mark.parametrize("name", ["arw", "vrw"])
@pytest.mark.parametrize("factor", [1.0 / 3.0, 3.0])
def test_a_noise_stated_wrong_is_told(errors: Grade, name: str, factor: float) -> None:
    rng = np.random.default_rng(11)
    for _ in range(5):
        felt, *_ = with_errors(still(-20.0, rotation(*EULER), count=120, dt=0.5), errors, rng)
        found = refined(felt, coarse(felt), errors=scaled(errors, **{name: factor})).innovations
        assert not found.consistent
        assert (found.nis.mean() > found.high) == (factor < 1.0)


def test_a_base_that_rocks_is_told_and_may_be_declared() -> None:
    """A tripod in the wind: 20 µrad and 60 µm/s about and along every axis, period 5 s."""
    rng = np.random.default_rng(12)
    window = still(45.0, rotation(*EULER), count=1200, dt=0.25)
    felt, *_ = with_errors(window, NAVIGATION, rng)
    phase = 2.0 * np.pi * np.cumsum(window.dt) / 5.0
    swing = np.sin(phase[:, None] + [0.0, 1.0, 2.0])
    change = np.diff(swing, axis=0, prepend=swing[-1:]) / 0.25
    tilt = np.cross(20e-6 * swing, window.f_ib_b)
    rocking = felt.plus(gyro=20e-6 * change, accel=60e-6 * change - tilt)
    blind = refined(rocking, coarse(rocking))
    assert not blind.innovations.consistent
    assert blind.innovations.nis.mean() > 2.0 * blind.innovations.high
    told = refined(rocking, coarse(rocking), micro_turn=15e-6, micro_motion=45e-6)
    units = error_n(told.q_nb, window.attitude) / np.sqrt(np.diag(told.P_n))
    assert np.max(np.abs(units)) < 3.0
    assert told.innovations.nis.mean() < told.innovations.high


@EACH_GRADE
def test_noise_that_is_not_stated_is_taken_from_the_window(errors: Grade) -> None:
    rng = np.random.default_rng(13)
    unstated = SensorErrors(errors.gyro_bias, errors.accel_bias)
    good = 0
    for _ in range(10):
        felt, *_ = with_errors(still(45.0, rotation(*EULER), count=600, dt=0.5), errors, rng)
        found = refined(felt, coarse(felt), errors=unstated)
        good += found.innovations.consistent
        stated = refined(felt, coarse(felt), errors=errors)
        np.testing.assert_allclose(
            np.sqrt(np.diag(found.P)), np.sqrt(np.diag(stated.P)), rtol=0.15, atol=1e-6
        )
    assert good >= 8


def test_angle_noise_of_the_gyros_is_no_random_walk() -> None:
    """A ring laser's readings jitter by 20 µrad, which five minutes average out as 1/T."""
    rng = np.random.default_rng(14)
    window = still(45.0, rotation(*EULER), count=600, dt=0.5)
    jitter = rng.normal(0.0, 20e-6, size=(601, 3))
    felt, *_ = with_errors(window, NAVIGATION, rng)
    felt = felt.plus(gyro=np.diff(jitter, axis=0) / 0.5)
    unstated = SensorErrors(NAVIGATION.gyro_bias, NAVIGATION.accel_bias)
    found = refined(felt, coarse(felt), errors=unstated)
    units = error_n(found.q_nb, window.attitude) / np.sqrt(np.diag(found.P_n))
    assert np.max(np.abs(units)) < 3.0
    # 6 and what the accelerometers miss of tilts that were none
    assert 5.0 < found.innovations.nis.mean() < 8.0
    # rad: as a random walk, the jitter of 28 µrad/sqrt(0.5 s) would leave 45 mrad of heading
    assert 1e-3 < np.sqrt(found.P_n[2, 2]) < 6e-3


def test_convergence_follows_theory() -> None:
    """1/sqrt(T) from the gyros' noise down to their bias; the last point is the result."""
    window = still(45.0, rotation(*EULER), count=2400, dt=0.25)
    felt, *_ = with_errors(window, NAVIGATION, np.random.default_rng(15))
    curve = refined(felt, coarse(felt)).convergence
    assert curve.t[0] == 0.25
    assert curve.t[-1] == 600.0
    assert np.all(np.diff(curve.t) > 0.0)
    assert 40 <= len(curve.t) <= 60
    np.testing.assert_array_equal(curve.off[-1], 0.0)
    late = curve.t > 10.0
    rate = np.hypot(NAVIGATION.gyro_bias, NAVIGATION.arw / np.sqrt(curve.t))
    law = np.hypot(rate / (OMEGA * np.cos(window.lat)), NAVIGATION.accel_bias / window.g)
    np.testing.assert_allclose(curve.azimuth_sigma[late], law[late], rtol=0.01)
    # biases are common to all points, so only noise is between them
    noise = NAVIGATION.arw / np.sqrt(curve.t) / (OMEGA * np.cos(window.lat))
    assert np.max(np.abs(curve.off[late, 2] / noise[late])) < 4.0
    np.testing.assert_allclose(curve.tilt_sigma[late], NAVIGATION.accel_bias / window.g, rtol=0.02)


WINDOW = still(45.0, rotation(*EULER), count=40)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"still": np.ones(39, bool)}, r"still must have shape \(40,\), got \(39,\)"),
        ({"t": np.full(40, np.nan)}, "t holds a value that is not finite"),
        ({"t": np.minimum(np.arange(40.0), 7.0)}, "t must increase, row 8 does not"),
        ({"micro_motion": 0.0}, "micro_motion must be above 0 m/s, got 0.0"),
        ({"micro_turn": -1e-6}, "micro_turn must be above 0 rad"),
        ({"errors": SensorErrors(arw=-1.0)}, "arw must be above 0"),
        ({"errors": SensorErrors(gyro_bias=0.0)}, "gyro_bias must be above 0 rad/s"),
        ({"heading": KnownHeading(0.0, 0.0)}, "heading.sigma must be above 0 rad"),
    ],
)
def test_arguments_out_of_range_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        refined(WINDOW, quaternion(WINDOW.attitude), **options)


def test_a_span_without_time_is_refused() -> None:
    short = replace(WINDOW, dt=np.where(np.arange(40) == 7, 0.0, 0.5))
    with pytest.raises(ValueError, match="dt must be positive, row 7 is not"):
        refined(short, quaternion(WINDOW.attitude))


def test_windows_that_cannot_be_aligned_are_refused() -> None:
    q = quaternion(WINDOW.attitude)
    with pytest.raises(AlignmentError, match="no span is still"):
        refined(WINDOW, q, still=np.zeros(40, bool))
    with pytest.raises(AlignmentError, match=r"20 still spans do not show.*state arw"):
        refined(WINDOW, q, errors=SensorErrors(), still=np.arange(40) < 20)
    upright = still(45.0, rotation(0.0, 0.5 * np.pi, 0.0), count=40)
    with pytest.raises(AlignmentError, match="straight up or down"):
        known = KnownHeading(0.0, 0.01)
        refined(upright, quaternion(upright.attitude), heading=known)
    # another hemisphere, and a rate that is not the Earth's
    elsewhere = replace(WINDOW, omega_ib_b=WINDOW.omega_ib_b + 1e-3)
    with pytest.raises(AlignmentError, match="still turns by"):
        refined(elsewhere, q)


def spans(
    samples: navgrade.ImuSamples, rows: slice | Mask, count: int
) -> tuple[Array, Array, Array]:
    """Durations and means of so many samples each."""
    dt, gyro, accel = (x[rows] for x in (samples.dt, samples.gyro, samples.accel))
    first = np.arange(0, len(dt) - count + 1, count)
    end = first[-1] + count
    length = np.add.reduceat(dt[:end], first)
    means = [
        np.add.reduceat(dt[:end, None] * x[:end], first) / length[:, None] for x in (gyro, accel)
    ]
    return length, means[0], means[1]


@pytest.mark.parametrize("name", ["up", "down"])
def test_ln100_on_its_tail_and_on_its_nose(shared_data: Path, name: str) -> None:
    """Navigation grade: the gyro bias along the vertical shows, and is the same both ways."""
    samples = navgrade.read_imu(
        shared_data / f"calgary_ln100_x_{name}.mcap", None, kind="average", axes="FRD"
    )
    rows = spans(samples, slice(None), 32)
    means = [rows[0] @ x / rows[0].sum() for x in rows[1:]]
    triad = Rotation.from_matrix(analytic_coarse(means[1], means[0]))
    stated = SensorErrors(gyro_bias=0.25 * DEG_H, accel_bias=50.0 * UG)
    found = fine_align(*rows, quaternion(triad), 51.07995352 * DEG, 1118.5, errors=stated)
    sigma = np.sqrt(np.diag(found.P_n))
    off = error_n(found.q_nb, triad)
    assert np.all(np.abs(off) < 0.4 * sigma)  # the same data, and the jitter of its end
    assert sigma[2] / DEG == pytest.approx(1.5, rel=0.0, abs=0.1)
    # deg/h: -0.25 +- 0.05 from both together, 0.04 of sigma each
    assert found.gyro_bias[0] / DEG_H == pytest.approx(-0.25, rel=0.0, abs=0.05)
    assert found.gyro_bias_sigma[0] < 0.06 * DEG_H
    assert [words.split(" (")[0] for words in found.unobservable] == [
        "gyro bias along east",
        "accelerometer bias along north",
        "accelerometer bias along east",
    ]
    # a sine in the laser's jitter, and less noise than 16 means of it show
    assert 1.0 < found.innovations.nis.mean() < 6.0


def test_a_parked_car(shared_data: Path) -> None:
    samples = navgrade.read_imu(
        shared_data / "kingston_hg1700_drive.mcap", None, kind="average", axes="RFU"
    )
    rows = spans(samples, (samples.t > 5.0) & (samples.t <= 520.0), 5)
    place = 44.23249 * DEG, 39.94
    means = [rows[0] @ x / rows[0].sum() for x in rows[1:]]
    q = quaternion(Rotation.from_matrix(analytic_coarse(means[1], means[0])))
    stated = SensorErrors(gyro_bias=1.5 * DEG_H, accel_bias=1000.0 * UG)
    by_gyros = fine_align(*rows, q, *place, errors=stated)
    heading, pitch, roll = Rotation.from_quat(by_gyros.q_nb, scalar_first=True).as_euler("ZYX")
    assert roll / DEG == pytest.approx(-0.246, rel=0.0, abs=0.05)
    assert pitch / DEG == pytest.approx(-0.339, rel=0.0, abs=0.05)
    assert heading % (2.0 * np.pi) / DEG == pytest.approx(201.0, rel=0.0, abs=2.0)
    assert np.sqrt(by_gyros.P_n[2, 2]) / DEG > 1.0
    assert by_gyros.gyro_bias[2] / DEG_H == pytest.approx(2.1, rel=0.0, abs=0.1)
    known = KnownHeading(201.0 * DEG, 1.0 * DEG)
    by_survey = fine_align(*rows, q, *place, errors=stated, heading=known)
    assert np.sqrt(by_survey.P_n[2, 2]) / DEG == pytest.approx(1.0, rel=0.02)
    assert not any("gyro" in words for words in by_survey.unobservable)
    # people in the car: the filter is told by itself that its noise is not the sensors' alone
    strict = SensorErrors(1.5 * DEG_H, 1000.0 * UG, 0.05 * DEG / 60.0, 50.0 * UG)
    assert not fine_align(*rows, q, *place, errors=strict).innovations.consistent
