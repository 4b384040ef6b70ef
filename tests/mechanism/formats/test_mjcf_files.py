"""MJCF files: start states, inputs, visuals, omissions, and errors."""

import pickle
import shutil
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from mujoco_models import DATA, FILES, compiled, load

import mbdae
from mbdae.errors import AssemblyError, InputError, UnknownNameError
from mbdae.mechanism import describe, restore, to_mujoco

mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
NO_STATES = np.empty(0)


def test_the_first_keyframe_is_the_start_and_others_are_chosen_by_name():
    m, _ = compiled("actuated")
    for key, k in (("", 0), ("home", 0), ("folded", 1)):
        mech = load("actuated", key=key)
        qpos, qvel = to_mujoco(mech.model, *mech.start)
        np.testing.assert_allclose(qpos, m.key_qpos[k], atol=1e-15)
        np.testing.assert_allclose(qvel, m.key_qvel[k], atol=1e-15)
    mech = load("actuated", key="qpos0")
    np.testing.assert_allclose(to_mujoco(mech.model, *mech.start)[0], m.qpos0, atol=1e-15)
    with pytest.raises(UnknownNameError, match=r"unknown keyframe 'hom'.*did you mean 'home'"):
        load("actuated", key="hom")


def test_without_keyframes_the_start_is_qpos0():
    m, _ = compiled("many_joints")
    mech = load("many_joints")
    np.testing.assert_allclose(to_mujoco(mech.model, *mech.start)[0], m.qpos0, atol=1e-15)


def test_motors_are_named_inputs():
    mech = load("actuated")
    inputs = [("lift", "lift", 50.0), ("push", "stroke", 6.0), ("servo", "bend", 10.0)]
    assert [(x.name, x.joint, x.gear) for x in mech.motors] == inputs
    torques = {f.name: f.torque.value * f.gear for f in mech.forces}
    assert torques == {"lift": 25.0, "push": pytest.approx(-0.6), "servo": 0.0}
    driven = load("actuated", motors={"push": lambda t: 2.0 * t}, key="folded")
    system = driven.system()
    q, v = driven.start
    system.inertia(0.0, q)
    push = driven.joint_names.index("stroke")
    difference = np.asarray(system.force(3.0, q, v, NO_STATES)[0]) - np.asarray(system.force(0.0, q, v, NO_STATES)[0])
    assert difference[push] == pytest.approx(36.0)
    with pytest.raises(UnknownNameError, match="unknown motor 'winch'"):
        load("actuated", motors={"winch": 1.0})


def test_what_is_not_carried_over_is_one_warning_by_name():
    with pytest.warns(UserWarning, match="^actuated: not carried over: ") as caught:
        mech = mbdae.load(DATA / "actuated.xml")
    (warning,) = [str(w.message) for w in caught]
    for words in (
        "contact between geoms",
        "limits of joints lift",
        "friction of joints lift",
        "actuators other than motors, positions or velocities of a hinge or slide winch",
        "tendons cable",
        "gravity compensation of bodies fore",
        "forces of a fluid",
    ):
        assert words in warning
        assert words in mech.left_out
    assert "\n" not in warning


def test_nothing_is_left_out_of_plain_files():
    for name in ("trees", "many_joints", "open_four_bar"):
        assert not load(name).left_out
    assert load("loops").left_out == ("equalities idle (not active)",)


def test_geoms_are_visuals():
    mech = load("loops")
    geometry = {g.name: g for g in mech.visuals.geometryObjects}
    assert len(geometry) == 6
    m, d = compiled("loops")
    q = pin.neutral(mech.model)
    d.qpos[:] = to_mujoco(mech.model, q)[0]
    mujoco.mj_forward(m, d)
    places = mech.visuals.createData()
    pin.updateGeometryPlacements(mech.model, mech.model.createData(), mech.visuals, places, q)
    for g in range(m.ngeom):
        np.testing.assert_allclose(places.oMg[g].translation, d.geom_xpos[g], atol=1e-12)
        np.testing.assert_allclose(places.oMg[g].rotation.ravel(), d.geom_xmat[g], atol=1e-12)
    steel = {g.name: g.meshColor.tolist() for g in mech.visuals.geometryObjects}["geom3"]
    assert steel == pytest.approx([0.5, 0.5, 0.6, 1])


def sizes(m, g):
    """The size of a geom as that of a shape in the replay."""
    a, b, h = m.geom_size[g]
    kinds = mujoco.mjtGeom
    return {
        kinds.mjGEOM_SPHERE: ("sphere", (a,)),
        kinds.mjGEOM_CAPSULE: ("capsule", (a, 2 * b)),
        kinds.mjGEOM_CYLINDER: ("cylinder", (a, 2 * b)),
        kinds.mjGEOM_ELLIPSOID: ("ellipsoid", (a, b, h)),
        kinds.mjGEOM_BOX: ("box", (2 * a, 2 * b, 2 * h)),
    }.get(kinds(m.geom_type[g]))


