"""Detected symmetries of a mechanism, and shifts of joints that leave its equations invariant.

A rigid motion g of all bodies, or a shift of joints, is a symmetry if rows and accelerations are equivariant at points
of a motion, each in its mode,

    g_rows(g q) = g_rows(q),   (G v)(g y) = (G v)(y),   a_i(g y) = Ad(g) a_i(y),   s'(g y) = s'(y)

with the spatial accelerations a_i of all bodies in world axes at the origin.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from ...errors import InputError, StepError
from ...system import Array
from ...tolerances import VISIBLE, ZERO_SPEED
from ..closures.clutch import Clutch
from ..forces.sampled import SampledElement
from ..formulations.index2 import Index2System
from ..hybrid.mode_point import AllRows
from ..tree.pinocchio_data import make_data
from .symmetry import MOTIONS, Symmetry, cyclic_joints

if TYPE_CHECKING:
    from ..mechanism import Mechanism

TWO_PI = 2 * np.pi
AMOUNTS = (0.7, -1.9)  # rad, characteristic lengths
VELOCITY_CHANGE = 0.3  # fraction of the characteristic speed: change of velocity at a further point of comparison


class MotionPoint(NamedTuple):
    """A point of a motion: time, y (n,), and the mode."""

    t: float
    y: Array
    mode: tuple[int, ...]


def symmetries_of(mech: "Mechanism", points: Sequence[MotionPoint]) -> tuple[str, ...]:
    """Return the names of the independent symmetries of a mechanism: cyclic joints, then motions of all bodies.

    Joints that share the name of a motion of all bodies come last: if they move all bodies, it is the same symmetry.
    """
    system, joints = mech.system(), cyclic_joints(mech)
    q = system.split(points[0].y)[0]
    points, found, directions = _with_velocities(system, points), list[str](), np.zeros((mech.nv, 0))
    for name in dict.fromkeys([*(name for name, joint in joints.items() if name == joint), *MOTIONS, *joints]):
        try:
            (symmetry,) = Symmetry.named(system, [name])
            w = symmetry.direction(q)
        except InputError:  # the joints do not allow it, or bodies deform
            continue
        rest = w - directions @ np.linalg.lstsq(directions, w, rcond=None)[0] if found else w
        if np.linalg.norm(rest) <= VISIBLE * np.linalg.norm(w):
            continue
        unit = mech.coordinate_scales[np.abs(w).argmax()] if not symmetry.moves_bodies else _unit(mech, name)
        if all(_is_equivariant(system, x, symmetry, amount * unit) for x in points for amount in AMOUNTS):
            found, directions = [*found, name], np.column_stack([directions, w])
    return tuple(found)


def shift_units(mech: "Mechanism") -> Array:
    """Return the shift (nv,) in rad or m that may leave a joint unchanged: a revolution, a pitch; 0 if none."""
    out = np.zeros(mech.nv)
    joints = [j for j in mech.model.joints if (j.nq, j.nv) == (1, 1)]
    revolute = [j for j in joints if j.shortname().removeprefix("JointModel").startswith("R")]
    out[[j.idx_v for j in revolute]] = TWO_PI
    for clutch in mech.constraints:
        if isinstance(clutch, Clutch) and clutch.pitch:
            indices = [mech.model.joints[mech.model.getJointId(name)].idx_v for name in clutch.between]
            out[indices] = clutch.pitch
    return out


def is_invariant(mech: "Mechanism", point: MotionPoint, shift: Array, T: float) -> bool:
    """Return whether equations at a point are invariant under shifts of joints by -shift (nv,) and of time by -T."""
    system = mech.system()
    q = system.manifold.integrate(system.split(point.y)[0], -shift)
    shifted = point._replace(t=point.t - T, y=np.concatenate([q, point.y[mech.nq :]]))
    reference, transformed = _point_terms(system, point), _point_terms(system, shifted)
    if reference is None or transformed is None:
        return False
    return _are_equal(system, reference, transformed, reference.rates)


class _Terms(NamedTuple):
    """g and G v + g_t of all rows, (ng,) each, and y' in the tangent, (ny,), with jumps of controller states added."""

    g: Array
    speeds: Array
    rates: Array


