"""Closed-form motion against high precision."""

from __future__ import annotations

import numpy as np
import pytest
from mpmath import mp, mpf

from navgrade.simulate import Oscillation, Sinusoid, Sinusoids
from tests.navgrade.simulate.exact import DEG, Pose, closing, mismatch, over_earth, radii
from tests.oracles.high_precision import from_euler

SWELL = Sinusoids(
    lat=-48.3 * DEG,
    lon=179.999 * DEG,  # the path crosses the antimeridian
    h=-12.0,
    duration=100.0,
    north=Oscillation(40.0, -30.0, (Sinusoid(100.0, 0.02, 0.3), Sinusoid(0.02, 7.0))),
    east=Oscillation(0.0, 45.0, (Sinusoid(10.0, 0.1, -1.0),)),
    up=Oscillation(3.0, 0.2, (Sinusoid(3.0, 0.13, 2.0),)),
    roll=Oscillation(2.5, 0.02, (Sinusoid(0.5, 0.05, 0.1),)),
    pitch=Oscillation(-1.2, 0.0, (Sinusoid(0.3, 0.15),)),
    heading=Oscillation(4.0, -0.1, (Sinusoid(0.3, 0.1), Sinusoid(0.001, 9.0))),
)


def value(x: Oscillation, t: mpf) -> mpf:
    """An oscillation in high precision."""
    return (
        mpf(x.value)
        + mpf(x.rate) * t
        + sum(
            mpf(s.amplitude) * mp.sin(2 * mp.pi * mpf(s.frequency) * t + mpf(s.phase))
            for s in x.sinusoids
        )
    )


def pose(motion: Sinusoids) -> Pose:
    """Its pose in high precision."""

    def at(t: mpf) -> tuple[mp.matrix, mp.matrix]:
        lat, lon, h = mpf(motion.lat), mpf(motion.lon), mpf(motion.h)
        meridian, transverse = radii(lat)
        return over_earth(
            lat + value(motion.north, t) / (meridian + h),
            lon + value(motion.east, t) / ((transverse + h) * mp.cos(lat)),
            h + value(motion.up, t),
            from_euler(*(value(x, t) for x in (motion.roll, motion.pitch, motion.heading))),
        )

    return at


def test_rates_of_a_closed_form() -> None:
    """Rates, force and velocity agree with high precision to rounding."""
    found = mismatch(SWELL, lambda _: pose(SWELL), (0.0, 12.345, 61.7, 99.99))
    # phases up to 6e3 rad are rounded to 5e-13 rad: of 0.06 rad/s at 9 Hz, and of 39 m/s^2 and
    # 0.9 m/s at 7 Hz, that is
    assert found.omega < 5e-14  # rad/s
    assert found.f < 2e-11  # m/s^2
    assert found.v < 5e-13  # m/s


def test_closes() -> None:
    """A hundred seconds of it, navigated, end where it ends."""
    error = closing(SWELL, np.arange(0.0, 100.0, 0.005))
    # m: roundings of positions, and 1e-12 m/s^2 of the engine's gravity
    assert max(error.horizontal, error.vertical) < 3e-8


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"duration": 0.0}, "duration must be positive, got 0.0 s"),
        ({"lat": float("nan")}, "lat must be finite, got nan"),
        ({"lat": 1.56}, "the reference point is at latitude 89.38"),
        ({"north": Oscillation(rate=1e6)}, "the path is at latitude .* beyond ±89°"),
    ],
)
def test_refusals(change: dict[str, object], message: str) -> None:
    """Each wrong number is named."""
    values = {"lat": 0.5, "lon": 1.0, "h": 0.0, "duration": 9.0} | change
    with pytest.raises(ValueError, match=message):
        Sinusoids(**values)  # type: ignore[arg-type]


def test_refused_oscillations() -> None:
    """A frequency that is not positive, a number that is not finite."""
    with pytest.raises(ValueError, match=r"frequency must be positive, got -1.0 Hz"):
        Sinusoid(1.0, -1.0)
    with pytest.raises(ValueError, match="finite"):
        Sinusoid(float("inf"), 1.0)
    with pytest.raises(ValueError, match="finite"):
        Oscillation(rate=float("nan"))
