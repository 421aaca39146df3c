"""Motion of a rigid body over the rotating Earth, and of what is attached to it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from earth.ellipsoid import WGS84
from earth.geodetic import ecef_from_geodetic
from earth.rotation import cross, euler_to_quat, quat_product, quat_rotate
from navgrade.simulate.jet import Jet

Array = NDArray[np.float64]
Triple = tuple[Array, Array, Array]
Quad = tuple[Array, Array, Array, Array]
JetTriple = tuple[Jet, Jet, Jet]
JetQuad = tuple[Jet, Jet, Jet, Jet]


class Kinematics(NamedTuple):
    """Motion of a point and of body axes b fixed to it, relative to the Earth.

    Attributes
    ----------
    r_e, v_e, a_e : tuple of ndarray, shape (n,)
        Position in Earth-fixed axes, m, and its first and second derivative there, m/s and m/s^2.
    q_eb : tuple of ndarray, shape (n,)
        Attitude, b to e, scalar first, unit.
    omega_eb_b : tuple of ndarray, shape (n,)
        Angular rate of b relative to e, in b, rad/s.
    alpha_eb_b : tuple of ndarray, shape (n,)
        Its derivative, rad/s^2.
    """

    r_e: Triple
    v_e: Triple
    a_e: Triple
    q_eb: Quad
    omega_eb_b: Triple
    alpha_eb_b: Triple


def q_en(lat: Any, lon: Any) -> Any:
    """Quaternion from north-east-down to Earth-fixed axes, of numbers, arrays or jets."""
    return euler_to_quat((0.0, -0.5 * np.pi - lat, lon))


def conjugate(q: Any) -> Any:
    """Return the quaternion of the opposite rotation."""
    return q[0], -q[1], -q[2], -q[3]


def angular_rate(q: JetQuad) -> JetTriple:
    """Rate of the second frame of a unit quaternion relative to the first, in the second, rad/s.

    omega = 2 Im(q* q'), to one order less than `q`.
    """
    _, x, y, z = quat_product(conjugate(q), tuple(c.rate() for c in q))
    return 2.0 * x, 2.0 * y, 2.0 * z


def _columns(t: Array, values: Any) -> Any:
    return tuple(np.broadcast_to(x, t.shape) for x in values)


def over_earth(t: Array, lat: Jet, lon: Jet, h: Jet, q_nb: JetQuad) -> Kinematics:
    """Kinematics from geodetic coordinates and attitude.

    Parameters
    ----------
    t : ndarray, shape (n,)
        The instants.
    lat, lon, h : Jet
        rad, rad, m above the WGS-84 ellipsoid, to second order.
    q_nb : tuple of Jet
        Unit quaternion, b to north-east-down, to second order.

    Notes
    -----
    Exact but for rounding: no difference of positions enters. q_nb changes with the body's turn
    relative to north-east-down; that of north-east-down itself comes with lat and lon.
    """
    r, v, a = zip(
        *(x.derivatives() for x in ecef_from_geodetic(WGS84.params, lat, lon, h)), strict=True
    )
    q = quat_product(q_en(lat, lon), q_nb)
    omega, alpha = zip(*(x.derivatives() for x in angular_rate(q)), strict=True)
    return Kinematics(*(_columns(t, x) for x in (r, v, a, (c.value for c in q), omega, alpha)))


def attached(body: Kinematics, l_b: JetTriple, q_bs: JetQuad) -> Kinematics:
    """Kinematics of a point and of axes s that are fixed to a body or move relative to it.

    Parameters
    ----------
    body : Kinematics
    l_b : tuple of Jet
        The point from the body's point, in b, m, to second order.
    q_bs : tuple of Jet
        Unit quaternion, s to b, to second order.
    """
    r, r1, r2 = zip(*(x.derivatives() for x in l_b), strict=True)
    q = tuple(c.value for c in q_bs)
    omega_bs_s, alpha_bs_s = zip(*(x.derivatives() for x in angular_rate(q_bs)), strict=True)
    omega, alpha = body.omega_eb_b, body.alpha_eb_b

    swept = cross(omega, r)
    v_b = tuple(x + y for x, y in zip(r1, swept, strict=True))
    coriolis, tangential, centripetal = cross(omega, r1), cross(alpha, r), cross(omega, swept)
    a_b = tuple(
        x + 2.0 * y + z + w
        for x, y, z, w in zip(r2, coriolis, tangential, centripetal, strict=True)
    )
    carried_omega = quat_rotate(conjugate(q), omega)
    carried_alpha = quat_rotate(conjugate(q), alpha)
    turning = cross(omega_bs_s, carried_omega)

    def moved(start: Triple, by_b: Any) -> Any:
        return tuple(x + y for x, y in zip(start, quat_rotate(body.q_eb, by_b), strict=True))

    return Kinematics(
        moved(body.r_e, r),
        moved(body.v_e, v_b),
        moved(body.a_e, a_b),
        quat_product(body.q_eb, q),
        tuple(x + y for x, y in zip(carried_omega, omega_bs_s, strict=True)),
        tuple(x + y - z for x, y, z in zip(carried_alpha, alpha_bs_s, turning, strict=True)),
    )
