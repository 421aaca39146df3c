"""A comparison as CSV and as plain types."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from navgrade.errors import ConfigError
from navgrade.report import as_dict, write_tables
from tests.navgrade.report.comparisons import ENDED, EPOCHS, LAWS, comparison

VECTORS = {
    "position_error": ("north_m", "east_m", "down_m"),
    "velocity_error": ("v_north_m_s", "v_east_m_s", "v_down_m_s"),
    "attitude_error": ("phi_north_rad", "phi_east_rad", "phi_down_rad"),
}


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def test_errors_come_back_to_the_bit(tmp_path: Path) -> None:
    c = comparison(truth=True)
    paths = write_tables(c, tmp_path / "new")
    assert paths == (tmp_path / "new" / "errors.csv", tmp_path / "new" / "growth.csv")
    found = rows(paths[0])
    n = len(c.t)
    assert len(found) == n * len(c.variants)
    for i, variant in enumerate(c.variants):
        mine = found[i * n : (i + 1) * n]
        assert {(row["variant"], row["group"]) for row in mine} == {(variant.name, variant.group)}
        assert np.array_equal([float(row["t_s"]) for row in mine], c.t)
        for name, columns in VECTORS.items():
            values = [[float(row[column]) for column in columns] for row in mine]
            assert np.array_equal(values, getattr(variant, name), equal_nan=True)
        north, east = variant.position_error[:, 0], variant.position_error[:, 1]
        horizontal = np.array([float(row["horizontal_m"]) for row in mine])
        # a rounding of the last bit, m
        np.testing.assert_allclose(horizontal, np.sqrt(north**2 + east**2), rtol=1e-15)


def test_laws(tmp_path: Path) -> None:
    _, path = write_tables(comparison(), tmp_path)
    found = rows(path)
    assert [row["variant"] for row in found] == [law[0] for law in LAWS]
    euler = found[1]
    assert float(euler["coefficient_m"]) == 8.43e-5
    assert float(euler["power"]) == 3.0
    assert euler["formula"] == "g Ω cos L t³ / 6"
    assert float(euler["predicted_at_60_s_m"]) == pytest.approx(18.2088)
    assert found[0]["predicted_at_3600_s_m"] == "nan"


def test_nothing_is_overwritten_unasked(tmp_path: Path) -> None:
    (tmp_path / "growth.csv").write_text("mine")
    with pytest.raises(ConfigError, match=r"growth\.csv exists"):
        write_tables(comparison(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["growth.csv"]
    with pytest.raises(ConfigError, match="is a file"):
        write_tables(comparison(), tmp_path / "growth.csv")
    with pytest.raises(ConfigError, match="does not exist"):
        write_tables(comparison(), tmp_path / "a" / "b")
    write_tables(comparison(), tmp_path, overwrite=True)
    assert len(rows(tmp_path / "growth.csv")) == len(LAWS)


def test_plain_types_for_json() -> None:
    c = comparison()
    told = json.loads(json.dumps(as_dict(c), allow_nan=False))
    assert told["epochs_s"] == list(EPOCHS)
    assert told["lat_deg"] == pytest.approx(44.238071, abs=1e-6)
    assert told["start_ns"] == c.start_ns
    assert told["imu_error_m"][0] == 0.002
    assert [variant["name"] for variant in told["variants"]] == [law[0] for law in LAWS]
    engine, euler, _, rk4 = told["variants"][:4]
    assert engine["growth"] == {
        "axis": "horizontal",
        "coefficient_m": None,
        "power": None,
        "formula": "",
        "predicted_m": [None] * 5,
    }
    assert engine["ended_s"] is None
    assert euler["horizontal_m"][2] == pytest.approx(18.2088)
    assert rk4["horizontal_m"][3:] == [None, None]
    assert rk4["position_error_ned_m"][4] == [None] * 3
    assert ENDED - 15.0 < rk4["ended_s"] <= ENDED  # s: the rows are 12 s apart
    at_a_minute = c.variants[1].attitude_error[np.flatnonzero(c.t == 60.0)[0]]
    assert euler["attitude_error_ned_rad"][2] == list(at_a_minute)
    assert as_dict(comparison(imu=False))["imu_error_m"] is None
