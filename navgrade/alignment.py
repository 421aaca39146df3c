"""Alignment of a log: its still stretches, the method for the motion found, the attitude."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from align import (
    METHODS,
    Alignment,
    AlignmentError,
    SensorErrors,
    WeakGyrosError,
    align_fine,
    align_static,
    align_swaying,
    align_together,
)
from align.checks import check_units_at_rest
from align.spans import SpanReducer, Spans, natural_length
from align.stillness import StillReport, Stretch, assess, find_still
from align.window import white_noise
from earth.units import DEG, DEG_PER_H, DEG_PER_RTH, UG, UG_PER_RTHZ
from navgrade import reconstruction as body
from navgrade.errors import ConfigError, GapError
from navgrade.gaps import Gap, without_gaps
from navgrade.imu import ImuSamples
from navgrade.logs import ImuLog
from navgrade.reconstruction import reconstruct, to_increments
from navgrade.site import Place, Site, Window, place_of_imu
from navgrade.state import NavState

Array = NDArray[np.float64]
Progress = Callable[[int], None]

_EDGE = 1e-9  # s
_LEFT_OUT = 0.1  # of a window that may lack samples
_ANOTHER = 5.0 * DEG  # between two orientations


@dataclass(frozen=True, eq=False)
class Trace:
    """What the log shows over time, one row per span.

    Attributes
    ----------
    t : ndarray, shape (m,)
        End of the span, s from the first sample.
    rate, force : ndarray, shape (m,)
        Distance of its means from those of the stretch used, rad/s and m/s^2.
    kept : ndarray of bool, shape (m,)
    """

    t: Array
    rate: Array
    force: Array
    kept: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class AlignedWindow:
    """An alignment and the samples it came from.

    Attributes
    ----------
    result : Alignment
    start, duration : float
        s; start from the first sample.
    state : NavState or None
        At the end of the window; None where only the level was found.
    still : StillReport
        The stretches found, of the log or of the site file's window.
    chosen : int or None
        Which of them was used; None where the window was too short to look for any.
    trace : Trace
    """

    result: Alignment
    start: float
    duration: float
    state: NavState | None
    still: StillReport
    chosen: int | None
    trace: Trace


@dataclass(frozen=True, eq=False)
class _Part:
    """The part of a log an alignment may use, as spans, and what is still of it."""

    log: ImuLog
    spans: Spans
    still: StillReport
    first: float
    last: float
    head: ImuSamples

    def stretch(self, chosen: int | None) -> Stretch | None:
        return None if chosen is None else self.still.stretches[chosen]

    def stretch_rows(self, chosen: int | None) -> NDArray[np.bool_]:
        """Spans of a stretch that are kept; all of them without one."""
        stretch = self.stretch(chosen)
        return np.ones(len(self.spans), bool) if stretch is None else stretch.rows

    def sways(self, chosen: int | None) -> bool:
        stretch = self.stretch(chosen)
        return stretch is not None and stretch.motion == "swaying"

    def bounds(self, chosen: int | None) -> tuple[float, float]:
        """Start and end, s; the window's own where the stretch reaches them."""
        stretch = self.stretch(chosen)
        if stretch is None:
            return self.first, self.last
        return max(stretch.start, self.first), min(stretch.stop, self.last)


def align_log(
    log: ImuLog,
    site: Site,
    method: str | None = None,
    *,
    leave_rest: bool = False,
    level_allowed: bool = False,
    progress: Progress | None = None,
) -> AlignedWindow:
    """Align on the site file's window, or on the best still stretch of the log.

    Parameters
    ----------
    log : ImuLog
    site : Site
    method : str, optional
        Of `align.METHODS`; by default the site file's, else ``auto``.
    leave_rest : bool
        Choose no stretch that ends with the log: something is to be navigated after it.
    level_allowed : bool
        Where the gyros are too weak to find north, give the level alone.
    progress : callable, optional
        Called with bytes of the log read.

    Raises
    ------
    ConfigError
        When the site file has no [site], or the method is unknown.
    AlignmentError
        When nothing gives an attitude.
    """
    try:
        return _align(log, site, method, leave_rest, level_allowed, progress)
    except AlignmentError as error:
        if not log.issues:
            raise
        raise type(error)(f"{error}; the file is damaged: {log.issues[0].text}") from None


