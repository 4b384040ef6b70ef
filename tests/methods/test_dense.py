"""Dense output: polynomials of any order exist, and have that order."""

from itertools import pairwise

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae.hermite import fit, nodes, powers, refine
from mbdae.textbook.problems import TEXTBOOK

SWEEPS = range(9)


@pytest.mark.parametrize("highest", [1, 2])
@pytest.mark.parametrize("m", SWEEPS)
def test_a_polynomial_is_recovered(highest, m):
    degree = 2 * highest + 1 + m
    c = np.random.default_rng(m).normal(size=(degree + 1, 2))
    ends = [(powers(0.0, degree, d) @ c, powers(1.0, degree, d) @ c) for d in range(highest + 1)]
    inner = np.array([powers(s, degree, highest) @ c for s in nodes(m)]).reshape(m, 2)
    np.testing.assert_allclose(fit(ends, inner), c, atol=1e-6)
    assert ((nodes(m) > 0) & (nodes(m) < 1)).all()


@pytest.mark.parametrize("sweeps", [0, 1, 2, 3, 4, 5])
def test_each_sweep_raises_the_order_by_one(sweeps):
    """On y' = -y^2, y = 1/(1 + t), from -h/2 to h/2."""

    def error(h):
        y = np.array([[1 / (1 - h / 2)], [1 / (1 + h / 2)]])
        ends = [(y[0], y[1]), (-h * y[0] ** 2, -h * y[1] ** 2)]
        c = refine(ends, lambda theta, c: -h * (powers(theta, len(c) - 1) @ c) ** 2, sweeps)
        return max(abs((powers(s, len(c) - 1) @ c)[0] - 1 / (1 + (s - 0.5) * h)) for s in np.linspace(0, 1, 20))

    assert np.log2(error(0.2) / error(0.1)) > 4 + sweeps - 0.2


@pytest.mark.parametrize("order", [4, 5, 6, 7])
def test_a_step_of_a_mechanism_is_read_at_the_wanted_order(order):
    """Errors of v decrease as h^(order + 1), those of q by one more, between points and rates of a tight reference."""
    mech, t, errors = shared_model("pendulum"), 0.3, []
    for h in (0.1, 0.05):
        times = [t, t + 0.4 * h, t + h]
        y0, y, y1 = mbdae.solve(mech, (0, t + h), method="pherk6", step=0.0025, t_eval=times).y
        system = mech.system()
        rates = system.derivative(t, y0)[0], system.derivative(t + h, y1)[0]
        off = np.abs(system.interpolant(t, h, (y0, y1), rates, order)(0.4) - y)
        errors.append((off[: mech.nq].max(), off[mech.nq : -1].max()))
    of_q, of_v = np.log2(np.divide(*errors))
    assert of_v > order + 1 - 0.2
    assert of_q > order + 2 - 0.2


@pytest.mark.parametrize(("method", "steps"), [("pherk4", 20), ("pherk5", 10), ("pherk6", 10)])
def test_between_steps_the_order_is_that_of_the_steps(method, steps):
    problem, errors = TEXTBOOK["hessenberg_a"](), []
    for n in (steps, 2 * steps):
        sol = mbdae.solve(problem, (0, 1), method=method, step=1 / n)
        times = (np.arange(n)[:, None] + [0.31, 0.5, 0.77]).ravel() / n
        errors.append(max(np.abs(sol.point(t) - problem.exact(t)[0]).max() for t in times))
    assert np.log2(np.divide(*errors)) > mbdae.METHODS[method].order - 0.2


@pytest.mark.parametrize("order", range(3, 10))
def test_problems_offer_every_order(order):
    for problem, method in ((TEXTBOOK["hessenberg_a"](), "pherk5"), (shared_model("four_bar"), "pherk6")):
        sol = mbdae.solve(problem, (0, 1), method=method, rtol=1e-8)
        exact = sol.point(0.5123)
        sol.settings["dense_order"] = order
        sol._dense.clear()
        np.testing.assert_allclose(sol.point(0.5123), exact, atol=1e-6)


@pytest.mark.parametrize("model", ["slider_crank", "four_bar", "panda_handle", "jansen_walker", "stewart_platform"])
@pytest.mark.parametrize("span", [(0.0, 0.3), (0.3, 0.0)])
def test_points_at_once_are_points_one_by_one(model, span):
    forces = [mbdae.JointDamping(joint="crank", damping=0.1)] if model == "slider_crank" else []
    mech = mbdae.load(model, forces=forces)  # work of damping, of the walker's driver; a platform on a curved manifold
    sol = mbdae.solve(mech, span, rtol=1e-6)
    times = np.concatenate([np.linspace(*span, 23), sol.t[3:5]])
    together = np.array(list(sol.points(times)))
    apart = np.array([sol.point(t) for t in times])
    size = np.abs(apart).max(axis=0)
    assert (np.abs(together - apart) <= 1e-11 * (1 + size)).all()
    np.testing.assert_array_equal(together[-2:], sol.y[3:5])
    np.testing.assert_allclose(sol(times).v, apart[:, mech.nq : mech.nq + mech.nv], rtol=0, atol=1e-9)
    for outside in (0.4, np.nan):
        with pytest.raises(mbdae.MbdaeError, match="outside the solution"):
            sol(np.array([0.1, outside]))


def test_the_steps_of_many_times_are_found_at_once(monkeypatch):
    """Of a motion with modes, whose points are computed one by one."""
    sol = mbdae.solve("pendulum_on_stop", (0.0, 1.0), rtol=1e-6)
    (impact,) = (t for t, after in pairwise(sol.t) if after - t <= sol.jump_margin)
    times = np.sort(np.concatenate([np.linspace(0.0, 1.0, 40), sol.t, [impact]]))
    apart = np.array([sol.point(t) for t in times])
    find, found = type(sol).before, []
    monkeypatch.setattr(type(sol), "before", lambda sol, t: found.append(len(t)) or find(sol, t))
    np.testing.assert_array_equal(np.array(list(sol.points(times))), apart)
    assert max(found) == len(times)
    assert len(found) <= 2
