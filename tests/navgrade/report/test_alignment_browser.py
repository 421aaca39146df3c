"""The page of an alignment in a browser: drawn, silent, as wide as the screen."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from navgrade.report import write_alignment_page
from tests.navgrade.report.alignments import LAT, LOG, SITE, aligned
from tests.navgrade.report.browsing import Shown, browsing, needs_browser, requests

pytestmark = needs_browser

PLOTS = ("budget", "convergence", "timeline", "innovations")
WIDTHS = "return [document.documentElement.scrollWidth, document.body.scrollWidth, innerWidth]"
CUT = (
    "return [...document.querySelectorAll('.fit')].filter(table =>"
    " table.parentNode.scrollWidth > table.parentNode.clientWidth).length"
)
TILT, AZIMUTH, TRACE = "#0072b2", "#d55e00", "#7d8590"


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Shown]:
    path = tmp_path_factory.mktemp("browser") / "an <alignment> & more.html"
    write_alignment_page(aligned(), path, log_name=LOG, site_name=SITE, lat=LAT)
    with browsing(path) as page:
        yield page


def everything_is_drawn(shown: Shown) -> None:
    for color in (TILT, AZIMUTH):
        assert shown.covered("budget", color) > 1000
        assert shown.covered("convergence", color) > 200
    assert shown.covered("timeline", TRACE) > 500
    assert shown.covered("innovations", TRACE) > 500


def test_in_a_browser(shown: Shown) -> None:
    everything_is_drawn(shown)
    lines = shown.browser.find_elements("css selector", "#timeline .scatterlayer .js-line")
    rate, force = (line.rect for line in lines)
    assert rate["y"] + rate["height"] < force["y"]  # each in its own panel
    assert shown.browser.get_log("browser") == []
    assert requests(shown.browser) == {shown.url}


def test_on_a_phone(shown: Shown) -> None:
    for width in (390, 360):
        shown.resize(width, mobile=True)
        shown.open()
        assert shown.browser.execute_script(WIDTHS) == [width] * 3
        for plot in PLOTS:
            assert shown.pixels(plot).shape[1] > 150, plot
    shown.resize(390, mobile=True)
    shown.open()
    assert shown.browser.execute_script(CUT) == 0
    assert shown.browser.get_log("browser") == []
    assert requests(shown.browser) == {shown.url}


def test_in_the_dark(shown: Shown) -> None:
    dark = {"features": [{"name": "prefers-color-scheme", "value": "dark"}]}
    shown.browser.execute_cdp_cmd("Emulation.setEmulatedMedia", dark)
    shown.resize(1280)
    shown.open()
    assert np.median(shown.pixels("convergence")) < 0.2
    everything_is_drawn(shown)
    assert shown.browser.get_log("browser") == []
