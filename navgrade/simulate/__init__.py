"""Motions over the WGS-84 Earth, and what an ideal IMU feels on them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from earth._lazy import lazy

if TYPE_CHECKING:
    from navgrade.simulate.bspline import BSpline, drawn_path
    from navgrade.simulate.imu import (
        Extremes,
        extremes,
        imu_increments,
        imu_rates,
        true_trajectory,
    )
    from navgrade.simulate.kinematics import Kinematics
    from navgrade.simulate.motion import Motion, Mounted
    from navgrade.simulate.segments import (
        Accelerate,
        BankToTurn,
        Climb,
        FigureEight,
        Rotate,
        Segments,
        Spiral,
        Start,
        Still,
        Straight,
        Turn,
    )
    from navgrade.simulate.sinusoids import Oscillation, Sinusoid, Sinusoids
    from navgrade.simulate.vibration import Coning, Sculling, Shaking, Vibrating
    from navgrade.simulate.waypoints import Waypoints

_HOMES = {
    "Accelerate": "navgrade.simulate.segments",
    "BSpline": "navgrade.simulate.bspline",
    "BankToTurn": "navgrade.simulate.segments",
    "Climb": "navgrade.simulate.segments",
    "Coning": "navgrade.simulate.vibration",
    "Extremes": "navgrade.simulate.imu",
    "FigureEight": "navgrade.simulate.segments",
    "Kinematics": "navgrade.simulate.kinematics",
    "Motion": "navgrade.simulate.motion",
    "Mounted": "navgrade.simulate.motion",
    "Oscillation": "navgrade.simulate.sinusoids",
    "Rotate": "navgrade.simulate.segments",
    "Sculling": "navgrade.simulate.vibration",
    "Segments": "navgrade.simulate.segments",
    "Shaking": "navgrade.simulate.vibration",
    "Sinusoid": "navgrade.simulate.sinusoids",
    "Sinusoids": "navgrade.simulate.sinusoids",
    "Spiral": "navgrade.simulate.segments",
    "Start": "navgrade.simulate.segments",
    "Still": "navgrade.simulate.segments",
    "Straight": "navgrade.simulate.segments",
    "Turn": "navgrade.simulate.segments",
    "Vibrating": "navgrade.simulate.vibration",
    "Waypoints": "navgrade.simulate.waypoints",
    "drawn_path": "navgrade.simulate.bspline",
    "extremes": "navgrade.simulate.imu",
    "imu_increments": "navgrade.simulate.imu",
    "imu_rates": "navgrade.simulate.imu",
    "true_trajectory": "navgrade.simulate.imu",
}

__all__ = [
    "Accelerate",
    "BSpline",
    "BankToTurn",
    "Climb",
    "Coning",
    "Extremes",
    "FigureEight",
    "Kinematics",
    "Motion",
    "Mounted",
    "Oscillation",
    "Rotate",
    "Sculling",
    "Segments",
    "Shaking",
    "Sinusoid",
    "Sinusoids",
    "Spiral",
    "Start",
    "Still",
    "Straight",
    "Turn",
    "Vibrating",
    "Waypoints",
    "drawn_path",
    "extremes",
    "imu_increments",
    "imu_rates",
    "true_trajectory",
]

__getattr__ = lazy(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted(__all__)
