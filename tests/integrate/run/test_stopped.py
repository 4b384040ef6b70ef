"""Runs that stop early keep what was computed: failing forces, limits, and interrupts at any moment."""

import sys

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae import MbdaeError
from mbdae.integrate.run import loop, run_state
from mbdae.integrate.steppers import core_record, native, stepper
from mbdae.studies.drift.drift import drift

LOOP = {"time_loop", "accept", "advance", "record_steps", "store", "_record_interval", "_extend", "extend", "complete"}


@pytest.fixture(scope="module")
def four_bar():
    return shared_model("four_bar")


def consistent(sol):
    """The arrays of a solution are consistent, and it can be read, measured and saved with any status."""
    n = len(sol.t)
    assert sol.q.shape == (n, sol.mechanism.nq)
    assert sol.v.shape == (n, sol.mechanism.nv)
    assert sol.lam_own.shape == sol.lam.shape == (n, sol.mechanism.ng)
    assert sol.work.shape == (n,)
    assert np.isfinite(sol.y).all()
    assert (np.diff(sol.t) > 0).all()
    assert drift(sol).t_end == sol.t[-1]
    assert sol.message
    assert "\n" not in sol.message
    return sol


def driven(law):
    return mbdae.load("four_bar", forces=[law])


@pytest.mark.parametrize("options", [{"rtol": 1e-6}, {"step": 0.01}, {"method": "herk3", "step": 0.01}])
@pytest.mark.parametrize("times", [None, np.linspace(0, 2, 41)])
def test_a_force_that_becomes_nan(options, times):
    def broken(t, q, v):
        return np.full(3, np.nan if t > 0.5 else 0.0)

    sol = consistent(mbdae.solve(driven(broken), (0, 2), t_eval=times, **options))
    assert (sol.status, sol.success) == ("nonfinite", False)
    assert "'broken'" in sol.message
    assert 0.3 < sol.t[-1] < 0.52
    assert len(sol.t) > 5


def test_nan_after_the_last_stage_of_a_step():
    # herk2 has no stage at the end of a step: a NaN there is first noticed when the run is read
    def broken(t, q, v):
        return np.full(3, np.nan if t > 0.5075 else 0.0)

    sol = mbdae.solve(driven(broken), (0, 2), method="herk2", step=0.01, t_eval=np.linspace(0, 2, 401))
    assert sol.status == "nonfinite"
    assert sol.t[-1] == pytest.approx(0.5, abs=0.011)
    assert np.isfinite(sol.y).all()


def test_a_force_that_returns_the_wrong_shape_or_raises():
    def short(t, q, v):
        return np.zeros(2 if t > 0.5 else 3)

    def raises(t, q, v):
        return np.zeros(3) / (1 if t < 0.5 else {}["gone"])

    def greedy(t, q, v):
        v *= -1.0
        return v

    for law, words in ((short, "shape (2,), expected shape (3,)"), (raises, "KeyError: 'gone'")):
        sol = consistent(mbdae.solve(driven(law), (0, 2)))
        assert sol.status == "force"
        assert repr(law.__name__) in sol.message
        assert words in sol.message
        assert 0.4 < sol.t[-1] <= 0.5
    for law, words in ((lambda t, q, v: [0.0, 0.0], "shape"), (lambda t: 0.0, "TypeError"), (greedy, "read-only")):
        with pytest.raises(MbdaeError, match=words):  # at the start: nothing to keep
            mbdae.solve(driven(law), (0, 2))


def test_too_many_steps(four_bar):
    for options in ({"rtol": 1e-8}, {"step": 1e-3}):
        sol = consistent(mbdae.solve(four_bar, (0, 2), max_steps=20, **options))
        assert sol.status == "max_steps"
        assert sol.stats["steps"] + sol.stats["rejected"] == 20
        assert "20 steps" in sol.message


def test_a_tolerance_that_cannot_be_met():
    def noise(t, q, v):
        return np.array([np.sin(1e12 * t) * 1e6, 0, 0])

    sol = consistent(mbdae.solve(driven(noise), (0, 1), rtol=1e-10, max_steps=1000))
    assert sol.status in ("step_size", "max_steps")


@pytest.mark.parametrize("calls", [1, 2, 7, 50, 333])
def test_interrupt_within_a_force(calls):
    count = 0

    def impatient(t, q, v):
        nonlocal count
        count += 1
        if count == calls:
            raise KeyboardInterrupt
        return np.zeros(3)

    sol = mbdae.solve(driven(impatient), (0, 2))
    assert (sol.status, sol.success) == ("interrupted", False)
    assert str(sol).startswith(f"interrupted: stopped by the user, t = {sol.t[-1]:.9g} s\n")
    assert len(sol.t) == len(sol.y) == len(sol.z_own)
    assert (len(sol.t) > 20) == (calls > 200)


@pytest.mark.parametrize("times", [None, np.linspace(0, 2, 201)])
def test_interrupt_within_the_progress_bar(four_bar, times):
    def press(done):
        if done > 0.4:
            raise KeyboardInterrupt

    sol = consistent(mbdae.solve(four_bar, (0, 2), progress=press, t_eval=times, backend="python"))
    assert sol.status == "interrupted"
    assert 0.7 < sol.t[-1] < 1.1


@pytest.mark.native
def test_interrupt_between_the_steps_of_the_compiled_core(four_bar):
    """Nodes arrive by the hundred, several times a second: all of them are kept."""

    def press(done):
        seen.append(done)
        if len(seen) == 3:
            raise KeyboardInterrupt

    seen = []
    sol = mbdae.solve(four_bar, (0, 1000), step=1e-3, progress=press)
    assert (sol.status, sol.stats["backend"]) == ("interrupted", "native")
    assert sol.t[-1] == pytest.approx(1000 * seen[-1], rel=1e-9)
    assert len(sol.t) == sol.stats["steps"] + 1 == len(sol.y) == len(sol.z_own)
    assert np.isfinite(sol.y).all()


