"""Impacts of a saved run: a dropped ball, by closed forms, read from the file."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, add_body, empty

import mbdae
from mbdae import Mechanism, Solution, Stop

MASS, HEIGHT, E = 2.0, 0.5, 0.6


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    model = empty()
    add_body(model, 0, pin.JointModelPZ(), "z", MASS)
    floor = Stop(joint="z", lower=0.0, restitution=E)
    sol = mbdae.solve(Mechanism(model, stops=[floor]), (0, 1.2), np.array([HEIGHT]), np.zeros(1), rtol=1e-10)
    path = tmp_path_factory.mktemp("impacts") / "run.npz"
    sol.save(path)
    return sol, Solution.load(path)


def test_impacts_are_in_the_file(saved):
    """t_1 = sqrt(2 h/g), then 2 e^k t_1 between two; p = m (1 + e) e^k g t_1, loss m (1 - e^2) (e^k g t_1)^2/2."""
    sol, again = saved
    t = np.sqrt(2 * HEIGHT / G)
    times = t * (2 * np.cumsum(E ** np.arange(5)) - 1)
    speeds = G * t * E ** np.arange(5)
    assert times[-1] < 1.2 < times[-1] + 2 * E**5 * t
    np.testing.assert_allclose([x.t for x in again.impacts], times, rtol=1e-9)
    np.testing.assert_allclose([x.impulse[0] for x in again.impacts], MASS * (1 + E) * speeds, rtol=1e-9)
    np.testing.assert_allclose([x.loss for x in again.impacts], MASS * (1 - E**2) * speeds**2 / 2, rtol=1e-9)
    assert again.impacts == sol.impacts


def test_what_follows_from_impacts_is_the_same_of_a_saved_run(saved):
    """Both sides of a jump of v, the balance of energy, and the table of signals."""
    sol, again = saved
    first = again.impacts[0].t
    before, behind = (again(first + dt).v[0] for dt in (-1e-9, 1e-9))
    assert behind == pytest.approx(-E * before, rel=1e-6)
    drifts = mbdae.drift(sol).to_dict(), mbdae.drift(again).to_dict()
    assert drifts[0] == drifts[1]
    signals = sol.signals(), again.signals()
    assert signals[0].keys() == signals[1].keys()
    for name, x in signals[0].items():
        np.testing.assert_array_equal(signals[1][name], x, err_msg=name)
