"""Visuals have the poses of Pinocchio, and the appearance of their file."""

import coal
import numpy as np
import pinocchio as pin
import pytest
import scenes

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism.scene.make_scene import make_scene
from mbdae.mechanism.scene.meshes import Mesh
from mbdae.mechanism.scene.scene import Mark, Strut
from mbdae.mechanism.scene.surfaces import surfaces


def is_rotation(quaternion):
    return np.isclose(np.linalg.norm(quaternion), 1)


@pytest.fixture(scope="module")
def panda():
    return mbdae.load("panda_handle")


@pytest.fixture
def fourbar():
    return scenes.fourbar()


def test_visuals_are_where_pinocchio_puts_them(panda):
    pin.seed(0)
    many = np.array([pin.randomConfiguration(panda.model, -np.ones(panda.nq), np.ones(panda.nq)) for _ in "abc"])
    data, geometry = panda.model.createData(), panda.visuals.createData()
    together = panda.scene.placements(many)
    assert together.shape == (3, len(panda.scene.shapes), 7)
    for q, placements in zip(many, together, strict=True):
        pin.updateGeometryPlacements(panda.model, data, panda.visuals, geometry, q)
        np.testing.assert_array_equal(panda.scene.placements(q), placements)
        for k, expected in enumerate(geometry.oMg):
            assert pin.XYZQUATToSE3(placements[k]).isApprox(expected, 1e-12)
        assert all(is_rotation(p[3:]) for p in placements)


def test_marks_sit_on_the_anchors(fourbar):
    names = [s.name for s in fourbar.scene.shapes]
    first, second = (names.index(f"loop {k}") for k in "ab")
    closed = fourbar.scene.placements(fourbar.q(0.7))
    np.testing.assert_allclose(closed[first, :3], closed[second, :3], atol=1e-12)
    opened = fourbar.scene.placements(fourbar.q(0.7) + [0, 0, 0.1])
    np.testing.assert_allclose(opened[first], closed[first])
    gap = np.linalg.norm(opened[first, :3] - opened[second, :3])
    assert gap == pytest.approx(2 * 1.5 * np.sin(0.05))


def test_generated_bodies_reach_from_joint_to_joint(fourbar):
    shapes = {s.name: s for s in fourbar.scene.shapes}
    length = {n: shapes[f"{n} link"].size[1] for n in ("crank", "coupler", "rocker")}
    assert length == pytest.approx({"crank": 1.0, "coupler": 2.0, "rocker": 1.5})
    for name in length:
        assert (shapes[name].role, shapes[name].kind) == ("joint", "cylinder")
    placements = dict(zip(shapes, fourbar.scene.placements(fourbar.q(0.3)), strict=True))
    axis = pin.XYZQUATToSE3(placements["rocker"]).rotation[:, 2]
    np.testing.assert_allclose(np.abs(axis), [0, 1, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("joint", "kinds"),
    [
        (pin.JointModelPX(), {"box", "cylinder", "sphere"}),  # slider, rail, mass
        (pin.JointModelSpherical(), {"sphere", "capsule", "box"}),
        (pin.JointModelFreeFlyer(), {"capsule", "sphere"}),
        (pin.JointModelTranslation(), {"sphere", "capsule"}),
    ],
)
def test_every_joint_has_a_figure(joint, kinds):
    model = pin.Model()
    j = model.addJoint(0, joint, pin.SE3.Identity(), "j")
    model.appendBodyToJoint(j, pin.Inertia(1.0, np.array([0, 0, -1.0]), np.eye(3)), pin.SE3.Identity())
    shapes = make_scene(model).shapes
    assert kinds <= {s.kind for s in shapes} | {"capsule"}
    assert len({s.name for s in shapes}) == len(shapes)


def test_a_body_around_its_joint_is_a_box_of_its_inertia():
    model = pin.Model()
    j = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "brick")
    model.appendBodyToJoint(j, pin.Inertia.FromBox(2.0, 0.3, 0.2, 0.1), pin.SE3.Identity())
    (brick,) = make_scene(model).shapes
    assert sorted(brick.size) == pytest.approx([0.1, 0.2, 0.3])


@pytest.mark.parametrize("axis", np.eye(3))
def test_a_wheel_on_its_axle_is_a_disc_of_its_inertia(axis):
    turn = pin.Quaternion.FromTwoVectors(pin.ZAxis, axis).matrix()
    wheel = pin.Inertia(3.0, np.zeros(3), turn @ pin.Inertia.FromCylinder(3.0, 0.4, 0.1).inertia @ turn.T)
    model, identity = pin.Model(), pin.SE3.Identity()
    for name, about in (("wheel", axis), ("lever", np.roll(axis, 1))):  # about its axis, and across it
        joint = model.addJoint(0, pin.JointModelRevoluteUnaligned(about), identity, name)
        model.appendBodyToJoint(joint, wheel, identity)
    scene = make_scene(model)
    shapes = {s.name: k for k, s in enumerate(scene.shapes)}
    assert scene.shapes[shapes["wheel body"]].size == pytest.approx((0.4, 0.1))
    place = pin.XYZQUATToSE3(scene.placements(np.zeros(2))[shapes["wheel body"]])
    np.testing.assert_allclose(np.abs(place.rotation[:, 2]), axis, atol=1e-12)
    assert "wheel spoke" in shapes
    assert "lever spoke" not in shapes


