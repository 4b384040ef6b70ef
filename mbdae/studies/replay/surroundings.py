"""Lights, ground and background around a mechanism, as commands of meshcat."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from ...system import Array
from .threejs import buffer_attribute, set_object, set_property

REMOVED = (  # elements of the viewer's defaults
    "Lights/SpotLight", "Lights/PointLightNegativeX", "Lights/PointLightPositiveX", "Lights/AmbientLight",
    "Lights/FillLight", "Grid", "Axes",
)  # fmt: skip
SUN, SKY = "/Lights/Sun", "/Lights/Sky"
GROUND = "/ground"
GROUND_RADIUS = 5.0  # radius in extents of the mechanism
SHADOW_BIAS = -1 / 2500  # fraction of the depth of the light, which prevents shadows of a surface on itself
GAP = 0.004  # distance between the lowest point and the ground, in extents
DENSE_GRID = 30  # number of cells on one side above which every second line is drawn
LINE_COLOUR = (0.663, 0.702, 0.741)


def surroundings(extent: float) -> Iterator[dict[str, Any]]:
    """Yield the commands for a mechanism of an extent in m; page and live view place sun and ground."""
    for path in REMOVED:
        yield {"type": "delete", "path": f"/{path}"}
    yield set_property("/Background", "top_color", [0.97, 0.98, 0.99])
    yield set_property("/Background", "bottom_color", [0.86, 0.885, 0.91])
    half = {"left": -extent, "right": extent, "top": extent, "bottom": -extent}
    camera = {"type": "OrthographicCamera", **half, "near": 0.1 * extent, "far": 8 * extent}
    quality = {"bias": SHADOW_BIAS, "normalBias": 0.003 * extent, "radius": 2.5, "mapSize": [2048, 2048]}
    light = {"uuid": "sun", "type": "DirectionalLight", "color": 0xFFFFFF, "intensity": 0.5}
    yield set_object(SUN, {"object": {**light, "shadow": {**quality, "camera": camera}}})
    sky = {"type": "HemisphereLight", "color": 0xFFFFFF, "groundColor": 0xC4C8CF, "intensity": 0.68}
    yield set_object(SKY, {"object": {"uuid": "sky", **sky}})
    yield set_property(f"{SKY}/<object>", "castShadow", False)
    yield from _ground(extent)


def grid_spacing(extent: float) -> float:
    """Return the spacing of the grid on the ground in m: 1, 2 or 5 times a power of ten."""
    decade = 10.0 ** np.floor(np.log10(extent / 5))
    return float(decade * next(k for k in (5, 2, 1) if k == 1 or k * decade <= extent / 5))


def ground_levels(box: Array, extent: float, ground: float | None) -> dict[str, float]:
    """Return the position of the ground along x, y or z, by view: below, or behind the box (2, 3) of a motion."""
    below = box[0, 2] - GAP * extent if ground is None else ground
    return {"front": box[1, 1] + GAP * extent, "side": box[0, 0] - GAP * extent, "top": below, "3d": below}


def _ground(extent: float) -> Iterator[dict[str, Any]]:
    """Yield a disc that receives shadows, and a grid that fades towards its edge."""
    radius = GROUND_RADIUS * extent
    disc = {"uuid": "disc", "type": "MeshLambertMaterial", "color": 0xF6F7F9, "opacity": 0.62}
    yield set_object(f"{GROUND}/disc", {
        "geometries": [{"uuid": "geometry", "type": "CircleGeometry", "radius": radius, "segments": 64}],
        "materials": [{**disc, "transparent": True, "depthWrite": False}],
        "object": _object("Mesh", "disc", renderOrder=-9),
    })  # fmt: skip
    points, fade = _grid(radius, grid_spacing(extent))
    colours = np.column_stack([np.tile(LINE_COLOUR, (len(points), 1)), fade])
    yield set_object(f"{GROUND}/grid", {
        "geometries": [{"uuid": "geometry", "type": "BufferGeometry", "data": {
            "attributes": {"position": buffer_attribute(points), "color": buffer_attribute(colours)}}}],
        "materials": [{"uuid": "line", "type": "LineBasicMaterial", "vertexColors": True, "transparent": True,
                       "depthWrite": False}],
        "object": _object("LineSegments", "line", renderOrder=-8),
    })  # fmt: skip
    for name in ("disc", "grid"):
        yield set_property(f"{GROUND}/{name}/<object>", "castShadow", False)


def _object(kind: str, material: str, **more: Any) -> dict[str, Any]:
    return {"uuid": kind, "type": kind, "geometry": "geometry", "material": material, **more}


def _grid(radius: float, spacing: float) -> tuple[Array, Array]:
    """Return the ends (2 n, 3) of line segments between the nodes of a grid, and their opacities (2 n,)."""
    cells = int(radius // spacing)
    i, j = np.meshgrid(np.arange(-cells, cells + 1), np.arange(-cells, cells), indexing="ij")
    drawn = (np.hypot(i, j) <= cells) & ((i % 2 == 0) | (cells <= DENSE_GRID))
    i, j = i[drawn], j[drawn]
    up = np.stack([np.column_stack([i, j]), np.column_stack([i, j + 1])], axis=1)
    ends = spacing * np.concatenate([up, up[:, :, ::-1]]).reshape(-1, 2)
    fade = 0.75 * np.maximum(0, 1 - np.linalg.norm(ends, axis=1) / radius) ** 1.5
    return np.column_stack([ends, np.zeros(len(ends))]), fade
