"""The interface between Python and the compiled core: callbacks, threads, missing features."""

import gc
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from shared import shared_model
from test_native import assert_same, both

import mbdae
from mbdae import backend
from mbdae.errors import InputError
from mbdae.integrate.steppers import native
from mbdae.mechanism.closures.rows import DotProduct2, FrameRows
from mbdae.textbook.problems.hessenberg_a import hessenberg_a

pytestmark = pytest.mark.native

# -- Python within the core ------------------------------------------------------------------------------------------


def failing(error, after=40):
    calls = []

    def law(t, q, v):
        calls.append((t, q, v))
        if t > after / 100:
            raise error
        return np.array([np.cos(t), 0.1 * v[0], -q[0]])

    return mbdae.load("four_bar", forces=[law]), calls


def test_functions_that_raise_end_the_run_as_in_python():
    mech, calls = failing(ZeroDivisionError("here"))
    native, python = both(mech, (0, 1), step=0.01)
    assert native.status == "force"
    assert "ZeroDivisionError: here" in native.message
    assert_same(native, python)
    kept = [q.copy() for _, q, _ in calls]
    del native, python
    gc.collect()
    np.testing.assert_array_equal([q for _, q, _ in calls], kept)  # arguments may be kept


@pytest.mark.parametrize("name", ["native", "python"])
def test_what_is_no_error_goes_through(name):
    stopped = mbdae.solve(failing(KeyboardInterrupt())[0], (0, 1), step=0.01, backend=name)
    assert stopped.status == "interrupted"
    assert stopped.t[-1] == pytest.approx(0.4)
    with pytest.raises(SystemExit, match="7"):
        mbdae.solve(failing(SystemExit(7))[0], (0, 1), step=0.01, backend=name)


def test_functions_cannot_change_their_arguments():
    def law(t, q, v):
        v[:] = 0.0
        return v

    for name in ("native", "python"):
        with pytest.raises(InputError, match="read-only"):
            mbdae.solve(mbdae.load("four_bar", forces=[law]), (0, 1), step=0.01, backend=name)


def test_a_core_executes_one_call_at_a_time():
    def law(t, q, v):
        return np.zeros(3) if inside else np.array([system.core.derivative(t, system.mechanism.point())[1]] * 3)

    inside = False
    system = mbdae.load("four_bar", forces=[law]).system(native=backend.load())
    system.use_rows((0, 2))
    assert system.core.derivative(0.0, system.mechanism.point()) is None
    inside = True
    assert system.core.derivative(0.0, system.mechanism.point())


@pytest.mark.slow
def test_a_function_that_knows_its_run_is_collected():
    code = """if True:
        import mbdae, numpy as np
        def law(t, q, v): return np.zeros(3)
        mech = mbdae.load("four_bar", forces=[law])
        sol = mbdae.solve(mech, (0, 0.1), step=0.01)
        law.sol = sol"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=100)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_threads_share_a_mechanism():
    mech = shared_model("stewart_platform")
    run = lambda step: mbdae.solve(mech, (0, 0.5), step=step, backend="native").y  # noqa: E731
    steps = [0.01, 0.007, 0.005, 0.003]
    with ThreadPoolExecutor(2) as pool:
        for a, b in zip(pool.map(run, steps), map(run, steps), strict=True):
            np.testing.assert_array_equal(a, b)


def test_a_mechanism_is_pickled_after_a_run():
    mech = shared_model("pendulum")
    sol = mbdae.solve(mech, (0, 0.1), step=0.01, backend="native")
    again = mbdae.solve(pickle.loads(pickle.dumps(mech)), (0, 0.1), step=0.01, backend="native")
    np.testing.assert_array_equal(again.y, sol.y)


# -- what the core does not have -------------------------------------------------------------------------------------


def test_what_is_missing_is_named():
    problem, words = hessenberg_a(), "textbook problems"
    with pytest.raises(InputError, match=f"backend='native' does not support {words}"):
        mbdae.solve(problem, (0, 0.1), backend="native")
    sol = mbdae.solve(problem, (0, 0.1))
    assert (sol.stats["backend"], sol.stats["fallback"]) == ("python", words)
    assert "fallback" not in mbdae.solve(problem, (0, 0.1), backend="python").stats


def test_rows_that_the_core_lacks_run_in_python(monkeypatch):
    monkeypatch.setattr(DotProduct2, "core_data", FrameRows.core_data)
    sol = mbdae.solve(mbdae.load("four_bar"), (0, 0.1))
    assert (sol.stats["backend"], sol.stats["fallback"]) == ("python", "rows of kind DotProduct2")


def test_one_solution_read_in_several_threads():
    """They use its workspace in turn, though its force law releases the lock."""
    sol = mbdae.solve(mbdae.load("four_bar", forces=[lambda t, q, v: -0.1 * v]), (0, 1), step=2e-3, backend="native")
    with ThreadPoolExecutor(3) as threads:
        found = list(threads.map(lambda k: sol(np.linspace(0, 1, 1001)).q, range(3)))
    assert all(np.array_equal(q, found[0]) for q in found)


def test_an_event_on_a_multiplier_takes_forces_from_the_last_stage():
    """It was evaluated at the end of the step: no law is called again, except at the start of the run."""
    calls = []

    def nothing(t, q, v):
        calls.append(t)
        return np.zeros(3)

    mech, asked = mbdae.load("four_bar", forces=[nothing]), []
    for events in ([], ["force.pin > 1e9"], ["force.pin > 1e9", "lam.pin.1 > 1e9"]):
        calls.clear()
        sol = mbdae.solve(mech, (0, 0.1), method="pherk5", step=2e-3, events=events, backend="native")
        assert sol.stats["steps"] == 50
        asked.append(len(calls))
    assert asked[0] <= asked[1] <= asked[2] <= asked[0] + 3


@pytest.mark.parametrize("method", ["herk3", "pherk6"])
def test_time_slices_do_not_affect_the_result(method, monkeypatch):
    """Between slices Python checks for Ctrl-C: on a busy machine after other steps than on an idle one."""
    mech, found = shared_model("jansen_walker"), []
    for seconds in (1e9, 0.0):
        monkeypatch.setattr(native, "CHECK_INTERVAL", seconds)
        found.append(mbdae.solve(mech, (0.0, 0.2), method=method, rtol=1e-5, project=True))
    assert (found[0].t == found[1].t).all()
    assert (found[0].y == found[1].y).all()
