"""Actuators of MJCF files: supported ones are converted, others are named."""

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.errors import InputError

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")


def geared(tmp_path, motor, option="", joint="", control="3"):
    path = tmp_path / "geared.xml"
    path.write_text(
        f"""<mujoco>{option}<worldbody><body><joint name="j" axis="0 1 0" {joint}/>
        <inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody>
        <actuator><motor name="m" joint="j" {motor}/></actuator><keyframe><key ctrl="{control}"/></keyframe></mujoco>"""
    )
    return path


CLAMPED = 'ctrllimited="true" ctrlrange="-1 1"'


@pytest.mark.parametrize(
    "where",
    [
        {"motor": CLAMPED},
        {"motor": 'forcelimited="true" forcerange="-1 1"'},
        {"motor": "", "joint": 'actuatorfrclimited="true" actuatorfrcrange="-1 1"'},
    ],
)
def test_motors_that_mujoco_would_clip_are_named(where, tmp_path):
    with pytest.warns(UserWarning, match="limits and delays of motors m"):
        mech = mbdae.load(geared(tmp_path, **where))
    assert [m.name for m in mech.motors] == ["m"]
    free = '<option><flag clampctrl="disable"/></option>'
    assert not mbdae.load(geared(tmp_path, CLAMPED, free)).left_out


@pytest.mark.parametrize(
    ("where", "array"),
    [
        ({"motor": "", "control": "nan"}, "key_ctrl"),
        ({"motor": "", "joint": 'frictionloss="1e200"'}, "dof_frictionloss"),
        ({"motor": "", "joint": 'limited="true" range="0 1e200"'}, "jnt_range"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*warning of MuJoCo")
def test_numbers_that_are_not_finite_or_too_large_are_named(where, array, tmp_path):
    with pytest.raises(InputError, match=f"geared.xml: {array} is not finite, or beyond"):
        mbdae.load(geared(tmp_path, **where))


@pytest.mark.parametrize("option", ['<flag actuation="disable"/>', 'actuatorgroupdisable="2"'])
def test_motors_that_are_switched_off_give_no_torque(option, tmp_path):
    option = f"<option>{option}</option>" if option.startswith("<") else f"<option {option}/>"
    with pytest.warns(UserWarning, match=r"actuators .* m \(not active\)"):
        mech = mbdae.load(geared(tmp_path, 'group="2"', option))
    assert not mech.forces
    assert not mech.motors


def test_armature_and_damping_of_actuators_belong_to_the_joint(tmp_path):
    if not hasattr(mujoco.MjModel, "actuator_armature"):
        pytest.skip("this version of MuJoCo has no armature of actuators")
    path = geared(tmp_path, 'gear="3" armature="0.2" damping="0.5"')
    m = mujoco.MjModel.from_xml_path(str(path))
    d = mujoco.MjData(m)
    d.qvel[:] = 2.0
    mujoco.mj_forward(m, d)
    inertia = np.zeros(1)
    mujoco.mj_mulM(m, d, inertia, np.ones(1))
    model = mbdae.load(path).model
    assert pin.crba(model, model.createData(), np.zeros(1))[0, 0] == pytest.approx(inertia[0], rel=1e-12)
    assert -model.damping[0] * 2.0 == pytest.approx(d.qfrc_passive[0], rel=1e-12)
