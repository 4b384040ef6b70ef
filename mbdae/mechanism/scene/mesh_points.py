"""Points of a mesh file, which determine the size of a scene; viewers draw the file itself.

The formats are parsed here because mesh libraries hang on some damaged files.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ..checked_table import HUGE

NUMBERS = rb"[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)"
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
MAX_NODES = 10_000  # nodes and instances of a .dae, which may reference each other


def points_of(path: Path) -> np.ndarray:
    """Return the points of a .stl, .obj or .dae file, (n, 3), in the unit and axes of the file.

    Raises:
        InputError: for a file without points, or with points that are not finite.
    """
    data = path.read_bytes()
    try:
        match path.suffix.lower():
            case ".stl":
                points = stl_points(data)
            case ".obj":
                points = np.array(re.findall(rb"^[ \t]*v" + NUMBERS, data, re.MULTILINE), dtype="S").astype(float)
            case _:
                points = Collada(ET.fromstring(data)).points()
    except (ValueError, LookupError, ET.ParseError, RecursionError) as e:
        raise InputError(f"mesh {path.name!r} is damaged: {' '.join(str(e).split())[:100]}") from None
    if not points.size or not (np.abs(points) <= HUGE).all():
        raise InputError(f"mesh {path.name!r} has no points, or points that are not finite, or beyond {HUGE:g}")
    return points


def stl_points(data: bytes) -> np.ndarray:
    """Return the corners of the triangles of a .stl file, (3 m, 3).

    Raises:
        ValueError: for a damaged file.
    """
    count = int.from_bytes(data[80:84], "little")
    if len(data) >= 84 + count * TRIANGLE.itemsize and not (data[:5] == b"solid" and b"vertex" in data):
        return np.frombuffer(data, TRIANGLE, count, 84)["corners"].reshape(-1, 3).astype(float)
    return np.array(re.findall(rb"vertex" + NUMBERS, data), dtype="S").astype(float)


class Collada:
    """A .dae file: its geometries, and the nodes with their placements."""

    def __init__(self, root: ET.Element) -> None:
        for element in root.iter():
            element.tag = element.tag.rpartition("}")[2]  # the namespace is the version
        self.root, self.count = root, 0
        self.by_id = {element.get("id", ""): element for element in root.iter() if element.get("id")}

    def points(self) -> np.ndarray:
        """Return all points, at their placements in the scene, (n, 3)."""
        found = [self.points_of(g) @ transform[:3, :3].T + transform[:3, 3] for g, transform, _ in self.instances()]
        return np.concatenate(found) if found else np.empty((0, 3))

    def instances(self) -> Iterator[tuple[ET.Element, np.ndarray, dict[str, str]]]:
        """Yield geometries, their placements (4, 4), and the materials of their groups by symbol."""
        scene = self.root.find("scene/instance_visual_scene")
        for node in self._target(scene).findall("node") if scene is not None else []:
            yield from self._node(node, np.eye(4))

    def _node(self, node: ET.Element, transform: np.ndarray) -> Iterator[tuple[ET.Element, np.ndarray, dict[str, str]]]:
        self.count += 1
        if self.count > MAX_NODES:
            raise ValueError(f"more than {MAX_NODES} nodes")
        for x in node:
            transform = transform @ _transform(x)
        for x in node:
            if x.tag == "node":
                yield from self._node(x, transform)
            elif x.tag == "instance_node":
                yield from self._node(self._target(x), transform)
            elif x.tag == "instance_geometry":
                bound = {m.get("symbol", ""): m.get("target", "")[1:] for m in x.iter("instance_material")}
                yield self._target(x), transform, bound

    def points_of(self, geometry: ET.Element) -> np.ndarray:
        """Return the points of a geometry, (n, 3)."""
        self.count += 1
        positions = geometry.find("mesh/vertices/input[@semantic='POSITION']")
        if positions is None:
            return np.empty((0, 3))
        source = self._target(positions, "source")
        array, accessor = source.find("float_array"), source.find("technique_common/accessor")
        if array is None:
            raise ValueError("a geometry has no points")
        stride = int(accessor.get("stride", "3")) if accessor is not None else 3
        values = _numbers(array)
        return values[: len(values) // stride * stride].reshape(-1, stride)[:, :3] if stride >= 3 else np.empty((0, 3))

    def _target(self, element: ET.Element, key: str = "url") -> ET.Element:
        return self.by_id[element.get(key, "").removeprefix("#")]


def _numbers(x: ET.Element) -> np.ndarray:
    values = np.array((x.text or "").split(), float)
    if not (np.abs(values) <= HUGE).all():
        raise ValueError(f"numbers of <{x.tag}> are not finite, or beyond {HUGE:g}")
    return values


def _transform(x: ET.Element) -> np.ndarray:
    """Return the (4, 4) matrix of an element of a node; the identity for an element without a placement."""
    out = np.eye(4)
    if x.tag not in ("matrix", "translate", "rotate", "scale"):
        return out
    values = _numbers(x)
    if x.tag == "matrix":
        return values.reshape(4, 4)
    if x.tag == "translate":
        out[:3, 3] = values
    elif x.tag == "scale":
        out[:3, :3] = np.diag(values)
    else:
        out[:3, :3] = pin.exp3(np.radians(values[3]) * values[:3] / (np.linalg.norm(values[:3]) or 1.0))
    return out
