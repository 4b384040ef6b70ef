"""A replay as one binary glTF 2.0 file (.glb): meshes once, a node for each shape, its motion as an animation.

The format is Khronos' "glTF 2.0 Specification" (2021): y is up, lengths are metres, rotations are unit quaternions.
"""

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...mechanism.scene.drawables import GREY, Drawable, Motion, Solid, Track, Vertices, drawables, motions
from ...system import Array
from .animation_tracks import MovingDrawables
from .mode_tracks import mark_drawables

if TYPE_CHECKING:
    from ...mechanism.scene.scene import Scene
    from .mode_tracks import ModeTrack

UP = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]  # rotates z up into y up
FLOAT, UINT = 5126, 5125  # component types
PATHS = {"position": "translation", "rotation": "rotation", "scale": "scale", "stretch": "weights"}
KINDS = ("nodes", "meshes", "materials", "textures", "images", "accessors", "bufferViews")
VERTICES, INDICES = 34962, 34963  # targets of a buffer view


class _File:
    """Contents of a glTF file: lists of elements by kind, and the binary data to which they refer."""

    def __init__(self, title: str) -> None:
        self.data = bytearray()
        self.elements: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "mbdae"},
            "scene": 0,
            "scenes": [{"name": title or "mechanism", "nodes": [0]}],
            **{name: [] for name in KINDS},
        }
        self.known: dict[Any, int] = {}

    def add(self, kind: str, item: dict[str, Any]) -> int:
        self.elements[kind].append(item)
        return len(self.elements[kind]) - 1

    def add_once(self, key: object, kind: str, item: dict[str, Any]) -> int:
        if key not in self.known:
            self.known[key] = self.add(kind, item)
        return self.known[key]

    def accessor(self, values: Array, target: int | None = None, bounded: bool = False) -> int:
        """Add an accessor of rows of floats, or of indices; return its index."""
        dtype, component = ("<u4", UINT) if target == INDICES else ("<f4", FLOAT)
        array = np.ascontiguousarray(values, dtype)
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": array.nbytes}
        self.data += array.tobytes()
        number = self.add("bufferViews", view | ({"target": target} if target else {}))
        kind_of_rows = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[array.shape[1] if array.ndim > 1 else 1]
        out: dict[str, Any] = {
            "bufferView": number, "componentType": component, "count": len(array), "type": kind_of_rows,
        }  # fmt: skip
        if bounded:
            out |= {f: np.atleast_1d(getattr(array, f)(axis=0)).astype(float).tolist() for f in ("min", "max")}
        return self.add("accessors", out)

    def mesh(self, solid: Solid, rgba: tuple[float, ...] | None) -> int:
        if (solid, rgba) not in self.known:
            drawn = [
                self.primitive(v, rgba or s.rgba or GREY, b"" if rgba else s.image)
                for s, v in zip(solid.surfaces, solid.vertices, strict=True)
            ]
            weights = {} if solid.stretch is None else {"weights": [0.0]}
            self.known[solid, rgba] = self.add("meshes", {"primitives": drawn, **weights})
        return self.known[solid, rgba]

    def primitive(self, v: Vertices, rgba: tuple[float, ...], image: bytes) -> dict[str, Any]:
        """Return triangles with normals, and texture coordinates from the upper left corner."""
        attributes = {
            "POSITION": self.accessor(v.points, VERTICES, bounded=True),
            "NORMAL": self.accessor(v.normals, VERTICES),
        }
        if image and v.uv is not None:
            attributes["TEXCOORD_0"] = self.accessor(v.uv * [1, -1] + [0, 1], VERTICES)
        out = {
            "attributes": attributes,
            "indices": self.accessor(v.corners, INDICES),
            "material": self.material(tuple(float(x) for x in rgba), image),
        }
        if v.stretch is not None:
            out["targets"] = [{"POSITION": self.accessor(v.stretch, VERTICES, bounded=True)}]
        return out

    def material(self, colour: tuple[float, ...], image: bytes) -> int:
        shading: dict[str, Any] = {"baseColorFactor": list(colour), "metallicFactor": 0.1, "roughnessFactor": 0.6}
        if image:
            shading["baseColorTexture"] = {"index": self.texture(image)}
        material = {"pbrMetallicRoughness": shading, "doubleSided": True}
        material |= {"alphaMode": "BLEND"} if colour[3] < 1 else {}
        return self.add_once(("shading", colour, image), "materials", material)

    def texture(self, image: bytes) -> int:
        if image not in self.known:
            self.data += b"\0" * (-len(self.data) % 4)
            view = self.add("bufferViews", {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(image)})
            self.data += image + b"\0" * (-len(image) % 4)
            kind = "image/jpeg" if image.startswith(b"\xff\xd8") else "image/png"
            source = self.add("images", {"bufferView": view, "mimeType": kind})
            self.known[image] = self.add("textures", {"source": source})
        return self.known[image]

    def bytes(self) -> bytes:
        """Return the file: header, JSON chunk and binary chunk."""
        elements = {k: v for k, v in self.elements.items() if v != []} | {"buffers": [{"byteLength": len(self.data)}]}
        text = json.dumps(elements, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + b"\0" * (-len(self.data) % 4)
        chunks = [(len(text), b"JSON", text), (len(data), b"BIN\0", data)]
        body = b"".join(n.to_bytes(4, "little") + kind + chunk for n, kind, chunk in chunks)
        return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body


def glb(scene: "Scene", times: Array, q: Array, title: str, speed: float, marks: Sequence["ModeTrack"] = ()) -> bytes:
    """Return the file of a motion.

    Args:
        scene: the scene; marks of closures are not drawn.
        times: times in s, (m,).
        q: configurations, (m, nq).
        title: title of the scene.
        speed: seconds of motion per second of the animation.
        marks: balls at active contacts, and for a quarter of a second at impacts.
    """
    animation = _Animation(title, np.abs(times - times[0]), speed)
    drawn = MovingDrawables(drawables(scene), motions(scene, q), "")
    marked = mark_drawables(marks if len(times) > 1 else (), times, speed, scene.width)
    for drawable, motion in (*zip(drawn.drawables, drawn.motions, strict=True), *zip(*marked[:2], strict=True)):
        if drawable.style != "closure" and drawable.solid.surfaces:
            animation.add(drawable, motion)
    return animation.bytes()


class _Animation:
    """Animated nodes over times (m,) in s; ``speed`` is seconds of motion per second of the animation."""

    def __init__(self, title: str, times: Array, speed: float) -> None:
        self.file, self.speed, self.moves = _File(title), speed, len(times) > 1
        self.file.add("nodes", {"name": title or "mechanism", "rotation": UP, "children": []})
        self.times_index = self.file.accessor(times / speed, bounded=True) if self.moves else -1
        self.motion: dict[str, Any] = {"name": "motion", "samplers": [], "channels": []}

    def add(self, drawable: Drawable, motion: Motion) -> None:
        """Add a node with the motion of a drawable; ``scale`` includes its scale."""
        tracks = {PATHS[key]: track for key, track in motion.items() if key in PATHS}
        scale = tracks.get("scale", Track(np.ones((1, 3))))
        tracks["scale"] = scale._replace(values=scale.values * np.array(drawable.scale))
        start = {path: track.values[0].tolist() for path, track in tracks.items()}
        if start["scale"] == [1.0, 1.0, 1.0]:
            del start["scale"]
        name = drawable.name.partition("/")[2] or drawable.name
        node = self.file.add("nodes", {"name": name, "mesh": self.file.mesh(drawable.solid, drawable.rgba), **start})
        self.file.elements["nodes"][0]["children"].append(node)
        for path, track in tracks.items():
            if self.moves and track.moves:
                self._add_channel(node, path, track)

    def bytes(self) -> bytes:
        """Return the file."""
        if self.motion["channels"]:
            self.file.elements["animations"] = [self.motion]
        return self.file.bytes()

    def _add_channel(self, node: int, path: str, track: Track) -> None:
        times = self.times_index
        if track.times is not None:
            times = self.file.accessor(track.times / self.speed, bounded=True)
        sampler = {"input": times, "interpolation": "STEP" if track.stepped else "LINEAR"}
        self.motion["samplers"].append({**sampler, "output": self.file.accessor(track.values)})
        target = {"node": node, "path": path}
        self.motion["channels"].append({"sampler": len(self.motion["samplers"]) - 1, "target": target})
