"""Parameters with constant directions are bound once: other values give the gradients of new mechanisms."""

import numpy as np
import pytest

import mbdae
from mbdae import JointPID, JointSpring, JointTorque, Wrench
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel, parameter_value
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.studies.optimize.objective import run_function

TABLE = {"kind": "table", "points": [(0.0, 1.0), (0.05, 2.0), (0.2, -1.0)]}
MONOTONE = {**TABLE, "interpolation": "monotone", "points": [(0.0, 1.0), (0.05, 2.0), (0.2, 5.0)]}
WAVE = {"kind": "harmonic", "amplitude": 1.0, "omega": 3.0, "offset": 0.2}
FORCES = [
    JointTorque(name="motor", joint="crank", torque=TABLE, gear=2.0),
    JointTorque(name="rising", joint="crank", torque=MONOTONE),
    JointTorque(name="wave", joint="rocker", torque=WAVE),
    JointSpring(name="spring", joint="rocker", stiffness=3.0, rest=0.4),
    JointPID(name="pid", joint="coupler", kp=2.0, ki=1.0, kd=0.1, reference=0.3),
    Wrench(name="wind", frame="rocker_tip", force=(1.0, 0.0, 0.5)),
]
ONCE = {  # models and parameters with constant directions
    "table": ["force.motor.torque.points.0.1", "force.motor.torque.points.1.1", "force.motor.torque.points.2.1"],
    "gear": ["force.motor.gear", "gravity.2"],
    "masses": ["joint.crank.mass", "joint.rocker.mass", "joint.rocker.inertia.0", "gravity.0"],
    "wave": ["force.wave.torque.amplitude", "force.wave.torque.offset"],
    "gains": ["force.pid.kp", "force.pid.ki", "force.pid.kd"],
    "stiffness": ["force.spring.stiffness"],
    "start": ["start.q.crank", "gravity.2"],
}
AGAIN = {  # directions that depend on other values
    "length": ["joint.rocker.xyz.0"],
    "centre": ["joint.rocker.com.0"],
    "times": ["force.motor.torque.points.1.0"],
    "frequency": ["force.wave.torque.omega"],
    "product": ["force.motor.gear", "force.motor.torque.points.1.1"],
    "monotone": ["force.rising.torque.points.1.1"],
    "spring": ["force.spring.stiffness", "force.spring.rest"],
    "not linear": ["force.wind.force.0"],
}
SETTINGS = {"method": "pherk5", "step": 0.02}


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.load("four_bar", forces=FORCES)


def cost(signals):
    end = np.eye(1, len(signals["t"]), len(signals["t"]) - 1)[0]
    x, v = signals["q.crank"][-1], signals["v.rocker"][-1]
    return x * v, {"q.crank": v * end, "v.rocker": x * end}


@pytest.mark.parametrize(("names", "often"), [*((x, 1) for x in ONCE.values()), *((x, 3) for x in AGAIN.values())])
def test_gradients_are_those_of_mechanisms_new_mechanism(four_bar, names, often):
    make = LoadedModel(four_bar)
    run = run_function(make, (0.0, 0.1), SETTINGS)
    first = {name: parameter_value(make, name) for name in names}
    found = []
    for i in (0, 1, 0):  # there and back
        values = {name: x + i * 0.02 * (1 + k) * (abs(x) or 1.0) for k, (name, x) in enumerate(first.items())}
        motion = run(values)
        at = motion.evaluate(cost)
        other = mbdae.load("four_bar", forces=FORCES)
        expected = mbdae.gradient(motion.result, cost, values, model=LoadedModel(other))
        scale = np.abs(list(expected.gradient.values())).max()
        np.testing.assert_allclose(at.derivatives(), list(expected.gradient.values()), rtol=0, atol=1e-10 * scale)
        other_make = LoadedModel(other).make(values)
        np.testing.assert_array_equal(mbdae.solve(other_make, (0.0, 0.1), **SETTINGS).y, motion.result.y)
        found.append(motion.result.y)
    assert motion.parameters.bound == often
    np.testing.assert_array_equal(found[0], found[2])


def test_functions_of_a_motion_share_its_parameters():
    make, name = Template("four_bar"), "joint.rocker.xyz.0"
    run, x = run_function(make, (0.0, 0.1), SETTINGS), parameter_value(make, name)
    first, second = run({name: x}), run({name: x + 0.01})
    derivatives = [motion.evaluate(cost).derivatives() for motion in (first, first, second)]
    assert second.parameters.bound == 2
    np.testing.assert_array_equal(derivatives[0], derivatives[1])
    np.testing.assert_array_equal(first.evaluate(cost).derivatives(), derivatives[0])  # bound again


def test_an_optimum_tells_how_often_parameters_were_bound():
    def least(signals):
        g = signals["gravity.2"]
        return (g + 3.0) ** 2 + 1e-3 * cost(signals)[0], {"gravity.2": 2 * (g + 3.0)} | {
            name: 1e-3 * x for name, x in cost(signals)[1].items()
        }

    found = mbdae.optimize("four_bar", least, {"gravity.2": -9.81}, t_span=(0.0, 0.1), **SETTINGS)
    assert found.bound == found.to_dict()["bound"] == 1
    assert "bound once" in str(found)
