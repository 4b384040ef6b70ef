"""Comparisons: errors agree with their definition, runs are kept, and rankings follow from the data."""

import numpy as np
import pytest

import mbdae
from mbdae.backend import load as load_core
from mbdae.backend import machine_description
from mbdae.errors import InputError, UnknownNameError
from mbdae.integrate.run.run_setup import common_backend
from mbdae.studies.comparison import comparison_runs
from mbdae.studies.comparison.comparison import Comparison
from mbdae.studies.comparison.ranking import rank, sentence, targets, work_at
from mbdae.studies.comparison.reference_motion import ReferenceMotion
from mbdae.studies.comparison.run_result import RunResult
from mbdae.studies.method_variant import Variant
from mbdae.textbook.problems import TEXTBOOK

METHODS = ("pherk5", "herk3", "ggl:pherk5", "project:pherk5", "index1:RK45")
QUICK = {"methods": ("pherk5", "herk3"), "rtol": (1e-3, 1e-5), "repeats": 1}


@pytest.fixture(scope="module")
def four_bar():
    return mbdae.load("four_bar")


@pytest.fixture(scope="module")
def study(four_bar):
    return mbdae.compare(four_bar, (0, 1), methods=METHODS, rtol=(1e-3, 1e-5, 1e-7), repeats=2)


# -- errors and work ---------------------------------------------------------------------------------------------------


def test_errors_are_differences_to_the_motion(study, four_bar):
    truth = mbdae.solve(four_bar, (0, 1), method="DOP853", formulation="index1", rtol=1e-12)
    for p in study.points:
        options = Variant.parse(p.method).arguments()
        sol = mbdae.solve(four_bar, (0, 1), rtol=p.rtol, backend=study.meta["backend"], **options)
        assert p.ends["q"] == pytest.approx(np.abs(sol.q[-1] - truth.q[-1]).max(), abs=1e-9)
        assert p.ends["v"] == pytest.approx(np.abs(sol.v[-1] - truth.v[-1]).max(), abs=1e-8)
        assert p.ends["lam"] == pytest.approx(np.abs(sol.lam[-1] - truth.lam[-1]).max(), abs=1e-7)
        assert p.errors["q"] >= p.ends["q"]
        kept = mbdae.drift(sol)
        assert (p.g, p.Gv, p.energy) == (kept.g_max, kept.Gv_max, kept.energy_relative)
        assert {name: sol.stats[name] for name in ("steps", "f", "M", "G", "solves", "factorizations")} == {
            name: getattr(p, name) for name in ("steps", "f", "M", "G", "solves", "factorizations")
        }
        assert len(p.times) == 2
        assert 0 < min(p.times) <= p.seconds <= max(p.times)


def test_the_reference_is_held_against_another_family(study):
    assert study.reference.startswith("pherk6, rtol 1e-12")
    assert study.cross_check.startswith("radau9, rtol 1e-12")
    assert 0 < study.uncertainty["q"] < 1e-12
    assert all(study.known(p) for p in study.points)


def test_errors_below_the_reference_are_marked(four_bar):
    loose = {"reference": ("pherk3", "herk3"), "reference_rtol": 1e-6}
    rough = mbdae.compare(four_bar, (0, 1), methods=["herk5"], rtol=[1e-3, 1e-9], **loose, repeats=0)
    coarse, fine = rough.points
    assert rough.known(coarse)
    assert not rough.known(fine)
    assert f"<{rough.floor():.1e}" in str(rough)
    assert fine.seconds is None
    assert "fastest" not in str(rough)
    with pytest.raises(InputError, match="below the uncertainty of the reference"):
        rough.ranking(rough.floor() / 2)


def test_fixed_steps_show_the_order(four_bar):
    study = mbdae.compare(four_bar, (0, 1), methods=["pherk3"], steps=[400, 200, 100], repeats=0)
    assert [p.n for p in study.points] == [100, 200, 400]
    errors = [p.errors["q"] for p in study.points]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([3, 3], abs=0.3)
    assert "fixed steps" in str(study)


