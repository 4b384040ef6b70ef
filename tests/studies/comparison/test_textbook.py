"""Comparisons on textbook problems: known exact solutions, custom methods, files, workers, invalid input."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError, UnknownNameError
from mbdae.studies.comparison.comparison import Comparison
from mbdae.textbook.problems import TEXTBOOK

RALSTON = "name = 'ralston3'\nA = [[], ['1/2'], [0, 0.75]]\nb = ['2/9', '1/3', '4/9']\n"


def slopes(study, method, quantity="y"):
    points = study.of(method)
    errors, steps = [p.errors[quantity] for p in points], [p.n for p in points]
    return -np.diff(np.log(errors)) / np.diff(np.log(steps))


@pytest.fixture(scope="module")
def reduction():
    """Where f is nonlinear in z, three methods with three to five stages."""
    methods = ["rk4", "pherk4", "herk3"]
    return mbdae.compare(TEXTBOOK["hessenberg_a"](), (0, 1), methods=methods, steps=[20, 40, 80], repeats=0)


def test_errors_are_those_to_the_exact_solution(reduction):
    problem = TEXTBOOK["hessenberg_a"]()
    assert (reduction.reference, reduction.cross_check) == ("the exact solution", "")
    assert "reference: the exact solution, known to" in str(reduction)
    for p in reduction.points:
        sol = mbdae.solve(problem, (0, 1), method=p.method, step=1 / p.n)
        errors = np.abs(sol.y - [problem.exact(t)[0] for t in sol.t]).max(axis=1)
        assert p.ends["y"] == pytest.approx(errors[-1], rel=1e-6)
        assert p.errors["y"] == pytest.approx(errors[:: p.n // 20].max(), rel=1e-6), "twenty common times"
        assert p.ends["z"] == pytest.approx(abs(sol.z[-1, 0] - np.exp(2)), rel=1e-3)
        assert p.energy is None


def test_order_reduction_and_its_cure_are_seen(reduction):
    assert slopes(reduction, "rk4")[-1] == pytest.approx(2, abs=0.2)
    assert slopes(reduction, "pherk4")[-1] == pytest.approx(4, abs=0.2)
    assert slopes(reduction, "pherk4", "z")[-1] == pytest.approx(4, abs=0.2)
    assert all(s.startswith("error in y of 1e-") for s in reduction.sentences())
    assert reduction.ranking(1e-6)[0].method == "pherk4"
    with pytest.raises(UnknownNameError, match="unknown quantity 'lam'"):
        reduction.plot(quantity="lam")


def test_a_reference_of_two_families_where_none_is_known():
    study = mbdae.compare(TEXTBOOK["car_axis_equations"](), (0, 0.05), methods=["pherk5"], rtol=[1e-5], repeats=0)
    assert study.reference.startswith("pherk6, rtol 1e-12")
    assert study.cross_check.startswith("radau9, rtol 1e-12")
    assert study.uncertainty["y"] < 1e-9
    tight = mbdae.solve(TEXTBOOK["car_axis_equations"](), (0, 0.05), method="herk5", rtol=1e-10)
    loose = mbdae.solve(TEXTBOOK["car_axis_equations"](), (0, 0.05), method="pherk5", rtol=1e-5)
    assert study.points[0].ends["y"] == pytest.approx(np.abs(loose.y[-1] - tight.y[-1]).max(), rel=1e-2)


def test_a_start_that_is_not_that_of_the_exact_solution_has_another_reference():
    turned = replace(TEXTBOOK["circle"](), y0=(0.0, 1.0))
    study = mbdae.compare(turned, (0, 0.5), methods=["herk2"], steps=[20], repeats=0)
    assert study.reference.startswith("pherk6")
    tight = mbdae.solve(turned, (0, 0.5), method="herk5", rtol=1e-10)
    assert tight.y[-1] == pytest.approx([-np.sin(0.5), np.cos(0.5)], abs=1e-9)


@pytest.mark.parametrize("suffix", [".csv", ".json"])
def test_files_hold_it_and_it_goes_on_from_there(reduction, tmp_path, suffix):
    path = tmp_path / f"study{suffix}"
    reduction.save(path)
    assert Comparison.load(path) == reduction
    options = {"methods": ["rk4", "herk3"], "steps": [20, 40], "repeats": 0}
    again = mbdae.compare(TEXTBOOK["hessenberg_a"](), (0, 1), **options, path=path)
    assert [p for p in reduction.points if p.method != "pherk4" and p.n < 80] == list(again.points)
    with pytest.raises(InputError, match="another mechanism, span"):
        mbdae.compare(TEXTBOOK["circle"](), (0, 1), **options, path=path)


@pytest.mark.usefixtures("forked_workers")
def test_processes_give_the_same():
    options = {"methods": ["herk2", "radau3"], "steps": [10, 20], "repeats": 0}
    one, two = (mbdae.compare(TEXTBOOK["circle"](), (0, 1), **options, workers=n) for n in (1, 2))
    assert one.points == two.points


def test_a_problem_of_the_users(tmp_path):
    own = replace(TEXTBOOK["circle"](), name="", title="mine")
    options = {"methods": ["herk2"], "steps": [10], "repeats": 0}
    study = mbdae.compare(own, (0, 1), **options)
    assert study.title == "mine"
    assert study.points[0].errors["y"] < 1e-2
    with pytest.raises(InputError, match="the functions of 'mine' cannot be saved"):
        mbdae.compare(own, (0, 1), **options, path=tmp_path / "mine.csv")
    with pytest.raises(InputError, match="cannot be sent to another process"):
        mbdae.compare(own, (0, 1), **options, workers=2)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"methods": ["ggl:pherk5"]}, "a textbook problem has the formulation 'index2' only, got 'ggl'"),
        ({"methods": ["project:pherk5"]}, "project"),
        ({"q": [1.0]}, "a textbook problem starts at y0"),
    ],
)
def test_what_belongs_to_mechanisms_is_rejected(options, words):
    with pytest.raises(InputError, match=words):
        mbdae.compare(TEXTBOOK["circle"](), (0, 1), **{"methods": ["herk2"], "steps": [10], "repeats": 0, **options})


def test_a_custom_method_on_the_command_line(tmp_path, monkeypatch):
    """The thesis' problem with a tableau from a file: a comparison, and its table in LaTeX."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(RALSTON)
    words = "compare hessenberg_a -t 1 -m mine.toml -m rk4 --steps 80,160 --repeats 0 -o c.csv -o c.tex --plot c.svg"
    done = CliRunner().invoke(cli, [*words.split(), "--quantity", "z", "--json"])
    assert done.exit_code == 0, done.output
    data = json.loads(done.stdout)
    assert data["written"] == ["c.csv", "c.tex", "c.svg"]
    assert [p["method"] for p in data["points"]] == ["ralston3", "ralston3", "rk4", "rk4"]
    coarse, fine = (p["error_y"] for p in data["points"][:2])
    assert np.log2(coarse / fine) == pytest.approx(2, abs=0.3), "Ralston's third order falls to the second"
    text = (tmp_path / "c.tex").read_text()
    assert r"method & fixed steps & error y & error z" in text
    assert text.count(r"\\") == 5
    assert r"\times 10^{" in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("compare circle --quantity lam", "unknown quantity 'lam'; valid: y, z"),
        ("compare pendulum --quantity y", "unknown quantity 'y'; valid: q, v, lam"),
        ("compare circl", "unknown model 'circl' .did you mean 'circle'"),
        ("compare circle --start q.a=1", "start values are those of mechanisms"),
    ],
)
def test_commands_refuse_by_name(words, said):
    with pytest.raises(InputError, match=said):
        CliRunner().invoke(cli, words.split(), catch_exceptions=False)
