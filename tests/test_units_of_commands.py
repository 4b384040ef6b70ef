"""`--units` of commands that judge runs and models: numbers are converted, headings, texts and axes name the unit."""

import asyncio
import csv
import re

import numpy as np
import pytest
import umsgpack
from browser import Chromium
from commands import call, without_pictures
from tornado.websocket import websocket_connect

import mbdae
from mbdae.studies.live.controls import slider
from mbdae.studies.report.parameter_text import parameter_texts

PENDULUM = """
[[body]]
name = "ball"
parent = "world"
joint = "continuous"
axis = [0, 1, 0]
mass = 2.0
com = [0, 0, -0.5]
inertia = [0, 0, 0, 0, 0, 0]
[[force]]
name = "oil"
kind = "joint_damping"
joint = "ball"
damping = {damping}
[start]
q = {{ ball = 0.5 }}
"""


@pytest.fixture
def pendulum(tmp_path):
    path = tmp_path / "pendulum.toml"
    path.write_text(PENDULUM.format(damping=0.05))
    return path


def shown(folder, *words):
    code, out, err = call(*words, cwd=folder)
    assert code in (0, 1), err
    return out


def number(pattern, text):
    found = re.search(pattern.replace("#", r"(-?[\d.]+(?:e[+-]?\d+)?)"), text)
    assert found, (pattern, text)
    return float(found[1])


def test_modes_and_loci_in_other_units(pendulum, tmp_path):
    si, ms = (shown(tmp_path, "modes", str(pendulum), *u) for u in ((), ("--units", "ms")))
    assert number(r"\n1 +#", ms) == pytest.approx(1e-3 * number(r"\n1 +#", si), rel=1e-9)
    assert "eigenvalue in 1/ms" in ms
    text = shown(tmp_path, "root-locus", str(pendulum), "force.oil.damping=0.01:0.03:3", "--units", "mm")
    assert ": 3 values" in text
    assert "over force.oil.damping, 10 to 30 N mm s/rad" in text
    shapes = shown(tmp_path, "modes", "slider_crank", "--units", "mm,deg")
    crank, slider_ = (number(rf"{x} # ", shapes) for x in ("crank", "slider"))
    si = shown(tmp_path, "modes", "slider_crank")
    ratio = number("slider # m", si) / number("crank # rad", si)
    assert slider_ / crank == pytest.approx(1e3 * np.pi / 180 * ratio, rel=0.1)


def test_gains_have_the_unit_of_output_over_input(pendulum, tmp_path):
    """A steady torque T turns a pendulum by T / (m g l)."""
    text = shown(tmp_path, "linearize", str(pendulum), "--inputs", "ball", "--outputs", "q.ball", "--q", "ball=0",
                 "--units", "deg,mm")  # fmt: skip
    expected = 180 / np.pi / (2.0 * 9.81 * 0.5) / 1e3
    assert number("gain # deg/N/mm at", text) == pytest.approx(expected, rel=0.02)  # at a tenth of the resonance


def test_fits_have_the_units_of_parameters_and_signals(pendulum, tmp_path):
    sol = mbdae.solve(pendulum, (0, 2), rtol=1e-8)
    t = np.linspace(0, 2, 40)
    with (tmp_path / "data.csv").open("w") as file:
        angle = sol.resampled(t).signals("q.ball")["q.ball"]
        csv.writer(file).writerows([["t", "q.ball"], *zip(t.tolist(), angle.tolist(), strict=True)])
    words = ("fit", str(pendulum), "data.csv", "-p", "force.oil.damping=0.02:0.01:0.2", "--units", "mm,deg")
    text = shown(tmp_path, *words, "-o", "fit.csv", "--plot", "fit.svg", "--html", "fit.html")
    assert number(r"force.oil.damping +# \+-", text) == pytest.approx(50 * np.pi / 180, rel=1e-4)
    assert "N mm s/deg" in text
    head, row = (line.split(",") for line in (tmp_path / "fit.csv").read_text().splitlines())
    assert dict(zip(head, row, strict=True))["unit"] == "N mm s/deg"
    assert "N mm s/deg" in (tmp_path / "fit.html").read_text()


