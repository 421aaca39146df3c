"""The lectures' tables: Euler, midpoint, Runge-Kutta by motion, and what a flat world costs."""

from __future__ import annotations

import re
import textwrap
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from earth import quat_from_euler, rotvec_from_quat
from earth.rotation import quat_product
from navgrade import ImuSamples, NavState, navigate
from navgrade.local import to_local
from tests.navgrade.engine import samples, state_at
from tests.oracles import lectures
from tests.oracles.cases import position_error
from tests.oracles.constants import OMEGA
from tests.oracles.gravity import normal_gravity_zonal
from tests.oracles.truth import Coordinate, Motion, per_metre, static

Array = NDArray[np.float64]

PAGE = Path(__file__).resolve().parents[1] / "docs" / "flat-world.md"
DEG = np.pi / 180.0
LAT, LON, H = 31.0 * DEG, 121.5 * DEG, 20.0
G = float(normal_gravity_zonal(LAT, H).down)  # m/s^2
DURATION = 61.7  # s: no whole periods, in which errors would cancel
DT = 0.01  # s
FLOOR = 2e-8  # m: below it the rounding of Earth-fixed positions shows


@dataclass(frozen=True)
class Wave:
    """constant + rate t + amplitude sin(w t + phase)."""

    constant: float = 0.0
    rate: float = 0.0
    amplitude: float = 0.0
    w: float = 1.0  # rad/s
    phase: float = 0.0  # rad

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Value and two derivatives."""
        arg, a, w = self.w * t + self.phase, self.amplitude, self.w
        return (
            self.constant + self.rate * t + a * np.sin(arg),
            self.rate + a * w * np.cos(arg),
            -a * w * w * np.sin(arg),
        )


@dataclass(frozen=True)
class Course:
    """A body over a plane, north, east, down (m), roll, pitch, heading (rad), in closed form."""

    name: str
    why: str
    place: tuple[Wave, Wave, Wave]
    angles: tuple[Wave, Wave, Wave]

    def truth(self, t: Array) -> tuple[Array, Array, Array]:
        """Position, velocity (NED) and q_nb."""
        p, v, _ = (np.stack(x, axis=-1) for x in zip(*(w.at(t) for w in self.place), strict=True))
        return p, v, quat_from_euler(*(w.at(t)[0] for w in self.angles))

    def samples(self, t: Array) -> ImuSamples:
        """What an ideal IMU feels at `t`."""
        (roll, roll1, _), (pitch, pitch1, _), (heading, heading1, _) = (
            w.at(t) for w in self.angles
        )
        omega = np.stack(
            [
                roll1 - heading1 * np.sin(pitch),
                pitch1 * np.cos(roll) + heading1 * np.cos(pitch) * np.sin(roll),
                heading1 * np.cos(pitch) * np.cos(roll) - pitch1 * np.sin(roll),
            ],
            axis=-1,
        )
        f = np.stack([w.at(t)[2] for w in self.place], axis=-1) - [0.0, 0.0, G]
        c, s = np.cos(heading), np.sin(heading)
        x, y, z = c * f[:, 0] + s * f[:, 1], c * f[:, 1] - s * f[:, 0], f[:, 2]
        c, s = np.cos(pitch), np.sin(pitch)
        x, z = c * x - s * z, s * x + c * z
        c, s = np.cos(roll), np.sin(roll)
        force = np.stack([x, c * y + s * z, c * z - s * y], axis=-1)
        return ImuSamples(t=t, gyro=omega, accel=force, kind="rate")

    def increments(self, t: Array) -> ImuSamples:
        """What it sums up between the times `t`."""
        x, w = np.polynomial.legendre.leggauss(12)
        dt = np.diff(t)
        felt = self.samples((t[:-1, None] + dt[:, None] * (0.5 + 0.5 * x)).ravel())
        sums = (
            np.einsum("m,nmi->ni", 0.5 * w, y.reshape(len(dt), -1, 3)) * dt[:, None]
            for y in (felt.gyro, felt.accel)
        )
        gyro, accel = sums
        return ImuSamples(t=t[1:], dt=dt, gyro=gyro, accel=accel, kind="increment")


def _waves(*table: tuple[float, ...]) -> tuple[Wave, Wave, Wave]:
    x, y, z = (Wave(*row) for row in table)
    return x, y, z


_HZ = 2.0 * np.pi
_SHAKE = 20.0 * _HZ
COURSES = (
    Course(
        "still",
        "Rates and forces are constant, and a constant times the interval is the integral: every "
        "scheme is exact.",
        _waves((0.0,), (0.0,), (0.0,)),
        _waves((0.05,), (-0.03,), (0.8,)),
    ),
    Course(
        "uniform",
        "20 m/s straight ahead feels like standing still: every scheme is exact.",
        _waves((0.0, 14.0), (0.0, 14.0), (0.0,)),
        _waves((0.02,), (0.01,), (0.785,)),
    ),
    Course(
        "accelerating",
        "±3 m/s² ahead in 8 s, no turns. Euler's force is late by half an interval: dt/2 times "
        "the change of the force is lost in velocity. A mean of the ends misses dt²/12 times its "
        "second derivative; without turns RK4 with such a middle is the midpoint scheme. The cubic "
        "follows the force.",
        _waves((0.0, 20.0, 3.0 * (8.0 / _HZ) ** 2, _HZ / 8.0, 0.4), (0.0,), (0.0,)),
        _waves((0.0,), (0.02,), (0.0,)),
    ),
    Course(
        "fast turning",
        "Circles of 3.5 s at 10 m/s, rolling by 17° at 0.5 Hz. The body turns by 1° in an "
        "interval: Euler does not turn the force with it and takes a rate that is late. Midpoint "
        "turns it, but neither it nor a mean middle sees how rate and force bend between the ends, "
        "and that mean costs RK4 two orders.",
        _waves((0.0, 0.0, 5.6, 1.8, 0.0), (0.0, 0.0, 5.6, 1.8, -1.5707963), (0.0,)),
        _waves((0.1, 0.0, 0.3, 0.5 * _HZ, 0.3), (0.0, 0.0, 0.05, 0.3 * _HZ, 1.0), (0.0, 1.8)),
    ),
    Course(
        "vibrating",
        "20 Hz, five samples a period: coning of 0.2° and 5 m/s². Errors that repeat with every "
        "period add up to a drift, which is coning, and sculling under the force. A mean of the "
        "ends shrinks the swings, so that midpoint leaves twice the coning that increments without "
        "any compensation would; Euler's swings are late, but of full size. Five points a period "
        "say too little for any scheme; increments, which a sensor sums itself, lose nothing "
        "between them.",
        _waves(
            (0.0, 0.0, 5.0 / _SHAKE**2, _SHAKE, 0.3),
            (0.0, 0.0, 5.0 / _SHAKE**2, _SHAKE, 1.1),
            (0.0,),
        ),
        _waves((0.0, 0.0, 0.2 * DEG, _SHAKE, 0.0), (0.0, 0.0, 0.2 * DEG, _SHAKE, 1.5708), (0.7,)),
    ),
)
SCHEMES = {
    "Euler": "flat-euler",
    "midpoint": "flat-midpoint",
    "RK4": "flat-rk4",
    "RK4, mean of the ends for the middle": "rk4-mean",
    "for comparison, true increments and `centred-9`": "flat",
}


def _errors(course: Course, scheme: str, dt: float) -> tuple[float, float, float]:
    """Final error of position (m), velocity (m/s) and attitude (rad)."""
    t = np.arange(round(DURATION / dt) + 1) * dt
    log = course.increments(t) if scheme == "flat" else course.samples(t)
    p, v, q = (x[[0, -1]] for x in course.truth(t))
    if scheme == "rk4-mean":
        rows = lectures.integrate(
            scheme, t, log.gyro, log.accel, lectures.quaternion_matrix(q[0]), v[0], np.zeros(3), -G
        )
        q_end, v_end, p_end = (x[-1] for x in rows)
    else:
        state = NavState(lat=LAT, lon=LON, h=H, v_eb_n=v[0], q_nb=q[0], t=t[0])
        nav = to_local(navigate(log, state, mechanization=scheme), LAT, LON, H, "NED", "FRD")
        q_end, v_end, p_end = nav.q[-1], nav.v[-1], nav.p[-1]
    turn = rotvec_from_quat(quat_product(q[-1] * [1.0, -1.0, -1.0, -1.0], q_end))
    off = (p_end - (p[-1] - p[0]), v_end - v[-1], turn)
    position, velocity, attitude = (float(np.linalg.norm(x)) for x in off)
    return position, velocity, attitude


def integrators() -> list[str]:
    """Markdown: final errors and order of every scheme on every course, and the reasons."""
    lines = [
        "| motion | integrator | position, m | velocity, m/s | attitude, ° | order |",
        "|---|---|---|---|---|---|",
    ]
    for course in COURSES:
        for name, scheme in SCHEMES.items():
            coarse, fine = (_errors(course, scheme, dt) for dt in (DT, 0.5 * DT))
            order = f"{np.log2(coarse[0] / fine[0]):.1f}" if fine[0] > FLOOR else "–"
            p, v, q = coarse[0], coarse[1], coarse[2] / DEG
            cells = (_figure(x, least) for x, least in ((p, FLOOR), (v, 1e-10), (q, 1e-10)))
            lines.append(f"| {course.name} | {name} | " + " | ".join(cells) + f" | {order} |")
    reasons = (f"- **{course.name}.** {course.why}" for course in COURSES)
    return [*lines, "", *(textwrap.fill(x, 105, subsequent_indent="  ") for x in reasons)]


def _figure(value: float, least: float) -> str:
    return f"{value:.2g}" if value > least else "0"


TIMES = (1, 10, 60, 300, 600)  # s


@dataclass(frozen=True)
class Journey:
    """A steady journey over the Earth; velocity north and east, m/s."""

    name: str
    motion: Motion
    v_n: float
    v_e: float

    def law(self, t: float) -> float:
        """How far the flat world goes astray by the leading terms, m."""
        lat, h = self.motion.lat.constant, self.motion.h.constant
        g = float(normal_gravity_zonal(lat, h).down)
        north, east = per_metre(lat, h)
        tilt = OMEGA * np.cos(lat) + self.v_e * east * np.cos(lat)
        sway = OMEGA * np.sin(lat) * t**2
        return float(
            np.hypot(
                sway * self.v_e + g * self.v_n * north * t**3 / 6.0,
                g * tilt * t**3 / 6.0 - sway * self.v_n,
            )
        )


def _steady(name: str, lat_deg: float, h: float, v_n: float, v_e: float) -> Journey:
    lat = lat_deg * DEG
    north, east = per_metre(lat, h)
    angles = Coordinate(0.03), Coordinate(-0.02), Coordinate(0.8)
    place = Coordinate(lat, v_n * north), Coordinate(0.1, v_e * east), Coordinate(h)
    return Journey(name, Motion(*place, *angles), v_n, v_e)


JOURNEYS = (
    Journey("rest, 45° N", static(45.0, 6.0, 0.0, 2.0, -1.0, 40.0), 0.0, 0.0),
    _steady("car, 20 m/s NE, 45° N", 45.0, 0.0, 20.0 * np.sqrt(0.5), 20.0 * np.sqrt(0.5)),
    _steady("aircraft, 250 m/s E, 10 km, 45° N", 45.0, 10_000.0, 0.0, 250.0),
)


def flatness() -> list[str]:
    """Markdown: the flat world on perfect data of the Earth, beside the leading terms."""
    lines = [
        "| journey | " + " | ".join(f"{t} s" for t in TIMES) + " |",
        "|---" * (len(TIMES) + 1) + "|",
    ]
    for journey in JOURNEYS:
        log = samples(journey.motion.increments(np.arange(round(TIMES[-1] / DT) + 9) * DT))
        nav = navigate(log, state_at(journey.motion, 0.0), mechanization="flat")
        cells = []
        for t in TIMES:
            row = round(t / DT) - 1
            error = position_error(nav[row : row + 1], journey.motion.state(nav.t[row]))
            cells.append(f"{error.horizontal:.4g} / {journey.law(t):.4g} m")
        lines.append(f"| {journey.name} | " + " | ".join(cells) + " |")
    return lines


def page() -> str:
    """The page with both tables measured afresh."""
    text = PAGE.read_text()
    for name, lines in (("integrators", integrators()), ("flatness", flatness())):
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
        text, found = re.subn(
            f"{begin}.*?{end}", lambda _, b=begin, e=end, r=lines: b + "\n".join(r) + "\n" + e,
            text, flags=re.DOTALL,
        )  # fmt: skip
        assert found == 1, name
    return text
