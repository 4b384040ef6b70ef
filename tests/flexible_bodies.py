"""Flexible bodies for the tests: random ones in space, and the four-bar with a flexible coupler."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin

import mbdae
from mbdae.mechanism.flexible import ModalBody, attach_flexible
from mbdae.mechanism.flexible.modal_body import Node

FOUR_BAR = Path(__file__).parent.parent / "models" / "flexible_four_bar" / "mechanism.toml"
AT_HALF_SECOND = {  # from two formulations in other programs, which agree to one unit of the last digit
    "crank": 6.176187673203,
    "middle": -1.042298286915e-3,
    "crank rate": 8.322846542954,
    "middle rate": 1.295419273308e-2,
}
MODES_AT_HALF_SECOND = -4.978271247338e-4, -1.250931639250e-5, -2.247061941686e-6, 6.7061592655e-8

CANTILEVER = """
[[flexible]]
name = "bar"
parent = "world"
joint = "fixed"
length = 1.0
young = 7e10
density = 2700.0
area = 1e-4
second_moment = 8e-11
modes = 2
nodes = { middle = 0.5, tip = 1.0 }
"""


def points(seed=0, n=25, k=4):
    """Return points (n, 3), masses (n,) and displacements (n, 3, k) of a random body."""
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3)), rng.uniform(0.5, 1.5, n), rng.normal(size=(n, 3, k))


def second_order(rng, n, k, size):
    """Return displacements of second order, (n, 3, k, k), symmetric in the modes; None if they are zero."""
    x = size * rng.normal(size=(n, 3, k, k))
    return x + x.swapaxes(2, 3) if size else None


def body(seed=0, k=4, stiffness=(1.0, 3.0), turn=1.0, damping=0.0, second=0.0):
    """Return a random body with nodes A, B and C."""
    rng = np.random.default_rng(seed + 100)
    nodes = {
        name: Node(*(rng.normal(size=s) for s in ((3,), (3, k))), turn * rng.normal(size=(3, k))) for name in "ABC"
    }
    r, m, Phi = points(seed, k=k)
    second_order_of_nodes = second_order(rng, 3, k, second)
    if second:
        nodes = {name: replace(x, Phi2=y) for (name, x), y in zip(nodes.items(), second_order_of_nodes, strict=True)}
    Phi2 = second_order(rng, len(m), k, second)
    return ModalBody.of_points(r, m, Phi, rng.uniform(*stiffness, k), damping, nodes, Phi2)


def place(rng):
    return pin.SE3(pin.Quaternion(pin.Quaternion(rng.normal(size=4)).normalized()), rng.normal(size=3))


def inertia(rng):
    return pin.Inertia(2.0, rng.normal(size=3), np.diag([1.0, 1.2, 1.5]))


def rigid_and_flexible(seed=0):
    """Return flexible bodies: free on a branch of rigid bodies, fixed to one of these, and fixed to the world."""
    rng, model = np.random.default_rng(seed), pin.Model()
    model.gravity.linear = np.array([1.0, -2.0, 3.0])
    joints = []
    for name, joint in (("a", pin.JointModelRX()), ("b", pin.JointModelSpherical())):
        joints.append(model.addJoint(joints[-1] if joints else 0, joint, place(rng), name))
        model.appendBodyToJoint(joints[-1], inertia(rng), place(rng))
    attach_flexible(
        model, "rod", body(seed, k=3, damping=0.1, second=0.2), pin.JointModelFreeFlyer(), joints[-1], place(rng)
    )
    for name, parent in (("arm", joints[0]), ("post", 0)):
        attach_flexible(model, name, body(seed + parent, k=2, second=0.1), None, parent, place(rng))
    joints.append(model.addJoint(0, pin.JointModelFreeFlyer(), place(rng), "c"))
    model.appendBodyToJoint(joints[-1], inertia(rng), place(rng))
    for name, joint in (("a.f", joints[0]), ("c.f", joints[-1])):
        model.addFrame(pin.Frame(name, joint, place(rng), pin.FrameType.OP_FRAME))
    make, spring = mbdae.Closure, {"stiffness": 3.0, "damping": 2.0, "length": 0.5}
    closures = [make.frame("rod.A", "c.f"), make.distance("rod.B", "c.f", 1.0)]
    closures += [make.point("a.f", "rod.C"), make.distance("rod.A", "rod.B", 1.0)]
    closures += [make.distance("arm.A", "c.f", 1.0)]
    forces = [mbdae.SpringDamper(frames=pair, **spring) for pair in (("rod.A", "rod.C"), ("arm.B", "post.A"))]
    return mbdae.Mechanism(model, closures, forces, title="crowd")


def free(modal, gravity=(0.0, 0.0, 0.0), more=()):
    """Return a free flexible body, with rigid bodies that closures (kind, node) attach to its nodes."""
    rng, model, closures = np.random.default_rng(5), pin.Model(), []
    model.gravity.linear = np.array(gravity)
    attach_flexible(model, "rod", modal, pin.JointModelFreeFlyer())
    for i, (kind, node) in enumerate(more):
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"load {i}")
        model.appendBodyToJoint(joint, inertia(rng), pin.SE3.Identity())
        model.addFrame(pin.Frame(f"load {i}", joint, pin.SE3.Identity(), pin.FrameType.OP_FRAME))
        closures.append(getattr(mbdae.Closure, kind)(f"rod.{node}", f"load {i}"))
    return mbdae.Mechanism(model, closures)


def state(mech, seed=1, size=0.5):
    """Return a random state."""
    rng = np.random.default_rng(seed)
    return mech.manifold.integrate(pin.neutral(mech.model), size * rng.normal(size=mech.nv)), rng.normal(size=mech.nv)


def derivative(f, x, h=2e-3):
    """Return the derivative of f at x, by central differences of order 8."""
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    return sum(w * (f(x + k * h) - f(x - k * h)) for k, w in weights.items()) / h


def tangent_derivatives(mech, f, q):
    """Return the derivatives of f with respect to q in the tangent, (.., nv)."""
    unit = np.eye(mech.nv)
    return np.array([derivative(lambda s, e=e: f(mech.manifold.integrate(q, s * e)), 0.0) for e in unit]).T
