"""Alignment of a swaying base, in the inertial frame (Wu et al., optimization-based alignment).

Gyros carry the specific force into the body axes of the start, b0, where sway no longer moves it.
Its integral there, and that of the reaction to gravity in the north-east-down axes of the start,
n0, which only the Earth turns,

    alpha(t) = integral of C_b0b f,    beta(t) = -integral of C_n0n g,

differ by a constant rotation, the velocity of the base and that of the start:
``C_n0b0 alpha = beta + v(t) - v(0)``. Gravity draws a cone in inertial space; levelling is its
chord, heading its curvature. The rotation minimises the integral of
``t (T - t) |C alpha - beta + v(0)|^2``. Four choices make it exact and robust:

- v(0) is eliminated: both are taken from their weighted means;
- the weight vanishes at both ends, where a velocity that swings turns the curvature most: a swell
  of period p adds to the heading 4.5 (p/T)^2 of what it would with constant weights and v(0) = 0;
- rates are fitted with the attitude: a drift about north would else tilt it, and lengths are free.
  What the drift has turned since the middle of the window is taken back at its end;
- Davenport's eigenvector squares the condition of the problem, 1/(Omega T). It starts a Newton
  iteration on the same moments, whose vertical and horizontal parts are never mixed in a sum.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from align.accuracy import SensorErrors
from align.errors import AlignmentError
from align.result import Contribution, Convergence
from align.wahba import davenport_matrix
from earth._jit import formula, kernel
from earth.ellipsoid import WGS84, Ellipsoid
from earth.gravity import normal_gravity_n
from earth.rates import omega_ie_n
from earth.rotation import (
    cross,
    dcm_from_quat,
    quat_from_dcm,
    quat_from_rotvec,
    quat_product,
    quat_rotate,
    rotation_factors,
    rotvec_from_quat,
    rotvec_to_quat_change,
)
from earth.summation import compensated_sum
from earth.units import DEG

Array = NDArray[np.float64]

SHORTEST = 10.0  # s
LONGEST = 2.0  # s, of an interval: five of them in the shortest window
MAX_LATITUDE = 89.0 * DEG
_FIRST, _RATIO, _MARKS = 10.0, 1.1, 128  # s of the first mark; of each to the last; three weeks
_NEWTON = 4  # steps; three reach rounding from where Davenport starts
_LEAST_FORCE = 0.5  # of gravity

# What a block hands to the next: t and what its sum lost, alpha (3) likewise, q_b0b (4), the next
# mark and the number of those made.
_CARRY = 14
# Moments, for each of the weights t dt and t^2 dt: 1; alpha; beta; alpha beta^T; beta beta^T;
# |alpha|^2.
_ONE, _ALPHA, _BETA, _CROSS, _GRAVITY, _SQUARE = 0, 1, 4, 7, 16, 25
_MOMENTS = 26
# Beyond the quadratic: the weight times the next two polynomials orthogonal under it, in powers 1
# to 6 of v = t/T, with slopes of 1 at the ends; and the integrals that give them their variance by
# white noise of gyros (per g^2 T^3) and accelerometers (per T).
_POWERS = 6
_BEYOND = np.array([[1.0, -10.0, 30.0, -35.0, 14.0, 0.0], [1.0, -15.0, 70.0, -140.0, 126.0, -42.0]])
_BEYOND_ARW = np.array([1.0 / 6486480.0, 1.0 / 36756720.0])
_BEYOND_VRW = np.array([1.0 / 120120.0, 1.0 / 360360.0])
_SHOWS = 3.32  # mean square of four, in sigmas, that noise exceeds in one window of a hundred


@formula
def reaction_to_gravity(g, rate, t):
    """Return beta: minus the integral over `t` of gravity in axes that stay as n began.

    `g` and `rate` are gravity and Earth rate in n, constant there.
    """
    angle = (t * rate[0], t * rate[1], t * rate[2])
    a, b = rotation_factors(angle[0] * angle[0] + angle[1] * angle[1] + angle[2] * angle[2])
    once = cross(angle, (g[0], g[1], g[2]))
    twice = cross(angle, once)
    return (
        -t * (g[0] + (a * once[0] + b * twice[0])),
        -t * (g[1] + (a * once[1] + b * twice[1])),
        -t * (g[2] + (a * once[2] + b * twice[2])),
    )


@kernel
def _accumulate(g, rate, dts, phis, dvs, carry, sums, lost, powers, row, marks):
    """Add a block to the moments (2, 26) and to those of t^k (6, 6); note them at each mark."""
    t, lost_t = carry[0], carry[1]
    x, y, z = carry[2], carry[3], carry[4]
    lost_x, lost_y, lost_z = carry[5], carry[6], carry[7]
    q = (carry[8], carry[9], carry[10], carry[11])
    next_mark, made = carry[12], int(carry[13])
    for k in range(dts.shape[0]):
        dt = dts[k]
        dv = quat_rotate(q, (dvs[k, 0], dvs[k, 1], dvs[k, 2]))
        x, lost_x = compensated_sum(x, lost_x, dv[0])
        y, lost_y = compensated_sum(y, lost_y, dv[1])
        z, lost_z = compensated_sum(z, lost_z, dv[2])
        turn = rotvec_to_quat_change((phis[k, 0], phis[k, 1], phis[k, 2]))
        excess = 0.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
        change = quat_product(q, (turn[0] + excess, turn[1], turn[2], turn[3]))
        q = (q[0] + change[0], q[1] + change[1], q[2] + change[2], q[3] + change[3])
        t, lost_t = compensated_sum(t, lost_t, dt)

        alpha = (x, y, z)
        beta = reaction_to_gravity(g, rate, t)
        row[_ONE] = 1.0
        for i in range(3):
            row[_ALPHA + i] = alpha[i]
            row[_BETA + i] = beta[i]
            for j in range(3):
                row[_CROSS + 3 * i + j] = alpha[i] * beta[j]
                row[_GRAVITY + 3 * i + j] = beta[i] * beta[j]
        row[_SQUARE] = x * x + y * y + z * z
        weight = dt
        for j in range(_POWERS):
            weight *= t
            if j < 2:
                for i in range(_MOMENTS):
                    sums[j, i], lost[j, i] = compensated_sum(
                        sums[j, i], lost[j, i], weight * row[i]
                    )
            for i in range(6):
                powers[j, i] += weight * row[_ALPHA + i]

        if t >= next_mark and made < marks.shape[0]:
            marks[made, 0] = t
            for i in range(4):
                marks[made, 1 + i] = q[i]
            for j in range(2):
                for i in range(_MOMENTS):
                    marks[made, 5 + _MOMENTS * j + i] = sums[j, i]
            made += 1
            while next_mark <= t:
                next_mark *= _RATIO
    carry[0], carry[1] = t, lost_t
    carry[2], carry[3], carry[4] = x, y, z
    carry[5], carry[6], carry[7] = lost_x, lost_y, lost_z
    carry[8], carry[9], carry[10], carry[11] = q
    carry[12], carry[13] = next_mark, made


class _Fit(NamedTuple):
    """Of windows from the start to `t`, shape (k,)."""

    t: Array
    C_mb0: Array  # (k, 3, 3), m: n in the middle of the window
    north: Array  # measured Earth rate along north, relative excess
    force: Array  # measured gravity, relative excess
    gap: Array
    velocity: Array  # m/s, rms


def _turns(phi: ArrayLike) -> Array:
    return dcm_from_quat(quat_from_rotvec(phi))


def _davenport(B: Array) -> tuple[Array, Array]:
    """Return the rotations that maximise tr(C B^T), and the eigenvalues, ascending."""
    values, vectors = np.linalg.eigh(davenport_matrix(B))
    return dcm_from_quat(vectors[..., :, 3]), values


def _lengths(P: Array, M: Array) -> tuple[Array, Array]:
    """Return by how much the curvature (beyond the chord) and the chord are too long, relative."""
    force = (P[:, 0, 0] + P[:, 2, 2]) / (M[:, 0, 0] + M[:, 2, 2]) - 1.0
    return P[:, 1, 1] / M[:, 1, 1] - 1.0 - force, force


def _fit(t: Array, sums: Array, rate: Array) -> _Fit:
    """Solve windows, shape (k,), from their moments, shape (k, 2, 26)."""
    m = t[:, None] * sums[:, 0] - sums[:, 1]
    one = m[:, _ONE]
    a, b = m[:, _ALPHA:_BETA], m[:, _BETA:_CROSS]
    to_middle = _turns(-0.5 * t[:, None] * rate)
    back = np.swapaxes(to_middle, 1, 2)
    per_one = 1.0 / one[:, None, None]
    # sums of alpha beta^T and beta beta^T about the means, beta in m
    S = (m[:, _CROSS:_GRAVITY].reshape(-1, 3, 3) - per_one * a[:, :, None] * b[:, None, :]) @ back
    M = m[:, _GRAVITY:_SQUARE].reshape(-1, 3, 3) - per_one * b[:, :, None] * b[:, None, :]
    M = to_middle @ M @ back
    square = m[:, _SQUARE] - np.sum(a * a, axis=1) / one
    C, values = _davenport(np.swapaxes(S, 1, 2))
    for _ in range(_NEWTON):
        P = C @ S
        north, force = _lengths(P, M)
        # each element of P has the digits of its own size: differences of large ones are avoided
        off = np.stack(
            [
                P[:, 2, 1] - P[:, 1, 2] + north * M[:, 1, 2],
                P[:, 0, 2] - P[:, 2, 0],
                P[:, 1, 0] - P[:, 0, 1] - north * M[:, 1, 0],
            ],
            axis=-1,
        )
        J = -P
        for i in range(3):
            J[:, i, i] = P[:, i - 1, i - 1] + P[:, i - 2, i - 2]
        C = _turns(-np.linalg.solve(J, off[:, :, None])[:, :, 0]) @ C
    P = C @ S
    north, force = _lengths(P, M)
    stretch, trace = 1.0 + force, np.trace(M, axis1=1, axis2=2)
    rest = square + stretch * (stretch * trace - 2.0 * np.trace(P, axis1=1, axis2=2))
    rest += north * ((2.0 * stretch + north) * M[:, 1, 1] - 2.0 * P[:, 1, 1])
    largest = square + trace - 2.0 * values[:, 0]
    return _Fit(
        t=t,
        C_mb0=C,
        north=north / stretch,
        force=force,
        gap=2.0 * (values[:, 3] - values[:, 2]) / largest,
        velocity=np.sqrt(np.maximum(rest, 0.0) / one),
    )


def _attitudes(fit: _Fit, t: Array, q_b0b: Array, rate: Array) -> Array:
    """Return C_nb (k, 3, 3) at `t`, the drift about north since mid-window taken back."""
    since = (t - 0.5 * fit.t)[:, None]
    drift = since * fit.north[:, None] * np.array([rate[0], 0.0, 0.0])
    C: Array = _turns(-drift) @ _turns(-since * rate) @ fit.C_mb0 @ dcm_from_quat(q_b0b)
    return C


class _Variances(NamedTuple):
    """Of one kind of error, rad^2: each tilt, azimuth, and how they go together."""

    source: str
    tilt: Array
    azimuth: Array
    north_down: Array
    east_down: Array


def _variances(
    t: Array, errors: SensorErrors, swing: float, lat: float, g: float, omega: float
) -> tuple[_Variances, ...]:
    """Closed forms for windows of `t` seconds; what is not stated counts as zero.

    With v = t/T, q = v (1 - v), the rate of tilt is found from tilts with the weights
    k = -140 d(q^3)/dv, hence from gyro noise with 140 q^3; the tilt at the end with 30 q^2 + k/2.
    The factors are integrals of squares and products of these. A velocity that swings counts by
    the slopes of the weights on it at the ends alone, 840 and 840, 360 and 480; `swing` is its
    root mean square over the square of its angular frequency, m s.
    """
    level, tan, none = omega * np.cos(lat), np.tan(lat), np.zeros_like(t)
    bg, ba, arw, vrw = (
        (x or 0.0) ** 2 for x in (errors.gyro_bias, errors.accel_bias, errors.arw, errors.vrw)
    )
    ba, vrw, motion = ba / g**2, vrw / g**2, (swing / g) ** 2 / t**6
    return (
        _Variances("accelerometer bias", none + ba, none + tan**2 * ba, none - tan * ba, none),
        _Variances(
            "accelerometer noise",
            600.0 / 77.0 * vrw / t,
            280.0 / 11.0 * vrw / (t**3 * level**2),
            none,
            140.0 / 11.0 * vrw / (t**2 * level),
        ),
        _Variances("gyro bias", none, none + bg / level**2, none, none),
        _Variances(
            "gyro noise",
            300.0 / 1001.0 * arw * t,
            700.0 / 429.0 * arw / (t * level**2),
            none,
            none + 271.0 / 858.0 * arw / level,
        ),
        _Variances(
            "motion of the base",
            (360.0**2 + 480.0**2) * motion,
            2.0 * 840.0**2 * motion / (t * level) ** 2,
            none,
            840.0 * (360.0 + 480.0) * motion / (t * level),
        ),
    )


def _swing(fit: _Fit, powers: Array, errors: SensorErrors, g: float, rate: Array) -> float:
    """Return what the base's velocity shows beyond the noise, rms over its frequency squared, m s.

    A velocity that swings leaks into the polynomials beyond the quadratic by the slopes of their
    weights at the ends, as into the quadratic itself.
    """
    T, C = float(fit.t[-1]), fit.C_mb0[-1]
    per_power = _BEYOND / T ** np.arange(2, _POWERS + 2)
    beta = powers[:, 3:] @ _turns(-0.5 * T * rate).T
    beyond = per_power @ (powers[:, :3] @ C.T - (1.0 + fit.force[-1]) * beta)[:, :2]
    arw, vrw = ((x or 0.0) ** 2 for x in (errors.arw, errors.vrw))
    noise = g**2 * T**3 * arw * _BEYOND_ARW + T * vrw * _BEYOND_VRW
    squares = np.mean(beyond**2, axis=1)
    if np.all(noise > 0.0) and np.mean(squares / noise) < _SHOWS:
        return 0.0
    # of the two ends, T^2 of the normalised time
    return float(T**2 * np.sqrt(0.5 * max(np.mean(squares - noise), 0.0)))


@dataclass(frozen=True, eq=False)
class InertialSolution:
    """Attitude of a base that sways, at the end of the window.

    Attributes
    ----------
    q_nb : ndarray, shape (4,)
    P_n : ndarray, shape (3, 3)
        Covariance of the small rotation of ``C_hat C^T`` about north, east, down, rad^2.
    budget : tuple of Contribution
    convergence : Convergence
        From 10 s on, each time a tenth later; each attitude beside that of the whole window at
        the same instant.
    gap : float
        Of Davenport's matrix, smallest eigenvalue to next over largest.
    velocity_rms : float
        m/s, weighted rms of the velocity of the base about its mean, a part that grows as t or
        t^2 taken off: decimetres per second at a berth, metres per second when the base leaves
        its place. A velocity that stays the same all along does not show.
    specific_force_residual : float
        Mean specific force minus gravity, m/s^2.
    rate_residual_north : float
        Measured minus expected Earth rate along north, rad/s.
    duration : float
        s.
    """

    q_nb: Array
    P_n: Array
    budget: tuple[Contribution, ...]
    convergence: Convergence
    gap: float
    velocity_rms: float
    specific_force_residual: float
    rate_residual_north: float
    duration: float


class InertialFrame:
    """Streaming alignment of a base that sways about a fixed place.

    Memory does not grow with the window, and the solution does not depend, bit for bit, on where
    blocks end.

    Parameters
    ----------
    lat, h : float
        Geodetic latitude, rad, and height above the ellipsoid, m.
    errors : SensorErrors, optional
        Stated 1-sigma errors. An amount not stated counts as zero; noise not stated is then taken
        for motion of the base, as which it counts for less: state measured densities.
    ellipsoid : Ellipsoid

    Raises
    ------
    AlignmentError
        Within 1° of a pole.

    Notes
    -----
    Exact increments, still or swaying about the IMU, give the attitude within 1e-9 rad from 30 s
    on up to latitude ±80° (`tests/align/test_inertial_frame.py`).

    Sigmas, T the window and W the level Earth rate: heading ``sqrt(700/429 ARW^2/T + 280/11
    VRW^2/(g^2 T^3))/W``, and by biases ``-b_gE/W + tan(lat) b_aE/g`` as for TRIAD; tilt at the
    end ``sqrt(300/1001 ARW^2 T + 600/77 VRW^2/(g^2 T))``, and by biases ``-b_aE/g, b_aN/g``.
    What the velocity of the base adds is read off the third and fourth polynomials in time, as
    far as they exceed the stated noise; it falls as T^-4 in heading. All are first-order: in
    Omega T, in what gyro errors turn over the window, and for a base that keeps its mean heading.
    A velocity linear or quadratic in time from the first interval to the last is taken for a tilt
    and a heading, and a constant one is not felt at all.
    """

    def __init__(
        self,
        lat: float,
        h: float,
        *,
        errors: SensorErrors | None = None,
        ellipsoid: Ellipsoid = WGS84,
    ) -> None:
        if not abs(lat) <= MAX_LATITUDE:
            raise AlignmentError(
                f"latitude {lat / DEG:.4f}° is within 1° of a pole, where gyros find no north; "
                "give a heading from survey"
            )
        self._lat, self._errors = float(lat), errors or SensorErrors()
        self._g, self._rate = normal_gravity_n(lat, h, ellipsoid), omega_ie_n(lat, ellipsoid)
        self._omega = ellipsoid.omega
        self._carry = np.zeros(_CARRY)
        self._carry[8], self._carry[12] = 1.0, _FIRST
        self._sums, self._lost = np.zeros((2, 2, _MOMENTS))
        self._powers, self._row = np.zeros((_POWERS, 6)), np.empty(_MOMENTS)
        self._marks = np.empty((_MARKS, 5 + 2 * _MOMENTS))

    def add(self, dt: ArrayLike, phi: ArrayLike, dv: ArrayLike) -> None:
        """Take the next intervals in.

        Parameters
        ----------
        dt : array_like, shape (n,)
            s.
        phi : array_like, shape (n, 3)
            Rotation vector from b at the start to b at the end of the interval, rad.
        dv : array_like, shape (n, 3)
            Integral of the specific force, resolved in b at the start of the interval, m/s.
        """
        dt, phi, dv = (np.ascontiguousarray(x, np.float64) for x in (dt, phi, dv))
        if dt.ndim != 1 or phi.shape != (len(dt), 3) or dv.shape != (len(dt), 3):
            raise ValueError(
                f"dt, phi and dv must have shapes (n,), (n, 3), (n, 3), got {dt.shape}, "
                f"{phi.shape}, {dv.shape}"
            )
        if dt.size and not dt.max() <= LONGEST:
            raise ValueError(f"intervals must be at most {LONGEST} s, got {dt.max()}")
        _accumulate(
            self._g,
            self._rate,
            dt,
            phi,
            dv,
            self._carry,
            self._sums,
            self._lost,
            self._powers,
            self._row,
            self._marks,
        )

    def solution(self, errors: SensorErrors | None = None) -> InertialSolution:
        """Attitude after the intervals so far; more may be added and solved again.

        Parameters
        ----------
        errors : SensorErrors, optional
            Instead of those given at the start.

        Raises
        ------
        AlignmentError
            After less than 10 s, and where the specific force does not hold gravity.
        """
        end = float(self._carry[0])
        if not end >= SHORTEST:
            raise AlignmentError(
                f"{end:.1f} s of data are too few to see gravity turn with the Earth; give "
                f"{SHORTEST:.0f} s at least, minutes for a useful heading"
            )
        g, felt = float(np.linalg.norm(self._g)), float(np.linalg.norm(self._carry[2:5])) / end
        if not felt > _LEAST_FORCE * g:
            raise AlignmentError(
                f"the mean specific force is {felt:.3f} m/s², not 9.8: gravity has been removed "
                "from this stream, or it is not in m/s²; give the raw increments in SI units"
            )
        marks = self._marks[: int(self._carry[13])]
        t = np.append(marks[:, 0], end)
        q_b0b = np.vstack([marks[:, 1:5], self._carry[8:12]])
        sums = np.concatenate([marks[:, 5:].reshape(-1, 2, _MOMENTS), self._sums[None]])
        fit = _fit(t, sums, self._rate)
        errors = errors or self._errors
        swing = _swing(fit, self._powers, errors, g, self._rate)
        parts = _variances(t, errors, swing, self._lat, g, self._omega)
        tilt, azimuth, north_down, east_down = (
            sum(getattr(part, name) for part in parts) for name in _Variances._fields[1:]
        )
        C_nb = _attitudes(fit, t, q_b0b, self._rate)
        last = _Fit(*(x[-1:] for x in fit))
        off = C_nb @ np.swapaxes(_attitudes(last, t, q_b0b, self._rate), 1, 2)
        return InertialSolution(
            q_nb=quat_from_dcm(C_nb[-1]),
            P_n=np.array(
                [
                    [tilt[-1], 0.0, north_down[-1]],
                    [0.0, tilt[-1], east_down[-1]],
                    [north_down[-1], east_down[-1], azimuth[-1]],
                ]
            ),
            budget=tuple(
                Contribution(x.source, float(np.sqrt(x.tilt[-1])), float(np.sqrt(x.azimuth[-1])))
                for x in parts
            ),
            convergence=Convergence(
                t, rotvec_from_quat(quat_from_dcm(off)), np.sqrt(tilt), np.sqrt(azimuth)
            ),
            gap=float(fit.gap[-1]),
            velocity_rms=float(fit.velocity[-1]),
            specific_force_residual=g * float(fit.force[-1]),
            rate_residual_north=float(self._rate[0] * fit.north[-1]),
            duration=end,
        )


def inertial_frame(
    dt: ArrayLike,
    phi: ArrayLike,
    dv: ArrayLike,
    lat: float,
    h: float,
    *,
    errors: SensorErrors | None = None,
    ellipsoid: Ellipsoid = WGS84,
) -> InertialSolution:
    """Align a window held in memory; parameters and errors are those of `InertialFrame`."""
    frame = InertialFrame(lat, h, errors=errors, ellipsoid=ellipsoid)
    frame.add(dt, phi, dv)
    return frame.solution()
