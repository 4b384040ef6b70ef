"""The larger models against formulas written here: governor, hexapod, delta robot, two arms, humanoid."""

import json

import numpy as np
import pinocchio as pin
import pytest
from click.testing import CliRunner
from numpy import cos, sin
from scipy.integrate import solve_ivp

import mbdae
from mbdae.__main__ import cli

G = 9.81


def place(mech, q, name):
    data = mech.model.createData()
    pin.framesForwardKinematics(mech.model, data, q)
    return data.oMf[next(i for i, f in enumerate(mech.model.frames) if f.name == name)].copy()


# -- flyball_governor ----------------------------------------------------------------------------------------------


def governor_equations():
    """Return y' of y = (shaft, s, alpha, s', alpha'): one rod of a symmetric pair, constant angular momentum."""
    hinge, thin, slender, stiffness, damping = 0.05, 5e-6, 0.0250025, 8e5, 4e4
    moment = 0.3 * 0.5 + 5.0  # of a rod with its ball about its hinge
    tilting = slender + 0.3 * 0.25 + 5.0

    def about_shaft(a):
        c, s = cos(a), sin(a)
        spin = thin * s**2 + slender * c**2 + 0.3 * (hinge + 0.5 * c) ** 2 + 5 * (hinge + c) ** 2
        derivative = 2 * (thin - slender) * s * c - 0.3 * (hinge + 0.5 * c) * s - 10 * (hinge + c) * s
        return thin + 0.005 + 2 * spin, 2 * derivative

    momentum = about_shaft(np.pi / 6)[0] * 2 * np.pi

    def rate(t, y):
        _, s, a, ds, da = y
        inertia, derivative = about_shaft(a)
        turn = momentum / inertia
        gap = np.array([0.5 * cos(a), 1 - 0.5 * sin(a) - s])  # from the slider's side to the middle of the rod
        d = np.hypot(*gap)
        d_a, d_s = gap @ [-0.5 * sin(a), -0.5 * cos(a)] / d, -gap[1] / d
        tension = stiffness * (d - 0.5) + damping * (d_a * da + d_s * ds)
        dda = (0.25 * derivative * turn**2 + moment * G * cos(a) - tension * d_a) / tilting
        return [turn, ds, da, -G - 2 * tension * d_s / 3, dda]

    return rate


@pytest.mark.slow
@pytest.mark.usefixtures("back_end")
def test_governor_follows_its_equations_in_two_coordinates():
    mech, t = mbdae.load("flyball_governor"), np.linspace(0, 2, 41)
    sol = mbdae.solve(mech, (0, 2), method="radau5", rtol=1e-8, t_eval=t)
    start = [0, 0.5, np.pi / 6, 0, 0]
    with np.errstate(over="ignore"):  # scipy's difference quotients grow where a column of the Jacobian is zero
        expected = solve_ivp(governor_equations(), (0, 2), start, "Radau", t, rtol=1e-9, atol=1e-11).y
    np.testing.assert_allclose(sol.q[:, :3], expected[:3].T, atol=2e-8)
    np.testing.assert_allclose(sol.q[:, 3], sol.q[:, 2], atol=1e-13)  # both rods have the same angle
    assert np.ptp(sol.q[:, 1]) > 0.24


# -- stewart_platform ----------------------------------------------------------------------------------------------


def test_hexapod_legs_are_as_long_as_the_platform_says():
    mech = mbdae.load("stewart_platform")
    base, platform = np.radians([[15, 105, 135, 225, 255, 345], [45, 75, 165, 195, 285, 315]])
    feet, sockets = (r * np.stack([cos(a), sin(a), 0 * a], axis=1) for r, a in ((0.5, base), (0.3, platform)))
    pistons = [mech.model.joints[mech.model.getJointId(f"piston_{i}")].idx_q for i in range(1, 7)]
    sol = mbdae.solve(mech, (0, 0.4), rtol=1e-7)
    for q in (mech.start[0], sol.q[-1]):
        tops = q[:3] + sockets @ pin.Quaternion(q[3:7]).matrix().T
        np.testing.assert_allclose(np.linalg.norm(tops - feet, axis=1), q[pistons] + 0.5, atol=1e-9)
    expected = 0.28 + 0.06 * sin(platform)
    np.testing.assert_allclose(mech.start[0][pistons], expected, atol=1e-11)  # given, the platform is found
    assert np.abs(sol.q[-1][pistons] - (0.28 + 0.06 * sin(0.4 * np.pi + platform))).max() < 0.015  # and followed


