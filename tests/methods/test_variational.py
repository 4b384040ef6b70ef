"""RATTLE and its compositions: orders, symmetry, constraints to rounding, long-time energy, rejections by name."""

from functools import cache

import driven
import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae import JointDamping, backend
from mbdae.errors import InputError
from mbdae.methods import METHODS
from mbdae.methods.order.claims import check_claims
from mbdae.methods.order.composition import check_composition
from mbdae.methods.variational import Composition
from mbdae.system import State

NAMES = [name for name, m in METHODS.items() if isinstance(m, Composition)]
SPANS = {"four_bar": 0.35, "heavy_top": 0.05, "bricard": 0.5, "stewart_platform": 0.075}  # s
STEPS = {"rattle2": 20, "rattle4": 10, "rattle6": 6, "rattle8": 4}  # the coarser of two numbers of steps
ROUNDING = 1e-13


@cache
def reference(name):
    sol = mbdae.solve(shared_model(name), (0, SPANS[name]), method="pherk6", step=SPANS[name] / 800)
    return sol.y[-1]


def steps_of(mech, method, T, n, y=None):
    """The system and the state after n steps from a point, the start when left out; by the core, if there is one."""
    system, state = mech.system(native=backend.load()), State(mech.point() if y is None else y)
    state = system.update_independent_rows(0.0, state)
    for i in range(n):
        state = METHODS[method].step(system, i * T / n, T / n, state).state
    return system, state


def observed(mech, method, T, n, end, order_of_ends=2):
    """Slope between n and 2n steps of the errors at T."""
    errors = []
    for k in (n, order_of_ends * n):
        system, state = steps_of(mech, method, T, k)
        errors.append(np.abs(system.difference(end, state.y)[:-1]).max())
    return np.log2(errors[0] / errors[1])


@pytest.mark.parametrize("method", NAMES)
@pytest.mark.parametrize("name", SPANS)
def test_orders(name, method):
    order = observed(shared_model(name), method, SPANS[name], STEPS[method], reference(name))
    assert order > METHODS[method].order - 0.2


@pytest.mark.parametrize("method", ["rattle2", "rattle6"])
@pytest.mark.parametrize("name", SPANS)
def test_a_step_back_returns_and_loops_stay_closed(name, method):
    mech = shared_model(name)
    system, state = steps_of(mech, method, 0.02, 4)
    there = METHODS[method].step(system, 0.02, 0.01, State(state.y))
    back = METHODS[method].step(system, 0.03, -0.01, State(there.state.y))
    scale = 1 + system.component_magnitudes(state.y)
    assert np.abs(system.difference(state.y, back.state.y) / scale).max() < ROUNDING
    g, rate = system.residual(0.03, *system.split(there.state.y))
    assert np.abs(g).max() < ROUNDING
    assert np.abs(rate).max() < ROUNDING * (1 + np.abs(there.state.y).max())


@pytest.mark.parametrize("name", ["four_bar", "heavy_top", "stewart_platform"])
def test_newton_converges_quadratically(name):
    system, _ = steps_of(shared_model(name), "rattle4", 0.1, 10)
    substeps = 10 * len(METHODS["rattle4"].weights)
    assert 2 <= system.counts.newton / substeps < 3.8


def test_partials_of_the_momentum_equation():
    mech, rng = driven.platform(), np.random.default_rng(0)
    system = mech.system()
    y = mech.point()
    step = system.variational_step(0.0, 0.1, y)
    x, lam = 0.3 * rng.standard_normal(mech.nv), rng.standard_normal(len(step.rows))
    dx, dlam = step.correction(x, lam)
    previous = np.inf
    for _ in range(5):  # quadratic: each change is of the size of the square of the last one
        x, lam = x + dx, lam + dlam
        dx, dlam = step.correction(x, lam)
        size = np.abs(dx).max()
        assert size < max(20 * previous**2, 1e-14)
        previous = size
    assert previous < 1e-14


@pytest.mark.parametrize("method", ["rattle2", "rattle4"])
@pytest.mark.parametrize("name", ["crane", "platform"])
def test_drivers_and_their_work(name, method):
    mech, T = getattr(driven, name)(), 0.2
    best = mbdae.solve(mech, (0, T), method="pherk6", step=T / 400).y[-1]
    errors = []
    for n in (10, 20):
        system, state = steps_of(mech, method, T, n)
        errors.append(np.abs(system.difference(best, state.y)))
        g, rate = system.residual(T, *system.split(state.y))
        assert max(np.abs(g).max(), np.abs(rate).max()) < ROUNDING
    assert np.log2(errors[0][:-1].max() / errors[1][:-1].max()) > METHODS[method].order - 0.25
    assert np.log2(errors[0][-1] / errors[1][-1]) > METHODS[method].order - 0.5


