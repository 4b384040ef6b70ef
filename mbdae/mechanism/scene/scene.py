"""What a mechanism looks like: plain shapes, and where each of them is at a configuration.

Nothing here draws. A `Scene` is data that any viewer can show without knowing Pinocchio: the shapes
once, and `Scene.placements(q)` for every instant.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from ...errors import InputError
from ..pinocchio_data import make_data
from . import stick_figure
from .meshes import FILE_FORMATS, Mesh, read_mesh, triangles
from .outlines import Outline, draw_outlines
from .rolling_bodies import RollingBody, draw
from .shapes import ground_level

Anchor = tuple[int, pin.SE3]  # a joint, and a placement fixed in its frame


class Mark(NamedTuple):
    """A closure to be shown: its two anchors, which coincide while the loop is closed.

    Attributes:
        name: the closure's name.
        first: joint and placement of the first anchor.
        second: joint and placement of the second anchor.
        rod: length of the massless rod of a distance closure [m], 0 for none.
        axis: of a hinge, (3,) in the first anchor; None where the anchors turn about several.
        meets: whether a closed loop brings both together, so that their distance is a gap.
    """

    name: str
    first: Anchor
    second: Anchor
    rod: float = 0.0
    axis: np.ndarray | None = None
    meets: bool = True


class Strut(NamedTuple):
    """What pulls or pushes between two points.

    Attributes:
        name: of the force.
        first: joint and placement of the first anchor.
        second: joint and placement of the second anchor.
        length: where it is at rest [m]; 0 when unknown.
        coil: whether it is drawn as a coil.
        tube: whether it is drawn as a tube with a rod in it: dampers, cylinders.
    """

    name: str
    first: Anchor
    second: Anchor
    length: float = 0.0
    coil: bool = True
    tube: bool = False


@dataclass(frozen=True, eq=False)
class Shape:
    """One rigid thing to draw, in its own frame (axes of symmetry along z).

    Attributes:
        name: unique within a scene.
        role: ``"visual"``, ``"link"``, ``"joint"``, ``"ground"``, ``"rail"`` or ``"closure"``.
        kind: ``"box"``, ``"sphere"``, ``"ellipsoid"``, ``"cylinder"``, ``"cone"``, ``"capsule"`` or
            ``"mesh"``.
        size: [m] box: three edges; sphere: radius; ellipsoid: three radii; cylinder, cone: radius and
            length; capsule: radius and length between the centres of its caps; mesh: empty.
        rgba: colour, each in [0, 1]; None: a mesh keeps the colours of its file.
        bounds: (2, 3) lower and upper corner of the shape, in its frame [m].
        mesh: the triangles of a mesh.
        scale: (3,) factors from the mesh's coordinates to metres, negative ones mirror.
    """

    name: str
    role: str
    kind: str
    size: tuple[float, ...]
    rgba: tuple[float, ...] | None
    bounds: np.ndarray
    mesh: Mesh | None = None
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Scene:
    """The shapes of a mechanism, and where they are.

    Attributes:
        shapes: what is drawn, n of them.
        anchors: of each shape, one: fixed to a joint; two: from the first towards the second.
        width: how thick generated links are: their radius [m].
        marks: the closures between frames; both of their ends are shapes of the role ``"closure"``.
        springs: what is drawn between two points, longer and shorter as they move, s of them.
        ground: height of the ground [m]; None where nothing says it.
    """

    shapes: tuple[Shape, ...]
    _model: pin.Model
    anchors: tuple[tuple[Anchor, ...], ...]
    width: float
    marks: tuple[Mark, ...] = ()
    springs: tuple[Strut, ...] = ()
    ground: float | None = None
    _rails: Mapping[int, int] = field(default_factory=dict)  # shapes that are rails, and the joints on them

    @property
    def carriers(self) -> list[tuple[int, ...]]:
        """The joints to which each shape is fixed: one, or two where it leads from one to the other."""
        return [tuple(joint for joint, _ in anchors) for anchors in self.anchors]

    def placements(self, q: np.ndarray) -> np.ndarray:
        """Where the shapes are in the world.

        Args:
            q: (nq,) a configuration, or (m, nq) several.

        Returns:
            (n, 7) or (m, n, 7): x, y, z [m] and the unit quaternion x, y, z, w of each shape.

        Raises:
            InputError: q has another length.
        """
        q = np.asarray(q, dtype=float)
        if q.ndim not in (1, 2) or q.shape[-1] != self._model.nq:
            raise InputError(f"q must have shape ({self._model.nq},) or (m, {self._model.nq}), not {q.shape}")
        data = make_data(self._model)
        out = np.empty((*q.shape[:-1], len(self.shapes), 7))
        for row, place in zip(np.atleast_2d(q), out.reshape(-1, len(self.shapes), 7), strict=True):
            pin.forwardKinematics(self._model, data, row)
            for k, anchors in enumerate(self.anchors):
                ends = [data.oMi[joint] * placement for joint, placement in anchors]
                here = ends[0] if len(ends) == 1 else _towards(ends[0], ends[1], self.shapes[k].size[1])
                place[k] = pin.SE3ToXYZQUAT(here)
        return out

    def ends(self, pairs: Iterable[Mark | Strut], q: np.ndarray) -> np.ndarray:
        """Where closures or springs begin and end.

        Args:
            pairs: some of ``marks`` or ``springs``, s of them.
            q: (m, nq) configurations.

        Returns:
            (m, s, 2, 3) points of the world [m].
        """
        anchors = [(pair.first, pair.second) for pair in pairs]
        data, out = make_data(self._model), np.empty((len(q), len(anchors), 2, 3))
        for row, points in zip(q, out, strict=True):
            pin.forwardKinematics(self._model, data, row)
            for k, pair in enumerate(anchors):
                points[k] = [(data.oMi[joint] * placement).translation for joint, placement in pair]
        return out

    def travelled(self, q: np.ndarray) -> "Scene":
        """The scene of a motion: rails reach no further than what slides on them.

        Args:
            q: (m, nq) configurations of the motion.
        """
        shapes, anchors = list(self.shapes), list(self.anchors)
        for k, joint in self._rails.items():
            at = q[:, self._model.idx_qs[joint]]
            (radius, length), ((ground, middle),) = shapes[k].size, anchors[k]
            half = min(length, np.ptp(at) + 14 * self.width) / 2
            foot = self._model.jointPlacements[joint].translation - middle.translation
            shift = (at.min() + at.max()) / 2 + middle.rotation[:, 2] @ foot
            bounds = shapes[k].bounds * [1, 1, 2 * half / length]
            shapes[k] = replace(shapes[k], size=(radius, 2 * half), bounds=bounds)
            anchors[k] = ((ground, middle * pin.SE3(np.eye(3), np.array([0.0, 0.0, shift]))),)
        return replace(self, shapes=tuple(shapes), anchors=tuple(anchors))


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
        closures: what to mark, and between which anchors.
        springs: springs and dampers from point to point.
        rolling: bodies that roll; those of joints with visuals are not drawn.
        outlines: curves fixed to bodies, likewise.

    Returns:
        The scene.

    Raises:
        InputError: a mesh file cannot be read, or a visual is of a kind that cannot be drawn.
    """
    closures, rolling = tuple(closures), tuple(rolling)
    meshes: dict[Path, Mesh] = {}
    visuals = list(visual_model.geometryObjects) if visual_model is not None else []
    levels = [ground_level(g) for g in visuals]
    visuals = [g for g, level in zip(visuals, levels, strict=True) if level is None]
    shapes = [_shape("visual", g, meshes) for g in visuals]
    points = [(int(j), p.translation) for mark in closures for j, p in (mark.first, mark.second)]
    named = [f for f in model.frames if f.type == pin.FrameType.OP_FRAME and f.parentJoint]  # feet, tools, tips
    points += [(int(f.parentJoint), f.placement.translation) for f in named]
    corners = [
        (int(g.parentJoint), g.placement.act(np.array(corner)))
        for g, shape in zip(visuals, shapes, strict=True)
        for corner in product(*shape.bounds.T)
    ]
    seen = {joint for joint, _ in corners}
    round_ones = [body for body in rolling if body.joint not in seen]
    rods = [mark.rod for mark in closures if mark.rod > 0]
    rods += [2 * (max(body.semi_axes) if body.semi_axes else body.rim + body.tyre) for body in round_ones]
    size = stick_figure.proportions(model, points, rods, corners)
    parts = list(stick_figure.generate(model, points, size, seen, {body.joint for body in round_ones}))
    parts += draw(round_ones)
    parts += draw_outlines((curve for curve in outlines if curve.joint not in seen), 1.5 * size.width)
    for mark in closures:
        if seen.isdisjoint((mark.first[0], mark.second[0])) and mark.meets and not mark.rod:
            parts += stick_figure.pin_of(mark.name, *mark.first, mark.axis, size.width)
        parts += stick_figure.closure_balls(mark.name, (mark.first, mark.second), size.width)
    rails = {len(visuals) + k: model.getJointId(g.name.removesuffix(" rail"))
             for k, (role, g) in enumerate(parts) if role == "rail"}  # fmt: skip
    shapes += [_shape(role, g, meshes) for role, g in parts]
    fixed = [*visuals, *(g for _, g in parts)]
    anchors: list[tuple[Anchor, ...]] = [((int(g.parentJoint), g.placement),) for g in fixed]
    for mark in closures:
        if mark.rod > 0:
            shapes.append(_shape("link", stick_figure.rod(mark.name, mark.rod, size.width), meshes))
            anchors.append((mark.first, mark.second))
    named_shapes = tuple(_uniquely_named(shapes))
    ground = max((x for x in levels if x is not None), default=None)
    return Scene(named_shapes, model, tuple(anchors), size.width, closures, tuple(springs), ground, rails)


def _towards(first: pin.SE3, second: pin.SE3, length: float) -> pin.SE3:
    """The middle of a rod of some length that begins at a point and leads towards another, with z along it."""
    d = second.translation - first.translation
    turn = pin.Quaternion.FromTwoVectors(pin.ZAxis, d) if d.any() else pin.Quaternion.Identity()
    return pin.SE3(turn, first.translation + turn * np.array([0.0, 0.0, length / 2]))


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
            meshes[path] = read_mesh(g.name, path)
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
