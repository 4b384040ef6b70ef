"""Wrong files: truncated, of wrong types, with unknown keys and extreme numbers. Never a traceback, never a hang."""

import copy
import math
import os
import re
import shutil
import sys
import warnings
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

import mbdae
from mbdae.errors import MbdaeError
from mbdae.mechanism.formats.model_library import models_directory

DATA = Path(__file__).parents[2] / "data"
ROBOT, GRIPPER = DATA / "robot", DATA / "robot_description" / "urdf" / "gripper.urdf"
fuzz = settings(
    max_examples=int(os.environ.get("MBDAE_FUZZ", "60")),
    deadline=timedelta(seconds=20),
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
    derandomize=True,
)

MECHANISM = {
    "title": "fuzz",
    "gravity": [0.0, 0.0, -9.81],
    "duration": 1.0,
    "body": [
        {"name": "crank", "parent": "world", "joint": "revolute", "axis": [0, 1, 0], "mass": 1.0, "com": [0.5, 0, 0],
         "inertia": [1e-3, 0.1, 0.1, 0, 0, 0]},
        {"name": "rod", "parent": "crank", "joint": "spherical", "xyz": [1, 0, 0], "mass": 2.0, "com": [1, 0, 0],
         "inertia": [2e-3, 0.7, 0.7, 0, 0, 0]},
        {"name": "slider", "parent": "world", "joint": "prismatic", "axis": [1, 0, 0], "mass": 0.5},
        {"name": "moon", "parent": "slider", "joint": "free", "mass": 0.1, "inertia": [1e-4, 1e-4, 1e-4, 0, 0, 0]},
    ],
    "frame": [
        {"name": "tip", "parent": "rod", "xyz": [2, 0, 0], "rpy": [0, 0.3, 0]},
        {"name": "eye", "parent": "slider"},
    ],
    "closure": [
        {"kind": "point", "frames": ["tip", "eye"], "name": "pin"},
        {"kind": "distance", "frames": ["moon", "world"], "length": 2.0},
    ],
    "force": [
        {"kind": "joint_spring", "joint": "slider", "stiffness": 10.0, "rest": 2.0},
        {"kind": "joint_damping", "joint": ["crank", "rod"], "damping": 0.1},
        {"kind": "spring_damper", "frames": ["moon", "tip"], "stiffness": 3.0, "damping": 0.1, "length": 1.0},
    ],
    "start": {"q": {"crank": 0.3}, "v": {"crank": 1.0}, "guess": {"slider": 2.5, "moon": [0, 2, 0, 0, 0, 0, 1]}},
    "order": {"T": 1.0, "steps": 20},
}  # fmt: skip

NUMBERS = [0, 1, -1, -0.0, 1e-300, 1e300, -1e300, 1.7e308, 5e-324, math.nan, math.inf, -math.inf, 2**63, -(10**40), 3.5]
SPELLED = ["nan", "inf", "-inf", "1e300", "-1", "0", "", "x", "1 2", "1e999", "1e-320", "0x10", "10" * 200, "1e9"]
WORDS = ["", "world", "crank", "rod", "universe", "tip", "no such name", "point", "revolute", "é☃", "a\nb", "x" * 300]
NESTED = [b"a = " + b"[" * 5000, b"[" * 5000, b"<a>" * 5000, b"a: " * 300, b"x: &x [*x]", b"a = 1" + b"0" * 5000]
# Any characters but surrogates; to draw `st.text`, every process would first sort all of Unicode by category.
letters = st.integers(0x20, 0x7E) | st.integers(0, 0xD7FF) | st.integers(0xE000, 0x10FFFF)


def texts(most):
    return st.lists(letters.map(chr), max_size=most).map("".join)


junk = st.recursive(
    st.sampled_from(NUMBERS) | st.sampled_from(WORDS) | st.booleans() | st.floats() | texts(5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from([*WORDS, "kind"]), inner, max_size=3),
    max_leaves=6,
)


def paths(value, here=()):
    yield here
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from paths(inner, (*here, key))


@st.composite
def mutated(draw, table):
    """The table with one to three of its entries replaced, removed, moved or joined by an unknown one."""
    table = copy.deepcopy(table)
    for _ in range(draw(st.integers(1, 3))):
        *where, key = draw(st.sampled_from([p for p in paths(table) if p]))
        inner = table
        for k in where:
            inner = inner[k]
        action = draw(st.sampled_from(["replace"] * 4 + ["remove", "copy", "stranger"]))
        if action == "replace":
            number = isinstance(inner[key], float | int) and draw(st.integers(0, 3))
            inner[key] = draw(st.sampled_from(NUMBERS) if number else junk)
        elif action == "remove":
            del inner[key]
        elif action == "copy":
            source = table
            for k in draw(st.sampled_from(list(paths(table)))):
                source = source[k]
            inner[key] = copy.deepcopy(source)
        elif isinstance(inner, dict):
            inner[draw(st.sampled_from(["stranger", "name", "axis", "source", "lock"]))] = draw(junk)
    return table


