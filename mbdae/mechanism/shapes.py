"""Visual geometry as plain JSON data, without the files that it came from."""

import base64
import zlib
from typing import Any

import coal
import numpy as np
import pinocchio as pin

SOLIDS = {  # kind: the shape of sizes, and its sizes
    "sphere": (coal.Sphere, lambda s: [s.radius]),
    "capsule": (coal.Capsule, lambda s: [s.radius, 2 * s.halfLength]),
    "cylinder": (coal.Cylinder, lambda s: [s.radius, 2 * s.halfLength]),
    "ellipsoid": (coal.Ellipsoid, lambda s: list(s.radii)),
    "box": (coal.Box, lambda s: list(2 * s.halfSide)),
}


def pack(visuals: pin.GeometryModel) -> dict[str, Any]:
    """Write solids and triangle meshes down; a mesh that several shapes share stands once."""
    shapes: list[dict[str, Any]] = []
    meshes: list[dict[str, str]] = []
    numbers: dict[tuple[str, str], int] = {}
    for g in visuals.geometryObjects:
        shape: dict[str, Any] = {
            "name": g.name,
            "joint": int(g.parentJoint),
            "placement": g.placement.homogeneous[:3].ravel().tolist(),
            "rgba": g.meshColor.tolist(),
        }
        kind = next((k for k, (cls, _) in SOLIDS.items() if isinstance(g.geometry, cls)), "")
        if kind:
            shape |= {"kind": kind, "size": [float(x) for x in SOLIDS[kind][1](g.geometry)]}
        else:
            points = g.geometry.vertices()
            faces = [[g.geometry.tri_indices(k)[i] for i in range(3)] for k in range(g.geometry.num_tris)]
            mesh = {"points": _packed(points, "<f4"), "faces": _packed(faces, "<i4")}
            number = numbers.setdefault((mesh["points"], mesh["faces"]), len(meshes))
            if number == len(meshes):
                meshes.append(mesh)
            shape |= {"kind": "mesh", "mesh": number}
        shapes.append(shape)
    return {"shapes": shapes, "meshes": meshes}


def unpack(data: dict[str, Any]) -> pin.GeometryModel:
    """Read what `pack` wrote."""
    meshes = [mesh(_unpacked(m["points"], "<f4"), _unpacked(m["faces"], "<i4")) for m in data["meshes"]]
    out = pin.GeometryModel()
    for s in data["shapes"]:
        geometry = meshes[s["mesh"]] if s["kind"] == "mesh" else SOLIDS[s["kind"]][0](*s["size"])
        place = np.array(s["placement"]).reshape(3, 4)
        g = pin.GeometryObject(s["name"], s["joint"], pin.SE3(place[:, :3], place[:, 3]), geometry)
        g.meshColor = np.array(s["rgba"])
        out.addGeometryObject(g)
    return out


def mesh(points: np.ndarray, faces: np.ndarray) -> coal.BVHModelOBBRSS:
    """A mesh of points (n, 3) in m and faces (m, 3)."""
    out = coal.BVHModelOBBRSS()
    out.beginModel(len(faces), len(points))
    out.addVertices(np.array(points, float))
    out.addTriangles(np.array(faces, int))
    out.endModel()
    return out


def _packed(array: Any, kind: str) -> str:
    return base64.b85encode(zlib.compress(np.asarray(array, kind).tobytes())).decode()


def _unpacked(text: str, kind: str) -> np.ndarray:
    return np.frombuffer(zlib.decompress(base64.b85decode(text)), kind).reshape(-1, 3)
