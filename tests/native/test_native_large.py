"""The compiled core on many rows: selected on demand, in an order of small bandwidth."""

import numpy as np
import pinocchio as pin
import pytest
from chains import random_inertia
from mechanism.formulations.test_descriptor import bricard
from test_native import assert_near, assert_same, both

import mbdae
from mbdae import Closure, Mechanism, backend
from mbdae.mechanism.closures import independent_rows as independent_rows

pytestmark = pytest.mark.native


def chain(n):
    """Free bodies, each on a ball joint of the previous one: 3 n rows of full rank, on a manifold with quaternions."""
    rng, mech = np.random.default_rng(1), pin.Model()
    up, down = pin.SE3(np.eye(3), np.array([0, 0, 0.5])), pin.SE3(np.eye(3), np.array([0, 0, -0.5]))
    mech.addFrame(pin.Frame("down_-1", 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    q = []
    for i in range(n):
        joint = mech.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"body_{i}")
        mech.appendBodyToJoint(joint, random_inertia(rng), pin.SE3.Identity())
        mech.addFrame(pin.Frame(f"up_{i}", joint, up, pin.FrameType.OP_FRAME))
        mech.addFrame(pin.Frame(f"down_{i}", joint, down, pin.FrameType.OP_FRAME))
        q += [0, 0, -0.5 - i, 0, 0, 0, 1]
    closures = [Closure.point(f"down_{i - 1}", f"up_{i}", name=f"ball {i}") for i in range(n)]
    mechanism = Mechanism(mech, closures)
    return mechanism, *mechanism.assemble(np.array(q, float), rng.uniform(-1, 1, mech.nv))


@pytest.mark.parametrize("N", [20, 40])
@pytest.mark.parametrize("method", ["herk3", "pherk5"])
def test_many_dependent_rows(N, method):
    native, python = both(mbdae.load("n_four_bar", N=N), (0, 0.3), method=method, step=0.03)
    assert_same(native, python, 1e-11, own=1e-9)


@pytest.mark.slow
def test_an_implicit_method_on_many_bodies():
    native, python = both(mbdae.load("n_four_bar", N=60), (0, 0.02), method="radau5", step=0.01)
    assert_same(native, python, 1e-11, own=1e-9)


IMPLICIT = [{"method": name} for name in ("radau5", "rattle4", "alpha")] + [{"method": "radau5", "formulation": "ggl"}]


@pytest.mark.parametrize("options", IMPLICIT, ids=str)
def test_matrices_of_implicit_methods_have_a_band(options):
    """Of 20 four-bars, in the order of their loops; in Python they are full."""
    native, python = both(mbdae.load("n_four_bar", N=20), (0, 0.04), step=0.02, **options)
    assert_same(native, python, 1e-11, own=1e-9)


@pytest.mark.parametrize("options", [{"method": "herk4"}, {"method": "pherk5", "project": True}], ids=str)
def test_many_rows_of_full_rank(options):
    mech, q, v = chain(15)
    assert_same(*both(mech, (0, 0.3), q, v, step=0.03, **options), 1e-11, own=1e-9)


def several(mech, n):
    """Copies of a mechanism with a revolute closure, side by side."""
    model, closures = pin.Model(), []
    model.gravity = mech.model.gravity
    for k in range(n):
        joints = [0]
        for i in range(1, mech.model.njoints):
            parent, name = joints[mech.model.parents[i]], f"{mech.model.names[i]} {k}"
            joints.append(model.addJoint(parent, mech.model.joints[i], mech.model.jointPlacements[i], name))
            model.appendBodyToJoint(joints[i], mech.model.inertias[i], pin.SE3.Identity())
        for f in list(mech.model.frames)[1:]:
            model.addFrame(pin.Frame(f"{f.name} {k}", joints[f.parentJoint], f.placement, f.type))
        closures += [Closure.revolute(f"left {k}", f"right {k}", axis=c.axis, name=f"{k}") for c in mech.closures]
    return Mechanism(model, closures)


def test_rows_are_reselected_during_a_run():
    """With ill-conditioned rows in use, errors are no larger than in a small system, which selects in each step."""
    one = bricard(5, [9.81, 0, 0])
    single, many = (
        mbdae.solve(m, (0, 10), np.zeros(m.nv), np.zeros(m.nv), step=0.01, backend="native")
        for m in (one, several(one, 7))
    )
    assert many.lam.shape[1] == 35
    for k in range(7):
        assert_near(many.q[:, 5 * k : 5 * k + 5], single.q, 1e-9)
    few, all_rows = (mbdae.drift(sol) for sol in (single, many))
    assert all_rows.Gv_max < 10 * few.Gv_max + 1e-9
    assert all_rows.energy_relative < 10 * few.energy_relative + 1e-9


@pytest.mark.slow
def test_both_back_ends_use_the_same_rows(monkeypatch):
    """On many rows that must be reselected, listed in an order that would fill the matrix."""
    mech = several(bricard(5, [9.81, 0, 0]), 7)
    by_row = [Mechanism(mech.model, mech.closures[k:] + mech.closures[:k]) for k in (0, 3)]
    selections, select = [], independent_rows.select_rows
    record = lambda *given: (selections.append(len(given[0])), select(*given))[1]  # noqa: E731
    monkeypatch.setattr(independent_rows, "select_rows", record)
    for m in (*by_row, mbdae.load("n_four_bar", N=20)):
        selections.clear()
        native, python = both(m, (0, 1.2), step=0.01, method="herk3")
        assert native.in_use == python.in_use
        assert len(selections) < 40  # not in each of 120 steps
        assert_near(native.y, python.y, 1e-9)
    assert len(mbdae.solve(by_row[0], (0, 1.2), step=0.01, method="herk3").in_use) > 1


def test_many_rows_are_eliminated_in_a_band():
    mech, q, v = chain(15)
    shuffled = Mechanism(mech.model, [mech.closures[k] for k in np.random.default_rng(0).permutation(15)])
    widths = []
    for m in (mech, shuffled):
        system = m.system()
        linked = system.constraints.columns.astype(int) @ system.constraints.columns.T
        i, j = linked.nonzero()
        widths.append(np.abs(system.elimination_order[i] - system.elimination_order[j]).max())
    assert widths == [5, 5]
    assert_same(*both(shuffled, (0, 0.1), q, v, step=0.02, method="herk3"), 1e-11, own=1e-9)


@pytest.mark.parametrize("options", [{"step": 0.01}, {"rtol": 1e-6}], ids=str)
def test_a_start_in_a_singular_configuration_is_detected(options):
    mech = mbdae.load("n_four_bar", N=12)  # flat
    v = np.array([1.0 if name.startswith("crank") else -1.0 for name in mech.joint_names])
    native, python = both(mech, (0, 1), np.zeros(mech.nq), v, **options)
    assert native.status == python.status == "rank"
    assert "rises above 12" in native.message
    assert native.stats["steps"] == python.stats["steps"]


def test_multipliers_of_many_dependent_rows_have_the_smallest_norm():
    """Plates in a plane, each carried by five parallel rods where two suffice, each differently."""
    rng, model, closures = np.random.default_rng(0), pin.Model(), []
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    for k in range(6):
        joint = model.addJoint(0, pin.JointModelPlanar(), pin.SE3.Identity(), f"plate {k}")
        model.appendBodyToJoint(joint, random_inertia(rng), pin.SE3.Identity())
        for i, place in enumerate(rng.uniform(-1, 1, (5, 3)) * [1.0, 0.3, 0.0]):
            hook = pin.SE3(np.eye(3), place + [-0.6, 0.8, 0.0])
            model.addFrame(pin.Frame(f"hook {k} {i}", 0, hook, pin.FrameType.OP_FRAME))
            model.addFrame(pin.Frame(f"eye {k} {i}", joint, pin.SE3(np.eye(3), place), pin.FrameType.OP_FRAME))
            closures.append(Closure.distance(f"hook {k} {i}", f"eye {k} {i}", 1.0))
    plates = Mechanism(model, closures)
    q, v = np.tile([0.0, 0.0, 1.0, 0.0], 6), np.outer(np.arange(6), [0.8, 0.6, 0.0]).ravel()
    system, y = plates.system(native=backend.load()), np.concatenate([q, v, [0.0]])
    expected = system.derivative(0.0, y)[1]  # the first one is computed in Python
    lam = system.core.derivative(0.0, y)[1]
    G = system.jacobian(q)
    assert np.linalg.matrix_rank(G, tol=1e-9) == 12
    assert_near(lam, np.linalg.lstsq(G.T, G.T @ lam, rcond=1e-9)[0], 1e-12)
    assert_near(lam, expected, 1e-12)
