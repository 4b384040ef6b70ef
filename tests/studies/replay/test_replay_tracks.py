"""Ghosts, paths, forces, gaps and springs of a replay, as numbers in the page."""

import numpy as np
import pinocchio as pin
import pytest
import scenes
from scenes import motion
from test_replay import PLAIN, curves, floats, payload, shown, track

import mbdae
from mbdae.errors import InputError
from mbdae.studies.replay.animation_tracks import arrows
from mbdae.studies.replay.replay import animate


@pytest.fixture(scope="module")
def sol():
    return mbdae.solve(mbdae.load("slider_crank"), (0, 2), rtol=1e-6)


@pytest.fixture
def fourbar():
    return scenes.fourbar()


def test_ghosts_are_sampled_at_the_same_times_and_vanish_at_their_end(sol, tmp_path):
    short = mbdae.solve(sol.mechanism, (0, 1), method="herk3", step=0.01)
    data = shown(sol, tmp_path, ghosts={"herk3": short})
    assert [ghost["name"] for ghost in data["ghosts"]] == ["herk3"]
    times = np.linspace(0, 2, data["frames"])
    scene = sol.mechanism.scene
    paths = [x["path"] for x in data["animations"] if "ghost 1" in x["path"] and "block" not in x["path"]]
    assert paths
    for path in paths:
        np.testing.assert_array_equal(track(data, path, ".visible", 1)[:, 0], times <= 1)
        k = next(i for i, s in enumerate(scene.shapes) if path.endswith(f"/{s.name}"))
        quaternion, expected = track(data, path, ".quaternion", 4)[40], scene.placements(short(times[40]).q)[k]
        assert abs(quaternion @ expected[3:]) == pytest.approx(1, abs=1e-6)
    assert any(s.name.startswith("ground") for s in scene.shapes)
    assert not [path for path in paths if "/ground" in path], "fixed bodies have no ghost"
    assert ("slider", 0) in curves(data, "q.slider (m)")
    for other, words in ((mbdae.load("four_bar"), "ghost 'x' is of"), (sol.mechanism, "no time in common")):
        with pytest.raises(InputError, match=words):
            shown(sol, tmp_path, ghosts={"x": mbdae.solve(other, (5, 5.1))})


def test_traces_are_the_paths_of_frames(sol, tmp_path):
    page = shown(sol, tmp_path, traces=["rod_tip"])
    (line,) = [x["object"] for x in page["commands"] if x["path"].endswith("trace/rod_tip line") and "object" in x]
    points = floats(line["geometries"][0]["data"]["attributes"]["position"]["array"], 3)
    model, count = sol.mechanism.model, track(page, "trace/rod_tip/<object>", ".count", 1)
    assert count[:, 0].tolist() == [0, len(points) - 1]
    data = model.createData()
    for k in (0, 50, 100):
        pin.framesForwardKinematics(model, data, sol(2 * k / (len(points) - 1)).q)
        np.testing.assert_allclose(points[k], data.oMf[model.getFrameId("rod_tip")].translation, atol=1e-6)


def test_arrows_are_forces_in_newton(tmp_path):
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "mass")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    top = pin.SE3(np.eye(3), np.array([0, 0, 0.1]))
    model.addFrame(pin.Frame("hook", joint, top, pin.FrameType.OP_FRAME))
    turned = pin.SE3(pin.utils.rotate("y", 0.7), top.translation)
    model.addFrame(pin.Frame("ceiling", 0, turned, pin.FrameType.OP_FRAME))
    mech = mbdae.Mechanism(model, closures=[mbdae.Closure.point("ceiling", "hook", name="rope")])
    solved = mbdae.solve(mech, (0, 0.1), method="herk1", step=0.05)
    forces = arrows(solved, True, np.linspace(0, 0.1, 21))
    (rope,) = forces["forces"]
    assert rope["name"] == "rope"
    assert forces["largest"] == pytest.approx(2 * 9.81)
    np.testing.assert_allclose(rope["values"][7], [0, 0, 2 * 9.81], atol=1e-5)
    np.testing.assert_allclose(rope["points"][7], [0, 0, 0.1], atol=1e-6)
    data = shown(solved, tmp_path, arrows=True)
    head = next(x for x in data["commands"] if x["path"].endswith("rope head") and x["type"] == "set_transform")
    size = 0.3 * data["extent"]
    matrix = np.reshape(head["matrix"], (4, 4)).T
    np.testing.assert_allclose(matrix @ [0, 0, 0.5, 1], [0, 0, 0.1 + size, 1], atol=1e-6)  # the tip of the cone
    pendulum = mbdae.load("double_pendulum")
    at_rest = mbdae.solve(pendulum, (0, 0.1), np.zeros(pendulum.nq), np.zeros(pendulum.nv))
    (reaction,) = arrows(at_rest, "joint2", at_rest.t)["forces"]
    weight = 9.81 * pendulum.model.inertias[2].mass
    np.testing.assert_allclose(reaction["values"][1], [0, 0, weight], atol=1e-3)  # almost at rest
    np.testing.assert_allclose(reaction["points"][1], pendulum.frame(at_rest.q[0], "joint2")[0], atol=1e-6)
    with pytest.raises(InputError, match="no closures between frames"):
        shown(mbdae.solve(mbdae.Mechanism(model), (0, 0.1)), tmp_path, arrows=True)


def test_gap_of_an_open_loop_and_end_points_of_a_spring(fourbar, tmp_path):
    opened = motion(fourbar.scene, lambda t: fourbar.q(t) + [0, 0, 0.1])
    (gap,) = payload(animate(opened, tmp_path / "a.html", **PLAIN))["gaps"]
    assert (gap["name"], gap["open"]) == ("loop", pytest.approx(2 * 1.5 * np.sin(0.05)))
    assert gap["paths"] == ["/mechanism/closure/loop a", "/mechanism/closure/loop b"]
    run = mbdae.solve(mbdae.load("spring_four_bar"), (0, 0.5))
    data = payload(animate(run, tmp_path / "a.html"))
    assert [x["path"] for x in data["commands"] if "/spring/" in x["path"] and x["type"] == "set_object"] == [
        "/mechanism/spring/diagonal coil"
    ]
    (spring,) = run.mechanism.scene.springs
    assert spring.length == pytest.approx(2**0.5)
    q = np.array([run(t).q for t in np.linspace(0, 0.5, data["frames"])])
    ends = run.mechanism.scene.end_points([spring], q)[:, 0]
    lengths = track(data, "diagonal coil/<object>", ".morphTargetInfluences[0]", 1)[:, 0] + 1
    np.testing.assert_allclose(lengths * spring.length, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), atol=1e-5)
    assert {b["name"] for b in data["bodies"]} == {"left", "coupler", "right"}
