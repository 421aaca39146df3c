"""Ready scenarios: how exactly they close, their pictures, and the page about them."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from earth.geodetic import geodetic_to_ecef
from earth.units import DEG_PER_S
from navgrade.logs import read_aiding
from navgrade.sensors import GRADES, SHEET
from navgrade.simulate.imu import imu_rates, true_trajectory
from navgrade.simulate.scenario import Scenario, read_scenario

ROOT = Path(__file__).resolve().parents[1]
READY = ROOT / "data" / "scenarios"
PICTURES = ROOT / "docs" / "scenarios"
ORDER = ("car", "airliner", "helicopter", "ship", "robot", "turntable", "still", "path")
_POINTS = 60_000  # of a curve: 100 Hz show vibration as a band
_COLOURS = 96  # of a picture: a file of less than 60 kB
_MARK = "<!-- made by `python -m benchmarks scenarios --write`: {} -->"

Array = NDArray[np.float64]


def closing(name: str) -> tuple[float, float, float]:
    """Duration, s, and largest horizontal and vertical error, m, of a scenario's whole length.

    By the commands: simulated, and navigated by centred-13 from the site file written beside it.
    """
    with tempfile.TemporaryDirectory() as folder:
        log, site, nav = (Path(folder) / part for part in ("log.mcap", "site.toml", "nav.mcap"))
        _navgrade("simulate", READY / f"{name}.toml", "-o", log, "--site", site)
        _navgrade("run", log, "-c", site, "-o", nav, "--reconstruction", "centred-13")
        truth = read_aiding(log, "/truth/solution")
        found = read_aiding(nav, "/navgrade/solution")
    _, a, b = np.intersect1d(truth.time_ns, found.time_ns, return_indices=True)
    assert truth.lat is not None and truth.lon is not None and truth.h is not None
    assert found.lat is not None and found.lon is not None and found.h is not None
    up = found.h[b] - truth.h[a]
    away = geodetic_to_ecef(found.lat[b], found.lon[b], truth.h[a])
    away -= geodetic_to_ecef(truth.lat[a], truth.lon[a], truth.h[a])
    seconds = float(truth.time_ns[-1] - truth.time_ns[0]) * 1e-9
    return seconds, float(np.linalg.norm(away, axis=1).max()), float(np.abs(up).max())


def _navgrade(*arguments: object) -> None:
    command = [sys.executable, "-m", "navgrade", *map(str, arguments)]
    subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)


def closings() -> Iterator[str]:
    """Lines of a table."""
    yield "| scenario | length | horizontal | vertical |"
    yield "|---|---|---|---|"
    for name in ORDER:
        seconds, horizontal, vertical = closing(name)
        yield f"| {name} | {seconds:.0f} s | {_small(horizontal)} | {_small(vertical)} |"


def _small(metres: float) -> str:
    return f"{metres * 1e6:.2g} µm" if metres < 1e-3 else f"{metres * 1e3:.2g} mm"


def grades() -> Iterator[str]:
    """Lines of a table of grades, where its numbers are from, and how they follow."""
    names = list(GRADES)
    sources: dict[str, int] = {}
    how = []
    yield "| key | " + " | ".join(names) + " | unit |"
    yield "|---" * (len(names) + 2) + "|"
    for key in GRADES[names[0]].sheet:
        cells = []
        for name in names:
            figure = GRADES[name].sheet[key]
            number = sources.setdefault(figure.source, len(sources) + 1)
            value = np.format_float_positional(figure.value, 3, fractional=False, trim="-")
            cells.append(f"{value} [{number}]")
            how += [f"`{key}`, {name}: {figure.how}"] if figure.how else []
        yield f"| `{key}` | {' | '.join(cells)} | {SHEET[key].unit} |"
    yield ""
    for name in names:
        yield f"- **{name}**: {GRADES[name].what}."
    yield ""
    yield from (f"- [{number}] {source}" for source, number in sources.items())
    yield ""
    yield from (f"- {line}" for line in how)


def errors() -> Iterator[str]:
    """Lines of a table of what [imu.errors] takes."""
    yield "| gyros | accelerometers | holds |"
    yield "|---|---|---|"
    gyro = {e.field: key for key, e in SHEET.items() if e.part == "gyro"}
    for key, entry in SHEET.items():
        if entry.part == "accel":
            yield f"| `{gyro[entry.field]}` | `{key}` | {entry.meaning} |"


def filled(page: str, sections: dict[str, Iterator[str]]) -> str:
    """The page with what stands between its marks made anew."""
    for name, lines in sections.items():
        begin, end = _MARK.format(name), _MARK.format(f"end of {name}")
        before, rest = page.split(begin)
        _, after = rest.split(end)
        page = f"{before}{begin}\n" + "\n".join(lines) + f"\n{end}{after}"
    return page


def draw(name: str) -> Path:
    """Draw the track, and rates and forces, of a ready scenario."""
    scenario = read_scenario(READY / f"{name}.toml")
    motion = scenario.imu_motion
    t = np.linspace(motion.start, motion.end, _POINTS)
    omega, f = imu_rates(motion, t)
    east, north, h = _plan(scenario, t)
    figure, axes = plt.subplot_mosaic(
        [["plan", "rate"], ["height", "force"]],
        figsize=(9, 4.6),
        layout="constrained",
        height_ratios=(1.6, 1.0),
        width_ratios=(1.0, 1.3),
    )
    unit, scale = ("km", 1e-3) if max(np.ptp(east), np.ptp(north)) > 5000.0 else ("m", 1.0)
    plan = axes["plan"]
    plan.plot(east * scale, north * scale, color="C0", linewidth=1.2)
    plan.plot(east[:1] * scale, north[:1] * scale, "o", color="C3", markersize=4)
    plan.set(xlabel=f"east, {unit}", ylabel=f"north, {unit}", title=name)
    plan.set_aspect("equal", adjustable="datalim")
    axes["height"].plot(t - t[0], h, linewidth=1.0)
    middle, half = 0.5 * (h.max() + h.min()), max(0.55 * np.ptp(h), 0.5)
    axes["height"].set(xlabel="s", ylabel="height, m", ylim=(middle - half, middle + half))
    axes["height"].ticklabel_format(useOffset=False)
    axes["rate"].plot(t - t[0], omega / DEG_PER_S, linewidth=0.7)
    axes["rate"].set(ylabel="ω_ib_b, °/s")
    axes["rate"].legend(("forward", "right", "down"), frameon=False, ncols=3, fontsize="small")
    axes["force"].plot(t - t[0], f, linewidth=0.7)
    axes["force"].set(xlabel="s", ylabel="f_ib_b, m/s²")
    for axis in axes.values():
        axis.grid(alpha=0.3)
    PICTURES.mkdir(exist_ok=True)
    path = PICTURES / f"{name}.png"
    figure.savefig(path, dpi=80)
    plt.close(figure)
    with Image.open(path) as image:
        few = image.convert("RGB").quantize(_COLOURS, dither=Image.Dither.NONE)
    few.save(path, optimize=True)
    return path


def _plan(scenario: Scenario, t: Array) -> tuple[Array, Array, Array]:
    """East and north of the first point, m, for the eye, and height."""
    nav = true_trajectory(scenario.imu_motion, t)
    radius = 6_378_137.0  # m
    north = (nav.lat - nav.lat[0]) * radius
    east = (np.unwrap(nav.lon) - nav.lon[0]) * radius * np.cos(nav.lat[0])
    return east, north, nav.h
