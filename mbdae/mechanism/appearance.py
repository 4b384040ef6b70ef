"""What a mechanism looks like: its visuals, and what its closures and springs say of the rest."""

from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from .closures.closure import Closure
from .forces.spring_damper import SpringDamper
from .frames import Anchor, anchor
from .scene.outlines import Outline
from .scene.rolling_bodies import RollingBody
from .scene.scene import Mark, Scene, make_scene

if TYPE_CHECKING:
    from .mechanism import Mechanism

APART = ("rolling", "knife_edge", "gear", "screw", "cam", "slot")  # closures whose frames do not meet: no gap is seen


def appearance(mech: "Mechanism") -> Scene:
    """The shapes of a mechanism, and where they are."""
    springs = [(f, [anchor(mech.model, n) for n in f.frames]) for f in mech.forces if isinstance(f, SpringDamper)]
    found = mech.closure_anchors
    return make_scene(mech.model, mech.visuals, _marks(found), _marks(springs), _rolling(found), _outlines(found))


def _marks(found: Iterable[tuple[Any, Sequence[Anchor]]]) -> list[Mark]:
    meeting = ((x, ends) for x, ends in found if getattr(x, "kind", "") not in APART)
    placed = ((x, [(e.joint, pin.SE3(e.R, e.p)) for e in ends]) for x, ends in meeting)
    return [Mark(x.name, a, b, rod=x.length or 0.0) for x, (a, b) in placed]


def _rolling(found: Iterable[tuple[Closure, Sequence[Anchor]]]) -> Iterator[RollingBody]:
    for closure, (_, b) in found:
        place = pin.SE3(b.R, b.p)
        if closure.kind == "rolling":
            s = closure.shape
            axle = None if s.axle is None else np.array(s.axle)
            yield RollingBody(closure.name, b.joint, place, axle, s.rim, s.tyre, s.semi_axes, s.centre)
        elif closure.kind == "cam" and closure.radius:
            yield RollingBody(closure.name, b.joint, place, None, 0.0, closure.radius, None, (0.0, 0.0, 0.0))


def _outlines(found: Iterable[tuple[Closure, Sequence[Anchor]]]) -> Iterator[Outline]:
    for closure, (a, _) in found:
        if closure.profile:
            path, place = closure.profile.path, pin.SE3(a.R, a.p)
            yield Outline(closure.name, a.joint, place, path.points, path.closed, closure.kind == "cam")
