"""Body increments against closed forms and power series; the Earth is not here.

Pure coning, sculling and SPIN-CONE of every algorithm are in test_coning, the declared orders
over seconds of motion in test_orders, gaps and the ends of a log in test_stretches.
"""

from __future__ import annotations

import dataclasses
from fractions import Fraction
from itertools import pairwise
from math import comb

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from navgrade import ImuSamples
from navgrade.imu import BodyIncrements
from navgrade.reconstruction import (
    RECONSTRUCTIONS,
    centred,
    coning,
    stream,
    takes_rates,
    to_increments,
)
from navgrade.reconstruction.stream import BlockForm
from tests.navgrade.body import Polynomial, log_of, rebuilt, same_bits, varied_log

Array = NDArray[np.float64]

OF_RATES = [name for name in RECONSTRUCTIONS if takes_rates(name)]
OF_INCREMENTS = [name for name in RECONSTRUCTIONS if not takes_rates(name)]
# a scheme of rates at points turns the force in steps, exact for no constant rate
CORRECTED = [name for name in OF_INCREMENTS if name != "none"]
WINDOWS = [int(name.split("-")[1]) for name in RECONSTRUCTIONS if name.startswith("centred")]
EPS = 2.0**-53  # relative: half a unit in the last place, one rounding

# ---- coning weights ----------------------------------------------------------------------------

PREVIOUS = {  # Ignagni 1996
    1: "1/12",
    2: "7/60 -1/60",
    3: "113/840 -13/420 1/280",
    4: "367/2520 -53/1260 1/120 -1/1260",
}
BLOCK = {2: "2/3", 3: "27/20 9/20", 4: "214/105 92/105 54/105"}  # Miller 1983; Lee et al. 1990


def fractions(text: str) -> list[float]:
    """The numbers nearest to these fractions."""
    return [float(Fraction(part)) for part in text.split()]


def weights_in(name: str, dt: Array, count: int) -> Array:
    """Coning weights of the last interval, seen from outside.

    With theta_k along z and theta_{k-m} along x, the y component of phi is -c_m.
    """
    weights = []
    for m in range(1, count + 1):
        gyro = np.zeros((len(dt), 3))
        gyro[-1, 2] = gyro[-1 - m, 0] = 1.0
        log = ImuSamples(t=np.cumsum(dt), dt=dt, gyro=gyro, accel=0.0 * gyro, kind="increment")
        weights.append(-rebuilt(log, name).phi[-1, 1])
    return np.array(weights)


def solved_weights(dt: Array, count: int, span: float) -> Array:
    """Coning weights of the last interval from the equations for any intervals."""
    weights = np.zeros(coning.MOST)
    scratch = np.empty((coning.MOST, coning.MOST + 1))
    coning.solve_weights(dt, len(dt) - 1, count, span, scratch, weights)
    return weights[:count]


def matched_weights(dt: Array, count: int, first: int) -> Array:
    """Weights of the `count` samples before the last that match pure coning, in 60 digits.

    The update begins with sample `first`. With the rate a W (-sin W t, cos W t) in the x-y plane,
    its rotation about z is a^2 (W T - sin W T) / 2; the products of the increments must add up to
    that as power series in W, as far as there are weights.
    """
    with mp.workdps(60):
        edges = [mpf(0)]
        for step in dt:
            edges.append(edges[-1] + mpf(float(step)))
        length = edges[-1] - edges[first]

        def product(m: int, W: mpf) -> mpf:
            x, y = ([f(W * e) for e in edges] for f in (mp.cos, mp.sin))
            i, k = len(dt) - 1 - m, len(dt) - 1
            return (x[i + 1] - x[i]) * (y[k + 1] - y[k]) - (y[i + 1] - y[i]) * (x[k + 1] - x[k])

        def odd(series: list[mpf]) -> list[mpf]:
            return series[3::2]

        powers = 2 * count + 1
        wanted = odd(mp.taylor(lambda W: (W * length - mp.sin(W * length)) / 2, 0, powers))
        columns = [
            odd(mp.taylor(lambda W, m=m: product(m, W), 0, powers)) for m in range(1, count + 1)
        ]
        found = mp.lu_solve(mp.matrix(columns).T, mp.matrix(wanted))
        return np.array([float(x) for x in found])


