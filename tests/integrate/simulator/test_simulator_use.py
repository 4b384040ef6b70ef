"""Wrong use of a simulator: one line, and nothing recorded is lost; a killed simulation resumes from its last save."""

import pickle
import signal
import subprocess
import sys
from textwrap import dedent

import numpy as np
import pytest

import mbdae
from mbdae import Input, JointTorque, Mechanism


def with_motor(forces=()):
    m = mbdae.load("four_bar")
    torque = JointTorque(joint="crank", torque=Input(name="motor"))
    return Mechanism(m.model, m.closures, [torque, *forces], start=m.start_values)


def rejected(call, match=""):
    with pytest.raises(mbdae.MbdaeError, match=rf"^[^\n]*{match}[^\n]*$"):
        call()


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"t": np.nan}, "t must be"),
        ({"t": "now"}, "t must be"),
        ({"q": [0.1]}, "q has shape.*four_bar"),
        ({"q": [np.nan] * 3}, "q is not finite"),
        ({"q": [1.2, 0.0, 0.0]}, "pin"),
        ({"v": [1.0, 0.0]}, "v has shape"),
        ({"s": [1.0]}, "s has shape"),
        ({"step": -1e-3}, "step must be"),
        ({"method": "pherk7"}, "pherk7.*pherk6"),
        ({"stepp": 1e-3}, "stepp.*step"),
        ({"t_span": (0, 1)}, "no t_span"),
        ({"max_steps": 3}, "no max_steps"),
        ({"backend": "fortran"}, "fortran"),
        ({"events": 3}, ""),
    ],
)
def test_wrong_arguments(options, match):
    rejected(lambda: mbdae.Simulator(with_motor(), **options), match)


def test_wrong_calls_change_nothing():
    simulator = mbdae.Simulator(with_motor(), step=1e-3)
    simulator["motor"] = 1.0
    simulator.advance(5e-3)
    before = simulator.t, simulator.q, simulator["motor"]
    for dt in (0.0, -1e-3, np.nan, np.inf, "x", True):
        rejected(lambda dt=dt: simulator.advance(dt), "dt must be")
    for value in (np.nan, np.inf, "x", None, True, [1.0]):
        rejected(lambda value=value: simulator.__setitem__("motor", value), "motor")
    rejected(lambda: simulator["engine"], "engine.*motor")
    rejected(lambda: simulator.signals("q.krank"), "q.krank.*q.crank")
    rejected(lambda: simulator.signals(["q.crank"]), "a signal is given by its name, got \\['q.crank'\\]")
    for state in ("x", None, mbdae.Simulator("pendulum", step=1e-3).save(), mbdae.Simulator("four_bar").save()):
        rejected(lambda state=state: simulator.restore(state), "restore|another mechanism")
    after = simulator.t, simulator.q, simulator["motor"]
    assert all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))
    simulator.advance(5e-3)
    assert simulator.solution().t[[0, -1]] == pytest.approx([0.0, 0.01])


def test_a_stopped_simulator_keeps_its_record_and_continues_from_a_save():
    def sensor(t, q, v):
        if t > limit[0]:
            raise ValueError("broken sensor")
        return np.zeros(3)

    limit = [0.015]
    simulator = mbdae.Simulator(with_motor([sensor]), step=1e-3)
    simulator.advance(0.01)
    state = simulator.save()
    rejected(lambda: simulator.advance(0.01), "broken sensor")
    calls = simulator.save, lambda: simulator.advance(1e-3), lambda: simulator.__setitem__("motor", 1.0)
    for call in calls:
        rejected(call, "stopped at t = 0.01.*broken sensor")
    rejected(simulator.tangent, "has not advanced")
    sol = simulator.solution()
    assert sol.status == "force"
    assert 0.01 < sol.t[-1] <= 0.015
    limit[0] = np.inf
    simulator.restore(state)
    simulator.advance(0.01)
    assert simulator.t == pytest.approx(0.02)


ENDLESS = """
    import os, pickle, sys
    import mbdae
    simulator = mbdae.Simulator("four_bar", step=1e-3)
    for k in range(10**9):
        simulator.advance(7e-3)
        if k % 10 == 9:
            with open(sys.argv[1] + ".new", "wb") as file:
                pickle.dump(simulator.save(), file)
            os.replace(sys.argv[1] + ".new", sys.argv[1])
            print(k + 1, flush=True)
"""


def test_a_killed_simulation_resumes_bit_by_bit(tmp_path):
    path = tmp_path / "state"
    process = subprocess.Popen([sys.executable, "-c", dedent(ENDLESS), str(path)], stdout=subprocess.PIPE, text=True)
    assert [process.stdout.readline().strip() for _ in range(2)] == ["10", "20"]
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert process.returncode == -signal.SIGKILL
    resumed, whole = (mbdae.Simulator("four_bar", step=1e-3) for _ in range(2))
    resumed.restore(pickle.loads(path.read_bytes()))
    advances = round(resumed.t / 7e-3)
    assert advances >= 20
    for k in range(advances + 15):
        whole.advance(7e-3)
        if k >= advances:
            resumed.advance(7e-3)
    assert whole.t == resumed.t
    assert np.array_equal(whole.q, resumed.q)
    assert np.array_equal(whole.v, resumed.v)


@pytest.mark.parametrize("options", [{"step": 0.004}, {"rtol": 1e-8, "project": True}])
def test_singular_configurations_between_advances_are_found(options):
    mech = mbdae.load("n_four_bar", N=1)
    expected = mbdae.solve(mech, (0.0, 2.0), **options).singular
    simulator = mbdae.Simulator(mech, **options)
    for _ in range(100):
        simulator.advance(0.02)
    found = simulator.solution().singular
    assert len(found) == len(expected) > 0
    assert [x.t for x in found] == pytest.approx([x.t for x in expected], abs=1e-6)


@pytest.mark.parametrize("options", [{"step": 1e-3}, {"rtol": 1e-8}, {"method": "radau5", "step": 1e-3}])
def test_reading_the_state_between_advances_changes_nothing(options):
    """Steps that the core keeps are those that are recorded one by one."""
    read, unread = (mbdae.Simulator("four_bar", **options) for _ in range(2))
    for k in range(700):
        read.advance(1e-3)
        unread.advance(1e-3)
        if k % 7 == 0:
            assert np.array_equal(read.solution().q[-1], read.q)
        if k % 100 == 0:
            assert np.array_equal(read.q, unread.q)
            assert unread.signals("kinetic") == read.signals("kinetic")
    one, other = read.solution(), unread.solution()
    assert np.array_equal(one.t, other.t)
    assert np.array_equal(one.y, other.y)
    assert one.stats["steps"] == other.stats["steps"]
    assert one.stats["rejected"] == other.stats["rejected"]


@pytest.mark.parametrize("backend", ["native", "python"])
def test_the_largest_number_of_steps_of_a_file_is_for_runs(backend, tmp_path):
    inertia = "mass = 1.0, inertia = [1, 1, 1, 0, 0, 0]"
    body = f'name = "disc", parent = "world", joint = "revolute", axis = [0, 0, 1], {inertia}'
    path = tmp_path / "disc.toml"
    path.write_text(f"body = [{{{body}}}]\n[solve]\nmax_steps = 2\nstep = 0.01\n")
    assert mbdae.solve(path, (0, 0.1), backend=backend).status == "max_steps"
    simulator = mbdae.Simulator(path, backend=backend)
    simulator.advance(0.1)
    assert simulator.t == pytest.approx(0.1)
