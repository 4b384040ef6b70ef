"""Grazing of the user's own events, of their conditions, and of loads, told by name along a branch, in closed form."""

import numpy as np
import pinocchio as pin
import pytest
from impact_oscillator import GRAZING_FORCE, OMEGA, E, S, Z, impact_motion, oscillator, steady

import mbdae
from mbdae import JointDamping, JointSpring, JointTorque, Mechanism, Reset, Stop
from mbdae.mechanism.time_functions.time_functions import Harmonic


def thrown(force, phase=0.0, when=""):
    """The impact oscillator whose stop is an event: the mass is thrown back."""
    back = Reset(name="back", signal=f"q.mass < {-S}", when=when, state={"v.mass": f"-{E}*v.mass"})
    return oscillator(force, phase, resets=[back])


def branch_of_impacts(mechanism, first, last, rtol=1e-9):
    """The branch from the motion with a speed u after the impact towards another one."""
    start, end = impact_motion(first), impact_motion(last)
    (x, v), phase = start.start, start.phase + np.pi
    return mbdae.periodic_branch(
        mechanism, "force", start.force, end.force, q=[x], v=[v], rtol=rtol, start={"phase": phase}
    )


@pytest.mark.slow
def test_a_motion_without_events_ends_where_it_grazes_the_level(tmp_path):
    x, v = steady(3.5, 0.0)
    found = mbdae.periodic_branch(thrown, "force", 3.5, 4.5, q=[x], v=[v], rtol=1e-9, start={"phase": 0.0})
    (at,) = found.bifurcations
    assert (at.kind, at.grazed) == ("grazing", "back")
    assert at.value == pytest.approx(GRAZING_FORCE, rel=1e-9)
    assert found.message == "ends where 'back' is grazed: there is no derivative beyond"
    _, magnitude, _ = found.plot(tmp_path / "grazing.png").axes
    assert [text.get_text() for text in magnitude.texts] == ["grazing"]


@pytest.mark.slow
def test_a_motion_with_an_event_ends_where_it_only_touches_its_level():
    exact = impact_motion(0.02)
    (x, v), phase = exact.start, exact.phase + np.pi
    found = mbdae.periodic_branch(thrown, "force", exact.force, 3.8, q=[x], v=[v], rtol=1e-9, start={"phase": phase})
    at = found.bifurcations[-1]
    assert (at.kind, at.grazed) == ("grazing", "back")
    assert at.value == pytest.approx(GRAZING_FORCE, rel=1e-7)


@pytest.mark.slow
def test_a_motion_ends_where_the_condition_of_its_event_fails():
    """The speed before the event is u/e, and the condition asks for 0.5."""
    mechanism = lambda force, phase: thrown(force, phase, when="v.mass < -0.5")  # noqa: E731
    found = branch_of_impacts(mechanism, 0.5, 0.3)
    at = found.bifurcations[-1]
    assert (at.kind, at.grazed) == ("grazing", "back")
    assert at.value == pytest.approx(impact_motion(0.5 * E).force, rel=1e-8)


PRESSED = 3.0


def on_a_pad(force):
    """An oscillator on a pad that a force presses onto a stop: the load of the stop is p + x''."""
    model = pin.Model()
    model.gravity.linear[:] = 0.0
    for parent, name in enumerate(("pad", "mass")):
        joint = model.addJoint(parent, pin.JointModelPX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    forces = [
        JointSpring(joint="mass", stiffness=1.0),
        JointDamping(joint="mass", damping=2 * Z),
        JointTorque(joint="mass", torque=Harmonic(amplitude=force, omega=OMEGA, phase=np.pi / 2)),
        JointTorque(joint="pad", torque=-PRESSED),
    ]
    return Mechanism(model, forces=forces, stops=[Stop(joint="pad", lower=0.0, name="floor")])


@pytest.mark.slow
def test_a_load_that_touches_zero_is_named_and_the_branch_goes_on():
    """The amplitude of x'' is w^2 F/|1 - w^2 + 2 i z w|; beyond, the pad leaves the stop for a moment."""
    x, v = steady(2.0, 0.0)
    limit = PRESSED * abs(1 - OMEGA**2 + 2j * Z * OMEGA) / OMEGA**2
    found = mbdae.periodic_branch(on_a_pad, "force", 2.0, 1.1 * limit, q=[0.0, x], v=[0.0, v], rtol=1e-9)
    (at,) = found.bifurcations
    assert (at.kind, at.grazed) == ("grazing", "floor")
    assert at.value == pytest.approx(limit, rel=1e-9)
    assert (found.message, found.values[-1]) == ("", pytest.approx(1.1 * limit))
    assert [len(found.points[i].motion.run.modes) for i in (0, -1)] == [1, 3]
