"""Alignment: errors beside their predicted sigmas, recordings, stillness, speed, and the page."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, norm

from align import (
    Alignment,
    InertialFrame,
    KnownHeading,
    Position,
    SensorErrors,
    align_fine,
    align_positions,
    align_static,
    align_swaying,
    align_together,
    analytic_coarse,
    fine_align,
    gyrocompass,
    gyrocompass_small_angle,
    inertial_frame,
    level,
    level_small_angle,
    wahba,
)
from align.spans import Spans, natural_length, spans_of
from align.stillness import find_still
from align.wahba import vectors_at_rest
from earth.gravity import normal_gravity_n
from earth.rates import omega_ie_n
from navgrade.alignment import AlignedWindow, align_log, align_logs
from navgrade.errors import NavgradeError
from navgrade.job import Choices, open_log
from navgrade.site import read_site
from tests.align.at_rest import DEG, DEG_H, UG, Window, attitudes, error_n, rotation, still
from tests.align.slams import GRADES as NOISE_GRADES
from tests.align.slams import Disturbed, noise, slams, walkers
from tests.align.sway import Sway, Waves, edges

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "alignment.md"
SHARED = ROOT.parent / "shared" / "data"

RUNS = 400
GRADES = {
    "navigation": SensorErrors(0.01 * DEG_H, 50.0 * UG, 0.003 * DEG / 60.0, 10.0 * UG),
    "tactical": SensorErrors(1.0 * DEG_H, 500.0 * UG, 0.1 * DEG / 60.0, 50.0 * UG),
}
TIMES = (60.0, 300.0, 600.0)  # s
LATITUDES = (0.0, 45.0, 70.0)  # deg
QUIET = SensorErrors(0.0, 0.0, 0.003 * DEG / 60.0, 10.0 * UG)
_ROW = 2.0  # s, of a row of a Monte Carlo window
_THINNED = 5  # rows that make a span of the filter
_MRAD, _URAD = 1e-3, 1e-6


@dataclass(frozen=True)
class Stated:
    """`SensorErrors` of which every amount is a number."""

    gyro_bias: float
    accel_bias: float
    arw: float
    vrw: float

    @classmethod
    def of(cls, errors: SensorErrors) -> Stated:
        amounts = errors.gyro_bias, errors.accel_bias, errors.arw, errors.vrw
        return cls(*(0.0 if x is None else x for x in amounts))


def drawn(
    window: Window, errors: SensorErrors, rng: np.random.Generator
) -> tuple[Window, Array, Array]:
    """The window with biases and noise drawn from stated sigmas, and those biases."""
    e = Stated.of(errors)
    gyro, accel = e.gyro_bias * rng.normal(size=3), e.accel_bias * rng.normal(size=3)
    return window.noisy(rng, e.arw, e.vrw).plus(gyro=gyro, accel=accel), gyro, accel


def _rms(values: object) -> Array:
    rms: Array = np.sqrt(np.mean(np.square(np.asarray(values, float)), axis=0))
    return rms


def _rotation_error(q_nb: Array, attitude: Rotation) -> Array:
    """Tilts by the true vertical in the estimated frame, linear in the biases at any heading."""
    turn = Rotation.from_quat(q_nb, scalar_first=True) * attitude.inv()
    down = turn.apply([0.0, 0.0, 1.0])
    return np.array([-down[1], down[0], turn.as_rotvec()[2]])


# Errors and sigmas


Solved = tuple[Array, Array]  # q_nb and P_n


def _solvers(
    errors: SensorErrors, place: Window
) -> dict[str, Callable[[Window, np.random.Generator], Solved]]:
    """Methods of a Monte Carlo window; what they all predict of it comes from the package."""
    e = Stated.of(errors)
    predicted = align_static(*place.samples, errors=errors, method="triad").P_n
    g_n, omega_n = normal_gravity_n(place.lat, place.h), omega_ie_n(place.lat)
    duration = float(place.dt.sum())
    sigmas = (
        float(np.hypot(e.accel_bias, e.vrw / np.sqrt(duration))),
        float(np.hypot(e.gyro_bias, e.arw / np.sqrt(duration))),
    )

    def means(felt: Window) -> tuple[Array, Array]:
        return felt.f_ib_b.mean(axis=0), felt.omega_ib_b.mean(axis=0)

    def coarse(felt: Window) -> Array:
        C = analytic_coarse(*means(felt), g_n=g_n, omega_ie_n=omega_n)
        return np.asarray(Rotation.from_matrix(C).as_quat(scalar_first=True))

    def by_triad(felt: Window, _: np.random.Generator) -> Solved:
        return coarse(felt), predicted

    def by_wahba(felt: Window, _: np.random.Generator) -> Solved:
        found = wahba(*vectors_at_rest(*means(felt), g_n, omega_n, *sigmas))
        return found.q_nb, found.P_n

    def by_filter(felt: Window, _: np.random.Generator) -> Solved:
        thin = felt.dt.reshape(-1, _THINNED).sum(axis=1)
        spans = (x.reshape(-1, _THINNED, 3).mean(axis=1) for x in (felt.omega_ib_b, felt.f_ib_b))
        found = fine_align(thin, *spans, coarse(felt), felt.lat, felt.h, errors=errors)
        return found.q_nb, found.P_n

    def by_curve(felt: Window, _: np.random.Generator) -> Solved:
        # A constant rate and force over each row; in axes that turn, so does the force.
        dt = felt.dt[:, None]
        phi = dt * felt.omega_ib_b
        half = Rotation.from_rotvec(0.5 * dt * place.omega_ib_b)
        dv = dt * half.apply(felt.f_ib_b)
        found = inertial_frame(felt.dt, phi, dv, felt.lat, felt.h, errors=errors)
        return found.q_nb, found.P_n

    return {"triad": by_triad, "wahba": by_wahba, "fine": by_filter, "inertial": by_curve}


def monte_carlo() -> Iterator[str]:
    """Lines of a table: errors of runs over their predicted sigmas."""
    low, high = chi2.ppf([0.025, 0.975], 3 * RUNS) / (3 * RUNS)
    yield "| grade | s | latitude | σ heading, tilt | triad | wahba | fine | inertial |"
    yield "|---" * 8 + "|"
    outside = cells = 0
    worst = 0.0
    for grade, errors in GRADES.items():
        for seconds in TIMES:
            for lat_deg in LATITUDES:
                rng = np.random.default_rng([50, int(seconds), int(lat_deg)])
                shown = []
                for of_tilt, of_heading, square in _ratios(rng, errors, seconds, lat_deg):
                    inside = low < square < high
                    cells, outside = cells + 1, outside + (not inside)
                    worst = max(worst, abs(of_tilt - 1.0), abs(of_heading - 1.0))
                    mark = "" if inside else "*"
                    shown.append(f"{of_heading:.2f} {of_tilt:.2f} {square:.2f}{mark}")
                P_n = align_static(
                    *_place(seconds, lat_deg, rotation(0.0, 0.0, 0.0)).samples, errors=errors
                ).P_n
                sigma = f"{np.sqrt(P_n[2, 2]) / _MRAD:.3g} mrad, {np.sqrt(P_n[0, 0]) / _URAD:.0f}"
                where = f"| {grade} | {seconds:.0f} | {lat_deg:.0f}° | {sigma} µrad |"
                yield f"{where} {' | '.join(shown)} |"
    yield ""
    text = (
        f"The rms are within {100.0 * worst:.0f} % of the sigmas. Bounds of the last number, 95 %: "
        f"{low:.3f} to {high:.3f}; {outside} of {cells} lie outside (*), {0.05 * cells:.1f} are "
        "to be expected."
    )
    yield from textwrap.wrap(text, 105)


def _place(seconds: float, lat_deg: float, attitude: Rotation) -> Window:
    return still(lat_deg, attitude, h=300.0, count=round(seconds / _ROW), dt=_ROW)


def _ratios(
    rng: np.random.Generator, errors: SensorErrors, seconds: float, lat_deg: float
) -> list[tuple[float, float, float]]:
    """Of each method: tilt and heading over sigma, rms, and the mean normalised square."""
    found: dict[str, list[tuple[Array, Array, float]]] = {}
    for attitude in Rotation.random(10, rng=rng):
        place = _place(seconds, lat_deg, attitude)
        solvers = _solvers(errors, place)
        for _ in range(RUNS // 10):
            felt, *_ = drawn(place, errors, rng)
            for name, solve in solvers.items():
                q_nb, P_n = solve(felt, rng)
                off = _rotation_error(q_nb, attitude)
                square = float(off @ np.linalg.solve(P_n, off))
                found.setdefault(name, []).append((off, np.diag(P_n), square))
    rows = []
    for runs in found.values():
        off2, variance, square = (np.array(x) for x in zip(*runs, strict=True))
        mean2, mean_variance = np.mean(off2**2, axis=0), np.mean(variance, axis=0)
        tilt = np.sqrt(mean2[:2].sum() / mean_variance[:2].sum())
        rows.append((float(tilt), float(np.sqrt(mean2[2] / mean_variance[2])), square.mean() / 3.0))
    return rows


def unstated() -> Iterator[str]:
    """Lines of a table: how often headings are off by more than so many sigmas."""
    rng = np.random.default_rng(59)
    noise = QUIET.arw or 0.0, QUIET.vrw or 0.0
    stated = SensorErrors(0.1 * DEG_H, 100.0 * UG, *noise)
    silent = SensorErrors(None, None, *noise)
    base = Sway(45.0 * DEG, 0.0, (0.02, -0.01, 0.8)).feel(edges(300.0, 1.0))
    place = still(45.0, base.attitude, count=60, dt=5.0)
    units: dict[str, list[float]] = {}

    def note(name: str, found: Alignment, truth: Rotation) -> None:
        off = abs(error_n(found.q_nb, truth)[2]) / found.azimuth_sigma
        units.setdefault(name, []).append(float(off))

    for _ in range(RUNS):
        felt, gyro, accel = drawn(place, stated, rng)
        sways = base.noisy(rng, *noise).plus(gyro=gyro, accel=accel)
        for words, errors in (("biases stated", stated), ("not stated", silent)):
            found = align_static(*felt.samples, errors=errors, method="triad", convergence=False)
            note(f"`triad`, {words}", found, place.attitude)
            found = align_swaying([sways.samples], place.lat, place.h, errors=errors)
            note(f"`inertial`, {words}", found, base.attitude)
    yield "| heading off by more than | 1 σ | 2 σ | 3 σ |"
    yield "|---|---|---|---|"
    normal = (2.0 * norm.sf(k) for k in (1, 2, 3))
    for name, shares in (
        ("a normal error", list(normal)),
        *((name, [np.mean(np.array(off) > k) for k in (1, 2, 3)]) for name, off in units.items()),
    ):
        yield f"| {name} | {' | '.join(f'{100.0 * x:.1f} %' for x in shares)} |"


EXACT_LATITUDES = (-80.0, -40.0, 0.0, 40.0, 80.0)  # deg
_STEEP = 0.5e-6  # cos(pitch) below which a heading says nothing


def exact() -> Iterator[str]:
    """Lines of a table: the largest error of each method on data without errors."""
    worst: dict[str, float] = {}

    def note(name: str, error: float) -> None:
        worst[name] = max(worst.get(name, 0.0), error)

    good = SensorErrors(0.001 * DEG_H, 10.0 * UG, None, None)
    sway = Waves((2.0 * DEG,) * 3, phase=(0.3, 2.0, 4.4))
    angles = attitudes()
    for lat_deg in EXACT_LATITUDES:
        felt = {
            "inertial, still": Sway(lat_deg * DEG, 300.0, (0.1, -0.2, 2.5)).feel(edges(60.0, 5.0)),
            "inertial, 2° of sway": Sway(lat_deg * DEG, 300.0, (0.1, -0.2, 2.5), sway).feel(
                edges(60.0, 10.0)
            ),
        }
        for k, euler in enumerate(angles):
            window = still(lat_deg, rotation(*euler), h=300.0, count=4)
            for method in ("triad", "gyrocompass", "wahba"):
                found = align_static(*window.samples, errors=good, method=method, convergence=False)
                note(method, _size(found, window))
            note("fine", _size(align_fine(*window.samples, errors=_NAVIGATION), window))
            if np.cos(euler[1]) > _STEEP:
                known = KnownHeading(euler[2], 1e-5)
                found = align_static(
                    *window.samples,
                    errors=good,
                    known_heading=known,
                    method="known-heading",
                    convergence=False,
                )
                note("known-heading", _size(found, window))
            up_b = window.attitude.inv().apply([0.0, 0.0, -1.0])
            found = align_static(
                *_level_place(window), errors=good, method="level", convergence=False
            )
            up = rotation(found.roll, found.pitch, 0.0).inv().apply([0.0, 0.0, -1.0])
            note("level", float(np.linalg.norm(np.cross(up, up_b))))
            other = still(lat_deg, rotation(*angles[(7 * k + 3) % len(angles)]), h=300.0, count=4)
            both = align_together(
                [x.samples[:3] for x in (window, other)],
                window.lat,
                window.h,
                errors=_NAVIGATION,
            )
            for result, place in zip(both, (window, other), strict=True):
                note("multi-position", _size(result, place))
            mounted = rotation(*euler)
            for name, still_or_not in felt.items():
                phi, dv = (mounted.inv().apply(x) for x in (still_or_not.phi, still_or_not.dv))
                frame = inertial_frame(still_or_not.dt, phi, dv, window.lat, 300.0)
                off = error_n(frame.q_nb, still_or_not.attitude * mounted)
                note(name, float(np.linalg.norm(off)))
    yield "| method | largest error, rad |"
    yield "|---|---|"
    for name, error in worst.items():
        yield f"| {name} | {error:.1e} |"


_NAVIGATION = GRADES["navigation"]


def _level_place(window: Window) -> tuple[Array, Array, Array, float, float]:
    """On the ellipsoid, where the plumb line is its normal: roll and pitch refer to that."""
    ground = still(window.lat / DEG, window.attitude, count=len(window.dt))
    return ground.samples


def _size(found: Alignment, window: Window) -> float:
    return float(np.linalg.norm(error_n(found.q_nb, window.attitude)))


# Formulas of the lectures, and TRIAD's variants


def small_angles() -> Iterator[str]:
    """Lines of a table: how far the lectures' formulas are from the full ones, mrad."""
    yield "| roll = pitch | roll | pitch | heading, worst of all directions |"
    yield "|---|---|---|---|"
    for tilt_deg in (0.5, 1.0, 2.0, 5.0, 10.0):
        tilt = tilt_deg * DEG
        off = []
        for heading in np.arange(0.0, 360.0, 5.0) * DEG:
            window = still(45.0, rotation(tilt, tilt, heading))
            f, omega = window.f_ib_b[0], window.omega_ib_b[0]
            roll, pitch = level_small_angle(f[0], f[1], window.g)
            turn = gyrocompass_small_angle(omega, roll, pitch) - gyrocompass(omega, *level(f))
            off.append((roll - tilt, pitch - tilt, np.remainder(turn + np.pi, 2 * np.pi) - np.pi))
        roll, pitch, turn = np.max(np.abs(off), axis=0) / _MRAD
        yield f"| {tilt_deg:g}° | {roll:.2g} mrad | {pitch:.2g} mrad | {turn:.2g} mrad |"


