"""Meshes: file contents, which preserve colours and textures, or triangles."""

import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import coal
import numpy as np

from ...errors import InputError
from ..allowed_paths import package_of
from .mesh_points import points_of
from .shapes import mesh

FILE_FORMATS = ("dae", "obj", "stl")
LIBRARY = rb"^[ \t]*mtllib[ \t]+(.+?)\s*$"
KEYWORDS = rb"newmtl|K[adse]|N[si]|d|T[rf]|illum|sharpness|P[rmsc]|Pcr|aniso\w*|map_\w+|bump|disp|decal|norm|refl"
MATERIAL = re.compile(rb"^[ \t]*(?:" + KEYWORDS + rb")[ \t].*$", re.MULTILINE)
IMAGES = (b"\x89PNG\r\n", b"\xff\xd8\xff", b"GIF8", b"II*\0", b"MM\0*")  # first bytes of images


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, as file bytes or as arrays; bodies with the same mesh share the object.

    Attributes:
        format: ``"dae"``, ``"obj"`` or ``"stl"`` for the bytes of a file, ``"triangles"`` for arrays.
        data: the file's bytes, empty for arrays.
        companions: referenced files (material libraries, textures) by the name used in the mesh; empty if missing.
        vertices: (n, 3) for arrays [m], otherwise empty.
        faces: (m, 3) indices into ``vertices``, otherwise empty.
    """

    format: str
    data: bytes = b""
    companions: Mapping[str, bytes] = field(default_factory=dict)
    vertices: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    faces: np.ndarray = field(default_factory=lambda: np.empty((0, 3), dtype=int))


def read_mesh(name: str, path: Path, root: Path | None = None) -> Mesh:
    """Read a mesh file whose format is one of ``FILE_FORMATS``, and the files that it references.

    Args:
        name: name of the visual, for messages.
        path: the file.
        root: folder of the files to which it may refer; its package if omitted.

    Returns:
        The mesh; a material library or texture that is missing, outside ``root`` or invalid becomes empty, with a
        warning. Only the materials of a material library are kept.

    Raises:
        InputError: the file cannot be read.
    """
    kind = path.suffix[1:].lower()
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"visual {name!r}: cannot read {path}: {error.strerror}") from error
    companions: dict[str, bytes] = {}
    root = root or package_of(path.resolve().parent)
    if kind == "dae":
        _add_companions(companions, path, root, rb"<init_from>([^<]+\.\w+)</init_from>", data, _image)
    elif kind == "obj":
        _add_companions(companions, path, root, LIBRARY, data, _materials)
        for library in list(companions.values()):
            _add_companions(companions, path, root, rb"^\s*map_\w+[ \t]+(.+?)\s*$", library, _image)
    missing = sorted(companion for companion, found in companions.items() if not found)
    if missing:
        warnings.warn(f"visual {name!r} is drawn without {', '.join(missing)}: not found with the mesh", stacklevel=2)
    return Mesh(kind, data, companions)


def triangles(name: str, geometry: coal.CollisionGeometry) -> Mesh:
    """Return the triangles of a coal geometry.

    Args:
        name: name of the visual, for messages.
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
        raise InputError(f"visual {name!r} is a {type(geometry).__name__} and cannot be drawn; valid: {valid}")
    faces = np.array([[face(k)[i] for i in range(3)] for k in range(count)], dtype=int)
    return Mesh("triangles", vertices=np.array(vertices), faces=faces)


def placeholder(path: Path, scale: np.ndarray) -> coal.BVHModelOBBRSS:
    """Return a geometry with the bounds of a scaled mesh file, including points without a face.

    Raises:
        InputError: for a file that is damaged, or of a format that cannot be drawn.
    """
    if path.suffix[1:].lower() not in FILE_FORMATS:
        raise InputError(f"mesh {path.name!r} is not drawn; known: {', '.join('.' + f for f in FILE_FORMATS)}")
    stat = path.stat()
    corners = _bounds(path, stat.st_mtime_ns, stat.st_size) * scale
    low, high = corners.min(axis=0), corners.max(axis=0)
    return mesh(np.array([low, [low[0], high[1], high[2]], high]), np.array([[0, 1, 2]]))


@lru_cache(maxsize=1000)
def _bounds(path: Path, changed: int, size: int) -> np.ndarray:
    """Return the smallest and the largest coordinates of a mesh file, (2, 3); a changed file is read again."""
    points = points_of(path)
    return np.array([points.min(axis=0), points.max(axis=0)])


def _add_companions(
    companions: dict[str, bytes], path: Path, root: Path, pattern: bytes, text: bytes, extract: Callable[[bytes], bytes]
) -> None:
    for found in re.findall(pattern, text, re.MULTILINE):
        name = found.decode("utf-8", errors="replace")
        file = _companion(path, root, name)
        companions[name] = extract(file.read_bytes()) if file else b""


def _companion(path: Path, root: Path, name: str) -> Path | None:
    """Return the file below a folder to which a name in a mesh refers."""
    try:
        file = (path.parent / name).resolve()
        return file if file.is_file() and file.is_relative_to(root) else None
    except (OSError, ValueError, RuntimeError):  # not a path, or circular links
        return None


def _materials(data: bytes) -> bytes:
    return b"\n".join(MATERIAL.findall(data))


def _image(data: bytes) -> bytes:
    bitmap = data.startswith(b"BM") and int.from_bytes(data[2:6], "little") == len(data)
    return data if data.startswith(IMAGES) or bitmap or (data[:4], data[8:12]) == (b"RIFF", b"WEBP") else b""
