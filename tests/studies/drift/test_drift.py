"""Drift: its reference values, at known states."""

import numpy as np
import pytest
from links import C, M, arm

import mbdae
from mbdae import JointDamping
from mbdae.errors import InputError


def test_energies_are_compared_with_their_range():
    """Not with the potential itself, which depends on its zero level: a mile up nothing else changes."""
    scales = []
    for height in (0.0, 1600.0):
        mech = arm(JointDamping(joint="arm", damping=0.01))
        mech.model.jointPlacements[1].translation = np.array([0.0, 0.0, height])
        sol = mbdae.solve(mech, (0, 1), rtol=1e-3)
        found = mbdae.drift(sol)
        energies = np.array([mech.energy(q, v) for q, v in zip(sol.q, sol.v, strict=True)])
        assert found.energy_scale == pytest.approx(max(energies[:, 0].max(), np.ptp(energies[:, 1])), rel=1e-9)
        assert found.energy_relative == pytest.approx(found.energy_error / found.energy_scale)
        scales.append(found.energy_scale)
    assert scales[1] == pytest.approx(scales[0], rel=1e-6)


def test_residuals_at_the_end_are_those_of_the_last_state():
    sol = mbdae.solve(mbdae.load("four_bar"), (0, 3.3), method="RK45", formulation="index1", rtol=1e-4)
    (g, Gv), start = sol.mechanism.residual(sol.q[-1], sol.v[-1]), sol.mechanism.residual(sol.q[0], sol.v[0])
    found = mbdae.drift(sol)
    assert found.g_end == pytest.approx(np.abs(g).max(), rel=1e-6)
    assert found.Gv_end == pytest.approx(np.abs(Gv).max(), rel=1e-6)
    assert min(found.g_end, found.Gv_end) > 1e3 * np.abs(start).max()


def test_energies_are_compared_with_those_of_all_steps():
    """At rest at both requested times, the slider moves between them."""
    ends, every = (mbdae.drift(mbdae.solve("stick_slip_slider", (0, 1), t_eval=at)) for at in ([0, 1], None))
    assert ends.energy_scale == every.energy_scale > 0
    assert ends.energy_relative == ends.energy_error / ends.energy_scale > 0
    assert ends.history.energy.max() == ends.energy_relative


def test_at_rest_the_relative_error_is_zero_in_the_history_too():
    """Energies of rest are rounding: in J, they are no ratio."""
    mech = arm(JointDamping(joint="arm", damping=0.01))
    sol = mbdae.solve(mech, (0, 1), mbdae.equilibrium(mech).q, np.zeros(1))
    found = mbdae.drift(sol)
    assert found.energy_scale == found.energy_relative == found.history.energy.max() == 0.0


@pytest.mark.parametrize("rtol", [1e-3, 1e-8])
def test_a_run_from_an_equilibrium_is_at_rest(rtol):
    """Long steps amplify rounding up to the tolerance: energies of such speeds are no violated balance."""
    mech = mbdae.load("four_bar")
    sol = mbdae.solve(mech, (0, 10), mbdae.equilibrium(mech).q, np.zeros(3), rtol=rtol)
    assert sol.status == "finished"
    assert np.abs(sol.v).max() > 1e-10
    assert mbdae.drift(sol).energy_scale == 0.0


def test_a_slow_descent_is_no_rest():
    """Slower than rtol of its characteristic rate, a damped link sinks by half a radian."""
    mech = arm(JointDamping(joint="arm", damping=1e5))
    sol = mbdae.solve(mech, (0, 1e4), np.array([0.3]), np.array([5.6e-5]), rtol=1e-3, method="radau5")
    assert np.abs(sol.v).max() < 1e-3 * mech.characteristic_rate
    fallen = M * 9.81 * C * (np.sin(sol.q[-1, 0]) - np.sin(0.3))
    assert mbdae.drift(sol).energy_scale == pytest.approx(fallen, rel=1e-3)


@pytest.mark.parametrize("model", ["circle", "four_bar"])
def test_a_run_that_ended_before_its_first_time(model):
    sol = mbdae.solve(model, (0, 1), max_steps=1, t_eval=[0.9])
    assert f"t = {sol.nodes[0][-1]:.9g} s" in str(sol)
    with pytest.raises(InputError, match="has no times: the run ended before the first of t_eval"):
        mbdae.drift(sol)
