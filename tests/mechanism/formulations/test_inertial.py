"""Partials of the inertial forces, and the expanded tree on which they are computed."""

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, close, random_q, tree

from mbdae import finite_differences
from mbdae.errors import InputError
from mbdae.mechanism.formulations import inverse_dynamics
from mbdae.mechanism.tree.expanded_tree import expand, factor_joints


@pytest.mark.parametrize("kind", JOINTS)
@pytest.mark.parametrize("largest", [0, 100])
def test_inertial_partials_on_every_kind_of_joint(kind, largest, monkeypatch):
    """From Pinocchio, and from large models with nv^2 numbers."""
    monkeypatch.setattr(inverse_dynamics, "MAX_PINOCCHIO_NV", largest)
    model, rng = tree([kind, "rx", kind, kind], [0, 1, 2, 1], seed=1), np.random.default_rng(2)
    model.armature = rng.uniform(0.1, 0.5, model.nv)
    q, (v, a), data = random_q(model, rng), rng.standard_normal((2, model.nv)), model.createData()

    def tau(x, dv=0.0):
        return pin.rnea(model, data, pin.integrate(model, q, x), v + dv, a).copy()

    M, dtau_dq, dtau_dv = inverse_dynamics.InverseDynamicsPartials(model).partials(q, v, a)
    close(dtau_dq, finite_differences.numerical_jacobian(tau, model.nv, 1e-2))
    close(dtau_dv, finite_differences.numerical_jacobian(lambda x: tau(np.zeros(model.nv), x), model.nv, 1e-2))
    U = np.triu(pin.crba(model, data, q))
    close(M, U + np.triu(U, 1).T, 1e-14)


def test_nested_joints_are_expanded():
    """A composite of universal and composite joints; q, J and the poses of bodies are unchanged."""
    inner, outer = pin.JointModelComposite(), pin.JointModelComposite()
    inner.addJoint(pin.JointModelSphericalZYX(), pin.SE3.Random())
    inner.addJoint(pin.JointModelPX(), pin.SE3.Random())
    outer.addJoint(pin.JointModelUniversal(np.array([0, 0, 1.0]), np.array([0, 1.0, 0])), pin.SE3.Random())
    outer.addJoint(inner, pin.SE3.Random())
    model = pin.Model()
    for i in range(2):
        joint = model.addJoint(i, outer, pin.SE3.Random(), f"double {i}")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    out = expand(model)
    assert out.njoints == 1 + 2 * 6
    q, data, other = random_q(model, np.random.default_rng(0)), model.createData(), out.createData()
    close(pin.computeJointJacobians(out, other, q), pin.computeJointJacobians(model, data, q), 1e-14)
    close(other.oMi[12].homogeneous, data.oMi[2].homogeneous, 1e-14)
    flat = tree(["revolute", "free"], [0, 1])
    assert expand(flat) is flat
    with pytest.raises(InputError, match="ellipsoid"):
        factor_joints(pin.JointModel(pin.JointModelEllipsoid(0.1, 0.2, 0.3)))
