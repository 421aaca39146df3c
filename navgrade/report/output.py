"""Folders of outputs."""

from __future__ import annotations

from pathlib import Path

from navgrade.errors import ConfigError
from navgrade.logs import check_output


def places(folder: Path, names: tuple[str, ...], *, overwrite: bool) -> tuple[Path, ...]:
    """Where to write in `folder`, which is made if only it is missing.

    Raises
    ------
    ConfigError
        If one of the files exists and must not be overwritten, or the folder cannot be made.
    """
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"the output folder {folder} is a file")
    if not folder.parent.is_dir():
        raise ConfigError(f"the folder {folder.parent} of the output does not exist")
    folder.mkdir(exist_ok=True)
    paths = tuple(folder / name for name in names)
    for path in paths:
        check_output(path, overwrite=overwrite)
    return paths
