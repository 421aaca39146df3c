"""What the terminal tells of an alignment: formatting alone, of made-up ones."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from navgrade.alignment import AlignedWindow
from navgrade.cli.show import show_alignment
from tests.navgrade.report.alignments import DEG, aligned, alignment, bare, still, stretch

SCREEN = 40  # lines


def printed(found: AlignedWindow, capsys: pytest.CaptureFixture[str]) -> list[str]:
    show_alignment(found)
    return capsys.readouterr().out.splitlines()


def rows(lines: list[str]) -> dict[str, list[str]]:
    """Texts by name."""
    found: dict[str, list[str]] = {}
    for line in lines:
        found.setdefault(line[:22].strip(), []).append(line[22:].strip())
    return found


def test_everything_is_told_on_one_screen(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(aligned(), capsys)
    assert len(lines) < SCREEN
    assert lines[1] == "Alignment  triad, 5 s to 305 s"
    r, found = alignment(), rows(lines)
    assert found["why"] == [r.reason]
    assert found["verdict"] == [r.verdict]
    # degrees of the factory, sigmas of 10.4 and 1023.5 µrad
    assert found["roll"] == ["1.5854°   1σ 0.0006°"]
    assert found["pitch"] == ["-2.6744°   1σ 0.0006°"]
    assert found["heading"] == ["64.7261°   1σ 0.0586°"]
    assert found["tilt and azimuth"] == ["1σ 0.0006°, 0.0586°"]
    assert found["accelerometer bias"] == ["2.14″, 2.66″"]
    assert found["gyro bias"] == ["0, 0.0584°"]
    assert found["gyro noise"] == ["0, 17.3″"]
    assert found["q_nb"] == ["  ".join(f"{x:.9f}" for x in r.q_nb)]
    assert found["|f| - g"] == ["-0.4378 mm/s²"]
    assert found["|ω| - Ω"] == ["+0.0113 °/h"]
    assert found["implied latitude"] == ["51.0662°"]
    assert found["scatter of tenths"] == ["N 0.0001°  E 0.0001°  D 0.1604°"]
    assert found["stillness, 1 s means"] == ["0.00017 m/s²  0.00008 °/s"]
    assert found["eigenvalue gap"] == ["0.412"]
    assert found["mean NIS"] == ["3.050, 95 % 2.800 to 3.200: consistent"]
    assert found["estimated gyro bias"] == ["x -0.2512 ± 0.051  y unknown  z +0.0123 ± 0.0031 °/h"]
    assert found["estimated accel. bias"] == ["x -43.8 ± 5.2  y unknown  z unknown µg"]
    assert found["unobservable"] == list(r.unobservable)
    assert found["still stretch"] == [
        "5.0 s to 305.0 s, kept 292.5 s, cut 7.5 s, used",
        "412.0 s to 480.0 s, kept 68.0 s, cut 0.0 s",
    ]
    assert found["swaying stretch"] == ["640.0 s to 838.5 s, kept 196.5 s, cut 2.0 s"]
    assert lines[-2:] == [f"warning: {text}" for text in r.warnings]
    assert "heading by gyros" not in found


def test_a_level_alone(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(bare(), capsys)
    found = rows(lines)
    assert found["roll"] == ["-178.2500°   1σ 0.0006°"]
    assert found["heading"] == ["unknown   1σ 180.0000°"]
    assert found["implied latitude"] == ["unknown"]
    assert not {
        "q_nb",
        "|ω| - Ω",
        "scatter of tenths",
        "gyro bias",
        "estimated gyro bias",
        "still stretch",
    } & set(found)
    assert not re.search(r"\bnan\b", "\n".join(lines))


def test_a_heading_given_stands_beside_that_of_the_gyros(
    capsys: pytest.CaptureFixture[str],
) -> None:
    result = replace(alignment(), gyro_heading=63.1 * DEG, gyro_heading_sigma=1.4 * DEG)
    found = rows(printed(aligned(result=result), capsys))
    assert found["heading by gyros"] == ["63.1000°   1σ 1.4000°"]


def test_of_many_stretches_the_longest_and_the_one_used(
    capsys: pytest.CaptureFixture[str],
) -> None:
    lengths = np.array([11.0, 30.0, 12.0, 50.0, 13.0, 40.0, 14.0, 60.0, 10.0])
    stretches = [stretch((100.0 * i, 100.0 * i + x)) for i, x in enumerate(lengths)]
    found = rows(printed(aligned(still=still(*stretches), chosen=0), capsys))
    shown = [text.split(" s", 1)[0] for text in found["still stretch"]]
    assert shown == ["0.0", "100.0", "300.0", "500.0", "600.0", "700.0"]
    assert [text.endswith(", used") for text in found["still stretch"]] == [True] + 5 * [False]
    assert "and 3 shorter" in found[""]
