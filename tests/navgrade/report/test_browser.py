"""The page in a browser: drawn, usable, silent."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from navgrade.report import write_page
from tests.navgrade.report.browsing import PATIENCE, Shown, browsing, needs_browser, requests
from tests.navgrade.report.comparisons import comparison

pytestmark = needs_browser


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    path = tmp_path_factory.mktemp("browser") / "a <report> & more.html"
    write_page(comparison(), path)
    with browsing(path) as page:
        yield page


def test_in_a_browser(shown: Shown) -> None:
    browser = shown.browser
    # curves: of the map the drive itself and one that left it; of growth one of each group
    assert shown.covered("track", shown.color("flat-midpoint")) > 100
    assert shown.covered("track", shown.color("without-coriolis")) > 300
    for variant in ("flat-midpoint", "without-coriolis", "without-ellipsoid", "without-coning"):
        assert shown.covered("growth", shown.color(variant)) > 80, variant
    assert shown.covered("cost", shown.color("without-earth-rate")) > 3000
    height, width, _ = shown.pixels("growth").shape
    assert height > 300
    assert width > 600

    # a time of the bars
    assert shown.bars()[0] == "Flat world, Euler 18.2 m"
    before = shown.pixels("cost")
    shown.choose("cost", 4)
    assert shown.bars()[0] == "Flat world, Euler 3,930 km"
    assert shown.bars()[-1].startswith("Flat world, RK4 ended at 6 min")
    after = shown.pixels("cost")
    wide = min(before.shape[1], after.shape[1])  # the labels beside the bars have changed, too
    assert np.abs(after[:, :wide] - before[:, :wide]).max(axis=-1).mean() > 0.02

    # a quantity of the growth, and of the table
    shown.choose("growth", 3)
    title = browser.find_element(By.CSS_SELECTOR, "#growth .ytitle").text
    assert title == "error of attitude"
    ticks = browser.find_elements(By.CSS_SELECTOR, "#growth .ytick")
    assert "1 µrad" in {tick.text for tick in ticks}
    shown.choose("growth", 0)
    captions = "return [...document.querySelectorAll('table')].map(t => t.offsetParent !== null)"
    assert browser.execute_script(captions) == [True, False, False, False]
    table = "document.querySelector(\"input[name=table][value='2']\").nextSibling.click()"
    browser.execute_script(table)
    assert browser.execute_script(captions) == [False, False, True, False]

    # the map: whole, and back
    east = "return document.getElementById('track').layout.xaxis.range[1]"
    assert browser.execute_script(east) < 3e3  # m
    bar = "return document.getElementById('track').layout.annotations[0].text"
    assert browser.execute_script(bar) == "500 m"
    shown.choose("track", 1)
    assert browser.execute_script(east) > 1e6
    assert browser.execute_script(bar) in ("1000 km", "2000 km", "5000 km")
    shown.choose("track", 0)
    assert browser.execute_script(east) < 3e3
    assert browser.execute_script(bar) == "500 m"

    # the legend hides a variant everywhere, and keeps the zoom
    midpoint = shown.color("flat-midpoint")
    zoom = "return [...document.getElementById('growth').layout.xaxis.range]"
    whole = browser.execute_script(zoom)
    corner = ActionChains(browser).move_to_element_with_offset(shown.axes("growth"), 0, -100)
    mouse = corner.click_and_hold()
    mouse.move_by_offset(200, 200).release().perform()
    zoomed = browser.execute_script(zoom)
    assert 0.5 < zoomed[0] < zoomed[1] < 3.0  # log s
    browser.execute_async_script(
        "document.getElementById('growth').once('plotly_afterplot', () =>"
        " setTimeout(arguments[0], 200));"
        "document.querySelector(\"input[value='flat-midpoint']\").click();"
    )
    for plot in ("track", "growth"):
        assert shown.covered(plot, midpoint) < 20
    assert browser.execute_script(zoom) == zoomed
    assert shown.covered("growth", shown.color("without-coriolis")) > 80
    shown.choose("growth", 1)
    shown.choose("growth", 0)
    assert browser.execute_script(zoom) == whole

    assert browser.get_log("browser") == []
    assert requests(browser) == {shown.url}


def test_on_a_phone(shown: Shown) -> None:
    browser = shown.browser
    widths = "return [document.documentElement.scrollWidth, document.body.scrollWidth, innerWidth]"
    shown.resize(400, mobile=True)
    shown.open()
    for view in range(4):
        shown.choose("growth", view)
    for view in range(5):
        shown.choose("cost", view)
        assert browser.execute_script(widths) == [400] * 3
    for plot in ("track", "growth", "cost"):
        _, wide, _ = shown.pixels(plot).shape
        assert wide > 150, plot
    assert shown.covered("growth", shown.color("without-earth-rate")) > 30
    shown.resize(360, mobile=True)
    WebDriverWait(browser, PATIENCE).until(lambda b: b.execute_script(widths) == [360] * 3)
    assert browser.get_log("browser") == []
    assert requests(browser) == {shown.url}


def test_in_the_dark(shown: Shown) -> None:
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    shown.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    shown.resize(1280)
    shown.open()
    assert np.median(shown.pixels("growth")) < 0.2
    for variant in ("flat-midpoint", "without-coriolis", "without-ellipsoid"):
        assert shown.covered("growth", shown.color(variant)) > 80, variant
    assert shown.browser.get_log("browser") == []
