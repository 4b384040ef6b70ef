"""Preconditions of closures: assumptions of their rows about both frames that they do not enforce (`Closure.unfit`).

They are checked at the start, for the motions that the other closures allow, and at the nodes of a run.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from ...errors import InputError
from ...system import Array
from ...tolerances import RANK, THREE_DIGITS
from ..frames import Pair, find_joint
from .closure import Closure

if TYPE_CHECKING:
    from ..formulations.index2 import Index2System
    from ..mechanism import Mechanism



def assuming(mech: "Mechanism") -> list[Closure]:
    """Closures of a mechanism that have a precondition."""
    return [c for c in mech.closures if c.assumes]


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
        if words := closure.unfit(pair, pair.Rb.T @ pair.Ra) or _free_rotation(mech, closure, pair, G):
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
            if words := closure.unfit(pair, relative):
                return f"closure {closure.name!r} does not hold from t = {t:.6g} s on: {words}"
    return ""


def _free_rotation(mech: "Mechanism", closure: Closure, pair: Pair, G: Array) -> str:
    """Return a message if wheels can rotate about other axes than the closure's, given joints and positional closures.

    Bodies that rotate about all axes are held by forces, which are unknown before the run.
    """
    if not (foreign := closure.foreign_axes(pair)):
        return ""
    kept = [i for c in mech.closures if not c.within for i in mech.rows_of(c.name) if mech.positional[i]]
    size, free = np.linalg.svd(G[kept])[1:] if kept else (np.empty(0), np.eye(mech.nv))
    free = free[np.count_nonzero(size > RANK * max(size, default=0.0)) :]
    turns = (pair.sign * pair._J)[3:] @ free.T
    if not turns.size or np.linalg.matrix_rank(turns, RANK * np.abs(turns).max()) > 2:
        return ""
    axes, words = foreign
    return words if np.abs(axes @ turns).max() > THREE_DIGITS * np.abs(turns).max() else ""


def _placed(system: "Index2System", closures: list[Closure]) -> Iterator[tuple[Closure, Pair]]:
    """Yield closures with their pairs of frames, located at current kinematics."""
    for closure in closures:
        pair = system.constraints.frame_parts[closure.name].pair
        pair.locate()
        yield closure, pair
