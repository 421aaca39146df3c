"""The page of message types, from the registry."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from navgrade.logs.schemas import (
    AIDING_SCHEMAS,
    HEADER_STAMP,
    HEIGHT_SCHEMAS,
    IMU_SCHEMAS,
    TIME_UNITS,
    AidingSchema,
    Clock,
    ImuSchema,
    Vector,
)
from navgrade.logs.topics import DEFAULT_AXES

_HEAD = """\
# Message types

What navgrade reads from a log, made from its registry (`navgrade/logs/schemas/`) by
`python -m benchmarks schemas --write`. Members are found by name in the definition the log itself
holds, so their order and whatever else a message has do not matter. Encodings are ROS 2 CDR and
ROS 1 (fast), JSON and protobuf (one message at a time). For each line a test makes a recording from
the vendor's definition with other people's software: `tests/navgrade/logs/test_schemas.py`,
`test_aiding.py`, `test_heights.py`.

## IMU samples

What stands here holds when nobody says otherwise: the site file can ([imu] `kind`, `axes`,
`gyro_unit`, `accel_unit`), the command line can (`--kind`, `--axes`). **Bold** is the default kind;
where none is bold it must be said. Increments are integrals over the interval that ends at the
time. [imu] `rate_hz` gives each IMU sample an interval of 1/rate_hz, and is refused where the times
contradict it. A clock that does not count from 1970 is tied to log time by the least delay of the
first thousand messages.

"""

_OWN = """
### Any other message

`[imu.fields]` in the site file says where the samples stand, in any of the encodings; `kind` must
then be said, and everything else of `[imu]` applies:

```toml
[imu]
topic = "/own/imu"
kind = "average"
axes = "FRD"
gyro_unit = "deg/s"
[imu.fields]
gyro = "imu.rate"                              # a vector ...
accel = ["imu.ax", "imu.ay", "imu.az"]         # ... or three numbers
time = "t_us"                                  # a stamp, or a number with the next two lines
time_unit = "us"                               # s, ms, us, ns
clock = "device"                               # unix, or device: tied to log time
interval = "dt"                                # may be left out
interval_unit = "ms"
```

With `accel_topic`, `accel` is a member of that topic's messages, joined by equal times.

## What happens to every one of them

Messages up to one second late are put back in the order of their time, and messages recorded twice
(same time, same values) are left out; both are counted, told, and written into the solution's
metadata. Refused are one time with two values, a message later than that, and a clock that was set
back (a late message that comes closer to another one than three quarters of the usual interval).

## Heights for the vertical loop

| message type | member | quantity | time |
|---|---|---|---|
"""

_AIDING = """
Any number of any other message with a header: [baro] `field` and `quantity`.

## Positions, velocities, attitudes

`navgrade.logs.read_aiding` reads them. Heights above the ellipsoid (`h`) and above mean sea level
(`h_msl`) are never exchanged.

