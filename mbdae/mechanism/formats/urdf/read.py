"""URDF: read by Pinocchio, with mimic joints and the axes of planar joints; other contents are reported."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ....errors import InputError
from ....file_io import read_text
from ...allowed_paths import AllowedPaths
from ...checked_table import Table
from ...closures.closure import Axis
from ...imported_model import EFFORTS, FRICTION, LIMITS, MIMICRY, ImportedModel, Mimic, mimic_couplings, name_list
from ...model_settings import Value
from ...tree.frames import find_joint, joint_names
from ..body_tables import WITH_AXIS, Source
from ..joint_tree import resolve_joints
from ..reader import KEY, Reader
from ..recorded import Recorded, unread_phrases
from .file_checks import check_urdf
from .loop_closures import add_loop_closures
from .visuals import one_line, read_visuals

POSE = "xyz rpy"
READ = {  # contents that Pinocchio or this module reads (`Recorded.mark`); joints have separate tables
    "link": "",
    "inertial!": "",
    "origin!": POSE,
    "mass!": "value",
    "inertia!": "ixx ixy ixz iyy iyz izz",
    "visual": "",
    "geometry!": "",
    "robot/material": "",
    "visual/material!": "",
    "color!": "rgba",
}
SHAPES = {"box": "size", "cylinder": "radius length", "sphere": "radius", "capsule": "radius length",
          "mesh": "filename scale"}  # fmt: skip
JOINT = {"origin!": POSE, "parent!": "link", "child!": "link"}
MIMIC = {"mimic!": "joint multiplier offset"}
AXIS_JOINT = {**JOINT, **MIMIC, "axis!": "xyz", "limit!": "effort velocity", "dynamics!": "damping friction"}
LIMITED_JOINT = {**AXIS_JOINT, "limit!": "lower upper effort velocity"}
READ_OF_JOINT = {
    "continuous": AXIS_JOINT,
    "revolute": LIMITED_JOINT,
    "prismatic": LIMITED_JOINT,
    "planar": {**JOINT, "axis!": "xyz"},
    "fixed": {**JOINT, "axis!": "xyz"},  # not used, as the format specifies
    "floating": {**JOINT, "axis!": "xyz"},
}
WITHOUT_QUATERNIONS = ("", "1.0")  # versions of the format without quaternions


def read_urdf(
    text: str,
    name: str,
    allowed: AllowedPaths,
    free_flyer: bool = False,
    *,
    kinds: Mapping[str, str] | None = None,
    lock: Mapping[str, object] | None = None,
) -> ImportedModel:
    """Read a URDF text; visuals are None (with a warning) when a mesh is missing.

    Args:
        text: the URDF.
        name: name of the file, for messages.
        allowed: allowed paths of meshes.
        free_flyer: add a free joint, ``root_joint``, between the world and the root link.
        kinds: kinds of joints that replace those of the URDF.
        lock: values of locked joints.

    Raises:
        InputError: if the text is not a URDF that Pinocchio accepts, or a joint's axis is zero.
    """
    parsed = _parsed(text, name, free_flyer)
    names, recorded = joint_names(parsed.model), _recorded(parsed.tree)
    kinds, lock = dict(kinds or {}), mimic_couplings(parsed.mimics, dict(lock or {}), names)[1]
    changed = {*kinds, *lock}
    axes = {n: x for n, x in parsed.axes.items() if n not in changed}
    _require_axes(name, axes)
    record = {
        "urdf": text,
        "folder": str(allowed.folder),
        "packages": list(map(str, allowed.packages)),
        "free_flyer": free_flyer,
        "kinds": kinds,
        "lock": lock,
    }
    left_out = _unsupported(parsed, recorded, [n for n in names if n not in changed])
    model, visuals = resolve_joints(parsed.model, read_visuals(name, parsed.model, parsed.tree, allowed), kinds, lock)
    return ImportedModel(
        model,
        visuals,
        record.copy,
        mimics=tuple(m for m in parsed.mimics if m.joint not in lock),
        normals={n: axis for n, (kind, axis) in axes.items() if kind == "planar"},
        left_out=left_out,
    )


class _Parsed(NamedTuple):
    """A URDF: the model of Pinocchio, and contents that Pinocchio does not read.

    Attributes:
        model: the model.
        tree: the elements of the file.
        mimics: mimic joints.
        without_leader: mimic joints whose leader does not move.
        axes: kind and axis of joints by name.
    """

    model: pin.Model
    tree: ET.Element
    mimics: tuple[Mimic, ...]
    without_leader: list[str]
    axes: dict[str, tuple[str, Axis]]


def _parsed(text: str, name: str, free_flyer: bool) -> _Parsed:
    try:
        tree = ET.fromstring(text)
        check_urdf(tree, name, READ_OF_JOINT)
        root = (pin.JointModelFreeFlyer(),) if free_flyer else ()
        model = pin.buildModelFromXML(text, *root)
        names, axes = joint_names(model), _axes(tree)
        mimics = [m for m in _mimics(tree) if m.joint in names]
    except InputError:
        raise
    except (ValueError, RuntimeError, IndexError, ET.ParseError) as e:
        raise InputError(f"{name} is not a URDF that Pinocchio reads: {one_line(e)}") from None
    without_leader = [m.joint for m in mimics if m.other not in names]
    return _Parsed(model, tree, tuple(m for m in mimics if m.joint not in without_leader), without_leader, axes)


def _require_axes(name: str, axes: Mapping[str, tuple[str, Axis]]) -> None:
    for joint, (_, axis) in axes.items():
        if not 0 < np.linalg.norm(axis) < np.inf:
            raise InputError(f"{name}: the axis of joint {joint!r} is not a direction: {' '.join(map(str, axis))}")


class Record(Table):
    """Record of an imported model, see `read_urdf`."""

    urdf: str
    folder: str
    packages: tuple[str, ...]
    free_flyer: bool
    kinds: dict[str, str]
    lock: dict[str, Value]


def _recorded(tree: ET.Element) -> Recorded:
    """Return the elements; contents that are read are marked."""
    robot = Recorded(tree)
    pose_keys = POSE if robot.get("version") in WITHOUT_QUATERNIONS else f"{POSE} quat_xyzw"
    robot.mark({**READ, "origin!": pose_keys})
    for geometry in (g for link in robot.all("link") for e in link.all("visual") for g in e.all("geometry")[:1]):
        for shape in geometry.children[:1]:
            geometry.mark({f"{shape.tag}!": SHAPES.get(shape.tag, "")})
    for joint in robot.all("joint"):
        joint.mark({**READ_OF_JOINT.get(joint.get("type"), {}), "origin!": pose_keys})
    return robot


def _unsupported(parsed: _Parsed, robot: Recorded, names: list[str]) -> tuple[str, ...]:
    """Return unsupported features of the joints ``names``, of mimic joints, and of other elements."""
    dry = np.array(parsed.model.upperDryFrictionLimit)
    joints = {n: find_joint(parsed.model, n) for n in names}
    limits = _limits(robot, names)
    found = {
        LIMITS: [n for n in limits if joints[n].nq == 1],
        EFFORTS: [n for n, x in limits.items() if any(float(x.get(key) or 0) for key in ("effort", "velocity"))],
        FRICTION: [n for n, j in joints.items() if dry[j.idx_v : j.idx_v + j.nv].any()],
        MIMICRY: parsed.without_leader,
    }
    return (*(name_list(what, n) for what, n in found.items() if n), *unread_phrases(robot.unread()))


def _limits(robot: Recorded, names: list[str]) -> dict[str, Recorded]:
    """Return the limit elements of joints by name."""
    elements = [e for e in robot.all("joint") if e.get("name") in names and "limit!" in READ_OF_JOINT[e.get("type")]]
    return {e.get("name"): x for e in elements if (x := e.first("limit"))}


def _mimics(tree: ET.Element) -> tuple[Mimic, ...]:
    out = []
    for joint in tree.iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            numbers = [float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))]
            out.append(Mimic(joint.get("name", ""), mimic.get("joint", ""), *numbers))
    return tuple(out)


def _axes(tree: ET.Element) -> dict[str, tuple[str, Axis]]:
    """Return kind and axis (default x) of joints with an axis; floating and fixed joints are left out."""
    out = {}
    for joint in tree.iter("joint"):
        if (kind := joint.get("type", "")) in WITH_AXIS:
            axis = joint.find("axis")
            given = None if axis is None else axis.get("xyz")
            x, y, z = map(float, (given or "1 0 0").split())
            out[joint.get("name", "")] = kind, (x, y, z)
    return out


def _read(path: Path, allowed: AllowedPaths, source: Source) -> ImportedModel:
    return add_loop_closures(read_urdf(read_text(path), path.name, allowed, source.free_flyer), path, allowed)


def _restored(record: Mapping[str, object], meshes: Sequence[Path] | None) -> ImportedModel:
    r = Record.model_validate(record)
    allowed = AllowedPaths.from_record(r.folder, r.packages, meshes)
    return read_urdf(r.urdf, "URDF", allowed, r.free_flyer, kinds=r.kinds, lock=r.lock)


urdf = Reader("urdf", (".urdf", ".xml", ".mjcf"), _read, root="robot", rejected=KEY, restore=_restored)
