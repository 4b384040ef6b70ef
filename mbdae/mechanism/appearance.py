"""Appearance of a mechanism: its visuals, and shapes derived from closures, springs and drivers."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from .closures.closure import Closure
from .closures.kinds.cam import CamClosure
from .closures.kinds.cylindrical import CylindricalClosure
from .closures.kinds.distance import DistanceClosure
from .closures.kinds.revolute import RevoluteClosure
from .closures.kinds.rolling import RollingClosure
from .closures.kinds.slot import SlotClosure
from .forces.spring_damper import SpringDamper
from .scene.make_scene import make_scene
from .scene.profile_outlines import Outline
from .scene.rolling_bodies import RollingBody
from .scene.scene import Mark, Scene, Strut
from .tree.frames import Anchor, anchor

if TYPE_CHECKING:
    from .mechanism import Mechanism

DRAWN_WITH_AXIS = (RevoluteClosure, CylindricalClosure)
AnchoredClosures = Iterable[tuple[Closure, Sequence[Anchor]]]


def appearance(mech: "Mechanism") -> Scene:
    """Return the shapes of a mechanism, and their placements."""
    closures = mech.closure_anchors
    marks, bodies, outlines = _marks(closures), _rolling_bodies(closures), _outlines(closures)
    return make_scene(mech.model, mech.visuals, marks, _struts(mech), bodies, outlines)


def _struts(mech: "Mechanism") -> Iterator[Strut]:
    """Yield springs and dampers, and drivers of distances: hydraulic cylinders, linear actuators."""
    for force in mech.forces:
        if isinstance(force, SpringDamper):
            first, second = _placed(anchor(mech.model, name) for name in force.frames)
            coil = force.stiffness != 0
            yield Strut(force.name, first, second, force.length, coil, tube=force.damping > 0 or not coil)
    for driver in mech.drivers:
        if driver.frames:
            first, second = _placed(anchor(mech.model, name) for name in driver.frames)
            yield Strut(driver.name, first, second, coil=False, tube=True)


def _placed(anchors: Iterable[Anchor]) -> Iterator[tuple[int, pin.SE3]]:
    return ((a.joint, pin.SE3(a.R, a.p)) for a in anchors)


def _marks(closures: AnchoredClosures) -> Iterator[Mark]:
    for c, anchors in closures:
        if not c.distinct_frames:
            first, second = _placed(anchors)
            axis = np.array(c.axis) if isinstance(c, DRAWN_WITH_AXIS) else None
            length = c.length if isinstance(c, DistanceClosure) else 0.0
            yield Mark(c.name, first, second, length, axis, c.coincident_origins)


def _rolling_bodies(closures: AnchoredClosures) -> Iterator[RollingBody]:
    for closure, (_, b) in closures:
        placement = pin.SE3(b.R, b.p)
        if isinstance(closure, RollingClosure):
            s = closure.shape
            axle = None if s.axle is None else np.array(s.axle)
            yield RollingBody(closure.name, b.joint, placement, axle, s.rim, s.tyre, s.semi_axes, s.centre)
        elif isinstance(closure, CamClosure) and closure.radius:
            yield RollingBody(closure.name, b.joint, placement, None, 0.0, closure.radius, None, (0.0, 0.0, 0.0))


def _outlines(closures: AnchoredClosures) -> Iterator[Outline]:
    for closure, (a, _) in closures:
        if isinstance(closure, CamClosure | SlotClosure):
            path, placement = closure.profile.path, pin.SE3(a.R, a.p)
            yield Outline(closure.name, a.joint, placement, path.points, path.closed, closure.kind == "cam")
