"""Derivatives through impacts and modes in closed form, and what is rejected."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, add_body, ball, empty

import mbdae
from mbdae import Closure, Clutch, JointFriction, JointSpring, JointTorque, Mechanism, Stop
from mbdae.errors import InputError
from mbdae.mechanism.time_functions.time_functions import Polynomial, Steps

TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def wheels(forces=(), **more):
    """Two wheels of 0.2 kg m^2 about z, ``input`` and ``wheel``."""
    model = empty(0.0)
    for name in ("input", "wheel"):
        add_body(model, 0, pin.JointModelRZ(), name, inertia=(0.2, 0.2, 0.2))
    return Mechanism(model, forces=forces, **more)


def test_a_ball_that_bounces_twice():
    """z0 - g t1^2/2 = 0, v1 = e g t1, flights of 2 v/g: v and z at T are functions of z0 and v0."""
    e, z0, T = 0.8, 1.0, 1.5
    sol = mbdae.solve(ball(e), (0.0, T), np.array([z0]), np.zeros(1), **TIGHT)
    assert len(sol.impacts) == 2
    hit = np.sqrt(2 * G * z0)  # speed of the first impact; by z0: G/hit, by v0 (at 0): 0; t1 = hit/G, by v0: 1/G
    by_hit, by_t1 = np.array([G / hit, 0.0]), np.array([1 / hit, 1 / G])
    by_last = by_t1 + 2 * e * by_hit / G  # of the time of the second impact
    dv = e**2 * by_hit + G * by_last
    t2 = hit / G + 2 * e * hit / G
    v2 = e**2 * hit
    dz = (T - t2) * e**2 * by_hit - v2 * by_last + G * (T - t2) * by_last
    found = mbdae.sensitivity(sol, start=True)
    np.testing.assert_allclose(found.dy[-1, :2], [dz, dv], rtol=0, atol=1e-10)
    before, after = (sol.modes[1][0] + i for i in (-1, 0))
    np.testing.assert_allclose(found.dy[before, :2], [[1.0, hit / G], [0.0, 1.0]], rtol=0, atol=1e-10)
    # just after: Y+ = -e dv- and the change of rates times dt, at fixed time
    np.testing.assert_allclose(found.dy[after, 0], -e * found.dy[before, 0], rtol=0, atol=1e-10)


def test_a_commanded_clutch():
    """Angular momentum is kept at a known time: v+ = (v1 + v2)/2."""
    lock = Clutch(joints=("wheel", "input"), engaged=Steps(points=((0.0, 0.0), (0.5, 1.0))))
    sol = mbdae.solve(wheels(clutches=[lock]), (0.0, 1.0), np.zeros(2), np.array([3.0, 1.0]), **TIGHT)
    found = mbdae.sensitivity(sol, start=True).dy[-1, :4, :4]
    one, half = np.eye(2), np.full((2, 2), 0.5)
    expected = np.block([[one, 0.5 * one + 0.5 * half], [0 * half, half]])
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)


def test_a_one_way_clutch_engages():
    """The wheel runs ahead, slows down under -T and is caught: then both keep their momentum under -T."""
    T, J, v = 0.3, 0.2, np.array([1.0, 2.0])
    mech = wheels([JointTorque(joint="wheel", torque=-T)], clutches=[Clutch(joints=("wheel", "input"))])
    sol = mbdae.solve(mech, (0.0, 1.0), np.zeros(2), v, **TIGHT)
    caught = (v[1] - v[0]) * J / T
    assert [m for _, m in sol.modes] == [(0,), (1,)]
    # v(1) = v_input - T/(2 J) (1 - caught), by v: caught by v = (-J/T, J/T)
    by_v = np.array([1.0, 0.0]) + T / (2 * J) * np.array([-J / T, J / T])
    found = mbdae.sensitivity(sol, start=True).dy[-1]
    np.testing.assert_allclose(found[2:4, 2:4], [by_v, by_v], rtol=0, atol=1e-11)
    assert found[0, 3] == pytest.approx((1 - caught) / 2, abs=1e-11)


def test_a_run_that_begins_with_an_impact():
    lock = Clutch(joints=("wheel", "input"))
    sol = mbdae.solve(wheels(clutches=[lock]), (0.0, 1.0), np.zeros(2), np.array([3.0, 1.0]), **TIGHT)
    assert sol.impacts[0].t == 0.0
    found = mbdae.sensitivity(sol, start=True).dy[-1]
    np.testing.assert_allclose(found[2:4, 2:4], np.full((2, 2), 0.5), rtol=0, atol=1e-12)
    assert found[-1, 2:4] == pytest.approx([0.2 * (1 - 3.0) / 2, 0.2 * (3.0 - 1) / 2], abs=1e-12)  # work of the impact


@pytest.mark.parametrize("unit", [1.0, 1e12])
def test_a_force_that_overcomes_stiction(unit):
    """m v' = c t - F from t = F_s/c on, in a unit of force in which parameters are large."""
    m, c, F, static, T = 2.0 * unit, 3.0 * unit, 0.5 * unit, 0.9 * unit, 1.0
    model = empty(0.0)
    add_body(model, 0, pin.JointModelPX(), "x", mass=m)
    friction = JointFriction(joint="x", friction=F, static=static)

    def pulled(ramp: float) -> Mechanism:
        pull = JointTorque(joint="x", torque=Polynomial(coefficients=(0.0, ramp)))
        return Mechanism(model, forces=[pull, friction])

    sol = mbdae.solve(pulled(c), (0.0, T), np.zeros(1), np.zeros(1), **TIGHT)
    found = mbdae.sensitivity(sol, {"ramp": c}, model=pulled).v[-1, 0, 0]
    slips = static / c
    expected = ((T**2 - slips**2) / 2 + (static - F) * static / c**2) / m
    assert found == pytest.approx(expected, rel=1e-9, abs=0)


