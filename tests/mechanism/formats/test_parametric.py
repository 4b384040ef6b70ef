"""Models and files with parameters: in Python, on the command line, in saved solutions; and invalid ones."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import InputError
from mbdae.mechanism.formats.mechanism_file.template import Template
from mbdae.mechanism.formats.model_library import find

TOWER = """
from typing import Annotated, Literal
from pydantic import Field

Kind = Literal["revolute", "prismatic"]

def mechanism(floors: Annotated[int, Field(ge=1, le=4)], length: float = 0.5, kind: Kind = "revolute"):
    if length == 13:
        raise RuntimeError("no thirteen")
    if length == 14:
        return {"bodies": []}
    floor = {"joint": kind, "mass": 1.0, "xyz": [length, 0, 0]}
    names = ["world"] + [f"floor_{i}" for i in range(floors)]
    return {"body": [{"name": n, "parent": p, **floor} for p, n in zip(names, names[1:])]}
"""


@pytest.fixture
def tower(tmp_path):
    (tmp_path / "tower.py").write_text(TOWER)
    return tmp_path / "tower.py"


def mbdae_says(*arguments):
    result = CliRunner().invoke(cli, [str(a) for a in arguments])
    if result.exception and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.output


def test_keywords_and_names():
    for mech in (mbdae.load("n_four_bar", N=4), mbdae.load("n_four_bar?N=4"), mbdae.load("n_four_bar?N=7", N=4)):
        assert (mech.nv, mech.ng) == (9, 12)
    assert mbdae.load("n_four_bar").nv == 5


def test_values_of_numpy_are_those_of_python():
    template = Template(str(find("n_four_bar")))
    exact = {"N": 3, "gravity.2": -9.5, "body.crank_0.com": [0.5, 0.0, 0.25]}
    given = {"N": np.int64(3), "gravity.2": np.float32(-9.5), "body.crank_0.com": np.array([0.5, 0.0, 0.25], "f4")}
    found, known = template.make(given), template.make(exact)
    assert found.model == known.model
    with pytest.raises(InputError, match="a parameter takes numbers, texts or lists of numbers, got 1j"):
        template.make({"gravity.2": np.complex128(1j)})


def test_a_users_own_file(tower):
    mech = mbdae.load(tower, floors=3, length=0.25)
    assert mech.joint_names == ["floor_0", "floor_1", "floor_2"]
    assert mech.model.jointPlacements[2].translation.tolist() == [0.25, 0, 0]
    assert mech.joint_kind("floor_0") == "RevoluteUnaligned"
    assert mbdae.load(f"{tower}?floors=1&kind=prismatic").joint_kind("floor_0") == "PrismaticUnaligned"
    (tower.parent / "mechanism.py").write_text(TOWER)
    with pytest.warns(UserWarning, match=r"the Python file .*mechanism\.py is run$"):
        assert mbdae.load(tower.parent, floors=2).nv == 2


def test_a_template_finds_its_file_once_and_warns_once(tower, monkeypatch):
    (tower.parent / "mechanism.py").write_text(TOWER)
    with pytest.warns(UserWarning, match=r"the Python file .*mechanism\.py is run$") as said:
        template = Template(tower.parent)
    assert len(said) == 1
    monkeypatch.setattr("mbdae.mechanism.formats.mechanism_file.load.find", None)
    assert [template.make({"floors": n}).nv for n in (2, 3)] == [2, 3]


def test_commands_show_and_take_parameters(tmp_path):
    assert "parameter N = 3: int at least 1 and at most 1000, default 2" in mbdae_says("info", "n_four_bar?N=3")
    card = json.loads(mbdae_says("info", "n_four_bar?N=3", "--json"))
    assert (card["parameters"][0]["name"], card["parameters"][0]["value"], card["nv"]) == ("N", 3, 7)
    listed = {row["name"]: row["parameters"] for row in json.loads(mbdae_says("models", "--json"))}
    assert listed["n_four_bar"] == "N: int at least 1 and at most 1000, default 2"
    assert listed["pendulum"] is None
    path = tmp_path / "run.npz"
    assert "finished" in mbdae_says("solve", "n_four_bar?N=1", "-t", 0.2, "-o", path)
    sol = mbdae.Solution.load(path)
    assert sol.mechanism.nv == 3
    assert mbdae.info(sol.mechanism).parameters[0]["value"] == 1
    assert mbdae.drift(sol).g_max < 1e-8
    assert not np.isnan(sol.lam).any()
    assert "wrote" in mbdae_says("animate", path, "-o", tmp_path / "run.html")


REFUSED = [
    ("?floors=5", "floors = 5: Input should be less than or equal to 4"),
    ("?floors=x", "floors = x: Input should be a valid integer"),
    ("?floors=2&length=nan", "length = nan: Input should be a finite number"),
    ("?floors=2&kind=ball", "kind = ball: Input should be 'revolute' or 'prismatic'"),
    ("?floor=2", "unknown parameter of tower 'floor'"),
    ("", "tower needs floors"),
]


@pytest.mark.parametrize(("parameters", "message"), REFUSED)
def test_wrong_parameters_name_the_valid_ones(parameters, message, tower):
    with pytest.raises(mbdae.MbdaeError) as error:
        mbdae.load(f"{tower}{parameters}")
    text = str(error.value)
    assert message in text
    assert "floors (int at least 1 and at most 4, no default)" in text
    assert "length (float, default 0.5)" in text
    assert "\n" not in text


WRONG = [
    ("?floors=1&length=13", r"mechanism\(.*\) failed: RuntimeError: no thirteen"),
    ("?floors=1&length=14", "unknown key bodies; known: .*body"),
]


@pytest.mark.parametrize(("parameters", "message"), WRONG)
def test_functions_that_fail(parameters, message, tower):
    with pytest.raises(mbdae.MbdaeError, match=message):
        mbdae.load(f"{tower}{parameters}")


def test_a_query_without_values(tower):
    with pytest.raises(mbdae.MbdaeError, match=r"parameters are written .*name=value"):
        mbdae.load(f"{tower}?floors")


FILES = [
    ("import nothing_of_this_name", "cannot be run: ModuleNotFoundError"),
    ("def mechanism(:", "cannot be run: SyntaxError"),
    ("N = 3", r"has no function mechanism\(...\)"),
    ("def mechanism(N=3): return {}", "parameter 'N' of mechanism.* needs an annotation"),
    ("def mechanism(**N: int): return {}", "by name only"),
    ("def mechanism(): return []", r"returned list, expected a dict"),
    ("def mechanism(): return {'gravity': [0, 0, 1e60]}", "gravity.2 is beyond"),
    ("raise SystemExit(3)", "cannot be run: SystemExit"),
]


@pytest.mark.parametrize(("text", "message"), FILES)
def test_files_that_are_wrong(text, message, tmp_path):
    (tmp_path / "own.py").write_text(text)
    with pytest.raises(mbdae.MbdaeError, match=message):
        mbdae.load(tmp_path / "own.py")


def test_models_without_parameters_take_none():
    with pytest.raises(mbdae.MbdaeError, match="unknown parameter of four_bar 'N'; valid: none"):
        mbdae.load("four_bar", N=3)
    with pytest.raises(mbdae.MbdaeError, match=r"'force.spring.stiffness': four_bar has no parameters; sweep, fit and"):
        mbdae.load("four_bar?force.spring.stiffness=3")


ARM = """
title = "Two springs"
body = [{{ name = "arm", parent = "world", axis = [0, 1, 0], mass = 1.0, com = [0, 0, -1] }}]
force = [
    {{ kind = "joint_spring", name = "{0}", joint = "arm", stiffness = 1.0 }},
    {{ kind = "joint_spring", name = "{1}", joint = "arm", stiffness = 3.0 }},
]
"""


@pytest.mark.parametrize(("name", "other"), [("pull", "pull"), ("joint_spring 2", "")])
def test_a_name_of_two_forces_is_no_parameter(tmp_path, name, other):
    path = tmp_path / "arm.toml"
    path.write_text(ARM.format(name, other))
    with pytest.raises(InputError, match=f"force.{name}.stiffness: several entries are named '{name}'"):
        Template(path).make({f"force.{name}.stiffness": 7.0})
