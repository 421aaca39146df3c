"""Grades of IMU: what a sheet of each class says, number by number, with its source."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from navgrade.sensors.model import ImuErrors
from navgrade.sensors.sheet import imu_errors

PLATEAU = 0.6174  # peak of the Allan deviation of a Gauss-Markov process, over its sigma

_HG9900 = "Honeywell HG9900, product sheet N61-1638"
_GG1320 = "Honeywell GG1320AN, product sheet"
_HG1700 = "Honeywell HG1700 AG58, product sheet N61-1619"
_SPAN = "NovAtel, UIMU-HG1700-AG58 sheet"
_RAWIMU = "NovAtel OEM7 manual, raw scale factors of the HG1700 AG58"
_ACEINNA = "Aceinna OpenIMU300ZA, sensor specification"
_MPU = "InvenSense MPU-6050, PS-MPU-6000A-00 revision 3.4"
_GREENHECK = "Greenheck, MPU-6000 in a low-cost MEMS cluster (Marquette 2009), as quoted by AirSim"
_TYPICAL = "typical of the class"


class Figure(NamedTuple):
    """A number in the unit of its key, where it is from, and how it follows from that."""

    value: float
    source: str
    how: str = ""


@dataclass(frozen=True)
class Grade:
    """A class of IMU.

    Attributes
    ----------
    name, what : str
        Its name, and the devices meant.
    sheet : mapping of str to Figure
        By the names of `navgrade.sensors.SHEET`.
    """

    name: str
    what: str
    sheet: Mapping[str, Figure]

    @property
    def values(self) -> dict[str, float]:
        """The numbers alone."""
        return {key: figure.value for key, figure in self.sheet.items()}

    @property
    def errors(self) -> ImuErrors:
        """The same in SI."""
        return imu_errors(self.values)


_ALL = (
    Grade(
        "navigation",
        "ring lasers and quartz pendulums of airliners",
        {
            "gyro_bias_sigma_deg_h": Figure(0.0035, _HG9900),
            "gyro_scale_sigma_ppm": Figure(5.0, _HG9900),
            "gyro_misalignment_sigma_mrad": Figure(0.025, _TYPICAL),
            "arw_deg_rth": Figure(0.002, _HG9900, "the most allowed"),
            "gyro_walk_deg_h_rth": Figure(0.0002, _TYPICAL),
            "gyro_markov_deg_h": Figure(0.001, _TYPICAL),
            "gyro_markov_time_s": Figure(3600.0, _TYPICAL),
            "gyro_quantum_arcsec": Figure(1.113, _GG1320, "1,164,352 pulses a turn"),
            "gyro_resolution_deg_s": Figure(1e-5, _TYPICAL),
            "accel_bias_sigma_ug": Figure(25.0, _HG9900),
            "accel_scale_sigma_ppm": Figure(100.0, _HG9900),
            "accel_misalignment_sigma_mrad": Figure(0.025, _TYPICAL),
            "vrw_ug_rthz": Figure(8.0, _TYPICAL),
            "accel_walk_ug_rth": Figure(1.0, _TYPICAL),
            "accel_markov_ug": Figure(5.0, _TYPICAL),
            "accel_markov_time_s": Figure(3600.0, _TYPICAL),
            "accel_quantum_um_s": Figure(60.0, _TYPICAL),
            "accel_resolution_ug": Figure(1.0, _TYPICAL),
        },
    ),
    Grade(
        "tactical",
        "small ring lasers, fibre gyros and the best MEMS, of missiles and survey vehicles",
        {
            "gyro_bias_sigma_deg_h": Figure(1.0, _HG1700),
            "gyro_scale_sigma_ppm": Figure(150.0, _SPAN),
            "gyro_misalignment_sigma_mrad": Figure(0.1, _TYPICAL),
            "arw_deg_rth": Figure(0.125, _HG1700, "the most allowed"),
            "gyro_walk_deg_h_rth": Figure(0.2, _TYPICAL),
            "gyro_markov_deg_h": Figure(0.3, _TYPICAL),
            "gyro_markov_time_s": Figure(600.0, _TYPICAL),
            "gyro_quantum_arcsec": Figure(2.40126e-5, _RAWIMU, "2^-33 rad"),
            "gyro_resolution_deg_s": Figure(1e-5, _TYPICAL),
            "accel_bias_sigma_ug": Figure(1000.0, _HG1700),
            "accel_scale_sigma_ppm": Figure(300.0, _SPAN),
            "accel_misalignment_sigma_mrad": Figure(0.1, _TYPICAL),
            "vrw_ug_rthz": Figure(33.7, _HG1700, "0.065 ft/s/√h, the most allowed"),
            "accel_walk_ug_rth": Figure(20.0, _TYPICAL),
            "accel_markov_ug": Figure(50.0, _TYPICAL),
            "accel_markov_time_s": Figure(600.0, _TYPICAL),
            "accel_quantum_um_s": Figure(2.27094e-3, _RAWIMU, "2^-27 ft/s"),
            "accel_resolution_ug": Figure(1.0, _TYPICAL),
        },
    ),
    Grade(
        "industrial",
        "calibrated MEMS modules of machines and drones",
        {
            "gyro_bias_sigma_deg_h": Figure(
                360.0, _TYPICAL, "near room temperature; the OpenIMU300ZA has 0.5 °/s over all"
            ),
            "gyro_scale_sigma_ppm": Figure(1000.0, _ACEINNA),
            "gyro_misalignment_sigma_mrad": Figure(1.0, _TYPICAL),
            "arw_deg_rth": Figure(0.3, _ACEINNA),
            "gyro_walk_deg_h_rth": Figure(5.0, _TYPICAL),
            "gyro_markov_deg_h": Figure(
                6.0 / PLATEAU, _ACEINNA, "Allan minimum 6 °/h taken as the plateau"
            ),
            "gyro_markov_time_s": Figure(300.0, _TYPICAL),
            "gyro_quantum_arcsec": Figure(0.36, _ACEINNA, "0.02 °/s at 200 Hz"),
            "gyro_resolution_deg_s": Figure(0.02, _ACEINNA),
            "accel_bias_sigma_ug": Figure(5000.0, _ACEINNA, "over temperature, rms"),
            "accel_scale_sigma_ppm": Figure(1000.0, _ACEINNA),
            "accel_misalignment_sigma_mrad": Figure(1.0, _TYPICAL),
            "vrw_ug_rthz": Figure(85.0, _ACEINNA, "0.05 m/s/√h"),
            "accel_walk_ug_rth": Figure(50.0, _TYPICAL),
            "accel_markov_ug": Figure(
                20.0 / PLATEAU, _ACEINNA, "Allan minimum 20 µg taken as the plateau"
            ),
            "accel_markov_time_s": Figure(300.0, _TYPICAL),
            "accel_quantum_um_s": Figure(24.5, _ACEINNA, "0.5 mg at 200 Hz"),
            "accel_resolution_ug": Figure(500.0, _ACEINNA),
        },
    ),
    Grade(
        "consumer",
        "chips of telephones, their gyros zeroed at rest",
        {
            "gyro_bias_sigma_deg_h": Figure(
                720.0, _TYPICAL, "once zeroed at rest; the MPU-6050 has ±20 °/s before"
            ),
            "gyro_scale_sigma_ppm": Figure(10_000.0, _MPU, "±3 % taken as three sigma"),
            "gyro_misalignment_sigma_mrad": Figure(6.7, _MPU, "±2 % taken as three sigma"),
            "arw_deg_rth": Figure(0.3, _MPU, "0.005 °/s/√Hz"),
            "gyro_walk_deg_h_rth": Figure(10.0, _TYPICAL),
            "gyro_markov_deg_h": Figure(
                4.6 / PLATEAU, _GREENHECK, "minimum 4.6 °/h taken as the plateau"
            ),
            "gyro_markov_time_s": Figure(500.0, _GREENHECK),
            "gyro_quantum_arcsec": Figure(1.1, _MPU, "16.4 LSB/(°/s) at 200 Hz"),
            "gyro_resolution_deg_s": Figure(1.0 / 16.4, _MPU, "16.4 LSB/(°/s) at ±2000 °/s"),
            "accel_bias_sigma_ug": Figure(16_700.0, _MPU, "±50 mg taken as three sigma"),
            "accel_scale_sigma_ppm": Figure(10_000.0, _MPU, "±3 % taken as three sigma"),
            "accel_misalignment_sigma_mrad": Figure(6.7, _MPU, "±2 % taken as three sigma"),
            "vrw_ug_rthz": Figure(400.0, _MPU),
            "accel_walk_ug_rth": Figure(200.0, _TYPICAL),
            "accel_markov_ug": Figure(
                36.0 / PLATEAU, _GREENHECK, "minimum 36 µg taken as the plateau"
            ),
            "accel_markov_time_s": Figure(800.0, _GREENHECK),
            "accel_quantum_um_s": Figure(23.9, _MPU, "2048 LSB/g at 200 Hz"),
            "accel_resolution_ug": Figure(1e6 / 2048.0, _MPU, "2048 LSB/g at ±16 g"),
        },
    ),
)
GRADES: Mapping[str, Grade] = {grade.name: grade for grade in _ALL}
