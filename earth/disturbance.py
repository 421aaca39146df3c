"""What the real gravity field adds to normal gravity, on a grid of latitude and longitude.

Deflections of the vertical are astronomic minus geodetic coordinates of the zenith,
``xi = Phi - phi`` and ``eta = (Lambda - lambda) cos(phi)``; the gravity disturbance ``dg`` is
real minus normal gravity at the same point (Heiskanen & Moritz, Physical Geodesy (1967), chapter
2; Torge & Müller, Geodesy (2012), chapter 6). A positive xi tilts the zenith to the north, so the
plumb line points, and gravity pulls, to the south:

    g_n = gamma_n - gamma xi,  g_e = -gamma eta,  g_d = gamma_d + dg

That is the definition, to first order, by which spherical harmonic synthesis delivers the three:
``xi = -T_north / gamma``, ``eta = -T_east / gamma``, ``dg = T_down`` of the disturbing potential.
In a strong field (60", 300 mGal) the terms left out amount to 0.1 mGal.

The deflections are taken from the direction of *normal gravity at the point*, as gravity models
give them (Molodensky's), not from the ellipsoid's normal, as astrogeodetic observations do
(Helmert's). The second exceed the first in xi by 0.17" sin(2 phi) per kilometre of height.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from earth._jit import formula
from earth.units import ARCSEC, DEG, MGAL

_TWO_PI = 2.0 * np.pi
_EDGE = 1e-9  # of a cell: rounding of a position on the border of the grid
_UNEVEN = 1e-3  # of a cell: rounding of coordinates in a file
_SAME = 1e-8  # rad, m/s^2: between the columns at the first longitude and 360° further
# More than any field known; it tells radians from arcseconds and m/s^2 from mGal.
_MAX = {"xi": 0.01, "eta": 0.01, "dg": 0.1}  # rad, rad, m/s^2
_COLUMNS = "lat_deg,lon_deg,xi_arcsec,eta_arcsec,dg_mgal"


class GridNodes(NamedTuple):
    """The numbers kernels need of a `DisturbanceGrid`."""

    lat: float  # of the first row, rad
    per_lat: float  # rows per rad
    lon: float  # of the middle, rad
    half_width: float  # from the first column to the middle, rad
    per_lon: float  # columns per rad
    values: NDArray[np.float64]  # (nlat, nlon, 3): xi, eta, dg


@formula
def grid_disturbance(nodes, lat, lon):
    """Return xi, eta (rad) and dg (m/s^2) by bilinear interpolation; NaN outside the grid."""
    values = nodes.values
    last_row = values.shape[0] - 1
    last_column = values.shape[1] - 1
    east = lon - nodes.lon
    east -= _TWO_PI * np.rint(east / _TWO_PI)
    y = (lat - nodes.lat) * nodes.per_lat
    x = (east + nodes.half_width) * nodes.per_lon
    if not (-_EDGE <= y <= last_row + _EDGE and -_EDGE <= x <= last_column + _EDGE):
        return np.nan, np.nan, np.nan
    i = min(int(y), last_row - 1)
    j = min(int(x), last_column - 1)
    y -= i
    x -= j
    south_west = (1.0 - y) * (1.0 - x)
    south_east = (1.0 - y) * x
    north_west = y * (1.0 - x)
    north_east = y * x
    return (
        south_west * values[i, j, 0]
        + south_east * values[i, j + 1, 0]
        + north_west * values[i + 1, j, 0]
        + north_east * values[i + 1, j + 1, 0],
        south_west * values[i, j, 1]
        + south_east * values[i, j + 1, 1]
        + north_west * values[i + 1, j, 1]
        + north_east * values[i + 1, j + 1, 1],
        south_west * values[i, j, 2]
        + south_east * values[i, j + 1, 2]
        + north_west * values[i + 1, j, 2]
        + north_east * values[i + 1, j + 1, 2],
    )


def _frozen(values: ArrayLike) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64, order="C")
    array.setflags(write=False)
    return array


def _check_even(name: str, values: NDArray[np.float64]) -> None:
    if values.ndim != 1 or values.size < 2:
        raise ValueError(f"{name} must hold two values or more, got shape {values.shape}")
    if not (np.isfinite(values).all() and np.all(np.diff(values) > 0.0)):
        raise ValueError(f"{name} must be finite and increase")
    even = np.linspace(values[0], values[-1], values.size)
    off = np.abs(values - even) > _UNEVEN * (even[1] - even[0])
    if off.any():
        index = int(np.argmax(off))
        raise ValueError(
            f"{name} must be evenly spaced; {values[index] / DEG:.6f}° at index {index} is not "
            "where even steps from the first value to the last would have it (across longitude "
            "0° or 180° count on without a jump, for example -2, 0, 2)"
        )


@dataclass(frozen=True, eq=False)
class DisturbanceGrid:
    """Deflections of the vertical and gravity disturbance on a regular grid.

    Between the nodes it is interpolated bilinearly. The values hold at every height: their
    decrease upwards is ignored (47 % per kilometre for structures of 10 km wavelength, 6 % for
    100 km), so give the grid for the height of the journey. Outside the grid the field is not a
    number; nothing is guessed. Longitudes may be counted from -180° or from 0°, and a grid that
    spans 360°, with or without the repeated column, closes upon itself.

    Parameters
    ----------
    lat : array_like, shape (nlat,)
        Geodetic latitudes, rad, increasing, evenly spaced to 0.1 % of a cell.
    lon : array_like, shape (nlon,)
        Longitudes, rad, likewise; they span 360° at most.
    xi : array_like, shape (nlat, nlon)
        Deflection towards north, ``Phi - phi``, rad: positive where the plumb line points to
        the south of normal gravity.
    eta : array_like, shape (nlat, nlon)
        Deflection towards east, ``(Lambda - lambda) cos(phi)``, rad: positive where the plumb
        line points to the west.
    dg : array_like, shape (nlat, nlon)
        Gravity disturbance, m/s^2: positive where real gravity is stronger. It is not the
        gravity *anomaly*, which compares two points and differs by 0.31 mGal per metre of geoid
        height.

    Raises
    ------
    ValueError
        On a wrong shape, uneven or decreasing coordinates, values that are not finite or too
        large for their unit, or a repeated column that disagrees with the first.
    """

    lat: NDArray[np.float64]
    lon: NDArray[np.float64]
    xi: NDArray[np.float64]
    eta: NDArray[np.float64]
    dg: NDArray[np.float64]

    def __post_init__(self) -> None:
        for name in ("lat", "lon", "xi", "eta", "dg"):
            object.__setattr__(self, name, _frozen(getattr(self, name)))
        _check_even("lat", self.lat)
        _check_even("lon", self.lon)
        if np.abs(self.lat).max() > 0.5 * np.pi * (1.0 + 1e-9):
            raise ValueError("lat must be within ±pi/2 rad; degrees are not radians")
        shape = (self.lat.size, self.lon.size)
        for name, bound in _MAX.items():
            values = getattr(self, name)
            if values.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, got {values.shape}")
            bad = ~(np.abs(values) <= bound)
            if bad.any():
                i, j = (int(k) for k in np.unravel_index(int(np.argmax(bad)), shape))
                unit = "m/s²; mGal are not m/s²" if name == "dg" else "rad; arcsec are not rad"
                raise ValueError(f"{name}[{i}, {j}] is {values[i, j]}, beyond ±{bound} {unit}")
        step = self._lon_step
        columns = (self.lon[-1] - self.lon[0]) / step
        if columns * step > _TWO_PI + _UNEVEN * step:
            raise ValueError("lon must not span more than 2 pi rad; degrees are not radians")
        if self._closed and self._repeated:
            for name in _MAX:
                values = getattr(self, name)
                if not np.allclose(values[:, 0], values[:, -1], rtol=0.0, atol=_SAME):
                    raise ValueError(
                        f"{name} differs between the first and the last longitude, which are "
                        "the same meridian"
                    )

    @property
    def _lon_step(self) -> float:
        return float(self.lon[-1] - self.lon[0]) / (self.lon.size - 1)

    @property
    def _repeated(self) -> bool:
        """The last column is the first one again, 360° further."""
        width = float(self.lon[-1] - self.lon[0])
        return abs(width - _TWO_PI) <= _UNEVEN * self._lon_step

    @property
    def _closed(self) -> bool:
        """The grid spans 360°."""
        width = float(self.lon[-1] - self.lon[0])
        return self._repeated or abs(width + self._lon_step - _TWO_PI) <= _UNEVEN * self._lon_step

    @cached_property
    def nodes(self) -> GridNodes:
        """The grid for kernels; see `grid_disturbance`."""
        values = np.stack([self.xi, self.eta, self.dg], axis=-1)
        width = float(self.lon[-1] - self.lon[0])
        if self._closed:
            width = _TWO_PI
            if not self._repeated:
                values = np.concatenate([values, values[:, :1]], axis=1)
        return GridNodes(
            lat=float(self.lat[0]),
            per_lat=(self.lat.size - 1) / float(self.lat[-1] - self.lat[0]),
            lon=float(self.lon[0]) + 0.5 * width,
            half_width=0.5 * width,
            per_lon=(values.shape[1] - 1) / width,
            values=_frozen(values),
        )

    @classmethod
    def read(cls, path: str | Path) -> DisturbanceGrid:
        """Read a grid from a CSV file.

        Parameters
        ----------
        path : str or Path
            The first line is ``lat_deg,lon_deg,xi_arcsec,eta_arcsec,dg_mgal``; then one node per
            line, in any order, every latitude with every longitude.

        Raises
        ------
        ValueError
            On another header, a line that is not five numbers, a node that is missing or comes
            twice, and for what `DisturbanceGrid` refuses.
        OSError
            If the file cannot be read.
        """
        rows: list[list[float]] = []
        with open(path, encoding="utf-8-sig") as file:
            header = file.readline().strip().replace(" ", "")
            if header != _COLUMNS:
                raise ValueError(f"{path} must begin with the line {_COLUMNS}, got {header!r}")
            for number, line in enumerate(file, 2):
                if not line.strip():
                    continue
                try:
                    row = [float(word) for word in line.split(",")]
                except ValueError:
                    row = []
                if len(row) != 5:
                    raise ValueError(
                        f"{path}, line {number}: expected five numbers, got {line.strip()!r}"
                    )
                rows.append(row)
        if not rows:
            raise ValueError(f"{path} holds no node")
        table = np.array(rows)
        if not np.isfinite(table).all():
            index = int(np.argmin(np.isfinite(table).all(axis=1)))
            raise ValueError(f"{path} holds a value that is not finite: {table[index].tolist()}")
        lat, row_of = np.unique(table[:, 0], return_inverse=True)
        lon, column_of = np.unique(table[:, 1], return_inverse=True)
        count = np.zeros((lat.size, lon.size), int)
        np.add.at(count, (row_of, column_of), 1)
        if (count != 1).any():
            i, j = np.unravel_index(int(np.argmax(count != 1)), count.shape)
            raise ValueError(
                f"{path} is not a full grid of {lat.size} latitudes by {lon.size} longitudes: "
                f"the node at {lat[i]:g}°, {lon[j]:g}° comes {count[i, j]} times, not once"
            )
        grid = np.empty((3, lat.size, lon.size))
        grid[:, row_of, column_of] = table[:, 2:].T
        try:
            return cls(lat * DEG, lon * DEG, grid[0] * ARCSEC, grid[1] * ARCSEC, grid[2] * MGAL)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None
