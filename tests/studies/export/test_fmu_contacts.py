"""Impacts of exported mechanisms: events of co-simulation, at the times of a run."""

import numpy as np
import pinocchio as pin
import pytest
from fmu_masters import Master, simulated

import mbdae
from mbdae.mechanism.model_settings import Start

pytestmark = pytest.mark.native
RESTITUTION, END = 0.7, 3.0


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    m = mbdae.load("pendulum_on_stop")
    return mbdae.export(m, tmp_path_factory.mktemp("fmu") / "stop.fmu", kind="cs", method="pherk5", step=1e-2)


def test_impacts_are_events_with_newton_s_restitution(unit):
    """A step ends before the impact; v changes sign in event mode, by the coefficient of restitution."""
    settings = {"use_event_mode": True, "early_return_allowed": True, "record_events": True}
    found = simulated(unit, "cs", END, step_size=1e-2, output_interval=1e-2, **settings)
    first = np.flatnonzero(np.diff(found["time"]) == 0.0)
    sol = mbdae.solve("pendulum_on_stop", (0.0, END), method="pherk5", step=1e-2)
    assert np.abs(found["time"][first] - [x.t for x in sol.impacts if x.t < END]).max() <= 1e-10
    before, after = found["v.rod"][first], found["v.rod"][first + 1]
    assert np.abs(after + RESTITUTION * before).max() <= 1e-12 * np.abs(before).max()
    assert np.abs(found["q.rod"][first] - 0.3).max() <= 1e-12  # the stop
    # falls from 1.2 rad: the speed of the first impact follows from energy, v^2 = 2 g (cos 0.3 - cos 1.2)
    assert before[0] == pytest.approx(-np.sqrt(2 * 9.81 * (np.cos(0.3) - np.cos(1.2))), rel=1e-5)


def test_without_event_mode_the_steps_are_those_of_a_run(unit):
    found = simulated(unit, "cs", END, step_size=1e-2, output_interval=1e-2)
    sol = mbdae.solve("pendulum_on_stop", (0.0, END), method="pherk5", step=1e-2)
    assert found["q.rod"][-1] == pytest.approx(sol.q[-1, 0], abs=1e-10)


def test_states_between_impacts_are_saved(unit):
    master = Master(unit, "cs")
    for k in range(100):
        master.step(k * 1e-2, 1e-2)
    saved = master.fmu.getFMUState()
    ends = []
    for _ in range(2):
        for k in range(100, 150):
            master.step(k * 1e-2, 1e-2)
        ends.append(master.get(*unit.outputs))
        master.fmu.setFMUState(saved)
    assert np.array_equal(*ends)


@pytest.mark.parametrize(
    ("name", "end", "step"),
    [
        ("pendulum_on_stop", 6.0, 1e-2),
        ("stick_slip_slider", 2.0, 1e-3),
        ("ratchet", 2.0, 1e-2),  # a tooth engages where a step begins
        ("woodpecker", 0.2, 1e-3),  # loads that change within a step
    ],
)
def test_modes_change_as_in_a_run(name, end, step, tmp_path):
    """A contact that comes to rest, a joint that sticks and slips; states are saved in any mode."""
    mech = mbdae.load(name)
    outputs = [f"{x}.{joint}" for joint in mech.joint_names for x in "qv"]
    outputs += [f"effort.{c.name}" for c in mech.constraints if not c.frames]  # the joints slip in the end
    unit = mbdae.export(mech, tmp_path / "x.fmu", kind="cs", outputs=outputs, method="pherk5", step=step)
    sol = mbdae.solve(mech, (0.0, end), method="pherk5", step=step)
    assert len(sol.modes) > 3
    master, communications = Master(unit, "cs"), 40
    for k in range(communications):
        master.step(k * end / communications, end / communications)
        if k % 10 == 5:
            saved = master.fmu.getFMUState()
            master.step((k + 1) * end / communications, end / communications)
            master.fmu.setFMUState(saved)
    found, expected = master.get(*unit.outputs), sol.signals()
    np.testing.assert_allclose(found, [expected[x][-1] for x in unit.outputs], rtol=1e-9, atol=1e-9)


def test_a_heavy_block_that_rests_is_no_singular_configuration(tmp_path):
    """Its row is small in the units of the other rows; states are saved in both modes."""
    model = pin.Model()
    for name, joint in (("swing", pin.JointModelRY()), ("lift", pin.JointModelPZ())):
        j = model.addJoint(0, joint, pin.SE3.Identity(), name)
        model.appendBodyToJoint(j, pin.Inertia(1.0, np.array([0.5, 0, 0]), 0.1 * np.eye(3)), pin.SE3.Identity())
        model.addFrame(pin.Frame(f"{name} tip", j, pin.SE3(np.eye(3), np.array([0.5, 0, 0])), pin.FrameType.OP_FRAME))
    block = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "block")
    model.appendBodyToJoint(block, pin.Inertia(1e4, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    flat = mbdae.Closure(kind="in_plane", frames=("lift tip", "swing tip"), name="slide")
    floor = mbdae.Stop(joint="block", lower=0.0, restitution=0.0, name="floor")
    mech = mbdae.Mechanism(model, [flat], stops=[floor], start=Start(q={"block": 0.05}))
    outputs = ["q.swing", "v.swing", "q.block"]
    unit = mbdae.export(mech, tmp_path / "x.fmu", kind="cs", outputs=outputs, method="pherk5", step=1e-2)
    sol = mbdae.solve(mech, (0.0, 1.0), method="pherk5", step=1e-2)
    assert [x.where for x in sol.impacts] == [("floor",)]
    master = Master(unit, "cs")
    for k in range(50):
        master.step(k * 0.02, 0.02)
        if k in (3, 20):
            saved = master.fmu.getFMUState()
            master.step((k + 1) * 0.02, 0.02)
            master.fmu.setFMUState(saved)
    np.testing.assert_allclose(master.get(*outputs), [sol.signals()[x][-1] for x in outputs], atol=1e-9)
