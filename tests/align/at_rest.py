"""What a perfect IMU at rest feels, and windows of it: truth of the alignment tests.

Gravity comes from the zonal-harmonic oracle, attitudes from SciPy.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from tests.oracles.constants import OMEGA
from tests.oracles.gravity import normal_gravity_zonal

Array = NDArray[np.float64]
DEG = np.pi / 180.0
DEG_H = DEG / 3600.0  # rad/s
UG = 9.80665e-6  # m/s^2
HALF = 0.5 * np.pi


def rotation(roll: float, pitch: float, heading: float) -> Rotation:
    """Attitude that carries body vectors to north-east-down."""
    return Rotation.from_euler("ZYX", [heading, pitch, roll])


@dataclass(frozen=True)
class Window:
    """Samples of an IMU, as `align_static` takes them, and where it stands."""

    dt: Array
    omega_ib_b: Array
    f_ib_b: Array
    lat: float
    h: float
    attitude: Rotation

    @property
    def samples(self) -> tuple[Array, Array, Array, float, float]:
        return self.dt, self.omega_ib_b, self.f_ib_b, self.lat, self.h

    @property
    def g(self) -> float:
        truth = normal_gravity_zonal(self.lat, self.h)
        return float(np.hypot(truth.north, truth.down))

    def plus(self, *, gyro: ArrayLike = 0.0, accel: ArrayLike = 0.0) -> "Window":
        """The window with errors or motion added, in body axes: rad/s and m/s^2."""
        return replace(
            self,
            omega_ib_b=self.omega_ib_b + np.asarray(gyro),
            f_ib_b=self.f_ib_b + np.asarray(accel),
        )

    def plus_n(self, *, gyro: ArrayLike = (0, 0, 0), accel: ArrayLike = (0, 0, 0)) -> "Window":
        """The window with constant errors given in north, east, down."""
        to_body = self.attitude.inv()
        return self.plus(
            gyro=to_body.apply(np.asarray(gyro, float)),
            accel=to_body.apply(np.asarray(accel, float)),
        )

    def noisy(self, rng: np.random.Generator, arw: float, vrw: float) -> "Window":
        """The window with white noise of the given random walks, rad/sqrt(s) and (m/s)/sqrt(s)."""
        per_sample = 1.0 / np.sqrt(self.dt[:, None])
        return self.plus(
            gyro=arw * per_sample * rng.normal(size=self.omega_ib_b.shape),
            accel=vrw * per_sample * rng.normal(size=self.f_ib_b.shape),
        )


def still(
    lat_deg: float,
    attitude: Rotation,
    *,
    h: float = 0.0,
    count: int = 40,
    dt: float | Array = 0.5,
) -> Window:
    """A window of a body at rest; on the ellipsoid the plumb line is its normal."""
    lat = lat_deg * DEG
    gravity = normal_gravity_zonal(lat, h)
    g_n = np.array([float(gravity.north), 0.0, float(gravity.down)])
    omega_n = OMEGA * np.array([np.cos(lat), 0.0, -np.sin(lat)])
    to_body = attitude.inv()
    return Window(
        dt=np.broadcast_to(dt, count).astype(float),
        omega_ib_b=np.tile(to_body.apply(omega_n), (count, 1)),
        f_ib_b=np.tile(to_body.apply(-g_n), (count, 1)),
        lat=lat,
        h=h,
        attitude=attitude,
    )


def error_n(q_nb: ArrayLike, truth: Rotation) -> Array:
    """Small rotation of the estimate relative to the truth, C_hat C^T, about NED, rad."""
    found = Rotation.from_quat(np.asarray(q_nb), scalar_first=True)
    return (found * truth.inv()).as_rotvec()


def attitudes() -> list[tuple[float, float, float]]:
    """200 attitudes: roll, pitch, heading, rad; upside down and around pitch ±90° among them."""
    rng = np.random.default_rng(50)
    steep = [
        sign * (HALF - short)
        for sign in (1.0, -1.0)
        for short in (0.0, 1e-9, 1e-8, 1e-6, 1e-5, 1e-4, 1e-3)
    ]
    special = [
        (0.0, 0.0, 0.0),
        (np.pi, 0.0, 0.0),
        (np.pi, 0.3, -2.0),
        (-3.0, -0.2, np.pi),
        (HALF, 0.0, HALF),
        (-HALF, 0.1, -HALF),
        (1e-9, -1e-9, 1e-9),
    ]
    special += [(0.4, pitch, 1.0) for pitch in steep] + [(-2.5, pitch, 3.0) for pitch in steep]
    count = 200 - len(special)
    free = zip(
        rng.uniform(-np.pi, np.pi, count),
        np.arcsin(rng.uniform(-1.0, 1.0, count)),
        rng.uniform(-np.pi, np.pi, count),
        strict=True,
    )
    return special + [(float(r), float(p), float(y)) for r, p, y in free]
