"""MCAP in and out. Nothing outside this package touches a container or a schema."""

from navgrade.logs.heights import Heights, read_heights
from navgrade.logs.imu_log import ImuLog, open_imu, read_imu, sha256
from navgrade.logs.solution import (
    PROVENANCE,
    SolutionWriter,
    check_output,
    write_increments,
    write_solution,
)
from navgrade.logs.topics import Topic, list_topics

__all__ = [
    "PROVENANCE",
    "Heights",
    "ImuLog",
    "SolutionWriter",
    "Topic",
    "check_output",
    "list_topics",
    "open_imu",
    "read_heights",
    "read_imu",
    "sha256",
    "write_increments",
    "write_solution",
]
