"""One window at rest: its means, what they show of the sensors' errors, and the report of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from align.accuracy import (
    SensorErrors,
    euler_sigmas,
    gyro_budget,
    heading_sigma,
    judge,
    tilt_sigma,
)
from align.checks import Residuals, check_force, check_rate, residuals
from align.errors import AlignmentError
from align.result import Alignment, Contribution
from align.stillness import FORCE_LIMIT, RATE_LIMIT, Stillness, assess, span_means
from align.triad import analytic_coarse
from earth.ellipsoid import WGS84, Ellipsoid
from earth.gravity import normal_gravity_n
from earth.rates import omega_ie_n
from earth.rotation import dcm_from_quat, euler_from_quat, quat_from_dcm, rotvec_from_quat
from earth.units import DEG, DEG_PER_H, UG

Array = NDArray[np.float64]
BudgetForm = Callable[..., tuple[Contribution, ...]]  # of `align.accuracy`

SHORTEST = 2.0  # s
SUB_WINDOWS = 10
SIGNIFICANT = 3.0  # sigmas
ONE_RESIDUAL, TWO_RESIDUALS = 1.84, 1.32  # 68 % of Student's t with so many degrees of freedom
UNSTATED_ACCEL_BIAS = 1000.0 * UG  # |f| shows the upward one alone, and that may be small by luck
_FALSE_ALARM = 1e-3  # of noise taken for more than was stated


class Noise(NamedTuple):
    """Sigma of one axis of a mean by white noise, and whether it is more than was stated."""

    sigma: float
    exceeds: bool


class Bias(NamedTuple):
    """Sigma of a bias, and the words for why it is not simply what was stated."""

    sigma: float
    note: str


class Quality(NamedTuple):
    """What a report says of the data, whatever the method."""

    shown: Residuals
    stillness: Stillness
    duration: float
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Window:
    """Means of a window and the errors they carry.

    Attributes
    ----------
    lat : float
        Of the site, rad.
    g_n, omega_ie_n : ndarray, shape (3,)
        Gravity and Earth rate there, NED.
    duration : float
        s.
    omega_ib_b, f_ib_b : ndarray, shape (3,)
        Means, rad/s and m/s^2.
    sub_omega, sub_f : ndarray, shape (k, 3)
        Means of tenths of the window.
    stillness : Stillness
    shown : Residuals
    rate_noise, force_noise : Noise
        Of the means, one axis.
    rate_bias, force_bias : Bias
        Of one axis.
    ellipsoid : Ellipsoid
    """

    lat: float
    g_n: Array
    omega_ie_n: Array
    duration: float
    omega_ib_b: Array
    f_ib_b: Array
    sub_omega: Array
    sub_f: Array
    stillness: Stillness
    shown: Residuals
    rate_noise: Noise
    force_noise: Noise
    rate_bias: Bias
    force_bias: Bias
    ellipsoid: Ellipsoid

    @property
    def g(self) -> float:
        """Magnitude of gravity, m/s^2."""
        return float(np.linalg.norm(self.g_n))

    @property
    def rate_sigma(self) -> float:
        """Of the mean rate, one axis, rad/s."""
        return float(np.hypot(self.rate_noise.sigma, self.rate_bias.sigma))

    @property
    def force_sigma(self) -> float:
        """Of the mean specific force, one axis, m/s^2."""
        return float(np.hypot(self.force_noise.sigma, self.force_bias.sigma))

    @property
    def tilt(self) -> float:
        """1-sigma of each tilt, rad."""
        return tilt_sigma(self.force_sigma, self.g)

    @property
    def azimuth(self) -> float:
        """1-sigma of the azimuth the gyros find, rad, unbounded."""
        return heading_sigma(self.rate_sigma, self.force_sigma, self.lat, self.g, self.ellipsoid)

    @property
    def quality(self) -> Quality:
        """For the report."""
        return Quality(self.shown, self.stillness, self.duration, self.warnings)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What speaks against the stated errors."""
        found = []
        if self.force_bias.note:
            found.append(
                f"|f| differs from normal gravity by {self.shown.force * 1e3:+.3f} mm/s² "
                f"{self.force_bias.note}"
            )
        if self.rate_bias.note:
            found.append(self._rate_warning())
        for noise, what, walk in (
            (self.rate_noise, "gyros", "arw"),
            (self.force_noise, "accelerometers", "vrw"),
        ):
            if noise.exceeds:
                found.append(
                    f"the {what} scatter more than the stated {walk} allows, so the sigmas were "
                    "enlarged"
                )
        return tuple(found)

    def _rate_warning(self) -> str:
        shown = self.shown
        implies = "the data imply no latitude"
        if np.isfinite(shown.implied_latitude):
            implies = (
                f"the data imply latitude {shown.implied_latitude / DEG:.3f}°, "
                f"{(shown.implied_latitude - self.lat) / DEG:+.3f}° from the site's"
            )
        return (
            f"the gyros miss the Earth rate by {shown.down / DEG_PER_H:+.3f} deg/h about down "
            f"and {shown.north / DEG_PER_H:+.3f} deg/h along north {self.rate_bias.note}; "
            f"{implies}. These parts do not turn the heading, but an eastward error does and "
            "cannot be seen: of the same size it would turn the heading by "
            f"{min(self.azimuth, np.pi) / DEG:.2f}°"
        )

    def budget(self, form: BudgetForm = gyro_budget) -> tuple[Contribution, ...]:
        """What each sensor error adds to an attitude found by the gyros."""
        return form(
            self.rate_bias.sigma,
            self.rate_noise.sigma,
            self.force_bias.sigma,
            self.force_noise.sigma,
            self.lat,
            self.g,
            self.ellipsoid,
        )

    def by_gyros(self, f_ib_b: Array, omega_ib_b: Array) -> Array:
        """Attitude of two means of this site, ``q_nb``."""
        return quat_from_dcm(
            analytic_coarse(f_ib_b, omega_ib_b, g_n=self.g_n, omega_ie_n=self.omega_ie_n)
        )


