"""The examples run, with the documented results."""

import importlib.util
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from commands import call

import mbdae
from mbdae.studies.order.measurement import Measurement

pytestmark = pytest.mark.slow
EXAMPLES = Path(__file__).parent.parent / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(Path(name).stem, EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def thesis_commands():
    return list(dict.fromkeys(command for _, command in example("thesis_tables").COMMANDS))


@pytest.mark.parametrize("command", [c for c in thesis_commands() if c.startswith("mbdae ")])
def test_commands_of_the_thesis(command, monkeypatch):
    monkeypatch.setattr(Measurement, "max_solves", 4000)  # solves of a run, which suffice
    code, out, err = call(*command.split()[1:])
    assert code == 0, out + err
    assert len(out.splitlines()) > 3


def test_scripts_of_the_thesis_are_run_here():
    scripts = [Path(c.removeprefix("python ")).stem for c in thesis_commands() if c.startswith("python ")]
    assert scripts
    assert all(f'example("{name}").main(' in Path(__file__).read_text() for name in scripts)


def test_textbook_costs(capsys):
    methods = ("herk5", "pherk6", "hedop5", "radau5", "radau9")
    found = example("textbook_costs").main(problems=["circle"], targets=[1e-5], rtol=[1e-3, 1e-5, 1e-7], bdf=False)
    work = found["circle", 1e-5]
    assert tuple(work) == methods
    sol = mbdae.solve("circle", method="pherk6", rtol=1e-5)
    assert 0.2 < work["pherk6"] / sol.stats["f"] < 5, "the run with rtol of the error costs about as much"
    assert "not reached" in capsys.readouterr().out


def test_errors_over_time(tmp_path, capsys):
    changes = example("errors_over_time").main((80, 160, 320), plot=tmp_path / "errors.png")
    for found in changes.values():
        y, z = np.log2(found[0] / found[-1]) / 2  # powers of h, over two halvings
        assert abs(y) < 0.1
        assert -1.2 < z < -0.9
    assert (tmp_path / "errors.png").stat().st_size > 20000
    assert "power of h" in capsys.readouterr().out
    _, y, z = example("errors_over_time").errors("radau5", 20)
    assert y[-1] > 5 * y[1], "errors of y accumulate"
    assert z[-1] < 10 * z[1], "those of z do not"


def test_andrews_benchmark(capsys):
    rows = example("benchmarks/andrews").main()
    assert len(rows) == 4
    assert all(ratio <= 1.1 for *_, ratio in rows), rows
    assert "Fortran" in capsys.readouterr().out


def test_andrews_gradients(capsys):
    result = example("andrews_gradients").main(25, ("m1", "sd"), 0.01, method="pherk6", step=1e-4)
    assert result["off"].max() < 1e-6
    assert "derivatives differ by" in capsys.readouterr().out


def test_pherk6(capsys):
    result = example("pherk6").main(rtol=(1e-7, 1e-8))
    assert result["conditions"].holds
    assert result["study"].holds, str(result["study"])
    assert "pherk6" in capsys.readouterr().out


def test_stiff(capsys):
    result = example("stiff").main()
    assert result["radau5"]["steps"] < 0.25 * result["herk5"]["steps"]
    assert abs(result["radau5"]["crank"] - result["pherk5"]["crank"]) < 1e-5
    assert "radau5" in capsys.readouterr().out


def test_first_steps(tmp_path, capsys):
    sol = example("first_steps").main(tmp_path, end=1.0)
    assert sol.success
    assert (tmp_path / "run.npz").exists()
    assert "<html" in (tmp_path / "run.html").read_text()[:200].lower()
    assert "wrist pin carries" in capsys.readouterr().out


def test_custom_mechanism(capsys):
    sol = example("custom_mechanism").main(end=1.0)
    values = sol.signals()
    np.testing.assert_allclose(values["q.left"], values["q.right"], rtol=0, atol=1e-9)  # a parallelogram
    assert np.ptp(values["q.left"]) > 0.1
    assert "tilts" in capsys.readouterr().out


def test_driven_crank(capsys):
    result = example("driven_crank").main(end=0.5)
    assert abs(result["work"] - result["integrated"]) < 1e-3 * abs(result["integrated"])
    assert "torque of the motor" in capsys.readouterr().out


def test_gym_cart_pole(capsys):
    pytest.importorskip("gymnasium", reason="gymnasium is not installed: the extra gym")
    from gymnasium.utils.env_checker import check_env
    from scipy.integrate import solve_ivp

    module = example("gym_cart_pole")
    env = module.CartPole()
    check_env(env, skip_render_check=True)
    seen, _ = env.reset(seed=3)
    again, _ = env.reset(seed=3)
    np.testing.assert_array_equal(seen, again)
    x, v = env.simulator.q, env.simulator.v
    env.step(np.array([0.5], np.float32))

    def motion(t, y):  # the equations of textbooks, with the pole's inertia m l^2 / 3, l = 1
        (_, a, _, w), m = y, 0.1
        M = [[1.0 + m, 0.5 * m * np.cos(a)], [0.5 * m * np.cos(a), m / 3]]
        f = [10.0 + 0.5 * m * w * w * np.sin(a), 0.5 * m * 9.81 * np.sin(a)]
        return [*y[2:], *np.linalg.solve(M, f)]

    expected = solve_ivp(motion, (0, 0.02), [*x, *v], rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose([*env.simulator.q, *env.simulator.v], expected, atol=1e-8)
    returns = module.main(episodes=1)
    assert returns[0] > -300, "the pole at rest has -500"
    assert "episode 1" in capsys.readouterr().out


def test_press(tmp_path, capsys):
    result = example("press").main(plot=tmp_path / "press.png")
    assert (result["motor"], result["gear"]) == ("A", 20)
    # work of the press in its stroke: 800 N over 20 mm, with a linear rise over the first fifth
    assert abs(result["energy"] - 800 * 0.02 * 0.9) < 0.5
    assert (tmp_path / "press.png").stat().st_size > 10_000
    assert "motor A with a gear of 20" in capsys.readouterr().out
    module = example("press")
    backwards = module.main(-60.0)  # limits of speed hold in both directions
    assert backwards["gear"] * 60 <= module.MOTORS[backwards["motor"]][2]
    with pytest.raises(SystemExit, match="no motor of the list drives the press at 200 rad/s"):
        module.main(200.0)


def test_stewart_workspace(capsys):
    result = example("stewart_workspace").main(n=3)
    assert abs(result["angle"] - np.pi / 2) < 1e-9
    assert result["dead_points"] == 4
    assert result["reached"] > 3
    assert "positions are reachable" in capsys.readouterr().out


def test_arm_controller(capsys):
    module = example("arm_controller")
    sol = module.main(end=1.0)
    wheel = sol.signals("q.handle")["q.handle"]
    wanted = np.array([module.reference(t)[0] for t in sol.t])
    assert np.abs(wheel - wanted).max() < 0.03
    assert "reference" in capsys.readouterr().out


def test_compare_integrators(tmp_path, capsys):
    study = example("compare_integrators").main(tmp_path, end=0.3, repeats=1)
    assert len(study.points) == 3 * len(example("compare_integrators").METHODS)
    assert (tmp_path / "compare.csv").exists()
    assert (tmp_path / "compare.png").stat().st_size > 10_000
    assert "pherk6" in capsys.readouterr().out


def test_events(capsys):
    sol = example("events").main()
    assert sol.status == "event"
    assert abs(sol.t[-1] - 1.0190940393) < 1e-8
    assert "falls through" in capsys.readouterr().out


def test_energy_and_drift(tmp_path, capsys):
    result = example("energy_and_drift").main(end=2.0, plot=tmp_path / "drift.png")
    assert result["GGLSystem"].g_max < 1e-11
    assert result["index 2, projected"].g_max < 1e-11 < result["index 2"].g_max
    assert result["index 2"].Gv_max < 1e-11 < result["index 1"].Gv_max
    assert (tmp_path / "drift.png").exists()
    assert "formulation" in capsys.readouterr().out


def test_long_time_energy(tmp_path, capsys):
    result = example("long_time_energy").main({"four_bar": 100.0, "heavy_top": 1.0}, tmp_path / "energy.png")
    for model in ("four_bar", "heavy_top"):
        trends = {m: abs(d.energy_trend) / d.energy_trend_error for (name, m), d in result.items() if name == model}
        assert trends["rattle4"] < 3
        assert trends["pherk6"] > 3
    assert (tmp_path / "energy.png").exists()
    assert "trend" in capsys.readouterr().out


def test_all_families(capsys):
    result = example("all_families").main({"four_bar": 0.2}, rtol=(1e-3, 1e-5), steps=(20, 80))
    assert {"rattle4", "alpha", "radau5", "sdirk2", "index1:dop853"} <= {*result["four_bar"].methods}
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| `")]
    rows = dict(line.strip("| ").split(" | ") for line in lines)
    assert rows["`rattle4`"] != "-"
    assert rows["`herk1`"] == "-"


def test_tolerance_sweep(tmp_path, capsys):
    path, plot = tmp_path / "runs.parquet", tmp_path / "runs.png"
    result = example("tolerance_sweep").main(n=12, end=1.0, path=path, plot=plot, executor="threads")
    assert result.complete
    assert not result.failed
    force = result["peak force.wrist pin"]
    assert 5e-4 < force.std() / force.mean() < 5e-3  # links that vary by two thousandths
    assert plot.stat().st_size > 10_000
    assert "standard deviation" in capsys.readouterr().out


def test_tolerance_sweep_of_few_runs():
    with pytest.raises(SystemExit, match="4 links need at least 6 finished runs, got 2"):
        example("tolerance_sweep").main(n=2, end=0.1, executor="threads")


def test_tolerance_stack(capsys):
    errors = example("tolerance_stack").main(100)
    assert max(map(abs, errors.values())) < 3
    assert "100 runs: mean" in capsys.readouterr().out


def test_custom_method(capsys):
    try:
        study = example("custom_method").main()
    finally:
        mbdae.METHODS.pop("ralston3", None)
    assert study.holds
    assert "claimed 2, found 2" in capsys.readouterr().out


def test_snap_through(capsys):
    result = example("snap_through").main()
    assert abs(result["limit"] - 42.91432573122) < 1e-9
    assert result["limit"] < result["run"] < 1.1 * result["limit"]
    assert "snap-through" in capsys.readouterr().out
    assert np.isnan(example("snap_through").main(end=0.1)["run"])


def test_arm_modes(capsys):
    result = example("arm_modes").main(values=5)
    assert abs(result["shipped"] - 0.1448422723) < 1e-9
    assert result["best"] > 3 * result["shipped"]
    assert "decays at" in capsys.readouterr().out


def test_balancing(capsys):
    result = example("balancing").main()
    assert abs(result["mass"] - result["closed"]) < 1e-7
    assert result["after"] < 0.6 * result["before"]
    assert "closed form" in capsys.readouterr().out


def test_lift_assist(capsys):
    result = example("lift_assist").main(points=9)
    assert result["after"] < 0.06 * result["before"]
    assert "N m after (RMS)" in capsys.readouterr().out


def test_walker(tmp_path, capsys):
    found = example("walker").main(0.01505, 0.01512, plot=tmp_path / "walker.png")
    assert found["incline"] == pytest.approx(0.0150884379411, abs=1e-9)
    assert found["angle"] == pytest.approx(0.23716586, abs=1e-7)
    assert "period doubling" in capsys.readouterr().out


def test_a_branch_of_gaits_without_a_doubling_is_nan(monkeypatch):
    monkeypatch.setattr(mbdae, "periodic_branch", lambda *_, **__: SimpleNamespace(bifurcations=[]))
    assert np.isnan(list(example("walker").main().values())).all()


def test_foot_path(tmp_path, capsys):
    result = example("foot_path").main(points=19, plot=tmp_path / "path.png")
    assert result["after"] < 0.6 * result["before"]
    assert min(result["stride kept"], result["lift kept"]) > 1 - 1e-6
    assert (tmp_path / "path.png").stat().st_size > 10_000
    assert "mm after" in capsys.readouterr().out


def test_optimal_control(tmp_path, capsys):
    result = example("optimal_control").main(points=9, fast_points=7, plot=tmp_path / "torque.png")
    assert 0 < result["excess"] < 1e-4
    assert 0.3 < result["duration"] < 0.4
    assert (tmp_path / "torque.png").stat().st_size > 10_000
    assert "by collocation" in capsys.readouterr().out