def _align(
    log: ImuLog,
    site: Site,
    method: str | None,
    leave_rest: bool,
    level_allowed: bool,
    progress: Progress | None,
) -> AlignedWindow:
    place = _place(site)
    method = chosen_method(site, method)
    part = _part(log, site, place.lat, progress)
    if method == "multi-position":
        return _together([part], site, place)[-1]
    chosen = _best(part, site, place, leave_rest)
    try:
        return _aligned(part, chosen, site, place, method)
    except WeakGyrosError as error:
        if not level_allowed or method != "auto" or part.sways(chosen):
            raise
        found = _aligned(part, chosen, site, place, "level")
        result = replace(
            found.result,
            reason="the gyros are too weak",
            warnings=(str(error), *found.result.warnings),
        )
        return replace(found, result=result)


def chosen_method(site: Site, method: str | None) -> str:
    """The command line's method, else the site file's, else ``auto``; checked."""
    value = method or site.method or "auto"
    if value not in METHODS:
        raise ConfigError(
            f"{'--method' if method else 'alignment.method'}: {value!r} is not one of "
            f"{', '.join(METHODS)}",
            file=None if method else site.file,
            key="alignment.method",
        )
    return value


def _place(site: Site) -> Place:
    if site.place is None:
        raise ConfigError(
            "alignment needs [site] (latitude, longitude, height_m)", file=site.file, key="site"
        )
    return site.place


def _between(
    log: ImuLog, start: float, stop: float, progress: Progress | None = None
) -> Iterator[tuple[ImuSamples, ImuSamples]]:
    """Samples whose intervals end inside a window, each with its block; nothing is read beyond."""
    for block in log.blocks(progress):
        first, last = np.searchsorted(block.t, [start, stop + _EDGE], side="right")
        yield block[int(first) : int(last)], block
        if block.t[-1] > stop:
            return


def _part(log: ImuLog, site: Site, lat: float, progress: Progress | None) -> _Part:
    """Reduce the site file's window, or the whole log, to spans, and find what is still."""
    window = site.window or Window(0.0, np.inf)
    start, stop = window.start, window.start + window.duration
    reducer: SpanReducer | None = None
    head: ImuSamples | None = None
    covered = nominal = 0.0
    for samples, block in _between(log, start, stop, progress):
        head = block if head is None else head
        last = float(block.t[-1])
        if not len(samples):
            continue
        if reducer is None:
            nominal = float(np.median(samples.dt))
            reducer = SpanReducer(natural_length(samples.dt))
            first = float(samples.t[0] - samples.dt[0])
        reducer.add(samples.t, samples.dt, *samples.mean_rates())
        covered += float(samples.dt.sum())
        end = float(samples.t[-1])
    if head is None:
        raise AlignmentError("the log holds no samples")
    if site.window is not None and last < stop - 1e-3:
        check_units(block, lat)
        raise AlignmentError(
            f"the alignment window runs from {start:g} s to {stop:g} s, the log ends at "
            f"{last:.3f} s; change alignment.start_s and duration_s"
        )
    if reducer is None:
        raise AlignmentError(f"the alignment window from {start:g} s to {stop:g} s has no samples")
    missing = window.duration - covered
    if site.window is not None and missing > max(3.0 * nominal, _LEFT_OUT * window.duration):
        raise AlignmentError(
            f"{missing:.3f} s of the alignment window have no samples; choose another window"
        )
    spans = reducer.finish()
    options = {} if site.false_alarm is None else {"false_alarm": site.false_alarm}
    return _Part(log, spans, find_still(spans, **options), first, end, head)


