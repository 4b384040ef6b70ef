"""Contacts, stops, ratchets and joints that stick in model exchange: event indicators, impacts and modes at events."""

import numpy as np
import pytest
from bodies import body, load
from fmu_masters import Master, simulated, solved_by_scipy

import mbdae
from mbdae import Input, JointTorque, Mechanism

pytestmark = pytest.mark.native
ENDS = {"pendulum_on_stop": 3.0, "slider_crank_with_stop": 0.62, "bouncing_chain": 0.5, "stick_slip_slider": 2.0,
        "ratchet": 2.0, "woodpecker": 0.2, "geneva_drive": 4.0}  # fmt: skip
FALL = 2 * 9.81 * (np.cos(0.3) - np.cos(1.2))  # squared speed of a pendulum of 1 m at its stop, from energy


@pytest.fixture(scope="module")
def pendulum(tmp_path_factory):
    return mbdae.export("pendulum_on_stop", tmp_path_factory.mktemp("fmu") / "stop.fmu", kind="me")


def sprung_foot(folder):
    """A body presses its foot down by a spring: flights end long before speed and acceleration predict."""
    foot, head = (body(n, "prismatic", mass=m, axis=[0.0, 0.0, 1.0]) for n, m in (("foot", 0.1), ("head", 1.0)))
    m = load(folder, [foot, {**head, "parent": "foot"}], [])
    spring = mbdae.JointSpring(joint="head", stiffness=1e4)
    stop, start = mbdae.Stop(joint="foot", lower=0.0, restitution=0.5), {"q": {"foot": 0.1}}
    return Mechanism(m.model, forces=[spring], stops=[stop], start=start, title="foot")


@pytest.mark.parametrize("name", [*ENDS, sprung_foot])
def test_modes_change_at_the_times_of_a_run(name, tmp_path):
    """Solved by DOP853 of scipy; times of a run with pherk6 and 1e-13."""
    model, end = (name, ENDS[name]) if name in ENDS else (name(tmp_path), 0.15)
    unit = mbdae.export(model, tmp_path / "x.fmu", kind="me")
    times, last = solved_by_scipy(unit, end)
    accurate = {"method": "pherk6", "rtol": 1e-13, "atol": 1e-14}
    sol = mbdae.solve(model, (0.0, end), **accurate)
    expected = np.union1d([sol.t[i] for i, _ in sol.modes][1:], [x.t for x in sol.impacts])
    assert len(expected) >= 3
    distances = [np.abs(times - t).min() for t in expected]  # events for other coordinates are among the times
    assert max(distances) <= 1e-10
    signals = mbdae.solve(model, (0.0, end), t_eval=[end], **accurate).signals()
    np.testing.assert_allclose(last, [signals[x][-1] for x in unit.outputs], rtol=1e-8, atol=1e-8)


def test_impacts_are_events_with_newton_s_restitution(pendulum):
    """The speed of the first impact follows from energy; each reverses it by the coefficient 0.7."""
    found = simulated(
        pendulum, "me", 3.0, solver="CVode", relative_tolerance=1e-12, output_interval=0.05, record_events=True
    )
    jumps = np.flatnonzero((np.diff(found["time"]) == 0.0) & (np.abs(np.diff(found["v.rod"])) > 0.1))
    before, after = found["v.rod"][jumps], found["v.rod"][jumps + 1]
    assert before[0] == pytest.approx(-np.sqrt(FALL), rel=1e-10)
    assert np.abs(after + 0.7 * before).max() <= 1e-12
    assert np.abs(after[:-1] + before[1:]).max() <= 1e-9  # no energy is lost between impacts


@pytest.mark.parametrize(
    "settings", [{"solver": "Euler", "step_size": 1e-3}, *({"relative_tolerance": 10.0**-k} for k in (5, 8, 11))]
)
def test_a_solver_of_any_accuracy_comes_to_rest(settings, pendulum):
    """Flights below the accuracy of the solver end in rest; without that, their events would never end."""
    end, interval = 8.0, settings.get("step_size", 0.04)
    found = simulated(pendulum, "me", end, output_interval=interval, timeout=30.0, **settings)
    assert found["time"][-1] == pytest.approx(end)
    if "solver" in settings:  # Euler's method adds g h to the speed of each flight
        assert abs(found["q.rod"][-1] - 0.3) <= 2e-5
        return
    assert found["q.rod"][-1] == pytest.approx(0.3, abs=1e-14)
    assert found["v.rod"][-1] == pytest.approx(0.0, abs=1e-14)


def test_states_beyond_those_of_a_mode_are_held(pendulum):
    """At rest on the stop nothing moves: both states are constant, and saved states go on there."""
    master = Master(pendulum, "me")
    master.set_x([0.1, 0.0])
    sense = np.sign(master.get("q.rod")[0] - 1.2)  # of the local coordinate, an angle
    master.set_x([sense * (0.3 - 1.2 - 1e-12), 0.0])  # on the stop
    assert master.get("guard[1]")[0] < 0
    master.fmu.enterEventMode()
    master.fmu.updateDiscreteStates()
    saved = master.fmu.getFMUState()
    master.fmu.enterContinuousTimeMode()
    assert np.array_equal(master.rate(), [0.0, 0.0])
    load = master.get("guard[1]")[0]
    assert load == pytest.approx(9.81 * np.sin(0.3), rel=1e-12)  # of 1 kg at 1 m: it holds the rod
    other = Master(pendulum, "me")
    other.fmu.setFMUState(other.fmu.deserializeFMUState(master.fmu.serializeFMUState(saved)))
    assert np.array_equal(other.rate(), [0.0, 0.0])
    assert other.get("guard[1]")[0] == load
    assert np.array_equal(other.jacobian()[:2], np.zeros((2, 2)))


def test_an_input_that_jumps_releases_a_joint_that_sticks(tmp_path):
    """F > mu m g at an event: it slips at once, with v' = (F - mu m g)/m."""
    mass, limit = 2.0, 5.0
    m = load(tmp_path, [body("block", "prismatic", mass=mass, axis=[1.0, 0.0, 0.0])], [])
    friction = mbdae.JointFriction(joint="block", friction=limit, exact=True)
    m = Mechanism(m.model, forces=[friction, JointTorque(joint="block", torque=Input(name="push"))], title="block")
    master = Master(mbdae.export(m, tmp_path / "block.fmu", kind="me", outputs=["a.block"]), "me")
    for share in (0.9, 1.2, 1.1):
        push, acceleration = share * limit, max(share - 1.0, 0.0) * limit / mass
        master.fmu.enterEventMode()
        master.set("push", push)
        master.fmu.updateDiscreteStates()
        master.fmu.enterContinuousTimeMode()
        assert master.get("a.block")[0] == pytest.approx(acceleration, abs=1e-13)


def test_events_need_no_more_memory(pendulum):
    """Impacts, other coordinates and saved states, by Euler's method."""
    resource = pytest.importorskip("resource")
    master, sizes = Master(pendulum, "me"), []
    for k in range(4000):
        master.fmu.setTime(k * 1e-3)
        master.set_x(master.x() + 1e-3 * master.rate())
        if master.fmu.completedIntegratorStep()[0]:
            master.fmu.enterEventMode()
            master.fmu.updateDiscreteStates()
            master.fmu.enterContinuousTimeMode()
        if k % 100 == 0:
            master.fmu.freeFMUState(master.fmu.getFMUState())
        if k in (2000, 3999):
            sizes.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    assert sizes[1] - sizes[0] <= 256  # kB
