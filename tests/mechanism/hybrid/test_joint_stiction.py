"""Joints that stick and slip: closed forms and a scalar equation, both back ends."""

import numpy as np
import pinocchio as pin
import pytest
from dry_friction import SliderCrank, oscillator
from scipy.optimize import brentq

import mbdae
from mbdae import JointFriction, JointSpring, JointTorque, Mechanism, Stop
from mbdae.errors import InputError
from mbdae.mechanism.time_functions.time_functions import Harmonic, Steps


def block(*forces, source=None, **more):
    """A block of 1 kg on a rail."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    rail = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "x")
    model.appendBodyToJoint(rail, pin.Inertia(1.0, np.zeros(3), 1e-3 * np.eye(3)), pin.SE3.Identity())
    if source:
        model.upperDryFrictionLimit[:] = source
    return Mechanism(model, forces=forces, **more)


def words(sol):
    """The states of the switches from each transition on."""
    return [tuple(s.states[k] for s, k in zip(sol.mechanism.switches, mode, strict=True)) for _, mode in sol.modes]


@pytest.mark.slow
@pytest.mark.parametrize("static", [1.3, 3.0])
def test_a_block_on_a_spring_turns_and_sticks_where_it_must(static, back_end):
    mech = block(JointSpring(joint="x", stiffness=40.0), JointFriction(joint="x", friction=1.3, static=static))
    sol = mbdae.solve(mech, (0, 14), np.array([0.5]), np.zeros(1), rtol=1e-10)
    turns = oscillator(1.0, 40.0, 1.3, static, 0.5)
    found = [(sol.t[i], sol.q[i, 0]) for i, _ in sol.modes]
    np.testing.assert_allclose(found, turns, atol=1e-12)
    assert words(sol)[-1] == ("sticking",)
    assert sol.stats["backend"] == back_end
    last = sol.modes[-1][0]
    assert np.abs(sol.v[last:]).max() <= 1e-14
    assert np.abs(sol.q[last:] - sol.q[last]).max() <= 1e-14
    assert mbdae.drift(sol).energy_relative < 1e-10
    lost = 20 * 0.25 - 20 * turns[-1][1] ** 2
    assert mbdae.drift(sol).work_end == pytest.approx(-lost, rel=1e-11)
    found = sol.signals(["power.x friction", "work.x friction", "v.x"])
    np.testing.assert_allclose(found["power.x friction"], -1.3 * np.abs(found["v.x"]), rtol=1e-12, atol=1e-13)
    assert found["work.x friction"][-1] == pytest.approx(-lost, rel=1e-9)
    tangent, moves = mbdae.sensitivity(sol, start=True), np.abs(found["v.x"]) > 1e-6
    expected = -1.3 * np.sign(found["v.x"])[:, None] * tangent.signal("v.x")
    np.testing.assert_allclose(tangent.signal("power.x friction")[moves], expected[moves], rtol=1e-9, atol=1e-11)


@pytest.mark.slow
def test_a_slider_crank_with_two_joints_that_stick(back_end):
    until = 3.0 if back_end == "native" else 1.2
    sol = mbdae.solve(mbdae.load("stick_slip_slider"), (0, until), rtol=1e-11)
    events, end = SliderCrank().run(until)
    assert len(events) == (13 if back_end == "native" else 5)
    np.testing.assert_allclose([sol.t[i] for i, _ in sol.modes[1:]], [t for _, t, _ in events], atol=1e-11)
    np.testing.assert_allclose([sol.q[i, 0] for i, _ in sol.modes[1:]], [p for *_, p in events], atol=6e-11)
    assert sol.q[-1, 0] == pytest.approx(end, abs=6e-11)
    held = {"slip": 0, "turn": 0, "stick": 2}
    assert back_end != "native" or sol.stats["transitions_in_core"] == len(events)
    assert [w.count("sticking") for w in words(sol)[1:]] == [held[word] for word, *_ in events]
    assert mbdae.drift(sol).energy_relative < 1e-10


@pytest.mark.usefixtures("back_end")
def test_sticking_joints_do_not_creep():
    for force in (0.99, Harmonic(amplitude=0.99, omega=7.0)):
        sol = mbdae.solve(block(JointTorque(joint="x", torque=force), JointFriction(friction=1.0, exact=True)), (0, 10))
        assert sol.success
        assert np.abs(sol.v).max() <= 1e-14
        assert len(sol.modes) == 1


@pytest.mark.parametrize("scale", [1.0, 100.0])
@pytest.mark.usefixtures("back_end")
def test_two_joints_of_a_loop_that_stick_do_not_creep(scale):
    """Crank and slider together at 99 % of their limits; steps are seconds long, and v is rounding as often."""
    source, p = mbdae.load("stick_slip_slider"), 0.6
    crank, slider, (*_, gravity, way) = 0.40 * scale, 2.0 * scale, SliderCrank().terms(p)
    push = JointTorque(joint="crank", torque=0.99 * (crank + slider * abs(way)) - gravity)
    holds = [JointFriction(joint=n, friction=f, exact=True) for n, f in (("crank", crank), ("slider", slider))]
    model = source.model.copy()
    spins = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), "wheel")
    model.appendBodyToJoint(spins, pin.Inertia(1.0, np.zeros(3), np.eye(3)), pin.SE3.Identity())
    mech = Mechanism(model, source.closures, forces=[push, *holds])
    q, v = source.start
    for spin in (0.0, 1000.0):  # of a wheel besides them
        sol = mbdae.solve(mech, (0, 10), np.append(q, 0.0), np.append(v, spin))
        assert sol.success
        assert len(sol.modes) == 1
        assert len(sol.t) < 20
        assert np.abs(sol.v[:, :3]).max() <= 1e-14
        assert np.abs(sol.q[:, :3] - q).max() <= 1e-14


@pytest.mark.usefixtures("back_end")
def test_a_load_that_peaks_above_the_limit_is_seen():
    """It sticks without error, and steps would grow until the peak lies between two samples."""
    for amplitude in (1.5, 1.001):
        push = JointTorque(joint="x", torque=Harmonic(amplitude=amplitude, omega=7.0))
        sol = mbdae.solve(block(push, JointFriction(joint="x", friction=1.0, exact=True)), (0, 0.45 * np.pi))
        first = sol.t[sol.modes[1][0]]
        assert first == pytest.approx(np.arcsin(1 / amplitude) / 7, abs=1e-12)


@pytest.mark.usefixtures("back_end")
def test_a_load_that_jumps_above_the_limit_starts_a_slip():
    push = JointTorque(joint="x", torque=Steps(points=((0, 0.9), (1, 1.2), (2, -0.9), (3, 0.0))))
    mech = block(push, JointFriction(joint="x", friction=1.0, static=1.1))
    sol = mbdae.solve(mech, (0, 4), rtol=1e-10, events=["effort.x friction < -0.95"])
    assert words(sol) == [("sticking",), ("slipping forwards",), ("sticking",)]
    assert [sol.t[i] for i, _ in sol.modes[1:]] == pytest.approx([1.0, 2 + 0.2 / 1.9], abs=1e-12)
    assert sol.q[-1, 0] == pytest.approx(0.1 + 0.2**2 / 1.9 / 2, abs=1e-12)
    friction, at = sol.effort("x friction"), np.abs(sol.t - 1.0) < 1e-12
    assert friction.unique
    assert friction.effort[at] == pytest.approx([-0.9, -1.0], rel=1e-12)  # one node before the jump, one after it
    np.testing.assert_allclose(friction.power, friction.effort * sol.v[:, 0])
    assert sol.multipliers(1.5) == pytest.approx([-1.0])
    assert sol.events[0][0] == pytest.approx([1.0])


@pytest.mark.usefixtures("back_end")
def test_a_sticking_block_leaves_its_stop_with_the_load():
    """m x'' = A sin wt - F between stops: the stop becomes inactive where slip begins, to rounding."""
    A, w, F, end = 5.0, 3.0, 2.0, 0.01
    push = JointTorque(joint="x", torque=Harmonic(amplitude=A, omega=w))
    stop = Stop(joint="x", lower=0.0, upper=end)
    mech = block(push, JointFriction(joint="x", friction=F, exact=True), stops=[stop])
    sol = mbdae.solve(mech, (0, 3), rtol=1e-10)
    slips = np.arcsin(F / A) / w

    def way(t):
        d = t - slips
        return A * (np.cos(w * slips) * d / w - (np.sin(w * t) - np.sin(w * slips)) / w**2) - F * d**2 / 2

    impact_time = brentq(lambda t: way(t) - end, slips, 0.5, xtol=1e-15)
    turns = [t + k * np.pi / w for k in range(3) for t in (slips, impact_time)]  # ahead, back, ahead by equal strokes
    assert sol.success
    slides = [mode[2] for _, mode in sol.modes]
    found = [sol.t[sol.modes[k][0]] for k in range(1, len(slides)) if slides[k] != slides[k - 1]]
    assert found == pytest.approx(turns, abs=1e-6)  # it slips above the limit by 1e-6
    assert [k for k in slides if k != 1] == [2, 3, 2]
    assert sol.q.min() > -1e-14
    assert sol.q.max() < end + 1e-14
    assert mbdae.drift(sol).energy_relative < 1e-10


def test_friction_of_the_source_is_taken_on_request():
    mech = block(JointFriction(exact=True), source=0.7)
    assert (mech.switches[0].spec.kinetic, mech.switches[0].spec.static) == (0.7, 0.7)
    with pytest.raises(InputError, match=r"static is at least the 0.7 of joint 'x'"):
        block(JointFriction(static=0.5), source=0.7)


def test_wrong_friction_is_rejected():
    with pytest.raises(InputError, match=r"static is at least friction, 2, got 1"):
        JointFriction(friction=2.0, static=1.0)
    with pytest.raises(InputError, match="velocity belongs to regularized friction"):
        JointFriction(friction=2.0, static=3.0, velocity=0.1)
    with pytest.raises(InputError, match="joint 'x' has two exact friction forces"):
        block(JointFriction(friction=2.0, exact=True), JointFriction(friction=2.0, exact=True))
    with pytest.raises(InputError, match="exact friction needs a joint of one degree of freedom; 'top' has 6"):
        mbdae.load("heavy_top", forces=[JointFriction(joint="top", friction=1.0, exact=True)])


@pytest.mark.parametrize("torque", [0.0, 1e-300, 1e-170, 1e-155])
def test_a_joint_that_sticks_without_a_load_goes_on(torque):
    push = JointTorque(joint="x", torque=Harmonic(amplitude=torque, omega=3.0, phase=1.0))
    sol = mbdae.solve(block(push, JointFriction(joint="x", friction=1.0, static=1.0)), (0, 1))
    assert sol.success, sol.message
    assert words(sol) == [("sticking",)]
    assert not sol.q.any()
