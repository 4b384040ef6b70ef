"""Robots by name: of example-robot-data, and of robot_descriptions where that is installed."""

import sys

import pytest

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism.formats.model_library import ROBOTS

pytestmark = pytest.mark.filterwarnings("ignore:.*not carried over")  # joint limits, which have separate tests

URDF = """<robot name="one"><link name="base"/><link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""


def test_a_robot_of_example_robot_data():
    pytest.importorskip("pinocchio")
    mech = mbdae.load(f"{ROBOTS}panda_description/urdf/panda.urdf")
    assert mech.nv == 9
    with pytest.raises(InputError, match="is not a file"):
        mbdae.load(f"{ROBOTS}nothing.urdf")


@pytest.fixture
def descriptions(tmp_path, monkeypatch):
    folder = tmp_path / "robot_descriptions"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (tmp_path / "one.urdf").write_text(URDF)
    (folder / "one_description.py").write_text(f"URDF_PATH = {str(tmp_path / 'one.urdf')!r}\n")
    (folder / "far_description.py").write_text("raise OSError('no network')\n")
    (folder / "empty_description.py").touch()
    for name in [n for n in sys.modules if n.partition(".")[0] == "robot_descriptions"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)


@pytest.mark.usefixtures("descriptions")
def test_a_robot_of_robot_descriptions():
    assert mbdae.load("one_description").joint_names == ["hinge"]
    with pytest.raises(InputError, match="cannot fetch it: no network"):
        mbdae.load("far_description")
    with pytest.raises(InputError, match="without a URDF or MJCF file"):
        mbdae.load("empty_description")
    with pytest.raises(UnknownNameError, match="unknown model 'other_description'"):
        mbdae.load("other_description")
