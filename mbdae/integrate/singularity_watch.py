"""A run's watch for singular configurations: seen between its steps, leapt over, never left on another branch."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.optimize import minimize_scalar

from ..errors import StepError
from ..mechanism.formulations.index2 import Index2System
from ..mechanism.singularity import Singular, open_limit, singular, tangent, turned, turning
from ..system import Array
from .leap import leap

if TYPE_CHECKING:
    from .run import RunState
    from .steppers.adaptive import Adaptive

SUSPECT = 0.6  # of the largest ratio so far: minima above are no singular configurations, stages come near enough
SMALL, NOTCH = 0.1, 0.7  # of the largest ratio, of the larger neighbour: it falls to zero linearly, over a step or two
ZONE = 0.2  # of the largest ratio: below, loops are closed and steps look ahead where it falls
AHEAD = 20.0  # steps: a ratio that would take longer to fall to zero is small for other reasons
NEAR = 0.1  # likewise: below, a leap is tried
APPROACH = 0.5  # of the way to the singular configuration: the longest step
NEARER = 0.75  # of the way of the leap tried before: how much nearer the next one begins
MET, PATIENCE = 0.5, 2  # of the last one's error: who does not fall to it so often has met the errors of the steps
TRUSTED = 1e3  # times the tolerance: up to where such an error may stand for theirs
MOVED = 100.0  # times the tolerance: how far a leap may end beside the closures
BEND, EXPLAINED = 0.2, 3.0  # rad, and times the turning before: what tangent spaces may differ by
CLOSED = 1e-12  # m or rad: loops open by less, and branches apart by its root, are as good as kept closed
SAMPLES = 5  # of each step
SHARP = 1e-10  # of a step: how sharply a minimum is found
ENDED = 1e-6  # of the largest ratio: velocities at an end as near as that have lost six digits
LANDED = 1e-3  # of the ratio a step before: so near to a singular configuration is in it
SAME = 1e-6  # s: minima this near to each other are one


def _suspicious(before: Any, here: Any, after: Any, largest: Any) -> Any:
    """Say whether the ratio may vanish around a step: where it is smallest, and small or at the bottom of a notch."""
    lowest = (here < before) & (here <= after) & (here < SUSPECT * largest)
    return lowest & ((here < SMALL * largest) | (here < NOTCH * np.maximum(before, after)))


def _falls(before: Any, here: Any) -> Any:
    """Say whether the ratio, going on as over the last step, vanishes within `AHEAD` steps."""
    return AHEAD * (before - here) > here


class SingularWatch:
    """Follows how far the rows of the closures are from depending on each other, step by step.

    The solves of the stages tell: the ratio of their pivots, for nothing. Where it becomes small, a run under control
    of its steps closes its loops, comes nearer in steps that halve the way, and leaps: `mbdae.integrate.leap`. Where
    it was smallest between other steps, the smallest pivot is minimised on the dense output; what is found is listed.

    Branches that meet in a singular configuration have tangent spaces of their own: behind it the run must move in the
    one it came in, as far as that was turning before.

    Args:
        system: the run's workspace.
        kept: the method keeps positions of closures, by projection or a multiplier.
        control: of the steps of a run that leaps; None for others.
        closing: loops are to be closed where the ratio is small; a multiplier does so by itself.
    """

    def __init__(self, system: Index2System, kept: bool, control: "Adaptive | None", closing: bool) -> None:
        self.system, self.kept, self.control, self.closing = system, kept, control, closing
        self._workspace: Index2System | None = None
        self.found: list[Singular] = []
        self.largest = 0.0
        self.restart(0)

    @property
    def workspace(self) -> Index2System:
        """A workspace of the watch's own, made when there is something to look at: what it computes is not counted."""
        if self._workspace is None:
            self._workspace = self.system.twin()
        self._workspace.enter(self.system.mode)
        if self._workspace.in_use != self.system.in_use:
            self._workspace.hold(self.system.in_use)
        return self._workspace

    def _ratio(self, t: float, y: Array) -> float:
        """See `Index2System.pivot_ratio`."""
        return self.workspace.pivot_ratio(t, y)

    def restart(self, first: int) -> None:
        """Forces jump at node ``first``: what was before does not continue."""
        self.entered: int | None = None  # the node from which steps came near a singular configuration
        self.tried, self.stalled = (np.inf, np.inf), 0  # way and error of the last leap that was not taken
        self._begin(first)

    def _begin(self, first: int) -> None:
        """Ratios of steps are counted anew from node ``first``."""
        self.first, self.ratios = first, [np.inf]

    def begin_step(self) -> None:
        """Forget what solves outside of the next step tell."""
        self.system.least_pivot_ratio = 1.0

    def refuse_landing(self, t: float, y: Array) -> None:
        """Refuse a fixed step that has a stage in a singular configuration, or ends there at (t, y).

        Rounding says where such a stage leads, and no step can begin there.

        Raises:
            StepError: with the time where the step ends.
        """
        nearest = min(float(np.sqrt(self.system.least_pivot_ratio)), self.ratios[-1])
        limit = LANDED * min(self.largest, self.ratios[-1])
        if nearest < limit or (nearest < SUSPECT * self.largest and self._ratio(t, y) < limit):
            raise StepError("rank", f"a step leads into a singular configuration, until t = {t:.17g}")

    def limits(self) -> tuple[float, float, float, float, float, float]:
        """Return the largest ratio and the last one, `SUSPECT`, `LANDED`, `ZONE` and `AHEAD`."""
        return self.largest, self.ratios[-1], SUSPECT, LANDED, ZONE, AHEAD

    def quiet(self, least_pivot_ratio: Array) -> int:
        """Pass over steps with nothing to look at, given their smallest ratios of pivots; return how many."""
        new = np.sqrt(least_pivot_ratio)
        if self.entered is not None or not len(new):
            return 0
        largest = np.maximum(np.maximum.accumulate(new), self.largest)
        every = np.concatenate([[0.0], self.ratios[-2:], new])  # before the first step there is none to look at
        earlier, before = every[-len(new) - 2 : -2], every[-len(new) - 1 : -1]
        loud = _suspicious(earlier, before, new, largest) | ((new < ZONE * largest) & _falls(before, new))
        n = int(loud.argmax()) if loud.any() else len(new)
        self.ratios += new[:n].tolist()
        self.largest = float(largest[n - 1]) if n else self.largest
        return n

    def step(self, run: "RunState", last: bool) -> None:
        """Look back at the step before the one just taken, and at this one if it is the last.

        Raises:
            StepError: for a singular configuration that the run cannot pass, or passed onto another branch; nodes
                behind it are taken off.
        """
        self.ratios.append(float(np.sqrt(self.system.least_pivot_ratio)))
        self.largest = max(self.largest, self.ratios[-1])
        self._look(run, len(self.ratios) - 2)
        if last:
            near = self.ratios[-1] < SUSPECT * self.largest
            if near and self._ratio(run.ts[-1], run.ys[-1]) < ENDED * self.largest:
                text = f"at t = {run.ts[-1]:.17g} the run ends in a singular configuration, where rounding decides"
                self._end(run, len(run.ts) - 2, f"{text} velocities and multipliers: the step before is the last")
            self.ratios.append(np.inf)
            self._look(run, len(self.ratios) - 2)
        before, here = self.ratios[-2:]
        near = here < ZONE * self.largest and (_falls(before, here) or (self.entered is not None and here >= before))
        near = near and self._ratio(run.ts[-1], run.ys[-1]) < ZONE * self.largest
        if near:
            if self.entered is None:
                self.entered = len(run.ts) - 2
            if self.control and self.closing:
                run.close()
        if self.entered is not None and (last or not near):
            self._compare(run, self.entered, len(run.ts) - 1)
            self.entered, self.tried, self.stalled = None, (np.inf, np.inf), 0
            if self.control:
                self.control.cap = np.inf

    def leap(self, run: "RunState") -> bool:
        """Where a singular configuration is near, shorten the next step, or take the leap over it: then say True."""
        if self.control is None or self.entered is None or len(run.ts) - 1 == self.first:
            return False
        self.control.cap = np.inf
        (t0, t1), (y0, y1) = run.ts[-2:], (run.ys[-2], run.ys[-1])
        before, here = self._ratio(t0, y0), self._ratio(t1, y1)
        if not here < before:
            return False
        way = here * abs(t1 - t0) / (before - here)
        self.control.cap = APPROACH * way
        if here > NEAR * self.largest or way > NEARER * self.tried[0]:
            return False
        found = None
        with suppress(StepError):
            found = leap(self.workspace, run, way, self.first)
        if found is None:
            self.tried = way, np.inf
            return False
        error, move = (self.control.measure(run, found.y, x) for x in (found.error, found.move))
        self.stalled = self.stalled + 1 if error >= MET * self.tried[1] else 0
        if not (error <= 1 or (self.stalled >= PATIENCE and error <= TRUSTED)) or move > MOVED * max(1.0, error):
            self.tried = way, error
            return False
        self.found.append(found.passed)
        self.path = found.path
        run.land(found.t, found.y, found.t == run.t1)
        self.control.cap, self.control.h = np.inf, APPROACH * way
        self.tried, self.stalled = (np.inf, np.inf), 0
        self._begin(len(run.ts) - 1)
        if self._ratio(found.t, found.y) >= (ZONE if run.to_go() else LANDED) * self.largest:
            self._compare(run, self.entered, len(run.ts) - 1)
            self.entered = None
        return True

    def beside(self, t: float, y: Array) -> bool:
        """Say whether a point lies next to a singular configuration, where a step's end is not to be trusted."""
        return self._ratio(t, y) < NEAR * self.largest

    def along(self, h: float, theta: float) -> Array:
        """Return the point after a share of the leap of size h that was taken last."""
        return self.path(theta * h)

    def _compare(self, run: "RunState", a: int, b: int) -> None:
        """Compare tangent spaces at nodes a and b, before and after a singular configuration that lies between."""
        way = run.ts[b] - run.ts[a]
        passed = next((x for x in self.found if (x.t - run.ts[a]) * way > 0 and (run.ts[b] - x.t) * way > 0), None)
        if not passed:
            return
        ends = [(run.ts[i], run.ys[i]) for i in (a, b)]
        angle = turned(*(tangent(self.workspace, *end) for end in ends))
        explained = EXPLAINED * abs(way) * turning(self.workspace, *ends[0], way)
        if angle > BEND + explained:
            text = f"{passed}: there the run went over to another branch, {angle:.2g} rad beside the one before"
            self._end(run, a, f"{text}; take a smaller rtol, or project=True")

    def _end(self, run: "RunState", i: int, message: str) -> None:
        del run.ts[i + 1 :], run.ys[i + 1 :], run.zs[i + 1 :]
        raise StepError("rank", message)

    def _look(self, run: "RunState", k: int) -> None:
        """Look around step k, counted from 1, whose ratio is in place k."""
        before, here, after = self.ratios[max(0, k - 1) : k + 2] if k else (0.0, 1.0, 0.0)
        if not _suspicious(before, here, after, self.largest):
            return
        nodes = range(max(0, k - 2), min(k + 2, len(run.ts) - self.first))
        self._search(run, [self.first + i for i in nodes])

    def _search(self, run: "RunState", nodes: list[int]) -> None:
        """Minimise over u, node i and the share of the step behind it that has passed."""
        paths = {i: self._path(run, i) for i in nodes[:-1]}

        def at(u: float) -> tuple[float, Array]:
            i = min(int(u), nodes[-2])
            return paths[i](u - i)

        samples = np.linspace(nodes[0], nodes[-1], SAMPLES * len(paths) + 1)
        padded = np.array([np.inf, *(self._ratio(*at(u)) for u in samples), np.inf])
        lowest = np.flatnonzero((padded[1:-1] < padded[:-2]) & (padded[1:-1] <= padded[2:]))
        for k in lowest.tolist():
            bounds = float(samples[max(0, k - 1)]), float(samples[min(k + 1, len(samples) - 1)])
            best = minimize_scalar(
                lambda u: self._ratio(*at(u)), bounds=bounds, method="bounded", options={"xatol": SHARP}
            )
            self._judge(run, nodes, int(best.x), *at(float(best.x)))

    def _judge(self, run: "RunState", nodes: list[int], i: int, t: float, y: Array) -> None:
        """Keep what was found on step i, and end the run there if it cannot pass or took another branch."""
        gap = max(np.abs(self.workspace.residual(run.ts[n], *self.workspace.split(run.ys[n]))[0]).max() for n in nodes)
        limit = open_limit(self.workspace, t, y, self.largest, gap)
        found = singular(self.workspace, t, y, (run.ts[nodes[0]], run.ys[nodes[0]]), limit)
        if found is None or any(abs(found.t - other.t) <= SAME * (1 + abs(t)) for other in self.found):
            return
        self.found.append(found)
        if self.control is None and not self.kept and gap > CLOSED:
            text = f"{found}: a singular configuration, behind which loops that have drifted open by {gap:.1e}"
            self._end(run, i, f"{text} may be on another branch; keep them closed by project=True or formulation 'ggl'")
        self._compare(run, nodes[0], nodes[-1])

    def _path(self, run: "RunState", i: int) -> Callable[[float], tuple[float, Array]]:
        """Theta -> time and point on step i; straight where an end of it is too singular for dense output."""
        t, h, y = run.ts[i], run.ts[i + 1] - run.ts[i], run.ys[i]
        move = self.workspace.difference(y, run.ys[i + 1])
        try:
            dense = run.record().dense(i)
        except StepError:
            dense = partial(self._straight, y, move)
        return lambda theta: (t + theta * h, dense(theta))

    def _straight(self, y: Array, move: Array, theta: float) -> Array:
        return self.workspace.add(y, theta * move)
