"""Pages in a browser."""

from __future__ import annotations

import io
import json
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

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

needs_browser = pytest.mark.skipif(
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


@contextmanager
def browsing(path: Path) -> Iterator[Shown]:
    """Open a page in a browser whose profile stands beside it."""
    data = path.read_text("utf-8").split('id="figures">')[1].split("</script>")[0]
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM or ""
    for flag in (*FLAGS, f"--user-data-dir={path.parent / 'profile'}"):
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
