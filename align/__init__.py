"""Initial attitude from what an IMU at rest feels, and how well it is known."""

from align.accuracy import SensorErrors
from align.errors import AlignmentError
from align.gyrocompass import gyrocompass
from align.leveling import level, leveled_attitude
from align.static import KnownHeading, StaticAlignment, align_static
from align.triad import analytic_coarse

__all__ = [
    "AlignmentError",
    "KnownHeading",
    "SensorErrors",
    "StaticAlignment",
    "align_static",
    "analytic_coarse",
    "gyrocompass",
    "level",
    "leveled_attitude",
]
