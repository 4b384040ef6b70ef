"""Geoms of an MJCF file as visuals."""

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from ....tolerances import COARSE
from ...scene.shapes import MIN_LEVEL_COSINE, ground, mesh
from .compiled_model import MjcfModel
from .states import pose

SHOWN_GROUPS = 3  # MuJoCo's viewer shows groups 0, 1 and 2
DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)  # colour of a geom without a colour


def visuals(c: MjcfModel) -> tuple[pin.GeometryModel, list[str]]:
    """Return the geoms that MuJoCo's viewer shows, and the names of geoms of unsupported shapes."""
    out, missing = pin.GeometryModel(), []
    meshes: dict[int, coal.BVHModelOBBRSS] = {}
    for g in np.flatnonzero(c.m.geom_group < SHOWN_GROUPS).tolist():
        name = c.name("GEOM", g) or f"geom{g}"
        joint, placement = c.carriers[c.m.geom_bodyid[g]]
        in_joint = placement * pose(c.m.geom_pos[g], c.m.geom_quat[g])
        shape = _shape(c, g, meshes, level=joint == 0 and in_joint.rotation[2, 2] > MIN_LEVEL_COSINE)
        if shape is None:
            missing.append(name)
            continue
        geometry = pin.GeometryObject(name, joint, in_joint, shape)
        geometry.meshColor = _colour(c, g)
        out.addGeometryObject(geometry)
    return out, missing


def _colour(c: MjcfModel, g: int) -> np.ndarray:
    """Return red, green, blue and opacity of a geom, (4,): as given, or else of its material."""
    material, given = int(c.m.geom_matid[g]), np.array(c.m.geom_rgba[g], float)
    return np.array(c.m.mat_rgba[material], float) if material >= 0 and (given == DEFAULT_RGBA).all() else given


def _shape(c: MjcfModel, g: int, meshes: dict[int, coal.BVHModelOBBRSS], level: bool) -> Any:
    m, kinds = c.m, c.lib.mjtGeom
    a, b, h = (float(x) for x in m.geom_size[g])
    match kinds(m.geom_type[g]):
        case kinds.mjGEOM_SPHERE:
            return coal.Sphere(a)
        case kinds.mjGEOM_CAPSULE:
            return coal.Capsule(a, 2 * b)
        case kinds.mjGEOM_CYLINDER:
            return coal.Cylinder(a, 2 * b)
        case kinds.mjGEOM_ELLIPSOID:
            return coal.Ellipsoid(a, b, h)
        case kinds.mjGEOM_BOX:
            return coal.Box(2 * a, 2 * b, 2 * h)
        case kinds.mjGEOM_PLANE if level:
            return ground()
        case kinds.mjGEOM_PLANE:  # a size of 0 means infinite
            extent = 2 * float(m.stat.extent)
            return coal.Box(2 * a or extent, 2 * b or extent, extent * COARSE)
        case kinds.mjGEOM_MESH:
            i = int(m.geom_dataid[g])
            if i not in meshes:
                points = m.mesh_vert[m.mesh_vertadr[i] :][: m.mesh_vertnum[i]]
                meshes[i] = mesh(points, m.mesh_face[m.mesh_faceadr[i] :][: m.mesh_facenum[i]])
            return meshes[i]
    return None
