"""Every reconstruction, frame and vertical channel on the recorded drive: how far they differ.

A car with a tactical IMU, 10 Hz averages, 50 min of driving after the stop it is aligned on. Its
pitch and roll swing at 1 to 2 Hz, where half of the power of their rates is: 5 to 10 samples a
swing. That is what tells the reconstructions apart; the frames get the same increments.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from navgrade import Trajectory, navigate
from navgrade.mechanization import MECHANIZATIONS, VERTICAL
from navgrade.reconstruction import RECONSTRUCTIONS, BlockForm
from tests.navgrade.cli.calling import Bench
from tests.navgrade.logs.decoding import solution
from tests.navgrade.real_drive import DRIVE_STARTS, LOG, Drive, drive, site_file
from tests.oracles.truth import ecef

Array = NDArray[np.float64]

EVERY = 12  # samples: common ends of blocks of two, three and four
AFTER = (120.0, 3001.0)  # s of driving: early, and the end
CHOICES = list(itertools.product(RECONSTRUCTIONS, MECHANIZATIONS, VERTICAL))


def block_length(reconstruction: str) -> int:
    """Samples of one row."""
    chosen = RECONSTRUCTIONS[reconstruction]
    return chosen.samples if isinstance(chosen, BlockForm) else 1


def solve(log: Drive, reconstruction: str, frame: str, vertical: str) -> Trajectory:
    """Navigate the whole drive."""
    channel: Any = log.baro if vertical == "baro" else vertical
    return navigate(
        log.imu,
        log.state,
        reconstruction=reconstruction,
        mechanization=frame,
        vertical=channel,
    )


class Tracks:
    """Earth-fixed positions (m) of every choice at the same instants."""

    def __init__(self, log: Drive) -> None:
        after = log.imu.t[log.imu.t > log.state.t + 1e-9]
        self.t = after[EVERY - 1 :: EVERY]
        self.positions: dict[tuple[str, str, str], Array] = {}
        self.heights: dict[tuple[str, str, str], Array] = {}
        for choice in CHOICES:
            nav = solve(log, *choice)
            step = EVERY // block_length(choice[0])
            rows = slice(step - 1, len(self.t) * step, step)
            assert np.array_equal(nav.t[rows], self.t)
            self.positions[choice] = ecef(nav.lat[rows], nav.lon[rows], nav.h[rows])
            self.heights[choice] = nav.h[rows]

    def apart(self, first: tuple[str, str, str], second: tuple[str, str, str]) -> Array:
        """Distance between two of them over time, m."""
        distance: Array = np.linalg.norm(self.positions[first] - self.positions[second], axis=1)
        return distance

    def from_default(self, reconstruction: str, vertical: str) -> tuple[float, float]:
        """Distance from the default reconstruction early in the drive and at its end, m."""
        distance = self.apart((reconstruction, "n", vertical), ("centred-9", "n", vertical))
        early, late = np.searchsorted(self.t, DRIVE_STARTS + np.array(AFTER)) - 1
        return float(distance[early]), float(distance[late])


@pytest.fixture(scope="module")
def tracks(shared_data: Path) -> Tracks:
    """All of them, 228 solutions of 30,000 samples."""
    return Tracks(drive(shared_data))


@pytest.mark.parametrize("vertical", VERTICAL)
@pytest.mark.parametrize("reconstruction", RECONSTRUCTIONS)
def test_frames_agree(tracks: Tracks, reconstruction: str, vertical: str) -> None:
    apart = [
        tracks.apart((reconstruction, frame, vertical), (reconstruction, "n", vertical)).max()
        for frame in MECHANIZATIONS
    ]
    # m: the step leaves (Omega dt)^2 g / 6 = 9e-11 m/s^2 at 10 Hz, in frame i, which becomes 0.4 mm
    # where the height runs away in 50 min and grows with the square of the step; 10 um elsewhere
    limit = 1e-3 if vertical == "free" else 1e-4
    assert max(apart) < limit * block_length(reconstruction) ** 2


# Largest distance from centred-9 after 120 s and after 50 min of driving, m, without the runaway of
# a free height. The swings make a steady drift by coning, of which each further sample on a side
# leaves (Omega dt)^2 / 5: a third at 2 Hz. So the distances fall by three from line to line, and
# the causal forms stand beside the centred ones of the same order.
LIMITS = {
    "causal-0": (1.0, 2300.0),  # no coning
    "causal-1": (0.16, 600.0),
    "centred-3": (0.17, 590.0),
    "samples-2": (0.7, 670.0),  # as order 4 as those two, but over 0.2 s in the car's bends
    "causal-2": (0.037, 195.0),
    "centred-5": (0.046, 185.0),
    # from here on it is swings above 2.5 Hz, resolved by no more than four samples, and noise
    "causal-3": (0.02, 60.0),
    "centred-7": (0.02, 60.0),
    "causal-4": (0.02, 60.0),
    "centred-9": (0.0, 0.0),
    "centred-11": (0.02, 60.0),
    "centred-13": (0.02, 60.0),
    "centred-15": (0.02, 60.0),
}
# A swing of 2.5 or 3.3 Hz repeats in every block of 0.4 or 0.3 s: what the block leaves out of it
# does not average out, and drifts by 1 mrad in two minutes.
TOO_LONG = {"samples-3": (10.0, 11_000.0), "samples-4": (30.0, 70_000.0)}
# Of rates at points, half as much again as measured. Euler turns no force, like "none"; means of
# two ends shrink a swing of 3 Hz to its half, so that twice its coning stays.
OF_POINTS = {"euler": (36.0, 2000.0), "midpoint": (1.8, 5400.0), "rk4": (1.0, 1300.0)}


@pytest.mark.parametrize("vertical", ["hold", "baro"])
def test_compensated_reconstructions_differ_by_what_ten_hertz_leave_open(
    tracks: Tracks, vertical: str
) -> None:
    assert {*LIMITS, *TOO_LONG, *OF_POINTS, "none"} == set(RECONSTRUCTIONS)
    none = tracks.from_default("none", vertical)
    # m: uncompensated, force is turned too little by half of what the car turns in an interval:
    # 20 mrad of 2 m/s^2 across, in every bend
    assert 15.0 < none[0] < 40.0
    for name, limits in LIMITS.items():
        early, late = tracks.from_default(name, vertical)
        assert early <= limits[0], name
        assert late <= limits[1], name
        assert early < 0.05 * none[0], name
        assert late < none[1], name
    for name, limits in OF_POINTS.items():
        early, late = tracks.from_default(name, vertical)
        assert early <= limits[0], name
        assert late <= limits[1], name
    for name, (least, most) in TOO_LONG.items():
        early, late = tracks.from_default(name, vertical)
        assert least < early < 3.0 * least, name
        assert late < most, name


@pytest.mark.parametrize(
    "family",
    [["causal-0", "causal-1", "causal-2", "causal-3"], ["centred-3", "centred-5", "centred-7"]],
)
def test_each_further_sample_leaves_a_third(tracks: Tracks, family: list[str]) -> None:
    left = np.array([tracks.from_default(name, "hold")[1] for name in family])
    ratio = left[1:] / left[:-1]
    assert np.all((ratio > 0.15) & (ratio < 0.45))


def test_the_vertical_channels_differ_by_the_height(tracks: Tracks, shared_data: Path) -> None:
    table = np.genfromtxt(
        shared_data / "kingston_hg1700_reference.csv", delimiter=",", skip_header=1
    )
    t = table[:, 0] - drive(shared_data).imu.epoch_ns * 1e-9
    height = np.interp(tracks.t, t, table[:, 3])
    errors = {
        vertical: np.abs(tracks.heights["centred-9", "n", vertical] - height)
        for vertical in VERTICAL
    }
    start = drive(shared_data).state.h
    assert np.abs(tracks.heights["centred-9", "n", "hold"] - start).max() < 1e-9  # m: rounding
    # m: the road climbs by 36 m. Free, a false 0.07 mm/s^2 grows by (cosh(t / 570 s) - 1)
    # (570 s)^2, a factor of 2 million in 50 min. The receiver's altitude is off by up to 30 m for
    # seconds, of which the loop of 100 s lets 7 m through
    assert errors["hold"].max() == pytest.approx(36.4, abs=1.0)
    assert errors["free"].max() > 1000.0
    assert errors["baro"].max() < 10.0


@pytest.mark.parametrize(
    ("reconstruction", "frame", "vertical"),
    [
        (name, frame, vertical)
        for name, frame, vertical in zip(
            RECONSTRUCTIONS,
            itertools.cycle(MECHANIZATIONS),
            itertools.cycle(VERTICAL),
            strict=False,
        )
    ],
)
def test_the_command_takes_every_choice(
    tmp_path: Path, shared_data: Path, reconstruction: str, frame: str, vertical: str
) -> None:
    bench = Bench(tmp_path)
    bench.log, bench.site = shared_data / LOG, site_file(tmp_path)
    options = ("--reconstruction", reconstruction, "--frame", frame, "--vertical", vertical)
    out = bench.accepted(*options, "--output-rate", "1").out
    assert f"Navigation  {reconstruction}, frame {frame}, vertical {vertical}" in out
    nav = solve(drive(shared_data), reconstruction, frame, vertical)
    found = solution(bench.out)
    stamp_ns = nav.epoch_ns + np.rint(nav.t * 1e9).astype(np.int64)
    rows = np.flatnonzero(np.isin(stamp_ns, found["stamp_ns"]))
    assert len(rows) == len(found["stamp_ns"]) == pytest.approx(3010, abs=10)
    assert found["height_m"].tobytes() == nav.h[rows].tobytes()
    assert found["v_east_m_s"].tobytes() == np.ascontiguousarray(nav.v_eb_n[rows, 1]).tobytes()
    assert found["orientation.w"].tobytes() == np.ascontiguousarray(nav.q_nb[rows, 0]).tobytes()
