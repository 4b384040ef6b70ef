"""Mechanisms with drivers, for tests of rheonomic constraints."""

import numpy as np
import pinocchio as pin
from chains import rod

import mbdae
from mbdae import Closure, Driver, Mechanism
from mbdae.mechanism.model_settings import Start


def crane():
    """Return a driven cart, a double pendulum on it, and a rod from its tip to the ground: one degree of freedom."""
    model = pin.Model()
    model.name = "crane"
    cart = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "cart")
    model.appendBodyToJoint(cart, pin.Inertia.FromSphere(2.0, 0.1), pin.SE3.Identity())
    upper, tip = rod(model, cart, pin.SE3.Identity(), 0.8, "upper")
    rod(model, upper, tip, 0.7, "lower")
    return Mechanism(
        model,
        [Closure.distance("world", "lower_tip", 1.1, name="stay")],
        drivers=[Driver.harmonic("cart", 0.3, 4.0, phase=0.5)],
        start=Start(q={"upper": 1.2}, guess={"lower": -0.6}),
    )


def platform():
    """Return a free body on three driven lengths, with a body attached by a ball joint: six degrees of freedom."""
    model = pin.Model()
    model.name = "platform"
    body = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "body")
    model.appendBodyToJoint(body, pin.Inertia.FromBox(2.0, 0.5, 0.4, 0.1), pin.SE3.Identity())
    arm = model.addJoint(body, pin.JointModelSpherical(), pin.SE3(np.eye(3), np.array([0.1, 0, -0.2])), "arm")
    off = pin.SE3(np.eye(3), np.array([0.05, 0, -0.2]))
    model.appendBodyToJoint(arm, pin.Inertia.FromBox(1.0, 0.1, 0.2, 0.3), off)
    drivers = []
    for i, (x, y) in enumerate(((0.3, 0), (-0.2, 0.25), (-0.2, -0.25))):
        corner, hook = np.array([x, y, 0.0]), np.array([2 * x, 2 * y, 1.5])
        model.addFrame(pin.Frame(f"corner_{i}", body, pin.SE3(np.eye(3), corner), pin.FrameType.OP_FRAME))
        model.addFrame(pin.Frame(f"hook_{i}", 0, pin.SE3(np.eye(3), hook), pin.FrameType.OP_FRAME))
        drivers.append(Driver.harmonic((f"hook_{i}", f"corner_{i}"), 0.1, 3.0 + i, phase=i, offset=1.3 + 0.1 * i))
    return Mechanism(model, drivers=drivers, start=Start(v={"arm": (1.0, 2.0, 0.5)}))


def linkage():
    """Return a four-bar linkage with a driven crank: no degree of freedom is left."""
    return mbdae.load("four_bar", drivers=[Driver.harmonic("crank", 1.2, 2 * np.pi, offset=1.2, phase=1.0)])


DRIVEN = {"crane": crane, "platform": platform, "linkage": linkage}
