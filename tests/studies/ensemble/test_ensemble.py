"""Ensembles: the bits of single runs, closed forms, runs that need Python, failures by run, and invalid input."""

import re
import threading

import numpy as np
import pytest
from scipy.special import ellipk

import mbdae
from mbdae import backend
from mbdae.errors import InputError
from mbdae.solution.columns import residuals
from mbdae.studies.ensemble.batch import NEEDS_PYTHON

pytestmark = pytest.mark.skipif(backend.load() is None, reason="the Python back end makes all runs by mbdae.solve")
SIGNALS = ("kinetic", "g", "lam.wrist pin.1", "force.wrist pin", "position.rod_tip.x")
PENDULUM = """
duration = 1.0
[[body]]
name = "bob"
parent = "world"
joint = "revolute"
axis = [0, 1, 0]
mass = 2.0
com = [0.0, 0.0, -1.0]
[start]
q = { bob = 0.5 }
"""


@pytest.fixture
def pendulum(tmp_path):
    path = tmp_path / "pendulum.toml"
    path.write_text(PENDULUM)
    return str(path)


def assert_same_bits(found, i, sol):
    assert (found.status[i], found.message[i]) == (sol.status, sol.message)
    assert found.t[i] == sol.t[-1]
    np.testing.assert_array_equal(found.q[i], sol.q[-1])
    np.testing.assert_array_equal(found.v[i], sol.v[-1])
    assert (found.steps[i], found.rejected[i]) == (sol.stats["steps"], sol.stats["rejected"])
    assert found.drift[i] == sol.stats["drift"]
    for name, values in found.signals.items():
        assert values[i] == sol.signals([name])[name][-1]


# -- the bits of single runs -----------------------------------------------------------------------------------------

CASES = {
    "default": ("four_bar", {}),
    "fixed steps": ("four_bar", {"method": "herk5", "step": 5e-3}),
    "fixed steps, redundant rows": ("slider_crank", {"step": 5e-3}),
    "projected": ("slider_crank", {"method": "pherk5", "rtol": 1e-6}),
    "not projected": ("slider_crank", {"method": "pherk4", "rtol": 1e-6, "project": False}),
    "implicit": ("slider_crank", {"method": "radau5", "rtol": 1e-5}),
    "given first step, jumps": ("pendulum", {"first_step": 1e-3, "jumps": [0.11]}),
    "redundant rows": ("stewart_platform", {"rtol": 1e-5}),
    "backward": ("slider_crank", {"rtol": 1e-6}),
}


@pytest.mark.parametrize("case", CASES)
def test_runs_have_the_bits_of_single_ones(case):
    name, settings = CASES[case]
    mech, span = mbdae.load(name), (0.3, 0.0) if case == "backward" else (0.0, 0.3)
    v = np.linspace(0.5, 1.5, 5)[:, None] * mech.assemble(q=mech.start[0], v=np.linspace(1.0, 2.0, mech.nv))[1]
    found = mbdae.ensemble(mech, None, v, None, span, **settings)
    assert not found.in_python
    for i in range(5):
        sol = mbdae.solve(mech, span, *mech.start[:1], v[i], **settings)
        assert_same_bits(found, i, sol)
        gaps = np.abs(residuals(sol).g[1:] / mech.row_scales).max(initial=0.0)
        assert found.drift[i] == pytest.approx(gaps, rel=1e-4, abs=1e-14)


@pytest.mark.parametrize("t0", [0.0, 0.31])
def test_controllers_sample_at_the_start_as_in_single_runs(pendulum, t0):
    mech = mbdae.load(pendulum, forces=[mbdae.JointPID(joint="bob", reference=1.0, kp=9.0, ki=2.0, kd=1.0, rate=10.0)])
    found = mbdae.ensemble(mech, np.array([[0.2], [0.5]]), None, None, (t0, t0 + 0.25))
    assert not found.in_python
    for i, q in enumerate([0.2, 0.5]):
        assert_same_bits(found, i, mbdae.solve(mech, (t0, t0 + 0.25), [q]))


@pytest.mark.parametrize("name", mbdae.model_names())
def test_runs_of_all_models_have_the_bits_of_single_ones(name):
    mech = mbdae.load(name)
    span = 0.0, 0.02 * min(1.0, mech.duration)
    found = mbdae.ensemble(mech, mech.start[0][None], mech.start[1], None, span)
    assert_same_bits(found, 0, mbdae.solve(mech, span, *mech.start))


@pytest.mark.parametrize("workers", [1, 3])
def test_parameters_and_signals_have_the_bits_of_single_runs(workers):
    lengths, speeds = np.array([0.35, 0.36, 0.35, 0.34]), np.array([6.0, 5.0, 7.0, 6.0])
    values = {"frame.rod_tip.xyz.0": lengths, "start.v.crank": speeds}
    found = mbdae.ensemble("slider_crank", None, None, values, (0.0, 0.4), signals=SIGNALS, workers=workers, rtol=1e-7)
    assert not found.in_python
    for i in range(4):
        text = f"slider_crank:frame.rod_tip.xyz.0={lengths[i]}"
        other = mbdae.sweep(
            "slider_crank", [{name: x[i] for name, x in values.items()}], 0.4, rtol=1e-7,
            outputs=[f"final {name}" for name in SIGNALS], executor="threads", workers=1,
        )  # fmt: skip
        assert found.steps[i] == other["steps"][0], text
        assert [found.signals[name][i] for name in SIGNALS] == [other[f"final {name}"][0] for name in SIGNALS]


