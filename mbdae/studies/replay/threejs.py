"""Scenes and motions as the commands of meshcat, whose objects and animations are three.js' JSON."""

import base64
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import umsgpack

from ...mechanism.scene.drawables import GREY, Drawable, Motion, Solid, Track, Vertices
from ...system import Array

ROOT = "/mechanism"
EXTENSION = {  # msgpack types of the arrays of JavaScript
    "int8": 0x11, "uint8": 0x12, "uint16": 0x14, "int32": 0x15, "uint32": 0x16, "float32": 0x17, "float64": 0x18,
}  # fmt: skip
ARRAY_TYPES = {"int8": "Int8Array", "uint16": "Uint16Array", "uint32": "Uint32Array", "float32": "Float32Array"}
TRACKS = {  # tracks of a motion: object below the path, property, type
    "position": ("", ".position", "vector"),
    "rotation": ("", ".quaternion", "quaternion"),
    "scale": ("", ".scale", "vector"),
    "visible": ("", ".visible", "bool"),
    "stretch": ("/<object>", ".morphTargetInfluences[0]", "number"),
}
DISCRETE = 2300  # three.js' InterpolateDiscrete
MARK_LAYER = 10**6  # render order above that of all closures
MIME = {b"\xff\xd8\xff": "image/jpeg", b"GIF8": "image/gif"}  # by the first bytes; otherwise png


def typed_array(values: object, dtype: str) -> umsgpack.Ext:
    """Return a flattened numpy array as a typed array of JavaScript; dtype is a key of ``EXTENSION``."""
    return umsgpack.Ext(EXTENSION[dtype], np.ascontiguousarray(values, dtype=dtype).tobytes())


def node_path(drawable: str, root: str = ROOT) -> str:
    """Return the path of a drawable in the viewer's tree."""
    return f"{root}/{drawable}"


def set_object(path: str, contents: Mapping[str, object]) -> dict[str, Any]:
    """Return the command that draws an object."""
    metadata = {"metadata": {"version": 4.5, "type": "Object"}}
    return {"type": "set_object", "path": path, "object": {**metadata, **contents}}


def set_property(path: str, name: str, value: object) -> dict[str, Any]:
    """Return the command that sets a property of an object."""
    return {"type": "set_property", "path": path, "property": name, "value": value}


def draw_commands(
    drawables: Sequence[Drawable], solids: list[Solid] | None = None, root: str = ROOT
) -> Iterator[dict[str, Any]]:
    """Yield the commands that draw drawables.

    Args:
        drawables: the drawables.
        solids: list to which their solids are added, so that a page stores each once; a geometry is then an index.
            Without a list each object contains its geometry.
        root: path above the names of the drawables.
    """
    for k, drawable in enumerate(drawables):
        if not drawable.solid.surfaces:
            continue
        path = node_path(drawable.name, root)
        yield set_object(path, _object(drawable, k, len(drawables) - k, solids))
        if drawable.style != "body":
            yield set_property(f"{path}/<object>", "castShadow", False)
            yield set_property(f"{path}/<object>", "receiveShadow", False)


def _object(d: Drawable, k: int, layer: int, solids: list[Solid] | None) -> dict[str, Any]:
    """Return an object; closures are drawn above everything else, higher layers above lower ones."""
    colours = [d.rgba] if d.rgba else [surface.rgba or GREY for surface in d.solid.surfaces]
    colours *= len(d.solid.surfaces) // len(colours)
    images = [b"" if d.rgba else surface.image for surface in d.solid.surfaces]
    if solids is None:
        geometry: dict[str, Any] = {"data": buffer_geometry(d.solid)}
    else:
        if d.solid not in solids:
            solids.append(d.solid)
        geometry = {"shared": solids.index(d.solid)}
    return {
        "geometries": [{"uuid": "geometry", "type": "BufferGeometry", **geometry}],
        "materials": [
            {"uuid": f"material {i}", **material(rgba, d.style, k), **({"map": f"texture {i}"} if images[i] else {})}
            for i, rgba in enumerate(colours)
        ],
        "images": [{"uuid": f"image {i}", "url": _url(data)} for i, data in enumerate(images) if data],
        "textures": [
            {"uuid": f"texture {i}", "image": f"image {i}", "wrap": [1000, 1000]} for i, x in enumerate(images) if x
        ],
        "object": {
            "uuid": d.name,
            "type": "Mesh",
            "geometry": "geometry",
            "material": [f"material {i}" for i in range(len(colours))],
            "matrix": np.diag([*d.scale, 1.0]).ravel().tolist(),
            "renderOrder": {"closure": layer, "mark": MARK_LAYER}.get(d.style, 0),
            "frustumCulled": d.solid.stretch is None,
        },
    }


