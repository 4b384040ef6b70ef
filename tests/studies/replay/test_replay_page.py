"""A browser shows the replay: picture, clock, keys and pointer."""

import numpy as np
import pytest
import scenes
from browser import Chromium, changed
from click.testing import CliRunner
from scenes import motion

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError
from mbdae.studies.replay.replay import animate

ORANGE = np.array([242, 142, 43])
PLAIN = {"plots": ()}


@pytest.fixture
def chromium(tmp_path):
    return Chromium()


@pytest.fixture
def fourbar():
    return scenes.fourbar()


@pytest.fixture(scope="module")
def crank():
    return mbdae.solve(mbdae.load("slider_crank"), (0, 2), rtol=1e-6)


def centre(picture, colour, near=60):
    """Mean row and column of the pixels near a colour, shades of it too; fails if there are few."""
    dark = picture / np.maximum(picture.max(axis=2, keepdims=True), 1)
    alike = np.abs(dark - colour / colour.max()).max(axis=2) < near / 255
    bright = picture.max(axis=2) > 90
    rows, columns = np.nonzero(alike & bright)
    assert len(rows) > 30, f"{len(rows)} pixels of {colour}"
    return np.array([rows.mean(), columns.mean()])


def test_the_mechanism_moves(fourbar, chromium, tmp_path):
    page = animate(motion(fourbar.scene, fourbar.q), tmp_path / "run.html", **PLAIN, closures=True)
    with chromium.open(f"{page.as_uri()}#t=0") as tab:
        first, second = tab.picture(), tab.at(0.5)
    assert 0.005 < changed(first, second) < 0.3
    moved = centre(second, ORANGE) - centre(first, ORANGE)
    k = [s.name for s in fourbar.scene.shapes].index("loop a")
    path = [fourbar.scene.placements(fourbar.q(t))[k, :3] for t in (0.0, 0.5)]
    right, up = (path[1] - path[0])[[0, 2]]  # viewed from -y
    assert moved[1] / right == pytest.approx(-moved[0] / up, rel=0.1), "no perspective"
    assert moved[1] / right > 50, "pixels per metre"


