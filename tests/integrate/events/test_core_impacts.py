"""Rare impacts that the core resolves: each in closed form, on both back ends."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, R, add_body, empty, frame
from numpy.polynomial import Polynomial

import mbdae
from mbdae import Closure, CoulombFriction, JointTorque, Mechanism, Stop
from mbdae.mechanism.time_functions.time_functions import Polynomial as Motion

E = 0.5


def pair(upper, **more):
    """A ball above the floor, and another one that the same stop joins to it: 1 kg each, z1 is relative."""
    model = empty()
    add_body(model, add_body(model, 0, pin.JointModelPZ(), "z0"), pin.JointModelPZ(), "z1")
    limit = {"upper": 0.0} if upper else {"lower": 0.0}
    floor, between = Stop(joint="z0", lower=0.0, restitution=E, **more), Stop(joint="z1", restitution=E, **limit)
    return Mechanism(model, stops=[floor, between])


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("how", [{"step": 0.8}, {"rtol": 1e-6}, {"rtol": 1e-9, "method": "radau5"}], ids=str)
@pytest.mark.parametrize("rate", [0.0, 1e-3, -1e-3])
def test_flights_that_end_within_a_step_at_whose_end_the_gap_rises_again(how, rate):
    """x'' = -1 + 4 t: bounces, rest until t = 1/4, then (2/3) (t - 1/4)^3; methods take it in one step."""
    model, height = empty(0.0), 5e-4
    add_body(model, 0, pin.JointModelPZ(), "z")
    forces = [JointTorque(joint="z", torque=Motion(coefficients=(-1.0, 4.0)))]
    mech = Mechanism(model, forces=forces, stops=[Stop(joint="z", lower=0.0, restitution=E)])
    speed, x, v, t, impacts = Polynomial([-1.0, 4.0]).integ(), height, rate, 0.0, []
    for _ in range(4):
        motion = x + (speed - speed(t) + v).integ(lbnd=t)
        t, x = min(r.real for r in motion.roots() if abs(r.imag) < 1e-9 and r.real > t + 1e-5), 0.0
        v = -E * motion.deriv()(t)
        impacts.append(t)
    sol = mbdae.solve(mech, (0, 0.8), [height], [rate], **how)
    np.testing.assert_allclose([x.t for x in sol.impacts][:4], impacts, rtol=1e-9)
    assert sol.q[-1, 0] == pytest.approx(2 / 3 * 0.55**3, rel=1e-9)
    assert sol(np.linspace(0, 0.8, 200)).q.min() > -1e-12


def test_an_impact_closes_a_contact_that_has_just_opened(back_end):
    """The upper ball pushes the lower one back onto the floor: impacts in turn, until none approaches."""
    opening, w = 1e-6, 1.0
    sol = mbdae.solve(pair(upper=False), (0, 1e-3), [1e-14, 1e-7], [opening, -w], step=1e-4)
    lower, between = opening, -w
    while min(lower, between) < 0:
        if between < 0:
            lower, between = lower + (1 + E) * between / 2, -E * between
        else:
            lower, between = -E * lower, between + (1 + E) * lower
    first = sol.impacts[0]
    assert first.where == ("z0 stop", "z1 stop")
    assert first.t == pytest.approx(1e-7, rel=1e-5)
    node = next(i for i, _ in sol.modes if sol.t[i] >= first.t)
    np.testing.assert_allclose(sol.v[node], [lower, between], rtol=1e-5)
    assert back_end == "python" or sol.stats["impacts_in_core"] >= 1


def test_a_contact_that_comes_to_rest_is_not_held_where_another_one_lifts_it(back_end):
    """The lower ball reaches the floor for the second time, within its time of rest, when the upper one yanks it up.

    So the floor has no impulse, and the yank meets the reduced mass 1/2.
    """
    h, yank = 0.2, 3.0
    t1 = np.sqrt(2 * h / G)
    rate = yank + (1 + E) * G * t1  # before the first impact
    start = [h, -rate * t1 - yank * 2 * E * t1]
    sol = mbdae.solve(pair(upper=True, rest=10.0), (0, 1.1 * t1 * (1 + 2 * E)), start, [0.0, rate], rtol=1e-9)
    assert [x.where for x in sol.impacts] == [("z0 stop",), ("z1 stop",)]
    assert [x.t for x in sol.impacts] == pytest.approx([t1, t1 * (1 + 2 * E)], rel=1e-12)
    assert [x.impulse[0] for x in sol.impacts] == pytest.approx([(1 + E) * G * t1, (1 + E) * yank / 2], rel=1e-9)
    assert back_end == "python" or sol.stats["impacts_in_core"] == 2


def test_feet_that_only_friction_loads_stay_down_where_another_body_bounces(back_end):
    """A sledge brakes: its centre is 0.05 m behind both feet, and mu h > 0.05 m keeps the front one down."""
    mu, v0, height, model = 0.5, 3.0, 0.3, empty()
    x = add_body(model, 0, pin.JointModelPX(), "x", 0.0)
    body = add_body(model, x, pin.JointModelPZ(), "z", 0.0)
    body = add_body(model, body, pin.JointModelRY(), "tilt", 1.0, inertia=(0.0, 0.05, 0.0))
    closures, forces = [], []
    for name, ahead in (("rear", 0.05), ("front", 0.45)):
        frame(model, body, name, ahead, 0, R - height)
        more = {"grip": "longitudinal", "unilateral": True}
        closures.append(Closure.rolling("world", name, R, name=f"{name} foot", **more))
        forces.append(CoulombFriction(closure=f"{name} foot", coefficient=mu, exact=True))
    add_body(model, 0, pin.JointModelPZ(), "ball")
    mech = Mechanism(model, closures, forces, stops=[Stop(joint="ball", lower=0.0, restitution=E)])
    sol = mbdae.solve(mech, (0, 0.25), [0, height, 0, 0.05], [v0, 0, 0, 0], rtol=1e-9)
    assert [x.where for x in sol.impacts][:2] == [("ball stop",)] * 2
    sledge = [x for x in mech.switches if x.name.endswith("foot")]
    assert {tuple(x.states[mode[x.index]] for x in sledge) for _, mode in sol.modes} == {("sliding", "sliding")}
    np.testing.assert_allclose(sol.v[:, 0], v0 - mu * G * sol.t, rtol=0, atol=1e-9)
    front = sol.lam[:, sledge[1].row]
    np.testing.assert_allclose(front, G * (mu * height - 0.05) / 0.4, rtol=1e-8)
    assert back_end == "python" or sol.stats["impacts_in_core"] == len(sol.impacts)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("level", [0.0, 1.0, -3.0])
@pytest.mark.parametrize("speed", [1e-7, 1e-8, 1e-9])
def test_a_flight_lower_than_the_rounding_of_its_gap_ends_in_rest(level, speed):
    """v^2/(2 g) = 5e-20 m and more: a gap of 1 m has no digits for it, but velocities do."""
    model = empty()
    add_body(model, 0, pin.JointModelPZ(), "z")
    mech = Mechanism(model, stops=[Stop(joint="z", lower=level, restitution=E)])
    sol = mbdae.solve(mech, (0, 0.1), [level], [speed], rtol=1e-8)
    assert sol.t[-1] == 0.1
    assert sol.modes[-1][1] == (1,)
    assert len(sol.modes) < 6
    assert sol.q[-1, 0] == pytest.approx(level, abs=1e-15)
    assert sol.v[-1, 0] == pytest.approx(0, abs=1e-16)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("height", [0.0, 5e-8])  # an impact at the start, and in a run
def test_a_wheel_that_has_just_opened_does_not_slip_after_an_impact(height):
    """A bar slides down onto its end a, which pushes the wheel at b back onto the floor: all of its motion is lost."""
    model, L, r, inertia = empty(), 0.3, 0.05, 0.03
    x = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    z = model.addJoint(x, pin.JointModelPZ(), pin.SE3.Identity(), "z")
    bar = add_body(model, z, pin.JointModelRY(), "turn", inertia=(inertia, inertia, inertia))
    for name, side in (("a", L), ("b", -L)):
        frame(model, bar, name, side, 0, 0)
    wheel = {"unilateral": True, "restitution": 0.0}
    a = Closure.rolling("world", "a", r, name="a", grip="none", **wheel)
    b = Closure.rolling("world", "b", r, name="b", grip="longitudinal", **wheel)
    speed, turn = (1e-6 - 0.5) / 2, (1e-6 + 0.5) / (2 * L)
    q, v = [0.0, r + height / 2, -height / (2 * L)], [-0.1, speed, turn]
    sol = mbdae.solve(Mechanism(model, [a, b]), (0, 1e-3), q, v, step=1e-4)
    impact = sol.impacts[0]
    assert impact.loss == pytest.approx((0.1**2 + speed**2 + inertia * turn**2) / 2, rel=1e-5)
    difference = (inertia * turn - 0.1 * r) / L
    expected = [(-speed + difference) / 2, (-speed - difference) / 2, 0.1]
    np.testing.assert_allclose(impact.rows, expected, rtol=1e-5)
    assert np.abs(sol.v[-1]).max() < 1e-12
