"""Vibrations of flexible bodies in runs: the one that limits the steps, and those that a method does not resolve."""

import numpy as np
import pinocchio as pin
import pytest
from flexible_bodies import FOUR_BAR
from flexible_slider_crank import slider_crank

import mbdae
from mbdae.integrate.run.elastic_resolution import _error, find_vibrations, step_error
from mbdae.mechanism.equilibrium.elastic_modes import elastic_modes
from mbdae.methods import method

ENDED = "the end of the time span was reached"
UNRESOLVED = "not resolved: mode 4 of rod (22600 rad/s), whose vibration"


def run(ratios=(0.0,) * 4, **options):
    mech, _, q, v = slider_crank(ratios)
    return mbdae.solve(mech, (0, 0.1), q, v, **options)


def test_frequencies_with_the_closures_over_a_cycle():
    """Published for the crank driven and the slider attached: 6548 to 6618 and 22013 to 22606; free 6841 and 24613."""
    mech, _, q, v = slider_crank()
    sol = mbdae.solve(mech, (0, 0.02), q, v, method="radau9", step=2e-4)
    found = np.array([elastic_modes(mech.system(), 0.0, x).frequencies for x in sol.q])
    np.testing.assert_allclose(found.min(axis=0)[2:], [6548, 22013], atol=1)
    np.testing.assert_allclose(found.max(axis=0)[2:], [6618, 22606], atol=1)
    assert elastic_modes(mech.system(), 0.0, q).labels == tuple(f"mode {i} of rod" for i in (1, 2, 3, 4))


def test_a_vibration_that_limits_the_steps_is_named():
    sol = run(method="pherk6", rtol=1e-7)
    assert (
        sol.message
        == "the end of the time span was reached; steps limited by mode 4 of rod (22600 rad/s); damp or drop it"
    )
    assert run(method="pherk6", step=2e-5).message == "the end of the time span was reached"


@pytest.mark.parametrize(
    "options",
    [
        {"method": "pherk6", "rtol": 1e-5},
        {"method": "radau9", "step": 5e-4},  # the upper mode is damped away
        {"method": "radau9", "rtol": 1e-4},
    ],
)
def test_a_vibration_that_is_not_resolved_is_named(options):
    sol = run(**options)
    assert sol.status == "doubtful"
    assert sol.message.startswith(f"{UNRESOLVED} {options['method']} damps or delays: take a smaller ")


def test_a_run_that_diverges_names_the_vibrations_that_its_steps_amplify():
    """Steps of h w = 5.1, 6.6 and 22.6 of modes 2 to 4."""
    sol = run(method="pherk6", step=1e-3)
    assert sol.status == "singular"
    words = "the run diverges: steps of 0.001 s amplify mode 2 of rod (5110 rad/s), mode 3 of rod (6620 rad/s), mode 4"
    assert sol.message.startswith(words)
    assert "drop it (the mass matrix is singular at joint 'rod', t = 0.00209155" in sol.message


def test_the_error_of_a_vibration_is_estimated():
    """At rtol 1e-6, against sixteen thousand steps: the rate of the upper mode is off by 3.5 % of its largest value."""
    mech, _, q, v = slider_crank()
    t = np.linspace(0, 0.1, 401)
    fine, sol = (
        mbdae.solve(mech, (0, 0.1), q, v, method="pherk6", t_eval=t, **x) for x in ({"step": 1e-5}, {"rtol": 1e-6})
    )
    modes = elastic_modes(mech.system(), 0.0, q)
    rates = [x.v[:, modes.iv] @ modes.rows[-1] for x in (sol, fine)]
    error = np.abs(rates[0] - rates[1]).max()
    estimated = _error(find_vibrations(sol), 3, sol.nodes[0], np.diff(sol.nodes[0]), method("pherk6"))
    assert 0.7 < estimated / error < 1.5