@pytest.mark.parametrize("count", PREVIOUS)
def test_causal_weights_are_the_classical_ones(count: int) -> None:
    assert coning.EQUAL_PREVIOUS[count, :count].tolist() == fractions(PREVIOUS[count])
    dt = np.full(5, 0.01)
    expected = fractions(PREVIOUS[count])
    # rounding of a system whose condition number is below 1e4
    np.testing.assert_allclose(solved_weights(dt, count, dt[-1]), expected, rtol=1e-12)
    assert weights_in(f"causal-{count}", dt, count).tolist() == expected


@pytest.mark.parametrize("samples", BLOCK)
def test_block_weights_are_the_classical_ones(samples: int) -> None:
    count = samples - 1
    assert coning.EQUAL_BLOCK[count, :count].tolist() == fractions(BLOCK[samples])
    dt = np.full(samples, 0.01)
    expected = fractions(BLOCK[samples])
    np.testing.assert_allclose(solved_weights(dt, count, dt.sum()), expected, rtol=1e-12)
    assert weights_in(f"samples-{samples}", dt, count).tolist() == expected


@pytest.mark.parametrize("share", [3e-8, 1e-6])
@pytest.mark.parametrize("name", [*(f"causal-{n}" for n in PREVIOUS), "samples-3", "samples-4"])
def test_weights_change_smoothly_where_intervals_cease_to_be_equal(name: str, share: float) -> None:
    family, size = name.split("-")
    count = int(size) if family == "causal" else int(size) - 1
    dt = 0.01 * (1.0 + share * np.array([1.0, -1.0, 0.5, 1.0, -0.7])[-count - 1 :])
    expected = fractions((PREVIOUS if family == "causal" else BLOCK)[int(size)])
    off = np.abs(weights_in(name, dt, count) - expected).max()
    # the weights are functions of the ratios with slopes of 0.1 to 10
    assert 0.01 * share < off < 10.0 * share


@pytest.mark.parametrize(("h1", "h2"), [(0.003, 0.01), (0.006, 0.004), (0.01, 0.0011)])
def test_two_intervals_of_different_length(h1: float, h2: float) -> None:
    """The closed forms for one previous sample and for a block of two."""
    dt = np.array([h1, h2])
    (before,), (inside,) = weights_in("causal-1", dt, 1), weights_in("samples-2", dt, 1)
    # rounding
    assert before == pytest.approx(h2**2 / (6.0 * h1 * (h1 + h2)), rel=1e-14)
    assert inside == pytest.approx((h1 + h2) ** 2 / (6.0 * h1 * h2), rel=1e-14)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", ["causal-2", "causal-3", "causal-4", "samples-3", "samples-4"])
def test_weights_of_uneven_intervals_match_pure_coning(name: str, seed: int) -> None:
    family, size = name.split("-")
    count = int(size) if family == "causal" else int(size) - 1
    dt = np.random.default_rng(seed).uniform(0.4, 1.6, count + 1)
    expected = matched_weights(dt, count, count if family == "causal" else 0)
    # rounding of the solution, whose weights reach a hundred where a short sample is in between
    scale = np.abs(expected).max()
    np.testing.assert_allclose(weights_in(name, dt, count), expected, rtol=0, atol=1e-11 * scale)


# ---- Legendre coefficients of a centred window ---------------------------------------------------


def legendre_coefficient(m: int, power: int) -> Fraction:
    """Coefficient a_m of s^power on [0, 1], in the polynomials P_m(2 s - 1)."""
    terms = [
        Fraction((-1) ** (m + k) * comb(m, k) * comb(m + k, k), power + k + 1) for k in range(m + 1)
    ]
    return (2 * m + 1) * sum(terms, Fraction(0))


