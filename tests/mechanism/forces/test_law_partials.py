"""Exact partial derivatives of every kind of force, and of Python laws, against differences of order six."""

import sys

import numpy as np
import pinocchio as pin
import pytest
from chains import close, random_q, tree
from mechanism.forces.test_force_runs import ON_FOUR_BAR

import mbdae
from mbdae import (
    Actuator,
    Bushing,
    Closure,
    Driver,
    Function,
    JointPID,
    JointTorque,
    Mechanism,
    Sampled,
    finite_differences,
)
from mbdae.errors import StepError
from mbdae.mechanism.forces import FORCES, PYTHON_FORCES
from mbdae.mechanism.forces.force import ForceElement, PairElement
from mbdae.mechanism.forces.linear import LinearElement
from mbdae.mechanism.formulations.equation_partials import equation_partials, time_partials

MIXED = ["free", "revolute", "spherical", "universal", "planar", "prismatic", "continuous", "composite", "helical"]
PARENTS = [0, 1, 2, 3, 1, 5, 0, 7, 8]
SHAKE = {"kind": "harmonic", "amplitude": 3.0, "omega": 2.0, "phase": 0.4}
TABLE = ((-2.0, 5.0), (-1.0, -1.0), (0.0, 1.0), (1.0, 2.0), (2.5, 9.0))


def kinds_of_forces():
    """One or more forces of every kind, by class name."""
    one = {
        "JointSpring": [
            {"joint": "revolute_1", "stiffness": 3.0, "rest": 0.2, "damping": 0.4},
            {"joint": "helical_8", "table": TABLE, "damping": 2.0},
        ],
        "FMU": [
            {"file": "motor.fmu", "recorded": True, "step": 0.1, "outputs": {"a": "revolute_1", "b": "planar_4.vx"}}
        ],
        "JointDamping": [{"joint": ("spherical_2", "planar_4"), "damping": 0.7}],
        "JointFriction": [{"joint": ("revolute_1", "planar_4"), "friction": 0.7, "velocity": 0.5}],
        "JointTorque": [
            {"joint": "planar_4", "torque": (1.0, SHAKE, -2.0), "gear": 2.0},
            {"joint": "prismatic_5", "torque": SHAKE, "gear": 2.0, "bias": (0.4, -3.0, -0.6)},
        ],
        "JointPID": [
            {"joint": "revolute_1", "reference": SHAKE, "kp": 5.0, "ki": 2.0, "kd": 1.0},
            {"joint": "prismatic_5", "reference": 1.0, "kp": 5.0, "controls": "velocity"},
            {"joint": "prismatic_5", "reference": 1.0, "kp": 5.0, "ki": 1.0, "rate": 100.0},
        ],
        "DCMotor": [
            {"joint": "continuous_6", "voltage": SHAKE, "resistance": 2.0, "inductance": 0.3, "constant": 0.7},
            {"joint": "revolute_1", "voltage": 5.0, "resistance": 2.0, "constant": 0.7},
        ],
        "SpringDamper": [
            {"frames": ("tip_3", "tip_5"), "stiffness": 30.0, "damping": 4.0, "length": 0.4, "force": SHAKE},
            {"frames": ("tip_8", "ground"), "stiffness": 30.0},
        ],
        "Bushing": [
            {"frames": ("tip_3", "tip_5"), "stiffness": (1, 2, 3, 4, 5, 6), "damping": (0.5, 0.4, 0.3, 0.2, 0.1, 0.6)},
            {"frames": ("tip_7", "world"), "stiffness": (1, 2, 3, 4, 5, 6)},
        ],
        "Wrench": [
            {"frame": "tip_3", "force": (1.0, 2.0, -3.0), "torque": (0.3, SHAKE, 0.1)},
            {"frame": "tip_5", "force": (1.0, SHAKE, -3.0)},
            {"frame": "tip_8", "force": (1.0, SHAKE, -3.0), "torque": (0.3, 0.2, 0.1), "axes": "frame"},
        ],
    }  # fmt: skip
    described = {c.__name__: [c(**table) for table in one.get(c.__name__, [])] for c in FORCES}
    held = Sampled(lambda t, q, v: -v[:2], rate=10.0, joints=("revolute_1", "prismatic_5"))
    return {**described, "Sampled": [held], "Actuator": [motor()], "function": [swirl]}


def swirl(t, q, v):
    return np.sin(np.arange(1.0, len(v) + 1) + t) * (1 + v**2) * np.cos(q[0]) - 0.3 * np.roll(v, 1)


