"""Every kind of force in a run, in a saved run and in a file."""

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae import (
    Bushing,
    CoulombFriction,
    Function,
    JointDamping,
    JointFriction,
    JointPID,
    JointSpring,
    JointTorque,
    SpringDamper,
    Wrench,
)
from mbdae.errors import InputError, StepError, UnknownNameError
from mbdae.mechanism.time_functions.time_functions import Harmonic, Steps, TimeTable

TABLE = ((-2.0, -9.0), (-0.5, -1.0), (0.0, 0.0), (0.5, 0.2), (2.0, 7.0))
SIX = (40.0, 90.0, 20.0, 3.0, 0.7, 5.0)
WAVE = Harmonic(amplitude=2.0, omega=3.0, phase=0.4, offset=0.7)
CURVE = TimeTable(points=((0.0, 1.0), (0.4, 2.0), (1.0, -1.0), (1.7, 0.0)))


def pull(t, q, v):
    """A nonconservative Python force."""
    return np.array([np.cos(3 * t), 0.1 * v[0], -0.2 * q[0] * v[1]])


ON_FOUR_BAR = {
    "joint_spring": JointSpring(joint=("crank", "rocker"), stiffness=4.0, rest=0.3, damping=0.1),
    "joint_spring, table": JointSpring(joint="rocker", table=TABLE),
    "joint_damping": JointDamping(joint="coupler", damping=0.2),
    "coulomb_friction": CoulombFriction(closure="pin", coefficient=0.4, radius=0.3, velocity=0.5),
    "joint_friction": JointFriction(joint="rocker", friction=0.5, velocity=0.5),
    "joint_torque": JointTorque(joint="crank", torque=Harmonic(amplitude=3.0, omega=5.0)),
    "joint_torque, table": JointTorque(joint="crank", torque=CURVE),
    "joint_torque, steps": JointTorque(joint="crank", torque=Steps(points=((0, 2), (0.3, -3), (0.61, 1)))),
    "joint_torque, bias": JointTorque(joint="rocker", torque=WAVE, gear=0.5, bias=(0.3, -4.0, -0.2)),
    "joint_pid": JointPID(joint="crank", kp=3.0, ki=2.0, kd=0.2, reference=WAVE),
    "joint_pid, sampled": JointPID(joint="crank", kp=3.0, ki=2.0, kd=0.2, rate=20.0),
    "dc_motor": mbdae.DCMotor(joint="crank", voltage=6.0, resistance=1.0, inductance=0.05, constant=0.4, gear=2.0),
    "dc_motor, without inductance": mbdae.DCMotor(joint="crank", voltage=6.0, resistance=1.0, constant=0.4),
    "spring_damper": SpringDamper(
        frames=("world", "coupler_tip"), stiffness=20.0, damping=0.5, length=0.2, force=WAVE
    ),
    "bushing": Bushing(frames=("crank", "rocker"), stiffness=SIX, damping=(0.1,) * 6),
    "wrench": Wrench(frame="coupler_tip", force=(1.0, 0.0, 2.0), torque=(0.0, 0.3, 0.0)),
    "wrench, turning": Wrench(frame="coupler_tip", force=(1.0, WAVE, 2.0), axes="frame"),
    "python": pull,
}
IN_PYTHON = {"coulomb_friction"}  # those that the core does not have
IN_BOTH = {name: force for name, force in ON_FOUR_BAR.items() if name not in IN_PYTHON}


@pytest.mark.parametrize("name", ON_FOUR_BAR)
def test_energy_balance_closes(name, back_end):
    if back_end == "native" and name in IN_PYTHON:
        pytest.skip(f"the core does not have {name}")
    force = ON_FOUR_BAR[name]
    mech = mbdae.load("four_bar", forces=[force])
    sol = mbdae.solve(mech, (0, 0.35), method="pherk6", rtol=1e-12)
    report = mbdae.drift(sol)
    assert sol.success
    free = mbdae.solve(shared_model("four_bar"), (0, 0.35))
    assert np.abs(sol.v[-1] - free.v[-1]).max() > 1e-3  # the force is active
    assert report.energy_relative < 1e-11


