"""Initial attitude from what an IMU at rest feels, and how well it is known."""

from align.accuracy import SensorErrors
from align.errors import AlignmentError, WeakGyrosError
from align.fine import fine_align
from align.gyrocompass import gyrocompass, gyrocompass_small_angle
from align.inertial_frame import InertialFrame, inertial_frame
from align.leveling import level, level_small_angle, level_two_axes, leveled_attitude
from align.methods import METHODS, align_fine, align_swaying, align_together
from align.multi_position import Position, align_positions
from align.result import Alignment
from align.static import KnownHeading, align_static
from align.triad import analytic_coarse, triad
from align.wahba import wahba

__all__ = [
    "METHODS",
    "Alignment",
    "AlignmentError",
    "InertialFrame",
    "KnownHeading",
    "Position",
    "SensorErrors",
    "WeakGyrosError",
    "align_fine",
    "align_positions",
    "align_static",
    "align_swaying",
    "align_together",
    "analytic_coarse",
    "fine_align",
    "gyrocompass",
    "gyrocompass_small_angle",
    "inertial_frame",
    "level",
    "level_small_angle",
    "level_two_axes",
    "leveled_attitude",
    "triad",
    "wahba",
]
