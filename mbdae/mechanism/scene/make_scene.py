"""A scene made of a mechanism: its visuals, sticks for bodies without any, the ends of closures, rods, what rolls."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from . import stick_figure
from .meshes import FILE_FORMATS, Mesh, read_mesh, triangles
from .outlines import Outline, draw_outlines
from .rolling_bodies import RollingBody, draw
from .scene import Anchor, Mark, Scene, Shape, Strut
from .shapes import ground_level


def make_scene(
    model: pin.Model,
    visual_model: pin.GeometryModel | None = None,
    closures: Iterable[Mark] = (),
    springs: Iterable[Strut] = (),
    rolling: Iterable[RollingBody] = (),
    outlines: Iterable[Outline] = (),
) -> Scene:
    """Builds the scene: the model's visuals, generated sticks for massive bodies without any, closures, springs.

    Args:
        model: the mechanism's tree.
        visual_model: its visual geometry, or None.
        closures: marks to draw, and their anchors.
        springs: springs and dampers from point to point.
        rolling: bodies that roll; those of joints with visuals are not drawn.
        outlines: curves fixed to bodies, too.

    Returns:
        The scene.

    Raises:
        InputError: a mesh file cannot be read, or a visual is of a kind that cannot be drawn.
    """
    closures, rolling = tuple(closures), tuple(rolling)
    meshes: dict[Path, Mesh] = {}
    visuals, ground = _visuals_and_ground(visual_model)
    shapes = [_shape("visual", g, meshes) for g in visuals]
    corners = _corners(visuals, shapes)
    seen = {joint for joint, _ in corners}
    round_ones = [body for body in rolling if body.joint not in seen]
    points = _points(model, closures)
    size = stick_figure.proportions(model, points, _lengths(closures, round_ones), corners)
    parts = [
        *stick_figure.generate(model, points, size, seen, {body.joint for body in round_ones}),
        *draw(round_ones),
        *draw_outlines((curve for curve in outlines if curve.joint not in seen), 1.5 * size.width),
        *_marked(closures, seen, size.width),
    ]
    rods = [mark for mark in closures if mark.rod > 0]
    shapes += [_shape(role, g, meshes) for role, g in parts]
    shapes += [_shape("link", stick_figure.rod(mark.name, mark.rod, size.width), meshes) for mark in rods]
    anchors: list[tuple[Anchor, ...]] = [_fixed(g) for g in (*visuals, *(g for _, g in parts))]
    anchors += [(mark.first, mark.second) for mark in rods]
    named, rails = tuple(_uniquely_named(shapes)), _rails(model, shapes)
    return Scene(named, model, tuple(anchors), size.width, closures, tuple(springs), ground, rails)


def _visuals_and_ground(visual_model: pin.GeometryModel | None) -> tuple[list[pin.GeometryObject], float | None]:
    """The visuals that are no ground, and the height of the highest ground, if there is one."""
    visuals = list(visual_model.geometryObjects) if visual_model is not None else []
    levels = [ground_level(g) for g in visuals]
    above = [g for g, level in zip(visuals, levels, strict=True) if level is None]
    return above, max((x for x in levels if x is not None), default=None)


def _corners(visuals: Iterable[pin.GeometryObject], shapes: Iterable[Shape]) -> list[stick_figure.Point]:
    """The corners of the boxes around visuals, in the frames of their joints."""
    return [
        (int(g.parentJoint), g.placement.act(np.array(corner)))
        for g, shape in zip(visuals, shapes, strict=True)
        for corner in product(*shape.bounds.T)
    ]


def _points(model: pin.Model, closures: Iterable[Mark]) -> list[stick_figure.Point]:
    """Return the end points of links: anchors of closures, and named frames (feet, tools, tips)."""
    anchors = [(int(j), p.translation) for mark in closures for j, p in (mark.first, mark.second)]
    named = [f for f in model.frames if f.type == pin.FrameType.OP_FRAME and f.parentJoint]
    return anchors + [(int(f.parentJoint), f.placement.translation) for f in named]


def _lengths(closures: Iterable[Mark], round_ones: Iterable[RollingBody]) -> list[float]:
    """Lengths of rods and diameters of what rolls, which say how large the mechanism is."""
    diameters = [2 * (max(body.semi_axes) if body.semi_axes else body.rim + body.tyre) for body in round_ones]
    return [mark.rod for mark in closures if mark.rod > 0] + diameters


def _marked(closures: Iterable[Mark], seen: set[int], width: float) -> Iterator[stick_figure.Part]:
    """The ends of closures, and a pin where bodies without visuals meet."""
    for mark in closures:
        if seen.isdisjoint((mark.first[0], mark.second[0])) and mark.meets and not mark.rod:
            yield from stick_figure.pin_of(mark.name, *mark.first, mark.axis, width)
        yield from stick_figure.closure_balls(mark.name, (mark.first, mark.second), width)


def _rails(model: pin.Model, shapes: Iterable[Shape]) -> dict[int, int]:
    """The joint on each rail, by the number of its shape."""
    return {k: model.getJointId(x.name.removesuffix(" rail")) for k, x in enumerate(shapes) if x.role == "rail"}


def _fixed(g: pin.GeometryObject) -> tuple[Anchor]:
    return ((int(g.parentJoint), g.placement),)


def _uniquely_named(shapes: Iterable[Shape]) -> Iterable[Shape]:
    taken: set[str] = set()
    for shape in shapes:
        name, k = shape.name, 1
        while name in taken:
            name, k = f"{shape.name} {k + 1}", k + 1
        taken.add(name)
        yield replace(shape, name=name)


def _shape(role: str, g: pin.GeometryObject, meshes: dict[Path, Mesh]) -> Shape:
    geometry = g.geometry
    geometry.computeLocalAABB()
    box = geometry.aabb_local
    bounds = np.array([box.min_, box.max_])
    rgba = tuple(float(c) for c in np.clip(g.meshColor, 0, 1))
    solid = _primitive(geometry)
    if solid is not None:
        return Shape(g.name, role, *solid, rgba, bounds)
    path = Path(g.meshPath)
    if path.suffix[1:].lower() in FILE_FORMATS:
        if path not in meshes:
            root = Path(g.meshTexturePath)  # from a reader of files; otherwise empty, or a picture
            meshes[path] = read_mesh(g.name, path, root if g.meshTexturePath and root.is_dir() else None)
        mesh = meshes[path]
        own_colours = (mesh.format == "dae" or any(mesh.companions.values())) and not g.overrideMaterial
        scale = tuple(float(s) for s in g.meshScale)
        return Shape(g.name, role, "mesh", (), None if own_colours else rgba, bounds, mesh, scale)
    return Shape(g.name, role, "mesh", (), rgba, bounds, triangles(g.name, geometry))


def _primitive(geometry: Any) -> tuple[str, tuple[float, ...]] | None:
    if isinstance(geometry, coal.Box):
        return "box", tuple(2 * np.asarray(geometry.halfSide))
    if isinstance(geometry, coal.Sphere):
        return "sphere", (geometry.radius,)
    if isinstance(geometry, coal.Ellipsoid):
        return "ellipsoid", tuple(geometry.radii)
    for kind, cls in (("cylinder", coal.Cylinder), ("cone", coal.Cone), ("capsule", coal.Capsule)):
        if isinstance(geometry, cls):
            return kind, (geometry.radius, 2 * geometry.halfLength)
    return None
