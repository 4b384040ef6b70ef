"""Rolling bodies, from closures: wheels with a tyre and spokes, balls with a belt, ellipsoids."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin

from .shapes import mesh
from .stick_figure import GROUND_COLOUR, JOINT_COLOUR, LINK_COLOURS, ShapeWithRole, coloured, frame_along

THICKNESS = 0.04  # fraction of the radius: half the thickness of a drawn knife edge
SPOKES, RING_SEGMENTS, SECTION_SEGMENTS = 6, 48, 10


class RollingBody(NamedTuple):
    """A rolling body.

    Attributes:
        name: name of the closure.
        joint: joint of the body.
        placement: placement of the frame of the closure on the joint.
        axle: unit vector in the frame of the closure, (3,); None for a ball or an ellipsoid.
        rim: radius of the circle of tyre section centres [m].
        tyre: radius of the tyre section, or of a ball [m].
        semi_axes: semi-axes of an ellipsoid [m], (3,), or None.
        centre: centre of an ellipsoid [m], (3,).
    """

    name: str
    joint: int
    placement: pin.SE3
    axle: np.ndarray | None
    rim: float
    tyre: float
    semi_axes: tuple[float, float, float] | None
    centre: tuple[float, float, float]


def draw(bodies: Iterable[RollingBody]) -> Iterator[ShapeWithRole]:
    """Yield the shapes of rolling bodies, with marks that show their rotation."""
    for k, body in enumerate(bodies):
        colour = LINK_COLOURS[k % len(LINK_COLOURS)]
        if body.semi_axes:
            placement = body.placement * pin.SE3(np.eye(3), np.array(body.centre))
            yield coloured("link", body.name, body.joint, placement, coal.Ellipsoid(*body.semi_axes), colour)
        elif body.axle is None or body.rim < body.tyre:
            rotation = frame_along(np.zeros(3), np.array([0.0, 0.0, 1.0]) if body.axle is None else body.axle)
            belt = coal.Cylinder(1.003 * (body.rim + body.tyre), 0.2 * body.tyre)
            ball = coal.Sphere(body.rim + body.tyre)
            yield coloured("link", body.name, body.joint, body.placement, ball, colour)
            yield coloured("link", f"{body.name} belt", body.joint, body.placement * rotation, belt, JOINT_COLOUR)
        else:
            yield from _wheel(body, LINK_COLOURS[0 if k % len(LINK_COLOURS) else 1])


def _wheel(body: RollingBody, marked: str) -> Iterator[ShapeWithRole]:
    outer = body.rim + body.tyre
    thickness = max(body.tyre, THICKNESS * outer)
    placement = body.placement * frame_along(np.zeros(3), np.asarray(body.axle))
    yield coloured(
        "link", f"{body.name} tyre", body.joint, placement, _torus(outer - thickness, thickness), JOINT_COLOUR
    )
    hub = coal.Cylinder(2 * THICKNESS * outer, 4 * THICKNESS * outer)
    yield coloured("link", f"{body.name} hub", body.joint, placement, hub, GROUND_COLOUR)
    for k in range(SPOKES):
        angle = 2 * np.pi * k / SPOKES
        end = (outer - thickness) * np.array([np.cos(angle), np.sin(angle), 0.0])
        spoke = coal.Cylinder((2 if k == 0 else 1) * THICKNESS * outer / 2, outer - thickness)  # a thick one marks 0
        shade = GROUND_COLOUR if k else marked
        yield coloured("link", f"{body.name} spoke", body.joint, placement * frame_along(end / 2, end), spoke, shade)


def _torus(radius: float, section: float) -> coal.BVHModelOBBRSS:
    """Return a torus about z."""
    i, j = np.meshgrid(np.arange(RING_SEGMENTS), np.arange(SECTION_SEGMENTS), indexing="ij")
    a, b = 2 * np.pi * i / RING_SEGMENTS, 2 * np.pi * j / SECTION_SEGMENTS
    distance = radius + section * np.cos(b)
    points = np.stack([distance * np.cos(a), distance * np.sin(a), section * np.sin(b)], axis=-1).reshape(-1, 3)
    current, following = i * SECTION_SEGMENTS, (i + 1) % RING_SEGMENTS * SECTION_SEGMENTS
    up = (j + 1) % SECTION_SEGMENTS
    first = np.stack([current + j, following + j, following + up], axis=-1).reshape(-1, 3)
    second = np.stack([current + j, following + up, current + up], axis=-1).reshape(-1, 3)
    return mesh(points, np.concatenate([first, second]))
