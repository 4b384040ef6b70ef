"""Formulations: scipy's solvers as a baseline, one solution for all, and invalid combinations."""

import json

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from motions import ALL, distance, free_loop, levels, model, run, start_of
from shared import shared_model

import mbdae
from mbdae import Mechanism, finite_differences
from mbdae.__main__ import cli
from mbdae.textbook.problems import hessenberg_a

# -- scipy's solvers -------------------------------------------------------------------------------------------------

FLAT = [(n, m) for n in ("four_bar", "slider_crank") for m in ("RK45", "DOP853", "Radau", "LSODA")]
CURVED = [(n, m) for n in ("heavy_top", "free_loop") for m in ("RK45", "DOP853")]


@pytest.mark.parametrize(("name", "method"), FLAT + CURVED)
def test_index1_agrees_with_index2(name, method):
    mech = model(name)
    T = 0.1 if name == "heavy_top" else 0.5  # it spins fast
    reference = run(mech, T, method="pherk6", rtol=1e-12)
    sol = run(mech, T, method=method, formulation="index1", rtol=1e-10 if method != "Radau" else 1e-8)
    assert max(distance(mech, reference, sol)) < 1e-7
    assert pin.isNormalized(mech.model, sol.q[-1], 1e-14)
    np.testing.assert_allclose(sol.lam_own[-1], sol.lam[-1], rtol=1e-9, atol=1e-9)
    assert (sol.stats["rejected"] is None) == (method in ("Radau", "LSODA"))
    middle, near = sol(0.6 * T), reference(0.6 * T)
    assert np.abs(mech.manifold.difference(middle.q, near.q)).max() < 1e-6
    assert np.abs(middle.v - near.v).max() < 1e-5


def test_index1_raw_coordinates_move_with_the_tangent_map():
    mech = free_loop()
    system = mech.system("index1")
    y = np.concatenate([*start_of(mech), [0.0]])
    rate = system.rate(0.0, y)[0][: mech.nq]
    q, v, h = y[: mech.nq], y[mech.nq : mech.nq + mech.nv], 1e-5
    ahead, behind = pin.integrate(mech.model, q, h * v), pin.integrate(mech.model, q, -h * v)
    np.testing.assert_allclose(rate, (ahead - behind) / (2 * h), atol=1e-9)


def test_baumgarte_reduces_the_drift():
    mech = shared_model("four_bar")
    options = {"method": "RK45", "formulation": "index1", "rtol": 1e-6}
    plain, stabilized = run(mech, 10.0, **options), run(mech, 10.0, baumgarte=(10.0, 10.0), **options)
    assert levels(plain)[0] > 20 * levels(stabilized)[0]
    assert stabilized.settings["baumgarte"] == (10.0, 10.0)


def test_baumgarte_residuals_obey_their_equation():
    """g'' + 2 alpha g' + beta^2 g = 0, with g'' along the motion by differences, at a state off the closures."""
    mech = shared_model("pendulum")
    alpha, beta = 3.0, 5.0
    q, v = mech.start[0] + [0.1, 0.2, -0.1], np.array([0.7, -0.4, 0.2])
    F = mech.system("index1", (alpha, beta)).derivative(0.0, np.concatenate([q, v, [0.0]]))[0]
    (g, rate), dv = mech.residual(q, v), F[mech.nv : 2 * mech.nv]
    second = finite_differences.numerical_derivative(lambda h: mech.residual(q + h * v, v + h * dv)[1], 1e-3)
    assert min(abs(g[0]), abs(rate[0])) > 0.05
    np.testing.assert_allclose(second, -2 * alpha * rate - beta**2 * g, rtol=1e-8)


def test_index1_counts_steps_and_stops_by_name():
    mech = shared_model("four_bar")
    options = {"method": "RK45", "formulation": "index1"}
    sol = run(mech, 1.0, **options)
    assert sol.stats["f"] == 6 * (sol.stats["steps"] + sol.stats["rejected"]) + 3  # the start, scipy's, its guess of h
    short = mbdae.solve(mech, (0.0, 1.0), max_steps=7, **options)
    assert (short.status, len(short.t)) == ("max_steps", 8)
    largest = run(mech, 1.0, max_step=0.01, first_step=1e-3, **options)
    assert np.diff(largest.t).max() <= 0.01 * (1 + 1e-12)
    assert largest.t[1] == pytest.approx(1e-3)
    there = run(mech, 1.0, rtol=1e-10, **options)
    back = mbdae.solve(mech, (1.0, 0.0), there.q[-1], there.v[-1], rtol=1e-10, **options)
    assert np.abs(back.q[-1] - there.q[0]).max() < 1e-7


