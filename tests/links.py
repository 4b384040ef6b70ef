"""A link on a hinge with its equation derived by hand, for tests of actuators and controllers."""

import numpy as np
import pinocchio as pin

from mbdae import Mechanism
from mbdae.mechanism.model_settings import Start

M, C, INERTIA = 1.5, 0.4, 0.05  # mass in kg, m to the centre of mass, kg m^2 about the centre of mass
HINGE_INERTIA = INERTIA + M * C * C  # kg m^2 about the hinge


def arm(*forces):
    """Return the link on a hinge about y, with forces; it starts at 0.3 rad and 1 rad/s."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRY(), pin.SE3.Identity(), "arm")
    inertia = pin.Inertia(M, np.array([C, 0, 0]), np.diag([0.01, INERTIA, INERTIA]))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    return Mechanism(model, forces=forces, start=Start(q={"arm": 0.3}, v={"arm": 1.0}))


def hinge(x, tau):
    """Return x'' of the link: a positive angle about y rotates it from x down, towards -z."""
    return (M * 9.81 * C * np.cos(x) + tau) / HINGE_INERTIA
