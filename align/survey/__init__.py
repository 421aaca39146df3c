"""What a surveyor hands over: angles, marks, lines, and the way from a mark to the IMU."""

from align.survey.angles import parse_angle, parse_latitude, parse_longitude, parse_turn
from align.survey.azimuths import (
    KINDS,
    AzimuthKind,
    KnownAzimuth,
    azimuth_between,
    meridian_convergence,
    stated_azimuth,
)
from align.survey.datums import site_warning
from align.survey.errors import SurveyError
from align.survey.files import read_marks
from align.survey.marks import HeightKind, Mark, choose, displaced, geodetic_from_xyz

__all__ = [
    "KINDS",
    "AzimuthKind",
    "HeightKind",
    "KnownAzimuth",
    "Mark",
    "SurveyError",
    "azimuth_between",
    "choose",
    "displaced",
    "geodetic_from_xyz",
    "meridian_convergence",
    "parse_angle",
    "parse_latitude",
    "parse_longitude",
    "parse_turn",
    "read_marks",
    "site_warning",
    "stated_azimuth",
]
