"""The tangent map of quaternions, planar and free joints: against finite differences, exponentials, and its order."""

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, random_inertia, random_q, tree
from scipy.linalg import expm

import mbdae
from mbdae import Closure, Mechanism, finite_differences
from mbdae.errors import StepError
from mbdae.mechanism.tree.manifold import Manifold

CURVED = ("spherical", "free", "planar", "composite")
ANGLES = (1e-8, 1e-4, 3e-4, 1e-3, 2e-3, 1e-2, 0.1, 0.5, 1.0, 2.0, 2.9)


def single(kind):
    model = pin.Model()
    joint = model.addJoint(0, JOINTS[kind](np.random.default_rng(0)), pin.SE3.Identity(), kind)
    model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    return model


def increment(model, angle, rng):
    """A tangent vector that rotates the joint by the angle and moves it by some 0.5 m."""
    x = 0.5 * rng.standard_normal(model.nv)
    turn = {"spherical": slice(0, 3), "free": slice(3, 6), "planar": slice(2, 3), "composite": slice(1, 4)}
    s = turn[model.names[1]]
    x[s] *= angle / np.linalg.norm(x[s])
    return x


def bracket(model, x):
    """ad_x, column by column, from Pinocchio's spatial cross product."""
    kind = model.names[1]
    if kind == "spherical":
        return np.array([np.cross(x, e) for e in np.eye(3)]).T
    if kind == "free":
        return np.array([pin.Motion(x).cross(pin.Motion(e)).vector for e in np.eye(6)]).T
    if kind == "planar":
        embed = np.eye(6)[[0, 1, 5]]
        return np.array([pin.Motion(x @ embed).cross(pin.Motion(e)).vector[[0, 1, 5]] for e in embed]).T
    out = np.zeros((5, 5))
    out[1:4, 1:4] = np.array([np.cross(x[1:4], e) for e in np.eye(3)]).T
    return out


def right_jacobian(ad):
    """The integral of exp(-s ad) over s from 0 to 1, from one matrix exponential."""
    n = len(ad)
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[:n, n:] = -ad, np.eye(n)
    return expm(block)[:n, n:]


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("kind", CURVED)
def test_tangent_against_the_exponential(kind, angle):
    model, rng = single(kind), np.random.default_rng(1)
    manifold = Manifold(model)
    for _ in range(5):
        x, v = increment(model, angle, rng), rng.standard_normal(model.nv)
        expected = np.linalg.solve(right_jacobian(bracket(model, x)), v)
        np.testing.assert_allclose(manifold.tangent(x, v), expected, rtol=0, atol=3e-14 * np.abs(expected).max())
        dx = manifold.tangent(x, v)
        np.testing.assert_allclose(manifold.velocity(x, dx), v, rtol=0, atol=3e-14 * (1 + np.abs(dx).max()))


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("kind", CURVED)
def test_tangent_is_the_derivative_of_difference(kind, angle):
    model, rng = single(kind), np.random.default_rng(2)
    manifold = Manifold(model)
    q = random_q(model, rng)
    for _ in range(3):
        x, v = increment(model, angle, rng), rng.standard_normal(model.nv)
        moved = manifold.integrate(q, x)
        rate = finite_differences.numerical_derivative(
            lambda s, q=q, moved=moved, v=v: manifold.difference(q, manifold.integrate(moved, s * v)), 2e-3
        )
        # Pinocchio's logarithm on SE(2) loses half its digits at small angles
        noise = 1e-6 if kind == "planar" else 2e-9
        np.testing.assert_allclose(manifold.tangent(x, v), rate, rtol=0, atol=noise)


@pytest.mark.parametrize("kind", CURVED)
def test_tangent_rate(kind):
    model, rng = single(kind), np.random.default_rng(3)
    manifold = Manifold(model)
    for angle in (1e-3, 0.5, 2.0):
        x, v, dx = increment(model, angle, rng), rng.standard_normal(model.nv), rng.standard_normal(model.nv)
        rate = finite_differences.numerical_derivative(lambda s, x=x, v=v, dx=dx: manifold.tangent(x + s * dx, v), 1e-2)
        np.testing.assert_allclose(manifold.tangent_rate(x, dx, v), rate, rtol=0, atol=1e-8)


