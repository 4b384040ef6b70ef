"""Tangents and adjoints of runs in the compiled core: against each other, and against quotients of runs."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from frozen import FROZEN, assert_derivative, free_velocity, runs_of
from signal_names import without_work
from smooth import SMOOTH

import mbdae
from mbdae import backend
from mbdae.errors import InputError
from mbdae.integrate.trajectory import trajectory
from mbdae.mechanism.discrete_sensitivity.parameter_partials import Parameters
from mbdae.mechanism.formats.mechanism_file.loaded_model import parameter_value
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.mechanism.mechanism import Mechanism
from mbdae.methods import METHODS, Tableau

METHODS_HERE = [name for name, method in METHODS.items() if isinstance(method, Tableau)]
STEPS = {"flexible_four_bar": 2e-4, "flexible_slider_crank": 2e-5,
         "andrews_squeezer": 5e-4, "humanoid_stance": 2e-3, "flyball_governor": 2e-4, "jansen_walker": 5e-3,
         "heavy_top": 2e-3, "sleeping_top": 2e-3, "stewart_platform": 0.01}  # fmt: skip


def random_cost(sol, seed=0):
    """Random weights of all coordinates, velocities and states, and a cost with them."""
    rng = np.random.default_rng(seed)
    names = [name for name in without_work(sol.mechanism) if name.startswith(("q.", "v.", "s."))]
    weights = {name: rng.standard_normal(len(sol.t)) for name in names}
    return weights, lambda values: (sum(float(w @ values[name]) for name, w in weights.items()), weights)


def compare(sol, names, **options):
    """The adjoint against the tangent; return the tangent."""
    weights, cost = random_cost(sol)
    tangent, adjoint = mbdae.sensitivity(sol, names, **options), mbdae.gradient(sol, cost, names, **options)
    backwards = np.array(list(adjoint.gradient.values()))
    derivatives = {name: tangent.signal(name) for name in weights}
    forwards = sum(w @ derivatives[name] for name, w in weights.items())
    size = sum(np.abs(w) @ np.abs(derivatives[name]) for name, w in weights.items())
    assert (np.abs(forwards - backwards) <= 1e-13 * size.max()).all()
    assert np.abs(tangent.dy).max() > 0
    return tangent


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
DECIDED = ("closure.axle.length", "frame.wheel.xyz.0", "driver.road driver.motion.amplitude")  # no start closes


@pytest.mark.parametrize("project", [False, True])
@pytest.mark.parametrize(
    ("model", "names", "step", "within"),
    [("four_bar", FOUR_BAR, 0.05, 1e-9), ("andrews_squeezer", ANDREWS, 1e-3, 3e-8), ("car_axis", CAR_AXIS, 0.01, 1e-9)],
)
def test_every_sort_of_parameter(model, names, step, within, project):
    options = {"step": step, "method": "pherk5", "project": project}
    found = compare(mbdae.solve(mbdae.load(model), (0.0, 3 * step), **options), names)
    for i, name in enumerate(names):
        if name in DECIDED:
            continue
        _, value, run = runs_of(model, name, 3 * step, **options)
        widths, own = (1e-4, 1e-3, 2e-3), run(value).mechanism
        assert_derivative(found.dy[..., i], lambda x, run=run: run(x).y, value, within, widths, own, name)


@pytest.mark.slow
def test_placements_on_a_moving_tree():
    """Masses and placements of a spatial mechanism in motion, with springs, dampers and forces between its frames."""
    template = Template("panda_handle")
    mech = mbdae.load("panda_handle")
    joints = mech.joint_names[:3]
    names = [f"joint.{joint}.{key}" for joint in joints for key in ("mass", "com.1", "inertia.3", "xyz.1", "rpy.0")]
    rng = np.random.default_rng(2)
    q, v = mech.start
    v = mech.assemble(q, v + rng.standard_normal(mech.nv))[1]

    @cache
    def run(name, value):
        return mbdae.solve(template.make({name: value}), (0.0, 0.03), q, v, step=0.01, project=True)

    found = compare(mbdae.solve(mech, (0.0, 0.03), q, v, step=0.01, project=True), names)
    for i, name in enumerate(names):
        if name.split(".")[-2] in ("xyz", "rpy"):
            continue  # the given start would not close
        value = parameter_value(template, name)
        assert_derivative(found.dy[..., i], lambda x, name=name: run(name, x).y, value, 1e-9, mech=mech, what=name)


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
    mech, value = template.make({}), parameter_value(template, name)
    q, v = mech.start
    free = free_velocity(mech)
    runs = [mbdae.solve(mech, (0.0, 4e-3), q, v + x * free, step=2e-3, method="pherk5") for x in (1.0, -1.0)]
    assert runs[0].modes != runs[1].modes

    def derivatives(sol, parameters):
        steps = trajectory.Trajectory(sol, parameters)
        nodes = steps.core.nodes(0, 2)
        return steps.core.tangent(nodes, np.zeros((1, steps.system.ny + steps.n_carry)), np.ones((1, 1)))

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


def rolling_ball(radius=0.3):
    """A point on a paraboloid, by rows in Python, on position and on velocity level."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelTranslation(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())

    def bowl(q):
        return q[2] - radius * (q[0] ** 2 + q[1] ** 2), np.array([-2 * radius * q[0], -2 * radius * q[1], 1.0])

    rows = [mbdae.Closure.rows(bowl, "ball", name="bowl")]
    rows.append(mbdae.Closure.rows(lambda q: np.array([q[1], 1 + q[0] ** 2, 0.0]), "ball", velocity=True, name="keel"))
    return Mechanism(model, rows)


