"""Solutions in a tangent plane, against another library's, and back."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np
import pymap3d
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from navgrade import Trajectory
from navgrade.local import BODIES, WORLDS, from_local, to_local
from tests.oracles.truth import manoeuvre, quaternion_product

Array = NDArray[np.float64]

DEG = np.pi / 180.0
ORIGIN = (44.8 * DEG, 10.3 * DEG, 350.0)


def flight() -> Trajectory:
    """Two minutes of a flight, up to 60 km from the origin, with a marked row."""
    s = manoeuvre().state(np.arange(3.0, 123.0))
    status = np.zeros(120, np.uint32)
    status[7] = 2
    return Trajectory(s.t, s.lat, s.lon, s.h, s.v_eb_n, s.q_nb, status, epoch_ns=1_600_000_000)


def axes(lat: Array, lon: Array) -> Rotation:
    """NED to Earth-fixed axes."""
    return Rotation.from_euler("ZY", np.stack([lon, -lat - np.pi / 2], axis=-1))


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("world", WORLDS)
def test_plane(world: Literal["ENU", "NED"], body: Literal["FLU", "FRD"]) -> None:
    nav = flight()
    local = to_local(nav, *ORIGIN, world=world, body=body)
    offset = pymap3d.geodetic2enu if world == "ENU" else pymap3d.geodetic2ned
    wanted = np.stack(offset(nav.lat, nav.lon, nav.h, *ORIGIN, deg=False), axis=-1)
    # m: rounding of Earth-fixed positions
    np.testing.assert_allclose(local.p, wanted, rtol=0, atol=6e-9)
    to_world = Rotation.from_matrix(
        [[0, 1, 0], [1, 0, 0], [0, 0, -1]] if world == "ENU" else np.eye(3)
    )
    to_frd = Rotation.from_matrix(np.diag([1, -1, -1]) if body == "FLU" else np.eye(3))
    turn = to_world * axes(np.array(ORIGIN[0]), np.array(ORIGIN[1])).inv() * axes(nav.lat, nav.lon)
    np.testing.assert_allclose(local.v, turn.apply(nav.v_eb_n.copy()), rtol=0, atol=1e-12)
    attitude = turn * Rotation.from_quat(nav.q_nb.copy(), scalar_first=True) * to_frd
    found = Rotation.from_quat(local.q, scalar_first=True)
    assert (attitude.inv() * found).magnitude().max() < 1e-15
    assert len(local) == len(nav)


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("world", WORLDS)
def test_there_and_back(world: Literal["ENU", "NED"], body: Literal["FLU", "FRD"]) -> None:
    nav = flight()
    back = from_local(to_local(nav, *ORIGIN, world=world, body=body))
    # rad, m: 2 nm of rounding, three times
    np.testing.assert_allclose(back.lat, nav.lat, rtol=0, atol=1e-15)
    np.testing.assert_allclose(back.lon, nav.lon, rtol=0, atol=1e-15)
    np.testing.assert_allclose(back.h, nav.h, rtol=0, atol=6e-9)
    np.testing.assert_allclose(back.v_eb_n, nav.v_eb_n, rtol=0, atol=2e-13)
    np.testing.assert_allclose(back.q_nb, nav.q_nb, rtol=0, atol=1e-15)  # its sign, too
    assert back.status.tolist() == nav.status.tolist()
    assert (back.t.tolist(), back.epoch_ns) == (nav.t.tolist(), nav.epoch_ns)


def test_body_axes_as_robots_name_them() -> None:
    """Level and heading east at the origin: forward is x of ENU, left is y, and it climbs."""
    nav = Trajectory(
        t=np.array([1.0]),
        lat=np.array([ORIGIN[0]]),
        lon=np.array([ORIGIN[1]]),
        h=np.array([ORIGIN[2] + 5.0]),
        v_eb_n=np.array([[0.0, 20.0, -3.0]]),
        q_nb=np.array([[np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]]),
        status=np.zeros(1),
    )
    local = to_local(nav, *ORIGIN)
    np.testing.assert_allclose(local.p, [[0.0, 0.0, 5.0]], rtol=0, atol=4e-9)
    np.testing.assert_allclose(local.v, [[20.0, 0.0, 3.0]], rtol=0, atol=1e-14)
    np.testing.assert_allclose(np.abs(local.q), [[1.0, 0.0, 0.0, 0.0]], rtol=0, atol=1e-15)
    roll = np.array([[np.cos(0.1), np.sin(0.1), 0.0, 0.0]])  # right side down by 0.2 rad
    banked = dataclasses.replace(nav, q_nb=quaternion_product(nav.q_nb, roll))
    C = Rotation.from_quat(to_local(banked, *ORIGIN).q[0], scalar_first=True).as_matrix()
    np.testing.assert_allclose(C @ [0, 1, 0], [0.0, np.cos(0.2), np.sin(0.2)], atol=1e-15)


def test_wrong_axes_and_degrees() -> None:
    with pytest.raises(ValueError, match="world must be one of ENU, NED, got 'NWU'"):
        to_local(flight(), *ORIGIN, world="NWU")  # type: ignore[arg-type]  # the error itself
    with pytest.raises(ValueError, match="body must be one of FLU, FRD, got 'RFU'"):
        to_local(flight(), *ORIGIN, body="RFU")  # type: ignore[arg-type]  # the error itself
    with pytest.raises(ValueError, match="degrees are not radians"):
        to_local(flight(), 44.8, 10.3, 350.0)
