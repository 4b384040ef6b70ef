"""Triangles of meshes with their colours and textures, and the normals of smooth surfaces."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from ...tolerances import TINY
from .mesh_points import Collada, stl_points
from .meshes import Mesh

Colour = tuple[float, ...]  # red, green, blue, opacity
CORNER = re.compile(rb"(-?\d+)(?:/(-?\d+))?\S*")
COS_CREASE_ANGLE = np.cos(0.6)  # cosine of the largest angle between triangles of a smooth surface
WHITE = (1.0, 1.0, 1.0, 1.0)


class Material(NamedTuple):
    """Colour of a material, None if the mesh does not define it, and the name of its texture, empty for none."""

    rgba: Colour | None = None
    texture: str = ""


class TriangleGroup(NamedTuple):
    """Triangles of one material: corners (m, 3, 3), its material, and texture coordinates (m, 3, 2) or None."""

    corners: np.ndarray
    material: Material = Material()
    uv: np.ndarray | None = None


class Surface(NamedTuple):
    """Triangles of one colour or texture.

    Attributes:
        points: points (n, 3), in the units and axes of the mesh.
        faces: indices of the points of each triangle, (m, 3).
        rgba: red, green, blue and opacity in [0, 1]; None if the mesh does not define it.
        uv: texture coordinates of the corners, (m, 3, 2), from the lower left of the image; None without a texture.
        image: bytes of the texture's file, empty for none.
    """

    points: np.ndarray
    faces: np.ndarray
    rgba: Colour | None
    uv: np.ndarray | None = None
    image: bytes = b""


def surfaces(mesh: Mesh) -> list[Surface] | None:
    """Return the triangles of a mesh, one entry per colour or texture; None for a damaged or empty mesh.

    Coincident points are merged, triangles with coincident corners are omitted.
    """
    try:
        found = list(_read(mesh))
    except (ValueError, LookupError, AttributeError, TypeError, ArithmeticError, ET.ParseError, RecursionError):
        return None
    merged: dict[Material, list[TriangleGroup]] = {}
    for group in found:
        image = mesh.companions.get(group.material.texture) if group.uv is not None else None
        material = group.material if image else Material(WHITE if group.material.texture else group.material.rgba)
        merged.setdefault(material, []).append(group)
    return [s for material, groups in merged.items() if len((s := _surface(material, groups, mesh)).faces)] or None


def _surface(material: Material, groups: list[TriangleGroup], mesh: Mesh) -> Surface:
    out, valid = _welded(np.concatenate([group.corners for group in groups]))
    if not material.texture:
        return out._replace(rgba=material.rgba)
    uv = np.concatenate([group.uv for group in groups if group.uv is not None])
    return out._replace(rgba=WHITE, uv=uv[valid], image=mesh.companions[material.texture])


def welded(corners: np.ndarray, rgba: Colour | None) -> Surface:
    """Return triangles with corners (m, 3, 3) as a surface of distinct points, in the order of use."""
    return _welded(corners)[0]._replace(rgba=rgba)


def _welded(corners: np.ndarray) -> tuple[Surface, np.ndarray]:
    """Return the surface, and whether each triangle has three different corners, (m,)."""
    all_points = corners.reshape(-1, 3).astype("float32") + 0.0
    order = np.lexsort(all_points.T)  # equal points are adjacent, in the order of use
    new = np.append(True, (all_points[order[1:]] != all_points[order[:-1]]).any(1))[: len(order)]
    first = order[new]  # first use of each point, ordered by coordinates
    used = np.argsort(first)
    rank = np.empty(len(used), int)
    rank[used] = np.arange(len(used))
    index = np.empty(len(order), int)
    index[order] = rank[np.cumsum(new) - 1]
    faces = index.reshape(-1, 3)
    a, b, c = faces.T
    valid = (a != b) & (b != c) & (c != a)
    return Surface(all_points[first[used]], faces[valid], None), valid


def normals(surface: Surface) -> np.ndarray:
    """Return unit normals (3 m, 3) at the corners of triangles, averaged over the smooth surface around each point."""
    a, b, c = surface.points[surface.faces].astype(float).swapaxes(0, 1)
    area = np.cross(b - a, c - a)
    sizes = np.linalg.norm(area, axis=1)
    unit = np.where(sizes[:, None] > 0, area / np.maximum(sizes, TINY)[:, None], [0.0, 0.0, 1.0])
    point = surface.faces.ravel()
    order, count = np.argsort(point, kind="stable"), np.bincount(point)
    first = np.cumsum(count) - count
    corner = np.repeat(np.arange(len(point)), count[point])  # paired with every corner at the same point
    within = np.arange(len(corner)) - np.repeat(np.cumsum(count[point]) - count[point], count[point])
    current, other = corner // 3, order[first[point[corner]] + within] // 3
    smooth = np.einsum("ij,ij->i", unit[current], unit[other]) > COS_CREASE_ANGLE
    sums = np.column_stack([np.bincount(corner[smooth], area[other[smooth], k], len(point)) for k in range(3)])
    sizes = np.linalg.norm(sums, axis=1)
    return np.where(sizes[:, None] > 0, sums / np.maximum(sizes, TINY)[:, None], unit[np.arange(len(point)) // 3])


def _read(mesh: Mesh) -> Iterator[TriangleGroup]:
    if mesh.format == "triangles":
        yield TriangleGroup(np.asarray(mesh.vertices)[np.asarray(mesh.faces)])
    elif mesh.format == "stl":
        yield TriangleGroup(stl_points(mesh.data).reshape(-1, 3, 3))
    elif mesh.format == "obj":
        yield from _obj(mesh)
    else:
        yield from _ColouredCollada(ET.fromstring(mesh.data)).triangles()


def _library_materials(libraries: Mapping[str, bytes]) -> dict[bytes, Material]:
    """Return the diffuse colours and textures of the materials in .mtl files."""
    materials: dict[bytes, Material] = {}
    for file, library in libraries.items():
        if not file.lower().endswith(".mtl"):
            continue
        for name, text in re.findall(rb"newmtl[ \t]+(\S+)(.*?)(?=newmtl|\Z)", library, re.DOTALL):
            rgba, image = None, re.search(rb"^\s*map_Kd[ \t]+(.+?)\s*$", text, re.MULTILINE)
            if kd := re.search(rb"\bKd[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", text):
                opacity = re.search(rb"^[ \t]*d[ \t]+(\S+)", text, re.MULTILINE)
                rgba = (*map(float, kd.groups()), float(opacity[1]) if opacity else 1.0)
            materials[name] = Material(rgba, image[1].decode("utf-8", errors="replace") if image else "")
    return materials


def _obj(mesh: Mesh) -> Iterator[TriangleGroup]:
    materials = _library_materials(mesh.companions)
    points: list[list[float]] = []
    uv: list[list[float]] = []
    groups: dict[Material, list[list[tuple[int, int | None]]]] = {}
    faces = groups.setdefault(Material(), [])
    for line in mesh.data.splitlines():
        word, _, rest = line.strip().partition(b" ")
        if word == b"v":
            points.append([float(x) for x in rest.split()[:3]])
        elif word == b"vt":
            uv.append([float(x) for x in rest.split()[:2]])
        elif word == b"usemtl":
            faces = groups.setdefault(materials.get(rest.strip(), Material()), [])
        elif word == b"f":
            corners = [CORNER.match(text).groups() for text in rest.split()]  # type: ignore[union-attr]
            used = [(_index(p, points), None if t is None else _index(t, uv)) for p, t in corners]
            faces += [[used[0], used[k], used[k + 1]] for k in range(1, len(used) - 1)]
    for material, found in groups.items():
        if found:
            yield _textured(material, np.array(found, float), np.array(points), np.array(uv))


def _textured(material: Material, index: np.ndarray, points: np.ndarray, uv: np.ndarray) -> TriangleGroup:
    """Return triangles from indices (m, 3, 2) of points and of texture coordinates, NaN if there are none."""
    corners = points[index[:, :, 0].astype(int)]
    if not material.texture or np.isnan(index).any():
        return TriangleGroup(corners, material)
    return TriangleGroup(corners, material, uv[index[:, :, 1].astype(int)])


def _index(text: bytes, listed: list[list[float]]) -> int:
    """Return an index of a .obj file, starting from zero; negative indices count from the last entry so far."""
    return int(text) - 1 if int(text) > 0 else len(listed) + int(text)


class _ColouredCollada(Collada):
    """A .dae file with the colours and textures of its materials."""

    def triangles(self) -> Iterator[TriangleGroup]:
        """Yield each group of triangles, at its placement in the scene."""
        for geometry, placement, materials in self.instances():
            for corners, uv, symbol in self._groups(geometry):
                material = self._material_of(materials.get(symbol, symbol))
                yield TriangleGroup(corners @ placement[:3, :3].T + placement[:3, 3], material, uv)

    def _material_of(self, name: str) -> Material:
        material = self.by_id.get(name)
        if material is None:
            return Material()
        effect = self.by_id.get(material.find("instance_effect").get("url", "")[1:])  # type: ignore[union-attr]
        if effect is None:
            return Material()
        if (texture := effect.find(".//diffuse/texture")) is not None:
            return Material(WHITE, self._image(effect, texture.get("texture", "")))
        found = {kind: effect.find(f".//{kind}/color") for kind in ("diffuse", "emission")}
        rgb = np.zeros(3)
        for colour in found.values():
            if colour is not None:
                rgb = rgb + np.array((colour.text or "").split(), float)[:3]
        if all(colour is None for colour in found.values()):
            return Material()
        return Material((*(float(x) for x in np.clip(rgb, 0, 1)), 1.0))

    def _image(self, effect: ET.Element, name: str) -> str:
        """Return the image file of a texture, which refers to it directly or by a sampler of a surface."""
        parameters = {x.get("sid", ""): x for x in effect.iter("newparam")}
        for key in ("sampler2D/source", "surface/init_from"):
            if name in parameters:
                name = (parameters[name].findtext(key) or name).strip()
        image = self.by_id.get(name)
        return (image.findtext("init_from") or "").strip() if image is not None else ""

    def _groups(self, geometry: ET.Element) -> Iterator[tuple[np.ndarray, np.ndarray | None, str]]:
        """Yield triangles (m, 3, 3), texture coordinates (m, 3, 2) and symbol of the material of each group."""
        points = self.points_of(geometry)
        for group in geometry.iterfind("mesh/*"):
            if group.tag not in ("triangles", "polylist", "polygons"):
                continue
            inputs = {x.get("semantic"): x for x in reversed(group.findall("input"))}
            offsets = [int(x.get("offset", "0")) for x in group.iterfind("input")]
            texture = inputs.get("TEXCOORD")
            used = [inputs["VERTEX"], *([] if texture is None else [texture])]
            corners = _fans(group, max(offsets) + 1, [int(x.get("offset", "0")) for x in used])
            if len(corners):
                uv = None if texture is None else self._values(texture)[corners[:, :, 1]]
                yield points[corners[:, :, 0]], uv, group.get("material", "")

    def _values(self, source: ET.Element) -> np.ndarray:
        """Return texture coordinates, (n, 2)."""
        found = self._target(source, "source")
        accessor = found.find("technique_common/accessor")
        stride = int(accessor.get("stride", "2")) if accessor is not None else 2
        values = np.array((found.findtext("float_array") or "").split(), float)
        return values[: len(values) // stride * stride].reshape(-1, stride)[:, :2]


def _fans(group: ET.Element, stride: int, offsets: list[int]) -> np.ndarray:
    """Return indices (m, 3, len(offsets)) of the triangles of a group; polygons become triangle fans."""
    lists = [np.array((p.text or "").split(), int).reshape(-1, stride)[:, offsets] for p in group.iterfind("p")]
    if group.tag == "triangles":
        return np.concatenate(lists).reshape(-1, 3, len(offsets)) if lists else np.empty((0, 3, len(offsets)), int)
    if group.tag == "polylist":
        counts = (group.findtext("vcount") or "").split()
        lists = np.split(lists[0], np.cumsum(np.array(counts, int))[:-1])
    fans = [[p[0], p[k], p[k + 1]] for p in lists for k in range(1, len(p) - 1)]
    return np.array(fans, int).reshape(-1, 3, len(offsets))
