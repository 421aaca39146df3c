"""The navigation state and its history."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from earth.rotation import euler_from_quat


@dataclass(frozen=True, eq=False)
class NavState:
    """Position, velocity and attitude at one instant.

    Parameters
    ----------
    lat, lon : float
        Geodetic latitude and longitude, rad.
    h : float
        Height above the ellipsoid, m.
    v_eb_n : array_like, shape (3,)
        Velocity over the Earth in NED, m/s.
    q_nb : array_like, shape (4,)
        Attitude, body (forward-right-down) to NED, scalar first; normalised here.
    t : float
        s since the epoch of the samples.

    Raises
    ------
    ValueError
        On a value that is not finite or out of range, or a quaternion whose norm is off by more
        than 1e-6.
    """

    lat: float
    lon: float
    h: float
    v_eb_n: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    q_nb: NDArray[np.float64] = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    t: float = 0.0

    def __post_init__(self) -> None:
        for name in ("lat", "lon", "h", "t"):
            value = float(getattr(self, name))
            if not np.isfinite(value):
                raise ValueError(f"{name} must be finite, got {value!r}")
            object.__setattr__(self, name, value)
        if abs(self.lat) > np.pi / 2:
            raise ValueError(
                f"lat must be within ±pi/2 rad, got {self.lat!r}; degrees are not radians"
            )
        if abs(self.lon) > 2 * np.pi:
            raise ValueError(
                f"lon must be within ±2 pi rad, got {self.lon!r}; degrees are not radians"
            )
        object.__setattr__(self, "v_eb_n", _vector("v_eb_n", self.v_eb_n, 3))
        q = _vector("q_nb", self.q_nb, 4)
        norm = float(np.linalg.norm(q))
        if abs(norm - 1.0) > 1e-6:
            raise ValueError(f"q_nb must be a unit quaternion, its norm is {norm!r}")
        q = q / norm
        q.setflags(write=False)
        object.__setattr__(self, "q_nb", q)


def _vector(name: str, values: ArrayLike, size: int) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    if array.shape != (size,) or not np.all(np.isfinite(array)):
        raise ValueError(f"{name} must be {size} finite numbers, got {values!r}")
    array.setflags(write=False)
    return array


class Columns(NamedTuple):
    """Room for a solution's rows, to be filled in place."""

    lat: NDArray[np.float64]
    lon: NDArray[np.float64]
    h: NDArray[np.float64]
    v_eb_n: NDArray[np.float64]
    q_nb: NDArray[np.float64]

    @classmethod
    def empty(cls, n: int) -> Columns:
        """Room for `n` rows."""
        return cls(np.empty(n), np.empty(n), np.empty(n), np.empty((n, 3)), np.empty((n, 4)))

    def rows(self, start: int, stop: int) -> Columns:
        """The room of some rows, shared."""
        return Columns(*(column[start:stop] for column in self))


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A navigation solution: one row per integrated sample, whatever frame computed it.

    Attributes
    ----------
    t : ndarray, shape (n,)
        s since the epoch; the end of each sample's interval.
    lat, lon, h : ndarray, shape (n,)
        Geodetic latitude and longitude (rad), height above the ellipsoid (m). Longitude stays
        within ±pi.
    v_eb_n : ndarray, shape (n, 3)
        Velocity over the Earth in NED, m/s.
    q_nb : ndarray, shape (n, 4)
        Attitude, body (forward-right-down) to NED, scalar first.
    status : ndarray of uint32, shape (n,)
        `navgrade.Status` bits.
    epoch_ns : int
        Unix time of ``t = 0``, ns.
    """

    t: NDArray[np.float64]
    lat: NDArray[np.float64]
    lon: NDArray[np.float64]
    h: NDArray[np.float64]
    v_eb_n: NDArray[np.float64]
    q_nb: NDArray[np.float64]
    status: NDArray[np.uint32]
    epoch_ns: int = 0

    def __post_init__(self) -> None:
        n = np.size(self.t)
        widths = {"lat": (), "lon": (), "h": (), "v_eb_n": (3,), "q_nb": (4,)}
        for name, width in {"t": (), **widths}.items():
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != (n, *width):
                raise ValueError(f"{name} must have shape {(n, *width)}, got {array.shape}")
            good = np.isfinite(array).reshape(n, -1).all(axis=1)
            if not good.all():
                raise ValueError(f"{name} is not finite at index {int(np.argmin(good))}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        status = np.array(self.status, dtype=np.uint32)
        if status.shape != (n,):
            raise ValueError(f"status must have shape {(n,)}, got {status.shape}")
        status.setflags(write=False)
        object.__setattr__(self, "status", status)
        later = np.diff(self.t) > 0.0
        if not later.all():
            raise ValueError(f"t must increase, it does not at index {int(np.argmin(later)) + 1}")

    @classmethod
    def made(
        cls,
        t: NDArray[np.float64],
        columns: Columns,
        status: NDArray[np.uint32],
        epoch_ns: int,
    ) -> Trajectory:
        """Wrap what the engine just computed, without checking or copying it."""
        self = object.__new__(cls)
        arrays = {"t": t, **columns._asdict(), "status": status}
        for name, array in arrays.items():
            view = array.view()
            view.setflags(write=False)
            object.__setattr__(self, name, view)
        object.__setattr__(self, "epoch_ns", epoch_ns)
        return self

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, rows: slice) -> Trajectory:
        columns = Columns(self.lat, self.lon, self.h, self.v_eb_n, self.q_nb)
        return Trajectory.made(
            self.t[rows],
            Columns(*(column[rows] for column in columns)),
            self.status[rows],
            self.epoch_ns,
        )

    @property
    def euler(self) -> NDArray[np.float64]:
        """Roll, pitch and heading, rad, shape (n, 3); see `earth.euler_from_quat`."""
        return euler_from_quat(self.q_nb)

    def state(self, index: int) -> NavState:
        """Return the state after sample `index`, ready to start another run."""
        return NavState(
            lat=self.lat[index],
            lon=self.lon[index],
            h=self.h[index],
            v_eb_n=self.v_eb_n[index],
            q_nb=self.q_nb[index],
            t=self.t[index],
        )
