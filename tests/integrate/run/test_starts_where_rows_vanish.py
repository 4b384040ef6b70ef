"""Starts where all rows of the closures vanish, and rows that vanish everywhere."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae


def arm(plane=None, gravity=0.0):
    """Two bars of 1 m in the x-z plane, whose tip stays in a plane through the first hinge, normal to x or to y.

    Folded, q = (a, pi), the tip is at the hinge, and the bars turn as one; G = (0, sin a) for the plane normal to x.
    """
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    inertia = pin.Inertia(1.0, np.array([0.5, 0.0, 0.0]), 0.1 * np.eye(3))
    for name, parent, at in (("upper", 0, 0.0), ("lower", 1, 1.0)):
        joint = model.addJoint(parent, pin.JointModelRY(), pin.SE3(np.eye(3), np.array([at, 0, 0])), name)
        model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    model.addFrame(pin.Frame("tip", 2, pin.SE3(np.eye(3), np.array([1.0, 0, 0])), pin.FrameType.OP_FRAME))
    normal = [0, 0, 1, 0, 1, 0, -1, 0, 0] if plane == "x" else [1, 0, 0, 0, 0, 1, 0, -1, 0]
    wall = pin.SE3(np.array(normal, float).reshape(3, 3), np.zeros(3))
    model.addFrame(pin.Frame("wall", 0, wall, pin.FrameType.OP_FRAME))
    closures = [mbdae.Closure(kind="in_plane", frames=("wall", "tip"), name="guide")] if plane else []
    return mbdae.Mechanism(model, closures)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("options", [{}, {"formulation": "ggl"}, {"method": "radau5"}, {"step": 0.01}], ids=str)
@pytest.mark.parametrize("v", [(0.0, 0.0), (1.0, -2.0)])
@pytest.mark.parametrize("away", [0.0, 1e-7])
def test_a_start_where_the_only_row_vanishes_is_rejected(away, v, options):
    """Both v are compatible with the closure there: the motion may continue on either branch."""
    sol = mbdae.solve(arm("x"), (0, 1), np.array([away, np.pi]), np.array(v), **options)
    assert (sol.status, sol.t[-1]) == ("rank", 0.0)
    assert "singular configuration, at t = 0, where G v = 0 for every v (rows of 'guide'): begin at" in sol.message


@pytest.mark.usefixtures("back_end")
def test_a_start_at_a_distance_keeps_its_branch():
    """Without gravity the folded bars turn at a constant rate, and the guide carries no force."""
    sol = mbdae.solve(arm("x"), (0, 2), np.array([0.01, np.pi]), np.array([1.0, 0.0]))
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.q[-1], [2.01, np.pi], atol=1e-8)
    np.testing.assert_allclose(sol.lam, 0.0, atol=1e-8)


@pytest.mark.usefixtures("back_end")
def test_rows_that_vanish_everywhere_are_redundant():
    """The plane of the bars' own motion does not act on them."""
    start = np.array([0.3, 0.4]), np.array([1.0, -2.0])
    sol = mbdae.solve(arm("y", gravity=9.81), (0, 1), *start, rtol=1e-8)
    free = mbdae.solve(arm(gravity=9.81), (0, 1), *start, rtol=1e-8)
    assert sol.success, sol.message
    np.testing.assert_allclose(sol.q[-1], free.q[-1], atol=1e-7)
    np.testing.assert_allclose(sol.lam, 0.0, atol=1e-9)