def test_constant_velocity_is_a_straight_line():
    model = tree(["free", "spherical", "planar", "revolute", "composite"], [0, 1, 2, 3, 4])
    manifold = Manifold(model)
    v = np.random.default_rng(4).uniform(-1, 1, model.nv)
    np.testing.assert_allclose(manifold.tangent(0.7 * v, v), v, atol=1e-15)
    np.testing.assert_allclose(manifold.velocity(0.7 * v, v), v, atol=1e-15)


def test_a_joint_that_turns_too_far_in_a_step_is_named():
    manifold = Manifold(tree(["revolute", "spherical"], [0, 1]))
    v = np.ones(4)
    manifold.tangent(np.array([100.0, 0, 0, 2.9]), v)
    with pytest.raises(StepError, match="'spherical_1' rotates by more than 3") as caught:
        manifold.tangent(np.array([0.0, 0, 0, 3.1]), v)
    assert caught.value.status == "chart"


def flying_loop():
    """A free base with two arms, one on a spherical joint, the other on two hinges; their hands are joined."""
    rng = np.random.default_rng(5)
    model = pin.Model()
    base = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
    model.appendBodyToJoint(base, random_inertia(rng), pin.SE3.Identity())
    offsets = [0.3, 0, 0], [0.4, 0.1, 0], [-0.3, 0, 0.1], [-0.4, 0.2, 0.1]
    placements = [pin.SE3(np.eye(3), np.array(p)) for p in offsets]
    parents, joints = base, [pin.JointModelSpherical(), pin.JointModelRY(), pin.JointModelRX(), pin.JointModelRZ()]
    for i, (placement, joint) in enumerate(zip(placements, joints, strict=True)):
        parents = model.addJoint(base if i == 2 else parents, joint, placement, f"joint_{i}")
        model.appendBodyToJoint(parents, random_inertia(rng), pin.SE3.Identity())
        if i in (1, 3):
            tip = pin.SE3(np.eye(3), np.array([0.1, 0.6, 0.3]))
            model.addFrame(pin.Frame(f"hand_{i}", parents, tip, pin.FrameType.OP_FRAME))
    return Mechanism(model, [Closure.point("hand_1", "hand_3")])


def distances(mech, runs, reference):
    out = []
    for sol in runs:
        dq = mech.manifold.difference(reference.q[-1], sol.q[-1])
        out.append(max(np.abs(dq).max(), np.abs(reference.v[-1] - sol.v[-1]).max()))
    return np.array(out)


@pytest.fixture(scope="module")
def flight():
    mech = flying_loop()
    rng = np.random.default_rng(6)
    q, v = mech.assemble(random_q(mech.model, rng, 0.3), rng.uniform(-1.5, 1.5, mech.nv))
    return mech, q, v, mbdae.solve(mech, (0, 0.8), q, v, method="pherk6", step=0.8 / 400)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(("method", "order"), [("pherk4", 4), ("pherk5", 5), ("herk5", 5)])
def test_full_order_on_a_flying_chain_with_a_loop(flight, method, order, monkeypatch):
    mech, q, v, reference = flight
    steps = (20, 40, 80)
    errors = distances(
        mech, [mbdae.solve(mech, (0, 0.8), q, v, method=method, step=0.8 / n) for n in steps], reference
    )
    assert (np.log2(errors[:-1] / errors[1:]) > order - 0.25).all(), errors

    monkeypatch.setattr(Manifold, "tangent", lambda self, x, v: v)  # q (+) h sum a V, the obvious formula
    python = {"method": method, "backend": "python"}
    without = distances(mech, [mbdae.solve(mech, (0, 0.8), q, v, step=0.8 / n, **python) for n in steps], reference)
    assert (np.log2(without[:-1] / without[1:]) < 3.5).all(), without
    assert without[-1] > 30 * errors[-1]


