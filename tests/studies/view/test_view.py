"""Poses over free coordinates: closed over the whole range, dead points of the geometry, shown by a page."""

import json

import numpy as np
import pytest
from browser import Chromium
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError
from mbdae.mechanism.assembly.position_search import close_position
from mbdae.mechanism.tree.frames import find_joint

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


@pytest.mark.slow
def test_arms_reverse_at_dead_points_and_the_others_rest():
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
    expected = found.sliders[0].u - found.sliders[0].u[found.sliders[0].start]
    np.testing.assert_allclose(np.exp(1j * moved[:, k]), np.exp(1j * expected), atol=1e-9)
    assert not np.delete(moved, k, axis=1).any()


MOVE = """
  const inputs = [...document.querySelectorAll(".slider input")];
  const move = (k, share) => { inputs[k].value = share; inputs[k].oninput(); };
  const look = () => ({
    places: PATHS.map(path => nodeOf(mbdae.viewer, path).position.toArray()),
    shares: inputs.map(input => Number(input.value)), said: byId("clock").textContent.replaceAll("\u2212", "-"),
    notes: [...document.querySelectorAll(".slider .note")].map(x => x.textContent), open: mbdae.open,
  });
"""


def page_of(found, folder):
    """The page of a view, and the script that moves it."""
    found.save(folder / "view.html")
    shapes = found.mechanism.scene.shapes
    paths = [f"/mechanism/{s.role}/{s.name.replace('/', '|')}" for s in shapes]
    return folder / "view.html", MOVE.replace("PATHS", json.dumps(paths))


@pytest.mark.slow
def test_a_coordinate_alone_goes_along_the_poses_computed_for_it(tmp_path):
    found = mbdae.view(mbdae.load("delta_robot"))
    page, move = page_of(found, tmp_path)
    robot = found.sliders[1]
    script = f"""{move}
      document.dispatchEvent(new KeyboardEvent("keydown", {{key: " "}}));
      await wait(0.3);
      log.opened = look();
      move(1, 40 / {len(robot.u) - 1});
      log.moved = look();
      log.dead = document.querySelectorAll(".dead").length;
      move(0, 0.3);
      document.querySelector(".back").click();
      log.back = look();
    """
    log = Chromium().ask(page, script, size=(700, 400))
    scene = found.mechanism.scene
    np.testing.assert_allclose(log["opened"]["places"], scene.placements(found.q)[:, :3], atol=1e-4)
    np.testing.assert_allclose(log["moved"]["places"], scene.placements(robot.q[40])[:, :3], atol=1e-4)
    assert log["moved"]["said"] == f"arm_2 = {robot.u[40]:.3f} rad"
    assert log["dead"] == 6
    np.testing.assert_allclose(log["back"]["places"], scene.placements(found.q)[:, :3], atol=1e-4)
    assert log["back"]["shares"] == pytest.approx([s.start / (len(s.u) - 1) for s in found.sliders])


@pytest.mark.slow
@pytest.mark.parametrize(("name", "moves"), [
    ("delta_robot", [(0, 0.1), (1, -0.15), (2, 0.12)]),
    ("stewart_platform", [(0, 0.06), (3, -0.05), (5, 0.04)]),
    ("double_pendulum", [(0, 1.0), (1, -2.0)]),
    ("flyball_governor", [(0, 0.8), (1, 0.02)]),
])  # fmt: skip
def test_several_coordinates_move_together_and_loops_stay_closed(name, moves, tmp_path):
    found = mbdae.view(mbdae.load(name))
    mech = found.mechanism
    page, move = page_of(found, tmp_path)
    wanted = {}
    for k, by in moves:
        s = found.sliders[k]
        near = np.abs(s.u - s.u[s.start] - by) + 1e-6 * np.abs(np.arange(len(s.u)) - s.start)
        wanted[s.joint] = near.argmin()
    shares = {k: wanted[s.joint] / (len(s.u) - 1) for k, s in enumerate(found.sliders) if s.joint in wanted}
    calls = "".join(f"move({k}, {share});" for k, share in shares.items())
    log = Chromium().ask(page, f"{move}{calls}log.pose = look();", size=(700, 400))["pose"]
    assert log["open"] < 1e-9
    assert [log["shares"][k] for k in shares] == pytest.approx(list(shares.values()))
    values = {s.joint: s.u[wanted.get(s.joint, s.start)] for s in found.sliders}
    held, step = [find_joint(mech.model, joint).idx_v for joint in values], np.zeros(mech.nv)
    step[held] = [values[s.joint] - s.u[s.start] for s in found.sliders]
    q = close_position(mech.system(), mech.manifold.integrate(found.q, step), np.array(held), 0.0)
    np.testing.assert_allclose(log["places"], mech.scene.placements(q)[:, :3], atol=1e-6)


def test_a_rail_reaches_as_far_as_its_slider(tmp_path):
    found = mbdae.view(mbdae.load("cart_pole"))
    page, _ = page_of(found, tmp_path)
    script = """
      const rail = nodeOf(mbdae.viewer, "mechanism/rail/cart rail");
      const {min, max} = new MeshCat.THREE.Box3().setFromObject(rail);
      log.ends = [min.x, max.x];
    """
    low, high = Chromium().ask(page, script)["ends"]
    (cart,) = found.sliders
    margin = 7 * found.mechanism.scene.width
    assert (low, high) == pytest.approx((cart.u.min() - margin, cart.u.max() + margin), abs=1e-3)


@pytest.mark.slow
def test_where_loops_cannot_be_closed_a_slider_stops(tmp_path):
    found = mbdae.view(mbdae.load("delta_robot"))
    page, move = page_of(found, tmp_path)
    least = int(found.sliders[0].u.argmin()) / (len(found.sliders[0].u) - 1)
    log = Chromium().ask(page, f"{move} move(1, 0.3); move(0, {least}); log.pose = look();", size=(700, 400))["pose"]
    assert log["notes"][0] == "the loops cannot be closed any further"
    assert log["open"] < 1e-9
    assert log["shares"][0] != pytest.approx(least)


def test_a_notebook_shows_it_and_wrong_input_is_rejected(four_bar, tmp_path):
    assert four_bar.mechanism.view()._repr_html_().startswith("<iframe srcdoc=")
    with pytest.raises(InputError, match=r"\.html, got"):
        four_bar.save(tmp_path / "view.png")
    with pytest.raises(InputError, match="view takes a Mechanism"):
        mbdae.view(3)


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli, ["view", "four_bar", "--json"])
    assert result.exit_code == 0, result.exception
    assert json.loads(result.output)["written"] == ["four_bar.html"]
    assert (tmp_path / "four_bar.html").stat().st_size < 1e6
