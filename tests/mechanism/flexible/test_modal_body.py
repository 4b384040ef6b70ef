"""A modal body against sums over its points, and its free motion."""

from dataclasses import replace

import flexible_bodies
import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.flexible import ModalBody, attach_flexible
from mbdae.mechanism.flexible.modal_body import Node


@pytest.fixture(scope="module")
def random():
    rng = np.random.default_rng(7)
    q, nu, rate = rng.normal(size=4), rng.normal(size=10), rng.normal(size=10)
    return (*flexible_bodies.points(), flexible_bodies.body(), q, nu, rate)


def rigid(body):
    X = pin.skew(body.s0)
    return np.block([[body.mass * np.eye(3), -X], [X, body.I0]])


def mass(body, q):
    M = body.delta(q)
    M[:6, :6] += rigid(body)
    return M


def test_kinetic_energy_is_that_of_the_points(random):
    r, m, Phi, body, q, nu, _ = random
    d = r + Phi @ q
    u = nu[:3] + np.cross(nu[3:6], d) + Phi @ nu[6:]
    assert nu @ mass(body, q) @ nu == pytest.approx(m @ (u * u).sum(axis=1), rel=1e-13)


def test_displacements_of_second_order_count_in_all_blocks():
    """M(q) of the points, J^T m J with J = [1, -[d]x, Phi + Phi2 q], to second order in q: the rest falls with q^3."""
    rng, (r, m, Phi) = np.random.default_rng(3), flexible_bodies.points(k=3)
    Phi2 = flexible_bodies.second_order(rng, len(m), 3, 0.5)
    body, q = ModalBody.of_points(r, m, Phi, np.ones(3), Phi2=Phi2), rng.normal(size=3)

    def rest(size):
        x = size * q
        d, by_q = r + Phi @ x + Phi2 @ x @ x / 2, Phi + Phi2 @ x
        J = np.concatenate([np.broadcast_to(np.eye(3), (len(m), 3, 3)), -np.array([pin.skew(p) for p in d]), by_q], 2)
        return np.abs(mass(body, x) - np.einsum("n,nai,naj->ij", m, J, J)).max()

    assert rest(1e-2) / rest(5e-3) == pytest.approx(8, rel=0.05)


def test_forces_of_inertia_are_those_of_the_points(random):
    """Mass times classical acceleration of each point, projected on the velocities."""
    r, m, Phi, body, q, nu, rate = random
    d, w, relative = r + Phi @ q, nu[3:6], Phi @ nu[6:]
    a = rate[:3] + np.cross(w, nu[:3]) + np.cross(rate[3:6], d) + Phi @ rate[6:]
    f = m[:, None] * (a + np.cross(w, np.cross(w, d)) + 2 * np.cross(w, relative))
    points = np.concatenate([f.sum(axis=0), np.cross(d, f).sum(axis=0), np.einsum("nak,na->k", Phi, f)])
    p, ours = rigid(body) @ nu[:6], body.inertial_force(q, nu, rate)
    ours[:6] += rigid(body) @ rate[:6]
    ours[:6] += np.concatenate([np.cross(w, p[:3]), np.cross(w, p[3:]) + np.cross(nu[:3], p[:3])])
    np.testing.assert_allclose(ours, points, rtol=1e-12, atol=1e-12 * np.abs(points).max())


@pytest.mark.slow
@pytest.mark.parametrize("second", [0.0, 0.1])
def test_free_motion_keeps_energy_and_momenta(second):
    mech = flexible_bodies.free(flexible_bodies.body(second=second))
    sol = mbdae.solve(mech, (0, 5), *flexible_bodies.state(mech, size=0.2), method="pherk6", rtol=1e-11, atol=1e-12)
    energy = [sum(mech.energy(q, v)) for q, v in zip(sol.q, sol.v, strict=True)]
    assert np.ptp(energy) < 1e-9 * max(energy)
    signals = sol.signals()
    for name in ("momentum", "angular_momentum"):
        size = max(np.abs(signals[f"{name}.{x}"]).max() for x in "xyz")
        assert max(np.ptp(signals[f"{name}.{x}"]) for x in "xyz") < 1e-9 * size
    assert np.abs([signals[f"shaking_force.{x}"] for x in "xyz"]).max() < 1e-9  # nothing acts on a free body


