"""A new run of the compiled core, with all thresholds and the parameters of step-size control."""

from functools import cache
from math import inf
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ...methods.controller import COMPANION_WEIGHT, SAFETY, SMALLEST_ERROR, SMALLEST_LAST, Control, Controller
from ...tolerances import AGREEMENT, COINCIDENT, JUMP_MARGIN, TINY
from ..events.core_modes import set_constants
from ..events.jumps import MAX_CLUSTER
from ..events.level_crossing import MAX_ITERATIONS, RELATIVE_TOLERANCE, TIME_SPACINGS
from ..events.singularity import MAX_RATIO_CHANGE, SINGULAR_RATIO
from ..events.singularity_location import (
    ADJACENT_RATIO,
    MAX_STEPS_AHEAD,
    MONITORED_RATIO,
    NOTCH,
    SMALL,
    SUSPICIOUS_RATIO,
)
from .adaptive import Adaptive
from .fixed import FIXED_STEP_TOLERANCE
from .projected_step import MAX_UNDONE
from .stepper import SPACINGS

if TYPE_CHECKING:
    from ..._native import Run


def new_run(native: ModuleType, project: bool, adaptive: Adaptive | None, method: Any) -> "Run":
    """Return a run of the core that has no point and no steps yet.

    Args:
        native: the core.
        project: whether positions are projected.
        adaptive: step-size control; None for fixed steps.
        method: the method.
    """
    pi = adaptive.controller if adaptive else None
    run: Run = native.Run(_template(native, pi and (pi.power, pi.control, pi.min_growth), method.blend if pi else 1.0))
    run.project = project
    if adaptive:
        run.control.rtol, run.control.atol = float(adaptive.rtol), adaptive.atol.ravel().tolist()
    return run


@cache
def _template(native: ModuleType, controller: tuple[int, Control, float] | None, blend: float) -> "Run":
    """Return a run with the parameters of step-size control; None for fixed steps."""
    run: Run = native.Run(_thresholds(native))
    run.adaptive = controller is not None
    if controller:
        c, pi = run.control, Controller(*controller)
        c.power, c.exponent, c.last_exponent = pi.power, pi.exponent, pi.beta
        c.smallest_factor, c.largest_factor = pi.control.smallest, pi.control.largest
        c.blend, c.min_growth = blend, pi.min_growth
    return run


@cache
def _thresholds(native: ModuleType) -> "Run":
    """Return a run of the core with all thresholds."""
    r: Run = native.Run()
    c, e, j, m = r.control, r.events, r.jumps, r.monitor
    r.max_undone, r.tiny, r.tolerated_move = MAX_UNDONE, TINY, FIXED_STEP_TOLERANCE
    r.grid.coincident = COINCIDENT
    set_constants(r.modes)
    m.suspicious_ratio, m.singular_ratio, m.monitored_ratio = SUSPICIOUS_RATIO, SINGULAR_RATIO, MONITORED_RATIO
    m.notch_ratio, m.small_ratio, m.steps_ahead = NOTCH, SMALL, MAX_STEPS_AHEAD
    m.adjacent_ratio, m.max_change, m.last_ratio = ADJACENT_RATIO, MAX_RATIO_CHANGE, inf
    c.agreement, c.spacings, c.tiny, c.companion = AGREEMENT, SPACINGS, TINY, COMPANION_WEIGHT
    c.safety, c.smallest_error, c.smallest_last = SAFETY, SMALLEST_ERROR, SMALLEST_LAST
    e.agreement, e.iterations = AGREEMENT, MAX_ITERATIONS
    e.spacings, e.step_tolerance = TIME_SPACINGS, RELATIVE_TOLERANCE
    j.margin, j.max_cluster = JUMP_MARGIN, MAX_CLUSTER
    return r
