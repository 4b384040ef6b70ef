"""A report on a beam that bends beyond the range of linear modes: the methods are compared, and the report says it."""

from copy import copy

import pytest
from flexible_bodies import CANTILEVER

import mbdae
from mbdae.studies.comparison.reference_motion import is_valid_reference

LOADED = f"""
gravity = [0.0, -9.81, 0.0]
[order]
T = 0.1{CANTILEVER}"""
WARNING = "bar bends beyond the range of linear modes, by 0.12 m of 1 m"


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("bar") / "bar.toml"
    path.write_text(LOADED)
    return mbdae.report(path, 0.3, methods=["radau5"], tolerances=(1e-4, 1e-6), repeats=0)


def test_the_deflection_is_that_of_a_suddenly_loaded_beam(report):
    """Twice the static one, w L^4 / (8 EI), at most: the first mode swings through it."""
    assert report.sol.status == "doubtful"
    assert WARNING in report.sol.message
    tip = report.sol.q @ report.sol.mechanism.model.flexible[0].modal.nodes["tip"].Phi[1]
    assert abs(tip).max() == pytest.approx(2 * 0.27 * 9.81 / (8 * 7e10 * 8e-11), rel=0.03)


def test_methods_are_compared(report):
    loose, tight = report.comparison.points
    assert 0 < tight.errors["q"] < 0.1 * loose.errors["q"] < 1e-6
    assert {p.status for p in report.comparison.points} == {"doubtful"}
    assert [d.energy_relative < 1e-6 for d in report.drifts] == [True]
    assert WARNING in str(report)


def test_runs_with_doubtful_numbers_are_no_reference(report):
    other = copy(report.sol)
    other.message += "; not resolved: mode 2"
    assert is_valid_reference(report.sol)
    assert not is_valid_reference(other)
