"""Events at the instant of a terminal one: they are located too, whichever of them ends the run."""

import numpy as np
import pytest

import mbdae
from mbdae import Event

CRANKS = ["crank_0", "crank_1", "crank_2"]


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("terminal", CRANKS)
@pytest.mark.parametrize("method", ["pherk5", "radau5"])
def test_parallel_cranks_pass_an_angle_at_once(method, terminal):
    """Three cranks of a parallelogram linkage; those after the terminal one are later by less than rounding."""
    mech = mbdae.load("n_four_bar", N=2)
    for levels in ([1.0] * 3, [1.0, 1.0 + 2e-14, 1.0 - 3e-14], [1.0 + 4e-14, 1.0, 1.0 + 2e-14]):
        events = [Event(f"q.{c} = {x!r}", terminal=c == terminal) for c, x in zip(CRANKS, levels, strict=True)]
        sol = mbdae.solve(mech, (0, 2), events=events, method=method, rtol=1e-9)
        assert sol.status == "event"
        times = [t for t, _ in sol.events]
        assert [len(t) for t in times] == [1, 1, 1]
        assert np.concatenate(times) == pytest.approx([0.4184187] * 3, abs=1e-6)
        assert np.ptp(np.concatenate(times)) <= 1e-12
        assert sol.t[-1] == pytest.approx(times[0][0], abs=1e-12)


@pytest.mark.usefixtures("back_end")
def test_what_comes_behind_the_terminal_event_is_not_found():
    mech = mbdae.load("n_four_bar", N=2)
    events = [Event("q.crank_0 = 1.0", terminal=True), Event("q.crank_1 = 0.9999"), Event("q.crank_2 = 1.0001")]
    sol = mbdae.solve(mech, (0, 2), events=events)
    assert [len(t) for t, _ in sol.events] == [1, 0, 1]


def level(t, q, v):
    return np.sin(8 * q[0]) - 0.3


@pytest.mark.parametrize("backend", ["python", "native"])
@pytest.mark.parametrize("method", ["herk3", "pherk5", "pherk6", "radau5"])
@pytest.mark.parametrize("end", [3.0, -3.0])
@pytest.mark.parametrize("rtol", [1e-3, 1e-5, 1e-7])
def test_a_function_that_ends_a_run_occurs_at_its_end(backend, method, end, rtol):
    events = [level, Event(level, terminal=True)]  # the dense output, which is less accurate, locates both
    sol = mbdae.solve("double_pendulum", end, events=events, method=method, rtol=rtol, backend=backend)
    assert (sol.status, sol.message) == ("event", "a terminal event occurred: level")
    for times, points in sol.events:
        assert times.tolist() == [sol.t[-1]]
        np.testing.assert_array_equal(points, sol.y[-1:])
    assert abs(level(sol.t[-1], sol.q[-1], sol.v[-1])) < 1e-10
