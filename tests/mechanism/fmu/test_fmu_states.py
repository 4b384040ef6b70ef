"""States of FMUs: runs and simulators continue from others, and from files."""

import dataclasses
import gc
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from motors import motor
from test_fmu_motion import END, STEP, cart, drive

import mbdae
from mbdae.errors import InputError
from mbdae.integrate.simulator import simulator as simulators
from mbdae.mechanism.fmu.session import saved_states

SETTINGS = {"step": STEP / 2, "method": "pherk5"}


def solved(m, *rest):
    return mbdae.solve(m, *rest, **SETTINGS)


@pytest.fixture
def whole(tmp_path):
    """A motor on a cart, and its run."""
    m = cart(drive(motor(tmp_path)))
    return m, solved(m, (0, END))


def forget():
    """Forget saved states, as another process."""
    saved_states._states.clear()


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("middle", [0.5, 0.53])  # at an instant, and between two
@pytest.mark.parametrize("saved", [False, True])
def test_a_run_continues_from_another(middle, saved, whole, tmp_path):
    m, all_of_it = whole
    first = solved(m, (0, middle))
    solved(m, (0, 0.1))  # the same workspace, and its FMU, in another run
    if saved:
        first.save(tmp_path / "run.npz")
        forget()
        m = cart(drive(motor(tmp_path)))
        first = mbdae.Solution.load(tmp_path / "run.npz")
        assert len(first.lam) == len(first.t)  # needs no FMU
        assert first.external.keys() == {"motor of cart 0"}
    second = solved(m, (middle, END), first.q[-1], first.v[-1], first.s[-1])
    np.testing.assert_allclose(second.y[-1, :3], all_of_it.y[-1, :3], rtol=1e-11)


def test_a_state_that_was_not_kept_is_named(whole):
    m, sol = whole
    with pytest.raises(InputError, match=r"FMU 'motor of cart 0': its state at this point is not kept; begin at"):
        solved(m, (0.2, END), sol.q[20], sol.v[20], sol.s[20])
    with pytest.raises(InputError, match=r"cannot continue at t = 0.2 s: its state belongs to t = 0.98 s"):
        solved(m, (0.2, END), sol.q[-1], sol.v[-1], sol.s[-1])


def test_a_saved_run_does_not_run_the_fmu(whole, tmp_path):
    """It may come from anywhere."""
    whole[1].save(tmp_path / "run.npz")
    sol = mbdae.Solution.load(tmp_path / "run.npz")
    motor(tmp_path).unlink()
    assert mbdae.drift(sol).energy_relative < 1e-12
    with pytest.raises(InputError, match="FMU 'motor of cart 0' is not in the file: load the mechanism with it again"):
        solved(sol.mechanism, (0, 1))


@pytest.mark.usefixtures("back_end")
@pytest.mark.parametrize("steps", [50, 51])  # at an instant, and between two
def test_a_simulator_continues_from_a_snapshot_bit_by_bit(steps, whole):
    m, sol = whole
    simulator, ends = mbdae.Simulator(m, **SETTINGS), []
    for _ in range(steps):
        simulator.advance(STEP / 2)
    snapshot = pickle.dumps(simulator.save())
    forget()
    for one in (simulator, simulator, mbdae.Simulator(m, **SETTINGS)):
        one.restore(pickle.loads(snapshot))
        for _ in range(100 - steps):
            one.advance(STEP / 2)
        ends.append(one._y)
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0], ends[2])
    np.testing.assert_allclose(ends[0][:3], sol.y[-1, :3], rtol=1e-11)


def test_a_snapshot_at_an_instant_keeps_its_sample():
    """The sample just after the snapshot is that of a run without one."""
    m = cart(mbdae.JointPID(joint="cart 0", kp=30, kd=4, reference=0.5, rate=1 / STEP))
    simulator = mbdae.Simulator(m, **SETTINGS)
    for _ in range(10):
        simulator.advance(5 * STEP)
        simulator.restore(simulator.save())
    np.testing.assert_allclose(simulator._y, solved(m, (0, END)).y[-1], rtol=1e-11)


@pytest.mark.parametrize("stop", [False, True])  # with stops, workspaces are not reused
def test_an_fmu_without_saved_states(stop, tmp_path, monkeypatch):
    """It runs, also in long simulations, but there is no snapshot."""
    m = cart(drive(motor(tmp_path, saves=False)))
    if stop:
        limit = mbdae.Stop(joint="cart 0", lower=-5.0, upper=5.0)
        m = mbdae.Mechanism(m.model, forces=m.forces, stops=[limit], start=m.start_values)
    sol = solved(m, (0, END))
    monkeypatch.setattr(simulators, "MAX_NODES", 20)
    simulator = mbdae.Simulator(m, record=False, **SETTINGS)
    for _ in range(100):
        simulator.advance(STEP / 2)
    np.testing.assert_allclose(simulator._y[:3], sol.y[-1, :3], rtol=1e-11)
    with pytest.raises(InputError, match="FMU 'motor of cart 0' cannot save its state: it lacks canSerializeFMUState"):
        simulator.save()
    assert not sol.external
    solved(m, (0, 0.1))
    with pytest.raises(InputError, match=r"is lost: it cannot be saved \(canSerializeFMUState\)"):
        solved(m, (0.98, END), sol.q[-1], sol.v[-1], sol.s[-1])


def test_an_fmu_with_one_instance_per_process(tmp_path):
    m, other = (cart(drive(motor(tmp_path, once=True))) for _ in range(2))
    for _ in range(2):
        solved(m, (0, 0.1))  # each run frees that of the one before
    with pytest.raises(InputError, match="it allows one instance per process, which another run or simulator has"):
        solved(other, (0, 0.1))
    del m
    gc.collect()
    assert solved(other, (0, 0.1)).success


def test_a_damaged_state_in_a_file(whole, tmp_path):
    sol = dataclasses.replace(whole[1], external={"motor of cart 0": b"short"})
    sol.save(tmp_path / "run.npz")
    with pytest.raises(InputError, match=r"run.npz is damaged .*the state of an FMU is damaged"):
        mbdae.Solution.load(tmp_path / "run.npz")


def test_runs_in_threads_agree_bit_by_bit(tmp_path):
    path, gains = motor(tmp_path), (20.0, 40.0)

    def run(kp):
        return solved(cart(drive(path, parameters={"kp": kp, "kd": 2.0, "T": 0.1})), (0, END)).y[-1]

    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(run, gains))
    for found, kp in zip(together, gains, strict=True):
        assert np.array_equal(found, run(kp))
    assert not np.array_equal(*together)
