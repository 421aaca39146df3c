"""MCAP in and out. Nothing outside this package touches a container or a schema."""

from __future__ import annotations

from typing import TYPE_CHECKING

from earth._lazy import lazy

if TYPE_CHECKING:
    from navgrade.logs.aiding import Aiding, read_aiding
    from navgrade.logs.container import Issue
    from navgrade.logs.container.writer import check_output
    from navgrade.logs.convert import write_increments
    from navgrade.logs.copying import TopicCopy
    from navgrade.logs.heights import Heights, read_heights
    from navgrade.logs.imu_log import ImuLog, open_imu, read_imu, sha256
    from navgrade.logs.schemas import ImuFields
    from navgrade.logs.solution import (
        POSE_RATE,
        PROVENANCE,
        SolutionWriter,
        write_solution,
    )
    from navgrade.logs.topics import Topic, list_topics
    from navgrade.logs.tracks import Track, read_track_csv, track_of

_HOMES = {
    "Aiding": "navgrade.logs.aiding",
    "Heights": "navgrade.logs.heights",
    "ImuFields": "navgrade.logs.schemas",
    "ImuLog": "navgrade.logs.imu_log",
    "Issue": "navgrade.logs.container",
    "POSE_RATE": "navgrade.logs.solution",
    "PROVENANCE": "navgrade.logs.solution",
    "SolutionWriter": "navgrade.logs.solution",
    "Topic": "navgrade.logs.topics",
    "TopicCopy": "navgrade.logs.copying",
    "Track": "navgrade.logs.tracks",
    "check_output": "navgrade.logs.container.writer",
    "list_topics": "navgrade.logs.topics",
    "open_imu": "navgrade.logs.imu_log",
    "read_aiding": "navgrade.logs.aiding",
    "read_heights": "navgrade.logs.heights",
    "read_imu": "navgrade.logs.imu_log",
    "read_track_csv": "navgrade.logs.tracks",
    "sha256": "navgrade.logs.imu_log",
    "track_of": "navgrade.logs.tracks",
    "write_increments": "navgrade.logs.convert",
    "write_solution": "navgrade.logs.solution",
}

__all__ = [
    "POSE_RATE",
    "PROVENANCE",
    "Aiding",
    "Heights",
    "ImuFields",
    "ImuLog",
    "Issue",
    "SolutionWriter",
    "Topic",
    "TopicCopy",
    "Track",
    "check_output",
    "list_topics",
    "open_imu",
    "read_aiding",
    "read_heights",
    "read_imu",
    "read_track_csv",
    "sha256",
    "track_of",
    "write_increments",
    "write_solution",
]

__getattr__ = lazy(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted(__all__)
