"""MCAP and the encodings of its messages; knows nothing of navigation."""

from navgrade.logs.container.definitions import Member
from navgrade.logs.container.reader import Columns, McapFile, Messages
from navgrade.logs.container.walk import Issue
from navgrade.logs.container.writer import Batch, McapWriter

__all__ = ["Batch", "Columns", "Issue", "McapFile", "McapWriter", "Member", "Messages"]
