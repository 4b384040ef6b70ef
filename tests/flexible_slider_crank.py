"""Slider-crank with an elastic rod of the IVP test set (B. Simeon), with its data as they are.

Quirks that are kept: pi = 3.1415927, masses of the longitudinal modes rho b h L (8, 1; 1, 2) without 1/15, no factor
of Poisson. The published start is rounded to nine digits, so the loop is closed first.
"""

from functools import cache

import numpy as np
import pinocchio as pin
from scipy.linalg import eigh

import mbdae
from mbdae.mechanism.flexible import ModalBody, attach_flexible
from mbdae.mechanism.flexible.modal_body import Node

PI, CRANK, ROD, SPEED = 3.1415927, 0.15, 0.3, 150.0
WIDTH, DENSITY, MODULUS = 0.008, 7870.0, 0.2e12
Q0, V0 = (0.0, 0.0, 1.03339863e-5, 1.69327969e-5), (0.444896105, 4.63434311e-3, -1.78591076e-6, -2.68938672e-6)


def rod(damping):
    """The rod in its eigenmodes, and the matrix T of q = T eta: sines, and longitudinal 4 x (1 - x), x (2 x - 1)."""
    m, k = DENSITY * WIDTH**2 * ROD, MODULUS * WIDTH**2 / ROD
    bend = k * PI**4 / 24 * (WIDTH / ROD) ** 2
    M = m * np.array([[0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 8, 1], [0, 0, 1, 2]])
    K = np.diag([bend, 16 * bend, 0, 0])
    K[2:, 2:] = k / 3 * np.array([[16, -8], [-8, 7]])
    C, H0, cross = np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((4, 3, 4))
    C[0], C[1] = m * np.array([0, 0, 2 / 3, 1 / 6]), m * np.array([2 / PI, 0, 0, 0])
    H0[2] = m * ROD * np.array([1 / PI, -0.5 / PI, 0, 0])
    for (i, j), value in {(0, 2): -16 / PI**3, (0, 3): 8 / PI**3 - 1 / PI, (1, 3): 0.5 / PI}.items():
        cross[i, 2, j], cross[j, 2, i] = m * value, -m * value
    about_z = np.diag([0.0, 0.0, 1.0])
    I1 = np.multiply.outer(2 * m * ROD * np.array([0, 0, 1 / 3, 1 / 6]), about_z)
    I2 = np.multiply.outer(2 * M, about_z)
    squares, T = eigh(K, M)
    end = Node(np.array([ROD, 0, 0]), np.array([[0, 0, 0, 1.0], [0] * 4, [0] * 4]) @ T, np.zeros((3, 4)))
    mass, inertia = 0.151104, 0.0045339259
    body = ModalBody(
        mass, mass * np.array([ROD / 2, 0, 0]), inertia * np.diag([0.0, 1, 1]), C @ T, H0 @ T, T.T @ M @ T,
        np.einsum("iaj,il,jm->lam", cross, T, T), np.einsum("iab,il->lab", I1, T),
        np.einsum("ijab,il,jm->lmab", I2, T, T), squares, 2 * np.array(damping) * np.sqrt(squares), {"pin": end},
    )  # fmt: skip
    return body, T


@cache
def slider_crank(damping=(0.0,) * 4):
    """The mechanism and its start: frame of the rod at the crank pin, crank driven, slider along x."""
    model, (body, T) = pin.Model(), rod(damping)
    model.gravity.linear = np.zeros(3)
    crank = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "crank")
    model.appendBodyToJoint(crank, pin.Inertia(0.36, np.zeros(3), 0.002727 * np.diag([0.0, 0, 1])), pin.SE3.Identity())
    attach_flexible(model, "rod", body, pin.JointModelRZ(), crank, pin.SE3(np.eye(3), np.array([CRANK, 0, 0])))
    slider = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "slider")
    model.appendBodyToJoint(slider, pin.Inertia(0.075552, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    model.addFrame(pin.Frame("slider", slider, pin.SE3.Identity(), pin.FrameType.BODY))
    drive = mbdae.Driver(joint="crank", speed=SPEED)
    mech = mbdae.Mechanism(model, [mbdae.Closure.point("rod.pin", "slider")], drivers=[drive])
    q = dict(zip(mech.joint_names[2:6], np.linalg.solve(T, Q0), strict=True))
    v = dict(zip(mech.joint_names[2:6], np.linalg.solve(T, V0), strict=True))
    return mech, T, *mech.assemble({"crank": 0.0, **q}, {"crank": SPEED, **v}, guess={"slider": CRANK + ROD})
