"""Preferences of the reader: dark colours, reduced motion, and the time as text."""

from contextlib import contextmanager

import numpy as np
import pytest
from browser import Chromium

import mbdae
from mbdae.studies.replay.replay import animate

INK = """
  log.ink = getComputedStyle(document.querySelector(".u-title")).color.match(/\\d+/g).map(Number);
  log.paper = getComputedStyle(byId("plots")).backgroundColor.match(/\\d+/g).map(Number);
  dispatchEvent(new Event("beforeprint"));
  await wait(0);
  log.printed = getComputedStyle(document.querySelector(".u-title")).color.match(/\\d+/g).map(Number);
  dispatchEvent(new Event("afterprint"));
"""


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    sol = mbdae.solve("slider_crank", (0, 1), rtol=1e-4)
    return animate(sol, tmp_path_factory.mktemp("page") / "run.html", plots=("q.crank",), fps=10)


@contextmanager
def preferring(page, address="", **features):
    """A tab of a reader with preferences."""
    media = [{"name": name.replace("_", "-"), "value": value} for name, value in features.items()]
    with Chromium().open("about:blank", (800, 400), "true") as tab:
        tab.call("Emulation.setEmulatedMedia", features=media)
        try:
            tab.navigate(f"{page.as_uri()}#shadows=0&{address}")
            yield tab
        finally:
            tab.call("Emulation.setEmulatedMedia", features=[])


def luminance(rgb):
    """Relative luminance of WCAG 2.1."""
    c = np.array(rgb[:3]) / 255
    return np.where(c <= 0.03928, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize("scheme", ["dark", "light"])
def test_text_is_readable_in_dark_and_light_colours_and_on_paper(page, scheme):
    with preferring(page, "t=0.3", prefers_color_scheme=scheme) as tab:
        picture, log = tab.picture(), tab.ask(INK)
    ink, paper = luminance(log["ink"]), luminance(log["paper"])
    assert (ink > paper) == (scheme == "dark")
    assert (max(ink, paper) + 0.05) / (min(ink, paper) + 0.05) > 7, "contrast AAA"
    assert (np.median(picture[:, 520:]) < 60) == (scheme == "dark"), "the plots"
    assert luminance(log["printed"]) < 0.1, "dark ink on paper"


@pytest.mark.parametrize(("motion", "plays"), [("reduce", False), ("no-preference", True)])
def test_a_reader_who_wants_less_motion_starts_it(page, motion, plays):
    with preferring(page, prefers_reduced_motion=motion) as tab:
        assert tab.evaluate("mbdae.playing") == plays


def test_the_slider_tells_the_time(page):
    with preferring(page, "t=0.3") as tab:
        assert tab.evaluate("byId('time').ariaValueText").startswith("t = 0.300 s")
