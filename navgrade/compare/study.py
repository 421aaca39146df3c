"""One log, navigated in every way: the full engine, flat worlds, and terms removed one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from earth import omega_ie_n
from earth.ellipsoid import WGS84
from earth.geodetic import radii
from earth.gravity import normal_gravity_n
from earth.rates import omega_en_n
from earth.rotation import quat_rotate
from navgrade.alignment import AlignedWindow
from navgrade.compare.growth import Level, Response, fit_power, superposed, turned
from navgrade.compare.result import Axis, Comparison, Group, Growth, Variant
from navgrade.compare.sampling import Difference, States, at_times, difference, in_plane
from navgrade.compare.verdict import verdict
from navgrade.errors import ConfigError, LogError
from navgrade.gaps import Gap, without_gaps
from navgrade.imu import ImuSamples, concatenate
from navgrade.job import Choices, setting, starting_state
from navgrade.logs import ImuLog, Track
from navgrade.mechanization.terms import SPHERE
from navgrade.navigation import BLOCK, TERMS, concatenated, solve
from navgrade.reconstruction import (
    BODY_TERMS,
    DEFAULT,
    RECONSTRUCTIONS,
    BlockForm,
    has_body_terms,
    reconstruct,
    to_increments,
)
from navgrade.site import Site
from navgrade.state import NavState, Trajectory

Array = NDArray[np.float64]
Progress = Callable[[int], None]

EPOCHS = (1.0, 10.0, 60.0, 600.0, 3600.0)  # s
FLAT = {
    "flat-euler": "flat world, Euler",
    "flat-midpoint": "flat world, midpoint",
    "flat-rk4": "flat world, Runge-Kutta 4",
}
FLAT_COMPENSATED = {"flat": "flat world, the sensor's own increments"}
LABELS = {
    "earth-rate": "the Earth's rotation in the attitude",
    "transport-rate": "the transport rate in the attitude",
    "coriolis": "the Coriolis acceleration",
    "ellipsoid": "the ellipsoid's radii",
    "gravity-height": "the change of gravity with height",
    "gravity-latitude": "the change of gravity with latitude",
    "north-gravity": "the north component of gravity",
    "coning": "coning",
    "sculling": "sculling",
    "rotation": "the rotation term of the velocity",
}
SOLUTIONS = 1 + len(FLAT) + len(TERMS)
_CONTEXT = 1.0  # s of samples before the start, for reconstructions that look back
_POINTS = 300  # times spaced evenly in logarithm, and again as many evenly in time
_FIRST = 0.01  # s
_HORIZONTAL: Axis = "horizontal"


class _Truth(NamedTuple):
    """What solutions are compared with."""

    source: str
    time_ns: NDArray[np.int64]
    states: States


def _known(track: Track) -> _Truth:
    """A track that can be compared with: heights, and Unix times that increase.

    Raises
    ------
    LogError
        Where it has not.
    """
    if track.h is None:
        raise LogError(f"the truth {track.source} has no heights (height_m)")
    if track.time_ns is None or not track.is_unix:
        raise LogError(
            f"the truth {track.source} has no Unix times (unix_s or time_ns); say when its time 0 "
            "is, --truth-epoch 2026-01-01T00:00:00Z"
        )
    late = np.flatnonzero(np.diff(track.time_ns) <= 0)
    if late.size:
        raise LogError(f"the truth {track.source} goes back in time after its row {late[0] + 1}")
    nowhere = States.nowhere(len(track))
    v = nowhere.v_eb_n if track.v_eb_n is None else track.v_eb_n
    q = nowhere.q_nb if track.q_nb is None else track.q_nb
    return _Truth(track.source, track.time_ns, States(track.lat, track.lon, track.h, v, q))


@dataclass(frozen=True, eq=False)
class _Drive:
    """What drives the error of each term, along the full engine's solution.

    Attributes
    ----------
    level : Level
        At the start.
    t : ndarray, shape (m,)
        s, from 0 on.
    epochs : ndarray, shape (k,)
    v_eb_n : ndarray, shape (m, 3)
    coriolis : ndarray, shape (m, 3)
        (2 omega_ie + omega_en) x v, m/s^2.
    north_gravity, by_height, by_latitude : ndarray, shape (m,)
        Gravity northward; what the change of height and of latitude change it by, m/s^2.
    omega_ie_n, omega_en_n : ndarray, shape (m, 3)
    scale : ndarray, shape (2,)
        Radii of the ellipsoid over those of the sphere, north and east, less one.
    body : dict of str to ndarray, shape (k, 2)
        Error north and east at the epochs that each of the body stage's terms would leave, m.
    """

    level: Level
    t: Array
    epochs: Array
    v_eb_n: Array
    coriolis: Array
    north_gravity: Array
    by_height: Array
    by_latitude: Array
    omega_ie_n: Array
    omega_en_n: Array
    scale: Array
    body: dict[str, Array]

    def pushed(self, response: Response, driver: Array) -> Array:
        """Horizontal error at the epochs of an acceleration or a velocity, m."""
        return _length(superposed(response, self.t, driver, self.epochs))

    def tilted(self, response: Response, rho: Array) -> Array:
        """Error north and east at the epochs of an attitude error that grows by `rho`, rad/s."""
        level = superposed(response, self.t, rho[:, [1, 0]] * [1.0, -1.0], self.epochs)
        turns = rho[:, 2] * np.gradient(self.t)
        r = cumulative_trapezoid(self.v_eb_n[:, :2], self.t, axis=0, initial=0.0)
        return level + turned(self.t, turns, r, self.v_eb_n[:, :2], self.epochs)


def _length(v: Array) -> Array:
    return np.abs(v) if v.ndim == 1 else np.asarray(np.hypot(v[:, 0], v[:, 1]))


def _flat(d: _Drive) -> Array:
    """The Earth's rate, the way travelled over its curvature, and Coriolis, unaccounted for."""
    v_n, v_e, _ = d.v_eb_n.T
    _, _, omega_d = d.omega_ie_n.T
    curved = np.stack([-v_e, v_n, 0.0 * v_n], axis=-1) / d.level.R
    coriolis = 2.0 * np.stack([-omega_d * v_e, omega_d * v_n], axis=-1)
    return _length(
        d.tilted(d.level.flat_after_tilt, curved - d.omega_ie_n)
        + superposed(d.level.flat_after_push, d.t, coriolis, d.epochs)
    )


