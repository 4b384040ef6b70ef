"""One-way clutches and ratchets against closed forms, both back ends."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import mbdae
from mbdae import Clutch, Driver, JointDamping, JointTorque, Mechanism
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.time_functions.time_functions import Harmonic

INERTIA = 0.2


def wheels(forces=(), joint=pin.JointModelRZ, **more):
    """Two wheels about z, ``input`` and ``wheel``."""
    model = pin.Model()
    model.gravity.linear = np.zeros(3)
    for name in ("input", "wheel"):
        j = model.addJoint(0, joint(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(j, pin.Inertia(1.0, np.zeros(3), INERTIA * np.eye(3)), pin.SE3.Identity())
    return Mechanism(model, forces=forces, **more)


@pytest.mark.parametrize(("direction", "joint"), [(1, pin.JointModelRZ), (-1, pin.JointModelRUBZ)])
def test_a_one_way_clutch_overruns_and_engages(direction, joint, back_end):
    """The wheel under load T follows A sin wt while its acceleration is above -T/J; then it overruns."""
    A, w, T = 10.0, 3.0, 1.5
    drive = Driver(joint="input", speed=Harmonic(amplitude=direction * A, omega=w))
    clutch = Clutch(joints=("wheel", "input"), direction=direction)
    mech = wheels([JointTorque(joint="wheel", torque=-direction * T)], joint, drivers=[drive], clutches=[clutch])
    sol = mbdae.solve(mech, (0, 2.5), rtol=1e-10)
    leaves = np.arccos(-T / (INERTIA * A * w)) / w
    speed = A * np.sin(w * leaves)
    catches = brentq(lambda t: A * np.sin(w * t) - speed + T / INERTIA * (t - leaves), 1, 2.5, xtol=1e-15)
    assert [m for _, m in sol.modes] == [(1,), (0,), (1,)]
    np.testing.assert_allclose([sol.t[i] for i, _ in sol.modes[1:]], [leaves, catches], rtol=0, atol=9e-14)
    assert [leaves, catches] == pytest.approx([0.60782553, 2.05520791], abs=1e-8)
    assert back_end != "native" or sol.stats["transitions_in_core"] == 2
    assert not sol.impacts
    assert mbdae.drift(sol).energy_relative < 1e-10


@pytest.mark.usefixtures("back_end")
def test_a_clutch_that_closes_on_wheels_at_different_speeds_is_an_impact():
    sol = mbdae.solve(wheels(clutches=[Clutch(joints=("wheel", "input"))]), (0, 1), np.zeros(2), np.array([3.0, 1.0]))
    assert sol.v[-1] == pytest.approx([2.0, 2.0], abs=1e-14)
    (impact,) = sol.impacts
    assert (impact.where, impact.loss) == (("wheel-input clutch",), pytest.approx(INERTIA * (9 + 1 - 8) / 2))
    assert impact.impulse == pytest.approx([INERTIA])


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("direction", [1, -1])
def test_a_ratchet_runs_back_to_its_last_tooth(direction):
    """J v' + c v = T cos wt: ahead from rest until v = 0, back to the tooth, at rest until the torque reverses."""
    T, w, c, pitch = 1.0, 3.0, 0.5, 0.1
    push = JointTorque(joint="wheel", torque=Harmonic(amplitude=direction * T, omega=w, phase=np.pi / 2))
    ratchet = Clutch(joint="wheel", direction=direction, pitch=pitch)
    mech = wheels([push, JointDamping(joint="wheel", damping=c)], clutches=[ratchet])
    sol = mbdae.solve(mech, (0, 3.5), rtol=1e-11)
    names = [mech.switches[0].states[m[0]] for _, m in sol.modes]
    assert names == ["free-running", "running backwards", "locked", "free-running", "running backwards", "locked"]
    a, b = np.linalg.solve([[c, INERTIA * w], [-INERTIA * w, c]], [T, 0.0])  # v = a cos wt + b sin wt - a exp(-ct/J)

    def speed(t):
        return a * np.cos(w * t) + b * np.sin(w * t) - a * np.exp(-c * t / INERTIA)

    def angle(t):
        return (a * np.sin(w * t) + b * (1 - np.cos(w * t))) / w - a * INERTIA / c * (1 - np.exp(-c * t / INERTIA))

    turns = brentq(speed, 0.5, 1.2, xtol=1e-15)
    tooth = pitch * np.floor(angle(turns) / pitch)
    meets = brentq(lambda t: angle(t) - tooth, turns, 1.5, xtol=1e-15)
    found = [sol.t[i] for i, _ in sol.modes[1:4]]
    np.testing.assert_allclose(found, [turns, meets, 1.5 * np.pi / w], rtol=0, atol=1e-10)
    assert sol.q[sol.modes[3][0], 1] == pytest.approx(direction * tooth, abs=1e-12)
    assert [x.loss for x in sol.impacts[:1]] == pytest.approx([INERTIA * speed(meets) ** 2 / 2], rel=1e-8)
    assert mbdae.drift(sol).energy_relative < 1e-10


