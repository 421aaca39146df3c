"""The body as other programs place it: in a map with axes east, north, up (REP-103, REP-105)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from earth.frames import NED_TO_ENU, C_en
from earth.geodetic import geodetic_to_ecef
from earth.rotation import dcm_from_quat, quat_from_dcm, rotvec_from_quat
from navgrade.logs.thinning import Thinning
from navgrade.state import Trajectory

_FLU_TO_FRD = np.diag([1.0, -1.0, -1.0])
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
        self._last: tuple[float, Array] | None = None  # time and attitude of the last row seen

    def poses(self, nav: Trajectory) -> Poses:
        """Poses in the next block of the solution."""
        first = 0
        if self._last is None:
            first = 1
            self._origin = geodetic_to_ecef(nav.lat[0], nav.lon[0], nav.h[0])
            self._C_me = NED_TO_ENU @ C_en(nav.lat[0], nav.lon[0]).T
        rows = first + self._thinning.rows(nav.t[first:])
        C_mb, C_mb_before = self._attitude(nav, rows), self._attitude(nav, rows - 1)
        t_before = nav.t[rows - 1]
        if self._last is not None and len(rows) and rows[0] == 0:
            t_before[0], C_mb_before[0] = self._last
        self._last = float(nav.t[-1]), self._attitude(nav, np.array([-1]))[0]
        turn = rotvec_from_quat(quat_from_dcm(np.swapaxes(C_mb_before, 1, 2) @ C_mb))
        r_eb_e = geodetic_to_ecef(nav.lat[rows], nav.lon[rows], nav.h[rows])
        v_frd = np.einsum("kji,kj->ki", dcm_from_quat(nav.q_nb[rows]), nav.v_eb_n[rows])
        return Poses(
            rows,
            position=(r_eb_e - self._origin) @ self._C_me.T,
            orientation=quat_from_dcm(C_mb),
            velocity=v_frd @ _FLU_TO_FRD,
            rate=turn / (nav.t[rows] - t_before)[:, None],
        )

    def _attitude(self, nav: Trajectory, rows: NDArray[np.intp]) -> Array:
        """Matrices (n, 3, 3) from the body's forward-left-up axes to the map."""
        C_mn = self._C_me @ C_en(nav.lat[rows], nav.lon[rows])
        C_mb: Array = C_mn @ dcm_from_quat(nav.q_nb[rows]) @ _FLU_TO_FRD
        return C_mb
