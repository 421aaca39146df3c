"""``navgrade simulate``: what it prints, the site file it writes, and that the log closes."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from navgrade.logs import read_aiding
from navgrade.site import read_site
from tests.navgrade.cli.calling import Outcome, navgrade, one_sentence
from tests.navgrade.logs.decoding import SOLUTION, SOLUTION_FLOATS, by_mcap_ros2_support
from tests.navgrade.simulate.scenarios import READY, START, STILL, TURN, shortened, written

RADIUS = 6_378_137.0  # m, to half a percent that of curvature
HERE = START.replace("12.0", "0.0")
LONG_STILL = STILL.replace("4.0", "45.0")
MOVE = """\
[[segment]]
type = "accelerate"
to_speed_m_s = 12.0
acceleration_m_s2 = 3.0
"""


class Bench:
    """A scenario, its log and site file, and the solution."""

    def __init__(self, folder: Path, scenario: Path) -> None:
        self.scenario = scenario
        self.log, self.site, self.nav = (
            folder / name for name in ("log.mcap", "site.toml", "nav.mcap")
        )

    def simulate(self, *options: object) -> Outcome:
        return navgrade("simulate", self.scenario, "-o", self.log, "--site", self.site, *options)

    def closing(self) -> np.ndarray:
        """Largest error along north, east, down, m, and of velocity, m/s, of the navigated log."""
        made = self.simulate()
        assert (made.code, made.err) == (0, ""), made
        run = navgrade(
            "run", self.log, "-c", self.site, "-o", self.nav, "--reconstruction", "centred-13"
        )
        assert (run.code, run.err) == (0, ""), run
        truth, nav = read_aiding(self.log, "/truth/solution"), read_aiding(self.nav, SOLUTION)
        _, a, b = np.intersect1d(truth.time_ns, nav.time_ns, return_indices=True)
        assert len(a) >= len(truth) - 2
        assert truth.lat is not None and truth.lon is not None and truth.h is not None
        assert nav.lat is not None and nav.lon is not None and nav.h is not None
        assert truth.v_eb_n is not None and nav.v_eb_n is not None
        north = (nav.lat[b] - truth.lat[a]) * RADIUS
        east = (nav.lon[b] - truth.lon[a]) * RADIUS * np.cos(truth.lat[a])
        velocity = nav.v_eb_n[b] - truth.v_eb_n[a]
        return np.abs([north, east, nav.h[b] - truth.h[a], *velocity.T]).max(axis=1)


def bench(folder: Path, imu: str = "", rest: str = START + TURN) -> Bench:
    return Bench(folder, written(folder, imu, rest))


@pytest.mark.parametrize(
    ("name", "segments"), [("airliner", 2), ("helicopter", 2), ("robot", 5), ("turntable", 4)]
)
def test_ready_scenarios_close(tmp_path: Path, name: str, segments: int) -> None:
    """Their first minute, within 1 um and 1 um/s: a tenth of it is measured, and ten minutes
    multiply it by at most a thousand, which leaves the millimetre."""
    found = Bench(tmp_path, shortened(name, tmp_path, segments)).closing()
    assert found.max() < 1e-6


def test_a_ship_and_a_drawn_path_close(tmp_path: Path) -> None:
    """Likewise; half a minute of the ship, and a line of 40 m."""
    text = (READY / "ship.toml").read_text().replace("600.0", "30.0")
    (tmp_path / "ship.toml").write_text(text)
    assert Bench(tmp_path, tmp_path / "ship.toml").closing().max() < 1e-6
    for path in tmp_path.glob("*.mcap"):
        path.unlink()
    (tmp_path / "site.toml").unlink()
    line = [[174.25, -41.5], [174.2502, -41.5], [174.2502, -41.4998], [174.2504, -41.4997]]
    geometry = {"type": "Feature", "geometry": {"type": "LineString", "coordinates": line}}
    (tmp_path / "line.geojson").write_text(json.dumps(geometry))
    path = '[path]\nfile = "line.geojson"\nheight_m = 12.0\nspeed_m_s = 3.0\nstill_s = 4.0\n'
    drawn = Bench(tmp_path, written(tmp_path, rest=path, rate_hz=200.0))
    assert drawn.closing().max() < 1e-6


@pytest.mark.parametrize("kind", ["average", "rate"])
def test_other_kinds_are_run_without_being_told(tmp_path: Path, kind: str) -> None:
    """Rates lose what happens between them: 0.1 mm in eleven seconds; averages lose nothing."""
    found = bench(tmp_path, f'kind = "{kind}"\nmounting_deg = [20, 30, 40]').closing()
    assert found.max() < (1e-6 if kind == "average" else 1e-4)


def test_it_prints_what_was_made(tmp_path: Path) -> None:
    text = "seed = 4\ndropped = 0.1\n[imu.errors]\ngyro_bias_deg_h = [1, 2, 3]\narw_deg_rth = 0.1\n"
    made = bench(tmp_path, text, START + TURN + "[gnss]\n").simulate("--seed", "9")
    assert (made.code, made.err) == (0, ""), made
    lines = {line[:22].strip(): line[22:] for line in made.out.splitlines()}
    assert lines["start"] == "2026-03-04 05:06:07 UTC"
    assert lines["duration"].startswith("13.720 s, 164.")
    count, _, topic, lost, _ = lines["samples"].split()
    assert (int(count) + int(lost), topic) == (1372, "/imu/increments,")
    assert 80 < int(lost) < 200
    assert lines["truth"] == "138 on /truth/solution"
    assert lines["fixes"] == "14 on /gnss/fix"
    assert lines["errors"] == "seed 9"
    assert lines["gyro_bias_deg_h"] == "1  2  3 °/h"
    assert lines["arw_deg_rth"] == "0.1 °/√h"
    assert lines["at the first sample"].startswith("-41.4999")
    assert lines["attitude"].startswith("roll ")
    assert lines["site file"] == str(tmp_path / "site.toml")
    assert "°/s at " in lines["largest rate"]


def test_site_of_a_moving_start(tmp_path: Path) -> None:
    """The truth at the first sample."""
    b = bench(tmp_path)
    b.simulate()
    site = read_site(b.site)
    assert (site.topic, site.kind, site.axes) == ("/imu/increments", "increment", "FRD")
    assert site.initial is not None
    truth = by_mcap_ros2_support(b.log, "/truth/solution", SOLUTION_FLOATS, [])
    assert site.initial.time_ns == truth["stamp_ns"][0]
    state = site.initial.state
    assert math.degrees(state.lat) == pytest.approx(truth["latitude_deg"][0], abs=1e-13)
    assert state.h == truth["height_m"][0]
    assert state.v_eb_n[0] == truth["v_north_m_s"][0]
    assert state.q_nb[3] == pytest.approx(truth["orientation.z"][0], abs=1e-15)


@pytest.mark.parametrize(
    ("imu", "rest", "aligned"),
    [
        ('grade = "navigation"', HERE + LONG_STILL + MOVE, True),
        ('grade = "navigation"', HERE + STILL + MOVE, False),  # too short
        ('grade = "consumer"', HERE + LONG_STILL + MOVE, False),  # its gyros cannot find north
        ("", HERE + LONG_STILL + MOVE, False),  # nothing to find out
    ],
)
def test_alignment_where_it_makes_sense(tmp_path: Path, imu: str, rest: str, aligned: bool) -> None:
    b = bench(tmp_path, imu, rest)
    assert b.simulate().code == 0
    site = read_site(b.site)
    assert (site.window is not None) is aligned
    run = navgrade("run", b.log, "-c", b.site, "-o", b.nav)
    assert (run.code, run.err) == (0, ""), run
    if site.window is not None:
        assert (site.window.start, site.window.duration) == (0.0, 44.0)
        assert site.errors.gyro_bias == pytest.approx(math.radians(0.0035) / 3600.0, rel=1e-5)
        assert site.errors.vrw == pytest.approx(8.0 * 9.80665e-6, rel=1e-5)


def test_refusals(tmp_path: Path) -> None:
    b = bench(tmp_path)
    b.log.write_bytes(b"precious")
    one_sentence(b.simulate(), "log.mcap exists")
    b.log.unlink()
    b.site.write_text("precious")
    one_sentence(b.simulate(), "site.toml exists")
    assert not b.log.exists()
    assert b.simulate("--overwrite").code == 0
    assert "[initial]" in b.site.read_text()
    one_sentence(
        navgrade("simulate", b.scenario, "-o", b.log, "--site", b.scenario, "--overwrite"),
        "is the scenario",
    )
    one_sentence(navgrade("simulate", tmp_path / "no.toml", "-o", tmp_path / "x.mcap"), "no such")
    one_sentence(navgrade("simulate", b.scenario, "-o", tmp_path / "x.bag"), "end in .mcap")
    one_sentence(navgrade("simulate", b.scenario, "-o", tmp_path / "no" / "x.mcap"), "folder")
    assert not list(tmp_path.glob("*.part"))


def test_without_a_site_file(tmp_path: Path) -> None:
    b = bench(tmp_path)
    made = navgrade("simulate", b.scenario, "-o", b.log)
    assert made.code == 0
    assert "site file" not in made.out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["log.mcap", "scenario.toml"]