def test_every_material_of_a_mesh_is_seen(chromium, tmp_path):
    page = animate(motion(scenes.flag(tmp_path), lambda t: np.array([0.1 * t])), tmp_path / "run.html", **PLAIN)
    picture = chromium.shot(page, 0.0)
    columns = [centre(picture, np.array(c))[1] for c in ((255, 0, 0), (0, 255, 0), (0, 0, 255))]
    assert np.diff(columns) == pytest.approx(np.diff(columns)[0], rel=0.3)
    assert columns[1] > columns[0] + 20


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
      for (let i = 0; mbdae.t > 8 && i < 100; i++) await wait(0.1);
      log.again = mbdae.t;
      mbdae.loop = false;
      mbdae.seek(8.9);
      mbdae.play();
      for (let i = 0; mbdae.playing && i < 100; i++) await wait(0.1);
      log.end = [mbdae.t, mbdae.playing];
      log.duration = mbdae.duration;
    """
    log = chromium.ask(page, script)
    (wall0, t0), (wall1, t1) = log["before"], log["after"]
    assert (t1 - t0 - 2 * (wall1 - wall0) + 3) % 6 == pytest.approx(3, abs=0.6 * (wall1 - wall0))  # it restarts
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
    assert [log[k][1] for k in ("space", "again", "button")] == [True, False, True]


def test_plots_zoom_hide_and_set_the_time(crank, chromium, tmp_path):
    observation = """
      log.t = mbdae.t;
      log.zoom = mbdae.plots.panes.map(({plot}) => [plot.scales.x.min, plot.scales.x.max]).flat();
    """
    place = "const r = mbdae.plots.panes[1].plot.over.getBoundingClientRect(); log.at = [r.left, r.top, r.width];"
    with chromium.open(f"{animate(crank, tmp_path / 'run.html', fps=20).as_uri()}#t=0&shadows=0", (900, 500)) as tab:
        left, top, width = tab.ask(place)["at"]
        x, y = left + width * np.array([0.25, 0.5, 0.75]), top + 20
        tab.mouse(("Moved", x[1], y), ("Pressed", x[1], y), ("Released", x[1], y))
        log = tab.ask(observation)
        assert log["t"] == pytest.approx(1.0, abs=0.01)
        tab.mouse(("Moved", x[0], y), ("Pressed", x[0], y), ("Moved", x[1], y), ("Moved", x[2], y))
        tab.mouse(("Released", x[2], y))
        log = tab.ask("await wait(0.2);" + observation)
        assert log["zoom"] == pytest.approx([0.5, 1.5] * 4, abs=0.02), "all panes"
        assert log["t"] == pytest.approx(1.0, abs=0.01)
        log = tab.ask("""
          const {plot} = mbdae.plots.panes[1];
          plot.over.dispatchEvent(new MouseEvent("dblclick", {bubbles: true}));
          await wait(0.2);
          plot.root.querySelectorAll(".u-legend .u-label")[1].click();
          log.hidden = plot.series[1].show;
          log.label = plot.ctx.canvas.getAttribute("aria-label");
        """ + observation)
        assert log["zoom"] == pytest.approx([0, 2] * 4)
        assert log["hidden"] is False
        assert log["label"] == "q.slider (m) over time: slider"


def test_an_axis_of_powers_is_labelled_at_each_of_its_lines(crank, chromium, tmp_path):
    drifting = mbdae.solve(crank.mechanism, (0, 5), method="pherk5", rtol=1e-8, project=False)
    page = animate(drifting, tmp_path / "run.html", plots=["q", "v", "kinetic", "g"], fps=20)
    density = "log.density = mbdae.plots.panes.map(({plot}) => plot.data[0].length / plot.bbox.width);"
    labels = "log.labels = mbdae.plots.panes.at(-1).plot.axes[1]._values;"
    log = chromium.ask(page, labels + density, size=(1280, 500))
    assert max(log["density"]) < 4, "uPlot draws as many points per pixel in steps"
    powers = [int(x.replace("1e", "").replace("\N{MINUS SIGN}", "-")) for x in log["labels"]]
    assert (len(powers) >= 4, len(set(np.diff(powers)))) == (True, 1)


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
    script = """
      const box = id => { const r = byId(id).getBoundingClientRect(); return [r.left, r.top, r.right, r.bottom]; };
      for (const id of ["pane", "bar", "plots", "fit", "play"]) log[id] = box(id);
      log.wide = document.documentElement.scrollWidth;
    """
    log = chromium.ask(animate(crank, tmp_path / "run.html", fps=20), script, size=(360, 640))
    assert log["wide"] == 360
    assert log["pane"][3] <= log["bar"][1] + 1 <= log["plots"][1] + 1
    assert log["pane"][3] - log["pane"][1] > 190
    assert log["plots"][3] - log["plots"][1] > 200
    assert all(log[name][2] <= 360 and log[name][3] <= 640 for name in ("bar", "fit", "play"))


def test_the_address_says_how_it_opens(crank, chromium, tmp_path):
    page = animate(crank, tmp_path / "run.html", fps=20)
    observation = """
      log.page = [mbdae.speed, mbdae.t, mbdae.playing, mbdae.loop, mbdae.view.state.view, mbdae.view.state.followed];
      log.bare = document.querySelector("main").className;
      log.legend = byId("legend").textContent;
    """
    said = "t=1.5&speed=0.1&camera=top&follow=crank_pin&plots=0&closures=1&loop=0"
    with chromium.open(f"{page.as_uri()}#{said}") as tab:
        log = tab.ask(observation)
        assert log["page"] == [0.1, 1.5, False, False, "top", "crank_pin"]
        assert (log["bare"], "wrist pin open by up to" in log["legend"]) == ("bare", True)
        tab.evaluate("location.hash = '#camera=3d&autoplay=1&plots=1&closures=0'; 0")
        tab.evaluate("new Promise(done => setTimeout(done, 300))")
        log = tab.ask(observation)
    assert log["page"][2:5] == [True, False, "3d"]
    assert (log["bare"], log["legend"]) == ("", "")


def test_an_open_loop_is_marked(fourbar, chromium, tmp_path):
    opened = motion(fourbar.scene, lambda t: fourbar.q(t) + [0, 0, 0.1])
    for sol, marked in ((motion(fourbar.scene, fourbar.q), ""), (opened, "loop open by up to 0.15 m")):
        with chromium.open(f"{animate(sol, tmp_path / 'run.html', **PLAIN).as_uri()}#t=0.5") as tab:
            assert tab.evaluate("byId('legend').textContent") == marked
            assert tab.evaluate("nodeOf(mbdae.viewer, 'mechanism/closure/loop a/<object>').visible") == bool(marked)


def test_the_command(crank, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    crank.save("run.npz")
    mbdae.solve(crank.mechanism, (0, 2), method="herk3", step=0.02).save("other.npz")

    def call(text):
        return CliRunner().invoke(cli, ["animate", *text.split()])

    result = call("run.npz other.npz -o run.html --plots q.crank,q.crank_pin --plots lam --trace rod_tip --arrows")
    assert result.exit_code == 0, result.exception
    assert result.output == "wrote run.html\n"
    assert len((tmp_path / "run.html").read_bytes()) > 4e5
    for arguments, words in (
        ("run.npz", "-o run.html, a video"),
        ("run.npz -o run.htm", r"must end in \.html"),
        ("run.npz --video run.avi", r"\.mp4 or \.gif"),
        ("run.npz -o b.html --plots nothing", "unknown signal 'nothing'.*valid: q,"),
        ("run.npz -o b.html --arrow nothing", "unknown closure, driver or joint"),
    ):
        with pytest.raises(InputError, match=words):
            raise call(arguments).exception
    assert not (tmp_path / "b.html").exists()
