"""The page: all data, nothing of it taken for markup, no resource outside the file."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import plotly.graph_objects as go
import pytest

from navgrade.compare.result import Comparison
from navgrade.errors import ConfigError
from navgrade.report import write_page
from tests.navgrade.report.comparisons import ENDED, EPOCHS, LAWS, LOG, TOPIC, comparison, drive

VOID = {"meta", "link", "input", "line", "br"}
ROUNDED = 2e-4  # relative: five digits of time to the third power, and of the error


@dataclass
class Page(HTMLParser):
    """Tags, attributes and text of a page; cells of each table; contents of each script."""

    source: str
    open: list[str] = field(default_factory=list)
    tags: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    text: str = ""
    scripts: list[str] = field(default_factory=list)
    tables: list[list[list[str]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self.feed(self.source)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "script":
            self.scripts.append("")
        elif tag == "table":
            self.tables.append([])
        elif tag == "tr":
            self.tables[-1].append([])
        elif tag in ("td", "th"):
            self.tables[-1][-1].append("")

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if "script" in self.open:
            self.scripts[-1] += data
        elif "style" not in self.open:
            self.text += data
        if {"td", "th"} & set(self.open):
            self.tables[-1][-1][-1] += data

    def row(self, table: int, label: str) -> list[str]:
        (found,) = (row for row in self.tables[table] if row[0].startswith(label))
        return found


def page_of(c: Comparison, folder: Path) -> tuple[Page, dict[str, Any]]:
    path = folder / "report.html"
    write_page(c, path)
    page = Page(path.read_text("utf-8"))
    return page, json.loads(page.scripts[0])


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Page, dict[str, Any]]:
    return page_of(comparison(), tmp_path_factory.mktemp("page"))


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> tuple[Page, dict[str, Any]]:
    """Against truth."""
    return page_of(comparison(truth=True), tmp_path_factory.mktemp("page"))


def lines(view: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The curve of each variant."""
    return {t["meta"]: t for t in view["data"] if t.get("mode", "").startswith("lines")}


