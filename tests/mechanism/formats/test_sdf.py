"""SDF: a four-bar as a graph of links, whose loop is cut and closed, against the same linkage from a mechanism file."""

import warnings

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.errors import InputError
from mbdae.mechanism import describe, restore
from mbdae.mechanism.formats.model_library import ROBOTS

BAR = """<link name="{name}"><pose{to}>{pose}</pose><inertial><pose>{half} 0 0 0 0 0</pose><mass>{mass}</mass>
<inertia><ixx>0.001</ixx><iyy>{I}</iyy><izz>{I}</izz></inertia></inertial>
<visual name="bar"><pose>{half} 0 0 0 0 0</pose><geometry><box><size>{length} 0.02 0.02</size></box></geometry></visual>
</link>"""
HINGE = """<joint name="{0}" type="revolute"><parent>{1}</parent><child>{2}</child><pose>{3} 0 0 0 0 0</pose>
<axis><xyz>0 -1 0</xyz>{4}</axis></joint>"""


def bar(name, pose, length, mass, to=""):
    return BAR.format(name=name, pose=pose, length=length, half=length / 2, mass=mass, I=mass * length**2 / 12, to=to)


LINKS = [
    bar("crank", "0 0 0 0 -90 0", 0.2, 0.5).replace("<pose>0", '<pose degrees="true">0', 1),
    bar("coupler", "0.2 0 0 0 1.5707963267948966 0", 0.5, 1.0, ' relative_to="crank"'),
    bar("rocker", "0.5 0 0 0 -1.5707963267948966 0", 0.2, 0.5),
]
JOINTS = [
    HINGE.format("drive", "world", "crank", 0, "<dynamics><damping>0.1</damping></dynamics>"),
    HINGE.format("elbow", "crank", "coupler", 0, ""),
    HINGE.format("pivot", "world", "rocker", 0, ""),
    HINGE.format("pin", "coupler", "rocker", 0.2, ""),
]
SDF = f'<sdf version="1.9"><model name="linkage">{"".join(LINKS + JOINTS)}</model></sdf>'


@pytest.fixture
def linkage(tmp_path):
    path = tmp_path / "linkage.sdf"
    path.write_text(SDF)
    return path


def test_the_loop_is_cut_and_closed(linkage):
    mech = mbdae.load(linkage)
    assert sorted(mech.joint_names) == ["drive", "elbow", "pivot"]
    assert [(c.name, c.kind) for c in mech.closures] == [("pin", "revolute")]
    assert np.abs(mech.residual(np.zeros(3), np.zeros(3))[0]).max() < 1e-12  # zero is the pose of the file
    assert mech.model.damping[mech.joint_names.index("drive")] == 0.1
    q, _ = mech.assemble(q={"drive": -0.3})
    at = dict(zip(mech.joint_names, q, strict=True))
    assert at["pivot"] == pytest.approx(-0.3, abs=1e-10)  # a parallelogram
    assert at["elbow"] == pytest.approx(0.3, abs=1e-10)
    end = mech.frame(q, "rocker")[1] @ [0.2, 0, 0] + mech.frame(q, "rocker")[0]
    np.testing.assert_allclose(end, [0.5 + 0.2 * np.sin(0.3), 0, 0.2 * np.cos(0.3)], atol=1e-10)


def test_it_moves_like_the_closed_form(linkage):
    """A parallelogram: both arms have one angle, the coupler translates: 0 = I phi'' + ..., one degree of freedom."""
    mech = mbdae.load(linkage)
    q, v = mech.assemble(q={"drive": -0.3})
    system = mech.system()
    drive = mech.joint_names.index("drive")
    a = system.derivative(0.0, mech.point(q, v))[0][mech.nv + drive]
    inertia, weight = 2 * 0.5 * 0.2**2 / 3 + 1.0 * 0.2**2, 9.81 * (2 * 0.5 * 0.1 + 1.0 * 0.2)
    assert a == pytest.approx(-weight * np.sin(0.3) / inertia, rel=1e-9)


