"""Meshes: the bytes of their files, so that colours and textures survive, or else their triangles."""

import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import coal
import numpy as np

from ..errors import InputError

FILE_FORMATS = ("dae", "obj", "stl")


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, as their file has them or as arrays; bodies that share a mesh share the object.

    Attributes:
        format: ``"dae"``, ``"obj"`` or ``"stl"`` for the bytes of a file, ``"triangles"`` for arrays.
        data: the file's bytes, empty for arrays.
        companions: what the file refers to (material libraries, textures) by the name it uses; empty for
            what is missing.
        vertices: (n, 3) for arrays [m], otherwise empty.
        faces: (m, 3) indices into ``vertices``, otherwise empty.
    """

    format: str
    data: bytes = b""
    companions: Mapping[str, bytes] = field(default_factory=dict)
    vertices: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    faces: np.ndarray = field(default_factory=lambda: np.empty((0, 3), dtype=int))


def read_mesh(name: str, path: Path) -> Mesh:
    """Reads a mesh file whose format is one of ``FILE_FORMATS``, and what it refers to.

    Args:
        name: of the visual, for messages.
        path: the file.

    Returns:
        The mesh; a material library or texture that is missing is empty, and warned of.

    Raises:
        InputError: the file cannot be read.
    """
    kind = path.suffix[1:].lower()
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"visual {name!r}: cannot read {path}: {error.strerror}") from error
    companions: dict[str, bytes] = {}
    if kind == "dae":
        _add_companions(companions, path, rb"<init_from>([^<]+\.\w+)</init_from>", data)
    elif kind == "obj":
        _add_companions(companions, path, rb"^mtllib[ \t]+(.+?)\s*$", data)
        for library in list(companions.values()):
            _add_companions(companions, path, rb"^\s*map_\w+[ \t]+(.+?)\s*$", library)
    missing = sorted(companion for companion, found in companions.items() if not found)
    if missing:
        warnings.warn(f"visual {name!r} is drawn without {', '.join(missing)}: not found", stacklevel=2)
    return Mesh(kind, data, companions)


def triangles(name: str, geometry: coal.CollisionGeometry) -> Mesh:
    """Takes the triangles that coal holds.

    Args:
        name: of the visual, for messages.
        geometry: a mesh or a convex body.

    Returns:
        The mesh as arrays.

    Raises:
        InputError: the geometry has no triangles.
    """
    if isinstance(geometry, coal.BVHModelBase):
        vertices, count, face = geometry.vertices(), geometry.num_tris, geometry.tri_indices
    elif isinstance(geometry, coal.Convex):
        vertices, count, face = geometry.points(), geometry.num_polygons, geometry.polygons
    else:
        valid = "box, sphere, ellipsoid, cylinder, cone, capsule, mesh"
        raise InputError(
            f"visual {name!r} is a {type(geometry).__name__} and cannot be drawn; valid: {valid}"
        )
    faces = np.array([[face(k)[i] for i in range(3)] for k in range(count)], dtype=int)
    return Mesh("triangles", vertices=np.array(vertices), faces=faces)


def _add_companions(companions: dict[str, bytes], path: Path, pattern: bytes, text: bytes) -> None:
    for found in re.findall(pattern, text, re.MULTILINE):
        name = found.decode("utf-8", errors="replace")
        file = path.parent / name
        companions[name] = file.read_bytes() if file.is_file() else b""
