"""Frames of the Earth, and the axis conventions sensors and other programs use."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import ArrayLike, NDArray

from earth._jit import formula
from earth.ellipsoid import WGS84, Ellipsoid

NED_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
NED_TO_ENU.setflags(write=False)

_DIRECTIONS = {
    "forward": (1.0, 0.0, 0.0),
    "right": (0.0, 1.0, 0.0),
    "down": (0.0, 0.0, 1.0),
    "back": (-1.0, 0.0, 0.0),
    "left": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, -1.0),
}
_BY_LETTER = {word[0].upper(): word for word in _DIRECTIONS}
_ASSIGNMENT = re.compile(r"([xyz])\s*=\s*([+-]?)\s*([a-z]+)", re.IGNORECASE)


@formula
def ned_to_ecef(lat, lon):
    """Return the nine elements of C_en, row by row."""
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    return (
        -sin_lat * cos_lon,
        -sin_lon,
        -cos_lat * cos_lon,
        -sin_lat * sin_lon,
        cos_lon,
        -cos_lat * sin_lon,
        cos_lat,
        0.0,
        -sin_lat,
    )


@formula
def half_angle(sin, cos):
    """Return sine and cosine of half an angle within ±pi, from its sine and cosine."""
    if cos > 0.0:
        half_cos = np.sqrt(0.5 * (1.0 + cos))
        return 0.5 * sin / half_cos, half_cos
    half_sin = np.copysign(np.sqrt(0.5 * (1.0 - cos)), sin)
    return half_sin, 0.5 * sin / half_sin


@formula
def ned_to_ecef_quat(sin_lat, cos_lat, sin_lon, cos_lon):
    """Return q_en."""
    lon_s, lon_c = half_angle(sin_lon, cos_lon)
    down_s, down_c = half_angle(cos_lat, -sin_lat)  # about east, from the pole's axis to down
    return lon_c * down_c, lon_s * down_s, -lon_c * down_s, lon_s * down_c


@formula
def ecef_to_inertial(angle):
    """Return the nine elements of C_ie, row by row, for a rotation angle of the Earth, rad."""
    sin, cos = np.sin(angle), np.cos(angle)
    return cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0


def _matrices(elements: tuple[ArrayLike, ...]) -> NDArray[np.float64]:
    rows = np.stack(np.broadcast_arrays(*elements), axis=-1)
    return rows.reshape((*rows.shape[:-1], 3, 3))


def C_en(lat: ArrayLike, lon: ArrayLike) -> NDArray[np.float64]:
    """Matrices (..., 3, 3) from NED at geodetic `lat`, `lon` (rad) to Earth-fixed axes."""
    return _matrices(ned_to_ecef(np.asarray(lat, float), np.asarray(lon, float)))


def C_ie(t: ArrayLike, ellipsoid: Ellipsoid = WGS84) -> NDArray[np.float64]:
    """Matrices (..., 3, 3) from Earth-fixed to inertial axes, which agree at `t` = 0 s."""
    return _matrices(ecef_to_inertial(ellipsoid.omega * np.asarray(t, float)))


def C_bs(axes: str) -> NDArray[np.float64]:
    """Matrix from sensor axes to the body's forward-right-down axes.

    Parameters
    ----------
    axes : str
        Where the sensor's x, y and z point: three letters of F, B, R, L, U, D such as ``"FLU"``,
        or three assignments such as ``"x=-up y=left z=forward"``.

    Returns
    -------
    ndarray, shape (3, 3)
        ``v_b = C_bs @ v_s``.

    Raises
    ------
    ValueError
        If the text does not name three directions of a right-handed triple.
    """
    text = axes.strip()
    columns: dict[str, NDArray[np.float64]] = {}
    if re.fullmatch(r"[A-Za-z]{3}", text) and set(text.upper()) <= set(_BY_LETTER):
        for name, letter in zip("xyz", text.upper(), strict=True):
            columns[name] = np.array(_DIRECTIONS[_BY_LETTER[letter]])
    else:
        if _ASSIGNMENT.sub("", text).strip(" ,;"):
            raise ValueError(_axes_help(axes, "it is not understood"))
        for name, sign, word in _ASSIGNMENT.findall(text.lower()):
            if word not in _DIRECTIONS or name in columns:
                raise ValueError(_axes_help(axes, f"{name}={sign}{word} is not understood"))
            columns[name] = np.array(_DIRECTIONS[word]) * (-1.0 if sign == "-" else 1.0)
        if len(columns) < 3:
            missing = ", ".join(sorted(set("xyz") - set(columns)))
            raise ValueError(_axes_help(axes, f"it leaves {missing} open"))
    C = np.stack([columns[name] for name in "xyz"], axis=-1)
    if round(float(np.linalg.det(C))) != 1:
        raise ValueError(_axes_help(axes, "it is not a right-handed triple"))
    return C + 0.0


def _axes_help(axes: str, reason: str) -> str:
    return (
        f"axes {axes!r}: {reason}; name where x, y and z point, as three letters (FRD, FLU, RFU) "
        'or as "x=-up y=left z=forward" with forward, right, down, back, left, up'
    )
