"""Every textbook problem: a consistent start, and derivatives against difference quotients."""

from dataclasses import replace

import numpy as np
import pytest
from commands import call

import mbdae
from mbdae import finite_differences
from mbdae.studies.drift.figure import drifts
from mbdae.textbook.problems import TEXTBOOK


@pytest.mark.parametrize("name", TEXTBOOK)
def test_start_and_derivatives(name):
    problem, rng, t, h = TEXTBOOK[name](), np.random.default_rng(3), 0.37, 1e-3
    system = problem.system()
    assert problem.g(0.0, problem.point()) == pytest.approx(0, abs=1e-14)
    y = problem.point() + 0.01 * rng.normal(size=len(problem.y0))
    z, dy, dz = (rng.normal(size=n) for n in (len(problem.z0), len(y), len(problem.z0)))
    for derivative, path in {
        "g_y": (problem.g_y(t, y) @ dy, lambda s: problem.g(t, y + s * dy)),
        "g_t": (problem.g_t(t, y), lambda s: problem.g(t + s, y)),
        "f_z": (system.f_z(t, y, z) @ dz, lambda s: system.f(t, y, z + s * dz)),
        "f_y": (problem.f_y and system.f_y(t, y, z) @ dy, lambda s: system.f(t, y + s * dy, z)),
    }.values():
        if derivative is not None:
            assert derivative == pytest.approx(finite_differences.numerical_derivative(path, h), rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("name", TEXTBOOK)
def test_a_run_is_saved_and_its_drift_is_seen(name, tmp_path, capsys):
    problem = TEXTBOOK[name]()
    sol = mbdae.solve(problem, (0, 0.05), method="pherk5", rtol=1e-6)
    sol.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(again.y, sol.y)
    found = mbdae.drift(again)
    assert found.g_max < 1e-9
    assert str(found).startswith(f"drift of {problem.title}, pherk5")
    assert list(again.signals())[:2] == ["t", "y.1"]
    assert len(again.signals()) == 1 + len(problem.y0) + len(problem.z0)


def test_drift_of_a_known_solution_is_that_of_its_z():
    # on the circle g_t + g_y f = 2 z |y|^2, and the exact z is 0
    sol = mbdae.solve(TEXTBOOK["circle"](), (0, 1), method="herk3", step=0.1)
    assert mbdae.drift(sol).Gv_max == pytest.approx(2 * np.abs(sol.z_own).max(), rel=1e-9)
    assert np.abs(sol.y[-1] - [np.cos(1), np.sin(1)]).max() < 1e-4


@pytest.mark.parametrize("length", [1.0, 1e-5])
def test_missing_derivatives_are_differenced_at_the_length_of_the_problem(length):
    def f(t, y, z):
        return np.array([-y[1], y[0]]) + (z[0] - 1) * y / length

    def g(t, y):
        return np.array([np.hypot(*y) - length])  # its derivatives change within a fraction of the length

    sol = mbdae.solve(mbdae.Hessenberg(f, g, [length, 0.0], [1.0]), (0, 1), method="herk3", step=0.05)
    np.testing.assert_allclose(sol.y[-1] / length, [np.cos(1), np.sin(1)], atol=1e-7)
    np.testing.assert_allclose(sol.z, 1.0, atol=1e-9)


def test_missing_quantities_of_a_problem_are_not_reported(tmp_path):
    """There are no energies and no bodies."""
    sol = mbdae.solve(TEXTBOOK["circle"](), (0, 1), method="herk3", step=0.1)
    found = mbdae.drift(sol)
    assert (found.energy_error, found.energy_relative, found.work_end) == (None, None, None)
    assert "|g_t + g_y f|  max" in str(found)
    assert "energy" not in str(found) + str(found.cells()) + str(list(found.to_columns().values))
    assert found.largest == found.Gv_max > found.g_max
    figure = found.plot(tmp_path / "drift.png")
    assert [len(ax.lines) for ax in figure.axes] == [1, 1]
    beside = drifts([found.history, mbdae.drift(mbdae.solve(mbdae.load("pendulum"), (0, 1))).history])
    assert [len(ax.lines) for ax in beside.axes] == [2, 1]
    for option in ("--html", "--video", "--glb"):
        _, _, err = call("solve", "circle", option, tmp_path / f"run.{'mp4' if 'v' in option else option[2:]}")
        assert "'Point on a circle' has no bodies to replay" in err


def test_a_run_is_drawn(tmp_path):
    sol = mbdae.solve(TEXTBOOK["circle"](), (0, 1), method="herk3", step=0.1)
    y, z = sol.plot(path=tmp_path / "run.svg").axes
    assert (tmp_path / "run.svg").stat().st_size > 5000
    assert (y.get_ylabel(), z.get_ylabel()) == ("$y$", "$z$")
    np.testing.assert_array_equal(y.lines[1].get_ydata(), sol.y[:, 1])
    (only,) = sol.plot("y.2").axes
    np.testing.assert_array_equal(only.lines[0].get_ydata(), sol.y[:, 1])
    with pytest.raises(mbdae.MbdaeError, match="unknown signal 'lam'; valid: y, z, t"):
        sol.plot("lam")


def test_what_has_no_name_is_not_saved(tmp_path):
    circle = replace(TEXTBOOK["circle"](), name="")
    with pytest.raises(mbdae.MbdaeError, match="the functions of 'Point on a circle' cannot be saved"):
        mbdae.solve(circle, (0, 0.1)).save(tmp_path / "run.npz")


COMMANDS = ["models --textbook", "solve circle -t 1 -m rk4", "solve circle -t 1", "drift hessenberg_a -t 0.2 -m herk3"]
COMMANDS += ["info circle", "info hessenberg_a --json"]


@pytest.mark.parametrize("words", COMMANDS)
def test_commands_take_them(words):
    code, out, _ = call(*words.split())
    assert code == 0
    assert ("Point on a circle" if "hessenberg" not in words else "Hessenberg problem (a)") in out
