"""A closed-loop arm from a real file: energy, drift, and agreement between tolerances."""

import numpy as np
import pinocchio as pin
import pytest
from chains import jacobian
from models.test_models import place

import mbdae
from mbdae.studies.drift.drift import drift


@pytest.fixture(scope="module", params=["native", "python"])
def runs(request):
    mech = mbdae.load("panda_handle")
    return {rtol: mbdae.solve(mech, (0, 2), rtol=rtol, backend=request.param) for rtol in (1e-8, 1e-10)}


def test_it_moves(runs):
    sol = runs[1e-8]
    assert sol.success
    assert sol.t[-1] == 2
    assert (np.ptp(sol.q, axis=0) > 0.05).all()
    assert np.abs(sol.v).max() > 1


def test_energy_balance_and_drift(runs):
    d = drift(runs[1e-8])
    assert d.energy_relative <= 1e-6
    assert d.g_max <= 1e-7
    assert d.Gv_max <= 1e-12
    assert d.work_end < -1  # dissipated by the dampers


def test_energy_balance_by_hand(runs):
    # from Pinocchio's own energies, the work of the dampers by a fine quadrature of the dense output
    sol = runs[1e-10]
    model, data = sol.mechanism.model, sol.mechanism.model.createData()
    damping = np.full(8, 1.0)
    damping[model.joints[model.getJointId("handle")].idx_v] = 0.05
    energy = [pin.computeMechanicalEnergy(model, data, q, v) for q, v in zip(sol.q, sol.v, strict=True)]
    nodes, weights = np.polynomial.legendre.leggauss(4)
    work = 0.0
    for i in range(0, len(sol.t) - 1):
        h = sol.t[i + 1] - sol.t[i]
        for s, w in zip((nodes + 1) / 2, weights / 2, strict=True):
            v = sol(sol.t[i] + s * h).v
            work -= w * h * v @ (damping * v)
    assert work == pytest.approx(sol.work[-1], rel=1e-8)
    scale = max(abs(work), np.abs(energy).max() - np.abs(energy).min())
    assert abs(energy[-1] - energy[0] - work) <= 1e-7 * scale


def test_the_end_does_not_depend_on_the_tolerance(runs):
    loose, tight = runs[1e-8], runs[1e-10]
    np.testing.assert_allclose(loose.q[-1], tight.q[-1], rtol=0, atol=1e-5)
    np.testing.assert_allclose(loose.v[-1], tight.v[-1], rtol=0, atol=1e-5)


def test_the_hand_stays_on_the_bar(runs):
    # placements, not g: origins coincide, the bar's direction is common
    sol = runs[1e-8]
    model, data = sol.mechanism.model, sol.mechanism.model.createData()
    for q in sol.q[::20]:
        pin.framesForwardKinematics(model, data, q)
        hand, bar = (data.oMf[model.getFrameId(n)] for n in ("panda_hand_tcp", "grip"))
        np.testing.assert_allclose(hand.translation, bar.translation, rtol=0, atol=1e-7)
        np.testing.assert_allclose(np.cross(hand.rotation[:, 0], bar.rotation[:, 0]), 0, atol=1e-7)


@pytest.fixture(scope="module")
def panda():
    return mbdae.load("panda_handle")


def test_panda_holds_the_bar(panda):
    q, v = panda.start
    assert not v.any()
    hand, bar = place(panda, q, "panda_hand_tcp"), place(panda, q, "grip")
    np.testing.assert_allclose(hand.translation, bar.translation, atol=1e-14)
    np.testing.assert_allclose(hand.rotation[:, 0], bar.rotation[:, 0], atol=1e-14)
    np.testing.assert_allclose(bar.rotation[:, 0], [0, 1, 0], atol=1e-14)  # along the axle
    assert not any("finger" in name for name in panda.joint_names)


def test_panda_stays_in_its_limits_and_away_from_singular_poses(panda):
    sol = mbdae.solve(panda, (0, 5), rtol=1e-7)
    assert sol.success
    arm = sol.q[:, :7]
    assert (arm > panda.model.lowerPositionLimit[:7]).all()
    assert (arm < panda.model.upperPositionLimit[:7]).all()
    smallest = [np.linalg.svd(jacobian(panda, q)[:, :7], compute_uv=False)[-1] for q in sol.q[::5]]
    assert min(smallest) > 0.03
    assert np.abs(sol.v).max() < 4
    assert np.ptp(sol.q[sol.t > 3, 7]) > 0.4  # the wheel still swings


def test_panda_does_not_feel_small_changes(panda):
    q, v = panda.start
    ahead, _ = panda.assemble({"handle": q[7] + 1e-4, "panda_joint1": q[0], "panda_joint3": q[2]})
    ends = [mbdae.solve(panda, (0, 5), q0, v, rtol=1e-9).q[-1] for q0 in (q, ahead)]
    assert np.linalg.norm(ends[1] - ends[0]) < 10 * np.linalg.norm(ahead - q)