def test_every_kind_is_on_the_four_bar():
    kinds = {f.kind for f in ON_FOUR_BAR.values() if f is not pull}
    others = {"fmu"}  # tests/mechanism/fmu
    assert kinds | others == {f.model_fields["kind"].default for f in mbdae.mechanism.forces.FORCES}


@pytest.mark.usefixtures("back_end")
def test_power_of_a_run_is_the_work():
    """The work of one force alone, integrated along a run, against a quadrature of its power."""
    torque = JointTorque(joint="crank", torque=Harmonic(amplitude=3.0, omega=5.0))
    sol = mbdae.solve(mbdae.load("four_bar", forces=[torque]), (0, 1), rtol=1e-11)
    x, w = np.polynomial.legendre.leggauss(10)
    work = 0.0
    for a in np.arange(0, 1, 0.02):
        work += 0.01 * sum(b * 3.0 * np.sin(5.0 * t) * sol(t).v[0] for t, b in zip(a + 0.01 * (x + 1), w, strict=True))
    assert sol.work[-1] == pytest.approx(work, rel=1e-10)


FILE = """
[[body]]
name = "arm"
parent = "world"
axis = [0, 1, 0]
mass = 1.0
com = [0.3, 0, 0]
inertia = [0.01, 0.01, 0.01, 0, 0, 0]
[[force]]
kind = "{}"
{}
"""


def test_every_kind_works_in_a_file_and_in_a_saved_run(tmp_path):
    for name, force in ON_FOUR_BAR.items():
        mech = mbdae.load("four_bar", forces=[force])
        sol = mbdae.solve(mech, (0, 0.1), rtol=1e-4)
        sol.save(tmp_path / "run.npz")
        again = mbdae.Solution.load(tmp_path / "run.npz")
        assert again.mechanism.states == mech.states
        assert mbdae.drift(again).to_dict() == mbdae.drift(sol).to_dict()
        python = force is pull or any(isinstance(s, Function) for s in vars(force).values())
        if python:
            with pytest.raises(InputError, match="not in the file"):
                _ = again.lam
        else:
            np.testing.assert_array_equal(again.lam, sol.lam, err_msg=name)


def test_a_python_function_of_time_is_recorded_by_name(tmp_path):
    def ramp(t):
        return 2.0 * t

    sol = mbdae.solve(mbdae.load("four_bar", forces=[JointTorque(joint="crank", torque=ramp)]), (0, 0.1))
    sol.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz")
    assert mbdae.drift(again).energy_error == mbdae.drift(sol).energy_error
    with pytest.raises(InputError, match="'ramp' is a Python function and not in the file"):
        _ = again.lam


@pytest.mark.usefixtures("back_end")
def test_a_torque_that_falls_with_the_speed_drives_a_continuous_joint():
    """J v' = b_0 + u + b_2 v: the speed approaches (u + b_0)/-b_2 with the time constant J/-b_2."""
    wheel = {"name": "wheel", "parent": "world", "joint": "continuous", "mass": 1.0, "inertia": [1, 1, 0.2, 0, 0, 0]}
    motor = {"kind": "joint_torque", "name": "motor", "joint": "wheel", "torque": 3.0, "bias": [1.0, 0.0, -0.5]}
    sol = mbdae.solve({"body": [wheel], "force": [motor]}, 1.0, rtol=1e-10)
    np.testing.assert_allclose(sol.v[-1], 8.0 * (1 - np.exp(-2.5)), rtol=1e-9)
    with pytest.raises(InputError, match="needs a joint of one coordinate; 'wheel' is continuous: make it revolute"):
        mbdae.load({"body": [wheel], "force": [motor | {"bias": [1.0, -2.0, -0.5]}]})


