"""Steps of RATTLE and generalized alpha in the compiled core against Python: states, multipliers and iterations."""

import driven
import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae import JointDamping, JointPID, SpringDamper
from mbdae.errors import InputError
from mbdae.methods import METHODS

pytestmark = pytest.mark.native

SPRING = SpringDamper(frames=("world", "coupler_tip"), stiffness=20.0, length=0.2, damping=0.5)
MECHANISMS = {
    "four_bar": lambda: shared_model("four_bar"),
    "heavy_top": lambda: shared_model("heavy_top"),
    "bricard": lambda: shared_model("bricard"),
    "stewart_platform": lambda: shared_model("stewart_platform"),
    "damped four-bar": lambda: mbdae.load("four_bar", forces=[JointDamping(joint="crank", damping=0.4)]),
    "four-bar at a spring": lambda: mbdae.load("four_bar", forces=[SPRING]),
    "crane": driven.crane,
    "platform": driven.platform,
}


def both(mech, method, step, T):
    return [mbdae.solve(mech, (0, T), method=method, step=step, backend=b) for b in ("native", "python")]


def assert_equal_runs(native, python, size):
    assert native.stats["backend"] == "native"
    assert python.status == native.status
    scale = np.abs(python.y).max(axis=0) + 1
    assert np.abs((native.y - python.y) / scale).max() < size
    assert np.abs(native.z_own - python.z_own).max(initial=0) < 10 * size * (1 + np.abs(python.z_own).max(initial=0))


@pytest.mark.parametrize("method", ["rattle2", "rattle4"])
@pytest.mark.parametrize("name", MECHANISMS)
def test_rattle(name, method):
    native, python = both(MECHANISMS[name](), method, 0.01, 0.06)
    assert_equal_runs(native, python, 1e-12)
    assert abs(native.stats["newton"] - python.stats["newton"]) <= 2 + 0.02 * python.stats["newton"]


@pytest.mark.parametrize("method", ["alpha", "alpha0.3_i3", "hht"])
@pytest.mark.parametrize("name", MECHANISMS)
def test_generalized_alpha(name, method):
    native, python = both(MECHANISMS[name](), method, 0.01, 0.12)
    assert_equal_runs(native, python, 1e-11)


def test_states_and_friction_of_closures():
    """Generalized alpha with states of a controller, and with friction proportional to multipliers."""
    servo = mbdae.load("four_bar", forces=[JointPID(joint="crank", kp=3.0, ki=5.0, name="servo")])
    assert_equal_runs(*both(servo, "alpha", 0.01, 0.2), 1e-11)


def test_sizes_of_steps_change_the_carry():
    """Jumps between smooth intervals restart it, a shorter last step rescales it, as in Python."""
    mech = shared_model("four_bar")
    runs = [
        mbdae.solve(mech, (0, 0.305), method="alpha0.2", step=0.02, jumps=[0.111], backend=b)
        for b in ("native", "python")
    ]
    assert_equal_runs(*runs, 1e-12)


def test_events_are_located_in_the_core():
    for method in ("rattle4", "alpha"):
        runs = [
            mbdae.solve("four_bar", (0, 0.5), method=method, step=0.02, events="q.crank = 0.9", backend=b)
            for b in ("native", "python")
        ]
        times = [run.events[0][0] for run in runs]
        assert len(times[0]) == 1
        assert np.abs(times[0] - times[1]).max() < 1e-10


def test_a_step_that_does_not_converge_is_named():
    for method in ("rattle2", "alpha"):
        sol = mbdae.solve("four_bar", (0, 40), method=method, step=4.0)
        assert not sol.success
        assert "shorter steps" in sol.message or "singular" in sol.message or "rad in one step" in sol.message


def test_malformed_numbers_are_rejected():
    native = mbdae.backend.load()
    iteration = METHODS["alpha"].iteration(native)
    with pytest.raises(ValueError, match="one more node than weights"):
        native.Composition(weights=np.ones(3), nodes=np.ones(3), iteration=iteration)
    with pytest.raises(ValueError, match="beta and gamma positive"):
        native.GeneralizedAlpha(alpha_m=0.1, alpha_f=0.2, beta=0.0, gamma=0.5, stabilized=True, iteration=iteration)
    with pytest.raises(InputError, match="takes fixed steps"):
        mbdae.solve("four_bar", (0, 1), method="rattle4", rtol=1e-6)
