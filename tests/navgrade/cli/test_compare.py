"""``navgrade compare`` as a user calls it."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from tests.navgrade.cli.calling import Outcome, navgrade, one_sentence
from tests.navgrade.compare.test_study import EPOCH_NS, make
from tests.oracles.truth import turning_vehicle

MOTION = turning_vehicle()
HEADER = "unix_s,latitude_deg,longitude_deg,height_m,v_north_m_s,v_east_m_s,v_down_m_s"


class Desk:
    """A log of eleven seconds, its site file, and room for a page."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.log, self.site = make(folder, MOTION, 11.0)
        self.page = folder / "report.html"

    def compare(self, *options: object) -> Outcome:
        return navgrade("compare", self.log, "-c", self.site, "-o", self.page, *options)

    def refused(self, *facts: str, options: tuple[object, ...]) -> None:
        one_sentence(self.compare(*options), *facts)
        assert not self.page.exists()
        assert not list(self.folder.glob("*.part"))

    def truth(self, header: str = HEADER) -> Path:
        """The true motion ten times a second, to 1e-12 degrees."""
        t = np.arange(1, 110) * 0.1
        s = MOTION.state(t)
        path = self.folder / "truth.csv"
        lines = [header]
        for k, seconds in enumerate(t):
            stamp = f"{(EPOCH_NS + round(seconds * 1e9)) // 10**9}.{round(seconds * 10) % 10}"
            place = np.degrees(s.lat[k]), np.degrees(s.lon[k])
            lines.append(
                f"{stamp},{place[0]:.13f},{place[1]:.13f},{s.h[k]:.6f},"
                + ",".join(f"{x:.9f}" for x in s.v_eb_n[k])
            )
        path.write_text("\n".join(lines) + "\n")
        return path


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)


def test_a_page_pictures_and_tables(desk: Desk) -> None:
    tables, pictures = desk.folder / "tables", desk.folder / "pictures"
    outcome = desk.compare("--truth", desk.truth(), "--csv", tables, "--png", pictures)
    assert outcome.code == 0, outcome
    assert outcome.err == ""
    assert "against truth truth.csv" in outcome.out
    assert desk.page.read_text().startswith("<!DOCTYPE html>")
    assert sorted(p.name for p in pictures.iterdir()) == ["growth.png", "terms.png", "track.png"]
    with (tables / "errors.csv").open() as stream:
        rows = [row for row in csv.DictReader(stream) if row["variant"] == "engine"]
    # m: exact increments, a truth to 1e-12 degrees
    assert max(float(row["horizontal_m"]) for row in rows) < 1e-4


def test_json_alone(desk: Desk) -> None:
    outcome = desk.compare("--json", "--duration", 5)
    assert outcome.code == 0, outcome
    found = json.loads(outcome.out)
    assert found["epochs_s"] == pytest.approx([1.0, 5.0], abs=0.011)
    names = [variant["name"] for variant in found["variants"]]
    assert names[0] == "engine" and "flat-rk4" in names and "without-coriolis" in names
    assert found["verdict"][0].startswith("Nothing says how good this IMU is")


def test_a_truth_with_a_zero_of_its_own(desk: Desk) -> None:
    """The epoch makes Unix times of seconds."""
    truth = desk.truth(HEADER.replace("unix_s", "t_s"))
    text = truth.read_text()
    for second in range(12):
        text = text.replace(f"\n{1767225600 + second}.", f"\n{second}.")
    truth.write_text(text)
    desk.refused("has no Unix times", "--truth-epoch", options=("--truth", truth))
    chosen = "--truth", truth, "--truth-epoch"
    desk.refused("'noon' is not a time", options=(*chosen, "noon"))
    outcome = desk.compare(*chosen, "2026-01-01T00:00:00Z", "--json")
    assert outcome.code == 0, outcome
    engine = json.loads(outcome.out)["variants"][0]
    assert max(engine["horizontal_m"]) < 1e-4  # m


def test_damage_is_told(desk: Desk) -> None:
    whole = desk.log.read_bytes()
    desk.log.write_bytes(whole[:-30])  # the end of the summary
    outcome = desk.compare("--duration", 2)
    assert outcome.code == 0, outcome
    assert "warning: the file is damaged: " in outcome.out
    assert "the file is damaged" in desk.page.read_text()


def test_what_is_there_is_kept(desk: Desk) -> None:
    desk.page.write_text("mine")
    one_sentence(desk.compare(), "report.html", "exists")
    assert desk.page.read_text() == "mine"
    assert desk.compare("--overwrite", "--duration", 2).code == 0
    assert desk.page.read_text() != "mine"


def test_bad_input(desk: Desk) -> None:
    desk.refused("--truth /trtuh", "neither a file nor a topic", options=("--truth", "/trtuh"))
    imu = "/imu/increments"
    desk.refused("holds no position this program reads", options=("--truth", imu))
    bare = desk.truth(HEADER.replace("latitude_deg", "phi"))
    desk.refused("no column latitude_deg", "unix_s, phi, longitude_deg", options=("--truth", bare))
    desk.refused("duration must be positive", options=("--duration", "-3"))
    desk.refused("'centred-8' is not one of", options=("--reconstruction", "centred-8"))
    desk.refused("one row for each sample", options=("--reconstruction", "samples-4"))
    late = desk.truth()
    late.write_text(late.read_text().replace("17672256", "17672999"))
    desk.refused("nothing between the start of navigation", options=("--truth", late))
    broken = desk.truth()
    broken.write_text(broken.read_text().replace(",", ";"))
    desk.refused("no column latitude_deg", options=("--truth", broken))
    assert navgrade("compare", desk.folder / "no.mcap", "-c", desk.site, "-o", "x").code == 2
