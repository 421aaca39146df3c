"""Increments the sensor has already corrected: they pass untouched, only the displacement is added.

A sensor may give the velocity increment in b at the end of the interval instead of its start; it
is then turned back by the rotation vector.
"""

from __future__ import annotations

from earth._jit import kernel
from earth.rotation import quat_rotate, rotvec_to_quat


@kernel
def reconstruct(at_end, dt, dtheta, dvel, first, phi, dv, dr, status):
    """Fill the rows from `first` on; one row before is context."""
    for row in range(phi.shape[0]):
        k = first + row
        v = (dvel[k, 0], dvel[k, 1], dvel[k, 2])
        before, ratio, share = v, 1.0, 0.0
        if k:
            # the previous increment in b at the start of this interval, which is its own end
            before = (dvel[k - 1, 0], dvel[k - 1, 1], dvel[k - 1, 2])
            if not at_end:
                back = (-dtheta[k - 1, 0], -dtheta[k - 1, 1], -dtheta[k - 1, 2])
                before = quat_rotate(rotvec_to_quat(back), before)
            ratio = dt[k] / dt[k - 1]
            share = ratio / (1.0 + ratio)
        if at_end:
            v = quat_rotate(rotvec_to_quat((dtheta[k, 0], dtheta[k, 1], dtheta[k, 2])), v)
        for i in range(3):
            phi[row, i] = dtheta[k, i]
            dv[row, i] = v[i]
            rise = share * (v[i] - ratio * before[i])
            dr[row, i] = dt[k] * (0.5 * v[i] - (1.0 / 6.0) * rise)
