"""Assumptions of closures beyond their rows: a start that violates them is rejected, a run is reported."""

import numpy as np
import pytest
from bodies import body, load
from numpy import pi

import mbdae
from mbdae import Closure
from mbdae.errors import InputError

UP, AHEAD = [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]


def wheels(folder, closure, axis=UP, xyz=(0.3, 0.0, 0.0), **tables):
    """Wheel a about z in the origin, wheel b about an axis."""
    bodies = [body("a", "continuous", axis=UP), body("b", "continuous", axis=axis, xyz=list(xyz))]
    return load(folder, bodies, [closure], **tables)


GEAR = Closure.gear("a", "b", (0.1, 0.2), name="mesh")
SPIN = {"start": {"v": {"a": 3.0}}}


@pytest.mark.parametrize("axis", [AHEAD, [0.0, 1.0, 1.0]])
def test_a_gear_between_axes_that_are_not_parallel(axis, tmp_path):
    with pytest.raises(InputError, match=r"'mesh': its wheels can rotate about axes that are not .*kind 'bevel'"):
        mbdae.solve(wheels(tmp_path, GEAR, axis, **SPIN), (0, 1))


def test_radii_that_do_not_fit_the_distance(tmp_path):
    with pytest.raises(InputError, match=r"are 0\.3 m apart, but radii of 0\.1 and 0\.3 m require 0\.4 m$"):
        mbdae.solve(wheels(tmp_path, Closure.gear("a", "b", (0.1, 0.3), name="mesh"), **SPIN), (0, 1))
    assert mbdae.solve(wheels(tmp_path, GEAR, **SPIN), (0, 1)).status == "finished"
    with pytest.raises(InputError, match="'mesh': the axes of its wheels coincide"):
        mbdae.solve(wheels(tmp_path, GEAR, xyz=(0.0, 0.0, 0.3), **SPIN), (0, 1))
    with pytest.raises(InputError, match=r"require 0\.2 m \(a belt or chain is a coupling of joints\)$"):
        mbdae.solve(wheels(tmp_path, Closure.gear("a", "b", (0.1, 0.1), name="mesh"), **SPIN), (0, 1))
    ring = Closure.gear("a", "b", (-0.5, 0.2), name="mesh")
    assert mbdae.solve(wheels(tmp_path, ring, xyz=(0.0, 0.3, 0.7), **SPIN), (0, 1)).status == "finished"


def test_every_study_refuses_it(tmp_path):
    mech = wheels(tmp_path, GEAR, AHEAD)
    for study in (mbdae.modes, mbdae.equilibrium, mbdae.linearize, lambda m: m.assemble(v={"a": 1.0})):
        with pytest.raises(InputError, match="closure 'mesh'"):
            study(mech)
    with pytest.raises(InputError, match="closure 'mesh'"):
        mbdae.solve(mech, (0, 1), np.array([1.0, 0.0, 1.0, 0.0]), np.zeros(2))


def test_a_bevel_pair_whose_axes_do_not_meet_or_are_parallel(tmp_path):
    across = Closure.bevel("a", "b", (0.1, 0.2), UP, AHEAD, "mesh")
    with pytest.raises(InputError, match=r"its axes do not intersect: their distance is 0\.2 m"):
        mbdae.solve(wheels(tmp_path, across, AHEAD, (0.3, 0.2, 0.0)), (0, 1))
    with pytest.raises(InputError, match="closure 'mesh': its axes are parallel: use kind 'gear'"):
        mbdae.solve(wheels(tmp_path, Closure.bevel("a", "b", (0.1, 0.2), name="mesh")), (0, 1))
    with pytest.raises(InputError, match="can rotate about an axis that is not in the plane of the given axes"):
        mbdae.solve(wheels(tmp_path, across, [0.0, 1.0, 0.0]), (0, 1))


