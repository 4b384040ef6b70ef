"""Cams and slots: methods keep their order with curves through points; impossible contacts are rejected by name."""

from math import cos, sin

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import mbdae
from mbdae import Closure
from mbdae.errors import InputError, StepError

ROUND = [(0.04 * cos(s), 0.03 * sin(s) - 0.002 * cos(2 * s)) for s in np.arange(8) * np.pi / 4]


def cam_and_follower(closure):
    """A cam about y, whose profile is vertical, and a follower along z."""
    model, upright = pin.Model(), pin.SE3(pin.exp3(np.array([np.pi / 2, 0, 0])), np.zeros(3))
    cam = model.addJoint(0, pin.JointModelRZ(), upright, "cam")
    model.appendBodyToJoint(cam, pin.Inertia(0.3, np.array([0.01, 0, 0]), 1e-3 * np.eye(3)), pin.SE3.Identity())
    up = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "follower")
    model.appendBodyToJoint(up, pin.Inertia(0.2, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    for joint in (cam, up):
        model.addJointFrame(joint)
    return mbdae.Mechanism(model, [closure])


@pytest.mark.native
@pytest.mark.parametrize(("method", "order", "steps"), [("pherk5", 5, (50, 200)), ("pherk6", 6, (25, 100))])
def test_a_profile_through_points_keeps_the_order(method, order, steps):
    mech = cam_and_follower(Closure.cam("cam", "follower", {"kind": "points", "points": ROUND}, radius=0.01))
    q, v = mech.assemble({"cam": 0.0}, {"cam": 10.0}, guess={"follower": 0.04})

    def end(method, n):
        sol = mbdae.solve(mech, (0, 0.5), q, v, method=method, step=0.5 / n, project=False)
        return np.concatenate([sol.q[-1], sol.v[-1]])

    reference = end("herk5", 4000)
    errors = [np.abs(end(method, n) - reference).max() for n in steps]
    assert (
        np.log2(errors[0] / errors[1]) / 2 > order - 0.5
    )  # as on an exact circle at these steps; cubic splines reach 3


def test_undercut_is_rejected():
    hollow = {"kind": "fourier", "x": (0, 1, 0, 0, 0, 0.2, 0), "y": (0, 0, 1, 0, 0, 0, -0.2)}
    with pytest.raises(InputError, match=r"undercut: the profile is concave at .* with a radius of 3\.2 m"):
        Closure.cam("cam", "follower", hollow, radius=4.0)
    with pytest.raises(InputError, match=r"not convex at .* a flat face does not touch it there"):
        Closure.cam("cam", "follower", hollow, axis=(0, 0, 1))
    with pytest.raises(InputError, match="the profile of a cam is closed"):
        Closure.cam("cam", "follower", {"kind": "points", "points": ROUND, "closed": False}, radius=0.01)
    with pytest.raises(InputError, match="needs one of radius, of its roller, and axis"):
        Closure.cam("cam", "follower", {"kind": "circle", "radius": 1.0})


@pytest.mark.usefixtures("back_end")
def test_a_centre_of_curvature_is_named_and_steps_past_it_are_shortened():
    """An eccentric circular groove: the midpoint of such a long step is in its centre, where no point is nearest."""
    R, e, turn = 0.04, 0.03, 10.0
    groove = Closure.slot("cam", "follower", {"kind": "fourier", "x": (e, R, 0.0), "y": (0.0, 0.0, R)}, name="groove")
    mech = cam_and_follower(groove)
    for ask in (mech.residual, lambda *at: mbdae.solve(mech, (0, 1), *at)):
        with pytest.raises(StepError, match=r"'groove': the contact is at a centre of curvature .*undercut"):
            ask(np.array([np.pi / 2, e]), np.zeros(2))

    def lift(p):
        root = np.sqrt(R**2 - e**2 * np.cos(p) ** 2)
        return e * np.sin(p) + root, e * np.cos(p) + e**2 * np.sin(p) * np.cos(p) / root

    start = brentq(lambda p: lift(p)[0] + lift(p)[1] * (np.pi / 2 - p) - e, -np.pi / 2, 0.0, xtol=1e-15)
    step, (z, rise) = 2 * (np.pi / 2 - start) / turn, lift(start)
    q, v = np.array([start, z]), np.array([turn, turn * rise])
    assert (q + step / 2 * v) == pytest.approx([np.pi / 2, e], abs=1e-14)
    sol = mbdae.solve(mech, (0, 2 * step), q, v, method="herk2", step=step, project=False)
    assert np.diff(sol.t)[0] < 0.9 * step


def test_a_slot_ends():
    line = {"kind": "points", "points": [(0.0, 0.01 * k) for k in range(5)], "closed": False}
    mech = cam_and_follower(Closure.slot("cam", "follower", line, name="groove"))
    assert mech.residual(np.array([0.1, 0.02]), np.zeros(2))[0] == pytest.approx([0.02 * sin(0.1)])
    with pytest.raises(StepError, match="closure 'groove': the pin leaves the slot at its end"):
        mech.residual(np.array([0.0, 0.06]), np.zeros(2))


def test_laws_are_rejected_where_they_are_not_defined():
    model = pin.Model()
    for name, joint in (("wheel", pin.JointModelRUBZ()), ("slide", pin.JointModelPX())):
        number = model.addJoint(0, joint, pin.SE3.Identity(), name)
        model.appendBodyToJoint(number, pin.Inertia.Random(), pin.SE3.Identity())
    points = [(0.0, 0.0), (1.0, 0.1), (2.0, 0.0), (3.0, 0.0)]
    for periodic, what in ((False, "is not periodic"), (True, "does not repeat itself in a revolution")):
        law = Closure.law("slide", "wheel", {"kind": "table", "points": points, "periodic": periodic}, name="cam")
        with pytest.raises(InputError, match=f"'cam': a curve that {what}"):
            mbdae.Mechanism(model, [law]).system()