@pytest.mark.parametrize("method", ["RK45", "LSODA"])
def test_index1_keeps_what_was_computed(method):
    def interrupt(done):
        if done > 0.5:
            raise KeyboardInterrupt

    options = {"method": method, "formulation": "index1"}
    sol = mbdae.solve(shared_model("pendulum"), (0.0, 1.0), progress=interrupt, **options)
    assert (sol.status, sol.success) == ("interrupted", False)
    assert 0.5 < sol.t[-1] < 1

    def broken(t, q, v):
        return np.full(3, np.nan if t > 0.5 else 0.0)

    pendulum = shared_model("pendulum")
    bad = Mechanism(pendulum.model, pendulum.closures, [broken], start=pendulum.start_values)
    sol = mbdae.solve(bad, (0.0, 1.0), **options)
    assert (sol.status, sol.success) == ("nonfinite", False)
    assert "broken" in sol.message
    assert 0.1 < sol.t[-1] <= 0.5


# -- one Solution for all --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("options", ALL)
def test_times_events_and_files(options, tmp_path):
    mech = shared_model("pendulum")
    bottom = mbdae.Event(lambda t, q, v: q[0], terminal=True)
    sol = run(mech, 5.0, rtol=1e-10, t_eval=np.linspace(0, 5, 51), events=bottom, **options)
    assert sol.status == "event"
    quarter = 1.854074677301372 / np.sqrt(9.81)  # K(sin 45 degrees), from horizontal rest
    assert sol.events[0][0][0] == pytest.approx(quarter, abs=1e-8)
    assert len(sol.t) == int(quarter * 10) + 1
    sol.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.lam_own, sol.lam_own)
    assert again.settings["formulation"] == options.get("formulation", "index2")
    assert sol.lam.shape == (len(sol.t), 1)
    np.testing.assert_allclose(sol.lam, sol.lam_own, atol=0.1)  # multipliers of the method are interpolated linearly


REFUSED = [
    ({"formulation": "index3"}, ["unknown formulation 'index3'", "index2, ggl, index1"]),
    ({"formulation": ["ggl"]}, ["formulation is a name, got ['ggl']"]),
    ({"formulation": "index1"}, ["index1", "RK45, DOP853, Radau, LSODA", "'pherk6'"]),
    ({"method": "RK45"}, ["'RK45'", "index1", "herk1", "pherk5"]),
    ({"method": "LSODA", "formulation": "ggl"}, ["'LSODA'", "index1", "'ggl'", "pherk5"]),
    ({"method": "nosuch"}, ["unknown method 'nosuch'", "pherk5"]),
    ({"formulation": "ggl", "project": True}, ["project=True", "index2", "'ggl'"]),
    ({"formulation": "index1", "method": "RK45", "project": True}, ["project=True", "index2", "'index1'"]),
    ({"baumgarte": (1.0, 1.0)}, ["baumgarte", "index1", "'index2'"]),
    ({"formulation": "index1", "method": "RK45", "baumgarte": (1.0, -1.0)}, ["baumgarte", "alpha, beta"]),
    ({"formulation": "index1", "method": "RK45", "baumgarte": 3.0}, ["baumgarte", "alpha, beta"]),
    ({"formulation": "index1", "method": "RK45", "step": 0.1}, ["'RK45'", "rtol and atol", "step"]),
    ({"formulation": "index1", "method": "RK45", "rtol": 0.0}, ["rtol = 0.0"]),
    ({"formulation": "index1", "method": "RK45", "atol": np.ones(4)}, ["atol", "6 components", "(4,)"]),
]


@pytest.mark.parametrize(("options", "words"), REFUSED)
def test_rejections(options, words):
    with pytest.raises(mbdae.MbdaeError) as caught:
        mbdae.solve(shared_model("four_bar"), (0.0, 1.0), **options)
    assert isinstance(caught.value, ValueError)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("method", ["Radau", "LSODA"])
def test_implicit_solvers_are_rejected_on_manifolds(method):
    with pytest.raises(mbdae.MbdaeError, match=f"'{method}'.*RK45, DOP853"):
        mbdae.solve(shared_model("heavy_top"), (0.0, 1.0), method=method, formulation="index1")
    with pytest.raises(mbdae.MbdaeError, match="one number as atol"):
        mbdae.solve(shared_model("heavy_top"), (0.0, 1.0), method="RK45", formulation="index1", atol=np.ones(6))


@pytest.mark.parametrize(
    "options",
    [{"formulation": "ggl"}, {"formulation": "index1", "method": "RK45"}, {"baumgarte": (1, 1)}, {"project": True}],
)
def test_textbook_problems_have_one_formulation(options):
    with pytest.raises(mbdae.MbdaeError, match="textbook problem"):
        mbdae.solve(hessenberg_a(), (0.0, 1.0), **options)


@pytest.mark.parametrize(("flags", "limit"), [(["--formulation", "ggl"], 1e-12), (["--project"], 1e-12), ([], 1.0)])
def test_command_line(flags, limit):
    result = CliRunner().invoke(cli, ["drift", "pendulum", "-t", "2", "--json", *flags])
    assert result.exit_code == 0, result.output
    assert json.loads(result.output)["g_max"] <= limit
