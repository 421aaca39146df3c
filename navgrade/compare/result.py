"""What a comparison found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Group = Literal["engine", "flat", "term"]
Axis = Literal["horizontal", "vertical"]


@dataclass(frozen=True, eq=False)
class Growth:
    """How the position error grows with time.

    Attributes
    ----------
    coefficient, power : float
        Fitted: error = coefficient * t ** power, m and s. NaN where there is no error to fit.
    formula : str
        The closed form that predicts it; empty where there is none.
    predicted : ndarray, shape (k,)
        What the closed form gives at the epochs, m; NaN where there is none.
    axis : {"horizontal", "vertical"}
        Which error is fitted and predicted.
    """

    coefficient: float
    power: float
    formula: str
    predicted: Array
    axis: Axis = "horizontal"


@dataclass(frozen=True, eq=False)
class Variant:
    """One solution of the log, and how it differs from the reference.

    Rows are those of `Comparison.t`; NaN from where the solution ended early.

    Attributes
    ----------
    name : str
        For tables: ``engine``, ``flat-euler``, ``without-coriolis``.
    label : str
        For people: "Earth frame, without Coriolis".
    group : {"engine", "flat", "term"}
        The full engine, a flat world, or the engine with one term removed.
    position_error : ndarray, shape (n, 3)
        Estimate minus reference along north, east, down at the reference, m.
    velocity_error : ndarray, shape (n, 3)
        Likewise, m/s.
    attitude_error : ndarray, shape (n, 3)
        ``phi_n``, rad: ``C_hat_nb = (I - [phi_n x]) C_nb``.
    track : ndarray, shape (n, 3)
        East, north, up in the plane tangent to the ellipsoid at the start, m.
    growth : Growth
    """

    name: str
    label: str
    group: Group
    position_error: Array
    velocity_error: Array
    attitude_error: Array
    track: Array
    growth: Growth

    @property
    def horizontal(self) -> Array:
        """Horizontal position error, m, shape (n,)."""
        return np.hypot(self.position_error[:, 0], self.position_error[:, 1])


@dataclass(frozen=True, eq=False)
class Comparison:
    """Solutions of one log side by side.

    Attributes
    ----------
    log, topic, description : str
        File, IMU topic, and what was understood of it.
    start_ns : int
        Unix time of ``t = 0``, the start of navigation, ns.
    lat, lon, h : float
        Where it started, rad, rad, m.
    reference : str
        What errors are relative to: "truth /truth/solution", "the full engine".
    t : ndarray, shape (n,)
        s after the start, increasing; dense at first, so that error growth shows on log axes.
    epochs : ndarray, shape (k,)
        The times to report, s, among `t`.
    track : ndarray, shape (n, 3)
        Of the reference; east, north, up in the plane tangent at the start, m.
    variants : tuple of Variant
        The full engine first.
    imu_error : ndarray, shape (k,), or None
        Horizontal error, 1-sigma, m, that the stated or simulated sensor errors alone cause.
    verdict : tuple of str
        Sentences.
    notes : tuple of str
        What the reader of the numbers must know: gaps bridged, truth interpolated, ...
    """

    log: str
    topic: str
    description: str
    start_ns: int
    lat: float
    lon: float
    h: float
    reference: str
    t: Array
    epochs: Array
    track: Array
    variants: tuple[Variant, ...]
    imu_error: Array | None
    verdict: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def epoch_rows(self) -> NDArray[np.intp]:
        """Rows of `t` that are the epochs."""
        return np.searchsorted(self.t, self.epochs)
