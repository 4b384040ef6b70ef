"""Trace the curve of closed configurations: step sizes, branch points, and its end."""

import numpy as np

from .... import tolerances as tol
from ....errors import StepError
from .branch_points import branch_point
from .pose_curve import MAX_DISPLACEMENT, PoseCurve

FIRST_STEP, MAX_STEP, MIN_STEP = 0.02, 0.4, tol.SMALLEST_PART  # steps of the arclength
JUMP = tol.INTERPOLATION  # step size above which a jump between branches is rejected
PREDICTOR_ERROR = 0.02  # target for the error of the predictor, as a fraction of the step
MAX_NODES = 5000  # nodes of a curve


def follow(curve: PoseCurve, low: float, high: float) -> PoseCurve:
    """Trace the curve until the input leaves a range, or the start pose recurs."""
    h, start = FIRST_STEP, curve.nodes[0]
    while len(curve.nodes) < MAX_NODES:
        last = curve.nodes[-1]
        new, error = curve.step(last, h)
        if new is None:
            if (h := h / 2) < MIN_STEP:
                curve.ended = "failed"
                return curve
            continue
        curve.nodes.append(new)
        if last.sigma * new.sigma < 0 and not _find_branch_point(curve) and h > JUMP:
            del curve.nodes[-1]
            del curve.branch_points[len(curve.nodes) - 1]
            h /= 4
            continue
        change = (PREDICTOR_ERROR * h / max(error, tol.SOLUTION_ROUNDING)) ** (1 / 3)
        h = min(MAX_STEP, h * float(np.clip(change, 0.4, 2.0)))
        recurrence = curve.point_at_pose(len(curve.nodes) - 2, start) if len(curve.nodes) > 2 else None
        if recurrence is not None and curve.is_full_period(recurrence.u - start.u):
            curve.nodes[-1], curve.ended = recurrence, "closed"
            return curve
        if not low <= new.u <= high:
            return _end_at(curve, low if new.u < low else high)
        if curve.displacement().max() > MAX_DISPLACEMENT:
            break
    curve.ended = "limit"
    return curve


def _find_branch_point(curve: PoseCurve) -> bool:
    """Locate the branch point in the last step; return False if the step jumped to another branch."""
    i = len(curve.nodes) - 2
    curve.branch_points[i] = None
    try:
        curve.branch_points[i] = branch_point(curve, i)
    except StepError:
        return False
    return True


def _end_at(curve: PoseCurve, u: float) -> PoseCurve:
    """Move the last node to the end u of the range of the input."""
    i = len(curve.nodes) - 2
    at = curve.at(i, curve.root(i, lambda p: p.u - u))
    curve.nodes[-1], curve.ended = curve.at_input(at, u) or at, "range"
    return curve
