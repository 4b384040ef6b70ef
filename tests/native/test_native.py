"""The compiled core against Python: the same trajectories, evaluations, statuses and tableaus."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, random_q, tree
from driven import DRIVEN
from in_core import IN_CORE
from mechanism.closures.test_closure_kinds import CASES, mechanism
from mechanism.forces.test_force_runs import IN_BOTH
from shared import shared_model

import mbdae
from mbdae import Closure, Driver, Mechanism, backend
from mbdae.errors import StepError
from mbdae.integrate.steppers.stepper import PythonStepper
from mbdae.methods import METHODS, Tableau
from mbdae.system import State

pytestmark = pytest.mark.native
TABLEAUS = [name for name, m in METHODS.items() if isinstance(m, Tableau)]
SPANS = {  # s; 0.5 s for the others; the impact of the chain is located beyond the rounding of t
    "andrews_squeezer": 0.015, "bouncing_chain": 0.2, "cart_pole": 0.1, "delta_robot": 0.3, "flexible_four_bar": 0.006,
    "flexible_slider_crank": 2e-4, "flyball_governor": 0.002, "heavy_top": 0.1, "humanoid_stance": 0.02,
    "rattleback": 0.1, "sleeping_top": 0.05, "spatial_slider_crank": 0.25, "woodpecker": 0.01,
}  # fmt: skip
LATE = ("geneva_drive", "pendulum_on_stop", "slider_crank_with_stop", "stick_slip_slider")  # events beyond a quarter
JUMPING = 0.25, 0.45  # s: forces step at 0.3 s and have a kink at 0.4 s
BEGUN = 0.1  # of a span, in runs that compare steps and need no events: two steps, the second with a carry
# A sleeve of 5e-9 kg m^2 rests against its pole, and its velocity is rounding of some 1e-14 rad/s, which must not
# determine the step after an impact: an atol of 1e-8 rad/s makes 3e-7 of it, where the maximum growth of steps begins.
ATOL = {"woodpecker": 1e-6}


def span(name):
    """End of a run, s: with the events of a model; a quarter of it if that has them all."""
    return SPANS.get(name, 0.5) * (1.0 if name in LATE else 0.25)


def both(mech, *arguments, **options):
    return [mbdae.solve(mech, *arguments, **options, backend=b) for b in ("native", "python")]


def assert_near(a, b, tolerance):
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape
    if b.size:
        np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * (1 + np.abs(b[np.isfinite(b)]).max(initial=0)))


def assert_same(native, python, tolerance=1e-12, own=1e-10):
    assert (native.stats["backend"], python.stats["backend"]) == ("native", "python")
    assert native.status == python.status
    assert native.message == python.message or native.status == "doubtful"  # which names residuals to all digits
    assert_near(native.t, python.t, 1e-15)
    assert_near(native.y, python.y, tolerance)
    assert_near(native.lam, python.lam, 1e-11)
    assert_near(native.z_own, python.z_own, own)


# -- trajectories ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", TABLEAUS)
@pytest.mark.parametrize("name", IN_CORE)
def test_fixed_steps(name, method):
    """Two methods run through the whole span if it has events; the others begin it with the same steps."""
    T, several = SPANS.get(name, 0.5), method in ("herk4", "pherk5")
    end = span(name) if several else BEGUN * T
    for options in ({}, {"project": True}) if several else ({},):
        native, python = both(shared_model(name), (0, end), method=method, step=T / 20, **options)
        assert python.ended
        assert_same(native, python)


@pytest.mark.parametrize("options", [{"method": "herk5"}, {"method": "rk4"}, {"project": True}], ids=str)
@pytest.mark.parametrize("name", IN_CORE)
def test_controlled_steps(name, options):
    # the first steps of a run are short: their errors are rounding only, and would determine the next ones
    options = options | {"rtol": 1e-4, "atol": ATOL.get(name), "first_step": SPANS.get(name, 0.5) / 20}
    native, python = both(shared_model(name), (0, span(name)), **options)
    assert native.status == python.status == "finished"
    assert (native.stats["steps"], native.stats["rejected"]) == (python.stats["steps"], python.stats["rejected"])
    assert_near(native.y[-1], python.y[-1], 1e-11)  # step sizes follow the rounding of small errors
    assert [x.rank_there for x in native.singular] == [x.rank_there for x in python.singular]


@pytest.mark.parametrize("name", DRIVEN)
def test_driven_mechanisms(name):
    mech = DRIVEN[name]()
    for options in ({"step": 0.02}, {"step": 0.02, "project": True, "method": "herk4"}):
        assert_same(*both(mech, (0.3, 0.5), **options))
    native, python = both(mech, (0.3, 0.8), rtol=1e-6)
    assert native.stats["steps"] == python.stats["steps"]
    assert_near(native.y[-1], python.y[-1], 1e-10)


@pytest.mark.parametrize("force", IN_BOTH.values(), ids=IN_BOTH.keys())
def test_every_force(force):
    mech = mbdae.load("four_bar", forces=[force])
    assert_same(*both(mech, JUMPING, step=0.046))
    assert_same(*both(mech, JUMPING, step=0.046, method="rule38", jumps=[0.31]))


def test_gears_of_unbounded_joints_are_projected_in_the_core(monkeypatch):
    """After many turns, the gap is that of the teeth; Python, which reduces it, is not called."""
    coupling = Closure.coupling("continuous_0", "continuous_1", (0.2, -2.5))
    gears = Mechanism(tree(["continuous", "continuous"], [0, 0]), [coupling])
    monkeypatch.setattr(PythonStepper, "advance", None)
    start = gears.assemble({"continuous_1": 0.4}, {"continuous_1": 20.0})
    sol = mbdae.solve(gears, (0, 2), *start, rtol=1e-8, project=True, backend="native")
    assert sol.success, sol.message
    driven, driving = sol.signals("q.continuous_0")["q.continuous_0"], sol.signals("q.continuous_1")["q.continuous_1"]
    assert abs(driving[-1] - driving[0]) > 20
    np.testing.assert_allclose(driven - driven[0], -2.5 * (driving - driving[0]), atol=1e-10)


@pytest.mark.slow
def test_spans_in_both_directions_and_parts():
    mech = shared_model("four_bar")
    for options in (
        {"t_span": (1.0, 0.0), "step": 0.01},
        {"t_span": (0.0, 1.0), "step": 0.01, "t_eval": np.linspace(0.05, 0.97, 31)},
        {"t_span": (0.0, 1.0), "step": 0.0301, "jumps": [0.1, 0.5]},
        {"t_span": (0.0, 0.1), "rtol": 1e-8, "max_step": 1e-3, "first_step": 1e-3},
        {"t_span": (0.0, 1.0), "step": 0.01, "max_steps": 17},
        {"t_span": (0.0, 1.0), "step": 0.01, "events": lambda t, q, v: v[0] + 1.0},
        {"t_span": (0.0, 0.0), "step": 0.01},
        {"t_span": (0.0, 0.1), "step": 5.0},
    ):
        assert_same(*both(mech, **options))


def test_failing_runs_have_the_same_message():
    bar = shared_model("four_bar")
    late = lambda t, q, v: np.full(3, np.nan if t > 0.4 else 0.0)  # noqa: E731
    wrong = lambda t, q, v: np.zeros(3 if t < 0.4 else 2)  # noqa: E731
    for mech, options in (
        (bar, {"step": 0.5, "method": "herk1"}),
        (shared_model("n_four_bar"), {"step": 0.011, "method": "pherk5"}),
        (shared_model("flyball_governor"), {"step": 0.0125}),
        (mbdae.load("four_bar", forces=[late]), {"step": 0.011}),
        (mbdae.load("four_bar", forces=[wrong]), {"step": 0.011}),
    ):
        native, python = both(mech, (0, 3), **options)
        assert (native.status, native.message) == (python.status, python.message)
        assert_near(native.y, python.y, 1e-8)
        assert native.stats["rejected"] == python.stats["rejected"]


@pytest.mark.parametrize("options", [{"step": 0.013, "project": True}, {"rtol": 1e-8, "project": True}], ids=str)
def test_singular_configurations(options):
    native, python = both(mbdae.load("n_four_bar", N=1), (0, 2), **options)
    assert len(native.singular) == len(python.singular) == 2
    for a, b in zip(native.singular, python.singular, strict=True):
        assert (a.rank, a.rank_there, a.closures) == (b.rank, b.rank_there, b.closures)
        assert a.t == pytest.approx(b.t, abs=1e-7)


# -- points and steps at random states -------------------------------------------------------------------------------


def compare_points(mech, states=6):
    rng, carrying, herk, compared = np.random.default_rng(0), METHODS["pherk4"], METHODS["herk3"], 0
    for _ in range(states):
        native, python = mech.system(native=backend.load()), mech.system()
        q, v, s = random_q(mech.model, rng), rng.uniform(-2, 2, mech.nv), rng.uniform(-1, 1, python.ns)
        t, y = rng.uniform(-1, 2), np.concatenate([q, v, s, [0.3]])
        try:
            G, w = python.derivative(t, y)
        except StepError:  # a bushing with a flipped frame
            assert native.core.derivative(t, y) is None
            continue
        compared += 1
        native.derivative(t, y)  # in Python: the rank
        F, z = native.core.derivative(t, y)
        tolerance = 1e-13 * max(10.0, 1 / python.least_pivot_ratio)
        assert_near(F, G, tolerance)
        assert_near(z, w, tolerance)
        for tableau, carry in ((herk, None), (carrying, python.carry(G, w))):
            a = native.compiled_step(tableau, t, 1e-3, State(y, carry))
            b = tableau.step(python, t, 1e-3, State(y, carry))
            assert_near(a.state.y, b.state.y, tolerance)
            assert_near(a.errors, b.errors, 10 * tolerance)  # differences of stages, which cancel
            assert_near(a.z, b.z, 1e3 * tolerance)
    assert compared > 1


@pytest.mark.parametrize("name", CASES)
def test_every_closure_and_driver(name):
    compare_points(mechanism(CASES[name]))


@pytest.mark.parametrize("kind", JOINTS)
def test_every_joint(kind):
    six = (40.0, 90.0, 20.0, 3.0, 0.7, 5.0)
    tips = {"frames": ("tip_2", "tip_3")}
    forces = [
        mbdae.Bushing(**tips, stiffness=six, damping=six),
        mbdae.SpringDamper(**tips, stiffness=20.0, damping=0.5, length=0.2),
        mbdae.Wrench(frame="tip_3", force=(1.0, 0.0, 2.0), torque=(0.0, 0.3, 0.0), axes="frame"),
    ]
    model = tree(["free", kind, "spherical", "revolute"], [0, 1, 2, 1], seed=2)
    compare_points(Mechanism(model, [Closure.revolute("tip_2", "ground")], forces[:2]))
    compare_points(Mechanism(tree([kind], [0]), [Closure.distance("tip_0", "ground", 0.3)]))
    rng = np.random.default_rng(0)
    free = Mechanism(model, [], forces)
    q, v = random_q(model, rng, 0.5), rng.uniform(-1, 1, model.nv)
    assert_same(*both(free, (0, 0.2), q, v, step=0.01))


def test_a_point_near_the_last_stage_is_computed_for_itself():
    mech = shared_model("four_bar")
    y, core = mech.point(), mech.system(native=backend.load())
    carry = core.carry(*core.derivative(0.0, y))
    for away in (0.0, 1e-12, 1e-9, 1e-4):
        near = core.compiled_step(METHODS["pherk4"], 0.0, 1e-2, State(y, carry)).state.y
        near[: mech.nq] += away
        for found, expected in zip(core.derivative(0.0, near), mech.system().derivative(0.0, near), strict=True):
            assert_near(found, expected, 1e-13)


# -- the tableau, recovered by running the core ----------------------------------------------------------------------


def slide(**options):
    """A unit mass on a slide: v' is the force."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    return Mechanism(model, **options).system(native=backend.load())


