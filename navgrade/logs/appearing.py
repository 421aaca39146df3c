"""Files that appear under their name only when they are complete."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from navgrade.logs.container.writer import check_output


@contextmanager
def appearing(path: Path, *, overwrite: bool) -> Iterator[BinaryIO]:
    """Write to ``PATH.part``, brought to the disk and renamed when the block ends.

    On an exception the part is removed, and what was at `path` before stays.

    Raises
    ------
    ConfigError
        If `path` exists and must not be overwritten, or its folder does not exist.
    """
    check_output(path, overwrite=overwrite)
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
