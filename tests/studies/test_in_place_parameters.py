"""Masses, forces and gravity written in place between runs: bits of new mechanisms, closed forms, other parameters."""

import numpy as np
import pytest

import mbdae
from mbdae import backend
from mbdae.errors import InputError
from mbdae.mechanism.formats.in_place_parameters import in_place_parameters
from mbdae.mechanism.formats.mechanism_file.loaded_model import parameter_value
from mbdae.mechanism.formulations.index2 import Index2System
from mbdae.studies.export.core_file import core_data, values_by_path
from mbdae.studies.factories import factory_of
from mbdae.studies.run_columns import row
from mbdae.studies.varied_starts import FEWEST, VariedStarts

pytestmark = pytest.mark.skipif(backend.load() is None, reason="the Python back end has no parameters in place")
CASES = {  # model, parameters with their first and last values
    "mass": ("slider_crank", {"joint.crank_pin.mass": (0.2, 0.9)}),
    "several bodies and a speed": (
        "slider_crank", {"joint.slider.mass": (1, 2.5), "joint.crank_pin.com.0": (0.1, 0.2), "start.v.crank": (3, 9.0)},
    ),
    "inertia": ("four_bar", {"joint.crank.inertia.1": (0.01, 0.2), "joint.coupler.mass": (1.0, 3.0)}),
    "gravity": ("slider_crank", {"gravity.0": (-1.0, 1.0), "gravity.2": (-9.81, 2.0)}),
    "bodies of the file": ("cart_pole", {"body.cart.mass": (0.5, 2.0), "body.bob.com.2": (-0.5, -1.0)}),
    "spring": ("spring_four_bar", {"force.diagonal.stiffness": (5.0, 30.0), "force.diagonal.length": (1.0, 1.4)}),
    "linear forces": ("andrews_squeezer", {"force.drive.torque": (0.03, 0.05), "force.spring.stiffness": (4e3, 5e3)}),
    "chain in space": ("panda_handle", {"joint.panda_joint2.mass": (2.0, 3.0), "gravity.1": (0.0, 0.5)}),
}  # fmt: skip
OSCILLATOR = """
duration = 1.0
gravity = [0, 0, 0]
[[body]]
name = "block"
parent = "world"
joint = "prismatic"
axis = [1, 0, 0]
mass = 2.0
{more}
[[force]]
kind = "joint_spring"
name = "spring"
joint = "block"
stiffness = 8.0
[start]
q = {{ block = 0.5 }}
"""
FIXED = """
[[body]]
name = "load"
parent = "block"
joint = "fixed"
mass = 1.0
"""

SAMPLED = """
[[force]]
kind = "joint_pid"
name = "controller"
joint = "block"
kp = 5.0
rate = 100.0
"""
INTEGRAL = SAMPLED.replace("rate = 100.0", "ki = 1.0")


@pytest.fixture
def oscillator(tmp_path):
    def write(more=""):
        path = tmp_path / "oscillator.toml"
        path.write_text(OSCILLATOR.format(more=more))
        return str(path)

    return write


def columns_of(parameters, n=FEWEST):
    return {name: np.linspace(*ends, n).tolist() for name, ends in parameters.items()}


def begun_groups(factory, columns):
    n = len(next(iter(columns.values())))
    starts = VariedStarts(factory, n, lambda mech: 0.0, lambda mech: True)
    return [(group.mech, group.begin()) for group in starts.groups(columns, n)]



