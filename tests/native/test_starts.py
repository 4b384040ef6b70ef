"""The start of a run in the core: rank, rows, point, derivative and first step are those of Python."""

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae import _native
from mbdae.mechanism.formulations.compiled_systems import CompiledSystem
from mbdae.system import System

MODELS = ("pendulum", "four_bar", "andrews_squeezer", "panda_handle", "bricard", "stewart_platform", "heavy_top")
MANY = 12  # four-bars: more rows than are examined by QR


def both(mech: mbdae.Mechanism):
    """Return workspaces of the core and of Python, and a start that violates the closures by 1e-9."""
    q, v = mech.start
    q = mech.manifold.integrate(q, 1e-9 * np.random.default_rng(1).normal(size=mech.nv))
    return mech.system(native=_native), mech.system(), mech.point(q, v, 0.0)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("project", [True, False])
def test_the_start_is_that_of_python(name, project):
    core, python, y = both(shared_model(name))
    found, expected = core.start(0.0, y, project), python.start(0.0, y, project)
    for a, b in zip(found, expected, strict=True):
        assert np.abs(a - b).max(initial=0) <= 1e-8 * (1 + np.abs(b).max(initial=0))
    assert core.rank == (python.rank or 0)
    assert core.rank_threshold == pytest.approx(python.rank_threshold, rel=1e-6)
    assert core.largest_g == pytest.approx(python.largest_g, abs=1e-9)


@pytest.mark.parametrize("project", [True, False])
def test_many_rows_start_by_sparse_elimination(project, monkeypatch):
    core, python, y = both(mbdae.load("n_four_bar", N=MANY))
    expected = python.start(0.0, y, project)
    monkeypatch.setattr(System, "start", lambda *_: pytest.fail("the start was computed in Python"))
    found = core.start(0.0, y, project)
    for a, b in zip(found, expected, strict=True):
        assert np.abs(a - b).max() <= 1e-7 * (1 + np.abs(b).max())
    assert core.in_use == python.in_use
    assert core.rank < core.ng
    assert core.remaining_rows_dependent(0.0, y)
    core.use_rows(core.in_use[:-1])
    assert not core.remaining_rows_dependent(0.0, y)


@pytest.mark.parametrize("name", ["four_bar", "andrews_squeezer", "heavy_top", "car_axis"])
def test_the_first_step_is_that_of_python(name, monkeypatch):
    mech = mbdae.load(name)
    core = mbdae.solve(mech, (0, 0.01), max_steps=1000)
    monkeypatch.setattr(System, "first_step", lambda *_, **__: None)
    monkeypatch.setattr(CompiledSystem, "first_step", System.first_step)
    monkeypatch.setattr(CompiledSystem, "begin", lambda *_: None)
    python = mbdae.solve(mech, (0, 0.01), max_steps=1000)
    assert core.stats["steps"] == python.stats["steps"]
    assert core.t[1] == pytest.approx(python.t[1], rel=1e-8)


@pytest.mark.parametrize(
    "options",
    [{}, {"step": 0.01}, {"method": "radau5"}, {"jumps": [0.05]}, {"max_steps": 3}, {"project": False}],
    ids=str,
)
@pytest.mark.parametrize("name", ["four_bar", "andrews_squeezer", "pendulum"])
def test_a_run_that_the_core_begins_is_the_same(name, options, monkeypatch):
    mech, begun = mbdae.load(name), []
    begin, end = CompiledSystem.begin, 2e-4 if name == "andrews_squeezer" else 0.1

    def recorded(*given):
        begun.append(begin(*given))
        return begun[-1]

    monkeypatch.setattr(CompiledSystem, "begin", recorded)
    found = mbdae.solve(mech, (0, end), **options)
    monkeypatch.setattr(CompiledSystem, "begin", lambda *_: None)
    expected = mbdae.solve(mech, (0, end), **options)
    assert len(begun) == 1
    assert begun[0] is not None
    assert len(found.t) > 1
    for column in ("t", "y", "z_own"):
        np.testing.assert_array_equal(getattr(found, column), getattr(expected, column))
    assert found.stats | {"seconds": 0} == expected.stats | {"seconds": 0}
    assert (found.status, found.message, found.in_use) == (expected.status, expected.message, expected.in_use)


@pytest.mark.parametrize("options", [{"first_step": 1e-3}, {"events": ["q.crank = 0.1"]}], ids=str)
def test_python_begins_runs_whose_start_its_sources_check(options, monkeypatch):
    monkeypatch.setattr(CompiledSystem, "begin", lambda *_: pytest.fail("the core began the run"))
    assert mbdae.solve("four_bar", (0, 0.1), **options).success