# The closed form of each variant: as people read it, for a driver that stays the same; along which
# axis; and as it is computed, for the driver as it was.
_FORMS: dict[str, tuple[str, Axis, Callable[[_Drive], Array]]] = {
    **dict.fromkeys(
        (*FLAT, *FLAT_COMPENSATED), ("|g (Ω cos L e + v/R) t³/6 + Ω×v t²|", "horizontal", _flat)
    ),
    "earth-rate": (
        "R Ω cos L (t − sin(ωₛt)/ωₛ)",
        "horizontal",
        lambda d: _length(d.tilted(d.level.after_tilt, -d.omega_ie_n)),
    ),
    "transport-rate": (
        "v (t − sin(ωₛt)/ωₛ)",
        "horizontal",
        lambda d: _length(d.tilted(d.level.after_tilt, -d.omega_en_n)),
    ),
    "coriolis": (
        "|(2Ω + ω)×v| (1 − cos ωₛt)/ωₛ²",
        "horizontal",
        lambda d: d.pushed(d.level.after_push, d.coriolis),
    ),
    "ellipsoid": (
        "v (M/R₀ − 1) sin(ωₛt)/ωₛ",
        "horizontal",
        lambda d: d.pushed(d.level.after_step, d.v_eb_n[:, :2] * d.scale),
    ),
    "gravity-height": (
        "δg t²/2",
        "vertical",
        lambda d: d.pushed(d.level.flat_after_push, d.by_height),
    ),
    "gravity-latitude": (
        "δg (cosh(√2 ωₛt) − 1)/2ωₛ²",
        "vertical",
        lambda d: d.pushed(d.level.after_lift, d.by_latitude),
    ),
    "north-gravity": (
        "g_N (1 − cos ωₛt)/ωₛ²",
        "horizontal",
        lambda d: d.pushed(d.level.after_push, d.north_gravity),
    ),
    "coning": ("R ε (t − sin(ωₛt)/ωₛ)", "horizontal", lambda d: _length(d.body["coning"])),
    "sculling": ("b (1 − cos ωₛt)/ωₛ²", "horizontal", lambda d: _length(d.body["sculling"])),
    "rotation": ("b (1 − cos ωₛt)/ωₛ²", "horizontal", lambda d: _length(d.body["rotation"])),
}


