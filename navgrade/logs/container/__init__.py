"""MCAP and the encodings of its messages; knows nothing of navigation."""

from navgrade.logs.container.definitions import Member
from navgrade.logs.container.reader import ENCODINGS, Columns, McapFile, Messages
from navgrade.logs.container.slow import SLOW_ENCODINGS
from navgrade.logs.container.walk import Issue
from navgrade.logs.container.writer import Batch, McapWriter

__all__ = [
    "ENCODINGS",
    "SLOW_ENCODINGS",
    "Batch",
    "Columns",
    "Issue",
    "McapFile",
    "McapWriter",
    "Member",
    "Messages",
]