# -- closed forms ----------------------------------------------------------------------------------------------------


def test_pendulums_return_after_their_periods(pendulum):
    # the period of a pendulum from rest at an angle, by the complete elliptic integral of the first kind
    angles = np.array([0.2, 1.0, 2.0, 3.0])
    lengths = 9.81 * (3.0 / (4 * ellipk(np.sin(angles / 2) ** 2))) ** 2
    values = {"body.bob.com.2": -lengths, "start.q.bob": angles}
    found = mbdae.ensemble(pendulum, None, None, values, (0.0, 3.0), rtol=1e-10)
    assert found.success.all()
    np.testing.assert_allclose(found.q[:, 0], angles, rtol=1e-7)
    assert np.abs(found.v).max() < 1e-5


def test_free_fall_on_a_string_keeps_its_energy_and_length():
    mech = mbdae.load("pendulum")
    angles = np.linspace(0.1, 3.0, 7)
    q = np.column_stack([np.sin(angles), np.zeros(7), -np.cos(angles)])
    found = mbdae.ensemble(mech, q, np.zeros(3), None, (0.0, 2.0), signals=["g"])
    np.testing.assert_allclose(np.linalg.norm(found.q, axis=1), 1.0, atol=1e-12)
    heights = found.q[:, 2] - q[:, 2]
    np.testing.assert_allclose(0.5 * (found.v**2).sum(axis=1), -9.81 * heights, atol=1e-6)
    assert (found.drift < 1e-12).all()
    np.testing.assert_allclose(found.signals["g"], np.abs(np.linalg.norm(found.q, axis=1) - 1), atol=1e-14)


# -- runs that need Python -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("workers", [1, 3])
def test_modes_switch_in_python(workers):
    mech = mbdae.load("pendulum_on_stop")
    v = mech.start[1] * np.linspace(1.0, 1.1, 6)[:, None]
    done = []
    found = mbdae.ensemble(mech, None, v, None, (0.0, 1.0), workers=workers, progress=lambda *x: done.append(x))
    assert list(found.in_python.values()) == [6]
    assert "modes of" in next(iter(found.in_python))
    assert [fraction for fraction, _ in done][-6:] == pytest.approx(np.arange(1, 7) / 6)
    for i in range(6):
        assert_same_bits(found, i, mbdae.solve(mech, (0.0, 1.0), mech.start[0], v[i]))


def test_functions_are_called_in_python(pendulum):
    threads = set()

    def law(t, q, v):
        threads.add(threading.get_ident())
        return -0.1 * v

    mech = mbdae.load(pendulum)
    damped = mbdae.Mechanism(mech.model, forces=[law])
    q = np.array([[0.3], [0.6]])
    found = mbdae.ensemble(damped, q, np.zeros(1), None, (0.0, 0.5), workers=2)
    assert len(threads - {threading.get_ident()}) == 1
    assert found.in_python == {"functions of Python": 2}
    for i in range(2):
        assert_same_bits(found, i, mbdae.solve(damped, (0.0, 0.5), q[i], np.zeros(1)))


def test_runs_through_singular_configurations_are_left_to_python():
    mech = mbdae.load("n_four_bar")  # of bars of equal length, which become collinear
    v = np.array([mech.start[1], 0 * mech.start[1]])
    found = mbdae.ensemble(mech, None, v, None, (0.0, 1.0))
    sols = [mbdae.solve(mech, (0.0, 1.0), mech.start[0], x) for x in v]
    crossed = sum(bool(sol.singular) for sol in sols)
    assert crossed
    assert found.in_python == {NEEDS_PYTHON: crossed}
    for i, sol in enumerate(sols):
        assert_same_bits(found, i, sol)


@pytest.mark.parametrize(("method", "step", "text"), [("herk3", 0.1, "energy balance"), ("herk2", 0.08, "closures")])
def test_inaccurate_runs_are_reported_by_python(method, step, text):
    mech, settings = mbdae.load("slider_crank"), {"method": method, "step": step}
    found = mbdae.ensemble(mech, None, mech.start[1][None], None, (0.0, 5.0), **settings)
    assert found.in_python == {NEEDS_PYTHON: 1}
    assert found.status == ["doubtful"]
    assert text in found.message[0]
    assert_same_bits(found, 0, mbdae.solve(mech, (0.0, 5.0), **settings))


def test_long_runs_are_left_to_python(pendulum):
    settings = {"method": "herk3", "rtol": 1e-12}
    found = mbdae.ensemble(pendulum, np.array([[0.1], [0.2]]), np.zeros(1), None, (0.0, 0.5), **settings)
    assert found.in_python == {NEEDS_PYTHON: 2}
    assert (found.steps > 2000).all()


