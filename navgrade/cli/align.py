"""navgrade align"""

from __future__ import annotations

import json
from pathlib import Path

import click

from navgrade.alignment import align_log, align_logs, alignment_report
from navgrade.cli.options import path_or_url, source_options
from navgrade.cli.show import show_alignment, show_source, show_survey
from navgrade.cli.terminal import progress_bar, warn
from navgrade.job import Choices, open_log
from navgrade.report import write_alignment_page
from navgrade.site import read_site

TOGETHER = "multi-position"


@click.command("align")
@click.argument("logs", metavar="LOG.mcap...", nargs=-1, required=True, callback=path_or_url)
@source_options
@click.option(
    "--method",
    help="auto, triad, gyrocompass, wahba, known-heading, level, inertial (swaying base), fine "
    "(zero-velocity Kalman filter) or multi-position (several logs, or stops of one).",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, with the convergence.")
@click.option(
    "--plot", type=click.Path(path_type=Path), metavar="OUT.html", help="Write a page with plots."
)
@click.option("--overwrite", is_flag=True, help="Replace OUT.html.")
def command(
    logs: tuple[str | Path, ...],
    site_file: Path,
    imu_topic: str | None,
    kind: str | None,
    axes: str | None,
    strict: bool,
    method: str | None,
    as_json: bool,
    plot: Path | None,
    overwrite: bool,
) -> None:
    """Find the attitude of the IMU where LOG is still and report how well it is known.

    Several logs are still orientations of one IMU at one place; they are aligned together.
    """
    site = read_site(site_file)
    choices = Choices(imu_topic, kind, axes, strict=strict)
    sources = [open_log(log, site, choices) for log in logs]
    if len(sources) > 1 and method not in (None, "auto", TOGETHER):
        raise click.UsageError(f"several logs are aligned by {TOGETHER}, one by {method}")
    if len(sources) > 1 or (method or site.method) == TOGETHER:
        found = align_logs(sources, site)
    else:
        with progress_bar("reading", logs[0]) as progress:
            found = [align_log(sources[0], site, method, level_allowed=True, progress=progress)]
    if plot is not None:
        assert site.place is not None
        write_alignment_page(
            found[-1],
            plot,
            log_name=str(logs[-1]),
            site_name=str(site_file),
            lat=site.place.lat,
            overwrite=overwrite,
        )
    defects = [f"{issue.text} (byte {issue.offset})" for log in sources for issue in log.issues]
    if as_json:
        reports = [
            alignment_report(aligned, curve=True) | {"defects": defects} for aligned in found
        ]
        click.echo(json.dumps(reports[0] if len(reports) == 1 else reports, indent=2))
        return
    for k, aligned in enumerate(found):
        if k < len(sources):
            show_source(sources[k], axes_given=bool(axes or site.axes))
        show_alignment(aligned)
    show_survey(site)
    for text in defects:
        warn(text)
