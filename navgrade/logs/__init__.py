"""MCAP in and out. Nothing outside this package touches a container or a schema."""

from navgrade.logs.aiding import Aiding, read_aiding
from navgrade.logs.container import Issue
from navgrade.logs.heights import Heights, read_heights
from navgrade.logs.imu_log import ImuLog, open_imu, read_imu, sha256
from navgrade.logs.schemas import ImuFields
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
    "Aiding",
    "Heights",
    "ImuFields",
    "ImuLog",
    "Issue",
    "SolutionWriter",
    "Topic",
    "check_output",
    "list_topics",
    "open_imu",
    "read_aiding",
    "read_heights",
    "read_imu",
    "sha256",
    "write_increments",
    "write_solution",
]
