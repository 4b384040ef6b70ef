"""Inputs that FMUs set: runs and simulators continue, saved runs keep their history, wrong uses are named."""

import pickle

import numpy as np
import pytest
from motors import motor
from test_fmu_motion import END, FILE, MASS, STEP, cart, drive
from test_fmu_rejections import message
from valves import FREE, at_instants, cylinder, driven, exact, framed, valve

import mbdae
from mbdae import Driver, Input, JointTorque
from mbdae.mechanism.fmu.session import saved_states
from mbdae.mechanism.time_functions.input_functions import InputHistory

SETTINGS = {"step": STEP / 2, "method": "pherk5"}


def solved(m, *rest):
    return mbdae.solve(m, *rest, **SETTINGS)


def forget():
    """Forget saved states, as another process."""
    saved_states._states.clear()


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("middle", [0.5, 0.53])  # at an instant, and between two
@pytest.mark.parametrize("make", [lambda path: cylinder(path, "first"), driven])
def test_a_run_continues_from_another(make, middle, tmp_path):
    """With inputs of first order, whose present line is in s."""
    m = make(motor(tmp_path))
    whole, first = solved(m, (0, END)), solved(m, (0, middle))
    second = solved(m, (middle, END), first.q[-1], first.v[-1], first.s[-1])
    np.testing.assert_allclose(second.y[-1, :-2], whole.y[-1, :-2], rtol=1e-11)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("hold", ["zero", "first"])
@pytest.mark.parametrize("steps", [50, 51])
def test_a_simulator_continues_from_a_snapshot_bit_by_bit(hold, steps, tmp_path):
    m = cylinder(motor(tmp_path), hold)
    simulator, ends = mbdae.Simulator(m, **SETTINGS), []
    for _ in range(steps):
        simulator.advance(STEP / 2)
    snapshot = pickle.dumps(simulator.save())
    forget()
    for one in (simulator, mbdae.Simulator(m, **SETTINGS)):
        one.restore(pickle.loads(snapshot))
        for _ in range(100 - steps):
            one.advance(STEP / 2)
        ends.append(one._y)
    assert np.array_equal(*ends)
    np.testing.assert_allclose(ends[0][:-2], solved(m, (0, END)).y[-1, :-2], rtol=1e-11)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("simulated", [False, True])
@pytest.mark.parametrize("hold", ["zero", "first"])
def test_a_run_has_the_history_of_the_input(hold, simulated, tmp_path):
    """Its checks and signals are evaluated with it, also from a file, without the FMU; a new run sets it again."""
    path = motor(tmp_path)
    free = JointTorque(joint="cart 0", torque=Input(name="hand", value=0.25), name="pull")
    m = cylinder(path, hold, free)
    sol = solved(m, (0, END))
    if simulated:
        simulator = mbdae.Simulator(m, **SETTINGS)
        for k in range(20):
            simulator.advance((k + 1) * END / 20 - simulator.t)
            if k == 9:
                simulator.save()
        sol = simulator.solution()
    history = sol.mechanism.forces[0].force
    assert isinstance(history, InputHistory)
    assert len(history.pieces) == round(END / STEP)
    free_input = sol.mechanism.forces[-1].torque
    assert isinstance(free_input, InputHistory if simulated else Input)
    sol.save(tmp_path / "run.npz")
    other = mbdae.Solution.load(tmp_path / "run.npz")
    value = np.array([history.at(t) for t in sol.t])
    if hold == "zero" and not simulated:  # an advance and its successor share a time
        np.testing.assert_array_equal(value, sol.signals()["s.motor.input valve"])
    for run in (sol, other):
        np.testing.assert_allclose(run.signals()["force.spring_damper 1"], -value, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(run.signals()["a.cart 0"], (value + 0.25) / MASS, rtol=1e-9, atol=1e-12)
    again = solved(sol.mechanism, (0, END))
    np.testing.assert_allclose(again.y[-1, :-2], sol.y[-1, :-2], rtol=1e-11)
    assert "is not in the file: load the mechanism with it again" in message(lambda: solved(other.mechanism, (0, END)))


def test_runs_of_one_mechanism_have_their_own_inputs(tmp_path):
    """A run in the midst of another one does not change it."""
    m = cylinder(motor(tmp_path), "first")
    simulator = mbdae.Simulator(m, **SETTINGS)
    for _ in range(100):
        simulator.advance(STEP / 2)
        if simulator.t < 0.1:
            solved(m, (0, 0.3))
    np.testing.assert_allclose(simulator._y[:2], exact(*FREE, "first", [0.3, 1.0])[-1], rtol=1e-11)


def test_a_simulator_reads_and_does_not_set_it(tmp_path):
    simulator = mbdae.Simulator(cylinder(motor(tmp_path), "zero"), **SETTINGS)
    simulator.advance(3.5 * STEP)
    assert simulator["valve"] == simulator.signals("s.motor.input valve")[0] != 1.5

    def set_it():
        simulator["valve"] = 1.0

    assert message(set_it) == "input 'valve' is set by FMU 'motor'"


def test_wrong_targets(tmp_path):
    path = motor(tmp_path)
    push = JointTorque(joint="cart 0", torque=Input(name="cart 0"), name="push")
    other = JointTorque(joint="cart 0", torque=Input(name="valve"), name="push")
    unlike = JointTorque(joint="cart 0", torque=Input(name="valve", value=2.0), name="pull")
    moved = Driver(joint="cart 0", motion=Input(name="valve", hold="first"), name="belt")
    twice = valve(path), valve(path, name="second"), other
    for make, words in (
        (lambda: cart(valve(path)), "unknown joint or input of output 'torque' of 'motor' 'valve'"),
        (lambda: cart(valve(path, "valves"), other), "did you mean 'valve'?); valid: cart 0, valve"),
        (lambda: cart(drive(path), push), "'cart 0' is a joint and an input, which needs another name"),
        (lambda: cart(*twice), "input 'valve' is set by an output of 'motor' and of 'second'"),
        (lambda: cart(valve(path), other, unlike), "input 'valve' is given twice, with different settings"),
        (lambda: driven(path, "zero"), "input 'valve' makes its speed jump, an impact: a driver follows"),
        (lambda: framed(valve(path), drivers=[moved]), "driver 'belt': input 'valve' makes its motion jump, an impact"),
    ):
        assert words in message(make)


def test_no_derivatives(tmp_path):
    m = cylinder(motor(tmp_path), "zero")
    sol = solved(m, (0, 0.1))
    words = "force 'motor' is an FMU: runs with it are not differentiable"
    assert words in message(lambda: mbdae.sensitivity(sol, ["force.spring_damper 1.stiffness"]))
    simulator = mbdae.Simulator(m, **SETTINGS)
    simulator.advance(STEP)
    assert words in message(lambda: simulator.tangent())


def test_a_file_names_the_input(tmp_path):
    motor(tmp_path, name="motor.fmu")
    table = '[[input]]\nname = "valve"\nvalue = 1.5\nunit = "N"\n[[force]]\nkind = "joint_torque"\njoint = "cart 0"\n'
    text = FILE.replace('{ torque = "cart 0" }', '{ torque = "valve" }') + table + 'torque = { input = "valve" }\n'
    (tmp_path / "cart.toml").write_text(text)
    sol = solved(mbdae.load(tmp_path / "cart.toml"), (0, END))
    found = at_instants(sol, sol.y[:, :2])
    np.testing.assert_allclose(found, exact(*FREE, "zero", [0.3, 1.0]), rtol=1e-11, atol=1e-12)
