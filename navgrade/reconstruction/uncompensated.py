"""No compensation: increments pass as they are.

For comparison, and for a sensor whose increments need none over so short an interval.
"""

from __future__ import annotations


def reconstruct(dt, dtheta, dvel, first, phi, dv, dr, status):
    """Copy the rows from `first` on."""
    rows = slice(first, first + len(phi))
    phi[:] = dtheta[rows]
    dv[:] = dvel[rows]
    dr[:] = 0.5 * dt[rows, None] * dv
