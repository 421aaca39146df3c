"""One step over an interval, the same in every frame; and sums that lose nothing.

A frame r turns at `rate` relative to inertial space, constant over the interval. With A = C_rb dv
and D = C_rb dr the velocity and displacement the specific force makes in inertial axes, and `rest`
the other accelerations in r (gravity, Coriolis, ...),

    integral of C f in r      A - rate x (dt A - D) + dt^2/6 rate x (rate x A)
    and its integral          D - dt^2/6 rate x A

(docs/equations.md, section 3). `rest` is taken at the middle of the interval; its slope, which
moves the position by a twelfth of dt^3, is that between the last two middles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from earth._jit import formula
from earth.rotation import cross, quat_product, rotvec_to_quat_change


@formula
def predicted(v, A, D, W, rest, dt):
    """Return the integral of the velocity over the interval, m, as far as `rest` before tells it.

    W = rate x A, of the interval before.
    """
    half = 0.5 * dt * dt
    k = half * (1.0 / 3.0)
    return (
        (v[0] * dt + D[0]) + (half * rest[0] - k * W[0]),
        (v[1] * dt + D[1]) + (half * rest[1] - k * W[1]),
        (v[2] * dt + D[2]) + (half * rest[2] - k * W[2]),
    )


@formula
def corrected(moved, rest, before, dt, dt_before):
    """Return the predicted displacement `moved` with `rest` at the middle and its slope, m."""
    half = 0.5 * dt * dt
    k = half - half * (1.0 / 3.0) * (dt / (dt + dt_before))
    return (
        moved[0] + k * (rest[0] - before[0]),
        moved[1] + k * (rest[1] - before[1]),
        moved[2] + k * (rest[2] - before[2]),
    )


@formula
def velocity_change(A, D, W, rest, rate, dt):
    """Return what the velocity gains over the interval, m/s."""
    k = dt * dt * (1.0 / 6.0)
    lag = (
        D[0] - (dt * A[0] - k * W[0]),
        D[1] - (dt * A[1] - k * W[1]),
        D[2] - (dt * A[2] - k * W[2]),
    )
    turn = cross(rate, lag)
    return (
        A[0] + (rest[0] * dt + turn[0]),
        A[1] + (rest[1] * dt + turn[1]),
        A[2] + (rest[2] * dt + turn[2]),
    )


@formula
def to_middle(v, moved, dt):
    """Return the displacement from the start to the middle of the interval, m."""
    return (
        0.25 * (dt * v[0] + moved[0]),
        0.25 * (dt * v[1] + moved[1]),
        0.25 * (dt * v[2] + moved[2]),
    )


@formula
def attitude_after(q, phi, rate, dt):
    """Return frame * q * body, normalised, for a body that turns by phi and a frame by rate dt."""
    # the small changes are formed first, so they keep their digits
    body = rotvec_to_quat_change(phi)
    frame = rotvec_to_quat_change((-dt * rate[0], -dt * rate[1], -dt * rate[2]))
    excess = 0.5 - 0.5 * (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    turn = quat_product(q, (body[0] + excess, body[1], body[2], body[3]))
    half_way = (q[0] + turn[0], q[1] + turn[1], q[2] + turn[2], q[3] + turn[3])
    drag = quat_product(frame, half_way)
    return (
        half_way[0] + drag[0],
        half_way[1] + drag[1],
        half_way[2] + drag[2],
        half_way[3] + drag[3],
    )


class Channel(NamedTuple):
    """How the vertical channel is held, for kernels."""

    mode: int  # FREE, HOLD or BARO
    c1: float  # 1/s, gains of the loop: of the height,
    c2: float  # 1/s^2, of the vertical velocity,
    c3: float  # 1/s^3, of the estimated acceleration error
    h: float  # m, height to hold


FREE, HOLD, BARO = 0, 1, 2


@formula
def vertical_correction(channel, h, v_down, height, bias, dt):
    """Return what to add to the height (m) and to v_down (m/s), and the new acceleration error.

    `height` is the pressure height at the end of the interval, nan where there is none.
    """
    if channel.mode == HOLD:
        return channel.h - h, -v_down, bias
    excess = h - height
    if channel.mode == FREE or np.isnan(excess):
        return 0.0, bias * dt, bias
    bias = bias + channel.c3 * excess * dt
    return -channel.c1 * excess * dt, (channel.c2 * excess + bias) * dt, bias