def check_units(samples: ImuSamples, lat: float) -> None:
    """Refuse samples at rest whose means only a wrong unit or a processed stream explains.

    Raises
    ------
    AlignmentError
    """
    omega, f = (samples.dt @ rates / samples.dt.sum() for rates in samples.mean_rates())
    check_units_at_rest(omega, f, lat)


def _best(part: _Part, site: Site, place: Place, leave_rest: bool) -> int | None:
    """The stretch whose mean rate has the least noise; None where the whole window is taken.

    Where the rest is to be navigated, the first one with up to twice that noise, so that little
    of the log is passed over.
    """
    stretches = part.still.stretches
    candidates = [
        i
        for i, stretch in enumerate(stretches)
        if not leave_rest or stretch.stop < part.last - _EDGE or site.window is not None
    ]
    if candidates:
        noise = {i: _rms(stretches[i].arw) / np.sqrt(stretches[i].duration) for i in candidates}
        least = min(noise.values())
        return next(i for i in candidates if noise[i] <= (2.0 if leave_rest else 1.0) * least)
    if site.window is not None:
        return None
    check_units(part.head, place.lat)
    if stretches:
        raise AlignmentError(
            f"the only still stretch, from {stretches[0].start:.1f} s to {stretches[0].stop:.1f} "
            "s, ends with the log and leaves nothing to navigate; name an earlier window with "
            "alignment.start_s and duration_s, or give [initial]"
        )
    raise AlignmentError(
        "no stretch of the log is still for 10 s; give [initial] instead of "
        "[alignment], or a log with a stop"
    )


def _aligned(
    part: _Part, chosen: int | None, site: Site, place: Place, method: str
) -> AlignedWindow:
    """Align on one stretch with one method."""
    stretch, rows = part.stretch(chosen), part.stretch_rows(chosen)
    start, stop = part.bounds(chosen)
    means = _means(part.spans[rows])
    sways = part.sways(chosen)
    if method == "inertial" or (sways and method == "auto"):
        errors, warnings = _measured(site.errors, stretch, means)
        result = align_swaying(
            _increments(part.log, start, stop),
            place.lat,
            place.h,
            errors=errors,
            stillness=assess(*means),
            reason="the base sways, and no mean stands still" if sways else "as chosen",
        )
        result = replace(result, warnings=(*warnings, *result.warnings))
    elif method == "fine":
        inside = (part.spans.end > start + _EDGE) & (part.spans.start < stop - _EDGE)
        whole = part.spans[inside]
        result = align_fine(
            *_means(whole),
            place.lat,
            place.h,
            errors=site.errors,
            known_heading=place.heading,
            still=rows[inside],
            t=whole.end - start,
            lon=place.lon,
        )
    else:
        result = align_static(
            *means,
            place.lat,
            place.h,
            errors=site.errors,
            known_heading=place.heading,
            method=method,
            lon=place.lon,
        )
    return _window_of(part, chosen, result, place, start, stop, rows)


def _means(spans: Spans) -> tuple[Array, Array, Array]:
    return spans.dt, spans.omega_ib_b, spans.f_ib_b


def _measured(
    errors: SensorErrors, stretch: Stretch | None, means: tuple[Array, Array, Array]
) -> tuple[SensorErrors, tuple[str, ...]]:
    """The stated errors, and the noise the data show where none is stated; a warning about it."""
    if errors.arw is not None and errors.vrw is not None:
        return errors, ()
    warnings: tuple[str, ...] = ()
    if stretch is None or stretch.motion == "still":
        arw, vrw = white_noise(*means)
    else:
        arw = min(_rms(stretch.arw), _rms(stretch.arw_1s))
        vrw = min(_rms(stretch.vrw), _rms(stretch.vrw_1s))
        warnings = (
            "noise of the sensors is not stated, and on a base that sways its motion counts as "
            "noise: the sigmas are upper bounds; state imu.errors.arw_deg_rth and vrw_ug_rthz",
        )
    return replace(errors, arw=errors.arw or arw, vrw=errors.vrw or vrw), warnings


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _increments(log: ImuLog, start: float, stop: float) -> Iterator[tuple[Array, Array, Array]]:
    """Body increments of a part of the log, coning and sculling compensated."""
    gaps: list[Gap] = []
    inside = (samples for samples, _ in _between(log, start, stop) if len(samples))
    whole = without_gaps(inside, bridge=False, gaps=gaps)
    try:
        for increments in reconstruct(to_increments(whole), body.DEFAULT):
            yield increments.dt, increments.phi, increments.dv
    except GapError as error:
        raise AlignmentError(
            f"samples are missing from {error.time_s:.3f} s on, and gyros that lose the body "
            "cannot carry its attitude; choose a window without a gap, or a static method"
        ) from None


