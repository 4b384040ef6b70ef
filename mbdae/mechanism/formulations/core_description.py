"""Core data of closures, drivers, forces and thresholds."""

from types import ModuleType
from typing import TYPE_CHECKING, Any

from ... import tolerances as tol
from ...errors import NotCompiled
from .. import manifold
from ..closures import independent_rows
from ..closures.constraints import Constraints
from ..forces.elements import ForceElements
from ..forces.sampled import SampledElement
from ..frames import Anchor, Pair
from . import closure_friction, friction_interface, ggl, projection

if TYPE_CHECKING:
    from ..._native import Tolerances
    from ..mechanism import Mechanism

CoreData = dict[str, Any]
FrameData = tuple[int, list[float], list[float]]  # joint, R, p
FramePair = tuple[FrameData, FrameData]
RESTAGES = 20  # iterations of a stage that a derivative of a run recomputes


def core_tolerances(native: ModuleType, mechanism: "Mechanism") -> "Tolerances":
    """Return all tolerances of points and steps; those of step-size control belong to the run."""
    tolerances: Tolerances = native.Tolerances(
        largest_turn=manifold.MAX_ROTATION,
        series=manifold.SERIES,
        series_end=tol.BELOW_ROUNDING,
        same_point=tol.ROUNDING,
        smallest_pivot=independent_rows.SMALLEST_PIVOT,
        independent=tol.PIVOT_RANK,
        worst_conditioning=independent_rows.WORST_CONDITIONING,
        grown=independent_rows.GROWTH_TOLERANCE,
        many=independent_rows.MANY_ROWS,
        reason=independent_rows.RESELECTION_RATIO,
        probed=independent_rows.PROBE_TOLERANCE,
        converged=independent_rows.CONVERGED,
        eps=tol.EPS,
        spare=independent_rows.EXTRA_CG_ITERATIONS,
        truncation=tol.TRUNCATION,
        rounding=tol.SUM_ROUNDING,
        falling=projection.MAX_REMAINING,
        open=projection.OPEN,
        stalled=projection.STALLED,
        kept=tol.VISIBLE,
        iterations=projection.ITERATIONS,
        unmoved=tol.EVALUATION_ROUNDING,
        row_scales=mechanism.row_scales.tolist(),
        q_scales=mechanism.q_scales.tolist(),
        coordinate_scales=mechanism.coordinate_scales.tolist(),
        meeting=ggl.ITERATIONS,
        met=tol.ROUNDING,
        halted=tol.SEARCH_TOLERANCE,
        gaping=tol.SAME_STATE,
        still=tol.STILL,
        turned=friction_interface.MIN_COSINE,
        loading=closure_friction.ITERATIONS,
        loaded=tol.ROUNDING,
        settled=tol.SOLUTION_ROUNDING,
        nothing=tol.TINY,
        restages=RESTAGES,
        restaged=tol.SOLUTION_ROUNDING,
    )
    return tolerances


def constraints_of(constraints: Constraints) -> tuple[list[FramePair], list[CoreData], list[CoreData]]:
    """Return pairs of frames, rows and drivers.

    Raises:
        NotCompiled: for rows that the core does not support.
    """
    pairs: list[FramePair] = []
    rows: list[CoreData] = [{}] * constraints.ng
    for pair, kinds in constraints.frame_rows.values():
        for s, r, _ in kinds:
            rows[s] = data = [{"pair": len(pairs), **row} for row in r.core_data()]
            if len(data) != r.m:
                raise NotCompiled(f"rows of kind {type(r).__name__}")
        pairs.append((_frame(pair.a), _frame(pair.b)))
    for row in constraints.joint_rows:
        rows[row.at] = row.core_data()
    drivers = [
        {"row": at, "length": bool(d.frames and d.motion), "speed": bool(d.speed), "motion": d.path.core_data()}
        for at, d in constraints.driven
    ]
    return pairs, rows, drivers


def _frame(a: Anchor) -> FrameData:
    return a.joint, a.R.ravel().tolist(), a.p.tolist()


def samplers_of(laws: ForceElements) -> list[CoreData]:
    """Return the core data of the sampled controllers."""
    sampled = [(law, at) for law, at in laws.bound if isinstance(law, SampledElement)]
    return [{**law.sampler(), "state": at.start, "states": at.stop - at.start} for law, at in sampled]


def laws_of(laws: ForceElements) -> tuple[list[FramePair], list[CoreData]]:
    """Return pairs of frames and force laws.

    Raises:
        NotCompiled: for a law that the core does not support.
    """
    pairs: list[FramePair] = []
    out: list[CoreData] = []
    for law, states in laws.acting:
        data = law.core_data()
        pair: Pair | None = data.pop("frames", None)
        if pair is not None:
            data["pair"] = len(pairs)
            pairs.append((_frame(pair.a), _frame(pair.b)))
        out.append({**data, "state": states.start, "states": states.stop - states.start})
    return pairs, out