@pytest.mark.usefixtures("back_end")
def test_quaternions_stay_normal_and_momentum_is_kept(flight):
    mech, q, v, _ = flight
    mech.model.gravity.linear = np.zeros(3)
    sol = mbdae.solve(mech, (0, 3), q, v, rtol=1e-10)
    data = mech.model.createData()
    momenta = []
    for q_i, v_i in zip(sol.q, sol.v, strict=True):
        pin.computeCentroidalMomentum(mech.model, data, q_i, v_i)
        momenta.append(data.hg.vector.copy())
        assert abs(np.linalg.norm(q_i[3:7]) - 1) < 1e-12
    np.testing.assert_allclose(np.array(momenta) - momenta[0], 0, atol=1e-8)
    assert np.abs(momenta[0]).max() > 0.1


@pytest.mark.parametrize("w", [0.0, 1e-9, 3e-9, 1e-4, 3.0])
def test_a_planar_joint_that_hardly_turns_goes_where_it_should(w):
    """Pinocchio's (1 - cos w)/w is off by eps/w: 5e-8 at w = 1e-9."""
    model = pin.Model()
    model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "planar")
    manifold, q, x = Manifold(model), np.array([0.2, -0.3, np.cos(0.4), np.sin(0.4)]), np.array([1.0, 0.5, w])
    end = manifold.integrate(q, x)
    half = 0.4 + w / 2  # along the chord
    c, s, share = np.cos(half), np.sin(half), np.sinc(w / 2 / np.pi)
    np.testing.assert_allclose(end[:2] - q[:2], share * np.array([c - 0.5 * s, s + 0.5 * c]), atol=5e-16)
    np.testing.assert_allclose(manifold.difference(q, end), x, atol=2e-15)


CIRCLES = [pin.JointModelPlanar, pin.JointModelRUBX,
           lambda: _composite(pin.JointModelPX(), pin.JointModelRUBZ())]  # fmt: skip


def _composite(*parts):
    out = pin.JointModelComposite()
    for part in parts:
        out.addJoint(part, pin.SE3.Identity())
    return out


@pytest.mark.parametrize("joint", CIRCLES)
@pytest.mark.parametrize("w", [1e-12, 1e-9, 1e-8, 1e-4, 3.0])
def test_no_small_turn_is_lost(joint, w):
    """Where rounding puts the cosine between two points above 1, Pinocchio treats them as equal: one time in thirty."""
    model = pin.Model()
    j = model.addJoint(0, joint(), pin.SE3.Identity(), "turns")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    manifold, x = Manifold(model), np.zeros(model.nv)
    x[-1] = w
    for angle in np.linspace(0.0, 6.0, 200):
        q = pin.neutral(model)
        q[-2:] = np.cos(angle), np.sin(angle)
        end = manifold.integrate(q, x)
        np.testing.assert_allclose(manifold.difference(q, end), x, rtol=0, atol=2e-15)


@pytest.mark.usefixtures("back_end")
def test_steps_do_not_depend_on_joint_positions():
    """Errors of step doubling are small rotations; here they alone count."""
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), "turns")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    mech = mbdae.Mechanism(model, forces=[mbdae.JointDamping(joint="turns", damping=0.3)])
    starts = [np.array([np.cos(a), np.sin(a)]) for a in np.linspace(0.0, 6.0, 60)]
    control = {"rtol": 1e-10, "atol": np.array([0.0, 1e3]), "method": "herk4"}
    runs = [mbdae.solve(mech, (0, 1.0), q, np.ones(1), **control) for q in starts]
    assert {sol.stats["rejected"] for sol in runs} == {0}
    assert np.ptp([sol.stats["steps"] for sol in runs]) <= 1


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("w", [0.0, 1e-9, 1e-4])
def test_a_free_body_that_hardly_turns_goes_straight_ahead(w):
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    j = model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "planar")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    v = np.array([np.cos(0.4), -np.sin(0.4), w])
    start = np.array([0.2, -0.3, np.cos(0.4), np.sin(0.4)])
    sol = mbdae.solve(mbdae.Mechanism(model), (0, 1), start, v, step=0.2, method="pherk6")
    np.testing.assert_allclose(sol.q[-1], [1.2, -0.3, np.cos(0.4 + w), np.sin(0.4 + w)], atol=1e-15)