def circles(view: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """What was predicted of each variant."""
    marked = [t for t in view["data"] if t.get("marker", {}).get("symbol") == "circle-open"]
    return {t["meta"]: t for t in marked}


def bars(view: dict[str, Any]) -> list[tuple[str, float | None]]:
    """Labels, line breaks and hard spaces as spaces, and lengths."""
    labels = (
        re.sub("<br>|\N{NO-BREAK SPACE}", " ", t) for t in view["layout"]["yaxis"]["ticktext"]
    )
    return list(zip(labels, view["data"][0]["x"], strict=True))


def test_the_page_is_whole_and_asks_for_nothing(written: tuple[Page, dict[str, Any]]) -> None:
    page, _ = written
    assert not page.open
    for tag, attributes in page.tags:
        for name in ("src", "href", "srcset", "data", "action", "poster"):
            assert attributes.get(name) in (None, "data:,"), f"{tag} {name}"
    styles = page.source[page.source.index("<style>") : page.source.index("</style>")]
    assert "url(" not in styles
    assert "@import" not in styles
    policies = [a["content"] for t, a in page.tags if "http-equiv" in a]
    assert len(policies) == 1
    assert (policies[0] or "").startswith("default-src 'none'")
    assert sum("plotly.js v" in script for script in page.scripts) == 1
    assert len(page.scripts) == 3


def test_names_from_outside_are_text(written: tuple[Page, dict[str, Any]]) -> None:
    page, _ = written
    c = comparison()
    for text in (LOG, TOPIC, c.description, *c.verdict, *c.notes):
        assert text in page.text.replace("\xa0", " ")
    assert "<script>alert" not in page.source
    assert not [tag for tag, _ in page.tags if tag in ("img", "b")]


def test_a_label_ends_no_script(tmp_path: Path) -> None:
    c = comparison()
    first, *others = c.variants
    odd = replace(first, name="</script>", label="</script><script>alert(1)</script>")
    page, figures = page_of(replace(c, variants=(odd, *others)), tmp_path)
    assert len(page.scripts) == 3
    hover = lines({"data": figures["track"]["data"]})["</script>"]["hovertemplate"]
    assert "&lt;/script&gt;" in hover


def test_curves_are_the_errors(written: tuple[Page, dict[str, Any]]) -> None:
    _, figures = written
    drawn = lines(figures["growth"]["views"][0])
    for name, _, _, coefficient, power, _ in LAWS[1:]:
        t = np.array(drawn[name]["x"])
        error = np.array(drawn[name]["y"], float)
        end = ENDED if name == "flat-rk4" else np.inf
        assert len(t) <= 600
        assert t[0] == 0.01
        assert t[-1] == 3600.0
        assert np.array_equal(np.isnan(error), t > end)
        expected = np.where(t > end, np.nan, coefficient * t**power)
        np.testing.assert_allclose(error, expected, rtol=ROUNDED)
    sigma = drawn["imu"]
    np.testing.assert_allclose(sigma["y"], 0.002 * np.array(EPOCHS) ** 1.9, rtol=ROUNDED)
    # thinned evenly in log time: no decade is left to a few points
    assert np.diff(np.log10(drawn["flat-euler"]["x"])).max() < 0.05


def test_other_quantities_have_views(written: tuple[Page, dict[str, Any]]) -> None:
    _, figures = written
    views = {view["name"]: lines(view) for view in figures["growth"]["views"]}
    assert list(views) == ["Horizontal position", "Height", "Horizontal velocity", "Attitude"]
    k, _ = next((k, law) for k, law in enumerate(LAWS) if law[0] == "without-coriolis")
    _, _, _, coefficient, power, _ = LAWS[k]
    t = np.array(views["Height"]["without-coriolis"]["x"])
    expected = {
        "Height": 0.01 * (k + 1) * coefficient * t**power,
        "Horizontal velocity": coefficient * t ** (power - 1.0),
        "Attitude": np.minimum(1e-6 * k * t, 0.5) * np.sqrt(0.3**2 + 0.2**2 + 0.9**2),
    }
    for name, values in expected.items():
        drawn = views[name]["without-coriolis"]
        np.testing.assert_allclose(np.array(drawn["y"], float), values, rtol=ROUNDED)


def test_predictions_are_circles(written: tuple[Page, dict[str, Any]]) -> None:
    _, figures = written
    first, *others = figures["growth"]["views"]
    predicted = {law[0] for law in LAWS if law[5]}
    assert set(circles(first)) == predicted
    assert not any(circles(view) for view in others)
    # g Ω cos L t³/6 of the factory's flat world at 60 s, m
    assert circles(first)["flat-euler"]["y"][2] == pytest.approx(8.43e-5 * 60.0**3, rel=ROUNDED)


def test_costs_are_sorted(written: tuple[Page, dict[str, Any]]) -> None:
    _, figures = written
    views = figures["cost"]["views"]
    assert [view["name"] for view in views] == ["1 s", "10 s", "1 min", "10 min", "1 h"]
    assert views[figures["cost"]["first"]]["name"] == "1 min"
    for epoch, view in zip(EPOCHS, views, strict=True):
        sizes = [law[3] * epoch ** law[4] for law in LAWS[1:]]
        if epoch > ENDED:
            *found, (label, gone) = bars(view)
            del sizes[2]
            assert gone is None
            assert label.startswith("Flat world, RK4")
            assert "ended at" in label
        else:
            found = bars(view)
        np.testing.assert_allclose([x for _, x in found], sorted(sizes)[::-1], rtol=ROUNDED)
    assert bars(views[2])[0] == ("Flat world, Euler <b>18.2 m</b>", 18.209)


def test_with_truth_costs_stay_those_of_the_model(
    written: tuple[Page, dict[str, Any]], judged: tuple[Page, dict[str, Any]]
) -> None:
    page, figures = judged
    assert "truth /truth/solution" in page.text
    own = np.hypot(0.02, 0.01) * 60.0**1.5  # m, of the engine at 1 min
    found = dict(bars(figures["cost"]["views"][2]))
    engine = [x for label, x in found.items() if label.startswith("Earth frame: its own error")]
    assert engine == [pytest.approx(own, rel=ROUNDED)]
    models = [pair for pair in found.items() if not pair[0].startswith("Earth frame: its")]
    without_truth = bars(written[1]["cost"]["views"][2])
    assert [label for label, _ in models] == [label for label, _ in without_truth]
    np.testing.assert_allclose([x for _, x in models], [x for _, x in without_truth], rtol=ROUNDED)
    position, cost, *_ = figures["growth"]["views"]
    assert cost["name"] == "Distance from the full engine"
    assert not circles(position)
    assert set(circles(cost)) == {law[0] for law in LAWS if law[5]}


def test_tables_read_as_people_do(written: tuple[Page, dict[str, Any]]) -> None:
    page, _ = written
    position, height, velocity, attitude = range(4)
    assert len(page.tables) == 4
    assert page.tables[position][0][1:6] == ["1 s", "10 s", "1 min", "10 min", "1 h"]
    euler = page.row(position, "Flat world, Euler")
    assert euler[1:6] == ["84.3 µm", "84.3 mm", "18.2 m", "18.2 km", "3,930 km"]
    assert euler[6:] == ["8.4 × 10-5 t3.00", "g Ω cos L t³ / 6"]
    rk4 = page.row(position, "Flat world, RK4")
    assert "ended at 6 min" in rk4[0]
    assert rk4[4:6] == ["—", "—"]
    assert page.row(position, "Earth frame")[1:] == ["0"] * 5 + ["", ""]
    assert page.row(height, "Flat world, Euler")[3] == "364 mm"  # 0.02 of 18.2 m
    assert page.row(velocity, "Flat world, Euler")[3] == "303 mm/s"  # 18.2 m in 60 s
    # factory: 13 µrad/s times sqrt(0.94) for the last variant, 1 min and 1 h
    last = page.row(attitude, "Without rotation compensation")
    assert last[3] == "756 µrad"
    assert last[5] == "2.60°"


def test_every_variant_is_explained_and_toggled(written: tuple[Page, dict[str, Any]]) -> None:
    page, figures = written
    boxes = {a["value"] for _, a in page.tags if a.get("type") == "checkbox"}
    assert boxes == {law[0] for law in LAWS} | {"reference", "imu"}
    drawn = {t.get("meta") for t in figures["track"]["data"]} - {None}
    assert drawn == boxes - {"imu"}
    assert "15° an hour" in page.text
    assert sum(tag == "dd" for tag, _ in page.tags) >= len(LAWS)


def test_the_map_shows_the_drive_at_one_scale(written: tuple[Page, dict[str, Any]]) -> None:
    _, figures = written
    layout = figures["track"]["layout"]
    assert layout["yaxis"]["scaleanchor"] == "x"
    (west, east), (south, north) = layout["xaxis"]["range"], layout["yaxis"]["range"]
    assert -1500.0 < west < -900.0 < 900.0 < east < 1500.0  # the drive is 1.8 km wide
    assert east - west == pytest.approx(north - south)
    reference = figures["track"]["data"][0]
    c = comparison()
    rows = np.unique(np.searchsorted(c.t, np.linspace(0.0, 3600.0, 600)))
    np.testing.assert_allclose(reference["x"], drive(c.t)[rows, 0], atol=1e-4)  # m: eight digits
    np.testing.assert_allclose(reference["y"], drive(c.t)[rows, 1], atol=1e-4)
    euler = next(t for t in figures["track"]["data"] if t.get("meta") == "flat-euler")
    assert max(euler["x"] + [-x for x in euler["x"]]) > 1e6  # m: it ran away and is still there
    ended = next(t for t in figures["track"]["data"] if t.get("meta") == "flat-rk4")
    assert ended["x"][-1] is None


@pytest.mark.parametrize("odd", [False, True])
def test_plotly_knows_every_property(odd: bool, tmp_path: Path) -> None:
    _, figures = page_of(comparison(truth=odd, still=odd, imu=not odd), tmp_path)
    for figure in figures.values():
        for view in figure["views"]:
            data = view.get("data", figure["data"])
            assert data
            go.Figure(data, figure["layout"] | view.get("layout", {}))


def test_one_variant_alone(tmp_path: Path) -> None:
    c = comparison(imu=False)
    page, figures = page_of(replace(c, variants=c.variants[:1], verdict=(), notes=()), tmp_path)
    assert bars(figures["cost"]["views"][0]) == []
    assert "Notes" not in page.text


def test_a_failure_leaves_what_was_there(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    path.write_text("before")
    with pytest.raises(ConfigError, match="exists"):
        write_page(comparison(), path)
    broken = replace(comparison(), verdict=(None,))  # type: ignore[arg-type]
    with pytest.raises(AttributeError):
        write_page(broken, path, overwrite=True)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]
    write_page(comparison(), path, overwrite=True)
    assert path.read_text("utf-8").startswith("<!DOCTYPE html>")


def test_libraries_of_pictures_load_when_used() -> None:
    code = (
        "import sys; from navgrade.report import as_dict, write_page, write_pictures, write_tables;"
        "print([name for name in sys.modules if name.split('.')[0] in ('plotly', 'matplotlib')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
