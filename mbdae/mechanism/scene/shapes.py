"""Visual geometry as JSON data, independent of its files."""

import base64
import zlib
from typing import Annotated, Literal

import coal
import numpy as np
import pinocchio as pin
from pydantic import Field, ValidationError

from ...data_types import JsonObject
from ...errors import InputError
from ...tolerances import COINCIDENT
from ..checked_table import Table, one_line

PlacementEntries = Annotated[tuple[float, ...], Field(min_length=12, max_length=12)]
SOLIDS = {  # shape class, sizes, and number of sizes by kind
    "sphere": (coal.Sphere, lambda s: [s.radius], 1),
    "capsule": (coal.Capsule, lambda s: [s.radius, 2 * s.halfLength], 2),
    "cylinder": (coal.Cylinder, lambda s: [s.radius, 2 * s.halfLength], 2),
    "ellipsoid": (coal.Ellipsoid, lambda s: list(s.radii), 3),
    "box": (coal.Box, lambda s: list(2 * s.halfSide), 3),
}
MIN_LEVEL_COSINE = 1 - COINCIDENT  # cosine of the inclination, up to which a plane counts as horizontal
UP = np.array([0.0, 0.0, 1.0])
MAX_BYTES = 2**28  # bytes of points or faces: packed data may expand to a thousand times its size
Size = Annotated[float, Field(ge=0)]


class _Mesh(Table):
    points: str
    faces: str


class _Shape(Table):
    name: str
    joint: int = Field(ge=0)
    placement: PlacementEntries
    rgba: tuple[float, float, float, float]
    kind: Literal["sphere", "capsule", "cylinder", "ellipsoid", "box", "plane", "mesh"]
    size: tuple[Size, ...] = ()
    mesh: int | None = Field(default=None, ge=0)


class _Visuals(Table):
    shapes: tuple[_Shape, ...]
    meshes: tuple[_Mesh, ...]


def pack(visuals: pin.GeometryModel) -> JsonObject:
    """Return solids and triangle meshes as data; a mesh shared by several shapes is stored once."""
    shapes: list[JsonObject] = []
    meshes: list[dict[str, str]] = []
    indices: dict[tuple[str, str], int] = {}
    for g in visuals.geometryObjects:
        shape: JsonObject = {
            "name": g.name,
            "joint": int(g.parentJoint),
            "placement": g.placement.homogeneous[:3].ravel().tolist(),
            "rgba": g.meshColor.tolist(),
        }
        kind = next((k for k, (cls, *_) in SOLIDS.items() if isinstance(g.geometry, cls)), "")
        if isinstance(g.geometry, coal.Halfspace):
            shape |= {"kind": "plane"}
        elif kind:
            shape |= {"kind": kind, "size": [float(x) for x in SOLIDS[kind][1](g.geometry)]}
        else:
            points = g.geometry.vertices()
            faces = [[g.geometry.tri_indices(k)[i] for i in range(3)] for k in range(g.geometry.num_tris)]
            mesh = {"points": _packed(points, "<f4"), "faces": _packed(faces, "<i4")}
            index = indices.setdefault((mesh["points"], mesh["faces"]), len(meshes))
            if index == len(meshes):
                meshes.append(mesh)
            shape |= {"kind": "mesh", "mesh": index}
        shapes.append(shape)
    return {"shapes": shapes, "meshes": meshes}


def unpack(data: JsonObject, joints: int) -> pin.GeometryModel:
    """Return the geometry from the data of `pack`; ``joints`` is the number of joints.

    Raises:
        InputError: for an invalid entry.
    """
    try:
        visuals = _Visuals.model_validate(data)
    except ValidationError as e:
        raise InputError(f"visuals: {one_line(e, lambda path: [])}") from None
    meshes = [_mesh(m) for m in visuals.meshes]
    out = pin.GeometryModel()
    for s in visuals.shapes:
        if s.joint >= joints:
            raise InputError(f"visuals: {s.name!r} is on joint {s.joint}, which does not exist")
        if s.kind == "mesh":
            if s.mesh is None or s.mesh >= len(meshes):
                raise InputError(f"visuals: {s.name!r} is mesh {s.mesh}, which does not exist")
            geometry = meshes[s.mesh]
        elif s.kind == "plane":
            geometry = ground()
        else:
            solid, _, count = SOLIDS[s.kind]
            if len(s.size) != count:
                raise InputError(f"visuals: {s.name!r} has {len(s.size)} sizes, a {s.kind} has {count}")
            geometry = solid(*s.size)
        placement = np.array(s.placement).reshape(3, 4)
        g = pin.GeometryObject(s.name, s.joint, pin.SE3(placement[:, :3], placement[:, 3]), geometry)
        g.meshColor = np.array(s.rgba)
        out.addGeometryObject(g)
    return out


def ground() -> coal.Halfspace:
    """Return the half-space below the x-y plane of a frame."""
    return coal.Halfspace(UP, 0.0)


def ground_level(g: pin.GeometryObject) -> float | None:
    """Return the height of a fixed horizontal plane [m]; None for other geometry."""
    if not isinstance(g.geometry, coal.Halfspace) or g.parentJoint:
        return None
    if (g.placement.rotation @ g.geometry.n)[2] < MIN_LEVEL_COSINE:
        return None
    return float(g.placement.act(g.geometry.n * g.geometry.d)[2])


def mesh(points: np.ndarray, faces: np.ndarray) -> coal.BVHModelOBBRSS:
    """Return a mesh of points (n, 3) in m and faces (m, 3)."""
    out = coal.BVHModelOBBRSS()
    out.beginModel(len(faces), len(points))
    out.addVertices(np.array(points, float))
    out.addTriangles(np.array(faces, int))
    out.endModel()
    return out


def _packed(array: object, kind: str) -> str:
    return base64.b85encode(zlib.compress(np.asarray(array, kind).tobytes())).decode()


def _mesh(packed: _Mesh) -> coal.BVHModelOBBRSS:
    points, faces = _unpacked(packed.points, "<f4"), _unpacked(packed.faces, "<i4")
    if not np.isfinite(points).all() or (len(faces) and not 0 <= faces.min() <= faces.max() < len(points)):
        text = f"a mesh of {len(points)} points has faces with other points, or points that are not finite"
        raise InputError(f"visuals: {text}")
    return mesh(points, faces)


def _unpacked(text: str, kind: str) -> np.ndarray:
    """Return rows of three numbers.

    Raises:
        InputError: for invalid text, or more than `MAX_BYTES` bytes.
    """
    stream = zlib.decompressobj()
    try:
        data = stream.decompress(base64.b85decode(text), MAX_BYTES)
    except (ValueError, zlib.error) as e:
        raise InputError(f"visuals: a mesh cannot be unpacked: {e}") from None
    if not stream.eof or len(data) % 12:
        raise InputError(f"visuals: a mesh is cut off, or has more than {MAX_BYTES} bytes")
    return np.frombuffer(data, kind).reshape(-1, 3)