def test_a_narrow_range():
    """A body of 1 kg takes another one along from its lower end on: v+ = v/2 from t = lower/v on."""
    model = empty(0.0)
    for name in ("a", "b"):
        add_body(model, 0, pin.JointModelPX(), name)

    def carried(lower: float) -> Mechanism:
        within = {"joint": "a", "windows": [(lower, 0.302)]}
        return Mechanism(model, [Closure(kind="ratio", joints=("b", "a"), coefficients=(1.0,), within=within)])

    sol = mbdae.solve(carried(0.3), (0.0, 0.5), np.zeros(2), np.array([1.0, 0.0]), **TIGHT)
    assert len(sol.modes) == 3
    found = mbdae.sensitivity(sol, {"lower": 0.3}, model=carried).q[-1, :, 0]
    np.testing.assert_allclose(found, [0.5, -0.5], rtol=0, atol=1e-11)


def rejected(match, sol):
    with pytest.raises(InputError, match=rf"^[^\n]*{match}[^\n]*$"):
        mbdae.sensitivity(sol, start=True)


def test_what_has_no_derivative():
    rejected(
        "'z stop' comes to rest by an accumulation of bounces at t = ",
        mbdae.solve(ball(0.5), (0.0, 2.0), np.array([0.5]), np.zeros(1)),
    )
    model = empty(0.0)
    for name in ("a", "b"):
        add_body(model, 0, pin.JointModelPX(), name)
    stops = [Stop(joint=name, upper=1.0, restitution=0.5) for name in ("a", "b")]
    both = mbdae.solve(Mechanism(model, stops=stops), (0.0, 2.0), np.zeros(2), np.ones(2))
    rejected("'a stop' and 'b stop' switch at the same time, t = 1 s", both)
    model = empty(0.0)
    add_body(model, 0, pin.JointModelPX(), "x")
    stop = Stop(joint="x", upper=0.0, restitution=0.5)
    spring = JointSpring(joint="x", stiffness=1.0)  # it moves at 1 m/s at an amplitude of 1 m
    slow = mbdae.solve(Mechanism(model, forces=[spring], stops=[stop]), (0.0, 1.0), np.array([-1e-8]), np.array([1e-7]))
    rejected("'x stop' only grazes its limit at t = 0.0996686525 s", slow)
