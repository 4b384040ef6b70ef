"""Scene of a mechanism: visuals, stick figures of bodies without visuals, closures, rods and rolling bodies."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from . import stick_figure
from .flexible_links import flexible_joints, flexible_links, hidden_joints
from .flexible_models import with_rods
from .meshes import FILE_FORMATS, Mesh, read_mesh, triangles
from .profile_outlines import Outline, draw_outlines
from .rolling_bodies import RollingBody, draw
from .scene import Anchor, Mark, Rod, Scene, Shape, Strut
from .shapes import ground_level


def make_scene(
    model: pin.Model,
    visual_model: pin.GeometryModel | None = None,
    closures: Iterable[Mark] = (),
    springs: Iterable[Strut] = (),
    rolling: Iterable[RollingBody] = (),
    outlines: Iterable[Outline] = (),
) -> Scene:
    """Build the scene: visuals, stick figures of massive bodies without visuals, closures and springs.

    Args:
        model: tree of the mechanism.
        visual_model: visual geometry, or None.
        closures: closures to draw, with their anchors.
        springs: springs and dampers between points.
        rolling: rolling bodies; those on joints with visuals are not drawn.
        outlines: curves on bodies; those on joints with visuals are not drawn.

    Returns:
        The scene.

    Raises:
        InputError: for an unreadable mesh file, or a visual of an unsupported kind.
    """
    closures, rolling = tuple(closures), tuple(rolling)
    meshes: dict[Path, Mesh] = {}
    visuals, ground = _visuals_and_ground(visual_model)
    shapes = [_shape("visual", g, meshes) for g in visuals]
    corners = _corners(visuals, shapes)
    with_visuals = {joint for joint, _ in corners}
    rolling_shown = [body for body in rolling if body.joint not in with_visuals]
    points = _points(model, closures)
    size = stick_figure.proportions(model, points, _lengths(closures, rolling_shown), corners)
    drawn = {body.joint for body in rolling_shown} | flexible_joints(model)
    generated = [
        *stick_figure.generate(model, points, size, with_visuals, drawn, hidden_joints(model)),
        *draw(rolling_shown),
        *draw_outlines((curve for curve in outlines if curve.joint not in with_visuals), 1.5 * size.width),
        *_marked(closures, with_visuals, size.width),
    ]
    rods = [Rod(c.name, c.first, c.second, c.rod) for c in closures if c.rod > 0] + list(flexible_links(model))
    shapes += [_shape(role, g, meshes) for role, g in generated]
    shapes += [_shape("link", stick_figure.rod(rod.name, rod.length, size.width), meshes) for rod in rods]
    anchors: list[tuple[Anchor, ...]] = [_fixed(g) for g in (*visuals, *(g for _, g in generated))]
    anchors += [(rod.first, rod.second) for rod in rods]
    named, rails = tuple(_uniquely_named(shapes)), _rails(model, shapes)
    return Scene(named, with_rods(model), tuple(anchors), size.width, closures, tuple(springs), ground, rails)


def _visuals_and_ground(visual_model: pin.GeometryModel | None) -> tuple[list[pin.GeometryObject], float | None]:
    """Return the visuals other than ground planes, and the height of the highest ground plane, if there is one."""
    visuals = list(visual_model.geometryObjects) if visual_model is not None else []
    levels = [ground_level(g) for g in visuals]
    others = [g for g, level in zip(visuals, levels, strict=True) if level is None]
    return others, max((x for x in levels if x is not None), default=None)


def _corners(visuals: Iterable[pin.GeometryObject], shapes: Iterable[Shape]) -> list[stick_figure.Point]:
    """Return the corners of the bounding boxes of visuals, in the frames of their joints."""
    return [
        (int(g.parentJoint), g.placement.act(np.array(corner)))
        for g, shape in zip(visuals, shapes, strict=True)
        for corner in product(*shape.bounds.T)
    ]


def _points(model: pin.Model, closures: Iterable[Mark]) -> list[stick_figure.Point]:
    """Return the end points of links: anchors of closures, and named frames (feet, tools, tips)."""
    anchors = [(int(j), p.translation) for mark in closures for j, p in (mark.first, mark.second)]
    modes = hidden_joints(model)
    links = (f for f in model.frames if f.parentJoint not in modes)
    named = [f for f in links if f.type == pin.FrameType.OP_FRAME and f.parentJoint]
    return anchors + [(int(f.parentJoint), f.placement.translation) for f in named]


def _lengths(closures: Iterable[Mark], rolling_shown: Iterable[RollingBody]) -> list[float]:
    """Return lengths of rods and diameters of rolling bodies, which determine the size of the mechanism."""
    diameters = [2 * (max(body.semi_axes) if body.semi_axes else body.rim + body.tyre) for body in rolling_shown]
    return [mark.rod for mark in closures if mark.rod > 0] + diameters


def _marked(closures: Iterable[Mark], with_visuals: set[int], width: float) -> Iterator[stick_figure.ShapeWithRole]:
    """Yield the anchors of closures, and pins between bodies without visuals."""
    for mark in closures:
        if with_visuals.isdisjoint((mark.first[0], mark.second[0])) and mark.coincide and not mark.rod:
            yield from stick_figure.pin_shapes(mark.name, *mark.first, mark.axis, width)
        yield from stick_figure.closure_balls(mark.name, (mark.first, mark.second), width)


def _rails(model: pin.Model, shapes: Iterable[Shape]) -> dict[int, int]:
    """Return the joint of each rail, by the index of the rail among the shapes."""
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
            root = Path(g.meshTexturePath)  # folder set by file readers; otherwise empty, or an image
            meshes[path] = read_mesh(g.name, path, root if g.meshTexturePath and root.is_dir() else None)
        mesh = meshes[path]
        file_colours = (mesh.format == "dae" or any(mesh.companions.values())) and not g.overrideMaterial
        scale = tuple(float(s) for s in g.meshScale)
        return Shape(g.name, role, "mesh", (), None if file_colours else rgba, bounds, mesh, scale)
    return Shape(g.name, role, "mesh", (), rgba, bounds, triangles(g.name, geometry))


def _primitive(geometry: object) -> tuple[str, tuple[float, ...]] | None:
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
