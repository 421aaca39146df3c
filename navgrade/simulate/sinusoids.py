"""Motion in closed form: constant rates and sums of sinusoids."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from earth.ellipsoid import WGS84
from earth.geodetic import curvatures
from earth.rotation import euler_to_quat
from navgrade.simulate.jet import Jet
from navgrade.simulate.kinematics import Kinematics, over_earth
from navgrade.simulate.motion import check_latitudes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sinusoid:
    """``amplitude sin(2 pi frequency t + phase)``; frequency in Hz, phase in rad."""

    amplitude: float
    frequency: float
    phase: float = 0.0

    def __post_init__(self) -> None:
        if not np.all(np.isfinite([self.amplitude, self.frequency, self.phase])):
            raise ValueError(f"a sinusoid needs finite numbers, got {self}")
        if not self.frequency > 0.0:
            raise ValueError(f"frequency must be positive, got {self.frequency!r} Hz")


@dataclass(frozen=True)
class Oscillation:
    """``value + rate t + sinusoids``."""

    value: float = 0.0
    rate: float = 0.0
    sinusoids: tuple[Sinusoid, ...] = ()

    def __post_init__(self) -> None:
        if not np.all(np.isfinite([self.value, self.rate])):
            raise ValueError(f"an oscillation needs finite numbers, got {self}")

    def at(self, t: Jet) -> Jet:
        """The oscillation at a time."""
        total = self.value + self.rate * t
        for s in self.sinusoids:
            total = total + s.amplitude * np.sin(2.0 * np.pi * s.frequency * t + s.phase)
        return total

    @property
    def swing(self) -> float:
        """Sum of the amplitudes."""
        return sum(abs(s.amplitude) for s in self.sinusoids)

    @property
    def fastest(self) -> float:
        """Angular frequency of the fastest sinusoid, rad/s."""
        return max((2.0 * np.pi * s.frequency for s in self.sinusoids), default=0.0)


@dataclass(frozen=True)
class Sinusoids:
    """A motion whose coordinates and Euler angles are oscillations, known exactly at any time.

    Parameters
    ----------
    lat, lon, h : float
        Reference point: rad, rad, m above the ellipsoid.
    duration : float
        s; the motion starts at 0.
    north, east, up : Oscillation
        Away from the reference, m. Metres are mapped to latitude and longitude by the radii of
        curvature of the reference: far from it they are no longer metres over ground.
    roll, pitch, heading : Oscillation
        rad.

    Raises
    ------
    ValueError
        On a number out of range, or beyond latitude ±89°.
    """

    lat: float
    lon: float
    h: float
    duration: float
    north: Oscillation = field(default=Oscillation())
    east: Oscillation = field(default=Oscillation())
    up: Oscillation = field(default=Oscillation())
    roll: Oscillation = field(default=Oscillation())
    pitch: Oscillation = field(default=Oscillation())
    heading: Oscillation = field(default=Oscillation())

    def __post_init__(self) -> None:
        for name in ("lat", "lon", "h"):
            if not np.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite, got {getattr(self, name)!r}")
        if not (np.isfinite(self.duration) and self.duration > 0.0):
            raise ValueError(f"duration must be positive, got {self.duration!r} s")
        check_latitudes(np.array([self.lat]), "the reference point")
        ends = self.north.value + self.north.rate * np.array([0.0, self.duration])
        reach = np.array([ends.min() - self.north.swing, ends.max() + self.north.swing])
        check_latitudes(self.lat + reach * self._per_metre()[0], "the path")

    def _per_metre(self) -> tuple[float, float]:
        """Latitude and longitude of a metre, rad."""
        per_meridian, per_transverse = curvatures(WGS84.params, np.sin(self.lat), self.h)
        return float(per_meridian), float(per_transverse / np.cos(self.lat))

    @property
    def start(self) -> float:
        """Start, s."""
        return 0.0

    @property
    def end(self) -> float:
        """End, s."""
        return self.duration

    @property
    def knots(self) -> Array:
        """None: the motion is analytic throughout."""
        return np.empty(0)

    @property
    def bandwidth(self) -> float:
        """Angular frequency of the fastest part, rad/s; wide swings of an angle have overtones."""
        angles = self.roll, self.pitch, self.heading
        path = max(x.fastest for x in (self.north, self.east, self.up))
        return max(path, *(x.fastest * (1.0 + x.swing) for x in angles)) + sum(
            abs(x.rate) for x in angles
        )

    def at(self, t: Array) -> Kinematics:
        """Kinematics at times `t`, s, shape (n,)."""
        now = Jet.time(t)
        per_north, per_east = self._per_metre()
        euler = self.roll.at(now), self.pitch.at(now), self.heading.at(now)
        return over_earth(
            t,
            self.lat + per_north * self.north.at(now),
            self.lon + per_east * self.east.at(now),
            self.h + self.up.at(now),
            euler_to_quat(euler),
        )
