"""How sensor sheets say what `TriadErrors` holds: names with their units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from earth.units import ARCSEC, DEG_PER_H, DEG_PER_RTH, DEG_PER_S, HOUR, UG, UG_PER_RTHZ
from navgrade.sensors.model import ImuErrors, TriadErrors

_SIX = ([0, 0, 1, 1, 2, 2], [1, 2, 0, 2, 0, 1])  # xy, xz, yx, yz, zx, zy


@dataclass(frozen=True)
class Entry:
    """One line of a sensor sheet.

    Attributes
    ----------
    part : {"gyro", "accel"}
    field : str
        Of `TriadErrors`.
    unit : str
        For people.
    factor : float
        Multiply to enter SI.
    count : int
        How many numbers it takes.
    meaning : str
    """

    part: str
    field: str
    unit: str
    factor: float
    count: int
    meaning: str


def _entries(part: str, names: Mapping[str, tuple[str, str, float]]) -> dict[str, Entry]:
    meanings = {
        "bias": (3, "constant bias of x, y, z"),
        "bias_sigma": (1, "bias from run to run, 1-sigma"),
        "scale": (3, "scale factor error of x, y, z"),
        "scale_sigma": (1, "scale factor error from run to run, 1-sigma"),
        "misalignment": (6, "xy, xz, yx, yz, zx, zy: how much x feels of y, ..."),
        "misalignment_sigma": (1, "each misalignment from run to run, 1-sigma"),
        "white": (1, "white noise: angle or velocity random walk"),
        "walk": (1, "random walk of the bias"),
        "markov": (1, "Gauss-Markov bias, 1-sigma"),
        "markov_time": (1, "its correlation time"),
        "quantum": (1, "one pulse of an increment"),
        "resolution": (1, "last digit of a rate or an average"),
    }
    return {
        key: Entry(part, field, unit, factor, *meanings[field])
        for field, (key, unit, factor) in names.items()
    }


SHEET: Mapping[str, Entry] = {
    **_entries(
        "gyro",
        {
            "bias": ("gyro_bias_deg_h", "°/h", DEG_PER_H),
            "bias_sigma": ("gyro_bias_sigma_deg_h", "°/h", DEG_PER_H),
            "scale": ("gyro_scale_ppm", "ppm", 1e-6),
            "scale_sigma": ("gyro_scale_sigma_ppm", "ppm", 1e-6),
            "misalignment": ("gyro_misalignment_mrad", "mrad", 1e-3),
            "misalignment_sigma": ("gyro_misalignment_sigma_mrad", "mrad", 1e-3),
            "white": ("arw_deg_rth", "°/√h", DEG_PER_RTH),
            "walk": ("gyro_walk_deg_h_rth", "°/h/√h", DEG_PER_H / np.sqrt(HOUR)),
            "markov": ("gyro_markov_deg_h", "°/h", DEG_PER_H),
            "markov_time": ("gyro_markov_time_s", "s", 1.0),
            "quantum": ("gyro_quantum_arcsec", "″", ARCSEC),
            "resolution": ("gyro_resolution_deg_s", "°/s", DEG_PER_S),
        },
    ),
    **_entries(
        "accel",
        {
            "bias": ("accel_bias_ug", "µg", UG),
            "bias_sigma": ("accel_bias_sigma_ug", "µg", UG),
            "scale": ("accel_scale_ppm", "ppm", 1e-6),
            "scale_sigma": ("accel_scale_sigma_ppm", "ppm", 1e-6),
            "misalignment": ("accel_misalignment_mrad", "mrad", 1e-3),
            "misalignment_sigma": ("accel_misalignment_sigma_mrad", "mrad", 1e-3),
            "white": ("vrw_ug_rthz", "µg/√Hz", UG_PER_RTHZ),
            "walk": ("accel_walk_ug_rth", "µg/√h", UG / np.sqrt(HOUR)),
            "markov": ("accel_markov_ug", "µg", UG),
            "markov_time": ("accel_markov_time_s", "s", 1.0),
            "quantum": ("accel_quantum_um_s", "µm/s", 1e-6),
            "resolution": ("accel_resolution_ug", "µg", UG),
        },
    ),
}


def imu_errors(sheet: Mapping[str, float | Sequence[float]]) -> ImuErrors:
    """Errors of an IMU from the lines of its sheet.

    Parameters
    ----------
    sheet : mapping of str to float or sequence
        By the names of `SHEET`, in their units. What is left out is zero. One number for three
        axes holds for each of them.

    Raises
    ------
    ValueError
        On an unknown name, a wrong count of numbers, or what `TriadErrors` refuses.
    """
    parts: dict[str, dict[str, Any]] = {"gyro": {}, "accel": {}}
    for key, value in sheet.items():
        if key not in SHEET:
            raise ValueError(f"{key!r} is not one of {', '.join(SHEET)}")
        entry = SHEET[key]
        numbers = np.asarray(value, dtype=np.float64) * entry.factor
        if numbers.ndim == 0 and entry.count == 3:
            numbers = np.full(3, numbers)
        if numbers.size != entry.count or numbers.ndim > 1:
            wanted = "one number" if entry.count == 1 else f"{entry.count} numbers"
            raise ValueError(f"{key} must be {wanted}, got {value!r}")
        if entry.count == 6:
            matrix = np.zeros((3, 3))
            matrix[_SIX] = numbers
            numbers = matrix
        parts[entry.part][entry.field] = numbers.item() if entry.count == 1 else numbers
    return ImuErrors(TriadErrors(**parts["gyro"]), TriadErrors(**parts["accel"]))
