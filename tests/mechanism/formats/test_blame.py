"""What is wrong with a file is said with the file, the entry by its name, and the key."""

import pickle

import pytest

import mbdae
from mbdae.errors import InputError, UnknownNameError

BODY = '[[body]]\nname = "a"\nparent = "world"\nmass = 1.0\ninertia = [1, 1, 1, 0, 0, 0]\n'


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
    ],
)
def test_files(text, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.toml").write_text(text.replace("start.q", "[start]\nq"))
    with pytest.raises(InputError) as told:
        mbdae.load("m.toml")
    assert str(told.value).startswith(words)
    assert str(pickle.loads(pickle.dumps(told.value))) == str(told.value)


def test_what_python_adds_is_not_the_files():
    with pytest.raises(UnknownNameError) as told:
        mbdae.load("pendulum", forces=[mbdae.JointSpring(joint="b", stiffness=1.0)])
    assert str(told.value).startswith("unknown joint 'b'")
