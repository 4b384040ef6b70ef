"""Kinematics of mechanisms with one freedom: all poses over the range of an input, followed over their arclength."""

from typing import Any

import numpy as np

from ...errors import InputError, StepError, require
from ...mechanism import Mechanism
from ...mechanism.joints import turning
from ...mechanism.manifold import Manifold
from ...system import Array
from .branching import BranchPoint, leave, same
from .curve import Curve, Point
from .driven import Hold, check_freedom, driven
from .result import Kinematics, Stretch
from .sampling import Events, events, sample
from .transmission import default_output, transmission

__all__ = ["kinematics"]

MOST_BRANCHES = 32
BOUNDED = 1e3  # rad or m: an input that is followed further without end needs a span


def kinematics(
    mech: Mechanism,
    drive: str,
    *,
    span: tuple[float, float] | None = None,
    turns: float = 1.0,
    hold: Hold = (),
    points: int = 181,
    q: Array | None = None,
    output: str | None = None,
    branches: bool = False,
) -> Kinematics:
    """Follow the poses of a mechanism with one freedom over an input.

    The curve is followed over its arclength, through dead points of the drive, where the input turns back, and through
    branch points, where it goes on smoothly. It ends where the input leaves its range, or where the first pose comes
    again.

    Args:
        mech: the mechanism; drivers other than the drive stand still where they are at t = 0.
        drive: a joint of one coordinate, or a driver of the mechanism.
        span: the input's range in rad or m; the curve begins at its first value. The start pose, and up to so many
            turns to both sides, when left out.
        turns: full turns of the input, when there is no span.
        hold: joints that stand still, where they are or at values by name; besides the drive, one freedom is left.
        points: about how many poses are returned.
        q: a pose on the branch that is meant, (nq,); the model's start when left out.
        output: a joint whose transmission angle is wanted; when left out, the only other one at the ground.
        branches: follow all branches from branch points on, within the range.

    Raises:
        UnknownNameError: for a joint that does not exist.
        InputError: no freedom is left, or too many (says which to hold); the drive cannot move; the start is a
            singular pose.
        AssemblyError: the loops cannot be closed where the range begins.
        StepError: the loops cannot be closed along the way.

    Example:
        >>> found = kinematics(mbdae.load("four_bar"), "crank", turns=2)   # doctest: +SKIP
    """
    require(mech, Mechanism, "kinematics takes a Mechanism (see mbdae.load)")
    if not (isinstance(points, int) and points >= 2):
        raise InputError(f"points is a number of poses, at least 2, got {points!r}")
    begin = mech.start[0] if q is None else mech.vector("q", q, mech.nq)
    moved = driven(mech, drive, hold, begin)
    system = moved.system()
    first, u = _first(moved, begin, drive, span)
    held = [d.joint or d.name for d in moved.drivers[:-1]]
    check_freedom(moved, system, first, drive, held)
    low, high = _range(u, span, turns, unit=str(moved.row_units[-1]), drive=drive)
    curve = Curve(system, turning(mech.model))
    curve.begin(first, u, None if span is None or span[1] > span[0] else _falling(curve, first, u))
    found = [(curve.follow(low, high), events(curve))]
    if branches:
        found += _others(curve, found[0][1], low, high)
    if curve.ended in ("long", "stuck"):
        raise StepError("newton", _unfinished(curve, drive))
    chosen = default_output(mech, drive, held) if output is None else output
    return _result(mech, moved, drive, held, chosen, found, points)


def _first(moved: Mechanism, q: Array, drive: str, span: tuple[float, float] | None) -> tuple[Array, float]:
    """The closed configuration where the curve begins, and the input there."""
    system = moved.system()
    if span is not None and not (len(span) == 2 and np.isfinite(span).all() and span[0] != span[1]):
        raise InputError(f"span is two different numbers, from and to, got {span!r}")
    u = float(system.closures(q, 0.0)[0][-1]) if span is None else float(span[0])
    if span is not None:  # go there in small steps of the drive, as it would
        here = float(system.closures(q, 0.0)[0][-1])
        for value in np.linspace(here, u, max(2, int(abs(u - here) / 0.2) + 2))[1:-1]:
            try:
                q = moved.assemble(q, t=float(value))[0]
            except Exception:
                break
    return moved.assemble(q, t=u)[0], u


