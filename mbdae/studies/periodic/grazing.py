"""Grazing of periodic motions: a guard has a double zero, or the speed of an impact vanishes.

Margins are the minima of guards (gaps, speeds) between the events of a motion, and the impulses of its impacts. They
are smooth along a branch until one becomes zero; beyond, the motion has an additional or a missing event, and its map
has a square-root singularity. So the parameter at the zero is extrapolated from one side, from the last few points, as
a polynomial in the margin. Branches end at grazing impacts and user-defined events; they have a corner where a joint
begins to stick; where a multiplier touches its limit, only a higher derivative jumps.
Source: A. B. Nordmark, Non-periodic motion caused by grazing incidence in an impact oscillator, J. Sound Vib. 145
(1991).
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ...discovery import lazy_import
from ...mechanism.hybrid.mode_point import AllRows, ModePoint
from ...mechanism.hybrid.switch import Guard
from ...solution.solution import Solution
from ...system import Array
from ...tolerances import CLOSED, INTERPOLATION, THREE_DIGITS
from .event_margins import ResetMargins
from .result import Bifurcation, BranchMotion, PeriodicMotion

minimize_scalar = lazy_import("scipy.optimize", "minimize_scalar")
FRACTION, IMPACT_FRACTION = 0.9, 0.5  # next step over the distance to a zero; derivatives grow as 1/impulse
EXTRAPOLATION_RANGE, IMPACT_RANGE = INTERPOLATION, THREE_DIGITS  # distance at which a zero is extrapolated
POINTS = 4  # number of points from which the parameter at a zero is extrapolated
KNOWN_TIMES = ("command", "speed step")  # guards that are functions of time
SPEEDS = ("impact", "crossing speed")  # margins that vary with the square root of the parameter
EVENT_KINDS = ("event", "crossing speed", "condition")  # margins of user-defined events


class Margin(NamedTuple):
    """A margin of a motion.

    Attributes:
        name: name of the stop, contact, joint or event.
        kind: ``"impact"``, the kind of the guard, ``"event"``, ``"crossing speed"`` or ``"condition"``.
        value: impulse in N s or N m s; else the value of the guard or signal in its unit.
    """

    name: str
    kind: str
    value: float

    @property
    def terminal(self) -> bool:
        """Whether the branch has no derivative beyond a zero of the margin."""
        return self.kind in ("impact", "contact", *EVENT_KINDS)


class GrazingMonitor:
    """The margins along a branch, and the nearest zero of one of them.

    Args:
        first: the first point.

    Attributes:
        distance: distance to the next zero of a margin, in the unit of steps; infinite if there is none.
        terminal: whether the branch has no derivative beyond the last zero found.
        passing: whether the next step crosses that zero, a corner of the branch.
    """

    def __init__(self, first: BranchMotion) -> None:
        self.last = [(first.value, margins(first.motion))]  # points, at most `POINTS`
        self.distance, self.fraction, self.terminal, self.passing = np.inf, FRACTION, False, False

    def grazing(self, point: BranchMotion, h: float) -> Bifurcation | None:
        """Return the grazing bifurcation close to the end of a step of length h; None if there is none."""
        before, found = self.last[-1][1], margins(point.motion)
        if _kinds(before) != _kinds(found):  # the motions have different events
            self.last, before, self.passing = [], found, False
        self.last = [*self.last[1 - POINTS :], (point.value, found)]
        steps, k = _nearest_zero(before, found)
        self.distance = steps * h
        if k is None or self.passing:
            self.distance = np.inf
            return None
        is_speed = found[k].kind in SPEEDS
        reach, self.fraction = (IMPACT_RANGE, IMPACT_FRACTION) if is_speed else (EXTRAPOLATION_RANGE, FRACTION)
        if self.distance > reach:
            return None
        self.distance, self.terminal, self.passing = np.inf, found[k].terminal, True
        sizes = np.array([margins[k].value for _, margins in self.last])
        value = sum(
            p * float(np.prod(np.delete(sizes, i) / (np.delete(sizes, i) - size)))
            for i, (size, (p, _)) in enumerate(zip(sizes, self.last, strict=True))
        )
        return Bifurcation("grazing", value, point.motion, found[k].name)

    def limit_step(self, h: float) -> float:
        """Return a step size that ends before the nearest zero."""
        return self.fraction * self.distance if self.distance < h else h


def _kinds(found: Sequence[Margin]) -> list[tuple[str, str]]:
    return [(margin.name, margin.kind) for margin in found]


def _nearest_zero(before: Sequence[Margin], after: Sequence[Margin]) -> tuple[float, int | None]:
    """Return the nearest zero beyond a step of the branch, in steps, by a secant, and the index of its margin."""
    pairs = enumerate(zip(before, after, strict=True))
    steps = [(b.value / (a.value - b.value), k) for k, (a, b) in pairs if 0 < b.value < a.value]
    return min(steps, default=(np.inf, None))


class RunStep(NamedTuple):
    """A step of a run, from node i, in a mode."""

    run: Solution
    i: int
    mode: tuple[int, ...]


def margins(motion: PeriodicMotion) -> list[Margin]:
    """Return the margins of a motion: those of impacts, then those of guards between events, in order of time."""
    if not (motion.mechanism.switches or motion.mechanism.resets):
        return []
    impacts = [pair for run in motion.runs for x in run.impacts for pair in zip(x.where, x.impulse, strict=True)]
    out = [Margin(name, "impact", abs(impulse)) for name, impulse in impacts]
    for chain in _chains(motion.runs):
        out += _least_values(motion, chain)
    out += [Margin(*x) for x in ResetMargins(motion.mechanism.system()).at_events(motion.runs)]
    return out


def _chains(runs: Sequence[Solution]) -> list[list[RunStep]]:
    """Return the steps of a period in chains between events, with one mode each; the period is cyclic."""
    out: list[list[RunStep]] = [[]]
    for run, (i, h) in ((x, step) for x in runs for step in enumerate(np.diff(x.nodes[0]))):
        if not h or (out[-1] and run.mode(i) != out[-1][-1].mode):
            out.append([])
        if h:
            out[-1].append(RunStep(run, i, run.mode(i)))
    chains = list(filter(None, out))
    if len(chains) == 1:
        return [[*chains[0], *chains[0][:1]]]
    if chains[0][0].mode == chains[-1][-1].mode:
        chains[0] = chains.pop() + chains[0]
    return chains


def _least_values(motion: PeriodicMotion, chain: list[RunStep]) -> Iterator[Margin]:
    """Yield the least values of guards inside a chain of steps."""
    system, mode, flow = motion.mechanism.system(), chain[0].mode, motion.shooting.flow
    system.enter(mode)
    all_rows, resets = AllRows(system), ResetMargins(system)
    points = [_node(run_step.run, run_step.i) for run_step in chain] + [_node(chain[-1].run, chain[-1].i + 1)]

    def value(guard: Guard, t: float, y: Array) -> float:
        return guard.value(ModePoint(system, all_rows, t, y))

    for guard in [*_monitored(motion, mode), *resets.guards]:
        values = [value(guard, t, y) for t, y in points]
        for j in _lowest(values):

            def dense(x: float, guard: Guard = guard, j: int = j) -> float:
                run_step, t = _time(chain, j, x)
                return value(guard, t, next(iter(run_step.run.points(np.array([t])))))

            run_step, t = _time(chain, j, float(minimize_scalar(dense, bounds=(0.0, 2.0), method="bounded").x))
            start = _node(run_step.run, run_step.i)
            end = flow.run(*start, t - start[0], None).y[-1] if t > start[0] else start[1]
            if guard.kind != "event" or resets.holds(guard.name, t, end):
                yield Margin(guard.name, guard.kind, value(guard, t, end))


def _monitored(motion: PeriodicMotion, mode: tuple[int, ...]) -> list[Guard]:
    guards = [g for s in motion.mechanism.switches for g in s.guards(mode[s.index])]
    return [g for g in guards if g.kind not in KNOWN_TIMES]


def _lowest(values: Sequence[float]) -> list[int]:
    """Return the indices of positive minima between the ends of a sequence."""
    x = np.array(values)
    inside = (x[:-2] > x[1:-1]) & (x[1:-1] <= x[2:]) & (x[1:-1] > CLOSED * x.max())
    return (np.flatnonzero(inside) + 1).tolist()


def _node(run: Solution, i: int) -> tuple[float, Array]:
    return float(run.nodes[0][i]), run.nodes[1][i]


def _time(chain: list[RunStep], j: int, x: float) -> tuple[RunStep, float]:
    """Return the step and the time at a distance x in steps, 0 to 2, from the start of step j - 1."""
    run_step, fraction = (chain[j - 1], x) if x < 1 else (chain[j], x - 1)
    first, last = run_step.run.nodes[0][run_step.i : run_step.i + 2].tolist()
    return run_step, first + fraction * (last - first)
