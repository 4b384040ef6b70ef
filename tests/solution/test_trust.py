"""Reliability of results: rows are stored with a run, the order of calls has no effect, warnings have a status.
"""

import numpy as np
import pytest
from click.testing import CliRunner
from shared import shared_model

import mbdae
from mbdae.__main__ import cli

MODELS = [("bricard", 3.0), ("n_four_bar", 1.5), ("four_bar", 1.0), ("stewart_platform", 0.3), ("heavy_top", 0.05)]


def run(name, T, **options):
    return mbdae.solve(shared_model(name), (0, T), **options)


def questions(sol):
    """Results of a solution that can be requested in any order."""
    a, b = sol.t[0], sol.t[-1]
    return {
        "lam": lambda: sol.lam,
        "point": lambda: sol(0.3 * a + 0.7 * b).q,
        "points": lambda: np.hstack(sol(np.linspace(a, b, 13))),
        "multipliers": lambda: sol.multipliers(0.9 * b),
        "rate": lambda: sol.rate(len(sol.t) - 1),
    }


@pytest.mark.parametrize("project", [False, "auto"])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6])
@pytest.mark.parametrize(("name", "T"), MODELS)
def test_results_do_not_depend_on_the_order_of_calls(tmp_path, name, T, rtol, project):
    sol = run(name, T, rtol=rtol, project=project)
    sol.save(tmp_path / "run.npz")
    first = {what: ask() for what, ask in questions(sol).items()}
    other = mbdae.Solution.load(tmp_path / "run.npz")
    again = {what: ask() for what, ask in reversed(questions(other).items())}
    for what, answer in first.items():
        np.testing.assert_array_equal(again[what], answer, err_msg=what)
        np.testing.assert_array_equal(questions(sol)[what](), answer, err_msg=what)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("project", [False, "auto"])
def test_a_run_with_dependent_rows_is_read_anywhere(project):
    """Rows of loops that have drifted open are not selected again at the first evaluation of a workspace."""
    exact = run("bricard", 3.0, method="pherk6", rtol=1e-10)
    sol = run("bricard", 3.0, rtol=1e-6, project=project)
    read = run("bricard", 3.0, rtol=1e-6, project=project, t_eval=[2, 2.5, 3])
    assert len(read.t) == 3
    np.testing.assert_array_equal(read.q, sol(read.t).q)
    for t in (2.97, 0.4):
        np.testing.assert_allclose(sol(t).v, exact(t).v, atol=1e-4)
        np.testing.assert_allclose(sol.multipliers(t), exact.multipliers(t), rtol=1e-3, atol=1e-2)
    np.testing.assert_array_equal(sol.multipliers([[2.97, 0.4]]), [[sol.multipliers(2.97), sol.multipliers(0.4)]])
    assert np.abs(sol.lam).max() == pytest.approx(np.abs(exact.lam).max(), rel=0.02)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("project", [False, True])
@pytest.mark.parametrize(("method", "rtol"), [("pherk6", 1e-6), ("pherk4", 1e-6), ("pherk3", 1e-5), ("herk2", 1e-4)])
def test_new_rows_begin_with_velocities_that_meet_them(method, rtol, project):
    sol = run("bricard", 3.0, method=method, rtol=rtol, project=project)
    assert sol.ended, sol.message
    for i, rows in sol.in_use:
        used = sol.mechanism.residual(sol.q[i], sol.v[i])[1][list(rows)]
        assert np.abs(used).max() <= 1e-13 * (1 + np.abs(sol.v[i]).max())


@pytest.mark.parametrize("name", ["bricard", "four_bar", "slider_crank", "delta_robot", "panda_handle"])
@pytest.mark.parametrize("options", [{}, {"method": "pherk6", "rtol": 1e-3}, {"method": "herk4", "rtol": 1e-4}])
def test_velocities_meet_all_rows_at_every_node(name, options):
    sol = run(name, 1.0, **options)
    assert sol.success
    rates = np.array([sol.mechanism.residual(q, v, t)[1] for t, q, v in zip(sol.t, sol.q, sol.v, strict=True)])
    assert (np.abs(rates).max(axis=1) <= 1e-12 * (1 + np.abs(sol.v).max(axis=1))).all()


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("project", [False, True])
@pytest.mark.parametrize(
    "name", ["bricard", "four_bar", "slider_crank", "jansen_walker?legs=1", "heavy_top", "dual_arm"]
)
def test_a_run_goes_on_from_where_another_ended(name, rtol, project):
    mech = shared_model(name)
    sol = mbdae.solve(mech, (0, 0.5), rtol=rtol, project=project)
    onward = mbdae.solve(mech, (0.5, 0.6), sol.q[-1], sol.v[-1], rtol=rtol, project=project)
    assert onward.ended, onward.message
    assert len(onward.in_use[0][1]) == len(sol.in_use[0][1])


