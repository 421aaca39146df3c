"""docs/scenarios.md says what a scenario file may hold, and its examples read."""

from __future__ import annotations

import re
from itertools import chain
from pathlib import Path

import pytest

from benchmarks.scenarios import errors, filled, grades
from navgrade.simulate.scenario import KEYS, read_scenario
from tests.navgrade.simulate.scenarios import NAMES, STILL

ROOT = Path(__file__).resolve().parents[3]
PAGE = (ROOT / "docs" / "scenarios.md").read_text()


def test_tables_are_those_of_the_code() -> None:
    """`python -m benchmarks scenarios --write` makes them."""
    assert filled(PAGE, {"errors": errors(), "grades": grades()}) == PAGE


def test_every_key_is_named() -> None:
    for key in chain.from_iterable(keys for table, keys in KEYS.items() if table != "imu.errors"):
        assert re.search(rf"[`.\[]{key}[`\]]|^{key} =", PAGE, re.MULTILINE), key
    for table in KEYS:
        for kind in ("segment", "vibration"):
            if table.startswith(f"{kind}."):
                assert f"| `{table.removeprefix(f'{kind}.')}` |" in PAGE


def test_the_example_reads(tmp_path: Path) -> None:
    (example,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)
    path = tmp_path / "scenario.toml"
    path.write_text(example + STILL.replace("4.0", "120.0"))
    found = read_scenario(path)
    assert found.imu.grade == "tactical"
    assert found.imu.dropped_spans == ((100.0, 100.5),)


@pytest.mark.parametrize("name", NAMES)
def test_pictures(name: str) -> None:
    assert f"(scenarios/{name}.png)" in PAGE
    assert f"| {name} | " in PAGE, "it closes"
    assert 5_000 < (ROOT / "docs" / "scenarios" / f"{name}.png").stat().st_size < 60_000
