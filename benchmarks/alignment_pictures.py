"""Pictures of docs/alignment.md."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial.transform import Rotation

from align import analytic_coarse
from align.spans import spans_of
from align.stillness import find_still
from benchmarks.alignment import GRADES, PAGE, budget_at, drawn, sway_errors
from tests.align.at_rest import rotation, still
from tests.align.slams import GRADES as NOISE_GRADES
from tests.align.slams import REST, slams
from tests.oracles.constants import OMEGA

Array = NDArray[np.float64]

PICTURES = PAGE.parent / "alignment"
_COLOURS = 160  # of a picture: a file of less than 100 kB
_RUNS, _SHOWN = 400, 30
_MRAD = 1e-3


def draw() -> None:
    """Draw every picture of the page."""
    PICTURES.mkdir(exist_ok=True)
    for name, make in {
        "heading": heading_by_time,
        "sway": sway_by_time,
        "budget": budget_by_latitude,
        "slams": detector,
    }.items():
        _save(make(), PICTURES / f"{name}.png")


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, dpi=90)
    plt.close(figure)
    with Image.open(path) as image:
        few = image.convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE)
    few.save(path, optimize=True)


def heading_by_time() -> Figure:
    """Heading error of TRIAD by averaging time: runs, their rms, and theory."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    spans = np.diff(np.geomspace(10.0, 1000.0, 25), prepend=0.0)
    t = np.cumsum(spans)
    for axis, (grade, errors) in zip(axes, GRADES.items(), strict=True):
        rng = np.random.default_rng(57)
        place = still(45.0, rotation(0.1, -0.2, 1.0), count=len(spans), dt=spans)
        off = np.empty((_RUNS, len(t)))
        for run in range(_RUNS):
            felt, *_ = drawn(place, errors, rng)
            f, omega = (
                np.cumsum(spans[:, None] * x, axis=0) / t[:, None]
                for x in (felt.f_ib_b, felt.omega_ib_b)
            )
            found = Rotation.from_matrix(
                [analytic_coarse(a, b) for a, b in zip(f, omega, strict=True)]
            )
            off[run] = (found * place.attitude.inv()).as_rotvec()[:, 2]
        level_rate = OMEGA * np.cos(place.lat)
        noise = (errors.arw or 0.0) / level_rate / np.sqrt(t)
        bias = np.hypot(
            (errors.gyro_bias or 0.0) / level_rate, (errors.accel_bias or 0.0) / place.g
        )
        axis.plot(t, np.abs(off[:_SHOWN].T) / _MRAD, color="0.8", linewidth=0.6)
        axis.plot([], [], color="0.8", label=f"|error| of {_SHOWN} runs")
        axis.plot(
            t, noise / _MRAD, "--", color="C0", label="angle random walk, falls as $1/\\sqrt{T}$"
        )
        axis.axhline(bias / _MRAD, linestyle=":", color="C2", label="biases, stay")
        axis.plot(t, np.hypot(noise, bias) / _MRAD, color="k", label="both: the sigma reported")
        rms = np.sqrt(np.mean(off**2, axis=0))
        axis.plot(t, rms / _MRAD, "o", color="C1", markersize=4, label=f"rms of {_RUNS} runs")
        top = np.hypot(noise, bias)[0] / _MRAD
        axis.set(
            xscale="log",
            yscale="log",
            xlabel="averaging time, s",
            ylabel="heading error, mrad",
            title=f"{grade} grade, latitude 45°",
            ylim=(0.04 * bias / _MRAD, 4.0 * top),
            xlim=(t[0], t[-1]),
        )
        axis.grid(alpha=0.3)
    axes[0].legend(frameon=False, fontsize="small", loc="lower left")
    return figure


