"""Solutions and truth at common times, and the difference of two."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from earth.ellipsoid import WGS84
from earth.frames import C_en
from earth.geodetic import ecef_from_geodetic, radii
from earth.rotation import quat_from_dcm, quat_from_rotvec, quat_product, rotvec_from_quat
from navgrade.errors import NumericalError
from navgrade.state import NavState, Trajectory

Array = NDArray[np.float64]

_COINCIDE = 1e-6  # s: stamps of one instant, written by two clocks


class States(NamedTuple):
    """States at some times; NaN where there is none."""

    lat: Array
    lon: Array
    h: Array
    v_eb_n: Array
    q_nb: Array

    @classmethod
    def nowhere(cls, n: int) -> States:
        """No states at `n` times."""
        return cls(*(np.full((n, *width), np.nan) for width in ((), (), (), (3,), (4,))))

    def put(self, rows: NDArray[np.intp], other: States) -> None:
        """Replace some rows."""
        for own, given in zip(self, other, strict=True):
            own[rows] = given

    def rows(self, rows: slice | NDArray[np.intp]) -> States:
        """Some rows."""
        return States(*(column[rows] for column in self))

    def then(self, later: States) -> States:
        """These rows and those of `later`."""
        return States(*map(np.concatenate, zip(self, later, strict=True)))


def states_of(nav: Trajectory) -> States:
    """The states of a solution."""
    return States(nav.lat, nav.lon, nav.h, nav.v_eb_n, nav.q_nb)


def _between(first: States, last: States, dt: Array, share: Array) -> States:
    """States a share of the way from one row to the next, `dt` s later.

    Position by the cubic through both positions and velocities, in metres north, east, down; its
    error is a sixteenth of the difference of the accelerations times dt^2 at most.
    """
    meridian, transverse = radii(WGS84.params, np.sin(first.lat))
    scale = np.stack(
        [meridian + first.h, (transverse + first.h) * np.cos(first.lat), -1.0 + 0 * dt]
    )
    turn = last.lon - first.lon
    turn -= 2.0 * np.pi * np.rint(turn / (2.0 * np.pi))
    moved = scale * np.stack([last.lat - first.lat, turn, last.h - first.h])
    s, v0, v1 = share, first.v_eb_n.T, last.v_eb_n.T
    r = s * s * (3.0 - 2.0 * s) * moved + s * (1.0 - s) * dt * ((1.0 - s) * v0 - s * v1)
    lat, lon, h = np.stack([first.lat, first.lon, first.h]) + r / scale
    v = v0 + s * (v1 - v0)
    q0, q1 = first.q_nb.T, last.q_nb.T
    between = np.stack(quat_product((q0[0], -q0[1], -q0[2], -q0[3]), tuple(q1)), axis=-1)
    part = quat_from_rotvec(rotvec_from_quat(between) * s[:, None])
    return States(lat, lon, h, v.T, np.stack(quat_product(tuple(q0), tuple(part.T)), axis=-1))


def at_times(pieces: Iterable[Trajectory], start: NavState, t: Array) -> tuple[States, str | None]:
    """Take a solution at increasing times `t`, from `start.t` on, while it is made.

    Returns
    -------
    States, str or None
        NaN from where the solution ended; and why it ended early.
    """
    out = States.nowhere(len(t))
    known_t, known = (
        np.array([start.t]),
        States(*(np.array([x]) for x in (start.lat, start.lon, start.h, start.v_eb_n, start.q_nb))),
    )
    done = int(np.searchsorted(t, start.t + _COINCIDE))
    out.put(np.arange(done), known.rows(np.zeros(done, np.intp)))
    try:
        for piece in pieces:
            known_t = np.concatenate([known_t, piece.t])
            known = known.then(states_of(piece))
            stop = int(np.searchsorted(t, known_t[-1] + _COINCIDE, side="right"))
            rows = np.arange(done, stop)
            out.put(rows, _interpolated(known_t, known, t[rows]))
            done = stop
            known_t, known = known_t[-1:], known.rows(slice(-1, None))
            if done == len(t):
                break
    except NumericalError as error:
        return out, str(error)
    return out, None


def _interpolated(known_t: Array, known: States, t: Array) -> States:
    last = np.minimum(np.searchsorted(known_t, t - _COINCIDE), len(known_t) - 1)
    found = known.rows(last)
    apart = np.flatnonzero(np.abs(known_t[last] - t) > _COINCIDE)
    if apart.size:
        k = last[apart]
        dt = known_t[k] - known_t[k - 1]
        share = (t[apart] - known_t[k - 1]) / dt
        found.put(apart, _between(known.rows(k - 1), known.rows(k), dt, share))
    return found


class Difference(NamedTuple):
    """Estimate minus reference in north, east, down at the reference."""

    position: Array  # (n, 3), m
    velocity: Array  # (n, 3), m/s
    attitude: Array  # (n, 3), rad: phi_n


def difference(estimate: States, reference: States) -> Difference:
    """How far an estimate is from a reference, exact at any distance.

    Positions are subtracted in the Earth-fixed frame, whose rounding is 1e-9 m; velocities and
    attitudes are turned there, too, for north differs from place to place.
    """
    to_e, to_n = C_en(estimate.lat, estimate.lon), C_en(reference.lat, reference.lon).mT
    turn = to_n @ to_e  # from north, east, down at the estimate to those at the reference
    apart = _ecef(estimate) - _ecef(reference)
    v = (turn @ estimate.v_eb_n[..., None])[..., 0] - reference.v_eb_n
    known = np.isfinite(estimate.q_nb).all(axis=1) & np.isfinite(reference.q_nb).all(axis=1)
    w, x, y, z = reference.q_nb[known].T
    q_hat = quat_product(tuple(quat_from_dcm(turn[known]).T), tuple(estimate.q_nb[known].T))
    phi = np.full(v.shape, np.nan)
    phi[known] = -rotvec_from_quat(np.stack(quat_product(q_hat, (w, -x, -y, -z)), axis=-1))
    return Difference((to_n @ apart[..., None])[..., 0], v, phi)


def _ecef(states: States) -> Array:
    return np.stack(ecef_from_geodetic(WGS84.params, states.lat, states.lon, states.h), axis=-1)


def in_plane(states: States, lat: float, lon: float, h: float) -> Array:
    """East, north, up in the plane tangent to the ellipsoid at a place, m, shape (n, 3)."""
    origin = np.stack(ecef_from_geodetic(WGS84.params, lat, lon, h), axis=-1)
    north, east, down = C_en(lat, lon).T @ (_ecef(states) - origin).T
    return np.stack([east, north, -down], axis=-1)
