"""URDF files with mistakes: each is named before Pinocchio leaves something out, or follows a loop of links."""

import pytest

import mbdae
from mbdae.errors import InputError

LINK = """<link name="arm"><inertial><origin xyz="0 0 1"/><mass value="1.5"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link><link name="tip"/>"""
JOINT = """<joint name="hinge" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" effort="0" velocity="0"/><dynamics damping="0.2"/></joint>
    <joint name="end" type="fixed"><parent link="arm"/><child link="tip"/></joint>"""
URDF = f'<robot name="r"><link name="base"/>{LINK}{JOINT}</robot>'
FIXED = '<joint name="again" type="fixed"><parent link="{}"/><child link="{}"/></joint></robot>'


@pytest.mark.filterwarnings("ignore:r. not carried over")
@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"1.5"', '"nan"', "mass/@value of link 'arm' of r.urdf takes a finite number, got 'nan'"),
        ('"1.5"', '"1_000"', "mass/@value of link 'arm' of r.urdf takes a finite number, got '1_000'"),
        ('type="revolute"', 'type="ball"', "'hinge' of r.urdf has type 'ball', expected one of continuous, revolute, "),
        (' effort="0"', "", "^joint 'hinge' of r.urdf is revolute and needs a limit with effort$"),
        ('"0 0 1"', '"0,0,1"', "origin/@xyz of link 'arm' of r.urdf takes 3 finite numbers, got '0,0,1'"),
        (' izz="0.1"', "", "inertia/@izz of link 'arm' of r.urdf takes a finite number, got ''"),
        ('<mass value="1.5"/>', "", "the inertial of link 'arm' of r.urdf needs a mass and an inertia"),
        ('ixy="0"', 'ixy="0.2"', "the inertia of link 'arm' of r.urdf is not positive semi-definite"),
        ('"1 0 0"', '"1 0"', "axis/@xyz of joint 'hinge' of r.urdf takes 3 finite numbers, got '1 0'"),
        ('"0.2"', '"-0.2"', "the damping of joint 'hinge' is negative: -0.2"),
        ("</robot>", FIXED.format("base", "tip"), "link 'tip' is the child of joints 'end' and 'again': cut the loop"),
        ("</robot>", FIXED.format("tip", "base"), "r.urdf: link 'arm' is its own ancestor"),
        ("</robot>", '<link name="x"/>' + FIXED.format("x", "x"), "r.urdf: link 'x' is its own ancestor"),
        ('lower="-1"', 'lower="2"', "joint 'hinge' has limits in the wrong order: 2 to 1"),
    ],
)
def test_mistakes_of_a_urdf_are_named(tmp_path, capfd, old, new, said):
    (tmp_path / "r.urdf").write_text(URDF.replace(old, new, 1))
    (tmp_path / "r.toml").write_text('source = "r.urdf"\n[[stop]]\nlimits = true\n')
    with pytest.raises(InputError, match=said):
        mbdae.load(tmp_path / "r.toml")
    assert capfd.readouterr().err == ""
