"""The body as other programs place it: in a map with axes east, north, up (REP-103, REP-105)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from earth._jit import formula, kernel
from earth.ellipsoid import WGS84
from earth.frames import ned_to_ecef_quat
from earth.geodetic import ecef_from_geodetic
from earth.rotation import quat_product, quat_rotate, quat_to_rotvec
from navgrade.logs.thinning import Thinning
from navgrade.state import Trajectory

# half turns: about forward, from forward-left-up to forward-right-down; and about north-east
_Q_FLU = (0.0, 1.0, 0.0, 0.0)
_Q_ENU_NED = (0.0, np.sqrt(0.5), np.sqrt(0.5), 0.0)

Array = NDArray[np.float64]


class Poses(NamedTuple):
    """Where the body is in the map and how it moves over the Earth.

    Attributes
    ----------
    rows : ndarray of int
        Of the solution.
    position : ndarray, shape (n, 3)
        East, north, up of the map's origin, m.
    orientation : ndarray, shape (n, 4)
        Body (forward-left-up) to map, scalar first.
    velocity : ndarray, shape (n, 3)
        Over the Earth, in forward-left-up axes, m/s.
    rate : ndarray, shape (n, 3)
        Mean angular rate relative to the Earth over the interval that ends here, in
        forward-left-up axes, rad/s.
    """

    rows: NDArray[np.intp]
    position: Array
    orientation: Array
    velocity: Array
    rate: Array


@formula
def conjugate(q):
    """Return the inverse of a unit quaternion."""
    return q[0], -q[1], -q[2], -q[3]


@formula
def to_ecef(lat, lon):
    """Return q_en."""
    return ned_to_ecef_quat(np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon))


@formula
def level_attitude(q_nb, k):
    """Return the quaternion from the body's forward-left-up axes, in row `k`, to NED."""
    return quat_product((q_nb[k, 0], q_nb[k, 1], q_nb[k, 2], q_nb[k, 3]), _Q_FLU)


@formula
def map_attitude(q_me, lat, lon, q_nb, k):
    """Return the quaternion from the body's forward-left-up axes, in row `k`, to the map's."""
    q_mn = quat_product(q_me, to_ecef(lat[k], lon[k]))
    return quat_product(q_mn, level_attitude(q_nb, k))


@kernel
def _place(params, lat0, lon0, h0, t, lat, lon, h, v_eb_n, q_nb, last, rows, out):
    """Fill `out` with the poses of `rows`; `last` is the time and attitude before row 0."""
    q_me = quat_product(_Q_ENU_NED, conjugate(to_ecef(lat0, lon0)))
    x0, y0, z0 = ecef_from_geodetic(params, lat0, lon0, h0)
    position, orientation, velocity, rate = out
    for j in range(len(rows)):
        k = rows[j]
        t_before, q_before = last[0], (last[1], last[2], last[3], last[4])
        if k > 0:
            t_before, q_before = t[k - 1], map_attitude(q_me, lat, lon, q_nb, k - 1)
        q = map_attitude(q_me, lat, lon, q_nb, k)
        x, y, z = ecef_from_geodetic(params, lat[k], lon[k], h[k])
        away = quat_rotate(q_me, (x - x0, y - y0, z - z0))
        v_n = v_eb_n[k, 0], v_eb_n[k, 1], v_eb_n[k, 2]
        v = quat_rotate(conjugate(level_attitude(q_nb, k)), v_n)
        turn = quat_to_rotvec(quat_product(conjugate(q_before), q))
        for i in range(3):
            position[j, i] = away[i]
            velocity[j, i] = v[i]
            rate[j, i] = turn[i] / (t[k] - t_before)
        for i in range(4):
            orientation[j, i] = q[i]
    last[0] = t[-1]
    last[1], last[2], last[3], last[4] = map_attitude(q_me, lat, lon, q_nb, len(t) - 1)


class LocalMap:
    """A plane tangent to the ellipsoid at the first position of a solution.

    The first row of the solution gives no pose: it ends no interval from which to take a rate.

    Parameters
    ----------
    rate_hz : float
        Of poses, at most.
    """

    def __init__(self, rate_hz: float) -> None:
        self._thinning = Thinning(rate_hz)
        self._origin: tuple[float, float, float] | None = None
        self._last = np.empty(5)

    def poses(self, nav: Trajectory) -> Poses:
        """Poses in the next block of the solution; they do not depend on where blocks end."""
        first = 0
        if self._origin is None:
            self._origin = nav.lat[0], nav.lon[0], nav.h[0]
            first = 1
        rows = first + self._thinning.rows(nav.t[first:])
        poses = Poses(rows, *(np.empty((len(rows), width)) for width in (3, 4, 3, 3)))
        columns = (nav.t, nav.lat, nav.lon, nav.h, nav.v_eb_n, nav.q_nb)
        _place(WGS84.params, *self._origin, *columns, self._last, rows, poses[1:])
        return poses
