"""Friction proportional to closure forces: closed forms, a second formulation, orders, and wedging."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import mbdae
from mbdae import Closure, CoulombFriction, Mechanism
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.closures.profiles import CircleProfile

R, M, MU, SPEED, GRAVITY = 0.5, 0.3, 0.3, 4.0, 9.81
SHARP = 1e-9  # m/s: the friction has its full value at all speeds that occur


def planar_body(joints="xy", com=(0.0, 0.0, 0.0)):
    """A body that moves in a vertical plane, x ahead and y up: slides x and y, and a turn z."""
    model, parent = pin.Model(), 0
    model.gravity.linear = np.array([0, -GRAVITY, 0])
    for name in joints:
        kind = {"x": pin.JointModelPX, "y": pin.JointModelPY, "z": pin.JointModelRZ}[name]()
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name)
    inertia = pin.Inertia(M, np.array(com), np.diag([1e-3, 1e-3, 2e-3]))
    model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    model.addBodyFrame("body", parent, pin.SE3.Identity(), 0)
    return model


def bead(velocity=SHARP, coefficient=MU):
    wire = Closure.slot("world", "body", CircleProfile(radius=R), name="wire")
    friction = CoulombFriction(closure="wire", coefficient=coefficient, velocity=velocity)
    return Mechanism(planar_body(), closures=[wire], forces=[friction])


def slide(method="pherk6", T=0.2, **how):
    return mbdae.solve(bead(), (0, T), np.array([0, -R]), np.array([SPEED, 0]), method=method, **how)


def squared_speed(angle):
    """d(v^2)/da + 2 mu v^2 = -2 g R (sin a + mu cos a), while the wire presses inwards."""
    A, B = np.linalg.solve([[2 * MU, -1], [1, 2 * MU]], [-2 * GRAVITY * R, -2 * GRAVITY * R * MU])
    return (SPEED**2 - B) * np.exp(-2 * MU * angle) + A * np.sin(angle) + B * np.cos(angle)


@pytest.mark.parametrize(("method", "within"), [("pherk6", 1e-12), ("radau5", 1e-8)])
def test_a_bead_on_a_wire_is_braked_by_its_normal_force(method, within):
    sol = slide(method, rtol=1e-13 if method == "pherk6" else 1e-8)
    angle = np.arctan2(sol.q[:, 0], -sol.q[:, 1])
    assert sol.success
    assert angle[-1] > 1
    np.testing.assert_allclose((sol.v**2).sum(axis=1), squared_speed(angle), atol=within)
    assert mbdae.drift(sol).energy_relative < within


def test_methods_have_their_general_order():
    reference = slide(rtol=1e-13)
    for method, order in {"herk3": 3, "pherk4": 4, "herk5": 5, "radau5": 5}.items():
        errors = []
        for n in (20, 40):
            end = slide(method, step=0.2 / n)
            errors.append(np.abs(np.r_[end.q[-1] - reference.q[-1], end.v[-1] - reference.v[-1]]).max())
        assert np.log2(errors[-2] / errors[-1]) > order - 0.2, (method, errors)


def test_the_order_of_pherk5_shows_after_a_sign_change_of_its_error():
    """Its leading error is so small that the next one dominates large steps: observed orders are irregular there."""
    reference = slide(rtol=1e-13)
    errors = {n: slide("pherk5", step=0.2 / n).v[-1, 1] - reference.v[-1, 1] for n in (10, 20, 80, 160)}
    assert errors[10] > 0 > errors[20]
    assert np.log2(errors[80] / errors[160]) > 4.8, errors


@pytest.mark.parametrize("kind", ["point", "revolute"])
def test_a_pendulum_in_a_bearing_with_friction(kind):
    """I a'' = -m g L sin a - mu r |F| sign a', where F, of the bearing, depends on a'': solved at each point."""
    L, mu, r, v0 = 0.4, 0.3, 0.2, 5.0
    model = planar_body("xyz", com=(0.0, -L, 0.0))
    pivot = Closure(kind=kind, frames=("world", "body"), name="pivot")
    mech = Mechanism(model, [pivot], [CoulombFriction(closure="pivot", coefficient=mu, radius=r, velocity=SHARP)])
    sol = mbdae.solve(mech, (0, 0.15), np.zeros(3), np.array([0, 0, v0]), rtol=1e-12)
    inertia = 2e-3 + M * L * L

    def rate(t, y):
        a, v = y

        def miss(acc):
            across, along = M * (L * acc + GRAVITY * np.sin(a)), M * (L * v**2 + GRAVITY * np.cos(a))
            return inertia * acc + M * GRAVITY * L * np.sin(a) + mu * r * np.hypot(across, along) * np.sign(v)

        return v, brentq(miss, -1e3, 1e3, xtol=1e-14, rtol=1e-15)

    end = solve_ivp(rate, (0, 0.15), [0, v0], "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    np.testing.assert_allclose([sol.q[-1, 2], sol.v[-1, 2]], end, atol=1e-9)
    assert mbdae.drift(sol).energy_relative < 1e-11


def test_friction_that_wedges_is_named():
    """A lever dragged over the ground, its end ahead of its pivot: with mu tan a >= 1 it wedges."""
    model = planar_body("xz", com=(0.5, -0.5, 0.0))
    model.addBodyFrame("tip", 2, pin.SE3(np.eye(3), np.array([0.5, -0.5, 0.0])), 0)
    model.addBodyFrame("floor", 0, pin.SE3(np.eye(3), np.array([0, -0.5, 0])), 0)
    model.inertias[1] = pin.Inertia(1e3, np.zeros(3), np.eye(3))
    for mu, status in ((0.9, "finished"), (1.2, "friction")):
        ground = Closure.in_plane("floor", "tip", axis=(0, 1, 0), name="ground")
        friction = CoulombFriction(closure="ground", coefficient=mu, velocity=SHARP)
        mech = Mechanism(model, [ground], [friction])
        sol = mbdae.solve(mech, (0, 1e-3), np.zeros(2), np.array([1.0, 0]))
        assert sol.status == status, sol.message
    assert "friction jams closure 'ground'" in sol.message


def test_wrong_friction_is_rejected():
    slot, point = Closure.slot("world", "body", CircleProfile(radius=R), name="wire"), Closure.point("world", "body")
    with pytest.raises(UnknownNameError, match=r"unknown closure 'wore' .did you mean 'wire'"):
        Mechanism(planar_body(), [slot], [CoulombFriction(closure="wore", coefficient=0.1)])
    with pytest.raises(InputError, match="closure 'world-body' needs the radius of its bearing"):
        Mechanism(planar_body(), [point], [CoulombFriction(closure="world-body", coefficient=0.1)])
    with pytest.raises(InputError, match="closure 'wire' slides: radius does not belong to it"):
        Mechanism(planar_body(), [slot], [CoulombFriction(closure="wire", coefficient=0.1, radius=0.1)])
    away = Closure.distance("world", "body", 1.0, name="away")
    with pytest.raises(InputError, match=r"is for closures of kind cyl.* revolute, .*; 'away' is of another kind"):
        Mechanism(planar_body(), [away], [CoulombFriction(closure="away", coefficient=0.1)])
    friction = CoulombFriction(closure="pin", coefficient=0.1, radius=0.1)
    with pytest.raises(InputError, match="a linearization does not support coulomb_friction, of closure 'pin'"):
        mbdae.modes(mbdae.load("four_bar", forces=[friction]))