# -- delta_robot ---------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("back_end")
def test_delta_robot_keeps_its_platform_level_by_parallelograms_alone():
    mech = mbdae.load("delta_robot")
    sol = mbdae.solve(mech, (0, 2), rtol=1e-7)
    assert np.abs(sol.q[:, 3:6]).max() < 1e-9
    assert (np.ptp(sol.q[:, :2], axis=0) > 0.4).all()
    turned = mech.start[0].copy()
    turned[3:7] = pin.Quaternion(pin.exp3(np.array([0.0, 0.0, 0.1]))).coeffs()
    assert np.abs(mech.residual(turned, np.zeros(9))[0]).max() > 1e-4  # its joint would allow rotation


def test_delta_robot_is_at_the_intersection_of_three_spheres():
    mech = mbdae.load("delta_robot")
    angles = {"arm_1": 0.9, "arm_2": -0.1, "arm_3": 0.3}
    q, _ = mech.assemble(q=angles)
    for a, arm in zip(np.radians([0, 120, 240]), angles.values(), strict=True):
        out = np.array([cos(a), sin(a), 0])
        elbow = (0.2 + 0.35 * cos(arm) - 0.06) * out - [0, 0, 0.35 * sin(arm)]
        assert np.linalg.norm(q[:3] - elbow) == pytest.approx(0.8, abs=1e-12)


# -- dual_arm ------------------------------------------------------------------------------------------------------


def test_both_hands_keep_their_places_on_the_bar():
    mech = mbdae.load("dual_arm")
    assert mech.model.nq == 6 + 6 + 7
    sol = mbdae.solve(mech, (0, 0.8), rtol=1e-7)
    for q in (mech.start[0], sol.q[-1]):
        left, right = (place(mech, q, f"{side}_tool0") for side in ("left", "right"))
        apart = left.actInv(right)
        np.testing.assert_allclose(apart.rotation, np.eye(3), atol=1e-8)
        np.testing.assert_allclose(apart.translation, [-0.8, 0, 0], atol=1e-8)
    assert np.linalg.norm(place(mech, sol.q[-1], "right_tool0").translation - [0.5, -0.3, 0.34]) > 0.1


# -- humanoid_stance -----------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("back_end")
def test_the_feet_carry_weight_and_inertia_forces():
    mech = mbdae.load("humanoid_stance")
    assert mech.nv > 30
    sol = mbdae.solve(mech, (0, 0.2), rtol=1e-5)
    model, data, q, v = mech.model, mech.model.createData(), sol.q[-1], sol.v[-1]
    y = np.concatenate([q, v, [0.0]])
    derivative, lam = mech.system().derivative(0.2, y)
    change = pin.computeCentroidalMomentumTimeVariation(model, data, q, v, derivative[mech.nv : 2 * mech.nv]).linear
    weight = pin.computeTotalMass(model) * G
    forces = lam.reshape(2, 6)[:, :3].sum(0)  # the anchors' axes are the world's
    np.testing.assert_allclose(forces, change + [0, 0, weight], atol=1e-8 * weight)
    assert np.abs(change[2]) > 1
    for side, y in (("left", 0.085), ("right", -0.085)):
        sole = place(mech, q, f"{side}_sole_link")
        np.testing.assert_allclose(sole.translation, [0, y, 0], atol=1e-8)
        np.testing.assert_allclose(sole.rotation, np.eye(3), atol=1e-8)


# -- on the command line -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["flyball_governor", "stewart_platform", "delta_robot", "dual_arm", "humanoid_stance"])
def test_command_line(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        result = CliRunner().invoke(cli, arguments)
        assert result.exit_code == 0, (arguments, result.output, result.exception)
        return result.output

    card = json.loads(call("info", name, "--json"))
    assert card["rank"] == card["ng"]  # none is redundant
    call("solve", name, "-t", "0.1", "--rtol", "1e-6", "-o", "run.npz")
    call("drift", "run.npz", "--max", "1e-5")
