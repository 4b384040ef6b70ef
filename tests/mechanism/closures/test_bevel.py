"""Bevel pairs against closed forms: wheels on fixed axes at any angle, and the differential of a car."""

import numpy as np
import pytest
from bodies import body, load
from numpy import pi

import mbdae
from mbdae import Closure

BACKENDS = ["native", "python"]
IA, IB, TORQUE = 0.3, 0.5, 2.0


def pair(folder, angle, radii, along=0.0):
    """Wheel a about z, wheel b about an axis at an angle from z in the plane of x and z, a frame ``along`` its axis."""
    bodies = [
        body("a", "continuous", inertia=IA, axis=[0.0, 0.0, 1.0]),
        body("b", "continuous", inertia=IB, axis=[0.0, 0.0, 1.0], rpy=[0.0, angle, 0.0]),
    ]
    frame = {"name": "hub", "parent": "b", "xyz": [0.0, 0.0, along]}
    force = {"kind": "joint_torque", "joint": "a", "torque": TORQUE}
    return load(folder, bodies, [Closure.bevel("a", "hub", radii, name="mesh")], frame=[frame], force=[force])


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    ("angle", "radii", "along"), [(pi / 2, (0.1, 0.2), 0.4), (1.0, (0.3, 0.2), 0.0), (2.2, (0.1, -0.3), -1.0)]
)
def test_wheels_turn_as_their_radii_say(angle, radii, along, backend, tmp_path):
    """r_a w_a + r_b w_b = 0; w_a' = torque/(I_a + I_b (r_a/r_b)^2), and a tangential force I_b w_a' r_a/r_b^2."""
    sol = mbdae.solve(pair(tmp_path, angle, radii, along), (0, 3), rtol=1e-9, backend=backend)
    (ra, rb), speed_up = radii, TORQUE / (IA + IB * (radii[0] / radii[1]) ** 2)
    assert sol.status == "finished"
    np.testing.assert_allclose(sol.v[:, 0], speed_up * sol.t, atol=1e-9)
    np.testing.assert_allclose(sol.v[:, 1], -ra / rb * sol.v[:, 0], atol=1e-11)
    np.testing.assert_allclose(np.abs(sol.lam[:, 0]), abs(IB * speed_up * ra / rb**2), rtol=1e-9)


def test_the_line_of_the_tangential_force(tmp_path):
    """It goes through the common point of both pitch circles: (r_a, 0, r_b) between z and x."""
    mech = pair(tmp_path, pi / 2, (0.1, 0.2), -0.4)
    system, (q, _) = mech.system(), mech.start
    system.jacobian(q)
    w = system.constraints.W[:, 0]
    np.testing.assert_allclose(w[:3], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(np.cross(w[:3], w[3:]), [0.1, 0, 0.2], atol=1e-15)  # its point nearest to the origin


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_differential(backend, tmp_path):
    """w_left + w_right = 2 w_cage, and the torque of the cage is split: (I + I_c/4) w' as for two free speeds."""
    left, right, cage, planet, torque = 0.2, 0.7, 0.4, 0.05, 3.0
    hinge = {"joint": "continuous", "axis": [0.0, 1.0, 0.0]}
    bodies = [
        body("left", inertia=left, **hinge),
        body("right", inertia=right, **hinge),
        body("cage", inertia=cage, **hinge),
        body("planet", "continuous", "cage", 1e-9, [planet, 1e-9, 1e-9, 0, 0, 0], axis=[1.0, 0.0, 0.0]),
    ]
    closures = [
        Closure.bevel("left", "planet", (0.1, 0.05), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0), "left mesh"),
        Closure.bevel("right", "planet", (0.1, 0.05), (0.0, -1.0, 0.0), (1.0, 0.0, 0.0), "right mesh"),
    ]
    force = {"kind": "joint_torque", "joint": "cage", "torque": torque}
    mech = load(tmp_path, bodies, closures, force=[force], start={"v": {"left": 1.0, "right": -2.0}})
    sol = mbdae.solve(mech, (0, 2), rtol=1e-9, backend=backend)
    # planet: w_p = (w_right - w_left) r_side/(2 r_planet) = w_right - w_left
    M = np.array([[left + cage / 4 + planet, cage / 4 - planet], [cage / 4 - planet, right + cage / 4 + planet]])
    v = np.array([1.0, -2.0]) + np.outer(sol.t, np.linalg.solve(M, [torque / 2, torque / 2]))
    np.testing.assert_allclose(sol.v[:, :2], v, atol=1e-6)
    np.testing.assert_allclose(sol.v[:, 2], v.mean(axis=1), atol=1e-6)
    np.testing.assert_allclose(sol.v[:, 0] + sol.v[:, 1], 2 * sol.v[:, 2], atol=1e-11)


def test_a_pair_on_a_carrier_that_tumbles(tmp_path):
    """Only rotations relative to the carrier count, and energy is conserved."""
    spin = [0.3, -0.2, 0.5]
    bodies = [
        body("frame", "spherical", inertia=[0.9, 0.7, 0.8, 0.0, 0.0, 0.0]),
        body("a", "continuous", "frame", inertia=IA, axis=[0.0, 0.0, 1.0], xyz=[0.0, 0.0, 0.2]),
        body("b", "continuous", "frame", inertia=IB, axis=[0.0, 0.0, 1.0], rpy=[0.0, 1.2, 0.0]),
    ]
    mech = load(tmp_path, bodies, [Closure.bevel("a", "b", (0.1, 0.2))], start={"v": {"frame": spin, "a": 4.0}})
    sol = mbdae.solve(mech, (0, 4), rtol=1e-9)
    assert sol.status == "finished"
    np.testing.assert_allclose(0.1 * sol.v[:, 3] + 0.2 * sol.v[:, 4], 0, atol=1e-11)
    assert abs(mbdae.drift(sol).energy_relative) < 1e-7
