"""The vertical channel: what damps it, and heights from a barometer to damp it with.

Free, an inertial height error grows: gravity weakens with height, so a height that is too large is
given too little gravity and rises on, by e every sqrt(R / 2g) = 570 s. The third-order loop ties it
to a reference height h_b:

    dh/dt       = v_up - c1 (h - h_b)
    dv_up/dt    = ... - c2 (h - h_b) - delta_a
    d delta_a/dt = c3 (h - h_b)

delta_a converges to the error of the vertical acceleration, so that a constant accelerometer bias
leaves no height error. With h_b correct, the error e of the height obeys

    e''' + c1 e'' + (c2 - 2 g/R) e' + c3 e = 0

(differentiate the first equation twice and insert the others, whose linear errors are
d dv/dt = (2 g/R - c2) e - delta_a). The loop and its instability are in R. M. Rogers, Applied
Mathematics in Integrated Navigation Systems, 3rd ed. (AIAA, 2007), (5.70), (5.71).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from earth.units import STANDARD_GRAVITY
from navgrade.errors import StateTimeError
from navgrade.imu import _column

Reference = Literal["start", "absolute"]
REFERENCES: tuple[Reference, ...] = get_args(Reference)
Quantity = Literal["height_m", "pressure_pa"]
QUANTITIES: tuple[Quantity, ...] = get_args(Quantity)

EARTH_RADIUS = 6_371_008.8  # m, mean radius (2a + b) / 3 of WGS-84
GRAVITY_GRADIENT = 2.0 * STANDARD_GRAVITY / EARTH_RADIUS  # 1/s^2, loss of gravity with height

# A hole in the heights longer than the larger of these two is not interpolated across: three
# intervals are a message or two lost, and the chord of one second is off by 1.2 m at 1 g, about
# the noise of a barometer.
MAX_HOLE_INTERVALS = 3.0  # median intervals
MAX_HOLE_S = 1.0  # s


class LoopGains(NamedTuple):
    """Gains of the third-order loop, from h - h_b to three rates."""

    c1: float  # 1/s, of the height
    c2: float  # 1/s^2, of the vertical velocity
    c3: float  # 1/s^3, of the estimated acceleration error


def gains_from_time_constant(tau_s: float) -> LoopGains:
    """Gains that place all three poles of the loop at -1/tau.

    ``(s + 1/tau)^3 = s^3 + c1 s^2 + (c2 - 2 g/R) s + c3``, see the module. Tight loops follow the
    barometer's noise, loose ones its weather; 100 s is usual in aircraft.

    Parameters
    ----------
    tau_s : float
        Time constant, s; positive, and long against the interval of the IMU.

    Raises
    ------
    ValueError
        If it is not positive and finite.
    """
    if not (np.isfinite(tau_s) and tau_s > 0.0):
        raise ValueError(f"tau_s must be positive and finite, got {tau_s!r} s")
    rate = 1.0 / tau_s
    return LoopGains(3.0 * rate, 3.0 * rate * rate + GRAVITY_GRADIENT, rate * rate * rate)


def _rogers(rate: float) -> LoopGains:
    return LoopGains(3.0 * rate, 4.0 * rate * rate + GRAVITY_GRADIENT, 2.0 * rate**3)


CLASSICAL_GAINS: dict[str, LoopGains] = {
    # poles at -k and -k (1 ± j), k = 0.01 1/s: Rogers (5.83), with the k that NavToolkit has as
    # its default (is4s.github.io/NavToolkit, apply_aiding_alt_accel and AidingAltData)
    "rogers": _rogers(0.01),
    # poles at -k and -k (1 ± j sqrt(3))/2, k = 0.01 1/s: the third-order Butterworth filter, whose
    # following of the barometer is flattest in frequency
    "butterworth": LoopGains(2.0 * 0.01, 2.0 * 0.01**2 + GRAVITY_GRADIENT, 0.01**3),
}
"""Published sets by name; each stands beside its source."""

DEFAULT_GAINS = gains_from_time_constant(100.0)  # s


@dataclass(frozen=True, eq=False)
class BaroLoop:
    """Heights that aid the vertical channel, and the gains of the loop.

    Parameters
    ----------
    t : array_like, shape (n,)
        s since the epoch of the IMU samples; at least two.
    h : array_like, shape (n,)
        Height, m, such as `pressure_height` through `geometric_height` gives.
    gains : LoopGains
        `gains_from_time_constant` or `CLASSICAL_GAINS`; a time constant of 100 s by default.
    reference : {"start", "absolute"}
        start: all heights are shifted by one amount, so that at the initial state the height is
        that of the state; pressure heights are off by weather and geoid. absolute: they are
        heights above the ellipsoid as they are.

    Raises
    ------
    ValueError
        On a wrong shape, a value that is not finite, times that do not increase (the message
        names the index), gains whose loop would not settle, or an unknown reference.
    """

    t: NDArray[np.float64]
    h: NDArray[np.float64]
    gains: LoopGains = DEFAULT_GAINS
    reference: Reference = "start"

    def __post_init__(self) -> None:
        n = np.size(self.t)
        if n < 2:
            raise ValueError(f"t must hold at least two heights' times, got {n}")
        t = _column("t", self.t, (n,))
        steps = np.diff(t)
        if not steps.min() > 0.0:
            index = int(np.argmin(steps > 0.0)) + 1
            raise ValueError(
                f"t must increase: {t[index]!r} s at index {index} follows {t[index - 1]!r} s"
            )
        if self.reference not in REFERENCES:
            raise ValueError(
                f"reference must be one of {', '.join(REFERENCES)}, got {self.reference!r}"
            )
        gains = LoopGains(*map(float, self.gains))
        # Routh's condition; c3 = 0 leaves the second-order loop
        damped = gains.c1 > 0.0 and gains.c1 * (gains.c2 - GRAVITY_GRADIENT) > gains.c3 >= 0.0
        if not (np.all(np.isfinite(gains)) and damped):
            raise ValueError(
                f"the loop does not settle with {gains}: it takes finite c1 > 0, c3 >= 0 and "
                f"c1 (c2 - {GRAVITY_GRADIENT:.3g} 1/s^2) > c3"
            )
        object.__setattr__(self, "t", t)
        object.__setattr__(self, "h", _column("h", self.h, (n,)))
        object.__setattr__(self, "gains", gains)

    def __len__(self) -> int:
        return len(self.t)

    @cached_property
    def max_hole(self) -> float:
        """Longest step between heights, s, that is interpolated across."""
        return max(MAX_HOLE_INTERVALS * float(np.median(np.diff(self.t))), MAX_HOLE_S)

    @cached_property
    def _holes(self) -> NDArray[np.bool_]:
        """Whether there is one before each height, and after the last."""
        return np.concatenate([[False], np.diff(self.t) > self.max_hole, [False]])

    def heights_at(self, t: ArrayLike) -> NDArray[np.float64]:
        """Heights on the chords between those recorded.

        Parameters
        ----------
        t : array_like
            s since the epoch, in any order.

        Returns
        -------
        ndarray, same shape
            m; nan before the first height, after the last one, and inside a hole longer than
            `max_hole`.
        """
        t = np.asarray(t, dtype=np.float64)
        h = np.interp(t, self.t, self.h, left=np.nan, right=np.nan)
        if self._holes.any():
            after = np.searchsorted(self.t, t)  # the first height at or after t; n if there is none
            recorded = self.t[np.minimum(after, len(self) - 1)] == t
            h = np.where(self._holes[after] & ~recorded, np.nan, h)
        return np.asarray(h)

    def aligned(self, t0: float, h0: float) -> BaroLoop:
        """Apply the reference: heights above the ellipsoid, given the state at the start.

        Parameters
        ----------
        t0 : float
            Time of the state, s since the epoch.
        h0 : float
            Its height, m.

        Returns
        -------
        BaroLoop
            With reference absolute. The shift is taken from the heights next to `t0`, so their
            noise stays in it.

        Raises
        ------
        StateTimeError
            When the reference is start and there is no height at `t0`.
        """
        if self.reference == "absolute":
            return self
        found = float(self.heights_at(t0))
        if not np.isfinite(found):
            raise StateTimeError(
                f"state.t = {t0:.9f} s has no height to start from: they span {self.t[0]:.9f} s "
                f"to {self.t[-1]:.9f} s, holes of up to {self.max_hole:.3g} s apart; begin where "
                'they do, or give heights above the ellipsoid and reference "absolute"'
            )
        return replace(self, h=self.h + (h0 - found), reference="absolute")


# Manual of the ICAO Standard Atmosphere, Doc 7488/3 (1993)
_P0 = 101_325.0  # Pa, at sea level
_T0 = 288.15  # K, at sea level
_LAPSE = 0.0065  # K/m, up to 11 km
_R_AIR = 287.05287  # J/(kg K)
_R0 = 6_356_766.0  # m, radius of the geopotential
_H_TROPOPAUSE = 11_000.0  # m, geopotential
_T_TROPOPAUSE = _T0 - _LAPSE * _H_TROPOPAUSE  # K
_EXPONENT = STANDARD_GRAVITY / (_R_AIR * _LAPSE)
_P_TROPOPAUSE = _P0 * (_T_TROPOPAUSE / _T0) ** _EXPONENT  # Pa
_SCALE = _R_AIR * _T_TROPOPAUSE / STANDARD_GRAVITY  # m
P_MAX = 177_687.0  # Pa, at -5 km, where the tables begin
P_MIN = 5_474.8  # Pa, at 20 km, where the isothermal layer ends


def pressure_height(p_pa: ArrayLike) -> NDArray[np.float64]:
    """Geopotential height of a pressure in the ICAO standard atmosphere.

    Parameters
    ----------
    p_pa : array_like
        Static pressure, Pa, from `P_MIN` to `P_MAX`: 20 km to -5 km.

    Returns
    -------
    ndarray, same shape
        m above the surface of 1013.25 hPa. Exact in the standard atmosphere; weather moves that
        surface by some 300 m, and air 10 K warmer than standard stretches heights by 4 %.

    Raises
    ------
    ValueError
        On a pressure outside that range; the message names the index.
    """
    p = np.asarray(p_pa, dtype=np.float64)
    good = (p >= P_MIN) & (p <= P_MAX)
    if not good.all():
        index = int(np.argmin(good.ravel()))
        raise ValueError(
            f"pressure {p.ravel()[index]!r} Pa at index {index} is not within {P_MIN:g} Pa to "
            f"{P_MAX:g} Pa (20 km to -5 km); is it in another unit, such as hPa?"
        )
    below = (_T0 / _LAPSE) * (1.0 - (p / _P0) ** (1.0 / _EXPONENT))
    above = _H_TROPOPAUSE + _SCALE * np.log(_P_TROPOPAUSE / p)
    return np.asarray(np.where(p >= _P_TROPOPAUSE, below, above))


def geometric_height(h_geopotential: ArrayLike) -> NDArray[np.float64]:
    """Turn geopotential metres into metres, by the standard atmosphere's own relation.

    ``h = r0 H / (r0 - H)`` with r0 = 6356.766 km: gravity falls off with the square of the
    distance from the Earth's centre and is 9.80665 m/s^2 at sea level. At 10 km it adds 15.8 m;
    gravity as it is, weaker at the equator and stronger at the poles, changes heights by ±0.3 %.
    """
    H = np.asarray(h_geopotential, dtype=np.float64)
    return np.asarray(_R0 * H / (_R0 - H))