| message type | from | position | height | velocity | attitude | accuracy | time |
|---|---|---|---|---|---|---|---|
"""


def page() -> str:
    """The text of docs/schemas.md."""
    text = _HEAD
    text += (
        "| message type | from | angular rate; specific force | kind | units | axes | interval "
        "| time |\n|---|---|---|---|---|---|---|---|\n"
    )
    text += "".join(_row(_imu_cells(schema)) for schema in IMU_SCHEMAS)
    text += "\n### Traps\n\n" + _traps(IMU_SCHEMAS) + _OWN
    for height in HEIGHT_SCHEMAS.values():
        time = "header stamp" if height.stamped else "log time"
        quantities = " or ".join(height.quantities)
        text += _row([f"`{height.name}`", f"`{height.field}`", quantities, time])
    text += _AIDING + "".join(_row(_aiding_cells(schema)) for schema in AIDING_SCHEMAS)
    return text + "\n### Traps\n\n" + _traps(AIDING_SCHEMAS)


def _row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |\n"


def _traps(schemas: Sequence[ImuSchema | AidingSchema]) -> str:
    """The traps of each type, once."""
    of: dict[str, dict[str, None]] = {}
    for schema in schemas:
        of.setdefault(schema.name, {}).update(dict.fromkeys(schema.traps))
    lines = [
        "".join((f"`{name}`\n", *(f"- {trap}\n" for trap in traps)))
        for name, traps in of.items()
        if traps
    ]
    return "\n".join(lines)


def _code(vector: Vector) -> str:
    return ", ".join(f"`{path}`" for path in ([vector] if isinstance(vector, str) else vector))


def _time(clock: Clock) -> str:
    if clock == HEADER_STAMP:
        return "header stamp"
    units = {ns: unit for unit, ns in TIME_UNITS.items()} | {604_800 * 10**9: "weeks"}
    members = " + ".join(f"`{path}` {units[unit]}" for path, unit in clock.members)
    if clock.unix:
        return members.removesuffix(" ns")
    wraps = f", unwrapped every {clock.period / 60e9:.1f} min" if clock.period else ""
    return f"{members}{wraps}, tied to log time"


def _imu_cells(schema: ImuSchema) -> list[str]:
    name = f"`{schema.name}`"
    if schema.accel_name:
        name += f" and `{schema.accel_name}`"
    if schema.condition:
        name += f" with {schema.condition.text}"
    members = f"{_code(schema.gyro)}; {_code(schema.accel)}"
    kinds = ", ".join(f"**{k}**" if k == schema.default_kind else k for k in schema.kinds)
    integrated = set(schema.kinds) <= {"increment", "compensated"}
    units = f"{schema.gyro_unit}, {schema.accel_unit}"
    if integrated and not schema.rates:
        units = units.replace("/s^2", "/s").replace("/s,", ",")
    elif integrated:
        units += ", times the interval"
    elif set(schema.kinds) > {"increment"}:
        units += "; increments rad, m/s"
    interval = "steps of time, or 1 / `rate_hz`"
    if schema.interval:
        path, per_second = schema.interval
        unit = {10**9 / per: unit for unit, per in TIME_UNITS.items()}[per_second]
        interval = f"`{path}` {unit}"
    elif schema.count:
        interval = f"steps of time, or `{schema.count}` / `rate_hz`"
    axes = schema.axes or f"not stated ({DEFAULT_AXES})"
    return [name, schema.source, members, kinds, units, axes, interval, _time(schema.clock)]


def _aiding_cells(schema: AidingSchema) -> list[str]:
    none = ""
    position = none
    if schema.lat and schema.lon:
        position = f"`{schema.lat[0]}`, `{schema.lon[0]}`"
    elif schema.r:
        position = f"`{schema.r}` of the child in its frame"
    heights = []
    if schema.h:
        heights.append(f"`{schema.h[0]}` above the ellipsoid")
    if schema.h_msl:
        more = f", plus `{schema.undulation}` above the ellipsoid" if schema.undulation else ""
        heights.append(f"`{schema.h_msl[0]}` above the sea{more}")
    velocity = none
    if schema.v_eb_n:
        velocity = ", ".join(f"`{path}`" for path, _ in schema.v_eb_n)
    elif schema.v:
        velocity = f"`{schema.v}` in the child's frame"
    attitude = none
    if schema.euler:
        attitude = ", ".join(f"`{path}`" for path, _ in schema.euler)
    elif schema.q:
        attitude = f"`{schema.q}`, child to frame"
    accuracy = none
    if schema.covariance or schema.pose_covariance:
        accuracy = "covariance"
    elif schema.sigma_r_n:
        accuracy = "standard deviations"
    name = f"`{schema.name}`" + (f", each of `{schema.each}`" if schema.each else "")
    return [
        name,
        schema.source,
        position,
        "; ".join(heights),
        velocity,
        attitude,
        accuracy,
        _time(schema.clock),
    ]
