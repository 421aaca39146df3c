"""MCAP and the encodings of its messages; knows nothing of navigation."""

from navgrade.logs.container.reader import Issue, McapFile, RawMessages

__all__ = ["Issue", "McapFile", "RawMessages"]
