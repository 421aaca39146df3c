"""navgrade simulate"""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import click
import numpy as np

from earth.rotation import euler_from_quat
from earth.units import DEG, DEG_PER_S, STANDARD_GRAVITY
from navgrade.cli.terminal import console, count_bar, row, warn
from navgrade.errors import ConfigError
from navgrade.logs import check_output
from navgrade.sensors import SHEET
from navgrade.simulate.scenario import Scenario, read_scenario
from navgrade.simulate.simulation import Simulated, simulate
from navgrade.simulate.site_file import site_text


@click.command("simulate")
@click.argument("scenario_file", type=click.Path(path_type=Path), metavar="SCENARIO.toml")
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    metavar="LOG.mcap",
    help="Appears when it is complete.",
)
@click.option("--overwrite", is_flag=True, help="Replace LOG.mcap, and SITE.toml.")
@click.option("--seed", type=click.IntRange(min=0), help="Instead of that of the scenario.")
@click.option(
    "--site",
    "site_file",
    type=click.Path(path_type=Path),
    metavar="SITE.toml",
    help="Write the site file with which `navgrade run` navigates the log.",
)
def command(
    scenario_file: Path, output: Path, overwrite: bool, seed: int | None, site_file: Path | None
) -> None:
    """Simulate an IMU, its truth and fixes along the motion of a scenario."""
    for path in (output, site_file):
        if path is None:
            continue
        if path.exists() and scenario_file.exists() and path.samefile(scenario_file):
            raise ConfigError(f"the output {path} is the scenario")
        check_output(path, overwrite=overwrite)
    scenario = read_scenario(scenario_file)
    if seed is not None:
        scenario = scenario.with_seed(seed)
    total = round(scenario.duration * scenario.imu.rate_hz)
    with count_bar("simulating", total) as progress:
        made = simulate(scenario, output, overwrite=overwrite, progress=progress)
    _show(scenario, made)
    if site_file is not None:
        site_file.write_text(site_text(scenario, made))
        row("site file", str(site_file))
    for text in made.warnings:
        warn(text)


def _show(scenario: Scenario, made: Simulated) -> None:
    imu, found = scenario.imu, made.extremes
    start = datetime.fromtimestamp(scenario.start_ns // 1_000_000_000, UTC)
    console.print(
        f"{scenario.file}  {imu.rate_hz:g} Hz, kind {imu.kind}, axes {made.axes}", markup=False
    )
    row("start", f"{start:%Y-%m-%d %H:%M:%S} UTC")
    row("duration", f"{made.duration:.3f} s, {made.distance:.1f} m over ground")
    lost = f", {made.lost} lost" if made.lost else ""
    row("samples", f"{made.samples} on {made.topic}{lost}")
    row("truth", f"{made.truth} on /truth/solution")
    if made.fixes:
        row("fixes", f"{made.fixes} on /gnss/fix")
    row("largest rate", f"{found.omega / DEG_PER_S:.3f} °/s at {found.omega_t:.1f} s")
    row(
        "largest force",
        f"{found.f:.3f} m/s², {found.f / STANDARD_GRAVITY:.3f} g, at {found.f_t:.1f} s",
    )
    row("largest speed", f"{found.speed:.3f} m/s at {found.speed_t:.1f} s")
    _show_errors(scenario, made)
    state = made.first
    roll, pitch, heading = euler_from_quat(state.q_nb) / DEG
    north, east, down = state.v_eb_n
    row("at the first sample", f"{state.lat / DEG:.9f}°  {state.lon / DEG:.9f}°  {state.h:.4f} m")
    row("velocity", f"N {north:.5f}  E {east:.5f}  D {down:.5f} m/s")
    row("attitude", f"roll {roll:.5f}°  pitch {pitch:.5f}°  heading {heading % 360.0:.5f}°")
    row("written", str(made.output))


def _show_errors(scenario: Scenario, made: Simulated) -> None:
    imu = scenario.imu
    name = f"grade {imu.grade}, seed {imu.seed}" if imu.grade else f"seed {imu.seed}"
    lines = []
    for key, entry in SHEET.items():
        value = np.atleast_1d(getattr(getattr(made.errors, entry.part), entry.field))
        if entry.count == 6:
            value = value[~np.eye(3, dtype=bool)]
        if not value.any() or not np.isfinite(value).all():
            continue
        numbers = "  ".join(f"{x:.5g}" for x in value / entry.factor)
        lines.append((key, f"{numbers} {entry.unit}"))
    row("errors", name if lines else "none")
    for key, text in lines:
        row(f"  {key}", text)
