"""Runs of an ensemble whose values make no mechanism, or one that does not suit the others, fail alone."""

import numpy as np
import pytest

import mbdae
from mbdae import backend

pytestmark = pytest.mark.skipif(backend.load() is None, reason="the Python back end makes all runs by mbdae.solve")


def test_values_without_a_mechanism_or_an_assembly_are_failures():
    values = {"frame.rod_tip.xyz.0": [0.35, 0.01], "start.v.crank": [6.0, 6.0]}
    found = mbdae.ensemble("slider_crank", None, None, values, (0.0, 0.1))
    assert found.status == ["finished", "assembly"]
    assert np.isnan(found.t[1])
    found = mbdae.ensemble("n_four_bar", parameters={"N": [1, 2]}, t_span=(0.0, 0.1))
    assert found.status == ["finished", "input"]
    assert "has 10 coordinates, velocities and states, the first run 6" in found.message[1]


INVALID = {"N": [-1, 2]}, {"gravity.2": [np.nan, -9.81]}, {"start.v.crank_0": [np.nan, -1.0]}


@pytest.mark.parametrize("values", INVALID)
def test_a_first_value_that_is_invalid_fails_alone(values):
    assert mbdae.ensemble("n_four_bar", parameters=values, t_span=(0.0, 0.01)).status == ["input", "finished"]


def test_masked_values_fail_alone():
    masked = np.ma.array([-9.81, -9.81], mask=[True, False])
    found = mbdae.ensemble("n_four_bar", parameters={"gravity.2": masked}, t_span=(0.0, 0.01))
    assert found.status == ["input", "finished"]


def test_a_run_without_the_signals_fails_alone():
    def model(sprung):
        springs = [mbdae.JointSpring(name="spring", joint="rod", stiffness=1.0)] if sprung else []
        return mbdae.load("pendulum_on_stop", forces=springs)

    found = mbdae.ensemble(model, parameters={"sprung": [1, 0]}, t_span=(0.0, 0.01), signals="torque.spring")
    assert found.status == ["finished", "input"]
    assert "unknown signal 'torque.spring'" in found.message[1]


def test_a_model_that_fails_for_a_value_is_the_failure_of_its_run():
    def model(damping):
        return mbdae.load("four_bar", forces=[mbdae.JointDamping(joint="crank", damping=1 / (1 / damping))])

    found = mbdae.ensemble(model, parameters={"damping": [0.1, 0.0, -0.1]}, t_span=(0.0, 0.1))
    assert found.status == ["finished", "error", "input"]
    assert "failed at damping = 0.0: ZeroDivisionError" in found.message[1]
    assert "error: an unexpected error, for instance run 1" in str(found)
