"""The tables list what Pinocchio reads of a URDF, and what MuJoCo compiles into converted contents."""

import re
import warnings

import numpy as np
import pinocchio as pin
import pytest

import mbdae
from mbdae.mechanism.formats.mjcf.unread_contents import READ
from mbdae.mechanism.formats.urdf.read import READ_OF_JOINT, SHAPES

# -- URDF --------------------------------------------------------------------------------------------------------------

URDF = """<robot name="r" version="1.1"><material name="m"><color rgba="0.1 0.2 0.3 1"/></material><link name="a"/>
<link name="b"><inertial><origin xyz="1 2 3" rpy="0.1 0.2 0.3"/><mass value="2"/>
<inertia ixx="1.1" ixy="0.1" ixz="0.2" iyy="1.2" iyz="0.05" izz="1.3"/></inertial>
<visual name="v"><origin xyz="4 5 6" rpy="0.4 0.5 0.6"/><geometry>{shape}</geometry><material name="m"/></visual></link>
<joint name="j" type="{kind}"><origin xyz="7 8 9" rpy="0.7 0.8 0.9"/><parent link="a"/><child link="b"/>
<axis xyz="0.6 0 0.8"/>{more}</joint></robot>"""
MORE = '<limit lower="-1.5" upper="2.5" effort="3.5" velocity="4.5"/><dynamics damping="5.5" friction="6.5"/>'
BOX = '<box size="0.15 0.25 0.35"/>'
SOLIDS = {"box": BOX, "cylinder": '<cylinder radius="0.15" length="0.25"/>', "sphere": '<sphere radius="0.15"/>',
          "capsule": '<capsule radius="0.15" length="0.25"/>'}  # fmt: skip


def numbers(text, folder):
    """All data read from a URDF, as numbers."""
    (folder / "x.urdf").write_text(text)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        mech = mbdae.load(folder / "x.urdf")
    m, g = mech.model, mech.visuals.geometryObjects[0]
    per_joint = ("damping", "upperDryFrictionLimit", "upperEffortLimit", "upperVelocityLimit")
    arrays = [np.array(getattr(m, key)) for key in (*per_joint, "lowerPositionLimit", "upperPositionLimit")]
    size = g.geometry.computeLocalAABB() or [g.geometry.aabb_local.max_]
    data = m.createData()
    pin.forwardKinematics(m, data, mech.start[0])
    moves = pin.computeJointJacobians(m, data, mech.start[0])
    places = [m.jointPlacements[1].homogeneous, g.placement.homogeneous, m.inertias[1].matrix(), moves]
    return np.concatenate([np.ravel(x) for x in (*arrays, *size, *places, g.meshColor)]), mech


@pytest.mark.parametrize("kind", [k for k in READ_OF_JOINT if k != "fixed"])
def test_every_number_of_a_urdf_that_counts_as_read_is_read(kind, tmp_path):
    """Each number, changed, changes the mechanism; or it is named."""
    text = URDF.format(shape=BOX, kind=kind, more=MORE)
    before, mech = numbers(text, tmp_path)
    named = " ".join(mech.left_out)
    body = text.index("<material")
    for found in re.finditer(r'(\w+)="[^"a-z]*?(\d\.\d+|\d)(?=[ "])', text[body:]):
        key, at = found[1], body + found.start(2)
        other = f"{text[:at]}{float(found[2]) + 0.01}{text[body + found.end(2) :]}"
        after, _ = numbers(other, tmp_path)
        changed = after.shape != before.shape or not np.array_equal(after, before)
        tag = text[: body + found.start()].rpartition("<")[2].split()[0]
        assert (
            changed or f"{tag}/@{key} of" in named or f"joint/{tag} of" in named or (kind, tag) == ("floating", "axis")
        )


@pytest.mark.parametrize("solid", sorted(SHAPES.keys() - {"mesh"}))
def test_sizes_of_solids_are_read(solid, tmp_path):
    text = URDF.format(shape=SOLIDS[solid], kind="continuous", more="")
    before, mech = numbers(text, tmp_path)
    assert not mech.left_out
    for key in SHAPES[solid].split():
        other = re.sub(rf'{key}="0\.15|{key}="0\.25', f'{key}="0.45', text)
        assert other != text
        assert not np.array_equal(numbers(other, tmp_path)[0], before)


# -- MJCF --------------------------------------------------------------------------------------------------------------

