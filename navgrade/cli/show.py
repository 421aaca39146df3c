"""What people read of a navigation."""

from __future__ import annotations

import numpy as np

from align import Alignment
from earth.rotation import euler_from_quat
from earth.units import DEG, DEG_PER_H, UG
from navgrade.alignment import AlignedWindow
from navgrade.cli.terminal import console, row, warn
from navgrade.compare.result import Comparison
from navgrade.compare.verdict import length_text, time_text
from navgrade.job import RunSummary
from navgrade.logs import ImuLog
from navgrade.report.alignment import differs
from navgrade.report.words import readable_angle
from navgrade.site import Site

_STRETCHES = 6  # shown, at most


def show_source(log: ImuLog, *, axes_given: bool) -> None:
    """Say what is read, and how it is understood."""
    default = "as its messages say" if log.schema.axes else "nobody said: the ROS default"
    axes = log.axes if axes_given else f"{log.axes} ({default})"
    console.print(
        f"{log.path}  {log.topic}  {log.schema.name}, kind {log.kind}, axes {axes}", markup=False
    )
    for note in log.notes:
        warn(note)


def show_survey(site: Site) -> None:
    """Say how place and heading came from marks, and what speaks against them."""
    for text in site.survey:
        row("survey", text)
    for note in site.survey_notes:
        warn(note)


def show_alignment(aligned: AlignedWindow) -> None:
    """Print the alignment report."""
    r = aligned.result
    console.print(
        f"\n[bold]Alignment[/bold]  {r.method}, {aligned.start:g} s to "
        f"{aligned.start + aligned.duration:g} s"
    )
    row("why", r.reason)
    row("verdict", r.verdict)
    for name, value, sigma in (
        ("roll", r.roll, r.roll_sigma),
        ("pitch", r.pitch, r.pitch_sigma),
        ("heading", r.heading, r.heading_sigma),
    ):
        row(name, _angle(value, sigma))
    row("tilt and azimuth", f"{'':14}1σ {r.tilt_sigma / DEG:.4f}°, {r.azimuth_sigma / DEG:.4f}°")
    for line in r.budget:
        if line.tilt or line.azimuth:
            each = f"{readable_angle(line.tilt)}, {readable_angle(line.azimuth)}"
            row(f"  {line.source}", f"{'':17}{each}")
    if np.all(np.isfinite(r.q_nb)):
        row("q_nb", "  ".join(f"{x:.9f}" for x in r.q_nb))
    _show_quality(r)
    _show_biases(r)
    _show_still(aligned)
    for warning in r.warnings:
        warn(warning)


def _angle(value: float, sigma: float) -> str:
    text = f"{value / DEG:10.4f}°" if np.isfinite(value) else f"{'unknown':>11}"
    return f"{text}   1σ {sigma / DEG:.4f}°"


def _show_quality(r: Alignment) -> None:
    row("|f| - g", f"{r.specific_force_residual * 1e3:+.4f} mm/s²")
    if np.isfinite(r.rate_residual):
        row("|ω| - Ω", f"{r.rate_residual / DEG_PER_H:+.4f} °/h")
    implied = r.implied_latitude
    row("implied latitude", f"{implied / DEG:.4f}°" if np.isfinite(implied) else "unknown")
    if differs(r.gyro_heading, r.heading):
        row("heading by gyros", _angle(r.gyro_heading, r.gyro_heading_sigma))
    if np.all(np.isfinite(r.scatter)):
        north, east, down = r.scatter / DEG
        row("scatter of tenths", f"N {north:.4f}°  E {east:.4f}°  D {down:.4f}°")
    row("stillness, 1 s means", f"{r.force_scatter:.5f} m/s²  {r.rate_scatter / DEG:.5f} °/s")
    if np.isfinite(r.eigenvalue_gap):
        row("eigenvalue gap", f"{r.eigenvalue_gap:.3g}")
    found = r.innovations
    if found is not None:
        says = "consistent" if found.consistent else "not consistent with the model"
        mean = float(np.mean(found.nis))
        row("mean NIS", f"{mean:.3f}, 95 % {found.low:.3f} to {found.high:.3f}: {says}")


