"""Heights for the vertical channel, from a topic of pressures or of heights."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from navgrade.errors import ConfigError, LogError, SchemaError
from navgrade.logs.container import Columns, Issue, McapFile
from navgrade.logs.schemas import FLUID_PRESSURE, HEADER_STAMP, HEIGHT_SCHEMAS
from navgrade.logs.topics import Topic, find_topic, list_topics
from navgrade.vertical import (
    P_MAX,
    P_MIN,
    QUANTITIES,
    Quantity,
    geometric_height,
    pressure_height,
)


class Heights(NamedTuple):
    """A topic of heights, in file order.

    Attributes
    ----------
    time_ns : ndarray of int64, shape (n,)
        Unix time, ns; increasing.
    h : ndarray, shape (n,)
        m.
    issues : tuple of Issue
        Defects of the file.
    """

    time_ns: NDArray[np.int64]
    h: NDArray[np.float64]
    issues: tuple[Issue, ...] = ()

    def seconds(self, epoch_ns: int) -> NDArray[np.float64]:
        """Times on the axis of IMU samples whose epoch is `epoch_ns`, s."""
        return np.asarray((self.time_ns - epoch_ns) * 1e-9)


class _Source(NamedTuple):
    topic: str
    field: str
    quantity: Quantity
    stamped: bool

    @property
    def paths(self) -> list[str]:
        """Members to read."""
        return [*(HEADER_STAMP.paths if self.stamped else ()), self.field]


def read_heights(
    path: str | Path,
    topic: str | None = None,
    *,
    field: str | None = None,
    quantity: str | None = None,
    strict: bool = False,
) -> Heights:
    """Read a whole topic of pressures or heights into memory.

    ``sensor_msgs/msg/FluidPressure`` becomes the height of its pressure in the standard
    atmosphere; ``std_msgs/msg/Float64`` and ``Float32`` hold heights in m; of any other message
    with a header, `field` and `quantity` name a number. Times are header stamps. Float64 and
    Float32 have none: their log time is taken, so the recorder's clock must be that of the IMU's
    stamps.

    Parameters
    ----------
    path : path or URL
    topic : str, optional
        May be left out when the log has one FluidPressure topic.
    field : str, optional
        Dotted path of a number, such as ``pose.position.z``.
    quantity : {"height_m", "pressure_pa"}, optional
        What the number is: m, or Pa. Required beside a `field` of an unknown schema.
    strict : bool
        Refuse a damaged file instead of using what it still holds.

    Returns
    -------
    Heights
        For a `navgrade.vertical.BaroLoop`: ``BaroLoop(heights.seconds(imu.epoch_ns), heights.h)``.

    Raises
    ------
    LogError, SchemaError
        When the log or the topic cannot be read, a value is not finite, a pressure is outside the
        standard atmosphere (20 km to -5 km), or time repeats or runs backwards.
    ConfigError
        When `field` or `quantity` is missing, unknown or not what the schema can hold.
    """
    source = _choose(path, topic, field, quantity)
    file = McapFile(path, strict=strict)
    parts = [
        _column(file, columns, source) for columns in file.columns({source.topic: source.paths})
    ]
    if not parts:
        raise LogError("no message of it is in the log", file=str(path), topic=source.topic)
    time_ns, value = map(np.concatenate, zip(*parts, strict=True))
    return _checked(path, source, time_ns, value)._replace(issues=tuple(file.issues))


def _choose(path: str | Path, name: str | None, field: str | None, quantity: str | None) -> _Source:
    if quantity is not None and quantity not in QUANTITIES:
        raise ConfigError(
            f"quantity {quantity!r} is not one of {', '.join(QUANTITIES)}", key="baro.quantity"
        )
    if field is not None and name is None:
        raise ConfigError(f"field {field!r} needs the topic it is in", key="baro.topic")
    topics = list_topics(path)
    chosen = find_topic(path, topics, _only_pressure(path, topics) if name is None else name)
    schema = HEIGHT_SCHEMAS.get(chosen.schema)
    if schema is not None and field in (None, schema.field):
        allowed, field, stamped = schema.quantities, schema.field, schema.stamped
        given = allowed[0] if quantity is None else quantity
    elif field is None:
        raise SchemaError(
            f"schema {chosen.schema or '(none)'} does not say which number is a height "
            f"({', '.join(HEIGHT_SCHEMAS)} do); set baro.field and baro.quantity",
            file=str(path),
            topic=chosen.name,
        )
    elif quantity is None:
        raise ConfigError(
            f"nothing says what {field} is; set baro.quantity to one of {', '.join(QUANTITIES)}",
            key="baro.quantity",
        )
    else:
        allowed, given, stamped = QUANTITIES, quantity, True
    for known in allowed:
        if given == known:
            return _Source(chosen.name, field, known, stamped)
    raise ConfigError(
        f"{chosen.schema} holds {' or '.join(allowed)}, not {given}", key="baro.quantity"
    )


def _only_pressure(path: str | Path, topics: list[Topic]) -> str:
    usable = [t for t in topics if t.schema == FLUID_PRESSURE.name and t.count]
    if not usable:
        held = "; ".join(map(str, topics)) or "no topics at all"
        raise LogError(
            f"no {FLUID_PRESSURE.name} topic; name a topic of heights with baro.topic; "
            f"the log holds {held}",
            file=str(path),
        )
    if len(usable) > 1:
        raise LogError(
            f"{len(usable)} pressure topics, choose one with baro.topic: "
            + "; ".join(map(str, usable)),
            file=str(path),
        )
    return usable[0].name


def _column(
    file: McapFile, columns: Columns, source: _Source
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    time_ns = columns.log_time_ns
    if source.stamped:
        (stamp,) = HEADER_STAMP.paths
        time_ns = columns.fields[stamp]
    value = columns.fields[source.field]
    if value.ndim != 1 or value.dtype.kind not in "if":
        raise SchemaError(f"{source.field} is not a number", file=file.name, topic=source.topic)
    return time_ns, value.astype(np.float64)


def _checked(
    path: str | Path, source: _Source, time_ns: NDArray[np.int64], value: NDArray[np.float64]
) -> Heights:
    def error(index: int, text: str) -> LogError:
        seconds = (int(time_ns[index]) - int(time_ns[0])) * 1e-9
        return LogError(
            f"message {index}, {seconds:.6f} s after the first: {text}",
            index=index,
            time_s=seconds,
            file=str(path),
            topic=source.topic,
        )

    step = np.diff(time_ns)
    if not np.all(step > 0):
        bad = int(np.argmax(step <= 0))
        clock = "header stamp" if source.stamped else "log time"
        what = "repeats" if step[bad] == 0 else f"steps back by {-step[bad] * 1e-9:.6f} s"
        raise error(bad + 1, f"the {clock} {what}; repair the times first")
    if source.quantity == "height_m":
        good = np.isfinite(value)
        if not good.all():
            bad = int(np.argmin(good))
            raise error(bad, f"the height {source.field} is {value[bad]}, not finite")
        return Heights(time_ns, value)
    good = (value >= P_MIN) & (value <= P_MAX)
    if not good.all():
        bad = int(np.argmin(good))
        raise error(
            bad,
            f"the pressure {source.field} is {value[bad]:g} Pa, not within {P_MIN:g} Pa to "
            f"{P_MAX:g} Pa (20 km to -5 km)"
            + ("; is it in hPa?" if 0.01 * P_MIN <= value[bad] <= 0.01 * P_MAX else ""),
        )
    return Heights(time_ns, geometric_height(pressure_height(value)))
