"""Frames against GeographicLib's table and SciPy; axis conventions by what the words say."""

from pathlib import Path

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.spatial.transform import Rotation

from earth import GRS80, WGS84, C_bs, C_en, C_ie, Ellipsoid, geodetic_to_ecef
from earth.frames import NED_TO_ENU
from tests.earth import exact
from tests.oracles.constants import OMEGA

DEG = np.pi / 180.0
ROUNDING = 1e-15  # four roundings of a matrix element of 1

FORWARD, RIGHT, DOWN = np.eye(3)
DIRECTIONS = {"F": FORWARD, "R": RIGHT, "D": DOWN, "B": -FORWARD, "L": -RIGHT, "U": -DOWN}
WORDS = {"F": "forward", "R": "right", "D": "down", "B": "back", "L": "left", "U": "up"}
TRIPLES = [a + b + c for a in DIRECTIONS for b in DIRECTIONS for c in DIRECTIONS]


def handedness(axes: str) -> float:
    x, y, z = (DIRECTIONS[letter] for letter in axes)
    return float(np.dot(np.cross(x, y), z))


RIGHT_HANDED = [axes for axes in TRIPLES if handedness(axes) > 0.5]


def test_C_en_against_the_table(shared_data: Path) -> None:
    """The table's columns are east, north and up in Earth-fixed axes."""
    table = np.loadtxt(shared_data / "lla_ecef_wgs84_geographiclib.csv", delimiter=",", skiprows=1)
    east, north, up = np.moveaxis(table[:, 8:].reshape(-1, 3, 3), -1, 0)
    found = C_en(table[:, 0] * DEG, table[:, 1] * DEG)
    truth = np.stack([north, east, -up], axis=-1)
    np.testing.assert_allclose(found, truth, rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("lat", [-np.pi / 2, -1.2, -1e-9, 0.4, 1.5707, np.pi / 2])
@pytest.mark.parametrize("lon", [-np.pi, -2.0, 1e-9, 0.17, 3.1415926, np.pi])
def test_C_en(lat: float, lon: float) -> None:
    found = C_en(lat, lon)
    with mp.workdps(40):
        truth = np.array(exact.C_en(mpf(lat), mpf(lon)).tolist(), dtype=float)
    np.testing.assert_allclose(found, truth, rtol=0.0, atol=ROUNDING)
    by_turns = Rotation.from_euler("ZY", [lon, -lat - np.pi / 2]).as_matrix()
    np.testing.assert_allclose(found, by_turns, rtol=0.0, atol=ROUNDING)


def test_C_en_points_along_displacements() -> None:
    """North is where latitude grows, east where longitude grows, down where height falls."""
    lat, lon, h = -0.61, 2.9, 400.0
    step = 1e-6  # rad, 6 m; curvature turns the chord by half of it
    r = geodetic_to_ecef(lat, lon, h)
    moves = (
        geodetic_to_ecef(lat + step, lon, h) - r,
        geodetic_to_ecef(lat, lon + step, h) - r,
        geodetic_to_ecef(lat, lon, h - 6.0) - r,
    )
    found = C_en(lat, lon)
    for column, move in zip(found.T, moves, strict=True):
        np.testing.assert_allclose(move / np.linalg.norm(move), column, rtol=0.0, atol=step)


def test_C_en_broadcasts() -> None:
    lat, lon = np.array([[0.3], [-1.1]]), np.array([0.1, -3.0, 2.2])
    found = C_en(lat, lon)
    assert found.shape == (2, 3, 3, 3)
    np.testing.assert_array_equal(found[1, 2], C_en(-1.1, 2.2))


@pytest.mark.parametrize("t", [-4000.0, 1e-6, 3600.0, 86164.0989, 1e6])  # s
def test_C_ie_turns_eastward(t: float) -> None:
    truth = Rotation.from_rotvec([0.0, 0.0, OMEGA * t]).as_matrix()
    # Rounding of the angle, 1e-16 of 73 rad at most.
    np.testing.assert_allclose(C_ie(t), truth, rtol=0.0, atol=2e-14)


def test_C_ie_in_words() -> None:
    """After a quarter of a sidereal day Greenwich points where 90° E pointed at first."""
    quarter = 0.25 * 2.0 * np.pi / OMEGA  # s
    greenwich = C_ie(quarter) @ [1.0, 0.0, 0.0]
    np.testing.assert_allclose(greenwich, [0.0, 1.0, 0.0], rtol=0.0, atol=ROUNDING)
    np.testing.assert_array_equal(C_ie(0.0), np.eye(3))
    several = C_ie(np.array([[1.0, 2.0]]))
    assert several.shape == (1, 2, 3, 3)
    np.testing.assert_array_equal(several[0, 1], C_ie(2.0))


def test_C_ie_takes_the_rate_of_its_ellipsoid() -> None:
    spinning = Ellipsoid("fast", WGS84.a, WGS84.f, WGS84.GM, 1e-3, "made up")
    truth = Rotation.from_rotvec([0.0, 0.0, 0.5]).as_matrix()
    np.testing.assert_allclose(C_ie(500.0, spinning), truth, rtol=0.0, atol=ROUNDING)
    np.testing.assert_array_equal(C_ie(500.0, GRS80), C_ie(500.0))


def test_NED_TO_ENU() -> None:
    np.testing.assert_array_equal(NED_TO_ENU @ [1.0, 2.0, 3.0], [2.0, 1.0, -3.0])
    with pytest.raises(ValueError, match="read-only"):
        NED_TO_ENU[0, 0] = 1.0


@pytest.mark.parametrize("axes", RIGHT_HANDED)
def test_every_right_handed_triple_of_letters_and_of_words(axes: str) -> None:
    truth = np.stack([DIRECTIONS[letter] for letter in axes], axis=-1)
    assignments = [f"{name}={WORDS[letter]}" for name, letter in zip("xyz", axes, strict=True)]
    for text in (
        axes,
        axes.lower(),
        f"  {axes} ",
        " ".join(assignments),
        ", ".join(reversed(assignments)),
        ";".join(assignments).upper(),
        " ".join(a.replace("=", " = + ") for a in assignments),
    ):
        found = C_bs(text)
        np.testing.assert_array_equal(found, truth, err_msg=text)


def test_a_sign_turns_a_direction_round() -> None:
    found = C_bs("x=-back y=-left z=-up")
    np.testing.assert_array_equal(found, np.eye(3))
    assert not np.any(np.signbit(found)), "a negative zero"
    np.testing.assert_array_equal(C_bs("x=-down y=+right z=forward"), C_bs("URF"))


def test_v_b_from_v_s_in_words() -> None:
    """A sensor with x right, y forward, z up feels 1 on x: it is to the right."""
    np.testing.assert_array_equal(C_bs("RFU") @ [1.0, 2.0, 3.0], [2.0, 1.0, -3.0])
    np.testing.assert_array_equal(C_bs("FLU") @ [1.0, 2.0, 3.0], [1.0, -2.0, -3.0])
    np.testing.assert_array_equal(C_bs("UFL") @ [1.0, 2.0, 3.0], [2.0, -3.0, -1.0])


@pytest.mark.parametrize("axes", [axes for axes in TRIPLES if handedness(axes) < 0.5][::7])
def test_a_triple_that_is_not_right_handed_is_refused(axes: str) -> None:
    with pytest.raises(ValueError, match=f"axes '{axes}': it is not a right-handed triple"):
        C_bs(axes)


@pytest.mark.parametrize(
    ("axes", "reason"),
    [
        ("", "it leaves x, y, z open"),
        ("x=up", "it leaves y, z open"),
        ("FR", "it is not understood"),
        ("FRDX", "it is not understood"),
        ("NED", "it is not understood"),
        ("x=forward y=right z=down please", "it is not understood"),
        ("x=north y=east z=down", "x=north is not understood"),
        ("x=forward x=right z=down", "x=right is not understood"),
        ("x=forward y=right z=-bottom", "z=-bottom is not understood"),
        ("x=forward y=right z=up", "it is not a right-handed triple"),
        ("x=forward y=right z=right", "it is not a right-handed triple"),
    ],
)
def test_a_text_that_is_no_triple_is_refused_with_the_way_out(axes: str, reason: str) -> None:
    with pytest.raises(ValueError) as refusal:
        C_bs(axes)
    message = str(refusal.value)
    assert f"axes {axes!r}: {reason};" in message
    assert "FRD, FLU, RFU" in message


def test_the_example_in_the_help_is_itself_valid() -> None:
    with pytest.raises(ValueError) as refusal:
        C_bs("")
    example = str(refusal.value).split('"')[1]
    assert example.startswith("x=")
    assert abs(np.linalg.det(C_bs(example)) - 1.0) < ROUNDING
    assert C_bs.__doc__ is not None
    documented = C_bs.__doc__.split('``"x=')[1].split('"')[0]
    assert abs(np.linalg.det(C_bs("x=" + documented)) - 1.0) < ROUNDING
