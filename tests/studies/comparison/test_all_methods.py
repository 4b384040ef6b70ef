"""Comparison of all methods: those that suit a problem run, the others are named with their reasons."""

import sys

import pytest

import mbdae
from mbdae.studies.comparison import comparison_runs


@pytest.mark.slow
def test_all_methods_that_suit_a_mechanism():
    """Each method runs or is named; with numbers of steps those with fixed steps alone run, too."""
    study = mbdae.compare("four_bar", (0, 0.1), methods="all", rtol=[1e-3], steps=[20], repeats=0)
    known = {*mbdae.METHODS, "ida", "index1:dop853"}
    assert {*study.methods} | {*study.omitted} == known
    assert not {*study.methods} & {*study.omitted}
    assert all(p.success for p in study.points)
    for p in study.points:
        assert (p.n is None) == bool(p.method == "index1:dop853" or mbdae.METHODS[p.method].error_power)
    assert max(p.errors["q"] for p in study.points) < 1e-2
    assert all(name in str(study) for name in study.omitted)
    study = mbdae.compare("bicycle", (0, 0.1), methods="all", rtol=[1e-3], repeats=0)
    assert {"rattle4", "alpha", "gauss2"} <= {*study.omitted}
    assert "'rear_wheel'" in study.omitted["alpha"]
    assert "fixed steps" in study.omitted["gauss2"]
    assert {"pherk6", "radau5"} <= {*study.methods}


@pytest.mark.slow
def test_all_methods_on_a_mechanism_with_stops_and_on_a_textbook_problem():
    study = mbdae.compare("pendulum_on_stop", (0, 0.1), methods="all", rtol=[1e-3], repeats=0)
    assert "need formulation 'index2'" in study.omitted["index1:dop853"]
    assert "rod stop" in study.omitted["rattle2"]
    study = mbdae.compare("circle", (0, 0.1), methods="all", rtol=[1e-3], steps=[10], repeats=0)
    assert {"gauss2", "sdirk2", "pherk6"} <= {*study.methods}
    assert {"alpha", "rattle8", "index1:dop853"} <= {*study.omitted}


def test_a_method_whose_package_is_missing_is_omitted(monkeypatch):
    monkeypatch.setitem(sys.modules, "sksundae.ida", None)
    study = mbdae.compare("circle", (0, 0.1), methods="all", rtol=[1e-3], repeats=0)
    assert "needs scikit-sundae" in study.omitted["ida"]
    assert "pherk6" in study.methods


@pytest.mark.native
def test_step_sizes_that_python_chooses_are_said():
    study = mbdae.compare("four_bar", (0, 0.1), methods=["alpha", "pherk6"], rtol=[1e-3], repeats=0)
    assert "step sizes of alpha in Python" in study.computed_by
    assert study.meta["backend"] == "native"


def test_a_span_that_begins_later_has_its_own_start():
    """The driver of the cam prescribes its angle at each time."""
    found = mbdae.compare("cam_follower", (0.3, 0.4), methods=["pherk5"], rtol=[1e-6])
    assert found.points[0].success
    assert found.points[0].errors["q"] < 1e-6


def test_wall_times_of_another_machine_are_measured_again(tmp_path, monkeypatch):
    options = {"t_span": (0, 0.1), "methods": ["herk3"], "rtol": [1e-3], "repeats": 2, "path": tmp_path / "c.json"}
    first, same = (mbdae.compare("pendulum", **options) for _ in range(2))
    assert same.points == first.points
    monkeypatch.setattr(comparison_runs, "machine_description", lambda: "another machine")
    other = mbdae.compare("pendulum", **options)
    (a,), (b,) = first.points, other.points
    assert len(b.times) == 2
    assert not set(a.times) & set(b.times)
    assert (a.errors, a.solves) == (b.errors, b.solves)
