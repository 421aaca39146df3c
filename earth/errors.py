"""The root of every error this project raises on purpose."""


class NavgradeError(Exception):
    """Base of the errors a user can act on; the message says how.

    It lives in the lowest package so that `align` and `navgrade` share it.
    """
