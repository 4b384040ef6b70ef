"""Printed pages of scenes: a picture of the scene, plots as wide as the page, no controls."""

import base64
import re

import numpy as np
import pytest
from browser import Chromium, picture_of

import mbdae
from mbdae.studies.replay.replay import animate

LAID_OUT = """
  dispatchEvent(new Event("beforeprint"));
  await wait(0);
  const inside = "#bar button, #bar select, #bar input, .slider input, .back";
  log.controls = [...document.querySelectorAll(inside)].filter(x => x.checkVisibility()).map(x => x.id);
  log.widths = [...document.querySelectorAll("#picture, .u-wrap canvas")].map(x => x.offsetWidth);
  log.texts = [...document.querySelectorAll("h1, .u-title, .slider output")].filter(x => x.checkVisibility()).length;
  const {x, y, width, height} = byId("pane").getBoundingClientRect();
  log.top = document.elementFromPoint(x + width / 2, y + height / 2).id;
"""


def pages_of(tab):
    """The number of printed pages."""
    return len(re.findall(rb"/Type /Page\b", base64.b64decode(tab.call("Page.printToPDF")["data"])))


@pytest.mark.parametrize(("plots", "pages"), [(4, 1), (5, 2), (9, 3)])
def test_plots_share_the_page_with_the_picture_or_continue_on_the_next(plots, pages, tmp_path):
    """One page holds the picture and up to four plots; otherwise three, and each further page five."""
    sol = mbdae.solve(mbdae.load("slider_crank"), (0, 0.1), rtol=1e-4)
    names = [f"{kind}.{joint}" for kind in ("q", "v", "a") for joint in ("crank", "crank_pin", "slider")]
    page = animate(sol, tmp_path / "run.html", plots=[(name,) for name in names[:plots]], fps=10)
    with Chromium().open(f"{page.as_uri()}#shadows=0", (390, 844)) as tab:
        assert tab.evaluate("document.querySelectorAll('.uplot').length") == plots
        assert pages_of(tab) == pages


def test_a_replay_is_printed_with_its_picture_and_its_plots(tmp_path):
    sol = mbdae.solve(mbdae.load("slider_crank"), (0, 1), rtol=1e-4)
    page = animate(sol, tmp_path / "run.html", plots=("q.crank", "v.crank", "energy"), fps=10)
    with Chromium().open(f"{page.as_uri()}#t=0.3&shadows=0", (390, 844)) as tab:
        before = tab.picture()
        pdf = base64.b64decode(tab.call("Page.printToPDF")["data"])
        assert b"/Width 1320" in pdf  # an image
        assert (tab.picture() == before).all()
        picture = picture_of(tab.evaluate("picture.toDataURL()"))
        coloured = np.flatnonzero((np.ptp(picture, axis=2) > 60).any(axis=0))
        assert 0.4 < np.ptp(coloured) / picture.shape[1] < 1.0
        log = tab.ask(LAID_OUT)
    assert (log["controls"], log["widths"], log["texts"], log["top"]) == ([], 4 * [660], 4, "picture")


def test_sliders_are_printed_as_what_they_say(tmp_path):
    mbdae.view(mbdae.load("four_bar")).save(tmp_path / "view.html")
    log = Chromium().ask(tmp_path / "view.html", LAID_OUT)
    assert (log["controls"], log["widths"], log["texts"], log["top"]) == ([], [660], 2, "picture")
