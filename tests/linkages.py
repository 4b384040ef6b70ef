"""Planar linkages in the x-z plane, positive angles from x to z, for tests of kinematics."""

import numpy as np
import pinocchio as pin

from mbdae import Closure, Mechanism
from mbdae.mechanism.model_settings import Start


def bar(model, parent, at, length, name, mass=1.0):
    """Add a uniform bar along x, hinged at a point (x, z) of its parent, with the frame ``<name>_tip`` at its end."""
    place = pin.SE3(np.eye(3), np.array([at[0], 0.0, at[1]]))
    joint = model.addJoint(parent, pin.JointModelRevoluteUnaligned(np.array([0.0, -1.0, 0.0])), place, name)
    moments = np.diag([0.01, mass * length**2 / 12, mass * length**2 / 12])
    model.appendBodyToJoint(joint, pin.Inertia(mass, np.array([length / 2, 0, 0]), moments), pin.SE3.Identity())
    point(model, joint, (length, 0.0), f"{name}_tip")
    return joint


def point(model, joint, at, name):
    place = pin.SE3(np.eye(3), np.array([at[0], 0.0, at[1]]))
    model.addFrame(pin.Frame(name, joint, place, pin.FrameType.OP_FRAME))


def four_bar(lengths, start):
    """Return a linkage of crank, coupler, rocker and ground, pinned at the tip of the coupler."""
    crank, coupler, rocker, ground = lengths
    model = pin.Model()
    model.name = "four-bar"
    first = bar(model, 0, (0, 0), crank, "crank")
    bar(model, first, (crank, 0), coupler, "coupler")
    bar(model, 0, (ground, 0), rocker, "rocker")
    pins = [Closure.revolute("coupler_tip", "rocker_tip", axis=(0, 1, 0), name="pin")]
    return Mechanism(model, pins, start=Start(**start))


def parallelogram():
    """Return a linkage with equal cranks of 1 m, and coupler and ground of 2 m."""
    return four_bar((1.0, 2.0, 1.0, 2.0), {"q": {"crank": 1.0}, "guess": {"coupler": -1.0, "rocker": 1.0}})


LINK = {"crank": 1.0, "coupler": 2.0, "rocker": 1.5, "ground": 2.0, "arm": 1.6, "lever": 1.4}
TIP, PIVOT = (1.0, 0.7), (3.2, 1.1)  # third point of the coupler; pivot of the lever


def stephenson():
    """Return a Stephenson III six-bar: a four-bar whose coupler carries a dyad of arm and lever to the ground."""
    model = pin.Model()
    model.name = "Stephenson"
    crank = bar(model, 0, (0, 0), LINK["crank"], "crank")
    coupler = bar(model, crank, (LINK["crank"], 0), LINK["coupler"], "coupler")
    arm = bar(model, coupler, TIP, LINK["arm"], "arm")
    bar(model, 0, (LINK["ground"], 0), LINK["rocker"], "rocker")
    bar(model, 0, PIVOT, LINK["lever"], "lever")
    assert arm
    pins = [Closure.point("coupler_tip", "rocker_tip", name="pin"), Closure.point("arm_tip", "lever_tip", name="joint")]
    return Mechanism(model, pins, start=Start(q={"crank": 1.2}, guess={"coupler": -0.9, "rocker": 1.4, "lever": 2.0}))


def parallelogram_model(joint_kind):
    """Return a crank and a rocker of 1 m, a coupler and a ground of 2 m, with frames "a" and "b" at the cut joint."""
    model, inertia = pin.Model(), pin.Inertia(1.0, np.zeros(3), 0.1 * np.eye(3))
    for name, parent, at in (("crank", 0, 0.0), ("coupler", 1, 1.0), ("rocker", 0, 2.0)):
        joint = model.addJoint(parent, joint_kind(), pin.SE3(np.eye(3), np.array([at, 0, 0])), name)
        model.appendBodyToJoint(joint, inertia, pin.SE3(np.eye(3), np.array([0.5, 0, 0])))
    for name, joint, length in (("a", 2, 2.0), ("b", 3, 1.0)):
        tip = pin.SE3(np.eye(3), np.array([length, 0, 0]))
        model.addFrame(pin.Frame(name, joint, tip, pin.FrameType.OP_FRAME))
    return model