def _unit(mech: "Mechanism", name: str) -> float:
    return 1.0 if name == "turn" else mech.characteristic_length


def _with_velocities(system: Index2System, points: Sequence[MotionPoint]) -> list[MotionPoint]:
    """Return the points, and the first point with changed velocities."""
    t, y, mode = points[0]
    mech, perturbed, iv = system.mechanism, y.copy(), slice(system.nq, system.nq + system.nv)
    perturbed[iv] += VELOCITY_CHANGE * mech.characteristic_rate * mech.coordinate_scales * np.cos(np.arange(system.nv))
    system.enter(mode)
    try:
        system.derivative(t, y)
        return [*points, MotionPoint(t, system.project_state(t, perturbed), mode)]
    except StepError:
        return list(points)


def _point_terms(system: Index2System, point: MotionPoint) -> _Terms | None:
    """Return the terms of a point; None if accelerations do not exist."""
    t, y, mode = point
    system.enter(mode)
    q, v = system.split(y)
    g, G, g_t = AllRows(system)(t, q)
    try:
        rates = system.derivative(t, y)[0]
    except StepError:
        return None
    s = system.element_states(y)
    for law, span in system.laws.bound:
        if isinstance(law, SampledElement) and not law.external:  # its samples enter v' only after the next instant
            rates[2 * system.nv :][span] += np.concatenate(law.sampled(t, q, v, s, span)) - s[span]
    return _Terms(np.where(system.constraints.positional, g, 0.0), G @ v + g_t, rates)


def _is_equivariant(system: Index2System, point: MotionPoint, symmetry: Symmetry, sigma: float) -> bool:
    """Return whether rows and accelerations at a point are equivariant under a symmetry."""
    q, v = system.split(point.y)
    moved = symmetry.moved(q, sigma)
    D, y = symmetry.tangent(q, moved, sigma), point.y.copy()
    y[: system.nq], y[system.nq : system.nq + system.nv] = moved, D @ v
    reference, transformed = _point_terms(system, point), _point_terms(system, point._replace(y=y))
    if reference is None or transformed is None:
        return False
    expected = reference.rates.copy()
    if symmetry.moves_bodies:
        nv = system.nv
        before = _body_accelerations(symmetry, q, v, reference.rates[nv : 2 * nv])
        after = _body_accelerations(symmetry, moved, D @ v, transformed.rates[nv : 2 * nv])
        rotated = before @ pin.exp6(symmetry.twist(q) * sigma).action.T
        if not np.abs(after - rotated).max(initial=0.0) <= VISIBLE * np.abs(before).max(initial=0.0) + VISIBLE**2:
            return False
        expected[: 2 * nv] = transformed.rates[: 2 * nv]
    return _are_equal(system, reference, transformed, expected)


def _are_equal(system: Index2System, reference: _Terms, transformed: _Terms, expected: Array) -> bool:
    """Return whether two points have the same rows, and the second point has the expected rates."""
    mech = system.mechanism
    size = mech.characteristic_rate + np.abs(reference.speeds / mech.row_scales).max(initial=0.0)
    rows = np.abs((transformed.g - reference.g) / mech.row_scales).max(initial=0.0) <= VISIBLE
    speeds = np.abs((transformed.speeds - reference.speeds) / mech.row_scales).max(initial=0.0) <= VISIBLE * size
    sizes = np.abs(expected)  # the error of any coordinate includes rounding of the fastest
    rates = np.abs(transformed.rates - expected) <= VISIBLE * (sizes + VISIBLE) + ZERO_SPEED * sizes.max()
    return bool(rows and speeds and rates.all())


def _body_accelerations(symmetry: Symmetry, q: Array, v: Array, vdot: Array) -> Array:
    """Return the spatial accelerations of the bodies in world axes at the origin, (n, 6)."""
    model, world = symmetry.system.model, pin.ReferenceFrame.WORLD
    data = make_data(model, complete=True)
    pin.forwardKinematics(model, data, q, v, vdot)
    return np.array([pin.getAcceleration(model, data, i, world).vector for i in symmetry.bodies])