def _falling(curve: Curve, q: Array, u: float) -> Array:
    first = curve.begin(q, u)
    return -first.tau


def _range(u: float, span: tuple[float, float] | None, turns: float, unit: str, drive: str) -> tuple[float, float]:
    if span is not None:
        return min(span), max(span)
    if not (np.isfinite(turns) and turns > 0):
        raise InputError(f"turns must be a positive number, got {turns!r}")
    reach = 2 * np.pi * turns if unit == "rad" else BOUNDED
    return u - reach, u + reach


def _unfinished(curve: Curve, drive: str) -> str:
    at = curve.nodes[-1].u
    if curve.ended == "stuck":
        return f"the curve over {drive!r} cannot be followed beyond {at:.9g}: several branches meet there, or a corner"
    return f"the curve over {drive!r} does not end within {len(curve.nodes)} steps, at {at:.6g}: give a span"


def _others(curve: Curve, found: Events, low: float, high: float) -> list[tuple[Curve, Events]]:
    """Curves along all tangents at branch points that no curve has passed."""
    met: list[BranchPoint] = []
    used: list[set[int]] = []
    out: list[tuple[Curve, Events]] = []

    def pass_by(c: Curve, e: Events) -> None:
        for i, point in e.branches.items():
            k = next((k for k, other in enumerate(met) if same(c, point, other)), len(met))
            if k == len(met):
                met.append(point)
                used.append(set())
            tau = c.nodes[i].tau
            way = int(np.abs(met[k].directions @ tau).argmax())
            used[k] |= {(way, 1), (way, -1)}  # type: ignore[arg-type]

    pass_by(curve, found)
    k = 0
    while k < len(met) and len(out) < MOST_BRANCHES:
        for way, sign in ((w, s) for w in range(len(met[k].directions)) for s in (1, -1)):
            if (way, sign) in used[k]:  # type: ignore[comparison-overlap]
                continue
            used[k].add((way, sign))  # type: ignore[arg-type]
            other = leave(curve, met[k], sign * met[k].directions[way])
            if other is not None and low <= other.nodes[0].u <= high:
                other.follow(low, high)
                seen = events(other)
                out.append((other, seen))
                pass_by(other, seen)
        k += 1
    return out


def _result(
    mech: Mechanism,
    moved: Mechanism,
    drive: str,
    held: list[str],
    output: str | None,
    found: list[tuple[Curve, Events]],
    n: int,
) -> Kinematics:
    points: list[Point] = []
    stretches: list[Stretch] = []
    for curve, seen in found:
        sampled = sample(curve, seen, n)
        inputs = [p.u for p in curve.nodes] + [d.point.u for d in seen.dead]
        stretches.append(Stretch(len(points), len(points) + len(sampled), min(inputs), max(inputs), curve.ended))
        points += sampled
    dead = [d.point for _, seen in found for d in seen.dead]
    crossings: list[BranchPoint] = []
    for curve, seen in found:
        crossings += [b for b in seen.branches.values() if not any(same(curve, b, c) for c in crossings)]
    tau = np.array([p.tau for p in points])
    q = np.array([p.q for p in points])
    system = found[0][0].system
    angles = np.full(len(q), np.nan)
    if output is not None:
        angles = transmission(mech, moved, system, q, tau, output)
    return Kinematics(
        mechanism=mech,
        drive=drive,
        held=tuple(held),
        output=output or "",
        unit=str(moved.row_units[-1]),
        u=np.array([p.u for p in points]),
        s=np.array([p.s for p in points]),
        q=q,
        tangent=tau,
        curvature=np.array([p.kappa for p in points]),
        speed=np.array([p.speed for p in points]),
        bend=np.array([p.bend for p in points]),
        transmission=angles,
        dead_points=tuple((p.u, p.q) for p in dead),
        branch_points=tuple(crossings),
        stretches=tuple(stretches),
        hidden=sum(seen.hidden for _, seen in found),
    )
