"""Vibration that moves the body itself: coning, sculling, shaking."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from earth.rotation import quat_product
from navgrade.simulate.jet import Jet
from navgrade.simulate.kinematics import JetQuad, JetTriple, Kinematics, attached
from navgrade.simulate.motion import Motion, Wrapper

Array = NDArray[np.float64]
Axis = Literal["x", "y", "z"]

_ZERO = Jet.constant(0.0)
_STILL = (_ZERO, _ZERO, _ZERO)
_UPRIGHT = (Jet.constant(1.0), _ZERO, _ZERO, _ZERO)


class Vibration(Protocol):
    """One vibration of a body."""

    @property
    def frequency(self) -> float:
        """Hz."""
        ...

    def at(self, t: Jet) -> tuple[JetTriple, JetQuad]:
        """Displacement, m, and rotation, in the axes of the body at rest."""
        ...


@dataclass(frozen=True)
class Coning:
    """A body axis that goes round a cone without spin about itself.

    ``q = Rz(w t + phase) Ry(half_angle) Rz(-w t - phase)`` for the z axis, the others alike: a
    rotation vector of constant length that goes round. The rate about the cone's axis is constant,
    -w (1 - cos(half_angle)).

    Parameters
    ----------
    half_angle : float
        rad.
    frequency : float
        Hz.
    axis : {"x", "y", "z"}
        Body axis on the cone.
    phase : float
        rad.
    """

    half_angle: float
    frequency: float
    axis: Axis = "z"
    phase: float = 0.0

    def __post_init__(self) -> None:
        _check(self, self.axis)

    def at(self, t: Jet) -> tuple[JetTriple, JetQuad]:
        """Displacement and rotation."""
        angle = _phase(self, t)
        sin = float(np.sin(0.5 * self.half_angle))
        vector = _along(self.axis, _ZERO, -sin * np.sin(angle), sin * np.cos(angle))
        return _STILL, (Jet.constant(float(np.cos(0.5 * self.half_angle))), *vector)


@dataclass(frozen=True)
class Sculling:
    """A rotation about one axis in step with an acceleration along another.

    ``angle sin(w t + phase)`` about `rotation_axis` and ``acceleration sin(w t + phase + lead)``
    along `force_axis`, in axes that do not rotate with it. In body axes the two rectify to a mean
    specific force of ``angle acceleration cos(lead) / 2``, for small angles.

    Parameters
    ----------
    angle : float
        rad.
    frequency : float
        Hz.
    acceleration, displacement : float
        Amplitude, m/s^2 or m; one of them.
    rotation_axis, force_axis : {"x", "y", "z"}
    lead : float
        Phase of the acceleration before the rotation, rad.
    phase : float
        rad.
    """

    angle: float
    frequency: float
    acceleration: float | None = None
    displacement: float | None = None
    rotation_axis: Axis = "x"
    force_axis: Axis = "y"
    lead: float = 0.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        _check(self, self.rotation_axis, self.force_axis)
        _amplitude(self)

    def at(self, t: Jet) -> tuple[JetTriple, JetQuad]:
        """Displacement and rotation."""
        angle = _phase(self, t)
        half = 0.5 * self.angle * np.sin(angle)
        turn = _along(self.rotation_axis, np.sin(half), _ZERO, _ZERO)
        moved = -_amplitude(self) * np.sin(angle + self.lead)
        return _along(self.force_axis, moved, _ZERO, _ZERO), (np.cos(half), *turn)


@dataclass(frozen=True)
class Shaking:
    """A sinusoidal displacement along one body axis.

    The acceleration is ``acceleration sin(w t + phase)``.

    Parameters
    ----------
    frequency : float
        Hz.
    acceleration, displacement : float
        Amplitude, m/s^2 or m; one of them.
    axis : {"x", "y", "z"}
    phase : float
        rad.
    """

    frequency: float
    acceleration: float | None = None
    displacement: float | None = None
    axis: Axis = "z"
    phase: float = 0.0

    def __post_init__(self) -> None:
        _check(self, self.axis)
        _amplitude(self)

    def at(self, t: Jet) -> tuple[JetTriple, JetQuad]:
        """Displacement and rotation."""
        moved = -_amplitude(self) * np.sin(_phase(self, t))
        return _along(self.axis, moved, _ZERO, _ZERO), _UPRIGHT


def _phase(vibration: Coning | Sculling | Shaking, t: Jet) -> Jet:
    return 2.0 * np.pi * vibration.frequency * t + vibration.phase


def _along(axis: Axis, first: Jet, second: Jet, third: Jet) -> JetTriple:
    """A vector from its component along `axis` and the two that follow it cyclically."""
    if axis == "x":
        return first, second, third
    if axis == "y":
        return third, first, second
    return second, third, first


def _check(vibration: Coning | Sculling | Shaking, *axes: str) -> None:
    for axis in axes:
        if axis not in ("x", "y", "z"):
            raise ValueError(f"the axis of a vibration must be x, y or z, got {axis!r}")
    for name, value in vars(vibration).items():
        if isinstance(value, float | int) and not np.isfinite(value):
            raise ValueError(f"{name} must be finite, got {value!r}")
    if not vibration.frequency > 0.0:
        raise ValueError(f"frequency must be positive, got {vibration.frequency!r} Hz")


def _amplitude(vibration: Sculling | Shaking) -> float:
    """Amplitude of the displacement, m, of one sign with the acceleration that opposes it."""
    acceleration, displacement = vibration.acceleration, vibration.displacement
    if (acceleration is None) == (displacement is None):
        raise ValueError("give one of acceleration and displacement")
    if displacement is not None:
        return displacement
    assert acceleration is not None
    return float(acceleration / (2.0 * np.pi * vibration.frequency) ** 2)


@dataclass(frozen=True, eq=False)
class Vibrating(Wrapper):
    """A motion with vibrations on top, from its start to its end.

    The body itself moves: its true position, velocity and attitude vibrate, not only what its
    sensors say. Displacements add up in the axes of the undisturbed body; rotations follow each
    other in the order given.

    Parameters
    ----------
    motion : Motion
    vibrations : sequence
        Of `Coning`, `Sculling`, `Shaking`.

    Notes
    -----
    The phase of a vibration is rounded to 1e-16 of itself: at 20 Hz after an hour to 5e-11 rad.
    Rates and forces then carry as much of its amplitude, which averages out.
    """

    motion: Motion
    vibrations: Sequence[Vibration]

    @property
    def bandwidth(self) -> float:
        """Angular frequency of the fastest part, rad/s."""
        fastest = max((v.frequency for v in self.vibrations), default=0.0)
        return self.motion.bandwidth + 2.0 * np.pi * fastest

    def at(self, t: Array) -> Kinematics:
        """Kinematics at times `t`, s, shape (n,)."""
        now = Jet.time(t)
        l_b, q_bs = _STILL, _UPRIGHT
        for vibration in self.vibrations:
            moved, turned = vibration.at(now)
            x, y, z = (a + b for a, b in zip(l_b, moved, strict=True))
            l_b, q_bs = (x, y, z), quat_product(q_bs, turned)
        return attached(self.motion.at(t), l_b, q_bs)
