"""A browser shows the replay: what is seen, what the clock says, and what keys and pointer do."""

import base64
import html
import json
import re
from io import BytesIO

import numpy as np
import pytest
import scenes
from browser import PROBE, Chromium, changed
from click.testing import CliRunner
from PIL import Image
from scenes import motion

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError
from mbdae.studies.replay import plot_panels as panes
from mbdae.studies.replay.replay import animate

ORANGE = np.array([242, 142, 43])
CURSOR = np.array([207, 34, 46])
PLAIN = {"plots": ()}


@pytest.fixture
def chromium(tmp_path):
    return Chromium(tmp_path)


@pytest.fixture
def fourbar():
    return scenes.fourbar()


@pytest.fixture(scope="module")
def crank():
    return mbdae.solve(mbdae.load("slider_crank"), (0, 2), rtol=1e-6)


def centre(picture, colour, near=60):
    """Mean row and column of the pixels near a colour, shades of it too; fails when there are few."""
    dark = picture / np.maximum(picture.max(axis=2, keepdims=True), 1)
    alike = np.abs(dark - colour / colour.max()).max(axis=2) < near / 255
    bright = picture.max(axis=2) > 90
    rows, columns = np.nonzero(alike & bright)
    assert len(rows) > 30, f"{len(rows)} pixels of {colour}"
    return np.array([rows.mean(), columns.mean()])


def picture_of(url):
    with Image.open(BytesIO(base64.b64decode(url.partition(",")[2]))) as image:
        return np.asarray(image.convert("RGB"), dtype=int)


def cursor(picture):
    """The column of the vertical line in the cursor's colour, where it ends in part of a pixel too."""
    cover = (255 - picture) / (255 - CURSOR)
    alike = (np.ptp(cover, axis=2) < 0.12) & (cover.min(axis=2) > 0.15)
    weight = np.where(alike, cover.mean(axis=2), 0).sum(axis=0)
    assert weight.max() > 20
    weight[weight < 20] = 0
    return np.average(np.arange(len(weight)) + 0.5, weights=weight)


def test_the_mechanism_moves(fourbar, chromium, tmp_path):
    page = animate(motion(fourbar.scene, fourbar.q), tmp_path / "run.html", **PLAIN)
    first, second = chromium.shot(page, 0.0), chromium.shot(page, 0.5)
    assert 0.005 < changed(first, second) < 0.3
    moved = centre(second, ORANGE) - centre(first, ORANGE)
    k = [s.name for s in fourbar.scene.shapes].index("loop a")
    path = [fourbar.scene.placements(fourbar.q(t))[k, :3] for t in (0.0, 0.5)]
    right, up = (path[1] - path[0])[[0, 2]]  # seen from the side of -y
    assert moved[1] / right == pytest.approx(-moved[0] / up, rel=0.25)
    assert moved[1] / right > 50, "pixels per metre"


def test_every_material_of_a_mesh_is_seen(chromium, tmp_path):
    page = animate(motion(scenes.flag(tmp_path), lambda t: np.array([0.1 * t])), tmp_path / "run.html", **PLAIN)
    picture = chromium.shot(page, 0.0)
    columns = [centre(picture, np.array(c))[1] for c in ((255, 0, 0), (0, 255, 0), (0, 0, 255))]
    assert np.diff(columns) == pytest.approx(np.diff(columns)[0], rel=0.3)
    assert columns[1] > columns[0] + 20


LOOK = """
  const canvas = mbdae.viewer.renderer.domElement;
  log.looks = %s.map(t => {
    mbdae.seek(t);
    const scene = canvas.toDataURL(), places = {};
    for (const path of %s) {
      const {position: p, quaternion: r} = nodeOf(mbdae.viewer, path);
      places[path] = [p.x, p.y, p.z, r.x, r.y, r.z, r.w];
    }
    const panes = mbdae.plots.panes.map(pane => pane.canvas.toDataURL());
    return {scene, places, panes, t: Number(document.documentElement.dataset.t), clock: byId("clock").textContent};
  });
  log.axis = mbdae.plots.panes.map(pane => [LEFT * pane.ratio, (pane.width - RIGHT) * pane.ratio]);
"""


