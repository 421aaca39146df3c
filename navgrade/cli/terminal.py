"""The terminal, and how lines are written on it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

console = Console(highlight=False, soft_wrap=True)


def row(name: str, text: str) -> None:
    """Print one line of a report."""
    console.print(f"{name:<22}{text}", markup=False)


def warn(text: str) -> None:
    """Print a warning."""
    console.print(f"warning: {text}", style="yellow", markup=False)


@contextmanager
def count_bar(what: str, total: int | None) -> Iterator[Callable[[int], None]]:
    """A bar on a terminal; yields the function that takes how many of the total are done."""
    bar = Progress(
        TextColumn(what),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    with bar:
        task = bar.add_task("", total=total)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def progress_bar(what: str, file: str | Path) -> Iterator[Callable[[int], None]]:
    """A bar whose total is the bytes of a file, where they are known."""
    known = isinstance(file, Path) and file.is_file()
    with count_bar(what, Path(file).stat().st_size if known else None) as progress:
        yield progress
