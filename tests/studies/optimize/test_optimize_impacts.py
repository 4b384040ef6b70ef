"""Optima of motions with impacts: derivatives against runs as a whole, trials without derivatives."""

import numpy as np
import pytest

import mbdae

NAME = "stop.rod stop.restitution"
OPTIONS = {"t_span": (0.0, 1.6), "rtol": 1e-9}


def last_angle(target):
    """Half the squared distance of the last angle from a target."""

    def cost(signals):
        x = signals["q.rod"]
        return (x[-1] - target) ** 2 / 2, {"q.rod": (x[-1] - target) * np.eye(len(x))[-1]}

    return cost


def test_a_coefficient_of_restitution_is_found_through_impacts():
    sol = mbdae.solve("pendulum_on_stop", (0.0, 1.6), rtol=1e-9)  # of 0.7
    assert len(sol.impacts) == 2
    found = mbdae.optimize("pendulum_on_stop", last_angle(sol.q[-1, 0]), {NAME: 0.8}, {NAME: (0.6, 0.9)}, **OPTIONS)
    assert found.values[NAME] == pytest.approx(0.7, abs=1e-5)
    assert (found.converged, found.failures) == (True, [])


def test_the_gradient_is_the_quotient_of_whole_runs():
    """At a bound it does not vanish."""
    cost = last_angle(2.0)
    found = mbdae.optimize("pendulum_on_stop", cost, {NAME: 0.75}, {NAME: (0.7, 0.8)}, **OPTIONS)
    assert found.at_bounds == [NAME]
    values, h = [], 1e-3
    for k in (2, 1, -1, -2):
        changed = mbdae.optimize(
            "pendulum_on_stop", cost, {NAME: found.values[NAME] + k * h}, {NAME: (0.6, 0.9)}, iterations=1, **OPTIONS
        )
        values.append(changed.start.cost)
    quotient = (8 * (values[1] - values[2]) - (values[0] - values[3])) / (12 * h)
    assert found.gradient[NAME] == pytest.approx(quotient, rel=1e-7)


def test_trials_that_come_to_rest_are_points_that_could_not_be_computed():
    """The least restitution is wanted, with which the rod comes to rest: there is no derivative there."""
    options = {"t_span": (0.0, 2.5), "rtol": 1e-5, "iterations": 4}
    found = mbdae.optimize(
        "pendulum_on_stop", lambda x: (x[NAME], {NAME: 1.0}), {NAME: 0.65}, {NAME: (0.1, 0.9)}, **options
    )
    assert 0.5 < found.values[NAME] <= 0.65
    assert any("no derivative" in line for line in found.failures)
