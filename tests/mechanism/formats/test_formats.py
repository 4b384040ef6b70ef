"""Files of other kinds: URDF with extensions, robot.yaml, several sources."""

import shutil
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.errors import InputError, UnknownNameError
from mbdae.mechanism import describe, restore
from mbdae.mechanism.tree.joints import is_depth_first, subspace

pytestmark = pytest.mark.filterwarnings("ignore:.*not carried over")  # joint limits, which have separate tests

DATA = Path(__file__).parents[2] / "data"
CIRCLE = '[[frame]]\nname = "a"\nparent = "b"\n[[frame]]\nname = "b"\nparent = "a"'
GRIPPER = DATA / "robot_description" / "urdf" / "gripper.urdf"


# -- URDF --------------------------------------------------------------------------------------------------------


def write(folder, text, name="mechanism.toml"):
    (folder / name).write_text(text)
    return folder / name


def test_joint_types_that_a_urdf_cannot_say(tmp_path):
    shutil.copy(DATA / "robot" / "robot.urdf", tmp_path)
    path = write(
        tmp_path,
        """
        source = "robot.urdf"
        joint_type = { left_ball = "spherical", left_universal = "universal", right_universal = "universal_zx" }
        lock = { hatch_hinge = 0.4 }
        [start.guess]
        left_universal = [0.3, -0.2]
        """,
    )
    mech = mbdae.load(path)
    kinds = {n: mech.joint_kind(n) for n in mech.joint_names}
    assert kinds["left_ball"] == "Spherical"
    assert kinds["left_universal"] == kinds["right_universal"] == "Universal"
    assert "hatch_hinge" not in kinds
    j = mech.model.joints[mech.model.getJointId("left_ball")]
    assert np.array(mech.model.damping)[j.idx_v : j.idx_v + 3].tolist() == [0.01] * 3
    # a universal joint turns about x, then about the new y
    data = mech.model.createData()
    pin.forwardKinematics(mech.model, data, mech.start[0])
    turn = data.oMi[mech.model.getJointId("left_universal")].rotation
    x, y = pin.exp3(np.array([0.3, 0, 0])), pin.exp3(np.array([0, -0.2, 0]))
    np.testing.assert_allclose(turn, x @ y, atol=1e-14)
    again = restore(describe(mech))
    assert again.model == mech.model