def test_a_signal_of_the_whole_run_is_computed_in_python():
    mech = mbdae.load("cam_follower")
    found = mbdae.ensemble(mech, None, mech.start[1][None], None, (0.0, 0.1), signals=["q.cam"])
    assert found.in_python == {"signal 'q.cam'": 1}
    assert_same_bits(found, 0, mbdae.solve(mech, (0.0, 0.1)))


# -- failures, interrupts, invalid input -----------------------------------------------------------------------------


def test_failed_runs_are_reported_each():
    mech = mbdae.load("four_bar")
    q = np.tile(mech.start[0], (4, 1))
    q[1, 0] += 0.1
    q[2, 0] = np.nan
    found = mbdae.ensemble(mech, q, 0 * mech.start[1], None, (0.0, 0.2))
    assert found.status == ["finished", "input", "input", "finished"]
    assert "is not consistent" in found.message[1]
    assert "is not finite" in found.message[2]
    assert np.isnan(found.q[1:3]).all()
    assert found.success.tolist() == [True, False, False, True]
    assert "input: an invalid value, for instance run 1" in str(found)


def test_too_few_steps_are_a_status():
    mech = mbdae.load("slider_crank")
    found = mbdae.ensemble(mech, None, mech.start[1][None], None, (0.0, 10.0), max_steps=20)
    assert found.status == ["max_steps"]
    assert 0 < found.t[0] < 10.0


def test_an_interrupt_returns_the_finished_runs():
    mech = mbdae.load("slider_crank")

    def progress(done, text):
        raise KeyboardInterrupt

    v = mech.start[1] * np.linspace(0.9, 1.1, 64)[:, None]
    found = mbdae.ensemble(mech, None, v, None, (0.0, 1.0), workers=1, progress=progress)
    finished = np.array(found.status) == "finished"
    assert 0 < finished.sum() < 64
    assert set(found.status) == {"finished", "interrupted"}
    assert np.isfinite(found.q[finished]).all()
    assert np.isnan(found.q[~finished]).all()


MECH = "slider_crank"
WRONG = {
    "no arrays": ({}, "have a row for each run, got rows: none"),
    "lengths": ({"v": np.zeros((2, 3)), "q": np.zeros((3, 3))}, "got rows: q 3, v 2"),
    "shape": ({"v": np.zeros((2, 5))}, r"v has shape \(2, 5\), expected \(n, 3\) or \(3,\)"),
    "text": ({"q": "start"}, r"q is an array of numbers, \(n, 3\) or \(3,\), got 'start'"),
    "complex": ({"v": np.zeros((2, 3), complex)}, r"v is an array of numbers, \(n, 3\)"),
    "parameter": ({"parameters": {"frame.rod_tp.xyz.0": [1.0]}}, "unknown entry of frame"),
    "value": ({"parameters": {"start.v.crank": ["fast"]}}, "takes one number for each run"),
    "large": ({"parameters": {"gravity.2": [10**400]}}, "takes one number for each run"),
    "name": ({"parameters": {3: [1.0]}}, "parameters are named by texts, got 3"),
    "table": ({"parameters": [1.0]}, "parameters are a table of arrays"),
    "setting": ({"v": np.zeros((1, 3)), "rtoll": 1e-3}, "unknown setting of solve 'rtoll'"),
    "events": ({"v": np.zeros((1, 3)), "events": "q.crank = 0"}, "unknown setting of solve 'events'"),
    "tolerance": ({"v": np.zeros((1, 3)), "rtol": -1.0}, "rtol"),
    "method": ({"v": np.zeros((1, 3)), "method": "herk9"}, "herk9"),
    "signal": ({"v": np.zeros((1, 3)), "signals": ["q.crnk"]}, "unknown signal 'q.crnk'"),
    "workers": ({"v": np.zeros((1, 3)), "workers": 0}, "workers is a number"),
}


@pytest.mark.parametrize("what", WRONG)
def test_invalid_input_is_rejected(what):
    arguments, text = WRONG[what]
    with pytest.raises(InputError, match=text):
        mbdae.ensemble(MECH, t_span=(0.0, 0.1), **arguments)


def test_a_loaded_mechanism_has_the_parameters_of_its_files():
    parameters = {"start.v.crank": [5.0, 6.0], "frame.rod_tip.xyz.0": [0.35, 0.36]}
    ends = (mbdae.ensemble(x, None, None, parameters, (0.0, 0.1)).q for x in (MECH, mbdae.load(MECH)))
    np.testing.assert_array_equal(*ends)


# -- presentation ----------------------------------------------------------------------------------------------------


def test_the_result_is_a_table(tmp_path):
    found = mbdae.ensemble(MECH, None, None, {"start.v.crank": [5.0, 6.0]}, (0.0, 0.1), signals="q")
    assert len(found) == 2
    assert re.search(r"q.slider \(m\) +\d", str(found))
    assert found.to_dict()["status"] == ["finished"] * 2
    found.save(tmp_path / "ends.csv")
    assert (tmp_path / "ends.csv").read_text().startswith("start.v.crank,t,")
