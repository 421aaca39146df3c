"""What an alignment found, how well, and how it came there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Grade = Literal["navigation", "coarse", "levelling"]


@dataclass(frozen=True)
class Contribution:
    """One line of an error budget, 1-sigma.

    Attributes
    ----------
    source : str
        ``accelerometer bias``, ``accelerometer noise``, ``gyro bias``, ``gyro noise``,
        ``given heading``.
    tilt : float
        Of the small rotation about each horizontal axis, rad.
    azimuth : float
        Of the small rotation about down, rad.
    """

    source: str
    tilt: float
    azimuth: float


@dataclass(frozen=True, eq=False)
class Convergence:
    """The attitude found from the first part of the window, for growing parts.

    Attributes
    ----------
    t : ndarray, shape (k,)
        s used.
    off : ndarray, shape (k, 3)
        Small rotation of that attitude relative to the final one, NED, rad.
    tilt_sigma, azimuth_sigma : ndarray, shape (k,)
        What theory predicts of the error of each, 1-sigma, rad.
    """

    t: Array
    off: Array
    tilt_sigma: Array
    azimuth_sigma: Array


@dataclass(frozen=True, eq=False)
class Innovations:
    """Normalised innovations of a Kalman filter, and what they say of its covariance.

    Attributes
    ----------
    t : ndarray, shape (k,)
        s.
    nis : ndarray, shape (k,)
        Normalised innovation squared; its expectation is `dof`.
    dof : int
    low, high : float
        Bounds of the mean of `nis` for a filter whose model holds, 95 %.
    consistent : bool
        The mean lies between them.
    """

    t: Array
    nis: Array
    dof: int
    low: float
    high: float
    consistent: bool


@dataclass(frozen=True, eq=False)
class Alignment:
    """Attitude of an IMU on a base at rest or swaying.

    Small rotations are those of ``C_hat C^T`` about north, east, down.

    Attributes
    ----------
    method : str
        Of `align.METHODS`.
    reason : str
        Why this method, in words.
    q_nb : ndarray, shape (4,)
        At the end of the window.
    roll, pitch, heading : float
        rad; heading in [0, 2 pi), not a number where only the level was found.
    P_n : ndarray, shape (3, 3)
        Covariance of the small rotation, rad^2.
    roll_sigma, pitch_sigma, heading_sigma : float
        Predicted 1-sigma, rad.
    tilt_sigma, azimuth_sigma : float
        1-sigma of the small rotations about a horizontal axis and about down, rad; unlike roll
        and heading they stay meaningful at pitch ±90°.
    budget : tuple of Contribution
        Their squares sum to those of `tilt_sigma` and `azimuth_sigma`.
    grade : {"navigation", "coarse", "levelling"}
    verdict : str
        What the attitude is good for, in a sentence.
    gyro_heading, gyro_heading_sigma : float
        What the gyros alone say, rad, used or not.
    implied_latitude : float
        Latitude the data alone imply, rad.
    specific_force_residual : float
        ``|f| - g``, m/s^2.
    rate_residual : float
        ``|omega| - omega_ie``, rad/s.
    rate_residual_down, rate_residual_north : float
        Measured minus expected Earth rate about down and along north, rad/s: the part of the
        gyro error that shows.
    scatter : ndarray, shape (3,)
        Standard deviation of the attitude between sub-windows about north, east, down, rad.
    force_scatter, rate_scatter : float
        Stillness statistics: root sum square scatter of one-second means, m/s^2 and rad/s.
    duration : float
        s of samples used.
    convergence : Convergence or None
    gyro_bias, gyro_bias_sigma : ndarray, shape (3,), or None
        In body axes, rad/s, where the data show it.
    accel_bias, accel_bias_sigma : ndarray, shape (3,), or None
        In body axes, m/s^2, where the data show it.
    unobservable : tuple of str
        What the data cannot tell, in words.
    innovations : Innovations or None
        Of the fine alignment's filter.
    eigenvalue_gap : float
        Of Davenport's matrix, smallest to next over largest: how sharply the vectors fix the
        attitude; not a number where the method has none.
    warnings : tuple of str
    """

    method: str
    reason: str
    q_nb: Array
    roll: float
    pitch: float
    heading: float
    P_n: Array
    roll_sigma: float
    pitch_sigma: float
    heading_sigma: float
    tilt_sigma: float
    azimuth_sigma: float
    budget: tuple[Contribution, ...]
    grade: Grade
    verdict: str
    gyro_heading: float
    gyro_heading_sigma: float
    implied_latitude: float
    specific_force_residual: float
    rate_residual: float
    rate_residual_down: float
    rate_residual_north: float
    scatter: Array
    force_scatter: float
    rate_scatter: float
    duration: float
    convergence: Convergence | None = None
    gyro_bias: Array | None = None
    gyro_bias_sigma: Array | None = None
    accel_bias: Array | None = None
    accel_bias_sigma: Array | None = None
    unobservable: tuple[str, ...] = ()
    innovations: Innovations | None = None
    eigenvalue_gap: float = float("nan")
    warnings: tuple[str, ...] = ()
