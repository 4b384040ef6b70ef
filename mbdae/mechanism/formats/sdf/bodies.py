"""Inertias and shapes of the links of an SDF model."""

from collections.abc import Callable
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ....errors import InputError
from ...allowed_paths import AllowedPaths
from ...scene.meshes import placeholder
from ..mechanism_file.inertias import checked_inertia
from ..recorded import Recorded
from .elements import YES, SdfElements

WATER = 1000.0  # kg/m^3: default density in SDF
GREY = (0.6, 0.6, 0.6, 1.0)
ENTRIES = (("ixx", 1.0), ("ixy", 0.0), ("iyy", 1.0), ("ixz", 0.0), ("iyz", 0.0), ("izz", 1.0))


def read_inertia(sdf: SdfElements, link: str) -> pin.Inertia:
    """Return the inertia of a link in its frame, from the file or, on request, from its collision shapes.

    Raises:
        InputError: for invalid numbers, masses and tensors that are not physical, and shapes of unknown inertia.
    """
    e, context = sdf.by_name[link].first("inertial"), f"the inertial of {link!r}"
    if e is not None and e.get("auto").lower() in YES:
        return _inertia_from_shapes(sdf, link, e)
    mass = sdf.number(e, "mass", 1.0, context)
    xx, xy, yy, xz, yz, zz = (sdf.number(e, f"inertia/{key}", default, context) for key, default in ENTRIES)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    inertia = checked_inertia(mass, np.zeros(3), tensor, f"link {link!r} of {sdf.file}")
    if e is None:
        return inertia
    placement = sdf.links[link]
    return placement.actInv(sdf.placement_in_world(e, f"{link}, its inertial", placement)).act(inertia)


def _inertia_from_shapes(sdf: SdfElements, link: str, e: Recorded) -> pin.Inertia:
    """Return the sum over collision shapes of density times volume inertia, scaled to the mass if it is given.

    Raises:
        InputError: for a shape that is not a solid in SDF.
    """
    context, placement, total = f"the inertial of {link!r}", sdf.links[link], pin.Inertia.Zero()
    default_density = sdf.number(e, "density", WATER, context)
    for shape in sdf.by_name[link].all("collision"):
        name = f"{link}/{shape.get('name')}"
        solid = read_solid(sdf, shape.first("geometry"), name)
        if solid is None:
            why = f"follows from its shapes, and {name!r} is not a solid"
            raise InputError(f"{sdf.file}: {context} {why}: set the mass")
        density = sdf.number(shape, "density", default_density, f"the density of {name!r}")
        moment = density * np.array(solid.computeMomentofInertia())
        com = np.array(solid.computeCOM()).ravel()
        inertia = checked_inertia(density * solid.computeVolume(), com, moment, f"{name!r} of {sdf.file}")
        total += placement.actInv(sdf.placement_in_world(shape, name, placement)).act(inertia)
    if not total.mass > 0:
        raise InputError(f"{sdf.file}: {context} follows from its shapes, which have no mass")
    mass = sdf.number(e, "mass", total.mass, context)
    tensor = total.inertia * abs(mass / total.mass)
    return checked_inertia(mass, total.lever, tensor, f"link {link!r} of {sdf.file}")


def read_solid(sdf: SdfElements, geometry: Recorded | None, name: str) -> Any:
    """Return the solid of a geometry; None for other shapes."""

    def sizes(shape: Recorded, *keys: str) -> list[float]:
        return [sdf.number(shape, key, 1.0, name) for key in keys]

    solids: dict[str, Callable[[Recorded], Any]] = {
        "box": lambda s: coal.Box(*sdf.parse_numbers(s.text("size") or "1 1 1", 3, name)),
        "sphere": lambda s: coal.Sphere(*sizes(s, "radius")),
        "cylinder": lambda s: coal.Cylinder(*sizes(s, "radius", "length")),
        "capsule": lambda s: coal.Capsule(*sizes(s, "radius", "length")),
        "ellipsoid": lambda s: coal.Ellipsoid(*sdf.parse_numbers(s.text("radii") or "1 1 1", 3, name)),
    }
    for kind, make in solids.items() if geometry else ():
        shape = geometry.first(kind) if geometry else None
        if shape is not None:
            return make(shape)
    return None


def read_visuals(
    sdf: SdfElements, allowed: AllowedPaths, joint_of_link: Callable[[str], tuple[int, pin.SE3]]
) -> tuple[pin.GeometryModel, list[str], str]:
    """Return the visuals of the links.

    Args:
        sdf: the elements.
        allowed: allowed paths of meshes.
        joint_of_link: returns the parent joint of a link, and its placement in the world.

    Returns:
        Solids and meshes; the names of unsupported shapes and missing meshes; and the reason for the first.
    """
    out, missing, reason = pin.GeometryModel(), list[str](), ""
    for link, placement in sdf.links.items():
        joint, origin = joint_of_link(link)
        for e in sdf.by_name[link].all("visual"):
            name, geometry = f"{link}/{e.get('name')}", e.first("geometry")
            mesh, files, scale = geometry.first("mesh") if geometry else None, ("", ""), np.ones(3)
            try:
                if mesh is None:
                    shape = read_solid(sdf, geometry, name)
                else:
                    scale = np.array(sdf.parse_numbers(mesh.text("scale") or "1 1 1", 3, f"the scale of {name!r}"))
                    found = allowed.find(mesh.text("uri") or "")
                    shape, files = placeholder(found, scale), (str(found), str(allowed.companion_folder(found)))
            except InputError as error:
                if mesh is None:
                    raise
                shape, reason = None, reason or str(error)
            if shape is None:
                missing.append(name)
                continue
            g = pin.GeometryObject(name, joint, origin.actInv(sdf.placement_in_world(e, name, placement)), shape)
            (g.meshPath, g.meshTexturePath), g.meshScale = files, scale
            colour = e.text("material/diffuse") or e.text("material/ambient")
            g.meshColor = np.array(sdf.parse_numbers(colour, 4, name) if colour else GREY)
            g.overrideMaterial = bool(colour)  # replaces the colours of a mesh
            out.addGeometryObject(g)
    return out, missing, reason