def _show_biases(r: Alignment) -> None:
    for name, bias, sigma, unit, sign in (
        ("estimated gyro bias", r.gyro_bias, r.gyro_bias_sigma, DEG_PER_H, "°/h"),
        ("estimated accel. bias", r.accel_bias, r.accel_bias_sigma, UG, "µg"),
    ):
        if bias is None:
            continue
        sigmas = np.full(3, np.nan) if sigma is None else sigma
        axes = (
            f"{axis} {b / unit:+.4g} ± {s / unit:.2g}" if np.isfinite(b) else f"{axis} unknown"
            for axis, b, s in zip("xyz", bias, sigmas, strict=True)
        )
        row(name, "  ".join(axes) + f" {sign}")
    for text in r.unobservable:
        row("unobservable", text)


def _show_still(aligned: AlignedWindow) -> None:
    """The stretch used and the longest others, in order of time."""
    found = dict(enumerate(aligned.still.stretches))
    order = sorted(found, key=lambda i: (i != aligned.chosen, -found[i].duration))
    for i in sorted(order[:_STRETCHES]):
        s = found[i]
        used = ", used" if i == aligned.chosen else ""
        row(
            f"{s.motion} stretch",
            f"{s.start:.1f} s to {s.stop:.1f} s, kept {s.duration:.1f} s, cut {s.cut:.1f} s{used}",
        )
    if len(order) > _STRETCHES:
        row("", f"and {len(order) - _STRETCHES} shorter")


def show_summary(summary: RunSummary) -> None:
    """Print what a run did."""
    final = summary.final
    if final is None:
        return
    roll, pitch, heading = euler_from_quat(final.q_nb) / DEG
    north, east, down = final.v_eb_n
    console.print(
        f"\n[bold]Navigation[/bold]  {summary.reconstruction}, frame {summary.frame}, vertical "
        f"{summary.vertical}"
    )
    row("samples", f"{summary.samples} over {summary.duration:.3f} s")
    bridged = ", ".join(f"{gap.length:.3f} s at {gap.start:.3f} s" for gap in summary.gaps[:5])
    more = ", …" if len(summary.gaps) > 5 else ""
    row("gaps bridged", f"{len(summary.gaps)}" + (f": {bridged}{more}" if bridged else ""))
    if summary.counts.get("STRETCHED"):
        row("stretched samples", f"{summary.counts['STRETCHED']} (1 or 2 missing before)")
    if summary.counts.get("SHORT_WINDOW"):
        row("short windows", f"{summary.counts['SHORT_WINDOW']} (too few samples between gaps)")
    if summary.counts.get("UNAIDED"):
        row("without heights", f"{summary.counts['UNAIDED']} samples, the loop coasted")
    row(
        "final position",
        f"{final.lat / DEG:.9f}°  {final.lon / DEG:.9f}°  {final.h:.4f} m",
    )
    row("final velocity", f"N {north:.5f}  E {east:.5f}  D {down:.5f} m/s")
    row("final attitude", f"roll {roll:.5f}°  pitch {pitch:.5f}°  heading {heading % 360.0:.5f}°")
    row("speed", f"{summary.samples / summary.seconds:,.0f} samples/s, {summary.seconds:.2f} s")
    row("written", str(summary.output))
    for text in (*summary.issues, *summary.notes):
        warn(text)


def show_comparison(found: Comparison) -> None:
    """Print what a comparison found."""
    console.print("\n[bold]Horizontal error[/bold]", f"against {found.reference}")
    lines = [("", [time_text(float(t)) for t in found.epochs])]
    for variant in found.variants:
        lines.append((variant.name, [length_text(x) for x in variant.horizontal[found.epoch_rows]]))
    if found.imu_error is not None:
        lines.append(("IMU, 1σ stated", [length_text(x) for x in found.imu_error]))
    for name, cells in lines:
        console.print(f"{name:<26}" + "".join(f"{cell:>11}" for cell in cells), markup=False)
    console.print()
    for sentence in found.verdict:
        console.print(sentence, markup=False)
    for note in found.notes:
        warn(note)
