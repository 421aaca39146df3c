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


def _bar(what: str, *, hidden: bool = False) -> Progress:
    return Progress(
        TextColumn(what),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=hidden or not console.is_terminal,
    )


@contextmanager
def progress_bar(what: str, file: str | Path) -> Iterator[Callable[[int], None]]:
    """A bar on a terminal; yields the function that takes the bytes of the file read so far."""
    with _bar(what) as bar:
        known = isinstance(file, Path) and file.is_file()
        task = bar.add_task("", total=Path(file).stat().st_size if known else None)
        yield lambda done: bar.update(task, completed=done)


@contextmanager
def count_bar(what: str, *, hidden: bool = False) -> Iterator[Callable[[int, int], None]]:
    """A bar on a terminal; yields the function that takes how many are done of how many."""
    with _bar(what, hidden=hidden) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
