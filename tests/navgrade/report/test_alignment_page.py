"""The page of an alignment: every number from the object, nothing from outside taken for markup."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from navgrade.alignment import AlignedWindow, Trace
from navgrade.errors import ConfigError
from navgrade.report import write_alignment_page
from navgrade.report.words import angle_unit, number, readable_angle, signed
from tests.navgrade.report.alignments import (
    AZIMUTH,
    CROSS,
    DEG,
    GYRO,
    HEADING,
    LAT,
    LOG,
    NOISE,
    PITCH,
    ROLL,
    SITE,
    TILT,
    aligned,
    alignment,
    bare,
    still,
    stretch,
)
from tests.navgrade.report.test_page import Page

SIZES = {"″": DEG / 3600.0, "°": DEG}
ROUNDED = 6e-3  # relative: three significant digits
DRAWN = 6e-5  # relative: five

Written = tuple[Page, dict[str, Any]]


def page_of(found: AlignedWindow, folder: Path, lat: float = LAT) -> Written:
    path = folder / "alignment.html"
    write_alignment_page(found, path, log_name=LOG, site_name=SITE, lat=lat)
    page = Page(path.read_text("utf-8"))
    return page, json.loads(page.scripts[0])


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return page_of(aligned(), tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def empty(tmp_path_factory: pytest.TempPathFactory) -> Written:
    return page_of(bare(), tmp_path_factory.mktemp("bare"), -LAT)


def value(cell: str) -> float:
    """The first number of a cell; of an angle, rad."""
    match = re.match(r"([−+]?)([\d.,]+)([°″](?!/))?", cell)
    assert match, cell
    sign, digits, unit = match.groups()
    size = float(digits.replace(",", "")) * SIZES.get(unit or "", 1.0)
    return -size if sign == "−" else size


def headings(page: Page) -> list[str]:
    return re.findall("<h2>(.*?)</h2>", page.source)


def traces(figure: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {trace["meta"]: trace for trace in figure["data"]}


def shades(figure: dict[str, Any]) -> list[tuple[float, float, str]]:
    return [(s["x0"], s["x1"], s["name"]) for s in figure["layout"]["shapes"]]


def test_the_page_is_whole_and_asks_for_nothing(written: Written) -> None:
    page, _ = written
    assert not page.open
    for tag, attributes in page.tags:
        for name in ("src", "href", "srcset", "data", "action", "poster"):
            assert attributes.get(name) in (None, "data:,"), f"{tag} {name}"
    (policy,) = [a["content"] for t, a in page.tags if "http-equiv" in a]
    assert (policy or "").startswith("default-src 'none'")
    assert len(page.scripts) == 3


def test_names_and_words_from_outside_are_text(written: Written) -> None:
    page, _ = written
    r = alignment()
    text = page.text.replace("\xa0", " ")
    for words in (LOG, SITE, r.verdict[1:], r.reason, *r.warnings, *r.unobservable):
        assert words in text
    assert "Good for navigation-grade free inertial" in text
    assert "<script>alert" not in page.source
    assert [t for t, _ in page.tags].count("b") == 1  # the method
    assert "i" not in {t for t, _ in page.tags}


def test_no_word_of_the_result_is_markup(tmp_path: Path) -> None:
    odd = "<u>&amp;</u></script>"
    r = alignment()
    budget = tuple(replace(line, source=odd) for line in r.budget)
    texts = {"method": odd, "reason": odd, "verdict": odd}
    result = replace(r, budget=budget, warnings=(odd,), unobservable=(odd,), **texts)  # type: ignore[arg-type]
    page, figures = page_of(aligned(result=result), tmp_path)
    assert "u" not in {tag for tag, _ in page.tags}
    assert len(page.scripts) == 3
    assert "<u>" not in page.source
    assert page.text.count(odd) == 11  # the method stands thrice, four sources once
    assert "&lt;u&gt;" in figures["budget"]["layout"]["yaxis"]["ticktext"][0]
    assert "<td>&lt; 1 %</td>" in page.source


def test_the_attitude_reads_to_its_sigma(written: Written) -> None:
    page, _ = written
    for name, angle, sigma in (
        ("roll", ROLL, TILT),
        ("pitch", PITCH, TILT),
        ("heading", HEADING, AZIMUTH),
    ):
        _, shown, one, mrad = page.row(0, name)
        assert value(shown) == pytest.approx(angle * DEG, abs=0.06 * sigma)
        assert value(one) == pytest.approx(sigma, rel=ROUNDED)
        assert value(mrad) == pytest.approx(1e3 * sigma, rel=ROUNDED)
    assert page.row(0, "pitch")[1] == "−2.67443°"
    assert page.row(0, "roll")[2] == "2.15″"  # 10.4 µrad
    assert value(page.row(0, "tilt")[2]) == pytest.approx(TILT, rel=ROUNDED)
    assert value(page.row(0, "azimuth")[2]) == pytest.approx(AZIMUTH, rel=ROUNDED)
    q = [f"{x:.9f}".replace("-", "−") for x in alignment().q_nb]
    assert "\u2002".join(q) in page.text


def test_the_budget_is_a_table_and_bars(written: Written) -> None:
    page, figures = written
    assert page.tables[1][0] == ["1σ", "tilt,\xa0″", "share", "azimuth,\xa0°", "share"]
    rows = page.tables[1][1:]
    assert [row[0] for row in rows] == [*(line.source for line in alignment().budget), "total"]
    azimuths = [CROSS, 0.0, GYRO, NOISE, AZIMUTH]
    found = [value(row[3]) * DEG for row in rows]
    np.testing.assert_allclose(found, azimuths, rtol=ROUNDED)
    # the tilt's contributions add as squares to the total
    parts = [value(row[1]) for row in rows]
    assert np.linalg.norm(parts[:-1]) == pytest.approx(parts[-1], rel=ROUNDED)
    assert parts[-1] * SIZES["″"] == pytest.approx(TILT, rel=ROUNDED)
    # 1.02² of 1.0235² is 99 %, 0.084² is 1 %
    assert [row[4] for row in rows] == ["< 1 %", "0 %", "99 %", "1 %", "100 %"]
    bars = traces(figures["budget"])
    np.testing.assert_allclose(bars["azimuth"]["x"][2:], azimuths[2:], rtol=DRAWN)
    assert bars["azimuth"]["x"][1] is None
    assert bars["azimuth"]["text"][2] == "0.0584°"
    assert bars["tilt"]["x"][4] == pytest.approx(TILT, rel=DRAWN)
    labels = figures["budget"]["layout"]["yaxis"]["ticktext"]
    assert labels[:3] == ["accelerometer<br>bias", "accelerometer<br>noise", "gyro bias"]


def test_the_quality_figures(written: Written) -> None:
    page, _ = written
    found = {row[0]: row[1:] for row in page.tables[2][1:]}
    assert found["|f| − g"][0] == "−0.438 mm/s²"
    assert found["|ω| − Ω"][0] == "+0.0113 °/h"
    assert found["rate about down"][0] == "−0.00710 °/h"
    assert found["rate along north"][0] == "+0.00420 °/h"
    assert found["implied latitude"] == ["51.0662°", "the site's is 51.0800°, off by −0.0138°"]
    for name, x in zip(("north", "east", "down"), alignment().scatter, strict=True):
        assert value(found[f"scatter of tenths, {name}"][0]) == pytest.approx(x, rel=ROUNDED)
    assert found["stillness, force"][0] == "0.170 mm/s²"
    assert found["stillness, rate"][0] == "0.0000800 °/s"
    assert found["eigenvalue gap"][0] == "0.412"
    assert found["mean NIS"] == ["3.05", "95\xa0% between 2.80 and 3.20: consistent"]
    assert "heading by gyros" not in found  # they gave the heading


def test_a_heading_given_stands_beside_that_of_the_gyros(tmp_path: Path) -> None:
    result = replace(alignment(), gyro_heading=63.1 * DEG, gyro_heading_sigma=1.4 * DEG)
    page, _ = page_of(aligned(result=result), tmp_path)
    assert page.row(2, "heading by gyros")[1:] == ["63.10°", "1σ 1.40°"]


def test_a_filter_that_is_not_consistent_says_so(tmp_path: Path) -> None:
    innovations = alignment().innovations
    assert innovations is not None
    result = replace(alignment(), innovations=replace(innovations, consistent=False))
    page, _ = page_of(aligned(result=result), tmp_path)
    assert page.row(2, "mean NIS")[2].endswith("not consistent with the model")


def test_convergence_stands_beside_theory(written: Written) -> None:
    page, figures = written
    c = alignment().convergence
    assert c is not None
    drawn = traces(figures["convergence"])
    for axis, name in enumerate(("north", "east", "down")):
        y = np.array(drawn[name]["y"], float)
        np.testing.assert_allclose(y[:-1], np.abs(c.off[:-1, axis]), rtol=DRAWN)
        assert np.isnan(y[-1])  # the final one is off by rounding alone
    np.testing.assert_allclose(drawn["tilt"]["y"], c.tilt_sigma, rtol=DRAWN)
    np.testing.assert_allclose(drawn["azimuth"]["y"], c.azimuth_sigma, rtol=DRAWN)
    np.testing.assert_allclose(drawn["down"]["x"], c.t, rtol=DRAWN)
    low, high = figures["convergence"]["layout"]["yaxis"]["range"]  # log rad
    assert np.log10(np.abs(c.off[:-1]).min()) - 1.0 < low < high < np.log10(0.1)
    for side in ("xaxis", "yaxis"):
        assert figures["convergence"]["layout"][side]["type"] == "log"
    assert "azimuth, theory 1σ" in page.text


def test_the_timeline_shades_what_is_kept(written: Written) -> None:
    page, figures = written
    assert shades(figures["timeline"]) == [
        (5.0, 92.0, "used"),
        (95.5, 184.0, "used"),
        (188.0, 305.0, "used"),
        (92.0, 95.5, "cut out"),
        (184.0, 188.0, "cut out"),
        (412.0, 480.0, "still"),
        (640.0, 700.0, "swaying"),
        (702.0, 838.5, "swaying"),
        (700.0, 702.0, "cut out"),
    ]
    drawn = traces(figures["timeline"])
    trace = aligned().trace
    for name, values in (("rate", trace.rate / DEG), ("force", trace.force)):
        y = np.array(drawn[name]["y"], float)
        assert len(y) < 2000 < len(values)
        # thinned, the highest and the lowest stay: four digits are drawn
        assert y.max() == pytest.approx(values.max(), rel=6e-4)
        assert y.min() == pytest.approx(values.min(), rel=6e-4)
    assert [note["text"] for note in figures["timeline"]["layout"]["annotations"]] == list("123")
    assert page.row(3, "1, used")[1:] == [
        *("5.0", "305.0", "292.5", "7.5", "still"),
        *("0.170", "0.0000800"),
        # root mean square of 1.5, 2, 2.5 m°/√h and of 3, 5, 7 µg/√Hz
        *("0.00204", "5.26"),
    ]
    assert page.row(3, "3")[1:6] == ["640.0", "838.5", "196.5", "2.0", "swaying"]


def test_a_gap_of_the_log_breaks_the_line(tmp_path: Path) -> None:
    t = np.concatenate([np.arange(1.0, 21.0), np.arange(60.0, 81.0)])
    trace = Trace(t, np.full(41, 1e-6), np.full(41, 1e-3), np.ones(41, bool))
    found = aligned(trace=trace, still=still(), chosen=None, start=0.0, duration=80.0)
    page, figures = page_of(found, tmp_path)
    rate = traces(figures["timeline"])["rate"]
    assert rate["x"][19:22] == [20.0, None, 60.0]
    assert rate["y"][20] is None
    assert shades(figures["timeline"]) == [(0.0, 80.0, "used")]
    assert not any("1, used" in row for table in page.tables for row in table)


def test_a_long_log_has_no_more_to_draw(tmp_path: Path) -> None:
    n = 120_000  # 8 h
    rate = np.full(n, 1e-6)
    rate[77_777] = 0.5
    trace = Trace(0.25 * np.arange(1.0, n + 1), rate, 1e3 * rate, np.ones(n, bool))
    found = aligned(trace=trace, still=still(stretch((0.25, 30_000.0))))
    _, figures = page_of(found, tmp_path)
    drawn = traces(figures["timeline"])["rate"]
    assert len(drawn["x"]) < 2000
    peak = int(np.argmax(drawn["y"]))
    assert drawn["x"][peak] == pytest.approx(0.25 * 77_778)
    assert drawn["y"][peak] == pytest.approx(0.5 / DEG, rel=6e-4)


def test_biases_and_what_stays_hidden(written: Written) -> None:
    page, _ = written
    assert page.tables[4] == [
        ["", "gyro bias, °/h", "1σ", "accelerometer bias, µg", "1σ"],
        ["x, forward", "−0.251", "0.0511", "−43.8", "5.20"],
        ["y, right", "—", "—", "—", "—"],
        ["z, down", "+0.0123", "0.00310", "—", "—"],
    ]


def test_innovations_are_drawn_with_their_bounds(written: Written) -> None:
    page, figures = written
    found = alignment().innovations
    assert found is not None
    np.testing.assert_allclose(traces(figures["innovations"])["nis"]["y"], found.nis, rtol=DRAWN)
    band, mean = figures["innovations"]["layout"]["shapes"]
    assert (band["y0"], band["y1"]) == (2.8, 3.2)
    assert mean["y0"] == mean["y1"] == pytest.approx(3.05)
    assert "it is 3.05" in page.text


def test_where_it_comes_from(written: Written) -> None:
    page, _ = written
    text = page.text
    assert "5.0 s to 305.0 s, 288.4 s used (4 min 48 s)" in text
    assert "51.080000° N, 114.133700° W, 1118.5 m above the ellipsoid" in text
    assert "navgrade " in text


def test_what_is_not_known_is_left_out(empty: Written) -> None:
    page, figures = empty
    assert headings(page) == ["Attitude", "Quality", "Where this comes from"]
    assert figures == {}
    assert page.row(0, "heading")[1:] == ["unknown", "180°", "3,140"]
    assert value(page.row(0, "roll")[1]) == pytest.approx(-178.25 * DEG)  # upside down
    assert page.row(1, "implied latitude")[1:] == ["unknown", "the site's is −51.0800°"]
    assert [row[0] for row in page.tables[1][1:]] == [
        *("|f| − g", "implied latitude", "stillness, force", "stillness, rate"),
    ]
    assert "nan" not in page.text.lower()
    assert "Quaternion" not in page.text
    assert "Warnings" not in page.text
    assert "latitude −51.080000°" in page.text


@pytest.mark.parametrize("found", [aligned(), bare()], ids=["full", "bare"])
def test_plotly_knows_every_property(found: AlignedWindow, tmp_path: Path) -> None:
    _, figures = page_of(found, tmp_path)
    for figure in figures.values():
        go.Figure(figure["data"], figure["layout"])


def test_sigmas_of_nothing_and_of_no_bound(tmp_path: Path) -> None:
    """Exact data leave no sigma, a pole no azimuth."""
    r = alignment()
    budget = tuple(replace(line, tilt=0.0, azimuth=np.inf) for line in r.budget)
    result = replace(r, tilt_sigma=0.0, roll_sigma=0.0, azimuth_sigma=np.inf, budget=budget)
    page, figures = page_of(aligned(result=result), tmp_path)
    assert "budget" not in figures
    assert page.row(0, "roll")[1:] == ["1.5854°", "0", "0"]
    assert page.row(1, "gyro bias")[1:] == ["0", "—", "—", "—"]


def test_a_failure_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "alignment.html"
    path.write_text("before")
    names: dict[str, Any] = {"log_name": LOG, "site_name": SITE, "lat": LAT}
    with pytest.raises(ConfigError, match="exists"):
        write_alignment_page(aligned(), path, **names)
    broken = aligned(result=replace(alignment(), verdict=None))  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        write_alignment_page(broken, path, overwrite=True, **names)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]
    write_alignment_page(aligned(), path, overwrite=True, **names)
    assert path.read_text("utf-8").startswith("<!DOCTYPE html>")


@pytest.mark.parametrize(
    ("angle", "text"),
    [
        (10.4e-6, "2.15″"),
        (0.0099 * DEG, "35.6″"),
        (0.01 * DEG, "0.0100°"),
        (np.pi, "180°"),
        (0.0, "0"),
        (np.nan, "—"),
    ],
)
def test_angles_read_in_their_unit(angle: float, text: str) -> None:
    assert readable_angle(angle) == text
    assert angle_unit(1e-5)[1] == "″"


def test_signs() -> None:
    assert [signed(x) for x in (0.0, 0.0113, -1234.0, np.nan)] == ["0", "+0.0113", "−1,230", "—"]
    assert number(-0.5, 2) == "−0.50"
