"""MJCF files: equalities between fixed bodies are dropped, all omissions are named, and names are distinct."""

from pathlib import Path

import numpy as np
import pytest

import mbdae
from mbdae.mechanism.formats.mjcf.compiled_model import MjcfModel
from mbdae.mechanism.formats.mjcf.file_checks import XmlFiles
from mbdae.mechanism.formats.mjcf.unread_contents import unread
from mbdae.studies.info.info import info

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")

GEOM = '<geom size="0.1" contype="0" conaffinity="0"/>'
PENDULUM = f'<body name="rod"><joint name="j" axis="0 1 0"/>{GEOM}</body>'


def load(folder, inside, behind="", before=""):
    """The mechanism of bodies and further elements after the world body, without the warning."""
    text = f"<mujoco>{before}<worldbody>{PENDULUM}{inside}</worldbody>{behind}</mujoco>"
    (folder / "x.xml").write_text(text)
    with pytest.warns(UserWarning, match="not carried over") as caught:
        mech = mbdae.load(folder / "x.xml")
    return mech, str(caught[0].message)


@pytest.mark.parametrize(
    "equality",
    ['weld name="w" body1="a" body2="b"', 'connect name="w" body1="a" body2="b" anchor="0 0 0"',
     'weld name="w" body1="a"', 'weld name="w" site1="s" site2="t"', 'weld name="w" body1="rod" body2="hand"'],
)  # fmt: skip
def test_equalities_between_bodies_that_do_not_move_are_left_out_by_name(tmp_path, equality):
    bodies = '<body name="a"><site name="s"/></body><body name="b" pos="1 0 0"><site name="t"/></body>'
    hand = PENDULUM.replace("</body>", '<body name="hand" pos="0 0 -1"/></body>')
    text = f"<mujoco><worldbody>{hand}{bodies}</worldbody><equality><{equality}/></equality></mujoco>"
    (tmp_path / "x.xml").write_text(text)
    with pytest.warns(UserWarning, match=r"equalities w \(no relative motion of its bodies\)"):
        mech = mbdae.load(tmp_path / "x.xml")
    assert (mech.nv, mech.ng) == (1, 0)
    assert mbdae.solve(mech, (0, 0.01), step=1e-3).status == "finished"


def test_all_names_of_omitted_contents_are_in_info(tmp_path):
    links = "".join(f'<body><joint name="hinge_{i}" range="-1 1" limited="true"/>{GEOM}</body>' for i in range(9))
    mech, said = load(tmp_path, links)
    names = [f"hinge_{i}" for i in range(9)]
    first = "limits of joints hinge_0, hinge_1, hinge_2, hinge_3 and 5 more (see mbdae info)"
    assert said == f"x: not carried over: {first}"
    assert mech.left_out == (f"limits of joints {', '.join(names)}",)
    assert f"limits of joints {', '.join(names)}" in " ".join(str(info(mech)).split())


@pytest.mark.skipif(not hasattr(mujoco, "mjtSleepPolicy"), reason="this MuJoCo has no sleep")
def test_adhesion_and_sleep_are_named(tmp_path):
    inside = (
        '<body name="box" sleep="never" pos="3 0 0"><joint name="k"/>'
        '<geom name="pad" size="0.1" adhesion="3" contype="0" conaffinity="0"/></body>'
    )
    mech, _ = load(tmp_path, inside)
    assert mech.left_out == ("adhesion of geoms pad", "sleep of bodies box")
    mech, _ = load(tmp_path, "", before='<option><flag sleep="enable"/></option>')
    assert mech.left_out == ("sleep of bodies",)


def test_an_actuator_with_a_plugin_is_no_motor(tmp_path):
    extension = (
        '<extension><plugin plugin="mujoco.pid"><instance name="pid"><config key="kp" value="40"/></instance></plugin>'
        "</extension>"
    )
    actuator = '<actuator><plugin name="p" joint="j" plugin="mujoco.pid" instance="pid"/></actuator>'
    mech, _ = load(tmp_path, "", actuator, extension)
    assert not mech.motors
    what = "actuators other than motors, positions or velocities of a hinge or slide"
    assert mech.left_out == (f"{what} p (plugin)", "plugins pid")