def test_the_weight_acts_on_the_deformed_body():
    """Work of gravity in a motion of all coordinates: the moment of the weight follows the deformation."""
    mech = flexible_bodies.free(flexible_bodies.body(second=0.3), gravity=(1.0, -2.0, 3.0))
    q, _ = flexible_bodies.state(mech)
    zero = np.zeros(mech.nv)
    springs = mech.system().laws.potential
    potential = flexible_bodies.tangent_derivatives(mech, lambda x: mech.energy(x, zero)[1] - springs(x), q)
    np.testing.assert_allclose(mech.bias(q, zero), potential, rtol=1e-10, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"masses": -np.ones(25)}, "masses must not be negative, and not all zero, got -1 kg"),
        (
            {"Phi": np.zeros((25, 3, 3))},
            r"modes: expected finite numbers of shape \(25, 3, 4\), got shape \(25, 3, 3\)",
        ),
        ({"stiffness": np.array([1.0, 2.0, 0.0, 1.0])}, "modes need positive stiffness"),
        ({"Phi": np.ones((25, 3, 4))}, "independent displacements of masses"),
        ({"masses": 1.0}, r"masses: expected finite numbers \(n,\) or \(n, n\), got shape \(\)"),
        ({"masses": np.ones((3, 2))}, r"masses: expected finite numbers \(n,\) or \(n, n\), got shape \(3, 2\)"),
        ({"masses": np.tri(25)}, "the mass matrix must be symmetric"),
        ({"masses": 3.0 - 2 * np.eye(25)}, "no body has these masses, whose kinetic energy could be negative"),
        ({"Phi2": np.full((25, 3, 4, 4), np.nan)}, r"Phi2: expected finite .*, got shape \(25, 3, 4, 4\), not all"),
        ({"Phi2": np.zeros((25, 3, 3, 3))}, r"Phi2: expected finite .*, got shape \(25, 3, 3, 3\)"),
        ({"Phi2": np.ones((25, 3, 1, 1)) * np.tri(4)}, "Phi2 must be symmetric in its modes"),
        ({"damping_ratios": -0.1}, "damping needs one ratio that is not negative, or 4"),
        ({"damping_ratios": (0.1, 0.2)}, r"damping needs .*; got \(0.1, 0.2\)"),
        ({"nodes": {"A": np.zeros(3)}}, "nodes are Node objects by name"),
        (
            {"nodes": {"A": Node(np.zeros(3), np.zeros((3, 2)), np.zeros((3, 4)))}},
            r"'A': Phi: .* \(3, 4\), got shape \(3, 2\)",
        ),
    ],
)
def test_bad_data_is_rejected_in_one_line(change, message):
    r, m, Phi = flexible_bodies.points()
    with pytest.raises(InputError, match=message):
        ModalBody.of_points(**{"r": r, "masses": m, "Phi": Phi, "stiffness": np.ones(4), **change})


def test_names_are_different_and_modes_carry_no_frames():
    model, modal = pin.Model(), flexible_bodies.body()
    attach_flexible(model, "rod", modal, pin.JointModelFreeFlyer())
    with pytest.raises(InputError, match="the name 'rod' is taken"):
        attach_flexible(model, "rod", modal, pin.JointModelFreeFlyer())
    with pytest.raises(InputError, match=r"the name 'bar.mode 1' is taken"):
        attach_flexible(model, "bar", replace(modal, nodes={"mode 1": modal.nodes["A"]}), None)
    model.addFrame(pin.Frame("tip", model.getJointId("rod.mode 1"), pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    with pytest.raises(InputError, match=r"'tip' is on a mode of 'rod': nodes are rod.A, rod.B, rod.C"):
        mbdae.Mechanism(model, [mbdae.Closure.point("tip", "world")])
