"""Peer navigator run on the same inertial increments as the benchmarked library.

The peer is ``pyins`` (distribution ``python-ins``, MIT), used through its public interface, with
its own two-sample coning and sculling compensation, as its users run it.

Which gravity can be used
-------------------------
``pyins`` computes gravity inside its compiled kernel: the Somigliana formula times
``1 - 2 h / a``, along the ellipsoid normal only. The kernel has no slot for a north component and
binds the function when it is compiled, so exact normal gravity cannot be given to it without
changing what is measured. Equal gravity in truth and navigator is therefore obtained on the side
of the truth: build the specific force with `pyins_gravity` (down component, north and east zero)
and run `run_pyins` with ``gravity="own"``. Its ellipsoid and Earth rate are those of WGS 84.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import TypeVar

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from pyins import earth, strapdown, transform, util

from tests.oracles.truth import Increments, State

Array = NDArray[np.float64]
T = TypeVar("T")

_WARM_UP_STEPS = 16


@dataclass(frozen=True)
class PeerResult:
    """Trajectory computed by the peer, one row per increment, and the time it took.

    Row ``k`` is the state at the end of interval ``k``; the initial state is not included.

    Attributes
    ----------
    lat, lon : (n,) array
        Geodetic latitude and longitude (rad). The longitude is not wrapped.
    h : (n,) array
        Ellipsoidal height (m).
    v_eb_n : (n, 3) array
        Earth-relative velocity, north, east, down (m/s).
    roll, pitch, heading : (n,) array
        Attitude (rad), ``C_nb = Rz(heading) Ry(pitch) Rx(roll)``; roll and heading in [-pi, pi].
    kernel_seconds : float
        Compiled integration loop alone, already compiled, best of the repeats.
    end_to_end_seconds : float
        Increment compensation, integrator set-up, integration and the output frame with Euler
        angles, through the public interface, best of the repeats. Building the input frame and
        the conversion of the output from degrees are not included.
    """

    lat: Array
    lon: Array
    h: Array
    v_eb_n: Array
    roll: Array
    pitch: Array
    heading: Array
    kernel_seconds: float
    end_to_end_seconds: float


def pyins_gravity(lat: ArrayLike, h: ArrayLike) -> Array:
    """Gravity magnitude of the peer's own model, directed along +down.

    Parameters
    ----------
    lat : array_like
        Geodetic latitude (rad).
    h : array_like
        Ellipsoidal height (m).

    Returns
    -------
    array
        Gravity (m/s^2), of the broadcast shape of the arguments.
    """
    return np.asarray(earth.gravity(np.rad2deg(lat), np.asarray(h, dtype=float)), dtype=float)


def run_pyins(
    dt: ArrayLike,
    dtheta: ArrayLike,
    dvel: ArrayLike,
    lat0: float,
    lon0: float,
    h0: float,
    v0_n: ArrayLike,
    roll0: float,
    pitch0: float,
    heading0: float,
    gravity: str = "own",
    *,
    before: tuple[ArrayLike, ArrayLike] | None = None,
    repeats: int = 3,
) -> PeerResult:
    """Navigate raw body increments with the peer.

    Parameters
    ----------
    dt : (n,) array_like
        Interval lengths (s). The peer's compensation assumes neighbours of equal length.
    dtheta, dvel : (n, 3) array_like
        Integrals of the inertial rate (rad) and specific force (m/s) over each interval, in body
        forward-right-down axes, without coning, sculling or rotation compensation.
    lat0, lon0 : float
        Initial geodetic latitude and longitude (rad).
    h0 : float
        Initial ellipsoidal height (m).
    v0_n : (3,) array_like
        Initial Earth-relative velocity, north, east, down (m/s).
    roll0, pitch0, heading0 : float
        Initial attitude (rad).
    gravity : {"own", "normal"}
        Only the peer's "own" model is possible; "normal" raises (see the module's notes).
    before : tuple of two (3,) array_like, optional
        ``(dtheta, dvel)`` of the interval that precedes the first one, of length ``dt[0]``, which
        the peer uses to compensate the first increment. By default the first increment is
        repeated, so that the first one gets no coning and no sculling term.
    repeats : int
        Number of timed runs of each kind.

    Returns
    -------
    PeerResult
        States after each increment and timings.
    """
    if gravity == "normal":
        raise NotImplementedError(
            "pyins has no exact normal gravity; build the truth with pyins_gravity instead"
        )
    if gravity != "own":
        raise ValueError(f"gravity must be 'own' or 'normal', got {gravity!r}")
    if repeats < 1:
        raise ValueError("repeats must be at least 1")

    imu = _imu_frame(dt, dtheta, dvel, before)
    pva = pd.Series(
        np.concatenate(
            [
                np.rad2deg([lat0, lon0]),
                [h0],
                np.asarray(v0_n, dtype=float),
                np.rad2deg([roll0, pitch0, heading0]),
            ]
        ),
        index=util.TRAJECTORY_COLS,
        name=0.0,
    )

    def navigate(readings: pd.DataFrame) -> pd.DataFrame:
        increments = strapdown.compute_increments_from_imu(readings, "increment")
        return strapdown.Integrator(pva).integrate(increments)

    with warnings.catch_warnings():
        # A keyword the peer passes to pandas is deprecated since pandas 3.
        warnings.filterwarnings("ignore", message="The copy keyword is deprecated")
        navigate(imu.iloc[: _WARM_UP_STEPS + 1])
        end_to_end_seconds, trajectory = _best_time(lambda: navigate(imu), repeats)
    increments = strapdown.compute_increments_from_imu(imu, "increment")
    kernel_seconds = _time_kernel(increments, pva, repeats)

    states = trajectory.iloc[1:]
    lat, lon = np.deg2rad(states[["lat", "lon"]].to_numpy()).T
    roll, pitch, heading = np.deg2rad(states[util.RPH_COLS].to_numpy()).T
    return PeerResult(
        lat=lat,
        lon=lon,
        h=states["alt"].to_numpy(),
        v_eb_n=states[util.VEL_COLS].to_numpy(),
        roll=roll,
        pitch=pitch,
        heading=heading,
        kernel_seconds=kernel_seconds,
        end_to_end_seconds=end_to_end_seconds,
    )


def _imu_frame(
    dt: ArrayLike,
    dtheta: ArrayLike,
    dvel: ArrayLike,
    before: tuple[ArrayLike, ArrayLike] | None,
) -> pd.DataFrame:
    """Lay out increments as the peer expects them: time index, one reading before the first."""
    dt = np.asarray(dt, dtype=float)
    dtheta = np.asarray(dtheta, dtype=float)
    dvel = np.asarray(dvel, dtype=float)
    n = len(dt)
    if n == 0 or dt.shape != (n,) or dtheta.shape != (n, 3) or dvel.shape != (n, 3):
        raise ValueError("expected dt (n,), dtheta (n, 3) and dvel (n, 3) with n > 0")
    first = (dtheta[0], dvel[0]) if before is None else before
    data = np.empty((n + 1, 6))
    data[0, :3], data[0, 3:] = first
    data[1:, :3] = dtheta
    data[1:, 3:] = dvel
    # The peer recovers dt by differencing, so the sum is kept free of accumulated rounding.
    time = np.concatenate([[0.0], np.cumsum(dt, dtype=np.longdouble).astype(float)])
    return pd.DataFrame(
        data, index=pd.Index(time, name="time"), columns=util.GYRO_COLS + util.ACCEL_COLS
    )


def _time_kernel(increments: pd.DataFrame, pva: pd.Series, repeats: int) -> float:
    """Time the peer's compiled loop alone, every state being stored."""
    n = len(increments)
    dt = np.ascontiguousarray(increments["dt"])
    theta = np.ascontiguousarray(increments[util.THETA_COLS])
    dv = np.ascontiguousarray(increments[util.DV_COLS])
    # Zeros are written at once, so that no run pays for the first touch of the memory.
    lla = np.full((n + 1, 3), 0.0)
    velocity_n = np.full((n + 1, 3), 0.0)
    mat_nb = np.full((n + 1, 3, 3), 0.0)
    lla[0] = pva[util.LLA_COLS]
    velocity_n[0] = pva[util.VEL_COLS]
    mat_nb[0] = transform.mat_from_rph(pva[util.RPH_COLS])

    def kernel(steps: int) -> None:
        strapdown.integrate(dt[:steps], lla, velocity_n, mat_nb, theta[:steps], dv[:steps], 0, True)

    kernel(min(n, _WARM_UP_STEPS))
    return _best_time(lambda: kernel(n), repeats)[0]


def _best_time(call: Callable[[], T], repeats: int) -> tuple[float, T]:
    """Return the shortest duration of the repeated call and its last value."""
    durations = []
    for _ in range(repeats):
        start = perf_counter()
        value = call()
        durations.append(perf_counter() - start)
    return min(durations), value


def run_pyins_from(
    exact: Increments,
    start: State,
    *,
    before: tuple[ArrayLike, ArrayLike] | None = None,
    repeats: int = 3,
) -> PeerResult:
    """Run the peer on oracle increments from a true state (its first row)."""
    return run_pyins(
        exact.dt,
        exact.dtheta,
        exact.dvel,
        start.lat[0],
        start.lon[0],
        start.h[0],
        start.v_eb_n[0],
        start.roll[0],
        start.pitch[0],
        start.heading[0],
        before=before,
        repeats=repeats,
    )
