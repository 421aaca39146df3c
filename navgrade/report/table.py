"""A comparison as plain data."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from earth.units import DEG
from navgrade.compare.result import Array, Comparison, Variant
from navgrade.logs.convert import write_table
from navgrade.report.curves import ended
from navgrade.report.output import places

_AXES = ("north", "east", "down")


def write_tables(
    comparison: Comparison, folder: str | Path, *, overwrite: bool = False
) -> tuple[Path, ...]:
    """Write ``errors.csv`` and ``growth.csv``, the unit in each column's name.

    ``errors.csv`` has a row for each variant and time; ``nan`` where a solution ended early.
    ``growth.csv`` has a row for each variant: the fitted law, whose coefficient is the error at
    1 s, the closed form, and what it predicts at the epochs.

    Parameters
    ----------
    comparison : Comparison
    folder : path
        Made if only it is missing.
    overwrite : bool

    Returns
    -------
    tuple of Path
        Written.

    Raises
    ------
    ConfigError
        If a file exists and must not be overwritten, or the folder cannot be made.
    """
    paths = places(Path(folder), ("errors.csv", "growth.csv"), overwrite=overwrite)
    for path, blocks in zip(paths, (_errors(comparison), _growth(comparison)), strict=True):
        write_table(path, blocks, overwrite=overwrite)
    return paths


def _errors(comparison: Comparison) -> Iterator[dict[str, Any]]:
    n = len(comparison.t)
    for variant in comparison.variants:
        yield {
            "variant": np.full(n, variant.name),
            "group": np.full(n, variant.group),
            "t_s": comparison.t,
            **_columns("{}_m", variant.position_error),
            **_columns("v_{}_m_s", variant.velocity_error),
            **_columns("phi_{}_rad", variant.attitude_error),
            "horizontal_m": variant.horizontal,
        }


def _columns(name: str, values: Array) -> dict[str, Array]:
    return {name.format(axis): values[:, i] for i, axis in enumerate(_AXES)}


def _growth(comparison: Comparison) -> Iterator[dict[str, Any]]:
    for variant in comparison.variants:
        growth = variant.growth
        yield {
            "variant": np.array([variant.name]),
            "group": np.array([variant.group]),
            "axis": np.array([growth.axis]),
            "coefficient_m": np.array([growth.coefficient]),
            "power": np.array([growth.power]),
            "formula": np.array([growth.formula]),
            **{
                f"predicted_at_{t:g}_s_m": growth.predicted[i : i + 1]
                for i, t in enumerate(comparison.epochs)
            },
        }


def as_dict(comparison: Comparison) -> dict[str, Any]:
    """The comparison at its epochs in plain types, as JSON takes them; None for NaN."""
    imu_error = comparison.imu_error
    return {
        "log": comparison.log,
        "topic": comparison.topic,
        "description": comparison.description,
        "start_ns": int(comparison.start_ns),
        "lat_deg": float(comparison.lat) / DEG,
        "lon_deg": float(comparison.lon) / DEG,
        "h_m": float(comparison.h),
        "reference": comparison.reference,
        "verdict": list(comparison.verdict),
        "notes": list(comparison.notes),
        "epochs_s": _plain(comparison.epochs),
        "imu_error_m": None if imu_error is None else _plain(imu_error),
        "variants": [_variant(comparison, variant) for variant in comparison.variants],
    }


def _variant(comparison: Comparison, variant: Variant) -> dict[str, Any]:
    rows = comparison.epoch_rows
    growth = variant.growth
    return {
        "name": variant.name,
        "label": variant.label,
        "group": variant.group,
        "ended_s": ended(comparison, variant),
        "horizontal_m": _plain(variant.horizontal[rows]),
        "position_error_ned_m": _plain(variant.position_error[rows]),
        "velocity_error_ned_m_s": _plain(variant.velocity_error[rows]),
        "attitude_error_ned_rad": _plain(variant.attitude_error[rows]),
        "growth": {
            "axis": growth.axis,
            "coefficient_m": _plain(growth.coefficient),
            "power": _plain(growth.power),
            "formula": growth.formula,
            "predicted_m": _plain(growth.predicted),
        },
    }


def _plain(values: Any) -> Any:
    """Floats, nested as the array is, None for what is not finite."""
    array = np.asarray(values, dtype=object)
    return np.where(np.isfinite(array.astype(float)), array, np.array(None)).tolist()