@pytest.mark.parametrize(
    "options",
    [{"project": False}, {"project": True}, {"formulation": "ggl"}, {"method": "radau5"},
     {"method": "radau5", "formulation": "ggl"}],
)  # fmt: skip
def test_rows_in_python(options):
    """The core calls them; they change with a parameter."""
    q, v = np.array([0.4, 0.2, 0.3 * 0.2]), np.array([1.0, 0, 0])
    q, v = rolling_ball().assemble(q, v)
    options = {"step": 0.02, "method": "pherk5", **options}

    @cache
    def run(faster):
        return mbdae.solve(rolling_ball(), (0.0, 0.06), q, v * (1 + faster), **options)

    assert run(0.0).stats["backend"] == "native"
    other = mbdae.solve(rolling_ball(), (0.0, 0.06), q, v, backend="python", **options)
    np.testing.assert_allclose(run(0.0).y, other.y, rtol=0, atol=1e-12)
    found = compare(run(0.0), {"radius": 0.3}, model=rolling_ball, start=True)
    assert_derivative(found.dy[..., 4:7] @ v, lambda x: run(x).y, 0.0, 1e-10, mech=rolling_ball())


def test_without_the_core(monkeypatch):
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 0.1), step=0.05, backend="python")
    monkeypatch.setattr(backend, "load", lambda: None)
    monkeypatch.setattr(backend, "status", lambda: "python: not built here; no core is installed: run `pip install .`")
    with pytest.raises(InputError, match=r"derivatives of runs need the compiled core of mbdae; .*run `pip install"):
        mbdae.sensitivity(sol, start=True)


def test_one_mechanism_is_bound_once(monkeypatch):
    made = []
    make = Mechanism.__init__
    monkeypatch.setattr(Mechanism, "__init__", lambda self, *args, **more: made.append(1) or make(self, *args, **more))
    sol = mbdae.solve(mbdae.load("four_bar"), (0.0, 0.1), step=0.05)
    mbdae.gradient(sol, random_cost(sol)[1], ["joint.crank.mass"])
    n = len(made)
    mbdae.gradient(sol, random_cost(sol, 1)[1], ["joint.crank.mass"])
    assert len(made) == n
