"""Which message types carry a height or a static pressure."""

from __future__ import annotations

from dataclasses import dataclass

from navgrade.vertical import Quantity


@dataclass(frozen=True)
class HeightSchema:
    """A message type that carries a height or a static pressure.

    Attributes
    ----------
    name : str
    field : str
        Path of the member.
    quantities : tuple of str
        What the number can be; the first is taken when nobody says it.
    stamped : bool
        There is a header; without one, log time must do.
    """

    name: str
    field: str
    quantities: tuple[Quantity, ...]
    stamped: bool


FLUID_PRESSURE = HeightSchema(
    "sensor_msgs/msg/FluidPressure", "fluid_pressure", ("pressure_pa",), stamped=True
)
FLOAT64 = HeightSchema("std_msgs/msg/Float64", "data", ("height_m", "pressure_pa"), stamped=False)
FLOAT32 = HeightSchema("std_msgs/msg/Float32", "data", ("height_m", "pressure_pa"), stamped=False)

HEIGHT_SCHEMAS = {schema.name: schema for schema in (FLUID_PRESSURE, FLOAT64, FLOAT32)}
