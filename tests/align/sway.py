"""What a perfect IMU feels on a base that sways about a fixed place: truth of the tests.

Attitude and path are sums of closed forms, increments follow from them by SciPy's rotations: no
formula of the package is used, none is integrated numerically.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from tests.oracles.constants import OMEGA
from tests.oracles.gravity import normal_gravity_zonal

Array = NDArray[np.float64]
DEG = np.pi / 180.0


@dataclass(frozen=True)
class Waves:
    """Three sinusoids, ``amplitude sin(2 pi t / period + phase)``."""

    amplitude: ArrayLike = (0.0, 0.0, 0.0)
    period: ArrayLike = (8.1, 9.3, 10.7)  # s
    phase: ArrayLike = (0.0, 0.0, 0.0)

    def at(self, t: Array) -> Array:
        turns = 2.0 * np.pi / np.asarray(self.period)
        return np.asarray(self.amplitude) * np.sin(turns * t[:, None] + self.phase)

    def slope(self, t: Array) -> Array:
        turns = 2.0 * np.pi / np.asarray(self.period)
        return np.asarray(self.amplitude) * turns * np.cos(turns * t[:, None] + self.phase)


@dataclass(frozen=True)
class Felt:
    """Body increments of an IMU, as `InertialFrame.add` takes them, and the attitude at the end."""

    dt: Array
    phi: Array
    dv: Array
    attitude: Rotation

    @property
    def samples(self) -> tuple[Array, Array, Array]:
        return self.dt, self.phi, self.dv

    def noisy(self, rng: np.random.Generator, arw: float, vrw: float) -> "Felt":
        """With white noise of the given random walks, rad/sqrt(s) and (m/s)/sqrt(s)."""
        root = np.sqrt(self.dt)[:, None]
        return replace(
            self,
            phi=self.phi + arw * root * rng.standard_normal(self.phi.shape),
            dv=self.dv + vrw * root * rng.standard_normal(self.dv.shape),
        )

    def plus(self, *, gyro: ArrayLike = 0.0, accel: ArrayLike = 0.0) -> "Felt":
        """With constant errors in body axes, rad/s and m/s^2."""
        dt = self.dt[:, None]
        return replace(
            self, phi=self.phi + dt * np.asarray(gyro), dv=self.dv + dt * np.asarray(accel)
        )


@dataclass(frozen=True)
class Sway:
    """A base at a berth.

    `euler` is the mean roll, pitch, heading, rad; `turn` swings them; `path` moves the IMU, m
    north, east, down, and `leaves` accelerates it away, m/s^2, from half the window on.
    """

    lat: float
    h: float = 0.0
    euler: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: Waves = field(default=Waves())
    path: Waves = field(default=Waves())
    leaves: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def attitude(self, t: Array) -> Rotation:
        """Of b relative to n."""
        roll, pitch, heading = (np.asarray(self.euler) + self.turn.at(t)).T
        return Rotation.from_euler("ZYX", np.stack([heading, pitch, roll], axis=-1))

    def feel(self, edges: Array) -> Felt:
        """Increments between instants, s: exact but for gravity's change along the path.

        In axes that stay as n was at time 0, with C = C_n0n and p the path, the specific force
        C (p'' + 2 w x p' - g) has the integral C p' + w x (C p) - integral of C g; what w x w x p
        adds is below 1e-8 m/s^2 a metre.
        """
        rate = OMEGA * np.array([np.cos(self.lat), 0.0, -np.sin(self.lat)])
        to_n0 = Rotation.from_rotvec(edges[:, None] * rate)
        gravity = normal_gravity_zonal(self.lat, self.h)
        g = np.array([float(gravity.north), 0.0, float(gravity.down)])
        late = np.maximum(edges - 0.5 * edges[-1], 0.0)[:, None] * np.asarray(self.leaves)
        gained = to_n0.apply(self.path.slope(edges) + late)
        gained += np.cross(rate, to_n0.apply(self.path.at(edges)))
        # Gravity along the Earth's axis stays, across it it circles.
        axis = rate / OMEGA
        dt = np.diff(edges)
        middle = Rotation.from_rotvec((0.5 * (edges[1:] + edges[:-1]))[:, None] * rate)
        along = axis * (axis @ g)
        chord = np.sinc(0.5 * OMEGA * dt / np.pi)[:, None]
        weight = dt[:, None] * (along + chord * middle.apply(g - along))
        to_i = to_n0 * self.attitude(edges)
        return Felt(
            dt=dt,
            phi=(to_i[:-1].inv() * to_i[1:]).as_rotvec(),
            dv=to_i[:-1].inv().apply(np.diff(gained, axis=0) - weight),
            attitude=self.attitude(edges[-1:])[0],
        )


def edges(duration: float, rate: float) -> Array:
    """Instants of a window, s."""
    return np.arange(round(duration * rate) + 1) / rate
