"""Core data of closures, drivers, forces and thresholds."""

from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from ... import tolerances as tol
from ...data_types import CoreData
from ...errors import NotCompiled
from ..closures import independent_rows
from ..closures.constraints import Constraints
from ..forces.elements import ForceElements
from ..forces.sampled import SampledElement
from ..time_functions.input_functions import Input
from ..tree import manifold
from ..tree.frames import Anchor, Pair
from ..tree.manifold import GROUPS
from ..tree.tree_terms import flexible_bodies
from . import closure_friction, friction_interface, ggl
from .steps import projection

if TYPE_CHECKING:
    from ..._native import Tolerances
    from ..mechanism import Mechanism
    from .compiled_systems import CompiledSystem
    from .index2 import Index2System

FramePair = tuple[CoreData, CoreData]
STAGE_ITERATIONS = 20  # iterations of stages that are recomputed for the derivatives of a run


def core_tolerances(native: ModuleType, mechanism: "Mechanism") -> "Tolerances":
    """Return all thresholds of points and steps, without those of step-size control, which belong to the run."""
    tolerances: Tolerances = native.Tolerances(
        eps=tol.EPS,
        tiny=tol.TINY,
        below_rounding=tol.BELOW_ROUNDING,
        rounding=tol.ROUNDING,
        sum_rounding=tol.SUM_ROUNDING,
        evaluation_rounding=tol.EVALUATION_ROUNDING,
        solution_rounding=tol.SOLUTION_ROUNDING,
        search_tolerance=tol.SEARCH_TOLERANCE,
        same_state=tol.SAME_STATE,
        zero_speed=tol.ZERO_SPEED,
        pivot_rank=tol.PIVOT_RANK,
        truncation=tol.TRUNCATION,
        visible=tol.VISIBLE,
        max_rotation=manifold.MAX_ROTATION,
        series=np.array(manifold.SERIES),
        smallest_pivot=independent_rows.SMALLEST_PIVOT,
        worst_conditioning=independent_rows.WORST_CONDITIONING,
        growth_tolerance=independent_rows.GROWTH_TOLERANCE,
        reselection_ratio=independent_rows.RESELECTION_RATIO,
        probe_tolerance=independent_rows.PROBE_TOLERANCE,
        cg_tolerance=independent_rows.CONVERGED,
        many_rows=independent_rows.MANY_ROWS,
        extra_cg_iterations=independent_rows.EXTRA_CG_ITERATIONS,
        projection_max_remaining=projection.MAX_REMAINING,
        projection_open=projection.VIOLATED,
        projection_stalled=projection.STALLED,
        projection_iterations=projection.ITERATIONS,
        ggl_iterations=ggl.ITERATIONS,
        friction_iterations=closure_friction.ITERATIONS,
        slip_cosine=friction_interface.MIN_COSINE,
        clear_slip=friction_interface.CLEAR_SLIP,
        stage_iterations=STAGE_ITERATIONS,
        row_scales=mechanism.row_scales,
        q_scales=mechanism.q_scales,
        coordinate_scales=mechanism.coordinate_scales,
    )
    return tolerances


def describe(system: "Index2System") -> CoreData:
    """Return the description of a mechanism for the core, the `Description` of `native/system/index2.hpp`.

    Raises:
        NotCompiled: for rows and laws that the core does not support.
    """
    m = system.manifold
    pairs, rows, drivers = constraints_of(system.constraints)
    law_pairs, laws = laws_of(system.laws)
    alpha, beta = system.baumgarte
    return {
        "formulation": system.formulation,
        "alpha": alpha,
        "beta": beta,
        "flat": m.flat,
        "ns": system.ns,
        "pairs": pairs,
        "rows": rows,
        "drivers": drivers,
        "law_pairs": law_pairs,
        "laws": laws,
        "group_joints": [
            {"kind": GROUPS[ad], "iv": s.start, "iq": iq}
            for (_, s, ad, _), iq in zip(m.group_joints, m.group_starts, strict=True)
        ],
        "angular": m.angular.astype(int).tolist(),
        "order": system.elimination_order.tolist(),
        "flexible": [body.core_data(system.model) for body in flexible_bodies(system.model)],
        "probe": independent_rows.random_probe(system.nv).tolist(),
    }


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


def _frame(a: Anchor) -> CoreData:
    return {"joint": a.joint, "R": a.R.ravel().tolist(), "p": a.p.tolist()}


def inputs_of(system: "CompiledSystem") -> list[Input]:
    """Return the inputs of forces and drivers, and register the workspace for their later settings."""
    forcing = [u for law, _ in system.laws.bound for u in law.time_functions]
    sampled = [u for law, _ in system.laws.bound if isinstance(law, SampledElement) for u in law.references]
    motions = [d.path for d in system.mechanism.drivers]
    found = [u for u in (*forcing, *sampled, *motions) if isinstance(u, Input)]
    for u in found:
        u.listen(system)
    return found


def samplers_of(laws: ForceElements) -> list[CoreData]:
    """Return the core data of the sampled controllers."""
    return [law.sampler(at) for law, at in laws.bound if isinstance(law, SampledElement)]


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