def variants() -> Iterator[str]:
    """Lines of a table: rms errors of TRIAD's variants by biases alone."""
    yield "| variant | north, µrad | east, µrad | down, mrad |"
    yield "|---|---|---|---|"
    rng = np.random.default_rng(51)
    place = still(45.0, rotation(0.1, -0.2, 1.0), count=1)
    g_n, omega_n = normal_gravity_n(place.lat, place.h), omega_ie_n(place.lat)
    off: dict[str, list[Array]] = {}
    for _ in range(RUNS):
        felt, *_ = drawn(place, SensorErrors(0.01 * DEG_H, 50.0 * UG, 0.0, 0.0), rng)
        for variant in ("gravity-first", "rate-first", "inverse"):
            C = analytic_coarse(
                felt.f_ib_b[0], felt.omega_ib_b[0], g_n=g_n, omega_ie_n=omega_n, variant=variant
            )
            turn = Rotation.from_matrix(C) * place.attitude.inv()
            off.setdefault(variant, []).append(turn.as_rotvec())
    for variant, errors in off.items():
        north, east, down = _rms(errors)
        yield f"| {variant} | {north / _URAD:.0f} | {east / _URAD:.0f} | {down / _MRAD:.2f} |"


def budgets() -> Iterator[str]:
    """Lines of a table: what each error adds to tilt and heading after 300 s, 1-sigma."""
    headings = [f"heading {lat_deg:.0f}°" for lat_deg in LATITUDES]
    yield f"| grade | source | tilt | {' | '.join(headings)} |"
    yield "|---" * (3 + len(headings)) + "|"
    for grade, errors in GRADES.items():
        found = [budget_at(errors, lat_deg) for lat_deg in LATITUDES]
        for k, line in enumerate(found[1].budget):
            cells = [f"{r.budget[k].azimuth / _MRAD:.3g} mrad" for r in found]
            tilt = f"{line.tilt / _URAD:.3g} µrad"
            yield f"| {grade} | {line.source} | {tilt} | {' | '.join(cells)} |"
        cells = [f"{r.azimuth_sigma / _MRAD:.3g} mrad" for r in found]
        tilt = f"{found[1].tilt_sigma / _URAD:.3g} µrad"
        yield f"| {grade} | all | {tilt} | {' | '.join(cells)} |"


