"""Errors in a file are reported with the file, the entry by its name, and the key."""

import pickle

import pytest

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.mechanism_file.schema import read_toml

BODY = '[[body]]\nname = "a"\nparent = "world"\nmass = 1.0\ninertia = [1, 1, 1, 0, 0, 0]\n'
TORQUE = "[[force]]\nkind = 'joint_torque'\nname = 't'\njoint = 'a'\ntorque = "


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BODY + "start.q = { b = 1 }", "m.toml: start.q.b: unknown joint 'b'; valid: a"),
        (BODY.replace("world", "wrld"), "m.toml: body.a.parent: unknown frame 'wrld' (did you mean 'world'?)"),
        (
            BODY + '[[force]]\nkind = "joint_spring"\nname = "s"\njoint = "b"\nstiffness = 1.0\n',
            "m.toml: force.s.joint: unknown joint 'b'",
        ),
        (
            BODY + '[[closure]]\nkind = "point"\nname = "c"\nframes = ["a", "z"]\n',
            "m.toml: closure.c.frames.1: unknown frame 'z'",
        ),
        (BODY + BODY, "m.toml: the name 'a' is taken"),
        ('[[driver]]\njoint = "a"\nmotion = { input = ["u"] }', "m.toml: unknown input ['u']; known: none"),
        ("motor.m = { input = { u = 1 } }", "m.toml: unknown input {'u': 1}; known: none"),
        (".".join(["a"] * 5000) + " = 1", "m.toml: its tables are nested too deeply"),
        ("source = false\n" + BODY, "m.toml: source: Input should be a list, got 'False'"),
        (BODY + "[force]\nkind = 'wrench'", "m.toml: force: Input should be a list of tables, [[force]], got"),
        ("start = 1\n" + BODY, "m.toml: start: Input should be a table, got '1'"),
        (BODY + "[[driver]]\njoint = 'a'\nmotion = 's'", "m.toml: driver.a.motion: Input should be a number or"),
        (BODY + "axis = [0, 1, 0, 0]", "m.toml: body.a.axis: Input should have at most 3 entries, not 4, got"),
        (BODY.replace(", 0, 0, 0", ""), "m.toml: body.a.inertia: Input should have 6 entries, not 3, got '[1, 1, 1]'"),
        ('[[input]]\nname = "u"\n' * 2, "m.toml: inputs need different names, got u, u"),
        (BODY + TORQUE + "inf", "m.toml: force.t.torque: Constant: value: Input should be a finite number, got 'inf'"),
        (BODY + TORQUE + "{ kind = 'steps' }", "m.toml: missing key force.t.torque.points (kind 'steps')"),
        (BODY + TORQUE + "[1, 'b']", "m.toml: force.t.torque.1: Input should be a number or a table, got 'b'"),
        (BODY.replace('"a"', '""'), "m.toml: body.0.name: String should have at least 1 character"),
        (BODY.replace("1.0", "true"), "m.toml: body.a.mass: Input should be a valid number, got 'True'"),
        (BODY.replace("1.0", '"500"'), "m.toml: body.a.mass: Input should be a valid number, got '500'"),
        (BODY.replace("1, 1, 1", '1, "1", 1'), "m.toml: body.a.inertia: Input should be a valid number, got"),
        (BODY + "start.q = { a = false }", "m.toml: start.q: Input should be a valid number, got"),
        (BODY + "[solve]\nproject = 1", "m.toml: solve.project: Input should be true or false, got '1'"),
    ],
)
def test_files(text, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(text.replace("start.q", "[start]\nq"))
    with pytest.raises(InputError) as reported:
        mbdae.load("m.toml")
    assert str(reported.value).startswith(words)
    assert "torque" not in words or str(reported.value) == words  # once, and not as if it were a list of torques
    assert str(pickle.loads(pickle.dumps(reported.value))) == str(reported.value)


def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path):
    """Editors of Windows write it."""
    robot = '<robot name="arm"><link name="base"/></robot>'
    for name, text in (("m.toml", BODY), ("arm.urdf", robot)):
        (tmp_path / name).write_text(text, encoding="utf-8-sig")
    assert mbdae.load(tmp_path / "m.toml").nv == 1
    assert mbdae.load(tmp_path / "arm.urdf", free_flyer=True).nv == 6


