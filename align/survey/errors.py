"""Why survey data were refused."""

from __future__ import annotations

from earth.errors import NavgradeError


class SurveyError(NavgradeError):
    """A mark, a line or an azimuth cannot be used as it stands.

    Attributes
    ----------
    file : str or None
    line : int or None
        In the file, from 1.
    """

    def __init__(self, message: str, *, file: str | None = None, line: int | None = None) -> None:
        where = ", ".join([*([file] if file else []), *([f"line {line}"] if line else [])])
        super().__init__(f"{where}: {message}" if where else message)
        self.file = file
        self.line = line
