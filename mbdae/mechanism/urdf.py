"""URDF: read by Pinocchio; mimic joints, which it keeps as joints of their own, are noted."""

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from typing import Any

import pinocchio as pin

from ..errors import InputError
from .frames import joint_names
from .part import Mimic, Part, follow, listed
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
        InputError: if the text is not a URDF that Pinocchio accepts.
    """
    try:
        root = (pin.JointModelFreeFlyer(),) if free_flyer else ()
        model = pin.buildModelFromXML(text, *root)
        mimics = _mimics(text)
    except (ValueError, RuntimeError, IndexError, ET.ParseError) as e:
        raise InputError(f"{name} is not a URDF that Pinocchio reads: {_short(e)}") from None
    names = joint_names(model)
    lost = [m.joint for m in mimics if m.joint in names and m.other not in names]
    mimics = tuple(m for m in mimics if m.joint in names and m.other in names)
    kinds, lock = dict(kinds or {}), follow(mimics, dict(lock or {}), names)[1]
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


def _short(error: Exception) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