def compare(
    log: ImuLog,
    site: Site,
    choices: Choices | None = None,
    *,
    truth: Track | None = None,
    duration: float = EPOCHS[-1],
    progress: Progress | None = None,
) -> Comparison:
    """Navigate a log with the full engine, flat worlds, and the engine less one term each.

    In frame n with a free vertical channel, from the site file's state or alignment; where it has
    neither, from the first instant of the truth.

    Parameters
    ----------
    log : ImuLog
        From `navgrade.job.open_log`.
    site : Site
    choices : Choices, optional
        Its frame and vertical channel are not used.
    truth : Track, optional
        What all solutions are compared with; the full engine's solution by default.
    duration : float
        s after the start, at most.
    progress : callable, optional
        Called with the number of solutions done, of `SOLUTIONS` at most.

    Raises
    ------
    ConfigError
        Where nothing says where to start, or the reconstruction has no row for each sample.
    LogError
        Where the truth does not overlap the log.
    NavgradeError
        On whatever prevents the full engine's solution.
    """
    choices = choices or Choices()
    reconstruction = _reconstruction(choices, site)
    if not (np.isfinite(duration) and duration > 0.0):
        raise ConfigError(f"the duration must be positive, got {duration!r} s")
    known = None if truth is None else _known(truth)
    state, aligned = _start(log, site, known)
    imu = _samples(log, state.t, duration)
    at = _times(imu, state.t, known)
    t = at - state.t
    epochs = _epochs(t)
    gaps: list[Gap] = []
    common: dict[str, Any] = {"bridge_gaps": choices.bridge_gaps}
    nav = concatenated(
        list(solve(imu.blocks(BLOCK), state, reconstruction=reconstruction, gaps=gaps, **common))
    )
    full, _ = at_times([nav], state, at)
    reference = full if known is None else _truth_at(known, imu.epoch_ns, at)
    removable = log.kind != "compensated" and has_body_terms(reconstruction)
    body = BODY_TERMS if removable else {}
    terms = {name: what for name, what in TERMS.items() if name in body or name not in BODY_TERMS}
    plan: list[tuple[str, str, Group, dict[str, Any]]] = [
        (name, label, "flat", {"mechanization": name})
        for name, label in (FLAT_COMPENSATED if log.kind == "compensated" else FLAT).items()
    ]
    plan += [
        (
            f"without-{name}",
            f"without {LABELS[name]}",
            "term",
            {"reconstruction": reconstruction, "without": name},
        )
        for name in terms
    ]
    left = _body_errors(imu, state, nav, reconstruction, epochs, body, **common)
    drive = _drive(state, full, t, epochs, left)
    notes = _notes(site, choices, truth)
    notes += [f"the file is damaged: {issue.text}" for issue in log.issues]
    notes += [f"a gap of {gap.length:.3f} s at {gap.start:.3f} s is bridged" for gap in gaps]
    found: list[tuple[str, str, Group, States]] = [
        ("engine", f"Earth frame, {reconstruction}", "engine", full)
    ]
    for done, (name, label, group, choice) in enumerate(plan, start=1):
        if progress:
            progress(done)
        states, ended = at_times(solve(imu.blocks(BLOCK), state, **common, **choice), state, at)
        found.append((name, label, group, states))
        if ended:
            notes.append(f"{label} ended early: {ended}")
    if progress:
        progress(len(plan) + 1)
    place = state.lat, state.lon, state.h
    variants = []
    for name, label, group, states in found:
        apart = difference(states, reference)
        variants.append(
            Variant(
                name, label, group, *apart, in_plane(states, *place), _growth(name, apart, t, drive)
            )
        )
    imu_error = _imu_error(site, aligned, drive.level, full, t)
    return Comparison(
        log=str(log.path),
        topic=log.topic,
        description=f"{log.schema.name}, kind {log.kind}, axes {log.axes}",
        start_ns=imu.epoch_ns + round(state.t * 1e9),
        lat=state.lat,
        lon=state.lon,
        h=state.h,
        reference="the full engine" if truth is None else f"truth {truth.source}",
        t=t,
        epochs=epochs,
        track=in_plane(reference, *place),
        variants=tuple(variants),
        imu_error=None if imu_error is None else imu_error[np.searchsorted(t, epochs)],
        verdict=verdict(t, epochs, variants, imu_error, against_truth=truth is not None),
        notes=tuple(notes),
    )