def test_drift_has_the_unit_of_the_worst_row(tmp_path):
    words = ("drift", "slider_crank", "-t", "0.2", "-m", "herk3", "--rtol", "1e-4")
    si, mm = (shown(tmp_path, *words, *u) for u in ((), ("--units", "mm,ms,mJ")))
    for pattern, factor in ((r"\|g\| +max # {}m", 1e3), ("energy balance # {}J", 1e3), (r"\|G v\| +max # {}m/", 1.0)):
        found, expected = (number(pattern.format(x), text) for x, text in (("m", mm), ("", si)))
        assert found == pytest.approx(factor * expected, rel=0.01), pattern
    assert "t = 200 ms" in mm


def test_orders_and_comparisons_of_angles_are_in_degrees(pendulum, tmp_path):
    """One coordinate, an angle: its errors are converted; step sizes, too."""
    words = ("order", str(pendulum), "-m", "herk3", "--T", "1", "--steps", "20")
    si, deg = (shown(tmp_path, *words, *u) for u in ((), ("--units", "deg,ms")))
    found, expected = (number(r"\nh = [\d.]+ m?s +#", text) for text in (deg, si))
    assert found == pytest.approx(180 / np.pi * expected, rel=0.01)
    assert "h = 50 ms" in deg
    assert "deg/s" not in deg.splitlines()[3]
    assert "deg/ms" in deg
    words = ("compare", str(pendulum), "-t", "0.5", "-m", "herk3", "-m", "herk5", "--rtol", "1e-4,1e-6")
    text = shown(tmp_path, *words, "--repeats", "1", "--units", "deg", "-o", "runs.csv")
    headers, units = text.splitlines()[4:6]
    assert headers.split()[:4] == ["method", "rtol", "error", "q"]
    assert units.split()[:3] == ["deg", "deg/s", "s"]
    row = next(csv.DictReader((tmp_path / "runs.csv").read_text().splitlines()))
    first = next(line for line in text.splitlines() if line.startswith(row["method"]))
    assert float(first.split()[2].lstrip("<")) == pytest.approx(180 / np.pi * float(row["error_q"]), rel=0.05)


def test_ranges_of_sliders_are_in_other_units(tmp_path):
    text = shown(tmp_path, "view", "slider_crank", "--units", "deg,mm")
    low, high = number("crank: # to", text), number("to # deg", text)
    assert high - low == pytest.approx(360, rel=1e-5)
    said = """
      const input = document.querySelector(".slider input");
      log.said = [0, 1].map(at => {
        input.value = at;
        input.oninput();
        return document.querySelector("output").textContent;
      });
    """
    said = Chromium().ask(tmp_path / "slider_crank.html", said, size=(700, 400))["said"]
    assert [number("# deg", x) for x in said] == pytest.approx([low, high], abs=0.02)
    with mbdae.display_units("mm", "deg"):
        command = slider("parameter", "frame.tip.xyz.0", "m", 0.25, 0.1, 0.5)
    assert (command["name"], command["value"], command["max"]) == ("frame.tip.xyz.0 (mm)", 250.0, 500.0)
    assert "value: 0.001 * value" in command["callback"]


async def sliders_of(url):
    """Labels of the sliders that a page receives from the server, which is another thread."""
    page, labels = await websocket_connect(url.replace("http", "ws").removesuffix("static/")), []
    while "release the joints" not in labels:
        command = umsgpack.unpackb(await page.read_message())
        labels += [command["name"]] if command["type"] == "set_control" else []
    page.close()
    return labels


def test_live_views_keep_their_units():
    with mbdae.display_units("deg", "ms"):
        view = mbdae.live("pendulum_on_stop", paused=True)
    with view:
        labels = asyncio.run(sliders_of(view.url))
    assert "rod (deg)" in labels


@pytest.mark.slow
def test_reports_have_units_everywhere(tmp_path, monkeypatch):
    without_pictures(monkeypatch)
    code, _, err = call("report", "stick_slip_slider", "-t", "0.3", "-m", "herk3", "--repeats", "1", "-o", "r.html",
                        "--units", "mm,deg,ms", cwd=tmp_path)  # fmt: skip
    assert code == 0, err
    page = (tmp_path / "r.html").read_text()
    for words in ("amplitude 700 N mm", "static = 400 N mm", "Iyz (kg mm^2)", "error q (rad, m)", "time (ms)"):
        assert words in page, words
    with mbdae.display_units("mm"):
        found = parameter_texts(mech := mbdae.load("stick_slip_slider"), mech.forces[0])
    assert found["torque"] == "amplitude 700 N mm omega 4 rad/s"
