"""Closed forms written out, for tests of survey data: no code shared with the packages."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

A = 6378137.0  # m, WGS 84 semi-major axis
F = 1.0 / 298.257223563  # its flattening
E2 = F * (2.0 - F)
DEG = math.pi / 180.0  # rad


def xyz(lat: float, lon: float, h: float) -> Array:
    """Earth-fixed position, m."""
    n = A / math.sqrt(1.0 - E2 * math.sin(lat) ** 2)
    return np.array(
        [
            (n + h) * math.cos(lat) * math.cos(lon),
            (n + h) * math.cos(lat) * math.sin(lon),
            (n * (1.0 - E2) + h) * math.sin(lat),
        ]
    )


def local_axes(lat: float, lon: float) -> tuple[Array, Array, Array]:
    """Unit vectors north, east, up at a direction of the vertical, Earth-fixed."""
    up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
    east = np.array([-math.sin(lon), math.cos(lon), 0.0])
    return np.cross(up, east), east, up


def sight(
    here: tuple[float, float, float], there: tuple[float, float, float]
) -> tuple[float, float]:
    """Azimuth and zenith angle of the straight line between two points, rad."""
    line = xyz(*there) - xyz(*here)
    north, east, up = (axis @ line for axis in local_axes(here[0], here[1]))
    return math.atan2(east, north), math.atan2(math.hypot(east, north), up)


def turn(a: float, b: float) -> float:
    """a - b in ±pi."""
    return math.remainder(a - b, 2.0 * math.pi)
