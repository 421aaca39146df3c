"""navgrade align"""

from __future__ import annotations

import json
from pathlib import Path

import click

from navgrade.alignment import align_log, alignment_report
from navgrade.cli.options import log_argument, source_options
from navgrade.cli.show import show_alignment, show_source
from navgrade.job import Choices, open_log
from navgrade.site import read_site


@click.command("align")
@log_argument
@source_options
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(
    log: str | Path,
    site_file: Path,
    imu_topic: str | None,
    kind: str | None,
    axes: str | None,
    strict: bool,
    as_json: bool,
) -> None:
    """Find the attitude of the IMU on LOG's still part and report how well it is known."""
    site = read_site(site_file)
    source = open_log(log, site, Choices(imu_topic, kind, axes, strict=strict))
    aligned = align_log(source, site)
    if as_json:
        click.echo(json.dumps(alignment_report(aligned), indent=2))
        return
    show_source(source, axes_given=bool(axes or site.axes))
    show_alignment(aligned)
