"""Radau IIA runs: observed orders, manifolds, stiffness, error control, reuse and failure."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from chains import random_q, tree

import mbdae
from mbdae import Closure, DCMotor, Driver, Hessenberg, JointDamping, Mechanism, SpringDamper, order
from mbdae.methods import method
from mbdae.methods.collocation import StageMemory
from mbdae.methods.radau import RadauIIA
from mbdae.system import State
from mbdae.textbook.problems import hessenberg_a

NAMES = [name for name, m in mbdae.METHODS.items() if isinstance(m, RadauIIA)]
ANDREWS = {  # at t = 0.03; quadruple precision, two codes that agree to 1e-12
    "beta": 15.8107711951537072507,
    "Theta": -15.7563710584118396600,
    "gamma": 0.0408222401196458004310,
    "Phi": -0.5347301163420796028546,
    "delta": 0.5244099658799540702388,
    "Omega": 0.5347301163420796033633,
    "epsilon": 1.0480807410419378693412,
}


def free_loop():
    """A free-flying loop of spherical, continuous and revolute joints, and its consistent start."""
    model = tree(["free", "spherical", "continuous", "revolute", "spherical"], [0, 1, 2, 1, 4], seed=3)
    mech = Mechanism(model, [Closure.point("tip_2", "tip_4")], [JointDamping(joint="revolute_3", damping=2.0)])
    rng = np.random.default_rng(0)
    return mech, mech.assemble(random_q(model, rng, 0.5), rng.uniform(-1, 1, mech.nv))


def planar(*forces):
    mech = mbdae.load("four_bar")
    return Mechanism(mech.model, mech.closures, forces, start=mech.start_values)


def governor():
    """A flyball governor: two arms with balls on a turning shaft, held by stiff spring-dampers to a ring."""
    model, here = pin.Model(), pin.SE3.Identity()
    model.gravity.linear = np.array([0, 0, -9.81])
    shaft = model.addJoint(0, pin.JointModelRZ(), here, "shaft")
    model.appendBodyToJoint(shaft, pin.Inertia(0.3, np.array([0, 0, 0.5]), np.diag([0.025, 0.025, 5e-6])), here)
    for k, turn in enumerate((np.eye(3), np.diag([-1.0, -1.0, 1.0]))):
        arm = model.addJoint(shaft, pin.JointModelRY(), pin.SE3(turn, np.array([0, 0, 1.0])), f"arm_{k}")
        rod = pin.Inertia(0.3, np.array([0.5, 0, 0]), np.diag([5e-6, 0.025, 0.025]))
        model.appendBodyToJoint(arm, rod + pin.Inertia(5.0, np.array([1.0, 0, 0]), np.zeros((3, 3))), here)
        middle = pin.SE3(np.eye(3), np.array([0.5, 0, 0]))
        model.addFrame(pin.Frame(f"middle_{k}", arm, middle, pin.FrameType.OP_FRAME))
    ring = model.addJoint(shaft, pin.JointModelPZ(), here, "ring")
    model.appendBodyToJoint(ring, pin.Inertia(3.0, np.zeros(3), 0.005 * np.eye(3)), here)
    model.addFrame(pin.Frame("ring_frame", ring, here, pin.FrameType.OP_FRAME))
    springs = [
        SpringDamper(frames=("ring_frame", f"middle_{k}"), stiffness=8e5, damping=4e4, length=0.5) for k in (0, 1)
    ]
    mech = Mechanism(model, [], springs)
    lean = np.pi / 2 - np.deg2rad(30)
    q = {"arm_0": lean, "arm_1": lean, "ring": 1 - np.cos(np.deg2rad(30))}
    return mech, mech.assemble(q, {"shaft": 2 * np.pi})


def samples(problem, sol, count):
    """The quantities of an order study at ten times."""
    at = np.arange(1, 11) * (count // 10)
    if problem.title.startswith("Hessenberg"):
        return sol.y[at], sol.z_own[at], sol.z[at]
    return sol.q[at], sol.v[at], sol.lam_own[at], sol.lam[at]


@cache
def reference(name, T):
    if name == "hessenberg_a":
        values = [hessenberg_a().exact(t) for t in np.arange(1, 11) * T / 10]
        y, z = (np.array([v[i] for v in values]) for i in (0, 1))
        return y, z, z
    mech = mbdae.load(name)
    q, v, _, lam = samples(mech, mbdae.solve(mech, (0, T), method="pherk6", step=T / 2000), 2000)
    return q, v, lam, lam


@pytest.mark.parametrize("problem", ["pendulum", "four_bar", "hessenberg_a"])
@pytest.mark.parametrize(("name", "counts"), [("radau1", (250, 500)), ("radau3", (100, 200)), ("radau5", (80, 160))])
def test_observed_orders(problem, name, counts):
    model, T, m = hessenberg_a() if problem == "hessenberg_a" else mbdae.load(problem), 1.0, method(name)
    errors = []
    for n in counts:
        found = samples(model, mbdae.solve(model, (0, T), method=name, step=T / n), n)
        errors.append([np.abs(x - y).max() for x, y in zip(found, reference(problem, T), strict=True)])
    slopes = np.log2(np.array(errors[0]) / errors[1])
    claims = np.array([m.order] * (len(slopes) - 2) + [m.order_own, m.order])
    assert (slopes > claims - 0.2).all(), slopes
    assert (slopes < claims + 0.5).all(), slopes


def test_order_study():
    study = order(mbdae.load("pendulum"), NAMES[1:])
    assert study.holds, study


@pytest.mark.parametrize(("name", "n"), [("radau3", 10), ("radau5", 6), ("radau7", 4)])
def test_orders_on_a_free_flying_loop(name, n):
    mech, start = free_loop()
    T, manifold = 0.2, mech.manifold
    best = mbdae.solve(mech, (0, T), *start, method="pherk6", step=T / 640)
    errors = []
    for count in (n, 2 * n):
        sol = mbdae.solve(mech, (0, T), *start, method=name, step=T / count)
        assert sol.success, sol.message
        assert np.abs(np.linalg.norm(sol.q[:, 3:7], axis=1) - 1).max() < 1e-14
        gaps = (manifold.difference(best.q[-1], sol.q[-1]), sol.v[-1] - best.v[-1], sol.work[-1] - best.work[-1])
        errors.append([np.abs(x).max() for x in gaps])
    slopes = np.log2(np.array(errors[0]) / errors[1])
    assert (slopes > method(name).order - 0.25).all(), slopes


@pytest.mark.parametrize("formulation", ["index2", "ggl"])
def test_many_stages(formulation):
    mech = mbdae.load("four_bar")
    reference = mbdae.solve(mech, (0, 1), method="pherk6", step=1 / 1280).q[-1]
    for s in (4, 5, 8, 12):
        sol = mbdae.solve(mech, (0, 1), method=f"radau{2 * s - 1}", step=1 / 64, formulation=formulation)
        np.testing.assert_allclose(sol.q[-1], reference, rtol=0, atol=1e-7 if s == 4 else 1e-9)


def test_time_dependent_textbook_problem():
    """y1' = z, y2' = y1 z + y2 cos t, 0 = y1 - sin t: y2 = ..., checked with another family."""
    problem = Hessenberg(
        f=lambda t, y, z: np.array([z[0], y[0] * z[0] + y[1] * np.cos(t)]),
        g=lambda t, y: np.array([y[0] - np.sin(t)]),
        y0=(0.0, 1.0),
        z0=(1.0,),
        exact=lambda t: (np.array([np.sin(t), 2 * np.exp(np.sin(t)) - np.sin(t) - 1]), np.array([np.cos(t)])),
    )
    for name in NAMES:
        m = method(name)
        errors = []
        for n in (8, 16, 32):
            sol = mbdae.solve(problem, (0, 1), method=name, step=1 / n)
            y, z = problem.exact(1.0)
            errors.append([abs(sol.y[-1, 1] - y[1]), abs(sol.z_own[-1, 0] - z[0])])
        slopes = -np.diff(np.log2(errors), axis=0)[-1]
        assert slopes[0] > m.order - 0.3
        assert slopes[1] > m.order_own - 0.3


def test_andrews_squeezer_to_ten_digits():
    mech = mbdae.load("andrews_squeezer")
    sol = mbdae.solve(mech, (0, 0.03), method="radau5", rtol=1e-10, atol=1e-12)
    error = max(abs(q - ANDREWS[name]) for name, q in zip(mech.joint_names, sol.q[-1], strict=True))
    assert sol.success
    assert error < 1e-10
    assert sol.stats["steps"] < 1800
    assert 0 < sol.stats["newton"] < 6 * sol.stats["steps"]


@pytest.mark.parametrize("name", ["radau3", "radau5"])
def test_error_follows_the_tolerance(name):
    mech = mbdae.load("four_bar")
    reference = mbdae.solve(mech, (0, 1), method="pherk6", step=1 / 1280)
    rtols = (1e-4, 1e-6, 1e-8, 1e-10)[: 4 if name == "radau5" else 3]
    errors = [np.abs(mbdae.solve(mech, (0, 1), method=name, rtol=r).q[-1] - reference.q[-1]).max() for r in rtols]
    ratios = np.array(errors) / rtols
    assert ratios.max() / ratios.min() < 100
    assert ratios.max() < 100


def test_stiff_mechanisms_take_few_steps():
    damped = planar(JointDamping(joint="coupler", damping=5e3))
    stiff, start = governor()
    for mech, (q, v), T in ((damped, damped.start, 1.0), (stiff, start, 0.3)):
        runs = {m: mbdae.solve(mech, (0, T), q, v, method=m, rtol=1e-6) for m in ("radau5", "pherk5", "herk5")}
        steps = {m: sol.stats["steps"] for m, sol in runs.items()}
        assert all(sol.success for sol in runs.values())
        assert 10 * steps["radau5"] < min(steps["pherk5"], steps["herk5"]), steps
        for sol in runs.values():
            np.testing.assert_allclose(sol.q[-1], runs["herk5"].q[-1], rtol=0, atol=1e-6)
    huge = planar(JointDamping(joint="coupler", damping=1e5))
    assert mbdae.solve(huge, (0, 10), method="radau5", rtol=1e-6).stats["steps"] < 100


def test_energy_balance_has_the_full_order():
    mech = planar(JointDamping(joint=("crank", "rocker"), damping=0.5))
    balances = []
    for n in (40, 80, 160):
        sol = mbdae.solve(mech, (0, 1), method="radau5", step=1 / n)
        first, last = (sum(mech.energy(sol.q[i], sol.v[i])) for i in (0, -1))
        balances.append(abs(last - first - sol.work[-1]))
    assert balances[-1] < 1e-6
    assert np.log2(balances[0] / balances[2]) / 2 > 4.5


def test_states_drivers_and_fast_currents():
    """A motor whose current relaxes within 1e-5 s turns a crank; a driver turns the same one."""
    motor = DCMotor(joint="crank", voltage=12.0, resistance=1.0, inductance=1e-5, constant=0.5)
    mech = planar(motor)
    stiff = mbdae.solve(mech, (0, 0.2), method="radau5", rtol=1e-7)
    with pytest.warns(UserWarning, match="stiff: .* try -m radau9"):
        quick = mbdae.solve(mech, (0, 0.2), method="pherk5", rtol=1e-7)
    assert stiff.stats["steps"] < 0.05 * quick.stats["steps"]
    np.testing.assert_allclose(stiff.q[-1], quick.q[-1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(stiff.s[-1], quick.s[-1], rtol=0, atol=1e-4)
    base = mbdae.load("four_bar")
    turn = {"kind": "polynomial", "coefficients": (float(base.start[0][0]), 0.0, 1.0)}
    driven = Mechanism(base.model, base.closures, drivers=[Driver(joint="crank", motion=turn)], start=base.start_values)
    a, b = (mbdae.solve(driven, (0, 0.5), method=m, rtol=1e-9) for m in ("radau5", "pherk5"))
    np.testing.assert_allclose(a.q[-1], b.q[-1], rtol=0, atol=1e-8)
    np.testing.assert_allclose(a.work[-1], b.work[-1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(a.lam_own[-1], a.lam[-1], rtol=0, atol=1e-4)


def steps(name, system, state, count, h=0.01, take="step"):
    m = method(name)
    for i in range(count):
        state = getattr(m, take)(system, i * h, h, state).state
    return state


@pytest.mark.parametrize("name", NAMES)
def test_a_step_is_pure(name):
    mech = mbdae.load("four_bar")
    system, m = mech.system(), method(name)
    state = steps(name, system, State(mech.point()), 2)
    first = m.controlled_step(system, 0.02, 0.01, state)
    m.controlled_step(system, 0.02, 0.03, state)
    steps(name, system, State(mech.point(mech.start[0], np.zeros(3))), 1)
    again = m.controlled_step(system, 0.02, 0.01, state)
    np.testing.assert_array_equal(first.state.y, again.state.y)
    np.testing.assert_array_equal(first.errors, again.errors)
    assert first.errors.shape == (1 + (m.stages >= 3), system.ny)
    plain = m.step(system, 0.02, 0.01, state)
    np.testing.assert_allclose(plain.state.y, first.state.y, rtol=0, atol=1e-15)
    assert plain.errors.shape == (0, system.ny)


def test_memory_is_kept_only_where_it_fits():
    mech = mbdae.load("four_bar")
    system = mech.system()
    state = steps("radau5", system, State(mech.point()), 3)
    assert isinstance(state.carry, StageMemory)
    plain = steps("radau5", system, State(state.y), 1)
    for carry in (state.carry, state.carry._replace(unknowns=(7, 8)), steps("radau3", system, state, 1).carry, "other"):
        other = steps("radau5", system, State(state.y, carry), 1)
        np.testing.assert_allclose(other.y, plain.y, rtol=0, atol=2e-15)


def test_partials_are_reused():
    mech = mbdae.load("pendulum")
    sol = mbdae.solve(mech, (0, 1), method="radau5", step=1e-3)
    linearized = sol.stats["M"] - sol.stats["steps"]
    assert linearized < 0.1 * sol.stats["steps"]
    assert sol.stats["factorizations"] - sol.stats["M"] < 0.3 * sol.stats["steps"]
    assert mbdae.solve(mech, (0, 1), method="pherk5", step=1e-2).stats["newton"] == 0


@pytest.mark.parametrize(("name", "T", "n"), [("andrews_squeezer", 0.03, 400), ("rolling_disc", 1.0, 10)])
def test_a_second_change_as_large_as_the_first_does_not_end_an_iteration(name, T, n):
    """The first one corrects positions, and so moves velocities off their rows: the second corrects these."""
    mech = mbdae.load(name)
    sol, fine = (mbdae.solve(mech, (0, T), method="radau5", step=T / m) for m in (n, 4 * n))
    assert (sol.status, sol.stats["steps"]) == ("finished", n)
    assert np.abs(mech.manifold.difference(fine.q[-1], sol.q[-1])).max() < 3e-3


def test_backwards_in_time_and_back():
    mech = mbdae.load("four_bar")
    there = mbdae.solve(mech, (0, 0.5), method="radau5", rtol=1e-9)
    back = mbdae.solve(mech, (0.5, 0), there.q[-1], there.v[-1], method="radau5", rtol=1e-9)
    np.testing.assert_allclose(back.q[-1], there.q[0], rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", NAMES)
def test_failures_keep_what_was_computed(name):
    mech = mbdae.load("four_bar")
    sol = mbdae.solve(mech, (0, 50), method=name, step=5.0)
    assert sol.status == "newton"
    assert "does not converge" in sol.message
    assert len(sol.t) >= 1

    def wild(t, q, v):
        return np.full(3, np.nan) if t > 0.3 else np.zeros(3)

    sol = mbdae.solve(planar(wild), (0, 1), method=name, rtol=1e-4)
    assert (sol.status, round(sol.t[-1], 3)) == ("nonfinite", 0.3)


@pytest.mark.usefixtures("back_end")
def test_iterations_follow_the_tolerance():
    def iterations(**options):
        stats = mbdae.solve("four_bar", (0.0, 0.5), method="radau5", **options).stats
        return stats["newton"] / (stats["steps"] + stats["rejected"])
    assert iterations(rtol=1e-4) < 4.5 < 7 < iterations(step=0.02)
    reference = mbdae.solve("four_bar", (0.0, 0.5), rtol=1e-12).q[-1]
    for rtol in (1e-4, 1e-6, 1e-8):
        q = mbdae.solve("four_bar", (0.0, 0.5), method="radau5", rtol=rtol).q[-1]
        assert np.abs(q - reference).max() < 10 * rtol
