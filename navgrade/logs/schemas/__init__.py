"""The message types this program reads, one entry each; nothing else knows their members."""

from navgrade.logs.schemas.aiding import AIDING_SCHEMAS, AidingSchema
from navgrade.logs.schemas.clock import HEADER_STAMP, TIME_UNITS, Clock
from navgrade.logs.schemas.heights import FLUID_PRESSURE, HEIGHT_SCHEMAS, HeightSchema
from navgrade.logs.schemas.imu import IMU_SCHEMAS, Condition, ImuFields, ImuSchema, Vector

__all__ = [
    "AIDING_SCHEMAS",
    "FLUID_PRESSURE",
    "HEADER_STAMP",
    "HEIGHT_SCHEMAS",
    "IMU_SCHEMAS",
    "TIME_UNITS",
    "AidingSchema",
    "Clock",
    "Condition",
    "HeightSchema",
    "ImuFields",
    "ImuSchema",
    "Vector",
]
