"""What a motion is, and a sensor mounted on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from earth.units import DEG
from navgrade.simulate.jet import Jet
from navgrade.simulate.kinematics import Kinematics, attached

Array = NDArray[np.float64]

MAX_LAT = 89.0 * DEG  # rad: nearer to a pole, north turns too fast to describe a path by


class Motion(Protocol):
    """A motion over the Earth, exact at any time between its start and its end.

    Attributes
    ----------
    start, end : float
        s.
    knots : ndarray
        Times between them, increasing, where the motion is smooth but not analytic.
    bandwidth : float
        Angular frequency of its fastest part, rad/s: what decides how densely it is integrated.
    """

    @property
    def start(self) -> float: ...
    @property
    def end(self) -> float: ...
    @property
    def knots(self) -> Array: ...
    @property
    def bandwidth(self) -> float: ...

    def at(self, t: Array) -> Kinematics:
        """Kinematics at times `t`, s, shape (n,), in increasing order."""
        ...


class Wrapper:
    """A motion made of another one, with its times."""

    motion: Motion

    @property
    def start(self) -> float:
        """Start, s."""
        return self.motion.start

    @property
    def end(self) -> float:
        """End, s."""
        return self.motion.end

    @property
    def knots(self) -> Array:
        """Times where the motion is not analytic, s."""
        return self.motion.knots

    @property
    def bandwidth(self) -> float:
        """Angular frequency of the fastest part, rad/s."""
        return self.motion.bandwidth


@dataclass(frozen=True, eq=False)
class Mounted(Wrapper):
    """A point fixed to a body, such as a sensor on a vehicle.

    Parameters
    ----------
    motion : Motion
        Of the body.
    lever_arm_b : array_like, shape (3,)
        The point from the body's point, forward, right, down, m.
    q_bs : array_like, shape (4,)
        Mounting rotation, axes of the sensor to those of the body; normalised here.

    Raises
    ------
    ValueError
        On a wrong shape, a number that is not finite, or a quaternion that is far from unit.
    """

    motion: Motion
    lever_arm_b: ArrayLike = (0.0, 0.0, 0.0)
    q_bs: ArrayLike = (1.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name, size in (("lever_arm_b", 3), ("q_bs", 4)):
            values = np.array(getattr(self, name), dtype=np.float64)
            if values.shape != (size,) or not np.all(np.isfinite(values)):
                raise ValueError(
                    f"{name} must be {size} finite numbers, got {getattr(self, name)!r}"
                )
            object.__setattr__(self, name, values)
        norm = float(np.linalg.norm(self.q_bs))
        if abs(norm - 1.0) > 1e-6:
            raise ValueError(f"q_bs must be a unit quaternion, its norm is {norm!r}")
        object.__setattr__(self, "q_bs", np.asarray(self.q_bs) / norm)

    def at(self, t: Array) -> Kinematics:
        """Kinematics at times `t`, s, shape (n,)."""
        x, y, z = (Jet.constant(float(c)) for c in np.asarray(self.lever_arm_b))
        a, b, c, d = (Jet.constant(float(c)) for c in np.asarray(self.q_bs))
        return attached(self.motion.at(t), (x, y, z), (a, b, c, d))


def check_latitudes(lat: Array, what: str) -> None:
    """Raise ValueError where a path comes too near to a pole; `what` names row {} of `lat`."""
    beyond = np.abs(lat) > MAX_LAT
    if beyond.any():
        k = int(np.argmax(beyond))
        raise ValueError(
            f"{what.format(k + 1)} is at latitude {lat[k] / DEG:.4f}°, beyond ±89°; nearer to a "
            "pole latitude and longitude do not describe a path"
        )
