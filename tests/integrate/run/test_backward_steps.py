"""Backward steps to the states before a crossing."""

import numpy as np
import pytest

import mbdae


@pytest.mark.parametrize("method", ["herk3", "herk5", "pherk6"])
def test_a_crossing_costs_hundreds_of_evaluations_for_any_method(method):
    """Backward steps of a low order to tight tolerance would take thousands."""
    model, times = mbdae.load("n_four_bar", N=1), []

    def watched(t, q, v):
        times.append(t)
        return np.zeros(3)

    mech = mbdae.Mechanism(model.model, model.closures, forces=[watched])
    v = np.array([-8.0, 8.0, -8.0])

    def calls(end):
        times.clear()
        sol = mbdae.solve(mech, (0, end), np.array([1.2, -1.2, 1.2]), v, method=method, rtol=1e-7)
        assert sol.success
        return len(times), len(sol.singular)

    (before, none), (after, one) = calls(0.11), calls(0.24)
    assert (none, one) == (0, 1)
    assert after - 2 * before < 600
