"""Radau IIA in the compiled core against Python: states, iterations, orders, and closures at ends of steps."""

from functools import partial

import numpy as np
import pinocchio as pin
import pytest
from driven import DRIVEN
from in_core import IN_CORE
from mechanism.forces.test_force_runs import IN_BOTH
from native.test_native import JUMPING, SPANS, assert_near, assert_same, both, span
from scipy.linalg import null_space
from shared import shared_model

import mbdae
from mbdae import backend
from mbdae.integrate.steppers.stepper import PythonStepper
from mbdae.methods.radau import RadauIIA
from mbdae.system import State

pytestmark = pytest.mark.native


def steps(mech, method, h, n, native):
    """States, multipliers and errors of n steps, and the iterations of each of them."""
    system = mech.system(native=backend.load()) if native else mech.system()
    y = system.update_independent_rows(0.0, State(mech.point())).y
    state, found, t = State(y, system.carry(*system.derivative(0.0, y))), [], 0.0
    for _ in range(n):
        before = system.counts.newton
        step = method.controlled_step(system, t, h, state)
        t += h
        state = system.update_independent_rows(t, step.state)
        v = system.split(state.y)[1]
        rate = system.residual(t, *system.split(state.y))[1]
        found.append((state.y, step.z, step.errors, system.counts.newton - before, np.abs(rate).max(initial=0), v))
    return found


@pytest.mark.parametrize("name", IN_CORE)
def test_single_steps(name):
    """Equal to rounding; as many iterations, or up to two more where rounding decides their end."""
    mech, h = shared_model(name), SPANS.get(name, 0.5) / 1000
    for s in (1, 2, 3, 4):
        found, expected = (steps(mech, RadauIIA(s), h, 2, native) for native in (True, False))
        for k, (a, b) in enumerate(zip(found, expected, strict=True)):
            assert_near(a[0], b[0], 1e-12)
            assert_near(a[1], b[1], 1e-9)
            assert_near(a[2], b[2], 0.1 * np.abs(b[2]).max() + 1e-16 if k else 1e-12)
            assert abs(a[3] - b[3]) <= 2
            assert a[4] <= 1e-13 * (1 + np.abs(a[5]).max())


@pytest.mark.parametrize("name", ["four_bar", "heavy_top"])
def test_a_step_adds_the_rounding_error_of_the_previous_one(name):
    """A compensation far larger than rounding moves the end of the step by the same amount, along the closures."""
    mech, method, found = shared_model(name), RadauIIA(3), []
    system = mech.system()
    start = system.update_independent_rows(0.0, State(mech.point())).y
    end = method.step(system, 0.0, 1e-3, State(start, None)).state.y
    free = null_space(system.jacobian(system.split(end)[0]))
    lost = np.zeros(system.ny)
    lost[mech.nv : 2 * mech.nv] = 1e-4 * free @ np.random.default_rng(0).standard_normal(free.shape[1])
    for native in (backend.load(), None):
        system = mech.system(native=native)
        y = system.update_independent_rows(0.0, State(mech.point())).y
        plain, moved = (method.step(system, 0.0, 1e-3, State(y, None, low)).state for low in (None, lost))
        v, others = slice(mech.nq, mech.nq + mech.nv), slice(mech.nv, 2 * mech.nv)
        np.testing.assert_allclose(moved.y[v] - plain.y[v], lost[others], rtol=1e-8, atol=1e-17)
        assert np.abs(moved.compensation).max() <= 1e-15 * (1 + np.abs(moved.y).max())
        found.append(moved.y)
    assert_near(*found, 1e-12)


@pytest.mark.parametrize("name", IN_CORE)
def test_fixed_steps(name):
    T = span(name)
    native, python = both(shared_model(name), (0, T), method="radau5", step=SPANS.get(name, 0.5) / 20)
    assert (native.stats["backend"], native.status, native.message) == ("native", python.status, python.message)
    for a, b, tolerance in (
        (native.y, python.y, 1e-10),
        (native.lam, python.lam, 1e-9),
        (native.z_own, python.z_own, 1e-8),
    ):
        assert_near(a, b, tolerance)


@pytest.mark.parametrize("name", IN_CORE)
def test_controlled_steps(name):
    T = span(name)
    python = mbdae.solve(shared_model(name), (0, T), method="radau5", rtol=1e-5, backend="python")
    native = mbdae.solve(shared_model(name), (0, T), method="radau5", rtol=1e-5, backend="native")
    assert native.status == python.status == "finished"
    assert abs(native.stats["steps"] - python.stats["steps"]) <= 1 + 0.02 * python.stats["steps"]
    assert_near(native.y[-1], python.y[-1], 1e-6)


