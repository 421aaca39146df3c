"""All frames tell the same story, and each goes where it says it goes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pymap3d
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from navgrade import ImuSamples, Trajectory, navigate
from navgrade.errors import NumericalError
from navgrade.mechanization import MECHANIZATIONS
from navgrade.vertical import BaroLoop
from tests.navgrade.engine import fly, samples, state_at
from tests.oracles.cases import CONTEXT, position_error
from tests.oracles.polar import polar_flight
from tests.oracles.truth import (
    Coordinate,
    Motion,
    Sinusoid,
    ecef,
    manoeuvre,
    static,
    turning_vehicle,
)

Array = NDArray[np.float64]

DEG = np.pi / 180.0
EACH_FRAME = pytest.mark.parametrize("mechanization", MECHANIZATIONS)
POLAR = [name for name in MECHANIZATIONS if name != "n"]
EACH_POLAR_FRAME = pytest.mark.parametrize("mechanization", POLAR)
MOTIONS = {"turning vehicle": turning_vehicle, "manoeuvre": manoeuvre}


def C_en_of(lat: Array, lon: Array) -> Rotation:
    """North, east, down to Earth-fixed axes."""
    return Rotation.from_euler("ZY", np.stack([lon, -lat - np.pi / 2], axis=-1))


def earth_fixed(nav: Trajectory) -> tuple[Array, Array, Array]:
    """Position (m), velocity (m/s) and body axes of a solution, free of north."""
    C_en = C_en_of(nav.lat, nav.lon)
    C_eb = C_en * Rotation.from_quat(nav.q_nb, scalar_first=True)
    r = np.stack(pymap3d.geodetic2ecef(nav.lat, nav.lon, nav.h, deg=False), axis=-1)
    return r, C_en.apply(nav.v_eb_n.copy()), C_eb.as_matrix()


def spread(solutions: list[Trajectory]) -> tuple[float, float, float]:
    """Largest departure from the first solution: m, m/s, rad."""
    first, *others = [earth_fixed(nav[::50]) for nav in solutions]
    off = [[np.abs(a - b).max() for a, b in zip(first, other, strict=True)] for other in others]
    return tuple(np.max(off, axis=0)) if off else (0.0, 0.0, 0.0)


@cache
def an_hour(name: str) -> ImuSamples:
    """Increments of an hour at 100 Hz."""
    return samples(MOTIONS[name]().increments(np.arange(360_001) * 0.01))


def with_noise(log: ImuSamples) -> ImuSamples:
    """What a navigation-grade IMU adds: 0.003°/√h and 0.01°/h, 10 µg/√Hz and 5 µg."""
    rng = np.random.default_rng(11)
    root = np.sqrt(log.dt)[:, None]
    gyro = rng.standard_normal((len(log), 3)) * (0.003 * DEG / 60.0) * root  # rad
    accel = rng.standard_normal((len(log), 3)) * 1e-4 * root  # m/s
    gyro_bias = np.array([1.0, -1.0, 1.0]) * (0.01 * DEG / 3600.0)  # rad/s
    accel_bias = np.array([-5e-5, 5e-5, 5e-5])  # m/s^2
    dt = log.dt[:, None]
    return replace(
        log, gyro=log.gyro + gyro + gyro_bias * dt, accel=log.accel + accel + accel_bias * dt
    )


@pytest.mark.parametrize("sensors", ["exact", "noisy"])
@pytest.mark.parametrize("vertical", ["free", "hold", "baro"])
@pytest.mark.parametrize("name", MOTIONS)
def test_frames_agree(name: str, vertical: str, sensors: str) -> None:
    """The same increments lead every frame the same way, to a tenth of a millimetre an hour."""
    motion, log = MOTIONS[name](), an_hour(name)
    if sensors == "noisy":
        log = with_noise(log)
    seconds = np.arange(3602.0)
    heights = BaroLoop(t=seconds - 1.0, h=motion.state(seconds - 1.0).h)
    chosen: Any = heights if vertical == "baro" else vertical
    apart = spread(
        [
            navigate(
                log,
                state_at(motion, 0.0),
                reconstruction="causal-3",
                mechanization=frame,
                vertical=chosen,
            )
            for frame in MECHANIZATIONS
        ]
    )
    # m, m/s: each frame's own step leaves 50 um in an hour where the height runs free, less where
    # it does not; rad: rounding of 360,000 turns
    assert apart[0] < 2e-4
    assert apart[1] < 5e-7
    assert apart[2] < 5e-12


# --- the poles ------------------------------------------------------------------------------------


@pytest.mark.parametrize("pole", [1, -1])
def test_frames_agree_across_the_poles(pole: int) -> None:
    """Ten minutes over the pole and round it: no frame but n knows that it is there."""
    motion = polar_flight(pole)
    flights = [
        fly(motion, np.arange(-24, 60_025) * 0.01, 24, mechanization=frame)[0] for frame in POLAR
    ]
    assert np.abs(np.concatenate([nav.lat for nav in flights])).max() > 89.9999 * DEG
    apart = spread(flights)
    # m, m/s, rad: each frame's own step leaves 1 um in ten minutes, and rounding
    assert apart[0] < 1e-5
    assert apart[1] < 3e-8
    assert apart[2] < 2e-12


@pytest.mark.parametrize("pole", [1, -1])
@EACH_POLAR_FRAME
def test_start_at_the_pole(mechanization: str, pole: int) -> None:
    """A state exactly at a pole is a start like any other; its north is that of its longitude."""
    # along a meridian, in the closed form as if latitude went on beyond the pole
    motion = Motion(
        lat=Coordinate(pole * np.pi / 2, rate=pole * 1.5e-5),
        lon=Coordinate(0.7),
        h=Coordinate(900.0, sinusoids=(Sinusoid(20.0, 0.2),)),
        roll=Coordinate(0.1),
        pitch=Coordinate(-0.2, sinusoids=(Sinusoid(0.05, 0.3),)),
        heading=Coordinate(1.0),
    )
    nav, _ = fly(motion, np.arange(6001) * 0.01, mechanization=mechanization)
    truth = motion.state(nav.t)
    r, v, axes = earth_fixed(nav)
    C_en = C_en_of(truth.lat, truth.lon)
    # m, m/s, rad: the steps of 10 ms and the gravity fit leave 3e-12 m/s^2, a minute of it 5 nm
    # and 0.2 nm/s; conversions round to a few nm
    np.testing.assert_allclose(r, ecef(truth.lat, truth.lon, truth.h), atol=5e-8)
    np.testing.assert_allclose(v, C_en.apply(truth.v_eb_n), atol=1e-9)
    np.testing.assert_allclose(axes, C_en.as_matrix() @ truth.C_nb, atol=1e-13)


@pytest.mark.parametrize("pole", [1, -1])
def test_frame_n_stops_short_of_the_poles(pole: int) -> None:
    """Frame n refuses beyond 89.9° and names the frames that go on."""
    motion = Motion(
        lat=Coordinate(pole * 89.89 * DEG, rate=pole * 1e-4),
        lon=Coordinate(0.3),
        h=Coordinate(10.0),
        roll=Coordinate(0.0),
        pitch=Coordinate(0.1),
        heading=Coordinate(0.2),
    )
    with pytest.raises(NumericalError, match=r"89\.9") as caught:
        fly(motion, np.arange(1001) * 0.01, mechanization="n")
    # s: 0.01 degrees at 1e-4 rad/s
    assert caught.value.t == pytest.approx(0.01 * DEG / 1e-4, abs=0.02)
    with pytest.raises(NumericalError, match=r"89\.9") as caught:
        fly(static(-89.95, 0.0, 0.0, 1.0, 2.0, 3.0), np.arange(11) * 0.01, mechanization="n")
    for name in ("e", "w"):
        assert f" {name} " in str(caught.value)


# --- the date line --------------------------------------------------------------------------------


@EACH_FRAME
@pytest.mark.parametrize("east", [1.0, -1.0])
def test_date_line(mechanization: str, east: float) -> None:
    """Crossing the date line costs nothing, and longitude stays within ±180°."""

    def cross(lon: float) -> tuple[Array, Array]:
        motion = Motion(
            lat=Coordinate(-17 * DEG, sinusoids=(Sinusoid(1e-4, 0.1),)),
            lon=Coordinate(lon - east * 1e-4, rate=east * 4e-5),
            h=Coordinate(900.0),
            roll=Coordinate(0.1),
            pitch=Coordinate(-0.2, sinusoids=(Sinusoid(0.05, 0.3),)),
            heading=Coordinate(0.0),
        )
        nav, truth = fly(motion, np.arange(-24, 1025) * 0.01, 24, mechanization=mechanization)
        error = position_error(nav, truth)
        return np.stack([error.north, error.east, error.up]), nav.lon

    at_greenwich, _ = cross(0.0)
    at_the_line, lon = cross(east * np.pi)
    # m: 4e-16 rad of longitude is 3 nm, here rounded in truth and solution
    np.testing.assert_allclose(at_the_line, at_greenwich, atol=2e-8)
    assert np.abs(lon).max() <= np.pi
    assert np.sign(lon[0]) == east
    assert np.sign(lon[-1]) == -east
    # rad: 4e-7 a step, modulo a turn
    np.testing.assert_allclose(np.diff(np.unwrap(lon)), east * 4e-7, atol=1e-12)


CRUISE = {  # m after ten minutes of steps of 1 s, horizontal and vertical
    "n": (1e-5, 1e-5),  # nothing changes in n
    "e": (5e-3, 5e-3),  # gravity turns in e by v / R + ..., dt^2 / 24 of its second derivative
    "i": (1.5e-3, 1.5e-3),  # likewise
    "w": (1.5e-3, 1e-4),  # north turns in w, and the Earth rate with it
}


@pytest.mark.parametrize("mechanization", MECHANIZATIONS)
def test_cruise_in_long_steps(mechanization: str) -> None:
    """Level and straight at 300 m/s: what one step neglects, in steps of one second.

    The frame's rotation to second order is 2e-8 m/s^2, 3 mm after ten minutes; the slope of
    gravity in axes that do not follow it is 20 to 40 mm.
    """
    motion = Motion(
        lat=Coordinate(0.9),
        lon=Coordinate(0.1, rate=7.6e-5),  # rad/s, 301 m/s
        h=Coordinate(8000.0),
        roll=Coordinate(0.1),
        pitch=Coordinate(-0.2),
        heading=Coordinate(1.0),
    )
    edges = np.arange(-CONTEXT, 601 + CONTEXT) * 1.0
    nav, truth = fly(motion, edges, CONTEXT, mechanization=mechanization)
    error = position_error(nav, truth)
    horizontal, vertical = CRUISE.get(mechanization, (5e-3, 5e-3))
    assert error.horizontal < horizontal
    assert error.vertical < vertical
