"""Derivatives of runs with friction proportional to closure forces, which depends on multipliers."""

from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from frozen import assert_derivative, compare

import mbdae
from mbdae import Closure, CoulombFriction, Mechanism
from mbdae.mechanism.closures.profiles import CircleProfile
from mbdae.studies.factories import factory_of


def planar_body(joints):
    model, parent = pin.Model(), 0
    model.gravity.linear = np.array([0, -9.81, 0])
    for name in joints:
        kind = {"x": pin.JointModelPX(), "y": pin.JointModelPY(), "z": pin.JointModelRZ()}[name]
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), name)
    inertia = pin.Inertia(0.3, np.array([0.1, -0.3, 0]), np.diag([1e-3, 1e-3, 2e-3]))
    model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    model.addBodyFrame("body", parent, pin.SE3.Identity(), 0)
    return model


def bead(coefficient=0.3, velocity=0.5):
    wire = Closure.slot("world", "body", CircleProfile(radius=0.5), name="wire")
    friction = CoulombFriction(closure="wire", coefficient=coefficient, velocity=velocity)
    return Mechanism(planar_body("xy"), [wire], [friction]), np.array([0, -0.5]), np.array([1.0, 0])


def bearing(kind):
    def made(coefficient=0.3, velocity=0.5):
        pivot = Closure(kind=kind, frames=("world", "body"), name="pivot")
        friction = CoulombFriction(closure="pivot", coefficient=coefficient, radius=0.2, velocity=velocity)
        return Mechanism(planar_body("xyz"), [pivot], [friction]), np.zeros(3), np.array([0, 0, 2.0])

    return made


def guided(coefficient=0.3, velocity=0.5):
    rail = Closure(kind="prismatic", frames=("world", "body"), axis=(1, 0, 0), name="rail")
    friction = CoulombFriction(closure="rail", coefficient=coefficient, velocity=velocity)
    return Mechanism(planar_body("xyz"), [rail], [friction]), np.zeros(3), np.array([0.4, 0, 0])


def laid(coefficient=0.3, velocity=0.5):
    floor = Closure.in_plane("world", "body", axis=(0, 1, 0), name="floor")
    friction = CoulombFriction(closure="floor", coefficient=coefficient, velocity=velocity)
    return Mechanism(planar_body("xyz"), [floor], [friction]), np.array([0, 0, 0.2]), np.array([0.4, 0, 1.0])


MADE = {"bead": bead, "in_plane": laid, "point": bearing("point"), "revolute": bearing("revolute"), "prismatic": guided}


def columns(sol, names):
    return np.array([*sol.signals(names).values()])


@pytest.mark.slow
@pytest.mark.parametrize("kind", MADE)
def test_every_kind_of_friction_interface(kind):
    values = {"coefficient": 0.3, "velocity": 0.5}

    @cache
    def run(faster=0.0, **changed):
        mech, q, v = MADE[kind](**(values | changed))
        return mbdae.solve(mech, (0, 0.15), q, v * (1 + faster), step=0.03, method="pherk5")

    sol, v = run(), MADE[kind]()[2]
    nv = len(v)
    found = mbdae.sensitivity(sol, values, model=lambda **x: MADE[kind](**x)[0], start=True)
    for i, (name, value) in enumerate(values.items()):
        assert_derivative(
            found.dy[..., i], lambda x, name=name: run(**{name: x}).y, value, 1e-10, mech=sol.mechanism, what=name
        )
        assert np.abs(found.v[-1, :, i]).max() > 1e-3, name
    along = found.dy[..., 2 + nv : 2 + 2 * nv] @ v
    assert_derivative(along, lambda x: run(faster=x).y, 0.0, 1e-10, mech=sol.mechanism)
    assert_derivative(found.lam[..., 0], lambda x: run(coefficient=x).lam, 0.3, 1e-10)
    closure = sol.mechanism.closures[0].name
    signals = f"force.{closure}", f"force.{closure}.x", f"torque.{closure}.z", "force.x.2", "torque.y"
    loads = np.array([found.signal(signal) for signal in signals])
    for i, (name, value) in enumerate(values.items()):
        assert_derivative(
            loads[..., i], lambda x, name=name: columns(run(**{name: x}), signals), value, 1e-9, what=name
        )
    compare(sol, values, ["v.x", "work", f"force.{closure}.x"], model=lambda **x: MADE[kind](**x)[0])


