"""Rotations against SciPy and 50 digits, at every attitude that hurts."""

from collections.abc import Callable

import numpy as np
import pytest
from mpmath import mp, mpf
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from earth import (
    dcm_from_quat,
    euler_from_quat,
    quat_from_dcm,
    quat_from_euler,
    quat_from_rotvec,
    rotvec_from_quat,
)
from earth.rotation import (
    cross,
    quat_product,
    quat_rotate,
    rotation_factors,
    rotvec_to_quat,
    rotvec_to_quat_change,
)

Array = NDArray[np.float64]
HALF = 0.5 * np.pi
ROUNDING = 2e-15  # rad or 1: ten roundings of a unit element, ours and SciPy's
EULER_CLAIM = 2e-15  # rad, what the docstring of `euler_from_quat` promises


def attitudes() -> Array:
    """Roll, pitch, heading, rad: random, at right angles, and around pitch ±90°."""
    rng = np.random.default_rng(7)
    free = np.stack(
        [
            rng.uniform(-np.pi, np.pi, 3000),
            np.arcsin(rng.uniform(-1.0, 1.0, 3000)),
            rng.uniform(-np.pi, np.pi, 3000),
        ],
        axis=-1,
    )
    quarter = np.arange(-2, 3) * HALF
    right = np.stack(np.meshgrid(quarter, quarter[1:4], quarter), axis=-1).reshape(-1, 3)
    from_vertical = np.array([0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3])
    pitch = np.concatenate([HALF - from_vertical, from_vertical - HALF])
    steep = np.repeat(free[:40], len(pitch), axis=0)
    steep[:, 1] = np.tile(pitch, 40)
    tiny = np.outer([1e-300, 1e-20, 1e-12, -1e-8, 1e-4], [0.3, -0.5, 0.8])
    half_turn = np.array([[np.pi, 0.2, 0.1], [-np.pi, -0.2, np.pi], [0.1, 0.3, -np.pi]])
    inverted = half_turn + 1e-9 * np.array([[-1.0, 1.0, 1.0]])
    return np.concatenate([free, right, steep, tiny, half_turn, inverted])


def rotation_vectors() -> Array:
    """Rotation vectors, rad: from nothing over half a turn to many turns, every direction."""
    rng = np.random.default_rng(8)
    sizes = [0.0, 1e-300, 1e-150, 1e-20, 1e-12, 1e-8, 1e-5, 9.9e-5, 1.01e-4, 1e-3, 0.1, 0.1732]
    sizes += [0.1733, 0.2449, 0.2450, 1.0, 3.0, np.pi - 1e-3, np.pi - 1e-9, np.pi - 1e-15, np.pi]
    sizes += [np.pi + 1e-9, 4.0, 6.28, 7.0, 20.0]
    directions = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(20, 3))])
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    return np.concatenate([size * directions for size in sizes])


EULER = attitudes()
ROTVEC = rotation_vectors()
TRUTH = Rotation.from_euler("ZYX", EULER[:, ::-1])
Q_TRUTH: Array = TRUTH.as_quat(scalar_first=True)


def angle_between(p: Array, q: Array) -> Array:
    """Angle of the rotation from one attitude to the other, rad; blind to the sign of q."""
    p, q = p.astype(np.longdouble), q.astype(np.longdouble)
    vector = p[..., :1] * q[..., 1:] - q[..., :1] * p[..., 1:] - np.cross(p[..., 1:], q[..., 1:])
    return 2.0 * np.linalg.norm(vector.astype(np.float64), axis=-1)


def exact_quaternion(phi: Array) -> list[mpf]:
    vector = [mpf(float(x)) for x in phi]
    size = mp.sqrt(sum(x * x for x in vector))
    factor = mp.sinc(size / 2) / 2
    return [mp.cos(size / 2), *(factor * x for x in vector)]


def test_euler_angles_in_words() -> None:
    """Nose to the east is heading 90°, nose up is pitch, right wing down is roll."""
    forward, right = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    east = dcm_from_quat(quat_from_euler(0.0, 0.0, HALF)) @ forward
    np.testing.assert_allclose(east, [0.0, 1.0, 0.0], rtol=0.0, atol=ROUNDING)
    up = dcm_from_quat(quat_from_euler(0.0, HALF, 0.0)) @ forward
    np.testing.assert_allclose(up, [0.0, 0.0, -1.0], rtol=0.0, atol=ROUNDING)
    wing = dcm_from_quat(quat_from_euler(HALF, 0.0, 0.0)) @ right
    np.testing.assert_allclose(wing, [0.0, 0.0, 1.0], rtol=0.0, atol=ROUNDING)


