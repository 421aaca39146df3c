"""One term of the Earth taken out of frame n, to see what it is worth.

Switches for a study, not for navigation. Where nothing is taken out the kernel gets None for them,
and their branches are gone when it is compiled.
"""

from __future__ import annotations

from typing import NamedTuple

from earth._jit import formula
from earth.geodetic import curvatures
from earth.gravity import gravity

SPHERE = 6_371_000.0  # m, radius of the Earth without its ellipsoid

TERMS = {
    "earth-rate": "omega_ie in the attitude",
    "transport-rate": "omega_en in the attitude",
    "coriolis": "(2 omega_ie + omega_en) x v",
    "ellipsoid": "radii of curvature of the ellipsoid; without it a sphere of 6371 km",
    "gravity-height": "gravity with height; without it that of the start height",
    "gravity-latitude": "gravity with latitude; without it that of the start latitude",
    "north-gravity": "north component of gravity",
}


class Terms(NamedTuple):
    """Which terms a run of frame n keeps; see `TERMS`."""

    earth_rate: bool = True
    transport_rate: bool = True
    coriolis: bool = True
    ellipsoid: bool = True
    gravity_height: bool = True
    gravity_latitude: bool = True
    north_gravity: bool = True


def without(term: str) -> Terms:
    """All terms but one of `TERMS`.

    Raises
    ------
    ValueError
        On another name.
    """
    if term not in TERMS:
        raise ValueError(f"term {term!r} is not one of {', '.join(TERMS)}")
    return Terms()._replace(**{term.replace("-", "_"): False})


class Kept(NamedTuple):
    """The terms of a run and the place it starts from, for kernels."""

    terms: Terms
    lat: float  # rad
    sin_lat: float
    cos_lat: float
    h: float  # m


@formula
def kept_curvatures(params, kept, sin_lat, h):
    """Return 1/(M + h) and 1/(N + h), 1/m."""
    if kept is None:
        return curvatures(params, sin_lat, h)
    if kept.terms.ellipsoid:
        return curvatures(params, sin_lat, h)
    per_radius = 1.0 / (SPHERE + h)
    return per_radius, per_radius


@formula
def kept_gravity(params, field, kept, sin_lat, cos_lat, lat, lon, h):
    """Return north, east and down gravity, m/s^2."""
    if kept is None:
        return gravity(params, field, sin_lat, cos_lat, lat, lon, h)
    if not kept.terms.gravity_height:
        h = kept.h
    if not kept.terms.gravity_latitude:
        sin_lat, cos_lat, lat = kept.sin_lat, kept.cos_lat, kept.lat
    g = gravity(params, field, sin_lat, cos_lat, lat, lon, h)
    return (g[0] if kept.terms.north_gravity else 0.0), g[1], g[2]


@formula
def kept_acceleration(kept, g, coriolis):
    """Return g - (2 omega_ie + omega_en) x v, m/s^2."""
    if kept is None:
        return g[0] - coriolis[0], g[1] - coriolis[1], g[2] - coriolis[2]
    share = 1.0 if kept.terms.coriolis else 0.0
    return g[0] - share * coriolis[0], g[1] - share * coriolis[1], g[2] - share * coriolis[2]


@formula
def kept_rate(kept, ie_n, ie_d, en):
    """Return omega_in_n as the attitude feels it, rad/s."""
    if kept is None:
        return ie_n + en[0], en[1], ie_d + en[2]
    ie = 1.0 if kept.terms.earth_rate else 0.0
    transport = 1.0 if kept.terms.transport_rate else 0.0
    return ie * ie_n + transport * en[0], transport * en[1], ie * ie_d + transport * en[2]