def test_a_continuous_joint_may_wind_up(tmp_path):
    text = (DATA / "robot" / "robot.urdf").read_text()
    text = text.replace('"motor_left" type="revolute"', '"motor_left" type="continuous"')
    write(tmp_path, text.replace('<axis xyz="0 1 0"/>', '<axis xyz="0.6 0.8 0"/>', 1), "robot.urdf")
    plain = mbdae.load(tmp_path / "robot.urdf")
    assert plain.nq == plain.nv + 1
    mech = mbdae.load(write(tmp_path, 'source = "robot.urdf"\njoint_type = { motor_left = "revolute" }'))
    assert mech.nq == mech.nv
    places = []
    for m, q in ((plain, {"motor_left": 0.7}), (mech, {"motor_left": 0.7})):
        data = m.model.createData()
        pin.forwardKinematics(m.model, data, m.coordinates(q)[0])
        places.append(data.oMi[m.model.getJointId("left_ball")].homogeneous)
    np.testing.assert_allclose(places[0], places[1], atol=1e-14)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('joint_type = { left_ball = "helix" }', "joint_type.left_ball: Input should be 'revolute'"),
        ('joint_type = { left_bal = "spherical" }', "unknown joint 'left_bal' (did you mean 'left_ball'?)"),
        ('lock = { left_bal = 0.0 }', "unknown joint 'left_bal'"),
        ('motor = { crank = 1.0 }', "unknown motor 'crank'; valid: none"),
        ('[[source]]\nfile = "robot.urdf"\nnick = "x"', "unknown key source.0.nick; known: file, free_flyer, key"),
        ('[[clutch]]\njoint = "b"\nengaged = { kind = "steps", x = 1 }', "engaged.x; known: kind, points"),
        ('[[closure]]\nkind = "slot"\nprofile = { kind = "circle", x = 1 }', "x; known: centre, kind, radius"),
        ('[[closure]]\nkind = "slot"\nwithin = { x = 1 }', "within.x; known: joint, period, windows"),
        ('[[source]]\nfile = "robot.obj"', "source 'robot.obj' is not a file"),
        ('[[source]]\nfile = "robot.urdf"\nkey = "home"', "key belongs to an MJCF source"),
        ('[[source]]\nfile = "robot.urdf"\nparent = "b"', "unknown frame 'b'; valid: world"),
        ('[[source]]\nfile = "robot.urdf"\n[[source]]\nfile = "robot.urdf"', "give one source a prefix"),
        (CIRCLE, "frames are attached to each other and not to the world: a, b"),
    ],
)  # fmt: skip
def test_wrong_tables_are_one_line(line, words, tmp_path):
    shutil.copy(DATA / "robot" / "robot.urdf", tmp_path)
    text = line if "[[source]]" in line else f'source = "robot.urdf"\n{line}'
    with pytest.raises(InputError) as caught:
        mbdae.load(write(tmp_path, text))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_several_robots_in_one_mechanism(tmp_path):
    shutil.copytree(DATA / "robot", tmp_path / "legs")
    path = write(
        tmp_path,
        """
        gravity = [0.0, 0.0, -3.7]
        [[source]]
        file = "legs/robot.yaml"
        prefix = "a_"
        [[source]]
        file = "legs/robot.yaml"
        prefix = "b_"
        parent = "shelf"
        rpy = [0.0, 0.0, 1.0]
        [[source]]
        file = "legs/robot.urdf"
        prefix = "c_"
        free_flyer = true
        [[frame]]
        name = "shelf"
        parent = "a_plate"
        xyz = [0.1, 0.2, 0.3]
        """,
    )
    mech = mbdae.load(path)
    one = mbdae.load(tmp_path / "legs")
    assert [n for n in mech.joint_names if n.startswith("a_")] == ["a_" + n for n in one.joint_names]
    assert "c_root_joint" in mech.joint_names
    assert [m.name for m in mech.motors] == ["a_motor_left", "a_motor_right", "b_motor_left", "b_motor_right"]
    assert [c.name for c in mech.closures] == ["a_right_tip-plate_end", "b_right_tip-plate_end"]
    assert is_depth_first(mech.model)
    q, v = mech.start
    assert np.abs(mech.residual(q, v)[0]).max() < 1e-10
    again = restore(describe(mech))
    assert again.model == mech.model
    assert again.closures == mech.closures
    data = mech.model.createData()
    pin.framesForwardKinematics(mech.model, data, q)
    shelf, ground = (data.oMf[mech.model.getFrameId(n)] for n in ("shelf", "b_ground"))
    np.testing.assert_allclose(ground.translation, shelf.translation, atol=1e-14)
    turn = pin.exp3(np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(ground.rotation, shelf.rotation @ turn, atol=1e-14)


def test_meshes_of_packages_are_found_above_the_file(tmp_path):
    mech = mbdae.load(GRIPPER)
    assert [s.kind for s in mech.scene.shapes if s.role == "visual"] == ["mesh"]
    shutil.copytree(GRIPPER.parents[1] / "meshes", tmp_path / "elsewhere" / "robot_description" / "meshes")
    shutil.copy(GRIPPER, tmp_path)
    with pytest.warns(UserWarning, match="visuals left out"):
        assert mbdae.load(tmp_path / "gripper.urdf").visuals is None
    mech = mbdae.load(write(tmp_path, '[[source]]\nfile = "gripper.urdf"\npackages = ["elsewhere"]'))
    assert len(mech.visuals.geometryObjects) == 1


def test_mimic_joints_become_couplings():
    mech = mbdae.load(GRIPPER)
    assert [(c.name, c.coefficients) for c in mech.closures] == [
        ("right follows left", (0.002, 1.5)),
        ("dial follows right", (0.0, 4.0)),
    ]
    q, v = mech.assemble(q={"left": 0.03}, v={"left": 0.1})
    right, dial = (mech.joint_names.index(n) for n in ("right", "dial"))
    assert q[right] == pytest.approx(1.5 * 0.03 + 0.002)
    assert q[dial] == pytest.approx(4 * q[right])
    assert v[right] == pytest.approx(0.15)
    assert v[dial] == pytest.approx(0.6)
    assert mech.nv - mech.ng == 1


def test_what_follows_a_locked_joint_is_locked(tmp_path):
    shutil.copytree(GRIPPER.parents[1], tmp_path / "robot_description")
    source = 'source = "robot_description/urdf/gripper.urdf"\nlock = { %s }\n'
    source += '[[body]]\nname = "x"\nparent = "palm"\nmass = 1.0'
    mech = mbdae.load(write(tmp_path, source % "left = 0.02"))
    assert mech.joint_names == ["x"]
    data = mech.model.createData()
    pin.framesForwardKinematics(mech.model, data, np.zeros(1))
    right = data.oMf[mech.model.getFrameId("right", pin.FrameType.BODY)]
    np.testing.assert_allclose(right.translation, [0, -0.01 - 0.032, 0.1], atol=1e-15)
    both = mbdae.load(write(tmp_path, source % "left = 0.02, right = 0.01"))
    assert both.joint_names == ["x"]
    with pytest.raises(InputError, match="joint 'right' follows 'left' and cannot be locked alone: lock 'left'"):
        mbdae.load(write(tmp_path, source % "right = 0.01"))


def test_a_joint_that_follows_nothing_is_left_out_by_name(tmp_path):
    write(tmp_path, GRIPPER.read_text().replace('<mimic joint="left"', '<mimic joint="lost"'), "gripper.urdf")
    shutil.copytree(GRIPPER.parents[1], tmp_path / "robot_description")
    with pytest.warns(UserWarning, match="not carried over: .*; mimic constraints without a moving leader on right"):
        mech = mbdae.load(tmp_path / "gripper.urdf")
    assert [c.name for c in mech.closures] == ["dial follows right"]


def test_what_robot_yaml_fixes_is_followed(tmp_path):
    shutil.copytree(GRIPPER.parents[1], tmp_path / "robot_description")
    text = GRIPPER.read_text().replace("</robot>", "")
    text += """<link name="lid"><inertial><mass value="1"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="lid" type="revolute"><parent link="palm"/><child link="lid"/><axis xyz="1 0 0"/>
        <limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    write(tmp_path, text, "robot.urdf")
    mech = mbdae.load(write(tmp_path, "joint_name: [left]\njoint_type: [FIXED]", "robot.yaml"))
    assert mech.joint_names == ["lid"]
    assert restore(describe(mech), [tmp_path]).model == mech.model
    with pytest.raises(InputError, match="joint 'dial' follows 'right' and cannot be locked alone"):
        mbdae.load(write(tmp_path, "joint_name: [dial]\njoint_type: [FIXED]", "robot.yaml"))


# -- robot.yaml --------------------------------------------------------------------------------------------------


def test_a_folder_of_the_parallel_robots(tmp_path):
    mech = mbdae.load(DATA / "robot")
    kinds = {n: mech.joint_kind(n) for n in mech.joint_names}
    assert kinds == {
        "motor_left": "RY",
        "left_universal": "Universal",
        "left_ball": "Spherical",
        "motor_right": "RY",
        "right_universal": "Universal",
    }
    assert [m.joint for m in mech.motors] == ["motor_left", "motor_right"]
    assert [(c.kind, c.frames) for c in mech.closures] == [("point", ("right_tip", "plate_end"))]
    assert mbdae.load(DATA / "robot" / "robot.yaml").model == mech.model
    driven = mbdae.load(DATA / "robot", motors={"motor_left": 2.0})
    system = driven.system()
    q, v = driven.start
    forces = []
    for m in (mech, driven):
        system = m.system()
        system.inertia(0.0, q)
        forces.append(np.asarray(system.force(0.0, q, v, np.empty(0))[0]))
    np.testing.assert_allclose(forces[1] - forces[0], 2.0 * np.eye(mech.nv)[0], atol=1e-12)
    assert restore(describe(driven)).model == driven.model


@pytest.mark.parametrize(
    ("kind", "axes"),
    [("UJOINT_XY", "xy"), ("CARDAN", "xy"), ("UJOINT_YX", "yx"), ("UJOINT_XZ", "xz"), ("UJOINT_ZY", "zy")],
)
def test_universal_joints_turn_about_the_axes_of_their_name(kind, axes, tmp_path):
    shutil.copy(DATA / "robot" / "robot.urdf", tmp_path)
    tables = f"joint_name: [left_ball]\njoint_type: [{kind}]\nname_mot: left_ball"
    with pytest.warns(UserWarning, match=r"motors of joints of several coordinates left_ball"):
        mech = mbdae.load(write(tmp_path, tables, "robot.yaml"))
    expected = np.zeros((6, 2))
    for column, axis in enumerate(axes):
        expected[3 + "xyz".index(axis), column] = 1.0
    np.testing.assert_allclose(subspace(mech.model.joints[mech.model.getJointId("left_ball")]), expected, atol=1e-15)


def test_older_tables_of_parallel_robots(tmp_path):
    shutil.copy(DATA / "robot" / "robot.urdf", tmp_path)
    tables = "name_mot: motor\nclosed_loop: [[right_tip, plate_end]]\nrotule_name: ball\nLidmot: [0, 1]"
    write(tmp_path, tables, "robot.yaml")
    with pytest.warns(UserWarning, match=r"not carried over: .*; keys of robot.yaml Lidmot, rotule_name"):
        mech = mbdae.load(tmp_path)
    assert [c.kind for c in mech.closures] == ["frame"]
    assert [m.joint for m in mech.motors] == ["motor_left", "motor_right"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("closed_loop: [[a, b]]\ntype: [6d, 3d]", "closed_loop has 1 entries, type has 2"),
        ("closed_loop: [[a, b]]\ntype: [5d]", "type '5d'; known: 6d, 3d"),
        ("closed_loop: [[right_tip, b]]", "unknown frame 'b'"),
        ("closed_loop: [[right_tip, right_tip]]", "with itself"),
        ("joint_name: [left_ball]\njoint_type: [SCREW]", "joint_type 'SCREW'; known: SPHERICAL, CARDAN, UJOINT_XY"),
        ("joint_name: [left_ball]", "joint_name has 1 entries, joint_type has 0"),
        ("joint_name: [bal]\njoint_type: [SPHERICAL]", "unknown joint 'bal'"),
        ("name_mot: [mot]", "unknown joint 'mot'"),
        ("name_mot: mot_x", "name_mot 'mot_x' occurs in no joint's name: "),
        ("joint_name: [a, a]\njoint_type: [SPHERICAL, SPHERICAL]", "joint_name has a more than once"),
        ("closed_loop: 3", "closed_loop: "),
        ("name_mot: [1]", "robot.yaml: name_mot.0: Input should be a valid string, got '1'"),
        ("- a\n- b", "is not a table of keys"),
        ("{", "is not YAML"),
        ("", "is not a table of keys"),
        ("closed_loop: &a [*a]", "it has inf entries with its aliases expanded"),
        ("name_mot: motor\nname_mot: []", "the key 'name_mot' occurs more than once"),
    ],
)
def test_wrong_robot_yaml_is_one_line(text, words, tmp_path):
    shutil.copy(DATA / "robot" / "robot.urdf", tmp_path)
    write(tmp_path, text, "robot.yaml")
    with pytest.raises(InputError) as caught:
        mbdae.load(tmp_path)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_unknown_names_list_what_is_read(tmp_path):
    files = r"\.toml, \.py, .*\.mjcf, .*\.sdf, .*\.urdf, .*\.xml or .*\.yaml"
    with pytest.raises(UnknownNameError, match=f"a path to a {files} file or their folder"):
        mbdae.load("four_barr")
    with pytest.raises(InputError, match=r"cannot read robot\.obj"):
        mbdae.load(write(tmp_path, "", "robot.obj"))
