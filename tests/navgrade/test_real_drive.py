"""The recorded drive: tactical IMU, its own alignment, no aiding."""

from __future__ import annotations

from pathlib import Path

from tests.navgrade.real_drive import drive_errors


def test_first_two_minutes_of_driving(shared_data: Path) -> None:
    """Free inertial error against the reference over 120 s of driving."""
    errors = drive_errors(shared_data, (30.0, 60.0, 120.0))
    # m: while it was parked, people moved in the car, and 0.04 degrees of level (700 µg, which
    # its accelerometers may have) are 50 m by g b t^2 / 2; heading by gyros is 1 to 2 degrees off
    # (200 m to 400 m of path a minute give 5 to 10 m), a gyro bias of 2 deg/h gives 4 m by
    # g b t^3 / 6; a wrong sign or a wrong axis leaves hundreds. README of the data: 30 to 70 m.
    assert errors[30.0].horizontal < 4.0
    assert errors[60.0].horizontal < 15.0
    assert errors[120.0].horizontal < 60.0
    assert abs(errors[120.0].up) < 3.0
    assert errors[120.0].velocity < 0.9  # m/s: the reference's own and a tilt of 0.04 degrees
    assert errors[120.0].roll_pitch < 0.1  # deg: README of the data says 0.06, plus gyro bias
