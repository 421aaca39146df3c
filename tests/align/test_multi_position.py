"""Attitude and biases from several still orientations."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

import navgrade
from align.accuracy import SensorErrors
from align.errors import AlignmentError
from align.multi_position import MultiPositionSolution, Position, align_positions
from tests.align.at_rest import DEG, DEG_H, UG, Window, attitudes, error_n, rotation, still
from tests.oracles.constants import OMEGA

ARW = 0.003 * DEG / 60.0  # rad/sqrt(s), navigation grade: 0.003 deg/sqrt(h)
VRW = 10.0 * UG  # (m/s)/sqrt(s)
NAVIGATION = SensorErrors(gyro_bias=0.01 * DEG_H, accel_bias=50.0 * UG, arw=ARW, vrw=VRW)
# Next to no noise: what the data tell is not pulled toward what was stated.
QUIET = SensorErrors(0.1 * DEG_H, 500.0 * UG, 1e-5 * ARW, 1e-5 * VRW)
ATTITUDES = [rotation(*euler) for euler in attitudes()]


def position(
    window: Window, duration: float, gyro: ArrayLike = 0.0, accel: ArrayLike = 0.0
) -> Position:
    felt = window.plus(gyro=gyro, accel=accel)
    return Position(felt.omega_ib_b[0], felt.f_ib_b[0], duration)


def turned(positions: list[Position], windows: list[Window], sigma: float) -> list[Position]:
    """The positions with the turns between them known."""
    turns = [
        (before.attitude.inv() * after.attitude).as_quat(scalar_first=True)
        for before, after in pairwise(windows)
    ]
    rest = zip(positions[1:], turns, strict=True)
    return positions[:1] + [replace(p, turn=turn, turn_sigma=sigma) for p, turn in rest]


def worst_error(found: MultiPositionSolution, windows: list[Window]) -> float:
    pairs = zip(found.q_nb, windows, strict=True)
    return max(float(np.linalg.norm(error_n(q, w.attitude))) for q, w in pairs)


LATITUDES = (-80.0, -60.0, -33.9, -5.0, 0.0, 18.4, 51.08, 80.0)  # deg


@pytest.mark.parametrize("shift", [0, 3])
def test_perfect_pairs(shift: int) -> None:
    """200 pairs, whatever their geometry: nothing stated or unstated turns perfect data."""
    for k, attitude in enumerate(ATTITUDES):
        lat_deg, h = LATITUDES[(k + shift) % 8], (0.0, 9000.0)[k % 2]
        pair = attitude, ATTITUDES[(7 * k + 3) % 200]
        windows = [still(lat_deg, a, h=h, count=1) for a in pair]
        rows = [position(w, 300.0) for w in windows]
        found = align_positions(rows, windows[0].lat, h, errors=NAVIGATION)
        assert worst_error(found, windows) < 1e-12  # rad
        assert found.chi2 < 1e-9


def test_biases_of_perfect_triples() -> None:
    """Three orientations show every bias; without noise they show it exactly."""
    rng = np.random.default_rng(70)
    judged = 0
    for k, attitude in enumerate(ATTITUDES):
        triple = attitude, ATTITUDES[(11 * k + 57) % 200], ATTITUDES[(13 * k + 91) % 200]
        windows = [still(LATITUDES[k % 8], a, h=500.0, count=1) for a in triple]
        gyro, accel = 0.05 * DEG_H * rng.normal(size=3), 200.0 * UG * rng.normal(size=3)
        rows = [position(w, 300.0, gyro, accel) for w in windows]
        found = align_positions(rows, windows[0].lat, 500.0, errors=QUIET)
        if np.max(found.gyro_bias_sigma) > 1e-6 * OMEGA or np.max(found.accel_bias_sigma) > 1e-5:
            continue  # nearly the same orientation three times
        judged += 1
        assert worst_error(found, windows) < 1e-9  # rad
        np.testing.assert_allclose(found.gyro_bias, gyro, rtol=0.0, atol=1e-9 * OMEGA)
        np.testing.assert_allclose(found.accel_bias, accel, rtol=0.0, atol=1e-9 * 9.8)
        assert found.unobservable == ()
    assert judged > 150


@pytest.mark.parametrize(
    ("count", "known"), [(2, False), (2, True), (4, False)], ids=["pair", "known turn", "four"]
)
def test_sigmas_are_the_scatter(count: int, known: bool) -> None:
    """200 runs, each with attitudes, place, biases, gravity disturbance and noise of its own."""
    rng = np.random.default_rng(80 + count)
    turn_sigma, duration, runs = 1e-4, 200.0, 200  # rad, s
    attitude, gyro, accel, fit = [], [], [], []
    for _ in range(runs):
        lat_deg = float(rng.choice([-60.0, -30.0, 0.0, 45.0]))
        windows = [still(lat_deg, a, h=200.0, count=1) for a in Rotation.random(count, rng=rng)]
        b_g = NAVIGATION.gyro_bias * rng.normal(size=3)
        b_a = NAVIGATION.accel_bias * rng.normal(size=3)
        heavier = 1.0 + 5e-4 * rng.normal() / windows[0].g  # 50 mGal
        rows = []
        for w in windows:
            noise = rng.normal(size=(2, 3)) / np.sqrt(duration)
            up = w.f_ib_b[0] * (heavier - 1.0)
            rows.append(position(w, duration, b_g + ARW * noise[0], b_a + up + VRW * noise[1]))
        if known:
            rows = turned(rows, windows, turn_sigma)
            off = Rotation.from_rotvec(turn_sigma * rng.normal(size=3))
            turn = off * Rotation.from_quat(rows[1].turn, scalar_first=True)
            rows[1] = replace(rows[1], turn=turn.as_quat(scalar_first=True))
        found = align_positions(rows, windows[0].lat, 200.0, errors=NAVIGATION)
        last = error_n(found.q_nb[-1], windows[-1].attitude)
        attitude.append(last @ np.linalg.solve(found.P_n[-1], last))
        gyro.append((found.gyro_bias - b_g) / found.gyro_bias_sigma)
        accel.append((found.accel_bias - b_a) / found.accel_bias_sigma)
        fit.append(found.chi2)
    low, high = chi2.ppf([0.005, 0.995], 3 * runs)
    assert low < np.sum(attitude) < high
    low, high = chi2.ppf([0.005, 0.995], found.dof * runs)
    assert low < np.sum(fit) < high
    assert found.dof == 3 * count + 3 * known
    low, high = chi2.ppf([0.001, 0.999], runs)
    for errors in (gyro, accel):
        squares = np.sum(np.square(errors), axis=0)
        assert np.all((low < squares) & (squares < high))


def half_turn(rng: np.random.Generator) -> tuple[MultiPositionSolution, list[Window]]:
    """150 s each before and after half a turn about the vertical, navigation grade."""
    windows = [still(45.0, rotation(0.0, 0.0, 0.7 + turn), count=1) for turn in (0.0, np.pi)]
    b_g = NAVIGATION.gyro_bias * rng.normal(size=3)
    b_a = NAVIGATION.accel_bias * rng.normal(size=3)
    rows = []
    for w in windows:
        noise = rng.normal(size=(2, 3)) / np.sqrt(150.0)
        rows.append(position(w, 150.0, b_g + ARW * noise[0], b_a + VRW * noise[1]))
    rows = turned(rows, windows, 1e-8)
    return align_positions(rows, windows[0].lat, 0.0, errors=NAVIGATION), windows


def test_half_a_turn_cancels_level_biases() -> None:
    """What no single position reaches in 300 s: 50 µrad of tilt and 1.36 mrad of heading."""
    rng = np.random.default_rng(90)
    errors = []
    for _ in range(200):
        found, windows = half_turn(rng)
        errors.append(error_n(found.q_nb[0], windows[0].attitude))
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    # Noise of 300 s alone: 0.003 deg/sqrt(h) over the level Earth rate, 10 µg over gravity.
    heading = ARW / np.sqrt(300.0) / (OMEGA * np.cos(45.0 * DEG))
    tilt = VRW / np.sqrt(300.0) / windows[0].g
    assert 1e3 * heading == pytest.approx(0.98, abs=0.01)  # mrad
    # Relative: the rms of 200 runs is known to 5 %.
    np.testing.assert_allclose(rms, (tilt, tilt, heading), rtol=0.15)
    np.testing.assert_allclose(np.sqrt(np.diag(found.P_n[0])), (tilt, tilt, heading), rtol=1e-2)


def test_half_a_turn_nobody_measured() -> None:
    """The northward gyro bias shows as a length, the eastward one turns both headings."""
    errors = replace(NAVIGATION, gyro_bias=0.1 * DEG_H)
    for heading, east in ((0.0, "y gyro bias"), (0.7, "gyro bias along (0.64, 0.76, 0.00)")):
        windows = [still(45.0, rotation(0.0, 0.0, heading + k * np.pi), count=1) for k in (0, 1)]
        rows = [position(w, 600.0) for w in windows]
        found = align_positions(rows, windows[0].lat, 0.0, errors=errors, gravity_sigma=1e-5)
        gyro, accel = found.unobservable
        assert gyro.replace("-", "").startswith(east)
        assert gyro.endswith(", together with the heading of positions 1 and 2")
        assert accel == "x and y accelerometer bias, together with the level of positions 1 and 2"
        # rad: the bias over the level Earth rate, and noise
        by_bias = 0.1 * DEG_H / (OMEGA * np.cos(windows[0].lat))
        np.testing.assert_allclose(np.sqrt(found.P_n[:, 2, 2]), by_bias, rtol=0.05)


def test_the_larger_of_stated_and_shown_noise_counts() -> None:
    window = still(30.0, rotation(0.2, 0.1, 1.0), count=1)
    other = still(30.0, rotation(2.0, -0.7, 2.0), count=1)

    def azimuth(arw: ArrayLike, stated: float | None) -> float:
        rows = [replace(position(w, 100.0), arw=np.asarray(arw)) for w in (window, other)]
        errors = SensorErrors(1e-4 * DEG_H, UG, stated, VRW)
        return float(np.sqrt(align_positions(rows, window.lat, 0.0, errors=errors).P_n[0, 2, 2]))

    assert azimuth(0.0, ARW) == azimuth(0.3 * ARW, ARW) == azimuth(ARW, None)
    assert azimuth([3 * ARW] * 3, ARW) == pytest.approx(3.0 * azimuth(ARW, None), rel=0.02)


def test_gyros_that_hide_the_earth_rate_own_up() -> None:
    """10 deg/h in two orientations: attitudes are found, and nobody believes their sigmas."""
    errors = SensorErrors(10.0 * DEG_H, 5000.0 * UG, 0.3 * DEG / 60.0, 100.0 * UG)
    windows = [still(45.0, ATTITUDES[k], count=1) for k in (100, 150)]
    bias = np.array([7.0, -9.0, 5.0]) * DEG_H
    rows = [position(w, 300.0, gyro=bias) for w in windows]
    found = align_positions(rows, windows[0].lat, 0.0, errors=errors)
    assert any(words.startswith("how far the attitudes may be off") for words in found.unobservable)


def test_refusals() -> None:
    windows = [still(45.0, ATTITUDES[k], count=1) for k in (100, 150)]
    rows = [position(w, 60.0) for w in windows]
    lat = windows[0].lat
    with pytest.raises(AlignmentError, match="1 position tells no bias from a tilt"):
        align_positions(rows[:1], lat, 0.0, errors=NAVIGATION)
    with pytest.raises(AlignmentError, match="nobody tells the noise of the gyros"):
        align_positions(rows, lat, 0.0, errors=SensorErrors(vrw=VRW))
    with pytest.raises(AlignmentError, match="nobody tells the noise of the accelerometers"):
        align_positions(rows, lat, 0.0, errors=SensorErrors(arw=ARW))
    with pytest.raises(ValueError, match=r"positions\[0\].turn is from the position before"):
        first = replace(rows[0], turn=np.array([1.0, 0.0, 0.0, 0.0]), turn_sigma=1e-3)
        align_positions([first, rows[1]], lat, 0.0, errors=NAVIGATION)
    with pytest.raises(ValueError, match="needs a positive turn_sigma"):
        align_positions(
            [rows[0], replace(rows[1], turn=np.array([1.0, 0.0, 0.0, 0.0]))],
            lat,
            0.0,
            errors=NAVIGATION,
        )
    with pytest.raises(ValueError, match="durations must be positive"):
        align_positions([rows[0], replace(rows[1], duration=0.0)], lat, 0.0, errors=NAVIGATION)


def test_ln100_x_up_and_x_down(shared_data: Path) -> None:
    """Navigation-grade ring-laser INS; the turn between the recordings is not known."""
    rows = []
    for name in ("calgary_ln100_x_up.mcap", "calgary_ln100_x_down.mcap"):
        samples = navgrade.read_imu(shared_data / name, None, kind="average", axes="FRD")
        seconds = float(samples.dt.sum())
        omega, f = samples.dt @ samples.gyro / seconds, samples.dt @ samples.accel / seconds
        rows.append(Position(omega, f, seconds))
    # Random walks as 30 s means scatter: 0.13 deg/h and some µg.
    errors = SensorErrors(0.25 * DEG_H, 50.0 * UG, 0.01 * DEG / 60.0, 20.0 * UG)
    lat = 51.07995352 * DEG
    found = align_positions(rows, lat, 1118.5, errors=errors)
    assert found.gyro_bias[0] / DEG_H == pytest.approx(-0.25, abs=0.05)
    # mm/s^2: half the sum of the two x readings is -0.43, but x leaned by 0.34° and by 0.46°,
    # which accounts for -0.07: with the bias taken off, both feel the same gravity.
    assert 5e2 * (rows[0].f_ib_b[0] + rows[1].f_ib_b[0]) == pytest.approx(-0.43, abs=0.01)
    assert 1e3 * found.accel_bias[0] == pytest.approx(-0.50, abs=0.02)
    for q, row in zip(found.q_nb, rows, strict=True):
        rate = Rotation.from_quat(q, scalar_first=True).apply(row.omega_ib_b - found.gyro_bias)
        assert -rate[2] / DEG_H == pytest.approx(OMEGA / DEG_H * np.sin(lat), abs=0.03)
    forces = [np.linalg.norm(row.f_ib_b - found.accel_bias) for row in rows]
    assert forces[0] == pytest.approx(forces[1], abs=2e-5)  # m/s^2
    # y looked north within 12° both times, so its bias shows in the level rate; z looked east.
    assert found.unobservable == (
        "z gyro bias, together with the heading of positions 1 and 2",
        "y and z accelerometer bias, together with the level of positions 1 and 2",
    )
    assert found.chi2 < chi2.ppf(0.99, found.dof)