def test_a_rod_keeps_its_length_between_its_anchors():
    model, identity = pin.Model(), pin.SE3.Identity()
    model.addJoint(0, pin.JointModelTranslation(), identity, "ball")
    scene = make_scene(model, None, [Mark("string", (0, identity), (1, identity), rod=2.0)])
    k = [s.name for s in scene.shapes].index("string rod")
    assert scene.shapes[k].size[1] == 2.0
    place = pin.XYZQUATToSE3(scene.placements(np.array([0.0, 1.2, -1.6]))[k])
    np.testing.assert_allclose(place.translation, [0, 0.6, -0.8])
    np.testing.assert_allclose(place.rotation[:, 2], [0, 0.6, -0.8], atol=1e-12)
    assert is_rotation(scene.placements(np.zeros(3))[k, 3:])


def test_a_spring_goes_from_point_to_point():
    model, identity = pin.Model(), pin.SE3.Identity()
    model.addJoint(0, pin.JointModelTranslation(), identity, "ball")
    scene = make_scene(model, springs=[Strut("coil", (0, identity), (1, identity), length=2.0)])
    ends = scene.end_points(scene.springs, np.array([[0.0, 1.2, -1.6], [0.0, 12.0, 0.0]]))
    np.testing.assert_allclose(ends[:, 0], [[[0, 0, 0], [0, 1.2, -1.6]], [[0, 0, 0], [0, 12, 0]]])
    shapes = {s.name: (s.coil, s.tube) for name in ("andrews_squeezer", "flyball_governor") for s in
             mbdae.load(name).scene.springs}  # fmt: skip
    assert set(shapes.values()) == {(True, False), (True, True)}, "the governor's are damped"
    assert not mbdae.load("slider_crank").scene.springs


def test_a_driven_distance_is_a_cylinder_between_its_frames():
    plain = mbdae.load("four_bar")
    cylinder = mbdae.Driver.polynomial(("ground", "coupler_tip"), [2.0, 0.1], name="lift")
    mech = mbdae.Mechanism(plain.model, plain.closures, drivers=[cylinder])
    (strut,) = mech.scene.springs
    assert (strut.name, strut.coil, strut.tube) == ("lift", False, True)
    q = plain.start[0]
    begin, end = mech.scene.end_points([strut], q[None])[0, 0]
    np.testing.assert_allclose(begin, 0)
    np.testing.assert_allclose(end @ end, 1 + 4 + 4 * np.cos(q[1]), err_msg="bars of 1 and 2 m")


def test_an_unlimited_slide_on_a_body_has_a_rail_as_long_as_the_body():
    scene = mbdae.load("flyball_governor").scene
    (rail,) = [s for s in scene.shapes if s.name == "slider rail"]
    assert rail.size[1] == pytest.approx(1.0)
    (rail,) = [s for s in mbdae.load("stewart_platform").scene.shapes if s.name == "piston_1 rail"]
    assert rail.size[1] == pytest.approx(0.5)


def test_a_rail_reaches_as_far_as_what_slides_on_it():
    mech = mbdae.load("cart_pole")
    q = np.repeat(mech.start[0][None], 3, axis=0)
    q[:, 0] = 0.2, 1.3, 0.7
    scene = mech.scene.for_motion(q)
    k = [s.name for s in scene.shapes].index("cart rail")
    assert scene.shapes[k].size[1] == pytest.approx(1.1 + 14 * scene.width)
    place = scene.placements(q[0])[k]
    np.testing.assert_allclose(place[:3], [0.75, 0, 0], atol=1e-12)
    assert np.ptp(scene.shapes[k].bounds[:, 2]) == pytest.approx(scene.shapes[k].size[1], rel=1e-3)


def test_a_loop_that_closes_ends_in_a_pin(fourbar):
    shapes = {s.name: s for s in fourbar.scene.shapes}
    assert shapes["loop pin"].role == "joint"
    hinge = Mark("hinge", (2, pin.SE3.Identity()), (3, pin.SE3.Identity()), axis=np.array([1.0, 0, 0]))
    scene = make_scene(fourbar.model, None, [hinge])
    k = [s.name for s in scene.shapes].index("hinge pin")
    assert (shapes["loop pin"].kind, scene.shapes[k].kind) == ("sphere", "cylinder")
    axis = pin.XYZQUATToSE3(scene.placements(np.zeros(3))[k]).rotation[:, 2]
    np.testing.assert_allclose(np.abs(axis), [1, 0, 0], atol=1e-12)