def test_matrix_is_heading_then_pitch_then_roll() -> None:
    roll, pitch, heading = 0.7, -1.1, 2.3
    turns = [Rotation.from_rotvec(v) for v in np.diag([roll, pitch, heading])]
    truth = (turns[2] * turns[1] * turns[0]).as_matrix()
    found = dcm_from_quat(quat_from_euler(roll, pitch, heading))
    np.testing.assert_allclose(found, truth, rtol=0.0, atol=ROUNDING)


def test_quaternions_from_euler_angles() -> None:
    found = quat_from_euler(*EULER.T)
    assert angle_between(found, Q_TRUTH).max() < ROUNDING
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1.0, rtol=0.0, atol=ROUNDING)


def test_euler_angles_give_the_attitude_back() -> None:
    """The promise of `euler_from_quat`, pitch ±90° included."""
    many = Rotation.random(50_000, rng=np.random.default_rng(9)).as_quat(scalar_first=True)
    for q in (Q_TRUTH, many, -many):
        angles = euler_from_quat(q)
        again = Rotation.from_euler("ZYX", angles[:, ::-1]).as_quat(scalar_first=True)
        # SciPy's own half angles are rounded too, as everywhere else here.
        assert angle_between(again, q).max() < ROUNDING
        assert angle_between(quat_from_euler(*angles.T), q).max() < EULER_CLAIM


def test_euler_angles_are_those_that_went_in() -> None:
    roll, pitch, heading = (euler_from_quat(Q_TRUTH) - EULER).T
    roll, heading = (np.remainder(x + np.pi, 2.0 * np.pi) - np.pi for x in (roll, heading))
    assert np.abs(pitch).max() < ROUNDING
    # Roll and heading blur as the rounding of the attitude over cos(pitch); their sum or
    # difference, the turn about the vertical, stays sharp.
    clear = np.cos(EULER[:, 1]) > 0.5e-3
    for angle in (roll, heading):
        assert np.abs(angle[clear] * np.cos(EULER[clear, 1])).max() < ROUNDING
    up = EULER[:, 1] > 1.5
    vertical = np.where(up, roll - heading, roll + heading)[np.abs(EULER[:, 1]) > 1.5]
    vertical = np.remainder(vertical + np.pi, 2.0 * np.pi) - np.pi
    assert np.abs(vertical).max() < 2.0 * ROUNDING


def test_euler_angles_stay_in_their_ranges() -> None:
    many = Rotation.random(50_000, rng=np.random.default_rng(10)).as_quat(scalar_first=True)
    found = euler_from_quat(np.concatenate([Q_TRUTH, -Q_TRUTH, many]))
    assert np.all(np.abs(found) <= [np.pi, HALF, np.pi])
    assert np.all(np.isfinite(found))


def test_matrices_from_quaternions() -> None:
    C = dcm_from_quat(Q_TRUTH)
    np.testing.assert_allclose(C, TRUTH.as_matrix(), rtol=0.0, atol=ROUNDING)
    np.testing.assert_array_equal(dcm_from_quat(-Q_TRUTH), C)


def test_quaternions_from_matrices() -> None:
    half_turns = [np.diag(d) for d in ([1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0])]
    near = Rotation.from_rotvec(ROTVEC)
    matrices = np.concatenate([TRUTH.as_matrix(), near.as_matrix(), half_turns])
    found = quat_from_dcm(matrices)
    truth = Rotation.from_matrix(matrices).as_quat(scalar_first=True)
    assert angle_between(found, truth).max() < ROUNDING
    assert np.all(found[:, 0] >= 0.0)
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1.0, rtol=0.0, atol=ROUNDING)


def test_quaternions_from_rotation_vectors() -> None:
    found = quat_from_rotvec(ROTVEC)
    with mp.workdps(50):
        for phi, q in zip(ROTVEC, found, strict=True):
            truth = exact_quaternion(phi)
            # Of the angle, not of 1: tiny turns keep all their digits, and turns of 20 rad are
            # rounded to 4e-15 rad before they get here.
            tol = 4e-16 * max(1.0, float(np.linalg.norm(phi)))
            assert abs(q[0] - truth[0]) < tol
            assert all(
                abs(x - y) <= tol * min(1.0, float(np.linalg.norm(phi)))
                for x, y in zip(q[1:], truth[1:], strict=True)
            )