def test_samples_are_not_interpolated(four_bar):
    """A step over the whole span has the error of its end at every common time, not that of a polynomial."""
    y = four_bar.point()
    motion = ReferenceMotion(four_bar, (y[:3], y[3:6]), (0.0, 0.2), np.array([0.05, 0.2]), 1000)
    sol = mbdae.solve(four_bar, (0, 0.2), method="radau5", step=0.2)
    tight = mbdae.solve(four_bar, (0, 0.2), method="pherk6", rtol=1e-11, t_eval=[0.05, 0.2])
    error = np.abs(motion.sample(sol)["q"] - tight.q).max(axis=1)
    assert error[0] < 1e-10
    assert error[1] > 1e-8


@pytest.mark.parametrize("model", ["slider_crank_with_stop", "stick_slip_slider"])
def test_every_sample_has_the_mode_of_its_step(model):
    mech = mbdae.load(model)
    study = mbdae.compare(mech, methods=["herk5"], rtol=[1e-6], reference=("pherk6", "herk5"), repeats=1)
    assert study.uncertainty["q"] < 1e-10
    assert study.uncertainty["lam"] < 1e-8
    (point,) = study.points
    runs = (("herk5", 1e-6), ("pherk6", 1e-12))
    ends = [mbdae.solve(mech, (0, mech.duration), method=m, rtol=r, project=False).q[-1] for m, r in runs]
    assert abs(point.ends["q"] - np.abs(ends[0] - ends[1]).max()) < 1e-11
    assert point.errors["q"] < 1e-5


def test_a_run_that_fails_is_kept_with_its_reason(four_bar):
    study = mbdae.compare(four_bar, (0, 1), methods=["herk1", "pherk5"], rtol=[1e-7], max_steps=100, repeats=0)
    failed, good = study.points
    assert (failed.status, failed.errors, failed.success) == ("max_steps", {}, False)
    assert good.success
    assert "max_steps" in str(study)
    assert study.ranking(1e-6)[-1].work is None


@pytest.mark.parametrize("backend", ["native", "python"])
def test_loops_that_have_drifted_open_keep_the_rank_of_the_run(backend):
    """Redundant rows of Bricard's loop are nearly independent there; those in use become singular in a long step."""
    if backend == "native" and load_core() is None:
        pytest.skip("there is no core")
    methods = ["herk3", "pherk6", "project:pherk6"]
    study = mbdae.compare("bricard", (0, 2), methods=methods, rtol=[1e-3], outputs=4, repeats=0, backend=backend)
    assert all(p.success and max(p.errors["q"], p.errors["v"]) < 1e-2 for p in study.points)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rtol": [1e-3], "steps": [100]}, "not both"),
        ({"rtol": [0.0]}, "between 0 and 1"),
        ({"rtol": []}, "between 0 and 1"),
        ({"steps": [0]}, "at least 1"),
        ({"methods": []}, "at least one method"),
        ({"reference": ["pherk5"]}, "two methods"),
        ({"workers": 0}, "workers"),
        ({"t_span": (1.0, 1.0)}, "finite and not empty"),
        ({"t_span": (1.0, 2.0, 3.0)}, "t_span is an end, or a start and an end"),
        ({"t_span": "long"}, "t_span is an end, or a start and an end"),
    ],
)
def test_wrong_arguments_are_rejected(four_bar, options, words):
    with pytest.raises(InputError, match=words):
        mbdae.compare(four_bar, **{"t_span": (0, 1), **options})
    with pytest.raises(UnknownNameError):
        mbdae.compare(four_bar, methods=["nosuch"])


# -- ranking -----------------------------------------------------------------------------------------------------------


def line(constant, order, works):
    """Runs with error = constant work^-order."""
    return [(constant * w**-order, w) for w in works]


