"""The end of a step on the closures, and whether the step can be trusted then."""

from typing import TYPE_CHECKING

import numpy as np

from ..errors import StepError
from ..mechanism.closures.closure_error import largest_error
from ..mechanism.formulations.index2 import Index2System
from ..system import Array, State

if TYPE_CHECKING:
    from .run_state import RunState

TAKEN_BACK = 0.25  # of the motion of a step: a projection that undoes more, in position or speed, cannot be trusted


def project_end(run: "RunState", t: float, state: State) -> State:
    """Bring the end of a step onto the closures.

    Rows that depend on others where a run begins are not solved for. Where they do so no more, a projection that keeps
    them takes each step back: such steps would creep, or go nowhere, whatever their size. Within its tolerance a step
    may be moved; after one that was taken back this holds of all steps together, until they lead onwards again.
    Gauss-Newton steps to a contact of order p leave a share 1 - 1/p of the way.

    Raises:
        StepError: where closing the closures takes back more than `TAKEN_BACK` of the step.
    """
    end, system = run.restored(t, state), run.system
    if end.y is state.y or not isinstance(system, Index2System):
        return end
    motions = _motions(run, system, t, state.y, end.y)
    if run.taken_back is not None:
        motions += run.taken_back
    whole, *undone = (run.stepper.measure(run, state.y, x) for x in motions)
    most = max(undone)
    if most > max(1.0, TAKEN_BACK * whole):
        if run.taken_back is None:
            run.taken_back = np.zeros_like(motions)
        level = undone.index(most)
        gap = largest_error(system.mechanism, system.residual(t, *system.split(state.y))[level], ("", "/s")[level])
        kept = f"keeping it takes back {most / max(whole, most):.0%} of the motion: the rows cannot all be kept"
        raise StepError("rank", f"{gap.says('opens')} in a step from t = {run.t:.17g}, and {kept}")
    if run.taken_back is not None:
        run.taken_back = None if TAKEN_BACK * whole > 1 else motions
    return end


def _motions(run: "RunState", system: Index2System, t: float, y: Array, end: Array) -> Array:
    """The motion of a step to y, and what its projection takes back of it in position and in speed, (3, ny)."""
    step, move, nv = system.difference(run.state.y, y), system.difference(y, end), system.nv
    out = np.zeros((3, len(move)))
    out[:, :nv] = step[:nv], move[:nv], (t - run.t) * move[nv : 2 * nv]
    return out
