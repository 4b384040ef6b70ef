"""Preconditions of closures on their frames, which their rows do not enforce: `Closure.violated_precondition`.

They are checked at the start, where also the motions allowed by other closures are tested, and at the nodes of a run.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...system import Array
from ...tolerances import RANK, THREE_DIGITS
from ..tree.frames import Pair, find_joint
from ..tree.tree_terms import update_motions
from .closure import Closure

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism


def closures_with_preconditions(mech: "Mechanism") -> list[Closure]:
    """Return the closures of a mechanism that have a precondition."""
    return [c for c in mech.closures if c.has_precondition]


def require_preconditions(mech: "Mechanism", q: Array) -> None:
    """Reject a configuration q (nq,) that violates a closure's precondition.

    Raises:
        InputError: names the closure, the expected and the actual value.
    """
    if not (closures := closures_with_preconditions(mech)):
        return
    system = mech.system()
    G = system.jacobian(q)
    for closure, pair in _with_pairs(system, closures):
        if closure.within and not closure.within.depth(q[find_joint(mech.model, closure.within.joint).idx_q]) > 0:
            continue
        message = closure.violated_precondition(pair, pair.Rb.T @ pair.Ra) or _free_rotation(mech, closure, pair, G)
        if message:
            raise InputError(f"closure {closure.name!r}: {message}")


def precondition_violation(system: "Index2System", ts: Array, qs: Array) -> str:
    """Return which precondition a run violates, and from which time; empty if none.

    Args:
        system: a workspace; its kinematics are overwritten.
        ts: times in s, (n,).
        qs: configurations, (n, nq).
    """
    closures = [c for c in closures_with_preconditions(system.mechanism) if not c.within]
    first: dict[str, Array] = {}
    for t, q in zip(ts, qs, strict=True) if closures else ():
        update_motions(system.model, system.workspace, q)
        for closure, pair in _with_pairs(system, closures):
            relative = first.setdefault(closure.name, pair.Rb.T @ pair.Ra)
            if message := closure.violated_precondition(pair, relative):
                return f"closure {closure.name!r} does not hold from t = {t:.6g} s on: {message}"
    return ""


def _free_rotation(mech: "Mechanism", closure: Closure, pair: Pair, G: Array) -> str:
    """Return a message if joints and positional closures allow a rotation about an excluded axis.

    Bodies that can rotate about all axes are guided by forces, which are unknown before the run.
    """
    if not (excluded := closure.excluded_axes(pair)):
        return ""
    rows = [i for c in mech.closures if not c.within for i in mech.rows_of(c.name) if mech.positional[i]]
    size, free = np.linalg.svd(G[rows])[1:] if rows else (np.empty(0), np.eye(mech.nv))
    free = free[np.count_nonzero(size > RANK * max(size, default=0.0)) :]
    rotations = pair.relative_jacobian()[3:] @ free.T
    if not rotations.size or np.linalg.matrix_rank(rotations, RANK * np.abs(rotations).max()) > 2:
        return ""
    axes, message = excluded
    return message if np.abs(axes @ rotations).max() > THREE_DIGITS * np.abs(rotations).max() else ""


def _with_pairs(system: "Index2System", closures: list[Closure]) -> Iterator[tuple[Closure, Pair]]:
    """Yield closures and their pairs of frames, with poses at current kinematics."""
    for closure in closures:
        pair = system.constraints.frame_rows[closure.name].pair
        pair.locate()
        yield closure, pair
