"""Explicit methods for accelerations: order conditions, the published program, observed orders on both back ends."""

from fractions import Fraction

import numpy as np
import pytest
from chains import random_q, tree
from motions import distance, model, run
from scipy.integrate import DOP853
from shared import shared_model

import mbdae
from mbdae import Mechanism
from mbdae.methods import EXPLICIT
from mbdae.methods.controller import Controller, error_norm
from mbdae.methods.order.trees import plain_trees
from mbdae.methods.order.weights import Weights
from mbdae.system import State
from mbdae.tolerances import PUBLISHED_DECIMALS

every = pytest.mark.parametrize("name", EXPLICIT)


@every
def test_conditions_hold_as_claimed_and_fail_at_the_next_order(name):
    """On all rooted trees of ordinary differential equations: 200 up to order 8."""
    m = EXPLICIT[name]
    weights = Weights(m)
    rows = (m.exact_b, *m.exact_embedded)
    for row, claim in zip(rows, (m.order, m.order_embedded, m.order_companion), strict=True):
        weight = weights.sums(row)
        residual = [max(abs(weight(t) - 1 / t.gamma) for t in plain_trees(k)) for k in range(1, claim + 2)]
        assert max(residual[:-1]) <= Fraction(PUBLISHED_DECIMALS)
        assert residual[-1] > 1e-6
    assert m.error_power == 8


def chain():
    """A tree of three joints without closures: an ordinary differential equation in a vector space."""
    mech = Mechanism(tree(["revolute", "rx", "prismatic"], [0, 1, 2], seed=1))
    rng = np.random.default_rng(0)
    return mech, np.concatenate([random_q(mech.model, rng, 0.5), rng.uniform(-1, 1, mech.nv), [0.0]])


@pytest.mark.usefixtures("back_end")
def test_a_step_is_that_of_the_published_program():
    """State and error norm, and the unlimited size of the next step, are those of scipy's port."""
    mech, y = chain()
    system, plain, h = mech.system(), mech.system("index1"), 0.02
    system = type(plain)(mech) if system.native is None else mech.system("index1", native=system.native)
    state = State(y, system.carry(*system.derivative(0.0, y)))
    step = EXPLICIT["dop853"].controlled_step(system, 0.0, h, state)
    there = DOP853(lambda t, y: plain.rate(t, y)[0], 0.0, y, 1.0, rtol=1e-8, atol=1e-10, first_step=h, max_step=h)
    there.step()
    assert there.t == h
    np.testing.assert_allclose(step.state.y, there.y, rtol=0, atol=1e-14)
    scale = 1e-10 + 1e-8 * np.maximum(np.abs(y), np.abs(there.y))
    expected = there._estimate_error_norm(there.K, h, scale)
    assert error_norm(step.errors, scale, blend=2.0) == pytest.approx(expected, rel=1e-4)
    assert error_norm(step.errors, scale) != pytest.approx(expected, rel=1e-2)


def test_step_sizes_change_as_in_the_published_program():
    """h_new = h min(6, max(1/3, 0.9 err^(-1/8))), and not above h after a rejected step."""
    m = EXPLICIT["dop853"]
    for error, factor in ((0.5, 0.9 * 0.5 ** (-1 / 8)), (1e-9, 6.0), (3.0, 0.9 * 3.0 ** (-1 / 8)), (1e9, 1 / 3)):
        assert Controller(m.error_power, m.control).next_step(0.1, error) == pytest.approx(0.1 * factor, rel=1e-14)
    control = Controller(m.error_power, m.control)
    control.next_step(0.1, 2.0)
    assert control.next_step(0.1, 1e-9) == 0.1


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(("name", "T"), [("four_bar", 1.0), ("heavy_top", 0.1)])
def test_order_of_q_v_and_lam(name, T):
    """In a vector space and on a sphere's rotations, at ten times; lam of a step is that of the hidden constraint."""
    mech, errors = model(name), []
    reference = mbdae.solve(mech, (0, T), method="radau13", step=T / 40)
    for n in (20, 40):
        sol = run(mech, T, method="dop853", formulation="index1", step=T / n)
        lam = sol.lam_own[n // 10 :: n // 10] - reference.lam[4::4]
        np.testing.assert_allclose(sol.lam_own, sol.lam, rtol=0, atol=1e-12 * np.abs(sol.lam).max())
        errors.append((*distance(mech, reference, sol, 10), np.abs(lam).max()))
    assert np.log2(np.divide(*errors)).min() >= 7.8, errors


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("name", ["four_bar", "free_loop", "heavy_top"])
def test_controlled_runs_agree_with_index2(name):
    mech, T = model(name), 0.1 if name == "heavy_top" else 0.5
    reference = run(mech, T, method="pherk6", rtol=1e-12)
    for options in ({}, {"baumgarte": (5.0, 5.0)}, {"project": True}):
        sol = run(mech, T, method="dop853", formulation="index1", rtol=1e-9, **options)
        assert max(distance(mech, reference, sol)) < 1e-7
        gap, rate = (np.abs(r).max(initial=0) for r in mech.residual(sol.q[-1], sol.v[-1]))
        assert max(gap, rate) < (1e-13 if "project" in options else 1e-7) * (1 + np.abs(sol.v[-1]).max())


def test_work_is_fewer_evaluations_than_scipys_for_the_same_steps():
    """The evaluation at the end of a step is reused by the next one."""
    mech = shared_model("four_bar")
    sol = run(mech, 1.0, method="dop853", formulation="index1", step=0.05)
    assert sol.stats["solves"] == 12 * sol.stats["steps"] + 1


def test_it_is_no_method_of_index2():
    with pytest.raises(mbdae.MbdaeError, match="'dop853' belongs to formulation 'index1'"):
        mbdae.solve(shared_model("four_bar"), (0, 1), method="dop853")
