"""A replay as one binary glTF 2.0 file (.glb): meshes once, a node for each shape, its motion as an animation.

The format is Khronos' "glTF 2.0 Specification" (2021): y is up, lengths are metres, rotations are unit quaternions.
"""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism.scene.surfaces import Surface
from ...system import Array
from ...tolerances import COINCIDENT, INPUT_DIGITS, TINY
from .animation_tracks import continuous
from .mode_tracks import ACTIVE_COLOUR, IMPACT_COLOUR
from .solids import coil, coloured_surfaces, solid

if TYPE_CHECKING:
    from ...mechanism.scene.scene import Scene, Strut
    from .mode_tracks import ModeTrack

GREY = (0.7, 0.7, 0.7, 1.0)
SPRING = (0.8, 0.22, 0.2, 1.0)
UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # rotates z up into y up
FLOAT, UINT = 5126, 5125  # component types
FLASH, SUDDEN = 0.25, 0.001  # s of viewing: duration and rise time of the mark of an impact
EDGE = np.cos(0.6)  # cosine of the largest angle between triangles of a smooth surface
VERTICES, INDICES = 34962, 34963  # targets of a buffer view


class _File:
    """The parts of a glTF file, each a list, and the bytes they refer to."""

    def __init__(self, title: str) -> None:
        self.data = bytearray()
        self.parts: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "mbdae"},
            "scene": 0,
            "scenes": [{"name": title or "mechanism", "nodes": [0]}],
            **{name: [] for name in ("nodes", "meshes", "materials", "accessors", "bufferViews")},
        }
        self.known: dict[Any, int] = {}

    def add(self, kind: str, what: dict[str, Any]) -> int:
        self.parts[kind].append(what)
        return len(self.parts[kind]) - 1

    def once(self, key: Any, kind: str, what: dict[str, Any]) -> int:
        if key not in self.known:
            self.known[key] = self.add(kind, what)
        return self.known[key]

    def accessor(self, values: Array, target: int | None = None, bounded: bool = False) -> int:
        """An accessor of rows of floats, or of indices."""
        dtype, component = ("<u4", UINT) if target == INDICES else ("<f4", FLOAT)
        array = np.ascontiguousarray(values, dtype)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes}
        self.data += array.tobytes()
        number = self.add("bufferViews", view | ({"target": target} if target else {}))
        wide = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}[array.shape[1] if array.ndim > 1 else 1]
        out: dict[str, Any] = {
            "bufferView": number, "componentType": component, "count": len(array), "type": wide,
        }  # fmt: skip
        if bounded:
            out |= {f: np.atleast_1d(getattr(array, f)(axis=0)).astype(float).tolist() for f in ("min", "max")}
        return self.add("accessors", out)

    def mesh(self, key: Any, parts: Sequence[Surface], rgba: tuple[float, ...] | None) -> int:
        if (key, rgba) not in self.known:
            drawn = [self.primitive(p, rgba or p.rgba) for p in parts]
            self.known[key, rgba] = self.add("meshes", {"primitives": drawn})
        return self.known[key, rgba]

    def primitive(self, surface: Surface, rgba: tuple[float, ...] | None) -> dict[str, Any]:
        """Triangles with normals; where an edge is sharp, its points are duplicated."""
        corners = np.hstack([surface.points[surface.faces.ravel()], np.round(normals(surface), 3)])
        rows, index = np.unique(corners.astype("<f4"), axis=0, return_inverse=True)
        directions = rows[:, 3:] / np.linalg.norm(rows[:, 3:], axis=1)[:, None]
        colour = [float(x) for x in rgba or GREY]
        material: dict[str, Any] = {
            "pbrMetallicRoughness": {"baseColorFactor": colour, "metallicFactor": 0.1, "roughnessFactor": 0.6},
            "doubleSided": True,
        }
        material |= {"alphaMode": "BLEND"} if colour[3] < 1 else {}
        return {
            "attributes": {
                "POSITION": self.accessor(rows[:, :3], VERTICES, bounded=True),
                "NORMAL": self.accessor(directions, VERTICES),
            },
            "indices": self.accessor(index.ravel(), INDICES),
            "material": self.once(("look", tuple(colour)), "materials", material),
        }

    def bytes(self) -> bytes:
        """The file: its head, the parts as JSON, and the numbers."""
        parts = {k: v for k, v in self.parts.items() if v != []} | {"buffers": [{"byteLength": len(self.data)}]}
        text = json.dumps(parts, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + b"\0" * (-len(self.data) % 4)
        chunks = [(len(text), b"JSON", text), (len(data), b"BIN\0", data)]
        body = b"".join(n.to_bytes(4, "little") + kind + chunk for n, kind, chunk in chunks)
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body


def glb(scene: "Scene", times: Array, q: Array, title: str, speed: float, marks: Sequence["ModeTrack"] = ()) -> bytes:
    """Return the file of a motion.

    Args:
        scene: the scene; marks of closures are not drawn.
        times: (m,) in s.
        q: (m, nq) configurations.
        title: of the scene.
        speed: seconds of motion per second of the animation.
        marks: balls at active contacts, and for a quarter of a second at impacts.
    """
    animation = _Animation(title, np.abs(times - times[0]) / speed, scene.width)
    animation.add_shapes(scene, q)
    for spring, ends in zip(scene.springs, scene.end_points(scene.springs, q).swapaxes(0, 1), strict=True):
        animation.add_spring(spring, ends)
    for mark in marks if animation.moves else ():
        animation.add_mark(mark, "active", _rgba(ACTIVE_COLOUR), *_active_scales(mark, times, speed), "STEP")
        animation.add_mark(mark, "impact", _rgba(IMPACT_COLOUR), *_impact_scales(mark, times, speed), "LINEAR")
    return animation.bytes()


class _Animation:
    """Animated nodes over seconds (m,); ``width`` is the line width of springs in m."""

    def __init__(self, title: str, seconds: Array, width: float) -> None:
        self.file, self.width, self.moves = _File(title), width, len(seconds) > 1
        self.file.add("nodes", {"name": title or "mechanism", "rotation": UP, "children": []})
        self.clock = self.file.accessor(seconds, bounded=True) if self.moves else -1
        self.motion: dict[str, Any] = {"name": "motion", "samplers": [], "channels": []}

    def add_shapes(self, scene: "Scene", q: Array) -> None:
        """Add the shapes of a scene at configurations (m, nq), without marks of closures."""
        for shape, track in zip(scene.shapes, scene.placements(q).swapaxes(0, 1), strict=True):
            if shape.role == "closure" or not (found := coloured_surfaces(shape)):
                continue
            mesh = self.file.mesh(shape.mesh or (shape.kind, shape.size), found, shape.rgba)
            tracks = {"translation": track[:, :3], "rotation": _unit(continuous(track[:, 3:]))}
            scale = {} if shape.scale == (1.0, 1.0, 1.0) else {"scale": np.array([shape.scale])}
            self._add_node(shape.name, mesh, tracks | scale)

    def add_spring(self, spring: "Strut", ends: Array) -> None:
        """Add coil and tube of a spring between its ends (m, 2, 3), unless its length is zero."""
        lines = ends[:, 1] - ends[:, 0]
        lengths = np.linalg.norm(lines, axis=1)
        length = spring.length or float(np.median(lengths))
        if length <= 0:
            return
        if spring.coil:
            surface = coil(2.4 * self.width, 0.5 * self.width, length)
            mesh = self.file.mesh(("coil", length), [surface], SPRING)
            self._add_line(f"{spring.name} coil", mesh, ends[:, 0], lines, lengths / length)
        if spring.tube:
            mesh = self.file.mesh(("tube", length), [solid("cylinder", (self.width, 1.0))], None)
            self._add_line(f"{spring.name} tube", mesh, ends.mean(axis=1), lines, lengths)

    def add_mark(
        self, mark: "ModeTrack", kind: str, rgba: tuple[float, ...], at: Array, sizes: Array, interpolation: str
    ) -> None:
        """Add balls at the positions of a mark, with sizes (n,) from the seconds (n,) on."""
        if not sizes.any():
            return
        scales = np.maximum(sizes, INPUT_DIGITS)[:, None] * np.ones(3)  # a scale of 0 leaves no normals
        for points in mark.positions:
            ball = self.file.mesh(kind, [solid("sphere", (3 * self.width,))], rgba)
            node = self._add_node(f"{mark.name} {kind}", ball, {"translation": points})
            self._add_channel(node, "scale", self.file.accessor(at, bounded=True), scales, interpolation)

    def bytes(self) -> bytes:
        """The file."""
        if self.motion["channels"]:
            self.file.parts["animations"] = [self.motion]
        return self.file.bytes()

    def _add_line(self, name: str, mesh: int, begin: Array, lines: Array, stretch: Array) -> None:
        """Add a mesh along z, rotated into lines (m, 3) and stretched."""
        tracks = {
            "translation": begin,
            "rotation": aligned_quaternions(lines),
            "scale": _along(np.maximum(stretch, INPUT_DIGITS)),
        }
        self._add_node(name, mesh, tracks)

    def _add_node(self, name: str, mesh: int, tracks: dict[str, Array]) -> int:
        start = {path: track[0].tolist() for path, track in tracks.items()}
        node = self.file.add("nodes", {"name": name, "mesh": mesh, **start})
        self.file.parts["nodes"][0]["children"].append(node)
        for path, track in tracks.items():
            if self.moves and np.ptp(track, axis=0).any():
                self._add_channel(node, path, self.clock, track)
        return node

    def _add_channel(self, node: int, path: str, clock: int, values: Array, interpolation: str = "LINEAR") -> None:
        output = self.file.accessor(values)
        self.motion["samplers"].append({"input": clock, "interpolation": interpolation, "output": output})
        target = {"node": node, "path": path}
        self.motion["channels"].append({"sampler": len(self.motion["samplers"]) - 1, "target": target})


def normals(surface: Surface) -> Array:
    """Return unit normals (3 m, 3) at the corners of triangles: means over the smooth surface around each point."""
    a, b, c = surface.points[surface.faces].astype(float).swapaxes(0, 1)
    area = np.cross(b - a, c - a)
    sizes = np.linalg.norm(area, axis=1)
    unit = np.where(sizes[:, None] > 0, area / np.maximum(sizes, TINY)[:, None], [0.0, 0.0, 1.0])
    point = surface.faces.ravel()
    order, count = np.argsort(point, kind="stable"), np.bincount(point)
    first = np.cumsum(count) - count
    corner = np.repeat(np.arange(len(point)), count[point])  # with each of the corners at its point
    within = np.arange(len(corner)) - np.repeat(np.cumsum(count[point]) - count[point], count[point])
    current, other = corner // 3, order[first[point[corner]] + within] // 3
    near = np.einsum("ij,ij->i", unit[current], unit[other]) > EDGE
    sums = np.column_stack([np.bincount(corner[near], area[other[near], k], len(point)) for k in range(3)])
    sizes = np.linalg.norm(sums, axis=1)
    return np.where(sizes[:, None] > 0, sums / np.maximum(sizes, TINY)[:, None], unit[np.arange(len(point)) // 3])


def _active_scales(mark: "ModeTrack", times: Array, speed: float) -> tuple[Array, Array]:
    """Return seconds (n,) at which a mark appears or disappears, and its sizes from then on, (n,)."""
    ends = np.abs(np.reshape(mark.active, (-1, 2)) - times[0]) / speed
    at = np.unique(np.append(ends.ravel(), 0.0).astype("f4"))
    low, high = ends.astype("f4").T
    return at, ((low <= at[:, None]) & (at[:, None] < high)).any(axis=1).astype(float)


def _impact_scales(mark: "ModeTrack", times: Array, speed: float) -> tuple[Array, Array]:
    """Return seconds (n,) and sizes of a mark, (n,), which jump at impacts and decay to 0."""
    if not mark.impacts:
        return np.zeros(1), np.zeros(1)
    impacts = np.abs(np.array(mark.impacts) - times[0]) / speed
    end = abs(times[-1] - times[0]) / speed
    at = np.concatenate([[0.0], impacts, impacts - SUDDEN, impacts + FLASH])
    at = np.unique(at[(at >= 0) & (at <= end)].astype("f4"))
    last = np.searchsorted(impacts.astype("f4"), at, side="right") - 1
    age = (at - impacts[last]) / FLASH
    return at, np.where((last < 0) | (age > 1), 0.0, 2.5 * np.array(mark.strength)[last] * (1 - np.maximum(age, 0)))


def _rgba(colour: str) -> tuple[float, ...]:
    return (*(int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)), 0.6)


def _unit(quaternions: Array) -> Array:
    return quaternions / np.linalg.norm(quaternions, axis=1)[:, None]


def _along(z: Array) -> Array:
    return np.column_stack([np.ones_like(z), np.ones_like(z), z])


def aligned_quaternions(directions: Array) -> Array:
    """Return quaternions (m, 4) that rotate z into directions (m, 3)."""
    d = directions / np.maximum(np.linalg.norm(directions, axis=1), TINY)[:, None]
    out = np.column_stack([-d[:, 1], d[:, 0], np.zeros(len(d)), 1 + d[:, 2]])
    out[1 + d[:, 2] < COINCIDENT] = 1, 0, 0, 0
    return continuous(_unit(out))
