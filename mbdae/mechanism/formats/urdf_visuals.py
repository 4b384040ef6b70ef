"""Visual geometry of a URDF, read by Pinocchio, except meshes, which are searched in allowed paths."""

import warnings
import xml.etree.ElementTree as ET

import coal
import numpy as np
import pinocchio as pin

from ...errors import InputError
from ..allowed_paths import AllowedPaths
from ..checked_table import HUGE
from ..scene.meshes import placeholder

TOKEN = 10_000_000  # m: the size of boxes in the place of meshes


def visuals_found(name: str, model: pin.Model, tree: ET.Element, places: AllowedPaths) -> pin.GeometryModel | None:
    """Return the visuals of a URDF, or nothing and a warning.

    Args:
        name: of the file, for the warning.
        model: its tree.
        tree: its elements, of which meshes and textures are taken away.
        places: where meshes are searched.
    """
    try:
        return _visuals(model, tree, places)
    except (ValueError, RuntimeError) as e:
        reason = str(e) if isinstance(e, InputError) else short(e)
        warnings.warn(f"{name}: visuals left out, {reason}", stacklevel=3)
        return None


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
            g.meshPath, g.geometry = str(path), placeholder(path, g.meshScale)
            g.meshTexturePath = str(places.companion_folder(path))
    return visuals


def _scale(text: str) -> np.ndarray:
    scale = np.array(text.split(), float)
    if scale.shape != (3,) or not (np.abs(scale) <= HUGE).all():
        raise InputError(f"the scale of a mesh is three finite numbers, got {text[:40]!r}")
    return scale


def short(error: Exception) -> str:
    """Return the message of a library's error in one line."""
    return " ".join(str(error).split())[:200] or type(error).__name__
