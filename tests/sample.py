"""The sample drive's solution against its exact truth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from numpy.typing import NDArray

from tests.oracles.constants import EQUATORIAL_RADIUS

EPOCH_S = 1_767_225_600  # 2026-01-01T00:00:00Z, t = 0 of the truth
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Comparison:
    """Truth on a plane about the start, and solution minus truth, m and deg."""

    t: Array
    truth_north: Array
    truth_east: Array
    north: Array
    east: Array
    up: Array
    roll: Array
    pitch: Array
    heading: Array


def compare(solution: Path, truth: Path) -> Comparison:
    """Compare a solution of data/sample.mcap with data/sample_truth.csv where both have a row."""
    rows = []
    with solution.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        messages = list(reader.iter_decoded_messages(topics=["/navgrade/solution"]))
    for _, _, _, m in messages:
        t_ns = (m.header.stamp.sec - EPOCH_S) * 1_000_000_000 + m.header.stamp.nanosec
        place = m.latitude_deg, m.longitude_deg, m.height_m
        rows.append((t_ns, *place, m.roll_deg, m.pitch_deg, m.heading_deg))
    nav = np.array(rows)
    table = np.genfromtxt(truth, delimiter=",", skip_header=1)
    _, ours, theirs = np.intersect1d(
        nav[:, 0], np.rint(table[:, 0] * 1e9), assume_unique=True, return_indices=True
    )
    nav, table = nav[ours], table[theirs]
    degree = EQUATORIAL_RADIUS * np.pi / 180.0
    shrink = np.cos(np.radians(table[:, 1]))
    return Comparison(
        t=table[:, 0],
        truth_north=(table[:, 1] - table[0, 1]) * degree,
        truth_east=(table[:, 2] - table[0, 2]) * degree * shrink,
        north=(nav[:, 1] - table[:, 1]) * degree,
        east=(nav[:, 2] - table[:, 2]) * degree * shrink,
        up=nav[:, 3] - table[:, 3],
        roll=nav[:, 4] - table[:, 7],
        pitch=nav[:, 5] - table[:, 8],
        heading=(nav[:, 6] - table[:, 9] + 180.0) % 360.0 - 180.0,
    )
