"""What a real IMU adds to the truth."""

from __future__ import annotations

from navgrade.sensors.grades import GRADES, Figure, Grade
from navgrade.sensors.model import ImuErrors, Sensor, TriadErrors
from navgrade.sensors.sheet import SHEET, Entry, imu_errors

__all__ = [
    "GRADES",
    "SHEET",
    "Entry",
    "Figure",
    "Grade",
    "ImuErrors",
    "Sensor",
    "TriadErrors",
    "imu_errors",
]