def test_methods_that_know_no_stops_are_rejected_by_name_before_any_run():
    def reported(done, name):
        raise AssertionError(f"{name} is computed")

    with pytest.raises(InputError, match=r"need formulation 'index2', leave out ggl:pherk5, index1:dop853$"):
        mbdae.compare(
            "slider_crank_with_stop", (0, 0.1), methods=["pherk5", "ggl:pherk5", "index1:dop853"], progress=reported
        )


def test_work_is_interpolated_in_logarithms():
    runs = line(1.0, 4.0, [10.0, 100.0, 1000.0])
    assert work_at(runs, 1e-6)[0] == pytest.approx(10**1.5)
    assert work_at(runs, 1e-3) == (10.0, True), "the coarsest run is better: a bound"
    assert work_at(runs, 1e-13) == (None, False)
    assert work_at([(1e-2, 10.0), (0.0, 20.0)], 1e-6) == (20.0, False), "no logarithm of zero"
    bumpy = [(1e-2, 1.0), (1e-7, 2.0), (1e-5, 3.0), (1e-9, 4.0)]
    assert 3 < work_at(bumpy, 1e-6)[0] < 4, "a lucky run before a worse one does not count"


def test_rankings_name_best_ratio_and_what_is_not_reached():
    table = {"slow": line(1.0, 2.0, [10.0, 1e4]), "fast": line(1.0, 4.0, [10.0, 1e4]), "never": [(1.0, 5.0)]}
    places = rank(table, 1e-6)
    assert [p.method for p in places] == ["fast", "slow", "never"]
    assert sentence(places, "solves") == "fewest solves fast (32), then slow (x 31.62); not reached by never"
    assert targets([[1e-1, 1e-5], [1e-2, 1e-4]], 1e-12) == [1e-1, 1e-2, 1e-3, 1e-4]
    assert targets([[1e-1, 1e-5], [1e-2, 1e-4]], 2e-3) == [1e-1, 1e-2]


def test_sentences_follow_from_the_points(study):
    sentences = study.sentences()
    assert sentences[0].startswith("error in q of 1e-")
    best = study.ranking(1e-5)[0]
    assert f"fewest solves {best.method} ({best.work:.0f})" in next(s for s in sentences if "1e-05" in s)
    assert str(study).count("fewest solves") == len(sentences)


# -- files and resumption ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["study.json", "study.csv"])
def test_files_hold_everything(study, tmp_path, name):
    path = tmp_path / name
    study.save(path)
    again = Comparison.load(path)
    assert again.points == study.points
    assert again == study
    assert "\x1b" not in path.read_text()
    path.write_bytes(path.read_bytes()[:-400])
    if name.endswith("json"):
        with pytest.raises(InputError, match="is damaged"):
            Comparison.load(path)
    study.save(path)
    whole, (q, v) = path.read_text(), (repr(study.points[0].errors["q"]), repr(study.uncertainty["v"]))
    edited = [whole.replace('"v"', '"w"'), *(whole.replace(x, y) for x in (q, v) for y in ("NaN", "-1.0"))]
    for bad in ("", "{}", "# {}\na,b\n1,2\n", "# {]", *edited):
        path.write_text(bad)
        with pytest.raises(InputError, match="is damaged"):
            Comparison.load(path)
    with pytest.raises(InputError, match="no such file"):
        Comparison.load(tmp_path / "gone.json")
    with pytest.raises(InputError, match=r"\.csv or \.json"):
        study.save(tmp_path / "study.txt")


def test_failed_runs_survive_files(tmp_path):
    found = {"q": 0.1, "v": 0.2, "lam": 0.3}
    points = (
        RunResult("herk1", 1e-7, None, "max_steps", steps=5),
        RunResult("DOP853", None, 7, "finished", found, found),
    )
    result = Comparison("x", (0.0, 1.0), points, "a", "b", {"q": 1e-9, "v": 1e-9, "lam": 1e-9})
    for name in ("c.csv", "c.json"):
        result.save(tmp_path / name)
        assert Comparison.load(tmp_path / name) == result


