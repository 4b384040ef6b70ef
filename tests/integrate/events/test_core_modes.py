"""Modes in the core: guards, impacts and transitions equal the Python specification, with few calls of it."""

import itertools

import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, R, add_body, empty, lever
from scipy.optimize import lsq_linear
from shared import shared_model

import mbdae
from mbdae import Mechanism, Stop
from mbdae.integrate.events.mode_changes import ModeChanges
from mbdae.mechanism.hybrid.box_lcp import solve_box_lcp
from mbdae.mechanism.hybrid.kinds.unilateral import Unilateral

# duration in s, method, step in s; impacts and transitions, all in the core
RUNS = {
    "pendulum_on_stop": (4.0, "herk5", 0.05, 9, 9),
    "slider_crank_with_stop": (0.6, "radau5", 0.01, 5, 5),
    "bouncing_chain": (0.5, "pherk5", 0.01, 32, 32),
    "woodpecker": (0.1, "pherk5", 4e-3, 2, 5),  # multipliers between nodes need more samples
    "stick_slip_slider": (1.0, "pherk5", 0.04, 0, 4),
    "ratchet": (1.0, "pherk5", 0.08, 1, 2),
    "geneva_drive": (1.0, "pherk5", 0.02, 0, 2),
}


@pytest.fixture(scope="module", params=RUNS)
def runs(request):
    """A run on both back ends, and its row of the table."""
    end, method, step, *counts = RUNS[request.param]
    mech = mbdae.load(request.param)
    given = {"t_span": (0, end), "method": method, "step": step}
    return [mbdae.solve(mech, backend=backend, **given) for backend in ("native", "python")], counts


def test_both_back_ends_agree(runs):
    (native, python), _ = runs
    assert native.modes == python.modes
    assert native.in_use == python.in_use
    assert [x.where for x in native.impacts] == [x.where for x in python.impacts]
    np.testing.assert_allclose(native.t, python.t, rtol=0, atol=1e-12)
    np.testing.assert_allclose(native.y, python.y, rtol=0, atol=1e-12 * (1 + np.abs(python.y).max()))
    np.testing.assert_allclose(native.lam, python.lam, rtol=0, atol=1e-12 * np.abs(python.lam).max(initial=1))
    if python.impacts:
        ours, theirs = (np.array([[*x.rows, x.loss] for x in sol.impacts]) for sol in (native, python))
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())


def test_the_core_resolves_all_transitions(runs):
    (native, python), (impacts, transitions) = runs
    assert (native.stats["impacts"], native.stats["impacts_in_core"]) == (impacts, impacts)
    assert native.stats["transitions"] == python.stats["transitions"] == transitions
    assert native.stats["transitions_in_core"] == transitions
    assert "transitions_in_core" not in python.stats


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "end"), [("woodpecker", 0.14), ("ratchet", 2.2), ("stick_slip_slider", 0.7), ("geneva_drive", 1.1)]
)
def test_both_back_ends_agree_under_step_size_control(name, end):
    """Steps that do not resolve a multiplier are rejected, in the core, too."""
    mech = shared_model(name)
    native, python = (mbdae.solve(mech, (0, end), rtol=1e-7, backend=backend) for backend in ("native", "python"))
    assert [mode for _, mode in native.modes] == [mode for _, mode in python.modes]
    assert native.stats["transitions_in_core"] == native.stats["transitions"] >= 2
    attempts = [sol.stats["steps"] + sol.stats["rejected"] for sol in (native, python)]
    assert attempts[0] <= 1.1 * attempts[1]  # rounding decides on 3 of 100 steps: rejected ones alone differ by a fifth
    assert [x.where for x in native.impacts] == [x.where for x in python.impacts]
    times = [[sol.t[i] for i, _ in sol.modes] for sol in (native, python)]
    np.testing.assert_allclose(*times, rtol=0, atol=1e-10)
    np.testing.assert_allclose(native.y[-1], python.y[-1], rtol=0, atol=1e-9 * (1 + np.abs(python.y).max()))