@pytest.mark.parametrize("rtol", [1e-11, 1e-12])
@pytest.mark.parametrize(("name", "T"), [("andrews_squeezer", 0.01), ("four_bar", 1.0), ("bricard", 0.5)])
def test_tight_tolerances_do_not_control_rounding(name, T, rtol):
    """A stage computes v' with an error of eps |v| / (h ahat): no smaller step reduces its estimate."""
    sol = run(name, T, method="pherk6", rtol=rtol)
    assert sol.success
    assert sol.stats["rejected"] < 20 + 0.1 * sol.stats["steps"]


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"project": False}, {"step": 1e-3}, {}, {"formulation": "ggl"}])
def test_drivers_that_contradict_each_other_are_no_success(options):
    free = shared_model("four_bar")
    q, v = free.assemble(v={"crank": 1.0})
    drivers = [mbdae.Driver.at_speed(n, v[i], start=q[i]) for i, n in ((0, "crank"), (2, "rocker"))]
    sol = mbdae.solve(mbdae.load("four_bar", drivers=drivers), (0, 1), **options)
    assert not sol.success
    assert "'rocker driver'" in sol.message or "'crank driver'" in sol.message


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{"method": "radau5"}, {"method": "pherk5"}, {"method": "herk3"}, {"step": 0.01}])
def test_projected_runs_name_the_drivers_that_contradict_each_other(options):
    """Two speeds that suit each other at the start alone."""
    free = shared_model("slider_crank")
    q, v = free.assemble(v={"crank": 6.0})
    drivers = [mbdae.Driver.at_speed(n, v[i], start=q[i]) for i, n in ((0, "crank"), (1, "crank_pin"))]
    mech = mbdae.load("slider_crank", drivers=drivers)
    sol = mbdae.solve(mech, (0, 1), project=True, max_steps=500, **options)
    assert sol.status in ("driver", "step_size", "newton")
    assert "'crank driver'" in sol.message
    assert "'crank_pin driver'" in sol.message


def light_links(inertia):
    """A four-bar of heavy bars whose coupler hangs on two dummy links."""
    heavy = {"mass": 1e6, "com": [0.5, 0, 0], "inertia": [1e5, 1e5, 1e5, 0, 0, 0]}
    light = {"mass": 1e-9, "inertia": [inertia, inertia, inertia, 0, 0, 0]}
    hinge = {"joint": "revolute", "axis": [0, 1, 0]}
    bodies = [
        {"name": "crank", "parent": "world", **hinge, **heavy},
        {"name": "dummy_x", "parent": "crank", "joint": "revolute", "axis": [1, 0, 0], "xyz": [1, 0, 0], **light},
        {"name": "dummy_z", "parent": "dummy_x", "joint": "revolute", "axis": [0, 0, 1], **light},
        {"name": "coupler", "parent": "dummy_z", **hinge, **heavy},
        {"name": "rocker", "parent": "world", **hinge, "xyz": [2, 0, 0], **heavy},
    ]
    ends = [
        {"name": "a", "parent": "coupler", "xyz": [1.5, 0, 0]},
        {"name": "b", "parent": "rocker", "xyz": [1.2, 0, 0]},
    ]
    pin = {"name": "pin", "kind": "revolute", "frames": ["a", "b"], "axis": [0, 1, 0]}
    start = {"q": {"crank": 1.0}, "guess": {"coupler": -0.5, "rocker": 1.2}}
    return {"body": bodies, "frame": ends, "closure": [pin], "start": start}


def test_rank_is_one_of_geometry_and_not_of_masses(tmp_path):
    ends = []
    for inertia in (1e-2, 1e-12):
        path = tmp_path / "mechanism.py"
        path.write_text(f"def mechanism() -> dict:\n    return {light_links(inertia)!r}\n")
        mech = mbdae.load(path)
        assert mbdae.info(mech).dof == 1
        sol = mbdae.solve(mech, (0, 1), rtol=1e-8)
        assert sol.success
        assert mbdae.drift(sol).g_max < 1e-12
        ends.append(sol.q[-1])
    np.testing.assert_allclose(*ends, atol=1e-6)


@pytest.mark.parametrize("options", [["--step", "100"], ["--step", "0.2"]])
def test_nonsense_is_no_success(options):
    done = CliRunner().invoke(cli, ["solve", "four_bar", "-t", "100", *options])
    assert done.exit_code == 1
    ends = "doubtful", "nonfinite", "chart", "a motion with a violation of"  # rounding decides how it ends
    assert any(words in done.output for words in ends), done.output


def test_a_doubtful_run_names_the_open_closure_and_the_remedy():
    sol = mbdae.solve(shared_model("four_bar"), (0, 10), step=0.2, method="herk3")
    assert (sol.status, sol.success, sol.ended) == ("doubtful", False, True)
    assert "'pin'" in sol.message
    assert "take a smaller step, or project=True" in sol.message
    assert mbdae.solve(shared_model("four_bar"), (0, 10), rtol=1e-3).success
    last = mbdae.Event(f"t = {sol.t[-2]}", terminal=True)
    cut = mbdae.solve(shared_model("four_bar"), (0, 10), step=0.2, method="herk3", events=[last])
    assert cut.status == "doubtful"
    assert f"(a terminal event occurred: {last.function})" in cut.message


def test_a_t_eval_that_cannot_be_read_is_no_success(monkeypatch):
    def fails(self, *given):
        raise mbdae.errors.StepError("singular", "nothing between steps")

    monkeypatch.setattr("mbdae.solution.solution.Solution.points", fails)
    sol = run("four_bar", 1.0, t_eval=[0.5, 1.0])
    assert (sol.status, len(sol.t)) == ("singular", 0)
    assert "solution cannot be evaluated at t_eval" in sol.message
