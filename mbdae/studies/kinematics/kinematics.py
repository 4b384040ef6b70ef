"""Kinematics of mechanisms with one degree of freedom: all poses over an input, followed over their arclength."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import AssemblyError, InputError, StepError, is_number
from ...mechanism import Mechanism
from ...mechanism.joints import angle_components
from ...mechanism.position_search import close_position
from ...solution.problem import mechanism_of
from ...system import Array
from .branch_following import Followed, is_same_point, other_branches
from .branch_points import BranchPoint
from .curve_sampling import at_crossing, events, sample
from .driven_mechanism import Hold, driven_mechanism, input_at, left_open, require_one_dof, start_pose
from .passing import passed_by
from .pose_curve import LONGEST, CurvePoint, PoseCurve
from .result import CurveSegment, Kinematics
from .transmission_angle import default_output, transmission

__all__ = ["kinematics"]

NEXT = 0.1  # rad or characteristic lengths: a step of the input on the way to its first value


def kinematics(
    mech: Mechanism | str | Path,
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
    """Follow the poses of a mechanism with one degree of freedom over an input u, with their rates.

        g(q) = 0,   q_drive = u;      G dq/du = 0,   G d2q/du2 = -gamma(q, dq/du)

    The curve is followed over its arclength, through dead points of the drive, where the input turns back, and through
    branch points, where it goes on smoothly. It ends where the input leaves its range, or where the first pose comes
    again. Stops, ropes, contacts that open, clutches and friction do not act. The places where the curve passes them
    are reported.
    Source: Allgower, Georg, Introduction to Numerical Continuation Methods (2003).

    Args:
        mech: the mechanism, or what `mbdae.load` takes; drivers other than the drive stay where they are at
            t = 0.
        drive: the input: a joint of one coordinate, or a driver of the mechanism.
        span: the input's range in rad or m; the curve begins at its first value. The start pose, and up to so many
            turns to both sides, when left out.
        turns: full turns, where no span is given.
        hold: joints to lock where they are, or at values by name: joint=value. One degree of freedom is left
            for the drive.
        points: about how many poses are returned.
        q: a pose on the branch that is meant, (nq,); the model's start when left out.
        output_joint: the joint of the transmission angle. When left out, the only other one at the ground.
        branches: follow all branches from branch points on. They stay within the range.

    Raises:
        UnknownNameError: for a joint that does not exist.
        InputError: no degree of freedom is left, or too many (names joints to hold); the drive cannot move; the start
            is a singular pose.
        AssemblyError: the loops cannot be closed where the range begins.
        StepError: the loops cannot be closed along the way.

    Example:
        >>> found = kinematics(mbdae.load("four_bar"), "crank", turns=2)   # doctest: +SKIP
    """
    mech = mechanism_of(mech, "kinematics")
    if not (isinstance(points, int) and points >= 2):
        raise InputError(f"points is a number of poses, at least 2, got {points!r}")
    begin = start_pose(mech) if q is None else mech.vector("q", q, mech.nq)
    moved = driven_mechanism(mech, drive, hold, begin)
    system = moved.system()
    first, u = _first(moved, begin, span)
    held = [d.joint or d.name for d in moved.drivers[:-1]]
    require_one_dof(moved, system, first, drive, held, left_open(mech))
    low, high = _range(moved, u, span, turns)
    curve = PoseCurve(system, angle_components(mech.model))
    curve.begin(first, u, None if span is None or span[1] > span[0] else _falling(curve, first, u))
    found = [Followed(curve.follow(low, high), events(curve))]
    if branches:
        found += other_branches(found[0], low, high)
    if curve.ended in ("long", "stuck"):
        raise StepError("newton", _unfinished(curve, drive, moved))
    if span is None and curve.ended == "range" and moved.row_units[-1] != "rad":
        raise InputError(f"{drive!r} slides without bound: give its range, span or --from and --to")
    chosen = default_output(mech, drive, held) if output_joint is None else output_joint
    return _result(mech, moved, drive, held, chosen, found, points)


def _first(moved: Mechanism, q: Array, span: tuple[float, float] | None) -> tuple[Array, float]:
    """The closed configuration where the curve begins, and the input there."""
    system, nothing = moved.system(), np.array([], int)
    here = input_at(moved, system, q)
    if span is None:
        return close_position(system, q, nothing, here), here
    listed = list(span) if isinstance(span, Iterable) else []
    if not (len(listed) == 2 and all(is_number(u) for u in listed) and listed[0] != listed[1]):
        raise InputError(f"span is two different numbers, from and to, got {span!r:.60}")
    first = float(span[0])
    for u in np.linspace(here, first, int(abs(first - here) / (NEXT * moved.row_scales[-1])) + 2)[
        1:
    ]:  # there in small steps, as the drive would
        try:
            q = close_position(system, q, nothing, float(u))
        except (AssemblyError, InputError) as e:
            text = f"the input cannot begin at {first:.6g}: it gets no further than about {u:.4g}; {e}"
            known = (e.closure, e.gap) if isinstance(e, AssemblyError) else ("", np.nan)
            raise AssemblyError(text, *known) from None
    return q, first


def _falling(curve: PoseCurve, q: Array, u: float) -> Array:
    first = curve.begin(q, u)
    return -first.tau


def _range(moved: Mechanism, u: float, span: tuple[float, float] | None, turns: float) -> tuple[float, float]:
    if span is not None:
        return min(span), max(span)
    if not (is_number(turns) and turns > 0):
        raise InputError(f"turns must be a positive number, got {turns!r:.60}")
    reach = 2 * np.pi * turns if moved.row_units[-1] == "rad" else LONGEST * moved.row_scales[-1]
    return u - reach, u + reach


def _unfinished(curve: PoseCurve, drive: str, mech: Mechanism) -> str:
    at = curve.nodes[-1].u
    if curve.ended == "stuck":
        return f"the curve over {drive!r} cannot be followed beyond {at:.9g}: several branches meet there, or a corner"
    way = curve.travelled()
    if way.max() > LONGEST:
        slides = mech.coordinate_joint(int(way.argmax()))
        return f"{slides!r} slides without bound as {drive!r} comes to {at:.4g}: give a span that ends before"
    return f"the curve over {drive!r} does not end within {len(curve.nodes)} steps, at {at:.6g}: give a span"


def _sampled(found: list[Followed], n: int) -> tuple[list[CurvePoint], list[CurveSegment]]:
    """Return about n points of each curve, one after another, and the segments of the curves."""
    points: list[CurvePoint] = []
    stretches: list[CurveSegment] = []
    for curve, seen, begins, ends in found:
        sampled = sample(curve, seen, n)
        sampled[:0] = [at_crossing(curve, begins, curve.nodes[0], behind=True)] if begins else []
        sampled += [at_crossing(curve, ends, curve.nodes[-1])] if ends else []
        inputs = [p.u for p in sampled]
        stretches.append(CurveSegment(len(points), len(points) + len(sampled), min(inputs), max(inputs), curve.ended))
        points += sampled
    return points, stretches


def _branch_points(found: list[Followed]) -> tuple[BranchPoint, ...]:
    """Return the branch points of all curves, each once."""
    crossings: list[BranchPoint] = []
    for curve, seen, *_ in found:
        crossings += [b for b in seen.branches.values() if not any(is_same_point(curve, b, c) for c in crossings)]
    columns = found[0].curve.columns
    return tuple(replace(b, directions=b.directions * columns) for b in crossings)


def _result(
    mech: Mechanism,
    moved: Mechanism,
    drive: str,
    held: list[str],
    output: str | None,
    found: list[Followed],
    n: int,
) -> Kinematics:
    points, stretches = _sampled(found, n)
    curve = found[0].curve
    tau, q, u, s, kappa, speed, bend = (
        np.array([getattr(p, name) for p in points]) for name in ("tau", "q", "u", "s", "kappa", "speed", "bend")
    )
    tau *= curve.columns
    angles = np.full(len(q), np.nan)
    if output is not None:
        crossing = np.array([p.sigma == 0 for p in points])
        angles = transmission(mech, curve.system, q, tau, crossing, output)
    return Kinematics(
        mechanism=mech,
        drive=drive,
        held=tuple(held),
        output=output or "",
        unit=str(moved.row_units[-1]),
        u=u,
        s=s,
        q=q,
        tangent=tau,
        curvature=kappa * curve.columns,
        speed=speed,
        bend=bend,
        transmission=angles,
        dead_points=tuple((d.point.u, d.point.q) for f in found for d in f.events.dead),
        branch_points=_branch_points(found),
        stretches=tuple(stretches),
        hidden=tuple(u for f in found for u in f.events.hidden),
        passed=tuple(p for f in found for p in passed_by(mech, f.curve)),
    )
