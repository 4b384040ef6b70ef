"""Closures and forces against finite differences, statics and power, far from the closed configurations."""

from contextlib import suppress

import numpy as np
import pinocchio as pin
import pytest
from chains import JOINTS, free_force, jacobian, random_q, rates, tree

from mbdae import Closure, JointDamping, JointSpring, JointTorque, MbdaeError, Mechanism, SpringDamper
from mbdae.finite_differences import numerical_derivative, numerical_jacobian

CLOSURES = {
    "point": lambda a, b: Closure.point(a, b),
    "revolute": lambda a, b: Closure.revolute(a, b, axis=(1.0, -2.0, 0.5)),
    "frame": lambda a, b: Closure.frame(a, b),
    "distance": lambda a, b: Closure.distance(a, b, 0.4),
}
PAIRS = {"link-world": ("tip_3", "ground"), "world-link": ("ground", "tip_3"), "branches": ("tip_3", "tip_6")}
PAIRS["along a branch"] = ("tip_0", "tip_3")


def models():
    """Every joint in the middle of a branched tree, and a robot of Pinocchio."""
    for kind in JOINTS:
        yield (
            kind,
            tree(
                ["free", kind, "spherical", "universal", "prismatic", "spherical", "revolute"],
                [0, 1, 2, 3, 1, 5, 6],
            ),
        )
    humanoid = pin.buildSampleModelHumanoid(True)
    for i, joint in ((0, "root_joint"), (3, "rleg_wrist2_joint"), (6, "rarm_wrist2_joint")):
        at = pin.SE3(pin.exp3(np.array([0.3, -0.5, 0.8])), np.array([0.1, 0.2 * i, -0.1]))
        humanoid.addFrame(pin.Frame(f"tip_{i}", humanoid.getJointId(joint), at, pin.FrameType.OP_FRAME))
    humanoid.addFrame(pin.Frame("ground", 0, pin.SE3(np.eye(3), np.array([0.2, 0.1, 0.3])), pin.FrameType.OP_FRAME))
    yield "humanoid", humanoid


MODELS = dict(models())
every_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
every_closure = pytest.mark.parametrize("closure", CLOSURES.values(), ids=CLOSURES.keys())


def far_states(model, number=2, seed=1):
    rng = np.random.default_rng(seed)
    for _ in range(number):
        yield random_q(model, rng, 1.5), rng.uniform(-2, 2, model.nv)


@every_closure
@every_model
def test_jacobian_is_the_derivative_of_g(model, closure):
    for pair in PAIRS.values():
        mech = Mechanism(model, [closure(*pair)])
        for q, v in far_states(model):
            g = lambda h: mech.residual(pin.integrate(model, q, h * v), v)[0]  # noqa: B023, E731
            rate = numerical_derivative(g, 2e-3)
            assert np.abs(g(0)).max() > 1e-3
            np.testing.assert_allclose(mech.residual(q, v)[1], rate, atol=1e-9 * (1 + np.abs(rate).max()))


@pytest.mark.usefixtures("back_end")
@every_closure
@every_model
def test_accelerations_meet_the_hidden_constraint(model, closure):
    # 0 = G v' + gamma, gamma = d/dt (G(q(t)) v) along q(t) = q (+) t v, on which v is constant
    for pair in PAIRS.values():
        mech = Mechanism(model, [closure(*pair)])
        for q, v in far_states(model, seed=2):
            rate = lambda h: mech.residual(pin.integrate(model, q, h * v), v)[1]  # noqa: B023, E731
            gamma = numerical_derivative(rate, 1e-3)
            vdot, _, _ = rates(mech, q, v)
            size = 1 + np.abs(gamma).max() + np.abs(vdot).max()
            np.testing.assert_allclose(mech.residual(q, vdot)[1] + gamma, 0, atol=2e-8 * size)


@pytest.mark.usefixtures("back_end")
@every_closure
@every_model
def test_multipliers_act_on_the_mechanism(model, closure):
    mech = Mechanism(model, [closure("tip_3", "tip_6")])
    for q, v in far_states(model, 1, seed=3):
        vdot, lam, power = rates(mech, q, v)
        M, f = free_force(model, q, v)
        f = f - model.damping * v
        np.testing.assert_allclose(M @ vdot, f + jacobian(mech, q).T @ lam, atol=1e-9 * (1 + np.abs(M @ vdot).max()))
        assert power == pytest.approx(-v @ (model.damping * v))


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS.keys())
def test_reaction_is_equal_and_opposite(pair):
    # the same force, put on both links as external wrenches by hand
    model = MODELS["composite"]
    q, v = next(iter(far_states(model, 1, seed=4)))
    mech = Mechanism(model, [Closure.point(*pair)])
    vdot, lam, _ = rates(mech, q, v)
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    a, b = (model.getFrameId(n) for n in pair)
    push = data.oMf[a].rotation @ lam  # along the axes of the first frame, on the second
    wrench = pin.Force(push, np.cross(data.oMf[b].translation, push))
    wrenches = [pin.Force.Zero() for _ in range(model.njoints)]
    for frame, sign in ((a, -1.0), (b, 1.0)):
        joint = model.frames[frame].parentJoint
        if joint:
            wrenches[joint] = wrenches[joint] + data.oMi[joint].actInv(pin.Force(sign * wrench.vector))
    expected = pin.aba(model, model.createData(), q, v, np.zeros(model.nv), wrenches)
    np.testing.assert_allclose(vdot, expected, atol=1e-9 * np.abs(vdot).max())