@pytest.mark.parametrize("name", mbdae.model_names())
def test_cursor_time_is_scene_time(name, chromium, tmp_path, monkeypatch):
    monkeypatch.setattr(panes, "POINTS", 100)
    mech = mbdae.load(name)
    end = min(0.5, mech.duration)
    sol = mbdae.solve(mech, (0, end), rtol=1e-4)
    page = animate(sol, tmp_path / "run.html", traces=[mech.model.frames[-1].name])
    assert page.stat().st_size < 7e6
    times = [0.0, 0.4 * end, end]
    paths = [f"/mechanism/{s.role}/{s.name.replace('/', '|')}" for s in mech.scene.shapes]
    log = chromium.ask(page, LOOK % (times, paths), size=(560, 320))
    frame = end / 100
    for t, look in zip(times, log["looks"], strict=True):
        assert look["t"] == pytest.approx(t, abs=1e-12)
        assert float(look["clock"].split()[2]) == pytest.approx(t, abs=frame)
        near = [mech.scene.placements(sol(x)[0]) for x in np.clip([t - frame, t, t + frame], 0, end)]
        slack = np.ptp([p[:, :3] for p in near], axis=0) + 1e-5
        seen = np.array([look["places"][path] for path in paths])
        assert np.all(np.abs(seen[:, :3] - near[1][:, :3]) <= slack)
        turns = np.abs(np.sum(seen[:, 3:] * near[1][:, 3:], axis=1))
        drift = [np.abs(np.sum(near[k][:, 3:] * near[1][:, 3:], axis=1)) for k in (0, 2)]
        assert np.all(turns >= np.minimum(*drift) - 1e-5)
        for (left, right), url in zip(log["axis"], look["panes"], strict=True):
            columns = cursor(picture_of(url))
            shown = (columns - left) / (right - left) * end
            assert shown == pytest.approx(t, abs=1.5 * end / (right - left))
    shots = [picture_of(look["scene"]) for look in log["looks"]]
    for a, b in ((0, 1), (1, 2), (0, 2)):
        seen = name != "sleeping_top"  # which turns about its axis of symmetry
        assert 1e-4 * seen <= changed(shots[a], shots[b]) < 0.6


def test_it_plays_in_real_time_and_repeats(fourbar, chromium, tmp_path):
    sol = motion(fourbar.scene, fourbar.q, start=3.0, end=9.0)
    page = animate(sol, tmp_path / "run.html", speed=2.0, **PLAIN)
    script = """
      const look = () => [performance.now() / 1000, mbdae.t];
      await wait(0.3);
      log.before = look();
      await wait(1);
      log.after = look();
      mbdae.seek(8.9);
      log.still = mbdae.t;
      mbdae.play();
      await wait(0.5);
      log.again = mbdae.t;
      mbdae.loop = false;
      mbdae.seek(8.9);
      mbdae.play();
      await wait(0.3);
      log.end = [mbdae.t, mbdae.playing];
      log.duration = mbdae.duration;
    """
    log = chromium.ask(page, script)
    (wall0, t0), (wall1, t1) = log["before"], log["after"]
    assert (t1 - t0) / (wall1 - wall0) == pytest.approx(2.0, rel=0.3)
    assert log["still"] == pytest.approx(8.9)
    assert 3 <= log["again"] < 8
    assert log["end"] == [9, False]
    assert log["duration"] == 6


def test_keys_buttons_and_pointer(crank, chromium, tmp_path):
    script = """
      const press = (key, more) => document.dispatchEvent(new KeyboardEvent("keydown", {key, ...more}));
      const note = name => { log[name] = [mbdae.t, mbdae.playing, mbdae.loop, mbdae.speed]; };
      log.opened = mbdae.playing;
      press("Home"); note("home");
      press("ArrowRight"); note("right");
      press("ArrowRight", {shiftKey: true}); note("far");
      press("ArrowLeft"); note("left");
      press("End"); note("end");
      press("l"); note("loop");
      press("<"); note("slow");
      press(">"); press(">"); note("fast");
      press("Home"); press(" "); note("space");
      press(" "); note("again");
      byId("time").value = 0.25; byId("time").oninput({target: byId("time")}); note("slider");
      byId("play").click(); note("button");
      const pane = mbdae.plots.panes[1].canvas, box = pane.getBoundingClientRect();
      const point = (type, share, buttons) => pane.dispatchEvent(new PointerEvent(type, {
        clientX: box.left + LEFT + share * (box.width - LEFT - RIGHT), clientY: box.top + 60, buttons, pointerId: 1}));
      pane.setPointerCapture = () => {};
      point("pointerdown", 0.5, 1); note("down");
      point("pointermove", 0.75, 1); note("drag");
      point("pointermove", 0.1, 0); note("hover");
      log.label = pane.getAttribute("aria-label");
    """
    log = chromium.ask(animate(crank, tmp_path / "run.html", fps=20), script, size=(900, 500))
    frame = 2 / 100
    times = {key: value[0] for key, value in log.items() if isinstance(value, list)}
    assert log["opened"]
    assert (times["home"], times["end"], times["slider"]) == (0, 2, 0.5)
    assert times["right"] == pytest.approx(frame)
    assert times["far"] == pytest.approx(11 * frame)
    assert times["left"] == pytest.approx(10 * frame)
    assert [log[k][2] for k in ("end", "loop")] == [True, False]
    assert [log[k][3] for k in ("loop", "slow", "fast")] == [1, 0.5, 2]
    assert [log[k][1] for k in ("space", "again", "button", "down")] == [True, False, True, False]
    assert times["down"] == pytest.approx(1.0, abs=0.01)
    assert times["drag"] == times["hover"] == pytest.approx(1.5, abs=0.01)
    assert log["label"] == "q.slider (m) over time: q.slider"