@pytest.mark.parametrize("name", DRIVEN)
def test_driven_mechanisms(name):
    for options in ({"step": 0.02}, {"step": 0.02, "project": True}):
        assert_same(*both(DRIVEN[name](), (0.3, 0.5), method="radau5", **options), 1e-10, 1e-8)


@pytest.mark.parametrize("force", IN_BOTH.values(), ids=IN_BOTH.keys())
def test_every_force(force):
    assert_same(*both(mbdae.load("four_bar", forces=[force]), JUMPING, method="radau5", step=0.046), 1e-10, 1e-8)


def test_fifteen_stages():
    """They reach rounding on a spherical joint, with steps in which five stages have an error."""
    solve = partial(mbdae.solve, shared_model("heavy_top"), (0, 0.01), backend="native")
    reference = solve(method="radau13", step=0.0005).y[-1]
    errors = [np.abs(solve(method=name, step=0.005).y[-1] - reference).max() for name in ("radau5", "radau29")]
    assert errors[1] < 1e-10 < errors[0], errors


def test_failing_iterations_leave_the_step_to_python(monkeypatch):
    asked = []
    advance = PythonStepper.advance
    monkeypatch.setattr(PythonStepper, "advance", lambda self, *args: asked.append(1) or advance(self, *args))
    native, python = both(shared_model("four_bar"), (0, 3), method="radau5", step=0.5)
    assert (native.status, native.message) == (python.status, python.message)
    assert asked


def test_steps_after_impacts_are_those_of_python():
    """Bodies whirl by 0.8 rad in a step: the core leaves such steps to Python."""
    native, python = both(shared_model("bouncing_chain"), (0, 0.3), method="radau5", step=0.025)
    assert (native.status, native.stats["backend"]) == (python.status, "native")
    assert [i.where for i in native.impacts] == [i.where for i in python.impacts]
    assert len(native.impacts) == 5
    assert_near(native.y[-1], python.y[-1], 1e-8)


def test_failing_iterations_under_control_are_tried_shorter_in_the_core(monkeypatch):
    """Crank and slider joined by a spring of 1e8 N/m: a step long enough for the tolerance is too long for Newton."""
    slider = pin.SE3(np.eye(3), np.zeros(3))
    tree = pin.Model()
    crank = tree.addJoint(0, pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0])), slider, "crank")
    along = tree.addJoint(0, pin.JointModelPX(), slider, "slider")
    tree.appendBodyToJoint(crank, pin.Inertia(1.0, np.zeros(3), 0.02 * np.eye(3)), slider)
    tree.appendBodyToJoint(along, pin.Inertia(0.5, np.zeros(3), 1e-3 * np.eye(3)), slider)
    tree.gravity.setZero()
    pins = pin.SE3(np.eye(3), np.array([0.1, 0.0, 0.0])), slider
    for name, joint, at in zip(("crank_pin", "slider_pin"), (crank, along), pins, strict=True):
        tree.addFrame(pin.Frame(name, joint, at, pin.FrameType.OP_FRAME))
    rod = mbdae.SpringDamper(frames=("crank_pin", "slider_pin"), stiffness=1e8, damping=1e4, length=0.35)
    mech = mbdae.Mechanism(tree, [], [rod])
    reach = float(np.sqrt(0.35**2 - (0.1 * np.sin(0.3)) ** 2))
    q = [0.3, 0.1 * np.cos(0.3) + reach]
    v = [6.0, -0.6 * np.sin(0.3) * (1 + 0.1 * np.cos(0.3) / reach)]
    solve = partial(mbdae.solve, mech, (0, 0.1), q, v, method="radau5", rtol=1e-6)
    python = solve(backend="python")
    monkeypatch.setattr(PythonStepper, "advance", None)
    native = solve(backend="native")
    assert python.stats["rejected"] > 10  # mostly by Newton's iteration
    assert (native.stats["steps"], native.stats["rejected"]) == (python.stats["steps"], python.stats["rejected"])
    assert_near(native.y[-1], python.y[-1], 1e-9)


@pytest.mark.parametrize("turn", [0.25, 0.75, 1.0])
def test_far_turns_leave_velocities_where_they_belong(turn):
    """Then Newton's iterations hardly damp rounding errors, in directions without any other excitation."""
    mech = shared_model("heavy_top")
    for sol in both(mech, (0, 0.15), method="radau5", step=turn / 150):
        rate = np.array([mech.residual(q, v, t)[1] for t, q, v in zip(sol.t, sol.q, sol.v, strict=True)])
        assert np.abs(rate).max() < 1e-13
