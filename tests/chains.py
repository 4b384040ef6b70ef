"""Models for tests: a tree with every kind of joint, and small loops."""

import numpy as np
import pinocchio as pin


def random_placement(rng):
    return pin.SE3(pin.exp3(rng.uniform(-2, 2, 3)), rng.uniform(-0.5, 0.5, 3))


def unit(rng):
    axis = rng.standard_normal(3)
    return axis / np.linalg.norm(axis)


def composite():
    joint = pin.JointModelComposite()
    joint.addJoint(pin.JointModelRX())
    joint.addJoint(pin.JointModelSpherical(), pin.SE3(np.eye(3), np.array([0.1, -0.2, 0.3])))
    joint.addJoint(pin.JointModelPZ())
    return joint


JOINTS = {
    "revolute": lambda rng: pin.JointModelRevoluteUnaligned(unit(rng)),
    "prismatic": lambda rng: pin.JointModelPrismaticUnaligned(unit(rng)),
    "spherical": lambda rng: pin.JointModelSpherical(),
    "planar": lambda rng: pin.JointModelPlanar(),
    "continuous": lambda rng: pin.JointModelRUBZ(),
    "translation": lambda rng: pin.JointModelTranslation(),
    "free": lambda rng: pin.JointModelFreeFlyer(),
    "universal": lambda rng: pin.JointModelUniversal(np.array([1.0, 0, 0]), np.array([0, 1.0, 0])),
    "euler": lambda rng: pin.JointModelSphericalZYX(),
    "composite": lambda rng: composite(),
    "helical": lambda rng: pin.JointModelHelicalUnaligned(unit(rng), 0.3),
    "rx": lambda rng: pin.JointModelRX(),
    "ruby": lambda rng: pin.JointModelRUBY(),
    "py": lambda rng: pin.JointModelPY(),
}


def random_inertia(rng):
    turn = pin.exp3(rng.uniform(-2, 2, 3))
    a, b, c = rng.uniform(0.05, 0.2, 3)
    moments = np.diag([b + c, c + a, a + b])
    return pin.Inertia(rng.uniform(0.5, 2.0), rng.uniform(-0.3, 0.3, 3), turn @ moments @ turn.T)


def tree(kinds, parents, seed=0):
    """Return a tree of the named joints; link i carries the frame ``tip_i``; ``ground`` is fixed to the world."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    model.name = "tree"
    model.gravity.linear = np.array([0.7, -1.1, -9.81])
    for i, (kind, parent) in enumerate(zip(kinds, parents, strict=True)):
        joint = model.addJoint(parent, JOINTS[kind](rng), random_placement(rng), f"{kind}_{i}")
        model.appendBodyToJoint(joint, random_inertia(rng), pin.SE3.Identity())
        model.addFrame(pin.Frame(f"tip_{i}", joint, random_placement(rng), pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("ground", 0, random_placement(rng), pin.FrameType.OP_FRAME))
    return model


def random_q(model, rng, width=1.2):
    """Return a random configuration far from neutral, quaternions and circles included."""
    return pin.integrate(model, pin.neutral(model), rng.uniform(-width, width, model.nv))


def close(found, expected, tolerance=1e-11, size=0.0):
    """Compare relative to the largest entry, or to a size."""
    scale = max(np.abs(expected).max(initial=0.0), size)
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance * max(scale, 1e-3))


def rod(model, parent, placement, length, name, axis=(0.0, -1.0, 0.0), mass=1.0, width=0.02):
    """Hinge a rod along x to a joint; its end is the frame ``name_tip``."""
    joint = model.addJoint(parent, pin.JointModelRevoluteUnaligned(np.array(axis)), placement, name)
    across = mass * length**2 / 12
    tensor = np.diag([mass * width**2 / 2, across, across])
    model.appendBodyToJoint(
        joint, pin.Inertia(mass, np.array([length / 2, 0, 0]), tensor), pin.SE3.Identity()
    )
    tip = pin.SE3(np.eye(3), np.array([length, 0, 0]))
    model.addFrame(pin.Frame(f"{name}_tip", joint, tip, pin.FrameType.OP_FRAME))
    return joint, tip


def rates(mech, q, v, t=0.0):
    """Return v', lam (ng,) and the power of the non-conservative forces from the acceleration-level solve."""
    F, lam = mech.system().derivative(t, np.concatenate([q, v, [0.0]]))
    return F[mech.nv : 2 * mech.nv], lam, F[-1]


def jacobian(mech, q):
    """Return G (ng, nv), column by column from G v of unit velocities."""
    return np.array([mech.residual(q, e)[1] for e in np.eye(mech.nv)]).T.reshape(mech.ng, mech.nv)


def free_force(model, q, v):
    """Return M (armature included) and -nle from recursive Newton-Euler alone, M column by column."""
    data, zero = model.createData(), np.zeros(model.nv)
    bias = pin.rnea(model, data, q, v, zero).copy()
    weight = pin.rnea(model, data, q, zero, zero).copy()
    M = np.array([pin.rnea(model, data, q, zero, e) - weight for e in np.eye(model.nv)]).T
    return M, -bias
