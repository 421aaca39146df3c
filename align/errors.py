"""Why an alignment was refused."""

from earth.errors import NavgradeError


class AlignmentError(NavgradeError):
    """The window cannot give an attitude; the message says why and what would help."""
