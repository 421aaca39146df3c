"""How navigation errors grow with time: closed forms, and power laws fitted to what was found.

A level navigator over the Earth turns its own level with the position it computes. That feedback
bounds horizontal errors in oscillations of the Schuler rate w = sqrt(g/R); a flat world has none.
With b an error of horizontal acceleration and eps of angular rate about a horizontal axis,

    over the Earth    (b/w^2) (1 - cos w t)    R eps (t - sin(w t)/w)
    flat world        b t^2 / 2                g eps t^3 / 6

(Titterton & Weston, Strapdown Inertial Navigation Technology, 2nd ed. (2004), section 12.3; Groves,
Principles of GNSS, Inertial and Multisensor Integrated Navigation Systems, 2nd ed. (2013), section
5.7). The vertical channel diverges with sqrt(R/2g) = 570 s. The forms leave out the daily and the
Foucault oscillation: within 4 % to one hour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from earth.ellipsoid import WGS84
from earth.geodetic import radii
from earth.gravity import normal_gravity_n

Array = NDArray[np.float64]

FLOOR = 1e-8  # m: smaller differences of positions are rounding
_FIT_FROM = 1.0  # s
_FIT_TO = 1200.0  # s: a quarter of the Schuler period, where bounded errors still grow


@dataclass(frozen=True)
class Level:
    """The closed forms of one place.

    Attributes
    ----------
    R : float
        Mean radius of curvature plus height, m.
    g : float
        Gravity, m/s^2.
    """

    R: float
    g: float

    @classmethod
    def at(cls, lat: float, h: float) -> Level:
        """At a latitude, rad, and a height, m."""
        meridian, transverse = radii(WGS84.params, np.sin(lat))
        gravity = normal_gravity_n(lat, h)
        return cls(float(np.sqrt(meridian * transverse)) + h, float(np.linalg.norm(gravity)))

    @property
    def schuler(self) -> float:
        """Schuler rate, rad/s."""
        return float(np.sqrt(self.g / self.R))

    def by_acceleration(self, b: Array | float, t: Array) -> Array:
        """Horizontal error, m, of an acceleration error, m/s^2."""
        return np.asarray(b * (1.0 - np.cos(self.schuler * t)) / self.schuler**2)

    def by_rate(self, eps: Array | float, t: Array) -> Array:
        """Horizontal error, m, of an angular rate error about a horizontal axis, rad/s."""
        return self.R * eps * (t - np.sin(self.schuler * t) / self.schuler)

    def by_velocity(self, v: Array | float, t: Array) -> Array:
        """Horizontal error, m, of a velocity error at the start, m/s."""
        return v * np.sin(self.schuler * t) / self.schuler

    def vertical(self, b: Array | float, t: Array) -> Array:
        """Height error, m, of a vertical acceleration error, m/s^2."""
        rate = np.sqrt(2.0) * self.schuler
        return np.asarray(b * (np.cosh(rate * t) - 1.0) / rate**2)

    def flat_by_acceleration(self, b: Array | float, t: Array) -> Array:
        """Horizontal error in a flat world, m, of an acceleration error, m/s^2."""
        return 0.5 * b * t**2

    def flat_by_rate(self, eps: Array | float, t: Array) -> Array:
        """Horizontal error in a flat world, m, of an angular rate error, rad/s."""
        return self.g * eps * t**3 / 6.0

    def by_rate_noise(self, density: float, t: Array) -> Array:
        """1-sigma along one axis, m, of a white angular rate, rad/sqrt(s)."""
        w = self.schuler
        variance = 1.5 * t - 2.0 * np.sin(w * t) / w + np.sin(2.0 * w * t) / (4.0 * w)
        return np.asarray(self.R * density * np.sqrt(np.maximum(variance, 0.0)))

    def by_acceleration_noise(self, density: float, t: Array) -> Array:
        """1-sigma along one axis, m, of a white specific force, (m/s)/sqrt(s)."""
        w = self.schuler
        variance = 0.5 * t - np.sin(2.0 * w * t) / (4.0 * w)
        return np.asarray(density / w * np.sqrt(np.maximum(variance, 0.0)))


def fit_power(t: Array, error: Array) -> tuple[float, float]:
    """Coefficient and power of error = coefficient * t ** power, by least squares of logarithms.

    From 1 s to a quarter of the Schuler period, where the error is larger than rounding; NaN with
    fewer than five such points.
    """
    with np.errstate(invalid="ignore"):
        rows = (t >= _FIT_FROM) & (t <= _FIT_TO) & (error > FLOOR)
    if np.count_nonzero(rows) < 5:
        return np.nan, np.nan
    power, logarithm = np.polyfit(np.log(t[rows]), np.log(error[rows]), 1)
    return float(np.exp(logarithm)), float(power)
