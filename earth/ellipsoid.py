"""Reference ellipsoids: four defining constants, a citation, and what follows from them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite, sqrt
from typing import NamedTuple

from earth._jit import formula

_TERMS = 14  # of the q series; x = E/u <= 0.2, so x^28 is below 1e-19


@formula
def ellipsoidal_q(x):
    """Return q and q' of Heiskanen & Moritz (2-113, 2-133) at x = E/u, as power series.

    The closed forms with arctan lose 11 of 16 digits for the Earth; the series lose none.
    """
    x2 = x * x
    q = 0.0
    dq = 0.0
    for k in range(_TERMS, 0, -1):
        odd = 1.0 / ((2 * k + 1) * (2 * k + 3))
        q = 2.0 * k * odd - x2 * q
        dq = 6.0 * odd - x2 * dq
    return q * x2 * x, dq * x2


class EllipsoidParams(NamedTuple):
    """The numbers kernels need; one compiled kernel then serves every ellipsoid."""

    a: float  # semi-major axis, m
    b: float  # semi-minor axis, m
    e2: float  # first eccentricity squared
    E: float  # linear eccentricity, m
    GM: float  # m^3/s^2
    omega: float  # rotation rate, rad/s
    q0: float  # q at the ellipsoid
    gamma_e: float  # normal gravity on the equator, m/s^2
    gamma_p: float  # normal gravity at the poles, m/s^2


@dataclass(frozen=True)
class Ellipsoid:
    """A rotating equipotential ellipsoid of revolution.

    Parameters
    ----------
    name : str
    a : float
        Semi-major axis, m.
    f : float
        Flattening, 0 < f <= 0.02.
    GM : float
        Gravitational parameter with atmosphere, m^3/s^2.
    omega : float
        Rotation rate, rad/s.
    citation : str
        Where the four constants come from.

    Raises
    ------
    ValueError
        If a constant is outside its range.
    """

    name: str
    a: float
    f: float
    GM: float
    omega: float
    citation: str

    def __post_init__(self) -> None:
        for label, value in (("a", self.a), ("GM", self.GM), ("omega", self.omega)):
            if not (isfinite(value) and value > 0.0):
                raise ValueError(f"Ellipsoid {label} must be positive and finite, got {value!r}")
        if not 0.0 < self.f <= 0.02:
            raise ValueError(f"Ellipsoid f must be in (0, 0.02], got {self.f!r}")

    @cached_property
    def params(self) -> EllipsoidParams:
        """Defining and derived constants for kernels.

        Normal gravity on the equator and at the poles is Heiskanen & Moritz (2-105, 2-106).
        """
        a, GM, omega = self.a, self.GM, self.omega
        e2 = self.f * (2.0 - self.f)
        b = a * (1.0 - self.f)
        E = a * sqrt(e2)
        q0, dq0 = ellipsoidal_q(E / b)
        m = omega**2 * a**2 * b / GM
        ratio = m * (E / b) * dq0 / q0
        return EllipsoidParams(
            a=a,
            b=b,
            e2=e2,
            E=E,
            GM=GM,
            omega=omega,
            q0=q0,
            gamma_e=GM / (a * b) * (1.0 - m - ratio / 6.0),
            gamma_p=GM / a**2 * (1.0 + ratio / 3.0),
        )


WGS84 = Ellipsoid(
    name="WGS84",
    a=6378137.0,
    f=1.0 / 298.257223563,
    GM=3.986004418e14,
    omega=7.292115e-5,
    citation="NGA.STND.0036_1.0.0_WGS84 (2014), table 3.1",
)

GRS80 = Ellipsoid(
    name="GRS80",
    a=6378137.0,
    f=1.0 / 298.257222100882711,
    GM=3.986005e14,
    omega=7.292115e-5,
    citation="Moritz, Geodetic Reference System 1980, J. Geodesy 74 (2000) 128-133",
)
