"""Simulators that continue: after a terminal event, and from a saved state."""

import numpy as np
import pytest

import mbdae


@pytest.mark.parametrize("backend", ["native", "python"])
def test_after_a_terminal_event_steps_lead_to_the_grid_again(backend):
    simulator = mbdae.Simulator("four_bar", step=2e-3, backend=backend, events=[mbdae.Event("q.crank", terminal=True)])
    simulator.advance(0.7)
    assert simulator.t == pytest.approx(0.665851, abs=1e-6)
    simulator.advance(0.8 - simulator.t)
    expected = mbdae.solve("four_bar", (0, 0.8), rtol=1e-12)
    assert simulator.q == pytest.approx(expected.q[-1], abs=1e-11)
    assert np.diff(simulator.solution().t).max() <= 2e-3 * (1 + 1e-9)


def test_a_state_of_another_simulator_is_rejected_and_nothing_is_lost():
    simulator, other = (mbdae.Simulator(name, step=1e-3) for name in ("four_bar", "slider_crank"))
    simulator.advance(0.01)
    for state, words in (
        (other.save(), "mechanism 'Planar slider-crank', not 'Planar four-bar linkage'"),
        (mbdae.Simulator("four_bar", rtol=1e-6).save(), "step None, not 0.001"),
        (mbdae.Simulator("four_bar", step=1e-3, method="herk3").save(), "method 'herk3', not 'pherk"),
    ):
        with pytest.raises(mbdae.errors.InputError, match=words):
            simulator.restore(state)
    simulator.advance(0.01)
    assert len(simulator.solution().t) == 21