def test_a_file_with_clutches_is_saved_and_loaded(tmp_path):
    mech = wheels(clutches=[Clutch(joints=("wheel", "input"), name="sprag"), Clutch(joint="input", pitch=0.3)])
    sol = mbdae.solve(mech, (0, 1), np.zeros(2), np.array([3.0, 1.0]))
    sol.save(tmp_path / "run.npz")
    again = mbdae.Solution.load(tmp_path / "run.npz")
    assert again.mechanism.clutches == mech.clutches
    assert again.modes == sol.modes


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("swapped", [False, True])
def test_two_opposed_clutches_lock_both_ways(swapped):
    """For any load of any sign: (J_i + r^2 J_w) v_i' = T sin wt, from momentum conserved at the start."""
    T, w, r = 3.0, 40.0, 2.0
    push = JointTorque(joint="input", torque=Harmonic(amplitude=T, omega=w))
    first = Clutch(joints=("wheel", "input"), ratio=r, name="first")
    second = {"joints": ("input", "wheel"), "ratio": 1 / r} if swapped else {"joints": ("wheel", "input"), "ratio": r}
    other = Clutch(direction=1 if swapped else -1, name="second", **second)
    sol = mbdae.solve(wheels([push], clutches=[first, other]), (0, 1), np.zeros(2), np.array([3.0, 1.0]), rtol=1e-10)
    assert sol.success
    assert len(sol.modes) == 1
    (impact,) = sol.impacts
    assert impact.loss == pytest.approx(INERTIA * (10 - 25 / (1 + r * r)) / 2, rel=1e-12)
    v = (3 + r) / (1 + r * r) + T / (w * INERTIA * (1 + r * r)) * (1 - np.cos(w))
    assert sol.v[-1] == pytest.approx([v, r * v], rel=1e-9)
    assert mbdae.drift(sol).energy_relative < 1e-10


def test_wrong_clutches_are_rejected():
    with pytest.raises(InputError, match="a clutch needs one of joint and joints"):
        Clutch()
    with pytest.raises(InputError, match="a clutch joins 'a' with itself"):
        Clutch(joints=("a", "a"))
    with pytest.raises(InputError, match="tooth belongs to a ratchet"):
        Clutch(joint="wheel", tooth=0.1)
    with pytest.raises(UnknownNameError, match="unknown joint 'whel'"):
        wheels(clutches=[Clutch(joint="whel")])
    with pytest.raises(InputError, match="the angle of an unbounded joint does not determine the next tooth"):
        wheels((), pin.JointModelRUBZ, clutches=[Clutch(joint="wheel", pitch=0.1)])


@pytest.mark.usefixtures("back_end")
def test_a_driver_that_turns_back_against_a_clutch_ends_the_run():
    """No torque on the clutch stops it: the run ended after a hundred changes of the mode, in seconds or minutes."""
    drive = Driver(joint="wheel", speed=Harmonic(amplitude=1.0, omega=2.0, phase=np.pi / 2))
    sol = mbdae.solve(wheels(drivers=[drive], clutches=[Clutch(joint="wheel", name="pawl")]), (0, 1))
    assert (sol.status, len(sol.modes)) == ("impact", 1)
    assert sol.message.startswith("'pawl': closures or drivers move against its direction, and no force on it can stop")
    assert sol.t[-1] == pytest.approx(np.pi / 4, abs=1e-9)