def ball(mass=2.0, com=(0.0, 0.0, 0.0), joint=None):
    model = pin.Model()
    i = model.addJoint(0, joint or pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(i, pin.Inertia(mass, np.array(com), np.diag([0.1, 0.2, 0.15])), pin.SE3.Identity())
    model.addFrame(pin.Frame("centre", i, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return model


@pytest.mark.usefixtures("back_end")
def test_signs_of_reactions_at_rest():
    weight = 2.0 * 9.81
    q, v = pin.neutral(ball()), np.zeros(6)
    point = rates(Mechanism(ball(), [Closure.point("world", "centre")]), q, v)[1]
    np.testing.assert_allclose(point, [0, 0, weight], atol=1e-12)
    swapped = rates(Mechanism(ball(), [Closure.point("centre", "world")]), q, v)[1]
    np.testing.assert_allclose(swapped, [0, 0, -weight], atol=1e-12)
    rod = Mechanism(ball(), [Closure.distance("world", "centre", 1.5)])
    below, above = q.copy(), q.copy()
    below[2], above[2] = -1.5, 1.5
    np.testing.assert_allclose(rates(rod, below, v)[1], [-weight])  # tension pulls the ends together
    np.testing.assert_allclose(rates(rod, above, v)[1], [weight])


@pytest.mark.usefixtures("back_end")
def test_moments_of_a_clamp():
    # lam 4 to 6 belong to the products of axes x.y', y.z', z.x' (first frame, second frame): the moment on the second
    # frame is -lam_4 z - lam_5 x - lam_6 y when the frames coincide
    com, weight = np.array([0.3, -0.2, 0.5]), np.array([0, 0, -2.0 * 9.81])
    mech = Mechanism(ball(com=com), [Closure.frame("world", "centre")])
    lam = rates(mech, pin.neutral(mech.model), np.zeros(6))[1]
    np.testing.assert_allclose(lam[:3], -weight, atol=1e-12)
    moment = -np.cross(com, weight)
    np.testing.assert_allclose([-lam[4], -lam[5], -lam[3]], moment, atol=1e-12)


@pytest.mark.usefixtures("back_end")
def test_centripetal_force_of_a_rod():
    mech = Mechanism(ball(joint=pin.JointModelTranslation()), [Closure.distance("world", "centre", 0.5)])
    mech.model.gravity.linear = np.zeros(3)
    _, lam, _ = rates(mech, np.array([0.5, 0, 0]), np.array([0, 3.0, 0]))
    np.testing.assert_allclose(lam, [-2.0 * 3.0**2 / 0.5])


def first_assembled(mech):
    """Some initial estimates lead to a flipped frame, which is rejected."""
    for q, v in far_states(mech.model, 20):
        with suppress(MbdaeError):
            return mech.assemble(q, v)
    raise AssertionError("no guess closes")


@pytest.mark.parametrize("kind", ["frame", "revolute"])
def test_a_closed_closure_has_coincident_frames(kind):
    # with g = 0 the frames coincide: checked by placements, not by g
    model = MODELS["spherical"]
    closure = CLOSURES[kind]("tip_3", "tip_6")
    mech = Mechanism(model, [closure])
    q, v = first_assembled(mech)
    data = model.createData()
    pin.forwardKinematics(model, data, q, v)
    pin.updateFramePlacements(model, data)
    a, b = (data.oMf[model.getFrameId(n)] for n in closure.frames)
    relative = a.actInv(b)
    np.testing.assert_allclose(relative.translation, 0, atol=1e-10)
    twists = [
        pin.getFrameVelocity(model, data, model.getFrameId(n), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        for n in closure.frames
    ]
    slip = (twists[1] - twists[0]).vector
    np.testing.assert_allclose(slip[:3], 0, atol=1e-9)
    if kind == "frame":
        np.testing.assert_allclose(relative.rotation, np.eye(3), atol=1e-10)
        np.testing.assert_allclose(slip[3:], 0, atol=1e-9)
    else:
        axis = np.array(closure.axis)
        np.testing.assert_allclose(relative.rotation @ axis, axis, atol=1e-10)
        np.testing.assert_allclose(np.cross(slip[3:], a.rotation @ axis), 0, atol=1e-9)
        assert np.linalg.norm(slip[3:]) > 1e-3


FORCES = {
    "spring between links": SpringDamper(frames=("tip_3", "tip_6"), stiffness=30.0, length=0.2),
    "spring to the world": SpringDamper(frames=("ground", "tip_6"), stiffness=30.0, length=0.7),
    "joint springs": JointSpring(joint=("revolute_6", "prismatic_4"), stiffness=7.0, rest=0.4),
}


@pytest.mark.parametrize("force", FORCES.values(), ids=FORCES.keys())
def test_spring_forces_are_gradients_of_their_potential(force):
    model = MODELS["revolute"]
    with_force, without = Mechanism(model, [], [force]), Mechanism(model)
    for q, v in far_states(model, seed=5):

        def energy(x, q=q, v=v):
            return with_force.energy(pin.integrate(model, q, x), v)[1]

        gradient = numerical_jacobian(energy, model.nv, 1e-3)
        M, f = free_force(model, q, 0 * v)
        vdot, _, power = rates(with_force, q, 0 * v)
        np.testing.assert_allclose(M @ vdot, -gradient, atol=1e-8)
        np.testing.assert_allclose(M @ rates(without, q, 0 * v)[0], f, atol=1e-9)
        assert power == 0


@pytest.mark.usefixtures("back_end")
def test_dampers_dissipate_energy_at_their_reported_power():
    model = MODELS["revolute"]
    damper = SpringDamper(frames=("tip_3", "tip_6"), damping=4.0)
    for q, v in far_states(model, seed=6):
        data = model.createData()

        def length(h, data=data, q=q, v=v):
            pin.framesForwardKinematics(model, data, pin.integrate(model, q, h * v))
            ends = [data.oMf[model.getFrameId(n)].translation for n in ("tip_3", "tip_6")]
            return np.linalg.norm(ends[1] - ends[0])

        speed = numerical_derivative(length, 1e-3)
        assert rates(Mechanism(model, [], [damper]), q, v)[2] == pytest.approx(-4.0 * speed**2, rel=1e-8)


@pytest.mark.usefixtures("back_end")
def test_joint_damping_torque_and_function():
    model = MODELS["revolute"]
    rng = np.random.default_rng(7)
    drive = rng.uniform(-1, 1, model.nv)
    joint = model.joints[model.getJointId("spherical_5")]
    at = slice(joint.idx_v, joint.idx_v + 3)

    def wind(t, q, v):
        return drive * np.cos(t) * v

    forces = [
        JointDamping(joint="spherical_5", damping=0.5),
        JointTorque(joint="spherical_5", torque=(1.0, 2.0, 3.0)),
        wind,
    ]
    for q, v in far_states(model, seed=8):
        tau = drive * np.cos(0.3) * v
        tau[at] += [1.0, 2.0, 3.0] - 0.5 * v[at]
        vdot, _, power = rates(Mechanism(model, [], forces), q, v, 0.3)
        M, f = free_force(model, q, v)
        np.testing.assert_allclose(M @ vdot, f + tau, atol=1e-9 * np.abs(f).max())
        assert power == pytest.approx(tau @ v)


@pytest.mark.usefixtures("back_end")
def test_damping_of_the_model_counts_once():
    model = pin.Model(MODELS["revolute"])
    model.damping = np.full(model.nv, 0.2)
    q, v = next(iter(far_states(model, 1)))
    joint = model.joints[model.getJointId("revolute_6")]
    d = np.full(model.nv, 0.2)
    for forces in ([], [JointDamping(joint="revolute_6", damping=3.0)]):
        if forces:
            d[joint.idx_v] = 3.0
        M, f = free_force(model, q, v)
        np.testing.assert_allclose(M @ rates(Mechanism(model, [], forces), q, v)[0], f - d * v, atol=1e-8)


def test_kinetic_and_potential_energy():
    model = MODELS["euler"]
    model = pin.Model(model)
    model.armature = np.linspace(0.1, 0.3, model.nv)
    for q, v in far_states(model, seed=9):
        kinetic, potential = Mechanism(model).energy(q, v)
        data = model.createData()
        pin.centerOfMass(model, data, q)
        mass = sum(i.mass for i in model.inertias)
        assert potential == pytest.approx(-mass * model.gravity.linear @ data.com[0])
        momenta = 0.0
        pin.forwardKinematics(model, data, q, v)
        for body, motion in zip(list(model.inertias)[1:], list(data.v)[1:], strict=True):
            momenta += 0.5 * (body * motion).vector @ motion.vector
        assert kinetic == pytest.approx(momenta + 0.5 * v @ (model.armature * v))


def test_what_closes_nothing_or_is_numbered_wrongly_is_rejected():
    model = pin.Model(MODELS["revolute"])
    model.addFrame(pin.Frame("again", model.getJointId("revolute_6"), pin.SE3.Random(), pin.FrameType.OP_FRAME))
    with pytest.raises(MbdaeError, match="'tip_6-again' closes nothing"):
        Mechanism(model, [Closure.point("tip_6", "again")])
    breadth_first = tree(["revolute", "revolute", "prismatic", "revolute"], [0, 0, 1, 2])
    with pytest.raises(MbdaeError, match="depth first"):
        Mechanism(breadth_first)