@pytest.mark.parametrize("flags", ['frictionloss="disable" limit="disable"', 'constraint="disable"'])
def test_friction_and_limits_that_the_file_disables_are_not_there(tmp_path, flags):
    joint = f'<body><joint name="k" range="-1 1" limited="true" frictionloss="0.3"/>{GEOM}</body>'
    (tmp_path / "x.xml").write_text(
        f"<mujoco><option><flag {flags}/></option><worldbody>{PENDULUM}{joint}</worldbody></mujoco>"
    )
    mech = mbdae.load(tmp_path / "x.xml")
    assert mech.left_out == ()
    assert not mech.model.upperDryFrictionLimit.any()
    assert not mech.model.lowerDryFrictionLimit.any()
    assert (mech.model.upperPositionLimit > np.finfo(float).max / 2).all()


def test_a_flag_of_older_versions_is_read():
    """MuJoCo 4 does not compile it; 3.3 has it for springs and dampers together."""
    text = b'<mujoco><option><flag passive="disable" warmstart="disable"/></option></mujoco>'
    assert unread(XmlFiles(Path("x.xml"), {Path("x.xml"): text}, {})) == ["option/flag/@warmstart"]


def test_an_unknown_flag_is_an_error():
    c = MjcfModel(mujoco, mujoco.MjModel.from_xml_string("<mujoco/>"), "empty")
    with pytest.raises(AttributeError, match="mjDSBL_GRAVTIY"):
        c.disables("GRAVTIY")


def test_names_of_the_file_are_kept_beside_objects_without_one(tmp_path):
    """An object without a name has a word and its number, which another one may have as its name."""
    bodies = f'<body><joint axis="0 1 0"/>{GEOM}<body><joint name="joint0"/>{GEOM}</body></body>'
    motors = '<motor joint="joint0"/><motor name="actuator0" joint="joint0"/>'
    keys = '<key qpos="0.1 0"/><key name="key0" qpos="0.2 0"/>'
    rest = f"<actuator>{motors}</actuator><keyframe>{keys}</keyframe>"
    (tmp_path / "x.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody>{rest}</mujoco>")
    mech = mbdae.load(tmp_path / "x.xml", key="key0")
    assert mech.joint_names == ["joint0_2", "joint0"]
    assert [(m.name, m.joint) for m in mech.motors] == [("actuator0_2", "joint0"), ("actuator0", "joint0")]
    assert mech.start[0].tolist() == [0.2, 0.0]
    assert mbdae.load(tmp_path / "x.xml", key="key0_2").start[0].tolist() == [0.1, 0.0]


def test_colours_are_those_of_the_viewer(tmp_path):
    """A geom's colour, unless it is the default one, is in place of that of its material."""
    path = tmp_path / "balls.xml"
    path.write_text(
        """<mujoco><asset><material name="red" rgba="1 0 0 1"/></asset><default><geom type="sphere" size="0.1"
        contype="0" conaffinity="0" mass="1"/></default><worldbody><body><joint name="j"/><geom material="red"/>
        <geom material="red" rgba="0 0 1 0.5"/><geom material="red" rgba="0.5 0.5 0.5 1"/><geom rgba="0 1 0 1"/>
        <geom/></body></worldbody></mujoco>"""
    )
    m = mujoco.MjModel.from_xml_path(str(path))
    d, scene = mujoco.MjData(m), mujoco.MjvScene(m, 9)
    mujoco.mj_forward(m, d)
    shown = mujoco.MjvOption(), None, mujoco.MjvCamera(), mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(m, d, *shown, scene)
    known = {x.objid: x.rgba for x in scene.geoms[: scene.ngeom] if x.objtype == mujoco.mjtObj.mjOBJ_GEOM}
    found = [x.meshColor for x in mbdae.load(path).visuals.geometryObjects]
    np.testing.assert_allclose(found, [known[g] for g in range(m.ngeom)], atol=1e-7)
