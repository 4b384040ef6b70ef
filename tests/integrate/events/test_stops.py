"""Stops, planes, ropes and wheels against closed forms, on both back ends."""

import mpmath as mp
import numpy as np
import pinocchio as pin
import pytest
from bouncing import G, add_body, ball, empty, frame, gaps, pendulum, plane

import mbdae
from mbdae import Closure, Mechanism, Stop

BACKENDS = ("native", "python")


def balance(sol):
    s = sol.signals()
    off = s["energy"] - s["energy"][0] - s["work"] + s["work"][0]
    return np.abs(off).max() / max(s["kinetic"].max(), np.ptp(s["potential"]))


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("how", [{"rtol": 1e-9}, {"step": 0.05}], ids=["controlled", "fixed"])
def test_a_ball_bounces_until_it_rests(backend, how):
    # t_1 = sqrt(2 h/g), impacts at t_1 (1 + 2 e (1 - e^k)/(1 - e)), at rest from t_1 (1 + e)/(1 - e) on
    e, rest = 0.8, 1e-7
    sol = mbdae.solve(ball(e, rest), (0, 5), [1.0], [0.0], backend=backend, **how)
    t = np.array([x.t for x in sol.impacts])
    first, k = np.sqrt(2 / G), np.arange(len(t))
    assert sol.status == "finished"
    assert len(t) >= 70
    np.testing.assert_allclose(t, first * (1 + 2 * e * (1 - e**k) / (1 - e)), rtol=0, atol=4e-14)
    end = sol.t[sol.modes[-1][0]]
    assert sol.modes[-1][1] == (1,)
    assert abs(end - first * (1 + e) / (1 - e)) < rest / (1 - e)
    np.testing.assert_allclose(sol.impacts[0].impulse, (1 + e) * np.sqrt(2 * G), rtol=1e-13)
    np.testing.assert_allclose(sol.impacts[0].loss, (1 - e**2) * G, rtol=1e-13)
    assert sol.lam[-1, 0] == pytest.approx(G)
    assert sol.lam[0, 0] == 0
    assert balance(sol) < 1e-13
    assert sol.q.min() > -1e-13


def test_a_pendulum_hits_a_stop():
    # cos top = cos s - e^2 (cos s - cos top); times by elliptic integrals
    mp.mp.dps = 30
    s, top, e = mp.mpf("0.3"), mp.mpf("1.2"), mp.mpf("0.7")

    def fall(top):
        k = mp.sin(top / 2) ** 2
        return (mp.ellipk(k) - mp.ellipf(mp.asin(mp.sin(s / 2) / mp.sin(top / 2)), k)) / mp.sqrt(mp.mpf("9.81"))

    t = [fall(top)]
    for _ in range(30):
        top = mp.acos(mp.cos(s) - e**2 * (mp.cos(s) - mp.cos(top)))
        t.append(t[-1] + 2 * fall(top))
    sol = mbdae.solve(pendulum(), (0, 4.0), [1.2], [0.0], rtol=1e-12)
    found = [x.t for x in sol.impacts]
    assert 8 < len(found) < 27
    np.testing.assert_allclose(found, [float(x) for x in t[: len(found)]], rtol=0, atol=5e-13)
    assert balance(sol) < 1e-12


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_rope_goes_slack_and_taut(backend):
    # from the lowest point with v^2 = 3.5 g L the rope becomes slack at z = (v^2/(g L) - 2)/3 L
    model = empty()
    add_body(model, 0, pin.JointModelTranslation(), "m")
    frame(model, 0, "peg", 0, 0, 0)
    mech = Mechanism(model, [Closure(kind="distance", frames=("peg", "m"), length=1.0, unilateral=True)])
    start = np.array([0, 0, -1.0]), np.array([np.sqrt(3.5 * G), 0, 0])
    sol = mbdae.solve(mech, (0, 1.5), *start, rtol=1e-10, backend=backend)
    assert [mode for _, mode in sol.modes][:3] == [(1,), (0,), (1,)]
    assert sol.q[sol.modes[1][0], 2] == pytest.approx(0.5, abs=1e-10)
    assert sol.lam.max() <= 1e-9
    assert gaps(mech, sol.q[-1]).min() > -1e-12
    assert np.linalg.norm(sol.q, axis=1).max() < 1 + 1e-12
    assert balance(sol) < 1e-9


