"""Triangles of meshes with their colours; normals and textures of files are ignored."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from .mesh_points import TRIANGLE, Collada
from .meshes import Mesh

Colour = tuple[float, ...]  # red, green, blue, opacity
CORNER = re.compile(rb"(-?\d+)\S*")


class Surface(NamedTuple):
    """Triangles of one colour.

    Attributes:
        points: (n, 3), in the units and axes of the mesh.
        faces: (m, 3) indices into them.
        rgba: red, green, blue and opacity in [0, 1]; None if the mesh does not define it.
    """

    points: np.ndarray
    faces: np.ndarray
    rgba: Colour | None


def surfaces(mesh: Mesh, *, pictures: bool = False) -> list[Surface] | None:
    """Return the triangles of a mesh, one entry per colour; None for damaged or textured meshes.

    Coincident points are merged, triangles without area are omitted.

    Args:
        mesh: the mesh.
        pictures: whether to accept a textured mesh, without its textures.
    """
    if not pictures and any(not name.lower().endswith(".mtl") and data for name, data in mesh.companions.items()):
        return None
    try:
        found = list(_read(mesh))
    except (ValueError, LookupError, AttributeError, TypeError, ArithmeticError, ET.ParseError, RecursionError):
        return None
    merged: dict[Colour | None, list[np.ndarray]] = {}
    for corners, rgba in found:
        merged.setdefault(rgba, []).append(corners)
    found_surfaces = [welded(np.concatenate(corners), rgba) for rgba, corners in merged.items()]
    return [s for s in found_surfaces if len(s.faces)] or None


def welded(corners: np.ndarray, rgba: Colour | None) -> Surface:
    """Return triangles with corners (m, 3, 3) as a surface of distinct points, in the order of use."""
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
    return Surface(all_points[first[used]], faces[(a != b) & (b != c) & (c != a)], rgba)


def _read(mesh: Mesh) -> Iterator[tuple[np.ndarray, Colour | None]]:
    if mesh.format == "triangles":
        yield np.asarray(mesh.vertices)[np.asarray(mesh.faces)], None
    elif mesh.format == "stl":
        yield _stl(mesh.data), None
    elif mesh.format == "obj":
        yield from _obj(mesh)
    else:
        yield from _ColouredCollada(ET.fromstring(mesh.data)).triangles()


def _stl(data: bytes) -> np.ndarray:
    count = int.from_bytes(data[80:84], "little")
    if len(data) >= 84 + count * TRIANGLE.itemsize and not (data[:5] == b"solid" and b"vertex" in data):
        return np.frombuffer(data, TRIANGLE, count, 84)["corners"].astype(float)
    numbers = rb"[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)"
    return np.array(re.findall(rb"vertex" + numbers, data), dtype="S").astype(float).reshape(-1, 3, 3)


def _colours_of(libraries: Iterable[bytes]) -> dict[bytes, Colour]:
    """Return the diffuse colours of the materials in .mtl files."""
    colours: dict[bytes, Colour] = {}
    for library in libraries:
        for name, text in re.findall(rb"newmtl[ \t]+(\S+)(.*?)(?=newmtl|\Z)", library, re.DOTALL):
            if kd := re.search(rb"\bKd[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", text):
                opacity = re.search(rb"^[ \t]*d[ \t]+(\S+)", text, re.MULTILINE)
                colours[name] = (*map(float, kd.groups()), float(opacity[1]) if opacity else 1.0)
    return colours


def _obj(mesh: Mesh) -> Iterator[tuple[np.ndarray, Colour | None]]:
    colours = _colours_of(mesh.companions.values())
    points: list[list[float]] = []
    parts: dict[Colour | None, list[list[int]]] = {}
    faces = parts.setdefault(None, [])
    for line in mesh.data.splitlines():
        word, _, rest = line.strip().partition(b" ")
        if word == b"v":
            points.append([float(x) for x in rest.split()[:3]])
        elif word == b"usemtl":
            faces = parts.setdefault(colours.get(rest.strip()), [])
        elif word == b"f":
            corners = [int(CORNER.match(text)[1]) for text in rest.split()]  # type: ignore[index]
            used = [c - 1 if c > 0 else len(points) + c for c in corners]
            faces += [[used[0], used[k], used[k + 1]] for k in range(1, len(used) - 1)]
    for rgba, found in parts.items():
        if found:
            yield np.array(points)[np.array(found)], rgba


class _ColouredCollada(Collada):
    """A .dae file with the colours of its materials."""

    def triangles(self) -> Iterator[tuple[np.ndarray, Colour | None]]:
        """Yield corners (m, 3, 3) and colour of each group of triangles, as placed by the scene."""
        for geometry, placement, materials in self.instances():
            for corners, symbol in _groups(self, geometry):
                rgba = self._colour(materials.get(symbol, symbol))
                yield corners @ placement[:3, :3].T + placement[:3, 3], rgba

    def _colour(self, name: str) -> Colour | None:
        material = self.named.get(name)
        effect = self.named.get(material.find("instance_effect").get("url", "")[1:]) if material is not None else None  # type: ignore[union-attr]
        if effect is None:
            return None
        found = {kind: effect.find(f".//{kind}/color") for kind in ("diffuse", "emission")}
        rgb = np.zeros(3)
        for colour in found.values():
            if colour is not None:
                rgb = rgb + np.array((colour.text or "").split(), float)[:3]
        if all(colour is None for colour in found.values()):
            return None
        return (*(float(x) for x in np.clip(rgb, 0, 1)), 1.0)


def _groups(file: Collada, geometry: ET.Element) -> Iterator[tuple[np.ndarray, str]]:
    """Yield triangles (m, 3, 3) of a geometry, and the symbol of their material; polygons become triangle fans."""
    points = file.points_of(geometry)
    for group in geometry.iterfind("mesh/*"):
        if group.tag not in ("triangles", "polylist", "polygons"):
            continue
        inputs = {x.get("semantic"): int(x.get("offset", "0")) for x in group.iterfind("input")}
        stride, at = max(inputs.values()) + 1, inputs["VERTEX"]
        lists = [np.array((p.text or "").split(), int)[at::stride] for p in group.iterfind("p")]
        counts = (group.findtext("vcount") or "").split()
        if group.tag == "polylist":
            lists = np.split(lists[0], np.cumsum(np.array(counts, int))[:-1])
        if group.tag == "triangles":
            corners = np.concatenate(lists).reshape(-1, 3) if lists else np.empty((0, 3), int)
        else:
            fans = [[p[0], p[k], p[k + 1]] for p in lists for k in range(1, len(p) - 1)]
            corners = np.array(fans, int).reshape(-1, 3)
        if len(corners):
            yield points[corners], group.get("material", "")