def material(rgba: Sequence[float], style: str, k: int = 0) -> dict[str, Any]:
    """Return a material; of coplanar faces, that of the drawable with the larger k is visible."""
    colour = int.from_bytes(bytes(round(255 * c) for c in rgba[:3]), "big")
    out = {"color": colour, "opacity": float(rgba[3]), "transparent": rgba[3] < 1, "side": 2}
    phong = {"type": "MeshPhongMaterial", "shininess": 40, "specular": 0x1C1C1C}
    if style == "body":
        return {**out, **phong, **_polygon_offset(0, -4 * (k % 12))}
    if style == "ghost":  # where both coincide, the body is visible
        return {**out, **phong, **_polygon_offset(2, 8), "depthWrite": False}
    overlay = {"depthTest": False, "transparent": True, "side": 0}
    return {**out, **(phong if style == "closure" else {"type": "MeshBasicMaterial"}), **overlay}


def _polygon_offset(factor: float, units: float) -> dict[str, Any]:
    return {"polygonOffset": True, "polygonOffsetFactor": factor, "polygonOffsetUnits": units}


def _url(image: bytes) -> str:
    kind = next((kind for start, kind in MIME.items() if image.startswith(start)), "image/png")
    return f"data:{kind};base64,{base64.b64encode(image).decode('ascii')}"


def buffer_attribute(values: Array, dtype: str = "float32", **more: Any) -> dict[str, Any]:
    """Return a BufferAttribute of three.js with values (n, k)."""
    return {"itemSize": values.shape[1], "type": ARRAY_TYPES[dtype], "array": typed_array(values, dtype), **more}


def buffer_geometry(solid: Solid) -> dict[str, Any]:
    """Return the data of a BufferGeometry of three.js, with a group of triangles for each surface."""
    found = solid.vertices
    points = np.concatenate([v.points for v in found])
    directions = np.rint(127 * np.concatenate([v.normals for v in found]))
    out: dict[str, Any] = {
        "attributes": {
            "position": buffer_attribute(points),
            "normal": buffer_attribute(directions, "int8", normalized=True),
        },
        "index": {"type": "Uint32Array", "array": typed_array(_index(found), "uint32")},
        "groups": [
            {"start": int(start), "count": len(v.corners), "materialIndex": k}
            for k, (v, start) in enumerate(zip(found, np.cumsum([0, *(len(v.corners) for v in found)]), strict=False))
        ],
    }
    if any(v.uv is not None for v in found):
        uv = [np.zeros((len(v.points), 2)) if v.uv is None else v.uv for v in found]
        out["attributes"]["uv"] = buffer_attribute(np.concatenate(uv))
    if solid.stretch is not None and found[0].stretch is not None:
        out |= {"morphAttributes": {"position": [buffer_attribute(found[0].stretch)]}, "morphTargetsRelative": True}
    return out


def _index(found: Sequence[Vertices]) -> Array:
    starts = np.cumsum([0, *(len(v.points) for v in found)])
    return np.concatenate([v.corners + start for v, start in zip(found, starts, strict=False)])


def quantized_geometry(solid: Solid) -> dict[str, Any]:
    """Return the data of a geometry for a page, a third of the size.

    Points have 16 bits per axis, as fractions of the bounding box: 1e-5 of its edges. Indices of corners are stored as
    differences.
    """
    points = np.concatenate([v.points for v in solid.vertices])
    low, high = points.min(axis=0).astype(float), points.max(axis=0).astype(float)
    span = np.where(high > low, high - low, 1.0)
    data = buffer_geometry(solid)
    data["attributes"]["position"]["array"] = typed_array(np.rint((points - low) / span * 65535), "uint16")
    data["index"]["array"] = typed_array(np.diff(_index(solid.vertices), prepend=0), "int32")
    return {"low": low.tolist(), "span": span.tolist(), "data": data}


