"""A body at rest that is disturbed, by door slams and people walking by, or that sways.

What counts as disturbed: while the envelope of the disturbance, its amplitude on each of the six
axes in units of the white noise of one sample there, root sum square over the axes, is at least
`visible`. There its energy in a quarter of a second is 3.3 times what the noise's own energy
scatters by. Whoever does not know the shape of a disturbance cannot see less in that time.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from tests.align.at_rest import DEG, UG, Array, rotation

REST = np.array([2e-5, -3e-5, 5e-5, 0.31, -0.12, -9.80])  # rad/s and m/s^2: tilted, turning Earth
GRADES = {  # rad/sqrt(s), (m/s)/sqrt(s)
    "navigation": (0.002 * DEG / 60.0, 8.0 * UG),
    "tactical": (0.125 * DEG / 60.0, 65.0 * UG),
}


@dataclass(frozen=True)
class Disturbed:
    """Samples (n, 6) of rate and force, and where they are disturbed."""

    dt: Array
    values: Array
    disturbed: np.ndarray

    @property
    def samples(self) -> tuple[Array, Array, Array]:
        return self.dt, self.values[:, :3], self.values[:, 3:]

    def shares(self, start: Array, stop: Array) -> tuple[float, float]:
        """Share of the still time that lies in the pieces, and of the disturbed time."""
        middle = np.cumsum(self.dt) - 0.5 * self.dt
        kept = np.zeros(len(middle), bool)
        for a, b in zip(start, stop, strict=True):
            kept |= (middle > a) & (middle < b)
        still = ~self.disturbed
        return float(np.mean(kept[still])), float(np.mean(kept[~still]))


def visible(rate: float) -> float:
    """Envelope that stands out of white noise sampled at `rate` Hz, see above."""
    n = 0.25 * rate
    scatter = np.sqrt(2.0 * 6.0 * n)  # of the sum of n squares on six axes
    return float(np.sqrt(3.3 * scatter / (0.5 * n)))


def noise(rng: np.random.Generator, rate: float, seconds: float, grade: str) -> tuple[Array, Array]:
    """White noise (n, 6) of a grade at `rate` Hz, and its standard deviations (6,)."""
    sigma = np.repeat(GRADES[grade], 3) * np.sqrt(rate)
    return sigma * rng.normal(size=(round(rate * seconds), 6)), sigma


def slams(
    rng: np.random.Generator, rate: float, seconds: float, grade: str, size: float
) -> Disturbed:
    """A slam about every 30 s: damped oscillations of 1.5 to 7 Hz of all six axes at once.

    `size` is the envelope at the start over what is visible; each slam dies away to that within
    0.5 to 3 s.
    """
    values, sigma = noise(rng, rate, seconds, grade)
    edges = np.arange(len(values) + 1) / rate
    middle = 0.5 * (edges[1:] + edges[:-1])
    envelope = np.zeros(len(middle))
    for nominal in np.arange(15.0, seconds - 5.0, 30.0):
        start = nominal + rng.uniform(-3.0, 3.0)  # s
        tau = rng.uniform(0.5, 3.0) / np.log(size)  # s
        share = rng.uniform(0.2, 1.0, 6)
        peak = size * visible(rate) * share / np.linalg.norm(share)
        pole = -1.0 / tau + 2j * np.pi * rng.uniform(1.5, 7.0, 6)
        # Its integral swings back to where it began: no turn and no speed left
        integral = np.imag(np.exp(pole * np.maximum(edges - start, 0.0)[:, None]))
        values += sigma * peak * np.diff(integral, axis=0) * rate / np.abs(pole)
        after = middle - start
        envelope += size * np.where(after >= 0.0, np.exp(-np.maximum(after, 0.0) / tau), 0.0)
    return Disturbed(np.full(len(middle), 1.0 / rate), values + REST, envelope >= 1.0)


def walkers(
    rng: np.random.Generator, rate: float, seconds: float, grade: str, size: float
) -> Disturbed:
    """Somebody walks by about every 30 s: 5 to 10 s of broadband vibration, rising and falling.

    `size` is the amplitude (root 2 times the standard deviation) of the vibration at its height,
    over what is visible.
    """
    values, sigma = noise(rng, rate, seconds, grade)
    t = np.arange(len(values)) / rate
    envelope = np.zeros(len(t))
    for nominal in np.arange(15.0, seconds - 10.0, 30.0):
        lasts = rng.uniform(5.0, 10.0)  # s
        phase = np.clip((t - nominal - rng.uniform(-3.0, 3.0)) / lasts + 0.5, 0.0, 1.0)
        shape = size * np.sin(np.pi * phase)
        share = rng.uniform(0.2, 1.0, 6)
        share /= np.linalg.norm(share)
        shake = 0.5 * np.diff(rng.normal(size=(len(t) + 1, 6)), axis=0)  # no turn and no speed left
        values += visible(rate) * sigma * share * shape[:, None] * shake
        envelope += shape
    return Disturbed(np.full(len(t), 1.0 / rate), values + REST, envelope >= 1.0)


def sways(
    rng: np.random.Generator,
    rate: float,
    seconds: float,
    grade: str,
    amplitude_deg: float,
    *,
    shares: tuple[float, float, float] = (1.0, 0.7, 0.3),
    arm: float = 0.0,
) -> tuple[Array, Array, Array]:
    """Samples of a body that rolls, pitches and yaws with periods of 7 to 11 s.

    `shares` of the amplitude go to roll, pitch and yaw; the IMU sits `arm` m above the axis.
    """
    random, _ = noise(rng, rate, seconds, grade)
    values = np.zeros_like(random)
    edges = np.arange(len(values) + 1) / rate
    swing = 2.0 * np.pi / rng.uniform(7.0, 11.0, 3)  # rad/s
    start = rng.uniform(0.0, 2.0 * np.pi, 3)

    def attitude(t: Array) -> Rotation:
        angles = DEG * amplitude_deg * np.array(shares) * np.sin(swing * t[:, None] + start)
        return rotation(0.02, -0.05, 1.0) * Rotation.from_euler("ZYX", angles[:, ::-1])

    turns = attitude(edges)
    values[:, :3] += rate * (turns[:-1].inv() * turns[1:]).as_rotvec()
    to_body = attitude(0.5 * (edges[1:] + edges[:-1])).inv()
    values[:, :3] += to_body.apply([5e-5, 0.0, -5e-5])  # rad/s: the Earth
    values[:, 3:] += to_body.apply([0.0, 0.0, -9.81])
    faster = np.gradient(values[:, :3], 1.0 / rate, axis=0)  # rad/s^2
    values[:, 3:] += np.cross(faster, [0.0, 0.0, -arm])
    values += random
    return np.full(len(values), 1.0 / rate), values[:, :3], values[:, 3:]
