"""Nodes that turn: rotation vectors, motions along paths, and rigid bodies attached to nodes."""

import flexible_bodies
import numpy as np
import pytest
from flexible_bodies import derivative
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

import mbdae
from mbdae.mechanism.flexible.rotation_vector import even_functions, rotation_vector
from mbdae.mechanism.tree.tree_terms import update_motions

SIZES = [1e-9, 1e-3, 0.1, 1.0, 2.5, 4.0]


@pytest.mark.parametrize("size", SIZES)
def test_rotation_vectors(size):
    rng = np.random.default_rng(0)
    theta, rate, z = rng.normal(size=(3, 3))
    theta *= size / np.linalg.norm(theta)
    turn = rotation_vector(theta)
    np.testing.assert_allclose(turn.E, Rotation.from_rotvec(theta).as_matrix(), atol=2e-15)
    spin = turn.E.T @ derivative(lambda s: rotation_vector(theta + s * rate).E, 0.0)
    np.testing.assert_allclose(turn.Jr @ rate, [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-11)
    moved = derivative(lambda s: rotation_vector(theta + s * rate).Jr @ z, 0.0)
    np.testing.assert_allclose(turn.jacobian_partials(z) @ rate, moved, atol=1e-11)
    assert np.linalg.det(turn.Jr) == pytest.approx(2 * turn.functions[0], rel=1e-13)


@pytest.mark.parametrize("x", [1e-3, 0.01, 0.1, 1.0, 3.0])
def test_series_keep_all_digits(x):
    """Against integrals over the exponential of a matrix, exact where closed forms lose digits."""
    a, b, a1, b1 = even_functions(x * x)
    nilpotent = np.diag(np.ones(4), 1)  # blocks of exp of an augmented matrix: phi functions of i x
    A = np.zeros((5, 5), complex)
    A[0, 0] = 1j * x
    phi = expm(A + nilpotent)[0]
    assert a == pytest.approx(phi[2].real, rel=1e-14)
    assert b == pytest.approx(phi[3].real, rel=1e-14)
    first = (1.0, 1.0)  # leading terms of the Taylor series, exact to x^4
    if x <= 0.01:
        assert a1 == pytest.approx(-first[0] / 12 + x * x / 180, rel=1e-10)
        assert b1 == pytest.approx(-first[1] / 60 + x * x / 1260, rel=1e-10)
    else:
        assert a1 == pytest.approx((x * np.sin(x) - 2 * (1 - np.cos(x))) / x**4, rel=1e-9)
        assert b1 == pytest.approx((3 * np.sin(x) - x * (2 + np.cos(x))) / x**5, rel=1e-7)


@pytest.mark.parametrize("size", [0.0, 0.3, 1.5])
def test_velocities_and_accelerations_of_nodes_are_derivatives_of_poses(size):
    mech = flexible_bodies.rigid_and_flexible()
    model, (q, v) = mech.model, flexible_bodies.state(mech, size=0.3 + size)
    a = np.random.default_rng(3).normal(size=mech.nv)
    data = mech.make_workspace()
    at = slice(*(mech.model.joints[model.getJointId(f"rod.mode {i}")].idx_v for i in (1, 3)))
    v[at] *= size

    def poses(t):
        update_motions(model, data, mech.manifold.integrate(q, t * v + t * t / 2 * a))
        return [data.oMi[i].copy() for i in range(model.njoints, len(data.oMi))]

    def twists(t):  # v along this path is v + t a to first order, on any manifold
        x = t * v + t * t / 2 * a
        u = derivative(lambda s: mech.manifold.difference(mech.manifold.integrate(q, x), path(t + s)), 0.0)
        update_motions(model, data, path(t), u, np.zeros(mech.nv))
        return [data.oMi[i].act(data.v[i]).vector for i in range(model.njoints, len(data.oMi))]

    def path(t):
        return mech.manifold.integrate(q, t * v + t * t / 2 * a)

    before = poses(0.0)
    update_motions(model, data, q, v, a)
    V = [data.oMi[i].act(data.v[i]).vector for i in range(model.njoints, len(data.oMi))]
    A = [data.oMi[i].act(data.a[i]).vector for i in range(model.njoints, len(data.oMi))]
    for k, (pose, twist) in enumerate(zip(before, V, strict=True)):
        velocity = derivative(lambda t, k=k: poses(t)[k].translation, 0.0)
        np.testing.assert_allclose(velocity, twist[:3] + np.cross(twist[3:], pose.translation), atol=1e-10)
        spin = derivative(lambda t, k=k: poses(t)[k].rotation, 0.0) @ pose.rotation.T
        np.testing.assert_allclose(twist[3:], [spin[2, 1], spin[0, 2], spin[1, 0]], atol=1e-10)
    changes = derivative(lambda t: np.array(twists(t)), 0.0)
    np.testing.assert_allclose(A, changes, atol=1e-8)


@pytest.mark.parametrize("kind", ["frame", "revolute"])
def test_energy_of_a_body_on_a_rotating_node(kind):
    """Welded or hinged to a node that turns by 0.5 rad; a Jacobian Psi in place of Jr Psi loses 4e-4 of the energy."""
    mech = flexible_bodies.free(flexible_bodies.body(turn=0.5), more=[(kind, "A")])
    q, v = mech.assemble(None, np.random.default_rng(2).normal(size=mech.nv))
    sol = mbdae.solve(mech, (0, 1), q, v, method="pherk6", rtol=1e-10, atol=1e-11)
    assert sol.stats["backend"] == "native"
    energy = [sum(mech.energy(a, b)) for a, b in zip(sol.q, sol.v, strict=True)]
    assert np.ptp(energy) < 1e-8 * max(energy)
    assert max(np.abs(mech.residual(a, b)[0]).max() for a, b in zip(sol.q, sol.v, strict=True)) < 1e-10
    angle = max(np.linalg.norm(mech.model.flexible[0].modal.nodes["A"].Psi @ x[7:11]) for x in sol.q)
    assert angle > 0.3
