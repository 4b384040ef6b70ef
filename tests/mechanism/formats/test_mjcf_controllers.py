"""Position, velocity and general actuators of MJCF files, each as one force, against MuJoCo: forces and equilibrium."""

import warnings

import numpy as np
import pytest

import mbdae
from mbdae.mechanism.formats.mechanism_file.loaded_model import LoadedModel, parameter_value

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


@pytest.mark.filterwarnings("ignore:.*option/@timestep; equality/connect/@solref; equality/connect/@solimp$")
def test_a_five_bar_rests_where_mujoco_holds_it(five_bar):
    m = mujoco.MjModel.from_xml_path(str(five_bar))
    d = mujoco.MjData(m)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    for _ in range(6000):
        mujoco.mj_step(m, d)
    assert np.abs(d.qvel).max() < 1e-8
    with pytest.warns(UserWarning, match="assembly corrects it"):
        mech = mbdae.load(five_bar)
    assert mech.left_out == ("option/@timestep", "equality/connect/@solref", "equality/connect/@solimp")
    assert mech.scene.ground == -0.5
    assert "floor" not in [shape.name for shape in mech.scene.shapes]
    assert mbdae.equilibrium(mech).q == pytest.approx(d.qpos, abs=1e-3)
    assert min(d.qpos[0] - 2.3, d.qpos[2] - 0.9) > 0.005  # gravity bends the controllers by more


ONE = """<mujoco><worldbody><body><joint name="j" axis="0 1 0"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
<actuator>{}</actuator><keyframe><key ctrl="0.7"/></keyframe></mujoco>"""


ACTUATORS = [
    '<position name="a" joint="j" kp="30" kv="2" gear="3"/>',
    '<velocity name="a" joint="j" kv="5" gear="2"/>',
    '<motor name="a" joint="j" gear="-2"/>',
    '<general name="a" joint="j" gear="2" gainprm="4" biastype="affine" biasprm="1.5 0 0"/>',
    '<general name="a" joint="j" gear="2" gaintype="affine" gainprm="4" biastype="affine" biasprm="1 -2 -3"/>',
]


@pytest.mark.parametrize("actuator", ACTUATORS)
def test_torque_and_power_are_those_of_mujoco(actuator, tmp_path, back_end):
    path = tmp_path / "one.xml"
    path.write_text(ONE.format(actuator))
    m = mujoco.MjModel.from_xml_path(str(path))
    d = mujoco.MjData(m)
    control = {"kind": "harmonic", "offset": 0.7, "amplitude": 0.4, "omega": 5.0}
    mech = mbdae.load(path, motors={"a": control})
    sol = mbdae.solve(mech, (0, 1), np.array([0.4]), np.array([-1.3]))
    assert sol.stats["backend"] == back_end
    found = sol.signals()
    assert [f.name for f in mech.forces] == [n[6:] for n in found if n.startswith("power.")] == ["a"]
    torque, power = found["torque.a"], found["power.a"]
    for k in np.linspace(0, len(sol.t) - 1, 5, dtype=int):
        d.qpos[:], d.qvel[:], d.ctrl[:] = sol.q[k], sol.v[k], 0.7 + 0.4 * np.sin(5.0 * sol.t[k])
        mujoco.mj_forward(m, d)
        assert torque[k] == pytest.approx(m.actuator_gear[0, 0] * d.actuator_force[0], rel=1e-12)
        assert power[k] == pytest.approx(d.qfrc_actuator[0] * d.qvel[0], rel=1e-12)


@pytest.mark.parametrize("name", ["gear", "bias.0", "bias.1", "bias.2", "torque"])
def test_runs_have_derivatives_by_the_parameters_of_actuators(name, five_bar):
    with warnings.catch_warnings(action="ignore"):
        mech = mbdae.load(five_bar)
    key, tight = f"force.right.{name}", {"rtol": 1e-10, "method": "pherk6"}
    derivative = mbdae.sensitivity(mbdae.solve(mech, (0, 0.5), **tight), [key]).signal("q.left")[-1]

    def end(x):
        return mbdae.solve(files.make({key: x}), (0, 0.5), **tight).signals("q.left")["q.left"][-1]

    files = LoadedModel(mech)
    x = parameter_value(files, key)
    assert derivative == pytest.approx((end(x + 1e-4) - end(x - 1e-4)) / 2e-4, rel=1e-5)


def test_gains_that_depend_on_the_joint_are_named(tmp_path):
    path = tmp_path / "one.xml"
    path.write_text(ONE.format('<general name="a" joint="j" gaintype="affine" gainprm="4 1 0"/>'))
    with pytest.warns(UserWarning, match=r"actuators other than motors.* a"):
        assert not mbdae.load(path).motors
