"""Runs that the compiled core completes in one call are those of the time loop, bit for bit."""

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae.errors import InputError
from mbdae.integrate.options.options import RunOptions
from mbdae.integrate.run.loop import run_to_end
from mbdae.integrate.run.result import make_solution
from mbdae.integrate.run.run_setup import prepare

pytestmark = pytest.mark.native
HERE = (None, None, None)


def by_time_loop(mech, t1, **options):
    """Return the run with its sources of events."""
    run = prepare(mech, RunOptions.from_settings(mech, (0, t1), options), HERE)
    assert run.sources
    ended = run_to_end(run, None)
    sol = make_solution(run, mech, *ended, 0.0)
    run.release()
    return sol


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("four_bar", {}),
        ("panda_handle", {}),
        ("spring_four_bar", {}),  # with a redundant row
        ("rolling_disc", {}),
        ("double_pendulum", {"method": "radau5"}),
        ("four_bar", {"step": 1e-3, "method": "pherk5"}),
        ("four_bar", {"project": False}),
    ],
)
def test_a_completed_run_is_that_of_the_time_loop(name, options):
    mech = shared_model(name)
    run = prepare(mech, RunOptions.from_settings(mech, (0, 0.02), options), HERE, kinds=())
    assert run_to_end(run, None)[0] == "finished"
    assert not run.sources  # none was needed
    one, other = mbdae.solve(mech, (0, 0.02), **options), by_time_loop(mech, 0.02, **options)
    assert (one.status, one.message, one.settings, one.in_use) == (
        other.status, other.message, other.settings, other.in_use
    )  # fmt: skip
    for name in ("t", "y", "z_own"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_equal(one.carried, other.carried)
    assert {**one.stats, "seconds": 0.0} == other.stats
    for name in ("events", "singular", "modes", "impacts"):
        assert getattr(one, name) == getattr(other, name) == []


@pytest.mark.parametrize(
    ("name", "t1", "options"),
    [
        ("four_bar", 20, {}),  # a long run
        ("four_bar", 0.02, {"events": "q.crank = 0"}),
        ("four_bar", 0.02, {"jumps": (0.01,)}),
        ("pendulum_on_stop", 0.02, {}),  # with modes
    ],
)
def test_other_runs_have_sources_of_events(name, t1, options):
    mech = shared_model(name)
    given = {"events": None, "jumps": (), **options}
    of_run = RunOptions.from_arguments(mech, (0, t1), None, given["jumps"], given["events"], "auto")
    run = prepare(mech, of_run, HERE, kinds=())
    assert run_to_end(run, None)[0] == "finished"
    assert run.sources


def test_the_progress_of_a_completed_run_is_reported():
    seen = []
    mbdae.solve(shared_model("four_bar"), (0, 0.02), progress=seen.append)
    assert seen == [1.0]


@pytest.mark.parametrize(
    ("name", "t1"), [("four_bar", 0.02), ("four_bar", 1), ("rolling_disc", 0.02), ("humanoid_stance", 0.01)]
)
def test_a_given_start_is_checked_without_counting(name, t1):
    mech = shared_model(name)
    q, v = mech.start
    one, other = mbdae.solve(mech, (0, t1)), mbdae.solve(mech, (0, t1), q, v)
    np.testing.assert_array_equal(one.y, other.y)
    assert {**one.stats, "seconds": 0.0} == {**other.stats, "seconds": 0.0}


def test_an_open_start_is_rejected_by_name():
    mech = shared_model("four_bar")
    q, v = mech.start
    with pytest.raises(InputError, match=r"the start is not consistent: closure .* is violated by .* m"):
        mbdae.solve(mech, (0, 1e-3), q + 1e-3, v)
    with pytest.raises(InputError, match=r"the start is not consistent: closure .* is violated by .*/s"):
        mbdae.solve(mech, (0, 1e-3), q, v + [1e-3, *np.zeros(mech.nv - 1)])
