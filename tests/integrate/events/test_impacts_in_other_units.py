"""Impacts, contacts and flights in (mm, t, s), (km, g, h), Ms and us: the same ones, at the same times."""

import numpy as np
import pinocchio as pin
import pytest
from shared import shared_model
from unit_systems import UNIT_SYSTEMS

import mbdae
from mbdae import Closure, CoulombFriction, Mechanism, Stop

SPANS = {"slider_crank_with_stop": 0.7, "pendulum_on_stop": 3.0, "bouncing_chain": 0.6}
REST = 1e-6  # s


def load(name):
    """The model with the duration of the shortest flight as a number, which has a unit."""
    mech = shared_model(name)
    stops = [s.model_copy(update={"rest": REST}) for s in mech.stops]
    closures = [c.model_copy(update={"rest": REST}) if c.is_unilateral else c for c in mech.closures]
    return Mechanism(mech.model, closures, mech.forces, drivers=mech.drivers, stops=stops, start=mech.start_values)


def run(mech, units, end):
    work = [[units.energy]] if mech.drivers else []
    atol = 1e-9 * np.concatenate([units.coordinates(mech), units.speeds(mech), *work])
    return mbdae.solve(mech, (0, end * units.time), rtol=1e-7, atol=atol, first_step=1e-3 * units.time)


@pytest.mark.parametrize("units", UNIT_SYSTEMS[1:], ids=lambda units: units.name)
@pytest.mark.parametrize("name", SPANS)
def test_impacts_know_no_units(name, units):
    mech = load(name)
    expected, found = run(mech, UNIT_SYSTEMS[0], SPANS[name]), run(units.mechanism(mech), units, SPANS[name])
    assert found.status == expected.status == "finished"
    assert [mode for _, mode in found.modes] == [mode for _, mode in expected.modes]
    times, others = ([x.t for x in sol.impacts] for sol in (expected, found))
    assert len(times) > 1
    np.testing.assert_allclose(others, np.array(times) * units.time, rtol=1e-9)


@pytest.mark.parametrize("units", UNIT_SYSTEMS, ids=lambda units: units.name)
@pytest.mark.parametrize(("beyond", "passed"), [(1e-8, True), (1e-10, False)])
def test_a_start_passes_its_stop_by_the_same_in_all_units(units, beyond, passed):
    """Within 1e-9 characteristic lengths it touches."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPZ(), pin.SE3.Identity(), "slide")
    model.appendBodyToJoint(joint, pin.Inertia(1.0, np.array([0.0, 0.0, 1.0]), np.eye(3) * 1e-3), pin.SE3.Identity())
    mech = units.mechanism(Mechanism(model, stops=[Stop(joint="slide", lower=0.0, rest=REST)]))
    q = np.array([-beyond * mech.characteristic_length])
    if passed:
        with pytest.raises(mbdae.MbdaeError, match=r"'slide stop' is penetrated by .* at the start"):
            mbdae.solve(mech, (0, units.time), q)
    else:
        assert mbdae.solve(mech, (0, 1e-3 * units.time), q).status == "finished"


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("units", UNIT_SYSTEMS[1:], ids=lambda units: units.name)
def test_a_ball_slides_until_it_rolls_in_all_units(units):
    """At 2 v_0 / (7 mu g)."""
    model, speed, mu, radius = pin.Model(), 2.0, 0.3, 0.1
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(joint, pin.Inertia(1.5, np.zeros(3), 0.6 * radius**2 * np.eye(3)), pin.SE3.Identity())
    model.addBodyFrame("centre", joint, pin.SE3.Identity(), 0)
    ball = Mechanism(model, [Closure.rolling("world", "centre", radius=radius, name="floor")])
    other = units.mechanism(ball)
    sliding = Mechanism(other.model, other.closures, [CoulombFriction(closure="floor", coefficient=mu, exact=True)])
    q = np.array([0, 0, radius, 0, 0, 0, 1.0]) * units.configuration(ball)
    v = speed * np.array([np.cos(0.7), np.sin(0.7), 0, 0, 0, 0]) * units.speeds(ball)
    atol = 1e-11 * np.concatenate([units.coordinates(ball), units.speeds(ball)])
    sol = mbdae.solve(sliding, (0, 0.25 * units.time), q, v, rtol=1e-9, atol=atol, first_step=1e-3 * units.time)
    assert [mode for _, mode in sol.modes] == [(2,), (1,)]
    assert sol.t[sol.modes[1][0]] == pytest.approx(2 * speed / (7 * mu * 9.81) * units.time, rel=1e-10)
