"""A run's watch for singular configurations: seen between its steps, leapt over, never left on another branch."""

from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import StepError
from ..mechanism.formulations.index2 import Index2System
from ..system import Array
from .passages import MONITORED_RATIO, Passages
from .singularity_crossing import KNOWN, cross_singularity

if TYPE_CHECKING:
    from .run import RunState
    from .steppers.adaptive import Adaptive

SUSPICIOUS_RATIO = (
    0.6  # of the largest ratio so far: minima above are no singular configurations, stages come near enough
)
SMALL, NOTCH = 0.1, 0.7  # of the largest ratio, of the larger neighbour: it falls to zero linearly, over a step or two
AHEAD = 20.0  # steps: a ratio that would take longer to fall to zero is small for other reasons
CROSSING_RATIO = 0.1  # of the largest ratio: below, a leap is tried
NEXT = 0.5 * KNOWN  # likewise, in rad or m about: below, the place of a singular configuration is not known better
APPROACH = 0.5  # of the way to the singular configuration: the longest step
NEARER = 0.75  # of the way of the leap tried before: how much nearer the next one begins
MET, PATIENCE = 0.5, 2  # of the last one's error: who does not fall to it so often has met the errors of the steps
TRUSTED = 1e3  # times the tolerance: up to where such an error may stand for theirs
MOVED = 100.0  # times the tolerance: how far a leap may end beside the closures
ENDED = 1e-6  # of the largest ratio: velocities at an end as near as that have lost six digits
SINGULAR_RATIO = 1e-3  # of the ratio a step before: so near to a singular configuration is in it
BACK = 0.02  # of the ratio where a leg begins: what it may change by on a way back along which it is a line


def _suspicious(before: Any, here: Any, after: Any, largest: Any) -> Any:
    """Say whether the ratio may vanish around a step: where it is smallest, and small or at the bottom of a notch."""
    lowest = (here < before) & (here <= after) & (here < SUSPICIOUS_RATIO * largest)
    return lowest & ((here < SMALL * largest) | (here < NOTCH * np.maximum(before, after)))


def _falls(before: Any, here: Any) -> Any:
    """Say whether the ratio, going on as over the last step, vanishes within `AHEAD` steps."""
    return AHEAD * (before - here) > here


