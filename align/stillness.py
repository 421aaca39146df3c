"""Is a window still?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from earth.units import DEG

SPAN = 1.0  # s: motion is sought in means over this long, below engine vibration
FORCE_LIMIT = 0.03  # m/s^2: a parked car with people in it shows 0.009, a gentle drive 0.13
RATE_LIMIT = 0.05 * DEG  # rad/s: the same car shows 0.016 deg/s, its drive 0.3 deg/s

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Stillness:
    """How much the one-second means of a window scatter, root sum square over the axes.

    Attributes
    ----------
    force : float
        m/s^2.
    rate : float
        rad/s.
    """

    force: float
    rate: float

    @property
    def is_still(self) -> bool:
        """True when both stay below their limits."""
        return self.force <= FORCE_LIMIT and self.rate <= RATE_LIMIT


def span_means(dt: Array, values: Array, span: float) -> Array:
    """Means of `values` (n, 3) over consecutive spans of `span` seconds, weighted by `dt`."""
    end = np.cumsum(dt)
    count = max(int(end[-1] / span + 1e-9), 1)
    group = np.minimum((end - 0.5 * dt) / span, count - 1).astype(int)
    weight = np.bincount(group, dt, minlength=count)
    sums = [np.bincount(group, dt * values[:, i], minlength=count) for i in range(3)]
    held = weight > 0.0
    means: Array = np.stack(sums, axis=-1)[held] / weight[held, None]
    return means


def assess(dt: Array, omega_ib_b: Array, f_ib_b: Array) -> Stillness:
    """Measure the scatter of one-second means of angular rate and specific force.

    Constant velocity on a straight line looks still to any IMU.
    """

    def scatter(values: Array) -> float:
        return float(np.sqrt(np.sum(np.var(span_means(dt, values, SPAN), axis=0))))

    return Stillness(force=scatter(f_ib_b), rate=scatter(omega_ib_b))
