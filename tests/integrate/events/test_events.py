"""Events on a swinging pendulum, against its period from the elliptic integral and a tight reference."""

import numpy as np
import pytest
from links import arm
from scipy.special import ellipk
from shared import shared_model
from smooth import SMOOTH

import mbdae
from mbdae.mechanism.time_functions.time_functions import Steps
from mbdae.mechanism.tree.tree_terms import flexible_bodies

QUARTER = float(ellipk(0.5)) / np.sqrt(9.81)  # from horizontal rest to the lowest point: K(sin 45 degrees) / omega


def run(T=6, **options):
    return mbdae.solve(shared_model("pendulum"), (0, T), **{"rtol": 1e-10, "atol": 1e-12, **options})


@pytest.mark.parametrize("method", ["pherk5", "herk5", "pherk6", "radau5"])
def test_reversals(method, back_end):
    reversal = mbdae.Event(lambda t, q, v: v[0] * q[2] - v[2] * q[0])  # the angular velocity changes sign
    lowest = mbdae.Event(lambda t, q, v: q[0])
    T, swings = (2.5, 2) if back_end == "native" and method == "pherk5" else (1.25, 1)  # of many steps
    coarse = {"rtol": 1e-9, "atol": 1e-11} if method in ("herk5", "radau5") else {}
    sol = run(T=T, method=method, events=[reversal, lowest], **coarse)
    n = int(T / (2 * QUARTER))
    times = sol.events[0][0]
    assert times[0] == 0  # at rest: the event at the start is reported, and does not end the run
    assert np.abs(times[1:] - 2 * QUARTER * np.arange(1, n + 1)).max() < 1e-9
    passed = sol.events[1][0]
    assert np.abs(passed - QUARTER * (2 * np.arange(len(passed)) + 1)).max() < 1e-10
    points = sol.events[1][1]
    assert (n, len(passed)) == (swings, swings)
    assert np.abs(points[:, 0]).max() < 1e-10


@pytest.mark.usefixtures("back_end")
def test_direction_and_terminal():
    upward = mbdae.Event(lambda t, q, v: q[0], direction=1, terminal=True)
    falling = mbdae.Event(lambda t, q, v: q[0], direction=-1)
    sol = run(events=[upward, falling])
    assert sol.status == "event"
    assert sol.success
    assert abs(sol.t[-1] - QUARTER) < 1e-10
    assert len(sol.events[1][0]) == 0
    again = mbdae.solve(shared_model("pendulum"), (sol.t[-1], 6), sol.q[-1], sol.v[-1], rtol=1e-9, events=upward)
    assert abs(again.t[-1] - 5 * QUARTER) < 1e-8  # a run may start on the surface where another one ended


@pytest.mark.usefixtures("back_end")
def test_several_in_one_step():
    marks = [mbdae.Event(lambda t, q, v, c=c: t - c) for c in (0.311, 0.312, 0.313)]
    sol = mbdae.solve(shared_model("pendulum"), (0, 1), method="herk3", step=0.1, events=marks)
    assert [e[0][0] for e in sol.events] == pytest.approx([0.311, 0.312, 0.313], abs=1e-12)
    twice = mbdae.Event(lambda t, q, v: (t - 0.21) * (t - 0.29))
    sol = mbdae.solve(shared_model("pendulum"), (0, 1), method="herk3", step=0.1, events=twice)
    assert sol.events[0][0] == pytest.approx([0.21, 0.29], abs=1e-12)


