"""Pixels of a replay: springs stay complete, marks are small."""

from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import numpy as np
from browser import Chromium
from scenes import motion

import mbdae
from mbdae.studies.replay.replay import animate


def test_in_a_frame_of_slides_the_address_says_how_it_opens_and_nothing_is_fetched(tmp_path):
    animate(mbdae.solve(mbdae.load("slider_crank"), (0, 2)), tmp_path / "run.html", fps=10)
    frame = '<iframe src="run.html#speed=0.1&camera=front&shadows=0" width="640" height="360"></iframe>'
    (tmp_path / "slide.html").write_text(frame)
    asked = []

    class Served(SimpleHTTPRequestHandler):
        def log_message(self, *_):
            asked.append(self.path)

    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Served, directory=str(tmp_path)))
    Thread(target=server.serve_forever, daemon=True).start()
    address = f"http://127.0.0.1:{server.server_port}/slide.html"
    with Chromium().open(address, (700, 400), ready="frames[0] && frames[0].mbdae") as tab:
        log = tab.ask("""
          const {mbdae, document: page, performance: clock} = frames[0];
          log.opened = [mbdae.speed, mbdae.view.state.view, mbdae.playing];
          const main = page.querySelector("main");
          log.cut = [...main.querySelectorAll("#pane, #bar button, #bar select, #plots, .u-wrap, .u-title")]
            .filter(x => x.offsetParent && x.getBoundingClientRect().right > 641).map(x => x.id || x.className);
          log.fetched = clock.getEntriesByType("resource").map(x => x.name).filter(x => !/^(data|blob):/.test(x));
        """)
    server.shutdown()
    server.server_close()
    assert log["opened"] == [0.1, "front", True]
    assert (log["cut"], log["fetched"]) == ([], [])
    assert [path for path in asked if "favicon" not in path] == ["/slide.html", "/run.html"]


def test_a_stretched_spring_stays_whole(tmp_path):
    import pinocchio as pin

    from mbdae.mechanism.scene.make_scene import make_scene
    from mbdae.mechanism.scene.scene import Strut

    model, still = pin.Model(), pin.SE3.Identity()
    model.addJoint(0, pin.JointModelPX(), still, "slide")
    for drawing in ({"coil": True}, {"coil": False, "tube": True}, {"coil": True, "tube": True}):
        scene = make_scene(model, springs=[Strut("pull", (0, still), (1, still), 0.2, **drawing)])
        page = animate(motion(scene, lambda t: np.array([0.1 + t])), tmp_path / "run.html", plots=())
        with Chromium().open(f"{page.as_uri()}#t=0&camera=front&shadows=0", (900, 300)) as tab:
            for t in (0.0, 0.5, 2.0):
                tab.evaluate(f"mbdae.seek({t}); 0")
                columns = np.flatnonzero(tab.drawn().any(axis=0))
                assert (np.diff(columns) == 1).all(), (drawing, t)
                scale = tab.evaluate("mbdae.view.camera.right - mbdae.view.camera.left")
                assert np.ptp(columns) / 900 * scale >= 0.99 * (0.1 + t)


def test_the_mark_of_an_impact_does_not_hide_the_bodies(tmp_path):
    """Also if the camera follows a body, so that the scene is much smaller than the whole path."""
    sol = mbdae.solve(mbdae.load("woodpecker"), (0, 0.5), rtol=1e-5)
    page = animate(sol, tmp_path / "run.html", fps=50, speed=0.2)
    hardest = max(sol.impacts, key=lambda x: max(x.impulse, default=0.0))
    picture = Chromium().shot(page, hardest.t + 0.03, plots=0)
    orange = (picture[..., 0] - picture[..., 2] > 60).mean()
    assert 0 < orange < 0.012, orange
