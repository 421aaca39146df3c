"""The site file of a simulated log: what `navgrade run` needs to know."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from earth.ellipsoid import WGS84
from earth.rotation import euler_from_quat
from earth.units import DEG, DEG_PER_H, DEG_PER_RTH, UG, UG_PER_RTHZ
from navgrade.simulate.scenario import Scenario
from navgrade.simulate.simulation import Simulated

LEAST_STILL = 30.0  # s at the start, to align on
_MOST_STILL = 600.0  # s
_WEAK = 0.1  # rad of heading: gyros with more error than this cannot find north


def site_text(scenario: Scenario, made: Simulated) -> str:
    """A site file, in TOML.

    Alignment where the scenario starts with `LEAST_STILL` seconds at rest and the IMU has errors
    with which its gyros still find north; the true state at the first sample otherwise.
    """
    imu, first = scenario.imu, made.first
    lines = [
        f"# Site file of {made.output.name}, simulated from {Path(scenario.file).name}.",
        "",
        "[imu]",
        f'topic = "{made.topic}"',
        f'kind = "{imu.kind}"',
        f'axes = "{made.axes}"',
        *_errors(scenario),
        "",
    ]
    place = [
        f"latitude = {first.lat / DEG!r}",
        f"longitude = {first.lon / DEG!r}",
        f"height_m = {first.h!r}",
    ]
    still = np.floor(scenario.still - 1.0 / imu.rate_hz)
    if scenario.still >= LEAST_STILL and _finds_north(scenario, first.lat):
        lines += ["[site]", *place, "", "[alignment]"]
        lines.append(f"duration_s = {min(still, _MOST_STILL):.1f}")
    else:
        roll, pitch, heading = (float(x) / DEG for x in euler_from_quat(first.q_nb))
        velocity = ", ".join(repr(float(v)) for v in first.v_eb_n)
        lines += [
            "[initial]                  # the truth at the first sample",
            f"time_ns = {made.first_ns}",
            *place,
            f"velocity_ned_m_s = [{velocity}]",
            f"roll_deg = {roll!r}",
            f"pitch_deg = {pitch!r}",
            f"heading_deg = {heading!r}",
        ]
    return "\n".join(lines) + "\n"


def _finds_north(scenario: Scenario, lat: float) -> bool:
    gyro = scenario.imu.errors.gyro
    if not _errors(scenario):
        return False  # perfect data need no alignment, and its leveling takes the plumb line
    level = WGS84.params.omega * np.cos(lat)
    bias = np.abs(gyro.bias).max() + 3.0 * (gyro.bias_sigma + gyro.markov)
    noise = 3.0 * gyro.white / np.sqrt(scenario.still)
    return bool(bias + noise < _WEAK * level)


def _errors(scenario: Scenario) -> list[str]:
    """1-sigma of what the sheet says, where it says something."""
    gyro, accel = scenario.imu.errors.gyro, scenario.imu.errors.accel
    amounts = {
        "gyro_bias_deg_h": max(np.abs(gyro.bias).max(), gyro.bias_sigma) / DEG_PER_H,
        "accel_bias_ug": max(np.abs(accel.bias).max(), accel.bias_sigma) / UG,
        "arw_deg_rth": gyro.white / DEG_PER_RTH,
        "vrw_ug_rthz": accel.white / UG_PER_RTHZ,
    }
    lines = [f"{key} = {value:.6g}" for key, value in amounts.items() if value > 0.0]
    return ["", "[imu.errors]               # 1-sigma", *lines] if lines else []
