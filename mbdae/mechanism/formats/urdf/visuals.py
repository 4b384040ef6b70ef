"""Visual geometry of a URDF, read by Pinocchio; only meshes in allowed paths are used."""

import warnings
import xml.etree.ElementTree as ET

import coal
import numpy as np
import pinocchio as pin

from ....errors import InputError
from ...allowed_paths import AllowedPaths
from ...checked_table import HUGE
from ...scene.meshes import placeholder

MARKER = 10_000_000  # m: size of the boxes that replace meshes


def read_visuals(name: str, model: pin.Model, tree: ET.Element, allowed: AllowedPaths) -> pin.GeometryModel | None:
    """Return the visuals of a URDF; None with a warning if they cannot be read.

    Args:
        name: name of the file, for the warning.
        model: the Pinocchio model of the file.
        tree: elements of the file, from which meshes and textures are removed.
        allowed: allowed paths of meshes.
    """
    try:
        return _visuals(model, tree, allowed)
    except (ValueError, RuntimeError) as e:
        reason = str(e) if isinstance(e, InputError) else one_line(e)
        warnings.warn(f"{name}: visuals left out, {reason}", stacklevel=3)
        return None


def _visuals(model: pin.Model, tree: ET.Element, allowed: AllowedPaths) -> pin.GeometryModel:
    """Return the visuals; Pinocchio reads boxes in place of meshes, whose sizes identify the allowed mesh files.

    Raises:
        InputError: for a mesh that is missing, damaged, outside the allowed paths, or of an unsupported format.
    """
    meshes = []
    for shape in tree.iterfind("link/visual/geometry"):
        for mesh in shape.findall("mesh"):
            meshes.append((allowed.find(mesh.get("filename", "")), _scale(mesh.get("scale", "1 1 1"))))
            shape.remove(mesh)
            ET.SubElement(shape, "box", size=f"{MARKER + len(meshes) - 1} {MARKER} {MARKER}")
    for material in tree.iter("material"):
        for texture in material.findall("texture"):
            material.remove(texture)
    text = ET.tostring(tree, encoding="unicode")
    visuals = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL, None, [])
    for g in visuals.geometryObjects:
        size = 2 * g.geometry.halfSide if isinstance(g.geometry, coal.Box) else np.zeros(3)
        if size[1] == size[2] == MARKER:
            path, g.meshScale = meshes[round(size[0] - MARKER)]
            g.meshPath, g.geometry = str(path), placeholder(path, g.meshScale)
            g.meshTexturePath = str(allowed.companion_folder(path))
    return visuals


def _scale(text: str) -> np.ndarray:
    scale = np.array(text.split(), float)
    if scale.shape != (3,) or not (np.abs(scale) <= HUGE).all():
        raise InputError(f"the scale of a mesh is three finite numbers, got {text[:40]!r}")
    return scale


def one_line(error: Exception) -> str:
    """Return the message of a library's error in one line."""
    return " ".join(str(error).split())[:200] or type(error).__name__