def budget_at(errors: SensorErrors, lat_deg: float, seconds: float = 300.0) -> Alignment:
    """The report of a perfect window at a latitude."""
    place = still(lat_deg, rotation(0.0, 0.0, 0.0), count=round(seconds / _ROW), dt=_ROW)
    return align_static(*place.samples, errors=errors, method="triad")


# A base that sways

SWAY_TIMES = (60.0, 120.0, 300.0)  # s
SWAY_RUNS = 40
_SWAY_RATE = 50.0  # Hz


def swaying(rng: np.random.Generator, sway: float) -> Sway:
    """Roll, pitch and yaw of `sway` rad, each with a period of 7 to 11 s, at latitude 45°."""
    euler = (*rng.uniform(-0.1, 0.1, 2), rng.uniform(-np.pi, np.pi))
    turn = Waves((sway,) * 3, rng.uniform(7.0, 11.0, 3), rng.uniform(0.0, 7.0, 3))
    return Sway(45.0 * DEG, 20.0, euler, turn)


def sway_errors(sway_deg: float, times: tuple[float, ...], runs: int) -> tuple[Array, Array, Array]:
    """Heading errors (runs, times) of TRIAD and of the inertial frame, and the sigma of this."""
    rng = np.random.default_rng([52, round(10.0 * sway_deg)])
    by_means, by_curve, sigma = (np.empty((runs, len(times))) for _ in range(3))
    for run in range(runs):
        base = swaying(rng, sway_deg * DEG)
        felt = base.feel(edges(times[-1], _SWAY_RATE)).noisy(rng, QUIET.arw or 0, QUIET.vrw or 0)
        frame = InertialFrame(base.lat, base.h, errors=QUIET)
        first = 0
        for k, seconds in enumerate(times):
            stop = round(seconds * _SWAY_RATE)
            frame.add(felt.dt[first:stop], felt.phi[first:stop], felt.dv[first:stop])
            first = stop
            truth = base.attitude(np.array([seconds]))[0]
            found = frame.solution()
            by_curve[run, k] = error_n(found.q_nb, truth)[2]
            sigma[run, k] = np.sqrt(found.P_n[2, 2])
            C = analytic_coarse(felt.dv[:stop].mean(axis=0), felt.phi[:stop].mean(axis=0))
            by_means[run, k] = (Rotation.from_matrix(C) * truth.inv()).as_rotvec()[2]
    return by_means, by_curve, sigma


