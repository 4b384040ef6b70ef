"""The replay is one offline file that contains the motion, the signals and drawn objects as numbers."""

import base64
import gzip
import re
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
import scenes
import umsgpack
from chains import tree
from scenes import motion

import mbdae
from mbdae.errors import InputError
from mbdae.studies.replay import replay
from mbdae.studies.replay.replay import animate

PLAIN = {"plots": ()}  # for synthetic motions


def unpacked(page, block):
    data = re.search(rf'id="{block}-data">([^<]*)<', page.read_text("utf-8"))[1]
    return gzip.decompress(base64.b64decode(data))


def payload(page):
    return umsgpack.unpackb(unpacked(page, "scene"))


def track(data, path, name, width):
    """The values of a property of a part over the frames, (m, width)."""
    (clip,) = [x["clip"] for x in data["animations"] if x["path"].endswith(path)]
    (found,) = [t["values"] for t in clip["tracks"] if t["name"] == name]
    return np.array(found, float).reshape(-1, width) if isinstance(found, list) else floats(found, width)


def floats(ext, width):
    return np.frombuffer(ext.data, dtype="float32").reshape(-1, width)


@pytest.fixture
def fourbar():
    return scenes.fourbar()


def test_page_is_one_offline_file(fourbar, tmp_path):
    page = animate(motion(fourbar.scene, fourbar.q, title="<b> & co"), tmp_path / "run.html", **PLAIN)
    text = page.read_text("utf-8")
    assert page == tmp_path / "run.html"
    assert [p.name for p in tmp_path.iterdir()] == ["run.html"]
    assert not re.search(r"https?:|wss?:|\ssrc=|\shref=|@import|{{", text)
    assert "default-src 'none'" in text, "the browser is told to fetch nothing"
    assert "<title>&lt;b&gt; &amp; co</title>" in text
    assert b"three.js" in unpacked(page, "viewer").lower() or b"THREE" in unpacked(page, "viewer")
    assert page.stat().st_size < 5e5
    assert "uPlot (MIT License" in text
    again = animate(motion(fourbar.scene, fourbar.q, title="<b> & co"), tmp_path / "again.html", **PLAIN)
    assert again.read_bytes() == page.read_bytes(), "the same motion gives the same file"


def test_motion_is_in_the_solution_s_own_time(fourbar, tmp_path):
    sol = motion(fourbar.scene, fourbar.q, start=1.0, end=5.0)
    data = payload(animate(sol, tmp_path / "run.html", fps=50, **PLAIN))
    assert (data["start"], data["end"], data["speed"], data["frames"]) == (1.0, 5.0, 1.0, 201)
    moved, turns = (track(data, "link/crank link", *what) for what in ((".position", 3), (".quaternion", 4)))
    k = [s.name for s in fourbar.scene.shapes].index("crank link")
    expected = np.array([fourbar.scene.placements(fourbar.q(1 + t))[k] for t in np.arange(201) / 50])
    np.testing.assert_allclose(moved, expected[:, :3], atol=1e-6)
    np.testing.assert_allclose(floats(data["times"], 1)[:, 0], np.arange(201) / 50, atol=1e-6)
    np.testing.assert_allclose(np.abs(np.sum(turns * expected[:, 3:], axis=1)), 1, atol=1e-6)
    assert np.all(np.sum(turns[1:] * turns[:-1], axis=1) > 0.9), "signs without jumps"


def test_slow_motion_stores_more_frames_and_what_rests_one(fourbar, tmp_path):
    sol = motion(fourbar.scene, fourbar.q)
    data = payload(animate(sol, tmp_path / "run.html", fps=30, speed=0.25, **PLAIN))
    moving = {x["path"].removesuffix("/<object>") for x in data["animations"]}
    assert {len(track(data, path, ".quaternion", 4)) for path in moving} == {data["frames"]} == {2 * 30 * 4 + 1}
    placed = {x["path"] for x in data["commands"] if x["type"] == "set_transform"}
    assert moving < placed
    assert any("ground" in path for path in placed - moving)
    long = motion(fourbar.scene, fourbar.q, end=1000.0)
    assert payload(animate(long, tmp_path / "run.html", **PLAIN))["frames"] == replay.MAX_FRAMES


