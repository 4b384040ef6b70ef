"""Events on a swinging pendulum, against its period from the elliptic integral and a tight reference."""

import numpy as np
import pytest
from scipy.special import ellipk

import mbdae

QUARTER = float(ellipk(0.5)) / np.sqrt(9.81)  # from horizontal rest to the lowest point: K(sin 45 degrees) / omega


def run(**options):
    return mbdae.solve(mbdae.load("pendulum"), (0, 6), rtol=1e-12, atol=1e-14, **options)


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("method", ["pherk5", "herk5", "pherk6", "radau5"])
def test_turning_points(method):
    turning = mbdae.Event(lambda t, q, v: v[0] * q[2] - v[2] * q[0])  # the angular velocity changes its sign
    lowest = mbdae.Event(lambda t, q, v: q[0])
    sol = run(method=method, events=[turning, lowest])
    n = int(6 / (2 * QUARTER))
    times = sol.events[0][0]
    assert times[0] == 0  # at rest: the event at the start is reported, and does not end the run
    assert np.abs(times[1:] - 2 * QUARTER * np.arange(1, n + 1)).max() < 1e-9
    passed = sol.events[1][0]
    assert np.abs(passed - QUARTER * (2 * np.arange(len(passed)) + 1)).max() < 1e-10
    points = sol.events[1][1]
    assert np.abs(points[:, 0]).max() < 1e-10


@pytest.mark.usefixtures("back_end")
def test_direction_and_terminal():
    rising = mbdae.Event(lambda t, q, v: q[0], direction=1, terminal=True)
    falling = mbdae.Event(lambda t, q, v: q[0], direction=-1)
    sol = run(events=[rising, falling])
    assert sol.status == "event"
    assert sol.success
    assert abs(sol.t[-1] - QUARTER) < 1e-10
    assert len(sol.events[1][0]) == 0
    again = mbdae.solve(mbdae.load("pendulum"), (sol.t[-1], 6), sol.q[-1], sol.v[-1], rtol=1e-10, events=rising)
    assert abs(again.t[-1] - 5 * QUARTER) < 1e-8  # a run may start on the surface where another one ended


@pytest.mark.usefixtures("back_end")
def test_several_in_one_step():
    marks = [mbdae.Event(lambda t, q, v, c=c: t - c) for c in (0.311, 0.312, 0.313)]
    sol = mbdae.solve(mbdae.load("pendulum"), (0, 1), method="herk3", step=0.1, events=marks)
    assert [e[0][0] for e in sol.events] == pytest.approx([0.311, 0.312, 0.313], abs=1e-12)
    twice = mbdae.Event(lambda t, q, v: (t - 0.21) * (t - 0.29))
    sol = mbdae.solve(mbdae.load("pendulum"), (0, 1), method="herk3", step=0.1, events=twice)
    assert sol.events[0][0] == pytest.approx([0.21, 0.29], abs=1e-12)


def test_functions_with_attributes_as_in_scipy():
    def ground(t, q, v):
        return q[2] + 0.5

    ground.terminal, ground.direction = True, -1
    sol = run(events=ground)
    assert sol.status == "event"
    assert abs(sol.q[-1][2] + 0.5) < 1e-12