@pytest.mark.parametrize("name", TABLEAUS)
def test_the_core_recovers_the_tableau(name):
    tableau, t, h = METHODS[name], 0.7, 0.25
    a, first = tableau.arrays, int(tableau.explicit_first)
    n, seen = len(a.b), []

    def unit(t, q, v):
        seen.append((t, v[0]))
        return np.array([float(len(seen) - 1 + first == stage)])

    system = slide(forces=[unit])
    for stage in range(n):
        seen.clear()
        carry = np.array([float(stage == 0), 0.0]) if first else None
        y, _, _, _, errors = system.core.step(system.method(tableau), t, h, np.zeros(3), carry, None)
        times, speeds = np.array(seen).T
        np.testing.assert_allclose(times, t + h * a.c[first:], rtol=0, atol=1e-15)
        np.testing.assert_allclose(speeds / h, a.A[first:, stage], rtol=0, atol=1e-13)
        np.testing.assert_allclose(y[1] / h, a.b[stage], rtol=0, atol=1e-13)
        np.testing.assert_allclose(errors[:, 1] / h, a.e[:, stage], rtol=0, atol=1e-13)


@pytest.mark.parametrize("name", TABLEAUS)
def test_the_core_satisfies_the_constraint_at_the_points_of_the_tableau(name):
    tableau, t, h = METHODS[name], 0.7, 0.25
    a, first = tableau.arrays, int(tableau.explicit_first)
    n, seen = len(a.b), []

    def speed(t):  # each stage calls it twice: at the constraint point, and at the time of the stage, for the work
        seen.append(t)
        return float(len(seen) == 2 * (stage - first) + 1)

    system = slide(drivers=[Driver.function("slide", lambda t: 0.0, speed, lambda t: 0.0)])
    system.use_rows((0,))
    derivatives = np.zeros((n, n))  # of stage i, for a speed of 1 at stage k alone, or the first derivative
    for stage in range(n):
        carry = np.array([float(stage == 0), 0.0]) if first else None
        for i in range(first, n):  # weights that select one derivative
            seen.clear()
            settings = {"project_embedded": False, "doubling_order": 0, "noise": 0.0}
            weights = replace(a, b=np.eye(n)[i], e=a.e[:0])
            show = weights.compiled(system.native, explicit_first=bool(first), **settings)
            derivatives[i, stage] = system.core.step(show, t, h, np.zeros(3), carry, None)[0][1] / h
        np.testing.assert_allclose(seen[::2], t + h * a.chat[first:], rtol=0, atol=1e-15)
    derivatives[0, 0] += first
    expected = np.eye(n) / h
    expected[:first] = 0.0
    scale = np.abs(a.Ahat) @ np.abs(derivatives)
    np.testing.assert_array_less(np.abs(a.Ahat @ derivatives - expected)[first:], 1e-13 * (1 + scale[first:]))


def test_a_closure_that_closes_nothing():
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    mech = Mechanism(model, [Closure.in_plane("world", "tip", (0.0, 0.0, 1.0))])
    for options in ({"step": 0.1}, {"rtol": 1e-6, "project": True}, {"step": 0.1, "method": "herk4", "project": True}):
        native, python = both(mech, (0, 1), np.zeros(1), np.ones(1), **options)
        assert_same(native, python)
        np.testing.assert_allclose(native.q[-1], 1.0)
