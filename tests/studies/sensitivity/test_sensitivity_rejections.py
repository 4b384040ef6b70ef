"""Invalid input of sensitivities and gradients, in one line; forces without direction have no derivative."""

from contextlib import nullcontext

import numpy as np
import pytest
from sprung_arm import ARM

import mbdae
from mbdae.errors import InputError, MbdaeError, StepError, UnknownNameError
from mbdae.studies.optimize.objective import curve_function

CRANK = mbdae.Event("q.crank = 1.0", terminal=True)
MASS = ["joint.crank.mass"]


@pytest.fixture(scope="module")
def ended():
    return mbdae.solve(mbdae.load("four_bar"), (0.0, 1.0), step=0.05, events=CRANK)


@pytest.fixture(scope="module")
def sol():
    return mbdae.solve(mbdae.load("four_bar"), (0.0, 0.1), step=0.05)


def broken(t, q, v):
    return 1 / 0


EVENTS = [
    (broken, StepError, "event 'broken' failed at t = .*ZeroDivisionError"),
    (lambda: 0.0, StepError, "event '<lambda>' failed at t = .*TypeError"),
    (lambda t, q, v: None, StepError, "event '<lambda>' returned None, expected a number"),
    (lambda t, q, v: True, StepError, "event '<lambda>' returned True, expected a number that changes its sign"),
    (lambda t, q, v: q[:1], StepError, r"event '<lambda>' returned shape \(1,\), expected a number"),
    (lambda t, q, v: 1j, StepError, "event '<lambda>' returned 1j"),
    (lambda t, q, v: "a", StepError, "event '<lambda>' returned 'a'"),
    (lambda t, q, v: np.nan, StepError, "event '<lambda>' returned nan"),
    (lambda t, q, v: 0.0, InputError, "event '<lambda>' has zero rate at the end of the run, t = 0.33"),
    (lambda t, q, v: q[0] - 1.1, InputError, r"event '<lambda>' is not the one in which the run ended: it is -0\.1 "),
    ("q.rocker = 2.0", InputError, r"event 'q\.rocker = 2\.0' is not the one in which the run ended"),
    ("q.crank = 0.5", InputError, r"event 'q\.crank = 0\.5' is not the one .*: it is 0\.5 at t = 0\.33"),
    ("nothing", UnknownNameError, "unknown signal 'nothing'"),
    (["q.crank = 1.0"], InputError, "an event is a signal or a function"),
    (None, InputError, "the run ended in a terminal event, whose time depends on parameters: give"),
]


@pytest.mark.parametrize(("event", "error", "words"), EVENTS)
def test_an_event_that_is_not_that_of_the_run(ended, event, error, words):
    with pytest.raises(error, match=words) as found:
        mbdae.sensitivity(ended, MASS, event=event)
    assert event is not broken or isinstance(found.value.__cause__, ZeroDivisionError)


@pytest.mark.parametrize("event", [CRANK, "q.crank = 1.0", "q.crank > 1", lambda t, q, v: 1e3 * (q[0] - 1)])
def test_the_event_of_the_run_is_known_in_other_words(ended, event):
    found = mbdae.sensitivity(ended, MASS, event=event)
    assert found.dt[-1] == pytest.approx(mbdae.sensitivity(ended, MASS, event=CRANK).dt[-1], rel=1e-6)


def moved(mass):
    if mass != 1.0:
        raise ValueError("one alone")
    return mbdae.load("four_bar")


def other(mass, length):
    return mbdae.load("four_bar")


MODELS = [
    (moved, {"mass": 1.0}, InputError,
     "'mass' = 1 cannot be changed by .* to find its derivative: model 'moved' failed at mass = .*ValueError: one"),
    (moved, {"mass": 2.0}, MbdaeError, r"model 'moved' failed at mass = 2\.0: ValueError: one alone"),
    (other, {"mass": 2.0}, MbdaeError, r"model 'other' failed at mass = 2\.0: TypeError: .*length"),
    (moved, {"length": 2.0}, UnknownNameError, "unknown parameter of moved 'length'.*valid: mass"),
    (moved, ["mass"], InputError, "given as name = value"),
    (int, {"mass": 2.0}, InputError, "model 'int' has no readable signature"),
]  # fmt: skip


@pytest.mark.parametrize(("model", "parameters", "error", "words"), MODELS)
def test_a_model_that_fails_is_named(sol, model, parameters, error, words):
    for study in (mbdae.sensitivity, lambda *a, **named: mbdae.gradient(a[0], lambda s: (0.0, {}), *a[1:], **named)):
        with pytest.raises(error, match=words):
            study(sol, parameters, model=model)


def test_a_parameter_of_a_function_needs_the_function():
    sol = mbdae.solve("n_four_bar", (0, 0.01), step=0.01)
    with pytest.raises(InputError, match=r"'N' is a parameter of n_four_bar, .* give the file itself, model="):
        mbdae.sensitivity(sol, ["N"])


