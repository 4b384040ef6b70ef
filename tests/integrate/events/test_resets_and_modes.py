"""Events at which the state jumps beside stops and drivers: closed forms, tangents against quotients of runs."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae import Driver, JointTorque, Mechanism, Reset, Stop
from mbdae.errors import InputError
from mbdae.finite_differences import numerical_derivative
from mbdae.mechanism.time_functions.time_functions import Harmonic

G, E = 9.81, 0.5


def masses(*names, axis=pin.JointModelPX, gravity=0.0):
    """Bodies of 1, 2, ... kg on parallel guides."""
    model = pin.Model()
    model.gravity.linear[:] = [0, 0, -gravity]
    for i, name in enumerate(names):
        joint = model.addJoint(0, axis(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia(1.0 + i, np.zeros(3), np.zeros((3, 3))), pin.SE3.Identity())
    return model


def ball(reset, restitution=E, force=0.0):
    floor = Stop(joint="z", lower=0.0, restitution=restitution, name="floor")
    up = [JointTorque(joint="z", torque=force)] if force else []
    return Mechanism(masses("z", axis=pin.JointModelPZ, gravity=G), forces=up, stops=[floor], resets=[reset])


KICK = Reset(name="kick", signal="q.z < 0.05", when="v.z < -0.3", state={"v.z": "v.z - 1.0"})


@pytest.mark.parametrize("backend", ["native", "python"])
def test_a_ball_that_is_kicked_down_before_each_bounce(backend):
    """v^2 = 2 g (h - 0.05) at the kick, then 1 m/s more, then 2 g 0.05 more; the bounce keeps e of it."""
    sol = mbdae.solve(ball(KICK), (0, 0.9), [0.3], [0.0], rtol=1e-10, backend=backend)
    height, speeds = 0.3, []
    for _ in range(3):
        speeds.append(np.sqrt((np.sqrt(2 * G * (height - 0.05)) + 1) ** 2 + 2 * G * 0.05))
        height = (E * speeds[-1]) ** 2 / (2 * G)
    assert [name for _, name in sol.resets] == ["kick"] * 3
    assert [x.impulse[0] for x in sol.impacts[:3]] == pytest.approx((1 + E) * np.array(speeds), rel=1e-9)
    assert mbdae.drift(sol).energy_error < 1e-12


def test_a_body_that_rests_is_thrown_up_or_pressed_onto_its_stop():
    """Thrown, it leaves its stop and comes back after 2 v/g; pressed, the impulse of the stop takes the speed."""
    for speed, impulse in ((1.5, 1.5), (-1.5, 1.5)):
        throw = Reset(name="throw", signal="t > 0.1", state={"v.z": speed})
        sol = mbdae.solve(ball(throw, restitution=0.0), (0, 0.6), [0.0], [0.0], rtol=1e-10)
        (impact,) = sol.impacts
        assert impact.impulse == pytest.approx([impulse], rel=1e-9)
        assert impact.t == pytest.approx(0.1 + (2 * speed / G if speed > 0 else 0.0), abs=1e-12)
        assert (sol.q[-1][0], sol.v[-1][0]) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_a_body_that_is_put_into_a_stop_ends_the_run():
    put = Reset(name="put", signal="q.z < 0.1", state={"q.z": -1.0})
    sol = mbdae.solve(ball(put), (0, 1), [0.3], [0.0])
    assert sol.status == "impact"
    assert sol.message.startswith("'floor' is penetrated by 1 m after event 'put', at t = 0.20")


def pair(reset, amplitude=0.2):
    """Two masses, 1 and 2 kg, whose distance a driver prescribes, pulled by a constant force."""
    driver = Driver(joints=("a", "b"), coefficients=(0.0, 1.0), motion=Harmonic(amplitude=amplitude, omega=3.0))
    force = JointTorque(joint="a", torque=1.5)
    return Mechanism(masses("a", "b"), forces=[force], drivers=[driver], resets=[reset])


BACK = Reset(name="back", signal="q.b > 0.3", state={"q.a": "q.a - 0.1", "v.a": "-2*v.a + t"})


def start_of_pair():
    return np.array([0.0, 0.0]), np.array([0.6, 0.0])


def test_an_impact_of_an_event_acts_against_a_driver():
    """b follows a in position; momentum is that of the new speeds, and v_a - v_b = u'."""
    sol = mbdae.solve(pair(BACK), (0, 1.2), *start_of_pair(), rtol=1e-11)
    i, _ = sol.resets[0]
    t, (va, vb), rate = sol.t[i], sol.v[i - 1], 0.6 * np.cos(3 * sol.t[i])
    assert sol.q[i - 1][1] == pytest.approx(0.3, abs=1e-11)
    assert sol.q[i] == pytest.approx([sol.q[i - 1][0] - 0.1, sol.q[i - 1][0] - 0.1 - 0.2 * np.sin(3 * t)], abs=1e-11)
    momentum = (-2 * va + t) + 2 * vb
    assert sol.v[i] == pytest.approx([(momentum + 2 * rate) / 3, (momentum - rate) / 3], abs=1e-10)