@pytest.mark.slow
def test_a_mesh_is_stored_once(tmp_path):
    panda = mbdae.load("panda_handle")
    still = SimpleNamespace(t=np.zeros(1), q=np.array([pin.neutral(panda.model)]), mechanism=panda, settings={})
    page = animate(still, tmp_path / "run.html", **PLAIN)
    data = payload(page)
    files = {s.mesh for s in panda.scene.shapes if s.mesh is not None}
    objects = [x["object"] for x in data["commands"] if "/visual/" in x["path"] and x["type"] == "set_object"]
    used = [x["geometries"][0]["shared"] for x in objects]
    assert len(set(used)) == len(files) < len(used)
    assert len(data["geometries"]) < len(panda.scene.shapes)
    assert page.stat().st_size < 2.5e6
    assert data["frames"] == 1


def test_wrong_input_is_rejected_by_name_and_leaves_the_file(fourbar, tmp_path):
    path = tmp_path / "run.html"
    path.write_text("precious")
    good = motion(fourbar.scene, fourbar.q)
    empty = motion(fourbar.scene, fourbar.q)
    empty.t, empty.q = np.empty(0), np.empty((0, 3))
    broken = motion(fourbar.scene, lambda t: fourbar.q(t) + (np.nan if t > 1 else 0.0))
    for sol, options, text in (
        (empty, {}, "empty"),
        (broken, {}, "not finite at t = 1"),
        (good, {"fps": 0}, "fps"),
        (good, {"deformation": float("nan")}, "deformation is a factor, a finite number, not nan"),
        (good, {"speed": -1.0}, "speed"),
        (good, {"speed": float("nan")}, "speed"),
    ):
        with pytest.raises(InputError, match=text):
            animate(sol, path, **PLAIN, **options)
    with pytest.raises(InputError, match="missing"):
        animate(good, tmp_path / "missing" / "run.html", **PLAIN)
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(InputError, match="cannot write"):
        animate(good, tmp_path / "folder.html", **PLAIN)
    with pytest.raises(InputError, match=r"\.html, \.mp4, \.gif or \.glb, got"):
        animate(good, tmp_path / "run.pdf", **PLAIN)
    assert path.read_text() == "precious"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.html", "run.html"]


@pytest.mark.slow
def test_nothing_is_printed_and_nothing_left_running(tmp_path):
    code = (
        "import mbdae; from mbdae.studies.replay.replay import animate; mech = mbdae.load('pendulum');"
        f"animate(mbdae.solve(mech, (0, 1), method='herk3'), {str(tmp_path / 'run.html')!r});"
        "import sys; assert not {'meshcat', 'tornado', 'zmq', 'IPython'} & {*sys.modules}"
    )
    # run() waits until the last process that holds its pipes has ended: a server would keep it waiting
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60, check=True)
    assert (done.stdout, done.stderr) == (b"", b"")
    assert (tmp_path / "run.html").exists()


@pytest.fixture(scope="module")
def sol():
    return mbdae.solve(mbdae.load("slider_crank"), (0, 2), rtol=1e-6)


def shown(sol, tmp_path, **options):
    return payload(animate(sol, tmp_path / "run.html", fps=20, **options))


def curves(data, title):
    pane = next(p for p in data["panes"] if p["title"] == title)
    times = lambda c: np.frombuffer(c["t"].data)  # noqa: E731
    return {(c["name"], c["ghost"]): (times(c), floats(c["y"], 1)[:, 0]) for c in pane["curves"]}


def test_default_plots_are_coordinates_energies_and_drift(sol, tmp_path):
    data = shown(sol, tmp_path)
    assert [(p["title"], p["logarithmic"]) for p in data["panes"]] == [
        ("angles (rad), within π", False), ("q.slider (m)", False),
        ("energies (J), potential from its start", False), ("|g| (m, rad)", True),
    ]  # fmt: skip
    mech, at = sol.mechanism, mbdae.mechanism.tree.frames.find_joint(sol.mechanism.model, "slider").idx_q
    t, y = curves(data, "q.slider (m)")["slider", -1]
    np.testing.assert_allclose(y[::100], [sol(x).q[at] for x in t[::100]], atol=1e-6)
    t, g = curves(data, "|g| (m, rad)")["|g|", -1]
    np.testing.assert_array_equal(t, sol.t)  # the drift at the steps, not between them
    np.testing.assert_allclose(g, [np.abs(mech.residual(q, v)[0]).max() for q, v in zip(sol.q, sol.v, strict=True)])
    energies = curves(data, "energies (J), potential from its start")
    assert energies["potential", -1][1][0] == 0
    t, y = energies["kinetic", -1]
    np.testing.assert_allclose(y[::100], [mech.energy(sol(x).q, sol(x).v)[0] for x in t[::100]], rtol=1e-5)
    assert len(t) > 1000, "a curve has no corners at the steps"
    t, y = curves(data, "angles (rad), within π")["crank", -1]
    few = np.flatnonzero(~np.isnan(y))[::20]
    at = mbdae.mechanism.tree.frames.find_joint(mech.model, "crank").idx_q
    np.testing.assert_allclose(np.exp(1j * y[few]), np.exp(1j * np.array([sol(x).q[at] for x in t[few]])), atol=1e-5)
    assert np.nanmax(np.abs(y)) <= np.pi + 1e-6
    assert np.isnan(y).any(), "broken where it jumps"