def test_a_ratchet_winch_lifts_a_tooth_in_each_stroke():
    sol = mbdae.solve(mbdae.load("ratchet"), (0, 6), rtol=1e-8)
    pitch = np.pi / 12
    at = [sol.before(np.array([t]))[0] for t in (2.0, 4.0, 6.0)]
    np.testing.assert_allclose(sol.q[at, 0] / pitch, [1, 2, 3], atol=1e-12)
    catches = 1 + np.arcsin(-0.5 * pitch / 0.2) / np.pi  # the rocker is back by half a tooth
    assert [x.t for x in sol.impacts[:2]] == pytest.approx([catches, 1 + catches], abs=1e-11)
    assert [x.where for x in sol.impacts[:2]] == [("driving pawl",), ("holding pawl",)]
    assert mbdae.drift(sol).energy_relative < 1e-10


LAWS = {"sin": lambda t: np.sin(4 * t), "linear": lambda t: 3 * t, "square": lambda t: t**2, "cubic": lambda t: t**3}


@pytest.mark.parametrize("method", ["pherk6", "radau5"])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_clutch_at_rest_under_a_torque_that_grows_from_zero(law, sign, method):
    """It locks or overruns by the first nonzero derivative of the torque; J x'' = T(t) is integrated twice."""
    torque = LAWS[law]
    push = [lambda t, q, v: np.array([sign * torque(t), 0.0])]
    mech = wheels(push, pin.JointModelRUBZ, clutches=[Clutch(joints=("wheel", "input"))])
    sol = mbdae.solve(mech, (0, 0.75), rtol=1e-10, method=method)
    assert sol.success, sol.message
    assert [m for _, m in sol.modes] == [(1,) if sign > 0 else (0,)]
    whole = quad(torque, 0, 0.75, epsabs=1e-14)[0] / INERTIA
    assert sol.v[-1] == pytest.approx([whole / 2, whole / 2] if sign > 0 else [-whole, 0.0], abs=1e-9)


@pytest.mark.usefixtures("back_end")
def test_a_clutch_at_rest_locks_and_releases_a_wheel_with_drag():
    """2 J v' + c v = T sin wt while it locks; the wheel overruns when its drag alone decelerates it as much."""
    T, w, c = 1.0, 4.0, 0.1
    push = JointTorque(joint="input", torque=Harmonic(amplitude=T, omega=w))
    forces = [push, JointDamping(joint="wheel", damping=c)]
    sol = mbdae.solve(wheels(forces, clutches=[Clutch(joints=("wheel", "input"))]), (0, 2), rtol=1e-11)
    a, b = np.linalg.solve([[c, 2 * INERTIA * w], [-2 * INERTIA * w, c]], [0.0, T])  # v = a cos + b sin - a exp

    def load(t):
        v = a * np.cos(w * t) + b * np.sin(w * t) - a * np.exp(-c * t / (2 * INERTIA))
        return INERTIA * (T * np.sin(w * t) - c * v) / (2 * INERTIA) + c * v

    assert [m for _, m in sol.modes[:2]] == [(1,), (0,)]
    assert sol.t[sol.modes[1][0]] == pytest.approx(brentq(load, 0.5, 1.2, xtol=1e-15), abs=1e-12)


def test_stops_at_rest_become_active_one_by_one():
    """Of two active stops the one in the direction of the growing torque closes."""
    stops = [mbdae.Stop(joint="input", lower=0.0, upper=1.0, name="a"), mbdae.Stop(joint="wheel", upper=0.0, name="b")]
    mech = wheels([lambda t, q, v: np.array([-t, -(t**3)])], stops=stops)
    sol = mbdae.solve(mech, (0, 1), np.zeros(2), np.zeros(2), rtol=1e-9)
    assert sol.success, sol.message
    assert len(sol.modes) == 1
    assert sol.v[-1] == pytest.approx([0.0, -1 / 4 / INERTIA], abs=1e-9)
    assert sol.lam[-1] == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
