"""Impacts of exported mechanisms: events of co-simulation, at the times of a run."""

import numpy as np
import pytest
from fmu_masters import Master, simulated

import mbdae

pytestmark = pytest.mark.native
RESTITUTION, END = 0.7, 3.0


@pytest.fixture(scope="module")
def unit(tmp_path_factory):
    m = mbdae.load("pendulum_on_stop")
    return mbdae.export(m, tmp_path_factory.mktemp("fmu") / "stop.fmu", kind="cs", method="pherk5", step=1e-2)


def test_impacts_are_events_with_newton_s_restitution(unit):
    """A step ends before the impact; v changes sign in event mode, by the coefficient of restitution."""
    settings = {"use_event_mode": True, "early_return_allowed": True, "record_events": True}
    found = simulated(unit, "cs", END, step_size=1e-2, output_interval=1e-2, **settings)
    first = np.flatnonzero(np.diff(found["time"]) == 0.0)
    sol = mbdae.solve("pendulum_on_stop", (0.0, END), method="pherk5", step=1e-2)
    assert np.abs(found["time"][first] - [x.t for x in sol.impacts if x.t < END]).max() <= 1e-10
    before, after = found["v.rod"][first], found["v.rod"][first + 1]
    assert np.abs(after + RESTITUTION * before).max() <= 1e-12 * np.abs(before).max()
    assert np.abs(found["q.rod"][first] - 0.3).max() <= 1e-12  # the stop
    # falls from 1.2 rad: the speed of the first impact follows from energy, v^2 = 2 g (cos 0.3 - cos 1.2)
    assert before[0] == pytest.approx(-np.sqrt(2 * 9.81 * (np.cos(0.3) - np.cos(1.2))), rel=1e-5)


def test_without_event_mode_the_steps_are_those_of_a_run(unit):
    found = simulated(unit, "cs", END, step_size=1e-2, output_interval=1e-2)
    sol = mbdae.solve("pendulum_on_stop", (0.0, END), method="pherk5", step=1e-2)
    assert found["q.rod"][-1] == pytest.approx(sol.q[-1, 0], abs=1e-10)


def test_states_between_impacts_are_saved(unit):
    master = Master(unit, "cs")
    for k in range(100):
        master.step(k * 1e-2, 1e-2)
    saved = master.fmu.getFMUState()
    ends = []
    for _ in range(2):
        for k in range(100, 150):
            master.step(k * 1e-2, 1e-2)
        ends.append(master.get(*unit.outputs))
        master.fmu.setFMUState(saved)
    assert np.array_equal(*ends)


def test_rest_on_the_stop_is_an_error(unit, capfd):
    master, times = Master(unit, "cs"), []

    def run():
        for k in range(800):
            times.append(k * 1e-2)
            master.step(times[-1], 1e-2)

    with pytest.raises(Exception, match="fmi3DoStep"):
        run()
    assert times[-1] == pytest.approx(4.3, abs=0.2)  # flights shrink by 0.7
    assert "a contact that remains closed, opens or slides is not supported" in capfd.readouterr().out