def test_a_motor_may_be_named_input():
    """Its table is no reference to an input."""
    file = read_toml('[[input]]\nname = "u"\nvalue = 2.0\n[motor]\ninput = { input = "u" }\n', "m.toml")
    assert (file.motor["input"].kind, file.motor["input"].value) == ("input", 2.0)
    assert read_toml("motor.input = 3.0", "m.toml").motor["input"].value == 3.0


def faults(text, tmp_path, monkeypatch):
    """The unknown names of a file's UnknownNameError, and the valid ones."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(text)
    with pytest.raises(UnknownNameError) as reported:
        mbdae.load("m.toml")
    return str(reported.value).split("; ")


FAULTY = """
[[body]]
name = "a"
parent = "wrld"
[[body]]
name = "b"
parent = "a"
mass = 1.0
inertia = [1, 1, 1, 0, 0, 0]
[[frame]]
name = "tip"
parent = "c"
[[closure]]
kind = "point"
name = "pin"
frames = ["tip", "z"]
within = { joint = "d", windows = [[0, 1]] }
[[closure]]
kind = "coupling"
joints = ["a", "e"]
coefficients = [0, 2]
[[force]]
kind = "joint_spring"
name = "s"
joint = ["b", "f"]
stiffness = 1.0
[[force]]
kind = "coulomb_friction"
closure = "pim"
coefficient = 0.1
[start]
q = { g = 1 }
[order]
v = { h = 1 }
"""


def test_all_names_that_do_not_exist_are_said_at_once(tmp_path, monkeypatch):
    assert faults(FAULTY, tmp_path, monkeypatch) == [
        "m.toml: frame.tip.parent: unknown frame 'c'",
        "body.a.parent: unknown frame 'wrld' (did you mean 'world'?)",
        "closure.pin.frames.1: unknown frame 'z'",
        "valid: world, a, b, tip",
        "closure.pin.within.joint: unknown joint 'd'",
        "closure.a-e.joints.1: unknown joint 'e'",
        "force.s.joint.1: unknown joint 'f'",
        "start.q.g: unknown joint 'g'",
        "order.v.h: unknown joint 'h'",
        "valid: a, b",
        "force.1.closure: unknown closure 'pim' (did you mean 'pin'?)",
        "valid: pin, a-e",
    ]


def test_a_locked_joint_is_no_unknown_one(tmp_path, monkeypatch):
    spring = "[[force]]\nkind = 'joint_spring'\njoint = ['a', 'x']\nstiffness = 1.0\n"
    bodies = BODY + BODY.replace('"a"', '"b"')
    assert faults("lock = { a = 0.0 }\n" + bodies + spring, tmp_path, monkeypatch) == [
        "m.toml: force.0.joint.0: joint 'a' is locked",
        "force.0.joint.1: unknown joint 'x'",
        "valid: b",
    ]


def test_names_of_sources_are_known(tmp_path, monkeypatch):
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"/><link name="link"/><joint name="turn" type="continuous">'
        '<parent link="base"/><child link="link"/><axis xyz="0 0 1"/></joint></robot>'
    )
    text = '[[source]]\nfile = "arm.urdf"\nprefix = "l_"\n' + BODY.replace("world", "l_link")
    lost = '[[force]]\nkind = "joint_spring"\njoint = ["l_turn", "x"]\nstiffness = 1.0\n'
    text = f"lock = {{ y = 0.0 }}\n[motor]\nu = 1.0\nw = 2.0\n{text}{lost}"
    assert faults(text, tmp_path, monkeypatch) == [
        "m.toml: lock.y: unknown joint 'y'",
        "force.0.joint.1: unknown joint 'x'",
        "valid: l_turn, a",
        "motor.u: unknown motor 'u'",
        "motor.w: unknown motor 'w'",
        "valid: none",
    ]


def test_what_python_adds_is_not_the_files():
    with pytest.raises(UnknownNameError) as reported:
        mbdae.load("pendulum", forces=[mbdae.JointSpring(joint="b", stiffness=1.0)])
    assert str(reported.value).startswith("unknown joint 'b'")
