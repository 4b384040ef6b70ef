"""Tangents and adjoints in the compiled core against those in Python, which is the specification."""

from contextlib import contextmanager

import numpy as np
import pytest
from frozen import FROZEN, free_velocity
from smooth import SMOOTH

import mbdae
from mbdae import backend
from mbdae.integrate import trajectory
from mbdae.mechanism.discrete_sensitivity.parameter_partials import Parameters
from mbdae.mechanism.formats.loaded_model import number
from mbdae.mechanism.formats.template import Template
from mbdae.mechanism.mechanism import Mechanism
from mbdae.methods import METHODS, Tableau

METHODS_HERE = [name for name, method in METHODS.items() if isinstance(method, Tableau)]
STEPS = {"andrews_squeezer": 5e-4, "humanoid_stance": 2e-3, "flyball_governor": 2e-4, "jansen_walker": 5e-3,
         "heavy_top": 2e-3, "sleeping_top": 2e-3, "stewart_platform": 0.01}  # fmt: skip


@contextmanager
def in_python():
    """Recompute the steps of trajectories in Python."""
    known = trajectory.native_trajectory
    trajectory.native_trajectory = lambda trace: None
    try:
        yield
    finally:
        trajectory.native_trajectory = known


def random_cost(sol, seed=0):
    """A cost of random weights of all coordinates and velocities, and of lam."""
    rng = np.random.default_rng(seed)
    names = [name for name in sol.signals() if name.startswith(("q.", "v.", "s."))]
    weights = {name: rng.standard_normal(len(sol.t)) for name in names}
    return lambda values: (sum(float(w @ values[name]) for name, w in weights.items()), weights)


def compare(sol, names, **options):
    """Both back ends, and in each the adjoint against the tangent."""
    cost = random_cost(sol)
    _, weights = cost(sol.signals())
    found = []
    for core in (True, False):
        if core:
            tangent, adjoint = mbdae.sensitivity(sol, names, **options), mbdae.gradient(sol, cost, names, **options)
            assert tangent.trace.core is not None
        else:
            with in_python():
                tangent, adjoint = mbdae.sensitivity(sol, names, **options), mbdae.gradient(sol, cost, names, **options)
            assert tangent.trace.core is None
        backwards = np.array(list(adjoint.gradient.values()))
        slopes = {name: tangent.signal(name) for name in weights}
        forwards = sum(w @ slopes[name] for name, w in weights.items())
        size = sum(np.abs(w) @ np.abs(slopes[name]) for name, w in weights.items())
        assert (np.abs(forwards - backwards) <= 1e-13 * size.max()).all()
        found.append((tangent.dy, backwards, size.max()))
    (dy, back, _), (expected, expected_back, size) = found
    assert np.abs(dy - expected).max() <= 1e-11 * max(1.0, np.abs(expected).max())
    assert np.abs(back - expected_back).max() <= 1e-11 * size
    assert np.abs(expected).max() > 0


@pytest.mark.parametrize("model", SMOOTH)
def test_every_model(model):
    mech, step = mbdae.load(model), STEPS.get(model, 0.02)
    sol = mbdae.solve(mech, (0.0, 4 * step), step=step, method="pherk5", project=mech.ng > 0)
    compare(sol, ["gravity.2"], start=True)


@pytest.mark.parametrize("method", METHODS_HERE)
def test_every_method(method):
    """Not projected; the second one with step-size control, on a curved manifold."""
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 0.12), step=0.03, method=method, project=False)
    compare(sol, ["joint.crank.mass", "start.q.crank"], start=True)
    sol = mbdae.solve(mbdae.load("heavy_top"), (0.0, 0.02), rtol=1e-4, method=method)
    compare(sol, ["gravity.2"], start=True)


FOUR_BAR = ("joint.crank.mass", "joint.coupler.com.0", "joint.rocker.inertia.1", "joint.coupler.xyz.0",
            "joint.coupler.rpy.1", "joint.rocker.xyz.2", "frame.coupler_tip.xyz.0", "frame.rocker_tip.rpy.1",
            "gravity.2", "start.v.crank")  # fmt: skip
ANDREWS = ("joint.gamma.mass", "joint.Theta.com.1", "joint.Phi.inertia.2", "joint.beta.xyz.0", "joint.Omega.xyz.1",
           "frame.P4.xyz.1", "frame.D.xyz.0", "frame.C.xyz.1", "force.spring.stiffness", "force.spring.length",
           "force.drive.torque.value")  # fmt: skip

