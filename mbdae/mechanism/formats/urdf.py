"""URDF: read by Pinocchio, plus mimic joints and the axes of planar joints; the rest is reported."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...file_io import read_text
from ..allowed_paths import AllowedPaths
from ..checked_table import Table
from ..closures.closure import Axis
from ..frames import find_joint, joint_names
from ..imported_model import EFFORTS, FRICTION, LIMITS, LOST, ImportedModel, Mimic, mimic_couplings, name_list
from ..model_settings import Value
from .joint_tree import resolve_joints
from .loop_closures import with_loops
from .reader import KEY, Reader
from .recorded import Recorded, unread_phrases
from .schema import WITH_AXIS, Source
from .urdf_visuals import short, visuals_found

PLACE = "xyz rpy"
READ = {  # of a URDF, by Pinocchio or here, see `Recorded.mark`; joints have separate tables
    "link": "",
    "inertial!": "",
    "origin!": PLACE,
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
JOINT = {"origin!": PLACE, "parent!": "link", "child!": "link"}
MIMIC = {"mimic!": "joint multiplier offset"}
TURNS = {**JOINT, **MIMIC, "axis!": "xyz", "limit!": "effort velocity", "dynamics!": "damping friction"}
ENDS = {**TURNS, "limit!": "lower upper effort velocity"}
OF_KIND = {
    "continuous": TURNS,
    "revolute": ENDS,
    "prismatic": ENDS,
    "planar": {**JOINT, "axis!": "xyz"},
    "fixed": {**JOINT, "axis!": "xyz"},  # not used, as the format specifies
    "floating": {**JOINT, "axis!": "xyz"},
}
QUATERNIONS = ("", "1.0")  # versions of the format without them


def read_urdf(
    text: str,
    name: str,
    places: AllowedPaths,
    free_flyer: bool = False,
    *,
    kinds: Mapping[str, str] | None = None,
    lock: Mapping[str, Any] | None = None,
) -> ImportedModel:
    """Read a URDF text; visuals are None (with a warning) when a mesh is missing.

    Args:
        text: the URDF.
        name: name of the file, for messages.
        places: allowed paths of meshes.
        free_flyer: put a free joint, ``root_joint``, under the root link.
        kinds: joints of another kind than the URDF says.
        lock: joints that are locked at values.

    Raises:
        InputError: if the text is not a URDF that Pinocchio accepts, or a joint's axis is zero.
    """
    said = _parsed(text, name, free_flyer)
    names, recorded = joint_names(said.model), _recorded(said.tree)
    kinds, lock = dict(kinds or {}), mimic_couplings(said.mimics, dict(lock or {}), names)[1]
    changed = {*kinds, *lock}
    axes = {n: x for n, x in said.axes.items() if n not in changed}
    _refuse_zero(name, axes)
    record = {
        "urdf": text,
        "folder": str(places.folder),
        "packages": list(map(str, places.packages)),
        "free_flyer": free_flyer,
        "kinds": kinds,
        "lock": lock,
    }
    left_out = _not_acting(said, recorded, [n for n in names if n not in changed])
    model, visuals = resolve_joints(said.model, visuals_found(name, said.model, said.tree, places), kinds, lock)
    return ImportedModel(
        model,
        visuals,
        record.copy,
        mimics=tuple(m for m in said.mimics if m.joint not in lock),
        normals={n: axis for n, (kind, axis) in axes.items() if kind == "planar"},
        left_out=left_out,
    )


class _Parsed(NamedTuple):
    """A URDF: Pinocchio's model, its elements, and what these say that Pinocchio does not read.

    ``lost`` are joints that follow one that does not move.
    """

    model: pin.Model
    tree: ET.Element
    mimics: tuple[Mimic, ...]
    lost: list[str]
    axes: dict[str, tuple[str, Axis]]


def _parsed(text: str, name: str, free_flyer: bool) -> _Parsed:
    try:
        root = (pin.JointModelFreeFlyer(),) if free_flyer else ()
        model = pin.buildModelFromXML(text, *root)
        tree = ET.fromstring(text)
        names, axes = joint_names(model), _axes(tree)
        mimics = [m for m in _mimics(tree) if m.joint in names]
    except (ValueError, RuntimeError, IndexError, ET.ParseError) as e:
        raise InputError(f"{name} is not a URDF that Pinocchio reads: {short(e)}") from None
    lost = [m.joint for m in mimics if m.other not in names]
    return _Parsed(model, tree, tuple(m for m in mimics if m.joint not in lost), lost, axes)


def _refuse_zero(name: str, axes: Mapping[str, tuple[str, Axis]]) -> None:
    for joint, (_, axis) in axes.items():
        if not 0 < np.linalg.norm(axis) < np.inf:
            raise InputError(f"{name}: the axis of joint {joint!r} is no direction: {' '.join(map(str, axis))}")


class Record(Table):
    """Record of an imported model, see `read_urdf`."""

    urdf: str
    folder: str
    packages: tuple[str, ...]
    free_flyer: bool
    kinds: dict[str, str]
    lock: dict[str, Value]


def _recorded(tree: ET.Element) -> Recorded:
    """Return the elements, marked where they are read."""
    robot = Recorded(tree)
    place = PLACE if robot.get("version") in QUATERNIONS else f"{PLACE} quat_xyzw"
    robot.mark({**READ, "origin!": place})
    for geometry in (g for link in robot.all("link") for e in link.all("visual") for g in e.all("geometry")[:1]):
        for shape in geometry.children[:1]:
            geometry.mark({f"{shape.tag}!": SHAPES.get(shape.tag, "")})
    for joint in robot.all("joint"):
        joint.mark({**OF_KIND.get(joint.get("type"), {}), "origin!": place})
    return robot


def _not_acting(said: _Parsed, robot: Recorded, names: list[str]) -> tuple[str, ...]:
    """Return features of the file that do not act: of joints ``names``, of mimics that are lost, and the rest."""
    dry = np.array(said.model.upperDryFrictionLimit)
    joints = {n: find_joint(said.model, n) for n in names}
    limits = _limits(robot, names)
    found = {
        LIMITS: [n for n in limits if joints[n].nq == 1],
        EFFORTS: [n for n, x in limits.items() if any(float(x.get(key) or 0) for key in ("effort", "velocity"))],
        FRICTION: [n for n, j in joints.items() if dry[j.idx_v : j.idx_v + j.nv].any()],
        LOST: said.lost,
    }
    return (*(name_list(what, n) for what, n in found.items() if n), *unread_phrases(robot.unread()))


def _limits(robot: Recorded, names: list[str]) -> dict[str, Recorded]:
    """The element of the limits of each joint that has one."""
    of_one = [e for e in robot.all("joint") if e.get("name") in names and "limit!" in OF_KIND[e.get("type")]]
    return {e.get("name"): x for e in of_one if (x := e.first("limit"))}


def _mimics(tree: ET.Element) -> tuple[Mimic, ...]:
    out = []
    for joint in tree.iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            numbers = [float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))]
            out.append(Mimic(joint.get("name", ""), mimic.get("joint", ""), *numbers))
    return tuple(out)


def _axes(tree: ET.Element) -> dict[str, tuple[str, Axis]]:
    """Return kind and axis, x when left out, of the joints that have one; floating and fixed joints have none."""
    out = {}
    for joint in tree.iter("joint"):
        if (kind := joint.get("type", "")) in WITH_AXIS:
            axis = joint.find("axis")
            given = None if axis is None else axis.get("xyz")
            x, y, z = map(float, (given or "1 0 0").split())
            out[joint.get("name", "")] = kind, (x, y, z)
    return out


def _read(path: Path, places: AllowedPaths, source: Source) -> ImportedModel:
    return with_loops(read_urdf(read_text(path), path.name, places, source.free_flyer), path, places)


def _restored(record: Mapping[str, Any], meshes: Sequence[Path] | None) -> ImportedModel:
    r = Record.model_validate(record)
    places = AllowedPaths.from_record(r.folder, r.packages, meshes)
    return read_urdf(r.urdf, "URDF", places, r.free_flyer, kinds=r.kinds, lock=r.lock)


urdf = Reader("urdf", (".urdf", ".xml", ".mjcf"), _read, root="robot", refused=KEY, restore=_restored)