def sway() -> Iterator[str]:
    """Lines of a table: heading on a base that sways."""
    yield "| sway | s | TRIAD rms | inertial rms | its σ | rms of error/σ | `auto` takes |"
    yield "|---" * 7 + "|"
    for sway_deg in (0.1, 2.0):
        by_means, by_curve, sigma = sway_errors(sway_deg, SWAY_TIMES, SWAY_RUNS)
        for k, seconds in enumerate(SWAY_TIMES):
            chosen = _by_auto(sway_deg, seconds)
            yield (
                f"| {sway_deg:g}° | {seconds:.0f} | {_rms(by_means)[k] / _MRAD:.0f} mrad "
                f"| {_rms(by_curve)[k] / _MRAD:.2f} mrad | {_rms(sigma)[k] / _MRAD:.2f} mrad "
                f"| {_rms(by_curve / sigma)[k]:.2f} | {chosen} |"
            )


def _by_auto(sway_deg: float, seconds: float) -> str:
    """What `auto` would take in runs of a swaying base, by the motion found."""
    rng = np.random.default_rng([53, round(10.0 * sway_deg)])
    count: dict[str, int] = {}
    for _ in range(SWAY_RUNS):
        felt = swaying(rng, sway_deg * DEG).feel(edges(seconds, _SWAY_RATE))
        felt = felt.noisy(rng, QUIET.arw or 0.0, QUIET.vrw or 0.0)
        dt = felt.dt[:, None]
        stretches = find_still(spans_of(felt.dt, felt.phi / dt, felt.dv / dt)).stretches
        best = min(stretches, key=lambda s: float(_rms(s.arw)) ** 2 / s.duration, default=None)
        motion = "refused" if best is None else best.motion
        what = {"swaying": "inertial", "still": "triad"}.get(motion, motion)
        count[what] = count.get(what, 0) + 1
    return ", ".join(f"{what} {number}/{SWAY_RUNS}" for what, number in sorted(count.items()))