def test_resolved_and_damped_vibrations_are_not():
    assert run(method="radau9", step=1e-4).status == "finished"
    assert run((1e-3, 1e-3, 1.0, 1.0), method="radau9", step=5e-4).status == "finished"  # error of q 1e-9


@pytest.mark.parametrize("name", ["radau5", "radau9", "pherk6"])
def test_errors_of_a_step_are_those_of_an_oscillator(name):
    """Of y'' = -y with a step from (1, 0), against cos and sin; a half-explicit method takes the same step."""
    tableau, h = method(name), 0.5
    A, b = tableau.arrays.A, tableau.arrays.b
    n, f = len(b), np.array([[0.0, 1.0], [-1.0, 0.0]])
    stages = np.linalg.solve(np.eye(2 * n) - h * np.kron(A, f), np.tile([1.0, 0.0], n)).reshape(n, 2)
    y = np.array([1.0, 0.0]) + h * b @ (stages @ f.T)
    assert step_error(tableau, 1j * h) == pytest.approx(np.hypot(y[0] - np.cos(h), y[1] + np.sin(h)), rel=1e-6)


def test_a_run_beyond_the_range_of_linear_modes_says_so(tmp_path):
    (tmp_path / "soft.toml").write_text(FOUR_BAR.read_text().replace("2.1e11", "1e8"))
    sol = mbdae.solve(tmp_path / "soft.toml", (0, 0.3), method="radau9", step=1e-3)
    assert sol.status == "doubtful"
    assert "coupler bends beyond the range of linear modes, by " in sol.message


def test_info_lists_frequencies():
    card = mbdae.info(FOUR_BAR)
    assert "coupler: 145.545, 582.32, 1311.56, 2337.87 rad/s, its frame at rest" in str(card)
    assert [w for w, _ in card.vibrations] == pytest.approx([162.691, 588.615, 1330.69, 2344.46], rel=1e-5)
    assert "with the closures" in str(card)


@pytest.mark.parametrize("options", [{"method": "radau9"}, {"method": "alpha", "step": 1e-3}])
def test_a_body_at_rest_in_its_equilibrium_has_nofind_vibrations(options):
    """Steps are as long as tolerances of the deflection allow: only rounding oscillates."""
    model = pin.Model()
    beam = mbdae.beam(1.0, 2.1e11, 7850.0, 1e-4, 8.3e-10, modes=3, loads=["gravity y"])
    mbdae.attach_flexible(model, "beam", beam, None)
    model.gravity.linear = np.array([0.0, -9.81, 0.0])
    mech = mbdae.Mechanism(model)
    rest = mbdae.equilibrium(mech).q
    sol = mbdae.solve(mech, (0, 0.1), rest, np.zeros(mech.nv), **options)
    assert (sol.status, sol.message) == ("finished", ENDED)
    np.testing.assert_allclose(sol.q[-1], rest, atol=1e-12)


@pytest.mark.parametrize("options", [{"rtol": 1e-9}, {"rtol": 1e-5}, {"step": 1e-3}])
def test_a_beam_that_moves_along_unloaded_has_no_vibrations(options):
    """It bends out of the plane in which it moves: only rounding deflects it, which explicit methods amplify."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    ship = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ship")
    model.appendBodyToJoint(ship, pin.Inertia(5.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    crank = model.addJoint(ship, pin.JointModelRY(), pin.SE3.Identity(), "crank")
    model.appendBodyToJoint(crank, pin.Inertia(0.5, np.array([0.05, 0, 0]), 1e-3 * np.eye(3)), pin.SE3.Identity())
    mbdae.attach_flexible(model, "beam", mbdae.beam(0.5, 2e9, 2000.0, 2e-4, 2e-9, modes=2), None, crank)
    q = pin.neutral(model)
    q[3:7] = np.array([0.5, -0.7, -0.1, 0.5])
    sol = mbdae.solve(mbdae.Mechanism(model), (0, 0.4), q, np.array([0.1, 2.7, -2.1, 0, 0, 0, 2, 0, 0]), **options)
    assert sol.status == "finished"