def sway_by_time() -> Figure:
    """Heading error on a base that sways, of TRIAD and of the inertial frame."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained", sharey=True)
    t = np.geomspace(15.0, 300.0, 14)
    for axis, sway_deg in zip(axes, (0.1, 2.0), strict=True):
        by_means, by_curve, sigma = sway_errors(sway_deg, tuple(t), 40)
        for errors, colour, name in (
            (by_means, "C3", "TRIAD on the means"),
            (by_curve, "C0", "inertial frame"),
        ):
            axis.plot(t, np.abs(errors[:20].T) / _MRAD, color=colour, linewidth=0.5, alpha=0.18)
            rms = np.sqrt(np.mean(errors**2, axis=0))
            axis.plot(t, rms / _MRAD, "o", color=colour, markersize=4, label=f"{name}, rms")
        axis.plot(t, np.sqrt(np.mean(sigma**2, axis=0)) / _MRAD, color="k", label="its sigma")
        axis.axhline(3.0, linestyle=":", color="0.4")
        axis.set(
            xscale="log",
            yscale="log",
            xlabel="window, s",
            title=f"{sway_deg:g}° of roll, pitch and yaw, 7 to 11 s",
            ylim=(0.1, 5e3),
            xlim=(t[0], t[-1]),
        )
        axis.set_xticks([15, 30, 60, 120, 300], ["15", "30", "60", "120", "300"])
        axis.minorticks_off()
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("heading error, mrad")
    axes[0].text(16.0, 2.3, "3 mrad", color="0.4", fontsize="small", va="top")
    axes[1].legend(frameon=False, fontsize="small", loc="center right")
    return figure


def budget_by_latitude() -> Figure:
    """What each sensor error adds to heading after 300 s, by latitude."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    latitudes = (0.0, 15.0, 30.0, 45.0, 60.0, 70.0)
    x = np.arange(len(latitudes))
    for axis, (grade, errors) in zip(axes, GRADES.items(), strict=True):
        found = [budget_at(errors, lat) for lat in latitudes]
        sources = [line.source for line in found[0].budget]
        for k, source in enumerate(sources):
            heights = [r.budget[k].azimuth / _MRAD for r in found]
            axis.bar(x + 0.2 * (k - 1.5), heights, 0.2, label=source, zorder=2)
        axis.plot(x, [r.azimuth_sigma / _MRAD for r in found], "k_", markersize=30, label="all")
        axis.set_xticks(x, [f"{lat:.0f}°" for lat in latitudes])
        axis.set(
            yscale="log",
            xlabel="latitude",
            ylabel="heading, 1-sigma, mrad",
            title=f"{grade} grade, 300 s",
        )
        axis.grid(alpha=0.3, axis="y")
    figure.legend(
        *axes[0].get_legend_handles_labels(),
        frameon=False,
        fontsize="small",
        loc="outside lower center",
        ncols=5,
    )
    return figure


def detector() -> Figure:
    """A log with door slams, and what the detector keeps of it."""
    rate, seconds = 100.0, 200.0
    case = slams(np.random.default_rng(58), rate, seconds, "tactical", 10.0)
    report = find_still(spans_of(*case.samples))
    t = np.cumsum(case.dt)
    figure, axes = plt.subplots(2, 1, figsize=(10, 4.4), layout="constrained", sharex=True)
    parts = ((3, "f, x, mm/s²", 1e3), (0, "ω, x, mrad/s", 1e3))
    for axis, (column, label, scale) in zip(axes, parts, strict=True):
        off = scale * (case.values[:, column] - REST[column])
        axis.plot(t, off, color="0.35", linewidth=0.4)
        for stretch in report.stretches:
            for start, stop in stretch.pieces:
                axis.axvspan(start, stop, color="C2", alpha=0.25, linewidth=0)
        noise = scale * np.repeat(NOISE_GRADES["tactical"], 3)[column] * np.sqrt(rate)
        axis.set(ylabel=label, xlim=(0.0, seconds), ylim=(-16.0 * noise, 16.0 * noise))
        edges = np.flatnonzero(np.diff(case.disturbed.astype(int), prepend=0, append=0))
        for a, b in edges.reshape(-1, 2):
            axis.plot([t[a], t[b - 1]], [-14.5 * noise] * 2, color="C3", linewidth=4)
    axes[0].set_title("door slams: green is kept, red is disturbed beyond the noise")
    axes[1].set_xlabel("s")
    return figure
