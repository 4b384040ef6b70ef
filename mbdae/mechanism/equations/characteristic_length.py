"""Characteristic length of a mechanism, which makes lengths and angles comparable.

Thresholds and steps of searches are in rad. Lengths are divided by l first: the coordinates of sliding joints, and the
rows of closures whose g is in m. The search is therefore independent of the size of a mechanism, from millimetres to
kilometres.
"""

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...system import Array
from ...tolerances import COINCIDENT
from ..tree.frames import anchor
from ..tree.joints import translation_components

if TYPE_CHECKING:
    from ..mechanism import Mechanism

# keys of closures with values in m
CLOSURE_LENGTHS = ("length", "radius", "tyre", "radii", "semi_axes", "centre", "surface_radius", "lead")


def characteristic_length(mech: "Mechanism") -> float:
    """Return l > 0 in m, see `Mechanism.characteristic_length`.

    l is the largest of: distances of joints, and of the frames of closures and drivers, from their parent joint (on the
    ground, from the first joint); lengths, radii and profiles of closures. If these are negligible, l is the largest
    distance of a frame, a point of a force, or a centre of mass from its joint, or radius of gyration; otherwise 1.
    """
    linkage, bodies = max(linkage_lengths(mech), default=0.0), max(_body_lengths(mech), default=0.0)
    return (linkage if linkage > COINCIDENT * bodies else bodies) or 1.0


def row_scales(mech: "Mechanism") -> Array:
    """Return the unit scale of each row's g, (ng,): l for lengths, 1 for angles and cosines."""
    return np.where(mech.row_units == "m", mech.characteristic_length, 1.0)


def coordinate_scales(mech: "Mechanism") -> Array:
    """Return the unit scale of each tangent component, (nv,): l for translations, 1 for angles."""
    return np.where(translation_components(mech.model), mech.characteristic_length, 1.0)


def q_scales(mech: "Mechanism") -> Array:
    """Return the unit scale of each component of q, (nq,): l for positions, 1 for angles and quaternions."""
    out, translations = np.ones(mech.nq), translation_components(mech.model)
    for joint in list(mech.model.joints)[1:]:
        n = int(translations[joint.idx_v : joint.idx_v + joint.nv].sum())  # which come first in q
        out[joint.idx_q : joint.idx_q + n] = mech.characteristic_length
    return out


def linkage_lengths(mech: "Mechanism") -> Iterator[float]:
    """Yield lengths in m between joints and the points where closures act, and lengths of closures."""
    model = mech.model
    for parent, placement in list(zip(model.parents, model.jointPlacements, strict=True))[1:]:
        yield _distance(model, parent, placement.translation)
    for spec in mech.constraints:
        yield from _frame_distances(model, spec.frames or ())
        yield from (abs(x) for key in CLOSURE_LENGTHS for x in _numbers(getattr(spec, key, None)))
        profile = getattr(spec, "profile", None)
        yield max((abs(x) for x in _numbers(profile.model_dump())), default=0.0) if profile else 0.0


def _body_lengths(mech: "Mechanism") -> Iterator[float]:
    """Yield sizes of the bodies, and distances of the points where forces act."""
    model = mech.model
    yield from (float(np.linalg.norm(f.placement.translation)) for f in model.frames if f.parentJoint)
    for force in mech.forces:
        yield from _frame_distances(model, getattr(force, "frames", None) or ())
    for body in list(model.inertias)[1:]:
        yield float(np.linalg.norm(body.lever))
        if body.mass > 0:
            yield float(np.sqrt(np.abs(body.inertia).max() / body.mass))


def _frame_distances(model: pin.Model, names: Iterable[str]) -> Iterator[float]:
    """Yield the distances of frames from their joints, see `_distance`."""
    for a in (anchor(model, name) for name in names):
        yield _distance(model, a.joint, a.p)


def _distance(model: pin.Model, joint: int, p: Array) -> float:
    """Return the distance of a point p (3,) of a body from its joint; of the ground, from its first joint."""
    return float(np.linalg.norm(p if joint else p - model.jointPlacements[min(1, model.njoints - 1)].translation))


def _numbers(value: object) -> Iterator[float]:
    """Yield all numbers in a value of a table."""
    if isinstance(value, dict):
        value = tuple(value.values())
    if isinstance(value, tuple | list):
        for x in value:
            yield from _numbers(x)
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield float(value)