@pytest.mark.slow
def test_a_chain_comes_to_rest_on_closed_contacts():
    """Through accumulations of impacts, and impacts of a contact while others are closed."""
    mech = shared_model("bouncing_chain")
    native, python = (mbdae.solve(mech, (0, 0.6), backend=backend) for backend in ("native", "python"))
    assert [mode for _, mode in native.modes] == [mode for _, mode in python.modes]
    assert [x.where for x in native.impacts] == [x.where for x in python.impacts]  # without impulses by rounding
    np.testing.assert_allclose(native.y[-1], python.y[-1], rtol=0, atol=1e-10)
    changes = sum(a != b for (_, a), (_, b) in itertools.pairwise(native.modes))
    assert len(native.impacts) - native.stats["impacts_in_core"] <= 2 * changes < 10 < len(native.impacts)


def bouncing_pair(e=0.5, heights=(1.0, 0.3)):
    """Two balls on a plane that do not touch each other; the second one falls from another height."""
    model = empty()
    for k in range(2):
        add_body(model, 0, pin.JointModelPZ(), f"z{k}")
    stops = [Stop(joint=f"z{k}", lower=0.0, restitution=e * (1 - k)) for k in range(2)]
    return Mechanism(model, stops=stops), np.array(heights), np.zeros(2)


@pytest.mark.parametrize("how", [{"rtol": 1e-8}, {"step": 0.02}, {"method": "radau5", "step": 0.02}])
def test_a_contact_rebounds_while_another_one_bears_its_load(monkeypatch, how):
    """Without restitution the second ball rests from sqrt(2 h/g) on; the first one bounces at t_1 (3 - 2^(1 - k))."""
    monkeypatch.setattr(ModeChanges, "handle_event", None)  # Python resolves nothing
    mech, q, v = bouncing_pair()
    sol = mbdae.solve(mech, (0, 1.2), q, v, **how)
    first, second = np.sqrt(2 * q / G)
    t = [first * (3 - 2.0 ** (1 - k)) for k in range(6) if first * (3 - 2.0 ** (1 - k)) < 1.2]
    of_first = [x for x in sol.impacts if x.where == ("z0 stop",)]
    np.testing.assert_allclose([x.t for x in of_first], t, rtol=0, atol=1e-13)
    speeds = [np.sqrt(2 * G * q[0]) / 2**k for k in range(len(t))]
    np.testing.assert_allclose([x.impulse[0] for x in of_first], np.multiply(1.5, speeds), rtol=1e-12)
    np.testing.assert_allclose([x.loss for x in of_first], 0.375 * np.square(speeds), rtol=1e-12)
    assert [x.where for x in sol.impacts if x not in of_first] == [("z1 stop",)]
    assert sol.stats["impacts_in_core"] == len(t) + 1 >= 3
    np.testing.assert_allclose(sol.lam[sol.t > second, 1], G, rtol=1e-13)


def test_simultaneous_contacts_are_one_impact():
    mech, q, v = bouncing_pair(heights=(1.0, 1.0))
    sol = mbdae.solve(mech, (0, 0.6), q, v)
    assert sol.impacts[0].where == ("z0 stop", "z1 stop")
    np.testing.assert_allclose(sol.impacts[0].impulse, np.sqrt(2 * G) * np.array([1.5, 1.0]), rtol=1e-12)
    assert sol.stats["impacts_in_core"] == len(sol.impacts) == 1


def test_flights_shorter_than_rest_end_in_contact():
    """Accumulating bounces, in the core to the last one."""
    mech, q, v = bouncing_pair()
    sol = mbdae.solve(mech, (0, 2.0), q, v, rtol=1e-9)
    assert sol.modes[-1][1] == (1, 1)
    assert sol.t[sol.modes[-1][0]] == pytest.approx(3 * np.sqrt(2 / G), abs=2e-6)  # t_1 (1 + e)/(1 - e)
    assert sol.stats["impacts_in_core"] == len(sol.impacts) > 15


