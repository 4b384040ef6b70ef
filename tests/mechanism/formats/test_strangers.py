"""Untrusted files: programs in them are named before they run, and names cannot control a terminal."""

import pytest
from commands import call

import mbdae
from mbdae.errors import InputError, MbdaeError
from mbdae.solution import problem
from mbdae.studies.sweep.toml_file import read_sweep

TOWER = """def mechanism(floors: int = 1) -> dict:
    return {"body": [{"name": f"floor_{i}", "parent": "world", "mass": 1.0} for i in range(floors)]}
"""
RED = "\x1b[31m"


@pytest.mark.parametrize("model", ["tower", "tower/mechanism.py", "tower?floors=2"])
def test_a_python_file_that_a_sweep_names_is_said(tmp_path, model):
    (tmp_path / "tower").mkdir()
    (tmp_path / "tower" / "mechanism.py").write_text(TOWER)
    (tmp_path / "sweep.toml").write_text(f'model = "{model}"\nend = 0.1\noutputs = ["final q.floor_0"]\n[grid]\n')
    with pytest.warns(UserWarning, match=r"sweep\.toml: the Python file .*mechanism\.py is run$") as said:
        assert "mechanism.py" in read_sweep(tmp_path / "sweep.toml")["model"]
    assert len(said) == 1


def test_names_with_control_characters_are_rejected(tmp_path):
    body = '[[body]]\nname = "NAME"\nparent = "world"\nmass = 1.0\n'
    for text, said in ((f'title = "{RED}"', "title"), (body.replace("NAME", "\\u001b[2J"), r"body\.0\.name")):
        (tmp_path / "x.toml").write_text(text.replace("\x1b", "\\u001b") + "\n" + body.replace("NAME", "arm"))
        with pytest.raises(InputError, match=rf"{said} .* control characters"):
            mbdae.load(tmp_path / "x.toml")
    (tmp_path / "x.toml").write_text(body.replace("NAME", "höhe ⌀\\tzwei"))
    assert mbdae.load(tmp_path / "x.toml").nv == 1


@pytest.mark.filterwarnings("ignore:x. not carried over. other contents of x.xml, which is not well-formed XML")
def test_mjcf_names_with_control_characters_are_rejected(tmp_path):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    text = f'<mujoco><worldbody><body name="{RED}"><joint/><geom size="0.1"/></body></worldbody></mujoco>'
    (tmp_path / "x.xml").write_text(text)
    with pytest.raises(InputError, match="control characters"):
        mbdae.load(tmp_path / "x.xml")


def test_errors_and_commands_print_no_control_characters(tmp_path):
    assert str(MbdaeError(f"{RED}a\nb\u202e")) == "\\x1b[31ma b\\u202e"
    path = tmp_path / f"{RED}.toml"
    path.write_text('[[body]]\nname = "arm"\nparent = "world"\nmass = 1.0\ninertia = [1, 1, 1, 0, 0, 0]\n')
    for arguments in (("info", path), ("solve", f"{path}x")):
        _, out, err = call(*arguments)
        assert "\x1b" not in out + err
        assert "\\x1b" in out + err


def test_a_lack_of_memory_is_one_line(monkeypatch):
    def load(path):
        raise MemoryError("Unable to allocate 10 TiB")

    monkeypatch.setattr(problem, "load", load)
    said = "mbdae: not enough memory: Unable to allocate 10 TiB\n"
    assert call("solve", "four_bar") == (1, "", said)