def _reconstruction(choices: Choices, site: Site) -> str:
    chosen = setting("reconstruction", choices, site, RECONSTRUCTIONS, DEFAULT)
    if isinstance(RECONSTRUCTIONS[chosen], BlockForm):
        raise ConfigError(
            f"compare needs one row for each sample, and {chosen} has one for several; choose "
            f"another reconstruction, such as {DEFAULT}"
        )
    return chosen


def _start(log: ImuLog, site: Site, truth: _Truth | None) -> tuple[NavState, AlignedWindow | None]:
    if truth is None or site.initial is not None or site.window is not None:
        return starting_state(log, site)
    t = (truth.time_ns - log.epoch_ns) * 1e-9
    row = int(np.searchsorted(t, 0.0))
    if row == len(t):
        raise LogError(f"{truth.source} ends before the log begins", file=str(log.path))
    lat, lon, h, v_eb_n, q_nb = truth.states.rows(slice(row, row + 1))
    if not (np.isfinite(v_eb_n).all() and np.isfinite(q_nb).all()):
        lacks = "attitude" if np.isfinite(v_eb_n).all() else "velocity"
        raise ConfigError(
            f"nothing says where to start: {truth.source} has no {lacks}, so the site file needs "
            "[initial], or [site] and [alignment]",
            file=site.file,
        )
    return NavState(lat[0], lon[0], h[0], v_eb_n[0], q_nb[0], float(t[row])), None


def _samples(log: ImuLog, start: float, duration: float) -> ImuSamples:
    """Samples from a moment before `start` to `duration` after it."""
    kept: list[ImuSamples] = []
    for block in log.blocks():
        if block.t[-1] > start - _CONTEXT:
            kept.append(block)
        if block.t[-1] > start + duration:
            break
    if not kept or kept[-1].t[-1] <= start:
        raise LogError(
            f"ends before {start:.3f} s, where navigation would start",
            file=str(log.path),
            topic=log.topic,
        )
    whole = concatenate(kept)
    first, stop = np.searchsorted(whole.t, [start - _CONTEXT, start + duration + 1e-9])
    return whole[int(first) : int(stop)]


def _times(imu: ImuSamples, start: float, truth: _Truth | None) -> Array:
    """Instants to look at, among those of the samples or of the truth."""
    known = imu.t[imu.t > start]
    if truth is not None:
        of_truth = (truth.time_ns - imu.epoch_ns) * 1e-9
        inside = (of_truth > start) & (of_truth <= known[-1] + 1e-6)
        if not inside.any():
            raise LogError(
                f"{truth.source} has nothing between the start of navigation and the end of the "
                f"log: it runs from {of_truth[0]:.3f} s to {of_truth[-1]:.3f} s of the log's time, "
                f"navigation from {start:.3f} s to {known[-1]:.3f} s"
            )
        known = of_truth[inside]
    last = known[-1] - start
    wanted = np.concatenate(
        [
            np.geomspace(min(_FIRST, last), last, _POINTS),
            np.linspace(last / _POINTS, last, _POINTS),
            [epoch for epoch in EPOCHS if epoch < last],
        ]
    )
    after = np.clip(np.searchsorted(known, start + wanted), 1, max(len(known) - 1, 1))
    rows = np.minimum(after, len(known) - 1)
    before = after - 1
    nearer = np.abs(known[before] - start - wanted) < np.abs(known[rows] - start - wanted)
    return np.asarray(known[np.unique(np.where(nearer, before, rows))])


def _epochs(t: Array) -> Array:
    """Of `t`, the nearest to each time to report; and the last, unless it is nearly one of them."""
    rows = [int(np.argmin(np.abs(t - epoch))) for epoch in EPOCHS if epoch <= 1.01 * t[-1]]
    if not rows or t[-1] > 1.2 * t[rows[-1]]:
        rows.append(len(t) - 1)
    return np.asarray(t[np.unique(rows)])


def _truth_at(truth: _Truth, epoch_ns: int, at: Array) -> States:
    return truth.states.rows(np.searchsorted((truth.time_ns - epoch_ns) * 1e-9, at - 1e-9))


