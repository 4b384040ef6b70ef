"""A live view: springs by their formulas, the page moved by sliders and pointer, and what is left at the end."""

import json
import signal
import subprocess
import sys
import time
from time import perf_counter

import numpy as np
import pinocchio as pin
import pytest
from browser import Chromium
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.pulled_point import PulledPoint
from mbdae.studies.live import frame_rate, live_scene
from mbdae.studies.live.frame_rate import FrameRate
from mbdae.studies.live.pulls import FREQUENCY, Pulls

COMMANDS = ("live slider_crank --seconds 0.2",)
READY = "typeof live !== 'undefined' && live.frames > 1 && Object.keys(viewer.gui_controllers).length > 3"
ARM = """
title = "Arm with a motor"
gravity = [0.0, 0.0, 0.0]
[[input]]
name = "motor"
unit = "N m"
[[body]]
name = "arm"
parent = "world"
axis = [0, 1, 0]
mass = 1.0
com = [0.0, 0.0, -0.5]
inertia = [0.02, 0.02, 0.001, 0, 0, 0]
[[force]]
kind = "joint_torque"
joint = "arm"
torque = { input = "motor" }
"""


@pytest.fixture
def arm(tmp_path):
    (tmp_path / "arm.toml").write_text(ARM)
    return mbdae.load(tmp_path / "arm.toml")


def waited(what, seconds=120.0):
    end = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < end, "it does not happen"
        time.sleep(0.02)


def test_a_joint_follows_its_slider_as_a_critically_damped_spring_does(arm):
    pulls = Pulls(arm, arm.start[0], {})
    simulator = mbdae.Simulator(pulls.mechanism)
    pulls.execute({"joint": "arm", "value": 0.5}, simulator, {})
    count = pulls.substeps(0.2)
    for _ in range(count):
        pulls.apply(simulator)
        simulator.advance(0.2 / count)
    wt = FREQUENCY * 0.2
    expected = 0.5 * (1 - (1 + wt) * np.exp(-wt))
    assert simulator.q[0] == pytest.approx(expected, rel=0.03)  # its torque is constant over 5 ms
    sol = simulator.solution()
    again = mbdae.solve(sol.mechanism, (0, 0.2), rtol=1e-10)
    np.testing.assert_allclose(again.q[-1], simulator.q, atol=1e-7)


def test_a_point_is_pulled_by_its_formula():
    model, place = pin.Model(), pin.SE3(np.eye(3), np.array([0.0, 0.0, 1.0]))
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), place, "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    mech = mbdae.Mechanism(model)
    q, v = pin.neutral(model), np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    found = PulledPoint(mech, joint, np.array([0.0, 0.0, 1.0]), q).pull(q, v, np.array([0.0, 0.3, 1.0]), 5.0)
    np.testing.assert_allclose(found.tau, 2.0 * np.array([-10 * 0.1, 25 * 0.3, 0, 0, 0, 0]), atol=1e-12)
    side = PulledPoint(mech, joint, np.array([0.1, 0.0, 1.0]), q).pull(q, 0 * v, np.array([0.1, 0.3, 1.0]), 5.0)
    mass = 1 / (1 / 2.0 + 0.1**2 / (0.4 * 2.0 * 0.1**2))  # of the point across its arm
    force = mass * 25 * 0.3
    np.testing.assert_allclose(side.tau, [0, force, 0, 0, 0, 0.1 * force], atol=1e-12)
    np.testing.assert_allclose(side.point, [0.1, 0, 1])


def test_the_page_is_moved_by_sliders_and_pointer(arm):
    running = mbdae.live(arm, paused=True, ranges={"motor": (-2, 2)})
    with running as view, Chromium().open(view.url, (900, 600), READY) as tab:
        log = tab.ask("""
          log.names = Object.keys(viewer.gui_controllers);
          const {__min, __max} = viewer.gui_controllers["motor (N m)"];
          log.range = [__min, __max];
          viewer.gui_controllers["motor (N m)"].setValue(0.06);
          log.before = live.state.t;
          viewer.gui_controllers["pause or play"].getValue()();
          await wait(1);
          viewer.gui_controllers["pause or play"].getValue()();
          while (live.state.state !== "paused") await wait(0.05);
          log.after = live.state.t;
          const arm = viewer.scene_tree.find(["mechanism", "link", "arm link"]).object;
          log.turn = arm.quaternion.toArray();
          log.at = new MeshCat.THREE.Vector3().setFromMatrixPosition(arm.matrixWorld).project(viewer.camera).toArray();
        """)
        assert log["names"] == ["pause or play", "reset", "motor (N m)", "arm (rad)", "release the joints"]
        assert (log["range"], log["before"]) == ([-2, 2], 0)
        assert log["after"] > 0
        waited(lambda: abs(view.t - log["after"]) < 1e-9)
        turned = 0.5 * 0.06 / (0.02 + 0.25) * view.t**2  # a constant torque
        assert view.q[0] == pytest.approx(turned, rel=1e-6)
        x, y = 450 * (1 + log["at"][0]), 300 * (1 - log["at"][1])
        view.play()
        tab.mouse(("Moved", x, y), ("Pressed", x, y), ("Moved", x + 60, y - 40))
        waited(lambda: view._pulls.line is not None)
        before = view.q[0]
        waited(lambda: abs(view.q[0] - before) > 0.05)
        tab.mouse(("Released", x + 60, y - 40))
        waited(lambda: view._pulls.line is None)
        view.stop()
        waited(lambda: "has ended" in tab.evaluate("document.body.innerText"))


