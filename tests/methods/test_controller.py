"""Step-size control by its formulas, and its use by a stepper: the computed values, not their effect."""

import numpy as np
import pytest
from shared import shared_model

import mbdae
from mbdae.methods.controller import Controller, error_norm


def test_one_vector_gives_its_weighted_root_mean_square():
    assert error_norm(np.array([[3.0, 4.0, 0.0, 0.0]]), np.full(4, 0.5)) == pytest.approx(5.0)
    assert error_norm(np.array([[3.0, 0.0]]), np.array([3.0, 1e9])) == pytest.approx(np.sqrt(0.5))


def test_two_vectors_give_the_square_of_one_over_both():
    errors = np.array([[2.0, 2.0], [300.0, 300.0]])
    assert error_norm(errors, np.ones(2)) == pytest.approx(4 / (2 + 3))
    assert error_norm(np.array([[0.0, 0.0], [1.0, 1.0]]), np.ones(2)) == 0.0
    assert error_norm(np.zeros((2, 2)), np.ones(2)) == 0.0


@pytest.mark.parametrize("power", [3, 5, 7])
def test_steps_follow_the_error_and_the_error_before(power):
    controller = Controller(power, last=1e-2)
    first, second = controller.next_step(0.1, 0.5), controller.next_step(0.1, 0.25)
    assert first == pytest.approx(0.09 * 0.5 ** (0.03 - 1 / power) * 1e-2**0.04)
    assert second == pytest.approx(0.09 * 0.25 ** (0.03 - 1 / power) * 0.5**0.04)


def test_estimates_of_low_order_do_without_the_error_before():
    assert Controller(2, last=1e-2).next_step(0.1, 0.25) == pytest.approx(0.09 * 2)


def test_an_error_that_is_almost_nothing_counts_as_a_small_one_for_the_next_step():
    """As in the codes of Hairer and Wanner: facold = max(err, 1e-4), and 1e-4 at the start."""
    controller = Controller(4)
    assert controller.last == 1e-4
    controller.next_step(0.1, 1e-7)
    assert controller.last == 1e-4
    controller.next_step(0.1, 2e-4)
    assert controller.last == 2e-4


def test_an_error_of_one_is_accepted_and_what_is_no_number_is_not():
    controller = Controller(4)
    assert controller.next_step(1.0, 1.0) == pytest.approx(0.9 * 1e-4**0.04)
    assert not controller.rejected
    controller.next_step(1.0, np.nan)
    assert controller.rejected


def test_a_rejected_step_shrinks_and_the_next_one_does_not_grow():
    controller = Controller(4, last=1e-2)
    assert controller.next_step(1.0, 16.0) == pytest.approx(0.9 / 2)
    assert controller.last == 1e-2
    assert controller.next_step(0.5, 1e-3) == 0.5
    assert controller.next_step(0.5, 1e-3) > 1.0


def test_steps_change_within_limits():
    assert Controller(4).next_step(1.0, 1e9) == pytest.approx(0.2)
    assert [Controller(4).next_step(1.0, x) for x in (np.inf, np.nan)] == pytest.approx([0.2, 0.2])
    assert Controller(4).next_step(1.0, 0.0) == pytest.approx(10.0)


@pytest.mark.usefixtures("back_end")
def test_a_step_that_a_jump_cuts_short_is_not_the_size_of_the_next():
    mech = shared_model("four_bar")
    plain = mbdae.solve(mech, (0, 1), rtol=1e-6)
    middle = len(plain.t) // 2
    cut = mbdae.solve(mech, (0, 1), rtol=1e-6, jumps=[plain.t[middle] + 1e-7])
    behind = int(np.searchsorted(cut.t, plain.t[middle] + 1e-7))
    assert np.diff(cut.t)[behind] > 0.5 * np.diff(plain.t)[middle]
