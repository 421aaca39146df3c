"""Why an alignment was refused."""

from earth.errors import NavgradeError


class AlignmentError(NavgradeError):
    """The window cannot give an attitude; the message says why and what would help."""


class WeakGyrosError(AlignmentError):
    """The window is still and can be leveled, but its gyros do not find north."""