def test_functions_with_attributes_as_in_scipy():
    def ground(t, q, v):
        return q[2] + 0.5

    ground.terminal, ground.direction = True, -1
    sol = run(events=ground)
    assert sol.status == "event"
    assert abs(sol.q[-1][2] + 0.5) < 1e-12


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("options", [{}, {"project": True}, {"formulation": "ggl"}], ids=str)
def test_closures_hold_in_a_terminal_event(name, options):
    """The event: the fastest coordinate passes its value at three fifths of the span."""
    mech = shared_model(name)
    vibrates = bool(flexible_bodies(mech.model))
    options = {"rtol": 1e-8 if vibrates else 1e-4, **options}
    system, end = mech.system(), min(mech.duration, 0.01 if vibrates else 0.15)
    plain = mbdae.solve(mech, (0, end), **options)
    place, speed = plain(0.6 * end)
    k = int(np.abs(speed).argmax())
    passage = mbdae.Event(lambda t, q, v: mech.manifold.difference(place, q)[k], terminal=True)
    sol = mbdae.solve(mech, (0, end), events=passage, **options)
    assert sol.status == "event"

    def open_by(sol, i):
        return np.array([np.abs(r).max(initial=0) for r in system.residual(sol.t[i], sol.q[i], sol.v[i])])

    after = int(np.searchsorted(plain.t, sol.t[-1]))
    usual = 2 * np.maximum(open_by(plain, after - 1), open_by(plain, after))
    usual[1] *= sum(sol.redundant.values()) > 0  # positions drift, and then rows depend only approximately
    met = np.array([1e-13, 1e-12 * (1 + np.abs(sol.v[-1]).max())])
    assert (open_by(sol, -1) <= met + (usual if len(options) == 1 else 0)).all()
    assert mbdae.solve(mech, (sol.t[-1], end), sol.q[-1], sol.v[-1], sol.s[-1], **options).success


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize(("method", "order"), [("herk3", 3), ("pherk4", 4), ("pherk5", 5), ("radau5", 5)])
def test_the_time_of_a_terminal_event_has_the_order_of_the_method(method, order):
    lowest, errors = mbdae.Event(lambda t, q, v: q[0], terminal=True), []
    for n in (20, 40, 80):
        sol = mbdae.solve(shared_model("pendulum"), (0, 0.7), method=method, step=0.7 / n, events=lowest)
        assert abs(sol.q[-1][0]) < 1e-14
        errors.append(abs(sol.t[-1] - QUARTER))
    slopes = -np.diff(np.log2(errors))
    assert (slopes > order - 0.35).all(), (errors, slopes)


@pytest.mark.usefixtures("back_end")
def test_all_events_at_the_time_of_a_terminal_one_are_listed():
    ends = mbdae.Event(lambda t, q, v: q[0], terminal=True)
    sol = run(events=[ends, lambda t, q, v: 2 * q[0], lambda t, q, v: q[0] * (1 + t), lambda t, q, v: t - 0.7])
    assert [len(t) for t, _ in sol.events] == [1, 1, 1, 0]
    for t, y in sol.events[:3]:
        assert t[0] == sol.t[-1]
        np.testing.assert_array_equal(y[0], sol.y[-1])


def test_a_jumping_function_ends_a_run_where_it_jumps():
    sol = run(events=mbdae.Event(lambda t, q, v: -1.0 if t < 0.3 else 1.0, terminal=True))
    assert sol.status == "event"
    assert sol.t[-1] == pytest.approx(0.3, abs=1e-12)


JUMPS = {0.2: 2.0, 0.31: -4.0, 0.5: 0.0, 0.77: 1.0, 0.9: -1.0}  # s, and the torque from there on, N m


def torque(t, q=None, v=None):
    return [1.0, *JUMPS.values()][int(np.searchsorted(list(JUMPS), t, side="right"))]


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("direction", [0, 1, -1])
@pytest.mark.parametrize("options", [{"rtol": 1e-8}, {"step": 0.05, "method": "herk3"}], ids=str)
def test_functions_and_signals_see_a_jump(direction, options):
    """A torque changes sign, or drops to zero, at given times; the time itself crosses one of them."""
    push = mbdae.JointTorque(joint="arm", torque=Steps(points=((0.0, 1.0), *JUMPS.items())), name="push")
    upward, falling, passed = [0.5], [0.31, 0.9], [0.31] if direction >= 0 else []
    expected = {0: [0.31, 0.5, 0.9], 1: upward, -1: falling}[direction]
    watched = ["torque.push", torque, "t = 0.31", lambda t, q, v: t - 0.31]
    events = [mbdae.Event(what, direction=direction) for what in watched]
    sol = mbdae.solve(arm(push), (0, 1), events=events, **options)
    for (times, _), exact in zip(sol.events, [expected, expected, passed, passed], strict=True):
        np.testing.assert_allclose(times, exact, rtol=0, atol=1e-14)
    assert all(np.array_equal(a, b) for a, b in zip(sol.events[0], sol.events[1], strict=True))
    for what in watched[:2]:
        event = mbdae.Event(what, terminal=True, direction=direction)
        ended = mbdae.solve(arm(push), (0, 1), events=event, **options)
        assert (ended.status, ended.t[-1]) == ("event", sol.events[0][0][0])
        np.testing.assert_array_equal(ended.y[-1], sol.y[np.flatnonzero(sol.t == ended.t[-1])[0]])
