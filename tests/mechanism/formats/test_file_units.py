"""Mechanism files in units of the trade: the same mechanisms and the same runs; every key says its unit."""

import tomllib
import typing

import numpy as np
import pytest
from unit_files import ALL, IN_MM, IN_SI, OTHER_UNITS, PRESS, SI
from unit_systems import UnitSystem

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.checked_table import tables_in
from mbdae.mechanism.formats.mechanism_file.load import read
from mbdae.mechanism.formats.mechanism_file.schema import MechanismFile
from mbdae.mechanism.formats.model_library import models_directory
from mbdae.mechanism.key_units import declared_unit

MM = UnitSystem("mm, t, s", length=1e3, mass=1e-3)  # with forces in N


def mechanism_of(text, folder):
    path = folder / "machine.toml"
    path.write_text(text)
    return mbdae.load(path)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("press")

    def run(values):
        return mbdae.solve(mechanism_of(PRESS.format(**values), folder), (0, 0.3), step=5e-3)

    return {name: run(values) for name, values in {"SI": SI, **OTHER_UNITS}.items()}


@pytest.mark.parametrize("name", OTHER_UNITS)
def test_a_press_in_other_units_runs_the_same(runs, name):
    found, expected = runs[name], runs["SI"]
    assert len(expected.t) > 10
    assert np.ptp(expected.q[:, -1]) > 0.05
    np.testing.assert_allclose(found.t, expected.t, rtol=1e-13)
    np.testing.assert_allclose(found.y, expected.y, rtol=1e-13, atol=1e-13 * np.abs(expected.y).max())


def test_every_number_says_its_unit():
    seen, missing = set(), []

    def has_numbers(annotation):
        return annotation is float or any(map(has_numbers, typing.get_args(annotation)))

    def check(table):
        if table in seen:
            return
        seen.add(table)
        for key, field in table.model_fields.items():
            inner = tables_in(field.annotation)
            if has_numbers(field.annotation) and not declared_unit(field) and field.exclude is not True:
                missing.append(f"{table.__name__}.{key}")
            for x in inner:
                check(x)

    check(MechanismFile)
    assert len(seen) > 50
    assert not missing


DOTTED = """
title = "A joint with the name of another one, a dot and more"
units = {{ length = "mm", angle = "deg" }}
{bodies}
[[force]]
kind = "joint_spring"
joint = "arm"
stiffness = 2.0
damping = 0.1
[start]
q = {{ arm = 30.0, "arm.tip" = 20.0 }}
v = {{ arm = 60.0, "arm.tip" = 5.0 }}
"""
BODY = """
[[body]]
name = "{name}"
parent = "world"
joint = "{joint}"
axis = [0, 1, 0]
mass = 1.0
com = [0, 0, -100]
inertia = [1e4, 1e4, 1e4, 0, 0, 0]
"""


def test_names_of_joints_with_dots(tmp_path):
    bodies = BODY.format(name="arm", joint="revolute") + BODY.format(name="arm.tip", joint="prismatic")
    mech = mechanism_of(DOTTED.format(bodies=bodies), tmp_path)
    np.testing.assert_allclose(mech.start, [[np.pi / 6, 0.02], [np.pi / 3, 0.005]], rtol=1e-14)
    (spring,) = mech.forces
    assert spring.stiffness == pytest.approx(2e-3 * 180 / np.pi, rel=1e-14)  # N mm/deg
    assert spring.damping == pytest.approx(1e-4 * 180 / np.pi, rel=1e-14)


@pytest.mark.parametrize("name", ["four_bar", "flyball_governor", "stewart_platform", "slider_crank_with_stop"])
def test_models_of_the_library_are_the_same_in_mm_and_t(name, tmp_path, monkeypatch):
    content, mech = tomllib.loads((models_directory() / name / "mechanism.toml").read_text()), mbdae.load(name)
    other = MM.mechanism(mech)
    for frame in (*content.get("frame", ()), *content.get("body", ())):
        for key in ("xyz", "com"):
            frame |= {key: [1e3 * x for x in frame[key]]} if key in frame else {}
    for body in content.get("body", ()):
        body |= (
            {"mass": 1e-3 * body["mass"], "inertia": [1e3 * x for x in body.get("inertia", [0.0] * 6)]}
            if "mass" in body
            else {}
        )
    tables = {"closure": other.closures, "driver": other.drivers, "stop": other.stops, "force": other.forces}
    content |= {key: [x.model_dump(exclude_unset=True) for x in tables[key]] for key in tables if content.get(key)}
    content |= {"start": other.start_values.model_dump(exclude_unset=True)} if "start" in content else {}
    content["units"] = {"length": "mm", "mass": "t"}
    if "gravity" in content:
        content["gravity"] = [1e3 * x for x in content["gravity"]]
    file = MechanismFile.model_validate(content)
    monkeypatch.setattr("mbdae.mechanism.formats.mechanism_file.load.read_toml", lambda text, where: file)
    found = mbdae.load(name)
    for a, b in zip(equations(found), equations(mech), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12 * np.abs(b).max(initial=1e-300))


