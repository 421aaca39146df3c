"""The command line. One file per command; it reads options, calls, and prints."""

from __future__ import annotations

import signal
import sys
from importlib import import_module
from types import FrameType
from typing import Any, NoReturn

import click

_COMMANDS = {
    "run": "Align on a log's still part and navigate through the rest.",
    "align": "Print the alignment report alone.",
    "compare": "Say what a flat world and each term of the Earth cost on a log.",
    "inspect": "List topics, rates and defects of a log.",
    "convert": "Turn a log into increments or a table, or a table into a log.",
    "simulate": "Make the log of an IMU along a motion, with its truth.",
}


class _Commands(click.Group):
    """Loads a command's module when it is called, so that --help answers at once."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in _COMMANDS:
            return None
        command: click.Command = import_module(f"navgrade.cli.{name}").command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(_COMMANDS.items()))


@click.group(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="navgrade")
def cli() -> None:
    """From a logged IMU to a navigation solution."""


def _terminated(signum: int, frame: FrameType | None) -> NoReturn:
    sys.exit(128 + signum)


def main(args: list[str] | None = None) -> NoReturn:
    """Run the command line; exit code 2 and one sentence on anything a user can mend."""
    signal.signal(signal.SIGTERM, _terminated)  # so that a half-written output is removed
    try:
        result: Any = cli.main(args, prog_name="navgrade", standalone_mode=False)
        sys.exit(result if isinstance(result, int) else 0)
    except click.exceptions.Abort:
        click.echo("navgrade: interrupted", err=True)
        sys.exit(130)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except Exception as error:
        from earth.errors import NavgradeError  # late: --help does without the packages

        if not isinstance(error, (NavgradeError, OSError)):
            raise
        click.echo(f"navgrade: {error}", err=True)
        sys.exit(2)