@pytest.mark.parametrize("name", ["c.csv", "c.json"])
def test_what_is_finished_is_not_done_again(four_bar, tmp_path, monkeypatch, name):
    runs = []
    real = ReferenceMotion.solve
    monkeypatch.setattr(
        ReferenceMotion, "solve", lambda self, trial, *rest: runs.append(str(trial)) or real(self, trial, *rest)
    )

    def stop(done, what):
        if what.startswith("herk3, rtol 1e-05"):
            raise KeyboardInterrupt

    first = mbdae.compare(four_bar, (0, 1), **QUICK, progress=stop, path=tmp_path / name)
    assert not first.complete
    assert len(first.points) == 3
    assert "stopped: 3 of 4 runs" in str(first)
    assert Comparison.load(tmp_path / name).points == first.points
    runs.clear()
    second = mbdae.compare(four_bar, (0, 1), **QUICK, path=tmp_path / name)
    assert second.complete
    assert [r for r in runs if "1e-12" not in r] == ["herk3, rtol 1e-05"]
    assert second.points[:3] == first.points
    runs.clear()
    third = mbdae.compare(four_bar, (0, 1), **QUICK | {"methods": ["herk3"]}, path=tmp_path / name)
    assert runs == []
    assert third.points == second.points[2:]
    assert Comparison.load(tmp_path / name).points[2:] == second.points[:2], "the file keeps the others behind"
    with pytest.raises(InputError, match="another mechanism, span"):
        mbdae.compare(four_bar, (0, 2), **QUICK, path=tmp_path / name)
    with pytest.raises(InputError, match="another mechanism"):
        mbdae.compare(mbdae.load("slider_crank"), (0, 1), **QUICK, path=tmp_path / name)


def test_times_are_taken_in_turn(four_bar, monkeypatch):
    order = []
    real = ReferenceMotion.solve
    monkeypatch.setattr(
        ReferenceMotion, "solve", lambda self, run, *rest: order.append(str(run)) or real(self, run, *rest)
    )
    reported = []
    options = QUICK | {"repeats": 3}
    study = mbdae.compare(four_bar, (0, 0.2), **options, progress=lambda done, name: reported.append(done))
    names = [f"{m}, rtol {r:g}" for m in QUICK["methods"] for r in QUICK["rtol"]]
    assert [o for o in order if "1e-12" not in o] == 3 * names
    assert all(len(p.times) == 3 for p in study.points)
    assert reported == sorted(reported)
    assert 0.5 < reported[-1] <= 1
    monkeypatch.setattr(comparison_runs, "LONG_RUN", 0.0)
    once = mbdae.compare(four_bar, (0, 0.2), **QUICK | {"repeats": 3})
    assert all(len(p.times) == 1 for p in once.points), "long runs are timed once"


@pytest.mark.native
def test_one_back_end_for_all_runs(four_bar):
    """Times compare: if the core lacks one, all methods run in Python; scipy always steps there."""
    options = {"t_span": (0, 0.2), "rtol": [1e-4], "repeats": 1, "outputs": 2}
    methods = ["pherk5", "project:herk5", "ggl:pherk5", "ggl:radau3", "index1:dop853", "index1:RK45"]
    study = mbdae.compare(four_bar, methods=methods, **options)
    assert study.meta["backend"] == "native"
    assert f"all runs: native back end, steps of index1:RK45 in Python, {machine_description()}" in str(study)
    written = next(iter(TEXTBOOK.values()))()
    assert common_backend(written, [("index2", None)], "auto") == ("python", "textbook problems")
    with pytest.raises(InputError, match="does not support textbook problems"):
        common_backend(written, [("index2", None)], "native")
