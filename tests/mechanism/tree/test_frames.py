"""Frames by name: links before joints of the same name; fixed bases, and freed ones."""

import re

import numpy as np
import pytest
from commands import call, without_pictures

import mbdae
from mbdae.errors import InputError, UnknownNameError

ARM = """<robot name="arm"><link name="base"/><link name="arm"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
<inertia ixx="0.2" iyy="0.2" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="arm" type="continuous"><parent link="base"/><child link="arm"/><origin xyz="0 0 1"/><axis xyz="0 1 0"/>
</joint></robot>"""
BASE = """<link name="base"><inertial><mass value="3"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial></link>"""
HEAVY = ARM.replace('<link name="base"/>', BASE)


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM)
    return path


def test_a_link_and_a_joint_of_one_name_are_both_found(arm, tmp_path, monkeypatch):
    without_pictures(monkeypatch)
    mech = mbdae.load(arm)
    np.testing.assert_allclose(mech.frame(mech.start[0], "arm")[0], [0, 0, 1])
    assert mech.start[0].shape == (2,)
    sol = mbdae.solve(mech, (0, 0.05), mech.start[0], [0.3], step=0.01)
    assert {"q.arm", "position.arm.z"} <= sol.signals().keys()
    code, _, err = call("solve", arm, "-t", "0.05", "-o", tmp_path / "run.csv")
    assert (code, err) == (0, "")
    assert "position.arm.z" in (tmp_path / "run.csv").read_text().splitlines()[0]
    assert call("report", arm, "-t", "0.05", "-o", tmp_path / "report.html")[0] == 0
    for name in ("leg", 3):
        with pytest.raises(UnknownNameError, match=f"unknown frame {name!r}; valid: world, base, arm"):
            mech.frame(mech.start[0], name)


def test_a_fixed_base_is_reported_and_free_on_request(tmp_path):
    path = tmp_path / "heavy.urdf"
    path.write_text(HEAVY)
    assert re.search(r"^  fixed base base$", call("info", path)[1], re.MULTILINE)
    free = mbdae.load(path, free_flyer=True)
    assert free.joint_names == ["root_joint", "arm"]
    assert "fixed base" not in str(mbdae.info(free))
    sol = mbdae.solve(free, (0, 0.2), step=0.01)  # both links fall freely
    assert sol.q[-1, 2] == pytest.approx(-0.5 * 9.81 * 0.2**2, rel=1e-10)
    with pytest.raises(InputError, match=r"free_flyer belongs to a source; a \[\[body\]\] says joint = \"free\""):
        mbdae.load("pendulum", free_flyer=True)
