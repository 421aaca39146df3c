"""Fine alignment of a base at rest: a zero-velocity Kalman filter about a coarse attitude.

A base at rest neither moves nor turns relative to the Earth. What the sensors say it did,

    velocity  v' = C_nb (f_ib_b - b_a) + g_n
    turn      theta' = C_nb (omega_ib_b - b_g) - omega_ie_n

must therefore stay zero but for micro-motion, and where it does not, attitude or biases are off.
The turn is to the gyros what velocity is to the accelerometers; without it (a large
`micro_turn`) the filter is the classical one, whose gyros are judged by the tilt they lead to, and
which finds north more slowly than three vectors do.

The state is the rotation a, velocity v, gyro bias and accelerometer bias in body axes, and turn:
``C_nb = exp(a) C_ref``, linear about a reference attitude that follows the gyros only where the
base is disturbed. The whole window is filtered again about its own result until that moves no
more, so that the coarse attitude leaves no trace, neither as a linearisation nor as data counted
twice: the initial attitude is as good as unknown.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from align.accuracy import SensorErrors
from align.errors import AlignmentError
from align.kalman import consistency, predict_in_place, room, update, update_in_place
from align.result import Convergence, Innovations
from align.static import KnownHeading
from earth._jit import kernel
from earth.ellipsoid import WGS84, Ellipsoid
from earth.gravity import normal_gravity_n
from earth.rates import omega_ie_n
from earth.rotation import dcm_from_quat, quat_from_dcm, quat_from_rotvec, skew
from earth.units import DEG, DEG_PER_H, DEG_PER_RTH, MG, UG_PER_RTHZ

Array = NDArray[np.float64]

UNSTATED_GYRO_BIAS = 10.0 * DEG_PER_H  # rad/s: of the order of the Earth rate, north stays open
UNSTATED_ACCEL_BIAS = 5.0 * MG  # m/s^2
QUIET = 0.005  # micro-motion, where none is stated, over a span's sensor noise: not felt at all
UNTOLD = 0.9  # posterior over prior sigma of a bias the data say nothing about

_TILT = 0.1  # rad, initial sigma: only an accelerometer off by 100 mg tilts so much
_HEADING = np.pi / np.sqrt(3.0)  # rad, initial sigma: that of a heading uniform on the circle
_LEAST_ARW = 1e-6 * DEG_PER_RTH  # rad/sqrt(s), of a perfect gyro
_LEAST_VRW = 1e-3 * UG_PER_RTHZ  # (m/s)/sqrt(s), of a perfect accelerometer
_BLOCKS = 16  # whose means show noise that is not stated
_WHITE = 2.5  # variance of their means over that of white noise, either way: what chance does
_LEAST_SHARE = 0.25  # of it that may be random walk where angle noise seems to explain all
_CLOSE = 1e-6  # rad: a last step this small leaves its square, 1e-12
_PASSES = 8
_SETTLED = 0.01  # sigma: a last step this small is good enough where steps shrink slowly
_SHAKEN = 1e-4  # rad: what the gyros' account of a disturbance may be wrong by
_CURVE = 60  # points
_LEVEL = 1e-6  # cosine of pitch below which a nose has no heading

_NONE, _GAP, _TURNED = -1, 0, 1
_BLOCK = 1024  # rows whose steps are in memory at once

_A, _V, _BG, _BA, _TURN = (slice(i, i + 3) for i in range(0, 15, 3))
_SIZE, _REPORTED = 15, 12


@dataclass(frozen=True, eq=False)
class FineSolution:
    """Attitude, velocity and biases of a base at rest, at the end of the window.

    Attributes
    ----------
    q_nb : ndarray, shape (4,)
    P_n : ndarray, shape (3, 3)
        Covariance of the small rotation ``C_hat C^T`` about north, east, down, rad^2.
    v_eb_n, v_sigma : ndarray, shape (3,)
        Micro-motion left, m/s.
    gyro_bias, gyro_bias_sigma : ndarray, shape (3,)
        Body axes, rad/s.
    accel_bias, accel_bias_sigma : ndarray, shape (3,)
        Body axes, m/s^2.
    P : ndarray, shape (12, 12)
        Covariance of estimate minus truth of rotation, velocity (both NED), gyro bias and
        accelerometer bias (both body).
    innovations : Innovations
        One for each still row: zero turn and zero velocity, 6 degrees of freedom.
    convergence : Convergence
    unobservable : tuple of str
        Biases the data say nothing about: their sigma is the stated one, and attitude pays.
    """

    q_nb: Array
    P_n: Array
    v_eb_n: Array
    v_sigma: Array
    gyro_bias: Array
    gyro_bias_sigma: Array
    accel_bias: Array
    accel_bias_sigma: Array
    P: Array
    innovations: Innovations
    convergence: Convergence
    unobservable: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class _Rows:
    """Spans of a window and what the filter makes of them."""

    dt: Array
    rate: Array
    force: Array
    still: NDArray[np.bool_]
    restart: NDArray[np.int64]  # before the row: `_NONE`, `_GAP`, `_TURNED`
    t: Array

    def __getitem__(self, part: slice) -> _Rows:
        return _Rows(*(getattr(self, field.name)[part] for field in fields(self)))


@dataclass(frozen=True, eq=False)
class _Model:
    """Place, noise and what is known before."""

    rate_n: Array
    gravity_n: Array
    arw: Array  # per axis
    vrw: Array
    micro_turn: float
    micro_motion: float
    gyro_bias: float
    accel_bias: float
    heading: KnownHeading | None


@dataclass(frozen=True, eq=False)
class _Pass:
    """One run over the window: state and covariance at its end, and on the way."""

    x: Array
    P: Array
    t: Array
    nis: Array
    a: Array  # (k, 3)
    variance: Array  # (k, 3)


def fine_align(
    dt: ArrayLike,
    omega_ib_b: ArrayLike,
    f_ib_b: ArrayLike,
    q_nb: ArrayLike,
    lat: float,
    h: float,
    *,
    errors: SensorErrors | None = None,
    still: ArrayLike | None = None,
    t: ArrayLike | None = None,
    heading: KnownHeading | None = None,
    micro_motion: float | None = None,
    micro_turn: float | None = None,
    ellipsoid: Ellipsoid = WGS84,
) -> FineSolution:
    """Refine the attitude of a base at rest, and estimate the biases that show.

    Parameters
    ----------
    dt : array_like, shape (n,)
        s of samples in each span, 0.25 to 1 s or what the window is thinned to.
    omega_ib_b, f_ib_b : array_like, shape (n, 3)
        Means over the spans, body axes, rad/s and m/s^2.
    q_nb : array_like, shape (4,)
        A coarse attitude: within 30° of heading and a few degrees of tilt. How good it is does
        not enter the result.
    lat, h : float
        Geodetic latitude (rad) and ellipsoidal height (m) from the survey.
    errors : SensorErrors, optional
        Stated 1-sigma per axis. A bias not stated is taken as wide (`UNSTATED_GYRO_BIAS`,
        `UNSTATED_ACCEL_BIAS`; state what is worse), a noise not stated as what the window shows.
    still : array_like of bool, shape (n,), optional
        False where the base is disturbed: there the gyros alone carry the attitude, which may
        change, to 0.1 mrad; nothing is concluded from the accelerometers. All are still by
        default.
    t : array_like, shape (n,), optional
        End of each span, s. Where they leave a gap, the base is taken not to have turned.
        By default the spans follow each other.
    heading : KnownHeading, optional
        Of the base before the first span; makes the eastward gyro bias observable.
    micro_motion : float, optional
        1-sigma of the velocity of a base at rest, m/s. By default too small for the
        accelerometers to feel (`QUIET`); 1e-4 in a parked car, 1e-5 is the noisiest ground.
    micro_turn : float, optional
        1-sigma of its angle, rad; angle (quantisation) noise of the gyros may be given as such.
        By default too small for the gyros to feel where `errors` state their noise, else what the
        window shows; 1e-4 in a parked car.
    ellipsoid : Ellipsoid

    Returns
    -------
    FineSolution
        Sigmas are those of errors drawn from the stated ones: 300 simulated windows stay within
        12 % of them (`tests/align/test_fine.py`).

    Raises
    ------
    AlignmentError
        If no span is still, noise is neither stated nor to be seen in so few spans, the heading
        is that of a nose pointing straight up or down, or the coarse attitude is too far off.
    ValueError
        If shapes do not fit or a number is out of range.

    Notes
    -----
    On a fixed base b_aN, b_aE and b_gE are not observable: they tilt and turn the attitude by
    b_a/g and b_gE/(omega_ie cos lat), as in every other method. What the filter adds is the
    covariance with its correlations, the biases that do show (b_gN, b_gD, b_aD; the last holds
    what gravity departs from normal gravity, up to 1 mm/s^2), the attitude through disturbances,
    and innovations that tell whether to believe it.
    """
    rows = _rows(dt, omega_ib_b, f_ib_b, still, t)
    model = _model(rows, errors or SensorErrors(), lat, h, heading, ellipsoid)
    model = replace(
        model,
        micro_motion=_positive("micro_motion", micro_motion, "m/s", model.micro_motion),
        micro_turn=_positive("micro_turn", micro_turn, "rad", model.micro_turn),
    )
    C_end = dcm_from_quat(np.asarray(q_nb, float))
    for _ in range(_PASSES):
        run = _filter(rows, model, _references(rows, model, C_end))
        step = run.x[_A]
        C_end = _turned(step) @ C_end
        if np.linalg.norm(step) < _CLOSE:
            break
    in_sigmas = np.max(np.abs(step) / np.sqrt(np.diag(run.P)[_A]))
    if np.linalg.norm(step) >= _CLOSE and in_sigmas > _SETTLED:
        raise AlignmentError(
            f"fine alignment still turns by {np.linalg.norm(step) / DEG:.3g}°, {in_sigmas:.2g} "
            f"sigma, after {_PASSES} passes: the coarse attitude is too far off, or the Earth rate "
            "and the latitude do not fit; give a heading or a better coarse attitude"
        )
    return _solution(run, model, C_end)


def _rows(
    dt: ArrayLike,
    omega_ib_b: ArrayLike,
    f_ib_b: ArrayLike,
    still: ArrayLike | None,
    t: ArrayLike | None,
) -> _Rows:
    dt, rate, force = (np.asarray(x, float) for x in (dt, omega_ib_b, f_ib_b))
    n = dt.size
    shapes = {"dt": (dt, (n,)), "omega_ib_b": (rate, (n, 3)), "f_ib_b": (force, (n, 3))}
    end = np.cumsum(dt) if t is None else np.asarray(t, float)
    mask = np.ones(n, bool) if still is None else np.asarray(still, bool)
    for name, (values, shape) in {**shapes, "t": (end, (n,)), "still": (mask, (n,))}.items():
        if values.shape != shape:
            raise ValueError(f"{name} must have shape {shape}, got {values.shape}")
        if not np.all(np.isfinite(values)):
            raise ValueError(f"{name} holds a value that is not finite")
    if not np.all(dt > 0.0):
        raise ValueError(f"dt must be positive, row {int(np.argmin(dt > 0.0))} is not")
    if not np.all(np.diff(end) > 0.0):
        raise ValueError(f"t must increase, row {int(np.argmin(np.diff(end) > 0.0)) + 1} does not")
    if not mask.any():
        raise AlignmentError("no span is still: choose another window, or align a swaying base")
    restart = np.full(n, _NONE)
    restart[1:][(np.diff(end) - dt[1:] > 0.5 * dt[1:]) & mask[1:]] = _GAP
    restart[1:][~mask[:-1] & mask[1:]] = _TURNED
    return _Rows(dt=dt, rate=rate, force=force, still=mask, restart=restart, t=end)


def _model(
    rows: _Rows,
    errors: SensorErrors,
    lat: float,
    h: float,
    heading: KnownHeading | None,
    ellipsoid: Ellipsoid,
) -> _Model:
    span = float(np.median(rows.dt[rows.still]))
    arw, micro_turn = _noise(rows, rows.rate, "arw", errors.arw, span, _LEAST_ARW)
    vrw, micro_motion = _noise(rows, rows.force, "vrw", errors.vrw, span, _LEAST_VRW)
    return _Model(
        rate_n=omega_ie_n(lat, ellipsoid),
        gravity_n=normal_gravity_n(lat, h, ellipsoid),
        arw=arw,
        vrw=vrw,
        micro_turn=micro_turn,
        micro_motion=micro_motion,
        gyro_bias=_positive("gyro_bias", errors.gyro_bias, "rad/s", UNSTATED_GYRO_BIAS),
        accel_bias=_positive("accel_bias", errors.accel_bias, "m/s²", UNSTATED_ACCEL_BIAS),
        heading=heading,
    )


def _positive(name: str, value: float | None, unit: str, otherwise: float) -> float:
    if value is None:
        return otherwise
    if not 0.0 < value < np.inf:
        raise ValueError(f"{name} must be above 0 {unit}, got {value}")
    return value


def _noise(
    rows: _Rows, values: Array, name: str, stated: float | None, span: float, least: float
) -> tuple[Array, float]:
    """White noise density of each axis, and noise of the integral at each end of a span."""
    if stated is not None:
        density = np.full(3, max(_positive(name, stated, "SI", least), least))
        return density, float(QUIET * density[0] * np.sqrt(span))
    dt, kept = rows.dt[rows.still], values[rows.still]
    if len(dt) < 2 * _BLOCKS:
        raise AlignmentError(
            f"{len(dt)} still spans do not show the sensors' noise, it takes {2 * _BLOCKS}: state "
            f"{name}, or give more or shorter spans"
        )
    # Variance of neighbours' differences: density^2 + 3 ends^2 / length, for spans and for blocks.
    fine = 0.5 * np.mean(np.diff(dt[:, None] * kept, axis=0) ** 2, axis=0) / span
    blocks = np.array_split(np.arange(len(dt)), _BLOCKS)
    means = np.array([dt[b] @ kept[b] / dt[b].sum() for b in blocks])
    length = float(dt.sum()) / _BLOCKS
    rough = 0.5 * np.mean(np.diff(means, axis=0) ** 2, axis=0) * length
    white = np.maximum((rough * length - fine * span) / (length - span), _LEAST_SHARE * rough)
    if fine.sum() / _WHITE < rough.sum() < fine.sum() * _WHITE:
        white = fine  # noise is white, and so many spans show it better
    density = np.sqrt(np.maximum(white, least**2))
    at_ends = np.mean(fine - density**2) * span / 3.0
    quiet = QUIET**2 * np.mean(density**2) * span
    return density, float(np.sqrt(max(at_ends, quiet)))


def _turned(phi: Array) -> Array:
    return dcm_from_quat(quat_from_rotvec(phi))


def _references(rows: _Rows, model: _Model, C_end: Array) -> Array:
    """Reference attitude of each row (n, 3, 3): the gyros turn it where the base is disturbed."""
    C = np.empty((len(rows.dt), 3, 3))
    C_row = C_end
    for k in range(len(rows.dt) - 1, -1, -1):
        C[k] = C_row
        if not rows.still[k]:
            step = rows.dt[k]
            C[k] = _turned(model.rate_n * step) @ C_row @ _turned(-rows.rate[k] * step)
            C_row = C[k]
    return C


def _steps(rows: _Rows, model: _Model, C: Array) -> tuple[Array, Array, Array]:
    """Transition, process noise and known part of each row's step: (n, 15, 15) twice, (n, 15)."""
    n = len(rows.dt)
    F = np.zeros((n, _SIZE, _SIZE))
    F[:, _A, _A] = F[:, _TURN, _A] = -skew(model.rate_n)
    F[:, _A, _BG] = F[:, _TURN, _BG] = -C
    F[:, _V, _A] = skew(model.gravity_n)
    F[:, _V, _BA] = -C
    F *= rows.dt[:, None, None]
    B = np.zeros((_SIZE, 6))
    B[_A, :3] = B[_TURN, :3] = B[_V, 3:] = np.eye(3)
    # Only a span's mean is known: rotation is taken as even over it, noise and all.
    G = B + 0.5 * F @ B
    noise = np.zeros((n, 6, 6))
    noise[:, :3, :3] = C * model.arw * np.sqrt(rows.dt)[:, None, None]
    noise[:, 3:, 3:] = C * model.vrw * np.sqrt(rows.dt)[:, None, None]
    G_noise = G @ noise
    rate = np.einsum("kij,kj->ki", C, rows.rate) - model.rate_n
    force = np.einsum("kij,kj->ki", C, rows.force) + model.gravity_n
    rate[~rows.still] = 0.0  # there the reference turns instead
    felt = np.concatenate((rate, force), axis=1) * rows.dt[:, None]
    return (
        np.eye(_SIZE) + F + 0.5 * F @ F,
        G_noise @ G_noise.transpose(0, 2, 1),
        np.einsum("kij,kj->ki", G, felt),
    )


