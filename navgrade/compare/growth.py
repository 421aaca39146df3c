"""How navigation errors grow with time: closed forms, and power laws fitted to what was found.

A level navigator over the Earth turns its own level with the position it computes. That feedback
bounds horizontal errors in oscillations of the Schuler rate w = sqrt(g/R); a flat world has none.
With b an error of horizontal acceleration and eps of angular rate about a horizontal axis,

    over the Earth    (b/w^2) (1 - cos w t)    R eps (t - sin(w t)/w)
    flat world        b t^2 / 2                g eps t^3 / 6

(Titterton & Weston, Strapdown Inertial Navigation Technology, 2nd ed. (2004), section 12.3; Groves,
Principles of GNSS, Inertial and Multisensor Integrated Navigation Systems, 2nd ed. (2013), section
5.7). The vertical channel diverges with sqrt(R/2g) = 570 s. The forms leave out the daily and the
Foucault oscillation: within 4 % to one hour. Of drivers that vary they are superposed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from earth.ellipsoid import WGS84
from earth.geodetic import radii
from earth.gravity import normal_gravity_n

Array = NDArray[np.float64]
Response = Callable[[Array], Array]

FLOOR = 1e-8  # m: smaller differences of positions are rounding
_TIE = 1e-6  # s
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

    # What an impulse leaves behind `s` seconds later, m: of velocity (1 m/s), of angle about a
    # horizontal axis (1 rad), of position (1 m)

    def after_push(self, s: Array) -> Array:
        """Horizontal error, m, of 1 m/s."""
        return np.asarray(np.sin(self.schuler * s) / self.schuler)

    def after_tilt(self, s: Array) -> Array:
        """Horizontal error, m, of 1 rad."""
        return np.asarray(self.R * (1.0 - np.cos(self.schuler * s)))

    def after_step(self, s: Array) -> Array:
        """Horizontal error, m, of 1 m that the attitude does not follow."""
        return np.asarray(np.cos(self.schuler * s))

    def after_lift(self, s: Array) -> Array:
        """Height error, m, of 1 m/s upwards."""
        rate = np.sqrt(2.0) * self.schuler
        return np.asarray(np.sinh(rate * s) / rate)

    def flat_after_push(self, s: Array) -> Array:
        """Error in a flat world, m, of 1 m/s."""
        return s

    def flat_after_tilt(self, s: Array) -> Array:
        """Horizontal error in a flat world, m, of 1 rad."""
        return np.asarray(0.5 * self.g * s * s)

    def by_acceleration(self, b: float, t: Array) -> Array:
        """Horizontal error, m, of a constant acceleration error, m/s^2."""
        return np.asarray(b * (1.0 - np.cos(self.schuler * t)) / self.schuler**2)

    def by_rate(self, eps: float, t: Array) -> Array:
        """Horizontal error, m, of a constant rate error about a horizontal axis, rad/s."""
        return np.asarray(self.R * eps * (t - np.sin(self.schuler * t) / self.schuler))

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


def superposed(response: Response, t: Array, driver: Array, epochs: Array) -> Array:
    """The error at each epoch of a driver that varies with time: a sum over its impulses.

    Parameters
    ----------
    response : callable
        Of `Level`: what an impulse leaves behind after some time.
    t : ndarray, shape (n,)
        s, from 0 on.
    driver : ndarray, shape (n,) or (n, m)
        Straight lines between its rows, per second of the impulse's unit.
    epochs : ndarray, shape (k,)
        Among `t`.

    Returns
    -------
    ndarray, shape (k,) or (k, m)
        m.
    """
    return np.array(
        [
            np.trapezoid((response(epoch - t[:stop]) * driver[:stop].T).T, t[:stop], axis=0)
            for epoch, stop in zip(epochs, np.searchsorted(t, epochs - _TIE) + 1, strict=True)
        ]
    )


def turned(t: Array, turns: Array, r: Array, v: Array, epochs: Array) -> Array:
    """The error at each epoch of turns about the vertical, which turn what is accelerated later.

    A turn moves the position across the way gained after it over what the speed held would give.

    Parameters
    ----------
    t : ndarray, shape (n,)
        s.
    turns : ndarray, shape (n,)
        Errors of heading, rad: ``phi_n`` downwards, that arise at `t`.
    r, v : ndarray, shape (n, 2)
        Displacement and velocity along north and east, m and m/s.
    epochs : ndarray, shape (k,)
        Among `t`.

    Returns
    -------
    ndarray, shape (k, 2)
        North and east, m.
    """
    found = np.empty((len(epochs), 2))
    for k, row in enumerate(np.searchsorted(t, epochs - _TIE)):
        gained = r[row] - r[:row] - v[:row] * (t[row] - t[:row, None])
        north, east = turns[:row] @ gained
        found[k] = east, -north
    return found


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