def test_values_that_contradict_a_driver_end_the_run():
    driver = Driver(joint="a", motion=Harmonic(amplitude=0.2, omega=3.0))
    reset = Reset(name="move", signal="t > 0.2", state={"q.a": 1.0})
    sol = mbdae.solve(Mechanism(masses("a"), drivers=[driver], resets=[reset]), (0, 1))
    assert sol.message.startswith("values of event 'move' contradict 'a driver', at t = 0.2")


def tangents(mech, T, q, v):
    """Tangent of the end with respect to the start, and quotients of order six of whole runs."""
    q, v = np.array(q, float), np.array(v, float)
    sol = mbdae.solve(mech, (0, T), q, v, rtol=1e-12)
    found = mbdae.sensitivity(sol, start=True).dy[-1][: 2 * mech.nv]

    def end(x):
        run = mbdae.solve(mech, (0, T), q + x[: mech.nv], v + x[mech.nv :], rtol=1e-12)
        assert [name for _, name in run.resets] == [name for _, name in sol.resets]
        return np.concatenate([run.q[-1], run.v[-1]])

    expected = [numerical_derivative(lambda h, e=e: end(h * e), 1e-4) for e in np.eye(2 * mech.nv)]
    return found, np.array(expected).T, sol


def test_tangents_through_events_and_impacts():
    found, expected, sol = tangents(ball(KICK), 0.7, [0.3], [0.2])
    assert len(sol.resets) == 2 == len(sol.impacts)
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8)


def test_tangents_of_an_event_that_is_an_impact():
    """The signal of the event is a speed; the stop stops it at once."""
    press = Reset(name="press", signal="v.z > 0.8", state={"q.z": 0.0, "v.z": "-2*v.z"})
    found, expected, sol = tangents(ball(press, force=G + 2.0), 0.7, [0.1], [0.2])
    assert len(sol.impacts) == 1
    np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-8)


def test_tangents_against_a_driver():
    """The start moves on the closures; along q and v of both masses together."""
    q, v = start_of_pair()
    mech = pair(BACK)
    sol = mbdae.solve(mech, (0, 1.2), q, v, rtol=1e-12)
    assert len(sol.resets) == 4
    dy = mbdae.sensitivity(sol, start=True).dy[:, :4]
    found = dy[-1]
    for i, _ in sol.resets:  # just after an event tangents satisfy the driver, whose speed depends on its time
        np.testing.assert_allclose(dy[i][[0, 2]] @ np.ones((4, 1)), dy[i][[1, 3]] @ np.ones((4, 1)), atol=1e-9)
    for column in (np.array([1.0, 1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])):

        def end(h, column=column):
            run = mbdae.solve(mech, (0, 1.2), q + h * column[:2], v + h * column[2:], rtol=1e-12)
            return np.concatenate([run.q[-1], run.v[-1]])

        np.testing.assert_allclose(found @ column, numerical_derivative(end, 1e-3), rtol=1e-8, atol=1e-9)


def test_the_gradient_is_the_transposed_tangent():
    sol = mbdae.solve(ball(KICK), (0, 0.7), [0.3], [0.2], rtol=1e-11)
    tangent = mbdae.sensitivity(sol, start=True).signal("q.z")

    def cost(signals):
        weights = np.cos(np.arange(len(signals["q.z"])))
        return float(weights @ signals["q.z"]), {"q.z": weights}

    found = mbdae.gradient(sol, cost, start=True)
    weights = np.cos(np.arange(len(tangent)))
    np.testing.assert_allclose(list(found.gradient.values())[:2], (weights @ tangent)[:2], rtol=1e-11)


def test_a_closure_within_a_range_is_rejected():
    with pytest.raises(InputError, match="is active only in ranges, which events that change the state do not support"):
        mbdae.load("geneva_drive", resets=[Reset(name="stop", signal="t > 1", state={"v.crank": 0.0})])
