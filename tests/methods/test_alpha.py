"""Generalized alpha and HHT: orders, constraints, agreement with an independent implementation, rejections by name."""

from dataclasses import replace
from fractions import Fraction
from functools import cache

import driven
import numpy as np
import pytest
from scipy.optimize import fsolve
from shared import shared_model

import mbdae
from mbdae.errors import InputError
from mbdae.methods import METHODS, method
from mbdae.methods.alpha import GeneralizedAlpha
from mbdae.methods.order.alpha import check_alpha
from mbdae.methods.order.claims import check_claims
from mbdae.system import State

NAMES = [name for name, m in METHODS.items() if isinstance(m, GeneralizedAlpha)]
SPANS = {"four_bar": 0.5, "heavy_top": 0.05, "bricard": 0.5}  # s
ROUNDING = 1e-13


@cache
def reference(name):
    return mbdae.solve(shared_model(name), (0, SPANS[name]), method="pherk6", step=SPANS[name] / 400)


@pytest.mark.parametrize("name", SPANS)
@pytest.mark.parametrize("used", [*NAMES, "alpha0.5"])
def test_order_2_of_q_v_and_multipliers(name, used):
    mech, best, errors = shared_model(name), reference(name), []
    for n in (80, 160):
        sol = mbdae.solve(mech, (0, SPANS[name]), method=used, step=SPANS[name] / n)
        at = slice(n // 4, None, n // 4)
        q = np.abs(mech.manifold.difference(best.q[-1], sol.q[-1])).max()
        errors.append([q, np.abs(sol.v[-1] - best.v[-1]).max(), np.abs(sol.lam_own[at] - best.lam[100::100]).max()])
    assert (np.log2(np.divide(*errors)) > 1.8).all()


@pytest.mark.parametrize("name", SPANS)
def test_levels_of_both_forms(name):
    for used in NAMES:
        sol = mbdae.solve(name, (0, SPANS[name]), method=used, step=SPANS[name] / 20)
        found = mbdae.drift(sol)
        assert found.g_max < ROUNDING
        assert found.Gv_max < (ROUNDING * (1 + np.abs(sol.v).max()) if METHODS[used].stabilized else 0.1)


def independent(rho, h, n):
    """Points of the Cartesian pendulum in stabilized index-2 form, with numerical partials; mass and length are 1."""
    am, af = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    gamma = 0.5 + af - am
    beta = (gamma + 0.5) ** 2 / 4
    weight = np.array([0.0, 0.0, -9.81])
    x, v = np.array([-0.6, 0.0, -0.8]), np.array([0.8, 0.0, -0.6])

    def acceleration(x, v):
        lam = -(v @ v + x @ weight) / (x @ x)
        return weight + lam * x

    offset = am - af
    dv = acceleration(x, v)
    ahead = abs(offset) * h
    a = dv + np.sign(offset) * (acceleration(x + ahead * v, v + ahead * dv) - dv)
    out = [x]
    for _ in range(n):

        def step(u, x=x, v=v, a=a, dv=dv):
            dv1, lam, mu = u[:3], u[3], u[4]
            a1 = ((1 - af) * dv1 + af * dv - am * a) / (1 - am)
            x1 = x + h * v + h * h * ((0.5 - beta) * a + beta * a1) + mu * x
            v1 = v + h * ((1 - gamma) * a + gamma * a1)
            return x1, v1, a1, np.array([*(dv1 - weight - lam * x1 / np.linalg.norm(x1)), x1 @ x1 - 1, x1 @ v1])

        u = fsolve(lambda u: step(u)[3], [*dv, 0.0, 0.0], xtol=1e-12)
        x, v, a, _ = step(u)
        dv = u[:3]
        out.append(x)
    return np.array(out)


@pytest.mark.parametrize("rho", [0.0, 0.6, 1.0])
def test_an_independent_implementation_agrees(rho):
    q, v = {"ball": [-0.6, 0.0, -0.8]}, {"ball": [0.8, 0.0, -0.6]}
    mech = shared_model("pendulum")
    sol = mbdae.solve(mech, (0, 0.4), *mech.assemble(q, v), method=f"alpha{rho}", step=0.02)
    assert np.abs(sol.q - independent(rho, 0.02, 20)).max() < 1e-9


@pytest.mark.parametrize("speed", [0.0, 4.0])
@pytest.mark.parametrize("rho", [0.6, 0.9, 1.0])
def test_steps_are_those_of_exudyn(rho, speed):
    """Index 3, in the same coordinates and from the same a_0 = v_0': q, v, v' and the force in the pin agree."""
    pytest.importorskip("exudyn", reason="exudyn is not installed: pip install 'mbdae[crosscheck]'")
    from crosscheck_exudyn import four_bar_tree

    mech, h, n = shared_model("four_bar"), 0.01, 50
    q, v = mech.assemble(None, {"crank": speed})
    angles, speeds, rates, force = four_bar_tree(q, v, h, n, rho)
    system, y = mech.system(), mech.point(q, v)
    assert np.abs(system.derivative(0.0, y)[0][mech.nv : -1] - rates[0]).max() < 1e-6
    start = [*rates[0], 0.0]
    state = system.update_independent_rows(0.0, State(y, np.array([*start, *start, h])))
    for i in range(n):
        step = method(f"alpha{rho}_i3").step(system, i * h, h, state)
        state = step.state
        assert np.abs(state.y[:6] - [*angles[i + 1], *speeds[i + 1]]).max() < 1e-9
        assert np.abs(state.carry[4:7] - rates[i + 1]).max() < 1e-9 * np.abs(rates).max()
        assert abs(np.linalg.norm(step.z) - force[i + 1]) < 1e-9 * force.max()
    assert np.ptp(angles, axis=0).min() > 0.1


@pytest.mark.parametrize("backend", ["python", pytest.param("native", marks=pytest.mark.native)])
@pytest.mark.parametrize("name", ["alpha", "alpha0.5", "hht"])
def test_errors_and_steps_follow_the_tolerance(name, backend):
    """The errors are proportional to rtol, so numbers of steps to rtol^-1/2, and few steps are rejected."""
    mech, best, steps = shared_model("four_bar"), reference("four_bar"), []
    for rtol in (1e-3, 1e-4):
        sol = mbdae.solve(mech, (0, 0.5), method=name, rtol=rtol, atol=rtol, backend=backend)
        assert sol.stats["backend"] == backend
        assert sol.stats["rejected"] <= 4
        steps.append(sol.stats["steps"])
        error = max(np.abs(sol.q[-1] - best.q[-1]).max(), np.abs(sol.v[-1] - best.v[-1]).max() / np.abs(best.v).max())
        assert 0.03 * rtol < error < 3 * rtol
    assert 2.7 < steps[1] / steps[0] < 3.7


@pytest.mark.native
@pytest.mark.parametrize("name", ["alpha", "hht"])
def test_controlled_steps_of_both_back_ends(name):
    runs = [mbdae.solve("heavy_top", (0, 0.02), method=name, rtol=1e-4, backend=b) for b in ("python", "native")]
    assert len({sol.stats["steps"] for sol in runs}) == 1
    np.testing.assert_allclose(runs[0].t, runs[1].t, rtol=1e-9)
    np.testing.assert_allclose(runs[0].y, runs[1].y, rtol=0, atol=1e-9 * np.abs(runs[0].y).max())


def test_the_error_estimate_is_the_difference_to_the_explicit_step():
    mech, m, h = shared_model("double_pendulum"), METHODS["alpha"], 1e-3
    system, y, (q, v) = mech.system(), mech.point(), mech.start
    F = system.derivative(0.0, y)[0][mech.nv :]
    step = m.controlled_step(system, 0.0, h, State(y, np.concatenate([F, F, [h]])))
    a, n = F[: mech.nv], mech.nv  # q and v of the step with a_1 = a_0
    found = step.state.y - np.concatenate([q + h * v + h * h / 2 * a, v + h * a, y[2 * n :] + h * F[n:]])
    np.testing.assert_allclose(step.errors[0], found, rtol=0, atol=1e-15)
    assert np.abs(found[n : 2 * n]).max() > 1e-7


def test_events_of_controlled_steps():
    times = []
    for used, rtol in (("alpha", 1e-6), ("pherk6", 1e-12)):
        sol = mbdae.solve("four_bar", (0, 0.5), method=used, rtol=rtol, events="q.crank = 0.9")
        times.append(sol.events[0][0][0])
    assert 1e-12 < abs(times[0] - times[1]) < 3e-6


def test_a_step_that_newton_cannot_take_is_shortened():
    sol = mbdae.solve("four_bar", (0, 0.5), method="alpha", rtol=1e-3, first_step=0.5)
    assert sol.ended
    assert sol.stats["rejected"] >= 1


@pytest.mark.parametrize("name", ["crane", "platform"])
def test_drivers_and_their_work(name):
    mech, errors = getattr(driven, name)(), []
    best = mbdae.solve(mech, (0, 0.2), method="pherk6", step=5e-4).y[-1]
    for n in (40, 80):
        sol = mbdae.solve(mech, (0, 0.2), method="alpha", step=0.2 / n)
        errors.append(np.abs(mech.system().difference(best, sol.y[-1])))
    assert np.log2(errors[0][:-1].max() / errors[1][:-1].max()) > 1.8
    assert np.log2(errors[0][-1] / errors[1][-1]) > 1.7


def test_controllers_with_states():
    mech = mbdae.load("four_bar", forces=[mbdae.JointPID(joint="crank", kp=3.0, ki=5.0, name="servo")])
    best, errors = mbdae.solve(mech, (0, 0.3), method="pherk6", step=1e-3), []
    for n in (30, 60):
        sol = mbdae.solve(mech, (0, 0.3), method="alpha", step=0.3 / n)
        errors.append(np.abs(sol.s[-1] - best.s[-1]).max())
    assert np.log2(errors[0] / errors[1]) > 1.8


def test_another_step_size_keeps_the_order():
    mech, best, errors = shared_model("four_bar"), reference("four_bar"), []
    for n in (60, 120):
        stops = np.array([0.4]) * SPANS["four_bar"] + 0.37 * SPANS["four_bar"] / n  # off the grid
        sol = mbdae.solve(mech, (0, SPANS["four_bar"]), method="alpha0.2", step=SPANS["four_bar"] / n, jumps=stops)
        errors.append(np.abs(sol.v[-1] - best.v[-1]).max())
    assert np.log2(errors[0] / errors[1]) > 1.7


@pytest.mark.parametrize(
    ("model", "options", "named"),
    [
        ("bicycle", {"step": 0.01}, "'rear_wheel'"),
        ("pendulum_on_stop", {"step": 0.01}, "'rod stop'"),
        ("four_bar", {"step": 0.01, "formulation": "ggl"}, "formulation 'ggl'"),
        ("circle", {"step": 0.01}, "'Point on a circle'"),
    ],
)
def test_rejections_name_the_reason(model, options, named):
    with pytest.raises(InputError, match="'alpha'.*" + named):
        mbdae.solve(model, (0, 0.1), method="alpha", **options)


@pytest.mark.parametrize("name", ["alpha_i3", "hht0.2_i3"])
def test_steps_of_index_3_are_fixed(name):
    with pytest.raises(InputError, match=f"'{name}' takes fixed steps"):
        mbdae.solve("four_bar", (0, 0.1), method=name, rtol=1e-4)


def test_parameters_outside_of_their_range():
    with pytest.raises(InputError, match=r"'alpha1.5': rho_inf lies between 0 and 1"):
        method("alpha1.5")
    with pytest.raises(InputError, match=r"'hht0.5': alpha of HHT lies between 0 and 1/3"):
        method("hht0.5")


def test_claims_are_proven():
    for name in (*NAMES, "alpha0", "alpha1", "hht0.3"):
        assert check_claims(method(name)).holds
    assert not check_alpha(replace(METHODS["alpha"], alpha_f=Fraction(1, 5))).stable