@pytest.mark.parametrize("kind", ["bead", "in_plane", "revolute"])
@pytest.mark.parametrize(
    "options",
    [{"method": "pherk5", "formulation": "ggl"}, {"method": "radau5"}, {"method": "radau5", "formulation": "ggl"}],
)
def test_other_methods_and_the_ggl_form(kind, options):
    @cache
    def run(x):
        mech, q, v = MADE[kind](coefficient=x)
        return mbdae.solve(mech, (0, 0.15), q, v, step=0.03, **options)

    model = {"model": lambda **x: MADE[kind](**x)[0]}
    found = mbdae.sensitivity(run(0.3), {"coefficient": 0.3}, **model)
    assert_derivative(found.dy[..., 0], lambda x: run(x).y, 0.3, 1e-10, mech=run(0.3).mechanism)
    compare(run(0.3), {"coefficient": 0.3}, ["v.x", "work"], **model)


NAMES = ("force.coulomb_friction 1.coefficient", "force.coulomb_friction 1.radius", "joint.coupler.mass",
         "joint.rocker.xyz.0", "frame.coupler_tip.xyz.0", "start.q.crank")  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_closures_that_depend_on_each_other(name):
    """Five rows of a revolute closure in the plane, two of them independent: the force is that of least norm."""
    friction = CoulombFriction(closure="pin", coefficient=0.4, radius=0.3, velocity=0.5)
    own = mbdae.load("four_bar", forces=[friction])

    @cache
    def run(x):
        made = factory_of(own).make({name: x})
        return mbdae.solve(made, (0.0, 0.2), step=0.04, method="pherk5", project=True)

    sol = mbdae.solve(own, (0.0, 0.2), step=0.04, method="pherk5", project=True)
    found = mbdae.sensitivity(sol, [name])
    value = found.parameters[name]
    assert_derivative(found.dy[..., 0], lambda x: run(x).y, value, 1e-10, mech=own)
    assert_derivative(found.lam[..., 0], lambda x: run(x).lam, value, 1e-9)
    signals = "torque.pin.y", "force.crank", "torque.rocker.1", "force.pin"
    loads = np.array([found.signal(signal)[:, 0] for signal in signals])
    assert_derivative(loads, lambda x: columns(run(x), signals), value, 1e-8)
    compare(sol, [name], ["q.crank", "lam.pin.1", "work", "torque.pin.y"])


@pytest.mark.slow
def test_friction_of_a_sliding_wheel():
    """T = -mu N along the no-slip row, which is inactive: its derivatives by mu are those of mu N."""

    @cache
    def run(coefficient):
        model, parent = pin.Model(), 0
        for joint, name in ((pin.JointModelPX(), "x"), (pin.JointModelPZ(), "z"), (pin.JointModelRY(), "turn")):
            parent = model.addJoint(parent, joint, pin.SE3.Identity(), name)
        body = pin.Inertia(1.0, np.array([0.02, 0, 0.01]), np.diag([4e-3, 4e-3, 6e-3]))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        model.addBodyFrame("hub", parent, pin.SE3.Identity(), 0)
        floor = Closure.rolling("world", "hub", 0.1, axis=(0, 1, 0), name="floor", grip="longitudinal")
        mech = Mechanism(model, [floor], [CoulombFriction(closure="floor", coefficient=coefficient, exact=True)])
        return mbdae.solve(mech, (0, 0.1), np.array([0, 0.1, 0]), np.array([3.0, 0, 0]), step=0.02, method="pherk5")

    found = mbdae.sensitivity(run(0.3), {"coefficient": 0.3}, model=lambda coefficient: run(coefficient).mechanism)
    signals = "longitudinal.floor", "force.floor.x", "friction.floor", "lam.floor.2"
    moves = np.array([found.signal(name)[:, 0] for name in signals])
    assert_derivative(moves, lambda x: columns(run(x), signals), 0.3, 1e-9)
    assert_derivative(found.lam[..., 0], lambda x: run(x).lam, 0.3, 1e-9)