# Stillness


def stillness() -> Iterator[str]:
    """Lines of a table: time kept and admitted on logs with disturbances every 30 s."""
    yield "| grade | Hz | size | door slams: kept | admitted | walkers: kept | admitted |"
    yield "|---" * 7 + "|"
    for grade in NOISE_GRADES:
        for rate in (100.0, 1000.0):
            for size in (2.0, 5.0, 20.0):
                cells = []
                for make in (slams, walkers):
                    kept, admitted = _shares(make, rate, grade, size)
                    cells += [f"{100.0 * kept:.1f} %", f"{100.0 * admitted:.2f} %"]
                yield f"| {grade} | {rate:.0f} | {size:.0f} | {' | '.join(cells)} |"


def _shares(
    make: Callable[[np.random.Generator, float, float, str, float], Disturbed],
    rate: float,
    grade: str,
    size: float,
) -> tuple[float, float]:
    shares = []
    seconds = 900.0 if rate < 500.0 else 300.0
    for run in range(2):
        case = make(np.random.default_rng([54, run, len(grade)]), rate, seconds, grade, size)
        report = find_still(spans_of(*case.samples))
        pieces = [piece for stretch in report.stretches for piece in stretch.pieces]
        shares.append(case.shares(*np.array(pieces).T))
    kept, admitted = np.mean(shares, axis=0)
    return float(kept), float(admitted)


