"""A replay in a browser without WebGL: the scene is not drawn, plots and numbers follow the time."""

import pytest
from browser import Chromium

import mbdae

BLIND = """const made = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind.includes("webgl") ? null : made.call(this, kind, ...more);
};"""
ASK = """
  log.said = document.getElementById("caption").textContent;
  mbdae.seek(%s);
  log.clock = document.getElementById("clock").textContent;
  log.names = [...document.querySelectorAll(".u-series.own .u-label")].map(x => x.textContent);
  log.values = [...document.querySelectorAll(".u-series.own .u-value")].map(x => x.textContent);
  mbdae.play();
  await wait(0.2);
  log.later = mbdae.t;
"""


def test_plots_and_numbers_need_no_webgl(tmp_path):
    sol, page, t = mbdae.solve("slider_crank", (0, 0.5), rtol=1e-6), tmp_path / "run.html", 0.3
    mbdae.animate(sol, page, plots=["q.slider"])
    with Chromium().open("about:blank", (800, 600), ready="true") as tab:
        tab.call("Page.enable")
        script = tab.call("Page.addScriptToEvaluateOnNewDocument", source=BLIND)["identifier"]
        try:
            tab.navigate(page.as_uri())
            log = tab.ask(ASK % t)
        finally:
            tab.call("Page.removeScriptToEvaluateOnNewDocument", identifier=script)
    assert log["said"].endswith("This browser has no WebGL: the scene is not drawn.")
    assert log["clock"].startswith("t = 0.30")
    assert [float(x) for x in log["values"]] == pytest.approx([sol(t).q[-1]], abs=6e-4)
    assert log["later"] > t