def worst_rounding(weights: Array, knots: list[Fraction]) -> Fraction:
    """Largest error of a_1 ... a_4 over all powers s^d the window carries, in rational numbers.

    Relative to the sum of the increments without their signs, each times its weight or one;
    `knots` bound the intervals, in units of the current one, which reaches from 0 to 1.
    """
    worst = Fraction(0)
    for power in range(len(knots) - 1):
        at = [knot ** (power + 1) / (power + 1) for knot in knots]
        for m, row in enumerate(weights, start=1):
            error, size = -legendre_coefficient(m, power), Fraction(0)
            for w, (begin, end) in zip(map(Fraction, row.tolist()), pairwise(at), strict=True):
                error += w * (end - begin)
                size += max(abs(w), Fraction(1)) * abs(end - begin)
            worst = max(worst, abs(error) / size)
    return worst


def legendre_weights(dt: Array, low: int, count: int, k: int) -> Array:
    """Weights for any intervals, of samples `low` to `low + count` for sample `k`."""
    weights = np.empty((centred.ORDERS, count))
    knots, inverse = np.empty(count + 1), np.empty(count + 1)
    centred.solve_weights(
        dt, low, count, k, centred._GAUSS, centred._SLOPES, knots, inverse, weights
    )
    return weights


@pytest.mark.parametrize("window", WINDOWS)
def test_equal_weights_give_the_legendre_coefficients_of_every_polynomial(window: int) -> None:
    half = window // 2
    knots = [Fraction(j - half) for j in range(window + 1)]
    # each weight is the exact fraction, rounded once
    assert worst_rounding(centred.equal_weights(window), knots) <= EPS


