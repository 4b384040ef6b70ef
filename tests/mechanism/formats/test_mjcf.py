"""MJCF against MuJoCo itself: the converted model has MuJoCo's mass matrix, forces and equalities."""

import numpy as np
import pinocchio as pin
import pytest
from mujoco_models import DATA, FILES, at, compiled, load, mass_matrix

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism import from_mujoco, to_mujoco
from mbdae.mechanism.closures.constraints import anchors

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")

NO_STATES = np.empty(0)
EXACT = 1e-9


def random_states(mech, n=5):
    rng = np.random.default_rng(0)
    for _ in range(n):
        q = pin.integrate(mech.model, pin.neutral(mech.model), rng.uniform(-1, 1, mech.nv))
        yield q, rng.standard_normal(mech.nv)


@pytest.mark.parametrize("name", FILES)
def test_mass_matrix_and_bias_are_those_of_mujoco(name):
    mech, (m, d) = load(name), compiled(name)
    M, data = np.empty((m.nv, m.nv)), mech.model.createData()  # mj_fullM takes other arguments in MuJoCo 3
    assert np.array_equal(mech.gravity, m.opt.gravity)
    for q, v in random_states(mech):
        T, transport = at(mech, m, d, q, v)
        for row, unit in zip(M, np.eye(m.nv), strict=True):
            mujoco.mj_mulM(m, d, row, unit)
        ours = mass_matrix(mech, q)
        np.testing.assert_allclose(T.T @ ours @ T, M, rtol=0, atol=EXACT * np.abs(M).max())
        if name == "heavy_rotor":  # the weight of its armature is balanced by a force: see the next test
            continue
        bias = T.T @ (pin.nonLinearEffects(mech.model, data, q, v) + ours @ transport)
        np.testing.assert_allclose(bias, d.qfrc_bias, rtol=0, atol=EXACT * max(1, np.abs(bias).max()))


@pytest.mark.parametrize("name", FILES)
def test_forces_are_those_of_mujoco(name):
    """Bias, springs, dampers and motors together: f = T^-T (passive + actuator - bias) with T' qvel added back."""
    mech, (m, d) = load(name, motors={"lift": 0.7} if name == "actuated" else None), compiled(name)
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT  # forces of equalities are not forces here
    m.body_gravcomp[:] = 0
    if name == "actuated":
        d.ctrl[:] = [0.7, -0.1, 0, 0]
        m.actuator_gainprm[3:], m.actuator_biasprm[3:] = 0, 0  # the winch is left out
    for q, v in random_states(mech):
        T, transport = at(mech, m, d, q, v)
        system = mech.system()
        system.inertia(0.0, q)
        f = np.asarray(system.force(0.0, q, v, NO_STATES)[0])
        theirs = d.qfrc_passive + d.qfrc_actuator - d.qfrc_bias
        np.testing.assert_allclose(
            T.T @ (f - mass_matrix(mech, q) @ transport), theirs, rtol=0, atol=EXACT * max(1, np.abs(theirs).max())
        )


def test_armature_of_a_free_joint_has_no_weight_on_the_moon_either(tmp_path):
    gravity = [0.0, 0.1, -1.62]
    path = tmp_path / "mechanism.toml"
    path.write_text(f'gravity = {gravity}\n[[source]]\nfile = "{DATA / "heavy_rotor.xml"}"\nprefix = "a_"')
    mech, (m, d) = mbdae.load(path), compiled("heavy_rotor")
    m.opt.gravity[:] = gravity
    q, v = mech.start[0], np.zeros(mech.nv)
    T, _ = at(mech, m, d, q, v)
    acceleration = mech.system().derivative(0.0, mech.point(q, v))[0][mech.nv : 2 * mech.nv]
    np.testing.assert_allclose(acceleration, T @ d.qacc, atol=1e-9)
    assert abs(acceleration[2]) < 0.99 * 1.62  # accelerated with its inertia


@pytest.mark.parametrize("name", FILES)
def test_bodies_and_sites_are_where_mujoco_has_them(name):
    mech, (m, d) = load(name), compiled(name)
    data = mech.model.createData()
    for q, v in random_states(mech, 2):
        at(mech, m, d, q, v)
        pin.forwardKinematics(mech.model, data, q)
        pin.updateFramePlacements(mech.model, data)
        for kind, count, x, R in (("BODY", m.nbody, d.xpos, d.xmat), ("SITE", m.nsite, d.site_xpos, d.site_xmat)):
            for i in range(kind == "BODY", count):
                frame = mujoco.mj_id2name(m, getattr(mujoco.mjtObj, f"mjOBJ_{kind}"), i)
                frame = frame or f"{kind.lower()}{i}"
                here = data.oMf[mech.model.getFrameId(frame)]
                np.testing.assert_allclose(here.translation, x[i], atol=1e-12)
                np.testing.assert_allclose(here.rotation.ravel(), R[i], atol=1e-12)


