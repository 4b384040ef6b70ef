"""The replay is one offline file, and a browser shows it moving."""

import base64
import gzip
import json
import re
import shutil
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
import scenes
import umsgpack
from PIL import Image
from scenes import motion

import mbdae
from mbdae.errors import InputError
from mbdae.studies.replay import animate

ORANGE = np.array([242, 142, 43])


def unpacked(page, block):
    data = re.search(rf'id="{block}-data">([^<]*)<', page.read_text("utf-8"))[1]
    return gzip.decompress(base64.b64decode(data))


def payload(page):
    return umsgpack.unpackb(unpacked(page, "scene"))


def floats(ext, width):
    return np.frombuffer(ext.data, dtype="float32").reshape(-1, width)


@pytest.fixture
def fourbar():
    return scenes.fourbar()


def test_page_is_one_offline_file(fourbar, tmp_path):
    page = animate(motion(fourbar.scene, fourbar.q, title="<b> & co"), tmp_path / "run.html")
    text = page.read_text("utf-8")
    assert page == tmp_path / "run.html"
    assert [p.name for p in tmp_path.iterdir()] == ["run.html"]
    assert not re.search(r"https?:|wss?:|\ssrc=|\shref=|@import|{{", text)
    assert "default-src 'none'" in text, "the browser is told to fetch nothing"
    assert "<title>&lt;b&gt; &amp; co</title>" in text
    assert b"three.js" in unpacked(page, "viewer").lower() or b"THREE" in unpacked(page, "viewer")
    assert page.stat().st_size < 5e5
    again = animate(motion(fourbar.scene, fourbar.q, title="<b> & co"), tmp_path / "again.html")
    assert again.read_bytes() == page.read_bytes(), "the same motion gives the same file"


def test_motion_is_in_the_solution_s_own_time(fourbar, tmp_path):
    page = animate(motion(fourbar.scene, fourbar.q, start=1.0, end=5.0), tmp_path / "run.html", fps=50)
    data = payload(page)
    assert (data["start"], data["end"], data["speed"]) == (1.0, 5.0, 1.0)
    animation = data["commands"][-1]
    assert animation["type"] == "set_animation"
    assert animation["options"]["repetitions"] == np.inf
    clip = next(a["clip"] for a in animation["animations"] if a["path"].endswith("link/crank link"))
    position, quaternion = clip["tracks"]
    times = floats(position["times"], 1)[:, 0] / clip["fps"]
    np.testing.assert_allclose(times, np.arange(201) / 50, atol=1e-5)
    k = [s.name for s in fourbar.scene.shapes].index("crank link")
    expected = np.array([fourbar.scene.placements(fourbar.q(1 + t))[k] for t in np.arange(201) / 50])
    np.testing.assert_allclose(floats(position["values"], 3), expected[:, :3], atol=1e-6)
    turns = floats(quaternion["values"], 4)
    np.testing.assert_allclose(np.abs(np.sum(turns * expected[:, 3:], axis=1)), 1, atol=1e-6)
    assert np.all(np.sum(turns[1:] * turns[:-1], axis=1) > 0.9), "signs without jumps"


def test_slow_motion_stores_more_frames_and_what_rests_none(fourbar, tmp_path):
    page = animate(motion(fourbar.scene, fourbar.q), tmp_path / "run.html", fps=30, speed=0.25)
    animations = payload(page)["commands"][-1]["animations"]
    tracks = [t for a in animations for t in a["clip"]["tracks"]]
    assert {len(t["times"].data) // 4 for t in tracks} == {2 * 30 * 4 + 1}
    assert not [a["path"] for a in animations if "ground" in a["path"]]


def test_a_mesh_is_stored_once(tmp_path):
    panda = mbdae.load("panda_handle")
    still = SimpleNamespace(t=np.zeros(1), q=np.array([pin.neutral(panda.model)]), mechanism=panda)
    page = animate(still, tmp_path / "run.html")
    data = payload(page)
    files = {s.mesh for s in panda.scene.shapes if s.mesh is not None}
    assert len(data["meshes"]) == len(files) < sum(s.mesh is not None for s in panda.scene.shapes)
    assert page.stat().st_size < 6e6
    assert all(c["type"] != "set_animation" for c in data["commands"]), "one instant does not move"


def test_wrong_input_is_refused_by_name_and_leaves_the_file(fourbar, tmp_path):
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
        (good, {"speed": -1.0}, "speed"),
        (good, {"speed": float("nan")}, "speed"),
    ):
        with pytest.raises(InputError, match=text):
            animate(sol, path, **options)
    with pytest.raises(InputError, match="missing"):
        animate(good, tmp_path / "missing" / "run.html")
    with pytest.raises(InputError, match="cannot write"):
        animate(good, tmp_path)
    assert path.read_text() == "precious"
    assert [p.name for p in tmp_path.iterdir()] == ["run.html"]