class SingularityMonitor(Passages):
    """Follows how far the rows of the closures are from depending on each other, step by step.

    The solves of the stages tell: the ratio of their pivots, for nothing. Where it becomes small, a run under control
    of its steps closes its loops, comes nearer in steps that halve the way, and leaps:
    `mbdae.integrate.singularity_crossing`. Where it was smallest between other steps, the smallest pivot is minimised
    on the dense output; what is found is listed.

    Branches that meet in a singular configuration have tangent spaces of their own: behind it the run must move in the
    one it came in, as far as that was turning before.

    Args:
        system: the run's workspace.
        kept: the method keeps positions of closures, by projection or a multiplier.
        control: of the steps of a run that leaps; None for others.
        closing: loops are to be closed where the ratio is small; a multiplier does so by itself.
    """

    def __init__(self, system: Index2System, kept: bool, control: "Adaptive | None", closing: bool) -> None:
        super().__init__(system, kept, control is not None)
        self.control, self.closing, self.newest = control, closing, 1.0
        self.restart(0)

    def restart(self, first: int) -> None:
        """Forces jump at node ``first``: what was before does not continue."""
        self.entered: int | None = None  # the node from which steps came near a singular configuration
        self.tried, self.stalled = (np.inf, np.inf), 0  # way and error of the last leap that was not taken
        self._begin(first)

    def _begin(self, first: int) -> None:
        """Ratios of steps are counted anew from node ``first``."""
        self.first, self.ratios = first, [np.inf]

    def cut(self, run: "RunState") -> None:
        """The run was cut back to its last node: what was found behind it was not passed."""
        self.found = [x for x in self.found if (x.t - run.t) * run.sign <= 0]

    def begin_step(self) -> None:
        """Forget what solves outside of the next step tell."""
        self.system.least_pivot_ratio = 1.0

    def reject_singular_step(self, t: float, y: Array) -> None:
        """Refuse a fixed step that has a stage in a singular configuration, or ends there at (t, y).

        Rounding says where such a stage leads, and no step can begin there.

        Raises:
            StepError: with the time where the step ends.
        """
        nearest = min(float(np.sqrt(self.system.least_pivot_ratio)), self.ratios[-1])
        limit = SINGULAR_RATIO * min(self.largest, self.ratios[-1])
        if nearest < limit or (nearest < SUSPICIOUS_RATIO * self.largest and self._ratio(t, y) < limit):
            raise StepError("rank", f"a step leads into a singular configuration, until t = {t:.17g}")

    def refuse_beginning(self, t: float, y: Array) -> None:
        """Refuse fixed steps from a node (t, y) behind an impact next to a singular configuration: they do not leap.

        Raises:
            StepError: with the time.
        """
        if self.control is None and self.next_to(t, y):
            raise StepError("rank", f"no step of fixed size begins next to a singular configuration, at t = {t:.17g}")

    def next_to(self, t: float, y: Array) -> bool:
        """Say whether a point lies so near to a singular configuration that its place is not known better."""
        return self._ratio(t, y) < NEXT * self.largest

    def limits(self) -> tuple[float, float, float, float, float, float]:
        """Return the largest ratio, the last one, the suspicious, singular and monitored ratios, and `AHEAD`."""
        return self.largest, self.ratios[-1], SUSPICIOUS_RATIO, SINGULAR_RATIO, MONITORED_RATIO, AHEAD

    def quiet(self, least_pivot_ratio: Array) -> int:
        """Pass over steps with nothing to look at, given their smallest ratios of pivots; return how many."""
        new = np.sqrt(least_pivot_ratio)
        if self.entered is not None or not len(new):
            return 0
        largest = np.maximum(np.maximum.accumulate(new), self.largest)
        every = np.concatenate([[0.0], self.ratios[-2:], new])  # before the first step there is none to look at
        earlier, before = every[-len(new) - 2 : -2], every[-len(new) - 1 : -1]
        loud = _suspicious(earlier, before, new, largest) | ((new < MONITORED_RATIO * largest) & _falls(before, new))
        n = int(loud.argmax()) if loud.any() else len(new)
        self.ratios += new[:n].tolist()
        self.largest = float(largest[n - 1]) if n else self.largest
        return n

    def note(self) -> None:
        """Keep what the solves of the step just taken tell: others may follow before it is looked at."""
        self.newest = float(np.sqrt(self.system.least_pivot_ratio))

    def step(self, run: "RunState", last: bool, ends: bool = False) -> None:
        """Look back at the step before the one just taken, and at this one if it is the last.

        Args:
            run: the run.
            last: its span ends here.
            ends: its mode does.

        Raises:
            StepError: for a singular configuration that the run cannot pass, or passed onto another branch; nodes
                behind it are taken off.
        """
        self.ratios.append(self.newest)
        self.largest = max(self.largest, self.ratios[-1])
        self._inspect_step(run, len(self.ratios) - 2)
        if last:
            near = self.ratios[-1] < SUSPICIOUS_RATIO * self.largest
            if near and self._ratio(run.ts[-1], run.ys[-1]) < ENDED * self.largest:
                text = f"at t = {run.ts[-1]:.17g} the run ends in a singular configuration, where rounding decides"
                self.end(run, len(run.ts) - 2, f"{text} velocities and multipliers: the step before is the last")
            self.ratios.append(np.inf)
            self._inspect_step(run, len(self.ratios) - 2)
        before, here = self.ratios[-2:]
        near = here < MONITORED_RATIO * self.largest and (
            _falls(before, here) or (self.entered is not None and here >= before)
        )
        near = near and self._ratio(run.ts[-1], run.ys[-1]) < MONITORED_RATIO * self.largest
        if near:
            if self.entered is None:
                self.entered = len(run.ts) - 2
            if self.control and self.closing and not ends:
                run.close()
        if self.entered is not None and (last or not near):
            self._leave(run)

    def end_leg(self, run: "RunState") -> None:
        """Look at the last step before an impact or a jump.

        Raises:
            StepError: as in `step`.
        """
        self.ratios.append(np.inf)
        self._inspect_step(run, len(self.ratios) - 2)
        if self.entered is not None:
            self._leave(run)

    def _leave(self, run: "RunState") -> None:
        """Go on regularly, on the branch of the node from which steps came near a singular configuration."""
        self.compare(run, self.entered or 0, len(run.ts) - 1)
        self.entered, self.tried, self.stalled = None, (np.inf, np.inf), 0
        if self.control:
            self.control.cap = np.inf

    def cross_if_near(self, run: "RunState") -> bool:
        """Where a singular configuration is near, shorten the next step, or take the leap over it: then say True."""
        begins = len(run.ts) - 1 == self.first
        if self.control is None or (self.entered is None and not begins):
            return False
        self.control.cap = np.inf
        here, way = self._ahead(run, begins)
        if not np.isfinite(way):
            return False
        if self.entered is None:
            self.entered = self.first
        self.control.cap = APPROACH * way
        if here > CROSSING_RATIO * self.largest or way > NEARER * self.tried[0]:
            return False
        found = None
        with suppress(StepError):
            found = cross_singularity(self.workspace, run, way, self.first)
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
        if self._ratio(found.t, found.y) >= (MONITORED_RATIO if run.time_left() else SINGULAR_RATIO) * self.largest:
            self.compare(run, self.entered, len(run.ts) - 1)
            self.entered = None
        return True

    def _ahead(self, run: "RunState", begins: bool) -> tuple[float, float]:
        """Return the ratio at the last node, and the time until it vanishes as it falls; inf where it does not.

        Where a leg begins there is no step before it: the ratio a short way back, at the speed there, serves as well.
        """
        here = self._ratio(run.t, run.ys[-1])
        if not begins:
            dt, before = abs(run.t - run.ts[-2]), self._ratio(run.ts[-2], run.ys[-2])
        else:
            dt, before = float((self.control and self.control.h) or 0.0), np.inf
            if not (dt and here < MONITORED_RATIO * self.largest):
                return here, np.inf
            while abs(before - here) > BACK * here:
                dt /= 2
                before = self._ratio(run.t - run.sign * dt, run.system.add(run.ys[-1], -run.sign * dt * run.F))
        return here, here * dt / (before - here) if here < before else np.inf

    def beside(self, t: float, y: Array) -> bool:
        """Say whether a point lies next to a singular configuration, where a step's end is not to be trusted."""
        return self._ratio(t, y) < CROSSING_RATIO * self.largest

    def along(self, h: float, theta: float) -> Array:
        """Return the point after a share of the leap of size h that was taken last."""
        return self.path(theta * h)

    def _inspect_step(self, run: "RunState", k: int) -> None:
        """Look around step k, counted from 1, whose ratio is in place k."""
        before, here, after = self.ratios[max(0, k - 1) : k + 2] if k else (0.0, 1.0, 0.0)
        if not _suspicious(before, here, after, self.largest):
            return
        nodes = range(max(0, k - 2), min(k + 2, len(run.ts) - self.first))
        self.search(run, [self.first + i for i in nodes])