@pytest.mark.parametrize("name", FILES)
def test_velocities_convert_as_mujoco_integrates_them(name):
    """A small step along qvel in MuJoCo is the same step along v here."""
    mech, (m, _) = load(name), compiled(name)
    for q, v in random_states(mech, 3):
        qpos, qvel = to_mujoco(mech.model, q, v)
        back = from_mujoco(mech.model, qpos, qvel)
        np.testing.assert_allclose(np.concatenate(back), np.concatenate([q, v]), atol=1e-14)
        h, ends = 1e-4, []
        for sign in (1, -1):
            moved = qpos.copy()
            mujoco.mj_integratePos(m, moved, sign * qvel, h)
            ends.append(from_mujoco(mech.model, moved)[0])
        rate = (pin.difference(mech.model, q, ends[0]) - pin.difference(mech.model, q, ends[1])) / (2 * h)
        np.testing.assert_allclose(rate, v, atol=1e-6)


def test_wrong_lengths_are_rejected():
    model = load("trees").model
    with pytest.raises(InputError, match="expected shapes"):
        from_mujoco(model, np.zeros(3))
    with pytest.raises(InputError, match="expected shapes"):
        to_mujoco(model, pin.neutral(model), np.zeros(1))


# -- equalities ----------------------------------------------------------------------------------------------


def pose_and_jacobian(mech, q, anchor):
    data = mech.model.createData()
    pin.computeJointJacobians(mech.model, data, q)
    here = data.oMi[anchor.joint] * pin.SE3(anchor.R, anchor.p)
    J = np.zeros((6, mech.nv))
    if anchor.joint:
        J = pin.getJointJacobian(mech.model, data, anchor.joint, pin.ReferenceFrame.WORLD)
    turned = J.copy()
    turned[:3] -= pin.skew(here.translation) @ J[3:]  # velocity of the anchor's origin
    return here, turned


def quaternion(R):
    x, y, z, w = pin.Quaternion(R).coeffs()
    return np.array([w, x, y, z])


def product(a, b):
    return np.array([a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))])


def rotational_part(one, two, J):
    """Vector part of q2^-1 q1 of two orientations, and its Jacobian; J of the difference of angular velocities."""
    a, b = quaternion(one.rotation), quaternion(two.rotation) * [1, -1, -1, -1]
    rows = np.array([0.5 * product(product(b, np.array([0, *w])), a)[1:] for w in J.T]).T
    return product(b, a)[1:], rows


def same_up_to_sign(ours, theirs):
    g, G = ours
    p, J = theirs
    sign = -1.0 if np.abs(g + p).max() < np.abs(g - p).max() else 1.0  # a quaternion and its negative are one rotation
    np.testing.assert_allclose(sign * g, p, atol=EXACT)
    np.testing.assert_allclose(sign * G, J, atol=EXACT)


@pytest.mark.parametrize("name", ["loops", "open_four_bar"])
def test_equalities_have_the_residuals_and_jacobians_of_mujoco(name):
    """From the anchors alone, at states with violated equalities; then rows of G against them."""
    mech, (m, d) = load(name), compiled(name)
    assert len(mech.constraints) == int(m.eq_active0.sum())
    system = mech.system()
    for q, v in random_states(mech, 3):
        T, _ = at(mech, m, d, q, v)
        g, G = system.closures(q, 0.0)
        J = d.efc_J.reshape(d.nefc, m.nv)
        for closure in mech.constraints:
            i = mujoco.mj_name2id(m, mujoco.mjtObj.mjOBJ_EQUALITY, closure.name)
            theirs = np.flatnonzero(d.efc_id[: d.ne] == i)
            p, dp = d.efc_pos[theirs], J[theirs] @ np.linalg.inv(T)
            mine = np.array(mech.rows_of(closure.name))
            if not closure.frames:
                np.testing.assert_allclose(g[mine], p, atol=EXACT)
                np.testing.assert_allclose(G[mine], dp, atol=EXACT)
                continue
            (one, J1), (two, J2) = (pose_and_jacobian(mech, q, x) for x in anchors(mech.model, closure))
            gap, dgap = one.translation - two.translation, J1[:3] - J2[:3]
            np.testing.assert_allclose(gap, p[:3], atol=EXACT)
            np.testing.assert_allclose(dgap, dp[:3], atol=EXACT)
            if closure.kind == "frame":
                same_up_to_sign(rotational_part(one, two, J1[3:] - J2[3:]), (p[3:], dp[3:]))
            # rows here measure the gap in axes of the first frame: g = R^T (p2 - p1)
            R, mine = one.rotation, mine[:3]
            np.testing.assert_allclose(R @ g[mine], -p[:3], atol=EXACT)
            np.testing.assert_allclose(R @ G[mine], -dp[:3] - pin.skew(gap) @ J1[3:], atol=EXACT)


def test_a_model_with_a_loop_moves_as_mujoco_moves_it():
    """Accelerations of the exact loop against MuJoCo's soft one, made stiff."""
    mech, (m, d) = load("open_four_bar"), compiled("open_four_bar")
    m.eq_solref[:], m.eq_solimp[:] = [-1e6, -1e3], [0.999999, 0.999999, 0.001, 0.5, 2]
    m.opt.tolerance, m.opt.iterations = 0, 200
    for speed in (0.0, 3.0):
        q, v = mech.assemble(v={"crank": speed})
        d.qpos[:], d.qvel[:] = to_mujoco(mech.model, q, v)
        mujoco.mj_forward(m, d)
        F, _ = mech.system().derivative(0.0, mech.point(q, v))
        np.testing.assert_allclose(F[mech.nv : 2 * mech.nv], d.qacc, rtol=1e-4)
