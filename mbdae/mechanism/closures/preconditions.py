"""Preconditions of closures: assumptions of their rows about both frames that they do not enforce.

    gear      axes stay parallel, r_a + r_b apart
    bevel     axes intersect at a constant angle
    screw     the body rotates about its axis only
    cam       a flat face is perpendicular to the plane of its profile
    rolling   without a contact row, joints keep the body on its surface

They are checked at the start, for the motions that the other closures allow, and at the nodes of a run.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...errors import InputError, StepError
from ...system import Array
from ..frames import Pair, find_joint
from .closure import Closure
from .rows import unit_axis

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism

FITS = 1e-3  # of the radii: numbers of three digits are consistent, wheels that do not mesh are not
TILT = 1e-3  # rad
RANK = 1e-9  # of the largest singular value
Z = (0.0, 0.0, 1.0)


def assuming(mech: "Mechanism") -> list[Closure]:
    """Closures of a mechanism that have a precondition."""
    return [c for c in mech.closures if c.kind in ("gear", "bevel", "screw") or _faces(c) or c.contact is False]


def refuse_unfit(mech: "Mechanism", q: Array) -> None:
    """Reject a configuration q (nq,) in which a closure's precondition does not hold.

    Raises:
        InputError: naming the closure, the expected and the actual value.
    """
    if not (found := assuming(mech)):
        return
    system = mech.system()
    G = system.jacobian(q)
    for closure, pair in _placed(system, found):
        if closure.within and not closure.within.depth(q[find_joint(mech.model, closure.within.joint).idx_q]) > 0:
            continue
        if words := unfit(closure, pair, pair.Rb.T @ pair.Ra) or _free_rotation(mech, closure, pair, G):
            raise InputError(f"closure {closure.name!r}: {words}")


def lost_precondition(system: "Index2System", ts: Array, qs: Array) -> str:
    """Return which precondition is lost at a node of a run, and since when; empty if none.

    Args:
        system: a workspace; its kinematics are overwritten.
        ts: times in s, (n,).
        qs: configurations, (n, nq).
    """
    found = [c for c in assuming(system.mechanism) if not c.within]
    first: dict[str, Array] = {}
    for t, q in zip(ts, qs, strict=True) if found else ():
        pin.forwardKinematics(system.model, system.workspace, q)
        for closure, pair in _placed(system, found):
            relative = first.setdefault(closure.name, pair.Rb.T @ pair.Ra)
            if words := unfit(closure, pair, relative):
                return f"closure {closure.name!r} does not hold from t = {t:.6g} s on: {words}"
    return ""


def unfit(closure: Closure, pair: Pair, relative: Array) -> str:
    """Return which assumption of a closure is violated by a located pair; empty if none.

    Args:
        closure: one of `assuming`.
        pair: its frames.
        relative: rotation from a to b at the start, R_b^T R_a, (3, 3).
    """
    k, d = pair.Ra @ unit_axis(closure.axis or Z), pair.pb - pair.pa
    if closure.kind == "bevel":
        return _unlike_bevel(closure, pair, relative)
    if closure.kind == "rolling":
        return _off_surface(closure, pair)
    if closure.kind == "cam":
        lean = abs(float(pair.Rb @ unit_axis(closure.axis or Z) @ pair.Ra[:, 2]))
        return f"its flat face leans by {lean:.3g} rad against the plane of the profile" if lean > TILT else ""
    tilt = float(np.linalg.norm(np.cross(k, pair.Rb @ relative @ (pair.Ra.T @ k))))
    if tilt > TILT:
        said = "its axes are not parallel" if closure.kind == "gear" else "it turns about another axis than its own"
        return f"{said}, by {np.arcsin(min(1.0, tilt)):.3g} rad"
    a, b = closure.radii or (0.0, 0.0)
    apart = float(np.linalg.norm(d - k * (k @ d)))
    if closure.kind == "gear" and abs(apart - abs(a + b)) > FITS * (abs(a) + abs(b)):
        return f"its axes are {apart:.4g} m apart, and radii of {a:g} and {b:g} m ask for {abs(a + b):.4g} m"
    return ""


def _unlike_bevel(closure: Closure, pair: Pair, relative: Array) -> str:
    a, b = unit_axis(closure.axis or Z), unit_axis(closure.other_axis)
    ka, kb = pair.Ra @ a, pair.Rb @ b
    e, radii = np.cross(ka, kb), closure.radii or (1.0, 1.0)
    across = float(np.linalg.norm(e))
    if (past := abs(float((pair.pb - pair.pa) @ e)) / across) > FITS * (abs(radii[0]) + abs(radii[1])):
        return f"its axes do not meet, they pass each other at {past:.3g} m"
    here, before = (float(np.arccos(np.clip(x, -1, 1))) for x in (ka @ kb, (relative @ a) @ b))
    return f"the angle of its axes is {here:.4g} rad, after {before:.4g} rad" if abs(here - before) > TILT else ""


def _off_surface(closure: Closure, pair: Pair) -> str:
    try:
        height = closure.shape.height(pair)
    except StepError:  # a wheel that lies flat, which the row itself reports
        return ""
    size = closure.radius or max(closure.semi_axes or (1.0,))
    if abs(height) <= FITS * size:
        return ""
    return f"contact is false, and joints do not keep it on its surface: it is {height:.3g} m off"


def _free_rotation(mech: "Mechanism", closure: Closure, pair: Pair, G: Array) -> str:
    """Return a message if wheels can rotate about other axes than the closure's, given joints and positional closures.

    Bodies that rotate about all axes are held by forces, which are unknown before the run.
    """
    ka, kb = pair.Ra @ unit_axis(closure.axis or Z), pair.Rb @ unit_axis(closure.other_axis)
    if closure.kind not in ("gear", "bevel", "screw"):
        return ""
    kept = [i for c in mech.closures if not c.within for i in mech.rows_of(c.name) if mech.positional[i]]
    size, free = np.linalg.svd(G[kept])[1:] if kept else (np.empty(0), np.eye(mech.nv))
    free = free[np.count_nonzero(size > RANK * max(size, default=0.0)) :]
    turns = (pair.sign * pair._J)[3:] @ free.T
    if not turns.size or np.linalg.matrix_rank(turns, RANK * np.abs(turns).max()) > 2:
        return ""
    across = np.cross(ka, kb)[None] if closure.kind == "bevel" else np.eye(3) - np.outer(ka, ka)
    if np.abs(across @ turns).max() <= TILT * np.abs(turns).max():
        return ""
    if closure.kind == "screw":
        return "the bodies can turn about other axes than its own: a screw goes with a cylindrical closure"
    if closure.kind == "bevel":
        return "its wheels can turn about other axes than those given, in the plane of both"
    return "its wheels can turn about axes that are not parallel: kind 'bevel' is for axes that meet"


def _faces(closure: Closure) -> bool:
    return closure.kind == "cam" and closure.radius is None


def _placed(system: "Index2System", closures: list[Closure]) -> Iterator[tuple[Closure, Pair]]:
    """Yield closures with their pairs of frames, located at current kinematics."""
    for closure in closures:
        pair = system.constraints.frame_parts[closure.name].pair
        pair.locate()
        yield closure, pair
