"""Exact partials of laws, and the linear element, against difference quotients and hand formulas."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_q, tree

from mbdae import DCMotor, JointDamping, JointPID, JointSpring, JointTorque, Mechanism, Sampled, finite_differences
from mbdae.errors import NotCompiled
from mbdae.mechanism.forces.force import ForceElement
from mbdae.mechanism.formulations.core_description import laws_of
from mbdae.mechanism.time_functions.time_functions import Harmonic, Steps

MODEL = tree(["free", "prismatic", "spherical", "revolute", "continuous"], [0, 1, 2, 3, 2])
A, B, TURN = (n for n in MODEL.names if n.startswith(("prismatic", "revolute", "continuous")))
WAVE = Harmonic(amplitude=2.0, omega=3.0, phase=0.4, offset=0.7)
LINEAR = {
    "damping": [JointDamping(joint=(A, "free_0"), damping=0.7)],
    "spring": [JointSpring(joint=(A, B), stiffness=30.0, rest=0.2, damping=0.4)],
    "torque": [JointTorque(joint="spherical_2", torque=(1.0, WAVE, -2.0), gear=3.0)],
    "PID": [JointPID(joint=A, kp=3.0, ki=2.0, kd=0.2, reference=WAVE)],
    "PI of a velocity": [JointPID(joint=TURN, kp=3.0, ki=2.0, controls="velocity", reference=WAVE)],
    "motor": [DCMotor(joint=TURN, voltage=WAVE, resistance=1.3, inductance=0.05, constant=0.4, gear=2.0)],
    "motor without inductance": [DCMotor(joint=TURN, voltage=WAVE, resistance=1.3, constant=0.4)],
    "held torque": [Sampled(lambda t, q, v, x: (-v[:3], x), rate=10.0, joints="spherical_2", memory={"x": 0.0})],
}
LINEAR["all"] = [force for forces in LINEAR.values() for force in forces]


def system(forces):
    named = [f.model_copy(update={"name": f"{i}"}) if hasattr(f, "kind") else f for i, f in enumerate(forces)]
    return Mechanism(MODEL, forces=named).system()


@pytest.mark.parametrize("forces", LINEAR.values(), ids=LINEAR.keys())
def test_linear_laws_have_exact_partials(forces):
    s, rng = system(forces), np.random.default_rng(1)
    q, v, x = random_q(MODEL, rng, 1.0), rng.uniform(-2, 2, MODEL.nv), rng.uniform(-1, 1, s.ns)
    known = s.laws.partials(0.3, q, v, x)

    def values(e):
        dq, dv, ds = np.split(e, [MODEL.nv, 2 * MODEL.nv])
        return np.concatenate(s.laws.generalized_force(0.3, pin.integrate(MODEL, q, dq), v + dv, x + ds))

    np.testing.assert_allclose(
        known, finite_differences.numerical_jacobian(values, 2 * MODEL.nv + s.ns, 0.01), atol=1e-9
    )
    assert np.abs(known).max() > 0.01


def test_linear_laws_are_one_element():
    """A constant is no function of time, a zero is no entry, and a function is computed once."""
    s = system(LINEAR["all"])
    (law, at), *rest = s.laws.acting
    assert not rest
    assert at == slice(0, s.ns)
    assert [k for _, k in law.u] == [0, 1]  # u and u' of one harmonic
    still = system([JointPID(joint=A, kp=3.0, kd=0.5, reference=2.0), JointTorque(joint=B, torque=1.0, gear=0.0)])
    numbers = laws_of(still.laws)[1][0]
    assert not numbers["signals"]
    assert sorted(numbers["a"]) == [-3.0, -0.5, 6.0]


def test_steps_jump_within_linear_laws():
    s = system([JointTorque(joint=A, torque=Steps(points=((0.0, 1.0), (0.5, 4.0))))])
    at_rest = pin.neutral(MODEL), np.zeros(MODEL.nv), np.empty(0)
    values = [s.laws.generalized_force(t, *at_rest)[0].max() for t in (-1, 0.49, 0.5)]
    assert values == [1.0, 1.0, 4.0]
    assert s.laws.breakpoint(0.0, 1.0) == 0.5


def test_a_law_missing_in_the_core_is_named():
    with pytest.raises(NotCompiled, match="force 'mine' of kind ForceElement"):
        ForceElement("mine").core_data()
