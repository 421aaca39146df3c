"""TOML files people write: read, and their values checked."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Any, TypeVar

from align.survey import parse_latitude, parse_longitude, parse_turn
from navgrade.errors import ConfigError

_Choice = TypeVar("_Choice", bound=str)
_Value = TypeVar("_Value")
Keys = Mapping[str, Sequence[str]]


_TIME = re.compile(r"^(?P<whole>[^.]+?)(?:\.(?P<fraction>\d{1,9}))?(?P<zone>Z|[+-]\d\d:?\d\d)?$")
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def parse_time_ns(value: object) -> int:
    """Unix time, ns, of ``2026-01-01T00:00:00.500Z`` or a TOML date-time; UTC if no zone.

    Raises
    ------
    ValueError
        If it is neither.
    """
    fraction = ""
    if isinstance(value, datetime):
        moment = value
    else:
        match = _TIME.match(value) if isinstance(value, str) else None
        if match is None:
            raise ValueError(f"{value!r} is not a time such as 2026-01-01T00:00:00.500Z")
        fraction = match["fraction"] or ""
        try:
            moment = datetime.fromisoformat(match["whole"] + (match["zone"] or ""))
        except ValueError:
            raise ValueError(f"{value!r} is not a time such as 2026-01-01T00:00:00.500Z") from None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    span = moment - _EPOCH
    whole = (span.days * 86_400 + span.seconds) * 1_000_000_000 + span.microseconds * 1000
    return whole + int(fraction.ljust(9, "0"))


class Table:
    """One table of a TOML file; takes its values with their types checked.

    Parameters
    ----------
    file : str
        For messages.
    path : str
        Dotted name of the table; empty for the whole file.
    values : mapping
    keys : mapping of str to sequence of str
        The keys each table may hold, by its path.
    name : str, optional
        What messages call it; its path by default.

    Raises
    ------
    ConfigError
        Here and in every method: naming the file, the key and, for an unknown key, the nearest
        allowed one.
    """

    def __init__(
        self, file: str, path: str, values: Any, keys: Keys, name: str | None = None
    ) -> None:
        self.name = path if name is None else name
        if not isinstance(values, Mapping):
            raise ConfigError(f"{self.name} must be a table, [{path}]", file=file, key=self.name)
        self.file = file
        self.path = path
        self.values = values
        self._keys = keys
        for key in values:
            if key not in keys[path]:
                raise self.error(key, self._unknown(key))

    def _unknown(self, key: str) -> str:
        near = difflib.get_close_matches(key, self._keys[self.path], n=1, cutoff=0.0)
        where = f" in [{self.name}]" if self.name else ""
        return f"unknown key{where}; the nearest allowed key is {near[0]}"

    def error(self, key: str, text: str) -> ConfigError:
        path = f"{self.name}.{key}" if self.name else key
        return ConfigError(f"{path}: {text}", file=self.file, key=path)

    def table(self, key: str) -> Table:
        """The table under a key; an empty one where there is none."""
        path = f"{self.path}.{key}" if self.path else key
        return Table(self.file, path, self.values.get(key, {}), self._keys)

    def rows(self, key: str, by: str | None = None) -> list[Table]:
        """The tables of an array of tables, [[key]]; none where there is no such key.

        Parameters
        ----------
        key : str
        by : str, optional
            The key whose value says which keys a table may hold: those of ``path.value``.
        """
        path = f"{self.path}.{key}" if self.path else key
        rows = self.values.get(key, [])
        if not isinstance(rows, list):
            raise self.error(key, f"must be an array of tables, [[{path}]]")
        return [
            self._row(path, values, f"{path} {number}", by) for number, values in enumerate(rows, 1)
        ]

    def _row(self, path: str, values: Any, name: str, by: str | None) -> Table:
        if by is not None and isinstance(values, Mapping):
            kinds = [known.removeprefix(f"{path}.") for known in self._keys if f"{path}." in known]
            chosen = Table(self.file, "", {by: values.get(by)}, {"": (by,)}, name)
            chosen.required(by, chosen.choice(by, kinds))
            path = f"{path}.{values[by]}"
        return Table(self.file, path, values, self._keys, name)

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def text(self, key: str) -> str | None:
        value = self.values.get(key)
        if value is not None and not isinstance(value, str):
            raise self.error(key, f"must be text, got {value!r}")
        return value

    def choice(self, key: str, allowed: Iterable[_Choice]) -> _Choice | None:
        value = self.text(key)
        choices = list(allowed)
        for known in choices:
            if value == known:
                return known
        if value is None:
            return None
        (near,) = difflib.get_close_matches(value, choices, n=1, cutoff=0.0)
        raise self.error(
            key, f"{value!r} is not one of {', '.join(choices)}; the nearest is {near}"
        )

    def required(self, key: str, value: _Value | None) -> _Value:
        """`value`, unless there is none."""
        if value is None:
            raise self.error(key, "is required")
        return value

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        least: float = -math.inf,
        above: float = -math.inf,
    ) -> float:
        value = self.required(key, self.values.get(key, default))
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise self.error(key, f"must be a number, got {value!r}")
        if not math.isfinite(value) or value < least or value <= above:
            limits = [f"at least {least:g}"] if least > -math.inf else []
            limits += [f"above {above:g}"] if above > -math.inf else []
            raise self.error(key, f"must be {' and '.join(['finite', *limits])}, got {value!r}")
        return float(value)

    def optional(self, key: str, **limits: float) -> float | None:
        """A number, or None where there is none."""
        return self.number(key, **limits) if key in self else None

    def integer(self, key: str, default: int) -> int:
        value = self.values.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            raise self.error(key, f"must be a whole number, not negative, got {value!r}")
        return value

    def flag(self, key: str) -> bool:
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            raise self.error(key, f"must be true or false, got {value!r}")
        return value

    def numbers(self, key: str, count: int, default: Sequence[float] | None = None) -> list[float]:
        """As many finite numbers."""
        value = self.required(key, self.values.get(key, default))
        good = isinstance(value, Sequence) and len(value) == count
        if not good or not all(
            isinstance(x, (int, float)) and not isinstance(x, bool) and math.isfinite(x)
            for x in value
        ):
            raise self.error(key, f"must be {count} finite numbers, got {value!r}")
        return [float(x) for x in value]

    def positive(self, key: str) -> float | None:
        return self.optional(key, least=0.0)

    def time_ns(self, key: str) -> int:
        """Unix time, ns; see `parse_time_ns`."""
        value = self.required(key, self.values.get(key))
        try:
            if isinstance(value, date) and not isinstance(value, datetime):
                raise ValueError(f"{value!r} is a date without a time")
            return parse_time_ns(value)
        except ValueError as error:
            raise self.error(key, str(error)) from None

    def latitude(self) -> float:
        return self._angle("latitude", parse_latitude)

    def longitude(self) -> float:
        return self._angle("longitude", parse_longitude)

    def turn(self, key: str) -> float:
        """An angle clockwise, rad, of degrees or degrees, minutes, seconds; 0 where there is none.

        See `align.survey.parse_turn`.
        """
        return self._angle(key, parse_turn) if key in self else 0.0

    def _angle(self, key: str, parse: Callable[[Any], float]) -> float:
        if key not in self:
            raise self.error(key, "is required")
        try:
            return parse(self.values[key])
        except ValueError as error:
            raise self.error(key, str(error)) from None

    def height(self) -> float:
        ellipsoidal = "height_m" in self
        orthometric = "orthometric_height_m" in self
        if ellipsoidal and orthometric:
            raise self.error("height_m", "give it or orthometric_height_m, not both")
        if ellipsoidal and "geoid_height_m" in self:
            raise self.error("geoid_height_m", "belongs to orthometric_height_m, not to height_m")
        if ellipsoidal:
            return self.number("height_m")
        if orthometric:
            if "geoid_height_m" not in self:
                raise self.error(
                    "orthometric_height_m",
                    "is above sea level; navigation needs the height above the ellipsoid, so add "
                    "geoid_height_m (undulation at the site) or give height_m",
                )
            return self.number("orthometric_height_m") + self.number("geoid_height_m")
        raise self.error("height_m", "is required (above the ellipsoid)")


def read_toml(path: Path, keys: Keys, what: str) -> tuple[Table, bytes]:
    """The whole file as a table, and its text as read.

    Raises
    ------
    ConfigError
        Where there is no such file, or it is not TOML; `what` names its kind.
    """
    file = str(path)
    try:
        text = path.read_bytes()
        values = tomllib.loads(text.decode())
    except FileNotFoundError:
        raise ConfigError(f"no such {what}", file=file) from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"cannot be read: {error}", file=file) from None
    return Table(file, "", values, keys), text
