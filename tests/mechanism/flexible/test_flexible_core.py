"""Flexible bodies in the core, and exact partial derivatives in both back ends."""

import flexible_bodies
import numpy as np
import pytest

from mbdae import backend
from mbdae.mechanism.formulations.equation_partials import equation_partials
from mbdae.mechanism.signals.joint_wrenches import joint_wrenches
from mbdae.mechanism.tree.tree_terms import inverse_dynamics, update_poses


@pytest.fixture(scope="module")
def rigid_and_flexible():
    mech = flexible_bodies.rigid_and_flexible()
    rng = np.random.default_rng(4)
    return mech, *flexible_bodies.state(mech), rng.normal(size=mech.nv), rng.normal(size=mech.ng)


def close(a, b, digits=1e-12):
    np.testing.assert_allclose(a, b, rtol=digits, atol=digits * np.abs(b).max())


def test_both_back_ends_have_the_same_terms(rigid_and_flexible):
    mech, q, v, a, _ = rigid_and_flexible
    core, python = mech.system(native=backend.load()), mech.system()
    M, nle, _, full, _, _ = core.core.dynamics(q, v, a)
    close(M, mech.mass_matrix(q))
    close(nle, mech.bias(q, v))
    close(full, nle + M @ a)
    y = np.concatenate([q, v, [0.0]])
    core.determine_rank(0.0, y)
    for ours, reference in zip(core.core.derivative(0.0, y), python.derivative(0.0, y), strict=True):
        close(ours, reference)
    g, rates, energies = core.residuals(np.zeros(1), y[None])
    close(g[0], python.closures(q)[0])
    close(rates[0], python.closures(q)[1] @ v)
    close(energies[0], python.energy(q, v))


def test_G_and_gamma_are_derivatives_of_g(rigid_and_flexible):
    mech, q, v, _, _ = rigid_and_flexible
    system = mech.system()
    G = system.closures(q)[1]
    close(G, flexible_bodies.tangent_derivatives(mech, lambda x: system.closures(x)[0], q), 1e-9)
    rate = flexible_bodies.derivative(lambda t: system.closures(mech.manifold.integrate(q, t * v))[1] @ v, 0.0)
    close(system.gamma(q, v, 0.0), rate, 1e-9)


@pytest.mark.slow
def test_partials_are_derivatives_of_the_equations(rigid_and_flexible):
    mech, q, v, a, lam = rigid_and_flexible
    system, u = mech.system(), np.concatenate([v, [0.0]])

    def residual(q, v):
        G = system.closures(q)[1]
        update_poses(system.model, system.workspace, q)
        tau, _ = system.generalized_force(0.0, q, v, np.empty(0))
        return tau + G.T @ lam - inverse_dynamics(system.model, system.workspace, q, v, a)

    p = equation_partials(system, 0.0, q, u, a, lam, np.arange(mech.ng))
    close(p.K[:-1], flexible_bodies.tangent_derivatives(mech, lambda x: residual(x, v), q), 1e-9)
    by_v = np.array([flexible_bodies.derivative(lambda s, e=e: residual(q, v + s * e), 0.0) for e in np.eye(mech.nv)]).T
    close(p.D[:-1, :-1], by_v, 1e-9)
    close(p.B, flexible_bodies.tangent_derivatives(mech, lambda x: system.closures(x)[1] @ v, q), 1e-9)


def test_the_core_has_the_same_partials(rigid_and_flexible):
    mech, q, v, a, lam = rigid_and_flexible
    u, core = np.concatenate([v, [0.0]]), mech.system(native=backend.load())
    core.determine_rank(0.0, np.concatenate([q, v, [0.0]]))
    core.expand()
    M, K, D, G, B, _ = core.core.partials(0.0, q, u, a, lam)
    rows = np.array(core.core.rows)
    p = equation_partials(mech.system(), 0.0, q, u, a, lam, np.arange(mech.ng))
    for ours, reference in ((M, p.E[:-1, :-1]), (K, p.K), (D, p.D), (G, p.G[rows]), (B, p.B[rows])):
        close(ours, reference)


def test_wrenches_of_joints_give_their_torques(rigid_and_flexible):
    """Along the axes of a joint they are M v' + nle - G^T lam - forces between frames."""
    mech, q, v, a, lam = rigid_and_flexible
    system = mech.system()
    wrenches = joint_wrenches(system, 0.0, q, v, a, lam)
    joint = mech.model.joints[mech.model.getJointId("b")]
    at = slice(joint.idx_v, joint.idx_v + 3)
    G = system.closures(q)[1]
    update_poses(system.model, system.workspace, q)
    tau, _ = system.generalized_force(0.0, q, v, np.empty(0))
    needed = inverse_dynamics(system.model, system.workspace, q, v, a) - G.T @ lam - tau
    close(wrenches[mech.model.getJointId("b") - 1][3:], needed[at], 1e-11)