def test_a_slow_page_draws_coarsely(monkeypatch):
    monkeypatch.setattr(frame_rate, "PERIOD", 0.2)
    monkeypatch.setattr(frame_rate, "MIN_FRAME_RATE", 1e4)  # a page that draws fewer counts as slow
    monkeypatch.setattr(live_scene, "COARSE", 600)
    with mbdae.live("slider_crank", speed=0.1) as view:
        before = sum(len(x.faces) for d in view._scene.drawables for x in d.solid.surfaces)
        with Chromium().open(view.url, size=(300, 200), ready="window.viewer && live.frames") as tab:
            waited(lambda: view._scene.coarse)
            waited(lambda: tab.evaluate("live.coarse") is True)
            assert tab.evaluate("viewer.renderer.getPixelRatio()") == 0.5
            waited(lambda: 0 < tab.evaluate("viewer.renderer.info.render.triangles") < before / 2)
            assert view.state == "running"
        after = sum(len(x.faces) for d in view._scene.drawables for x in d.solid.surfaces)
    assert after < 900 < before


def test_only_pages_that_stay_slow_are_slow(monkeypatch):
    rate, t = FrameRate(0.0), perf_counter()
    for k, frames in enumerate((0, 0, 20, 40, 100, 110, 120)):  # no page, two slow seconds, a fast one, two slow ones
        rate.update(t + 1.1 * (k + 1), 0.5 * (k + 1), frames)
        assert not rate.slow
    assert rate.real_time_factor == pytest.approx(0.5 / 1.1)
    rate.update(t + 1.1 * 8, 4.0, 130)
    assert rate.slow
    assert rate.drawn == pytest.approx(10 / 1.1)


def test_what_callers_do_is_checked_in_one_line(arm):
    with mbdae.live(arm, paused=True) as view:
        for act, words in (
            (lambda: view.set("motr", 1.0), "unknown input 'motr'.*motor"),
            (lambda: view.set("motor", float("nan")), "input 'motor' must be a finite number, got nan"),
            (lambda: view.move("leg", 1.0), "unknown joint with a slider 'leg'.*arm"),
            (lambda: view.pull("tip", (0, 0, 0)), "unknown frame 'tip'"),
            (lambda: view.pull("world", (0, 0, 0)), "frame 'world' is fixed and cannot be pulled; valid: arm"),
            (lambda: view.pull("arm", (0, 0)), "a point is three numbers"),
            (lambda: mbdae.live(arm, port=int(view.url.split(":")[2].split("/")[0])), "port .* cannot be used"),
            (lambda: mbdae.live(arm, ranges={"leg": (0, 1)}), "unknown input or joint 'leg'"),
            (lambda: mbdae.live(arm, ranges={"arm": (1, 0)}), "two increasing numbers"),
            (lambda: mbdae.live(arm, speed=0.0), "speed"),
            (lambda: mbdae.live("no_model"), "no_model"),
        ):
            with pytest.raises((InputError, UnknownNameError), match=words):
                act()


def test_a_failed_step_stops_and_leaves_what_was_recorded(arm):
    def breaks(t, q, v):
        return np.full(1, np.nan if t > 0.05 else 0.1)

    view = mbdae.live(mbdae.Mechanism(arm.model, forces=[breaks], title="breaks"), step=1e-3)
    waited(lambda: view.state == "stopped")
    assert "breaks" in view.message
    view.reset()
    waited(lambda: view.t == 0.0)
    assert view.state == "paused"
    (run,) = view.runs
    assert 0.04 < run.t[-1] < 0.06
    assert view.stop().t[-1] == 0.0
    with pytest.raises(InputError, match="has ended"):
        view.play()


@pytest.mark.slow
def test_interrupting_the_command_saves_the_run(tmp_path):
    command = [sys.executable, "-m", "mbdae", "live", "slider_crank", "-o", str(tmp_path / "run.npz")]
    running = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert "http://127.0.0.1:" in running.stdout.readline()
    time.sleep(1.0)
    running.send_signal(signal.SIGINT)
    out, err = running.communicate(timeout=60)
    assert (running.returncode, err) == (0, "")
    assert "simulated" in out
    assert "run.npz" in out
    sol = mbdae.Solution.load(tmp_path / "run.npz")
    assert sol.t[-1] > 0
    assert mbdae.drift(sol).g_max < 1e-8


def test_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(cli, ["live", "four_bar", "--seconds", "0.3", "--json", "-o", "run.npz"])
    assert result.exit_code == 0, result.exception
    data = json.loads(result.output)
    assert (data["status"], data["written"], data["resets"]) == ("finished", ["run.npz"], 0)
    with pytest.raises(UnknownNameError, match="unknown input or joint 'x'"):
        raise CliRunner().invoke(cli, ["live", "four_bar", "--range", "x=0,1"]).exception
