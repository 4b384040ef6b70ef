"""Small mechanisms with impacts, and random ones."""

import numpy as np
import pinocchio as pin

from mbdae import Closure, CoulombFriction, Mechanism, Stop

G = 9.81
R = 0.01


def empty(gravity=-G):
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, gravity])
    return model


def add_body(model, parent, joint, name, mass=1.0, com=(0.0, 0.0, 0.0), inertia=(0.0, 0.0, 0.0), place=None):
    """Add a joint with a body and a frame of the same name."""
    j = model.addJoint(parent, joint, place or pin.SE3.Identity(), name)
    model.appendBodyToJoint(j, pin.Inertia(mass, np.array(com), np.diag(inertia)), pin.SE3.Identity())
    model.addFrame(pin.Frame(name, j, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
    return j


def frame(model, joint, name, *xyz):
    model.addFrame(pin.Frame(name, joint, 0, pin.SE3(np.eye(3), np.array(xyz)), pin.FrameType.OP_FRAME))


def plane(name, restitution=0.0, **more):
    return Closure(kind="in_plane", frames=("world", name), unilateral=True, restitution=restitution, name=name, **more)


def ball(restitution=0.8, rest=1e-7):
    model = empty()
    add_body(model, 0, pin.JointModelPZ(), "z")
    return Mechanism(model, stops=[Stop(joint="z", lower=0.0, restitution=restitution, rest=rest)])


def pendulum(lower=0.3, restitution=0.7):
    """Return a point on a massless rod of 1 m."""
    model = empty()
    add_body(model, 0, pin.JointModelRY(), "a", com=(0, 0, -1.0))
    return Mechanism(model, stops=[Stop(joint="a", lower=lower, restitution=restitution)])


def lever(mu, angle=0.9, e=0.0):
    """Return a rod on a carriage, hinged above the floor, its end in front of the hinge and rounded to a radius R."""
    model = empty()
    cart = add_body(model, 0, pin.JointModelPX(), "cart", 0.5)
    rod = add_body(model, cart, pin.JointModelRY(), "rod", 0.0, inertia=(0, 0.02, 0))
    frame(model, rod, "end", 0.5 * np.sin(angle), 0, -0.5 * np.cos(angle))
    place = pin.SE3(np.eye(3), np.array([0, 0, -0.5 * np.cos(angle) - R]))
    model.addFrame(pin.Frame("floor", 0, 0, place, pin.FrameType.OP_FRAME))
    floor = Closure.rolling("floor", "end", R, name="ground", grip="longitudinal", unilateral=True, restitution=e)
    return Mechanism(model, [floor], [CoulombFriction(closure="ground", coefficient=mu, exact=True)])


def dropped_chain(rng):
    """Return a chain of up to four links and a state from which it falls: tips hit a plane, joints hit stops."""
    n, kind, e = int(rng.integers(1, 5)), int(rng.integers(3)), float(rng.choice([0.0, 0.3, 0.5, 0.8, 1.0]))
    upright = pin.SE3(pin.utils.rotate("x", np.pi / 2), np.zeros(3))
    bases = (pin.JointModelPlanar(), upright), (pin.JointModelPZ(), None), (pin.JointModelFreeFlyer(), None)
    (base, place), model, closures, stops, joint = bases[kind], empty(), [], [], 0
    for k in range(n):
        hinge = pin.JointModelRX() if kind == 2 and rng.random() < 0.5 else pin.JointModelRY()
        moving = base if not k else pin.JointModelRZ() if kind == 0 else hinge
        length, mass = float(rng.uniform(0.3, 0.8)), float(rng.uniform(0.2, 2))
        moment = mass * length**2 / 12
        inertia = (0.002, moment, moment)
        joint = add_body(model, joint, moving, f"j{k}", mass, (length / 2, 0, 0), inertia, place)
        place = pin.SE3(np.eye(3), np.array([length, 0, 0]))
        frame(model, joint, f"tip{k}", length, 0, 0)
        closures.append(plane(f"tip{k}", e))
        if k and rng.random() < 0.7:
            ends = {"lower": -float(rng.uniform(0.05, 1)), "upper": float(rng.uniform(0.05, 1))}
            stops.append(Stop(joint=f"j{k}", restitution=float(rng.choice([0.0, e, 0.5])), **ends))
    mech = Mechanism(model, [plane("j0", e), *closures], stops=stops)
    q = pin.neutral(model)
    for s in stops:
        q[model.joints[model.getJointId(s.joint)].idx_q] = rng.uniform(0.9 * s.lower, 0.9 * s.upper)
    if kind == 2:
        q[3:7] = pin.Quaternion(pin.exp3(0.5 * rng.normal(size=3))).coeffs()
    elif kind == 0:
        turn = rng.uniform(-0.8, 0.8)
        q[2:4] = np.cos(turn), np.sin(turn)
    q[(1, 0, 2)[kind]] += float(rng.choice([0.0, 0.05, 0.5])) - gaps(mech, q)[0, : n + 1].min()
    return mech, q, float(rng.choice([0.0, 0.5, 2.0])) * rng.normal(size=model.nv)


def gaps(mech, *qs):
    """Return gaps of all unilateral rows, at each q, (n, k), positive where they are open."""
    from mbdae.mechanism.hybrid.mode_point import AllRows

    rows = AllRows(mech.system())
    return np.array([[s.sign * g[s.row] for s in mech.switches] for g in (rows(0.0, q)[0] for q in qs)])
