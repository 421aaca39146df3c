"""A smooth motion through given points, with given attitudes or along its own path."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import make_interp_spline

from earth.ellipsoid import WGS84
from earth.geodetic import curvatures
from earth.rotation import quat_from_euler
from earth.units import DEG
from navgrade.simulate.jet import Jet
from navgrade.simulate.kinematics import JetQuad, Kinematics, over_earth
from navgrade.simulate.motion import check_latitudes

Array = NDArray[np.float64]

_DEGREE = 5
_MOVING = 0.5  # m/s: slower than that a path has no direction
_SHARES = (0.0, 0.2, 0.35, 0.5, 0.65, 0.8)  # of an interval: where the spline is looked at
_SHARPEST = 120.0 * DEG  # rad: a turn between legs, a rotation between waypoints


class Waypoints:
    """A motion through waypoints by interpolating quintic splines.

    Latitude, longitude and height have four continuous derivatives. So has the attitude: a spline
    of the components of the quaternion relative to north-east-down, normalised, which depends
    neither on the axes of the body nor on those of the reference. The spline ends not-a-knot.

    Parameters
    ----------
    t : array_like, shape (n,)
        s, increasing; six waypoints or more, not necessarily at equal intervals.
    lat, lon : array_like, shape (n,)
        rad; longitudes may jump at the antimeridian.
    h : array_like, shape (n,)
        Height above the ellipsoid, m.
    q_nb : array_like, shape (n, 4), optional
        Attitudes. Without them the body follows its path: at each waypoint heading and pitch are
        those of the velocity, roll is 0; slower than 0.5 m/s they are those of the nearest waypoint
        that moves. Between waypoints the attitude is interpolated, so that a little sideslip
        remains where the path bends.

    Raises
    ------
    ValueError
        Naming the waypoints, counted from 1: at one time or going back in time, a kink (a turn of
        more than 120° at speed), a rotation of more than 120° between neighbours, beyond latitude
        ±89°; or where no waypoint moves and no attitude is given.
    """

    def __init__(
        self,
        t: ArrayLike,
        lat: ArrayLike,
        lon: ArrayLike,
        h: ArrayLike,
        q_nb: ArrayLike | None = None,
    ) -> None:
        t, lat, lon, h = (
            _column(name, values)
            for name, values in (("t", t), ("lat", lat), ("lon", lon), ("h", h))
        )
        if len({len(t), len(lat), len(lon), len(h)}) != 1:
            raise ValueError(
                "t, lat, lon and h must be of one length, got "
                f"{len(t)}, {len(lat)}, {len(lon)} and {len(h)}"
            )
        if len(t) < _DEGREE + 1:
            raise ValueError(
                f"a quintic spline needs {_DEGREE + 1} waypoints, got {len(t)}; add points between "
                "them, or draw the path without times"
            )
        _check_times(t)
        check_latitudes(lat, "waypoint {}")
        lon = np.unwrap(lon)
        _check_kinks(t, lat, lon, h)
        self.start, self.end = float(t[0]), float(t[-1])
        self._origin = lat[0], lon[0], h[0]
        path = np.stack([lat, lon, h], axis=-1) - self._origin
        if q_nb is None:
            rate = make_interp_spline(t, path, k=_DEGREE)(t, nu=1)
            q_nb = along_path(velocity_n(lat, h, rate), _MOVING)
        q_nb = continuous_quaternions(q_nb, len(t), _SHARPEST, "waypoint")
        self._spline = make_interp_spline(t, np.concatenate([path, q_nb], axis=1), k=_DEGREE)
        self.knots = self._spline.t[_DEGREE + 1 : -_DEGREE - 1]
        between = np.sort(np.concatenate([t[:-1] + share * np.diff(t) for share in _SHARES]))
        values, slopes = self._spline(between), self._spline(between, nu=1)
        check_latitudes(lat[0] + values[:, 0], "the path")
        swing = np.linalg.norm(slopes[:, 3:], axis=1) / np.linalg.norm(values[:, 3:], axis=1)
        # the fastest that waypoints can tell, and what normalising the quaternion makes of it
        self.bandwidth = float(np.pi / np.diff(t).min() + 2.0 * swing.max())

    def at(self, t: Array) -> Kinematics:
        """Kinematics at times `t`, s, shape (n,)."""
        derivatives = [np.ascontiguousarray(self._spline(t, nu=nu).T) for nu in range(3)]
        lat, lon, h, *q = (Jet.of(*rows) for rows in zip(*derivatives, strict=True))
        lat0, lon0, h0 = self._origin
        return over_earth(t, lat0 + lat, lon0 + lon, h0 + h, _normalised(q))


def _normalised(q: list[Jet]) -> JetQuad:
    a, b, c, d = q
    per_length = 1.0 / np.sqrt(a * a + b * b + c * c + d * d)
    return a * per_length, b * per_length, c * per_length, d * per_length


def velocity_n(lat: Array, h: Array, rate: Array) -> Array:
    """Velocity north, east and up, m/s, of rows of the rates of latitude, longitude and height."""
    per_meridian, per_transverse = curvatures(WGS84.params, np.sin(lat), h)
    return np.stack(
        [rate[:, 0] / per_meridian, rate[:, 1] / per_transverse * np.cos(lat), rate[:, 2]], axis=-1
    )


def along_path(velocity: Array, moving: float) -> Array:
    """Attitudes that point along a velocity (north, east, up), without roll.

    Slower than `moving`, m/s, they are those of the nearest row that is not.

    Raises
    ------
    ValueError
        If none is.
    """
    north, east, up = velocity.T
    rows = np.flatnonzero(np.hypot(north, east) > moving)
    if not len(rows):
        raise ValueError(
            f"no waypoint moves faster than {moving:g} m/s, so that the path gives no heading; "
            "give attitudes"
        )
    k = np.arange(len(velocity))
    after = np.clip(np.searchsorted(rows, k), 0, len(rows) - 1)
    before = np.maximum(after - 1, 0)
    nearer = np.where(np.abs(rows[before] - k) <= np.abs(rows[after] - k), before, after)
    north, east, up = velocity[rows[nearer]].T
    return quat_from_euler(
        np.zeros(len(velocity)), np.arctan2(up, np.hypot(north, east)), np.arctan2(east, north)
    )


def continuous_quaternions(q: ArrayLike, n: int, sharpest: float, what: str) -> Array:
    """Unit quaternions whose signs do not jump from row to row.

    Raises
    ------
    ValueError
        On a wrong shape, a norm off by more than 1e-3, or a rotation of more than `sharpest`, rad,
        between neighbours, each of which is a `what`.
    """
    q = np.array(q, dtype=np.float64)
    if q.shape != (n, 4):
        raise ValueError(f"q_nb must have shape {(n, 4)}, got {q.shape}")
    norm = np.linalg.norm(q, axis=1)
    good = np.abs(norm - 1.0) < 1e-3
    if not good.all():
        k = int(np.argmin(good))
        raise ValueError(
            f"q_nb of {what} {k + 1} must be a unit quaternion, its norm is {norm[k]!r}"
        )
    q /= norm[:, None]
    together = np.sum(q[1:] * q[:-1], axis=1)
    angle = 2.0 * np.arccos(np.minimum(np.abs(together), 1.0))
    if (angle > sharpest).any():
        k = int(np.argmax(angle > sharpest))
        raise ValueError(
            f"from {what} {k + 1} to {k + 2} the body rotates by {angle[k] / DEG:.1f}°, more than "
            f"the {sharpest / DEG:.0f}° up to which the way round is clear; add points between them"
        )
    q[1:] *= np.cumprod(np.where(together < 0.0, -1.0, 1.0))[:, None]
    return q


def _column(name: str, values: ArrayLike) -> Array:
    column = np.array(values, dtype=np.float64)
    if column.ndim != 1:
        raise ValueError(f"{name} must have one dimension, got shape {column.shape}")
    good = np.isfinite(column)
    if not good.all():
        k = int(np.argmin(good))
        raise ValueError(f"{name} of waypoint {k + 1} must be finite, got {column[k]!r}")
    return column


def _check_times(t: Array) -> None:
    steps = np.diff(t)
    if (steps <= 0.0).any():
        k = int(np.argmax(steps <= 0.0))
        if steps[k] == 0.0:
            raise ValueError(f"waypoints {k + 1} and {k + 2} are both at {t[k]:g} s; drop one")
        raise ValueError(
            f"time goes back from {t[k]:g} s at waypoint {k + 1} to {t[k + 1]:g} s at waypoint "
            f"{k + 2}; sort them"
        )


def leg_directions(lat: Array, lon: Array, h: Array) -> tuple[Array, Array, Array]:
    """Length, m, and horizontal direction, rad, of straight legs, and the turns between them."""
    middle = 0.5 * (lat[1:] + lat[:-1])
    legs = np.diff(np.stack([lat, lon, h], axis=-1), axis=0)
    way = velocity_n(middle, 0.5 * (h[1:] + h[:-1]), legs)
    direction = np.arctan2(way[:, 1], way[:, 0])
    turn = np.abs((np.diff(direction) + np.pi) % (2.0 * np.pi) - np.pi)
    return np.linalg.norm(way, axis=1), direction, turn


def _check_kinks(t: Array, lat: Array, lon: Array, h: Array) -> None:
    length, _, turn = leg_directions(lat, lon, h)
    fast = length / np.diff(t) > _MOVING
    kink = (turn > _SHARPEST) & fast[1:] & fast[:-1]
    if kink.any():
        k = int(np.argmax(kink))
        raise ValueError(
            f"the path has a kink of {turn[k] / DEG:.0f}° at waypoint {k + 2}, {t[k + 1]:g} s; "
            "slow down there, add points that round it, or draw the path without times"
        )