def test_ghosts_traces_and_arrows_are_seen(crank, chromium, tmp_path):
    other = mbdae.solve(crank.mechanism, (0, 2), method="herk1", step=0.02)
    options = {"traces": ["rod_tip"], "ghosts": {"herk1": other}, "arrows": True}
    plain = chromium.shot(animate(crank, tmp_path / "plain.html"), 1.5, size=(900, 500))
    full = chromium.shot(animate(crank, tmp_path / "full.html", **options), 1.5, size=(900, 500))
    assert changed(plain[100:400, :500], full[100:400, :500]) > 0.01
    arrow = np.array([194, 24, 91])
    near = [(np.abs(x[100:, :500] - arrow).max(axis=2) < 12).sum() for x in (plain, full)]
    assert all((x[50:400, 620:].min(axis=2) < 200).mean() > 0.01 for x in (plain, full)), "plots"
    assert near[0] == 0
    assert near[1] > 100


def test_a_phone_shows_scene_controls_and_plots(crank, chromium, tmp_path):
    inner = animate(crank, tmp_path / "run.html", fps=20)
    page = tmp_path / "phone.html"
    script = """
      await wait(0.1);
      const box = id => { const r = byId(id).getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom]; };
      for (const id of ["pane", "bar", "plots", "fit", "play"]) log[id] = box(id);
      log.wide = document.documentElement.scrollWidth;
      parent.postMessage(JSON.stringify(log), "*");
    """
    inner.write_text(inner.read_text("utf-8").replace("</body>", PROBE % script), "utf-8")
    page.write_text(
        "<!DOCTYPE html><script>onmessage = e => { document.title = e.data; };</script>"
        '<iframe src="run.html#t=1" style="width: 360px; height: 640px; border: 0"></iframe>'
    )
    text = chromium.run(page.as_uri(), "--dump-dom")
    log = json.loads(html.unescape(re.search("<title>(.*?)</title>", text)[1]))
    assert log["wide"] == 360
    assert log["pane"][3] <= log["bar"][1] + 1 <= log["plots"][1] + 1
    assert log["pane"][3] - log["pane"][1] > 190
    assert log["plots"][3] - log["plots"][1] > 200
    assert all(log[name][2] <= 360 and log[name][3] <= 640 for name in ("bar", "fit", "play"))


def test_the_command(crank, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    crank.save("run.npz")
    mbdae.solve(crank.mechanism, (0, 2), method="herk3", step=0.02).save("other.npz")

    def call(text):
        return CliRunner().invoke(cli, ["animate", *text.split()])

    result = call("run.npz other.npz -o run.html --plot q.crank,q.crank_pin --plot lam --trace rod_tip --arrows")
    assert result.exit_code == 0, result.exception
    assert result.output == "wrote run.html\n"
    assert len((tmp_path / "run.html").read_bytes()) > 4e5
    for arguments, words in (
        ("run.npz", "-o run.html, a video"),
        ("run.npz -o run.htm", r"must end in \.html"),
        ("run.npz --video run.avi", r"\.mp4 or \.gif"),
        ("run.npz -o b.html --plot nothing", "unknown signal 'nothing'.*valid: q,"),
        ("run.npz -o b.html --arrow nothing", "unknown closure or driver"),
    ):
        with pytest.raises(InputError, match=words):
            raise call(arguments).exception
    assert not (tmp_path / "b.html").exists()