def interrupted_at(line, is_counted, *given, **options):
    """A run that is interrupted at the given line, of those in frames that are counted."""
    seen = 0

    def trace(frame, event, arg):
        nonlocal seen
        if not is_counted(frame.f_code):
            return trace if frame.f_code.co_name == "solve" else None
        if event == "line":
            seen += 1
            if seen == line:
                sys.settrace(None)
                raise KeyboardInterrupt
        return trace

    sys.settrace(trace)
    try:
        return mbdae.solve(*given, **options)
    finally:
        sys.settrace(None)


@pytest.mark.parametrize(
    ("backend", "t1", "lines"),
    [("python", 2, range(60, 260, 3)), ("native", 20, range(8, 38)), ("native", 0.2, range(1, 14))],  # in one call
)
def test_interrupt_at_any_line_of_the_loop(four_bar, backend, t1, lines):
    files = {module.__file__ for module in (loop, core_record, native, stepper, run_state)}
    statuses = set()

    def in_loop(code):
        return code.co_filename in files and code.co_name in LOOP

    for line in lines:  # the line of the interrupt, counted in the loop and the record
        sol = interrupted_at(line, in_loop, four_bar, (0, t1), rtol=1e-6, backend=backend)
        statuses.add(sol.status)
        assert len(sol.t) == len(sol.y) == len(sol.z_own)
        assert (np.diff(sol.t) > 0).all()
    assert statuses == {"interrupted"}


def test_progress_rises_to_one(four_bar):
    for options in ({}, {"step": 0.03}):
        seen = []
        mbdae.solve(four_bar, (0, 1), progress=seen.append, backend="python", **options)
        assert seen == sorted(seen)
        assert seen[-1] == 1
        assert 0 < seen[0] < 1


@pytest.mark.parametrize("method", ["herk3", "herk5", "pherk5", "radau5"])
def test_steps_never_fall_below_the_rounding_of_time(method):
    """The speed grows without bound at a finite time: steps decrease towards it, each accepted."""
    plain = shared_model("four_bar")
    _, v = plain.assemble(v={"crank": 3.0})
    mech = mbdae.load("four_bar", forces=[lambda t, q, v: 1e3 * v**3])
    sol = mbdae.solve(mech, (0, 1e6), v=v, method=method)
    assert sol.status == "step_size"
    assert "rounds to t" in sol.message
    assert (np.diff(sol.t) > 0).all()
    with pytest.raises(mbdae.MbdaeError, match="no times"):
        mbdae.drift(mbdae.solve(mech, (0, 1e6), v=v, method=method, t_eval=[5.0, 6.0]))
    assert mbdae.solve(plain, (1, 2), max_step=1e-18).status == "step_size"


@pytest.mark.parametrize(
    ("event", "status", "said"),
    [
        (lambda t, q, v: np.nan if t > 0.05 else 1.0, "nonfinite", "returned nan"),
        (lambda t, q, v: 1 / 0 if t > 0.05 else 1.0, "force", "ZeroDivisionError"),
        (lambda t, q, v: "a" if t > 0.05 else 1.0, "force", "expected a number"),
        (lambda t, q, v: None if t > 0.05 else 1.0, "force", "returned None"),
        (lambda t, q, v: t > 0.05 or 1.0, "force", "returned True, expected a number that changes its sign"),
    ],
)
def test_an_event_that_fails_loses_nothing(event, status, said):
    sol = mbdae.solve(shared_model("four_bar"), (0, 1), events=event)
    assert sol.status == status
    assert "event" in sol.message
    assert said in sol.message
    assert 0.04 < sol.t[-1] < 0.2


@pytest.mark.parametrize(
    ("model", "options"),
    [("double_pendulum", {"method": "herk1", "step": 1.0}), ("flyball_governor", {"step": 0.05})],
)
def test_a_run_that_overflows_reports_it_once(model, options):
    """Numbers overflow: the status reports it, without numpy warnings."""
    sol = consistent(mbdae.solve(shared_model(model), (0, 50), **options))
    assert sol.status == "nonfinite"


@pytest.mark.parametrize("backend", ["python", "native"])
@pytest.mark.parametrize("options", [{}, {"method": "radau5"}, {"step": 1e-3}, {"method": "radau5", "step": 1e-3}])
def test_a_start_whose_accelerations_overflow_is_a_status(four_bar, options, backend):
    q, v = four_bar.assemble(v={"crank": 1e150})
    sol = mbdae.solve(four_bar, (0, 1), q, v, backend=backend, **options)
    assert sol.status == "nonfinite"
    assert "not finite at t = " in sol.message or "has entries that are not finite" in sol.message
    assert len(sol.t) == 1


@pytest.mark.native
def test_a_run_after_an_interrupted_one_with_modes():
    """At any line of the record: nodes and modes of an interrupted run are those of the whole one, as is a next run."""
    mech = shared_model("woodpecker")
    whole = mbdae.solve(mech, (0, 0.1), rtol=1e-6)
    found = set()
    for line in range(1, 120, 7):
        sol = interrupted_at(line, lambda code: code.co_filename == core_record.__file__, mech, (0, 0.1), rtol=1e-6)
        n = len(sol.t)
        np.testing.assert_array_equal(sol.y, whole.y[:n])
        assert sol.modes == [(i, mode) for i, mode in whole.modes if i < n]
        found.add(n)
    assert len(found) > 2
    np.testing.assert_array_equal(mbdae.solve(mech, (0, 0.1), rtol=1e-6).y, whole.y)
