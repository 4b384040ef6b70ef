"""Linear systems with inputs and outputs, against runs and closed forms."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy import signal

import mbdae
from mbdae import DCMotor, JointDamping, JointPID, JointTorque, Mechanism
from mbdae.__main__ import cli
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.mechanism.time_functions.input_functions import Input
from mbdae.mechanism.time_functions.time_functions import Harmonic


def test_a_mass_on_a_spring_is_scipys():
    """H = 1/(m s^2 + c s + k) of the toggle about its equilibrium."""
    mech = Template("snap_toggle").make({"force.press.force": [0.0, 0.0, 0.0]})
    system = mbdae.linearize(mech, inputs="pin", outputs=["q.pin", "v.pin", "position.pin.z"])
    derivative = 0.5 / np.sqrt(1.25)
    k, c = 2 * 1000 * derivative**2, 2 * 5 * derivative**2
    omega = np.array([1.0, 5.0, 20.0, 100.0])
    expected = 1 / (-(omega**2) + 1j * c * omega + k)
    H = system.response(omega)[:, :, 0]
    np.testing.assert_allclose(H, np.array([expected, 1j * omega * expected, expected]).T, rtol=1e-12)
    assert {name: X.shape for name, X in zip("ABCD", system.matrices, strict=True)}["C"] == (3, 2)


def shaken(forces, name):
    """The double pendulum at rest under these forces, and one of its joints driven by a small signal."""
    mech = mbdae.load("double_pendulum")
    damped = [JointDamping(joint=mech.joint_names[0], damping=0.5), *forces]
    return Mechanism(mech.model, mech.closures, damped, start=mech.start_values)


@pytest.mark.parametrize("kind", ["torque", "reference", "voltage"])
def test_a_run_answers_as_the_linear_system(kind):
    first, second = mbdae.load("double_pendulum").joint_names[:2]
    made = {
        "torque": lambda u: JointTorque(joint=second, torque=u, name="input"),
        "reference": lambda u: JointPID(joint=second, reference=u, kp=30.0, kd=4.0, ki=3.0, name="input"),
        "voltage": lambda u: DCMotor(
            joint=second, voltage=u, resistance=2.0, inductance=0.3, constant=0.7, name="input"
        ),
    }[kind]
    a, omega, T = 1e-4, 3.0, 1.0
    still = shaken([made(0.0)], first)
    rest = mbdae.equilibrium(still)
    system = mbdae.linearize(still, rest.q, inputs="input", outputs=[f"q.{first}", f"q.{second}", f"v.{second}"])
    ends = []
    for sign in (1, -1):
        u = Harmonic(amplitude=sign * a, omega=omega, phase=0.0)
        sol = mbdae.solve(shaken([made(u)], first), (0, T), rest.q, rest.v, s=rest.s, rtol=1e-12, atol=1e-14)
        ends.append(np.array([*(sol.q[-1] - rest.q), sol.v[-1][1]]))
    found = (ends[0] - ends[1]) / (2 * a)
    t = np.linspace(0, T, 40001)
    y = signal.lsim(signal.StateSpace(*system.matrices), np.sin(omega * t), t)[1][-1]
    np.testing.assert_allclose(found, y, atol=2e-6 * np.abs(y).max())


def test_a_joint_and_a_force_of_one_name_are_two_inputs():
    """The force acts through the gear, the torque directly on the joint."""
    mech = mbdae.load("double_pendulum")
    joint = mech.joint_names[1]
    mech = Mechanism(mech.model, (), [JointTorque(joint=joint, torque=0.0, gear=40.0, name=joint)])
    B = mbdae.linearize(mech, {n: 0.0 for n in mech.joint_names}, inputs=[joint, f"{joint} (force)"]).B
    assert np.abs(B).max() > 0
    np.testing.assert_allclose(B[:, 1], 40.0 * B[:, 0], rtol=1e-14)


def test_an_input_acts_in_all_forces_that_have_it():
    """It adds them up; a simulator that sets it accelerates as the system does."""
    mech = mbdae.load("double_pendulum")
    (first, second), u = mech.joint_names[:2], Input(name="u", unit="N m")
    torques = [JointTorque(joint=first, torque=u), JointTorque(joint=second, torque=u, gear=3.0)]
    mech = Mechanism(mech.model, (), torques)
    rest = {first: 0.0, second: 0.0}
    system = mbdae.linearize(mech, rest, inputs=["u", first, second], outputs=f"v.{first}")
    np.testing.assert_allclose(system.B[:, 0], system.B[:, 1:] @ [1.0, 3.0], rtol=1e-14)
    assert system.units == (("rad/s/N/m",) * 3,)
    simulator, h = mbdae.Simulator(mech, q=np.zeros(2), v=np.zeros(2)), 1e-6
    simulator["u"] = 1.0
    simulator.advance(h)
    assert simulator.v[0] / h == pytest.approx((system.C @ system.B)[0, 0], rel=1e-3)


def test_names_that_do_not_exist_are_rejected():
    mech = mbdae.load("snap_toggle")
    with pytest.raises(UnknownNameError, match=r"unknown input 'knee'.*valid: pin, pin\.x"):
        mbdae.linearize(mech, inputs="knee")
    with pytest.raises(UnknownNameError, match="unknown output"):
        mbdae.linearize(mech, outputs="q.knee")


def test_frequencies_without_a_response_are_rejected():
    """A cart is free: at frequency 0 it has no finite response to a force."""
    system = mbdae.linearize(mbdae.load("cart_pole"), inputs="cart", outputs="q.cart")
    with pytest.raises(InputError, match="the response is infinite at 0 rad/s, an eigenvalue of the system"):
        system.response([0.0])
    for wrong in (1.0, [], [np.nan], ["a"], [[1.0, 2.0]], None):
        with pytest.raises(InputError, match="a frequency response takes a list of frequencies, got"):
            system.response(wrong)
    with pytest.raises(InputError, match="a frequency response takes a list of frequencies, got"):
        system.plot(hertz=[])


def test_the_response_is_drawn(tmp_path):
    system = mbdae.linearize(mbdae.load("panda_handle"), inputs="handle", outputs="v.handle")
    system.plot(tmp_path / "response.svg", np.geomspace(0.01, 10, 50))
    assert (tmp_path / "response.svg").stat().st_size > 1000
    assert str(system).endswith("inputs handle, outputs v.handle")


def test_a_response_on_the_command_line(tmp_path):
    """One undamped degree of freedom: gain c / |w_0^2 - w^2|, w_0 the closed form of the four-bar with a spring."""
    written = str(tmp_path / "response.png")
    call = ["linearize", "spring_four_bar", "--inputs", "left", "--outputs", "q.left", "--json", "--plot", written]
    data = json.loads(CliRunner().invoke(cli, call, catch_exceptions=False).stdout)
    gain = np.array(data["gain"])[:, 0, 0]
    share = gain * np.abs(2.14767663850228**2 - (2 * np.pi * np.array(data["hertz"])) ** 2)
    np.testing.assert_allclose(share, share[0], rtol=1e-9)
    assert data["written"] == [written]
    said = CliRunner().invoke(cli, call[:6], catch_exceptions=False)
    assert "q.left / left: gain" in said.stdout


@pytest.mark.parametrize("study", [mbdae.modes, mbdae.linearize, mbdae.equilibrium])
def test_a_time_is_a_finite_number(study):
    for t in (np.inf, np.nan, None, "now"):
        with pytest.raises(InputError, match="t is a time in s, got"):
            study("pendulum", t=t)
