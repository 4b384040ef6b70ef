"""Drift: its reference values, at known states."""

import json

import numpy as np
import pytest
from commands import call
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


def test_impacts_of_a_saved_run_are_reported(tmp_path):
    """Their losses are in the work of the energy balance, of a pendulum without forces the whole work."""
    sol = mbdae.solve("pendulum_on_stop", (0, 3))
    sol.save(tmp_path / "run.npz")
    code, out, err = call("drift", "run.npz", cwd=tmp_path)
    assert (code, err) == (0, "")
    line = "  impacts on rod stop: t = 0.464927724, 1.27497619, 1.97549149, 2.56071803 s (4), 5.482 J lost"
    assert out.splitlines()[-1] == line
    assert call("solve", "pendulum_on_stop", "-t", "3", cwd=tmp_path)[1].count("impacts on") == 1
    found = mbdae.drift(sol)
    assert found.impacts.loss == pytest.approx(-found.work_end, rel=1e-12)
    data = json.loads(call("drift", "run.npz", "--json", cwd=tmp_path)[1])
    assert data["impacts"] == {"names": ["rod stop"], "times": [x.t for x in sol.impacts], "loss": found.impacts.loss}
    with mbdae.display_units("ms", "mJ"):
        assert str(found).endswith("t = 464.927724, 1274.97619, 1975.49149, 2560.71803 ms (4), 5482 mJ lost")


def test_energy_that_drivers_add_in_impacts_is_no_loss():
    body = {"name": "cart", "parent": "world", "joint": "prismatic", "axis": [1, 0, 0], "mass": 2.0}
    driver = {"name": "belt", "joint": "cart", "speed": {"kind": "steps", "points": [[0.0, 0.5], [0.7, 1.0]]}}
    found = mbdae.drift(mbdae.solve({"body": [body], "driver": [driver]}, (0, 1)))
    assert str(found).endswith("  impacts on belt: t = 0.7 s (1), 0.75 J added by drivers")
    assert mbdae.drift(mbdae.solve("pendulum_on_stop", (0, 0.1))).to_dict()["impacts"] is None