def test_unattached_links_are_free_and_static_ones_are_fixed(tmp_path):
    path = tmp_path / "one.sdf"
    text = f'<sdf version="1.9"><model name="one">{{}}{LINKS[2]}</model></sdf>'
    path.write_text(text.format(""))
    mech = mbdae.load(path)
    assert mech.joint_kind("rocker free") == "FreeFlyer"
    np.testing.assert_allclose(mech.frame(mech.start[0], "rocker")[0], [0.5, 0, 0])
    sol = mbdae.solve(mech, (0, 0.1), step=0.01)
    assert sol.q[-1, 0] == pytest.approx(-0.5 * 9.81 * 0.01, rel=1e-9)  # down is x of the link's frame
    path.write_text(text.format("<static>true</static>"))
    with pytest.raises(InputError, match=r"no joint|joints"):
        mbdae.load(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('type="revolute"', 'type="screw"', "joint 'drive' is of kind 'screw'; known: revolute"),
        ("<parent>world</parent>", "<parent>wall</parent>", "joint 'drive' joins 'wall', which is not a link"),
        ("<xyz>0 -1 0</xyz>", "<xyz>0 0 0</xyz>", "the axis of joint 'drive' is zero"),
        ("<mass>0.5</mass>", "<mass>heavy</mass>", "the inertial of 'crank' takes 1 finite numbers"),
        ("<mass>0.5</mass>", "<mass>-0.5</mass>", r"the mass of link 'crank' of linkage.sdf is negative: -0.5 kg"),
        ("<inertia>", "<inertia><iyy>-1</iyy>", "the inertia of link 'crank' of linkage.sdf is not positive semi-def"),
        ("</mass>", "</mass><inertia><ixy>2</ixy></inertia>", "inertia of link 'crank' .* is not positive semi-def"),
        ('relative_to="crank"', 'relative_to="coupler"', "is placed relative to itself"),
        ("<sdf", "<urdf", "is not XML|expected <sdf>"),
        ("<model name", '<model name="two"/><model name', "with one <model>, got <sdf> with 2"),
        ("<joint", "<include/><joint", "<include> within a model is not read"),
    ],
)
def test_faults_are_said_by_name(linkage, old, new, words):
    linkage.write_text(SDF.replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        mbdae.load(linkage)


def loaded(tmp_path, content, head='<sdf version="1.9"><model name="m">', more=""):
    (tmp_path / "x.sdf").write_text(f"{head}{content}</model></sdf>")
    (tmp_path / "x.toml").write_text(f'source = "x.sdf"\n{more}')
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        return mbdae.load(tmp_path / "x.toml"), [str(w.message) for w in said]


def test_forces_in_the_joint_that_closes_the_loop_are_applied(tmp_path):
    """A parallelogram: the pin turns by -phi as the pivot does, so its damper and spring act as if at the driver."""
    dynamics = "<dynamics><damping>0.4</damping><spring_stiffness>3</spring_stiffness></dynamics>"
    motions = []
    for at in (1, 3):  # the elbow of the tree, and the pin that closes the loop: both turn by -phi
        joints = list(JOINTS)
        joints[at] = joints[at].replace("</axis>", f"{dynamics}</axis>")
        mech, said = loaded(tmp_path, "".join(LINKS + joints), more="[start]\nq = { drive = -0.3 }")
        assert not said
        sol = mbdae.solve(mech, (0, 1.0), rtol=1e-10)
        motions.append(sol.q[-1, mech.joint_names.index("drive")])
    assert motions[0] == pytest.approx(motions[1], abs=1e-7)
    plain, _ = loaded(tmp_path, "".join(LINKS + JOINTS), more="[start]\nq = { drive = -0.3 }")
    free = mbdae.solve(plain, (0, 1.0), rtol=1e-10)
    assert abs(free.q[-1, plain.joint_names.index("drive")] - motions[0]) > 0.1
    q, v = mech.assemble(q={"drive": -0.3}, v={"drive": 0.5})
    a = mech.system().derivative(0.0, mech.point(q, v))[0][mech.nv + mech.joint_names.index("drive")]
    inertia, weight = 2 * 0.5 * 0.2**2 / 3 + 1.0 * 0.2**2, 9.81 * (2 * 0.5 * 0.1 + 1.0 * 0.2)
    assert a == pytest.approx((weight * np.sin(-0.3) + 3 * 0.3 - (0.1 + 0.4) * 0.5) / inertia, rel=1e-8)


def test_a_joint_that_closes_a_loop_may_be_followed(tmp_path):
    wheel = '<link name="w"/><joint name="dial" type="revolute"><parent>world</parent><child>w</child><axis><xyz>0 1 0'
    wheel += '</xyz><mimic joint="pin"><multiplier>2</multiplier></mimic></axis></joint>'
    mech, said = loaded(tmp_path, "".join([*LINKS, *JOINTS, wheel]))
    assert not said
    q, _ = mech.assemble(q={"drive": -0.3})
    at = dict(zip(mech.joint_names, q, strict=True))
    assert abs(at["pin"]) == pytest.approx(0.3, abs=1e-10)
    assert at["dial"] == pytest.approx(2 * at["pin"], abs=1e-10)


ARM = """<link name="arm"><inertial><pose>0.5 0 0 0 0 0</pose></inertial>{}</link>
<joint name="hinge" type="{}"><parent>world</parent><child>arm</child><axis><xyz>0 1 0</xyz>{}</axis></joint>"""


def test_limits_are_stops_and_friction_acts_where_that_is_asked_for(tmp_path):
    ends = "<limit><lower>-0.5</lower><upper>0.25</upper><effort>3</effort></limit>"
    ends += "<dynamics><friction>2</friction></dynamics>"
    mech, said = loaded(tmp_path, ARM.format("", "revolute", ends))
    named = ("limits of joints hinge", "limits of effort and velocity of joints hinge", "friction of joints hinge")
    assert mech.left_out == named
    assert said == [f"x: not carried over: {'; '.join(named)}"]
    stops = '[[stop]]\nlimits = true\n[[force]]\nkind = "joint_friction"\nvelocity = 0.5'
    mech, said = loaded(tmp_path, ARM.format("", "revolute", ends), more=stops)
    assert [(s.lower, s.upper) for s in mech.stops] == [(-0.5, 0.25)]
    assert said == [f"x: not carried over: {named[1]}"]
    q, v = np.zeros(1), np.array([0.4])
    assert mech.system().laws.generalized_force(0.0, q, v, q[:0])[0][0] == pytest.approx(-2 * np.tanh(0.8))
    assert not loaded(tmp_path, ARM.format("", "continuous", "<limit><upper>1e16</upper></limit>"))[0].stops


def test_bodies_without_weight_float(tmp_path):
    mech, said = loaded(tmp_path, ARM.format("<gravity>false</gravity>", "revolute", ""))
    assert not said
    assert mbdae.solve(mech, (0, 1.0)).q[-1, 0] == pytest.approx(0, abs=1e-12)
    heavy, _ = loaded(tmp_path, ARM.format("<gravity>true</gravity>", "revolute", ""))
    assert abs(mbdae.solve(heavy, (0, 1.0)).q[-1, 0]) > 0.5


def test_inertia_of_shapes(tmp_path):
    rod = "<pose>0.5 0 0 0 1.5707963267948966 0</pose><density>2000</density>"
    rod += "<geometry><cylinder><radius>0.02</radius><length>1</length></cylinder></geometry>"
    bob = "<pose>1 0 0 0 0 0</pose><geometry><sphere><radius>0.1</radius></sphere></geometry>"
    shapes = f'<inertial auto="true"/><collision name="rod">{rod}</collision><collision name="bob">{bob}</collision>'
    text = ARM.replace("<inertial><pose>0.5 0 0 0 0 0</pose></inertial>", "")
    mech, said = loaded(tmp_path, text.format(shapes, "revolute", ""))
    assert not said
    rod, bob = 2000 * np.pi * 0.02**2, 1000 * 4 / 3 * np.pi * 0.1**3
    expected = rod * (0.02**2 / 4 + 1 / 12 + 0.5**2) + bob * (0.4 * 0.1**2 + 1)
    assert mech.model.inertias[1].mass == pytest.approx(rod + bob, rel=1e-12)
    assert pin.crba(mech.model, mech.model.createData(), np.zeros(1))[0, 0] == pytest.approx(expected, rel=1e-12)
    half, _ = loaded(tmp_path, text.format(shapes.replace("/>", "><mass>1</mass></inertial>", 1), "revolute", ""))
    assert pin.crba(half.model, half.model.createData(), np.zeros(1))[0, 0] == pytest.approx(expected / (rod + bob))
    with pytest.raises(InputError, match="follows from its shapes, and 'arm/bob' is not a solid"):
        loaded(tmp_path, text.format(shapes.replace("sphere", "heightmap"), "revolute", ""))
    with pytest.raises(InputError, match=r"the mass of 'arm/rod' of .* is negative"):
        loaded(tmp_path, text.format(shapes.replace("<length>1<", "<length>-1<"), "revolute", ""))


def test_what_moves_nothing_or_is_not_modelled_is_named(tmp_path):
    inner = """<kinematic>true</kinematic><velocity_decay><linear>0.1</linear></velocity_decay><sensor name="eye"/>
    <collision name="hull"/>"""
    arm = ARM.format(inner, "revolute", "").replace(
        "</inertial>", "<fluid_added_mass><xx>1</xx></fluid_added_mass></inertial>"
    )
    head = '<sdf version="1.9"><world name="w"><physics type="ode"/></world>'
    head += '<model name="m"><plugin name="p" filename="f"/>'
    mech, said = loaded(tmp_path, arm, head)
    named = [
        "kinematic motion of links arm",
        "world/physics of w",
        "link/velocity_decay of arm",
        "link/sensor of arm/eye",
    ]
    named += ["link/collision of arm/hull", "link/inertial/fluid_added_mass of arm", "plugin of p"]
    assert sorted(mech.left_out) == sorted(named)
    assert all(text in said[0] for text in named)


def test_meshes_of_installed_packages_are_found(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        cassie = mbdae.load(f"{ROBOTS}cassie_description/robots/cassie_v2.sdf")
    assert sum(s.kind == "mesh" for s in cassie.scene.shapes) == 23
    again = restore(describe(cassie))
    assert again.model == cassie.model
    assert sum(s.kind == "mesh" for s in again.scene.shapes) == 23
    mesh = '<visual name="v"><geometry><mesh><uri>model://nowhere/hip.stl</uri></mesh></geometry></visual>'
    mech, said = loaded(tmp_path, ARM.format(mesh, "revolute", ""))
    assert "shapes arm/v" in mech.left_out
    assert said[0].startswith("x.sdf: meshes left out, 'model://nowhere/hip.stl' is not found in ")


def test_joints_between_frames_and_axes_that_are_no_pair(tmp_path):
    frames = '<frame name="f" attached_to="arm"><pose>0 0 0 0 0 1.5707963267948966</pose></frame>'
    text = ARM.format("", "revolute", "").replace("<child>arm</child>", "<child>f</child>")
    mech, _ = loaded(tmp_path, frames + text)  # y of the frame is -x of the arm: gravity has no lever arm about it
    assert abs(pin.nle(mech.model, mech.model.createData(), np.zeros(1), np.zeros(1))[0]) < 1e-12
    with pytest.raises(InputError, match="joint 'hinge' joins 'arm' with itself"):
        loaded(tmp_path, frames + ARM.format("", "revolute", "").replace("world", "f"))
    skew = ARM.format("", "universal", "").replace("</joint>", "<axis2><xyz>0 1 1</xyz></axis2></joint>")
    with pytest.raises(InputError, match="the axes of joint 'hinge' are not perpendicular"):
        loaded(tmp_path, skew)