def test_bodies_without_visuals_join_those_that_have_them(panda):
    roles = [s.role for s in panda.scene.shapes]
    assert {"visual", "link", "joint", "closure"} <= set(roles)
    assert roles.count("visual") == len(panda.visuals.geometryObjects)


def test_wrong_length_of_q_is_rejected(fourbar):
    with pytest.raises(InputError, match=r"\(3,\)"):
        fourbar.scene.placements(np.zeros(4))


def test_a_mesh_has_the_scale_and_the_colours_that_pinocchio_gives_it(tmp_path):
    (shape,) = scenes.flag(tmp_path).shapes
    assert shape.scale == (0.1, 0.1, -0.1)
    np.testing.assert_allclose(shape.bounds, [[0, 0, -0.1], [0.3, 0, 0]], atol=1e-6)
    assert shape.rgba is None, "the file's own colours"


def test_bodies_share_a_mesh(panda):
    fingers = [s.mesh for s in panda.scene.shapes if "finger" in s.name and s.role == "visual"]
    assert len(fingers) == 2
    assert fingers[0] is fingers[1]


def test_missing_texture_is_warned_of(tmp_path):
    path = scenes.collada(tmp_path / "flag.dae")
    path.write_text(path.read_text().replace("</asset>", "</asset><init_from>paint.png</init_from>"))
    visuals = pin.GeometryModel()
    triangles = coal.MeshLoader().load(str(path), np.ones(3))
    g = pin.GeometryObject("flag", 0, pin.SE3.Identity(), triangles, str(path), np.ones(3))
    visuals.addGeometryObject(g)
    with pytest.warns(UserWarning, match=r"flag.*paint\.png"):
        make_scene(pin.Model(), visuals)


def test_missing_mesh_is_rejected_by_name(tmp_path):
    visuals = pin.GeometryModel()
    g = pin.GeometryObject("lost", 0, pin.SE3.Identity(), coal.BVHModelOBBRSS(), str(tmp_path / "lost.stl"))
    visuals.addGeometryObject(g)
    with pytest.raises(InputError, match=r"lost.*lost\.stl"):
        make_scene(pin.Model(), visuals)


def test_a_level_plane_is_the_ground_and_no_shape():
    visuals = pin.GeometryModel()
    assert make_scene(pin.Model(), visuals).ground is None
    for z in (-2.0, -1.0):
        place = pin.SE3(pin.utils.rotate("z", 0.3), np.array([5.0, 0.0, z]))
        plane = coal.Halfspace(np.array([0, 0, 1.0]), 0.5)
        visuals.addGeometryObject(pin.GeometryObject(f"floor {z}", 0, place, plane))
    scene = make_scene(pin.Model(), visuals)
    assert (scene.ground, scene.shapes) == (-0.5, ())


def test_unknown_geometry_is_named():
    visuals = pin.GeometryModel()
    plane = coal.Halfspace(np.array([0, 1.0, 0]), 0.0)
    visuals.addGeometryObject(pin.GeometryObject("floor", 0, pin.SE3.Identity(), plane))
    with pytest.raises(InputError, match=r"floor.*Halfspace.*capsule"):
        make_scene(pin.Model(), visuals)


def test_a_mesh_with_an_index_beyond_all_integers_is_damaged(tmp_path):
    text = scenes.collada(tmp_path / "squares.dae").read_text()
    assert surfaces(Mesh("dae", text.encode()))
    assert surfaces(Mesh("dae", text.replace("<p>0", f"<p>{10**30}").encode())) is None


FLAG = """<sdf version="1.9"><model name="m"><link name="a"><inertial><mass>1</mass></inertial><visual name="v">
<geometry><mesh><uri>flag.dae</uri></mesh></geometry>{}</visual></link>
<joint name="j" type="prismatic"><parent>world</parent><child>a</child><axis><xyz>1 0 0</xyz></axis></joint>
</model></sdf>"""


@pytest.mark.parametrize(
    ("material", "rgba"),
    [("", None), ("<material><diffuse>0.1 0.2 0.3 1</diffuse></material>", (0.1, 0.2, 0.3, 1.0))],
)
def test_a_material_of_sdf_replaces_the_colours_of_a_mesh(material, rgba, tmp_path):
    scenes.collada(tmp_path / "flag.dae")
    (tmp_path / "m.sdf").write_text(FLAG.format(material))
    mbdae.solve(mbdae.load(tmp_path / "m.sdf"), (0, 0.01)).save(tmp_path / "run.npz")
    for mech in (mbdae.load(tmp_path / "m.sdf"), mbdae.Solution.load(tmp_path / "run.npz").mechanism):
        (shape,) = [s for s in mech.scene.shapes if s.role == "visual"]
        assert shape.rgba == rgba