def false_alarms() -> Iterator[str]:
    """Lines of a table: false alarms in white noise beside the stated rate."""
    yield "| Hz | 1e-2 stated | 1e-3 stated | 1e-4 stated | spans |"
    yield "|---|---|---|---|---|"
    for rate in (100.0, 1000.0):
        counts, total = np.zeros(3), 0
        for run in range(10):
            spans = _white(np.random.default_rng([55, run]), rate, 1800.0, "navigation")
            total += len(spans)
            for k, stated in enumerate((1e-2, 1e-3, 1e-4)):
                counts[k] += find_still(spans, false_alarm=stated).alarms.sum()
        measured = " | ".join(f"{x / total:.1e}" for x in counts)
        yield f"| {rate:.0f} | {measured} | {total} |"


def _white(rng: np.random.Generator, rate: float, seconds: float, grade: str) -> Spans:
    """Spans of white noise; of fast samples drawn from the laws of their means and variances."""
    length = natural_length(np.full(1, 1.0 / rate))
    if rate < 500.0:
        values, _ = noise(rng, rate, seconds, grade)
        return spans_of(np.full(len(values), 1.0 / rate), values[:, :3], values[:, 3:], length)
    rows, count = round(seconds / length), round(rate * length)
    sigma = np.repeat(NOISE_GRADES[grade], 3) * np.sqrt(rate)
    mean = sigma / np.sqrt(count) * rng.normal(size=(rows, 6))
    variance = sigma**2 * rng.chisquare(count - 1, (rows, 6)) / (count - 1)
    each = np.full(rows, length), np.full(rows, count)
    parts = mean[:, :3], mean[:, 3:], variance[:, :3], variance[:, 3:]
    return Spans(length, length * np.arange(1.0, rows + 1.0), *each, *parts)


# Recordings

_LN100 = """\
[imu]
kind = "average"
axes = "FRD"
[imu.errors]
gyro_bias_deg_h = 0.25
accel_bias_ug = 50.0
[site]
latitude = 51.07995352
longitude = -114.13371127
height_m = 1118.5
"""
_KINGSTON = """\
[imu]
kind = "average"
axes = "RFU"
[site]
latitude = 44.23249
longitude = -76.48
height_m = 39.94
[alignment]
start_s = 5.0
duration_s = 515.0
"""
_OEM7 = _LN100.replace("[imu]\n", '[imu]\ntopic = "/gps/imu"\n')


Known = tuple[float | None, float | None, float | None]  # roll, pitch, heading, deg


def recordings() -> Iterator[str]:
    """Lines of a table: alignments of real recordings beside what is known of them."""
    if not SHARED.is_dir():
        print("no ../shared/data: the recordings are left out")
        return
    up, down = "calgary_ln100_x_up.mcap", "calgary_ln100_x_down.mcap"
    yield "| recording | method | s used | roll | pitch | heading | known | error/σ |"
    yield "|---" * 8 + "|"
    facts: dict[str, Known] = {up: (None, 89.66, None), down: (None, -89.54, None)}
    for name, known in facts.items():
        for method in ("triad", "fine"):
            (found,) = _aligned(_LN100, [name], method)
            yield _recorded(name, found, known)
    both = _aligned(_LN100, [up, down], "multi-position")
    for found, (name, known) in zip(both, facts.items(), strict=True):
        yield _recorded(name, found, known)
    car = "kingston_hg1700_drive.mcap"
    for method in ("triad", "fine", "inertial"):
        (found,) = _aligned(_KINGSTON, [car], method)
        yield _recorded(car, found, (-0.226, -0.321, 201.0))
    oem7 = "novatel_oem7_parked.mcap"
    try:
        _aligned(_OEM7, [oem7], "auto")
    except NavgradeError as error:
        yield f"| `{oem7.removesuffix('.mcap')}` | refused | | | | | without gravity | |"
        yield ""
        yield from textwrap.wrap(f"The refusal: *{error}*.", 105)
    else:
        yield f"| `{oem7}` | NOT REFUSED | | | | | without gravity | |"
    yield ""
    yield from _of_two(both)


def _recorded(name: str, aligned: AlignedWindow, known: Known) -> str:
    r = aligned.result
    angles = (r.roll, r.roll_sigma), (r.pitch, r.pitch_sigma), (r.heading, r.heading_sigma)
    cells = [f"{angle / DEG:.3f}° ± {sigma / DEG:.2g}°" for angle, sigma in angles]
    units = [
        abs(angle / DEG - fact) * DEG / sigma
        for (angle, sigma), fact in zip(angles, known, strict=True)
        if fact is not None
    ]
    facts = ", ".join(f"{fact:g}°" for fact in known if fact is not None)
    name = name.removesuffix(".mcap")
    return (
        f"| `{name}` | {r.method} | {r.duration:.0f} | {' | '.join(cells)} | {facts} "
        f"| {max(units):.2f} |"
    )


