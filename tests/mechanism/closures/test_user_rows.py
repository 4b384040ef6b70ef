"""Rows defined by a Python function, against equivalent closures, and invalid functions."""

import warnings

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae import Closure, Mechanism
from mbdae.errors import InputError
from mbdae.mechanism.model_settings import Start

LENGTH = 0.5


def planar():
    """A sleigh whose centre of mass is ahead of its edge."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), "sleigh")
    inertia = pin.Inertia(2.0, np.array([0.4, 0, 0]), np.diag([0.1, 0.2, 0.3]))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("edge", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return model


def bob():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "bob")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return model


def length(p):
    n = np.linalg.norm(p)
    return n - LENGTH, p / n


def length_partials(p):
    n = np.linalg.norm(p)
    return (np.eye(3) - np.outer(p, p) / n**2) / n


def across(q):
    """No slip across: the sleigh's velocities are along and across it, and its turn."""
    return np.array([0.0, 1.0, 0.0])


def test_an_edge_slides_as_its_closure():
    start = Start(v={"sleigh": [1.0, 0.0, 0.7]})
    known = mbdae.solve(
        Mechanism(planar(), [Closure.knife_edge("world", "edge", (0, 1, 0))], start=start), (0, 2), rtol=1e-9
    )
    mech = Mechanism(planar(), [Closure.rows(across, "sleigh", velocity=True)], start=start)
    sol = mbdae.solve(mech, (0, 2), rtol=1e-9)
    np.testing.assert_allclose(sol.y[-1], known.y[-1], atol=1e-12)
    np.testing.assert_allclose(sol.lam[-1], known.lam[-1], atol=1e-12)
    assert mbdae.info(mech).position_dof == 3
    assert mech.row_names == ["across"]


@pytest.mark.parametrize("more", [{}, {"partials": length_partials}])
@pytest.mark.parametrize(("method", "form"), [("pherk5", "index2"), ("radau5", "index2"), ("herk5", "ggl")])
def test_a_bob_swings_as_its_closure(method, form, more):
    start = Start(q={"bob": [0.3, 0.0, -0.4]}, v={"bob": [0.0, 0.5, 0.0]})
    known = Mechanism(bob(), [Closure.distance("world", "tip", LENGTH)], start=start)
    mech = Mechanism(bob(), [Closure.rows(length, "bob", **more)], start=start)
    a, b = (mbdae.solve(m, (0, 0.5), rtol=1e-6, method=method, formulation=form) for m in (known, mech))
    np.testing.assert_allclose(b.y[-1], a.y[-1], atol=1e-9)
    assert mbdae.drift(b).g_max < 1e-9
    assert np.sign(b.lam[0, 0]) == np.sign(a.lam[0, 0])


@pytest.mark.parametrize("own", [False, True])
def test_partials_are_those_of_a_coupling(own):
    model = pin.Model()
    for i in range(2):
        joint = model.addJoint(i, pin.JointModelPX(), pin.SE3.Identity(), f"slide {i}")
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    c = (0.1, -1.5, 0.7, 0.3)

    def cubic(q):
        x, y = q
        return x - np.polyval(c[::-1], y), np.array([1.0, -np.polyval(np.polyder(c[::-1]), y)])

    def curved(q):
        return np.diag([0.0, -np.polyval(np.polyder(c[::-1], 2), q[1])])

    rows = Closure.rows(cubic, ["slide 0", "slide 1"], partials=curved if own else None)
    both = [Mechanism(model, [k]).system() for k in (rows, Closure.coupling("slide 0", "slide 1", c))]
    q, v, lam = np.array([0.3, -0.6]), np.array([0.8, 1.7]), np.array([2.5])
    found, known = [
        (*s.closures(q), s.gamma(q, v, 0.0), *s.constraints.partials(v, lam), *s.constraints.bias_partials(v))
        for s in both
    ]
    for ours, theirs in zip(found, known, strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-11)


@pytest.mark.parametrize("kind", [pin.JointModelPlanar, pin.JointModelFreeFlyer, pin.JointModelRUBZ])
def test_rates_of_any_joint_are_those_of_differences(kind):
    model, rng = pin.Model(), np.random.default_rng(3)
    model.addJoint(0, kind(), pin.SE3.Identity(), "first")
    model.addJoint(1, pin.JointModelRX(), pin.SE3.Identity(), "second")
    A = rng.standard_normal((2, model.nv, model.nq))

    def rows(q):
        return np.sin(A @ np.roll(q, 1))

    system = Mechanism(model, [Closure.rows(rows, ["second", "first"], 2, velocity=True)]).system()
    v, h = rng.standard_normal(model.nv), 1e-4
    q = pin.integrate(model, pin.neutral(model), rng.standard_normal(model.nv))
    ahead, behind = (system.closures(pin.integrate(model, q, s * h * v))[1] @ v for s in (1, -1))
    np.testing.assert_allclose(system.gamma(q, v, 0.0), (ahead - behind) / (2 * h), atol=1e-6)


WRONG = {
    "G is 1 along velocity 0, but the derivative of g is 2": lambda p: (2 * p[0], np.array([1.0, 0, 0])),
    "returned shape (2,), expected shape (3,)": lambda p: (0.0, np.zeros(2)),
    "expected g and G": lambda p: p,
    "ZeroDivisionError": lambda p: (1 / 0, p),
}


@pytest.mark.parametrize("text", WRONG)
def test_wrong_functions_are_named(text):
    mech = Mechanism(bob(), [Closure.rows(WRONG[text], "bob", name="mine")])
    with pytest.raises(mbdae.MbdaeError, match="rows 'mine'") as e:
        mech.assemble({"bob": [0.1, 0.2, 0.3]})
    assert text in str(e.value)


def test_wrong_keys_are_named():
    with pytest.raises(InputError, match="unknown key grip; known: function, joints, kind, name, partials, size"):
        Closure.rows(length, "bob", grip="full")
    with pytest.raises(InputError, match="a joint is named twice: bob, bob"):
        Closure.rows(length, ["bob", "bob"])
    with pytest.raises(InputError, match="unknown joint 'bab'"):
        Mechanism(bob(), [Closure.rows(length, "bab")])
    with pytest.raises(InputError, match="function: Input should be callable"):
        Closure.rows("length", "bob")


def test_the_core_calls_it_and_runs_are_saved_by_name(tmp_path):
    mech = Mechanism(bob(), [Closure.rows(length, "bob")], start=Start(q={"bob": [0.3, 0.0, -0.4]}))
    sol, other = (mbdae.solve(mech, (0, 0.1), step=0.02, backend=backend) for backend in ("native", "python"))
    assert sol.stats["backend"] == "native"
    np.testing.assert_allclose(sol.q, other.q, rtol=0, atol=1e-12)
    sol.save(tmp_path / "run.npz")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = mbdae.Solution.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.q, sol.q)
    with pytest.raises(InputError, match="rows 'length' are a Python function and not in the file"):
        mbdae.drift(again)