def examine(
    dt: Array,
    omega_ib_b: Array,
    f_ib_b: Array,
    lat: float,
    h: float,
    errors: SensorErrors,
    ellipsoid: Ellipsoid = WGS84,
) -> Window:
    """Average a window and compare it with what rest at the site would show.

    Parameters are those of `align.align_static`.

    Raises
    ------
    AlignmentError
        When it is too short or not still, or a unit is wrong.
    """
    duration = float(dt.sum())
    if duration < SHORTEST:
        raise AlignmentError(
            f"the alignment window holds {duration:.3f} s of samples; it takes 2 s at least, and "
            "minutes for gyros to find north"
        )
    f = dt @ f_ib_b / duration
    omega = dt @ omega_ib_b / duration
    check_force(f)
    stillness = assess(dt, omega_ib_b, f_ib_b)
    if stillness.force <= FORCE_LIMIT:
        check_rate(omega, f, lat, ellipsoid)
    if not stillness.is_still:
        raise AlignmentError(
            f"the alignment window is not still: one-second means scatter by "
            f"{stillness.force:.4f} m/s² (limit {FORCE_LIMIT}) and "
            f"{stillness.rate / DEG:.4f} deg/s (limit {RATE_LIMIT / DEG:.2f}); choose "
            "alignment.start_s and duration_s inside a stop"
        )
    g_n = normal_gravity_n(lat, h, ellipsoid)
    shown = residuals(omega, f, lat, g_n, ellipsoid)
    sub_omega = span_means(dt, omega_ib_b, duration / SUB_WINDOWS)
    sub_f = span_means(dt, f_ib_b, duration / SUB_WINDOWS)
    rate_noise = _noise(errors.arw, sub_omega, duration)
    force_noise = _noise(errors.vrw, sub_f, duration)
    return Window(
        lat=lat,
        g_n=g_n,
        omega_ie_n=omega_ie_n(lat, ellipsoid),
        duration=duration,
        omega_ib_b=omega,
        f_ib_b=f,
        sub_omega=sub_omega,
        sub_f=sub_f,
        stillness=stillness,
        shown=shown,
        rate_noise=rate_noise,
        force_noise=force_noise,
        rate_bias=bias_sigma(errors.gyro_bias, rate_noise.sigma, shown.shown_rate, TWO_RESIDUALS),
        force_bias=bias_sigma(
            errors.accel_bias,
            force_noise.sigma,
            abs(shown.force),
            ONE_RESIDUAL,
            UNSTATED_ACCEL_BIAS,
        ),
        ellipsoid=ellipsoid,
    )