def test_a_wheel_that_falls_rolls_on():
    # each impact is without slip; with I + m r^2 = 2 I it keeps two thirds of the speed without rotation
    model = empty()
    add_body(model, 0, pin.JointModelFreeFlyer(), "hub", 2.0, inertia=(0.05, 0.09, 0.05))
    touches = {"unilateral": True, "restitution": 0.3}
    rolls = Closure(kind="rolling", frames=("world", "hub"), radius=0.3, axis=(0, 1, 0), **touches)
    q, v = pin.neutral(model), np.array([1.0, 0, 0, 0, 0, 0])
    q[2] = 0.5
    sol = mbdae.solve(Mechanism(model, [rolls]), (0, 1.5), q, v, rtol=1e-9)
    assert sol.modes[-1][1] == (1,)
    assert len(sol.impacts) > 5
    np.testing.assert_allclose(np.hypot(sol.v[-1, 0], sol.v[-1, 2]), 2 / 3, rtol=1e-8)
    np.testing.assert_allclose(sol.v[-1, 4], 2 / 3 / 0.3, rtol=1e-8)


def geared(**stop):
    model = empty(0.0)
    for name in "ab":
        add_body(model, 0, pin.JointModelRY(), name, inertia=(1, 1, 1))
    return Mechanism(model, stops=[Stop(joints=("a", "b"), coefficients=(0.0, 2.0), **stop)])


def test_backlash_is_two_stops_on_a_coupling():
    # -0.1 <= a - 2 b <= 0.1: a hits at t = 0.1 with p = 1/(1 + 4), which leaves a 4/5 and gives b 2/5
    sol = mbdae.solve(geared(lower=-0.1, upper=0.1), (0, 3), [0.0, 0.0], [1.0, 0.0])
    assert [x.t for x in sol.impacts] == pytest.approx([0.1], abs=1e-14)
    np.testing.assert_allclose(sol.v[-1], [0.8, 0.4], rtol=1e-14)
    np.testing.assert_allclose(sol.q[-1, 0] - 2 * sol.q[-1, 1], 0.1, rtol=1e-13)


@pytest.mark.parametrize("above", [1e-9, -1e-9])
def test_a_contact_within_one_step_is_detected(above):
    # thrown down at a plane, with a force that reverses it there: z = above + (t - 1)^2, in one long step
    model = empty(2.0)
    add_body(model, 0, pin.JointModelPZ(), "z")
    mech = Mechanism(model, [plane("z")])
    sol = mbdae.solve(mech, (0, 2), [1.0 + above], [-2.0], step=2.0)
    assert len(sol.impacts) == (above < 0)


def test_a_load_that_reverses_opens_a_stop():
    # pressed by a force A sin wt + T until A sin wt = -T
    model = empty(0.0)
    add_body(model, 0, pin.JointModelPZ(), "z")
    load = mbdae.JointTorque(joint="z", torque={"kind": "harmonic", "offset": -1.0, "amplitude": -2.0, "omega": 3.0})
    mech = Mechanism(model, stops=[Stop(joint="z", lower=0.0)], forces=[load])
    sol = mbdae.solve(mech, (0, 1.6), [0.0], [0.0], rtol=1e-11)
    assert [m for _, m in sol.modes] == [(1,), (0,)]
    assert sol.t[sol.modes[1][0]] == pytest.approx((np.pi + np.arcsin(0.5)) / 3, abs=1e-12)


def test_a_later_contact_is_not_moved_into_an_earlier_impact():
    model = empty()
    for name in "ab":
        add_body(model, 0, pin.JointModelPZ(), name)
    mech = Mechanism(model, stops=[Stop(joint="a", lower=0.0), Stop(joint="b", lower=0.0)])
    h = np.array([1e-3, 1e-3 + 5e-11])
    sol = mbdae.solve(mech, (0, 0.02), h, np.zeros(2), rtol=1e-10)
    assert np.array([x.t for x in sol.impacts]) == pytest.approx(np.sqrt(2 * h / G), rel=1e-12)
    assert balance(sol) < 1e-11


def test_infinitely_fast_switching_in_a_narrow_gap_is_named():
    """Elastic stops 1e-9 m apart, at 1 m/s: without a longer rest, and with flights near the resolution of time."""
    model = empty(0.0)
    add_body(model, 0, pin.JointModelPX(), "x")

    def run(**more):
        slit = Stop(joint="x", lower=0.0, upper=1e-9, restitution=1.0, name="slit", **more)
        return mbdae.solve(Mechanism(model, stops=[slit]), (1000, 1001), np.array([5e-10]), np.ones(1))

    sol = run(rest=1e-12)
    assert sol.status == "switching"
    assert sol.message.startswith("'slit upper': chattering, modes switch without end at t = 1000.0000003")
    assert sol.t[-1] - 1000 == pytest.approx(3e-7, rel=0.01)
    assert np.abs(sol.v).max() == pytest.approx(1.0, rel=1e-12)
    assert run().success  # a flight shorter than 1e-6 s counts as rest
