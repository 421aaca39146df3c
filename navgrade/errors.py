"""Errors a user can act on. Each carries its data as attributes and reads as one sentence."""

from __future__ import annotations

from earth.errors import NavgradeError


class ConfigError(NavgradeError):
    """The site file or an option is wrong.

    Attributes
    ----------
    file : str or None
    key : str or None
        Path of the key, such as ``imu.kind``.
    """

    def __init__(self, message: str, *, file: str | None = None, key: str | None = None) -> None:
        where = f"{file}: " if file else ""
        super().__init__(f"{where}{message}")
        self.file = file
        self.key = key


class LogError(NavgradeError):
    """A log cannot be used as it is.

    Attributes
    ----------
    file, topic : str or None
    index : int or None
        Message index within the topic.
    time_s : float or None
        Seconds since the first sample.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        topic: str | None = None,
        index: int | None = None,
        time_s: float | None = None,
    ) -> None:
        where = ", ".join(part for part in (file, topic) if part)
        super().__init__(f"{where}: {message}" if where else message)
        self.file = file
        self.topic = topic
        self.index = index
        self.time_s = time_s


class SchemaError(LogError):
    """A topic's schema or encoding is not one this program reads."""


class GapError(LogError):
    """The log has a gap that was not allowed to be bridged."""


class StateTimeError(NavgradeError, ValueError):
    """The samples do not hold the instant of the initial state."""


class NumericalError(NavgradeError):
    """The mechanization cannot go on.

    Attributes
    ----------
    index : int
        Sample at which it stopped.
    t : float
        Its time, s since the epoch.
    """

    def __init__(self, message: str, *, index: int, t: float) -> None:
        super().__init__(message)
        self.index = index
        self.t = t
