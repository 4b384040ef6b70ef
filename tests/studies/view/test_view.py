"""Poses over free coordinates: closed along the whole way, dead points where geometry says, shown by a page."""

import json

import numpy as np
import pytest
from browser import Chromium
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError
from mbdae.mechanism.frames import find_joint

COMMANDS = ("view four_bar -o out.html",)


def gaps(mech, poses):
    return max(np.abs(mech.residual(q, np.zeros(mech.nv))[0]).max() for q in poses)


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.view(mbdae.load("four_bar"))


def test_a_crank_goes_round_with_its_loop_closed(four_bar):
    (crank,) = four_bar.sliders
    assert (crank.joint, crank.unit, crank.ended, crank.dead_points) == ("crank", "rad", "closed", ())
    assert np.ptp(crank.u) == pytest.approx(2 * np.pi)
    assert gaps(four_bar.mechanism, crank.q) < 1e-9
    np.testing.assert_allclose(crank.q[crank.start], four_bar.q, atol=1e-9)


def test_arms_turn_back_at_dead_points_and_the_others_stand_still():
    found = mbdae.view(mbdae.load("delta_robot"))
    for s in found.sliders:
        assert len(s.dead_points) == 2
        assert (s.u.min(), s.u.max()) == pytest.approx((min(s.dead_points), max(s.dead_points)))
        assert gaps(found.mechanism, s.q[::10]) < 1e-8
        others = [find_joint(found.mechanism.model, o.joint).idx_q for o in found.sliders if o is not s]
        assert np.ptp(s.q[:, others], axis=0).max() < 1e-9, "the others stand still"


def test_a_joint_outside_of_loops_moves_over_its_limits():
    mech = mbdae.load("double_pendulum")
    found = mbdae.view(mech)
    assert [s.joint for s in found.sliders] == list(mech.joint_names)
    k = find_joint(mech.model, "joint1").idx_v
    moved = np.array([mech.manifold.difference(found.q, q) for q in found.sliders[0].q])
    np.testing.assert_allclose(moved[:, k], found.sliders[0].u - found.sliders[0].u[found.sliders[0].start], atol=1e-9)
    assert not np.delete(moved, k, axis=1).any()


def test_the_page_moves_one_coordinate_at_a_time(tmp_path):
    found = mbdae.view(mbdae.load("delta_robot"))
    found.save(tmp_path / "view.html")
    scene, robot = found.mechanism.scene, found.sliders[1]
    paths = [f"/mechanism/{s.role}/{s.name.replace('/', '|')}" for s in scene.shapes]
    script = """
      const places = () => PATHS.map(path => nodeOf(mbdae.viewer, path).position.toArray());
      const inputs = [...document.querySelectorAll(".slider input")];
      inputs[0].value = 0.7;
      inputs[0].oninput();
      inputs[1].value = 40 / COUNT;
      inputs[1].oninput();
      log.places = places();
      log.first = Number(inputs[0].value);
      log.clock = byId("clock").textContent;
      log.dead = document.querySelectorAll(".dead").length;
    """.replace("PATHS", json.dumps(paths)).replace("COUNT", str(len(robot.u) - 1))
    log = Chromium().ask(tmp_path / "view.html", script, size=(700, 400))
    np.testing.assert_allclose(log["places"], scene.placements(robot.q[40])[:, :3], atol=1e-4)
    assert log["first"] == pytest.approx(found.sliders[0].start / (len(found.sliders[0].u) - 1))
    assert log["clock"].replace("−", "-") == f"arm_2 = {robot.u[40]:.3f} rad"  # noqa: RUF001
    assert log["dead"] == 6


def test_a_notebook_shows_it_and_wrong_input_is_refused(four_bar, tmp_path):
    assert four_bar.mechanism.view()._repr_html_().startswith("<iframe srcdoc=")
    with pytest.raises(InputError, match=r"\.html, got"):
        four_bar.save(tmp_path / "view.png")
    with pytest.raises(InputError, match="view takes a Mechanism"):
        mbdae.view("four_bar")


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli, ["view", "four_bar", "--json"])
    assert result.exit_code == 0, result.exception
    assert json.loads(result.output)["written"] == ["four_bar.html"]
    assert (tmp_path / "four_bar.html").stat().st_size < 1e6
