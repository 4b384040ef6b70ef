"""The scripts of examples/benchmarks run briefly, and all programs solve the same problem."""

import importlib
import shutil
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import mbdae

pytestmark = pytest.mark.slow
FOLDER = Path(__file__).parent.parent / "examples" / "benchmarks"
PROBLEMS = ("four-bar", "double pendulum", "Andrews")
WITHIN = {  # tolerance or number of steps of one run, and the largest error in rad that it may leave
    "pherk5, projected": (1e-6, 1e-4),
    "pherk5, projected, elbow cut": (1e-5, 1e-2),
    "DOP853 on Pinocchio": (1e-7, 1e-5),
    "solve_dae Radau": (1e-4, 2e-3),
    "MuJoCo RK4": (1000, 1e-4),
    "Exudyn": (2000, 1e-2),
}


@pytest.fixture
def script(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    return importlib.import_module


@pytest.mark.parametrize("title", PROBLEMS)
def test_every_solver_solves_the_same_problem(script, title):
    problem = script("problems").PROBLEMS[title]
    reference = problem.reference()
    for name, (make, stepped) in script("peers").solvers(problem).items():
        if name not in WITHIN or (runner := make(problem)) is None:  # not installed
            continue
        value, within = WITHIN[name]
        run = runner(problem.end / value if stepped else value)
        assert np.abs(run.end - reference).max() < within, name
        assert run.g < (1e-12 if "projected" in name else 1e-3), name


@pytest.mark.parametrize("title", PROBLEMS)
def test_jacobian_of_the_equations_written_by_hand(script, title):
    problem = script("problems").PROBLEMS[title]
    eq = script("planar").Equations(problem, cut=() if problem.pins else ("lower",))
    rng, n, h = np.random.default_rng(1), 2 * eq.n + 4 * eq.nc, 1e-6
    y, yp = 0.5 * rng.normal(size=n), rng.normal(size=n)
    for k, derivative in enumerate(eq.ggl_partials(0.0, y, yp)):
        for i in range(n):
            ends = [
                eq.ggl(0.0, *(x + s * h * (np.arange(n) == i) * (k == m) for m, x in enumerate((y, yp))))
                for s in (1, -1)
            ]
            np.testing.assert_allclose((ends[0] - ends[1]) / (2 * h), derivative[:, i], atol=1e-7)


@pytest.mark.parametrize("title", PROBLEMS)
def test_equations_in_real_numbers_are_those_in_complex_ones(script, title):
    eq = script("planar").Equations(script("problems").PROBLEMS[title])
    q, v = np.random.default_rng(2).normal(size=(2, eq.n))
    M, f, *G, re, im = script("index1").terms(
        eq, np.asarray, np.cos(q)[:, None], np.sin(q)[:, None], v[:, None], alpha=0.0
    )
    vdot, lam = eq.acceleration(q, v)
    G = np.vstack(G)
    np.testing.assert_allclose(M @ vdot, f[:, 0] + G.T @ lam, atol=1e-9 * (1 + np.abs(f).max()))
    np.testing.assert_allclose(G @ vdot, np.concatenate([re, im])[:, 0], atol=1e-9 * (1 + np.abs(vdot).max()))


@pytest.mark.parametrize("name", ["GOVERNOR", "SPRING_CRANK", "CAR_AXIS"])
def test_stiff_mechanisms_are_the_equations_written_by_hand(script, name):
    problem = replace(getattr(script("stiff"), name), end=0.01)
    run = script("stiff_peers").with_mbdae(problem, "radau9")(1e-9)
    np.testing.assert_allclose(run.end, problem.reference(), rtol=0, atol=1e-10)


@pytest.mark.parametrize("name", ["GOVERNOR", "SPRING_CRANK", "CAR_AXIS"])
def test_stiff_mechanisms_in_exudyn_are_those_equations(script, name):
    pytest.importorskip("exudyn")
    problem = replace(getattr(script("stiff"), name), end=0.01)
    run = script("stiff_peers").with_exudyn(problem)
    reference, errors = problem.reference(), []
    for n in (100, 200):
        errors.append(np.abs(run(problem.end / n).end - reference).max())
    assert errors[1] < 1e-5
    assert errors[1] < errors[0] / 3


def test_stages(script, capsys):
    measured = script("stages").main(["--brief"])
    assert set(measured) == {"four_bar", "panda_handle", "humanoid_stance", "stewart_platform"}
    assert all(min(m["bare python"], m["python"]) > 0 for m in measured.values()), measured
    assert "| four_bar |" in capsys.readouterr().out


def test_growth(script, capsys):
    times = script("scaling").main(["--brief"])["python"]
    assert list(times) == [1, 2, 5, 10, 20, 40]
    assert min(times.values()) > 0
    assert "exponent" in capsys.readouterr().out


def test_exponent(script):
    assert script("scaling").exponent({1: 7.0, 10: 10.0, 100: 1000.0}) == pytest.approx(2)
    assert script("scaling").exponent({1: 7.0, 10: 10.0}) is None


def test_work_precision(script, capsys, tmp_path):
    measured = script("work_precision").main(["--brief"], tmp_path / "figure.png")
    assert tuple(measured) == PROBLEMS
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    assert all(points["pherk5, projected"] for points in measured.values())
    out = capsys.readouterr().out
    assert all(f"| {title}, " in out for title in PROBLEMS)


def test_ensembles(script, capsys):
    assert all(seconds > 0 for seconds in script("ensembles").main(["--brief"]).values())  # refuses tables that differ
    assert "| threads | 2 |" in capsys.readouterr().out


def test_impacts(script, capsys):
    ((core, python),) = script("impacts").main(["--brief"]).values()
    assert core.in_core == core.transitions == python.transitions > 30
    assert python.in_core == 0
    assert "| pendulum_on_stop, 4.2829 s |" in capsys.readouterr().out


def test_fixed_cost(script, capsys):
    found = script("fixed_cost").main(["--brief"])
    assert "a run of one step" in capsys.readouterr().out
    assert all(run > 0 and advance > 0 for run, advance in found.values())


@pytest.mark.native
def test_random_drops(script, capsys):
    results = script("drops").main(["--brief"])
    assert {x.verdict for x in results} == {"same"}, [x.text for x in results]
    assert len({x.kind for x in results}) == len(results) == 10
    assert "| all | 10 |" in capsys.readouterr().out


def test_gradients(script, capsys):
    found = script("gradients").main(["--brief"])
    assert min(found["run"], found["value and gradient"]) > 0
    assert "| 10 tangents |" in capsys.readouterr().out


def test_singular(script, capsys):
    singular = script("singular")
    (result,) = singular.main(["--brief", "--mechanism", "parallelogram"])
    assert result.outcome in singular.OUTCOMES
    assert singular.main(["--only", str(result.number)])[0].outcome == result.outcome
    assert "| parallelogram | projected | 1 |" in capsys.readouterr().out


def test_motions_along_closed_branches(script):
    """They equal computed steps where nothing is singular, and conserve energy at singular configurations."""
    runs, branches = script("random_runs"), script("branches")
    for number, kind in enumerate(runs.MECHANISMS[:-1]):
        branch, _ = runs.random_branch(kind, 9.81, np.random.default_rng(number))
        truth = branches.Truth(branch, 0.7, 1.0)
        sol = mbdae.solve(branch.mech, (0, 0.1), *truth.at(0), method="pherk6", rtol=1e-11, project=True)
        q, v = truth.at(0.1)
        assert np.abs(branch.difference(sol.q[-1], q)).max() < 1e-9, kind
        np.testing.assert_allclose(sol.v[-1], v, atol=1e-8, err_msg=kind)
        np.testing.assert_allclose(sol.lam[-1], truth.forces(0.1)[0], atol=1e-6, err_msg=kind)
        energy = [sum(branch.mech.energy(*truth.at(t))) for t in np.linspace(0, 1, 20)]
        assert np.ptp(energy) < 1e-7, kind
        gaps = [np.abs(branch.mech.residual(*truth.at(t))).max() for t in np.linspace(0, 1, 20)]
        assert max(gaps) < 1e-9, kind
        assert branch.distance(q) < 1e-12, kind
        assert branch.distance(q + 0.05 * np.arange(1, len(q) + 1)) > 0.01, kind


def test_the_cheapest_run_below_an_error_counts(script):
    w = script("work_precision")
    points = [w.Point(1, 0.1, 1e-2, 1e-3), w.Point(2, 0.2, 1e-5, 1e-8), w.Point(3, 0.4, 1e-6, 1e-10)]
    assert w.cells(points, (1e-1, 1e-4, 1e-9)) == [0.1, 0.2, None]
    assert w.cells(points, (1e-1, 1e-4, 1e-9), 1e-9) == [0.4, 0.4, None]


def test_stops_beside_other_programs(script):
    exact = script("stops").exact()
    for name, run in script("stops").main(["--brief"]).items():
        assert abs(run.end - exact) < (1e-6 if name.startswith("mbdae") else 0.1), name


def test_friction_beside_other_programs(script):
    stops = script("friction").STOPS
    for name, run in script("friction").main(["--brief"]).items():
        assert abs(run.end - stops) < (1e-6 if name.startswith("mbdae") else 3e-2), name


def test_growth_of_default_runs(script, capsys):
    growth = script("growth")
    measured = growth.main(["--brief"])
    assert [list(m) for m in measured.values()] == [[10, 30], [10, 30]]
    assert min(x["start"] for m in measured.values() for x in m.values()) > 0
    assert "| exponent from 10 |" in capsys.readouterr().out
    times, memory = growth.in_process(partial(growth.seconds, "unequal", 2, 1, 0.0))
    assert times["start"] > 0
    assert memory >= 0


def test_simulator_is_measured(script, capsys):
    found = script("simulator").main(5)
    assert all(mean > 0 and longest > 0 for mean, longest in found.values())
    assert "slider_crank" in capsys.readouterr().out


def test_frames_of_a_live_view_are_counted(script, capsys, monkeypatch):
    if shutil.which("chromium") is None:
        pytest.skip("chromium is not installed")
    monkeypatch.setattr(script("live"), "SETTLING", 0.0)
    assert script("live").main("pendulum", 2.0, "200x150") > 0
    assert "frames per second" in capsys.readouterr().out


def test_optimal_control_is_measured(script, capsys):
    found = script("optimal_control").main((5,))
    assert 0 < found[5][1] < 1e-2
    assert "excess" in capsys.readouterr().out


def test_parameters_are_written_in_place(script, capsys):
    found = script("parameters").main(2)
    assert found["bound"] == 1
    assert found["made"] > 0
    assert "bound 1 times" in capsys.readouterr().out


def test_a_free_choice_of_orders_is_bounded(script, capsys):
    module = script("radau_orders")
    (saved,) = module.main(["flyball_governor"], [1e-6]).values()
    assert 0 <= saved < 0.5
    assert "free choice" in capsys.readouterr().out
    sol = mbdae.solve("pendulum", (0, 2), method="radau5", rtol=1e-6)
    t = (np.arange(module.POINTS) + 0.5) / module.POINTS * 2
    assert module.rate(sol, t).mean() * 2 == pytest.approx(sol.stats["solves"], rel=0.02), "the integral is the work"


def test_the_guide_has_the_tables_of_the_atlas(script, capsys):
    """They are written from the stored summary; its best methods are those with the fewest solves."""
    atlas = script("atlas")
    text = atlas.main()
    assert text in atlas.GUIDE.read_text()
    assert atlas.written(atlas.GUIDE.read_text(), text) == atlas.GUIDE.read_text()
    assert atlas.DATA.stat().st_size <= 300_000
    with pytest.raises(ValueError, match="the page has no comments"):
        atlas.written(f"{atlas.END}{atlas.BEGIN}", text)
    assert capsys.readouterr().out


def test_bounds_of_the_atlas_are_no_measurements(script):
    """Of negative numbers: a method does not win by its bound, and no other does where it is the smallest."""
    atlas = script("atlas")
    solves = {"a": [30, 20, -40, 60], "b": [30, 20, -10, None], "c": [None, None, -10, -10], "d": [None] * 4}
    data = {"models": {k: {"methods": list("xyzw"), "work": {"1e-02": {"solves": s}}} for k, s in solves.items()}}
    head, *rows = atlas.rows(data, ["1e-02"])
    assert head[1] == "1e-02, 3 models"
    assert rows == [["`y`", "1; 1; 2 + 0"], ["`w`", "0; 3; 1 + 1"], ["`x`", "0; 1.5; 2 + 0"], ["`z`", "-; -; 0 + 3"]]
    assert "4 of 9 at 1e-02" in atlas.bounds(data)
    assert "2 of 3 at 1e-02" in atlas.bounds(data)


def test_rates_of_the_energy_have_the_median_of_even_numbers(script):
    data = {"models": {str(x): {"energy_rate": {"x": (x, False)}} for x in (1, 2, 4, None)}}
    assert list(script("atlas").energies(data))[1] == ["`x`", "4", "3.0e+00", "-", "0", "1"]


def test_samples_of_tolerances_agree_with_the_analysis(script):
    """Loop equations in complex numbers, solved for all samples at once, and the same samples assembled by mbdae."""
    for name, found in script("tolerance_samples").main(["--brief"]).items():
        assert max(abs(found["mean"]), abs(found["deviation"])) < 3, name
        assert found["assembly"] < 1e-12, name
