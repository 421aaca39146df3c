"""No compensation: increments pass as they are.

For comparison, and for a sensor whose increments need none over so short an interval.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def reconstruct(dt: Array, dtheta: Array, dvel: Array, first: int, phi: Array, dv: Array) -> None:
    """Copy the rows from `first` on."""
    phi[:] = dtheta[first:]
    dv[:] = dvel[first:]