def _of_two(both: list[AlignedWindow]) -> Iterator[str]:
    """What the LN-100's two positions say of its errors."""
    r = both[0].result
    assert r.gyro_bias is not None and r.gyro_bias_sigma is not None
    assert r.accel_bias is not None and r.accel_bias_sigma is not None
    readings = [_mean_force(x) for x in ("calgary_ln100_x_up.mcap", "calgary_ln100_x_down.mcap")]
    half_sum = 0.5 * (readings[0] + readings[1])
    down = " and ".join(f"{x.result.rate_residual_down / DEG_H:+.3f}" for x in both)
    force = " and ".join(f"{x.result.specific_force_residual * 1e3:+.2f}" for x in both)
    text = (
        f"The LN-100 by both positions: x gyro bias {r.gyro_bias[0] / DEG_H:+.3f} ± "
        f"{r.gyro_bias_sigma[0] / DEG_H:.2g} °/h, x accelerometer bias "
        f"{r.accel_bias[0] * 1e3:+.3f} ± {r.accel_bias_sigma[0] * 1e3:.2g} mm/s²; half the sum of "
        f"the two x readings is {half_sum * 1e3:+.3f} mm/s². The rate about down is then {down} "
        f"°/h from the Earth's, and |f| {force} mm/s² from gravity: a scale factor, or gravity "
        f"itself. Unobservable: {'; '.join(r.unobservable)}."
    )
    yield from textwrap.wrap(text, 105)


def _mean_force(name: str) -> float:
    """Of the x accelerometer, m/s^2."""
    with tempfile.TemporaryDirectory() as folder:
        log = _open(_LN100, name, Path(folder))
        total = duration = 0.0
        for block in log.blocks():
            _, f = block.mean_rates()
            total, duration = total + float(block.dt @ f[:, 0]), duration + float(block.dt.sum())
    return total / duration


def _open(text: str, name: str, folder: Path):  # type: ignore[no-untyped-def]
    path = folder / "site.toml"
    path.write_text(text)
    return open_log(SHARED / name, read_site(path), Choices())


def _aligned(text: str, names: list[str], method: str) -> list[AlignedWindow]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = [_open(text, x, folder) for x in names]
        site = read_site(folder / "site.toml")
        if method == "multi-position":
            return align_logs(logs, site)
        return [align_log(logs[0], site, method, level_allowed=True)]


# Survey data

_MARKS = ROOT / "tests" / "align" / "marks"
_SURVEYED = """\
[imu]
kind = "increment"
[imu.errors]
gyro_bias_deg_h = 1.0
accel_bias_ug = 500.0
[site]
marks = "{}"
mark = "PIER 1"
[azimuth]
to = "AZ MK"
"""


def survey() -> Iterator[str]:
    """Lines of a table: one log aligned by what files of three kinds say of the same line."""
    yield "| file | latitude | longitude | height | heading | method |"
    yield "|---" * 6 + "|"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        scenario, log = folder / "still.toml", folder / "log.mcap"
        text = _SCENARIO.format(60.0).replace("heading_deg = 137.0", "heading_deg = 63.4")
        scenario.write_text(text.replace("1000.0", "100.0"))
        _timed("simulate", scenario, "-o", log)
        for file in ("surveyor.csv", "datasheet.txt", "solution.snx", "points.geojson"):
            path = folder / "site.toml"
            path.write_text(_SURVEYED.format(_MARKS / file))
            site = read_site(path)
            assert site.place is not None
            r = align_log(open_log(log, site, Choices()), site).result
            yield (
                f"| `{file}` | {site.place.lat / DEG:.9f}° | {site.place.lon / DEG:.9f}° "
                f"| {site.place.h:.4f} m | {r.heading / DEG:.6f}° ± {r.heading_sigma / DEG:.4f}° "
                f"| {r.method} |"
            )


# Two positions


_TURN_SIGMA = 1e-6  # rad