def test_a_screw_without_a_joint_for_its_turns(tmp_path):
    bodies = [body("arm", "revolute", axis=AHEAD)]
    with pytest.raises(InputError, match="'thread': the bodies can rotate about axes other than the screw axis"):
        mbdae.solve(load(tmp_path, bodies, [Closure.screw("world", "arm", 0.02, name="thread")]), (0, 1))


def test_a_flat_face_that_leans(tmp_path):
    cam = {"kind": "circle", "radius": 0.1, "centre": [0.02, 0.0]}
    bodies = [
        body("cam", "continuous", axis=UP),
        body("face", "prismatic", axis=[0.0, 1.0, 0.0], rpy=[0.3, 0.0, 0.0]),
    ]
    face = Closure.cam("cam", "face", cam, "touch", axis=(0.0, 1.0, 0.0))
    with pytest.raises(InputError, match=r"closure 'touch': its flat face deviates by 0\.2\d* rad"):
        mbdae.solve(load(tmp_path, bodies, [face]), (0, 1))


def test_a_wheel_without_contact_off_its_surface(tmp_path):
    bodies = [
        body("car", "planar", mass=100.0, inertia=20.0),
        body("wheel", "continuous", "car", axis=[0.0, 1.0, 0.0], xyz=[0.0, 0.0, 0.35]),
    ]
    wheel = Closure.rolling("world", "wheel", 0.3, (0.0, 1.0, 0.0), "wheel", contact=False)
    with pytest.raises(InputError, match=r"joints do not keep it on its surface: it is 0\.05 m off"):
        mbdae.solve(load(tmp_path, bodies, [wheel]), (0, 1))


@pytest.mark.parametrize("backend", ["native", "python"])
def test_wheels_that_part_in_a_run(backend, tmp_path):
    """They fit to a thousandth of the radii: |v t| < 3e-4 m."""
    bodies = [
        body("a", "continuous", axis=UP),
        body("slide", "prismatic", axis=AHEAD),
        body("b", "continuous", "slide", axis=UP, xyz=[0.3, 0.0, 0.0]),
    ]
    mech = load(tmp_path, bodies, [GEAR], start={"v": {"slide": 0.01, "a": 1.0}})
    sol = mbdae.solve(mech, (0, 1), max_step=0.01, backend=backend)
    assert sol.status == "doubtful"
    assert "closure 'mesh' does not hold from t = 0.0" in sol.message
    assert "but radii of 0.1 and 0.2 m require 0.3 m" in sol.message
    first = float(sol.message.split("from t = ")[1].split(" s")[0])
    assert 0.03 <= first < 0.041
    assert mbdae.solve(mech, (0, 0.029), max_step=0.01, backend=backend).status == "finished"


def test_axes_that_tilt_in_a_run(tmp_path):
    """A wheel on a ball joint may tilt: this is unknown before the run."""
    bodies = [body("a", "continuous", axis=UP), body("b", "spherical", xyz=[0.3, 0.0, 0.0])]
    mech = load(tmp_path, bodies, [GEAR], start={"v": {"a": 1.0}, "guess_v": {"b": [0.2, 0.0, 0.0]}})
    sol = mbdae.solve(mech, (0, 1))
    assert sol.status == "doubtful"
    assert "closure 'mesh' does not hold from t = " in sol.message
    assert "its axes are not parallel, but at an angle of" in sol.message


def test_the_angle_of_a_bevel_pair_that_changes(tmp_path):
    bodies = [
        body("a", "continuous", axis=UP),
        body("fork", "revolute", axis=[0.0, 1.0, 0.0]),
        body("b", "continuous", "fork", axis=UP, rpy=[0.0, pi / 2, 0.0]),
    ]
    mesh = Closure.bevel("a", "b", (0.1, 0.2), name="mesh")
    mech = load(tmp_path, bodies, [mesh], start={"v": {"fork": 0.1, "a": 1.0}}, gravity=[0.0, 0.0, 0.0])
    sol = mbdae.solve(mech, (0, 1))
    assert sol.status == "doubtful"
    assert "the angle between its axes has changed from 1.571 to 1.5" in sol.message
