"""Options the commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

F = TypeVar("F", bound=Callable[..., Any])


def path_or_url(context: click.Context, parameter: click.Parameter, value: Any) -> Any:
    """Keep a URL as it is: a path would lose one of its slashes."""
    if isinstance(value, tuple):
        return tuple(path_or_url(context, parameter, each) for each in value)
    return value if "://" in value else Path(value)


log_argument = click.argument("log", metavar="LOG.mcap", callback=path_or_url)

_SITE = click.option(
    "-c",
    "--config",
    "site_file",
    required=True,
    type=click.Path(path_type=Path),
    metavar="SITE.toml",
    help="Site file: IMU, survey, alignment window.",
)
_IMU = (
    click.option("--imu-topic", help="IMU topic; needed when the log has several."),
    click.option(
        "--kind",
        help="What the samples are: rate (instantaneous), average (mean over the interval that "
        "ends at the stamp), increment, or compensated.",
    ),
    click.option("--axes", help="Where x, y, z point: FRD, FLU, RFU or 'x=-up y=left z=forward'."),
    click.option("--strict", is_flag=True, help="Refuse a damaged log instead of using the rest."),
)


def imu_options(command: F) -> F:
    """Add the options that name and describe the IMU."""
    for option in reversed(_IMU):
        command = option(command)
    return command


def source_options(command: F) -> F:
    """Add the site file and the options that name and describe the IMU."""
    return _SITE(imu_options(command))
