"""Equilibria over a joint and over a load that rest on stops and planes, in closed form."""

import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, add_body, empty, frame, pendulum, plane

import mbdae
from mbdae import JointSpring, Mechanism, Stop

ROUNDING = 1e-12
L0 = np.sqrt(1.25)


def toggle(**ends):
    m = mbdae.load("snap_toggle")
    return Mechanism(m.model, m.closures, m.forces, stops=[Stop(joint="pin", **ends)])


def press(z):
    """Force in units of 100 N that holds the toggle's pin at height z."""
    return 20 * z * (L0 / np.sqrt(1 + z * z) - 1)


def changes(path):
    return [(e.kind, e.contact, e.reverses) for e in path.critical if e.contact]


def test_a_toggle_between_stops_under_a_growing_load():
    """It leaves the upper stop, snaps through, and rests on the lower one, whose force takes all further load."""
    path = mbdae.load_path(toggle(lower=-0.3, upper=0.6), "press", (-3, 2))
    assert [e.kind for e in path.critical] == ["separation", "limit", "limit", "contact"]
    assert changes(path) == [("separation", "pin stop upper", False), ("contact", "pin stop lower", False)]
    left, closed = path.critical[0], path.critical[-1]
    assert [left.factor, closed.factor] == pytest.approx([press(0.6), press(-0.3)], rel=ROUNDING)
    assert [left.q[0], closed.q[0]] == pytest.approx([0.6, -0.3], abs=ROUNDING)
    z, force = path.q[:, 0], 100 * (path.factor - press(path.q[:, 0]))
    np.testing.assert_allclose(path.contacts["pin stop upper"], np.where(z > 0.6 - ROUNDING, -force, 0), atol=1e-9)
    np.testing.assert_allclose(path.contacts["pin stop lower"], np.where(z < -0.3 + ROUNDING, force, 0), atol=1e-9)
    assert path.contacts["pin stop lower"][-1] == pytest.approx(100 * (2 - press(-0.3)), rel=ROUNDING)
    assert (path.complete, path.unstable[-1]) == (True, 0)
    assert "pin stop lower closes at factor -0.425294053" in str(path)
    assert "contact.pin stop lower" in path.to_columns().values


def test_the_load_reverses_at_a_stop_beyond_the_limit_point():
    """A stop between the limit points: the unstable branch, whose load falls, ends there."""
    path = mbdae.load_path(toggle(lower=0.2), "press", (0, 2))
    assert changes(path) == [("contact", "pin stop", True)]
    assert path.critical[-1].factor == pytest.approx(press(0.2), rel=ROUNDING)
    assert path.contacts["pin stop"][-1] == pytest.approx(100 * (2 - press(0.2)), rel=ROUNDING)
    assert path.complete
    assert "where the load reverses" in str(path)


def test_an_arm_between_a_spring_and_a_stop():
    """Of two arms with springs the upper one meets a stop, which presses against its weight and the lower one's."""
    model = empty()
    first = add_body(model, 0, pin.JointModelRY(), "upper", 2.0, (0.7, 0, 0), (0.1, 0.1, 0.1))
    add_body(model, first, pin.JointModelRY(), "lower", 1.0, (0, 0, -0.4), (0.1, 0.1, 0.1))
    springs = [JointSpring(joint="upper", stiffness=30.0), JointSpring(joint="lower", stiffness=5.0)]
    mech = Mechanism(model, forces=springs, stops=[Stop(joint="upper", upper=0.3)])
    path = mbdae.load_path(mech, "gravity", (0.0, 3.0))
    assert [e.kind for e in path.critical] == ["contact"]
    a, b = path.critical[0].q
    p = path.critical[0].factor
    assert a == pytest.approx(0.3, abs=ROUNDING)
    assert 5 * b == pytest.approx(-p * G * 0.4 * np.sin(a + b), rel=1e-11)
    assert 30 * a == pytest.approx(p * 2 * G * 0.7 * np.cos(a) + 5 * b, rel=1e-11)
    on_stop = path.contacts["upper stop"] > 0
    a, b = path.q[on_stop].T
    np.testing.assert_allclose(a, 0.3, atol=ROUNDING)
    p = path.factor[on_stop]
    np.testing.assert_allclose(5 * b, -p * G * 0.4 * np.sin(0.3 + b), rtol=1e-11)
    force = p * 2 * G * 0.7 * np.cos(0.3) + 5 * b - 9
    np.testing.assert_allclose(path.contacts["upper stop"][on_stop], force, rtol=1e-9, atol=1e-9)


def test_equilibria_of_a_rod_that_leans_on_a_plane():
    """sin(q) = h/L on both sides of the hinge, N = m g / 2; upright it balances, hanging it would pass the plane."""
    L, h, m = 1.0, 0.6, 2.0
    model = empty()
    place = pin.SE3(np.eye(3), np.array([0.0, 0.0, h]))
    j = add_body(model, 0, pin.JointModelRY(), "rod", m, (L / 2, 0, 0), (0.1, 0.1, 0.1), place)
    frame(model, j, "tip", L, 0, 0)
    found = mbdae.equilibria(Mechanism(model, [plane("tip")]), "rod", span=(-2, 4))
    poses = {round(float(e.q[0]), 12): e for e in found}
    leaning = np.arcsin(h / L)
    assert sorted(poses) == pytest.approx([-np.pi / 2, leaning, np.pi - leaning], abs=ROUNDING)
    for q, e in poses.items():
        expected = {} if q < 0 else {"tip": pytest.approx(m * G / 2, rel=ROUNDING)}
        assert (e.contacts, e.stability) == (expected, "rigid" if q > 0 else "unstable")


@pytest.mark.slow
def test_equilibria_of_a_pendulum_and_of_a_toggle_on_their_stops():
    found = mbdae.equilibria(pendulum(), "a")
    assert [float(e.q[0]) for e in found] == pytest.approx([np.pi, 0.3], abs=ROUNDING)
    assert found[1].contacts == {"a stop": pytest.approx(G * np.sin(0.3), rel=ROUNDING)}
    found = mbdae.equilibria("pendulum_on_stop", "rod")  # a turn ahead it hangs, a turn back the stop is in the way
    assert [float(e.q[0]) for e in found] == pytest.approx([np.pi, 2 * np.pi, 0.3], abs=ROUNDING)
    found = mbdae.equilibria(toggle(lower=-0.3, upper=0.45), "pin", span=(-1, 1))
    assert [e.contacts for e in found] == [{"pin stop lower": pytest.approx(100 * (1 - press(-0.3)), rel=ROUNDING)}]
