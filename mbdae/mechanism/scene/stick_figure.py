"""Stick figures: generated links, joints and markers for bodies without visual geometry.

A body is a star of links from its joint to the joints of its children and to the anchors of closures; a leaf body
extends to its centre of mass. Revolute joints are cylinders along their axis, prismatic joints boxes on a rail, all
other joints balls.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from ...tolerances import COINCIDENT, INPUT_DIGITS, SOLUTION_ROUNDING
from ..tree.joints import subspace
from ..tree.pinocchio_data import make_data
from ..tree.tree_terms import update_motions

Point = tuple[int, np.ndarray]  # a joint, and a point fixed in its frame [m]
ShapeWithRole = tuple[str, pin.GeometryObject]  # role and geometry

LINK_COLOURS = ("#4e79a7", "#59a14f", "#b07aa1", "#499894", "#9c755f", "#7c7cc0")
JOINT_COLOUR, GROUND_COLOUR, ROD_COLOUR = "#33383f", "#878d96", "#bc7a2c"
CLOSURE_COLOURS = ("#f28e2b", "#e0263c")


class Proportions(NamedTuple):
    """Sizes for drawing: ``extent`` of the mechanism, and ``width``, the radius of a link [m]."""

    extent: float
    width: float


def proportions(
    model: pin.Model,
    points: Sequence[Point],
    rods: Sequence[float] = (),
    corners: Sequence[Point] = (),
) -> Proportions:
    """Return the proportions of the mechanism at its neutral configuration.

    Args:
        model: the tree.
        points: further points of the mechanism, such as anchors of closures.
        rods: lengths of rods between these points [m].
        corners: corners of its visual geometry.

    Returns:
        The proportions, positive for any model.
    """
    data = make_data(model)
    update_motions(model, data, pin.neutral(model))
    massive = [i for i in range(1, model.njoints) if model.inertias[i].mass > 0]
    local = [(i, np.zeros(3)) for i in range(1, model.njoints)]
    local += [(i, model.inertias[i].lever) for i in massive]
    local += [*points, *corners]
    world = np.array([data.oMi[i].act(p) for i, p in local] or [np.zeros(3)])
    extent = max(float(np.linalg.norm(np.ptp(world, axis=0))), *rods, 0.0)
    if extent == 0.0:
        gyration = [np.sqrt(np.trace(model.inertias[i].inertia) / model.inertias[i].mass) for i in massive]
        extent = 2 * max(gyration, default=0.0) or 1.0
    if corners:
        return Proportions(extent, 0.006 * extent)
    ends = [p for i in range(1, model.njoints) for p in _ends(model, i, points)]
    typical = float(np.median([*map(np.linalg.norm, ends), *rods])) if ends or rods else extent
    return Proportions(extent, float(np.clip(0.008 * extent, 0.02 * typical, 0.12 * typical)))


def generate(
    model: pin.Model,
    points: Sequence[Point],
    size: Proportions,
    with_visuals: Collection[int],
    rolling: Collection[int] = (),
    hidden: Collection[int] = (),
) -> Iterator[ShapeWithRole]:
    """Yield shapes for bodies without visual geometry.

    Args:
        model: the tree.
        points: end points of links other than child joints, such as anchors of closures.
        size: lengths for drawing.
        with_visuals: joints whose bodies have visuals. If there are any, bodies without mass are omitted.
        rolling: joints whose bodies are drawn otherwise: rolling bodies, flexible bodies.
        hidden: joints that are not drawn.

    Yields:
        Role and geometry, fixed to joints; role is ``"ground"``, ``"rail"``, ``"joint"`` or ``"link"``.
    """
    drawn = [i for i in range(1, model.njoints) if i not in with_visuals and i not in hidden]
    shown = [i for i in drawn if not with_visuals or model.inertias[i].mass > 0]
    subspaces = _motion_subspaces(model)
    rotating = [i for i in shown if subspaces[i][3:].any()]
    yield from _ground(model, rotating, [] if with_visuals else points, size)
    for i in shown:
        yield from _joint(model, i, subspaces[i], points, size)
        if i not in rolling or _ends(model, i, points):
            yield from _body(model, i, points, size)


def _ground(
    model: pin.Model, joints: Sequence[int], points: Sequence[Point], size: Proportions
) -> Iterator[ShapeWithRole]:
    """Yield cubes at joints on the ground and at points of the ground."""
    supports = [model.jointPlacements[i] for i in joints if model.parents[i] == 0 and model.nvs[i] < 6]
    supports += [pin.SE3(np.eye(3), p) for j, p in points if j == 0]
    edge = 4.2 * size.width
    for support in _distinct(supports):
        yield coloured("ground", "ground", 0, support, coal.Box(edge, edge, edge), GROUND_COLOUR)


def closure_balls(name: str, anchors: Iterable[tuple[int, pin.SE3]], width: float) -> list[ShapeWithRole]:
    """Return two balls at the anchors of a closure; the first contains the second while the anchors coincide."""
    return [
        coloured("closure", f"{name} {k}", joint, placement, coal.Sphere(radius * width), colour)
        for (joint, placement), k, radius, colour in zip(anchors, "ab", (2.2, 1.7), CLOSURE_COLOURS, strict=True)
    ]


def rod(name: str, length: float, width: float) -> pin.GeometryObject:
    """Return the rod of a distance closure, in its local frame along z."""
    return coloured("link", f"{name} rod", 0, pin.SE3.Identity(), coal.Cylinder(0.6 * width, length), ROD_COLOUR)[1]


def pin_shapes(
    name: str, joint: int, placement: pin.SE3, axis: np.ndarray | None, width: float
) -> Iterator[ShapeWithRole]:
    """Yield the joint of a closure: a pin along the axis of a hinge, in the frame of its first anchor, or a ball."""
    if axis is None:
        yield coloured("joint", f"{name} pin", joint, placement, coal.Sphere(1.9 * width), JOINT_COLOUR)
    else:
        shape = coal.Cylinder(1.8 * width, 6 * width)
        yield coloured("joint", f"{name} pin", joint, placement * frame_along(np.zeros(3), axis), shape, JOINT_COLOUR)


def _body(model: pin.Model, i: int, points: Sequence[Point], size: Proportions) -> Iterator[ShapeWithRole]:
    name, colour, width = model.names[i], LINK_COLOURS[i % len(LINK_COLOURS)], size.width
    inertia = model.inertias[i]
    ends = _ends(model, i, points)
    for end in ends:
        yield coloured("link", f"{name} link", i, frame_along(end / 2, end), _capsule(end, width), colour)
    if ends or inertia.mass <= 0:
        return
    com = inertia.lever
    if np.linalg.norm(com) > 3 * width:
        yield coloured("link", f"{name} link", i, frame_along(com / 2, com), _capsule(com, width), colour)
        ball = coal.Sphere(2.5 * width)
        yield coloured("link", f"{name} mass", i, pin.SE3(np.eye(3), com), ball, colour)
        return
    if (axis := _axis(model, i)) is not None and (disc := _disc(inertia, axis, width)):
        placement = frame_along(com, axis)
        yield coloured("link", f"{name} body", i, placement, coal.Cylinder(*disc), colour)
        offset = pin.SE3(np.eye(3), np.array([0.5 * disc[0], 0.0, 0.0]))
        spoke = coal.Box(0.8 * disc[0], width, disc[1] + 0.6 * width)  # to show the rotation
        yield coloured("link", f"{name} spoke", i, placement * offset, spoke, GROUND_COLOUR)
        return
    moments, axes = np.linalg.eigh(inertia.inertia)
    if np.linalg.det(axes) < 0:
        axes = -axes
    edges = np.sqrt(np.maximum(6 / inertia.mass * (moments.sum() - 2 * moments), 0.0))
    solid = coal.Box(*np.maximum(edges, 2 * width)) if edges.max() > 4 * width else coal.Sphere(3 * width)
    yield coloured("link", f"{name} body", i, pin.SE3(axes, com), solid, colour)


def _axis(model: pin.Model, i: int) -> np.ndarray | None:
    """Return the axis of a revolute joint in its frame; None for other joints."""
    S = subspace(model.joints[i])
    return S[3:, 0] if S.shape[1] == 1 and S[3:].any() and not S[:3].any() else None


def _disc(inertia: pin.Inertia, axis: np.ndarray, width: float) -> tuple[float, float] | None:
    """Return radius and height of a solid cylinder about an axis with a given inertia; None if there is none."""
    about = float(axis @ inertia.inertia @ axis)
    across = (np.trace(inertia.inertia) - about) / 2
    symmetric = about * np.outer(axis, axis) + across * (np.eye(3) - np.outer(axis, axis))
    centred = np.linalg.norm(np.cross(axis, inertia.lever)) < COINCIDENT
    if not centred or not np.allclose(inertia.inertia, symmetric, rtol=INPUT_DIGITS, atol=COINCIDENT * about):
        return None
    radius = np.sqrt(2 * about / inertia.mass)
    height = np.sqrt(max(12 * across / inertia.mass - 3 * radius**2, 0.0))
    return (float(radius), max(float(height), 2 * width)) if radius > 4 * width else None


def _joint(
    model: pin.Model, i: int, subspace: np.ndarray, points: Sequence[Point], size: Proportions
) -> Iterator[ShapeWithRole]:
    name, width, (linear, angular) = model.names[i], size.width, np.split(subspace, 2)
    if model.nvs[i] == 6:
        return
    if model.nvs[i] != 1:
        ball = coal.Sphere(1.9 * width)
        yield coloured("joint", name, i, pin.SE3.Identity(), ball, JOINT_COLOUR)
        return
    if angular.any():
        cylinder = coal.Cylinder(1.8 * width, 6 * width)
        yield coloured("joint", name, i, frame_along(np.zeros(3), angular[:, 0]), cylinder, JOINT_COLOUR)
        return
    axis = frame_along(np.zeros(3), linear[:, 0])
    box = coal.Box(3.6 * width, 3.6 * width, 7 * width)
    yield coloured("joint", name, i, axis, box, JOINT_COLOUR)
    on_body = _rail_extent(model, i, linear[:, 0], points, size)
    low, high = on_body or _limits(model, i, size.extent)
    rail = pin.SE3(np.eye(3), np.array([0, 0, (low + high) / 2]))
    placement = model.jointPlacements[i] * axis * rail
    shape = coal.Cylinder(0.5 * width, max(high - low, width))
    yield coloured("link" if on_body else "rail", f"{name} rail", model.parents[i], placement, shape, GROUND_COLOUR)


def _limits(model: pin.Model, i: int, largest: float) -> tuple[float, float]:
    """Return the ends of the rail of a prismatic joint from its limits or the size of the mechanism [m]."""
    k = model.idx_qs[i]
    low, high = np.clip((model.lowerPositionLimit[k], model.upperPositionLimit[k]), -largest, largest)
    return float(low), float(high)


def _rail_extent(
    model: pin.Model, i: int, axis: np.ndarray, points: Sequence[Point], size: Proportions
) -> tuple[float, float] | None:
    """Return the extent of the guiding body of an unlimited prismatic joint, or else of the slider [m]; None if empty.

    The limit of an unlimited joint is the largest finite number, not infinity.
    """
    k, parent = model.idx_qs[i], model.parents[i]
    if not parent or min(abs(model.lowerPositionLimit[k]), abs(model.upperPositionLimit[k])) <= size.extent:
        return None
    placement = model.jointPlacements[i].inverse()
    extent = [axis @ placement.act(p) for p in (np.zeros(3), *_ends(model, parent, points))]
    if np.ptp(extent) < size.width:
        extent += [axis @ p for p in _ends(model, i, points)]
    return (min(extent), max(extent)) if np.ptp(extent) > size.width else None


def _ends(model: pin.Model, i: int, points: Sequence[Point]) -> list[np.ndarray]:
    """Return the end points of the links of body i, except its joint [m]."""
    ends = [model.jointPlacements[c].translation for c in model.children[i]]
    ends += [p for j, p in points if j == i]
    far = [pin.SE3(np.eye(3), p) for p in ends if np.linalg.norm(p) > COINCIDENT]
    return [placement.translation for placement in _distinct(far)]


def _distinct(placements: Iterable[pin.SE3]) -> list[pin.SE3]:
    distinct: list[pin.SE3] = []
    for placement in placements:
        p = placement.translation
        if not any(np.allclose(p, k.translation, rtol=INPUT_DIGITS, atol=SOLUTION_ROUNDING) for k in distinct):
            distinct.append(placement)
    return distinct


def _motion_subspaces(model: pin.Model) -> list[np.ndarray]:
    """Return (6, nv) per joint: linear, then angular velocity in the joint's frame at the neutral configuration."""
    return [np.empty((6, 0)), *(subspace(joint) for joint in list(model.joints)[1:])]


def frame_along(origin: np.ndarray, direction: np.ndarray) -> pin.SE3:
    """Return a frame with z along a direction."""
    return pin.SE3(pin.Quaternion.FromTwoVectors(pin.ZAxis, np.array(direction)), np.array(origin))


def _capsule(end: np.ndarray, width: float) -> coal.Capsule:
    return coal.Capsule(width, float(np.linalg.norm(end)))


def coloured(
    role: str, name: str, joint: int, placement: pin.SE3, shape: coal.CollisionGeometry, colour: str
) -> ShapeWithRole:
    """Return a geometry fixed to a joint, with its role and its colour."""
    geometry = pin.GeometryObject(name, int(joint), placement, shape)
    geometry.meshColor = np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)] + [1.0])
    return role, geometry
