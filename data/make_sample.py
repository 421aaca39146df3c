"""Make the sample log: a navigation-grade IMU, still for three minutes, then driven for three.

Run from the repository's root: ``python -m data.make_sample``. The truth is in closed form
(tests/oracles/truth.py) and shares nothing with the navigation it is meant to judge.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from earth.units import DEG, DEG_PER_H, DEG_PER_RTH, UG, UG_PER_RTHZ
from navgrade import ImuSamples, write_increments
from tests.oracles.truth import road_drive, start_from_rest

HERE = Path(__file__).resolve().parent
EPOCH_NS = 1_767_225_600_000_000_000  # 2026-01-01T00:00:00Z
RATE = 100  # Hz
T_STILL, T_RAMP, T_END = 180, 20, 360  # s
TRUTH_RATE = 10  # Hz
POSITION = ("latitude_deg", "longitude_deg", "height_m")
VELOCITY = ("v_north_m_s", "v_east_m_s", "v_down_m_s")
ATTITUDE = ("roll_deg", "pitch_deg", "heading_deg")

# What the IMU does wrong: biases drawn once from the 1-sigma the site file states, white noise.
GYRO_BIAS = np.array([0.006, -0.009, 0.011]) * DEG_PER_H
ACCEL_BIAS = np.array([38.0, -21.0, 46.0]) * UG
ARW = 0.003 * DEG_PER_RTH
VRW = 10.0 * UG_PER_RTHZ


def main() -> None:
    """Write sample.mcap and sample_truth.csv beside this file."""
    motion = start_from_rest(road_drive(), T_STILL, T_RAMP)
    edges = np.arange(T_END * RATE + 1) / RATE
    exact = motion.increments(edges)
    noise = np.random.default_rng(20260101).standard_normal((2, len(exact.t), 3))
    dt = exact.dt[:, None]
    imu = ImuSamples(
        t=exact.t,
        dt=exact.dt,
        gyro=exact.dtheta + GYRO_BIAS * dt + ARW * np.sqrt(dt) * noise[0],
        accel=exact.dvel + ACCEL_BIAS * dt + VRW * np.sqrt(dt) * noise[1],
        kind="increment",
        epoch_ns=EPOCH_NS,
    )
    write_increments(HERE / "sample.mcap", imu, topic="/imu/increments", overwrite=True)

    t = np.arange(T_END * TRUTH_RATE + 1) / TRUTH_RATE
    state = motion.state(t)
    with (HERE / "sample_truth.csv").open("w", newline="") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["t_s", *POSITION, *VELOCITY, *ATTITUDE])
        for k in range(len(t)):
            place = f"{state.lat[k] / DEG:.12f}", f"{state.lon[k] / DEG:.12f}", f"{state.h[k]:.6f}"
            velocity = (f"{v:.9f}" for v in state.v_eb_n[k])
            angles = state.roll[k], state.pitch[k], state.heading[k]
            out.writerow(
                [f"{t[k]:.1f}", *place, *velocity, *(f"{angle / DEG:.9f}" for angle in angles)]
            )


if __name__ == "__main__":
    main()