def _drive(
    state: NavState, full: States, t: Array, epochs: Array, body: dict[str, Array]
) -> _Drive:
    first = States(
        *(np.array([x]) for x in (state.lat, state.lon, state.h, state.v_eb_n, state.q_nb))
    )
    along = first.then(full)
    v = along.v_eb_n
    ie, en = omega_ie_n(along.lat), omega_en_n(along.lat, along.h, v)
    meridian, transverse = radii(WGS84.params, np.sin(state.lat))
    at_start = float(normal_gravity_n(state.lat, state.h)[2])
    return _Drive(
        level=Level.at(state.lat, state.h),
        t=np.concatenate([[0.0], t]),
        epochs=epochs,
        v_eb_n=v,
        coriolis=np.cross(2.0 * ie + en, v),
        north_gravity=normal_gravity_n(along.lat, along.h)[:, 0],
        by_height=normal_gravity_n(state.lat, along.h)[:, 2] - at_start,
        by_latitude=normal_gravity_n(along.lat, state.h)[:, 2] - at_start,
        omega_ie_n=ie,
        omega_en_n=en,
        scale=(np.array([meridian, transverse]) + state.h) / (SPHERE + state.h) - 1.0,
        body=body,
    )


def _body_errors(
    imu: ImuSamples,
    state: NavState,
    nav: Trajectory,
    reconstruction: str,
    epochs: Array,
    terms: Iterable[str],
    *,
    bridge_gaps: bool,
) -> dict[str, Array]:
    """The error north and east at the epochs that each body term would leave, m."""
    level = Level.at(state.lat, state.h)
    t = nav.t - state.t
    q_nb = np.concatenate([state.q_nb[None, :], nav.q_nb[:-1]])
    v = nav.v_eb_n[:, :2]
    r = cumulative_trapezoid(v, t, axis=0, initial=0.0)
    stops = np.searchsorted(t, epochs - 1e-6) + 1
    bridged = without_gaps(imu.blocks(BLOCK), bridge=bridge_gaps, gaps=[], since=state.t)
    raw = list(to_increments(bridged))
    whole = list(reconstruct(raw, reconstruction))
    errors = {}
    for term in terms:
        added = []
        for full, less in zip(whole, reconstruct(raw, reconstruction, without=term), strict=True):
            added.append(full.phi - less.phi if term == "coning" else full.dv - less.dv)
        in_b = np.concatenate(added)[-len(t) :]
        north, east, down = quat_rotate(tuple(q_nb.T), tuple(in_b.T))
        if term == "coning":
            response, driver, across = (
                level.after_tilt,
                (east, -north),
                turned(t, down, r, v, epochs),
            )
        else:
            response, driver, across = level.after_push, (north, east), np.zeros((len(epochs), 2))
        impulses = np.stack(driver, axis=-1)
        errors[term] = across + [
            response(epoch - t[:stop]) @ impulses[:stop]
            for epoch, stop in zip(epochs, stops, strict=True)
        ]
    return errors


def _growth(name: str, apart: Difference, t: Array, drive: _Drive) -> Growth:
    form = _FORMS.get(name.removeprefix("without-"))
    if form is None:
        formula, axis, predicted = "", _HORIZONTAL, np.full(len(drive.epochs), np.nan)
    else:
        formula, axis, predicted = form[0], form[1], form[2](drive)
    error = _length(apart.position) if axis == "horizontal" else np.abs(apart.position[:, 2])
    return Growth(*fit_power(t, error), formula, predicted, axis)


def _imu_error(
    site: Site, aligned: AlignedWindow | None, level: Level, full: States, t: Array
) -> Array | None:
    """Horizontal error, 1-sigma, m, of the sensor errors the site file states."""
    errors = site.errors
    forms: tuple[tuple[float | None, Callable[[float, Array], Array]], ...] = (
        (errors.gyro_bias, level.by_rate),
        (errors.accel_bias, level.by_acceleration),
        (errors.arw, level.by_rate_noise),
        (errors.vrw, level.by_acceleration_noise),
    )
    parts = [form(value, t) for value, form in forms if value is not None]
    if not parts:
        return None
    variance = 2.0 * np.sum(np.square(parts), axis=0)  # along two axes
    if aligned is not None:
        track = in_plane(full, float(full.lat[0]), float(full.lon[0]), float(full.h[0]))
        variance = variance + (aligned.result.azimuth_sigma * _length(track)) ** 2
    return np.asarray(np.sqrt(variance))


def _notes(site: Site, choices: Choices, truth: Track | None) -> list[str]:
    notes = [] if truth is None else list(truth.notes)
    vertical = choices.vertical or site.vertical
    if vertical not in (None, "free"):
        notes.append(
            f"the vertical channel is free in all solutions, not {vertical!r}: heights diverge"
        )
    return notes
