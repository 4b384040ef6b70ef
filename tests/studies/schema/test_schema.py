"""JSON Schemas of files: shipped files are valid, wrong ones are not, and editors get the names of methods."""

import json
import tomllib
from functools import cache

import pytest
from click.testing import CliRunner

import mbdae
from mbdae.__main__ import cli
from mbdae.errors import UnknownNameError
from mbdae.mechanism.formats.model_library import models_directory

jsonschema = pytest.importorskip("jsonschema")
COMMANDS = ("schema", "schema sweep")
SWEEP = {"model": "four_bar", "outputs": ["final q.crank"], "grid": {"gravity.2": [-9, -10]}}


@cache
def validator(file):
    schema = mbdae.schema(file)
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def faults(file, content):
    return [" ".join([*map(str, e.path), e.message]) for e in validator(file).iter_errors(content)]


def test_shipped_files_are_valid():
    paths = sorted(models_directory().glob("*/mechanism.toml"))
    assert len(paths) > 15
    for path in paths:
        assert not faults("mechanism", tomllib.loads(path.read_text())), path


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"body": [{"name": "a", "parent": "world", "axes": 1}]}, "'axes' was unexpected"),
        ({"solve": {"method": "fast"}}, "'fast' is not one of"),
        ({"force": [{"kind": "joint_spring", "joint": "a", "stiffnes": 1}]}, "is not valid under any"),
        ({"closure": [{"kind": "pin", "frames": ["a", "b"]}]}, "'pin' is not one of"),
        ({"duration": -1}, "-1 is less than or equal to the minimum of 0"),
    ],
)
def test_faults_are_seen(content, words):
    assert any(words in text for text in faults("mechanism", content)), faults("mechanism", content)


def test_values_that_represent_others_are_taken():
    body = {"name": "a", "parent": "world"}
    torque = {"kind": "joint_torque", "joint": "a", "torque": {"kind": "harmonic", "amplitude": 1.0, "omega": 2.0}}
    assert not faults("mechanism", {"source": "robot.urdf", "motor": {"hip": 2.0}, "force": [torque], "body": [body]})
    assert not faults("mechanism", {"source": [{"file": "robot.urdf", "prefix": "left_"}]})
    uses = {"force": [torque | {"torque": {"input": "u"}}], "driver": [{"joint": "a", "speed": {"input": "u"}}]}
    uses |= {"input": [{"name": "u", "hold": "first"}], "motor": {"hip": {"input": "u"}}}
    assert not faults("mechanism", uses)
    assert faults("mechanism", {"driver": [{"joint": "a", "speed": {"input": 3}}]})
    assert not faults("sweep", SWEEP)
    assert faults("sweep", {**SWEEP, "output": []})


def test_the_command_prints_it():
    out = CliRunner().invoke(cli, ["schema", "sweep"])
    assert json.loads(out.output) == mbdae.schema("sweep")
    with pytest.raises(UnknownNameError, match="kind of file 'motion'; valid: mechanism, sweep"):
        mbdae.schema("motion")
    with pytest.raises(UnknownNameError, match="kind of file"):
        mbdae.schema(["mechanism"])
