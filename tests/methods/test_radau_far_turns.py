"""Steps of Radau IIA with large rotations."""

import numpy as np
from shared import shared_model

import mbdae
from mbdae.methods import method
from mbdae.system import State


def test_steps_in_which_bodies_turn_far_are_solved():
    """A chain whirls by 0.8 rad in a step after its impacts: partials at one point are not enough for all stages."""
    mech = shared_model("bouncing_chain")
    coarse, fine = (mbdae.solve(mech, (0, 0.3), method="radau5", step=h) for h in (0.025, 0.0015))
    assert coarse.success, coarse.message
    assert np.abs(coarse.v).max() * 0.025 > 0.7
    assert [i.where for i in coarse.impacts] == [i.where for i in fine.impacts]
    np.testing.assert_allclose([i.t for i in coarse.impacts], [i.t for i in fine.impacts], atol=1e-4)
    assert mbdae.drift(coarse).energy_relative < 1e-5


def test_a_start_takes_partials_from_the_middle_of_the_predicted_step():
    """Those of the start itself give a contraction of 0.9 where these give 0.4."""
    mech = shared_model("bouncing_chain")
    y = np.concatenate([[0.09, 0.17, 0.56, -0.6, -0.045, -1.26, -4.78, -11.6, 6.4, 6.7, 0.0]])
    system = mech.system()
    method("radau5").step(system, 0.0, 0.0165, State(y))
    assert system.counts.newton < 35
