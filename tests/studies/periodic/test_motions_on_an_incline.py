"""Motions that advance along inclined ground, or rotate about a vertical other than z: the same as in other frames."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, add_body, empty

import mbdae
from mbdae import Closure, JointDamping, JointTorque, Mechanism, Stop
from mbdae.errors import InputError
from mbdae.mechanism.time_functions.time_functions import Harmonic

TILT, DAMPING, OMEGA, STOP_ANGLE = 0.2, 3.0, 4.0, -0.8
MASS = 2.7  # kg, of cart and pendulum
PUSH = JointTorque(joint="bob", torque=Harmonic(amplitude=1.5, omega=OMEGA))
INCLINED = pin.utils.rotate("y", TILT)


def forces(*joints):
    return [PUSH, JointDamping(joint="bob", damping=0.4), *(JointDamping(joint=j, damping=DAMPING) for j in joints)]


def on_ground(ground, joints, lowest=()):
    """A cart on an inclined plane, free along axes of the world, with a driven pendulum; gravity is along -z."""
    kinds = {"east": pin.JointModelPX(), "north": pin.JointModelPY(), "up": pin.JointModelPZ()}
    model, parent = empty(), 0
    for name in joints:
        parent = add_body(model, parent, kinds[name], name, 2.0 * (name == joints[-1]))
    add_body(model, parent, pin.JointModelRY(), "bob", 0.7, (0, 0, -0.4))
    model.addFrame(pin.Frame("ground", 0, 0, pin.SE3(ground, np.zeros(3)), pin.FrameType.OP_FRAME))
    cart = Closure(kind="in_plane", frames=("ground", joints[-1]), name="cart")
    stops = [Stop(joint="bob", lower=x + TILT, restitution=0.5) for x in lowest]
    return Mechanism(model, [cart], forces(*joints), stops=stops)


def on_rail(lowest=()):
    """The same in axes along the ground: the cart is on a joint, and gravity is turned by the angle of the incline."""
    model = empty()
    model.gravity.linear = G * np.array([np.sin(TILT), 0, -np.cos(TILT)])
    add_body(model, add_body(model, 0, pin.JointModelPX(), "rail", 2.0), pin.JointModelRY(), "bob", 0.7, (0, 0, -0.4))
    return Mechanism(model, forces=forces("rail"), stops=[Stop(joint="bob", lower=x, restitution=0.5) for x in lowest])


@pytest.mark.parametrize("lowest", [(), (STOP_ANGLE,)], ids=["smooth", "impacts"])
def test_an_incline_is_a_symmetry_like_a_rail(lowest):
    """No period, symmetry or start is given. Damping of the cart balances gravity over a period: c x = m g sin(a) T."""
    incline, rail = (mbdae.periodic(mech) for mech in (on_ground(INCLINED, ("east", "up"), lowest), on_rail(lowest)))
    assert (incline.symmetry, rail.symmetry) == (("incline",), ("rail",))
    assert incline.T == rail.T == pytest.approx(2 * np.pi / OMEGA, rel=1e-14)
    assert incline.advances["incline"] == pytest.approx(rail.advances["rail"], rel=1e-9)
    assert incline.advances["incline"] == pytest.approx(MASS * G * np.sin(TILT) / DAMPING * incline.T, rel=1e-9)
    np.testing.assert_allclose(incline.multipliers, rail.multipliers, rtol=0, atol=1e-9)
    assert incline.stability == rail.stability == "stable"
    assert [x.name for x in incline.neutral] == ["incline"]
    assert incline.neutral[0].error < 1e-9
    assert len(incline.run.impacts) == len(rail.run.impacts) == len(lowest)


def test_ground_that_is_inclined_about_two_axes():
    """The cart advances along the line of steepest descent only."""
    ground = pin.utils.rotate("y", TILT) @ pin.utils.rotate("x", 0.3)
    found = mbdae.periodic(on_ground(ground, ("east", "north", "up")))
    assert found.symmetry == ("incline", "level")
    steepest = np.sqrt(1 - ground[2, 2] ** 2)
    assert found.advances["incline"] == pytest.approx(MASS * G * steepest / DAMPING * found.T, rel=1e-9)
    assert found.advances["level"] == pytest.approx(0, abs=1e-10)
    assert max(x.error for x in found.neutral) < 1e-9


def spherical_pendulum(axis):
    """A spherical pendulum and its initial state; gravity is along the negative third axis."""
    model = empty()
    model.gravity.linear = -G * axis[:, 2]
    add_body(model, 0, pin.JointModelSpherical(), "hook", 1.0, (0, 0, -1.0), (0.1, 0.1, 0.05))
    body = axis @ pin.utils.rotate("y", 0.6)
    return Mechanism(model), pin.Quaternion(body).coeffs(), body.T @ axis @ np.array([0.3, 0.5, 2.5])


def test_a_turn_is_about_the_vertical_of_gravity():
    """A spherical pendulum does the same whatever the axes of the world: "turn" is found.

    Periodic motions form a family in energy and angular momentum: which member Newton's method reaches depends on the
    coordinates and on rounding.
    """
    axes = np.eye(3), pin.utils.rotate("y", 0.4) @ pin.utils.rotate("x", -0.7)
    upright, tilted = (mbdae.periodic(mech, 1.0, q=q, v=v, rtol=1e-11) for mech, q, v in map(spherical_pendulum, axes))
    assert upright.symmetry == tilted.symmetry == ("turn",)
    assert pytest.approx(upright.T, rel=1e-5) == tilted.T
    assert abs(upright.advances["turn"]) > 1
    assert tilted.advances["turn"] == pytest.approx(upright.advances["turn"], rel=1e-5)
    assert [x.name for x in tilted.neutral] == ["time", "turn", "energy"]
    np.testing.assert_allclose(tilted.multipliers, upright.multipliers, rtol=0, atol=1e-5)
    (circle,) = upright.plot().axes  # a ball has no phase plane
    assert circle.get_xlabel() == r"Re $\mu$"


def test_ground_whose_inclination_is_the_parameter():
    """The direction of a motion may not change along a branch; that of gravity may."""

    def make(tilt):
        return on_ground(pin.utils.rotate("y", tilt), ("east", "up"))

    with pytest.raises(InputError, match=r"^symmetry 'incline' turns with 'tilt': turn gravity instead of the ground$"):
        mbdae.periodic_branch(make, "tilt", 0.2, 0.25)


def test_level_ground_has_no_incline():
    with pytest.raises(InputError, match=r"^symmetry 'incline': .* is not on an incline$"):
        mbdae.periodic(on_ground(np.eye(3), ("east", "up")), symmetry=["incline"])
