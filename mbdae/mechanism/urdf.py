"""URDF: read by Pinocchio; what it does not carry over is noted: mimic joints, and the axes of planar joints."""

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ..errors import InputError
from .closures import Axis
from .frames import joint_names
from .part import Mimic, Part, follow, listed
from .schema import WITH_AXIS
from .tree import settled


def read_urdf(
    text: str,
    name: str,
    free_flyer: bool = False,
    packages: Sequence[str] = (),
    *,
    kinds: Mapping[str, str] | None = None,
    lock: Mapping[str, Any] | None = None,
) -> Part:
    """Read a URDF text; visuals are None (with a warning) when a mesh is missing.

    Args:
        text: the URDF.
        name: of the file, for messages.
        free_flyer: put a free joint, ``root_joint``, under the root link.
        packages: folders in which ``package://`` names are looked up.
        kinds: joints of another kind than the URDF says.
        lock: joints that are locked at values.

    Raises:
        InputError: if the text is not a URDF that Pinocchio accepts, or a joint's axis is zero.
    """
    try:
        root = (pin.JointModelFreeFlyer(),) if free_flyer else ()
        model = pin.buildModelFromXML(text, *root)
        mimics, axes = _mimics(text), _axes(text)
    except (ValueError, RuntimeError, IndexError, ET.ParseError) as e:
        raise InputError(f"{name} is not a URDF that Pinocchio reads: {_short(e)}") from None
    names = joint_names(model)
    lost = [m.joint for m in mimics if m.joint in names and m.other not in names]
    mimics = tuple(m for m in mimics if m.joint in names and m.other in names)
    kinds, lock = dict(kinds or {}), follow(mimics, dict(lock or {}), names)[1]
    axes = {n: x for n, x in axes.items() if n not in kinds and n not in lock}
    for joint, (_, axis) in axes.items():
        if not 0 < np.linalg.norm(axis) < np.inf:
            raise InputError(f"{name}: the axis of joint {joint!r} is no direction: {' '.join(map(str, axis))}")
    record = {"urdf": text, "packages": list(packages), "free_flyer": free_flyer, "kinds": kinds, "lock": lock}
    try:
        visuals = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL, None, list(packages))
    except (ValueError, RuntimeError) as e:
        warnings.warn(f"{name}: visuals left out, {_short(e)}", stacklevel=2)
        visuals = None
    model, visuals = settled(model, visuals, kinds, lock)
    return Part(
        model,
        visuals,
        record.copy,
        mimics=tuple(m for m in mimics if m.joint not in lock),
        normals={n: axis for n, (kind, axis) in axes.items() if kind == "planar"},
        left_out=(listed("mimicry of joints that do not move, by", lost),) if lost else (),
    )


def _mimics(text: str) -> tuple[Mimic, ...]:
    out = []
    for joint in ET.fromstring(text).iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            numbers = [float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))]
            out.append(Mimic(joint.get("name", ""), mimic.get("joint", ""), *numbers))
    return tuple(out)


def _axes(text: str) -> dict[str, tuple[str, Axis]]:
    """Kind and axis, x when left out, of the joints that have one; floating and fixed joints have none."""
    out = {}
    for joint in ET.fromstring(text).iter("joint"):
        if (kind := joint.get("type", "")) in WITH_AXIS:
            axis = joint.find("axis")
            given = None if axis is None else axis.get("xyz")
            x, y, z = map(float, (given or "1 0 0").split())
            out[joint.get("name", "")] = kind, (x, y, z)
    return out


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
