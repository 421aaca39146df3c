"""A linear IMU error model, discretised exactly over the real length of each interval."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from navgrade.imu import ImuSamples, Kind
from navgrade.sensors.processes import count_pulses, gauss_markov, random_walk

Array = NDArray[np.float64]

_SOURCES = ("bias", "scale", "misalignment", "white", "walk", "markov")  # append only: seeds


@dataclass(frozen=True, eq=False)
class TriadErrors:
    """Errors of three gyros (rad/s) or three accelerometers (m/s^2).

    What is measured of a true input x is
    ``(I + diag(scale) + misalignment) x + bias + walk(t) + markov(t) + white noise``, quantised.

    Parameters
    ----------
    bias : array_like, shape (3,)
        Constant, in the unit of the rate.
    scale : array_like, shape (3,)
        Scale factor error; 1e-6 is 1 ppm.
    misalignment : array_like, shape (3, 3)
        Element (i, j), small angle in rad: how much axis i feels of what happens along axis j.
        The diagonal is zero.
    white : float
        Density of white noise: rad/sqrt(s), angle random walk; m/s/sqrt(s), velocity random walk.
    walk : float
        Density of the bias's random walk, unit of the rate per sqrt(s). It starts at zero.
    markov, markov_time : float
        1-sigma of a stationary first-order Gauss-Markov bias, and its correlation time, s.
    quantum : float
        One pulse of an increment, rad or m/s.
    resolution : float
        Last digit of a rate or of an average.
    bias_sigma, scale_sigma, misalignment_sigma : float
        1-sigma from run to run of each element of `bias`, `scale` and `misalignment`, drawn once.

    Raises
    ------
    ValueError
        On a wrong shape, a number that is not finite, or a negative amount.
    """

    bias: Array = field(default_factory=lambda: np.zeros(3))
    scale: Array = field(default_factory=lambda: np.zeros(3))
    misalignment: Array = field(default_factory=lambda: np.zeros((3, 3)))
    white: float = 0.0
    walk: float = 0.0
    markov: float = 0.0
    markov_time: float = np.inf
    quantum: float = 0.0
    resolution: float = 0.0
    bias_sigma: float = 0.0
    scale_sigma: float = 0.0
    misalignment_sigma: float = 0.0

    def __post_init__(self) -> None:
        for name, shape in (("bias", (3,)), ("scale", (3,)), ("misalignment", (3, 3))):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != shape or not np.all(np.isfinite(array)):
                raise ValueError(f"{name} must be finite, of shape {shape}, got {array!r}")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if np.any(np.diag(self.misalignment)):
            raise ValueError("misalignment must have a zero diagonal: that is scale")
        for part in fields(self)[3:]:
            value = getattr(self, part.name)
            if not value >= 0.0 or (value == np.inf and part.name != "markov_time"):
                raise ValueError(f"{part.name} must be finite and not negative, got {value!r}")
        if self.markov and not 0.0 < self.markov_time < np.inf:
            raise ValueError(f"markov_time must be positive, got {self.markov_time!r} s")


@dataclass(frozen=True, eq=False)
class ImuErrors:
    """Errors of an IMU's gyros and accelerometers; none by default."""

    gyro: TriadErrors = field(default_factory=TriadErrors)
    accel: TriadErrors = field(default_factory=TriadErrors)