def conclude(
    quality: Quality,
    method: str,
    reason: str,
    q_nb: Array,
    P_n: Array,
    budget: tuple[Contribution, ...],
    *,
    warnings: tuple[str, ...] = (),
    **more: Any,
) -> Alignment:
    """Report an attitude found in a window.

    Parameters
    ----------
    quality : Quality
    method, reason, q_nb, P_n, budget
        Of `align.result.Alignment`.
    warnings : tuple of str
        Beside those of `quality`.
    more
        Other attributes of `align.result.Alignment`.
    """
    euler = euler_from_quat(q_nb)
    roll_sigma, pitch_sigma, psi_sigma = euler_sigmas(euler, P_n)
    tilt = float(np.sqrt(0.5 * (P_n[0, 0] + P_n[1, 1])))
    azimuth = float(min(np.sqrt(P_n[2, 2]), np.pi))
    if dcm_from_quat(q_nb)[2, 2] < -0.5:
        warnings = (
            *warnings,
            f"the body hangs upside down (roll {euler[0] / DEG:.1f}°); if it does not, imu.axes "
            "is wrong",
        )
    grade, verdict = judge(tilt, azimuth)
    shown = quality.shown
    report: dict[str, Any] = {
        "method": method,
        "reason": reason,
        "q_nb": q_nb,
        "roll": float(euler[0]),
        "pitch": float(euler[1]),
        "heading": compass(float(euler[2])),
        "P_n": P_n,
        "roll_sigma": roll_sigma,
        "pitch_sigma": pitch_sigma,
        "heading_sigma": psi_sigma,
        "tilt_sigma": tilt,
        "azimuth_sigma": azimuth,
        "budget": budget,
        "grade": grade,
        "verdict": verdict,
        "implied_latitude": shown.implied_latitude,
        "specific_force_residual": shown.force,
        "rate_residual": shown.rate,
        "rate_residual_down": shown.down,
        "rate_residual_north": shown.north,
        "force_scatter": quality.stillness.force,
        "rate_scatter": quality.stillness.rate,
        "duration": quality.duration,
        "warnings": (*quality.warnings, *warnings),
    }
    return Alignment(**(report | more))


def white_noise(dt: Array, omega_ib_b: Array, f_ib_b: Array) -> tuple[float, float]:
    """Random walks, rad/sqrt(s) and (m/s)/sqrt(s), that the tenths of a still window show."""
    duration = float(dt.sum())
    noises = [
        _noise(None, span_means(dt, values, duration / SUB_WINDOWS), duration)
        for values in (omega_ib_b, f_ib_b)
    ]
    arw, vrw = (noise.sigma * float(np.sqrt(duration)) for noise in noises)
    return arw, vrw


def compass(heading: float) -> float:
    """The same direction in [0, 2 pi)."""
    wrapped = heading % (2.0 * np.pi)
    return 0.0 if wrapped == 2.0 * np.pi else wrapped  # of a tiny negative angle


def small_rotation(q_hat: Array, q: Array) -> Array:
    """Rotation vector of ``C_hat C^T``, rad, shape (3,)."""
    return rotvec_from_quat(quat_from_dcm(dcm_from_quat(q_hat) @ dcm_from_quat(q).T))


def _noise(random_walk: float | None, sub_means: Array, duration: float) -> Noise:
    """Sigma of the window's mean by white noise: as stated unless the scatter disproves it."""
    count = len(sub_means)
    shown = 0.0
    if count > 1:
        shown = float(np.sqrt((np.var(sub_means, axis=0, ddof=1) / count).mean()))
    if random_walk is None:
        return Noise(shown, False)
    stated = random_walk / np.sqrt(duration)
    dof = 3 * (count - 1)
    exceeds = dof > 0 and (shown / stated) ** 2 * dof > scipy.special.chdtri(dof, _FALSE_ALARM)
    return Noise(shown if exceeds else float(stated), bool(exceeds))


def bias_sigma(
    stated: float | None, noise: float, shown: float, few: float, least: float = 0.0
) -> Bias:
    """Sigma of a bias: as stated unless the residual disproves it.

    Where nobody states it, `few` times the residual, and `least` at least.
    """
    if stated is None and few * shown < least:
        return Bias(least, f"(no bias is stated, so {least / UG:.0f} µg stand for its sigma)")
    if stated is None:
        note = f"(no bias is stated, so {few:.2f} times that stands for its sigma)"
        return Bias(few * shown, note)
    if shown > SIGNIFICANT * np.hypot(noise, stated):
        return Bias(shown, "(more than the stated errors allow, so the sigmas were enlarged)")
    return Bias(stated, "")
