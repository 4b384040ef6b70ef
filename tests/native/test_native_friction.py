"""Friction proportional to closure forces, in both back ends: methods, formulations, modes, invalid data."""

import numpy as np
import pinocchio as pin
import pytest
from mechanism.formulations.test_sliding import bead, planar_body
from mechanism.hybrid.test_rolling_stiction import START, ball
from native.test_native import assert_near, assert_same, both, compare_points

import mbdae
from mbdae import Closure, CoulombFriction, Mechanism, backend
from mbdae.integrate.steppers.stepper import PythonStepper

pytestmark = pytest.mark.native
R = 0.5


def pivot(kind):
    """A pendulum in a bearing; a revolute one has redundant rows."""
    closure = Closure(kind=kind, frames=("world", "body"), name="pivot")
    friction = CoulombFriction(closure="pivot", coefficient=0.3, radius=0.2, velocity=0.1)
    return Mechanism(planar_body("xyz", com=(0.0, -0.4, 0.0)), [closure], [friction])


def rail(kind):
    """A body on a slanted rail, pressed against it by its weight; with or without rotation."""
    closure = Closure(kind=kind, frames=("slope", "body"), name="rail", axis=(0, 0, 1))
    model = planar_body("xyz", com=(0.05, 0.0, 0.0))
    turn = pin.exp3(np.array([0.0, 0.0, -0.3])) @ np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]])
    model.addBodyFrame("slope", 0, pin.SE3(turn, np.zeros(3)), 0)
    model.frames[model.getFrameId("body")].placement.rotation = turn
    friction = CoulombFriction(closure="rail", coefficient=0.2, velocity=0.1)
    return Mechanism(model, [closure], [friction])


SLIDING = {
    "bead on a wire": (lambda: bead(velocity=0.1), [0, -R], [4.0, 0]),
    "point": (lambda: pivot("point"), [0, 0, 0.2], [0, 0, 5.0]),
    "revolute": (lambda: pivot("revolute"), [0, 0, 0.2], [0, 0, 5.0]),
    "in_line": (lambda: rail("in_line"), None, [1.0, 0, 0.0]),
    "prismatic": (lambda: rail("prismatic"), None, [1.0, 0, 0.0]),
    "four_bar": (
        lambda: mbdae.load(
            "four_bar", forces=[CoulombFriction(closure="pin", coefficient=0.2, radius=0.05, velocity=0.1)]
        ),
        None,
        None,
    ),
}


def made(name):
    make, q, v = SLIDING[name]
    mech = make()
    if v is None:
        return mech, mech.start
    q, v = np.zeros(mech.nq) if q is None else np.array(q, float), np.array(v, float)
    y = mech.system().project_state(0.0, np.concatenate([q, v, [0.0]]))
    return mech, (y[: mech.nq], y[mech.nq : mech.nq + mech.nv])


@pytest.mark.parametrize("name", SLIDING)
def test_both_back_ends_agree_with_closure_friction(name):
    mech, start = made(name)
    for method in ("pherk5", "herk5"):
        assert_same(*both(mech, (0, 0.03), *start, method=method, step=0.005), 1e-10, 1e-8)
    for formulation, method in (("ggl", "pherk4"), ("index1", "dop853")):
        how = {"formulation": formulation, "method": method, "step": 0.005}
        assert_same(*both(mech, (0, 0.02), *start, **how), 1e-10, 1e-8)
    assert_same(*both(mech, (0, 0.02), *start, method="radau5", step=0.005), 1e-10, 1e-8)
    assert_same(*both(mech, (0, 0.02), *start, method="radau5", step=0.005, formulation="ggl"), 1e-10, 1e-8)


def test_friction_is_there():
    """The runs compared slow down: power of friction, and the balancing work."""
    for name in SLIDING:
        mech, start = made(name)
        sol = mbdae.solve(mech, (0, 0.1), *start, rtol=1e-10, backend="native")
        assert mbdae.drift(sol).work_end < -1e-4, name
        assert mbdae.drift(sol).energy_relative < 1e-8, name


def test_points_of_a_bead():
    compare_points(bead(velocity=0.1))


@pytest.mark.parametrize("heading", [0.0, 0.7])
def test_steps_of_a_ball_that_slides_and_rolls_are_the_cores(heading, monkeypatch):
    v = 2.0 * np.array([np.cos(heading), np.sin(heading), 0, 0, 0, 0.3])
    native, python = both(ball(exact=True), (0, 0.4), START, v, rtol=1e-8)
    assert native.stats["backend"] == "native"
    assert native.modes == python.modes
    assert (native.modes[0][1], native.modes[-1][1]) == ((2,), (1,))
    for a, b in ((native.t, python.t), (native.y, python.y)):
        assert_near(a[-1], b[-1], 1e-10)
    assert native.t[native.modes[-1][0]] == pytest.approx(python.t[python.modes[-1][0]], abs=1e-9)
    monkeypatch.setattr(PythonStepper, "advance", None)
    assert mbdae.solve(ball(exact=True), (0, 0.2), START, v, step=0.01, backend="native").success


def test_friction_that_wedges_is_left_to_python():
    """The same message, though the core has none."""
    model = planar_body("xz", com=(0.5, -0.5, 0.0))
    model.addBodyFrame("tip", 2, pin.SE3(np.eye(3), np.array([0.5, -0.5, 0.0])), 0)
    model.addBodyFrame("floor", 0, pin.SE3(np.eye(3), np.array([0, -0.5, 0])), 0)
    model.inertias[1] = pin.Inertia(1e3, np.zeros(3), np.eye(3))
    ground = Closure.in_plane("floor", "tip", axis=(0, 1, 0), name="ground")
    mech = Mechanism(model, [ground], [CoulombFriction(closure="ground", coefficient=1.2, velocity=1e-9)])
    native, python = both(mech, (0, 1e-3), np.zeros(2), np.array([1.0, 0]))
    assert native.message == python.message
    assert native.status == "friction"


def test_invalid_interfaces_are_rejected():
    system = bead().system(native=backend.load())
    (right,) = system.closure_friction.core_data()
    acts, headings = system.closure_friction.active, system.closure_friction.slip_directions
    core = system.core
    core.set_friction_interfaces([right], acts, headings)
    wrong = {
        "kind": ["slip", 3, None],
        "row": [-1, 1, 7, "x"],
        "components": [0, 2, 4],
        "no_slip_rows": [[0], [7], None],
        "axis": [[1.0], None],
        "coefficient": [-1.0, np.nan, np.inf],
        "width": [0.0, -1.0, np.nan],
    }
    rejected = (ValueError, TypeError, RuntimeError, IndexError)
    for key, values in wrong.items():
        for value in values:
            with pytest.raises(rejected):
                core.set_friction_interfaces([{**right, key: value}], acts, headings)
    for place in ({}, {**right, "kind": "rolling"}, {**right, "kind": "rolling", "no_slip_rows": [0, 0, 0]}):
        with pytest.raises(rejected):
            core.set_friction_interfaces([place], acts, headings)
    for numbers in ((acts[:0], headings), (acts, headings[:0]), (acts.astype(float), headings)):
        with pytest.raises(rejected):
            core.set_friction_interfaces([right], *numbers)
