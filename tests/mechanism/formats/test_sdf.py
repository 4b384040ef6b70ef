"""SDF: a four-bar as a graph of links, whose loop is cut and closed, against the same linkage from a mechanism file."""

import numpy as np
import pytest

import mbdae
from mbdae.errors import InputError

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
    """A parallelogram of bars: both arms turn alike, the coupler only goes along: 0 = I phi'' + ... of one freedom."""
    mech = mbdae.load(linkage)
    q, v = mech.assemble(q={"drive": -0.3})
    system = mech.system()
    drive = mech.joint_names.index("drive")
    a = system.derivative(0.0, mech.point(q, v))[0][mech.nv + drive]
    inertia, weight = 2 * 0.5 * 0.2**2 / 3 + 1.0 * 0.2**2, 9.81 * (2 * 0.5 * 0.1 + 1.0 * 0.2)
    assert a == pytest.approx(-weight * np.sin(0.3) / inertia, rel=1e-9)


def test_links_that_nothing_carries_fly_and_static_ones_stand(tmp_path):
    path = tmp_path / "one.sdf"
    text = f'<sdf version="1.9"><model name="one">{{}}{LINKS[2]}</model></sdf>'
    path.write_text(text.format(""))
    mech = mbdae.load(path)
    assert mech.joint_kind("rocker free") == "FreeFlyer"
    np.testing.assert_allclose(mech.frame(mech.start[0], "rocker")[0], [0.5, 0, 0])
    sol = mbdae.solve(mech, (0, 0.1), step=0.01)
    assert sol.q[-1, 0] == pytest.approx(-0.5 * 9.81 * 0.01, rel=1e-9)  # down is x of the link's own place
    path.write_text(text.format("<static>true</static>"))
    with pytest.raises(InputError, match=r"no joint|joints"):
        mbdae.load(path)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('type="revolute"', 'type="screw"', "joint 'drive' is of kind 'screw'; known: revolute"),
        ("<parent>world</parent>", "<parent>wall</parent>", "joint 'drive' joins 'wall', which is no link"),
        ("<xyz>0 -1 0</xyz>", "<xyz>0 0 0</xyz>", "the axis of joint 'drive' is no direction"),
        ("<mass>0.5</mass>", "<mass>heavy</mass>", "the inertial of 'crank' takes 1 finite numbers"),
        ('relative_to="crank"', 'relative_to="coupler"', "placed relative to itself"),
        ("<sdf", "<urdf", "is not XML|expected <sdf>"),
        ("<model name", '<model name="two"/><model name', "with one <model>, got <sdf> with 2"),
        ("<joint", "<include/><joint", "<include> within a model is not read"),
    ],
)
def test_faults_are_said_by_name(linkage, old, new, words):
    linkage.write_text(SDF.replace(old, new, 1))
    with pytest.raises(InputError, match=words):
        mbdae.load(linkage)
