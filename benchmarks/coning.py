"""Coning, sculling and SPIN-CONE for every reconstruction, beside theory where there is one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from navgrade.reconstruction import RECONSTRUCTIONS, reconstruct
from tests.navgrade.engine import samples
from tests.oracles.coning import Coning, Sculling, SpinCone, classical, within
from tests.oracles.truth import Increments

Array = NDArray[np.float64]
DEG = np.pi / 180.0  # rad
DEG_PER_H = DEG / 3600.0  # rad/s
UG = 9.80665e-6  # m/s^2

H = 0.01  # s
CONTEXT = 60  # samples on either side that are not judged: whole blocks and whole 10 Hz periods
CONES = (Coning(0.02 * DEG, 10.0), Coning(1.0 * DEG, 10.0))
CONING_TIME = 60.0  # s: whole periods
SCULLING = Sculling(1e-3, 2.0, 10.0)  # rad, m/s^2, Hz
SPIN_CONE = SpinCone(precession=1.0, spin=2.0 * np.pi, beta=45.0 * DEG)  # rad/s, rad/s
SPIN_CONE_TIME = 360.0  # s


def _edges(duration: float) -> Array:
    return np.arange(-CONTEXT, round(duration / H) + CONTEXT + 1, dtype=np.float64) * H


def _body(name: str, exact: Increments, duration: float) -> tuple[Array, ...]:
    """Columns t, dt, phi, dv of the rows between 0 and `duration`."""
    pieces = list(reconstruct([samples(exact)], name))
    columns = ("t", "dt", "phi", "dv")
    whole: list[Array] = [
        np.concatenate([getattr(piece, column) for piece in pieces]) for column in columns
    ]
    rows = within(whole[0], whole[1], 0.0, duration)
    return tuple(column[rows] for column in whole)


def coning_table() -> list[str]:
    """Markdown table: what each algorithm of the registry leaves, measured / closed form.

    Coning at 10 Hz with half-angles of 0.02 and 1 degree (drift, deg/h), sculling of 1 mrad and
    2 m/s^2 at 10 Hz (micro-g), SPIN-CONE (micro-rad after 360 s); all sampled at 100 Hz. The
    closed form is of second order in the angle; what the 1 degree column adds to it comes from
    products of three increments.
    """
    lines = [
        "| reconstruction | coning 0.02°, °/h | coning 1°, °/h | sculling, µg | SPIN-CONE, µrad |",
        "|---|---|---|---|---|",
    ]
    cones = [cone.increments(_edges(CONING_TIME)) for cone in CONES]
    sculling = SCULLING.increments(_edges(CONING_TIME))
    spin_cone = SPIN_CONE.increments(_edges(SPIN_CONE_TIME))
    for name in RECONSTRUCTIONS:
        theory = classical(name)
        cells = []
        for cone, exact in zip(CONES, cones, strict=True):
            t, dt, phi, _ = _body(name, exact, CONING_TIME)
            scale = cone.half_angle**2 * cone.W / DEG_PER_H
            left = None if theory is None else scale * theory.share(cone.W * H)
            cells.append(_cell(abs(cone.drift(t, dt, phi)) / DEG_PER_H, left))
        t, dt, _, dv = _body(name, sculling, CONING_TIME)
        scale = SCULLING.angle * SCULLING.force / UG
        left = None if theory is None else scale * theory.share(SCULLING.W * H)
        cells.append(_cell(abs(SCULLING.residual(t, dt, dv)[2]) / UG, left))
        t, dt, phi, _ = _body(name, spin_cone, SPIN_CONE_TIME)
        cells.append(_cell(SPIN_CONE.error(t, dt, phi) / 1e-6, None))
        lines.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return lines


def _cell(measured: float, theory: float | None) -> str:
    return f"{measured:.4g}" if theory is None else f"{measured:.4g} / {theory:.4g}"
