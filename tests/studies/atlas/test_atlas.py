"""The atlas: its errors are those of other studies, it resumes, and refuses to mix what cannot be compared."""

import json
import re
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from commands import call

import mbdae
from mbdae.errors import InputError, MbdaeError
from mbdae.studies.atlas.model_motion import MotionTask, Settings
from mbdae.studies.atlas.result import rounded

COMMANDS = ("atlas spring_four_bar -m herk3,rattle2 --rtol 1e-3 --refinements 1 --executor threads -o out.html",)
MODELS = ("spring_four_bar", "pendulum_on_stop")
METHODS = ("pherk6", "herk3", "radau5", "rattle4", "index1:dop853", "gauss2")
OPTIONS = {"methods": METHODS, "rtol": [1e-3, 1e-5], "refinements": [1, 4], "executor": "threads", "workers": 2}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return tmp_path_factory.mktemp("atlas") / "atlas.jsonl"


@pytest.fixture(scope="module")
def small(data):
    return mbdae.atlas(MODELS, data=data, **OPTIONS)


def points(atlas):
    """Results of all runs without their times."""
    return {(r.model, *p.label): (p.status, p.errors, p.solves, p.g, p.energy) for r in atlas.runs for p in r.points}


@pytest.mark.slow
def test_every_method_runs_or_is_named_with_its_reason(small):
    assert small.complete
    for m in small.motions:
        assert {*m.methods} | {*m.omitted} == {*METHODS}
        assert not {*m.methods} & {*m.omitted}
    smooth, stop = small.motions
    assert smooth.conservative
    assert not stop.conservative
    assert "rod stop" in stop.omitted["rattle4"]
    assert {(f.model, f.method) for f in small.failures if f.status == "omitted"} == {
        (m.model, name) for m in small.motions for name in m.omitted
    }
    assert {r.method for r in small.runs if r.long} == {*smooth.methods}
    assert all(name in str(small) for name in MODELS)


def test_errors_and_best_methods_are_those_of_an_independent_comparison(small):
    """`compare` with the settings of the page's commands gives the same errors, counts and ranking."""
    c = small.comparisons["spring_four_bar"]
    steps = sorted({p.n for p in c.points if p.n})
    independent = mbdae.compare(
        "spring_four_bar",
        methods=c.methods,
        rtol=OPTIONS["rtol"],
        steps=steps,
        repeats=0,
        backend=small.meta["backend"],
    )
    assert {p.label: (p.errors, p.solves, p.g) for p in c.points} == {
        p.label: (p.errors, p.solves, p.g) for p in independent.points
    }
    wins = [w for w in small.wins if w.model == "spring_four_bar"]
    assert [w.target for w in wins] == independent.targets()
    assert wins
    for w in wins:
        best = independent.ranking(w.target, work="solves")[0]
        assert best.method in w.fewest
        assert w.solves == best.work


def test_a_long_run_is_that_of_solve_and_drift(small):
    for r in small.runs:
        if r.method not in ("rattle4", "herk3") or not r.long:
            continue
        x = r.long
        sol = mbdae.solve(r.model, (0.0, x.t_end), method=r.method, step=x.step)
        d = mbdae.drift(sol)
        np.testing.assert_allclose(
            [x.trend, x.trend_error, x.energy, x.g], [d.energy_trend, d.energy_trend_error, d.energy_relative, d.g_max],
            rtol=1e-6, atol=1e-15,
        )  # fmt: skip
        assert x.largest_rate == pytest.approx((abs(d.energy_trend) + 3 * d.energy_trend_error) / d.energy_scale)
        assert x.has_trend == (abs(d.energy_trend) > 3 * d.energy_trend_error)


@pytest.mark.slow
def test_an_interrupted_atlas_resumes(small, data, tmp_path):
    """Ctrl-C comes after five results, and a crash within a line; finished results are not computed again.

    Counts, errors and best methods are those of the atlas that was made in one go.
    """
    path, finished = tmp_path / "again.jsonl", []

    def interrupt(done, text):
        finished.append(text)
        if len(finished) == 5:
            raise KeyboardInterrupt

    stopped = mbdae.atlas(MODELS, data=path, progress=interrupt, **OPTIONS | {"workers": 1})
    assert not stopped.complete
    assert 0 < len(stopped.runs) < len(small.runs)
    with path.open("a") as file:
        file.write('{"model": "spring_')
    finished.clear()
    resumed = mbdae.atlas(MODELS, data=path, progress=lambda done, text: finished.append(text), **OPTIONS)
    assert resumed.complete
    assert points(resumed) == points(small)
    assert [w[:5] for w in resumed.wins] == [w[:5] for w in small.wins]
    assert len(finished) == len(MODELS) + len(small.runs) - len(stopped.runs)
    assert len(path.read_text().splitlines()) == len(data.read_text().splitlines())
    finished.clear()
    more = mbdae.atlas(
        MODELS, data=path, progress=lambda done, text: finished.append(text), **OPTIONS | {"methods": ["herk4"]}
    )
    assert sorted(finished[2:]) == sorted(f"{name}, herk4" for name in MODELS)  # workers finish in any order
    assert {r.method for r in more.runs} == {"herk4"}
    assert mbdae.atlas(MODELS, data=path, **OPTIONS).complete