def motor(partials=None):
    def torque(t, q, v, s):
        return np.r_[s[0] * np.cos(s[1]) - v[1], np.sin(q[1]) * np.ones(len(v) - 1)]

    def rate(t, q, v, s):
        return np.array([-5 * s[0] + s[1] * v[0], np.sin(s[0]) - 2 * s[1] + v[2]])

    return Actuator(torque, rate, start={"a": 0.4, "b": -0.2}, name="motor", partials=partials)


def samples(name):
    """Mechanisms with a force of a class, by its name: on a tree of all joints, and on the four-bar."""
    found = [moving([force]) for force in kinds_of_forces()[name]]
    found += [mbdae.load("four_bar", forces=[f]) for f in ON_FOUR_BAR.values() if type(f).__name__ == name]
    assert found, f"{name} has no sample: add one to ON_FOUR_BAR in tests/mechanism/forces/test_force_runs.py"
    return found


def test_a_force_without_a_sample_is_named(monkeypatch):
    """A class that discovery finds and that has no sample."""

    class Unsampled(mbdae.JointDamping):
        pass

    monkeypatch.setattr(sys.modules[__name__], "FORCES", (*FORCES, Unsampled))
    assert "Unsampled" in kinds_of_forces()
    with pytest.raises(AssertionError, match="Unsampled has no sample"):
        samples("Unsampled")


def test_every_python_force_has_a_sample():
    assert {c.__name__ for c in PYTHON_FORCES} <= kinds_of_forces().keys()


def test_every_law_has_partials():
    """Linear laws have them jointly, those between frames as partials of their wrenches."""

    def below(c):
        return [x for sub in c.__subclasses__() for x in (sub, *below(sub))]

    for c in below(ForceElement):
        if c.__module__.startswith("mbdae") and c is not PairElement and not issubclass(c, LinearElement):
            base, name = (PairElement, "wrench_partials") if issubclass(c, PairElement) else (ForceElement, "partials")
            assert getattr(c, name) is not getattr(base, name), c


def moving(forces):
    return Mechanism(tree(MIXED, PARENTS, seed=2), [], forces)


def law_differences(mech, q, v, s, t):
    """Partials of (tau, s', power) with respect to (q, v, s)."""
    system = mech.system()

    def at(x):
        nv = mech.nv
        moved = pin.integrate(mech.model, q, x[:nv])
        pin.computeJointJacobians(system.model, system.workspace, moved)
        return np.concatenate(system.laws.generalized_force(t, moved, v + x[nv : 2 * nv], s + x[2 * nv :]))

    expected = finite_differences.numerical_jacobian(at, 2 * mech.nv + len(s), 1e-3)
    pin.computeJointJacobians(system.model, system.workspace, q)
    return system.laws.partials(t, q, v, s), expected


@pytest.mark.parametrize("name", kinds_of_forces())
def test_partials_of_every_kind_of_force(name):
    rng = np.random.default_rng(8)
    for mech in samples(name):
        for _ in range(2):
            q, v, s = random_q(mech.model, rng, 0.8), *(rng.standard_normal(n) for n in (mech.nv, len(mech.states)))
            close(*law_differences(mech, q, v, s, 0.32), 1e-9 if name in ("function", "Actuator") else 1e-11)


