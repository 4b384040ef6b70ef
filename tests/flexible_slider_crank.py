"""Slider-crank with an elastic rod of the IVP test set (B. Simeon), with damping, from the published start."""

from functools import cache
from pathlib import Path
from runpy import run_path

import numpy as np
import pinocchio as pin

import mbdae
from mbdae.mechanism.flexible import attach_flexible

CRANK, ROD, SPEED = 0.15, 0.3, 150.0
Q0, V0 = (0.0, 0.0, 1.03339863e-5, 1.69327969e-5), (0.444896105, 4.63434311e-3, -1.78591076e-6, -2.68938672e-6)
rod = run_path(str(Path(__file__).parent.parent / "models" / "flexible_slider_crank" / "rod.py"))["rod"]


@cache
def slider_crank(damping=(0.0,) * 4):
    """Return the mechanism and its start: frame of the rod at the crank pin, crank driven, slider along x."""
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
