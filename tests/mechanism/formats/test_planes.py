"""Axes of joints: that of a planar joint is the normal of its plane, in every format; joints without one reject it."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.formats.mechanism_file.description import describe, restore

pytestmark = pytest.mark.filterwarnings("ignore:.*not carried over")  # joint limits, which have separate tests

GRAVITY, COM = np.array([0.5, -1.0, -9.81]), np.array([0.1, -0.2, 0.3])
PLACE, TURN = np.array([0.3, 0.2, 1.0]), np.array([0.4, -0.7, 0.2])  # of the joint; rpy in rad
AXES = {"x": (1.0, 0.0, 0.0), "minus z": (0.0, 0.0, -1.0), "slanting": (0.6, -1.2, 0.4), "z": (0.0, 0.0, 1.0)}
SPEED = (0.0, 0.0, 3.0)  # rad/s about the normal

URDF = """<robot name="slider"><link name="base"/><link name="puck">
<inertial><origin xyz="0.1 -0.2 0.3"/><mass value="2"/>
<inertia ixx="0.03" iyy="0.04" izz="0.05" ixy="0.001" ixz="0.002" iyz="-0.003"/></inertial></link><link name="tip"/>
<joint name="slide" type="{kind}"><origin xyz="0.3 0.2 1.0" rpy="0.4 -0.7 0.2"/><parent link="base"/>
<child link="puck"/>{axis}<limit effort="1" velocity="1" lower="-1" upper="1"/></joint>
<joint name="glue" type="fixed"><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><parent link="puck"/><child link="tip"/>
<axis xyz="0 0 0"/></joint></robot>"""
BODY = """
[[body]]
name = "puck"
parent = "world"
joint = "{kind}"
{axis}
xyz = [0.3, 0.2, 1.0]
rpy = [0.4, -0.7, 0.2]
mass = 2.0
com = [0.1, -0.2, 0.3]
inertia = [0.03, 0.04, 0.05, 0.001, 0.002, -0.003]
[[frame]]
name = "tip"
parent = "puck"
xyz = [1, 2, 3]
rpy = [0.1, 0.2, 0.3]
"""
HEAD = "gravity = [0.5, -1.0, -9.81]\n"


def in_toml(tmp_path, axis, kind="planar"):
    (tmp_path / "mechanism.toml").write_text(HEAD + BODY.format(kind=kind, axis=f"axis = {list(axis)}" if axis else ""))
    return mbdae.load(tmp_path / "mechanism.toml")


def in_urdf(tmp_path, axis, kind="planar", more=""):
    xyz = f'<axis xyz="{" ".join(map(str, axis))}"/>' if axis else ""
    (tmp_path / "slider.urdf").write_text(URDF.format(kind=kind, axis=xyz))
    (tmp_path / "mechanism.toml").write_text(f'source = "slider.urdf"\n{HEAD}{more}')
    return mbdae.load(tmp_path / "mechanism.toml")


def in_place_of_a_hinge(tmp_path, axis):
    return in_urdf(tmp_path, axis, "revolute", 'joint_type = { slide = "planar" }')


def slid(mech, normal):
    """Let the body fall for a second and compare with free motion in the plane with this normal in the joint's frame.

    The centre of mass falls with the in-plane part of gravity; the rotation about the normal is unchanged.
    """
    R = pin.rpy.rpyToMatrix(TURN)
    n = R @ np.array(normal) / np.linalg.norm(normal)
    sol = mbdae.solve(mech, (0, 1), v=np.array(SPEED), rtol=1e-10, atol=1e-12)
    data = mech.model.createData()
    start, end = (pin.centerOfMass(mech.model, data, y[: mech.nq]).copy() for y in (sol.y[0], sol.y[-1]))
    np.testing.assert_allclose(start, PLACE + R @ COM, atol=1e-14)
    speed = np.cross(SPEED[2] * n, R @ COM)
    inside = GRAVITY - n * (n @ GRAVITY)
    np.testing.assert_allclose(end, start + speed + inside / 2, atol=1e-8)
    for t, q in ((0.0, sol.y[0]), (1.0, sol.y[-1])):
        pin.framesForwardKinematics(mech.model, data, q[: mech.nq])
        found = data.oMf[mech.model.getFrameId("tip")].rotation
        turned = pin.exp3(SPEED[2] * t * n) @ R @ pin.rpy.rpyToMatrix(np.array([0.1, 0.2, 0.3]))
        np.testing.assert_allclose(found, turned, atol=1e-8)


@pytest.mark.parametrize("read", [in_toml, in_urdf, in_place_of_a_hinge], ids=lambda f: f.__name__)
@pytest.mark.parametrize("axis", AXES.values(), ids=AXES)
def test_a_planar_joint_slides_across_its_axis(tmp_path, read, axis):
    mech = read(tmp_path, axis)
    slid(mech, axis)
    again = restore(describe(mech))
    assert again.model == mech.model


def test_axes_that_are_left_out(tmp_path):
    slid(in_urdf(tmp_path, None), (1, 0, 0))  # as the URDF's specification says
    slid(in_toml(tmp_path, None), (0, 0, 1))


def test_names_and_locks_of_planar_joints(tmp_path):
    mech = in_urdf(tmp_path, (0, 3, 4))
    plain = in_urdf(tmp_path, (0, 3, 4), more="[start]\nq = { slide = [0.1, 0.2, 0.8, 0.6] }")
    locked = "lock = { slide = [0.1, 0.2, 0.8, 0.6] }\n[[body]]\nname = 'x'\nparent = 'tip'\nmass = 1.0"
    other = in_urdf(tmp_path, (0, 3, 4), more=locked)
    places = []
    for m in (plain, other):
        data = m.model.createData()
        pin.framesForwardKinematics(m.model, data, m.start[0])
        places.append(data.oMf[m.model.getFrameId("tip")].homogeneous)
    np.testing.assert_allclose(places[0], places[1], atol=1e-14)
    assert mech.joint_kind("slide") == "Planar"
    (tmp_path / "mechanism.toml").write_text(HEAD + '[[source]]\nfile = "slider.urdf"\nprefix = "a_"')
    assert mbdae.load(tmp_path / "mechanism.toml").model.jointPlacements[1] == mech.model.jointPlacements[1]


def test_a_planar_joint_that_becomes_another_keeps_its_frame(tmp_path):
    mech = in_urdf(tmp_path, (0, 3, 4), more='joint_type = { slide = "universal" }')
    np.testing.assert_allclose(mech.model.jointPlacements[1].rotation, pin.rpy.rpyToMatrix(TURN), atol=1e-15)


@pytest.mark.parametrize("kind", ["spherical", "universal", "translation", "free", "fixed"])
def test_joints_without_an_axis_refuse_one(tmp_path, kind):
    with pytest.raises(InputError, match=f"axis does not belong to a {kind} joint; rotate its frame by rpy"):
        in_toml(tmp_path, (0, 0, 1), kind)
    if kind != "fixed":
        mech = in_toml(tmp_path, None, kind)
        assert restore(describe(mech)).model == mech.model


@pytest.mark.parametrize("kind", ["revolute", "continuous", "prismatic", "planar"])
def test_axes_of_zero_are_rejected(tmp_path, kind):
    with pytest.raises(InputError, match=r"slider.urdf: the axis of joint 'slide' is not a direction: 0.0 0.0 0.0"):
        in_urdf(tmp_path, (0.0, 0.0, 0.0), kind)
    with pytest.raises(InputError, match="the axis of body 'puck' is zero"):
        in_toml(tmp_path, (0.0, 0.0, 0.0), kind)
