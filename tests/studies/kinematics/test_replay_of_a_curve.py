"""The replay of a curve of poses: its abscissa is the arclength, no time, and energies are those of poses."""

import pytest
from browser import Chromium
from commands import call

import mbdae

ASK = """
  mbdae.seek(1.5);
  log.clock = byId("clock").textContent;
  const {panes} = mbdae.plots, marks = panes[0].plot.axes[0]._values;
  log.marks = [marks[0], marks[marks.length - 1]];
  log.slider = byId("time").getAttribute("aria-label");
  log.titles = panes.map(x => x.data.title);
  log.label = document.querySelector("canvas[role=img]").getAttribute("aria-label");
  mbdae.setSpeed(0.5);
  log.slow = byId("clock").textContent;
"""


def observed(page):
    return Chromium().ask(page, ASK, size=(1100, 700))


def test_the_abscissa_of_a_curve_of_poses_is_its_arclength(tmp_path):
    words = ("kinematics", "four_bar", "--drive", "crank", "--points", "61", "--html", "poses.html")
    code, _, err = call(*words, cwd=tmp_path)
    assert (code, err) == (0, "")
    log = observed(tmp_path / "poses.html")
    assert log["clock"] == "arclength s = 1.50"
    assert log["slow"] == "arclength s = 1.50 (0.5/s)"
    assert log["marks"][0] == "0"
    assert log["marks"][1].startswith("s = ")
    assert log["slider"] == "arclength"
    assert " over arclength: " in log["label"]
    assert "potential (J)" in log["titles"]
    assert not any("energies" in title for title in log["titles"])


@pytest.mark.parametrize("prescribed", [True, False])
def test_the_abscissa_of_a_motion_is_its_time(prescribed, tmp_path):
    """At a constant speed of the drive a curve is a motion in time."""
    curve = mbdae.kinematics("four_bar", "crank", points=61)
    sol = curve.run(speed=2.0) if prescribed else mbdae.solve("four_bar", (0, 3), rtol=1e-6)
    log = observed(mbdae.animate(sol, tmp_path / "run.html", speed=1.0))
    assert log["clock"] == "t = 1.500 s"
    assert log["slow"] == "t = 1.500 s (0.5 \u00d7 real time)"
    assert log["marks"][1].endswith(" s")
    assert log["slider"] == "time"
    assert " over time: " in log["label"]
    assert any("energies" in title for title in log["titles"])


def test_a_saved_curve_keeps_its_abscissa(tmp_path):
    mbdae.kinematics("four_bar", "crank", points=61).run().save(tmp_path / "curve.npz")
    sol = mbdae.Solution.load(tmp_path / "curve.npz")
    assert observed(mbdae.animate(sol, tmp_path / "curve.html"))["clock"] == "arclength s = 1.50"