@pytest.mark.parametrize("window", WINDOWS)
def test_weights_of_equal_intervals_agree_on_both_paths(window: int) -> None:
    solved = legendre_weights(np.full(20, 0.01), 3, window, 3 + window // 2)
    # rounding of a few dozen operations on numbers of size 10
    np.testing.assert_allclose(solved, centred.equal_weights(window), rtol=0, atol=2e-14)


@pytest.mark.parametrize("count", range(1, 16))
def test_solved_weights_give_the_legendre_coefficients_of_every_polynomial(count: int) -> None:
    """Uneven intervals, the current one anywhere in the window, windows of any length."""
    rng = np.random.default_rng(count)
    for place in sorted({0, count // 3, count // 2, count - 1}):
        dt = rng.uniform(0.004, 0.016, count + 3)
        low, k = 2, 2 + place
        # weights depend on the intervals as rounded, and so does the truth
        unit = Fraction(float(dt[k]))
        edges = [Fraction(0)]
        for step in dt[low : low + count].tolist():
            edges.append(edges[-1] + Fraction(step) / unit)
        knots = [edge - edges[place] for edge in edges]
        # rounding of products of up to 15 differences
        assert worst_rounding(legendre_weights(dt, low, count, k), knots) < 4e-14


# ---- motion ------------------------------------------------------------------------------------


def off(motion: Polynomial, edges: Array, name: str, rows: list[int]) -> Array:
    """Largest error of C, dv and dr in rows of a log, (rows, cases, 3): rad, m/s and m."""
    found = [rebuilt(log, name) for log in motion.logs(edges)]
    errors = []
    for row in rows:
        end, length = found[0].t[row], found[0].dt[row]
        C, dv, dr = motion.moved(end - length, length)
        turned = Rotation.from_rotvec([one.phi[row] for one in found]).as_matrix()
        errors.append(
            [
                np.abs(turned - C).max(axis=(1, 2)),
                np.abs(np.array([one.dv[row] for one in found]) - dv).max(axis=1),
                np.abs(np.array([one.dr[row] for one in found]) - dr).max(axis=1),
            ]
        )
    return np.moveaxis(np.array(errors), 1, 2)


def test_truth_solves_the_differential_equation() -> None:
    """The power series against an adaptive integration, over a turn of more than 1 rad."""
    motion = Polynomial.random(4, 1)

    def slope(t: float, state: Array) -> Array:
        C = state[:9].reshape(3, 3)
        rate, force = (
            np.polynomial.polynomial.polyval(t, c[:, 0]) for c in (motion.rate, motion.force)
        )
        skew = np.cross(np.eye(3), rate)
        return np.concatenate([(C @ skew).ravel(), C @ force, state[9:12]])

    begin = np.concatenate([np.eye(3).ravel(), np.zeros(6)])
    done = solve_ivp(slope, (-0.3, 0.7), begin, "DOP853", rtol=1e-13, atol=1e-14)
    C, dv, dr = motion.moved(-0.3, 1.0)
    truth = np.concatenate([C.ravel(), dv[0], dr[0]])
    # some ten steps of 1e-13 of values up to 20
    np.testing.assert_allclose(truth, done.y[:, -1], rtol=0, atol=1e-12)


def centred_edges(window: int, h: float) -> Array:
    """Edges of a window whose middle sample has its middle at zero."""
    return h * (np.arange(window + 1) - 0.5 * window)


def left_by_the_series(h: float) -> Array:
    """Limits of the error of C, dv (m/s) and dr (m) over an interval of h (s).

    Half as much again as the worst of all motions here; and rounding of a matrix, and of
    10 m/s^2 times h.
    """
    return np.array([5e-4 * h**7 + 1e-15, 0.013 * h**7 + 1e-14 * h, 0.014 * h**7 + 1e-14 * h**2])


@pytest.mark.parametrize("window", WINDOWS)
def test_motion_of_a_centred_window(window: int) -> None:
    """Two hundred motions, 0.01 to 1 rad per interval: only the truncated series is left.

    It leaves the seventh power of the interval in phi, dv and dr.
    """
    motion = Polynomial.random(min(window - 1, 6), 30, seed=window)
    errors = {}
    for h in (1.0, 0.5, 0.25, 0.125, 0.03, 0.01):
        (row,) = off(motion, centred_edges(window, h), f"centred-{window}", [window // 2])
        assert np.all(row < left_by_the_series(h)), h
        errors[h] = row.mean(axis=0)
    # 0.1: the next power still shows
    orders = np.log2(errors[0.25] / errors[0.125])
    np.testing.assert_allclose(orders, [7.0, 7.0, 7.0], rtol=0, atol=0.1)


@pytest.mark.parametrize("window", [window for window in WINDOWS if window >= 5])
def test_products_of_two_increments_are_complete(window: int) -> None:
    """Turns so small that products of three vanish, of any shape of the fourth degree."""
    turn, h = 1e-5, 2.0  # rad/s, s: five powers of time of equal weight on [-1, 1]
    rate, force = np.random.default_rng(window).uniform(-1.0, 1.0, (2, 5, 20, 3))
    (row,) = off(
        Polynomial(turn * rate, force), centred_edges(window, h), f"centred-{window}", [window // 2]
    )
    # products of three; the smallest coefficient, 1/126, makes 1e-3 of a product of two
    attitude, velocity = row[:, :2].max(axis=0)
    assert attitude < turn**3 + 1e-15
    assert velocity < turn**2


@pytest.mark.parametrize(
    ("window", "count"),
    [(3, 2), (3, 5), *((9, n) for n in (1, 2, 3, 4, 5, 8, 9, 10, 14)), (15, 14), (15, 15)],
)
def test_every_window_carries_its_polynomial(window: int, count: int) -> None:
    """A log of `count` uneven samples: windows that moved aside or are short are as good.

    A polynomial of the degree the window carries is seen without error, wherever the row lies.
    """
    h = 0.02
    motion = Polynomial.random(min(window, count) - 1, 3)
    steps = np.random.default_rng(count).uniform(0.5, 1.5, count) * h
    edges = np.concatenate([[0.0], np.cumsum(steps)]) - 0.5 * steps.sum()
    errors = off(motion, edges, f"centred-{window}", list(range(count)))
    assert np.all(errors < left_by_the_series(1.5 * h))


@pytest.mark.parametrize("ratio", [0.5, 2.0])
@pytest.mark.parametrize("window", [3, 9, 15])
def test_windows_over_a_change_of_the_interval_carry_their_polynomial(
    window: int, ratio: float
) -> None:
    half = window // 2
    steps = 0.01 * np.concatenate([np.ones(window), np.full(window, ratio)])
    edges = np.concatenate([[0.0], np.cumsum(steps)]) - 0.01 * window
    motion = Polynomial.random(window - 1, 2)
    rows = list(range(window - half - 1, window + half + 1))  # one beyond the change on both sides
    errors = off(motion, edges, f"centred-{window}", rows)
    assert np.all(errors < left_by_the_series(0.01 * max(ratio, 1.0)))


UNEVEN = {
    "6 ms and 4 ms": np.tile([1.2, 0.8], 10),
    "random": np.random.default_rng(3).uniform(0.4, 1.6, 20),
}


@pytest.mark.parametrize("pattern", UNEVEN)
@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_uneven_intervals_keep_the_order(name: str, pattern: str) -> None:
    """One update leaves one power more than the whole: half the interval, 2^-(order + 1)."""
    motion = Polynomial.random(4, 20)
    chosen = RECONSTRUCTIONS[name]
    place = 20 // chosen.samples // 2 if isinstance(chosen, BlockForm) else 10
    edges = np.concatenate([[0.0], np.cumsum(UNEVEN[pattern])])
    edges -= edges[10]
    errors = [off(motion, h * edges, name, [place]).mean(axis=(0, 1)) for h in (0.16, 0.08)]
    attitude, velocity, position = np.log2(errors[0] / errors[1])
    # 0.15: the next power still shows
    assert min(attitude, velocity) == pytest.approx(chosen.order + 1, abs=0.15)
    # a force that stands still in b leaves the third power of the way
    assert position == pytest.approx(max(chosen.order, 2) + 1, abs=0.15)


# ---- constant rate and force -------------------------------------------------------------------

AXIS = np.array([0.36, 0.48, -0.8])
FORCE = np.array([1.0, -9.0, 3.0])  # m/s^2


def steady(name: str, angle: float, dt: Array) -> tuple[BodyIncrements, Array, Array, Array]:
    """Rows of a constant rate and force, and the true phi, dv and dr.

    `angle` is the turn over an interval of 0.02 s.
    """
    rate = AXIS * angle / 0.02
    log = ImuSamples(
        t=np.cumsum(dt),
        dt=dt,
        gyro=np.outer(dt, rate),
        accel=np.outer(dt, FORCE),
        kind="increment",
    )
    rows = rebuilt(log, name)
    x, w = np.polynomial.legendre.leggauss(30)
    s, w = 0.5 * (1.0 + x), 0.5 * w
    nodes = np.multiply.outer(np.outer(rows.dt, s), rate).reshape(-1, 3)
    turned = Rotation.from_rotvec(nodes).apply(FORCE).reshape(len(rows), len(s), 3)
    dv = rows.dt[:, None] * np.einsum("m,nmi->ni", w, turned)
    dr = rows.dt[:, None] ** 2 * np.einsum("m,nmi->ni", w * (1.0 - s), turned)
    return rows, np.outer(rows.dt, rate), dv, dr


EVEN_STEPS = np.full(24, 0.02)  # s
UNEVEN_STEPS = np.random.default_rng(1).uniform(0.01, 0.03, 24)  # s


@pytest.mark.parametrize("dt", [EVEN_STEPS, UNEVEN_STEPS], ids=["even", "uneven"])
@pytest.mark.parametrize("angle", [1e-9, 1e-4, 0.2, 0.3, 1.0])
@pytest.mark.parametrize("name", CORRECTED)
def test_constant_rate_and_force_are_exact(name: str, angle: float, dt: Array) -> None:
    rows, phi, dv, _ = steady(name, angle, dt)
    # rounding of 4 rad in a block of four and of 0.8 m/s; of sums with weights of up to 100 at the
    # ends of an uneven log
    np.testing.assert_allclose(rows.phi, phi, rtol=0, atol=5e-14 * angle)
    np.testing.assert_allclose(rows.dv, dv, rtol=0, atol=2e-14)


@pytest.mark.parametrize("angle", [1e-9, 1e-4, 0.1, 1.0])
@pytest.mark.parametrize("window", WINDOWS)
def test_displacement_of_centred_windows_under_a_constant_rate(window: int, angle: float) -> None:
    """Exact to 0.1 rad per interval; beyond, the series of its last factor leaves |phi|^8/10!."""
    rows, phi, _, dr = steady(f"centred-{window}", angle, EVEN_STEPS)
    series = float(0.02**2 * np.linalg.norm(FORCE) * np.linalg.norm(phi[0]) ** 8 / 3628800.0)
    # m: rounding of 10 m/s^2 times the square of 0.02 s with the weights at the ends; the series
    np.testing.assert_allclose(rows.dr, dr, rtol=0, atol=1e-16 + 1.1 * series)


@pytest.mark.parametrize("name", [n for n in CORRECTED if not n.startswith("centred")])
def test_displacement_under_a_constant_rate(name: str) -> None:
    """A straight line for the force in b at the start leaves T theta x (theta x v) / 24."""
    rows, phi, dv, dr = steady(name, 0.01, EVEN_STEPS)
    left = rows.dt[:, None] * np.cross(phi, np.cross(phi, dv)) / 24.0
    # the next term is a turn of 0.04 rad smaller
    size = np.abs(left).max(axis=1, keepdims=True)
    assert np.all(np.abs(rows.dr - dr - left) < 0.05 * size)


# ---- what passes untouched ---------------------------------------------------------------------


def test_none_passes_increments_as_they_are() -> None:
    log = log_of(np.random.default_rng(1).uniform(0.01, 0.1, 40))
    rows = rebuilt(log, "none")
    for name, passed in (("t", "t"), ("dt", "dt"), ("phi", "gyro"), ("dv", "accel")):
        assert getattr(rows, name).tobytes() == getattr(log, passed).tobytes()
    # a force that stands still in b moves the body by half of it; to rounding
    np.testing.assert_allclose(rows.dr, 0.5 * log.dt[:, None] * log.accel, rtol=3e-16)
    assert not rows.status.any()


@pytest.mark.parametrize("name", OF_INCREMENTS)
def test_compensated_input_is_not_corrected_again(name: str) -> None:
    """Whatever the algorithm, block forms too."""
    log = dataclasses.replace(
        log_of(np.random.default_rng(2).uniform(0.01, 0.03, 40)), kind="compensated"
    )
    rows = rebuilt(to_increments(log.blocks(7)), name)
    for column, passed in (("t", "t"), ("dt", "dt"), ("phi", "gyro"), ("dv", "accel")):
        assert getattr(rows, column).tobytes() == getattr(log, passed).tobytes()
    assert not rows.status.any()
    assert same_bits(rows, rebuilt(log, "causal-1"))


@pytest.mark.parametrize("name", OF_RATES)
def test_compensated_input_holds_no_rates(name: str) -> None:
    log = dataclasses.replace(log_of(np.full(40, 0.01)), kind="compensated")
    with pytest.raises(ValueError, match=f"'{name}' needs the rates themselves"):
        rebuilt(log, name)


def exactly_compensated(
    motion: Polynomial, edges: Array, dv_frame: str
) -> tuple[ImuSamples, Array, Array]:
    """What a perfect sensor gives of the first case; and the true dv and dr."""
    steps = [motion.moved(a, b - a) for a, b in pairwise(edges)]
    C, dv, dr = (np.array([step[i][0] for step in steps]) for i in range(3))
    log = ImuSamples(
        t=edges[1:],
        dt=np.diff(edges),
        gyro=Rotation.from_matrix(C).as_rotvec(),
        accel=dv if dv_frame == "start" else np.einsum("nji,nj->ni", C, dv),
        kind="compensated",
        dv_frame=dv_frame,  # type: ignore[arg-type]  # a parameter of the test
    )
    return log, dv, dr


@pytest.mark.parametrize("dv_frame", ["start", "end"])
def test_compensated_increments_in_either_frame(dv_frame: str) -> None:
    """Given in b at the end they are turned back; dr follows with the fourth power."""
    motion = Polynomial.random(4, 1)
    steps = np.random.default_rng(3).uniform(0.5, 1.5, 12)
    edges = np.concatenate([[0.0], np.cumsum(steps)]) - 0.5 * steps.sum()
    errors = []
    for h in (0.02, 0.01):
        log, dv, dr = exactly_compensated(motion, h * edges, dv_frame)
        rows = rebuilt(to_increments(log.blocks(5)), "centred-9")
        assert rows.phi.tobytes() == log.gyro.tobytes()
        if dv_frame == "start":
            assert rows.dv.tobytes() == log.accel.tobytes()
        np.testing.assert_allclose(rows.dv, dv, rtol=0, atol=1e-15)  # m/s: rounding of 0.3
        errors.append(np.abs(rows.dr - dr).max(axis=1))
    # without a sample before it, the first row takes the force as it stands: the second power
    # times the change of the force, 20 m/s^3 at most
    assert errors[1][0] < 20.0 * 0.015**3
    assert np.log2(np.mean(errors[0][1:]) / np.mean(errors[1][1:])) == pytest.approx(4.0, abs=0.15)


# ---- blocks and threads ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "kind"), [*((name, "increment") for name in RECONSTRUCTIONS), ("none", "compensated")]
)
def test_rows_do_not_depend_on_blocks(name: str, kind: str) -> None:
    log = dataclasses.replace(
        varied_log(),
        kind=kind,  # type: ignore[arg-type]  # a parameter of the test
        dv_frame="end",
    )
    whole = rebuilt(log, name)
    for size in (1, 2, 7, 100):
        assert same_bits(rebuilt(log.blocks(size), name), whole), size
    ragged = np.cumsum([1, 40, 3, 3, 120, 1, 1, 29, 30, 31, 200])
    pieces = [log[a:b] for a, b in zip([0, *ragged], [*ragged, len(log)], strict=True)]
    assert same_bits(rebuilt(pieces, name), whole)


@pytest.mark.parametrize("piece", [1, 13, 64])
@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_rows_do_not_depend_on_threads(
    name: str, piece: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = varied_log()
    whole = rebuilt(log, name)
    monkeypatch.setattr(stream, "_LEAST", piece)
    assert same_bits(rebuilt(log, name), whole)
    assert same_bits(rebuilt(log.blocks(90), name), whole)


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_every_sample_is_used_once(name: str) -> None:
    """Rows meet, and the last ends where the log ends."""
    log = varied_log()
    rows = rebuilt(log.blocks(50), name)
    # s: rounding of 14 s
    np.testing.assert_allclose(rows.t[1:] - rows.dt[1:], rows.t[:-1], rtol=0, atol=1e-13)
    assert rows.dt.sum() == pytest.approx(log.dt.sum(), rel=1e-14)
    assert rows.t[-1] == log.t[-1]


# ---- rates and averages ------------------------------------------------------------------------


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
        np.testing.assert_allclose(dtheta[1:], steps[:, :3], rtol=0, atol=1e-13)
        np.testing.assert_allclose(dvel[1:], steps[:, 3:], rtol=0, atol=1e-13)


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
