"""The page in a browser: drawn, usable, silent."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

from navgrade.report import write_page
from tests.navgrade.report.comparisons import comparison

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
DRIVER = shutil.which("chromedriver")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
PATIENCE = 60.0  # s: five megabytes of script on a busy machine

pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="chromium or chromedriver is not installed"
)


@dataclass
class Shown:
    """The page in a browser."""

    browser: Any
    url: str
    figures: dict[str, Any]

    def resize(self, width: int, *, mobile: bool = False) -> None:
        size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": mobile}
        self.browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)

    def open(self) -> None:
        self.browser.get(self.url)
        WebDriverWait(self.browser, PATIENCE).until(
            lambda browser: browser.execute_script("return document.documentElement.dataset.drawn")
        )

    def choose(self, plot: str, view: int) -> None:
        """Press a button as a finger does, and wait until the plot is drawn again."""
        self.browser.execute_async_script(
            "const [plot, view, done] = arguments;"
            "const input = document.querySelector(`input[name=${plot}][value='${view}']`);"
            "if (input.checked) { done(); return; }"
            "const node = document.getElementById(plot);"
            "node.once('plotly_afterplot', () => setTimeout(done, 50));"
            "input.nextSibling.click();",
            plot,
            str(view),
        )

    def axes(self, plot: str) -> Any:
        """The area of a plot, without labels and buttons, brought into view."""
        area = self.browser.find_element(By.CSS_SELECTOR, f"#{plot} .nsewdrag")
        self.browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", area)
        return area

    def pixels(self, plot: str) -> np.ndarray:
        """What is drawn there, shape (h, w, 3)."""
        area = self.axes(plot)
        image = io.BytesIO(area.screenshot_as_png)
        return matplotlib.image.imread(image)[..., :3]

    def covered(self, plot: str, color: str) -> int:
        """How many pixels of a plot have a colour."""
        wanted = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
        return int((np.abs(self.pixels(plot) - wanted).max(axis=-1) < 0.04).sum())

    def bars(self) -> list[str]:
        """The labels beside the bars."""
        ticks = self.browser.find_elements(By.CSS_SELECTOR, "#cost .ytick text")
        texts = [tick.get_attribute("data-unformatted") for tick in ticks]
        return [re.sub("<br>|\\s", " ", re.sub("</?b>", "", text)) for text in texts]

    def color(self, variant: str) -> str:
        (trace,) = (
            t
            for t in self.figures["growth"]["views"][0]["data"]
            if t.get("meta") == variant and t.get("mode") == "lines"
        )
        return str(trace["line"]["color"])


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    folder = tmp_path_factory.mktemp("browser")
    path = folder / "a <report> & more.html"
    write_page(comparison(), path)
    data = path.read_text("utf-8").split('id="figures">')[1].split("</script>")[0]
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM or ""
    for flag in (*FLAGS, f"--user-data-dir={folder / 'profile'}"):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    browser = webdriver.Chrome(options=options, service=Service(DRIVER))
    try:
        browser.set_script_timeout(PATIENCE)
        page = Shown(browser, path.as_uri(), json.loads(data))
        page.resize(1280)
        page.open()
        yield page
    finally:
        browser.quit()


def requests(browser: Any) -> set[str]:
    """What was asked for since the last call, but for what page and browser hold themselves."""
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    sent = [e["params"] for e in events if e["method"] == "Network.requestWillBeSent"]
    urls = {params["request"]["url"] for params in sent}
    return {url for url in urls if not url.startswith(("data:", "blob:", "chrome:"))}


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
