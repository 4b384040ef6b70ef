"""URDF: read by Pinocchio, beside which mimic joints and the axes of planar joints are read; the rest is named."""

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ...errors import InputError
from ..allowed_paths import AllowedPaths
from ..checked_table import HUGE, Table
from ..closures.closure import Axis
from ..frames import find_joint, joint_names
from ..imported_model import EFFORTS, FRICTION, LIMITS, LOST, ImportedModel, Mimic, mimic_couplings, name_list
from ..model_settings import Value
from ..scene.meshes import stand_in
from .joint_tree import settled
from .recorded import Recorded, unread_phrases
from .schema import WITH_AXIS

TOKEN = 10_000_000  # m: the size of boxes that stand for meshes
PLACE = "xyz rpy"
READ = {  # of a URDF, by Pinocchio or here, see `Recorded.mark`; joints have tables of their own
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
    "fixed": {**JOINT, "axis!": "xyz"},  # which it does not use, as the format says
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
        name: of the file, for messages.
        places: where meshes are looked up.
        free_flyer: put a free joint, ``root_joint``, under the root link.
        kinds: joints of another kind than the URDF says.
        lock: joints that are locked at values.

    Raises:
        InputError: if the text is not a URDF that Pinocchio accepts, or a joint's axis is zero.
    """
    try:
        root = (pin.JointModelFreeFlyer(),) if free_flyer else ()
        model = pin.buildModelFromXML(text, *root)
        tree = ET.fromstring(text)
        mimics, axes = _mimics(tree), _axes(tree)
    except (ValueError, RuntimeError, IndexError, ET.ParseError) as e:
        raise InputError(f"{name} is not a URDF that Pinocchio reads: {_short(e)}") from None
    names, recorded = joint_names(model), _recorded(tree)
    lost = [m.joint for m in mimics if m.joint in names and m.other not in names]
    mimics = tuple(m for m in mimics if m.joint in names and m.other in names)
    kinds, lock = dict(kinds or {}), mimic_couplings(mimics, dict(lock or {}), names)[1]
    axes = {n: x for n, x in axes.items() if n not in kinds and n not in lock}
    for joint, (_, axis) in axes.items():
        if not 0 < np.linalg.norm(axis) < np.inf:
            raise InputError(f"{name}: the axis of joint {joint!r} is no direction: {' '.join(map(str, axis))}")
    record = {
        "urdf": text,
        "folder": str(places.folder),
        "packages": list(map(str, places.packages)),
        "free_flyer": free_flyer,
        "kinds": kinds,
        "lock": lock,
    }
    said = [n for n in names if n not in kinds and n not in lock]
    left_out = [*_not_acting(model, recorded, said), (LOST, lost)]
    rest = unread_phrases(recorded.unread())
    try:
        visuals = _visuals(model, tree, places)
    except (ValueError, RuntimeError) as e:
        reason = str(e) if isinstance(e, InputError) else _short(e)
        warnings.warn(f"{name}: visuals left out, {reason}", stacklevel=2)
        visuals = None
    model, visuals = settled(model, visuals, kinds, lock)
    return ImportedModel(
        model,
        visuals,
        record.copy,
        mimics=tuple(m for m in mimics if m.joint not in lock),
        normals={n: axis for n, (kind, axis) in axes.items() if kind == "planar"},
        left_out=(*(name_list(what, n) for what, n in left_out if n), *rest),
    )


class Record(Table):
    """What a part remembers of itself, see `read_urdf`."""

    urdf: str
    folder: str
    packages: tuple[str, ...]
    free_flyer: bool
    kinds: dict[str, str]
    lock: dict[str, Value]


def _recorded(tree: ET.Element) -> Recorded:
    """The elements, marked where they are read."""
    robot = Recorded(tree)
    place = PLACE if robot.get("version") in QUATERNIONS else f"{PLACE} quat_xyzw"
    robot.mark({**READ, "origin!": place})
    for geometry in (g for link in robot.all("link") for e in link.all("visual") for g in e.all("geometry")[:1]):
        for shape in geometry.children[:1]:
            geometry.mark({f"{shape.tag}!": SHAPES.get(shape.tag, "")})
    for joint in robot.all("joint"):
        joint.mark({**OF_KIND.get(joint.get("type"), {}), "origin!": place})
    return robot


def _not_acting(model: pin.Model, robot: Recorded, names: list[str]) -> list[tuple[str, list[str]]]:
    """What the model has of joints and the motion does not."""
    of_one = [e for e in robot.all("joint") if e.get("name") in names and "limit!" in OF_KIND[e.get("type")]]
    limits = {e.get("name"): x for e in of_one if (x := e.first("limit"))}
    ends = [n for n in limits if find_joint(model, n).nq == 1]
    bounds = [n for n, x in limits.items() if any(float(x.get(key) or 0) for key in ("effort", "velocity"))]
    dry = np.array(model.upperDryFrictionLimit)
    with_friction = [n for n in names if (j := find_joint(model, n)) and dry[j.idx_v : j.idx_v + j.nv].any()]
    return [(LIMITS, ends), (EFFORTS, bounds), (FRICTION, with_friction)]


def _visuals(model: pin.Model, tree: ET.Element, places: AllowedPaths) -> pin.GeometryModel:
    """The visuals, whose meshes are files that may be read: Pinocchio sees a box for each, by whose size it is known.

    Raises:
        InputError: for a mesh that is missing, damaged, stands elsewhere, or is of a format that is not drawn.
    """
    meshes = []
    for shape in tree.iterfind("link/visual/geometry"):
        for mesh in shape.findall("mesh"):
            meshes.append((places.find(mesh.get("filename", "")), _scale(mesh.get("scale", "1 1 1"))))
            shape.remove(mesh)
            ET.SubElement(shape, "box", size=f"{TOKEN + len(meshes) - 1} {TOKEN} {TOKEN}")
    for material in tree.iter("material"):
        for texture in material.findall("texture"):
            material.remove(texture)
    text = ET.tostring(tree, encoding="unicode")
    visuals = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL, None, [])
    for g in visuals.geometryObjects:
        size = 2 * g.geometry.halfSide if isinstance(g.geometry, coal.Box) else np.zeros(3)
        if size[1] == size[2] == TOKEN:
            path, g.meshScale = meshes[round(size[0] - TOKEN)]
            g.meshPath, g.geometry = str(path), stand_in(path, g.meshScale)
    return visuals


def _scale(text: str) -> np.ndarray:
    scale = np.array(text.split(), float)
    if scale.shape != (3,) or not (np.abs(scale) <= HUGE).all():
        raise InputError(f"the scale of a mesh is three finite numbers, got {text[:40]!r}")
    return scale


def _mimics(tree: ET.Element) -> tuple[Mimic, ...]:
    out = []
    for joint in tree.iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            numbers = [float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))]
            out.append(Mimic(joint.get("name", ""), mimic.get("joint", ""), *numbers))
    return tuple(out)


def _axes(tree: ET.Element) -> dict[str, tuple[str, Axis]]:
    """Kind and axis, x when left out, of the joints that have one; floating and fixed joints have none."""
    out = {}
    for joint in tree.iter("joint"):
        if (kind := joint.get("type", "")) in WITH_AXIS:
            axis = joint.find("axis")
            given = None if axis is None else axis.get("xyz")
            x, y, z = map(float, (given or "1 0 0").split())
            out[joint.get("name", "")] = kind, (x, y, z)
    return out


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
