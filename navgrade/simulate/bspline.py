"""A motion near given poses, by cumulative B-splines; and one along a path drawn by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.interpolate
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import PPoly

from earth.rotation import quat_product, rotvec_from_quat
from earth.units import DEG
from navgrade.simulate.jet import Jet
from navgrade.simulate.kinematics import JetQuad, Kinematics, conjugate, over_earth
from navgrade.simulate.motion import check_latitudes
from navgrade.simulate.waypoints import (
    along_path,
    continuous_quaternions,
    leg_directions,
    velocity_n,
)

Array = NDArray[np.float64]

_SHARPEST = 150.0 * DEG  # rad: a rotation between poses, a corner of a drawn path
_SAME = 1e-3  # m: nearer points are one


class BSpline:
    """A motion by a B-spline whose control points are poses at equal intervals.

    It comes near the poses and does not go through them; in return it never overshoots. Attitude is
    the cumulative B-spline on SO(3), ``q = q_i prod_j exp(B_j(t) Omega_j)`` with Omega_j the
    rotation vector from one pose to the next, position the B-spline of the same basis. Lovegrove,
    Patron-Perez, Sibley, Spline Fusion (BMVC 2013).

    Parameters
    ----------
    t0, dt : float
        Time of the first pose and interval, s.
    lat, lon, h : array_like, shape (n,)
        rad (longitudes may jump at the antimeridian), rad, m above the ellipsoid.
    q_nb : array_like, shape (n, 4)
    degree : {3, 5}
        3 as in the paper, with two continuous derivatives, or 5, with four.

    Attributes
    ----------
    start, end : float
        s; (degree - 1) / 2 intervals after the first and before the last pose.

    Raises
    ------
    ValueError
        On fewer than degree + 1 poses, a rotation of more than 150° between neighbours, or beyond
        latitude ±89°; poses are counted from 1.
    """

    def __init__(
        self,
        t0: float,
        dt: float,
        lat: ArrayLike,
        lon: ArrayLike,
        h: ArrayLike,
        q_nb: ArrayLike,
        degree: int = 5,
    ) -> None:
        if degree not in (3, 5):
            raise ValueError(f"degree must be 3 or 5, got {degree!r}")
        if not (np.isfinite(t0) and np.isfinite(dt) and dt > 0.0):
            raise ValueError(f"t0 must be finite and dt positive, got {t0!r} s and {dt!r} s")
        lat, lon, h = _path(lat, lon, h)
        if len(lat) < degree + 1:
            raise ValueError(f"degree {degree} needs {degree + 1} poses, got {len(lat)}")
        check_latitudes(lat, "pose {}")
        self._dt, self._degree = float(dt), degree
        self._spans = len(lat) - degree
        self.start = float(t0 + 0.5 * (degree - 1) * dt)
        self.knots = self.start + dt * np.arange(1, self._spans)
        self.end = self.start + dt * self._spans
        self.bandwidth = float(np.pi / dt)  # the fastest that poses can tell
        self._path = np.stack([lat, np.unwrap(lon), h])
        self._steps = np.diff(self._path)
        q = continuous_quaternions(q_nb, len(lat), _SHARPEST, "pose")
        self._q = q.T
        turns = rotvec_from_quat(np.stack(quat_product(conjugate(q[:-1].T), q[1:].T), axis=-1)).T
        self._half_angles = 0.5 * np.linalg.norm(turns, axis=0)
        length = np.where(self._half_angles > 0.0, 2.0 * self._half_angles, 1.0)
        self._axes = turns / length
        self._basis = _cumulative_basis(degree)

    def at(self, t: Array) -> Kinematics:
        """Kinematics at times `t`, s, shape (n,)."""
        elapsed = t - self.start
        span = np.clip(np.floor(elapsed / self._dt).astype(np.intp), 0, self._spans - 1)
        u = Jet(elapsed / self._dt - span, 1.0 / self._dt, 0.0)
        coordinates = [Jet(row[span], 0.0, 0.0) for row in self._path]
        a, b, c, d = (Jet(row[span], 0.0, 0.0) for row in self._q)
        q: JetQuad = a, b, c, d
        for j, polynomial in enumerate(self._basis):
            weight = _horner(polynomial, u)
            which = span + j
            coordinates = [
                x + row[which] * weight for x, row in zip(coordinates, self._steps, strict=True)
            ]
            half = self._half_angles[which] * weight
            sin = np.sin(half)
            q = quat_product(q, (np.cos(half), *(row[which] * sin for row in self._axes)))
        x, y, z = coordinates
        return over_earth(t, x, y, z, q)


def _horner(polynomial: Polynomial, u: Jet) -> Any:
    total: Any = 0.0
    for coefficient in reversed(polynomial.coef.tolist()):
        total = total * u + coefficient
    return total


def _cumulative_basis(degree: int) -> list[Polynomial]:
    """B~_1 to B~_degree on one interval of unit length: from 0 or more at its start to 1 at most.

    B~_j is the sum of the basis functions of the control points from the j-th on.
    """
    element = scipy.interpolate.BSpline.basis_element(np.arange(degree + 2.0))
    powers = PPoly.from_spline(element).c[::-1, degree : 2 * degree + 1]  # [power, its interval]
    basis = [Polynomial(powers[:, degree - k]) for k in range(degree + 1)]
    return [sum(basis[j:], Polynomial([0.0])) for j in range(1, degree + 1)]


def _path(lat: ArrayLike, lon: ArrayLike, h: ArrayLike) -> tuple[Array, Array, Array]:
    rows = [np.array(values, dtype=np.float64) for values in (lat, lon, h)]
    if len({row.shape for row in rows}) != 1 or rows[0].ndim != 1:
        raise ValueError(
            "lat, lon and h must be rows of one length, got shapes "
            + ", ".join(str(row.shape) for row in rows)
        )
    good = np.isfinite(np.sum(rows, axis=0))
    if not good.all():
        raise ValueError(f"point {int(np.argmin(good)) + 1} is not finite")
    return rows[0], np.unwrap(rows[1]), rows[2]


def drawn_path(
    lat: ArrayLike,
    lon: ArrayLike,
    h: ArrayLike,
    speed: float,
    *,
    dt: float = 2.0,
    still: float = 60.0,
    degree: int = 5,
) -> BSpline:
    """Drive along a line drawn without times: from rest, at one speed, to rest.

    The line is cut into equal lengths that take about `dt` at `speed`; their ends are the control
    points of a `BSpline`. Heading and pitch are those of the spline's velocity, roll is 0.

    Parameters
    ----------
    lat, lon, h : array_like, shape (n,)
        Corners of the line: rad, rad, m above the ellipsoid.
    speed : float
        On straight legs, m/s.
    dt : float
        Interval of the control points, s, as a wish: it is changed a little so that a whole number
        of intervals fits. Corners are rounded and speed is gained within about `degree` intervals.
    still : float
        How long the vehicle stands before it starts, s; at least `dt`.
    degree : {3, 5}

    Returns
    -------
    BSpline
        It starts at 0 s and stands at rest at both ends.

    Raises
    ------
    ValueError
        On fewer than two points, two equal points in a row, a corner sharper than 150°, or a number
        that is not positive; points are counted from 1.

    Notes
    -----
    The path cuts a corner of 90° by up to half of `speed` times `dt` and slows down there to 0.7 of
    its speed. The spline rounds headings as it rounds the path, once more: the velocity leaves the
    forward axis by up to 3° in a corner of 30°, 10° in one of 90° and 17° in one of 120°
    (`tests/navgrade/simulate/test_bspline.py`). Corners drawn with more points slip less.
    """
    for name, value, unit in (("speed", speed, "m/s"), ("dt", dt, "s")):
        if not (np.isfinite(value) and value > 0.0):
            raise ValueError(f"{name} must be positive, got {value!r} {unit}")
    if not (np.isfinite(still) and still >= 0.0):
        raise ValueError(f"still must not be negative, got {still!r} s")
    lat, lon, h = _path(lat, lon, h)
    if len(lat) < 2:
        raise ValueError(f"a path needs two points or more, got {len(lat)}")
    check_latitudes(lat, "point {}")
    length, _, turn = leg_directions(lat, lon, h)
    if (length < _SAME).any():
        k = int(np.argmax(length < _SAME))
        raise ValueError(f"points {k + 1} and {k + 2} are at the same place; drop one")
    if (turn > _SHARPEST).any():
        k = int(np.argmax(turn > _SHARPEST))
        raise ValueError(
            f"the path turns back by {turn[k] / DEG:.0f}° at point {k + 2}, more than 150°; round "
            "the corner with points in between"
        )
    along = np.concatenate([[0.0], np.cumsum(length)])
    count = max(1, round(along[-1] / (speed * dt)))
    dt = float(along[-1] / (speed * count))
    before, after = degree + max(1, int(np.ceil(still / dt - 1e-9))), degree + 1
    ends = np.linspace(0.0, along[-1], count + 1)
    path = np.stack(
        [
            np.pad(np.interp(ends, along, row), (before - 1, after - 1), mode="edge")
            for row in (lat, lon, h)
        ],
        axis=-1,
    )
    n = len(path)
    knots = np.arange(n + degree + 1.0) - 0.5 * (degree + 1)  # control point k is at time k
    rate = scipy.interpolate.BSpline(knots, path - path[0], degree)(np.arange(n), nu=1) / dt
    q_nb = along_path(velocity_n(path[:, 0], path[:, 2], rate), 1e-3 * speed)
    lat, lon, h = path.T
    return BSpline(-0.5 * (degree - 1) * dt, dt, lat, lon, h, q_nb, degree)