class Sensor:
    """One IMU with its errors, from switching on.

    Every source of randomness has a sequence of its own: what one source gives does not depend on
    which others are switched on. Blocks continue one another; what comes out does not depend, bit
    for bit, on where they end.

    Parameters
    ----------
    errors : ImuErrors
    seed : int
        Not negative; the same seed gives the same numbers.

    Attributes
    ----------
    errors : ImuErrors
        Of this unit in this run: the constants drawn, their sigmas zero.
    """

    def __init__(self, errors: ImuErrors, seed: int) -> None:
        self._triads = [
            _Triad(triad, _sequences(seed, key))
            for key, triad in enumerate((errors.gyro, errors.accel))
        ]
        self.errors = ImuErrors(*(triad.errors for triad in self._triads))

    def measure(self, samples: ImuSamples) -> ImuSamples:
        """What this IMU gives for the next true samples.

        Exact for the model over intervals of any length, equal or not. White noise of density N
        adds ``N sqrt(dt)`` to an increment, ``N / sqrt(dt)`` to an average and to a rate, which
        no sensor takes without averaging; drifting biases add their integral over the interval,
        or their value at the stamp of a rate. Time passes by the samples' `dt`; leave samples out
        afterwards, not before.

        Increments carry what is less than a pulse on to the next; rates and averages are rounded.

        Raises
        ------
        ValueError
            If the samples are compensated: the sensor's own processing has mixed the axes.
        """
        if samples.kind == "compensated":
            raise ValueError("samples must be rates, averages or increments, not compensated")
        gyro, accel = (
            triad.measure(values, samples.dt, samples.kind)
            for triad, values in zip(self._triads, (samples.gyro, samples.accel), strict=True)
        )
        return ImuSamples(
            t=samples.t,
            dt=samples.dt,
            gyro=gyro,
            accel=accel,
            kind=samples.kind,
            epoch_ns=samples.epoch_ns,
            status=samples.status,
        )


def _sequences(seed: int, triad: int) -> dict[str, np.random.Generator]:
    return {
        source: np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(triad, key)))
        for key, source in enumerate(_SOURCES)
    }


class _Triad:
    """Three axes, their sequences, and the state carried from block to block."""

    def __init__(self, errors: TriadErrors, sequences: dict[str, np.random.Generator]) -> None:
        off_diagonal = 1.0 - np.eye(3)
        self.errors = replace(
            errors,
            bias=errors.bias + errors.bias_sigma * sequences["bias"].standard_normal(3),
            scale=errors.scale + errors.scale_sigma * sequences["scale"].standard_normal(3),
            misalignment=errors.misalignment
            + errors.misalignment_sigma
            * sequences["misalignment"].standard_normal((3, 3))
            * off_diagonal,
            bias_sigma=0.0,
            scale_sigma=0.0,
            misalignment_sigma=0.0,
        )
        self._sequences = sequences
        self._response = np.eye(3) + np.diag(self.errors.scale) + self.errors.misalignment
        self._states = {
            "walk": np.zeros(3),
            "markov": errors.markov * sequences["markov"].standard_normal(3),
        }
        self._remainder = np.zeros(3)

    def measure(self, true: Array, dt: Array, kind: Kind) -> Array:
        per_interval = dt[:, None] if kind == "increment" else 1.0
        out = self.errors.bias * per_interval
        for j in range(3):  # not a matrix product, whose rounding depends on the number of rows
            out = out + true[:, j, None] * self._response[:, j]
        if self.errors.white:
            noise = self.errors.white * self._sequences["white"].standard_normal(true.shape)
            root = np.sqrt(dt)[:, None]
            out += noise * root if kind == "increment" else noise / root
        for value, integral in self._drifts(dt):
            if kind == "increment":
                out += integral
            else:
                out += value if kind == "rate" else integral / dt[:, None]
        if kind == "increment":
            if self.errors.quantum:
                count_pulses(out, self.errors.quantum, self._remainder)
        elif self.errors.resolution:
            out = self.errors.resolution * np.rint(out / self.errors.resolution)
        return out

    def _drifts(self, dt: Array) -> list[tuple[Array, Array]]:
        """Value at the stamp and integral over the interval of each bias that drifts."""
        drifts = []
        if self.errors.walk:
            drifts.append(self._drift("walk", dt, random_walk, self.errors.walk))
        if self.errors.markov:
            amounts = self.errors.markov, self.errors.markov_time
            drifts.append(self._drift("markov", dt, gauss_markov, *amounts))
        return drifts

    def _drift(
        self, source: str, dt: Array, loop: Callable[..., None], *amounts: float
    ) -> tuple[Array, Array]:
        normal = self._sequences[source].standard_normal((len(dt), 2, 3))
        value, integral = np.empty((2, len(dt), 3))
        loop(dt, normal, *amounts, self._states[source], value, integral)
        return value, integral
