"""Derivatives with respect to parameters against differences of order six of the equations' terms."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_q, tree

from mbdae import Bushing, Closure, Driver, JointFriction, JointPID, Mechanism, SpringDamper, Wrench
from mbdae.errors import InputError
from mbdae.finite_differences import WEIGHTS
from mbdae.mechanism.discrete_sensitivity.parameter_partials import Parameters
from mbdae.mechanism.formats.mechanism_file.template import Template

KINDS = ["free", "revolute", "spherical", "universal", "planar", "prismatic", "continuous", "composite", "euler"]
PARENTS = [0, 1, 2, 3, 1, 5, 0, 7, 8]
VALUES = {
    "mass": 1.3, "com": 0.2, "inertia": 0.1, "armature": 0.2, "gravity": -9.81, "reach": 0.4, "tilt": 0.0, "arm": 0.3,
    "foot": 0.5, "turn": 0.3, "length": 0.8, "ratio": -1.5, "amplitude": 0.4, "stiffness": 30.0, "damping": 2.0,
    "rest": 0.2, "kp": 5.0, "force": 3.0, "steep": 0.5,
}  # fmt: skip


def swirl(t, q, v):
    return np.sin(q[0] + t) * v


def make(values):
    """A tree of nine kinds of joints with rows and various forces; parameters of all its components."""
    x = {**VALUES, **values}
    model = tree(KINDS, PARENTS, seed=2)
    model.inertias[5] = pin.Inertia(x["mass"], np.array([0.1, x["com"], -0.1]), np.diag([x["inertia"], 0.2, 0.15]))
    model.armature = np.full(model.nv, 0.1) + x["armature"] * np.arange(model.nv)
    model.gravity.linear = np.array([1.0, 0.5, x["gravity"]])
    for j, (reach, tilt) in {4: (x["reach"], 0.3), 8: (0.1, x["tilt"]), 3: (-x["reach"], 2 * x["tilt"])}.items():
        model.jointPlacements[j] = pin.SE3(pin.rpy.rpyToMatrix(0.4, tilt, -0.7), np.array([reach, 0.2, 0.1]))
    for name, size in {"tip_3": x["arm"], "ground": x["foot"], "tip_8": 0.2}.items():
        frame = model.frames[model.getFrameId(name)]
        frame.placement = pin.SE3(pin.rpy.rpyToMatrix(x["turn"], 0.2, x["turn"]), np.array([size, 0.1, size**2]))
    closures = [
        Closure.revolute("tip_3", "tip_5", (0.3, -0.5, 0.8)),
        Closure.distance("ground", "tip_8", x["length"]),
        Closure.coupling("revolute_1", "prismatic_5", (0.1, x["ratio"], 0.7)),
    ]
    driver = {"kind": "harmonic", "amplitude": x["amplitude"], "omega": 2.0, "offset": 1.0}
    forces = [
        SpringDamper(frames=("tip_3", "ground"), stiffness=x["stiffness"], damping=x["damping"], length=x["rest"]),
        Bushing(frames=("tip_7", "tip_8"), stiffness=(1, 2, 3, 4, 5, x["stiffness"]), damping=(0.5,) * 6),
        JointPID(joint="revolute_1", kp=x["kp"], ki=2.0, reference=1.0),
        Wrench(frame="tip_8", force=(x["force"], 1.0, 2.0), torque=(0.1, 0.2, x["force"]), axes="frame"),
        JointFriction(joint="revolute_1", friction=0.7, velocity=x["steep"]),
        swirl,
    ]
    return Mechanism(model, closures, forces, drivers=[Driver(frames=("tip_7", "tip_5"), motion=driver)])


def terms(mech, t, q, v, s, vdot, lam):
    system = mech.system()
    (g, G), gamma = system.closures(q, t), system.gamma(q, v, t)
    pin.computeJointJacobians(system.model, system.workspace, q)
    tau, rates = system.generalized_force(t, q, v, s)
    rates[-1] -= lam @ system.g_t(t)
    f = tau + lam @ G - pin.rnea(system.model, system.workspace, q, v, vdot)
    return np.concatenate([f, rates]), G @ v + system.g_t(t), g, gamma


def partials(parameters, t, q, v, s, vdot, lam):
    rows = parameters.row_partials(t, q, v)
    return parameters.force_partials(t, q, v, s, vdot, lam), *rows, parameters.bias_partials(t, q, v)


@pytest.mark.parametrize("name", VALUES)
def test_partials_of_every_sort_of_parameter(name):
    parameters, rng = Parameters(make, {name: VALUES[name]}), np.random.default_rng(4)
    mech, h = parameters.mech, 3e-3 * (abs(VALUES[name]) or 1.0)
    q, lam, s = random_q(mech.model, rng, 0.8), rng.standard_normal(mech.ng), rng.standard_normal(len(mech.states))
    point = (0.3, q, rng.standard_normal(mech.nv), s, rng.standard_normal(mech.nv), lam)
    found = partials(parameters, *point)
    at = {k: terms(make({name: VALUES[name] + k * h}), *point) for k in (-3, -2, -1, 1, 2, 3)}
    largest = 0.0
    for i, (ours, what) in enumerate(zip(found, ("P", "Q", "g", "gamma"), strict=True)):
        expected = sum(w / h * (at[k][i] - at[-k][i]) for k, w in WEIGHTS.items())
        size = max(np.abs(expected).max(), 1.0)
        np.testing.assert_allclose(ours[:, 0], expected, rtol=0, atol=2e-11 * size, err_msg=what)
        largest = max(largest, np.abs(expected).max())
    assert largest > 1e-3


def test_parameters_of_files():
    """Dotted names, several at a time; a placement that violates redundant rows has no derivative."""
    values = {"joint.crank.mass": 1.0, "joint.rocker.xyz.0": 2.5, "frame.coupler_tip.xyz.0": 2.0, "gravity.2": -9.81}
    parameters = Parameters(Template("four_bar").make, values)
    q, v = parameters.mech.start
    parameters.require_consistent(0.0, q)
    P, Q, g, _ = partials(parameters, 0.0, q, v, np.empty(0), np.ones(3), np.ones(3))
    assert (np.abs(np.vstack([P, Q, g])).max(axis=0) > 0.1).all()
    assert not g[:, 0].any()
    across = Parameters(Template("four_bar").make, {"joint.rocker.rpy.0": 0.0})
    with pytest.raises(InputError, match=r"'joint\.rocker\.rpy\.0' violates redundant closures"):
        across.require_consistent(0.0, q)


def test_what_changes_more_than_numbers_is_rejected():
    with pytest.raises(InputError, match="'N' changes joints"):
        Parameters(lambda x: Mechanism(tree(["rx"] * round(100 * x["N"]), range(round(100 * x["N"])))), {"N": 1.0})
