"""Frictional unilateral contacts: impacts with friction, slipping, sticking, jamming, in closed form."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, R, add_body, empty, frame, lever

import mbdae
from mbdae import Closure, CoulombFriction, Mechanism
from mbdae.errors import InputError

OPEN, GRIPS, SLIDES = 0, 1, 2


def block(mu=0.3, e=0.0, slope=0.0):
    """A ball that does not rotate, over a floor inclined down along x."""
    model = empty()
    model.gravity.linear = G * np.array([np.sin(slope), 0, -np.cos(slope)])
    add_body(model, add_body(model, 0, pin.JointModelPX(), "x", 0.0), pin.JointModelPZ(), "z", 2.0)
    floor = Closure.rolling("world", "z", R, name="floor", grip="longitudinal", unilateral=True, restitution=e)
    return Mechanism(model, [floor], [CoulombFriction(closure="floor", coefficient=mu, exact=True)])


def test_a_block_thrown_over_the_floor_stops_when_its_weight_has_braked_it():
    """With any bounces, the impulse of the floor is m g t after them: it stops at t = u/(mu g)."""
    mu, e, h, stops = 0.3, 0.5, 0.1, 0.6
    u = mu * G * stops
    sol = mbdae.solve(block(mu, e), (0, 0.8), np.array([0, R + h]), np.array([u, 0]), rtol=1e-10)
    t = np.sqrt(2 * h / G)
    first = sol.impacts[0]
    assert first.t == pytest.approx(t, abs=1e-12)
    assert first.rows == pytest.approx([2.0 * (1 + e) * G * t, -2.0 * mu * (1 + e) * G * t], rel=1e-11)
    assert first.loss == pytest.approx((1 - e**2) * (G * t) ** 2 + u**2 - (u - mu * (1 + e) * G * t) ** 2, rel=1e-10)
    assert [m for _, m in sol.modes[-2:]] == [(SLIDES,), (GRIPS,)]
    assert sol.t[sol.modes[-1][0]] == pytest.approx(stops, abs=1e-9)
    assert sol.t[sol.modes[-2][0]] == pytest.approx(t * (1 + e) / (1 - e), abs=1e-5)
    assert np.abs(sol.v[-1]).max() < 1e-14
    assert mbdae.drift(sol).energy_relative < 1e-10


@pytest.mark.parametrize(("tangent", "mode"), [(0.29, GRIPS), (0.31, SLIDES)])
def test_a_block_that_falls_on_an_incline_sticks_or_slides(tangent, mode):
    slope, mu, h = np.arctan(tangent), 0.3, 0.05
    sol = mbdae.solve(block(mu, 0.0, slope), (0, 0.5), np.array([0, R + h]), np.zeros(2), rtol=1e-10)
    assert [m for _, m in sol.modes] == [(OPEN,), (mode,)]
    # the tangential impulse of the floor is mu times the normal one, in the impact and after it
    speed = 0.0 if mode == GRIPS else G * 0.5 * (np.sin(slope) - mu * np.cos(slope))
    assert sol.v[-1] == pytest.approx([speed, 0], abs=1e-12)


@pytest.mark.parametrize("mu", [0.1, 0.9, 3.0])
def test_the_end_of_a_falling_rod_sticks_or_slides_by_its_impulse(mu):
    """From W p = change of speeds: p_t = -u/W_tt and so on, within the cone; otherwise on its boundary."""
    mech, v = lever(mu), np.array([1.0, 1.0])  # it rotates onto the floor ahead of it
    a, c = 0.5 * np.sin(0.9), 0.5 * np.cos(0.9) + R
    N, T = np.array([0.0, -a]), np.array([1.0, -c])
    W = np.array([N, T]) @ np.diag([1 / 0.5, 1 / 0.02]) @ np.array([N, T]).T
    speed = np.array([N, T]) @ v
    p = np.linalg.solve(W, -speed)
    if abs(p[1]) > mu * p[0]:
        side = np.array([1.0, mu * np.sign(p[1])])
        p = -speed[0] / (W[0] @ side) * side
    sol = mbdae.solve(mech, (0, 1e-3), np.zeros(2), v)
    assert sol.impacts[0].rows == pytest.approx(p, rel=1e-12)
    assert sol.impacts[0].loss == pytest.approx(-p @ (2 * speed + W @ p) / 2, rel=1e-12)


def test_invalid_frictional_contacts_are_rejected():
    model = empty()
    add_body(model, 0, pin.JointModelFreeFlyer(), "ball")
    floor = Closure.rolling("world", "ball", R, name="floor", unilateral=True)
    with pytest.raises(InputError, match="'floor', which is unilateral, needs exact = true without static"):
        Mechanism(model, [floor], [CoulombFriction(closure="floor", coefficient=0.3, exact=True)])


def rod(mu):
    """A uniform rod of 1 m in a vertical plane, its end on the floor."""
    model = empty()
    model.gravity.linear = np.array([0, 0, -G])
    across = add_body(model, add_body(model, 0, pin.JointModelPX(), "x", 0.0), pin.JointModelPZ(), "z", 0.0)
    frame(model, add_body(model, across, pin.JointModelRY(), "turn", 1.0, inertia=(0, 1 / 12, 0)), "end", 0.5, 0, 0)
    tip = Closure.rolling("world", "end", SMALL, name="tip", grip="longitudinal", unilateral=True)
    return Mechanism(model, [tip], [CoulombFriction(closure="tip", coefficient=mu, exact=True)])


SMALL = 1e-9


@pytest.mark.parametrize("angle", [0.5, 0.9, 1.3])
@pytest.mark.parametrize("share", [0.5, 0.99, 1.01, 2.0])
def test_the_rod_of_painleve_is_named_where_it_has_no_motion(angle, share):
    """Slipping as it leans, the normal force is m a_n/(1 + 3 c (c - mu s)): no solution where that is < 0."""
    s, c = np.sin(angle), np.cos(angle)
    limit = (1 + 3 * c * c) / (3 * c * s)  # 4/3 at least
    sol = mbdae.solve(rod(share * limit), (0, 1e-3), np.array([0, 0.5 * s + SMALL, angle]), np.array([1.0, 0, 0]))
    if share < 1:
        assert sol.success
        assert sol.lam[0, 0] == pytest.approx(G / (1 + 3 * c * (c - share * limit * s)), rel=1e-6)
    else:
        assert (sol.status, len(sol.t)) == ("friction", 1)
        assert sol.message == "'tip': friction of contacts has no solution, or several, at t = 0"


@pytest.mark.usefixtures("back_end")
def test_a_drive_against_a_stop_has_no_impact_and_is_named():
    model = empty()
    add_body(model, 0, pin.JointModelPX(), "x")
    drive = mbdae.Driver.at_speed("x", 2.0)
    mech = Mechanism(model, drivers=[drive], stops=[mbdae.Stop(joint="x", upper=0.5, name="end")])
    sol = mbdae.solve(mech, (0, 1))
    assert sol.status == "impact"
    assert sol.message.startswith("'end': closures block the relative velocity of the impact, at t = 0.2")
    assert sol.t[-1] == pytest.approx(0.25, abs=1e-12)
