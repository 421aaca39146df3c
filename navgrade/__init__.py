"""From a logged IMU to a navigation solution.

Names are loaded on first use, so that ``navgrade --help`` does not wait for a compiler.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from earth._lazy import lazy

if TYPE_CHECKING:
    from earth.errors import NavgradeError
    from navgrade.imu import BodyIncrements, ImuSamples, Status
    from navgrade.logs import read_imu, write_increments, write_solution
    from navgrade.navigation import navigate, solve
    from navgrade.state import NavState, Trajectory
    from navgrade.vertical import BaroLoop

_HOMES = {
    "BaroLoop": "navgrade.vertical",
    "BodyIncrements": "navgrade.imu",
    "ImuSamples": "navgrade.imu",
    "NavState": "navgrade.state",
    "NavgradeError": "earth.errors",
    "Status": "navgrade.imu",
    "Trajectory": "navgrade.state",
    "navigate": "navgrade.navigation",
    "read_imu": "navgrade.logs",
    "solve": "navgrade.navigation",
    "write_increments": "navgrade.logs",
    "write_solution": "navgrade.logs",
}

__all__ = [
    "BaroLoop",
    "BodyIncrements",
    "ImuSamples",
    "NavState",
    "NavgradeError",
    "Status",
    "Trajectory",
    "navigate",
    "read_imu",
    "solve",
    "write_increments",
    "write_solution",
]


_load = lazy(__name__, _HOMES)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("navgrade")
    return _load(name)


def __dir__() -> list[str]:
    return sorted(__all__)