def half_turn() -> Iterator[str]:
    """Lines of a table: half a turn about the vertical against one position."""
    rng = np.random.default_rng(56)
    errors = _NAVIGATION
    windows = [still(45.0, rotation(0.0, 0.0, 0.7 + turn), count=1) for turn in (0.0, np.pi)]
    half = windows[0].attitude.inv() * windows[1].attitude
    off: dict[str, list[tuple[Array, Array]]] = {}
    for _ in range(RUNS):
        e = Stated.of(errors)
        gyro, accel = e.gyro_bias * rng.normal(size=3), e.accel_bias * rng.normal(size=3)
        z = rng.normal(size=(2, 2, 3)) / np.sqrt(150.0)
        rows = [
            (
                w.omega_ib_b[0] + gyro + e.arw * z[k, 0],
                w.f_ib_b[0] + accel + e.vrw * z[k, 1],
            )
            for k, w in enumerate(windows)
        ]
        off_turn = Rotation.from_rotvec(_TURN_SIGMA * rng.normal(size=3))
        turn = (off_turn * half).as_quat(scalar_first=True)
        for known in (True, False):
            second = Position(*rows[1], 150.0)
            if known:
                second = replace(second, turn=turn, turn_sigma=_TURN_SIGMA)
            positions = [Position(*rows[0], 150.0), second]
            found = align_positions(positions, windows[0].lat, 0.0, errors=errors)
            name = "two positions, turn known to 1 µrad" if known else "two positions, turn unknown"
            off.setdefault(name, []).append(
                (error_n(found.q_nb[0], windows[0].attitude), np.diag(found.P_n[0]))
            )
        at_one = still(45.0, windows[0].attitude, count=12, dt=25.0)
        felt = at_one.noisy(rng, e.arw, e.vrw).plus(gyro=gyro, accel=accel)
        one = align_static(*felt.samples, errors=errors, method="triad", convergence=False)
        off.setdefault("one position", []).append(
            (error_n(one.q_nb, at_one.attitude), np.diag(one.P_n))
        )
    yield "| 300 s in all | tilt rms | its σ | heading rms | its σ |"
    yield "|---|---|---|---|---|"
    for name in ("one position", *(x for x in off if x != "one position")):
        errors_n, variances = (np.array(x) for x in zip(*off[name], strict=True))
        rms, sigma = _rms(errors_n), np.sqrt(np.mean(variances, axis=0))
        tilt, tilt_sigma = (np.sqrt(0.5 * (x[0] ** 2 + x[1] ** 2)) / _URAD for x in (rms, sigma))
        yield (
            f"| {name} | {tilt:.2g} µrad | {tilt_sigma:.2g} µrad | {rms[2] / _MRAD:.2f} mrad "
            f"| {sigma[2] / _MRAD:.2f} mrad |"
        )


# Speed


_SCENARIO = """\
[imu]
rate_hz = 1000.0
kind = "increment"
grade = "navigation"
[start]
latitude = 51.0799
longitude = -114.1337
height_m = 1118.5
heading_deg = 137.0
roll_deg = 2.0
pitch_deg = -1.2
[gnss]
[[segment]]
type = "still"
duration_s = {}
"""


def speed() -> Iterator[str]:
    """Lines of a table: what, wall and processor time, s, and the most memory, MB."""
    yield "| command | wall s | processor s | MB |"
    yield "|---|---|---|---|"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for minutes in (5, 30):
            scenario, log, site = (
                folder / f"{minutes}.{end}" for end in ("toml", "mcap", "site.toml")
            )
            scenario.write_text(_SCENARIO.format(60.0 * minutes))
            _timed("simulate", scenario, "-o", log)
            site.write_text(_LN100.replace('axes = "FRD"\n', "").replace("average", "increment"))
            if minutes == 5:
                for method in ("auto", "fine", "inertial"):
                    _timed("align", log, "-c", site, "--method", method)  # compiles
            for method in ("auto", "fine", "inertial"):
                row = _timed("align", log, "-c", site, "--method", method)
                yield f"| `align --method {method}`, {minutes} min at 1 kHz | {row} |"


# A process counts the memory of the one it was forked from, so a small one stands between.
_METER = """\
import resource, subprocess, sys, time
began = time.perf_counter()
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)
"""


def _timed(*arguments: object) -> str:
    command = [sys.executable, "-m", "navgrade", *map(str, arguments)]
    metered = [sys.executable, "-c", _METER, *command]
    done = subprocess.run(metered, check=True, cwd=ROOT, stdout=subprocess.PIPE, text=True)
    wall, processor, memory = map(float, done.stdout.split())
    return f"{wall:.1f} | {processor:.1f} | {memory:.0f}"


# The page

SECTIONS: dict[str, Callable[[], Iterator[str]]] = {
    "budgets": budgets,
    "small-angles": small_angles,
    "variants": variants,
    "half-turn": half_turn,
    "exact": exact,
    "unstated": unstated,
    "survey": survey,
    "stillness": stillness,
    "false-alarms": false_alarms,
    "sway": sway,
    "recordings": recordings,
    "monte-carlo": monte_carlo,
    "speed": speed,
}


def measure(write: bool, only: tuple[str, ...] = ()) -> None:
    """Print every table, and write them into docs."""
    for name, lines in SECTIONS.items():
        if only and name not in only:
            continue
        print(f"\n## {name}", flush=True)
        made = []
        for line in lines():
            print(line, flush=True)
            made.append(line)
        if write and made:
            PAGE.write_text(_filled(PAGE.read_text(), name, made))


def _filled(page: str, name: str, lines: list[str]) -> str:
    """The page with what stands between two marks made anew."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    text, found = re.subn(
        f"{begin}.*?{end}",
        lambda _: begin + "\n".join(lines) + "\n" + end,
        page,
        flags=re.DOTALL,
    )
    assert found == 1, name
    return text
