"""The replay of each model: bodies, clock and plots at a time, and that the mechanism fills the scene."""

import numpy as np
import pytest
from browser import Chromium, changed, picture_of

import mbdae
from mbdae.studies.replay.replay import animate, playback_speed

FILLED = ("slider_crank", "spring_four_bar", "andrews_squeezer", "jansen_walker", "stewart_platform", "bicycle",
          "cart_pole", "car_axis", "flyball_governor", "panda_handle", "bouncing_chain", "slider_crank_with_stop",
          "geneva_drive", "ratchet", "stick_slip_slider", "pendulum_on_stop", "woodpecker")  # fmt: skip
SIZES = (1280, 800), (390, 844)
OBSERVE = """
  const canvas = mbdae.viewer.renderer.domElement;
  log.looks = %s.map(t => {
    mbdae.seek(t);
    const scene = canvas.toDataURL(), places = {};
    for (const path of %s) {
      const {position: p, quaternion: r} = nodeOf(mbdae.viewer, path);
      places[path] = [p.x, p.y, p.z, r.x, r.y, r.z, r.w];
    }
    const panes = mbdae.plots.panes.map(({plot, line}) => {
      const {left, width} = line.getBoundingClientRect(), over = plot.over.getBoundingClientRect();
      return (left + width / 2 - over.left) / over.width;
    });
    return {scene, places, panes, t: Number(document.documentElement.dataset.t), clock: byId("clock").textContent};
  });
  log.axis = mbdae.plots.panes.map(({plot}) => [plot.scales.x.min, plot.scales.x.max]);
"""


@pytest.mark.parametrize("name", mbdae.model_names())
def test_cursor_time_is_scene_time_and_the_mechanism_fills_the_scene(name, tmp_path, monkeypatch):
    for constant, coarse in (("plot_panels.POINTS", 100), ("animation_tracks.SMOOTH", np.inf)):
        monkeypatch.setattr(f"mbdae.studies.replay.{constant}", coarse)
    mech = mbdae.load(name)
    end = min(0.5, mech.duration)
    sol = mbdae.solve(mech, (0, end), rtol=1e-4)
    page = animate(sol, tmp_path / "run.html", traces=[mech.model.frames[-1].name])
    assert page.stat().st_size < 2.5e6
    times = [0.0, 0.4 * end, end]
    frames = round(60 * end / playback_speed(sol)) + 1
    scene = mech.scene.for_motion(sol(np.linspace(0, end, max(101, frames)))[0])
    paths = [f"/mechanism/{s.role}/{s.name.replace('/', '|')}" for s in scene.shapes]
    with Chromium().open(f"{page.as_uri()}#shadows=0&autoplay=0", (560, 320)) as tab:
        log = tab.ask(OBSERVE % (times, paths))
        for size in SIZES if name in FILLED else ():
            tab.evaluate(f"mbdae.seek({0.3 * end}); 0")
            tab.resize(size)
            seen = tab.drawn()
            shares = [np.ptp(np.flatnonzero(seen.any(axis=axis))) / seen.shape[1 - axis] for axis in (0, 1)]
            assert 0.5 < max(shares) < 1.0, (size, shares)
    frame = end / 100
    for t, observation in zip(times, log["looks"], strict=True):
        assert observation["t"] == pytest.approx(t, abs=1e-12)
        assert float(observation["clock"].split()[2]) == pytest.approx(t, abs=frame)
        near = [scene.placements(sol(x)[0]) for x in np.clip([t - frame, t, t + frame], 0, end)]
        slack = np.ptp([p[:, :3] for p in near], axis=0) + 1e-5
        seen = np.array([observation["places"][path] for path in paths])
        assert np.all(np.abs(seen[:, :3] - near[1][:, :3]) <= slack)
        turns = np.abs(np.sum(seen[:, 3:] * near[1][:, 3:], axis=1))
        drift = [np.abs(np.sum(near[k][:, 3:] * near[1][:, 3:], axis=1)) for k in (0, 2)]
        assert np.all(turns >= np.minimum(*drift) - 1e-5)
        for (left, right), share in zip(log["axis"], observation["panes"], strict=True):
            assert left + share * (right - left) == pytest.approx(t, abs=end / 100)
    shots = [picture_of(observation["scene"]) for observation in log["looks"]]
    for a, b in ((0, 1), (1, 2), (0, 2)):
        seen = name != "sleeping_top"  # which turns about its axis of symmetry
        assert 1e-4 * seen <= changed(shots[a], shots[b]) < 0.6