def _restarts(model: _Model) -> tuple[Array, Array]:
    """Transition and noise (2, 15, 15) that begin velocity and turn anew.

    First for a base that kept its mean attitude, then for one that turned to another.
    """
    anew = np.tile(np.eye(_SIZE), (2, 1, 1))
    anew[:, _V, _V] = anew[:, _TURN, _TURN] = 0.0
    anew[0, _A, _TURN] = -np.eye(3)
    start = np.zeros((2, _SIZE, 9))
    start[:, _V, :3] = model.micro_motion * np.eye(3)
    start[:, _TURN, 3:6] = start[0, _A, 3:6] = model.micro_turn * np.eye(3)
    start[1, _A, 6:] = _SHAKEN * np.eye(3)
    return anew, start @ start.transpose(0, 2, 1)


@kernel
def _run(x, P, still, restart, steps, noises, felt, anew, fresh, H, R, room, nis, found, variance):
    """Filter rows, in place; return the row whose innovation has no covariance, or -1."""
    at_rest = np.zeros(H.shape[0])
    for k in range(still.shape[0]):
        if restart[k] >= 0:
            predict_in_place(x, P, anew[restart[k]], fresh[restart[k]], room)
        predict_in_place(x, P, steps[k], noises[k], room)
        for i in range(x.shape[0]):
            x[i] += felt[k, i]
        if still[k]:
            failed, nis[k] = update_in_place(x, P, at_rest, H, R, room)
            if failed >= 0:
                return k
        for i in range(3):
            found[k, i] = x[i]
            variance[k, i] = P[i, i]
    return -1