def test_damping_keeps_order_and_symmetry():
    mech = mbdae.load("four_bar", forces=[JointDamping(joint="crank", damping=0.4)])
    best = mbdae.solve(mech, (0, 0.5), method="pherk6", step=1e-3).y[-1]
    assert observed(mech, "rattle4", 0.5, 20, best) > 3.8
    system, state = steps_of(mech, "rattle4", 0.1, 4)
    there = METHODS["rattle4"].step(system, 0.1, 0.01, State(state.y)).state
    back = METHODS["rattle4"].step(system, 0.11, -0.01, State(there.y)).state
    assert np.abs(system.difference(state.y, back.y)).max() < ROUNDING


def test_the_energy_of_long_runs_is_bounded():
    mech = shared_model("pendulum")
    sol = mbdae.solve(mech, (0, 120), method="rattle2", step=0.05)
    energy = np.array([sum(mech.system().energy(q, v)) for q, v in zip(sol.q[::4], sol.v[::4], strict=True)])
    third = len(energy) // 3
    swing = [np.ptp(energy[:third]), np.ptp(energy[-third:])]
    assert swing[1] < 1.02 * swing[0]
    assert abs(energy[:third].mean() - energy[-third:].mean()) < 0.02 * swing[0]


def test_events_are_located_at_full_order():
    times = []
    for method, step in (("rattle6", 0.02), ("pherk6", 0.001)):
        sol = mbdae.solve("four_bar", (0, 0.5), method=method, step=step, events="q.crank = 0.9")
        times.append(sol.events[0][0][0])
    assert abs(times[0] - times[1]) < 1e-8


@pytest.mark.parametrize(
    ("model", "options", "named"),
    [
        ("bicycle", {"step": 0.01}, "'rear_wheel'"),
        ("pendulum_on_stop", {"step": 0.01}, "'rod stop'"),
        ("four_bar", {"step": 0.01, "formulation": "ggl"}, "formulation 'ggl'"),
        ("circle", {"step": 0.01}, "'Point on a circle'"),
        ("four_bar", {"rtol": 1e-6}, "takes fixed steps"),
    ],
)
def test_rejections_name_the_reason(model, options, named):
    with pytest.raises(InputError, match="'rattle4'.*" + named.replace("(", r"\(")):
        mbdae.solve(model, (0, 0.1), method="rattle4", **options)


def test_states_of_controllers_are_rejected():
    mech = mbdae.load("four_bar", forces=[mbdae.JointPID(joint="crank", kp=1.0, ki=1.0, name="servo")])
    with pytest.raises(InputError, match="'rattle2' does not take 'servo"):
        mbdae.solve(mech, (0, 0.1), method="rattle2", step=0.01)


def test_comparisons_refuse_before_they_run():
    with pytest.raises(InputError, match="'rattle4' takes fixed steps"):
        mbdae.compare("four_bar", (0, 0.1), methods=["rattle4"], rtol=[1e-4])
    with pytest.raises(InputError, match="'rattle4' does not take 'rear_wheel'"):
        mbdae.compare("bicycle", (0, 0.1), methods=["rattle4"], steps=[10])


@pytest.mark.parametrize("name", NAMES)
def test_claims_are_proven(name):
    report = check_claims(METHODS[name])
    assert report.holds
    assert report.order == METHODS[name].order
    assert report.failure


def test_wrong_weights_are_refuted():
    good = METHODS["rattle6"]
    off = good.half[0][:-14] + "0" + good.half[0][-13:]
    broken = check_composition(Composition("off", "", "", (off, *good.half[1:]), 6))
    assert not broken.holds
    assert broken.order < 6
    powers = check_composition(Composition("three", "", "", ("1", "-1", "1"), 4))  # symmetric, sum 1, no order 4
    assert powers.symmetric
    assert powers.order == 2


def test_times_of_a_comparison_are_those_of_one_back_end():
    study = mbdae.compare("pendulum", (0, 0.1), methods=["gauss2", "pherk6"], steps=[5], repeats=0)
    assert "steps of gauss2" in str(study.to_dict())