def _window_of(
    part: _Part,
    chosen: int | None,
    result: Alignment,
    place: Place,
    start: float,
    stop: float,
    rows: NDArray[np.bool_],
) -> AlignedWindow:
    spans = part.spans
    used = spans[rows]
    weight = used.dt / used.dt.sum()
    trace = Trace(
        spans.end,
        np.linalg.norm(spans.omega_ib_b - weight @ used.omega_ib_b, axis=1),
        np.linalg.norm(spans.f_ib_b - weight @ used.f_ib_b, axis=1),
        rows,
    )
    state = None
    if np.all(np.isfinite(result.q_nb)):
        there = place_of_imu(place, result.q_nb)
        state = NavState(lat=there.lat, lon=there.lon, h=there.h, q_nb=result.q_nb, t=stop)
    return AlignedWindow(result, start, stop - start, state, part.still, chosen, trace)


def align_logs(
    logs: Sequence[ImuLog], site: Site, progress: Progress | None = None
) -> list[AlignedWindow]:
    """Align several still orientations together: one log each, or the stretches of one log.

    Raises
    ------
    ConfigError, AlignmentError
        As `align_log`, and where there are fewer than two orientations.
    """
    place = _place(site)
    parts = [_part(log, site, place.lat, progress) for log in logs]
    return _together(parts, site, place)


def _together(parts: Sequence[_Part], site: Site, place: Place) -> list[AlignedWindow]:
    chosen = [(part, i) for part in parts for i in _orientations(part)]
    if len(chosen) < 2:
        raise AlignmentError(
            "multi-position alignment takes two still orientations or more, and one was found; "
            "give several logs, or a log in which the IMU is turned between stops"
        )
    rows = [part.stretch_rows(i) for part, i in chosen]
    means = [_means(part.spans[kept]) for (part, _), kept in zip(chosen, rows, strict=True)]
    results = align_together(means, place.lat, place.h, errors=site.errors)
    return [
        _window_of(part, i, result, place, *part.bounds(i), kept)
        for (part, i), result, kept in zip(chosen, results, rows, strict=True)
    ]


def _orientations(part: _Part) -> list[int | None]:
    """The still stretches whose attitudes differ from the one before: one for each orientation."""
    found: list[int] = []
    for i, stretch in enumerate(part.still.stretches):
        if stretch.motion != "still":
            continue
        if found and _turned(part, found[-1], i) < _ANOTHER:
            best = part.still.stretches[found[-1]]
            if stretch.duration > best.duration:
                found[-1] = i
            continue
        found.append(i)
    return [*found] or [None]