def test_the_page_and_the_summary(small, tmp_path):
    small.save(tmp_path / "atlas.json")
    found = json.loads((tmp_path / "atlas.json").read_text())
    for name, m in found["models"].items():
        for target, works in m["work"].items():
            best = min(abs(x) for x in works["solves"] if x)
            win = next(w for w in small.wins if (w.model, f"{w.target:.0e}") == (name, target))
            assert best == pytest.approx(win.solves, rel=5e-4)
    small.save(tmp_path / "atlas.html")
    text = (tmp_path / "atlas.html").read_text()
    assert "http" not in text.replace("http-equiv", "").replace("http://www.w3.org/2000/svg", "")
    assert small.meta["machine"] in text
    chosen = {name: m["methods"] for name, m in found["models"].items()}
    assert work_on_page(text, chosen) == {name: m["work"] for name, m in found["models"].items()}


def work_on_page(text, methods):
    """Work for errors of q by model and error on a page, in the form of the file: a number for each method."""
    page = json.loads(re.search(r'id="data">(.*?)</script>', text, re.S)[1])
    names = [m["name"] for m in page["methods"]]
    out = {}
    for m in page["models"]:
        out[m["name"]] = works = {}
        for target, solves, _, seconds in m["ranks"]["q"]:
            kinds = {"solves": solves, "seconds": seconds}
            found = {k: {names[i]: -x if bound else x for i, x, bound in kind} for k, kind in kinds.items()}
            works[f"{target:.0e}"] = {k: [x.get(name) for name in methods[m["name"]]] for k, x in found.items()}
    return out


@pytest.mark.parametrize(
    ("x", "text"),
    [(1234.56, "1235"), (-1004.9, "-1005"), (0.000123456, "0.0001235"), (20.0, "20"), (123456, "123456"), (0.0, "0")],
)
def test_numbers_of_page_and_file_have_four_digits(x, text):
    assert str(rounded(x)) == text
    assert rounded(None) is None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"backend": "python"}, "another backend, native, not python"),
        ({"rtol": [1e-3]}, "another rtol"),
    ],
)
@pytest.mark.native
def test_other_results_are_not_mixed(small, data, change, words):
    before = data.read_bytes()
    with pytest.raises(InputError, match=words):
        mbdae.atlas(MODELS, data=data, **OPTIONS | change)
    assert data.read_bytes() == before


def test_another_machine_and_a_changed_model_are_rejected(small, data, tmp_path):
    path = tmp_path / "atlas.jsonl"
    path.write_text(data.read_text().replace(small.meta["machine"], "another computer"))
    with pytest.raises(InputError, match="another machine, another computer"):
        mbdae.atlas(MODELS, data=path, **OPTIONS)
    path.write_text(data.read_text().replace(small.motions[0].key, "0"))
    with pytest.raises(InputError, match="spring_four_bar has changed"):
        mbdae.atlas(MODELS, data=path, **OPTIONS)
    path.write_text("no atlas\n")
    with pytest.raises(InputError, match="not the data of an atlas"):
        mbdae.atlas(MODELS, data=path, **OPTIONS)
    with ThreadPoolExecutor(1) as custom:
        change = {"methods": ["herk3"], "executor": custom, "workers": None}
        assert mbdae.atlas(MODELS[:1], data=path, fresh=True, **OPTIONS | change).complete


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"models": ["four_bra"]}, "'four_bra'"),
        ({"models": []}, "at least one model"),
        ({"methods": ["pherk66"]}, "'pherk66'"),
        ({"rtol": [2.0]}, "rtol is a list of numbers between 0 and 1"),
        ({"rtol": ["fine"]}, "rtol is a list of numbers between 0 and 1"),
        ({"refinements": [0]}, "refinements are whole numbers"),
        ({"data": "atlas.csv"}, ".jsonl file"),
        ({"data": 3}, "data is the name of a file"),
        ({"executor": "trains"}, "'trains'"),
        ({"workers": 0}, "workers is a number"),
        ({"backend": "fortran"}, "'fortran'"),
    ],
)
def test_wrong_arguments_are_one_line(change, words):
    with pytest.raises(MbdaeError, match=words) as e:
        mbdae.atlas(**{"models": MODELS, **OPTIONS} | change)
    assert "\n" not in str(e.value)


def test_a_model_without_a_reference_is_a_result(monkeypatch):
    """A model that fails does not end the others."""

    def fail(*_):
        raise MbdaeError("no reference today")

    monkeypatch.setattr("mbdae.studies.comparison.reference_motion.ReferenceMotion.reference", fail)
    motion = MotionTask("spring_four_bar").run(Settings(("herk3",), (1e-3,), (1,), "python"), None)
    assert motion.failure == "no reference today"


def test_the_command(tmp_path):
    page = tmp_path / "atlas.html"
    words = (
        "spring_four_bar",
        "-m",
        "herk3",
        "--rtol",
        "1e-3",
        "--executor",
        "threads",
        "-o",
        page,
        "--data",
        tmp_path / "a.jsonl",
    )
    code, out, err = call("atlas", *words)
    assert (code, err) == (0, "")
    assert "atlas of 1 models, 1 methods" in out
    assert page.exists()
    code, out, err = call("atlas", "spring_four_bar", "--data", tmp_path / "a.csv")
    assert code == 2
    assert err.count("\n") == 1