def test_partials_of_bushings_at_small_and_large_rotations():
    for angle in (0.0, 1e-9, 1e-4, 0.1, 2.9):
        model = pin.Model()
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
        model.addFrame(pin.Frame("tip", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
        mech = Mechanism(model, [], [Bushing(frames=("world", "tip"), stiffness=(1, 2, 3, 4, 5, 6), damping=(1,) * 6)])
        q = pin.integrate(model, pin.neutral(model), np.array([0.1, 0.2, 0.3, *(angle * np.array([0.6, 0.0, 0.8]))]))
        close(*law_differences(mech, q, np.arange(6.0), np.empty(0), 0.0))


def test_all_forces_and_closures_together():
    """K, D, G, B of a point with partials of v', lam and states; dependent rows are left out."""
    forces = [f for name, some in kinds_of_forces().items() for f in some if name not in ("function", "Actuator")]
    closures = [Closure.revolute("tip_3", "tip_5", (0.3, -0.5, 0.8)), Closure.distance("ground", "tip_8", 0.7)]
    mech, rng = Mechanism(tree(MIXED, PARENTS, seed=2), closures, forces), np.random.default_rng(3)
    s, nv, rows = mech.system(), mech.nv, np.array([0, 2, 3, 5])
    n = nv + len(mech.states) + 1
    q, (vdot, x), lam = random_q(mech.model, rng, 0.8), rng.standard_normal((2, n)), rng.standard_normal(4)
    vdot, u = vdot[:nv], x

    def at(e, du=0.0):
        moved, v = pin.integrate(mech.model, q, e), u + du
        pin.computeJointJacobians(s.model, s.workspace, moved)
        tau, rates = s.generalized_force(0.3, moved, v[:nv], v[nv:-1])
        G = s.jacobian()[rows]
        return np.concatenate([tau + lam @ G - pin.rnea(s.model, s.workspace, moved, v[:nv], vdot), rates, G @ u[:nv]])

    found = equation_partials(s, 0.3, q, u, vdot, lam, rows)
    close(np.vstack([found.K, found.B]), finite_differences.numerical_jacobian(at, nv, 1e-3))
    close(found.D, finite_differences.numerical_jacobian(lambda du: at(np.zeros(nv), du), n, 1e-3)[:n])
    np.testing.assert_allclose(found.E @ np.r_[vdot, np.ones(n - nv)], np.r_[mass(mech, q) @ vdot, np.ones(n - nv)])
    np.testing.assert_array_equal(found.G, s.jacobian(q)[rows])


def mass(mech, q):
    M = pin.crba(mech.model, mech.model.createData(), q)
    return np.triu(M) + np.triu(M, 1).T


def test_functions_can_provide_their_partials():
    calls = []

    def brake(t, q, v):
        return -2.0 * v**3

    def partials(t, q, v):
        calls.append(t)
        return np.hstack([np.zeros((len(v), len(v))), np.diag(-6.0 * v**2)])

    brake.partials = partials
    mech = Mechanism(tree(["rx", "rx", "rx"], [0, 1, 2]), [], [brake])
    v = np.array([0.3, -0.5, 2.0])
    close(*law_differences(mech, np.zeros(3), v, np.empty(0), 0.5))
    assert calls == [0.5]
    mech = moving([motor(lambda t, q, v, s: np.ones((mech.nv + 2, 2 * mech.nv + 2)))])
    s = mech.system()
    assert (s.laws.partials(0.0, *mech.start, np.ones(2))[:-1] == 1).all()
    with pytest.raises(StepError, match="partials of actuator 'motor' returned shape"):
        moving([motor(lambda t, q, v, s: np.ones(3))]).system().laws.partials(0.0, *mech.start, np.ones(2))


def test_partials_of_a_function_that_returns_the_same_array_each_time():
    kept = np.empty(3)

    def brake(t, q, v):
        kept[:] = -2.0 * v
        return kept

    mech = Mechanism(tree(["rx", "rx", "rx"], [0, 1, 2]), [], [brake])
    found = mech.system().laws.partials(0.0, np.zeros(3), np.array([0.3, -0.5, 2.0]), np.empty(0))
    assert np.allclose(found[:3], np.hstack([np.zeros((3, 3)), -2.0 * np.eye(3)]))


def test_time_partials():
    """Of laws with functions of time, including Python functions with and without a given rate, and of drivers."""
    forces = [force for some in kinds_of_forces().values() for force in some]
    forces += [JointTorque(joint="revolute_1", torque=Function(function=np.sin, rate=np.cos))]
    forces += [JointTorque(joint="revolute_1", torque=np.cos)]
    forces += [JointPID(joint="revolute_1", kp=1.0, kd=2.0, reference=wave())]
    drivers = [Driver.polynomial("prismatic_5", (0.1, 0.2, 0.3, 0.4, 0.5)), Driver.harmonic("helical_8", 0.7, 3.0)]
    mech, rng = Mechanism(tree(MIXED, PARENTS, seed=2), [], forces, drivers=drivers), np.random.default_rng(6)
    s, q, v = mech.system(), random_q(mech.model, rng, 0.8), rng.standard_normal(mech.nv)
    states, lam = rng.standard_normal(len(mech.states)), rng.standard_normal(2)

    def at(x, t=0.3):
        pin.computeJointJacobians(s.model, s.workspace, q)
        tau, rates = s.generalized_force(t + x[0], q, v, states)
        rates[-1] -= lam @ s.g_t(t + x[0])
        return np.concatenate([tau, rates, s.g_t(t + x[0]), s.gamma(q, v, t + x[0])])

    close(
        np.concatenate(time_partials(s, 0.3, q, v, states, lam)),
        finite_differences.numerical_jacobian(at, 1, 1e-3)[:, 0],
        1e-9,
    )


def wave():
    return Function(function=np.sin, rate=np.cos, acceleration=lambda t: -np.sin(t))
