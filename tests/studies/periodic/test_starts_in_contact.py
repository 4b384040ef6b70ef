"""Periods that begin where a joint slips or sticks, or on a stop, in closed form."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import mbdae
from mbdae import JointDamping, JointFriction, JointSpring, JointTorque, Mechanism, Stop
from mbdae.errors import InputError
from mbdae.mechanism.time_functions.time_functions import Harmonic

OMEGA, DAMPING, CONSTANT, FRICTION = 2.0, 0.5, 2.0, 1.0
T = 2 * np.pi / OMEGA


def mass(*forces, **more):
    """1 kg on a guide, without gravity."""
    model = pin.Model()
    model.gravity.linear[:] = 0.0
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "mass")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    return Mechanism(model, forces=list(forces), **more)


def driven(force, phase=0.0):
    return JointTorque(joint="mass", torque=Harmonic(amplitude=force, omega=OMEGA, phase=phase))


def slider(force):
    """A block that a constant and a harmonic force push over a rough floor."""
    friction = JointFriction(joint="mass", friction=FRICTION, exact=True)
    constant = JointTorque(joint="mass", torque=CONSTANT)
    return mass(JointDamping(joint="mass", damping=DAMPING), constant, driven(force), friction)


@pytest.mark.slow
def test_a_sliding_block_begins_to_stick_where_its_speed_grazes_zero():
    """Its speed has the mean (c - f)/d and the amplitude F/sqrt(w^2 + d^2); beyond it sticks once in a period."""
    found = mbdae.periodic_branch(slider, "force", 3.9, 4.3, q=[0.0], v=[2.0], rtol=1e-9, symmetry=["mass"])
    (at,) = found.bifurcations
    assert (at.kind, at.grazed) == ("grazing", "mass friction")
    assert at.value == pytest.approx((CONSTANT - FRICTION) / DAMPING * np.hypot(OMEGA, DAMPING), rel=1e-10)
    slides = found.values < at.value
    assert found.multipliers[slides, 0].real == pytest.approx(np.exp(-DAMPING * T), rel=1e-9)
    assert np.abs(found.multipliers[~slides]).max() < 1e-12
    assert (found.message, found.values[-1]) == ("", pytest.approx(4.3))
    assert [len(found.points[i].motion.run.modes) for i in (0, -1)] == [1, 3]


def test_a_period_that_begins_while_the_block_sticks():
    """It slips from sin(w t1) = f/F until F/w (cos w t1 - cos w t2) = f (t2 - t1); two strokes cancel."""
    force = 1.2
    mech = mass(driven(force), JointFriction(joint="mass", friction=FRICTION, exact=True))
    found = mbdae.periodic(mech, q=[0.3], v=[0.0], symmetry=["mass"], rtol=1e-11)
    t1 = np.arcsin(FRICTION / force) / OMEGA
    rest = brentq(
        lambda t: force / OMEGA * (np.cos(OMEGA * t1) - np.cos(OMEGA * t)) - FRICTION * (t - t1), t1 + 0.5, t1 + T / 2
    )
    run, sticks = found.run, [i for i, mode in found.run.modes if mode == found.run.mode(0)]
    assert run.nodes[0][[i for i, _ in run.modes[1:3]]] == pytest.approx([t1, rest], abs=1e-9)
    assert len(sticks) == 3
    assert found.advances["mass"] == pytest.approx(0.0, abs=1e-10)
    assert (found.stability, len(found.multipliers)) == ("stable", 0)
    assert [(x.name, x.error < 1e-9) for x in found.neutral] == [("mass", True)]


def test_a_period_that_begins_at_rest_on_a_stop():
    """It leaves the stop where the driving force exceeds the spring's, and comes back without rebound."""
    force, z = 1.5, 0.2
    forces = JointSpring(joint="mass", stiffness=1.0), JointDamping(joint="mass", damping=2 * z)
    stop = Stop(joint="mass", lower=1.0, restitution=0.0, name="stop")
    mech = mass(*forces, driven(force, -np.pi / 2), stops=[stop])  # -F cos(w t) presses it onto the stop
    found = mbdae.periodic(mech, q=[1.0], v=[0.0], rtol=1e-10)
    leaves = np.arccos(-1.0 / force) / OMEGA
    X = -force / (1 - OMEGA**2 + 2j * z * OMEGA)
    w = np.sqrt(1 - z * z)
    x0, v0 = (1.0 - (X * np.exp(1j * OMEGA * leaves)).real, -(1j * OMEGA * X * np.exp(1j * OMEGA * leaves)).real)

    def gap(t):
        free = np.exp(-z * t) * (x0 * np.cos(w * t) + (v0 + z * x0) / w * np.sin(w * t))
        return free + (X * np.exp(1j * OMEGA * (leaves + t))).real - 1.0

    back = leaves + brentq(gap, 0.3, T)
    run = found.run
    assert run.nodes[0][[i for i, _ in run.modes[1:]]] == pytest.approx([leaves, back], abs=1e-9)
    assert (found.stability, len(found.multipliers)) == ("stable", 0)


def test_ends_in_another_mode_are_one_line():
    """A period of half the driver's ends where the block slides."""
    mech = mass(driven(1.2), JointFriction(joint="mass", friction=FRICTION, exact=True))
    message = r"^at t = .*'mass friction' is slipping backwards, and sticking at the start .*: begin at another phase$"
    with pytest.raises(InputError, match=message):
        mbdae.periodic(mech, 0.7 * T, q=[0.3], v=[0.0], symmetry=["mass"])