WRONG = {
    'joint_spring\njoint = "arm"': "takes a stiffness or a table",
    'joint_spring\njoint = "arm"\ntable = [[0, 0], [0, 1]]': "must increase",
    'joint_spring\njoint = "arm"\ntable = [[0, 0]]': "table",
    'joint_spring\njoint = "arm"\ntable = [[0, 0], [1e-320, 1]]': "too large or too close",
    'joint_spring\njoint = "arm"\nstiffness = 1\nstifness = 2': "key force.0.stifness; known: damping",
    'joint_torque\njoint = "arm"\ntorque = {kind = "harmonic", amplitude = 1}': "omega",
    'joint_torque\njoint = "arm"\ntorque = {kind = "harmonic", amplitude = 1, omega = 1, phi = 2}': "amplitude, kind",
    'joint_torque\njoint = "arm"\ntorque = {kind = "sine"}': "sine",
    'joint_torque\njoint = "arm"\ntorque = [1, 2]': "takes 1 torque values, got 2",
    'joint_torque\njoint = "arm"\ntorque = nan': "finite",
    'joint_torque\njoint = "arm"\ntorque = 1\nbias = [1, 2]': "bias",
    'joint_friction\njoint = "arm"\nfriction = -1': "friction",
    'joint_friction\njoint = "leg"\nfriction = 1': "unknown joint 'leg'",
    'joint_spring\njoint = ["arm", "arm"]\ntable = [[0, 0], [1, 1]]': "force.0.joint: joint 'arm' is listed twice",
    'joint_spring\njoint = []\nstiffness = 1': "force.0.joint: at least one joint is needed",
    'joint_damping\njoint = ["arm", "arm"]\ndamping = 1': "joint 'arm' is listed twice",
    'joint_friction\njoint = []\nfriction = 1': "at least one joint is needed",
    'bushing\nframes = ["world", "arm"]\nstiffness = [1, 2, 3]': "stiffness",
    'bushing\nframes = ["world", "arm"]\ndamping = [1, 2, 3, 4, 5, -6]': "must not be negative",
    'bushing\nframes = ["arm", "arm"]': "frames: it joins frame 'arm' with itself",
    'spring_damper\nframes = ["arm", "arm"]\nstiffness = 1': "frames: it joins frame 'arm' with itself",
    'wrench\nframe = "leg"': "unknown frame 'leg'",
    'wrench\nframe = "arm"\naxes = "body"': "axes",
    'joint_pid\njoint = "arm"\nkd = 1\ncontrols = "velocity"': "kd belongs",
    'joint_pid\njoint = "arm"\nkp = 1\nrate = 0': "rate",
    'dc_motor\njoint = "arm"\nvoltage = 1\nresistance = 0\nconstant = 1': "needs a resistance or an inductance",
    'dc_motor\njoint = "arm"\nvoltage = 1\nresistance = 1\nconstant = 1\ngear = 0': "gear is 0 has no torque",
    'spring_damper\nframes = ["world", "arm"]\nforce = "much"': "force",
    "magnet": "magnet",
}


@pytest.mark.parametrize(("text", "words"), WRONG.items())
def test_wrong_files_are_one_line(tmp_path, text, words):
    kind, _, rest = text.partition("\n")
    (tmp_path / "arm.toml").write_text(FILE.format(kind, rest))
    with pytest.raises((InputError, UnknownNameError)) as e:
        mbdae.load(tmp_path / "arm.toml")
    assert words in str(e.value)
    assert "\n" not in str(e.value)


@pytest.mark.usefixtures("back_end")
def test_functions_that_fail_are_named():
    odd = {"nan": lambda t: np.nan, "shape": lambda t: [1, 2], "ZeroDivisionError": lambda t: 1 / 0}
    for words, value in odd.items():
        mech = mbdae.load("four_bar", forces=[JointTorque(joint="crank", torque=Function(function=value, name="odd"))])
        with pytest.raises(StepError, match="'odd'") as e:
            mech.system().derivative(0.0, mech.point())
        assert words in str(e.value)
    with pytest.raises(InputError, match="kd needs the rate of 'sin'"):
        JointPID(joint="crank", kd=1.0, reference=np.sin)
