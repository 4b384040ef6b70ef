"""Position, velocity and general actuators of MJCF files as controllers, against MuJoCo: its torques, its rest."""

import numpy as np
import pytest

import mbdae

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
FIVE_BAR = """<mujoco>
<option gravity="0 0 -9.81" timestep="0.001"/>
<default><joint axis="0 -1 0" damping="0.5"/>
  <geom type="capsule" size="0.01" density="2000" contype="0" conaffinity="0"/></default>
<worldbody>
  <geom name="floor" type="plane" size="0 0 1" pos="0 0 -0.5" contype="0" conaffinity="0"/>
  <body name="left"><joint name="left"/><geom fromto="0 0 0 0.2 0 0"/>
    <body name="left_rod" pos="0.2 0 0"><joint name="left_elbow"/><geom fromto="0 0 0 0.3 0 0"/>
      <site name="left_tip" pos="0.3 0 0"/></body></body>
  <body name="right" pos="0.2 0 0"><joint name="right"/><geom fromto="0 0 0 0.2 0 0"/>
    <body name="right_rod" pos="0.2 0 0"><joint name="right_elbow"/><geom fromto="0 0 0 0.3 0 0"/>
      <site name="right_tip" pos="0.3 0 0"/></body></body>
</worldbody>
<equality><connect site1="left_tip" site2="right_tip" solref="0.002 1" solimp="0.9999 0.9999 0.001"/></equality>
<actuator>
  <position name="left" joint="left" kp="40" kv="3"/>
  <general name="right" joint="right" gear="2" gainprm="20" biastype="affine" biasprm="0.4 -10 -1"/>
</actuator>
<keyframe><key qpos="2.2 -1.3 0.95 1.3" ctrl="2.3 0.9"/></keyframe>
</mujoco>"""


@pytest.fixture
def five_bar(tmp_path):
    path = tmp_path / "five_bar.xml"
    path.write_text(FIVE_BAR)
    return path


def test_a_five_bar_rests_where_mujoco_holds_it(five_bar):
    m = mujoco.MjModel.from_xml_path(str(five_bar))
    d = mujoco.MjData(m)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    for _ in range(6000):
        mujoco.mj_step(m, d)
    assert np.abs(d.qvel).max() < 1e-8
    with pytest.warns(UserWarning, match="assembly closes it"):
        mech = mbdae.load(five_bar)
    assert not mech.left_out
    assert mech.scene.ground == -0.5
    assert "floor" not in [shape.name for shape in mech.scene.shapes]
    assert mbdae.equilibrium(mech).q == pytest.approx(d.qpos, abs=1e-3)
    assert min(d.qpos[0] - 2.3, d.qpos[2] - 0.9) > 0.005  # weight bends the controllers by more


ONE = """<mujoco><worldbody><body><joint name="j" axis="0 1 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
<actuator>{}</actuator><keyframe><key ctrl="0.7"/></keyframe></mujoco>"""


@pytest.mark.parametrize(
    "actuator",
    [
        '<position name="a" joint="j" kp="30" kv="2" gear="3"/>',
        '<velocity name="a" joint="j" kv="5" gear="2"/>',
        '<general name="a" joint="j" gear="2" gainprm="4" biastype="affine" biasprm="1.5 0 0"/>',
        '<general name="a" joint="j" gear="2" gaintype="affine" gainprm="4" biastype="affine" biasprm="1 -2 -3"/>',
    ],
)
def test_torques_are_those_of_mujoco(actuator, tmp_path):
    path = tmp_path / "one.xml"
    path.write_text(ONE.format(actuator))
    m = mujoco.MjModel.from_xml_path(str(path))
    d = mujoco.MjData(m)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    d.qpos[:], d.qvel[:] = 0.4, -1.3
    mujoco.mj_forward(m, d)
    mech = mbdae.load(path)
    system = mech.system()
    q, v = np.array([0.4]), np.array([-1.3])
    system.inertia(0.0, q)
    assert system.torque(0.0, q, v, np.empty(0))[0][0] == pytest.approx(d.qfrc_actuator[0], rel=1e-12)


def test_gains_that_depend_on_the_joint_are_named(tmp_path):
    path = tmp_path / "one.xml"
    path.write_text(ONE.format('<general name="a" joint="j" gaintype="affine" gainprm="4 1 0"/>'))
    with pytest.warns(UserWarning, match=r"actuators that are no motors.* a"):
        assert not mbdae.load(path).motors
