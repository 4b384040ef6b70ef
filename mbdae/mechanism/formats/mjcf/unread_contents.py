"""Contents of an MJCF file that are not read, since they do not enter the imported model.

The tables list the attributes that affect bodies, joints, closures, forces, shapes or the start, or are reported by
`mbdae.mechanism.formats.mjcf.unsupported_features` if they have an effect. All other attributes are reported by their
path in the file.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

from ..recorded import ALL, Recorded, unread_phrases
from .file_checks import XmlFiles

ROTATION = "quat axisangle xyaxes zaxis euler"
GEOM = f"""class type size pos {ROTATION} fromto mass density shellinertia group rgba material mesh fitscale hfield
    contype conaffinity adhesion"""
JOINT = """class type pos axis springdamper springref springyield stiffness damping armature ref range limited
    frictionloss actuatorfrclimited actuatorfrcrange"""
ACTUATOR = """class joint jointinparent tendon slidersite cranksite site refsite gear cranklength group ctrllimited
    ctrlrange forcelimited forcerange armature damping delay"""
OTHER = 2 * ALL  # actuators that are reported as a whole
READ = {
    "compiler": ALL,
    "option": "gravity density viscosity actuatorgroupdisable",
    "flag": "actuation clampctrl constraint contact damper equality frictionloss gravity limit passive spring sleep",
    "default": "class",
    "asset": "",
    "mesh": """class file content_type vertex face params builtin refpos refquat scale inertia""",
    "material": "class rgba",
    "model": "content_type file",
    "worldbody": "",
    "body": f"childclass pos {ROTATION} mocap gravcomp sleep",
    "frame": f"childclass pos {ROTATION}",
    "replicate": ALL,
    "attach": "body frame model prefix",
    "composite": OTHER,
    "inertial": f"mass pos {ROTATION} diaginertia fullinertia",
    "joint": JOINT,
    "freejoint": "align",
    "geom": GEOM,
    "site": f"class pos {ROTATION} fromto",
    "equality": "active",  # also in a class of defaults
    "equality/connect": "active class anchor body1 body2 site1 site2",
    "equality/weld": "active class anchor body1 body2 site1 site2 relpose torquescale",
    "equality/joint": "active class joint1 joint2 polycoef",
    "equality/tendon": OTHER,
    "equality/flex": OTHER,
    "equality/flexstrain": OTHER,
    "equality/flexvert": OTHER,
    "mujoco/tendon": OTHER,
    "deformable": OTHER,
    "flexcomp": OTHER,
    "asset/skin": OTHER,
    "mujoco/extension": OTHER,
    "actuator": "",
    "general": f"{ACTUATOR} body inheritrange gaintype gainprm biastype biasprm dyntype",
    "motor": ACTUATOR,
    "position": f"{ACTUATOR} inheritrange kp kv dampratio",
    "actuator/velocity": f"{ACTUATOR} kv",
    "default/velocity": f"{ACTUATOR} kv",
    **{f"actuator/{kind}": OTHER for kind in ("intvelocity", "orientation", "pid", "damper", "cylinder", "muscle",
                                              "adhesion", "dcmotor", "plugin")},
    "keyframe": "",
    "key": "qpos qvel ctrl",
}  # fmt: skip


def unread(files: XmlFiles) -> list[str]:
    """Return phrases for unread contents of an MJCF file and its included files."""
    trees: dict[Path, ET.Element] = {}
    out: list[str] = []
    for file, text in files.texts.items():
        try:
            trees[file] = ET.fromstring(text)
        except (ET.ParseError, ValueError, LookupError):  # MuJoCo is more tolerant
            out.append(f"other contents of {file.name}, which is not well-formed XML")
    used = {files.main}
    if files.main in trees:
        _include(trees[files.main], trees, files.by_name, used)
    for file in [files.main, *(f for f in trees if f not in used)]:  # the remaining files are nested models
        if file in trees:
            root = Recorded(trees[file])
            root.get("model")
            root.mark(READ)
            out += unread_phrases(root.unread())
    return out


def _include(
    element: ET.Element, trees: Mapping[Path, ET.Element], by_name: Mapping[str, Path], used: set[Path]
) -> None:
    """Replace ``<include>`` by the included elements, as MuJoCo does."""
    waiting = [element]
    while waiting:
        element = waiting.pop()
        for e in list(element):
            other = by_name.get(e.get("file", "")) if e.tag == "include" else None
            if other is None or other not in trees or other in used:
                waiting.append(e)
                continue
            used.add(other)
            index = list(element).index(e)
            element[index : index + 1] = list(trees[other])
            waiting += trees[other]