@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("workers", [1, 2])
def test_ends_have_the_bits_of_new_mechanisms(case, workers):
    model, parameters = CASES[case]
    n = 2 * FEWEST * 4 * workers  # batches of many runs
    columns = {name: np.linspace(*ends, n) for name, ends in parameters.items()}
    found = mbdae.ensemble(model, parameters=columns, t_span=(0.0, 0.02), workers=workers)
    assert found.in_python == {}
    factory = factory_of(model)
    for i in range(0, n, n // 5):
        sol = mbdae.solve(factory.make({name: x[i].item() for name, x in columns.items()}), (0.0, 0.02))
        np.testing.assert_array_equal(found.q[i], sol.q[-1])
        np.testing.assert_array_equal(found.v[i], sol.v[-1])
        assert (found.status[i], found.steps[i]) == (sol.status, sol.stats["steps"])


@pytest.mark.parametrize("case", CASES)
def test_runs_share_a_mechanism_with_the_points_of_new_ones(case):
    model, parameters = CASES[case]
    columns, factory = columns_of(parameters), factory_of(model)
    ((mech, (which, points, in_place)),) = begun_groups(factory, columns)
    assert which.tolist() == [*range(FEWEST)]
    assert in_place.locations
    made = [factory.make(row(columns, i)) for i in range(FEWEST)]
    assert mech.model is not made[0].model
    np.testing.assert_array_equal(points, [x.point() for x in made])
    np.testing.assert_array_equal(mech.point(), made[0].point())


@pytest.mark.parametrize(
    ("model", "names"),
    [
        ("andrews_squeezer", ["force.spring.damping", "force.drive.torque"]),
        ("delta_robot", ["force.motor 1.kp", "force.motor 1.kd", "body.platform.mass", "body.arm_1.inertia.1"]),
        ("car_axis", ["force.left spring.length", "gravity.2"]),
        ("stewart_platform", ["force.drive 1.kd", "gravity.0"]),
        ("jansen_walker", ["body.crank.mass", "body.upper_rod_0.com.1"]),
    ],
)
def test_all_data_of_the_core_are_those_of_new_mechanisms(model, names):
    factory = factory_of(model)
    for name in names:
        value = parameter_value(factory, name) or 0.3
        found, other = in_place_parameters(factory, [name], {name: value}), 1.1 * value + 0.01
        data, new = (data_of_core(factory.make({name: x})) for x in (value, other))
        assert data != new
        for location, x in zip(found.locations, found.rows({name: [other]})[0].tolist(), strict=True):
            data |= {path: x for path in data if path == path_of(location, data)}
        assert data == new


def data_of_core(mech):
    data = values_by_path(core_data(mech.system(native=backend.load())))
    return {path: x for path, x in data.items() if path[0] != "expanded"}


def path_of(location, data):
    kind, of, i = location["kind"], str(location["of"]), location["i"]
    if kind == "gravity":
        return "tree", "gravity", str(i)
    if kind == "body":
        keys = [("mass",), *(("lever", str(k)) for k in range(3)), *(("I", str(k)) for k in range(6))]
        return "tree", "joints", of, *keys[i]
    law = "description", "laws", of
    return (*law, "a", str(i)) if (*law, "a", str(i)) in data else (*law, "offset")


def test_oscillators_follow_the_cosine(oscillator):
    mass, stiffness = np.linspace(0.5, 4.0, 200), np.linspace(20.0, 1.0, 200)
    parameters = {"body.block.mass": mass, "force.spring.stiffness": stiffness}
    found = mbdae.ensemble(oscillator(), parameters=parameters, rtol=1e-10, atol=1e-12)
    omega = np.sqrt(stiffness / mass)
    np.testing.assert_allclose(found.q[:, 0], 0.5 * np.cos(omega), atol=1e-8)
    np.testing.assert_allclose(found.v[:, 0], -0.5 * omega * np.sin(omega), atol=1e-7)


def test_a_sweep_has_the_rows_of_single_runs():
    model, parameters = CASES["several bodies and a speed"]
    runs, outputs = columns_of(parameters, 40), ["final q.slider", "final position.rod_tip.z", "final g"]
    runs = [row(runs, i) for i in range(40)]
    found = mbdae.sweep(model, runs, (0.0, 0.1), outputs=outputs, workers=1)
    with_energy = ["final energy", *outputs]  # which needs mechanisms
    alone = mbdae.sweep(model, runs, (0.0, 0.1), outputs=with_energy, workers=1)
    for name in (*parameters, *outputs, "steps", "status"):
        assert list(found[name]) == list(alone[name])


@pytest.mark.parametrize(
    ("name", "value"), [("joint.crank_pin.mass", -1.0), ("joint.crank_pin.mass", 1e200), ("gravity.2", np.nan)]
)
def test_invalid_values_are_rejected_as_those_of_a_mechanism(name, value):
    factory, values = factory_of("slider_crank"), np.array([1.0, 2.0, value, *range(3, FEWEST)])
    with pytest.raises(InputError) as alone:
        factory.make({name: value})
    ((_, begun),) = begun_groups(factory, {name: values.tolist()})
    assert begun.i.tolist() == [i for i in range(FEWEST) if i != 2]
    found = mbdae.ensemble("slider_crank", parameters={name: values}, t_span=(0.0, 0.01))
    assert (found.status[2], found.message[2]) == ("input", str(alone.value))
    assert found.status.count("finished") == FEWEST - 1
    assert found.in_python == {}


@pytest.mark.parametrize(
    ("model", "values"),
    [
        ("slider_crank", {"joint.crank_pin.xyz.0": 0.12}),
        ("slider_crank", {"closure.wrist pin.axis.1": 1.0}),
        ("slider_crank", {"duration": 3.0}),
        ("n_four_bar", {"N": 3}),
        ("stick_slip_slider", {"force.joint_friction 2.friction": 0.3}),
        ("slider_crank", {"joint.crank_pin.com": [0.1, 0.0, 0.0], "joint.crank_pin.com.0": 0.2}),
    ],
)
def test_other_parameters_make_mechanisms(model, values):
    assert in_place_parameters(factory_of(model), [*values], values) is None


@pytest.mark.parametrize(("lengths", "shared"), [(2, True), (FEWEST, False)])
def test_mechanisms_are_copied_for_several_runs_each(lengths, shared):
    gravity = [-float(k) for k in range(FEWEST)]
    columns = {"joint.crank_pin.xyz.0": [0.1 + 0.01 * (k % lengths) for k in range(FEWEST)], "gravity.2": gravity}
    found = begun_groups(factory_of("slider_crank"), columns)
    assert len(found) == lengths
    assert all(bool(begun.parameters.locations) == shared for _, begun in found)


def test_a_body_that_carries_another_makes_mechanisms(oscillator):
    values = {"body.block.mass": 3.0}
    assert in_place_parameters(factory_of(oscillator()), [*values], values)
    assert in_place_parameters(factory_of(oscillator(FIXED)), [*values], values) is None


def test_a_force_that_vanishes_makes_its_mechanism(oscillator):
    name = "force.spring.stiffness"
    found = in_place_parameters(factory_of(oscillator()), [name], {name: 8.0})
    rows = found.rows({name: [8.0, 0.0, 9.0]})
    assert np.isfinite(rows).all(axis=1).tolist() == [True, False, True]


def test_gains_of_sampled_controllers_are_those_of_each_run(oscillator):
    model, gains = oscillator(SAMPLED), np.linspace(1.0, 30.0, 64)
    found = mbdae.ensemble(model, parameters={"force.controller.kp": gains}, t_span=(0.0, 0.5), workers=1)
    for i in (0, 40, 63):
        sol = mbdae.solve(factory_of(model).make({"force.controller.kp": gains[i].item()}), (0.0, 0.5))
        np.testing.assert_array_equal(found.q[i], sol.q[-1])
    assert len(set(found.q[:, 0].tolist())) == len(gains)


@pytest.mark.parametrize("first", [0.0, 3.0])
@pytest.mark.parametrize("workers", [1, 2])
def test_runs_with_another_number_of_states_fail_alone(oscillator, first, workers):
    model, gains, span = oscillator(INTEGRAL), np.array([first, 1.0, 2.0, 0.0] * 16), (0.0, 0.5)
    found = mbdae.ensemble(model, parameters={"force.controller.ki": gains}, t_span=span, workers=workers)
    for gain, status, q in zip(gains.tolist(), found.status, found.q, strict=True):
        assert status == ("finished" if bool(gain) == bool(first) else "input")
        if status == "finished":
            sol = mbdae.solve(factory_of(model).make({"force.controller.ki": gain}), span)
            np.testing.assert_array_equal(q, sol.q[-1])


def test_parameters_are_restored(oscillator):
    masses = {"body.block.mass": np.linspace(1.0, 2.0, FEWEST).tolist()}
    ((mech, begun),) = begun_groups(factory_of(oscillator()), masses)
    assert len(begun.i) == FEWEST
    assert mech.model.inertias[1].mass == 1.0


@pytest.mark.parametrize("first", [0.0, 0.2])
def test_a_body_that_determines_the_characteristic_length_makes_mechanisms(oscillator, first):
    """A single body has no other length than its own: that of its centre of mass."""
    values = [first, *np.linspace(0.0, 0.7, FEWEST - 1).tolist()]
    found = begun_groups(factory_of(oscillator()), {"body.block.com.0": values})
    in_place = [i for _, begun in found if begun.parameters.locations for i in begun.i.tolist()]
    assert in_place == ([0, 1] if first == 0.0 else [])
    assert sorted(i for _, begun in found for i in begun.i.tolist()) == [*range(FEWEST)]


def test_values_of_a_group_need_not_be_writable(oscillator):
    """Runs differ in the distance of two joints: without any, sizes of bodies are the characteristic length."""
    columns = {"body.load.xyz.0": [1.0] * 8 + [0.0] * 8, "body.load.com.0": [0.1 * k for k in range(1, 9)] * 2}
    found = begun_groups(factory_of(oscillator(FIXED.replace("fixed", "prismatic"))), columns)
    in_place = [begun.i.tolist() for _, begun in found if begun.parameters.locations]
    assert in_place == [[*range(8)]]
    assert [i for _, begun in found for i in begun.i.tolist()] == [*range(16)]


def test_a_thread_binds_its_workspaces_once(monkeypatch):
    bound, bind = [], Index2System.bind
    monkeypatch.setattr(Index2System, "bind", lambda system, mech: (bound.append(mech), bind(system, mech))[1])
    masses = {"joint.crank_pin.mass": np.linspace(0.2, 0.9, 1000)}
    found = mbdae.ensemble("slider_crank", parameters=masses, t_span=(0.0, 0.1), workers=2)
    assert found.success.all()
    assert not found.in_python
    assert len(bound) <= 10  # three for each thread, and those for the first mechanism