def _turned(part: _Part, first: int, second: int) -> float:
    """Angle between the mean specific forces and rates of two stretches, the larger, rad."""
    angles = []
    for name in ("f_ib_b", "omega_ib_b"):
        a, b = (
            np.average(getattr(part.spans, name)[rows], axis=0, weights=part.spans.dt[rows])
            for rows in (part.stretch_rows(first), part.stretch_rows(second))
        )
        angles.append(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    return float(max(angles))


def alignment_report(aligned: AlignedWindow, *, curve: bool = False) -> dict[str, Any]:
    """The alignment in degrees and plain types, as `navgrade align --json` prints it.

    Parameters
    ----------
    aligned : AlignedWindow
    curve : bool
        With the convergence.
    """
    r = aligned.result

    def finite(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None

    def each(values: Array | None, unit: float) -> list[float | None] | None:
        return None if values is None else [finite(x / unit) for x in values]

    report: dict[str, Any] = {
        "method": r.method,
        "reason": r.reason,
        "grade": r.grade,
        "verdict": r.verdict,
        "roll_deg": r.roll / DEG,
        "pitch_deg": r.pitch / DEG,
        "heading_deg": finite(r.heading / DEG),
        "roll_sigma_deg": r.roll_sigma / DEG,
        "pitch_sigma_deg": r.pitch_sigma / DEG,
        "heading_sigma_deg": r.heading_sigma / DEG,
        "q_nb": [finite(x) for x in r.q_nb],
        "tilt_sigma_deg": r.tilt_sigma / DEG,
        "azimuth_sigma_deg": r.azimuth_sigma / DEG,
        "covariance_ned_deg2": (r.P_n / DEG**2).tolist(),
        "budget": [
            {
                "source": line.source,
                "tilt_deg": line.tilt / DEG,
                "azimuth_deg": line.azimuth / DEG,
            }
            for line in r.budget
        ],
        "start_s": aligned.start,
        "duration_s": aligned.duration,
        "used_s": r.duration,
        "implied_latitude_deg": finite(r.implied_latitude / DEG),
        "specific_force_residual_m_s2": r.specific_force_residual,
        "rate_residual_deg_h": finite(r.rate_residual / DEG_PER_H),
        "rate_residual_down_deg_h": finite(r.rate_residual_down / DEG_PER_H),
        "rate_residual_north_deg_h": finite(r.rate_residual_north / DEG_PER_H),
        "gyro_heading_deg": finite(r.gyro_heading / DEG),
        "gyro_heading_sigma_deg": r.gyro_heading_sigma / DEG,
        "scatter_ned_deg": each(r.scatter, DEG),
        "stillness_force_m_s2": finite(r.force_scatter),
        "stillness_rate_deg_s": finite(r.rate_scatter / DEG),
        "eigenvalue_gap": finite(r.eigenvalue_gap),
        "gyro_bias_deg_h": each(r.gyro_bias, DEG_PER_H),
        "gyro_bias_sigma_deg_h": each(r.gyro_bias_sigma, DEG_PER_H),
        "accel_bias_ug": each(r.accel_bias, UG),
        "accel_bias_sigma_ug": each(r.accel_bias_sigma, UG),
        "unobservable": list(r.unobservable),
        "false_alarm": aligned.still.false_alarm,
        "stretches": [
            {
                "start_s": stretch.start,
                "stop_s": stretch.stop,
                "kept_s": stretch.duration,
                "cut_s": stretch.cut,
                "motion": stretch.motion,
                "force_scatter_m_s2": stretch.force_scatter,
                "rate_scatter_deg_s": stretch.rate_scatter / DEG,
                "arw_deg_rth": _rms(stretch.arw) / DEG_PER_RTH,
                "vrw_ug_rthz": _rms(stretch.vrw) / UG_PER_RTHZ,
                "used": i == aligned.chosen,
            }
            for i, stretch in enumerate(aligned.still.stretches)
        ],
        "warnings": list(r.warnings),
    }
    if (found := r.innovations) is not None:
        report["innovations"] = {
            "count": len(found.nis),
            "mean": float(np.mean(found.nis)),
            "low": found.low,
            "high": found.high,
            "degrees_of_freedom": found.dof,
            "consistent": found.consistent,
        }
    if curve and (grown := r.convergence) is not None:
        report["convergence"] = {
            "t_s": grown.t.tolist(),
            "off_ned_deg": (grown.off / DEG).tolist(),
            "tilt_sigma_deg": (grown.tilt_sigma / DEG).tolist(),
            "azimuth_sigma_deg": (grown.azimuth_sigma / DEG).tolist(),
        }
    return report
