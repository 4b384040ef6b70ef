"""Shapes as the objects of three.js that meshcat's viewer reads."""

import base64
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
import umsgpack

from ...mechanism.scene.surfaces import surfaces

if TYPE_CHECKING:
    from ...mechanism.scene.scene import Mesh, Shape

Y_TO_Z = np.array(
    [[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
)  # three.js has y as the axis of revolution
MIME = {".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".gif": "image/gif"}  # all others: png
WHITE = "data:image/gif;base64,R0lGODlhAQABAIAAAP///wAAACwAAAAAAQABAAACAkQBADs="  # for missing textures
EXTENSION = {  # msgpack types of the arrays of JavaScript
    "uint8": 0x12, "uint16": 0x14, "int32": 0x15, "uint32": 0x16, "float32": 0x17, "float64": 0x18,
}  # fmt: skip


def typed(values: Any, dtype: str) -> umsgpack.Ext:
    """Return a flattened numpy array as a typed array of JavaScript; dtype is a key of ``EXTENSION``."""
    return umsgpack.Ext(EXTENSION[dtype], np.ascontiguousarray(values, dtype=dtype).tobytes())


def node(shape: "Shape") -> str:
    """Return the path of a shape in the viewer's tree."""
    return f"/mechanism/{shape.role}/{shape.name.replace('/', '|')}"


def mesh_data(mesh: "Mesh") -> dict[str, Any]:
    """Return the data of a mesh for the page: triangles, by colour, or its file if it has textures.

    Points are 16 bits for each axis, in fractions of their bounding box: 1e-5 of its edges. Corners of triangles
    are indices of points, each as the difference to the one before.
    """
    if found := surfaces(mesh):
        low, high = (f([f(s.points, axis=0) for s in found], axis=0) for f in (np.min, np.max))
        span = np.where(high > low, high - low, 1.0)
        points = np.concatenate([np.rint((s.points - low) / span * 65535) for s in found])
        starts = np.cumsum([0, *(len(s.points) for s in found)])
        faces = [s.faces.ravel() + start for s, start in zip(found, starts[:-1], strict=True)]
        ends = np.cumsum([0, *map(len, faces)]).tolist()
        return {
            "low": low.tolist(),
            "high": (low + span).tolist(),
            "points": typed(points, "uint16"),
            "corners": typed(np.diff(np.concatenate(faces), prepend=0), "int32"),
            "parts": [
                {"start": start, "count": end - start, "rgba": s.rgba and list(s.rgba)}
                for s, start, end in zip(found, ends[:-1], ends[1:], strict=True)
            ],
        }
    if mesh.format == "stl":
        return {"data": typed(np.frombuffer(mesh.data, dtype="uint8"), "uint8")}
    images, more = {}, {}
    for name, data in mesh.companions.items():
        suffix = PurePath(name).suffix.lower()
        if suffix == ".mtl":
            more["mtl_library"] = _text(data)
        else:
            image = base64.b64encode(data).decode("ascii")
            images[name] = f"data:{MIME.get(suffix, 'image/png')};base64,{image}" if data else WHITE
    return {"data": _text(mesh.data), "resources": images, **more}


def scene_object(shape: "Shape", meshes: list["Mesh"], layer: int = 0) -> dict[str, Any]:
    """Return a shape in three.js' JSON; ``mesh`` is an index of ``meshes``, for `mesh_data`.

    Args:
        shape: the shape to draw.
        meshes: the meshes of the scene.
        layer: closures are drawn over everything else, in the order of layers.

    Returns:
        The object with its geometry and material, all strings, numbers and lists.
    """
    matrix = np.diag([*shape.scale, 1.0])
    body: dict[str, Any] = {"uuid": shape.name, "type": "Mesh"}
    parts: dict[str, Any] = {"metadata": {"version": 4.5, "type": "Object"}, "object": body}
    if shape.mesh is not None and shape.rgba is None:
        body |= {"type": "_meshfile_object", "format": shape.mesh.format, "mesh": meshes.index(shape.mesh)}
    else:
        geometry, turned = _geometry(shape, meshes)
        matrix = turned @ matrix
        body |= {"geometry": "geometry", "material": "material", "renderOrder": layer}
        if shape.mesh is not None:
            body["rgba"] = list(shape.rgba or ())
        parts["geometries"] = [{"uuid": "geometry", **geometry}]
        parts["materials"] = [{"uuid": "material", **_material(shape)}]
    body["matrix"] = matrix.T.ravel().tolist()
    return parts


def _geometry(shape: "Shape", meshes: list["Mesh"]) -> tuple[dict[str, Any], np.ndarray]:
    """Return the geometry, and the (4, 4) transform to the shape's frame."""
    size = [float(s) for s in shape.size]
    if shape.mesh is not None:
        kind = {"type": "_meshfile_geometry", "format": shape.mesh.format}
        return {**kind, "mesh": meshes.index(shape.mesh)}, np.eye(4)
    if shape.kind == "box":
        return {"type": "BoxGeometry", "width": size[0], "height": size[1], "depth": size[2]}, np.eye(4)
    if shape.kind in ("sphere", "ellipsoid"):
        ball = {"type": "SphereGeometry", "radius": 1.0, "widthSegments": 40, "heightSegments": 28}
        return ball, np.diag([*(size * 3 if shape.kind == "sphere" else size), 1.0])
    radius, length = size
    if shape.kind == "capsule":
        angle = np.linspace(-np.pi / 2, np.pi / 2, 24)
        x, y = radius * np.cos(angle), radius * np.sin(angle) + np.sign(angle) * length / 2
        profile = [{"x": float(a), "y": float(b)} for a, b in zip(x, y, strict=True)]
        return {"type": "LatheGeometry", "points": profile, "segments": 40}, Y_TO_Z
    top = 0.0 if shape.kind == "cone" else radius
    round_ = {"type": "CylinderGeometry", "radiusTop": top, "radiusBottom": radius, "height": length}
    return {**round_, "radialSegments": 72}, Y_TO_Z


def _material(shape: "Shape") -> dict[str, Any]:
    red, green, blue, alpha = shape.rgba or (0.7, 0.7, 0.7, 1.0)
    colour = int.from_bytes(bytes(round(255 * c) for c in (red, green, blue)), "big")
    material = {"type": "MeshPhongMaterial", "color": colour, "opacity": alpha, "transparent": alpha < 1}
    if shape.role == "closure":  # drawn over the bodies that hide it
        return {**material, "depthTest": False, "transparent": True}
    return {**material, "side": 2, "shininess": 40, "specular": 0x1C1C1C}


def _text(data: bytes) -> str:
    return data.decode("utf-8", errors="replace")
