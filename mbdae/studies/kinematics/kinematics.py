"""Kinematics of mechanisms with one degree of freedom: all poses over an input, by continuation in arclength."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ...errors import AssemblyError, InputError, StepError, is_count, is_number
from ...mechanism import Mechanism, ModelSource
from ...mechanism.assembly.assembly import start_configuration
from ...mechanism.assembly.position_search import close_position
from ...mechanism.tree.joints import angle_components
from ...solution.problem import mechanism_of
from ...system import Array
from ...tolerances import SMALLEST_PART
from ...units import quantity
from .curve.branch_following import TracedCurve, is_same_point, other_branches
from .curve.curve_sampling import branch_point_on_curve, events, sample
from .curve.curve_tracing import follow
from .curve.pose_curve import MAX_DISPLACEMENT, BranchPoint, CurvePoint, PoseCurve
from .driven_mechanism import Hold, driven_mechanism, input_at, omitted_elements, require_one_dof
from .result import CurveSegment, Kinematics
from .transmission_angle import default_output, transmission
from .violations import curve_violations

__all__ = ["kinematics"]

INPUT_STEP = 0.1  # step of the input from the start pose to its first value, in rad or characteristic lengths


def kinematics(
    mech: Mechanism | ModelSource,
    drive: str,
    *,
    span: tuple[float, float] | None = None,
    turns: float = 1.0,
    hold: Hold = (),
    points: int = 181,
    q: Array | None = None,
    output_joint: str | None = None,
    branches: bool = False,
) -> Kinematics:
    """Trace the poses of a mechanism with one degree of freedom over an input u, with their rates.

        g(q) = 0,   q_drive = u;      G dq/du = 0,   G d2q/du2 = -gamma(q, dq/du)

    The curve is traced by continuation in its arclength, through dead points of the input joint, where it reverses,
    and smoothly through branch points. It ends where the input leaves its range, or where the curve closes. Stops,
    ropes, contacts, clutches and friction do not act; poses that violate unilateral constraints are reported.
    Source: Allgower, Georg, Introduction to Numerical Continuation Methods (2003).

    Args:
        mech: the mechanism, or an argument of `mbdae.load`; drivers except the drive are constant at their values at
            t = 0.
        drive: the input: a joint of one coordinate, or a driver of the mechanism.
        span: the input's range in rad or m; the curve begins at its first value. When left out, it begins at the start
            pose, and the range is ``turns`` to both sides.
        turns: number of full turns, if no span is given.
        hold: joints to lock in place, or at given values: joint=value. One degree of freedom must remain for the
            drive. Flexible bodies are rigid, unless one of their modes is named.
        points: approximate number of poses.
        q: a pose on the requested branch, (nq,); the model's start when left out.
        output_joint: the joint of the transmission angle; by default the second joint on the ground, if it is unique.
        branches: also trace the remaining branches from branch points, within the range.

    Raises:
        UnknownNameError: for a joint that does not exist.
        InputError: for no degree of freedom, too many (names joints to lock), a drive that cannot move, or a singular
            start pose.
        AssemblyError: if the loops cannot be closed at the start of the range.
        StepError: if the curve cannot be continued.

    Example:
        >>> found = kinematics(mbdae.load("four_bar"), "crank", turns=2)   # doctest: +SKIP
    """
    mech = mechanism_of(mech, "kinematics")
    if not is_count(points, 2):
        raise InputError(f"points is a number of poses, at least 2, got {points!r}")
    q_start = start_configuration(mech) if q is None else mech.vector("q", q, mech.nq)
    driven = driven_mechanism(mech, drive, hold, q_start)
    system = driven.system()
    first, u = _start_on_curve(driven, q_start, span)
    locked = [d.joint or d.name for d in driven.drivers[:-1]]
    require_one_dof(driven, system, first, drive, locked, omitted_elements(mech))
    low, high = _range(driven, u, span, turns)
    curve = PoseCurve(system, angle_components(mech.model))
    curve.set_start(first, u, None if span is None or span[1] > span[0] else _decreasing_tangent(curve, first, u))
    found = [TracedCurve(follow(curve, low, high), events(curve))]
    if branches:
        found += other_branches(found[0], low, high)
    if curve.ended in ("limit", "failed"):
        raise StepError("newton", _unfinished(curve, drive, driven))
    if span is None and curve.ended == "range" and driven.row_units[-1] != "rad":
        raise InputError(f"{drive!r} slides without bound: give its range, span or --from and --to")
    chosen = default_output(mech, drive, locked) if output_joint is None else output_joint
    return _result(mech, driven, drive, locked, chosen, found, points)


def _start_on_curve(driven: Mechanism, q: Array, span: tuple[float, float] | None) -> tuple[Array, float]:
    """Return the closed configuration at which the curve begins, and its input."""
    system, no_joints = driven.system(), np.array([], int)
    u_start = input_at(driven, system, q)
    if span is None:
        return close_position(system, q, no_joints, u_start), u_start
    limits = list(span) if isinstance(span, Iterable) else []
    if not (len(limits) == 2 and all(is_number(u) for u in limits) and limits[0] != limits[1]):
        raise InputError(f"span is two different numbers, from and to, got {span!r:.60}")
    if abs(limits[1] - limits[0]) < SMALLEST_PART * driven.row_scales[-1]:
        raise InputError(f"span is too short to trace a curve, got {span!r:.60}")
    first = float(span[0])
    n_steps = int(abs(first - u_start) / (INPUT_STEP * driven.row_scales[-1])) + 1  # small steps stay on the branch
    for u in np.linspace(u_start, first, n_steps + 1)[1:]:
        try:
            q = close_position(system, q, no_joints, float(u))
        except (AssemblyError, InputError) as e:
            wanted, reached = (quantity(x, driven.row_units[-1], form) for x, form in ((first, ".6g"), (u, ".4g")))
            text = f"the input cannot start at {wanted}: it only reaches about {reached}; {e}"
            known = (e.closure, e.violation) if isinstance(e, AssemblyError) else ("", np.nan)
            raise AssemblyError(text, *known) from None
    return q, first


def _decreasing_tangent(curve: PoseCurve, q: Array, u: float) -> Array:
    first = curve.set_start(q, u)
    return -first.tau


def _range(driven: Mechanism, u: float, span: tuple[float, float] | None, turns: float) -> tuple[float, float]:
    if span is not None:
        return min(span), max(span)
    if not (is_number(turns) and turns > 0):
        raise InputError(f"turns must be a positive number, got {turns!r:.60}")
    reach = 2 * np.pi * turns if driven.row_units[-1] == "rad" else MAX_DISPLACEMENT * driven.row_scales[-1]
    return u - reach, u + reach


def _unfinished(curve: PoseCurve, drive: str, mech: Mechanism) -> str:
    u = curve.nodes[-1].u
    if curve.ended == "failed":
        return f"the curve over {drive!r} cannot be continued beyond {u:.9g}: a branch point or a corner"
    displacement = curve.displacement()
    if displacement.max() > MAX_DISPLACEMENT:
        joint = mech.coordinate_joint(int(displacement.argmax()))
        return f"{joint!r} slides without bound as {drive!r} approaches {u:.4g}: give a span that ends before"
    return f"the curve over {drive!r} does not end within {len(curve.nodes)} steps, at {u:.6g}: give a span"


def _sampled(found: list[TracedCurve], n: int) -> tuple[list[CurvePoint], list[CurveSegment]]:
    """Return about n points of each curve, one after another, and the segments of the curves."""
    points: list[CurvePoint] = []
    segments: list[CurveSegment] = []
    for curve, curve_events, start, end in found:
        sampled = sample(curve, curve_events, n)
        sampled[:0] = [branch_point_on_curve(curve, start, curve.nodes[0], before=True)] if start else []
        sampled += [branch_point_on_curve(curve, end, curve.nodes[-1])] if end else []
        inputs = [p.u for p in sampled]
        segments.append(CurveSegment(len(points), len(points) + len(sampled), min(inputs), max(inputs), curve.ended))
        points += sampled
    return points, segments


def _branch_points(found: list[TracedCurve]) -> tuple[BranchPoint, ...]:
    """Return the branch points of all curves, each once."""
    out: list[BranchPoint] = []
    for curve, curve_events, *_ in found:
        out += [b for b in curve_events.branch_points.values() if not any(is_same_point(curve, b, c) for c in out)]
    scales = found[0].curve.scales
    return tuple(replace(b, directions=b.directions * scales) for b in out)


def _result(
    mech: Mechanism,
    driven: Mechanism,
    drive: str,
    locked: list[str],
    output: str | None,
    found: list[TracedCurve],
    n: int,
) -> Kinematics:
    points, segments = _sampled(found, n)
    curve = found[0].curve
    tau, q, u, s, kappa, speed, input_curvature = (
        np.array([getattr(p, name) for p in points])
        for name in ("tau", "q", "u", "s", "kappa", "speed", "input_curvature")
    )
    tau *= curve.scales
    angles = np.full(len(q), np.nan)
    if output is not None:
        at_branch_point = np.array([p.sigma == 0 for p in points])
        angles = transmission(mech, curve.system, q, tau, at_branch_point, output)
    return Kinematics(
        mechanism=mech,
        drive=drive,
        locked=tuple(locked),
        output=output or "",
        unit=str(driven.row_units[-1]),
        u=u,
        s=s,
        q=q,
        tangent=tau,
        curvature=kappa * curve.scales,
        speed=speed,
        input_curvature=input_curvature,
        transmission=angles,
        dead_points=tuple((d.point.u, d.point.q) for f in found for d in f.events.dead_points),
        branch_points=_branch_points(found),
        segments=tuple(segments),
        hidden=tuple(u for f in found for u in f.events.hidden),
        violations=tuple(p for f in found for p in curve_violations(mech, f.curve)),
        traced=tuple(found),
    )