def test_a_simulator_goes_through_the_same_impacts():
    simulator = mbdae.Simulator("pendulum_on_stop", method="pherk5", step=0.01)
    for _ in range(40):
        simulator.advance(0.05)
    other = mbdae.solve(shared_model("pendulum_on_stop"), (0, 2.0), method="pherk5", step=0.01, jumps=())
    assert [x.t for x in simulator.solution().impacts] == pytest.approx([x.t for x in other.impacts], abs=1e-12)


def test_switches_that_only_python_has_stay_there(monkeypatch):
    """The same run without switches in the core."""
    mech = mbdae.load("bouncing_chain")
    sol = mbdae.solve(mech, (0, 0.3), step=0.01)
    monkeypatch.setattr(Unilateral, "core_data", lambda self, system: None)
    other = mbdae.solve(mech, (0, 0.3), step=0.01)
    assert other.stats["impacts_in_core"] == 0 < sol.stats["impacts_in_core"]
    np.testing.assert_allclose(sol.y, other.y, rtol=0, atol=1e-12 * (1 + np.abs(other.y).max()))


@pytest.mark.parametrize("mu", [0.1, 1.1])
def test_the_end_of_a_rod_rebounds_with_friction(mu):
    """W p = changes of the speeds along normal and tangent, where the tangent sticks; otherwise it slides ahead."""
    e, angle = 0.4, 0.9
    mech = lever(mu, angle, e)
    sol = mbdae.solve(mech, (0, 0.2), np.array([0.0, -0.05]), np.array([1.0, 1.0]), rtol=1e-10)
    node, inverse = sol.modes[1][0], np.array([1 / 0.5, 1 / 0.02])
    before, after = sol.v[node - 1], sol.v[node]
    rows = np.array([[0.0, -0.5 * np.sin(angle)], [1.0, -0.5 * np.cos(angle) - R]])  # normal and tangent at the impact
    (normal, tangent), W = rows @ before, rows * inverse @ rows.T
    p = np.linalg.solve(W, [-(1 + e) * normal, -tangent])
    if abs(p[1]) > mu * p[0]:
        slips = -np.sign(p[1])
        p = -(1 + e) * normal / (W[0, 0] - slips * mu * W[0, 1]) * np.array([1.0, -slips * mu])
        assert slips * (tangent + W[1] @ p) > 0
    np.testing.assert_allclose(after, before + inverse * (rows.T @ p), rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.abs(sol.impacts[0].rows), np.abs(p), rtol=1e-11)
    assert sol.stats["impacts_in_core"] == len(sol.impacts) >= 1


def test_friction_problems_of_two_rows_against_scipy():
    rng = np.random.default_rng(0)
    for low, high in itertools.product((-np.inf, -1.0, 0.0), (np.inf, 0.1, 2.0)):
        C, c = rng.normal(size=(4, 2)), 3 * rng.normal(size=2)
        bounds = np.array([low, -0.5]), np.array([high, 0.5])
        d = np.linalg.lstsq(C.T, c, rcond=None)[0]
        expected = lsq_linear(C, -d, bounds, method="bvls", tol=1e-15).x
        np.testing.assert_allclose(solve_box_lcp(C, c, *bounds), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("name", "end"), [("woodpecker", 0.14), ("ratchet", 2.2), ("bouncing_chain", 0.4)])
def test_a_run_does_not_depend_on_the_number_of_calls(name, end, monkeypatch):
    """The core returns to Python after each step; all points and counts stay the same."""
    whole = mbdae.solve(name, t_span=(0, end))
    monkeypatch.setattr("mbdae.integrate.steppers.native.CHECK_INTERVAL", 0.0)
    divided = mbdae.solve(name, t_span=(0, end))
    np.testing.assert_array_equal(divided.y, whole.y)
    assert divided.modes == whole.modes
    assert divided.stats | {"seconds": 0} == whole.stats | {"seconds": 0}


@pytest.mark.slow
def test_both_back_ends_check_multipliers_at_the_same_points():
    """At a loose tolerance the multipliers limit the steps; points between their ends are on a cubic."""
    native, python = (mbdae.solve("woodpecker", (0, 0.14), rtol=1e-5, backend=x).stats for x in ("native", "python"))
    assert python["rejected"] > 20
    assert native["rejected"] == pytest.approx(python["rejected"], rel=0.2)
