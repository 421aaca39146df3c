"""navgrade compare"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import click

from navgrade.cli.options import log_argument, source_options
from navgrade.cli.show import show_comparison, show_source
from navgrade.cli.terminal import console, count_bar, row
from navgrade.compare.study import EPOCHS, SOLUTIONS, compare
from navgrade.config import parse_time_ns
from navgrade.errors import ConfigError
from navgrade.job import Choices, open_log
from navgrade.logs import Track, check_output, list_topics, read_aiding, read_track_csv, track_of
from navgrade.reconstruction import DEFAULT
from navgrade.report import as_dict, write_page, write_pictures, write_tables
from navgrade.site import read_site


@click.command("compare")
@log_argument
@source_options
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    metavar="REPORT.html",
    help="One page that needs nothing else; appears when it is complete.",
)
@click.option(
    "--truth",
    metavar="TOPIC|CSV",
    help="What to compare with: a topic of LOG, or a text file (docs/compare.md).",
)
@click.option(
    "--truth-epoch",
    metavar="TIME",
    help="When time 0 of the truth is, such as 2026-01-01T00:00:00Z; Unix times need none.",
)
@click.option(
    "--duration",
    type=float,
    default=EPOCHS[-1],
    metavar="S",
    help=f"Of navigation, at most. Default: {EPOCHS[-1]:g}.",
)
@click.option("--reconstruction", help=f"Of the full engine. Default: {DEFAULT}.")
@click.option(
    "--png", type=click.Path(path_type=Path), metavar="FOLDER", help="Write pictures there, too."
)
@click.option(
    "--csv", type=click.Path(path_type=Path), metavar="FOLDER", help="Write tables there, too."
)
@click.option("--json", "as_json", is_flag=True, help="Print the figures as JSON, nothing else.")
@click.option("--bridge-gaps", is_flag=True, help="Interpolate across gaps instead of stopping.")
@click.option("--overwrite", is_flag=True, help="Replace what is there.")
def command(
    log: str | Path,
    site_file: Path,
    imu_topic: str | None,
    kind: str | None,
    axes: str | None,
    strict: bool,
    output: Path,
    truth: str | None,
    truth_epoch: str | None,
    duration: float,
    reconstruction: str | None,
    png: Path | None,
    csv: Path | None,
    as_json: bool,
    bridge_gaps: bool,
    overwrite: bool,
) -> None:
    """Navigate LOG with the full engine, over a flat world, and with one term of the Earth left
    out at a time; say what each costs."""
    check_output(output, overwrite=overwrite)
    site = read_site(site_file)
    choices = Choices(
        topic=imu_topic,
        kind=kind,
        axes=axes,
        reconstruction=reconstruction,
        bridge_gaps=bridge_gaps,
        strict=strict,
    )
    source = open_log(log, site, choices)
    if not as_json:
        show_source(source, axes_given=bool(axes or site.axes))
    known = None if truth is None else _truth(log, truth, truth_epoch, strict=strict)
    with count_bar("comparing", SOLUTIONS) as progress:
        found = compare(source, site, choices, truth=known, duration=duration, progress=progress)
    write_page(found, output, overwrite=overwrite)
    if png is not None:
        write_pictures(found, png, overwrite=overwrite)
    if csv is not None:
        write_tables(found, csv, overwrite=overwrite)
    if as_json:
        click.echo(json.dumps(as_dict(found), indent=2, allow_nan=False))
        return
    show_comparison(found)
    row("written", ", ".join(str(path) for path in (output, png, csv) if path is not None))
    console.print()


def _truth(log: str | Path, truth: str, epoch: str | None, *, strict: bool) -> Track:
    """A text file of that name, or else a topic of the log."""
    path = Path(truth)
    if path.is_file():
        track = read_track_csv(path)
        if epoch is None or track.time_ns is None:
            return track
        try:
            epoch_ns = parse_time_ns(epoch)
        except ValueError as error:
            raise ConfigError(f"--truth-epoch: {error}") from None
        return replace(track, time_ns=track.time_ns + epoch_ns, is_unix=True)
    if truth not in {topic.name for topic in list_topics(log)}:
        raise ConfigError(
            f"--truth {truth}: there is neither a file nor a topic of {log} of this name"
        )
    return track_of(read_aiding(log, truth, strict=strict), str(log))
