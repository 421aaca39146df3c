"""A comparison made up by powers of time: no navigation runs."""

from __future__ import annotations

import numpy as np

from navgrade.compare.result import Comparison, Group, Growth, Variant

HOUR = 3600.0  # s
ENDED = 400.0  # s: where the last flat world stops
EPOCHS = (1.0, 10.0, 60.0, 600.0, HOUR)
LOG = "/data/<script>alert(1)</script>&/kingston <b>&amp;.mcap"
TOPIC = '/imu/"data"<img src=x>'
REFERENCE = "the full engine"

# name, label, group, horizontal error at 1 s in m, power of time, formula
LAWS: tuple[tuple[str, str, Group, float, float, str], ...] = (
    ("engine", "Earth frame", "engine", 0.0, 1.0, ""),
    ("flat-euler", "Flat world, Euler", "flat", 8.43e-5, 3.0, "g Ω cos L t³ / 6"),
    ("flat-midpoint", "Flat world, midpoint", "flat", 8.40e-5, 2.99, "g Ω cos L t³ / 6"),
    ("flat-rk4", "Flat world, RK4", "flat", 8.35e-5, 2.98, "g Ω cos L t³ / 6"),
    (
        "without-earth-rate",
        "Earth frame, without Earth rate",
        "term",
        7.9e-5,
        2.6,
        "g Ω cos L t³ / 6",
    ),
    ("without-transport-rate", "Earth frame, without transport rate", "term", 3e-6, 2.9, ""),
    ("without-coriolis", "Earth frame, without Coriolis", "term", 1.1e-3, 1.9, "Ω v sin L t²"),
    ("without-ellipsoid", "Earth frame, without ellipsoid", "term", 4e-6, 1.6, ""),
    ("without-gravity-height", "Earth frame, without gravity with height", "term", 3e-8, 1.5, ""),
    (
        "without-gravity-latitude",
        "Earth frame, without gravity with latitude",
        "term",
        2e-9,
        1.3,
        "",
    ),
    ("without-north-gravity", "Earth frame, without north gravity", "term", 4e-7, 2.0, ""),
    ("without-coning", "Earth frame, without coning", "term", 5e-6, 2.3, ""),
    ("without-sculling", "Earth frame, without sculling", "term", 2e-5, 2.0, ""),
    ("without-rotation", "Earth frame, without rotation compensation", "term", 2e-3, 1.2, ""),
)


def drive(t: np.ndarray) -> np.ndarray:
    """A path of some hundred metres: east, north, up."""
    return np.stack(
        [900.0 * np.sin(t / 190.0), 500.0 * np.sin(t / 95.0) + 0.1 * t, 4.0 * np.sin(t / 300.0)],
        axis=1,
    )


def comparison(*, truth: bool = False, still: bool = False, imu: bool = True) -> Comparison:
    """Fourteen variants over an hour; ``flat-rk4`` ends after 400 s.

    With `truth`, the engine, too, has an error.
    """
    t = np.unique(
        np.concatenate([[0.0], np.geomspace(0.01, HOUR, 590), np.linspace(1, HOUR, 300), EPOCHS])
    )
    epochs = np.array(EPOCHS)
    track = drive(t) * (0.0 if still else 1.0)
    own = np.stack([0.02 * t**1.5, -0.01 * t**1.5, 0.001 * t**2], axis=1) * truth
    variants = []
    for i, (name, label, group, coefficient, power, formula) in enumerate(LAWS):
        heading = 0.4 + 0.7 * i
        size = coefficient * t**power
        along = np.array([np.cos(heading), np.sin(heading), 0.01 * (i + 1)])
        position = own + size[:, None] * along
        velocity = own * 0.1 + (size / np.maximum(t, 1e-2))[:, None] * along
        attitude = np.minimum(1e-6 * (i * t)[:, None], 0.5) * np.array([0.3, -0.2, 0.9])
        if name == "flat-rk4":
            for values in (position, velocity, attitude):
                values[t > ENDED] = np.nan
        predicted = coefficient * epochs**power if formula else np.full(len(epochs), np.nan)
        fit = Growth(coefficient or np.nan, power if coefficient else np.nan, formula, predicted)
        path = track + position[:, [1, 0, 2]] * (1.0, 1.0, -1.0)
        variants.append(Variant(name, label, group, position, velocity, attitude, path, fit))
    return Comparison(
        log=LOG,
        topic=TOPIC,
        description="sensor_msgs/msg/Imu, kind average, axes RFU <as its messages say>",
        start_ns=1_717_243_200_000_000_000,
        lat=0.7721,
        lon=-1.3345,
        h=92.4,
        reference="truth /truth/solution" if truth else REFERENCE,
        t=t,
        epochs=epochs,
        track=track,
        variants=tuple(variants),
        imu_error=0.002 * epochs**1.9 if imu else None,
        verdict=(
            "With this IMU the flat world is the larger error after 14 s.",
            "After 1 min it costs 18.2 m; the full engine is 0.3 m away.",
            "Of the terms, the Earth's rotation is worth most: 3.4 m after 1 min.",
        ),
        notes=("2 gaps bridged, 0.4 s in all.", "Truth <interpolated> to the IMU's stamps & back."),
    )