@pytest.mark.parametrize(
    "size", [1e-12, 3e-9, 1e-6, 9e-5, 1.1e-4, 0.02, 0.1732, 0.1733, 0.2449, 0.245, 1.7, 3.1]
)
def test_the_change_of_a_quaternion_keeps_its_digits(size: float) -> None:
    """q - 1 of small turns, relative: cos(x/2) - 1 would lose them all below 1e-8."""
    phi = size * np.array([2.0, -3.0, 6.0]) / 7.0
    with mp.workdps(50):
        truth = exact_quaternion(phi)
        truth[0] -= 1
        change = rotvec_to_quat_change(phi)
        # What the series may leave out, and four roundings.
        assert abs(change[0] - truth[0]) < 1e-17 + 1e-15 * abs(truth[0])
        for found, expected in zip(change[1:], truth[1:], strict=True):
            assert abs(found / expected - 1) < 1e-15
    assert rotvec_to_quat(phi) == (1.0 + change[0], *change[1:])


@pytest.mark.parametrize("x", [1e-9, 1e-4, 0.01, 0.1, 0.1732, 0.1733, 0.2449, 0.245, 2.0, 3.1, 6.2])
def test_rotation_factors(x: float) -> None:
    with mp.workdps(50):
        size = mpf(x)
        truth = (1 - mp.cos(size)) / size**2, (1 - mp.sin(size) / size) / size**2
        for found, expected in zip(rotation_factors(x * x), truth, strict=True):
            # Relative; just above the series 1 - sin(x)/x = 0.005 loses two digits of 16. Near a
            # full turn 1 - cos(x) nearly vanishes, and the rounding of x^2 shows.
            tol = 1e-15 if x < 0.17 else 3e-14 if x < 6.0 else 1e-13
            assert abs(found / expected - 1) < tol
    assert rotation_factors(0.0) == (0.5, 1.0 / 6.0)


def test_rotation_vectors_from_quaternions() -> None:
    short = ROTVEC[np.linalg.norm(ROTVEC, axis=-1) < np.pi - 1e-12]
    found = rotvec_from_quat(quat_from_rotvec(short))
    size = np.linalg.norm(short, axis=-1, keepdims=True)
    # Relative: four roundings.
    assert np.all(np.abs(found - short) <= 1e-15 * size)
    long = Rotation.from_rotvec(ROTVEC)
    shortest = rotvec_from_quat(long.as_quat(scalar_first=True))
    assert np.linalg.norm(shortest, axis=-1).max() <= np.pi * (1.0 + 4e-16)
    again = Rotation.from_rotvec(shortest)
    # A rotation vector of pi is rounded to 4e-16 rad, as often as the attitude is.
    assert (again.inv() * long).magnitude().max() < 2.0 * ROUNDING


