"""FMUs for co-simulation: validated by FMPy, the steps of a simulator, states saved and restored."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from fmu_masters import STEP, Master, fmpy, motion_outputs, motorized, simulated

import mbdae
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel, parameter_value

pytestmark = pytest.mark.native
MODELS = ("pendulum", "slider_crank", "stewart_platform", "differential_drive", "spatial_slider_crank", "heavy_top")
N = 100


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    m = motorized("slider_crank")
    outputs = [*motion_outputs(m), "a.crank", "force.wrist pin", "g"]
    return m, mbdae.export(m, tmp_path_factory.mktemp("fmu") / "driven.fmu", outputs=outputs, step=STEP)


@pytest.mark.parametrize("name", MODELS)
def test_steps_are_those_of_a_simulator(name, tmp_path):
    m = mbdae.load(name)
    unit = mbdae.export(m, tmp_path / "model.fmu", method="pherk5", step=STEP)
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(unit.path)) == []
    found = simulated(unit, "cs", N * STEP, step_size=STEP, output_interval=STEP)
    simulator = mbdae.Simulator(m, method="pherk5", step=STEP, record=False)
    for _ in range(N):
        simulator.advance(STEP)
    last = np.array([found[name][-1] for name in unit.outputs])
    assert np.abs(last - simulator.signals(*unit.outputs)).max() <= 1e-12 * max(1.0, np.abs(last).max())
    assert found["time"][-1] == simulator.t


@pytest.mark.parametrize("hold", ["zero", "first"])
def test_inputs_are_those_of_a_simulator(hold, tmp_path):
    m = motorized("slider_crank", hold)
    unit = mbdae.export(m, tmp_path / "driven.fmu", step=STEP)
    master, simulator = Master(unit, "cs"), mbdae.Simulator(m, step=STEP, record=False)
    for k in range(N):
        if k % 20 == 10:
            master.set("motor", k / 10)
            simulator["motor"] = k / 10
        master.step(k * STEP)
        simulator.advance(STEP)
    assert master.get("motor") == pytest.approx(simulator["motor"], rel=1e-14)
    wanted = simulator.signals(*unit.outputs)
    assert np.abs(master.get(*unit.outputs) - wanted).max() <= 1e-12 * np.abs(wanted).max()


def test_a_controller_is_sampled_once_at_each_instant(tmp_path):
    """Inputs are set after each step, which ends a rounding before or after an instant."""
    servo = mbdae.JointPID(joint="crank", kp=0.2, ki=3.0, rate=10.0, reference=1.0)
    m = motorized("slider_crank", value=0.0)
    m = mbdae.Mechanism(m.model, m.closures, [*m.forces, servo], start=m.start_values)
    unit = mbdae.export(m, tmp_path / "servo.fmu", kind="cs", outputs=["q.crank"], rtol=1e-5)
    master, reference = Master(unit, "cs"), mbdae.Simulator(m, rtol=1e-5, record=False)
    for k in range(N):
        for set_input in (master.set, reference.__setitem__):
            set_input("motor", 1e-9 * (k % 2))
        master.step(reference.t, 0.01)
        reference.advance(0.01)
    expected = mbdae.Simulator(m, rtol=1e-5, record=False)
    expected.advance(reference.t)
    for found in (*master.get("q.crank"), reference.q[0]):
        assert found == pytest.approx(expected.q[0], abs=1e-4)


def test_a_start_just_after_an_instant_is_that_of_a_run(tmp_path):
    """A controller samples at an instant; 1e-11 s after it, it waits for the next one."""
    servo = mbdae.JointPID(joint="crank", kp=20.0, rate=10.0, reference=1.0)
    m = mbdae.load("slider_crank")
    m = mbdae.Mechanism(m.model, m.closures, [servo], start=m.start_values)
    unit = mbdae.export(m, tmp_path / "servo.fmu", kind="cs", outputs=["v.crank"], rtol=1e-8)
    ends = []
    for start in (0.3, 0.3 + 1e-11):
        master = Master(unit, "cs", t=start)
        master.step(start, 0.05)
        ends.append(mbdae.solve(m, (start, start + 0.05), rtol=1e-8).v[-1, 0])
        assert master.get("v.crank") == pytest.approx(ends[-1], abs=1e-7)
    assert abs(ends[1] - ends[0]) > 1e-3


@pytest.mark.parametrize("name", ["joint.slider.mass", "gravity.2"])
def test_a_parameter_is_set_before_the_initialization(name, tmp_path):
    m = mbdae.load("slider_crank")
    unit = mbdae.export(m, tmp_path / "model.fmu", kind="cs", parameters=[name], step=STEP)
    template = LoadedModel(m)
    changed = 1.3 * parameter_value(template, name)
    found = []
    for value, mech in ((None, m), (changed, template.make({name: changed}))):
        master = Master(unit, "cs", {} if value is None else {name: value})
        simulator = mbdae.Simulator(mech, step=STEP, record=False)
        for k in range(N):
            master.step(k * STEP)
            simulator.advance(STEP)
        found.append(master.get(*unit.outputs))
        assert np.abs(found[-1] - simulator.signals(*unit.outputs)).max() <= 1e-12
    assert np.abs(found[1] - found[0]).max() > 1e-4
    with pytest.raises(Exception, match="fmi3SetFloat64"):
        master.set(name, 1.0)


def test_values_before_the_initialization_are_those_of_the_start(tmp_path, capfd):
    m = mbdae.load("slider_crank")
    unit = mbdae.export(m, tmp_path / "model.fmu", kind="cs", parameters=["gravity.2"], outputs=["a.slider"], step=STEP)
    master = Master(unit, "cs", initialized=False)
    with pytest.raises(Exception, match="fmi3DoStep"):
        master.step(0.0)
    assert "must be initialized before its steps" in capfd.readouterr().out
    start = m.at(0.0, *m.start).vdot
    assert np.isclose(master.get("a.slider")[0], start[2], rtol=1e-12)
    master.fmu.enterInitializationMode()
    with_gravity = master.get("a.slider")
    master.set("gravity.2", 0.0)
    assert not np.isclose(master.get("a.slider"), with_gravity)
    master.set("gravity.2", -9.81)
    assert np.isclose(master.get("a.slider"), with_gravity, rtol=1e-12)


def test_saved_states_go_on_bit_by_bit(driven):
    _, unit = driven
    master = Master(unit, "cs")
    for k in range(10):
        master.step(k * STEP)
    master.set("motor", 2.0)
    saved = master.fmu.getFMUState()
    data = master.fmu.serializeFMUState(saved)
    ends = []
    for other in (master, master, Master(unit, "cs")):
        if ends:
            state = other.fmu.deserializeFMUState(data)
            other.fmu.setFMUState(state)
            other.fmu.freeFMUState(state)
        for k in range(10, 30):
            other.step(k * STEP)
        ends.append(other.get(*unit.outputs))
    master.fmu.freeFMUState(saved)
    assert np.array_equal(ends[0], ends[1])
    assert np.array_equal(ends[0], ends[2])
    with pytest.raises(Exception, match="fmi3"):
        master.fmu.setFMUState(master.fmu.deserializeFMUState(data[:80]))


def test_instances_in_threads_agree_bit_by_bit(driven):
    _, unit = driven

    def run(value):
        master = Master(unit, "cs", {"motor": value})
        for k in range(200):
            master.step(k * STEP)
        return master.get(*unit.outputs)

    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(run, (0.1, 0.7)))
    assert np.array_equal(together[0], run(0.1))
    assert np.array_equal(together[1], run(0.7))
    assert not np.array_equal(*together)


def test_a_step_ends_early_where_the_master_asks(driven):
    _, unit = driven
    calls = []

    def update(_, t, set_requested, get_allowed, finished, can_return, requested, until):
        calls.append((t, finished, can_return))
        requested[0] = t >= 3.5 * STEP

    callback = fmpy.fmi3.fmi3IntermediateUpdateCallback(update)
    master = Master(unit, "cs", early=True, update=callback)
    *_, early, last = master.step(0.0, 10 * STEP)
    assert bool(early)
    assert abs(last - 4 * STEP) < 1e-12
    assert [round(t / STEP) for t, *_ in calls] == [1, 2, 3, 4]
    assert all(can for *_, can in calls)
    other = Master(unit, "cs")
    for k in range(4):
        other.step(k * STEP)
    assert np.array_equal(master.get(*unit.outputs), other.get(*unit.outputs))


@pytest.mark.parametrize("steps", [6000, pytest.param(100_000, marks=pytest.mark.slow)])
def test_many_steps_need_no_more_memory(steps, driven):
    resource = pytest.importorskip("resource")
    master, sizes = Master(driven[1], "cs", {"motor": 0.0}), []
    for k in range(steps):
        master.step(k * STEP)
        if k in (2000, steps - 1):
            sizes.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    assert sizes[1] - sizes[0] <= 256  # kB


def test_impossible_requests_are_errors(driven, capfd):
    _, unit = driven
    master = Master(unit, "cs")
    for wrong, text in (
        (lambda: master.fmu.setFloat64([4000], [1.0]), "unknown value reference 4000"),
        (lambda: master.set("motor", np.nan), "an input must be a finite number"),
        (lambda: master.set("q.crank", 1.0), "can be set"),
        (lambda: master.step(1.0), "must begin where the one before ended"),
        (lambda: master.fmu.getInt32([1]), "all variables are of type Float64"),
    ):
        with pytest.raises(Exception, match="fmi3"):
            wrong()
        assert text in capfd.readouterr().out