def animation_clips(
    drawables: Sequence[Drawable], motions: Sequence[Motion], root: str = ROOT, moving: Sequence[bool] | None = None
) -> list[dict[str, Any]]:
    """Return the animations of the drawables that move, over seconds; the page adds the times of frames.

    Args:
        drawables: the drawables.
        motions: motions of the drawables.
        root: path above the names of the drawables.
        moving: mask of the drawables to animate; those that move if omitted.
    """
    out = []
    for k, (drawable, motion) in enumerate(zip(drawables, motions, strict=True)):
        tracks = {key: t for key, t in motion.items() if (t.moves if moving is None else moving[k])}
        for below in ("", "/<object>") if drawable.solid.surfaces else ():
            found = [_clip_track(key, track) for key, track in tracks.items() if TRACKS[key][0] == below]
            if found:
                out.append({"path": node_path(drawable.name, root) + below, "clip": {"fps": 1, "tracks": found}})
    return out


def selectable_clips(
    drawables: Sequence[Drawable],
    shown: Sequence[Motion],
    choices: Mapping[str, Sequence[Motion]],
    times: Array | None = None,
) -> list[dict[str, Any]]:
    """Return selectable animations, each with all drawables that move in at least one of them.

    Args:
        drawables: the drawables.
        shown: motions that are shown when none of the animations is selected.
        choices: motions of each animation, by its name.
        times: times of the frames in s, (m,); uniform from 0 to 1 if omitted.
    """
    every = [shown, *choices.values()]
    moving = [_differ(found) for found in zip(*every, strict=True)]
    out = []
    for name, found in choices.items():
        count = len(next(iter(found[0].values())).values) if found else 1
        at = np.linspace(0, 1, count) if times is None else times
        clips = animation_clips(drawables, found, moving=moving)
        out.append({"name": name, "times": typed_array(at, "float32"), "animations": clips})
    return out


def _differ(found: Sequence[Motion]) -> bool:
    """Return whether a drawable moves in one of its motions, or its constant poses differ."""
    tracks = [(key, track) for motion in found for key, track in motion.items()]
    return any(t.moves or not np.array_equal(t.values[0], found[0][key].values[0]) for key, t in tracks)


def _clip_track(key: str, track: Track) -> dict[str, Any]:
    _, name, kind = TRACKS[key]
    values = [bool(x) for x in track.values.ravel()] if kind == "bool" else typed_array(track.values, "float32")
    out = {"name": name, "type": kind, "values": values}
    out |= {"interpolation": DISCRETE} if track.stepped or kind == "bool" else {}
    return out if track.times is None else out | {"times": typed_array(track.times, "float32")}


def pose_commands(
    drawables: Sequence[Drawable], motions: Sequence[Motion], k: int = 0, root: str = ROOT
) -> Iterator[dict[str, Any]]:
    """Yield the commands that move drawables to frame k of their motions, by the tracks over frames."""
    for drawable, motion in zip(drawables, motions, strict=True):
        if not drawable.solid.surfaces:
            continue
        path = node_path(drawable.name, root)
        if "position" in motion:
            scale = motion["scale"].values[k] if "scale" in motion and motion["scale"].times is None else np.ones(3)
            matrix = transform(motion["position"].values[k], motion["rotation"].values[k], scale)
            yield {"type": "set_transform", "path": path, "matrix": matrix.T.ravel().tolist()}
        if "stretch" in motion:
            values = motion["stretch"].values[k].tolist()
            yield set_property(f"{path}/<object>", "morphTargetInfluences", values)


def transform(position: Array, rotation: Array, scale: Array) -> Array:
    """Return the matrix (4, 4) of a position, a unit quaternion x, y, z, w and three scales."""
    x, y, z, w = rotation
    out = np.eye(4)
    out[:3, :3] = scale * np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    out[:3, 3] = position
    return out