def test_nothing_is_printed_and_nothing_left_running(tmp_path):
    code = (
        "import mbdae; from mbdae.studies.replay import animate; mech = mbdae.load('pendulum');"
        f"animate(mbdae.solve(mech, (0, 1), method='herk3'), {str(tmp_path / 'run.html')!r})"
    )
    # run() waits until the last process that holds its pipes has ended: a server would keep it waiting
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60, check=True)
    assert (done.stdout, done.stderr) == (b"", b"")
    assert (tmp_path / "run.html").exists()


@pytest.fixture
def chromium(tmp_path):
    """Runs chromium on a page; the page counts as loaded when its scene stands."""
    found = [shutil.which(n) for n in ("chromium", "chromium-browser", "google-chrome", "chrome")]
    if not any(found):
        pytest.skip("no chromium found")
    program = next(f for f in found if f)
    flags = "--headless --no-sandbox --use-gl=swiftshader --enable-unsafe-swiftshader --window-size=600,400"

    def run(url, *options):
        profile = tmp_path / "profile"
        command = [program, *flags.split(), "--disable-background-networking", f"--user-data-dir={profile}"]
        done = subprocess.run([*command, *options, url], capture_output=True, timeout=120, check=True)
        return done.stdout.decode()

    return run


def shot(chromium, page, t):
    picture = page.with_suffix(".png")
    chromium(f"{page.as_uri()}#t={t}", f"--screenshot={picture}")
    with Image.open(picture) as image:
        return np.asarray(image.convert("RGB"), dtype=int)


def centre(picture, colour, near=60):
    """Mean row and column of the pixels near a colour, shades of it too; fails when there are few."""
    dark = picture / np.maximum(picture.max(axis=2, keepdims=True), 1)
    alike = np.abs(dark - colour / colour.max()).max(axis=2) < near / 255
    bright = picture.max(axis=2) > 90
    rows, columns = np.nonzero(alike & bright)
    assert len(rows) > 30, f"{len(rows)} pixels of {colour}"
    return np.array([rows.mean(), columns.mean()])


def test_browser_shows_the_mechanism_moving(fourbar, chromium, tmp_path):
    page = animate(motion(fourbar.scene, fourbar.q), tmp_path / "run.html")
    first, second = shot(chromium, page, 0.0), shot(chromium, page, 0.5)
    changed = np.abs(first - second).max(axis=2) > 30
    assert 0.005 < changed.mean() < 0.3
    moved = centre(second, ORANGE) - centre(first, ORANGE)
    k = [s.name for s in fourbar.scene.shapes].index("loop a")
    path = [fourbar.scene.placements(fourbar.q(t))[k, :3] for t in (0.0, 0.5)]
    right, up = (path[1] - path[0])[[0, 2]]  # seen from the side of -y
    assert moved[1] / right == pytest.approx(-moved[0] / up, rel=0.25)
    assert moved[1] / right > 50, "pixels per metre"


def test_browser_shows_every_material_of_a_mesh(chromium, tmp_path):
    page = animate(motion(scenes.flag(tmp_path), lambda t: np.array([0.1 * t])), tmp_path / "run.html")
    picture = shot(chromium, page, 0.0)
    columns = [centre(picture, np.array(c))[1] for c in ((255, 0, 0), (0, 255, 0), (0, 0, 255))]
    assert np.diff(columns) == pytest.approx(np.diff(columns)[0], rel=0.3)
    assert columns[1] > columns[0] + 20


def test_browser_plays_in_real_time_and_repeats(fourbar, chromium, tmp_path):
    page = animate(motion(fourbar.scene, fourbar.q, start=3.0, end=9.0), tmp_path / "run.html", speed=2.0)
    probe = """<script>
      const hold = holdLoad(), look = () => [performance.now() / 1000, mbdae.t];
      const wait = seconds => new Promise(done => setTimeout(done, 1000 * seconds));
      (async () => {
        while (!window.mbdae) await wait(0.05);
        await wait(0.3);
        const log = {before: look()};
        await wait(1);
        log.after = look();
        mbdae.seek(8.9);
        log.still = mbdae.t;
        mbdae.play();
        await wait(0.5);
        log.again = mbdae.t;
        log.duration = mbdae.duration;
        document.title = JSON.stringify(log);
        hold();
      })();
    </script></body>"""
    page.write_text(page.read_text("utf-8").replace("</body>", probe))
    title = re.search("<title>(.*?)</title>", chromium(page.as_uri(), "--dump-dom"))[1]
    log = json.loads(title)
    (wall0, t0), (wall1, t1) = log["before"], log["after"]
    assert (t1 - t0) / (wall1 - wall0) == pytest.approx(2.0, rel=0.3)
    assert log["still"] == pytest.approx(8.9)
    assert 3 <= log["again"] < 8
    assert log["duration"] == 6