def toml(value):
    """A value as inline TOML."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(str(k))} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, str):
        return '"' + "".join(c if c.isalnum() or c in " _-." else f"\\U{ord(c):08x}" for c in value) + '"'
    return repr(value)


def try_it(path):
    """Load, assemble, describe and step; report a failure in one line."""
    try:
        mech = mbdae.load(path)
        q, v = mech.start
        system = mech.system()
        system.derivative(0.0, mech.point(q, v))
        sol = mbdae.solve(mech, (0.0, 1e-4), method="herk2", step=5e-5)
    except MbdaeError as e:
        error = e
    else:
        assert np.isfinite(sol.q).all()
        return sol.status
    assert str(error).splitlines() == [str(error)]
    return type(error).__name__


def quiet(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # omissions are reported in a warning
        return try_it(path)


@st.composite
def mangled(draw, text):
    """The text with one to three numbers, words or parts replaced, removed or doubled, or cut off."""
    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.sampled_from(["number", "number", "number", "word", "tag", "double", "cut", "letter"]))
        pattern = {"number": r"-?\d+(\.\d+)?(e-?\d+)?", "word": r"[A-Za-z_]{2,}"}.get(kind, r"<[^>]*>|[^<\n]+")
        pieces = [m.span() for m in re.finditer(pattern, text)] or [(0, len(text))]
        a, b = draw(st.sampled_from(pieces))
        if kind == "number":
            text = text[:a] + draw(st.sampled_from(SPELLED)) + text[b:]
        elif kind == "word":
            c, d = draw(st.sampled_from(pieces))
            text = text[:a] + text[c:d] + text[b:]
        elif kind == "letter":
            text = text[:a] + draw(texts(2)) + text[a:]
        else:
            text = {"tag": text[:a] + text[b:], "double": text[:b] + text[a:], "cut": text[:b]}[kind]
    return text


def test_the_mechanism_itself_runs(tmp_path):
    path = tmp_path / "fuzz.toml"
    path.write_text("\n".join(f"{k} = {toml(v)}" for k, v in MECHANISM.items()))
    assert try_it(path) == "finished"


@pytest.mark.slow
@fuzz
@given(table=mutated(MECHANISM))
def test_mutated_mechanisms(table, tmp_path):
    path = tmp_path / "fuzz.toml"
    path.write_text("\n".join(f"{toml(str(k))} = {toml(v)}" for k, v in table.items()), encoding="utf-8")
    event(str(quiet(path)))


@fuzz
@given(text=mangled((ROBOT / "robot.urdf").read_text()))
def test_mangled_urdf(text, tmp_path):
    path = tmp_path / "fuzz.urdf"
    path.write_text(text, encoding="utf-8")
    event(str(quiet(path)))


@pytest.mark.slow
@fuzz
@given(tables=mangled((ROBOT / "robot.yaml").read_text()), urdf=st.just("") | mangled(GRIPPER.read_text()))
def test_mangled_robot_yaml(tables, urdf, tmp_path):
    shutil.copy(ROBOT / "robot.urdf", tmp_path)
    (tmp_path / "robot.yaml").write_text(tables, encoding="utf-8")
    (tmp_path / "gripper.urdf").write_text(urdf or GRIPPER.read_text(), encoding="utf-8")
    event(str(quiet(tmp_path / "robot.yaml")))
    event(str(quiet(tmp_path / "gripper.urdf")))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["trees", "loops", "actuated"])
@fuzz
@given(data=st.data())
def test_mangled_mjcf(name, data, tmp_path):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    source = DATA / "mjcf" / f"{name}.xml"
    shutil.copy(source.with_name("materials.xml"), tmp_path)
    path = tmp_path / "fuzz.xml"
    path.write_text(data.draw(mangled(source.read_text())), encoding="utf-8")
    event(str(quiet(path)))


@pytest.mark.parametrize("suffix", [".toml", ".urdf", ".xml", ".yaml"])
@fuzz
@given(content=st.binary(max_size=60) | texts(60).map(str.encode) | st.sampled_from(NESTED))
def test_files_of_anything(suffix, content, tmp_path):
    path = tmp_path / f"fuzz{suffix}"
    path.write_bytes(content)
    shutil.copy(ROBOT / "robot.urdf", tmp_path)
    raised = sys.getrecursionlimit()
    sys.setrecursionlimit(1000)  # Python's; PyYAML takes seconds to reach that of hypothesis
    try:
        assert quiet(path) in ("InputError", "UnknownNameError")
    finally:
        sys.setrecursionlimit(raised)


@pytest.mark.parametrize("name", [f.parent.name for f in sorted(models_directory().glob("*/mechanism.toml"))])
def test_truncated_models(name, tmp_path):
    folder = models_directory() / name
    text = (folder / "mechanism.toml").read_text(encoding="utf-8")
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    for end in np.linspace(0, len(text), 40, dtype=int)[:-1]:
        (tmp_path / "mechanism.toml").write_text(text[:end], encoding="utf-8")
        quiet(tmp_path / "mechanism.toml")