def test_shapes_have_the_sizes_and_colours_of_the_geoms():
    mech, (m, _) = load("trees"), compiled("trees")
    shapes = [s for s in mech.scene.shapes if s.role == "visual"]
    assert m.ngeom == len(mech.visuals.geometryObjects)
    (plane,) = np.flatnonzero(m.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)
    ground = m.geom_pos[plane, 2]
    assert mech.scene.ground == restore(describe(mech)).scene.ground == ground, "the plane is no shape"
    kinds = set()
    for g, shape in zip(np.delete(np.arange(m.ngeom), plane), shapes, strict=True):
        np.testing.assert_allclose(shape.rgba, m.geom_rgba[g], atol=1e-7)
        if sizes(m, g):
            kind, size = sizes(m, g)
            kinds.add(kind)
            assert shape.kind == kind
            np.testing.assert_allclose(shape.size, size, rtol=1e-12)
    assert kinds == {"box", "capsule", "cylinder", "ellipsoid", "sphere"}


@pytest.mark.parametrize("name", FILES)
def test_mechanisms_are_sent_to_other_processes(name):
    mech = load(name)
    assert describe(pickle.loads(pickle.dumps(mech))) == describe(mech)


def test_meshes_are_visuals_and_are_saved(tmp_path):
    path = tmp_path / "wedge.xml"
    path.write_text(
        """<mujoco><asset><mesh name="wedge" vertex="0 0 0  0.2 0 0  0 0.1 0  0 0 0.1"/></asset><worldbody>
        <body><joint name="j" axis="0 1 0"/><geom type="mesh" mesh="wedge" contype="0" conaffinity="0"/>
        <geom type="mesh" mesh="wedge" pos="1 0 0" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""
    )
    m = mujoco.MjModel.from_xml_path(str(path))
    mech = mbdae.load(path)
    description = describe(mech)
    assert len(description["parts"][0]["visuals"]["meshes"]) == 1
    for again in (mech, restore(description)):
        for shape in (s for s in again.scene.shapes if s.role == "visual"):
            np.testing.assert_allclose(shape.mesh.vertices, m.mesh_vert, atol=1e-7)
            np.testing.assert_array_equal(shape.mesh.faces, m.mesh_face)


def test_a_saved_mechanism_comes_back_without_mujoco(monkeypatch):
    for name in FILES:
        mech = load(name)
        description = describe(mech)
        monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
        again = restore(description)
        monkeypatch.undo()
        assert again.model == mech.model
        assert again.motors == mech.motors
        assert again.left_out == mech.left_out
        assert again.start_values == mech.start_values
        assert again.closures == mech.closures
        for a, b in zip(again.scene.shapes, mech.scene.shapes, strict=True):
            assert (a.name, a.role, a.kind, a.size, a.rgba) == (b.name, b.role, b.kind, b.size, b.rgba)


# -- open loops and wrong files --------------------------------------------------------------------------------


def test_what_mujoco_finds_odd_goes_to_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    link = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    joint = '<parent link="a"/><child link="b"/><axis xyz="0 1 0"/><limit lower="1" upper="1" effort="1" velocity="1"/>'
    Path("odd.xml").write_text(
        f'<robot name="r"><link name="a"/><link name="b">{link}</link>'
        f'<joint name="j" type="revolute">{joint}</joint></robot>'
    )
    with warnings.catch_warnings(action="ignore"), ThreadPoolExecutor(8) as threads:  # at a time, as in a sweep
        list(threads.map(lambda _: mbdae.load("odd.xml"), range(100)))
    assert [file.name for file in tmp_path.iterdir()] == ["odd.xml"]


def test_a_missing_mujoco_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(InputError, match=r"reading it needs MuJoCo, pip install 'mbdae\[mjcf\]'"):
        mbdae.load(DATA / "trees.xml")


@pytest.mark.parametrize(
    "text",
    ["", "<mujoco>", "<mujoco><worldbody><body/></worldbody><nonsense/></mujoco>", "not xml", "<robot>", "\0",
     "<mujoco><worldbody><body><joint type='screw'/></body></worldbody></mujoco>", "<mujoco/>"],
)  # fmt: skip
def test_a_wrong_file_is_an_error_of_one_line(text, tmp_path):
    path = tmp_path / "wrong.xml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        mbdae.load(path)
    assert "\n" not in str(caught.value)


def test_sources_of_mjcf_share_a_mechanism(tmp_path):
    for name in ("many_joints.xml", "open_four_bar.xml"):
        shutil.copy(DATA / name, tmp_path)
    (tmp_path / "mechanism.toml").write_text("""
        gravity = [0, 0, -1.62]
        [[source]]
        file = "open_four_bar.xml"
        prefix = "a_"
        [[source]]
        file = "open_four_bar.xml"
        prefix = "b_"
        parent = "a_rocker"
        xyz = [0.0, 1.0, 0.0]
        rpy = [0.0, 0.0, 0.5]
        key = "apart"
    """)
    with pytest.warns(UserWarning, match=r"closure 'b_pin' is violated by 2\.59 m as given"):
        mech = mbdae.load(tmp_path)
    assert mech.joint_names == ["a_crank", "a_coupler", "a_rocker", "b_crank", "b_coupler", "b_rocker"]
    assert [c.name for c in mech.closures] == ["a_pin", "b_pin"]
    assert mech.gravity.tolist() == [0, 0, -1.62]
    q, v = mech.start
    assert np.abs(mech.residual(q, v)[0]).max() < 1e-10


def test_sources_that_disagree_about_gravity_are_rejected(tmp_path):
    body = '<worldbody><body><joint/><geom size="0.1"/></body></worldbody>'
    text = ""
    for name, g in (("a", "0 0 -9.81"), ("b", "0 0 -1.62")):
        (tmp_path / f"{name}.xml").write_text(f'<mujoco><option gravity="{g}"/>{body}</mujoco>')
        text += f'[[source]]\nfile = "{name}.xml"\nprefix = "{name}_"\n'
    path = tmp_path / "mechanism.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"different gravity, \[0.0, 0.0, -9.81\] and \[0.0, 0.0, -1.62\]"):
        mbdae.load(path)
    path.write_text("gravity = [0.0, 0.0, -1.62]\n" + text)
    assert mbdae.load(path).gravity.tolist() == [0, 0, -1.62]


def test_a_loop_that_is_open_at_the_start_is_reported_and_closed_or_rejected():
    path = DATA / "open_four_bar.xml"
    with pytest.warns(UserWarning, match=r"closure 'pin' is violated by 2\.59 m as given: assembly corrects it"):
        mech = mbdae.load(path, key="apart")
    q, _ = mech.start
    assert np.abs(mech.residual(q, np.zeros(3))[0]).max() < 1e-10
    mech = mbdae.load(path, key="apart", assemble=False)
    with pytest.raises(InputError, match=r"the start is not consistent: closure 'pin' is violated by 2\.59 m"):
        _ = mech.start
    with pytest.raises(AssemblyError, match=r"'pin' is violated by 2\.59 m \(fixed: crank, coupler, rocker\)"):
        mech.assemble(q={"crank": 1.2, "coupler": 0.5, "rocker": 1.4})


def test_what_the_option_disables_is_not_there(tmp_path):
    text = (DATA / "many_joints.xml").read_text()
    path = tmp_path / "quiet.xml"
    path.write_text(text.replace('<option gravity="0 0 -9.81"/>', '<option><flag gravity="disable"/></option>'))
    assert mbdae.load(path).gravity.tolist() == [0, 0, 0]
    apart = hasattr(mujoco.mjtDisableBit, "mjDSBL_SPRING")  # MuJoCo 3.3 has one flag for both
    flags = '<flag spring="disable" damper="disable"/>' if apart else '<flag passive="disable"/>'
    path.write_text(text.replace('<option gravity="0 0 -9.81"/>', f"<option>{flags}</option>"))
    mech = mbdae.load(path)
    assert not mech.forces
    assert not mech.model.damping.any()
    text = (DATA / "open_four_bar.xml").read_text()
    path.write_text(text.replace('<option gravity="0 0 -9.81"/>', '<option><flag equality="disable"/></option>'))
    with pytest.warns(UserWarning, match=r"not carried over: equalities pin \(not active\)"):
        assert not mbdae.load(path).closures


def test_a_weld_without_torque_is_a_point(tmp_path):
    path = tmp_path / "loops.xml"
    shutil.copy(DATA / "materials.xml", tmp_path)
    text = (DATA / "loops.xml").read_text()
    path.write_text(text.replace('anchor="0.05 0 0.02"', 'anchor="0.05 0 0.02" torquescale="0"'))
    with pytest.warns(UserWarning) as said:  # noqa: PT030
        mech = mbdae.load(path)
    assert sorted(str(w.message).split()[1] for w in said) == ["closure", "not"]
    assert {c.name: c.kind for c in mech.closures}["glue"] == "point"


def test_nonlinear_springs_are_named(tmp_path):
    if not hasattr(mujoco.MjModel, "jnt_stiffnesspoly"):
        pytest.skip("this version of MuJoCo has no nonlinear springs")
    path = tmp_path / "springy.xml"
    path.write_text(
        """<mujoco><worldbody><body><joint name="j" axis="0 1 0" stiffness="3 2 1" damping="1 2"/>
        <inertial pos="0 0 0.1" mass="1" diaginertia="0.1 0.1 0.1"/></body></worldbody></mujoco>"""
    )
    with pytest.warns(UserWarning, match="nonlinear stiffness of joints j; nonlinear damping of joints j"):
        mbdae.load(path)
