"""Laws that hold for every method: exact data come out exact, sigmas and budget fit each other."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from align import (
    METHODS,
    Alignment,
    AlignmentError,
    KnownHeading,
    SensorErrors,
    WeakGyrosError,
    align_fine,
    align_static,
    align_swaying,
    align_together,
)
from align.accuracy import judge
from tests.align.at_rest import DEG, DEG_H, HALF, UG, Window, attitudes, error_n, rotation, still
from tests.align.sway import Sway, Waves, edges

ERRORS = SensorErrors(0.01 * DEG_H, 50.0 * UG, 0.003 * DEG / 60.0, 10.0 * UG)
ALONE = [name for name in METHODS if name not in ("level", "multi-position")]
CLEAR = 1e-3  # cosine of pitch; below it a given Euler angle is no heading of a body


def windows() -> Iterator[tuple[tuple[float, float, float], Window]]:
    """200 attitudes, latitudes from -80° to 80° and heights to 9 km in turn."""
    lats = np.linspace(-80.0, 80.0, 9)
    heights = (0.0, 1100.0, 9000.0, -400.0)
    for k, euler in enumerate(attitudes()):
        place = still(float(lats[k % 9]), rotation(*euler), h=heights[k % 4], count=64, dt=1.0)
        yield euler, place


def found_by(method: str, window: Window, heading: float) -> Alignment:
    known = KnownHeading(heading, 1e-6)
    if method == "fine":
        return align_fine(*window.samples, errors=ERRORS)
    if method == "inertial":
        dt = window.dt[:, None]
        increments = (window.dt, dt * window.omega_ib_b, _at_the_start(window))
        return align_swaying([increments], window.lat, window.h, errors=ERRORS)
    given = known if method == "known-heading" else None
    return align_static(
        *window.samples, errors=ERRORS, method=method, known_heading=given, convergence=False
    )


def _at_the_start(window: Window) -> np.ndarray:
    """Velocity increments of a steady turn in body axes at the start of each interval.

    The force is steady in the body, which turns by ``theta``: its mean there is turned by half of
    it, and shortened across the axis by ``sinc(theta / 2)``.
    """
    theta = window.dt[:, None] * window.omega_ib_b
    size = np.linalg.norm(theta, axis=1, keepdims=True)
    axis = theta / size
    along = np.sum(axis * window.f_ib_b, axis=1, keepdims=True) * axis
    across = np.sinc(0.5 * size / np.pi) * (window.f_ib_b - along)
    return window.dt[:, None] * (along + Rotation.from_rotvec(0.5 * theta).apply(across))


@pytest.mark.parametrize("method", ALONE)
def test_exact_data_come_out_exact(method: str) -> None:
    for euler, window in windows():
        if method == "known-heading" and np.cos(euler[1]) < CLEAR:
            continue
        found = found_by(method, window, euler[2])
        assert found.method == ("triad" if method == "auto" else method)
        # rad: gravity turns with the Earth by 5 mrad a minute, which is what rounding divides by
        assert np.linalg.norm(error_n(found.q_nb, window.attitude)) < 1e-9, (method, euler)
        again = rotation(found.roll, found.pitch, found.heading)
        assert np.linalg.norm(error_n(found.q_nb, again)) < 1e-12, (method, euler)


def test_exact_positions_come_out_exact() -> None:
    """Pairs whose turn the two vectors tell: 100 of them, no bias."""
    each = list(windows())
    for (_, first), (euler, _) in zip(each[::2], each[1::2], strict=True):
        second = still(first.lat / DEG, rotation(*euler), h=first.h, count=64, dt=1.0)
        rows = [(w.dt, w.omega_ib_b, w.f_ib_b) for w in (first, second)]
        results = align_together(rows, first.lat, first.h, errors=ERRORS)
        for found, window in zip(results, (first, second), strict=True):
            assert np.linalg.norm(error_n(found.q_nb, window.attitude)) < 1e-9, euler


@pytest.mark.parametrize("method", [*ALONE, "level"])
@pytest.mark.parametrize("euler", [(0.3, -0.2, 2.5), (-2.9, 0.4, -1.7), (0.4, 1.5, 1.0)])
def test_budget_covariance_and_sigmas_fit(method: str, euler: tuple[float, float, float]) -> None:
    window = still(52.0, rotation(*euler), h=300.0, count=600, dt=0.5)
    found = found_by(method, window, euler[2])
    tilts = [line.tilt for line in found.budget]
    azimuths = [line.azimuth for line in found.budget]
    # Relative: at 300 m the plumb line is off by 0.2 µrad, which budgets leave out
    assert np.linalg.norm(tilts) == pytest.approx(found.tilt_sigma, rel=1e-6)
    assert np.linalg.norm(azimuths) == pytest.approx(found.azimuth_sigma, rel=1e-6)
    np.testing.assert_allclose(found.P_n, found.P_n.T, rtol=0.0, atol=0.0)
    assert np.all(np.linalg.eigvalsh(found.P_n) > 0.0)
    assert found.tilt_sigma == pytest.approx(np.sqrt(np.trace(found.P_n[:2, :2]) / 2.0), rel=1e-12)
    assert found.verdict.startswith("good for")
    assert found.reason


@pytest.mark.parametrize("pitch", [0.3, -1.1])
def test_a_given_heading_and_a_tilt_turn_the_attitude_together(pitch: float) -> None:
    """The covariance of 400 windows, its cross terms included."""
    errors = SensorErrors(1.0 * DEG_H, 500.0 * UG, 1e-9, 1e-9)
    rng = np.random.default_rng(70)
    window = still(45.0, rotation(0.3, pitch, 2.0), count=8, dt=1.0)
    turns = []
    for _ in range(400):
        felt = window.plus(accel=500.0 * UG * rng.normal(size=3))
        known = KnownHeading(2.0 + 5e-4 * rng.normal(), 5e-4)
        found = align_static(
            *felt.samples,
            errors=errors,
            known_heading=known,
            method="known-heading",
            convergence=False,
        )
        turns.append(error_n(found.q_nb, window.attitude))
    whitened = np.linalg.solve(np.linalg.cholesky(found.P_n), np.transpose(turns))
    # 400 draws know a variance to 7 %, a correlation to 0.05; four of these
    np.testing.assert_allclose(np.cov(whitened), np.eye(3), rtol=0.0, atol=0.28)


@pytest.mark.parametrize("lat_deg", [60.0, -70.0])
def test_a_gyrocompass_tilts_and_turns_together(lat_deg: float) -> None:
    """Where accelerometers rule, an eastward error tilts about north and turns about down."""
    errors = SensorErrors(0.001 * DEG_H, 500.0 * UG, 1e-9, 1e-9)
    rng = np.random.default_rng(73)
    window = still(lat_deg, rotation(0.3, -0.4, 2.0), count=8, dt=1.0)
    turns = []
    for _ in range(400):
        felt = window.plus(
            gyro=0.001 * DEG_H * rng.normal(size=3), accel=500.0 * UG * rng.normal(size=3)
        )
        found = align_static(*felt.samples, errors=errors, method="triad", convergence=False)
        turns.append(error_n(found.q_nb, window.attitude))
    whitened = np.linalg.solve(np.linalg.cholesky(found.P_n), np.transpose(turns))
    # As above
    np.testing.assert_allclose(np.cov(whitened), np.eye(3), rtol=0.0, atol=0.28)


def test_noise_beyond_the_stated_one_enlarges_the_sigma() -> None:
    rng = np.random.default_rng(71)
    window = still(45.0, rotation(0.3, -0.2, 2.0), count=600, dt=0.5)
    quiet = align_static(*window.noisy(rng, 1e-6, 1e-4).samples, errors=ERRORS)
    stated = replace(ERRORS, arw=5e-7, vrw=9e-5)
    loud = align_static(*window.noisy(rng, 8e-6, 1e-3).samples, errors=stated)
    assert not any("scatter more" in text for text in quiet.warnings)
    assert sum("scatter more" in text for text in loud.warnings) == 2
    noise = {line.source: line for line in loud.budget}
    level_rate = 7.292115e-5 * np.cos(window.lat)
    # Ten tenths of three axes know the noise to 14 %; four of these
    assert noise["gyro noise"].azimuth * level_rate == pytest.approx(
        8e-6 / np.sqrt(300.0), rel=0.55
    )
    assert noise["accelerometer noise"].tilt * window.g == pytest.approx(
        1e-3 / np.sqrt(300.0), rel=0.55
    )


def test_level_has_no_heading() -> None:
    window = still(45.0, rotation(0.3, -0.2, 2.0))
    found = align_static(*window.samples, errors=ERRORS, method="level")
    assert found.roll == pytest.approx(0.3, abs=1e-12)
    assert found.pitch == pytest.approx(-0.2, abs=1e-12)
    assert np.isnan(found.heading)
    assert np.all(np.isnan(found.q_nb))
    assert found.grade == "levelling"
    # A direction nobody knows is uniform on the circle
    assert found.heading_sigma == pytest.approx(np.pi / np.sqrt(3.0), rel=1e-6)


@pytest.mark.parametrize(
    ("tilt_deg", "azimuth_deg", "grade", "words"),
    [
        (0.009, 0.09, "navigation", "navigation-grade free inertial"),
        (0.011, 0.09, "coarse", "coarse heading"),
        (0.009, 0.11, "coarse", "coarse heading"),
        (0.009, 15.1, "levelling", "levelling only"),
    ],
)
def test_what_an_attitude_is_good_for(
    tilt_deg: float, azimuth_deg: float, grade: str, words: str
) -> None:
    found, verdict = judge(tilt_deg * DEG, azimuth_deg * DEG)
    assert found == grade
    assert words in verdict


def test_a_base_that_drives_away_does_not_sway() -> None:
    sway = Sway(lat=0.8, turn=Waves((0.01, 0.01, 0.01)), leaves=(0.3, 0.0, 0.0))
    felt = sway.feel(edges(120.0, 20.0))
    with pytest.raises(AlignmentError, match=r"leaves its place.*inside a stop"):
        align_swaying([felt.samples], 0.8, 0.0, errors=ERRORS)


def test_weak_gyros_on_a_swaying_base() -> None:
    felt = Sway(lat=0.8, turn=Waves((0.01, 0.01, 0.01))).feel(edges(60.0, 20.0))
    weak = replace(ERRORS, gyro_bias=10.0 * DEG_H)
    with pytest.raises(WeakGyrosError, match=r"on a base that sways.*sigma of 5"):
        align_swaying([felt.samples], 0.8, 0.0, errors=weak)


def test_fine_says_when_its_model_fails() -> None:
    """A base that rocks by 0.05 mm/s at 4 s: three sigma of its accelerometers' noise."""
    window = still(45.0, rotation(0.3, -0.2, 2.0), count=600, dt=0.5)
    noisy = window.noisy(np.random.default_rng(72), 0.003 * DEG / 60.0, 10.0 * UG)
    quiet = align_fine(*noisy.samples, errors=ERRORS)
    assert quiet.innovations is not None
    assert quiet.innovations.consistent
    assert quiet.warnings == ()
    rock = 3e-4 * np.sin(HALF * np.cumsum(window.dt))[:, None] * [0.6, 0.8, 0.0]
    moved = align_fine(*noisy.plus(accel=rock).samples, errors=ERRORS)
    assert moved.innovations is not None
    assert not moved.innovations.consistent
    assert any("innovation" in text and "base moves" in text for text in moved.warnings)


def test_a_bias_that_one_position_proves_is_in_the_budget_of_all() -> None:
    """Its upward accelerometer is off by 500 µg in the first position, where 50 are stated."""
    first, second = (still(45.0, rotation(roll, 0.1, 1.0), count=40) for roll in (0.0, 1.5))
    felt = first.plus_n(accel=(0.0, 0.0, 500.0 * UG))
    found = align_together(
        [felt.samples[:3], second.samples[:3]], first.lat, first.h, errors=ERRORS
    )
    for result in found:
        shares = {line.source: line.tilt for line in result.budget}
        assert shares["accelerometer bias"] > 20.0 * shares.get("noise", 0.0)
        assert shares["accelerometer bias"] > 200.0 * UG / 9.8


@pytest.mark.parametrize("method", ["triad", "fine"])
def test_a_body_upside_down_is_mentioned_once(method: str) -> None:
    found = found_by(method, still(45.0, rotation(3.0, 0.1, 1.0), count=64, dt=1.0), 1.0)
    assert sum("upside down" in text for text in found.warnings) == 1
