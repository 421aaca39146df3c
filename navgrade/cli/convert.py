"""navgrade convert"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import click

from navgrade.cli.options import imu_options
from navgrade.cli.show import show_source
from navgrade.cli.terminal import console, progress_bar, row, warn
from navgrade.config import parse_time_ns
from navgrade.errors import ConfigError
from navgrade.imu import KIND_HELP, Kind
from navgrade.job import Choices, open_log
from navgrade.logs import ImuLog, Issue, check_output
from navgrade.logs.convert import convert_imu, topic_columns, write_table
from navgrade.logs.tables import SampleTable
from navgrade.logs.topics import open_known
from navgrade.site import Site, read_site

_UNITS = "s, ms, us or ns"
_TEXT = (".csv", ".tsv", ".txt")


@click.command("convert")
@click.argument("source", type=click.Path(path_type=Path), metavar="INPUT")
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(path_type=Path),
    metavar="OUT",
    help="Ends in .mcap, .csv or .parquet; appears when it is complete.",
)
@click.option(
    "-c",
    "--config",
    "site_file",
    type=click.Path(path_type=Path),
    metavar="SITE.toml",
    help="Site file, for what its [imu] says of the log.",
)
@imu_options
@click.option("--topic", help="Write a topic's members as they are, to .csv or .parquet.")
@click.option("--start-s", type=float, help="Leave out what is earlier, s after the first sample.")
@click.option("--end-s", type=float, help="Leave out this instant and what is later.")
@click.option("--overwrite", is_flag=True, help="Replace OUT.")
@click.option("--time", metavar="COL", help="Column of time: INPUT is a text file.")
@click.option("--time-unit", help=f"{_UNITS}. Default: s.")
@click.option("--epoch", metavar="TIME", help="When that time was 0, as 2026-01-31T12:00:00Z.")
@click.option("--gyro", metavar="X,Y,Z", help="Columns of angular rate or its increment.")
@click.option("--accel", metavar="X,Y,Z", help="Columns of specific force or its increment.")
@click.option("--interval", metavar="COL", help="Column of the length of each interval.")
@click.option("--interval-unit", help=f"{_UNITS}. Default: that of the time.")
@click.option("--gyro-unit", help="rad/s or deg/s, of the rate. Default: rad/s.")
@click.option("--accel-unit", help="m/s^2 or g, of the specific force. Default: m/s^2.")
@click.option("--delimiter", help="A character, tab, or space for any blanks. Default: a comma.")
def command(
    source: Path,
    output: Path,
    site_file: Path | None,
    imu_topic: str | None,
    kind: str | None,
    axes: str | None,
    strict: bool,
    topic: str | None,
    start_s: float | None,
    end_s: float | None,
    overwrite: bool,
    **columns: str | None,
) -> None:
    """Write an IMU as increments (.mcap) or as a table (.csv, .parquet).

    INPUT is a log, of which any IMU topic of a known type is read; or a text file of samples, whose
    columns --time, --gyro and --accel name, by the header in its first line or by number from 1.

    Means become increments by their intervals. The rates of a text file stay rates.
    """
    if output.exists() and source.exists() and output.samefile(source):
        raise ConfigError(f"the output {output} is the input")
    check_output(output, overwrite=overwrite)
    told = {name: value for name, value in columns.items() if value is not None}
    if "time" in told:
        _refuse({"config": site_file, "imu-topic": imu_topic, "topic": topic, "strict": strict})
    elif told or source.suffix in _TEXT:
        raise ConfigError("a text file of samples needs --time, --gyro and --accel, its columns")
    window = {"start": start_s, "end": end_s}
    imu: ImuLog | SampleTable
    known: list[str] = []
    if topic is not None:
        with progress_bar("converting", source) as progress:
            log = open_known(source, progress)
            rows = topic_columns(log, topic, progress=progress, **window)
            count = write_table(output, rows, overwrite=overwrite)
        row("written", f"{output}, {count} messages")
        _warn(log.issues)
        return
    if told:
        imu = _table(source, kind, axes, told)
        console.print(f"{source}  kind {imu.kind}, axes {imu.axes}", markup=False)
    else:
        site = read_site(site_file) if site_file else Site("", b"")
        imu = open_log(source, site, Choices(imu_topic, kind, axes, strict=strict))
        show_source(imu, axes_given=bool(axes or site.axes))
        known = imu.notes
    with progress_bar("converting", source) as progress:
        written = convert_imu(imu, output, progress=progress, overwrite=overwrite, **window)
    row("written", f"{output}, {written.count} samples: {written.what}")
    if isinstance(imu, ImuLog):
        _warn(imu.issues)
        for note in imu.notes:
            if note not in known:
                warn(note)


def _warn(issues: list[Issue]) -> None:
    for issue in issues:
        warn(f"{issue.text} (byte {issue.offset})")


def _refuse(options: Mapping[str, object]) -> None:
    """Raise for an option that has no meaning for a text file."""
    for name, value in options.items():
        if value:
            raise ConfigError(f"--{name} is about a log, but --time makes the input a text file")


def _table(source: Path, kind: str | None, axes: str | None, told: dict[str, Any]) -> SampleTable:
    """The text file the options describe."""
    if kind is None:
        raise ConfigError(
            f"a text file does not say what its numbers are; set --kind to {KIND_HELP}"
        )
    if axes is None:
        raise ConfigError(
            "a text file does not say where x, y and z point; set --axes to FRD, FLU, RFU or "
            "'x=-up y=left z=forward'"
        )
    for name in ("gyro", "accel"):
        told[name] = tuple(column.strip() for column in told.get(name, "").split(","))
    try:
        told["epoch_ns"] = parse_time_ns(told.pop("epoch")) if "epoch" in told else 0
    except ValueError as error:
        raise ConfigError(f"--epoch: {error}") from None
    return SampleTable(source, kind=cast(Kind, kind), axes=axes, **told)
