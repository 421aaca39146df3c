"""The main job on the sample log, as a newcomer runs it, against the sample's exact truth."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from navgrade.cli import main
from tests.sample import compare

DATA = Path(__file__).resolve().parents[2] / "data"


def test_sample_run(tmp_path: Path) -> None:
    """Aligned within its sigmas; the drive ends where biases within their sigmas allow."""
    out = tmp_path / "nav.mcap"
    with pytest.raises(SystemExit) as end:
        main(["run", str(DATA / "sample.mcap"), "-c", str(DATA / "sample.toml"), "-o", str(out)])
    assert end.value.code == 0
    with out.open("rb") as stream:
        records = {r.name: r.metadata for r in make_reader(stream).iter_metadata()}
    report = json.loads(records["navgrade.provenance"]["alignment"])
    c = compare(out, DATA / "sample_truth.csv")
    assert len(c.t) > 1700  # 10 Hz truth over the 180 s after alignment
    # 3 sigma of what the alignment itself predicts
    assert abs(c.roll[0]) < 3 * report["roll_sigma_deg"]
    assert abs(c.pitch[0]) < 3 * report["pitch_sigma_deg"]
    assert abs(c.heading[0]) < 3 * report["heading_sigma_deg"]
    horizontal = np.hypot(c.north, c.east)
    # m: a heading error of 0.074 deg over 850 m of net path is 1.1 m, an uncorrected 50 µg of
    # tilt-free accelerometer error is 8 m in 180 s, of which leveling hides all but the turns'
    # share; vertical has the full 46 µg, 7.3 m
    assert horizontal[-1] < 10.0
    assert 5.0 < abs(c.up[-1]) < 10.0


def test_readme_names_the_sample_as_it_is() -> None:
    """data/README.md gives the checksums of the files that are there."""
    text = (DATA / "README.md").read_text()
    for name in ("sample.mcap", "sample.toml", "sample_truth.csv"):
        assert hashlib.sha256((DATA / name).read_bytes()).hexdigest() in text, name