CAR_AXIS = ("body.chassis.mass", "body.right.mass", "closure.axle.length", "driver.road driver.motion.amplitude",
            "force.left spring.stiffness", "frame.wheel.xyz.0", "gravity.1")  # fmt: skip


@pytest.mark.parametrize("project", [False, True])
@pytest.mark.parametrize(
    ("model", "names", "step"),
    [("four_bar", FOUR_BAR, 0.05), ("andrews_squeezer", ANDREWS, 1e-3), ("car_axis", CAR_AXIS, 0.01)],
)
def test_every_sort_of_parameter(model, names, step, project):
    sol = mbdae.solve(mbdae.load(model), (0.0, 3 * step), step=step, method="pherk5", project=project)
    compare(sol, names)


def test_placements_on_a_moving_tree():
    """Masses and placements of a spatial mechanism in motion, with springs, dampers and forces between its frames."""
    mech = mbdae.load("panda_handle")
    joints = mech.joint_names[:3]
    names = [f"joint.{joint}.{key}" for joint in joints for key in ("mass", "com.1", "inertia.3", "xyz.1", "rpy.0")]
    rng = np.random.default_rng(2)
    q, v = mech.start
    v = mech.assemble(q, v + rng.standard_normal(mech.nv))[1]
    compare(mbdae.solve(mech, (0.0, 0.03), q, v, step=0.01, project=True), names)


def test_reselected_rows():
    sol = mbdae.solve(mbdae.load("bricard"), (0.0, 3.0), step=0.05, method="pherk5")
    assert len(sol.in_use) > 1
    compare(sol, ["gravity.2"])


@pytest.mark.parametrize(("model", "values", "others", "T", "mode"), FROZEN)
@pytest.mark.parametrize("project", [False, True])
def test_modes_that_do_not_change(model, values, others, T, mode, project):
    template, given = Template(model), {**values, **others}
    sol = mbdae.solve(template.make(given), (0.0, T), step=T / 4, method="pherk5", project=project)
    assert sol.modes == [(0, mode)]
    compare(sol, given, start=True, model=template)


def test_one_binding_serves_runs_in_two_modes():
    """Perturbed friction acts in the direction of slip of each run."""
    template, name = Template("stick_slip_slider"), "force.joint_friction 3.friction"
    mech, value = template.make({}), number(template, name)
    q, v = mech.start
    free = free_velocity(mech)
    runs = [mbdae.solve(mech, (0.0, 4e-3), q, v + x * free, step=2e-3, method="pherk5") for x in (1.0, -1.0)]
    assert runs[0].modes != runs[1].modes

    def derivatives(sol, parameters):
        trace = trajectory.Trajectory(sol, parameters)
        nodes = trace.core.nodes(0, 2)
        return trace.core.tangent(nodes, np.zeros((1, trace.system.ny + trace.n_carry)), np.ones((1, 1)))

    shared = Parameters(template.make, {name: value}, backend.load())
    for sol in runs:
        alone = derivatives(sol, Parameters(template.make, {name: value}, backend.load()))
        np.testing.assert_array_equal(derivatives(sol, shared), alone)
        assert np.abs(alone).max() > 1e-6


def test_jumps_events_and_times_between_nodes():
    hold = mbdae.Sampled(lambda t, q, v: -5 * v[:1], rate=10, joints="crank", name="hold")
    mech = mbdae.load("four_bar", forces=[hold])
    times = np.linspace(0.0, 0.35, 9)
    compare(mbdae.solve(mech, (0.0, 0.35), rtol=1e-4, t_eval=times), ["joint.crank.mass"], start=True)
    event = mbdae.Event(lambda t, q, v: q[0] - 1.0, terminal=True)
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 2.0), rtol=1e-4, events=event)
    compare(sol, ["joint.crank.mass"], start=True, event=event)


def test_a_law_in_python():
    """The core calls it."""
    mech = mbdae.load("four_bar", forces=[lambda t, q, v: -0.1 * v * abs(v)])
    compare(mbdae.solve(mech, (0.0, 0.2), step=0.05), ["joint.crank.mass"])


def test_one_mechanism_is_bound_once(monkeypatch):
    made = []
    make = Mechanism.__init__
    monkeypatch.setattr(Mechanism, "__init__", lambda self, *args, **more: made.append(1) or make(self, *args, **more))
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 0.1), step=0.05)
    mbdae.gradient(sol, random_cost(sol), ["joint.crank.mass"])
    n = len(made)
    mbdae.gradient(sol, random_cost(sol, 1), ["joint.crank.mass"])
    assert len(made) == n
