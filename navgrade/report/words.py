"""Numbers and terms as people read them."""

from __future__ import annotations

import math
from datetime import UTC, datetime

from earth.units import ARCSEC, DEG
from navgrade.compare.result import Group, Growth

_PREFIXES = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k"}
_SMALL_ANGLE = 1e-3  # rad: 0.06°, up to here in rad
_FINE_ANGLE = 0.01 * DEG  # below it in arcseconds

GROUPS: dict[Group, str] = {
    "engine": "The full engine",
    "flat": "A flat world",
    "term": "One term left out",
}

MEANINGS = {
    "engine": "Everything navgrade knows: a rotating, ellipsoidal Earth whose gravity varies with "
    "latitude and height, and samples integrated with all corrections.",
    "flat": "The ground is a plane that does not turn, and gravity is one constant; samples are "
    "integrated as by the full engine.",
    "flat-matrix": "A flat world with the attitude kept as a rotation matrix.",
    "flat-euler": "A flat world, each step taken with the values at its beginning.",
    "flat-midpoint": "A flat world, each step taken with the values at its middle.",
    "flat-rk4": "A flat world, each step taken with four evaluations, after Runge and Kutta.",
    "earth-rate": "The gyros feel the Earth turn, 15° an hour; left out, level slowly tilts and "
    "gravity leaks into the horizontal.",
    "transport-rate": "Level turns as the vehicle moves around the curved Earth; left out, it "
    "stays that of the start, and gravity leaks into the horizontal.",
    "coriolis": "Moving over a turning Earth, everything is pushed aside, to the right in the "
    "northern hemisphere; left out, the push is taken for a real acceleration.",
    "ellipsoid": "The Earth is flattened by 1 in 298; left out, it is a ball, and metres become "
    "the wrong degrees.",
    "gravity-height": "Gravity weakens by a third of a millionth for each metre up; left out, it "
    "is that of the height of the start.",
    "gravity-latitude": "Gravity grows by half a percent from the equator to the poles; left out, "
    "it is that of the latitude of the start.",
    "north-gravity": "Above the ellipsoid a plumb line leans a little towards the equator; left "
    "out, it is exactly vertical.",
    "coning": "When the axis of rotation itself turns, as under vibration, the sum of the gyro's "
    "samples is not the turn; left out, it is taken for it.",
    "sculling": "Rocking and shaking in step make a force that sums of samples miss; left out, it "
    "is missed.",
    "rotation": "The vehicle turns while a sample of its acceleration is summed; left out, the "
    "sum is taken as if it had not.",
}
"""One sentence for each variant, by its name without "without-"."""


def meaning(name: str) -> str:
    """One sentence on a variant, empty where there is none."""
    return MEANINGS.get(name.removeprefix("without-"), "")


def readable(value: float, unit: str, digits: int = 3) -> str:
    """A size with the prefix or unit that keeps it short: "18.2 m", "3,910 km", "0.204°".

    Parameters
    ----------
    value : float
        Not negative; m, m/s or rad.
    unit : {"m", "m/s", "rad"}
        Angles from 1 mrad on are given in degrees.
    digits : int
        Significant.
    """
    if math.isnan(value):
        return "—"
    value = float(f"{value:.{digits - 1}e}")
    if value == 0.0:
        return "0"
    if unit == "rad" and value >= _SMALL_ANGLE:
        return f"{_plain(value / DEG, digits)}°"
    power = min(max(3 * math.floor(math.log10(value) / 3), -9), 3 if unit == "m" else 0)
    return f"{_plain(value / 10.0**power, digits)} {_PREFIXES[power]}{unit}"


def _plain(value: float, digits: int) -> str:
    value = float(f"{value:.{digits - 1}e}")
    return f"{value:,.{max(digits - 1 - math.floor(math.log10(value)), 0)}f}"


def number(value: float, digits: int = 3) -> str:
    """Some significant digits without a power of ten; a dash for what is not finite."""
    if not math.isfinite(value):
        return "—"
    if value == 0.0:
        return "0"
    return f"{'−' if value < 0.0 else ''}{_plain(abs(value), digits)}"


def signed(value: float, digits: int = 3) -> str:
    """As `number`, with a plus where it is positive."""
    return f"{'+' if value > 0.0 and math.isfinite(value) else ''}{number(value, digits)}"


def angle_unit(largest: float) -> tuple[float, str]:
    """Size, rad, and sign of the unit in which angles up to this one read best."""
    return (ARCSEC, "″") if largest < _FINE_ANGLE else (DEG, "°")


def readable_angle(value: float, digits: int = 3) -> str:
    """An angle given in rad: "8.21″", "0.0740°"."""
    size, sign = angle_unit(abs(value))
    text = number(value / size, digits)
    return text if text in ("—", "0") else f"{text}{sign}"


def decades(unit: str) -> dict[float, str]:
    """What stands at the ticks of a logarithmic axis: 1 to 9 times powers of ten, SI prefixes."""
    labels = {}
    for power in range(-15, 10):
        step = min(max(3 * (power // 3), -9), 3 if unit == "m" else 0)
        for digit in range(1, 10):
            text = f"{digit * 10.0 ** (power - step):,.12g}"
            labels[float(f"{digit}e{power}")] = f"{text} {_PREFIXES[step]}{unit}"
    return labels


def readable_time(t: float) -> str:
    """A time since the start: "0.5 s", "1 min 30 s", "1 h"."""
    if t < 60.0:
        return f"{t:.3g} s"
    seconds = round(t)
    parts = (seconds // 3600, "h"), (seconds // 60 % 60, "min"), (seconds % 60, "s")
    return " ".join(f"{count} {unit}" for count, unit in parts if count)


def clock(start_ns: int) -> str:
    """Unix time as a date and a time of day."""
    return f"{datetime.fromtimestamp(start_ns // 1_000_000_000, UTC):%Y-%m-%d %H:%M:%S} UTC"


def place(lat: float, lon: float, h: float) -> str:
    """A position in degrees and metres."""
    north, east = "N" if lat >= 0.0 else "S", "E" if lon >= 0.0 else "W"
    return f"{abs(lat) / DEG:.6f}° {north}, {abs(lon) / DEG:.6f}° {east}, {h:.1f} m"


def law(growth: Growth) -> tuple[str, str, str] | None:
    """Mantissa, power of ten and power of time of a fitted law, None where nothing was fitted."""
    if not math.isfinite(growth.coefficient) or not math.isfinite(growth.power):
        return None
    mantissa, exponent = f"{growth.coefficient:.1e}".split("e")
    return mantissa, str(int(exponent)), f"{growth.power:.2f}"
