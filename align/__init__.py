"""Initial attitude from what an IMU at rest feels, and how well it is known."""

from align.accuracy import SensorErrors
from align.errors import AlignmentError, WeakGyrosError
from align.gyrocompass import gyrocompass
from align.leveling import level, leveled_attitude
from align.result import Alignment
from align.static import KnownHeading, align_static
from align.triad import analytic_coarse

__all__ = [
    "Alignment",
    "AlignmentError",
    "KnownHeading",
    "SensorErrors",
    "WeakGyrosError",
    "align_static",
    "analytic_coarse",
    "gyrocompass",
    "level",
    "leveled_attitude",
]
