"""Projection of the end of a step onto the closures, and a check that the projection does not undo the step."""

from typing import TYPE_CHECKING

import numpy as np

from ...errors import StepError
from ...mechanism.closures.closure_error import largest_error, shortening_remark
from ...mechanism.formulations.index2 import Index2System
from ...system import Array, State

if TYPE_CHECKING:
    from ..run.run_state import RunState

MAX_UNDONE = 0.25  # fraction of the motion of a step, in position or velocity, that a projection may undo


def project_end(run: "RunState", t: float, state: State) -> State:
    """Project the end of a step onto the closures.

    Steps do not solve for rows that are redundant at the start of a run. Where these rows become independent, the
    projection onto all rows undoes each step, and the run would make no progress for any step size. A projection within
    the tolerance is always accepted; after a step that was undone, steps are assessed together until the motion makes
    progress. (Near a root of multiplicity p, a Gauss-Newton iteration multiplies the distance by 1 - 1/p.)

    Raises:
        StepError: if the projection undoes more than `MAX_UNDONE` of the step.
    """
    end, system = run.projected(t, state), run.system
    if end.y is state.y or not isinstance(system, Index2System):
        return end
    motions = _motions(run, system, t, state.y, end.y)
    if run.undone_motion is not None:
        motions += run.undone_motion
    motion, *undone = run.stepper.tolerance_norms(run, state.y, motions)
    largest = max(undone)
    if largest > max(1.0, MAX_UNDONE * motion):
        if run.undone_motion is None:
            run.undone_motion = np.zeros_like(motions)
        level = undone.index(largest)
        residual = system.residual(t, *system.split(state.y))[level]
        violation = largest_error(system.mechanism, residual, ("", "/s")[level])
        fraction = f"{largest / max(motion, largest):.0%} of the motion"
        remark = shortening_remark(system.mechanism, violation.name)
        undoes = f"its projection undoes {fraction}: the rows cannot all be satisfied{remark}"
        raise StepError("rank", f"{violation.message()} in a step from t = {run.t:.17g}, and {undoes}")
    if run.undone_motion is not None:
        run.undone_motion = None if MAX_UNDONE * motion > 1 else motions
    return end


def _motions(run: "RunState", system: Index2System, t: float, y: Array, end: Array) -> Array:
    """Return the motion of a step to y, and its displacements by projection in position and velocity, (3, ny)."""
    step, displacement, nv = system.difference(run.state.y, y), system.difference(y, end), system.nv
    out = np.zeros((3, len(displacement)))
    out[:, :nv] = step[:nv], displacement[:nv], (t - run.t) * displacement[nv : 2 * nv]
    return out