MJCF = """<mujoco><compiler autolimits="true"/><option{option}/>{top}<default><geom{default}/></default><worldbody>
<body name="a" pos="0 0 1"{body}><joint name="j"{joint}/><geom name="g" size="0.1"{geom}/>{inside}<site name="s"{site}/>
</body></worldbody><actuator><motor name="u" joint="j"{motor}/></actuator>{tail}</mujoco>"""
SPOTS = re.findall(r"\{(\w+)\}", MJCF)
PLANTS = [  # location, change, and the end of its path
    ("option", ' timestep="0.001"', "option/@timestep"),
    ("option", ' integrator="implicit"', "option/@integrator"),
    ("option", ' wind="1 0 0"', "option/@wind"),
    ("top", '<visual><global fovy="30"/></visual>', "visual"),
    ("top", '<statistic extent="2"/>', "statistic"),
    ("top", '<size memory="2M"/>', "size"),
    ("top", '<custom><numeric name="n" data="1"/></custom>', "custom"),
    ("top", '<asset><texture name="t" type="2d" builtin="flat" width="8" height="8"/></asset>', "asset/texture"),
    ("top", '<asset><material name="m" specular="0.3"/></asset>', "asset/material/@specular"),
    ("default", ' friction="0.5 0.1 0.1"', "default/geom/@friction"),
    ("body", ' user="1"', "worldbody/body/@user"),
    ("joint", ' margin="0.1"', "worldbody/body/joint/@margin"),
    ("joint", ' group="2"', "worldbody/body/joint/@group"),
    ("joint", ' solreflimit="0.01 1"', "worldbody/body/joint/@solreflimit"),
    ("geom", ' condim="4"', "worldbody/body/geom/@condim"),
    ("geom", ' solref="0.01 1"', "worldbody/body/geom/@solref"),
    ("geom", ' fluidshape="ellipsoid"', "worldbody/body/geom/@fluidshape"),
    ("site", ' rgba="1 0 0 1"', "worldbody/body/site/@rgba"),
    ("inside", '<camera name="eye"/>', "worldbody/body/camera"),
    ("inside", '<light name="sun"/>', "worldbody/body/light"),
    ("motor", ' user="1"', "actuator/motor/@user"),
    ("motor", ' lengthrange="0 1"', "actuator/motor/@lengthrange"),
    ("tail", '<sensor><jointpos joint="j"/></sensor>', "sensor"),
    ("tail", '<contact><exclude body1="world" body2="a"/></contact>', "contact"),
    ("tail", '<keyframe><key name="k" time="3"/></keyframe>', "keyframe/key/@time"),
]


@pytest.mark.parametrize("seed", range(12))
def test_elements_and_attributes_of_mjcf_files_are_named(seed, tmp_path):
    pytest.importorskip("mujoco", reason="mujoco is not installed")
    rng = np.random.default_rng(seed)
    chosen = [PLANTS[i] for i in rng.permutation(len(PLANTS))[:8]]
    content = MJCF.format_map({spot: "".join(x for where, x, _ in chosen if where == spot) for spot in SPOTS})
    if seed % 2:  # another file is included
        tail = re.search(r"<actuator>.*(?=</mujoco>)", content, re.DOTALL)[0]
        (tmp_path / "rest.xml").write_text(f"<mujoco>{tail}</mujoco>")
        content = content.replace(tail, '<include file="rest.xml"/>')
    (tmp_path / "x.xml").write_text(content)
    with pytest.warns(UserWarning, match="x: not carried over: ") as said:
        mech = mbdae.load(tmp_path / "x.xml")
    assert {text.partition(" of ")[0] for text in mech.left_out} == {path for _, _, path in chosen}
    assert all(path in str(said[0].message) for _, _, path in chosen)


def test_the_attributes_of_the_table_are_those_of_mujoco():
    """MuJoCo's schema has each element and each attribute that counts as read."""
    mujoco = pytest.importorskip("mujoco", reason="mujoco is not installed")
    known, tag = {}, ""
    for line in mujoco.mj_printSchema(False, False).splitlines():
        head = re.match(r" *(\(world\))?(\w+) \((.)\)", line)
        tag = head[2] if head else tag
        known.setdefault(tag, set()).update((line[head.end() :] if head else line).split())
    known["flag"].add("passive")  # of MuJoCo 3.3
    extra = {"frame": known["body"], "replicate": set(), "composite": set(), "worldbody": set()}  # not in the schema
    for key, attributes in READ.items():
        element = key.rpartition("/")[2]
        assert element in known.keys() | extra or element == "flexvert"
        if "*" not in attributes:
            assert set(attributes.split()) <= known.get(element, extra.get(element)), key