def test_plots_are_chosen_by_name_and_by_beginning(sol, tmp_path):
    own = {"stroke": lambda t, q, v: 1000 * q[2], "count": np.arange(len(sol.t))}
    plots = ["v", ("q.crank", "kinetic", "potential"), "lam.wrist pin.2", ("stroke",)]
    data = shown(sol, tmp_path, plots=plots, signals=own)
    assert [p["title"] for p in data["panes"]] == [
        "angular velocities (rad/s)", "v.slider (m/s)", "q.crank (rad)", "energies (J)", "lam.wrist pin.2 (N)",
        "stroke", "count",
    ]  # fmt: skip
    assert set(curves(data, "angular velocities (rad/s)")) == {("crank", -1), ("crank_pin", -1)}
    t, y = curves(data, "stroke")["stroke", -1]
    np.testing.assert_allclose(y[::50], [1000 * sol(x).q[2] for x in t[::50]], rtol=1e-5)
    t, y = curves(data, "count")["count", -1]
    np.testing.assert_array_equal((t, y), (sol.t, np.arange(len(t))))


def test_of_many_coordinates_those_that_move_the_most_are_plotted(tmp_path):
    model = tree(["revolute"] * 9, range(9), seed=1)
    data = shown(mbdae.solve(mbdae.Mechanism(model), (0, 0.2), rtol=1e-4), tmp_path)
    title = data["panes"][0]["title"]
    assert title == "angles (rad), 7 of 9 with the largest ranges"
    assert len(curves(data, title)) == 7
    assert not [p for p in data["panes"] if "|g|" in p["title"]], "there are no closures"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"plots": ["crank.q"]}, "unknown signal 'crank.q'.*valid: q, v, lam, lam.wrist pin, .*in all"),
        ({"traces": ["tip"]}, "unknown frame 'tip'.*rod_tip"),
        ({"arrows": ["pin"]}, "unknown closure, driver or joint 'pin'.*wrist pin, crank, "),
        ({"signals": {"a": [1.0, 2.0]}}, r"signal 'a' has shape \(2,\), expected \(\d+,\)"),
        ({"signals": {"a": lambda t, q, v: "x"}}, "signal 'a' must give numbers"),
        ({"signals": {"energy": lambda t, q, v: 0.0}}, "'energy' is a column"),
    ],
)
def test_wrong_names_are_rejected(sol, tmp_path, options, words):
    with pytest.raises(InputError, match=words):
        shown(sol, tmp_path, **options)
    assert not list(tmp_path.iterdir())


def test_a_notebook_is_not_filled_beyond_measure(sol, monkeypatch):
    assert sol._repr_html_().startswith("<iframe srcdoc=")
    monkeypatch.setattr(replay, "MAX_NOTEBOOK_TEXT", 1e5)
    text = sol._repr_html_()
    assert len(text) < 400
    assert "mbdae.animate(sol, 'run.html') writes it" in text


def test_a_short_motion_is_shown_slowly(fourbar, tmp_path):
    paces = {}
    for end in (0.03, 0.5, 1.9, 2.0, 60.0):
        paces[end] = payload(animate(motion(fourbar.scene, fourbar.q, end=end), tmp_path / "a.html", **PLAIN))["speed"]
    assert paces == {0.03: 0.005, 0.5: 0.1, 1.9: 0.2, 2.0: 1.0, 60.0: 1.0}


def test_cameras_are_rejected_by_name(sol, tmp_path):
    with pytest.raises(InputError, match=r"unknown camera 'back'.*valid: front, top, side, 3d"):
        shown(sol, tmp_path, camera="back")
    with pytest.raises(InputError, match=r"unknown body 'bak'.*slider"):
        shown(sol, tmp_path, follow="bak")