def test_settings_of_runs_are_no_parameters(sol):
    with pytest.raises(UnknownNameError, match=r"unknown parameter 'solve.rtol'; valid: .* joint\. \.\.\.$"):
        mbdae.sensitivity(sol, ["solve.rtol"])


def test_start_is_a_yes_or_no(sol):
    with pytest.raises(InputError, match="start is True or False, got 'a'"):
        mbdae.sensitivity(sol, MASS, start="a")
    with pytest.raises(InputError, match="start is True or False, got 1"):
        mbdae.gradient(sol, lambda s: (0.0, {}), MASS, start=1)


def test_a_cost_that_fails_is_the_cause(sol):
    with pytest.raises(InputError, match=r"^cost 'broken' failed: TypeError: broken.* missing 2") as found:
        mbdae.gradient(sol, broken, MASS)
    assert isinstance(found.value.__cause__, TypeError)
    with pytest.raises(InputError, match=r"data of 'q\.crank' are numbers"):
        mbdae.gradient(sol, mbdae.Squares({"q.crank": np.array([1j, 0, 0])}), MASS)


def hung(x, more):
    """The arm without gravity, its spring attached at (x, 0, 0)."""
    return f"gravity = [0.0, 0.0, 0.0]{ARM.replace('[0.0, 0.0, 0.6]', f'[{x}, 0.0, 0.0]')}{more}"


LOST = "force 'spring' has no direction where its points coincide: no derivative"


@pytest.mark.parametrize("more", ["length = 0.3", "damping = 1.0", "force = 2.0"])
@pytest.mark.parametrize("backend", ["python", pytest.param("native", marks=pytest.mark.native)])
def test_a_spring_between_coincident_points_has_no_derivative(tmp_path, more, backend):
    path = tmp_path / "arm.toml"
    path.write_text(hung(0.4, more))
    mech = mbdae.load(path)
    run = mbdae.solve(mech, (0.0, 0.02), step=0.01, backend=backend)
    with pytest.raises(InputError, match=LOST):
        mbdae.sensitivity(run, start=True)
    with pytest.raises(InputError, match=LOST):
        mbdae.gradient(run, lambda s: (0.0, {}), ["force.spring.stiffness"])
    for study in (mbdae.linearize, mbdae.modes, mbdae.equilibrium):
        with pytest.raises(InputError, match=LOST):
            study(mech, np.zeros(1))
    path.write_text(hung(0.41, more))
    apart = mbdae.sensitivity(mbdae.solve(mbdae.load(path), (0.0, 0.02), step=0.01, backend=backend), start=True)
    assert np.abs(apart.dy).max() < 100


def test_a_force_that_flips_as_its_points_pass_has_no_derivative(tmp_path):
    """The arm swings by 0.2 rad through the anchor in two steps: a spring of length 0.3 flips, a damper does not."""
    path, start = tmp_path / "arm.toml", {"q": {"arm": -0.1}, "v": {"arm": 1.0}}
    for more in ("length = 0.3", "force = 2.0", "damping = 1.0"):
        path.write_text(hung(0.4, more))
        mech = mbdae.load(path)
        run = mbdae.solve(mech, (0.0, 0.2), *mech.assemble(**start), step=0.09)
        with pytest.raises(InputError, match=LOST) if more != "damping = 1.0" else nullcontext():
            mbdae.sensitivity(run, start=True)


def test_a_spring_of_zero_rest_length_has_derivatives_everywhere(tmp_path):
    """F = -k (b - a): its stiffness is k in all directions; other lengths, forces and holding efforts have none."""
    path = tmp_path / "arm.toml"
    path.write_text(hung(0.4, ""))
    mech = mbdae.load(path)
    stiffness = 10 * 0.4**2 / (0.1 + 2 * 0.5**2)  # of theta'' = -stiffness theta + O(theta^3)
    assert mbdae.linearize(mech, np.zeros(1)).A[1, 0] == pytest.approx(-stiffness)
    run = mbdae.solve(mech, (0.0, 0.02), step=0.01)
    found = mbdae.sensitivity(run, ["force.spring.stiffness"], start=True)
    assert np.abs(found.dy).max() < 10
    assert found.dy[-1, 1, 1] == pytest.approx(-np.sqrt(stiffness) * np.sin(0.02 * np.sqrt(stiffness)), rel=1e-6)
    with pytest.raises(InputError, match=LOST):
        mbdae.sensitivity(run, {"force.spring.force": 0.0})
    path.write_text(hung(0.4, "length = 0.3"))
    signals = curve_function(mbdae.studies.factories.factory_of(str(path)), "arm",
    mbdae.load(path),
                     {"span": (0.0, 0.5), "points": 3})({"force.spring.stiffness": 10.0}).signals  # fmt: skip
    with pytest.raises(InputError, match=LOST):
        signals.derivative("holding")
