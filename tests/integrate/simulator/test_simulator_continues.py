"""Simulators that continue: after a terminal event, and from a saved state."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import add_body, empty

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


def test_an_event_on_the_dense_output_is_continued():
    """A light ball falls and rolls: next to the free flight its rows seem nearly dependent."""
    model = empty()
    add_body(model, 0, pin.JointModelFreeFlyer(), "ball", 1.0, (0, 0, 0), (1e-5, 1e-5, 1e-5))
    mech = mbdae.Mechanism(model, [mbdae.Closure.rolling("world", "ball", 0.1, name="floor", unilateral=True)])
    start = np.array([0, 0, 0.15, 0, 0, 0, 1.0]), np.array([1.0, 0, 0, 0, 0, 0])
    event = mbdae.Event("position.ball.x = 0.15", terminal=True)
    simulator = mbdae.Simulator(mech, 0.0, *start, events=event)
    assert [simulator.advance(0.1), simulator.advance(0.1)] == ["running", "event"]
    simulator.advance(0.3 - simulator.t)
    assert simulator.q == pytest.approx(mbdae.solve(mech, (0, 0.3), *start).q[-1], abs=1e-8)


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


@pytest.mark.parametrize("backend", ["native", "python"])
@pytest.mark.parametrize("lengths", [[0.1] * 66, [0.05] * 40, [0.01] * 300, [0.4 - 3e-9, 0.7], [0.4 + 3e-9, 0.7]])
@pytest.mark.parametrize("is_set", [False, True])
def test_each_instant_is_sampled_once_wherever_an_advance_ends(backend, lengths, is_set):
    """A cart of 1 kg beside an integrator of 1 per sample: ends of advances are rounded sums of their lengths."""
    model = empty(0.0)
    add_body(model, 0, pin.JointModelPX(), "cart", 1.0)
    count = mbdae.Sampled(lambda t, q, v, x: (0.0 * v, x + 1), 10.0, memory={"n": 0.0}, name="count")
    motor = mbdae.JointTorque(joint="cart", torque=mbdae.Input(name="motor"))
    mech = mbdae.Mechanism(model, forces=[count, motor])
    simulator = mbdae.Simulator(mech, rtol=1e-4, backend=backend)
    for i, length in enumerate(lengths):
        if is_set:
            simulator["motor"] = 1.0 + i % 2
        simulator.advance(length)
    simulator.advance(0.05)
    assert simulator.s[-1] == np.floor(10 * simulator.t) + 1


@pytest.mark.parametrize("saved", [False, True])
def test_a_controller_is_sampled_at_the_start_with_the_inputs_that_are_set_before_the_first_advance(saved):
    model = empty(0.0)
    add_body(model, 0, pin.JointModelPX(), "cart", 1.0)
    reference = mbdae.Input(name="reference", value=2.0)
    pid = mbdae.JointPID(joint="cart", kp=2.0, ki=3.0, rate=10.0, reference=reference, integral=0.5)
    mech = mbdae.Mechanism(model, forces=[pid], stops=[mbdae.Stop(joint="cart", upper=9.0)])
    simulator = mbdae.Simulator(mech, rtol=1e-4)
    if saved:
        simulator.restore(simulator.save())
    simulator["reference"] = 1.0
    simulator.advance(0.05)
    assert simulator.s == pytest.approx([2.0 * 1.0 + 3.0 * 0.5, 0.5 + 0.1 * 1.0])
    assert simulator.tangent(inputs={"reference": 1.0}).v == pytest.approx([2.0 * 0.05])