def equations(mech):
    q, v = mech.start
    v = v + np.random.default_rng(1).standard_normal(mech.nv)
    system = mech.system()
    U, f = system.inertia(0.0, q), system.force(0.0, q, v, np.array(list(mech.states.values())))[0]
    return q, U.T @ U, system.jacobian(), f, mech.residual(q, v)[1]


@pytest.fixture(scope="module")
def all_sorts(tmp_path_factory):
    path = tmp_path_factory.mktemp("all") / "all.toml"

    def read_as(values, units):
        path.write_text(units + ALL.format(**values))
        return read(path, {}).file.model_dump()

    return read_as(IN_SI, ""), read_as(IN_MM, '[units]\nlength = "mm"\nangle = "deg"\n')


def flat(value, path=""):
    if isinstance(value, dict | list | tuple):
        for key, x in value.items() if isinstance(value, dict) else enumerate(value):
            yield from flat(x, f"{path}.{key}")
    else:
        yield path, value


def test_units_of_joints_are_those_of_their_coordinates(all_sorts):
    expected, found = (dict(flat(x)) for x in all_sorts)
    numbers = {path for path, x in expected.items() if isinstance(x, float)}
    assert found.keys() == expected.keys()
    assert {p: found[p] for p in numbers} == pytest.approx({p: expected[p] for p in numbers}, rel=1e-14)
    assert all(found[p] == expected[p] for p in expected.keys() - numbers)
    assert sum(expected[p] not in (0, 1) for p in numbers) > 50


SPEEDS = """
units = {{ {units} }}
[[body]]
name = "wheel"
parent = "world"
[[driver]]
joint = "wheel"
{driven}
[[force]]
kind = "joint_pid"
joint = "wheel"
controls = "velocity"
reference = {{ kind = "steps", points = [[0, {v}], [1, {v}]] }}
kp = 2.0
[[force]]
kind = "joint_friction"
joint = "wheel"
friction = 1.0
velocity = {v}
[start]
v = {{ wheel = {v} }}
"""


@pytest.mark.parametrize("driven", ["speed = {v}", 'motion = {{ kind = "polynomial", coefficients = [0.0, {v}] }}'])
def test_speeds_of_joints_are_in_the_unit_of_rotation(driven, tmp_path):
    def speeds(units, v):
        path = tmp_path / "speeds.toml"
        path.write_text(SPEEDS.format(units=units, v=v, driven=driven.format(v=v)))
        values = flat(read(path, {}).file.model_dump(include={"driver", "force", "start"}))
        return [x for _, x in values if isinstance(x, float) and x > 5]

    assert speeds("", 10.0) == [10.0] * 5
    assert speeds('rotation = "rpm"', 300 / np.pi) == pytest.approx([10.0] * 5, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('[units]\nlength = "inch"', "units.length: unknown unit, known: m, mm, cm, um, km, in, ft, got 'inch'"),
        ('[units]\nlenght = "mm"', "unknown key units.lenght; known: angle, energy, force, length"),
        ('[units]\nlength = "mm"\n[[body]]\nname = "a"\nparent = "world"\n[[body]]\nname = "b"\nparent = "a"\n'
         'joint = "prismatic"\n[[force]]\nkind = "joint_damping"\njoint = ["a", "b"]\ndamping = 1.0',
         "joint_damping"),
    ],
)  # fmt: skip
def test_wrong_units_are_one_line(text, said, tmp_path):
    with pytest.raises(InputError) as e:
        mechanism_of(text, tmp_path)
    assert said in str(e.value)
    assert "\n" not in str(e.value)


def test_archives_are_in_si(tmp_path):
    file = mechanism_of(PRESS.format(**OTHER_UNITS["mm, deg, kg"]), tmp_path).source["file"]
    assert list(file["body"][1]["xyz"]) == [0.0, 0.0, 0.1]
    assert "units" not in file
