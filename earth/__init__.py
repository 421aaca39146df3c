"""The planet a navigator needs: ellipsoid, radii, normal gravity, rates, frames, rotations.

It knows no sensors and steps no time. Angles are radians, everything is SI.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from earth._lazy import lazy

if TYPE_CHECKING:
    from earth.disturbance import DisturbanceGrid
    from earth.ellipsoid import GRS80, WGS84, Ellipsoid
    from earth.errors import NavgradeError
    from earth.frames import NED_TO_ENU, C_bs, C_en, C_ie
    from earth.geodetic import (
        ecef_to_geodetic,
        geodetic_to_ecef,
        meridian_radius,
        transverse_radius,
    )
    from earth.gravity import (
        GRAVITY_MODELS,
        gravity_n,
        normal_gravity_n,
        somigliana_second_order,
    )
    from earth.rates import omega_en_n, omega_ie_n, omega_in_n
    from earth.rotation import (
        dcm_from_quat,
        euler_from_quat,
        quat_from_dcm,
        quat_from_euler,
        quat_from_rotvec,
        rotvec_from_quat,
    )

_HOMES = {
    "C_bs": "earth.frames",
    "C_en": "earth.frames",
    "C_ie": "earth.frames",
    "DisturbanceGrid": "earth.disturbance",
    "Ellipsoid": "earth.ellipsoid",
    "GRAVITY_MODELS": "earth.gravity",
    "GRS80": "earth.ellipsoid",
    "NED_TO_ENU": "earth.frames",
    "NavgradeError": "earth.errors",
    "WGS84": "earth.ellipsoid",
    "dcm_from_quat": "earth.rotation",
    "ecef_to_geodetic": "earth.geodetic",
    "euler_from_quat": "earth.rotation",
    "geodetic_to_ecef": "earth.geodetic",
    "gravity_n": "earth.gravity",
    "meridian_radius": "earth.geodetic",
    "normal_gravity_n": "earth.gravity",
    "omega_en_n": "earth.rates",
    "omega_ie_n": "earth.rates",
    "omega_in_n": "earth.rates",
    "quat_from_dcm": "earth.rotation",
    "quat_from_euler": "earth.rotation",
    "quat_from_rotvec": "earth.rotation",
    "rotvec_from_quat": "earth.rotation",
    "somigliana_second_order": "earth.gravity",
    "transverse_radius": "earth.geodetic",
}

__all__ = [
    "GRAVITY_MODELS",
    "GRS80",
    "NED_TO_ENU",
    "WGS84",
    "C_bs",
    "C_en",
    "C_ie",
    "DisturbanceGrid",
    "Ellipsoid",
    "NavgradeError",
    "dcm_from_quat",
    "ecef_to_geodetic",
    "euler_from_quat",
    "geodetic_to_ecef",
    "gravity_n",
    "meridian_radius",
    "normal_gravity_n",
    "omega_en_n",
    "omega_ie_n",
    "omega_in_n",
    "quat_from_dcm",
    "quat_from_euler",
    "quat_from_rotvec",
    "rotvec_from_quat",
    "somigliana_second_order",
    "transverse_radius",
]

__getattr__ = lazy(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted(__all__)
