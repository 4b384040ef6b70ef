"""The arclength of curves of poses, against integrals of closed forms, and the motion along it."""

import numpy as np
import pytest
from scipy.integrate import quad

import mbdae
from mbdae import kinematics

SHAFTS = np.radians(50)  # the angle between the shafts of a universal joint


def universal_joint():
    shaft = {"parent": "world", "joint": "continuous", "axis": [0, 0, 1], "inertia": [1e-2, 1e-2, 1e-2, 0, 0, 0]}
    cross = {"kind": "universal", "frames": ["in", "out"], "axis": [1, 0, 0], "second_axis": [0, 1, 0]}
    bodies = [shaft | {"name": "in"}, shaft | {"name": "out", "rpy": [0, float(SHAFTS), 0]}]
    return mbdae.load({"gravity": [0, 0, 0], "body": bodies, "closure": [cross]})


def ratio(u):
    """Speed of the driven shaft per speed of the driving one, whose cross begins in the plane of the shafts."""
    return np.cos(SHAFTS) / (1 - (np.sin(SHAFTS) * np.cos(u)) ** 2)


@pytest.mark.parametrize("points", [7, 181])
def test_arclength_is_the_integral_of_the_speeds(points):
    found = kinematics(universal_joint(), "in", points=points)
    np.testing.assert_allclose(found.ratio("out"), ratio(found.u), rtol=1e-12)
    steps = [quad(lambda u: np.hypot(1, ratio(u)), *ends)[0] for ends in zip(found.u, found.u[1:], strict=False)]
    np.testing.assert_allclose(np.diff(found.s), steps, rtol=2e-4)
    np.testing.assert_allclose(found.s[-1], sum(steps), rtol=2e-5)


@pytest.mark.parametrize("drive", ["crank", "slider"])
def test_arclength_passes_dead_points_without_a_jump(drive):
    found = kinematics("slider_crank", drive)
    scales = [1, 1, found.mechanism.characteristic_length]
    chords = np.linalg.norm(np.diff(found.q, axis=0) / scales, axis=1)
    np.testing.assert_allclose(np.diff(found.s), chords, rtol=2e-3)


def test_velocities_along_a_curve_are_those_of_its_positions():
    run, h = kinematics("four_bar", "crank").run(), 1e-4
    for t in np.linspace(0.1, 0.9, 201) * run.t[-1]:
        before, here, after = (run(x) for x in (t - h, t, t + h))
        derivative = (after.q[2] - before.q[2]) / (2 * h)  # of the rocker
        assert abs(derivative - here.v[2]) < 2e-4
        assert abs(np.linalg.norm(here.v) - 1) < 6e-4  # the arclength increases by one per second


def test_a_branch_on_which_the_drive_rests_has_equidistant_poses():
    found = kinematics("n_four_bar?N=1", "crank_0", branches=True, points=41)  # a rhombus: folded bars turn as one
    folded = [x for x in found.segments if x.high - x.low < 1e-9]
    assert len(folded) == 2
    for x in folded:
        turned = found.q[x.first + 1 : x.last] - found.q[x.first + 1]  # the first pose is the branch point
        assert len(turned) == 41
        expected = np.linspace(0, turned[-1, 1], 41)
        np.testing.assert_allclose(turned, np.column_stack([0 * expected, expected, expected]), atol=1e-9)
        assert abs(abs(turned[-1, 1]) - 2 * np.pi) < 0.03  # up to the step off the branch point
    assert found.dead_points == ()  # the crank does not reverse
    assert ": 42 poses, input 0 to 0, " in str(found)