@pytest.mark.parametrize("scalar", [0.0, -0.0, 1e-300, -1e-300, 1e-17, -1e-17, 1e-9, -1e-9])
def test_rotation_by_half_a_turn(scalar: float) -> None:
    """Exactly pi and just beside it, from both signs of the quaternion."""
    axis = np.array([2.0, -3.0, 6.0]) / 7.0
    found = rotvec_from_quat([scalar, *axis])
    angle = np.pi - 2.0 * abs(scalar)
    sign = np.copysign(1.0, scalar)
    np.testing.assert_allclose(found, sign * angle * axis, rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("turn", [1e-300, 1e-12, 3e-9, 1e-7, 0.2])
def test_both_signs_of_a_quaternion_are_one_rotation(turn: float) -> None:
    q = np.array([np.cos(0.5 * turn), 0.0, -np.sin(0.5 * turn), 0.0])
    for sign in (1.0, -1.0):
        np.testing.assert_allclose(rotvec_from_quat(sign * q), [0.0, -turn, 0.0], rtol=1e-15)


def test_a_quaternion_of_another_length_is_scaled() -> None:
    for scale in (1e-120, 3.0, 1e120):
        np.testing.assert_allclose(
            dcm_from_quat(scale * Q_TRUTH), TRUTH.as_matrix(), rtol=0.0, atol=ROUNDING
        )
        assert angle_between(
            quat_from_euler(*euler_from_quat(scale * Q_TRUTH).T), Q_TRUTH
        ).max() < (2.0 * ROUNDING)


def test_products_follow_hamilton() -> None:
    one, i, j, k = (tuple(row) for row in np.eye(4))
    minus_one = (-1.0, 0.0, 0.0, 0.0)
    assert quat_product(i, j) == k
    assert quat_product(j, k) == i
    assert quat_product(k, i) == j
    assert quat_product(j, i) == (0.0, 0.0, 0.0, -1.0)
    for unit in (i, j, k):
        assert quat_product(unit, unit) == minus_one
        assert quat_product(one, unit) == quat_product(unit, one) == unit


def test_products_compose_and_rotations_rotate() -> None:
    rng = np.random.default_rng(11)
    P, Q = Rotation.random(200, rng=rng), Rotation.random(200, rng=rng)
    v = rng.normal(size=(200, 3))
    p, q = P.as_quat(scalar_first=True), Q.as_quat(scalar_first=True)
    product = np.stack(quat_product(p.T, q.T), axis=-1)
    assert angle_between(product, (P * Q).as_quat(scalar_first=True)).max() < ROUNDING
    turned = np.stack(quat_rotate(p.T, v.T), axis=-1)
    # m, of vectors of a few metres
    np.testing.assert_allclose(turned, P.apply(v), rtol=0.0, atol=4.0 * ROUNDING)
    np.testing.assert_allclose(
        np.stack(cross(v.T, turned.T), axis=-1), np.cross(v, turned), rtol=0.0, atol=1e-14
    )


@pytest.mark.parametrize(
    ("function", "truth"),
    [
        (lambda q: dcm_from_quat(q), TRUTH.as_matrix()),
        (lambda q: quat_from_dcm(dcm_from_quat(q)), None),
        (lambda q: quat_from_euler(*np.moveaxis(euler_from_quat(q), -1, 0)), None),
        (lambda q: quat_from_rotvec(rotvec_from_quat(q)), None),
    ],
    ids=["dcm", "dcm and back", "euler and back", "rotvec and back"],
)
def test_any_shape(function: Callable[[Array], Array], truth: Array | None) -> None:
    """One, many, a grid, every second, none: the same numbers."""
    rows = function(Q_TRUTH)
    if truth is not None:
        np.testing.assert_allclose(rows, truth, rtol=0.0, atol=ROUNDING)
    else:
        assert angle_between(rows, Q_TRUTH).max() < 2.0 * ROUNDING
    np.testing.assert_array_equal(function(Q_TRUTH[5]), rows[5])
    grid = function(Q_TRUTH[:60].reshape(4, 5, 3, 4))
    np.testing.assert_array_equal(grid, rows[:60].reshape(4, 5, 3, *rows.shape[1:]))
    np.testing.assert_array_equal(function(Q_TRUTH[::-2]), rows[::-2])
    assert function(Q_TRUTH[:0]).shape == (0, *rows.shape[1:])


def test_input_is_left_alone() -> None:
    q, phi = 2.0 * Q_TRUTH[:3], ROTVEC[-3:].copy()
    kept = q.copy(), phi.copy()
    euler_from_quat(q)
    quat_from_rotvec(phi)
    np.testing.assert_array_equal(q, kept[0])
    np.testing.assert_array_equal(phi, kept[1])


def test_euler_angles_broadcast() -> None:
    found = quat_from_euler(0.1, [0.2, -1.3], [[0.4], [2.0], [-3.0]])
    assert found.shape == (3, 2, 4)
    np.testing.assert_array_equal(found[2, 1], quat_from_euler(0.1, -1.3, -3.0))


@pytest.mark.parametrize(
    ("function", "value", "message"),
    [
        (quat_from_rotvec, [1.0, 2.0], r"phi must have shape \(\.\.\., 3\), got \(2,\)"),
        (quat_from_rotvec, 1.0, r"phi must have shape \(\.\.\., 3\), got \(\)"),
        (rotvec_from_quat, np.eye(3), r"q must have shape \(\.\.\., 4\), got \(3, 3\)"),
        (dcm_from_quat, [[1.0, 0.0, 0.0]], r"q must have shape \(\.\.\., 4\), got \(1, 3\)"),
        (euler_from_quat, [1.0], r"q_nb must have shape \(\.\.\., 4\), got \(1,\)"),
        (quat_from_dcm, np.eye(4), r"C must have shape \(\.\.\., 3, 3\), got \(4, 4\)"),
        (rotvec_from_quat, np.zeros(4), "q must not be the zero quaternion"),
        (dcm_from_quat, np.eye(4) * [1, 1, 1, 0], "q must not be the zero quaternion"),
        (euler_from_quat, np.zeros(4), "q_nb must not be the zero quaternion"),
    ],
)
def test_a_wrong_shape_or_a_zero_quaternion_is_named(
    function: Callable[[object], Array], value: object, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        function(value)