def _filter(rows: _Rows, model: _Model, C: Array) -> _Pass:
    """Run the filter about the reference attitudes `C`."""
    anew, fresh = _restarts(model)
    sigma = np.zeros(_SIZE)
    sigma[_A] = _TILT, _TILT, _HEADING
    sigma[_BG], sigma[_BA] = model.gyro_bias, model.accel_bias
    x, P = np.zeros(_SIZE), np.diag(sigma**2) + fresh[1]
    if model.heading is not None:
        x, P = _with_heading(x, P, C[0], model.heading)
    H = np.zeros((6, _SIZE))
    H[:3, _TURN] = H[3:, _V] = np.eye(3)
    R = np.diag(np.repeat([model.micro_turn**2, model.micro_motion**2], 3))
    memory = room(_SIZE, 6)

    n = len(rows.dt)
    nis, found, variance = np.empty(n), np.empty((n, 3)), np.empty((n, 3))
    for first in range(0, n, _BLOCK):
        part = slice(first, first + _BLOCK)
        block = rows[part]
        model_of_rows = (*_steps(block, model, C[part]), anew, fresh, H, R)
        results = nis[part], found[part], variance[part]
        failed = _run(x, P, block.still, block.restart, *model_of_rows, memory, *results)
        if failed >= 0:
            raise AlignmentError(
                f"the innovation of span {first + failed} has no covariance: micro_motion or "
                "micro_turn is too small beside the initial uncertainty; make it larger"
            )
    kept = rows.still
    return _Pass(x, P, rows.t[kept], nis[kept], found[kept], variance[kept])


