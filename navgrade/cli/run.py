"""navgrade run"""

from __future__ import annotations

from pathlib import Path

import click

from earth.gravity import GRAVITY_MODELS
from navgrade.cli.options import log_argument, source_options
from navgrade.cli.show import show_alignment, show_source, show_summary, show_survey
from navgrade.cli.terminal import progress_bar
from navgrade.job import Choices, open_log, run
from navgrade.logs import POSE_RATE
from navgrade.mechanization import FLAT_WORLD, MECHANIZATIONS, VERTICAL
from navgrade.reconstruction import CAUSAL, DEFAULT, RECONSTRUCTIONS
from navgrade.site import read_site


@click.command("run")
@log_argument
@source_options
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    metavar="OUT.mcap",
    help="Appears when it is complete.",
)
@click.option("--reconstruction", help=f"{', '.join(RECONSTRUCTIONS)}. Default: {DEFAULT}.")
@click.option("--causal", is_flag=True, help=f"Use no later samples: --reconstruction {CAUSAL}.")
@click.option(
    "--frame",
    help=f"{', '.join(MECHANIZATIONS)}. For comparison, a flat world: {', '.join(FLAT_WORLD)}.",
)
@click.option("--vertical", help=f"{', '.join(VERTICAL)} (heights: [baro] in SITE.toml).")
@click.option("--gravity", help=f"{', '.join(GRAVITY_MODELS)}.")
@click.option("--output-rate", type=float, metavar="HZ", help="Default: every sample.")
@click.option(
    "--pose-rate",
    type=float,
    default=POSE_RATE,
    metavar="HZ",
    help=f"Of odometry and transforms for 3D views, at most; 0: none. Default: {POSE_RATE:g}.",
)
@click.option("--location-fix", is_flag=True, help="Write fixes in Foxglove's message, too.")
@click.option(
    "--copy-topics",
    multiple=True,
    metavar="TOPIC",
    help="Carry a topic of LOG over unchanged; may be given several times.",
)
@click.option("--bridge-gaps", is_flag=True, help="Interpolate across gaps instead of stopping.")
@click.option("--overwrite", is_flag=True, help="Replace OUT.mcap.")
def command(
    log: str | Path,
    site_file: Path,
    imu_topic: str | None,
    kind: str | None,
    axes: str | None,
    strict: bool,
    output: Path,
    reconstruction: str | None,
    causal: bool,
    frame: str | None,
    vertical: str | None,
    gravity: str | None,
    output_rate: float | None,
    pose_rate: float,
    location_fix: bool,
    copy_topics: tuple[str, ...],
    bridge_gaps: bool,
    overwrite: bool,
) -> None:
    """Align on LOG's still part, navigate through the rest, and write the solution."""
    if causal and reconstruction not in (None, CAUSAL):
        raise click.UsageError(
            f"--causal means --reconstruction {CAUSAL}; give it or {reconstruction!r}, not both"
        )
    site = read_site(site_file)
    choices = Choices(
        topic=imu_topic,
        kind=kind,
        axes=axes,
        reconstruction=CAUSAL if causal else reconstruction,
        frame=frame,
        vertical=vertical,
        gravity=gravity,
        bridge_gaps=bridge_gaps,
        strict=strict,
    )
    source = open_log(log, site, choices)
    show_source(source, axes_given=bool(axes or site.axes))
    show_survey(site)
    with progress_bar("navigating", log) as progress:
        summary = run(
            source,
            site,
            output,
            choices,
            rate_hz=output_rate,
            pose_rate_hz=pose_rate,
            location_fix=location_fix,
            copy_topics=copy_topics,
            overwrite=overwrite,
            progress=progress,
            aligned=show_alignment,
        )
    show_summary(summary)
