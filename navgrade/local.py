"""Trajectories in a plane that touches the Earth at one point, in the axes robotics uses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from earth.frames import NED_TO_ENU, C_bs, C_en
from earth.geodetic import ecef_to_geodetic, geodetic_to_ecef
from earth.rotation import quat_from_dcm, quat_product
from navgrade.state import Columns, Trajectory

Array = NDArray[np.float64]
World = Literal["ENU", "NED"]
Body = Literal["FLU", "FRD"]
WORLDS: tuple[World, ...] = get_args(World)
BODIES: tuple[Body, ...] = get_args(Body)


@dataclass(frozen=True, eq=False)
class LocalTrajectory:
    """A solution in the tangent plane of an origin, whose axes do not turn with the place.

    Attributes
    ----------
    t : ndarray, shape (n,)
        s since the epoch.
    p, v : ndarray, shape (n, 3)
        Position from the origin (m) and velocity over the Earth (m/s) in the axes of `world`.
    q : ndarray, shape (n, 4)
        Attitude, `body` to `world`, scalar first.
    origin_lat, origin_lon, origin_h : float
        Where the plane touches: geodetic latitude and longitude (rad), height above the
        ellipsoid (m).
    world : {"ENU", "NED"}
        East, north, up, or north, east, down, at the origin.
    body : {"FLU", "FRD"}
        Forward, left, up, or forward, right, down.
    status : ndarray of uint32, shape (n,)
        `navgrade.Status` bits.
    epoch_ns : int
        Unix time of ``t = 0``, ns.
    """

    t: Array
    p: Array
    v: Array
    q: Array
    origin_lat: float
    origin_lon: float
    origin_h: float
    world: World
    body: Body
    status: NDArray[np.uint32]
    epoch_ns: int = 0

    def __len__(self) -> int:
        return len(self.t)


def to_local(
    trajectory: Trajectory,
    origin_lat: float,
    origin_lon: float,
    origin_h: float,
    world: World = "ENU",
    body: Body = "FLU",
) -> LocalTrajectory:
    """Describe a solution in the tangent plane of an origin.

    Parameters
    ----------
    trajectory : Trajectory
    origin_lat, origin_lon : float
        Geodetic latitude and longitude of the origin, rad.
    origin_h : float
        Its height above the ellipsoid, m.
    world : {"ENU", "NED"}
    body : {"FLU", "FRD"}

    Returns
    -------
    LocalTrajectory
        Exact but for the rounding of Earth-fixed positions, 2 nm. The plane does not bend with
        the Earth: 10 km away the ground lies 8 m below it.

    Raises
    ------
    ValueError
        On other axes, and on a latitude beyond ±pi/2.
    """
    C_we, q_wn, q_bs = _axes(origin_lat, origin_lon, world, body)
    r_e = geodetic_to_ecef(trajectory.lat, trajectory.lon, trajectory.h)
    to_world = C_we @ C_en(trajectory.lat, trajectory.lon)  # C_w,n along the way
    q = _product(q_wn, _turn(trajectory.lat, trajectory.lon, origin_lat, origin_lon))
    return LocalTrajectory(
        t=trajectory.t,
        p=(r_e - geodetic_to_ecef(origin_lat, origin_lon, origin_h)) @ C_we.T,
        v=np.einsum("nij,nj->ni", to_world, trajectory.v_eb_n),
        q=_product(_product(q, trajectory.q_nb), q_bs),
        origin_lat=origin_lat,
        origin_lon=origin_lon,
        origin_h=origin_h,
        world=world,
        body=body,
        status=trajectory.status,
        epoch_ns=trajectory.epoch_ns,
    )


def from_local(local: LocalTrajectory) -> Trajectory:
    """Return the solution `to_local` described; exact but for the rounding of positions, 2 nm.

    Raises
    ------
    ValueError
        On unknown axes, and on a latitude beyond ±pi/2.
    """
    C_we, q_wn, q_bs = _axes(local.origin_lat, local.origin_lon, local.world, local.body)
    origin = geodetic_to_ecef(local.origin_lat, local.origin_lon, local.origin_h)
    lat, lon, h = ecef_to_geodetic(origin + local.p @ C_we)
    from_world = np.swapaxes(C_we @ C_en(lat, lon), -1, -2)
    q = _product(q_wn, _turn(lat, lon, local.origin_lat, local.origin_lon))
    columns = Columns(
        lat,
        lon,
        h,
        np.einsum("nij,nj->ni", from_world, local.v),
        _product(_product(_inverse(q), local.q), _inverse(q_bs)),
    )
    return Trajectory.made(local.t, columns, local.status, local.epoch_ns)


def _axes(lat: float, lon: float, world: str, body: str) -> tuple[Array, Array, Array]:
    """Earth-fixed axes to the world's; quaternions from the origin's NED, and body to FRD."""
    for name, value, allowed in (("world", world, WORLDS), ("body", body, BODIES)):
        if value not in allowed:
            raise ValueError(f"{name} must be one of {', '.join(allowed)}, got {value!r}")
    C_wn = NED_TO_ENU if world == "ENU" else np.eye(3)
    return C_wn @ C_en(lat, lon).T, quat_from_dcm(C_wn), quat_from_dcm(C_bs(body))


def _turn(lat: Array, lon: Array, origin_lat: float, origin_lon: float) -> Array:
    """Quaternions from NED along the way to NED at the origin."""
    return quat_from_dcm(C_en(origin_lat, origin_lon).T @ C_en(lat, lon))


def _product(p: Array, q: Array) -> Array:
    product: Array = np.stack(quat_product(np.moveaxis(p, -1, 0), np.moveaxis(q, -1, 0)), axis=-1)
    return product


def _inverse(q: Array) -> Array:
    inverse: Array = q * np.array([1.0, -1.0, -1.0, -1.0])
    return inverse
