"""The vertical loop's gains, heights between heights, and the standard atmosphere."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from scipy.linalg import expm

from navgrade.errors import StateTimeError
from navgrade.vertical import (
    CLASSICAL_GAINS,
    DEFAULT_GAINS,
    BaroLoop,
    LoopGains,
    gains_from_time_constant,
    geometric_height,
    pressure_height,
)

A, F = 6_378_137.0, 1.0 / 298.257223563  # m, -; WGS-84
GROWTH = 2.0 * 9.80665 / (A * (1.0 - F / 3.0))  # 1/s^2, 2 g/R
TAUS = (5.0, 40.0, 100.0, 250.0)  # s


def error_dynamics(gains: LoopGains) -> np.ndarray:
    """Rates of the errors of height, vertical velocity and delta_a, for a perfect barometer."""
    return np.array([[-gains.c1, 1.0, 0.0], [GROWTH - gains.c2, 0.0, -1.0], [gains.c3, 0.0, 0.0]])


def poles(gains: LoopGains) -> np.ndarray:
    """Eigenvalues in order of their imaginary parts."""
    values = np.linalg.eigvals(error_dynamics(gains).astype(complex))
    return values[np.argsort(values.imag)]


# ---- gains -------------------------------------------------------------------------------------


@pytest.mark.parametrize("tau", TAUS)
def test_three_poles_lie_at_the_time_constant(tau: float) -> None:
    # a triple pole moves by the cube root of a rounding, 1e-16: 5e-6 of itself, more while 2 g/R
    # outweighs 1/tau^2. Without the 2 g/R term it would move by 4 % (tau = 5 s) to 60 % (250 s).
    assert np.max(np.abs(poles(gains_from_time_constant(tau)) + 1.0 / tau)) < 1e-3 / tau


@pytest.mark.parametrize("tau", TAUS)
def test_an_initial_height_error_dies_as_the_closed_form(tau: float) -> None:
    """With (D + 1/tau)^3 e = 0 and only e(0) = e0: e = e0 (1 - 2 x + x^2/2) exp(-x), x = t/tau."""
    e0 = 80.0  # m
    dynamics = error_dynamics(gains_from_time_constant(tau))
    for x in (0.3, 1.0, 2.5, 6.0, 12.0):
        found = (expm(dynamics * x * tau) @ [e0, 0.0, 0.0])[0]
        # 1 um: 2 g/R to 1e-8, and roundings
        assert found == pytest.approx(e0 * (1 - 2 * x + x * x / 2) * math.exp(-x), abs=1e-6)


@pytest.mark.parametrize("tau", TAUS)
def test_an_accelerometer_bias_leaves_no_height_error(tau: float) -> None:
    """The bias b drives e through 1/(s + 1/tau)^3: e = b t^2/2 exp(-t/tau); delta_a finds b."""
    b = 1e-3  # m/s^2, 100 ug
    whole = np.zeros((4, 4))
    whole[:3, :3] = error_dynamics(gains_from_time_constant(tau))
    whole[1, 3] = 1.0
    for x in (0.5, 2.0, 7.0, 25.0):
        t = x * tau
        e, _, delta_a, _ = expm(whole * t) @ [0.0, 0.0, 0.0, b]
        # 10 nm of up to 8 m: 2 g/R to 1e-8, and roundings
        assert e == pytest.approx(0.5 * b * t * t * math.exp(-x), abs=1e-8)
    # exp(-25) x^2/2: 4e-9 of it is left after 25 tau
    assert delta_a == pytest.approx(b, rel=1e-8)


def test_gains_are_those_of_the_formula_in_plain_numbers() -> None:
    gains = gains_from_time_constant(100.0)
    assert gains == DEFAULT_GAINS
    # 3/100, 3/100^2 + 3.0785e-6 (2 x 9.80665 m/s^2 / 6371.0 km, five digits), 1/100^3
    assert gains == pytest.approx((0.03, 3.030785e-4, 1e-6), rel=1e-7)


def test_rogers_poles_are_one_real_and_a_pair_at_45_degrees() -> None:
    found = poles(CLASSICAL_GAINS["rogers"])
    # 1e-8 1/s of 0.01 1/s: 2 g/R to 1e-8
    assert found == pytest.approx([-0.01 - 0.01j, -0.01, -0.01 + 0.01j], abs=1e-8)


def test_butterworth_poles_lie_on_a_circle_60_degrees_apart() -> None:
    found = poles(CLASSICAL_GAINS["butterworth"])
    expected = -0.01 * np.exp(1j * np.radians([60.0, 0.0, -60.0]))
    # 1e-8 1/s of 0.01 1/s: 2 g/R to 1e-8
    assert found == pytest.approx(sorted(expected, key=lambda x: x.imag), abs=1e-8)


@pytest.mark.parametrize("name", CLASSICAL_GAINS)
def test_every_classical_set_settles(name: str) -> None:
    assert poles(CLASSICAL_GAINS[name]).real.max() < -1e-3  # 1/s: within a quarter of an hour


@pytest.mark.parametrize("tau", [0.0, -100.0, math.nan, math.inf])
def test_a_time_constant_must_be_positive(tau: float) -> None:
    with pytest.raises(ValueError, match="tau_s must be positive and finite, got"):
        gains_from_time_constant(tau)


# ---- heights between heights -------------------------------------------------------------------


def a_loop(t: np.ndarray, **options: object) -> BaroLoop:
    """Heights on the line 200 m + 3 m/s t."""
    return BaroLoop(t, 200.0 + 3.0 * t, **options)  # type: ignore[arg-type]


def test_heights_lie_on_the_chords() -> None:
    t = 50.0 + np.cumsum(np.random.default_rng(1).uniform(0.05, 0.15, 400))
    h = 300.0 + 20.0 * np.sin(0.2 * t)
    loop = BaroLoop(t, h)
    for k in (0, 17, 398):
        for part in (0.0, 0.25, 0.9, 1.0):
            at = t[k] + part * (t[k + 1] - t[k])
            # 1 nm: roundings of 300 m
            assert float(loop.heights_at(at)) == pytest.approx(
                (1.0 - part) * h[k] + part * h[k + 1], abs=1e-9
            )
    assert loop.heights_at(t).tobytes() == h.tobytes()
    assert len(loop) == 400


def test_times_may_come_in_any_order_and_shape() -> None:
    loop = a_loop(np.arange(10.0))
    at = np.array([[7.5, 0.0, 11.0], [3.25, 9.0, -0.5]])
    expected = np.where((at >= 0.0) & (at <= 9.0), 200.0 + 3.0 * at, np.nan)
    found = loop.heights_at(at)
    assert found.shape == at.shape
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12)  # m: roundings
    assert loop.heights_at(4.0).shape == ()
    assert loop.heights_at([]).shape == (0,)


def test_outside_the_record_there_is_no_height() -> None:
    loop = a_loop(np.linspace(10.0, 20.0, 101))
    found = loop.heights_at([9.999_999, 10.0, 20.0, 20.000_001, math.nan])
    assert np.isnan(found).tolist() == [True, False, False, True, True]


@pytest.mark.parametrize(
    ("rate_hz", "longest_s"),
    [(50.0, 1.0), (4.0, 1.0), (2.0, 1.5), (0.5, 6.0)],  # the larger of 1 s and three intervals
)
def test_a_hole_is_bridged_up_to_its_longest(rate_hz: float, longest_s: float) -> None:
    first = 3.0 + np.arange(60) / rate_hz
    for hole, bridged in ((0.98 * longest_s, True), (1.02 * longest_s, False)):
        second = first[-1] + hole + np.arange(60) / rate_hz
        loop = a_loop(np.concatenate([first, second]))
        assert loop.max_hole == pytest.approx(longest_s, rel=1e-9)
        inside = first[-1] + np.array([1e-6, 0.5 * hole, hole - 1e-6])
        found = loop.heights_at(inside)
        if bridged:
            np.testing.assert_allclose(found, 200.0 + 3.0 * inside, rtol=0.0, atol=1e-9)  # m
        else:
            assert np.isnan(found).all()
        # the heights at its ends, and beside them, stay
        beside = np.array([first[-1] - 0.4 / rate_hz, first[-1], second[0], second[0] + 1e-6])
        np.testing.assert_allclose(
            loop.heights_at(beside), 200.0 + 3.0 * beside, rtol=0.0, atol=1e-9
        )


def test_start_shifts_all_heights_by_one_amount() -> None:
    t = np.linspace(5.0, 65.0, 601)
    h = 812.0 + 15.0 * np.sin(0.1 * t)
    loop = BaroLoop(t, h, gains_from_time_constant(30.0))
    aligned = loop.aligned(20.05, 1118.5)
    assert loop.reference == "start"
    assert aligned.reference == "absolute"
    assert aligned.gains == gains_from_time_constant(30.0)
    assert float(aligned.heights_at(20.05)) == pytest.approx(1118.5, abs=1e-9)  # m: roundings
    shift = 1118.5 - (h[150] + h[151]) / 2.0
    np.testing.assert_allclose(aligned.h - h, shift, rtol=0.0, atol=1e-9)  # m: roundings
    assert loop.h.tobytes() == h.tobytes()
    assert aligned.aligned(30.0, -50.0) is aligned


def test_absolute_heights_stay() -> None:
    loop = a_loop(np.arange(10.0), reference="absolute")
    assert loop.aligned(2.0, 500.0) is loop
    assert loop.aligned(-20.0, 500.0) is loop  # no height there, and none needed


@pytest.mark.parametrize("t0", [-0.1, 4.5, 9.1])
def test_start_needs_a_height_at_the_state(t0: float) -> None:
    t = np.concatenate([np.arange(0.0, 3.0, 0.1), np.arange(6.0, 9.0, 0.1)])
    with pytest.raises(StateTimeError, match="no height to start from") as caught:
        a_loop(t).aligned(t0, 100.0)
    assert f"{t0:.9f} s" in str(caught.value)
    assert 'reference "absolute"' in str(caught.value)


def test_what_was_checked_cannot_change() -> None:
    t, h = np.arange(5.0), np.full(5, 40.0)
    loop = BaroLoop(t, h)
    t[2], h[3] = -1.0, math.nan
    assert loop.t.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert loop.h.tolist() == [40.0] * 5
    for array in (loop.t, loop.h):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(FrozenInstanceError):
        loop.reference = "absolute"  # type: ignore[misc]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"t": [1.0], "h": [2.0]}, "at least two heights"),
        ({"t": [], "h": []}, "at least two heights"),
        ({"h": [1.0, 2.0]}, r"h must have shape \(4,\), got \(2,\)"),
        ({"t": [[0.0, 1.0], [2.0, 3.0]]}, r"t must have shape \(4,\)"),
        ({"h": [1.0, 2.0, math.nan, 4.0]}, "h is not finite at index 2"),
        ({"t": [0.0, math.inf, 2.0, 3.0]}, "t is not finite at index 1"),
        ({"t": [0.0, 1.0, 1.0, 2.0]}, "t must increase: .* at index 2"),
        ({"t": [0.0, 1.0, 2.0, 1.5]}, "t must increase: .* at index 3"),
        ({"reference": "msl"}, "reference must be one of start, absolute, got 'msl'"),
        ({"gains": LoopGains(0.0, 1e-3, 0.0)}, "does not settle"),
        ({"gains": LoopGains(0.03, 3.0e-6, 0.0)}, "does not settle"),  # less than 2 g/R
        ({"gains": LoopGains(0.03, 3e-4, 1e-5)}, "does not settle"),
        ({"gains": LoopGains(0.03, 3e-4, -1e-9)}, "does not settle"),
        ({"gains": LoopGains(math.nan, 3e-4, 1e-6)}, "does not settle"),
        ({"gains": LoopGains(math.inf, 3e-4, 1e-6)}, "does not settle"),
    ],
)
def test_what_is_wrong_is_named(changes: dict[str, object], message: str) -> None:
    arguments = {"t": [0.0, 1.0, 2.0, 3.0], "h": [1.0, 2.0, 3.0, 4.0], **changes}
    with pytest.raises(ValueError, match=message):
        BaroLoop(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "gains", [LoopGains(0.03, 3.2e-6, 0.0), LoopGains(0.03, 4.0e-5, 1.1e-6), LoopGains(2, 3, 5)]
)
def test_gains_are_refused_just_when_a_pole_is_not_damped(gains: LoopGains) -> None:
    assert poles(gains).real.max() < 1e-9  # 1/s; c3 = 0 leaves a pole at 0 that nothing excites
    BaroLoop([0.0, 1.0], [0.0, 0.0], gains)
    worse = gains._replace(c3=1.001 * gains.c1 * (gains.c2 - GROWTH))
    assert poles(worse).real.max() > 0.0
    with pytest.raises(ValueError, match="does not settle"):
        BaroLoop([0.0, 1.0], [0.0, 0.0], worse)


# ---- the standard atmosphere -------------------------------------------------------------------

# geopotential height, m: pressure, Pa, as the tables print it (ICAO Doc 7488/3, and the U.S.
# Standard Atmosphere 1976 where it prints more digits: it is 1 ppm above at 11 km, 6 mm)
BY_GEOPOTENTIAL = {
    -5_000.0: 177_687.0,
    -1_000.0: 113_929.0,
    0.0: 101_325.0,
    1_000.0: 89_874.6,
    2_000.0: 79_495.2,
    5_000.0: 54_019.9,
    10_000.0: 26_436.3,
    11_000.0: 22_632.06,
    15_000.0: 12_044.6,
    20_000.0: 5_474.89,
}
BY_GEOMETRIC = {  # U.S. Standard Atmosphere 1976
    5_000.0: 54_048.3,
    10_000.0: 26_499.9,
    11_000.0: 22_699.9,
    20_000.0: 5_529.3,
}


def printed_to(pressure: float) -> float:
    """Half of the last digit printed, Pa."""
    return 0.5 * 10.0 ** -len(f"{pressure}".split(".")[1].rstrip("0"))


@pytest.mark.parametrize("height", BY_GEOPOTENTIAL)
def test_pressure_heights_are_those_of_the_table(height: float) -> None:
    pressure = BY_GEOPOTENTIAL[height]
    # a scale height times the digit printed: 3 cm at -5 km; and 1.5 cm, by which the two differ
    tolerance = 9_400.0 * printed_to(pressure) / pressure + 0.015
    assert tolerance < 0.075
    assert float(pressure_height(pressure)) == pytest.approx(height, abs=tolerance)


@pytest.mark.parametrize("height", BY_GEOMETRIC)
def test_geometric_heights_are_those_of_the_table(height: float) -> None:
    pressure = BY_GEOMETRIC[height]
    tolerance = 9_400.0 * printed_to(pressure) / pressure + 0.015  # m, as above
    assert tolerance < 0.105
    found = float(geometric_height(pressure_height(pressure)))
    assert found == pytest.approx(height, abs=tolerance)


@pytest.mark.parametrize(
    ("geopotential", "geometric"),
    # ICAO Doc 7488/3, table of geometric altitudes: 4996.1 m at 5 km, 9984.3 m, 19937.3 m
    [(0.0, 0.0), (4_996.1, 5_000.0), (9_984.3, 10_000.0), (19_937.3, 20_000.0)],
)
def test_geopotential_metres_become_metres(geopotential: float, geometric: float) -> None:
    # half of the digit printed, 5 cm
    assert float(geometric_height(geopotential)) == pytest.approx(geometric, abs=0.051)


def test_height_falls_steadily_with_pressure_across_the_tropopause() -> None:
    p = np.linspace(22_000.0, 23_300.0, 1301)
    steps = np.diff(pressure_height(p))
    # R T/g is 6341.6 m at 216.65 K, and 0.6 % more at 23.3 kPa, where it is 1.2 K warmer: of the
    # 0.28 m a pascal stands for, 1.7 mm. A jump of 2 mm would show.
    slope = -6_341.6 / (0.5 * (p[1:] + p[:-1]))
    assert np.max(np.abs(steps - slope)) < 2e-3
    assert np.max(np.abs(np.diff(steps))) < 1e-4


def test_shapes_are_kept() -> None:
    p = np.array([[101_325.0, 90_000.0], [12_000.0, 70_000.0]])
    assert pressure_height(p).shape == (2, 2)
    assert geometric_height(p).shape == (2, 2)
    assert pressure_height(90_000.0).shape == ()
    # 1 nm: roundings
    assert pressure_height(p)[0, 1] == pytest.approx(float(pressure_height(90_000.0)), abs=1e-9)


@pytest.mark.parametrize("bad", [0.0, -101_325.0, 1013.25, 5_474.0, 178_000.0, math.nan, math.inf])
def test_a_pressure_outside_the_tables_is_refused(bad: float) -> None:
    with pytest.raises(ValueError, match=r"at index 2 is not within .* such as hPa"):
        pressure_height([101_325.0, 90_000.0, bad, 80_000.0])