def _with_heading(x: Array, P: Array, C: Array, known: KnownHeading) -> tuple[Array, Array]:
    """Take in the heading of the nose, to first order about the attitude `C`."""
    nose = C[:, 0]
    level = float(np.hypot(nose[0], nose[1]))
    if level < _LEVEL:
        raise AlignmentError(
            "the nose points straight up or down, where a heading has no meaning: align without one"
        )
    sigma = _positive("heading.sigma", known.sigma, "rad", np.inf)
    off = known.heading - np.arctan2(nose[1], nose[0])
    off -= 2.0 * np.pi * np.rint(off / (2.0 * np.pi))
    H = np.zeros((1, _SIZE))
    H[0, _A] = -nose[2] * nose[0] / level**2, -nose[2] * nose[1] / level**2, 1.0
    taken = update(x, P, np.array([off]), H, np.array([[sigma**2]]))
    return taken.x, taken.P


def _solution(run: _Pass, model: _Model, C_nb: Array) -> FineSolution:
    sigma = np.sqrt(np.diag(run.P))
    shown = np.unique(np.geomspace(1, len(run.t), _CURVE).astype(int)) - 1
    variance = run.variance[shown]
    return FineSolution(
        q_nb=quat_from_dcm(C_nb),
        P_n=run.P[_A, _A],
        v_eb_n=run.x[_V],
        v_sigma=sigma[_V],
        gyro_bias=run.x[_BG],
        gyro_bias_sigma=sigma[_BG],
        accel_bias=run.x[_BA],
        accel_bias_sigma=sigma[_BA],
        P=run.P[:_REPORTED, :_REPORTED],
        innovations=consistency(run.t, run.nis, 6),
        convergence=Convergence(
            t=run.t[shown],
            off=run.a[shown] - run.x[_A],
            tilt_sigma=np.sqrt(0.5 * (variance[:, 0] + variance[:, 1])),
            azimuth_sigma=np.sqrt(variance[:, 2]),
        ),
        unobservable=_unobservable(run.P, C_nb, model),
    )


def _unobservable(P: Array, C_nb: Array, model: _Model) -> tuple[str, ...]:
    """Name the biases along north, east and down whose sigma the data have not reduced."""
    found = []
    for sensor, block, prior in (
        ("gyro", _BG, model.gyro_bias),
        ("accelerometer", _BA, model.accel_bias),
    ):
        left = np.sqrt(np.diag(C_nb @ P[block, block] @ C_nb.T)) / prior
        for axis, share, along in zip(("north", "east", "down"), left, C_nb, strict=True):
            if share > UNTOLD:
                body = [f"{c:+.2f} {b}" for c, b in zip(along, "xyz", strict=True) if abs(c) > 0.1]
                found.append(f"{sensor} bias along {axis} (body {' '.join(body)})")
    return tuple(found)
