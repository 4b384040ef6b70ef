"""Mechanism files in units of the trade: the same mechanisms and the same runs; every key says its unit."""

import tomllib
import typing

import numpy as np
import pytest
from unit_systems import UnitSystem

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.checked_table import tables_in
from mbdae.mechanism.formats.load import read
from mbdae.mechanism.formats.model_library import models_directory
from mbdae.mechanism.formats.schema import MechanismFile
from mbdae.mechanism.key_units import declared_unit

PRESS = """
[units]
{units}
[[body]]
name = "crank"
parent = "world"
joint = "revolute"
axis = [0, 1, 0]
mass = {mass}
com = [0, 0, {com}]
inertia = [{I}, {I}, {I}, 0, 0, 0]
[[body]]
name = "rod"
parent = "crank"
joint = "continuous"
axis = [0, 1, 0]
xyz = [0, 0, {crank}]
mass = {mass}
inertia = [{I}, {I}, {I}, 0, 0, 0]
[[body]]
name = "ram"
parent = "world"
joint = "prismatic"
mass = {mass}
[[frame]]
name = "rod_end"
parent = "rod"
xyz = [0, 0, {rod}]
[[closure]]
kind = "revolute"
frames = ["rod_end", "ram"]
axis = [0, 1, 0]
[[force]]
kind = "joint_damping"
joint = "ram"
damping = {damping}
[[force]]
kind = "joint_spring"
joint = "crank"
stiffness = {spring}
rest = {rest}
[start]
q = {{ crank = {q} }}
v = {{ crank = {v} }}
"""
DEG = 180 / np.pi
SI = {"units": "", "mass": 2.5, "com": 0.05, "I": 4e-3, "crank": 0.1, "rod": 0.4, "damping": 20.0, "spring": 3.0,
      "rest": 0.6, "q": 0.3, "v": 10.0}  # fmt: skip
TRADE = {  # the values of SI in other units, with factors written out
    "mm, deg, kg": {"units": 'length = "mm"\nangle = "deg"\nmass = "kg"', "mass": 2.5, "com": 50, "I": 4000,
                    "crank": 100, "rod": 400, "damping": 0.02, "spring": 3000 / DEG, "rest": 0.6 * DEG, "q": 0.3 * DEG,
                    "v": 10 * DEG},
    "in, g, kN, N m, rpm": {"units": 'length = "in"\nmass = "g"\nforce = "kN"\ntorque = "N m"\nrotation = "rpm"',
                            "mass": 2500, "com": 0.05 / 0.0254, "I": 4 / 0.0254**2, "crank": 0.1 / 0.0254,
                            "rod": 0.4 / 0.0254, "damping": 0.020 * 0.0254, "spring": 3.0, "rest": 0.6, "q": 0.3,
                            "v": 300 / np.pi},
    "ms, N mm": {"units": 'time = "ms"\ntorque = "N mm"', "mass": 2.5, "com": 0.05, "I": 4e-3, "crank": 0.1, "rod": 0.4,
                 "damping": 20e3, "spring": 3000, "rest": 0.6, "q": 0.3, "v": 0.01},
}  # fmt: skip
MM = UnitSystem("mm, t, s", length=1e3, mass=1e-3)  # with forces in N
ALL = """
[[body]]
name = "arm"
parent = "world"
joint = "revolute"
rpy = [0, 0, {a2}]
[[body]]
name = "disc"
parent = "world"
joint = "revolute"
[[body]]
name = "wheel"
parent = "world"
joint = "revolute"
[[body]]
name = "slide"
parent = "world"
joint = "prismatic"
[[body]]
name = "table"
parent = "world"
joint = "planar"
[[closure]]
kind = "coupling"
joints = ["slide", "arm"]
coefficients = [{l1}, {l_a}, {l_aa}]
[[closure]]
kind = "coupling"
joints = ["arm", "slide", "disc"]
coefficients = [{a1}, {a_l}, 3]
[[closure]]
kind = "coupling"
joints = ["slide", "wheel"]
curve = {{ kind = "harmonic", amplitude = {l1}, omega = 2, phase = {a1} }}
[[closure]]
kind = "ratio"
joints = ["arm", "slide"]
coefficients = [{a_l}]
[[closure]]
kind = "point"
name = "pin"
frames = ["arm", "disc"]
[closure.within]
joint = "slide"
windows = [[{l1}, {l2}]]
[[driver]]
joint = "arm"
motion = {{ kind = "polynomial", coefficients = [{a1}, {a1}] }}
[[driver]]
frames = ["arm", "slide"]
motion = {{ kind = "table", points = [[0, {l1}], [1, {l2}]] }}
[[stop]]
joint = "disc"
lower = {a1}
[[clutch]]
joint = "slide"
pitch = {l1}
[[force]]
kind = "joint_pid"
joint = "arm"
reference = {a1}
kp = {e_a}
kd = {e_a}
[[force]]
kind = "joint_pid"
joint = "slide"
controls = "velocity"
reference = {l1}
kp = {f_l}
[[force]]
kind = "dc_motor"
joint = "slide"
voltage = 12
resistance = 2
constant = {e1}
gear = {a_l}
[[force]]
kind = "joint_spring"
joint = "arm"
table = [[{a1}, {e1}], [{a2}, {e2}]]
[[force]]
kind = "coulomb_friction"
closure = "pin"
coefficient = 0.1
radius = {l1}
velocity = {a1}
[[force]]
kind = "bushing"
frames = ["arm", "disc"]
stiffness = [{f_l}, {f_l}, {f_l}, {e_a}, {e_a}, {e_a}]
[[force]]
kind = "wrench"
frame = "arm"
torque = [{e1}, 0, 0]
[[force]]
kind = "joint_torque"
joint = "arm"
torque = {e1}
bias = [{e2}, {e_a}, {e_a}]
[start]
q = {{ arm = {a1}, table = [{l1}, {l2}, 1, 0] }}
v = {{ table = [{l1}, {l2}, {a1}] }}
[order]
q = {{ slide = {l2} }}
[[event]]
name = "swap"
signal = "q.arm > 0.5"
state = {{ "q.disc" = {a1}, "v.slide" = {l1}, "q.wheel" = "2 * q.arm" }}
"""
IN_SI = {"a1": 0.4, "a2": 0.9, "l1": 0.02, "l2": 0.05, "l_a": 0.3, "l_aa": 0.2, "a_l": 40.0, "e1": 0.7, "e2": 0.8,
         "e_a": 6.0, "f_l": 500.0}  # fmt: skip
IN_MM = {"a1": 0.4 * DEG, "a2": 0.9 * DEG, "l1": 20, "l2": 50, "l_a": 300 / DEG, "l_aa": 200 / DEG**2,
         "a_l": 0.04 * DEG, "e1": 700, "e2": 800, "e_a": 6000 / DEG, "f_l": 0.5}  # fmt: skip


def mechanism_of(text, folder):
    path = folder / "machine.toml"
    path.write_text(text)
    return mbdae.load(path)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("press")

    def run(values):
        return mbdae.solve(mechanism_of(PRESS.format(**values), folder), (0, 0.3), step=5e-3)

    return {name: run(values) for name, values in {"SI": SI, **TRADE}.items()}


@pytest.mark.parametrize("name", TRADE)
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
    monkeypatch.setattr("mbdae.mechanism.formats.load.read_toml", lambda text, where: file)
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
    file = mechanism_of(PRESS.format(**TRADE["mm, deg, kg"]), tmp_path).source["file"]
    assert list(file["body"][1]["xyz"]) == [0.0, 0.0, 0.1]
    assert file["units"] == MechanismFile().units.model_dump()
