"""Residuals and energies at random states, in the core as in Python; invalid events and samplers."""

import numpy as np
import pytest
from chains import random_q
from driven import DRIVEN
from in_core import IN_CORE
from mechanism.forces.test_force_runs import IN_BOTH
from shared import shared_model

import mbdae
from mbdae import backend
from mbdae.mechanism.formulations.core_description import samplers_of
from mbdae.mechanism.formulations.index2 import Index2System
from mbdae.solution.signal_value import SignalValue

pytestmark = pytest.mark.native
REFUSED = (ValueError, TypeError, RuntimeError, OverflowError, IndexError, KeyError)


def compare(mech, turn=1.0):
    rng, native, python = np.random.default_rng(0), mech.system(native=backend.load()), mech.system()
    t = rng.uniform(0, 1, 5)
    y = [
        np.concatenate([random_q(mech.model, rng, turn), rng.uniform(-2, 2, mech.nv), np.zeros(python.ns + 1)])
        for _ in t
    ]
    y = np.array(y)
    *all_found, unknown = native.core.residuals(t, y)
    assert not unknown
    for found, expected in zip(all_found, python.residuals(t, y), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12 * (1 + np.abs(expected).max(initial=0)))
    assert type(python) is Index2System


@pytest.mark.parametrize("force", IN_BOTH.values(), ids=IN_BOTH.keys())
def test_energies_of_every_force(force):
    compare(mbdae.load("four_bar", forces=[force, mbdae.JointSpring(joint="rocker", stiffness=3.0, rest=0.4)]), 0.5)


@pytest.mark.parametrize("name", DRIVEN)
def test_driven_mechanisms(name):
    compare(DRIVEN[name]())


@pytest.mark.parametrize("name", IN_CORE)
def test_models(name):
    compare(shared_model(name))


def test_drift_is_computed_in_the_core(monkeypatch):
    sol = mbdae.solve(mbdae.load("stewart_platform"), (0, 0.2), step=0.01)
    python = mbdae.drift(mbdae.Solution(sol.problem, sol.t, sol.y, sol.z_own, "", "", {}, sol.settings))
    monkeypatch.setattr(Index2System, "residual", None)
    native = mbdae.drift(sol)
    assert native.g_max == pytest.approx(python.g_max, rel=1e-3, abs=1e-15)
    assert native.energy_error == pytest.approx(python.energy_error, abs=1e-12 * python.energy_scale)
    assert native.energy_scale == pytest.approx(python.energy_scale, rel=1e-12)


def test_wrong_signals_are_rejected():
    native, mech = backend.load(), shared_model("four_bar")
    system = mech.system(native=native)
    events = native.Run().events
    right = SignalValue("y", 1, 1).core_data()
    event = {"signal": right, "level": 0.0, "direction": 0, "unchanged_within": 0.0, "terminal": False}
    events.set_events([event])
    for wrong in (
        [event | {"signal": right | {"kind": "speed"}}],
        [{key: x for key, x in event.items() if key != "terminal"}],
        [event | {"signal": {key: x for key, x in right.items() if key != "rows"}}],
        [event | {"level": "high"}],
        [right],
        [None],
        3,
    ):
        with pytest.raises(REFUSED):
            events.set_events(wrong)
    with pytest.raises(ValueError, match="nodes must be as many as events"):
        events.set_nodes([(0.0, 0.0, 0.0)] * 7)
    method = system.method(mbdae.METHODS["herk3"])
    system.derivative(0.0, mech.point())
    for wrong in (("y", 99, 1, []), ("y", -1, 1, []), ("y", 1, 99, []), ("angle", 6, 1, []), ("angle", 1, -1, []),
                  ("lam", 0, -1, []), ("lam", 0, -1, [9]), ("force", 0, -1, [-1])):  # fmt: skip
        run = native.Run()
        run.set_state(mech.point(), None, None)
        run.events.set_events([event | {"signal": SignalValue(*wrong).core_data()}])
        with pytest.raises(ValueError, match="a signal does not fit"):
            system.core.advance(method, run)


def test_wrong_samplers_are_rejected():
    pid = mbdae.JointPID(joint="crank", kp=1.0, ki=2.0, rate=10.0)
    own = mbdae.Sampled(lambda t, q, v: -v, rate=10.0)
    system = mbdae.load("four_bar", forces=[pid, own]).system(native=backend.load())
    right = samplers_of(system.laws)
    system.core.set_sampled_controllers(right)
    for key, values in {
        "kind": ["pd", None],
        "rate": [0.0, -1.0, np.nan, "fast"],
        "offset": [np.inf],
        "coincide": [-1.0, np.nan],
        "state": [-1, 99, 2**31 - 1],
        "states": [0, -1, 99, 3],
        "x": [-1, 99],
        "v": [99],
        "a": [[1.0], "a"],
        "reference": [{}, None],
    }.items():
        for value in values:
            with pytest.raises(REFUSED):
                system.core.set_sampled_controllers([{**right[0], key: value}])
        with pytest.raises(REFUSED):
            system.core.set_sampled_controllers([{k: x for k, x in right[0].items() if k != key}])
    with pytest.raises(REFUSED):
        system.core.set_sampled_controllers([{**right[1], "call": 3}, None])
